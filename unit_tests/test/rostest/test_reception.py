#!/usr/bin/env python3
"""Do visitors of the reception get the right visit, by voice and on the tablet?

Every kind of visitor is tried in virtual time, in test/unit.
"""
import sys

import rospy
import rostest

from whole_test import WholeTest, run_test

COMMON = ("failureRate:=0", "speed:=5")
RELEASE = (*COMMON, "robotInterface:=release-1.0", "scenarioSpecification:=release_1_0_reception")


class TestReception(WholeTest):
    """Each case runs the whole test."""

    def test_a_visitor_who_leaves_by_voice(self):
        result = run_test(*COMMON, "scenarioSpecification:=reception", "visitorBehaviour:=leaves")
        self.assert_passed(result, "FAILURE")

    def test_a_visitor_on_the_tablet(self):
        result = run_test(*COMMON, "scenarioSpecification:=reception", "asrEnabled:=false")
        self.assert_passed(result, "SUCCESS")

    def test_a_visitor_of_a_robot_of_release_1_0(self):
        self.assert_passed(run_test(*RELEASE, "tabletSuccessIs:=yes"), "SUCCESS")


if __name__ == "__main__":
    rospy.init_node("test_reception")
    rostest.rosrun("unit_tests", "reception", TestReception, sys.argv)
