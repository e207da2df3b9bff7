#!/usr/bin/env python3
"""Is each fault of the robot noticed within two seconds, reported once, and survived while the
mission runs?"""
import os
import signal
import subprocess
import sys
import time

import rosgraph
import rostest

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from behavior_controller.run.events import Recovered  # noqa: E402
from behavior_controller.robot.gateway import Cause, Failure  # noqa: E402
from faulty_master import FaultyMaster  # noqa: E402
from robot import (
    MASTER_IS_GONE,
    MISSION,
    NodeCase,
    forget_dead_entries,
    mission_starts,
    registrations,
    robot_for,
    run_master,
    sentence,  # noqa: E402
    start_master)

SAY, DRIVE, KNOWLEDGE = ("/textToSpeech/say_text", "/robotNavigation/"
                                                   "set_goal", "/knowledgeBase/query")
FACES, ATTENTION, SPEECH = "/faceDetection/data", "/overtAttention/mode", "/speechEvent/text"
LIMIT = 2.0
WAITING = "<ReactiveFallback><IsVisitorDiscovered/><Sleep msec=\"600000\"/></ReactiveFallback>"
TALKING = "<WelcomeSpeech/><Sleep msec=\"300\"/>"


class MonitorCase(NodeCase):
    """Each case runs its own mission."""

    def robot(self, modes=None):
        return robot_for(self, modes)

    def start(self, mission, environment=None, **keys):
        """Run ``mission`` (leaves) and wait until it has started."""
        self.prepare(mission, startupCheck="all", **keys)
        controller = self.controller(**(environment or {}))
        controller.lines.wait_for(lambda line: mission_starts() in line, 20)
        return controller

    def assert_told_once(self, controller, *words):
        """Expect one line with all of ``words``, apart from those of the robot as a whole."""
        lines = [line for _, line in controller.lines.all
                 if "robot: " not in line and all(word in line for word in words)]
        self.assertEqual(len(lines), 1, "\n".join(lines) or controller.lines.text())

    def wait_for(self, controller, since, *words, **more):
        """Wait for a line with all of ``words`` and expect it within the limit; return how long it
        took."""
        came, _ = controller.lines.wait_for(lambda line: all(word in line for word in words), 15)
        self.assertLess(came - since, more.get("limit", LIMIT), words)
        return came - since

    def faulty_master(self):
        """Return a master that stands between the node and the real one, and the environment that
        names it."""
        master = FaultyMaster(os.environ["ROS_MASTER_URI"])
        return master, {"ROS_MASTER_URI": master.uri}


class TestMonitor(MonitorCase):
    """The robot, its master, and the configuration change while the mission runs."""

    def test_the_death_and_the_return_of_the_robots_nodes(self):
        robot = self.robot()
        controller = self.start(WAITING)
        time.sleep(0.7)  # the connections that are watched stand half a second after the start
        killed = time.monotonic()
        robot.kill()
        for name in (SAY, DRIVE, KNOWLEDGE, FACES, ATTENTION):
            took = self.wait_for(controller, killed, name, "gone")
            self.assert_told_once(controller, name, "gone", "until it is back")
        print("death seen after {:.2f} s".format(took))
        forget_dead_entries()
        self.robot()
        back = time.monotonic()
        for name in (SAY, DRIVE, KNOWLEDGE, FACES, ATTENTION):
            took = self.wait_for(controller, back, name, "available again")
        print("return seen after {:.2f} s".format(took))
        self.assertIsNone(controller.process.poll())
        self.assertNotIn("Traceback", controller.lines.text())

    def test_a_silent_topic(self):
        robot = self.robot()
        robot.publish(FACES, [], [], [], hertz=20)
        controller = self.start(WAITING)
        time.sleep(1.0)  # the rate of the topic is known after some messages
        robot.publish(FACES, [], [], [])
        silent = time.monotonic()
        print("silence told after {:.2f} s".format(
            self.wait_for(controller, silent, FACES, "silent")))
        self.assert_told_once(controller, FACES, "silent", "visitors are not noticed")
        robot.publish(FACES, [], [], [], hertz=20)
        self.wait_for(controller, time.monotonic(), FACES, ": heard again")

    def test_a_slow_service(self):
        robot = self.robot({SAY: "hang"})
        controller = self.start("<FollowMeSpeech/><Sleep msec=\"600000\"/>",
                                textToSpeechDeadline="20")
        asked = robot.wait_for_request(SAY, 5)["time"]
        # on a busy machine the request itself may arrive late
        waited = self.wait_for(controller, asked, SAY, "slow", limit=8)
        robot.set_mode(SAY, "done")
        # “Please follow me.”: 17 letters, 14 a second
        self.assertAlmostEqual(waited, 2 * 17 / 14 + 3, delta=2)
        self.assert_told_once(controller, SAY, "slow", " 5.43 s", " 20 s")

    def test_calls_that_fail_in_a_row(self):
        self.robot({SAY: "refuse"})
        controller = self.start(
            "<Repeat num_cycles=\"-1\"><ForceSuccess><Sequence><Sleep msec=\"20\"/>"
            "<WelcomeSpeech/></Sequence></ForceSuccess></Repeat>")
        controller.lines.wait_for(lambda line: SAY in line and "failing: 3 calls in a row" in line,
                                  10)
        time.sleep(0.5)
        self.assert_told_once(controller, SAY, "failing")

    def test_a_navigation_that_is_started_again_saves_the_tour(self):
        robot = self.robot({DRIVE: "exit"})
        controller = self.start("<LookUpHome/><Fallback><Navigate/><HandleFallBack/></Fallback>",
                                missionRuns="1")
        robot.wait_for_request(DRIVE, 10)
        controller.lines.wait_for(lambda line: DRIVE in line and "gone" in line, 5)
        forget_dead_entries()
        time.sleep(4.0)  # longer than all back-offs of the policy together
        self.robot()
        self.assertEqual(controller.wait(10), 0)
        done = Recovered("Navigate", "-", Failure(Cause.NOT_REACHABLE, "", DRIVE), "-", 1, True,
                         "done", "", 1)
        self.assertIn(sentence(done), controller.lines.text())

    def test_the_mission_goes_on_without_a_master(self):
        master = self.own_master()
        robot = self.robot()
        controller = self.start(
            "<Repeat num_cycles=\"-1\"><Sequence>{}<LookUpHome/><Navigate/></Sequence>"
            "</Repeat>".format(TALKING))
        robot.wait_for_request(SAY, 20)
        end(master)
        died = time.monotonic()
        self.wait_for(controller, died, *MASTER_IS_GONE)
        start = len(robot.lines.all)
        for _ in range(10):  # further calls of each service, one after the other
            for service in (SAY, KNOWLEDGE, DRIVE):
                robot.wait_for_request(service, 5, start)
            start = len(robot.lines.all)
        self.assert_told_once(controller, "master")
        self.assertNotIn("FAILURE", controller.lines.text())
        self.assertEqual(controller.stop()[0], 0)
        self.assertNotIn("Traceback", controller.lines.text())

    def own_master(self):
        """Start a master for this case alone, and return its process."""
        master_before = os.environ["ROS_MASTER_URI"]
        self.addCleanup(os.environ.update, ROS_MASTER_URI=master_before)
        master = start_master()
        self.addCleanup(end, master)
        return master

    def test_one_question_that_the_master_does_not_answer_is_no_news(self):
        master = self.own_master()
        self.robot()
        controller = self.start(WAITING)
        self.addCleanup(master.send_signal, signal.SIGCONT)
        time.sleep(0.7)  # the master is checked
        master.send_signal(signal.SIGSTOP)
        # the first question is given up after 1.5 to 2 s, the second after 3.5 s at the earliest
        time.sleep(2.6)
        master.send_signal(signal.SIGCONT)
        time.sleep(1.5)
        self.assertNotIn(MASTER_IS_GONE[1], controller.lines.text())
        master.send_signal(signal.SIGSTOP)
        frozen = time.monotonic()
        self.wait_for(controller, frozen, *MASTER_IS_GONE, limit=5.0)

    def test_a_new_master_is_told_and_the_robots_nodes_are_used_where_they_are(self):
        master = self.own_master()
        robot = self.robot()
        controller = self.start(WAITING + TALKING + "<LookUpHome/><Navigate/>", missionRuns="1",
                                rosInterface="true")
        time.sleep(0.7)  # the connections that are watched stand
        before = registrations("/behaviorController")
        end(master)
        replaced = time.monotonic()
        self.addCleanup(end, run_master(os.environ["ROS_MASTER_URI"].rsplit(":", 1)[1]))
        self.wait_for(controller, replaced, "master", "a new one", "textToSpeech",
                      "start them again", limit=10.0)
        self.assertNotIn("answers again", controller.lines.text())
        self.assertTrue({FACES, "/rosout", "/diagnostics", "/behaviorController/stop"}
                        < set(before), before)
        self.assertEqual(registrations("/behaviorController"), before)
        # the mission calls its services only now, which this master never knew
        robot.publish(FACES, hertz=20)
        self.assertEqual(controller.wait(10), 0, controller.lines.text())
        robot.wait_for_request(DRIVE, 0)
        self.assertNotIn("FAILURE", controller.lines.text())

    def test_garbage_of_the_master_ends_no_monitoring(self):
        master, environment = self.faulty_master()
        robot = self.robot()
        controller = self.start(WAITING, environment)
        time.sleep(0.7)  # the connections that are watched stand
        master.is_garbled = True
        garbled = time.monotonic()
        self.wait_for(controller, garbled, "master", "does not answer as ROS does", limit=5.0)
        robot.kill()
        killed = time.monotonic()
        for name in (SAY, DRIVE, KNOWLEDGE, FACES, ATTENTION, SPEECH):
            self.wait_for(controller, killed, name, "gone")
        forget_dead_entries()
        self.robot()
        time.sleep(max(0.0, garbled + 6.0 - time.monotonic()))
        self.assertNotIn("Traceback", controller.lines.text())
        master.is_garbled = False
        sane = time.monotonic()
        self.wait_for(controller, sane, "master", "answers again")
        for name in (SAY, DRIVE, KNOWLEDGE, FACES, ATTENTION, SPEECH):
            self.wait_for(controller, sane, name, "available again", limit=5.0)
        self.assertEqual(controller.stop()[0], 0)
        self.assertNotIn("internal error", controller.lines.text())

    def test_an_answer_that_does_not_count_is_told_with_the_reason(self):
        robot = self.robot({SAY: "hang"})
        robot.publish(FACES, [], [], [], hertz=20)
        controller = self.start(WAITING + "<QueryTourSpeech/><IsYesNoUttered/>")
        robot.wait_for_listener(SPEECH, "yes")
        controller.lines.wait_for(lambda line: SPEECH in line and "nothing was asked" in line, 5)
        operator = subprocess.Popen(["rostopic", "pub", "-1", SPEECH, "std_msgs/String",
                                     "data: 'yes'"], stdout=subprocess.DEVNULL)
        self.addCleanup(operator.wait)
        controller.lines.wait_for(lambda line: SPEECH in line and "latched" in line, 15)
        robot.publish(FACES, hertz=20)
        robot.wait_for_request(SAY, 5)
        robot.publish(SPEECH, "yes")
        controller.lines.wait_for(lambda line: "before the question" in line, 5)
        self.assert_told_once(controller, SPEECH, "nothing was asked")
        self.assertNotIn("SUCCESS", controller.lines.text())

    def test_parameters_of_wrong_types_end_nothing(self):
        names = ("/use_sim_time", "/tcp_keepalive", "/rosout_disable_topics_generation",
                 "/enable_statistics", "/run_id")
        master = rosgraph.Master("/test")
        for value in ("perhaps", {"a": [1]}, -1.5):
            for name in names:
                master.setParam(name, value)
                self.addCleanup(lambda name=name: master.hasParam(name) and master.deleteParam(name
                                                                                               ))
            self.robot()
            controller = self.start(TALKING + "<LookUpHome/><Navigate/>", missionRuns="1")
            self.assertEqual(controller.wait(20), 0, controller.lines.text())
            self.assertNotIn("rror", controller.lines.text())
            self.assert_told_once(controller, "/use_sim_time is", "true or false")

    # --------------------------------------------------------------------------------------- SIGHUP

    def test_a_mission_is_changed_between_two_visitors(self):
        robot = self.robot()
        controller = self.start(TALKING)
        robot.wait_for_request(SAY, 5)
        self.package.write("data/other.xml",
                           MISSION.format("<FollowMeSpeech/><Sleep msec=\"200\"/>"))
        self.package.configure(scenarioSpecification="other", verboseMode="true")
        controller.process.send_signal(signal.SIGHUP)
        controller.lines.wait_for(lambda line: mission_starts("other") in line, 5)
        controller.lines.wait_for(lambda line: "FollowMeSpeech" in line and "SUCCESS" in line, 5)
        self.assertEqual(controller.stop()[0], 0)
        self.assertEqual(controller.lines.text().count("reloaded:"), 1)

    def test_a_faulty_mission_is_refused_and_the_running_one_stays(self):
        robot = self.robot()
        controller = self.start(TALKING)
        self.package.write("data/m.xml", MISSION.format("<WelcomeSpech/><FollowMSpeech/>"))
        controller.process.send_signal(signal.SIGHUP)
        controller.lines.wait_for(
            lambda line: "refused, the running mission stays: 2 mistakes" in line, 5)
        self.assertIn("WelcomeSpech", controller.lines.text())
        self.assertIn(" WelcomeSpeech?", controller.lines.text())
        said = len(robot.requests(SAY))
        robot.lines.wait_for(lambda line: len(robot.requests(SAY)) > said + 2, 10)
        self.package.configure(scenarioSpecification="m", asrEnabled="perhaps")
        controller.process.send_signal(signal.SIGHUP)
        controller.lines.wait_for(lambda line: "behaviorControllerConfiguration.ini:3" in line, 5)
        self.assertEqual(controller.stop()[0], 0)
        self.assertNotIn("Traceback", controller.lines.text())


class TestSlowMaster(MonitorCase):
    """The master answers slowly for a while."""

    def test_a_slow_master_is_told_and_no_topic_is_gone_that_was_not_looked_for(self):
        master, environment = self.faulty_master()
        self.robot()
        master.delay = 0.9
        controller = self.start(WAITING, environment)
        started = time.monotonic()
        self.wait_for(controller, started, "master", "answers slowly", limit=12.0)
        time.sleep(max(0.0, started + 8.0 - time.monotonic()))
        self.assertNotIn("gone", controller.lines.text())
        master.delay = 0.0
        self.wait_for(controller, time.monotonic(), "master", "answers in time again", limit=3.0)
        master.gap = 0.02
        self.wait_for(controller, time.monotonic(), "master", "answers slowly",
                      "the mission goes on", limit=6.0)
        master.gap = 0.0
        self.wait_for(controller, time.monotonic(), "master", "answers again", limit=5.0)
        self.assertNotIn("gone", controller.lines.text())


def end(process):
    """End a process and wait for it."""
    process.kill()
    process.wait(10)


if __name__ == "__main__":
    rostest.rosrun("cssr_system", "monitor", "__main__." + sys.argv[1])
