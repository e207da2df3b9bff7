"""The live page: serves the running mission to browsers and pushes every change; nobody can change anything through it.

tornado, which rosbridge uses on robots too, serves; changes travel as server-sent events, for which every browser connects
again by itself. The page needs nothing from elsewhere: HTML, CSS and script lie beside this module.
"""
import asyncio
import json
import os
import threading
import time
from typing import Any, Callable, Dict, Optional, Set

from tornado.httpserver import HTTPServer
from tornado.ioloop import IOLoop
from tornado.iostream import StreamClosedError
from tornado.netutil import bind_sockets
from tornado.web import Application, RequestHandler, StaticFileHandler

from behavior_controller.bt.engine.tree import Tree
from behavior_controller.watch.board import PARTS, Board

FILES = os.path.join(os.path.dirname(os.path.abspath(__file__)), "page_files")
PUSH_INTERVAL = 0.1
"""Seconds between two pushes: what changes meanwhile is sent together, and the tick thread need wake nobody."""

FAREWELL = 0.3
"""Seconds that browsers have at the end to take what came last."""

MOST_BROWSERS = 20


class Page:
    """Serves ``board`` at ``http://address:port/`` on a thread of its own."""

    def __init__(self, address: str, port: int, board: Board, warn: Callable[[str], None]):
        """Start to serve; a port that is taken is told to ``warn`` in one line, and nobody is served."""
        self.board = board
        self.streams: Set[_Stream] = set()
        self.is_closing = False
        self._loop: Optional[IOLoop] = None
        try:
            sockets = bind_sockets(port, address)
        except OSError as error:
            warn("no page in the browser: {}:{} cannot be opened ({}); set monitorPort to another port, or to 0".format(
                address, port, error.strerror or error))
            return
        ready = threading.Event()
        self._thread = threading.Thread(target=self._serve, args=(sockets, ready), name="page", daemon=True)
        self._thread.start()
        ready.wait(5.0)

    def show(self, tree: Tree) -> None:
        """Show ``tree`` from now on, also to who looks already."""
        self.board.show(tree)

    def close(self) -> None:
        """Tell every browser how the mission ended, and stop serving."""
        self.board.close()
        if self._loop is not None:
            self._loop.add_callback(self._part)
            self._thread.join(1.0)

    async def _part(self) -> None:
        self.is_closing = True
        ends = time.monotonic() + FAREWELL
        while self.streams and time.monotonic() < ends:
            await asyncio.sleep(0.01)
        # a browser must not ask again on a connection that is served no more
        closing = asyncio.ensure_future(self._server.close_all_connections())
        await asyncio.wait([closing], timeout=0.1)
        assert self._loop is not None
        self._loop.stop()

    def _serve(self, sockets: Any, ready: threading.Event) -> None:
        asyncio.set_event_loop(asyncio.new_event_loop())
        self._loop = IOLoop.current()
        application = Application([
            (r"/events", _Stream, {"page": self}), (r"/state", _State, {"page": self}),
            (r"/(.*)", _File, {"path": FILES, "default_filename": "index.html"})], log_function=lambda handler: None)
        self._server = HTTPServer(application, max_body_size=1024)
        self._server.add_sockets(sockets)
        self._loop.add_callback(ready.set)
        self._loop.start()
        self._server.stop()


class _Quiet(RequestHandler):
    """What all answers have in common."""

    def set_default_headers(self) -> None:
        """Allow nothing from elsewhere, and nothing to be kept."""
        self.set_header("Content-Security-Policy", "default-src 'self'")
        self.set_header("X-Content-Type-Options", "nosniff")
        self.set_header("Cache-Control", "no-store")


class _File(_Quiet, StaticFileHandler):
    """The page itself."""


class _State(_Quiet):
    """``/state``: the whole board at once."""

    def initialize(self, page: Page) -> None:
        """Take the page."""
        self._board = page.board

    def get(self) -> None:
        """Answer with all parts as JSON."""
        self._board.look()
        self.set_header("Content-Type", "application/json; charset=utf-8")
        self.write(json.dumps({name: self._board.part(name) for name in PARTS}))


class _Stream(_Quiet):
    """``/events``: all parts at first, then each that has changed. A slow browser gets the newest, not a backlog."""

    def initialize(self, page: Page) -> None:
        """Take the page."""
        self._page = page
        self._is_gone = False

    async def get(self) -> None:
        """Send until the browser goes, or all has been told at the end."""
        if len(self._page.streams) >= MOST_BROWSERS:
            self.set_status(503)
            return
        self.set_header("Content-Type", "text/event-stream; charset=utf-8")
        self._page.streams.add(self)
        known: Dict[str, int] = {}
        try:
            while not self._is_gone:
                is_last, message = self._page.is_closing, self._message(known)
                if message:
                    self.write(message)
                    await self.flush()
                if is_last:
                    return
                await asyncio.sleep(PUSH_INTERVAL)
        except StreamClosedError:
            pass
        finally:
            self._page.streams.discard(self)

    def on_connection_close(self) -> None:
        """End the loop above."""
        self._is_gone = True

    def _message(self, known: Dict[str, int]) -> str:
        """Return the parts that are newer than ``known``, as one event; an empty text if there are none."""
        board = self._page.board
        board.look()
        newer = {name: version for name, version in board.versions.items() if known.get(name) != version}
        if not newer:
            return ""
        known.update(newer)
        return "data: {}\n\n".format(json.dumps({name: board.part(name) for name in newer}))
