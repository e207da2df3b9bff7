#!/usr/bin/env python3
"""Does the test end by itself with the right exit code, whatever the controller does?"""
import os
import pathlib
import re
import sys
import tempfile
import unittest

import rospy
import rostest

from whole_test import run_test


FAULTY = {
    "package.xml": """<package format="2"><name>faulty</name><version>1.0.0</version>
<description>a mission with a fault</description><maintainer email="a@example.org">a</maintainer>
<license>BSD</license><export><cssr_system leaves="faulty_leaves"/></export></package>""",
    "faulty_leaves.py": "SPECS = ()\n",
    "data/faulty.xml": """<root BTCPP_format="4"><BehaviorTree ID="M"><Nope/></BehaviorTree>
</root>"""}
"""A package with a mission that cannot be run."""


class TestVerdict(unittest.TestCase):
    """Each case runs the whole test."""

    def test_a_mission_that_has_to_fail(self):
        code, printed, report = run_test(
            "scenarioSpecification:=lab_tour", "failureRate:=0",
            "plannedFaults:=" + ",".join("knowledgeBase:{}".format(call)
                                         for call in range(1, 4)))[:3]
        self.assertEqual(code, 0, printed)
        self.assertRegex(report[-1], r"^PASSED: pass 1 ended early, as it had to: ")
        rows = [line.split() for line in report if "knowledgeBase:" in line and line[0] != "#"]
        self.assertEqual([row[3:5] for row in rows],
                         [["RetrieveListOfExhibits", "knowledgeBase:{}".format(number)]
                          for number in (1, 2, 3)])
        self.assertEqual([" ".join(row[6:8]) for row in rows],
                         ["tried again", "tried again", "given up"])

    def test_a_controller_that_does_not_start(self):
        with tempfile.TemporaryDirectory() as folder:
            for path, text in FAULTY.items():
                file = pathlib.Path(folder, "faulty", path)
                file.parent.mkdir(parents=True, exist_ok=True)
                file.write_text(text)
            paths = {name: os.pathsep.join([os.path.join(folder, "faulty"), os.environ[name]])
                     for name in ("ROS_PACKAGE_PATH", "PYTHONPATH")}
            code, printed, report = run_test("scenarioSpecification:=faulty", **paths)[:3]
        self.assertEqual(code, 2, printed)
        self.assertRegex(report[1], r"^FAILED: .*exit code 2\b.*and 2 objections")
        self.assertIn("Nope", report[-2], "why it did not start")

    def test_a_mission_that_is_not_there_is_told_at_once(self):
        code, printed, report = run_test("scenarioSpecification:=lab_tuor")[:3]
        self.assertEqual((code, report), (2, []), printed)
        self.assertRegex(printed, r"^scenarioSpecification: .*did you mean lab_tour.*\n.*\n$")

    def test_a_wrong_configuration_is_told_once(self):
        code, printed, report = run_test("failureRate:=2")[:3]
        self.assertEqual((code, report), (2, []), printed)
        self.assertRegex(printed, r"^argument failureRate: .*\"2\".*\n.*\n$")

    def test_an_unknown_argument_is_refused_before_anything_starts(self):
        code, printed, report = run_test("failurRate:=0.9")[:3]
        self.assertEqual((code, report), (2, []), printed)
        self.assertRegex(printed, r"^argument failurRate:=0.9: .* failureRate\?.*\n.*\n$")


class TestVerdictOfTours(unittest.TestCase):
    """Each case runs the whole test, with all of a tour."""

    def test_a_mission_that_succeeds_although_calls_fail(self):
        code, printed, report = run_test("scenarioSpecification:=lab_tour", "failureRate:=0",
                                         "plannedFaults:=textToSpeech:1,gestureExecution:2")[:3]
        self.assertEqual(code, 0, printed)
        # 77 calls of the tour, and the two of the safe state after it
        self.assertRegex(report[-1], r"^PASSED: 1 .*\bengages\b.*\b2 of 79 ")
        *_, verdict, page = printed.splitlines()
        self.assertEqual(report[-1], verdict)
        self.assertRegex(page, r"file:///.*/report\.html$")
        self.assertNotIn("REQUIRED", printed)
        self.assertIn(": mission lab_tour.xml; visitorBehaviour engages; failureRate 0; ",
                      report[0])
        seed = re.search(r"randomSeed \d+", report[0]).group()
        self.assertLess(printed.index(seed), printed.index(report[0]),
                        "it is told before the mission begins")
        refused = [line.split("\t") for line in report if "\trefused\t" in line]
        self.assertEqual([(line[1], line[3]) for line in refused], [
            ("WelcomeSpeech", "/textToSpeech/say_text"),
            ("PerformDeicticGesture", "/gestureExecution/perform_gesture")])

    def test_a_mission_for_which_the_time_is_too_short(self):
        code, printed, report = run_test("mission:=lab_tour", "scenario:=silent",
                                         "failureRate:=0", "testTimeout:=8")[:3]
        self.assertEqual(code, 3, printed)
        self.assertRegex(report[-1], r"^CUT OFF: .*\b8 s.*testTimeout")
        told = printed.index("so that the test may be cut off; set testTimeout:=")
        self.assertLess(told, printed.index("a pass begins"), "it is told before the start")


if __name__ == "__main__":
    rospy.init_node("test_verdict")
    rostest.rosrun("unit_tests", "verdict", "__main__." + sys.argv[1], sys.argv)
