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
        return [line for line in "\n".join(result.report).split("FAILED: ")[1].splitlines()]

    def test_a_leaf_that_ignores_refusals(self):
        objections = self.run_spoilt("ros/services.py", "    if success == route.refused:", "    if False:",
                                     "plannedFaults:=gestureExecution:1")
        self.assertTrue(any("gesture" in line.lower() for line in objections), objections)

    def test_a_recovery_that_always_succeeds(self):
        objections = self.run_spoilt("leaves/recovery.py", "        return self._finished(outcome != GIVEN_UP)",
                                     "        return self._finished(True)",
                                     "plannedFaults:=" + ",".join("robotNavigation:{}".format(n) for n in (1, 2, 3)))
        self.assertTrue(any("did not get to exhibit" in line or "ended with" in line for line in objections), objections)

    def test_an_exhibit_that_is_skipped(self):
        objections = self.run_spoilt("leaves/knowledge.py", SELECTED, SELECTED.replace("+ 1", "+ 2"))
        self.assertTrue(any("did not get to exhibit" in line for line in objections), objections)


SELECTED = "        self.remember(NEXT_EXHIBIT, index + 1)"

if __name__ == "__main__":
    rospy.init_node("test_broken_controllers")
    rostest.rosrun("unit_tests", "broken_controllers", TestBrokenControllers, sys.argv)
