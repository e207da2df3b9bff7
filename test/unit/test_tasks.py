"""The tasks that people open the page for: a professor and a student find the answer with at most
one click, and it is that of the model of the run. A technician opens the list of runs."""
import pytest

from behavior_controller.robot.requests import Faces, Say
from behavior_controller.robot.d543 import FACES
from behavior_controller.run.events import MISSING, READY, Checked, TopicSaid
from behavior_controller.run.moment import card, robot_line
from behavior_controller.run.readiness import readiness
from browser import axe, findings
from mission_rig import Rig, refusal, visitor_who
from page_rig import Situation, open_page, text, use_time_of, wait_until

pytestmark = pytest.mark.slow

LANES = """
return Object.fromEntries([...document.querySelectorAll("#lanes .values .lane:not([hidden])")].map(
  row => [row.firstChild.textContent, [...row.lastChild.children].map(bar => bar.title)]))"""
ROWS = """
return [...document.querySelectorAll("#ready-list li")].map(
  row => [...row.children].map(one => one.textContent))"""


FIRST_IS_SEEN = """
const box = byId("ready-list").getBoundingClientRect();
const first = document.querySelector("#ready-list .missing").getBoundingClientRect();
return first.top >= box.top && first.bottom <= Math.min(box.bottom, innerHeight)"""


def test_a_professor_sees_whether_all_is_ready(show, browser, screen):
    rig = Rig()
    played, shown = Situation(rig), show(rig)
    open_page(browser, shown)
    checks = [Checked("mission", "lab_tour.xml", READY, "222 nodes"),
              Checked("service", "/textToSpeech/say_text", READY),
              Checked("topic", FACES.name, READY), Checked("topic", "/x", MISSING, "no node")]
    for event in [*checks, TopicSaid(FACES.name, "no face", 10.0)]:
        rig.mission.events.emit(event)
    expected = readiness(played.run.state)
    wait_until(lambda: len(browser.execute_script(ROWS)) == len(expected) == 4)
    expected.sort(key=lambda row: row.state != MISSING)  # what has to be repaired comes first
    for row, (_, name, words) in zip(expected, browser.execute_script(ROWS)):
        assert (name, words) == (f"{row.kind} {row.name}", row.text)
    assert text(browser, "#ready-title") == "Not ready"  # without a click
    browser.execute_script("byId('mission-section').hidden = true")  # judged with the whole page
    for wanted in ((390, 844, "dark"), (1280, 800, "light")):
        screen(*wanted)
        assert browser.execute_script(FIRST_IS_SEEN), wanted
        assert findings(browser, axe()) == [], wanted
    rig.mission.events.emit(Checked("topic", "/x", READY, ""))
    wait_until(lambda: text(browser, "#ready-title") == "Ready")


def watched(rig, words):
    """Have a topic say its newest message, as the monitoring does, and return the visitor."""
    def act(rig):
        rig.clock.advance(0.5)
        rig.topics.publish(FACES, Faces((), ()))
        if words not in [event.words for event in rig.of(TopicSaid)]:
            rig.mission.events.emit(TopicSaid(FACES.name, words, 10.0))
    return act


def test_a_student_sees_that_a_visitor_was_not_greeted_for_want_of_a_face(
        show, browser, monkeypatch):
    rig, waits = Rig(), []
    use_time_of(rig, monkeypatch)
    played, shown = Situation(rig), show(rig)
    played.play(watched(rig, "no face"), lambda: waits.append(0) or len(waits) > 20)
    open_page(browser, shown)
    state = played.run.state
    wait_until(lambda: text(browser, "#now") == card(state).what)
    assert "waiting for a visitor" in card(state).what
    # without a click: beside the wait, the face detection has said all the time that it sees none
    lanes = browser.execute_script(LANES)
    assert lanes["attention"][-1].startswith(f"attention: {state.robot.attention.state},")
    bar, = lanes[FACES.name]
    assert bar.startswith(f"{FACES.name}: {state.said[FACES.name].words},")
    assert "answer" not in lanes


def test_a_student_finds_the_failure_that_kept_the_robot_from_greeting(show, browser, monkeypatch):
    rig = Rig(answer=lambda request: refusal(request) if isinstance(request, Say) and
              "welcome" in request.text else NotImplemented)
    use_time_of(rig, monkeypatch)
    played, shown = Situation(rig), show(rig)
    rig.run(visitor_who("yes"))
    open_page(browser, shown)
    failed = next(failed for failed in played.run.failures if failed.node == "WelcomeSpeech")
    # in the story of the visit, also when it is over
    wait_until(lambda: "WelcomeSpeech failed" in browser.execute_script(
        "return byId('transcript').textContent"))
    mark = "return getComputedStyle(rowOf(arguments[0]).querySelector('.sign')).color"
    red = browser.execute_script(
        "return getComputedStyle(document.querySelector('.legend .F')).color")
    assert browser.execute_script(mark, failed.uid) == red  # and red in the tree
    browser.execute_script("""
        const lane = timeline.lanes.find(lane => lane.name === "WelcomeSpeech");
        lane.row.querySelector(".bar.F").click()""")  # the only click
    wait_until(lambda: browser.execute_script("return frozen") is not None)
    at = browser.execute_script("return frozen")
    state = played.run.at(at + 1e-6)
    wait_until(lambda: text(browser, "#now") == card(state).what)
    assert "WelcomeSpeech" in card(state).what
    assert text(browser, "#place") == robot_line(state).place
    titles = browser.execute_script(LANES)["attention"]
    assert titles[-1].startswith(f"attention: {state.robot.attention.state},")
