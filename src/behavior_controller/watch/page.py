"""The live page: serves the running mission to browsers and pushes every change; it is read-only.

tornado, which rosbridge uses on robots too, serves; changes travel as server-sent events, for which every browser connects
again by itself. The page needs nothing from elsewhere: HTML, CSS and script lie beside this module.
"""
import asyncio
import contextlib
import ipaddress
import json
import os
import re
import socket
import threading
import time
from typing import Any, Callable, Dict, Optional, Set, Union, cast

from tornado.http1connection import HTTP1Connection
from tornado.httpserver import HTTPServer
from tornado.httputil import HTTPServerRequest
from tornado.iostream import IOStream, StreamClosedError
from tornado.netutil import bind_sockets
from tornado.web import Application, RequestHandler, StaticFileHandler

from behavior_controller.bt.engine.tree import Tree
from behavior_controller.story import title
from behavior_controller.text import clean
from behavior_controller.watch.board import PARTS, Board
from behavior_controller.watch.drawing import NotDrawn, svg
from behavior_controller.watch.server import Connections, LoopThread

FILES = os.path.join(os.path.dirname(os.path.abspath(__file__)), "page_files")
PUSH_INTERVAL = 0.05
"""Seconds between two pushes: changes in between are sent together, and the tick thread wakes no other thread."""

FAREWELL = 0.3
"""Seconds that browsers have at the end to receive the last changes."""

MOST_BROWSERS = 20
MOST_CONNECTIONS = 64
LONGEST_IDLE = 30.0
"""Seconds after which an idle connection is closed, or a browser's that receives nothing."""


class Page:
    """Serves ``board`` at ``http://address:port/`` on a separate thread."""

    def __init__(self, address: str, port: int, board: Board, warn: Callable[[str], None]):
        """Start to serve; if the port is taken, ``warn`` gets one line and nothing is served."""
        self.board = board
        self.streams: Set[_Stream] = set()
        self.hosts = _Hosts(address)
        self.connections = Connections(MOST_CONNECTIONS)
        self._thread: Optional[LoopThread] = None
        self.is_closing = False
        self._drawings: Dict[bool, _Drawing] = {}  # the operator's, and that of all nodes
        try:
            self._sockets = bind_sockets(port, address)
        except OSError as error:
            warn("no page in the browser: {}:{} cannot be opened ({}); set monitorPort to another port, or to 0".format(
                address, port, error.strerror or error))
            return
        self._thread = LoopThread("page", self._begin, self._end)

    @property
    def is_served(self) -> bool:
        """Whether the port could be opened."""
        return self._thread is not None

    def show(self, tree: Tree) -> None:
        """Show ``tree`` from now on, also to browsers already connected."""
        self.board.show(tree)

    async def draw(self, is_operators: bool) -> Union[bytes, NotDrawn, None]:
        """Return the drawing of the tree, made once, or why there is none; None before there is a tree.

        The operator's view has no node that only says how the mission is put together.
        """
        self.board.look()
        tree = self.board.tree
        if tree is None:
            return None
        drawing = self._drawings.get(is_operators)
        if drawing is None or drawing.tree is not tree:
            left_out = {node.uid for node in tree.nodes if is_operators and self.board.is_bare(node)}
            drawing = _Drawing(tree, title(self.board.mission) or tree.root.name, left_out)
            self._drawings[is_operators] = drawing
        await drawing.is_done.wait()
        return drawing.result

    def close(self) -> None:
        """Send every browser the end of the mission, and stop serving."""
        self.board.close()
        if self._thread is not None:
            self._thread.close(self._part)

    async def _part(self) -> None:
        self.is_closing = True
        ends = time.monotonic() + FAREWELL
        while self.streams and time.monotonic() < ends:
            await asyncio.sleep(0.01)
        # a browser must not send another request on a connection that is no longer served
        await asyncio.wait([asyncio.ensure_future(self._server.close_all_connections())], timeout=0.1)

    def _begin(self) -> None:
        application = Application([
            (r"/events", _Stream), (r"/state", _State), (r"/node/([0-9]{1,6})", _Node), (r"/graph(-operator)?\.svg", _Graph),
            (r"/(.*)", _File, {
                "path": FILES, "default_filename": "index.html"})], log_function=lambda handler: None, page=self)
        self._server = _Server(application, max_body_size=1024, max_buffer_size=64 * 1024, max_header_size=16 * 1024,
                               idle_connection_timeout=LONGEST_IDLE, body_timeout=LONGEST_IDLE)
        self._server.connections = self.connections
        self._server.add_sockets(self._sockets)
        asyncio.ensure_future(self._keep_board_current())

    async def _keep_board_current(self) -> None:
        """Have the board process events also while no browser is connected."""
        while True:
            self.board.look()
            await asyncio.sleep(PUSH_INTERVAL)

    def _end(self) -> None:
        for sock in self._sockets:
            sock.close()


class _Drawing:
    """The drawing of a tree, made on a separate thread; ``result`` is set when ``is_done`` is."""

    def __init__(self, tree: Tree, name: str, left_out: Set[int]):
        self.tree = tree
        self.result: Union[bytes, NotDrawn, None] = None
        self.is_done = asyncio.Event()
        self._name, self._left_out = name, left_out
        self._loop = asyncio.get_event_loop()
        # a daemon: a thread of an executor would hold the process at its end until graphviz has ended
        threading.Thread(target=self._draw, name="drawing", daemon=True).start()

    def _draw(self) -> None:
        try:
            self.result = svg(self.tree, self._name, self._left_out)
        except NotDrawn as reason:
            self.result = reason
        with contextlib.suppress(RuntimeError):  # the page has been closed
            self._loop.call_soon_threadsafe(self.is_done.set)


class _Server(HTTPServer):
    """Serves the connections that have a place among the page's ``connections``."""

    connections: Connections

    def handle_stream(self, stream: IOStream, address: Any) -> None:
        """Serve a connection if there is a place for it."""
        if self.connections.admit(stream):
            super().handle_stream(stream, address)


class _Hosts:
    """The names under which a browser may ask for the page.

    A foreign site can point a name of its own at this computer and then read, in the operator's browser, whatever answers
    to that name (DNS rebinding). So the page answers to no name that it does not know to be this computer's.
    """

    def __init__(self, address: str):
        own = socket.gethostname().lower()
        self._names = {"localhost"}
        if _ip(address) is None:
            self._names.add(address.lower())
        if not _is_loopback(address):
            self._names.update((own, own + ".local"))

    def __contains__(self, request: HTTPServerRequest) -> bool:
        """Whether the host that a request asks for is the address that it came to, or a name of this computer."""
        match = re.fullmatch(r"\[?([0-9A-Za-z.:_-]+?)\]?(:[0-9]+)?", request.headers.get("Host", ""))
        if match is None:
            return False
        host = match.group(1).lower()
        if host in self._names or _is_loopback(host):
            return True
        stream = _stream(request)
        return _ip(host) is not None and not stream.closed() and _ip(host) == _ip(stream.socket.getsockname()[0])


def _stream(request: HTTPServerRequest) -> IOStream:
    """Return the connection that a request came on."""
    return cast(HTTP1Connection, request.connection).stream


def _ip(text: str) -> Any:
    """Return an IP address, or None for a name; an IPv4 address that came to an IPv6 socket is one of IPv4."""
    try:
        address = ipaddress.ip_address(text.split("%")[0])
    except ValueError:
        return None
    return getattr(address, "ipv4_mapped", None) or address


def _is_loopback(text: str) -> bool:
    address = _ip(text)
    return text.lower() == "localhost" if address is None else address.is_loopback


class _Quiet(RequestHandler):
    """The common part of all answers."""

    @property
    def page(self) -> Page:
        return self.settings["page"]

    def note_use(self) -> None:
        """Keep the connection's place."""
        self.page.connections.use(_stream(self.request))

    def prepare(self) -> None:
        """Refuse a request for another computer's name."""
        self.note_use()
        if self.request not in self.page.hosts:
            self.set_status(403)
            self.set_header("Content-Type", "text/plain; charset=utf-8")
            self.finish("This page answers to the address of its computer and to localhost, and to the name that "
                        "monitorAddress gives, but not to the name that was asked for.\n")

    def set_default_headers(self) -> None:
        """Forbid content from other sites, caching, and frames of other pages around this one."""
        self.set_header("Content-Security-Policy", "default-src 'self'; frame-ancestors 'none'")
        self.set_header("X-Frame-Options", "DENY")
        self.set_header("X-Content-Type-Options", "nosniff")
        self.set_header("Cache-Control", "no-store")


class _File(_Quiet, StaticFileHandler):
    """The page itself."""


class _State(_Quiet):
    """``/state``: the whole board at once."""

    def get(self) -> None:
        """Answer with all parts as JSON."""
        board = self.page.board
        self.set_header("Content-Type", "application/json; charset=utf-8")
        self.write(json.dumps({name: board.part(name) for name in PARTS}))


class _Node(_Quiet):
    """``/node/5``: the details of one node."""

    def get(self, uid: str) -> None:
        """Answer as JSON."""
        found = self.page.board.node(int(uid))
        if found is None:
            self.set_status(404)
        self.set_header("Content-Type", "application/json; charset=utf-8")
        self.write(json.dumps(found))


class _Graph(_Quiet):
    """``/graph.svg``: the tree as graphviz draws it; ``/graph-operator.svg``: without its bare nodes."""

    async def get(self, view: Optional[str]) -> None:
        """Answer with the drawing, or in one line why there is none."""
        drawn = await self.page.draw(view is not None)
        if isinstance(drawn, bytes):
            self.set_header("Content-Type", "image/svg+xml; charset=utf-8")
            self.write(drawn)
        else:
            self.set_status(404)
            self.set_header("Content-Type", "text/plain; charset=utf-8")
            self.write(clean(str(drawn or "there is no mission yet")))


class _Stream(_Quiet):
    """``/events``: all parts at first, then each that has changed. A slow browser gets the newest state, not a backlog."""

    _is_gone = False

    async def get(self) -> None:
        """Send until the browser disconnects, or everything was sent at the end."""
        if len(self.page.streams) >= MOST_BROWSERS:
            self.set_status(503)
            return
        self.set_header("Content-Type", "text/event-stream; charset=utf-8")
        self.page.streams.add(self)
        known: Dict[str, int] = {}
        try:
            while not self._is_gone:
                is_last, message = self.page.is_closing, self._message(known)
                if message:
                    self.write(message)
                    await asyncio.wait_for(self.flush(), LONGEST_IDLE)
                if is_last:
                    return
                self.note_use()
                await asyncio.sleep(PUSH_INTERVAL)
        except StreamClosedError:
            pass
        except asyncio.TimeoutError:
            _stream(self.request).close()
        finally:
            self.page.streams.discard(self)

    def on_connection_close(self) -> None:
        """End the loop above."""
        self._is_gone = True

    def _message(self, known: Dict[str, int]) -> str:
        """Return the parts that are newer than ``known``, as one event; an empty text if there are none."""
        board = self.page.board
        board.look()
        newer = {name: version for name, version in board.versions.items() if known.get(name) != version}
        if not newer:
            return ""
        known.update(newer)
        return "data: {}\n\n".format(json.dumps({name: board.part(name) for name in newer}))
