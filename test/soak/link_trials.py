"""Trials with the node on one machine and the robot on another: the link between them is poor, or
cut."""
import math
import re
import signal
import time
from collections import Counter

from network import MASTER_PORT
from tour_model import SERVICES, tour_with
from trial import FACES, GAZE, GONE, SAFE_STATE, SPEECH, STOP_LIMIT, longest_gap, sleep_until, when

SAY = "/textToSpeech/say_text"
DEADLINE = 3.0  # s, of a speech
PAUSE = 0.3  # s, between two speeches, and between two looks at a topic
SLACK = 0.7  # s, for a loaded computer
TOLD_LIMIT = 5.0  # s, until a loss is reported, and until messages arrive again
DEATH_LIMIT = 2.0  # s, until the death of a node is reported
PATIENCE = 15.0  # s, the longest wait of a trial
HEARS = {"IsVisitorDiscovered": FACES, "IsMutualGazeDiscovered": GAZE, "IsYesNoUttered": SPEECH}
SPEAKS = r"WelcomeSpeech \(.*(SUCCESS|FAILURE)"
FOR_EVER = """<Repeat num_cycles="-1"><Sequence><ForceSuccess><{}/></ForceSuccess><Sleep msec="{:.0f}"/></Sequence>
</Repeat>"""
SPEAK_AND_LISTEN = """<root BTCPP_format="4" main_tree_to_execute="M"><BehaviorTree ID="M"><Sequence>
<START_OF_TREE/><SeekOvertAttentionMode/><Parallel success_count="1" failure_count="1">{}</Parallel></Sequence>
</BehaviorTree></root>""".format("".join(
    FOR_EVER.format(leaf, 1000 * PAUSE) for leaf in ("WelcomeSpeech", *HEARS)))


class Link:
    """The two machines of a trial, and on which of them its ROS master and its robot are; the node
    is on "node"."""

    def __init__(self, trial, master, robot="robot", kind="tun"):
        self.network = trial.network(kind)
        self._trial, self._master, self._robot = trial, master, robot
        environment = self.network.environment(master, master)
        self.master_uri = environment["ROS_MASTER_URI"]
        with self.network.inside(master):
            trial.process("roscore", "-p", str(MASTER_PORT), **environment)

    def robot(self):
        """Start the robot."""
        with self.network.inside(self._robot):
            return self._trial.robot(**self.network.environment(self._robot, self._master))

    def node(self, *arguments):
        """Start the node."""
        with self.network.inside("node"):
            return self._trial.node(*arguments, **self.network.environment("node", self._master))

    @property
    def beyond(self):
        """The names of all that the node loses in a cut."""
        robot = [*SERVICES, *HEARS.values()] if self._robot != "node" else []
        return robot + ([self.master_uri] if self._master != "node" else [])


def lab_tour(trial, master):
    """Two lab tours over a link of 100 ms and 5 % loss each way make the calls of two lab tours,
    and succeed."""
    link = Link(trial, master)
    link.network.set(delay=0.1, jitter=0.02, loss=0.05)
    robot = link.robot()
    trial.package.configure(verboseMode="true", missionRuns=2, startupTimeout=30)
    node = link.node()
    trial.require(node.wait(150) == 0, "exit code {}".format(node.process.returncode))
    passes = re.findall(r"pass \d+: (\w+) after ([\d.]+) s", node.lines.text())
    trial.times.extend("{} after {} s".format(*found) for found in passes)
    trial.times.append("{} false alarms".format(len(GONE.findall(node.lines.text()))))
    trial.require([outcome for outcome, _ in passes] == ["SUCCESS"] * 2, "not two successes")
    made = Counter(request["service"] for request in robot.requests())
    due = Counter(attempt.service for attempt in tour_with({}).attempts * 2)
    due.update(SAFE_STATE)  # after the last pass
    # where a failure is told the call may have been made again, or left out
    for service in SERVICES:
        told = len(re.findall(r"(?:FAILURE|failed), {}".format(service), node.lines.text()))
        trial.require(abs(made[service] - due[service]) <= told,
                      "{} calls of {}, expected {}, {} told".format(
                          made[service], service, due[service], told))


def cut(trial, seconds, stops, master="robot", robot="robot", kind="tun"):
    """While the link is cut the mission keeps its deadlines and says what is gone; after it, it
    hears and speaks again.

    ``stops`` are the moments of the cut at which a node is stopped. ``robot`` and ``master`` say
    where these are.
    """
    link = Link(trial, master, robot, kind)
    stub = link.robot()
    trial.package.write("data/m.xml", SPEAK_AND_LISTEN)
    trial.package.configure(scenarioSpecification="m", verboseMode="true", startupCheck="all",
                            textToSpeechDeadline=DEADLINE)
    trial.allow_several_controllers()
    watched, late, *others = [
        link.node("__name:=n{}".format(number)) for number in range(len(stops) + 2)]
    for node in (watched, late, *others):
        for leaf in ("WelcomeSpeech", *HEARS):
            node.lines.wait_for(re.compile(leaf + ".*SUCCESS").search, 40)
    began = cut_during_a_call(link, stub)
    for node, moment in zip(others, stops):
        sleep_until(began + moment)
        trial.stop(node, stub, "at {:g} s".format(moment), robot == "node")
    sleep_until(began + seconds)
    link.network.set(cut=False)
    ended = time.monotonic()
    sleep_until(ended + 0.5)
    trial.stop(late, stub, "0.5 s after it")
    look_at_the_cut(trial, watched, began, ended, link.beyond)
    look_at_the_time_after(trial, watched, ended, link.beyond)
    stub.kill()
    trial.within("death after it", when_dead(watched, time.monotonic()), DEATH_LIMIT)
    trial.stop(watched, stub, "at the end", False)


def when_dead(node, killed):
    """Return how long after ``killed`` the death of all of the robot's nodes is told; infinite if
    it is not."""
    return max(
        when(node, name + ".*gone", killed, PATIENCE) for name in (*SERVICES, *HEARS.values()))


def cut_during_a_call(link, robot):
    """Cut the link while each node waits for an answer, and return when."""
    robot.set_mode(SAY, "hang")
    robot.wait_for_request(SAY, 10, start=len(robot.lines.all))
    link.network.set(cut=True)
    robot.set_mode(SAY, "done")
    return time.monotonic()


def look_at_the_cut(trial, node, began, ended, beyond):
    """Were deadlines kept, and was all that is ``beyond`` the cut reported as gone?"""
    trial.within("between two speeches", longest_gap(node, SPEAKS, began, ended),
                 DEADLINE + PAUSE + SLACK)
    told = {}
    for came, line in node.lines.all:
        found = GONE.search(line)
        if found and began < came < ended:
            told.setdefault(found.group(1), came - began)
    trial.within("all gone is said", max(told.get(name, math.inf) for name in beyond), TOLD_LIMIT)
    trial.require(told.keys() >= set(beyond), "not said to be gone: {}".format(
        ", ".join(sorted(set(beyond) - told.keys()))))
    trial.require(told.keys() <= set(beyond), "said to be gone, and is not: {}".format(
        ", ".join(sorted(told.keys() - set(beyond)))))


def look_at_the_time_after(trial, node, ended, beyond):
    """Are all topics heard, is a speech said again, and is all that was ``beyond`` the cut reported
    as back?"""
    for leaf in ("WelcomeSpeech", *HEARS):
        trial.within("{} again".format(leaf), when(node, leaf + r" \(.*SUCCESS", ended, PATIENCE),
                     TOLD_LIMIT)
    back = max(
        when(node, name + r".*: (?:available|answers) again", ended, PATIENCE) for name in beyond)
    trial.within("all back is said", back, TOLD_LIMIT)


def cut_while_it_starts(trial, moments):
    """A node whose master is cut off ``moments`` after its start is ended by SIGTERM in time,
    wherever it was."""
    link = Link(trial, "robot")
    link.robot()
    trial.package.configure()
    for moment in moments:
        link.network.set(cut=False, delay=0.1)  # a slow start, to meet more of its steps
        node = link.node()
        sleep_until(node.started + moment)
        link.network.set(cut=True)
        sleep_until(node.started + moment + 1.0)
        if node.process.poll() is None:
            trial.within("SIGTERM 1 s after a cut at {:g} s".format(moment),
                         node.stop(signal.SIGTERM)[1], STOP_LIMIT)
        else:
            trial.times.append("ended by itself after a cut at {:g} s".format(moment))
