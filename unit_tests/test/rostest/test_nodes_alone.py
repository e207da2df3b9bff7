#!/usr/bin/env python3
"""Does each simulated node run alone, by rosrun, under the name and with the types of the real one?
"""
import os
import socket
import subprocess
import sys
import tempfile
import threading
import time
import unittest
import xmlrpc.client
import xmlrpc.server
from urllib.parse import urlsplit

import rosgraph
import rosnode
import rospy
import rosservice
import rostest
import rostopic
from cssr_system.srv import robotNavigationService, robotPoseService, textService
from rosgraph_msgs.msg import Clock
from unit_tests.robot.ros_time import RosTime

from first_message import wait_for_first_message

# node, service and its type, topic and its type: contract, sections 2 and 3
TABLE = (
    ("animateBehavior", "/animateBehaviour/set_activation", "cssr_system/animateBehaviorService",
     None, None),
    ("gestureExecution", "/gestureExecution/perform_gesture", "cssr_system/gestureExecutionService",
     None, None),
    ("knowledgeBase", "/knowledgeBase/query", "cssr_system/knowledgeBaseService", None, None),
    ("overtAttention", "/overtAttention/set_mode", "cssr_system/overtAttentionService",
     "/overtAttention/mode", "cssr_system/overtAttentionMessage"),
    ("robotNavigation", "/robotNavigation/set_goal", "cssr_system/robotNavigationService", None,
     None),
    ("tabletEvent", "/tabletEvent/prompt_and_get_response", "cssr_system/textService", None, None),
    ("textToSpeech", "/textToSpeech/say_text", "cssr_system/textService", None, None),
    ("faceDetection", None, None, "/faceDetection/data", "cssr_system/faceDetectionMessage"),
    ("speechEvent", None, None, "/speechEvent/text", "std_msgs/String"))
LIMIT = 60.0  # seconds for a node to start or end, on a computer that is busy


class TestNodesAlone(unittest.TestCase):
    """Starts nodes one by one."""

    def setUp(self):
        self.home = tempfile.TemporaryDirectory()
        self.addCleanup(self.home.cleanup)

    def start(self, *arguments, **environment):
        environment = dict(os.environ, ROS_HOME=self.home.name, **environment)
        process = subprocess.Popen(("rosrun", "unit_tests") + arguments, env=environment,
                                   stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                                   universal_newlines=True)
        self.addCleanup(process.stdout.close)
        self.addCleanup(process.wait, LIMIT)
        self.addCleanup(process.terminate)
        return process

    def assert_offers(self, node, service, service_type, topic, topic_type):
        self.start(node, "_failureRate:=0", "_arrivalRate:=6000")
        if service:
            rospy.wait_for_service(service, LIMIT)
            self.assertEqual(rosservice.get_service_type(service), service_type)
            self.assertEqual(rosservice.get_service_node(service), "/" + node)
        if topic:
            wait_for_first_message(topic, LIMIT)
            self.assertEqual(rostopic.get_topic_type(topic)[0], topic_type)
        self.assertIn("/" + node, rosnode.get_node_names())

    def test_names_can_be_remapped(self):
        self.start("textToSpeech", "/textToSpeech/say_text:=/other/say", "_failureRate:=0")
        rospy.wait_for_service("/other/say", LIMIT)
        self.assertTrue(rospy.ServiceProxy("/other/say", textService)("Hello").success)

    def test_its_lines_come_whole_and_at_once_with_milliseconds(self):
        process = self.start("textToSpeech", "_failureRate:=0", "_verboseMode:=true")
        rospy.wait_for_service("/textToSpeech/say_text", LIMIT)
        rospy.ServiceProxy("/textToSpeech/say_text", textService)("Hello")
        limit = threading.Timer(LIMIT, process.terminate)
        limit.start()
        self.addCleanup(limit.cancel)
        line = next(line for line in process.stdout if ": call 1 " in line)
        self.assertIsNone(process.poll())
        self.assertRegex(line, r"^\[INFO\] \[\d\d:\d\d:\d\d\.\d{3}\]: textToSpeech: call 1 ")

    def test_the_time_is_heard_although_ros_has_not_connected(self):
        """As where an older list of publishers reaches rospy after the newest."""
        publisher, own = rospy.Publisher("/clock", Clock, queue_size=1), RosTime()
        self.addCleanup(publisher.unregister)
        ends = publisher.impl, own._subscriber.impl
        until(lambda: all(end.connections for end in ends))
        for end in ends:
            for connection in list(end.connections):
                end.remove_connection(connection)
                connection.close()
        waits = threading.Thread(target=own.await_first, daemon=True)
        waits.start()
        until(lambda: publisher.publish(rospy.Time(7)) or not waits.is_alive())
        self.assertEqual(own.now(), 7.0)

    def test_a_caller_that_says_nothing_keeps_no_other_away(self):
        self.start("textToSpeech", "_failureRate:=0")
        rospy.wait_for_service("/textToSpeech/say_text", LIMIT)
        address = urlsplit(rosgraph.Master("/test").lookupService("/textToSpeech/say_text"))
        answered = threading.Event()

        def say():
            rospy.ServiceProxy("/textToSpeech/say_text", textService)("Hello")
            answered.set()

        with socket.create_connection((address.hostname, address.port)):
            threading.Thread(target=say, daemon=True).start()
            self.assertTrue(answered.wait(LIMIT))

    def test_requests_are_refused_at_the_failure_rate(self):
        self.start("robotNavigation", "_failureRate:=1", "_callTimes:=none")
        rospy.wait_for_service("/robotNavigation/set_goal", LIMIT)
        go = rospy.ServiceProxy("/robotNavigation/set_goal", robotNavigationService,
                                persistent=True)
        self.assertEqual([go(1.0, 2.0, 90.0).navigation_goal_success for _ in range(5)], 5 * [0])

    def test_each_node_can_be_left_out_for_the_real_one(self):
        names = {"/" + row[0] for row in TABLE}
        for launch in ("simulatedRobot.launch", "behaviorControllerTest.launch"):
            for node in ("textToSpeech", "faceDetection"):
                listed = subprocess.check_output(
                    ("roslaunch", "unit_tests", launch, "use_real_{}:=true".format(node),
                     "--nodes"), universal_newlines=True,
                    env=dict(os.environ, ROS_HOME=self.home.name), timeout=LIMIT)
                self.assertEqual(names & set(listed.split()), names - {"/" + node})

    def test_a_robot_of_release_1_0_has_a_node_that_another_has_not(self):
        process = self.start("robotLocalization")
        output, _ = process.communicate(timeout=LIMIT)
        self.assertEqual((output, process.returncode), (
            "robotLocalization: this robot has no such node: choose another robotInterface\n", 2))
        self.start("robotLocalization", "_robotInterface:=release-1.0", "_failureRate:=0")
        rospy.wait_for_service("/robotLocalization/set_pose", LIMIT)
        set_pose = rospy.ServiceProxy("/robotLocalization/set_pose", robotPoseService)
        self.assertTrue(set_pose(1.0, -2.0, 90.0).success)
        self.assertFalse(set_pose(1.0, float("nan"), 90.0).success)

    def test_a_wrong_configuration_is_one_line_and_exit_code_2(self):
        process = self.start("textToSpeech", "_failureRate:=2")
        output, _ = process.communicate(timeout=LIMIT)
        self.assertRegex(output, "^argument failureRate: .*\"2\".*\n$")
        self.assertEqual(process.returncode, 2)

    def test_a_word_that_it_does_not_read_is_refused_in_one_line(self):
        for word, hint in (("failureRate:=0", "_failureRate"), ("--verbose", "_key:=value"),
                           ("__nam:=x", "__name")):
            process = self.start("textToSpeech", word)
            output, _ = process.communicate(timeout=LIMIT)
            self.assertRegex(output, "^argument {}: .*{}.*\n$".format(word, hint))
            self.assertEqual(process.returncode, 2)

    def test_a_wrong_configuration_of_a_launch_is_one_line_and_ends_it(self):
        for argument, hint in (("failureRate:=2", "failureRate cannot be"),
                               ("failureRat:=0", "did you mean failureRate?")):
            printed = subprocess.run(
                ("roslaunch", "unit_tests", "simulatedRobot.launch", argument), timeout=LIMIT,
                env=dict(os.environ, ROS_HOME=self.home.name), stdout=subprocess.PIPE,
                stderr=subprocess.STDOUT, universal_newlines=True).stdout
            self.assertEqual(printed.count(hint), 1, printed)
            self.assertNotIn("Traceback", printed)

    def test_a_signal_ends_it_while_it_registers(self):
        with SlowMaster(os.environ["ROS_MASTER_URI"]) as master:
            process = self.start("tabletEvent", ROS_MASTER_URI=master.uri)
            self.assertTrue(master.was_asked.wait(LIMIT))
            process.terminate()
            master.may_answer.set()
            process.communicate(timeout=LIMIT)

    def test_without_a_master_it_says_so_in_one_line(self):
        process = self.start("textToSpeech", ROS_MASTER_URI="http://localhost:9")
        output, _ = process.communicate(timeout=LIMIT)
        self.assertEqual(output, "textToSpeech: no ROS master at http://localhost:9: "
                                 "start roscore, or use the launch file\n")
        self.assertEqual(process.returncode, 1)


def until(holds):
    """Wait for what another thread does."""
    ends = time.monotonic() + LIMIT
    while not holds():
        assert time.monotonic() < ends, "not so in {:g} s".format(LIMIT)
        time.sleep(0.05)


class SlowMaster(xmlrpc.server.SimpleXMLRPCServer):
    """Passes calls on to a master, but the first registration of a service that is not rospy's own
    only when it may."""

    allow_reuse_address = True

    def __init__(self, master):
        super().__init__(("localhost", 0), logRequests=False, allow_none=True)
        self._master = master
        self.uri = "http://localhost:{}".format(self.server_address[1])
        self.was_asked, self.may_answer = threading.Event(), threading.Event()

    def _dispatch(self, method, params):
        if method == "registerService" and "prompt" in params[1]:
            self.was_asked.set()
            self.may_answer.wait(LIMIT)
        return getattr(xmlrpc.client.ServerProxy(self._master), method)(*params)

    def __enter__(self):
        threading.Thread(target=self.serve_forever, daemon=True).start()
        return self

    def __exit__(self, *_):
        self.shutdown()
        self.server_close()


def offers(row):
    """Return the case of one node: rostest leaves no text of a subTest in its XML."""
    return lambda case: case.assert_offers(*row)


for each in TABLE:
    setattr(TestNodesAlone, "test_{}_offers_what_the_real_one_does".format(each[0]), offers(each))


if __name__ == "__main__":
    rospy.init_node("test_nodes_alone")
    rostest.rosrun("unit_tests", "nodes_alone", TestNodesAlone, sys.argv)
