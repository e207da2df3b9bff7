#!/usr/bin/env python3
"""Does each visitor of the example's receptionist get the right visit, by voice and on the tablet,
and with faults?"""
import os
import sys

import rospy
import rostest

from whole_test import HERE, WholeTest, run_tests

EXAMPLE = os.path.join(HERE, "../../../examples/receptionist")
PATHS = {name: os.pathsep.join([folder, os.environ.get(name, "")]) for name, folder in (
    ("ROS_PACKAGE_PATH", EXAMPLE), ("PYTHONPATH", os.path.join(EXAMPLE, "src")))}
MISSION = ("scenarioSpecification:=receptionist", "speed:=5")
VISITS = (("engages", "true"), ("engages", "false"), ("unclear", "true"), ("noGaze", "true"))


class TestReceptionist(WholeTest):
    """Runs the whole test once for each visit."""

    def test_visitors_by_voice_and_on_the_tablet(self):
        healthy = (*MISSION, "failureRate:=0")
        visits = [(*healthy, "asrEnabled:=" + asr, "visitorBehaviour:=" + behaviour)
                  for behaviour, asr in VISITS]
        visits.append((*healthy, "robotInterface:=release-1.0", "recogniseBy:=action"))
        for arguments, result in run_tests(visits, **PATHS):
            self.assert_passed(result, "FAILURE" if "noGaze" in arguments[-1] else "SUCCESS")

    def test_runs_with_faults_are_judged(self):
        faulty = (*MISSION, "failureRate:=0.3")
        for _, result in run_tests([(*faulty, "randomSeed:=1"), (
                *faulty, "randomSeed:=3", "asrEnabled:=false")], **PATHS):
            self.assertEqual(result.code, 0, "\n".join(result.report) or result.printed)


if __name__ == "__main__":
    rospy.init_node("test_receptionist")
    rostest.rosrun("unit_tests", "receptionist", TestReceptionist, sys.argv)
