#!/usr/bin/env python3
"""Is the introduced tour of release 1.1 given by actions on the wire, with goals that fail, never
end or die with their server? (Fault 11 of the release: its own controller waits for ever.)"""
import sys

import rospy
import rostest

from behavior_controller.run.events import Asked, LeafFinished
from unit_tests.judge.facts import of
from whole_test import WholeTest, run_test

GIVEN = ("robotInterface:=release-1.1", "scenarioSpecification:=release_1_1_tour", "failureRate:=0",
         "textToSpeechDeadline:=2",
         "plannedFaults:=gestureExecution:1:refused,robotNavigation:2:crash,"
         "textToSpeech:4:unanswered,gestureExecution:4:exception")


class TestRelease11(WholeTest):
    """One whole test."""

    @classmethod
    def setUpClass(cls):
        cls.result = run_test(*GIVEN)

    def test_a_visitor_sees_the_whole_tour(self):
        self.assertEqual(self.result.code, 0, "\n".join(self.result.report) or self.result.printed)
        visit, = self.result.run.visits
        self.assertEqual((visit.outcome, len(visit.stops)), ("SUCCESS", 5))
        drives = [event for _, event in of(self.result.run.lines, Asked)
                  if event.service == "/robotNavigation/set_goal"]
        # the order is that of the knowledge file; the second drive is made again
        self.assertEqual([(drive.request.goal.x, drive.request.goal.y) for drive in drives],
                         [(2.0, 7.8), (2.0, 6.6), (2.0, 6.6), (2.0, 5.4), (2.9, 6.3), (2.0, 7.8)])

    def test_each_goal_that_fails_has_its_cause_and_what_follows(self):
        self.assertEqual([(each.node, each.failures[0].failure.cause.value, each.outcome)
                          for each in self.result.run.recoveries],
                         [("NavigateAsync", "connection-lost", "done"),
                          ("PerformDeicticGestureAsync", "refused", "done"),
                          ("DescribeExhibitSpeechAsync", "no-answer", "skipped"),
                          ("PerformDeicticGestureAsync", "refused", "done")])

    def test_a_goal_that_never_ends_is_over_at_its_deadline(self):
        late, = [event.seconds for _, event in of(self.result.run.lines, LeafFinished)
                 if event.failure and event.failure.cause.value == "no-answer"]
        self.assertTrue(2.0 <= late < 4.0, late)


if __name__ == "__main__":
    rospy.init_node("test_release_1_1_tour")
    rostest.rosrun("unit_tests", "release_1_1_tour", TestRelease11, sys.argv)
