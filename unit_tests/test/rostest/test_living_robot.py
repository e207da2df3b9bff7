#!/usr/bin/env python3
"""Does a test leave the living nodes of a robot alone, before it starts and while it runs?"""
import glob
import os
import re
import signal
import subprocess
import sys

import rospy
import rostest

from first_message import wait_for_first_message
from launched import LIMIT, Launched, USUAL

GOAL = "/robotNavigation/set_goal"
NAVIGATION = ("robotNavigation", GOAL)
TEST = ("rosrun", "unit_tests", "runTest")
# ten processes start at once, perhaps on a busy machine
QUICK = ("scenario:=declines", "failureRate:=0", "startupTimeout:=90", *USUAL)
WAITS = ("scenario:=silent",) + QUICK[1:]
STAND_IN = os.path.join(os.path.dirname(os.path.abspath(__file__)), "stand_in.py")


class LivingRobot(Launched):
    """A test case with stand-ins for nodes of a robot."""

    def setUp(self):
        super().setUp()
        self.addCleanup(self.kill_leftovers)

    def kill_leftovers(self):
        """End the nodes that a roslaunch leaves if it is stopped while it starts them: the next
        case must not meet them."""
        for path in glob.glob("/proc/[0-9]*/environ"):
            try:
                with open(path, "rb") as file:
                    is_ours = "ROS_HOME={}".format(self.home).encode() in file.read().split(b"\0")
                if is_ours:
                    os.kill(int(path.split("/")[2]), signal.SIGKILL)
            except OSError:
                pass  # it ended meanwhile

    # ------------------------------------------------------------------------------- what it starts

    def prepare(self, *arguments):
        """Return a stand-in for a real node that registers at a line on its input."""
        node = subprocess.Popen((sys.executable, STAND_IN) + arguments, env=self.environment,
                                stdin=subprocess.PIPE, stdout=subprocess.PIPE,
                                universal_newlines=True, bufsize=1)
        for end in (node.stdin.close, node.stdout.close, lambda: node.wait(LIMIT), node.terminate):
            self.addCleanup(end)
        return node

    def stand_in(self, *arguments):
        """Return a stand-in that has registered."""
        return self.register(self.prepare(*arguments))

    def register(self, node):
        node.stdin.write("\n")
        self.assertEqual(node.stdout.readline(), "ready\n")
        return node

    def start_robot(self):
        """Start a simulated robot to its last node: a roslaunch that is ended before may leave
        nodes behind."""
        self.start("roslaunch", "unit_tests", "simulatedRobot.launch")
        rospy.wait_for_service(GOAL, LIMIT)
        wait_for_first_message("/faceDetection/data", LIMIT)

    # ------------------------------------------------------------------------------ what it expects

    def place(self, node, name):
        """Return how a line names a stand-in: its name, its machine and its process."""
        machine = re.match("http://(.*):", self.master.lookupNode(name)).group(1)
        return name, " " + machine + ",", " {} ".format(node.pid)


class TestBeforeItStarts(LivingRobot):
    """What lives already stays, and the test says so and starts nothing."""

    def registered(self):
        """Return the addresses of all nodes at the master but the logger's."""
        state = self.master.getSystemState()
        nodes = {node for part in state for _, holders in part for node in holders} - {"/rosout"}
        return {node: self.master.lookupNode(node) for node in nodes}

    def assert_refuses(self, command, place, argument):
        """Expect one line about a node at ``place``, and nothing to have changed."""
        before = self.registered()
        code, printed = self.run_to_end(*command)
        lines = [line for line in printed.splitlines() if line.startswith("node /")]
        self.assertEqual(len(lines), 1, printed)
        for part in place + (argument,):
            self.assertIn(part, lines[0])
        self.assertEqual(self.registered(), before)
        self.assertNotIn("Traceback", printed)
        self.assertNotIn("PASSED", printed)
        return code

    def test_a_living_node_is_named_and_stays(self):
        self.master.setParam("/behaviorController/asrEnabled", False)
        self.addCleanup(self.master.deleteParam, "/behaviorController")
        node = self.stand_in(*NAVIGATION)
        place = self.place(node, "/robotNavigation")
        for command in (TEST, ("roslaunch", "unit_tests", "behaviorControllerTest.launch"),
                        ("roslaunch", "unit_tests",
                         "simulatedRobot.launch"), ("rosrun", "unit_tests", "robotNavigation")):
            code = self.assert_refuses(command, place, "use_real_robotNavigation:=true")
            self.assertEqual(code, 0 if "roslaunch" in command else 2)
        self.assertIsNone(node.poll())
        self.assertFalse(self.master.getParam("/behaviorController/asrEnabled"))

    def test_a_part_of_a_node_counts_too(self):
        for name, resource, node in (("nav_stack", GOAL, "robotNavigation"),
                                     ("recogniser", "/speechEvent/text", "speechEvent")):
            living = self.stand_in(name, resource)
            self.assert_refuses(TEST, self.place(living, "/" + name) + (resource,),
                                "use_real_{}:=true".format(node))
            living.terminate()
            living.wait(LIMIT)

    def test_a_node_that_is_frozen_is_not_displaced(self):
        node = self.stand_in("nav_stack", GOAL)
        machine = self.place(node, "/nav_stack")[1]
        node.send_signal(signal.SIGSTOP)
        self.addCleanup(node.send_signal, signal.SIGCONT)
        self.assert_refuses(TEST, ("/nav_stack", machine, "does not answer"),
                            "use_real_robotNavigation:=true")

    def test_a_living_mission_is_not_displaced(self):
        controller = self.stand_in("behaviorController")
        self.assertEqual(self.assert_refuses(TEST, self.place(controller, "/behaviorController"),
                                             "ROS_MASTER_URI"), 2)
        self.start_robot()  # for it
        self.assertIsNone(controller.poll())

    def test_a_real_node_takes_part_and_what_dead_ones_left_is_in_nobodys_way(self):
        for arguments in (("nav_stack", "/gestureExecution/perform_gesture"),
                          ("behaviorController", ), ("recogniser", "/speechEvent/text")):
            dead = self.stand_in(*arguments)
            dead.kill()
            dead.wait(LIMIT)
        self.assertIn("/behaviorController", self.registered())
        node = self.stand_in(*NAVIGATION)
        code, printed = self.run_to_end(*TEST, "use_real_robotNavigation:=true", *QUICK)
        self.assertEqual(code, 0, printed)
        self.assertIsNone(node.poll())


class TestWhileItRuns(LivingRobot):
    """What comes into the test stays, and ends it."""

    def assert_fails_because_of(self, process, place):
        """Expect a verdict whose first line names what came into the test, and that it stayed."""
        self.assertEqual(process.wait(LIMIT), 1, self.printed())
        verdict = self.printed()[self.printed().rindex("FAILED: "):].splitlines()[0]
        for part in place:
            self.assertIn(part.strip(), verdict)

    def test_a_node_that_is_replaced_ends_the_test(self):
        for arguments in (("nav_stack", GOAL), ("recogniser", "/speechEvent/text"),
                          ("behaviorController", )):
            node = self.prepare(*arguments)
            process = self.start(*TEST, *WAITS)
            self.wait_for(" starts, ")
            place = self.place(self.register(node), "/" + arguments[0])
            self.assert_fails_because_of(process, place)
            self.assertIsNone(node.poll())
            self.assertEqual(self.place(node, "/" + arguments[0]), place, "it kept its name")
            node.terminate()
            node.wait(LIMIT)

    def test_a_replacement_that_is_gone_again_is_noticed(self):
        node = self.prepare(*NAVIGATION)
        process = self.start(*TEST, *WAITS)
        self.wait_for(" starts, ")
        self.register(node)
        node.kill()
        self.assert_fails_because_of(process, ("/robotNavigation", "replaced"))

    def test_a_name_that_is_taken_after_a_crash_is_noticed(self):
        node = self.prepare("animateBehavior")
        process = self.start(*TEST, *WAITS, "plannedFaults:=animateBehavior:1:crash")
        self.wait_for("animateBehavior.* process has died")
        self.assert_fails_because_of(process, self.place(self.register(node), "/animateBehavior"))
        self.assertIsNone(node.poll())

    def test_a_node_of_the_simulated_robot_makes_room_once(self):
        node = self.prepare(*NAVIGATION)
        self.start_robot()
        place = self.place(self.register(node), "/robotNavigation")
        self.wait_for("node /robotNavigation: ")
        self.assertEqual(self.place(node, "/robotNavigation"), place)
        self.assertIsNone(node.poll())
        self.assertNotIn("killing on exit", self.printed())


if __name__ == "__main__":
    rospy.init_node("test_living_robot")
    rostest.rosrun("unit_tests", "living_robot", "__main__." + sys.argv[1], sys.argv)
