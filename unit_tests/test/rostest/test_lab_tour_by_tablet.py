#!/usr/bin/env python3
"""Does a visitor who presses Yes get the tour without speech recognition, where 2 means mutual
gaze?"""
import sys

import rospy
import rostest

from expected import QUESTION, TABLET, TOUR, WELCOME
from mission_run import MissionRun


class TestLabTourByTablet(MissionRun):
    """One visitor who engages, speech recognition off, mutualGazeValue 2."""

    def test_the_mission_succeeds(self):
        self.assert_ended_with_success()

    def test_the_requests_are_those_of_the_mission_in_order(self):
        self.assert_requests(WELCOME + QUESTION + TABLET + TOUR)

    def test_the_gaze_status_is_that_of_the_robot(self):
        statuses = [line.content for line in self.published("overtAttention")]
        self.assertEqual({status["value"] for status in statuses if status["state"] == "seeking"},
                         {1, 2})


if __name__ == "__main__":
    rospy.init_node("test_lab_tour_by_tablet")
    rostest.rosrun("unit_tests", "lab_tour_by_tablet", TestLabTourByTablet, sys.argv)
