"""What a robot offers, one declaration for each service, action and topic.

The ROS edge, the start-up check, the monitoring, the configuration's deadlines and the simulated
robot use only these declarations for their knowledge of a service or topic.
"""
import enum
import itertools
import reprlib
from dataclasses import dataclass, field
from functools import cached_property
from typing import (Any, Callable, Collection, Dict, Generic, Mapping, NamedTuple, Optional,
                    Sequence, Tuple, Type, TypeVar, Union)

from behavior_controller.foreign_code import defined_at, described, takes
from behavior_controller.robot.requests import Answer, Listen, QueryKnowledge, Request


Message = Any  # type: ignore
"""A ROS message or response; these classes are generated and have no types."""

Asked = TypeVar("Asked", bound=Request)
Value = TypeVar("Value")
Plain = Union[bool, int, float, str]

KNOWLEDGE_FILES = "the knowledge files"
"""The name of the source that answers ``QueryKnowledge`` if the robot has no such service."""


MOST_EVENTS = 100
"""Number of events of a topic that are kept; a visitor says less within the window of a question.
"""


class Unusable(ValueError):
    """A positive answer has unusable content; the text says which."""


class Unsendable(ValueError):
    """A declaration does not turn a request into a message; the text says why, and where in Python.
    """


class WrongFields(Unsendable):
    """A declaration returns other values than its type has fields."""


def _check_functions(declared: object, owner: str, **counts: int) -> None:
    """Raise TypeError if a function of a declaration does not take so many arguments."""
    for piece, count in counts.items():
        function = getattr(declared, piece)
        if callable(function) and not takes(function, count):
            raise TypeError(f"{piece} of the {type(declared).__name__} of {owner}"
                            f"{defined_at(function)} does not take {count} "
                            f"argument{'s' * (count > 1)}")


class Success(NamedTuple):
    """The response's field with the outcome, and its values for done and refused. Any other value
    is unusable."""

    field: str
    done: Plain
    refused: Plain


@dataclass(frozen=True)
class Sample(Generic[Value]):
    """A message of a topic, as plain data, and when it arrived (monotonic seconds)."""

    value: Value
    arrived: float


@dataclass(frozen=True, eq=False)
class Service(Generic[Asked]):
    """A service of the robot.

    ``request`` is the kind of record that it carries out, ``fields`` returns the values of the srv
    request in order; ``answer`` reads a positive response and raises ``Unusable``. ``name`` is the
    canonical name, ``node`` the robot's node that offers it, ``type`` its ``package/Type``.
    ``deadline`` is the default, in seconds. ``impact_if_missing`` says what the robot cannot do
    without it;
    ``is_optional``: a mission starts on a robot without it, where its leaves then succeed, unless
    ``fails_without``. ``simulated_answer`` returns the robot's answer in a rehearsal, of a service
    that ``simulation`` does not know. ``answers_early``: whether a request is answered when it
    begins to be carried out, and not when it is done.
    """

    request: Type[Asked]
    name: str
    node: str
    type: str
    fields: Callable[[Asked], Tuple[object, ...]]
    success: Optional[Success]
    deadline: float
    impact_if_missing: str
    answer: Callable[[Message], Answer] = lambda response: Answer()
    is_optional: bool = False
    fails_without: bool = False
    simulated_answer: Callable[[Asked], Answer] = lambda request: Answer()
    answers_early: Callable[[Asked], bool] = lambda request: False

    kind = "service"

    def __post_init__(self) -> None:
        """Raise TypeError, which names it, if a piece is missing, so that the next one stands in
        its place."""
        may_lack = self.success is None and self.kind != Service.kind
        fits = {"fields": callable(self.fields),
                "success": may_lack or isinstance(self.success, Success),
                "deadline": isinstance(self.deadline, (int, float)),
                "impact_if_missing": isinstance(self.impact_if_missing, str),
                "answer": callable(self.answer)}
        for piece, is_there in fits.items():
            if not is_there:
                raise TypeError(f"the declaration of {self.name} has no {piece}, but "
                                f"{getattr(self, piece)!r} in its place")
        _check_functions(self, self.name, fields=1, answer=1, simulated_answer=1, answers_early=1)

    @cached_property
    def deadline_key(self) -> str:
        """The configuration's key for the deadline."""
        return self.node + "Deadline"

    def values(self, request: Asked, names: Sequence[str]) -> Sequence[object]:
        """Return the values of the message's fields, which have these names. Raises Unsendable."""
        try:
            values = self.fields(request)
        except BaseException as error:  # that of another package may raise anything
            raise Unsendable(f"its declaration: {described(error, self.fields)}") from error
        if not isinstance(values, (tuple, list)) or len(values) != len(names):
            raise WrongFields(
                f"its declaration: fields{defined_at(self.fields)} returned {reprlib.repr(values)};"
                f" {self.type} has the fields {', '.join(names) or '-'}: return a tuple with a "
                "value for each")
        return values

    def rehearse(self, request: Asked) -> Answer:
        """Return the answer in a rehearsal. Raises Unusable."""
        try:
            return self.simulated_answer(request)
        except BaseException as error:
            raise Unusable(f"its declaration: {described(error, self.simulated_answer)}") from error


@dataclass(frozen=True, eq=False)
class Action(Service[Asked]):
    """An action of the robot, declared as a service: a request is carried out as one goal.

    ``name`` is the action's namespace, ``type`` the ``package/Type`` of its file; ``fields``
    returns the values of the goal's fields, those of a nested message as a dict or a list, as
    ``rostopic pub`` takes them. ``answer`` reads the result. ``success`` None: the goal's status
    alone says whether it is done. ``feedback`` puts a feedback message into words for people.
    """

    feedback: Callable[[Message], str] = lambda message: ""

    kind = "action"

    def __post_init__(self) -> None:
        super().__post_init__()
        _check_functions(self, self.name, feedback=1)


@dataclass(frozen=True, eq=False)
class Publication(Service[Asked]):
    """A topic that the robot's ``node`` subscribes to, declared as a service: a request is carried
    out as one message, and is done when that is sent. ``fields``: see ``Action``; ``success`` is
    None."""

    kind = "topic"


@dataclass(frozen=True, eq=False)
class Topic(Generic[Value]):
    """A topic of the robot. ``read`` turns a message into plain data of the kind ``value``.

    ``is_continuous``: its messages are a state that is published all the time: the newest alone
    counts, an old one counts as absent, and silence is a fault. Otherwise they are events, of which
    none is skipped. ``action``: an action that a robot may offer instead, for ``Listen``: the
    response of its answer is a message, its deadline the seconds after those of the request within
    which the result comes. ``is_event``: whether a value of a state is an event, which the robot
    may publish only once: the newest one counts too. ``words`` says for people what a value is.
    ``simulated_value`` returns what a rehearsal publishes on a topic that ``simulation`` does not
    know, by the seconds since its beginning; None: nothing. The other fields: see ``Service``.
    """

    name: str
    node: str
    type: str
    value: Type[Value]
    read: Callable[[Message], Value]
    impact_if_missing: str
    is_continuous: bool
    action: Optional[Action[Listen]] = None
    is_event: Optional[Callable[[Value], bool]] = None
    simulated_value: Optional[Callable[[float], Optional[Value]]] = None
    words: Callable[[Value], str] = str

    kind = "topic"
    is_optional = False

    def __post_init__(self) -> None:
        _check_functions(self, self.name, read=1, is_event=1, simulated_value=1, words=1)

    def kept(self, messages: "Tuple[Sample[Value], ...]",
             newest: "Sample[Value]") -> "Tuple[Sample[Value], ...]":
        """Return what is kept when ``newest`` has come after ``messages``: state or last events."""
        if not self.is_continuous:
            return messages[1 - MOST_EVENTS:] + (newest,)
        if self.is_event is None or self.is_event(newest.value):
            return (newest,)
        return tuple(message for message in messages if self.is_event(message.value)) + (newest,)


Offer = Union[Service, Topic]
"""What a robot offers."""


class SenseWords(NamedTuple):
    """What the robot reports, in words, and a phrase for a robot that waits for it.

    ``given`` and ``absent`` are the marks of ``events.LeafSummary`` for a visit in which it was
    observed, or not.
    """

    noun: str
    awaiting: str
    given: str = ""
    absent: str = ""


class Sense(SenseWords, enum.Enum):
    """A kind of information about the visitor that a mission can get while it runs."""

    VISITOR = "a visitor", "waiting for a visitor", "arrived", "left"
    PRESENCE = ("the visitor's presence", "waiting for the visitor to be seen", "arrived", "left")
    GAZE = "the visitor's gaze", "waiting for the visitor to look at the robot", "engaged"
    UTTERANCE = "the visitor's utterance", "listening to the visitor"


@dataclass(frozen=True, eq=False)
class Evidence(Generic[Value]):
    """The evidence for a sense: a message of ``topic`` for which ``is_given`` holds.

    ``is_given`` takes the message's value and the value of /overtAttention/mode that means mutual
    gaze. ``wait`` is the seconds that a condition waits for the evidence, infinity for no limit;
    None: those of ``conditionWait``. ``is_given_up``: the robot has stopped looking, so a condition
    stops waiting. ``mode`` is the mode of attention without which the robot does not look; empty:
    any.
    """

    topic: Topic[Value]
    is_given: Callable[[Value, int], bool] = lambda value, gaze_value: True
    wait: Optional[float] = None
    is_given_up: Callable[[Value], bool] = lambda value: False
    mode: str = ""

    def __post_init__(self) -> None:
        _check_functions(self, getattr(self.topic, "name", "?"), is_given=2, is_given_up=1)


@dataclass(eq=False)
class Interface:
    """All services and topics of one robot, their evidence about a visitor, and the requests that
    make the robot safe.

    ``name`` identifies it in the configuration and in a record; ``senses`` has the evidence of each
    sense. ``gaze_value`` is the value of
    /overtAttention/mode that means mutual gaze; None: the configuration says it.
    ``has_knowledge_files``: files answer ``QueryKnowledge`` and hold the language and the phrases.
    ``tells_pressed``: the tablet's answer says which button was pressed. ``takes_arm``: a deictic
    gesture has an arm and a shape of the hand. ``numbers_phrases``: the number of a utility phrase
    says what it is about. ``ends_location``: after the mode ``location`` attention is switched off.
    ``never_asked``: the kinds of requests that are left out for this robot. ``namespace`` stands
    before the names of a robot beside others; ``names`` has the resolved names of what is remapped,
    by canonical name. Raises ValueError if two services carry out the same
    kind of request, or kinds of the same name.
    """

    name: str
    services: Tuple[Service, ...]
    topics: Tuple[Topic, ...]
    safe_state: Tuple[Request, ...]
    senses: Mapping[Sense, Evidence]
    gaze_value: Optional[int] = None
    has_knowledge_files: bool = False
    tells_pressed: bool = True
    takes_arm: bool = False
    numbers_phrases: bool = True
    ends_location: bool = False
    never_asked: Tuple[type, ...] = ()
    namespace: str = ""
    names: Mapping[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self._by_request: Dict[type, Service] = {
            service.request: service for service in self.services}
        self._kinds: Dict[type, Optional[type]] = {}
        for one, other in itertools.combinations(self.services, 2):
            kind, name = one.request, one.request.__name__
            if other.request is kind:
                raise ValueError(f"{one.name} and {other.name} are both declared for {name}")
            if other.request.__name__ == name:
                raise ValueError(f"{kind.__module__} has a request {name} already, and records "
                                 f"have its name alone: rename that of {other.name}")
            if one.deadline_key == other.deadline_key and one.deadline != other.deadline:
                raise ValueError(f"{one.name} and {other.name} of the node {one.node} share one "
                                 "deadline, and declare different ones")
        for request in self.safe_state:
            self.service(type(request))

    @property
    def offers(self) -> Tuple[Offer, ...]:
        """All services and topics."""
        return self.services + self.topics

    def _kind(self, request: type) -> Optional[type]:
        """Return the kind of request as which a service carries out ``request``: that kind itself,
        or else the one from which it is derived, as for the goal of an action."""
        if request not in self._kinds:  # each request of a run asks several times
            self._kinds[request] = next(
                (kind for kind in request.__mro__ if kind in self._by_request), None)
        return self._kinds[request]

    def service(self, request: type) -> Service:
        """Return the service for a kind of request. Raises LookupError, which names it, if none is
        declared."""
        kind = self._kind(request)
        if kind is None:
            raise LookupError(f"no service is declared for the request {request.__name__}: declare "
                              "it in behavior_controller.robot.declarations")
        return self._by_request[kind]

    def substitute(self, offer: Offer) -> Optional[Service]:
        """Return what stands in where no node offers ``offer``: for an action the service of the
        same name, for a service the action, for a topic its action."""
        if isinstance(offer, Topic):
            return offer.action
        return next((other for other in self.services
                     if other is not offer and other.name == offer.name
                     and (issubclass(offer.request, other.request)
                          or issubclass(other.request, offer.request))), None)

    def serves(self, request: type) -> bool:
        """Return whether a kind of request is answered, by a service of the robot or from files."""
        return (self._kind(request) is not None
                or self.has_knowledge_files and request is QueryKnowledge)

    def resource(self, request: type) -> str:
        """Return the name of the service for a kind of request, or ``FILES``. Raises LookupError
        as ``service``."""
        if self.has_knowledge_files and request is QueryKnowledge:
            return KNOWLEDGE_FILES
        return self.name_of(self.service(request))

    def name_of(self, offer: Offer) -> str:
        """Return the resolved name of a service or topic of this robot."""
        return self.names.get(offer.name, self.namespace + offer.name)

    def node_of(self, offer: Offer) -> str:
        """Return the name of the node that has a service or topic, without the first slash; empty:
        of any."""
        return f"{self.namespace}/{offer.node}"[1:] if offer.node else ""

    def tells(self, sense: Union[Sense, Topic]) -> bool:
        """Return whether the robot has evidence of ``sense``, or publishes that topic."""
        return sense in self.topics if isinstance(sense, Topic) else sense in self.senses

    def evidence(self, sense: Sense) -> Evidence:
        """Return the evidence of ``sense``. Raises LookupError if this robot has none."""
        try:
            return self.senses[sense]
        except KeyError:
            raise LookupError(f"the robot {self.name} does not tell of {sense.noun}") from None

    def used(self, requests: Collection[type],
             senses: Collection[Union[Sense, Topic]]) -> Tuple[Offer, ...]:
        """Return the services and topics that these kinds of requests, senses and topics need, in
        their order."""
        topics = [sense if isinstance(sense, Topic) else self.evidence(sense).topic
                  for sense in senses if self.tells(sense)]
        kinds = set(map(self._kind, requests))
        services = (service for service in self.services if service.request in kinds)
        return (*services, *(topic for topic in self.topics if topic in topics))

    def topic(self, name: str) -> Topic:
        """Return the topic of that canonical name. Raises LookupError if none is declared."""
        for topic in self.topics:
            if topic.name == name:
                return topic
        raise LookupError(f"no topic {name} is declared")
