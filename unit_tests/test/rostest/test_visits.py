#!/usr/bin/env python3
"""Does each kind of visit go as its mission says, request by request?

The requests are derived by hand from data/lab_tour.xml and data/release_1_0_tour.xml. Each launch
file names the class that looks at its mission.
"""
import sys

import rosnode
import rospy
import rostest

import release_1_0_expected as release
from expected import FAREWELL, KNOWLEDGE, QUESTION, TABLET, TOUR, WELCOME, say
from mission_run import MissionRun, told

NINE = ("/animateBehavior /overtAttention /gestureExecution /textToSpeech /robotNavigation "
        "/knowledgeBase /tabletEvent /speechEvent /faceDetection").split()
NODES_OF_RELEASE = {"/animateBehavior", "/overtAttention", "/gestureExecution", "/textToSpeech",
                    "/robotNavigation", "/robotLocalization", "/tabletEvent", "/speechEvent"}


class TestLabTourByVoice(MissionRun):
    """One visitor who engages, speech recognition on."""

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


class TestLabTourByTablet(MissionRun):
    """One visitor who engages, speech recognition off, mutualGazeValue 2."""

    def test_the_requests_are_those_of_the_mission_in_order(self):
        self.assert_requests(WELCOME + QUESTION + TABLET + TOUR)

    def test_the_gaze_status_is_that_of_the_robot(self):
        statuses = [line.content for line in self.published("overtAttention")]
        self.assertEqual({status["value"] for status in statuses if status["state"] == "seeking"},
                         {1, 2})


class TestDeclines(MissionRun):
    """Two visitors who decline, speech recognition on."""

    behaviour, runs = "declines", 2

    def test_nobody_is_given_a_tour(self):
        self.assert_requests(2 * (WELCOME + QUESTION + FAREWELL))


class TestSilent(MissionRun):
    """One visitor who is silent, speech recognition on."""

    behaviour = "silent"

    def test_three_prompts_then_farewell(self):
        self.assert_requests(WELCOME + QUESTION + 3 * [say("SayYesNoSpeech")] + FAREWELL)

    def test_each_prompt_comes_after_the_ten_seconds_of_the_mission(self):
        # without the welcome
        times = [line.time for line in self.requests if line.node == "textToSpeech"][1:]
        for before, after in zip(times[:3], times[1:4]):
            self.assertGreater(after - before, 9.99)
            self.assertLess(after - before, 12.0)


class TestNoGaze(MissionRun):
    """One visitor who never looks back."""

    behaviour, code = "noGaze", 3

    def test_nobody_is_asked_without_a_gaze(self):
        self.assert_requests(WELCOME[:-1])  # without the social attention that a gaze brings

    def test_the_robot_seeks_for_as_long_as_the_mission_says(self):
        ended = self.model.visits[0].ended
        sought = next(line.time for line in self.requests if line.content.get("state") == "seeking")
        self.assertGreater(ended - sought, 14.99)
        self.assertLess(ended - sought, 17.0)


class TestFaults(MissionRun):
    """One visitor who engages; a refusal, an exception, a drive that fails twice and a call without
    an answer."""

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


class TestRelease10ByVoice(MissionRun):
    """One visitor who engages; utterances come by topic."""

    chosen = {"robotInterface": "release-1.0", "scenarioSpecification": "release_1_0_tour"}

    def test_the_requests_are_those_of_the_mission_in_order(self):
        self.assert_requests(release.PREPARE + release.WELCOME + release.QUESTION + release.TOUR
                             + release.END)

    def test_speech_has_its_language(self):
        spoken = [line.content["language"] for line in self.requests if line.node == "textToSpeech"]
        self.assertEqual(set(spoken), {"English"})

    def test_attention_tells_of_the_visitor_in_each_mode(self):
        told = {(line.content["state"], line.content["value"])
                for line in self.published("overtAttention")}
        self.assertLessEqual({("scanning", 2), ("social", 2), ("seeking", 2)}, told)

    def test_nothing_is_heard_while_recognition_is_off(self):
        switched = [line for line in self.requests if line.node == "speechEvent"
                    and "status" in line.content]
        on, off = (next(line.time for line in switched[1:] if line.content["status"] == status)
                   for status in ("true", "false"))
        heard = [line for line in self.published("speechEvent") if line.time > switched[0].time]
        self.assertEqual([line.content["data"] for line in heard], ["Yes"])
        self.assertTrue(on < heard[0].time < off)

    def test_the_robot_has_the_nodes_of_the_release(self):
        names = set(rosnode.get_node_names())
        self.assertEqual(NODES_OF_RELEASE - names, set())
        self.assertEqual({"/knowledgeBase", "/faceDetection"} & names, set())


if __name__ == "__main__":
    rospy.init_node("test_visits")
    rostest.rosrun("unit_tests", "visits", "__main__." + sys.argv[1], sys.argv)
