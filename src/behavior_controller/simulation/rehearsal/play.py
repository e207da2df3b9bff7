"""Plays a mission in virtual time, without ROS: the engine, leaves, recovery and policy against the
virtual robot.

Time goes from one event to the next, so a pass takes some hundredths of a second.
"""
import contextlib
import dataclasses
import math
import threading
import traceback
from typing import (Any, Collection, FrozenSet, Iterable, Iterator, List, Mapping, NamedTuple,
                    Optional, Sequence, Set, Tuple)

from behavior_controller import exit_codes, extensions, leaves
from behavior_controller.bt import ManualClock, Node, Result, TickError, IDLE, RUNNING
from behavior_controller.bt.engine.failure import node_on
from behavior_controller.bt.engine.tree import Change
from behavior_controller.bt.loader.checks import check
from behavior_controller.bt.loader.document import Document, read, with_includes
from behavior_controller.bt.loader.tree_builder import build
from behavior_controller.config.settings import Settings
from behavior_controller.errors import BehaviorControllerError
from behavior_controller.foreign_code import described
from behavior_controller.run.events import Event, Events, Line, PassFinished, PassStarted, TreeShown
from behavior_controller.run.history import Run
from behavior_controller.leaves.base import MissionLeaf
from behavior_controller.missions import load as missions
from behavior_controller.missions.runner import Running, TimeIsUp, VirtualTimeRunner
from behavior_controller.run.record.feed import Entries, traversed, written
from behavior_controller.run.record.tree_shown import shown
from behavior_controller.robot.declarations import Topic
from behavior_controller.robot.requests import Request

from behavior_controller.simulation.rehearsal import blocked_leaf
from behavior_controller.simulation.rehearsal.situations import Situations
from behavior_controller.simulation.behaviour import rehearsed_topics
from behavior_controller.simulation.faults import PlannedFault
from behavior_controller.simulation.journal import JournalEntry, unmet
from behavior_controller.simulation.virtual_robot import SHORTEST_GAP, VirtualRobot
from behavior_controller.simulation.visitor import Visitor
from behavior_controller.simulation.world import World, world as read_world
from behavior_controller.simulation import configuration

START = 1000.0
"""When a play begins, in seconds of its clock; events and journal have the times of that clock."""

PASS_LIMIT = 3600.0
"""Seconds of the mission's time after which a pass counts as one that does not end."""

STEP = 0.5
"""Seconds between two messages of each topic where nothing fails."""

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

CALM = configuration.defaults(failureRate=0.0, callTimes=configuration.NONE)
"""A test without faults in which every message comes in time."""


Place = Tuple[int, str]
"""The uid of the node at which something is wrong, and a description of that."""


class RunResult(NamedTuple):
    """The result of a play. ``exit_code`` is the controller's; None: it had not ended when its time
    was up."""

    events: Sequence[Tuple[float, Event]]  # as in a record
    journal: Sequence[JournalEntry]
    exit_code: Optional[int]
    cut_off: str  # why the play was stopped before the end
    # the exceptions that were reported, each with its node; 0: none, it ended the mission
    errors: Sequence[Place]
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
    left_behind: bytes = b""  # by the last pass, for the next visitor (``Situations``)
    unmet: Tuple[PlannedFault, ...] = ()  # planned, and no pass has made that call

    @property
    def has_timed_out(self) -> bool:
        """Whether its time, or the number of its requests, was used up before the mission's end."""
        return self.exit_code is None and self.cut_off != BUSY

    def run(self) -> Run:
        """Return the model of the run."""
        return Run(Line(at, event) for at, event in self.events)

    def last_pass(self) -> "RunResult":
        """Return the result without the passes before the last one."""
        begins = [place for place, (_, event) in enumerate(self.events)
                  if isinstance(event, PassStarted)]
        if len(begins) < 2:
            return self
        since = self.events[begins[-1]][0]
        journal = [entry for entry in self.journal if entry.time >= since]
        return self._replace(events=[*self.events[:begins[0]], *self.events[begins[-1]:]],
                             journal=journal)


class LoadedMission:
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
        self._shown = shown(self.mission.tree, specs=list(self._registry.values()))
        self.world = world or read_world("", settings)

    def world_of(self, test: configuration.Configuration) -> World:
        """Return the world of a test, before the robot's first request."""
        manners = self.world.visitor.manners._replace(behaviour=test.visitor_behaviour)
        return self.world._replace(visitor=Visitor(manners))

    def play(self, test: configuration.Configuration, silent: Collection[str] = (),
             shortest_gap: float = SHORTEST_GAP, has_situations: bool = False,
             then: Sequence[str] = ()) -> RunResult:
        """Play the mission with the faults, messages and visitors of ``test``; topics in ``silent``
        say nothing. ``then`` are the behaviours of the visitors after the first."""
        tree = build(self._documents, self._registry, ManualClock(START), checked=self._checked)
        alone = dataclasses.replace(self.settings, robot="")  # there is no other robot
        mission = dataclasses.replace(self.mission, tree=tree, settings=alone)
        robot = VirtualRobot(mission, self.world_of(test), test, shortest_gap)
        situations = Situations(tree, robot, has_situations, not test.planned_faults)
        topics = [topic for topic in rehearsed_topics(self.settings.interface)
                  if topic.name not in silent]
        return PlayRunner(robot, self._shown, situations, then).played(topics)


class PlayRunner(VirtualTimeRunner):
    """A play in progress: it records what happens."""

    def __init__(self, robot: VirtualRobot, shown_tree: TreeShown, situations: Situations,
                 then: Sequence[str]):
        self._robot, self._busy = robot, 0
        self._situations, self._left_behind, self._then = situations, b"", list(then)
        self._history: List[Tuple[float, Event]] = []
        self._ended = math.inf
        self._errors: List[Place] = []
        self._ticked: Set[int] = set()
        mission = robot.mission
        self._entries, events = Entries(mission.tree), Events()
        events.subscribe(self._note)
        robot.note = self._note
        self._note(shown_tree)
        mission.tree.follow(self._follow)
        context = mission.context(robot, robot.topics, events, robot.health)
        limit, runs = robot.test.test_timeout, robot.test.mission_runs + len(then)
        super().__init__(Running(mission.tree, context, mission.file, runs),
                         START + limit * (1 + len(then)), TIMED_OUT.format(limit))

    def played(self, topics: Iterable[Topic]) -> RunResult:
        """Play, with messages of ``topics``, until the mission is over or its time is up."""
        robot, cut_off = self._robot, ""
        exit_code: Optional[int] = None
        try:
            with blocked_leaf.ended(), self._thread_errors():
                for topic in topics:
                    robot.publish(topic)
                exit_code = self.run()
        except TimeIsUp as reason:
            cut_off, self._ended = str(reason), math.inf
        except Exception as error:  # as the node does: an exception in a leaf is an outcome too
            exit_code = exit_codes.BROKEN
            self._errors.append((0, described(error)))
        waiting = tuple(node.uid for node in self.tree.nodes if node.status is RUNNING
                        and not any(child.status is RUNNING for child in node.children))
        return RunResult(self._history, robot.journal, exit_code, cut_off, self._errors,
                         frozenset(self._ticked), waiting,
                         min(robot.clock.now(), self._ended) - START,
                         [query for query in robot.asked if query[0] <= self._ended],
                         robot.presence, self._ended, self._situations.met, self._left_behind,
                         unmet(robot.test.planned_faults, robot.journal))

    def _tick(self) -> Result:
        result = super()._tick()
        self._busy += self.tree.busy_loops
        if self._busy > MOST_BUSY:
            raise TimeIsUp(BUSY)
        if len(self._robot.asked) > MOST_REQUESTS:
            raise TimeIsUp(TOO_MANY)
        return result

    def _report(self, error: BehaviorControllerError, text: str) -> None:
        super()._report(error, text)
        self._errors.append((_node_of(error, self.tree.nodes), text))

    @contextlib.contextmanager
    def _thread_errors(self) -> Iterator[None]:
        """Report what ends a thread that a leaf has started, meanwhile."""
        def report(args: Any) -> None:
            failure = extensions.thread_failure(args.exc_value)
            if failure is None:
                before(args)
                return
            *_, (innermost, _) = traceback.walk_tb(args.exc_traceback)
            node = node_on(innermost)[0]
            self._errors.append((node.uid if node is not None else 0, str(failure)))

        before, threading.excepthook = threading.excepthook, report
        try:
            yield
        finally:
            threading.excepthook = before

    def _follow(self, is_first: Optional[bool], changes: List[Change]) -> None:
        self._robot.topics.reads.clear()
        news = self._entries.news()
        if news:
            self._note(written(*news))
        if is_first is not None:
            self._note(traversed(self.clock.now(), is_first, changes))
        self._ticked.update(node.uid for node, _, new in changes if new is not IDLE)

    def _note(self, event: Event) -> None:
        """Add an event to the run."""
        at = self._robot.stamp()
        self._history.append((at, event))
        if isinstance(event, PassFinished):
            self._ended = at
            self._left_behind = self._situations.left_behind()
        elif (isinstance(event, PassStarted) and self._then
              and event.number > self._robot.test.mission_runs):
            self._robot.world.visitor.succeed(self._then.pop(0))
            self._robot.topics.forget()


def _node_of(error: BehaviorControllerError, nodes: Sequence[Node]) -> int:
    """Return the node, or that of the script, in which an error was raised; 0 if none is known."""
    node, cause = (error.node, error.cause) if isinstance(error, TickError) else (None, error)
    origin = getattr(cause, "origin", None)
    if origin is not None and (node is None or node.element is not origin[0]):
        node = next((node for node in nodes if node.element is origin[0]), None)
    return node.uid if node is not None else 0


def leaves_reached(stage: LoadedMission,
                   test: configuration.Configuration) -> Optional[FrozenSet[str]]:
    """Return the paths of the mission leaves that one pass reaches with the visitor and the robot
    of ``test``, but without faults; None if the pass does not end."""
    calm = dataclasses.replace(test, failure_rate=0.0, planned_faults=(), mission_runs=1,
                               arrival_rate=CALM.arrival_rate, call_times=CALM.call_times,
                               test_timeout=PASS_LIMIT)
    played = stage.play(calm, shortest_gap=STEP)
    if not played.run().visits:
        return None
    return frozenset(node.full_path for node in stage.mission.tree.nodes
                     if isinstance(node, MissionLeaf) and node.uid in played.reached)
