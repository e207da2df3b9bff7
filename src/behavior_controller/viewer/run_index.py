"""The digests of all runs below a folder, kept in a file beside them that can be thrown away."""
import contextlib
import os
import time
from typing import Dict, Iterator, List, Optional

import msgspec

from behavior_controller.errors import BehaviorControllerError
from behavior_controller.output_files import replace_file
from behavior_controller.run.digest import Digest, Digester
from behavior_controller.run.record.codec import VERSION
from behavior_controller.run.record.files import is_written, runs, size
from behavior_controller.run.record.tail import RunTail

INDEX = "index.json"
"""The file in a folder of runs that has their digests. Without it they are made again."""

_LAYOUT = f"digests 3 of records {VERSION}"
"""What an index has to be of; any other one is made anew."""


WRITE_INTERVAL = 5.0
"""Seconds between two writes of the index while many runs are read."""


class Listed(msgspec.Struct, frozen=True):
    """A run in the list: the name of its folder, how many bytes its files have, and its digest.

    ``trouble``: why it cannot be read, or not from some line on. ``goes_on``: it is being written.
    """

    name: str
    size: int
    digest: Digest
    trouble: str = ""
    goes_on: bool = False

    @property
    def ending(self) -> str:
        """How the run ended, or why it cannot be read."""
        return self.trouble or self.digest.ending or "goes on"


class _Index(msgspec.Struct, frozen=True):
    layout: str = ""
    runs: List[Listed] = []


class _Reading:
    """A run as far as it was read."""

    def __init__(self, path: str):
        self.path, self.trouble = path, ""
        self._tail, self._digester = RunTail(path), Digester()

    def listed(self) -> Listed:
        """Read what was added, and return the run."""
        bytes_read, goes_on = size(self.path), False
        with contextlib.suppress(OSError):
            goes_on = is_written(self.path)
        try:
            if not self.trouble:
                for line in self._tail.news(is_over=not goes_on):
                    self._digester.take(line)
        except BehaviorControllerError as error:
            self.trouble = str(error)
        return Listed(_name(self.path), bytes_read, self._digester.digest(), self.trouble, goes_on)


class RunIndex:
    """The runs below a folder. Belongs to one thread."""

    def __init__(self, place: str):
        self.place = place
        self._file = os.path.join(place, INDEX)
        self._known: Optional[Dict[str, Listed]] = None  # by name; None: the file was not read
        self._readings: Dict[str, _Reading] = {}  # of those that are being written

    def path(self, name: str) -> Optional[str]:
        """Return the first file of the run in the folder of that name; None if there is none."""
        return next((path for path in runs(self.place) if _name(path) == name), None)

    def refresh(self) -> Iterator[List[Listed]]:
        """Bring the index up to date. Yield what is known whenever a run was read, the oldest run
        first, and all at the end."""
        paths = {_name(path): path for path in runs(self.place)}
        if self._known is None:
            self._known = {listed.name: listed for listed in _read(self._file)}
        known = {name: self._known[name] for name in paths if name in self._known}
        has_changed, written = len(known) < len(self._known), time.monotonic()
        self._known = known
        for name, path in paths.items():
            listed = known.get(name)
            if listed is None or listed.goes_on or listed.size != size(path):
                known[name] = self._listed(name, path)
                # one that goes on is read again anyway
                has_changed = has_changed or not known[name].goes_on
                yield [known[name] for name in paths if name in known]
            # what was read is not read again
            if has_changed and time.monotonic() - written > WRITE_INTERVAL:
                self._write(list(known.values()))
                written = time.monotonic()
        if has_changed:
            self._write(list(known.values()))
        yield [known[name] for name in paths]

    def _listed(self, name: str, path: str) -> Listed:
        reading = self._readings.pop(name, None) or _Reading(path)
        listed = reading.listed()
        if listed.goes_on:
            self._readings[name] = reading
        return listed

    def _write(self, listed: List[Listed]) -> None:
        """Write the index; a folder in which nothing can be written has none."""
        with contextlib.suppress(OSError):
            replace_file(self._file, msgspec.json.encode(_Index(_LAYOUT, listed)))


def all_runs(place: str) -> List[Listed]:
    """Return the runs below a folder, the oldest first."""
    listed: List[Listed] = []
    for listed in RunIndex(place).refresh():
        pass
    return listed


def _name(path: str) -> str:
    return os.path.basename(os.path.dirname(path))


def _read(file: str) -> List[Listed]:
    with contextlib.suppress(OSError, msgspec.MsgspecError), open(file, "rb") as opened:
        index = msgspec.json.decode(opened.read(), type=_Index)
        return index.runs if index.layout == _LAYOUT else []
    return []
