"""The start-up check: do the robot's nine nodes run, do they answer, and do they have our types.

A master's entry proves nothing: it outlives its node. So the check connects to each service and
each publisher and shakes hands, all at once and each bounded in time; all that is missing is
reported together.
"""
import time
from concurrent.futures import TimeoutError as FutureTimeout, wait
from dataclasses import dataclass, field
from functools import partial
from typing import Any, Callable, Dict, Iterable, List, Sequence, Set, Tuple

import rospy

from behavior_controller.wakeup import WakeUp
from behavior_controller.errors import NodesMissing
from behavior_controller.run.events import AWAITED, DOUBTFUL, MISSING, READY, Checked
from behavior_controller.robot.gateway import Cause, NO_ACTION, NO_SUBSCRIBER
from behavior_controller.robot.declarations import Action, Offer, Publication, Sense, Service, Topic
from behavior_controller.robot.interfaces import INTERFACES
from behavior_controller.missions.load import Mission
from behavior_controller.ros.master import DIRECTORY
from behavior_controller.ros.tcpros import (
    Connection, RETRY_INTERVAL, STEP_LIMIT, Trouble, ask_master, open_publisher)
from behavior_controller.ros.service_client import open_service
from behavior_controller.ros.timeouts import begin, run_apart
from behavior_controller.ros.types import TYPES, in_place_of, not_published, resolved, type_mismatch

PROBE_LIMIT = 3.0
"""Seconds after which a service or topic without an answer counts as missing."""


def _keys(offers: Iterable[Offer]) -> Set[Tuple[str, str]]:
    """Return what identifies each of these services and topics on the network: name and type."""
    return {(resolved(offer), TYPES[offer]._md5sum) for offer in offers}


# --------------------------------------------------------------------------------------- the probes


def _probe_service(service: Service) -> None:
    """Connect to a service as a probe, which its server answers without running anything."""
    connection, name = Connection(), resolved(service)
    answer = open_service(DIRECTORY.service(name, STEP_LIMIT), connection, name, "*", STEP_LIMIT,
                          probe="1")
    connection.hang_up()
    _compare(answer, TYPES[service], "its server")


def _probe_publishers(offer: Offer) -> None:
    """Connect to publishers of a topic, or of an action's results, until one is right; else raise
    what is wrong with the first."""
    if isinstance(offer, Topic):
        topic, kind, otherwise = resolved(offer), TYPES[offer], not_published(offer)
    else:
        topic, kind = resolved(offer) + "/result", type(TYPES[offer]().action_result)
        otherwise = NO_ACTION
    publishers, _, _ = ask_master("getSystemState", seconds=STEP_LIMIT)
    troubles: List[Trouble] = []
    for node in dict(publishers).get(topic, ()):
        try:
            _probe_publisher(topic, kind, node)
            return
        except Trouble as trouble:
            troubles.append(trouble)
    raise troubles[0] if troubles else Trouble(Cause.NOT_ADVERTISED, otherwise)


def _probe_subscribers(topic: Publication) -> None:
    """Ask the master: a subscriber has no address to connect to. Its type shows when we publish."""
    _, subscribers, _ = ask_master("getSystemState", seconds=STEP_LIMIT)
    if set(dict(subscribers).get(resolved(topic), ())) <= {rospy.get_name()}:
        raise Trouble(Cause.NOT_ADVERTISED, NO_SUBSCRIBER)


def _probe_publisher(topic: str, kind: Any, node: str) -> None:
    """Connect to the topic at ``node`` as a subscriber of any type, and compare the type that it
    publishes."""
    connection = Connection()
    try:
        uri = ask_master("lookupNode", node, seconds=STEP_LIMIT)
        if not uri:
            raise Trouble(Cause.NOT_ADVERTISED, "it has ended")
        answer = open_publisher(connection, uri, topic, "_start_up_check")
    except Trouble as trouble:
        raise Trouble(trouble.cause, f"node {node} is listed as its publisher, but {trouble}")
    finally:
        connection.hang_up()
    _compare(answer, kind, "node " + node)


PROBES: Dict[type, Callable[[Any], None]] = {
    Service: _probe_service, Action: _probe_publishers, Publication: _probe_subscribers,
    Topic: _probe_publishers}
"""What raises ``Trouble`` if it cannot be used, in bounded time, by the kind of declaration."""


def _compare(answer: Dict[str, str], wanted: Any, peer: str) -> None:
    """Raise ``Trouble`` if the handshake of ``peer`` names another type than ours."""
    if answer.get("md5sum") != wanted._md5sum:
        raise Trouble(Cause.TYPE_MISMATCH, f"{peer} has {type_mismatch(answer, wanted)}; build "
                                           "both from the same srv and msg files")


# ------------------------------------------------------------------------------ all of them at once


def find_missing(offers: Sequence[Offer], wake: WakeUp,
                 is_stopped: Callable[[], bool]) -> Dict[Offer, Trouble]:
    """Examine ``offers`` in parallel and return those that cannot be used, in their order, each
    with the reason.

    Ends within ``PROBE_LIMIT``. Raises the error of a shortage, and ``Stopped`` when ``wake``
    signals that the operator has stopped the node.
    """
    probes = [begin("probe " + offer.name, partial(PROBES[type(offer)], offer))[1]
              for offer in offers]
    run_apart(lambda: wait(probes, PROBE_LIMIT), wake, is_stopped, 2 * PROBE_LIMIT)
    missing: Dict[Offer, Trouble] = {}
    for offer, probe in zip(offers, probes):
        try:
            probe.result(0)
        except Trouble as trouble:
            if trouble.shortage is not None:
                raise trouble.shortage
            missing[offer] = trouble
        except FutureTimeout:
            missing[offer] = Trouble(Cause.NO_ANSWER, f"not in {PROBE_LIMIT:g} s")
    return missing


@dataclass
class StartUpCheck:
    """Waits for the robot's nodes as long as the configuration allows."""

    plan: Mission
    tell: Callable[[str, str], None]
    """Takes a severity and a line for the operator."""
    wake: WakeUp
    is_stopped: Callable[[], bool]
    checked: Callable[[Checked], None] = lambda check: None
    """Takes what was found of each service and topic."""
    substituted: Dict[Offer, Offer] = field(default_factory=dict)
    """What no node offers, and what is used in its place."""

    def run(self) -> None:
        """Return when the mission has all that it needs.

        Raises ``Stopped``, and ``NodesMissing``, which lists all that is missing.
        """
        deadline = time.monotonic() + self.plan.settings.startup_timeout
        looked_for: Sequence[Offer] = self.plan.offers
        self._note(looked_for, dict.fromkeys(looked_for, "is looked for"))
        awaited: List[str] = []
        while True:
            missing = self._missing(looked_for)
            self._note(looked_for, {offer: missing[offer].reason for offer in missing})
            self._look_for_another_robot(missing)
            names, left = list(map(resolved, self._needed(missing))), deadline - time.monotonic()
            if not names or left <= 0.0:
                break
            if names != awaited:
                self.tell("info", f"waiting up to {left:.0f} s for {', '.join(names)}")
                awaited = names
            self.wake.wait(min(RETRY_INTERVAL, left))
            self.wake.test_and_clear()
            looked_for = list(missing)
        self._report(missing)
        for offer, other in self.substituted.items():
            self.tell("warning", in_place_of(offer, other))

    def _note(self, offers: Iterable[Offer], reasons: Dict[Offer, str]) -> None:
        """Note for the list of what is ready why each is not, if it has a reason."""
        for offer in offers:
            state = AWAITED if offer in reasons else READY
            self.checked(Checked(offer.kind, resolved(offer), state, reasons.get(offer, "")))

    def _missing(self, offers: Sequence[Offer]) -> Dict[Offer, Trouble]:
        """Return those of ``offers`` that cannot be used, and whose substitutes cannot either."""
        missing, substitutes = self._unusable(offers), {}
        for offer, trouble in missing.items():
            other = self.plan.settings.interface.substitute(offer)
            if other is not None and trouble.cause is Cause.NOT_ADVERTISED:
                substitutes[offer] = other
        lacking = self._unusable(list(substitutes.values()))
        for offer, other in substitutes.items():
            if other not in lacking:
                self.substituted[offer] = other
                del missing[offer]
            elif lacking[other].cause is not Cause.NOT_ADVERTISED:
                missing[offer] = lacking[other]
        return missing

    def _unusable(self, offers: Sequence[Offer]) -> Dict[Offer, Trouble]:
        return find_missing(offers, self.wake, self.is_stopped)

    def _needed(self, missing: Dict[Offer, Trouble]) -> List[Offer]:
        """Return what is missing and without which the mission does not start."""
        return [offer for offer, trouble in missing.items()
                if not self._reason_to_go_on(offer, trouble)]

    def _reason_to_go_on(self, offer: Offer, trouble: Trouble) -> str:
        """Return why the mission can start without it; empty if it cannot."""
        asr_enabled = self.plan.settings.asr_enabled
        speech = self.plan.settings.interface.evidence(Sense.UTTERANCE).topic
        if offer is speech and not asr_enabled:
            return "asrEnabled is false: going on"
        has_another_type = trouble.cause is Cause.TYPE_MISMATCH
        if isinstance(offer, Topic) or not offer.is_optional or has_another_type:
            return ""
        if not offer.fails_without:
            return "going on: a step that asks for it is passed over while no node offers it"
        return "going on: a step that asks for it fails" if asr_enabled else ""

    def _look_for_another_robot(self, missing: Dict[Offer, Trouble]) -> None:
        """Raise ``NodesMissing`` if more of another robot is there than of the configured one.

        What hangs is there. What is there with another type counts against a robot. Actions do not
        count, since a robot may do without them, nor what some robot offers and is never asked for.
        """
        if not self._needed(missing):
            return
        ours = self.plan.settings.interface
        unasked = {kind for robot in INTERFACES.values() for kind in robot.never_asked}
        offers = {key: offer for robot in INTERFACES.values() for offer in robot.offers
                  if getattr(offer, "request", None) not in unasked for key in _keys([offer])}
        lacking = self._unusable(list(offers.values()))
        absent = {offer for offer, trouble in lacking.items()
                  if trouble.cause in (Cause.TYPE_MISMATCH, Cause.NOT_ADVERTISED)}
        there = _keys(offer for offer in offers.values()
                      if not (offer in absent or isinstance(offer, Action)))
        differing = _keys(offer for offer, trouble in lacking.items()
                          if trouble.cause is Cause.TYPE_MISMATCH)
        robot = max(INTERFACES.values(), key=lambda robot: (
            len(there & _keys(robot.offers)) - len(differing & _keys(robot.offers)),
            robot.name == ours.name))
        names = sorted(f"{resolved(offer)} as {offer.type}" for key, offer in offers.items()
                       if key in _keys(robot.offers) - _keys(ours.offers)
                       and offer not in lacking)
        if robot.name != ours.name and names:
            raise NodesMissing(
                f"this is a robot of {robot.name.replace('-', ' ')}: set robotInterface "
                f"{robot.name} (the configuration says {ours.name}; found: {', '.join(names)})")

    def _report(self, missing: Dict[Offer, Trouble]) -> None:
        """Warn of what is missing and not needed, and raise for the rest."""
        needed, robot = [], self.plan.settings.interface
        for offer, trouble in missing.items():
            text = f"{trouble.reason}; without it {offer.impact_if_missing}"
            line = f"{offer.kind} {resolved(offer)} (of node /{robot.node_of(offer)}): {text}"
            reason = self._reason_to_go_on(offer, trouble)
            state = DOUBTFUL if reason else MISSING
            self.checked(Checked(offer.kind, resolved(offer), state, text))
            if reason:
                self.tell("warning", f"{line} ({reason})")
            else:
                needed.append("  " + line)
        if needed:
            raise NodesMissing("\n".join([
                f"{len(needed)} of the {len(self.plan.offers)} services and topics that the "
                "mission needs are missing:", *needed,
                "start what is missing and start again, or set startupTimeout to wait for it"]))
