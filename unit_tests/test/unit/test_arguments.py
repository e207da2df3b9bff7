"""Tests of the arguments of a test: each key of both configurations, and no word that is not understood."""
import pytest

from behavior_controller import settings
from behavior_controller.errors import ConfigurationError

from unit_tests import arguments, configuration
from unit_tests.controller import command_line


def faults(call, given):
    with pytest.raises(ConfigurationError) as raised:
        call(given)
    return [str(fault) for fault in raised.value.faults]


def test_every_key_of_both_configurations_is_an_argument_with_a_line_of_the_help():
    usage = arguments.usage().splitlines()
    for key in settings.KEYS + configuration.KEYS:
        assert arguments.read([key.name + ":=1"]) == {key.name: "1"}
        lines = [line for line in usage if line.split()[:1] == [key.name]]
        # the test's own meaning counts where both have the key
        meaning = {each.name: each.plain_meaning for each in settings.KEYS + configuration.KEYS}[key.name]
        assert [line.endswith(meaning) for line in lines] == [True]


def test_short_names_are_those_of_keys():
    assert arguments.read(["mission:=museum", "scenario:=silent", "seed:=3", "verbose:=true"]) == {
        "scenarioSpecification": "museum", "visitorBehaviour": "silent", "randomSeed": "3", "verboseMode": "true"}


def test_every_word_that_is_not_understood_is_named():
    assert faults(arguments.read, ["failurRate:=0.9", "mision:=museum", "_failureRate:=1", "failureRate=1", "randomSeed:=",
                                   "colour:=red", "seed:=1"]) == [
        "argument failurRate:=0.9: unknown (did you mean failureRate?)",
        "argument mision:=museum: unknown (did you mean mission?)",
        "argument _failureRate:=1: unknown (did you mean failureRate?)",
        "argument failureRate=1: this is not of the form name:=value (--help lists the names)",
        "argument randomSeed:=: it has no value (leave it out, and the configuration decides)",
        "argument colour:=red: unknown (rosrun unit_tests runTest --help lists all)",
        "argument seed:=1: randomSeed is given twice (leave out all but one)"]


def test_every_value_that_is_not_allowed_is_named():
    assert faults(arguments.check, {"failureRate": "2", "monitorPort": "99999", "verboseMode": "yes",
                                    "use_real_speechEvent": "x", "recordDirectory": "none"}) == [
        "argument failureRate: failureRate cannot be \"2\" (allowed: a number from 0 to 1)",
        "argument verboseMode: verboseMode cannot be \"yes\" (allowed: true or false)",
        "argument monitorPort: monitorPort cannot be \"99999\" (allowed: a port from 1 to 65535, or 0)",
        "argument use_real_speechEvent: use_real_speechEvent cannot be \"x\" (allowed: true or false)",
        "argument recordDirectory: a test needs its record (leave it out, or name a folder for a copy)"]


@pytest.mark.parametrize("command, given", (
    (["python3", "/usr/bin/roslaunch", "unit_tests", "behaviorControllerTest.launch", "mision:=x", "__log:=y"],
     ["mision:=x"]),
    (["roslaunch", "-p", "11312", "/tmp/behaviorControllerTest.launch", "_seed:=1"], ["_seed:=1"]),
    (["roslaunch", "their_robot", "everything.launch", "mision:=x"], []),  # which may include ours
    ([], []),
))
def test_what_roslaunch_was_given_for_our_file(command, given):
    assert arguments.given_to_roslaunch(command) == given


@pytest.mark.parametrize("command, expected", (
    (["/usr/bin/python3", "/usr/bin/roslaunch", "unit_tests", "x.launch"], True), (["roslaunch", "x.launch"], True),
    (["bash"], False), (["vi", "notes", "roslaunch"], False), ([], False)))
def test_only_roslaunch_is_asked_to_end(command, expected):
    assert arguments.is_roslaunch(command) is expected


def test_the_controller_gets_its_own_keys_and_what_the_test_needs():
    test = configuration.load({"missionRuns": "2", "verboseMode": "true"})
    assert command_line(["behaviorController", "_language:=X", "_failureRate:=0", "_folder:=/f", "_missionRuns:=2",
                         "_recordDirectory:=/copy", "__name:=b"], test, "/f") == [
        "behaviorController", "__name:=b", "_startupTimeout:=30", "_language:=X", "_missionRuns:=2",
        "_recordDirectory:=/f", "_verboseMode:=true"]
    assert "_startupTimeout:=5" in command_line(["c", "_startupTimeout:=5"], test, "/f")
