"""What mission leaves share: the context they run in, the record of failures, service calls and topic conditions.

A service leaf fills a request and reads an answer; deadline, waiting and the mapping to a status are written here once.
"""
import itertools
import math
from abc import abstractmethod
from functools import partial
from typing import Any, Callable, Dict, List, Mapping, NamedTuple, Optional, Sequence, Tuple, Type, TypeVar, Union

from behavior_controller.bt.engine.clock import Clock, Timer
from behavior_controller.bt.engine.builtins import Sleep
from behavior_controller.bt.engine.controls import ReactiveFallback, ReactiveSequence, WhileDoElse
from behavior_controller.bt.engine.decorators import Inverter, KeepRunningUntilFailure, Repeat, Timeout
from behavior_controller.bt.engine.leaf import ActionLeaf, ConditionLeaf, SyncActionLeaf
from behavior_controller.bt.engine.node import ConfigureError, Node, Result
from behavior_controller.bt.engine.tree import Tree
from behavior_controller.bt.language.blackboard import Blackboard
from behavior_controller.bt.language.ports import NoValue, PortError
from behavior_controller.bt.ownership import tick_thread_only
from behavior_controller.bt.registry import Kind, Port, argument
from behavior_controller.bt.status import FAILURE, IDLE, NAMES, RUNNING, SUCCESS
from behavior_controller.events import Events, LeafFinished, StepStarted, Told
from behavior_controller.gateway import Call, Cause, Failure, Gateway, Sample, Topics
from behavior_controller.health import Health
from behavior_controller.interface import Evidence, Sense, Service, Topic
from behavior_controller.interface.records import Answer, Request, Words
from behavior_controller.knowledge_files import Knowledge
from behavior_controller.leaves import data
from behavior_controller.mission_spec import MissionSpec
from behavior_controller.phrases import Phrases
from behavior_controller.policy import Policy
from behavior_controller.settings import Settings

Shared = TypeVar("Shared")


class Failed(NamedTuple):
    """One failure of a leaf, with its number in order of time."""

    number: int
    leaf: "MissionLeaf"
    failure: Failure


class FailureLog:
    """The newest failure of each leaf: HandleFallBack finds in it what brought it about."""

    @tick_thread_only
    def __init__(self) -> None:
        self._numbers = itertools.count(1)
        self._by_uid: Dict[int, Failed] = {}
        self.newest_number = 0
        self.given_up = 0  # number of the last failure that a HandleFallBack gave up, with the robot in the safe state

    @tick_thread_only
    def add(self, leaf: "MissionLeaf", failure: Failure) -> None:
        """Record that ``leaf`` failed."""
        self.newest_number = next(self._numbers)
        self._by_uid[leaf.uid] = Failed(self.newest_number, leaf, failure)

    @tick_thread_only
    def newest(self, first_uid: int, end_uid: int, after: int) -> Optional[Failed]:
        """Return the newest failure of the leaves ``first_uid`` to ``end_uid - 1`` with a number beyond ``after``."""
        found = [failed for uid, failed in self._by_uid.items() if first_uid <= uid < end_uid and failed.number > after]
        return max(found, key=lambda failed: failed.number) if found else None


class MissionContext:
    """What the leaves of a running mission share. ``setup(mission=…)`` hands it to each."""

    def __init__(self, gateway: Gateway, topics: Topics, settings: Settings, phrases: Phrases, policy: Policy,
                 clock: Clock, events: Events, health: Optional[Health] = None, knowledge: Optional[Knowledge] = None,
                 offers: Sequence[Union[Service, Topic]] = ()):
        """``health`` tells what is known of the robot's nodes; without it they count as well.

        ``knowledge`` is that of files, where they stand for a knowledge base; ``offers`` are the services and topics
        that the mission cannot do without.
        """
        self.gateway = gateway
        self.topics = topics
        self.settings = settings
        self.interface = settings.interface
        self.phrases = phrases
        self.policy = policy
        self.clock = clock
        self.events = events
        self.health = health or Health()
        self.knowledge = knowledge
        self.offers = offers
        self.language = settings.language if knowledge is None else knowledge.language
        self.failures = FailureLog()
        self.recoveries: List[float] = []  # when each recent recovery began, for the budget
        self.visit_began = -math.inf
        self._shared: Dict[Any, Any] = {}

    def shared(self, kind: Callable[[], Shared]) -> Shared:
        """Return the one ``kind()`` of this mission, which its leaves share."""
        return self._shared.setdefault(kind, kind())

    def begin_visit(self, blackboard: Blackboard, at: float) -> None:
        """Forget the last visitor on the root's ``blackboard``; no answer and no gaze from before ``at`` counts."""
        self.visit_began = at
        for datum in data.ALL:
            blackboard.unset(datum.name)
        for datum in (data.QUESTION_ASKED_AT, data.ATTENTION_SET_AT):
            blackboard.set(datum.name, at, datum.type)

    def leaves_of(self, tree: Tree) -> List[List[str]]:
        """Return path and type of each mission leaf, in document order."""
        return [[node.full_path, node.registration_id] for node in tree.nodes if isinstance(node, MissionLeaf)]


class MissionLeaf(Node):
    """A leaf of the mission vocabulary. What is wrong with a port is a failure of the leaf, in whatever it does."""

    PORTS: Tuple[Port, ...] = ()
    spec: MissionSpec
    mission: MissionContext
    sense: Optional[Sense] = None  # what it learns of the visitor
    resource = ""  # the service or topic that the leaf uses, by canonical name
    started_at = 0.0
    told: Optional[Told] = None  # what people are to be told when the leaf ends

    def configure(self) -> None:
        """Refuse a node type that lacks what the recovery must know of it."""
        if not isinstance(self.spec, MissionSpec):
            raise ConfigureError("{} is a mission leaf and is declared by a NodeSpec alone; declare it with leaf_spec"
                                 .format(self.registration_id))

    def setup(self, **kwargs: Any) -> None:
        """Take the mission's context; a tree that is only drawn has none."""
        if "mission" in kwargs:
            self.mission = kwargs["mission"]

    def get_input_or(self, port: str, otherwise: Any) -> Any:
        """Return the value of an input port, or ``otherwise`` where nothing has written its entry. Raises PortError."""
        try:
            return self.get_input(port)
        except NoValue:
            return otherwise

    def missing(self, error: PortError) -> Failure:
        """Return the failure for a port that cannot be read or written."""
        return Failure(Cause.MISSING_DATA, str(error), self.resource)

    def succeeded(self) -> Result:
        """Report SUCCESS and return it."""
        self.report(SUCCESS)
        return SUCCESS

    def failed(self, failure: Failure) -> Result:
        """Record and report the failure, and return FAILURE."""
        self.mission.failures.add(self, failure)
        self.report(FAILURE, failure)
        return FAILURE

    def report(self, status: Any, failure: Optional[Failure] = None) -> None:
        """Tell the events that this leaf finished."""
        resource = (failure.resource if failure is not None else "") or self.resource
        self.feedback_message = failure.message if failure is not None else ""
        told, self.told = self.told, None
        self.mission.events.emit(LeafFinished(self.uid, self.registration_id, self.full_path, NAMES[status], resource,
                                              self.mission.clock.now() - self.started_at, failure, told))

    def begin_step(self, words: str, what: str, limit: float) -> None:
        """Tell the events in people's words what the robot does from now on, for ``limit`` seconds at most (0: any)."""
        self._begin(words, what, limit, False)

    def begin_wait(self, words: str, limit: float) -> None:
        """As ``begin_step``, for what the robot waits for."""
        self._begin(words, "", limit if limit < math.inf else 0.0, True)

    def _begin(self, words: str, what: str, limit: float, is_wait: bool) -> None:
        self.mission.events.emit(StepStarted(self.uid, self.registration_id, self.full_path, words, what, limit, is_wait))


class InstantAction(MissionLeaf, SyncActionLeaf):
    """An action without a service: done within its tick."""

    @abstractmethod
    def act(self) -> Optional[Failure]:
        """Do it; return what went wrong, if anything."""

    def update(self) -> Result:
        """Act and report."""
        self.started_at = self.mission.clock.now()
        try:
            failure = self.act()
        except PortError as error:
            failure = self.missing(error)
        return self.succeeded() if failure is None else self.failed(failure)


class InstantCondition(MissionLeaf, ConditionLeaf):
    """A condition on what the mission knows."""

    otherwise: str  # the message of its failure

    @abstractmethod
    def holds(self) -> bool:
        """Return the answer."""

    def update(self) -> Result:
        """Answer and report."""
        self.started_at = self.mission.clock.now()
        try:
            if self.holds():
                return self.succeeded()
        except PortError as error:
            return self.failed(self.missing(error))
        return self.failed(Failure(Cause.CONDITION_FALSE, self.otherwise))


class Ended(NamedTuple):
    """The end of an attempt; ``failure`` None: it was done."""

    failure: Optional[Failure]


class Attempt:
    """One request of a service leaf, from its sending to its end. The leaf makes one, and each retry another."""

    def __init__(self, leaf: "ServiceLeaf"):
        self._leaf = leaf
        try:
            wanted = leaf.request()
        except PortError as error:
            wanted = leaf.missing(error)
        self._failure = wanted if isinstance(wanted, Failure) else None
        self._call: Optional[Call] = None
        self._words: Optional[Words] = None
        if wanted is not None and not isinstance(wanted, Failure):
            self._words = leaf.words(wanted)
            leaf.begin_step(self._words.doing, self._words.what, leaf.limit(wanted))
            self._call = leaf.mission.gateway.start(wanted)

    def poll(self) -> Optional[Ended]:
        """Return how the attempt ended, or None while it is under way."""
        if self._call is None:
            return Ended(self._failure)
        result = self._call.result
        if result is None:
            return None
        if isinstance(result, Failure):
            return Ended(self._leaf.attempt_failed(result))
        self._leaf.told = self._leaf.done(self._words) if self._words is not None else None
        try:
            failure = self._leaf.accept(result)
        except PortError as error:
            failure = self._leaf.missing(error)
        if failure is not None:
            self._leaf.told = None
        return Ended(failure)

    def drop(self) -> None:
        """Give the attempt up; its answer is not used."""
        if self._call is not None:
            self._call.drop()


class ServiceLeaf(MissionLeaf, ActionLeaf):
    """An action that calls a service: RUNNING until the answer or the deadline, which the gateway keeps."""

    asks: type  # the kind of request
    attempt: Optional[Attempt] = None

    @property
    def resource(self) -> str:
        """The service's canonical name, or the files."""
        return self.mission.interface.resource(self.asks)

    @abstractmethod
    def request(self) -> Union[Request, Failure, None]:
        """Return what to ask for, why it cannot be asked, or None when there is nothing to do (SUCCESS)."""

    def accept(self, answer: Answer) -> Optional[Failure]:
        """Take what a positive answer brought; return what is wrong with it, if anything."""
        return None

    def words(self, request: Request) -> Words:
        """Return what an operator is told of ``request``: its own words, or the name of the node."""
        return request.words or Words(self.registration_id, self.registration_id + " is done")

    def done(self, words: Words) -> Optional[Told]:
        """Return what is told when the request was carried out."""
        return Told(words.kind, " ".join(filter(None, (words.done, words.what)))) if words.done else None

    def limit(self, request: Request) -> float:
        """Return the seconds that ``request`` may take; 0 if no service carries it out."""
        try:
            return self.mission.settings.deadline(self.mission.interface.service(type(request)))
        except LookupError:
            return 0.0

    def attempt_failed(self, failure: Failure) -> Failure:
        """Return the failure of a request that was made, the leaf's own or a retry."""
        return failure

    def try_once(self) -> Attempt:
        """Begin an attempt; a recovery does so to retry the step."""
        return Attempt(self)

    def on_start(self) -> Result:
        """Begin the first attempt."""
        self.started_at = self.mission.clock.now()
        self.attempt = self.try_once()
        return self.on_running()

    def on_running(self) -> Result:
        """Look for the end of the attempt."""
        ended = self.attempt.poll() if self.attempt is not None else None
        if ended is None:
            return RUNNING
        self.attempt = None
        return self.succeeded() if ended.failure is None else self.failed(ended.failure)

    def on_halted(self) -> None:
        """Drop the attempt."""
        if self.attempt is not None:
            self.attempt.drop()
            self.attempt = None
        self.report(IDLE)


class OptionalServiceLeaf(ServiceLeaf):
    """A leaf that has nothing to do on a robot whose interface lacks the service."""

    @property
    def resource(self) -> str:
        """The service's canonical name; empty if there is none."""
        return super().resource if self.mission.interface.serves(self.asks) else ""

    def request(self) -> Union[Request, Failure, None]:
        """Ask for what is wanted, if the robot has a service for it."""
        return self.wanted() if self.mission.interface.serves(self.asks) else None

    @abstractmethod
    def wanted(self) -> Union[Request, Failure, None]:
        """As ``request`` of a ServiceLeaf."""


def is_asked_again(node: Any) -> bool:
    """Return whether a control asks this node again while a later one runs, which it would halt if it were RUNNING."""
    while node.parent is not None:
        parent, is_last = node.parent, node is node.parent.children[-1]
        if isinstance(parent, (ReactiveFallback, ReactiveSequence)) and not is_last:
            return True
        if isinstance(parent, WhileDoElse) and node is parent.children[0]:
            return True
        node = parent
    return False


def _limit(node: Any) -> float:
    """Return the seconds of a Sleep or Timeout; 0: the file does not say them as a number."""
    msec = node.attributes.get("msec", "")
    return int(msec) / 1000.0 if msec.isdecimal() else 0.0


def wait_beside(node: Any) -> Optional[float]:
    """Return for how many seconds a node is asked again while a ReactiveFallback waits; 0: for ever, None: it is not.

    The limit is that of a Timeout above the two, or of the Sleeps in their place, where the file says it as a number.
    """
    while node.parent is not None and not isinstance(node.parent, Inverter):  # that waits for the opposite
        parent, later = node.parent, node.parent.children[node.parent.children.index(node) + 1:]
        if isinstance(parent, ReactiveFallback) and later:
            below = [each for beside in later for each in beside.iterate()]
            sleeps = [_limit(each) for each in below if isinstance(each, Sleep)]
            is_endless = any(isinstance(each, (KeepRunningUntilFailure, Repeat)) for each in below) or not all(sleeps)
            limits = (0.0 if is_endless else sum(sleeps), _limit(parent.parent) if isinstance(parent.parent, Timeout) else 0.0)
            return min(filter(None, limits), default=0.0)
        node = parent
    return None


class TopicCondition(MissionLeaf, ConditionLeaf):
    """A question to the newest message of the topic that tells of ``sense``.

    It answers at once; with ``conditionWait`` it is RUNNING for up to that long, unless a reactive control asks it
    again and again, where the waiting is the mission's. Nothing polls: an alarm wakes the tree at the message that
    changes the answer, a timer when the message that it rests on grows too old.
    """

    sense: Sense
    otherwise: str  # the message of its failure
    own_evidence: Optional[Evidence] = None  # of a topic that another package declares, in place of a sense
    awaiting = ""  # what the robot does that waits for it, in people's words, in place of those of the sense
    _beside: Optional[float] = None  # see ``wait_beside``
    _expiry: Optional[Timer] = None
    _patience: Optional[Timer] = None
    _is_over = False
    _told: Tuple[str, float] = ("", 0.0)  # the failure reported last, and what a message had to be newer than then

    def setup(self, **kwargs: Any) -> None:
        """Find what the mission does while it asks."""
        super().setup(**kwargs)
        self._beside = wait_beside(self)

    @property
    def resource(self) -> str:
        """The topic's canonical name."""
        return self.topic.name

    @property
    def own_sense(self) -> Optional[Sense]:
        """What is learned of the visitor; None if another package declares what it is."""
        return None if self.own_evidence is not None else self.sense

    @property
    def evidence(self) -> Evidence:
        """What tells of ``sense`` on this robot."""
        return self.own_evidence or self.mission.interface.evidence(self.sense)

    @property
    def topic(self) -> Topic:
        """The topic that tells of it."""
        return self.evidence.topic

    def is_evidence(self, value: Any) -> bool:
        """Return whether a message with this value makes the condition true. Called on the receiving thread too."""
        return self.evidence.is_given(value, self.mission.settings.gaze_value)

    def not_before(self) -> float:
        """Return the time (monotonic seconds) that a message must be newer than."""
        return float("-inf")

    def use(self, sample: Sample) -> None:
        """Take what the message brought."""

    def unused(self, sample: Sample) -> None:
        """Note what a message brought that counts, and is not what is asked for."""

    def judged(self, sample: Optional[Sample]) -> None:
        """Note what the newest message says beside the answer to the question."""

    def update(self) -> Result:
        """Judge the newest message."""
        if self.status is not RUNNING:
            self.started_at = self.mission.clock.now()
        try:
            return self._answer()
        except PortError as error:
            self._stop_timers()
            return self._fail(self.missing(error), 0.0)

    def _answer(self) -> Result:
        sample = self.mission.topics.newest(self.topic)
        counts = sample is not None and self._counts(sample)
        self.judged(sample)
        if sample is not None and counts and self.is_evidence(sample.value):
            return self._true(sample)
        if sample is not None and counts and self.evidence.is_given_up(sample.value):
            self.mission.topics.wake_when(self.uid, self.topic, self.is_evidence)
            return self._false(sample)
        self.mission.topics.wake_when(self.uid, self.topic, self._is_end)
        self.mission.topics.listen(self.topic, self.wait)
        if not self._waits():
            return self._false(sample)
        if self.status is not RUNNING:
            self._begin_to_wait(self.wait)
        return RUNNING

    def _begin_to_wait(self, limit: float) -> None:
        sensed = self.own_sense
        self.begin_wait(self.awaiting or (self.registration_id if sensed is None else sensed.awaiting), limit)

    def _is_end(self, value: Any) -> bool:
        return self.is_evidence(value) or self.evidence.is_given_up(value)

    def _counts(self, sample: Sample) -> bool:
        age = self.mission.clock.now() - sample.arrived
        return sample.arrived > self.not_before() and (
            not self.topic.is_continuous or age <= self.mission.settings.topic_max_age)

    def _true(self, sample: Sample) -> Result:
        self._stop_timers()
        self.mission.topics.listen(self.topic, 0.0)
        if self.topic.is_continuous:
            self.mission.topics.wake_when(self.uid, self.topic, lambda value: not self.is_evidence(value))
            left = sample.arrived + self.mission.settings.topic_max_age - self.mission.clock.now()
            self._expiry = self.mission.clock.call_after(left + 0.001, self.wake)
        self._told = ("", 0.0)
        self.told = self._told_of(self.own_sense.given if self.own_sense is not None else "")
        self.use(sample)
        return self.succeeded()

    def _false(self, sample: Optional[Sample]) -> Result:
        self._stop_timers()
        failure = Failure(Cause.CONDITION_FALSE, self.otherwise, self.resource)
        if sample is not None and not self._counts(sample):
            when = "came before" if sample.arrived <= self.not_before() else "is too old"
            failure = failure._replace(message="{}; the newest message {}".format(self.otherwise, when))
        self.told = self._told_of(self.own_sense.absent if self.own_sense is not None else "")
        if sample is not None and self._counts(sample):
            self.unused(sample)
        return self._fail(failure, self.not_before())

    def _told_of(self, mark: str) -> Optional[Told]:
        return Told("visit", "", mark, self.mission.clock.now()) if mark else None

    def _fail(self, failure: Failure, since: float) -> Result:
        telling = failure.message, max(since, self.mission.visit_began)
        if telling == self._told:
            # asked again at every tick of a wait: recorded each time, reported once
            self.mission.failures.add(self, failure)
            return FAILURE
        begins = self._beside is not None and telling[1:] != self._told[1:]
        self._told = telling
        result = self.failed(failure)
        if begins and self._beside is not None:
            self._begin_to_wait(self._beside)
        return result

    @property
    def wait(self) -> float:
        """Seconds that the condition waits for its evidence."""
        wait = self.evidence.wait
        return self.mission.settings.condition_wait if wait is None else wait

    def _waits(self) -> bool:
        if self.wait <= 0.0 or self._is_over or is_asked_again(self):
            return False
        if self._patience is None and self.wait < math.inf:
            self._patience = self.mission.clock.call_after(self.wait, self._give_up)
        return True

    def _give_up(self) -> None:
        self._is_over = True
        self.wake()

    def _stop_timers(self) -> None:
        for timer in (self._expiry, self._patience):
            if timer is not None:
                timer.cancel()
        self._expiry = self._patience = None
        self._is_over = False

    def halt(self) -> None:
        """Stop waiting."""
        if self.status is RUNNING:
            self.mission.topics.listen(self.topic, 0.0)
        self._stop_timers()
        super().halt()


def _named(leaf: Type[MissionLeaf], choices: Mapping[str, Dict[str, Any]], name: str) -> MissionLeaf:
    return leaf(name, **choices[argument(name)])


def _listens(leaf: Type[MissionLeaf]) -> Tuple[Union[Sense, Topic], ...]:
    if issubclass(leaf, TopicCondition) and leaf.own_evidence is not None:
        return (leaf.own_evidence.topic,)
    return (leaf.sense,) if leaf.sense is not None else ()


def leaf_spec(node_id: str, leaf: Type[MissionLeaf], description: str, ports: Tuple[Port, ...] = (),
              arguments: Optional[Dict[str, Any]] = None, choices: Optional[Mapping[str, Dict[str, Any]]] = None,
              **facts: Any) -> MissionSpec:
    """Return the node type of a leaf: kind, ports, requests and topics are those of the class.

    ``ports`` are added to those of the class, ``arguments`` are the constructor's beside the name. With ``choices`` the
    name of an instance chooses them.
    """
    return MissionSpec(
        node_id, Kind.CONDITION if issubclass(leaf, ConditionLeaf) else Kind.ACTION,
        partial(_named, leaf, choices) if choices else partial(leaf, **arguments) if arguments else leaf,
        leaf.PORTS + ports, description, names=tuple(choices or ()),
        is_instant=issubclass(leaf, (InstantAction, InstantCondition)),
        calls=(leaf.asks,) if issubclass(leaf, ServiceLeaf) else (), does_without=issubclass(leaf, OptionalServiceLeaf),
        listens=_listens(leaf), **facts)
