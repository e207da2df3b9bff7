"""Finds and reads recorded runs; for programs that need no tree too."""
import glob
import os
from typing import Iterator, List

from behavior_controller import folders
from behavior_controller.errors import MissionError
from behavior_controller.run import events
from behavior_controller.run.record.files import FILE_NAME, runs
from behavior_controller.run.record.tail import RunTail, is_under_way

LATEST = "latest"
"""The argument that means the newest run of the default folder."""


def folder_of(name: str) -> str:
    """Return the folder of that name; of ``latest`` the default one."""
    if name == LATEST:
        return folders.records()
    return name


def find_record(name: str) -> str:
    """Return the first file of a run, given that or its folder; of the newest run below a folder of
    runs, or below the default one (``latest``)."""
    folder = folder_of(name)
    newest = runs(folder)[-1:]
    if newest:
        return newest[0]
    if name == LATEST:
        place = os.path.join(folder, "*", FILE_NAME)
        raise MissionError.of(place, "there is no record yet", "name a record or its folder")
    below = sorted(filter(os.path.isfile, glob.glob(
        os.path.join(glob.escape(folder), "*", FILE_NAME))))
    own = os.path.join(name, FILE_NAME)
    if not below or os.path.exists(own):
        return own if os.path.isdir(name) else name
    if len(below) > 1:
        raise MissionError.of(name, f"the folder has the records of {len(below)} runs", "name one")
    return below[-1]


def read_record(path: str) -> List[events.Line]:
    """Return the lines of a record, the last one ``KILLED`` if it has no end. Raises MissionError
    if it cannot be read or is invalid."""
    return list(stream_record(path))


def stream_record(path: str) -> Iterator[events.Line]:
    """Yield the lines of ``read_record`` one by one: a fault is raised when its line is reached."""
    is_over, tail = not is_under_way(path), RunTail(path)
    yield from tail.news(is_over)
    tail.finish()
