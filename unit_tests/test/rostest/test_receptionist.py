#!/usr/bin/env python3
"""Do visitors of the example's receptionist get the right visit, by voice, on the tablet, and with
faults?"""
import os
import sys

import rospy
import rostest

from whole_test import HERE, WholeTest, run_test

EXAMPLE = os.path.join(HERE, "../../../examples/receptionist")
PATHS = {name: os.pathsep.join([folder, os.environ.get(name, "")]) for name, folder in (
    ("ROS_PACKAGE_PATH", EXAMPLE), ("PYTHONPATH", os.path.join(EXAMPLE, "src")))}
MISSION = ("scenarioSpecification:=receptionist", "speed:=5")


class TestReceptionist(WholeTest):
    """Each case runs the whole test."""

    def test_a_visitor_by_voice(self):
        self.assert_passed(run_test(*MISSION, "failureRate:=0", **PATHS), "SUCCESS")

    def test_a_visitor_of_a_robot_of_release_1_0(self):
        result = run_test(*MISSION, "failureRate:=0", "robotInterface:=release-1.0",
                          "recogniseBy:=action", **PATHS)
        self.assert_passed(result, "SUCCESS")

    def test_a_visit_with_faults_on_the_tablet_is_judged(self):
        result = run_test(*MISSION, "failureRate:=0.3", "randomSeed:=3", "asrEnabled:=false",
                          **PATHS)
        self.assertEqual(result.code, 0, "\n".join(result.report) or result.printed)


if __name__ == "__main__":
    rospy.init_node("test_receptionist")
    rostest.rosrun("unit_tests", "receptionist", TestReceptionist, sys.argv)
