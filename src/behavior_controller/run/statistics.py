"""What many runs have in common: results of visits, causes, nodes that fail, and days."""
import collections
import functools
import math
import time
from typing import Counter, Dict, Iterable, Iterator, List, NamedTuple, Optional, Tuple

from msgspec import Struct

from behavior_controller.run.digest import Digest, EndedVisit, Outage, Period
from behavior_controller.run.state import RESULTS


class Choice(NamedTuple):
    """Which visits are meant; an empty text means all. ``day`` is such as 2026-11-27."""

    day: str = ""
    result: str = ""
    fault: str = ""
    mission: str = ""
    robot: str = ""

    def has_run(self, digest: Digest) -> bool:
        """Return whether visits of a run may be meant."""
        return self.mission in ("", digest.mission) and self.robot in ("", digest.robot)

    def has_visit(self, visit: EndedVisit) -> bool:
        """Return whether a visit of such a run is meant."""
        return (self.day in ("", day_of(visit.began)) and self.result in ("", visit.result) and
                (not self.fault or self.fault in visit.faults or self.fault == visit.decisive))


class FaultCount(Struct, frozen=True):
    """A fault of the robot: how many ``visits`` met it, and how many of them it ended."""

    fault: str
    visits: int
    ended: int


class NodeFigures(Struct, frozen=True):
    """How often a node of the robot was not well, the mean time from one such time to the next in
    which the robot was used, and how long it took until it was back (seconds): in the mean, and at
    the longest; None if it never was."""

    node: str
    outages: int
    between: float
    back: Optional[float]
    longest: Optional[float]


class DayFigures(Struct, frozen=True):
    """A day: its runs, the visits by result, and the share of the time from the first run's begin
    to the last one's end in which visitors could be served."""

    day: str
    runs: int
    visits: Dict[str, int]
    served: float


class Statistics(Struct, frozen=True):
    """The figures of some runs. ``visits`` has the number of each result."""

    runs: int
    visits: Dict[str, int]
    faults: List[FaultCount]
    nodes: List[NodeFigures]
    days: List[DayFigures]


def day_of(at: float) -> str:
    """Return the day of a time in Unix seconds; empty if it is not known."""
    return _day_of_quarter(int(at // _QUARTER)) if at else ""


def time_of(at: float) -> str:
    """Return the time of day of a time in Unix seconds; empty if it is not known."""
    return time.strftime("%H:%M:%S", time.localtime(at)) if at else ""


_QUARTER = 900
"""Seconds of a quarter of an hour: in every time zone a day begins with one."""


@functools.lru_cache(maxsize=None)
def _day_of_quarter(number: int) -> str:
    return time.strftime("%Y-%m-%d", time.localtime(number * _QUARTER))


def days_of(digests: Iterable[Digest]) -> List[str]:
    """Return the days on which something ran, the newest first."""
    return sorted({day for digest in digests for day, _ in _days((digest.began, digest.ended))},
                  reverse=True)


def statistics(digests: Iterable[Digest], choice: Choice = Choice()) -> Statistics:
    """Return the figures of the runs that ``choice`` means."""
    chosen = [digest for digest in digests if choice.has_run(digest) and any(
        choice.day in ("", day) for day, _ in _days((digest.began, digest.ended)))]
    visits = [visit for digest in chosen for visit in digest.visits if choice.has_visit(visit)]
    days = [each for each in _day_figures(chosen, visits) if choice.day in ("", each.day)]
    return Statistics(len(chosen), _by_result(visits), _fault_counts(visits),
                      _node_figures(chosen), days)


def _by_result(visits: Iterable[EndedVisit]) -> Dict[str, int]:
    counts = collections.Counter(visit.result for visit in visits)
    return {result: counts[result] for result in RESULTS if counts[result]}


def _fault_counts(visits: List[EndedVisit]) -> List[FaultCount]:
    """Return the faults, that which ended most visits first, then that which most met."""
    ended = collections.Counter(visit.decisive for visit in visits if visit.decisive)
    met: Counter[str] = collections.Counter(
        fault for visit in visits for fault in {*visit.faults, visit.decisive} - {""})
    return [FaultCount(fault, count, ended[fault]) for fault, count in sorted(
        met.items(), key=lambda item: (-ended[item[0]], -item[1], item[0]))]


def _node_figures(digests: List[Digest]) -> List[NodeFigures]:
    """Return the nodes that were not well, that which was so most often first."""
    used = sum(digest.ended - digest.began for digest in digests)
    by_node: Dict[str, List[Outage]] = collections.defaultdict(list)
    for digest in digests:
        for outage in digest.outages:
            by_node[outage.node].append(outage)
    figures = []
    for node, outages in by_node.items():
        back = [outage.ended - outage.began for outage in outages if outage.ended is not None]
        mean = None
        if back:
            mean = sum(back) / len(back)
        figures.append(NodeFigures(
            node, len(outages), used / len(outages), mean, max(back, default=None)))
    return sorted(figures, key=lambda each: (-each.outages, each.node))


def _day_figures(digests: List[Digest], visits: List[EndedVisit]) -> Iterator[DayFigures]:
    """Yield the days with those of the visits, the newest first."""
    by_day: Dict[str, List[Tuple[Digest, Period]]] = collections.defaultdict(list)
    visits_of: Dict[str, List[EndedVisit]] = collections.defaultdict(list)
    for digest in digests:
        for day, period in _days((digest.began, digest.ended)):
            by_day[day].append((digest, period))
    for visit in visits:
        visits_of[day_of(visit.began)].append(visit)
    for day in sorted(by_day, reverse=True):
        yield DayFigures(day, len(by_day[day]), _by_result(visits_of[day]), _served(by_day[day]))


def _served(runs: List[Tuple[Digest, Period]]) -> float:
    """Return the share of a day, given its runs and their times; of each robot by itself."""
    opened: Dict[str, List[Period]] = collections.defaultdict(list)
    served: Dict[str, List[Period]] = collections.defaultdict(list)
    for digest, (began, ended) in runs:
        opened[digest.robot].append((began, ended))
        for first, last in sorted(digest.unserved):
            served[digest.robot].append((began, min(first, ended)))
            began = max(began, last)
        served[digest.robot].append((began, ended))
    whole = sum(max(ended for _, ended in periods) - min(began for began, _ in periods)
                for periods in opened.values())
    return sum(map(_length, served.values())) / whole if whole > 0.0 else 0.0


def _length(periods: List[Period]) -> float:
    """Return the time that is in at least one of the periods."""
    length, until = 0.0, -math.inf
    for began, ended in sorted(periods):
        length += max(0.0, ended - max(began, until))
        until = max(until, ended)
    return length


def _days(period: Period) -> Iterator[Tuple[str, Period]]:
    """Yield each day of a period, with the part of it in that day; none of a run that could not be
    read."""
    began, ended = period
    while began:
        now = time.localtime(began)
        midnight = time.mktime((now.tm_year, now.tm_mon, now.tm_mday + 1, 0, 0, 0, 0, 0, -1))
        yield day_of(began), (began, min(ended, midnight))
        if ended <= midnight:
            return
        began = midnight
