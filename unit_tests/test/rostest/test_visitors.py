#!/usr/bin/env python3
"""Do visitors get the right visit that no other test of this folder runs with nodes?

Every kind of visitor is tried in virtual time, in test/unit.
"""
import sys

import rospy
import rostest

from whole_test import CLEAN, WholeTest, run_test

VISIT = (*CLEAN, "speed:=5")


class TestVisitors(WholeTest):
    """Each case runs the whole test."""

    def test_a_visitor_who_leaves(self):
        self.assert_passed(run_test(*VISIT, "visitorBehaviour:=leaves"), "FAILURE")

    def test_a_visitor_who_presses_nothing_that_is_understood(self):
        result = run_test(*VISIT, "visitorBehaviour:=unclear", "asrEnabled:=false")
        self.assert_passed(result, "SUCCESS")


if __name__ == "__main__":
    rospy.init_node("test_visitors")
    rostest.rosrun("unit_tests", "visitors", TestVisitors, sys.argv)
