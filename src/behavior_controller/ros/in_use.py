"""One controller for each service of a robot: a controller does not start while another one asks
the same services.

Nothing is registered for this: each controller tells whoever asks its node which services it asks,
so nothing of a controller that was killed is left. Two that start at the same moment see each other
once both are registered; the one whose name comes first stays.
"""
import contextlib
import time
from functools import partial
from typing import Dict, FrozenSet, List, Tuple

import rospy

from behavior_controller.errors import NodesMissing
from behavior_controller.missions.load import Mission
from behavior_controller.robot.declarations import Service
from behavior_controller.ros.master import IN_USE, IN_USE_METHOD, ask_at_start
from behavior_controller.ros.tcpros import Trouble, ask, ask_master
from behavior_controller.ros.timeouts import run_together
from behavior_controller.ros.types import resolved

ANSWER_LIMIT = 2.0
"""Seconds in which a controller must have answered. Other nodes answer at once that they do not
know the question; one that says nothing cannot be told from one that is gone."""

LOOK_AGAIN = 0.1
"""Seconds between two questions to a controller that starts at the same moment."""


def asked_services(mission: Mission) -> FrozenSet[str]:
    """Return the names of the services and actions that a controller of ``mission`` asks, also for
    the safe state, and of the topics that it commands."""
    robot = mission.settings.interface
    safe = robot.used({type(request) for request in robot.safe_state}, ())
    return frozenset(resolved(offer) for offer in (*mission.offers, *safe)
                     if isinstance(offer, Service))


def check_unused(services: FrozenSet[str], is_registered: bool = False) -> None:
    """Raise NodesMissing if another controller asks one of ``services``. Once this node
    ``is_registered``, it waits for one that starts at the same moment, unless that one's name comes
    first: the other may have looked before this one was registered."""
    me, is_open = rospy.get_name(), True
    while is_open:
        is_open = False
        for node, (is_running, others) in sorted(_controllers(me).items()):
            shared = sorted(services.intersection(others))
            if shared and is_registered and not is_running and me < node:
                is_open = True
            elif shared:
                if is_registered:
                    IN_USE.services = frozenset()  # nobody needs to wait for this node
                raise NodesMissing(_refusal(node, shared))
        time.sleep(LOOK_AGAIN * is_open)


def _refusal(node: str, shared: List[str]) -> str:
    more = f" and {len(shared) - 1} more of them" * (len(shared) > 1)
    return (f"node {node} already controls this robot: it asks {shared[0]}{more}, and each service "
            "has one controller; stop that node, or set robot for another robot")


def _controllers(me: str) -> Dict[str, Tuple[bool, Tuple[str, ...]]]:
    """Return the controllers beside the node ``me`` by name: whether they run, and the services
    that they ask."""
    publishers, _, services = ask_at_start("getSystemState")
    nodes = {node for _, names in publishers + services for node in names} - {me}
    answers: Dict[str, Tuple[bool, Tuple[str, ...]]] = {}

    def inquire(node: str) -> None:
        with contextlib.suppress(Trouble):  # it is no controller, or gone
            uri = ask_master("lookupNode", node, seconds=ANSWER_LIMIT)
            answers[node] = ask(uri, IN_USE_METHOD, seconds=ANSWER_LIMIT)

    run_together([partial(inquire, node) for node in nodes], ANSWER_LIMIT)
    return dict(answers)
