"""The server's half of ZeroMQ's protocol (ZMTP 3.0 without security, rfc.zeromq.org/spec/23).

libzmq limits neither its connections nor what it collects of a message, it takes the text of a web
page for the first version of its protocol, and it aborts the process when no descriptor is left.
"""
import asyncio
import contextlib
import math
import time
from typing import Any, Callable, Coroutine, List, Sequence, Set

from tornado.iostream import IOStream, StreamClosedError
from tornado.tcpserver import TCPServer

from behavior_controller.viewer.server import Connections

MOST_CLIENTS = 16

HANDSHAKE_LIMIT = 5.0
"""Seconds within which a client must complete the handshake."""

REPLY_LIMIT = 60.0
"""Seconds without the client reading a reply until it is disconnected; ZeroMQ reconnects."""

INTERVAL = 0.002
"""The shortest time between two messages or commands of a client, in seconds: one that floods must
not slow the others."""

MORE, LONG, COMMAND_FRAME = 1, 2, 4
"""Flags of a frame: others of its message follow, its length has eight bytes, it is a command."""

SIGNATURE_BYTES = 10
GREETING = b"\xff" + bytes(8) + b"\x7f\x03\x00" + b"NULL".ljust(52, b"\0")
"""The signature, the version, the name of the mechanism, and a filler."""


class Peer:
    """A connection with a client."""

    def __init__(self, stream: IOStream, most_bytes: int):
        """``most_bytes`` is the most that a message may have, with the lengths of its frames."""
        self.stream, self._most_bytes = stream, most_bytes
        self._heard = -math.inf

    @property
    def silence(self) -> float:
        """The seconds since the last message; infinite if the connection is over."""
        if self.stream.closed():
            return math.inf
        return time.monotonic() - self._heard

    async def shake_hands(self, kind: bytes) -> None:
        """Begin as a socket of that kind. Raises StreamClosedError if it is no ZeroMQ there."""
        theirs = await self.stream.read_bytes(SIGNATURE_BYTES)
        if theirs[:1] != GREETING[:1] or theirs[-1:] != b"\x7f":
            raise StreamClosedError
        await self.stream.write(GREETING)
        version, *_ = await self.stream.read_bytes(len(GREETING) - SIGNATURE_BYTES)
        if version < 3:
            raise StreamClosedError
        ready = b"\x05READY\x0bSocket-Type" + len(kind).to_bytes(4, "big") + kind
        await self.stream.write(_frame(COMMAND_FRAME, ready))

    async def receive(self) -> List[bytes]:
        """Return the frames of the next message. Raises StreamClosedError."""
        frames: List[bytes] = []
        room = self._most_bytes
        while True:
            await asyncio.sleep(0)  # reading what is there already lets no other client run
            flags, = await self.stream.read_bytes(1)
            size = await self.stream.read_bytes(8 if flags & LONG else 1)
            room -= 1 + len(size) + int.from_bytes(size, "big")
            if room < 0:
                raise StreamClosedError
            body = await self.stream.read_bytes(int.from_bytes(size, "big"))
            if not flags & COMMAND_FRAME:
                frames.append(body)
                if not flags & MORE:
                    self._heard = time.monotonic()
                    return frames
                continue
            if body.startswith(b"\x04PING"):
                await self.stream.write(_frame(COMMAND_FRAME, b"\x04PONG" + body[7:]))
            if not frames:
                room = self._most_bytes
            await asyncio.sleep(INTERVAL)

    async def send(self, *frames: bytes) -> None:
        """Send a message. Raises StreamClosedError, and TimeoutError if it is not taken."""
        await asyncio.wait_for(self.stream.write(_message(frames)), REPLY_LIMIT)

    def offer(self, *frames: bytes) -> None:
        """Send a message, unless the client has not taken the one before, or is gone."""
        if not self.stream.writing():
            with contextlib.suppress(StreamClosedError):
                self.stream.write(_message(frames))


def _message(frames: Sequence[bytes]) -> bytes:
    return b"".join([*(_frame(MORE, body) for body in frames[:-1]), _frame(0, frames[-1])])


def _frame(flags: int, body: bytes) -> bytes:
    if len(body) > 255:
        return bytes([flags | LONG]) + len(body).to_bytes(8, "big") + body
    return bytes([flags, len(body)]) + body


class ZmtpServer(TCPServer):
    """A socket that clients connect to; ``peers`` are those that are connected."""

    def __init__(self, kind: bytes, most_bytes: int,
                 take: Callable[[Peer, List[bytes]], Coroutine[Any, Any, None]],
                 ended: Callable[["asyncio.Task[None]"], None]):
        """``kind`` is that of the socket, such as ``ROUTER``. ``take`` gets each message, of
        ``most_bytes`` at most, and ``ended`` the task that has served a client."""
        super().__init__(max_buffer_size=4 * most_bytes)
        self.peers: Set[Peer] = set()
        self._kind, self._most_bytes = kind, most_bytes
        self._take, self._ended = take, ended
        self._connections = Connections(MOST_CLIENTS)

    def handle_stream(self, stream: IOStream, address: Any) -> None:
        """Serve a connection if there is a free place; this is decided before the next connection
        is accepted."""
        if self._connections.admit(stream):
            asyncio.ensure_future(self._serve(stream)).add_done_callback(self._ended)

    async def _serve(self, stream: IOStream) -> None:
        peer = Peer(stream, self._most_bytes)
        # a closed stream's error is an OSError
        with contextlib.closing(stream), contextlib.suppress(asyncio.TimeoutError, OSError):
            await asyncio.wait_for(peer.shake_hands(self._kind), HANDSHAKE_LIMIT)
            self.peers.add(peer)
            try:
                while True:
                    frames = await peer.receive()
                    self._connections.use(stream)
                    await self._take(peer, frames)
                    await asyncio.sleep(INTERVAL)
            finally:
                self.peers.discard(peer)
