"""The effect of each injected fault and of each other failure: visitor, exhibit, recovery, lost time."""
import bisect
import itertools
import textwrap
from typing import Dict, Iterator, List, NamedTuple, Optional, Sequence, Set, Tuple

from behavior_controller.events import EVENTS
from behavior_controller.gateway import Cause
from behavior_controller.recovery import DONE
from behavior_controller.story import UNDER_WAY, Sentence, Story
from behavior_controller.text import clean
from behavior_controller.watch.codec import KINDS
from behavior_controller.watch.plain import Wrong, form

from unit_tests.facts import Event, Facts, of
from unit_tests.journal import Line
from unit_tests.matching import CAUSE_OF, RECOVERY
from unit_tests.recoveries import Round, rounds

AGAIN = "tried again"
"""What the recovery did about a failure whose next attempt failed too."""

NO_RECOVERY, IN_SAFE_STATE, HALTED, NOT_ON_RECORD = "none", "on the way to the safe state", "halted", "not on record"
"""The text if no recovery dealt with the failure."""


class Row(NamedTuple):
    """One failure. ``call`` is as plannedFaults names it and ``kind`` one of ``faults.KINDS``, if it was injected.

    Of another failure ``call`` is the service, and ``kind`` the cause on record.
    """

    at: float  # unix seconds
    visitor: int  # counts from 1
    exhibit: str  # that was under way; empty: none
    node: str  # empty: it is not on record
    call: str
    kind: str
    recovery: str
    lost: float  # seconds until the step was done, tried again or given up
    is_injected: bool


class Told:
    """The effects of the failures of a run, from its record."""

    def __init__(self, facts: Facts):
        self._facts = facts
        self._quiet = {facts.interface.service(type(request)).node for request in facts.interface.safe_state}
        self._calls: Dict[str, List[float]] = {}  # when a service was called
        for line in facts.journal:
            if line.call:
                self._calls.setdefault(line.resource, []).append(line.time)
        self._pass_ends = [event["time"] for event in of(facts.events, "PassFinished")]
        under_way = [(0.0, "")] + list(_exhibits(facts.events))
        self._exhibits, self._exhibit_times = [name for _, name in under_way], [time for time, _ in under_way]
        self._rounds: Dict[int, List[Round]] = {}  # id() of a failure -> the recovery from it, and those around that one
        for each in rounds(facts.events):
            for event in _attempts(each):
                self._rounds.setdefault(id(event), []).append(each)

    def rows(self) -> List[Row]:
        """Return a row for each injected fault, and for each failure beside them that is no false condition, in order."""
        ends = [event for event in self._facts.events if _is_failure(event) or _is_halt(event) or _is_given_up(event)]
        times = [event["time"] for event in ends]
        taken: Set[int] = set()
        found = []
        for line in self._facts.journal:
            if line.fault is not None:
                later = itertools.islice(ends, bisect.bisect_left(times, line.time), None)
                end = next((event for event in later if id(event) not in taken and self._can_end(event, line)), None)
                if end is not None and not _is_given_up(end):
                    taken.add(id(end))
                found.append(self._of_fault(line, end))
        found += [self._of_failure(event) for event in ends if _is_failure(event) and id(event) not in taken]
        return sorted(found, key=lambda row: row.at)

    def _can_end(self, event: Event, line: Line) -> bool:
        """Whether an event may be the end of an earlier call that was made to fail."""
        if _is_given_up(event):
            return line.node in self._quiet
        if _is_halt(event):
            return bool(event["resource"] == line.resource)
        failure = event["failure"]
        return bool(failure["resource"] == line.resource and failure["cause"] == CAUSE_OF[line.fault or ""])

    def _of_fault(self, line: Line, end: Optional[Event]) -> Row:
        call, kind = "{}:{}".format(line.node, line.call), line.fault or ""
        if end is None:
            return self._row(line.time, "", call, kind, NOT_ON_RECORD, line.time, True)
        if _is_given_up(end):  # its time counts with the step that was given up
            return self._row(line.time, end["node"], call, kind, IN_SAFE_STATE, line.time, True)
        recovery, until = (HALTED, end["time"]) if _is_halt(end) else self._recovery(end)
        return self._row(line.time, end["node"], call, kind, recovery, until, True)

    def _of_failure(self, event: Event) -> Row:
        failure = event["failure"]
        recovery, until = self._recovery(event)
        return self._row(event["time"], event["node"], failure["resource"] or "-", failure["cause"], recovery, until, False)

    def _row(self, at: float, node: str, call: str, kind: str, recovery: str, until: float, is_injected: bool) -> Row:
        exhibit = self._exhibits[bisect.bisect_right(self._exhibit_times, at) - 1]
        return Row(at, 1 + bisect.bisect_left(self._pass_ends, at), exhibit, node, call, kind, recovery, until - at, is_injected)

    def _recovery(self, failed: Event) -> Tuple[str, float]:
        """Return what the recovery did about a failure, and when the step was done, tried again or given up."""
        if id(failed) not in self._rounds:
            return NO_RECOVERY, failed["time"]
        mine = self._rounds[id(failed)][0]
        later = [event for event in _attempts(mine) if event["time"] > failed["time"]]
        if later:
            is_other = any(event is later[0] for event in mine.instead)
            return later[0]["node"] + " instead" if is_other else AGAIN, self._began(later[0], failed["time"])
        # an outer HandleFallBack goes on with the failure that an inner one gave up
        ends = [each.recovered for each in self._rounds[id(_attempts(mine)[0])]]
        return ", then ".join(dict.fromkeys(map(_outcome, ends))), ends[-1]["time"]

    def _began(self, retried: Event, after: float) -> float:
        """Return when the attempt was made that ended with an event."""
        calls = self._calls.get(retried["failure"]["resource"], [0.0])
        last = calls[bisect.bisect_right(calls, retried["time"]) - 1]
        return last if after <= last <= retried["time"] else float(retried["time"])


def _attempts(each: Round) -> List[Event]:
    """Return the failures that a recovery dealt with, in order."""
    return each.failures + each.instead


def _outcome(recovered: Event) -> str:
    tries = " by retry {}".format(recovered["attempts"]) if recovered["outcome"] == DONE else ""
    reason = reason_of(recovered)
    return recovered["outcome"] + tries + (": " + reason if reason else "")


def reason_of(recovered: Event) -> str:
    """Return why a recovery did not follow the policy's rule: its budget was spent, for one; empty: it did."""
    return str(recovered["policy"].partition(": ")[2])


def _is_failure(event: Event) -> bool:
    if event["event"] != "Retried" and (event["event"] != "LeafFinished" or event["status"] != "FAILURE"
                                        or event["node"] in RECOVERY):
        return False
    return bool(event["failure"]) and event["failure"]["cause"] != Cause.CONDITION_FALSE.value


def _is_halt(event: Event) -> bool:
    return bool(event["event"] == "LeafFinished" and event["status"] == "IDLE")


def _is_given_up(event: Event) -> bool:
    return event["event"] == "Recovered" and not event["success"]


def story_of(events: Sequence[Event]) -> Iterator[Tuple[Event, Story, Tuple[Sentence, ...]]]:
    """Yield for each event the story up to then, which is the same object each time, and what the event adds to it."""
    story = Story()
    for plain in events:
        kind = KINDS.get(plain["event"])
        if kind in EVENTS:
            try:
                added = story.take(plain["time"], form(kind).read(plain))
            except Wrong:
                continue  # what another release wrote
            yield plain, story, added


def _exhibits(events: Sequence[Event]) -> Iterator[Tuple[float, str]]:
    """Yield when which exhibit was under way, or none."""
    before = ""
    for event, story, _ in story_of(events):
        shown = story.visit.exhibits if story.visit is not None else ()
        name = next((exhibit.name for exhibit in shown if exhibit.state == UNDER_WAY), "")
        if name != before:
            yield event["time"], name
        before = name


# ------------------------------------------------------------------------------------------------------------ the table

HEAD = ("time", "visitor", "exhibit", "node", "call", "kind", "recovery", "lost")
NUMBERS = (0, 1, 7)
"""Columns that are set to the right."""

ON_FIRST_LINE = 4
"""The number of columns on the first of two lines, if one line is not wide enough."""


def table(rows: Sequence[Row], began: float, width: int) -> List[str]:
    """Return the rows as lines of text of at most ``width``; times are in seconds from ``began`` on."""
    cells = [HEAD] + [_cells(row, began) for row in rows]
    widths = [max(len(row[column]) for row in cells) for column in range(len(HEAD))]
    padded = [[cell.rjust(size) if column in NUMBERS else cell.ljust(size)
               for column, (cell, size) in enumerate(zip(row, widths))] for row in cells]
    lines = ["  ".join(row).rstrip() for row in padded]
    if max(map(len, lines)) <= width:
        return lines
    indent = " " * (widths[0] + 2)
    return [line for row in padded for line in ["  ".join(row[:ON_FIRST_LINE]).rstrip()] + textwrap.wrap(
        "  ".join(row[ON_FIRST_LINE:]).strip(), width, initial_indent=indent, subsequent_indent=indent,
        break_on_hyphens=False)]


def _cells(row: Row, began: float) -> Tuple[str, ...]:
    return tuple(clean(cell) for cell in ("{:.1f}".format(row.at - began), str(row.visitor), row.exhibit or "-",
                                          row.node or "-", row.call, row.kind, row.recovery, "{:.1f} s".format(row.lost)))
