#!/usr/bin/env python3
"""Is a visitor who says nothing asked three times and then let go?"""
import sys

import rospy
import rostest

from expected import FAREWELL, QUESTION, WELCOME, say
from mission_run import MissionRun


class TestSilent(MissionRun):
    """One visitor who is silent, speech recognition on."""

    behaviour = "silent"

    def test_the_mission_succeeds(self):
        self.assert_ended_with_success()

    def test_three_prompts_then_farewell(self):
        self.assert_requests(WELCOME + QUESTION + 3 * [say("SayYesNoSpeech")] + FAREWELL)

    def test_each_prompt_comes_after_the_ten_seconds_of_the_mission(self):
        # without the welcome
        times = [line.time for line in self.requests if line.node == "textToSpeech"][1:]
        for before, after in zip(times[:3], times[1:4]):
            self.assertGreater(after - before, 9.99)
            self.assertLess(after - before, 12.0)


if __name__ == "__main__":
    rospy.init_node("test_silent")
    rostest.rosrun("unit_tests", "silent", TestSilent, sys.argv)
