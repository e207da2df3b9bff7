"""The robot of D5.4.3 (tables 2 and 3): the interface that missions run against by default."""
import math

from behavior_controller.robot import requests
from behavior_controller.robot.declarations import (
    Evidence, Interface, Message, Sense, Service, Success, Topic, Unusable)


def _exhibit(place: Message) -> requests.Exhibit:
    location = requests.Location(place.location.x, place.location.y, place.location.theta)
    gesture = requests.Point(place.gesture.x, place.gesture.y, place.gesture.z)
    if not all(map(math.isfinite, location + gesture)):
        numbers = ", ".join(f"{number:g}" for number in location + gesture)
        raise Unusable(f"{place.name} has a coordinate that is not a number: {numbers}")
    return requests.Exhibit(place.name, place.description1, place.description2, location, gesture)


SERVICES = (
    Service(requests.SetAnimation, "/animateBehaviour/set_activation", "animateBehavior",
            "cssr_system/animateBehaviorService", lambda request: (request.state,),
            Success("success", "1", "0"), 5.0,
            "lifelike movement can be neither started nor stopped"),
    Service(requests.PerformGesture, "/gestureExecution/perform_gesture", "gestureExecution",
            "cssr_system/gestureExecutionService",
            lambda request: (request.type, request.id, request.duration_ms,
                             request.bow_nod_angle_deg, *request.target),
            Success("gesture_success", 1, 0), 15.0, "the robot makes no gestures"),
    Service(requests.QueryKnowledge, "/knowledgeBase/query", "knowledgeBase",
            "cssr_system/knowledgeBaseService", lambda request: (request.what,),
            Success("success", True, False), 5.0, "there are no places to go to and no way home",
            lambda response: requests.Answer(exhibits=tuple(map(_exhibit, response.exhibits)))),
    Service(requests.SetAttention, "/overtAttention/set_mode", "overtAttention",
            "cssr_system/overtAttentionService",
            lambda request: (request.state,) + tuple(request.target),
            Success("mode_set_success", 1, 0), 5.0, "the robot's gaze cannot be directed"),
    Service(requests.GoTo, "/robotNavigation/set_goal", "robotNavigation",
            "cssr_system/robotNavigationService", lambda request: tuple(request.goal),
            Success("navigation_goal_success", 1, 0), 180.0, "the robot cannot drive"),
    Service(requests.Prompt, "/tabletEvent/prompt_and_get_response", "tabletEvent",
            "cssr_system/textService", lambda request: ("|".join(request.options),),
            Success("success", True, False), 60.0, "visitors cannot answer on the tablet",
            lambda response: requests.Answer(response=response.response)),
    Service(requests.Say, "/textToSpeech/say_text", "textToSpeech", "cssr_system/textService",
            lambda request: (request.text,),
            Success("success", True, False), 60.0, "the robot cannot speak"))

FACES = Topic(
    "/faceDetection/data", "faceDetection", "cssr_system/faceDetectionMessage", requests.Faces,
    lambda message: requests.Faces(tuple(message.face_label_id), tuple(message.mutualGaze)),
    "visitors are not noticed", is_continuous=True, words=requests.Faces.in_words)
ATTENTION = Topic(
    "/overtAttention/mode", "overtAttention", "cssr_system/overtAttentionMessage",
    requests.AttentionStatus,
    lambda message: requests.AttentionStatus(message.state, message.value),
    "mutual gaze is not noticed", is_continuous=True, words=lambda status: status.state)
SPEECH = Topic("/speechEvent/text", "speechEvent", "std_msgs/String", str,
               lambda message: message.data, "what visitors say is not heard", is_continuous=False,
               words=lambda text: f"“{text}”")

INTERFACE = Interface(
    "D5.4.3", SERVICES, (FACES, ATTENTION, SPEECH),
    (requests.SetAttention("disabled"), requests.SetAnimation("disabled")),
    {Sense.VISITOR: Evidence(FACES, lambda faces, _: bool(faces.labels)),
     Sense.PRESENCE: Evidence(FACES, lambda faces, _: bool(faces.labels), 10.0),
     Sense.GAZE: Evidence(ATTENTION, lambda status, gaze: status == ("seeking", gaze),
                          mode="seeking"),
     Sense.UTTERANCE: Evidence(SPEECH)})
