#!/usr/bin/env python3
"""Does a launch leave nothing behind on a running master, and ignore what was left there before?"""
import os
import re
import signal
import subprocess
import sys

import rospy
import rostest

from launched import LIMIT, Launched

STARTS = " starts, "  # in the sentence about a mission that has started
PATIENT = "startupTimeout:=90"  # ten processes start at once, perhaps on a busy machine
QUICK = ("scenario:=declines", "failureRate:=0", "arrivalRate:=3000", "callTimes:=none", PATIENT)


class TestLivingMaster(Launched):
    """Every case has the master of this test."""

    def setUp(self):
        super().setUp()
        self.report = os.path.join(self.home, "report.dat")
        self.before = set(self.master.getParamNames())
        self.addCleanup(self.forget_dead_nodes)

    def forget_dead_nodes(self):
        """Have the master forget the nodes that were killed.

        At the next node of such a name it would ask the dead one to end, at an address that another
        may have by then.
        """
        subprocess.run(["rosnode", "cleanup"], input="y\n", universal_newlines=True,
                       stdout=subprocess.DEVNULL, timeout=LIMIT, check=True)

    def launch(self, *arguments):
        return self.start("roslaunch", "unit_tests", "behaviorControllerTest.launch",
                          "outputFile:=" + self.report, *arguments)

    def run_launch(self, *arguments):
        """Return what a launch printed, and the title of its report."""
        self.launch(*arguments).wait(LIMIT)
        with open(self.report) as file:
            return self.printed(), file.readline()

    def left_behind(self):
        """Return the parameters on the master that were not there before, except roslaunch's own.
        """
        return {
            name for name in set(self.master.getParamNames()) - self.before
            if not name.startswith(("/roslaunch/uris/", "/rosdistro", "/rosversion", "/run_id"))}

    def assert_runs_as_configured(self):
        """Expect a plain rosrun, which finds no robot here, to have read the configuration file
        alone."""
        code, printed = self.run_to_end("rosrun", "cssr_system", "behaviorController")
        self.assertEqual(code, 1, printed)
        self.assertIn(
            "data/lab_tour.xml: 222 nodes; language English; speech recognition on; verbose mode "
            "off", printed)
        self.assertNotIn("override", printed)

    def test_arguments_count_for_their_own_launch_alone(self):
        printed, title = self.run_launch("asrEnabled:=false", "mutualGazeValue:=2", "seed:=5",
                                         "verbose:=true", "speed:=10", *QUICK)
        self.assertIn("\nPASSED: ", printed)
        self.assertRegex(title, "randomSeed 5; callTimes none; asrEnabled false; "
                                "mutualGazeValue 2; speed 10$")
        self.assertNotIn("REQUIRED", printed)
        self.assertEqual(self.left_behind(), set())
        printed, title = self.run_launch(*QUICK)
        self.assertIn("\nPASSED: ", printed)
        self.assertRegex(title, "arrivalRate 3000; randomSeed [0-9]+; callTimes none$")
        self.assertNotRegex(title, r"randomSeed 5\b")
        self.assert_runs_as_configured()

    def test_what_stands_on_the_master_does_not_count_in_a_test(self):
        for name, value in (("/behaviorController/asrEnabled",
                             False), ("/unit_tests/visitorBehaviour", "silent"),
                            ("/unit_tests/folder", "/nowhere"), ("/textToSpeech/failureRate", 1)):
            self.master.setParam(name, value)
        self.addCleanup(self.master.deleteParam, "/unit_tests")
        self.addCleanup(self.master.deleteParam, "/textToSpeech")
        printed, title = self.run_launch(*QUICK)
        self.assertIn("\nPASSED: ", printed)
        self.assertRegex(
            title, "visitorBehaviour declines; failureRate 0; arrivalRate 3000; "
            "randomSeed [0-9]+; callTimes none$")

    def test_a_launch_that_is_killed_leaves_nothing_that_counts(self):
        process = self.launch("asrEnabled:=false", "language:=Kinyarwanda", *QUICK)
        self.addCleanup(self.kill_nodes)
        self.wait_for(STARTS)
        process.kill()
        process.wait()
        self.kill_nodes()
        self.assertEqual(self.left_behind(), set())
        self.assert_runs_as_configured()

    def test_a_test_that_is_stopped_takes_its_nodes_along_and_says_so_last(self):
        process = self.start("rosrun", "unit_tests", "runTest", "outputFile:=" + self.report,
                             "scenario:=silent", *QUICK[1:])
        self.addCleanup(self.kill_nodes)
        self.wait_for(STARTS)
        process.send_signal(signal.SIGINT)
        self.assertEqual(process.wait(LIMIT), 1)
        self.assertEqual(self.printed().splitlines()[-2],
                         "FAILED: the test was stopped before the mission had ended")
        for pid in self.started():
            self.assertRaises(ProcessLookupError, os.kill, pid, 0)

    def started(self):
        """Return the processes that a roslaunch has reported."""
        return [int(pid) for pid in re.findall(r"started with pid \[(\d+)\]", self.printed())]

    def kill_nodes(self):
        """Kill what a roslaunch has started."""
        for pid in self.started():
            try:
                os.killpg(pid, signal.SIGKILL)
            except ProcessLookupError:
                pass

    def test_an_unknown_argument_of_roslaunch_is_told_and_nothing_is_tested(self):
        code, printed = self.run_to_end("roslaunch", "unit_tests", "behaviorControllerTest.launch",
                                        "failurRate:=0.9", "outputFile:=" + self.report)
        self.assertRegex(printed, r"\nargument failurRate:=0.9: .* failureRate\?")
        self.assertNotIn("PASSED", printed)
        self.assertNotIn(STARTS, printed)
        self.assertFalse(os.path.exists(self.report))
        # roslaunch ends what has just begun: a signal may meet catkin's relay before our first line
        self.assertNotRegex(printed, 'File ".*/(nodes|src)/.*line')


if __name__ == "__main__":
    rospy.init_node("test_living_master")
    rostest.rosrun("unit_tests", "living_master", TestLivingMaster, sys.argv)
