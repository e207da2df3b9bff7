#!/usr/bin/env python3
"""Does a visitor who says yes get the whole lab tour, in the right order?"""
import sys

import rosnode
import rospy
import rostest

from expected import QUESTION, TOUR, WELCOME
from mission_run import MissionRun

NINE = ("/animateBehavior /overtAttention /gestureExecution /textToSpeech /robotNavigation "
        "/knowledgeBase /tabletEvent /speechEvent /faceDetection").split()


class TestLabTourByVoice(MissionRun):
    """One visitor who engages, speech recognition on."""

    def test_the_mission_succeeds(self):
        self.assert_ended_with_success()

    def test_the_requests_are_those_of_the_mission_in_order(self):
        self.assert_requests(WELCOME + QUESTION + TOUR)

    def test_the_robot_waits_for_the_visitor_and_for_an_answer(self):
        requests = {(line.node, line.content.get("message")): line.time for line in self.requests}
        seen = next(line.time for line in self.published("faceDetection")
                    if line.content["face_label_id"])
        welcomed = next(line.time for line in self.requests if line.node == "gestureExecution")
        self.assertLess(seen, welcomed)
        answered = next(line.time for line in self.published("speechEvent")
                        if line.content["data"] == "Yes")
        asked = requests[QUESTION[0]]
        toured = next(line.time for line in self.requests if line.node == "knowledgeBase")
        self.assertTrue(asked < answered < toured)

    def test_a_gaze_status_is_published_in_seeking_only(self):
        statuses = [line.content for line in self.published("overtAttention")]
        self.assertEqual({status["value"] for status in statuses if status["state"] == "seeking"},
                         {0, 1})
        self.assertEqual({status["value"] for status in statuses if status["state"] != "seeking"},
                         {0})

    def test_the_nine_nodes_bear_the_names_of_the_real_ones(self):
        names = rosnode.get_node_names()
        self.assertEqual([name for name in NINE if name not in names], [])


if __name__ == "__main__":
    rospy.init_node("test_lab_tour_by_voice")
    rostest.rosrun("unit_tests", "lab_tour_by_voice", TestLabTourByVoice, sys.argv)
