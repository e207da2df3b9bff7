"""The server's side of ZMTP 3.0, the wire protocol of ZeroMQ's sockets (RFC 23), with a bound on everything.

libzmq accepts each connection, collects a message of any number of parts, and queues replies for a client that reads
none: nothing in it keeps a stranger from taking all descriptors and all memory. Here a connection has one request and
one reply at a time; while a client does not read, it is not read from.
"""
import asyncio
from typing import Any, Awaitable, Callable, List, Optional, Set, Tuple

from tornado.iostream import IOStream, StreamClosedError
from tornado.tcpserver import TCPServer

from behavior_controller.watch.server import Connections

MOST_BYTES = 1024 * 1024
"""A longer message closes its connection."""

MOST_PARTS = 64
"""A message of more parts closes its connection."""

MOST_TOPICS = 64
"""A subscriber of more topics is let go."""

HANDSHAKE = 5.0
"""Seconds until a connection must have introduced itself."""

LONGEST_IDLE = 60.0
"""Seconds after which a client that asks nothing, or does not take its reply, is let go; ZeroMQ connects again."""

MOST_CONNECTIONS = 16

_MORE, _LONG, _COMMAND = 1, 2, 4
_GREETING = b"\xff" + bytes(8) + b"\x7f" + b"\x03\x00" + b"NULL".ljust(20, b"\x00") + bytes(32)


class _Broken(Exception):
    """A peer that does not keep to the protocol."""


class _Peer:
    """One connection after its handshake."""

    def __init__(self, stream: IOStream):
        self.stream = stream

    async def introduce(self, kind: bytes) -> None:
        """Exchange greetings and the types of the sockets."""
        await self.stream.write(_GREETING)
        greeting = await self.stream.read_bytes(len(_GREETING))
        if (greeting[0], greeting[9]) != (0xFF, 0x7F) or greeting[10] < 3 or greeting[12:32].rstrip(b"\x00") != b"NULL":
            raise _Broken
        await self.stream.write(_frame(_COMMAND, b"\x05READY\x0bSocket-Type" + len(kind).to_bytes(4, "big") + kind))
        flags, body = await self._read_frame()
        if flags & _COMMAND == 0 or not body.startswith(b"\x05READY"):
            raise _Broken

    async def receive(self) -> List[bytes]:
        """Return the parts of the next message."""
        parts: List[bytes] = []
        while True:
            flags, body = await self._read_frame()
            if flags & _COMMAND:
                await self._obey(body)
                continue
            parts.append(body)
            if len(parts) > MOST_PARTS or sum(map(len, parts)) > MOST_BYTES:
                raise _Broken
            if not flags & _MORE:
                return parts

    def send(self, parts: List[bytes]) -> "Awaitable[None]":
        """Write a message; what is returned is done when the peer's computer has room for all of it."""
        return self.stream.write(b"".join(_frame(_MORE, part) for part in parts[:-1]) + _frame(0, parts[-1]))

    async def _read_frame(self) -> Tuple[int, bytes]:
        flags = (await self.stream.read_bytes(1))[0]
        size = int.from_bytes(await self.stream.read_bytes(8 if flags & _LONG else 1), "big")
        if flags > 7 or size > MOST_BYTES:
            raise _Broken
        return flags, await self.stream.read_bytes(size) if size else b""

    async def _obey(self, command: bytes) -> None:
        """Answer a ping, which has two bytes of time to live and then what is to be sent back; pass over all else."""
        if command.startswith(b"\x04PING"):
            await self.stream.write(_frame(_COMMAND, b"\x04PONG" + command[7:23]))


def _frame(flags: int, body: bytes) -> bytes:
    if len(body) < 256:
        return bytes((flags, len(body))) + body
    return bytes((flags | _LONG,)) + len(body).to_bytes(8, "big") + body


class _Server(TCPServer):
    """Accepts connections of one type of socket; sub-classes give ``serve``."""

    kind = b""

    def __init__(self) -> None:
        super().__init__(max_buffer_size=2 * MOST_BYTES)
        self._connections = Connections(MOST_CONNECTIONS)

    def handle_stream(self, stream: IOStream, address: Any) -> Optional[Awaitable[None]]:
        """Serve a connection if there is a place for it; this is decided before the next one is accepted."""
        return self._talk(stream) if self._connections.admit(stream) else None

    async def _talk(self, stream: IOStream) -> None:
        """Serve one connection until it ends, for whatever reason."""
        peer = _Peer(stream)
        try:
            await asyncio.wait_for(peer.introduce(self.kind), HANDSHAKE)
            await self.serve(peer)
        except (StreamClosedError, asyncio.TimeoutError, _Broken):
            pass
        finally:
            stream.close()

    async def serve(self, peer: _Peer) -> None:
        """Talk to a peer that has introduced itself."""
        raise NotImplementedError


class ReplyServer(_Server):
    """A REP socket: answers each request of each client with what ``answer`` returns for its parts."""

    kind = b"REP"

    def __init__(self, answer: Callable[[List[bytes]], Awaitable[List[bytes]]]):
        super().__init__()
        self._answer = answer

    async def serve(self, peer: _Peer) -> None:
        """Answer one request after another; what stands before the empty part is the sender's and goes back to it."""
        while True:
            parts = await asyncio.wait_for(peer.receive(), LONGEST_IDLE)
            self._connections.use(peer.stream)
            if b"" in parts[:-1]:
                start = parts.index(b"") + 1
                reply = await self._answer(parts[start:])
                await asyncio.wait_for(peer.send(parts[:start] + reply), LONGEST_IDLE)


class PublishServer(_Server):
    """A PUB socket: sends each message to all that have subscribed to its beginning."""

    kind = b"PUB"

    def __init__(self) -> None:
        super().__init__()
        self._subscribers: List[Tuple[_Peer, Set[bytes]]] = []

    async def serve(self, peer: _Peer) -> None:
        """Take subscriptions: a byte 1, or 0 to end one, and then the topic."""
        topics: Set[bytes] = set()
        subscriber = (peer, topics)
        self._subscribers.append(subscriber)
        try:
            while len(topics) <= MOST_TOPICS:
                message = (await peer.receive())[0]
                if message[:1] == b"\x01":
                    topics.add(message[1:])
                else:
                    topics.discard(message[1:])
        finally:
            self._subscribers.remove(subscriber)

    def publish(self, parts: List[bytes]) -> None:
        """Send a message; a subscriber that has not taken the one before misses it."""
        for peer, topics in self._subscribers:
            if any(map(parts[0].startswith, topics)) and not peer.stream.writing() and not peer.stream.closed():
                peer.send(parts)
