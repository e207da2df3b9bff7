"""Plays a mission without ROS, with a robot that never fails and the visitor of the test: what should be reached.

The mission is played by the engine itself, but not by the node under test: not its ROS edge, its clock or its process.
"""
from typing import Any, Dict, FrozenSet, List, NamedTuple, Optional, Tuple, Union

from behavior_controller import mission as missions
from behavior_controller import settings
from behavior_controller.bt.engine.clock import ManualClock
from behavior_controller.bt.engine.node import Node
from behavior_controller.bt.engine.tree import Tree
from behavior_controller.bt.language.document import read, with_includes
from behavior_controller.errors import BehaviorControllerError
from behavior_controller.events import Event, Events, LeafFinished, PassFinished
from behavior_controller.gateway import Cause, Failure, FakeGateway, FakeTopics
from behavior_controller.interface.records import (Answer, GoTo, Prompt, QueryKnowledge, Request, Say, SetAttention)
from behavior_controller.leaves.base import MissionLeaf
from behavior_controller.runner import Runner, Running

from unit_tests.exhibits import Knowledge
from unit_tests.journal import Line
from unit_tests.robot import SERVICES, TOPICS, Fields, World, topics
from unit_tests.visitor import Manners, Visitor

STEP = 0.5
"""Seconds between two messages of each topic."""

MOST_STEPS = 7200
"""A rehearsal that has not ended by then (an hour of the mission's time) does not end."""


class Rehearsal(NamedTuple):
    """How the mission should go: its outcome, the paths of the leaves that it reaches, and its branches.

    A branch is a child of a node with several children; it is given as the paths of the mission leaves below it.
    """

    outcome: str
    reached: FrozenSet[str]
    branches: Tuple[FrozenSet[str], ...]


class _Stage(Runner):
    """A runner that waits for nothing: the world goes on a step instead."""

    world: World
    topics: FakeTopics
    steps = 0

    def wait(self, seconds: Optional[float]) -> None:
        """Let time pass, and every topic be published."""
        self.steps += 1
        self.clock.advance(STEP)
        for topic in topics(self.world.settings.interface):
            value = TOPICS[topic.name].content(self.world)
            if value is not None:
                self.topics.publish(topic, value)


def rehearse(mission: str, chosen: Dict[str, Any], manners: Manners, knowledge: Knowledge) -> Optional[Rehearsal]:
    """Return how one pass of ``mission`` goes with the configuration ``chosen``; None if that cannot be told."""
    try:
        clock = ManualClock(1000.0)
        given = settings.defaults(**{key: value for key, value in chosen.items() if key != "recordDirectory"})
        loaded = missions.load(given, clock, documents=with_includes(read(mission)))
    except (BehaviorControllerError, OSError, TypeError):
        return None
    world = World(Visitor(manners), knowledge, given)
    events = Events()
    seen: List[Event] = []
    events.subscribe(seen.append)
    tree = loaded.tree
    topics = FakeTopics(clock.now, tree.wake.emit)
    gateway = FakeGateway(tree.wake.emit, lambda request: _answer(request, world))
    context = loaded.context(gateway, topics, events)
    stage = _Stage(Running(tree, context, mission, 1), lambda: stage.steps >= MOST_STEPS)
    stage.world, stage.topics = world, topics
    stage.run()
    outcomes = [event.outcome for event in seen if isinstance(event, PassFinished)]
    if not outcomes:
        return None
    reached = frozenset(event.path for event in seen if isinstance(event, LeafFinished))
    return Rehearsal(outcomes[-1], reached, branches(tree))


def _answer(request: Request, world: World) -> Union[Answer, Failure]:
    """Do what the simulated nodes do with a request, and let the visitor see it; what is not simulated is done."""
    service, fields = world.settings.interface.service(type(request)), _fields(request)
    world.visitor.notice(Line(0.0, service.node, service.name, 1, fields))
    simulated = SERVICES.get(type(request))
    answer = simulated.answer(fields, world) if simulated is not None else Answer()
    return answer or Failure(Cause.REFUSED, "the visitor's answer is no", service.name)


def _fields(request: Request) -> Fields:
    """Return what a visitor sees of a request and what its answer rests on."""
    if isinstance(request, SetAttention):
        return {"state": request.state}
    if isinstance(request, Say):
        return {"message": request.text}
    if isinstance(request, GoTo):
        return {"goal_x": request.goal.x, "goal_y": request.goal.y}
    if isinstance(request, QueryKnowledge):
        return {"parameters": request.what}
    if isinstance(request, Prompt):
        return {"message": "|".join(request.options)}
    return {}


def branches(tree: Tree) -> Tuple[FrozenSet[str], ...]:
    """Return the branches of a tree that have mission leaves."""
    found = (_leaves_below(child) for node in tree.nodes if len(node.children) > 1 for child in node.children)
    return tuple(paths for paths in found if paths)


def _leaves_below(node: Node) -> FrozenSet[str]:
    return frozenset(below.full_path for below in node.iterate() if isinstance(below, MissionLeaf))
