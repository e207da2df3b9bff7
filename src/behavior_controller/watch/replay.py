"""Runs a recorded mission again, without ROS, on the recorded answers and messages: does it take the same path?"""
import argparse
import glob
import itertools
import os
import sys
from typing import Any, Callable, Dict, Iterator, List, NamedTuple, Optional, Tuple, TypeVar, Union

from behavior_controller import exits, folders, knowledge_files, leaves, phrases, policy, settings
from behavior_controller.bt.engine.clock import ManualClock
from behavior_controller.bt.language.document import parse
from behavior_controller.bt.status import FAILURE, NAMES, RUNNING, SUCCESS
from behavior_controller.errors import BehaviorControllerError, ConfigurationError, Fault, FaultsFound, MissionError
from behavior_controller.events import Events, HealthChanged, PassFinished, PassStarted, RunStarted
from behavior_controller.gateway import Call, Failure, Gateway, Sample, Topics
from behavior_controller.health import Health
from behavior_controller.interface import Interface, Topic
from behavior_controller.interface.records import Answer, Request
from behavior_controller.interface.robots import INTERFACES
from behavior_controller.knowledge_files import Knowledge
from behavior_controller.mission import Mission, build_tree, load_tree
from behavior_controller.text import Source, Unreadable, clean, read_bytes
from behavior_controller.watch.codec import (LETTERS, Answered, Asked, Entry, Line, Lost, Message, Tick, TreeNode,
                                             TreeShown, decode)
from behavior_controller.watch.record import FILE_NAME, MOST_BYTES
from behavior_controller.watch.report import story_lines, to_html

Part = TypeVar("Part")

LATEST = "latest"
"""The argument that means the newest record of the default folder."""


class Outcome(NamedTuple):
    """The result of a replay. ``divergence`` says where the runs diverge; empty: nowhere."""

    passes: int
    changes: int
    divergence: str = ""

    def __str__(self) -> str:
        """Return the line for the operator."""
        if self.divergence:
            return "the runs diverge {}".format(clean(self.divergence))
        return "the same path: {} passes, {} changes of status".format(self.passes, self.changes)


class Diverged(Exception):
    """The replay differs from the record; the text says where."""


def find_record(name: str) -> str:
    """Return the path of a record, given that, the folder of one run, or ``latest``: the newest of the default folder."""
    if name == LATEST and not os.path.exists(name):
        paths = _records_below(folders.records())
        if not paths:
            raise MissionError([Fault(os.path.join(folders.records(), "*", FILE_NAME), 0, 0, "there is no record yet",
                                      "name a record or its folder")])
        return paths[-1]
    path = os.path.join(name, FILE_NAME)
    below = _records_below(name)
    if not below or os.path.exists(path):
        return path if os.path.isdir(name) else name
    if len(below) > 1:
        raise MissionError([Fault(name, 0, 0, "the folder has the records of {} runs".format(len(below)),
                                  "name one, the newest is {}".format(os.path.dirname(below[-1])))])
    return below[0]


def _records_below(folder: str) -> List[str]:
    return sorted(filter(os.path.isfile, glob.glob(os.path.join(glob.escape(folder), "*", FILE_NAME))))


def read_record(path: str) -> List[Line]:
    """Return the lines of a record. Raises MissionError if it cannot be read or is invalid."""
    return list(stream_record(path))


def stream_record(path: str) -> Iterator[Line]:
    """Yield the lines of ``read_record`` one by one: a fault is raised when its line is reached."""
    try:
        data = read_bytes(path, MOST_BYTES)
    except Unreadable as error:
        raise MissionError([Fault(path, 0, 0, "the record cannot be read: {}".format(error))]) from error
    return decode(data, path)


def replay(lines: List[Line], mission: Optional[str] = None) -> Outcome:
    """Run the record again, with the file ``mission`` in place of each mission in it if one is given.

    Raises BehaviorControllerError if that file, or the content of the record, cannot be run.
    """
    replaying: Optional[_Replay] = None
    passes, changes = 0, 0
    nodes: List[TreeNode] = []
    for _, entry in lines:
        if isinstance(entry, TreeShown):
            nodes = entry.nodes
        elif isinstance(entry, RunStarted):
            replaying = _Replay(entry, nodes, mission)
        elif replaying is not None:
            passes += isinstance(entry, PassFinished)
            try:
                changes += replaying.take(entry)
            except Diverged as diverged:
                return Outcome(passes, changes, "in pass {}, {}".format(passes + 1, diverged))
    return Outcome(passes, changes)


def _restored(what: str, read: Callable[[], Part]) -> Part:
    """Return the result of ``read``, a part of a record. Raises MissionError, in one line, if this release cannot use it."""
    try:
        return read()
    except FaultsFound as found:
        more = len(found.faults) - 1
        raise _unusable("its {} cannot be used: {}{}".format(
            what, found.faults[0], "; and {} more".format(more) if more else "")) from found


def _unusable(text: str) -> MissionError:
    return MissionError([Fault("the record", 0, 0, text, "replay it with the release that wrote it")])


class _Replay:
    """One mission of a record, and the recorded answers and messages."""

    def __init__(self, started: RunStarted, nodes: List[TreeNode], mission: Optional[str]):
        sources = started.sources
        if sources.interface not in INTERFACES:
            raise _unusable("its interface is {}; this release has {}".format(
                sources.interface, ", ".join(INTERFACES)))
        self.clock = ManualClock()
        self.tree = load_tree(mission, clock=self.clock) if mission is not None else _restored(
            "mission", lambda: build_tree([parse(text, file) for file, text in sources.documents], clock=self.clock))
        self._nodes = nodes  # of the record, by uid - 1
        self._world = _World(INTERFACES[sources.interface])
        self._health = Health()
        self._began: Optional[float] = None
        self._now: List[Tuple[str, str]] = []
        chosen = _restored("configuration", lambda: settings.recorded(started.settings, "settings"))
        spoken = _restored("phrases", lambda: phrases.read(sources.phrases))
        rules = _restored("recovery policy", lambda: policy.read(sources.policy, leaves.mission_specs()))
        known = _restored("knowledge", lambda: _knowledge(sources.knowledge, INTERFACES[sources.interface]))
        self.tree.subscribe(lambda node, old, new: self._now.append((node.full_path, LETTERS[new])))
        restored = Mission(chosen, started.mission, spoken, rules, self.tree, known)
        self._mission = restored.context(self._world, self._world, Events(), self._health)
        self.tree.setup(mission=self._mission)

    def take(self, entry: Entry) -> int:
        """Process one entry; a traversal is repeated and compared. Return how many statuses it changed."""
        if isinstance(entry, (Asked, Answered, Message)):
            self._world.take(entry)
        elif isinstance(entry, Lost):
            raise Diverged("the record lacks {} lines".format(entry.lines))
        elif isinstance(entry, PassStarted):
            self._mission.begin_visit(self.tree.blackboard, entry.at)
        elif isinstance(entry, HealthChanged):
            self._health.report(entry.respect, entry)
            self._health.publish(Events())
        elif isinstance(entry, Tick):
            return self._traverse(entry)
        return 0

    def _traverse(self, tick: Tick) -> int:
        self.clock.set_to(tick.at)
        self._began = tick.at if self._began is None else self._began
        self._now.clear()
        self._world.begin()
        result: Any = None
        try:
            if tick.first:
                self.clock.run_due()
            result = self.tree.root.execute()
        except BehaviorControllerError:
            pass  # it ended a pass of the recorded run too
        self._compare([(self._nodes[uid - 1].path, letter) for uid, letter in tick.changes], tick.at - self._began)
        if result is SUCCESS or result is FAILURE:
            self.tree.root.reset()
        elif result is not RUNNING:
            self.tree.halt()
        return len(tick.changes)

    def _compare(self, recorded: List[Tuple[str, str]], seconds: float) -> None:
        """Raise ``Diverged`` at the first difference."""
        status = next(("recorded is {}, now it is {}".format(_words(was), _words(now))
                       for was, now in itertools.zip_longest(recorded, self._now) if was != now), "")
        differences = "; ".join(filter(None, (status, self._world.difference())))
        if differences:
            raise Diverged("{:.1f} s after its mission began: {}".format(seconds, differences))


def _knowledge(sources: Tuple[Source, ...], interface: Interface) -> Optional[Knowledge]:
    if interface.has_knowledge_files != (len(sources) == 2):
        raise ConfigurationError([Fault("sources.knowledge", 0, 0, "{} files do not fit the robot {}".format(
            len(sources), interface.name))])
    return knowledge_files.read(sources[0], sources[1]) if sources else None


def _words(change: Optional[Tuple[str, str]]) -> str:
    words: Dict[str, str] = {letter: NAMES[status] for status, letter in LETTERS.items()}
    return "no further change" if change is None else "{} {}".format(change[0], words[change[1]])


class _Recorded(Call):
    """A call that has its recorded result from the traversal on that read it."""

    def __init__(self, request: Request):
        self.request = request
        self.result = None

    def drop(self) -> None:
        """Do nothing: the recorded result comes anyway."""


class _World(Gateway, Topics):
    """The recorded answers and messages: those that a traversal read precede it in the record."""

    def __init__(self, interface: Interface) -> None:
        self._interface = interface
        self._calls: List[_Recorded] = []
        self._wanted: List[Request] = []  # requests that the traversal must make
        self._results: Dict[int, Union[Answer, Failure]] = {}
        self._messages: List[Tuple[Topic, int, Optional[Sample]]] = []
        self._newest: Dict[Topic, Optional[Sample]] = {}
        self._reads: Dict[Topic, int] = {}
        self._difference = ""  # between the requests that are made and the recorded ones

    def take(self, entry: Union[Asked, Answered, Message]) -> None:
        """Store a request, an answer or a message of the next traversal."""
        if isinstance(entry, Asked):
            self._wanted.append(entry.request)
        elif isinstance(entry, Answered):
            self._results[entry.call] = entry.result
        else:
            sample = None if entry.value is None else Sample(entry.value, entry.arrived)
            self._messages.append((self._interface.topic(entry.topic), entry.read, sample))

    def begin(self) -> None:
        """A traversal begins."""
        self._reads.clear()
        for number, result in list(self._results.items()):
            if number <= len(self._calls):
                self._calls[number - 1].result = self._results.pop(number)

    def start(self, request: Request) -> Call:
        """Compare a request with the recorded one; its answer is the recorded one's."""
        call = _Recorded(request)
        self._calls.append(call)
        recorded = self._wanted.pop(0) if self._wanted else None
        if not self._difference and recorded != request:
            self._difference = "recorded is {}, now it asks {} for {}".format(
                "no request" if recorded is None else "the request {}".format(recorded),
                self._interface.resource(type(request)), request)
        call.result = self._results.pop(len(self._calls), None)
        return call

    def difference(self) -> str:
        """Return how the requests of the traversal differ from the recorded ones; empty if they do not."""
        if self._wanted and not self._difference:
            return "recorded is the request {}, now there is none".format(self._wanted[0])
        return self._difference

    def newest(self, topic: Topic) -> Optional[Sample]:
        """Return the recorded message for this read of a topic."""
        self._reads[topic] = self._reads.get(topic, 0) + 1
        for entry in list(self._messages):
            if entry[0] is topic and entry[1] <= self._reads[topic]:
                self._newest[topic] = entry[2]
                self._messages.remove(entry)
        return self._newest.get(topic)

    def wake_when(self, key: Any, topic: Topic, wanted: Any) -> None:
        """Do nothing: the record decides when the tree is traversed."""


# ------------------------------------------------------------------------------------------------------- the command


def main(arguments: Optional[List[str]] = None) -> int:
    """Return the exit code of ``replayMission``: 0 the same path, 3 another path, 2 the record cannot be replayed."""
    parser = argparse.ArgumentParser(
        prog="replayMission", description="Runs a recorded mission again and says whether it takes the same path.")
    parser.add_argument("record", help="mission.jsonl of a run, its folder, or {}: the newest in {}".format(
        LATEST, folders.records()))
    instead = parser.add_mutually_exclusive_group()
    instead.add_argument("--mission", metavar="FILE",
                         help="run this file, such as the edited mission, instead of the mission in the record")
    instead.add_argument("--report", metavar="OUT.html", help="write a report of the recorded run as a web page instead")
    instead.add_argument("--story", action="store_true", help="print what happened instead, a line each")
    chosen = parser.parse_args(arguments)
    try:
        path = find_record(chosen.record)
        if chosen.report:
            _write(chosen.report, to_html(stream_record(path)))
            return exits.SUCCESS
        if chosen.story:
            print("\n".join(story_lines(stream_record(path))))
            return exits.SUCCESS
        outcome = replay(read_record(path), chosen.mission)
    except BehaviorControllerError as error:
        print(error, file=sys.stderr)
        return exits.WRONG_INPUT
    print(outcome)
    return exits.FAILURE if outcome.divergence else exits.SUCCESS


def _write(path: str, text: str) -> None:
    try:
        with open(path, "w", encoding="utf-8", errors="replace") as file:
            file.write(text)
    except (OSError, ValueError) as error:
        raise MissionError([Fault(path, 0, 0, "the report cannot be written: {}".format(
            getattr(error, "strerror", None) or error))]) from error
