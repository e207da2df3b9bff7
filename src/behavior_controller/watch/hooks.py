"""Groot2's hooks: what is done in place of a node's tick, or with its result; a breakpoint keeps its node RUNNING.

The rules are BehaviorTree.CPP's (``Monitor::Hook`` of its Groot2 publisher), with one difference: a breakpoint of the
library stops the ticking thread, ours stops the node, and everything else (stop, deadlines, topics) goes on. An operator
is told of every hook that is set, acts, or goes: a robot that stands still for a hook must not look like a broken one.
"""
import functools
import json
from typing import Any, Callable, Dict, Iterable, List, NamedTuple, Optional, Tuple

from behavior_controller.bt.engine.leaf import SyncActionLeaf
from behavior_controller.bt.engine.node import Node, Result
from behavior_controller.bt.engine.tree import Tree
from behavior_controller.bt.status import FAILURE, IDLE, NAMES, RUNNING, SKIPPED, SUCCESS

BEFORE, AFTER = 0, 1
BREAKPOINT, REPLACE = 0, 1
_RESULTS: Dict[str, Result] = {"SUCCESS": SUCCESS, "FAILURE": FAILURE}
_STATUSES = ("SUCCESS", "FAILURE", "SKIPPED", "IDLE", "RUNNING")
"""What ``desired_status`` may be; the last three have no influence."""

HIGHEST_UID = 65535


def read_fields(given: Any, *names: str) -> List[Any]:
    """Return the values of these fields of a JSON object. Raises ValueError: what is wrong, what is allowed."""
    if not isinstance(given, dict):
        raise ValueError("a hook is a JSON object with the fields {}".format(", ".join(names)))
    for name in names:
        if name not in given:
            raise ValueError("the field {} is missing".format(name))
        type_, values, allowed = _FIELDS[name]
        value = given[name]
        if type(value) is not type_ or (values and value not in values):  # for isinstance, true would be a number
            raise ValueError("{} cannot be {}; allowed: {}".format(name, json.dumps(value)[:80], allowed))
    return [given[name] for name in names]


_FIELDS: Dict[str, Tuple[type, Any, str]] = {
    "uid": (int, range(HIGHEST_UID + 1), "a whole number from 0 to {}".format(HIGHEST_UID)),
    "position": (int, (BEFORE, AFTER), "0 (before the node) or 1 (after it)"),
    "mode": (int, (BREAKPOINT, REPLACE), "0 (breakpoint) or 1 (replace)"),
    "once": (bool, (), "true or false"),
    "enabled": (bool, (), "true or false"),
    "remove_when_done": (bool, (), "true or false"),
    "desired_status": (str, _STATUSES, ", ".join(_STATUSES))}


class Hook:
    """One hook of one node. A ``desired_status`` other than SUCCESS and FAILURE has no influence."""

    def __init__(self, uid: int, position: int, mode: int, once: bool, enabled: bool, desired_status: str):
        self.uid, self.position = uid, position
        self.mode, self.once, self.enabled, self.desired_status = mode, once, enabled, desired_status
        self.is_waiting = False  # a breakpoint that was reached
        self.is_unlocked = False
        self.is_told = False  # the operator knows that it decides results

    def as_dict(self) -> Dict[str, Any]:
        """Return the hook as Groot2 reads it."""
        return {"desired_status": self.desired_status, "enabled": self.enabled, "mode": self.mode, "once": self.once,
                "position": self.position, "uid": self.uid}

    def release(self) -> None:
        """Let a breakpoint go on."""
        self.is_unlocked = self.is_waiting


class _Held(NamedTuple):
    """A node that waits at a breakpoint: the status that it had, and its result if it has been ticked."""

    status: Any
    result: Optional[Result]


class Hooks:
    """All hooks of one tree. Insert, remove and the like come from the publisher's thread, ticks from the tree's."""

    def __init__(self, tree: Tree, reached: Callable[[int], None], tell: Callable[[str], None]):
        """``reached`` is told the uid of a node that comes to a breakpoint, ``tell`` a line for the operator.

        Both are called on the tree's thread too, and must not keep it.
        """
        self._nodes: Dict[int, Node] = {node.uid: node for node in tree.nodes}
        self._wake = tree.wake.emit
        self._reached = reached
        self._tell_line = tell
        self._hooks: Dict[Tuple[int, int], Hook] = {}  # by position and uid
        self._held: Dict[int, _Held] = {}
        self._originals: Dict[int, Any] = {}

    def __bool__(self) -> bool:
        """Whether there is any."""
        return bool(self._hooks)

    def all(self) -> List[Hook]:
        """Return every hook, those before their nodes first."""
        return [hook for _, hook in sorted(list(self._hooks.items()))]

    def insert(self, hooks: Iterable[Hook]) -> None:
        """Add each hook, or change the one at its place; a hook of an unknown node is passed over, as the library does."""
        for hook in hooks:
            node = self._nodes.get(hook.uid)
            if node is not None:
                self._insert(hook, node)
        self._wake()

    def _insert(self, hook: Hook, node: Node) -> None:
        before = self._hooks.get((hook.position, hook.uid))
        if before is not None:
            before.mode, before.once, before.desired_status = hook.mode, hook.once, hook.desired_status
            before.enabled, before.is_told = hook.enabled, False
            if not hook.enabled:
                before.release()
        else:
            self._hooks[hook.position, hook.uid] = hook
            self._attach(node)
        self._tell(hook, "is set{}{}".format("" if hook.mode == BREAKPOINT else " to " + hook.desired_status,
                                             "" if hook.enabled else ", but disabled"))

    def remove(self, position: int, uid: int, reason: str = "") -> bool:
        """Remove a hook and let its node go on; return whether there was one. The operator is told the ``reason``."""
        hook = self._hooks.pop((position, uid), None)
        if hook is not None:
            hook.enabled = False
            hook.release()
            self._wake()
            self._tell(hook, "is removed" + reason)
        return hook is not None

    def unlock(self, position: int, uid: int, desired_status: str, remove: bool) -> bool:
        """Let a breakpoint go on with this result; return whether there is one."""
        hook = self._hooks.get((position, uid))
        if hook is None:
            return False
        hook.desired_status = desired_status
        hook.once = hook.once or remove
        hook.release()
        self._wake()
        self._tell(hook, "lets the node go on")
        return True

    def disable_all(self) -> None:
        """Keep every hook, but have none do anything; every breakpoint lets its node go on."""
        for hook in self.all():
            hook.enabled = False
            hook.release()
            self._tell(hook, "is disabled")
        self._wake()

    def remove_all(self, reason: str = "") -> None:
        """Remove every hook."""
        for hook in self.all():
            self.remove(hook.position, hook.uid, reason)

    def _tell(self, hook: Hook, text: str) -> None:
        self._tell_line("Groot2: {} {} {} {}".format(
            "breakpoint" if hook.mode == BREAKPOINT else "replacement", "before" if hook.position == BEFORE else "after",
            self._nodes[hook.uid].full_path, text))

    # ------------------------------------------------------------------------------------------- on the tree's thread

    def _attach(self, node: Node) -> None:
        """Have ``node`` look at its hooks when it is ticked. It does so from then on; nodes without hooks never do."""
        if node.uid in self._originals:
            return
        self._originals[node.uid] = node.update
        node.update = functools.partial(self._update, node)  # type: ignore[method-assign]
        if isinstance(node, SyncActionLeaf):  # whose execute refuses RUNNING, as a node at a breakpoint is
            node.execute = functools.partial(Node.execute_with_conditions, node)  # type: ignore[method-assign]
        halt = node.halt
        node.halt = functools.partial(self._halt, node, halt)  # type: ignore[method-assign]

    def _update(self, node: Node) -> Result:
        """Tick ``node`` as its hooks want it."""
        held = self._held.get(node.uid)
        if held is None or node.status is not RUNNING:
            return self._begin(node)
        hook = self._hooks.get((BEFORE if held.result is None else AFTER, node.uid))
        if hook is not None and hook.is_waiting and not hook.is_unlocked:
            return RUNNING
        del self._held[node.uid]
        node.status = held.status  # it has not run yet, or has its result already: RUNNING was ours
        return self._begin(node) if held.result is None else self._finish(node, held.result)

    def _begin(self, node: Node) -> Result:
        decided = self._ask(node, BEFORE, None)
        if decided is RUNNING:
            return RUNNING
        return self._finish(node, self._originals[node.uid]() if decided is SKIPPED else decided)

    def _finish(self, node: Node, result: Result) -> Result:
        if result is not SUCCESS and result is not FAILURE:
            return result
        decided = self._ask(node, AFTER, result)
        return result if decided is SKIPPED else decided

    def _ask(self, node: Node, position: int, result: Optional[Result]) -> Result:
        """Return what a hook decides: SKIPPED for nothing, RUNNING for a breakpoint that waits."""
        hook = self._hooks.get((position, node.uid))
        if hook is None or not (hook.enabled or hook.is_unlocked):
            return SKIPPED
        if hook.mode == BREAKPOINT and not hook.is_unlocked:
            if not hook.is_waiting:
                hook.is_waiting = True
                self._reached(node.uid)
                self._tell(hook, "holds the node")
            self._held[node.uid] = _Held(node.status, result)
            return RUNNING
        hook.is_waiting = hook.is_unlocked = False
        decided = _RESULTS.get(hook.desired_status, SKIPPED) if hook.enabled else SKIPPED
        if decided is not SKIPPED and not hook.is_told:
            hook.is_told = hook.mode == REPLACE  # told once: it may decide at every tick
            self._tell(hook, "decides {} {}".format(hook.desired_status, "and the node is not run" if result is None else
                                                    "instead of the node's {}".format(NAMES[result])))
        if hook.once and self._hooks.pop((position, node.uid), None) is not None:
            self._tell(hook, "is removed")
        return decided

    def _halt(self, node: Node, halt: Callable[[], None]) -> None:
        """Halt ``node``; one that waits at a breakpoint before its work has none to halt."""
        held = self._held.pop(node.uid, None)
        for position in (BEFORE, AFTER):
            hook = self._hooks.get((position, node.uid))
            if hook is not None:
                hook.is_waiting = hook.is_unlocked = False
        if held is not None and held.result is None and held.status is IDLE:
            node.reset()
        else:
            halt()
