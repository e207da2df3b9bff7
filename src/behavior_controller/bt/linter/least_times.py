"""The least times, in milliseconds, that a mission's nodes need before they succeed or fail, as far
as the file tells."""
import math
from typing import Dict, List, Mapping, Tuple

from behavior_controller.bt.engine.node import DECISIONS
from behavior_controller.bt.engine.possible_results import (
    FAILS, OF_A_LEAF, SKIPS, SUCCEEDS, Attributes)
from behavior_controller.bt.engine.node_types import Registry
from behavior_controller.bt.engine.registry import NodeSpec
from behavior_controller.bt.loader.document import Element
from behavior_controller.bt.loader.structure import from_leaves

Times = Dict[int, float]
"""Before it SUCCEEDS, and before it FAILS; infinite for what it never does."""

_AT_ONCE: Times = {SUCCEEDS: 0.0, FAILS: 0.0}


def least_times(trees: Mapping[str, List[Element]], ends: Mapping[int, int],
                registry: Registry) -> Dict[int, Times]:
    """Return the least times of each element, by ``id(element)``. ``trees``: see
    ``from_leaves``; ``ends`` are the results of each."""
    def of_element(element: Element, children: List[Times]) -> Times:
        below = [(ends[id(child)], times) for child, times in zip(element.children, children)]
        return _of_node(registry[element.type_id], element.attributes, below)

    def decided(element: Element, times: Times) -> Times:
        if element.attributes.keys().isdisjoint(DECISIONS):
            return times
        return _AT_ONCE

    return from_leaves(trees, of_element, decided)


def milliseconds(attributes: Attributes, port: str) -> float:
    """Return the literal of a port with milliseconds; 0 if it has none."""
    text = attributes.get(port, "")
    if not text.isdecimal() or len(text) >= 10:
        return 0.0
    return float(text)


def _of_node(spec: NodeSpec, attributes: Attributes, children: List[Tuple[int, Times]]) -> Times:
    if spec.advances_on and not spec.last_child_is_handler:
        return _in_chain(children, spec.advances_on)
    if spec.repeats_on in _AT_ONCE and spec.rounds:
        return _in_rounds(children[0][1], attributes.get(spec.rounds, ""), spec.repeats_on)
    pause = milliseconds(attributes, spec.pause)
    if len(children) == 1:
        return _of_decorator(spec, attributes, children[0][1], pause)
    if any(ends & SKIPS for ends, _ in children):
        return _AT_ONCE
    least = min((min(times.values()) for _, times in children), default=pause)
    own = spec.ends(attributes, [ends for ends, _ in children])
    return {end: least if own & end else math.inf for end in _AT_ONCE}


def _in_chain(children: List[Tuple[int, Times]], advances_on: int) -> Times:
    """Return the times of a Sequence, which advances on SUCCEEDS, or of a Fallback, on FAILS."""
    ends_at = OF_A_LEAF - advances_on
    total, other = 0.0, math.inf
    for ends, times in children:
        other = min(other, total + times[ends_at])
        if not ends & SKIPS:
            total += times[advances_on]
    return {advances_on: total, ends_at: other}


def _in_rounds(child: Times, rounds: str, repeats_on: int) -> Times:
    """Return the times of a Repeat, which repeats on SUCCEEDS, or of a Retry, on FAILS."""
    total = 0.0
    if rounds == "-1":
        total = math.inf
    elif rounds.isdecimal() and int(rounds[:9]):  # 0 * inf is no number
        total = int(rounds) * child[repeats_on]
    return {**child, repeats_on: total}


def _of_decorator(spec: NodeSpec, attributes: Attributes, child: Times, pause: float) -> Times:
    limit = milliseconds(attributes, spec.limit)
    own = spec.ends(attributes, [0])  # by itself, whatever its child does
    found = dict.fromkeys(_AT_ONCE, math.inf)
    for end in found:
        after = [time for of_child, time in child.items()
                 if spec.ends(attributes, [of_child]) & ~own & end]
        least = min(after, default=math.inf) + pause
        if own & end:
            found[end] = limit
        elif not limit or least <= limit:
            found[end] = least
    return found
