"""Compares data from outside with the shape that it should have, and says where they differ first.

A shape is a type, ``NUMBER``, a tuple of shapes (any of them), a list of one shape (a list of any length), a list of
more (a list of that length), or a dictionary (an object with at least these keys).
"""
from typing import Any, List, Optional, Tuple

NUMBER = "number"
"""A finite number within ``LARGEST``: one that can be formatted, and be a time."""

LARGEST = 1e11
NAMES = {str: "a text", int: "an integer", bool: "true or false", list: "a list", dict: "an object",
         type(None): "null"}


def mismatch(value: Any, shape: Any) -> str:
    """Return where ``value`` differs from ``shape`` and what is due there, as ``health[2].name is not a text``, or ""."""
    place, text = _differs(value, shape) or ("", "")
    return "{} {}".format(place.lstrip(".") or "it", text) if text else ""


def _differs(value: Any, shape: Any) -> Optional[Tuple[str, str]]:
    if isinstance(shape, tuple):
        found = [_differs(value, each) for each in shape]
        return None if None in found else found[0]
    if isinstance(shape, list):
        return _list_differs(value, shape)
    if isinstance(shape, dict):
        return _object_differs(value, shape)
    if shape is NUMBER:
        is_right = isinstance(value, (int, float)) and not isinstance(value, bool) and abs(value) <= LARGEST
        return None if is_right else ("", "is not a number of a usual size")
    is_right = isinstance(value, shape) and (shape is bool or not isinstance(value, bool))
    return None if is_right else ("", "is not " + NAMES[shape])


def _list_differs(value: Any, shape: List[Any]) -> Optional[Tuple[str, str]]:
    if not isinstance(value, list):
        return "", "is not a list"
    if len(shape) > 1 and len(value) != len(shape):
        return "", "has {} entries, not {}".format(len(value), len(shape))
    for place, entry in enumerate(value):
        found = _differs(entry, shape[place] if len(shape) > 1 else shape[0])
        if found is not None:
            return "[{}]{}".format(place, found[0]), found[1]
    return None


def _object_differs(value: Any, shape: Any) -> Optional[Tuple[str, str]]:
    if not isinstance(value, dict):
        return "", "is not an object"
    for key, inner in shape.items():
        found = _differs(value[key], inner) if key in value else ("", "is missing")
        if found is not None:
            return ".{}{}".format(key, found[0]), found[1]
    return None
