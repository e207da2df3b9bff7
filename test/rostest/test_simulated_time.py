#!/usr/bin/env python3
"""Does the mission go by /clock, at any rate, while it stands still and when it jumps back?"""
import json
import os
import re
import signal
import subprocess
import sys
import time

import rosgraph
import rospy
import rostest

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from free_ports import free_port  # noqa: E402
from robot import BUSY, NodeCase, Robot  # noqa: E402
from simulator import Simulator  # noqa: E402

SAY = "/textToSpeech/say_text"
MISSION = """<root BTCPP_format="4" main_tree_to_execute="M">
  <BehaviorTree ID="M"><Sequence><WelcomeSpeech/>{}</Sequence></BehaviorTree>
</root>
"""


class TestSimulatedTime(NodeCase):
    """Each case has its own simulator, robot and node."""

    @classmethod
    def setUpClass(cls):
        # of this process, as it publishes that time
        rospy.init_node("simulator", disable_rostime=True)

    def setUp(self):
        super().setUp()
        self.master = rosgraph.Master("/test")
        self.master.setParam("/use_sim_time", True)

    def simulator(self, rate, topic="/clock"):
        simulator = Simulator(topic, rate)
        self.addCleanup(simulator.stop)
        return simulator

    def node(self, mission, *arguments, robot_modes=None, **keys):
        """Start a robot, and the node with a mission of these leaves after a first speech."""
        self.package.write("data/m.xml", MISSION.format(mission))
        self.package.configure(scenarioSpecification="m", **keys)
        self.robot = Robot(robot_modes)
        self.addCleanup(self.robot.stop)
        return self.controller(*arguments)

    def wait_for(self, controller, words, seconds=20.0, start=0):
        """Return the time of the first line with these words, and its text."""
        return controller.lines.wait_for(lambda line: words in line, seconds, start)

    def taken(self, controller, code=0):
        """Return the seconds of the process from the first speech to the end of the first pass."""
        begins = self.robot.wait_for_request(SAY, 20)["time"]
        ends, _ = self.wait_for(controller, "pass 1: ", 30.0)
        self.assertEqual(controller.wait(20), code, controller.lines.text())
        return ends - begins

    def assert_takes(self, controller, seconds, code=0):
        """Expect that the first pass takes so many seconds of the process, and what a busy machine
        adds."""
        self.assertTrue(-0.2 < self.taken(controller, code) - seconds < 0.5 * BUSY + 1.0)

    def command(self, name, *arguments):
        """Return what one of the package's commands prints, which must not fail."""
        done = subprocess.run(
            [*self.package.command(name), *arguments], env=self.package.environment(), timeout=60,
            stdout=subprocess.PIPE, stderr=subprocess.STDOUT, universal_newlines=True)
        self.assertEqual(done.returncode, 0, done.stdout)
        return done.stdout

    # ------------------------------------------------------------------------------------ the rate

    def test_a_sleep_takes_its_seconds_at_20_times_the_speed(self):
        self.simulator(20.0)
        port = free_port()
        controller = self.node('<Sleep msec="240000"/>', missionRuns="1", monitorPort=port)
        self.wait_for(controller, " page: ")
        self.robot.wait_for_request(SAY, 20)
        shown = self.command("missionStatus", "--port", str(port))
        self.assertIn("asleep, ", shown)
        self.assertIn(" s of at most 240 s", shown)
        self.assertNotIn("hangs", shown)
        self.assert_takes(controller, 12.0)
        self.assertRegex(controller.lines.text(), r"pass 1: SUCCESS after (2[4-9]|30)\d\.\d s")
        self.wait_for(controller, "the mission goes by the simulated time on /clock")

    def test_a_deadline_is_that_of_the_simulated_robot(self):
        self.simulator(20.0)
        controller = self.node("", robot_modes={SAY: "hang"}, missionRuns="1",
                               textToSpeechDeadline="30")
        self.assert_takes(controller, 1.5, code=3)
        self.assertIn("waited 30 s", controller.lines.text())

    # ----------------------------------------------------------------------------------- standstill

    def test_a_time_that_stands_still_holds_the_mission_and_is_told(self):
        simulator = self.simulator(1.0)
        port = free_port()
        controller = self.node('<Sleep msec="2000"/>', missionRuns="1", monitorPort=port)
        self.robot.wait_for_request(SAY, 20)
        simulator.is_paused = True
        told, line = self.wait_for(controller, "stands still since")
        self.assertRegex(line, r"simulated time /clock: stands still since \d\d:\d\d:\d\d; ")
        self.wait_for(controller, "robot: simulated time stands still since")
        # longer than the sleep: the beat of the process goes on
        beats = len(controller.lines.all)
        self.wait_for(controller, "running.", 15.0, beats)
        self.assertNotIn("pass 1: ", controller.lines.text())
        shown = self.command("missionStatus", "--port", str(port))
        self.assertIn("\nrobot: simulated time stands still since", shown)
        self.assertNotIn("hangs", shown)
        simulator.is_paused = False
        self.wait_for(controller, "goes on")
        self.assertEqual(controller.wait(20), 0, controller.lines.text())
        self.assertRegex(controller.lines.text(), r"pass 1: SUCCESS after 2\.\d s")

    def test_a_stop_needs_no_time_that_goes_on(self):
        simulator = self.simulator(1.0)
        controller = self.node('<Sleep msec="60000"/>')
        self.robot.wait_for_request(SAY, 20)
        simulator.is_paused = True
        self.wait_for(controller, "stands still since")
        _, seconds = controller.stop(signal.SIGINT)
        self.assertLess(seconds, 2.0)
        self.assertIn("attention and lifelike movement are off", controller.lines.text())

    def test_the_time_of_a_simulator_that_was_started_anew_is_followed(self):
        simulator = self.simulator(1.0)
        controller = self.node('<Sleep msec="1000"/>', missionRuns="2")
        self.robot.wait_for_request(SAY, 20)
        simulator.stop()
        self.wait_for(controller, "stands still since")
        self.simulator(1.0)
        self.wait_for(controller, "goes on")
        self.wait_for(controller, "pass 2: SUCCESS")

    # ---------------------------------------------------------------------------------- a jump back

    def test_a_jump_back_ends_the_visit_and_the_next_one_begins(self):
        for seconds, said in ((12.0, "12"), (5000.0, "5000"), (0.5, "0.5")):
            simulator = self.simulator(1.0)
            simulator.jump(9000.0)
            controller = self.node('<Sleep msec="60000"/>', missionRuns="2")
            self.robot.wait_for_request(SAY, 20)
            before = simulator.time
            simulator.jump(-seconds)
            self.wait_for(controller, "this visit is over")
            text = controller.lines.text()
            found = re.search(r"simulated time jumped back by ([\d.]+) s: this visit is over", text)
            # less the step of the clock, which a busy machine makes longer
            self.assertTrue(0.0 < float(found.group(1)) <= seconds, text)
            self.assertLess(seconds - float(found.group(1)), 0.4, text)
            self.wait_for(controller, "pass 1: FAILURE after")
            self.robot.wait_for_request(SAY, 20, start=len(self.robot.lines.all))
            simulator.rate = 20.0
            self.wait_for(controller, "pass 2: SUCCESS after ")
            self.assertRegex(controller.lines.text(), r"pass 2: SUCCESS after ([6-9]|1[01])\d\.")
            self.assertEqual(controller.wait(20), 0)
            self.assertIn("attention and lifelike movement are off", controller.lines.text())
            self.robot.stop()
            simulator.stop()

    # -------------------------------------------------------------------------------------- no time

    def test_no_time_at_all_is_told_at_once(self):
        for arguments, topic in (((), "/clock"), (("/clock:=/sim/clock",), "/sim/clock")):
            controller = self.node("", *arguments)
            self.assertEqual(controller.wait(20), 1)
            errors = [line for _, line in controller.lines.all if "ERROR" in line]
            self.assertEqual(len(errors), 1, controller.lines.text())
            self.assertRegex(errors[0], r"/use_sim_time is true.* {}: no node publishes it".format(
                topic))
            self.assertEqual(self.robot.requests(), [])
            self.robot.stop()

    def test_a_publisher_that_sends_no_time_is_told(self):
        self.simulator(1.0).is_paused = True
        controller = self.node("")
        self.assertEqual(controller.wait(20), 1)
        self.assertIn("its publisher sends none", controller.lines.text())

    def test_a_simulator_may_start_later(self):
        controller = self.node("", startupTimeout="60", missionRuns="1")
        self.wait_for(controller, "waiting up to 60 s for the time on /clock")
        self.simulator(1.0)
        self.assertEqual(controller.wait(30), 0, controller.lines.text())

    # --------------------------------------------------------------------------------------- record

    def test_a_record_has_the_times_of_events_ros_and_computer(self):
        self.simulator(20.0)
        place = os.path.join(self.folder, "records")
        began = time.time()
        controller = self.node('<Sleep msec="60000"/>', missionRuns="1", recordDirectory=place)
        self.assertEqual(controller.wait(40), 0, controller.lines.text())
        ended = time.time()
        run, = os.listdir(place)
        with open(os.path.join(place, run, "mission.jsonl")) as file:
            lines = list(map(json.loads, file))[1:]
        first, last = (next(line for line in lines if line["event"]["_type"] == kind)
                       for kind in ("PassStarted", "PassFinished"))
        for name in ("time", "ros"):
            self.assertTrue(60.0 <= last[name] - first[name] < 120.0)
        self.assertLess(1000.0, first["ros"])
        for line in (first, last):
            self.assertTrue(began < line["computer"] < ended)
        self.assertTrue(2.9 < last["computer"] - first["computer"] < 6.0)
        self.assertIn("the same path: 1 pass,", self.command("replayMission", place))


if __name__ == "__main__":
    rostest.rosrun("cssr_system", "test_simulated_time", TestSimulatedTime)
