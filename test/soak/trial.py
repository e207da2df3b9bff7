"""What every trial of an adversary needs: things that are stopped at its end, times with limits,
and a bound in time."""
import contextlib
import math
import os
import random
import re
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter

HERE = os.path.dirname(os.path.abspath(__file__))
sys.path[:0] = [HERE, os.path.join(os.path.dirname(HERE), "rostest")]
from network import Network, Unavailable  # noqa: E402
from robot import Controller, Package, Robot  # noqa: E402

FACES, GAZE, SPEECH = "/faceDetection/data", "/overtAttention/mode", "/speechEvent/text"

SAFE_STATE = {"/overtAttention/set_mode", "/animateBehaviour/set_activation"}
STOP_LIMIT = 2.0
GONE = re.compile(r"behaviorController: (?:service|topic|master) (\S+).*: "
                  r"(?:gone|silent|unreachable|does not answer)")
LINES_SHOWN = 12
OURS = ("Traceback", "internal error")


class Trial:
    """One trial under way: what it has started, measured and found wrong."""

    def __init__(self, folder, held, draw):
        """``held`` is the ``ExitStack`` that stops what the trial starts; ``draw`` (Random) varies
        it."""
        self.package = Package(os.path.join(folder, "package"))
        self.held = held
        self.draw = draw
        self.times, self.problems = [], []
        self._nodes = []
        self.logs = os.path.join(folder, "log")
        self._log = {"ROS_LOG_DIR": self.logs}

    # ------------------------------------------------------------------------------- what it starts

    def network(self, kind="tun"):
        """Return two machines with a wire between them."""
        network = Network(kind)
        self.held.callback(network.close)
        return network

    def process(self, *command, **environment):
        """Start a program that is ended in good order, or else killed."""
        process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
                                   env=dict(os.environ, **dict(self._log, **environment)))
        self.held.callback(_end, process)
        return process

    def robot(self, **environment):
        """Start the commanded robot with a visitor before it."""
        robot = Robot(**dict(self._log, **environment))
        self.held.callback(robot.kill)
        for topic in (FACES, GAZE, SPEECH):
            robot.publish(topic, hertz=20)
        return robot

    def node(self, *arguments, **environment):
        """Start the node, which need not be up yet when this returns."""
        node = Controller(self.package, *arguments, **dict(self._log, **environment))
        self.held.callback(node.close)
        self._nodes.append(node)
        return node

    def allow_several_controllers(self):
        """Let several controllers ask one robot: this trial observes more than one."""
        name = "src/behavior_controller/ros/in_use.py"
        with open(self.package.path(name)) as file:
            text = file.read()
        self.package.write(name, text + "\n\ndef check_unused(*_, **__):\n    pass\n")

    # ---------------------------------------------------------------------------- what it finds out

    def within(self, what, seconds, limit):
        """Note how long something took; infinite: it did not happen."""
        self.times.append("{} {}".format(
            what, "{:.1f} s".format(seconds) if seconds < math.inf else "never"))
        self.require(seconds <= limit, "{}; the limit is {:g} s".format(self.times[-1], limit))

    def require(self, is_so, problem):
        """Note a problem unless ``is_so``."""
        if not is_so:
            self.problems.append(problem)

    def stop(self, node, robot, moment, is_reachable=True):
        """Have SIGTERM end the node in time, in the safe state or with words for each part of it
        that is not reached."""
        sent = time.monotonic()
        _, took = node.stop(signal.SIGTERM)
        self.within("SIGTERM {}".format(moment), took, STOP_LIMIT)
        if is_reachable:
            done = {request["service"] for request in robot.requests()
                    if request["time"] >= sent and request["fields"].get("state") == "disabled"}
        else:
            told = "\n".join(line for came, line in node.lines.all
                             if came >= sent and not GONE.search(line))
            done = {service for service in SAFE_STATE if service in told}
        self.require(done == SAFE_STATE, "SIGTERM {}: {} for {}".format(
            moment, "not asked" if is_reachable else "not a word",
            " and ".join(sorted(SAFE_STATE - done))))

    def look_for_our_mistakes(self):
        """Note the kinds of lines that no operator should ever see."""
        lines = (line for node in self._nodes for _, line in node.lines.all
                 if any(word in line for word in OURS))
        for text, count in Counter(line.split("]: ")[-1].split("; please")[0]
                                   for line in lines).items():
            self.problems.append("{} x {}".format(count, text))


def when(node, pattern, since, seconds):
    """Return how long after ``since`` (monotonic) a line with ``pattern`` came; infinite if none
    came in ``seconds``."""
    start = sum(came < since for came, _ in list(node.lines.all))
    try:
        return node.lines.wait_for(re.compile(pattern).search,
                                   max(0.0, since + seconds - time.monotonic()), start)[0] - since
    except AssertionError:
        return math.inf


def longest_gap(node, pattern, since, until):
    """Return the longest time without a line with ``pattern`` between two moments (monotonic)."""
    times = [came for came, line in list(node.lines.all) if since < came < until
             and re.search(pattern, line)]
    return max(later - sooner for sooner, later in zip([since] + times, times + [until]))


def sleep_until(moment):
    """Return at ``moment`` (monotonic), or at once if that has passed."""
    time.sleep(max(0.0, moment - time.monotonic()))


def run(table, word="", seed=1):
    """Run the trials with ``word`` in their names; print a line for each, and return all problems.

    ``table`` has rows of name, seconds that the trial may take at most, and function of a
    ``Trial``.
    """
    if not any(word in row[0] for row in table):
        sys.exit("no trial has {!r} in its name; there are:\n  {}".format(
            word, "\n  ".join(row[0] for row in table)))
    before = signal.signal(signal.SIGTERM, lambda *_: sys.exit(1))  # what runs is stopped then too
    try:
        return [problem for row in table if word in row[0] for problem in _run(*row, seed)]
    finally:
        signal.signal(signal.SIGTERM, before)


def _run(name, limit, function, seed):
    """Run one trial and return its problems."""
    began = time.monotonic()
    trial = None
    try:
        with tempfile.TemporaryDirectory() as folder, contextlib.ExitStack() as held, _bound(limit):
            trial = Trial(folder, held, random.Random("{} {}".format(seed, name)))
            function(trial)
            trial.look_for_our_mistakes()
    except Unavailable as reason:
        print("skipped: {}: network namespaces cannot be made here: {}".format(name, reason),
              flush=True)
        return []
    except (AssertionError, OSError) as error:
        text = str(error).splitlines() or ["a wait of the trial failed"]
        trial.problems.append("\n    ".join(text if len(text) < LINES_SHOWN else text[:1] +
                                            text[-LINES_SHOWN:]))
    print("{}: {} in {:.0f} s: {}".format(name,
                                          "NOT as it should" if trial.problems else "as it should",
                                          time.monotonic() - began, ", ".join(trial.times)),
          flush=True)
    print("".join("  {}\n".format(problem) for problem in trial.problems), end="", flush=True)
    return ["{}: {}".format(name, problem) for problem in trial.problems]


@contextlib.contextmanager
def _bound(seconds):
    """Fail if what is inside takes longer."""
    def end(*_):
        raise AssertionError("not done after {:g} s".format(seconds))

    signal.signal(signal.SIGALRM, end)
    signal.setitimer(signal.ITIMER_REAL, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)


def _end(process):
    process.send_signal(signal.SIGCONT)  # the trial may have frozen it
    process.terminate()
    try:
        process.wait(10)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()
