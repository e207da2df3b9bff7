#!/usr/bin/env python3
"""Does a test go by a simulated time, and is its verdict that of a test in the computer's time?"""
import os
import sys
import threading

import rosgraph
import rospy
import rostest
from cssr_system.msg import overtAttentionMessage

from behavior_controller.config import settings
from behavior_controller.run.events import Line
from behavior_controller.run.history import Run
from behavior_controller.simulation import configuration
from behavior_controller.simulation.rehearsal.play import LoadedMission
from unit_tests.judge.facts import speeds

from whole_test import NOT_RUN, PASSED, WholeTest, run_test, run_tests, story
from simulator import Simulator  # of test/rostest, whose path whole_test adds

SEED = ("scenarioSpecification:=lab_tour", "callTimes:=real", "arrivalRate:=600", "randomSeed:=3")
DECLINES = (*SEED, "failureRate:=0", "visitorBehaviour:=declines")


def played(behaviour, **given):
    """Return the run of the same visit in virtual time."""
    stage = LoadedMission(settings.defaults(scenarioSpecification="lab_tour"))
    result = stage.play(configuration.defaults(
        visitorBehaviour=behaviour, callTimes="real", arrivalRate=600.0, randomSeed=3, **given))
    return Run(Line(*moment) for moment in result.events)


def seconds(run):
    """Return how long the first visit takes, with the wait for the visitor."""
    return run.visits[0].seconds + run.visits[0].waited


class TestClocks(WholeTest):
    """Each case runs the whole test on the master of this one."""

    def setUp(self):
        self.master = rosgraph.Master("/test")
        self.addCleanup(self.forget)

    def forget(self):
        if self.master.hasParam("/use_sim_time"):
            self.master.deleteParam("/use_sim_time")

    def run_here(self, *arguments):
        return run_test(*DECLINES, *arguments, ROS_MASTER_URI=os.environ["ROS_MASTER_URI"])

    def simulator(self):
        simulator = Simulator("/clock", 10.0)
        self.addCleanup(simulator.stop)
        self.master.setParam("/use_sim_time", True)
        return simulator

    def test_a_clock_of_its_own_is_gone_with_the_test(self):
        result = self.run_here("speed:=10")
        self.assert_passed(result, "SUCCESS")
        self.assertRegex(result.report[0], "; speed 10$")
        self.assertLess(abs(seconds(result.run) - seconds(played("declines"))), 12.0)
        reached, _ = speeds(result.run.lines)
        self.assertTrue(3.0 < reached < 10.5, reached)
        self.assertFalse(self.master.hasParam("/use_sim_time"))

    def test_the_clock_of_another_node_is_left_alone(self):
        self.simulator()
        self.master.deleteParam("/use_sim_time")
        result = self.run_here("speed:=10")
        self.assertEqual(result.code, NOT_RUN, result.printed)
        self.assertRegex(result.printed, "node /speed: it already has /clock on machine .*"
                         "without speed the test goes by that clock")
        self.assertFalse(self.master.hasParam("/use_sim_time"))

    def test_the_clock_of_a_simulator_may_jump_back(self):
        simulator, has_jumped = self.simulator(), threading.Event()

        def jump(message):
            if message.state == "seeking" and not has_jumped.is_set():
                has_jumped.set()
                simulator.jump(-1000.0)

        attention = rospy.Subscriber("/overtAttention/mode", overtAttentionMessage, jump)
        self.addCleanup(attention.unregister)
        result = self.run_here("missionRuns:=2")
        self.assertEqual(result.code, PASSED, result.printed)
        self.assertEqual([visit.outcome for visit in result.run.visits], ["FAILURE", "SUCCESS"])
        self.assertRegex(result.report[-1], r"pass 1 ended early, as it had to: simulated time "
                         r"jumped back by (1000|9\d\d\.\d+) s")
        self.assertTrue(self.master.getParam("/use_sim_time"), "it is the simulator's")


class TestSpeeds(WholeTest):
    """Each case runs the whole test several times."""

    def test_the_tour_has_the_proportions_of_a_robot(self):
        wanted = seconds(played("engages", failureRate=0.1))
        result = run_test(*SEED, "failureRate:=0.1", "speed:=20")
        self.assert_passed(result, "SUCCESS")
        self.assertLess(abs(seconds(result.run) - wanted), 0.2 * wanted)

    def test_the_verdict_is_that_of_the_computers_time(self):
        kinds = [(*SEED, "visitorBehaviour:=declines", "failureRate:=0.2", "faultKinds:=" + kind)
                 for kind in ("refused", "unanswered")]
        usual = list(run_tests(kinds))  # which wait most of the time
        for (kind, slow), speed in zip(usual, (10, 20)):
            for result in (slow, run_test(*kind, f"speed:={speed}")):
                self.assertEqual(result.code, PASSED, result.printed)
                self.assertEqual(story(result.run), story(slow.run))


if __name__ == "__main__":
    rospy.init_node("test_speed", disable_rostime=True)
    rostest.rosrun("unit_tests", "speed", "__main__." + sys.argv[1], sys.argv)
