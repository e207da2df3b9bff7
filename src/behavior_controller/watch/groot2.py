"""Groot2's publisher: lets Groot2 see the running tree, its blackboards and transitions, and stop at breakpoints.

Speaks the protocol of BehaviorTree.CPP's ``Groot2Publisher`` (the project's notes: groot2_protocol) over two ZeroMQ
sockets, which one thread owns. The tick thread only notes each change of a status, at next to no cost.
"""
import collections
import json
import os
import socket
import struct
import threading
import time
import uuid
from typing import Any, Callable, Deque, Dict, List, Optional, Sequence, Tuple
from xml.sax.saxutils import quoteattr

import msgpack
import zmq

from behavior_controller.bt.checking.checks import CONDITIONS
from behavior_controller.bt.checking.palette import tree_nodes_model
from behavior_controller.bt.engine.node import Node
from behavior_controller.bt.engine.tree import Tree
from behavior_controller.bt.language.blackboard import Blackboard
from behavior_controller.bt.registry import NodeSpec
from behavior_controller.bt.status import FAILURE, IDLE, RUNNING, SUCCESS
from behavior_controller.watch.hooks import Hook, Hooks

PROTOCOL = 2
CODES = {IDLE: 0, RUNNING: 1, SUCCESS: 2, FAILURE: 3}
WAS = 10
"""Added to the code of what a node was before it went back to IDLE, for a monitor that comes too late to see it."""

MOST_TRANSITIONS = 1000
HEARTBEAT = 5.0
"""Seconds without a request after which the client counts as gone: its breakpoints must not hold the robot."""

MOST_BYTES = 1024 * 1024
"""A longer message is no request."""

PACE = 0.001
"""Seconds between requests that follow each other at once: a client that floods must not slow the mission."""


class Refused(Exception):
    """A request that cannot be carried out; the text goes back to the client."""


class Groot2Publisher:
    """Serves one tree after another at ``address``, ``port`` (requests) and ``port + 1`` (breakpoints reached)."""

    def __init__(self, address: str, port: int, specs: Sequence[NodeSpec], warn: Callable[[str], None],
                 heartbeat: float = HEARTBEAT):
        """Open the sockets; a port that is taken is told to ``warn`` in one line, and nobody is served.

        ``specs`` are all registered node types.
        """
        self._specs = specs
        self._shown: Optional[_Shown] = None
        self._heartbeat = heartbeat
        self._lock = threading.Lock()
        self._reached: Deque[int] = collections.deque()
        self._bell, self._rung = socket.socketpair()
        self._bell.setblocking(False)
        self._closed = False
        self._context = zmq.Context()
        self._server, self._publisher = self._context.socket(zmq.REP), self._context.socket(zmq.PUB)
        self._thread: Optional[threading.Thread] = None
        try:
            for sock, number in ((self._server, port), (self._publisher, port + 1)):
                sock.setsockopt(zmq.LINGER, 0)
                sock.setsockopt(zmq.MAXMSGSIZE, MOST_BYTES)
                sock.bind("tcp://{}:{}".format(address, number))
        except zmq.ZMQError as error:
            self._context.destroy(0)
            warn("Groot2 cannot connect: {}:{} cannot be opened ({}); set groot2Port to another port, or to 0".format(
                address, number, error.strerror))
            return
        self._thread = threading.Thread(target=self._serve, name="groot2", daemon=True)
        self._thread.start()

    def show(self, tree: Tree) -> None:
        """Serve ``tree`` from now on. A client sees by the UUID that it is new."""
        shown = _Shown(tree, self._specs, self._tell_reached)
        with self._lock:
            before, self._shown = self._shown, shown
        if before is not None:
            before.hooks.remove_all()

    def close(self) -> None:
        """Close the sockets and let every breakpoint go on."""
        self._closed = True
        self._ring()
        if self._thread is not None:
            self._thread.join(1.0)

    def _tell_reached(self, uid: int) -> None:
        """Have the sockets' thread announce a breakpoint. Called on the tick thread."""
        self._reached.append(uid)
        self._ring()

    def _ring(self) -> None:
        try:
            self._bell.send(b"!")
        except OSError:
            pass  # it rings already

    # ----------------------------------------------------------------------------------------------- the sockets' thread

    def _serve(self) -> None:
        poller = zmq.Poller()
        poller.register(self._server, zmq.POLLIN)
        poller.register(self._rung, zmq.POLLIN)
        last = time.monotonic()
        while not self._closed:
            shown = self._shown
            has_hooks = shown is not None and bool(shown.hooks) and not shown.is_deserted
            events = dict(poller.poll(1000 * self._heartbeat if has_hooks else None))
            if self._rung.fileno() in events:
                self._rung.recv(4096)
                self._announce()
            if self._server in events:
                now = time.monotonic()
                if now - last < PACE:
                    time.sleep(PACE)
                last = time.monotonic()
                self._answer()
            elif has_hooks and time.monotonic() - last >= self._heartbeat:
                shown.desert()
        if self._shown is not None:
            self._shown.hooks.remove_all()
        self._context.destroy(0)

    def _announce(self) -> None:
        """Publish the breakpoints that were reached."""
        while self._reached:
            header = struct.pack("<BBI", PROTOCOL, ord("N"), int.from_bytes(os.urandom(4), "little"))
            self._publisher.send_multipart([header, str(self._reached.popleft()).encode()])

    def _answer(self) -> None:
        """Receive one request and reply to it, whatever it is."""
        frames = self._server.recv_multipart()
        with self._lock:
            shown = self._shown
        try:
            reply = self._reply(frames, shown)
        except Refused as refused:
            reply = [b"error", str(refused).encode("utf-8", "replace")]
        except Exception as error:  # what a client sends, or a value of the mission, must not end this thread
            reply = [b"error", "{}: {}".format(type(error).__name__, error).encode("utf-8", "replace")]
        self._server.send_multipart(reply)

    def _reply(self, frames: List[bytes], shown: "Optional[_Shown]") -> List[bytes]:
        if len(frames[0]) != 6:
            raise Refused("wrong request header")
        if shown is None:
            raise Refused("no tree yet")
        _, kind, number = struct.unpack("<BBI", frames[0])
        command = _COMMANDS.get(chr(kind))
        if command is None:
            raise Refused("Request not recognized")
        shown.welcome()
        payload = command(shown, frames)
        header = struct.pack("<BBI", PROTOCOL, kind, number) + shown.uuid
        return [header] if payload is None else [header, payload]


class _Shown:
    """One tree as Groot2 sees it: the status of each node, transitions, blackboards, hooks."""

    def __init__(self, tree: Tree, specs: Sequence[NodeSpec], reached: Callable[[int], None]):
        self.tree = tree
        self.uuid = uuid.uuid4().bytes
        self.hooks = Hooks(tree, reached)
        self._order = _by_instance(tree)
        self._statuses = bytearray(len(tree.nodes) + 1)
        self._specs = specs
        self._xml = b""
        self._transitions: Deque[Tuple[int, int, int]] = collections.deque(maxlen=MOST_TRANSITIONS)
        self._recording_since: Optional[float] = None
        self.is_deserted = False
        tree.subscribe(self._observe)

    def _observe(self, node: Any, old: Any, new: Any) -> None:
        """Note a change. Called on the tick thread."""
        code = CODES[new]
        self._statuses[node.uid] = code or WAS + CODES[old]
        if self._recording_since is not None:
            self._transitions.append((int(1e6 * (time.monotonic() - self._recording_since)), node.uid, code))

    def desert(self) -> None:
        """Let the hooks rest: the client seems to be gone."""
        self.is_deserted = True
        self.hooks.enable(False)

    def welcome(self) -> None:
        """Enable the hooks again if the client seemed to be gone."""
        if self.is_deserted:
            self.is_deserted = False
            self.hooks.enable(True)

    # ----------------------------------------------------------------------------------------------------- requests

    def full_tree(self, frames: List[bytes]) -> bytes:
        """``T``: the unfolded tree and the model of all node types, as XML."""
        if not self._xml:
            self._xml = full_tree(self.tree, self._specs).encode()
        return self._xml

    def status(self, frames: List[bytes]) -> bytes:
        """``S``: uid and status of each node, grouped by subtree instance."""
        statuses = self._statuses
        return b"".join(struct.pack("<HB", uid, statuses[uid]) for uid in self._order)

    def blackboard(self, frames: List[bytes]) -> bytes:
        """``B``: the entries of the named subtree instances; with the root's if another is asked for."""
        boards = dict(self.tree.blackboards)
        boards[self.tree.id] = boards.pop("")
        wanted = {name: boards[name] for name in _second(frames).decode().split(";") if name in boards}
        if any(board.parent is not None for board in wanted.values()):
            wanted["ROOT"] = boards[self.tree.id]
        return pack({name: _entries(board) or None for name, board in wanted.items()} or None)

    def insert_hooks(self, frames: List[bytes]) -> None:
        """``I``: one hook or an array of them."""
        given = _json(frames)
        for fields in given if isinstance(given, list) else [given]:
            self.hooks.insert(Hook(fields["uid"], fields["position"], fields["mode"], fields["once"],
                                   fields["enabled"], fields["desired_status"]))

    def remove_hook(self, frames: List[bytes]) -> None:
        """``R``: the hook of a node and position."""
        fields = _json(frames)
        if not self.hooks.remove(fields["position"], fields["uid"]):
            raise Refused("Node ID not found")

    def unlock(self, frames: List[bytes]) -> None:
        """``U``: a breakpoint may go on."""
        fields = _json(frames)
        if not self.hooks.unlock(fields["position"], fields["uid"], fields["desired_status"],
                                 fields["remove_when_done"]):
            raise Refused("Node ID not found")

    def dump_hooks(self, frames: List[bytes]) -> bytes:
        """``D``: all hooks as JSON."""
        return json.dumps([hook.as_dict() for hook in self.hooks.all()], separators=(",", ":")).encode()

    def remove_hooks(self, frames: List[bytes]) -> None:
        """``A``: no hook any more."""
        self.hooks.remove_all()

    def disable_hooks(self, frames: List[bytes]) -> None:
        """``X``: every hook stays, but does nothing."""
        self.hooks.enable(False)

    def record(self, frames: List[bytes]) -> Optional[bytes]:
        """``r``: start or stop recording transitions; a start is answered with the time in microseconds."""
        if _second(frames) == b"start":
            self._transitions.clear()
            self._recording_since = time.monotonic()
            return str(int(1e6 * time.time())).encode()
        self._recording_since = None
        return None

    def transitions(self, frames: List[bytes]) -> bytes:
        """``t``: the transitions since the last time."""
        taken = []
        while self._transitions:
            when, uid, code = self._transitions.popleft()
            taken.append(struct.pack("<Q", when)[:6] + struct.pack("<HB", uid, code))
        return b"".join(taken)


_COMMANDS: Dict[str, Callable[[_Shown, List[bytes]], Optional[bytes]]] = {
    "T": _Shown.full_tree, "S": _Shown.status, "B": _Shown.blackboard, "I": _Shown.insert_hooks,
    "R": _Shown.remove_hook, "U": _Shown.unlock, "D": _Shown.dump_hooks, "A": _Shown.remove_hooks,
    "X": _Shown.disable_hooks, "r": _Shown.record, "t": _Shown.transitions}


def _second(frames: List[bytes]) -> bytes:
    if len(frames) != 2:
        raise Refused("must be 2 parts message")
    return frames[1]


def _json(frames: List[bytes]) -> Any:
    try:
        return json.loads(_second(frames).decode())
    except ValueError as error:
        raise Refused("not JSON: {}".format(error))


# ------------------------------------------------------------------------------------------------------------- the tree


def _by_instance(tree: Tree) -> List[int]:
    """Return the uids grouped by subtree instance, in the order in which the instances were made."""
    groups: Dict[int, List[int]] = {id(board): [] for board in tree.blackboards.values()}
    for node in tree.nodes:
        groups[id(node.blackboard)].append(node.uid)
    return [uid for uids in groups.values() for uid in uids]


def full_tree(tree: Tree, specs: Sequence[NodeSpec]) -> str:
    """Return the tree as Groot2 reads it: a ``<BehaviorTree>`` for each subtree instance, then the model."""
    lines = ['<root BTCPP_format="4">']
    inside = {id(node.children[0].blackboard): node for node in tree.nodes if node.registration_id == "SubTree"}
    for path, board in tree.blackboards.items():
        subtree = inside.get(id(board))
        name = tree.id if subtree is None else subtree.attributes["ID"]
        lines.append("  <BehaviorTree ID={} _fullpath={}>".format(quoteattr(name), quoteattr(path)))
        root = tree.root if subtree is None else subtree.children[0]
        lines.extend("    " + line for line in _element(root, inside, tree))
        lines.append("  </BehaviorTree>")
    return "\n".join(lines + [tree_nodes_model(specs, "  "), "</root>"])


def _element(node: Node, inside: Dict[int, Node], tree: Tree) -> List[str]:
    """Return the lines of one node and those below it, down to the SubTrees."""
    if node.registration_id == "SubTree":
        board = node.children[0].blackboard
        path = next(path for path, other in tree.blackboards.items() if other is board)
        shown = {"ID": node.attributes["ID"], "_fullpath": path, "_uid": str(node.uid)}
        shown.update((key, text) for key, text in node.attributes.items() if key in CONDITIONS or (
            key not in ("ID", "name") and key[:1] != "_"))
        children: List[Node] = []
    else:
        shown = {"name": node.name, "_uid": str(node.uid)}
        ports = {port.name for port in node.ports}
        shown.update((key, text) for key, text in node.attributes.items() if key in CONDITIONS or key in ports)
        children = node.children
    start = "<{} {}".format(node.registration_id, " ".join(
        "{}={}".format(key, quoteattr(text)) for key, text in shown.items()))
    if not children:
        return [start + "/>"]
    lines = ["  " + line for child in children for line in _element(child, inside, tree)]
    return [start + ">"] + lines + ["</{}>".format(node.registration_id)]


# ------------------------------------------------------------------------------------------------------- the blackboard

_single, _double = msgpack.Packer(use_single_float=True), msgpack.Packer()


def pack(value: Any) -> bytes:
    """Return MessagePack as the library writes it: keys in order, and reals in four bytes where that loses nothing."""
    if isinstance(value, dict):
        return _double.pack_map_header(len(value)) + b"".join(
            _double.pack(key) + pack(value[key]) for key in sorted(value))
    if isinstance(value, list):
        return _double.pack_array_header(len(value)) + b"".join(pack(item) for item in value)
    if isinstance(value, float) and _fits_single(value):
        return _single.pack(value)
    return _double.pack(value)


def _fits_single(value: float) -> bool:
    try:
        return struct.unpack("<f", struct.pack("<f", value))[0] == value
    except OverflowError:
        return False


def _entries(board: Blackboard) -> Dict[str, Any]:
    """Return the entries of one blackboard that have a value that can be shown."""
    values = {key: _plain(entry.value) for key, entry in dict(board.local).items()}
    return {key: value for key, value in values.items() if value is not None}


def _plain(value: Any) -> Any:
    """Return a value as numbers, texts, lists and objects, or None if it is none of these."""
    if isinstance(value, (bool, int, float, str)):
        return value
    if hasattr(value, "_asdict"):  # the mission's own records: exhibits, places, points
        return {key: _plain(item) for key, item in value._asdict().items()}
    if isinstance(value, (list, tuple)):
        return [_plain(item) for item in value]
    return None
