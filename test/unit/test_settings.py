"""The configuration: every fault in one pass, each with its line, what is allowed, and a
suggestion."""
import dataclasses
import os
import re
import time

import pytest

from behavior_controller import folders, leaves
from behavior_controller.config import config_file, phrases, recovery_policy, settings
from behavior_controller.errors import ConfigurationError
from behavior_controller.robot.d543 import INTERFACE
from behavior_controller.robot.requests import GoTo, Say

GOOD = "scenarioSpecification lab_tour\nverboseMode false\nasrEnabled true\n"


def load(tmp_path, text, *overrides):
    path = tmp_path / "test.ini"
    path.write_text(text, encoding="utf-8")
    return settings.load(str(path), *overrides)


def faults(tmp_path, text, *overrides):
    with pytest.raises(ConfigurationError) as raised:
        load(tmp_path, text, *overrides)
    return [str(fault).replace(str(tmp_path) + "/", "") for fault in raised.value.faults]


def test_the_delivered_file_is_right_and_shows_every_default():
    delivered = settings.load(folders.config("behaviorControllerConfiguration.ini"))
    assert delivered.values == settings.defaults().values
    with open(folders.config("behaviorControllerConfiguration.ini"), encoding="utf-8") as file:
        words = {line.split()[0] for line in file if line.strip() and not line.startswith("#")}
    assert words == {key.name for key in settings.KEYS}


def test_the_documents_defaults(tmp_path):
    found = load(tmp_path, GOOD)
    # contract sections 3 to 7
    assert (found.language, found.topic_max_age, found.condition_wait) == ("English", 2.0, 0.0)
    assert found.mutual_gaze_value == 1
    assert (found.welcome_gesture_id, found.goodbye_gesture_id, found.gesture_duration) == (1, 3,
                                                                                            3000)
    assert (found.mission_runs, found.startup_timeout) == (0, 0.0)


def test_a_mistake_in_one_key_leaves_the_values_of_the_others(tmp_path):
    path = tmp_path / "test.ini"
    path.write_text(GOOD + "missionRuns 3\nmonitorPort many\ntopicMaxAge 4\n", encoding="utf-8")
    values = settings.valid_values(str(path), {"missionRuns": 5}, {})
    given = {"missionRuns": 5, "topicMaxAge": 4.0}
    assert values == {**settings.defaults().values, **given}


@pytest.mark.parametrize("line, name, value", [
    ("missionRuns 3", "mission_runs", 3),
    ("missionRuns=3", "mission_runs", 3),
    ("  missionRuns\t= 3   # three visitors", "mission_runs", 3),
    ("startupTimeout 2.5", "startup_timeout", 2.5),
    ("language Kinyarwanda", "language", "Kinyarwanda"),
    ("recordDirectory /tmp/a b", "record_directory", "/tmp/a b"),
    ("recordDirectory", "record_directory", "")])
def test_ways_to_write_a_line(tmp_path, line, name, value):
    assert getattr(load(tmp_path, GOOD + line + "\n"), name) == value


@pytest.mark.parametrize("text, expected", [("TRUE", True), ("True", True), ("false", False),
                                            ("FALSE", False)])
def test_booleans_in_any_case(tmp_path, text, expected):
    assert load(tmp_path, GOOD.replace("true", text)).asr_enabled is expected


@pytest.mark.parametrize("value, expected", [("lab_tour.xml", "lab_tour"), ("my tour", "my tour")])
def test_the_mission_with_an_extension_is_tolerated(tmp_path, value, expected):
    assert load(tmp_path, GOOD.replace("lab_tour", value)).scenario_specification == expected


@pytest.mark.parametrize("line, expected", [
    ("asrEnable true", "test.ini:4:1: unknown key asrEnable (did you mean asrEnabled?)"),
    ("asrEnabled false", "test.ini:4:1: the key asrEnabled is in line 3 already"),
    ("missionRuns many", "test.ini:4:13: missionRuns cannot be \"many\" (allowed: a whole number "
                         "from 0 to 1000000000)"),
    ("missionRuns -1",
     "test.ini:4:13: missionRuns cannot be \"-1\" (allowed: a whole number from 0 to 1000000000)"),
    ("startupTimeout nan", "test.ini:4:16: startupTimeout cannot be \"nan\" (allowed: a number of "
                           "seconds from 0 to 86400)"),
    ("startupTimeout inf", "test.ini:4:16: startupTimeout cannot be \"inf\" (allowed: a number of "
                           "seconds from 0 to 86400)"),
    ("mutualGazeValue 3", "test.ini:4:17: mutualGazeValue cannot be \"3\" (allowed: 1 or 2)"),
    ("welcomeGestureId 256",
     "test.ini:4:18: welcomeGestureId cannot be \"256\" (allowed: a whole number from 0 to 255)"),
    ("  = 5", "test.ini:4:3: this is not a line of the form: key value"),
    ("language",
     "test.ini:4:1: language cannot be empty (allowed: the name of a language, such as English)")])
def test_one_fault_each(tmp_path, line, expected):
    assert faults(tmp_path, GOOD + line + "\n") == [expected]


@pytest.mark.parametrize("key", ["groot2Address", "monitorAddress"])
@pytest.mark.parametrize("value", [
    "", "*", "a b", "0", "0x0", "0x7f.1", "127.0.0", "1.2.3.256", "-a", "a..b", "a/b", "a:80",
    "http://a", "[::1]", "::1::", "a" * 64, ("b" * 63 + ".") * 3 + "b" * 62, "\u0661", "."])
def test_what_is_no_address_is_a_fault(tmp_path, key, value):
    found = faults(tmp_path, GOOD + "{} {}\n".format(key, value))
    assert len(found) == 1 and "{} cannot be {}".format(
        key, "\"{}\"".format(value) if value else "empty") in found[0]
    assert "allowed: an address or a host name of this computer" in found[0]


@pytest.mark.parametrize(
    "value",
    [
        "127.0.0.1",
        "0.0.0.0",
        "192.168.1.7",
        "::1",
        "::",
        "localhost",
        "pepper.local",
        "robot_2",
        "3com.com",
        # 253 characters, the longest name
        ("b" * 63 + ".") * 3 + "b" * 61])
def test_addresses_and_host_names(tmp_path, value):
    assert load(tmp_path, GOOD + "monitorAddress {}\n".format(value)).monitor_address == value


@pytest.mark.parametrize("value", ["yes", "1", "0", "on", "tru"])
def test_nothing_else_is_a_boolean(tmp_path, value):
    assert faults(tmp_path, GOOD.replace("true", value)) == [
        "test.ini:3:12: asrEnabled cannot be \"{}\" (allowed: true or false)".format(value)]


@pytest.mark.parametrize("value", ["../lab_tour", "data/lab_tour", "a\\b"])
def test_a_mission_is_no_path(tmp_path, value):
    assert "scenarioSpecification cannot be" in faults(tmp_path, GOOD.replace("lab_tour", value))[0]


@pytest.mark.parametrize("line", [
    "startupTimeout 1_0", "startupTimeout 1e999", "startupTimeout \u0661", "startupTimeout 0x10",
    "missionRuns 1_0", "missionRuns \u0661", "missionRuns 1.0"])
def test_numbers_are_written_plainly(tmp_path, line):
    name, text = line.split()
    assert faults(tmp_path, GOOD + line + "\n")[0].split(" (")[0].endswith(
        "{} cannot be \"{}\"".format(name, text))


@pytest.mark.parametrize("text, value", [("1e1", 10.0), (".5", 0.5), ("+2", 2.0), ("3.", 3.0)])
def test_ways_to_write_a_number(tmp_path, text, value):
    assert load(tmp_path, GOOD + "startupTimeout {}\n".format(text)).startup_timeout == value


def test_only_who_allows_it_takes_infinity():
    assert config_file.number(1.0, infinite=True)("inf") == float("inf")
    with pytest.raises(ValueError):
        config_file.number(1.0)("inf")
    with pytest.raises(ValueError):
        config_file.number(1.0, infinite=True)("-inf")


def test_a_byte_order_mark_and_foreign_line_ends_are_tolerated(tmp_path):
    assert load(tmp_path,
                "\ufeff" + GOOD.replace("\n", "\r\n")).scenario_specification == "lab_tour"


def test_settings_are_frozen():
    found = settings.defaults()
    with pytest.raises(AttributeError):
        found.asr_enabled = False
    with pytest.raises(TypeError):
        found.deadlines["textToSpeechDeadline"] = 1.0
    found.values["asrEnabled"] = False
    assert found.asr_enabled is found.values["asrEnabled"] is True


def test_all_faults_come_at_once(tmp_path):
    found = faults(tmp_path, "verboseMode maybe\nnonsense 1\nmissionRuns x\n")
    assert len(found) == 5
    assert [fault for fault in found if "required key" in fault] == [
        "test.ini: the required key scenarioSpecification is missing (add a line: "
        "scenarioSpecification <the name of a mission in the data folder, without .xml>)",
        "test.ini: the required key asrEnabled is missing (add a line: asrEnabled <true or false>)"]


@pytest.mark.parametrize("line", [
    "{0}{0}x{0}x", "language{0}x{0}x", "language{0}={0}x{0}x#", "language x{0}#{0}#{0}", "{0}="])
def test_a_line_of_blanks_takes_no_time(tmp_path, line):
    path = tmp_path / "test.ini"
    path.write_text(GOOD + line.format(" " * 200_000) + "\n")
    began = time.thread_time()
    try:
        settings.load(str(path))
    except ConfigurationError:
        pass
    assert time.thread_time() - began < 2.0  # a quadratic pattern takes minutes


def test_a_file_of_mistakes_is_told_as_far_as_a_person_reads_it(tmp_path):
    assert len(faults(tmp_path, GOOD + "nsense 1\n" * 100)) == 100
    found = faults(tmp_path, "no" * 20 + "nsense 1\n" * 30_000)
    assert len(found) == 101 and found[
        100] == "test.ini:101:1: more than 100 mistakes; the rest is not read"
    assert found[99].startswith("test.ini:100:1: unknown key nsense (")


@pytest.mark.parametrize(
    "reads", [settings.load, lambda path: recovery_policy.load(path, leaves.mission_specs())])
def test_only_a_file_of_text_is_read_and_not_for_ever(tmp_path, reads):
    os.mkfifo(str(tmp_path / "fifo.ini"))
    (tmp_path / "large.ini").write_text("#" * 1_000_001)
    (tmp_path / "largest.ini").write_text("#" * 1_000_000)
    for path, reason in (("fifo.ini", "it is not a regular file"), ("/dev/zero",
                                                                    "it is not a regular file"),
                         ("large.ini", "it has 1000001 bytes; at most 1000000 are read"),
                         ("largest.ini", "missing")):
        with pytest.raises(ConfigurationError, match=reason):
            reads(str(tmp_path / path))


@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16"])
def test_a_policy_is_read_as_the_configuration_is(tmp_path, encoding):
    with open(folders.config("recoveryPolicy.ini"), encoding="utf-8") as file:
        text = file.read()
    (tmp_path / "policy.ini").write_bytes(text.replace("\n", "\r\n").encode(encoding))
    expected = recovery_policy.load(folders.config("recoveryPolicy.ini"), leaves.mission_specs())
    found = recovery_policy.load(str(tmp_path / "policy.ini"), leaves.mission_specs())
    assert found == dataclasses.replace(expected, source=found.source) and found.source.text == text


def test_a_fault_is_one_line_whatever_the_file_says(tmp_path):
    fault, = faults(tmp_path, GOOD + "language \x1b[31m/\u202e{}\n".format("x" * 5000))
    assert fault.startswith('test.ini:4:10: language cannot be "\\x1b[31m/\\u202exxx') and len(
        fault) < 1200
    assert fault.endswith("(allowed: the name of a language, such as English)")


def test_a_file_that_is_not_there_and_one_that_is_not_text(tmp_path):
    with pytest.raises(
            ConfigurationError,
            match="none.ini: the configuration cannot be read: No such file or directory$"):
        settings.load(str(tmp_path / "none.ini"))
    (tmp_path / "binary.ini").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(ConfigurationError, match="not UTF-8"):
        settings.load(str(tmp_path / "binary.ini"))


def test_parameters_override_the_file(tmp_path):
    found = load(tmp_path, GOOD,
                 {"asrEnabled": False, "missionRuns": 2, "scenarioSpecification": "other"})
    assert (found.asr_enabled, found.mission_runs, found.scenario_specification) == (False, 2,
                                                                                     "other")


def test_a_parameter_may_give_a_required_key(tmp_path):
    assert load(tmp_path, "verboseMode false\nasrEnabled true\n",
                {"scenarioSpecification": "x"}).asr_enabled is True


def test_faults_of_parameters_name_the_parameter(tmp_path):
    assert faults(tmp_path, GOOD, {"asrEnabled": "perhaps", "misionRuns": 1}) == [
        "parameter ~asrEnabled: asrEnabled cannot be \"perhaps\" (allowed: true or false)",
        "parameter ~misionRuns: unknown key misionRuns (did you mean missionRuns?)"]


@pytest.mark.parametrize("value", [None, [1], {"a": 1}, b"x", object()])
def test_a_parameter_of_an_odd_type_is_one_fault(tmp_path, value):
    found = faults(tmp_path, GOOD, {"language": value, "recordDirectory": value})
    assert found == ["parameter ~{}: {} cannot be of type {} (allowed: {})".format(
                         name, name, type(value).__name__, allowed)
                     for name, allowed in (("language", "the name of a language, such as English"),
                                           ("recordDirectory", "a folder, nothing, or none"))]


def test_the_settings_of_a_record_are_checked():
    assert settings.recorded(dict(settings.defaults().values),
                             "r").values == settings.defaults().values
    with pytest.raises(ConfigurationError) as raised:
        settings.recorded(
            dict(settings.defaults().values, topicMaxAge="x", asrEnabled=None, oldKey=1), "r")
    assert sorted(str(fault).split(" (")[0] for fault in raised.value.faults) == [
        "r: asrEnabled cannot be of type NoneType", "r: topicMaxAge cannot be \"x\"",
        "r: unknown key oldKey"]


def test_arguments_override_parameters_and_the_file(tmp_path):
    found = load(tmp_path, GOOD, {"missionRuns": 2, "startupTimeout": 4},
                 {"missionRuns": "3", "asrEnabled": "false"})
    assert (found.mission_runs, found.startup_timeout, found.asr_enabled) == (3, 4.0, False)


def test_no_argument_is_ignored(tmp_path):
    assert faults(tmp_path, GOOD, {}, {"asrEnabled": "", "misionRuns": "1", "colour": "red"}) == [
        "argument asrEnabled: asrEnabled cannot be empty (allowed: true or false)",
        "argument misionRuns: unknown key misionRuns (did you mean missionRuns?)",
        "argument colour: unknown key colour (the keys: {})".format(", ".join(
            key.name for key in settings.KEYS))]


def test_arguments_are_kept_from_rospy():
    given = ["node", "_asrEnabled:=false", "__name:=n", "/a:=/b", "_recordDirectory:=/tmp/a:=b",
             "_language:=", "--help"]
    assert settings.split_arguments(given) == (["node", "__name:=n", "/a:=/b", "--help"], {
        "asrEnabled": "false", "recordDirectory": "/tmp/a:=b", "language": ""})


def test_a_robot_of_release_1_0_has_a_gaze_value_of_its_own():
    robots = [settings.defaults(mutualGazeValue=1, robotInterface=robot) for robot in (
        "D5.4.3", "release-1.0")]
    assert [robot.gaze_value for robot in robots] == [1, 2]


def test_each_service_has_its_deadline(tmp_path):
    found = load(tmp_path, GOOD + "robotNavigationDeadline 42\n")
    assert found.deadline(INTERFACE.service(GoTo)) == 42.0
    assert found.deadline(INTERFACE.service(Say)) == 60.0


# ---------------------------------------------------------------- what is said of a key is so, once


ALL_KEYS = settings.KEYS + phrases.PHRASE_KEYS
LIMITS = re.compile(r"from ([0-9.]+) to ([0-9.]+)|^([0-9]+) or ([0-9]+)$")


@pytest.mark.parametrize("key", [key for key in ALL_KEYS if LIMITS.search(key.read.allowed)],
                         ids=lambda key: key.name)
def test_a_key_takes_just_the_numbers_that_it_says(key):
    low, high = [text for text in LIMITS.search(key.read.allowed).groups() if text]
    assert [key.read(text) for text in (low, high)] == [float(low), float(high)]
    step = 0.0001 if key.read.allowed.startswith("a number") else 1
    if "port" in key.read.allowed:
        assert key.read("0") == 0
        low = "0"
    for outside in (float(low) - step, float(high) + step):
        with pytest.raises(ValueError):
            key.read("{:.10g}".format(outside))


@pytest.mark.parametrize("key",
                         [key for key in ALL_KEYS if key.default not in (config_file.REQUIRED, ())],
                         ids=lambda key: key.name)
def test_each_default_is_a_value_that_its_key_takes(key):
    assert key.read(config_file.to_text(key.default)) == key.default
