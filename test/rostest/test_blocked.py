#!/usr/bin/env python3
"""Does the mission go on, and does the node stop, while a terminal, a pipe, a disk or the master is
blocked?"""
import fcntl
import os
import pty
import re
import resource
import signal
import socket
import subprocess
import sys
import threading
import time
import unittest

import rostest

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from robot import (  # noqa: E402
    BUSY, MASTER_IS_GONE, NodeCase, robot_for, start_master)

ATTENTION, ANIMATION = "/overtAttention/set_mode", "/animateBehaviour/set_activation"
SAY = "/textToSpeech/say_text"
LIMIT = 2.0
CTRL_S, CTRL_Q = b"\x13", b"\x11"
SMALLEST_PIPE = 4096
F_SETPIPE_SZ = 1031  # fcntl has the name from Python 3.10 on
MISSION = """<root BTCPP_format="4" main_tree_to_execute="M">
  <BehaviorTree ID="M"><Sequence><START_OF_TREE/><EnableAnimateBehavior/><ScanningOvertAttentionMode/>{}</Sequence>
  </BehaviorTree>
</root>
"""
TALKING = ("<Repeat num_cycles=\"-1\"><ForceSuccess><Sequence><Sleep "
           "msec=\"10\"/><WelcomeSpeech/></Sequence></ForceSuccess></Repeat>")
ONLY_TALKING = """<root BTCPP_format="4" main_tree_to_execute="M"><BehaviorTree ID="M"><Sequence><START_OF_TREE/>{}
</Sequence></BehaviorTree></root>""".format(TALKING)

WITHOUT_THREADS = """import os, threading
start = threading.Thread.start
def start_if_allowed(thread):
    if os.path.exists(os.environ["WITHOUT_THREADS"]):
        raise RuntimeError("can't start new thread")
    start(thread)
threading.Thread.start = start_if_allowed"""
"""A system that gives no more threads while a file exists."""


class TestBlocked(NodeCase):
    """Each case has a copy of the package; some have their own master, which they may freeze."""

    def setUp(self):
        super().setUp()
        self.master = None
        self.environment = {"ROS_HOME": os.path.join(self.folder, "ros")}

    def own_master(self):
        """Run a master that this case may freeze, and return its process."""
        before = os.environ["ROS_MASTER_URI"]
        self.addCleanup(os.environ.update, ROS_MASTER_URI=before)
        self.master = start_master()
        return self.master

    def tearDown(self):
        """Clean up first: no other clean-up may wait for a frozen master."""
        if self.master is not None:
            self.master.kill()
            self.master.wait()

    def prepare(self, mission, modes=None, **keys):
        """Write the mission and start the robot."""
        self.package.write("data/m.xml", MISSION.format(mission))
        self.package.configure(scenarioSpecification="m", **keys)
        self.robot = robot_for(self, modes)

    def controller(self, *arguments):
        """Start the node, with its output read by this test."""
        return super().controller(*arguments, **self.environment)

    def start_process(self, *arguments, **options):
        """Start the node with the output that ``options`` of Popen say."""
        process = subprocess.Popen(self.package.command("behaviorController") + list(arguments),
                                   stdin=options.pop("stdin", subprocess.DEVNULL),
                                   env=self.package.environment(**self.environment), **options)
        self.addCleanup(process.wait, 10)
        self.addCleanup(process.kill)
        return process

    def assert_says_on(self, count=20):
        """Expect that the mission goes on."""
        start = len(self.robot.lines.all)
        for _ in range(count):
            self.robot.wait_for_request(SAY, 5, start)
            start = len(self.robot.lines.all)

    def assert_stops_safely(self, process, number=signal.SIGTERM):
        """Expect the end within the limit, the safe state, and the exit code of a run without a
        finished pass."""
        sent = time.monotonic()
        process.send_signal(number)
        self.assertEqual(process.wait(10), 0)
        seconds = time.monotonic() - sent
        print("{}: stopped after {:.2f} s".format(self.id(), seconds))
        self.assertLess(seconds, LIMIT)
        self.assertEqual(sorted(request["service"] for request in self.robot.requests()[-2:]),
                         sorted([ATTENTION, ANIMATION]))
        self.assertTrue(
            all(request["fields"]["state"] == "disabled" for request in self.robot.requests()[-2:]))

    # --------------------------------------------------------------------------- what takes no line

    def small_pipe(self):
        """Return both ends of a pipe with room for one page."""
        ends = os.pipe()
        for end in ends:
            self.addCleanup(os.close, end)
        fcntl.fcntl(ends[0], F_SETPIPE_SZ, SMALLEST_PIPE)
        return ends

    def terminal(self):
        """Return both ends of a terminal."""
        master, slave = pty.openpty()
        self.addCleanup(os.close, master)
        self.addCleanup(os.close, slave)
        return master, slave

    def test_a_frozen_master(self):
        master = self.own_master()
        self.prepare(TALKING, textToSpeechDeadline="2", verboseMode="true")
        controller = self.controller()
        self.robot.wait_for_request(SAY, 20)
        master.send_signal(signal.SIGSTOP)
        frozen = time.monotonic()
        controller.lines.wait_for(lambda line: all(words in line for words in MASTER_IS_GONE), 8)
        self.assert_says_on()
        self.robot.set_mode(SAY, "hang")
        hung = self.robot.requests(SAY)[-1]["time"]
        start = len(controller.lines.all)
        given_up, _ = controller.lines.wait_for(
            lambda line: "WelcomeSpeech" in line and "FAILURE" in line, 5, start)
        self.assertTrue(1.5 < given_up - hung < 2.0 + 0.5 * BUSY, given_up - hung)
        beat, _ = controller.lines.wait_for(lambda line: "running." in line, 11)
        self.assertGreater(beat, frozen)
        self.assert_stops_safely(controller.process)
        self.assertNotIn("Traceback", controller.lines.text())

    def test_a_master_that_freezes_at_the_moment_of_the_stop(self):
        master = self.own_master()
        self.prepare("")
        # the services of the safe state were not called: their connections must be made
        self.package.write("data/m.xml", ONLY_TALKING)
        controller = self.controller()
        self.robot.wait_for_request(SAY, 20)
        master.send_signal(signal.SIGSTOP)
        self.assert_stops_safely(controller.process)

    def test_every_sink_at_once(self):
        master = self.own_master()
        record = os.path.join(self.folder, "record")
        os.mkfifo(record)
        log = os.path.join(self.folder, "log")
        os.mkfifo(log)
        log_end = os.open(log, os.O_RDWR)
        self.addCleanup(os.close, log_end)
        fcntl.fcntl(log_end, F_SETPIPE_SZ, SMALLEST_PIPE)
        operator, terminal = self.terminal()
        self.prepare(TALKING, verboseMode="true", recordDirectory=record)
        process = self.start_process("__log:=" + log, stdout=terminal, stderr=self.small_pipe()[1])
        self.robot.wait_for_request(SAY, 20)
        os.write(operator, CTRL_S)
        master.send_signal(signal.SIGSTOP)
        self.assert_says_on(100)
        self.assert_stops_safely(process)

    def test_a_terminal_that_is_held_shows_its_lines_when_it_is_let_go(self):
        operator, terminal = self.terminal()
        self.prepare(TALKING, verboseMode="true")
        process = self.start_process(stdin=terminal, stdout=terminal, stderr=terminal)
        self.robot.wait_for_request(SAY, 20)
        os.write(operator, CTRL_S)
        held = len(self.robot.requests(SAY))
        self.assert_says_on()
        os.write(operator, CTRL_Q)
        shown = b""
        while shown.count(b"WelcomeSpeech (") < held + 20:
            shown += os.read(operator, 65536)
        self.assertNotIn(b"left out", shown)
        threading.Thread(target=self.read_on, args=(operator,), daemon=True).start()
        self.assert_stops_safely(process)

    @staticmethod
    def read_on(descriptor):
        """Read until the other end is closed."""
        try:
            while os.read(descriptor, 65536):
                pass
        except OSError:
            pass

    def test_an_unread_pipe(self):
        self.prepare(TALKING, verboseMode="true")
        reader, writer = self.small_pipe()
        process = self.start_process(stdout=writer, stderr=subprocess.STDOUT)
        self.robot.wait_for_request(SAY, 20)
        self.assert_says_on(100)
        self.assertGreater(len(os.read(reader, SMALLEST_PIPE)), SMALLEST_PIPE // 2)  # it was full
        self.assert_stops_safely(process, signal.SIGQUIT)

    def test_closed_standard_streams(self):
        self.prepare("<WelcomeSpeech/>", missionRuns=1)
        for closed in ((1,), (2,), (0, 1, 2)):
            said = len(self.robot.requests(SAY))
            process = self.start_process(
                stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
                preexec_fn=lambda closed=closed: [os.close(descriptor) for descriptor in closed])
            self.assertEqual(process.wait(20), 0)
            self.assertEqual(len(self.robot.requests(SAY)), said + 1)

    # ------------------------------------------------------------------------- what does not answer

    def test_a_configuration_that_cannot_be_read_to_its_end(self):
        self.prepare(TALKING)
        controller = self.controller()
        self.robot.wait_for_request(SAY, 20)
        configuration = self.package.path("config/behaviorControllerConfiguration.ini")
        os.remove(configuration)
        os.mkfifo(configuration)
        controller.process.send_signal(signal.SIGHUP)
        self.assert_says_on()
        self.assert_stops_safely(controller.process)

    def test_a_master_that_freezes_before_the_files_are_read_again(self):
        master = self.own_master()
        self.prepare(TALKING)
        controller = self.controller()
        self.robot.wait_for_request(SAY, 20)
        master.send_signal(signal.SIGSTOP)
        ends = time.monotonic() + 5.0 * BUSY
        while not re.search("SIGHUP ignored.*still being read", controller.lines.text()):
            self.assertLess(time.monotonic(), ends, controller.lines.text())
            controller.process.send_signal(signal.SIGHUP)
            time.sleep(0.3)  # two signals that are pending together are one
        self.assert_says_on()
        self.assert_stops_safely(controller.process)

    def test_files_that_cannot_be_read_again_because_of_the_master_are_refused(self):
        master = self.own_master()
        self.prepare(TALKING)
        controller = self.controller()
        self.robot.wait_for_request(SAY, 20)
        master.kill()
        master.wait()
        controller.process.send_signal(signal.SIGHUP)
        controller.lines.wait_for(
            lambda line: "refused, the running mission stays" in line and "master" in line, 10)
        self.assert_says_on()
        self.assert_stops_safely(controller.process)

    def test_a_master_that_freezes_while_the_node_registers(self):
        real = re.match(r"http://(.*):(\d+)", os.environ["ROS_MASTER_URI"])
        relay = Relay((real.group(1), int(real.group(2))))
        self.addCleanup(relay.close)
        self.environment["ROS_MASTER_URI"] = "http://localhost:{}".format(relay.port)
        self.prepare(TALKING)
        controller = self.controller()
        relay.wait_for_registration(10)
        code, seconds = controller.stop(signal.SIGTERM)
        self.assertLess(seconds, LIMIT)
        self.assertEqual(code, 1)
        controller = self.controller()
        self.assertEqual(controller.wait(25), 1)
        waits, ends = [line for _, line in controller.lines.all][-2:]
        self.assertIn("waiting up to 15 s for the ROS master", waits)
        self.assertIn("no longer answers", ends)

    # ----------------------------------------------------------------- a machine that gives no more

    def allow_threads(self, count):
        """Become a user without processes, with that many threads in addition to the first. In the
        new process."""
        user = 100000 + os.getppid()
        resource.setrlimit(resource.RLIMIT_NPROC, (1 + count, 1 + count))
        os.setgid(user)
        os.setuid(user)

    def end_of(self, limit):
        """Run the node to its end under a limit; return exit code and lines."""
        process = self.start_process(stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                                     universal_newlines=True, preexec_fn=limit)
        text = process.communicate(timeout=60)[0]
        return process.returncode, text

    def assert_says_why(self, limits, limit):
        """Run the node under each of ``limits``: it runs the mission, or ends with the documented
        code and a reason."""
        codes = set()
        for number in limits:
            code, text = self.end_of(lambda number=number: limit(number))
            codes.add(code)
            self.assertNotIn("Traceback", text)
            if code == 4:
                self.assertRegex(text, "no more memory, threads or files|cannot be loaded")
            self.assertLessEqual(text.count("no more memory, threads or files"), 1, text)
        self.assertLessEqual({0, 4}, codes)
        self.assertLessEqual(codes, {0, 3, 4})  # 3: a step of the mission got no thread

    @unittest.skipIf(os.getuid() != 0,
                     "only root can become a user without processes, whose threads can be counted")
    def test_few_threads(self):
        os.chown(self.folder, 100000 + os.getpid(), -1)
        self.prepare("<WelcomeSpeech/>", missionRuns=1)
        self.assert_says_why((0, 2, 3, 5, 6, 8, 12, 60), self.allow_threads)

    def test_a_stop_without_a_new_thread_reaches_both_parts_of_the_safe_state(self):
        self.package.write("src/sitecustomize.py", WITHOUT_THREADS)
        for hanging in (None, ATTENTION, ANIMATION):
            self.prepare("", {hanging: "hang"} if hanging else {})
            self.package.write("data/m.xml", ONLY_TALKING)
            self.environment["WITHOUT_THREADS"] = self.package.path("threads_are_over")
            controller = self.controller()
            self.robot.wait_for_request(SAY, 20)
            self.package.write("threads_are_over", "")
            _, seconds = controller.stop(signal.SIGTERM)
            os.remove(self.package.path("threads_are_over"))
            self.assertLess(seconds, LIMIT)
            for service in (ATTENTION, ANIMATION):
                self.robot.wait_for_request(service, 1, state="disabled")
            self.assertNotIn("Traceback", controller.lines.text())

    def test_without_files_the_computer_is_named_and_neither_master_nor_nodes_are_gone(self):
        self.prepare(TALKING)
        controller = self.controller()
        self.robot.wait_for_request(SAY, 20)
        time.sleep(1.0)  # the connections that are watched stand
        number = controller.process.pid
        soft, hard = resource.prlimit(number, resource.RLIMIT_NOFILE)
        used = set(map(int, os.listdir("/proc/{}/fd".format(number))))
        free = next(each for each in range(hard) if each not in used)
        resource.prlimit(number, resource.RLIMIT_NOFILE, (free, hard))
        computer = re.compile("computer {}: gives this node no more .*Too many open files".format(
            socket.gethostname())).search
        controller.lines.wait_for(computer, 5)
        controller.lines.wait_for(re.compile("robot: .* is out of resources.*End what uses up"
                                             ).search, 5)
        self.assert_says_on(200)
        self.assertNotRegex(controller.lines.text(), "gone|does not answer|master,")
        resource.prlimit(number, resource.RLIMIT_NOFILE, (soft, hard))
        controller.lines.wait_for(lambda line: "memory again" in line, 5)
        self.assert_stops_safely(controller.process)

    def test_little_memory(self):
        self.prepare("<WelcomeSpeech/>", missionRuns=1)
        self.assert_says_why((90, 140, 220, 500, 4000), lambda megabytes: resource.setrlimit(
            resource.RLIMIT_AS, (megabytes * 1000000, megabytes * 1000000)))


class Relay:
    """A master that freezes when a node registers: passes on what comes before that, and holds the
    rest."""

    def __init__(self, master):
        self._master = master
        self._held = []
        self._registers = threading.Event()
        self._server = socket.create_server(("127.0.0.1", 0))
        self.port = self._server.getsockname()[1]
        threading.Thread(target=self._serve, daemon=True).start()

    def wait_for_registration(self, seconds):
        """Return when a registration is held."""
        assert self._registers.wait(seconds), "no node registers"

    def close(self):
        """Release all connections."""
        for sock in [self._server] + self._held:
            sock.close()

    def _serve(self):
        try:
            while True:
                client, _ = self._server.accept()
                server = socket.create_connection(self._master)
                self._held += [client, server]
                for source, target in ((client, server), (server, client)):
                    threading.Thread(target=self._pass_on, args=(source, target),
                                     daemon=True).start()
        except OSError:
            pass  # closed

    def _pass_on(self, source, target):
        try:
            data = source.recv(65536)
            while data and b"registerPublisher" not in data:
                target.sendall(data)
                data = source.recv(65536)
            if data:
                self._registers.set()
            else:
                target.shutdown(socket.SHUT_WR)
        except OSError:
            pass


if __name__ == "__main__":
    rostest.rosrun("cssr_system", "blocked", TestBlocked)
