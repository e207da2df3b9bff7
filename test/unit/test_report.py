"""The report of a recorded run tells all of it, in the right places, and nothing in a record is taken for HTML."""
import copy
import html.parser
import json
import re

import pytest

from behavior_controller.errors import MissionError
from behavior_controller.gateway import Cause, Failure
from behavior_controller.interface.document import ATTENTION, FACES
from behavior_controller.interface.records import AttentionStatus, Faces, GoTo, Say, SetAttention
from behavior_controller.watch.codec import FORMAT, VERSION, decode
from behavior_controller.watch.record import Record
from behavior_controller.watch.replay import read_record
from behavior_controller.watch.report import DEEPEST, to_html
from mission_rig import Rig, service_of, visitor_who

FAILED = {"cause": "refused", "message": "a chair is in the way", "resource": "/s"}


def record_of(folder, visitor, answer=lambda request: NotImplemented, runs=1):
    """Run the lab tour, and return the lines of its record."""
    rig = Rig(answer=answer)
    record = Record(str(folder), rig.clock, pytest.fail)
    rig.mission.events.subscribe(record)
    record.show(rig.tree)
    rig.mission.gateway, rig.mission.topics = record.gateway(rig.gateway), record.topics(rig.topics)
    rig.run(visitor, runs=runs)
    record.close()
    return read_record(record.path)


class Page(html.parser.HTMLParser):
    """The tables of a report as lists of rows of texts, its tags and titles."""

    def __init__(self, text):
        super().__init__()
        self.tables, self.tags, self.titles, self._depth, self.deepest, self._is_in_cell = [], [], [], 0, 0, False
        self.feed(text)
        assert self._depth == 0

    def handle_starttag(self, tag, attributes):
        self.tags.append(tag)
        self.titles += [value for name, value in attributes if name == "title"]
        if tag == "table":
            self.tables.append([])
        elif tag == "tr":
            self.tables[-1].append([])
        elif tag in ("td", "th"):
            self.tables[-1][-1].append("")
            self._is_in_cell = True
        if tag not in ("meta", "br"):
            self._depth += 1
            self.deepest = max(self.deepest, self._depth)

    def handle_endtag(self, tag):
        self._depth -= 1
        self._is_in_cell = self._is_in_cell and tag not in ("td", "th")

    def handle_data(self, data):
        if self._is_in_cell:
            self.tables[-1][-1][-1] += data


def table(text, head):
    """Return the rows of the table whose first row has ``head``."""
    return next(rows[1:] for rows in Page(text).tables if head in rows[0])


def lines_of(*more, nodes=(["A::1", "A", "A", 0],), mission="/m/first.xml"):
    """Return a record written by hand, which begins at 100 s."""
    keys = ("path", "type", "name", "parent")
    source = {"file": mission, "text": "-"}
    return [{"event": "TreeShown", "time": 100.0, "id": "M", "nodes": [dict(zip(keys, node)) for node in nodes]},
            {"event": "RunStarted", "time": 100.0, "mission": mission, "leaves": [], "settings": {"missionRuns": 1},
             "sources": {"documents": [source], "phrases": source, "policy": source, "interface": "R",
                         "knowledge": []}}] + list(more)


HEADER = {"event": "Header", "time": 100.0, "format": FORMAT, "version": VERSION, "pid": 1}


def page_of(lines, file="the record"):
    """Return the report of a record written by hand."""
    return to_html(decode("".join(json.dumps(line) + "\n" for line in [HEADER] + lines).encode(), file))


def tick(*changes):
    return {"event": "Tick", "time": 107.0, "at": 7.0, "first": True, "changes": changes}


def gone(when):
    return {"event": "HealthChanged", "time": when, "kind": "service", "name": "/s", "node": "n", "status": "gone",
            "is_well": False, "consequence": "-", "respect": "gone"}


def finished(when, status="SUCCESS", seconds=0.5, path="A::1", failure=None, uid=1):
    return {"event": "LeafFinished", "uid": uid, "time": when, "node": "A", "path": path, "status": status, "resource": "",
            "seconds": seconds, "failure": failure}


# ------------------------------------------------------------------------------------------------------ all of it is told


def test_a_run_of_many_results_is_told_to_its_end():
    ticks = [finished(100.0 + 0.01 * number, "SUCCESS" if number % 3 else "FAILURE", 0.001) for number in range(1, 3401)]
    passes = [{"event": "PassFinished", "time": 100.0 + 1.7 * n, "number": n, "outcome": "SUCCESS", "seconds": 1.7}
              for n in range(1, 21)]
    text = page_of(lines_of(*ticks, *passes))
    assert "Timeline of 34.0 s" in text and len(table(text, "visitor")) == 20
    counts = [(title.split()[-3], int(title.split()[0]) if "×" in title else 1)
              for title in Page(text).titles if title.endswith(" s")]
    assert {status: sum(count for each, count in counts if each == status) for status in ("SUCCESS", "FAILURE")} == {
        "SUCCESS": 2267, "FAILURE": 1133}
    assert text.count('class="bar') < 2 * 400 + 2


def test_a_bar_stands_where_its_result_was():
    text = page_of(lines_of(finished(102.0, seconds=1.0), finished(104.0, "FAILURE", 0.5, failure=FAILED),
                            finished(110.0, "IDLE", 2.0)))
    assert re.findall(r'class="bar (\w)" style="left:([\d.]+)%;width:([\d.]+)%" title="([^"]*)"', text) == [
        ("S", "10.00", "10.00", "SUCCESS 1.000 s"), ("F", "35.00", "5.00", "FAILURE 0.500 s"),
        ("h", "80.00", "20.00", "IDLE 2.000 s")]


def test_results_that_lie_nearer_than_a_400th_of_the_run_are_one_bar():
    text = page_of(lines_of(finished(110.0), finished(111.25), finished(112.75), finished(500.0)))  # the run took 400 s
    assert re.findall(r'class="bar S" [^>]* title="([^"]*)"', text) == [
        "2 × SUCCESS 1.750 s", "SUCCESS 0.500 s", "SUCCESS 0.500 s"]


def test_failures_recoveries_and_notices_are_told_in_order_with_their_causes():
    recovered = {"event": "Recovered", "time": 104.0, "node": "A", "path": "A::1", "failure": FAILED,
                 "policy": "retry 1x, then skip", "attempts": 1, "success": True, "outcome": "skipped"}
    handled = dict(finished(104.0, "FAILURE", failure=FAILED), node="HandleFallBack")  # told by what it decided
    text = page_of(lines_of(
        finished(101.0), finished(102.0, "FAILURE", failure=FAILED),
        finished(102.5, "FAILURE", failure=dict(FAILED, cause="condition-false")),
        {"event": "Retried", "time": 103.0, "node": "A", "path": "A::1", "attempt": 1, "failure": FAILED}, recovered,
        handled, gone(105.0),
        {"event": "Noticed", "time": 106.0, "level": "warning", "text": "the mission busy-loops"},
        tick()))
    assert table(text, "what") == [
        ["2.0 s", "A::1 failed: refused: a chair is in the way"], ["3.0 s", "A::1: retry 1 failed: refused"],
        ["4.0 s", "A::1: recovery: skipped (retry 1x, then skip), for refused: a chair is in the way"],
        ["5.0 s", "service /s: gone"], ["6.0 s", "warning: the mission busy-loops"]]


def test_each_node_has_the_count_of_its_results():
    nodes = (["S", "Sequence", "S", 0], ["A::2", "A", "A", 1], ["B::3", "B", "B", 1])
    ticks = [tick([1, "R"], [2, letter]) for letter in "SFSSR"]
    text = page_of(lines_of(*ticks, nodes=nodes))
    items = {part[:part.index('"')]: part for part in text.split('<li class="node" title="')[1:]}
    assert re.findall(r"(.)</span>&thinsp;(\d+)", items["A::2"]) == [("✔", "3"), ("✘", "1")]
    assert "never" in items["B::3"] and "never" not in items["A::2"]


def test_a_node_is_told_by_its_name_and_by_its_type_if_that_is_another():
    text = page_of(lines_of(nodes=(["S", "Sequence", "the tour", 0], ["A::2", "A", "A", 1])))
    labels = [re.sub("<[^>]*>", " ", part).split() for part in text.split('<li class="node" title="')[1:]]
    assert [label[1:-1] for label in labels] == [["the", "tour", "Sequence"], ["A"]]


def test_of_a_mission_that_was_changed_the_last_one_is_reported_and_the_first_is_named():
    lines = lines_of(finished(101.0)) + lines_of(
        finished(103.0, path="B::1"), tick([2, "S"]), mission="/m/second.xml",
        nodes=(["B::1", "B", "B", 0], ["C::2", "C", "C", 1]))
    text = page_of(lines)
    assert "<h1>Mission second.xml</h1>" in text and "/m/first.xml, which this report leaves out" in text
    assert "C::2" in text and "A::1" not in text and "Timeline of 3.0 s" in text


@pytest.mark.parametrize("more, expected", [
    ([], "the record ends before the run"),
    ([{"event": "RunFinished", "time": 101.0, "outcome": "stopped; last pass: none", "exit_code": 0}], "ended: stopped; last pass: none")])
def test_how_the_run_ended(more, expected):
    assert expected in page_of(lines_of(*more))


# --------------------------------------------------------------------------------------------------- exhibits left out


def refusing_the_drive_to(x):
    return lambda request: Failure(Cause.REFUSED, "blocked", service_of(request)) if (
        isinstance(request, GoTo) and request.goal.x == x) else NotImplemented


def no_gaze_at(x):
    def visitor(rig):
        goals = [request.goal.x for request in rig.requests if isinstance(request, GoTo)]
        visitor_who(says="yes", gazes=goals[-1:] != [x])(rig)
    return visitor


def gone_after_the_first_exhibit(rig):
    scans = [place for place, request in enumerate(rig.requests) if request == SetAttention("scanning")]
    if not any(isinstance(request, GoTo) and request.goal.x == 2 for request in rig.requests[scans[-1]:]):
        visitor_who(says="yes")(rig)
    else:
        rig.clock.advance(0.5)
        rig.topics.publish(FACES, Faces((), ()))
        rig.topics.publish(ATTENTION, AttentionStatus("seeking", 3))


@pytest.mark.parametrize("visitor, answer, expected", [
    (visitor_who(says="yes"), lambda request: NotImplemented, [""]),
    (visitor_who(says="no"), lambda request: NotImplemented, [""]),
    (no_gaze_at(2), lambda request: NotImplemented,
     ["exhibit 2: IsMutualGazeDiscovered: condition false: the visitor did not look at the robot; skipped (skip)"]),
    (visitor_who(says="yes"), refusing_the_drive_to(1),
     ["exhibit 1: Navigate: refused: blocked; given up (give up)", "exhibit 2: it was not driven to"]),
    (gone_after_the_first_exhibit, lambda request: NotImplemented,
     ["exhibit 2: IsVisitorDiscovered: condition false: no face in view; given up (give up)"]),
    (visitor_who(says="yes"), lambda request: Failure(Cause.REFUSED, "hoarse", service_of(request)) if (
        isinstance(request, Say) and "text 1" in request.text) else NotImplemented,
     ["exhibit 1: DescribeExhibitSpeech: refused: hoarse; skipped (retry 1x, then skip)"]),
], ids=["none", "no tour", "no gaze", "no drive", "visitor gone", "hoarse"])
def test_why_an_exhibit_was_left_out(tmp_path, visitor, answer, expected):
    text = to_html(record_of(tmp_path, visitor, answer, runs=2))
    cells = re.findall(r"<td>[\d.]+ s</td><td>(.*?)</td>", text)
    assert cells == ["<br>".join(expected)] * 2


# ----------------------------------------------------------------------------------------------- records that were changed


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


LOCATION = {"x": 1.0, "y": 2.0, "theta_deg": 90.0}
EXHIBIT = {"name": "cup", "description1": "a cup", "description2": "an old cup", "location": LOCATION,
           "gesture": {"x": 1.0, "y": 1.0, "z": 1.0}}
ONE_OF_EACH = lines_of(
    {"event": "Asked", "time": 100.0, "call": 1, "service": "/k", "request": ["QueryKnowledge", {"what": "exhibits"}]},
    {"event": "Answered", "time": 100.0, "call": 1, "result": ["Answer", {"response": "", "exhibits": [EXHIBIT]}]},
    {"event": "Asked", "time": 101.0, "call": 2, "service": "/n", "request": ["GoTo", {"goal": LOCATION}]},
    {"event": "Answered", "time": 101.0, "call": 2, "result": ["Failure", FAILED]},
    {"event": "Asked", "time": 101.0, "call": 3, "service": "/t", "request": ["Say", {"text": "hello", "language": "English"}]},
    {"event": "Answered", "time": 101.0, "call": 3, "result": ["Answer", {"response": "", "exhibits": []}]},
    tick([1, "S"]),
    finished(101.5, "FAILURE", failure=FAILED),
    {"event": "Retried", "time": 102.0, "node": "A", "path": "A::1", "attempt": 1, "failure": FAILED},
    {"event": "Recovered", "time": 103.0, "node": "A", "path": "A::1", "failure": FAILED, "policy": "skip",
     "attempts": 1, "success": True, "outcome": "skipped"},
    finished(103.0),
    gone(104.0),
    {"event": "Noticed", "time": 105.0, "level": "info", "text": "hello"},
    {"event": "PassFinished", "time": 106.0, "number": 1, "outcome": "SUCCESS", "seconds": 6.0},
    {"event": "RunFinished", "time": 106.0, "outcome": "stopped", "exit_code": 0})


@pytest.mark.parametrize("to", [EVIL, None, [], {}, True, -1, 10 ** 400, float("nan"), "\ud800"],
                         ids=["script", "null", "list", "object", "true", "-1", "huge", "nan", "surrogate"])
def test_whatever_stands_in_a_record_is_text_or_is_refused(to):
    assert "cup: A: refused: a chair is in the way; skipped (skip)" in page_of(ONE_OF_EACH)
    for number, line in enumerate(ONE_OF_EACH):
        for path in places_in(line):
            lines = ONE_OF_EACH[:number] + [changed(line, path, to)] + ONE_OF_EACH[number + 1:]
            try:
                text = page_of(lines)
            except MissionError as error:
                named = re.match(r"the record:(\d+):1: this is no line of a record: ", str(error))
                assert number + 2 <= int(named[1]) and "\n" not in str(error), (line, path)
            else:
                assert "script" not in Page(text).tags and text.encode()


@pytest.mark.parametrize("lines, expected", [
    (lines_of({"event": "PassFinished", "time": 1, "number": EVIL, "outcome": "S", "seconds": 1}),
     "r.jsonl:4:1: this is no line of a record: number is not an integer"),
    (lines_of({"event": "PassFinished", "time": 1, "number": True, "outcome": "S", "seconds": 1}), "number is not an int"),
    (lines_of({"event": "PassFinished", "time": 1, "number": 1, "outcome": "S"}), "seconds is missing"),
    (lines_of()[:1] + [changed(lines_of()[1], ("sources", "documents"), [])], "sources.documents is empty"),
    (lines_of({"event": ["Tick"]}), "it has no event"),
    (lines_of(tick([2, "S"])), "the tree has only 1 nodes"),
    (lines_of(tick([1, "s"])), "changes[0][1] is not one of -, R, S, F"),
    (lines_of(tick([1])), "changes[0] has 1 entries, not 2"),
    (lines_of(dict(tick(), time=1e12)), "time is no time"),
    (lines_of(dict(tick(), at=float("inf"))), "at is not a number"),
    (lines_of(nodes=(["A", "A", "A", 1],)), "a node's parent does not come before it"),
    (lines_of(nodes=(["A", "A", "A", 0], ["A", "A", "A", 0])), "a node's parent does not come before it"),
    (lines_of()[::-1], "no tree comes before it"),
    (lines_of({"event": "Answered", "time": 1, "call": 1, "result": ["Answer", {"response": "", "exhibits": [{}]}]}),
     "result[1].exhibits[0].name is missing"),
    (lines_of({"event": "Answered", "time": 1, "call": 0, "result": ["Dance", {}]}), "call is not an integer from 1 on"),
    (lines_of({"event": "Answered", "time": 1, "call": 1, "result": ["Dance", {}]}), "result[0] is not one of Answer, Fail"),
    (lines_of({"event": "Message", "time": 1, "topic": "/x", "read": 1, "value": None, "arrived": 1}),
     "topic is not one of the interface's"),
    (lines_of({"event": "Message", "time": 1, "topic": "/faceDetection/data", "read": 1, "arrived": 1, "value": {
        "labels": ["1"], "mutual_gaze": [1]}}), "value.mutual_gaze[0] is not true or false"),
    (lines_of(finished(101.0, failure={"cause": "refused"})), "failure.message is missing"),
])
def test_a_line_that_the_node_cannot_have_written_is_named(lines, expected):
    with pytest.raises(MissionError) as raised:
        page_of(lines, "r.jsonl")
    assert expected in str(raised.value) and "\n" not in str(raised.value)


def test_a_tree_of_many_levels_is_reported():
    nodes = [["N::{}".format(number), "N", "N", number - 1] for number in range(1, 2001)]
    page = Page(page_of(lines_of(tick([2000, "S"]), nodes=nodes)))
    assert page.tags.count("li") == 2000 and page.deepest < 3 * DEEPEST + 20
    assert page.tags.count("details") == 99  # the hundredth level has no other below it
