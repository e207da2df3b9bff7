"""Runs a recorded mission again, without ROS, on the recorded answers and messages: does it take the same path?"""
import argparse
import glob
import itertools
import os
import sys
from typing import Any, Dict, List, NamedTuple, Optional, Tuple, Union

from behavior_controller import folders, leaves, phrases, policy, settings
from behavior_controller.bt.engine.clock import ManualClock
from behavior_controller.bt.engine.tree import Tree
from behavior_controller.bt.status import FAILURE, RUNNING, SUCCESS
from behavior_controller.errors import BehaviorControllerError, Fault, MissionError
from behavior_controller.events import Events, HealthChanged
from behavior_controller.gateway import Call, Cause, Failure, Gateway, Sample, Topics
from behavior_controller.health import Health
from behavior_controller.interface import Topic
from behavior_controller.interface.document import ATTENTION, FACES, INTERFACE, SPEECH
from behavior_controller.interface.records import Answer, AttentionStatus, Exhibit, Faces, Location, Point, Request
from behavior_controller.leaves.base import MissionContext
from behavior_controller.leaves.vocabulary import load as load_mission
from behavior_controller.text import Unreadable, clean, read_bytes
from behavior_controller.watch.board import LETTERS
from behavior_controller.watch.record import FILE_NAME, LOST, MOST_BYTES, plain_request, sha256
from behavior_controller.watch.report import to_html
from behavior_controller.watch.shape import RecordShape

LATEST = "latest"
"""What is given for the newest record of the default folder."""

Line = Dict[str, Any]
READ = {
    FACES: lambda value: Faces(tuple(value[0]), tuple(value[1])),
    ATTENTION: lambda value: AttentionStatus(*value),
    SPEECH: lambda value: value,
}


class Outcome(NamedTuple):
    """What a replay found. ``parting`` says where the paths part; empty: they are the same."""

    mission: str
    is_edited: bool
    passes: int
    changes: int
    parting: str = ""

    def __str__(self) -> str:
        """Return the lines for a person."""
        edited = "{} has changed since the record was made\n".format(clean(self.mission)) if self.is_edited else ""
        if self.parting:
            return edited + "the paths part {}".format(clean(self.parting))
        return edited + "the same path: {} passes, {} changes of status".format(self.passes, self.changes)


class Parted(Exception):
    """The replay went another way than the record; the text says where."""


def find_record(name: str) -> str:
    """Return the path of a record: ``latest`` is the newest of the default folder, a folder is that of one run."""
    if name == LATEST and not os.path.exists(name):
        place = os.path.join(folders.records(), "*", FILE_NAME)
        paths = sorted(filter(os.path.isfile, glob.glob(place)))
        if not paths:
            raise MissionError([Fault(place, 0, 0, "there is no record yet", "name a record or its folder")])
        return paths[-1]
    return os.path.join(name, FILE_NAME) if os.path.isdir(name) else name


def read_record(path: str) -> List[Line]:
    """Return the lines of a record, without a torn end. Raises MissionError, which names the first line that is none."""
    try:
        lines = read_bytes(path, MOST_BYTES).split(b"\n")
    except Unreadable as error:
        raise MissionError([Fault(path, 0, 0, "the record cannot be read: {}".format(error))]) from error
    found: List[Line] = []
    shape = RecordShape()
    del lines[-1]  # what follows the last line's end was torn when the node was killed
    for number, line in enumerate(lines, 1):
        try:
            found.append(shape.line(line))
        except ValueError as error:
            raise MissionError([Fault(path, number, 1, "this is no line of a record: {}".format(error),
                                      "a record is written by the node")]) from error
    if not shape.has_mission:
        raise MissionError([Fault(path, 0, 0, "the record has no mission in it",
                                  "was the node stopped before it began?")])
    return found


def replay(lines: List[Line]) -> Outcome:
    """Run the record again. Raises BehaviorControllerError if the mission cannot be read any more."""
    replaying: Optional[_Replay] = None
    is_edited, passes, changes, mission = False, 0, 0, ""
    tree: Line = {}
    for line in lines:
        if line["event"] == "Tree":
            tree = line
        if line["event"] == "RunStarted":
            mission = line["mission"]
            is_edited = is_edited or sha256(mission) != line["sha256"]
            replaying = _Replay(line, [entry[0] for entry in tree["nodes"]])
        elif replaying is not None:
            passes += line["event"] == "PassFinished"
            try:
                changes += replaying.take(line)
            except Parted as parted:
                return Outcome(mission, is_edited, passes, changes, "in pass {}, {}".format(passes + 1, parted))
    return Outcome(mission, is_edited, passes, changes)


class _Replay:
    """One mission of a record, and the world as it was told."""

    def __init__(self, started: Line, paths: List[str]):
        self.clock = ManualClock()
        self.tree: Tree = load_mission(started["mission"], clock=self.clock)
        self._paths = paths  # of the record's nodes, by uid - 1
        self._world = _World()
        self._health = Health()
        self._began: Optional[float] = None
        self._now: List[Tuple[str, str]] = []
        chosen = settings.recorded(started["settings"], "settings of the record")
        events = Events()
        self.tree.subscribe(lambda node, old, new: self._now.append((node.full_path, LETTERS[new])))
        self._mission = MissionContext(
            self._world, self._world, chosen, phrases.load(chosen.language),
            policy.load(folders.config("recoveryPolicy.ini"), leaves.SPECS), self.clock, events, self._health)
        self.tree.setup(mission=self._mission)

    def take(self, line: Line) -> int:
        """Take in one line; a traversal is made again and compared. Return how many statuses it changed."""
        kind = line["event"]
        if kind in ("Asked", "Answered", "Message"):
            self._world.take(line)
        elif kind == LOST:
            raise Parted("the record lacks {} lines".format(line["lines"]))
        elif kind == "PassStarted":
            self.clock._now = line["at"]
            self._mission.begin_visit(self.tree.blackboard, line["at"])
        elif kind == "HealthChanged":
            change = HealthChanged(*(line[name] for name in HealthChanged._fields))
            self._health.report(change.respect, change)
            self._health.publish(Events())
        elif kind == "Tick":
            return self._traverse(line)
        return 0

    def _traverse(self, line: Line) -> int:
        self.clock._now = line["at"]
        self._began = line["at"] if self._began is None else self._began
        self._now.clear()
        self._world.begin()
        result: Any = None
        try:
            if line["first"]:
                self.clock.run_due()
            result = self.tree.root.execute()
        except BehaviorControllerError:
            pass  # it ended a pass of the recorded run too
        self._compare([(self._paths[uid - 1], letter) for uid, letter in line["changes"]], line["at"] - self._began)
        if result is SUCCESS or result is FAILURE:
            self.tree.root.reset()
        elif result is not RUNNING:
            self.tree.halt()
        return len(line["changes"])

    def _compare(self, recorded: List[Tuple[str, str]], seconds: float) -> None:
        """Raise ``Parted`` at the first difference."""
        differences = [self._world.difference()]
        for was, now in itertools.zip_longest(recorded, self._now):
            if was != now:
                differences.insert(0, "recorded is {}, now it is {}".format(_words(was), _words(now)))
                break
        if any(differences):
            raise Parted("{:.1f} s after its mission began: {}".format(seconds, "; ".join(filter(None, differences))))


def _words(change: Optional[Tuple[str, str]]) -> str:
    words = {"R": "RUNNING", "S": "SUCCESS", "F": "FAILURE", "-": "IDLE"}
    return "no further change" if change is None else "{} {}".format(change[0], words[change[1]])


class _Recorded(Call):
    """A call that has its recorded result from the traversal on that saw it."""

    def __init__(self, request: Request):
        self.request = request
        self.result = None

    def drop(self) -> None:
        """Nobody waits any more."""


class _World(Gateway, Topics):
    """Answers and messages as the record has them: those that a traversal saw stand before it."""

    def __init__(self) -> None:
        self._calls: List[_Recorded] = []
        self._wanted: List[Line] = []  # requests that the traversal is to make
        self._results: Dict[int, Union[Answer, Failure]] = {}
        self._messages: List[Tuple[Topic, int, Optional[Sample]]] = []
        self._newest: Dict[Topic, Optional[Sample]] = {}
        self._reads: Dict[Topic, int] = {}
        self._difference = ""  # between the requests that are made and the recorded ones

    def take(self, line: Line) -> None:
        """Take in a request, an answer or a message of the traversal that follows."""
        if line["event"] == "Asked":
            self._wanted.append(line)
        elif line["event"] == "Answered":
            self._results[line["call"]] = _failure(line["failure"]) if "failure" in line else _answer(line["answer"])
        else:
            topic = INTERFACE.topic(line["topic"])
            sample = None if line["value"] is None else Sample(READ[topic](line["value"]), line["arrived"])
            self._messages.append((topic, line["read"], sample))

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
        if not self._difference and (recorded is None or recorded["request"] != plain_request(request)):
            self._difference = "recorded is {}, now it asks {} for {}".format(
                "no request" if recorded is None else "the request {}".format(recorded["request"]),
                INTERFACE.service(type(request)).name,
                plain_request(request))
        call.result = self._results.pop(len(self._calls), None)
        return call

    def difference(self) -> str:
        """Return how the requests of the traversal differ from the recorded ones; empty if they do not."""
        if self._wanted and not self._difference:
            return "recorded is the request {}, now there is none".format(self._wanted[0]["request"])
        return self._difference

    def newest(self, topic: Topic) -> Optional[Sample]:
        """Return what the record has for this look at a topic."""
        self._reads[topic] = self._reads.get(topic, 0) + 1
        for entry in list(self._messages):
            if entry[0] is topic and entry[1] <= self._reads[topic]:
                self._newest[topic] = entry[2]
                self._messages.remove(entry)
        return self._newest.get(topic)

    def wake_when(self, key: Any, topic: Topic, wanted: Any) -> None:
        """Nobody is to be woken: the record says when the tree was traversed."""


def _failure(fields: Dict[str, str]) -> Failure:
    return Failure(Cause(fields["cause"]), fields["message"], fields["resource"])


def _answer(fields: List[Any]) -> Answer:
    response, exhibits = fields
    return Answer(response, tuple(Exhibit(name, first, second, Location(*place), Point(*target))
                                  for name, first, second, place, target in exhibits))


# ------------------------------------------------------------------------------------------------------- the command

SAME, BAD_FILE, PARTED = 0, 2, 3


def main(arguments: Optional[List[str]] = None) -> int:
    """Return the exit code of ``replayMission``: 0 the same path, 3 another one, 2 the record cannot be replayed."""
    parser = argparse.ArgumentParser(
        prog="replayMission", description="Runs a recorded mission again and says whether it takes the same path.")
    parser.add_argument("record", help="mission.jsonl of a run, its folder, or {}: the newest in {}".format(
        LATEST, folders.records()))
    parser.add_argument("--report", metavar="OUT.html", help="write a report of the recorded run as a web page instead")
    chosen = parser.parse_args(arguments)
    try:
        lines = read_record(find_record(chosen.record))
        if chosen.report:
            _write(chosen.report, to_html(lines))
            return SAME
        outcome = replay(lines)
    except BehaviorControllerError as error:
        print(error, file=sys.stderr)
        return BAD_FILE
    print(outcome)
    return PARTED if outcome.parting else SAME


def _write(path: str, text: str) -> None:
    try:
        with open(path, "w", encoding="utf-8", errors="replace") as file:
            file.write(text)
    except (OSError, ValueError) as error:
        raise MissionError([Fault(path, 0, 0, "the report cannot be written: {}".format(
            getattr(error, "strerror", None) or error))]) from error
