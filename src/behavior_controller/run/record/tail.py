"""Reads the files of a run, also while they are written."""
import os
import time
from typing import Dict, Iterator, Optional

from behavior_controller.errors import MissionError
from behavior_controller.run.events import KILLED, Line, RunFinished, use_clock_of
from behavior_controller.run.record.codec import Decoder
from behavior_controller.run.record.files import is_further, is_written, parts
from behavior_controller.text import Unreadable, read_bytes

LARGEST_FILE = 50_000_000
"""The most bytes of a file of a record that are read at once."""

TAIL_POLL = 0.1
"""Seconds between two looks for further lines."""


def follow(path: str, newest: int = 0) -> Iterator[Optional[Line]]:
    """Yield the lines of the run with this first file, and those that are written to it meanwhile,
    and None while it waits for more; with ``newest`` as a ``RunTail``.

    Ends when the run has ended. Raises MissionError if it cannot be read, or for a line that is not
    one of a record.
    """
    tail, goes_on = RunTail(path, newest), True
    while goes_on:
        goes_on = is_under_way(path)  # asked before reading: what was written until then is read
        yield from tail.news(is_over=not goes_on)
        if goes_on:
            tail.use_clock()
            yield None
            time.sleep(TAIL_POLL)


def is_under_way(path: str) -> bool:
    """Return ``is_written``. Raises MissionError if the file cannot be read."""
    try:
        return is_written(path)
    except OSError as error:
        raise MissionError.of(path, f"the record cannot be read: {error.strerror}") from error


class RunTail:
    """Reads the lines of a run as far as they are written."""

    def __init__(self, path: str, newest: int = 0):
        """``path`` is the first file of the run. With ``newest``, reading begins with the last
        files, of that number, each of which begins with what was so before it."""
        self._path, self._newest = path, newest
        self._places: Dict[str, int] = {}  # bytes that were read of each file, in their order
        self._decoder: Optional[Decoder] = None  # of the last one
        self._has_end, self._time = is_further(path), 0.0  # of its last line

    def news(self, is_over: bool = False) -> Iterator[Line]:
        """Yield the lines that were added since the last call; ``is_over``, if nobody writes the
        run any more: then also an end, if it has none. Raises MissionError if a file cannot be
        read, or for a line that is not one of a record."""
        last = list(self._places)[-1:]
        # looked for before reading: then the file before them is complete
        new = [file for file in parts(self._path) if file not in self._places]
        is_late = 0 < self._newest < len(new)
        if is_late:
            self._places.update(dict.fromkeys(new[:-self._newest], 0))
            new = new[-self._newest:]
        self._newest = 0
        for file in last + new:
            if file in new:
                self._places[file] = 0
                self._decoder = Decoder(file, self._decoder, is_late)
                is_late = False
            assert self._decoder is not None
            for line in self._decoder.read_all(self._added(file)):
                self._has_end, self._time = self._has_end or isinstance(
                    line.event, RunFinished), line.time
                yield line
        if is_over and self._time and not self._has_end:
            yield Line(self._time, KILLED)

    def finish(self) -> None:
        """Raise MissionError if there is no mission in what was read."""
        if self._decoder is not None:
            self._decoder.finish()

    def use_clock(self) -> None:
        """Have ``unix_now`` follow the process that writes, if it is one of this computer."""
        head = self._decoder.head if self._decoder is not None else None
        if head is not None and head.unix_at_zero and os.path.exists(f"/proc/{head.pid}"):
            use_clock_of(head.unix_at_zero)

    def _added(self, file: str) -> bytes:
        """Return the whole lines that were added to a file."""
        try:
            data = read_bytes(file, LARGEST_FILE, self._places[file])
        except Unreadable as error:
            if file != self._path and not os.path.exists(file):
                return b""  # the run goes on, and has dropped it
            raise MissionError.of(file, f"the record cannot be read: {error}") from error
        whole = data[:data.rfind(b"\n") + 1]
        self._places[file] += len(whole)
        return whole
