"""Plays a mission without ROS, with a robot that never fails and the visitor of the test: what
should be reached.

The mission is played by the engine itself, but not by the node under test: not its ROS edge, its
clock or its process.
"""
import dataclasses
from typing import FrozenSet, NamedTuple, Optional, Tuple

from behavior_controller.bt.engine.tree import Tree
from behavior_controller.leaves.base import MissionLeaf

from unit_tests.rehearsal.play import CALM, LIMIT, Stage

STEP = 0.5
"""Seconds between two messages of each topic."""


class Rehearsal(NamedTuple):
    """How the mission should go: its outcome, the paths of the leaves that it reaches, and its
    branches.

    A branch is a child of a node with several children; it is given as the paths of the mission
    leaves below it.
    """

    outcome: str
    reached: FrozenSet[str]
    branches: Tuple[FrozenSet[str], ...]


def rehearse(stage: Stage, behaviour: str) -> Optional[Rehearsal]:
    """Return how one pass of the mission goes with a visitor of that behaviour; None if that cannot
    be told."""
    test = dataclasses.replace(CALM, visitor_behaviour=behaviour, test_timeout=LIMIT)
    played = stage.play(test, shortest_gap=STEP)
    visits = played.run().visits
    if not visits:
        return None
    tree = stage.mission.tree
    reached = frozenset(node.full_path for node in tree.nodes
                        if isinstance(node, MissionLeaf) and node.uid in played.reached)
    return Rehearsal(visits[-1].outcome, reached, branches(tree))


def branches(tree: Tree) -> Tuple[FrozenSet[str], ...]:
    """Return the branches of a tree that have mission leaves."""
    children = (child for node in tree.nodes if len(node.children) > 1 for child in node.children)
    leaves = (frozenset(node.full_path for node in child.iterate() if isinstance(node, MissionLeaf))
              for child in children)
    return tuple(filter(None, leaves))
