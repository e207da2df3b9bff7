"""The simulated robot in virtual time, without ROS: it ends calls and publishes messages as the
nodes of a test do, on the clock of a mission's tree.

What its nodes decide is decided by ``simulated_node``, with the same seeds as in a test.
"""
import math
import os
import re
from functools import lru_cache, partial
from types import SimpleNamespace
from typing import Any, Callable, Dict, Iterator, List, Optional, Tuple, Union

from msgspec.structs import asdict

from behavior_controller.bt.engine.clock import Timer
from behavior_controller import extensions, folders
from behavior_controller.run.events import Event, Message
from behavior_controller.run.health import GONE, Health, available_again, gone, slow_after
from behavior_controller.missions.load import Mission
from behavior_controller.robot.declarations import (
    Action, Publication, Service, Topic, Unsendable, Unusable)
from behavior_controller.robot.gateway import (Call, Cause, Failure, FakeTopics, Gateway,
                                               NOT_OFFERED, NO_SUBSCRIBER, Sample, result_of,
                                               waited)
from behavior_controller.robot.requests import Answer, Exhibit, Request

from behavior_controller.simulation import behaviour
from behavior_controller.simulation.faults import CRASH, EXCEPTION, UNANSWERED, WRONG
from behavior_controller.simulation.journal import JournalEntry
from behavior_controller.simulation.simulated_node import Reply, SimulatedNode
from behavior_controller.simulation.world import World
from behavior_controller.simulation.configuration import Configuration, IDLE_ACTION

HANDLING = 0.005
"""Seconds that a node takes for a request that takes no time."""

WAY = 0.001
"""Seconds from the sending of a request to its arrival at the node."""

AWAY = 2.0
"""Seconds from a node's crash to its return: the launch file waits one, and the node takes another
to start."""

NOTICED = 0.1
"""Seconds after which the controller's monitor has noticed a crash or a return."""

SHORTEST_GAP = 0.05
"""The shortest time between two messages of a topic, in seconds: an infinite arrival rate means
this."""

FEEDBACK_SHARE = 0.5
"""The share of an action's time after which it reports how far it is."""

CONNECTION_REFUSED = "connection refused"
NOT_RUNNING = "{}: {}".format(Cause.NOT_REACHABLE.text, CONNECTION_REFUSED)

_ORDER = 1e-6
"""Seconds between two things that happen at one moment, so that their order shows in their times.
"""

Result = Union[Answer, Failure]

_FIELD = re.compile(r"^\s*[\w/\[\]]+\s+(\w+)\s*(?:#|$)", re.MULTILINE)
"""A field in the file of a type, and its name; a constant is none."""

FILES = {Service: "srv", Action: "action", Publication: "msg"}
"""The folder and ending of the file of a type."""


class VirtualRobot(Gateway):
    """The nodes of one play, and what the ROS edge would report of them. It carries requests to
    them, and ends calls as the real gateway does."""

    def __init__(self, mission: Mission, world: World, test: Configuration,
                 shortest_gap: float = SHORTEST_GAP):
        self.mission, self.world, self.test = mission, world, test
        self.shortest_gap = shortest_gap
        self.note: Callable[[Event], None] = lambda event: None
        """Gets messages, as the record has them."""
        self.clock, self.wake = mission.tree.clock, mission.tree.wake.emit
        self.health = Health(self.wake)
        self.topics = VirtualTopics(self)
        self.journal: List[JournalEntry] = []
        self.asked: List[Tuple[float, Request]] = []
        self.presence: List[Tuple[float, bool]] = []
        # called for each call that reaches a node
        self.called: Callable[[JournalEntry], None] = lambda entry: None
        self._newest = 0.0
        self._nodes: Dict[str, VirtualNode] = {}

    def stamp(self) -> float:
        """Return the time of the current event: later than that of every event before."""
        self._newest = max(self.clock.now(), self._newest + _ORDER)
        return self._newest

    def start(self, request: Request) -> Call:
        """Send ``request``; the call ends with the answer, with a failure, or at its deadline."""
        self.asked.append((self.stamp(), request))
        return _VirtualCall(self, request).call

    def after(self, seconds: float, callback: Callable[[], None]) -> Timer:
        """Run ``callback`` once, ``seconds`` from now."""
        return self.clock.call_after(seconds, callback, is_foreign=True)

    def node(self, name: str) -> "VirtualNode":
        """Return the node of that name."""
        return self._nodes.get(name) or self._nodes.setdefault(name, VirtualNode(self, name))

    def publish(self, topic: Topic) -> None:
        """Have messages on a topic from now on: its node's, or those that another package's
        declaration has for a rehearsal."""
        if topic.name in behaviour.TOPICS:
            self.node(topic.node).publish()
        else:
            self.topics.rehearse(topic)

    def away(self) -> List[str]:
        """Return the names of the nodes that are not running."""
        return sorted(name for name, node in self._nodes.items() if node.is_away)

    def write(self, entry: JournalEntry) -> None:
        """Add an entry to the journal; the visitor notices it."""
        self.journal.append(entry)
        if entry.call:
            self.called(entry)
        visitor = self.world.visitor
        visitor.notice(entry)
        was_here = bool(self.presence) and self.presence[-1][1]
        if visitor.is_here is not was_here:
            self.presence.append((entry.time, visitor.is_here))


class VirtualNode(SimulatedNode):
    """One node: whether it is running, and the times of its messages."""

    def __init__(self, robot: VirtualRobot, name: str):
        super().__init__(name, robot.test, robot.world, robot.stamp, robot.write)
        self._robot, self.is_away = robot, False
        self.listens_until = -math.inf  # an action returns nothing later
        self.calls: Dict["_VirtualCall", None] = {}  # under way here, in their order
        self._timer: Optional[Timer] = None  # of its next message, if it publishes

    # ------------------------------------------------------------------------------------- presence

    def crash(self) -> None:
        """Lose all calls, and be unreachable for a while."""
        self.is_away = True
        for call in self.calls:
            call.lose()
        if self._timer is not None:
            self._timer.cancel()
        self._robot.after(NOTICED, lambda: self._report(False))
        self._robot.after(AWAY, self._return)

    def _return(self) -> None:
        self.is_away = False
        if self._timer is not None:
            self.publish()
        self._robot.after(NOTICED, lambda: self._report(True))

    def _report(self, is_well: bool) -> None:
        for offer in self._robot.mission.offers:
            if offer.node == self.name and isinstance(offer, Service):
                change = available_again(offer.kind, offer.name, self.name)
                if not is_well:
                    change = gone(offer.kind, offer.name, self.name, NOT_RUNNING,
                                  offer.impact_if_missing)
                self._robot.health.report(GONE, change)

    # ------------------------------------------------------------------------------------- messages

    def publish(self) -> None:
        """Publish from now on, as a node does when it starts."""
        self._await_next(self.arrivals().times(self._robot.clock.now()))

    def _await_next(self, times: Iterator[float]) -> None:
        robot = self._robot
        gap = max(next(times) - robot.clock.now(), robot.shortest_gap)
        self._timer = robot.after(gap, partial(self._publish_next, times))

    def _publish_next(self, times: Iterator[float]) -> None:
        robot, offers = self._robot, self.offers
        self._await_next(times)
        is_idle = robot.test.recognise_by == IDLE_ACTION
        if offers.action is not None and (is_idle or robot.clock.now() > self.listens_until):
            return
        fields = self.message(offers.publisher)
        if fields is not None and offers.topic is not None:
            robot.topics.publish(offers.topic, behaviour.read(offers.topic, fields))


class VirtualTopics(FakeTopics):
    """The topics of the simulated nodes, each with messages at random times."""

    def __init__(self, robot: VirtualRobot):
        super().__init__(robot.clock.now, robot.wake)
        self._robot = robot
        self.reads: Dict[Topic, int] = {}  # in this traversal
        self._known: Dict[Topic, Tuple[Sample, ...]] = {}

    def recent(self, topic: Topic) -> Tuple[Sample, ...]:
        """Return the messages that count, and note those that are read for the first time."""
        samples, known = super().recent(topic), self._known.get(topic, ())
        self.reads[topic], self._known[topic] = self.reads.get(topic, 0) + 1, samples
        for sample in samples:
            if not any(sample is other for other in known):
                self._robot.note(
                    Message(topic.name, self.reads[topic], sample.value, sample.arrived))
        return samples

    def forget(self) -> None:
        """Drop all messages: the next visitor comes when they are too old to count."""
        self._recent.clear()

    def rehearse(self, topic: Topic) -> None:
        """Publish from now on what the declaration of another package's topic says. As on a robot,
        a mission begins before the first message comes."""
        robot, began = self._robot, self._robot.clock.now()
        gap = max(robot.shortest_gap, SHORTEST_GAP)

        def publish_next() -> None:
            robot.after(gap, publish_next)
            if topic.simulated_value is not None:
                value = topic.simulated_value(robot.clock.now() - began)
                if value is not None:
                    self.publish(topic, value)

        robot.after(gap, publish_next)

    def listen(self, topic: Topic, seconds: float, prefers_action: bool = False) -> None:
        """Have a robot that hears by an action listen for that time."""
        self._robot.node(topic.node).listens_until = self._robot.clock.now() + seconds


# -------------------------------------------------------------------------------------------- calls


class _VirtualCall:
    """A call on its way to a node and back."""

    def __init__(self, robot: VirtualRobot, request: Request):
        interface = robot.mission.settings.interface
        service = robot.test.carrier(interface.service(type(request)), interface)
        self._robot, self._service, self._request = robot, service, request
        self._began = robot.clock.now()
        self._deadline = robot.mission.settings.deadline(service)
        self.call = Call(request, robot.wake, self._cancel)
        late = self._failure(Cause.NO_ANSWER, waited(self._deadline))
        self._timers = [
            robot.after(WAY, self._arrive),
            robot.after(self._deadline, lambda: self._finish(late)),
            robot.after(slow_after(request.usual_seconds, self._deadline),
                        lambda: robot.health.slow(service.name, self._deadline, service.kind,
                                                  request.usual_seconds))]

    def _cancel(self) -> None:
        for timer in self._timers[1:]:  # what is sent arrives
            timer.cancel()
        self._robot.node(self._service.node).calls.pop(self, None)

    def lose(self) -> None:
        """End without the answer: the node's process has ended."""
        for timer in self._timers[3:]:  # those of the answer and of feedback
            timer.cancel()
        self._timers.append(self._robot.after(HANDLING, partial(self._finish, self._hung_up())))

    def _hung_up(self) -> Failure:
        return self._failure(Cause.CONNECTION_LOST, "the server hung up")

    def _finish(self, result: Result) -> None:
        self._cancel()
        seconds = self._robot.clock.now() - self._began
        self._robot.health.ended(self._service.name, seconds, self._deadline,
                                 isinstance(result, Failure), self._service.kind,
                                 self._request.usual_seconds)
        self.call.finish(result)

    def _failure(self, cause: Cause, message: str) -> Failure:
        return Failure(cause, message, self._service.name)

    def _arrive(self) -> None:
        """Reach the node, or find that it is not running."""
        robot, service, seconds = self._robot, self._service, 0.0
        node = robot.node(service.node)
        result: Optional[Result] = None
        if robot.test.lacks(service):
            absent = self._failure(Cause.NOT_ADVERTISED, NOT_OFFERED)
            result = Answer() if service.is_optional and not service.fails_without else absent
        elif node.is_away:
            text = "the master lists it, but " + CONNECTION_REFUSED
            result = self._failure(Cause.NOT_REACHABLE, text)
        else:
            try:
                reply = self._carried_out(node)
                seconds = reply.entry.seconds or (0.0 if reply.is_at_once else HANDLING)
                result = None if reply.entry.fault == UNANSWERED else self._result(reply)
                self._await_feedback(reply.entry)
            except Unsendable as error:
                result = self._failure(Cause.TYPE_MISMATCH, str(error))
            except Unusable as error:
                result = self._failure(Cause.UNUSABLE_ANSWER, str(error))
        if self._timers[1].callback is None:  # it was dropped
            return
        if not node.is_away:
            node.calls[self] = None
        if result is not None:
            self._timers.append(robot.after(seconds, partial(self._finish, result)))

    def _await_feedback(self, entry: JournalEntry) -> None:
        """Have an action report once, after half of its time."""
        service = self._service
        fields = behaviour.simulated(service).feedback(entry.content, FEEDBACK_SHARE)
        if isinstance(service, Action) and fields and entry.seconds:
            text = service.feedback(SimpleNamespace(**fields))
            self._timers.append(self._robot.after(entry.seconds * FEEDBACK_SHARE,
                                                  lambda: self.call.on_feedback(text)))

    def _carried_out(self, node: VirtualNode) -> Reply:
        """Have the node carry out the request. Raises Unsendable and Unusable."""
        service, request = self._service, self._request
        names, response_fields = slots(service)
        # without an srv file, the fields are those of the record
        fields = dict(zip(names, service.values(request, names))) if names else asdict(request)
        reply = node.reply(service, service.name, fields, response_fields, response, request)
        if reply.entry.fault == CRASH:
            node.crash()
        return reply

    def _result(self, reply: Reply) -> Result:
        """Return the result that the controller decodes from the response."""
        service, fault = self._service, reply.entry.fault
        if fault == EXCEPTION and isinstance(service, Action):  # its server aborts the goal
            return self._failure(Cause.REFUSED, f"aborted ({reply.exception})")
        if fault == EXCEPTION:
            return self._failure(Cause.HANDLER_EXCEPTION, reply.exception)
        if fault == CRASH:
            return self._hung_up()
        if reply.answer is None and isinstance(service, Publication):
            return self._failure(Cause.NOT_ADVERTISED, NO_SUBSCRIBER)
        if reply.answer is None and isinstance(service, Action) and fault != WRONG:
            return self._failure(Cause.REFUSED, "aborted")
        if reply.answer is not None and service.request not in behaviour.SERVICES:
            return reply.answer
        return result_of(service, reply.response, service.name)


def response(service: Service, answer: Optional[Answer], fault: Optional[str] = None) -> Any:
    """Return the response that carries ``answer``, with the fields of the ROS message: see
    ``behaviour.response``."""
    content = behaviour.response(service, answer, fault)
    content["exhibits"] = list(map(_exhibit, content["exhibits"]))
    return SimpleNamespace(**content)


def _exhibit(exhibit: Exhibit) -> SimpleNamespace:
    x, y, theta = exhibit.location
    location = SimpleNamespace(x=x, y=y, theta=theta)
    return SimpleNamespace(**dict(exhibit._asdict(), location=location))


@lru_cache(maxsize=None)
def slots(service: Service) -> Tuple[Tuple[str, ...], Tuple[str, ...]]:
    """Return the names of the fields of a service's request and response, as its srv file has them,
    or its action or msg file.
    """
    package, _, name = service.type.partition("/")
    places = {extension.package: extension.folder for extension in extensions.exported("interface")}
    ending = FILES[type(service)]
    path = os.path.join(places.get(package, folders.share()), ending, name + "." + ending)
    if not os.path.isfile(path):
        return (), ()
    with open(path, encoding="utf-8") as file:
        asked, answered = (file.read() + "\n---\n").split("---")[:2]
    return tuple(_FIELD.findall(asked)), tuple(_FIELD.findall(answered))
