"""Records of whole days in virtual time: visitors of all kinds, a robot that needs time and
sometimes fails."""
import random
from dataclasses import replace

import pytest

from behavior_controller import folders
from behavior_controller.config import settings
from behavior_controller.run.events import HealthChanged, PassFinished
from behavior_controller.robot.gateway import Cause, Failure
from behavior_controller.run.health import GONE
from behavior_controller.robot.d543 import ATTENTION, FACES, SPEECH
from behavior_controller.robot.requests import (
    Answer, AttentionStatus, Exhibit, Faces, GoTo, Location, PerformGesture, Point, QueryKnowledge,
    Say, SetAttention)
from behavior_controller.run.record import recorder as record_module
from behavior_controller.run.record.recorder import RecordFiles, encoded
from behavior_controller.simulation.configuration import REAL
from behavior_controller.simulation.faults import KINDS as FAULTS, REFUSED, PlannedFault
from behavior_controller.simulation.rehearsal.play import CALM, LoadedMission
from behavior_controller.simulation.visitor import BEHAVIOURS
from mission_rig import ENTRANCE, HOME, FileRecord, Rig, service_of, written

NAMES = ("Robot arm", "Sea chest", "Loom", "Weather balloon", "Printing press")
EXHIBITS = tuple(
    Exhibit(name, "This is the {}.".format(name.lower()), "It was made here, in the year {}.".
            format(1890 + 7 * n), Location(n, n + 0.5, 90.0), Point(n, n, 1.0))
    for n, name in enumerate(NAMES, 1))
STEP = 0.25  # seconds between two messages of a topic
BEGAN = 1_790_000_000.0  # when the clock of the record says that the day begins
KINDS = ("engages", "engages", "declines", "silent", "no gaze", "leaves", "robot refuses",
         "drive dies")


class Day:
    """Visitors one after another, of the given kinds in turn."""

    def __init__(self, kinds):
        self.kinds = kinds
        self.draw = random.Random(1)
        self.pending = []  # [when it is done, call]
        self.began = 0.0
        self.visit = -1
        self.is_dead = False

    def seconds(self, request):
        if isinstance(request, Say):
            return 1.0 + 0.06 * len(request.text)
        usual = {GoTo: 14.0, PerformGesture: 2.5, QueryKnowledge: 0.05}.get(type(request), 0.1)
        return usual * self.draw.uniform(0.8, 1.3)

    def answer(self, request):
        if isinstance(request, QueryKnowledge):
            return Answer(exhibits={"exhibits": EXHIBITS, "entrance": (ENTRANCE,),
                                    "home": (HOME,)}[request.what])
        if self.kind == "robot refuses" and isinstance(request,
                                                       PerformGesture) and self.draw.random() < 0.4:
            return Failure(Cause.REFUSED, "a joint is too hot", service_of(request))
        if self.kind == "drive dies" and isinstance(request, GoTo) and self.is_dead:
            return Failure(Cause.NOT_REACHABLE, "no node offers it", service_of(request))
        return Answer(response="1")

    @property
    def kind(self):
        return self.kinds[self.visit % len(self.kinds)]

    def begin(self, rig):
        self.visit, self.began = len(rig.of(PassFinished)), rig.clock.now()
        rig.topics.publish(FACES, Faces((), ()))

    def step(self, rig):
        if len(rig.of(PassFinished)) != self.visit:
            self.begin(rig)
        now, new = rig.clock.now(), rig.gateway.calls[len(self.pending):]
        self.pending += [[now + self.seconds(call.request), call] for call in new]
        rig.clock.advance(STEP)
        for entry in self.pending[-6:]:
            if entry[0] <= rig.clock.now() and entry[1].result is None:
                entry[1].finish(self.answer(entry[1].request))
        self.die(rig)
        self.publish(rig)

    def die(self, rig):
        is_dead = self.kind == "drive dies" and rig.clock.now() - self.began > 60
        if is_dead != self.is_dead:
            self.is_dead = is_dead
            rig.report(GONE, HealthChanged(
                "service", service_of(GoTo), "robotNavigation", not is_dead,
                "gone" if is_dead else "back", "the robot cannot drive" if is_dead else "", GONE))

    def publish(self, rig):
        since = rig.clock.now() - self.began
        is_there = since > 20.0 and not (self.kind == "leaves" and since > 75.0)
        gazes = is_there and self.kind != "no gaze"
        rig.topics.publish(FACES, Faces(("1",), (gazes,)) if is_there else Faces((), ()))
        modes = [
            request.state for request in rig.requests[-60:] if isinstance(request, SetAttention)]
        if modes and modes[-1] == "seeking":
            rig.topics.publish(ATTENTION, AttentionStatus("seeking", 1 if gazes else 0))
        says = {"declines": "no", "silent": None}.get(self.kind, "yes")
        if is_there and says is not None and int(since / STEP) % 8 == 0:
            rig.topics.publish(SPEECH, says)


def recorded_day(folder, monkeypatch, runs, kinds=KINDS):
    """Record so many visits of the lab tour, and return the path of the record."""
    day = Day(kinds)
    rig = Rig("lab_tour", answer=lambda request: None)
    rig.mission_file = folders.mission("lab_tour")
    monkeypatch.setattr(record_module.events, "unix_now", lambda: BEGAN + rig.clock.now() - 1000.0)
    monkeypatch.setattr(record_module, "MOST_FOR_DISK", 10 ** 9)
    record = FileRecord(str(folder), pytest.fail).open()
    rig.mission.events.subscribe(record)
    record.show(rig.tree)
    rig.mission.topics = record.topics(rig.topics)
    rig.run(day.step, runs=runs)
    return written(record)


def record_simulated_runs(folder, runs):
    """Record so many lab tours of the simulated robot, with three visitors each. Visitors and
    failing calls are drawn; in each third run navigation refuses from some call on."""
    stage, draw = LoadedMission(settings.defaults()), random.Random(1)
    for number in range(runs):
        first, *others = draw.choices(BEHAVIOURS, (6, 1, 1, 1, 2, 1), k=3)
        lasting = PlannedFault("robotNavigation", draw.randint(1, 10), REFUSED, is_lasting=True)
        test = replace(CALM, visitor_behaviour=first, call_times=REAL, random_seed=number,
                       failure_rate=draw.uniform(0.0, 0.2), fault_kinds=FAULTS,
                       planned_faults=() if number % 3 else (lasting,))
        files = RecordFiles(str(folder), pytest.fail)
        for at, event in stage.play(test, shortest_gap=STEP, then=others).events:
            files.put(encoded(BEGAN + 9000.0 * number + at, event))
        files.close()
        files._thread.join()  # ``close`` waits a second at most
