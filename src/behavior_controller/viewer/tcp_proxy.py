"""A TCP port in front of a ZeroMQ socket, with a bound on connections, memory and work.

libzmq accepts any number of connections, collects a message of any number of parts, and aborts the
process when no descriptor is left for a connection it accepts. So the front accepts, and has the
socket connect to it, once for each client. It copies bytes both ways and knows nothing of the
protocol but its first byte. Without that, libzmq would take the text that a browser sends for a web
page for the first version of its protocol, and any request in it.
"""
import asyncio
import contextlib
import math
import socket
import time
import uuid
from typing import Any, AsyncIterator, Awaitable, Dict, Optional

import zmq
from tornado.iostream import IOStream, StreamClosedError
from tornado.tcpserver import TCPServer

from behavior_controller.viewer.server import Connections

MOST_CONNECTIONS = 16

SIGNATURE = b"\xff"
"""The first byte of ZeroMQ's protocol since its version 2; no text begins with it."""

FIRST_BYTE = 5.0
"""Seconds within which a client must send its first bytes, and complete ZeroMQ's handshake."""

HEARTBEAT = 20.0
"""Seconds between two pings of ZeroMQ: it disconnects a client that does not answer them."""

LONGEST_IDLE = 60.0
"""Seconds without data to a client, or without the client reading it, until it is disconnected;
ZeroMQ reconnects."""

PARTING = 1.0
"""The longest time, in seconds, that the connection with ZeroMQ outlives its client, so that ZeroMQ
notices the end."""

FORGETTING = 5.0
"""Seconds before ZeroMQ is told that a connection is over: during a handshake, this makes it abort
the process."""

RECONNECT = 3600.0
"""Seconds after which ZeroMQ would connect again: after ``FORGETTING``. If it were told never to,
it would drop the connection at once, and abort the process if it has read one part of a request.
"""

CHUNK = 16 * 1024
"""Bytes that are copied at a time."""

PACE = 0.001
"""Seconds between two chunks from all clients together: clients that flood must not slow the
mission."""


class TcpProxy(TCPServer):
    """Connects clients with one ZeroMQ socket."""

    def __init__(self, zmq_socket: zmq.Socket, most_unanswered: int):
        """Set up ``zmq_socket``, which is new.

        A client may send ``most_unanswered`` bytes more than it receives; a complete request resets
        this count. It limits what ZeroMQ collects without sending as much: parts of an unfinished
        message, and subscriptions.
        """
        super().__init__(max_buffer_size=2 * CHUNK)
        zmq_socket.setsockopt(zmq.LINGER, 0)
        zmq_socket.setsockopt(zmq.RECONNECT_IVL, int(1000 * RECONNECT))
        zmq_socket.setsockopt(zmq.MAXMSGSIZE, most_unanswered)
        zmq_socket.setsockopt(zmq.HANDSHAKE_IVL, int(1000 * FIRST_BYTE))
        zmq_socket.setsockopt(zmq.HEARTBEAT_IVL, int(1000 * HEARTBEAT))
        self._zmq_socket = zmq_socket
        self.most_unanswered = most_unanswered
        self.connections = Connections(MOST_CONNECTIONS)
        self.links = asyncio.Semaphore(MOST_CONNECTIONS)
        self.turn = asyncio.Lock()
        self._clients: Dict[bytes, _Client] = {}

    def note_request(self, name: bytes) -> None:
        """Note a complete request from the client that a ROUTER socket calls ``name``."""
        if name in self._clients:
            self._clients[name].unanswered = 0
            self._clients[name].requested_at = time.monotonic()

    def silence(self, name: bytes) -> float:
        """Return the seconds since the last complete request of that client; infinite if its
        connection is over."""
        client = self._clients.get(name)
        return time.monotonic() - client.requested_at if client is not None else math.inf

    def connect(self, name: bytes, client: "_Client") -> None:
        """Connect the ZeroMQ socket to the listener ``name``, an abstract Unix socket without a
        file."""
        self._clients[name] = client
        if self._zmq_socket.type == zmq.ROUTER:
            self._zmq_socket.setsockopt(zmq.CONNECT_RID, name)
        self._zmq_socket.connect("ipc://@" + name.decode())

    def disconnect(self, name: bytes) -> None:
        """End what ``connect`` has begun."""
        self._clients.pop(name, None)
        with contextlib.suppress(zmq.ZMQError):  # ZeroMQ has noticed the lost connection
            self._zmq_socket.disconnect("ipc://@" + name.decode())

    def handle_stream(self, stream: IOStream, address: Any) -> Optional[Awaitable[None]]:
        """Serve a connection if there is a free place; this is decided before the next connection
        is accepted."""
        return _Client(self, stream).serve() if self.connections.admit(stream) else None


class _Client:
    """One connection."""

    def __init__(self, front: TcpProxy, stream: IOStream):
        self._front = front
        self._stream = stream
        self.unanswered = 0
        self.requested_at = -math.inf  # at the last complete request

    async def serve(self) -> None:
        """Copy in both directions until either side ends, for any reason."""
        # a closed stream's error is an OSError
        with contextlib.closing(self._stream), contextlib.suppress(asyncio.TimeoutError, OSError):
            # a silent client costs ZeroMQ nothing
            first = await asyncio.wait_for(self._read(), FIRST_BYTE)
            if not first.startswith(SIGNATURE):
                return
            async with self._front.links, self._link() as link:
                await self._copy(first, link)

    async def _read(self) -> bytes:
        """Return the client's next bytes, at a limited rate."""
        chunk = await self._stream.read_bytes(CHUNK, partial=True)
        async with self._front.turn:
            await asyncio.sleep(PACE)
        return chunk

    @contextlib.asynccontextmanager
    async def _link(self) -> AsyncIterator[IOStream]:
        """Yield a connection with the ZeroMQ socket."""
        name = f"behaviorController-{uuid.uuid4()}".encode()
        with contextlib.ExitStack() as stack:
            with socket.socket(socket.AF_UNIX) as listener:
                listener.bind(b"\0" + name)
                listener.listen(1)
                stack.callback(asyncio.get_event_loop().call_later, FORGETTING,
                               self._front.disconnect, name)
                self._front.connect(name, self)
                link = IOStream(await _accept(listener), max_buffer_size=2 * CHUNK)
            stack.callback(link.close)
            yield link

    async def _copy(self, first: bytes, link: IOStream) -> None:
        """Copy in both directions, until ZeroMQ has noticed that either side ended."""
        out = asyncio.ensure_future(self._copy_out(link))
        try:
            await self._copy_in(first, link)
        finally:
            if not link.closed():
                link.socket.shutdown(socket.SHUT_WR)
            await asyncio.wait([out], timeout=PARTING)
            out.cancel()

    async def _copy_in(self, chunk: bytes, link: IOStream) -> None:
        """Copy the client's bytes, with a limit on the amount."""
        while True:
            self.unanswered += len(chunk)
            if self.unanswered > self._front.most_unanswered:
                raise StreamClosedError
            await link.write(chunk)
            chunk = await self._read()

    async def _copy_out(self, link: IOStream) -> None:
        """Copy ZeroMQ's bytes until it ends; while the client does not read them, no more are read.
        """
        with contextlib.suppress(asyncio.TimeoutError, StreamClosedError):
            while True:
                await asyncio.wait_for(self._copy_chunk_out(link), LONGEST_IDLE)
        self._stream.close()

    async def _copy_chunk_out(self, link: IOStream) -> None:
        chunk = await link.read_bytes(CHUNK, partial=True)
        self.unanswered = max(0, self.unanswered - len(chunk))
        if not self._stream.closed():
            self._front.connections.use(self._stream)
            with contextlib.suppress(StreamClosedError):
                await self._stream.write(chunk)


async def _accept(listener: socket.socket) -> socket.socket:
    """Return the next connection."""
    listener.setblocking(False)
    loop = asyncio.get_event_loop()
    try:
        accepted, _ = await asyncio.wait_for(loop.sock_accept(listener), FIRST_BYTE)
    finally:
        loop.remove_reader(listener)  # Python 3.8 leaves it
    return accepted
