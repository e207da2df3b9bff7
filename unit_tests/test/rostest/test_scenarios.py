#!/usr/bin/env python3
"""Does every kind of visitor get the right visit, by voice and on the tablet, with and without faults?"""
import sys
import unittest

import rospy
import rostest

from unit_tests.verdict import QUESTIONS
from whole_test import run_test

CLEAN = ("scenarioSpecification:=lab_tour", "failureRate:=0")
OUTCOMES = {"engages": "SUCCESS", "declines": "SUCCESS", "silent": "SUCCESS", "unclear": "SUCCESS", "noGaze": "FAILURE",
            "leaves": "FAILURE"}
ELSEWHERE = {("engages", "true"), ("engages", "false"), ("declines", "true"), ("silent", "true"), ("noGaze", "true")}
"""What other tests of this folder run, with the order of all requests."""


class TestScenarios(unittest.TestCase):
    """Each case runs the whole test, most of them once."""

    def assert_passed(self, result, outcome):
        self.assertEqual(result.code, 0, "\n".join(result.report))
        self.assertEqual([event["outcome"] for event in result.record if event["event"] == "PassFinished"], [outcome])
        self.assertEqual((result.junit.get("tests"), result.junit.get("failures")), (str(len(QUESTIONS)), "0"))
        wanted = next(line.split() for line in result.report if "that this visitor should bring about" in line)
        self.assertEqual(wanted[0], wanted[2], "of the leaves that should be reached")

    def test_every_visitor_by_voice_and_on_the_tablet(self):
        for behaviour, outcome in OUTCOMES.items():
            for asr in ("true", "false"):
                if (behaviour, asr) not in ELSEWHERE:
                    print("visitor who {}, asrEnabled {}".format(behaviour, asr))
                    self.assert_passed(run_test("visitorBehaviour:=" + behaviour, "asrEnabled:=" + asr, *CLEAN), outcome)

    def test_nodes_that_crash_or_answer_nonsense(self):
        result = run_test("plannedFaults:=robotNavigation:1:crash,knowledgeBase:2:wrong,overtAttention:5:wrong,"
                          "gestureExecution:3:crash", *CLEAN)
        self.assert_passed(result, "SUCCESS")
        self.assertIn("4 of ", result.report[-1])
        causes = {event["node"]: event["failure"]["cause"] for event in result.record
                  if event["event"] == "LeafFinished" and event["status"] == "FAILURE"}
        self.assertEqual([causes[node] for node in ("Navigate", "LookUpEntrance")],
                         ["connection-lost", "unusable-answer"])

    def test_the_same_seed_gives_the_same_record(self):
        first, second = (run_test("randomSeed:=3", "failureRate:=0.2", "visitorBehaviour:=random",
                                  "scenarioSpecification:=lab_tour") for _ in range(2))
        self.assertEqual(first.code, 0, "\n".join(first.report))
        self.assertEqual(story(first.record), story(second.record))
        self.assertGreater(len(story(first.record)), 5)


def story(record):
    """Return what happened to each leaf in turn: branches that run side by side may do so in any order.

    Times differ, and so does the number of reports that a waiting condition is false.
    """
    found = {}
    for event in record:
        if event["event"] in ("LeafFinished", "Recovered") and (event["failure"] or {}).get("cause") != "condition-false":
            found.setdefault(event["path"], []).append(
                (event["event"], event.get("status") or event["outcome"], (event["failure"] or {}).get("cause")))
    return found


if __name__ == "__main__":
    rospy.init_node("test_scenarios")
    rostest.rosrun("unit_tests", "scenarios", TestScenarios, sys.argv)
