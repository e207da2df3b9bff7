"""Plans faults towards nodes that no play has reached."""
import itertools
from typing import Any, Dict, Iterable, Iterator, List, Optional, Set, Tuple

from behavior_controller.bt.engine.node import Node
from behavior_controller.text import count

from unit_tests.rehearsal.play import Place
from unit_tests.rehearsal.plays import Outcome, Scene
from unit_tests.robot.faults import PlannedFault
from unit_tests.robot.visitor import BEHAVIOURS, ENGAGES

MOST_PLAYS = 400
"""Plays towards all nodes together."""

MOST_BASES = 12
"""Plays that get a further fault for a node in one round."""

BURSTS = (2, 3, 4)
"""How many calls in a row go wrong where nothing says which ones have to."""


class Search:
    """Plans plays in rounds, from the ``outcomes`` so far: a play that comes as far as the sibling
    before a node gets a further fault below that sibling, until the sibling fails.

    ``plays`` is the number of planned plays. ``is_cut``: more could have been tried.
    """

    def __init__(self, nodes: List[Node], reached: Set[int], outcomes: List[Outcome], kind: str):
        """``reached`` and ``outcomes`` grow with each round that is played."""
        self._nodes, self._reached, self._outcomes = nodes, reached, outcomes
        self._kind = kind
        self._tried: Set[Scene] = set()
        self._bases: Set[Tuple[int, Scene]] = set()
        self.plays = 0
        self.is_cut = False

    def targets(self) -> List[Node]:
        """Return the nodes to search for, which no play has reached; of a whole branch only the
        topmost, of nodes that follow one another only the first.

        A tree that is called several times is one part of the file: one call that reaches a node is
        enough. None is a recovery from a step that cannot fail.
        """
        known = {node.element for node in self._nodes if node.uid in self._reached}
        asked = {call.uid for outcome in self._outcomes for call in outcome.calls}
        targets = []
        for node in self._nodes:
            before = _sibling_before(node)
            is_first = before is None or before.uid in self._reached
            is_top = node.parent is None or node.parent.uid in self._reached
            may_be_needed = not node.spec.is_recovery or _below(before) & asked
            if node.element not in known and is_top and is_first and may_be_needed:
                targets.append(node)
        return targets

    def unreached(self) -> Iterator[Place]:
        """Yield the nodes that are still not reached, and in words how sure it is that no play
        reaches them."""
        runs = count(len(self._outcomes), "simulated run", "simulated runs")
        for node in self.targets():
            yield node.uid, (f"not reached by {runs}" if self.is_cut else
                             f"no visitor and no fault brings the mission here, in {runs}")

    def rounds(self) -> Iterator[List[Scene]]:
        """Yield the scenes of each round."""
        yield from self._towards()
        if self.targets():
            yield self._new(self._bursts())
            yield from self._towards()

    def _towards(self) -> Iterator[List[Scene]]:
        while True:
            scenes = self._new(scene for node in self.targets() for scene in self._extended(node))
            if not scenes:
                return
            yield scenes

    def _new(self, scenes: Iterable[Scene]) -> List[Scene]:
        new = [scene for scene in dict.fromkeys(scenes) if scene not in self._tried]
        chosen = new[:MOST_PLAYS - self.plays]
        self.is_cut = self.is_cut or len(chosen) < len(new)
        self._tried.update(chosen)
        self.plays += len(chosen)
        return chosen

    def _extended(self, node: Node) -> Iterator[Scene]:
        """Yield the nearest plays that end before ``node``, with a further fault below its sibling.
        """
        before = _sibling_before(node)
        below = _below(before)
        near = [outcome for outcome in self._outcomes
                if before is not None and before.uid in outcome.reached
                and outcome.calls and (node.uid, outcome.scene) not in self._bases]
        for outcome in sorted(near, key=_distance)[:MOST_BASES]:
            self._bases.add((node.uid, outcome.scene))
            scene = outcome.scene._replace(is_traced=True)
            for call in outcome.calls:
                if call.uid in below and call.is_done:
                    fault = PlannedFault(call.node, call.number, self._kind)
                    yield scene.with_fault(fault)
                    yield scene.with_fault(fault._replace(is_lasting=True))

    def _bursts(self) -> Iterator[Scene]:
        """Yield, for a visitor who engages, several faults in a row from each leaf's first call on,
        and each two services that go wrong for good."""
        for outcome in self._outcomes:
            scene = outcome.scene._replace(is_traced=True)
            if not outcome.scene.is_calm or scene.visitor != ENGAGES:
                continue
            first: Dict[int, PlannedFault] = {}
            for call in outcome.calls:
                first.setdefault(call.uid, PlannedFault(call.node, call.number, self._kind))
            for fault in first.values():
                for length in BURSTS:
                    burst = (fault._replace(call=fault.call + later) for later in range(length))
                    yield scene._replace(planned=tuple(burst))
            nodes = {fault.node: fault for fault in reversed(list(first.values()))}  # their first
            lasting = (fault._replace(is_lasting=True) for fault in nodes.values())
            for pair in itertools.combinations(sorted(lasting), 2):
                yield scene._replace(planned=pair)


def _sibling_before(node: Node) -> Optional[Node]:
    """Return the sibling after which a node is ticked; None if it does not wait for another."""
    parent = node.parent
    if parent is None or not parent.spec.next_after or parent.children[0] is node:
        return None
    return parent.children[parent.children.index(node) - 1]


def _below(node: Any) -> Set[int]:
    return {below.uid for below in node.iterate()} if node is not None else set()


def _distance(outcome: Outcome) -> Tuple[int, int, bool]:
    scene = outcome.scene
    return len(scene.planned + scene.silent), BEHAVIOURS.index(scene.visitor), not scene.by_voice
