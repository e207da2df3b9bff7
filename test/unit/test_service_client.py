"""The gateway, with servers in this process: connections that are kept, hang or break, and what a
server answers."""
import queue
import socket
import struct
import threading
import time

import pytest

rospy = pytest.importorskip("rospy", reason="needs ROS")

from behavior_controller.bt.engine.clock import Clock, SimulatedClock  # noqa: E402
from behavior_controller.wakeup import WakeUp  # noqa: E402
from behavior_controller.robot.d543 import INTERFACE  # noqa: E402
from behavior_controller.robot.declarations import Publication  # noqa: E402
from behavior_controller.robot.gateway import Cause  # noqa: E402
from behavior_controller.robot import release_1_0, release_1_1  # noqa: E402
from behavior_controller.robot.requests import (  # noqa: E402
    Answer, GoTo, GoToGoal, Location, Prompt, Say, SetAttention, SetPose)
from behavior_controller.ros import service_client  # noqa: E402
from behavior_controller.ros.master import Directory  # noqa: E402
from behavior_controller.ros.service_client import PublisherThread, RosGateway  # noqa: E402
from behavior_controller.ros.types import TYPES  # noqa: E402
from behavior_controller.run.events import Events  # noqa: E402
from behavior_controller.run.health import Health  # noqa: E402
from ros_peers import (  # noqa: E402
    HANG, LIMIT, Master, Service, TcprosPeer, answer_of, hang, read_block, shake_hands, until)
from shortages import no_files_left  # noqa: E402

SPEECH = INTERFACE.service(Say)
KIND = {"callerid": "/robot", "type": "cssr_system/textService", "md5sum": TYPES[SPEECH]._md5sum}


DONE, REFUSED = answer_of(SPEECH), answer_of(SPEECH, success=False)


def error(words):
    return struct.pack("<BI", 0, len(words)) + words


def service_threads():
    return {thread for thread in threading.enumerate() if thread.name.startswith("service /")}


class Robot:
    """A gateway, and the master that it asks."""

    def __init__(self, interface=INTERFACE, substituted=()):
        self.told, self.deadline, self.clock, self.wake = [], 20.0, Clock(), WakeUp()
        self.health = Health()
        self._others = service_threads()  # that other tests have left
        self.master = Master()
        self.gateway = RosGateway(interface, lambda service: self.deadline, self.clock,
                                  self.wake.emit, self.health, self.told.append, substituted)
        self.peers = [self.master]

    def say(self, words="hello"):
        """Return the result of a speech, and how long it took."""
        began = time.monotonic()
        result, _ = self.finish(self.gateway.start(Say(words)))
        return result, time.monotonic() - began

    def finish(self, call):
        """Act as the runner does until ``call`` has a result; return it and how long it took."""
        began = time.monotonic()
        while call.result is None:
            self.wake.wait(self.clock.time_left())
            self.wake.test_and_clear()
            self.clock.run_due()
            assert time.monotonic() - began < LIMIT
        return call.result, time.monotonic() - began

    def serves(self, *answers):
        """Offer the speech."""
        self.peers.append(Service(self.master, SPEECH, *answers))
        return self.peers[-1]

    def talks(self, talk, backlog=16):
        """Offer the speech by a server that does what ``talk`` does."""
        peer = TcprosPeer(talk, backlog)
        self.peers.append(peer)
        self.master.services[SPEECH.name] = "rosrpc://127.0.0.1:{}".format(peer.port)
        return peer

    def rests(self, count=0):
        """Return whether soon no more than ``count`` threads talk to services."""
        until(lambda: len(service_threads() - self._others) == count, 2.0)
        return True

    def close(self):
        self.gateway.close()
        for peer in self.peers:
            peer.close()


@pytest.fixture
def robots(monkeypatch):
    """Return what makes a robot with a gateway."""
    rospy.rostime.set_rostime_initialized(True)  # as the node does at its start
    monkeypatch.setattr(service_client, "DIRECTORY", Directory())
    made = []

    def make(*arguments):
        made.append(Robot(*arguments))
        monkeypatch.setenv("ROS_MASTER_URI", made[-1].master.uri)
        return made[-1]
    yield make
    for each in made:
        each.close()
        assert each.rests()


@pytest.fixture
def robot(robots):
    return robots()


# ------------------------------------------------------------------------------------ connections


@pytest.mark.slow
@pytest.mark.parametrize("hangs", [
    [True], [False, True], [True, True], [False, True, False, True, True], [False, False, True]])
def test_what_hangs_is_given_up_and_what_has_answered_is_used_again(robot, hangs):
    """Each call after one that hangs has a connection of its own; the others share one."""
    server = robot.serves(*[HANG if each else DONE for each in hangs])
    robot.deadline = 0.1
    for each in [*hangs, False, False]:
        robot.deadline = 0.1 if each else 20.0
        result, _ = robot.say()
        if each:
            assert (result.cause, result.message) == (Cause.NO_ANSWER, "waited 0.1 s")
        else:
            assert result == Answer()
    assert len(server.connections) == 1 + sum(hangs)
    assert len(server.requests) == len(hangs) + 2
    assert robot.rests(1)


def test_a_call_that_is_dropped_gives_its_thread_back_and_the_next_is_answered(robot):
    server = robot.serves(DONE, HANG)
    robot.say()
    call = robot.gateway.start(Say("dropped"))
    until(lambda: len(server.requests) == 2)
    call.drop()
    assert robot.rests() and call.result is None
    assert robot.say()[0] == Answer() and robot.clock.next_due() is None
    assert len(server.connections) == 2


def test_two_calls_at_once_have_two_connections_and_both_are_kept(robot):
    server = robot.serves()
    for _ in range(3):
        for call in [robot.gateway.start(Say(words)) for words in ("one", "other")]:
            assert robot.finish(call)[0] == Answer()
    assert len(server.connections) == 2 and len(server.requests) == 6


def test_a_connection_found_dead_before_the_request_is_opened_again(robot):
    server = robot.serves()
    robot.say("first")
    server.break_connections()
    assert robot.say("second")[0] == Answer()
    other = robot.serves()  # it was started again elsewhere
    server.close()
    assert robot.say("third")[0] == Answer()
    assert [len(each.requests) for each in (server, other)] == [2, 1]


def test_a_request_that_may_have_been_carried_out_is_not_sent_again(robot):
    server = robot.serves(DONE, b"")
    robot.say("first")
    call = robot.gateway.start(Say("once"))
    until(lambda: len(server.requests) == 2)
    server.break_connections()
    assert robot.finish(call)[0].cause is Cause.CONNECTION_LOST
    assert server.requests[1:] == [struct.pack("<II", 8, 4) + b"once"]


# ---------------------------------------------------------------------------- what a server answers


def handshake(words):
    return lambda connection: shake_hands(connection, error=words)


def answer(data):
    def talk(connection):
        shake_hands(connection, **KIND)
        read_block(connection)
        connection.sendall(data)
        connection.shutdown(socket.SHUT_WR)
    return talk


@pytest.mark.parametrize("talk, cause, words", [
    (handshake("client wants service /textToSpeech/say_text to have md5sum 1, but it has 2."),
     Cause.TYPE_MISMATCH, "md5sum 1"),  # as roscpp words it
    (handshake("[/other] is not a provider of [/textToSpeech/say_text]"), Cause.NOT_REACHABLE,
     "not a provider"),
    (lambda connection: shake_hands(connection, callerid="/robot", md5sum="other"),
     Cause.TYPE_MISMATCH, "vs. [other]"),
    (lambda connection: connection.sendall(b"HTTP/1.1 400 Bad Request\r\n\r\n"),
     Cause.NOT_REACHABLE, "the master lists it"),
    (lambda connection: connection.close(), Cause.NOT_REACHABLE, "the master lists it"),
    (answer(error(b"no voice")), Cause.HANDLER_EXCEPTION, "no voice"),
    (answer(error(b"")), Cause.HANDLER_EXCEPTION, "without a reason"),
    (answer(REFUSED), Cause.REFUSED, ""),
    (answer(b""), Cause.CONNECTION_LOST, ""),
    (answer(DONE[:-1]), Cause.CONNECTION_LOST, ""),
    (answer(struct.pack("<BI", 1, 3) + b"\x01\xff\xff"), Cause.UNUSABLE_ANSWER, "textService"),
    (answer(struct.pack("<BI", 1, 0xffffffff)), Cause.CONNECTION_LOST, "4294967295")])
def test_each_failure_has_its_cause_in_one_line(robot, talk, cause, words):
    robot.talks(talk)
    failure = robot.say()[0]
    assert failure.cause is cause and words in failure.message and "\n" not in failure.message
    assert failure.resource == SPEECH.name


@pytest.mark.parametrize("uri, cause, words", [
    (None, Cause.NOT_ADVERTISED, "no node offers this service"),
    ("rosrpc://127.0.0.1:1", Cause.NOT_REACHABLE, "Connection refused"),
    ("http://127.0.0.1:1", Cause.NOT_REACHABLE, "not an address of a service"),
    ("rosrpc://127.0.0.1:x", Cause.NOT_REACHABLE, "not an address of a service"),
    ("rosrpc://127.0.0.1:1²", Cause.NOT_REACHABLE, "not an address of a service")])
def test_an_entry_at_which_nothing_answers(robot, uri, cause, words):
    robot.master.services[SPEECH.name] = uri
    failure = robot.say()[0]
    assert failure.cause is cause and words in failure.message
    server = robot.serves()  # now it is started
    assert robot.say()[0] == Answer() and len(server.requests) == 1


def test_after_a_handshake_that_means_nothing_the_next_call_connects_anew(robot):
    robot.talks(lambda connection: connection.sendall(struct.pack("<I", 4) + 4 * b"\xff"))
    failure = robot.say()[0]
    assert failure.cause is Cause.NOT_REACHABLE and "no ROS node" in failure.message
    robot.serves()
    answer, seconds = robot.say()
    assert answer == Answer() and seconds < 2.0


# ------------------------------------------------------------------------------------------- time


@pytest.mark.slow
def test_a_server_that_never_shakes_hands_was_not_asked(robot):
    robot.talks(hang)
    robot.deadline = 0.3
    failure, seconds = robot.say()
    assert failure.cause is Cause.NO_ANSWER and "nothing was asked" in failure.message
    assert 0.3 <= seconds < 1.5 and robot.rests()


@pytest.mark.slow
def test_a_host_that_does_not_take_the_connection(robot):
    # a full queue of connections drops what comes, as a host that is away does
    peer = robot.talks(None, backlog=0)
    fillers = [socket.socket() for _ in range(4)]
    for filler in fillers:
        filler.setblocking(False)
        filler.connect_ex(peer.listener.getsockname())
    robot.deadline = 0.3
    failure, seconds = robot.say()
    assert failure.cause is Cause.NO_ANSWER and "still connecting" in failure.message
    assert 0.3 <= seconds < 1.5 and robot.rests()
    robot.deadline = 20.0  # the connection has its own limit
    failure, seconds = robot.say()
    assert failure.cause is Cause.NOT_REACHABLE and seconds < 6.0
    for filler in fillers:
        filler.close()


# --------------------------------------------------------------------------------------- the master


@pytest.mark.slow
@pytest.mark.parametrize("was_found", [False, True])
def test_without_a_master_a_service_is_used_where_it_was_found_last(robot, was_found):
    """One that was never found is not reachable; nobody knows that no node offers it."""
    server = robot.serves()
    if was_found:
        robot.say()
        server.break_connections()
    robot.master.may_answer.clear()
    robot.deadline = 6.0
    result, seconds = robot.say()
    robot.master.may_answer.set()
    if was_found:
        assert result == Answer() and seconds < service_client.LOOKUP_LIMIT + 1.0
    else:
        assert result.cause is Cause.NOT_REACHABLE and "does not answer" in result.message
        assert service_client.CONNECT_LIMIT - 0.1 < seconds < 6.0
        assert not server.requests
    assert robot.say()[0] == Answer()


# ---------------------------------------------------------------- what stands in, and what is left

GOAL = GoToGoal(Location(1.0, 2.0, 90.0))
DRIVE, ACTION = (release_1_1.INTERFACE.service(kind) for kind in (GoTo, GoToGoal))
IN_PLACE = ("no node offers the action /robotNavigation/set_goal: the service "
            "/robotNavigation/set_goal is used in its place")


@pytest.mark.parametrize("substituted, told", [((), [IN_PLACE]), ((ACTION,), [])])
def test_a_service_stands_in_for_its_action_and_is_told_to_once(robots, substituted, told):
    robot = robots(release_1_1.INTERFACE, substituted)
    server = Service(robot.master, DRIVE)
    robot.peers.append(server)
    for _ in range(2):
        assert robot.finish(robot.gateway.start(GOAL))[0] == Answer()
    assert robot.told == told and len(server.requests) == 2


def test_where_neither_an_action_nor_its_service_is_offered_nothing_is_told(robots):
    robot = robots(release_1_1.INTERFACE)
    failure = robot.finish(robot.gateway.start(GOAL))[0]
    assert failure.cause is Cause.NOT_ADVERTISED and not robot.told


def test_a_robot_without_the_action_is_asked_by_its_service(robot):
    server = Service(robot.master, INTERFACE.service(GoTo))
    robot.peers.append(server)
    for _ in range(2):
        assert robot.finish(robot.gateway.start(GOAL))[0] == Answer()
    assert robot.told == ["the robot D5.4.3 has no action /robotNavigation/set_goal: its service "
                          "is used in its place"]


@pytest.mark.parametrize("request_, expected", [
    (SetPose(Location(0.0, 0.0, 0.0)), None), (Prompt(("a", "b")), Cause.NOT_ADVERTISED)])
def test_what_is_optional_and_not_offered_counts_as_done_unless_it_fails_without(
        robots, request_, expected):
    robot = robots(release_1_0.INTERFACE)
    result = robot.finish(robot.gateway.start(request_))[0]
    assert result == Answer() if expected is None else result.cause is expected


def test_without_a_thread_only_the_safe_state_is_asked_for(robot, monkeypatch):
    def fail(service):
        raise RuntimeError("can't start new thread")

    monkeypatch.setattr(service_client, "_started", fail)
    off = SetAttention("disabled")
    robot.peers.append(Service(robot.master, INTERFACE.service(SetAttention)))
    failure = robot.say()[0]
    assert failure.cause is Cause.NOT_REACHABLE and failure.message == (
        "no thread to ask with (can't start new thread)") and failure.resource == SPEECH.name
    assert robot.finish(robot.gateway.start(off))[0] == Answer()
    assert off not in robot.gateway.standby


def test_calls_under_way_end_at_once_when_they_are_cut(robot):
    robot.serves(HANG)
    call = robot.gateway.start(Say("hello"))
    until(lambda: robot.peers[-1].requests)
    robot.gateway.cut()
    failure, seconds = robot.finish(call)
    assert failure.cause is Cause.CONNECTION_LOST and seconds < 2.0


def test_feedback_is_handed_on_while_the_call_is_under_way(robot):
    robot.serves(HANG, HANG)
    call, told = robot.gateway.start(Say("hello")), []
    call.on_feedback = told.append
    until(lambda: robot.peers[-1].requests)
    held = robot.gateway._under_way[call]
    robot.gateway._hand_over(robot.gateway._report, call, "half")
    robot.clock.run_due()
    call.drop()
    robot.gateway._hand_over(robot.gateway._report, call, "late")
    robot.clock.run_due()
    assert told == ["half"] and held.thread.service is SPEECH


@pytest.mark.slow
def test_a_call_without_an_answer_is_slow_first_and_then_failed(robot):
    robot.serves(HANG, HANG, HANG)
    robot.deadline, seen, events = 0.2, [], Events()
    events.subscribe(lambda event: seen.append(event.status))
    for _ in range(3):
        assert robot.say("")[0].cause is Cause.NO_ANSWER
    robot.health.publish(events)
    assert seen == ["slow: no answer for 0.1 s", "failing: 3 calls in a row"]
    robot.deadline = 20.0
    robot.say("")
    robot.health.publish(events)
    assert seen[2:] == ["works again", "answers in time again"]


@pytest.mark.slow
def test_what_this_computer_could_not_ask_is_no_failure_of_the_server(robot):
    robot.serves()
    for _ in range(4):
        with no_files_left():
            assert robot.say("")[0].cause is Cause.NOT_REACHABLE
    events, seen = Events(), []
    events.subscribe(seen.append)
    robot.health.publish(events)
    assert not seen


@pytest.mark.slow
@pytest.mark.parametrize("request_, least", [(SetAttention("disabled"), 0.4), (Say("a"), 0.0)])
def test_the_safe_state_has_its_seconds_of_the_process_however_fast_the_simulated_time_goes(
        robot, request_, least):
    clock = SimulatedClock(robot.wake.emit)
    clock.set_to(1.0)
    robot.peers.append(Service(robot.master, INTERFACE.service(type(request_)), HANG))
    gateway = RosGateway(INTERFACE, lambda service: 0.4, clock, robot.wake.emit)
    began, call = time.monotonic(), gateway.start(request_)
    clock.set_to(100.0)
    while call.result is None:
        robot.wake.wait(0.05)
        robot.wake.test_and_clear()
        clock.run_due()
        clock.process.run_due()
        assert time.monotonic() - began < LIMIT
    assert call.result.cause is Cause.NO_ANSWER and time.monotonic() - began >= least
    assert least or time.monotonic() - began < 0.4
    gateway.close()
    for thread in gateway.standby.values():
        thread.end()


def test_what_takes_long_to_connect_to_is_prepared_once(robots):
    robot = robots(release_1_1.INTERFACE)
    for _ in range(2):
        robot.gateway.prepare([SPEECH, ACTION])
    assert {service: len(threads) for service, threads in robot.gateway._spare.items()
            if threads} == {ACTION: 1}


# --------------------------------------------------------------------------------------- publishing

SIGN = Publication(Say, "/sign", "sign", "std_msgs/String", lambda request: (request.text,), None,
                   5.0, "nothing is shown")


class Subscriber:
    """A subscriber as rospy's publisher knows it; ``messages`` are those that it was sent."""

    id = endpoint_id = "/s"

    def __init__(self):
        self.socket, self.end = socket.socketpair()
        self.messages = []

    def write_data(self, data):
        self.messages.append(data)


@pytest.fixture
def publishing(robot, monkeypatch):
    monkeypatch.setattr(service_client, "STEP_LIMIT", 0.3)
    monkeypatch.setattr(rospy.topics, "is_initialized", lambda: True)
    monkeypatch.setitem(TYPES, SIGN, TYPES[INTERFACE.topic("/speechEvent/text")])
    thread = PublisherThread(SIGN)
    results = queue.Queue()
    thread.start()
    until(lambda: thread._publisher)  # before any request, so that subscribers connect
    thread.send = lambda: thread.carry(Say("hello"), results.put, lambda text: None)
    thread.result = lambda: results.get(timeout=5.0)
    yield thread
    thread.end()
    thread._publisher.impl.connections.clear()  # rospy has one list for each name


def test_a_message_goes_to_a_subscriber_that_is_there_or_comes_in_time(publishing):
    first = Subscriber()
    publishing._publisher.impl.connections.append(first)
    publishing.send()
    assert publishing.result() == Answer()
    first.end.close()  # rospy would count that one as connected
    publishing.send()
    other = Subscriber()
    publishing._publisher.impl.connections.append(other)
    assert publishing.result() == Answer()
    assert [data[-5:] for data in other.messages] == [b"hello"]


@pytest.mark.slow
@pytest.mark.parametrize("is_cut", [False, True])
def test_without_a_subscriber_nothing_is_published(publishing, is_cut):
    began = time.monotonic()
    publishing.send()
    if is_cut:
        assert publishing.cut()
    failure = publishing.result()
    assert failure.cause is Cause.NOT_ADVERTISED and failure.resource == "/sign"
    assert failure.message == "no node subscribes to this topic"
    assert is_cut or time.monotonic() - began >= 0.3
    # the next request is not cut
    publishing._publisher.impl.connections.append(Subscriber())
    publishing.send()
    assert publishing.result() == Answer()
