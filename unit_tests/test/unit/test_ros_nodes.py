"""The simulated nodes on the wire: one as a process beside a master in here, and how each answers a
request, carries out a goal, listens and publishes."""
import os
import signal
import subprocess
import sys
import types

import pytest

rospy = pytest.importorskip("rospy", reason="needs ROS, which this interpreter does not have")

from actionlib_msgs.msg import GoalStatus  # noqa: E402

from behavior_controller.bt.engine.clock import Clock  # noqa: E402
from behavior_controller.wakeup import WakeUp  # noqa: E402
from behavior_controller.robot import d543, release_1_1  # noqa: E402
from behavior_controller.robot.requests import Answer, GoToGoal, Say  # noqa: E402
from behavior_controller.ros import service_client  # noqa: E402
from behavior_controller.ros.master import Directory  # noqa: E402
from behavior_controller.ros.service_client import RosGateway  # noqa: E402
from behavior_controller.ros.types import TYPES  # noqa: E402
from behavior_controller.simulation.journal import Journal  # noqa: E402
from ros_peers import LIMIT, Master, until  # noqa: E402
from unit_tests.robot import options, ros_nodes, ros_time  # noqa: E402
from unit_tests.robot.options import Arguments  # noqa: E402
from unit_tests.robot.ros_nodes import RosNode  # noqa: E402

SAY = d543.INTERFACE.service(Say)
DRIVE = release_1_1.INTERFACE.service(GoToGoal)


class Time:
    """A time that goes on while somebody waits, and ends after ``lasts`` seconds."""

    jumped = 0.0

    def __init__(self, lasts=1000.0):
        self.at, self.ends = 100.0, 100.0 + lasts

    def now(self):
        return self.at

    def wait(self, seconds):
        self.at = min(self.at + seconds, self.ends)
        return self.at >= self.ends

    def await_first(self):
        return False

    def end(self):
        """Nothing."""


@pytest.fixture
def make(tmp_path, monkeypatch):
    """Return what makes a simulated node with these keys, whose time ends after ``lasts``."""
    monkeypatch.setenv("ROS_HOME", str(tmp_path))

    def of(name, lasts=1000.0, **keys):
        values = {"failureRate": "0", "randomSeed": "1", "arrivalRate": "60", **keys}
        return RosNode(name, options.read(Arguments(["node"], values)), Time(lasts))
    return of


def written(node):
    """Return the entries of the journal."""
    return Journal(os.path.dirname(node._journal.path)).news()


REQUEST = TYPES[SAY]._request_class("hello")


def test_a_request_is_answered_after_its_time_and_is_in_the_journal_before(make):
    node = make("textToSpeech")
    assert node._handle(SAY, REQUEST).success
    assert 100.0 < node._time.now() < 105.0
    entry, = written(node)
    assert (entry.call, entry.content, entry.fault) == (1, {"message": "hello"}, None)
    assert entry.time == 100.0 and entry.done


@pytest.mark.parametrize("fault, success, until", [
    ("refused", False, None), ("unanswered", None, 600.0)])
def test_a_planned_fault_of_a_request(make, fault, success, until):
    node = make("textToSpeech", 500.0, plannedFaults="textToSpeech:2:" + fault)
    assert node._handle(SAY, REQUEST).success
    answer = node._handle(SAY, REQUEST)
    assert success is None or answer.success is success
    assert until is None or node._time.now() == until
    assert [entry.fault for entry in written(node)] == [None, fault]


def test_a_handler_that_fails_and_a_node_that_dies_on_purpose(make, monkeypatch):
    node = make("textToSpeech", plannedFaults="textToSpeech:1:exception,textToSpeech:2:crash")
    with pytest.raises(rospy.ServiceException, match="call 1 of textToSpeech fails on purpose"):
        node._handle(SAY, REQUEST)
    monkeypatch.setattr(os, "_exit", lambda code: 1 // (code - ros_nodes.CRASHED))
    with pytest.raises(ZeroDivisionError):
        node._handle(SAY, REQUEST)
    again = make("textToSpeech")  # an earlier run is none of its own
    again._handle(SAY, REQUEST)
    assert written(again)[-1].call == 1


def test_a_node_of_a_launch_that_died_goes_on_where_it_was(make, monkeypatch):
    launched = {"drawn": "5", "plannedFaults": "textToSpeech:1:crash"}
    monkeypatch.setattr(os, "_exit", lambda code: 1 // (code - ros_nodes.CRASHED))
    with pytest.raises(ZeroDivisionError):
        make("textToSpeech", **launched)._handle(SAY, REQUEST)
    again = make("textToSpeech", **launched)
    assert again._handle(SAY, REQUEST).success
    assert [(entry.call, entry.fault) for entry in written(again)] == [(1, "crash"), (2, None)]
    other = make("textToSpeech", drawn="6")  # has nothing to do with it
    other._handle(SAY, REQUEST)
    assert [entry.call for entry in written(other)] == [1]


@pytest.mark.parametrize("is_verbose", ["true", "false"])
def test_each_request_is_a_line_if_it_is_to_be(make, monkeypatch, is_verbose):
    lines = []
    monkeypatch.setattr(rospy, "loginfo", lambda text, *words: lines.append(text % words))
    make("textToSpeech", verboseMode=is_verbose)._handle(SAY, REQUEST)
    assert lines == ["textToSpeech: randomSeed 1"] + [
        "textToSpeech: call 1 {'message': 'hello'} -> Answer(response='', exhibits=())"
    ] * (is_verbose == "true")


# -------------------------------------------------------------------------------------------- goals


class Goal:
    """A goal that its client cancels at that time; ``ends`` are what became of it."""

    def __init__(self, node, cancelled=1e9):
        self.node, self.cancelled, self.ends, self.news = node, cancelled, [], []

    def get_goal(self):
        return TYPES[DRIVE]().action_goal.goal

    def get_goal_status(self):
        is_cancelled = self.node._time.now() >= self.cancelled
        status = GoalStatus.PREEMPTING if is_cancelled else GoalStatus.ACTIVE
        return types.SimpleNamespace(status=status)

    def publish_feedback(self, message):
        self.news.append(message.distance_remaining)

    def set_canceled(self):
        self.ends.append("cancelled")

    def set_aborted(self, result, why):
        self.ends.append(("aborted", why))

    def set_succeeded(self, result):
        self.ends.append(("succeeded", result.navigation_goal_success))


@pytest.mark.parametrize("fault, cancelled, end", [
    ("", 1e9, ("succeeded", 1)), ("", 101.0, "cancelled"),
    ("refused", 1e9, ("aborted", "")), ("wrong", 1e9, None),
    ("exception", 1e9, ("aborted", "call 1 of robotNavigation fails on purpose")),
    ("unanswered", 300.0, "cancelled")])
def test_how_a_goal_ends(make, fault, cancelled, end):
    planned = {"plannedFaults": "robotNavigation:1:" + fault} if fault else {}
    node = make("robotNavigation", robotInterface="release-1.1", callTimes="real", **planned)
    goal = Goal(node, cancelled)
    node._achieve(DRIVE, goal)
    assert len(goal.ends) == 1
    assert goal.ends == [end] or end is None and goal.ends[0][0] == "succeeded"
    if cancelled < 1e9:
        assert node._time.now() == pytest.approx(cancelled, abs=0.2)
    if end == ("succeeded", 1):
        assert goal.news == sorted(goal.news, reverse=True) and goal.news[-1] < 0.5


def test_a_newer_goal_ends_the_one_before(make):
    node = make("robotNavigation", robotInterface="release-1.1", callTimes="real")
    first, second = Goal(node), Goal(node)
    wait, node._time.wait = node._time.wait, lambda seconds: node._goals.update(
        {DRIVE: second}) or wait(seconds)
    node._achieve(DRIVE, first)
    assert first.ends == ["cancelled"] and node._time.now() < 101.0


# ---------------------------------------------------------------------------- listening, publishing


class Server:
    """A server of the action that listens."""

    def __init__(self, node, preempted=1e9):
        self.node, self.preempted, self.ends = node, preempted, []

    def is_preempt_requested(self):
        return self.node._time.now() >= self.preempted

    def set_preempted(self):
        self.ends.append(None)

    def get_default_result(self):
        return types.SimpleNamespace()

    def set_succeeded(self, result):
        self.ends.append(result.transcription)


@pytest.mark.parametrize("seconds, preempted, said, ends, at", [
    (30.0, 1e9, "yes", ["yes"], None), (5.0, 1e9, None, [""], 105.0),
    (30.0, 103.0, None, [None], 103.0)])
def test_how_the_action_listens(make, monkeypatch, seconds, preempted, said, ends, at):
    node = make("speechEvent", robotInterface="release-1.0", recogniseBy="action")
    monkeypatch.setattr(node, "_next_fields", lambda: {"data": said} if said else None)
    server = Server(node, preempted)
    node._listen(node._node.arrivals(), server, seconds)
    assert server.ends == ends
    assert at is None or node._time.now() == pytest.approx(at, abs=0.11)
    assert node._time.now() <= 100.0 + seconds + 0.01


def test_messages_come_at_their_rate_until_the_end(make, monkeypatch):
    sent = []
    monkeypatch.setattr(rospy, "Publisher", lambda *_, **__: types.SimpleNamespace(
        publish=lambda message: sent.append((node._time.now(), message))))
    node = make("faceDetection", 600.0, arrivalRate="60")
    node._publish(d543.FACES)
    assert 480 < len(sent) < 720  # ten minutes of sixty
    assert all(len(message.centroids) == len(message.face_label_id) for _, message in sent)
    assert written(node)


@pytest.mark.parametrize("keys, offered", [
    ({}, ["publish"]), ({"recogniseBy": "action"}, ["serve"]),
    ({"recogniseBy": "idleAction"}, ["idle"])])
def test_what_a_node_offers(make, monkeypatch, keys, offered):
    node, found = make("speechEvent", robotInterface="release-1.0", **keys), []
    monkeypatch.setattr(rospy, "Service", lambda name, *_: found.append(name))
    monkeypatch.setattr(ros_nodes, "offer_idle", lambda action: found.append("idle"))
    monkeypatch.setattr(ros_nodes, "serve_action", lambda *_: found.append("serve"))
    monkeypatch.setattr(node, "_publish", lambda topic: found.append("publish"))
    node.run()
    assert found[-1:] == offered and "/speechEvent/set_enabled" in found
    assert node._time.now() == 1100.0  # until its end


# -------------------------------------------------------------------------------- the whole process


@pytest.mark.slow
def test_a_node_beside_a_master_answers_and_ends_at_a_signal(monkeypatch, tmp_path):
    master, wake = Master(), WakeUp()
    monkeypatch.setenv("ROS_MASTER_URI", master.uri)
    monkeypatch.setattr(service_client, "DIRECTORY", Directory())
    rospy.rostime.set_rostime_initialized(True)
    process = subprocess.Popen(
        [sys.executable, "-c", "import sys; from unit_tests.robot.ros_nodes import main\n"
         "sys.exit(main('textToSpeech'))", "_failureRate:=0", "_callTimes:=none"],
        env=dict(os.environ, PYTHONPATH=os.pathsep.join(filter(None, sys.path)),
                 ROS_HOME=str(tmp_path)))
    try:
        until(lambda: SAY.name in master.services)
        clock = Clock()
        gateway = RosGateway(d543.INTERFACE, lambda service: 20.0, clock, wake.emit)
        call = gateway.start(Say("hello"))
        until(lambda: clock.run_due() or call.result is not None)
        assert call.result == Answer()
        gateway.close()
        process.send_signal(signal.SIGTERM)
        assert process.wait(LIMIT) == 0
    finally:
        process.kill()
        master.close()


@pytest.mark.slow
@pytest.mark.parametrize("name, words, code, told", [
    ("textToSpeech", ["_failurRate:=0"], 2, "failurRate"),
    ("textToSpeech", ["_failureRate:=2"], 2, "failureRate"),
    ("simulatedClock", [], 2, "at speed 1 the computer's time is used"),
    ("robotLocalization", [], 2, "this robot has no such node"),
    ("textToSpeech", [], 1, "master")])
def test_a_node_that_cannot_start_says_why(tmp_path, name, words, code, told):
    master = Master()
    if code == 1:
        master.close()
    done = subprocess.run(
        [sys.executable, "-c", "import sys; from unit_tests.robot.ros_nodes import main\n"
         "sys.exit(main({!r}))".format(name), *words], timeout=LIMIT, stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT, universal_newlines=True,
        env=dict(os.environ, PYTHONPATH=os.pathsep.join(filter(None, sys.path)),
                 ROS_HOME=str(tmp_path), ROS_MASTER_URI=master.uri))
    assert done.returncode == code and told in done.stdout, done.stdout
    assert "Traceback" not in done.stdout
    if code == 2:
        master.close()


def test_the_clock_goes_on_at_its_speed_and_does_not_leap(monkeypatch):
    steps, sent, now = [0.01, 0.02, 3.0], [], [50.0]
    monkeypatch.setattr(ros_time, "time", types.SimpleNamespace(
        time=lambda: 1000.0, monotonic=lambda: now[0],
        sleep=lambda seconds: now.__setitem__(0, now[0] + steps.pop(0))))
    monkeypatch.setattr(rospy, "is_shutdown", lambda: not steps)
    monkeypatch.setattr(rospy, "Publisher", lambda *_, **__: types.SimpleNamespace(
        publish=lambda message: sent.append(message.to_sec())))
    ros_time.publish_clock(10.0)
    assert sent == pytest.approx([1000.1, 1000.3, 1000.8])
