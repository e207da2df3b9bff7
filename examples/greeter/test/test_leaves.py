"""The leaves of this package, without ROS: python3 -m unittest discover -s test"""
import unittest

from behavior_controller.extend import (
    Answer, Cause, FAILURE, Failure, RUNNING, SUCCESS, Say, Trial)

from greeter.interface import DOORBELL, MoveTo, SetLights, ShowText


class TestLeaves(unittest.TestCase):
    def test_the_lights_get_their_colour(self):
        trial = Trial('<Lights colour="blue"/>')
        self.assertEqual(trial.tick(), SUCCESS)
        self.assertEqual(trial.gateway.requests, [SetLights("blue")])

    def test_a_refusal_is_a_failure(self):
        trial = Trial("<Lights/>", answer=lambda request: Failure(Cause.REFUSED, "no bulb"))
        self.assertEqual(trial.tick(), FAILURE)

    def test_the_mission_waits_for_the_answer(self):
        trial = Trial("<Lights/>", answer=lambda request: None)
        self.assertEqual(trial.tick(), RUNNING)
        trial.gateway.calls[0].finish(Answer())
        self.assertEqual(trial.tick(), SUCCESS)

    def test_the_doorbell_counts_once_it_has_rung(self):
        trial = Trial("<DoorbellRang/>")
        self.assertEqual(trial.tick(), FAILURE)
        trial.topics.publish(DOORBELL, True)
        self.assertEqual(trial.tick(), SUCCESS)

    def test_the_time_is_said_every_other_time(self):
        trial = Trial("<EveryOther><SayTime/></EveryOther>")
        said = []
        for _ in range(3):
            trial.tick()
            said.append(len(trial.gateway.requests))
        self.assertEqual(said, [1, 1, 2])
        self.assertIsInstance(trial.gateway.requests[0], Say)

    def test_a_drive_that_is_halted_cancels_its_goal(self):
        trial = Trial('<DriveTo x="1.5" y="-0.5"/>', answer=lambda request: None)
        self.assertEqual(trial.tick(), RUNNING)
        trial.tree.halt()
        self.assertEqual(trial.gateway.dropped, [MoveTo(1.5, -0.5, 0.0)])

    def test_a_text_is_published(self):
        trial = Trial('<Display text="Hello"/>')
        self.assertEqual(trial.tick(), SUCCESS)
        self.assertEqual(trial.gateway.requests, [ShowText("Hello")])


if __name__ == "__main__":
    unittest.main()
