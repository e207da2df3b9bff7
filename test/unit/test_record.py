"""The record: one JSON object a line, complete, and never a danger to the run."""
import itertools
import json
import os
import threading
import time
import types

import pytest

from behavior_controller.run.observed_gateway import ObservedGateway
from behavior_controller.run.events import (
    LeafFinished, Lost, Message, Noticed, PassFinished, RunStarted, Sources)
from behavior_controller.robot.gateway import Cause, Failure, FakeGateway, FakeTopics, Sample
from behavior_controller.robot.d543 import INTERFACE, SPEECH
from behavior_controller.robot.requests import Answer, Exhibit, Location, Point, Say
from behavior_controller.text import Source
from behavior_controller.run.record import feed as feed_module, recorder as module
from behavior_controller.run.record.feed import Entries, Feed, entry_text
from behavior_controller.run.record.recorder import LineQueue, Record
from behavior_controller.run.record.tree_shown import shown
from mission_rig import FileRecord, Rig, one_leaf, written


def lines(record):
    """Return the lines after the header."""
    record.close()
    with open(record.path, encoding="utf-8") as file:
        header, *found = [json.loads(line) for line in file]
    assert (header["format"], header["version"], header["pid"]) == ("behaviorController record", 11,
                                                                    os.getpid())
    return [line["event"] for line in found]


def test_events_are_written_as_they_happen(tmp_path):
    record = FileRecord(str(tmp_path / "new folder")).open()
    record(RunStarted("/m.xml", [("a", "Navigate")], {"asrEnabled": True},
                      Sources((Source("/m.xml", "<root/>"),), Source("/p.ini", "yes yes\n"),
                              Source("/r.ini", "budget 1 1\n"), "R")))
    record(LeafFinished(7, "Navigate", "go/a", "FAILURE", "/robotNavigation/set_goal", 0.5,
                        Failure(Cause.REFUSED, "no", "/robotNavigation/set_goal")))
    first, second = lines(record)
    assert (first["_type"], first["leaves"], first["settings"]) == (
        "RunStarted", [["a", "Navigate"]], {"asrEnabled": True})
    assert first["sources"] == {
        "documents": [["/m.xml", "<root/>"]], "phrases": ["/p.ini", "yes yes\n"],
        "policy": ["/r.ini", "budget 1 1\n"], "interface": "R", "knowledge": []}
    assert second["failure"] == {"_type": "Failure", "cause": "refused", "message": "no",
                                 "resource": "/robotNavigation/set_goal", "unheard": None}
    assert (second["node"], second["path"], second["status"],
            second["seconds"]) == ("Navigate", "go/a", "FAILURE", 0.5)


def test_a_folder_that_cannot_be_written_is_one_complaint(tmp_path):
    (tmp_path / "file").write_text("")
    complaints = []
    record = FileRecord(str(tmp_path / "file"), complaints.append).open()
    record(PassFinished(1, "SUCCESS", 1.0))
    record.close()
    assert not (record.is_kept or record.path)
    assert complaints == [
        f"no record is written to {tmp_path / 'file'}: File exists; it is tried again, the mission "
        "goes on"]


@pytest.mark.parametrize("is_writable", [True, False])
def test_a_record_waits_no_longer_for_the_disk_than_until_it_is_open_or_has_failed(
        tmp_path, monkeypatch, is_writable):
    monkeypatch.setattr(module, "OPENING", 6.0)
    if not is_writable:
        (tmp_path / "place").write_text("")
    began = time.monotonic()
    record = FileRecord(str(tmp_path / "place"), lambda complaint: None).open()
    assert time.monotonic() - began < 5.0 and bool(record.path) is is_writable
    record.close()
    record(PassFinished(1, "SUCCESS", 1.0))
    assert list(record.lines()) == [] and not record.is_kept  # nothing is kept for it


def test_what_happened_before_it_was_opened_is_handed_over_too():
    queue = LineQueue()
    record = Record(queue)
    record(PassFinished(1, "SUCCESS", 1.0))
    assert list(queue.take()) == []
    record.open().close()
    assert [line.event for line in queue.take()] == [PassFinished(1, "SUCCESS", 1.0)]


def test_what_happened_is_in_the_file_before_the_node_ends(tmp_path):
    record = FileRecord(str(tmp_path)).open()
    # a disk may hang
    assert [thread.daemon for thread in threading.enumerate() if
            thread.name.startswith("record")] == [True, True]
    record(PassFinished(1, "SUCCESS", 1.0))
    ends = time.monotonic() + 10.0
    while not os.path.exists(record.path) or os.path.getsize(record.path) < 160:
        assert time.monotonic() < ends
        time.sleep(0.01)
    assert record.is_kept and os.stat(record.path).st_mode & 0o111 == 0
    with open(record.path, "rb") as file:
        data = file.read()
    assert data.count(b"\n") == 2 and b"PassFinished" in data
    record.close()


def test_what_does_not_fit_into_the_queue_of_a_disk_is_counted_where_it_is_missing(
        tmp_path, monkeypatch):
    # until it is closed, as if the disk were that slow
    monkeypatch.setattr(module, "RECORD_INTERVAL", 60.0)
    monkeypatch.setattr(module, "MOST_FOR_DISK", 10)
    complaints = []
    record = FileRecord(str(tmp_path), complaints.append).open()
    for number in range(12):
        record(PassFinished(number, "SUCCESS", 1.0))
    found = [line.get("number", line["_type"]) for line in lines(record)]
    assert found == [*range(10), "Lost"]
    assert complaints == [f"the record {record.path} lacks 2 lines: the disk is too slow; the "
                          "mission goes on"]


@pytest.mark.slow
def test_a_disk_that_hangs_keeps_no_other_output_and_not_the_end_of_the_run(tmp_path, monkeypatch):
    is_met, returns, queue, found = threading.Event(), threading.Event(), LineQueue(), []
    monkeypatch.setattr(module.files.os, "pwrite", lambda file, data, place: (
        is_met.set(), returns.wait(60.0)) and len(data))
    record = FileRecord(str(tmp_path)).open()
    record.add(queue)
    assert is_met.wait(10.0)
    began = time.monotonic()
    for number in range(3):
        record(PassFinished(number, "SUCCESS", 1.0))
        while len(found) <= number:
            assert time.monotonic() - began < 10.0
            found += [line.event.number for line in queue.take()]
    record(PassFinished(3, "SUCCESS", 1.0))
    began = time.monotonic()
    module.Record.close(record)  # as the node does
    assert time.monotonic() - began < 2 * module.CLOSING_LIMIT + 0.5 and record.is_kept
    assert found + [line.event.number for line in queue.take()] == [0, 1, 2, 3]
    returns.set()
    written(record)


def test_a_feed_says_where_events_are_missing(monkeypatch):
    monkeypatch.setattr(feed_module, "MOST_EVENTS", 10)
    feed, found = Feed(), []
    for number in range(20):
        if number == 12:  # some of them are taken
            found.extend(itertools.islice(feed.lines(), 4))
        feed(PassFinished(number, "SUCCESS", 1.0))
    feed.note_loss()
    found.extend(feed.lines())
    events = [line.event for line in found]
    assert [event.lines if isinstance(event, Lost) else -event.number for event in events] == [
        *range(0, -10, -1), 2, -12, -13, -14, 5]
    feed.stop()
    feed(PassFinished(1, "SUCCESS", 1.0))
    assert list(feed.lines()) == []


def test_an_answer_is_recorded_once_when_it_is_seen(tmp_path):
    record = FileRecord(str(tmp_path)).open()
    answers = {}
    robot = FakeGateway(lambda: None, answers.get)
    gateway = ObservedGateway(robot, INTERFACE, record)
    early, late = gateway.start(Say("now")), gateway.start(Say("later"))
    assert early.result is None and late.result is None
    robot.calls[1].finish(Failure(Cause.REFUSED, "no", "/x"))
    assert late.result == late.result == Failure(Cause.REFUSED, "no", "/x") and early.result is None
    robot.calls[0].finish(Answer("1"))
    assert early.result == early.result == Answer("1")
    assert [(line["_type"], line["call"]) for line in lines(record)] == [
        ("Asked", 1), ("Asked", 2), ("Answered", 2), ("Answered", 1)]


def test_a_recorded_robot_drops_calls_and_wakes_as_it_does(tmp_path):
    record, woken = FileRecord(str(tmp_path)).open(), []
    robot, topics = FakeGateway(), FakeTopics(lambda: 7.0, lambda: woken.append(True))
    ObservedGateway(robot, INTERFACE, record).start(Say("now")).drop()
    assert robot.dropped == [Say("now")]
    recorded = record.topics(topics)
    topics.listen = lambda *wanted: woken.append(wanted)
    recorded.listen(SPEECH, 2.5, True)
    assert woken.pop() == (SPEECH, 2.5, True)
    recorded.wake_when("key", SPEECH, lambda text: text == "yes")
    for text in ("no", "yes"):
        topics.publish(SPEECH, text)
    assert woken == [True
                     ] and recorded.newest(SPEECH) == recorded.newest(SPEECH) == Sample("yes", 7.0)
    assert [(line["_type"], line.get("read"), line.get("value")) for line in lines(record)] == [
        ("Asked", None, None), ("Message", 1, "no"), ("Message", 1, "yes")]


def test_entries_are_recorded_when_they_were_written_and_when_they_have_gone(tmp_path):
    rig = Rig("<root BTCPP_format='4' main_tree_to_execute='M'><BehaviorTree "
              "ID='M'><Sequence><SubTree ID='Inner' name='inner'/><Sleep "
              "msec='9000'/></Sequence></BehaviorTree><BehaviorTree ID='Inner'><Script code='b := "
              "4'/></BehaviorTree></root>")
    board = rig.tree.blackboard
    record = FileRecord(str(tmp_path)).open()
    record.show(rig.tree)

    def tick(**entries):
        for name, value in entries.items():
            board.unset(name) if value is None else board.set(name, value)
        rig.tick()

    tick(a=1)
    tick()
    tick(a=1)
    board.unset("a")
    tick(a=1)
    tick(a=None)
    tick(c=[Location(1.0, 2.0, 3.0)] * 99)
    texts = [dict(line["entries"]) for line in lines(record) if line["_type"] == "EntriesWritten"]
    assert texts[:-1] == [{"a": "1", "inner/b": "4"}, {"a": "1"}, {"a": "1"}, {"a": None}]
    assert list(texts[-1]) == ["c"] and 100 < len(texts[-1]["c"]) <= 120


def test_what_was_written_to_entries_is_known_once():
    rig = one_leaf("<AlwaysSuccess/>")
    board, entries = rig.tree.blackboard, Entries(rig.tree)
    assert entries.news() == []
    board.set("a", 1)
    assert entries.news() == [("a", 1)] and entries.news() == []
    board.set("b", 2)
    board.set("a", 1)
    assert entries.news() == [("a", 1), ("b", 2)]
    board.unset("a")
    assert entries.news() == [("a", None)] and entries.news() == []


def test_a_place_that_cannot_be_and_odd_texts_stop_nothing(tmp_path):
    complaints = []
    FileRecord(str(tmp_path / "a\0b"), complaints.append).open().close()
    assert len(complaints) == 1 and "the mission goes on" in complaints[0]
    record = FileRecord(str(tmp_path / "odd")).open()
    record(Noticed("error", "\ud800 \x1b \U0001f916"))
    assert lines(record)[0]["text"] == "\ud800 \x1b \U0001f916"


class Unprintable:
    """A value of a foreign message."""

    def __str__(self):
        raise RuntimeError("no text")


@pytest.mark.parametrize("make", [
    lambda: Message(SPEECH.name, 1, Unprintable(), 1.0), lambda: Noticed("info", 2000 * "x"),
    lambda: feed_module.written(("a", Unprintable()))])
def test_a_line_that_cannot_be_written_is_missing_and_the_rest_is_there(tmp_path, monkeypatch,
                                                                       make):
    monkeypatch.setattr(module, "LONGEST_LINE", 1000)
    record = FileRecord(str(tmp_path)).open()
    record(Noticed("info", "one"))
    record.put(make)
    record(Noticed("info", "two"))
    assert [line.get("text", line.get("lines")) for line in lines(record)] == ["one", 1, "two"]


@pytest.mark.parametrize("value, expected", [
    (Location(1.0, -2.5, 90.0), "x 1 m, y -2.5 m, 90°"),
    (Point(1.0, 0.5, 2.0), "x 1 m, y 0.5 m, z 2 m"),
    ([Exhibit("cup", "", "", Location(1.0, 2.0, 3.0), Point(4.0, 5.0, 6.0)), "arm", 3],
     "cup, arm, 3"), ([], ""), (3.0, "3"), (2.5, "2.5"), (7, "7"), (True, "True"),
    (float("inf"), "inf"), ("a\nb", "a\\nb"), (120 * "x", 120 * "x")])
def test_the_value_of_an_entry_is_one_short_line(value, expected):
    assert entry_text(value) == expected
    assert len(entry_text(121 * "x")) <= 120


def test_of_a_node_are_kept_its_pause_and_what_follows_it():
    rig = Rig("<root BTCPP_format='4'><BehaviorTree ID='M'><Sequence name='all' _while='true'>"
              "<Sleep msec='1500'/><Sleep msec='{pause}'/><Delay delay_msec='250'>"
              "<AlwaysSuccess _skipIf='false'/></Delay></Sequence></BehaviorTree></root>")
    assert [(node.type, node.parent, node.pause, node.next) for node in shown(rig.tree).nodes] == [
        ("Sequence", 0, 0.0, (0,)), ("Sleep", 1, 1.5, (3,)), ("Sleep", 1, -1.0, ()),
        ("Delay", 1, 0.25, (0,)), ("AlwaysSuccess", 4, 0.0, (0,))]


def test_that_a_topic_is_still_heard_is_recorded_if_it_is(tmp_path):
    record = FileRecord(str(tmp_path)).open()
    hears = types.SimpleNamespace(is_hearing=lambda topic: answers.pop())
    answers, topics = [False, True, False], record.topics(hears)
    assert [topics.is_hearing(SPEECH) for _ in range(3)] == [False, True, False]
    assert [(line["_type"], line["topic"]) for line in lines(record)] == [
        ("RecognitionPending", SPEECH.name)]


def test_each_message_is_recorded_once_at_the_reading_that_saw_it_first(tmp_path):
    record, rig = FileRecord(str(tmp_path)).open(), one_leaf("<AlwaysSuccess/>")
    robot = FakeTopics(lambda: 7.0, lambda: None)
    topics = record.topics(robot)
    record.show(rig.tree)
    robot.publish(SPEECH, "a")
    topics.recent(SPEECH)
    topics.recent(SPEECH)
    robot.publish(SPEECH, "b")
    topics.recent(SPEECH)
    rig.tick()  # the readings are counted anew
    robot.publish(SPEECH, "c")
    assert [sample.value for sample in topics.recent(SPEECH)] == ["a", "b", "c"]
    assert [(line["read"], line["value"], line["arrived"]) for line in lines(record)
            if line["_type"] == "Message"] == [(1, "a", 7.0), (3, "b", 7.0), (1, "c", 7.0)]


def test_of_a_tree_that_is_shown_are_recorded_its_nodes_its_traversals_and_what_it_reads(tmp_path):
    record, rig = FileRecord(str(tmp_path)).open(), one_leaf("<AlwaysSuccess/>")
    robot = FakeTopics(lambda: 7.0, lambda: None)
    topics = record.topics(robot)
    robot.publish(SPEECH, "a")
    for tree in (one_leaf("<AlwaysFailure/>").tree, rig.tree):  # the next mission reads it anew
        record.show(tree)
        topics.recent(SPEECH)
    rig.tick()
    rig.tree.halt()  # between two traversals
    found = lines(record)
    assert [line["_type"] for line in found] == [
        "TreeShown", "SignOfLife", "Message", "TreeShown", "Message", "Tick", "Tick"]
    assert [(tick["first"], tick["changes"], tick["at"]) for tick in found[-2:]] == [
        (True, [[1, "S"]], rig.clock.now()), (None, [[1, "-"]], rig.clock.now())]
    assert [found[place]["number"] for place in (0, 3)] == [1, 2]
