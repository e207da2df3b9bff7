"""The start-up check: are the robot's nine nodes there, does each answer, and does it speak our types.

A master's entry proves nothing: it outlives its node. So each service and each publisher is connected to and shakes
hands, all at once and each bounded in time; whatever is missing is told in one go.
"""
import threading
import time
from typing import Any, Callable, Dict, List, NamedTuple, Optional, Sequence, Tuple, Union

import rospy

from behavior_controller.bt.engine.wakeup import WakeUp
from behavior_controller.errors import NodesMissing
from behavior_controller.gateway import Cause
from behavior_controller.interface import Interface, Sense, Service, Topic
from behavior_controller.ros.connection import Connection, Trouble, ask_master
from behavior_controller.ros.services import open_service
from behavior_controller.ros.subscription import STEP_LIMIT, open_publisher
from behavior_controller.ros.types import TYPES
from behavior_controller.settings import Settings
from behavior_controller.text import clean

PROBE_LIMIT = 3.0
"""Seconds after which whatever has not answered is counted as missing."""

ROUND = 0.5
"""Seconds between two looks at what is still missing, while the start waits (``startupTimeout``)."""


class Part(NamedTuple):
    """A service or topic that one of the robot's nodes offers."""

    offer: Union[Service, Topic]

    @property
    def name(self) -> str:
        """The resolved name of the service or topic."""
        return rospy.resolve_name(self.offer.name)

    @property
    def kind(self) -> str:
        """``service`` or ``topic``."""
        return "topic" if isinstance(self.offer, Topic) else "service"

    @property
    def node(self) -> str:
        """The robot's node."""
        return self.offer.node

    @property
    def absence(self) -> str:
        """What it means for the robot when this is not there."""
        return self.offer.absence


def parts_of(interface: Interface) -> Tuple[Part, ...]:
    """Return what the nodes of a robot offer."""
    return tuple(map(Part, interface.offers))


class Missing(NamedTuple):
    """A part that did not pass, and why."""

    part: Part
    reason: str

    def __str__(self) -> str:
        """Return a line for an operator."""
        return "{} {} (of node /{}): {}; without it {}".format(
            self.part.kind, self.part.name, self.part.node, clean(self.reason), self.part.absence)


# ---------------------------------------------------------------------------------------------------------- one probe


def _examine(part: Part) -> Optional[str]:
    """Return why ``part`` cannot be used, or None if it can. Ends in bounded time."""
    try:
        look = _examine_topic if isinstance(part.offer, Topic) else _examine_service
        return look(part)
    except Trouble as trouble:
        return "{}: {}".format(trouble.cause.text, trouble)


def _examine_service(part: Part) -> Optional[str]:
    """Connect to a service as a probe does, which its server answers without running anything."""
    connection = Connection()
    answer = open_service(connection, part.name, "*", STEP_LIMIT, probe="1")
    connection.hang_up()
    return _compare(answer, TYPES[part.offer], "its server")


def _examine_topic(part: Part) -> Optional[str]:
    """Connect to each publisher until one is right; else tell of the first."""
    publishers, _, _ = ask_master("getSystemState", seconds=STEP_LIMIT) or ([], [], [])
    nodes = [node for topic, names in publishers if topic == part.name for node in names]
    reasons: List[str] = []
    for node in nodes:
        reason = _examine_publisher(part, node)
        if reason is None:
            return None
        reasons.append(reason)
    return reasons[0] if reasons else "no node publishes it"


def _examine_publisher(part: Part, node: str) -> Optional[str]:
    """Connect to the topic at ``node`` as a subscriber of any type does, and compare what it says that it publishes."""
    connection = Connection()
    try:
        uri = ask_master("lookupNode", node, seconds=STEP_LIMIT)
        if not uri:
            return "node {} does not publish it any more".format(node)
        # under a name of its own: a publisher drops the older of two connections from the same node, our subscription
        answer = open_publisher(connection, uri, part.name, {
            "type": "*", "callerid": rospy.get_name() + "_start_up_check"})
    except Trouble as trouble:
        return "{}: node {} is listed as its publisher, but {}".format(trouble.cause.text, node, trouble)
    finally:
        connection.hang_up()
    return _compare(answer, TYPES[part.offer], "node " + node)


def _compare(answer: Any, wanted: Any, peer: str) -> Optional[str]:
    """Return how the type in a handshake differs from ours, or None."""
    if "error" in answer:
        return "{}: {} says: {}".format(Cause.NOT_REACHABLE.text, peer, answer["error"])
    if answer.get("md5sum") == wanted._md5sum:
        return None
    return "{}: {} has {} (md5 {}), expected is {} (md5 {}); build both from the same srv and msg files".format(
        Cause.TYPE_MISMATCH.text, peer, answer.get("type"), answer.get("md5sum"), wanted._type, wanted._md5sum)


# -------------------------------------------------------------------------------------------------- all of them at once


def find_missing(parts: Sequence[Part], wake: WakeUp, is_stopped: Callable[[], bool]) -> List[Missing]:
    """Examine ``parts`` in parallel and return those that cannot be used, in their order.

    Ends within ``PROBE_LIMIT``, or when ``wake`` says that the operator has stopped us.
    """
    reasons: Dict[Part, Optional[str]] = {}

    def examine(part: Part) -> None:
        reasons[part] = _examine(part)
        wake.emit()

    for part in parts:
        threading.Thread(target=examine, args=(part,), daemon=True, name="probe " + part.name).start()
    ends = time.monotonic() + PROBE_LIMIT
    while len(reasons) < len(parts) and time.monotonic() < ends and not is_stopped():
        wake.wait(max(0.0, ends - time.monotonic()))
        wake.test_and_clear()
    found = {part: reasons.get(part, "{}: not in {:g} s".format(Cause.NO_ANSWER.text, PROBE_LIMIT)) for part in parts}
    return [Missing(part, reason) for part, reason in found.items() if reason is not None]


class StartUpCheck:
    """Waits for the robot's nodes as long as the configuration allows."""

    def __init__(self, settings: Settings, tell: Callable[[str, str], None]):
        """``tell`` takes a severity and a line for the operator."""
        self._asr_enabled = settings.asr_enabled
        self._patience = settings.startup_timeout
        self._parts = parts_of(settings.interface)
        self._speech = settings.interface.evidence(Sense.UTTERANCE).topic
        self._tell = tell

    def run(self, wake: WakeUp, is_stopped: Callable[[], bool]) -> bool:
        """Return whether every part that the mission needs is there: False only if the operator stopped the waiting.

        Raises ``NodesMissing``, which lists all that is not there.
        """
        ends = time.monotonic() + self._patience
        missing = find_missing(self._parts, wake, is_stopped)
        awaited: List[str] = []
        while self._needed(missing) and time.monotonic() < ends and not is_stopped():
            names = [part.part.name for part in self._needed(missing)]
            if names != awaited:
                self._tell("info", "waiting up to {:.0f} s for {}".format(ends - time.monotonic(), ", ".join(names)))
                awaited = names
            wake.wait(min(ROUND, max(0.0, ends - time.monotonic())))
            wake.test_and_clear()
            missing = find_missing([part.part for part in missing], wake, is_stopped)
        if is_stopped():
            return False
        self._report(missing)
        return True

    def _needed(self, missing: List[Missing]) -> List[Missing]:
        """Return those without which the mission does not start: without speech recognition its topic is optional."""
        return [part for part in missing if self._asr_enabled or part.part.offer is not self._speech]

    def _report(self, missing: List[Missing]) -> None:
        """Warn of what can be done without, and raise for the rest."""
        needed = self._needed(missing)
        for part in missing:
            if part not in needed:
                self._tell("warning", "{} (asrEnabled is false: going on)".format(part))
        if needed:
            raise NodesMissing("{} of the {} services and topics that the mission needs are missing:\n{}\n{}".format(
                len(needed), len(self._parts), "\n".join("  {}".format(part) for part in needed),
                "start what is missing and start again, or set startupTimeout to wait for it"))
