#!/usr/bin/env python3
"""Do nodes that crash or answer nonsense do no harm?"""
import sys

import rospy
import rostest

from whole_test import CLEAN, WholeTest, run_test


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


if __name__ == "__main__":
    rospy.init_node("test_scenarios")
    rostest.rosrun("unit_tests", "scenarios", TestScenarios, sys.argv)
