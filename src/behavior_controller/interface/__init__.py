"""What a robot offers, one declaration for each service and topic.

The ROS edge, the start-up check, the monitoring, the configuration's deadlines and the simulated robot use only these
declarations for their knowledge of a service or topic.
"""
import copy
import enum
from dataclasses import dataclass
from typing import Any, Callable, Collection, Dict, Generic, Mapping, NamedTuple, Optional, Tuple, Type, TypeVar, Union

from behavior_controller.interface.records import Answer, QueryKnowledge, Request


Message = Any  # type: ignore
"""A ROS message or response; these classes are generated and have no types."""

Asked = TypeVar("Asked", bound=Request)
Value = TypeVar("Value")
Plain = Union[bool, int, float, str]

KNOWLEDGE_FILES = "the knowledge files"
"""The name of the source that answers ``QueryKnowledge`` if the robot has no such service."""


class Unusable(ValueError):
    """A positive answer has unusable content; the text says which."""


class Success(NamedTuple):
    """The response's field with the outcome, and its values for done and refused. Any other value is unusable."""

    field: str
    done: Plain
    refused: Plain


def _nothing(response: Message) -> Answer:
    return Answer()


@dataclass(frozen=True, eq=False)
class Service(Generic[Asked]):
    """A service of the robot.

    ``request`` is the kind of record that it carries out, ``fields`` returns the values of the srv request in order;
    ``answer`` reads a positive response and raises ``Unusable``. ``name`` is the canonical name, ``node`` the robot's
    node that offers it, ``type`` its ``package/Type``. ``deadline`` is the default, in seconds. ``absence`` says what
    the robot cannot do without it; ``is_optional``: a mission starts on a robot without it, where its leaves then
    succeed, unless ``fails_without``. ``rehearsed`` is the robot's answer in a rehearsal of a service that the test
    package does not simulate.
    """

    request: Type[Asked]
    name: str
    node: str
    type: str
    fields: Callable[[Asked], Tuple[object, ...]]
    success: Success
    deadline: float
    absence: str
    answer: Callable[[Message], Answer] = _nothing
    is_optional: bool = False
    fails_without: bool = False
    rehearsed: Callable[[Asked], Answer] = lambda request: Answer()

    def __post_init__(self) -> None:
        """Raise TypeError, which names it, if a piece is missing, so that the next one stands in its place."""
        fits = {"fields": callable(self.fields), "success": isinstance(self.success, Success),
                "deadline": isinstance(self.deadline, (int, float)), "absence": isinstance(self.absence, str),
                "answer": callable(self.answer)}
        for piece, is_there in fits.items():
            if not is_there:
                raise TypeError("the declaration of {} has no {}, but {!r} in its place".format(
                    self.name, piece, getattr(self, piece)))

    @property
    def deadline_key(self) -> str:
        """The configuration's key for the deadline."""
        return self.node + "Deadline"


@dataclass(frozen=True, eq=False)
class Action(Generic[Value]):
    """An action that a robot may offer instead of a topic, one goal for one message.

    ``goal`` returns the values of the goal's fields for the seconds that it may take; ``read`` turns a result into the
    topic's plain data, None for an empty result. ``type`` is the ``package/Type`` of the action file.
    """

    name: str
    type: str
    goal: Callable[[float], Tuple[object, ...]]
    read: Callable[[Message], Optional[Value]]


@dataclass(frozen=True, eq=False)
class Topic(Generic[Value]):
    """A topic of the robot. ``read`` turns a message into plain data of the kind ``value``.

    ``is_continuous``: it is published all the time, so that silence is a fault and an old message counts as
    absent. ``action``: an action that a robot may offer instead. The other fields: see ``Service``.
    """

    name: str
    node: str
    type: str
    value: Type[Value]
    read: Callable[[Message], Value]
    absence: str
    is_continuous: bool
    action: Optional[Action[Value]] = None


class Sense(enum.Enum):
    """A kind of information about the visitor that a mission can get while it runs.

    ``awaiting`` is a phrase for a robot that waits for it; ``given`` and ``absent`` are the marks of ``events.Told`` for a
    visit in which it was observed, or not.
    """

    awaiting: str
    given: str
    absent: str

    VISITOR = "visitor", "waiting for a visitor", "arrived", "left"
    PRESENCE = "presence", "waiting for the visitor to be seen", "arrived", "left"
    GAZE = "gaze", "waiting for the visitor to look at the robot", "engaged"
    UTTERANCE = "utterance", "listening to the visitor"

    def __new__(cls, word: str, awaiting: str, given: str = "", absent: str = "") -> "Sense":
        """Make the sense called ``word``."""
        sense = object.__new__(cls)
        sense._value_ = word
        sense.awaiting, sense.given, sense.absent = awaiting, given, absent
        return sense


@dataclass(frozen=True, eq=False)
class Evidence(Generic[Value]):
    """The evidence for a sense: a message of ``topic`` for which ``is_given`` holds.

    ``is_given`` takes the message's value and the value of /overtAttention/mode that means mutual gaze. ``wait`` is the
    seconds that a condition waits for the evidence, infinity for no limit; None: those of ``conditionWait``.
    ``is_given_up``: the robot has stopped looking, so a condition stops waiting. ``mode`` is the mode of attention
    without which the robot does not look; empty: any.
    """

    topic: Topic[Value]
    is_given: Callable[[Value, int], bool] = lambda value, gaze_value: True
    wait: Optional[float] = None
    is_given_up: Callable[[Value], bool] = lambda value: False
    mode: str = ""


class Interface:
    """All services and topics of one robot, their evidence about a visitor, and the requests that make the robot safe.

    ``name`` identifies it in the configuration and in a record. ``gaze_value`` is the value of
    /overtAttention/mode that means mutual gaze; None: the configuration says it. ``has_knowledge_files``: files answer
    ``QueryKnowledge`` and hold the language and the phrases. ``tells_pressed``: the tablet's answer says which button
    was pressed. Raises ValueError if two services carry out the same kind of request.
    """

    def __init__(self, name: str, services: Tuple[Service, ...], topics: Tuple[Topic, ...],
                 safe_state: Tuple[Request, ...], evidence: Mapping[Sense, Evidence],
                 gaze_value: Optional[int] = None, has_knowledge_files: bool = False, tells_pressed: bool = True):
        self.name = name
        self.gaze_value = gaze_value
        self.has_knowledge_files = has_knowledge_files
        self.tells_pressed = tells_pressed
        self._evidence = evidence
        self.services = services
        self.topics = topics
        self.safe_state = safe_state
        self._by_request: Dict[type, Service] = {}
        self._index()

    def _index(self) -> None:
        for service in self.services:
            other = self._by_request.setdefault(service.request, service)
            if other is not service:
                raise ValueError("{} and {} are both declared for {}".format(
                    other.name, service.name, service.request.__name__))
        for request in self.safe_state:
            self.service(type(request))

    @property
    def offers(self) -> Tuple[Union[Service, Topic], ...]:
        """All services and topics."""
        return self.services + self.topics

    def service(self, request: type) -> Service:
        """Return the service for a kind of request. Raises LookupError, which names it, if none is declared."""
        try:
            return self._by_request[request]
        except KeyError:
            raise LookupError("no service is declared for the request {}: declare it in behavior_controller.interface"
                              .format(request.__name__)) from None

    def serves(self, request: type) -> bool:
        """Return whether a kind of request is answered, by a service of the robot or from files."""
        return request in self._by_request or self.has_knowledge_files and request is QueryKnowledge

    def resource(self, request: type) -> str:
        """Return the canonical name of the service for a kind of request, or ``FILES``. Raises LookupError as ``service``."""
        if self.has_knowledge_files and request is QueryKnowledge:
            return KNOWLEDGE_FILES
        return self.service(request).name

    def tells(self, sense: Union[Sense, Topic]) -> bool:
        """Return whether the robot has evidence of ``sense``, or publishes that topic."""
        return sense in self.topics if isinstance(sense, Topic) else sense in self._evidence

    def evidence(self, sense: Sense) -> Evidence:
        """Return the evidence of ``sense``. Raises LookupError if this robot has none."""
        try:
            return self._evidence[sense]
        except KeyError:
            raise LookupError("the robot {} does not tell of the visitor's {}".format(self.name, sense.value)) from None

    def used(self, requests: Collection[type],
             senses: Collection[Union[Sense, Topic]]) -> Tuple[Union[Service, Topic], ...]:
        """Return the services and topics that these kinds of requests, senses and topics need, in their order."""
        topics = [sense if isinstance(sense, Topic) else self.evidence(sense).topic
                  for sense in senses if self.tells(sense)]
        return tuple(service for service in self.services if service.request in requests) + tuple(
            topic for topic in self.topics if topic in topics)

    def with_more(self, services: Tuple[Service, ...], topics: Tuple[Topic, ...]) -> "Interface":
        """Return the interface of the same robot with these services and topics too. Raises ValueError."""
        more = copy.copy(self)
        more.services, more.topics = self.services + services, self.topics + topics
        more._by_request = {}
        more._index()
        return more

    def topic(self, name: str) -> Topic:
        """Return the topic of that canonical name. Raises LookupError if none is declared."""
        for topic in self.topics:
            if topic.name == name:
                return topic
        raise LookupError("no topic {} is declared".format(name))
