"""Shared by the servers of the page and of Groot2: a thread with an event loop, and a limit on
connections.

The robot needs the process's file descriptors: a server holds a limited number of them, whatever
connects to its port.
"""
import asyncio
import contextlib
import errno
import itertools
import socket
import threading
import time
from typing import Any, Callable, Coroutine, Dict, List, Optional, Sequence

from tornado.iostream import IOStream
from tornado.netutil import bind_sockets

SHORTEST_IDLE = 2.0
"""Seconds for which an idle connection keeps its place."""

NO_DESCRIPTOR = (errno.EMFILE, errno.ENFILE, errno.ENOBUFS, errno.ENOMEM)
"""The system's error numbers when it gives nothing for a connection."""

HIGHEST_PORT = 65535

ACCEPT_AGAIN = 0.05
"""Seconds between two attempts to accept a client meanwhile."""


class Connections:
    """The open connections of one server, ``most`` at the same time."""

    def __init__(self, most: int):
        self._most = most
        # the connection that was idle longest comes first
        self._last_used: Dict[IOStream, float] = {}

    def admit(self, stream: IOStream) -> bool:
        """Give ``stream`` a place and return whether it has one; a stream without a place is
        closed.

        When all places are taken, it gets the place of the connection that was idle longest, if
        that was 2 s or more.
        """
        for known in [known for known in self._last_used if known.closed()]:
            del self._last_used[known]
        if len(self._last_used) >= self._most:
            idle, last_used = next(iter(self._last_used.items()))
            if time.monotonic() - last_used < SHORTEST_IDLE:
                stream.close()
                return False
            del self._last_used[idle]
            idle.close()
        # so that a computer that vanished frees its place
        stream.socket.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
        self.use(stream)
        return True

    def use(self, stream: IOStream) -> None:
        """Note that ``stream`` is active now."""
        self._last_used.pop(stream, None)
        self._last_used[stream] = time.monotonic()


class _Listener(socket.socket):
    """A listening socket, for tornado."""

    def accept(self) -> Any:
        """Accept a client; if no descriptor is left, it waits: tornado would try again at once, and
        write a traceback each time."""
        try:
            return super().accept()
        except OSError as error:
            if error.errno not in NO_DESCRIPTOR:
                raise
            time.sleep(ACCEPT_AGAIN)
            raise BlockingIOError from error


def opened(address: str, ports: Sequence[int], consequence: str, key: str,
           warn: Callable[[str], None], attempts: int = 1) -> List[List[socket.socket]]:
    """Return the sockets of each port, or of the ports after them that are free, after so many
    ``attempts``; if one cannot be opened none, and ``warn`` gets a line that says what follows from
    it, and with which key of the configuration it is changed."""
    sockets: List[List[socket.socket]] = []
    for port in ports:
        try:
            sockets.append([_Listener(fileno=sock.detach())
                            for sock in bind_sockets(port, address)])
        except OSError as error:
            _close(sockets)
            following = [other + len(ports) for other in ports]
            if error.errno == errno.EADDRINUSE and attempts > 1 and following[-1] <= HIGHEST_PORT:
                return opened(address, following, consequence, key, warn, attempts - 1)
            warn(f"{consequence}: {address}:{port} cannot be opened ({error.strerror or error}); "
                 f"set {key} to another port, or to 0")
            return []
    return sockets


def _close(sockets: List[List[socket.socket]]) -> None:
    for sock in itertools.chain(*sockets):
        sock.close()


class LoopThread:
    """A thread on which an event loop runs until ``close``; without sockets there is none, and
    nothing is done."""

    def __init__(self, name: str, sockets: List[List[socket.socket]], begin: Callable[[], None],
                 end: Callable[[], None] = lambda: None):
        """``begin`` is called in the running loop; when the loop ends, for any reason, the
        ``sockets`` are closed and ``end`` is called."""
        self.is_serving = bool(sockets)
        self.port = sockets[0][0].getsockname()[1] if sockets else 0
        """The first port; 0: none."""
        self._sockets = sockets
        self._loop = asyncio.new_event_loop()
        self._loop.call_soon(begin)
        self._end = end
        self._thread = threading.Thread(target=self._run, name=name, daemon=True)
        if self.is_serving:
            self._thread.start()
        else:
            self._loop.close()

    def call(self, function: Callable[..., Any], *arguments: Any) -> None:
        """Have the loop call ``function`` soon, unless the loop has ended. Any thread may call
        this; it does not wait."""
        with contextlib.suppress(RuntimeError):  # the loop has ended
            self._loop.call_soon_threadsafe(function, *arguments)

    def close(self, finish: Optional[Callable[[], Coroutine[Any, Any, None]]] = None) -> None:
        """End the loop after ``finish``, and wait for its end for a second at most."""
        async def end() -> None:
            try:
                if finish is not None:
                    await finish()
            finally:
                self._loop.stop()

        self.call(lambda: self._loop.create_task(end()))
        if self.is_serving:
            self._thread.join(1.0)

    def _run(self) -> None:
        asyncio.set_event_loop(self._loop)
        try:
            self._loop.run_forever()
        finally:
            _close(self._sockets)
            self._end()
            tasks = asyncio.all_tasks(self._loop)
            for task in tasks:
                task.cancel()
            if tasks:
                self._loop.run_until_complete(asyncio.wait(tasks))
            self._loop.close()
