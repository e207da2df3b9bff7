"""Connections with ROS peers: every step ends in bounded time, or at once when another thread
closes the connection.

``rospy.ServiceProxy`` cannot do this: it looks up, connects and shakes hands without a time limit,
does not expose its socket meanwhile, and does not report whether the request was sent before the
connection broke. So this module implements the protocols itself, with ROS's own functions for their
formats: TCPROS (https://wiki.ros.org/ROS/TCPROS) and the XML-RPC interface of the master and of
nodes (https://wiki.ros.org/ROS/Master_API, .../Slave_API).
"""
import http.client
import contextlib
import os
import socket
import struct
import threading
import time
import urllib.parse
import xmlrpc.client
from concurrent.futures import Future, TimeoutError as FutureTimeout
from functools import partial
from typing import Any, Dict, List, NoReturn, Optional, Tuple

import msgspec
import rosgraph
import rosgraph.network
import rospy

from behavior_controller.errors import BehaviorControllerError
from behavior_controller.robot.gateway import Cause
from behavior_controller.ros.shortage import SHORTAGE, is_shortage, shortage_behind
from behavior_controller.ros.timeouts import begin
from behavior_controller.text import clean

CONNECT_LIMIT = 4.0
"""Seconds to look up, connect and shake hands: a peer on the robot's network that takes longer
counts as unreachable."""

STEP_LIMIT = 2.0
"""Seconds that a publisher has for each step: to answer with its address, to accept the connection,
to shake hands."""

RETRY_INTERVAL = 0.5
"""Seconds between two attempts to reach what is not there."""

RECONNECT_PAUSE = 0.05
"""Seconds between a broken connection and the next one: a peer may end each at once."""

LONGEST_ANSWER = 64 * 1024 * 1024
"""The most bytes of a header or answer; a longer one counts as a broken stream. The longest real
one lists the places."""

MOST_XML = 8 * 1024 * 1024
"""The same of an XML-RPC answer. A system of a thousand topics takes a quarter of a megabyte."""

READ_SIZE = 65536

NO_ANSWER = "does not answer"
"""The fault of a peer that cannot be reached, or is silent."""

Named = List[Tuple[str, List[str]]]
"""Names of topics or services, each with the names of its nodes."""

ANSWERS: Dict[str, Any] = {
    "getSystemState": Tuple[Named, Named, Named],  # publishers, subscribers, services
    "lookupService": Optional[str],
    "lookupNode": Optional[str],
    "getParam": Any,
    "registerPublisher": List[str],
    "registerSubscriber": List[str],
    "registerService": int,
    "publisherUpdate": int,
    "unregisterSubscriber": int,
    "setParam": Optional[int],
    "deleteParam": Optional[int],
    "getPid": int,
    "servicesInUse": Tuple[bool, Tuple[str, ...]],  # of a controller: see in_use
    "requestTopic": Optional[Tuple[str, str, int]],  # protocol, host, port
}
"""What each method of a master or node returns. Optional: it may also report a failure, which is
None."""


class Trouble(BehaviorControllerError):
    """A connection failed: the cause, in the mission's terms, and a line without the peer's name.

    ``fault`` is the verb phrase about a peer that was asked by XML-RPC, such as ``does not
    answer``.
    """

    def __init__(self, cause: Cause, text: str, fault: str = ""):
        super().__init__(clean(" ".join(text.split()), 500))
        self.cause, self.fault = cause, fault

    @property
    def shortage(self) -> Optional[BaseException]:
        """The shortage of this computer for which it failed; None if the peer is the cause."""
        return shortage_behind(self)

    @property
    def reason(self) -> str:
        """The cause in words, and the text."""
        return f"{self.cause.text}: {self}"


class _TimedSocket(socket.socket):
    """A socket whose operations all end by one ``deadline`` (monotonic seconds; None: without a
    limit)."""

    deadline: Optional[float] = None
    has_received = False  # whether ``recv_into`` has brought anything

    def limit(self) -> None:
        """Let the next operation end by the deadline."""
        if self.deadline is None:
            return
        left = self.deadline - time.monotonic()
        if left <= 0.0:
            raise socket.timeout("timed out")
        self.settimeout(left)

    def connect(self, address: Any) -> None:
        self.limit()
        super().connect(address)

    def sendall(self, *data: Any) -> None:
        self.limit()
        super().sendall(*data)

    def recv(self, *arguments: Any) -> bytes:
        self.limit()
        return super().recv(*arguments)

    def recv_into(self, *arguments: Any) -> int:
        self.limit()
        count = super().recv_into(*arguments)
        self.has_received = True
        return count


def _reason(error: Optional[BaseException]) -> str:
    """Return why something failed, in the system's shortest words."""
    if isinstance(error, socket.gaierror):
        return ("the name of its computer cannot be resolved here: enter it in /etc/hosts, or set "
                "ROS_IP where the node starts")
    reason = getattr(error, "strerror", None) or str(error or "timed out")
    return f"this computer gives no more: {reason}" if shortage_behind(error) else reason


def ask(uri: str, method: str, *arguments: Any, seconds: float = CONNECT_LIMIT,
        peer: str = "") -> Any:
    """Call ``method`` of the master or node at ``uri`` and return its value, as in ``ANSWERS``.

    ``seconds`` bounds the whole call; ``peer`` stands before the address in a line about it. Raises
    ``Trouble`` (not reachable) if nothing at ``uri`` answers as a ROS node does; its ``__cause__``
    is the system's error if the connection failed.
    """
    connection, fault = Connection(), NO_ANSWER
    origin: Optional[BaseException] = None
    try:
        answer = _called(connection, uri, method, arguments, seconds)
        code, _, value = msgspec.convert(answer, Tuple[int, Any, Any])
        return msgspec.convert(value if code == 1 else None, ANSWERS[method])
    except Trouble as trouble:
        why, origin = str(trouble), trouble.__cause__
    except OSError as error:
        why, origin = _reason(error), error
        if connection.has_received and isinstance(error, socket.timeout):
            fault, why = "answers slowly", f"its answer takes longer than {seconds:g} s"
    except Exception as error:  # the parsers of HTTP and XML-RPC raise anything on broken data
        fault, why = "does not answer as ROS does", f"{method}: {clean(str(error), 200)}"
    finally:
        connection.hang_up()
    if shortage_behind(origin) is not None:
        fault = "cannot be asked"
    raise Trouble(Cause.NOT_REACHABLE, f"{peer}{uri} {fault}: {why}", fault) from origin


def _called(connection: "Connection", uri: str, method: str, arguments: Tuple[Any, ...],
            seconds: float) -> Any:
    """Return the answer of an XML-RPC call as it came."""
    place = urllib.parse.urlsplit(uri)
    if place.scheme != "http" or not place.hostname:
        raise ValueError(f"{uri!r} is not an address of a node")
    http_connection = http.client.HTTPConnection(place.hostname, place.port or 80)
    sock = http_connection.sock = connection.connect(place.hostname, place.port or 80, seconds)
    # header and body are sent one after the other
    sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    request = xmlrpc.client.dumps((rospy.get_name(),) + arguments, method).encode()
    http_connection.request("POST", place.path or "/RPC2", request, {"Content-Type": "text/xml"})
    response = http_connection.getresponse()
    if response.status != http.client.OK:
        raise ValueError(f"HTTP status {response.status} {response.reason}")
    body = bytearray()
    for chunk in iter(lambda: response.read(READ_SIZE), b""):
        body += chunk
        if len(body) > MOST_XML:
            raise ValueError(f"its answer has more than {MOST_XML} bytes")
    return xmlrpc.client.loads(bytes(body))[0][0]


def ask_master(method: str, *arguments: Any, seconds: float = CONNECT_LIMIT) -> Any:
    """Call ``method`` of the ROS master, as ``ask`` does."""
    return ask(rosgraph.get_master_uri(), method, *arguments, seconds=seconds,
               peer="the ROS master at ")


def _addresses(host: str, seconds: float) -> List[Any]:
    """Return what ``getaddrinfo`` returns. Raises OSError, also if no name server has answered in
    ``seconds``."""
    with contextlib.suppress(socket.gaierror):  # it is a name
        return _look_up(host, socket.AI_NUMERICHOST)
    try:
        with _lookups_lock:
            lookup = _lookups.get(host)
            if lookup is None or lookup.done():
                _, lookup = begin("lookup", partial(_look_up, host))
                _lookups[host] = lookup
        return lookup.result(seconds)
    except FutureTimeout:
        raise OSError(f"no name server has told the address of {host} in {seconds:g} s")
    except RuntimeError:  # no thread is left
        return _look_up(host)


def _look_up(host: str, flags: int = 0) -> List[Any]:
    return socket.getaddrinfo(host, None, type=socket.SOCK_STREAM, flags=flags)


def _file_shortage() -> Optional[OSError]:
    """Return the error of a process that gets no more files; None if it gets them."""
    try:
        os.close(os.dup(0))
    except OSError as error:
        return error if is_shortage(error) else None
    return None


_lookups: Dict[str, "Future[List[Any]]"] = {}
"""The last lookup of each host; one that is under way is awaited by all that need it, as it may
hang."""

_lookups_lock = threading.Lock()


def is_silent(sock: socket.socket) -> bool:
    """Return whether the other end of a connection has neither ended it nor sent anything that is
    unread."""
    try:
        sock.recv(1, socket.MSG_PEEK | socket.MSG_DONTWAIT)
    except BlockingIOError:
        return True
    except OSError:
        pass
    return False


class Connection:
    """One TCPROS connection. Used by one thread; ``close`` may be called from any other and ends
    what it waits for.

    Every failure is raised as ``Trouble``; then the connection is closed, and may be opened again.
    """

    def __init__(self) -> None:
        self._socket: Optional[_TimedSocket] = None
        self.closed = False

    @property
    def has_received(self) -> bool:
        """Whether the peer has sent anything of its answer to a request by HTTP."""
        return self._socket is not None and self._socket.has_received

    @property
    def is_open(self) -> bool:
        """Whether there is a connection that the peer has not ended."""
        if self._socket is not None and not is_silent(self._socket):
            self.hang_up()  # the end of the stream, or unrequested bytes: unusable either way
        return self._socket is not None

    def open(self, host: str, port: int, header: Dict[str, str], seconds: float) -> Dict[str, str]:
        """Connect, send ``header`` and return the peer's; ``seconds`` also bound later reads and
        writes."""
        try:
            self.connect(host, port, seconds)
            self.send(rosgraph.network.encode_ros_handshake_header(header))
            return self._read_header()
        except Trouble as trouble:
            if trouble.cause is Cause.NO_ANSWER:
                raise Trouble(trouble.cause, f"{host}:{port} takes the connection but does not "
                                             "answer; nothing was asked of it")
            # a connection lost before the end of the handshake never existed
            raise Trouble(Cause.NOT_REACHABLE, f"{host}:{port}: {trouble}")

    def connect(self, host: str, port: int, seconds: float) -> socket.socket:
        """Connect to the host's first address that accepts; all use of the connection ends in
        ``seconds``."""
        error: Optional[BaseException] = None
        deadline = time.monotonic() + seconds
        try:
            addresses = _addresses(host, seconds)
        except (OSError, ValueError) as failed:  # also of what is no name
            # a lookup that gets no file says that there is no such name
            addresses, error = [], _file_shortage() or failed
        for family, kind, protocol, _, address in addresses:
            try:
                sock = self._socket = _TimedSocket(family, kind, protocol)
                sock.deadline = deadline
                # checked only after ``close`` can reach the socket: one of the two threads sees the
                # other
                if self.closed:
                    raise OSError("closed")
                sock.connect((address[0], port) + address[2:])
                return sock
            except (OSError, OverflowError) as failed:  # also of what is no port
                self.hang_up()
                error = failed
        if error is not None and is_shortage(error):
            SHORTAGE.note(error)
        raise Trouble(Cause.NOT_REACHABLE, f"no connection ({_reason(error)})") from error

    def _read_header(self) -> Dict[str, str]:
        """Read and decode the peer's half of the handshake; raises ``Trouble`` if it is invalid."""
        length = self.receive(4)
        body = self.receive(struct.unpack("<I", length)[0])
        try:
            return rosgraph.network.decode_ros_handshake_header(length + body)
        except (rosgraph.network.ROSHandshakeException, UnicodeDecodeError, struct.error) as error:
            self.hang_up()
            raise Trouble(Cause.NOT_REACHABLE, f"no ROS node ({error})")

    def notice_a_dead_host(self) -> None:
        """Have an idle connection end after about three seconds without a sign of life from the
        peer's host.

        A host that is switched off or unreachable does not close its connections.
        """
        sock = self._connected()
        sock.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
        for option, value in ((socket.TCP_KEEPIDLE, 1), (socket.TCP_KEEPINTVL, 1),
                              (socket.TCP_KEEPCNT, 2)):
            sock.setsockopt(socket.IPPROTO_TCP, option, value)

    def wait_without_limit(self) -> None:
        """Remove the time limit of later reads: from here on only ``close`` ends them."""
        sock = self._connected()
        sock.deadline = None
        sock.settimeout(None)

    def send(self, data: bytes) -> None:
        """Send ``data``. After ``Trouble`` it is unknown whether the peer has received it."""
        try:
            self._connected().sendall(data)
        except OSError as error:
            self._lose(error)

    def receive(self, length: int) -> bytes:
        """Read ``length`` bytes."""
        if length > LONGEST_ANSWER:
            self._lose(f"{length} bytes announced")
        data = bytearray()
        while len(data) < length:
            data += self.receive_some(min(length - len(data), READ_SIZE))
        return bytes(data)

    def receive_some(self, most: int) -> bytes:
        """Read the available bytes, at least one and at most ``most``."""
        try:
            chunk = self._connected().recv(most)
        except OSError as error:
            self._lose(error)
        if not chunk:
            self._lose("closed by the peer")
        return chunk

    def _connected(self) -> _TimedSocket:
        return self._socket or self._lose("it is not open")

    def _lose(self, reason: Any) -> NoReturn:
        """Close the socket and raise ``Trouble``."""
        self.hang_up()
        # a limit of ours has no error number; from Python 3.10 on, an ETIMEDOUT of the system is of
        # the same class
        is_late = isinstance(reason, socket.timeout) and reason.errno is None
        raise Trouble(Cause.NO_ANSWER if is_late else Cause.CONNECTION_LOST,
                      f"the connection broke ({reason})")

    def hang_up(self) -> None:
        """Close the socket; only for the thread that uses the connection."""
        if self._socket is not None:
            self._socket.close()
            self._socket = None

    def close(self) -> None:
        """End the connection permanently, from any thread: the wait of its user fails at once, and
        the user frees it.

        The socket is shut down but not closed here: its number must not be reused while the other
        thread reads from it.
        """
        self.closed = True
        sock = self._socket
        if sock is not None:
            with contextlib.suppress(OSError):  # not connected yet, or already closed
                sock.shutdown(socket.SHUT_RDWR)


def open_publisher(connection: Connection, uri: str, topic: str, suffix: str = "",
                   **more: str) -> Dict[str, str]:
    """Connect to the node at ``uri`` as a subscriber of ``topic`` (resolved), of any type; return
    its handshake.

    A publisher drops the older of two connections from nodes of the same name: ``suffix`` makes
    ours another one. ``more`` goes into our half of the handshake. Raises ``Trouble``.
    """
    offer = ask(uri, "requestTopic", topic, [["TCPROS"]], seconds=STEP_LIMIT)
    if offer is None:
        raise Trouble(Cause.NOT_ADVERTISED, f"{uri} no longer publishes it")
    _, host, port = offer
    header = {"topic": topic, "type": "*", "md5sum": "*", "callerid": rospy.get_name() + suffix}
    answer = connection.open(host, port, dict(header, **more), STEP_LIMIT)
    if "error" in answer:
        raise Trouble(Cause.NOT_REACHABLE, f"it says: {answer['error']}")
    return answer
