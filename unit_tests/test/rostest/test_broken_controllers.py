#!/usr/bin/env python3
"""Is a controller that does the wrong thing found out, with the right words?"""
import os
import shutil
import sys
import tempfile
import unittest

import rospy
import rostest

from behavior_controller import folders
from expected import KNOWLEDGE
from whole_test import FAILED, run_test

SOURCE = os.path.dirname(os.path.realpath(folders.__file__))
ROOT = os.path.dirname(os.path.dirname(SOURCE))


class TestBrokenControllers(unittest.TestCase):
    """Each case spoils one line of a copy of the controller."""

    def run_spoilt(self, module, line, spoilt, *arguments):
        """Run the whole test with a controller in which ``line`` of ``module`` reads ``spoilt``."""
        folder = tempfile.mkdtemp()
        self.addCleanup(shutil.rmtree, folder)
        for name in ("src/behavior_controller", "config", "data"):
            shutil.copytree(os.path.join(ROOT, name), os.path.join(folder, name),
                            ignore=shutil.ignore_patterns("__pycache__"))
        path = os.path.join(folder, "src", "behavior_controller", module)
        with open(path) as file:
            text = file.read()
        self.assertEqual(text.count(line), 1, "the line to spoil has changed")
        with open(path, "w") as file:
            file.write(text.replace(line, spoilt))
        paths = [os.path.join(folder, "src")] + os.environ.get("PYTHONPATH", "").split(os.pathsep)
        result = run_test("scenarioSpecification:=lab_tour", "failureRate:=0", *arguments,
                          PYTHONPATH=os.pathsep.join(paths))
        self.assertEqual(result.code, FAILED, result.printed[-3000:])
        return [line.strip() for line in "\n".join(result.report).split("FAILED: ")[1].splitlines()]

    def test_a_leaf_that_ignores_refusals(self):
        objections = self.run_spoilt(
            "leaves/base.py", RESULT, RESULT.replace("result if", "None if"), "plannedFaults:=gestureExecution:1")
        self.assertEqual(objections, ["call 1 of /gestureExecution/perform_gesture was made to fail (refused) "
                                      "and is not on record as a failure"])

    def test_a_recovery_that_always_succeeds(self):
        # the first drive of the tour and both retries that the delivered policy allows
        objections = self.run_spoilt("leaves/recovery.py", "        return self._finished(outcome != GIVEN_UP)",
                                     "        return self._finished(True)",
                                     "plannedFaults:=" + ",".join("robotNavigation:{}".format(n) for n in (1, 2, 3)))
        self.assertEqual(objections, ["pass 1: the robot did not get to exhibit " + EXHIBITS[0]])

    def test_an_exhibit_that_is_skipped(self):
        objections = self.run_spoilt("leaves/knowledge.py", SELECTED, SELECTED.replace("+ 1", "+ 2"))
        self.assertEqual(objections, ["pass 1: the robot did not get to exhibit " + name for name in EXHIBITS[1::2]])


EXHIBITS = [exhibit.name for exhibit in KNOWLEDGE.exhibits]
RESULT = "        failure = result if isinstance(result, Failure) else self.accept(result)"
SELECTED = "        self.remember(NEXT_EXHIBIT, index + 1)"

if __name__ == "__main__":
    rospy.init_node("test_broken_controllers")
    rostest.rosrun("unit_tests", "broken_controllers", TestBrokenControllers, sys.argv)
