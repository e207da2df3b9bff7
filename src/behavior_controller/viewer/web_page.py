"""The live page: serves the running mission to browsers and pushes every change; it is read-only.

tornado, which rosbridge uses on robots too, serves; changes travel as server-sent events, for which
every browser connects again by itself. The page needs nothing from elsewhere: HTML, CSS and script
lie beside this module.
"""
import asyncio
import math
import os
import time
from typing import Any, Callable, Dict, Optional, Set

import msgspec
from tornado.httpserver import HTTPServer
from tornado.iostream import IOStream, StreamClosedError
from tornado.web import Application, StaticFileHandler

from behavior_controller.run.events import unix_now
from behavior_controller.viewer.backlog import Backlog, Batch
from behavior_controller.viewer.board import Board
from behavior_controller.viewer.answers import PageAnswer, host_names, stream_of
from behavior_controller.viewer.earlier_runs import EarlierRuns
from behavior_controller.viewer import runs_answers
from behavior_controller.viewer.server import Connections, LoopThread, opened
from behavior_controller.viewer.view import PARTS

PAGE_FILES = os.path.join(os.path.dirname(os.path.abspath(__file__)), "page_files")
PUSH_INTERVAL = 0.05
"""Seconds between two pushes: changes in between are sent together, and the tick thread wakes no
other thread."""

FAREWELL = 0.3
"""Seconds that browsers have at the end to receive the last changes."""

MOST_BROWSERS = 20
MOST_CONNECTIONS = 64
LONGEST_IDLE = 30.0
"""Seconds after which an idle connection is closed, or a browser's that receives nothing."""


class Page:
    """Serves ``board`` at ``http://address:port/`` on a separate thread."""

    def __init__(self, address: str, port: int, board: Board, warn: Callable[[str], None],
                 records: str = "", attempts: int = 1):
        """Start to serve at the port, or at a later one, as ``opened`` says; if it is taken,
        ``warn`` gets one line and nothing is served; with port 0, nothing is served either.
        ``records`` is the folder of the runs that are listed; empty: there is none."""
        self.board = board
        self._runs = EarlierRuns(records)
        self.streams: Set[_Pushed] = set()
        self._host_names = host_names(address.lower())
        self.connections = Connections(MOST_CONNECTIONS)
        self.is_closing = False
        self._sockets = opened(address, list(filter(None, [port])), "no page in the browser",
                               "monitorPort", warn, attempts)
        self._thread = LoopThread("page", self._sockets, self._begin)
        self.is_served, self.port = self._thread.is_serving, self._thread.port

    def show(self, board: Board) -> None:
        """Show another run, also to browsers that are connected. Any thread may call this."""
        self._thread.call(setattr, self, "board", board)

    def note_end(self) -> None:
        """Show that the run is over, however it ended. Any thread may call this."""
        self._thread.call(lambda: self.board.close())

    def close(self) -> None:
        """Send every browser the end of the mission, and stop serving."""
        self._thread.close(self._part)

    async def _part(self) -> None:
        self.board.close()
        self.is_closing = True
        ends = time.monotonic() + FAREWELL
        while self.streams and time.monotonic() < ends:
            await asyncio.sleep(0.01)
        # a browser must not send another request on a connection that is no longer served
        await asyncio.wait([asyncio.ensure_future(self._server.close_all_connections())],
                           timeout=0.1)

    def _begin(self) -> None:
        data = [(path, _Data, {"find": find}) for path, find in DATA.items()]
        application = Application(
            [(r"/events", _Changes), (r"/lines", _Lines), *data, *runs_answers.ROUTES,
             (r"/(.*)", _File, {"path": PAGE_FILES, "default_filename": "index.html"})],
            log_function=lambda handler: None, compress_response=True, page=self,
            connections=self.connections, host_names=self._host_names, runs=self._runs)
        self._server = _Server(application, max_body_size=1024, max_buffer_size=64 * 1024,
                               max_header_size=16 * 1024, idle_connection_timeout=LONGEST_IDLE,
                               body_timeout=LONGEST_IDLE)
        self._server.connections = self.connections
        self._server.add_sockets(self._sockets[0])
        asyncio.ensure_future(self._keep_board_current())

    async def _keep_board_current(self) -> None:
        """Have the board process events also while no browser is connected."""
        while True:
            self.board.refresh()
            await asyncio.sleep(PUSH_INTERVAL)


class _Server(HTTPServer):
    """Serves the connections that have a place among the page's ``connections``."""

    connections: Connections

    def handle_stream(self, stream: IOStream, address: Any) -> None:
        """Serve a connection if there is a place for it."""
        if self.connections.admit(stream):
            super().handle_stream(stream, address)


class _File(PageAnswer, StaticFileHandler):
    """The page itself."""


class _Data(PageAnswer):
    """Answers with what ``find`` knows of the board, as JSON; None: there is no such thing."""

    def initialize(self, find: Callable[..., Optional[Dict[str, Any]]]) -> None:
        self._find = find

    def get(self, *arguments: str) -> None:
        board: Board = self.settings["page"].board
        board.refresh()
        data = self._find(board, *arguments)
        if data is None:
            self.set_status(404)
        self.send(data)


DATA: Dict[str, Callable[..., Any]] = {
    r"/state": lambda board: board.shown(PARTS),  # the whole board at once
    r"/node/([0-9]{1,6})": lambda board, uid: board.node(int(uid)),
    # what was so at that time of events
    r"/at/(now|[0-9]{1,12}(?:\.[0-9]{1,12})?)": lambda board, moment: board.at(
        math.inf if moment == "now" else float(moment))}
"""What is answered as JSON, by path."""


class _Pushed(PageAnswer):
    """A stream of what is new of the run. A slow client gets the newest state, not a backlog."""

    content = ""
    _board: Optional[Board] = None  # of which something was sent

    @property
    def page(self) -> Page:
        return self.settings["page"]

    async def get(self) -> None:
        """Send until the client disconnects, or everything was sent at the end."""
        if len(self.page.streams) >= MOST_BROWSERS:
            self.set_status(503)
            return
        self.set_header("Content-Type", self.content)
        self.page.streams.add(self)
        try:
            while not stream_of(self.request).closed():
                is_last, board = self.page.is_closing, self.page.board
                board.refresh()
                news, self._board = self.news(board, board is not self._board), board
                if news:
                    self.write(news)
                    await asyncio.wait_for(self.flush(), LONGEST_IDLE)
                if is_last:
                    return
                self.note_use()
                await asyncio.sleep(PUSH_INTERVAL)
        except (StreamClosedError, asyncio.TimeoutError):
            stream_of(self.request).close()
        finally:
            self.page.streams.discard(self)

    def news(self, board: Board, is_first: bool) -> bytes:
        """Return what has changed since the last call; ``is_first``: that was of another run."""
        raise NotImplementedError


class _Changes(_Pushed):
    """``/events``: all parts of the board at first, then those that have changed."""

    content = "text/event-stream; charset=utf-8"
    _versions: Dict[str, int] = {}

    def news(self, board: Board, is_first: bool) -> bytes:
        seen, self._versions = self._versions, dict(board.versions)
        parts = board.shown(name for name, version in board.versions.items()
                            if is_first or seen.get(name) != version)
        return b"data: " + msgspec.json.encode(parts) + b"\n\n" if parts else b""


class _Lines(_Pushed):
    """``/lines``: the lines of the run, each some of them after a ``Batch``; a batch comes at least
    once in ``PULSE``."""

    content = "application/x-ndjson; charset=utf-8"
    _backlog: Optional[Backlog] = None  # of which something was sent
    _next = _alive = 0  # the number of the next line; the version of the last sign of life

    def news(self, board: Board, is_first: bool) -> bytes:
        if board.backlog is not self._backlog:
            self._backlog, self._next = board.backlog, 0
        begins, texts = board.backlog.since(self._next)
        alive, self._alive = self._alive, board.versions["alive"]
        self._next = board.backlog.count
        if not texts and alive == self._alive and not is_first:
            return b""
        batch = Batch(len(texts), begins or is_first, unix_now(), board.stopped)
        return b"\n".join([msgspec.json.encode(batch), b"".join(texts)])
