"""Plays a mission without ROS, with a robot that never fails and the visitor of the test: what should be reached.

The mission is played by the engine itself, but not by the node under test: not its ROS edge, its clock or its process.
"""
import dataclasses
from typing import Any, Dict, FrozenSet, NamedTuple, Optional, Tuple

from behavior_controller import settings
from behavior_controller.bt.engine.node import Node
from behavior_controller.bt.engine.tree import Tree
from behavior_controller.bt.language.document import read, with_includes
from behavior_controller.errors import BehaviorControllerError
from behavior_controller.events import LeafFinished, PassFinished
from behavior_controller.leaves.base import MissionLeaf

from unit_tests.exhibits import Knowledge
from unit_tests.robot import World
from unit_tests.stage import CALM, Stage
from unit_tests.visitor import Manners, Visitor

STEP = 0.5
"""Seconds between two messages of each topic."""

LONGEST = 3600.0
"""A rehearsal that has not ended after so many seconds of the mission's time does not end."""


class Rehearsal(NamedTuple):
    """How the mission should go: its outcome, the paths of the leaves that it reaches, and its branches.

    A branch is a child of a node with several children; it is given as the paths of the mission leaves below it.
    """

    outcome: str
    reached: FrozenSet[str]
    branches: Tuple[FrozenSet[str], ...]


def rehearse(mission: str, chosen: Dict[str, Any], manners: Manners, knowledge: Knowledge) -> Optional[Rehearsal]:
    """Return how one pass of ``mission`` goes with the configuration ``chosen``; None if that cannot be told."""
    try:
        given = settings.defaults(**{key: value for key, value in chosen.items() if key != "recordDirectory"})
        stage = Stage(given, with_includes(read(mission)), World(Visitor(manners), knowledge, given))
    except (BehaviorControllerError, OSError, TypeError):
        return None
    return rehearse_on(stage, manners.behaviour)


def rehearse_on(stage: Stage, behaviour: str) -> Optional[Rehearsal]:
    """Do the same with a mission that was read before."""
    test = dataclasses.replace(CALM, visitor_behaviour=behaviour, test_timeout=LONGEST)
    events = [event for _, event in stage.play(test, shortest_gap=STEP).events]
    outcomes = [event.outcome for event in events if isinstance(event, PassFinished)]
    if not outcomes:
        return None
    reached = frozenset(event.path for event in events if isinstance(event, LeafFinished))
    return Rehearsal(outcomes[-1], reached, branches(stage.mission.tree))


def branches(tree: Tree) -> Tuple[FrozenSet[str], ...]:
    """Return the branches of a tree that have mission leaves."""
    found = (_leaves_below(child) for node in tree.nodes if len(node.children) > 1 for child in node.children)
    return tuple(paths for paths in found if paths)


def _leaves_below(node: Node) -> FrozenSet[str]:
    return frozenset(below.full_path for below in node.iterate() if isinstance(below, MissionLeaf))
