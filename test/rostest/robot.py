"""Help for the tests: the commanded robot and the node itself, each in its own process, to command
and wait for."""
import contextlib
import glob
import json
import os
import re
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time
import unittest
from pathlib import Path

import rosgraph

from behavior_controller.run.events import RunStarted, Sources
from behavior_controller.run.story import Story
from behavior_controller.text import Source
from behavior_controller.simulation.world import building_file

from free_ports import free_port

STAND_INS = {"/commanded_robot", "/peer"}
MASTER = os.environ.get("ROS_MASTER_URI")
"""The master of all cases that have none of their own."""
MASTER_IS_GONE = ("master", "does not answer")
"""Words of the line about a master that is not heard of any more."""
HERE = os.path.dirname(os.path.abspath(__file__))

on_one_python = unittest.skipIf("REPEATED_ON" in os.environ, "it does not depend on the Python")
"""Marks a case that takes long and is left out where its file is repeated on another Python."""


def sentence(event):
    """Return what the story tells of an event; the node's line about it holds that."""
    told, = Story().take(0.0, event)
    return told.text


def mission_starts(name="NAME"):
    """Return words of the line that tells that a mission, or the one of that name, has started."""
    sources = Sources((), Source("", ""), Source("", ""), "")
    before_count = re.split(r"\d", sentence(RunStarted(name + ".xml", [], {}, sources)))[0]
    return before_count.partition("NAME")[2] or before_count


SETTLE = 0.02
"""Seconds between an answer and the message that follows: a visitor is not faster."""

LIVE_MODES = {"done", "refuse", "odd", "raise", "hang", "exit"}
"""The modes of a service that may change while the robot runs."""

MISSION = """<root BTCPP_format="4" main_tree_to_execute="M">
  <BehaviorTree ID="M"><Sequence><START_OF_TREE/>{}</Sequence></BehaviorTree>
</root>
"""

BUSY = 4
"""How many times as long as on a quiet machine a wait for a line may take."""


class Lines:
    """The lines of a stream, as they come; ``wait_for`` waits for a certain line."""

    def __init__(self, stream):
        self.all = []
        self.ended = False
        self._news = threading.Condition()
        threading.Thread(target=self._read, args=(stream,), daemon=True).start()

    def _read(self, stream):
        try:
            for line in stream:
                with self._news:
                    self.all.append((time.monotonic(), line.rstrip("\n")))
                    self._news.notify_all()
        except ValueError:
            pass  # a test has closed the stream
        with self._news:
            self.ended = True
            self._news.notify_all()

    def wait_for(self, wanted, seconds, start=0):
        """Return (time, line) of the first line from number ``start`` on that is ``wanted``; fails
        if none comes.

        ``seconds`` are those of a quiet machine; what a test says about time it measures itself.
        """
        with self._news:
            found = self._news.wait_for(
                lambda: next((pair for pair in self.all[start:]
                              if wanted(pair[1])), None) or self.ended, BUSY * seconds)
            if isinstance(found, tuple):
                return found
        raise AssertionError("the wanted line did not come in {} s, only:\n{}".format(
            BUSY * seconds, self.text()))

    def wait_for_more(self, seen, seconds):
        """Return the lines from number ``seen`` on and whether the stream has ended, once there is
        news of either."""
        with self._news:
            self._news.wait_for(lambda: len(self.all) > seen or self.ended, seconds)
            return self.all[seen:], self.ended

    def wait_for_end(self, seconds):
        """Return when the stream has ended."""
        with self._news:
            assert self._news.wait_for(lambda: self.ended,
                                       seconds), "the stream did not end in time"

    def text(self):
        """Return all lines so far."""
        return "\n".join(line for _, line in self.all)


class Robot:
    """The commanded robot; ``modes`` as in ``commanded_robot.py``, by name of the service or topic.

    ``log`` has the lines that rospy writes there.
    """

    shared = None
    """The one that cases share; see ``robot_for``."""

    def __init__(self, modes=None, **environment):
        if os.environ["ROS_MASTER_URI"] == MASTER:
            end_shared()  # it has the name
        arguments = ["{}={}".format(name, mode) for name, mode in (modes or {}).items()]
        self.process = subprocess.Popen(
            [sys.executable, os.path.join(HERE, "commanded_robot.py")] + arguments,
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
            universal_newlines=True, bufsize=1, env=dict(os.environ, **environment))
        self.lines, self.log = Lines(self.process.stdout), Lines(self.process.stderr)
        self.lines.wait_for(lambda line: "ready" in line, 20)

    def begin_again(self, modes):
        """Be as one that has just been started in these modes."""
        start = len(self.lines.all)
        self._order(again=modes)
        self.lines.wait_for(lambda line: '"again"' in line, 10, start)
        del self.lines.all[:], self.log.all[:]

    def set_mode(self, name, mode):
        """Change the behaviour of the service ``name``."""
        self._order(name=name, mode=mode)

    def publish(self, topic, *values, **more):
        """Publish these field values, or what its visitor causes: once, or from now on ``hertz``
        times per second."""
        self._order(topic=topic, values=list(values), hertz=more.get("hertz", 0))

    def wait_for_listener(self, topic, *values):
        """Publish until a node stays connected: rospy notices at the second message that the
        connection of the start's check has ended."""
        listeners = [0]
        while not all(listeners[-3:]):
            start = len(self.lines.all)
            self.publish(topic, *values)
            _, line = self.lines.wait_for(lambda line: '"topic"' in line, 5, start)
            listeners.append(json.loads(line)["listeners"])
            time.sleep(0.05)

    def say(self, text):
        """Let the action of speech recognition hear ``text``."""
        self._order(say=text)

    def _order(self, **order):
        self.process.stdin.write(json.dumps(order) + "\n")
        self.process.stdin.flush()

    def requests(self, service=""):
        """Return the requests so far, of ``service`` or of all, each a dict of service, fields and
        time (monotonic)."""
        events = [json.loads(line) for _, line in self.lines.all if '"service"' in line]
        return [event for event in events if service in ("", event["service"])]

    def wait_for_request(self, service, seconds, start=0, **fields):
        """Return the first request to ``service`` with these field values, from line number
        ``start`` on."""
        def is_wanted(line):
            event = json.loads(line) if '"service"' in line else {}
            return event.get("service") == service and all(event["fields"][key] == fields[key]
                                                           for key in fields)

        return json.loads(self.lines.wait_for(is_wanted, seconds, start)[1])

    def reaction(self, service, topic, *values):
        """Publish, and return the seconds until the next request to ``service`` arrived, which is
        answered before this returns."""
        start = len(self.lines.all)
        self.publish(topic, *values)
        arrived = self.wait_for_request(service, 5, start)["time"]
        sent = next(event["time"]
                    for event in map(json.loads, (line for _, line in self.lines.all[start:]))
                    if event.get("topic") == topic)
        self.lines.wait_for(lambda line: '"answered": "{}"'.format(service) in line, 5, start)
        time.sleep(SETTLE)
        return arrived - sent

    def stop(self):
        """End it cleanly: it unregisters from the master."""
        if self.process.poll() is None:
            self.process.stdin.close()
            try:
                self.process.wait(10)
            except subprocess.TimeoutExpired:
                self.kill()
        self._close()

    def kill(self):
        """End it as a crash does: the master's entries stay."""
        self.process.kill()
        self._close()

    def _close(self):
        self.process.wait(10)
        self.log.wait_for_end(10)
        for stream in (self.process.stdin, self.process.stdout, self.process.stderr):
            stream.close()


def robot_for(case, modes=None):
    """Return a robot in these modes for a test case: that of the case before, if it may have them
    and lives, or else a new one. The shared one ends with the process, as its input does."""
    modes = modes or {}
    if os.environ["ROS_MASTER_URI"] != MASTER or not LIVE_MODES.issuperset(modes.values()):
        robot = Robot(modes)
        case.addCleanup(robot.stop)
        return robot
    if not is_shared():
        Robot.shared = Robot()
    Robot.shared.begin_again(modes)
    return Robot.shared


def is_shared():
    """Return whether cases have a robot in common that lives."""
    return Robot.shared is not None and Robot.shared.process.poll() is None


def end_shared():
    """Stop the robot that cases have in common."""
    if Robot.shared is not None:
        Robot.shared.stop()
        Robot.shared = None


def places():
    """Return the places that the robot knows, as their file has them; the exhibits of a tour are
    the first two."""
    return json.loads(Path(building_file()).read_text("utf-8"))


def start_master():
    """Start a ROS master on a free port, let the environment name it, and return its process."""
    port = free_port()
    os.environ["ROS_MASTER_URI"] = "http://localhost:{}".format(port)
    master = run_master(port)
    ends = time.monotonic() + 20.0
    while time.monotonic() < ends:
        try:
            socket.create_connection(("127.0.0.1", port)).close()
            return master
        except OSError:
            time.sleep(0.05)
    raise AssertionError("the ROS master did not start")


def run_master(port):
    """Run a ROS master on ``port`` and return its process."""
    return subprocess.Popen(["rosmaster", "--core", "-p", str(port)], stdout=subprocess.DEVNULL,
                            stderr=subprocess.DEVNULL)


def forget_dead_entries():
    """Have the master forget what killed robots left behind."""
    dead = STAND_INS - {"/commanded_robot"} if is_shared() else STAND_INS
    publishers, _, services = rosgraph.Master("/test").getSystemState()
    for service, nodes in services:
        if nodes[0] in dead:
            master = rosgraph.Master(nodes[0])
            master.unregisterService(service, master.lookupService(service))
    for topic, nodes in publishers:
        for node in dead.intersection(nodes):
            master = rosgraph.Master(node)
            master.unregisterPublisher(topic, master.lookupNode(node))


def registrations(node):
    """Return the names of all topics and services that the master lists for ``node``: of a topic
    that it publishes and subscribes to twice."""
    return sorted(name for rows in rosgraph.Master("/test").getSystemState()
                  for name, nodes in rows if node in nodes)


def free_ports():
    """Return a port for Groot2, which takes the next one too, and one for the page."""
    port = free_port(3)
    return port, port + 2


class Package:
    """A copy of the package in ``folder``, whose configuration, missions and code a test may spoil:
    the last by ``write``, as its files, compiled ones too, are links.
    """

    def __init__(self, folder):
        self.folder = folder
        root = os.path.dirname(os.path.dirname(HERE))
        for name, copy in (("src/behavior_controller", os.symlink), ("config", shutil.copy),
                           ("data", shutil.copy)):
            shutil.copytree(os.path.join(root, name), self.path(name), copy_function=copy)

    def path(self, name):
        """Return the path of a file or folder of the package."""
        return os.path.join(self.folder, name)

    def command(self, name):
        """Return the words that run a program of the package, in its ``environment``."""
        return [sys.executable, self.path("src/behavior_controller/" + name)]

    def environment(self, **more):
        """Return the environment in which the modules of this package are found."""
        paths = [self.path("src")] + os.environ.get("PYTHONPATH", "").split(os.pathsep)
        return dict(os.environ, PYTHONPATH=os.pathsep.join(paths), **more)

    def write(self, name, text):
        """Write a file, in place of a link."""
        with contextlib.suppress(FileNotFoundError):
            os.remove(self.path(name))
        Path(self.path(name)).write_text(text, "utf-8")

    def configure(self, **values):
        """Write the configuration: the required keys with working values, and ``values``; no
        monitoring by default."""
        keys = dict(scenarioSpecification="lab_tour", verboseMode="false", asrEnabled="true")
        keys.update(values)
        for key, off in (("groot2Port", 0), ("monitorPort", 0), ("recordDirectory", "none")):
            keys.setdefault(key, off)
        self.write("config/behaviorControllerConfiguration.ini", "".join(
            "{} {}\n".format(key, value) for key, value in keys.items()))


class Controller:
    """The node, run from a ``Package``, and the lines that it writes."""

    def __init__(self, package, *arguments, stdin=subprocess.DEVNULL, preexec_fn=None,
                 **environment):
        self.started = time.monotonic()
        self.process = subprocess.Popen(
            package.command("behaviorController") + list(arguments), stdin=stdin,
            stdout=subprocess.PIPE, stderr=subprocess.STDOUT, universal_newlines=True,
            env=package.environment(**environment), preexec_fn=preexec_fn)
        self.lines = Lines(self.process.stdout)

    def viewer(self):
        """Return the number of the process of its viewer."""
        for path in glob.glob("/proc/{}/task/*/children".format(self.process.pid)):
            with contextlib.suppress(FileNotFoundError), open(path) as file:
                for number in map(int, file.read().split()):
                    with open("/proc/{}/cmdline".format(number)) as command:
                        if "--child" in command.read():
                            return number
        raise AssertionError("the node has no viewer:\n{}".format(self.lines.text()))

    def wait(self, seconds):
        """Return the exit code; fails if it does not come in ``seconds`` of a quiet machine."""
        try:
            code = self.process.wait(BUSY * seconds)
        except subprocess.TimeoutExpired:
            self.process.kill()
            raise AssertionError("the node did not end in {} s:\n{}".format(
                BUSY * seconds, self.lines.text()))
        self.lines.wait_for_end(10)
        return code

    def stop(self, number=signal.SIGINT):
        """Send a signal; return the exit code and the seconds that the node took."""
        sent = time.monotonic()
        self.process.send_signal(number)
        code = self.wait(10)
        return code, time.monotonic() - sent

    def close(self):
        """Make sure that it has ended."""
        if self.process.poll() is None:
            self.process.kill()
        self.process.wait(10)
        self.process.stdout.close()


class NodeCase(unittest.TestCase):
    """A test case of the node. Each case has a copy of the package."""

    def setUp(self):
        self.folder = tempfile.mkdtemp()
        self.addCleanup(shutil.rmtree, self.folder)
        self.addCleanup(forget_dead_entries)
        self.package = Package(os.path.join(self.folder, "package"))

    def prepare(self, mission, **keys):
        """Write the mission of these leaves, and a configuration that chooses it."""
        self.package.write("data/m.xml", MISSION.format(mission))
        self.package.configure(scenarioSpecification="m", **keys)

    def controller(self, *arguments, **environment):
        """Start the node for this case."""
        controller = Controller(self.package, *arguments, **environment)
        self.addCleanup(controller.close)
        return controller

    def start(self, mission, modes=None, **keys):
        """Run the mission of these leaves against a robot in these modes; return both."""
        self.prepare(mission, **keys)
        return robot_for(self, modes), self.controller()
