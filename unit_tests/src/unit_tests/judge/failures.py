"""The failures of a run as rows: visitor, stop, node, call, the recovery from it, the time that it
cost."""
import sys
import textwrap
from typing import List, NamedTuple, Sequence, Tuple

from behavior_controller.run.history import Run
from behavior_controller.run.state import LeafFailure, RecoveryRound
from behavior_controller.text import clean, joined
from behavior_controller.simulation.faults import WRONG

from unit_tests.judge.reference import DONE, HANDLERS
from unit_tests.judge.journal_check import Pair
from unit_tests.judge.verdict import Verdict

TRIED_AGAIN = "tried again"
"""The recovery from a failure whose next attempt failed too."""

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


def failure_rows(verdict: Verdict) -> List[FailureRow]:
    """Return a row for each injected fault, and for each failure beside them that is no false
    condition."""
    run, found = verdict.facts.run, []
    faults = [pair for pair in verdict.journal_check.pairs if pair.fault]
    for failed in run.failures:
        if failed.is_false_condition or failed.node in HANDLERS:
            continue
        outcome, until = _recovery(run, failed)
        pair = next((pair for pair in faults if _explains(pair, failed)), None)
        at, call, kind = failed.at, failed.failure.resource or "-", failed.failure.cause.value
        if pair is not None:
            faults.remove(pair)
            at, call, kind = pair.time, pair.call, pair.fault
        # in simulated time the node may note its crash after the controller has met it
        found.append(FailureRow(at, failed.visit, _stop(run, at), failed.node, call, kind, outcome,
                                max(0.0, until - at), pair is not None))
    for pair in faults:  # that are no failures of a node
        visit, node, outcome = run.at(pair.time).visit, "", NOT_ON_RECORD
        if pair.query is not None:
            node = pair.query.node
            outcome = HALTED if pair.query.result is None else IN_SAFE_STATE
        found.append(FailureRow(
            pair.time, visit.number if visit is not None else 1, _stop(run, pair.time), node,
            pair.call, pair.fault, outcome, 0.0, True))
    return sorted(found, key=lambda row: row.at)


def _stop(run: Run, at: float) -> str:
    """Return the stop that was under way at a time; empty: none."""
    stop = run.at(at).stop
    return stop.name if stop is not None else ""


def _rounds(run: Run, failed: LeafFailure) -> List[RecoveryRound]:
    """Return the recovery from a failure, and those around that one."""
    return [recovery for recovery in run.recoveries
            if recovery.recovered is not None and not recovery.is_halted
            and any(other is failed for other in recovery.failures + recovery.instead)]


def _recovery(run: Run, failed: LeafFailure) -> Tuple[str, float]:
    """Return what the recovery did about a failure, and when the step was done, tried again or
    given up."""
    inner = next(iter(_rounds(run, failed)), None)
    if inner is None:
        return NO_RECOVERY, failed.at
    failures = inner.failures + inner.instead
    later = next((other for other in failures if other.at > failed.at), None)
    if later is not None:
        if any(other is later for other in inner.instead):
            return f"{later.node} instead", later.at
        return TRIED_AGAIN, later.at
    # an outer HandleFallBack goes on with the failure that an inner one gave up
    around = _rounds(run, failures[0])
    return ", then ".join(dict.fromkeys(map(_outcome, around))), around[-1].decided


def _explains(pair: Pair, failed: LeafFailure) -> bool:
    """Return whether a fault is that of a failure on record: the same service and cause, the newest
    before it."""
    query = pair.query
    if query is None or query.service != failed.failure.resource or query.node not in (
            "", failed.node) or (query.answered or 0.0) > failed.at:
        return False
    return query.outcome == failed.failure.cause.value or pair.fault == WRONG


def _outcome(recovery: RecoveryRound) -> str:
    words = recovery.outcome
    if words == DONE:
        words += f" by retry {recovery.attempts}"
    if recovery.recovered is None:
        return words
    return joined(": ", words, recovery.recovered.reason)


# ---------------------------------------------------------------------------------------- the table

TABLE_HEAD = ("time", "visitor", "stop", "node", "call", "kind", "recovery", "lost")
SIDES = ">><<<<<>"
"""The side to which each column is set: to the left or to the right."""

ON_FIRST_LINE = 4
"""The number of columns on the first of two lines, if one line is not wide enough."""


def table(rows: Sequence[FailureRow], began: float, width: int = sys.maxsize) -> List[str]:
    """Return the rows as lines of text of at most ``width``; times are in seconds from ``began``
    on."""
    cells = [TABLE_HEAD] + [_cells(row, began) for row in rows]
    widths = [max(len(row[column]) for row in cells) for column in range(len(TABLE_HEAD))]
    padded = [[f"{cell:{side}{size}}" for cell, side, size in zip(row, SIDES, widths)]
              for row in cells]
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
    return tuple(map(clean, (
        f"{row.at - began:.1f}", str(row.visitor), row.stop or "-", row.node or "-", row.call,
        row.kind, row.recovery, f"{row.lost:.1f} s")))
