"""The entries of a tree for py_trees' tools: a py_trees blackboard client for each node, and the
values.

py_trees' blackboard is one dictionary of the process, ours are typed and one for each tree
instance. So py_trees gets a copy, under ``/tree/path/entry``, of the entries of those nodes whose
clients a tool uses, such as py-trees-render -b.
"""
from typing import Any, Dict, Iterable, List, Tuple

from py_trees.blackboard import Blackboard as Shown
from py_trees.blackboard import Client
from py_trees.common import Access

from behavior_controller.bt.linter.dataflow import flow
from behavior_controller.bt.engine.node import Node
from behavior_controller.bt.engine.blackboard import Blackboard
from behavior_controller.bt.registry import Registry

_ShownEntry = Tuple[Blackboard, str, str]
"""An entry by its place and name here, and by its name there."""


class Clients:
    """Makes the clients of the nodes of one tree when they are asked for first, and shows the
    values whenever they are."""

    def __init__(self, main: str, blackboards: Dict[str, Blackboard], registry: Registry):
        self._main = main
        self._blackboards = blackboards
        self._registry = registry
        self._entries: Dict[Node, List[_ShownEntry]] = {}

    def show(self, node: Node, clients: List[Any]) -> None:
        """Show the values of the entries that ``node`` uses; its client is added to ``clients`` if
        it is new."""
        entries = self._entries.get(node)
        if entries is None:
            entries = self._entries[node] = []
            read, written = self._used(node)
            if read or written:
                client = Client(name=node.full_path)
                for names, access in ((read, Access.READ), (written, Access.WRITE)):
                    for name in sorted(names):
                        entries.append(self._entry(node.blackboard, name))
                        client.register_key(entries[-1][2], access)
                clients.append(client)
        for blackboard, key, shown in entries:
            value = blackboard.get(key)
            if value is None:
                Shown.storage.pop(shown, None)
            else:
                Shown.storage[shown] = value

    def _used(self, node: Node) -> Tuple[Iterable[str], Iterable[str]]:
        """Return the entries that a node reads and writes; what a SubTree hands on is used by the
        nodes inside."""
        if node.element is None or node.registration_id == "SubTree":
            return [], []
        uses = flow({"": [node.element]}, "@", {}, self._registry)
        return ([tree + name for tree, name in uses.reads],
                [tree + name for tree, name in uses.written])

    def _entry(self, blackboard: Blackboard, name: str) -> _ShownEntry:
        home, key = blackboard.home(name)
        path = next((path for path, known in self._blackboards.items() if known is home), "")
        shown = "/".join(filter(None, [self._main, path, key]))
        # in the dot language a colon would end the name
        return home, key, "/" + shown.replace("::", " #").replace(":", "#")
