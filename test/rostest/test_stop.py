#!/usr/bin/env python3
"""Does the node stop within two seconds, whatever it is doing, and leave the robot in the safe
state once?"""
import os
import re
import signal
import subprocess
import sys
import time

import rosgraph
import rostest

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from robot import NodeCase, mission_starts, start_master  # noqa: E402

ATTENTION, ANIMATION = "/overtAttention/set_mode", "/animateBehaviour/set_activation"
SAY, DRIVE = "/textToSpeech/say_text", "/robotNavigation/set_goal"
LIMIT = 2.0


class TestStop(NodeCase):
    """Each case runs its own mission up to a certain moment."""

    def assert_safe_state_once(self, robot):
        """Expect that the last two requests, and no others, switched attention and animation off.
        """
        off = [request["service"] for request in robot.requests() if request["fields"].get("state")
               == "disabled"]
        self.assertEqual(sorted(off), sorted([ATTENTION, ANIMATION]))
        self.assertEqual(sorted(request["service"] for request in robot.requests()[-2:]),
                         sorted(off))

    def test_while_a_service_call_hangs(self):
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGQUIT):
            robot, controller = self.start("<WelcomeSpeech/>", {SAY: "hang"})
            robot.wait_for_request(SAY, 20)
            code, seconds = controller.stop(number)
            print("stopped by {} in a hung call: {:.2f} s".format(number.name, seconds))
            self.assertLess(seconds, LIMIT)
            self.assertEqual(code, 0)
            self.assert_safe_state_once(robot)
            self.assertNotIn("Traceback", controller.lines.text())

    def test_while_it_drives(self):
        robot, controller = self.start("<LookUpHome/><Navigate/>", {DRIVE: "hang"})
        robot.wait_for_request(DRIVE, 20)
        self.assertLess(controller.stop()[1], LIMIT)
        self.assert_safe_state_once(robot)

    def test_while_it_waits_for_a_visitor(self):
        robot, controller = self.start(
            "<ReactiveFallback><IsVisitorDiscovered/><Sleep msec=\"600000\"/>"
            "</ReactiveFallback>")
        controller.lines.wait_for(lambda line: mission_starts() in line, 20)
        code, seconds = controller.stop()
        print("stopped while waiting for a visitor: {:.2f} s".format(seconds))
        self.assertLess(seconds, LIMIT)
        self.assert_safe_state_once(robot)

    def test_when_the_services_of_the_safe_state_hang_too(self):
        robot, controller = self.start("<WelcomeSpeech/>",
                                       {SAY: "hang", ATTENTION: "hang", ANIMATION: "hang"})
        robot.wait_for_request(SAY, 20)
        code, seconds = controller.stop()
        print("stopped with everything hung: {:.2f} s".format(seconds))
        self.assertLess(seconds, LIMIT)
        self.assert_safe_state_once(robot)
        self.assertIn(ATTENTION, controller.lines.text())

    def test_when_the_robot_has_frozen(self):
        robot, controller = self.start("<WelcomeSpeech/>", {SAY: "hang"})
        robot.wait_for_request(SAY, 20)
        robot.process.send_signal(signal.SIGSTOP)
        code, seconds = controller.stop()
        robot.process.send_signal(signal.SIGCONT)
        self.assertLess(seconds, LIMIT)
        self.assertNotIn("Traceback", controller.lines.text())

    def test_when_the_robot_has_died(self):
        robot, controller = self.start("<WelcomeSpeech/><Sleep msec=\"600000\"/>")
        robot.wait_for_request(SAY, 20)
        robot.kill()
        code, seconds = controller.stop()
        self.assertLess(seconds, LIMIT)
        self.assertTrue([line for _, line in controller.lines.all if ATTENTION in line
                         and ANIMATION in line], controller.lines.text())
        self.assertNotIn("Traceback", controller.lines.text())

    def test_at_any_moment_of_its_start(self):
        for delay in (0.0, 0.1, 0.2, 0.3, 0.5, 0.8):
            robot, controller = self.start("<WelcomeSpeech/>", {SAY: "hang"})
            time.sleep(delay)
            self.assertLess(self.interrupt(controller), LIMIT, "after {} s".format(delay))
            # Python itself has a traceback for a signal before the first line of ours, "line 0"
            frame = 'File "{}[^"]*", line [1-9]'.format(re.escape(self.package.path("src")))
            self.assertNotRegex(controller.lines.text(), frame)

    def interrupt(self, controller):
        """Stop it, and return the seconds that it took; Python can swallow a signal before the
        first line of ours."""
        sent = time.monotonic()
        controller.process.send_signal(signal.SIGINT)
        try:
            controller.lines.wait_for(lambda line: "KeyboardInterrupt" in line, 10)
        except AssertionError:  # it has ended without
            controller.wait(10)
            return time.monotonic() - sent
        return controller.stop()[1]

    def test_a_second_signal_changes_nothing(self):
        robot, controller = self.start("<WelcomeSpeech/>", {SAY: "hang"})
        robot.wait_for_request(SAY, 20)
        controller.process.send_signal(signal.SIGINT)
        controller.process.send_signal(signal.SIGTERM)
        self.assertLess(controller.stop()[1], LIMIT)
        self.assert_safe_state_once(robot)
        self.assertNotIn("Traceback", controller.lines.text())

    def test_rosnode_kill_stops_it_in_good_order(self):
        robot, controller = self.start("<WelcomeSpeech/>", {SAY: "hang"})
        robot.wait_for_request(SAY, 20)
        killed = time.monotonic()
        subprocess.check_call(["rosnode", "kill", "/behaviorController"], stdout=subprocess.DEVNULL)
        self.assertEqual(controller.wait(10), 0)
        # of which starting rosnode takes a part
        self.assertLess(time.monotonic() - killed, LIMIT + 1.0)
        self.assert_safe_state_once(robot)

    def test_the_master_forgets_it(self):
        robot, controller = self.start("<WelcomeSpeech/>", {SAY: "hang"})
        robot.wait_for_request(SAY, 20)
        controller.stop()
        state = rosgraph.Master("/test").getSystemState()
        nodes = [node for entries in state for _, names in entries for node in names]
        self.assertIn("/commanded_robot", nodes)
        self.assertNotIn("/behaviorController", nodes)

    def test_with_nobody_who_reads_what_it_writes(self):
        mission = ("<Repeat num_cycles=\"-1\"><Sequence><WelcomeSpeech/><Sleep "
                   "msec=\"1\"/></Sequence></Repeat>")
        robot, controller = self.start(mission, verboseMode="true")
        robot.wait_for_request(SAY, 20)
        controller.process.stdout.close()
        count = len(robot.requests(SAY))
        robot.lines.wait_for(lambda line: len(robot.requests(SAY)) > count + 20, 10)
        controller.process.send_signal(signal.SIGINT)
        self.assertEqual(controller.process.wait(LIMIT), 0)
        self.assert_safe_state_once(robot)

    def test_when_the_master_has_died(self):
        self.addCleanup(os.environ.update, ROS_MASTER_URI=os.environ["ROS_MASTER_URI"])
        master = start_master()
        self.addCleanup(master.wait)
        self.addCleanup(master.kill)
        robot, controller = self.start("<WelcomeSpeech/>", {SAY: "hang"})
        robot.wait_for_request(SAY, 20)
        master.kill()
        master.wait()
        code, seconds = controller.stop()
        print("stopped without a master: {:.2f} s".format(seconds))
        self.assertLess(seconds, LIMIT)
        self.assertNotIn("Traceback", controller.lines.text())


if __name__ == "__main__":
    rostest.rosrun("cssr_system", "stop", TestStop)
