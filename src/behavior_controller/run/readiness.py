"""Whether all is ready for a demonstration: what the mission needs, and what is known of it.

A row says no more than the record proves: a service that was not asked yet is untried.
"""
from typing import Iterator, List

from msgspec import Struct

from behavior_controller.run.events import AWAITED, MISSING, READY, Checked
from behavior_controller.run.state import State
from behavior_controller.run.story import condition
from behavior_controller.text import clean

UNTRIED = "untried"
"""The state of a service that is there, and was not asked yet."""

UNREADY = (AWAITED, MISSING)
"""The states of what has to be waited for, or repaired."""

class ReadyRow(Struct, frozen=True):
    """A part of the list: ``kind`` in a word, and the state and words of ``Checked``."""

    kind: str
    name: str
    state: str
    text: str


def readiness(state: State, is_over: bool = False) -> List[ReadyRow]:
    """Return the parts in the order in which they were looked at. ``is_over``: the controller has
    ended, even if the run does not say so."""
    return list(_rows(state, is_over or state.finished is not None))


def is_ready(rows: List[ReadyRow]) -> bool:
    """Return whether a visitor can be received: nothing has to be waited for, or repaired."""
    return bool(rows) and not any(row.state in UNREADY for row in rows)


def _rows(state: State, is_over: bool) -> Iterator[ReadyRow]:
    if is_over:
        yield ReadyRow("run", "controller", MISSING, "it has ended: start it again")
    elif state.started is None and state.starting:
        yield ReadyRow("run", "controller", AWAITED, state.starting)
    for check in state.checks.values():
        trouble = state.robot.trouble(check.name)
        if trouble is not None:
            yield ReadyRow(check.kind, check.name, MISSING, clean(condition(trouble)))
        elif check.state == READY and check.kind in ("service", "action"):
            yield _service(state, check)
        elif check.state == READY and check.kind == "topic":
            yield _topic(state, check)
        else:
            yield ReadyRow(check.kind, check.name, check.state, clean(check.text))


def _service(state: State, check: Checked) -> ReadyRow:
    if check.name in state.robot.services.values():
        return ReadyRow(check.kind, check.name, READY, "there, and was asked")
    return ReadyRow(check.kind, check.name, UNTRIED, "there, its type is right; not asked yet")


def _topic(state: State, check: Checked) -> ReadyRow:
    said = state.said.get(check.name)
    if said is None:
        text = "published, its type is right; nothing was heard yet"
        return ReadyRow(check.kind, check.name, UNTRIED, text)
    rate = f", {said.rate:g} messages a second" if said.rate else ""
    return ReadyRow(check.kind, check.name, READY, clean(said.words + rate))
