"""Tests of the launch files as roslaunch reads them: every key is declared and reaches its processes."""
import os
import shlex

import pytest
from roslaunch import substitution_args
from roslaunch.config import ROSLaunchConfig
from roslaunch.xmlloader import XmlLoader

from behavior_controller import folders, settings
from behavior_controller.settings import split_arguments

from unit_tests import arguments, configuration
from unit_tests.robot import NODES

CONTROLLER = {key.name for key in settings.KEYS}
TEST = {key.name for key in configuration.KEYS}
LAUNCH = os.path.join(configuration.share(), "launch")
WHOLE_TEST = os.path.join(LAUNCH, "behaviorControllerTest.launch")
ROBOT = os.path.join(LAUNCH, "simulatedRobot.launch")
CONTROLLER_ALONE = os.path.join(folders.share(), "launch", "behaviorController.launch")


@pytest.fixture(autouse=True)
def packages(monkeypatch):
    """Let roslaunch find the packages also outside of a workspace."""
    monkeypatch.setenv("ROS_PACKAGE_PATH", os.pathsep.join((folders.share(), configuration.share())))
    monkeypatch.setattr(substitution_args, "_rospack", None)


def load(path, *given):
    config = ROSLaunchConfig()
    XmlLoader(resolve_anon=True).load(path, config, argv=list(given), verbose=False)
    return config


def given_to(path, *given):
    """Return the arguments of each node."""
    return {node.name: split_arguments(shlex.split(node.args))[1] for node in load(path, *given).nodes}


@pytest.mark.parametrize("path, names, nodes", (
    (WHOLE_TEST, CONTROLLER | TEST | {"outputFile"}, ("behaviorController", "behaviorControllerTest") + NODES),
    (ROBOT, TEST - {"missionRuns", "testTimeout"} | {"robotInterface", "tabletSuccessIs", "language",
                                                              "mutualGazeValue"}, NODES),
    (CONTROLLER_ALONE, CONTROLLER, ("behaviorController",)),
))
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
    assert {name for name in load(path, "asrEnabled:=false", "failureRate:=0.5").params if "/ros" not in name} == set()


def test_zero_and_false_are_values():
    controller = given_to(WHOLE_TEST, "failureRate:=0", "asrEnabled:=false")["behaviorController"]
    assert (controller["failureRate"], controller["asrEnabled"]) == ("0", "False")


def test_short_names_stand_for_their_keys():
    report = given_to(WHOLE_TEST, *("{}:=x".format(short) for short in arguments.SHORT))["behaviorControllerTest"]
    assert {key: report[key] for key in arguments.SHORT.values()} == dict.fromkeys(arguments.SHORT.values(), "x")


def test_a_real_node_is_not_started_and_the_report_knows():
    found = given_to(WHOLE_TEST, *("use_real_{}:=true".format(node) for node in NODES))
    assert set(found) == {"behaviorController", "behaviorControllerTest"}
    assert {found["behaviorControllerTest"]["use_real_" + node] for node in NODES} == {"True"}
