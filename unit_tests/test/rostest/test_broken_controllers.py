#!/usr/bin/env python3
"""Is a controller with a mistake detected, with the right objections?"""
import os
import shutil
import sys
import tempfile
import unittest

import rospy
import rostest

from broken import GIVES_UP_A_RETRY_TOO_EARLY, IGNORES_REFUSALS, RECOVERS_ALWAYS, SKIPS_EXHIBITS
from expected import KNOWLEDGE
from whole_test import FAILED, run_test


class TestBrokenControllers(unittest.TestCase):
    """Each case spoils one rule of the controller, as Python starts in each process of the test."""

    def run_spoilt(self, spoilt, *arguments):
        """Run the whole test with the controller ``spoilt`` by that code, and return the objections."""
        folder = tempfile.mkdtemp()
        self.addCleanup(shutil.rmtree, folder)
        with open(os.path.join(folder, "sitecustomize.py"), "w") as file:
            file.write(spoilt)
        paths = [folder] + os.environ.get("PYTHONPATH", "").split(os.pathsep)
        result = run_test("scenarioSpecification:=lab_tour", "failureRate:=0", *arguments,
                          PYTHONPATH=os.pathsep.join(paths))
        self.assertEqual(result.code, FAILED, result.printed[-3000:])
        return [line.strip() for line in "\n".join(result.report).split("FAILED: ")[-1].splitlines()]

    def test_a_leaf_that_ignores_refusals(self):
        objections = self.run_spoilt(IGNORES_REFUSALS, "plannedFaults:=gestureExecution:1")
        self.assertEqual(objections, ["call 1 of /gestureExecution/perform_gesture was made to fail (refused) "
                                      "and is not on record as a failure"])

    def test_a_recovery_that_always_succeeds(self):
        # the first drive of the tour and both retries that the delivered policy allows
        objections = self.run_spoilt(RECOVERS_ALWAYS, "plannedFaults:=" + ",".join(
            "robotNavigation:{}".format(n) for n in (1, 2, 3)))
        self.assertIn("HandleFallBack ended with FAILURE, and the mission went on as if it had not", objections)

    def test_a_recovery_that_gives_up_a_retry_too_early(self):
        objections = self.run_spoilt(GIVES_UP_A_RETRY_TOO_EARLY, "plannedFaults:=gestureExecution:1")
        self.assertEqual(objections, ["the recovery from refused of WelcomeGesture ended after 0 retries where the policy "
                                      "prescribes 1"])

    def test_an_exhibit_that_is_skipped(self):
        objections = self.run_spoilt(SKIPS_EXHIBITS)  # except after the last, which has no next
        self.assertEqual(objections, ["pass 1: the robot did not get to exhibit " + name for name in EXHIBITS[:-1:2]])


EXHIBITS = [exhibit.name for exhibit in KNOWLEDGE.exhibits]

if __name__ == "__main__":
    rospy.init_node("test_broken_controllers")
    rostest.rosrun("unit_tests", "broken_controllers", TestBrokenControllers, sys.argv)
