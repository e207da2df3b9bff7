"""Connections with ROS peers: every step ends in bounded time, or at once when another thread closes the connection.

``rospy.ServiceProxy`` cannot do this: it looks up, connects and shakes hands without a time limit, does not expose its
socket meanwhile, and does not report whether the request was sent before the connection broke. So this module implements
the protocols itself, with ROS's own functions for their formats: TCPROS (https://wiki.ros.org/ROS/TCPROS) and the
XML-RPC interface of the master and of nodes (https://wiki.ros.org/ROS/Master_API, .../Slave_API).
"""
import http.client
import socket
import struct
import xml.parsers.expat
import xmlrpc.client
from typing import Any, Dict, NoReturn, Optional, Tuple

import rosgraph
import rosgraph.network
import rospy

from behavior_controller.errors import BehaviorControllerError
from behavior_controller.gateway import Cause
from behavior_controller.text import clean

CONNECT_LIMIT = 4.0
"""Seconds to look up, connect and shake hands: a peer on the robot's network that takes longer counts as unreachable."""

MOST_BYTES = 64 * 1024 * 1024
"""The most bytes of a header or answer; a longer one counts as a broken stream. The longest real one lists exhibits."""

_XMLRPC_TROUBLE = (OSError, http.client.HTTPException, xmlrpc.client.Error, xml.parsers.expat.ExpatError, ValueError,
                   TypeError)


class Trouble(BehaviorControllerError):
    """A connection failed: the cause, in the terms of the mission, and a line for an operator without the peer's name."""

    def __init__(self, cause: Cause, text: str):
        super().__init__(clean(" ".join(text.split()), 500))
        self.cause = cause


class _TimedTransport(xmlrpc.client.Transport):
    """XML-RPC whose every step on the network ends after ``seconds``."""

    def __init__(self, seconds: float):
        super().__init__()
        self._seconds = seconds

    def make_connection(self, host: Any) -> http.client.HTTPConnection:
        """Return the connection to ``host``, with the limit set."""
        connection = super().make_connection(host)
        connection.timeout = self._seconds
        return connection


def _reason(error: Optional[Exception]) -> str:
    """Return why something failed, in the system's shortest words."""
    if isinstance(error, socket.gaierror):
        return ("the name of its computer cannot be resolved here: enter it in /etc/hosts, or set ROS_IP where the node "
                "starts")
    return getattr(error, "strerror", None) or str(error or "timed out")


def ask(uri: str, method: str, *arguments: Any, seconds: float = CONNECT_LIMIT) -> Any:
    """Call ``method`` of the master or node at ``uri`` in our name and return its value; None if it reports a failure.

    Raises ``Trouble`` (not reachable) if nothing at ``uri`` answers as a ROS node does.
    """
    try:
        with xmlrpc.client.ServerProxy(uri, transport=_TimedTransport(seconds)) as peer:
            code, _, value = getattr(peer, method)(rospy.get_name(), *arguments)
    except _XMLRPC_TROUBLE as error:
        raise Trouble(Cause.NOT_REACHABLE, "{} does not answer ({})".format(uri, _reason(error)))
    return value if code == 1 else None


def ask_master(method: str, *arguments: Any, seconds: float = CONNECT_LIMIT) -> Any:
    """Call ``method`` of the ROS master, as ``ask`` does."""
    try:
        return ask(rosgraph.get_master_uri(), method, *arguments, seconds=seconds)
    except Trouble as trouble:
        raise Trouble(trouble.cause, "the ROS master at {}".format(trouble))


class Connection:
    """One TCPROS connection. Used by one thread; ``close`` may be called from any other and ends what it waits for.

    Every failure is raised as ``Trouble``; then the connection is closed, and may be opened again.
    """

    def __init__(self) -> None:
        self._socket: Optional[socket.socket] = None
        self.closed = False

    @property
    def is_open(self) -> bool:
        """Whether there is a connection that the peer has not ended."""
        if self._socket is None:
            return False
        try:
            self._socket.recv(1, socket.MSG_PEEK | socket.MSG_DONTWAIT)
        except BlockingIOError:
            return True
        except OSError:
            pass
        # the end of the stream, or unrequested bytes: unusable either way
        self.hang_up()
        return False

    def open(self, host: str, port: int, header: Dict[str, str], seconds: float) -> Dict[str, str]:
        """Connect, send ``header`` and return the peer's. ``seconds`` bounds connecting, and then each reading."""
        try:
            self._connect(host, port, seconds)
            self.send(rosgraph.network.encode_ros_handshake_header(header))
            return self._read_header()
        except Trouble as trouble:
            if trouble.cause is Cause.NO_ANSWER:
                raise Trouble(trouble.cause, "{}:{} takes the connection but does not answer; nothing was asked of it"
                              .format(host, port))
            # a connection lost before the end of the handshake never existed
            raise Trouble(Cause.NOT_REACHABLE, "{}:{}: {}".format(host, port, trouble))

    def _connect(self, host: str, port: int, seconds: float) -> None:
        """Connect to the first of the host's addresses that accepts the connection."""
        error: Optional[Exception] = None
        try:
            for family, kind, protocol, _, address in socket.getaddrinfo(host, port, type=socket.SOCK_STREAM):
                error = self._try(socket.socket(family, kind, protocol), address, seconds)
                if error is None:
                    return
        except (OSError, UnicodeError) as failed:
            error = failed
        raise Trouble(Cause.NOT_REACHABLE, "no connection ({})".format(_reason(error)))

    def _try(self, sock: socket.socket, address: Tuple, seconds: float) -> Optional[OSError]:
        """Connect ``sock``; return None or why not."""
        self._socket = sock
        try:
            sock.settimeout(seconds)
            # checked only after ``close`` can reach the socket: one of the two threads sees the other
            if self.closed:
                raise OSError("closed")
            sock.connect(address)
        except OSError as error:
            self.hang_up()
            return error
        return None

    def _read_header(self) -> Dict[str, str]:
        """Read and decode the peer's half of the handshake; raises ``Trouble`` if it is invalid."""
        length = self.receive(4)
        body = self.receive(struct.unpack("<I", length)[0])
        try:
            return rosgraph.network.decode_ros_handshake_header(length + body)
        except (rosgraph.network.ROSHandshakeException, UnicodeDecodeError, struct.error) as error:
            self.hang_up()
            raise Trouble(Cause.NOT_REACHABLE, "no ROS node ({})".format(error))

    def notice_a_dead_host(self) -> None:
        """Have an idle connection end after about three seconds without a sign of life from the peer's host.

        A host that is switched off or unreachable does not close its connections.
        """
        if self._socket is not None:
            self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
            for option, value in ((socket.TCP_KEEPIDLE, 1), (socket.TCP_KEEPINTVL, 1), (socket.TCP_KEEPCNT, 2)):
                self._socket.setsockopt(socket.IPPROTO_TCP, option, value)

    def wait_without_limit(self) -> None:
        """Remove the time limit of later reads: from here on only ``close`` ends them."""
        if self._socket is not None:
            self._socket.settimeout(None)

    def send(self, data: bytes) -> None:
        """Send ``data``. After ``Trouble`` it is unknown whether the peer has received it."""
        try:
            self._connected().sendall(data)
        except OSError as error:
            self._lose(error)

    def receive(self, length: int) -> bytes:
        """Read ``length`` bytes."""
        if length > MOST_BYTES:
            self._lose("{} bytes announced".format(length))
        data = bytearray()
        while len(data) < length:
            data += self.receive_some(min(length - len(data), 65536))
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

    def _connected(self) -> socket.socket:
        return self._socket or self._lose("it is not open")

    def _lose(self, reason: Any) -> NoReturn:
        """Close the socket and raise ``Trouble``."""
        self.hang_up()
        # a limit of ours has no error number; from Python 3.10 on, an ETIMEDOUT of the system is of the same class
        is_late = isinstance(reason, socket.timeout) and reason.errno is None
        raise Trouble(Cause.NO_ANSWER if is_late else Cause.CONNECTION_LOST, "the connection broke ({})".format(reason))

    def hang_up(self) -> None:
        """Close the socket; only for the thread that uses the connection."""
        if self._socket is not None:
            self._socket.close()
            self._socket = None

    def close(self) -> None:
        """End the connection permanently, from any thread: the wait of its user fails at once, and the user frees it.

        The socket is shut down but not closed here: its number must not be reused while the other thread reads from it.
        """
        self.closed = True
        sock = self._socket
        if sock is not None:
            try:
                sock.shutdown(socket.SHUT_RDWR)
            except OSError:
                pass  # not connected yet, or already closed
