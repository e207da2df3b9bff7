#!/usr/bin/env python3
"""Runs the soak in its short form: each call of the lab tour meets one kind of fault, some meet
two, some stop there."""
import os
import sys
import unittest

import rospy
import rostest

sys.path.insert(0, os.path.join(os.path.dirname(os.path.dirname(os.path.abspath(__file__))),
                                "soak"))
import soak  # noqa: E402


class TestSoak(unittest.TestCase):
    """A case for each plan; what ran is printed."""

    def run_plan(self, name):
        self.assertEqual("\n".join(soak.run([name], short=True, seed=1)), "")

    def test_every_call_meets_a_fault(self):
        self.run_plan("sweep")

    def test_two_faults_in_one_tour(self):
        self.run_plan("pairs")

    def test_calls_that_fail_at_random(self):
        self.run_plan("rates")

    def test_a_signal_during_a_call(self):
        self.run_plan("stops")


if __name__ == "__main__":
    rospy.init_node("test_soak", disable_signals=True)
    rostest.rosrun("cssr_system", "soak", TestSoak)
