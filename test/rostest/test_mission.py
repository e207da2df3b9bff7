#!/usr/bin/env python3
"""Does the node run a mission against the robot's services and topics, and inform the operator?"""
import json
import os
import re
import signal
import statistics
import sys
import time

import rosgraph
import rostest

from behavior_controller.run.events import SafeStateReported
from behavior_controller.run.record import files
from behavior_controller.run.record.reader import read_record

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from robot import (  # noqa: E402
    BUSY, MISSION, NodeCase, Robot, mission_starts, on_one_python, places)

ATTENTION, ANIMATION = "/overtAttention/set_mode", "/animateBehaviour/set_activation"
SAY, FACES, DRIVE = "/textToSpeech/say_text", "/faceDetection/data", "/robotNavigation/set_goal"
SPEECH = "/speechEvent/text"
GREET_AND_PART = """<Repeat num_cycles="-1"><Sequence>
  <ReactiveFallback><IsVisitorDiscovered/><Sleep msec="600000"/></ReactiveFallback>
  <WelcomeSpeech/>
  <ReactiveFallback><Inverter><IsVisitorDiscovered/></Inverter><Sleep msec="600000"/></ReactiveFallback>
  <SayGoodByeSpeech/>
</Sequence></Repeat>"""
NO_FACE = [], [], []
BROKEN_SCRIPT = "x := 'a' * 2"
ENDS = (("", 0), ("<Script code=\"{}\"/>".format(BROKEN_SCRIPT), 3),
        ("<Timeout msec=\"100\"><Sleep msec=\"60000\" _onHalted=\"{}\"/></Timeout>".format(
            BROKEN_SCRIPT), 3, 2))
"""Leaves after which a mission ends by itself; exit code, and passes of it."""
ANSWERED = """<ReactiveFallback><IsYesNoUttered/><Sleep msec="600000"/></ReactiveFallback>
<IsVisitorResponseYes/><WelcomeSpeech/>"""


class TestMission(NodeCase):
    """Each case runs its own mission."""

    def lines(self, controller):
        """Return what the node wrote, without time stamps."""
        return [re.sub(r"^\[(\w+)\] \[[\d:.]+\]: behaviorController: ", r"\1 ", line)
                for _, line in controller.lines.all]

    def assert_left_safe(self, robot):
        """Expect that the last two requests switched attention and animation off, and no others
        did."""
        self.assertEqual(sorted(self.switched_off(robot)), [ANIMATION, ATTENTION])

    def switched_off(self, robot):
        """Return the services of the requests that switch something, which are the last ones."""
        states = [request["fields"].get("state") for request in robot.requests()]
        first = states.index("disabled")
        self.assertEqual(set(filter(None, states[:first])), set())
        self.assertEqual(set(states[first:]), {"disabled"})
        return [request["service"] for request in robot.requests()[first:]]

    # ------------------------------------------------------------------------------------- outcomes

    @on_one_python
    def test_the_exit_code_is_the_outcome_of_the_last_pass(self):
        for mission, outcome, code in (("<WelcomeSpeech/>", "SUCCESS", 0),
                                       ("<IsVisitorResponseYes/>", "FAILURE", 3)):
            robot, controller = self.start(mission, missionRuns="2")
            self.assertEqual(controller.wait(20), code)
            text = "\n".join(self.lines(controller))
            for number in (1, 2):
                self.assertRegex(text,
                                 r"(?m)^\w+ pass {}: {} after \d+\.\d s: ".format(number, outcome))
            self.assertRegex(text, r"(?m)^INFO ends: .*exit code {}".format(code))

    def test_what_is_said_and_asked_reaches_the_robot(self):
        robot, controller = self.start(
            "<RetrieveListOfExhibits/><SelectExhibit/><Navigate/><PerformDeicticGesture/>"
            "<DescribeExhibitSpeech/>", missionRuns="1")
        self.assertEqual(controller.wait(20), 0, controller.lines.text())
        self.assert_left_safe(robot)
        exhibit = places()["exhibits"][0]
        self.assertEqual(
            [(request["service"], request["fields"]) for request in robot.requests()[:-2]],
            [("/knowledgeBase/query", {"parameters": "exhibits"}),
             ("/robotNavigation/set_goal",
              dict(zip(("goal_x", "goal_y", "goal_theta"), exhibit["location"]))),
             ("/gestureExecution/perform_gesture", {
                 "gesture_type": "deictic", "gesture_id": 1, "gesture_duration": 3000,
                 "bow_nod_angle": 0, **dict(
                     zip(("location_x", "location_y", "location_z"), exhibit["gesture"]))
             }), (SAY, {"message": "{description1} {description2}".format(**exhibit)})])

    # ---------------------------------------------------------------------------------------- lines

    def test_normal_mode_tells_the_story(self):
        robot, controller = self.start(
            "<WelcomeSpeech/><Fallback><WelcomeGesture/><HandleFallBack/></Fallback>",
            {"/gestureExecution/perform_gesture": "refuse"}, missionRuns="1")
        self.assertEqual(controller.wait(60), 0, controller.lines.text())
        lines = self.lines(controller)
        self.assertEqual([line.split()[0] for line in lines],
                         4 * ["INFO"] + ["WARN", "INFO", "WARN", "WARN"] + 3 * ["INFO"])
        self.assertRegex(lines[7], "complete without WelcomeGesture$")
        self.assertEqual(lines[2], "INFO a pass begins")  # START_OF_TREE
        self.assertRegex(lines[3], r"^INFO said “.+”$")
        self.assertRegex(lines[5], r"WelcomeGesture.*\b2\b.*\b2\b")
        for line in (lines[4], lines[6]):
            for word in ("refused", "/gestureExecution/perform_gesture"):
                self.assertIn(word, line)
        # the detail stands in the sentence about the failure alone
        self.assertIn("gesture_success = 0", lines[4])
        self.assertRegex(lines[6], r"WelcomeGesture.*\b2\b")
        self.assertNotIn("WelcomeSpeech", "\n".join(lines))

    def test_verbose_mode_has_a_line_for_each_leaf_that_finishes(self):
        mission = ("<WelcomeSpeech/><ForceSuccess><WelcomeGesture/></ForceSuccess>"
                   "<IsVisitorResponseYes/>")
        modes = {"/gestureExecution/perform_gesture": "raise"}
        robot, controller = self.start(mission, modes, missionRuns="1", verboseMode="true")
        self.assertEqual(controller.wait(20), 3)
        text = "\n".join(self.lines(controller))
        self.assertRegex(text, r"(?m)^INFO START_OF_TREE .*: SUCCESS, 0\.\d+ s$")
        self.assertRegex(
            text,
            r"(?m)^INFO WelcomeSpeech .*: SUCCESS, /textToSpeech/say_text, \d+\.\d+ s, said “.+”$")
        self.assertRegex(
            text,
            r"(?m)^INFO WelcomeGesture .*: FAILURE, /gestureExecution/perform_gesture, \d+\.\d+ s, "
            r"exception in the server: .*commanded to raise$")
        self.assertRegex(
            text, r"(?m)^INFO IsVisitorResponseYes .*: FAILURE, \d+\.\d+ s, condition false: ")

    @on_one_python
    def test_lines_come_at_once_and_a_heartbeat_every_ten_seconds(self):
        robot, controller = self.start("<WelcomeSpeech/><Sleep msec=\"600000\"/>",
                                       verboseMode="true")
        asked = robot.wait_for_request(SAY, 20)["time"]
        told = controller.lines.wait_for(lambda line: "WelcomeSpeech" in line, 10)[0]
        self.assertLess(told - asked, 0.5 * BUSY)
        began = controller.lines.wait_for(lambda line: mission_starts() in line, 1)[0]
        beat, line = controller.lines.wait_for(lambda line: "running" in line, 15)
        self.assertRegex(line, ": behaviorController: running. asleep, (9|10) s of at most 600 s · "
                               "next: the end of the visit$")
        self.assertLess(abs(beat - began - 10.0), 0.5 * BUSY)

    # ------------------------------------------------------------------------------------- reaction

    def test_a_message_brings_the_next_request_at_once(self):
        robot, controller = self.start(GREET_AND_PART)
        controller.lines.wait_for(lambda line: mission_starts() in line, 20)
        self.wait_until_connected(robot)
        for hertz in (0, 2000):
            if hertz:
                robot.publish("/overtAttention/mode", "scanning", 0, hertz=hertz)
            delays = self.reactions(robot, 40)
            print("message to request with attention at {} Hz: median {:.2f} ms, slowest of 40 "
                  "{:.2f} ms".format(hertz, 1000 * statistics.median(delays), 1000 * max(delays)))
            self.assertLess(statistics.median(delays), 0.02)
            # a message that was lost would wait until the one before expires, 2 s
            self.assertLess(max(delays), 1.5)

    def wait_until(self, value, wanted):
        """Wait until ``value()`` is ``wanted``: the master tells nobody who registers."""
        ends = time.monotonic() + 30.0
        while value() != wanted:
            self.assertLess(time.monotonic(), ends, value())
            time.sleep(0.05)

    def test_the_node_subscribes_to_the_topics_that_its_missions_use(self):
        def registered(place):  # 0: publishers, 1: subscribers
            return [name for name, nodes in master.getSystemState()[place]
                    if "/behaviorController" in nodes]

        pause, seen = '<Sleep msec="200"/>', "<Fallback><IsVisitorDiscovered/>{}</Fallback>"
        robot, controller = self.start(pause)
        controller.lines.wait_for(lambda line: mission_starts("m") in line, 20)
        master = rosgraph.Master("/behaviorController")
        self.wait_until(lambda: registered(0), ["/rosout"])
        self.assertEqual(registered(1), [])
        # without a subscription too, what the master has forgotten is registered again
        master.unregisterPublisher("/rosout", master.lookupNode("/behaviorController"))
        self.wait_until(lambda: registered(0), ["/rosout"])
        self.package.write("data/m.xml", MISSION.format(seen.format(pause)))
        controller.process.send_signal(signal.SIGHUP)
        self.wait_until(lambda: registered(1), [FACES])
        self.assertEqual(controller.stop()[0], 0)

    def wait_until_connected(self, robot):
        """Show a face until the node reacts, and then none: rospy connects to publishers in its own
        time."""
        robot.publish(FACES, hertz=20)
        robot.wait_for_request(SAY, 10)
        start = len(robot.lines.all)
        robot.publish(FACES, *NO_FACE, hertz=0.1)
        robot.wait_for_request(SAY, 20, start)

    def reactions(self, robot, count):
        """Let a visitor come and go; return the seconds from each message to the request that
        follows from it."""
        delays = []
        for number in range(count):
            start = len(robot.lines.all)
            robot.publish(FACES, *(NO_FACE if number % 2 else ()))
            sent = json.loads(robot.lines.wait_for(lambda line: '"topic"' in line, 5,
                                                   start)[1])["time"]
            delays.append(robot.wait_for_request(SAY, 5, start)["time"] - sent)
            # the next message must find the tree waiting for it
            robot.lines.wait_for(lambda line: '"answered"' in line, 5, start)
        return delays

    # --------------------------------------------------------------------------------- our mistakes

    def test_a_mistake_of_ours_is_one_line_and_leaves_the_robot_safe(self):
        self.check_own_mistake("KeyError('spoilt')")

    def check_own_mistake(self, raised):
        """Our runner raises that."""
        runner = "src/behavior_controller/missions/runner.py"
        with open(self.package.path(runner)) as file:
            self.package.write(runner, file.read() + SPOILT.format(raised))
        robot, controller = self.start("<WelcomeSpeech/>", {SAY: "hang"})
        self.assertEqual(controller.wait(20), 4)
        lines = self.lines(controller)
        self.assertEqual(lines[-1], "INFO attention and lifelike movement are off")
        self.assertRegex(lines[-2], r"^ERROR internal error \({}.*\); .* details in (\S+)$".format(
            raised.partition("(")[0]))
        self.assertNotIn("Traceback", controller.lines.text())
        with open(lines[-2].split()[-1]) as file:
            self.assertIn("_spoilt", file.read())
        self.assert_left_safe(robot)

    # -------------------------------------------------------------------------------------- the end

    @on_one_python
    def test_a_run_that_ends_by_itself_leaves_the_robot_safe_and_says_so_on_every_surface(self):
        for end in ENDS:
            self.check_own_end(*end)

    def check_own_end(self, leaves, code, runs=1):
        """After its last pass of these leaves the node asks for the safe state, and says so."""
        robot, controller = self.start("<WelcomeSpeech/>" + leaves, missionRuns=runs,
                                       recordDirectory=self.folder)
        self.assertEqual(controller.wait(20), code, controller.lines.text())
        self.assertEqual(len(robot.requests(SAY)), runs)
        self.assert_left_safe(robot)
        lines = self.lines(controller)
        self.assertIn("INFO attention and lifelike movement are off", lines[-4:],
                      controller.lines.text())
        events = [line.event for line in read_record(files.runs(self.folder)[-1])]
        reported = [event for event in events if isinstance(event, SafeStateReported)]
        self.assertEqual([[part.failure for part in event.parts] for event in reported],
                         [[None, None]])

    def test_a_part_of_the_safe_state_that_is_not_reached_is_named_at_the_end(self):
        robot, controller = self.start("<WelcomeSpeech/>", {ATTENTION: "hang", ANIMATION: "refuse"},
                                       missionRuns="1")
        self.assertEqual(controller.wait(20), 0, controller.lines.text())
        # what is refused is asked for again while the last second lasts
        services = self.switched_off(robot)
        self.assertEqual(services.count(ATTENTION), 1)
        self.assertGreater(services.count(ANIMATION), 3)
        warnings = [line for line in self.lines(controller) if line.startswith("WARN")]
        warning, robot_line = dict.fromkeys(warnings)  # the robot's line is the last one again
        self.assertIn("by hand", robot_line)
        self.assertLess(warning.index(ATTENTION), warning.index(ANIMATION))
        self.assertIn("refused", warning)

    # --------------------------------------------------------------------------- what visitors say

    def test_an_answer_that_is_followed_at_once_by_another_utterance_counts(self):
        self.check_answer(["hm", "yes", "well"])

    def check_answer(self, utterances):
        """A yes among ``utterances`` that come as fast as they can is the visitor's answer."""
        robot, controller = self.start(ANSWERED, missionRuns="1")
        controller.lines.wait_for(lambda line: "a pass begins" in line, 20)
        robot.wait_for_listener(SPEECH, "hm")
        for text in utterances:
            robot.publish(SPEECH, text)
        self.assertEqual(controller.wait(20), 0, controller.lines.text())
        self.assertEqual(len(robot.requests(SAY)), 1)

    def test_a_publisher_of_which_no_message_can_be_decoded_counts_as_absent(self):
        self.check_garbled(FACES)

    def check_garbled(self, topic):
        """The publisher of ``topic`` sends messages that cannot be decoded, while the robot
        speaks."""
        robot, controller = self.start(
            "<Repeat num_cycles=\"-1\"><Sequence><WelcomeSpeech/><Sleep msec=\"100\"/></Sequence>"
            "</Repeat>", {topic: "garbled"}, startupCheck="all")
        robot.publish(topic, hertz=20)
        for words in ("ignoring", "gone"):
            controller.lines.wait_for(
                lambda line: "[WARN]" in line and words in line and topic in line, 20)
        robot.wait_for_request(SAY, 10, start=len(robot.lines.all))
        controller.stop()
        told = [line for _, line in controller.lines.all if topic in line and "robot: " not in line]
        self.assertEqual(len(told), 2, controller.lines.text())

    # ---------------------------------------------------------------------------- persistent causes

    @on_one_python
    def test_a_budget_that_is_spent_makes_the_next_visitor_wait_longer_each_time(self):
        self.check_spent_budget("refuse", 1.0)

    def check_spent_budget(self, mode, pause):
        """Each pass fails as a service is in ``mode``, and nothing may be recovered: the pauses
        double."""
        with open(self.package.path("config/recoveryPolicy.ini")) as file:
            policy = re.sub(r"(?m)^(budget|pause) .*$", "", file.read())
        self.package.write("config/recoveryPolicy.ini",
                           "{}\nbudget 0 600\npause {} 300\n".format(policy, pause))
        robot, controller = self.start(
            "<WelcomeSpeech/><LookUpHome/><Fallback><Navigate/><HandleFallBack/></Fallback>",
            {DRIVE: mode}, missionRuns="4")
        self.assertEqual(controller.wait(60), 3, controller.lines.text())
        times = [request["time"] for request in robot.requests(SAY)]
        gaps = [later - sooner for sooner, later in zip(times, times[1:])]
        for gap, least in zip(gaps, (pause, 2 * pause, 4 * pause)):
            self.assertGreaterEqual(gap, least)
        self.assertEqual(len(gaps), 3)

    def test_a_node_that_is_gone_does_not_meet_the_next_visitor(self):
        robot, controller = self.start("<WelcomeSpeech/><LookUpHome/><Navigate/>", {DRIVE: "exit"},
                                       missionRuns="2")
        controller.lines.wait_for(lambda line: "waiting for /" in line, 20)
        time.sleep(3.0)  # three times the pace of passes that fail at once
        self.assertEqual(len(robot.requests(SAY)), 1)
        again = Robot()
        self.addCleanup(again.stop)
        self.assertEqual(controller.wait(20), 0, controller.lines.text())
        self.assertEqual(len(again.requests(SAY)), 1)

    @on_one_python
    def test_a_reload_ends_the_wait_for_a_node(self):
        robot, controller = self.start("<WelcomeSpeech/><LookUpHome/><Navigate/>", {DRIVE: "exit"})
        controller.lines.wait_for(lambda line: "waiting for /" in line, 20)
        self.package.write("data/m.xml", MISSION.format("<Sleep msec=\"600000\"/>"))
        controller.process.send_signal(signal.SIGHUP)
        controller.lines.wait_for(lambda line: "mission m starts, 1 mission leaves" in line, 20)

    @on_one_python
    def test_a_stop_ends_the_wait_for_a_node(self):
        robot, controller = self.start("<LookUpHome/><Navigate/>", {DRIVE: "exit"})
        controller.lines.wait_for(lambda line: "waiting for /" in line, 20)
        code, seconds = controller.stop()
        self.assertEqual(code, 3)
        self.assertLess(seconds, 2.0)


SPOILT = """

def _spoilt(self):
    raise {}


Runner.run = _spoilt
"""

if __name__ == "__main__":
    rostest.rosrun("cssr_system", "mission", TestMission)
