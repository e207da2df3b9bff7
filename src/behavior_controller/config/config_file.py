"""Reads the files that a person writes line by line, with every fault in one pass, and declares
the keys of a configuration with their allowed values.

The configurations and the languages have lines of the form ``key value``; the recovery policy and
the knowledge files have lines of several words.
"""
import ipaddress
import math
import os
import re
from dataclasses import dataclass, field, fields
from typing import (Any, Callable, Collection, Dict, Generic, Iterator, List, Mapping, Match,
                    Optional, Pattern, Sequence, Tuple, Type, TypeVar)

from behavior_controller.errors import ConfigurationError, Fault
from behavior_controller.text import Source, Unreadable, did_you_mean, joined, read_text

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
_WORD = re.compile(r"\S+")
_KEY = re.compile(r"\s*([^\s=#]*)\s*=?\s*")
_COMMENT = re.compile(r"(?<!\S)#|$")
COMMENT_LINE = re.compile(r"\A\s*#|\Z")
"""Finds where a comment that has a line of its own begins, or else the end of the text."""

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

    limits = f" from {low:.10g} to {high:.10g}"
    if math.isinf(high):
        limits = f", {low:.10g} or more"
    if infinite:
        limits += ", or inf"
    return Reader(joined(" of ", "a number", of) + limits, float, is_allowed)


def seconds(low: float = 0.0) -> Reader[float]:
    """Return a reader of a time of at least ``low`` seconds."""
    return number(low, LONGEST_WAIT, of="seconds")


def integer(low: int, high: int, of: str = "") -> Reader[int]:
    """Return a reader of integers from ``low`` to ``high``. ``of``: the unit."""
    allowed = joined(" of ", "a whole number", of) + f" from {low} to {high}"
    if high == low + 1:
        allowed = f"{low} or {high}"
    return Reader(allowed, int, lambda text: _INTEGER.fullmatch(text) and low <= int(text) <= high)


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
                      lambda text: re.sub(r"\.xml\Z", "", text), _is_file_name)
bind_address = Reader("an address or a host name of this computer, 127.0.0.1 for itself alone, "
                      "0.0.0.0 for all networks", _address)
folder = Reader("a folder, nothing, or none", _folder)
namespace = Reader("a ROS name such as robot1 (a letter, then letters, digits and _; / between two "
                   "names), or nothing", lambda text: text.lstrip("/"),
                   re.compile(r"(/?[A-Za-z]\w*(/[A-Za-z]\w*)*)?", re.ASCII).fullmatch)


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
        if self.default is REQUIRED:
            return "required"
        return to_text(self.default) or "empty"

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
    if value is None:
        return ""
    return str(value)


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


def read_source(path: str, what: str, hint: str = "") -> Source:
    """Return a text file that a person writes. Raises ConfigurationError; ``what`` describes the
    file in its text."""
    try:
        return Source(path, read_text(path))
    except Unreadable as error:
        raise ConfigurationError.of(path, f"{what} cannot be read: {error}", hint) from error


class TextLine:
    """A line of a file without its comment, in words; the first word is its key."""

    def __init__(self, file: str, number: int, text: str, comment: Pattern[str]):
        self.file, self.number = file, number
        self.text = text[:comment.search(text).start()].rstrip()  # type: ignore[union-attr]
        self.words = list(_WORD.finditer(self.text))

    @property
    def key(self) -> str:
        """The first word."""
        return self.words[0].group()

    def place(self, index: int = 0) -> Place:
        """Return the place of the word at ``index``, or of the key if there is no such word."""
        word = (self.words[index:] or self.words)[0]
        return self.file, self.number, word.start() + 1

    def rest(self, index: int) -> str:
        """Return the text from the word at ``index`` to the end of the line."""
        return next((self.text[word.start():] for word in self.words[index:]), "")


def lines_of(source: Source, comment: Pattern[str] = COMMENT_LINE) -> Iterator[TextLine]:
    """Yield the lines that have words; ``comment`` finds where a comment begins."""
    for number, text in enumerate(source.text.split("\n"), 1):
        line = TextLine(source.file, number, text, comment)
        if line.words:
            yield line


class LineReader:
    """Reads a file line by line and collects its values, and all faults and warnings.

    ``values`` and ``lines`` are those of each entry: its value, and the number of its first line.
    """

    comment = COMMENT_LINE

    def __init__(self, source: Source):
        self.source = source
        self.values: Dict[str, Any] = {}
        self.lines: Dict[str, int] = {}
        self.faults: List[Fault] = []
        self.warnings: List[Fault] = []

    def read(self) -> None:
        """Read all lines. Raises ConfigurationError when there are too many faults."""
        for line in lines_of(self.source, self.comment):
            self.line(line)
            if len(self.faults) > MOST_FAULTS:
                del self.faults[MOST_FAULTS:]
                self.fault((line.file, line.number, 1),
                           f"more than {MOST_FAULTS} mistakes; the rest is not read")
                raise ConfigurationError(self.faults)
        self.finish()

    def finish(self) -> None:
        """Check what needs several lines, and add faults for missing ones."""

    def line(self, line: TextLine) -> None:
        """Process one line that has words."""
        raise NotImplementedError

    def fault(self, place: Optional[Place], text: str, hint: str = "",
              is_warning: bool = False) -> None:
        """Add a fault or a warning; without a place it is about the whole file."""
        found = self.warnings if is_warning else self.faults
        found.append(Fault(*place or (self.source.file, 0, 0), text, hint, is_warning))

    def parsed(self, read: Reader[Value], text: str, what: str, place: Place) -> Optional[Value]:
        """Return the value of ``text``, or None and add a fault; ``what`` the text is."""
        try:
            return read(text)
        except ValueError:
            value = f'"{text}"' if text else "empty"
            self.fault(place, f"{what} cannot be {value}", f"allowed: {read.allowed}")
            return None

    def require(self, key: str, form: str) -> None:
        """Add a fault if there is no entry of that name; ``form`` are the values it would have."""
        if key not in self.lines:
            self.fault(None, f"the required key {key} is missing", f"add a line: {key} {form}")


class KeyReader(LineReader):
    """Reads lines of the form ``key value`` or ``key = value``, and values from elsewhere;
    ``unused`` are keys of other programs."""

    def __init__(self, source: Source, keys: Sequence[Key], unused: Collection[str] = ()):
        super().__init__(source)
        self.keys = {key.name: key for key in keys}
        self.unused = unused

    def line(self, line: TextLine) -> None:
        """Process one line of the file."""
        start: Match[str] = _KEY.match(line.text)  # type: ignore[assignment]
        name, rest, place = start[1], line.text[start.end():], line.place()
        text = rest[:_COMMENT.search(rest).start()].rstrip()  # type: ignore[union-attr]
        if not name:
            self.fault(place, "this is not a line of the form: key value")
        elif name in self.lines:
            self.fault(place, f"the key {name} is in line {self.lines[name]} already")
        elif self._is_key(name, place):
            if text:
                place = line.file, line.number, start.end() + 1
            self._value(name, text, place)

    def given(self, name: str, value: Any, where: str) -> None:
        """Process a value from a parameter, an argument or a record."""
        place = where, 0, 0
        if not self._is_key(name, place):
            return
        # ROS also has lists, mappings, dates, bytes and null
        if not isinstance(value, (int, float, str)):
            self.lines.setdefault(name, 0)
            self.fault(place, f"{name} cannot be of type {type(value).__name__}",
                       f"allowed: {self.keys[name].read.allowed}")
        else:
            self._value(name, str(value).lower() if isinstance(value, bool) else str(value), place)

    def _is_key(self, name: str, place: Place) -> bool:
        """Return whether this is a key; another name is a fault, one of another program a warning.
        """
        if name in self.unused:
            self.fault(place, f"{name} has no effect",
                       "it is a key of the release's own controller", True)
        elif name not in self.keys:
            self.fault(place, f"unknown key {name}", did_you_mean(name, self.keys)
                       or f"the keys: {', '.join(self.keys)}")
        return name in self.keys

    def _value(self, name: str, text: str, place: Place) -> None:
        self.lines.setdefault(name, place[1])
        self.values[name] = self.parsed(self.keys[name].read, text, name, place)

    def result(self) -> Dict[str, Any]:
        """Return all values. Raises ConfigurationError with every fault: unknown or duplicate key,
        bad value, missing key."""
        for key in self.keys.values():
            if key.default is REQUIRED:
                self.require(key.name, f"<{key.read.allowed}>")
        ConfigurationError.raise_any(self.faults)
        return {name: self.values.get(name, key.default) for name, key in self.keys.items()}


def collected(source: Source, keys: Sequence[Key], overrides: Mapping[str, object] = {},
              arguments: Mapping[str, str] = {}, unused: Collection[str] = ()) -> KeyReader:
    """Return what is collected from a file, from overriding ROS parameters, and from ``arguments``,
    which override both."""
    reader = KeyReader(source, keys, unused)
    reader.read()
    for name, value in overrides.items():
        # other parameters below our name belong to other programs
        if name in reader.keys or did_you_mean(name, reader.keys):
            reader.given(name, value, f"parameter ~{name}")
    for name, text in arguments.items():
        reader.given(name, text, f"argument {name}")
    return reader
