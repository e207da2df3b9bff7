"""The names of a robot that is one of several: of its services, its records and its ports."""
import os
import socket

import pytest
import rospy
from rosgraph.names import load_mappings, resolve_name

from behavior_controller.bt import ManualClock
from behavior_controller.wakeup import WakeUp
from behavior_controller.config import settings
from behavior_controller.errors import ConfigurationError
from behavior_controller.robot.d543 import FACES, INTERFACE
from behavior_controller.robot.gateway import FakeGateway, FakeTopics
from behavior_controller.robot.requests import Answer, Say
from behavior_controller.ros import configuration
from behavior_controller.ros.names import enter, words_of
from behavior_controller.ros.types import resolved
from behavior_controller.run.events import Events
from behavior_controller.run.health import GONE, gone
from behavior_controller.run.record import files
from behavior_controller.run.record.unended import may_be_live
from behavior_controller.viewer.server import opened
from free_ports import free_port

SAY = "/textToSpeech/say_text"
CONFIGURATION = "scenarioSpecification lab_tour\nverboseMode true\nasrEnabled true\nrobot {}\n"


@pytest.mark.parametrize("given, robot", [
    ("robot1", "robot1"), ("/robot1", "robot1"), ("lab/robot_1", "lab/robot_1"), ("", "")])
def test_the_name_of_a_robot(tmp_path, given, robot):
    path = tmp_path / "test.ini"
    path.write_text(CONFIGURATION.format(given))
    assert settings.load(str(path)).robot == robot


@pytest.mark.parametrize("given", [
    "1 robot", "1robot", "robot-1", "~robot", "lab//robot", "robot/", "/", "_robot", "robót"])
def test_a_wrong_name_is_told_in_one_line(tmp_path, given):
    path = tmp_path / "test.ini"
    path.write_text(CONFIGURATION.format(given), encoding="utf-8")
    with pytest.raises(ConfigurationError, match="test.ini:4:") as caught:
        settings.load(str(path))
    assert given in str(caught.value) and "such as robot1" in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("words, say", [
    ([], "/robot1" + SAY), ([SAY + ":=/voice/say"], "/voice/say"),
    (["/robot1" + SAY + ":=/voice/say"], "/voice/say"), ([SAY[1:] + ":=/voice/say"], "/voice/say"),
    ([SAY + ":=say"], "/robot1/say"), ([f"{SAY}:={SAY}"], SAY),
    (["__ns:=robot1"], "/robot1" + SAY)])
def test_names_are_below_the_robot_unless_they_are_remapped(words, say):
    found = words_of("robot1", ["program", *words])
    node = "/robot1/node"
    mappings = {resolve_name(one, node): resolve_name(other, node)
                for one, other in load_mappings(found).items() if not one.startswith("__")}
    assert resolve_name(SAY, node, mappings) == say
    assert load_mappings(found)["__ns"].strip("/") == "robot1" and "/clock" not in mappings
    assert words_of("", words) is words


@pytest.mark.parametrize("words, say", [
    (["__ns:=/robot1"], "/robot1/say"), (["__ns:=robot1", "say:=speak"], "/robot1/say"),
    ([], "/say")])
def test_a_node_that_has_no_name_yet_resolves_names_in_its_namespace(monkeypatch, words, say):
    monkeypatch.setattr(rospy.names, "_caller_id", rospy.names.get_caller_id())
    enter(["program", *words])
    assert rospy.resolve_name("say") == say and rospy.resolve_name("/clock") == "/clock"


def test_a_replay_has_the_names_of_its_record():
    offers, values = INTERFACE.offers, dict(settings.defaults().values)
    mappings = {SAY: "/voice/say", FACES.name: "/cam/faces"}
    names = [mappings.get(offer.name, offer.name) for offer in offers]
    robot = settings.recorded(values, "settings", names).interface
    assert [robot.name_of(offer) for offer in offers] == names
    # that of another release, or without remapped names
    for others in (names[1:], [offer.name for offer in offers], ()):
        assert settings.recorded(values, "settings", others).interface is INTERFACE


def test_what_is_remapped_has_one_name_for_leaves_and_monitor(monkeypatch):
    mappings = {SAY: "/voice/say", FACES.name: "/cam/faces"}
    monkeypatch.setattr(rospy.names, "_resolved_mappings", mappings)
    monkeypatch.setattr(rospy.names, "_caller_id", "/behaviorController")
    monkeypatch.setattr(configuration, "_private_parameters", lambda: {"missionRuns": 2})
    monkeypatch.setattr(configuration, "_given", dict)
    clock, wake = ManualClock(100.0), WakeUp()
    plan = configuration.read_plan(clock, wake, lambda severity, text: None)
    robot, say = plan.settings.interface, INTERFACE.service(Say)
    assert {offer.name: robot.name_of(offer) for offer in robot.offers
            if robot.name_of(offer) != offer.name} == mappings
    assert robot.topic(FACES.name) is FACES and plan.settings.interface is robot
    gateway = FakeGateway(wake.emit, lambda request: Answer())
    mission = plan.context(gateway, FakeTopics(clock.now, wake.emit), Events())
    mission.health.report(GONE, gone("service", resolved(say), "textToSpeech", "so", "no voice"))
    mission.health.publish(mission.events)
    asked = []
    mission.events.subscribe(asked.append)
    mission.gateway.start(Say("hello", "English"))
    assert mission.health.is_gone(asked[0].service) and asked[0].service == "/voice/say"


@pytest.mark.parametrize("words, environment", [(["__ns:=/hall"], ""), ([], "hall")])
def test_another_namespace_is_refused(monkeypatch, words, environment):
    monkeypatch.setenv("ROS_NAMESPACE", environment)
    with pytest.raises(ConfigurationError, match="robot robot1: .* namespace /hall,.*/robot1"):
        words_of("robot1", words)


def test_the_folder_of_a_record_names_the_robot(tmp_path):
    for robot in ("", "robot1", "lab/robot_1"):
        folder = files.new_folder(str(tmp_path), robot)
        assert files.robot_of(os.path.join(folder, files.FILE_NAME)) == robot
    assert [name[:6] for name in sorted(os.listdir(tmp_path))] == ["000001", "000002", "000003"]


def test_the_killed_run_of_another_robot_says_nothing_of_this_one(tmp_path, killed_run):
    assert may_be_live(str(tmp_path)) and not may_be_live(str(tmp_path), "robot1")
    folder = os.path.dirname(killed_run)
    os.rename(folder, folder + "_robot1")
    assert not may_be_live(str(tmp_path)) and may_be_live(str(tmp_path), "robot1")


def test_the_next_free_ports_are_taken():
    port, told = free_port(6), []
    with socket.create_server(("127.0.0.1", port + 1)):
        found = opened("127.0.0.1", [port, port + 1], "no page", "aPort", told.append, 3)
        assert [sockets[0].getsockname()[1] for sockets in found] == [port + 2, port + 3]
        assert opened("127.0.0.1", [port + 1], "no page", "aPort", told.append, 4)
        for sock in sum(found, []):
            sock.close()
    assert told == []
