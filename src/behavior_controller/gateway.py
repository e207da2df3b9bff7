"""What leaves ask of the robot, as plain records, and how the answers come back.

A leaf hands a request record to ``Gateway.start`` and gets a ``Call``, which is finished once with an ``Answer`` or a
``Failure`` and then wakes the tree. Nothing here waits. ``ros.services`` and ``ros.topics`` are the real thing;
``FakeGateway`` and ``FakeTopics`` are for tests, rendering and replay.
"""
import enum
from typing import Any, Callable, ClassVar, Dict, List, NamedTuple, Optional, Tuple, Union

from dataclasses import dataclass


class Cause(enum.Enum):
    """Why a leaf failed; the values are what an operator reads and what the recovery policy is written in."""

    REFUSED = "refused"
    HANDLER_EXCEPTION = "exception in the server"
    NO_ANSWER = "no answer in time"
    CONNECTION_LOST = "connection lost"
    NOT_REACHABLE = "not reachable"
    NOT_ADVERTISED = "not advertised"
    TYPE_MISMATCH = "type mismatch"
    UNUSABLE_ANSWER = "unusable answer"
    MISSING_DATA = "missing data"
    CONDITION_FALSE = "condition false"


class Failure(NamedTuple):
    """Why a step was not done: the cause, a line for people, and the service or topic (empty: neither)."""

    cause: Cause
    message: str
    resource: str = ""


class Location(NamedTuple):
    """A place on the floor: metres and degrees in the map frame."""

    x: float
    y: float
    theta_deg: float


class Point(NamedTuple):
    """A point in space, metres in the map frame."""

    x: float
    y: float
    z: float


class Exhibit(NamedTuple):
    """What the knowledge base knows of one place (D5.4.3 section 3.2.5)."""

    name: str
    description1: str
    description2: str
    location: Location
    gesture: Point


# ------------------------------------------------------------------------------------------------ requests (table 3)


@dataclass(frozen=True)
class SetAnimation:
    """Switch lifelike movement: ``enabled`` or ``disabled``."""

    service: ClassVar[str] = "/animateBehaviour/set_activation"
    state: str


@dataclass(frozen=True)
class PerformGesture:
    """``iconic`` or ``deictic`` gesture number ``id``; ``target`` matters to deictic ones only."""

    service: ClassVar[str] = "/gestureExecution/perform_gesture"
    type: str
    id: int
    duration_ms: int
    target: Point = Point(0.0, 0.0, 0.0)
    bow_nod_angle_deg: int = 0


@dataclass(frozen=True)
class QueryKnowledge:
    """Ask for ``exhibits`` (all, in tour order), ``entrance`` or ``home`` (one)."""

    service: ClassVar[str] = "/knowledgeBase/query"
    what: str


@dataclass(frozen=True)
class SetAttention:
    """``disabled``, ``social``, ``scanning``, ``seeking`` or ``location`` (the only one that uses ``target``)."""

    service: ClassVar[str] = "/overtAttention/set_mode"
    state: str
    target: Point = Point(0.0, 0.0, 0.0)


@dataclass(frozen=True)
class GoTo:
    """Drive to ``goal``."""

    service: ClassVar[str] = "/robotNavigation/set_goal"
    goal: Location


@dataclass(frozen=True)
class Prompt:
    """Show ``options`` on the tablet and wait for one to be pressed."""

    service: ClassVar[str] = "/tabletEvent/prompt_and_get_response"
    options: Tuple[str, ...]


@dataclass(frozen=True)
class Say:
    """Speak ``text``; answered when it has been spoken."""

    service: ClassVar[str] = "/textToSpeech/say_text"
    text: str


Request = Union[SetAnimation, PerformGesture, QueryKnowledge, SetAttention, GoTo, Prompt, Say]
REQUESTS = (SetAnimation, PerformGesture, QueryKnowledge, SetAttention, GoTo, Prompt, Say)
SERVICES = tuple(request.service for request in REQUESTS)
SAFE_STATE: Tuple[Request, ...] = (SetAttention("disabled"), SetAnimation("disabled"))
"""Requests that leave the robot calm; a navigation goal is in flight only while Navigate runs, which is halted first."""


class Answer(NamedTuple):
    """A server's usable, positive answer. ``response`` is the tablet's; ``exhibits`` the knowledge base's."""

    response: str = ""
    exhibits: Tuple[Exhibit, ...] = ()


class Call:
    """One request under way. Finished exactly once, from any thread; later results are dropped."""

    def __init__(self, request: Request, wake: Callable[[], None], abandon: Optional[Callable[[], None]] = None):
        """``wake`` is called when the result is there; ``abandon`` gives back what the call holds when it is dropped."""
        self.request = request
        self.result: Optional[Union[Answer, Failure]] = None
        self._wake = wake
        self._abandon = abandon

    def finish(self, result: Union[Answer, Failure]) -> None:
        """Store the first result and wake the tree."""
        if self.result is None:
            self.result = result
            self._wake()

    def drop(self) -> None:
        """Nobody waits for the result any more (the leaf was halted, or the deadline has passed)."""
        if self._abandon is not None:
            abandon, self._abandon = self._abandon, None
            abandon()


# ---------------------------------------------------------------------------------------------------- topics (table 2)


class Faces(NamedTuple):
    """One message of face detection: a label for each face, and whether that face looks at the robot."""

    labels: Tuple[str, ...]
    mutual_gaze: Tuple[bool, ...]


class AttentionStatus(NamedTuple):
    """One message of overt attention: the mode, and the status of ``seeking``."""

    state: str
    value: int


class Topic(enum.Enum):
    """The topics that the mission listens to, by canonical name."""

    FACES = "/faceDetection/data"  # values: Faces
    ATTENTION = "/overtAttention/mode"  # values: AttentionStatus
    SPEECH = "/speechEvent/text"  # values: str


class Sample(NamedTuple):
    """The newest message of a topic, as plain data, and when it arrived (monotonic seconds)."""

    value: Any
    arrived: float


class Gateway:
    """Carries requests to the robot. ``start`` never waits and never raises: what goes wrong finishes the call."""

    def start(self, request: Request) -> Call:
        """Send ``request`` and return the call, which ends by its deadline at the latest."""
        raise NotImplementedError


class Topics:
    """The newest message of each topic, and one-shot alarms."""

    def newest(self, topic: Topic) -> Optional[Sample]:
        """Return the newest message, or None before the first."""
        raise NotImplementedError

    def wake_when(self, key: Any, topic: Topic, wanted: Callable[[Any], bool]) -> None:
        """Wake the tree once, at the next message whose value is ``wanted``; a second alarm under ``key`` replaces it.

        ``wanted`` runs on the thread that receives messages, possibly thousands of times a second: it must be cheap.
        """
        raise NotImplementedError


# ------------------------------------------------------------------------------------------------------------ the fakes


class FakeGateway(Gateway):
    """Remembers what it was asked, in ``requests``; a test finishes the ``calls``, or gives ``reply`` to do it at once."""

    def __init__(self, wake: Callable[[], None] = lambda: None,
                 reply: Optional[Callable[[Request], Optional[Union[Answer, Failure]]]] = None):
        self.requests: List[Request] = []
        self.calls: List[Call] = []
        self._wake = wake
        self._reply = reply

    def start(self, request: Request) -> Call:
        """Remember the request; finish the call if ``reply`` has a result for it."""
        call = Call(request, self._wake)
        self.requests.append(request)
        self.calls.append(call)
        result = self._reply(request) if self._reply else None
        if result is not None:
            call.finish(result)
        return call


class FakeTopics(Topics):
    """Topics whose messages a test writes with ``publish``."""

    def __init__(self, now: Callable[[], float], wake: Callable[[], None] = lambda: None):
        self._now = now
        self._wake = wake
        self._newest: Dict[Topic, Sample] = {}
        self._alarms: Dict[Any, Tuple[Topic, Callable[[Any], bool]]] = {}

    def publish(self, topic: Topic, value: Any) -> None:
        """Let ``value`` arrive on ``topic`` now."""
        self._newest[topic] = Sample(value, self._now())
        for key, (alarmed, wanted) in list(self._alarms.items()):
            if alarmed is topic and wanted(value):
                del self._alarms[key]
                self._wake()

    def newest(self, topic: Topic) -> Optional[Sample]:
        """Return the newest message, or None before the first."""
        return self._newest.get(topic)

    def wake_when(self, key: Any, topic: Topic, wanted: Callable[[Any], bool]) -> None:
        """Set the alarm ``key``."""
        self._alarms[key] = (topic, wanted)
