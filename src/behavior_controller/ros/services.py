"""The robot's services: a request record goes out as a srv message, and comes back as an Answer or a Failure.

Each call under way has its own daemon thread with one persistent connection, a ``ServiceThread``. After an answer
it waits for the next call to that service. When its call is dropped (deadline passed, leaf halted) it is cut: thread
and socket are freed at once. So a server that hangs costs nothing, blocks no later call and does not hold the process.
A request is sent once: only a connection found dead before the sending is opened again.
"""
import io
import queue
import struct
import threading
import time
from typing import Callable, Dict, List, NamedTuple, Optional, Tuple, Union

import genpy
import rospy

from behavior_controller.bt.engine.clock import Clock, Timer
from behavior_controller.gateway import Call, Cause, Failure, Gateway
from behavior_controller.health import SLOW_SHARE, Health
from behavior_controller.interface import Interface, Service, Unusable
from behavior_controller.interface.records import Answer, Request
from behavior_controller.ros.connection import CONNECT_LIMIT, Connection, Trouble
from behavior_controller.ros.directory import DIRECTORY, Place
from behavior_controller.ros.types import TYPES

HURRY = 0.3
"""Seconds that the lookup of a known service at the master may take; then the last address is used.

The safe state has one second, in which the master may freeze. ``Monitor`` looks up restarted services without haste.
"""


# ------------------------------------------------------------------------------------------------- finding the server


def open_service(connection: Connection, name: str, md5sum: str, seconds: float, **more: str) -> Dict[str, str]:
    """Connect to the server of the service ``name`` (resolved) and return its handshake: ``type`` and ``md5sum``.

    ``md5sum`` is the one of the wanted type, ``*`` for any. ``more`` goes into our half of the handshake. Raises
    ``Trouble``: not advertised, not reachable, type mismatch, or no answer.
    """
    return open_service_at(DIRECTORY.service(name, seconds), connection, name, md5sum, seconds, **more)


def open_service_at(place: Place, connection: Connection, name: str, md5sum: str, seconds: float,
                    **more: str) -> Dict[str, str]:
    """Do the same with a server whose address is known."""
    host, port = _address(place.uri)
    header = {"service": name, "md5sum": md5sum, "callerid": rospy.get_name()}
    header.update(more)
    try:
        answer = connection.open(host, port, header, seconds)
    except Trouble as trouble:
        if trouble.cause is not Cause.NOT_REACHABLE:
            raise
        raise Trouble(trouble.cause, "{}, but {}".format(
            "the master lists it" if place.is_listed else "it was there when the master listed it", trouble))
    _check_handshake(connection, answer, md5sum)
    return answer


def _address(uri: str) -> Tuple[str, int]:
    """Return host and port of ``rosrpc://host:port``."""
    host, _, port = uri[len(rospy.core.ROSRPC):].rstrip("/").rpartition(":")
    if not (uri.startswith(rospy.core.ROSRPC) and host and port.isdigit()):
        raise Trouble(Cause.NOT_REACHABLE, "the master lists it at {!r}, which is not an address of a service".format(uri))
    return host, int(port)


def _check_handshake(connection: Connection, answer: Dict[str, str], md5sum: str) -> None:
    """Raise ``Trouble`` if the server refuses the connection, or serves another type than the wanted one."""
    error = answer.get("error", "")
    if not error and md5sum not in ("*", answer.get("md5sum", md5sum)):
        error = "md5sums do not match: [{}] vs. [{}]".format(md5sum, answer["md5sum"])
    if error:
        connection.hang_up()
        mismatch = "md5sum" in error  # rospy and roscpp word it differently, both with this word
        raise Trouble(Cause.TYPE_MISMATCH if mismatch else Cause.NOT_REACHABLE, "the server says: " + error)


# ------------------------------------------------------------------------------------------------- requests and answers


def encode(service: Service, request: Request) -> bytes:
    """Return ``request`` as TCPROS carries it: its length, then its fields. Raises ``Trouble`` if it does not fit."""
    buffer = io.BytesIO()
    try:
        TYPES[service]._request_class(*service.fields(request)).serialize(buffer)
    except (genpy.SerializationError, struct.error, UnicodeError, TypeError) as error:
        raise Trouble(Cause.TYPE_MISMATCH, "{} cannot be sent as {}: {}".format(request, service.type, error))
    return struct.pack("<I", buffer.tell()) + buffer.getvalue()


def receive_response(service: Service, connection: Connection) -> genpy.Message:
    """Read the server's answer: a byte for success of its handler, a length, a message or an error."""
    ok, length = struct.unpack("<BI", connection.receive(5))
    body = connection.receive(length)
    if not ok:
        raise Trouble(Cause.HANDLER_EXCEPTION, body.decode("utf-8", "replace") or "its handler failed without a reason")
    try:
        return TYPES[service]._response_class().deserialize(body)
    except (genpy.DeserializationError, struct.error, UnicodeError) as error:
        connection.hang_up()
        raise Trouble(Cause.UNUSABLE_ANSWER, "not a {}: {}".format(service.type, error))


def read_answer(service: Service, response: genpy.Message) -> Answer:
    """Return the answer in a response; raises ``Trouble`` if it is a refusal, or unusable."""
    field, done, refused = service.success
    success = getattr(response, field)
    if success == refused:
        raise Trouble(Cause.REFUSED, "answered {} = {!r}".format(field, success))
    if success != done:
        raise Trouble(Cause.UNUSABLE_ANSWER, "answered {} = {!r}: neither {!r} (done) nor {!r} (refused)".format(
            field, success, done, refused))
    try:
        return service.answer(response)
    except Unusable as unusable:
        raise Trouble(Cause.UNUSABLE_ANSWER, str(unusable))


# -------------------------------------------------------------------------------------------------------------- threads


class ServiceThread:
    """A daemon thread with one connection to one service, which carries one request at a time until it is cut."""

    def __init__(self, name: str, service: Service):
        """``name`` is the resolved name of the service."""
        self._name = name
        self._service = service
        self._connection = Connection()
        self._jobs: "queue.SimpleQueue[Optional[Tuple[Request, Callable]]]" = queue.SimpleQueue()
        self.is_asked = False
        """Whether the request under way may have reached the server."""
        threading.Thread(target=self._work, name="service " + name, daemon=True).start()

    def carry(self, request: Request, done: Callable[[Union[Answer, Failure], float], None]) -> None:
        """Send ``request``, and call ``done`` with the result and its time (monotonic), on this thread."""
        self.is_asked = False
        self._jobs.put((request, done))

    def cut(self) -> None:
        """Abort the request under way; the thread and the socket are freed at once. Any thread may call it."""
        self._connection.close()
        self._jobs.put(None)

    def _work(self) -> None:
        job = self._jobs.get()
        while job is not None:
            request, done = job
            result = self._ask(request)
            done(result, time.monotonic())
            job = self._jobs.get()
        self._connection.hang_up()

    def _ask(self, request: Request) -> Union[Answer, Failure]:
        """Return the answer, or why there is none. An optional service that no node offers counts as done."""
        try:
            data = encode(self._service, request)
            self._connect()
            self.is_asked = True
            self._connection.send(data)
            return read_answer(self._service, receive_response(self._service, self._connection))
        except Trouble as trouble:
            service = self._service
            if trouble.cause is Cause.NOT_ADVERTISED and service.is_optional and not service.fails_without:
                return Answer()
            return Failure(trouble.cause, str(trouble), self._name)

    def _connect(self) -> None:
        """Make sure that the connection is open before anything is sent."""
        if not self._connection.is_open:
            open_service_at(DIRECTORY.service(self._name, CONNECT_LIMIT, HURRY), self._connection, self._name,
                            TYPES[self._service]._md5sum, CONNECT_LIMIT, persistent="1")
            self._connection.wait_without_limit()


class _UnderWay(NamedTuple):
    """The resources of a call until it ends."""

    thread: ServiceThread
    timers: Tuple[Timer, ...]
    since: float

    def end(self) -> None:
        """Cancel the timers."""
        for timer in self.timers:
            timer.cancel()


class RosGateway(Gateway):
    """Calls the robot's services. ``start`` and ``Call.drop`` belong to the tick thread, and neither waits."""

    def __init__(self, interface: Interface, deadline: Callable[[Service], float], clock: Clock,
                 wake: Callable[[], None], health: Optional[Health] = None):
        """``deadline`` returns the seconds that a service may take; ``wake`` is called for each result.

        ``health`` gets reports about the services.
        """
        self.deadline = deadline
        self._interface = interface
        self._health = health or Health()
        self._clock = clock
        self._wake = wake
        self._names = {service: rospy.resolve_name(service.name) for service in interface.services}
        self._spare: Dict[Service, List[ServiceThread]] = {service: [] for service in interface.services}
        self._under_way: Dict[Call, _UnderWay] = {}

    def start(self, request: Request) -> Call:
        """Send ``request``; the call ends with the answer, with a failure, or at the deadline of its service."""
        service = self._interface.service(type(request))
        name, deadline = self._names[service], self.deadline(service)
        call = Call(request, self._wake, lambda: self._give_up(call))
        try:
            thread = self._spare[service].pop() if self._spare[service] else ServiceThread(name, service)
        except RuntimeError as error:
            call.finish(Failure(Cause.NOT_REACHABLE, "no thread to ask with ({})".format(error), name))
            return call
        timers = (self._clock.call_after(deadline, lambda: self._expire(call)),
                  self._clock.call_after(deadline * SLOW_SHARE, lambda: self._health.slow(name, deadline)))
        self._under_way[call] = _UnderWay(thread, timers, time.monotonic())
        thread.carry(request, lambda result, at: self._hand_over(call, result, at))
        return call

    def _hand_over(self, call: Call, result: Union[Answer, Failure], at: float) -> None:
        """Let the tick thread end ``call``; on the service's thread."""
        self._clock.post(lambda: self._end(call, result, at))
        self._wake()

    def close(self) -> None:
        """Drop every call under way and free every thread and connection."""
        for call in list(self._under_way):
            self._give_up(call)
        for threads in self._spare.values():
            while threads:
                threads.pop().cut()

    def _end(self, call: Call, result: Union[Answer, Failure], at: float) -> None:
        """Finish ``call``, which was answered ``at`` that time, unless it was dropped meanwhile."""
        held = self._under_way.pop(call, None)
        if held is not None:
            held.end()
            self._spare[self._interface.service(type(call.request))].append(held.thread)
            self._finish(call, result, at - held.since)

    def _finish(self, call: Call, result: Union[Answer, Failure], seconds: float) -> None:
        """Finish ``call``, which took that many seconds, and report it to the health."""
        service = self._interface.service(type(call.request))
        self._health.ended(self._names[service], seconds, self.deadline(service), isinstance(result, Failure))
        call.finish(result)

    def _give_up(self, call: Call) -> Optional[_UnderWay]:
        """Cut the thread of ``call`` and return its resources; None if the call has ended already."""
        held = self._under_way.pop(call, None)
        if held is None:
            return None
        held.end()
        held.thread.cut()
        return held

    def _expire(self, call: Call) -> None:
        """End ``call`` at its deadline."""
        held = self._give_up(call)
        if held is not None:
            service = self._interface.service(type(call.request))
            where = "" if held.thread.is_asked else ", still connecting: nothing was asked"
            self._finish(call, Failure(Cause.NO_ANSWER, "waited {:g} s{}".format(self.deadline(service), where),
                                       self._names[service]), time.monotonic() - held.since)
