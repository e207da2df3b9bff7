#!/usr/bin/env python3
"""Can the running node be monitored with Groot2, a browser and the terminal, and its record be
replayed?"""
import json
import os
import resource
import socket
import struct
import subprocess
import sys
import urllib.request

import rostest
import zmq

from behavior_controller.run.record.files import runs

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from robot import NodeCase, free_ports, robot_for  # noqa: E402

SAY = "/textToSpeech/say_text"
MISSION = """<root BTCPP_format="4" main_tree_to_execute="M"><BehaviorTree ID="M"><Sequence>
  <START_OF_TREE/><LookUpHome/><Navigate/><WelcomeSpeech/></Sequence></BehaviorTree></root>"""

CALLED = 20
CALLS = """<root BTCPP_format="4" main_tree_to_execute="M"><BehaviorTree ID="M"><Sequence>
  <START_OF_TREE/><WelcomeSpeech/>
  <Repeat num_cycles="{}"><Sequence><WelcomeSpeech/><Delay delay_msec="100"><AlwaysSuccess/></Delay></Sequence></Repeat>
  </Sequence></BehaviorTree></root>""".format(CALLED)


def descriptors(process):
    """Return how many a process has."""
    return len(os.listdir("/proc/{}/fd".format(process)))


class TestWatch(NodeCase):
    """One mission that hangs in its last leaf while it is monitored."""

    def setUp(self):
        super().setUp()
        self.package.write("data/m.xml", MISSION)
        self.groot2, self.page = free_ports()

    def start(self):
        self.robot = robot_for(self, {SAY: "hang"})
        self.package.configure(scenarioSpecification="m", groot2Port=self.groot2,
                               monitorPort=self.page,
                               recordDirectory=os.path.join(self.folder, "record"), missionRuns=1)
        self.node = self.controller()
        self.robot.wait_for_request(SAY, 20)

    def start_with_page(self):
        """Start robot and node, and wait for the viewer, which starts beside the mission."""
        self.start()
        self.node.lines.wait_for(lambda line: " page: " in line, 20)

    def test_where_to_find_page_and_record_is_told(self):
        self.start()
        record, = runs(os.path.join(self.folder, "record"))
        page = "http://127.0.0.1:{}/".format(self.page)
        self.node.lines.wait_for(lambda line: line.endswith(" page: " + page), 10)
        self.node.lines.wait_for(lambda line: line.endswith(" record: " + record), 10)
        self.node.stop()
        told = self.node.lines.text()
        self.assertIn("page of this run, closed now: {}\n".format(page), told)
        self.assertTrue(told.endswith("record of this run: " + record), told)
        with open(record) as file:
            self.assertEqual(
                json.loads(file.read().splitlines()[-1])["event"]["_type"], "RunFinished")

    def command(self, name, *arguments):
        """Run one of the package's commands and return its exit code and what it printed."""
        done = subprocess.run(
            [*self.package.command(name), *arguments], env=self.package.environment(), timeout=30,
            stdout=subprocess.PIPE, stderr=subprocess.STDOUT, universal_newlines=True)
        return done.returncode, done.stdout

    def groot2_client(self):
        """Return a ZeroMQ socket that asks as Groot2 does."""
        context = zmq.Context()
        self.addCleanup(context.destroy, 0)
        client = context.socket(zmq.REQ)
        client.setsockopt(zmq.RCVTIMEO, 5000)
        client.connect("tcp://127.0.0.1:{}".format(self.groot2))
        return client

    def test_it_is_seen_while_it_runs_and_replayed_afterwards(self):
        self.start_with_page()
        client = self.groot2_client()
        client.send(struct.pack("<BBI", 2, ord("S"), 1))
        statuses = dict(struct.iter_unpack("<HB", client.recv_multipart()[1]))
        self.assertEqual(statuses, {1: 1, 2: 2, 3: 2, 4: 2, 5: 1})
        with urllib.request.urlopen("http://127.0.0.1:{}/state".format(self.page),
                                    timeout=5) as answer:
            state = json.load(answer)
        self.assertEqual(state["statuses"], {"letters": "RSSSR", "tip": 5})
        said = state["health"]["/knowledgeBase/query"]
        self.assertEqual((said["calls"], said["failures"]), (1, 0))
        code, printed = self.command("missionStatus", "--port", str(self.page))
        self.assertEqual(code, 0, printed)
        self.assertIn("  ▶ WelcomeSpeech #5: running", printed)
        self.robot.set_mode(SAY, "done")
        self.assertEqual(self.node.wait(10), 0)
        code, printed = self.command("replayMission", os.path.join(self.folder, "record"))
        self.assertEqual(code, 0, printed)
        self.assertIn("the same path: 1 pass,", printed)

    def connect_idly(self, number):
        """Try to exhaust the viewer with ``number`` connections to each of its ports."""
        for _ in range(number):
            for port in (self.page, self.groot2, self.groot2 + 1):
                self.idle.append(socket.create_connection(("127.0.0.1", port), timeout=10))

    def test_idle_connections_take_no_descriptors_from_robot_and_viewer(self):
        self.package.write("data/m.xml", CALLS)
        soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
        # for our own ends of the connections
        resource.setrlimit(resource.RLIMIT_NOFILE, (hard, hard))
        self.addCleanup(resource.setrlimit, resource.RLIMIT_NOFILE, (soft, hard))
        self.idle = []
        self.addCleanup(lambda: [each.close() for each in self.idle])
        self.start_with_page()
        node, viewer = processes = self.node.process.pid, self.node.viewer()
        before = dict(zip(processes, map(descriptors, processes)))
        for process in processes:
            resource.prlimit(process, resource.RLIMIT_NOFILE, (1024, hard))
        self.connect_idly(1100)
        most = {process: descriptors(process) for process in processes}
        self.robot.set_mode(SAY, "done")
        try:
            while self.node.process.poll() is None:
                self.connect_idly(1)
                most = {process: max(most[process], descriptors(process)) for process in processes}
                while len(self.idle) > 5000:
                    self.idle.pop(0).close()
        except (ConnectionError, FileNotFoundError):
            pass  # node and viewer have ended
        self.assertEqual(self.node.wait(30), 0, self.node.lines.text())
        self.assertEqual(len(self.robot.requests(SAY)), 1 + CALLED)
        self.assertLess(most[node] - before[node], 30)  # the robot's
        self.assertLess(most[viewer] - before[viewer], 64 + 2 * 16 + 5)  # the page's, and Groot2's
        self.assertEqual(
            [line for _, line in self.node.lines.all if "[WARN]" in line or "[ERROR]" in line], [])

    def test_the_operator_reads_what_groot2_does(self):
        self.start_with_page()
        client = self.groot2_client()
        hook = {"enabled": True, "uid": 5, "mode": 1, "once": False, "desired_status": "FAILURE",
                "position": 1}
        client.send_multipart([struct.pack("<BBI", 2, ord("I"), 1), json.dumps(hook).encode()])
        self.assertNotEqual(client.recv_multipart()[0], b"error")
        self.node.lines.wait_for(
            lambda line: "Groot2: replacement after WelcomeSpeech::5 is set to FAILURE" in line, 10)
        self.robot.set_mode(SAY, "done")
        self.node.lines.wait_for(
            lambda line: "WelcomeSpeech::5 decides FAILURE instead of the node's SUCCESS" in line,
            10)
        self.assertEqual(self.node.wait(20), 3)

    def test_ports_that_are_taken_do_not_keep_the_mission_from_running(self):
        with socket.socket() as first, socket.socket() as second:
            for listener, port in ((first, self.groot2), (second, self.page)):
                listener.bind(("127.0.0.1", port))
                listener.listen(1)
            self.start()
            for word in ("groot2Port", "monitorPort"):  # another viewer could still end
                self.node.lines.wait_for(lambda line: word in line, 20)
        self.assertEqual(self.node.stop()[0], 0)
        for word in ("groot2Port", "monitorPort"):
            self.assertEqual(sum(word in line for _, line in self.node.lines.all), 1,
                             self.node.lines.text())


if __name__ == "__main__":
    rostest.rosrun("cssr_system", "watch", TestWatch)
