"""Warns of a pass that begins after the robot was asked for something: the node that begins it
clears what belongs to a visitor."""
from typing import Any, Iterator

from behavior_controller.bt.engine.tree import Tree
from behavior_controller.bt.loader import rules
from behavior_controller.config.node_facts import MissionSpec
from behavior_controller.errors import Fault


def late_begins(tree: Tree) -> Iterator[Fault]:
    """Yield a warning for each node that begins a pass after another one has asked the robot."""
    for node in tree.nodes:
        if isinstance(node.spec, MissionSpec) and node.spec.begins_pass:
            asked = next(filter(_asks, _ticked_before(node)), None)
            if asked is not None:
                text = (f"{node.registration_id} begins the pass after {asked.registration_id} has "
                        "asked the robot, and clears what is known of the visitor")
                hint = f"move it before {asked.registration_id}"
                yield node.element.fault(rules.BEGINS_LATE, text, hint)


def _asks(node: Any) -> bool:
    return isinstance(node.spec, MissionSpec) and bool(node.spec.calls)


def _ticked_before(node: Any) -> Iterator[Any]:
    """Yield the nodes that are ticked before ``node`` in the same round of the innermost loop."""
    inner, outer = node, node.parent
    while outer is not None and not outer.spec.repeats_on:
        if outer.spec.advances_on:
            for sibling in outer.children[:outer.children.index(inner)]:
                yield from sibling.iterate()
        inner, outer = outer, outer.parent
