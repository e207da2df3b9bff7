"""Tests of the arguments of a test: each key of both configurations, and unknown words."""
import functools

import pytest

from behavior_controller import folders
from behavior_controller.config import config_file, settings
from behavior_controller.errors import ConfigurationError
from behavior_controller.simulation import configuration

from unit_tests.robot import options
from unit_tests.robot.options import Arguments
from unit_tests.run.controller import command_line

parse = functools.partial(configuration.parse, names=options.NAMES, lists_all=options.HELP)


def faults(call, given):
    with pytest.raises(ConfigurationError) as raised:
        call(given)
    return [str(fault) for fault in raised.value.faults]


def controller_words(*command, **given):
    """Return the command line of the controller in a test that was given these keys."""
    arguments = Arguments(["startController", *command], dict(given, folder="/folder"))
    return command_line(options.Options(arguments, options.load_test(given), None))


def check(given):
    options.read(Arguments([], given))


def test_every_key_has_its_meaning_its_range_and_its_default_in_the_help(monkeypatch):
    monkeypatch.setenv("COLUMNS", "1000")
    usage = options.usage("a remark").splitlines()
    # the test's own meaning counts where both have the key
    for key in {each.name: each
                for each in settings.KEYS + configuration.KEYS + options.OWN}.values():
        place, = [number for number, line in enumerate(usage) if line.split()[:1] == [key.name]]
        told = usage[place + 1].strip()
        assert told.startswith("{} ({}; ".format(key.plain_meaning, key.read.allowed))
        assert key.default_text + ")" in told
        assert told.endswith(")") == (key.name not in ("arrivalRate", "recordDirectory"))


def test_the_help_tells_what_is_required_and_what_is_simulated_by_default(monkeypatch):
    monkeypatch.setenv("COLUMNS", "1000")
    usage = options.usage()
    assert "messages per minute on each topic, on average; 1 or more, inf allowed (" in usage
    assert "; required)" in usage and "default required" not in usage
    assert ("  use_real_faceDetection     false\n      the real faceDetection is running; it is "
            "not "
            "simulated (" \
           "true or false; default false)\n" in usage)


def test_the_help_fits_the_terminal(monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    assert max(map(len, options.usage().splitlines())) <= 80


def test_what_is_not_for_users_is_refused():
    for name in options.INTERNAL:
        assert "unknown" in faults(parse, [name + ":=x"])[0]
        assert configuration.parse([name + ":=x"], [name], "") == {name: "x"}


LEGAL = ("Kinyarwanda", "false", "true", "2", "1", "release-1.0", "yes", "all", "silent", "crash",
         "action", "textToSpeech:1:crash", "/speechEvent/set_enabled", "/textToSpeech/say_text",
         "real", "operator", "textToSpeech")
"""Words: each key accepts at least one of them that is not its default."""


@pytest.mark.slow
@pytest.mark.parametrize("key", {
    each.name: each for each in settings.KEYS + configuration.KEYS + options.OWN
}.values(), ids=lambda key: key.name)
def test_every_key_can_be_given_and_arrives(key):
    text, value = next(found for found in map(functools.partial(read_by, key), LEGAL)
                       if found is not None)
    robot = {"robotInterface": "release-1.1"} if key.name in (
        "recogniseBy", "absentServices", "absentActions", "tabletSuccessIs",
        "use_real_robotLocalization") else {}
    given = dict(robot, **parse(["{}:={}".format(key.name, text)]))
    check(given)
    if key.name in options.TEST:
        assert config_file.values_of(options.load_test(given))[key.name] == value
    elif key.name in configuration.CONTROLLER:
        assert configuration.load_controller(given).values[key.name] == value
    if key.name in configuration.CONTROLLER:  # as the controller's own process reads it
        words = controller_words("behaviorController", **given)
        arrived = settings.load(folders.config(settings.FILE_NAME), {},
                                settings.split_arguments(words)[1])
        assert arrived.values[key.name] == ("/folder" if key.name == "recordDirectory" else value)


def read_by(key, text):
    """Return a text and its value for a key; None if the key refuses it, or it is the default."""
    try:
        value = key.read(text)
    except ValueError:
        return None
    return None if value == key.default else (text, value)


def test_short_names_are_those_of_keys():
    assert parse(["mission:=museum", "scenario:=silent", "seed:=3", "verbose:=true"]) == {
        "scenarioSpecification": "museum", "visitorBehaviour": "silent", "randomSeed": "3",
        "verboseMode": "true"}


def test_every_word_that_is_not_understood_is_named():
    assert faults(parse, [
        "failurRate:=0.9", "mision:=museum", "_failureRate:=1", "failureRate=1", "randomSeed:=",
        "colour:=red", "seed:=1"]) == [
        "argument failurRate:=0.9: unknown (did you mean failureRate?)",
        "argument mision:=museum: unknown (did you mean mission?)",
        "argument _failureRate:=1: unknown (did you mean failureRate?)",
        "argument failureRate=1: this is not of the form name:=value (rosrun unit_tests "
        "runTest --help lists all)",
        "argument randomSeed:=: it has no value (leave it out, and the configuration decides)",
        "argument colour:=red: unknown (rosrun unit_tests runTest --help lists all)",
        "argument seed:=1: randomSeed is given twice (leave out all but one)"]


def test_a_simulated_node_names_each_word_that_it_does_not_read():
    options.check_words(Arguments(["textToSpeech", "/say:=/tell", "__name:=speech"], {}))
    told = faults(options.check_words,
                  Arguments(["textToSpeech", "failureRate:=0", "/say:=/tell", "--verbose"], {}))
    assert [fault.partition(": ")[0] for fault in told] == [
        "argument failureRate:=0", "argument --verbose"]


def test_every_value_that_is_not_allowed_is_named():
    told = faults(check, {
        "failureRate": "2", "monitorPort": "99999", "verboseMode": "yes",
        "use_real_speechEvent": "x", "recordDirectory": "none"})
    assert [fault.partition(":")[0] for fault in told] == [
        "argument failureRate", "argument verboseMode", "argument monitorPort",
        "argument use_real_speechEvent", "argument recordDirectory"]
    assert all(value in fault for value, fault in zip(('"2"', '"yes"', '"99999"', '"x"'), told))


def test_a_language_without_phrases_is_named_beside_a_value_that_is_not_allowed():
    told = faults(check, {"failureRate": "2", "language": "Klingon"})
    assert [fault.partition(":")[0] for fault in told] == ["argument failureRate", "language"]
    assert "Klingon" in told[1]


def test_what_only_another_robot_has_is_named_with_its_place(monkeypatch, tmp_path):
    given = {"recogniseBy": "action", "absentServices": "/speechEvent/set_enabled"}
    told = ["recogniseBy: the robot D5.4.3 recognises speech by no action "
            "(leave it out, or choose another robotInterface)",
            "absentServices: the robot D5.4.3 does not have /speechEvent/set_enabled anyway "
            "(leave it out, or choose another robotInterface)"]
    assert faults(check, given) == ["argument " + line for line in told]
    check(dict(given, robotInterface="release-1.0"))
    file = tmp_path / "test.ini"
    file.write_text("arrivalRate inf\nverboseMode false\n" + "".join(
        "{} {}\n".format(*pair) for pair in given.items()))
    monkeypatch.setattr(options, "path", lambda: str(file))
    assert faults(check, {}) == ["{}: {}".format(file, line) for line in told]


@pytest.mark.parametrize("given, told", [
    ({"plannedFaults": "robotLocalization:1, robotLocalization:2:crash, textToSpeech:1"},
     "plannedFaults: the robot D5.4.3 has no service of robotLocalization (leave it out, or choose "
     "another robotInterface)"),
    ({"plannedFaults": "speechEvent:1"},
     "plannedFaults: the robot D5.4.3 has no service of speechEvent (leave it out, or choose "
     "another robotInterface)"),
    ({"quickNodes": "speechEvent"},
     "quickNodes: the robot D5.4.3 has no service of speechEvent (leave it out, or choose another "
     "robotInterface)"),
    ({"use_real_robotLocalization": "true"},
     "use_real_robotLocalization: the robot D5.4.3 does not have robotLocalization anyway (leave "
     "it out, or choose another robotInterface)")])
def test_a_node_that_only_another_robot_has_is_named(given, told):
    assert faults(check, given) == ["argument " + told]
    check(dict(given, robotInterface="release-1.0"))


@pytest.mark.parametrize("key, value, node", [
    ("plannedFaults", "textToSpeech:1", "textToSpeech"),
    ("quickNodes", "textToSpeech", "textToSpeech"),
    ("absentActions", "/textToSpeech/say_text", "textToSpeech"),
    ("recogniseBy", "idleAction", "speechEvent")])
def test_a_node_that_is_real_is_not_made_to_behave_otherwise(key, value, node):
    given = {key: value, "robotInterface": "release-1.1"}
    real = {"use_real_" + node: "true"}
    assert faults(check, {**given, **real}) == [
        f"argument {key}: {node} is real, and not simulated (leave it out, or use_real_{node})"]
    check(given)
    check(dict(real, robotInterface="release-1.1"))


@pytest.mark.parametrize("robot", ["D5.4.3", "release-1.0"])
def test_a_robot_without_an_action_cannot_lack_it(robot):
    given = {"robotInterface": robot, "absentActions": "/textToSpeech/say_text"}
    told, = faults(check, given)
    assert f"the robot {robot} does not have /textToSpeech/say_text anyway" in told
    check(dict(given, robotInterface="release-1.1"))


def test_the_controller_gets_its_own_keys_and_what_the_test_needs():
    given = {"missionRuns": "2", "verboseMode": "true"}
    words = controller_words("behaviorController", "__name:=b", language="X", failureRate="0",
                             recordDirectory="/copy", **given)
    assert words[:2] == ["behaviorController", "__name:=b"]
    assert sorted(words[2:]) == ["_language:=X", "_missionRuns:=2", "_recordDirectory:=/folder",
                                 "_startupTimeout:=30", "_verboseMode:=true"]
    assert "_startupTimeout:=5" in controller_words("c", startupTimeout="5")
