"""The types of services and topics: the fields' names, types and order decide whether the robot understands us."""
import os

import pytest

from behavior_controller.interface.document import INTERFACE
from behavior_controller.interface.records import (GoTo, Location, PerformGesture, Point, Prompt, QueryKnowledge, Say,
                                                   SetAnimation, SetAttention)

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))

# D5.4.3 table 3 and section 3.2.5, with the decisions on what they leave open
EXPECTED = {
    "srv/animateBehaviorService.srv": ["string state", "---", "string success"],
    "srv/gestureExecutionService.srv": [
        "string gesture_type", "uint8 gesture_id", "int64 gesture_duration", "uint32 bow_nod_angle",
        "float64 location_x", "float64 location_y", "float64 location_z", "---", "uint8 gesture_success"],
    "srv/knowledgeBaseService.srv": ["string parameters", "---", "bool success", "exhibitInfoMessage[] exhibits"],
    "srv/overtAttentionService.srv": ["string state", "float64 location_x", "float64 location_y", "float64 location_z",
                                      "---", "uint8 mode_set_success"],
    "srv/robotNavigationService.srv": ["float64 goal_x", "float64 goal_y", "float64 goal_theta", "---",
                                       "uint8 navigation_goal_success"],
    "srv/textService.srv": ["string message", "---", "bool success", "string response"],
    "msg/locationMessage.msg": ["float64 x", "float64 y", "float64 theta"],
    "msg/gestureMessage.msg": ["float64 x", "float64 y", "float64 z"],
    "msg/exhibitInfoMessage.msg": ["string name", "string description1", "string description2",
                                   "locationMessage location", "gestureMessage gesture"],
    "msg/faceDetectionMessage.msg": ["string[] face_label_id", "geometry_msgs/Point[] centroids", "bool[] mutualGaze"],
    "msg/overtAttentionMessage.msg": ["string state", "int64 value"],
}


@pytest.mark.parametrize("path", sorted(EXPECTED))
def test_the_fields_are_those_of_the_robot(path):
    with open(os.path.join(ROOT, path), encoding="utf-8") as file:
        fields = [" ".join(line.split("#")[0].split()) for line in file]
    assert [field for field in fields if field] == EXPECTED[path]


def test_each_declared_type_has_its_file():
    missing = []
    for folder, offers in (("srv", INTERFACE.services), ("msg", INTERFACE.topics)):
        own = [offer.type.partition("/")[2] for offer in offers if offer.type.startswith("cssr_system/")]
        files = ["{}/{}.{}".format(folder, name, folder) for name in own]
        missing += [path for path in files if not os.path.exists(os.path.join(ROOT, path))]
    assert missing == []


# the tables 2 and 3: request, name, robot's node, type, what is sent, and the field that tells the outcome
SERVICES = [
    (SetAnimation("enabled"), "/animateBehaviour/set_activation", "animateBehavior", "animateBehaviorService",
     ("enabled",), ("success", "1", "0")),
    (PerformGesture("deictic", 2, 3000, Point(1.0, 2.0, 3.0), 20), "/gestureExecution/perform_gesture",
     "gestureExecution", "gestureExecutionService", ("deictic", 2, 3000, 20, 1.0, 2.0, 3.0), ("gesture_success", 1, 0)),
    (QueryKnowledge("exhibits"), "/knowledgeBase/query", "knowledgeBase", "knowledgeBaseService", ("exhibits",),
     ("success", True, False)),
    (SetAttention("location", Point(1.0, 2.0, 3.0)), "/overtAttention/set_mode", "overtAttention",
     "overtAttentionService", ("location", 1.0, 2.0, 3.0), ("mode_set_success", 1, 0)),
    (GoTo(Location(2.0, 3.5, 90.0)), "/robotNavigation/set_goal", "robotNavigation", "robotNavigationService",
     (2.0, 3.5, 90.0), ("navigation_goal_success", 1, 0)),
    (Prompt(("Yes", "No")), "/tabletEvent/prompt_and_get_response", "tabletEvent", "textService", ("Yes|No",),
     ("success", True, False)),
    (Say("hello"), "/textToSpeech/say_text", "textToSpeech", "textService", ("hello",), ("success", True, False)),
]


@pytest.mark.parametrize("request_, name, node, type_, fields, success", SERVICES, ids=[row[2] for row in SERVICES])
def test_a_service_is_called_as_the_document_says(request_, name, node, type_, fields, success):
    service = INTERFACE.service(type(request_))
    assert (service.name, service.node, service.type) == (name, node, "cssr_system/" + type_)
    assert service.fields(request_) == fields
    assert tuple(service.success) == success
    assert [type(value) for value in service.success] == [type(value) for value in success]


def test_the_services_and_topics_are_those_of_the_document():
    assert [service.name for service in INTERFACE.services] == [row[1] for row in SERVICES]
    assert [(topic.name, topic.is_continuous) for topic in INTERFACE.topics] == [
        ("/faceDetection/data", True), ("/overtAttention/mode", True), ("/speechEvent/text", False)]


def test_an_attention_without_a_place_and_a_gesture_without_a_target_send_zeros():
    assert INTERFACE.service(SetAttention).fields(SetAttention("social")) == ("social", 0.0, 0.0, 0.0)
    assert INTERFACE.service(PerformGesture).fields(PerformGesture("iconic", 1, 500)) == (
        "iconic", 1, 500, 0, 0.0, 0.0, 0.0)
