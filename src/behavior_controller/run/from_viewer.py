"""What a viewer sends to the controller, a line each: changes of Groot2's hooks, signs of life, and
lines for the operator.

A hook replaces a node's tick or its result; a breakpoint keeps its node RUNNING.
"""
from typing import Literal, Tuple, Union, get_args

import msgspec
from msgspec import Struct

BEFORE, AFTER = 0, 1
BREAKPOINT, REPLACE = 0, 1

Desired = Literal["SUCCESS", "FAILURE", "SKIPPED", "IDLE", "RUNNING"]
"""What ``desired_status`` may be; the last three have no influence."""

ALLOWED = ("position 0 (before the node) or 1 (after it), mode 0 (breakpoint) or 1 (replace), "
           "desired_status " + ", ".join(get_args(Desired)))


class HookPlace(Struct, frozen=True):
    """Where a hook is: at most one before each node, and one after it."""

    uid: int
    position: Literal[0, 1]

    @property
    def key(self) -> Tuple[int, int]:
        """What hooks are listed by."""
        return self.position, self.uid


class Hook(HookPlace, frozen=True):
    """One hook of one node."""

    mode: Literal[0, 1]
    once: bool
    enabled: bool
    desired_status: Desired


class Unlocking(HookPlace, frozen=True):
    """What lets a breakpoint go on."""

    desired_status: Desired
    remove_when_done: bool


Change = Literal["set", "release", "remove"]
SET: Change = "set"
RELEASE: Change = "release"
REMOVE: Change = "remove"


class HookChange(Struct, frozen=True, tag=True):
    """A change of a hook: ``what`` is ``SET`` (a new hook, or a changed one), ``RELEASE`` (its
    breakpoint lets the node go on) or ``REMOVE``.

    ``number`` counts the changes of a viewer from 1 on, and ``tree`` the trees of the controller.
    ``text`` is what the operator is told of it.
    """

    what: Change
    hook: Hook
    number: int
    tree: int
    text: str = ""


class ViewerAlive(Struct, frozen=True, tag=True):
    """The viewer goes on; it serves the page and Groot2 at these ports, 0: not."""

    page: int
    groot2: int


class ViewerTold(Struct, frozen=True, tag=True):
    """A warning for the operator."""

    text: str


FromViewer = Union[HookChange, ViewerAlive, ViewerTold]

_decoder = msgspec.json.Decoder(FromViewer)


def encode(sent: FromViewer) -> bytes:
    """Return a line with its end."""
    return msgspec.json.encode(sent) + b"\n"


def decode(line: bytes) -> FromViewer:
    """Return what a line says. Raises ValueError."""
    return _decoder.decode(line)
