#!/usr/bin/env python3
"""Does the mission go on while the viewer is stopped, killed or flooded, does the viewer come back,
and does it end with the node?"""
import contextlib
import fcntl
import json
import os
import pty
import random
import select
import signal
import socket
import subprocess
import sys
import termios
import threading
import time
import urllib.request

import rostest
import zmq


sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from robot import BUSY, NodeCase, Robot, free_ports  # noqa: E402

SAY, FACES = "/textToSpeech/say_text", "/faceDetection/data"
NO_FACE = [], [], []
UNTIL = "<ReactiveFallback>{}<Sleep msec=\"600000\"/></ReactiveFallback>"
MISSION = """<root BTCPP_format="4" main_tree_to_execute="M"><BehaviorTree ID="M">
  <Repeat num_cycles="-1"><Sequence>{}<WelcomeSpeech/>{}<SayGoodByeSpeech/></Sequence></Repeat>
  </BehaviorTree></root>""".format(UNTIL.format("<IsVisitorDiscovered/>"),
                                   UNTIL.format("<Inverter><IsVisitorDiscovered/></Inverter>"))
WELCOME = 6  # the uid of the step

REACTION_LIMIT = 0.5  # s, which a loaded computer keeps
GONE_LIMIT = 2.0  # s after the node
PAGE_LIMIT = 10.0  # s from the end of the former node to the page of its successor
REACTIONS = 40
CLIENTS = 200
MESSAGES, FRAMES = 1000, 10


class Browser:
    """The parts of the page, as its browser has them."""

    def __init__(self, port):
        self.parts, self._news = {}, threading.Condition()
        self._stream = urllib.request.urlopen("http://127.0.0.1:{}/events".format(port), timeout=60)
        threading.Thread(target=self._read, daemon=True).start()

    def _read(self):
        with contextlib.suppress(OSError, ValueError, AttributeError):  # the viewer was killed
            for line in self._stream:
                if line.startswith(b"data: "):
                    with self._news:
                        self.parts = dict(self.parts, **json.loads(line[len(b"data: "):]))
                        self._news.notify_all()

    def wait_for(self, wanted):
        """Return the parts when they are so."""
        with self._news:
            if not self._news.wait_for(lambda: self.parts and wanted(self.parts), BUSY * 10):
                raise AssertionError("the page does not show it: {}".format(
                    self.parts and self.parts["now"]))
            return self.parts

    def wait_for_card(self, kind, words=""):
        """Return the parts when the card "Now" is of that kind, with these words."""
        return self.wait_for(lambda parts: parts["now"]["card"]["kind"] == kind
                             and words in parts["now"]["card"]["what"])


class TestViewer(NodeCase):
    """A visitor comes and goes; the viewer of the node that greets him has its troubles."""

    def setUp(self):
        super().setUp()
        self.package.write("data/m.xml", MISSION)
        self.groot2, self.port = free_ports()
        self.package.configure(scenarioSpecification="m", groot2Port=self.groot2,
                               monitorPort=self.port)

    def tearDown(self):
        """No viewer stays."""
        self.doCleanups()
        viewers = subprocess.run(["pgrep", "-f", "--", "--child --port {} ".format(self.port)],
                                 stdout=subprocess.PIPE, universal_newlines=True).stdout
        for number in map(int, viewers.split()):
            with contextlib.suppress(ProcessLookupError):  # it has ended meanwhile
                self.assert_gone(os.pidfd_open(number), time.monotonic())

    def start_robot(self):
        """Start the robot."""
        self.robot = Robot()
        self.addCleanup(self.robot.stop)

    def start(self, *arguments):
        """Start a node, and return it when its page is served."""
        node = self.controller(*arguments)
        node.lines.wait_for(self.tells_page, 20)
        return node

    def tells_page(self, line):
        return line.endswith(" page: http://127.0.0.1:{}/".format(self.port))

    def running(self):
        """Start robot and node, and return the node while its mission runs."""
        self.start_robot()
        node = self.start()
        self.assert_shows_the_mission()
        return node

    def assert_shows_the_mission(self):
        """Expect that the page shows the running tree."""
        browser = Browser(self.port)
        parts = browser.wait_for(lambda parts: parts["statuses"]["letters"].startswith("RR"))
        self.assertEqual(parts["mission"]["nodes"][WELCOME - 1]["name"], "WelcomeSpeech")
        return browser

    def assert_reacts(self, moment, rounds=REACTIONS):
        """Expect that the visitor is greeted, and said good-bye to, in time."""
        taken = []
        for turn in range(rounds):
            taken.append(self.robot.reaction(SAY, FACES, *(NO_FACE if turn % 2 else ())))
        print("{}: the slowest of {} reactions {:.3f} s".format(moment, rounds, max(taken)))
        self.assertLess(max(taken), REACTION_LIMIT, moment)

    def assert_gone(self, viewer, since):
        """Expect the end of the process with that file descriptor in time."""
        self.addCleanup(os.close, viewer)
        limit = since + GONE_LIMIT - time.monotonic()
        self.assertTrue(select.select([viewer], [], [], max(0.0, limit))[0], "the viewer stays")
        print("{}: gone after {:.2f} s".format(self.id(), time.monotonic() - since))

    # -------------------------------------------------------------------------- while the node runs

    def test_the_mission_goes_on_and_the_viewer_comes_back(self):
        node = self.running()
        self.assert_reacts("undisturbed")
        for sign, words in ((signal.SIGSTOP, "no sign of life"), (signal.SIGKILL, "signal 9")):
            seen = len(node.lines.all)
            os.kill(node.viewer(), sign)
            self.assert_reacts(sign.name)
            node.lines.wait_for(lambda line: "is started again" in line and words in line, 20, seen)
            self.assert_reacts("start of the viewer")
            node.lines.wait_for(self.tells_page, 20, seen)
            self.assert_shows_the_mission()
        seen = len(node.lines.all)
        with contextlib.ExitStack() as held:
            for port in (self.port, self.groot2):
                for _ in range(CLIENTS):
                    client = held.enter_context(
                        socket.create_connection(("127.0.0.1", port), timeout=10))
                    with contextlib.suppress(ConnectionError):  # it has no place any more
                        client.sendall(b"GET /events HTTP/1.1\r\nHost: localhost\r\n\r\n")
            self.assert_reacts("{} clients".format(CLIENTS))
        self.refused = 0
        sender = threading.Thread(target=self.send_garbage)
        sender.start()
        while sender.is_alive():
            self.assert_reacts("garbage", 4)
        self.assertEqual(self.refused, MESSAGES)
        self.assertFalse([line for _, line in node.lines.all[seen:] if "viewer" in line])
        self.assert_shows_the_mission()
        self.assertEqual(node.stop()[0], 0)

    def send_garbage(self):
        """Send messages to Groot2's port that make no sense, each of which is answered."""
        draw = random.Random(1)
        with self.groot2_client() as client:
            for _ in range(MESSAGES):
                client.send_multipart([bytes(draw.choices(range(256), k=draw.randrange(7, 40)))
                                       for _ in range(FRAMES)])
                self.refused += client.recv_multipart()[0] == b"error"

    @contextlib.contextmanager
    def groot2_client(self):
        """Yield a socket that asks as Groot2 does."""
        with zmq.Context() as context, context.socket(zmq.REQ) as client:
            client.setsockopt(zmq.LINGER, 0)
            client.setsockopt(zmq.RCVTIMEO, 20000)
            client.connect("tcp://127.0.0.1:{}".format(self.groot2))
            yield client

    # ------------------------------------------------------------------------ start and end of both

    def test_ctrl_c_in_the_terminal_shows_the_end_first(self):
        self.start_robot()
        operator, terminal = pty.openpty()
        self.addCleanup(os.close, operator)

        def take_terminal():
            os.setsid()
            fcntl.ioctl(terminal, termios.TIOCSCTTY, 0)

        node = self.controller(preexec_fn=take_terminal, stdin=terminal)
        os.close(terminal)
        node.lines.wait_for(self.tells_page, 20)
        browser, viewer = self.assert_shows_the_mission(), os.pidfd_open(node.viewer())
        os.write(operator, b"\x03")
        self.assertEqual(node.wait(10), 0)
        self.assert_gone(viewer, time.monotonic())
        parts = browser.wait_for_card("ended", "stopped")
        self.assertIn("off", parts["now"]["robot"]["safe"])

    def test_it_ends_with_a_node_that_ends_while_it_is_stopped(self):
        self.start_robot()
        node = self.start()
        number = node.viewer()
        viewer = os.pidfd_open(number)
        os.kill(number, signal.SIGSTOP)
        self.assertEqual(node.stop()[0], 0)
        with contextlib.suppress(ProcessLookupError):
            os.kill(number, signal.SIGCONT)
        self.assert_gone(viewer, time.monotonic())

    def test_the_page_of_a_node_that_takes_over(self):
        older = self.running()
        newer = self.controller()
        self.assertEqual(older.wait(20), 0)
        ended = time.monotonic()
        told, _ = newer.lines.wait_for(self.tells_page, 20)
        self.assertLess(told - ended, PAGE_LIMIT)
        self.assert_shows_the_mission()
        self.assertNotIn("Port", "".join(line for _, line in newer.lines.all if "[WARN]" in line))

    def test_the_page_says_what_a_start_waits_for_and_why_it_is_refused(self):
        node = self.start("_startupTimeout:=15")
        browser = Browser(self.port)
        browser.wait_for_card("idle", "starting: waiting up to ")
        self.assertEqual(node.wait(60), 1)
        parts = browser.wait_for_card("ended", "nothing was started")
        said = [sentence["text"] for sentence in parts["story"]["sentences"]]
        self.assertTrue(any(SAY in text and "without it" in text for text in said), said)


if __name__ == "__main__":
    rostest.rosrun("cssr_system", "viewer", TestViewer)
