"""What is written into a record comes back as it was, whatever the interface has to ask and to tell."""
import dataclasses
import enum
from typing import Dict, List, Literal, NamedTuple, Optional, Tuple, Union

import pytest

from behavior_controller.errors import MissionError
from behavior_controller.events import (LeafFinished, Noticed, PassFinished, RunStarted, Sources, StepStarted, Told,
                                        TourAdvanced)
from behavior_controller.gateway import Cause, Failure
from behavior_controller.interface.document import INTERFACE
from behavior_controller.interface.records import (Answer, AttentionStatus, Exhibit, Faces, GoTo, Location,
                                                   PerformGesture, Point, Prompt, QueryKnowledge, Request, Say,
                                                   SetAnimation, SetAttention)
from behavior_controller.text import Source
from behavior_controller.watch.codec import (FORMAT, VERSION, Answered, Asked, Header, Line, Message, Tick, TreeNode,
                                             TreeShown, decode, encode)
from behavior_controller.watch.plain import Count, Wrong, form, inside

REQUESTS = [SetAnimation("enabled"), PerformGesture("deictic", 3, 2000, Point(1.0, -2.5, 0.0)), QueryKnowledge("home"),
            SetAttention("location", Point(0.1, 0.2, 1e300)), GoTo(Location(1.5, -0.0, 90.0)), Prompt(("yes", "no")),
            Say("a \ud800 b\u2028\n")]
MESSAGES = [Message("/faceDetection/data", 1, Faces(("7", ""), (True, False)), 12.5),
            Message("/overtAttention/mode", 2, AttentionStatus("seeking", 2), 0.0),
            Message("/speechEvent/text", 3, "yes", 1.0), Message("/speechEvent/text", 1, None, 0.0)]
PLACE = Exhibit("cup", "a cup", "", Location(1.0, 2.0, 3.0), Point(4.0, 5.0, 6.0))
RESULTS = [Answer(), Answer("1", (PLACE, PLACE)), Failure(Cause.NO_ANSWER, "late", "/x")]
BEGIN = [TreeShown("M", [TreeNode("a", "A", "a", 0), TreeNode("b::2", "B", "B", 1)]),
         RunStarted("/m.xml", [["b::2", "B"]], {"asrEnabled": True, "missionRuns": 2, "topicMaxAge": 0.5, "language": "x"},
                    Sources((Source("/i.xml", "<i/>"), Source("/m.xml", "<m/>")), Source("p", "a"), Source("r", ""), "R"))]


def written(entries, version=VERSION):
    return encode(0.5, Header(FORMAT, version, 7)) + b"".join(encode(1.5, entry) for entry in entries)


@pytest.mark.parametrize("entry", [Asked(1, "/s", request) for request in REQUESTS] + MESSAGES + [
    Answered(2, result) for result in RESULTS] + [Tick(1.5, False, [(1, "R"), (2, "-")]), PassFinished(1, "FAILURE", 2.0),
                                                  StepStarted(2, "B", "b::2", "driving", "to it", 3.5, False),
                                                  TourAdvanced(2, "B", "b::2", 1, 2, "cup", "begun"),
                                                  LeafFinished(2, "B", "b::2", "SUCCESS", "", 1.0, None, Told("said", "x"))],
    ids=str)
def test_each_entry_comes_back_as_it_was(entry):
    lines = list(decode(written(BEGIN + [entry]), "r"))
    assert lines == [Line(1.5, each) for each in BEGIN + [entry]]
    assert type(lines[-1].entry) is type(entry)


@pytest.mark.parametrize("old, new, fault", [
    ('"pid": 7', '"pid": ' + 18 * "9", ""), ('"pid": 7', '"pid": 1' + 18 * "0", "a whole number has more than 18 digits"),
    ('"time": 1.5', '"time": 0', ""), ('"time": 1.5', '"time": -0.5', "time is not a time"),
    ('"time": 1.5', '"time": 1e11', ""), ('"time": 1.5', '"time": 100000000001', "time is not a time")])
def test_numbers_have_limits(old, new, fault):
    data = written(BEGIN).replace(old.encode(), new.encode())
    assert new.encode() in data
    if fault:
        with pytest.raises(MissionError, match=fault):
            list(decode(data, "r"))
    else:
        assert len(list(decode(data, "r"))) == len(BEGIN)


def test_letters_of_any_language_can_be_read_in_the_file():
    assert "Grüße, 展品".encode() in encode(0.5, Noticed("info", "Grüße, 展品"))


def test_a_record_of_version_2_is_read_without_what_it_does_not_have():
    finished = LeafFinished(2, "B", "b::2", "FAILURE", "/s", 1.0, RESULTS[2])
    data = written(BEGIN + [finished], version=2)
    assert data.count(b', "told": null') == 1
    assert list(decode(data.replace(b', "told": null', b""), "r"))[-1].entry == finished


def test_all_that_the_interface_asks_and_tells_can_be_recorded():
    assert [service.request for service in INTERFACE.services if not issubclass(service.request, Request)] == []
    assert {type(request) for request in REQUESTS} <= {service.request for service in INTERFACE.services}
    assert {message.topic for message in MESSAGES} <= {topic.name for topic in INTERFACE.topics}
    for message in MESSAGES[:-1]:
        assert type(message.value) is INTERFACE.topic(message.topic).value


@pytest.mark.parametrize("value", [0, -1, 1.5, "1", True, None])
def test_a_count_is_an_integer_from_1_on_and_what_is_not_has_a_name(value):
    read = form(Count).read
    assert read(1) == 1
    for place, name in (("", "it"), (".call", "call"), ("[2]", "[2]")):
        with pytest.raises(Wrong) as wrong:
            inside(place, read, value)
        assert str(wrong.value).startswith(name + " ") and "an integer from 1 on" in str(wrong.value)


def forms():
    """Return kinds of values, which no form was made of before, each with a value, that as plain data, and wrong data."""
    class Colour(enum.Enum):
        RED = "red"
        BLUE = "blue"

    class Spot(NamedTuple):
        x: int
        colour: Colour = Colour.RED

    class Word(NamedTuple):
        word: Literal["a", "b"]

    class Shape:
        pass

    @dataclasses.dataclass
    class Ball(Shape):
        r: float

    @dataclasses.dataclass
    class Box(Shape):
        sides: Tuple[int, int]

    class Lonely:
        pass

    @dataclasses.dataclass
    class Only(Lonely):
        r: float

    spot, plain = Spot(1, Colour.BLUE), {"x": 1, "colour": "blue"}
    no_colour, no_kind = " is not one of red, blue", "[0] is not one of Ball, Box"
    no_pair = "it is not a list of kind and record"
    return [
        (Colour, Colour.RED, "red", [(3, "it" + no_colour), ([], "it" + no_colour), ("green", "it" + no_colour)]),
        (Spot, spot, plain, [(3, "it is not an object"), ({}, "x is missing"), ({"x": "a"}, "x is not an integer"),
                             ({"x": True}, "x is not an integer"), ({"x": 1, "colour": 1}, "colour" + no_colour)]),
        (Word, Word("b"), {"word": "b"}, [({"word": "c"}, "word is not one of a, b")]),
        (List[Spot], [spot], [plain], [({}, "it is not a list"), ([plain, 3], "[1] is not an object")]),
        (Tuple[Spot, ...], (spot, spot), [plain, plain], [("a", "it is not a list"), ([{}], "[0].x is missing")]),
        (Tuple[Spot, int], (spot, 3), [plain, 3], [("ab", "it is not a list"), ([plain], "it has 1 entries, not 2"),
                                                   ([plain, "a"], "[1] is not an integer")]),
        (Tuple[Spot], (spot,), [plain], [([], "it has 0 entries, not 1")]),
        (Dict[str, Spot], {"a": spot}, {"a": plain}, [([], "it is not an object"), ({"a": 3}, "a is not an object")]),
        (Optional[Spot], spot, plain, [(3, "it is not an object")]), (Optional[Spot], None, None, []),
        (Union[int, Spot], 3, 3, [("a", "it is not an object")]), (Union[int, Spot], spot, plain, []),
        (Union[Spot, Word], spot, ["Spot", plain], [(plain, no_pair), (["Spot"], no_pair), ([3, plain], "[0] is not one of Spot, Word"),
                                                    (["Word", plain], "[1].word is missing")]),
        (Shape, Ball(1.5), ["Ball", {"r": 1.5}], [(["Shape", {}], no_kind), ([[], {}], no_kind)]),
        (Shape, Box((1, 2)), ["Box", {"sides": [1, 2]}], [(["Box", {"sides": [1]}], "[1].sides has 1 entries, not 2")]),
        (Lonely, Only(1.5), {"r": 1.5}, [({"r": float("inf")}, "r is not a number"), ({"r": True}, "r is not a number")])]


@pytest.mark.parametrize("number", range(len(forms())))
def test_a_value_of_each_kind_comes_back_and_wrong_data_has_its_place(number):
    kind, value, plain, wrong = forms()[number]
    made = form(kind)
    assert made.write(value) == plain and made.read(plain) == value and type(made.read(plain)) is type(value)
    for data, text in wrong:
        with pytest.raises(Wrong) as found:
            made.read(data)
        assert str(found.value) == text


def test_a_field_with_a_default_may_be_missing():
    kind, value, _, _ = forms()[1]
    assert form(kind).read({"x": 1}) == value._replace(colour=type(value.colour).RED)
