"""A run at one moment, for an operator: the card "Now" and the line "Robot".

Page, ``missionStatus`` and report show the same fields, the terminal the line. They are made from
the model of the run and from nothing else.
"""
import re
from typing import Iterator, List, Literal, Optional, Tuple

from msgspec import Struct
from msgspec.structs import replace

from behavior_controller.run.events import HealthChanged, Paused
from behavior_controller.run.health import FAILING, GONE, NEW, SHORT, SILENT
from behavior_controller.run.state import HOME, Robot, State, Step
from behavior_controller.run.story import (
    STOP_BUTTON, cause, condition, conditions, end_headline, few, listed, may_be_under_way,
    may_move, resume, run_end, safe_parts, stop_name, step_words, switched_off, to_check,
    under_way_warning)
from behavior_controller.robot.requests import SetAnimation, SetAttention
from behavior_controller.text import clean, form, joined

_MOST_NAMED = 4
"""How many nodes an instruction names; of more it says the number."""

Kind = Literal["step", "wait", "retry", "held", "asleep", "paused", "busy", "idle", "ended"]
"""The kinds of cards."""


class Card(Struct, frozen=True):
    """What the run does now. Times are Unix seconds."""

    kind: Kind
    what: str = ""
    where: str = ""  # the visitor, and the stop
    since: Optional[float] = None
    until: Optional[float] = None  # at the latest
    attempt: int = 1
    attempts: int = 1
    waits_for: str = ""
    trouble: str = ""  # with what it waits for
    next: str = ""  # the node that follows if this succeeds; empty: the tree does not say it
    uid: int = 0
    also: List[str] = []  # what it does at the same time


class RobotLine(Struct, frozen=True):
    """How the robot is, and what a person has to do, if anything. ``attention`` and ``movement``
    are empty if the mission does not use them and nothing is known of them."""

    is_well: bool  # all that is used answers
    alive: str
    attention: str
    movement: str
    place: str
    safe: str = ""  # after a stop: what was reached of the safe state
    instruction: str = ""

    @property
    def text(self) -> str:
        """All on one line, the instruction last."""
        attention = self.attention and "attention " + self.attention
        movement = self.movement and "lifelike movement " + self.movement
        text = joined(" · ", self.alive, attention, movement, self.place, self.safe)
        return joined(". ", text, self.instruction)


def card_line(now: Card, at: float) -> str:
    """Return the card on one line, as of that time."""
    what = now.what
    if now.attempt > 1 and now.kind != "retry":
        what += f" (attempt {now.attempt} of {now.attempts})"
    if now.since is not None and now.kind != "ended":
        what += f", {max(0.0, at - now.since):.0f} s"
        if now.until is not None:
            what += f" of at most {now.until - now.since:g} s"
    what = joined("; ", what, now.trouble, *("also " + words for words in now.also))
    waits_for = now.waits_for and "waits for " + now.waits_for
    return joined(" · ", now.where, what, waits_for, now.next and "next: " + now.next)


# ----------------------------------------------------------------------------------------- the card


def card(state: State) -> Card:
    """Return what the run does."""
    where = _where(state)
    if state.finished is not None:
        what, run = end_headline(state), run_end(state, is_short=True)
        if run == what:
            run = ""
        return Card("ended", what, where, state.at, trouble=run)
    if state.held:
        uid, since = list(state.held.items())[-1]
        return Card("held", f"held by a breakpoint of Groot2 at {_name(state, uid)}", where,
                    since, waits_for="its release in Groot2", uid=uid)
    words, since = state.suspended
    if words:
        call = state.resume and f": {resume(state.resume)}"
        return Card("paused", words, where, since, waits_for=f"the operator{call}")
    if state.step is not None:
        return _of_step(state, state.step, where)
    return _of_tree(state, where)


def _where(state: State) -> str:
    visit, stop, where = state.visit, state.stop, ""
    if visit is not None and visit.has_visitor:
        where = f"visitor {visit.number}"
    if stop is not None:
        where = joined(" · ", where, stop_name(stop))
    return where


def _of_step(state: State, step: Step, where: str) -> Card:
    exchange, trouble, following = state.waits_for, state.held_by, next_node(state, step.uid)
    kind: Kind = "step"
    waits_for = why = ""
    if exchange is not None:
        waits_for = "the answer of " + exchange.service
    if step.cause is not None:
        kind, trouble = "retry", state.robot.trouble(step.cause.failure.resource)
    elif step.is_wait:
        kind = "wait"
    if trouble is not None:
        why = condition(trouble)
    if isinstance(step.cause, Paused):
        kind, where, following = "paused", "", "the next visit"
        why = why or "the last failure: " + cause(step.cause.failure, is_short=True)
    for recovery in state.recoveries:
        if step.is_wait and recovery.uid == step.uid:  # its node is done again after the wait
            following = _purpose(state, state.uids.get(recovery.path, 0))
    also = [step_words(other) for other in state.steps if other is not step and not other.cause]
    return Card(kind, step_words(step), where, step.began, step.until, step.attempt, step.attempts,
                waits_for, why, state.due or following, step.uid, also)


def _of_tree(state: State, where: str) -> Card:
    """Return the card for a run without a step, from what is asked of the robot beside the steps,
    as the safe state is, and from the statuses of the nodes.
    """
    if state.exchanges:
        exchange = state.exchanges[0]
        return Card("step", exchange.words, where, exchange.asked,
                    waits_for="the answer of " + exchange.service)
    uid = state.letters.rfind("R") + 1
    if uid:
        pause, since, until = state.nodes[uid - 1].pause, state.running.get(uid), None
        following = next_node(state, uid)
        if not pause:
            what = "runs " + _name(state, uid)
            return Card("busy", what, where, since, next=following, uid=uid)
        if since is not None and pause > 0.0:
            until = since + pause
        return Card("asleep", "asleep", where, since, until, next=following, uid=uid)
    if state.visit is None and state.starting:
        return Card("idle", "starting: " + state.starting)
    if state.visit is None:
        return Card("idle", "nothing runs")
    if state.visit.ended is None:
        return Card("idle", "between two steps", where)
    return Card("idle", "between two visits", where)


def _name(state: State, uid: int) -> str:
    node = state.node(uid)
    if node is None:
        return f"node {uid}"
    if node.name in ("", node.type):
        return clean(node.type)
    return clean(f"{node.name} ({node.type})")


def next_node(state: State, uid: int) -> str:
    """Return in words which leaf follows when node ``uid`` succeeds, or which two may, or that the
    visit ends; empty if the tree leaves that open, or has no words for it.
    """
    node = state.node(uid)
    if node is None:
        return ""
    words = [_purpose(state, other) if other else "the end of the visit" for other in node.next]
    return " or ".join(words) if all(words) else ""


def _purpose(state: State, uid: int) -> str:
    """Return the name of a leaf if that is a phrase, or else what it is for: never its type."""
    node = state.node(uid)
    if node is None:
        return ""
    summary = state.tree.summaries.get(node.type, "")
    if node.pause:
        summary = "a pause"
    # what follows the first clause is about the node type
    words = re.split(r"[.;:,]( |$)| \(", summary)[0].rstrip("?")
    if " " in node.name or not words and node.name != node.type:
        return clean(node.name)
    return clean(words[:1].lower() + words[1:])


# ---------------------------------------------------------------------------------------- the robot


def robot_line(state: State) -> RobotLine:
    """Return how the robot is."""
    robot, alive = state.robot, "not yet asked"
    mode, movement = _unsaid(state, SetAttention), _unsaid(state, SetAnimation)
    if robot.attention is not None:
        mode = _SWITCHED.get(robot.attention.state, f"on ({robot.attention.state})")
    if robot.animation is not None:
        movement = _SWITCHED.get(robot.animation.state, "off")
    if state.started is not None:
        alive = "all nodes in use answer"
    return RobotLine(not robot.ill, conditions(robot.ill) or alive, mode, movement, _place(robot),
                     _safety(state), instruction(state))


_SWITCHED = {"disabled": "off", "enabled": "on"}


def _unsaid(state: State, kind: type) -> str:
    """Return what is said of a part of the robot whose last request, of that kind, is not known."""
    used = state.start.requests
    if used is None or kind.__name__ in used:
        return "unknown"
    return ""


def _safety(state: State) -> str:
    """Return after a stop what is off, and what may be on or under way; ``safe`` alone is said only
    when neither may be.
    """
    if state.safe_state is None:
        return ""
    off, under_way = switched_off(state), may_be_under_way(state)
    left_on = listed(safe_parts(state, is_off=False))
    if not left_on and not under_way:
        return joined(": ", "safe", off)
    return clean(joined("; ", off, left_on and left_on + " may be on", under_way))


def _place(robot: Robot) -> str:
    last = robot.last_place and "at " + robot.last_place
    if robot.goal is not None:
        verb = "driving"
        if robot.cannot_drive:  # nothing has taken the goal
            verb = "asked to drive"
        return f"{verb} {_to(robot.goal_name or f'{robot.goal.x:g}, {robot.goal.y:g}')}"
    if robot.place is not None:
        return last or f"at {robot.place.x:g}, {robot.place.y:g}"
    if not robot.way:
        return "place unknown"
    return f"last seen {last or 'at the start'}, on the way {_to(robot.way)}"


def _to(goal: str) -> str:
    return goal if goal == HOME else "to " + goal


def instruction(state: State) -> str:
    """Return what a person has to do; it stays until that is done."""
    steps = list(_repairs(state))
    if state.safe_state is not None and may_move(state):
        steps.insert(0, STOP_BUTTON)
    if state.is_stranded:
        steps.append("take the robot home")
    text = clean("; ".join(steps))
    return text[:1].upper() + text[1:]


def left_running(state: State) -> str:
    """Return what may be on or under way after a run without a safe state, and what a person has to
    do; empty: nothing."""
    robot = state.robot
    on = [kind.switches
          for kind, last in ((SetAttention, robot.attention), (SetAnimation, robot.animation))
          if kind.__name__ in robot.services and (last is None or last.state != "disabled")]
    text = under_way_warning(state)
    if on:
        by_hand = f"switch {form(len(on), 'it', 'them')} off by hand"
        text = joined("; ", f"{listed(on)} may be on: {by_hand}", text)
    return text and clean("the robot may be live: " + text)


def _repairs(state: State) -> Iterator[str]:
    """Yield what has to be repaired, restarted or switched off by hand."""
    ill = state.robot.ill
    gone = _nodes(ill, GONE)
    if gone:
        yield "restart " + _named(gone)
    for change in ill:
        if change.kind == "master" and change.respect == GONE:
            yield "check the ROS master, and start it again if it has ended"
        elif change.kind == "master" and change.respect == NEW:
            yield "restart the robot's nodes as soon as it is free"
        elif change.respect == SHORT:
            yield f"end what uses up the files, threads or memory of {change.name}"
    for respect in (SILENT, FAILING):
        nodes = _nodes(ill, respect)
        if nodes:
            yield f"check {_named(nodes)}: {form(len(nodes), 'it is', 'they are')} {respect}"
    pause = state.pause
    if pause is not None and not pause.awaited:
        if state.robot.trouble(pause.failure.resource) is None:
            failed = replace(pause.failure, resource="")
            yield f"{to_check(pause.failure)}: {cause(failed, is_short=True)}"
    if state.held:
        yield "release the breakpoint in Groot2, or disconnect Groot2"
    left_on = safe_parts(state, is_off=False)
    if left_on:
        yield f"switch {listed(left_on)} off by hand"


def _named(nodes: List[str]) -> str:
    """Return the names of a few nodes, or how many they are: what to do has to fit a phone."""
    return few(nodes, ["node"] * len(nodes), _MOST_NAMED)


def _nodes(ill: Tuple[HealthChanged, ...], respect: str) -> List[str]:
    """Return the nodes, or else the services, that are not well in that respect."""
    return list(dict.fromkeys(change.owner for change in ill
                              if change.respect == respect and change.kind != "master"))
