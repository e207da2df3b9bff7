#!/usr/bin/env python3
"""Does exactly one node run under a name, and control a robot, whatever is started beside it?"""
import contextlib
import http.client
import os
import signal
import socket
import sys
import time
import urllib.parse
import xmlrpc.client

import rosgraph
import rostest

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from robot import (  # noqa: E402
    NodeCase, on_one_python, robot_for)

NAME = "/behaviorController"
SAY = "/textToSpeech/say_text"
SERVICES = (SAY, "/animateBehaviour/set_activation", "/overtAttention/set_mode")
MISSION = """<root BTCPP_format="4"><BehaviorTree ID="M"><Repeat num_cycles="-1"><Sequence>
<WelcomeSpeech/><ForceSuccess><IsVisitorDiscovered/></ForceSuccess><Sleep msec="200"/></Sequence></Repeat></BehaviorTree></root>"""
AT_ONCE = 3
ROUNDS = 3
START_LIMIT = 20.0


class TestOneNode(NodeCase):
    """A node speaks in each case; others are started beside it."""

    def setUp(self):
        super().setUp()
        self.package.write("data/m.xml", MISSION)
        self.package.configure(scenarioSpecification="m")
        self.robot = robot_for(self)
        self.master = rosgraph.Master("/test")

    def running(self):
        """Start a node, and return it when it is registered and speaks."""
        node = self.controller()
        self.robot.wait_for_request(SAY, START_LIMIT, start=len(self.robot.lines.all))
        self.assert_registered()
        return node

    def assert_speaks(self, node):
        """Expect that ``node`` has the name, and that the robot is asked to speak from now on."""
        self.robot.wait_for_request(SAY, 10, start=len(self.robot.lines.all))
        self.assertIsNone(node.process.poll(), node.lines.text())
        self.assertEqual(self.named(), node.process.pid)

    def named(self):
        """Return the number of the process that has the name."""
        with xmlrpc.client.ServerProxy(self.master.lookupNode(NAME)) as node:
            return node.getPid("/test")[2]

    def assert_registered(self):
        """Expect that the master soon lists what a node registers."""
        ends = time.monotonic() + 5.0
        while time.monotonic() < ends:
            publishers, subscribers, _ = map(dict, self.master.getSystemState())
            if NAME in publishers["/rosout"] and NAME in subscribers.get("/faceDetection/data", ()):
                return
            time.sleep(0.05)
        self.fail("the master lists {} and {}".format(publishers, subscribers))

    # --------------------------------------------------------------------------- a start that fails

    @on_one_python
    def test_a_start_that_fails_changes_nothing(self):
        running = self.running()
        for code, words in ((2, ["_missionRuns:=many"]), (2, ["missionRuns:=1"]),
                            (2, ["--verbose"]), (2, ["_scenarioSpecification:=absent"]),
                            (2, ["_language:=Klingon"]), (2, ["__nam:=x"]),
                            (2, ["_robot:=1 robot"]), (2, ["_robot:=robot1", "__ns:=/hall"]),
                            (1, ["__name:=other", SAY + ":=/voice/say"])):
            failing = self.controller(*words)
            self.assertEqual(failing.wait(START_LIMIT), code, failing.lines.text())
            self.assert_speaks(running)
        self.assertNotIn("another node", running.lines.text())

    @on_one_python
    def test_a_start_that_waits_for_nodes_leaves_the_running_one_alone(self):
        running = self.running()
        waiting = self.controller("_startupTimeout:=60", SAY + ":=/voice/say")
        waiting.lines.wait_for(lambda line: "waiting up to" in line and "/voice/say" in line,
                               START_LIMIT)
        self.assert_speaks(running)
        self.assertEqual(waiting.stop(signal.SIGTERM)[0], 1)
        self.assert_speaks(running)

    def test_a_name_of_its_own(self):
        other = self.controller("__name:=other", "__ns:=/hall")
        other.lines.wait_for(lambda line: " starts, " in line, START_LIMIT)
        self.assertIsNotNone(self.master.lookupNode("/hall/other"))
        refused = self.controller("__name:=hall/other")
        self.assertEqual(refused.wait(START_LIMIT), 2)
        self.assertIn("argument __name:=hall/other", refused.lines.text())

    def test_parameters_below_the_name_that_it_is_given(self):
        self.addCleanup(self.master.deleteParam, "/hall")
        self.master.setParam("/hall/other", {"language": "Klingon"})
        node = self.controller("__name:=other", "__ns:=/hall")
        self.assertEqual(node.wait(START_LIMIT), 2)
        self.assertIn("Klingon", node.lines.text())

    def test_a_web_page_does_not_end_it_and_rosnode_does(self):
        running = self.running()
        place = urllib.parse.urlsplit(self.master.lookupNode(NAME))
        call = xmlrpc.client.dumps(("/page", "gone"), "shutdown")
        for headers in ({"Content-Type": "text/plain"},
                        {"Content-Type": "text/xml", "Origin": "http://page.example"}):
            client = http.client.HTTPConnection(place.hostname, place.port, timeout=10)
            client.request("POST", "/", call, headers)
            self.assertEqual(client.getresponse().status, 403)
            client.close()
        with xmlrpc.client.ServerProxy(place.geturl()) as node:
            protocol, host, port = node.requestTopic("/test", "/rosout", [["TCPROS"]])[2]
        # whoever is silent at the other port keeps nobody else from it
        with socket.create_connection((host, port)), \
                socket.create_connection((host, port), timeout=10) as page:
            page.sendall(b"POST / HTTP/1.1\r\nOrigin: null\r\nContent-Length: 9\r\n\r\nshutdown!")
            with contextlib.suppress(ConnectionResetError):
                self.assertEqual(page.recv(10), b"")
        self.assert_speaks(running)
        refused = [line for _, line in running.lines.all if "a browser has sent" in line]
        self.assertEqual(len(refused), 1, running.lines.text())
        self.assertNotIn("Traceback", running.lines.text())
        with contextlib.suppress(ConnectionError), xmlrpc.client.ServerProxy(
                place.geturl()) as node:
            node.shutdown("/rosnode", "")  # which may end it before the answer
        self.assertEqual(running.wait(10), 0, running.lines.text())

    # ------------------------------------------------------------------------- a start that is good

    def test_the_newer_one_stays_and_the_older_one_says_why_it_goes(self):
        older = self.running()
        for _ in range(ROUNDS):
            newer = self.controller()
            self.assertEqual(older.wait(START_LIMIT), 0)
            self.assertIn("another node was started under the name " + NAME, older.lines.text())
            self.assertIn("exit code 0", older.lines.text())
            newer.lines.wait_for(lambda line: " starts, " in line, START_LIMIT)
            self.assert_speaks(newer)
            self.assert_registered()
            older = newer

    def test_the_newer_one_asks_for_nothing_before_the_older_one_has_ended(self):
        older = self.running()
        newer = self.controller("_verboseMode:=true")
        self.assertEqual(older.wait(START_LIMIT), 0)
        calm = max(request["time"] for request in self.robot.requests()
                   if request["fields"].get("state") == "disabled")
        started, _ = newer.lines.wait_for(lambda line: " starts, " in line, START_LIMIT)
        self.assertGreater(started, calm)

    @on_one_python
    def test_an_older_one_that_does_not_end_is_reported(self):
        older = self.running()
        older.process.send_signal(signal.SIGSTOP)
        newer = self.controller()
        newer.lines.wait_for(lambda line: "[WARN]" in line and "does not end" in line, START_LIMIT)
        older.process.send_signal(signal.SIGCONT)
        self.assertEqual(older.wait(START_LIMIT), 0)
        self.assert_speaks(newer)

    @on_one_python
    def test_of_several_that_start_at_once_one_stays(self):
        nodes = [self.running()]
        for _ in range(ROUNDS):
            nodes += [self.controller() for _ in range(AT_ONCE)]
            for node in nodes:
                node.lines.wait_for(lambda line: " starts, " in line or "another node" in line,
                                    START_LIMIT)
            self.robot.wait_for_request(SAY, START_LIMIT, start=len(self.robot.lines.all))
            staying = [node for node in nodes if node.process.pid == self.named()]
            self.assertEqual(len(staying), 1)
            leaving = [node for node in nodes if node is not staying[0]]
            self.assertEqual([node.wait(START_LIMIT) for node in leaving], [0] * AT_ONCE)
            self.assert_speaks(staying[0])
            self.assert_registered()
            nodes = staying

    # -------------------------------------------------------------------- another name, same robot

    def assert_refused(self, node, first):
        """Expect that a start has failed, with one line about the controller ``first``."""
        self.assertEqual(node.wait(START_LIMIT), 1, node.lines.text())
        errors = [line for _, line in node.lines.all if "[ERROR]" in line]
        self.assertEqual(len(errors), 1, node.lines.text())
        self.assertRegex(errors[0], "node {} already controls this robot".format(first))

    def test_a_robot_has_one_controller_whatever_its_name_is(self):
        running = self.running()
        below = ["/robot2{0}:={0}".format(name) for name in (*SERVICES, "/faceDetection/data")]
        for words in (["__name:=other"], ["__ns:=/hall"], ["_robot:=robot2", *below],
                      ["_robot:=robot2"] + [word.replace("/robot2", "") for word in below]):
            self.assert_refused(self.controller(*words), NAME)
            self.assert_speaks(running)

    def test_a_killed_controller_is_in_nobodys_way(self):
        killed = self.running()
        killed.process.kill()
        killed.wait(10)
        other = self.controller("__name:=other")
        other.lines.wait_for(lambda line: " starts, " in line, START_LIMIT)
        self.assertIsNotNone(self.master.lookupNode(NAME), "its entry is left")

    def test_of_several_names_that_start_at_once_one_stays(self):
        nodes = {"/n{}".format(number): self.controller("__name:=n{}".format(number))
                 for number in range(AT_ONCE)}
        for node in nodes.values():
            node.lines.wait_for(lambda line: " starts, " in line or "already controls" in line,
                                START_LIMIT)
        staying, = (name for name, node in nodes.items() if " starts, " in node.lines.text())
        for name, node in nodes.items():
            if name != staying:
                self.assert_refused(node, "/n[0-9]")  # the one that it met first
        self.robot.wait_for_request(SAY, START_LIMIT, start=len(self.robot.lines.all))

    def test_a_mission_of_another_robot_does_not_follow_by_a_reload(self):
        running = self.running()
        self.package.configure(scenarioSpecification="m", robot="robot1")
        running.process.send_signal(signal.SIGHUP)
        running.lines.wait_for(lambda line: "refused, the running mission stays" in line
                               and "robot robot1 cannot follow" in line, START_LIMIT)
        self.assert_speaks(running)

    # ------------------------------------------------------------------------- the master's request

    def test_a_request_of_the_master_that_is_out_of_date_ends_nobody(self):
        running = self.running()
        with xmlrpc.client.ServerProxy(self.master.lookupNode(NAME)) as node:
            node.shutdown("/master", "[{}] Reason: new node registered with same name".format(NAME))
        self.assert_speaks(running)

    def test_a_publication_that_another_start_removed_comes_back(self):
        """The master forgets what a node has registered when another of its name registers, even if
        that one ends."""
        self.running()
        rosgraph.Master(NAME).unregisterPublisher("/rosout", self.master.lookupNode(NAME))
        self.assert_registered()

    def test_a_newer_one_of_which_the_master_said_nothing(self):
        """The master asks the older node only once to end; here never, as it has forgotten that
        node."""
        running = self.running()
        theirs, uri = rosgraph.Master(NAME), self.master.lookupNode(NAME)
        publishers, subscribers, services = ([name for name, nodes in kind if NAME in nodes]
                                             for kind in self.master.getSystemState())
        for topic in publishers:
            theirs.unregisterPublisher(topic, uri)
        for topic in subscribers:
            theirs.unregisterSubscriber(topic, uri)
        for service in services:
            theirs.unregisterService(service, theirs.lookupService(service))
        with xmlrpc.client.ServerProxy(os.environ["ROS_MASTER_URI"]) as master:
            master.registerSubscriber(NAME, "/other", "std_msgs/String", "http://localhost:9/")
        self.addCleanup(theirs.unregisterSubscriber, "/other", "http://localhost:9/")
        self.assertEqual(running.wait(START_LIMIT), 0)


if __name__ == "__main__":
    rostest.rosrun("cssr_system", "one_node", TestOneNode)
