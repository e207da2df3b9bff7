"""Reads a run line by line while it is written, to its end."""
import time
from typing import Iterator

from behavior_controller.run.events import Line
from behavior_controller.run.record.codec import Decoder
from behavior_controller.run.record.files import is_written, parts

REST = 0.1
"""Seconds between two looks for further lines."""

CHUNK = 1_000_000
"""The most bytes that are read at a time."""


def follow(path: str) -> Iterator[Line]:
    """Yield the lines of the run with this first file, and those that are written to it meanwhile.

    Ends when the run has ended. Raises MissionError for a line that is not one of a record, and
    OSError if a file cannot be read.
    """
    decoder = None
    shown = -1  # the number of files that were read, less one
    while True:
        goes_on = is_written(path)
        files = parts(path)[shown + 1:]
        for file in files:
            shown += 1
            decoder = Decoder(file, decoder)
            yield from _read(file, decoder, path, shown)
        if not files and not goes_on:
            return
        time.sleep(REST)


def _read(file: str, decoder: Decoder, path: str, shown: int) -> Iterator[Line]:
    """Yield the lines of a file until the run goes on in another one, or has ended."""
    torn = b""
    with open(file, "rb") as opened:
        while True:
            # asked before reading: what was written until then is read
            is_complete = not is_written(path) or len(parts(path)) > shown + 1
            for chunk in iter(lambda: opened.read(CHUNK), b""):
                *texts, torn = (torn + chunk).split(b"\n")
                for text in texts:
                    yield from decoder.read(text + b"\n")
            if is_complete:
                return
            time.sleep(REST)
