#!/usr/bin/env python3
"""Do ROS tools see the run, and can an operator start, pause, reload and stop it by services, also
while others flood them or hang?"""
import contextlib
import json
import os
import socket
import sys
import threading
import time
from urllib.parse import urlsplit

import rosgraph
import rospy
import rostest
from diagnostic_msgs.msg import DiagnosticArray
from std_msgs.msg import String
from std_srvs.srv import Trigger

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from robot import BUSY, NodeCase, robot_for  # noqa: E402

NODE = "/behaviorController"
DRIVE, SAY = "/robotNavigation/set_goal", "/textToSpeech/say_text"
ATTENTION, ANIMATION = "/overtAttention/set_mode", "/animateBehaviour/set_activation"
MISSION = """<root BTCPP_format="4" main_tree_to_execute="M"><BehaviorTree ID="M"><Sequence>{}
</Sequence></BehaviorTree></root>"""
TOUR = "<SeekOvertAttentionMode/><LookUpHome/><Navigate/><WelcomeSpeech/>"
CALLERS = 8


class Heard:
    """The messages of a topic, to wait for; a failure shows ``lines``, which the node has written.

    To be made before the node starts: rospy may lose a publisher that registers while it
    subscribes, since it takes the master's older answer for the newer one.
    """

    def __init__(self, name, kind, read):
        self.all, self._news, self.lines = [], threading.Condition(), None
        self._subscriber = rospy.Subscriber(name, kind, lambda message: self._take(read(message)))

    def _take(self, value):
        with self._news:
            self.all.append(value)
            self._news.notify_all()

    def wait_for(self, wanted, start=0):
        """Return the first value from number ``start`` on that is ``wanted``."""
        with self._news:
            if not self._news.wait_for(lambda: any(map(wanted, self.all[start:])), BUSY * 10):
                raise AssertionError("the wanted message did not come, only {}\n{}".format(
                    self.all[start:][-5:], self.lines.text()))
            return next(filter(wanted, self.all[start:]))

    def close(self):
        """Hear no more."""
        self._subscriber.unregister()


class TestRosInterface(NodeCase):
    """A node with ``rosInterface``, and the commanded robot."""

    def start(self, mission, **values):
        """Return the robot and the node, which waits for the operator unless ``values`` say
        otherwise."""
        self.package.write("data/m.xml", MISSION.format(mission))
        self.package.configure(**dict(dict(scenarioSpecification="m", rosInterface="true",
                                           startBy="operator"), **values))
        robot = robot_for(self)
        self.now = Heard(NODE + "/state", String, lambda message: json.loads(message.data))
        self.addCleanup(self.now.close)
        self.diagnostics = Heard("/diagnostics", DiagnosticArray,
                                 lambda message: {each.name: each.level for each in message.status})
        self.addCleanup(self.diagnostics.close)
        controller = self.controller()
        self.now.lines = self.diagnostics.lines = controller.lines
        return robot, controller

    def call(self, name):
        """Call a service of the node, and return its response."""
        self.now.wait_for(bool)  # it is there
        return rospy.ServiceProxy(NODE + "/" + name, Trigger)()

    def wait_for_card(self, **fields):
        """Return the first card with these fields from now on, or the last one if it has them."""
        start = max(0, len(self.now.all) - 1)
        return self.now.wait_for(
            lambda now: all(now["card"][key] == fields[key] for key in fields), start)["card"]

    def test_the_mission_waits_for_its_start_and_pauses_when_a_drive_is_over(self):
        robot, controller = self.start(TOUR)
        robot.set_mode(DRIVE, "hang")
        waiting = self.wait_for_card(kind="paused")
        self.assertIn("start", waiting["what"])
        self.assertEqual(waiting["waits_for"], "the operator: rosservice call " + NODE + "/start")
        controller.lines.wait_for(
            lambda line: "to go on, rosservice call {}/start".format(NODE) in line, 10)
        self.assertEqual(robot.requests(), [])
        self.assertTrue(self.call("start").success)
        robot.wait_for_request(DRIVE, 10)
        self.wait_for_card(kind="step")
        self.assertTrue(self.call("pause").success)
        robot.set_mode(DRIVE, "done")  # until now it drives on
        self.assertIn("paused", self.wait_for_card(kind="paused")["what"])
        self.assertEqual(robot.requests(SAY), [])
        self.assertTrue(self.call("start").success)
        robot.wait_for_request(SAY, 10)

    def test_a_stop_reaches_the_safe_state_and_ends_the_node(self):
        robot, controller = self.start(TOUR)
        robot.set_mode(DRIVE, "hang")
        self.call("start")
        robot.wait_for_request(DRIVE, 10)
        began = time.monotonic()
        self.assertTrue(self.call("stop").success)
        self.assertEqual(controller.wait(10), 0)
        self.assertLess(time.monotonic() - began, 2.0 * BUSY)
        robot.wait_for_request(ATTENTION, 10, state="disabled")
        robot.wait_for_request(ANIMATION, 10, state="disabled")
        now = self.now.wait_for(lambda now: now["ended"] and now["robot"]["safe"])
        self.assertIn("may still be driving", now["robot"]["safe"])
        self.assertIn("stopped before a visitor came", now["card"]["what"])
        self.assertEqual(now["last"], "")  # that is no visit
        services = [name for name, _ in rosgraph.Master("/test").getSystemState()[2]]
        self.assertFalse([name for name in services if name.startswith(NODE + "/")])

    def test_a_changed_mission_follows_and_a_broken_one_does_not(self):
        robot, controller = self.start(TOUR)
        self.wait_for_card(kind="paused")
        self.package.write("data/m.xml", MISSION.format("<Navigat/>"))
        self.assertTrue(self.call("reload").success)
        controller.lines.wait_for(lambda line: "refused, the running mission stays" in line, 10)
        self.assertIn("Navigat ", controller.lines.text())
        self.call("start")
        robot.wait_for_request(SAY, 10)  # the old one
        self.package.write("data/m.xml", MISSION.format("<Sleep msec=\"600000\"/>"))
        self.assertTrue(self.call("reload").success)
        controller.lines.wait_for(lambda line: "mission m starts, 0 mission leaves" in line, 20)
        self.wait_for_card(kind="asleep")

    def test_a_flood_of_calls_and_callers_that_hang_do_not_hold_the_mission(self):
        robot, controller = self.start(TOUR, startBy="robot")
        robot.wait_for_request(SAY, 10)
        over, counts = threading.Event(), []
        visits = self.now.wait_for(bool)["count"]

        def flood():
            proxy, count = rospy.ServiceProxy(NODE + "/start", Trigger, persistent=True), 0
            with contextlib.suppress(rospy.ServiceException, rospy.exceptions.TransportException):
                while not over.is_set():
                    proxy()
                    count += 1
            counts.append(count)

        threads = [threading.Thread(target=flood, daemon=True) for _ in range(CALLERS)]
        for thread in threads:
            thread.start()
        address = urlsplit(rosgraph.Master("/test").lookupService(NODE + "/pause"))
        hung = [socket.create_connection((address.hostname, address.port)) for _ in range(CALLERS)]
        self.now.wait_for(lambda now: now["count"] >= visits + 3)
        began = time.monotonic()
        self.assertTrue(self.call("stop").success)
        over.set()
        self.assertEqual(controller.wait(10), 0)
        self.assertLess(time.monotonic() - began, 2.0 * BUSY)
        for connection in hung:
            connection.close()

    def test_a_node_that_dies_shows_in_the_diagnostics(self):
        robot, controller = self.start(TOUR)
        own = "behaviorController: "
        first = self.diagnostics.wait_for(lambda levels: own + "mission" in levels)
        self.assertEqual(set(first.values()), {0})
        self.assertLessEqual({own + name for name in ("recovery", "master", "/textToSpeech")},
                             set(first))
        robot.kill()
        self.diagnostics.wait_for(lambda levels: levels[own + "/textToSpeech"] == 2)

    def test_an_operator_who_cannot_start_is_a_mistake(self):
        _, controller = self.start(TOUR, rosInterface="false")
        self.assertEqual(controller.wait(20), 2)
        self.assertIn("startBy", controller.lines.text())


if __name__ == "__main__":
    rospy.init_node("test_ros_interface")
    rostest.rosrun("cssr_system", "ros_interface", TestRosInterface)
