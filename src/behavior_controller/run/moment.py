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
from behavior_controller.text import clean

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
        parts = (self.alive, attention, movement, self.place, self.safe)
        text = " · ".join(filter(None, parts))
        return f"{text}. {self.instruction}" if self.instruction else text


def card_line(now: Card, at: float) -> str:
    """Return the card on one line, as of that time."""
    parts = [now.what]
    if now.attempt > 1 and now.kind != "retry":
        parts.append(f" (attempt {now.attempt} of {now.attempts})")
    if now.since is not None and now.kind != "ended":
        limit = "" if now.until is None else f" of at most {now.until - now.since:g} s"
        parts.append(f", {max(0.0, at - now.since):.0f} s{limit}")
    if now.trouble:
        parts.append("; " + now.trouble)
    parts += ["; also " + words for words in now.also]
    waits_for = now.waits_for and "waits for " + now.waits_for
    following = now.next and "next: " + now.next
    return " · ".join(filter(None, (now.where, "".join(parts), waits_for, following)))


# ----------------------------------------------------------------------------------------- the card


def card(state: State) -> Card:
    """Return what the run does."""
    where = _where(state)
    if state.finished is not None:
        what, run = end_headline(state), run_end(state, is_short=True)
        return Card("ended", what, where, state.at, trouble=run if run != what else "")
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
    visit, stop = state.visit, state.stop
    parts = []
    if visit is not None and visit.has_visitor:
        parts.append(f"visitor {visit.number}")
    if stop is not None:
        parts.append(stop_name(stop))
    return " · ".join(parts)


def _of_step(state: State, step: Step, where: str) -> Card:
    exchange, trouble, following = state.waits_for, state.held_by, next_node(state, step.uid)
    kind: Kind = "wait" if step.is_wait else "step"
    waits_for = ""
    if exchange is not None:
        waits_for = "the answer of " + exchange.service
    if step.cause is not None:
        kind, trouble = "retry", state.robot.trouble(step.cause.failure.resource)
    why = condition(trouble) if trouble is not None else ""
    if isinstance(step.cause, Paused):
        kind, where, following = "paused", "", "the next visit"
        why = why or "the last failure: " + cause(step.cause.failure, is_short=True)
    for recovery in state.recoveries:
        if step.is_wait and recovery.uid == step.uid:  # its node is done again after the wait
            following = _purpose(state, state.uids.get(recovery.path, 0))
    also = [step_words(other) for other in state.steps
            if other is not step and other.cause is None]
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
        node, since = state.nodes[uid - 1], state.running.get(uid)
        what, following = "runs " + _name(state, uid), next_node(state, uid)
        if not node.pause:
            return Card("busy", what, where, since, next=following, uid=uid)
        until = since + node.pause if since is not None and node.pause > 0.0 else None
        return Card("asleep", "asleep", where, since, until, next=following, uid=uid)
    if state.visit is None:
        words = "starting: " + state.starting if state.starting else "nothing runs"
        return Card("idle", words)
    is_over = state.visit.ended is not None
    return Card("idle", "between two visits" if is_over else "between two steps", where)


def _name(state: State, uid: int) -> str:
    node = state.nodes[uid - 1] if 0 < uid <= len(state.nodes) else None
    if node is None:
        return f"node {uid}"
    is_named = node.name not in ("", node.type)
    return clean(f"{node.name} ({node.type})" if is_named else node.type)


def next_node(state: State, uid: int) -> str:
    """Return in words which leaf follows when node ``uid`` succeeds, or which two may, or that the
    visit ends; empty if the tree leaves that open, or has no words for it.
    """
    following = state.nodes[uid - 1].next if 0 < uid <= len(state.nodes) else ()
    words = [_purpose(state, other) if other else "the end of the visit" for other in following]
    return " or ".join(words) if all(words) else ""


def _purpose(state: State, uid: int) -> str:
    """Return the name of a leaf if that is a phrase, or else what it is for: never its type."""
    node = state.nodes[uid - 1] if 0 < uid <= len(state.nodes) else None
    if node is None:
        return ""
    summary = "a pause" if node.pause else state.tree.summaries.get(node.type, "")
    # what follows the first clause is about the node type
    words = re.split(r"[.;:,]( |$)| \(", summary)[0].rstrip("?")
    is_phrase = " " in node.name or not words and node.name != node.type
    return clean(node.name if is_phrase else words[:1].lower() + words[1:])


# ---------------------------------------------------------------------------------------- the robot


def robot_line(state: State) -> RobotLine:
    """Return how the robot is."""
    robot = state.robot
    mode, movement = _unsaid(state, SetAttention), _unsaid(state, SetAnimation)
    if robot.attention is not None:
        mode = robot.attention.state
        mode = "off" if mode == "disabled" else f"on ({mode})"
    if robot.animation is not None:
        movement = "on" if robot.animation.state == "enabled" else "off"
    alive = "all nodes in use answer" if state.started is not None else "not yet asked"
    return RobotLine(not robot.ill, conditions(robot.ill) or alive, mode, movement, _place(robot),
                     _safety(state), instruction(state))


def _unsaid(state: State, kind: type) -> str:
    """Return what is said of a part of the robot whose last request, of that kind, is not known."""
    used = state.started.requests if state.started is not None else None
    return "unknown" if used is None or kind.__name__ in used else ""


def _safety(state: State) -> str:
    """Return after a stop what is off, and what may be on or under way; ``safe`` alone is said only
    when neither may be.
    """
    if state.safe_state is None:
        return ""
    off, left_on = switched_off(state), safe_parts(state, is_off=False)
    under_way = may_be_under_way(state)
    if not left_on and not under_way:
        return f"safe: {off}" if off else "safe"
    on = f"{listed(left_on)} may be on" if left_on else ""
    return clean("; ".join(filter(None, (off, on, under_way))))


def _place(robot: Robot) -> str:
    last = "at " + robot.last_place if robot.last_place else ""
    if robot.goal is not None:
        # of a node that is gone nothing has taken the goal
        verb = "asked to drive" if robot.cannot_drive else "driving"
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
    parts = [f"{listed(on)} may be on: switch {'it' if len(on) == 1 else 'them'} off by hand"
             if on else "", under_way_warning(state)]
    text = "; ".join(filter(None, parts))
    return clean("the robot may be live: " + text) if text else ""


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
            yield f"check {_named(nodes)}: {'it is' if len(nodes) == 1 else 'they are'} {respect}"
    pause = state.step.cause if state.step is not None else None
    if isinstance(pause, Paused) and not pause.awaited:
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
    changes = [change for change in ill if change.respect == respect and change.kind != "master"]
    names = ("/" + change.node if change.node else change.name for change in changes)
    return list(dict.fromkeys(names))
