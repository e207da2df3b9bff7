"""Plays a mission in virtual time, without ROS: the engine, leaves, recovery and policy against the
virtual robot.

Time goes from one event to the next, so a pass takes some hundredths of a second.
"""
import dataclasses
import math
import os
from typing import (
    Collection, Dict, FrozenSet, List, Mapping, NamedTuple, Optional, Sequence, Set, Tuple)

from behavior_controller import exit_codes, leaves
from behavior_controller.bt.engine.clock import ManualClock
from behavior_controller.bt.engine.node import Result
from behavior_controller.bt.engine.tree import Change
from behavior_controller.bt.linter.walker import check
from behavior_controller.bt.loader.document import Document, read, with_includes
from behavior_controller.bt.loader.tree_builder import build
from behavior_controller.bt.status import IDLE, RUNNING
from behavior_controller.config.settings import Settings
from behavior_controller.execution.events import Event, Events, Line, PassFinished
from behavior_controller.execution.run import Run
from behavior_controller.missions import load as missions
from behavior_controller.missions.runner import PACE, Runner, Running
from behavior_controller.monitoring.record.recorder import Entries, shown, traversed, written
from behavior_controller.robot.requests import Request

from unit_tests.rehearsal import blocked_leaf
from unit_tests.rehearsal.situations import Situations
from unit_tests.robot.behaviour import rehearsed_topics
from unit_tests.robot.building import Building
from unit_tests.robot.journal import JournalEntry
from unit_tests.robot.virtual_robot import SHORTEST_GAP, VirtualRobot
from unit_tests.robot.visitor import Visitor
from unit_tests.robot.world import World, world as read_world
from unit_tests.robot import options
from unit_tests.robot.options import Configuration

START = 1000.0
"""When a play begins, in seconds of its clock; events and journal have the times of that clock."""

LONG_PACE = 0.25
"""Seconds between the ticks of a mission that changes something at every tick, instead of
``runner.PACE``."""

TIMED_OUT = "the mission did not end within {:g} s"
"""Why a play stops at the time limit."""

BUSY = "the mission busy-loops"
"""Why a play stops if the mission never waits."""

MOST_REQUESTS = 1000
"""Requests of a pass after which it counts as one that does not end; the delivered missions make at
most 80."""

TOO_MANY = f"the mission did not end within {MOST_REQUESTS} requests"

MOST_BUSY = 10
"""Ticks without a wait after which a mission counts as busy-looping."""

CALM = options.defaults(failureRate=0.0, callTimes=options.NONE)
"""A test without faults in which every message comes in time."""


class Played(NamedTuple):
    """The result of a play. ``exit_code`` is the controller's; None: it had not ended when its time
    was up."""

    events: Sequence[Tuple[float, Event]]  # as in a record
    journal: Sequence[JournalEntry]
    exit_code: Optional[int]
    cut_off: str  # why the play was stopped before the end
    error: str  # an exception that ended the mission; empty: none
    reached: FrozenSet[int]  # the uids of the nodes that were ticked
    # the uids of the nodes that were running at the end, without a running child
    waiting: Tuple[int, ...]
    seconds: float
    # the mission's requests, whether or not they reached their node
    asked: Sequence[Tuple[float, Request]]
    presence: Sequence[Tuple[float, bool]]  # times from which on a visitor was present, or was not
    # when the last pass ended; what the journal has later is the safe state
    ended: float = math.inf
    # what each call met that reached a node, by that and its number, if it was asked for
    situations: Mapping[Tuple[str, int], bytes] = {}

    def run(self) -> Run:
        """Return the model of the run."""
        return Run(Line(at, event) for at, event in self.events)


class Stage:
    """A mission without faults, and the world in which it can be played any number of times."""

    def __init__(self, settings: Settings, documents: Optional[Sequence[Document]] = None,
                 world: Optional[World] = None):
        """``documents`` are played instead of the configured mission; the mission is the last of
        them. Raises FaultsFound."""
        self.settings = settings
        self._documents = documents or with_includes(
            read(missions.find(settings.scenario_specification)))
        self.mission = missions.load(settings, ManualClock(START), documents=self._documents)
        """The mission, with a tree that is not played."""
        self._registry = leaves.registry()
        self._checked = check(self._documents, self._registry)
        self.world = world or read_world("", settings)

    @classmethod
    def of_file(cls, settings: Settings, path: str) -> "Stage":
        """Return the stage for a mission file. Raises FaultsFound."""
        name = os.path.splitext(os.path.basename(path))[0]
        return cls(dataclasses.replace(settings, scenario_specification=name),
                   with_includes(read(path)))

    @property
    def knowledge(self) -> Building:
        return self.world.knowledge

    def world_of(self, test: Configuration) -> World:
        """Return the world of a test, before the robot's first request."""
        manners = self.world.visitor.manners._replace(behaviour=test.visitor_behaviour)
        return self.world._replace(visitor=Visitor(manners))

    def play(self, test: Configuration, silent: Collection[str] = (),
             shortest_gap: float = SHORTEST_GAP, has_situations: bool = False) -> Played:
        """Play the mission with the faults, messages and visitors of ``test``; topics in ``silent``
        say nothing."""
        tree = build(self._documents, self._registry, ManualClock(START), checked=self._checked)
        mission = dataclasses.replace(self.mission, tree=tree)
        play = _Play(mission, self.world_of(test), test, shortest_gap)
        if has_situations:
            play.note_situations()
        return play.run(silent)


class _TimeIsUp(Exception):
    """The play ends here; the text says why."""


class _VirtualRunner(Runner):
    """A runner that advances the clock to the next event instead of waiting for it."""

    deadline = math.inf
    robot: VirtualRobot
    _busy = 0

    def _tick(self) -> Result:
        result = super()._tick()
        self._busy += self.tree.busy_loops
        if self._busy > MOST_BUSY:
            raise _TimeIsUp(BUSY)
        if len(self.robot.asked) > MOST_REQUESTS:
            raise _TimeIsUp(TOO_MANY)
        return result

    def wait(self, seconds: Optional[float]) -> None:
        """Advance time until the tree is woken, by ``seconds`` at most."""
        clock, wake = self.clock, self.tree.wake
        assert isinstance(clock, ManualClock)
        if seconds == PACE:
            seconds = LONG_PACE
        limit = math.inf if seconds is None else clock.now() + seconds
        while not wake.test_and_clear():
            due = clock.next_due()
            moment = limit if due is None else min(limit, due)
            if moment > self.deadline and not self._is_over():  # the last pass was in time
                raise _TimeIsUp(TIMED_OUT.format(self.deadline - START))
            clock.set_to(max(clock.now(), moment))
            clock.run_due()
            if moment == limit:
                return


class _Play:
    """A play in progress: it runs the mission and records what happens."""

    def __init__(self, mission: missions.Mission, world: World, test: Configuration,
                 shortest_gap: float):
        self._mission, self._test = mission, test
        self._robot = VirtualRobot(mission, world, test, self._note, shortest_gap)
        self._events: List[Tuple[float, Event]] = []
        self._entries = Entries(mission.tree)
        self._ended = math.inf
        self._reached: Set[int] = set()
        self._met: Dict[Tuple[str, int], bytes] = {}

    def note_situations(self) -> None:
        """Note what each call meets, from the first fault on if one is planned."""
        situations = Situations(self._mission.tree, self._robot)
        is_wanted = not self._test.planned_faults

        def note(entry: JournalEntry) -> None:
            nonlocal is_wanted
            if is_wanted:
                self._met[entry.node, entry.call] = situations.now()
            is_wanted = is_wanted or entry.fault is not None

        self._robot.called = note

    def run(self, silent: Collection[str]) -> Played:
        """Play until the mission is over or its time is up."""
        robot, tree = self._robot, self._mission.tree
        events = Events()
        events.subscribe(self._note)
        self._note(shown(tree))
        tree.follow(self._follow)
        for topic in rehearsed_topics(self._mission.settings.interface):
            if topic.name not in silent:
                robot.publish(topic)
        context = self._mission.context(robot.gateway, robot.topics, events, robot.health)
        running = Running(tree, context, self._mission.file, self._test.mission_runs)
        runner = _VirtualRunner(running, lambda: False)
        runner.deadline = START + self._test.test_timeout
        runner.robot = robot
        return self._played(*_ended(runner))

    def _played(self, exit_code: Optional[int], cut_off: str, error: str) -> Played:
        robot = self._robot
        ended = self._ended if exit_code is not None else math.inf
        running = [node for node in self._mission.tree.nodes if node.status is RUNNING]
        waiting = tuple(node.uid for node in running
                        if not any(child.status is RUNNING for child in node.children))
        asked = [(at, request) for at, request in robot.asked if at <= ended]
        return Played(self._events, robot.journal, exit_code, cut_off, error,
                      frozenset(self._reached), waiting, min(robot.clock.now(), ended) - START,
                      asked, robot.presence, ended, self._met)

    def _follow(self, is_first: Optional[bool], changes: List[Change]) -> None:
        self._robot.topics.reads.clear()
        news = self._entries.news()
        if news:
            self._note(written(*news))
        if is_first is not None:
            self._note(traversed(self._robot.clock.now(), is_first, changes))
        self._reached.update(node.uid for node, _, new in changes if new is not IDLE)

    def _note(self, event: Event) -> None:
        """Add an event to the run."""
        at = self._robot.stamp()
        self._events.append((at, event))
        if isinstance(event, PassFinished):
            self._ended = at


def _ended(runner: Runner) -> Tuple[Optional[int], str, str]:
    """Run, and return the exit code, why the end was not awaited, and the exception that ended the
    run."""
    try:
        with blocked_leaf.ended():
            return runner.run(), "", ""
    except _TimeIsUp as reason:
        return None, str(reason), ""
    except Exception as error:  # as the node does: an exception in a leaf is an outcome too
        return exit_codes.BROKEN, "", f"{type(error).__name__}: {' '.join(str(error).split())}"
