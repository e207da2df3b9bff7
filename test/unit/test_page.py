"""The live page in a real browser."""
import json
import os
import random
import re
import signal
import subprocess
import sys
import time

import pytest
from msgspec.structs import replace

from behavior_controller.run.events import (HealthChanged, LeafFinished, Noticed,
                                                  PassFinished, PassStarted, Recovering,
                                                  RunFinished, StepStarted)
from behavior_controller.robot.gateway import Cause, Failure
from behavior_controller.run.health import GONE
from behavior_controller.robot.requests import Answer, GoTo, PerformGesture, Say
from behavior_controller.run.state import LEFT_OUT, rank
from behavior_controller.viewer import status_tool, view
from behavior_controller.run.record import recorder
from behavior_controller.viewer import web_page as page_module
from behavior_controller.viewer.view import PARTS, SENTENCES
from behavior_controller.run.story import condition, counted, how_it_ended, why
from behavior_controller.viewer.web_page import Page
from browser import SCREENS, axe, findings
from mission_rig import RUN, Rig, board_of, hanging, one_leaf, refusal, refusing, visitor_who
from page_rig import Stop, is_second_text, open_page, text, until, wait_until
from told_visits import RUNS, Teller, rig_of, walks_off

pytestmark = pytest.mark.slow

IN_VIEW = """
const row = document.querySelector(".tip > .row").getBoundingClientRect(), box = byId("tree").getBoundingClientRect();
return row.height > 0 && row.top >= box.top && row.bottom <= box.bottom && row.left >= 0 && row.right <= innerWidth;"""
NO_SIDEWAYS = "return document.documentElement.scrollWidth <= innerWidth"


def play_to_second_text(browser, shown):
    """Open the page, and play the tour until the robot says the second text of an exhibit."""
    open_page(browser, shown)
    shown.run_until(is_second_text)
    wait_until(lambda: "second text 1" in text(browser, "#now"))


def test_a_tour_is_followed_without_a_reload(show, browser):
    rig = Rig(answer=refusing(PerformGesture))
    shown = show(rig)
    open_page(browser, shown)
    assert text(browser, "#now") == "nothing runs"
    browser.execute_script("window.is_same_page = true")
    shown.run_until(is_second_text)
    board = shown.page.board
    wait_until(lambda: "second text 1" in text(browser, "#now"))
    assert text(browser, "#now") == board.part("now")["card"]["what"]
    assert text(browser, "#visitor") == "Visitor 1 · exhibit 1 of 2, exhibit 1"
    assert re.match(r"\d+ s of at most \d+ s$", text(browser, "#elapsed"))
    assert browser.execute_script("return is_same_page")
    assert text(browser, "#running").endswith("VisitExhibit › 2 (DescribeExhibitSpeech) #134")
    drawn = browser.execute_script("return items.map(one => one && "
                                   "([...one.classList].find(name => name.length == 1) || '-'))")
    letters = board.part("statuses")["letters"]
    assert [(uid, letter) for uid, letter in enumerate(drawn)
            if letter and letter != letters[uid]] == []
    assert browser.execute_script(TRANSCRIPT) == [
        sentence["text"] for sentence in reversed(board.part("story")["sentences"])]
    assert "exhibit 1" in text(browser, "#blackboard")
    for width, height in ((1280, 800), (800, 1180)):
        browser.set_window_size(width, height)
        wait_until(lambda: browser.execute_script(IN_VIEW))
        assert browser.execute_script(NO_SIDEWAYS)
    assert [entry for entry in browser.get_log("browser") if entry["level"] == "SEVERE"] == []


def test_the_page_counts_the_time_of_a_step_by_itself(show, browser):
    shown = show(one_leaf("<WelcomeSpeech/>", lambda request: None))
    open_page(browser, shown)
    shown.rig.tick()
    wait_until(lambda: re.match("[0-9]+ s of at most 60 s$", text(browser, "#elapsed")))
    first = int(text(browser, "#elapsed").split()[0])
    wait_until(lambda: shown.rig.clock.advance(0.05) or  # else the tick thread hangs
               int(text(browser, "#elapsed").split()[0]) >= first + 2)
    assert browser.execute_script("return byId('limit').max") == 60
    shown_as, value = browser.execute_script(
        "return [byId('elapsed').textContent, byId('limit').value]")
    assert value == pytest.approx(int(shown_as.split()[0]), abs=1.0)


def test_steps_that_run_at_once_have_a_line_each_that_is_seen(show, browser, screen):
    shown = show(one_leaf("<Parallel><WelcomeSpeech/><EnableAnimateBehavior/></Parallel>",
                          lambda request: None))
    open_page(browser, shown)
    shown.rig.tick()
    wait_until(lambda: len(text(browser, "#now").split("\n")) == 2)
    lines = text(browser, "#now").split("\n")
    assert [line.split()[0] for line in lines] == ["starting", "saying"]
    for width in (1280, 360):
        screen(width, 800)
        assert browser.execute_script("return byId('now').scrollHeight <= byId('now').clientHeight")


ROW_OF_TIP = """
const tip = document.querySelector(".tip"), sign = tip && tip.querySelector(".sign");
return tip && [Number(tip.dataset.uid), sign.textContent, sign.getAttribute("aria-label")]"""


def test_a_step_that_a_recovery_does_again_is_marked_where_it_stands(show, browser):
    drives = []

    def answer(request):
        if not isinstance(request, GoTo):
            return NotImplemented
        drives.append(request)
        return refusal(request) if len(drives) == 1 else None

    shown = show(Rig(answer=answer))
    open_page(browser, shown)
    with pytest.raises(Stop):
        shown.rig.run(until(lambda: len(drives) == 2))
    recovering = shown.rig.of(Recovering)[-1]
    uid = next(node.uid for node in shown.rig.tree.nodes if node.full_path == recovering.path)
    assert uid != recovering.uid
    wait_until(lambda: browser.execute_script(ROW_OF_TIP) == [
        uid, "↻", "done again after a failure"])
    wait_until(lambda: browser.execute_script(IN_VIEW))
    assert text(browser, "#running").endswith("Navigate #{}".format(uid))


def test_the_row_where_the_run_is_stays_in_view_when_the_panel_changes_its_size(show, browser):
    shown = show(Rig())
    open_page(browser, shown, 1280, 1000)
    shown.run_until(is_second_text)
    wait_until(lambda: "second text 1" in text(browser, "#now"))
    for height in ("300px", "40vh", "220px"):
        browser.execute_script("byId('tree').style.height = arguments[0]", height)
        wait_until(lambda: browser.execute_script(IN_VIEW))


@pytest.fixture
def rig_s_time(monkeypatch):
    """Return what has the board tell the time of day by the clock of a rig."""
    def use(rig):
        for module in (view, recorder.events):
            monkeypatch.setattr(module, "unix_now", rig.clock.now)
    return use


TRANSCRIPT = """
return [...document.querySelectorAll('#transcript [data-number]')].sort((one, other) => other.dataset.number - one.dataset.number)
  .map(one => one.children[1].textContent)"""
VISITS_LIST = """
return [...document.querySelectorAll("#visits-list > li")].map(one => [one.children[1].lastChild.textContent.trim(),
  [...one.querySelectorAll(".why")].map(why => why.innerText)])"""
ALARMS = "return [...document.querySelectorAll('#alarms li')].map(one => one.innerText)"


@pytest.mark.parametrize("kind", ["left out", "given up", "node died", "budget spent"])
def test_the_page_tells_each_kind_of_visit_in_the_sentences_of_the_story(
        show, browser, rig_s_time, kind):
    visitor, _, _, runs, _ = RUNS[kind]
    rig = rig_of(kind)
    rig_s_time(rig)
    shown, teller = show(rig), Teller(rig)
    open_page(browser, shown)
    teller.run(visitor, runs)
    told = teller.sentences[::-1]
    texts = [sentence.text for sentence in told[:SENTENCES]]
    wait_until(lambda: browser.execute_script(TRANSCRIPT) == texts)
    ends = [how_it_ended(visit) for visit in reversed(teller.story.state.visits)]
    left_out = [["{}: left out, {}".format(each.name, why(each.why)) for each in visit.stops
                 if each.state == LEFT_OUT] for visit in reversed(teller.story.state.visits)]
    wait_until(lambda: browser.execute_script(VISITS_LIST) ==
               [list(each) for each in zip(ends, left_out)])
    assert len(ends) == runs
    assert text(browser, "#outcomes") == counted(teller.story.state)
    ill = sorted(teller.story.state.robot.ill, key=rank)
    wrong = ["{}; {}".format(condition(each), each.consequence) for each in ill] + [
        each.text for each in told
        if each.severity == "error" and each.kind != "health" and each.visit == runs]
    more = " (and {} more)".format(len(wrong) - 1) if len(wrong) > 1 else ""
    assert browser.execute_script(ALARMS) == ["✘ " + each + more for each in wrong[:1]]


def test_every_status_has_a_sign_and_a_word_of_its_own(show, browser):
    rig = one_leaf("<Parallel success_count='3' failure_count='4'><WelcomeSpeech/><ForceFailure>"
                   "<FollowMeSpeech/></ForceFailure><SayGoodByeSpeech/><EndTourSpeech/></Parallel>",
                   lambda request: None if "oodbye" in request.text.lower() else Answer())
    shown = show(rig)
    open_page(browser, shown)
    rig.tick()
    wait_until(lambda: "R" in browser.execute_script("return letters"))
    seen = dict(browser.execute_script(
        "setAll(true); return items.map((one, n) => [letters[n], [one.firstChild.children[1]"
        ".innerText, one.firstChild.children[1].getAttribute('aria-label')]])"))
    assert (seen["R"], seen["S"], seen["F"]) == (
        ["▶", "running"], ["✔", "success"], ["✘", "failure"])


def press(browser, *keys):
    for key in keys:
        browser.switch_to.active_element.send_keys(key)


def test_the_keyboard_folds_walks_and_opens(show, browser):
    from selenium.webdriver.common.keys import Keys
    shown = show(Rig())
    open_page(browser, shown)
    browser.execute_script("byId('fold').click(); items[0].focus()")

    def focused():
        return browser.execute_script(
            "return document.activeElement.querySelector('.name').innerText")

    press(browser, Keys.ARROW_DOWN, Keys.ARROW_DOWN)
    assert focused() == "DetectVisitor"
    press(browser, Keys.ARROW_RIGHT, Keys.ARROW_RIGHT)
    # the rows between say how the mission is put together
    assert focused() == "EnableAnimateBehavior"
    press(browser, Keys.ARROW_LEFT)
    assert focused() == "DetectVisitor"
    assert browser.execute_script(
        "return document.activeElement.getAttribute('aria-expanded')") == "true"
    press(browser, Keys.SPACE)
    assert browser.execute_script(
        "return document.activeElement.getAttribute('aria-expanded')") == "false"
    press(browser, Keys.ENTER)
    wait_until(lambda: "DetectVisitor" in text(browser, "#facts"))
    press(browser, Keys.ESCAPE)
    assert focused() == "DetectVisitor" and browser.execute_script("return byId('node').hidden")
    press(browser, Keys.END)
    last = focused()
    press(browser, Keys.ARROW_DOWN)
    assert focused() == last
    press(browser, Keys.HOME)
    assert focused() == "Sequence" and browser.execute_script("return follow") is False


def test_the_transcript_is_one_tab_stop_whose_sentences_are_walked(show, browser):
    from selenium.webdriver.common.keys import Keys
    shown = show(Rig())
    play_to_second_text(browser, shown)
    browser.execute_script("byId('transcript').focus()")
    press(browser, Keys.ARROW_UP, Keys.ARROW_UP)
    last = browser.execute_script("return [...byId('transcript').querySelectorAll('a')].slice(-2)")
    assert browser.switch_to.active_element == last[0]
    press(browser, Keys.TAB)
    assert browser.execute_script("return document.activeElement.id") == "visits-list"


def test_all_rows_are_there_if_they_are_wanted(show, browser):
    shown = show(Rig())
    open_page(browser, shown)
    bare = [node["uid"] for node in shown.page.board.part("mission")["nodes"] if node["bare"]]
    rows = "return items.flatMap((one, place) => one ? [] : [place + 1])"
    assert bare and browser.execute_script(
        "return [...Array(items.length).keys()].filter(n => !items[n]).map(n => n + 1)") == bare
    browser.execute_script("byId('all').click()")
    assert browser.execute_script(rows) == []
    assert browser.execute_script(
        "return document.querySelectorAll('[role=treeitem]').length") == len(shown.rig.tree.nodes)


def test_the_subtrees_around_what_is_seen_stay_at_the_top(show, browser):
    shown = show(Rig())
    open_page(browser, shown, 1280, 800)
    browser.execute_script(  # VisitExhibit's
        "byId('unfold').click(); byId('tree').scrollTop = items[127].offsetTop - 200")
    names = """const box = byId('tree').getBoundingClientRect(), x = box.left + 300;
    return [0, 1, 2, 3].map(n => document.elementFromPoint(x, box.top + 14 + n * 28).closest('.row').querySelector('.name').innerText)"""
    assert browser.execute_script(names) == [
        "Sequence", "GiveTour", "VisitExhibits", "VisitExhibit"]


def test_a_sentence_leads_to_its_node_with_ports_results_and_place(show, browser):
    rig = Rig(answer=lambda request: refusal(request)
              if isinstance(request, GoTo) and request.goal.x == 2.0 else NotImplemented)
    shown = show(rig)
    open_page(browser, shown)
    rig.run(visitor_who(says="yes"))
    wait_until(lambda: "/robotNavigation/set_goal" in text(browser, "#transcript"))
    browser.execute_script("""[...document.querySelectorAll('#transcript a')].find(
        one => one.textContent.includes('/robotNavigation/set_goal')).click()""")
    wait_until(lambda: "{@targetLocation}" in text(browser, "#ports"))
    assert text(browser, "#node-title") == "Navigate #107"
    assert "lab_tour.xml:" in text(browser, "#facts") and "the server refused" in text(
        browser, "#results")
    assert browser.execute_script("return document.activeElement.id") == "node-title"
    assert browser.execute_script("return items[106].offsetParent !== null")  # its row is unfolded
    browser.execute_script("byId('close').click()")
    assert browser.execute_script("return location.hash") == ""


MARKS = {"failure": "error", "recovery": "r"}
DRAWN = """
return [...document.querySelectorAll("#lanes .bar." + arguments[0])].reduce(
  (sum, bar) => sum + Number((/: ([0-9]+) ×/.exec(bar.title) || [0, 1])[1]), 0)"""


def test_the_timeline_has_an_axis_waits_and_recoveries(show, browser):
    rig = Rig(answer=refusing(PerformGesture))
    shown = show(rig)
    open_page(browser, shown)
    shown.run_until(is_second_text)
    wait_until(lambda: browser.execute_script(
        "return document.querySelectorAll('#lanes .bar.w').length"))
    assert len(labels(browser)) >= 2
    sentences = shown.page.board.part("story")["sentences"]
    for kind in ("failure", "recovery"):
        told = [each for each in sentences if each["kind"] == kind and each["visit"] == 1]
        assert told
        wait_until(lambda: browser.execute_script(DRAWN, MARKS[kind]) == len(told))
    assert "recoveries" in browser.execute_script("return byId('lanes').textContent")
    cut, scrolled = browser.execute_script("""
        const edge = timeline.axis.getBoundingClientRect().bottom;
        const cut = timeline.lanes.map(lane => lane.row.getBoundingClientRect()).filter(
            row => row.top < edge - 1 && row.bottom > edge + 1);
        return [cut.length, byId("lanes").scrollTop]""")
    assert scrolled > 0 and not cut
    assert browser.execute_script("""
        ahead -= 60;  // the step began after the node's last sign of life
        showTimeline();
        return timeline.lanes.filter(lane => lane.row.hidden && !lane.isValue).length""") == 0


def test_a_step_with_many_words_ends_with_an_ellipsis_and_has_the_height_of_others(show, browser):
    said = "many words about this exhibit " * 9
    shown = show(one_leaf("<Navigate/>", lambda request: None))
    open_page(browser, shown)
    heights = [browser.execute_script(
        "showNow({robot: parts.now.robot, card: Object.assign({}, card, {what: arguments[0]})});"
        "return [byId('now').offsetHeight, getComputedStyle(byId('now')).webkitLineClamp]", words)
        for words in ("driving", said)]
    assert heights[0] == heights[1] and heights[0][1] == "2"


def labels(browser):
    """Return the labels of the timeline's axis, which stand within it and apart, as seconds since
    the visit began."""
    found = browser.execute_script("""
        const outer = byId("lanes").getBoundingClientRect();
        return [outer.left, outer.right, [...document.querySelectorAll("#lanes .axis span")].map(
            one => [one.textContent, one.getBoundingClientRect().left, one.getBoundingClientRect().right])]""")
    edges = [found[0], *(edge for _, *pair in found[2] for edge in pair), found[1]]
    assert edges == sorted(edges), found
    return [60 * int(label.split(":")[0]) + float(label.split(":")[1]) for label, _, _ in found[2]]


def test_the_timeline_is_zoomed_and_moved_by_buttons_keys_wheel_and_pointer(
        show, browser, screen, rig_s_time):
    from selenium.webdriver import ActionChains
    from selenium.webdriver.common.actions.wheel_input import ScrollOrigin
    from selenium.webdriver.common.keys import Keys
    rig = Rig()
    rig_s_time(rig)
    shown = show(rig)
    driving = StepStarted(107, "Navigate", "", "driving", "", 0.0, False)
    for seconds, event in ((0, PassStarted(1, 0.0)), (30, driving),
                           (50, PassFinished(1, "SUCCESS", 80.0))):
        rig.clock.advance(seconds)
        rig.mission.events.emit(event)
    open_page(browser, shown)
    timeline = browser.find_element("id", "lanes")

    def stretch():
        return browser.execute_script("return [timeline.from / 1000, timeline.to / 1000]")

    screen(400, 800)
    assert stretch() == [0, 80]
    wait_until(lambda: labels(browser) == [0, 30, 60])
    screen(1280, 800)
    wait_until(lambda: labels(browser) == list(range(0, 80, 10)))
    timeline.send_keys("+", "+")
    assert stretch() == [30, 50] and labels(browser) == list(range(30, 50, 2))
    timeline.send_keys(Keys.ARROW_LEFT)
    assert stretch() == [25, 45]
    browser.find_element("id", "later").click()
    assert stretch() == [35, 55] and text(browser, "#stretch") == "0:35 to 0:55"
    browser.find_element("id", "out").click()
    assert stretch() == [25, 65]
    ActionChains(browser).drag_and_drop_by_offset(timeline, 50, 0).perform()
    moved = 50 * 40 / browser.execute_script("return timeline.width")
    assert stretch() == [pytest.approx(25 - moved), pytest.approx(65 - moved)]
    timeline.send_keys(Keys.HOME)
    wheel = ActionChains(browser).move_to_element_with_offset(timeline, 0, 0)
    wheel.scroll_from_origin(ScrollOrigin.from_element(timeline), 0, -10).perform()
    assert stretch() == [0, 80]  # the page scrolls
    wheel.key_down(Keys.CONTROL).scroll_from_origin(ScrollOrigin.from_element(timeline), 0,
                                                    -10).key_up(Keys.CONTROL).perform()
    assert stretch()[1] - stretch()[0] == pytest.approx(64)
    browser.find_element("id", "whole-visit").click()
    assert stretch() == [0, 80]


def test_a_stretch_that_is_seen_up_to_now_goes_on_and_another_stays(show, browser, rig_s_time):
    rig = Rig()
    rig_s_time(rig)
    shown = show(rig)
    steps = "return [timeline.length, timeline.from, timeline.to].map(each => each / 1000)"

    def seen_after(seconds, *events):
        rig.clock.advance(seconds)
        for event in events:
            rig.mission.events.emit(event)
        message = {name: shown.page.board.part(name) for name in PARTS}
        browser.execute_script("show(arguments[0], arguments[0])", message)
        return [round(each) for each in browser.execute_script(steps)]

    open_page(browser, shown)
    browser.execute_script("source.close()")
    driving = StepStarted(107, "Navigate", "", "driving", "", 0.0, False)
    assert seen_after(0, PassStarted(1, 0.0), driving) == [1, 0, 1]
    assert seen_after(40) == [40, 0, 40]
    browser.execute_script("timeline.show(timeline.length - 20000, timeline.length)")
    assert seen_after(10) == [50, 30, 50]
    browser.execute_script("timeline.show(0, 20000)")
    assert seen_after(10) == [60, 0, 20]
    assert seen_after(30, PassFinished(1, "SUCCESS", 90.0), PassStarted(2, 90.0),
                      driving) == [1, 0, 1]


# ---------------------------------------------------------------------------------------- the graph

GRAPH = """
const box = byId("tree").getBoundingClientRect(), inside = (one, other) => one.left >= other.left - 1 && one.right <= other.right + 1
  && one.top >= other.top - 1 && one.bottom <= other.bottom + 1;
const shown = items.filter(one => one && one.firstChild.offsetParent), boxes = new Map();
for (const one of shown) boxes.set(one, one.firstChild.getBoundingClientRect());
const at = one => boxes.get(one);
const apart = (one, other) => one.right <= other.left || other.right <= one.left || one.bottom <= other.top || other.bottom <= one.top;
return {shown: shown.length, inside: shown.filter(one => inside(at(one), box)).length,
  overlapping: arguments[0] && shown.filter(one => shown.some(other => other !== one && !apart(at(one), at(other)))).length,
  misplaced: shown.filter(one => parentItem(one) && (at(parentItem(one)).left >= at(one).left || at(parentItem(one)).top >= at(one).top)).length,
  letter_height: 13 * at(shown[0]).height / shown[0].firstChild.offsetHeight, tip: inside(at(document.querySelector(".tip")), box),
  has_map: byId("map").offsetHeight > 0}"""
FOUND = """
const row = document.querySelector(".match > .row").getBoundingClientRect(), box = byId("tree").getBoundingClientRect();
return row.left >= box.left && row.right <= box.right && row.top >= box.top && row.bottom <= box.bottom"""
FOCUSED = "return document.activeElement.querySelector('.name').innerText"


def test_the_whole_tour_can_be_read_as_a_graph_which_is_zoomed_folded_and_searched(
        show, browser, screen):
    from selenium.webdriver.common.keys import Keys
    shown = show(Rig())
    screen(1280, 800)
    play_to_second_text(browser, shown)
    browser.find_element("id", "show-graph").click()
    graph = browser.execute_script(GRAPH, True)
    count = sum(not node["bare"] for node in shown.page.board.part("mission")["nodes"])
    assert (graph["shown"], graph["inside"]) == (count, count) and not graph["has_map"]
    assert graph["overlapping"] == graph["misplaced"] == 0 and graph["letter_height"] > 9
    for _ in range(3):
        browser.find_element("id", "nearer").click()
    browser.execute_script("byId('tree').scrollTo(0, 0); setFollow(true)")
    graph = browser.execute_script(GRAPH)
    assert graph["tip"] and graph["inside"] < count and graph["has_map"]
    browser.execute_script("items[0].focus()")
    press(browser, "0", Keys.ARROW_DOWN, Keys.ARROW_DOWN, Keys.ARROW_LEFT)
    assert browser.execute_script(FOCUSED) == "DetectVisitor"
    assert browser.execute_script(GRAPH)["shown"] < count - 5
    press(browser, "/", "deictic", Keys.ENTER)  # the second one
    assert text(browser, "#matches") == "2 found"
    press(browser, Keys.ESCAPE)
    assert browser.execute_script("return document.activeElement.dataset.uid") == "175"
    press(browser, "?")
    assert browser.execute_script("return byId('keys').open")
    press(browser, Keys.ESCAPE)
    browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": "print"})
    tops = browser.execute_script("""
        return [...document.querySelectorAll(".row")].filter(row => row.offsetParent).map(
            row => row.getBoundingClientRect().top)""")
    assert tops == sorted(tops)  # the list
    browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": ""})
    assert [entry for entry in browser.get_log("browser") if entry["level"] == "SEVERE"] == []


def test_a_graph_of_1000_nodes_is_there_at_once_and_stays_with_what_runs(show, browser):
    part = ("<Sequence name='part {0}'><ForceSuccess name='a'><WelcomeSpeech/></ForceSuccess>"
            "</Sequence>")
    rig = one_leaf("<Sequence>{}<Sleep msec='9000'/></Sequence>".format("".join(
        map(part.format, range(333)))))
    shown = show(rig)
    open_page(browser, shown)
    rig.tick()
    wait_until(lambda: "Sleep #1001" in text(browser, "#running"))
    took = browser.execute_script(
        "const began = performance.now(); setGraph(true); return performance.now() - began")
    graph = browser.execute_script(GRAPH, True)
    assert graph["shown"] == 1001 and graph["overlapping"] == graph["misplaced"] == 0
    assert graph["tip"] and graph["has_map"] and graph["letter_height"] == 13
    print("a graph of 1,001 nodes: {:.0f} ms".format(took))
    assert took < 10000
    browser.find_element("id", "whole").click()
    assert browser.execute_script(GRAPH)["inside"] == 1001
    press(browser, "/", "part 250")  # what is found can be read
    assert browser.execute_script(FOUND) and browser.execute_script(GRAPH)["letter_height"] == 13


def test_what_there_is_to_know_of_a_node_is_told_on_demand(show):
    shown = show(Rig())
    _, body, headers = shown.fetch("node/107")
    assert json.loads(body)["type"] == "Navigate"
    assert headers["Content-Type"] == "application/json; charset=utf-8"
    assert {shown.fetch("node/" + uid)[0] for uid in ("0", "223", "999999", "x", "1/2")} == {404}


# ----------------------------------------------------------------------------------- for all to see

DEAD = HealthChanged("service", "/robotNavigation/set_goal", "robotNavigation", False, "gone",
                     "the robot cannot drive")


FEW_ROWS = """
items.forEach((one, n) => one && n > 30 && !one.querySelector(".tip") && !one.matches(".tip") && one.remove())"""


def test_axe_finds_nothing_and_each_width_has_all(show, browser, screen):
    rig = Rig(answer=refusing(PerformGesture))
    rig.mission.health.report(GONE, DEAD)
    shown = show(rig)
    play_to_second_text(browser, shown)
    browser.execute_script("location.hash = '#node-107'")
    wait_until(lambda: "{@targetLocation}" in text(browser, "#ports"))
    for width, height in SCREENS:
        screen(width, height)
        assert browser.execute_script("return innerWidth") == width
        assert browser.execute_script(NO_SIDEWAYS)
    browser.execute_script(FEW_ROWS)  # axe-core takes its time: a few of each kind do
    for wanted in ((400, 800, "light"), (1280, 800, "dark")):
        screen(*wanted)
        assert findings(browser, axe()) == [], wanted


def test_axe_finds_nothing_in_any_state(show, browser, screen):
    shown = show(Rig())
    screen(1280, 800, "dark")
    open_page(browser, shown)
    browser.execute_script("setGraph(true); setScale(1); byId('find').value = 'gaze'; find()")
    assert findings(browser, axe()) == []
    shown.rig.mission.events.emit(RunFinished("stopped", 0))
    wait_until(lambda: "has ended" in doubt(browser))
    browser.execute_script("setGraph(false); byId('mission-section').hidden = true")
    assert findings(browser, axe()) == []


def test_axe_finds_nothing_when_the_connection_is_lost(show, browser, screen):
    screen(1280, 800)
    open_page(browser, show(Rig()))
    browser.execute_script("hasConnection = false; showDoubt(); source.close(); "
                           "byId('mission-section').hidden = true")
    assert "is lost" in doubt(browser)
    assert findings(browser, axe()) == []


def test_what_the_robot_says_in_another_language_is_marked_for_screen_readers(show, browser):
    rig = Rig(answer=hanging(Say), language="Kinyarwanda")
    shown = show(rig)
    open_page(browser, shown)
    shown.rig.mission.events.emit(replace(RUN, settings={"language": "Kinyarwanda"}))
    shown.run_until(lambda request: isinstance(request, Say))
    wait_until(lambda: "“Muraho" in text(browser, "#now"))
    assert browser.execute_script(
        "return byId('now').querySelector('[lang=rw]').textContent").startswith("“Muraho")


FORCED = [{"name": "forced-colors", "value": "active"}]
IS_DRAWN = """
const plain = getComputedStyle(document.body).backgroundColor;
return [...document.querySelectorAll(arguments[0])].map(one => getComputedStyle(one).backgroundColor !== plain)"""


def test_what_is_drawn_by_its_colour_is_seen_in_forced_colours(show, browser):
    shown = show(Rig())
    play_to_second_text(browser, shown)
    browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": FORCED})
    try:
        for chosen in ("#lanes .bar.R", "[aria-pressed=true]", "#stops .under-way", ".tip > .row"):
            drawn = browser.execute_script(IS_DRAWN, chosen)
            assert drawn and all(drawn), chosen
    finally:
        browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": []})


def test_what_a_person_has_to_do_can_be_read_on_paper(show, browser):
    shown = show(Rig())
    shown.rig.mission.health.report(GONE, DEAD)
    open_page(browser, shown)
    shown.run_until(is_second_text)
    wait_until(lambda: text(browser, "#instruction") == "Restart /robotNavigation")
    browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": "print"})
    try:
        assert browser.execute_script(
            "return getComputedStyle(byId('instruction')).color") == "rgb(0, 0, 0)"
        alarm, card = browser.execute_script(
            "return [byId('alarms').getBoundingClientRect().bottom, "
            "byId('card').getBoundingClientRect().top]")
        assert alarm <= card
    finally:
        browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": ""})


def test_another_mission_takes_the_place_of_the_first(show, browser):
    shown = show(Rig())
    open_page(browser, shown)
    other = one_leaf(
        "<Sequence><WelcomeSpeech name='&lt;img src=x onerror=alert(1)&gt;'/></Sequence>")
    shown.page.board.show(other.tree)
    wait_until(lambda: browser.execute_script("return items.length") == 2)
    # a name is a text, whatever it looks like
    name = "#tree .row:last-child .name, [aria-level='2'] .name"
    assert text(browser, name) == "<img src=x onerror=alert(1)>"


NAME_IN_VIEW = """
const name = document.querySelector(".tip > .row > .name").getBoundingClientRect();
const row = document.querySelector(".tip > .row").getBoundingClientRect(), box = byId("tree").getBoundingClientRect();
return name.left >= box.left && name.right <= box.right && row.top >= box.top && row.bottom <= box.bottom
  && row.bottom <= innerHeight && row.right >= name.right;"""


def test_a_phone_shows_first_what_the_robot_does_and_what_is_wrong(show, browser, screen):
    rig = Rig()
    shown = show(rig)
    rig.mission.health.report(GONE, DEAD)
    screen(400, 800)
    open_page(browser, shown)
    assert browser.execute_script("return innerWidth") == 400
    shown.run_until(is_second_text)
    wait_until(lambda: "second text 1" in text(browser, "#now"))
    for what in ("#alarms", "#now", "#elapsed", "#stops",
                 "#transcript li:last-child"):  # without scrolling
        bottom = browser.execute_script(
            "return document.querySelector(arguments[0]).getBoundingClientRect().bottom", what)
        assert 0 < bottom <= 800, what
    assert browser.execute_script(NO_SIDEWAYS)
    parts = shown.page.board.part("health").values()
    dead = [part["trouble"] for part in parts if not part["well"]]
    assert text(browser, "#alarms") == "✘ " + dead[0] and "the robot cannot drive" in dead[0]
    browser.execute_script("byId('mission-section').scrollIntoView()")
    wait_until(lambda: browser.execute_script(NAME_IN_VIEW))
    browser.execute_script("scrollTo(0, document.body.scrollHeight)")  # the alarm stays in view
    bottom = browser.execute_script("return byId('alarms').getBoundingClientRect().bottom")
    assert 0 < bottom < 400


IS_CUT = """
return [...document.querySelectorAll(arguments[0])].map(one => one.scrollWidth > one.clientWidth || one.scrollHeight > one.clientHeight)"""


def test_what_is_wrong_and_what_came_of_it_are_not_cut(show, browser, screen):
    rig = Rig(answer=refusing(PerformGesture))
    shown = show(rig)
    rig.mission.health.report(GONE, replace(
        DEAD, consequence="until it is back, the robot cannot drive"))
    play_to_second_text(browser, shown)
    for width in (400, 1280):
        screen(width, 800)
        assert browser.execute_script(IS_CUT, "#alarms li") == [False]
        summaries = browser.execute_script(IS_CUT, "#transcript summary")
        assert summaries and not any(summaries)


def test_a_stop_that_is_broken_off_begins_with_its_name_on_a_phone(show, browser, screen):
    shown = show(Rig(answer=refusing(GoTo)))
    screen(400, 800)
    open_page(browser, shown)
    shown.rig.run(visitor_who("yes"))
    wait_until(lambda: "broken off" in text(browser, "#stops"))
    inside = browser.execute_script("""
        const box = byId("stops").getBoundingClientRect(), last = byId("stops").lastChild.getBoundingClientRect();
        return last.top >= box.top && last.bottom <= box.bottom && last.left >= box.left - 1""")
    assert inside and text(browser, "#stops").startswith("✘ 1 exhibit 1: broken off")


def test_a_stop_that_the_visitor_left_is_no_failure(show, browser):
    rig = rig_of("visitor left")
    open_page(browser, show(rig))
    rig.run(walks_off)
    wait_until(lambda: text(browser, "#stops") == "○ 1 exhibit 1: left")
    color = "return getComputedStyle(document.querySelector(arguments[0])).color"
    failure = browser.execute_script(color, ".legend .F")
    assert browser.execute_script(color, "#stops li") != failure


def test_a_tree_of_many_levels_is_shown(show, browser):
    shown = show(one_leaf("<Inverter>" * 1900 + "<WelcomeSpeech/>" + "</Inverter>" * 1900,
                          lambda request: None))
    open_page(browser, shown)
    browser.execute_script("setAll(true)")
    shown.rig.tick()
    wait_until(lambda: "WelcomeSpeech #1901" in text(browser, "#running"))
    wait_until(lambda: browser.execute_script(NAME_IN_VIEW))


# ------------------------------------------------------------------------------- how fast, how much

SEEN = """
window.seen = {};
new MutationObserver(() => requestAnimationFrame(() => {
  for (const shown of document.querySelectorAll("#transcript .sentence span"))
    if (!(shown.textContent in seen)) seen[shown.textContent] = performance.timeOrigin + performance.now();
})).observe(byId("transcript"), {childList: true, subtree: true});"""


def latency(shown, browser, name, count=40):
    """Return in how many seconds 95 of 100 events are on the screen; they come at random times."""
    draw, told = random.Random(name), {}
    browser.execute_script(SEEN)
    for number in range(count):
        time.sleep(draw.uniform(0.08, 0.2))
        told["{} {}".format(name, number)] = time.time()
        shown.rig.mission.events.emit(Noticed("info", "{} {}".format(name, number)))
    wait_until(lambda: "{} {}".format(name, count - 1) in browser.execute_script("return seen"))
    seen = browser.execute_script("return seen")
    delays = sorted(seen[text] / 1000 - at for text, at in told.items())
    return delays[int(0.95 * len(delays))]


@pytest.mark.long
@pytest.mark.timing
def test_an_event_is_on_the_screen_within_150_ms(show, browser):
    shown = show(Rig())
    open_page(browser, shown)
    found = []
    while not found or min(found) > 0.15:
        assert len(found) < 4, found  # others may have had the processors
        found.append(latency(shown, browser, "event of round {}".format(len(found))))
    print("event to screen, 95 of 100: {:.0f} ms".format(1000 * min(found)))


VISITS = 4000


def visit(events, number):
    """Tell the events of one visitor."""
    path = "GiveTour::79/VisitExhibits::82/VisitExhibit::92/Navigate::107"
    failure = Failure(Cause.REFUSED, "the server refused visitor {}".format(number),
                      "/robotNavigation/set_goal")
    events.emit(PassStarted(number, 0.0))
    events.emit(StepStarted(
        107, "Navigate", path, "driving to", "exhibit {}".format(number), 180.0, False))
    events.emit(LeafFinished(
        107, "Navigate", path, "FAILURE", "/robotNavigation/set_goal", 0.1, failure))
    events.emit(Noticed("error", "notice {}".format(number)))
    events.emit(replace(DEAD, is_well=bool(number % 2)))
    events.emit(PassFinished(number, "FAILURE" if number % 3 else "SUCCESS", 1.0))


def size(browser):
    """Return the nodes of the document and the bytes of the script's heap, when all that is garbage
    has gone."""
    for _ in range(2):
        browser.execute_cdp_cmd("HeapProfiler.collectGarbage", {})
    metrics = {each["name"]: each["value"]
               for each in browser.execute_cdp_cmd("Performance.getMetrics", {})["metrics"]}
    return browser.execute_script(
        "return document.querySelectorAll('*').length"), metrics["JSHeapUsedSize"]


BEHIND = 300.0  # s, in which the browser of a loaded machine draws what it has received


@pytest.mark.long
def test_a_page_left_open_for_thousands_of_visits_does_not_grow(show, browser, monkeypatch):
    # so that the page draws more than one visit in twenty
    monkeypatch.setattr(page_module, "PUSH_INTERVAL", 0.001)
    browser.set_script_timeout(BEHIND)
    shown = show(Rig())
    open_page(browser, shown)
    browser.execute_cdp_cmd("Performance.enable", {})
    browser.execute_script(
        "window.messages = 0; source.addEventListener('message', () => messages++)")

    def tell(first, end):
        for number in range(first, end):
            visit(shown.rig.mission.events, number)
            time.sleep(0.001)
        wait_until(lambda: re.search(r"\b{}\b".format(end - 1), text(browser, "#visits-list")),
                   BEHIND)

    tell(1, 300)  # by now each list is as long as it may become
    nodes, heap = size(browser)
    tell(300, VISITS + 1)
    after_nodes, after_heap = size(browser)
    print("{} messages; nodes {} -> {}, heap {} -> {}".format(
        browser.execute_script("return messages"), nodes, after_nodes, heap, after_heap))
    assert browser.execute_script("return messages") > 300
    assert after_nodes < 1.1 * nodes and after_heap < 1.2 * heap + 1e6
    board = shown.page.board
    assert len(board.part("story")["sentences"]) <= 100 and len(
        board.part("visits")["newest"]) <= 50


# ---------------------------------------------------------------------------------- is it still so?


def doubt(browser):
    return text(browser, "#doubt").strip()


def is_stale(browser):
    return browser.execute_script("return document.body.classList.contains('stale')")


SERVED = """
import sys, threading, time
from mission_rig import RUN, one_leaf
from page_rig import Show
from behavior_controller.robot.d543 import FACES
rig = one_leaf("<Sleep msec='900000'/>")
shown = Show(rig)
rig.mission.events.emit(RUN)
print(shown.port, flush=True)
ticked = time.monotonic()
while True:
    rig.tick()
    rig.mission.health.last_arrivals[FACES.name] = time.monotonic()
    time.sleep(0.1)
    rig.clock.advance(time.monotonic() - ticked)  # so that its signs of life are in time
    ticked = time.monotonic()
"""


def test_a_controller_that_is_frozen_does_not_look_live(browser):
    path = os.pathsep.join(filter(None, sys.path))
    with subprocess.Popen([sys.executable, "-c", SERVED], stdout=subprocess.PIPE,
                          universal_newlines=True, env=dict(os.environ, PYTHONPATH=path)) as served:
        try:
            browser.get("http://127.0.0.1:{}/".format(served.stdout.readline().strip()))
            wait_until(lambda: re.search(r"last message [01]\.", text(browser, "#health")))
            wait_until(lambda: doubt(browser) == "" and not is_stale(browser))
            os.kill(served.pid, signal.SIGSTOP)
            wait_until(lambda: is_stale(browser), 5.0)
            assert doubt(browser).startswith(
                "No message from the mission. What is shown may be old. Since ")
            wait_until(lambda: re.search(r", [4-9] s ago\.", doubt(browser)))
            # the age that the server told last goes on growing
            age = re.search(r"last message ([\d.]+) s ago", text(browser, "#health"))
            assert float(age[1]) >= 3.0
            os.kill(served.pid, signal.SIGCONT)
            wait_until(lambda: doubt(browser) == "" and not is_stale(browser))
        finally:
            served.kill()
    wait_until(lambda: doubt(browser).startswith(
        "The connection to the mission is lost; trying again."))
    assert is_stale(browser)


def test_a_tick_thread_that_hangs_does_not_look_live_though_the_page_is_served(show, browser):
    shown = show(one_leaf("<Sleep msec='9000'/>"))
    open_page(browser, shown)
    wait_until(lambda: is_stale(browser))
    assert doubt(browser).startswith(
        "The controller hangs: its tick thread gives no sign of life. Since ")
    shown.rig.clock.advance(1.0)  # it runs its timers again
    wait_until(lambda: doubt(browser) == "" and not is_stale(browser))


def test_the_end_of_the_mission_is_told_and_the_next_one_is_shown(show, browser):
    shown = show(one_leaf("<Sleep msec='9000'/>"))
    open_page(browser, shown)
    shown.rig.mission.events.emit(RunFinished("all passes are done; last pass: SUCCESS", 0))
    shown.page.close()  # at once, as the node does
    wait_until(lambda: browser.execute_script("return !hasConnection"))
    assert doubt(browser) == "The mission has ended."
    # how, where a person looks first
    assert text(browser, "#card").count("all passes are done; last pass: SUCCESS") == 1
    rig = one_leaf("<Sequence><Sleep msec='9000'/><WelcomeSpeech/></Sequence>")
    following = Page("127.0.0.1", shown.port, board_of(rig), pytest.fail)
    try:
        wait_until(lambda: browser.execute_script("return items.length") == 3 and
                   "ended" not in doubt(browser), 15.0)
    finally:
        following.close()


CARD = """
return ["step", "ended"].map(kind => {
  showNow({robot: parts.now.robot, card: Object.assign({}, card, {kind, what: arguments[0], trouble: "x", also: []})});
  return [byId("card").offsetHeight, byId("now").scrollHeight <= byId("now").clientHeight + 1];
})"""


def test_the_words_of_an_end_are_whole_and_move_nothing(show, browser, screen):
    open_page(browser, show(one_leaf("<Navigate/>", lambda request: None)))
    words = ("ended at exhibit 1 of 5, Robot arm: Navigate failed 3 times: refused "
             "(/robotNavigation/set_goal); without WelcomeGesture")
    for width, height in SCREENS + [(320, 640)]:
        screen(width, height)
        for told in (words, "stopped"):
            (before, _), (after, is_whole) = browser.execute_script(CARD, told)
            assert abs(after - before) <= 1 and (is_whole or width == 320), width


def test_health_is_told_when_it_changes(show, browser):
    rig = one_leaf("<Sleep msec='9000'/>")
    shown = show(rig)
    open_page(browser, shown)
    for is_well in (False, True):
        rig.report(GONE, HealthChanged(
            "service", "/robotNavigation/set_goal", "", is_well, "gone", "no drive"))
        wait_until(lambda: ("gone; no drive" in text(browser, "#health")) is not is_well)


# -------------------------------------------------------------------------------- without a browser


def test_a_foreign_page_cannot_frame_it(show, browser, tmp_path):
    shown = show(Rig())
    (tmp_path / "foreign.html").write_text(
        "<title>foreign</title><iframe src='{}'></iframe>".format(shown.url))
    browser.get("file://{}/foreign.html".format(tmp_path))
    wait_until(lambda: any(
        "frame-ancestors" in entry["message"] for entry in browser.get_log("browser")))


def test_the_terminal_shows_the_same(show, capsys):
    shown = show(Rig())
    shown.run_until(lambda request: isinstance(request, Say) and request.text == "first text 1")
    assert status_tool.main(["--port", str(shown.port)]) == 0
    assert "1 (DescribeExhibitSpeech) #125" in capsys.readouterr().out
