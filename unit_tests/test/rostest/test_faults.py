#!/usr/bin/env python3
"""Does the controller survive calls that go wrong, and does the record contain exactly those?"""
import sys

import rospy
import rostest

from expected import KNOWLEDGE
from mission_run import MissionRun, told


class TestFaults(MissionRun):
    """One visitor who engages; a refusal, an exception, a drive that fails twice and a call without
    an answer."""

    def test_the_tour_is_given_all_the_same(self):
        self.assert_ended_with_success()

    def test_every_planned_fault_happened(self):
        faults = [(line.node, line.call, line.fault) for line in self.requests if line.fault]
        self.assertEqual(sorted(faults), [("animateBehavior", 3, "unanswered"),
                                          ("knowledgeBase", 1, "exception"),
                                          ("robotNavigation", 2, "refused"),
                                          ("robotNavigation", 3, "refused"),
                                          ("textToSpeech", 3, "refused")])

    def test_the_second_drive_was_tried_three_times(self):
        goals = [told(line)[1] for line in self.requests if line.node == "robotNavigation"]
        self.assertEqual(goals[:5],
                         [tuple(KNOWLEDGE.exhibits[index].location) for index in (0, 1, 1, 1, 2)])

    def test_the_record_names_the_causes(self):
        failed = [(failed.node, failed.failure.cause.value) for failed in self.model.failures
                  if not failed.attempt and not failed.is_false_condition]
        self.assertEqual(failed, [
            ("EnableAnimateBehavior", "no-answer"), ("RetrieveListOfExhibits", "exception"),
            ("FollowMeSpeech", "refused"), ("Navigate", "refused")])


if __name__ == "__main__":
    rospy.init_node("test_faults")
    rostest.rosrun("unit_tests", "faults", TestFaults, sys.argv)
