"""Answers what the list of runs asks for: figures and visits of the runs below a folder, a run's
report, and two visits compared."""
import asyncio
import os
import subprocess
import sys
import threading
import time
from typing import AsyncIterator, Callable, List, Tuple, TypeVar

from msgspec import Struct

from behavior_controller.errors import BehaviorControllerError, MissionError
from behavior_controller.run.digest import EndedVisit
from behavior_controller.run.statistics import (
    Choice, Statistics, day_of, days_of, statistics, time_of)
from behavior_controller.viewer.parting import Parting, parting, visit_rows
from behavior_controller.viewer.run_index import Listed, RunIndex

NEWEST = 200
"""Number of visits that are sent at once."""

CURRENT = 2.0
"""Seconds for which the list of runs is current."""

CHUNK = 64 * 1024
"""Bytes of a report that are sent at once."""

_REPORT = [sys.executable, "-m", "behavior_controller.viewer.report"]

Result = TypeVar("Result")


class VisitRow(Struct, frozen=True):
    """A visit of any run; ``run`` is the name of its folder."""

    run: str
    number: int
    day: str
    time: str
    mission: str
    robot: str
    result: str
    words: str
    seconds: float
    faults: Tuple[str, ...]


class RunRow(Struct, frozen=True):
    """A run; ``ending`` says how it ended, or why it cannot be read."""

    name: str
    mission: str
    robot: str
    day: str
    began: str
    ended: str
    visits: int
    ending: str
    is_readable: bool


class RunList(Struct, frozen=True):
    """The runs of ``place`` with their figures, and ``visits`` of them, the newest first, before
    ``older`` further ones. ``reading``: how many runs were read, while some are not."""

    place: str
    reading: str
    missions: List[str]
    robots: List[str]
    all_days: List[str]
    figures: Statistics
    runs: List[RunRow]
    visits: List[VisitRow]
    older: int


class EarlierRuns:
    """The runs below a folder. Its methods are called in the page's event loop; what takes long is
    done on other threads, and a report in a process of its own."""

    def __init__(self, place: str):
        """Without a ``place`` there are no runs."""
        self._index, self._place = RunIndex(place), place
        self._listed: List[Listed] = []
        self._read = -CURRENT  # when they were
        self._is_reading = False

    async def list(self, choice: Choice, first: int) -> RunList:
        """Return the runs that are known, with visits from the number ``first`` on."""
        if self._place and not self._is_reading and time.monotonic() - self._read > CURRENT:
            self._is_reading = True
            threading.Thread(target=self._refresh, name="runs", daemon=True).start()
            await asyncio.sleep(0.2)  # most often it is done by then
        return await on_a_thread(lambda: self._list(choice, first))

    def _refresh(self) -> None:
        try:
            for self._listed in self._index.refresh():
                pass
        finally:
            self._read, self._is_reading = time.monotonic(), False

    def _list(self, choice: Choice, first: int) -> RunList:
        listed, reading = self._listed, ""
        if self._is_reading:
            reading = f"{len(listed)} runs read so far"
        digests = [each.digest for each in listed]
        chosen = [each for each in reversed(listed) if choice.has_run(each.digest)]
        visits = [(each, visit) for each in chosen for visit in reversed(each.digest.visits)
                  if choice.has_visit(visit)]
        missions, robots = ({digest.mission for digest in digests} - {""},
                            {digest.robot for digest in digests} - {""})
        return RunList(
            self._place, reading, sorted(missions), sorted(robots), days_of(digests),
            statistics(digests, choice._replace(result="", fault="")),
            [_run_row(each) for each in chosen[:NEWEST]],
            [_visit_row(*each) for each in visits[first:first + NEWEST]],
            max(0, len(visits) - first - NEWEST))

    def path(self, name: str) -> str:
        """Return the first file of a run. Raises MissionError if there is none of that name."""
        path = self._index.path(name)
        if path is None:
            raise MissionError.of(name, "there is no such run", "choose one of the list")
        return path

    async def compare(self, visits: List[Tuple[str, int]]) -> Parting:
        """Compare two visits, each given by its run and number. Raises MissionError."""
        def compared() -> Parting:
            one, other = (visit_rows(self.path(name), number) for name, number in visits)
            return parting(one, other)
        return await on_a_thread(compared)

    async def report(self, name: str) -> AsyncIterator[bytes]:
        """Yield the report of a run. Raises MissionError if it cannot be made."""
        path = self.path(name)
        environment = dict(os.environ, PYTHONPATH=os.pathsep.join(filter(None, sys.path)))
        process = await asyncio.create_subprocess_exec(
            *_REPORT, path, cwd="/", env=environment, stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL, stdin=subprocess.DEVNULL)
        assert process.stdout is not None
        is_begun = False
        try:
            data = await process.stdout.read(CHUNK)
            is_begun = bool(data)
            while data:
                yield data
                data = await process.stdout.read(CHUNK)
        finally:
            if process.returncode is None:
                process.kill()
        if not is_begun:
            raise MissionError.of(path, "there is no report of it", "does replayMission read it?")


async def on_a_thread(function: Callable[[], Result]) -> Result:
    """Return what a function returns, which a thread calls that no exit waits for."""
    loop = asyncio.get_event_loop()
    future: "asyncio.Future[Result]" = loop.create_future()

    def work() -> None:
        try:
            result = function()
        except BehaviorControllerError as error:
            loop.call_soon_threadsafe(future.set_exception, error)
        else:
            loop.call_soon_threadsafe(future.set_result, result)

    threading.Thread(target=work, daemon=True).start()
    return await future


def _visit_row(listed: Listed, visit: EndedVisit) -> VisitRow:
    return VisitRow(listed.name, visit.number, day_of(visit.began), time_of(visit.began),
                    listed.digest.mission, listed.digest.robot, visit.result, visit.words,
                    visit.seconds, visit.faults)


def _run_row(listed: Listed) -> RunRow:
    digest = listed.digest
    return RunRow(listed.name, digest.mission, digest.robot, day_of(digest.began),
                  time_of(digest.began), time_of(digest.ended), len(digest.visits), listed.ending,
                  not listed.trouble)
