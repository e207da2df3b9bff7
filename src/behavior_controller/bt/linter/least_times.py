"""The least times, in milliseconds, that a mission's nodes need before they succeed or fail, as far
as the file tells."""
import math
from typing import Dict, List, Mapping, Tuple

from behavior_controller.bt.engine.node import DECISIONS
from behavior_controller.bt.engine.possible_results import FAILS, SKIPS, SUCCEEDS, Attributes
from behavior_controller.bt.engine.node_types import Registry
from behavior_controller.bt.engine.registry import NodeSpec
from behavior_controller.bt.loader.document import Element
from behavior_controller.bt.loader.structure import from_leaves

Times = Tuple[float, float]
"""Before it succeeds, and before it fails; infinite for what it never does."""

_BOTH = (SUCCEEDS, FAILS)


def least_times(trees: Mapping[str, List[Element]], ends: Mapping[int, int],
                registry: Registry) -> Dict[int, Times]:
    """Return the least times of each element, by ``id(element)``. ``trees``: see
    ``from_leaves``; ``ends`` are the results of each."""
    def of_element(element: Element, children: List[Times]) -> Times:
        below = [(ends[id(child)], times) for child, times in zip(element.children, children)]
        return _of_node(registry[element.type_id], element.attributes, below)

    def decided(element: Element, times: Times) -> Times:
        is_conditional = not element.attributes.keys().isdisjoint(DECISIONS)
        return (0.0, 0.0) if is_conditional else times

    return from_leaves(trees, of_element, decided)


def milliseconds(attributes: Attributes, port: str) -> float:
    """Return the literal of a port with milliseconds; 0 if it has none."""
    text = attributes.get(port, "")
    return float(text) if text.isdecimal() and len(text) < 10 else 0.0


def _of_node(spec: NodeSpec, attributes: Attributes, children: List[Tuple[int, Times]]) -> Times:
    if spec.advances_on and not spec.last_child_is_handler:
        return _in_chain(children, spec.advances_on)
    if spec.repeats_on in _BOTH and spec.rounds:
        return _in_rounds(children[0][1], attributes.get(spec.rounds, ""), spec.repeats_on)
    pause = milliseconds(attributes, spec.pause)
    if len(children) == 1:
        return _of_decorator(spec, attributes, children[0][1], pause)
    if any(ends & SKIPS for ends, _ in children):
        return 0.0, 0.0
    least = min((min(times) for _, times in children), default=pause)
    own = spec.ends(attributes, [ends for ends, _ in children])
    return least if own & SUCCEEDS else math.inf, least if own & FAILS else math.inf


def _in_chain(children: List[Tuple[int, Times]], advances_on: int) -> Times:
    """Return the times of a Sequence, which advances on SUCCEEDS, or of a Fallback, on FAILS."""
    goes_on = _BOTH.index(advances_on)
    total, other = 0.0, math.inf
    for ends, times in children:
        other = min(other, total + times[1 - goes_on])
        total += 0.0 if ends & SKIPS else times[goes_on]
    return (total, other) if goes_on == 0 else (other, total)


def _in_rounds(child: Times, rounds: str, repeats_on: int) -> Times:
    """Return the times of a Repeat, which repeats on SUCCEEDS, or of a Retry, on FAILS."""
    again = _BOTH.index(repeats_on)
    # an infinite time is no number of rounds: 0 * inf is none
    total = int(rounds) * child[again] if rounds.isdecimal() and int(rounds[:9]) else 0.0
    if rounds == "-1":
        total = math.inf
    return (total, child[1]) if again == 0 else (child[0], total)


def _of_decorator(spec: NodeSpec, attributes: Attributes, child: Times, pause: float) -> Times:
    limit = milliseconds(attributes, spec.limit)
    own = spec.ends(attributes, [0])  # by itself, whatever its child does
    found = []
    for end in _BOTH:
        after = [time for time, of_child in zip(child, _BOTH)
                 if spec.ends(attributes, [of_child]) & ~own & end]
        least = min(after, default=math.inf) + pause
        found.append(least if not limit or least <= limit else math.inf)
        if own & end:
            found[-1] = limit
    return found[0], found[1]
