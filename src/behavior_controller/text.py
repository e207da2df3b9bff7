"""Reads text files safely, makes outside text safe to show, and suggests the word that was meant.
"""
import ast
import contextlib
import difflib
import inspect
import itertools
import os
import re
import stat
import unicodedata
from typing import Any, Iterable, NamedTuple

LONGEST = 1000
"""The most characters of outside text that are shown: names, values and answers may have any
length."""

MOST_BYTES = 1_000_000
"""The most bytes of a text file that a person writes."""

# letters of other alphabets that look like Latin ones
_LATIN = str.maketrans("АВЕКМНОРСТХЅІЈасеорхуѕіјкмтнΑΒΕΖΗΙΚΜΝΟΡΤΥΧοα",
                       "ABEKMHOPCTXSIJaceopxysijkmtnABEZHIKMNOPTYXoa")
_TAIL = 36
_MOST_NAMES = 20  # in a list

_CONTROLS = "[\x00-\x08\x0b-\x1f\x7f-\x9f\u202a-\u202e\u2066-\u2069\ud800-\udfff\ufffe\uffff]"
_CONTROL = re.compile(_CONTROLS)
_OTHER_CONTROL = re.compile(r"(?!\r|\x1b\[[HJK])" + _CONTROLS)
"""All but those that redraw a window: carriage return, home, clear the rest of the line or window.
"""


class Source(NamedTuple):
    """The text of a file as it was read."""

    file: str
    text: str


class Unreadable(Exception):
    """A file cannot be read as text; the text of the exception is the reason."""


def clean(text: str, longest: int = LONGEST) -> str:
    """Return ``text`` from outside as one line of at most ``longest`` characters, safe for a
    terminal and for a file.

    Control characters, escape sequences, line breaks, characters that change the direction of text
    or cannot be seen, and lone surrogates are shown as Python escapes. A text that is too long is
    cut in the middle.
    """
    if len(text) > longest:
        text = text[:longest - _TAIL - 3] + " … " + text[-_TAIL:]
    if not text.isprintable():
        text = "".join(letter if letter.isprintable() else _escaped(letter) for letter in text)
    return text


def without_controls(text: str, redraws: bool = False) -> str:
    """Return ``text`` with its control characters as Python escapes: a terminal and XML take it.
    Lines stay lines.

    If it ``redraws`` a window, the control sequences for that stay too.
    """
    controls = _CONTROL
    if redraws:
        controls = _OTHER_CONTROL
    return controls.sub(lambda match: _escaped(match.group()), text)


def _escaped(text: str) -> str:
    return text.encode("unicode_escape").decode("ascii")


def read_text(path: str) -> str:
    """Return the text of a regular file: UTF-8, or UTF-16 with its byte order mark, with any line
    ends.

    Raises Unreadable, also for a file of more than ``MOST_BYTES``.
    """
    try:
        text = decode(read_bytes(path))
    except UnicodeDecodeError as error:
        raise Unreadable("it is not UTF-8 text") from error
    if "\0" in text:
        raise Unreadable("it is not UTF-8 text: it has a NUL character")
    return text.replace("\r\n", "\n").replace("\r", "\n")


def read_bytes(path: str, most: int = MOST_BYTES, begin: int = 0) -> bytes:
    """Return the content of a regular file from the byte ``begin`` on. Raises Unreadable; a FIFO or
    a device is refused without being read."""
    try:
        # O_NONBLOCK: else open() blocks on a FIFO without a writer
        descriptor = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_NOCTTY)
        try:
            status = os.fstat(descriptor)
            if stat.S_ISDIR(status.st_mode):
                raise Unreadable("it is a folder")
            if not stat.S_ISREG(status.st_mode):
                raise Unreadable("it is not a regular file")
            data = b""
            if status.st_size - begin <= most:
                with open(descriptor, "rb", closefd=False) as file:
                    file.seek(begin)
                    data = file.read(most + 1)
        finally:
            os.close(descriptor)
    except (OSError, ValueError) as error:
        raise Unreadable(clean(getattr(error, "strerror", None) or str(error))) from error
    size = max(status.st_size - begin, len(data))
    if size > most:
        raise Unreadable(f"it has {size} bytes; at most {most} are read")
    return data


def decode(data: bytes, errors: str = "strict") -> str:
    """Return bytes as text without the byte order mark. Raises UnicodeDecodeError, unless
    ``errors`` are ignored."""
    encoding = "utf-8-sig"
    if data.startswith((b"\xff\xfe", b"\xfe\xff")):
        encoding = "utf-16"
    return data.decode(encoding, errors)


def docstring(thing: Any) -> str:
    """Return the docstring of a class or function: with ``python -OO``, which drops it, as the
    source has it; empty if that is missing too."""
    if thing.__doc__ is not None:
        return thing.__doc__
    with contextlib.suppress(OSError, SyntaxError):
        definition = ast.parse(inspect.getsource(thing)).body[0]
        return ast.get_docstring(definition, clean=False) or ""  # type: ignore[arg-type]
    return ""


def did_you_mean(word: str, known: Iterable[str], likeness: float = 0.6) -> str:
    """Return ``did you mean X?`` for the nearest of ``known`` (case is ignored), or an empty text.

    ``likeness`` is the required similarity, from 0 to 1 (equal).
    """
    by_lower = {name.lower(): name for name in known}
    plain = word.translate(_LATIN).lower()
    near = difflib.get_close_matches(plain, list(by_lower), 1, likeness)
    return meant(word, by_lower[near[0]]) if near else ""


def meant(word: str, name: str) -> str:
    """Return ``did you mean …?`` for a name, and the letter of another alphabet that ``word`` has
    in place of one of its letters, which a reader cannot see."""
    foreign = named_letters("".join(letter for letter in word if letter not in name))
    return f"did you mean {quoted(name)}?{foreign and ' ' + foreign}"


def named_letters(text: str) -> str:
    """Return the names of the first letters of a text that are not Latin; "" if all are."""
    names = {letter: unicodedata.name(letter, "") for letter in text if letter > "\x7f"}
    return ", ".join(f"{letter} is {name}" for letter, name in list(names.items())[:3]
                     if name and not name.startswith("LATIN"))


def quoted(name: str) -> str:
    """Return a name, in quotes if a reader could not see where it begins or ends."""
    if name and name == name.strip():
        return name
    return f'"{name}"'


def first_names(names: Iterable[str]) -> str:
    """Return the names with commas between them; of many the first, and an ellipsis."""
    shown = list(itertools.islice(names, _MOST_NAMES + 1))
    return ", ".join(shown[:_MOST_NAMES] + ["…"] * (len(shown) > _MOST_NAMES))


def joined(separator: str, *parts: str) -> str:
    """Return the parts that are not empty, with the separator between them."""
    return separator.join(filter(None, parts))


def bracketed(text: str) -> str:
    """Return a text in brackets after a blank; of none an empty one."""
    return text and f" ({text})"


def count(number: int, one: str, more: str = "") -> str:
    """Return a number and its noun; ``more`` is the plural if that does not only add an s."""
    return f"{number} {form(number, one, more or one + 's')}"


def form(number: int, one: str, more: str) -> str:
    """Return that form of a word which goes with a number."""
    if number == 1:
        return one
    return more
