"""Tests of what a test asks the master before it starts: no answer ends it otherwise than by a
line, in bounded time."""
import os
import socket
import threading
import time
from xmlrpc.server import SimpleXMLRPCServer

import pytest

pytest.importorskip("rospy", reason="needs ROS, which this interpreter does not have")

from behavior_controller.errors import NodesMissing  # noqa: E402
from behavior_controller.robot.gateway import Cause  # noqa: E402
from behavior_controller.ros.tcpros import NO_ANSWER, Trouble, ask_master  # noqa: E402

from unit_tests.robot import claims, options  # noqa: E402
from unit_tests.robot.options import Arguments  # noqa: E402

TABLET = "/tabletEvent/prompt_and_get_response"
STATE = [[["/speechEvent/text", ["/ear"]]], [], [["/robotNavigation/set_goal", ["/legs"]]]]


def of(given):
    return options.read(Arguments([], given))


def own():
    return options.read(options.of_process())


@pytest.fixture(name="master")
def fake_master(monkeypatch, given):
    """Start a master that gives these answers; each node it knows is itself."""
    servers = []

    def start(state, lookup=None):
        server = SimpleXMLRPCServer(("127.0.0.1", 0), logRequests=False, allow_none=True)
        uri = "http://127.0.0.1:{}/".format(server.server_address[1])
        known = {"/ear": uri, "/legs": uri}
        server.register_function(lambda caller: state, "getSystemState")
        server.register_function(lambda caller, node: lookup or (
            [1, "", known[node]] if node in known else [-1, "unknown node", ""]), "lookupNode")
        server.register_function(lambda caller: [1, "", 77], "getPid")
        threading.Thread(target=server.serve_forever, args=(0.01,), daemon=True).start()
        servers.append(server)
        monkeypatch.setenv("ROS_MASTER_URI", uri)
    yield start
    for server in servers:
        server.shutdown()
        server.server_close()


def refused(given):
    """Return the lines of a refusal."""
    with pytest.raises(claims.Taken) as refusal:
        claims.check_test(of(given))
    return str(refusal.value).splitlines()


def test_each_node_in_the_way_is_a_line(master):
    master([1, "", STATE])
    legs, ear = refused({})
    for line, parts in ((legs, ("/legs", "/robotNavigation/set_goal",
                                "use_real_robotNavigation:=true")),
                        (ear, ("/ear", "/speechEvent/text", "use_real_speechEvent:=true"))):
        for part in parts + ("127.0.0.1", " 77 "):
            assert part in line


def test_the_clock_of_a_simulator_is_in_the_way_of_another_one_alone(master):
    master([1, "", [[["/clock", ["/ear"]]], [], []]])
    claims.check_test(of({"speed": "1"}))
    line, = refused({"speed": "10"})
    for part in ("/ear", "/clock", "without speed", " 77"):
        assert part in line


def test_what_is_not_simulated_is_not_asked_for(master):
    master([1, "", STATE])
    assert len(refused({"use_real_speechEvent": "true"})) == 1
    claims.check_test(of({"use_real_speechEvent": "true", "use_real_robotNavigation": "true"}))


@pytest.mark.parametrize("state", [
    "x", 5, None, [], [1, "", 5], [1, "", []], [1, "", [[], [], [5]]], [-1, "no", 0],
    [1, "", [[["/a"]], [], []]], [1, "", [[["/a", 5]], [], []]], [1, "", {"a": 1}]])
def test_a_system_state_of_another_shape_is_one_line(master, state):
    master(state)
    with pytest.raises(NodesMissing) as refusal:
        claims.check_test(of({}))
    assert "\n" not in str(refusal.value) and "127.0.0.1" in str(refusal.value)


@pytest.mark.parametrize("answer", [5, [1, "", 5], [1, "", ["a"]]])
def test_an_address_of_another_shape_is_one_line(master, answer):
    master([1, "", STATE], answer)
    with pytest.raises(NodesMissing) as refusal:
        claims.check_test(of({}))
    assert "\n" not in str(refusal.value)


@pytest.mark.parametrize(
    "uri", ["", "nonsense", "http://[", "http://127.0.0.1:9/", "http://127.0.0.1:99999999/"])
def test_an_address_where_no_node_answers_is_no_living_node(master, uri):
    master([1, "", STATE], [1, "", uri])
    claims.check_test(of({}))


@pytest.mark.slow
def test_a_master_that_hangs_is_one_line_in_time(given, monkeypatch):
    with socket.socket() as listener:
        listener.bind(("127.0.0.1", 0))
        listener.listen()
        monkeypatch.setenv("ROS_MASTER_URI",
                           "http://127.0.0.1:{}".format(listener.getsockname()[1]))
        monkeypatch.setattr(claims, "ANSWER_LIMIT", 0.2)
        began = time.monotonic()
        with pytest.raises(NodesMissing, match="does not answer"):
            claims.check_test(of({}))
        assert time.monotonic() - began < 5.0


def test_a_master_is_asked_again_if_its_first_answer_is_late(master, monkeypatch):
    master([1, "", STATE])
    late = iter([Trouble(Cause.NOT_REACHABLE, "timed out", NO_ANSWER)])

    def ask(*question, seconds):
        for trouble in late:
            raise trouble
        return ask_master(*question, seconds=seconds)

    monkeypatch.setattr(claims, "ask_master", ask)
    with pytest.raises(claims.Taken):
        claims.check_test(of({}))


def test_a_master_that_answers_without_end_is_one_line_in_time(master, monkeypatch):
    master([1, "", STATE])
    monkeypatch.setattr(claims, "CLAIMS_LIMIT", 0.2)
    monkeypatch.setattr(claims, "ask_master", lambda *_, **__: threading.Event().wait(5.0))
    with pytest.raises(NodesMissing):
        claims.check_test(of({}))


def test_without_a_master_a_test_starts_its_own_and_a_node_alone_does_not_start(given, monkeypatch):
    monkeypatch.setenv("ROS_MASTER_URI", "http://127.0.0.1:9")
    claims.check_test(of({}))
    with pytest.raises(claims.NoMaster):
        claims.check("textToSpeech", own())


def test_a_node_alone_needs_only_what_is_its_own(master):
    master([1, "", STATE])
    claims.check("textToSpeech", own())
    with pytest.raises(claims.Taken):
        claims.check("robotNavigation", own())


def test_of_a_launch_that_has_not_started_no_node_starts(master, given):
    master([1, "", STATE])
    given("drawn:=5")
    with pytest.raises(claims.Taken):
        claims.check("textToSpeech", own())
    given("drawn:=5", "use_real_robotNavigation:=true", "use_real_speechEvent:=true")
    claims.check("textToSpeech", own())


def test_names_are_those_that_rospy_will_register(given, monkeypatch):
    def claimed():
        claim, = claims.of_process("robotNavigation", own())
        return claim.name, claim.resources
    given()
    monkeypatch.setattr("sys.argv", ["node"])
    assert claimed() == ("/robotNavigation", {"/robotNavigation/set_goal"})
    monkeypatch.setattr("sys.argv", ["node", "__name:=legs", "/robotNavigation/set_goal:=go"])
    monkeypatch.setenv("ROS_NAMESPACE", "/upstairs")
    assert claimed() == ("/upstairs/legs", {"/upstairs/go"})


def test_a_service_that_the_robot_lacks_may_be_anywhere():
    tablet, = [claim for claim in claims.of_test(of({"absentServices": TABLET}))
               if claim.node == "tabletEvent"]
    assert (tablet.name, tablet.resources) == ("/tabletEvent", set())


def test_a_service_and_an_action_of_one_name_are_both_claimed(monkeypatch):
    monkeypatch.setattr("sys.argv", ["node"])
    name = "/textToSpeech/say_text"

    def claimed(**given):
        return next(claim.resources for claim in claims.of_test(of(dict(
            given, robotInterface="release-1.1"))) if claim.node == "textToSpeech")
    assert claimed() == {name, name + "/result"}
    assert claimed(absentServices=name) == {name + "/result"}
    assert claimed(absentActions=name) == {name}


def test_with_an_action_its_result_takes_the_place_of_the_topic(given):
    claimed = {claim.node: claim.resources for claim in claims.of_test(of({
        "robotInterface": "release-1.0", "recogniseBy": "action"}))}
    assert not any(name.endswith("/speechEvent/text") for name in claimed["speechEvent"])
    assert any(name.endswith("/result") for name in claimed["speechEvent"])
    assert "knowledgeBase" not in claimed


@pytest.mark.parametrize("name, machine, process, is_ours", [
    ("/ear", "here", os.getpid(), True), ("/ear", "here", os.getppid(), True),
    ("/ear", "here", 1, False), ("/ear", "here", 1 << 30, False),  # there is no such process
    ("/ear", "here", claims._UNKNOWN, True),  # it may be slow to answer
    ("/ear", "there", os.getpid(), False), ("/other", "here", os.getpid(), False)
], ids=map(str, range(7)))  # the numbers of processes differ where tests run side by side
def test_a_node_below_the_same_roslaunch_is_of_this_launch(
        monkeypatch, name, machine, process, is_ours):
    monkeypatch.setenv("ROS_HOSTNAME", "here")
    claim = claims.Claim("speechEvent", "/ear")
    monkeypatch.setattr(claims, "_holders", lambda _: [
        claims.Holder(claim, name, (), machine, process)])
    others, is_under_way = claims.find_others([claim], Arguments([], {options.DRAWN: "1"}))
    assert (not others, is_under_way) == (is_ours, is_ours)
    others, is_under_way = claims.find_others([claim], Arguments([], {}))
    assert len(others) == 1 and not is_under_way  # of no launch at all
