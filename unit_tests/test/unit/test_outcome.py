"""Tests of the outcome of a visit by people's measures: each objection, and what just misses it.

The journal of a sound tour is changed in one place. A message counts for 2 s, and the judge
allows 1 s more.
"""
import pytest

from behavior_controller.simulation.configuration import IDLE_ACTION

from unit_tests.judge.execution import Execution
from unit_tests.judge.facts import Stall

from plays import UNIX, calls, facts, of_test_with

GOODBYE = "Thank you for your visit. Goodbye!"
SPINE = "Most parts are printed here within a day."  # the last part of the last exhibit
PEPPER = "This is Pepper, a robot like me. It has twenty joints and a tablet on its chest."


def told(of_test, journal):
    """Return the objections to the first visit of a test with this journal, as one text."""
    of_test = of_test._replace(journal=sorted(journal, key=lambda line: line.time))
    return "; ".join(Execution(of_test).outcomes()[0].objections())


def said(line, text):
    return line.node == "textToSpeech" and line.content.get("message") == text


def saying(of_test, text, time):
    """Return a line of the journal with that text, said then."""
    return calls(of_test, "textToSpeech")[0]._replace(time=time, content={"message": text})


def drives_of(of_test):
    return calls(of_test, "robotNavigation")


def without(of_test, *texts):
    return [line for line in of_test.journal if not any(said(line, text) for text in texts)]


def changed(of_test, old, **fields):
    return [line._replace(**fields) if line is old else line for line in of_test.journal]


@pytest.fixture(scope="module")
def tour():
    return facts()


@pytest.fixture(scope="module")
def leaving():
    return facts(visitor_behaviour="leaves")


def test_an_exhibit_is_described_where_the_robot_stands_before_it(tour):
    drive = drives_of(tour)[0]
    goal = {"goal_x": 9.0, "goal_y": 8.0, "goal_theta": 7.0}
    assert "Pepper was described where the robot stood at 9, 8, 7°" in told(
        tour, changed(tour, drive, content=goal))
    assert "was described where" not in told(tour, tour.journal)


@pytest.mark.parametrize("early, is_told", [(0.3, True), (0.2, False)])
def test_an_exhibit_is_described_after_the_drive_to_it(tour, early, is_told):
    """A drive may end 0.25 s early by the journal."""
    drive = drives_of(tour)[0]
    line = next(line for line in tour.journal if said(line, PEPPER))
    seconds = line.time - drive.time + early
    assert ("while the robot drove there" in told(
        tour, changed(tour, drive, seconds=seconds))) is is_told


@pytest.mark.parametrize("early, is_told", [(0.3, True), (0.2, False)])
@pytest.mark.parametrize("node, what", [("textToSpeech", f"said “{SPINE}”"),
                                        ("gestureExecution", "made a gesture")])
def test_the_robot_does_not_drive_away_from_what_it_says_or_shows(tour, node, what, early, is_told):
    drive = drives_of(tour)[5]
    line = [line for line in calls(tour, node) if line.time < drive.time
            and (node == "gestureExecution" or said(line, SPINE))][-1]
    seconds = drive.time - line.time + early
    assert ("drove away while it " + what in told(
        tour, changed(tour, line, seconds=seconds))) is is_told


def test_a_visitor_who_engages_is_shown_all_exhibits(tour):
    text = told(tour, without(tour, SPINE))
    assert "the visitor, who engages, was shown 5 of 5 exhibits in this order: Pepper" in text
    text = told(tour, tour.journal[:tour.journal.index(drives_of(tour)[0])])
    assert "was shown 0 of 5 exhibits in this order: none" in text


@pytest.mark.parametrize("more", [
    {"test": {"arrival_rate": 599.0}}, {"test": {"absent_services": ("/x",)}},
    {"test": {"absent_actions": ("/x",)}}, {"test": {"recognise_by": IDLE_ACTION}},
    {"real": frozenset({"textToSpeech"})}, {"stalls": (Stall(UNIX, UNIX + 1.1),)}], ids=str)
def test_a_tour_may_end_early_if_something_is_in_its_way(tour, more):
    more = dict(more, test=of_test_with(tour, **more.get("test", {})).test)
    assert told(tour._replace(**more), without(tour, SPINE)) == ""


@pytest.mark.parametrize("change, may_end", [
    ({"fault": "refused"}, True), ({"seconds": 59.1}, True), ({"seconds": 58.9}, False)], ids=str)
def test_a_call_that_fails_or_takes_too_long_ends_a_tour(tour, change, may_end):
    """Speech has 60 s, of which 1 s may be the judge's error."""
    last = calls(tour, "textToSpeech")[-3]
    text = told(tour, [line._replace(**change) if line is last else line
                       for line in without(tour, SPINE)])
    assert ("was shown 5 of 5" in text) is not may_end


def test_a_visitor_who_engages_is_told_goodbye(tour):
    objection = f"the visitor, who engages, was not told “{GOODBYE}”"
    assert objection in told(tour, without(tour, GOODBYE))
    assert objection not in told(tour, without(tour, "Here is the door."))


def test_a_visitor_who_engages_is_led_home(tour):
    assert "was shown 5 of 5 exhibits" in told(
        tour, [line for line in tour.journal if line is not drives_of(tour)[-1]])


def test_a_visitor_who_declines_is_shown_nothing_and_told_so(tour):
    declined = facts(visitor_behaviour="declines")
    begin = calls(declined, "textToSpeech")[-1].time
    drive = drives_of(tour)[0]._replace(time=begin)
    assert "the visitor, who declines, was shown driven to 2, 1, 90°" in told(
        declined, declined.journal + [drive])
    assert "the visitor, who declines, was shown Pepper" in told(
        declined, declined.journal + [drive, saying(declined, PEPPER, begin)])
    farewell = "That is all right. Maybe another time! Have a nice day."
    assert f"the visitor, who declines, was not told “{farewell}”" in told(
        declined, without(declined, farewell))
    assert "who declines" not in told(declined, declined.journal)


def gone_at(of_test):
    """Return when the sensor first saw that nobody is there any more."""
    return min(line.time for line in of_test.journal
               if line.node == "faceDetection" and not line.content["face_label_id"])


@pytest.mark.parametrize("text", [GOODBYE, PEPPER])
@pytest.mark.parametrize("seconds, is_told", [(3.1, True), (2.9, False)])
def test_nothing_is_said_to_a_visitor_who_is_known_to_have_left(leaving, text, seconds, is_told):
    late = saying(leaving, text, gone_at(leaving) + seconds)
    assert (f"“{text}” was said to a visitor who had left" in told(
        leaving, leaving.journal + [late])) is is_told


def test_a_visitor_who_comes_back_has_not_left(leaving):
    gone = gone_at(leaving)
    back = next(line for line in leaving.journal if line.node == "faceDetection")._replace(
        time=gone + 2.0)
    late = saying(leaving, GOODBYE, gone + 4.0)
    assert "who had left" not in told(leaving, leaving.journal + [back, late])


def test_a_call_that_failed_may_have_held_up_the_goodbye(leaving):
    gone = gone_at(leaving)
    late = saying(leaving, GOODBYE, gone + 4.0)
    failed = calls(leaving, "overtAttention")[0]._replace(time=gone + 1.0, fault="refused")
    assert "who had left" not in told(leaving, leaving.journal + [failed, late])


def test_a_visitor_who_leaves_is_not_shown_all(tour):
    stayed = tour._replace(test=facts(visitor_behaviour="leaves").test)
    assert "the visitor, who leaves, was there to the end" in told(stayed, tour.journal)


# ------------------------------------------------------------------------------------- a reception

ASKED, WAY = "Are you looking for the {}?", (
    "Turn right behind the lecture hall: the library is at the end of the corridor.")


@pytest.fixture(scope="module")
def reception():
    return facts(mission=(("scenarioSpecification", "reception"),))


def test_the_way_is_told_to_the_place_that_was_asked_about_last(reception):
    objection = "the way to Library was told to a visitor who was "
    last, before = ASKED.format("library"), ASKED.format("lecture hall")
    assert objection + "asked about Lecture hall" in told(reception, without(reception, last))
    office = ASKED.format("secretary's office")
    assert objection + "not asked" in told(reception, without(reception, last, before, office))
    assert told(of_test_with(reception, arrival_rate=1.0), without(reception, last)) == ""


def test_a_reception_ends_when_the_way_was_told_and_the_robot_is_home(reception):
    objection = "the visitor, who engages, was told the way to {}, looks for Library, and the last "
    assert objection.format("no place") + "drive led to 0, 0, 0°" in told(
        reception, without(reception, WAY))
    there, home = drives_of(reception)
    assert objection.format("Library") + "drive led to 7, -4, 270°" in told(
        reception, [line for line in reception.journal if line is not home])
    stays = [line for line in reception.journal if line not in (there, home)]
    assert told(reception, stays) == ""
