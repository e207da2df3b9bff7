"""Converts values to plain data for JSON and back, by the types of a record's fields.

A record (a NamedTuple or a dataclass) is an object of its fields, a tuple a list, a member of an enumeration its value.
Where several kinds of records are allowed (a Union, or a base class), it is ``[kind, record]``. Data is checked against
these types when it is read.
"""
import dataclasses
import enum
import itertools
import math
from typing import (Any, Callable, Dict, Iterable, List, Literal, NamedTuple, NewType, Sequence, Tuple, Union, cast,
                    get_args, get_origin, get_type_hints)

Count = NewType("Count", int)
"""A whole number from 1 on."""


class Wrong(ValueError):
    """Data from outside is invalid; the text says where and why."""

    def __init__(self, text: str, place: str = ""):
        super().__init__("{} {}".format(place.lstrip(".") or "it", text))
        self.text = text
        self.place = place


class Form(NamedTuple):
    """Writes values of one type as plain data and reads them. ``read`` raises Wrong."""

    write: Callable[[Any], Any]
    read: Callable[[Any], Any]


def inside(place: str, read: Callable[[Any], Any], value: Any) -> Any:
    """Return the part as ``read`` returns it. Raises Wrong with its ``place`` in the whole: ``.name`` or ``[2]``."""
    try:
        return read(value)
    except Wrong as wrong:
        raise Wrong(wrong.text, place + wrong.place) from None


def form(kind: Any) -> Form:
    """Return the form of a type; each is made once."""
    found = _FORMS.get(kind)
    if found is None:
        found = _FORMS[kind] = _made(kind)
    return found


def _made(kind: Any) -> Form:
    origin, inner = get_origin(kind), get_args(kind)
    if origin is Union:
        return _any_of(inner)
    if origin is Literal:
        return _word({word: word for word in inner})
    if origin is not None and (origin is list or inner[1:] == (...,)):
        return _list(origin, form(inner[0]))
    if origin is tuple:
        return _row([form(part) for part in inner])
    if origin is dict:
        return _mapping(form(inner[1]))
    if issubclass(kind, enum.Enum):
        return _word({member.value: member for member in kind})
    if kind.__subclasses__():
        return _any_of(kind.__subclasses__())
    return _record(kind)


def _as_it_is(value: Any) -> Any:
    return value


def _simple(is_right: Callable[[Any], bool], what: str) -> Form:
    def read(value: Any) -> Any:
        if not is_right(value):
            raise Wrong("is not " + what)
        return value
    return Form(_as_it_is, read)


def _is_integer(value: Any) -> bool:
    return isinstance(value, int) and not isinstance(value, bool)


_SIMPLE: Dict[Any, Form] = {
    str: _simple(lambda value: isinstance(value, str), "a text"),
    bool: _simple(lambda value: isinstance(value, bool), "true or false"),
    int: _simple(_is_integer, "an integer"),
    float: _simple(lambda value: _is_integer(value) or isinstance(value, float) and math.isfinite(value), "a number"),
    Count: _simple(lambda value: _is_integer(value) and value > 0, "an integer from 1 on"),
    Any: Form(lambda value: form(cast(Any, type(value))).write(value), _as_it_is),
    type(None): _simple(lambda value: value is None, "null"),
}
_FORMS = dict(_SIMPLE)  # the forms that were made


def _any_of(kinds: Sequence[Any]) -> Form:
    """Return the form of a union: of records, of simple values, or of one of these and None."""
    records = {kind.__name__: form(kind) for kind in kinds if kind not in _SIMPLE}
    *choices, last = [form(kind) for kind in sorted(kinds, key=lambda kind: kind is not type(None)) if kind in _SIMPLE] + (
        [_tagged(records)] if len(records) > 1 else list(records.values()))

    def read(value: Any) -> Any:
        for choice in choices:
            try:
                return choice.read(value)
            except Wrong:
                continue
        return last.read(value)
    return Form(lambda value: last.write(value) if type(value).__name__ in records else value, read)


def _tagged(records: Dict[str, Form]) -> Form:
    def write(value: Any) -> Any:
        kind = type(value).__name__
        return [kind, records[kind].write(value)]

    def read(value: Any) -> Any:
        if not isinstance(value, list) or len(value) != 2:
            raise Wrong("is not a list of kind and record")
        if not isinstance(value[0], str) or value[0] not in records:
            raise Wrong("is not one of {}".format(", ".join(records)), "[0]")
        return inside("[1]", records[value[0]].read, value[1])
    return Form(write, read)


def _word(members: Dict[Any, Any]) -> Form:
    names = {member: word for word, member in members.items()}

    def read(value: Any) -> Any:
        if not isinstance(value, str) or value not in members:
            raise Wrong("is not one of {}".format(", ".join(members)))
        return members[value]
    return Form(names.__getitem__, read)


def _read_each(reads: Iterable[Callable[[Any], Any]], values: List[Any]) -> List[Any]:
    """Read each value; its place is formatted only if it is wrong."""
    found: List[Any] = []
    try:
        for read, value in zip(reads, values):
            found.append(read(value))
    except Wrong as wrong:
        raise Wrong(wrong.text, "[{}]{}".format(len(found), wrong.place)) from None
    return found


def _list(make: Callable[[Any], Any], each: Form) -> Form:
    def read(value: Any) -> Any:
        if not isinstance(value, list):
            raise Wrong("is not a list")
        return make(_read_each(itertools.repeat(each.read), value))
    return Form(lambda value: [each.write(part) for part in value], read)


def _row(parts: Sequence[Form]) -> Form:
    def read(value: Any) -> Tuple[Any, ...]:
        if not isinstance(value, list):
            raise Wrong("is not a list")
        if len(value) != len(parts):
            raise Wrong("has {} entries, not {}".format(len(value), len(parts)))
        return tuple(_read_each((part.read for part in parts), value))
    return Form(lambda value: [part.write(entry) for part, entry in zip(parts, value)], read)


def _mapping(each: Form) -> Form:
    def read(value: Any) -> Dict[str, Any]:
        if not isinstance(value, dict):
            raise Wrong("is not an object")
        return {key: inside("." + key, each.read, part) for key, part in value.items()}
    return Form(lambda value: {key: each.write(part) for key, part in value.items()}, read)


def _record(kind: Any) -> Form:
    assert hasattr(kind, "_fields") or dataclasses.is_dataclass(kind), kind
    fields = [(name, form(hint)) for name, hint in get_type_hints(kind).items()]
    defaults: Dict[str, Any] = getattr(kind, "_field_defaults", {})  # an older release wrote no such field

    def write(value: Any) -> Dict[str, Any]:
        return {name: part.write(getattr(value, name)) for name, part in fields}

    def read(value: Any) -> Any:
        if not isinstance(value, dict):
            raise Wrong("is not an object")
        found: List[Any] = []
        try:
            for name, part in fields:
                if name not in value and name not in defaults:
                    raise Wrong("is missing")
                found.append(part.read(value[name]) if name in value else defaults[name])
        except Wrong as wrong:
            raise Wrong(wrong.text, ".{}{}".format(name, wrong.place)) from None
        return kind(*found)
    return Form(write, read)
