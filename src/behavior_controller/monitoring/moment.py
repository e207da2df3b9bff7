"""A run at one moment, for an operator: the card "Now" and the line "Robot".

Page, ``missionStatus`` and report show the same fields, the terminal the line. They are made from
the model of the run and from nothing else.
"""
from typing import Iterator, List, Tuple

from behavior_controller.execution.events import HealthChanged, Paused, Recovering, TreeNode
from behavior_controller.execution.health import FAILING, GONE, NEW, SILENT
from behavior_controller.execution.state import Robot, State, Step
from behavior_controller.monitoring.parts import (
    ASLEEP, BUSY, Card, ENDED, HELD, IDLE, PAUSED, RETRY, RobotLine, STEP, WAIT)
from behavior_controller.monitoring.story import (
    cause, condition, conditions, listed, stop_name, step_words)
from behavior_controller.robot.requests import GoTo, Words
from behavior_controller.text import clean

HOME = "home"

MOST_NAMED = 4
"""How many nodes an instruction names; of more it says the number."""

IN_TURN = {"Sequence", "SequenceWithMemory", "ReactiveSequence", "AsyncSequence"}
"""The controls that go on to their next child when one succeeds."""

AS_CHILD = {"Fallback", "ReactiveFallback", "AsyncFallback", "ForceSuccess", "SubTree", "Timeout",
            "Delay", "RetryUntilSuccessful", "RunOnce"}
"""The nodes that succeed when a child does."""

AT_ONCE = {"Script", "SetBlackboard", "UnsetBlackboard", "AlwaysSuccess"}
"""The leaves that succeed and have the robot do nothing."""

AGAIN = {"KeepRunningUntilFailure"}
"""The nodes that begin again when their child succeeds."""


# ----------------------------------------------------------------------------------------- the card


def card(state: State) -> Card:
    """Return what the run does."""
    where = _where(state)
    if state.finished is not None:
        return Card(ENDED, state.finished.outcome, where, state.at)
    if state.held:
        uid, since = list(state.held.items())[-1]
        return Card(HELD, f"held by a breakpoint of Groot2 at {_name(state, uid)}", where,
                    since, waits_for="its release in Groot2", uid=uid)
    words, since = state.suspended
    if words:
        return Card(PAUSED, words, where, since, waits_for="the operator's call of start")
    if state.step is not None:
        return _of_step(state, state.step, where)
    return _of_tree(state, where)


def _where(state: State) -> str:
    visit, stop = state.visit, state.stop
    parts = []
    if visit is not None and not visit.outcome and visit.arrived is not None:
        parts.append(f"visitor {visit.number}")
    if stop is not None:
        parts.append(stop_name(stop))
    return " · ".join(parts)


def _of_step(state: State, step: Step, where: str) -> Card:
    exchange, waits_for, trouble = state.waits_for, "", state.held_by
    if exchange is not None:
        waits_for = "the answer of " + exchange.service
    kind = WAIT if step.is_wait else STEP
    if isinstance(step.cause, Recovering):
        kind, trouble = RETRY, state.robot.trouble(step.cause.failure.resource)
    elif isinstance(step.cause, Paused):
        return _of_pause(state, step, step.cause)
    return Card(kind, step_words(step), where, step.began, step.until, step.attempt, step.attempts,
                waits_for, condition(trouble) if trouble is not None else "",
                state.due or next_node(state, step.uid), step.uid)


def _of_pause(state: State, step: Step, paused: Paused) -> Card:
    trouble = state.robot.trouble(paused.failure.resource)
    why = condition(trouble) if trouble is not None else "failed last: " + cause(paused.failure)
    return Card(PAUSED, step_words(step), "", step.began, step.until, trouble=why,
                next=state.due or "the next visit")


def _of_tree(state: State, where: str) -> Card:
    """Return the card for a run without a step, from what is asked of the robot beside the steps,
    as the safe state is, and from the statuses of the nodes.
    """
    if state.exchanges:
        exchange = state.exchanges[0]
        words = exchange.request.words or Words("asking " + exchange.service)
        return Card(STEP, clean(" ".join(filter(None, (words.doing, words.what)))), where,
                    exchange.asked, waits_for="the answer of " + exchange.service)
    uid = state.letters.rfind("R") + 1
    if uid:
        node, since = state.nodes[uid - 1], state.running.get(uid)
        if node.type in ("Sleep", "Delay"):
            until = since + node.pause if since is not None and node.pause else None
            return Card(ASLEEP, "asleep", where, since, until, next=next_node(state, uid), uid=uid)
        return Card(
            BUSY, "runs " + _name(state, uid), where, since, next=next_node(state, uid), uid=uid)
    if state.visit is None:
        return Card(IDLE, "nothing runs")
    is_over = state.visit.ended is not None
    return Card(IDLE, "between two visits" if is_over else "between two steps", where)


def _name(state: State, uid: int) -> str:
    node = state.nodes[uid - 1] if 0 < uid <= len(state.nodes) else None
    if node is None:
        return f"node {uid}"
    is_named = node.name not in ("", node.type)
    return clean(f"{node.name} ({node.type})" if is_named else node.type)


def next_node(state: State, uid: int) -> str:
    """Return the name of the first leaf that follows when node ``uid`` succeeds, or that the visit
    ends; empty if the tree leaves that open.
    """
    nodes = state.nodes
    while 0 < uid <= len(nodes):
        parent = nodes[uid - 1].parent
        if not parent:
            return "the end of the visit"
        kind = nodes[parent - 1].type
        later = next(_children(nodes, parent, uid), None) if kind in IN_TURN else None
        if later is not None:
            return _first_leaf(state, later)
        if kind in AGAIN:
            return _first_leaf(state, uid)
        if kind not in IN_TURN and kind not in AS_CHILD:
            return ""
        uid = parent
    return ""


def _children(nodes: Tuple[TreeNode, ...], parent: int, after: int) -> Iterator[int]:
    return (uid for uid in range(after + 1, len(nodes) + 1) if nodes[uid - 1].parent == parent)


def _first_leaf(state: State, uid: int) -> str:
    """Return the name of the leaf that does something first if node ``uid`` is ticked; empty if
    that is open.
    """
    nodes = state.nodes
    # in document order the first child follows its parent
    while uid < len(nodes) and nodes[uid].parent == uid and not _is_open(nodes[uid - 1]):
        uid += 1
    if _is_open(nodes[uid - 1]):
        return ""
    return next_node(state, uid) if nodes[uid - 1].type in AT_ONCE else _name(state, uid)


def _is_open(node: TreeNode) -> bool:
    """Whether a pre-condition, or the value of an entry, decides whether its first child runs."""
    return node.has_condition or node.type.startswith("Switch")


# ---------------------------------------------------------------------------------------- the robot


def robot_line(state: State) -> RobotLine:
    """Return how the robot is."""
    robot, instruction = state.robot, _instruction(state)
    return RobotLine(not robot.ill, conditions(robot.ill) or _alive(state),
                     _attention(robot), _movement(robot), _place(robot), _safe(state), instruction)


def _alive(state: State) -> str:
    return "all nodes in use answer" if state.started is not None else "not yet asked"


def _safe(state: State) -> str:
    """Return after a stop whether the safe state was reached."""
    if state.safe_state is None:
        return ""
    failed = [part.what for part in state.safe_state.parts if part.failure is not None]
    if not failed:
        return "safe state reached"
    return clean(f"safe state not reached: {listed(failed)} may be on")


def _cannot_drive(robot: Robot) -> bool:
    trouble = robot.trouble(robot.services.get(GoTo.__name__, ""))
    return trouble is not None and trouble.respect == GONE


def _attention(robot: Robot) -> str:
    if robot.attention is None:
        return "unknown"
    mode = robot.attention.state
    return "off" if mode == "disabled" else f"on ({mode})"


def _movement(robot: Robot) -> str:
    if robot.animation is None:
        return "unknown"
    return "on" if robot.animation.state == "enabled" else "off"


def _place(robot: Robot) -> str:
    last = "at " + robot.last_place if robot.last_place else ""
    if robot.goal is not None:
        return "driving " + _to(robot.goal_name or "{:g}, {:g}".format(*robot.goal[:2]))
    if robot.place is not None:
        return last or "at {:g}, {:g}".format(*robot.place[:2])
    if robot.goal_name:
        return f"last seen {last or 'at the start'}, on the way {_to(robot.goal_name)}"
    return "place unknown"


def _to(goal: str) -> str:
    return goal if goal == HOME else "to " + goal


def _instruction(state: State) -> str:
    """Return what a person has to do; it stays until that is done."""
    robot = state.robot
    steps = list(_repairs(state))
    is_away = robot.goal_name and (robot.place is None or robot.last_place != HOME)
    # at a stop the visit goes on as soon as it can drive again
    is_stuck = robot.place is None and _cannot_drive(robot)
    if is_away and (state.finished is not None or robot.is_lost or is_stuck):
        steps.append("take the robot home")
    text = clean("; ".join(steps))
    return text[:1].upper() + text[1:]


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
    for respect in (SILENT, FAILING):
        nodes = _nodes(ill, respect)
        if nodes:
            yield f"check {_named(nodes)}: {'it is' if len(nodes) == 1 else 'they are'} {respect}"
    step = state.step.cause if state.step is not None else None
    is_known = isinstance(step, Paused) and state.robot.trouble(step.failure.resource) is not None
    if isinstance(step, Paused) and not step.awaited and not is_known:
        yield "repair what fails: " + cause(step.failure)
    if state.safe_state is not None:
        off = [part.what for part in state.safe_state.parts if part.failure is not None]
        if off:
            yield f"switch {listed(off)} off by hand"


def _named(nodes: List[str]) -> str:
    """Return the names of a few nodes, or how many they are: what to do has to fit a phone."""
    return listed(nodes) if len(nodes) <= MOST_NAMED else f"{len(nodes)} nodes"


def _nodes(ill: Tuple[HealthChanged, ...], respect: str) -> List[str]:
    """Return the nodes, or else the services, that are not well in that respect."""
    changes = [change for change in ill if change.respect == respect and change.kind != "master"]
    names = ("/" + change.node if change.node else change.name for change in changes)
    return list(dict.fromkeys(names))
