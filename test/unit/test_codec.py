"""What is written into a record comes back as it was, whatever the interface has to ask and to
tell."""
import pytest
from msgspec.structs import replace

from behavior_controller.errors import MissionError
from behavior_controller.run.events import (
    EVENTS, Answered, Asked, BaseEvent, LeafFinished, Line, Message, Noticed, OfNode, PassFinished,
    RunStarted, Sources, StepStarted, Tick, StopChanged, LeafSummary, TreeNode, TreeShown)
from behavior_controller.robot.gateway import Cause, Failure
from behavior_controller.robot.d543 import INTERFACE
from behavior_controller.robot.requests import (
    Answer, AttentionStatus, Exhibit, Faces, GoTo, Location, PerformGesture, Point, Prompt,
    QueryKnowledge, Request, Say, SetAnimation, SetAttention)
from behavior_controller.text import Source
from behavior_controller.run.record.codec import encode, header
from mission_rig import decode

REQUESTS = [
    SetAnimation("enabled"),
    PerformGesture("deictic", 3, 2000, Point(1.0, -2.5, 0.0)),
    QueryKnowledge("home"),
    SetAttention("location", Point(0.1, 0.2, 1e300)),
    GoTo(Location(1.5, -0.0, 90.0)),
    Prompt(("yes", "no")),
    Say("a \ud800 b\u2028\n")]
MESSAGES = [Message("/faceDetection/data", 1, Faces(("7", ""), (True, False)), 12.5),
            Message("/overtAttention/mode", 2, AttentionStatus("seeking", 2), 0.0),
            Message("/speechEvent/text", 3, "yes", 1.0)]
PLACE = Exhibit("cup", "a cup", "", Location(1.0, 2.0, 3.0), Point(4.0, 5.0, 6.0))
RESULTS = [Answer(), Answer("1", (PLACE, PLACE)), Failure(Cause.NO_ANSWER, "late", "/x")]
BEGIN = [TreeShown("M", [TreeNode("a", "A", "a", 0), TreeNode("b::2", "B", "B", 1)]),
         RunStarted("/m.xml", [("b::2", "B")],
                    {"asrEnabled": True, "missionRuns": 2, "topicMaxAge": 0.5, "language": "x"},
                    Sources((Source("/i.xml", "<i/>"), Source("/m.xml", "<m/>")), Source("p", "a"),
                            Source("r", ""), "R"))]


def written(events):
    return header(7, 0.5) + b"".join(encode(1.5, event) for event in events)


@pytest.mark.parametrize(
    "event", [Asked(1, "/s", request)
              for request in REQUESTS] + MESSAGES + [Answered(2, result) for result in RESULTS] + [
                  Tick(1.5, False, [(1, "R"), (2, "-")]),
                  PassFinished(1, "FAILURE", 2.0),
                  StepStarted(2, "B", "b::2", "driving", "to it", 3.5, False),
                  StopChanged(2, "B", "b::2", 1, 2, "cup", "begun"),
                  LeafFinished(2, "B", "b::2", "SUCCESS", "", 1.0, None, LeafSummary("said", "x"))
              ], ids=str)
def test_each_event_comes_back_as_it_was(event):
    lines = list(decode(written(BEGIN + [event]), "r"))
    assert lines == [Line(1.5, each) for each in BEGIN + [event]]


def test_each_kind_of_event_can_be_recorded():
    kinds = BaseEvent.__subclasses__() + OfNode.__subclasses__()
    assert set(EVENTS) == set(kinds) - {OfNode}


@pytest.mark.parametrize("old, new, fault", [
    ('"pid":7', '"pid":' + 18 * "9", ""), ('"pid":7', '"pid":' + 100_000 * "9", "no record"),
    ('"time":1.5', '"time":0', ""), ('"time":1.5', '"time":-0.5', "-0.5 is not a time"),
    ('"time":1.5', '"time":1e11', ""), ('"time":1.5', '"time":100000000001', "is not a time")])
def test_numbers_have_limits(old, new, fault):
    data = written(BEGIN).replace(old.encode(), new.encode())
    assert new.encode() in data
    if fault:
        with pytest.raises(MissionError, match=fault):
            list(decode(data, "r"))
    else:
        assert len(list(decode(data, "r"))) == len(BEGIN)


ROOT = BEGIN[0].nodes[0]


def trees(*parents):
    return TreeShown("M", [replace(ROOT, parent=parent) for parent in parents])


@pytest.mark.parametrize("events, place, fault", [
    ([], "r", "the record has no mission in it"),
    (BEGIN[:1], "r", "the record has no mission in it"),
    (BEGIN[1:], "r:2:1", "no tree comes before it"),
    ([BEGIN[0], replace(BEGIN[1], sources=replace(BEGIN[1].sources, documents=()))], "r:3:1",
     "the mission has no documents"),
    (BEGIN + [Tick(1.5, False, [(0, "R")])], "r:4:1", "the tree has only 2 nodes"),
    (BEGIN + [Tick(1.5, False, [(1, "R"), (3, "R")])], "r:4:1", "the tree has only 2 nodes"),
    # the running mission's nodes count
    (BEGIN + [trees(0), Tick(1.5, False, [(3, "R")])], "r:5:1", "the tree has only 2 nodes"),
    (BEGIN + [Asked(0, "/s", Say("a"))], "r:4:1", "calls count from 1"),
    (BEGIN + [Answered(0, Answer())], "r:4:1", "calls count from 1"),
    (BEGIN + [replace(MESSAGES[0], read=0)], "r:4:1", "reads count from 1"),
    ([trees()], "r:2:1", "a node's parent does not come before it"),
    ([trees(1)], "r:2:1", "a node's parent does not come before it"),
    ([trees(0, 0)], "r:2:1", "a node's parent does not come before it"),
    ([trees(0, 2)], "r:2:1", "a node's parent does not come before it"),
    ([trees(0, 1, 3)], "r:2:1", "a node's parent does not come before it")])
def test_what_the_node_cannot_have_written_is_refused_at_its_line(events, place, fault):
    with pytest.raises(MissionError) as caught:
        list(decode(written(events), "r"))
    assert str(caught.value).startswith(place + ": ") and fault in str(caught.value)


@pytest.mark.parametrize("events", [
    BEGIN + [Tick(1.5, False, [(1, "R"), (2, "R")])], BEGIN + [trees(0), BEGIN[0]],
    [trees(0, 1, 1, 3, 2)] + BEGIN, [Tick(1.5, None, [(9, "R")])] + BEGIN,
    BEGIN + [trees(0), Tick(1.5, False, [(2, "R")])]])
def test_what_the_node_can_have_written_is_read(events):
    assert [line.event for line in decode(written(events), "r")] == events


def test_a_line_that_was_torn_is_left_out():
    data = written(BEGIN + [Noticed("info", "so")])
    assert len(list(decode(data, "r"))) == 3
    assert len(list(decode(data[:-1], "r"))) == 2


@pytest.mark.parametrize("first, fault", [
    (b'{"format":"behaviorController record","version":9,"pid":1,"time":0.5}', "version 9; this"),
    (b'{"format":"other","version":10,"pid":1,"time":0.5}', "no record"),
    (b"{}", "no record"), (b"[]", "no record"), (b"{", "not a line of a record")])
def test_a_file_that_does_not_begin_as_a_record_is_refused(first, fault):
    with pytest.raises(MissionError, match=fault):
        list(decode(first + b"\n", "r"))


def test_letters_of_any_language_can_be_read_in_the_file():
    assert "Grüße, 展品".encode() in encode(0.5, Noticed("info", "Grüße, 展品"))


def test_all_that_the_interface_asks_and_tells_can_be_recorded():
    assert [service.request for service in INTERFACE.services if not issubclass(
        service.request, Request)] == []
    assert {type(request)
            for request in REQUESTS} <= {service.request for service in INTERFACE.services}
    assert {message.topic for message in MESSAGES} <= {topic.name for topic in INTERFACE.topics}
    for message in MESSAGES:
        assert type(message.value) is INTERFACE.topic(message.topic).value
