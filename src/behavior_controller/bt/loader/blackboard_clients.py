"""The entries of a tree for py_trees' tools: a py_trees blackboard client for each node, and the
values.

py_trees' blackboard is one dictionary of the process, ours are typed and one for each tree
instance. So py_trees gets a copy, under ``/tree/path/entry``, of the entries of those nodes whose
clients a tool uses, such as py-trees-render -b.
"""
from typing import Any, Dict, List, Tuple

from py_trees.blackboard import Blackboard as Shown, Client
from py_trees.common import Access

from behavior_controller.bt.loader.flow import Flow
from behavior_controller.bt.engine.node import Node
from behavior_controller.bt.values.blackboard import Blackboard
from behavior_controller.bt.engine.node_types import Registry
from behavior_controller.text import joined

_ShownEntry = Tuple[Blackboard, str, str]
"""An entry by its place and name here, and by its name there."""


class Clients:
    """Makes the clients of the nodes of one tree when they are asked for first, and shows the
    values whenever they are."""

    def __init__(self, main: str, registry: Registry):
        self._main, self._registry = main, registry
        self._entries: Dict[Node, List[_ShownEntry]] = {}

    def show(self, node: Node, clients: List[Any]) -> None:
        """Show the values of the entries that ``node`` uses; its client is added to ``clients`` if
        it is new."""
        if node not in self._entries:
            self._entries[node] = entries = []
            uses = self._used(node)
            if uses:
                clients.append(Client(name=node.full_path))
            for name, access in uses:
                home, key = node.blackboard.home(name)
                # in the dot language a colon would end the name
                path = joined("/", self._main, home.path, key)
                shown = "/" + path.replace("::", " #").replace(":", "#")
                entries.append((home, key, shown))
                clients[-1].register_key(shown, access)
        for blackboard, key, shown in self._entries[node]:
            value = blackboard.get(key)
            if value is None:
                Shown.storage.pop(shown, None)
            else:
                Shown.storage[shown] = value

    def _used(self, node: Node) -> List[Tuple[str, Access]]:
        """Return the entries that a node reads, and those that it writes; what a SubTree hands on
        is used by the nodes inside."""
        if node.element is None or node.registration_id == "SubTree":
            return []
        flow = Flow({"": [node.element]}, "@", {}, self._registry)
        uses = sorted((use.tree + use.name, use) for use in flow.all())
        return ([(name, Access.READ) for name, use in uses if use.read]
                + [(name, Access.WRITE) for name, use in uses if use.write])
