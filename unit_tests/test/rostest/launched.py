"""A test case that starts commands on the master of its test, and reads what they print."""
import os
import re
import subprocess
import tempfile
import time
import unittest

import rosgraph

LIMIT = 180.0
"""Seconds for one launch."""
USUAL = "arrivalRate:=3000", "callTimes:=none", "groot2Port:=0", "monitorPort:=0"
"""Arguments of a test that takes as little time as it can."""


class Launched(unittest.TestCase):
    """Each case has a ROS_HOME of its own; the output of a command is in a file there."""

    def setUp(self):
        home = tempfile.TemporaryDirectory()
        self.addCleanup(home.cleanup)
        self.home = home.name
        self.environment = dict(os.environ, ROS_HOME=self.home, ROS_TEST_RESULTS_DIR=self.home)
        self.environment.pop("ROS_LOG_DIR", None)
        self.master = rosgraph.Master("/test")

    def start(self, *command, name="output", **environment):
        """Start a command, whose output has that name, and return its process."""
        with open(os.path.join(self.home, name + ".log"), "w") as output:
            process = subprocess.Popen(command, env=dict(self.environment, **environment),
                                       stdout=output, stderr=subprocess.STDOUT,
                                       stdin=subprocess.DEVNULL)
        self.addCleanup(process.wait, LIMIT)
        self.addCleanup(process.terminate)
        return process

    def run_to_end(self, *command):
        """Return the exit code of a command and what it printed."""
        code = self.start(*command).wait(LIMIT)
        return code, self.printed()

    def printed(self, name="output"):
        """Return the output of that name so far."""
        with open(os.path.join(self.home, name + ".log")) as file:
            return file.read()

    def wait_for(self, pattern, name="output"):
        """Return when the output of that name matches."""
        ends = time.monotonic() + LIMIT
        while not re.search(pattern, self.printed(name)):
            self.assertLess(time.monotonic(), ends,
                            "{!r} was not printed:\n{}".format(pattern, self.printed(name)))
            time.sleep(0.05)
