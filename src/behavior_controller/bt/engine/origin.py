"""Finds what a recovery is about: the nodes before it, and those with which their failure began."""
from typing import Any, Iterable, List

from behavior_controller.bt.engine.possible_results import FAILS, SUCCEEDS
from behavior_controller.bt.values.status import FAILURE, RUNNING, SUCCESS


def steps_before(node: Any) -> List[Any]:
    """Return the nodes before ``node`` below its nearest ancestor that has any: a consecutive range
    of uids."""
    while node.parent is not None:
        before: List[Any] = node.parent.children[:node.parent.children.index(node)]
        if before:
            return before
        node = node.parent
    return []


def origins(steps: List[Any], known: int) -> List[Any]:
    """Return the nodes with which the failure of ``steps`` began, the newest last: those that have
    failed by themselves, and those that were halted while they were under way.

    Changes of status up to number ``known``, and those before the steps began, do not count. A
    recovery is no origin.
    """
    since = max(known, steps[0].parent.changed_at) if steps else 0
    return _origins((step for step in steps if step.last_status is FAILURE), since) or [
        node for node in _origins(steps, since) if node.last_status is FAILURE]


def _origins(nodes: Iterable[Any], since: int) -> List[Any]:
    fresh = [node for node in nodes if node.changed_at > since and not node.spec.is_recovery]
    fresh.sort(key=lambda node: node.changed_at)
    return [origin for node in fresh for origin in _below(node, since) or [node]]


def _below(node: Any, since: int) -> List[Any]:
    """Return the origins below a node."""
    spec, children = node.spec, node.spec.in_turn(node.children)
    failed = [child for child in children
              if not child.spec.is_recovery and _has_failed(child, spec.repeats_on)]
    if failed and spec.advances_on != FAILS:  # it went on after the others
        failed = [max(failed, key=lambda child: child.changed_at)]
    found = _origins(failed, since)
    if not found or node.last_status is RUNNING:
        found += _origins((child for child in children if child.last_status is RUNNING), since)
    return found


def _has_failed(node: Any, repeated_on: int) -> bool:
    """Return whether a node has failed, or has inverted a failure in a loop that goes on then."""
    if node.last_status is SUCCESS and repeated_on & SUCCEEDS:
        return not node.spec.ends(node.attributes, [SUCCEEDS]) & SUCCEEDS
    return node.last_status is FAILURE
