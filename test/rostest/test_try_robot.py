#!/usr/bin/env python3
"""Is one request sent to the robot and its answer told, and none while a mission uses the robot?"""
import os
import signal
import subprocess
import sys
from unittest import mock

import rostest

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from robot import NodeCase, forget_dead_entries, robot_for  # noqa: E402

SAY = "/textToSpeech/say_text"
GESTURE, MODE = "/gestureExecution/perform_gesture", "/overtAttention/set_mode"
START_LIMIT = 20.0


class TestTryRobot(NodeCase):
    """Each case tries a robot."""

    def setUp(self):
        super().setUp()
        self.prepare("<WelcomeSpeech/><Sleep msec=\"200\"/>")
        self.robot = robot_for(self)

    def assert_speaks(self, node):
        """Expect that the mission asks the robot to speak from now on."""
        self.robot.wait_for_request(SAY, START_LIMIT, start=len(self.robot.lines.all))
        self.assertIsNone(node.process.poll(), node.lines.text())

    def tries(self, *words, during=lambda process: ""):
        """Run tryRobot, and return its exit code and its lines; ``during`` returns the first ones.
        """
        with subprocess.Popen([*self.package.command("tryRobot"), *words],
                              env=self.package.environment(), stdout=subprocess.PIPE,
                              stderr=subprocess.STDOUT, universal_newlines=True) as process:
            text = during(process) + process.stdout.read()  # with what its buffer has
        return process.returncode, text

    def test_ctrl_c_ends_a_try_and_a_mission_waits_for_its_end(self):
        def interrupt(process):
            self.robot.wait_for_request(GESTURE, START_LIMIT)
            refused = self.controller()
            self.assertEqual(refused.wait(START_LIMIT), 1, refused.lines.text())
            self.assertIn("node /tryRobot already controls this robot", refused.lines.text())
            process.send_signal(signal.SIGINT)
            lines = [process.stdout.readline()]
            while lines[-1] and "stopped by Ctrl-C" not in lines[-1]:
                lines.append(process.stdout.readline())
            process.send_signal(signal.SIGINT)  # somebody is impatient
            return "".join(lines)

        self.robot.set_mode(GESTURE, "hang")
        found, text = self.tries("gesture", "welcome", during=interrupt)
        self.assertEqual(found, 3, text)
        self.assertIn("stopped by Ctrl-C", text)
        self.assertIn("may still be making iconic gesture 1: keep the stop button at hand", text)
        self.assertNotIn("asked nothing", text)
        self.assertNotIn("Traceback", text)
        self.assert_speaks(self.controller())

    def test_one_request_is_sent_and_its_answer_is_told(self):
        for words, service, code, said in (
                (["say", "Good", "morning"], SAY, 0, "saying “Good morning”"),
                (["gesture", "goodbye"], GESTURE, 0, "making iconic gesture 3"),
                (["attention", "scanning"], MODE, 0, "tryRobot attention disabled")):
            before = len(self.robot.requests())
            found, text = self.tries(*words)
            self.assertEqual(found, code, text)
            self.assertIn("tryRobot: asks the service {}: ".format(service), text)
            self.assertIn(said, text)
            self.assertIn("{}: done, after ".format(service), text)
            asked = self.robot.requests()[before:]
            self.assertEqual([each["service"] for each in asked], [service])
        self.assertEqual(self.robot.requests(SAY)[-1]["fields"]["message"], "Good morning")

    def test_what_a_robot_does_not_do_is_told_with_its_reason(self):
        for mode, code, said in (
                ("refuse", 3, "refused: answered gesture_success = 0"),
                ("raise", 3, "exception in the server: "),
                ("hang", 3, "no answer in time: waited 2 s"),
                ("exit", 3, "connection lost: ")):
            self.robot.set_mode(GESTURE, mode)
            found, text = self.tries("gesture", "welcome", "_gestureExecutionDeadline:=2")
            self.assertEqual(found, code, text)
            self.assertIn("{}: {}".format(GESTURE, said), text)
            self.assertEqual("keep the stop button at hand" in text, mode != "refuse")
        found, text = self.tries("gesture", "welcome")  # the robot's process has died
        self.assertEqual((found, "not there: the master lists it, but" in text), (1, True), text)
        forget_dead_entries()
        found, text = self.tries("say", "Hello")
        self.assertEqual((found, "not there: no node offers this service" in text), (1, True), text)
        robot_for(self, {SAY: "wrong"})
        found, text = self.tries("say", "Hello")
        self.assertEqual((found, "of another type: " in text), (1, True), text)

    def test_a_robot_of_another_release_is_asked_in_its_types(self):
        self.robot = robot_for(self, {"interface": "release-1.1"})
        for words, service in ((["attention", "location", "2", "-1", "1"], MODE),
                               (["say", "Hello"], SAY)):
            found, text = self.tries(*words, "_robotInterface:=release-1.1")
            self.assertEqual(found, 0, text)
            self.assertEqual(self.robot.requests()[-1]["service"], service)
        self.assertEqual(self.robot.requests(SAY)[-1]["fields"]["language"], "English")

    def test_the_action_of_a_robot_that_lacks_the_service_is_asked(self):
        self.robot = robot_for(self, {"interface": "release-1.1", SAY: "absent"})
        found, text = self.tries("say", "Hello", "_robotInterface:=release-1.1")
        self.assertEqual(found, 0, text)
        self.assertIn("the action {} is used in its place".format(SAY), text)
        self.assertEqual([request["service"] for request in self.robot.requests()],
                         ["action " + SAY])

    def test_without_a_master_one_line_says_so(self):
        found, text = self.tries("gesture", "wave", "__master:=http://localhost:9")
        self.assertEqual((found, "Traceback" in text), (2, False), text)
        with mock.patch.dict(os.environ, ROS_MASTER_URI="http://localhost:9"):
            found, text = self.tries("say", "Hello")
        self.assertEqual((found, text.count("\n")), (1, 1), text)
        self.assertIn("no ROS master at http://localhost:9", text)

    def test_names_are_those_of_the_robot_and_of_remappings(self):
        for words, name in ((["_robot:=lab"], "/lab" + SAY),
                            (["robot:=lab", SAY + ":=/voice/say"], "/voice/say")):
            found, text = self.tries("say", "Hello", *words)
            self.assertEqual(found, 1, text)
            self.assertIn("tryRobot: asks the service {}: ".format(name), text)
            self.assertIn("{}: not there".format(name), text)
        found, text = self.tries("say", "Hello", "_missionRuns:=many")
        self.assertEqual((found, "missionRuns" in text), (2, True), text)

    def test_while_a_mission_uses_the_robot_nothing_is_tried(self):
        running = self.controller()
        self.assert_speaks(running)
        found, text = self.tries("gesture", "welcome")
        self.assertEqual(found, 1, text)
        self.assertIn("node /behaviorController already controls this robot", text)
        self.assertNotIn("asks the service", text)
        self.assertEqual(self.robot.requests(GESTURE), [])
        self.assert_speaks(running)


if __name__ == "__main__":
    rostest.rosrun("cssr_system", "try_robot", TestTryRobot)
