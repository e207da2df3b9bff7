"""The values of a visit over time: what the lanes say is what the model of the run says."""
import json
import zlib
from base64 import b64decode

import pytest

from behavior_controller.robot.requests import SetAttention
from behavior_controller.run.events import (
    Answered, Asked, EntriesWritten, PassStarted, TopicSaid)
from behavior_controller.robot.requests import Answer
from behavior_controller.run.history import Run
from behavior_controller.run.record.reader import read_record
from behavior_controller.viewer import values
from behavior_controller.viewer.report import to_html
from behavior_controller.viewer.view import View
from recorded_tours import KINDS, recorded_day

FACES = "/faceDetection/data"


def value_at(changes, at):
    """Return the last text up to that time; empty: none."""
    return ([""] + [text for when, text in changes if when <= at])[-1]


def lanes_after(*told):
    """Return the view, and its lanes by name, after events with their times."""
    shown = View()
    for at, event in told:
        shown.take(at, event)
    return shown, {lane.name: lane.changes for lane in shown.values().lanes}


@pytest.fixture(name="day", scope="module")
def _day(tmp_path_factory):
    with pytest.MonkeyPatch.context() as patch:
        return recorded_day(tmp_path_factory.mktemp("values"), patch, len(KINDS))


def expected_of(state):
    """Return what the model says of the mode of attention, the answer and the entries."""
    expected, visit = {}, state.visit
    if state.robot.attention is not None:
        expected["attention"] = state.robot.attention.state
    if visit is not None and visit.ended is None and visit.asked is not None:
        expected["answer"] = visit.answer or "asked"
    times = state.tree.times
    expected.update(("{%s}" % name, text) for name, text in state.entries.items()
                    if name not in times)
    return expected


@pytest.mark.slow
def test_the_lanes_of_a_report_are_the_model_of_the_run_at_each_moment(day):
    lines = read_record(day)
    data = to_html(lines).partition('id="data">')[2].partition("</script>")[0]
    packed = json.loads(data)
    lanes, began = json.loads(zlib.decompress(b64decode(packed["values"]))), packed["began"] / 1000
    run = Run(lines)
    compared = set()
    for part in range(1, 100):
        at = began + part * (run.lines[-1].time - began) / 100
        for name, text in expected_of(run.at(at)).items():
            compared.add((name, text))
            shown = value_at(lanes[name], 1000 * (at - began) + 1)
            assert shown == (text[:len(shown)] or values.EMPTY), (name, at)
    assert {("attention", "scanning"), ("answer", "yes"), ("answer", "no")} <= compared
    assert len({name for name, _ in compared}) > 6


def test_a_lane_begins_anew_with_each_visit_and_ends_where_it_has_no_value():
    attention = [(1.0, Asked(1, "/a", SetAttention("seeking"))), (2.0, Answered(1, Answer()))]
    _, lanes = lanes_after(
        *attention, (3.0, EntriesWritten([("x", "1"), ("y", "")])), (4.0, PassStarted(1, 0.0)),
        (5.0, TopicSaid(FACES, "no face", 9.0)), (6.0, TopicSaid(FACES, "no face", 5.0)),
        (7.0, EntriesWritten([("x", None)])), (8.0, TopicSaid(FACES, "1 face", 5.0)))
    assert lanes == {"attention": [(4.0, "seeking")], "{x}": [(4.0, "1"), (7.0, "")],
                     "{y}": [(4.0, values.EMPTY)], FACES: [(5.0, "no face"), (8.0, "1 face")]}
    assert list(lanes)[-2:] == ["{x}", "{y}"]  # entries come last


def test_their_number_and_size_have_an_end():
    entries = [(0.5, EntriesWritten([("n", str(number))])) for number in range(1000)]
    others = [("e%d" % number, "x" * 1000) for number in range(100)]
    shown, lanes = lanes_after((0.0, PassStarted(1, 0.0)), *entries, (2.0, EntriesWritten(others)))
    assert len(lanes) == values.MOST_LANES
    assert shown.values().left_out == 101 - values.MOST_LANES  # and that is said
    assert [text for _, text in lanes["{n}"]] == list(map(str, range(900, 1000)))
    assert max(len(text) for changes in lanes.values() for _, text in changes) <= (
        values.LONGEST_VALUE)


def test_what_is_not_known_of_an_earlier_visit_is_not_filled_in():
    seen = [(0.0, PassStarted(1, 0.0)), (1.0, EntriesWritten([("n", "last")]))]
    first, _ = lanes_after(*seen)
    second, _ = lanes_after((10.0, PassStarted(2, 0.0)), *(
        (11.0 + number, EntriesWritten([("n", str(number))])) for number in range(200)))
    changes = values.joined([(0.0, first.values()), (10.0, second.values())])["{n}"]
    assert value_at(changes, 9.0) == "last" and value_at(changes, 50.0) == ""
    assert value_at(changes, 300.0) == "199"
