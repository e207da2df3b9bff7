"""The list of Groot2's hooks, which its clients change and read.

A hook belongs to the client that set or changed it last, and is removed when that client is gone:
the library asks only whether any client is there. Any client may remove, disable or unlock it.
"""
from typing import Callable, Dict, Iterable, List, Tuple

from msgspec.structs import replace

from behavior_controller.run.events import HookEnded, TreeShown
from behavior_controller.run.from_viewer import (
    RELEASE, REMOVE, SET, Change, Hook, HookChange, HookPlace, Unlocking)


class HookList:
    """All hooks of one tree as its clients know them. Each change is handed to ``send``; the nodes
    of the controller follow."""

    def __init__(self, tree: TreeShown, send: Callable[[HookChange], None], first: int = 1):
        """``first`` is the number of the first change."""
        self.tree = tree
        self._send = send
        self.next_number = first
        self._listed: Dict[Tuple[int, int], Hook] = {}  # by position and uid
        self._owners: Dict[Tuple[int, int], bytes] = {}  # likewise; also of hooks that are gone
        self._numbers: Dict[Tuple[int, int], int] = {}  # likewise: of the last change

    def all(self) -> List[Hook]:
        """Return every hook, those before their nodes first."""
        return [hook for _, hook in sorted(self._listed.items())]

    def end(self, event: HookEnded) -> None:
        """Forget a hook that has removed itself, unless it was changed meanwhile."""
        key = event.position, event.uid
        if self._numbers.get(key) == event.number:
            self._listed.pop(key, None)

    def insert(self, hooks: Iterable[Hook], owner: bytes = b"") -> None:
        """Add each hook of the client ``owner``, or change the one at its place; a hook of an
        unknown node is passed over, as the library does."""
        # the last hook for a place counts: a client that floods must not occupy the tick thread
        newest = {hook.key: hook for hook in hooks if 0 < hook.uid <= len(self.tree.nodes)}
        for key, hook in newest.items():
            self._owners[key] = owner
            self._change(SET, hook)

    def remove(self, place: HookPlace, reason: str = "") -> bool:
        """Remove the hook there and let its node go on; return whether it existed. The operator
        gets the ``reason``."""
        hook = self._listed.get(place.key)
        if hook is not None:
            self._change(REMOVE, hook, reason)
            del self._listed[place.key]
        return hook is not None

    def unlock(self, given: Unlocking) -> bool:
        """Let a breakpoint go on with this result; return whether there is one."""
        hook = self._listed.get(given.key)
        if hook is not None:
            self._change(RELEASE, replace(
                hook, desired_status=given.desired_status,
                once=hook.once or given.remove_when_done), "lets the node go on")
        return hook is not None

    def disable_all(self) -> None:
        """Disable every hook without removing it; every breakpoint lets its node go on."""
        for hook in self.all():
            self._change(RELEASE, replace(hook, enabled=False), "is disabled")

    def remove_all(self, reason: str = "",
                   is_removed: Callable[[bytes], bool] = lambda owner: True) -> None:
        """Remove the hooks of each client for which ``is_removed``."""
        for hook in self.all():
            if is_removed(self._owners[hook.key]):
                self.remove(hook, reason)

    def _change(self, what: Change, hook: Hook, text: str = "") -> None:
        self._send(HookChange(what, hook, self.next_number, self.tree.number, text))
        self._listed[hook.key] = hook
        self._numbers[hook.key] = self.next_number
        self.next_number += 1
