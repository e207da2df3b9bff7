"""Finds the nodes with which the failure of a node began."""
from typing import Any, Iterable, List

from behavior_controller.bt.engine.possible_results import FAILS, SUCCEEDS
from behavior_controller.bt.values.status import FAILURE, RUNNING, SUCCESS


def origins(nodes: Iterable[Any], since: int) -> List[Any]:
    """Return the nodes with which the failure of ``nodes`` began, the newest last: those that have
    failed by themselves, and those that were halted while they were under way.

    Changes of status up to number ``since`` do not count. A recovery is no origin.
    """
    fresh = sorted((node for node in nodes
                    if node.changed_at > since and not node.spec.is_recovery),
                   key=lambda node: node.changed_at)
    return [origin for node in fresh for origin in _below(node, since) or [node]]


def _below(node: Any, since: int) -> List[Any]:
    """Return the origins below a node."""
    spec, children = node.spec, node.children
    if spec.last_child_is_handler:
        children = children[:-1]
    failed = [child for child in children
              if not child.spec.is_recovery and _has_failed(child, spec.repeats_on)]
    if failed and spec.advances_on != FAILS:  # it went on after the others
        failed = [max(failed, key=lambda child: child.changed_at)]
    found = origins(failed, since)
    if not found or node.last_status is RUNNING:
        found += origins((child for child in children if child.last_status is RUNNING), since)
    return found


def _has_failed(node: Any, repeated_on: int) -> bool:
    """Return whether a node has failed, or has inverted a failure in a loop that goes on then."""
    if node.last_status is SUCCESS and repeated_on & SUCCEEDS:
        return not node.spec.ends(node.attributes, [SUCCEEDS]) & SUCCEEDS
    return node.last_status is FAILURE
