"""A mission on the real engine with a robot and a visitor of the test's own, and a clock that only
the test moves."""
import random

import pytest

from behavior_controller import folders
from behavior_controller.bt.values.status import FAILURE, RUNNING, SUCCESS
from behavior_controller.run import events
from behavior_controller.missions import runner
from behavior_controller.missions.load import describe
from behavior_controller.missions.trial import Trial
from behavior_controller.run.record.codec import Decoder
from behavior_controller.viewer.board import Board
from behavior_controller.run.record.recorder import LineQueue, Record, RecordFiles
from behavior_controller.robot.d543 import ATTENTION, FACES, INTERFACE, SPEECH
from behavior_controller.robot.gateway import Cause, Failure
from behavior_controller.robot.requests import (
    Answer, AttentionStatus, Exhibit, Faces, Location, Point, QueryKnowledge, SetAttention)
from behavior_controller.text import Source

EXHIBITS = tuple(
    Exhibit("exhibit {}".format(n), "first text {}".format(n), "second text {}".format(n),
            Location(n, n + 0.5, 90.0), Point(n, n, 1.0)) for n in (1, 2))
ENTRANCE = Exhibit("entrance", "", "", Location(7.0, 8.0, 180.0), Point(7.5, 8.5, 1.5))
HOME = Exhibit("home", "", "", Location(0.5, 0.25, 0.0), Point(0.0, 0.0, 0.0))
RUN = events.RunStarted("some/where/lab_tour.xml", [], {},
                        events.Sources((), Source("", ""), Source("", ""), ""),
                        {offer.name: offer.kind for offer in INTERFACE.offers})
# of a runner without a wait for an event; without a limit such a test would not end
MOST_ROUNDS = 2 * runner.ROUNDS_AT_ONCE
CAUSES = [Cause.REFUSED, Cause.NOT_REACHABLE, Cause.NO_ANSWER, Cause.CONNECTION_LOST,
          Cause.HANDLER_EXCEPTION, Cause.TYPE_MISMATCH]
ASKS_WITHOUT_START_OF_TREE = """<Sequence><QueryTourSpeech/><ForceSuccess><ReactiveFallback>
<IsYesNoUttered/><ForceFailure><Sleep msec='2000'/></ForceFailure></ReactiveFallback></ForceSuccess>
<IsVisitorResponseYes/><LookUpEntrance/><Navigate/></Sequence>"""


class Rig(Trial):
    """``answer(request)`` returns a Failure, an Answer, None (never answers) or NotImplemented (the
    usual answer)."""

    def __init__(self, mission="lab_tour", answer=lambda request: NotImplemented, **changed):
        is_name = "<" not in mission and not mission.endswith(".xml")
        super().__init__(folders.mission(mission) if is_name else mission, self._reply, **changed)
        self.answer = answer
        self.mission_file = "lab_tour.xml"
        self._passed = None
        self.mission.events.subscribe(self._note_pass)

    def _reply(self, request):
        answer = self.answer(request)
        if answer is not NotImplemented:
            return answer
        if isinstance(request, QueryKnowledge):
            return Answer(exhibits={"exhibits": EXHIBITS, "entrance": (ENTRANCE,),
                                    "home": (HOME,)}[request.what])
        return Answer(response="1")

    @property
    def requests(self):
        """What the mission asked of the robot, in order; not what the end of the run asks after the
        last pass."""
        return self.gateway.requests[:self._passed]

    @property
    def last_requests(self):
        """What the end of the run asked for after the last pass."""
        return self.gateway.requests[len(self.requests):]

    def _note_pass(self, event):
        if isinstance(event, (events.PassStarted, events.PassFinished)):
            self._passed = None if isinstance(event, events.PassStarted) else len(
                self.gateway.requests)

    def report(self, respect, change):
        """Have the monitoring find a change, and tell it."""
        self.mission.health.report(respect, change)
        self.mission.health.publish(self.mission.events)

    def of(self, kind):
        """Return the events of one kind."""
        return [event for event in self.events if isinstance(event, kind)]

    def run(self, visitor, runs=1, **options):
        """Run passes; ``visitor(rig)`` acts whenever the mission waits; ``options`` are the
        runner's. Return the code."""
        rig, publish, rounds = self, self.mission.health.publish, []

        def go_round(events):  # the runner publishes at each tick and before each wait
            rounds.append(events)
            assert len(rounds) < MOST_ROUNDS, "the runner does not wait"
            publish(events)

        class Waiting(runner.Runner):
            def wait(self, seconds):
                if seconds != runner.GIVE_WAY:
                    rounds.clear()
                    visitor(rig)

        self.mission.health.publish = go_round

        options.setdefault("is_stopped", lambda: False)
        self.runner = Waiting(runner.Running(self.tree, self.mission, self.mission_file, runs),
                              **options)
        try:
            return self.runner.run()
        finally:
            self.mission.health.publish = publish


def one_leaf(element, answer=lambda request: NotImplemented, **changed):
    """Return a rig whose mission is this one element."""
    return Rig(element, answer, **changed)


WOKEN, ASLEEP, NO_TIMER = True, False, None


def follow(rig, topic, steps):
    """Go through steps: seconds pass; a status is that of a tick; the tree was ``WOKEN`` since the
    last look, or is ``ASLEEP``; no time is waited for; anything else comes on the topic."""
    for number, step in enumerate(steps):
        if isinstance(step, bool):
            assert rig.tree.wake.test_and_clear() is step, number
        elif isinstance(step, float):
            rig.clock.advance(step)
        elif step in (RUNNING, SUCCESS, FAILURE):
            assert rig.tick() is step, number
        elif step is NO_TIMER:
            assert rig.clock.next_due() is None, number
        else:
            rig.topics.publish(topic, step)


def write(rig, **entries):
    """Write entries of the mission's blackboard."""
    for key, value in entries.items():
        rig.tree.blackboard.set(key, value)


def visitor_who(says=None, gazes=True, step=0.5):
    """Return a visitor who is seen, looks at the robot when it seeks, and says ``says`` again and
    again."""
    def act(rig):
        rig.clock.advance(step)
        rig.topics.publish(FACES, Faces(("1",), (gazes,)))
        modes = [request.state for request in rig.requests if isinstance(request, SetAttention)]
        if modes and modes[-1] == "seeking":
            rig.topics.publish(ATTENTION, AttentionStatus("seeking", 1 if gazes else 0))
        if says is not None:
            rig.topics.publish(SPEECH, says)
    return act


def recorded(folder, visitor, by_voice=True, failure_rate=0.0, seed=0, mission=None, runs=1):
    """Run the lab tour, record it, and return the path of the record."""
    draw = random.Random(seed)
    mission = mission or folders.mission("lab_tour")

    def answer(request):
        if draw.random() < failure_rate:
            return Failure(draw.choice(CAUSES), "drawn", service_of(request))
        return NotImplemented

    rig = Rig(mission, answer=answer, asrEnabled=by_voice)
    record = FileRecord(str(folder)).open()
    rig.mission.events.subscribe(record)
    record.show(rig.tree)
    rig.mission.topics = record.topics(rig.topics)
    rig.mission_file = mission
    rig.run(visitor, runs=runs)
    return written(record)


def written(record):
    """Return the path of a record when all of it is written: each ``close`` waits a second at most.
    """
    while record.is_kept:
        record.close()
    return record.path


def decode(data, file):
    """Yield the lines of a record with this content."""
    decoder = Decoder(file)
    yield from decoder.read_all(data)
    decoder.finish()


def service_of(request):
    """Return the canonical name of the service for a request, or for a kind of requests."""
    return INTERFACE.service(request if isinstance(request, type) else type(request)).name


def refusal(request):
    """Return the failure of a server that says no."""
    return Failure(Cause.REFUSED, "the server refused", service_of(request))


def refusing(*kinds):
    """Return a robot that says no to requests of these kinds."""
    return lambda request: refusal(request) if isinstance(request, kinds) else NotImplemented


def hanging(*kinds):
    """Return a robot that never answers requests of these kinds."""
    return lambda request: None if isinstance(request, kinds) else NotImplemented


class LiveBoard(Board):
    """What a page shows of a rig, made of the lines of its record without a thread."""

    def __init__(self, rig):
        queue = LineQueue()
        self.record = Record(queue, describe=describe)

        def lines():
            self.record.hand_over()
            return queue.take()

        super().__init__(lines)
        rig.mission.events.subscribe(self.record)

    def show(self, tree, heard={}):
        """Show a tree from now on."""
        self.record.show(tree, heard)

    def part(self, name):
        self.refresh()
        return super().part(name)

    def node(self, uid):
        self.refresh()
        return super().node(uid)

    def at(self, moment):
        self.refresh()
        return super().at(moment)


def board_of(rig):
    """Return a board that shows the rig's mission."""
    board = LiveBoard(rig)
    board.show(rig.tree, rig.mission.health.last_arrivals)
    return board


LOADED = 30.0
"""Seconds for threads that have other work before them."""


class FileRecord(Record):
    """A record that is written below ``folder`` after ``open``."""

    def __init__(self, folder, complain=pytest.fail):
        super().__init__(describe=describe)
        self._make_files = lambda: RecordFiles(folder, complain)
        self.files = None

    def open(self):
        self.files = self._make_files()
        self.add(self.files)
        return super().open()

    @property
    def path(self):
        return self.files.path

    def close(self):
        """Close it, and wait on a loaded machine for longer than the product does."""
        self._is_over.set()
        self._thread.join(LOADED)
        super().close()
        self.files._thread.join(LOADED)

    @property
    def is_kept(self):
        """Whether lines are still written."""
        return self.files._thread.is_alive()
