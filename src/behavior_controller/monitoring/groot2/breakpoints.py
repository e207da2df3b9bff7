"""Groot2's hooks: they replace a node's tick or its result; a breakpoint keeps its node RUNNING.

The rules are BehaviorTree.CPP's (``Monitor::Hook`` of its Groot2 publisher), with one difference: a
breakpoint of the library stops the ticking thread, ours stops the node, and everything else (stop,
deadlines, topics) goes on. Every hook that is set, acts, or is removed is reported to the operator:
a robot that stops at a hook must not look broken.

A hook belongs to the client that set or changed it last, and is removed when that client is gone:
the library asks only whether any client is there. Any client may remove, disable or unlock it.

``Hooks`` is the list that clients change, on the publisher's thread. Each change is posted to the
tick thread, which alone sets hooks on nodes (``_NodeHooks``) and posts back those that have removed
themselves.
"""
import collections
import contextlib
from typing import Any, Callable, Deque, Dict, Iterable, List, Literal, Optional, Tuple, get_args

from msgspec import Struct
from msgspec.structs import replace

from behavior_controller.bt.engine.node import Node, NodeHook, Result
from behavior_controller.bt.engine.tree import Tree
from behavior_controller.bt.status import FAILURE, IDLE, NAMES, RUNNING, SUCCESS
from behavior_controller.execution.events import BreakpointChanged

BEFORE, AFTER = 0, 1
BREAKPOINT, REPLACE = 0, 1
_RESULTS: Dict[str, Result] = {"SUCCESS": SUCCESS, "FAILURE": FAILURE}

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


class Hooks:
    """All hooks of one tree as its clients know them. Any thread may change them; the nodes follow
    at the next tick."""

    def __init__(self, tree: Tree, reached: Callable[[int], None], tell: Callable[[str], None],
                 held: Callable[[BreakpointChanged], None]):
        """``reached`` gets the uid of a node that reaches a breakpoint, ``tell`` a line for the
        operator, ``held`` an event when a breakpoint holds its node and when it lets it go on.

        All are called on the tick thread, and must not block it.
        """
        self.reached, self.tell, self.held = reached, tell, held
        self._clock, self._wake = tree.clock, tree.wake
        self._nodes = {node.uid: _NodeHooks(node, self) for node in tree.nodes}
        self._listed: Dict[Tuple[int, int], Hook] = {}  # by position and uid
        self._owners: Dict[Tuple[int, int], bytes] = {}  # likewise; also of hooks that are gone
        # those that have removed themselves, on the tick thread
        self.gone: Deque[Hook] = collections.deque()

    def all(self) -> List[Hook]:
        """Return every hook, those before their nodes first."""
        self._take_gone_off()
        return [hook for _, hook in sorted(self._listed.items())]

    def _take_gone_off(self) -> None:
        """Forget what the tick thread has removed, unless another hook was set in its place
        meanwhile."""
        with contextlib.suppress(IndexError):
            while True:
                hook = self.gone.popleft()
                if self._listed.get(hook.key) is hook:
                    self._listed.pop(hook.key, None)

    def insert(self, hooks: Iterable[Hook], owner: bytes = b"") -> None:
        """Add each hook of the client ``owner``, or change the one at its place; a hook of an
        unknown node is passed over, as the library does."""
        # the last hook for a place counts: a client that floods must not occupy the tick thread
        newest = {hook.key: hook for hook in hooks if hook.uid in self._nodes}
        self._listed.update(newest)
        self._owners.update(dict.fromkeys(newest, owner))
        for hook in newest.values():
            self._post(self._nodes[hook.uid].insert, hook)

    def remove(self, place: HookPlace, reason: str = "") -> bool:
        """Remove the hook there and let its node go on; return whether it existed. The operator
        gets the ``reason``."""
        self._take_gone_off()
        hook = self._listed.pop(place.key, None)
        if hook is not None:
            self._post(self._nodes[hook.uid].remove, hook, reason)
        return hook is not None

    def unlock(self, given: Unlocking) -> bool:
        """Let a breakpoint go on with this result; return whether there is one."""
        self._take_gone_off()
        hook = self._listed.get(given.key)
        if hook is None:
            return False
        hook = self._listed[hook.key] = replace(
            hook, desired_status=given.desired_status, once=hook.once or given.remove_when_done)
        self._post(self._nodes[hook.uid].release, hook, "lets the node go on")
        return True

    def disable_all(self) -> None:
        """Disable every hook without removing it; every breakpoint lets its node go on."""
        for hook in self.all():
            disabled = self._listed[hook.key] = replace(hook, enabled=False)
            self._post(self._nodes[hook.uid].release, disabled, "is disabled")

    def remove_all(self, reason: str = "",
                   is_removed: Callable[[bytes], bool] = lambda owner: True) -> None:
        """Remove the hooks of each client for which ``is_removed``."""
        for hook in self.all():
            if is_removed(self._owners[hook.key]):
                self.remove(hook, reason)

    def _post(self, change: Callable[..., None], *arguments: Any) -> None:
        """Post a change to the tick thread and wake it."""
        self._clock.post(lambda: change(*arguments))
        self._wake.emit()


# ------------------------------------------------------------------------------- on the tick thread


class _SetHook:
    """A hook that is set on a node, and its state."""

    def __init__(self, hook: Hook):
        self.hook = hook
        self.is_unlocked = False  # a breakpoint that was reached
        self.is_reported = False  # the operator knows that it decides results


class _NodeHooks(NodeHook):
    """The hooks of one node, attached to it while there are any."""

    def __init__(self, node: Node, owner: Hooks):
        self._node = node
        self._owner = owner
        self._set: Dict[int, _SetHook] = {}  # by position
        # while the node waits: the breakpoint, its status before, and its result if it was ticked
        self._held: Optional[Tuple[_SetHook, Any, Optional[Result]]] = None

    @property
    def is_holding(self) -> bool:  # type: ignore[override]
        """Whether the node waits at a breakpoint."""
        return self._held is not None

    def _report_hold(self, is_held: bool) -> None:
        self._owner.held(BreakpointChanged(self._node.uid, self._node.full_path, is_held))

    def insert(self, hook: Hook) -> None:
        """Set ``hook``, or change the one at its place."""
        self._node.hook = self
        place = self._set.setdefault(hook.position, _SetHook(hook))
        place.is_reported = False
        place.hook = hook
        if not hook.enabled:
            self._unlock(place)
        result = "" if hook.mode == BREAKPOINT else " to " + hook.desired_status
        self._tell(hook, f"is set{result}" + ("" if hook.enabled else ", but disabled"))

    def release(self, hook: Hook, text: str) -> None:
        """Replace the hook at the same place by ``hook`` and let a breakpoint go on; the operator
        gets ``text``."""
        place = self._set.get(hook.position)
        if place is None:
            self._owner.gone.append(hook)  # it has removed itself already
            return
        place.hook = hook
        self._unlock(place)
        self._tell(hook, text)

    def _unlock(self, place: _SetHook) -> None:
        place.is_unlocked = self._held is not None and self._held[0] is place

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
        kind = "breakpoint" if hook.mode == BREAKPOINT else "replacement"
        where = "before" if hook.position == BEFORE else "after"
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
            decided = self._ask(node, AFTER, result)
            result = result if decided is None else decided
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
            self._owner.reached(node.uid)
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
            del self._set[hook.position]
            self._owner.gone.append(hook)
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
