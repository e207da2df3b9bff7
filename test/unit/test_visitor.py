"""Tests of the visitor: what sensors see and hear, after the robot's requests."""
import re

import pytest

from behavior_controller.config import phrases
from behavior_controller.robot.requests import Exhibit, Location, Point

from behavior_controller.simulation.journal import JournalEntry
from behavior_controller.simulation.visitor import (
    BEHAVIOURS, DECLINES, ENGAGES, GAZE_FAILED, GAZE_VALUES, LEAVES, MUTUAL_GAZE, Manners,
    NOTHING_HEARD, NO_GAZE, SILENT, SMALL_TALK, STILL_SEEKING, UNCLEAR, UNCLEAR_ANSWER, Visitor)

HOME = (0.0, 0.0)


def visitor(behaviour=ENGAGES):
    return Visitor(Manners(behaviour, ("A tour?", "Yes or no?"), "Yes", "No", HOME))


def line(node, fault=None, **content):
    return JournalEntry(0.0, node, "/" + node, 1, content, fault)


def attention(state, fault=None):
    return line("overtAttention", fault, state=state)


def say(text, fault=None):
    return line("textToSpeech", fault, message=text)


def drive(x, y, fault=None):
    return line("robotNavigation", fault, goal_x=x, goal_y=y, goal_theta=0.0)


def after(behaviour, *lines):
    person = visitor(behaviour)
    for each in lines:
        person.notice(each)
    return person


# --------------------------------------------------------------------------------- coming and going


@pytest.mark.parametrize("behaviour", BEHAVIOURS)
def test_nobody_is_there_before_the_robot_wakes_up(behaviour):
    person = visitor(behaviour)
    assert (person.is_here, person.utterance(), person.press(["Oui", "Non"]),
            person.gaze()) == (False, "", "", GAZE_FAILED)
    assert after(behaviour, attention("scanning")).is_here


def test_a_visitor_comes_to_a_robot_that_does_not_scan_too():
    person = after(ENGAGES, say("Hello"))
    assert person.is_here and person.gaze() == STILL_SEEKING


@pytest.mark.parametrize("state, is_here", (("enabled", True), ("disabled", False)))
def test_the_next_visitor_comes_to_a_robot_that_stirs(state, is_here):
    person = after(ENGAGES, attention("scanning"), drive(*HOME), line("animateBehavior",
                                                                      state=state))
    assert person.is_here is is_here


def test_messages_on_topics_wake_nobody():
    assert not after(ENGAGES, JournalEntry(
        0.0, "faceDetection", "/faceDetection/data", 0, {"face_label_id": []})).is_here


def test_a_visitor_comes_even_if_the_scanning_failed():
    assert after(ENGAGES, attention("scanning", "refused")).is_here


def test_the_visitor_is_gone_when_the_robot_drives_home_and_the_next_one_comes():
    person = after(ENGAGES, attention("scanning"), drive(1, 1), drive(*HOME))
    assert not person.is_here
    person.notice(attention("scanning"))
    assert person.is_here


def told(at):
    return JournalEntry(at, "faceDetection", "/faceDetection/data", 0, {})


@pytest.mark.parametrize("seconds, is_here", ((299.0, False), (301.0, True)))
def test_the_next_visitor_comes_after_a_long_wait(seconds, is_here):
    assert after(ENGAGES, attention("scanning"), drive(*HOME), told(seconds)).is_here is is_here


def test_a_visitor_who_is_there_answers_after_a_long_wait():
    assert after(ENGAGES, say("A tour?"), told(301.0)).utterance() == "Yes"


def test_who_leaves_follows_to_two_exhibits():
    person = after(LEAVES, attention("scanning"), drive(1, 1), drive(2, 2))
    assert person.is_here
    person.notice(drive(3, 3))
    assert not person.is_here


def test_a_drive_that_fails_leads_nowhere():
    assert after(LEAVES, attention("scanning"), drive(1, 1), drive(2, 2), drive(3, 3,
                                                                                "refused")).is_here


def test_the_others_stay_to_the_end():
    assert after(ENGAGES, attention("scanning"), *(drive(x, 1) for x in range(1, 9))).is_here


# --------------------------------------------------------------------------------------------- gaze


def test_the_second_look_of_a_seeking_robot_is_returned():
    person = after(ENGAGES, attention("scanning"), attention("seeking"))
    assert [person.gaze() for _ in range(3)] == [STILL_SEEKING, MUTUAL_GAZE, MUTUAL_GAZE]
    person.notice(attention("seeking"))
    assert person.gaze() == STILL_SEEKING


def test_a_visitor_who_never_looks_back_is_seen_and_sought_without_result():
    person = after(NO_GAZE, attention("scanning"), attention("seeking"))
    assert person.is_here and not person.looks_back
    assert [person.gaze() for _ in range(100)] == 10 * [STILL_SEEKING] + 90 * [GAZE_FAILED]
    person.notice(attention("seeking"))
    assert person.gaze() == STILL_SEEKING


def test_nobody_returns_the_gaze_of_a_robot_that_was_left():
    person = after(LEAVES, attention("scanning"), drive(1, 1), drive(2, 2), drive(3, 3),
                   attention("seeking"))
    assert person.gaze() == GAZE_FAILED


def test_a_mode_that_was_refused_is_not_set():
    person = after(ENGAGES, attention("scanning"), attention("seeking", "refused"))
    assert person.attention == "scanning"


def test_gaze_values_are_those_of_the_two_conventions():
    # contract section 3: where 1 is mutual gaze, 2 and 3 are a sign of the other convention
    assert GAZE_VALUES[1][MUTUAL_GAZE] == 1
    assert {GAZE_VALUES[1][STILL_SEEKING], GAZE_VALUES[1][GAZE_FAILED]} & {1, 2, 3} == set()
    assert GAZE_VALUES[2] == {STILL_SEEKING: 1, MUTUAL_GAZE: 2, GAZE_FAILED: 3}


# ------------------------------------------------------------------------------------------ answers


@pytest.mark.parametrize("behaviour, spoken, pressed", (
    (ENGAGES, "Yes", "Oui"), (LEAVES, "Yes", "Oui"), (DECLINES, "No", "Non"), (SILENT, "", "")))
def test_answers(behaviour, spoken, pressed):
    person = after(behaviour, attention("scanning"), say("A tour?"))
    assert person.utterance() == spoken
    assert person.utterance() == spoken, "an answer is repeated until the robot goes on"
    assert person.press(["Oui", "Non"]) == pressed


def test_who_is_unclear_gives_no_answer_in_two_ways_in_turn():
    person = after(UNCLEAR, attention("scanning"))
    heard = []
    for _ in range(3):
        person.notice(say("A tour?"))
        heard += [person.utterance(), person.utterance()]
    assert heard == [UNCLEAR_ANSWER] * 2 + [NOTHING_HEARD] * 2 + [UNCLEAR_ANSWER] * 2
    assert person.press(["Oui", "Non"]) == "Non"


@pytest.mark.parametrize("lines", (
    [say("Hello")],
    [say("A tour?"), drive(1, 1)],
    [say("A tour?", "refused")],
    [say("A tour?"), say("Thank you")]))
def test_without_an_open_question_there_is_small_talk(lines):
    assert after(ENGAGES, *lines).utterance() == SMALL_TALK


@pytest.mark.parametrize(
    "call", (attention("social"), line("animateBehavior", state="disabled"),
             line("animateBehavior", state="enabled"), line(
                 "speechEvent", status="true"), line("tabletEvent", message="Yes|No")))
def test_a_robot_that_prepares_to_listen_does_not_go_on(call):
    assert after(DECLINES, say("A tour?"), call).utterance() == "No"


@pytest.mark.parametrize("seconds, at, heard", (
    (4.0, 13.9, ""), (4.0, 14.1, ""), (4.0, 15.0, "No"), (0.5, 10.7, ""), (0.5, 10.9, "No"),
    (0.0, 10.0, "No")))
def test_nobody_answers_before_the_robot_has_asked(seconds, at, heard):
    person = after(DECLINES, attention("scanning"),
                   say("A tour?")._replace(time=10.0, seconds=seconds), told(at))
    assert person.utterance() == heard


@pytest.mark.parametrize("words, heard", (
    ("A tour?", "No"), ("What now?", "No"), ("Tell me yes or no", "No"), ("What now", SMALL_TALK)))
def test_a_question_is_one_of_the_robots_or_ends_with_its_mark(words, heard):
    person = Visitor(Manners(DECLINES, ("A tour?", "Tell me yes or no"), "Yes", "No", HOME))
    person.notice(say(words))
    assert person.utterance() == heard


def test_a_question_may_be_put_again():
    assert after(DECLINES, say("A tour?"), say("Yes or no?")).utterance() == "No"
    assert after(DECLINES, say("A tour?"),
                 say("Yes or no?", "refused")).utterance() == "No", "the first one stands"


def test_the_robot_listens_until_it_switches_its_speech_recognition_off():
    person = visitor()
    heard = [person.is_listened_to]
    for fault, content in ((None, {"language": "English"}), ("refused", {"status": "false"}),
                           (None, {"status": "false"
                                   }), ("refused", {"status": "true"}), (None, {"status": "true"})):
        person.notice(line("speechEvent", fault, **content))
        heard.append(person.is_listened_to)
    assert heard == [True, True, True, False, False, True]


@pytest.mark.parametrize("language", phrases.languages())
def test_a_language_understands_its_visitors_as_they_are_meant(language):
    known = phrases.load(language)
    yes, no = known.tablet_options
    assert known.spoken_answer(yes) == known.pressed_answer(yes) == "yes"
    assert known.spoken_answer(no) == known.pressed_answer(no) == "no"
    assert known.spoken_answer(SMALL_TALK) is known.spoken_answer(NOTHING_HEARD) is None
    assert known.spoken_answer(UNCLEAR_ANSWER) is None


# ----------------------------------------------------------------------------------- what is wanted

PLACES = tuple(Exhibit(name, name + "?", "", Location(number, 1.0, 0.0), Point(0.0, 0.0, 0.0))
               for number, name in enumerate(("office", "hall", "library", "canteen")))


def at_reception(behaviour, *lines):
    questions = ["A way?", *(place.description1 for place in PLACES)]
    person = Visitor(Manners(behaviour, questions, "Yes", "No", HOME, PLACES))
    for each in lines:
        person.notice(each)
    return person


@pytest.mark.parametrize("behaviour, answers", [
    (ENGAGES, ["Yes", "No", "No", "Yes", "No"]), (LEAVES, ["Yes", "No", "No", "Yes", "No"]),
    (DECLINES, ["No"] * 5)])
def test_a_visitor_looks_for_the_third_of_the_places_that_the_robot_names(behaviour, answers):
    person = at_reception(behaviour)
    found = []
    for question in ["A way?", *(place.description1 for place in PLACES)]:
        person.notice(say(question))
        assert person.press(["Yes", "No"]) == person.utterance()
        found.append(person.utterance())
    assert found == answers


def test_a_place_that_was_not_heard_is_not_answered_to_and_the_next_visitor_knows_of_none():
    person = at_reception(ENGAGES, say("A way?"), say("office?", fault="refused"), say("A way?"))
    assert person.utterance() == "Yes"
    person.notice(say("office?"))
    for each in (drive(*HOME), attention("scanning"), say("A way?")):
        person.notice(each)
    assert person.utterance() == "Yes"


@pytest.mark.parametrize("behaviour, said, typed", [
    (ENGAGES, "Ana", "Ana"), (LEAVES, "Ana", "Ana"), (DECLINES, "No", ""),
    (UNCLEAR, UNCLEAR_ANSWER, ""), (SILENT, "", "")])
def test_a_question_of_another_package_has_its_own_answer(behaviour, said, typed):
    answers = [(re.compile("Whom, .+"), "Ana"), (re.compile("Do you mean .+"), "")]
    person = Visitor(Manners(behaviour, ("A tour?",), "Yes", "No", HOME, answers=answers))
    person.notice(attention("scanning"))
    person.notice(say("Whom, please"))
    assert (person.utterance(), person.press(["Type a name"])) == (said, typed)
    person.notice(say("Do you mean Ana"))  # and no question mark
    if behaviour in (ENGAGES, LEAVES):
        assert (person.utterance(), person.press(["Yes", "No"])) == ("Yes", "Yes")
    elif behaviour == DECLINES:
        assert (person.utterance(), person.press(["Yes", "No"])) == ("No", "No")


@pytest.mark.parametrize("named, is_here", [("office?", True), ("library?", False)])
def test_a_visitor_who_leaves_does_so_on_the_way_to_the_place_that_was_wanted(named, is_here):
    assert at_reception(LEAVES, say(named), drive(5.0, 5.0)).is_here is is_here
    assert at_reception(ENGAGES, say(named), drive(5.0, 5.0)).is_here
