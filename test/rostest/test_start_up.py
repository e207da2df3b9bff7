#!/usr/bin/env python3
"""Does the node find every fault before anything moves, report all of them, and exit with the right
code?"""
import datetime
import os
import re
import signal
import socket
import subprocess
import sys
import time
import xmlrpc.client

import rosgraph
import rostest

from behavior_controller.run.record.files import runs

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from robot import NodeCase, end_shared, mission_starts, robot_for  # noqa: E402

SPEAKS = "<root BTCPP_format='4'><BehaviorTree ID='M'><WelcomeSpeech/></BehaviorTree></root>"
SAY, DRIVE = "/textToSpeech/say_text", "/robotNavigation/set_goal"
PARTS = {  # what the robot's nodes offer (contract, sections 2 and 3), by the name of the node
    "/animateBehaviour/set_activation": "animateBehavior", "/gestureExecution/perform_gesture":
        "gestureExecution", "/knowledgeBase/query": "knowledgeBase",
    "/overtAttention/set_mode": "overtAttention", "/robotNavigation/set_goal": "robotNavigation",
    "/tabletEvent/prompt_and_get_response": "tabletEvent", "/textToSpeech/say_text": "textToSpeech",
    "/faceDetection/data": "faceDetection", "/overtAttention/mode": "overtAttention",
    "/speechEvent/text": "speechEvent"}
MISSION = """<root BTCPP_format="4" main_tree_to_execute="M">
  <BehaviorTree ID="M">
    <Sequence>
      {}
    </Sequence>
  </BehaviorTree>
</root>
"""


class TestStartUp(NodeCase):
    """Each case has a copy of the package, and a robot if it needs one."""

    def setUp(self):
        super().setUp()
        self.package.configure()

    def robot(self, modes=None):
        """Return a robot for this case."""
        return robot_for(self, modes)

    def run_node(self, *arguments, **environment):
        """Run the node to its end; return the exit code and what it wrote, without time stamps."""
        controller = self.controller(*arguments, **environment)
        code = controller.wait(20)
        text = re.sub(r"(?m)^\[(\w+)\] \[[\d:.]+\]: ", r"\1 ", controller.lines.text())
        self.assertNotIn("Traceback", text)
        return code, text

    def assert_line(self, text, *words):
        """Expect a line that has all of ``words``."""
        self.assertTrue(any(all(word in line for word in words) for line in text.splitlines()),
                        "no line with {} in:\n{}".format(words, text))

    # ---------------------------------------------------------------------------- the robot's nodes

    def test_what_answers_no_question_at_the_masters_address_is_not_called_absent(self):
        with socket.socket() as mute:
            mute.bind(("127.0.0.1", 0))
            mute.listen(5)
            uri = "http://127.0.0.1:{}".format(mute.getsockname()[1])
            code, text = self.run_node(ROS_MASTER_URI=uri)
        self.assertEqual(code, 1)
        self.assert_line(text, uri, "does not answer", "ROS_MASTER_URI")
        self.assertNotIn("no ROS master", text)

    def test_a_half_written_manifest_of_another_package_costs_the_log_file_alone(self):
        self.check_manifest("")

    def check_manifest(self, text):
        """A package on the path has that package.xml; None: a pipe."""
        end_shared()
        os.makedirs(os.path.join(self.folder, "other/half"))
        if text is None:
            os.mkfifo(os.path.join(self.folder, "other/half/package.xml"))
        else:
            self.package.write("../other/half/package.xml", text)
        code, text = self.run_node(ROS_PACKAGE_PATH=os.path.join(self.folder, "other"))
        self.assertEqual(code, 1)  # for the robot's nodes are missing
        self.assert_line(text, "WARN", "no log file")
        self.assert_line(text, "WARN", "package half")
        self.assertNotIn("internal error", text)

    def test_everything_that_is_missing_is_listed_at_once(self):
        end_shared()
        code, text = self.run_node()
        self.assertEqual(code, 1)
        for name, node in PARTS.items():
            self.assert_line(text, "ERROR", " " + name + " ", "node /" + node, "without it")

    def test_each_part_is_named_with_what_is_wrong_with_it_and_nothing_is_called(self):
        wrong = {DRIVE: "absent", SAY: "absent", "/faceDetection/data": "absent",
                 "/knowledgeBase/query": "wrong", "/speechEvent/text": "wrong"}
        robot, master = self.robot(wrong), rosgraph.Master("/elsewhere")
        where = SAY, "rosrpc://robot.invalid:4711"  # RFC 6761: this name never resolves
        master.registerService(*where, "http://robot.invalid:4712/")
        self.addCleanup(master.unregisterService, *where)
        code, text = self.run_node()
        self.assertEqual(code, 1)
        for name in PARTS:
            self.assertEqual(name in text, name in wrong)
        self.assert_line(text, "ERROR", DRIVE, "node /robotNavigation", "not advertised", "drive")
        self.assert_line(text, "ERROR", "topic /faceDetection/data", "node /faceDetection",
                         "no node publishes it")
        self.assert_line(text, "/knowledgeBase/query", "type mismatch", "cssr_system/textService",
                         "10b91f7565804f90610ee9fc2d0e20ba", "cssr_system/knowledgeBaseService",
                         "230b5e3f3d344348479332bc683f6f11")
        self.assert_line(text, "/speechEvent/text", "type mismatch",
                         "cssr_system/overtAttentionMessage", "std_msgs/String",
                         "992ce8a1687cec8c8bd883ec73ca41d1")
        self.assert_line(text, "ERROR", SAY, "robot.invalid", "cannot be resolved", "/etc/hosts",
                         "ROS_IP")
        self.assertEqual(robot.requests(), [])
        robot.stop()
        self.assertEqual(robot.log.text(), "", "it logs nothing of the questions")

    def test_entries_whose_node_is_dead_do_not_count(self):
        self.robot().kill()
        code, text = self.run_node()
        self.assertEqual(code, 1)
        for name in PARTS:
            self.assert_line(text, name, "not reachable", "Connection refused")

    def test_a_robot_that_hangs_does_not_hang_the_start(self):
        robot = self.robot()
        robot.process.send_signal(signal.SIGSTOP)
        self.addCleanup(robot.process.send_signal, signal.SIGCONT)
        started = time.monotonic()
        code, text = self.run_node()
        self.assertLess(time.monotonic() - started, 8.0)
        self.assertEqual(code, 1)
        for name in PARTS:
            self.assert_line(text, "ERROR", name, "without it")

    def test_the_resolved_name_is_told(self):
        self.robot()
        code, text = self.run_node("/textToSpeech/say_text:=/voice/say")
        self.assertEqual(code, 1)
        self.assert_line(text, "ERROR", "/voice/say", "node /textToSpeech", "not advertised")
        self.assertNotIn("/textToSpeech/say_text", text)

    def test_a_mission_that_only_speaks_needs_text_to_speech_alone(self):
        self.robot(dict.fromkeys(set(PARTS) - {SAY}, "absent"))
        self.package.write("data/speaks.xml", SPEAKS)
        self.package.configure(scenarioSpecification="speaks", missionRuns="1")
        code, text = self.run_node()
        self.assertEqual((code, "WARN" in text), (0, False), text)
        code, text = self.run_node("_startupCheck:=all")
        self.assertEqual(code, 1)
        self.assert_line(text, "ERROR", "/robotNavigation/set_goal", "not advertised")

    def test_without_speech_recognition_nobody_needs_speechEvent(self):
        self.robot({"/speechEvent/text": "absent"})
        self.package.configure(asrEnabled="false")
        controller = self.controller()
        controller.lines.wait_for(lambda line: "[WARN]" in line and "/speechEvent/text" in line, 15)
        controller.lines.wait_for(lambda line: mission_starts() in line, 15)

    def test_it_waits_for_nodes_that_come_late(self):
        end_shared()
        self.package.configure(startupTimeout="30")
        controller = self.controller()
        controller.lines.wait_for(
            lambda line: "waiting up to" in line and "/knowledgeBase/query" in line, 15)
        robot = self.robot()
        controller.lines.wait_for(lambda line: mission_starts() in line, 15)
        robot.wait_for_request("/overtAttention/set_mode", 10, state="scanning")

    def test_the_wait_for_nodes_ends(self):
        end_shared()
        self.package.configure(startupTimeout="1.5")
        controller = self.controller()
        began = controller.lines.wait_for(lambda line: "waiting up to" in line, 15)[0]
        self.assertEqual(controller.wait(15), 1)
        self.assertLess(abs(time.monotonic() - began - 1.5), 1.0)
        self.assertIn("/tabletEvent/prompt_and_get_response", controller.lines.text())

    # -------------------------------------------------------------------- configuration and mission

    def assert_refused(self, *lines):
        """Run the node with a complete robot: exit code 2, each of ``lines`` (words) printed, and
        nothing called."""
        robot = self.robot()
        code, text = self.run_node()
        self.assertEqual(code, 2, text)
        for words in lines:
            self.assert_line(text, "ERROR", *words)
        self.assertEqual(robot.requests(), [])

    def test_no_configuration(self):
        os.remove(self.package.path("config/behaviorControllerConfiguration.ini"))
        self.assert_refused(("behaviorControllerConfiguration.ini", "No such file"))

    def test_all_mistakes_of_all_files_come_in_one_go(self):
        self.package.configure(scenarioSpecification="wrong", language="Klingon")
        self.package.write("data/wrong.xml",
                           MISSION.format("<WelcomSpeech/>\n      <Slep msec=\"5\"/>"))
        self.package.write("config/recoveryPolicy.ini", "budget 10 60\nNavigate * 1 1 skip\n")
        self.assert_refused(("wrong.xml:4:", "WelcomSpeech", "WelcomeSpeech"),
                            ("wrong.xml:5:", "Slep", "Sleep"), ("Klingon", "English"),
                            ("recoveryPolicy.ini:2", "Navigate"))

    def test_an_argument_overrides_the_file_and_leaves_nothing_on_the_master(self):
        self.robot()
        code, text = self.run_node("_scenarioSpecification:=other")
        self.assertEqual(code, 2)
        self.assertFalse(
            rosgraph.Master("/test").hasParam("/behaviorController"), "a later run would find it")
        self.assert_line(text, "INFO", "override", "scenarioSpecification other")
        self.assert_line(text, "ERROR", "other.xml", "lab_tour")

    def test_a_parameter_that_is_no_text_and_no_number_is_one_line(self):
        master = rosgraph.Master("/test")
        self.addCleanup(master.deleteParam, "/behaviorController")
        for value, kind in (([1], "list"), ({"a": 1}, "dict"),
                            (xmlrpc.client.Binary(b"x"), "Binary"), (datetime.datetime(2026, 1, 1),
                                                                     "DateTime")):
            master.setParam("/behaviorController", {"language": value, "topicMaxAge": 1})
            code, text = self.run_node()
            self.assertEqual(code, 2)
            self.assert_line(text, "ERROR", "parameter ~language: ", " " + kind)
            self.assertEqual(text.count("ERROR"), 2)  # the fault, and the summary

    # --------------------------------------------------------------------------------- command line

    def test_help_is_printed_by_the_installed_command(self):
        text = subprocess.check_output(["rosrun", "cssr_system", "behaviorController", "--help"],
                                       universal_newlines=True, timeout=20)
        for word in ("usage", "exit codes", "behaviorControllerConfiguration.ini",
                     "seconds to wait for missing robot nodes"):
            self.assertIn(word, text)

    def test_a_word_that_looks_like_a_key_is_no_remapping(self):
        self.check_word("missionRuns:=1", "_missionRuns")

    def check_word(self, word, meant):
        """The node refuses an argument that means nothing, and names the one that is meant."""
        code, text = self.run_node(word)
        self.assertEqual(code, 2)
        self.assert_line(text, "ERROR", "argument " + word, "did you mean {}?".format(meant))

    def test_an_argument_that_our_launch_file_does_not_declare(self):
        for given, code in ((["missionRun:=1"], 2), (["missionRuns:=0", "foo:=1"], 2),
                            (["missionRuns:=0"], 1)):
            self.check_launch(given, code)

    def check_launch(self, given, code):
        """roslaunch with these arguments: with code 2 the last one is refused by the node."""
        end_shared()
        text = subprocess.run(["roslaunch", "cssr_system", "behaviorController.launch"] + given,
                              stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                              universal_newlines=True, timeout=60).stdout
        self.assertIn("exit code {}".format(code), text)
        self.assertEqual("unknown key {}".format(given[-1].split(":=")[0]) in text, code == 2, text)

    # ----------------------------------------------------------------- files that are no such files

    def test_a_configuration_or_mission_that_is_no_file(self):
        self.package.configure(scenarioSpecification="odd")
        for name in ("data/odd.xml", "config/behaviorControllerConfiguration.ini"):
            path = self.package.path(name)
            for make, end in ((os.mkfifo, os.remove), (os.mkdir, os.rmdir)):
                if os.path.exists(path):
                    os.remove(path)
                make(path)
                self.assert_refused((path, "cannot be read", "it is "))
                end(path)

    # ------------------------------------------------------------------ after a run that was killed

    def test_a_start_that_is_refused_says_what_the_run_before_may_have_left(self):
        self.package.write("data/drives.xml", MISSION.format(
            "<EnableAnimateBehavior/><LookUpEntrance/><Navigate/>"))
        records = os.path.join(self.folder, "records")
        self.package.configure(scenarioSpecification="drives", recordDirectory=records)
        robot = self.robot({DRIVE: "hang"})
        killed = self.controller()
        robot.wait_for_request(DRIVE, 20)
        record, = runs(records)
        words = ("WARN", "the robot may be live", "lifelike movement may be on: switch it off by "
                 "hand", "driving to", "stop button", record)
        # as long as a node controls the robot nothing is said
        self.assertNotIn(words[1], self.run_node("_language:=Klingon")[1])
        self.wait_for_record(record, b'"GoTo"')
        killed.process.kill()
        code, text = self.run_node("_language:=Klingon")
        self.assertEqual(code, 2)
        self.assert_line(text, *words)
        robot.stop()
        code, text = self.run_node()
        self.assertEqual(code, 1)
        self.assert_line(text, *words)
        self.assertEqual(runs(records), [record])

    def wait_for_record(self, path, words):
        """Return when a record has these words in it."""
        ends = time.monotonic() + 20
        while True:
            with open(path, "rb") as file:
                if words in file.read():
                    return
            self.assertLess(time.monotonic(), ends)
            time.sleep(0.05)

    def assert_runs_without_log(self, *arguments, **environment):
        """Expect a warning about the log file alone, and a mission that runs."""
        self.package.write("data/speaks.xml", SPEAKS)
        self.package.configure(scenarioSpecification="speaks", missionRuns="1")
        code, text = self.run_node(*arguments, **environment)
        self.assertEqual(code, 0, text)
        self.assert_line(text, "WARN", "no log file is written to")
        self.assertEqual(text.count("WARN"), 1)

    def test_a_log_file_that_hangs(self):
        self.check_hanging_log("behaviorController")

    def check_hanging_log(self, name):
        """The log file of the node of that name is a pipe that nobody reads."""
        os.mkfifo(os.path.join(self.folder, name + ".log"))
        self.robot()
        self.assert_runs_without_log("__name:=" + name, ROS_LOG_DIR=self.folder)

    def test_a_log_file_that_cannot_be_written(self):
        self.robot()
        for path in ("/proc/x", self.folder, "/proc/x/y", "/dev/full"):
            self.assert_runs_without_log("__log:=" + path)

    def test_a_log_file_of_its_own(self):
        path = os.path.join(self.folder, "inner", "own.log")
        code, _ = self.run_node("__log:=" + path, "_language:=Klingon")
        self.assertEqual(code, 2)
        with open(path, encoding="utf-8") as file:
            self.assertIn("Klingon", file.read())
        self.assertNotIn("latest", os.listdir(self.folder))


if __name__ == "__main__":
    rostest.rosrun("cssr_system", "start_up", TestStartUp)
