"""Files of ``key value`` lines: the allowed values of each key, and every fault in one pass.

The controller's configuration, the languages and the test package's configuration are such files.
"""
import ipaddress
import math
import os
import re
from dataclasses import dataclass, field, fields
from typing import (Any, Callable, Collection, Dict, Generic, List, Mapping, Optional, Sequence,
                    Tuple, Type, TypeVar)

from behavior_controller.errors import ConfigurationError, Fault
from behavior_controller.text import Source, Unreadable, did_you_mean, read_text

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
Place = Tuple[str, int, int]
"""A file or what else was read, the line and the column."""


# -------------------------------------------------------------------------------------- the readers


@dataclass(frozen=True)
class Reader(Generic[Value]):
    """Parses text into a value. ``allowed`` describes the allowed texts; others raise ValueError.
    """

    allowed: str
    value: Callable[[str], Value]
    is_allowed: Callable[[str], object] = lambda text: True

    def __call__(self, text: str) -> Value:
        """Return the value of ``text``."""
        if not self.is_allowed(text):
            raise ValueError(text)
        return self.value(text)


def some_text(allowed: str, without: str = "") -> Reader[str]:
    """Return a reader of texts that are not empty, and have no character of ``without``."""
    return Reader(allowed, str, lambda text: text and set(text).isdisjoint(without))


boolean = Reader("true or false", lambda text: text.lower() == "true",
                 lambda text: text.lower() in ("true", "false"))
"""Accepts both words in any case."""


def number(
        low: float, high: float = math.inf, infinite: bool = False, of: str = "") -> Reader[float]:
    """Return a reader of numbers from ``low`` to ``high``; only an ``infinite`` one accepts
    ``inf``. ``of``: the unit."""
    def is_allowed(text: str) -> bool:
        return (_NUMBER.fullmatch(text) is not None and low <= float(text) <= high
                and (infinite or not math.isinf(float(text))))

    limits = f", {low:.10g} or more" if math.isinf(high) else f" from {low:.10g} to {high:.10g}"
    return Reader(f"a number{' of ' + of if of else ''}{limits}{', or inf' if infinite else ''}",
                  float, is_allowed)


def seconds(low: float = 0.0) -> Reader[float]:
    """Return a reader of a time of at least ``low`` seconds."""
    return number(low, LONGEST_WAIT, of="seconds")


def integer(low: int, high: int, of: str = "") -> Reader[int]:
    """Return a reader of integers from ``low`` to ``high``. ``of``: the unit."""
    allowed = f"a whole number{' of ' + of if of else ''} from {low} to {high}"
    return Reader(f"{low} or {high}" if high == low + 1 else allowed, int,
                  lambda text: _INTEGER.fullmatch(text) and low <= int(text) <= high)


def port(high: int) -> Reader[int]:
    """Return a reader of a port up to ``high``, or 0."""
    return Reader(f"a port from 1 to {high}, or 0", integer(0, high))


def one_of(*allowed: str) -> Reader[str]:
    """Return a reader of exactly these words."""
    return Reader(f"one of {', '.join(allowed)}", str, allowed.__contains__)


def _is_file_name(text: str) -> bool:
    return re.fullmatch(r"[^/\\\0]+", text) is not None and text not in (".", "..")


def _address(text: str) -> str:
    """Return an address or name; unclear forms are refused.

    The system's resolver reads an empty text, 0 and 0x0 as all addresses.
    """
    labels = text.lower().split(".")
    if ":" in text or re.fullmatch("[0-9]*|0x[0-9a-f]*", labels[-1]):
        return str(ipaddress.ip_address(text))
    are_valid = (re.fullmatch("[0-9a-z_][0-9a-z_-]{0,62}", label) for label in labels)
    if len(text) > 253 or not all(are_valid):
        raise ValueError(text)
    return text


def _folder(text: str) -> str:
    """Return a path with the home folder in place of ``~``, which shells leave in arguments."""
    path = os.path.expanduser(text)
    if path.startswith("~") or "\0" in path:  # no such user
        raise ValueError(text)
    return path


language_name = Reader("the name of a language, such as English", str, _is_file_name)
mission_name = Reader("the name of a mission in the data folder, without .xml",
                      lambda text: text[:-4] if text.endswith(".xml") else text, _is_file_name)
bind_address = Reader("an address or a host name of this computer, 127.0.0.1 for itself alone, "
                      "0.0.0.0 for all networks", _address)
folder = Reader("a folder, nothing, or none", _folder)


# ----------------------------------------------------------------------------------------- the keys


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
        return f"{value:.10g}"
    if type(value) is tuple:
        return ",".join(map(to_text, value))
    return "" if value is None else str(value)


def key(read: Reader[Value], default: Value, meaning: str) -> Value:
    """Declare a field of a dataclass that is a key of a configuration: ``asr_enabled`` is the key
    ``asrEnabled``."""
    return field(metadata={"key": (read, default, meaning)})


def keys_of(record: type) -> Dict[str, Key]:
    """Return the keys of a dataclass by the names of its fields, in order."""
    keys = {}
    for known in fields(record):
        if "key" in known.metadata:
            first, *words = known.name.split("_")
            name = first + "".join(map(str.capitalize, words))
            keys[known.name] = Key(name, *known.metadata["key"])
    return keys


def filled(record: Type[Record], values: Mapping[str, Any], **others: Any) -> Record:
    """Return a dataclass whose fields have the ``values`` of their keys; ``others`` are fields that
    are not keys."""
    return record(**others, **{name: values[key.name] for name, key in keys_of(record).items()})


def values_of(record: object) -> Dict[str, Any]:
    """Return the value of each key of a dataclass that has keys."""
    return {key.name: getattr(record, name) for name, key in keys_of(type(record)).items()}


# ------------------------------------------------------------------------------------------ reading


def collected(source: Source, keys: Sequence[Key], overrides: Optional[Mapping[str, object]] = None,
              arguments: Optional[Mapping[str, str]] = None,
              unused: Collection[str] = ()) -> "Collector":
    """Return what is collected from a file, from overriding ROS parameters, and from ``arguments``,
    which override both; ``unused`` are keys of other programs. Its ``result`` has a value for each
    of ``keys``."""
    reader = Collector(source.file, {key.name: key for key in keys}, unused)
    read_lines(source, reader.faults, reader.line)
    for name, value in (overrides or {}).items():
        # other parameters below our name belong to other programs
        if name in reader.keys or did_you_mean(name, reader.keys):
            reader.given_value(name, value, f"parameter ~{name}")
    for name, text in (arguments or {}).items():
        reader.given_value(name, text, f"argument {name}")
    return reader


def read_source(path: str, what: str, hint: str = "") -> Source:
    """Return a text file that a person writes. Raises ConfigurationError; ``what`` describes the
    file in its text."""
    try:
        return Source(path, read_text(path))
    except Unreadable as error:
        raise ConfigurationError.of(path, f"{what} cannot be read: {error}", hint) from error


def read_lines(source: Source, faults: List[Fault], take: Callable[[int, str], None]) -> None:
    """Call ``take`` with each line of a file and its number. Raises ConfigurationError when there
    are too many ``faults``."""
    for number, line in enumerate(source.text.split("\n"), 1):
        take(number, line)
        if len(faults) > MOST_FAULTS:
            rest = f"more than {MOST_FAULTS} mistakes; the rest is not read"
            raise ConfigurationError(faults[:MOST_FAULTS] + [Fault(source.file, number, 1, rest)])


def parsed(read: Reader[Value], text: str, what: str, place: Place,
           faults: List[Fault]) -> Optional[Value]:
    """Return the value of ``text``, or None and add a fault at ``place``; ``what`` the text is."""
    try:
        return read(text)
    except ValueError:
        value = f'"{text}"' if text else "empty"
        faults.append(Fault(*place, f"{what} cannot be {value}", f"allowed: {read.allowed}"))
        return None


class Collector:
    """Collects values, faults and warnings of one configuration."""

    def __init__(self, path: str, keys: Dict[str, Key], unused: Collection[str] = ()):
        self.path = path
        self.keys = keys
        self.unused = unused
        self.warnings: List[Fault] = []
        self.values: Dict[str, Any] = {}
        self.given: Dict[str, int] = {}
        self.faults: List[Fault] = []

    def line(self, line_number: int, line: str) -> None:
        """Process one line of the file."""
        column = len(line) - len(line.lstrip()) + 1
        content = line.strip()
        name = content[:_NAME_END.search(content).start()]  # type: ignore[union-attr]
        rest = content[len(name):].lstrip()
        rest = rest[1:].lstrip() if rest.startswith("=") else rest
        text = rest[:_COMMENT.search(rest).start()].rstrip()  # type: ignore[union-attr]
        place = self.path, line_number, column
        if not name:
            if content and content[0] != "#":
                self._fault(place, "this is not a line of the form: key value")
        elif name in self.given:
            self._fault(place, f"the key {name} is in line {self.given[name]} already")
        elif self._is_key(name, place):
            begin = column + len(content) - len(rest) if text else column
            self._value(name, text, (self.path, line_number, begin))

    def given_value(self, name: str, value: Any, where: str) -> None:
        """Process a value from a parameter, an argument or a record."""
        place = where, 0, 0
        if not self._is_key(name, place):
            return
        # ROS also has lists, mappings, dates, bytes and null
        if not isinstance(value, (int, float, str)):
            self.given.setdefault(name, 0)
            self._fault(place, f"{name} cannot be of type {type(value).__name__}",
                        f"allowed: {self.keys[name].read.allowed}")
        else:
            self._value(name, str(value).lower() if isinstance(value, bool) else str(value), place)

    def _is_key(self, name: str, place: Place) -> bool:
        """Return whether this is a key; another name is a fault, one of another program a warning.
        """
        if name in self.unused:
            self.warnings.append(Fault(*place, f"{name} has no effect",
                                       "it is a key of release 1.0's own controller", True))
        elif name not in self.keys:
            self._fault(place, f"unknown key {name}", did_you_mean(name, self.keys)
                        or f"the keys: {', '.join(self.keys)}")
        return name in self.keys

    def _value(self, name: str, text: str, place: Place) -> None:
        self.given.setdefault(name, place[1])
        self.values[name] = parsed(self.keys[name].read, text, name, place, self.faults)

    def _fault(self, place: Place, text: str, hint: str = "") -> None:
        self.faults.append(Fault(*place, text, hint))

    def result(self) -> Dict[str, Any]:
        """Return all values. Raises ConfigurationError with every fault: unknown or duplicate key,
        bad value, missing key."""
        for key in self.keys.values():
            if key.default is REQUIRED and key.name not in self.given:
                self._fault((self.path, 0, 0), f"the required key {key.name} is missing",
                            f"add a line: {key.name} <{key.read.allowed}>")
        if self.faults:
            raise ConfigurationError(self.faults)
        return {name: self.values.get(name, key.default) for name, key in self.keys.items()}
