"""Values of the blackboard and how they become one another: text to value, value to text, number to
number.

An integer is a Python int (int64), a real a float, a text a str; the three never change into each
other silently. A boolean or status that is stored becomes an int, as an entry holds it; a port of
that type reads it back as what it was. Digits are 0 to 9 alone. Rules: BT.CPP's
``convertFromString`` and ``Any`` (sections 9.1, 9.4 and 9.5).
"""
import math
import re
from functools import lru_cache, partial
from itertools import starmap
from typing import Any, Callable, Dict, List, NamedTuple, Optional, Tuple, Union

import msgspec

from behavior_controller.bt.values.status import BY_NAME, NAMES, NUMBERS
from behavior_controller.errors import BehaviorControllerError
from behavior_controller.foreign_code import described
from behavior_controller.text import clean

EPSILON = 1.1920929e-07  # of a C++ float: the tolerance of BT.CPP's equality
INT = (-2 ** 31, 2 ** 31 - 1)
INT64 = (-2 ** 63, 2 ** 63 - 1)
EXACT = 2 ** 53  # every integer nearer to 0 is a real without loss

ANY = "any"  # no type given: an entry that scripts made, a port that takes anything
# the library's own generic type; as generic as ANY, but scripts treat its empty entries otherwise
BT_ANY = "Any"
TEXT = "string"
GENERIC = (ANY, BT_ANY)

Enums = Dict[str, int]


class ValueFault(BehaviorControllerError):
    """A value cannot be what it should be."""


class ValueType(NamedTuple):
    """A type of ports and entries. ``from_text`` raises ValueFault.

    ``number`` is the pattern of a number as BT.CPP reads it: what follows it in a text is passed
    over.
    """

    name: str
    from_text: Callable[[str, Enums], Any]
    limits: Optional[Tuple[int, int]] = None  # the lowest and highest value of an integer
    checked_at_load: bool = True
    number: Optional["re.Pattern[str]"] = None
    python: Optional[type] = None  # the class of its values, if it is a PortType
    cpp_name: str = ""  # in palettes, if BehaviorTree.CPP calls it otherwise


_INTEGER = re.compile(r"(-?)0*([0-9]+)")  # the second group has no leading zero but the last digit
_REAL = re.compile(r"-?(?:inf(?:inity)?|nan|(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:e[+-]?[0-9]+)?)",
                   re.IGNORECASE | re.ASCII)
_BLANKS = re.compile(r"[ \t\r\n]+")
# and a sign: one more than of an integer of 64 bits is out of range; Python refuses to read 4,300
_MOST_DIGITS = 21
_TRUE, _FALSE = ("1", "true", "TRUE", "True"), ("0", "false", "FALSE", "False")


def shown(text: str) -> str:
    """Return ``text`` as a message quotes it: on one line, not too long, and what cannot be seen as
    its escape."""
    return clean(_BLANKS.sub(" ", text), 80)


@lru_cache(maxsize=1000)  # a literal at a port is read at each tick
def _integer(text: str, low: int, high: int) -> int:
    match = _INTEGER.match(text)
    if match is None or (low == 0 and match.group(1)):
        raise ValueFault(f"Can't convert string [{shown(text)}] to integer")
    return _in_range(match, low, high)


def _in_range(match: Any, low: int, high: int) -> int:
    value = int("".join(match.groups())[:_MOST_DIGITS])
    if not low <= value <= high:
        wrong = f"Value out of bound when converting [{shown(match.string)}] to integer"
        raise ValueFault(f"{wrong}: {low} to {high} is allowed")
    return value


def whole_integer(text: str, low: int, high: int) -> Optional[int]:
    """Return the integer that ``text`` is as a whole, or None if it is none or not in that range.
    """
    match = _INTEGER.fullmatch(text)
    try:
        return match and _in_range(match, low, high)
    except ValueFault:
        return None


def real_from_text(text: str, _enums: Optional[Enums] = None) -> float:
    """Return the number at the start of ``text``. Raises ValueFault if there is none, or one too
    large for a real."""
    match = _REAL.match(text)
    if match is None:
        raise ValueFault(f"Can't convert string [{shown(text)}] to double")
    value = float(match.group())
    if math.isinf(value) and match.group()[-1] in "0123456789.":
        raise ValueFault(f"Value out of bound when converting [{shown(text)}] to double")
    return value


def whole_real(text: str) -> Optional[float]:
    """Return the number that ``text`` is as a whole, or None."""
    try:
        return real_from_text(text) if _REAL.fullmatch(text) else None
    except ValueFault:
        return None


def _text(text: str, _enums: Enums) -> str:
    return text


def _boolean(text: str, _enums: Enums) -> bool:
    if text not in _TRUE + _FALSE:
        wrong = f"convertFromString(): invalid bool conversion of [{shown(text)}]"
        raise ValueFault(f"{wrong}; allowed: 0 1 true false")
    return text in _TRUE


def _status(text: str, _enums: Enums) -> Any:
    if text not in BY_NAME:
        wrong = f"Cannot convert this to NodeStatus: {shown(text)}"
        raise ValueFault(f"{wrong}; allowed: {' '.join(BY_NAME)}")
    return BY_NAME[text]


def _enumerator(text: str, enums: Enums) -> int:
    if text in enums:
        return enums[text]
    number = whole_integer(text, *INT)
    if number is None:
        names = " ".join(enums) or "none"
        raise ValueFault(f"Can't convert string [{shown(text)}] to an enum; known names: {names}")
    return number


def _vector_type(name: str, item: str) -> ValueType:
    def read(text: str, enums: Enums) -> Any:
        if text.startswith("json:"):
            return _from_json(text[5:], item)
        return [TYPES[item].from_text(part, enums) for part in items_of(text)]
    return ValueType(name, read, cpp_name=f"std::vector<{'std::string' if item == TEXT else item}>")


def items_of(text: str) -> List[str]:
    """Return what ``;`` separates; nothing is meant after the last one."""
    items = text.split(";")
    if not items[-1]:
        items.pop()
    return items


def _from_json(text: str, item: str) -> List[Any]:
    """Return the items of a JSON array; a JSON number may lack the point that a real has here."""
    try:
        values = msgspec.json.decode(text, type=_JSON_TYPES[item])
    except (msgspec.DecodeError, ValueError, RecursionError) as error:
        raise ValueFault(f"not a JSON array of items of type {item}: {error}") from error
    return [declared(value, item) for value in values]


VECTORS = {"vec_int": "int", "vec_double": "double", "vec_string": TEXT, "vec_bool": "bool"}
_CLASSES = {"int": int, "double": float, TEXT: str, "bool": bool}
_JSON_TYPES = {"int": List[int], "double": List[Union[int, float]], TEXT: List[str],
               "bool": List[bool]}


def _integer_type(name: str, low: int, high: int, cpp_name: str = "") -> ValueType:
    return ValueType(name, lambda text, _enums: _integer(text, low, high), (low, high),
                     number=_INTEGER, cpp_name=cpp_name)


class _Types(Dict[str, ValueType]):
    """The types that there are by name. A PortType is found too: it knows itself what it is."""

    def __missing__(self, name: str) -> ValueType:
        if isinstance(name, PortType):
            return name.value_type
        raise KeyError(name)


class PortType(str):
    """A type of your own for ports: ``Port("target", PortType("Spot", Spot, spot))``. It is its
    name."""

    value_type: ValueType

    def __new__(cls, name: str, python: type,
                from_text: Optional[Callable[[str], Any]] = None) -> "PortType":
        """Return the type ``name``, whose values are of the class ``python``. Raises ValueError if
        the name is taken.

        ``from_text`` reads what stands in a file; what it raises says what is wrong with the text.
        Without it only an entry can hold a value.
        """
        if name in TYPES:
            raise ValueError(f"{name} is a type of the engine; give yours another name")
        made = super().__new__(cls, name)
        made.value_type = ValueType(name, partial(_own, name, python, from_text), python=python)
        return made


def _own(name: str, python: type, from_text: Optional[Callable[[str], Any]], text: str,
         _enums: Enums) -> Any:
    """Return a text as a value of the PortType ``name``. Raises ValueFault."""
    if from_text is None:
        raise ValueFault(f"a value of type {name} has no text; only an {{entry}} can hold it")
    try:
        value = from_text(text)
    except ValueFault:
        raise
    # a wrong text or a mistake in the converter: both are reported at the place of the text
    except BaseException as error:
        raise ValueFault(
            f"Can't convert string [{shown(text)}] to {name}: {described(error)}") from error
    if not isinstance(value, python):
        wrong = f"the converter of {name} returned {value!r} for [{shown(text)}]"
        raise ValueFault(f"{wrong}, which is not a {python.__name__}")
    return value


TYPES: Dict[str, ValueType] = _Types((value_type.name, value_type) for value_type in (
    ValueType(TEXT, _text, cpp_name="std::string"),
    _integer_type("int", *INT),
    _integer_type("uint", 0, 2 ** 32 - 1, "unsigned int"),
    _integer_type("int8", -2 ** 7, 2 ** 7 - 1, "signed char"),
    _integer_type("uint8", 0, 2 ** 8 - 1, "unsigned char"),
    _integer_type("int64", *INT64, "long"),
    _integer_type("uint64", 0, 2 ** 64 - 1, "unsigned long"),
    ValueType("double", real_from_text, number=_REAL),
    ValueType("bool", _boolean),
    ValueType("NodeStatus", _status, checked_at_load=False, cpp_name="BT::NodeStatus"),
    ValueType("enum", _enumerator, checked_at_load=False),
    *starmap(_vector_type, VECTORS.items()),
    ValueType(ANY, _text, cpp_name="BT::AnyTypeAllowed"),
    ValueType(BT_ANY, _text, cpp_name="BT::Any")))


def find_type(name: str) -> Optional[ValueType]:
    """Return the type of that name; None for an entry that the host made of a class of its own."""
    return TYPES.get(name, getattr(name, "value_type", None))


def unread(text: str, type_name: str) -> str:
    """Return what a reader of numbers passes over at the end of ``text``, or of the first such item
    of a vector."""
    if text.startswith("json:"):
        return ""
    if type_name in VECTORS:
        rests = (unread(item, VECTORS[type_name]) for item in text.split(";"))
        return next(filter(None, rests), "")
    number = TYPES[type_name].number
    match = number and number.match(text)
    return text[match.end():].strip() if match else ""


_STATUSES = list(NAMES)  # by their numbers
_STATUS_CLASSES = {type(status) for status in NAMES}


def stored(value: Any) -> Any:
    """Return ``value`` as an entry holds it: a boolean and a status are integers."""
    if isinstance(value, bool):
        return int(value)
    if type(value) in _STATUS_CLASSES:
        return NUMBERS[value]
    return value


def is_vector(value: Any, wanted: str) -> bool:
    """Return whether ``value`` is a list of the items that the vector type ``wanted`` has."""
    return (wanted in VECTORS and isinstance(value, list)
            and all(type(item) is _CLASSES[VECTORS[wanted]] for item in value))


def is_number(value: Any) -> bool:
    """Return whether ``value`` is an integer or a real."""
    return isinstance(value, (int, float))


def origin_of(value: Any) -> str:
    """Return the type that a value has by itself, when no port or entry says otherwise."""
    if isinstance(value, float):
        return "double"
    if isinstance(value, int):
        return "int64"
    if isinstance(value, str):
        return TEXT
    return type(value).__name__


def to_text(value: Any) -> str:
    """Return a number or text as BT.CPP writes it: integers plain, reals with six decimals."""
    if isinstance(value, float):
        return "%f" % value
    return str(value)


def to_real(value: Any) -> float:
    """Return a number as a real. Raises ValueFault where that would lose digits, and for anything
    else."""
    if isinstance(value, float):
        return value
    if isinstance(value, int):
        if not -EXACT < value < EXACT:
            raise ValueFault(f"Loss of precision when converting {value} to a real")
        return float(value)
    raise ValueFault(f"[Any::convert]: {_named(value)} is not a number")


def to_int(value: Any, low: int = INT64[0], high: int = INT64[1]) -> int:
    """Return a number as an integer of that range. Raises ValueFault for a fraction and out of
    range."""
    if isinstance(value, float):
        if not value.is_integer():
            raise ValueFault(f"Invalid floating point to integer conversion of {value}")
        value = int(value)
    if not isinstance(value, int):
        raise ValueFault(f"[Any::convert]: {_named(value)} is not a number")
    if not low <= value <= high:
        raise ValueFault(f"Value {value} is outside {low} to {high}")
    return value


def to_bool(value: Any) -> bool:
    """Return the truth of a script's value: a positive real, or the integer 1, is true. Raises
    ValueFault for negative numbers, other integers, and what is no number."""
    if isinstance(value, float):
        if value < 0.0:
            raise ValueFault(f"Implicit casting to bool is not allowed: {value} is negative")
        return value != 0.0
    if isinstance(value, int):
        if value not in (0, 1):
            raise ValueFault(f"Implicit casting to bool is not allowed: {value} is neither 0 nor 1")
        return value == 1
    if value is None:
        raise ValueFault("Any::cast failed because it is empty")
    raise _no_conversion(value, "bool")


def convert(value: Any, wanted: str, enums: Enums) -> Any:
    """Return a stored ``value`` as an input port of type ``wanted`` reads it. Raises ValueFault."""
    if wanted in GENERIC:
        return value
    if wanted == TEXT:
        if isinstance(value, (str, int, float)):
            return to_text(value)
        raise _no_conversion(value, "std::string")
    if isinstance(value, str):
        return TYPES[wanted].from_text(value, enums)
    python = TYPES[wanted].python
    if wanted in VECTORS or python is not None:
        if not is_vector(value, wanted) and (python is None or not isinstance(value, python)):
            raise _no_conversion(value, wanted)
        return value
    if wanted == "bool":
        return to_bool(value)
    if wanted == "double":
        return to_real(value)
    if wanted == "NodeStatus":
        return _STATUSES[to_int(value, 0, len(_STATUSES) - 1)]
    return to_int(value, *(TYPES[wanted].limits or INT))


def _no_conversion(value: Any, wanted: str) -> ValueFault:
    return ValueFault(
        f"[Any::convert]: no known safe conversion between [{_named(value)}] and [{wanted}]")


def declared(value: Any, wanted: str) -> Any:
    """Return what a leaf writes as its port of type ``wanted`` has it: 3 is a real there. Raises
    ValueFault."""
    if wanted in GENERIC:
        return value
    if isinstance(value, str) is not (wanted == TEXT):
        raise _no_conversion(value, wanted)
    if wanted in VECTORS and isinstance(value, list):
        return [declared(item, VECTORS[wanted]) for item in value]
    return convert(stored(value), wanted, {})


def same_kind(value: Any, stored: Any) -> Any:
    """Return ``value`` in the kind of ``stored`` (BT.CPP ``Any::copyInto``). Raises ValueFault if
    it cannot be."""
    if stored is None or type(value) is type(stored):
        return value
    if is_number(value) and is_number(stored):
        return to_real(value) if isinstance(stored, float) else to_int(value)
    raise ValueFault(f"Any::copyInto fails: {_named(value)} cannot become {_named(stored)}")


def _named(value: Any) -> str:
    name = type(value).__name__
    return {"str": "std::string", "NoneType": "empty"}.get(name, name)
