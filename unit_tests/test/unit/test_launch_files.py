"""Tests of the launch files as roslaunch reads them: every key is declared and reaches its
processes."""
import os
import shlex

import pytest
from roslaunch import arg_dump, substitution_args
from roslaunch.config import ROSLaunchConfig
from roslaunch.xmlloader import XmlLoader

from behavior_controller import folders
from behavior_controller.config import settings
from behavior_controller.errors import ConfigurationError
from behavior_controller.config.settings import split_arguments
from behavior_controller.simulation import configuration
from behavior_controller.simulation.behaviour import NODES

from unit_tests import folders as test_folders
from unit_tests.robot import options

CONTROLLER = {key.name for key in settings.KEYS}
TEST = {key.name for key in configuration.KEYS}
LAUNCH = os.path.join(test_folders.share(), "launch")
WHOLE_TEST = os.path.join(LAUNCH, "behaviorControllerTest.launch")
ROBOT = os.path.join(LAUNCH, "simulatedRobot.launch")
CONTROLLER_ALONE = os.path.join(folders.share(), "launch", "behaviorController.launch")


@pytest.fixture(autouse=True)
def packages(monkeypatch):
    """Let roslaunch find the packages also outside of a workspace."""
    monkeypatch.setenv("ROS_PACKAGE_PATH", os.pathsep.join((folders.share(), test_folders.share())))
    monkeypatch.setattr(substitution_args, "_rospack", None)


def load(path, *given):
    config = ROSLaunchConfig()
    XmlLoader(resolve_anon=True).load(path, config, argv=list(given), verbose=False)
    return config


def given_to(path, *given):
    """Return the arguments of each node."""
    return {
        node.name: split_arguments(shlex.split(node.args))[1] for node in load(path, *given).nodes}


@pytest.mark.parametrize("path, names, nodes", (
    (WHOLE_TEST, CONTROLLER | TEST | {"outputFile"},
     ("behaviorController", "behaviorControllerTest") + NODES),
    (ROBOT, TEST - {"missionRuns", "testTimeout"}
     | {"robotInterface", "tabletSuccessIs", "language", "mutualGazeValue"}, NODES),
    (CONTROLLER_ALONE, CONTROLLER, ("behaviorController", ))))
def test_each_key_reaches_each_process(path, names, nodes):
    values = {name: "the {}".format(name) for name in names}
    found = given_to(path, *("{}:={}".format(*pair) for pair in values.items()))
    assert set(found) == set(nodes)
    for given in found.values():
        assert {name: given.get(name) for name in names} == values


@pytest.mark.parametrize("path", (WHOLE_TEST, ROBOT, CONTROLLER_ALONE))
def test_what_is_not_given_is_left_to_the_configuration(path):
    for given in given_to(path).values():
        assert not (CONTROLLER | TEST) & set(given)


@pytest.mark.parametrize("path", (WHOLE_TEST, ROBOT, CONTROLLER_ALONE))
def test_nothing_is_put_on_the_master(path):
    assert {name for name in load(path, "asrEnabled:=false", "failureRate:=0.5").params
            if "/ros" not in name} == set()


@pytest.mark.parametrize("path", (WHOLE_TEST, ROBOT, CONTROLLER_ALONE))
def test_each_argument_is_documented_and_none_is_required(path):
    shown = arg_dump.get_args([path])
    assert len(shown) > 20
    bare = {name for name, (meaning, default) in shown.items() if not meaning or not default}
    assert bare == set()


@pytest.mark.parametrize("path", (WHOLE_TEST, ROBOT))
@pytest.mark.parametrize("speed, has_clock", (((), False), (("speed:=1",), False),
                                              (("speed:=10",), True), (("speed:=0.5",), True)))
def test_a_speed_starts_the_clock_and_is_told_to_each_node(path, speed, has_clock):
    found = given_to(path, *speed)
    assert (options.CLOCK_NODE in found) is has_clock
    told = {given.get("speed") for given in found.values()}
    assert told == {speed[0].partition(":=")[2] if speed else None}
    assert "/use_sim_time" not in load(path, *speed).params  # a launch may be refused


def test_zero_and_false_are_values():
    controller = given_to(WHOLE_TEST, "failureRate:=0", "asrEnabled:=false")["behaviorController"]
    assert (controller["failureRate"], controller["asrEnabled"]) == ("0", "False")


def test_short_names_stand_for_their_keys():
    report = given_to(WHOLE_TEST, *("{}:=x".format(short)
                                    for short in configuration.SHORT))["behaviorControllerTest"]
    assert {key: report[key] for key in configuration.SHORT.values()} == dict.fromkeys(
        configuration.SHORT.values(), "x")


def test_a_real_node_is_not_started_and_the_report_knows():
    found = given_to(WHOLE_TEST, *("use_real_{}:=true".format(node) for node in NODES))
    assert set(found) == {"behaviorController", "behaviorControllerTest"}
    assert {found["behaviorControllerTest"]["use_real_" + node] for node in NODES} == {"True"}


@pytest.mark.parametrize("word, meant", (("failurRate:=0.9", "failureRate"), ("missionRuns:=1", ""),
                                         ("use_real_tabletEvents:=true", "use_real_tabletEvent")))
def test_an_argument_that_the_simulated_robot_does_not_declare(given, monkeypatch, word, meant):
    given("drawn:=5")
    monkeypatch.setattr(options.ros_arguments, "parent_command", lambda: [
        "roslaunch", "unit_tests", "simulatedRobot.launch", "failureRate:=0.1", word])
    with pytest.raises(ConfigurationError) as refusal:
        options.read(options.of_process())
    fault, = refusal.value.faults
    assert fault.file == "argument " + word and meant in fault.hint
