"""Warns of a recovery that goes on without a step that no policy may skip."""
from typing import Any, Iterator

from behavior_controller.bt.engine.possible_results import SUCCEEDS
from behavior_controller.bt.engine.tree import Tree
from behavior_controller.bt.loader import rules
from behavior_controller.errors import Fault
from behavior_controller.leaves.base import MissionLeaf
from behavior_controller.leaves.data import CURRENT_EXHIBIT


def left_out_steps(tree: Tree) -> Iterator[Fault]:
    """Yield a warning for each such step: a step before it, which a policy may skip, fails, and the
    HandleFallBack behind both goes on."""
    for handler in tree.nodes:
        if handler.parent is not None and handler.spec.is_recovery:
            for step in handler.parent.children[:handler.parent.children.index(handler)]:
                yield from _left_out(step, handler.registration_id)


def _left_out(step: Any, handler: str) -> Iterator[Fault]:
    leaves = [node for node in step.iterate() if isinstance(node, MissionLeaf)]
    for failed in _unhandled(step):
        if not failed.spec.calls or failed.spec.is_indispensable:
            continue
        if any(node.spec.writes(CURRENT_EXHIBIT.name) for node in leaves if node.uid < failed.uid):
            return  # the whole stop is left out
        for node in leaves:
            if node.uid > failed.uid and node.spec.is_indispensable:
                text = (f"{node.registration_id} is left out when {failed.registration_id} fails, "
                        f"and {handler} goes on")
                hint = f"give {failed.registration_id} a recovery of its own"
                yield node.element.fault(rules.STEP_LEFT_OUT, text, hint)
                return


def _unhandled(node: Any) -> Iterator[MissionLeaf]:
    """Yield the leaves whose failure is the failure of ``node``, in their order."""
    if isinstance(node, MissionLeaf):
        yield node
    elif node.spec.advances_on == SUCCEEDS or node.spec.id == "SubTree":
        for child in node.children:
            yield from _unhandled(child)
