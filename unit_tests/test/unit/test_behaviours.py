"""Tests of the verdict on visitors who never look back or answer unclearly."""
import pytest

from unit_tests.exhibits import Knowledge
from unit_tests.facts import Facts
from unit_tests.journal import Line
from unit_tests.verdict import judge

LEAVES = ("IsMutualGazeDiscovered", "IsYesNoUttered", "RetrieveListOfExhibits", "SelectExhibit", "Navigate")
SEEK = Line(101.5, "overtAttention", "/overtAttention/set_mode", 1, {"state": "seeking"})
DRIVE = Line(102.0, "robotNavigation", "/robotNavigation/set_goal", 1, {"goal_x": 1.0, "goal_y": 1.0})
SPEECH = Line(101.0, "textToSpeech", "/textToSpeech/say_text", 1, {"message": "Hello"})


def objections(behaviour, outcome, *lines, leaves=LEAVES):
    exit_code = 0 if outcome == "SUCCESS" else 3
    events = [{"event": "RunStarted", "time": 100.0, "mission": "x.xml", "leaves": [["p", leaf] for leaf in leaves]},
              {"event": "PassFinished", "time": 103.0, "number": 1, "outcome": outcome, "seconds": 3.0},
              {"event": "RunFinished", "time": 104.0, "outcome": "all passes are done", "exit_code": exit_code}]
    return list(judge(Facts(events, lines, exit_code, behaviour, 1, Knowledge((), None, None))).objections)


def test_a_pass_that_fails_for_want_of_a_gaze_is_as_it_should_be():
    assert objections("noGaze", "FAILURE", SPEECH, SEEK) == []


def test_a_gaze_that_was_never_returned_and_yet_found_is_wrong():
    found, = objections("noGaze", "SUCCESS", SPEECH, SEEK)
    assert found.startswith("pass 1 ended with SUCCESS; a visitor who never looks back should bring FAILURE")


def test_a_tour_for_somebody_who_never_looked_back_is_wrong():
    assert objections("noGaze", "FAILURE", SPEECH, SEEK, DRIVE) == [
        "pass 1: the robot was sent to 1 place without a visitor who wants a tour"]


def test_a_mission_that_seeks_no_gaze_has_to_succeed():
    assert objections("noGaze", "SUCCESS", SPEECH, leaves=("WelcomeSpeech",)) == []


@pytest.mark.parametrize("lines, number", (((SPEECH,), 0), ((SPEECH, DRIVE), 1)))
def test_an_unclear_answer_is_no_yes(lines, number):
    assert len(objections("unclear", "SUCCESS", *lines)) == number
