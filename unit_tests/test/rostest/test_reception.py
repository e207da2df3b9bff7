#!/usr/bin/env python3
"""Does every kind of visitor of the reception get the right visit, by voice and on the tablet?"""
import sys

import rospy
import rostest

from whole_test import WholeTest, run_tests

OUTCOMES = {"engages": "SUCCESS", "declines": "SUCCESS", "silent": "SUCCESS", "unclear": "SUCCESS",
            "noGaze": "FAILURE", "leaves": "FAILURE"}
COMMON = ("failureRate:=0", "speed:=5")
RELEASE = (*COMMON, "robotInterface:=release-1.0", "scenarioSpecification:=release_1_0_reception")


class TestReception(WholeTest):
    """Runs the whole test once for each kind of visitor."""

    def test_every_visitor_by_voice_and_on_the_tablet(self):
        visits = [(*COMMON, "scenarioSpecification:=reception", "asrEnabled:=" + asr,
                   "visitorBehaviour:=" + behaviour)
                  for behaviour in OUTCOMES for asr in ("true", "false")]
        self.assert_each_passed(visits)

    def test_a_visitor_of_a_robot_of_release_1_0(self):
        self.assert_each_passed([(*RELEASE, "asrEnabled:=" + asr, "tabletSuccessIs:=yes",
                                  "visitorBehaviour:=" + behaviour)
                                 for behaviour, asr in (("engages", "true"), ("engages", "false"),
                                                        ("declines", "true"))])

    def assert_each_passed(self, visits):
        for arguments, result in run_tests(visits):
            self.assert_passed(result, OUTCOMES[arguments[-1].partition(":=")[2]])


if __name__ == "__main__":
    rospy.init_node("test_reception")
    rostest.rosrun("unit_tests", "reception", TestReception, sys.argv)
