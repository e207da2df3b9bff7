"""Runs a recorded mission again, without ROS, on the recorded answers and messages: does it take
the same path?"""
import itertools
from typing import Any, Dict, Iterator, List, NamedTuple, Optional, Sequence, Tuple, Union

from msgspec.structs import replace

from behavior_controller import leaves
from behavior_controller.config import knowledge_files, phrases, recovery_policy, settings
from behavior_controller.bt import FAILURE, ManualClock, RUNNING, SUCCESS, Tree
from behavior_controller.bt.loader.document import parse
from behavior_controller.bt.values.status import NAMES
from behavior_controller.errors import (
    BehaviorControllerError, ConfigurationError, FaultsFound, MissionError)
from behavior_controller.run import events
from behavior_controller.run.history import with_tree
from behavior_controller.robot.gateway import Call, Failure, FakeGateway, Sample, Topics
from behavior_controller.run.health import Health
from behavior_controller.robot.declarations import Interface, Topic
from behavior_controller.robot.requests import Answer, Request
from behavior_controller.robot.interfaces import INTERFACES
from behavior_controller.config.knowledge_files import Knowledge
from behavior_controller.missions.load import Mission, build_tree, load_tree
from behavior_controller.text import Source, clean, count, joined

NAME_OF: Dict[str, str] = {letter: name for name, letter in events.LETTERS.items()}


class Replayed(NamedTuple):
    """The result of a replay. ``divergence`` says where the runs diverge; empty: nowhere.

    ``missing`` says what the record lacks: the replay leaves out up to the next pass.
    """

    passes: int
    changes: int
    divergence: str = ""
    missing: Tuple[str, ...] = ()

    def __str__(self) -> str:
        """Return the line for the operator."""
        text = f"the runs diverge {clean(self.divergence)}"
        if not self.divergence:
            changes = count(self.changes, "change of status", "changes of status")
            text = f"the same path: {count(self.passes, 'pass', 'passes')}, {changes}"
        if self.missing:
            text += clean(f"; {'; '.join(self.missing)}: left out up to the next pass, and what "
                          "that was left with (entries, spent recoveries) is not known")
        return text


class Diverged(Exception):
    """The replay differs from the record; the text says where."""


def replay(lines: List[events.Line], mission: Optional[str] = None) -> Replayed:
    """Run the record again, with the file ``mission`` in place of each mission in it if one is
    given.

    Raises BehaviorControllerError if that file, or the content of the record, cannot be run.
    """
    replaying: Optional[_Replay] = None
    passes, changes, number, missing = 0, 0, 1, []
    for line, tree in with_tree(lines):
        event = line.event
        if isinstance(event, events.RunStarted):
            replaying = _Replay(event, tree.nodes, mission)
        elif replaying is not None:
            if isinstance(event, events.PassStarted):
                number = event.number
            elif isinstance(event, events.PassFinished):
                passes, number = passes + (not replaying.skips), event.number + 1
            elif isinstance(event, events.Lost):
                missing.append(str(event))
            try:
                changes += replaying.take(event)
            except Diverged as diverged:
                return Replayed(passes, changes, f"in pass {number}, {diverged}", tuple(missing))
    return Replayed(passes, changes, "", tuple(missing))


def _restored(started: events.RunStarted, clock: ManualClock, mission: Optional[str]) -> Mission:
    """Return the mission of a record, with the file ``mission`` in its place if one is given.

    Raises MissionError, in one line, if this release cannot use the record.
    """
    sources = started.sources
    if sources.interface not in INTERFACES:
        raise _unusable(
            f"its interface is {sources.interface}; this release has {', '.join(INTERFACES)}")
    edited = load_tree(mission, clock=clock) if mission is not None else None
    try:
        return Mission(
            settings.recorded(started.settings, "settings", started.offers), started.mission,
            phrases.recorded(sources.phrases),
            recovery_policy.read(sources.policy, leaves.mission_specs()),
            edited or build_tree([parse(text, file) for file, text in sources.documents],
                                 clock=clock),
            _knowledge(sources.knowledge, INTERFACES[sources.interface]))
    except FaultsFound as invalid:
        first, *others = invalid.faults
        more = f"; and {len(others)} more" if others else ""
        raise _unusable(f"it cannot be used: {first}{more}") from invalid


def _unusable(text: str) -> FaultsFound:
    return MissionError.of("the record", text, "replay it with the release that wrote it")


class RecordedTopics(Topics):
    """The recorded messages: those that a traversal read precede it in the record."""

    def __init__(self, interface: Interface) -> None:
        self._interface = interface
        self._messages: List[Tuple[Topic, int, Sample]] = []
        self._recent: Dict[Topic, Tuple[Sample, ...]] = {}
        self._reads: Dict[Topic, int] = {}
        self._hearing: List[str] = []  # on which topics the robot still hears something

    def take(self, event: events.Event) -> None:
        """Store a message, or that the robot still hears something, for the next traversal."""
        if isinstance(event, events.RecognitionPending):
            self._hearing.append(event.topic)
        elif isinstance(event, events.Message):
            sample = Sample(event.value, event.arrived)
            self._messages.append((self._interface.topic(event.topic), event.read, sample))

    def begin(self) -> None:
        """A traversal begins."""
        self._reads.clear()

    def recent(self, topic: Topic) -> Tuple[Sample, ...]:
        """Return the recorded messages for this read of a topic."""
        self._reads[topic] = self._reads.get(topic, 0) + 1
        for message in list(self._messages):
            topic_read, read, sample = message
            if topic_read is topic and read <= self._reads[topic]:
                self._recent[topic] = topic.kept(self._recent.get(topic, ()), sample)
                self._messages.remove(message)
        return self._recent.get(topic, ())

    def is_hearing(self, topic: Topic) -> bool:
        """Return whether it is recorded for this traversal, once for each time it was asked."""
        if topic.name not in self._hearing:
            return False
        self._hearing.remove(topic.name)
        return True

    def wake_when(self, key: Any, topic: Topic, wanted: Any) -> None:
        """Do nothing: the record decides when the tree is traversed."""


def traverse_again(tree: Tree, clock: ManualClock, tick: events.Tick, recorded: Sequence[object],
                   changes: List[Any]) -> Tuple[Any, Optional[BehaviorControllerError]]:
    """Repeat a traversal at its time; ``changes``, to which an observer of the tree adds its
    changes of status, becomes comparable with the ``recorded`` ones. The caller compares them and
    then calls ``complete``.

    Return the result, or None and the exception that ended the pass, as it did in the recorded run.
    """
    clock.set_to(tick.at)
    changes.clear()
    try:
        if tick.first:
            clock.run_due()
            # what a timer halts between two traversals has a line of its own
            if list(recorded[:len(changes)]) != changes:
                changes.clear()
        return tree.traverse(bool(tick.first)), None
    except BehaviorControllerError as error:
        return None, error


def complete(tree: Tree, result: Any) -> None:
    """End a repeated tick with this result: what has not ended by itself, and goes on no longer, is
    halted."""
    if tree.complete(result) not in (RUNNING, SUCCESS, FAILURE):
        tree.stop()


class _Replay(FakeGateway):
    """One mission of a record, as the robot that it asks: with the recorded answers."""

    def __init__(self, started: events.RunStarted, nodes: List[events.TreeNode],
                 mission: Optional[str]):
        super().__init__(reply=lambda request: self._results.pop(len(self.calls), None))
        self._clock = ManualClock()
        restored = _restored(started, self._clock, mission)
        self._tree = restored.tree
        self._nodes = nodes  # of the record, by uid - 1
        self._interface = restored.settings.interface
        self._topics, self._health = RecordedTopics(self._interface), Health()
        self._before: Optional[int] = None  # number of the call before the first one here
        self.skips = False
        """The record lacks something, and the next pass has not begun."""
        self._began: Optional[float] = None
        self._statuses: List[Tuple[str, str]] = []  # that the traversal has changed
        self._wanted: List[Request] = []  # requests that the traversal must make
        self._results: Dict[int, Union[Answer, Failure]] = {}  # of the calls that it makes
        self._difference = ""  # between the requests that are made and the recorded ones
        self._tree.subscribe(lambda node, old, new: self._statuses.append(
            (node.full_path, events.LETTERS[NAMES[new]])))
        self._mission = restored.context(self, self._topics, events.Events(), self._health)
        self._tree.setup(mission=self._mission)

    def take(self, event: events.Event) -> int:
        """Store what the next traversal needs; a traversal is repeated and compared. Return how
        many statuses it changed. Raises ``Diverged``."""
        if isinstance(event, events.Lost):
            self._skip()
        elif isinstance(event, events.PassStarted):
            self.skips = False
            if not self._tree.is_idle:  # the pass before was ended from outside
                self._tree.stop()
            self._mission.begin_visit(self._tree.blackboard, event.at)
        elif isinstance(event, events.HealthChanged):
            self._health.report(event.respect, event)
            self._health.publish(events.Events())
        elif isinstance(event, events.Message):
            self._topics.take(replace(event, read=1) if self.skips else event)
        elif self.skips:
            return 0
        elif isinstance(event, events.Asked):
            if self._before is None:
                self._before = event.call - 1
            self._wanted.append(event.request)
        elif isinstance(event, events.Answered):
            self._answer(event.call - (self._before or 0), event.result)
        elif isinstance(event, events.Tick):
            if event.first is None:  # it follows from what the traversals do
                return 0
            self._traverse(event)
            return len(event.changes)
        else:
            self._topics.take(event)
        return 0

    def _answer(self, call: int, result: Union[Answer, Failure]) -> None:
        if call > len(self.calls):
            self._results[call] = result
        elif call > 0:  # else it was asked in a pass that is not repeated
            self.calls[call - 1].finish(result)

    def _skip(self) -> None:
        """Forget what is under way: the next pass is repeated again, with what is known of robot
        and messages."""
        self._tree.stop()
        self.skips, self._before = True, None
        self._wanted.clear()
        self._results.clear()
        self.calls.clear()

    def _traverse(self, tick: events.Tick) -> None:
        if self._began is None:
            self._began = tick.at
        self._topics.begin()
        recorded = [(self._nodes[uid - 1].path, letter) for uid, letter in tick.changes]
        result, _ = traverse_again(self._tree, self._clock, tick, recorded, self._statuses)
        differences = joined("; ", *self._differences(recorded))
        if differences:
            seconds = tick.at - self._began
            raise Diverged(f"{seconds:.1f} s after its mission began: {differences}")
        complete(self._tree, result)

    def _differences(self, recorded: Sequence[Tuple[str, str]]) -> Iterator[str]:
        """Yield the first difference of statuses, and that of requests."""
        pairs = itertools.zip_longest(recorded, self._statuses)
        yield next((f"recorded is {_words(was)}, now it is {_words(now)}"
                    for was, now in pairs if was != now), "")
        if self._wanted and not self._difference:
            yield f"recorded is the request {self._wanted[0]}, now there is none"
        yield self._difference

    # --------------------------------------------------------------------------------- as the robot

    def start(self, request: Request) -> Call:
        """Compare a request with the recorded one; its answer is the recorded one's."""
        recorded, words = None, "no request"
        if self._wanted:
            recorded = self._wanted.pop(0)
            words = f"the request {recorded}"
        if not self._difference and recorded != request:
            asked = self._interface.resource(type(request))
            self._difference = f"recorded is {words}, now it asks {asked} for {request}"
        return super().start(request)


def _knowledge(sources: Tuple[Source, ...], interface: Interface) -> Optional[Knowledge]:
    if interface.has_knowledge_files != (len(sources) == 2):
        raise ConfigurationError.of(
            "sources.knowledge", f"{len(sources)} files do not fit the robot {interface.name}")
    if not sources:
        return None
    return knowledge_files.read(sources[0], sources[1], takes_arm=interface.takes_arm)


def _words(change: Optional[Tuple[str, str]]) -> str:
    if change is None:
        return "no further change"
    path, letter = change
    return f"{path} {NAME_OF[letter]}"
