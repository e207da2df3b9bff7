"""The gateway, with servers in this process: connections that are kept, hang or break, and what a
server answers."""
import socket
import struct
import threading
import time

import pytest

rospy = pytest.importorskip("rospy", reason="needs ROS")

from behavior_controller.bt.engine.clock import Clock  # noqa: E402
from behavior_controller.bt.engine.wakeup import WakeUp  # noqa: E402
from behavior_controller.robot.d543 import INTERFACE  # noqa: E402
from behavior_controller.robot.gateway import Cause  # noqa: E402
from behavior_controller.robot.requests import Answer, Say  # noqa: E402
from behavior_controller.ros import service_client  # noqa: E402
from behavior_controller.ros.master import Directory  # noqa: E402
from behavior_controller.ros.service_client import RosGateway  # noqa: E402
from behavior_controller.ros.types import TYPES  # noqa: E402
from behavior_controller.run.health import Health  # noqa: E402
from ros_peers import (  # noqa: E402
    HANG, LIMIT, Master, Service, TcprosPeer, answer_of, hang, read_block, shake_hands, until)

SPEECH = INTERFACE.service(Say)
KIND = {"callerid": "/robot", "type": "cssr_system/textService", "md5sum": TYPES[SPEECH]._md5sum}


DONE, REFUSED = answer_of(SPEECH), answer_of(SPEECH, success=False)


def error(words):
    return struct.pack("<BI", 0, len(words)) + words


def service_threads():
    return {thread for thread in threading.enumerate() if thread.name.startswith("service /")}


class Robot:
    """A gateway, and the master that it asks."""

    def __init__(self):
        self.deadline, self.clock, self.wake = 20.0, Clock(), WakeUp()
        self.health = Health()
        self._others = service_threads()  # that other tests have left
        self.master = Master()
        self.gateway = RosGateway(INTERFACE, lambda service: self.deadline, self.clock,
                                  self.wake.emit, self.health)
        self.peers = [self.master]

    def say(self, words="hello"):
        """Return the result of a speech, and how long it took."""
        return self.finish(self.gateway.start(Say(words)))

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
def robot(monkeypatch):
    rospy.rostime.set_rostime_initialized(True)  # as the node does at its start
    made = Robot()
    monkeypatch.setenv("ROS_MASTER_URI", made.master.uri)
    monkeypatch.setattr(service_client, "DIRECTORY", Directory())
    yield made
    made.close()
    assert made.rests()


# ------------------------------------------------------------------------------------ connections


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
    ("rosrpc://127.0.0.1:x", Cause.NOT_REACHABLE, "not an address of a service")])
def test_an_entry_at_which_nothing_answers(robot, uri, cause, words):
    robot.master.services[SPEECH.name] = uri
    failure = robot.say()[0]
    assert failure.cause is cause and words in failure.message
    server = robot.serves()  # now it is started
    assert robot.say()[0] == Answer() and len(server.requests) == 1


# ------------------------------------------------------------------------------------------- time


def test_a_server_that_never_shakes_hands_was_not_asked(robot):
    robot.talks(hang)
    robot.deadline = 0.3
    failure, seconds = robot.say()
    assert failure.cause is Cause.NO_ANSWER and "nothing was asked" in failure.message
    assert 0.3 <= seconds < 1.5 and robot.rests()


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
