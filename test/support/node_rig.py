"""The node, or another program of its package, as a process of its own, beside a robot and a master
in this process."""
import os
import re
import shutil
import signal
import subprocess
import sys
import threading
import time

from behavior_controller import folders
from behavior_controller.robot.d543 import INTERFACE
from ros_peers import LIMIT, Master, Publisher, Service, until

MISSION = """<root BTCPP_format="4" main_tree_to_execute="M"><BehaviorTree ID="M"><Sequence>
<START_OF_TREE/>{}</Sequence></BehaviorTree></root>"""
SAYS = "<WelcomeSpeech/>"
RUN = """from behavior_controller import folders
folders.share = lambda *_: {!r}
from behavior_controller.ros import node, try_robot
{}"""


class Rig:
    """A robot that answers, and a folder with the files of the node."""

    def __init__(self, folder):
        self.folder, self.master, self.nodes = str(folder), Master(), []
        self.services = {each: Service(self.master, each) for each in INTERFACE.services}
        self.peers = [self.master, *self.services.values()]
        for name in ("config", "data"):
            shutil.copytree(os.path.join(folders.share(), name), self.path(name))
        self.mission(SAYS)

    def path(self, name):
        return os.path.join(self.folder, name)

    def mission(self, body):
        with open(self.path("data/m.xml"), "w", encoding="utf-8") as file:
            file.write(MISSION.format(body))

    def offers(self, service, *answers):
        """Start the node of a service again, with these answers."""
        self.services[service] = Service(self.master, service, *answers)
        self.peers.append(self.services[service])
        return self.services[service]

    def publishes(self, topic):
        publisher = Publisher(topic, "/p")
        self.peers.append(publisher)
        self.master.publishers[topic.name], self.master.nodes["/p"] = ["/p"], publisher.uri
        return publisher

    def start(self, *arguments, run="node.run()", **keys):
        """Start a process that does ``run``."""
        keys = {"scenarioSpecification": "m", "missionRuns": 1, "groot2Port": 0, "monitorPort": 0,
                "recordDirectory": "none", **keys}
        self.nodes.append(Node(
            [*("_{}:={}".format(*each) for each in keys.items()), *arguments],
            RUN.format(self.folder, run), ROS_MASTER_URI=self.master.uri, ROS_HOME=self.folder))
        return self.nodes[-1]

    def close(self):
        for node in self.nodes:
            node.close()
        for peer in self.peers:
            peer.close()


class Node:
    """The process, and the lines that it writes, without their times."""

    def __init__(self, arguments, program, **environment):
        paths = [path for path in sys.path if path]
        self.process = subprocess.Popen(
            [sys.executable, "-c", program, *arguments], stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE, stderr=subprocess.STDOUT, universal_newlines=True, env=dict(
                os.environ, PYTHONPATH=os.pathsep.join(paths), PYTHONUNBUFFERED="",
                **environment))
        self.lines = []
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def _read(self):
        for line in self.process.stdout:
            self.lines.append(re.sub(r"\[\d\d:\d\d:\d\d\.\d{3}\]: (behaviorController: )?", "",
                                     line.rstrip()))

    def code(self):
        """Return the exit code and the text, once it has ended."""
        code = self.process.wait(LIMIT)
        self._reader.join(LIMIT)
        return code, "\n".join(self.lines)

    def says(self, words, seconds=LIMIT):
        """Wait for a line with these words, and return it."""
        def found():
            return [line for line in self.lines if words in line]
        until(lambda: found() or self.process.poll() is not None, seconds)
        assert found(), "\n".join(self.lines)
        return found()[0]

    def stop(self, number=signal.SIGINT):
        """Send a signal; return the exit code, the text, and the seconds that the end took."""
        sent = time.monotonic()
        self.process.send_signal(number)
        return (*self.code(), time.monotonic() - sent)

    def close(self):
        self.process.kill()
        self.process.wait(LIMIT)
