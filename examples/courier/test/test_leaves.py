"""The leaves of this package, without ROS: python3 -m unittest discover -s test"""
import unittest

from behavior_controller.extend import (
    Answer, Cause, FAILURE, Failure, FaultsFound, RUNNING, SUCCESS, Trial)

from courier.interface import BATTERY, CloseHatch, Drive, OpenHatch


def run(trial):
    """Tick to the end, half a second after the other; return the result."""
    result = trial.tick()
    while result is RUNNING:
        trial.clock.advance(0.5)
        result = trial.tick()
    return result


class TestLeaves(unittest.TestCase):
    def test_the_level_is_compared_with_the_port(self):
        for percent, result in ("79.5", SUCCESS), ("80", FAILURE), ("{limit}", FAILURE):
            trial = Trial(f'<BatteryAbove percent="{percent}"/>')
            trial.topics.publish(BATTERY, 80.0)
            self.assertEqual(trial.tick(), result)

    def test_it_drives_to_its_place(self):
        trial = Trial('<Carry place="2.5;1"/>')
        self.assertEqual(run(trial), SUCCESS)
        self.assertEqual(trial.gateway.requests, [Drive(2.5, 1.0)])

    def test_a_place_that_is_none_is_a_fault_of_the_file(self):
        with self.assertRaisesRegex(FaultsFound, "Place"):
            Trial('<Carry place="here"/>')

    def test_the_hatch_is_open_for_as_long_as_the_port_says(self):
        trial = Trial('<HandOver seconds="3"/>')
        self.assertEqual(trial.tick(), RUNNING)
        trial.clock.advance(2.9)
        self.assertEqual(trial.tick(), RUNNING)
        self.assertEqual(trial.gateway.requests, [OpenHatch()])
        trial.clock.advance(0.2)
        self.assertEqual(trial.tick(), SUCCESS)
        self.assertEqual(trial.gateway.requests, [OpenHatch(), CloseHatch()])

    def test_a_hatch_that_stays_closed_is_a_failure(self):
        trial = Trial("<HandOver/>", answer=lambda request: Failure(Cause.REFUSED, "jammed"))
        self.assertEqual(trial.tick(), FAILURE)
        self.assertEqual(trial.gateway.requests, [OpenHatch()])

    def test_a_recovery_does_all_of_it_again(self):
        answers = iter([Answer(), Failure(Cause.REFUSED, "jammed"), Answer(), Answer()])
        trial = Trial('<Fallback><HandOver seconds="3"/><HandleFallBack/></Fallback>',
                      answer=lambda request: next(answers))
        self.assertEqual(run(trial), SUCCESS)
        self.assertEqual(trial.gateway.requests, [OpenHatch(), CloseHatch()] * 2)


if __name__ == "__main__":
    unittest.main()
