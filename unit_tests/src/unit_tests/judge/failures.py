"""The failures of a run as rows: visitor, stop, node, call, what the recovery did about it, the
time that it cost."""
import bisect
import textwrap
from typing import Dict, List, NamedTuple, Sequence, Tuple

from behavior_controller.execution.events import PassFinished
from behavior_controller.execution.state import LeafFailure, RecoveryRound
from behavior_controller.text import clean

from unit_tests.judge.facts import Facts, of
from unit_tests.judge.reference import DONE, HANDLERS
from unit_tests.judge.witness import Pair, Witness
from unit_tests.robot.faults import WRONG

AGAIN = "tried again"
"""What the recovery did about a failure whose next attempt failed too."""

NO_RECOVERY, IN_SAFE_STATE, HALTED, NOT_ON_RECORD = (
    "none", "on the way to the safe state", "halted", "not on record")
"""The text if no recovery dealt with the failure."""


class FailureRow(NamedTuple):
    """One failure. ``call`` is as plannedFaults names it and ``kind`` one of ``faults.KINDS``, if
    it was injected.

    Of another failure ``call`` is the service, and ``kind`` the cause on record.
    """

    at: float  # unix seconds
    visitor: int  # counts from 1
    stop: str  # that was under way; empty: none
    node: str  # empty: it is not on record
    call: str
    kind: str
    recovery: str
    lost: float  # seconds until the step was done, tried again or given up
    is_injected: bool


class Rows:
    """Makes the rows of a run."""

    def __init__(self, facts: Facts, witness: Witness):
        self._facts = facts
        self._passes = [time for time, _ in of(facts.run.lines, PassFinished)]
        self._open: List[Pair] = list(filter(_fault, witness.pairs))
        # id() of a failure -> the recovery from it, and those around that one
        self._rounds: Dict[int, List[RecoveryRound]] = {}
        for recovery in facts.run.recoveries:
            if recovery.recovered is not None and not recovery.is_halted:
                for failed in recovery.failures + recovery.instead:
                    self._rounds.setdefault(id(failed), []).append(recovery)

    def all(self) -> List[FailureRow]:
        """Return a row for each injected fault, and for each failure beside them that is no false
        condition."""
        rows = [self._of_failure(failed) for failed in self._facts.run.failures
                if not failed.is_false_condition and failed.node not in HANDLERS]
        return sorted(rows + list(map(self._of_rest, self._open)), key=lambda row: row.at)

    def _of_failure(self, failed: LeafFailure) -> FailureRow:
        recovery, until = self._recovery(failed)
        pair = next((pair for pair in self._open if _explains(pair, failed)), None)
        if pair is None:
            return self._row(failed.at, failed.node, failed.failure.resource or "-",
                             failed.failure.cause.value, recovery, until, False)
        self._open.remove(pair)
        return self._row(pair.time, failed.node, _call(pair), _fault(pair), recovery, until, True)

    def _of_rest(self, pair: Pair) -> FailureRow:
        """Return the row of a fault that is no failure of a node."""
        query, recovery = pair.query, NOT_ON_RECORD
        if query is not None:
            recovery = HALTED if query.result is None else IN_SAFE_STATE
        return self._row(pair.time, query.node if query is not None else "", _call(pair),
                         _fault(pair), recovery, pair.time, True)

    def _row(self, at: float, node: str, call: str, kind: str, recovery: str, until: float,
             is_injected: bool) -> FailureRow:
        stop = self._facts.run.at(at).stop
        return FailureRow(at, 1 + bisect.bisect_left(self._passes, at),
                          stop.name if stop is not None else "", node, call, kind, recovery,
                          until - at, is_injected)

    def _recovery(self, failed: LeafFailure) -> Tuple[str, float]:
        """Return what the recovery did about a failure, and when the step was done, tried again or
        given up."""
        rounds = self._rounds.get(id(failed))
        if not rounds:
            return NO_RECOVERY, failed.at
        later = [other for other in rounds[0].failures + rounds[0].instead if other.at > failed.at]
        if later:
            is_other = any(other is later[0] for other in rounds[0].instead)
            return f"{later[0].node} instead" if is_other else AGAIN, later[0].at
        # an outer HandleFallBack goes on with the failure that an inner one gave up
        rounds = self._rounds[id((rounds[0].failures + rounds[0].instead)[0])]
        return ", then ".join(dict.fromkeys(map(_outcome, rounds))), rounds[-1].decided


def _explains(pair: Pair, failed: LeafFailure) -> bool:
    """Return whether a fault is that of a failure on record: the same service and cause, the newest
    before it."""
    query = pair.query
    if query is None or query.service != failed.failure.resource or query.node not in (
            "", failed.node) or (query.answered or 0.0) > failed.at:
        return False
    return query.outcome == failed.failure.cause.value or _fault(pair) == WRONG


def _fault(pair: Pair) -> str:
    """Return the fault that was injected; empty: none."""
    return (pair.line.fault or "") if pair.line is not None else ""


def _call(pair: Pair) -> str:
    return f"{pair.line.node}:{pair.line.call}" if pair.line is not None else "-"


def _outcome(recovery: RecoveryRound) -> str:
    tries = f" by retry {recovery.attempts}" if recovery.outcome == DONE else ""
    reason = recovery.recovered.reason if recovery.recovered is not None else ""
    return recovery.outcome + tries + (": " + reason if reason else "")


# ---------------------------------------------------------------------------------------- the table

HEAD = ("time", "visitor", "stop", "node", "call", "kind", "recovery", "lost")
NUMBERS = (0, 1, 7)
"""Columns that are set to the right."""

ON_FIRST_LINE = 4
"""The number of columns on the first of two lines, if one line is not wide enough."""


def table(rows: Sequence[FailureRow], began: float, width: int) -> List[str]:
    """Return the rows as lines of text of at most ``width``; times are in seconds from ``began``
    on."""
    cells = [HEAD] + [_cells(row, began) for row in rows]
    widths = [max(len(row[column]) for row in cells) for column in range(len(HEAD))]
    padded = [[cell.rjust(size) if column in NUMBERS else cell.ljust(size)
               for column, (cell, size) in enumerate(zip(row, widths))] for row in cells]
    lines = ["  ".join(row).rstrip() for row in padded]
    if max(map(len, lines)) <= width:
        return lines
    indent = " " * (widths[0] + 2)
    return [
        line for row in padded for line in ["  ".join(row[:ON_FIRST_LINE]).rstrip()] +
        textwrap.wrap("  ".join(row[ON_FIRST_LINE:]).strip(), width, initial_indent=indent,
                      subsequent_indent=indent, break_on_hyphens=False)
    ]


def _cells(row: FailureRow, began: float) -> Tuple[str, ...]:
    return tuple(
        clean(cell) for cell in (f"{row.at - began:.1f}", str(row.visitor),
                                 row.stop or "-", row.node or "-", row.call, row.kind,
                                 row.recovery, f"{row.lost:.1f} s"))
