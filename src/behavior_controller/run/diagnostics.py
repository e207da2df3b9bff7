"""The diagnostics of a run (REP 107), from its model: the mission, the recovery, the master, the
simulated time, and each node of the robot."""
from typing import Dict, Iterable, List, NamedTuple

from behavior_controller.run.events import Recovering
from behavior_controller.run.health import SIMULATED_TIME, SLOW
from behavior_controller.run.state import State
from behavior_controller.folders import mission_name
from behavior_controller.run.moment import card
from behavior_controller.run.story import condition, conditions, counted, recovering, why
from behavior_controller.robot.declarations import Interface, Offer

OK, WARN, ERROR = range(3)
"""The levels of ``diagnostic_msgs/DiagnosticStatus``."""

_LEVELS = {SLOW: WARN}  # of troubles that are no errors


class Status(NamedTuple):
    """How one component is; ``values`` are details for people."""

    name: str
    level: int
    message: str
    values: Dict[str, str]


def statuses(state: State, robot: Interface, offers: Iterable[Offer],
             is_simulated: bool = False) -> List[Status]:
    """Return how the mission is, and what it uses: these ``offers`` of the robot, and the simulated
    time if it goes by that."""
    nodes: Dict[str, List[str]] = {}
    for offer in offers:
        nodes.setdefault(robot.node_of(offer), []).append(robot.name_of(offer))
    parts = [_of_troubles(state, "/" + node, names) for node, names in nodes.items()]
    masters = [change.name for change in state.robot.ill if change.kind == "master"]
    clocks = [_simulated_time(state)] * is_simulated
    return [_mission(state), _recovery(state), _of_troubles(state, "master", masters),
            *clocks, *parts]


def _mission(state: State) -> Status:
    now, level = card(state), OK
    if state.finished is not None and state.finished.exit_code:
        level = ERROR
    elif state.finished is None and (now.kind == "retry" or state.pause is not None):
        level = WARN
    details = {"mission": mission_name(state.start.mission), "visits": counted(state),
               "where": now.where, "waits for": now.waits_for, "next": now.next}
    return Status("mission", level, now.what, details)


def _recovery(state: State) -> Status:
    """Return what is tried again; else what this visit has given up."""
    step, gave_up = state.step, state.course.gave_up
    if state.recoveries:
        last = state.recoveries[-1]
        words = "recovering from a failure"
        if step is not None and isinstance(step.cause, Recovering):
            words = recovering(step.cause)
        return Status("recovery", WARN, words, {"node": last.node, "path": last.path})
    if state.course.given_up is not None and gave_up is not None:
        return Status("recovery", ERROR, "gave up: " + why(gave_up), {"node": gave_up.node})
    return Status("recovery", OK, "nothing to recover from", {})


def _simulated_time(state: State) -> Status:
    still = conditions(change for change in state.robot.ill if change.kind == SIMULATED_TIME)
    if still:
        return Status("/clock", WARN, still, {})
    return Status("/clock", OK, "goes on", {})


def _of_troubles(state: State, name: str, parts: List[str]) -> Status:
    """Return how a node is by those of its services, actions and topics that are not well."""
    troubles = {part: state.robot.trouble(part) for part in parts}
    ill = [change for change in troubles.values() if change is not None]
    level = max((_LEVELS.get(change.respect, ERROR) for change in ill), default=OK)
    details = {part: "ok" if change is None else change.status for part, change in troubles.items()}
    return Status(name, level, "; ".join(map(condition, ill)) or "answers", details)
