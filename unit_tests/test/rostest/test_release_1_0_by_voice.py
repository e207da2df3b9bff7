#!/usr/bin/env python3
"""Is a mission with the nodes of release 1.0 carried out on a robot of that release, in the right
order?

The requests are derived by hand from data/release_1_0_tour.xml.
"""
import sys

import rosnode
import rospy
import rostest

from behavior_controller.config import knowledge_files

from expected import animate, attend, describe, drive, iconic, point
from mission_run import MissionRun

FILES = knowledge_files.load()
START = FILES.tour[0]
NODES = {
    "/animateBehavior", "/overtAttention", "/gestureExecution", "/textToSpeech", "/robotNavigation",
    "/robotLocalization", "/tabletEvent", "/speechEvent"
}


def say(number):
    return ("textToSpeech", FILES.phrases[number])


def recognition(state):
    return ("speechEvent", state)


SET_POSE = ("robotLocalization", tuple(START.location))
PREPARE = [recognition("English"), SET_POSE, recognition("false")]
WELCOME = [
    animate("enabled"),
    attend("scanning"),
    animate("disabled"),
    iconic(1),
    say(4),
    attend("seeking"),
    attend("social")
]
QUESTION = [say(5), recognition("true"), recognition("false")]


def visit(place):
    pointing = [point(place)] if any(place.gesture) else []
    return ([say(2)] + drive(place) + [attend("social"), describe(place.description1)] + pointing
            + [describe(place.description2)])


TOUR = [request for place in FILES.tour for request in visit(place)]
END = [attend("social"), say(6), iconic(3), say(7)] + drive(START) + [SET_POSE]


class TestRelease10ByVoice(MissionRun):
    """One visitor who engages; utterances come by topic."""

    chosen = {"robotInterface": "release-1.0", "scenarioSpecification": "release_1_0_tour"}

    def test_the_mission_succeeds(self):
        self.assert_ended_with_success()

    def test_the_requests_are_those_of_the_mission_in_order(self):
        self.assert_requests(PREPARE + WELCOME + QUESTION + TOUR + END)

    def test_speech_has_its_language(self):
        spoken = [line.content["language"] for line in self.requests if line.node == "textToSpeech"]
        self.assertEqual(set(spoken), {"English"})

    def test_attention_tells_of_the_visitor_in_each_mode(self):
        told = {(line.content["state"], line.content["value"])
                for line in self.published("overtAttention")}
        self.assertLessEqual({("scanning", 2), ("social", 2), ("seeking", 2)}, told)

    def test_nothing_is_heard_while_recognition_is_off(self):
        switched = [
            line for line in self.requests
            if line.node == "speechEvent" and "status" in line.content
        ]
        on, off = (next(line.time for line in switched[1:] if line.content["status"] == status)
                   for status in ("true", "false"))
        heard = [line for line in self.published("speechEvent") if line.time > switched[0].time]
        self.assertEqual([line.content["data"] for line in heard], ["Yes"])
        self.assertTrue(on < heard[0].time < off)

    def test_the_robot_has_the_nodes_of_the_release(self):
        names = set(rosnode.get_node_names())
        self.assertEqual(NODES - names, set())
        self.assertEqual({"/knowledgeBase", "/faceDetection"} & names, set())


if __name__ == "__main__":
    rospy.init_node("test_release_1_0_by_voice")
    rostest.rosrun("unit_tests", "release_1_0_by_voice", TestRelease10ByVoice, sys.argv)
