#!/usr/bin/env python3
"""Does every kind of visitor get the right visit from a robot of release 1.0, with and without
faults?"""
import sys
import unittest

import rospy
import rostest

from behavior_controller.run.events import LeafFinished
from unit_tests.judge.facts import of
from whole_test import run_tests

RELEASE = ("robotInterface:=release-1.0", "scenarioSpecification:=release_1_0_tour",
           "failureRate:=0", "speechPace:=50")
ACTION = "recogniseBy:=action"
RUNS = {  # name -> arguments in addition to RELEASE, and the end of the pass
    "silent": ((ACTION, "visitorBehaviour:=silent"), "SUCCESS"),
    "leaves": (("visitorBehaviour:=leaves",), "FAILURE"),
    "presses yes": (("asrEnabled:=false", "tabletSuccessIs:=yes"), "SUCCESS"),
    "faults": ((ACTION, "speechEventDeadline:=1", "absentServices:=/speechEvent/set_language",
                "plannedFaults:=robotLocalization:1:exception,speechEvent:1:unanswered,"
                "overtAttention:2:wrong,"
                "gestureExecution:2:refused,robotNavigation:2:crash"), "SUCCESS")}


class TestRelease10Scenarios(unittest.TestCase):
    """Each case looks at one whole test."""

    @classmethod
    def setUpClass(cls):
        tests = run_tests([(*RELEASE, *given) for given, _ in RUNS.values()])
        cls.results = {name: result for name, (_, result) in zip(RUNS, tests)}

    def nodes(self, name):
        """Return the mission nodes that ran."""
        return {event.node for event in self.ended(name)}

    def ended(self, name):
        """Return how mission nodes ended."""
        return [event for _, event in of(self.results[name].run.lines, LeafFinished)]

    def test_each_passes_and_ends_as_the_visitor_brings_about(self):
        for name, (_, outcome) in RUNS.items():
            result = self.results[name]
            self.assertEqual(result.code, 0,
                             "{}\n{}".format(name, "\n".join(result.report) or result.printed))
            self.assertEqual([visit.outcome for visit in result.run.visits], [outcome], name)

    def test_a_tour_is_given_to_those_who_want_one(self):
        toured = {name for name in RUNS if "SelectExhibit" in self.nodes(name)}
        self.assertEqual(toured, {"leaves", "presses yes", "faults"})

    def test_a_visitor_who_is_silent_is_asked_again_after_ten_seconds(self):
        listened = [event for event in self.ended("silent") if event.node == "GetVisitorResponse"]
        self.assertEqual([event.status for event in listened], ["SUCCESS", "SUCCESS"])
        for event in listened:
            self.assertTrue(9.99 < event.seconds < 12.0, event)

    def test_a_visitor_who_has_left_is_not_told_goodbye(self):
        self.assertNotIn("goodbye",
                         {event.path.rpartition("/")[2] for event in self.ended("leaves")})

    def test_each_fault_is_recovered_as_the_policy_says(self):
        recovered = [(each.node, each.failures[0].failure.cause.value, each.outcome)
                     for each in self.results["faults"].run.recoveries]
        self.assertEqual(recovered, [("SetRobotPose", "exception", "done"),
                                     ("SetSpeechEvent", "no-answer", "done"),
                                     ("SetOvertAttentionMode", "unusable-answer", "done"),
                                     ("Navigate", "connection-lost", "done"),
                                     ("PerformDeicticGesture", "refused", "done")])

    def test_the_start_says_once_what_the_robot_lacks(self):
        lines = [line for line in self.results["faults"].printed.splitlines()
                 if "/speechEvent/set_language" in line and "behaviorController:" in line
                 and "parameters" not in line]
        self.assertEqual(len(lines), 1, lines)


if __name__ == "__main__":
    rospy.init_node("test_release_1_0_scenarios")
    rostest.rosrun("unit_tests", "release_1_0_scenarios", TestRelease10Scenarios, sys.argv)
