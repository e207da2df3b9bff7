"""Plays a mission in virtual time, without ROS: the engine, leaves, recovery and policy against the simulated robot.

What the simulated robot decides is decided by the same models as in a test (``faults``, ``arrivals``, ``visitor``,
``robot``), with the same seeds. Time goes from one event to the next, so a pass takes some hundredths of a second.
"""
import dataclasses
import functools
import json
import math
import os
from types import SimpleNamespace
from typing import (Any, Callable, Collection, Dict, FrozenSet, Iterator, List, NamedTuple, Optional, Sequence, Set, Tuple,
                    Union)

from behavior_controller import exits, extensions, folders, leaves
from behavior_controller import mission as missions
from behavior_controller.bt.compiler import build
from behavior_controller.bt.engine.clock import ManualClock, Timer
from behavior_controller.bt.engine.node import Result
from behavior_controller.bt.engine.tree import Change
from behavior_controller.bt.language.document import Document, read, with_includes
from behavior_controller.bt.status import IDLE, RUNNING
from behavior_controller.events import EVENTS, Event, Events, HealthChanged
from behavior_controller.gateway import Call, Cause, Failure, FakeTopics, Gateway
from behavior_controller.health import GONE, SLOW_SHARE, Health
from behavior_controller.interface import Service, Topic, Unusable
from behavior_controller.interface.records import Answer, Request
from behavior_controller.runner import PACE, Runner, Running
from behavior_controller.settings import Settings
from behavior_controller.watch.codec import Entry, encode
from behavior_controller.watch.record import shown, traversed

from unit_tests import configuration, parameters, robot
from unit_tests.arrivals import Arrivals
from unit_tests.configuration import ACTION, Configuration
from unit_tests.exhibits import Knowledge
from unit_tests.faults import CRASH, EXCEPTION, UNANSWERED, WRONG, Faults
from unit_tests.journal import Line, Told
from unit_tests.robot import SERVICES, TOPICS, Fields, World
from unit_tests.visitor import Manners, Visitor

START = 1000.0
"""When a play begins, in seconds of its clock; events and journal have the times of that clock."""

WAY = 0.001
"""Seconds from the sending of a request to its arrival at the node."""

AWAY = 2.0
"""Seconds from a node's crash to its return: the launch file waits one, and the node takes another to start."""

NOTICED = 0.1
"""Seconds after which the controller's monitor has noticed a crash or a return."""

SHORTEST_GAP = 0.05
"""The shortest time between two messages of a topic, in seconds: an infinite arrival rate means this."""

LONG_PACE = 0.25
"""Seconds between the ticks of a mission that changes something at every tick, instead of ``runner.PACE``."""

TIMED_OUT = "the mission did not end within {:g} s"
"""Why a play stops at the time limit."""

BUSY = "the mission busy-loops"
"""Why a play stops if the mission never waits."""

MOST_BUSY = 10
"""Ticks without a wait after which a mission counts as busy-looping."""

CALM = configuration.defaults(failureRate=0.0)
"""A test without faults in which every message comes in time."""

_ORDER = 1e-6
"""Seconds between two things that happen at one moment, so that their order shows in their times."""


class Played(NamedTuple):
    """The result of a play. ``exit_code`` is the controller's; None: it had not ended when its time was up."""

    entries: Sequence[Tuple[float, Entry]]  # as in a record: events, and what each traversal of the tree changed
    journal: Sequence[Line]
    exit_code: Optional[int]
    cut_off: str  # why the play was stopped before the end
    error: str  # an exception that ended the mission; empty: none
    reached: FrozenSet[int]  # the uids of the nodes that were ticked
    waiting: Tuple[int, ...]  # the uids of the nodes that were running at the end, without a running child
    seconds: float
    asked: Sequence[Tuple[float, Request]]  # the requests, whether or not they reached their node
    presence: Sequence[Tuple[float, bool]]  # times from which on a visitor was present, or was not

    @property
    def events(self) -> List[Tuple[float, Event]]:
        """The events alone."""
        return [(at, entry) for at, entry in self.entries if isinstance(entry, EVENTS)]

    def record(self) -> List[Dict[str, Any]]:
        """Return the entries as a reader of a record gets them."""
        return [json.loads(encode(at, entry)) for at, entry in self.entries]


Durations = Callable[[Service, Fields], float]
"""Seconds that a service takes for a request with these fields."""


def at_once(service: Service, request: Fields) -> float:
    """Return how long the simulated nodes of a test take, in seconds."""
    return 0.005


class Stage:
    """A mission without faults, and the world in which it can be played any number of times."""

    def __init__(self, settings: Settings, documents: Optional[Sequence[Document]] = None, world: Optional[World] = None):
        """``documents`` are played instead of the configured mission; the mission is the last of them. Raises FaultsFound."""
        self.settings = settings
        self._documents = documents or with_includes(read(missions.find(settings.scenario_specification)))
        self._mission = missions.load(settings, ManualClock(START), documents=self._documents)
        self._registry = leaves.registry()
        self.world = world or parameters.world("", settings)

    @classmethod
    def of_file(cls, settings: Settings, path: str) -> "Stage":
        """Return the stage for a mission file. Raises FaultsFound."""
        return cls(settings, with_includes(read(path)))

    @property
    def mission(self) -> missions.Mission:
        """The mission, with a tree that is not played."""
        return self._mission

    @property
    def knowledge(self) -> Knowledge:
        return self.world.knowledge

    def manners(self, behaviour: str) -> Manners:
        """Return the manners of a visitor with that behaviour."""
        return self.world.visitor.manners._replace(behaviour=behaviour)

    def play(self, test: Configuration, silent: Collection[str] = (), durations: Durations = at_once,
             shortest_gap: float = SHORTEST_GAP) -> Played:
        """Play the mission with the faults, messages and visitors of ``test``; topics in ``silent`` say nothing."""
        clock = ManualClock(START)
        mission = dataclasses.replace(self._mission, tree=build(self._documents, self._registry, clock))
        visitor = Visitor(self.manners(test.visitor_behaviour))
        return _Play(mission, self.world._replace(visitor=visitor), test, durations).run(silent, shortest_gap)


class _TimeIsUp(Exception):
    """The play ends here; the text says why."""


class _Runner(Runner):
    """A runner that advances the clock to the next event instead of waiting for it."""

    ends = math.inf
    _busy = 0

    def _tick(self) -> Result:
        result = super()._tick()
        self._busy += self.tree.busy_loops
        if self._busy > MOST_BUSY:
            raise _TimeIsUp(BUSY)
        return result

    def wait(self, seconds: Optional[float]) -> None:
        """Advance time until the tree is woken, by ``seconds`` at most."""
        clock, wake = self.clock, self.tree.wake
        assert isinstance(clock, ManualClock)
        limit = math.inf if seconds is None else clock.now() + (LONG_PACE if seconds == PACE else seconds)
        while not wake.test_and_clear():
            due = clock.next_due()
            moment = min(limit, math.inf if due is None else due)
            if moment > self.ends:
                raise _TimeIsUp(TIMED_OUT.format(self.ends - START))
            clock.set_to(max(clock.now(), moment))
            clock.run_due()
            if moment == limit:
                return


class _Play:
    """A play in progress: it stands in for the robot's nodes, the monitor and the record of a test."""

    def __init__(self, mission: missions.Mission, world: World, test: Configuration, durations: Durations):
        self.mission, self.world, self.test, self.durations = mission, world, test, durations
        tree = mission.tree
        self.clock, self.interface = tree.clock, world.settings.interface
        self.wake = tree.wake.emit
        self.health = Health(self.wake)
        self.journal: List[Line] = []
        self.entries: List[Tuple[float, Entry]] = []
        self.asked: List[Tuple[float, Request]] = []
        self.presence: List[Tuple[float, bool]] = []
        self.topics = _Topics(self)
        self.nodes: Dict[str, _Node] = {}
        self._newest = 0.0
        self._reached: Set[int] = set()

    def run(self, silent: Collection[str], shortest_gap: float) -> Played:
        """Play until the mission is over or its time is up."""
        tree = self.mission.tree
        events = Events()
        events.subscribe(self._note)
        self._note(shown(tree))
        tree.follow(self._follow)
        for topic in robot.topics(self.interface):
            if topic.name not in silent:
                self.topics.open(topic, shortest_gap)
        context = self.mission.context(_Gateway(self), self.topics, events, self.health)
        runner = _Runner(Running(tree, context, self.mission.file, self.test.mission_runs), lambda: False)
        runner.ends = START + self.test.test_timeout
        exit_code, cut_off, error = _ended(runner)
        running = [node for node in tree.nodes if node.status is RUNNING]
        waiting = tuple(node.uid for node in running if not any(child.status is RUNNING for child in node.children))
        return Played(self.entries, self.journal, exit_code, cut_off, error, frozenset(self._reached), waiting,
                      self.clock.now() - START, self.asked, self.presence)

    def _follow(self, is_first: Optional[bool], changes: List[Change]) -> None:
        if is_first is not None:
            self._note(traversed(self.clock.now(), is_first, changes))
        self._reached.update(node.uid for node, _, new in changes if new is not IDLE)

    def _note(self, entry: Entry) -> None:
        self.entries.append((self.stamp(), entry))

    def stamp(self) -> float:
        """Return the time of the current event: later than that of every event before."""
        self._newest = max(self.clock.now(), self._newest + _ORDER)
        return self._newest

    def node(self, name: str) -> "_Node":
        """Return the simulated node of that name."""
        if name not in self.nodes:
            self.nodes[name] = _Node(self, name)
        return self.nodes[name]

    def write(self, line: Line) -> None:
        """Note a line; the visitor sees it."""
        self.journal.append(line)
        visitor = self.world.visitor
        was_here = visitor.is_here
        visitor.notice(line)
        if visitor.is_here is not was_here:
            self.presence.append((line.time, visitor.is_here))

    def seed(self, node: str, purpose: str) -> str:
        return parameters.seed(self.test, node, purpose)


def _ended(runner: _Runner) -> Tuple[Optional[int], str, str]:
    """Run, and return the exit code, why the end was not awaited, and the exception that ended the run."""
    try:
        return runner.run(), "", ""
    except _TimeIsUp as reason:
        return None, str(reason), ""
    except Exception as error:  # as the node does: an exception in a leaf is an outcome too
        return exits.BROKEN, "", "{}: {}".format(type(error).__name__, " ".join(str(error).split()))


# ------------------------------------------------------------------------------------------------------------- services


class _Node:
    """A simulated node: which of its calls go wrong, and whether it is running."""

    def __init__(self, play: _Play, name: str):
        self._play = play
        self.name = name
        test = play.test
        planned = [fault for fault in test.planned_faults if fault.node == name]
        self.faults = Faults(test.failure_rate, play.seed(name, "faults"), test.fault_kinds, planned)
        self.is_away = False

    def crash(self) -> None:
        """Be unreachable for a while."""
        play = self._play
        self.is_away = True
        play.topics.close(self.name)
        play.clock.call_after(NOTICED, lambda: self._report(False))
        play.clock.call_after(AWAY, self._return)

    def _return(self) -> None:
        self.is_away = False
        self._play.topics.reopen(self.name)
        self._play.clock.call_after(NOTICED, lambda: self._report(True))

    def _report(self, is_well: bool) -> None:
        for offer in self._play.mission.offers:
            if offer.node == self.name and isinstance(offer, Service):
                self._play.health.report(GONE, HealthChanged("service", offer.name, self.name, True, "available again", "")
                                         if is_well else HealthChanged(
                    "service", offer.name, self.name, False, "gone: not reachable: connection refused",
                    "until it is back, " + offer.absence))


class _Gateway(Gateway):
    """Carries requests to the simulated nodes, and ends calls as the real gateway does."""

    def __init__(self, play: _Play):
        self._play = play

    def start(self, request: Request) -> Call:
        """Send ``request``; the call ends with the answer, with a failure, or at its deadline."""
        play = self._play
        play.asked.append((play.stamp(), request))
        service = play.interface.service(type(request))
        return _UnderWay(play, service, request).call


class _UnderWay:
    """A call on its way to a node and back."""

    def __init__(self, play: _Play, service: Service, request: Request):
        self._play, self._service, self._request = play, service, request
        self._began = play.clock.now()
        self._deadline = play.mission.settings.deadline(service)
        self.call = Call(request, play.wake, self._end)
        after = play.clock.call_after
        self._timers = [
            after(WAY, self._arrive), after(self._deadline, self._expire),
            after(self._deadline * SLOW_SHARE, lambda: play.health.slow(service.name, self._deadline))]

    def _end(self) -> None:
        for timer in self._timers[1:]:  # what is sent arrives
            timer.cancel()

    def _finish(self, result: Union[Answer, Failure]) -> None:
        self._end()
        self._play.health.ended(self._service.name, self._play.clock.now() - self._began, self._deadline,
                                isinstance(result, Failure))
        self.call.finish(result)

    def _expire(self) -> None:
        self._finish(self._failure(Cause.NO_ANSWER, "waited {:g} s".format(self._deadline)))

    def _failure(self, cause: Cause, message: str) -> Failure:
        return Failure(cause, message, self._service.name)

    def _arrive(self) -> None:
        """Reach the node, or find that it is not running."""
        play, service = self._play, self._service
        node = play.node(service.node)
        if service.name in play.test.absent_services:
            absent = self._failure(Cause.NOT_ADVERTISED, "the master does not know it")
            self._answer_after(0.0, absent if service.fails_without else Answer())
        elif node.is_away:
            self._answer_after(0.0, self._failure(
                Cause.NOT_REACHABLE, "the master lists it, but connection refused"))
        else:
            self._carry_out(node)

    def _answer_after(self, seconds: float, result: Union[Answer, Failure]) -> None:
        # a dropped call no longer has timers
        if self._timers[1].callback is not None:
            self._timers.append(self._play.clock.call_after(seconds, lambda: self._finish(result)))

    def _carry_out(self, node: _Node) -> None:
        """Carry out the request as the node does."""
        play, service = self._play, self._service
        asked, answered = slots(service)
        fields = _fields(service, self._request, asked)
        fault = robot.possible(node.faults.next(), service, answered)
        simulated = SERVICES.get(service.request)
        line = Line(play.stamp(), node.name, service.name, node.faults.calls, fields, fault,
                    simulated.object_to(fields) if simulated is not None else None)
        play.write(line)
        answer = None
        if line.done:
            answer = simulated.answer(fields, play.world) if simulated is not None else service.rehearsed(self._request)
        if fault == CRASH:
            node.crash()
        if fault != UNANSWERED:
            at_once = fault in (EXCEPTION, CRASH) or line.objection is not None
            self._answer_after(0.0 if at_once else play.durations(service, fields), self._result(line, answer))

    def _result(self, line: Line, answer: Optional[Answer]) -> Union[Answer, Failure]:
        """Return the result that the controller decodes from the response."""
        success = self._service.success
        if line.fault == EXCEPTION:
            return self._failure(Cause.HANDLER_EXCEPTION, "call {} of {} fails on purpose".format(line.call, line.node))
        if line.fault == CRASH:
            return self._failure(Cause.CONNECTION_LOST, "the server hung up")
        if line.fault == WRONG:
            return self._nonsense()
        if answer is None:
            return self._failure(Cause.REFUSED, "answered {} = {!r}".format(success.field, success.refused))
        return self._decoded(answer) if self._service.request in SERVICES else answer

    def _nonsense(self) -> Union[Answer, Failure]:
        field, done, refused = self._service.success
        value = robot.nonsense(self._service.success)
        if value is not None:
            return self._failure(Cause.UNUSABLE_ANSWER, "answered {} = {!r}: neither {!r} (done) nor {!r} (refused)"
                                 .format(field, value, done, refused))
        return self._decoded(SERVICES[self._service.request].nonsense or Answer())

    def _decoded(self, answer: Answer) -> Union[Answer, Failure]:
        """Return what the controller reads in the response that carries ``answer``."""
        try:
            return self._service.answer(message(answer))
        except Unusable as unusable:
            return self._failure(Cause.UNUSABLE_ANSWER, str(unusable))


def message(answer: Answer) -> Any:
    """Return the response that carries ``answer``, with the fields of the ROS message."""
    exhibits = [SimpleNamespace(
        name=place.name, description1=place.description1, description2=place.description2, gesture=place.gesture,
        location=SimpleNamespace(x=place.location.x, y=place.location.y, theta=place.location.theta_deg))
        for place in answer.exhibits]
    return SimpleNamespace(**dict(answer._asdict(), exhibits=exhibits))


def _fields(service: Service, request: Request, names: Sequence[str]) -> Fields:
    """Return the fields of the srv request; without an srv file, those of the record. Raises ValueError."""
    if not names:
        return dict(vars(request))
    values = service.fields(request)
    if len(names) != len(values):
        raise ValueError("the declaration of {} gives {} values for the fields of {}: {}".format(
            service.name, len(values), service.type, ", ".join(names)))
    return dict(zip(names, values))


@functools.lru_cache(maxsize=None)
def slots(service: Service) -> Tuple[Tuple[str, ...], Tuple[str, ...]]:
    """Return the names of the fields of a service's request and response, as its srv file has them."""
    package, _, name = service.type.partition("/")
    places = {extension.package: extension.folder for extension in extensions.found("interface")}
    path = os.path.join(places.get(package, folders.share()), "srv", name + ".srv")
    if not os.path.isfile(path):
        return (), ()
    with open(path, encoding="utf-8") as file:
        asked, _, answered = file.read().partition("---")
    return _names(asked), _names(answered)


def _names(text: str) -> Tuple[str, ...]:
    words = (line.partition("#")[0].split() for line in text.splitlines())
    return tuple(line[1] for line in words if len(line) == 2)


# --------------------------------------------------------------------------------------------------------------- topics


class _Topics(FakeTopics):
    """The topics of the simulated nodes, each with messages at random times."""

    def __init__(self, play: _Play):
        super().__init__(play.clock.now, play.wake)
        self.play = play
        self._open: Dict[Topic, _Publisher] = {}

    def open(self, topic: Topic, shortest_gap: float) -> None:
        """Start the messages of ``topic``."""
        self._open[topic] = _Publisher(self, topic, shortest_gap)
        self._open[topic].begin()

    def close(self, node: str) -> None:
        """Silence the topics of a node that has crashed."""
        for publisher in self._of(node):
            publisher.end()

    def reopen(self, node: str) -> None:
        """Start the topics of a node again, as a new process."""
        for publisher in self._of(node):
            publisher.begin()

    def _of(self, node: str) -> List["_Publisher"]:
        return [publisher for topic, publisher in self._open.items() if topic.node == node]

    def listen(self, topic: Topic, seconds: float) -> None:
        """Have a robot that hears by an action listen for that time."""
        if topic in self._open:
            self._open[topic].until = self.play.clock.now() + seconds


class _Publisher:
    """What a simulated node publishes on one topic, or returns by the action that replaces it."""

    def __init__(self, topics: _Topics, topic: Topic, shortest_gap: float):
        self._topics, self._topic, self._shortest_gap = topics, topic, shortest_gap
        play = topics.play
        self._action = topic.action if play.test.recognise_by == ACTION else None
        self._name = topic.name if self._action is None else self._action.name
        self.until = -math.inf  # an action returns nothing later
        self._told = Told()
        self._times: Iterator[float] = iter(())
        self._timer: Optional[Timer] = None

    def begin(self) -> None:
        """Start publishing, as a node does when it starts."""
        play = self._topics.play
        self._told = Told()
        self._times = Arrivals(play.test.arrival_rate, play.seed(self._topic.node, "arrivals")).times(play.clock.now())
        self._await_next()

    def end(self) -> None:
        """Stop publishing."""
        if self._timer is not None:
            self._timer.cancel()

    def _await_next(self) -> None:
        clock = self._topics.play.clock
        self._timer = clock.call_after(max(next(self._times) - clock.now(), self._shortest_gap), self._tell)

    def _tell(self) -> None:
        play = self._topics.play
        self._await_next()
        if self._action is not None and play.clock.now() > self.until:
            return
        simulated = TOPICS[self._topic.name]
        value = simulated.content(play.world)
        if value is None:
            return
        fields = simulated.fields(value)
        if self._told.is_due(fields, play.clock.now()):
            play.write(Line(play.stamp(), self._topic.node, self._name, 0, fields))
        self._topics.publish(self._topic, value)
