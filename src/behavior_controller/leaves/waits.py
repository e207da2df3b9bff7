"""How the tree around a condition waits for it: whether it is ticked again, and for how long at
most."""
import itertools
import math
from typing import Any, List, Optional, Tuple

from behavior_controller.bt import Kind, Node
from behavior_controller.bt.engine.possible_results import FAILS

MOST_BESIDE = 100
"""The most nodes of a round, without the condition: no round drawn by hand has so many."""


def is_asked_again(node: Any) -> bool:
    """Return whether a control asks this node again while a later one runs, which it would halt if
    it were RUNNING."""
    # the mission may be a part of a tree of py_trees
    while isinstance(node.parent, Node):
        spec, children = node.parent.spec, node.parent.children
        if spec.is_reactive and node in (children[:-1] if spec.advances_on else children[:1]):
            return True
        node = node.parent
    return False


def wait_for(condition: Any) -> Optional[float]:
    """Return for how many seconds the mission asks ``condition`` again and again while that is
    false.

    inf: without a limit, or the file does not say it as numbers; None: the mission does not wait
    for it. A ReactiveFallback waits as long as the nodes after the condition take, a loop for the
    pauses of all its rounds. A loop in whose rounds the robot does something else is not a wait.
    """
    node, outcome = condition, FAILS
    round_takes, wait = 0.0, None
    while isinstance(node.parent, Node):
        parent, place = node.parent, node.parent.children.index(node)
        spec, later = parent.spec, parent.children[place + 1:]
        if spec.advances_on and not outcome & spec.advances_on:
            later = []
        takes, does_more = _in_turn(parent.children[:place] + later)
        round_takes += takes + _pause(parent)
        if spec.is_reactive and spec.advances_on == FAILS and _in_turn(later)[0]:
            wait = round_takes
        if outcome & spec.repeats_on and (
                round_takes or not (spec.rounds or spec.ends(parent.attributes, [outcome]))):
            wait = round_takes = _number(parent, spec.rounds) * (round_takes or 1.0)
        if spec.limit:
            round_takes = min(round_takes, _number(parent, spec.limit) / 1000.0)
            if wait is not None:
                wait = round_takes
        if does_more:
            break
        node, outcome = parent, spec.ends(parent.attributes, [outcome, *map(_ends, later)])
    return wait


def _in_turn(siblings: List[Any]) -> Tuple[float, bool]:
    """Return how long nodes take that are ticked in turn, and whether the robot does more than to
    ask and to pause.

    inf: the file does not say it. Too many to look at, with each condition of a large mission,
    count as doing more.
    """
    below = itertools.chain.from_iterable(node.iterate() for node in siblings)
    nodes = list(itertools.islice(below, MOST_BESIDE + 1))
    if len(nodes) > MOST_BESIDE:
        return math.inf, True
    return sum(map(_seconds, nodes)), any(map(_does_more, nodes))


def _seconds(node: Any) -> float:
    takes_time = node.spec.repeats_on or not node.spec.is_instant and node.spec.kind in (
        Kind.ACTION, Kind.DECORATOR)
    if takes_time:
        return _pause(node) or math.inf
    return _pause(node)


def _pause(node: Any) -> float:
    if not node.spec.pause:
        return 0.0
    return _number(node, node.spec.pause) / 1000.0


def _number(node: Any, port: str) -> float:
    """Return the number of a port, inf if it is 0 or -1, or if the file does not say it as a
    number."""
    text = node.attributes.get(port, "")
    if not text.isdecimal():
        return math.inf
    return int(text) or math.inf


def _does_more(node: Any) -> bool:
    """Return whether a node has the robot do something, rather than ask or pause."""
    return node.spec.kind is Kind.ACTION and not node.spec.is_instant and not node.spec.pause


def _ends(node: Any) -> int:
    return node.spec.ends(node.attributes, list(map(_ends, node.children)))
