"""Groot2's publisher: lets Groot2 see the running tree, its blackboards and transitions, and stop
at breakpoints.

Speaks the protocol of BehaviorTree.CPP's ``Groot2Publisher`` (the project's notes: groot2_protocol)
on its own thread. The tick thread only notes each change of a status, at next to no cost.
"""
import asyncio
import collections
import ctypes
import os
import struct
import time
import uuid
from functools import partial
from typing import Any, Callable, Deque, Dict, List, Optional, Sequence, Tuple, Union
from xml.etree import ElementTree

import msgspec
import zmq
import zmq.asyncio

from behavior_controller.bt.linter.structure import CONDITIONS
from behavior_controller.bt.linter.palette import tree_nodes_model
from behavior_controller.bt.engine.node import Node
from behavior_controller.bt.engine.tree import Change, Tree
from behavior_controller.bt.engine.blackboard import Blackboard
from behavior_controller.bt.registry import NodeSpec
from behavior_controller.bt.status import IDLE, NUMBERS
from behavior_controller.execution.events import BreakpointChanged
from behavior_controller.monitoring.groot2.tcp_proxy import Front
from behavior_controller.monitoring.groot2.breakpoints import (
    ALLOWED, Hook, Hooks, HookPlace, Unlocking)
from behavior_controller.monitoring.server import LoopThread, opened

PROTOCOL = 2
WAS = 10
"""Added to the code of the status that a node had before IDLE, for a monitor that polls too late to
see it."""

MOST_TRANSITIONS = 1000
HEARTBEAT = 5.0
"""Seconds without a request after which a client, which is one connection, counts as gone: its
breakpoints must not hold the robot."""

PACE = 0.002
"""The shortest time between two requests, in seconds: a client that floods must not slow the
mission."""

MOST_REQUEST = 32_768
"""The most bytes of a request."""

MOST_SUBSCRIPTIONS = 4096
"""The most bytes from a client on the port of breakpoints reached: ZeroMQ keeps them in a hundred
times the memory."""

MOST_QUEUED = 2
"""Requests and replies that ZeroMQ keeps for each client."""

ZERO_COPY_RECV = 10
"""An option of libzmq without a name in pyzmq; if it is off, a small part does not keep 8 KB of its
connection's input."""

MOST_LINES = 20
"""The most lines about hooks that the operator gets in a second."""


class Refused(ValueError):
    """A request that cannot be carried out; the text goes back to the client."""


class Groot2Publisher:
    """Serves one tree after another at ``address``, ``port`` (requests) and ``port + 1``
    (breakpoints reached)."""

    def __init__(self, address: str, port: int, specs: Sequence[NodeSpec],
                 warn: Callable[[str], None], held: Callable[[BreakpointChanged], None]):
        """Open the sockets; if a port is taken, ``warn`` gets one line and nothing is served.

        ``specs`` are all registered node types. ``warn`` also gets lines about hooks, on the
        publisher's thread.
        """
        self._specs = specs
        self._warn = warn
        self._second_began, self._lines = 0.0, 0  # and the lines about hooks since
        self._held = held
        self._shown: Optional[_Shown] = None
        self._is_closed = False
        # of the requests, and of the breakpoints reached
        self._sockets = opened(
            address, [port, port + 1], "Groot2 cannot connect", "groot2Port", warn)
        self._thread = LoopThread("groot2", self._sockets, self._begin, self._end)

    def show(self, tree: Tree) -> None:
        """Serve ``tree`` from now on. A client sees by the UUID that it is new."""
        before = self._shown
        # a hook reports on the tick thread
        hooks = Hooks(tree, partial(self._thread.call, self._publish),
                      partial(self._thread.call, self._tell), self._held)
        self._shown = _Shown(tree, self._specs, hooks)
        if before is not None:
            before.hooks.remove_all(": another mission follows")

    def close(self) -> None:
        """Close the sockets and let every breakpoint go on."""
        self._is_closed = True
        self._thread.close()

    # -------------------------------------------------------------------- on the publisher's thread

    def _begin(self) -> None:
        self._context = zmq.asyncio.Context()
        self._context.set(ZERO_COPY_RECV, 0)
        self._requests, self._news = self._context.socket(zmq.ROUTER), self._context.socket(zmq.PUB)
        self._requests.setsockopt(zmq.SNDHWM, MOST_QUEUED)
        self._requests.setsockopt(zmq.RCVHWM, MOST_QUEUED)
        self._front = Front(self._requests, MOST_REQUEST)
        self._front.add_sockets(self._sockets[0])
        Front(self._news, MOST_SUBSCRIPTIONS).add_sockets(self._sockets[1])
        # without the check for a client that is gone, no breakpoint may hold the robot
        self._tasks = list(map(asyncio.ensure_future, (self._serve(), self._check_clients())))
        for task in self._tasks:
            task.add_done_callback(self._served)

    def _served(self, task: "asyncio.Task[None]") -> None:
        """End if serving ended by an error, which asyncio would print with its traceback."""
        if not task.cancelled():
            error = task.exception()
            self._warn(f"Groot2: internal error ({type(error).__name__}: {error})")
            asyncio.get_event_loop().stop()

    def _end(self) -> None:
        self._context.destroy(0)
        if self._shown is not None:
            self._shown.hooks.remove_all()
        if not self._is_closed:
            self._warn("Groot2 is cut off by an internal error; its breakpoints and replacements "
                       "are removed")

    def _tell(self, text: str) -> None:
        """Send the operator a line about hooks, which a client may change a thousand times a
        second; of those that are too many only that there are more."""
        now = time.monotonic()
        if now - self._second_began >= 1.0:
            self._second_began, self._lines = now, 0
        self._lines += 1
        if self._lines <= MOST_LINES:
            self._warn(text)
        elif self._lines == MOST_LINES + 1:
            self._warn("Groot2: more changes of breakpoints and replacements within this second")

    def _publish(self, uid: int) -> None:
        """Announce to the client that a breakpoint was reached."""
        header = struct.pack("<BBI", PROTOCOL, ord("N"), int.from_bytes(os.urandom(4), "little"))
        self._news.send_multipart([header, str(uid).encode()])

    async def _serve(self) -> None:
        """Answer requests one by one, at a limited rate; the parts before the empty one are the
        sender's address, which begins with its connection."""
        while True:
            parts = await self._requests.recv_multipart()
            self._front.note_request(parts[0])
            if b"" in parts[:-1]:
                start = parts.index(b"") + 1
                answer = self._answer(parts[start:], parts[0])
                await self._requests.send_multipart(parts[:start] + answer)
            await asyncio.sleep(PACE)

    async def _check_clients(self) -> None:
        """Remove the hooks of a client that is gone, also while others ask: they must not hold the
        robot."""
        while True:
            await asyncio.sleep(HEARTBEAT / 10)
            if self._shown is not None:
                self._shown.hooks.remove_all(
                    ": its client is gone",
                    lambda client: self._front.silence(client) >= HEARTBEAT)

    def _answer(self, frames: List[bytes], client: bytes) -> List[bytes]:
        """Return the reply to one request, valid or not."""
        try:
            return self._reply(frames, client, self._shown)
        # what a client sends, or a value of the mission, must not end the service
        except Exception as error:
            kind = "" if isinstance(error, Refused) else f"{type(error).__name__}: "
            return [b"error", f"{kind}{error}".encode("utf-8", "replace")]

    def _reply(self, frames: List[bytes], client: bytes,
               shown: "Optional[_Shown]") -> List[bytes]:
        if len(frames[0]) != 6:
            raise Refused("wrong request header")
        if shown is None:
            raise Refused("no tree yet")
        _, kind, number = struct.unpack("<BBI", frames[0])
        if chr(kind) not in _COMMANDS:
            raise Refused("Request not recognized")
        shown.client = client
        payload = _COMMANDS[chr(kind)](shown, frames)
        header = struct.pack("<BBI", PROTOCOL, kind, number) + shown.uuid
        return [header] if payload is None else [header, payload]


class _Shown:
    """One tree as Groot2 sees it: the status of each node, transitions, blackboards, hooks."""

    def __init__(self, tree: Tree, specs: Sequence[NodeSpec], hooks: Hooks):
        self.tree = tree
        self.uuid = uuid.uuid4().bytes
        self.hooks = hooks
        self.client = b""  # whose request is carried out
        # as in the library: grouped by subtree instance, in the order in which these were made
        instances = [id(board) for board in tree.blackboards.values()]
        self._nodes = sorted(tree.nodes, key=lambda node: instances.index(id(node.blackboard)))
        self._specs = specs
        self._xml = b""
        self._transitions: Deque[Tuple[int, int, int]] = collections.deque(maxlen=MOST_TRANSITIONS)
        self._recording_since: Optional[float] = None
        tree.follow(self._follow)

    def _follow(self, is_first: Optional[bool], changes: List[Change]) -> None:
        """Note the transitions. Called on the tick thread."""
        if self._recording_since is not None:
            moment = int(1e6 * (time.monotonic() - self._recording_since))
            self._transitions.extend((moment, node.uid, NUMBERS[new]) for node, _, new in changes)

    # ------------------------------------------------------------------------------------- requests

    def full_tree(self, frames: List[bytes]) -> bytes:
        """``T``: the unfolded tree and the model of all node types, as XML."""
        if not self._xml:
            self._xml = full_tree(self.tree, self._specs)
        return self._xml

    def status(self, frames: List[bytes]) -> bytes:
        """``S``: uid and status of each node, grouped by subtree instance."""
        return b"".join(struct.pack("<HB", node.uid, _code(node)) for node in self._nodes)

    def blackboard(self, frames: List[bytes]) -> bytes:
        """``B``: the entries of the named subtree instances, and the root's if another one is
        named."""
        boards = dict(self.tree.blackboards)
        boards[self.tree.id] = boards.pop("")
        names = _second(frames).decode().split(";")
        wanted = {name: boards[name] for name in names if name in boards}
        if any(board.parent is not None for board in wanted.values()):
            wanted["ROOT"] = boards[self.tree.id]
        shown = {name: _entries(board) or None for name, board in sorted(wanted.items())}
        return msgspec.msgpack.encode(shown or None)

    def insert_hooks(self, frames: List[bytes]) -> None:
        """``I``: one hook or an array of them; if one is wrong, none is set."""
        given = _read(frames, Union[Hook, List[Hook]])
        self.hooks.insert(given if isinstance(given, list) else [given], self.client)

    def remove_hook(self, frames: List[bytes]) -> None:
        """``R``: the hook of a node and position."""
        if not self.hooks.remove(_read(frames, HookPlace)):
            raise Refused("Node ID not found")

    def unlock(self, frames: List[bytes]) -> None:
        """``U``: a breakpoint may go on."""
        if not self.hooks.unlock(_read(frames, Unlocking)):
            raise Refused("Node ID not found")

    def dump_hooks(self, frames: List[bytes]) -> bytes:
        """``D``: all hooks as JSON."""
        hooks = msgspec.to_builtins(self.hooks.all())
        return msgspec.json.encode([dict(sorted(hook.items())) for hook in hooks])

    def record(self, frames: List[bytes]) -> Optional[bytes]:
        """``r``: start or stop recording transitions; a start is answered with the time in
        microseconds."""
        if _second(frames) == b"start":
            self._transitions.clear()
            self._recording_since = time.monotonic()
            return str(int(1e6 * time.time())).encode()
        self._recording_since = None
        return None

    def transitions(self, frames: List[bytes]) -> bytes:
        """``t``: the transitions since the last time."""
        waiting = [self._transitions.popleft() for _ in range(len(self._transitions))]
        return b"".join(struct.pack("<Q", when)[:6] + struct.pack("<HB", uid, code)
                        for when, uid, code in waiting)


_COMMANDS: Dict[str, Callable[[_Shown, List[bytes]], Optional[bytes]]] = {
    "T": _Shown.full_tree, "S": _Shown.status, "B": _Shown.blackboard, "I": _Shown.insert_hooks,
    "R": _Shown.remove_hook, "U": _Shown.unlock, "D": _Shown.dump_hooks, "r": _Shown.record,
    "t": _Shown.transitions,
    "A": lambda shown, frames: shown.hooks.remove_all(),
    "X": lambda shown, frames: shown.hooks.disable_all()}  # they stay in the list


def _second(frames: List[bytes]) -> bytes:
    if len(frames) != 2:
        raise Refused("must be 2 parts message")
    return frames[1]


def _read(frames: List[bytes], kind: Any) -> Any:
    try:
        return msgspec.json.decode(_second(frames), type=kind)
    except msgspec.ValidationError as error:
        raise Refused(f"{error}; allowed: {ALLOWED}")


# ----------------------------------------------------------------------------------------- the tree


def _code(node: Node) -> int:
    """Return the code of a node's status, or of what it was before it went back to IDLE."""
    return NUMBERS[node.status] or (WAS + NUMBERS[node.was] if node.was is not IDLE else 0)


def full_tree(tree: Tree, specs: Sequence[NodeSpec]) -> bytes:
    """Return the tree as Groot2 reads it: a ``<BehaviorTree>`` for each subtree instance, then the
    model."""
    document = ElementTree.Element("root", BTCPP_format="4")
    paths = {id(board): path for path, board in tree.blackboards.items()}
    elements: List[ElementTree.Element] = []
    for node in tree.nodes:
        parent, path = node.parent, paths[id(node.blackboard)]
        if parent is None or parent.registration_id == "SubTree":
            name = tree.id if parent is None else parent.attributes["ID"]
            above = ElementTree.SubElement(document, "BehaviorTree", ID=name, _fullpath=path)
        else:
            above = elements[parent.uid - 1]
        elements.append(ElementTree.SubElement(above, node.registration_id, _shown(node, paths)))
    document.append(ElementTree.fromstring(tree_nodes_model(specs)))
    return ElementTree.tostring(document, "utf-8")


def _shown(node: Node, paths: Dict[int, str]) -> Dict[str, str]:
    """Return the attributes of a node's element."""
    shown, names = {"name": node.name}, {port.name for port in node.spec.ports}
    if node.registration_id == "SubTree":
        shown = {"ID": node.attributes["ID"], "_fullpath": paths[id(node.children[0].blackboard)]}
        names = {key for key in node.attributes if key not in ("ID", "name") and key[:1] != "_"}
    given = {key: text for key, text in node.attributes.items()
             if key in names or key in CONDITIONS}
    return {**shown, "_uid": str(node.uid), **given}


# ----------------------------------------------------------------------------------- the blackboard

def _entries(board: Blackboard) -> Dict[str, Any]:
    """Return the entries of one blackboard that have a value that can be shown, in order as the
    library has them."""
    values = {key: _plain(entry.value) for key, entry in sorted(dict(board.local).items())}
    return {key: value for key, value in values.items() if value is not None}


def _plain(value: Any) -> Any:
    """Return a value as numbers, texts, lists and objects, or None if it is none of these."""
    if isinstance(value, float) and ctypes.c_float(value).value == value:
        # as the library writes reals: in four bytes where that loses nothing
        return msgspec.Raw(struct.pack(">Bf", 0xca, value))
    if isinstance(value, (bool, int, float, str)):
        return value
    if hasattr(value, "_asdict"):  # the mission's own records: places, points
        return {key: _plain(item) for key, item in sorted(value._asdict().items())}
    if isinstance(value, (list, tuple)):
        return list(map(_plain, value))
    return None
