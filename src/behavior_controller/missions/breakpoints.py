"""Groot2's hooks on the nodes of the running tree.

The rules are BehaviorTree.CPP's (``Monitor::Hook`` of its Groot2 publisher), with one difference: a
breakpoint of the library stops the ticking thread, ours stops the node, and everything else (stop,
deadlines, topics) goes on. Every hook that is set, acts, or is removed is reported to the operator:
a robot that stops at a hook must not look broken.

A viewer lists the hooks, and sends each change as a line. The changes are posted to the tick
thread, which alone sets hooks on nodes.
"""
import time
from typing import Any, Callable, Dict, Optional, Tuple

from behavior_controller.bt.engine.node import Node, NodeHook, Result
from behavior_controller.bt.engine.tree import Tree
from behavior_controller.bt.values.status import FAILURE, IDLE, NAMES, RUNNING, SUCCESS
from behavior_controller.run.events import BreakpointChanged, Event, HookEnded
from behavior_controller.run.from_viewer import (
    AFTER, BEFORE, BREAKPOINT, RELEASE, REMOVE, REPLACE, SET, Hook, HookChange)

_RESULTS: Dict[str, Result] = {"SUCCESS": SUCCESS, "FAILURE": FAILURE}
_KINDS = {BREAKPOINT: "breakpoint", REPLACE: "replacement"}
_PLACES = {BEFORE: "before", AFTER: "after"}

MOST_LINES_A_SECOND = 20
"""The most lines about hooks that the operator gets in a second."""


class Breakpoints:
    """The hooks of one tree after the other."""

    def __init__(self, emit: Callable[[Event], None], warn: Callable[[str], None]):
        """``emit`` gets an event when a breakpoint holds its node, when it lets it go on, and when
        a hook has removed itself; ``warn`` a line for the operator. Both are called on the tick
        thread, and must not block it."""
        self.emit, self._warn = emit, warn
        self._tree: Optional[Tree] = None
        self._count = 0  # of trees
        self._nodes: Dict[int, _NodeHooks] = {}  # by uid
        self._second_began, self._lines = 0.0, 0  # and the lines since

    def show(self, tree: Tree) -> None:
        """Let ``tree`` have the hooks from now on. On the tick thread."""
        self._remove_all(": another mission follows")
        self._tree = tree
        self._count += 1
        self._nodes = {node.uid: _NodeHooks(node, self) for node in tree.nodes}

    def change(self, change: HookChange) -> None:
        """Post a change to the tick thread and wake it. On any thread."""
        self._post(lambda: self._change(change))

    def remove_all(self, reason: str) -> None:
        """Remove every hook, and let every node go on; the operator gets the ``reason``. On any
        thread."""
        self._post(lambda: self._remove_all(reason))

    def _post(self, change: Callable[[], None]) -> None:
        tree = self._tree
        if tree is not None:
            tree.clock.post(change)
            tree.wake.emit()

    # --------------------------------------------------------------------------- on the tick thread

    def _change(self, change: HookChange) -> None:
        node = self._nodes.get(change.hook.uid)
        # else it was sent before the viewer knew of this tree
        if node is not None and change.tree == self._count:
            node.change(change)

    def _remove_all(self, reason: str) -> None:
        for node in self._nodes.values():
            node.remove_all(reason)

    def tell(self, text: str) -> None:
        """Send the operator a line about hooks, which a client may change a thousand times a
        second; of those that are too many only that there are more."""
        now = time.monotonic()
        if now - self._second_began >= 1.0:
            self._second_began, self._lines = now, 0
        self._lines += 1
        if self._lines <= MOST_LINES_A_SECOND:
            self._warn(text)
        elif self._lines == MOST_LINES_A_SECOND + 1:
            self._warn("Groot2: more changes of breakpoints and replacements within this second")


class _SetHook:
    """A hook that is set on a node, and its state."""

    def __init__(self, change: HookChange):
        """It is as the last ``change`` wants it."""
        self.hook, self.number = change.hook, change.number
        self.is_unlocked = False  # a breakpoint that was reached
        self.is_reported = False  # the operator knows that it decides results


class _NodeHooks(NodeHook):
    """The hooks of one node, attached to it while there are any."""

    def __init__(self, node: Node, owner: Breakpoints):
        self._node, self._owner = node, owner
        self._set: Dict[int, _SetHook] = {}  # by position
        # while the node waits: the breakpoint, its status before, and its result if it was ticked
        self._held: Optional[Tuple[_SetHook, Any, Optional[Result]]] = None

    @property
    def is_holding(self) -> bool:  # type: ignore[override]
        """Whether the node waits at a breakpoint."""
        return self._held is not None

    def _report_hold(self, is_held: bool) -> None:
        self._owner.emit(BreakpointChanged(self._node.uid, self._node.full_path, is_held))

    def change(self, change: HookChange) -> None:
        """Set a hook at its place, let its breakpoint go on, or remove it."""
        hook, text = change.hook, change.text
        if change.what == REMOVE:
            self.remove(hook, text)
            return
        if change.what == SET:
            self._node.hook = self
            self._set.setdefault(hook.position, _SetHook(change)).is_reported = False
            text = "is set" if hook.mode == BREAKPOINT else "is set to " + hook.desired_status
            if not hook.enabled:
                text += ", but disabled"
        elif hook.position not in self._set:
            # it has removed itself already
            self._owner.emit(HookEnded(hook.uid, hook.position, change.number))
            return
        place = self._set[hook.position]
        place.hook, place.number = hook, change.number
        if change.what == RELEASE or not hook.enabled:
            place.is_unlocked = self._held is not None and self._held[0] is place
        self._tell(hook, text)

    def remove_all(self, reason: str) -> None:
        """Remove each hook, and let the node go on."""
        for place in list(self._set.values()):
            self.remove(place.hook, reason)

    def remove(self, hook: Hook, reason: str) -> None:
        """Remove the hook at the same place, and let the node go on."""
        if self._set.pop(hook.position, None) is not None:
            self._tell(hook, "is removed" + reason)
            self._leave()

    def _leave(self) -> None:
        """Detach from the node if no hook is left."""
        if not self._set and self._held is None:
            self._node.hook = None

    def _tell(self, hook: Hook, text: str) -> None:
        kind, where = _KINDS[hook.mode], _PLACES[hook.position]
        self._owner.tell(f"Groot2: {kind} {where} {self._node.full_path} {text}")

    def before(self, node: Node) -> Optional[Result]:
        """Return the result that replaces the node's tick, if any; its own result if it waits after
        its tick."""
        held, self._held = self._held, None
        if held is not None:
            place, status, result = held
            if place in self._set.values() and not place.is_unlocked:
                self._held = held
                return RUNNING
            self._report_hold(False)
            # it has not run yet, or has its result already: RUNNING was ours
            node.status = status
            if result is not None:
                return result
        return self._ask(node, BEFORE, None)

    def after(self, node: Node, result: Result) -> Result:
        """Return the node's result, or the one that a hook decides instead."""
        if result is SUCCESS or result is FAILURE:
            result = self._ask(node, AFTER, result) or result
        self._leave()
        return result

    def _ask(self, node: Node, position: int, result: Optional[Result]) -> Optional[Result]:
        """Return the result that a hook decides, if any; RUNNING for a breakpoint that waits."""
        place = self._set.get(position)
        if place is None or not (place.hook.enabled or place.is_unlocked):
            return None
        if place.hook.mode == BREAKPOINT and not place.is_unlocked:
            self._held = place, node.status, result
            self._report_hold(True)
            return RUNNING
        place.is_unlocked = False
        return self._decide(place, result)

    def _decide(self, place: _SetHook, result: Optional[Result]) -> Optional[Result]:
        """Return the hook's result, if any; a hook that acts once is then removed."""
        hook = place.hook
        decided = _RESULTS.get(hook.desired_status) if hook.enabled else None
        if decided is not None and not place.is_reported:
            place.is_reported = hook.mode == REPLACE  # once: it may decide at every tick
            own = "and the node is not run"
            if result is not None:
                own = f"instead of the node's {NAMES[result]}"
            self._tell(hook, f"decides {hook.desired_status} {own}")
        if hook.once:
            self._node.ask_for_tick()  # which may end otherwise
            del self._set[hook.position]
            self._owner.emit(HookEnded(hook.uid, hook.position, place.number))
            self._tell(hook, "is removed")
        return decided

    def halt(self, node: Node) -> bool:
        """Reset the hooks; return whether ``node`` has work to halt: at a breakpoint before it, it
        has none."""
        held, self._held = self._held, None
        for place in self._set.values():
            place.is_unlocked = False
        self._leave()
        if held is None:
            return True
        self._report_hold(False)
        return held[1:] != (IDLE, None)
