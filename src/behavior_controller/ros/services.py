"""The robot's seven services: a request record goes out as a srv message, and comes back as an Answer or a Failure.

Each call under way has a line of its own: a daemon thread with one persistent connection. A line whose call was
answered waits for the next call to that service; a line whose call is given up (deadline passed, leaf halted) is cut,
which gives its thread and its socket back at once. So a server that hangs costs nothing, blocks no later call and does
not hold the process. A request is sent once: only a connection found dead before the sending is made anew.
"""
import io
import math
import queue
import struct
import threading
import time
from typing import Any, Callable, Dict, List, NamedTuple, Optional, Tuple, Union

import genpy
import rospy
from cssr_system.srv import (animateBehaviorService, gestureExecutionService, knowledgeBaseService,
                             overtAttentionService, robotNavigationService, textService)

from behavior_controller.bt.engine.clock import Clock, Timer
from behavior_controller.gateway import (Answer, Call, Cause, Exhibit, Failure, Gateway, GoTo, Location, PerformGesture,
                                         Point, Prompt, QueryKnowledge, Request, Say, SetAnimation, SetAttention)
from behavior_controller.health import SLOW_SHARE, Health
from behavior_controller.ros.connection import CONNECT_LIMIT, Connection, Trouble
from behavior_controller.ros.directory import DIRECTORY, Place


class Route(NamedTuple):
    """How a kind of request travels: the srv type, its request fields in order, and what its success field means."""

    type: Any
    fields: Callable[[Any], tuple]
    success: str
    done: Any
    refused: Any


ROUTES: Dict[type, Route] = {
    SetAnimation: Route(animateBehaviorService, lambda r: (r.state,), "success", "1", "0"),
    PerformGesture: Route(gestureExecutionService,
                          lambda r: (r.type, r.id, r.duration_ms, r.bow_nod_angle_deg) + tuple(r.target),
                          "gesture_success", 1, 0),
    QueryKnowledge: Route(knowledgeBaseService, lambda r: (r.what,), "success", True, False),
    SetAttention: Route(overtAttentionService, lambda r: (r.state,) + tuple(r.target), "mode_set_success", 1, 0),
    GoTo: Route(robotNavigationService, lambda r: tuple(r.goal), "navigation_goal_success", 1, 0),
    Prompt: Route(textService, lambda r: ("|".join(r.options),), "success", True, False),
    Say: Route(textService, lambda r: (r.text,), "success", True, False),
}


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
        raise Trouble(Cause.NOT_REACHABLE, "the master lists it at {!r}, which is no address of a service".format(uri))
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


def encode(route: Route, request: Request) -> bytes:
    """Return ``request`` as TCPROS carries it: its length, then its fields. Raises ``Trouble`` if it does not fit."""
    buffer = io.BytesIO()
    try:
        route.type._request_class(*route.fields(request)).serialize(buffer)
    except (genpy.SerializationError, struct.error, UnicodeError, TypeError) as error:
        raise Trouble(Cause.TYPE_MISMATCH, "{} cannot be sent as {}: {}".format(request, route.type._type, error))
    return struct.pack("<I", buffer.tell()) + buffer.getvalue()


def receive_response(route: Route, connection: Connection) -> genpy.Message:
    """Read the server's answer: a byte that tells whether its handler ran through, a length, a message or an error."""
    ok, length = struct.unpack("<BI", connection.receive(5))
    body = connection.receive(length)
    if not ok:
        raise Trouble(Cause.HANDLER_EXCEPTION, body.decode("utf-8", "replace") or "its handler failed without a reason")
    try:
        return route.type._response_class().deserialize(body)
    except (genpy.DeserializationError, struct.error, UnicodeError) as error:
        connection.hang_up()
        raise Trouble(Cause.UNUSABLE_ANSWER, "not a {}: {}".format(route.type._type, error))


def read_answer(route: Route, response: genpy.Message) -> Answer:
    """Return what a response says; raises ``Trouble`` if it is a refusal, or cannot be used."""
    success = getattr(response, route.success)
    if success == route.refused:
        raise Trouble(Cause.REFUSED, "answered {} = {!r}".format(route.success, success))
    if success != route.done:
        raise Trouble(Cause.UNUSABLE_ANSWER, "answered {} = {!r}: neither {!r} (done) nor {!r} (refused)".format(
            route.success, success, route.done, route.refused))
    return Answer(response=getattr(response, "response", ""),
                  exhibits=tuple(_exhibit(place) for place in getattr(response, "exhibits", ())))


def _exhibit(place: Any) -> Exhibit:
    """Return an exhibitInfoMessage as plain data; raises ``Trouble`` if a coordinate is not a number."""
    location = Location(place.location.x, place.location.y, place.location.theta)
    gesture = Point(place.gesture.x, place.gesture.y, place.gesture.z)
    if not all(math.isfinite(number) for number in location + gesture):
        raise Trouble(Cause.UNUSABLE_ANSWER, "{!r} has a coordinate that is no number: {}, {}".format(
            place.name, location, gesture))
    return Exhibit(place.name, place.description1, place.description2, location, gesture)


# ---------------------------------------------------------------------------------------------------------------- lines


class Line:
    """A daemon thread with one connection to one service, which carries one request at a time until it is cut."""

    def __init__(self, name: str, route: Route):
        """``name`` is the resolved name of the service."""
        self._name = name
        self._route = route
        self._connection = Connection()
        self._jobs: "queue.SimpleQueue[Optional[Tuple[Request, Callable]]]" = queue.SimpleQueue()
        self.is_asked = False
        """Whether the request under way may have reached the server."""
        threading.Thread(target=self._work, name="service " + name, daemon=True).start()

    def carry(self, request: Request, done: Callable[[Union[Answer, Failure]], None]) -> None:
        """Send ``request``, and call ``done`` with the result on the line's thread."""
        self.is_asked = False
        self._jobs.put((request, done))

    def cut(self) -> None:
        """Give up what is under way; the thread and the socket come back at once. Any thread may call it."""
        self._connection.close()
        self._jobs.put(None)

    def _work(self) -> None:
        job = self._jobs.get()
        while job is not None:
            request, done = job
            done(self._ask(request))
            job = self._jobs.get()
        self._connection.hang_up()

    def _ask(self, request: Request) -> Union[Answer, Failure]:
        """Return the answer, or why there is none."""
        try:
            data = encode(self._route, request)
            self._connect()
            self.is_asked = True
            self._connection.send(data)
            return read_answer(self._route, receive_response(self._route, self._connection))
        except Trouble as trouble:
            return Failure(trouble.cause, str(trouble), self._name)

    def _connect(self) -> None:
        """See to it that the connection stands before anything is sent."""
        if not self._connection.is_open:
            open_service(self._connection, self._name, self._route.type._md5sum, CONNECT_LIMIT, persistent="1")
            self._connection.wait_without_limit()


class _UnderWay(NamedTuple):
    """What a call holds until it ends."""

    line: Line
    timers: Tuple[Timer, ...]
    since: float

    def end(self) -> None:
        """Let nothing more fall due."""
        for timer in self.timers:
            timer.cancel()


class RosGateway(Gateway):
    """Calls the robot's services. ``start`` and ``Call.drop`` belong to the tick thread, and neither waits."""

    def __init__(self, deadline: Callable[[str], float], clock: Clock, wake: Callable[[], None],
                 health: Optional[Health] = None):
        """``deadline`` gives the seconds that a service (canonical name) may take; ``wake`` is told of each result.

        ``health`` is told how the services do.
        """
        self.deadline = deadline
        self._health = health or Health()
        self._clock = clock
        self._wake = wake
        self._names = {kind: rospy.resolve_name(kind.service) for kind in ROUTES}
        self._spare: Dict[type, List[Line]] = {kind: [] for kind in ROUTES}
        self._under_way: Dict[Call, _UnderWay] = {}

    def start(self, request: Request) -> Call:
        """Send ``request``; the call ends with the answer, with a failure, or at the deadline of its service."""
        kind = type(request)
        call = Call(request, self._wake, lambda: self._give_up(call))
        try:
            line = self._spare[kind].pop() if self._spare[kind] else Line(self._names[kind], ROUTES[kind])
        except RuntimeError as error:
            call.finish(Failure(Cause.NOT_REACHABLE, "no thread to ask with ({})".format(error), self._names[kind]))
            return call
        deadline = self.deadline(kind.service)
        timers = (self._clock.call_after(deadline, lambda: self._expire(call)),
                  self._clock.call_after(deadline * SLOW_SHARE, lambda: self._health.slow(self._names[kind], deadline)))
        self._under_way[call] = _UnderWay(line, timers, time.monotonic())
        line.carry(request, lambda result: self._end(call, result))
        return call

    def close(self) -> None:
        """Give up every call under way and give back every thread and connection."""
        for call in list(self._under_way):
            self._give_up(call)
        for lines in self._spare.values():
            while lines:
                lines.pop().cut()

    def _end(self, call: Call, result: Union[Answer, Failure]) -> None:
        """Finish ``call``, on the line's thread, unless somebody has given it up meanwhile."""
        held = self._under_way.pop(call, None)  # who gets it ends the call: nobody does it twice
        if held is not None:
            held.end()
            self._spare[type(call.request)].append(held.line)
            self._finish(call, held, result)

    def _finish(self, call: Call, held: _UnderWay, result: Union[Answer, Failure]) -> None:
        """Hand over the result, and tell the health of the service."""
        kind = type(call.request)
        self._health.ended(self._names[kind], time.monotonic() - held.since, self.deadline(kind.service),
                           isinstance(result, Failure))
        call.finish(result)

    def _give_up(self, call: Call) -> Optional[_UnderWay]:
        """Cut the line of ``call`` and return what it held; None if the call has ended before."""
        held = self._under_way.pop(call, None)
        if held is None:
            return None
        held.end()
        held.line.cut()
        return held

    def _expire(self, call: Call) -> None:
        """End ``call`` at its deadline."""
        held = self._give_up(call)
        if held is not None:
            seconds = self.deadline(call.request.service)
            where = "" if held.line.is_asked else ", still connecting: nothing was asked"
            self._finish(call, held, Failure(Cause.NO_ANSWER, "waited {:g} s{}".format(seconds, where),
                                             self._names[type(call.request)]))
