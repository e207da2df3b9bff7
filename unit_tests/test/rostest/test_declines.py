#!/usr/bin/env python3
"""Are visitors who say no let go, one after the other?"""
import sys

import rospy
import rostest

from expected import FAREWELL, QUESTION, WELCOME
from mission_run import MissionRun


class TestDeclines(MissionRun):
    """Two visitors who decline, speech recognition on."""

    behaviour, runs = "declines", 2

    def test_the_mission_succeeds(self):
        self.assert_ended_with_success()

    def test_nobody_is_given_a_tour(self):
        self.assert_requests(2 * (WELCOME + QUESTION + FAREWELL))


if __name__ == "__main__":
    rospy.init_node("test_declines")
    rostest.rosrun("unit_tests", "declines", TestDeclines, sys.argv)
