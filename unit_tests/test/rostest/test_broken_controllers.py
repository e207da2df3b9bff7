#!/usr/bin/env python3
"""Is a controller with a mistake failed, with the node of the mistake in the first objection?

Hundreds of mistakes are tried in virtual time, by test/soak.
"""
import os
import shutil
import sys
import tempfile
import unittest

import rospy
import rostest

import broken
from whole_test import FAILED, run_test

DRIVES = "robotNavigation:1,robotNavigation:2,robotNavigation:3"
"""The first drive of the tour, and both retries that the delivered policy allows."""

PLANS = {
    "IGNORES_REFUSALS": ("gestureExecution:1", "WelcomeGesture"),
    "RECOVERS_ALWAYS": (DRIVES, "Navigate"),
    "RAISES_IN_EACH_SPEECH": ("", "WelcomeSpeech"),
    "ENDS_A_PASS_AFTER_FIVE_CALLS": ("", "pass 1")}
"""Which calls have to fail for a mistake to show, and the mission node that the verdict has to
name, or the pass if no node is at fault."""


class TestBrokenControllers(unittest.TestCase):
    """Each case has a controller with one mistake, made as Python starts in each process."""

    def test_every_mistake_has_its_case(self):
        self.assertEqual(sorted(PLANS), sorted(broken.ALL))


def case(name):
    """Return the test of one mistake."""
    faults, node = PLANS[name]

    def test(self):
        folder = tempfile.mkdtemp()
        self.addCleanup(shutil.rmtree, folder)
        with open(os.path.join(folder, "sitecustomize.py"), "w") as file:
            file.write(broken.ALL[name])
        paths = [folder] + os.environ.get("PYTHONPATH", "").split(os.pathsep)
        planned = ["plannedFaults:=" + faults] if faults else []
        result = run_test("scenarioSpecification:=lab_tour", "failureRate:=0", *planned,
                          PYTHONPATH=os.pathsep.join(paths))
        self.assertEqual(result.code, FAILED, result.printed[-3000:])
        objections = "\n".join(result.report).split("FAILED: ")[-1].splitlines()
        self.assertIn(node, objections[0])

    return test


for mistake in PLANS:
    setattr(TestBrokenControllers, "test_" + mistake.lower(), case(mistake))

if __name__ == "__main__":
    rospy.init_node("test_broken_controllers")
    rostest.rosrun("unit_tests", "broken_controllers", TestBrokenControllers, sys.argv)
