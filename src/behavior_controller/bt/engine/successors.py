"""Which leaf follows when a node of a tree succeeds, by the NodeSpecs of the nodes around it."""
from typing import Any, List, Optional, Set, Tuple

from behavior_controller.bt.engine.node import PRE_CONDITIONS
from behavior_controller.bt.engine.possible_results import EACH, SUCCEEDS
from behavior_controller.bt.engine.registry import Kind, Role

_MOST_NAMED = 2
"""The most leaves that are named; which of more is left open."""

MOST_STEPS = 100
"""How far the way to the next leaf is followed, up and down the tree: no way drawn by hand is
longer."""

END = 0
"""Stands for the end of the tree, in place of the uid of a leaf."""

_CONDITIONAL = {Role.SCRIPT, Role.WATCHED, Role.CHOICE}
_Step = Tuple[Any, int]
"""A node, and how it has ended; 0: it is ticked."""


class Successors:
    """The leaves that may follow each of ``nodes``.

    A node that can end as its child did counts as doing so: a decorator that declares nothing too.
    """

    def __init__(self, nodes: List[Any]):
        self._place = {child: place for node in nodes for place, child in enumerate(node.children)}

    def of(self, node: Any) -> Tuple[int, ...]:
        """Return the uids of the leaves that may follow when ``node`` succeeds, ``END`` last; none
        if the file leaves it open."""
        found: Set[int] = set()
        steps: List[_Step] = [(node, SUCCEEDS)]
        for reached, end in steps:  # which grow
            following = self._following(reached, end)
            if following is None or len(steps) > MOST_STEPS:
                return ()
            if reached.parent is None and end:
                found.add(END)
            elif not following and not end:
                found.add(reached.uid)
            steps += [further for further in following if further not in steps]
        if len(found) > _MOST_NAMED:
            return ()
        return tuple(sorted(found, key=lambda uid: (uid == END, uid)))

    def _following(self, node: Any, end: int) -> Optional[List[_Step]]:
        """Return the steps after one; none after the end of the tree, and after a leaf that takes
        time. None: it is open."""
        if not end:
            return self._in_tick(node)
        parent = node.parent
        if parent is None:
            return []
        ends, children = parent.spec.after(
            parent.attributes, len(parent.children), self._place[node], end)
        if len(children) > 1:
            return None
        return ([(parent, way) for way in EACH if way & (ends & end or ends)]
                + [(parent.children[index], 0) for index in children])

    @staticmethod
    def _in_tick(node: Any) -> Optional[List[_Step]]:
        """Return the steps of a node that is ticked; open if a condition, or the value of an entry,
        decides what it does."""
        spec, children = node.spec, node.children
        if any(node.attributes.get(name) for name in PRE_CONDITIONS):
            return None
        if children:
            first = spec.first(len(children))
            if len(first) > 1 or not spec.roles.isdisjoint(_CONDITIONAL):
                return None
            return [(children[first[0]], 0)]
        ends = spec.ends(node.attributes, [])
        is_passed = spec.kind is Kind.ACTION and spec.is_instant and ends in EACH
        return [(node, ends)] if is_passed else []
