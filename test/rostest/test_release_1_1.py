#!/usr/bin/env python3
"""Do the requests of release 1.1 reach its services and actions, does the service of the same name
stand in for an action, and is a robot of another release told as such?"""
import os
import re
import sys
import time
import unittest

import rospy
import rostest

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from release_parts import MISSION, EndingServer, ReleaseCase  # noqa: E402
from robot import Controller, Robot, forget_dead_entries  # noqa: E402

from behavior_controller.bt.engine.clock import Clock  # noqa: E402
from behavior_controller.wakeup import WakeUp  # noqa: E402
from behavior_controller.robot import release_1_0  # noqa: E402
from behavior_controller.robot.gateway import Cause  # noqa: E402
from behavior_controller.robot.release_1_1 import INTERFACE, SERVICES  # noqa: E402
from behavior_controller.robot.requests import (  # noqa: E402
    Answer, GoTo, GoToGoal, Location, PerformGesture, PerformGestureGoal, Point, Say, SayGoal)
from behavior_controller.ros.service_client import RosGateway  # noqa: E402
from behavior_controller.ros.subscriber import RosTopics  # noqa: E402
from behavior_controller.ros.watchdog import Monitor  # noqa: E402
from behavior_controller.run.events import Events  # noqa: E402
from behavior_controller.run.health import Health  # noqa: E402

RELEASE = {"interface": "release-1.1"}
SAY, DRIVE = "/textToSpeech/say_text", "/robotNavigation/set_goal"
GESTURE, MODE = "/gestureExecution/perform_gesture", "/overtAttention/mode"
ACTION, TEXT = "/speechEvent/recognise_speech_action", "/speechEvent/text"
LANGUAGE, ENABLED = "/speechEvent/set_language", "/speechEvent/set_enabled"
ACTIONS = ["action " + name for name in (GESTURE, DRIVE, SAY)]
GOAL = Location(1.0, 2.0, 90.0)
SETTLED = 0.5
"""Seconds within which a server publishes to a client that its handshake says is connected."""
WARNINGS = []
TOPICS = RosTopics(INTERFACE.topics, lambda: None, WARNINGS.append)
"""One for this process: rospy subscribes once per topic and process."""


class TestGateway(unittest.TestCase):
    """The requests, as a robot of release 1.1 gets them."""

    def setUp(self):
        self.clock, self.wake, self.told = Clock(), WakeUp(), []
        self.gateway = RosGateway(INTERFACE, lambda service: 20.0, self.clock, self.wake.emit,
                                  tell=self.told.append)
        self.addCleanup(forget_dead_entries)
        self.addCleanup(self.gateway.close)

    def robot(self, **modes):
        """Start a robot, and return it when the gateway is connected to its actions."""
        robot = Robot(dict(RELEASE, **modes))
        self.addCleanup(robot.stop)
        actions = [each for each in SERVICES if each.kind == "action"
                   and modes.get("action " + each.name) != "absent"]
        self.gateway.prepare(actions)
        threads = [self.gateway._spare[action][-1] for action in actions]
        self.until(lambda: all(thread.is_there for thread in threads))
        time.sleep(SETTLED)
        return robot

    def until(self, holds):
        ends = time.monotonic() + 30.0
        while not holds() and time.monotonic() < ends:
            self.wake.wait(0.1)
            self.wake.test_and_clear()
            self.clock.run_due()
        self.assertTrue(holds())

    def ask(self, request):
        call = self.gateway.start(request)
        self.until(lambda: call.result is not None)
        return call.result

    def reached(self, robot):
        return [request["service"] for request in robot.requests()]

    def test_service_and_action_of_one_name_get_their_own_requests(self):
        robot = self.robot()
        pointing = "deictic", 1, 3000, Point(1.0, 2.0, 3.0), 0, "LEFT", "PALM_UPWARDS"
        for request in (Say("a"), SayGoal("b"), GoTo(GOAL), GoToGoal(GOAL),
                        PerformGesture(*pointing), PerformGestureGoal(*pointing)):
            self.assertEqual(self.ask(request), Answer())
        robot.wait_for_request("action " + GESTURE, 10.0)
        names = [SAY, "action " + SAY, DRIVE, "action " + DRIVE, GESTURE, "action " + GESTURE]
        self.assertEqual(self.reached(robot), names)
        fields = [request["fields"] for request in robot.requests()]
        self.assertEqual(fields[:2], [{"message": "a", "language": "English"},
                                      {"text": "b", "language": "English"}])
        self.assertEqual(fields[4], fields[5])
        self.assertEqual(fields[4], {
            "gesture_type": "deictic", "gesture_id": 1, "arm": "LEFT",
            "deictic_shape": "PALM_UPWARDS", "gesture_duration": 3000, "bow_nod_angle": 0,
            "location_x": 1.0, "location_y": 2.0, "location_z": 3.0})
        self.assertEqual(self.told, [])

    def test_a_result_that_says_no_is_a_failure_though_the_goal_succeeded(self):
        self.robot(**{"action " + DRIVE: "refuse", "action " + SAY: "abort"})
        refused, aborted = self.ask(GoToGoal(GOAL)), self.ask(SayGoal("a"))
        self.assertEqual((refused.cause, refused.message),
                         (Cause.REFUSED, "answered navigation_goal_success = 0"))
        self.assertEqual((aborted.cause, aborted.message), (Cause.REFUSED, "aborted (no pose)"))

    def test_feedback_is_reported_and_a_cancel_that_is_ignored_holds_nothing_up(self):
        robot = self.robot(**{"action " + DRIVE: "deaf"})
        call, reported = self.gateway.start(GoToGoal(GOAL)), []
        call.on_feedback = reported.append
        self.until(lambda: reported)
        self.assertEqual(reported, ["2.1 m left"])
        call.drop()
        asked = time.monotonic()
        self.assertEqual(self.ask(SayGoal("a")), Answer())
        self.assertLess(time.monotonic() - asked, 10.0)
        robot.set_mode("action " + DRIVE, "done")
        robot.lines.wait_for(lambda line: "cancelled" in line, 10)

    def test_the_service_stands_in_for_an_action_that_comes_and_goes(self):
        first = self.robot(**{name: "absent" for name in ACTIONS})
        self.assertEqual([self.ask(SayGoal("a")), self.ask(SayGoal("b"))], [Answer()] * 2)
        self.assertEqual(self.reached(first), [SAY, SAY])
        self.assertEqual(self.told, [
            "no node offers the action {0}: the service {0} is used in its place".format(SAY)])
        first.stop()
        second = self.robot()
        self.assertEqual(self.ask(SayGoal("c")), Answer())
        self.assertEqual(self.reached(second), ["action " + SAY])
        self.assertEqual(len(self.told), 1)

    def test_the_action_stands_in_for_a_service_and_without_both_the_cause_says_so(self):
        robot = self.robot(**{DRIVE: "absent", SAY: "absent", "action " + SAY: "absent"})
        self.assertEqual(self.ask(GoTo(GOAL)), Answer())
        self.assertEqual(self.reached(robot), ["action " + DRIVE])
        for request in (Say("a"), SayGoal("a")):
            self.assertEqual(self.ask(request).cause, Cause.NOT_ADVERTISED)
        self.assertEqual(self.told, [  # once used, and nothing of what is not there either
            "no node offers the service {0}: the action {0} is used in its place".format(DRIVE)])

    def test_a_name_is_gone_when_neither_its_service_nor_its_action_is_there(self):
        robot = self.robot(**{"action " + DRIVE: "absent"})
        health, events, seen = Health(), Events(), []
        events.subscribe(seen.append)
        monitor = Monitor(INTERFACE, TOPICS, health, lambda: True)
        self.addCleanup(monitor.close)
        monitor.include([each for each in SERVICES if each.name == DRIVE])
        time.sleep(2.5)  # several looks for the action
        health.publish(events)
        self.assertEqual(seen, [])
        robot.stop()

        def is_told():
            health.publish(events)
            return bool(seen)

        self.until(is_told)
        self.assertEqual([(change.name, change.is_well) for change in seen], [(DRIVE, False)])


class TestHearing(unittest.TestCase):
    """The answer of a visitor to GetVisitorResponseAsync."""

    @classmethod
    def setUpClass(cls):
        cls.speech, cls.topics, cls.warnings = INTERFACE.topic(TEXT), TOPICS, WARNINGS

    def setUp(self):
        del self.warnings[:]
        self.addCleanup(forget_dead_entries)
        self.addCleanup(self.topics.listen, self.speech, 0.0)

    def robot(self, **modes):
        robot = Robot(dict(RELEASE, **modes))
        self.addCleanup(robot.stop)
        latch = self.topics.buffers[self.speech]
        self.until(lambda: latch.connected_nodes and
                   (ACTION not in modes or latch.speech_action.is_there))
        return robot

    def until(self, holds):
        ends = time.monotonic() + 20.0
        while not holds():
            self.assertLess(time.monotonic(), ends)
            time.sleep(0.02)

    def heard(self):
        sample = self.topics.newest(self.speech)
        return sample.value if sample is not None else None

    def test_the_action_is_asked_although_the_topic_is_published(self):
        robot = self.robot(**{ACTION: "done"})
        self.topics.listen(self.speech, 10.0, True)
        line = robot.lines.wait_for(lambda line: '"goal"' in line, 10)[1]
        self.assertTrue(9.0 < float(re.search(r'"goal": ([\d.]+)', line).group(1)) <= 10.0)
        robot.say("Yes by action")
        self.until(lambda: self.heard() == "Yes by action")

    def test_without_the_action_the_topic_is_heard_and_that_is_told_once(self):
        robot = self.robot()
        self.topics.listen(self.speech, 10.0, True)
        robot.publish(TEXT, "yes by topic", hertz=10)
        self.until(lambda: self.heard() == "yes by topic" and self.warnings)
        time.sleep(0.3)
        self.assertEqual(self.warnings, [
            "the action {} is not there: the topic is used in its place".format(ACTION)])

    def test_an_action_that_never_handles_its_goals_ends_the_listening_and_the_topic_is_heard(self):
        server = EndingServer([])  # as the release's own driver
        self.addCleanup(server.stop)
        robot = self.robot()
        latch = self.topics.buffers[self.speech]
        self.until(lambda: latch.speech_action.is_there)
        began = time.monotonic()
        self.topics.listen(self.speech, 3.0, True)
        self.until(lambda: server.goals)
        robot.publish(TEXT, "yes by topic")
        self.until(lambda: self.heard() == "yes by topic")
        self.until(lambda: time.monotonic() > began + 3.0)
        self.until(lambda: not self.topics.is_hearing(self.speech))
        self.assertLess(time.monotonic() - began, 3.0 + self.speech.action.deadline + 1.0)
        self.assertEqual(self.warnings, [
            "the action {} failed: the goal was not acknowledged in 2 s".format(ACTION)])


class TestStart(ReleaseCase):
    """The messages of the start about the robot, and a mission on it."""

    def setUp(self):
        super().setUp()
        self.mission("<PerformIconicGesture name='welcome'/>")

    def mission(self, body):
        self.package.write("data/small.xml", MISSION.format(body))

    def run_node(self, modes, **values):
        robot = Robot(modes)
        self.package.configure(**dict(dict(robotInterface="release-1.1",
                                           scenarioSpecification="small", missionRuns=1), **values))
        controller = Controller(self.package)
        try:
            code = controller.wait(40)
            text = re.sub(r"(?m)^\[(\w+)\] \[[\d:.]+\]: ", r"\1 ", controller.lines.text())
            return code, text, robot.requests()
        finally:
            controller.close()
            robot.stop()
            forget_dead_entries()

    def check_other(self, modes, configured, words):
        code, text, requests = self.run_node(modes, robotInterface=configured)
        self.assertEqual((code, requests), (1, []), text)
        self.assertIn(words, text)
        self.assertNotIn("build both from", text)

    def test_a_robot_of_another_release_is_told_as_such(self):
        self.check_other({"interface": "release-1.0"}, "release-1.1",
                         "this is a robot of release 1.0: set robotInterface release-1.0")
        self.check_other(RELEASE, "release-1.0",
                         "this is a robot of release 1.1: set robotInterface release-1.1")
        self.check_other({}, "release-1.1", "this is a robot of D5.4.3: set robotInterface D5.4.3")

    def test_the_gestures_decide_between_the_releases(self):
        others = {each.name: "absent" for each in release_1_0.INTERFACE.offers
                  if each.name != GESTURE}
        gestures = Robot(dict(others, **{"interface": "release-1.0", "__name:": "gestures"}))
        self.addCleanup(gestures.stop)
        lacking = {GESTURE: "absent", "action " + GESTURE: "absent"}
        self.check_other(dict(RELEASE, **lacking), "release-1.1",
                         "this is a robot of release 1.0: set robotInterface release-1.0")

    def test_a_service_that_the_releases_share_does_not_decide_between_them(self):
        others = {each.name: "absent" for each in release_1_0.INTERFACE.offers
                  if each.name != LANGUAGE}
        recognition = Robot(dict(others, **{"interface": "release-1.0", "__name:": "recognition"}))
        self.addCleanup(recognition.stop)
        for configured in ("release-1.0", "D5.4.3"):
            self.check_other(dict(RELEASE, **{ENABLED: "absent"}), configured,
                             "this is a robot of release 1.1: set robotInterface release-1.1")
        code, text, _ = self.run_node(dict(RELEASE, **{  # the robot's other nodes start later
            each.name: "absent" for each in INTERFACE.offers}, **{
                name: "absent" for name in ACTIONS}))
        self.assertEqual(code, 1, text)
        self.assertNotIn("this is a robot of", text)

    def test_a_mission_on_mixed_parts_says_once_what_stands_in(self):
        self.mission("<SayTextAsync name='4'/><SayTextAsync name='1'/><RetrieveListOfExhibits/>"
                     "<SelectExhibit/><SelectExhibit/><Parallel><DescribeExhibitSpeechAsync/>"
                     "<PerformDeicticGestureAsync/></Parallel>")
        code, text, requests = self.run_node(dict(RELEASE, **{"action " + SAY: "absent"}))
        self.assertEqual(code, 0, text)
        self.assertEqual(text.count("used in its place"), 1, text)
        asked = [(each["service"], each["fields"]) for each in requests[:-2]]
        self.assertEqual([fields["message"] for name, fields in asked if name == SAY],
                         ["phrase 4", "phrase 1", "This is the arm It has six joints"])
        (_, pointed), = [each for each in asked if each[0] == "action " + GESTURE]
        # the culture file says nothing of either
        self.assertEqual((pointed["arm"], pointed["deictic_shape"]), ("EITHER", "PALM_UPWARDS"))
        self.assertEqual(text.count("there is no gestureArm"), 1, text)

    def test_on_a_robot_of_release_1_0_the_nodes_use_its_services(self):
        self.mission("<SayTextAsync name='4'/><SayTextAsync name='1'/>")
        code, text, requests = self.run_node({"interface": "release-1.0"},
                                             robotInterface="release-1.0")
        self.assertEqual(code, 0, text)
        self.assertEqual([each["service"] for each in requests[:2]], [SAY, SAY])
        self.assertEqual(text.count("the robot release-1.0 has no action " + SAY), 1, text)


if __name__ == "__main__":
    rospy.init_node("test_release_1_1", disable_signals=True)
    TOPICS.subscribe()
    rostest.rosrun("cssr_system", "release_1_1", "__main__")
