#!/usr/bin/env python3
"""Does the node run a mission against the robot's services and topics, and inform the operator?"""
import json
import os
import re
import shutil
import statistics
import sys
import tempfile
import unittest

import rostest

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from robot import Controller, Package, Robot, forget_dead_entries  # noqa: E402

ATTENTION, ANIMATION = "/overtAttention/set_mode", "/animateBehaviour/set_activation"
SAY, FACES = "/textToSpeech/say_text", "/faceDetection/data"
MISSION = """<root BTCPP_format="4" main_tree_to_execute="M">
  <BehaviorTree ID="M"><Sequence><START_OF_TREE/>{}</Sequence></BehaviorTree>
</root>
"""
GREET_AND_PART = """<Repeat num_cycles="-1"><Sequence>
  <ReactiveFallback><IsVisitorDiscovered/><Sleep msec="600000"/></ReactiveFallback>
  <WelcomeSpeech/>
  <ReactiveFallback><Inverter><IsVisitorDiscovered/></Inverter><Sleep msec="600000"/></ReactiveFallback>
  <SayGoodByeSpeech/>
</Sequence></Repeat>"""
A_FACE, NO_FACE = (["1"], [[0.0, 0.0, 1.0]], [True]), ([], [], [])


class TestMission(unittest.TestCase):
    """Each case runs its own mission."""

    def setUp(self):
        self.folder = tempfile.mkdtemp()
        self.addCleanup(shutil.rmtree, self.folder)
        self.addCleanup(forget_dead_entries)
        self.package = Package(os.path.join(self.folder, "package"))

    def start(self, mission, robot_modes=None, **keys):
        """Run ``mission`` (leaves) against a stub robot; return both."""
        self.package.write("data/m.xml", MISSION.format(mission))
        self.package.configure(scenarioSpecification="m", **keys)
        robot = Robot(robot_modes)
        self.addCleanup(robot.stop)
        controller = Controller(self.package)
        self.addCleanup(controller.close)
        return robot, controller

    def lines(self, controller):
        """Return what the node wrote, without time stamps."""
        return [re.sub(r"^\[(\w+)\] \[[\d.]+\]: behaviorController: ", r"\1 ", line)
                for _, line in controller.lines.all]

    # -------------------------------------------------------------------------------------------------- outcomes

    def test_the_exit_code_is_the_outcome_of_the_last_pass(self):
        for mission, outcome, code in (("<WelcomeSpeech/>", "SUCCESS", 0), ("<IsVisitorResponseYes/>", "FAILURE", 3)):
            robot, controller = self.start(mission, missionRuns="2")
            self.assertEqual(controller.wait(20), code)
            text = "\n".join(self.lines(controller))
            for number in (1, 2):
                self.assertRegex(text, r"(?m)^\w+ pass {}: {} after \d+\.\d s: ".format(number, outcome))
            self.assertRegex(text, r"(?m)^INFO ends: .*exit code {}".format(code))
            robot.stop()

    def test_what_is_said_and_asked_reaches_the_robot(self):
        robot, controller = self.start("<RetrieveListOfExhibits/><SelectExhibit/><Navigate/><PerformDeicticGesture/>"
                                       "<DescribeExhibitSpeech/>", missionRuns="1")
        self.assertEqual(controller.wait(20), 0, controller.lines.text())
        self.assertEqual([(request["service"], request["fields"]) for request in robot.requests()], [
            ("/knowledgeBase/query", {"parameters": "exhibits"}),
            ("/robotNavigation/set_goal", {"goal_x": 1.0, "goal_y": 2.0, "goal_theta": 90.0}),
            ("/gestureExecution/perform_gesture",
             {"gesture_type": "deictic", "gesture_id": 1, "gesture_duration": 3000, "bow_nod_angle": 0,
              "location_x": 1.0, "location_y": 2.0, "location_z": 3.0}),
            (SAY, {"message": "pepper one pepper two"})])

    # ---------------------------------------------------------------------------------------------------- lines

    def test_normal_mode_tells_the_story(self):
        robot, controller = self.start("<WelcomeSpeech/><Fallback><WelcomeGesture/><HandleFallBack/></Fallback>",
                                       {"/gestureExecution/perform_gesture": "refuse"}, missionRuns="1")
        self.assertEqual(controller.wait(60), 0, controller.lines.text())
        lines = self.lines(controller)
        self.assertEqual([line.split()[0] for line in lines], 4 * ["INFO"] + ["WARN", "INFO", "WARN", "INFO", "INFO"])
        self.assertEqual(lines[2], "INFO a pass begins")  # START_OF_TREE
        self.assertRegex(lines[3], r"^INFO said “.+”$")
        self.assertEqual(lines[5], "INFO retrying WelcomeGesture, 1 of 1")
        for line in (lines[4], lines[6]):
            for word in ("refused", "gesture_success = 0", "/gestureExecution/perform_gesture"):
                self.assertIn(word, line)
        self.assertIn("went on without WelcomeGesture, which failed 2 times", lines[6])
        self.assertNotIn("WelcomeSpeech", "\n".join(lines))

    def test_verbose_mode_has_a_line_for_each_leaf_that_finishes(self):
        mission = "<WelcomeSpeech/><ForceSuccess><WelcomeGesture/></ForceSuccess><IsVisitorResponseYes/>"
        modes = {"/gestureExecution/perform_gesture": "raise"}
        robot, controller = self.start(mission, modes, missionRuns="1", verboseMode="true")
        self.assertEqual(controller.wait(20), 3)
        text = "\n".join(self.lines(controller))
        self.assertRegex(text, r"(?m)^INFO START_OF_TREE .*: SUCCESS, 0\.\d+ s$")
        self.assertRegex(text, r"(?m)^INFO WelcomeSpeech .*: SUCCESS, /textToSpeech/say_text, \d+\.\d+ s, said “.+”$")
        self.assertRegex(text, r"(?m)^INFO WelcomeGesture .*: FAILURE, /gestureExecution/perform_gesture, \d+\.\d+ s, "
                               r"exception in the server: .*the stub was told to raise$")
        self.assertRegex(text, r"(?m)^INFO IsVisitorResponseYes .*: FAILURE, \d+\.\d+ s, condition false: ")

    def test_lines_come_at_once_and_a_heartbeat_every_ten_seconds(self):
        robot, controller = self.start("<WelcomeSpeech/><Sleep msec=\"600000\"/>", verboseMode="true")
        asked = robot.wait_for_request(SAY, 20)["time"]
        told = controller.lines.wait_for(lambda line: "WelcomeSpeech" in line, 10)[0]
        self.assertLess(told - asked, 0.5)
        began = controller.lines.wait_for(lambda line: "starts" in line, 1)[0]
        beat, line = controller.lines.wait_for(lambda line: "running" in line, 15)
        self.assertTrue(line.endswith(": behaviorController: running."), line)
        self.assertLess(abs(beat - began - 10.0), 0.5)

    # ------------------------------------------------------------------------------------------------- reaction

    def test_a_message_brings_the_next_request_at_once(self):
        robot, controller = self.start(GREET_AND_PART)
        controller.lines.wait_for(lambda line: "starts" in line, 20)
        self.wait_until_connected(robot)
        for hertz in (0, 2000):
            if hertz:
                robot.publish("/overtAttention/mode", "scanning", 0, hertz=hertz)
            delays = self.reactions(robot, 40)
            print("message to request with attention at {} Hz: median {:.2f} ms, slowest of 40 {:.2f} ms".format(
                hertz, 1000 * statistics.median(delays), 1000 * max(delays)))
            self.assertLess(statistics.median(delays), 0.02)
            self.assertLess(max(delays), 0.5)  # a message that was lost would wait until the one before expires, 2 s

    def wait_until_connected(self, robot):
        """Show a face until the node reacts, and then none: rospy connects to publishers in its own time."""
        robot.publish(FACES, *A_FACE, hertz=20)
        robot.wait_for_request(SAY, 10)
        start = len(robot.lines.all)
        robot.publish(FACES, *NO_FACE, hertz=0.1)
        robot.wait_for_request(SAY, 20, start)

    def reactions(self, robot, count):
        """Let a visitor come and go; return the seconds from each message to the request that follows from it."""
        delays = []
        for number in range(count):
            start = len(robot.lines.all)
            robot.publish(FACES, *(NO_FACE if number % 2 else A_FACE))
            sent = json.loads(robot.lines.wait_for(lambda line: '"topic"' in line, 5, start)[1])["time"]
            delays.append(robot.wait_for_request(SAY, 5, start)["time"] - sent)
            # the next message must find the tree waiting for it
            robot.lines.wait_for(lambda line: '"answered"' in line, 5, start)
        return delays

    # ------------------------------------------------------------------------------------------------ our mistakes

    def test_a_mistake_of_ours_is_one_line_and_leaves_the_robot_safe(self):
        with open(self.package.path("src/behavior_controller/runner.py")) as file:
            self.package.write("src/behavior_controller/runner.py", file.read() + SPOILT)
        robot, controller = self.start("<WelcomeSpeech/>", {SAY: "hang"})
        self.assertEqual(controller.wait(20), 4)
        lines = self.lines(controller)
        self.assertRegex(lines[-1], r"^ERROR internal error \(KeyError: 'spoilt'\); .* details in (\S+)$")
        self.assertNotIn("Traceback", controller.lines.text())
        with open(lines[-1].split()[-1]) as file:
            self.assertIn("KeyError: 'spoilt'", file.read())
        self.assertEqual(sorted((request["service"], request["fields"]["state"]) for request in robot.requests()),
                         [(ANIMATION, "disabled"), (ATTENTION, "disabled")])


SPOILT = """

def _spoilt(self):
    raise KeyError("spoilt")


Runner.run = _spoilt
"""

if __name__ == "__main__":
    rostest.rosrun("cssr_system", "mission", TestMission)
