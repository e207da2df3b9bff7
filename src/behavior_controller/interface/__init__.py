"""What a robot offers, one declaration for each service and topic.

The ROS edge, the start-up check, the monitoring, the configuration's deadlines and the simulated robot take from these
declarations all that they need to know of a service or topic.
"""
import copy
import enum
from dataclasses import dataclass
from typing import Any, Callable, Collection, Dict, Generic, Mapping, NamedTuple, Optional, Tuple, Type, TypeVar, Union

from behavior_controller.interface.records import Answer, QueryKnowledge, Request


Message = Any  # type: ignore
"""A message or response as ROS makes it; these classes are generated and have no types."""

Asked = TypeVar("Asked", bound=Request)
Value = TypeVar("Value")
Plain = Union[bool, int, float, str]

KNOWLEDGE_FILES = "the knowledge files"
"""What answers ``QueryKnowledge`` where the robot has no such service."""


class Unusable(ValueError):
    """A positive answer has content that cannot be used; the text says which."""


class Success(NamedTuple):
    """The response's field that tells the outcome, and its values for done and refused. Any other is unusable."""

    field: str
    done: Plain
    refused: Plain


def _nothing(response: Message) -> Answer:
    return Answer()


@dataclass(frozen=True, eq=False)
class Service(Generic[Asked]):
    """A service of the robot.

    ``request`` is the kind of record that it carries out, ``fields`` gives the values of the srv request in order;
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

    @property
    def deadline_key(self) -> str:
        """The configuration's key for the deadline."""
        return self.node + "Deadline"


@dataclass(frozen=True, eq=False)
class Action(Generic[Value]):
    """An action that a robot may offer in place of a topic, one goal for one message.

    ``goal`` gives the values of the goal's fields for the seconds that it may take; ``read`` turns a result into the
    topic's plain data, None for a result that says nothing. ``type`` is the ``package/Type`` of the action file.
    """

    name: str
    type: str
    goal: Callable[[float], Tuple[object, ...]]
    read: Callable[[Message], Optional[Value]]


@dataclass(frozen=True, eq=False)
class Topic(Generic[Value]):
    """A topic of the robot. ``read`` turns a message into plain data of the kind ``value``.

    ``is_continuous``: it is published all the time, so that silence means something and an old message counts as
    absent. ``action``: what a robot may offer instead. The other fields: see ``Service``.
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
    """What a mission can learn of its visitor while it runs.

    ``awaiting`` says in people's words what a robot does that waits for it; ``given`` and ``absent`` are what it means
    for a visit that it was learned, or not: marks of ``events.Told``.
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
    """What tells a robot of its visitor: a message of ``topic`` for which ``is_given`` holds.

    ``is_given`` takes the message's value and the value of /overtAttention/mode that means mutual gaze. ``wait`` is how
    many seconds a condition waits for the evidence, infinity for no limit; None: as long as ``conditionWait`` says.
    ``is_given_up``: the robot looks no longer, so that a condition waits no longer. ``mode`` is the mode of attention
    without which the robot does not look; empty: any.
    """

    topic: Topic[Value]
    is_given: Callable[[Value, int], bool] = lambda value, gaze_value: True
    wait: Optional[float] = None
    is_given_up: Callable[[Value], bool] = lambda value: False
    mode: str = ""


class Interface:
    """All services and topics of one robot, what they tell of a visitor, and the requests that make the robot safe.

    ``name`` tells it from others in the configuration and in a record. ``gaze_value`` is the value of
    /overtAttention/mode that means mutual gaze; None: the configuration says it. ``has_knowledge_files``: files answer
    ``QueryKnowledge`` and hold the language and the phrases. ``tells_pressed``: the tablet's answer says which button
    was pressed. Raises ValueError where two services carry out the same kind of request.
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
        """Return what answers a kind of request: the service's canonical name. Raises LookupError as ``service``."""
        if self.has_knowledge_files and request is QueryKnowledge:
            return KNOWLEDGE_FILES
        return self.service(request).name

    def tells(self, sense: Union[Sense, Topic]) -> bool:
        """Return whether the robot tells of ``sense``, or publishes that topic."""
        return sense in self.topics if isinstance(sense, Topic) else sense in self._evidence

    def evidence(self, sense: Sense) -> Evidence:
        """Return what tells of ``sense``. Raises LookupError if this robot cannot tell."""
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
