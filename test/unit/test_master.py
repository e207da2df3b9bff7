"""What is known of the robot while the master answers, is silent, or is another one."""
import contextlib

import pytest

rospy = pytest.importorskip("rospy", reason="needs ROS")

from behavior_controller.robot.gateway import Cause  # noqa: E402
from behavior_controller.ros import master as ros_master  # noqa: E402
from behavior_controller.ros.master import Directory, Place  # noqa: E402
from behavior_controller.ros.tcpros import Trouble  # noqa: E402
from ros_peers import Master  # noqa: E402

SAY, THERE, ELSEWHERE = "/textToSpeech/say_text", "rosrpc://h:1", "rosrpc://h:2"
FACES, NODE = "/faceDetection/data", "http://h:3/"
LIMIT = 0.4  # seconds for an answer


@pytest.fixture
def master(monkeypatch):
    found = Master()
    monkeypatch.setenv("ROS_MASTER_URI", found.uri)
    monkeypatch.setattr(ros_master, "QUERY_LIMIT", LIMIT)
    yield found
    found.may_answer.set()
    found.close()


def look_up(directory):
    """Return the place of the service, or why it has none."""
    try:
        return directory.service(SAY, LIMIT, LIMIT)
    except Trouble as trouble:
        return trouble.cause


def knows_us(master):
    master.nodes[rospy.get_name()] = "http://us:1/"


@pytest.mark.parametrize("found_before, now, expected", [
    # the master lists it
    ("", THERE, Place(THERE, True)), (THERE, ELSEWHERE, Place(ELSEWHERE, True)),
    # no node offers it; a master that does not know this node either is a new one
    ("", None, Cause.NOT_ADVERTISED), (THERE, None, Cause.NOT_ADVERTISED),
    (THERE, "new master", Place(THERE, False)), ("", "new master", Cause.NOT_ADVERTISED),
    # nobody knows: it is used where it was, and what was never seen cannot be reached
    ("", "silent", Cause.NOT_REACHABLE), (THERE, "silent", Place(THERE, False)),
    ("", "garbage", Cause.NOT_REACHABLE), (THERE, "garbage", Place(THERE, False))])
def test_where_a_service_is(master, found_before, now, expected):
    directory = Directory()
    knows_us(master)
    if found_before:
        master.services[SAY] = found_before
        assert look_up(directory) == Place(found_before, True)
    master.services[SAY] = {"silent": None, "new master": None, "garbage": 7}.get(now, now)
    if now == "new master":
        master.nodes.clear()
    if now == "silent":
        master.may_answer.clear()
    assert look_up(directory) == expected


@pytest.mark.parametrize("is_known", [False, True])
def test_a_master_that_was_just_silent_is_asked_only_for_what_was_never_found(master, is_known):
    directory, master.services[SAY] = Directory(), THERE
    if is_known:
        look_up(directory)
    directory.unanswered, before = 1, len(master.calls)
    assert look_up(directory) == Place(THERE, not is_known)
    assert len(master.calls) - before == (not is_known)


def test_a_service_that_its_node_has_withdrawn_is_forgotten(master):
    directory, master.services[SAY] = Directory(), THERE
    knows_us(master)
    look_up(directory)
    del master.services[SAY]
    assert look_up(directory) is Cause.NOT_ADVERTISED
    master.may_answer.clear()
    assert look_up(directory) is Cause.NOT_REACHABLE


def refreshed(directory):
    with contextlib.suppress(Trouble), directory.round():
        directory.refresh()
        directory.publishers(FACES, {})
    return directory.unanswered, directory.fault


def test_each_round_without_an_answer_counts_until_one_is_complete(master):
    directory = Directory()
    master.may_answer.clear()
    assert [refreshed(directory) for _ in range(3)] == [
        (number, "does not answer") for number in (1, 2, 3)]
    master.may_answer.set()
    assert refreshed(directory)[0] == 0


def test_where_publishers_are_also_of_a_master_that_fell_silent_after_its_list(master):
    directory = Directory()
    master.publishers[FACES] = ["/a", "/b", "/gone"]
    master.nodes.update({"/a": NODE, "/b": ELSEWHERE})
    directory.refresh()
    assert directory.is_published(FACES) and not directory.is_published("/x")
    assert directory.publishers(FACES, {}) == (NODE, ELSEWHERE)
    calls = len(master.calls)
    assert directory.publishers(FACES, {"/a": "x", "/b": "y", "/gone": "z"}) == ("x", "y", "z")
    assert len(master.calls) == calls
    master.may_answer.clear()
    with pytest.raises(Trouble):
        directory.publishers(FACES, {})


def test_slow_answers_in_a_row_are_counted(master, monkeypatch):
    directory = Directory()
    monkeypatch.setattr(ros_master, "SLOW_ANSWER", -1.0)
    for number in (1, 2):
        directory.refresh()
        assert directory.slow_answers == number
    monkeypatch.setattr(ros_master, "SLOW_ANSWER", 60.0)
    directory.refresh()
    assert directory.slow_answers == 0


@pytest.mark.parametrize("publishers, nodes, expected", [
    ({}, {}, Cause.NOT_ADVERTISED), ({"/go/status": ["/n"]}, {}, Cause.NOT_ADVERTISED),
    ({"/go/status": ["/n"]}, {"/n": NODE}, NODE),
    ({"/go/status": ["/dead", "/n"]}, {"/n": NODE}, NODE),
    ({"/go/result": ["/n"]}, {"/n": NODE}, Cause.NOT_ADVERTISED)])
def test_which_node_offers_an_action(master, publishers, nodes, expected):
    master.publishers.update(publishers)
    master.nodes.update(nodes)
    try:
        assert Directory.server("/go", LIMIT) == expected
    except Trouble as trouble:
        assert trouble.cause is expected


def test_what_this_node_subscribes_to_is_registered_where_it_is_not_listed(master, monkeypatch):
    monkeypatch.setattr(rospy.core, "get_node_uri", lambda: "http://us:1/")
    directory = Directory()
    directory.is_keeping_up = True
    directory.subscribe(FACES, "t/T")
    directory.refresh()
    assert ("registerSubscriber", FACES, "t/T", "http://us:1/") in master.calls
