"""The types of services and topics: the fields' names, types and order decide whether the robot understands us."""
import os

import pytest

from behavior_controller.interface.document import INTERFACE

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
