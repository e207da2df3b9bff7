"""The start-up check, with servers and publishers in this process: what is missing, why, and
whether the mission starts without it."""
import types

import pytest

rospy = pytest.importorskip("rospy", reason="needs ROS")

from behavior_controller.wakeup import WakeUp  # noqa: E402
from behavior_controller.errors import NodesMissing  # noqa: E402
from behavior_controller.robot import d543, release_1_0, release_1_1  # noqa: E402
from behavior_controller.robot.declarations import Publication  # noqa: E402
from behavior_controller.robot.gateway import Cause  # noqa: E402
from behavior_controller.robot.requests import (  # noqa: E402
    GoTo, GoToGoal, Prompt, Say, SetPose)
from behavior_controller.ros import startup_check  # noqa: E402
from behavior_controller.ros.master import Directory  # noqa: E402
from behavior_controller.ros.startup_check import StartUpCheck, find_missing  # noqa: E402
from behavior_controller.ros.timeouts import Stopped  # noqa: E402
from behavior_controller.ros.types import TYPES  # noqa: E402
from ros_peers import Master, Publisher, Service, TcprosPeer, hang  # noqa: E402

SAY, FACES = d543.INTERFACE.service(Say), d543.FACES
POSE, PROMPT = (release_1_0.INTERFACE.service(kind) for kind in (SetPose, Prompt))
DRIVE, ACTION = (release_1_1.INTERFACE.service(kind) for kind in (GoTo, GoToGoal))
SIGN = Publication(Say, "/sign", "sign", "std_msgs/String", lambda request: (request.text,), None,
                   5.0, "nothing is shown")


@pytest.fixture
def master(monkeypatch):
    found = Master()
    monkeypatch.setenv("ROS_MASTER_URI", found.uri)
    monkeypatch.setattr(startup_check, "DIRECTORY", Directory())
    monkeypatch.setitem(TYPES, SIGN, TYPES[d543.SPEECH])
    yield found
    found.close()


def publishes(master, topic, name="/p", **header):
    publisher = Publisher(topic, name, **header)
    master.publishers.setdefault(topic.name, []).append(name)
    master.nodes[name] = publisher.uri
    return publisher


def dead(master):
    master.publishers[FACES.name], master.nodes["/p"] = ["/p"], "http://127.0.0.1:1/"


def forgotten(master):
    master.publishers[FACES.name] = ["/p"]


def wrong_then_right(master):
    publishes(master, FACES, "/wrong", md5sum="other")
    publishes(master, FACES, "/right")


def hangs(master):
    master.services[SAY.name] = "rosrpc://127.0.0.1:{}".format(TcprosPeer(hang).port)


def offers_action(master):
    kind = type(TYPES[ACTION]().action_result)
    publisher = Publisher(d543.SPEECH, "/p", type=kind._type, md5sum=kind._md5sum)
    master.publishers[ACTION.name + "/result"], master.nodes["/p"] = ["/p"], publisher.uri


def subscribe(master, *nodes):
    state = master._dispatch

    def answer(method, params):
        if method == "getSystemState":
            return [1, "", [[], [[SIGN.name, list(nodes)]], []]]
        return state(method, params)

    master._dispatch = answer


@pytest.mark.slow
@pytest.mark.parametrize("offer, robot, cause, words", [
    (SAY, lambda master: None, Cause.NOT_ADVERTISED, "no node offers this service"),
    (SAY, lambda master: Service(master, SAY), None, ""),
    # another type under that name
    (PROMPT, lambda master: Service(master, d543.INTERFACE.service(Prompt)), Cause.TYPE_MISMATCH,
     "its server has cssr_system/textService (md5 "),
    (SAY, hangs, Cause.NO_ANSWER, "not in 0.5 s"),
    (FACES, lambda master: None, Cause.NOT_ADVERTISED, "no node publishes it"),
    (FACES, lambda master: publishes(master, FACES), None, ""),
    (FACES, lambda master: publishes(master, FACES, type="a/B", md5sum="1"), Cause.TYPE_MISMATCH,
     "node /p has a/B (md5 1), expected is cssr_system/faceDetectionMessage"),
    (FACES, wrong_then_right, None, ""),
    (FACES, lambda master: publishes(master, FACES, error="not for you"), Cause.NOT_REACHABLE,
     "node /p is listed as its publisher, but it says: not for you"),
    (FACES, dead, Cause.NOT_REACHABLE, "node /p is listed as its publisher, but "),
    (FACES, forgotten, Cause.NOT_ADVERTISED,
     "node /p is listed as its publisher, but it has ended"),
    (ACTION, lambda master: None, Cause.NOT_ADVERTISED, "no node offers this action"),
    (ACTION, offers_action, None, ""),
    (SIGN, lambda master: subscribe(master), Cause.NOT_ADVERTISED,
     "no node subscribes to this topic"),
    (SIGN, lambda master: subscribe(master, rospy.get_name()), Cause.NOT_ADVERTISED, "no node"),
    (SIGN, lambda master: subscribe(master, "/s", rospy.get_name()), None, "")])
def test_what_is_missing_and_why(master, monkeypatch, offer, robot, cause, words):
    monkeypatch.setattr(startup_check, "PROBE_LIMIT", 0.5)
    robot(master)
    found = find_missing([offer], WakeUp(), lambda: False)
    assert [trouble.cause for trouble in found.values()] == [cause] * bool(cause)
    assert all(words in str(trouble) for trouble in found.values())


def test_a_probe_asks_nothing_of_the_robot(master):
    server = Service(master, SAY)
    find_missing([SAY], WakeUp(), lambda: False)
    assert len(server.connections) == 1 and not server.requests


def check(robot, *offers, timeout=0.0, has_asr=True):
    """Return a check of a mission that needs these, and the lines and findings of it."""
    settings = types.SimpleNamespace(startup_timeout=timeout, asr_enabled=has_asr, interface=robot)
    lines, found = [], []
    made = StartUpCheck(types.SimpleNamespace(offers=offers, settings=settings),
                        lambda *line: lines.append(line), WakeUp(), lambda: False, found.append)
    return made, lines, found


@pytest.mark.slow
@pytest.mark.parametrize("robot, offer, has_asr, reason", [
    (d543.INTERFACE, SAY, True, None), (d543.INTERFACE, FACES, False, None),
    (d543.INTERFACE, d543.SPEECH, True, None),
    (d543.INTERFACE, d543.SPEECH, False, "asrEnabled is false: going on"),
    (release_1_0.INTERFACE, POSE, True,
     "going on: a step that asks for it is passed over while no node offers it"),
    (release_1_0.INTERFACE, PROMPT, True, "going on: a step that asks for it fails"),
    (release_1_0.INTERFACE, PROMPT, False, None)])  # visitors answer on the tablet
def test_without_what_a_mission_starts(master, robot, offer, has_asr, reason):
    made, lines, found = check(robot, offer, has_asr=has_asr)
    if reason is None:
        with pytest.raises(NodesMissing, match="^1 of the 1 services and topics that the mission "
                                               "needs are missing:\n  .*without it"):
            made.run()
        assert not lines
    else:
        made.run()
        (severity, line), = lines
        assert severity == "warning" and line.endswith(f" ({reason})")
        assert line.startswith(f"{offer.kind} {offer.name} (of node /{offer.node}): not advertised")
    assert [each.state for each in found] == [
        "awaited", "awaited", "missing" if reason is None else "doubtful"]


@pytest.mark.slow
def test_one_of_another_type_is_missed_though_it_is_optional(master):
    Service(master, POSE)._header["md5sum"] = "1"
    with pytest.raises(NodesMissing, match="type mismatch: its server has .* .md5 1., expected is"):
        check(release_1_0.INTERFACE, POSE)[0].run()


@pytest.mark.slow
def test_it_waits_for_what_is_missing_and_tells_so_once_for_each_set(master, monkeypatch):
    monkeypatch.setattr(startup_check, "RETRY_INTERVAL", 0.05)
    made, lines, found = check(d543.INTERFACE, SAY, FACES, timeout=30.0)
    told = made.tell

    def tell(*line):
        told(*line)
        if len(lines) == 1:
            publishes(master, FACES)
        else:
            Service(master, SAY)

    made.tell = tell
    made.run()
    assert [(severity, line.split(" for ")[1]) for severity, line in lines] == [
        ("info", f"{SAY.name}, {FACES.name}"), ("info", SAY.name)]
    assert {each.name: each.state for each in found} == {SAY.name: "ready", FACES.name: "ready"}


@pytest.mark.slow
def test_a_stop_ends_the_wait(master, monkeypatch):
    made, lines, _ = check(d543.INTERFACE, SAY, timeout=30.0)
    made.is_stopped = lambda: bool(lines)
    made.tell = lambda *line: (lines.append(line), made.wake.emit())
    with pytest.raises(Stopped):
        made.run()


def test_a_service_stands_in_for_its_action_and_is_told_to(master):
    made, lines, found = check(release_1_1.INTERFACE, ACTION)
    Service(master, DRIVE)
    made.run()
    assert made.substituted == {ACTION: DRIVE}
    assert lines == [("warning", "no node offers the action /robotNavigation/set_goal: the service "
                                 "/robotNavigation/set_goal is used in its place")]
    assert [each.state for each in found] == ["awaited", "ready"]


@pytest.mark.slow
def test_of_an_action_whose_service_cannot_be_used_that_is_told(master):
    master.services[DRIVE.name] = "rosrpc://127.0.0.1:1"
    with pytest.raises(NodesMissing, match="not reachable: the master lists it"):
        check(release_1_1.INTERFACE, ACTION)[0].run()


def test_another_robot_is_known_by_what_it_offers(master):
    for service in release_1_0.SERVICES:
        Service(master, service)
    with pytest.raises(NodesMissing, match="^this is a robot of release 1.0: set robotInterface "
                                           "release-1.0 .the configuration says D5.4.3; found: "
                                           "/animateBehaviour/setActivation as "):
        check(d543.INTERFACE, *d543.SERVICES)[0].run()


@pytest.mark.slow
def test_a_robot_of_the_configured_kind_lacks_only_what_is_missing(master):
    for service in d543.SERVICES[1:]:
        Service(master, service)
    with pytest.raises(NodesMissing, match="^1 of the 7 services and topics"):
        check(d543.INTERFACE, *d543.SERVICES)[0].run()
