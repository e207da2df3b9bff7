"""Files of ``key value`` lines: the allowed values of each key, and every fault in one pass.

The controller's configuration, the languages and the test package's configuration are such files.
"""
import ipaddress
import math
import re
from dataclasses import dataclass, field, fields
from typing import Any, Callable, Dict, Generic, Iterable, List, Mapping, Optional, Sequence, Type, TypeVar

from behavior_controller.bt.registry import did_you_mean
from behavior_controller.errors import ConfigurationError, Fault
from behavior_controller.text import Source, Unreadable, read_text

MOST_FAULTS = 100
"""The most mistakes of a file that are reported; the rest of it is not read."""

REQUIRED: Any = object()
"""The default of a key that must be given."""

LONGEST_WAIT = 86400.0
"""The longest time that a configuration may give, in seconds: a day."""

# float() and \d alone would also take "1_0" and the digits of other scripts
_NUMBER = re.compile(r"[-+]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][-+]?[0-9]+)?|[-+]?inf", re.IGNORECASE)
_INTEGER = re.compile(r"-?[0-9]{1,18}")
# each takes linear time
_NAME_END = re.compile(r"[\s=#]|$")
_COMMENT = re.compile(r"(?<!\S)#|$")

Value = TypeVar("Value")
Record = TypeVar("Record")


# ---------------------------------------------------------------------------------------------------------- the readers


@dataclass(frozen=True)
class Reader(Generic[Value]):
    """Parses text into a value. ``allowed`` describes the allowed texts; others raise ValueError."""

    allowed: str
    read: Callable[[str], Value]

    def __call__(self, text: str) -> Value:
        """Return the value of ``text``."""
        return self.read(text)


def _boolean(text: str) -> bool:
    if text.lower() not in ("true", "false"):
        raise ValueError(text)
    return text.lower() == "true"


boolean = Reader("true or false", _boolean)
"""Accepts both words in any case."""


def number(low: float, high: float = math.inf, infinite: bool = False, of: str = "") -> Reader[float]:
    """Return a reader of numbers from ``low`` to ``high``; only an ``infinite`` one accepts ``inf``. ``of``: the unit."""
    def read(text: str) -> float:
        if not _NUMBER.fullmatch(text):
            raise ValueError(text)
        value = float(text)
        if (math.isinf(value) and not infinite) or not low <= value <= high:
            raise ValueError(text)
        return value

    limits = ", {:.10g} or more".format(low) if math.isinf(high) else " from {:.10g} to {:.10g}".format(low, high)
    return Reader("a number{}{}{}".format(" of " + of if of else "", limits, ", or inf" if infinite else ""), read)


def seconds(low: float = 0.0) -> Reader[float]:
    """Return a reader of a time of at least ``low`` seconds."""
    return number(low, LONGEST_WAIT, of="seconds")


def integer(low: int, high: int, of: str = "") -> Reader[int]:
    """Return a reader of integers from ``low`` to ``high``. ``of``: the unit."""
    def read(text: str) -> int:
        if not _INTEGER.fullmatch(text) or not low <= int(text) <= high:
            raise ValueError(text)
        return int(text)

    if high == low + 1:
        return Reader("{} or {}".format(low, high), read)
    return Reader("a whole number{} from {} to {}".format(" of " + of if of else "", low, high), read)


def port(high: int) -> Reader[int]:
    """Return a reader of a port up to ``high``, or 0."""
    return Reader("a port from 1 to {}, or 0".format(high), integer(0, high).read)


def one_of(*allowed: str) -> Reader[str]:
    """Return a reader of exactly these words."""
    def read(text: str) -> str:
        if text not in allowed:
            raise ValueError(text)
        return text
    return Reader("one of {}".format(", ".join(allowed)), read)


def _file_name(text: str) -> str:
    if not re.fullmatch(r"[^/\\\0]+", text) or text in (".", ".."):
        raise ValueError(text)
    return text


def _mission_name(text: str) -> str:
    name = _file_name(text)
    return name[:-4] if name.endswith(".xml") else name


def _address(text: str) -> str:
    """Return an address or name; unclear forms are refused.

    The system's resolver reads an empty text, 0 and 0x0 as all addresses.
    """
    labels = text.lower().split(".")
    if ":" in text or re.fullmatch("[0-9]*|0x[0-9a-f]*", labels[-1]):
        return str(ipaddress.ip_address(text))
    if len(text) > 253 or not all(re.fullmatch("[0-9a-z_][0-9a-z_-]{0,62}", label) for label in labels):
        raise ValueError(text)
    return text


language_name = Reader("the name of a language, such as English", _file_name)
mission_name = Reader("the name of a mission in the data folder, without .xml", _mission_name)
bind_address = Reader("an address or a host name of this computer, 127.0.0.1 for itself alone, 0.0.0.0 for all networks",
                      _address)
folder = Reader("a folder, nothing, or none", str)


# ------------------------------------------------------------------------------------------------------------- the keys


@dataclass(frozen=True)
class Key:
    """One key: its reader, its default, and its meaning.

    In ``meaning``, words of a file are in backquotes, as in the README.
    """

    name: str
    read: Reader[Any]
    default: Any
    meaning: str

    @property
    def allowed(self) -> str:
        """A description of the allowed values."""
        return self.read.allowed

    @property
    def default_text(self) -> str:
        """The default, as the documents show it."""
        return "required" if self.default is REQUIRED else to_text(self.default) or "empty"

    @property
    def plain_meaning(self) -> str:
        """The meaning without Markdown."""
        return self.meaning.replace("`", "")


def to_text(value: object) -> str:
    """Return a value in the form of a configuration file."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, float):
        return "{:.10g}".format(value)
    if type(value) is tuple:
        return ",".join(map(to_text, value))
    return "" if value is None else str(value)


def help_lines(keys: Iterable[Key]) -> List[str]:
    """Return a line for each key, with its name, its default, and its meaning."""
    return ["  {:<26} {:<12} {}".format(key.name, key.default_text, key.plain_meaning) for key in keys]


def key(read: Reader[Value], default: Value, meaning: str) -> Value:
    """Declare a field of a dataclass that is a key of a configuration: ``asr_enabled`` is the key ``asrEnabled``."""
    return field(metadata={"key": (read, default, meaning)})


def keys_of(record: type) -> Dict[str, Key]:
    """Return the keys of a dataclass by the names of its fields, in order."""
    return {each.name: Key(re.sub("_([a-z])", lambda found: found.group(1).upper(), each.name), *each.metadata["key"])
            for each in fields(record) if "key" in each.metadata}


def filled(record: Type[Record], values: Mapping[str, Any], **others: Any) -> Record:
    """Return a dataclass whose fields have the ``values`` of their keys; ``others`` are fields that are not keys."""
    return record(**others, **{name: values[each.name] for name, each in keys_of(record).items()})


def values_of(record: object) -> Dict[str, Any]:
    """Return the value of each key of a dataclass that has keys."""
    return {each.name: getattr(record, name) for name, each in keys_of(type(record)).items()}


# -------------------------------------------------------------------------------------------------------------- reading


def read_configuration(path: str, keys: Sequence[Key], overrides: Optional[Mapping[str, object]] = None,
                       arguments: Optional[Mapping[str, str]] = None) -> Dict[str, Any]:
    """Return a value for each of ``keys`` from a file, overriding ROS parameters, and ``arguments``, which override both.

    Raises ConfigurationError with every fault: unreadable file, unknown or duplicate key, bad value, missing key.
    """
    return configured(read_source(path, "the configuration"), keys, overrides, arguments)


def configured(source: Source, keys: Sequence[Key], overrides: Optional[Mapping[str, object]] = None,
               arguments: Optional[Mapping[str, str]] = None) -> Dict[str, Any]:
    """As ``read_configuration``, for the text of a file."""
    reader = Collector(source.file, {key.name: key for key in keys})
    read_lines(source, reader.faults, reader.line)
    for name, value in (overrides or {}).items():
        reader.override(name, value)
    for name, text in (arguments or {}).items():
        reader.argument(name, text)
    return reader.result()


def read_source(path: str, what: str) -> Source:
    """Return a text file that a person writes. Raises ConfigurationError; ``what`` describes the file in its text."""
    try:
        return Source(path, read_text(path))
    except Unreadable as error:
        raise ConfigurationError([Fault(path, 0, 0, "{} cannot be read: {}".format(what, error))]) from error


def read_lines(source: Source, faults: List[Fault], take: Callable[[int, str], None]) -> None:
    """Call ``take`` with each line of a file and its number. Raises ConfigurationError when there are too many ``faults``."""
    for number, line in enumerate(source.text.split("\n"), 1):
        take(number, line)
        if len(faults) > MOST_FAULTS:
            raise ConfigurationError(faults[:MOST_FAULTS] + [too_many_faults(source.file, number)])


def too_many_faults(path: str, line_number: int) -> Fault:
    """Return the fault that ends the reading of a file."""
    return Fault(path, line_number, 1, "more than {} mistakes; the rest is not read".format(MOST_FAULTS))


class Collector:
    """Collects values and faults of one configuration."""

    def __init__(self, path: str, keys: Dict[str, Key]):
        self.path = path
        self.keys = keys
        self.values: Dict[str, Any] = {}
        self.given: Dict[str, int] = {}
        self.faults: List[Fault] = []

    def line(self, line_number: int, line: str) -> None:
        """Process one line of the file."""
        column = len(line) - len(line.lstrip()) + 1
        content = line.strip()
        name = content[:_NAME_END.search(content).start()]  # type: ignore[union-attr]
        if not name:
            if content and content[0] != "#":
                self._fault(line_number, column, "this is not a line of the form: key value")
            return
        rest = content[len(name):].lstrip()
        rest = rest[1:].lstrip() if rest.startswith("=") else rest
        text = rest[:_COMMENT.search(rest).start()].rstrip()  # type: ignore[union-attr]
        if name not in self.keys:
            self._fault(line_number, column, "unknown key {}".format(name), self._nearest(name))
        elif name in self.given:
            self._fault(line_number, column, "the key {} is in line {} already".format(name, self.given[name]))
        else:
            self.given[name] = line_number
            self._value(name, text, line_number, column + len(content) - len(rest) if text else column)

    def override(self, name: str, value: object) -> None:
        """Process one private ROS parameter."""
        where = "parameter ~{}".format(name)
        if name not in self.keys:
            hint = did_you_mean(name, self.keys)
            if hint:  # other parameters below our name belong to other programs
                self.faults.append(Fault(where, 0, 0, "unknown key {}".format(name), hint))
            return
        self.given_value(name, value, where)

    def given_value(self, name: str, value: Any, where: str) -> None:
        """Process a value from a parameter or a record."""
        self.given.setdefault(name, 0)
        if name not in self.keys:
            self.faults.append(Fault(where, 0, 0, "unknown key {}".format(name)))
        elif not isinstance(value, (int, float, str)):  # ROS also has lists, mappings, dates, bytes and null
            self.faults.append(Fault(where, 0, 0, "{} cannot be of type {}".format(name, type(value).__name__),
                                     "allowed: {}".format(self.keys[name].allowed)))
        else:
            self._value(name, str(value).lower() if isinstance(value, bool) else str(value), 0, 0, where)

    def argument(self, name: str, text: str) -> None:
        """Process one argument of the command line."""
        where = "argument {}".format(name)
        if name in self.keys:
            self.given.setdefault(name, 0)
            self._value(name, text, 0, 0, where)
        else:
            self.faults.append(Fault(where, 0, 0, "unknown key {}".format(name), self._nearest(name)))

    def _nearest(self, name: str) -> str:
        return did_you_mean(name, self.keys) or "the keys: {}".format(", ".join(self.keys))

    def _value(self, name: str, text: str, line_number: int, column: int, where: str = "") -> None:
        key = self.keys[name]
        try:
            self.values[name] = key.read(text)
        except ValueError:
            self.faults.append(Fault(where or self.path, line_number, column, "{} cannot be {}".format(
                name, "\"{}\"".format(text) if text else "empty"), "allowed: {}".format(key.allowed)))

    def _fault(self, line_number: int, column: int, text: str, hint: str = "") -> None:
        self.faults.append(Fault(self.path, line_number, column, text, hint))

    def result(self) -> Dict[str, Any]:
        """Return all values, or raise ConfigurationError."""
        for key in self.keys.values():
            if key.default is REQUIRED and key.name not in self.given:
                self.faults.append(Fault(self.path, 0, 0, "the required key {} is missing".format(key.name),
                                         "add a line: {} <{}>".format(key.name, key.allowed)))
        if self.faults:
            raise ConfigurationError(self.faults)
        return {name: self.values.get(name, key.default) for name, key in self.keys.items()}
