"""Tests of the configuration of the simulated robot."""
import math

import pytest

from behavior_controller.errors import ConfigurationError
from behavior_controller.config.config_file import REQUIRED, values_of
from behavior_controller.simulation import configuration
from behavior_controller.simulation.faults import PlannedFault

from unit_tests import folders
from unit_tests.robot import options


def test_the_file_that_comes_with_the_package_shows_the_defaults():
    found = options.load_test({})
    defaults = {key.name: key.default for key in configuration.KEYS}
    assert found.failure_rate == 0.1  # document, table 5
    assert found.arrival_rate == 60
    assert (found.visitor_behaviour, found.mission_runs, found.random_seed) == ("engages", 1, None)
    assert {name: value for name, value in values_of(found).items()
            if defaults[name] not in (REQUIRED, value)} == {}


@pytest.mark.parametrize("given, field, value", (
    ({"failureRate": "0"}, "failure_rate", 0),
    ({"failureRate": "1"}, "failure_rate", 1),
    ({"arrivalRate": "inf"}, "arrival_rate", math.inf),
    ({"arrivalRate": "1"}, "arrival_rate", 1),
    ({"verboseMode": "True"}, "verbose_mode", True),
    ({"randomSeed": "7"}, "random_seed", 7),
    ({"randomSeed": ""}, "random_seed", None),
    ({"visitorBehaviour": "leaves"}, "visitor_behaviour", "leaves"),
    ({"visitorBehaviour": "complete"}, "visitor_behaviour", "engages"),
    ({"visitorBehaviour": "partial01"}, "visitor_behaviour", "noGaze"),
    ({"visitorBehaviour": "partial02"}, "visitor_behaviour", "silent"),
    ({"visitorBehaviour": "partial03"}, "visitor_behaviour", "declines"),
    ({"visitorBehaviour": "partial04"}, "visitor_behaviour", "leaves"),
    ({"faultKinds": "refused, exception"}, "fault_kinds", ("refused", "exception")),
    ({"plannedFaults": "robotNavigation:3,textToSpeech:1:unanswered"}, "planned_faults",
     (PlannedFault("robotNavigation", 3, "refused"), PlannedFault("textToSpeech", 1,
                                                                  "unanswered"))),
    ({"recogniseBy": "action"}, "recognise_by", "action"),
    ({"absentServices": "/speechEvent/set_enabled, /robotLocalization/set_pose"}, "absent_services",
     ("/speechEvent/set_enabled", "/robotLocalization/set_pose"))))
def test_arguments_override_the_file(given, field, value):
    assert getattr(options.load_test(given), field) == value


@pytest.mark.parametrize("given, message", (
    ({"failureRate": "1.1"}, "a number from 0 to 1"),
    ({"failureRate": "-0.1"}, "a number from 0 to 1"),
    ({"failureRate": "nan"}, "a number from 0 to 1"),
    ({"arrivalRate": "0.5"}, "1 or more, or inf"),
    ({"verboseMode": "yes"}, "true or false"),
    ({"visitorBehaviour": "shouts"
      }, "one of engages, silent, unclear, declines, leaves, noGaze, random, complete, "
     "partial01"),
    ({"missionRuns": "0"}, r"a whole number from 1 to 1000000\)"),
    ({"testTimeout": "0.5"}, r"seconds from 1 to 1000000\)"),
    ({"randomSeed": "1000000000"}, "from 0 to 999999999, or nothing"),
    ({"faultKinds": ""}, "some of refused, exception, unanswered"),
    ({"faultKinds": "slow"}, "some of refused, exception, unanswered"),
    ({"plannedFaults": "faceDetection:1"}, "node:call"),
    ({"recogniseBy": "service"}, "one of topic, action"),
    ({"absentServices": "/overtAttention/set_mode"
      }, "some of /gestureExecution/perform_gesture, /robotNavigation/set_goal"),
    ({"absentActions": "/speechEvent/set_enabled"
      }, "some of /gestureExecution/perform_gesture, /robotNavigation/set_goal"),
    ({"failureRat": "1"}, "failureRate")))
def test_what_is_not_allowed_is_said_with_what_is(given, message):
    with pytest.raises(ConfigurationError, match=message):
        options.load_test(given)


def test_without_the_file_a_message_comes_at_once_and_nothing_is_printed():
    made = configuration.defaults(missionRuns=2)
    assert (made.mission_runs, made.arrival_rate, made.verbose_mode) == (2, math.inf, False)


def test_an_installed_package_has_its_files_in_its_share_folder(tmp_path, monkeypatch):
    module = tmp_path / "lib" / "python3" / "dist-packages" / "unit_tests" / "folders.py"
    monkeypatch.setattr(folders, "__file__", str(module))
    for name in ("config", "data"):
        (tmp_path / "share" / "unit_tests" / name).mkdir(parents=True)
    assert folders.share() == str(tmp_path / "share" / "unit_tests")


@pytest.mark.parametrize("given, expected", [
    ({}, True), ({"missionRuns": 3}, True), ({"missionRuns": 4}, False),
    ({"missionRuns": 4, "testTimeout": 1200.0}, True), ({"callTimes": "none"}, False),
    ({"callTimes": "real", "missionRuns": 100}, True)])
def test_calls_take_time_where_the_test_has_it(given, expected):
    assert configuration.defaults(**given).takes_time is expected
