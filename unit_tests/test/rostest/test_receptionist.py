#!/usr/bin/env python3
"""Does each visitor of the example's receptionist get the right visit, by voice and on the tablet,
and with faults?"""
import os
import sys
from concurrent.futures import ThreadPoolExecutor

import rospy
import rostest

from whole_test import HERE, WholeTest, run_test

EXAMPLE = os.path.join(HERE, "../../../examples/receptionist")
PATHS = {name: os.pathsep.join([folder, os.environ.get(name, "")])
         for name, folder in (("ROS_PACKAGE_PATH", EXAMPLE),
                              ("PYTHONPATH", os.path.join(EXAMPLE, "src")))}
VISITS = (("engages", "true"), ("engages", "false"), ("unclear", "true"), ("noGaze", "true"))


def visit(arguments):
    return run_test("scenarioSpecification:=receptionist", "speed:=5", *arguments, **PATHS)


class TestReceptionist(WholeTest):
    """Runs the whole test once for each visit."""

    def test_visitors_by_voice_and_on_the_tablet(self):
        visits = [("failureRate:=0", "asrEnabled:=" + asr, "visitorBehaviour:=" + behaviour)
                  for behaviour, asr in VISITS]
        visits.append(("failureRate:=0", "robotInterface:=release-1.0", "recogniseBy:=action"))
        for arguments, result in self.results(visits):
            self.assert_passed(result, "FAILURE" if "noGaze" in arguments[-1] else "SUCCESS")

    def test_runs_with_faults_are_judged(self):
        visits = [("failureRate:=0.3", "randomSeed:=1"),
                  ("failureRate:=0.3", "randomSeed:=3", "asrEnabled:=false")]
        for _, result in self.results(visits):
            self.assertEqual(result.code, 0, "\n".join(result.report) or result.printed)

    def results(self, visits):
        """Run two at a time; yield the arguments and the result of each."""
        with ThreadPoolExecutor(2) as pool:
            for arguments, result in zip(visits, pool.map(visit, visits)):
                print(*arguments, "\n".join(result.report[:2]))
                yield arguments, result


if __name__ == "__main__":
    rospy.init_node("test_receptionist")
    rostest.rosrun("unit_tests", "receptionist", TestReceptionist, sys.argv)
