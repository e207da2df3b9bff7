"""The list of Groot2's hooks, which its clients change and read.

A hook belongs to the client that set or changed it last, and is removed when that client is gone:
the library asks only whether any client is there. Any client may remove, disable or unlock it.
"""
from typing import Callable, Dict, Iterable, List, NamedTuple, Optional, Tuple

from msgspec.structs import replace

from behavior_controller.run.events import HookEnded, TreeShown
from behavior_controller.run.from_viewer import (
    RELEASE, REMOVE, SET, Change, Hook, HookChange, HookPlace, Unlocking)
from behavior_controller.viewer.zmtp import Peer


class _Listed(NamedTuple):
    """A hook, the client that it belongs to, and the number of its last change."""

    hook: Hook
    owner: Optional[Peer]
    number: int


class HookList:
    """All hooks of one tree as its clients know them. Each change is handed to ``send``; the nodes
    of the controller follow."""

    def __init__(self, tree: TreeShown, send: Callable[[HookChange], None], first: int = 1):
        """``first`` is the number of the first change."""
        self.tree, self._send = tree, send
        self.next_number = first
        self._listed: Dict[Tuple[int, int], _Listed] = {}  # by position and uid

    def all(self) -> List[Hook]:
        """Return every hook, those before their nodes first."""
        return [listed.hook for _, listed in sorted(self._listed.items())]

    def end(self, event: HookEnded) -> None:
        """Forget a hook that has removed itself, unless it was changed meanwhile."""
        listed = self._listed.get((event.position, event.uid))
        if listed is not None and listed.number == event.number:
            del self._listed[listed.hook.key]

    def insert(self, hooks: Iterable[Hook], owner: Optional[Peer] = None) -> None:
        """Add each hook of the client ``owner``, or change the one at its place; a hook of an
        unknown node is passed over, as the library does."""
        # the last hook for a place counts: a client that floods must not occupy the tick thread
        newest = {hook.key: hook for hook in hooks if 0 < hook.uid <= len(self.tree.nodes)}
        for hook in newest.values():
            self._change(SET, hook, owner)

    def remove(self, place: HookPlace, reason: str = "") -> bool:
        """Remove the hook there and let its node go on; return whether it existed. The operator
        gets the ``reason``."""
        listed = self._listed.get(place.key)
        if listed is not None:
            self._change(REMOVE, listed.hook, None, reason)
            del self._listed[place.key]
        return listed is not None

    def unlock(self, given: Unlocking) -> bool:
        """Let a breakpoint go on with this result; return whether there is one."""
        listed = self._listed.get(given.key)
        if listed is not None:
            hook = replace(listed.hook, desired_status=given.desired_status,
                           once=listed.hook.once or given.remove_when_done)
            self._change(RELEASE, hook, listed.owner, "lets the node go on")
        return listed is not None

    def disable_all(self) -> None:
        """Disable every hook without removing it; every breakpoint lets its node go on."""
        for _, (hook, owner, _number) in sorted(self._listed.items()):
            self._change(RELEASE, replace(hook, enabled=False), owner, "is disabled")

    def remove_all(self, reason: str = "",
                   is_removed: Callable[[Optional[Peer]], bool] = lambda owner: True) -> None:
        """Remove the hooks of each client for which ``is_removed``."""
        for _, (hook, owner, _number) in sorted(self._listed.items()):
            if is_removed(owner):
                self.remove(hook, reason)

    def _change(self, what: Change, hook: Hook, owner: Optional[Peer], text: str = "") -> None:
        self._send(HookChange(what, hook, self.next_number, self.tree.number, text))
        self._listed[hook.key] = _Listed(hook, owner, self.next_number)
        self.next_number += 1
