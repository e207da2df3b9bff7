"""Reads text files safely and makes outside text safe to show."""
import os
import stat
from typing import NamedTuple

LONGEST = 1000
"""The most characters of outside text that are shown: names, values and answers may have any length."""

MOST_BYTES = 1_000_000
"""The most bytes of a text file that a person writes."""

_TAIL = 36


class Source(NamedTuple):
    """The text of a file as it was read."""

    file: str
    text: str


class Unreadable(Exception):
    """A file cannot be read as text; the text of the exception is the reason."""


def clean(text: str, longest: int = LONGEST) -> str:
    """Return ``text`` from outside as one line of at most ``longest`` characters, safe for a terminal and for a file.

    Control characters, escape sequences, line breaks, characters that change the direction of text or cannot be seen,
    and lone surrogates are shown as Python escapes. A text that is too long is cut in the middle.
    """
    if len(text) > longest:
        text = text[:longest - _TAIL - 3] + " … " + text[-_TAIL:]
    if not text.isprintable():
        text = "".join(letter if letter.isprintable() else letter.encode("unicode_escape").decode("ascii")
                       for letter in text)
    return text


def read_text(path: str) -> str:
    """Return the text of a regular file: UTF-8, or UTF-16 with its byte order mark, with any line ends.

    Raises Unreadable, also for a file of more than ``MOST_BYTES``.
    """
    try:
        text = decode(read_bytes(path))
    except UnicodeDecodeError as error:
        raise Unreadable("it is not UTF-8 text") from error
    if "\0" in text:
        raise Unreadable("it is not UTF-8 text: it has a NUL character")
    return text.replace("\r\n", "\n").replace("\r", "\n")


def read_bytes(path: str, most: int = MOST_BYTES) -> bytes:
    """Return the content of a regular file. Raises Unreadable; a FIFO or a device is refused without being read."""
    try:
        # O_NONBLOCK: else open() blocks on a FIFO without a writer
        descriptor = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_NOCTTY)
        try:
            size = _regular_size(descriptor)
            data = b"" if size > most else _first_bytes(descriptor, most + 1)
        finally:
            os.close(descriptor)
    except (OSError, ValueError) as error:
        raise Unreadable(clean(getattr(error, "strerror", None) or str(error))) from error
    if max(size, len(data)) > most:
        raise Unreadable("it has {} bytes; at most {} are read".format(max(size, len(data)), most))
    return data


def _regular_size(descriptor: int) -> int:
    status = os.fstat(descriptor)
    if not stat.S_ISREG(status.st_mode):
        raise Unreadable("it is a folder" if stat.S_ISDIR(status.st_mode) else "it is not a regular file")
    return status.st_size


def _first_bytes(descriptor: int, most: int) -> bytes:
    with open(descriptor, "rb", closefd=False) as file:
        return file.read(most)


def decode(data: bytes, errors: str = "strict") -> str:
    """Return bytes as text without the byte order mark. Raises UnicodeDecodeError, unless ``errors`` are ignored."""
    return data.decode("utf-16" if data[:2] in (b"\xff\xfe", b"\xfe\xff") else "utf-8-sig", errors)
