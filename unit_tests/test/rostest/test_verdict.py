#!/usr/bin/env python3
"""Does the test end by itself with the right exit code, whatever the controller does?"""
import re
import sys
import unittest

import rospy
import rostest

from whole_test import run_test


class TestVerdict(unittest.TestCase):
    """Each case runs the whole test."""

    def test_a_mission_that_succeeds_although_calls_fail(self):
        code, printed, report = run_test("scenarioSpecification:=lab_tour", "failureRate:=0",
                                         "plannedFaults:=textToSpeech:1,gestureExecution:2")[:3]
        self.assertEqual(code, 0, printed)
        self.assertEqual(report[-1], "PASSED: 1 pass ended as a visitor who engages should; "
                                     "2 of 77 calls were made to fail, and all of these are on record")
        self.assertEqual(report[-1], printed.splitlines()[-1])
        self.assertNotIn("REQUIRED", printed)
        self.assertIn(": mission lab_tour.xml; visitorBehaviour engages; failureRate 0; ", report[0])
        seed = re.search(r"randomSeed \d+", report[0]).group()
        self.assertLess(printed.index(seed), printed.index(report[0]), "it is told before the mission begins")
        refused = [line.split("\t") for line in report if "\trefused\t" in line]
        self.assertEqual([(line[1], line[3]) for line in refused], [
            ("WelcomeSpeech", "/textToSpeech/say_text"),
            ("PerformDeicticGesture", "/gestureExecution/perform_gesture")])

    def test_a_mission_that_has_to_fail(self):
        code, printed, report = run_test("scenarioSpecification:=lab_tour", "failureRate:=0", "plannedFaults:="
                                         + ",".join("knowledgeBase:{}".format(call) for call in range(1, 4)))[:3]
        self.assertEqual(code, 0, printed)
        self.assertIn("pass 1 ended with FAILURE, as it had to", report[-1])
        rows = [line.split() for line in report if "knowledgeBase:" in line and line[0] != "#"]
        self.assertEqual([row[3:5] for row in rows], [["RetrieveListOfExhibits", "knowledgeBase:{}".format(number)]
                                                      for number in (1, 2, 3)])
        self.assertEqual([" ".join(row[6:8]) for row in rows], ["tried again", "tried again", "given up"])

    def test_a_controller_that_does_not_start(self):
        code, printed, report = run_test("scenarioSpecification:=no_such_mission")[:3]
        self.assertEqual(code, 1, printed)
        self.assertEqual(report[-1], "FAILED: the controller ended with exit code 2 before it started its mission")

    def test_a_mission_that_does_not_end(self):
        code, printed, report = run_test("mission:=lab_tour", "scenario:=silent",
                                         "failureRate:=0", "testTimeout:=8")[:3]
        self.assertEqual(code, 1, printed)
        self.assertEqual(report[-1], "FAILED: the mission did not end within 8 s (testTimeout)")

    def test_a_wrong_configuration_is_told_once(self):
        code, printed, report = run_test("failureRate:=2")[:3]
        self.assertEqual((code, report), (2, []), printed)
        self.assertEqual(printed, "argument failureRate: failureRate cannot be \"2\" (allowed: a number from 0 to 1)\n"
                                  "nothing was tested\n")

    def test_an_unknown_argument_is_refused_before_anything_starts(self):
        code, printed, report = run_test("failurRate:=0.9")[:3]
        self.assertEqual((code, report), (2, []), printed)
        self.assertEqual(printed, "argument failurRate:=0.9: unknown (did you mean failureRate?)\nnothing was tested\n")


if __name__ == "__main__":
    rospy.init_node("test_verdict")
    rostest.rosrun("unit_tests", "verdict", TestVerdict, sys.argv)
