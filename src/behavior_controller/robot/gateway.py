"""How requests go to the robot, and how answers and messages come back: the seam between the leaves
and ROS.

A leaf hands a request record to ``Gateway.start`` and gets a ``Call``, which is finished once with
an ``Answer`` or a ``Failure`` and then wakes the tree. Nothing here waits. ``ros.service_client``
and ``ros.subscriber`` implement it for ROS; ``FakeGateway`` and ``FakeTopics`` are for tests,
rendering and replay.
"""
import enum
from typing import Callable, Dict, Hashable, List, Mapping, Optional, Tuple, Union

from msgspec import Struct

from behavior_controller.thread_check import tick_thread_only
from behavior_controller.robot.declarations import Message, Sample, Service, Topic, Unusable, Value
from behavior_controller.robot.requests import Answer, Exhibit, QueryKnowledge, Request


class Cause(enum.Enum):
    """Why a leaf failed. The value is the word of policy and record."""

    REFUSED = "refused"
    HANDLER_EXCEPTION = "exception"
    NO_ANSWER = "no-answer"
    CONNECTION_LOST = "connection-lost"
    NOT_REACHABLE = "not-reachable"
    NOT_ADVERTISED = "not-advertised"
    TYPE_MISMATCH = "type-mismatch"
    UNUSABLE_ANSWER = "unusable-answer"
    MISSING_DATA = "missing-data"
    CONDITION_FALSE = "condition-false"

    @property
    def text(self) -> str:
        """The words for an operator."""
        return _TEXTS.get(self, self.value.replace("-", " "))


UNCERTAIN = (Cause.NO_ANSWER, Cause.CONNECTION_LOST, Cause.HANDLER_EXCEPTION, Cause.UNUSABLE_ANSWER)
"""The causes of a failure in spite of which the request may have been carried out."""

UNSENT = (Cause.NOT_REACHABLE, Cause.NOT_ADVERTISED, Cause.TYPE_MISMATCH)
"""The causes of a failure of a request that has not reached its server."""

_TEXTS = {Cause.HANDLER_EXCEPTION: "exception in the server", Cause.NO_ANSWER: "no answer in time"}


class Failure(Struct, frozen=True, tag=True, tag_field="_type"):
    """Why a step failed: the cause, a line for people, and the service or topic (empty: neither).

    ``unheard``: why no message of a topic counts that is published all the time, so that the robot
    could not know better; empty: one counts that has just come; None: neither is known.
    """

    cause: Cause
    message: str
    resource: str = ""
    unheard: Optional[str] = None

    @property
    def is_false_condition(self) -> bool:
        """Whether a condition did not hold, which is no fault."""
        return self.cause is Cause.CONDITION_FALSE


NOT_OFFERED = "no node offers this service"
NO_ACTION = "no node offers this action"
NO_SUBSCRIBER = "no node subscribes to this topic"
"""The texts of a failure with the cause ``NOT_ADVERTISED``."""


def waited(seconds: float) -> str:
    """Return the text of a failure with the cause ``NO_ANSWER``, at the deadline of a call."""
    return f"waited {seconds:g} s"


def result_of(service: Service, response: Message, resource: str) -> Union[Answer, Failure]:
    """Return the answer in a response of ``resource``; a failure if it is a refusal, or unusable.
    """
    if service.success is not None:
        field, done, refused = service.success
        outcome = getattr(response, field)
        if outcome == refused:
            return Failure(Cause.REFUSED, f"answered {field} = {outcome!r}", resource)
        if outcome != done:
            text = (f"answered {field} = {outcome!r}: neither {done!r} (done) nor {refused!r} "
                    "(refused)")
            return Failure(Cause.UNUSABLE_ANSWER, text, resource)
    try:
        return service.answer(response)
    except Unusable as unusable:
        return Failure(Cause.UNUSABLE_ANSWER, str(unusable), resource)


class Call:
    """One request under way. Finished exactly once, on the tick thread; later results are dropped.
    """

    @tick_thread_only
    def __init__(self, request: Request, wake: Callable[[], None],
                 abandon: Optional[Callable[[], object]] = None):
        """``wake`` is called when the result has come; ``abandon`` releases the call's resources
        when it is dropped."""
        self.request = request
        self.result: Optional[Union[Answer, Failure]] = None
        self.on_feedback: Callable[[str], None] = lambda text: None
        """Called with what an action reports while the request is under way, in words."""
        self._wake, self._abandon = wake, abandon

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


def since(samples: Tuple[Sample[Value], ...], after: float) -> Tuple[Sample[Value], ...]:
    """Return the messages of ``samples``, oldest first, that arrived later than ``after``."""
    return tuple(sample for sample in samples if sample.arrived > after)


class Gateway:
    """Sends requests to the robot. ``start`` never waits and never raises: a failure finishes the
    call."""

    def start(self, request: Request) -> Call:
        """Send ``request`` and return the call, which ends by its deadline at the latest."""
        raise NotImplementedError

    @property
    def is_busy(self) -> bool:
        """Whether the robot has not yet done what it was asked for."""
        raise NotImplementedError


class FilesGateway(Gateway):
    """Answers ``QueryKnowledge`` at once with the ``places`` of that query, and passes on all other
    requests."""

    def __init__(self, inner: Gateway, places: Mapping[str, Tuple[Exhibit, ...]]):
        self._inner, self._places = inner, places

    def start(self, request: Request) -> Call:
        """Return a call that is already answered, or the robot's call."""
        if not isinstance(request, QueryKnowledge):
            return self._inner.start(request)
        call = Call(request, lambda: None)
        call.finish(Answer(exhibits=self._places[request.what]))
        return call

    @property
    def is_busy(self) -> bool:
        """Whether the robot is."""
        return self._inner.is_busy


class Topics:
    """The messages of each topic that count, and one-shot alarms."""

    def name(self, topic: Topic) -> str:
        """Return the topic's name for people: resolved, if ROS renames it."""
        return topic.name

    def recent(self, topic: Topic[Value]) -> Tuple[Sample[Value], ...]:
        """Return the last events, oldest first, or of a state the newest message; empty before the
        first."""
        raise NotImplementedError

    def newest(self, topic: Topic[Value]) -> Optional[Sample[Value]]:
        """Return the newest message, or None before the first."""
        samples = self.recent(topic)
        return samples[-1] if samples else None

    def wake_when(
            self, key: Hashable, topic: Topic[Value], wanted: Callable[[Value], bool]) -> None:
        """Wake the tree once, at the next message whose value is ``wanted``; a second alarm under
        ``key`` replaces it.

        ``wanted`` runs on the thread that receives messages, possibly thousands of times a second:
        it must be cheap.
        """
        raise NotImplementedError

    def listen(self, topic: Topic, seconds: float, prefers_action: bool = False) -> None:
        """Have the robot listen for ``seconds`` from now; 0: stop. What it hears arrives as
        messages of ``topic``.

        Only a robot that offers an action instead of the topic needs this, or if the mission
        ``prefers_action`` where the robot offers both.
        """

    def is_hearing(self, topic: Topic) -> bool:
        """Return whether a message may still come that began within the time of ``listen``; the
        tree is woken when that is over."""
        return False

    def ignore(self, topic: Topic[Value], reason: str, missed: Callable[[Value], bool]) -> None:
        """Report from now on that messages that are ``missed`` are ignored, and why; no ``reason``:
        none is.

        This is only about what an operator reads: which messages count, the leaves decide.
        """


# ---------------------------------------------------------------------------------------- the fakes


class FakeGateway(Gateway):
    """Stores its ``requests``; a test finishes the ``calls``, or gives ``reply`` to finish them at
    once.

    ``dropped`` are the requests whose results are no longer awaited.
    """

    def __init__(self, wake: Callable[[], None] = lambda: None,
                 reply: Optional[Callable[[Request], Optional[Union[Answer, Failure]]]] = None):
        self.requests: List[Request] = []
        self.calls: List[Call] = []
        self.dropped: List[Request] = []
        self._wake, self._reply = wake, reply

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
        self._now, self._wake = now, wake
        self._recent: Dict[Topic, Tuple[Sample, ...]] = {}
        self.ignoring: Dict[Topic, str] = {}
        """Why the messages of a topic are ignored."""
        # of topics of any kind
        self._alarms: Dict[Hashable, Tuple[Topic, Callable[..., bool]]] = {}  # type: ignore

    def publish(self, topic: Topic[Value], value: Value) -> None:
        """Let ``value`` arrive on ``topic`` now."""
        self._recent[topic] = topic.kept(self._recent.get(topic, ()), Sample(value, self._now()))
        for key, (alarmed, wanted) in list(self._alarms.items()):
            if alarmed is topic and wanted(value):
                del self._alarms[key]
                self._wake()

    def recent(self, topic: Topic[Value]) -> Tuple[Sample[Value], ...]:
        """Return the messages that count."""
        return self._recent.get(topic, ())

    def ignore(self, topic: Topic[Value], reason: str, missed: Callable[[Value], bool]) -> None:
        """Store the reason."""
        self.ignoring[topic] = reason

    def wake_when(
            self, key: Hashable, topic: Topic[Value], wanted: Callable[[Value], bool]) -> None:
        """Set the alarm ``key``."""
        self._alarms[key] = (topic, wanted)
