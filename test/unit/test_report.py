"""The report of a recorded run: all of the story, a timeline, tree and file with links; nothing in
it is taken for HTML."""
import copy
import html.parser
import itertools
import json
import re
import time

import pytest
from msgspec import to_builtins

from behavior_controller.bt.mission import load_text
from behavior_controller.errors import MissionError
from behavior_controller.run.events import (
    LeafFinished, Retried, RunStarted, Sources, StepStarted, TreeNode, TreeShown)
from behavior_controller.robot.gateway import Cause, Failure
from behavior_controller.leaves import registry
from behavior_controller.run.state import BROKEN_OFF, LEFT, Reason
from behavior_controller.run.story import Story, cause, how_it_ended, why
from behavior_controller.text import Source
from behavior_controller.viewer import timeline
from behavior_controller.run.record.codec import header
from behavior_controller.replay_cli import main
from behavior_controller.run.record.reader import read_record
from behavior_controller.run.record.tree_shown import shown
from behavior_controller.viewer.report import (
    CUT_OFF, FAILED as IS_FAILED, MAX_LIST_DEPTH, PASSED, Drawn, ShownVerdict, to_html)
from behavior_controller.run.history import Run
from behavior_controller.run.moment import card, robot_line
from behavior_controller.simulation.rehearsal.findings import KIND_BY_NAME
from behavior_controller.simulation.rehearsal.html_report import to_html as rehearsal_html
from behavior_controller.simulation.rehearsal.summary import FindingSummary, Share, VisitorRow
from browser import IS_WHOLE, SCREENS, axe, findings, reset_screen, set_screen
from mission_rig import decode
from recorded_tours import KINDS, recorded_day
from page_rig import wait_until

FAILED = {
    "_type": "Failure", "cause": "refused", "message": "a chair is in the way", "resource": "/s"}
WHY = cause(Failure(Cause.REFUSED, "a chair is in the way", "/s"))
RETRIED = {"event": "Retried", "time": 103.0, "node": "A", "path": "A::1", "attempt": 1,
           "failure": FAILED}


class Page(html.parser.HTMLParser):
    """What stands in a report: its tags, ids, links, and the texts of its elements by class."""

    def __init__(self, text):
        super().__init__()
        self.tags, self.ids, self.links, self.texts, self.deepest = [], [], [], [], 0
        self._open = []  # [tag, its classes, its text]
        self.text = text
        self.feed(text)
        assert self._open == []
        self.data = json.loads(self.of("data")[0])

    def handle_starttag(self, tag, attributes):
        given = dict(attributes)
        self.tags.append(tag)
        self.ids += [given["id"]] if "id" in given else []
        self.links += [given["href"]] if "href" in given else []
        if tag not in ("meta", "input"):
            self._open.append(
                [tag, [tag, given.get("id")] + (given.get("class") or "").split(), ""])
            self.deepest = max(self.deepest, len(self._open))

    def handle_endtag(self, tag):
        ended, names, text = self._open.pop()
        assert ended == tag
        self.texts.append((names, text))
        if self._open:
            self._open[-1][2] += text

    def handle_data(self, data):
        if self._open and (data.strip() or "\n" not in data or self._open[-1][0] == "code"):
            self._open[-1][2] += data.strip("\n") if self._open[-1][0] == "summary" else data

    def of(self, name):
        """Return the texts of the elements with that tag, id or class."""
        return [text for names, text in self.texts if name in names]

    @property
    def told(self):
        """The sentences, each with its time before it."""
        return [text for names, text in self.texts if names[0] == "li" and set(names) & {
            "info", "warning", "error"}]

    def bars(self, lane, of="lanes"):
        """Return the bars of a lane: begin and length in ms, kind, count, note."""
        bars = next(each for each in self.data[of] if each[0] == lane)[1:]
        return list(map(tuple, bars))


@pytest.fixture(scope="module")
def day(tmp_path_factory):
    """The path of a record of visitors of all kinds."""
    with pytest.MonkeyPatch.context() as patch:
        return recorded_day(tmp_path_factory.mktemp("day"), patch, len(KINDS))


@pytest.fixture(scope="module")
def told(day):
    """The page of its report."""
    return Page(to_html(read_record(day)))


def events_of(path):
    return [line.event for line in read_record(path)]


def lines_of(*more, nodes=(["A::1", "A", "A", 0],), mission="/m/first.xml", text="-", tree=None):
    """Return a record written by hand, which begins at 100 s, of these nodes or that tree."""
    tree = tree or TreeShown("M", [TreeNode(*node, label=node[2]) for node in nodes])
    source = [mission, text]
    return [{"event": "TreeShown", "time": 100.0, **to_builtins(tree)}, {
        "event": "RunStarted", "time": 100.0, "mission": mission, "leaves": [],
        "settings": {"missionRuns": 1}, "sources": {
            "documents": [source], "phrases": source, "policy": source, "interface": "R",
            "knowledge": []}}] + list(more)


def page_of(lines, file="the record"):
    """Return the report of a record written by hand."""
    return to_html(decoded(lines, file))


def decoded(lines, file="the record"):
    written = [{"time": line["time"], "event": dict(line, _type=line["event"])} for line in lines]
    return decode(
        header(1, 100.0) + "".join(json.dumps(line) + "\n" for line in written).encode(), file)


def tick(*changes, when=107.0):
    return {"event": "Tick", "time": when, "at": when - 100.0, "first": True, "changes": changes}


def gone(when):
    return {"event": "HealthChanged", "time": when, "kind": "service", "name": "/s", "node": "n",
            "status": "gone", "is_well": False, "consequence": "-", "respect": "gone"}


def noticed(text, level="warning", at=101.0):
    return {"event": "Noticed", "time": at, "level": level, "text": text}


def finished(when, status="SUCCESS", seconds=0.5, path="A::1", failure=None, uid=1):
    return {"event": "LeafFinished", "uid": uid, "time": when, "node": "A", "path": path,
            "status": status, "resource": "", "seconds": seconds, "failure": failure}


def waits(when, words="a wait"):
    return {"event": "StepStarted", "time": when, "uid": 1, "node": "A", "path": "A::1",
            "words": words, "what": "", "limit": 0.0, "is_wait": True}


# -------------------------------------------------------------------------------- all of it is told


@pytest.mark.slow
def test_the_sentences_are_those_of_the_story_with_their_times(day, told, capsys):
    story, expected = Story(), []
    for line in read_record(day):
        expected += [(time.strftime("%H:%M:%S", time.localtime(each.at)), each.text, each.uid)
                     for each in story.take(line.time, line.event)]
    assert len(expected) > 150
    assert told.told == [
        when + text + (" #{}".format(uid) if uid else "") for when, text, uid in expected]
    assert main(["--story", day]) == 0
    assert capsys.readouterr().out.splitlines() == [
        "{} {}".format(when, text) for when, text, _ in expected]


@pytest.mark.slow
def test_each_visit_has_a_section_with_its_outcome_and_its_exhibits(day, told):
    heads = [text for names, text in told.texts if names[0] == "summary" and "Visitor" in text]
    assert [re.match("Visitor (\\d)", head)[1] for head in heads] == list("12345678")
    results = ("✔ complete", "✔ complete", "○ declined", "○ no reaction", "○ no reaction", "○ left",
               "✔ complete", "✘ broken off")
    assert [result in head for result, head in zip(results, heads)] == 8 * [True]
    story = Story()
    for line in read_record(day):
        story.take(line.time, line.event)
    assert all(head.endswith(how_it_ended(visit)) for head, visit in zip(heads, story.state.visits))
    assert "5 of 5" in heads[0] and "20." in heads[0]
    assert "2 of 5" in heads[5] and why(Reason(LEFT)) in heads[5]
    rows = [text for names, text in told.texts if names[0] == "tr"]
    ended = r"3 of 5, Loom{}[\d.]+ s{}".format(BROKEN_OFF, why(Reason(LEFT)))
    assert any(re.match(ended, row) for row in rows)


@pytest.mark.slow
def test_eight_visitors_take_less_than_half_a_megabyte(told):
    assert len(told.text.encode()) < 500_000
    assert told.text.count('<details class="visit"') == 9  # and what was before the first visit
    assert "http://" not in told.text and "https://" not in told.text


@pytest.mark.parametrize("times, expected", [
    (44 * [101.0] + [102.0], ["the mission busy-loops 44 times", "the mission busy-loops"]),
    (2 * [101.0], ["the mission busy-loops 2 times"])])
def test_a_sentence_that_is_repeated_at_once_is_told_once_with_its_count(times, expected):
    page = Page(page_of(lines_of(*[noticed("the mission busy-loops", at=at) for at in times])))
    assert [text[8:] for text in page.told if "busy" in text] == expected


def test_more_visits_than_a_story_keeps_are_all_told():
    visits = [dict(line, number=n) for n in range(1, 61) for line in (
        {"event": "PassStarted", "time": 100.0 + n, "at": 1.0},
        {"event": "PassFinished", "time": 100.5 + n, "outcome": "SUCCESS", "seconds": 0.5})]
    assert page_of(lines_of(*visits)).count('<details class="visit"') == 61


def test_of_a_mission_that_was_changed_the_last_one_is_reported_and_the_first_is_named():
    lines = lines_of(finished(101.0)) + lines_of(
        finished(103.0, path="B::1"), tick([2, "S"]), mission="/m/second.xml",
        nodes=(["B::1", "B", "B", 0], ["C::2", "C", "C", 1]))
    text = page_of(lines)
    assert ("<h1>Mission second</h1>" in text and "/m/first.xml, which this report "
                                                  "leaves out" in text)
    assert "C::2" in text and "A::1" not in text


@pytest.fixture
def two_hours_east(monkeypatch):
    """The computer's time zone."""
    monkeypatch.setenv("TZ", "EAST-2")
    time.tzset()
    yield
    monkeypatch.undo()
    time.tzset()


def begun(when, number, name):
    return {"event": "StopChanged", "time": when, "uid": 1, "node": "A", "path": "A::1",
            "number": number, "of": 2, "name": name, "state": "begun"}


A_TOUR = [
    line for number, when in ((1, 1000.0), (2, 2000.0)) for line in
    ({"event": "PassStarted", "time": when, "number": number, "at": when}, waits(when),
     dict(finished(when + 5.0, path="A::1"),
          summary={"kind": "visit", "text": "", "mark": "arrived", "at": when + 4.0}),
     *[begun(when + 6.0, 1, "cup"), begun(when + 66.0, 2, "jug")][:3 - number], {
         "event": "PassFinished", "time": when + 70.0, "number": number, "outcome":
             ("SUCCESS", "FAILURE")[number - 1], "seconds": 70.0})
] + [{"event": "PassStarted", "time": 3000.0, "number": 3, "at": 3000.0}, {
    "event": "RunFinished", "time": 3010.25, "outcome": "stopped; last pass: FAILURE",
    "exit_code": 0}]


A_VISIT = [  # the visitor comes 4 s after the begin, the first stop 1 s later
    {"event": "PassStarted", "time": 101.0, "number": 1, "at": 101.0}, waits(101.0),
    dict(finished(105.0, path="A::1"),
         summary={"kind": "visit", "text": "", "mark": "arrived", "at": 105.0}),
    begun(106.0, 1, "cup")]


def test_the_visits_and_the_whole_run_are_told_with_their_times(two_hours_east):
    page, story = Page(page_of(lines_of(*A_TOUR))), Story()
    starts, *_, ended = [sentence.text for line in decoded(lines_of(*A_TOUR))
                         for sentence in story.take(line.time, line.event)]
    assert page.of("h1") == ["Mission first"] and page.of("header")[0].startswith(
        "Mission first1970-01-01 02:01:40 to 02:50:10, 48 min 30 s; "
        "2 visits: 1 complete and 1 broken off; ended: stopped; last pass: FAILURE")
    third = page.of("visit")[-1]
    heads = [text for names, text in page.texts if names[0] == "summary" and "Visitor" in text]
    done, failed, stopped = (how_it_ended(visit) for visit in story.state.visits)
    assert heads == [
        "Visitor 102:16:40✔ complete1 min 6 s, waited 4.0 s before" + done,
        "Visitor 202:33:20✘ broken off0 of 2 stops completed1 min 6 s, waited 4.0 s before" +
        failed,
        "Visitor 302:50:00■ stopped10.2 s" + stopped]
    assert [text for names, text in page.texts if names[0] == "tr"][:5] == [
        "stopstatetookwhy", "1 of 2, cupcompleted1 min 0 s", "2 of 2, jugcompleted4.0 s",
        "stopstatetookwhy",
        "1 of 2, cup{}1 min 4 s{}".format(BROKEN_OFF, why(story.state.visits[1].why))]
    assert third == heads[2] + "02:50:10{}Show on the timeline".format(ended)
    assert page.of("v0") == ["Before the first visit02:01:40" + starts]
    assert page.data["offset"] == 7_200_000
    assert page.data["visits"] == [[1, 900_000, 905_000, 970_000, "S"],
                                   [2, 1_900_000, 1_905_000, 1_970_000, "F"],
                                   [3, 2_900_000, 2_900_000, 2_910_250, "-"]]
    assert page.data["words"]["R"] == "under way"


@pytest.mark.parametrize("mark, result, kind", [("left", "○ left", "d"), ("", "✘ broken off", "F")])
def test_a_visitor_who_leaves_is_no_failure(mark, result, kind):
    left = dict(finished(120.0, "FAILURE", failure=FAILED, path="B::2"),
                summary={"kind": "visit", "text": "", "mark": mark, "at": 120.0})
    end = {"event": "PassFinished", "time": 121.0, "number": 1, "outcome": "FAILURE"}
    page = Page(page_of(lines_of(*A_VISIT, left, dict(end, seconds=20.0))))
    head, = [text for names, text in page.texts if names[0] == "summary" and "Visitor" in text]
    assert result in head and page.data["visits"][0][-1] == kind
    assert [text for text in [head, *page.of("header")] if "FAILURE" in text] == []


def test_a_visit_that_the_record_breaks_off_has_the_time_that_it_took():
    page = Page(page_of(lines_of(*A_VISIT, gone(136.0))))  # 31 s after the arrival
    head, = [text for names, text in page.texts if names[0] == "summary" and "Visitor" in text]
    assert "▶ under way" in head and "31.0 s, waited 4.0 s before" in head
    assert "1 of 2, cupunder way30.0 s" in [text for names, text in page.texts if names[0] == "tr"]


def test_a_visit_of_which_nothing_is_told_yet_has_no_list():
    text = page_of(lines_of({"event": "PassStarted", "time": 101.0, "number": 1, "at": 1.0}))
    assert text.count('<ol class="told">') == 1  # before the first visit
    assert '<table class="stops">' not in text


@pytest.mark.parametrize("seconds, expected", [
    (0.0, "0.0 s"), (59.9, "59.9 s"), (60.0, "1 min 0 s"), (119.6, "2 min 0 s"),
    (3599.0, "59 min 59 s"), (3600.0, "1 h 0 min"), (3659.0, "1 h 0 min"), (7320.0, "2 h 2 min")])
def test_a_duration_is_told_in_two_units(seconds, expected):
    assert ", {}; no visit".format(expected) in Page(page_of(lines_of(
        gone(100.0 + seconds)))).of("header")[0]


def test_sentences_can_be_chosen_by_what_they_are_about():
    page = Page(page_of(lines_of(
        noticed("x", "error"), finished(102.0, "FAILURE", failure=FAILED), gone(103.0))))
    assert page.of("option") == ["everything", "failure (1)", "health (1)", "notice (2)", "all",
                                 "error (1)", "info (1)", "warning (2)", "any", "refused (1)"]
    assert page.text.count("data-cause=") == page.text.count('data-cause="refused"') == 1
    assert page.of("found") == [""] and "1 results in 1 bars" in page.of("timeline")[0]
    assert page.of("legend") == [
        "successfailurehaltednot yet truea retry failedwaiting for a visitorwarningerrorvalue"]


@pytest.mark.parametrize("more, expected", [
    ([], "goes on"),
    ([{"event": "RunFinished", "time": 101.0, "outcome": "stopped; last pass: none",
       "exit_code": 0}], "ended: stopped; last pass: none"),
    ([{"event": "Lost", "time": 101.0, "lines": 7}, {"event": "Lost", "time": 102.0, "lines": 5}],
     "lacks some of the run: 7 events are missing; 5 events are missing")])
def test_how_the_run_ended_and_what_is_missing(more, expected):
    assert expected in Page(page_of(lines_of(*more))).of("header")[0]


# ----------------------------------------------------------------------------------------- timeline


def test_a_bar_stands_where_its_result_was():
    page = Page(page_of(lines_of(
        finished(102.0, seconds=1.0), finished(104.0, "FAILURE", 0.5, failure=FAILED),
        finished(110.0, "IDLE", 2.0))))
    assert page.bars(1) == [(1000, 1000, "S", 1, ""), (3500, 500, "F", 1, WHY),
                            (8000, 2000, "-", 1, "")]
    assert page.data["began"] == 100_000 and page.data["length"] == 10_000


def test_a_condition_that_does_not_hold_has_not_failed():
    no = dict(FAILED, cause="condition-false")
    ticks = [tick([1, "F"])] * 4 + [tick([1, "S"])]
    page = Page(page_of(lines_of(*[finished(100.0 + n, "FAILURE", 0.0, failure=no)
                                   for n in (1, 3, 60)], finished(161.0, seconds=0.0), *ticks)))
    assert page.bars(1) == [(1000, 59000, "n", 3, "a chair is in the way"), (61000, 0, "S", 1, "")]
    assert [text for names, text in page.texts if "count" in names] == ["✔ 1", "○ 4"]
    page = Page(page_of(lines_of(
        finished(101.0, "FAILURE", failure=no), finished(102.0, "FAILURE", failure=FAILED),
        *ticks[-3:], nodes=(["A::1", "A", "A", 0], ["B::2", "B", "B", 1]))))
    assert [text for names, text in page.texts if "count" in names] == ["✔ 1", "✘ 1", "○ 1"]


def test_a_wait_lasts_until_its_condition_holds(day, told):
    nodes = read_record(day)[0].event.nodes
    uid = next(uid for uid, node in enumerate(nodes, 1) if node.type == "IsVisitorDiscovered")
    waits = [bar for bar in told.bars(uid) if bar[2] == "n"]
    # seen after 20 s
    assert len(waits) == len(KINDS) and all(19_000 < bar[1] < 22_000 for bar in waits)
    words, = {event.words for event in events_of(day)
              if isinstance(event, StepStarted) and event.uid == uid}
    assert [bar[4] for bar in told.bars(0)].count(words) == len(KINDS)


def test_no_step_covers_another():
    page = Page(page_of(lines_of(waits(101.0), waits(101.5, "a word"), waits(102.0), gone(103.0))))
    assert page.bars(0) == [(1000, 500, "d", 1, "a wait"), (1500, 500, "d", 1, "a word"),
                            (2000, 1000, "d", 1, "a wait")]


def test_a_wait_of_the_next_visit_is_another_bar():
    visits = [({"event": "PassStarted", "time": when, "number": number, "at": 1.0}, waits(when),
               finished(when, "FAILURE", 0.0, failure=dict(FAILED, cause="condition-false")),
               {"event": "PassFinished", "time": when + 9.0, "number": number, "outcome": "FAILURE",
                "seconds": 9.0}) for number, when in ((1, 101.0), (2, 150.0))]
    page = Page(page_of(lines_of(*visits[0], *visits[1])))
    assert [bar[:3] for bar in page.bars(1)] == [(1000, 9000, "n"), (50000, 9000, "n")]


def test_a_retry_that_failed_is_marked():
    assert Page(page_of(lines_of(RETRIED))).bars(1) == [(3000, 0, "r", 1, WHY)]


@pytest.mark.slow
def test_no_result_of_a_long_run_is_dropped(monkeypatch):
    monkeypatch.setattr(timeline, "MOST_BARS", 100)
    results = [finished(100.0 + 2 * n, "SUCCESS" if n % 3 else "FAILURE", 0.001,
                        failure=None if n % 3 else FAILED) for n in range(1, 3401)]
    page = Page(page_of(lines_of(*results)))
    bars = page.bars(1)
    assert len(bars) <= 100 and max(begin + length for begin, length, *_ in bars) == 6_800_000
    assert {kind: sum(bar[3] for bar in bars if bar[2] == kind)
            for kind in "SF"} == {"S": 2267, "F": 1133}
    assert "3400 results in {} bars".format(len(bars)) in page.of("timeline")[0]


@pytest.mark.parametrize("gap, bars", [(0.9, 1), (1.0, 2)])
def test_alike_results_less_than_a_second_apart_are_one_bar(gap, bars):
    drawn = timeline.Lanes()
    for begin in (10.0, 10.5 + gap):
        drawn.add(1, timeline.Bar(begin, begin + 0.5, "S"))
    assert (drawn.results, drawn.bars, [bar.count for _, lane in drawn
                                        for bar in lane]) == (2, bars, [3 - bars] * bars)


def bars_of(drawn):
    return {key: [(bar.begin, bar.end, bar.kind, bar.note, bar.count) for bar in bars]
            for key, bars in drawn}


def test_results_of_different_lanes_kinds_or_notes_are_different_bars():
    drawn = timeline.Lanes()
    for key, kind, note in ((2, "S", ""), (1, "S", ""), (1, "F", ""), (1, "F", "so"), (1, "S", "")):
        drawn.add(key, timeline.Bar(10.0, 10.5, kind, note))
    assert bars_of(drawn) == {1: [(10.0, 10.5, "S", "", 2), (10.0, 10.5, "F", "", 1),
                                  (10.0, 10.5, "F", "so", 1)], 2: [(10.0, 10.5, "S", "", 1)]}
    assert list(dict(drawn)) == [1, 2] and (drawn.results, drawn.bars) == (5, 4)
    assert 1 in drawn and 2 in drawn and 3 not in drawn


def test_a_bar_lasts_as_long_as_the_longest_of_its_results():
    drawn = timeline.Lanes()
    drawn.add(1, timeline.Bar(10.0, 30.0, "S", count=2))
    drawn.add(1, timeline.Bar(12.0, 13.0, "S", count=3))
    drawn.add(1, timeline.Bar(30.5, 31.0, "S"))
    assert bars_of(drawn) == {1: [(10.0, 31.0, "S", "", 6)]}


@pytest.mark.parametrize("lanes, asked_again, bars", [
    ([1, 1], True, 1), ([1, 1], False, 2), ([1, 2, 1], True, 2)])
def test_what_is_asked_again_in_a_row_is_one_bar(lanes, asked_again, bars):
    drawn = timeline.Lanes()
    for number, key in enumerate(lanes):
        drawn.add(key, timeline.Bar(100.0 * number, 100.0 * number, "F"), asked_again)
    assert len(dict(drawn)[1]) == bars


def test_a_wait_lasts_until_its_end_and_what_is_asked_next_is_asked_anew():
    drawn = timeline.Lanes()
    drawn.end_wait(1, "F", 50.0)  # nothing is there
    drawn.add(1, timeline.Bar(10.0, 20.0, "F"), True)
    drawn.end_wait(1, "S", 30.0)
    drawn.end_wait(1, "F", 15.0)
    assert bars_of(drawn) == {1: [(10.0, 20.0, "F", "", 1)]}
    drawn.end_wait(1, "F", 30.0)
    drawn.add(1, timeline.Bar(60.0, 61.0, "F"), True)
    assert bars_of(drawn) == {1: [(10.0, 30.0, "F", "", 1), (60.0, 61.0, "F", "", 1)]}


def test_a_bar_too_many_joins_those_that_are_twice_as_far_apart(monkeypatch):
    monkeypatch.setattr(timeline, "MOST_BARS", 3)
    drawn = timeline.Lanes()
    for begin in (10.0, 11.5, 14.0):
        drawn.add(1, timeline.Bar(begin, begin, "S"))
    assert (drawn.bars, drawn.grain) == (3, 1.0)
    drawn.add(2, timeline.Bar(14.0, 14.0, "S"))
    assert bars_of(drawn) == {1: [(10.0, 11.5, "S", "", 2), (14.0, 14.0, "S", "", 1)],
                              2: [(14.0, 14.0, "S", "", 1)]}
    assert (drawn.results, drawn.bars, drawn.grain) == (4, 3, 2.0)


def test_bars_become_coarser_only_when_there_are_a_quarter_more_of_them(monkeypatch):
    monkeypatch.setattr(timeline, "MOST_BARS", 4)
    drawn, grains = timeline.Lanes(), []
    for number in range(1, 10):
        # results that are never alike
        drawn.add(1, timeline.Bar(number, number, "F", "cause {}".format(number)))
        grains.append(drawn.grain)
    assert drawn.bars == 9 and grains == [1.0] * 4 + [2.0] * 2 + [4.0] * 2 + [8.0]


# ------------------------------------------------------------------------------------ tree and file


def test_each_node_has_the_count_of_its_results():
    nodes = (["S", "Sequence", "the tour", 0], ["A::2", "A", "A", 1], ["B::3", "B", "B", 1])
    page = Page(page_of(lines_of(*[tick([1, "R"], [2, letter]) for letter in "SFSSR"],
                                 nodes=nodes)))
    assert page.of("row") == ["the tourhalted", "A✔ 3✘ 1", "Bnever"]


@pytest.mark.parametrize("parents, expected", [
    ([0, 1, 2, 1], [0, 1, 2, 1]), ([0, 1, 1, 1], [0, 1, 1, 1]),
    ([0, 1, 2, 3, 2, 1], [0, 1, 2, 3, 2, 1]), ([0], [0]),
    ([0, 1, 2, 1, 3], [0, 1, 2, 1, 2])])  # in an order that no tree has
def test_nodes_stand_in_lists_below_their_parents(parents, expected):
    nodes = [["N::{}".format(uid), "A", "n", parent] for uid, parent in enumerate(parents, 1)]
    text = page_of(lines_of(nodes=nodes))
    assert len(Page(text).of("row")) == len(nodes)
    tree = text[text.index('<li id="n1"'):]
    depths, depth = [], 0
    for tag in re.findall('<ul>|</ul>|<li id="n[0-9]+"', tree[:tree.index("</section>")]):
        depth += {"<ul>": 1, "</ul>": -1}.get(tag, 0)
        depths += [depth] if tag[:3] == "<li" else []
    assert depths == expected


def loaded(body):
    """Return the text of a mission with this body, and its tree as it is recorded."""
    text = f"<root BTCPP_format='4'><BehaviorTree ID='M'>\n{body}\n</BehaviorTree></root>\n"
    return text, shown(load_text(text, registry(), "/m/first.xml"), specs=list(registry().values()))


@pytest.mark.parametrize("node, letters, is_bare, has_run", [
    ("<Sequence><WelcomeSpeech/></Sequence>", [], True, False),
    ("<Sequence name='tour'><WelcomeSpeech/></Sequence>", [], False, False),
    ("<Sequence><WelcomeSpeech/></Sequence>", "S", True, True),
    ("<Sequence><WelcomeSpeech/></Sequence>", "R", True, True),
    ("<WelcomeSpeech/>", "F", False, True)])
def test_which_nodes_only_group_others_and_which_have_run(node, letters, is_bare, has_run):
    tree = loaded(f"<Sequence>{node}</Sequence>")[1]
    text = page_of(lines_of(*[tick([2, letter]) for letter in letters], tree=tree))
    classes = [re.search('<li id="n{}"([^>]*)'.format(uid), text)[1] for uid in (1, 2)]
    assert "bare" not in classes[0]
    assert (("bare" in classes[1]), ("never" in Page(text).of("row")[1])) == (is_bare, not has_run)


def test_a_node_without_events_has_its_results_from_its_changes_of_status():
    begun = {"event": "PassStarted", "time": 111.0, "number": 2, "at": 11.0}
    changes = [tick([1, letter], when=when) for when, letter in (
        (101.0, "R"), (104.0, "S"), (104.0, "-"), (105.0, "R"), (107.0, "-"), (108.0, "F"),
        (110.0, "R"))]
    page = Page(page_of(lines_of(*changes, begun, tick([1, "S"], when=120.0),
                                 nodes=(["S", "Sequence", "the tour", 0], ))))
    assert page.bars(1, "changes") == [(1000, 3000, "S", 1, ""), (5000, 2000, "-", 1, ""),
                                       (8000, 0, "F", 1, ""), (20000, 0, "S", 1, "")]
    assert Page(page_of(lines_of(finished(101.0), tick([1, "S"])))).data["changes"] == []


def test_a_node_has_its_place_its_ports_and_what_it_is_for():
    text, tree = loaded("<Sequence name='tour'>\n<Parallel success_count='2'><Sleep "
                        "msec='7'/>\n<Sleep\nmsec='8' name='a'/></Parallel></Sequence>")
    page = Page(page_of(lines_of(tick([1, "R"], [4, "S"], [1, "-"]),
                                 finished(108.0, path=tree.nodes[3].path, uid=4),
                                 tree=tree, text=text)))
    assert page.of("row") == ["tour(Sequence) #1haltedfirst.xml:2", "Parallel#2neverfirst.xml:3",
                              "Sleep#3neverfirst.xml:3", "a(Sleep) #4✔ 1first.xml:4"]
    assert page.of("bare") == ["".join(page.of("row")[1:])]
    assert page.of("never") == page.of("row")[1:3]
    assert page.text.count("<ul>") == 3 and "<ul></ul>" not in page.text
    assert page.data["nodes"][1:3] == [
        ["Parallel", [["success_count", "2", True], ["failure_count", "1", False]]],
        ["Sleep", [["msec", "7", True]]]]
    assert sorted(page.data["types"]) == ["Parallel", "Sequence", "Sleep"]
    assert page.data["types"]["Sleep"] == registry()["Sleep"].summary
    assert page.bars(4) == [(7500, 500, "S", 1, "")]


@pytest.mark.slow
def test_every_link_leads_somewhere_and_a_node_to_its_line(day, told):
    assert {link[1:] for link in told.links} - set(told.ids) == set()
    lines = dict(zip([id for id in told.ids if id.startswith("f0-")], told.of("code")))
    shown_tree = read_record(day)[0].event
    for row in re.findall(r'<li id="n\d+".*?</div>', to_html(read_record(day))):
        uid = int(re.match(r'<li id="n(\d+)"', row)[1])
        place = re.search('href="#(f0-[0-9]+)"', row)[1]
        assert re.search(r"<{}|\bID=\"{}\"".format(*[shown_tree.nodes[uid - 1].type] * 2),
                         lines[place]), row


def test_the_source_is_that_of_the_record(day, told):
    started = next(event for event in events_of(day) if isinstance(event, RunStarted))
    assert "".join(told.of("code")).rstrip("\n") == started.sources.documents[-1].text.rstrip("\n")


@pytest.mark.parametrize("place", ["", "/m/first.xml", "/m/first.xml:x:1", "/m/other.xml:1:1"])
def test_a_node_that_has_no_place_in_the_files_of_the_record_has_no_link(place):
    tree = TreeShown("M", [TreeNode("A::1", "A", "A", 0, place=place)])
    text = page_of(lines_of(tick([1, "S"]), tree=tree))
    assert 'href="#f0' not in text and '<code id="f0-1">' in text


# ------------------------------------------------------------------------ records that were changed


EVIL = "<script>alert(1)</script>"


def places_in(value, path=()):
    """Yield the path to each value in ``value``, but for the kind of event."""
    if path and path[-1] != "event":
        yield path
    if isinstance(value, (dict, list)):
        for key, inner in value.items() if isinstance(value, dict) else enumerate(value):
            yield from places_in(inner, path + (key,))


def changed(value, path, to):
    if not path:
        return to
    value = copy.copy(value)
    value[path[0]] = changed(value[path[0]], path[1:], to)
    return value


LOCATION = [1.0, 2.0, 90.0]
EXHIBIT = ["cup", "a cup", "an old cup", LOCATION, [1.0, 1.0, 1.0]]
ONE_OF_EACH = lines_of(
    {"event": "Asked", "time": 100.0, "call": 1, "service": "/k", "request": {
        "_type": "QueryKnowledge", "what": "exhibits"}},
    {"event": "Answered", "time": 100.0, "call": 1, "result": {
        "_type": "Answer", "response": "", "exhibits": [EXHIBIT]}},
    {"event": "Asked", "time": 101.0, "call": 2, "service": "/n", "request": {
        "_type": "GoTo", "goal": LOCATION}},
    {"event": "Answered", "time": 101.0, "call": 2, "result": FAILED},
    {"event": "Asked", "time": 101.0, "call": 3, "service": "/t", "request": {
        "_type": "Say", "text": "hello", "language": "English"}},
    {"event": "Answered", "time": 101.0, "call": 3, "result": {
        "_type": "Answer", "response": "", "exhibits": []}}, tick([1, "S"]),
    finished(101.5, "FAILURE", failure=FAILED), RETRIED,
    {"event": "Recovered", "time": 103.0, "node": "A", "path": "A::1", "failure": FAILED,
     "policy": "skip", "attempts": 1, "success": True, "outcome": "skipped"}, finished(103.0),
    gone(104.0), noticed("hello", "info", 105.0),
    {"event": "PassFinished", "time": 106.0, "number": 1, "outcome": "SUCCESS", "seconds": 6.0},
    {"event": "RunFinished", "time": 106.0, "outcome": "stopped", "exit_code": 0})


@pytest.mark.slow
@pytest.mark.parametrize("to", [
    pytest.param(EVIL, id="script"), pytest.param(10**400, id="huge"),
    pytest.param("\ud800", id="surrogate")])
def test_whatever_stands_in_a_record_is_text_or_is_refused(to):
    assert "a chair is in the way" in page_of(ONE_OF_EACH)
    for number, line in enumerate(ONE_OF_EACH):
        for path in places_in(line):
            lines = ONE_OF_EACH[:number] + [changed(line, path, to)] + ONE_OF_EACH[number + 1:]
            try:
                text = page_of(lines)
            except MissionError as error:
                named = re.match(r"the record:(\d+):1: this is not a line of a record: ",
                                 str(error))
                assert number + 2 <= int(named[1]) and "\n" not in str(error), (line, path)
            else:
                assert Page(text).tags.count("script") == 2 and text.encode()


def event(kind, **fields):
    return {"event": kind, "time": 1, **fields}


def answered(call=1, **result):
    return event("Answered", call=call, result=dict({"_type": "Answer"}, **result))


A = ["A", "A", "A"]


@pytest.mark.parametrize("lines, expected", [
    (lines_of(event("PassFinished", number=EVIL, outcome="S", seconds=1)),
     "r.jsonl:4:1: this is not a line of a record: Expected `int`, got `str` - at `$.event.number`"
     ),
    (lines_of(event("PassFinished", number=True, outcome="S", seconds=1)),
     "Expected `int`, got `bool` - at `$.event.number`"),
    (lines_of(event("PassFinished", number=1, outcome="S")),
     "required field `seconds` - at `$.event`"),
    (lines_of()[:1] + [changed(lines_of()[1], ("sources", "documents"), [])],
     "the mission has no documents"),
    (lines_of(event(["Tick"])), "Expected `str` - at `$.event._type`"),
    (lines_of(tick([2, "S"])), "the tree has only 1 nodes"),
    (lines_of(tick([1, "s"])), "Invalid enum value 's' - at `$.event.changes[0][1]`"),
    (lines_of(tick([1])), "Expected `array` of length 2 - at `$.event.changes[0]`"),
    (lines_of(dict(tick(), time=1e12)), "is not a time"),
    (lines_of(dict(tick(), at=float("inf"))), "JSON is malformed"),
    *[(lines_of(nodes=nodes), "a node's parent does not come before it") for nodes in (
        [[*A, 1]], [[*A, 0], [*A, 0]], [[*A, 0], [*A, 2]])],
    (lines_of()[::-1], "no tree comes before it"),
    (lines_of(answered(exhibits=[[1]])),
     "Expected `str`, got `int` - at `$.event.result.exhibits[0][0]`"),
    (lines_of(answered(0)), "calls count from 1"),
    (lines_of(answered(_type="Dance")), "Invalid value 'Dance' - at `$.event.result._type`"),
    (lines_of(event("Message", topic="/x", read=1, value=None, arrived=1)),
     "no topic /x is declared"),
    (lines_of(event("Message", topic="/faceDetection/data", read=1, arrived=1,
                    value=[["1"], [1]])), "Expected `bool`, got `int` - at `$[1][0]`"),
    (lines_of(finished(101.0, failure={"cause": "refused"})),
     "required field `message` - at `$.event.failure`")])
def test_a_line_that_the_node_cannot_have_written_is_named(lines, expected):
    with pytest.raises(MissionError) as raised:
        page_of(lines, "r.jsonl")
    assert expected in str(raised.value) and "\n" not in str(raised.value)


@pytest.mark.slow
def test_a_tree_of_many_levels_is_reported():
    nodes = [["N::{}".format(number), "N", "N", number - 1] for number in range(1, 2001)]
    page = Page(page_of(lines_of(tick([2000, "S"]), nodes=nodes)))
    assert len(page.of("row")) == 2000 and page.deepest < 2 * MAX_LIST_DEPTH + 20
    depth = itertools.accumulate({"<ul>": 1, "</ul>": -1}[tag]
                                 for tag in re.findall("</?ul>", page.text))
    assert max(depth) == MAX_LIST_DEPTH


# ------------------------------------------------------------------------------------- in a browser


@pytest.fixture(scope="module")
def address(day, tmp_path_factory):
    """Where the report of the day is: a file, and nothing else."""
    place = tmp_path_factory.mktemp("report") / "report.html"
    assert main(["--report", str(place), day]) == 0
    return "file://{}".format(place)


@pytest.fixture
def report(browser, address):
    """The browser with the report freshly opened; it must have nothing to complain about in the
    end."""
    browser.get("about:blank")  # else only the hash would change
    browser.get_log("browser")  # the page of the test before may miss its server
    browser.get(address)
    yield browser
    reset_screen(browser)
    # axe-core draws letters in order to compare them
    assert [entry for entry in browser.get_log("browser") if entry["source"] != "rendering"] == []


def run(browser, script, *arguments):
    return browser.execute_script("return " + script, *arguments)


SHOWN = "sentences.filter(one => one.offsetParent !== null)"


def choose(browser, name, value):
    browser.execute_script("byId(arguments[0]).value = arguments[1]; "
                           "byId(arguments[0]).dispatchEvent(new Event('input'))", name, value)


@pytest.fixture(scope="module")
def short(tmp_path_factory):
    """Where the report of two visits is, as a test writes it: axe-core takes its time."""
    place = tmp_path_factory.mktemp("short")
    with pytest.MonkeyPatch.context() as patch:
        path = recorded_day(place, patch, 2, ("leaves", "robot refuses"))
    page = place / "report.html"
    verdict = ShownVerdict(CUT_OFF, ["<every call> was made"], ["visitor 1"])
    page.write_text(to_html(read_record(path), verdict), encoding="utf-8")
    return "file://{}".format(page)


@pytest.mark.slow
def test_it_is_accessible_and_fits_every_width(report, short):
    report.get(short)
    report.execute_script("visits.forEach(visit => { visit.open = true; }); showVisit(2); "
                          "openNode(byId('n10'), true);")
    for width, _ in SCREENS:
        set_screen(report, width, 900)
        assert run(report, "document.documentElement.scrollWidth <= innerWidth"), width
    report.execute_script("""
        const rows = [...document.querySelectorAll("#tree li[id]")].filter(row => row.id.slice(1) > 30);
        const others = document.querySelectorAll("code:nth-child(n+9), .told > li:nth-child(n+9)");
        [...rows, ...others].forEach(one => one.remove())""")
    for width, mode in ((400, "dark"), (1920, "light")):
        set_screen(report, width, 900, mode)
        # it takes its time: a few rows of each kind do
        assert findings(report, axe()) == [], mode
    assert "<every call> was made" in report.find_element("id", "verdict").text


@pytest.mark.slow
def test_a_verdict_is_a_coloured_headline_with_its_reasons(report, day, tmp_path):
    lines, colours = read_record(day)[:40], set()
    for word in (PASSED, IS_FAILED, CUT_OFF):
        page = tmp_path / "{}.html".format(word)
        page.write_text(to_html(lines, ShownVerdict(word, ["why 1", "why 2"], ["more"])),
                        encoding="utf-8")
        report.get("file://{}".format(page))
        head = report.find_element("css selector", "#verdict h2")
        assert head.text.endswith(word) and head.text != word  # a sign of its own besides
        colours.add(head.value_of_css_property("background-color"))
        assert [each.text for each in report.find_elements("css selector", "#verdict p")] == [
            "why 1", "why 2"]
    assert len(colours) == 3


@pytest.mark.parametrize("language, marked", [("Kinyarwanda", True), ("English", False)])
def test_what_is_quoted_is_marked_with_its_language(language, marked):
    lines = lines_of(noticed("said “<b> Muraho”: yes", "info"))
    lines[1]["settings"]["language"] = language
    assert ('said <span lang="rw">“&lt;b&gt; Muraho”</span>: yes' in page_of(lines)) is marked


@pytest.mark.slow
def test_the_report_of_a_rehearsal_is_accessible_and_has_the_page_s_look(report, tmp_path):
    source, page = axe(), tmp_path / "rehearsal.html"
    shares = [Share(0.0, 10, 10, 60.0), Share(1.0, 10, 0, 60.0)]
    rows = [VisitorRow("engages", True, "SUCCESS", 119.6, 5, (("SUCCESS", 7), ("", 2)))]
    finding = FindingSummary(KIND_BY_NAME["left-on"], "Say::2", "m.xml:3:4", "<b> is on")
    page.write_text(rehearsal_html("lab_tour", rows, shares, [finding]), encoding="utf-8")
    set_screen(report, 400, 800, "dark")
    report.get("file://{}".format(page))
    assert run(report, "document.documentElement.scrollWidth <= innerWidth")
    assert run(report, "getComputedStyle(document.body).backgroundColor") == "rgb(17, 23, 29)"
    assert findings(report, source) == []


@pytest.mark.slow
def test_sentences_are_found_by_word_kind_and_cause(report, told):
    assert run(report, "byId('found').textContent") == "{} sentences".format(len(told.told))
    choose(report, "words", "LOOM")
    count = sum("loom" in text.lower() for text in told.told)
    assert run(report,
               "byId('found').textContent") == "{} of {} sentences".format(count, len(told.told))
    assert run(report, SHOWN + ".length") == count > 5  # and they are unfolded
    choose(report, "words", "")
    choose(report, "cause", "not reachable")
    shown = run(report, SHOWN + ".map(one => one.querySelector('span').innerText)")
    assert "Navigate" in shown[0] and Cause.NOT_REACHABLE.text in shown[0]
    assert re.fullmatch(r"[^\d]*Navigate[^\d]*2[^\d]*3", shown[1])
    assert run(report, "visits.filter(one => !one.hidden).map(one => one.id)") == ["v8"]
    choose(report, "kind", "said")
    assert run(report, "byId('found').textContent").startswith("0 of ")


@pytest.mark.slow
def test_the_timeline_is_moved_and_zoomed_by_keys(report):
    from selenium.webdriver.common.keys import Keys
    lanes_of = report.find_element("id", "lanes")
    length = run(report, "data.length")
    assert run(report, "[timeline.from, timeline.to]") == [0, length]
    lanes_of.send_keys("+", "+")
    assert run(report, "[timeline.from, timeline.to]") == [length * 3 / 8, length * 5 / 8]
    lanes_of.send_keys(Keys.ARROW_RIGHT)
    assert run(report, "[timeline.from, timeline.to]") == [length * 7 / 16, length * 11 / 16]
    lanes_of.send_keys(Keys.HOME, Keys.ARROW_LEFT)
    assert run(report, "[timeline.from, timeline.to]") == [0, length]
    marks = run(report,
                "[...document.querySelectorAll('.axis span')].map(mark => mark.textContent)")
    assert len(marks) > 3 and all(re.fullmatch(r"\d\d:\d\d:\d\d", mark) for mark in marks)


@pytest.mark.slow
def test_a_visit_is_shown_on_the_timeline(report, told):
    report.execute_script(
        "visits[6].open = true; document.querySelector('button[data-visit=\"6\"]').click()")
    number, began, _, ended, _ = told.data["visits"][5]
    assert number == 6 and run(report, "[timeline.from, timeline.to]") == [began, ended]
    texts = run(report, "[...timeline.lanes[2].row.lastChild.children].map(bar => bar.title)")
    assert texts[0].startswith("Steps: ") and any("waiting for a visitor" in text for text in texts)
    # what a click on a bar tells
    report.execute_script("timeline.lanes[0].row.lastChild.lastChild.click()")
    assert run(report, "byId('detail').innerText").startswith("Visits: Visitor 6, at ")


@pytest.mark.slow
def test_no_bar_is_lost_when_those_that_touch_are_drawn_as_one(report):
    counts = report.execute_script("""
        const count = bars => bars.reduce((sum, bar) => sum + bar.count, 0);
        return timeline.lanes.slice(3, 12).map(
          lane => [lane.bars, timeline.merged(lane.bars, 500 / data.length)].map(count))""")
    assert len(counts) == 9 and all(all_of == merged > 0 for all_of, merged in counts)


@pytest.mark.slow
def test_a_link_unfolds_what_it_leads_to(report):
    report.execute_script("byId('tree').querySelectorAll('.fold').forEach(each => each.click())")
    report.execute_script("visits[1].open = true; visits[1].querySelector('.told a').click()")
    wait = "byId(location.hash.slice(1))"
    wait_until(lambda: run(report, wait + " !== null && " + wait + ".offsetParent !== null"))
    hidden = run(report, "document.querySelector('#tree .bare').id")
    assert run(report, "byId(arguments[0]).offsetHeight", hidden) == 0
    report.execute_script("location.hash = arguments[0]", hidden)
    wait_until(lambda: run(report, "byId(arguments[0]).offsetHeight > 0", hidden))
    assert run(report, "byId('all').getAttribute('aria-pressed')") == "true"


@pytest.mark.slow
def test_a_node_opens_with_what_stands_in_the_file_and_all_its_results(report, day):
    lines = read_record(day)
    uid = next(uid for uid, node in enumerate(lines[0].event.nodes, 1) if node.type == "Navigate")
    events = [each for each in events_of(day) if isinstance(each, LeafFinished) and each.uid == uid
              or isinstance(each, Retried) and each.path == lines[0].event.nodes[uid - 1].path]
    failures = [each.failure for each in events if each.failure is not None]
    assert len(events) > len(failures) == 3
    name = report.find_element("css selector", "#n{} .name".format(uid))

    def click(one):
        report.execute_script("arguments[0].scrollIntoView({block: 'center'})", one)
        one.click()

    click(name)
    panel = report.find_element("css selector", "#n{} .node".format(uid))
    assert "Navigate: " + registry()["Navigate"].description in panel.text
    line = panel.text.split("lab_tour.xml:")[1].split()[0]
    assert panel.find_element("css selector", "dd a").get_attribute("href").endswith("#f0-" + line)
    row = panel.find_element("css selector", "tbody tr")
    assert row.text == "target not given, means {@targetLocation}"
    button = panel.find_element("css selector", ".node > button")
    shown = [row.text for row in panel.find_elements("css selector", ".results li")]
    assert button.text == "Show {} older ones".format(len(events) - len(shown))
    click(button)
    shown = [row.text for row in panel.find_elements("css selector", ".results li")]
    assert len(shown) == len(events)  # a drive takes longer than what is drawn as one
    assert [sum(words in row for row in shown) for words in ("failure after ", "↻ a retry failed: ")
            ] == [1, 2]
    assert [row.split(": ")[-1].rsplit(" visitor")[0] for row in shown if " success " not in row
            ] == ["not reachable, no node offers it (/robotNavigation/set_goal)"] * 3
    assert re.fullmatch(r"\d\d:\d\d:\d\d ✔ success after 1\d s visitor 1", shown[-1])
    click(name)
    assert not panel.is_displayed()


@pytest.mark.slow
def test_paper_is_white_and_has_all_visits_and_all_of_the_timeline(report):
    report.execute_cdp_cmd("Emulation.setEmulatedMedia", {
        "media": "print", "features": [{"name": "prefers-color-scheme", "value": "dark"}]})
    report.execute_script(
        "dispatchEvent(new Event('beforeprint')); byId('lanes').style.width = '450px'")
    assert run(report, "visits.every(visit => visit.open)")
    color = run(report, "getComputedStyle(document.querySelector('.told span')).color")
    assert color == "rgb(22, 32, 43)"  # as in light mode
    ends = run(report, "[timeline.lanes[0].row.lastChild.lastChild, byId('lanes')].map("
                       "each => each.getBoundingClientRect().right)")
    assert abs(ends[0] - ends[1]) < 1.0  # the last visit ends where the run does
    report.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": ""})
    report.execute_script("dispatchEvent(new Event('afterprint'))")
    assert run(report, "visits.filter(visit => visit.open).length") == 0


@pytest.mark.parametrize("uid, finished", [(1, [{"S": 1}]), (0, [{}]), (2, [{}])])
def test_a_mission_may_be_one_leaf_and_results_of_nodes_that_are_not_there_are_left_out(
        uid, finished):
    sources = Sources((), Source("", ""), Source("", ""), "")
    run = Drawn(1.0, RunStarted("m.xml", [], {}, sources),
                TreeShown("M", [TreeNode("Say", "Say", "Say", 0)]))
    run.take(2.0, LeafFinished(uid, "Say", "Say", "SUCCESS", "", 1.0, None))
    run.take(2.0, Retried("Say", "Gone", 1, Failure(Cause.REFUSED, "", "")))
    assert run.finished == finished
    assert [key for key, _ in run.lanes] == ([0, 1] if uid == 1 else [0])


MOMENT = """
const text = id => byId(id).textContent;
return {kind: byId("card").dataset.kind, what: text("now"), place: text("place"), instruction: text("instruction"),
        signs: [...document.querySelectorAll("#tree li[id] > .row")].map(row => row.querySelector(".then").className.slice(5)).join(""),
        stops: [...byId("stops").children].map(one => one.className.replace("-", " ")),
        told: [...document.querySelectorAll("#transcript [data-number]")].map(one => Number(one.dataset.at)),
        entries: Object.fromEntries([...byId("blackboard").rows].map(row => [...row.cells].map(cell => cell.textContent)))}"""
SCRUB = """
const scrub = byId("scrub");
scrub.value = arguments[0];
scrub.dispatchEvent(new Event("input"))"""


@pytest.mark.slow
def test_any_moment_of_the_run_is_shown(report, day):
    run = Run(read_record(day))
    began, ended = run.lines[0].time, run.lines[-1].time
    for part in (0.02, 0.11, 0.3, 0.52, 0.75, 0.97, 1.0):
        at = began + part * (ended - began)
        state = run.at(at)
        report.execute_script(SCRUB, at)
        expected = card(state)
        wait_until(lambda: report.execute_script(MOMENT)["signs"] == state.letters and
                   report.execute_script(MOMENT)["what"] == expected.what)
        seen, robot = report.execute_script(MOMENT), robot_line(state)
        assert (seen["kind"], seen["place"], seen["instruction"]) == (
            expected.kind, robot.place, robot.instruction)
        assert seen["stops"] == [each.state for each in state.visit.stops]
        assert report.execute_script(IS_WHOLE, ["instruction"])
        assert set(seen["entries"]) - {"none"} == set(state.entries)
        assert not seen["told"] or max(seen["told"]) <= at + 0.001
    assert len(run.visits) == len(KINDS)
    # what was done about a failure stands beneath it
    assert report.execute_script(
        "return document.querySelectorAll('#transcript details').length") > 0


@pytest.mark.slow
def test_bars_and_sentences_choose_their_moment(report, day):
    moment = "return byId('moment').textContent"
    sentence = report.execute_script("""
        const one = document.querySelectorAll(".told time")[30];
        one.closest("details").open = true;
        one.click();
        return one.textContent""")
    wait_until(lambda: report.execute_script(moment) == sentence)
    bar = report.execute_script("""
        timeline.showAll();
        const bar = document.querySelectorAll(".lane .bar.S")[2];
        bar.click();
        return bar.title""")
    wait_until(lambda: report.execute_script(moment) == re.search(r"at (\d\d:\d\d:\d\d)", bar)[1])
    assert report.execute_script("return document.querySelector('.cursor').hidden") is False
    report.execute_script("byId('live').click()")
    wait_until(lambda: report.execute_script(MOMENT)["kind"] == "ended")
