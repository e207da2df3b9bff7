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
from typing import Any, Callable, Deque, Dict, List, Optional, Tuple, Union

import msgspec

from behavior_controller.run.events import (
    LETTERS, BreakpointChanged, HookEnded, Letter, Line, Tick, TreeShown, unix_now)
from behavior_controller.run.fold import fold
from behavior_controller.run.from_viewer import ALLOWED, Hook, HookChange, HookPlace, Unlocking
from behavior_controller.run.state import State
from behavior_controller.viewer.hook_list import HookList
from behavior_controller.viewer.server import LoopThread, opened
from behavior_controller.viewer.zmtp import Peer, ZmtpServer

PROTOCOL = 2
CODES: Dict[Letter, int] = {letter: number for number, letter in enumerate(LETTERS.values())}
"""The statuses as BehaviorTree.CPP numbers them."""

WAS = 10
"""Added to the code of the status that a node had before IDLE, for a monitor that polls too late to
see it."""

MOST_TRANSITIONS = 1000
CLIENT_SILENCE = 5.0
"""Seconds without a request after which a client, which is one connection, counts as gone: its
breakpoints must not hold the robot."""

LONGEST_REQUEST = 32_768
"""The most bytes of a request."""


class Refused(ValueError):
    """A request that cannot be carried out; the text goes back to the client."""


class Groot2Publisher:
    """Serves one tree after another at ``address``, ``port`` (requests) and ``port + 1``
    (breakpoints reached)."""

    def __init__(self, address: str, port: int, warn: Callable[[str], None],
                 send: Optional[Callable[[HookChange], None]] = None, attempts: int = 1):
        """Open the sockets, of later ports as ``opened`` says; if a port is taken, ``warn`` gets
        one line and nothing is served; with port 0, nothing is served either.

        ``send`` gets each change of a hook, on the publisher's thread; without it the tree is that
        of a record, and hooks are refused.
        """
        self._warn, self._send = warn, send
        self._state = State()
        self._shown: Optional[_Shown] = None
        self._is_closed = False
        # of the requests, and of the breakpoints reached
        self._sockets = opened(address, [each for each in (port, port + 1) if port],
                               "Groot2 cannot connect", "groot2Port", warn, attempts)
        self._thread = LoopThread("groot2", self._sockets, self._begin, self._end)
        self.is_served, self.port = self._thread.is_serving, self._thread.port

    def take(self, line: Line) -> None:
        """Take the next event. Any thread may call this."""
        self._thread.call(self._fold, line)

    def close(self) -> None:
        """Close the sockets."""
        self._is_closed = True
        self._thread.close()

    # -------------------------------------------------------------------- on the publisher's thread

    def _fold(self, line: Line) -> None:
        event = line.event
        self._state = fold(self._state, line.time, event)
        if isinstance(event, TreeShown):
            number = self._shown.hooks.next_number if self._shown is not None else 1
            self._shown = _Shown(self._state, HookList(event, self._send or _refuse, number))
        elif self._shown is not None:
            self._shown.take(self._state, line)
        if isinstance(event, BreakpointChanged) and event.is_held:
            self._publish(event.uid)

    def _begin(self) -> None:
        requests = ZmtpServer(b"ROUTER", LONGEST_REQUEST, self._serve, self._served)
        self._news = ZmtpServer(b"PUB", LONGEST_REQUEST, self._subscribe, self._served)
        for server, sockets in zip((requests, self._news), self._sockets):
            server.add_sockets(sockets)
        # without the check for a client that is gone, no breakpoint may hold the robot
        self._check = asyncio.ensure_future(self._check_clients())
        self._check.add_done_callback(self._served)

    def _served(self, task: "asyncio.Task[None]") -> None:
        """End if serving ended by an error, which asyncio would print with its traceback."""
        if not task.cancelled() and task.exception() is not None:
            error = task.exception()
            self._warn(f"Groot2: internal error ({type(error).__name__}: {error})")
            asyncio.get_event_loop().stop()

    def _end(self) -> None:
        if self._shown is not None:
            self._shown.hooks.remove_all()
        if not self._is_closed:
            self._warn("Groot2 is cut off by an internal error; its breakpoints and replacements "
                       "are removed")

    def _publish(self, uid: int) -> None:
        """Announce to the clients that a breakpoint was reached; not to one that does not read."""
        header = struct.pack("<BBI", PROTOCOL, ord("N"), int.from_bytes(os.urandom(4), "little"))
        for peer in self._news.peers:
            peer.offer(header, str(uid).encode())

    async def _subscribe(self, peer: Peer, frames: List[bytes]) -> None:
        """Do nothing: every client gets all news, and leaves out what it does not want."""

    async def _serve(self, peer: Peer, frames: List[bytes]) -> None:
        """Answer a request, whose sender's address ends with an empty frame."""
        if b"" in frames[:-1]:
            start = frames.index(b"") + 1
            await peer.send(*frames[:start], *self._answer(frames[start:], peer))

    async def _check_clients(self) -> None:
        """Remove the hooks of a client that is gone, also while others ask: they must not hold the
        robot."""
        while True:
            await asyncio.sleep(CLIENT_SILENCE / 10)
            if self._shown is not None:
                self._shown.hooks.remove_all(
                    ": its client is gone",
                    lambda client: client is None or client.silence >= CLIENT_SILENCE)

    def _answer(self, frames: List[bytes], client: Peer) -> List[bytes]:
        """Return the reply to one request, valid or not."""
        try:
            return self._reply(frames, client, self._shown)
        except Refused as error:
            text = str(error)
        # what a client sends, or a value of the mission, must not end the service
        except Exception as error:
            text = f"{type(error).__name__}: {error}"
        return [b"error", text.encode("utf-8", "replace")]

    def _reply(self, frames: List[bytes], client: Peer, shown: "Optional[_Shown]") -> List[bytes]:
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
        if payload is None:
            return [header]
        return [header, payload]


def _refuse(change: HookChange) -> None:
    raise Refused("this is a record: its nodes cannot be changed")


class _Shown:
    """One tree as Groot2 sees it: the status of each node, transitions, blackboards, hooks."""

    def __init__(self, state: State, hooks: HookList):
        self.uuid = uuid.uuid4().bytes
        self.hooks = hooks
        self.client: Optional[Peer] = None  # whose request is carried out
        self._state = state
        # as in the library: grouped by subtree instance, in the order in which these were made
        tree = state.tree
        self._uids = sorted(range(1, len(tree.nodes) + 1),
                            key=lambda uid: tree.subtrees.index(tree.nodes[uid - 1].subtree))
        self._transitions: Deque[Tuple[int, int, int]] = collections.deque(maxlen=MOST_TRANSITIONS)
        self._recording_since: Optional[float] = None

    def take(self, state: State, line: Line) -> None:
        """Note the next event, and what is so after it."""
        self._state, event = state, line.event
        if isinstance(event, HookEnded):
            self.hooks.end(event)
        elif isinstance(event, Tick) and self._recording_since is not None:
            moment = max(0, int(1e6 * (line.time - self._recording_since)))
            self._transitions.extend((moment, uid, CODES[new]) for uid, new in event.changes)

    # ------------------------------------------------------------------------------------- requests

    def full_tree(self, frames: List[bytes]) -> bytes:
        """``T``: the unfolded tree and the model of all node types, as XML."""
        return _DECLARATION + self._state.tree.xml.encode("utf-8", "xmlcharrefreplace")

    def status(self, frames: List[bytes]) -> bytes:
        """``S``: uid and status of each node, grouped by subtree instance."""
        letters = self._state.letters
        return b"".join(struct.pack("<HB", uid, _code(letters[uid - 1])) for uid in self._uids)

    def blackboard(self, frames: List[bytes]) -> bytes:
        """``B``: the entries of the named subtree instances, and the root's if another one is
        named."""
        tree = self._state.tree
        known = {path or tree.id: path for path in tree.subtrees}
        names = _second(frames).decode().split(";")
        wanted = {name: known[name] for name in names if name in known}
        if any(wanted.values()):
            wanted["ROOT"] = ""
        shown = {name: self._entries(path) or None for name, path in sorted(wanted.items())}
        return msgspec.msgpack.encode(shown or None)

    def _entries(self, subtree: str) -> Dict[str, Any]:
        """Return the entries of one blackboard that have a value that can be shown, in order as the
        library has them."""
        prefix = subtree and subtree + "/"
        inner = tuple(path + "/" for path in self._state.tree.subtrees
                      if path and path != subtree and path.startswith(prefix))
        return {name[len(prefix):]: _short(value)
                for name, value in sorted(self._state.values.items())
                if name.startswith(prefix) and not name.startswith(inner)}

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
            self._recording_since = unix_now()
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


_DECLARATION = b"<?xml version='1.0' encoding='utf-8'?>\n"


def _code(letter: str) -> int:
    """Return the code of a node's status, or of what it was before it went back to IDLE."""
    for status, number in CODES.items():
        if letter in (status, status.lower()):
            return number + WAS * (letter != status)
    return 0


def _short(value: Any) -> Any:
    """Return a value with its reals as the library writes them: in four bytes where that loses
    nothing."""
    if isinstance(value, float) and ctypes.c_float(value).value == value:
        return msgspec.Raw(struct.pack(">Bf", 0xca, value))
    if isinstance(value, dict):
        return {key: _short(item) for key, item in value.items()}
    return list(map(_short, value)) if isinstance(value, list) else value
