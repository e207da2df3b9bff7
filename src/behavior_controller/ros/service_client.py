"""The robot's services, actions and commanded topics: a request record goes out as a message, and
comes back as an Answer or a Failure.

Each call under way has its own daemon thread, for a service with one persistent connection. After
an answer it waits for the next call to that service. When its call is dropped (deadline passed,
leaf halted) it is cut: thread and socket are freed at once, a goal is cancelled. So a server that
hangs costs nothing, blocks no later call and does not hold the process. A request is sent once:
only a connection found dead before the sending is opened again.
"""
import contextlib
import io
import struct
import time
from collections import defaultdict
from dataclasses import dataclass
from functools import partial
from typing import Any, Callable, Dict, Iterable, List, Optional, Set, Tuple, Type, Union

import genpy
import rospy

from behavior_controller.bt.engine.clock import Clock, Timer
from behavior_controller.robot.gateway import (
    Call, Cause, Failure, Gateway, NO_SUBSCRIBER, UNSENT, result_of, waited)
from behavior_controller.run.health import Health, slow_after
from behavior_controller.robot.declarations import (Action, Interface, Offer, Publication, Service)
from behavior_controller.robot.requests import Answer, Request
from behavior_controller.ros.action_client import GoalThread, has_subscriber
from behavior_controller.ros.tcpros import CONNECT_LIMIT, Connection, STEP_LIMIT, Trouble
from behavior_controller.ros.master import DIRECTORY, Place
from behavior_controller.ros.request_thread import Job, RequestThread
from behavior_controller.ros.types import TYPES, filled, in_place_of, resolved

LOOKUP_LIMIT = 0.3
"""Seconds that the lookup of a known service at the master may take; then the last address is used.

The safe state has one second, in which the master may freeze. ``Monitor`` looks up restarted
services without haste.
"""

SUBSCRIBER_POLL = 0.05
"""Seconds between two looks for the subscribers of a topic that is published to."""


# ------------------------------------------------------------------------------- finding the server


def open_service(place: Place, connection: Connection, name: str, md5sum: str, seconds: float,
                 **more: str) -> Dict[str, str]:
    """Connect to the server of the service ``name`` (resolved) at ``place``, and return its
    handshake: ``type`` and ``md5sum``.

    ``md5sum`` is the one of the wanted type, ``*`` for any. ``more`` goes into our half of the
    handshake. Raises ``Trouble``: not reachable, type mismatch, or no answer.
    """
    host, port = _address(place.uri)
    header = {"service": name, "md5sum": md5sum, "callerid": rospy.get_name()}
    try:
        answer = connection.open(host, port, dict(header, **more), seconds)
    except Trouble as trouble:
        if trouble.cause is not Cause.NOT_REACHABLE:
            raise
        known = "the master lists it" if place.is_listed else (
            "it was there when the master listed it")
        raise Trouble(trouble.cause, f"{known}, but {trouble}")
    _check_handshake(connection, answer, md5sum)
    return answer


def _address(uri: str) -> Tuple[str, int]:
    """Return host and port of ``rosrpc://host:port``."""
    host, _, port = uri[len(rospy.core.ROSRPC):].rstrip("/").rpartition(":")
    if not (uri.startswith(rospy.core.ROSRPC) and host and port.isdecimal()):
        raise Trouble(Cause.NOT_REACHABLE,
                      f"the master lists it at {uri!r}, which is not an address of a service")
    return host, int(port)


def _check_handshake(connection: Connection, answer: Dict[str, str], md5sum: str) -> None:
    """Raise ``Trouble`` if the server refuses the connection, or serves another type than the
    wanted one."""
    error = answer.get("error", "")
    if not error and md5sum not in ("*", answer.get("md5sum", md5sum)):
        error = f"md5sums do not match: [{md5sum}] vs. [{answer['md5sum']}]"
    if error:
        connection.hang_up()
        mismatch = "md5sum" in error  # rospy and roscpp word it differently, both with this word
        raise Trouble(Cause.TYPE_MISMATCH if mismatch else Cause.NOT_REACHABLE,
                      "the server says: " + error)


# ----------------------------------------------------------------------------- requests and answers


def encode(service: Service, request: Request) -> bytes:
    """Return ``request`` as TCPROS carries it: its length, then its fields. Raises ``Trouble`` if
    it does not fit, and Unsendable."""
    buffer = io.BytesIO()
    filled(TYPES[service]._request_class(), service, request).serialize(buffer)
    return struct.pack("<I", buffer.tell()) + buffer.getvalue()


def receive_response(service: Service, connection: Connection) -> genpy.Message:
    """Read the server's answer: a byte for success of its handler, a length, a message or an error.
    """
    ok, length = struct.unpack("<BI", connection.receive(5))
    body = connection.receive(length)
    if not ok:
        raise Trouble(Cause.HANDLER_EXCEPTION,
                      body.decode("utf-8", "replace") or "its handler failed without a reason")
    try:
        return TYPES[service]._response_class().deserialize(body)
    except (genpy.DeserializationError, struct.error, UnicodeError) as error:
        connection.hang_up()
        raise Trouble(Cause.UNUSABLE_ANSWER, f"not a {service.type}: {error}")


# ------------------------------------------------------------------------------------------ threads


class ServiceThread(RequestThread):
    """A thread with one connection to one service, which ends with it when it is cut."""

    def __init__(self, service: Service):
        self._connection = Connection()
        super().__init__(service)

    def cut(self) -> bool:
        """Free the thread and the socket at once."""
        self._connection.close()
        self.end()
        return False

    def close(self) -> None:
        """Free the socket, which ``cut`` has shut down."""
        self._connection.hang_up()

    def exchange(self, job: Job) -> Union[Answer, Failure]:
        """Ask the server."""
        data = encode(self.service, job.request)
        if not self._connection.is_open:
            place = DIRECTORY.service(self.name, CONNECT_LIMIT, LOOKUP_LIMIT)
            open_service(place, self._connection, self.name, TYPES[self.service]._md5sum,
                         CONNECT_LIMIT, persistent="1")
            self._connection.wait_without_limit()
        self.is_asked = True
        self._connection.send(data)
        return result_of(self.service, receive_response(self.service, self._connection), self.name)


class PublisherThread(RequestThread):
    """A thread that publishes to one topic."""

    _publisher: Any = None

    def _work(self) -> None:
        with contextlib.suppress(Exception):  # the request that meets it reports it
            self._advertise()  # so that subscribers connect before the first message
        super()._work()

    def _advertise(self) -> None:
        if self._publisher is None:
            self._publisher = rospy.Publisher(self.name, TYPES[self.service], queue_size=10)

    def exchange(self, job: Job) -> Answer:
        """Publish, once there is a subscriber."""
        message = filled(TYPES[self.service](), self.service, job.request)
        self._advertise()
        deadline = time.monotonic() + STEP_LIMIT
        if not has_subscriber(self._publisher):
            with contextlib.suppress(Trouble):  # see GoalThread._register_again
                DIRECTORY.register(self._publisher)
        while job.cut.is_set() or not has_subscriber(self._publisher):
            if job.cut.wait(SUBSCRIBER_POLL) or time.monotonic() > deadline:
                raise Trouble(Cause.NOT_ADVERTISED, NO_SUBSCRIBER)
        self._publisher.publish(message)
        return Answer()


THREADS: Dict[type, Type[RequestThread]] = {
    Service: ServiceThread, Action: GoalThread, Publication: PublisherThread}
"""What carries requests, by the kind of declaration."""


def _started(service: Service, role: str = "") -> RequestThread:
    """Return a new thread for requests. Raises RuntimeError if none is left."""
    thread = THREADS[type(service)](service)
    thread.start(role)
    return thread


@dataclass
class _UnderWay:
    """The resources of a call until it ends."""

    thread: RequestThread
    timer: Timer  # until it is slow, then until its deadline
    since: float
    sent_at: float  # by the time of the process


class RosGateway(Gateway):
    """Calls the robot's services. ``start`` and ``Call.drop`` belong to the tick thread, and
    neither waits."""

    def __init__(self, interface: Interface, deadline: Callable[[Service], float], clock: Clock,
                 wake: Callable[[], None], health: Optional[Health] = None,
                 tell: Callable[[str], None] = lambda text: None,
                 substituted: Iterable[Offer] = (),
                 standby: Optional[Dict[Request, RequestThread]] = None):
        """``deadline`` returns the seconds that a service may take; ``wake`` is called for each
        result.

        ``health`` gets reports about the services, and ``tell`` a line about each that another one
        stands in for, but those that are ``substituted`` already. ``standby`` is that of a gateway
        in whose place this one asks for the safe state. Raises RuntimeError if no thread is left.
        """
        self._interface, self.deadline = interface, deadline
        self._clock, self._wake, self._health = clock, wake, health or Health()
        self._spare: Dict[Service, List[RequestThread]] = defaultdict(list)
        self._under_way: Dict[Call, _UnderWay] = {}
        if standby is None:
            standby = {request: _started(interface.service(type(request)), "standby ")
                       for request in interface.safe_state}
        self.standby = standby
        """The threads of the requests for the safe state when no other can be started."""
        self._tell = tell
        self._substituted: Set[Offer] = set(substituted)  # as told

    def start(self, request: Request) -> Call:
        """Send ``request``; the call ends with the answer, with a failure, or at the deadline of
        its service."""
        call = Call(request, self._wake, lambda: self._release(call, is_dropped=True))
        service = self._interface.service(type(request))
        if type(request) is not service.request:
            name = self._interface.name_of(service)
            self._tell_once(service, f"the robot {self._interface.name} has no action "
                                     f"{name}: its {service.kind} is used in its place")
        self._send(call, service)
        return call

    def _tell_once(self, service: Service, text: str) -> None:
        if service not in self._substituted:
            self._substituted.add(service)
            self._tell(text)

    def _send(self, call: Call, service: Service) -> None:
        """Have ``service`` carry out the request of ``call``."""
        request, deadline = call.request, self.deadline(service)
        try:
            thread = self._thread(service, request)
        except RuntimeError as error:
            text = f"no thread to ask with ({error})"
            call.finish(Failure(Cause.NOT_REACHABLE, text, resolved(service)))
            return
        timer = self._clock.call_after(slow_after(request.usual_seconds, deadline),
                                       lambda: self._on_slow(call, deadline), is_foreign=True)
        self._under_way[call] = _UnderWay(
            thread, timer, self._clock.source(), self._clock.process.source())
        thread.carry(
            request,
            lambda result: self._hand_over(self._end, call, result, self._clock.source()),
            partial(self._hand_over, self._report, call))

    def _thread(self, service: Service, request: Request) -> RequestThread:
        """Take a spare thread, start one, or take the one that stands by. Raises RuntimeError if
        none is left."""
        if self._spare[service]:
            return self._spare[service].pop()
        try:
            return _started(service)
        except RuntimeError:
            if request not in self.standby:
                raise
            return self.standby.pop(request)

    def prepare(self, offers: Iterable[Offer]) -> None:
        """Connect to those of these that take longer to connect to than a service."""
        for offer in offers:
            if isinstance(offer, (Action, Publication)) and not self._spare[offer]:
                self._spare[offer].append(_started(offer))

    def _hand_over(self, callback: Callable[..., None], *arguments: Any) -> None:
        """Let the tick thread go on with ``callback``; on the request's thread."""
        self._clock.post(partial(callback, *arguments), is_foreign=True)
        self._wake()

    def _report(self, call: Call, feedback: str) -> None:
        if call in self._under_way:
            call.on_feedback(feedback)

    def cut(self) -> None:
        """Abort every call under way, and cancel its goal. Any thread may call this."""
        for held in list(self._under_way.values()):
            held.thread.cut()

    def close(self) -> None:
        """Drop every call under way and free every thread and connection; the threads that stand by
        are left to another gateway."""
        for call in list(self._under_way):
            self._release(call, is_dropped=True)
        for threads in self._spare.values():
            while threads:
                thread = threads.pop()
                thread.cut()
                thread.end()

    def _end(self, call: Call, result: Union[Answer, Failure], at: float,
             is_dropped: bool = False) -> None:
        """Finish ``call``, which ended ``at`` that time, and report it to the health, unless it has
        ended before."""
        held = self._release(call, is_dropped)
        if held is None or self._has_substituted(call, held.thread.service, result):
            return
        thread, cause = held.thread, result.cause if isinstance(result, Failure) else None
        own = self._interface.service(type(call.request))
        if thread.service is not own and cause not in UNSENT:
            self._tell_once(own, in_place_of(own, thread.service))
        if not thread.is_short:  # its server was not asked
            self._health.ended(thread.name, at - held.since, self.deadline(thread.service),
                               cause is not None, thread.service.kind,
                               call.request.usual_seconds)
        call.finish(result)

    def _has_substituted(self, call: Call, service: Service,
                         result: Union[Answer, Failure]) -> bool:
        """Have the request sent by the substitute of ``service`` if no node offers that, and return
        whether it is."""
        other = self._interface.substitute(service)
        is_offered = not (isinstance(result, Failure) and result.cause is Cause.NOT_ADVERTISED)
        is_own = service is self._interface.service(type(call.request))
        if is_offered or other is None or not is_own:
            return False
        self._send(call, other)
        return True

    def _release(self, call: Call, is_dropped: bool = False) -> Optional[_UnderWay]:
        """Free the resources of ``call`` and return them; None if it has ended already. The thread
        of one that ``is_dropped`` is cut."""
        held = self._under_way.pop(call, None)
        if held is not None:
            held.timer.cancel()
            if not is_dropped or held.thread.cut():
                self._spare[held.thread.service].append(held.thread)
        return held

    def _on_slow(self, call: Call, deadline: float) -> None:
        """Report that ``call`` is slow, and wait for its deadline."""
        held, usual = self._under_way[call], call.request.usual_seconds
        after = slow_after(usual, deadline)
        if after < deadline:
            self._health.slow(held.thread.name, deadline, held.thread.service.kind, usual)
        left = held.timer.due + deadline - after - self._clock.source()
        held.timer = self._clock.call_after(left, lambda: self._expire(call), is_foreign=True)

    def _expire(self, call: Call) -> None:
        """End ``call`` at its deadline. What makes the robot safe has those seconds of the process
        too."""
        held, process = self._under_way[call], self._clock.process
        thread = held.thread
        left = held.sent_at + self.deadline(thread.service) - process.source()
        is_vital = process is not self._clock and call.request in self._interface.safe_state
        if is_vital and left > 0.0:
            held.timer = process.call_after(left, lambda: self._expire(call), is_foreign=True)
            return
        text = waited(self.deadline(thread.service))
        if not thread.is_asked:
            text += ", still connecting: nothing was asked"
        late = Failure(Cause.NO_ANSWER, text, thread.name)
        self._end(call, late, self._clock.source(), is_dropped=True)
