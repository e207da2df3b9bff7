"""Values of the blackboard and how they become one another: text to value, value to text, number to number.

An integer is a Python int (int64), a real a float, a text a str; the three never change into each other silently. A
boolean port gives a bool; stored in an entry it is the int 0 or 1. Rules: BT.CPP's ``convertFromString`` and ``Any``.
"""
import json
import re
from typing import Any, Callable, Dict, NamedTuple, Optional

from behavior_controller.bt.status import BY_NAME
from behavior_controller.errors import BehaviorControllerError

EPSILON = 1.1920929e-07  # of a C++ float: the tolerance of BT.CPP's equality
EXACT = 2 ** 53  # the largest integer that a real holds without loss

ANY = "any"  # no type given: an entry that scripts made, a port that takes anything
BT_ANY = "Any"  # the library's own generic type; as generic as ANY, but scripts treat its empty entries otherwise
TEXT = "string"
GENERIC = (ANY, BT_ANY)

Enums = Dict[str, int]


class ValueFault(BehaviorControllerError):
    """A value cannot be what it should be."""


class ValueType(NamedTuple):
    """A type of ports and entries. ``from_text`` raises ValueFault; None: no conversion from text is known."""

    name: str
    from_text: Optional[Callable[[str, Enums], Any]]
    low: Optional[int] = None
    high: Optional[int] = None
    checked_at_load: bool = True


_INTEGER = re.compile(r"-?\d+")
_REAL = re.compile(r"-?(?:inf(?:inity)?|nan|(?:\d+\.?\d*|\.\d+)(?:e[+-]?\d+)?)", re.IGNORECASE)
_BOOLEANS = {"1": True, "true": True, "TRUE": True, "True": True,
             "0": False, "false": False, "FALSE": False, "False": False}


def _integer_reader(low: int, high: int) -> Callable[[str, Enums], int]:
    def read(text: str, _enums: Enums) -> int:
        match = _INTEGER.match(text)
        if match is None or (low == 0 and text.startswith("-")):
            raise ValueFault("Can't convert string [{}] to integer".format(text))
        digits = match.group()
        if len(digits.lstrip("-0")) > 20 or not low <= int(digits) <= high:
            raise ValueFault("Value out of bound when converting [{}] to integer".format(text))
        return int(digits)
    return read


def real_from_text(text: str, _enums: Optional[Enums] = None) -> float:
    """Return the number at the start of ``text``. Raises ValueFault if there is none."""
    match = _REAL.match(text)
    if match is None:
        raise ValueFault("Can't convert string [{}] to double".format(text))
    return float(match.group())


def _boolean(text: str, _enums: Enums) -> bool:
    if text not in _BOOLEANS:
        raise ValueFault("convertFromString(): invalid bool conversion of [{}]; allowed: 0 1 true false".format(text))
    return _BOOLEANS[text]


def _status(text: str, _enums: Enums) -> Any:
    if text not in BY_NAME:
        raise ValueFault("Cannot convert this to NodeStatus: {}; allowed: {}".format(text, " ".join(BY_NAME)))
    return BY_NAME[text]


def _enumerator(text: str, enums: Enums) -> int:
    if text in enums:
        return enums[text]
    if _INTEGER.fullmatch(text):
        return int(text)
    raise ValueFault("Can't convert string [{}] to an enum; known names: {}".format(text, " ".join(enums) or "none"))


def _vector_reader(item: Callable[[str, Enums], Any]) -> Callable[[str, Enums], Any]:
    def read(text: str, enums: Enums) -> Any:
        if text.startswith("json:"):
            return _from_json(text[5:])
        items = text.split(";")
        if items[-1] == "":
            items.pop()
        return [item(part, enums) for part in items]
    return read


def _from_json(text: str) -> Any:
    try:
        value = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise ValueFault("not valid JSON: {}".format(error)) from error
    if not isinstance(value, list):
        raise ValueFault("a JSON array is expected")
    return value


def _integer_type(name: str, low: int, high: int) -> ValueType:
    return ValueType(name, _integer_reader(low, high), low, high)


INT64 = _integer_reader(-2 ** 63, 2 ** 63 - 1)
TYPES: Dict[str, ValueType] = {value_type.name: value_type for value_type in (
    ValueType(TEXT, lambda text, _enums: text),
    _integer_type("int", -2 ** 31, 2 ** 31 - 1),
    _integer_type("uint", 0, 2 ** 32 - 1),
    _integer_type("int8", -2 ** 7, 2 ** 7 - 1),
    _integer_type("uint8", 0, 2 ** 8 - 1),
    _integer_type("int64", -2 ** 63, 2 ** 63 - 1),
    _integer_type("uint64", 0, 2 ** 64 - 1),
    ValueType("double", real_from_text),
    ValueType("bool", _boolean, 0, 1),
    ValueType("NodeStatus", _status, checked_at_load=False),
    ValueType("enum", _enumerator, checked_at_load=False),
    ValueType("vec_int", _vector_reader(_integer_reader(-2 ** 31, 2 ** 31 - 1))),
    ValueType("vec_double", _vector_reader(real_from_text)),
    ValueType("vec_string", _vector_reader(lambda text, _enums: text)),
    ValueType("vec_bool", _vector_reader(_boolean)),
    ValueType(ANY, None, checked_at_load=False),
    ValueType(BT_ANY, None, checked_at_load=False),
)}


def is_number(value: Any) -> bool:
    """Return whether ``value`` is an integer or a real."""
    return isinstance(value, (int, float))


def origin_of(value: Any) -> str:
    """Return the type that a value has by itself, when no port or entry says otherwise."""
    if isinstance(value, float):
        return "double"
    if isinstance(value, int):
        return "int64"
    return TEXT if isinstance(value, str) else type(value).__name__


def to_text(value: Any) -> str:
    """Return a number or text as BT.CPP writes it: integers plain, reals with six decimals."""
    if isinstance(value, float):
        return "%f" % value
    return str(value)


def to_real(value: Any) -> float:
    """Return a number as a real. Raises ValueFault where that would lose digits, and for anything else."""
    if isinstance(value, float):
        return value
    if isinstance(value, int):
        if not -EXACT <= value <= EXACT:
            raise ValueFault("Loss of precision when converting {} to a real".format(value))
        return float(value)
    raise ValueFault("[Any::convert]: {} is not a number".format(_named(value)))


def to_int(value: Any, low: int = -2 ** 63, high: int = 2 ** 63 - 1) -> int:
    """Return a number as an integer of that range. Raises ValueFault for a fraction and out of range."""
    if isinstance(value, float):
        if value != value or value in (float("inf"), float("-inf")) or value != int(value):
            raise ValueFault("Invalid floating point to integer conversion of {}".format(value))
        value = int(value)
    if not isinstance(value, int):
        raise ValueFault("[Any::convert]: {} is not a number".format(_named(value)))
    if not low <= value <= high:
        raise ValueFault("Value {} is outside {} to {}".format(value, low, high))
    return value


def to_bool(value: Any) -> bool:
    """Return the truth of a script's value: a real other than 0, or the integer 1. Raises ValueFault for the rest."""
    if isinstance(value, float):
        return value != 0.0
    if isinstance(value, int):
        if value not in (0, 1):
            raise ValueFault("Implicit casting to bool is not allowed: {} is neither 0 nor 1".format(value))
        return value == 1
    if value is None:
        raise ValueFault("Any::cast failed because it is empty")
    raise ValueFault("[Any::convert]: no known safe conversion between [{}] and [bool]".format(_named(value)))


def convert(value: Any, wanted: str, enums: Enums) -> Any:
    """Return ``value`` as an input port of type ``wanted`` reads it. Raises ValueFault."""
    if wanted in GENERIC:
        return value
    if wanted == TEXT:
        if isinstance(value, str) or is_number(value):
            return to_text(value)
        raise ValueFault("{} cannot be read as text".format(_named(value)))
    value_type = TYPES[wanted]
    if isinstance(value, str):
        return value_type.from_text(value, enums)  # type: ignore[misc]
    if wanted == "bool":
        return to_bool(value)
    if wanted == "double":
        return to_real(value)
    if value_type.low is not None and value_type.high is not None:
        return to_int(value, value_type.low, value_type.high)
    if wanted == "enum":
        return to_int(value)
    return value


def same_kind(value: Any, stored: Any) -> Any:
    """Return ``value`` in the kind of ``stored`` (BT.CPP ``Any::copyInto``). Raises ValueFault if it cannot be."""
    if stored is None or type(value) is type(stored):
        return value
    if is_number(value) and is_number(stored):
        return to_real(value) if isinstance(stored, float) else to_int(value)
    raise ValueFault("Any::copyInto fails: {} cannot become {}".format(_named(value), _named(stored)))


def _named(value: Any) -> str:
    return {"str": "std::string", "NoneType": "empty"}.get(type(value).__name__, type(value).__name__)
