"""How requests go to the robot, and how answers and messages come back: the seam between the leaves and ROS.

A leaf hands a request record to ``Gateway.start`` and gets a ``Call``, which is finished once with an ``Answer`` or a
``Failure`` and then wakes the tree. Nothing here waits. ``ros.services`` and ``ros.topics`` implement it for ROS;
``FakeGateway`` and ``FakeTopics`` are for tests, rendering and replay.
"""
import enum
from dataclasses import dataclass
from typing import Callable, Dict, Generic, Hashable, List, Mapping, NamedTuple, Optional, Tuple, Union

from behavior_controller.bt.ownership import tick_thread_only
from behavior_controller.interface import Topic, Value
from behavior_controller.interface.records import Answer, Exhibit, QueryKnowledge, Request


class Cause(enum.Enum):
    """Why a leaf failed. The value is the word of policy and record, ``text`` is what an operator reads."""

    text: str

    REFUSED = "refused"
    HANDLER_EXCEPTION = "exception", "exception in the server"
    NO_ANSWER = "no-answer", "no answer in time"
    CONNECTION_LOST = "connection-lost"
    NOT_REACHABLE = "not-reachable"
    NOT_ADVERTISED = "not-advertised"
    TYPE_MISMATCH = "type-mismatch"
    UNUSABLE_ANSWER = "unusable-answer"
    MISSING_DATA = "missing-data"
    CONDITION_FALSE = "condition-false"

    def __new__(cls, word: str, text: str = "") -> "Cause":
        """Make the cause called ``word``; the default of ``text`` is the word."""
        cause = object.__new__(cls)
        cause._value_ = word
        cause.text = text or word.replace("-", " ")
        return cause


class Failure(NamedTuple):
    """Why a step failed: the cause, a line for people, and the service or topic (empty: neither)."""

    cause: Cause
    message: str
    resource: str = ""


class Call:
    """One request under way. Finished exactly once, on the tick thread; later results are dropped."""

    @tick_thread_only
    def __init__(self, request: Request, wake: Callable[[], None], abandon: Optional[Callable[[], object]] = None):
        """``wake`` is called when the result has come; ``abandon`` releases the call's resources when it is dropped."""
        self.request = request
        self.result: Optional[Union[Answer, Failure]] = None
        self._wake = wake
        self._abandon = abandon

    @tick_thread_only
    def finish(self, result: Union[Answer, Failure]) -> None:
        """Store the first result and wake the tree."""
        if self.result is None:
            self.result = result
            self._wake()

    @tick_thread_only
    def drop(self) -> None:
        """Stop waiting for the result (the leaf was halted, or the deadline has passed)."""
        if self._abandon is not None:
            abandon, self._abandon = self._abandon, None
            abandon()


@dataclass(frozen=True)
class Sample(Generic[Value]):
    """The newest message of a topic, as plain data, and when it arrived (monotonic seconds)."""

    value: Value
    arrived: float


class Gateway:
    """Sends requests to the robot. ``start`` never waits and never raises: a failure finishes the call."""

    def start(self, request: Request) -> Call:
        """Send ``request`` and return the call, which ends by its deadline at the latest."""
        raise NotImplementedError


class FilesGateway(Gateway):
    """Answers ``QueryKnowledge`` at once with the ``places`` of that query, and passes on all other requests."""

    def __init__(self, inner: Gateway, places: Mapping[str, Tuple[Exhibit, ...]]):
        self._inner = inner
        self._places = places

    def start(self, request: Request) -> Call:
        """Return a call that is already answered, or the robot's call."""
        if not isinstance(request, QueryKnowledge):
            return self._inner.start(request)
        call = Call(request, lambda: None)
        call.finish(Answer(exhibits=self._places[request.what]))
        return call


class Topics:
    """The newest message of each topic, and one-shot alarms."""

    def newest(self, topic: Topic[Value]) -> Optional[Sample[Value]]:
        """Return the newest message, or None before the first."""
        raise NotImplementedError

    def wake_when(self, key: Hashable, topic: Topic[Value], wanted: Callable[[Value], bool]) -> None:
        """Wake the tree once, at the next message whose value is ``wanted``; a second alarm under ``key`` replaces it.

        ``wanted`` runs on the thread that receives messages, possibly thousands of times a second: it must be cheap.
        """
        raise NotImplementedError

    def listen(self, topic: Topic, seconds: float) -> None:
        """Have the robot listen for ``seconds`` from now; 0: stop. What it hears arrives as messages of ``topic``.

        Only a robot that offers an action instead of the topic needs this.
        """


# ------------------------------------------------------------------------------------------------------------ the fakes


class FakeGateway(Gateway):
    """Stores its ``requests``; a test finishes the ``calls``, or gives ``reply`` to finish them at once.

    ``dropped`` are the requests whose results are no longer awaited.
    """

    def __init__(self, wake: Callable[[], None] = lambda: None,
                 reply: Optional[Callable[[Request], Optional[Union[Answer, Failure]]]] = None):
        self.requests: List[Request] = []
        self.calls: List[Call] = []
        self.dropped: List[Request] = []
        self._wake = wake
        self._reply = reply

    def start(self, request: Request) -> Call:
        """Store the request; finish the call if ``reply`` has a result for it."""
        call = Call(request, self._wake, lambda: self.dropped.append(request))
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
        self._alarms: Dict[Hashable, Tuple[Topic, Callable[..., bool]]] = {}  # type: ignore  # of topics of any kind

    def publish(self, topic: Topic[Value], value: Value) -> None:
        """Let ``value`` arrive on ``topic`` now."""
        self._newest[topic] = Sample(value, self._now())
        for key, (alarmed, wanted) in list(self._alarms.items()):
            if alarmed is topic and wanted(value):
                del self._alarms[key]
                self._wake()

    def newest(self, topic: Topic[Value]) -> Optional[Sample[Value]]:
        """Return the newest message, or None before the first."""
        return self._newest.get(topic)

    def wake_when(self, key: Hashable, topic: Topic[Value], wanted: Callable[[Value], bool]) -> None:
        """Set the alarm ``key``."""
        self._alarms[key] = (topic, wanted)
