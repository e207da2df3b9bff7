"""The start-up check: do the robot's nine nodes run, do they answer, and do they have our types.

A master's entry proves nothing: it outlives its node. So the check connects to each service and
each publisher and shakes hands, all at once and each bounded in time; all that is missing is
reported together.
"""
import collections
import threading
import time
from typing import Any, Callable, Dict, FrozenSet, List, NamedTuple, Optional, Sequence, Tuple

import rospy

from behavior_controller.bt.engine.wakeup import WakeUp
from behavior_controller.errors import NodesMissing
from behavior_controller.robot.gateway import Cause, NO_ACTION, NO_SUBSCRIBER
from behavior_controller.robot.declarations import Action, Offer, Publication, Sense, Service, Topic
from behavior_controller.robot.interfaces import INTERFACES
from behavior_controller.missions.load import Mission
from behavior_controller.ros.master import DIRECTORY
from behavior_controller.ros.tcpros import (
    Connection, Trouble, ask_master, STEP_LIMIT, open_publisher)
from behavior_controller.ros.service_client import open_service
from behavior_controller.ros.types import TYPES
from behavior_controller.text import clean

PROBE_LIMIT = 3.0
"""Seconds after which a service or topic without an answer counts as missing."""

ROUND = 0.5
"""Seconds between two checks of what is missing, while the start waits (``startupTimeout``)."""


def resolved(offer: Offer) -> str:
    """Return the resolved name of a service or topic."""
    return rospy.resolve_name(offer.name)


def not_published(topic: Topic) -> str:
    """Return why there is no evidence from a topic that has no publisher."""
    action = topic.action
    return "no node publishes it" + (
        "" if action is None else f", and none offers the action {resolved(action)}")


def _key(offer: Offer) -> Tuple[str, str]:
    """Return what identifies a service or topic on the network."""
    return resolved(offer), TYPES[offer]._md5sum


def _common_keys() -> FrozenSet[Tuple[str, str]]:
    """Return the keys of what several robots have."""
    count = collections.Counter(key for interface in INTERFACES.values()
                                for key in set(map(_key, interface.offers)))
    return frozenset(key for key, robots in count.items() if robots > 1)


class Missing(NamedTuple):
    """A service or topic that did not pass, and why."""

    offer: Offer
    reason: str

    @property
    def is_elsewhere(self) -> bool:
        """Whether another robot may have it under another name or type: what hangs exists on this
        robot."""
        return self.is_mismatch or self.reason.startswith(Cause.NOT_ADVERTISED.text)

    @property
    def is_mismatch(self) -> bool:
        """Whether it exists with another type."""
        return self.reason.startswith(Cause.TYPE_MISMATCH.text)

    def __str__(self) -> str:
        """Return a line for an operator."""
        offer = self.offer
        return (f"{offer.kind} {resolved(offer)} (of node /{offer.node}): {clean(self.reason)}; "
                f"without it {offer.absence}")


# ---------------------------------------------------------------------------------------- one probe


def _examine(offer: Offer) -> Optional[str]:
    """Return why ``offer`` cannot be used, or None if it can. Ends in bounded time."""
    try:
        return EXAMINERS[type(offer)](offer)
    except Trouble as trouble:
        return f"{trouble.cause.text}: {trouble}"


def _examine_service(service: Service) -> Optional[str]:
    """Connect to a service as a probe, which its server answers without running anything."""
    connection, name = Connection(), resolved(service)
    answer = open_service(DIRECTORY.service(name, STEP_LIMIT), connection, name, "*", STEP_LIMIT,
                          probe="1")
    connection.hang_up()
    return _compare(answer, TYPES[service], "its server")


def _examine_topic(topic: Topic) -> Optional[str]:
    """Connect to each publisher until one is right. An action may replace the topic."""
    wanted = [(resolved(topic), TYPES[topic])]
    if topic.action is not None:
        wanted.append(_result_of(topic.action))
    return _examine_publishers(wanted, not_published(topic))


def _examine_action(action: Action) -> Optional[str]:
    """Connect to the topic of its results."""
    return _examine_publishers([_result_of(action)], f"{Cause.NOT_ADVERTISED.text}: {NO_ACTION}")


def _result_of(action: Action) -> Tuple[str, Any]:
    return resolved(action) + "/result", type(TYPES[action]().action_result)


def _examine_publishers(wanted: Sequence[Tuple[str, Any]], otherwise: str) -> Optional[str]:
    """Connect to publishers of the ``wanted`` topics and types until one is right; else report the
    first, or ``otherwise``."""
    publishers, _, _ = ask_master("getSystemState", seconds=STEP_LIMIT)
    reasons: List[str] = []
    for topic, kind in wanted:
        for node in dict(publishers).get(topic, ()):
            reason = _examine_publisher(topic, kind, node)
            if reason is None:
                return None
            reasons.append(reason)
    return reasons[0] if reasons else otherwise


def _examine_subscribers(topic: Publication) -> Optional[str]:
    """Ask the master: a subscriber has no address to connect to. Its type shows when we publish."""
    _, subscribers, _ = ask_master("getSystemState", seconds=STEP_LIMIT)
    others = set(dict(subscribers).get(resolved(topic), ())).difference({rospy.get_name()})
    return None if others else f"{Cause.NOT_ADVERTISED.text}: {NO_SUBSCRIBER}"


def _examine_publisher(topic: str, kind: Any, node: str) -> Optional[str]:
    """Connect to the topic at ``node`` as a subscriber of any type, and compare the type that it
    publishes."""
    connection = Connection()
    try:
        uri = ask_master("lookupNode", node, seconds=STEP_LIMIT)
        if not uri:
            return f"node {node} no longer publishes it"
        # under another name: a publisher drops the older of two connections from the same node, our
        # subscription
        answer = open_publisher(connection, uri, topic, {
            "type": "*", "callerid": rospy.get_name() + "_start_up_check"})
    except Trouble as trouble:
        return f"{trouble.cause.text}: node {node} is listed as its publisher, but {trouble}"
    finally:
        connection.hang_up()
    return _compare(answer, kind, "node " + node)


EXAMINERS: Dict[type, Callable[[Any], Optional[str]]] = {
    Service: _examine_service, Action: _examine_action, Publication: _examine_subscribers,
    Topic: _examine_topic}


def _compare(answer: Any, wanted: Any, peer: str) -> Optional[str]:
    """Return how the type in a handshake differs from ours, or None."""
    if "error" in answer:
        return f"{Cause.NOT_REACHABLE.text}: {peer} says: {answer['error']}"
    if answer.get("md5sum") == wanted._md5sum:
        return None
    return (f"{Cause.TYPE_MISMATCH.text}: {peer} has {answer.get('type')} (md5 "
            f"{answer.get('md5sum')}), expected is {wanted._type} (md5 {wanted._md5sum}); build "
            "both from the same srv and msg files")


# ------------------------------------------------------------------------------ all of them at once


def find_missing(offers: Sequence[Offer], wake: WakeUp,
                 is_stopped: Callable[[], bool]) -> List[Missing]:
    """Examine ``offers`` in parallel and return those that cannot be used, in their order.

    Ends within ``PROBE_LIMIT``, or when ``wake`` signals that the operator has stopped the node.
    """
    reasons: Dict[Offer, Optional[str]] = {}

    def examine(offer: Offer) -> None:
        reasons[offer] = _examine(offer)
        wake.emit()

    for offer in offers:
        threading.Thread(target=examine, args=(offer,), daemon=True,
                         name="probe " + offer.name).start()
    deadline = time.monotonic() + PROBE_LIMIT
    while len(reasons) < len(offers) and time.monotonic() < deadline and not is_stopped():
        wake.wait(max(0.0, deadline - time.monotonic()))
        wake.test_and_clear()
    silent = f"{Cause.NO_ANSWER.text}: not in {PROBE_LIMIT:g} s"
    verdicts = ((offer, reasons.get(offer, silent)) for offer in offers)
    return [Missing(offer, reason) for offer, reason in verdicts if reason is not None]


class StartUpCheck:
    """Waits for the robot's nodes as long as the configuration allows."""

    def __init__(self, plan: Mission, tell: Callable[[str, str], None]):
        """``tell`` takes a severity and a line for the operator."""
        self._asr_enabled = plan.settings.asr_enabled
        self._patience = plan.settings.startup_timeout
        self._interface = plan.settings.interface
        self._offers = plan.offers
        self._speech = self._interface.evidence(Sense.UTTERANCE).topic
        self._tell = tell

    def run(self, wake: WakeUp, is_stopped: Callable[[], bool]) -> bool:
        """Return True when the mission has all that it needs, False if the operator stopped the
        wait.

        Raises ``NodesMissing``, which lists all that is missing.
        """
        deadline = time.monotonic() + self._patience
        missing = find_missing(self._offers, wake, is_stopped)
        self._look_for_another_robot(missing, wake, is_stopped)
        awaited: List[str] = []
        while self._needed(missing) and time.monotonic() < deadline and not is_stopped():
            names = [resolved(absent.offer) for absent in self._needed(missing)]
            if names != awaited:
                left = deadline - time.monotonic()
                self._tell("info", f"waiting up to {left:.0f} s for {', '.join(names)}")
                awaited = names
            wake.wait(min(ROUND, max(0.0, deadline - time.monotonic())))
            wake.test_and_clear()
            missing = find_missing([absent.offer for absent in missing], wake, is_stopped)
        if awaited:
            self._look_for_another_robot(missing, wake, is_stopped)
        if is_stopped():
            return False
        self._report(missing)
        return True

    def _needed(self, missing: List[Missing]) -> List[Missing]:
        """Return what is missing and without which the mission does not start."""
        return [absent for absent in missing if not self._reason_to_go_on(absent)]

    def _reason_to_go_on(self, missing: Missing) -> str:
        """Return why the mission can start without it; empty if it cannot."""
        offer = missing.offer
        if offer is self._speech:
            return "" if self._asr_enabled else "asrEnabled is false: going on"
        if isinstance(offer, Topic) or not offer.is_optional or missing.is_mismatch:
            return ""
        if not offer.fails_without:
            return "going on: a step that asks for it is passed over while no node offers it"
        return "going on: a step that asks for it fails" if self._asr_enabled else ""

    def _look_for_another_robot(self, missing: List[Missing], wake: WakeUp,
                                is_stopped: Callable[[], bool]) -> None:
        """Raise ``NodesMissing`` if the robot is not the configured one.

        That is so if nothing exists that only the configured robot has, but something that only
        another robot has.
        """
        there = set(map(_key, self._offers)).difference(_key(absent.offer) for absent in missing)
        common = _common_keys()
        if there - common or not any(absent.is_elsewhere for absent in self._needed(missing)):
            return
        for name, interface in INTERFACES.items():
            if interface is self._interface:
                continue
            own = [offer for offer in interface.offers if _key(offer) not in common]
            lacking = [absent.offer for absent in find_missing(own, wake, is_stopped)]
            names = sorted(f"{resolved(offer)} as {offer.type}" for offer in own
                           if offer not in lacking)
            if names and not is_stopped():
                raise NodesMissing(
                    f"the robot speaks {name}, and the configuration says robotInterface "
                    f"{self._interface.name}: set robotInterface {name} (found: "
                    f"{', '.join(names)})")

    def _report(self, missing: List[Missing]) -> None:
        """Warn of what is missing and not needed, and raise for the rest."""
        needed = self._needed(missing)
        for absent in missing:
            if absent not in needed:
                self._tell("warning", f"{absent} ({self._reason_to_go_on(absent)})")
        if needed:
            lines = [f"{len(needed)} of the {len(self._offers)} services and topics that the "
                     "mission needs are missing:", *(f"  {absent}" for absent in needed),
                     "start what is missing and start again, or set startupTimeout to wait for it"]
            raise NodesMissing("\n".join(lines))
