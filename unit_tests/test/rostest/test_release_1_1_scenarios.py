#!/usr/bin/env python3
"""Is each fault of release 1.1 that needs a robot survived, and what does a visitor see of it?

The numbers are those of docs/reference.md.
"""
import os
import signal
import subprocess
import sys
import time
import unittest

import rosgraph
import rospy
import rostest

from behavior_controller import exit_codes
from behavior_controller.run.events import LeafFinished
from unit_tests.judge.facts import of
from whole_test import free_port, run_tests

GIVEN = ("robotInterface:=release-1.1", "failureRate:=0")
VISITOR, D6_1 = "mission:=release_1_1_visitor_tour", "mission:=d6_1_tour"
TABLET = "/tabletEvent/prompt_and_get_response"
RUNS = {  # name -> arguments in addition to GIVEN, the end of the pass, and how many stops it shows
    "5, goals that nobody handles": ((VISITOR, "recogniseBy:=idleAction"), "SUCCESS", 0),
    "7, the published parts": (
        (VISITOR, "recogniseBy:=action", "absentActions:=/textToSpeech/say_text",
         f"absentServices:=/speechEvent/set_enabled,{TABLET}"), "SUCCESS", 7),
    "7, speech by the action alone": (
        (D6_1, "absentServices:=/textToSpeech/say_text"), "SUCCESS", 7),
    "11, servers that die or never answer": (
        (VISITOR, "textToSpeechDeadline:=2", "plannedFaults:=robotNavigation:2:crash,"
         "textToSpeech:5:unanswered"), "SUCCESS", 7)}


class TestRelease11Scenarios(unittest.TestCase):
    """Each case looks at one whole test."""

    @classmethod
    def setUpClass(cls):
        tests = run_tests([(*GIVEN, *given) for given, _, _ in RUNS.values()])
        cls.results = {name: result for name, (_, result) in zip(RUNS, tests)}

    def ended(self, name, node):
        """Return how a mission node ended, each time."""
        return [event for _, event in of(self.results[name].run.lines, LeafFinished)
                if event.node == node]

    def test_each_passes_and_shows_its_stops(self):
        for name, (_, outcome, stops) in RUNS.items():
            result = self.results[name]
            self.assertEqual(result.code, 0,
                             "{}\n{}".format(name, "\n".join(result.report) or result.printed))
            visit, = result.run.visits
            self.assertEqual((visit.outcome, len(visit.stops)), (outcome, stops), name)

    def test_a_visitor_whose_answer_nobody_hears_is_asked_twice_for_ten_seconds(self):
        listened = self.ended("5, goals that nobody handles", "GetVisitorResponseAsync")
        self.assertEqual([event.status for event in listened], ["SUCCESS", "SUCCESS"])
        for event in listened:
            self.assertTrue(9.99 < event.seconds < 12.0, event)

    def test_a_substitute_is_told_once(self):
        printed = self.results["7, the published parts"].printed
        told = [line for line in printed.splitlines() if "/textToSpeech/say_text" in line
                and "is used in its place" in line]
        self.assertEqual(len(told), 1, told)

    def test_on_a_robot_of_release_1_0_the_start_names_it(self):
        """Fault 8: the release's own controller waits for actions for ever."""
        environment = dict(os.environ, ROS_MASTER_URI=f"http://localhost:{free_port()}")
        robot = subprocess.Popen(
            ["roslaunch", "unit_tests", "simulatedRobot.launch", "robotInterface:=release-1.0"],
            env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        master = rosgraph.Master("/test", environment["ROS_MASTER_URI"])
        ends = time.monotonic() + 30.0
        try:
            while not master.is_online():
                self.assertLess(time.monotonic(), ends)
                time.sleep(0.1)
            ended = subprocess.run(
                ["rosrun", "cssr_system", "behaviorController", "_robotInterface:=release-1.1",
                 "_scenarioSpecification:=release_1_1_tour", "_startupTimeout:=40",
                 "_recordDirectory:=none", "_monitorPort:=0", "_groot2Port:=0"],
                env=environment, timeout=90, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                universal_newlines=True)
        finally:
            robot.send_signal(signal.SIGINT)
            robot.wait(30)
        self.assertEqual(ended.returncode, exit_codes.UNAVAILABLE, ended.stdout)
        self.assertIn("this is a robot of release 1.0: set robotInterface release-1.0",
                      ended.stdout)


if __name__ == "__main__":
    rospy.init_node("test_release_1_1_scenarios")
    rostest.rosrun("unit_tests", "release_1_1_scenarios", TestRelease11Scenarios, sys.argv)
