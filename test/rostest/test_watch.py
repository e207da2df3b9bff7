#!/usr/bin/env python3
"""Can one look at the running node with Groot2, a browser and the terminal, and replay what it did?"""
import json
import os
import shutil
import socket
import struct
import subprocess
import sys
import tempfile
import unittest
import urllib.request

import rostest
import zmq

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from robot import Controller, Package, Robot, forget_dead_entries  # noqa: E402

SAY = "/textToSpeech/say_text"
MISSION = """<root BTCPP_format="4" main_tree_to_execute="M"><BehaviorTree ID="M"><Sequence>
  <START_OF_TREE/><LookUpHome/><Navigate/><WelcomeSpeech/></Sequence></BehaviorTree></root>"""


def free_ports():
    """Return a port for Groot2, which takes the next one too, and one for the page."""
    while True:
        with socket.socket() as first, socket.socket() as second, socket.socket() as third:
            first.bind(("127.0.0.1", 0))
            third.bind(("127.0.0.1", 0))
            port = first.getsockname()[1]
            try:
                second.bind(("127.0.0.1", port + 1))
                return port, third.getsockname()[1]
            except (OSError, OverflowError):
                continue


class TestWatch(unittest.TestCase):
    """One mission that hangs in its last leaf while it is looked at."""

    def setUp(self):
        self.folder = tempfile.mkdtemp()
        self.addCleanup(shutil.rmtree, self.folder)
        self.addCleanup(forget_dead_entries)
        self.package = Package(os.path.join(self.folder, "package"))
        self.package.write("data/m.xml", MISSION)
        self.groot2, self.page = free_ports()

    def start(self):
        self.robot = Robot({SAY: "hang"})
        self.addCleanup(self.robot.stop)
        self.package.configure(scenarioSpecification="m", groot2Port=self.groot2, monitorPort=self.page,
                               recordDirectory=os.path.join(self.folder, "record"), missionRuns=1)
        self.node = Controller(self.package)
        self.addCleanup(self.node.close)
        self.robot.wait_for_request(SAY, 20)

    def command(self, name, *arguments):
        """Run one of the package's commands and return its exit code and what it printed."""
        done = subprocess.run([sys.executable, self.package.path("src/behavior_controller/" + name)] + list(arguments),
                              stdout=subprocess.PIPE, stderr=subprocess.STDOUT, universal_newlines=True, timeout=30,
                              env=dict(os.environ, PYTHONPATH=os.pathsep.join(
                                  [self.package.path("src")] + os.environ.get("PYTHONPATH", "").split(os.pathsep))))
        return done.returncode, done.stdout

    def test_it_is_seen_while_it_runs_and_replayed_afterwards(self):
        self.start()
        context = zmq.Context()
        self.addCleanup(context.destroy, 0)
        client = context.socket(zmq.REQ)
        client.setsockopt(zmq.RCVTIMEO, 5000)
        client.connect("tcp://127.0.0.1:{}".format(self.groot2))
        client.send(struct.pack("<BBI", 2, ord("S"), 1))
        statuses = dict(struct.iter_unpack("<HB", client.recv_multipart()[1]))
        self.assertEqual(statuses, {1: 1, 2: 2, 3: 2, 4: 2, 5: 1})
        with urllib.request.urlopen("http://127.0.0.1:{}/state".format(self.page), timeout=5) as answer:
            state = json.load(answer)
        self.assertEqual(state["statuses"], {"letters": "RSSSR", "tip": 5})
        said = [part for part in state["health"] if part["name"] == "/knowledgeBase/query"][0]
        self.assertEqual((said["calls"], said["failures"]), (1, 0))
        code, printed = self.command("missionStatus", "--port", str(self.page))
        self.assertEqual(code, 0, printed)
        self.assertIn("  ▶ WelcomeSpeech #5: running", printed)
        self.robot.set_mode(SAY, "done")
        self.assertEqual(self.node.wait(10), 0)
        code, printed = self.command("replayMission", os.path.join(self.folder, "record", "mission.jsonl"))
        self.assertEqual(code, 0, printed)
        self.assertIn("the same path: 1 passes", printed)

    def test_ports_that_are_taken_do_not_keep_the_mission_from_running(self):
        with socket.socket() as first, socket.socket() as second:
            for listener, port in ((first, self.groot2), (second, self.page)):
                listener.bind(("127.0.0.1", port))
                listener.listen(1)
            self.start()
        for word in ("groot2Port", "monitorPort"):
            self.assertEqual(sum(word in line for _, line in self.node.lines.all), 1, self.node.lines.text())
        self.assertEqual(self.node.stop()[0], 0)


if __name__ == "__main__":
    rostest.rosrun("cssr_system", "watch", TestWatch)
