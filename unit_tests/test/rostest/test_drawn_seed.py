#!/usr/bin/env python3
"""Do the simulated nodes share the random seed if none is given?"""
import sys
import unittest
from xmlrpc.client import ServerProxy

import rosgraph
import rospy
import rostest
from cssr_system.srv import knowledgeBaseService, textService

from behavior_controller.config.settings import split_arguments
from behavior_controller.simulation.faults import Faults

from unit_tests.robot.options import DRAWN

CALLS = 30
LIMIT = 20.0  # seconds for a node to start


class TestDrawnSeed(unittest.TestCase):
    """Calls nodes whose calls fail in one of two cases, as the seed says."""

    def refusals(self, service, service_type, text):
        rospy.wait_for_service(service, LIMIT)
        call = rospy.ServiceProxy(service, service_type, persistent=True)
        return [not call(text).success for _ in range(CALLS)]

    def drawn(self, node):
        """Return the seed that roslaunch gave to a node."""
        with open("/proc/{}/cmdline".format(node_pid("/" + node))) as file:
            return int(split_arguments(file.read().split("\0"))[1][DRAWN])

    def predicted(self, node):
        faults = Faults(0.5, "{}/{}/faults".format(self.drawn(node), node))
        return [faults.next() is not None for _ in range(CALLS)]

    def test_calls_fail_as_the_drawn_seed_says(self):
        self.assertEqual(self.refusals("/textToSpeech/say_text", textService, "Hello"),
                         self.predicted("textToSpeech"))
        self.assertEqual(self.refusals("/knowledgeBase/query", knowledgeBaseService, "home"),
                         self.predicted("knowledgeBase"))

        self.assertEqual(self.drawn("textToSpeech"), self.drawn("knowledgeBase"))


def node_pid(name):
    """Return the process id that a node reports."""
    return ServerProxy(rosgraph.Master("/test").lookupNode(name)).getPid("/test")[2]


if __name__ == "__main__":
    rospy.init_node("test_drawn_seed")
    rostest.rosrun("unit_tests", "drawn_seed", TestDrawnSeed, sys.argv)
