"""A ROS master, services and publishers in this process: real sockets, and no ROS runs."""
import io
import socket
import struct
import threading
import time
from socketserver import ThreadingMixIn
from xmlrpc.server import SimpleXMLRPCRequestHandler, SimpleXMLRPCServer

import rosgraph.network

from behavior_controller.ros.types import TYPES, resolved

LIMIT = 20.0  # seconds for what takes milliseconds on a quiet machine
HANG = object()
"""An answer that does not come: the request is read, and the connection stays open."""


def until(is_so, seconds=LIMIT):
    """Wait for what another thread does."""
    ends = time.monotonic() + seconds
    while not is_so():
        assert time.monotonic() < ends, "not so in {:g} s".format(seconds)
        time.sleep(0.005)


class _Handler(SimpleXMLRPCRequestHandler):
    protocol_version = "HTTP/1.0"  # a connection for each call


class _Server(ThreadingMixIn, SimpleXMLRPCServer):
    daemon_threads = True
    block_on_close = False


class RpcPeer:
    """A server of XML-RPC that answers with the methods of ``node``."""

    def __init__(self):
        self._server = _Server(("127.0.0.1", 0), _Handler, logRequests=False, allow_none=True)
        self._server.register_instance(self)
        self.uri = "http://127.0.0.1:{}/".format(self._server.server_address[1])
        threading.Thread(target=self._server.serve_forever, args=(0.01,), daemon=True).start()

    def close(self):
        self._server.shutdown()
        self._server.server_close()


class Master(RpcPeer):
    """A master that knows ``services``, ``nodes``, ``publishers`` and ``parameters``, and notes its
    ``calls``. Of a node that registers it notes the address, and its
    services."""

    def __init__(self):
        super().__init__()
        self.services, self.nodes, self.publishers, self.parameters = {}, {}, {}, {}
        self.calls = []
        self.may_answer = threading.Event()
        self.may_answer.set()

    def _dispatch(self, method, params):
        self.calls.append((method,) + params[1:])
        if method.startswith("register"):
            self.nodes[params[0]] = params[-1]
        if method == "registerService":
            self.services[params[1]] = params[2]
        self.may_answer.wait(LIMIT)
        return {"lookupService": self._look_up(self.services, params),
                "lookupNode": self._look_up(self.nodes, params),
                "getParam": self._look_up(self.parameters, params),
                "getSystemState": [1, "", [list(self.publishers.items()), [],
                                           [[name, ["/robot"]] for name in self.services]]],
                "registerPublisher": [1, "", []],
                "registerSubscriber": [1, "", []]}.get(method, [1, "", 1])

    @staticmethod
    def _look_up(table, params):
        found = table.get(params[1]) if len(params) == 2 else None
        return [-1, "unknown", ""] if found is None else [1, "", found]


class TcprosPeer:
    """A server that does with each connection what ``talk`` says; ``connections`` are all so far.
    """

    def __init__(self, talk=None, backlog=16):
        self.listener = socket.socket()
        self.listener.bind(("127.0.0.1", 0))
        self.listener.listen(backlog)
        self.port = self.listener.getsockname()[1]
        self.connections = []
        if talk is not None:
            self.talk = talk
            threading.Thread(target=self._serve, daemon=True).start()

    def _serve(self):
        while True:
            try:
                connection, _ = self.listener.accept()
            except OSError:
                return
            self.connections.append(connection)
            threading.Thread(target=self._talk, args=(connection,), daemon=True).start()

    def _talk(self, connection):
        try:
            self.talk(connection)
        except (OSError, struct.error):
            pass  # the other side has hung up

    def break_connections(self):
        """End all connections, as a lost link does."""
        for connection in self.connections:
            try:
                connection.shutdown(socket.SHUT_RDWR)
            except OSError:
                pass  # it has ended

    def close(self):
        """Take no more connections, and end those that are there."""
        try:
            self.listener.shutdown(socket.SHUT_RDWR)  # ends the wait for the next one
        except OSError:
            pass
        self.listener.close()
        self.break_connections()


def shake_hands(connection, **header):
    """Do the server's half of the handshake; return the other half."""
    theirs = rosgraph.network.decode_ros_handshake_header(read_block(connection))
    rosgraph.network.write_ros_handshake_header(connection, header)
    return theirs


def read_block(connection):
    """Read a length and that many bytes, and return both; nothing at the end of the stream."""
    head = connection.recv(4, socket.MSG_WAITALL)
    if len(head) < 4:
        return b""
    return head + connection.recv(struct.unpack("<I", head)[0], socket.MSG_WAITALL)


def answer_of(service, **fields):
    """Return the answer "done" of a declared service as it travels, with these fields."""
    response, body = TYPES[service]._response_class(), io.BytesIO()
    for name, value in {service.success.field: service.success.done, **fields}.items():
        setattr(response, name, value)
    response.serialize(body)
    return struct.pack("<BI", 1, body.tell()) + body.getvalue()


def hang(connection):
    """Read until the other side hangs up."""
    while connection.recv(4096):
        pass


class Service(TcprosPeer):
    """Offers a declared service; ``requests`` are those that came, after ``handshakes``.

    Each takes the next of ``answers``: bytes, or ``HANG``. After the last one the answer is "done".
    """

    def __init__(self, master, service, *answers):
        self.requests, self.answers, self._usual = [], list(answers), answer_of(service)
        self.handshakes = 0
        kind = TYPES[service]
        self._header = {"callerid": "/robot", "type": kind._type, "md5sum": kind._md5sum}
        super().__init__(self._carry_out)
        master.services[resolved(service)] = "rosrpc://127.0.0.1:{}".format(self.port)

    def _carry_out(self, connection):
        shake_hands(connection, **self._header)
        self.handshakes += 1
        for request in iter(lambda: read_block(connection), b""):
            self.requests.append(request)
            answer = self.answers.pop(0) if self.answers else self._usual
            if answer is HANG:
                hang(connection)
            else:
                connection.sendall(answer)


class Publisher(RpcPeer):
    """A node that publishes a topic; ``header`` is more of its handshake."""

    def __init__(self, topic, name="/robot", **header):
        kind = TYPES[topic]
        header = dict({"callerid": name, "type": kind._type, "md5sum": kind._md5sum}, **header)
        self.ready = []  # connections after their handshake
        self.peer = TcprosPeer(lambda connection: self._accept(connection, header))
        super().__init__()

    def _accept(self, connection, header):
        shake_hands(connection, **header)
        self.ready.append(connection)
        hang(connection)

    def requestTopic(self, caller, topic, protocols):
        """Answer with the address for subscribers."""
        return 1, "", ["TCPROS", "127.0.0.1", self.peer.port]

    def send(self, data):
        """Send these bytes at once to the newest subscriber."""
        until(lambda: self.ready)
        self.ready[-1].sendall(data)

    def close(self):
        """End as a node does."""
        self.peer.close()
        super().close()
