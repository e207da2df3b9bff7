"""What is known of the robot while the master answers, is silent, or is another one."""
import contextlib
import types

import pytest

rospy = pytest.importorskip("rospy", reason="needs ROS")

from behavior_controller.robot.gateway import Cause  # noqa: E402
from behavior_controller.ros import master as ros_master  # noqa: E402
from behavior_controller.ros.master import Directory, Place  # noqa: E402
from behavior_controller.ros.tcpros import Trouble  # noqa: E402
from ros_peers import Master, TcprosPeer, hang  # noqa: E402

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


@pytest.mark.slow
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


@pytest.mark.slow
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


@pytest.mark.slow
def test_each_round_without_an_answer_counts_until_one_is_complete(master):
    directory = Directory()
    master.may_answer.clear()
    assert [refreshed(directory) for _ in range(3)] == [
        (number, "does not answer") for number in (1, 2, 3)]
    master.may_answer.set()
    assert refreshed(directory)[0] == 0


@pytest.mark.slow
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


# ----------------------------------------------------------------------------- this node's own name

US = "http://us:1/"


@pytest.fixture
def registering(master, monkeypatch):
    """A directory that keeps this node registered; ``ended`` has the reasons to end it."""
    monkeypatch.setattr(rospy.core, "get_node_uri", lambda: US)
    found = Directory()
    found.is_keeping_up, found.ended = True, []
    monkeypatch.setattr(rospy, "signal_shutdown", found.ended.append)
    found.subscribe(FACES, "t/T")
    return found


def registered(master):
    return [call for call in master.calls if call[0].startswith("register")]


@pytest.mark.parametrize("holder, ends", [(None, False), (US, False), ("http://other:1/", True)])
def test_a_node_whose_name_another_has_registers_nothing_and_ends(master, registering, holder,
                                                                  ends):
    master.nodes[rospy.get_name()] = holder
    registering.refresh()
    assert bool(registered(master)) is not ends
    assert registering.ended == [ros_master.NAME_IS_TAKEN] * ends


def test_a_node_that_ends_registers_nothing(master, registering, monkeypatch):
    monkeypatch.setattr(rospy.core, "is_shutdown_requested", lambda: True)
    registering.refresh()
    assert not registered(master) and not registering.ended


def test_topics_are_registered_once_more(master, registering):
    topics = [types.SimpleNamespace(reg_type=kind, resolved_name="/" + kind, type="t/T")
              for kind in ("pub", "sub")]
    registering.register(*topics)
    assert registered(master) == [("registerPublisher", "/pub", "t/T", US),
                                  ("registerSubscriber", "/sub", "t/T", US)]


def test_rospy_is_told_of_the_publishers_that_a_registration_returns(master, registering,
                                                                    monkeypatch):
    told, answer = [], master._dispatch
    monkeypatch.setattr(ros_master, "ask", lambda *what, seconds: told.append(what))
    master._dispatch = lambda method, params: (
        [1, "", [NODE]] if method == "registerSubscriber" else answer(method, params))
    registering.refresh()
    assert told == [(US, "publisherUpdate", FACES, [NODE])]
    told.clear()
    master._dispatch = answer
    registering.refresh()
    assert not told


def test_of_a_master_that_has_forgotten_this_node_the_known_services_are_former_ones(
        master, registering, monkeypatch):
    master.services[SAY] = THERE
    look_up(registering)
    registering.refresh()
    assert not registering.forgotten  # it lacks a subscription alone
    del master.services[SAY]
    monkeypatch.setattr(ros_master.get_topic_manager(), "get_publications",
                        lambda: [["/rosout", "rosgraph_msgs/Log"]])
    registering.refresh()
    assert registering.forgotten == {SAY} and look_up(registering) == Place(THERE, False)
    master.services[SAY] = ELSEWHERE
    assert look_up(registering) == Place(ELSEWHERE, True)
    registering.refresh()
    assert not registering.forgotten


@pytest.mark.slow
@pytest.mark.parametrize("unanswered, expected", [(0, [("unregisterSubscriber", FACES, US)]),
                                                  (1, [])])
def test_at_its_end_the_node_unregisters_if_the_master_answers(master, registering, unanswered,
                                                              expected):
    registering.unanswered = unanswered
    for _ in range(2):
        registering.sign_off()
    assert master.calls == 2 * expected
    master.may_answer.clear()
    registering.sign_off()  # within the limit of a question
    assert not registering.registering.locked()


@pytest.mark.parametrize("talk, expected", [
    (lambda connection: connection.close(), True), (hang, False),
    (lambda connection: connection.sendall(b"x") or hang(connection), False)])
def test_whether_the_former_node_ends(monkeypatch, talk, expected):
    monkeypatch.setattr(ros_master, "PARTING_LIMIT", 0.3)
    peer = TcprosPeer(talk)
    assert ros_master._ends("http://127.0.0.1:{}/".format(peer.port)) is expected
    peer.close()
    assert ros_master._ends("http://127.0.0.1:{}/".format(peer.port))


@pytest.mark.parametrize("holder, expected", [(None, True), (US, True), ("http://o:1/", False),
                                              ("silent", False)])
def test_who_has_the_name(master, registering, monkeypatch, holder, expected):
    master.nodes[rospy.get_name()] = holder
    if holder == "silent":
        master.close()
    assert ros_master._has_name() is expected
