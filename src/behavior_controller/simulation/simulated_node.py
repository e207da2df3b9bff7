"""One node of the simulated robot: what it answers and publishes, when, and with which fault.

It uses no clock and no ROS: ``ros_nodes`` carries it to the wire, ``virtual_robot`` to virtual
time.
"""
import math
from typing import Any, Callable, Dict, List, NamedTuple, Optional, Sequence, Tuple

from behavior_controller.robot.declarations import Action, Interface, Service, Topic
from behavior_controller.robot.requests import Answer, Request

from behavior_controller.simulation import behaviour
from behavior_controller.simulation.arrivals import Arrivals
from behavior_controller.simulation.behaviour import FOREIGN, Fields, TOPICS
from behavior_controller.simulation.faults import CRASH, EXCEPTION, UNANSWERED, Faults
from behavior_controller.simulation.journal import JournalEntry, REPEAT, plain
from behavior_controller.simulation.world import World
from behavior_controller.simulation.configuration import Configuration, TOPIC


class Offers(NamedTuple):
    """What a node offers: services, and actions for requests; ``action`` takes the place of the
    topic."""

    services: List[Service]
    topic: Optional[Topic]
    action: Optional[Action]

    @property
    def publisher(self) -> str:
        """The canonical name of the topic, or of the action in its place; empty: neither."""
        offer = self.action or self.topic
        return offer.name if offer is not None else ""


def offers_of(node: str, interface: Interface, test: Configuration) -> Offers:
    """Return what a simulated node of a robot offers in a test."""
    services = [service for service in behaviour.services(interface)
                if service.node == node and not test.lacks(service)]
    topic = next((topic for topic in behaviour.topics(interface) if topic.node == node), None)
    action = topic.action if topic is not None and test.recognise_by != TOPIC else None
    return Offers(services, topic, action)


class Reply(NamedTuple):
    """What a node does with a request. ``answer`` is the content of a positive answer; None: the
    answer is no. ``is_at_once``: the node does not start what it was asked for. ``response`` is the
    ROS message; None: the node sends none."""

    entry: JournalEntry
    answer: Optional[Answer]
    is_at_once: bool
    response: Any

    @property
    def exception(self) -> str:
        """The text of the exception of a call that ends with one."""
        return "call {} of {} fails on purpose".format(self.entry.call, self.entry.node)


class SimulatedNode:
    """One node. Its journal entries reach the visitor of its ``world`` by those who ``write``
    them."""

    def __init__(self, name: str, test: Configuration, world: World,
                 stamp: Callable[[], float], write: Callable[[JournalEntry], None]):
        """``stamp`` returns the time of an entry of the journal."""
        self.name, self.world = name, world
        self.offers = offers_of(name, world.settings.interface, test)
        self._test, self._stamp, self._write = test, stamp, write
        planned = [fault for fault in test.planned_faults if fault.node == name]
        self._faults = Faults(test.failure_rate, self._seed("faults"), test.fault_kinds, planned)
        # the last message in the journal, and when
        self._reported: Tuple[Fields, float] = {}, -math.inf
        # of each action, when its last goal began and ends
        self._goals: Dict[str, Tuple[float, float]] = {}

    def _seed(self, purpose: str) -> str:
        return "{}/{}/{}".format(self._test.random_seed, self.name, purpose)

    def arrivals(self) -> Arrivals:
        """Return the times of the node's messages from its start on."""
        return Arrivals(self._test.arrival_rate, self._seed("arrivals"))

    def catch_up(self, entry: JournalEntry) -> None:
        """Process an entry of an earlier process of this node, which has had that fault already."""
        while entry.node == self.name and self._faults.calls < entry.call:
            self._faults.next()

    def reply(self, service: Service, resource: str, fields: Fields,
              response_fields: Sequence[str], respond: Callable[..., Any],
              request: Optional[Request] = None) -> Reply:
        """Decide what to do with a request, and write it and its response to the journal, before
        anything is answered.

        ``resource`` is the resolved name of the service. ``respond`` returns the message with the
        response: see ``behaviour.response``. ``request`` is for a service that another package
        declares.
        """
        fault = behaviour.possible(self._faults.next(), service, response_fields)
        simulated, now = behaviour.simulated(service), self._stamp()
        objection = simulated.object_to(fields)
        is_at_once = objection is not None or fault in (EXCEPTION, CRASH, UNANSWERED)
        takes_time = self._test.takes_time and self.name not in self._test.quick_nodes
        seconds = 0.0
        if takes_time and not is_at_once:
            seconds = behaviour.seconds(service, fields)
        if isinstance(service, Action) and seconds:
            seconds = self._after_last_goal(service, now, seconds)
        answer: Optional[Answer] = None
        response: Any = None
        if fault is None and objection is None and simulated is not FOREIGN:
            self.world.visitor.notice_start()
            answer = simulated.answer(fields, self.world)
        if fault not in (EXCEPTION, CRASH, UNANSWERED):
            response = respond(service, answer, fault)
        entry = JournalEntry(now, self.name, resource, self._faults.calls, fields, fault, objection,
                             seconds, plain(response))
        self._write(entry)
        if entry.done and simulated is FOREIGN:
            answer = service.rehearse(request)
        return Reply(entry, answer, is_at_once, response)

    def _after_last_goal(self, action: Action, now: float, seconds: float) -> float:
        """Return how long a new goal takes, with the rest of the last one that is not stopped."""
        began, end = self._goals.get(action.name, (-math.inf, now))
        if now - began < behaviour.simulated(action).stops_until * (end - began):
            end = now
        begins = max(now, end)
        self._goals[action.name] = begins, begins + seconds
        return begins + seconds - now

    def message(self, resource: str) -> Optional[Fields]:
        """Return the fields of the next message, None if there is none, and write it to the
        journal, unless it repeats the last one.

        ``resource`` is the resolved name of topic or action.
        """
        if self.offers.topic is None:
            return None
        self.world.visitor.now = now = self._stamp()
        simulated = TOPICS[self.offers.topic.name]
        value = simulated.content(self.world)
        if value is None:
            return None
        fields = simulated.fields(value)
        content, at = self._reported
        if fields != content or not at <= now < at + REPEAT:
            self._reported = fields, now
            self._write(JournalEntry(now, self.name, resource, 0, fields))
        return fields
