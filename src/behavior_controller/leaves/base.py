"""The common parts of mission leaves: their context, the record of failures, and service calls.

A service leaf fills a request and reads an answer; deadline, waiting and the mapping to a status are implemented here once.
"""
import itertools
import math
from abc import abstractmethod
from functools import partial
from typing import Any, Callable, Dict, List, Mapping, NamedTuple, Optional, Sequence, Tuple, Type, TypeVar, Union

from behavior_controller.bt.engine.clock import Clock
from behavior_controller.bt.engine.leaf import ActionLeaf, ConditionLeaf, SyncActionLeaf
from behavior_controller.bt.engine.node import ConfigureError, Node, Result
from behavior_controller.bt.engine.tree import Tree
from behavior_controller.bt.language.blackboard import Blackboard
from behavior_controller.bt.language.ports import NoValue, PortError
from behavior_controller.bt.ownership import tick_thread_only
from behavior_controller.bt.registry import Kind, Port, argument
from behavior_controller.bt.status import FAILURE, IDLE, NAMES, RUNNING, SUCCESS
from behavior_controller.events import Events, LeafFinished, StepStarted, Told
from behavior_controller.gateway import Call, Cause, Failure, Gateway, Topics
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
    """The newest failure of each leaf: HandleFallBack finds its cause in it."""

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
    """The context of the leaves of a running mission. ``setup(mission=…)`` passes it to each."""

    def __init__(self, gateway: Gateway, topics: Topics, settings: Settings, phrases: Phrases, policy: Policy,
                 clock: Clock, events: Events, health: Optional[Health] = None, knowledge: Optional[Knowledge] = None,
                 offers: Sequence[Union[Service, Topic]] = ()):
        """``health`` is the state of the robot's nodes; without it they count as working.

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
        """Clear the last visitor's data on the root's ``blackboard``; answers and gazes from before ``at`` do not count."""
        self.visit_began = at
        for datum in data.ALL:
            blackboard.unset(datum.name)
        for datum in (data.QUESTION_ASKED_AT, data.ATTENTION_SET_AT):
            blackboard.set(datum.name, at, datum.type)

    def leaves_of(self, tree: Tree) -> List[List[str]]:
        """Return path and type of each mission leaf, in document order."""
        return [[node.full_path, node.registration_id] for node in tree.nodes if isinstance(node, MissionLeaf)]


class MissionLeaf(Node):
    """A leaf of the mission vocabulary. A wrong port at any point is a failure of the leaf."""

    PORTS: Tuple[Port, ...] = ()
    spec: MissionSpec
    mission: MissionContext
    sense: Optional[Sense] = None  # the sign of the visitor that it checks
    own_evidence: Optional[Evidence] = None  # of a topic that another package declares, instead of a sense
    otherwise = "it does not hold"  # the message of a condition's failure
    resource = ""  # the service or topic that the leaf uses, by canonical name
    started_at = 0.0
    told: Optional[Told] = None  # the sentence for people when the leaf ends

    def configure(self) -> None:
        """Refuse a node type without the facts that the recovery needs."""
        if not isinstance(self.spec, MissionSpec):
            raise ConfigureError("{} is a mission leaf and is declared by a NodeSpec alone; declare it with leaf_spec"
                                 .format(self.registration_id))

    def setup(self, **kwargs: Any) -> None:
        """Take the mission's context; a tree that is only drawn has none."""
        if "mission" in kwargs:
            self.mission = kwargs["mission"]

    def get_input_or(self, port: str, otherwise: Any) -> Any:
        """Return the value of an input port, or ``otherwise`` if nothing has written its entry. Raises PortError."""
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
        """Emit the event that this leaf finished."""
        resource = (failure.resource if failure is not None else "") or self.resource
        self.feedback_message = failure.message if failure is not None else ""
        told, self.told = self.told, None
        self.mission.events.emit(LeafFinished(self.uid, self.registration_id, self.full_path, NAMES[status], resource,
                                              self.mission.clock.now() - self.started_at, failure, told))

    def begin_step(self, words: str, what: str, limit: float) -> None:
        """Emit in words for people what the robot does from now on, for ``limit`` seconds at most (0: any)."""
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
        """Carry out the action; return its failure, if any."""

    def update(self) -> Result:
        """Act and report."""
        self.started_at = self.mission.clock.now()
        try:
            failure = self.act()
        except PortError as error:
            failure = self.missing(error)
        return self.succeeded() if failure is None else self.failed(failure)


class InstantCondition(MissionLeaf, ConditionLeaf):
    """A condition on the mission's own data."""

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
        """Drop the attempt; its answer is not used."""
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
        """Return the request, or why it cannot be made, or None if it is not needed (SUCCESS)."""

    def accept(self, answer: Answer) -> Optional[Failure]:
        """Store the content of a positive answer; return its failure if it is wrong."""
        return None

    def words(self, request: Request) -> Words:
        """Return the words for ``request``: its own, or the name of the node."""
        return request.words or Words(self.registration_id, self.registration_id + " is done")

    def done(self, words: Words) -> Optional[Told]:
        """Return the sentence for a request that was carried out."""
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
        """Begin an attempt; a recovery calls this to retry the step."""
        return Attempt(self)

    def on_start(self) -> Result:
        """Begin the first attempt."""
        self.started_at = self.mission.clock.now()
        self.attempt = self.try_once()
        return self.on_running()

    def on_running(self) -> Result:
        """Check whether the attempt has ended."""
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
    """A leaf that succeeds without a request on a robot whose interface lacks the service."""

    @property
    def resource(self) -> str:
        """The service's canonical name; empty if there is none."""
        return super().resource if self.mission.interface.serves(self.asks) else ""

    def request(self) -> Union[Request, Failure, None]:
        """Return the request, if the robot has a service for it."""
        return self.wanted() if self.mission.interface.serves(self.asks) else None

    @abstractmethod
    def wanted(self) -> Union[Request, Failure, None]:
        """As ``request`` of a ServiceLeaf."""


def _named(leaf: Type[MissionLeaf], choices: Mapping[str, Dict[str, Any]], name: str) -> MissionLeaf:
    return leaf(name, **choices[argument(name)])


def _listens(leaf: Type[MissionLeaf]) -> Tuple[Union[Sense, Topic], ...]:
    if leaf.own_evidence is not None:
        return (leaf.own_evidence.topic,)
    return (leaf.sense,) if leaf.sense is not None else ()


def leaf_spec(node_id: str, leaf: Type[MissionLeaf], description: str, ports: Tuple[Port, ...] = (),
              arguments: Optional[Dict[str, Any]] = None, choices: Optional[Mapping[str, Dict[str, Any]]] = None,
              **facts: Any) -> MissionSpec:
    """Return the node type of a leaf: kind, ports, requests and topics are those of the class.

    ``ports`` are added to those of the class, ``arguments`` are the constructor's after the name. With ``choices`` the
    name of an instance chooses them. Raises ImportError if a service leaf does not say what it asks for.
    """
    if issubclass(leaf, ServiceLeaf) and not hasattr(leaf, "asks"):
        raise ImportError("{}.{}, the leaf of {}, does not say what it asks for: asks = the kind of request".format(
            leaf.__module__, leaf.__qualname__, node_id))
    return MissionSpec(
        node_id, Kind.CONDITION if issubclass(leaf, ConditionLeaf) else Kind.ACTION,
        partial(_named, leaf, choices) if choices else partial(leaf, **arguments) if arguments else leaf,
        leaf.PORTS + ports, description, names=tuple(choices or ()),
        is_instant=issubclass(leaf, (InstantAction, InstantCondition)),
        calls=(leaf.asks,) if issubclass(leaf, ServiceLeaf) else (), does_without=issubclass(leaf, OptionalServiceLeaf),
        listens=_listens(leaf), **facts)
