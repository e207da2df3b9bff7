"""Tells from the newest record what the robot may still do if its run was killed."""
import os
import time

from behavior_controller.errors import MissionError
from behavior_controller.run.events import RunFinished
from behavior_controller.run.fold import fold
from behavior_controller.run.state import State
from behavior_controller.run import moment
from behavior_controller.run.record import files
from behavior_controller.run.record.tail import RunTail

NEWEST_FILES = 2
"""Number of the newest files of the run that are read; each begins with what was so before."""

TIME_LIMIT = 2.0
"""Seconds in which the events are folded."""

END_BYTES = 10_000
"""Where a run that has ended says so: within this many bytes before the end of its record."""

UNKNOWN = "the robot may be live, and its record cannot be read: keep the stop button at hand"


def may_be_live(place: str, robot: str = "") -> str:
    """Return what may be on or under way if the newest run of a robot below a folder was killed,
    and what to do about it; otherwise an empty text. Raises OSError."""
    newest = [path for path in files.runs(place) if files.robot_of(path) == robot][-1:]
    if not newest or files.is_written(newest[0]):
        return ""
    last = files.parts(newest[0])[-1]
    with open(last, "rb") as file:
        file.seek(max(0, os.path.getsize(last) - END_BYTES))
        if b'"_type":"%b"' % RunFinished.__name__.encode() in file.read():
            return ""
    try:
        said = moment.left_running(_end(newest[0]))
    except (MissionError, TimeoutError):
        said = UNKNOWN
    return f"{said} (the record of the run before has no end: {newest[0]})" if said else ""


def _end(path: str) -> State:
    """Return what was so when the run with this first file was killed. Raises TimeoutError after
    ``TIME_LIMIT``."""
    state, until = State(), time.monotonic() + TIME_LIMIT
    for line in RunTail(path, NEWEST_FILES).news(is_over=True):
        state = fold(state, line.time, line.event)
        if time.monotonic() > until:
            raise TimeoutError
    return state
