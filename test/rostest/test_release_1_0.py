#!/usr/bin/env python3
"""Does the ROS edge work with a robot of release 1.0: its types, its action, missing services, the
start's messages?"""
import dataclasses
import io
import os
import re
import signal
import sys
import time
import unittest

import rospy
import rostest
from actionlib_msgs.msg import GoalStatus

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from release_parts import ACTION, MISSION, EndingServer, ReleaseCase  # noqa: E402
from robot import Robot, forget_dead_entries, robot_for  # noqa: E402

from behavior_controller.bt.engine.clock import Clock  # noqa: E402
from behavior_controller.wakeup import WakeUp  # noqa: E402
from behavior_controller.robot.gateway import Cause, Failure  # noqa: E402
from behavior_controller.robot.requests import (
    Answer, GoTo, Location, PerformGesture, Point, Prompt, Say, SetAnimation, SetAttention,
    SetPose, SetRecognition, SetRecognitionLanguage)
from behavior_controller.robot.release_1_0 import ATTENTION, INTERFACE, SPEECH  # noqa: E402
from behavior_controller.ros.action_client import (  # noqa: E402
    PARAMETERS, ACK_LIMIT, ROUND_WHEN_LISTENING, SpeechActionClient)
from behavior_controller.ros.service_client import RosGateway  # noqa: E402
from behavior_controller.ros.subscriber import RosTopics  # noqa: E402
from behavior_controller.ros.types import TYPES  # noqa: E402

RELEASE = {"interface": "release-1.0"}
BY_ACTION = {"interface": "release-1.0", ACTION: "done", "/speechEvent/text": "absent"}


class TestGateway(unittest.TestCase):
    """The requests, as a robot of release 1.0 gets them."""

    def setUp(self):
        self.clock, self.wake = Clock(), WakeUp()
        self.gateway = RosGateway(INTERFACE, lambda service: 20.0, self.clock, self.wake.emit)
        self.addCleanup(forget_dead_entries)
        self.addCleanup(self.gateway.close)

    def robot(self, modes):
        robot = Robot(modes)
        self.addCleanup(robot.stop)
        return robot

    def ask(self, request):
        call, ends = self.gateway.start(request), time.monotonic() + 30.0
        while call.result is None and time.monotonic() < ends:
            self.wake.wait(ends - time.monotonic())
            self.wake.test_and_clear()
            self.clock.run_due()
        return call.result

    def test_each_request_arrives_in_the_fields_of_the_release(self):
        robot = self.robot(RELEASE)
        asked = (SetAnimation("enabled"), PerformGesture("deictic", 1, 3000, Point(1.0, 2.0, 3.0)),
                 SetAttention("seeking"), SetPose(Location(2.5, -1.25, 90.0)),
                 GoTo(Location(-3.5, 4.0, -90.0)), SetRecognition(True), SetRecognition(False),
                 SetRecognitionLanguage("Kinyarwanda"), Prompt(
                     ("Yes", "No")), Say("Muraho", "Kinyarwanda"))
        self.assertEqual([self.ask(request) for request in asked], [Answer()] * 10)
        robot.wait_for_request("/textToSpeech/say_text", 10.0)
        self.assertEqual(
            [request["fields"] for request in robot.requests()],
            [{"state": "enabled"}, {
                "gesture_type": "deictic", "gesture_id": 1, "gesture_duration": 3000,
                "bow_nod_angle": 0, "location_x": 1.0, "location_y": 2.0, "location_z": 3.0
            }, {"state": "seeking", "location_x": 0.0, "location_y": 0.0, "location_z": 0.0},
             {"x": 2.5, "y": -1.25, "theta": 90.0}, {
                 "goal_x": -3.5, "goal_y": 4.0, "goal_theta": -90.0
             }, {"status": "true"}, {"status": "false"}, {"language": "Kinyarwanda"},
             {"message": "'Yes'|'No'"}, {"message": "Muraho", "language": "Kinyarwanda"}])

    def test_what_the_robot_lacks_is_passed_over_but_for_the_tablet(self):
        lacking = ("/robotLocalization/set_pose", "/speechEvent/set_enabled",
                   "/speechEvent/set_language", "/tabletEvent/prompt_and_get_response",
                   "/robotNavigation/set_goal")
        self.robot(dict(RELEASE, **{name: "absent" for name in lacking}))
        for request in (SetPose(Location(0, 0, 0)), SetRecognition(True),
                        SetRecognitionLanguage("English")):
            self.assertEqual(self.ask(request), Answer())
        for request in (Prompt(("Yes", "No")), GoTo(Location(0, 0, 0))):
            self.assertEqual(self.ask(request).cause, Cause.NOT_ADVERTISED)

    def test_a_refusal_of_what_a_robot_may_lack_is_a_failure(self):
        self.robot(dict(RELEASE, **{
            "/robotLocalization/set_pose": "refuse", "/speechEvent/set_enabled": "odd"}))
        results = [self.ask(SetPose(Location(0, 0, 0))), self.ask(SetRecognition(True))]
        self.assertEqual([result.cause for result in results],
                         [Cause.REFUSED, Cause.UNUSABLE_ANSWER])
        self.assertIsInstance(results[0], Failure)


class TestHearing(unittest.TestCase):
    """What visitors say, by the action. rospy subscribes once per topic and process: the cases
    share ``RosTopics``."""

    @classmethod
    def setUpClass(cls):
        cls.wake = WakeUp()
        cls.warnings = []
        cls.topics = RosTopics(INTERFACE.topics, cls.wake.emit, cls.warnings.append)
        cls.topics.subscribe()

    def setUp(self):
        del self.warnings[:]
        self.latch = self.topics.buffers[SPEECH]
        self.robot = None

    def tearDown(self):
        self.topics.listen(SPEECH, 0.0)
        if self.robot is not None:
            self.robot.stop()
        forget_dead_entries()
        self.wait_until(lambda: not self.latch.is_connected)

    def start(self, **modes):
        """Start a robot with these modes, and return it when the client is connected to its action.
        """
        self.robot = Robot(dict(BY_ACTION, **modes))
        self.wait_until(lambda: self.latch.is_connected)
        return self.robot

    def wait_until(self, is_so, seconds=15.0):
        """rospy does not report its connections: poll until it is connected."""
        ends = time.monotonic() + seconds
        while not is_so():
            self.assertLess(time.monotonic(), ends)
            time.sleep(0.02)

    def goal(self, robot, start=0):
        """Return the wait of the next goal, and the number of its line."""
        robot.lines.wait_for(lambda line: '"goal"' in line, 10, start)
        number = next(i for i, (_, line) in enumerate(robot.lines.all)
                      if i >= start and '"goal"' in line)
        return float(re.search(r'"goal": ([\d.]+)', robot.lines.all[number][1]).group(1)), number

    def heard(self, is_wanted=lambda value: True):
        """Wait for the alarm, and return the newest message."""
        self.wake.test_and_clear()
        self.topics.newest(SPEECH)
        self.topics.wake_when("test", SPEECH, is_wanted)

        def wait():
            self.assertTrue(self.wake.wait(10) or self.wake.test_and_clear())
            return self.topics.newest(SPEECH)
        return wait

    def test_a_goal_is_sent_while_the_mission_listens_and_its_result_is_a_message(self):
        robot = self.start()
        time.sleep(0.7)  # a look for the server and more
        self.assertNotIn('"goal"', robot.lines.text())
        wait, asked = self.heard(), time.monotonic()
        self.topics.listen(SPEECH, 8.0)
        self.assertLess(time.monotonic() - asked, 0.5)
        seconds, number = self.goal(robot)
        self.assertTrue(7.0 < seconds <= 8.0, seconds)
        robot.say("Yes, please")
        sample = wait()
        self.assertEqual(sample.value, "Yes, please")
        self.assertTrue(asked < sample.arrived <= time.monotonic())
        self.goal(robot, number + 1)  # it goes on listening
        self.assertEqual(self.warnings, [])

    def test_the_goal_is_cancelled_when_the_mission_listens_no_longer(self):
        robot = self.start()
        self.topics.listen(SPEECH, 30.0)
        self.goal(robot)
        self.topics.listen(SPEECH, 0.0)
        robot.lines.wait_for(lambda line: "cancelled" in line, 5)
        self.assertEqual(robot.lines.text().count('"goal"'), 1)

    def test_silence_is_no_message_and_the_time_that_was_asked_for_is_kept(self):
        robot = self.start()
        before = self.topics.newest(SPEECH)
        self.topics.listen(SPEECH, 1.0)
        self.goal(robot)
        time.sleep(1.6)
        self.assertIs(self.topics.newest(SPEECH), before)
        self.assertEqual(robot.lines.text().count('"goal"'), 1)

    def test_a_goal_that_is_aborted_is_heard_as_an_error_and_warned_of_once(self):
        self.start(**{ACTION: "abort"})
        wait = self.heard(lambda value: value.startswith("Error"))
        self.topics.listen(SPEECH, 5.0)
        self.assertEqual(wait().value, "Error: {} aborted (the microphone is away)".format(ACTION))
        time.sleep(0.8)  # further goals
        self.assertEqual(self.warnings,
                         ["the action {} failed: aborted (the microphone is away)".format(ACTION)])

    def test_the_result_counts_whether_it_comes_before_the_status_or_after_it(self):
        for parts in (("status", "result"), ("result", "status")):
            with self.subTest(parts):
                self.robot = EndingServer(parts, 10 * ROUND_WHEN_LISTENING)
                self.wait_until(lambda: self.latch.is_connected and self.robot.is_connected)
                wait = self.heard()
                self.topics.listen(SPEECH, 30.0)
                self.assertEqual(wait().value,
                                 "Error: {} aborted (the microphone is away)".format(ACTION))
                self.tearDown()

    def test_a_status_that_says_why_is_enough(self):
        self.robot = EndingServer(["status"])
        self.wait_until(lambda: self.latch.is_connected and self.robot.is_connected)
        wait = self.heard()
        self.topics.listen(SPEECH, 30.0)
        self.assertEqual(wait().value, "Error: {} aborted (the microphone is away)".format(ACTION))

    def test_a_result_that_does_not_come_is_asked_for_again_some_time_after_the_status(self):
        self.robot = EndingServer(["status"], status=GoalStatus.SUCCEEDED)
        self.wait_until(lambda: self.latch.is_connected and self.robot.is_connected)
        before, asked = self.topics.newest(SPEECH), time.monotonic()
        self.topics.listen(SPEECH, 30.0)
        self.wait_until(lambda: self.robot.goals == 2)
        self.assertGreaterEqual(time.monotonic() - asked, ACK_LIMIT)
        self.assertIs(self.topics.newest(SPEECH), before)
        self.assertEqual(["its result did not come" in text for text in self.warnings], [True])

    def test_what_is_said_in_time_is_heard_when_it_has_been_recognised(self):
        robot = self.start(**{ACTION: "late"})
        self.topics.listen(SPEECH, 0.5)
        self.goal(robot)
        time.sleep(1.0)
        self.assertTrue(self.topics.is_hearing(SPEECH))
        wait = self.heard()
        robot.say("Yes")
        self.assertEqual(wait().value, "Yes")
        self.wait_until(lambda: not self.topics.is_hearing(SPEECH))
        self.assertEqual(robot.lines.text().count('"goal"'), 1)

    def test_a_result_has_its_own_limit_after_the_time_of_the_goal(self):
        robot = self.start(**{ACTION: "late"})
        action = dataclasses.replace(SPEECH.action, deadline=1.0)
        TYPES[action] = TYPES[SPEECH.action]
        self.addCleanup(TYPES.pop, action)
        warnings = []
        hearing = SpeechActionClient(action, lambda: False, self.fail, lambda: None,
                                     warnings.append)
        self.wait_until(lambda: hearing.is_there)
        asked = time.monotonic()
        hearing.listen(0.5)
        self.goal(robot)
        self.assertTrue(hearing.is_under_way)
        robot.lines.wait_for(lambda line: "cancelled" in line, 5)
        self.assertGreaterEqual(time.monotonic() - asked, 1.5)
        self.assertFalse(hearing.is_under_way)
        self.wait_until(lambda: warnings)
        self.assertEqual(warnings, ["the action {} has given no result in time".format(ACTION)])

    def test_a_round_that_was_silent_wakes_the_tree_when_the_time_is_over(self):
        robot = self.start()
        self.topics.listen(SPEECH, 0.5)
        self.goal(robot)
        self.wake.test_and_clear()
        self.assertTrue(self.wake.wait(5) or self.wake.test_and_clear())
        self.assertFalse(self.topics.is_hearing(SPEECH))

    def test_a_visitor_who_is_reported_once_in_a_burst_is_noticed(self):
        latch = self.topics.buffers[ATTENTION]
        publisher = rospy.Publisher(ATTENTION.name, TYPES[ATTENTION], queue_size=10)
        self.addCleanup(publisher.unregister)
        self.wait_until(lambda: latch.connected_nodes and publisher.impl.connections)
        burst = io.BytesIO()
        for value in (1, 2, 1, 1):
            rospy.msg.serialize_message(burst, 0, TYPES[ATTENTION]("scanning", value))
        publisher.impl.connections[0].socket.sendall(burst.getvalue())
        self.wait_until(lambda: [sample.value for sample in latch.recent()] ==
                        [("scanning", 2), ("scanning", 1)])

    def test_a_server_that_dies_with_the_goal_is_heard_as_an_error(self):
        self.start(**{ACTION: "exit"})
        wait = self.heard(lambda value: value.startswith("Error"))
        self.topics.listen(SPEECH, 20.0)
        self.assertIn("its server is gone", wait().value)

    def test_a_server_that_is_started_again_is_used_again(self):
        self.start().stop()
        self.wait_until(lambda: not self.latch.is_connected)
        robot = self.start()
        wait = self.heard()
        self.topics.listen(SPEECH, 8.0)
        self.goal(robot)
        robot.say("No")
        self.assertEqual(wait().value, "No")

    def test_a_parameter_of_a_wrong_type_is_told_and_hearing_begins_when_it_is_right(self):
        for name in PARAMETERS:
            rospy.set_param(name, "ten")
            self.addCleanup(lambda name=name: rospy.has_param(name) and rospy.delete_param(name))
        self.start()
        warnings = []
        hearing = SpeechActionClient(SPEECH.action, lambda: False, lambda value: None, lambda: None,
                          warnings.append)
        self.wait_until(lambda: warnings)
        time.sleep(1.2)  # two more attempts
        self.assertEqual([PARAMETERS[0] in text and "'ten'" in text for text in warnings], [True])
        rospy.delete_param(PARAMETERS[0])
        self.wait_until(lambda: len(warnings) == 2 and PARAMETERS[1] in warnings[1])
        rospy.set_param(PARAMETERS[1], 5)
        self.wait_until(lambda: hearing.is_there)

    def test_a_hung_action_holds_nothing_up(self):
        robot = self.start(**{ACTION: "hang"})
        self.topics.listen(SPEECH, 20.0)
        self.goal(robot)
        robot.process.send_signal(signal.SIGSTOP)
        self.addCleanup(robot.process.send_signal, signal.SIGCONT)
        began = time.monotonic()
        for seconds in (5.0, 0.0, 5.0, 0.0):
            self.topics.listen(SPEECH, seconds)
            self.topics.newest(SPEECH)
        self.assertLess(time.monotonic() - began, 0.5)
        robot.process.send_signal(signal.SIGCONT)

    def test_where_the_topic_is_published_no_goal_is_sent(self):
        robot = self.robot = Robot({"interface": "release-1.0", ACTION: "done"})
        self.wait_until(lambda: self.latch.connected_nodes)
        self.topics.listen(SPEECH, 3.0)
        wait = self.heard(lambda value: value == "by topic")
        robot.publish("/speechEvent/text", "by topic", hertz=10)
        self.assertEqual(wait().value, "by topic")
        self.assertNotIn('"goal"', robot.lines.text())


class TestStart(ReleaseCase):
    """The messages of the start about the robot, and a mission on it."""

    def setUp(self):
        super().setUp()
        self.package.write("data/small.xml", MISSION.format(
            "<LookUpHome/><Navigate/><RetrieveListOfExhibits/><SelectExhibit/>"
            "<DescribeExhibitSpeech name='1'/><WelcomeSpeech/>"))

    def robot(self, modes):
        return robot_for(self, modes)

    def controller(self, *arguments, **values):
        self.package.configure(**dict(
            dict(robotInterface="release-1.0", scenarioSpecification="small", missionRuns=1,
                 startupCheck="all"), **values))
        return super().controller(*arguments)

    def run_node(self, **values):
        controller = self.controller(**values)
        code = controller.wait(30)
        text = re.sub(r"(?m)^\[(\w+)\] \[[\d:.]+\]: ", r"\1 ", controller.lines.text())
        self.assertNotIn("Traceback", text)
        return code, text

    def test_a_mission_runs_on_the_files_and_the_release_s_services(self):
        robot = self.robot(RELEASE)
        code, text = self.run_node()
        self.assertEqual(code, 0, text)
        self.assertEqual(
            [(request["service"], request["fields"]) for request in robot.requests()[:-2]],
            [("/robotNavigation/set_goal", {"goal_x": 2.5, "goal_y": -1.25, "goal_theta": 90.0}),
             ("/textToSpeech/say_text", {"message": "Hello", "language": "English"}),
             ("/textToSpeech/say_text",
              {"message": robot.requests()[2]["fields"]["message"], "language": "English"})])
        self.assertIn("robot interface release-1.0; knowledge: ", text)

    def test_what_the_robot_lacks_is_said_once_and_the_mission_runs(self):
        self.robot(dict(RELEASE, **{
            "/robotLocalization/set_pose": "absent", "/speechEvent/set_enabled": "absent",
            "/tabletEvent/prompt_and_get_response": "absent"}))
        code, text = self.run_node()
        self.assertEqual(code, 0, text)
        for name in ("/robotLocalization/set_pose", "/speechEvent/set_enabled",
                     "/tabletEvent/prompt_and_get_response"):
            self.assertEqual(text.count("WARN behaviorController: service {} ".format(name)), 1,
                             text)
            # the monitoring does not report it missing either
            self.assertEqual(text.count(name), 1, text)
        self.assertNotIn("set_language", text)

    def test_without_speech_recognition_the_tablet_is_needed(self):
        self.robot(dict(RELEASE, **{"/tabletEvent/prompt_and_get_response": "absent"}))
        code, text = self.run_node(asrEnabled="false")
        self.assertEqual(code, 1, text)
        self.assertIn("ERROR behaviorController:   service /tabletEvent/prompt_and_get_response",
                      text)

    def test_utterances_by_the_action_alone_are_enough_and_neither_is_told_as_missing(self):
        robot = self.robot(BY_ACTION)
        code, text = self.run_node()
        self.assertEqual(code, 0, text)
        self.assertEqual(text.count("no node offers the topic /speechEvent/text: the action " +
                                    ACTION + " is used in its place"), 1, text)
        robot.stop()
        self.robot(dict(RELEASE, **{"/speechEvent/text": "absent"}))
        code, text = self.run_node()
        self.assertEqual(code, 1, text)
        self.assertIn("no node publishes it, and none offers the action " + ACTION, text)

    def test_the_wrong_interface_is_told_as_such(self):
        robot = self.robot(RELEASE)
        code, text = self.run_node(robotInterface="D5.4.3", scenarioSpecification="lab_tour")
        self.assertEqual(code, 1, text)
        errors = [line for line in text.splitlines() if line.startswith("ERROR")]
        self.assertEqual(len(errors), 1, text)
        self.assertIn(
            "this is a robot of release 1.0: set robotInterface release-1.0 (the configuration "
            "says D5.4.3; found: /animateBehaviour/setActivation as ", errors[0])
        self.assertNotIn("mismatch", text)
        robot.stop()
        self.robot({})
        code, text = self.run_node()
        self.assertEqual(code, 1, text)
        self.assertIn(
            "this is a robot of D5.4.3: set robotInterface D5.4.3 (the configuration says "
            "release-1.0;", text)

    def test_a_part_that_is_missing_of_the_right_robot_is_told_as_such(self):
        self.robot(dict(RELEASE, **{"/robotNavigation/set_goal": "absent"}))
        code, text = self.run_node()
        self.assertEqual(code, 1, text)
        self.assertIn("1 of the 11 services and topics that the mission needs are missing", text)
        self.assertNotIn("this is a robot of", text)

    def test_another_interface_cannot_follow(self):
        self.robot(RELEASE)
        controller = self.controller(missionRuns=0)
        controller.lines.wait_for(lambda line: "pass" in line.lower(), 20)
        self.package.configure(scenarioSpecification="lab_tour")
        controller.process.send_signal(signal.SIGHUP)
        line = controller.lines.wait_for(lambda line: "refused" in line, 10)[1]
        self.assertIn(
            "refused, the running mission stays: robotInterface D5.4.3 cannot follow release-1.0",
            line)
        self.assertIsNone(controller.process.poll())
        self.assertEqual(controller.stop()[0], 0)


if __name__ == "__main__":
    rospy.init_node("test_release_1_0", disable_signals=True)
    rostest.rosrun("cssr_system", "release_1_0", "__main__")
