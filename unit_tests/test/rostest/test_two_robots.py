#!/usr/bin/env python3
"""Do two robots under one master have a tour each, and one controller each?"""
import glob
import json
import os
import re
import sys

import rostest

from launched import LIMIT, Launched

HERE = os.path.dirname(os.path.realpath(__file__))
sys.path.append(os.path.join(HERE, "../../../test/rostest"))
from free_ports import free_port  # noqa: E402

ROBOTS = ("robot1", "robot2")
COMMON = {"/rosout", "/test"}
"""The nodes that are of no robot."""


class TestTwoRobots(Launched):
    """Two tests side by side."""

    def setUp(self):
        super().setUp()
        port = free_port(5)
        self.ports = ["monitorPort:={}".format(port), "groot2Port:={}".format(port + 1)]

    def nodes(self):
        """Return the names of all nodes that offer or use anything."""
        return {node for part in self.master.getSystemState() for _, nodes in part
                for node in nodes} - COMMON

    def test_two_tours_side_by_side_and_no_further_controller(self):
        tests = {robot: self.start(
            "rosrun", "unit_tests", "runTest", "robot:=" + robot, "callTimes:=none",
            "failureRate:=0", "arrivalRate:=120", "startupTimeout:=90",
            "scenarioSpecification:=lab_tour", *self.ports, name=robot,
            ROS_TEST_RESULTS_DIR=os.path.join(self.home, robot)) for robot in ROBOTS}
        for robot in ROBOTS:
            self.wait_for(" starts, ", robot)
        refused = self.start("rosrun", "cssr_system", "behaviorController", "_robot:=robot1",
                             "__name:=other", "_monitorPort:=0", "_groot2Port:=0", name="other")
        self.assertEqual({node.split("/")[1] for node in self.nodes()}, set(ROBOTS))
        self.assertEqual(refused.wait(LIMIT), 1, self.printed("other"))
        self.assertIn("node /robot1/behaviorController already controls this robot",
                      self.printed("other"))
        for robot, test in tests.items():
            self.assertEqual(test.wait(LIMIT), 0, self.printed(robot))
            self.assert_is_of(robot)
        pages = [re.search(r"page: (http://\S+)", self.printed(robot)).group(1) for robot in ROBOTS]
        self.assertNotEqual(*pages)

    def assert_is_of(self, robot):
        """Expect a verdict, a report, a record and a journal of that robot alone."""
        printed = self.printed(robot)
        self.assertIn("\nPASSED: ", printed)
        self.assertIn("behaviorControllerTestOutput_{}.dat".format(robot), printed)
        folder = re.search("its folder, with record and journal: (.*)", printed).group(1)
        with open(os.path.join(folder, "journal.jsonl")) as file:
            resources = {json.loads(line)["resource"] for line in file}
        self.assertEqual({name.split("/")[1] for name in resources}, {robot})
        self.assertIn("/{}/textToSpeech/say_text".format(robot), resources)
        record, = glob.glob(os.path.join(folder, "*_{}".format(robot), "mission.jsonl"))
        with open(record) as file:
            asked = re.findall(r'"service":"/(\w+)/', file.read())
        self.assertEqual(set(asked), {robot})


if __name__ == "__main__":
    rostest.rosrun("unit_tests", "two_robots", TestTwoRobots)
