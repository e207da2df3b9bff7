"""The start-up check: do the robot's nine nodes run, do they answer, and do they have our types.

A master's entry proves nothing: it outlives its node. So the check connects to each service and each publisher and shakes
hands, all at once and each bounded in time; all that is missing is reported together.
"""
import collections
import threading
import time
from typing import Any, Callable, Dict, FrozenSet, Iterable, List, NamedTuple, Optional, Sequence, Tuple, Union

import rospy

from behavior_controller.bt.engine.wakeup import WakeUp
from behavior_controller.errors import NodesMissing
from behavior_controller.gateway import Cause
from behavior_controller.interface import Sense, Service, Topic
from behavior_controller.interface.robots import INTERFACES
from behavior_controller.mission import Mission
from behavior_controller.ros.connection import Connection, Trouble, ask_master
from behavior_controller.ros.services import open_service
from behavior_controller.ros.subscription import STEP_LIMIT, open_publisher
from behavior_controller.ros.types import TYPES
from behavior_controller.text import clean

PROBE_LIMIT = 3.0
"""Seconds after which a part without an answer counts as missing."""

ROUND = 0.5
"""Seconds between two checks of the missing parts, while the start waits (``startupTimeout``)."""


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
    def is_optional(self) -> bool:
        """Whether a robot may lack it."""
        return isinstance(self.offer, Service) and self.offer.is_optional

    @property
    def absence(self) -> str:
        """What the robot cannot do without it."""
        return self.offer.absence


def parts_of(offers: Iterable[Union[Service, Topic]]) -> Tuple[Part, ...]:
    """Return a part for each declaration."""
    return tuple(map(Part, offers))


def _key(part: Part) -> Tuple[str, str]:
    """Return what identifies a part on the network."""
    return part.name, TYPES[part.offer]._md5sum


def _common_keys() -> FrozenSet[Tuple[str, str]]:
    """Return the keys of the parts that several robots have."""
    count = collections.Counter(
        key for interface in INTERFACES.values() for key in set(map(_key, parts_of(interface.offers))))
    return frozenset(key for key, robots in count.items() if robots > 1)


class Missing(NamedTuple):
    """A part that did not pass, and why."""

    part: Part
    reason: str

    @property
    def is_elsewhere(self) -> bool:
        """Whether another robot may have it under another name or type: a part that hangs exists on this robot."""
        return self.is_mismatch or self.reason.startswith(Cause.NOT_ADVERTISED.text)

    @property
    def is_mismatch(self) -> bool:
        """Whether it exists with another type."""
        return self.reason.startswith(Cause.TYPE_MISMATCH.text)

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
    """Connect to a service as a probe, which its server answers without running anything."""
    connection = Connection()
    answer = open_service(connection, part.name, "*", STEP_LIMIT, probe="1")
    connection.hang_up()
    return _compare(answer, TYPES[part.offer], "its server")


def _examine_topic(part: Part) -> Optional[str]:
    """Connect to each publisher until one is right; else report the first. An action may replace the topic."""
    publishers, _, _ = ask_master("getSystemState", seconds=STEP_LIMIT) or ([], [], [])
    wanted = [(part.name, TYPES[part.offer])]
    action = part.offer.action if isinstance(part.offer, Topic) else None
    if action is not None:
        wanted.append((rospy.resolve_name(action.name) + "/result", type(TYPES[action]().action_result)))
    reasons: List[str] = []
    for topic, kind in wanted:
        for node in dict(publishers).get(topic, ()):
            reason = _examine_publisher(topic, kind, node)
            if reason is None:
                return None
            reasons.append(reason)
    otherwise = "" if action is None else ", and none offers the action {}".format(rospy.resolve_name(action.name))
    return reasons[0] if reasons else "no node publishes it" + otherwise


def _examine_publisher(topic: str, kind: Any, node: str) -> Optional[str]:
    """Connect to the topic at ``node`` as a subscriber of any type, and compare the type that it publishes."""
    connection = Connection()
    try:
        uri = ask_master("lookupNode", node, seconds=STEP_LIMIT)
        if not uri:
            return "node {} no longer publishes it".format(node)
        # under another name: a publisher drops the older of two connections from the same node, our subscription
        answer = open_publisher(connection, uri, topic, {
            "type": "*", "callerid": rospy.get_name() + "_start_up_check"})
    except Trouble as trouble:
        return "{}: node {} is listed as its publisher, but {}".format(trouble.cause.text, node, trouble)
    finally:
        connection.hang_up()
    return _compare(answer, kind, "node " + node)


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

    Ends within ``PROBE_LIMIT``, or when ``wake`` signals that the operator has stopped the node.
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

    def __init__(self, plan: Mission, tell: Callable[[str, str], None]):
        """``tell`` takes a severity and a line for the operator."""
        self._asr_enabled = plan.settings.asr_enabled
        self._patience = plan.settings.startup_timeout
        self._interface = plan.settings.interface
        self._parts = parts_of(plan.offers)
        self._speech = self._interface.evidence(Sense.UTTERANCE).topic
        self._tell = tell

    def run(self, wake: WakeUp, is_stopped: Callable[[], bool]) -> bool:
        """Return True when the mission has every part that it needs, False if the operator stopped the wait.

        Raises ``NodesMissing``, which lists all missing parts.
        """
        ends = time.monotonic() + self._patience
        missing = find_missing(self._parts, wake, is_stopped)
        self._look_for_another_robot(missing, wake, is_stopped)
        awaited: List[str] = []
        while self._needed(missing) and time.monotonic() < ends and not is_stopped():
            names = [part.part.name for part in self._needed(missing)]
            if names != awaited:
                self._tell("info", "waiting up to {:.0f} s for {}".format(ends - time.monotonic(), ", ".join(names)))
                awaited = names
            wake.wait(min(ROUND, max(0.0, ends - time.monotonic())))
            wake.test_and_clear()
            missing = find_missing([part.part for part in missing], wake, is_stopped)
        if awaited:
            self._look_for_another_robot(missing, wake, is_stopped)
        if is_stopped():
            return False
        self._report(missing)
        return True

    def _needed(self, missing: List[Missing]) -> List[Missing]:
        """Return the missing parts without which the mission does not start."""
        return [part for part in missing if not self._reason_to_go_on(part)]

    def _reason_to_go_on(self, missing: Missing) -> str:
        """Return why the mission can start without a part; empty if it cannot."""
        offer = missing.part.offer
        if offer is self._speech:
            return "" if self._asr_enabled else "asrEnabled is false: going on"
        if isinstance(offer, Topic) or not offer.is_optional or missing.is_mismatch:
            return ""
        if not offer.fails_without:
            return "going on: a step that asks for it is passed over while no node offers it"
        return "going on: a step that asks for it fails" if self._asr_enabled else ""

    def _look_for_another_robot(self, missing: List[Missing], wake: WakeUp, is_stopped: Callable[[], bool]) -> None:
        """Raise ``NodesMissing`` if the robot is not the configured one.

        That is so if no part exists that only the configured robot has, but one that only another robot has.
        """
        there = set(map(_key, self._parts)).difference(_key(each.part) for each in missing)
        common = _common_keys()
        if there - common or not any(each.is_elsewhere for each in self._needed(missing)):
            return
        for name, interface in INTERFACES.items():
            if interface is self._interface:
                continue
            parts = [part for part in parts_of(interface.offers) if _key(part) not in common]
            found = set(parts).difference(each.part for each in find_missing(parts, wake, is_stopped))
            if found and not is_stopped():
                raise NodesMissing("the robot speaks {0}, and the configuration says robotInterface {1}: set "
                                   "robotInterface {0} (found: {2})".format(name, self._interface.name, ", ".join(
                                       sorted("{} as {}".format(part.name, part.offer.type) for part in found))))

    def _report(self, missing: List[Missing]) -> None:
        """Warn of missing parts that are not needed, and raise for the others."""
        needed = self._needed(missing)
        for part in missing:
            if part not in needed:
                self._tell("warning", "{} ({})".format(part, self._reason_to_go_on(part)))
        if needed:
            raise NodesMissing("{} of the {} services and topics that the mission needs are missing:\n{}\n{}".format(
                len(needed), len(self._parts), "\n".join("  {}".format(part) for part in needed),
                "start what is missing and start again, or set startupTimeout to wait for it"))
