"""The common parts of mission leaves: their context, the record of failures, and service calls.

A service leaf fills a request and reads an answer; deadline, waiting and the mapping to a status
are implemented here once.
"""
import math
import reprlib
from abc import abstractmethod
from collections import deque
from functools import partial
from typing import (Any, Callable, Deque, Dict, Generator, List, Mapping, Optional,
                    Sequence, Tuple, Type, TypeVar, Union)

import msgspec

from behavior_controller.bt import (
    ActionLeaf, Blackboard, Clock, ConditionLeaf, ConfigureError, Kind, NoValue, Node, NodeError,
    Port, PortError, Result, SyncActionLeaf, FAILURE, IDLE, RUNNING, SUCCESS)
from behavior_controller.foreign_code import defined_at
from behavior_controller.thread_check import tick_thread_only
from behavior_controller.bt.engine.registry import argument
from behavior_controller.bt.values.status import NAMES
from behavior_controller.run.events import Events, LeafFinished, StepStarted, LeafSummary
from behavior_controller.robot.gateway import Call, Cause, Failure, Gateway, Topics
from behavior_controller.run.health import Health
from behavior_controller.robot.declarations import Evidence, Offer, Sense, Topic
from behavior_controller.robot.requests import Answer, Request, Target, Words
from behavior_controller.config.knowledge_files import Knowledge
from behavior_controller.leaves import data
from behavior_controller.config.node_facts import MissionSpec
from behavior_controller.config.phrases import Phrases
from behavior_controller.config.recovery_policy import MOST_RECOVERIES, Policy
from behavior_controller.run.safe_state import SafeState
from behavior_controller.config.settings import Settings
from behavior_controller.text import joined

Shared = TypeVar("Shared")
Value = TypeVar("Value")
Awaited = Union[Call, SafeState]
Waiting = Generator[Optional[Awaited], None, Value]
"""Work of several ticks: it yields while it waits, and is dropped when it is closed.

It may yield the call for whose result it waits: then it goes on when that has come, and the call is
dropped when the leaf is halted."""


class FailureLog:
    """The failures of a pass."""

    @tick_thread_only
    def __init__(self) -> None:
        # the node whose failure was given up last, with the robot in the safe state, and when that
        # was, by ``changed_at``
        self.given_up: Tuple[Optional[Node], int] = (None, 0)
        self.begin_pass()

    @tick_thread_only
    def begin_pass(self) -> None:
        """Note that the failures from now on are those of another pass."""
        self.is_budget_spent = False  # so that a failure of this pass was given up
        self.unrecovered: List[Failure] = []  # those that were given up
        self._last: List[Failure] = []  # the newest

    @tick_thread_only
    def of_pass(self) -> List[Failure]:
        """Return what this pass may have failed for: the failures that were given up, and the
        newest one."""
        return self.unrecovered + self._last

    @tick_thread_only
    def add(self, leaf: "MissionLeaf", failure: Failure) -> None:
        """Record that ``leaf`` failed."""
        leaf.failure, self._last = failure, [failure]


NOT_ASKED = "nothing was asked"
BEFORE_QUESTION = "it was said before the question"
"""Why a spoken answer is ignored."""


class MissionContext:
    """The context of the leaves of a running mission. ``setup(mission=…)`` passes it to each."""

    def __init__(self, gateway: Gateway, topics: Topics, settings: Settings, phrases: Phrases,
                 policy: Policy, clock: Clock, events: Events, health: Optional[Health] = None,
                 knowledge: Optional[Knowledge] = None, offers: Sequence[Offer] = ()):
        """``health`` is the state of the robot's nodes; without it they count as working.

        ``knowledge`` is that of files, where they stand for a knowledge base; ``offers`` are the
        services and topics that the mission cannot do without.
        """
        self.gateway, self.topics, self.offers = gateway, topics, offers
        self.settings, self.interface = settings, settings.interface
        self.phrases, self.policy, self.knowledge = phrases, policy, knowledge
        self.clock, self.events, self.health = clock, events, health or Health()
        self.language, self.failures = (knowledge or settings).language, FailureLog()
        # when the last ones began, as many as a budget can have
        self._recoveries: Deque[float] = deque(maxlen=MOST_RECOVERIES)
        self.visit_began = -math.inf
        # until when the first message of a state is awaited, by topic
        self.first_due: Dict[Topic, float] = {}
        self.has_questions = False  # whether answers count only after a question
        self._shared: Dict[Any, Any] = {}
        self._names: Dict[Any, str] = {}  # for people, by location and by gesture target

    def shared(self, kind: Callable[[], Shared]) -> Shared:
        """Return the one ``kind()`` of this mission, which its leaves share."""
        return self._shared.setdefault(kind, kind())

    def name_place(self, name: str, *targets: Target) -> None:
        """Have the place of these called ``name``, under which it was chosen, where people read of
        it."""
        for target in targets:
            self._names[type(target), target] = name  # a location may equal a target

    def named(self, words: Words) -> Words:
        """Return ``words`` with the name of the place, if it has one, instead of its coordinates.
        """
        name = self._names.get((type(words.target), words.target))
        if name is None:
            return words
        what = f"{words.what.split()[0]} {name}"
        return words._replace(what={"to its home": "home"}.get(what, what))

    def ignore_answers(self, reason: str) -> None:
        """Have spoken answers reported as ignored from now on, and why; empty: they count.

        Without a question in the mission, answers count at any time of the visit.
        """
        if not self.has_questions:
            reason = ""  # the mission before a reload may have had one
        if self.interface.tells(Sense.UTTERANCE):
            topic = self.interface.evidence(Sense.UTTERANCE).topic
            self.topics.ignore(topic, reason, self.phrases.is_answer)

    def begin_visit(self, blackboard: Blackboard, at: float) -> None:
        """Clear the last visitor's data on the root's ``blackboard``; answers and gazes from before
        ``at`` do not count."""
        self.visit_began = at
        self.ignore_answers(NOT_ASKED)
        self.failures.begin_pass()
        for datum in data.ALL:
            blackboard.unset(datum.name)
        for datum in (data.QUESTION_ASKED_AT, data.ATTENTION_SET_AT):
            blackboard.set(datum.name, at, datum.type)

    def ask_for_safe_state(self) -> SafeState:
        """Send the requests for the safe state. On the tick thread."""
        return SafeState(self.gateway, self.interface, self.offers, self.clock.process.now)

    def recovers_again_at(self) -> float:
        """Return when the budget allows a recovery, by the mission's clock."""
        most = self.policy.most
        if len(self._recoveries) < most:
            return -math.inf
        return self._recoveries[-most] + self.policy.seconds if most else math.inf

    def afford_recovery(self) -> bool:
        """Count a recovery that begins now; return whether the budget allows it."""
        now = self.clock.now()
        is_affordable = self.recovers_again_at() <= now
        self._recoveries.append(now)
        self.failures.is_budget_spent |= not is_affordable
        return is_affordable


class MissionLeaf(Node):
    """A leaf of the mission vocabulary. A wrong port at any point is a failure of the leaf."""

    PORTS: Tuple[Port, ...] = ()
    spec: MissionSpec
    mission: MissionContext
    sense: Optional[Sense] = None  # the sign of the visitor that it checks
    # of a topic that another package declares, instead of a sense
    own_evidence: Optional[Evidence] = None
    otherwise = ""  # the message of a condition's failure; empty: its name, and "does not hold"
    resource = ""  # the service or topic that the leaf uses, by canonical name
    started_at = 0.0
    failure: Optional[Failure] = None  # its last one
    summary: Optional[LeafSummary] = None  # the sentence for people when the leaf ends

    def __init__(self, name: str, **constants: Any):
        """``constants`` are the ``arguments`` of its ``leaf_spec``, as attributes.

        Raises TypeError for one that the class does not declare.
        """
        super().__init__(name)
        for constant in constants:
            if not any(constant in vars(kind) or constant in vars(kind).get("__annotations__", ())
                       for kind in type(self).__mro__):
                raise TypeError(f"{type(self).__qualname__} declares no {constant}")
        vars(self).update(constants)

    def configure(self) -> None:
        """Refuse a node type without the facts that the recovery needs."""
        if not isinstance(self.spec, MissionSpec):
            raise ConfigureError(f"{self.registration_id} is a mission leaf and is declared by a "
                                 "NodeSpec alone; declare it with leaf_spec")

    def setup(self, **kwargs: Any) -> None:
        """Take the mission's context; a tree that is only drawn has none."""
        if "mission" in kwargs:
            self.mission = kwargs["mission"]
            self.join()

    def join(self) -> None:
        """Get or tell what the mission's leaves share. Called once it has its ``mission``."""

    def get_input_or(self, port: str, otherwise: Any) -> Any:
        """Return the value of an input port, or ``otherwise`` if nothing has written its entry.
        Raises PortError."""
        try:
            return self.get_input(port)
        except NoValue:
            return otherwise

    @property
    def words_if_false(self) -> str:
        """The message of a condition's failure."""
        return self.otherwise or f"{self.registration_id} does not hold"

    def missing(self, error: PortError) -> Failure:
        """Return the failure for a port that cannot be read or written."""
        return Failure(Cause.MISSING_DATA, str(error), self.resource)

    def checked_end(self, method: str, failure: Optional[Failure]) -> Optional[Failure]:
        """Return what a method returned. Raises NodeError if it is of a wrong kind."""
        if failure is not None and not isinstance(failure, Failure):
            raise NodeError(f"its {method}(){self._place(method)} returned {reprlib.repr(failure)};"
                            " allowed: None if it is done, or a Failure")
        return failure

    def _place(self, method: str) -> str:
        return defined_at(getattr(type(self), method))

    def succeeded(self) -> Result:
        """Report SUCCESS and return it."""
        return self.report(SUCCESS)

    def ended(self, failure: Optional[Failure]) -> Result:
        """Report how the leaf ended; ``failure`` None: it was done."""
        return self.succeeded() if failure is None else self.failed(failure)

    def failed(self, failure: Failure) -> Result:
        """Record and report the failure, and return FAILURE."""
        self.mission.failures.add(self, failure)
        return self.report(FAILURE, failure)

    def report(self, status: Any, failure: Optional[Failure] = None) -> Result:
        """Emit the event that this leaf finished, and return its status."""
        resource, self.feedback_message = self.resource, ""
        if failure is not None:
            resource, self.feedback_message = failure.resource or resource, failure.message
        summary, self.summary = self.summary, None
        self.mission.events.emit(LeafFinished(
            self.uid, self.registration_id, self.full_path, NAMES[status], resource,
            self.mission.clock.now() - self.started_at, failure, summary))
        return status

    def begin_step(self, words: Words, limit: float, is_wait: bool = False,
                   goes_on: bool = False) -> None:
        """Emit in words for people what the robot does from now on, or waits for, for ``limit``
        seconds at most (0 or inf: any); ``goes_on``: see ``StepStarted``."""
        self.mission.events.emit(StepStarted(
            self.uid, self.registration_id, self.full_path, words.doing, words.what,
            limit if limit < math.inf else 0.0, is_wait, goes_on))

    def begin_wait(self, words: str, limit: float) -> None:
        """As ``begin_step``, for what the robot waits for."""
        self.begin_step(Words(words), limit, is_wait=True)


class InstantLeaf(MissionLeaf):
    """A leaf without a service: done within its tick."""

    RULE = ("act",)

    @abstractmethod
    def act(self) -> Optional[Failure]:
        """Carry out the action; return its failure, if any."""

    def update(self) -> Result:
        """Act and report."""
        self.started_at = self.mission.clock.now()
        try:
            return self.ended(self.checked_end("act", self.act()))
        except PortError as error:
            return self.failed(self.missing(error))


class InstantAction(InstantLeaf, SyncActionLeaf):
    """An action without a service."""


class InstantCondition(InstantLeaf, ConditionLeaf):
    """A condition on the mission's own data."""

    RULE = ("holds",)

    @abstractmethod
    def holds(self) -> bool:
        """Return the answer."""

    def act(self) -> Optional[Failure]:
        """Fail if the condition does not hold."""
        if self.holds():
            return None
        return Failure(Cause.CONDITION_FALSE, self.words_if_false)


class WorkingLeaf(MissionLeaf, ActionLeaf):
    """An action of several ticks, as one function."""

    RULE: Tuple[str, ...] = ("try_once", "work")
    rule = Node.rule
    asks: Union[type, Tuple[type, ...]] = ()  # the kinds of its requests
    _under_way: Optional[Waiting[Result]] = None
    _awaited: Optional[Awaited] = None

    def work(self) -> Waiting[Result]:
        """Do the work, and return the reported result."""
        return self.ended(self.checked_end("try_once", (yield from self.try_once())))

    @property
    def can_redo(self) -> bool:
        """Whether a recovery can do the work again, by ``try_once``."""
        return type(self).work is WorkingLeaf.work

    def try_once(self) -> Waiting[Optional[Failure]]:
        """Do the work once, yield where it waits for another tick, and return its failure.

        A recovery calls this to retry the step. A class that overrides ``work`` cannot be retried.
        """
        raise NotImplementedError

    def ask(self, request: Request) -> Waiting[Union[Answer, Failure]]:
        """Have the robot carry out a request, and return its answer or failure. Raises NodeError
        for a request that ``asks`` does not name."""
        if not isinstance(request, self.asks):
            raise NodeError(f"{reprlib.repr(request)} is no request that it asks for: name its kind"
                            f" in asks of the class {type(self).__name__}")
        self.summary = None
        words = self.words(request)
        self.begin_step(words, self.limit(request))
        call = self.mission.gateway.start(request)
        if call.result is None:
            yield call
        answer = call.result
        assert answer is not None
        if not isinstance(answer, Failure):
            seconds = self.lasts(request)
            if seconds:
                self.begin_step(words, seconds, goes_on=True)
                yield from self.pause(seconds)
            self.summary = self.done(words)
        return answer

    def words(self, request: Request) -> Words:
        """Return the words for ``request``: its own, or the name of the node."""
        words = request.words or Words(self.registration_id, self.registration_id + " is done")
        return self.mission.named(words)

    def done(self, words: Words) -> Optional[LeafSummary]:
        """Return the sentence for a request that was carried out."""
        if not words.done:
            return None
        return LeafSummary(words.kind, joined(" ", words.done, words.what))

    def limit(self, request: Request) -> float:
        """Return the seconds that ``request`` may take; 0 if no service carries it out."""
        try:
            return self.mission.settings.deadline(self.mission.interface.service(type(request)))
        except LookupError:
            return 0.0

    def lasts(self, request: Request) -> float:
        """Return the seconds for which the robot goes on with ``request`` after its answer."""
        return 0.0

    def on_start(self) -> Result:
        """Begin the work."""
        self.started_at = self.mission.clock.now()
        self._under_way, self._awaited = self.work(), None
        return self.on_running()

    def on_running(self) -> Result:
        """Go on with the work."""
        assert self._under_way is not None
        if self._awaited is not None and self._awaited.result is None:
            return RUNNING
        try:
            self._awaited = next(self._under_way)
        except StopIteration as over:
            return over.value
        except PortError as error:
            return self.failed(self.missing(error))
        return RUNNING

    def on_halted(self) -> None:
        """Drop the work."""
        if self._under_way is not None:
            self._under_way.close()
        if self._awaited is not None:
            self._awaited.drop()
        self.report(IDLE)

    def pause(self, seconds: float) -> Waiting[None]:
        """Wait that long."""
        timer = self.mission.clock.call_after(seconds, self.wake)
        try:
            while timer.callback is not None:
                yield None
        finally:
            timer.cancel()


class ServiceLeaf(WorkingLeaf):
    """An action that calls a service: RUNNING until the answer or the deadline, which the gateway
    keeps, and then for as long as ``lasts`` says."""

    RULE = ("request", "try_once", "work")
    asks: type  # the kind of request
    does_without = False  # it succeeds without a request on a robot that lacks the service

    @property
    def resource(self) -> str:
        """The service's name, or the files; empty if it does without."""
        if self.does_without and not self.mission.interface.serves(self.asks):
            return ""
        return self.mission.interface.resource(self.asks)

    @abstractmethod
    def request(self) -> Union[Request, Failure, None]:
        """Return the request, or why it cannot be made, or None if it is not needed (SUCCESS)."""

    def accept(self, answer: Answer) -> Optional[Failure]:
        """Store the content of a positive answer; return its failure if it is wrong."""
        return None

    def attempt_failed(self) -> None:
        """Process that a request failed, the leaf's own or a retry."""

    def _check_request(self, wanted: object) -> None:
        """Raise NodeError if a request is not of the kind that the leaf asks for, or has a field of
        a wrong type."""
        method = f"its request(){self._place('request')}"
        if not isinstance(wanted, self.asks):
            raise NodeError(
                f"{method} returned {reprlib.repr(wanted)}, which is no {self.asks.__name__}")
        try:
            msgspec.convert(msgspec.to_builtins(wanted), self.asks)
        except msgspec.ValidationError as error:
            raise NodeError(
                f"{method} returned a {self.asks.__name__} with a wrong field: {error}") from None

    def try_once(self) -> Waiting[Optional[Failure]]:
        """Make the request, and return its failure."""
        if self.does_without and not self.resource:
            return None
        try:
            wanted = self.request()
            if wanted is None or isinstance(wanted, Failure):
                return wanted
            self._check_request(wanted)
            answer = yield from self.ask(wanted)
            if isinstance(answer, Failure):
                self.attempt_failed()
                return answer
            failure = self.checked_end("accept", self.accept(answer))
        except PortError as error:
            failure = self.missing(error)
        if failure is not None:
            self.summary = None
        return failure


def leaf_spec(node_id: str, leaf: Type[MissionLeaf], description: str, ports: Tuple[Port, ...] = (),
              arguments: Optional[Dict[str, Any]] = None,
              choices: Optional[Mapping[str, Dict[str, Any]]] = None, **facts: Any) -> MissionSpec:
    """Return the node type of a leaf: kind, ports, requests and topics are those of the class.

    ``ports`` are added to those of the class, ``arguments`` are attributes of each leaf, or what
    its own constructor takes after the name.
    With ``choices`` the name of an instance chooses them. Raises ImportError if it is no mission
    leaf, or a service leaf that does not say what it asks for.
    """
    if not (isinstance(leaf, type) and issubclass(leaf, MissionLeaf)):
        raise ImportError(f"{leaf!r}, the leaf of {node_id}, is not a class of mission leaves")
    asks: Any = getattr(leaf, "asks", ())
    calls = asks if isinstance(asks, tuple) else (asks,)
    is_service = issubclass(leaf, ServiceLeaf)
    if is_service and len(calls) != 1 or not all(
            isinstance(kind, type) and issubclass(kind, Request) for kind in calls):
        raise ImportError(f"{leaf.__module__}.{leaf.__qualname__}, the leaf of {node_id}, does not "
                          "say what it asks for: asks = the kind of request")
    kind = Kind.CONDITION if issubclass(leaf, ConditionLeaf) else Kind.ACTION
    factory: Callable[[str], MissionLeaf] = partial(leaf, **(arguments or {}))
    if choices:
        factory = partial(_chosen, leaf, choices)
    evidence = leaf.own_evidence
    if evidence is not None and not (
            isinstance(evidence, Evidence) and isinstance(evidence.topic, Topic)):
        raise ImportError(f"own_evidence of {leaf.__qualname__} is no Evidence: Evidence(TOPIC)"
                          " wraps a topic")
    sign = leaf.sense if evidence is None else evidence.topic
    return MissionSpec(node_id, kind, factory, (*leaf.PORTS, *ports), description,
                       names=tuple(choices or ()), is_instant=issubclass(leaf, InstantLeaf),
                       may_fail_at_once=bool(calls), calls=calls,
                       does_without=getattr(leaf, "does_without", False),
                       listens=(sign,) if sign is not None else (), **facts)


def _chosen(leaf: Type[MissionLeaf], choices: Mapping[str, Dict[str, Any]],
            name: str) -> MissionLeaf:
    return leaf(name, **choices[argument(name)])
