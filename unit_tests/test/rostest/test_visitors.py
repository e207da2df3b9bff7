#!/usr/bin/env python3
"""Does every kind of visitor get the right visit, by voice and on the tablet?"""
import sys

import rospy
import rostest

from whole_test import CLEAN, WholeTest, run_tests

OUTCOMES = {"engages": "SUCCESS", "declines": "SUCCESS", "silent": "SUCCESS", "unclear": "SUCCESS",
            "noGaze": "FAILURE", "leaves": "FAILURE"}
ELSEWHERE = {("engages", "true"), ("engages", "false"), ("declines", "true"), ("silent", "true"),
             ("noGaze", "true")}
"""What other tests of this folder run, with the order of all requests."""


class TestVisitors(WholeTest):
    """Runs the whole test once for each kind of visitor."""

    def test_every_visitor_by_voice_and_on_the_tablet(self):
        every = {(behaviour, asr) for behaviour in OUTCOMES for asr in ("true", "false")}
        visitors = sorted(every - ELSEWHERE)
        results = run_tests([(*CLEAN, "speed:=5", "visitorBehaviour:=" + behaviour,
                              "asrEnabled:=" + asr) for behaviour, asr in visitors])
        for visitor, (_, result) in zip(visitors, results):
            self.assert_passed(result, OUTCOMES[visitor[0]])


if __name__ == "__main__":
    rospy.init_node("test_visitors")
    rostest.rosrun("unit_tests", "visitors", TestVisitors, sys.argv)
