#!/usr/bin/env python3
"""Do nodes that crash or answer nonsense do no harm, and does the same seed give the same visit?"""
import sys

import rospy
import rostest

from whole_test import CLEAN, WholeTest, run_test, run_tests, story


class TestScenarios(WholeTest):
    """The case runs the whole test."""

    def test_nodes_that_crash_or_answer_nonsense(self):
        result = run_test(
            "plannedFaults:=robotNavigation:1:crash,knowledgeBase:2:wrong,overtAttention:5:wrong,"
            "gestureExecution:3:crash", *CLEAN)
        self.assert_passed(result, "SUCCESS")
        self.assertIn("4 of ", result.report[-1])
        causes = {failed.node: failed.failure.cause.value for failed in result.run.failures
                  if not failed.attempt}
        self.assertEqual([causes[node] for node in ("Navigate", "LookUpEntrance")],
                         ["connection-lost", "unusable-answer"])


class TestSameSeed(WholeTest):
    """The case runs the whole test twice."""

    def test_the_same_seed_gives_the_same_record(self):
        # a visitor who engages, and faults that keep nobody waiting
        (_, first), (_, second) = run_tests(2 * [(
            "randomSeed:=8", "failureRate:=0.2", "visitorBehaviour:=random",
            "scenarioSpecification:=lab_tour")])
        self.assertEqual(first.code, 0, "\n".join(first.report))
        self.assertEqual(story(first.run), story(second.run))
        self.assertGreater(len(story(first.run)), 5)


if __name__ == "__main__":
    rospy.init_node("test_scenarios")
    rostest.rosrun("unit_tests", "scenarios", "__main__." + sys.argv[1], sys.argv)
