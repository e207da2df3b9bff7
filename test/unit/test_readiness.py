"""The list that is read before a demonstration: it says no more than what is known."""
import dataclasses

import pytest

from behavior_controller import folders
from behavior_controller.config import settings
from behavior_controller.missions import load
from behavior_controller.missions.checks import checks
from behavior_controller.robot.d543 import ATTENTION, FACES, SPEECH
from behavior_controller.robot.requests import AttentionStatus, Faces, GoTo, Location
from behavior_controller.run.events import (
    AWAITED, DOUBTFUL, MISSING, READY, Asked, Checked, HealthChanged, RunFinished, RunStarted,
    Sources, Starting, TopicSaid)
from behavior_controller.run.fold import fold
from behavior_controller.run.health import GONE, Health
from behavior_controller.run.readiness import UNTRIED, is_ready, readiness
from behavior_controller.run.record.codec import Decoder
from behavior_controller.run.record.outset import Outset
from behavior_controller.run.state import State
from behavior_controller.text import Source
from behavior_controller.viewer import status_tool
from mission_rig import Rig
from page_rig import Show, wait_until

DRIVE = Checked("service", "/robotNavigation/set_goal", READY)
FACE_TOPIC = Checked("topic", "/faceDetection/data", READY)
MISSION = Checked("mission", "tour.xml", READY, "222 nodes")
STARTED = RunStarted("tour.xml", [], {}, Sources(
    (Source("tour.xml", "<m/>"),), Source("", ""), Source("", ""), ""))
GONE_DRIVE = HealthChanged("service", DRIVE.name, "robotNavigation", False, "gone: it has ended",
                           "the robot cannot drive", GONE)


def rows_after(*events):
    state = State()
    for at, event in enumerate(events, 1):
        state = fold(state, float(at), event)
    return readiness(state)


def states_after(*events):
    return {row.name: row.state for row in rows_after(*events)}


def test_before_anything_was_checked_nothing_is_ready():
    assert not is_ready(rows_after())
    rows = rows_after(Starting("waiting up to 15 s for the ROS master"))
    assert [(row.name, row.state) for row in rows] == [("controller", AWAITED)]
    assert "the ROS master" in rows[0].text and not is_ready(rows)


@pytest.mark.parametrize("state, ready", [
    (READY, True), (DOUBTFUL, True), (AWAITED, False), (MISSING, False)])
def test_all_is_ready_when_nothing_is_awaited_or_missing(state, ready):
    rows = rows_after(MISSION, Checked("topic", "/x", state, "why"), STARTED)
    assert is_ready(rows) is ready


def test_a_service_is_untried_until_it_was_asked():
    asked = Asked(1, DRIVE.name, GoTo(Location(1.0, 2.0, 0.0)))
    assert states_after(DRIVE, STARTED)[DRIVE.name] == UNTRIED
    assert states_after(DRIVE, STARTED, asked)[DRIVE.name] == READY
    # what was awaited and is there counts as it is now
    awaited = Checked("service", DRIVE.name, AWAITED, "is looked for")
    assert states_after(awaited)[DRIVE.name] == AWAITED
    assert states_after(awaited, DRIVE)[DRIVE.name] == UNTRIED


def test_a_node_that_is_gone_is_missing_until_it_is_back():
    back = HealthChanged("service", DRIVE.name, "robotNavigation", True, "available again", "",
                         GONE)
    gone = rows_after(MISSION, DRIVE, STARTED, GONE_DRIVE)
    assert [row.state for row in gone] == [READY, MISSING] and not is_ready(gone)
    assert is_ready(rows_after(MISSION, DRIVE, STARTED, GONE_DRIVE, back))


def test_a_topic_says_what_its_newest_message_was_and_how_many_come():
    assert states_after(FACE_TOPIC, STARTED)[FACE_TOPIC.name] == UNTRIED
    row, = rows_after(FACE_TOPIC, STARTED, TopicSaid(FACE_TOPIC.name, "no face", 9.8))
    assert (row.state, row.text) == (READY, "no face, 9.8 messages a second")


def test_a_run_that_has_ended_is_not_ready():
    assert not is_ready(rows_after(MISSION, STARTED, RunFinished("stopped; last pass: none", 0)))


def test_a_late_reader_gets_the_list():
    outset, state = Outset(), State()
    for at, event in enumerate((MISSION, DRIVE, FACE_TOPIC, TopicSaid(FACE_TOPIC.name, "x", 1.0))):
        outset.take(float(at), event)
        state = fold(state, float(at), event)
    again = State()
    for line in Decoder("head").read_all(outset.head(0, 9.0, has_former=False)):
        again = fold(again, line.time, line.event)
    assert readiness(again) == readiness(state) and len(readiness(again)) == 3


@pytest.mark.parametrize("topic, value, words", [
    (FACES, Faces((), ()), "no face"), (FACES, Faces(("a",), (False,)), "1 face"),
    (FACES, Faces(("a", "b"), (True, False)), "2 faces, 1 looking at the robot"),
    (ATTENTION, AttentionStatus("seeking", 0), "seeking"), (SPEECH, "Yes", "“Yes”")])
def test_what_a_message_is_in_words(topic, value, words):
    assert topic.words(value) == words


def test_a_small_change_of_the_rate_is_no_news():
    health = Health()
    said = []
    for rate in (10.0, 9.0, 11.5, 20.0):
        health.hear("/x", 1.0, "no face", rate)
        said.append(health.said["/x"].rate)
    assert said == [10.0, 10.0, 10.0, 20.0]


@pytest.mark.parametrize("language, state", [("English", READY), ("Kinyarwanda", DOUBTFUL)])
def test_configuration_mission_and_phrases_are_in_the_list(language, state):
    chosen = settings.load(folders.config(settings.FILE_NAME), {}, {"language": language})
    plan = load.load(chosen)
    found = {check.kind: check for check in checks(plan, folders.config(settings.FILE_NAME))}
    assert found["mission"].name == folders.mission("lab_tour")
    assert found["mission"].text.startswith("222 nodes, changed on 20")
    assert (found["language"].name, found["phrases"].state) == (language, state)
    assert ("draft" in found["phrases"].text) == (state == DOUBTFUL)


def texts_of(**changed):
    """Return what the list says of the texts of the exhibits."""
    chosen = settings.load(folders.config(settings.FILE_NAME), {}, changed)
    plan = load.load(chosen)
    return plan, [(check.state, check.text) for check in checks(plan, "c.ini")
                  if check.kind == "exhibits"]


def test_the_list_says_which_texts_of_exhibits_may_be_in_another_language():
    _, found = texts_of()
    assert found == [(READY, "the knowledge base has the texts")]
    _, ((state, text),) = texts_of(language="Kinyarwanda")
    assert state == DOUBTFUL and "Kinyarwanda" in text
    plan, found = texts_of(robotInterface="release-1.0", scenarioSpecification="release_1_0_tour")
    assert found == [(READY, "all texts are in English")]
    first, *others = plan.knowledge.tour
    tour = (first._replace(name="Loom", description2=""), *others)
    mute = dataclasses.replace(plan, knowledge=dataclasses.replace(plan.knowledge, tour=tour))
    assert [(check.state, check.text) for check in checks(mute, "c.ini")
            if check.kind == "exhibits"] == [(DOUBTFUL, "texts in English are missing for Loom")]


def test_a_draft_of_another_package_is_a_draft_too():
    plan, _ = texts_of()
    both = Source("p.ini", plan.phrases.source.text + "\n# Draft: nobody has read it\nX  x\n")
    drafted = dataclasses.replace(plan, phrases=dataclasses.replace(plan.phrases, source=both))
    assert [check.state for check in checks(drafted, "c.ini") if check.kind == "phrases"] == [
        DOUBTFUL]


def test_the_command_prints_the_list_under_a_headline():
    class Part:
        rows = rows_after(MISSION, DRIVE, Checked("topic", "/x", MISSING, "no node publishes it"))
        is_ready = False

    assert status_tool.ready_lines(Part) == [
        "not ready", "✔ mission tour.xml: 222 nodes",
        "○ service /robotNavigation/set_goal: there, its type is right; not asked yet",
        "✘ topic /x: no node publishes it"]


@pytest.mark.slow
def test_a_professor_sees_without_a_click_what_is_missing(browser):
    shown = Show(Rig())
    try:
        browser.get(shown.url)
        for event in (MISSION, DRIVE, Checked("topic", "/x", MISSING, "no node publishes it")):
            shown.rig.mission.events.emit(event)
        wait_until(lambda: len(browser.find_elements("css selector", "#ready-list li")) == 3)
        assert browser.find_element("id", "ready-title").text == "Not ready"
        missing = browser.find_element("css selector", "#ready-list .missing")
        assert missing.text.split("\n") == ["✘", "topic /x", "no node publishes it"]
        shown.rig.mission.events.emit(Checked("topic", "/x", READY, ""))
        wait_until(lambda: browser.find_element("id", "ready-title").text == "Ready")
    finally:
        shown.page.close()
