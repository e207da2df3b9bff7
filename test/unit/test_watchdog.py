"""The monitor, with servers and publishers in this process: what is reported of the robot, of its
topics, of the master and of this computer, and what is no news."""
import socket
import time
import types

import pytest

rospy = pytest.importorskip("rospy", reason="needs ROS")

from behavior_controller.bt.engine.clock import Clock  # noqa: E402
from behavior_controller.robot import d543, release_1_1  # noqa: E402
from behavior_controller.robot.rhythm import Rhythm  # noqa: E402
from behavior_controller.robot.requests import (  # noqa: E402
    AttentionStatus, GoTo, GoToGoal, Say)
from behavior_controller.ros import service_client, subscriber, watchdog  # noqa: E402
from behavior_controller.ros.master import Directory  # noqa: E402
from behavior_controller.ros.shortage import Shortage  # noqa: E402
from behavior_controller.ros.subscriber import RosTopics  # noqa: E402
from behavior_controller.ros.tcpros import Connection, RECONNECT_PAUSE  # noqa: E402
from behavior_controller.ros.types import CLOCK  # noqa: E402
from behavior_controller.ros.watchdog import Monitor  # noqa: E402
from behavior_controller.run.events import Events  # noqa: E402
from behavior_controller.run.health import Health  # noqa: E402
from ros_peers import Master, Publisher, Service, shake_hands, until  # noqa: E402

SPEECH = d543.INTERFACE.service(Say)
SERVICE, ACTION = (release_1_1.INTERFACE.service(kind) for kind in (GoTo, GoToGoal))
OPTIONAL = next(each for each in release_1_1.SERVICES if each.is_optional)


class Watched:
    """A monitor and what it reports, which ``told`` returns as (name, is well, status)."""

    def __init__(self, interface, has_asr=True):
        self.health, self.events, self.found = Health(), Events(), []
        self.events.subscribe(self.found.append)
        self.topics = RosTopics((), lambda: None, print, Clock())
        self.monitor = Monitor(interface, self.topics, self.health, lambda: has_asr, lambda: 0)

    def told(self):
        self.health.publish(self.events)
        return [(each.name, each.is_well, each.status) for each in self.found]

    def tells(self, *expected):
        """Wait until exactly this was reported: (name, is well, how the status begins)."""
        until(lambda: len(self.told()) >= len(expected), 8.0)
        assert [(name, is_well, status[:len(begins)]) for (name, is_well, status), (_, _, begins)
                in zip(self.told(), expected)] == list(expected)
        assert len(self.told()) == len(expected)


@pytest.fixture
def directory(monkeypatch):
    found = Directory()
    for module in (watchdog, service_client, subscriber):
        monkeypatch.setattr(module, "DIRECTORY", found)
    return found


@pytest.fixture
def master(monkeypatch, directory):
    found = Master()
    monkeypatch.setenv("ROS_MASTER_URI", found.uri)
    monkeypatch.setattr(watchdog, "RETRY_INTERVAL", 0.05)
    yield found
    found.close()


@pytest.fixture
def watch(monkeypatch):
    """Return what makes a monitor of a robot that looks often."""
    monkeypatch.setattr(watchdog, "CHECK_EVERY", 0.01)
    made = []

    def start(interface=d543.INTERFACE, **more):
        made.append(Watched(interface, **more))
        return made[-1]
    yield start
    for each in made:
        each.monitor.close()


# --------------------------------------------------------------------------------------- services


def test_a_server_that_goes_and_one_that_returns_are_told_once(master, watch):
    server, watched = Service(master, SPEECH), watch()
    watched.monitor.include([SPEECH])
    until(lambda: server.handshakes == 1)
    server.break_connections()  # it is connected to again: nothing has gone
    until(lambda: server.handshakes == 2)
    assert not watched.told()
    server.close()
    watched.tells((SPEECH.name, False, "gone: not reachable: the master lists it"))
    assert watched.found[0].node == SPEECH.node and watched.found[0].kind == "service"
    assert watched.found[0].consequence == "until it is back, the robot cannot speak"
    other = Service(master, SPEECH)
    watched.tells((SPEECH.name, False, "gone"), (SPEECH.name, True, "available again"))
    other.close()
    watched.tells((SPEECH.name, False, "gone"), (SPEECH.name, True, "available again"),
                  (SPEECH.name, False, "gone"))


@pytest.mark.slow
def test_a_connection_is_kept_as_long_as_the_server_is_there(master, watch, monkeypatch):
    made = []

    class Made(Connection):
        def __init__(self):
            super().__init__()
            made.append(self)

    monkeypatch.setattr(watchdog, "Connection", Made)
    monkeypatch.setattr(watchdog, "STEP_LIMIT", 0.1)
    server, watched = Service(master, SPEECH), watch()
    watched.monitor.include([SPEECH])
    time.sleep(0.4)
    assert len(server.connections) == 1
    assert made[0]._socket.getsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE)
    server.close()


@pytest.mark.slow
@pytest.mark.parametrize("is_there, pause", [(False, 0.1), (True, RECONNECT_PAUSE)])
def test_a_server_that_cannot_be_used_is_tried_at_intervals(master, watch, monkeypatch, is_there,
                                                           pause):
    monkeypatch.setattr(watchdog, "RETRY_INTERVAL", 0.1)
    server, watched = Service(master, SPEECH), watch()
    if is_there:  # and ends each connection
        header = server._header
        server.talk = lambda each: (shake_hands(each, **header), each.close())
    else:
        server.close()
    began, lookup = time.monotonic(), ("lookupService", SPEECH.name)
    watched.monitor.include([SPEECH])
    # what other tests left behind may ask this master as well, but not for this service
    until(lambda: is_there or master.calls.count(lookup) > 4)
    until(lambda: not is_there or len(server.connections) > 4)
    assert time.monotonic() - began >= 4 * pause
    server.close()


@pytest.mark.parametrize("service, may_lack, is_told", [
    (SPEECH, False, True), (SPEECH, True, False), (OPTIONAL, False, False)])
def test_one_that_never_was_there_is_told_only_if_it_is_needed(master, watch, service, may_lack,
                                                              is_told):
    watched = watch(release_1_1.INTERFACE)
    watched.monitor.include([service], **{"may_lack": True} if may_lack else {})
    until(lambda: master.calls.count(("lookupService", service.name)) > 2)
    assert [status for _, _, status in watched.told()] == [
        "gone: not advertised: no node offers this service"] * is_told


def test_one_that_may_lack_is_told_when_it_has_gone(master, watch):
    server, watched = Service(master, SPEECH), watch()
    watched.monitor.include([SPEECH], may_lack=True)
    until(lambda: server.handshakes)
    until(lambda: watched.monitor._reported)
    server.close()
    watched.tells((SPEECH.name, False, "gone"))


@pytest.mark.slow
def test_a_server_that_shakes_no_hands_is_gone(master, watch, monkeypatch):
    monkeypatch.setattr(watchdog, "RECONNECT_LIMIT", 0.3)
    server, watched = Service(master, SPEECH), watch()
    watched.monitor.include([SPEECH])
    until(lambda: server.handshakes)
    server.talk = lambda connection: connection.recv(1 << 20, 0) and until(lambda: False)
    server.break_connections()
    watched.tells((SPEECH.name, False, "gone: no answer"))
    server.close()


@pytest.mark.parametrize("offered, declared", [
    (SERVICE, [SERVICE, ACTION]), (ACTION, [SERVICE, ACTION]), (ACTION, [ACTION, SERVICE])])
def test_a_service_and_its_action_stand_in_for_each_other(master, watch, offered, declared):
    """They have one name, whose health is told once."""
    watched = watch(release_1_1.INTERFACE)
    if offered is SERVICE:
        server = Service(master, SERVICE)
        connections = server.connections
    else:
        server = Publisher(d543.SPEECH)  # whatever its type is
        master.publishers[ACTION.name + "/status"], master.nodes["/a"] = ["/a"], server.uri
        connections = server.peer.connections
    watched.monitor.include(declared)
    until(lambda: connections)
    until(lambda: watched.monitor._reported)
    assert len(connections) == 1
    server.close()
    watched.tells((ACTION.name, False, "gone"))


# ------------------------------------------------------------------------------- topics and master


@pytest.mark.parametrize("unanswered, slow, forgotten, expected", [
    (1, 3, (), []), (2, 0, (), [(False, "does not answer")]),
    (2, 4, (SPEECH.name,), [(False, "does not answer")]), (0, 4, (), [(False, "answers slowly")]),
    (0, 0, ("/other",), []),
    (0, 0, (SPEECH.name,),
     [(False, "is a new one, or its memory was cleared: it does not know " "textToSpeech")])])
def test_the_master(master, watch, monkeypatch, unanswered, slow, forgotten, expected):
    directory, watched = Directory(), watch()  # in which no thread of a subscriber counts rounds
    monkeypatch.setattr(watchdog, "DIRECTORY", directory)
    watched.monitor.include([SPEECH], may_lack=True)
    directory.unanswered, directory.slow_answers = unanswered, slow
    directory.fault = "does not answer"
    directory._former = {("service", name): ("rosrpc://h:1",) for name in forgotten}
    watched.monitor.start()
    watched.tells(*((master.uri, *each) for each in expected))
    directory.unanswered, directory.slow_answers, directory._former = 0, 0, {}
    until(lambda: all(watched.monitor._reported.values()))
    assert [each[1] for each in watched.told()] == [False, True] * len(expected)


def test_of_a_master_that_is_replaced_the_silence_ends_with_another(master, watch, directory):
    watched = watch()
    watched.monitor.include([SPEECH], may_lack=True)
    directory.unanswered, directory.fault = 2, "does not answer"
    watched.monitor.start()
    watched.tells((master.uri, False, "does not answer"))
    directory._former, directory.unanswered = {("service", SPEECH.name): ("rosrpc://h:1",)}, 0
    watched.tells((master.uri, False, "does not answer"), (master.uri, True, "another one answers"),
                  (master.uri, False, "is a new one"))


def test_what_this_computer_gives_no_more(master, watch, monkeypatch):
    shortage, watched = Shortage(), watch()
    monkeypatch.setattr(watchdog, "SHORTAGE", shortage)
    monkeypatch.setattr("behavior_controller.ros.shortage.LASTS", 0.2)
    shortage.note(MemoryError("no memory"))
    watched.monitor.start()
    name = watchdog.socket.gethostname()
    watched.tells((name, False, "gives this node no more files, threads or memory: no memory"),
                  (name, True, "gives this node files, threads and memory again"))


@pytest.mark.parametrize("has_asr, topic, is_told", [
    (True, d543.SPEECH, True), (False, d543.SPEECH, False), (False, d543.FACES, True)])
def test_a_topic_without_publisher_is_gone_after_a_while(master, watch, monkeypatch, has_asr, topic,
                                                         is_told):
    monkeypatch.setattr(watchdog, "NO_CONNECTION_LIMIT", 0.2)
    watched = watch(has_asr=has_asr)
    watched.monitor.include([topic])
    watched.monitor.start()
    buffer = watched.topics.buffers[topic]
    until(lambda: watched.monitor._reported)  # the master is looked at before each topic
    assert not watched.told()  # its publishers were not looked up
    publisher = Publisher(topic)
    buffer.set_publishers([publisher.uri])
    until(lambda: buffer.is_connected)
    publisher.close()
    if is_told:
        watched.tells((topic.name, False, "gone: its publisher at " + publisher.uri))
    again = Publisher(topic)
    buffer.set_publishers([again.uri])
    until(lambda: buffer.is_connected)
    if is_told:
        watched.tells((topic.name, False, "gone"), (topic.name, True, "available again"))
    until(lambda: topic not in watched.monitor._lonely)
    assert len(watched.told()) == 2 * is_told
    for link in list(buffer._links.values()):
        link.end()
    again.close()


class Quiet:
    """A buffer of a topic with a publisher whose messages came as often as it says."""

    is_connected, is_searched, newest, absence = True, True, None, "no node publishes it"

    def __init__(self, topic, clock, last, name=None):
        self.clock, self.name, self.reconnects = clock, name or topic.name, []
        self.rhythm = types.SimpleNamespace(
            count=9, last=last, rate=2.0, is_silent=lambda now: now - self.rhythm.last > 2.0)
        self.heard_at = 0.0

    def reconnect(self):
        self.reconnects.append(round(self.clock.source() - self.rhythm.last, 1))


@pytest.mark.parametrize("topic, name, silent, again", [
    (d543.FACES, "/faceDetection/data", "silent for 2.5 s", "heard again"),
    (CLOCK, "/clock", "stands still since ", "goes on")])
def test_a_silence_is_told_once_and_connected_again_meanwhile(watch, topic, name, silent, again):
    watched, now = watch(), [100.0]
    clock = types.SimpleNamespace(source=lambda: now[0])
    buffer = Quiet(topic, clock, 100.0)
    for now[0] in (101.0, 102.0, 102.5, 103.0, 105.4, 105.5, 108.4, 108.6):
        watched.monitor._check_topic(topic, buffer)
    assert [(each[0], each[1], each[2].startswith(silent)) for each in watched.told()] == [
        (name, False, True)]
    assert buffer.reconnects == [5.5, 8.6]  # three seconds later, and again
    buffer.rhythm.last = now[0]
    watched.monitor._check_topic(topic, buffer)
    assert watched.told()[1:] == [(name, True, again)]


def test_a_silence_is_counted_from_the_return_of_a_topic_that_was_gone(watch, monkeypatch):
    monkeypatch.setattr(watchdog, "NO_CONNECTION_LIMIT", -1.0)
    watched, now = watch(), [100.0]
    buffer = Quiet(d543.FACES, types.SimpleNamespace(source=lambda: now[0]), 97.5)
    name, check = d543.FACES.name, lambda: watched.monitor._check_topic(d543.FACES, buffer)
    check()
    buffer.is_connected = False
    for now[0] in (101.0, 160.0):
        check()
    buffer.is_connected = True
    for now[0] in (160.25, 164.0, 170.0):
        check()
    # it has been silent since before, but its connection is new
    assert watched.told() == [(name, False, "silent for 2.5 s"),
                              (name, False, "gone: no node publishes it"),
                              (name, True, "available again")]
    assert not buffer.reconnects
    buffer.rhythm.hear(now[0])
    check()
    assert watched.told()[3:] == [(name, True, "heard again")]


def test_a_topic_that_is_not_heard_from_time_zero_on_is_silent(watch):
    watched = watch()
    buffer = Quiet(d543.FACES, types.SimpleNamespace(source=lambda: 10.25), 0.0)
    buffer.rhythm = Rhythm(0.0)
    watched.monitor._check_topic(d543.FACES, buffer)
    assert watched.told() == [(d543.FACES.name, False, "silent for 10.2 s")]
    assert not buffer.reconnects


def test_a_topic_of_events_may_be_silent(watch):
    watched, clock = watch(), types.SimpleNamespace(source=lambda: 500.0)
    watched.monitor._check_topic(d543.SPEECH, Quiet(d543.SPEECH, clock, 100.0))
    assert not watched.told()
    said = watched.health.said[d543.SPEECH.name]
    assert (said.words, said.rate) == ("“None”", 2.0)
    assert watched.health.last_arrivals == {d543.SPEECH.name: 100.0}


@pytest.mark.parametrize("status, words", [
    (("seeking", 0), "seeking, the visitor's gaze"),
    (("seeking", 1), "seeking, waiting for the visitor to look at the robot"),
    (("disabled", 0), "disabled")])
def test_a_message_in_words_says_what_it_means_for_the_mission(watch, status, words):
    assert watch().monitor._words(d543.ATTENTION, AttentionStatus(*status)) == words


def test_a_message_that_its_declaration_cannot_put_into_words_is_shown_as_it_is(watch):
    assert watch().monitor._words(d543.FACES, "x") == "'x'"


def test_at_a_high_speed_of_the_simulated_time_a_silence_takes_the_time_of_the_process_too(watch):
    watched = watch()
    buffer = Quiet(d543.FACES, types.SimpleNamespace(source=lambda: 200.0), 100.0)
    buffer.heard_at = time.monotonic()
    watched.monitor._check_topic(d543.FACES, buffer)
    assert not watched.told()
