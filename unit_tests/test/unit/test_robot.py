"""Tests of what the simulated nodes answer and publish."""
import os

import pytest

from behavior_controller.errors import ConfigurationError
from behavior_controller.interface.document import INTERFACE

from unit_tests import configuration, exhibits
from unit_tests.journal import Line
from unit_tests.robot import NODES, SERVICES, TOPICS, World
from unit_tests.visitor import ENGAGES, NO_GAZE, SILENT, Manners, Visitor

KNOWLEDGE = exhibits.load(os.path.join(configuration.share(), "data", "exhibits.json"))
GESTURE = {"gesture_type": "iconic", "gesture_id": 1, "gesture_duration": 3000, "bow_nod_angle": 0,
           "location_x": 0.0, "location_y": 0.0, "location_z": 0.0}


def world(behaviour=ENGAGES, mutual_gaze_value=1, *states):
    person = Visitor(Manners(behaviour, ("A tour?",), "Yes", "No", (0.0, 0.0)))
    for state in states:
        person.notice(Line(0.0, "overtAttention", "/overtAttention/set_mode", 1, {"state": state}))
    return World(person, KNOWLEDGE, mutual_gaze_value)


def test_each_declared_service_and_topic_has_its_simulated_node():
    assert len(NODES) == len(set(NODES)) and set(SERVICES) | set(TOPICS) == set(NODES)
    simulated = {each.name for part in (SERVICES, TOPICS) for each in part.values()}
    assert {offer.name for offer in INTERFACE.offers} ^ simulated == set()


@pytest.mark.parametrize("node, request_fields, answer", (
    ("animateBehavior", {"state": "enabled"}, {"success": "1"}),
    ("overtAttention", {"state": "seeking"}, {"mode_set_success": 1}),
    ("gestureExecution", GESTURE, {"gesture_success": 1}),
    ("textToSpeech", {"message": "Hello"}, {"success": True, "response": ""}),
    ("robotNavigation", {"goal_x": 1.0, "goal_y": 2.0, "goal_theta": 90.0}, {"navigation_goal_success": 1}),
    ("tabletEvent", {"message": "Yes|No"}, {"success": True, "response": "Yes"}),
))
def test_success_is_what_the_contract_says(node, request_fields, answer):
    assert SERVICES[node].object_to(request_fields) is None
    assert SERVICES[node].answer(request_fields, world(ENGAGES, 1, "scanning")) == answer


@pytest.mark.parametrize("node, refusal", (
    ("animateBehavior", "0"), ("overtAttention", 0), ("gestureExecution", 0), ("textToSpeech", False),
    ("robotNavigation", 0), ("knowledgeBase", False), ("tabletEvent", False)))
def test_a_refusal_is_not_success(node, refusal):
    assert refusal in SERVICES[node].refusal.values()


@pytest.mark.parametrize("what, names", (
    ("exhibits", ["Pepper", "Robot arm", "Camera wall", "Mobile base", "Workshop"]),
    ("Entrance", ["Entrance"]), ("HOME", ["Home"])))
def test_the_knowledge_base_knows_places_in_tour_order(what, names):
    assert SERVICES["knowledgeBase"].object_to({"parameters": what}) is None
    answer = SERVICES["knowledgeBase"].answer({"parameters": what}, world())
    assert answer["success"] is True and [place.name for place in answer["exhibits"]] == names


def test_exhibits_have_what_a_tour_needs():
    for exhibit in KNOWLEDGE.exhibits:
        assert exhibit.description1 and exhibit.description2 and exhibit.gesture != (0, 0, 0)
    assert len({exhibit.location for exhibit in KNOWLEDGE.exhibits}) == len(KNOWLEDGE.exhibits) >= 3
    assert KNOWLEDGE.entrance.gesture != (0, 0, 0)


@pytest.mark.parametrize("node, request_fields, objection", (
    ("animateBehavior", {"state": "on"}, "state is 'on'; allowed: enabled, disabled"),
    ("overtAttention", {"state": "sleeping"}, "allowed: disabled, social, scanning, seeking, location"),
    ("gestureExecution", dict(GESTURE, gesture_type="dance"), "gesture_type is 'dance'"),
    ("gestureExecution", dict(GESTURE, gesture_duration=0), "gesture_duration is 0 ms"),
    ("textToSpeech", {"message": " "}, "no text"),
    ("robotNavigation", {"goal_x": float("nan"), "goal_y": 0.0, "goal_theta": 0.0}, "no place"),
    ("knowledgeBase", {"parameters": "toilets"}, "allowed: exhibits, entrance, home"),
    ("tabletEvent", {"message": ""}, "no text"),
))
def test_requests_that_make_no_sense_are_objected_to(node, request_fields, objection):
    assert objection in SERVICES[node].object_to(request_fields)


def test_who_is_silent_presses_nothing():
    assert SERVICES["tabletEvent"].answer({"message": "Yes|No"}, world(SILENT, 1, "scanning"))["response"] == ""


def test_faces():
    assert TOPICS["faceDetection"].content(world()) == {"face_label_id": [], "mutualGaze": []}
    assert TOPICS["faceDetection"].content(world(ENGAGES, 1, "scanning")) == {
        "face_label_id": ["visitor"], "mutualGaze": [False]}
    seeking = ("scanning", "seeking")
    assert TOPICS["faceDetection"].content(world(ENGAGES, 1, *seeking))["mutualGaze"] == [True]
    assert TOPICS["faceDetection"].content(world(NO_GAZE, 1, *seeking))["mutualGaze"] == [False]


@pytest.mark.parametrize("state", ("disabled", "social", "scanning", "location"))
def test_a_gaze_status_is_published_in_seeking_only(state):
    content = TOPICS["overtAttention"].content(world(ENGAGES, 1, "scanning", "seeking", state))
    assert content == {"state": state, "value": 0}


@pytest.mark.parametrize("mutual_gaze_value, values", ((1, [0, 1]), (2, [1, 2])))
def test_the_gaze_status_keeps_to_the_convention(mutual_gaze_value, values):
    seeking = world(ENGAGES, mutual_gaze_value, "scanning", "seeking")
    assert [TOPICS["overtAttention"].content(seeking) for _ in range(2)] == [
        {"state": "seeking", "value": value} for value in values]


@pytest.mark.parametrize("text", ("", "[]", "{\"exhibits\": []}", "{\"exhibits\": [{\"name\": \"x\"}]}",
                                  "{\"exhibits\": [{\"name\": \"x\", \"location\": [1, 2]}]}", "{\"exhibits\": [[]]}",
                                  "{\"exhibits\": [1]}", "[" * 100_000, "{\"exhibits\": [\"\u202e\"]}"))
def test_a_file_of_places_that_cannot_be_used_is_named(tmp_path, text):
    path = tmp_path / "exhibits.json"
    path.write_text(text)
    with pytest.raises(ConfigurationError, match="exhibits.json: the exhibits cannot be read"):
        exhibits.load(str(path))
    with pytest.raises(ConfigurationError, match="cannot be read"):
        exhibits.load(str(tmp_path / "none.json"))


def test_a_file_of_places_may_begin_with_a_byte_order_mark_and_must_be_a_file(tmp_path):
    with open(os.path.join(configuration.share(), "data", "exhibits.json"), "rb") as file:
        (tmp_path / "marked.json").write_bytes(b"\xef\xbb\xbf" + file.read())
    assert exhibits.load(str(tmp_path / "marked.json")) == KNOWLEDGE
    with pytest.raises(ConfigurationError, match="/dev/zero: the exhibits cannot be read: it is not a regular file"):
        exhibits.load("/dev/zero")
