"""A mission on the real engine with a robot and a visitor of the test's own, and a clock that only the test moves."""
import os
import random

import pytest

from behavior_controller import events, folders, runner, settings
from behavior_controller import mission as missions
from behavior_controller.bt.engine.clock import ManualClock
from behavior_controller.bt.language.document import parse, read, with_includes
from behavior_controller.gateway import Cause, Failure, FakeGateway, FakeTopics
from behavior_controller.interface.document import ATTENTION, FACES, INTERFACE, SPEECH
from behavior_controller.interface.records import (Answer, AttentionStatus, Exhibit, Faces, Location, Point,
                                                   QueryKnowledge, SetAttention)
from behavior_controller.watch.record import Record

EXHIBITS = tuple(
    Exhibit("exhibit {}".format(n), "first text {}".format(n), "second text {}".format(n),
            Location(n, n + 0.5, 90.0), Point(n, n, 1.0)) for n in (1, 2))
ENTRANCE = Exhibit("entrance", "", "", Location(7.0, 8.0, 180.0), Point(7.5, 8.5, 1.5))
HOME = Exhibit("home", "", "", Location(0.5, 0.25, 0.0), Point(0.0, 0.0, 0.0))
CAUSES = [Cause.REFUSED, Cause.NOT_REACHABLE, Cause.NO_ANSWER, Cause.CONNECTION_LOST, Cause.HANDLER_EXCEPTION,
          Cause.TYPE_MISMATCH]
ASKS_WITHOUT_START_OF_TREE = """<Sequence><QueryTourSpeech/><ForceSuccess><ReactiveFallback>
<IsYesNoUttered/><ForceFailure><Sleep msec='2000'/></ForceFailure></ReactiveFallback></ForceSuccess>
<IsVisitorResponseYes/><LookUpEntrance/><Navigate/></Sequence>"""


class Rig:
    """``answer(request)`` returns a Failure, an Answer, None (never answers) or NotImplemented (the usual answer)."""

    def __init__(self, mission="lab_tour", answer=lambda request: NotImplemented, **changed):
        self.clock = ManualClock(1000.0)
        self.settings = settings.defaults(**changed)
        loaded = missions.load(self.settings, self.clock, documents=with_includes(
            parse(mission) if mission.lstrip().startswith("<") else read(folders.mission(mission))))
        self.tree = loaded.tree
        self.answer = answer
        self.seen = []
        self.mission_file = "lab_tour.xml"
        log = events.Events()
        log.subscribe(self.seen.append)
        self.gateway = FakeGateway(self.tree.wake.emit, self._reply)
        self.topics = FakeTopics(self.clock.now, self.tree.wake.emit)
        self.mission = loaded.context(self.gateway, self.topics, log)

    def _reply(self, request):
        answer = self.answer(request)
        if answer is not NotImplemented:
            return answer
        if isinstance(request, QueryKnowledge):
            return Answer(exhibits={"exhibits": EXHIBITS, "entrance": (ENTRANCE,), "home": (HOME,)}[request.what])
        return Answer(response="1")

    @property
    def requests(self):
        """What the robot was asked, in order."""
        return self.gateway.requests

    def of(self, kind):
        """Return the events of one kind."""
        return [event for event in self.seen if isinstance(event, kind)]

    def tick(self):
        """Set up once, and tick."""
        if self.tree.nodes and not hasattr(self, "_is_set_up"):
            self.tree.setup(mission=self.mission)
            self._is_set_up = True
        return self.tree.tick_once()

    def run(self, visitor, runs=1, **options):
        """Run passes; ``visitor(rig)`` acts whenever the mission waits; ``options`` are the runner's. Return the code."""
        rig = self

        class Waiting(runner.Runner):
            def wait(self, seconds):
                if seconds != runner.GIVE_WAY:
                    visitor(rig)

        options.setdefault("is_stopped", lambda: False)
        self.runner = Waiting(runner.Running(self.tree, self.mission, self.mission_file, runs), **options)
        return self.runner.run()


def one_leaf(element, answer=lambda request: NotImplemented, **changed):
    """Return a rig whose mission is this one element."""
    text = "<root BTCPP_format='4'><BehaviorTree ID='M'>{}</BehaviorTree></root>".format(element)
    return Rig(text, answer, **changed)


def write(rig, **entries):
    """Write entries of the mission's blackboard."""
    for key, value in entries.items():
        rig.tree.blackboard.set(key, value)


def visitor_who(says=None, gazes=True, step=0.5):
    """Return a visitor who is seen, looks at the robot when it seeks, and says ``says`` again and again."""
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

    rig = Rig(mission, answer=answer, asrEnabled=by_voice) if mission.lstrip().startswith("<") else Rig(
        os.path.splitext(os.path.basename(mission))[0], answer=answer, asrEnabled=by_voice)
    record = Record(str(folder), rig.clock, pytest.fail)
    rig.mission.events.subscribe(record)
    record.show(rig.tree)
    rig.mission.gateway, rig.mission.topics = record.gateway(rig.gateway), record.topics(rig.topics)
    rig.mission_file = mission
    rig.run(visitor, runs=runs)
    record.close()
    return record.path


def service_of(request):
    """Return the canonical name of the service for a request, or for a kind of requests."""
    return INTERFACE.service(request if isinstance(request, type) else type(request)).name


def refusal(request):
    """Return the failure of a server that says no."""
    return Failure(Cause.REFUSED, "the server refused", service_of(request))
