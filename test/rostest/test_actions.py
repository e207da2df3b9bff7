#!/usr/bin/env python3
"""Does a request that an action carries out end with its result or the right cause, at its deadline
at the latest, and is its goal cancelled when it is dropped? Is a message sent to subscribers?"""
import os
import socket
import subprocess
import sys
import threading
import time
import unittest
from types import SimpleNamespace

import actionlib
import rosgraph.network
import rospy
import rostest
from actionlib.msg import TestAction, TestFeedback, TestResult
from rospy.impl.registration import get_topic_manager
from rospy.impl.tcpros_base import TCPROSTransport
from rospy.impl.tcpros_pubsub import TCPROSSub
from std_msgs.msg import Header

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))

from behavior_controller.bt.engine.clock import Clock  # noqa: E402
from behavior_controller.wakeup import WakeUp  # noqa: E402
from behavior_controller.run.events import Events  # noqa: E402
from behavior_controller.run.health import Health  # noqa: E402
from behavior_controller.robot.d543 import INTERFACE  # noqa: E402
from behavior_controller.robot.declarations import (  # noqa: E402
    Action, Interface, Publication, Success)
from behavior_controller.robot.gateway import Cause, Failure  # noqa: E402
from behavior_controller.robot.requests import Answer, Request  # noqa: E402
from behavior_controller.ros.action_client import has_publisher  # noqa: E402
from behavior_controller.ros.request_thread import Job  # noqa: E402
from behavior_controller.ros.service_client import RosGateway  # noqa: E402
from behavior_controller.ros.startup_check import find_missing  # noqa: E402
from behavior_controller.ros.subscriber import RosTopics  # noqa: E402
from behavior_controller.ros.tcpros import Trouble  # noqa: E402
from behavior_controller.ros.types import TYPES, message_class  # noqa: E402
from behavior_controller.ros.watchdog import Monitor  # noqa: E402

LONG = 20.0


class Turn(Request, frozen=True):
    """A goal of the action."""

    number: int


class Mark(Request, frozen=True):
    """A message of the topic."""

    frame: str


class Count(Request, frozen=True):
    """A message of another topic."""

    number: int


def action(name, **more):
    """Return the declaration of an action called ``name``."""
    return Action(**dict(dict(
        request=Turn, name=name, node="turner", type="actionlib/Test",
        fields=lambda turn: (turn.number,), success=None, deadline=LONG,
        impact_if_missing="nothing turns",
        answer=lambda result: Answer(response=str(result.result)),
        feedback=lambda feedback: "turned {}".format(feedback.feedback)), **more))


class Server:
    """A server of an action that does what the ``behaviour`` says of a goal."""

    def __init__(self, name):
        self.goals, self.cancelled = [], threading.Event()
        self.behaviour, self.pause = "done", 0.0
        self._server = actionlib.SimpleActionServer(name, TestAction, self._carry_out, False)
        self._server.start()

    def _carry_out(self, goal):
        self.goals.append(goal.goal)
        if self.behaviour == "raise":
            raise ValueError("on purpose")
        if self.behaviour == "abort":
            self._server.set_aborted(text="a wheel is stuck")
        elif self.behaviour == "hang":
            ends = time.monotonic() + LONG
            while not self._server.is_preempt_requested() and time.monotonic() < ends:
                self._server.publish_feedback(TestFeedback(7))
                time.sleep(0.02)
            self.cancelled.set()
            self._server.set_preempted()
        else:
            time.sleep(self.pause)
            self._server.set_succeeded(TestResult(goal.goal + 1))


class TestActions(unittest.TestCase):
    """A gateway with a single action, and the topics that are published to."""

    def use(self, offer, *others):
        """Ask by the declaration ``offer`` from now on."""
        self.offers = (offer,) + others
        for each in self.offers:
            TYPES[each] = message_class(each)
            self.addCleanup(TYPES.pop, each)
        self.clock, self.wake = Clock(), WakeUp()
        interface = Interface("test", self.offers, (), (), {})
        self.gateway = RosGateway(interface, lambda service: service.deadline, self.clock,
                                  self.wake.emit)
        self.addCleanup(self.gateway.close)
        self.reported = []

    def start(self, request):
        call = self.gateway.start(request)
        call.on_feedback = self.reported.append
        return call

    def until(self, holds):
        """Do as the tick thread until that holds."""
        ends = time.monotonic() + LONG
        while not holds() and time.monotonic() < ends:
            self.wake.wait(0.05)
            self.wake.test_and_clear()
            self.clock.run_due()
        self.assertTrue(holds())

    def ask(self, request):
        call = self.start(request)
        self.until(lambda: call.result is not None)
        return call.result

    def missing(self):
        """Return the reasons for which the start-up check would not begin."""
        found_missing = find_missing(self.offers, WakeUp(), lambda: False)
        return [trouble.reason for trouble in found_missing.values()]

    def test_a_goal_ends_with_its_result_again_and_again(self):
        server = Server("/turn/done")
        self.use(action("/turn/done"))
        self.assertEqual([self.ask(Turn(n)) for n in (1, 2, 3)],
                         [Answer(response=str(n)) for n in (2, 3, 4)])
        self.assertEqual(server.goals, [1, 2, 3])
        self.assertEqual(self.missing(), [])

    def test_what_the_server_refuses_is_a_refusal_with_its_reason(self):
        server = Server("/turn/refuse")
        self.use(action("/turn/refuse"))
        for server.behaviour, reason in (("abort", "a wheel is stuck"), ("raise", "on purpose")):
            result = self.ask(Turn(1))
            self.assertEqual((result.cause, result.resource), (Cause.REFUSED, "/turn/refuse"))
            self.assertIn(reason, result.message)

    def test_a_goal_that_its_server_forgets_may_have_been_carried_out(self):
        goals = []
        server = actionlib.ActionServer("/turn/forgotten", TestAction, goals.append,
                                        auto_start=False)
        server.start()
        self.use(action("/turn/forgotten"))
        call = self.start(Turn(1))
        self.until(lambda: goals)
        goals[0].set_accepted()
        with server.lock:
            server.status_list.clear()
        self.until(lambda: call.result is not None)
        self.assertEqual(call.result.cause, Cause.CONNECTION_LOST)

    def test_a_result_may_have_a_field_with_the_outcome(self):
        Server("/turn/outcome")
        self.use(action("/turn/outcome", success=Success("result", 2, 3)))
        self.assertEqual([self.ask(Turn(1)), self.ask(Turn(2)).cause, self.ask(Turn(3)).cause],
                         [Answer(response="2"), Cause.REFUSED, Cause.UNUSABLE_ANSWER])

    def test_a_goal_that_hangs_reports_ends_at_its_deadline_and_is_cancelled(self):
        server = Server("/turn/late")
        server.behaviour = "hang"
        self.use(action("/turn/late", deadline=2.0))
        result = self.ask(Turn(1))
        self.assertEqual((result.cause, self.reported), (Cause.NO_ANSWER, ["turned 7"]))
        self.assertTrue(server.cancelled.wait(LONG))
        server.behaviour = "done"
        self.assertEqual(self.ask(Turn(5)), Answer(response="6"))

    def test_a_goal_that_is_dropped_is_cancelled_whoever_drops_it(self):
        server = Server("/turn/drop")
        server.behaviour = "hang"
        self.use(action("/turn/drop"))
        for stop in (lambda: call.drop(), lambda: self.gateway.cut(), lambda: self.gateway.close()):
            server.cancelled.clear()
            call = self.start(Turn(1))
            self.until(lambda: self.reported)
            self.reported.clear()
            stop()
            self.assertTrue(server.cancelled.wait(LONG))

    def test_without_a_server_or_with_one_of_another_type_the_cause_says_so(self):
        self.use(action("/turn/nowhere"))
        self.assertEqual(self.ask(Turn(1)).cause, Cause.NOT_ADVERTISED)
        self.assertIn(Cause.NOT_ADVERTISED.text, self.missing()[0])
        Server("/turn/other")
        self.use(action("/turn/other", type="cssr_system/recogniseSpeech",
                        answer=lambda result: Answer(), feedback=lambda feedback: ""))
        self.assertIn(Cause.TYPE_MISMATCH.text, self.missing()[0])

    def test_a_connection_that_ros_does_not_make_is_made_all_the_same(self):
        """As where an older list of publishers reaches rospy after the newest."""
        server, topics = Server("/turn/lost"), get_topic_manager()
        server.pause = 0.5  # the publisher counts a connection after the subscriber
        self.use(action("/turn/lost"))
        self.ask(Turn(0))
        for number, topic in enumerate(("goal", "cancel", "status", "result", "feedback"), 1):
            name = "/turn/lost/" + topic
            for end in (topics.get_subscriber_impl(name), topics.get_publisher_impl(name)):
                for connection in list(end.connections):
                    end.remove_connection(connection)
                    connection.close()
            self.assertEqual(self.ask(Turn(number)), Answer(response=str(number + 1)), topic)
        self.assertEqual(server.goals, [0, 1, 2, 3, 4, 5])

    def test_a_goal_that_does_not_fit_the_type_is_not_sent(self):
        server = Server("/turn/wrong")
        # an empty goal has the right fields: what is always wrong is told at the start
        self.use(action("/turn/wrong", fields=lambda turn: ("a", "b") if turn.number else (0,)))
        self.assertEqual(self.ask(Turn(1)).cause, Cause.TYPE_MISMATCH)
        self.use(action("/turn/wrong", fields=lambda turn: ("a",) if turn.number else (0,)))
        failure = self.ask(Turn(1))
        self.assertEqual((failure.cause, server.goals), (Cause.TYPE_MISMATCH, []))
        self.assertRegex(failure.message, r"test_actions\.py:\d+\)")  # of the declaration

    def test_a_message_is_sent_to_its_subscriber_and_without_one_it_is_a_failure(self):
        came, news = [], threading.Event()
        rospy.Subscriber("/mark", Header, lambda message: (came.append(message), news.set()))
        self.use(marking("/mark"),
                 Publication(Count, "/count", "counter", "std_msgs/Int32",
                             lambda count: (count.number,), None, LONG, "nothing is counted"))
        self.assertEqual(self.ask(Mark("map")), Answer())
        self.assertTrue(news.wait(LONG))
        self.assertEqual(came[0].frame_id, "map")
        self.assertGreater(came[0].stamp.to_sec(), 0.0)
        result = self.ask(Count(3))
        self.assertEqual((type(result), result.cause), (Failure, Cause.NOT_ADVERTISED))

    def test_a_connection_to_a_subscriber_that_ros_does_not_make_is_made_all_the_same(self):
        came, name = threading.Semaphore(0), "/mark/lost"
        subscriber = rospy.Subscriber(name, Header, lambda message: came.release())
        self.use(marking(name))
        self.assertEqual(self.ask(Mark("first")), Answer())
        for end in (subscriber.impl, get_topic_manager().get_publisher_impl(name)):
            for connection in list(end.connections):
                end.remove_connection(connection)
                connection.close()
        self.assertEqual(self.ask(Mark("second")), Answer())
        self.assertTrue(came.acquire(timeout=LONG) and came.acquire(timeout=LONG))

    def test_a_message_to_a_subscriber_that_has_died_is_not_sent(self):
        node = subprocess.Popen([sys.executable, "-c", SUBSCRIBER])
        self.addCleanup(node.kill)
        topic = rospy.Publisher("/mark/died", Header, queue_size=1)
        self.use(marking("/mark/died"))
        self.until(topic.get_num_connections)
        self.assertEqual(self.ask(Mark("first")), Answer())
        node.kill()
        node.wait()
        self.assertEqual(self.ask(Mark("second")).cause, Cause.NOT_ADVERTISED)

    def test_what_is_dropped_before_it_is_sent_is_not_sent(self):
        """As after a registration at a master that hangs, beyond the deadline."""
        server, came = Server("/turn/dropped"), []
        rospy.Subscriber("/mark/dropped", Header, lambda message: came.append(message.frame_id))
        self.use(action("/turn/dropped"), marking("/mark/dropped"))
        done = [Answer(response="2"), Answer()]
        self.assertEqual([self.ask(Turn(1)), self.ask(Mark("first"))], done)
        for offer, request in zip(self.offers, (Turn(2), Mark("dropped"))):
            job = Job(request, print, print, threading.Event())
            job.cut.set()
            with self.assertRaises(Trouble):
                self.gateway._spare[offer][-1].exchange(job)
        self.assertEqual([self.ask(Turn(1)), self.ask(Mark("last"))], done)
        self.until(lambda: came[-1:] == ["last"])
        self.assertEqual((server.goals, came), ([1, 1], ["first", "last"]))

    def test_a_connection_counts_when_its_publisher_has_answered(self):
        """What its publisher sends before that is lost."""
        listener = socket.create_server(("127.0.0.1", 0))
        self.addCleanup(listener.close)
        transport = TCPROSTransport(TCPROSSub("/x", Header), "/x")
        topic = SimpleNamespace(impl=SimpleNamespace(connections=[transport]))
        connecting = threading.Thread(
            target=transport.connect, args=listener.getsockname() + ("http://x:1/", LONG))
        connecting.start()
        peer = listener.accept()[0]
        self.addCleanup(peer.close)
        self.assertFalse(has_publisher(topic))
        rosgraph.network.write_ros_handshake_header(
            peer, {"type": Header._type, "md5sum": Header._md5sum, "callerid": "/x"})
        connecting.join(LONG)
        self.assertTrue(has_publisher(topic))
        transport.close()
        self.assertFalse(has_publisher(topic))

    def test_the_monitor_notices_a_server_that_dies_and_one_that_is_started(self):
        turn = action("/turn/away")
        TYPES[turn] = message_class(turn)
        self.addCleanup(TYPES.pop, turn)
        health, events, seen = Health(), Events(), []
        events.subscribe(seen.append)
        topics = RosTopics((), lambda: None, lambda text: None)
        monitor = Monitor(INTERFACE, topics, health, lambda: True)
        self.addCleanup(monitor.close)

        def wait_for(is_well):
            ends = time.monotonic() + LONG
            while not (seen and seen[-1].is_well is is_well) and time.monotonic() < ends:
                time.sleep(0.05)
                health.publish(events)
            self.assertEqual((seen[-1].kind, seen[-1].name, seen[-1].is_well),
                             ("action", "/turn/away", is_well))

        monitor.include([turn])
        wait_for(False)
        for _ in range(2):
            server = subprocess.Popen([sys.executable, "-c", SERVER])
            self.addCleanup(server.kill)
            wait_for(True)
            server.kill()
            wait_for(False)


def marking(name):
    """Return the declaration of a commanded topic called ``name``."""
    return Publication(Mark, name, "marker", "std_msgs/Header",
                       lambda mark: (0, "now", mark.frame), None, LONG, "nothing is marked")


SERVER = """
import actionlib, rospy
from actionlib.msg import TestAction
rospy.init_node("server")
actionlib.SimpleActionServer("/turn/away", TestAction, lambda goal: None, True)
rospy.spin()
"""

SUBSCRIBER = """
import rospy
from std_msgs.msg import Header
rospy.init_node("marker")
rospy.Subscriber("/mark/died", Header, print)
rospy.spin()
"""

if __name__ == "__main__":
    rospy.init_node("test_actions")
    RosTopics((), lambda: None, lambda text: None).subscribe()
    rostest.rosrun("cssr_system", "actions", TestActions)
