#!/usr/bin/env python3
"""Whatever the leaves of another package do, does the node go on or stop in the safe state, and
name them?"""
import itertools
import os
import re
import signal
import subprocess
import sys
import time

import rostest

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from behavior_controller.folders import RECORDS  # noqa: E402
from behavior_controller.run.events import SafePart, SafeStateReported  # noqa: E402
from robot import NodeCase, robot_for, sentence  # noqa: E402

ATTENTION, ANIMATION = "/overtAttention/set_mode", "/animateBehaviour/set_activation"
SAY = "/textToSpeech/say_text"
OFF = (SafePart("attention", ATTENTION, None), SafePart("lifelike movement", ANIMATION, None))
LIMIT = 2.0
MISSION = """<root BTCPP_format="4" main_tree_to_execute="M">
  <BehaviorTree ID="M"><Sequence><START_OF_TREE/><EnableAnimateBehavior/>
{}</Sequence></BehaviorTree>
</root>
"""
MANIFEST = """<package format="2"><name>odd</name><version>1.0.0</version><description>d</description>
<maintainer email="a@example.org">a</maintainer><license>BSD</license>
<export><cssr_system {}="odd.leaves"/></export></package>"""
LEAF = """import os, signal, sys, threading, time
from behavior_controller.extend import ActionLeaf
from behavior_controller.extend import Kind, NodeSpec
from behavior_controller.extend import RUNNING, SUCCESS


class FixtureOdd(ActionLeaf):
    def {}

    def on_running(self):
        return RUNNING


SPECS = (NodeSpec("FixtureOdd", Kind.ACTION, FixtureOdd),)
"""
DECLARATIONS = """import sys
from behavior_controller.extend import Service, Success, Topic
from behavior_controller.extend import Request


def read(message):
    raise KeyboardInterrupt


class Bell(Request, frozen=True):
    text: str = "ding"


SERVICES = (Service(Bell, "/bell/ring", "bell", "cssr_system/textService", lambda bell: (bell.text,),
                    Success("success", True, False), 5.0, "no bell rings", answer=lambda response: sys.exit(7)),)
HEARD = Topic("/bell/heard", "bell", "std_msgs/String", str, read, "no bell is heard", False)
TOPICS = (HEARD,)
"""
RINGS = """from behavior_controller.extend import Evidence, ServiceLeaf, TopicCondition, leaf_spec
from odd.declared import HEARD, Bell


class FixtureRing(ServiceLeaf):
    asks = Bell

    def request(self):
        return Bell()


class FixtureHeard(TopicCondition):
    own_evidence = Evidence(HEARD)


SPECS = (leaf_spec("FixtureRing", FixtureRing, "Rings the bell."),
         leaf_spec("FixtureHeard", FixtureHeard, "Is the bell heard?"))
"""

LEVEL = """from behavior_controller.extend import Topic

LEVEL = Topic("/battery/level", "battery", "std_msgs/Float32", float, lambda message: message.data,
              "the battery is not known", is_continuous=True)
TOPICS = (LEVEL,)
"""
IS_ABOVE = """from behavior_controller.extend import Evidence, TopicCondition, leaf_spec
from odd.level import LEVEL


class BatteryAbove(TopicCondition):
    own_evidence = Evidence(LEVEL, lambda level, gaze_value: level > 20.0)


SPECS = (leaf_spec("BatteryAbove", BatteryAbove, "Is the battery full enough?"),)
"""
BATTERY = """import rospy, std_msgs.msg
rospy.init_node("battery")
publisher = rospy.Publisher("/robot1/battery", std_msgs.msg.Float32, queue_size=1)
print("ready", flush=True)
while not rospy.is_shutdown():
    rospy.sleep({})
    publisher.publish(80.0)
"""

RAISED = ("SystemExit(0)", "KeyboardInterrupt()", "KeyError('gripper')")
MOMENTS = ("on_start(self):\n        raise {}",
           "on_start(self):\n        self.clock.call_after(0.1, self.late)\n"
           "        return RUNNING\n\n    def late(self):\n        raise {}")
BLOCKS = ("time.sleep(600)", "threading.Event().wait()", "while True: pass",
          "os.read(os.pipe()[0], 1)")
BLOCKED_MOMENTS = ("on_start(self):\n        {}",
                   "on_start(self):\n        print('it grips')\n        return RUNNING\n\n"
                   "    def on_halted(self):\n        {}")
KINDS = ("leaves", "interface", "phrases")
BROKEN_MODULES = (("raise SystemExit(0)", "SystemExit: 0"), ("SPECS = (", "SyntaxError"))


class TestForeign(NodeCase):
    """Each case writes a package with the leaf FixtureOdd, which does something that a leaf must
    not do.
    """

    def start(self, module, mission="<FixtureOdd name=\"grip\"/>", kind="leaves", modes=None,
              arguments=(), **keys):
        """Run a mission with the leaf against a robot in these modes; return robot and node."""
        for folder in ("other/odd", "package/src/odd"):
            os.makedirs(os.path.join(self.folder, folder), exist_ok=True)
        self.package.write("../other/odd/package.xml", MANIFEST.format(kind))
        self.package.write("src/odd/__init__.py", "")
        self.package.write("src/odd/leaves.py", module)
        self.package.write("data/m.xml", MISSION.format(mission))
        self.package.configure(scenarioSpecification="m", **keys)
        return robot_for(self, modes), self.second(*arguments)

    def second(self, *arguments):
        """Start a node, as ``start`` does."""
        return self.controller(*arguments, ROS_PACKAGE_PATH=os.path.join(self.folder, "other"),
                               ROS_HOME=os.path.join(self.folder, "ros"))

    def assert_calm(self, robot):
        """Expect the requests of the safe state as the last two."""
        last = robot.requests()[-2:]
        self.assertEqual(sorted(request["service"] for request in last),
                         sorted([ATTENTION, ANIMATION]))
        self.assertTrue(all(request["fields"]["state"] == "disabled" for request in last))

    def test_whatever_it_raises_ends_its_pass_and_the_next_begins(self):
        for raised, where in zip(RAISED, itertools.cycle(MOMENTS)):  # the soak draws others
            self.check_raised(raised, where)

    def check_raised(self, raised, where):
        """What the leaf raises there is its failure in each of two passes."""
        robot, controller = self.start(LEAF.format(where.format(raised)), missionRuns="2")
        self.assertEqual(controller.wait(20), 3, controller.lines.text())
        text = controller.lines.text()
        found = re.findall(
            r"ERROR.*m\.xml:3:1: {}.*\(odd/leaves\.py:\d+\)\n".format(raised.split("(")[0]), text)
        self.assertEqual(len(found), 2, text)
        self.assertNotIn("Traceback", text)
        self.assertIn("Traceback", self.log_files())

    def log_files(self):
        """Return all that the log files hold."""
        text = ""
        for folder, _, names in os.walk(os.path.join(self.folder, "ros")):
            for name in names:
                with open(os.path.join(folder, name), encoding="utf-8", errors="replace") as file:
                    text += file.read()
        return text

    def test_a_leaf_that_cannot_be_set_up_is_told_before_anything_begins(self):
        robot, controller = self.start(LEAF.format("setup(self, **kwargs):\n        sys.exit(0)"),
                                       recordDirectory="")
        self.assertEqual(controller.wait(20), 2)
        records = os.path.join(self.folder, "ros", "log", RECORDS)
        self.assertFalse(os.path.exists(records), "an empty record would be the latest")
        self.assertRegex(controller.lines.text(),
                         r"m\.xml:3:1: .*SystemExit: 0 \(odd/leaves\.py:9\)")
        self.assertEqual(robot.requests(), [])

    def test_a_leaf_whose_set_up_fails_or_hangs_displaces_no_running_node(self):
        running = self.start(LEAF.format("setup(self, **kwargs):\n        time.sleep(600)"),
                             "<Sleep msec=\"600000\"/>")[1]
        running.lines.wait_for(lambda line: " starts, " in line, 20)
        self.package.write("data/odd.xml", MISSION.format("<FixtureOdd/>"))
        starting = self.second("_scenarioSpecification:=odd")
        starting.lines.wait_for(lambda line: "waiting up to" in line and "set-up" in line, 20)
        self.assertEqual(starting.stop()[0], 1)
        starting = self.second("_scenarioSpecification:=odd")
        self.assertEqual(starting.wait(40), 2)
        self.assertRegex(starting.lines.text(), r"package odd: odd/leaves\.py:9 has not returned")
        self.package.write("src/odd/leaves.py",
                           LEAF.format("setup(self, **kwargs):\n        raise KeyError('port')"))
        starting = self.second("_scenarioSpecification:=odd")
        self.assertEqual(starting.wait(20), 2)
        self.assertRegex(starting.lines.text(),
                         r"odd\.xml:3:1: .*KeyError: 'port' \(odd/leaves\.py:9\)")
        self.assertIsNone(running.process.poll(), running.lines.text())
        self.assertNotIn("another node", running.lines.text())

    def test_a_leaf_may_use_ros_in_its_set_up(self):
        robot, controller = self.start(LEAF.format("""setup(self, **kwargs):
        import rospy, std_msgs.msg
        self.now = rospy.Time.now()
        self.publisher = rospy.Publisher("/odd", std_msgs.msg.String, latch=True, queue_size=1)

    def on_start(self):
        self.publisher.publish("gripped at {}".format(self.now))
        print("it grips")
        return RUNNING"""))
        controller.lines.wait_for(lambda line: "it grips" in line, 20)
        heard = subprocess.check_output(["rostopic", "echo", "-n1", "/odd"],
                                        universal_newlines=True, timeout=20)
        self.assertIn("gripped", heard)

    def test_a_thread_of_a_leaf_that_fails_is_its_packages_failure(self):
        robot, controller = self.start(LEAF.format("""on_start(self):
        threading.Thread(target=sys.exit).start()
        threading.Thread(target=self.work).start()
        return SUCCESS

    def work(self):
        raise KeyError("gripper")"""), missionRuns="1")
        self.assertEqual(controller.wait(20), 0)
        errors = [line for _, line in controller.lines.all if "[ERROR]" in line]
        self.assertEqual(len(errors), 1, controller.lines.text())
        self.assertRegex(errors[0], r"package odd: .*KeyError: 'gripper' \(odd/leaves\.py:14\)")
        self.assertIn("Traceback", self.log_files())

    def test_a_leaf_that_blocks_is_named_and_a_stop_reaches_the_safe_state_beside_it(self):
        for moment, number in zip(BLOCKED_MOMENTS, (signal.SIGINT, signal.SIGTERM)):
            self.check_blocked(moment, BLOCKS[0], number)

    def check_blocked(self, moment, statement, number):
        """The leaf blocks in ``statement``; a stop by that signal reaches the safe state."""
        is_ticked = "on_halted" not in moment
        robot, controller = self.start(LEAF.format(moment.format(statement)))
        robot.wait_for_request(ANIMATION, 20)
        if is_ticked:
            line = controller.lines.wait_for(lambda line: "stands still" in line, 20)[1]
            self.assertRegex(line, r"WARN.*m\.xml:3:1: .*'grip' \[FixtureOdd\].* odd/leaves\.py:9 ")
        else:
            controller.lines.wait_for(lambda line: "it grips" in line, 20)
        code, seconds = controller.stop(number)
        print("stopped beside a leaf that blocks: {:.2f} s".format(seconds))
        self.assertLess(seconds, LIMIT)
        self.assertEqual(code, 4)
        self.assert_calm(robot)
        self.assertIn(sentence(SafeStateReported(OFF, 0.1)), controller.lines.text())
        self.assertEqual(controller.lines.text().count("stands still"), int(is_ticked))

    def test_a_safe_state_that_is_not_reached_beside_a_leaf_that_blocks_is_told(self):
        robot, controller = self.start(LEAF.format("on_start(self):\n        time.sleep(600)"),
                                       modes={ATTENTION: "hang"})
        controller.lines.wait_for(lambda line: "stands still" in line, 20)
        code, seconds = controller.stop()
        print("stopped beside a leaf that blocks, with a service that hangs: {:.2f} s".format(
            seconds))
        self.assertLess(seconds, LIMIT)
        self.assertEqual(code, 4)
        self.assertRegex(controller.lines.text(), r"WARN.*lifelike movement.*{}".format(ATTENTION))
        self.assert_calm(robot)

    def test_what_an_import_does_is_one_line_that_names_package_and_module(self):
        for kind, broken in zip(KINDS, itertools.cycle(BROKEN_MODULES)):
            self.check_import(kind, *broken)

    def check_import(self, kind, module, words):
        """The node refuses that module of an export in one line."""
        robot, controller = self.start(module, "<WelcomeSpeech/>", kind)
        self.assertEqual(controller.wait(20), 2, controller.lines.text())
        found = [line for _, line in controller.lines.all if "package odd: " in line]
        self.assertEqual(len(found), 1, controller.lines.text())
        self.assertIn('{}="odd.leaves"'.format(kind), found[0])
        self.assertIn(words, found[0])
        self.assertNotIn("Traceback", controller.lines.text())

    def test_a_declaration_that_ends_the_program_fails_at_the_calls_and_messages_that_it_reads(
            self):
        os.makedirs(os.path.join(self.folder, "package/src/odd"))
        self.package.write("src/odd/declared.py", DECLARATIONS)
        robot, controller = self.start(RINGS, "<Fallback><FixtureHeard/><FixtureRing/></Fallback>",
                                       'interface="odd.declared" leaves', None,
                                       ("/bell/ring:=" + SAY, "/bell/heard:=/speechEvent/text"))
        robot.publish("/speechEvent/text", "ding", hertz=20)
        for words in (r"FixtureRing failed: .*SystemExit: 7 \(odd/declared\.py:\d+\)",
                      r"WARN.* /speechEvent/text .*KeyboardInterrupt \(odd/declared\.py:\d+\)"):
            controller.lines.wait_for(lambda line: re.search(words, line), 30)
        self.assertEqual(controller.stop()[0], 3)
        self.assert_calm(robot)

    def test_a_mission_may_begin_with_a_condition_on_a_state_that_comes_once_a_second(self):
        os.makedirs(os.path.join(self.folder, "package/src/odd"))
        self.package.write("src/odd/level.py", LEVEL)
        for pause, code, told in ((1.0, 0, "complete"), (
                600.0, 3, "BatteryAbove: no message on /robot1/battery yet")):
            battery = subprocess.Popen([sys.executable, "-c", BATTERY.format(pause)],
                                       stdout=subprocess.PIPE)
            self.addCleanup(battery.stdout.close)
            self.addCleanup(battery.wait)
            self.addCleanup(battery.kill)
            battery.stdout.readline()
            robot, controller = self.start(
                IS_ABOVE, "<BatteryAbove/>", 'interface="odd.level" leaves', None,
                ("/battery/level:=/robot1/battery",), missionRuns="1", startupTimeout="5")
            self.assertEqual(controller.wait(30), code, controller.lines.text())
            self.assertIn(told, controller.lines.text())
            battery.kill()

    def test_an_import_that_does_not_end_is_told_within_its_limit(self):
        began = time.monotonic()
        controller = self.start("import threading; threading.Event().wait()", "<WelcomeSpeech/>")[1]
        self.assertEqual(controller.wait(40), 2, controller.lines.text())
        print("an import that does not end: {:.1f} s".format(time.monotonic() - began))
        self.assertIn('package odd: leaves="odd.leaves": its import has not ended',
                      controller.lines.text())


if __name__ == "__main__":
    rostest.rosrun("cssr_system", "foreign", TestForeign)
