"""The leaves of this package, without ROS: python3 -m unittest discover -s test"""
import unittest
from unittest import mock

from behavior_controller.extend import (
    Answer, FAILURE, Prompt, SUCCESS, Say, Sense, Trial)

from receptionist import directory

NAMED = '<Sequence><Script code="@person := \'{}\'"/>{}</Sequence>'


class TestLeaves(unittest.TestCase):
    def test_a_name_is_heard_that_is_said_after_the_question(self):
        trial = Trial("<Sequence><AskNameSpeech/><IsNameUttered/></Sequence>")
        topic = trial.mission.interface.evidence(Sense.UTTERANCE).topic
        trial.topics.publish(topic, "Doctor Vernon")
        self.assertEqual(trial.tick(), FAILURE)  # it was said before the question
        for utterance, sentence, person, candidates in (
                ("the weather", "heard “the weather”: no name understood", None, None),
                ("Dr Vernan", "heard “Dr Vernan”: David Vernon?", "David Vernon", "David Vernon"),
                ("Dr Vernon", "heard “Dr Vernon”: David Vernon", "David Vernon", "")):
            trial = Trial("<Sequence><AskNameSpeech/><Sleep msec='1'/><IsNameUttered/></Sequence>")
            trial.tick()
            trial.clock.advance(0.5)
            trial.topics.publish(topic, utterance)
            self.assertEqual(trial.tick(), SUCCESS if person else FAILURE)
            self.assertEqual(trial.events[-1].summary.text, sentence)
            self.assertEqual(trial.tree.blackboard.get("person"), person)
            self.assertEqual(trial.tree.blackboard.get("candidates"), candidates)

    def test_an_error_of_the_recognition_is_no_name(self):
        errol = directory.Directory({"Errol Flynn": "B203"}, {})
        self.assertTrue(errol.heard("Error: no speech recognised").names)
        with mock.patch.object(directory, "load", lambda: errol):
            trial = Trial("<IsNameUttered/>")
        topic = trial.mission.interface.evidence(Sense.UTTERANCE).topic
        trial.topics.publish(topic, "Error: no speech recognised")
        self.assertEqual(trial.tick(), FAILURE)
        self.assertEqual(trial.events[-1].summary.text, "no answer recognised")

    def test_the_way_is_that_to_the_persons_room(self):
        trial = Trial(NAMED.format("Jürgen Müller", "<LookUpPerson/><RoomSpeech/>"))
        self.assertEqual(trial.tick(), SUCCESS)
        self.assertEqual(trial.gateway.requests, [Say("Jürgen Müller is in room C105.")])
        self.assertEqual(trial.tree.blackboard.get("gestureTarget"), (-4.0, 3.0, 1.2))

    def test_somebody_who_is_not_in_the_file_has_no_room(self):
        self.assertEqual(Trial(NAMED.format("Nobody", "<LookUpPerson/>")).tick(), FAILURE)

    def test_a_typed_name_counts_and_no_name_is_a_failure(self):
        for typed, result, candidates in (
                ("vernon", SUCCESS, ""), ("Habimana", SUCCESS, "Jean-Paul Habimana;Eric Habimana"),
                ("nobody", FAILURE, None), ("", FAILURE, None)):
            trial = Trial("<TypeName/>", answer=lambda request: Answer(response=typed))
            self.assertEqual(trial.tick(), result, typed)
            self.assertIsInstance(trial.gateway.requests[0], Prompt)
            self.assertEqual(trial.tree.blackboard.get("candidates"), candidates)


if __name__ == "__main__":
    unittest.main()
