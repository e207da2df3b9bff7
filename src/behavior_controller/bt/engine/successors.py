"""Which leaf follows when a node of a tree succeeds, by the NodeSpecs of the nodes around it."""
from typing import Any, Dict, FrozenSet, List, Optional, Tuple

from behavior_controller.bt.engine.node import PRE_CONDITIONS
from behavior_controller.bt.engine.possible_results import EACH, SUCCEEDS
from behavior_controller.bt.engine.registry import Kind, Role

MOST = 2
"""The most leaves that are named; which of more is left open."""

END = 0
"""Stands for the end of the tree, in place of the uid of a leaf."""

_CONDITIONAL = {Role.SCRIPT, Role.WATCHED, Role.CHOICE}
_Leaves = Optional[FrozenSet[int]]
"""The uids of the leaves that may follow; None: it is open."""


class Successors:
    """The leaves that may follow each of ``nodes``.

    A node that can end as its child did counts as doing so: a decorator that declares nothing
    too."""

    def __init__(self, nodes: List[Any]):
        self._place = {child: place for node in nodes for place, child in enumerate(node.children)}
        self._known: Dict[Tuple[Any, int], _Leaves] = {}

    def of(self, node: Any) -> Tuple[int, ...]:
        """Return the uids of the leaves that may follow when ``node`` succeeds, ``END`` last; none
        if the file leaves it open."""
        found = self._after(node, SUCCEEDS) or frozenset()
        in_order = sorted(found, key=lambda uid: (uid == END, uid))
        return tuple(in_order) if len(found) <= MOST else ()

    def _after(self, node: Any, end: int) -> _Leaves:
        """Return what follows when ``node`` has ended with ``end``."""
        parent = node.parent
        if parent is None:
            return frozenset([END])
        if (node, end) not in self._known:
            self._known[node, end] = frozenset()  # of a loop in which no leaf takes time
            ends, following = parent.spec.after(
                parent.attributes, len(parent.children), self._place[node], end)
            ways = [self._after(parent, way) for way in EACH if way & (ends & end or ends)]
            ways += [self._first(parent.children[index]) for index in following]
            is_open = len(following) > 1 or None in ways
            self._known[node, end] = None if is_open else frozenset(
                uid for way in ways for uid in way or ())
        return self._known[node, end]

    def _first(self, node: Any) -> _Leaves:
        """Return the leaf that is ticked first when ``node`` is, or what follows those that take no
        time; open if a condition, or the value of an entry, decides whether it is."""
        spec, children = node.spec, node.children
        if any(node.attributes.get(name) for name in PRE_CONDITIONS):
            return None
        if children:
            first = spec.first(len(children))
            is_open = len(first) > 1 or not spec.roles.isdisjoint(_CONDITIONAL)
            return None if is_open else self._first(children[first[0]])
        ends = spec.ends(node.attributes, [])
        is_passed = spec.kind is Kind.ACTION and spec.is_instant and ends in EACH
        return self._after(node, ends) if is_passed else frozenset([node.uid])
