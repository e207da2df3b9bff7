"""A mission goes by the time of a simulator: at any rate, while it stands still, when it jumps back.

No thread and no master: the simulator's time goes on while the tick thread waits.
"""
import argparse
import struct
import threading

import pytest

from behavior_controller import exit_codes
from behavior_controller.bt.engine.clock import Clock, SimulatedClock
from behavior_controller.wakeup import WakeUp
from behavior_controller.bt.loader.document import parse, with_includes
from behavior_controller.config import settings
from behavior_controller.missions import load
from behavior_controller.missions.replay import replay
from behavior_controller.missions.runner import Runner, Running
from behavior_controller.robot.d543 import FACES, INTERFACE, SPEECH
from behavior_controller.robot.gateway import FakeGateway, FakeTopics, since
from behavior_controller.robot.requests import Answer, Faces
from behavior_controller.errors import NodesMissing
from behavior_controller.ros import simulated_time, watchdog
from behavior_controller.ros.master import Directory
from behavior_controller.ros.simulated_time import SimulatedTime
from behavior_controller.ros.subscriber import TopicBuffer
from behavior_controller.ros.types import CLOCK
from behavior_controller.run import events
from behavior_controller.run.events import (
    Events, HealthChanged, Line, Noticed, PassFinished, PassStarted, SignOfLife)
from behavior_controller.run.health import SILENT, SIMULATED_TIME, Health
from behavior_controller.run.history import Run
from behavior_controller.run.moment import robot_line
from behavior_controller.run.record.codec import encode
from behavior_controller.run.record.feed import Feed
from behavior_controller.run.record.recorder import LineQueue, Record
from behavior_controller.viewer.main import Viewer
from ros_peers import Master, Publisher, until

DOCUMENT = ("<root BTCPP_format='4'><BehaviorTree ID='M'><Sequence>{}</Sequence></BehaviorTree>"
            "</root>")


class Simulator(WakeUp):
    """While the tick thread waits, the time goes on to the next of ``times``."""

    def __init__(self, *times):
        super().__init__()
        self.clock = SimulatedClock(self.emit)
        self.times = list(times)
        self.waits = []

    def wait(self, seconds):
        while not self.is_set:
            self.waits.append(seconds)
            assert self.times, "it waits for more than the time that comes"
            self.clock.set_to(self.times.pop(0))


def run(leaves, simulator, runs=1, record=None):
    """Run a mission to its end; return the exit code, and what was emitted."""
    loaded = load.load(settings.defaults(), simulator.clock, simulator,
                       with_includes(parse(DOCUMENT.format(leaves))))
    log, emitted = Events(), []
    log.subscribe(emitted.append)
    gateway = FakeGateway(simulator.emit, lambda request: Answer())
    topics = FakeTopics(simulator.clock.arrival, simulator.emit)
    if record is not None:
        log.subscribe(record)
        topics = record.topics(topics)
    context = loaded.context(gateway, topics, log)
    running = Running(loaded.tree, context, "m.xml", runs,
                      lambda: record and record.show(loaded.tree))
    return Runner(running, lambda: False).run(), emitted


def seconds_of(emitted):
    return [event.seconds for event in emitted if isinstance(event, PassFinished)]


# --------------------------------------------------------------------------------------- the clock


@pytest.mark.parametrize("step", [0.001, 0.1, 2.0])
def test_a_sleep_ends_with_the_first_message_at_which_it_is_due(step):
    simulator = Simulator(*(500.0 + step * number for number in range(20000)))
    code, emitted = run('<Sleep msec="10000"/>', simulator)
    assert code == exit_codes.SUCCESS
    assert seconds_of(emitted) == [pytest.approx(10.0, abs=1e-6 + step / 1000)]
    # the time of the process ends no wait for the simulator's
    assert set(simulator.waits) == {None}


def test_no_timer_is_due_while_the_time_stands_still():
    simulator = Simulator(*[7.0] * 1000, 7.5, 8.0)
    assert run('<Sleep msec="1000"/>', simulator)[0] == exit_codes.SUCCESS
    assert simulator.times == []


def test_a_timer_that_became_due_before_its_wait_is_not_waited_for():
    clock = SimulatedClock(lambda: None)
    clock.set_to(100.0)
    clock.call_after(1.0, lambda: None)
    clock.set_to(101.0)
    assert clock.time_left() == 0.0


def test_the_tree_is_woken_for_the_next_timer_alone():
    woken = []
    clock = SimulatedClock(lambda: woken.append(clock.now()))
    clock.set_to(100.0)  # the time begins
    clock.call_after(2.0, lambda: None)
    assert clock.time_left() is None
    for moment in (100.5, 101.5, 102.5, 103.5):
        clock.set_to(moment)
    assert woken == [0.0, 2.5]


def test_timers_of_the_process_run_while_the_time_stands_still():
    clock, beats = SimulatedClock(lambda: None), []
    clock.set_to(100.0)
    clock.process.call_after(0.0, lambda: beats.append(clock.now()))
    assert clock.time_left() <= 0.0
    clock.run_due()
    assert beats == [0.0]


@pytest.mark.parametrize("back", [0.001, 12.0, 1e9])
def test_after_a_jump_back_what_was_left_of_a_timer_is_left(back):
    clock, due = SimulatedClock(lambda: None), []
    clock.set_to(2e9)
    clock.call_after(5.0, lambda: due.append(clock.now()))
    clock.set_to(2e9 + 3.0)
    clock.set_to(2e9 + 3.0 - back)
    assert clock.now() == pytest.approx(3.0, abs=1e-5)
    clock.set_to(2e9 + 3.0 - back + 1.9)
    clock.run_due()
    assert due == []
    clock.set_to(2e9 + 3.0 - back + 2.1)
    clock.run_due()
    assert due == [pytest.approx(5.1, abs=1e-5)]
    assert clock.take_jump() == pytest.approx(back, abs=1e-5)
    assert clock.take_jump() == 0.0


def test_an_answer_while_the_time_stands_still_is_later_than_its_question():
    clock = SimulatedClock(lambda: None)
    clock.set_to(1.7e9)
    topics = FakeTopics(clock.arrival)
    topics.publish(SPEECH, "yes")
    asked_at = clock.now()
    topics.publish(SPEECH, "no")
    assert [said.value for said in since(topics.recent(SPEECH), asked_at)] == ["no"]


def test_the_seconds_of_a_request_do_not_begin_before_it():
    now = [0.0]
    clock = Clock(lambda: now[0])
    clock.hold()
    now[0] = 5.0  # a leaf before it was slow
    assert clock.call_after(8.0, lambda: None, is_foreign=True).due == 13.0
    assert clock.call_after(8.0, lambda: None).due == 8.0  # a traversal has one time


# -------------------------------------------------------------------------------------- the mission


@pytest.mark.parametrize("back, said", [(12.0, "12"), (0.25, "0.25"), (5000.0, "5000")])
def test_a_jump_back_ends_the_visit_with_a_sentence_and_the_next_one_begins(back, said):
    after = 9000.0 - back
    simulator = Simulator(8990.0, 8995.0, 9000.0, after, *(after + n for n in range(1, 70)))
    code, emitted = run('<Sleep msec="60000"/>', simulator, runs=2)
    assert code == exit_codes.SUCCESS  # the last pass decides
    assert [event.text for event in emitted if isinstance(event, Noticed)] == [
        f"simulated time jumped back by {said} s: this visit is over"]
    assert [event.outcome for event in emitted if isinstance(event, PassFinished)] == [
        "FAILURE", "SUCCESS"]
    assert seconds_of(emitted) == [pytest.approx(10.0, abs=1e-3), pytest.approx(60.0, abs=1e-3)]
    number = iter(range(1000))
    told = Run(Line(float(next(number)), event) for event in emitted).visits
    assert told[0].why.text == f"simulated time jumped back by {said} s: this visit is over"


def test_a_jump_back_between_two_visits_ends_none():
    times = [100.0, 100.1, 50.0, *(50.0 + n / 2 for n in range(1, 20))]
    code, emitted = run("<AlwaysSuccess/>", Simulator(*times), runs=2)
    assert code == exit_codes.SUCCESS
    assert not any(isinstance(event, Noticed) for event in emitted)
    began = [event.at for event in emitted if isinstance(event, PassStarted)]
    assert began[1] - began[0] >= 1.0  # the pause of a pass that ends at once


# ------------------------------------------------------------------------------------- the monitor


@pytest.mark.parametrize("asleep, is_silent", [(0.5, False), (2.0, True)])
def test_a_topic_is_silent_only_if_the_computer_has_heard_nothing_either(
        monkeypatch, asleep, is_silent):
    """At 100 times the speed, half a second in which this process got no time is no silence."""
    now, health = [1000.0], Health()
    monkeypatch.setattr(watchdog.time, "monotonic", lambda: now[0])
    clock = SimulatedClock(lambda: None)
    latch = TopicBuffer(FACES, lambda: None, pytest.fail, clock)
    for number in range(20):
        clock.set_to(100 * now[0])
        latch.hear(Faces((), ()))
        now[0] += 0.01
    monitor = watchdog.Monitor(INTERFACE, None, health, lambda: True)
    now[0] += asleep
    clock.set_to(100 * now[0])
    monitor._check_silence(FACES, latch, clock.source())
    log, changes = Events(), []
    log.subscribe(changes.append)
    health.publish(log)
    assert [change.respect for change in changes] == [SILENT] * is_silent


# ------------------------------------------------------------------------------------ the record


def test_a_run_whose_time_jumped_back_is_replayed_on_the_same_path():
    queue = LineQueue()
    record = Record(queue, describe=load.describe)
    simulator = Simulator(90.0, 95.0, 80.0, *(80.0 + n for n in range(1, 70)))
    run('<WelcomeSpeech/><Sleep msec="60000"/>', simulator, runs=2, record=record)
    record.hand_over()
    replayed = replay(queue.take())
    assert (replayed.passes, replayed.divergence) == (2, "")


@pytest.fixture
def simulated(monkeypatch):
    """Have events take the time of a simulator."""
    for name in ("_unix_at_zero", "_computer_at_zero", "_now", "_ros_now"):
        monkeypatch.setattr(events, name, getattr(events, name))
    clock = SimulatedClock(lambda: None)
    events.use_simulated_time(clock.source, lambda: clock.simulated)
    return clock


def test_a_line_has_the_times_of_the_event_of_ros_and_of_the_computer(simulated):
    feed, before = Feed(), events.computer_now()
    feed(Noticed("info", "before the time begins"))
    for moment in (1000.0, 1020.0, 1010.0):
        simulated.set_to(moment)
        feed(Noticed("info", str(moment)))
    lines = list(feed.lines())
    began = lines[0].time
    assert began == pytest.approx(before, abs=1.0)
    assert [(round(line.time - began, 3), line.ros) for line in lines] == [
        (0.0, None), (0.0, 1000.0), (20.0, 1020.0), (20.0, 1010.0)]
    assert all(line.computer == pytest.approx(before, abs=1.0) for line in lines)


def test_a_line_of_a_run_without_simulated_time_is_as_it_was():
    feed = Feed()
    feed(Noticed("info", "so"))
    line, = feed.lines()
    assert encode(2.5, line.event, line.ros, line.computer) == (
        b'{"time":2.5,"event":{"_type":"Noticed","level":"info","text":"so"}}\n')


@pytest.mark.parametrize("rate", [0.0, 0.1, 20.0])
def test_a_viewer_follows_the_time_of_the_mission_by_its_signs_of_life(simulated, rate):
    nowhere = dict.fromkeys(("address", "groot2_address", "records"), "")
    viewer = Viewer(argparse.Namespace(port=0, groot2_port=0, attempts=1, **nowhere), pytest.fail)
    events._now = events.time.monotonic  # that of another process
    for second in range(4):
        sign = Line(5e8 + rate * second, SignOfLife(), 1000.0 + rate * second, 5e8 + second)
        viewer.take(sign)
        assert events.unix_now() == pytest.approx(sign.time, abs=0.5)


def test_that_the_time_stands_still_is_said_on_the_robots_line():
    change = HealthChanged(SIMULATED_TIME, "/clock", "", False, "stands still since 14:03:12",
                           "until it is heard again, the mission stands still", SILENT)
    line = robot_line(Run([Line(0.0, change)]).state)
    assert not line.is_well
    assert line.text.startswith("simulated time stands still since 14:03:12 · ")


# ------------------------------------------------------------------------------ as it comes by ROS


@pytest.fixture
def clock_topic(monkeypatch):
    """The topic, a publisher of it, and the times that rospy was set to."""
    rospy = pytest.importorskip("rospy", reason="needs ROS")
    set_to = []
    monkeypatch.setattr(simulated_time, "DIRECTORY", Directory())
    monkeypatch.setattr(rospy.rostime, "_set_rostime", lambda now: set_to.append(now.to_sec()))
    publisher = Publisher(CLOCK, latching="1")
    clock = SimulatedClock(lambda: None)
    topic = SimulatedTime(clock, print)
    topic.clock_, topic.set_to, topic.publisher = clock, set_to, publisher
    yield topic
    topic.set_publishers([])
    for link in topic._links.values():
        link.end()
    publisher.close()


def now_is(topic, seconds):
    topic.publisher.send(struct.pack("<III", 8, seconds, 500_000_000))


def test_the_time_goes_on_with_each_message_that_has_another_one(clock_topic):
    clock_topic.set_publishers([clock_topic.publisher.uri])
    now_is(clock_topic, 5)  # also with the first of a latching publisher
    until(lambda: clock_topic.clock_.simulated == 5.5)
    before = clock_topic.rhythm.last
    now_is(clock_topic, 5)
    now_is(clock_topic, 5)
    now_is(clock_topic, 7)
    until(lambda: clock_topic.clock_.simulated == 7.5)
    assert clock_topic.set_to == [5.5, 7.5]
    assert clock_topic.rhythm.count == 2 and clock_topic.rhythm.last > before


@pytest.mark.parametrize("is_published, seconds, expected", [
    (True, 0.0, [("info", "the mission goes by the simulated time on /clock")]),
    (False, 5.0, [("info", "waiting up to 5 s for the time on /clock"),
                  ("info", "the mission goes by the simulated time on /clock")])])
def test_the_node_waits_for_the_first_time(clock_topic, monkeypatch, is_published, seconds,
                                           expected):
    master, lines = Master(), []
    monkeypatch.setenv("ROS_MASTER_URI", master.uri)
    monkeypatch.setattr(simulated_time, "RETRY_INTERVAL", 0.05)
    master.nodes["/s"] = clock_topic.publisher.uri

    def tell(*line):
        lines.append(line)
        master.publishers["/clock"] = ["/s"]

    if is_published:
        master.publishers["/clock"] = ["/s"]
    monkeypatch.setattr(simulated_time, "PROBE_LIMIT", 5.0)
    threading.Thread(target=lambda: now_is(clock_topic, 1), daemon=True).start()
    clock_topic.await_first(seconds, tell, WakeUp(), lambda: False)
    assert lines == expected
    master.close()


@pytest.mark.slow
def test_a_publisher_that_sends_no_time_is_told(clock_topic, monkeypatch):
    master = Master()
    monkeypatch.setenv("ROS_MASTER_URI", master.uri)
    monkeypatch.setattr(simulated_time, "RETRY_INTERVAL", 0.05)
    monkeypatch.setattr(simulated_time, "PROBE_LIMIT", 0.3)
    master.nodes["/s"], master.publishers["/clock"] = clock_topic.publisher.uri, ["/s"]
    with pytest.raises(NodesMissing, match="no time comes on /clock: its publisher sends none"):
        clock_topic.await_first(0.0, print, WakeUp(), lambda: False)
    master.close()
