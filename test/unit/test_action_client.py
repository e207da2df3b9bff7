"""What becomes of a goal, by what its server says of it, and when an action is listened to.

Only actionlib's client is a double: that it does as it is taken to do here is seen beside a real
server in test/rostest/actions.test.
"""
import queue
import socket
import threading
import time
import types

import pytest

rospy = pytest.importorskip("rospy", reason="needs ROS")

from actionlib import CommState  # noqa: E402
from actionlib_msgs.msg import GoalStatus  # noqa: E402

from behavior_controller.robot import release_1_0, release_1_1  # noqa: E402
from behavior_controller.robot.gateway import Cause, Failure  # noqa: E402
from behavior_controller.robot.requests import Answer, GoToGoal, Location  # noqa: E402
from behavior_controller.ros import action_client  # noqa: E402
from behavior_controller.ros.action_client import GoalThread, SpeechActionClient  # noqa: E402
from behavior_controller.ros.master import Directory  # noqa: E402
from behavior_controller.ros.request_thread import Job  # noqa: E402
from behavior_controller.ros.tcpros import Trouble  # noqa: E402
from ros_peers import Master, until  # noqa: E402

ACTION, SPEECH = release_1_1.INTERFACE.service(GoToGoal), release_1_0.RECOGNITION
GOAL = GoToGoal(Location(1.0, 2.0, 90.0))
LIMIT = 0.2  # seconds, for those of seconds

ACTIVE = (CommState.ACTIVE, GoalStatus.ACTIVE)
UNSEEN = (CommState.WAITING_FOR_GOAL_ACK, GoalStatus.PENDING)


def done(status, **result):
    return CommState.DONE, status, types.SimpleNamespace(**result) if result else None


def awaited(status):
    return CommState.WAITING_FOR_RESULT, status


class Goal:
    """A goal that is in one of these states after the other; in the last one it stays."""

    def __init__(self, *states, why=""):
        self.states, self.why, self.is_cancelled = list(states), why, False

    def get_comm_state(self):
        self.now = self.states.pop(0) if len(self.states) > 1 else self.states[0]
        return self.now[0]

    def get_goal_status(self):
        return self.now[1]

    def get_goal_status_text(self):
        return self.why

    def get_result(self):
        return self.now[2]

    def cancel(self):
        self.is_cancelled = True


class Client:
    """Sends these goals; its connections are ``ends``, as (ours, the server's) by topic."""

    def __init__(self, *goals):
        self.goals, self.sent, self.ends = list(goals), [], {}
        for name in ("pub_goal", "pub_cancel", "status_sub", "result_sub", "feedback_sub"):
            ours, theirs = socket.socketpair()
            self.ends[name] = ours, theirs
            connection = types.SimpleNamespace(socket=ours, md5sum="1")
            setattr(self, name, types.SimpleNamespace(
                impl=types.SimpleNamespace(connections=[connection])))

    def connection(self, name):
        return getattr(self, name).impl.connections[0]

    def send_goal(self, goal, transition, feedback):
        self.sent.append(goal)
        self.feedback = feedback
        return self.goals.pop(0)


@pytest.fixture
def master(monkeypatch):
    found = Master()
    monkeypatch.setenv("ROS_MASTER_URI", found.uri)
    monkeypatch.setattr(action_client, "DIRECTORY", Directory())
    for name in ("ACK_LIMIT", "CONNECT_LIMIT"):
        monkeypatch.setattr(action_client, name, LIMIT)
    for name in ("RETRY_INTERVAL", "ROUND_WHEN_LISTENING", "GOAL_PAUSE"):
        monkeypatch.setattr(action_client, name, 0.01)
    rospy.rostime.set_rostime_initialized(True)  # as the node does at its start
    yield found
    found.close()


def job(is_cut=False):
    """Return a request under way, and the list of its feedback."""
    cut, told = threading.Event(), []
    if is_cut:
        cut.set()
    return Job(GOAL, lambda result: None, told.append, cut), told


def carried(client, is_cut=False):
    """Return the result of a request that goes to this client, or its trouble."""
    thread = GoalThread(ACTION)
    thread._client = client
    try:
        return thread.exchange(job(is_cut)[0])
    except Trouble as trouble:
        return trouble.cause, str(trouble)


DONE, REFUSED = done(GoalStatus.SUCCEEDED, navigation_goal_success=1), done(
    GoalStatus.SUCCEEDED, navigation_goal_success=0)


@pytest.mark.slow
@pytest.mark.parametrize("states, why, expected, is_cancelled", [
    ([DONE], "", Answer(), False),
    ([UNSEEN, ACTIVE, ACTIVE, awaited(GoalStatus.SUCCEEDED), DONE], "", Answer(), False),
    ([ACTIVE] * 40 + [DONE], "", Answer(), False),  # however long it takes once it is acknowledged
    ([REFUSED], "", Failure(Cause.REFUSED, "", ACTION.name), False),
    ([done(GoalStatus.SUCCEEDED)], "", (Cause.REFUSED, "succeeded"), False),
    ([done(GoalStatus.ABORTED, navigation_goal_success=1)], "a wall",
     (Cause.REFUSED, "aborted (a wall)"), False),
    ([done(GoalStatus.REJECTED)], "", (Cause.REFUSED, "rejected"), False),
    ([ACTIVE, awaited(GoalStatus.PREEMPTED)], "", (Cause.REFUSED, "preempted"), False),
    ([ACTIVE, done(GoalStatus.LOST)], "",
     (Cause.CONNECTION_LOST, "its server does not know the goal any more"), False),
    ([ACTIVE, awaited(GoalStatus.SUCCEEDED)], "",
     (Cause.UNUSABLE_ANSWER, "its result did not come"), False),
    ([UNSEEN], "", (Cause.NO_ANSWER, "the goal was not acknowledged in 0.2 s"), True)])
def test_what_becomes_of_a_goal(master, states, why, expected, is_cancelled):
    goal = Goal(*states, why=why)
    client = Client(goal)
    result = carried(client)
    if isinstance(expected, Failure):
        assert result.cause is expected.cause and result.resource == expected.resource
    else:
        assert result == expected
    assert goal.is_cancelled is is_cancelled
    assert [(sent.goal_x, sent.goal_y, sent.goal_theta) for sent in client.sent] == [
        (1.0, 2.0, 90.0)]


def test_a_goal_whose_request_is_cut_is_cancelled_at_once(master, monkeypatch):
    monkeypatch.setattr(action_client, "RETRY_INTERVAL", 20.0)
    goal, thread, found = Goal(ACTIVE), GoalThread(ACTION), queue.Queue()
    thread._client = Client(goal)
    thread.start()
    thread.carry(GOAL, found.put, lambda text: None)
    until(lambda: thread.is_asked)
    assert thread.cut()  # it is used again
    result = found.get(timeout=5.0)
    assert (result.cause, result.message) == (Cause.NO_ANSWER, "cancelled") and goal.is_cancelled
    thread._client.goals.append(Goal(DONE))
    thread.carry(GOAL, found.put, lambda text: None)
    assert found.get(timeout=5.0) == Answer()
    thread.end()


@pytest.mark.parametrize("lost", ["pub_goal", "pub_cancel", "status_sub", "result_sub",
                                  "feedback_sub"])
def test_a_server_that_goes_is_noticed_at_each_connection(master, lost):
    client = Client(Goal(ACTIVE))
    thread = GoalThread(ACTION)
    assert not thread.is_there
    thread._client = client
    assert thread.is_there
    if lost.startswith("pub"):
        client.ends[lost][1].close()
    else:
        client.connection(lost).md5sum = None
    assert not thread.is_there
    with pytest.raises(Trouble) as raised:
        thread.achieve(GOAL, lambda: False)
    assert (raised.value.cause, str(raised.value)) == (Cause.CONNECTION_LOST, "its server is gone")
    listener = SpeechActionClient(SPEECH, lambda: False, print, print, print)
    listener._client = client
    assert listener.is_there is (lost == "feedback_sub")  # which it does not read
    listener.end()


@pytest.mark.parametrize("nodes, is_cut, expected", [
    ([], False, (Cause.NOT_ADVERTISED, "no node offers this action")),
    (["/a"], True, (Cause.NOT_REACHABLE, "the master lists it, but not all of its topics connect")),
    (["/a"], False,
     (Cause.NOT_REACHABLE, "the master lists it, but not all of its topics connect"))])
def test_without_its_server_no_goal_is_sent(master, nodes, is_cut, expected):
    master.publishers[ACTION.name + "/status"] = nodes
    master.nodes["/a"] = "http://h:1/"
    client = Client()
    client.connection("status_sub").md5sum = None
    assert carried(client, is_cut) == expected and not client.sent


def test_a_request_that_was_cut_sends_no_goal(master):
    client = Client(Goal(DONE))
    assert carried(client, is_cut=True)[0] is Cause.NOT_REACHABLE and not client.sent


def test_the_topics_of_a_server_that_does_not_connect_are_registered_again_ever_more_rarely(
        master, monkeypatch):
    now, registered = [0.0], []
    monkeypatch.setattr(action_client.time, "monotonic", lambda: now[0])
    monkeypatch.setattr(action_client.DIRECTORY, "register",
                        lambda *topics: registered.append((now[0], len(topics))))
    thread = GoalThread(ACTION)
    thread._client = Client()
    for tenth in range(80):
        now[0] = tenth / 10
        thread._connect()
    assert registered == [(1.0, 5), (3.0, 5), (7.0, 5)]  # seconds after 1, 2 and 4 more
    thread.idle()  # it is connected
    for tenth in range(80, 100):
        now[0] = tenth / 10
        thread._connect()
    assert [at for at, _ in registered[3:]] == [8.9]


def test_a_client_that_was_just_made_has_time_to_connect(master, monkeypatch):
    now, registered = [0.0], []
    monkeypatch.setattr(action_client.time, "monotonic", lambda: now[0])
    monkeypatch.setattr(action_client.actionlib, "ActionClient", lambda *_: Client())
    monkeypatch.setattr(action_client.DIRECTORY, "register",
                        lambda *topics: registered.append(now[0]))
    thread = GoalThread(ACTION)
    for now[0] in (50.0, 50.9, 51.0):
        thread._connect()
    assert registered == [51.0]


def test_what_a_client_hears_is_kept_registered(master, monkeypatch):
    monkeypatch.setattr(rospy.core, "get_node_uri", lambda: master.uri)
    GoalThread(ACTION)
    action_client.DIRECTORY.is_keeping_up = True
    action_client.DIRECTORY.refresh()
    assert {call[1:3] for call in master.calls if call[0] == "registerSubscriber"} >= {
        (ACTION.name + "/status", "actionlib_msgs/GoalStatusArray"),
        (ACTION.name + "/result", "cssr_system/driveToActionResult"),
        (ACTION.name + "/feedback", "cssr_system/driveToActionFeedback")}


def test_a_goal_is_sent_when_its_server_connects_in_time(master, monkeypatch):
    master.publishers[ACTION.name + "/status"], master.nodes["/a"] = ["/a"], "http://h:1/"
    monkeypatch.setattr(action_client, "CONNECT_LIMIT", 20.0)
    monkeypatch.setattr(action_client.actionlib, "ActionClient", lambda *_: Client(Goal(DONE)))
    assert carried(None) == Answer()


@pytest.mark.slow
def test_a_goal_is_looked_at_now_and_then(master, monkeypatch):
    monkeypatch.setattr(action_client, "RETRY_INTERVAL", 0.05)
    began = time.monotonic()
    assert carried(Client(Goal(*[ACTIVE] * 6, DONE))) == Answer()
    assert time.monotonic() - began >= 0.3


@pytest.mark.parametrize("is_offered, expected", [(False, 0), (True, 1)])
def test_a_client_is_made_as_soon_as_there_is_a_server(master, monkeypatch, is_offered, expected):
    made = []
    monkeypatch.setattr(action_client.actionlib, "ActionClient",
                        lambda *arguments: made.append(arguments) or Client())
    if is_offered:
        action_client.DIRECTORY._publishing = {ACTION.name + "/status": ["/a"]}
    thread = GoalThread(ACTION)
    for _ in range(2):
        thread.idle()
    assert len(made) == expected and thread.is_there is is_offered


@pytest.mark.parametrize("value", ["5", 1.5, True])
def test_a_parameter_that_spoils_the_client_is_told(master, monkeypatch, value):
    monkeypatch.setattr(action_client, "ask_master", lambda method, name: value)
    with pytest.raises(Trouble, match="actionlib_client_pub_queue_size is .*must be a whole") as by:
        GoalThread(ACTION)._connect()
    assert by.value.cause is Cause.TYPE_MISMATCH


def test_feedback_is_told_if_it_is_new_and_not_too_often(master, monkeypatch):
    now = [100.0]
    monkeypatch.setattr(action_client.time, "monotonic", lambda: now[0])
    (request, told), thread = job(), GoalThread(ACTION)
    for now[0], metres in ((100.0, 9.0), (100.4, 8.0), (100.5, 7.0), (101.0, 7.0), (101.1, 6.0)):
        thread._report(request, None, types.SimpleNamespace(distance_remaining=metres))
    assert told == ["9.0 m left", "7.0 m left", "6.0 m left"]
    now[0] = 200.0
    thread._report(request, None, None)
    assert "AttributeError" in told[3] and "\n" not in told[3]


# -------------------------------------------------------------------------------------- listening


class Listening:
    """A client for speech, and what it does."""

    def __init__(self, *goals):
        self.is_published, self.time, self.heard, self.warned = False, [0.0], [], []
        self.client, self.wakes = Client(*goals), []
        self.action = SpeechActionClient(
            SPEECH, lambda: self.is_published, self.heard.append, lambda: self.wakes.append(1),
            self.warned.append, lambda: self.time[0])
        self.action._client = self.client


@pytest.fixture
def listening(master):
    made = []

    def start(*goals):
        made.append(Listening(*goals))
        return made[-1]
    yield start
    for each in made:
        each.action.listen(0.0)
        each.action.end()


def heard(words):
    return Goal(done(GoalStatus.SUCCEEDED, transcription=words))


def test_goals_are_sent_while_the_mission_listens_and_each_utterance_is_a_message(listening):
    last = Goal(ACTIVE)
    listens = listening(heard(" yes "), heard(""), heard("no"), last)
    assert not listens.action.is_under_way
    listens.action.listen(20.04)
    until(lambda: len(listens.client.sent) == 4)
    assert listens.heard == ["yes", "no"] and len(listens.wakes) == 3 and not listens.warned
    assert {sent.wait for sent in listens.client.sent} == {20.0}
    assert listens.action.is_under_way
    listens.time[0] = 20.04 + SPEECH.deadline - 0.1  # a result may come after the listening
    assert listens.action.is_under_way and not last.is_cancelled
    listens.time[0] += 0.2
    assert not listens.action.is_under_way
    until(lambda: last.is_cancelled)
    until(lambda: listens.warned)
    assert listens.warned == [f"the action {SPEECH.name} has given no result in time"]
    assert listens.heard == ["yes", "no"] and len(listens.client.sent) == 4


def test_the_end_of_the_listening_cancels_the_goal_and_is_no_failure(listening):
    goal = Goal(ACTIVE)
    listens = listening(goal, heard("later"))
    listens.action.listen(20.0)
    until(lambda: listens.client.sent)
    listens.action.listen(0.0)
    until(lambda: goal.is_cancelled)
    assert not listens.warned and not listens.heard and not listens.action.is_under_way
    listens.action.listen(20.0)
    until(lambda: listens.heard == ["later"])


@pytest.mark.parametrize("is_preferred", [False, True])
def test_a_topic_that_is_published_is_heard_instead_unless_the_action_is_preferred(
        listening, is_preferred):
    listens = listening(heard("yes"), Goal(ACTIVE))
    listens.is_published = True
    listens.action.listen(20.0, is_preferred)
    if is_preferred:
        until(lambda: listens.heard == ["yes"])
        assert set(listens.warned) == {
            f"the action {SPEECH.name} is not there: the topic is used in its place"}
    else:
        time.sleep(0.1)
        assert not listens.client.sent and not listens.warned
        listens.is_published = False
        until(lambda: listens.heard == ["yes"])


@pytest.mark.slow
@pytest.mark.parametrize("goal, words, message", [
    (Goal(done(GoalStatus.ABORTED), why="no microphone"), "aborted (no microphone)", True),
    (Goal(done(GoalStatus.LOST)), "its server does not know the goal any more", True),
    (Goal(awaited(GoalStatus.SUCCEEDED)), "its result did not come", False),
    (Goal(UNSEEN), "the goal was not acknowledged in 0.2 s", False)])
def test_a_failure_is_warned_of_once_and_is_a_message_unless_another_goal_may_bring_one(
        listening, goal, words, message):
    again = Goal(*goal.states, why=goal.why)
    listens = listening(goal, again, heard("yes"), Goal(ACTIVE))
    listens.action.listen(60.0)
    until(lambda: len(listens.client.sent) == 4)
    assert listens.warned == [f"the action {SPEECH.name} failed: {words}"]
    assert listens.heard == [f"Error: {SPEECH.name} {words}"] * 2 * message + ["yes"]


@pytest.mark.parametrize("error, told", [
    (OSError("the master is away"), []), (ValueError("half an answer"),
                                          ["cannot be used: half an answer"])])
def test_what_keeps_it_from_its_server_is_warned_of_once(listening, monkeypatch, error, told):
    def fail():
        raise error
    listens = listening()
    listens.client.connection("status_sub").md5sum = None
    monkeypatch.setattr(listens.action, "_connect", fail)
    action_client.DIRECTORY._publishing = {SPEECH.name + "/status": ["/a"]}
    for _ in range(2):
        listens.action.idle()
    assert listens.warned == [f"the action {SPEECH.name} {each}" for each in told]


def test_a_server_that_is_started_while_the_mission_listens_is_used(listening, monkeypatch):
    listens = listening()
    listens.action._client = None
    monkeypatch.setattr(action_client.actionlib, "ActionClient",
                        lambda *_: Client(heard("yes"), Goal(ACTIVE)))
    listens.action.listen(20.0)
    time.sleep(0.05)
    assert not listens.heard
    action_client.DIRECTORY._publishing = {SPEECH.name + "/status": ["/a"]}
    until(lambda: listens.heard == ["yes"])
