#!/usr/bin/env python3
"""Is a visitor who never looks back left alone after the fifteen seconds of the mission?"""
import sys

import rospy
import rostest

from expected import WELCOME
from mission_run import MissionRun


class TestNoGaze(MissionRun):
    """One visitor who never looks back."""

    behaviour = "noGaze"

    def test_the_pass_fails_and_that_is_right(self):
        self.assertEqual((str(self.verdict)[:6], self.exit_code), ("PASSED", 3), str(self.verdict))

    def test_nobody_is_asked_without_a_gaze(self):
        self.assert_requests(WELCOME[:-1])  # without the social attention that a gaze brings

    def test_the_robot_seeks_for_as_long_as_the_mission_says(self):
        ended = self.model.visits[0].ended
        sought = next(line.time for line in self.requests if line.content.get("state") == "seeking")
        self.assertGreater(ended - sought, 14.99)
        self.assertLess(ended - sought, 17.0)


if __name__ == "__main__":
    rospy.init_node("test_no_gaze")
    rostest.rosrun("unit_tests", "no_gaze", TestNoGaze, sys.argv)
