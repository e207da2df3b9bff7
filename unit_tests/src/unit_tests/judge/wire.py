"""Requests, responses and messages as ROS carries them, by the tables 2 and 3 of D5.4.3 and the
published releases: names, fields, units, and what they mean.

It is written from the documents, beside the controller's own declarations, and uses nothing of
them but the records of requests and messages that a run is made of.
"""
import math
from typing import Any, Callable, Dict, Mapping, NamedTuple, Tuple, Union

from behavior_controller.config.settings import Settings
from behavior_controller.robot.gateway import Cause
from behavior_controller.robot.requests import (
    Answer, AttentionStatus, Exhibit, Faces, GoTo, GoToGoal, Location, PerformGesture,
    PerformGestureGoal, Point, Prompt, QueryKnowledge, Say, SayGoal, SetAnimation, SetAttention,
    SetPose, SetRecognition, SetRecognitionLanguage)

DOCUMENTS, RELEASE_1_0, RELEASE_1_1 = "D5.4.3", "release-1.0", "release-1.1"
"""The interfaces of robots."""

FILES = "the knowledge files"
"""The name for people of what answers for a knowledge base that the robot does not have."""


class RosService(NamedTuple):
    """A service, or action: its name, the field of its response that says whether it is done, and
    that field's values for done and refused."""

    name: str
    outcome: str
    done: Any
    refused: Any


SERVICES: Dict[type, RosService] = {
    SetAnimation: RosService("/animateBehaviour/set_activation", "success", "1", "0"),
    PerformGesture: RosService("/gestureExecution/perform_gesture", "gesture_success", 1, 0),
    QueryKnowledge: RosService("/knowledgeBase/query", "success", True, False),
    SetAttention: RosService("/overtAttention/set_mode", "mode_set_success", 1, 0),
    GoTo: RosService("/robotNavigation/set_goal", "navigation_goal_success", 1, 0),
    Prompt: RosService("/tabletEvent/prompt_and_get_response", "success", True, False),
    Say: RosService("/textToSpeech/say_text", "success", True, False),
    SetPose: RosService("/robotLocalization/set_pose", "success", True, False),
    SetRecognition: RosService("/speechEvent/set_enabled", "response", 1, 0),
    SetRecognitionLanguage: RosService("/speechEvent/set_language", "response", 1, 0)
}
SERVICES.update({PerformGestureGoal: SERVICES[PerformGesture], GoToGoal: SERVICES[GoTo],
                 SayGoal: SERVICES[Say]})

SENT: Dict[type, Callable[[Any, str], Tuple[Any, ...]]] = {
    SetAnimation: lambda request, _: (request.state,),
    PerformGesture: lambda request, robot: (
        request.type, request.id, *(request.arm, request.shape) * (robot == RELEASE_1_1),
        request.duration_ms, request.bow_nod_angle_deg, *request.target),
    QueryKnowledge: lambda request, _: (request.what,),
    SetAttention: lambda request, _: (request.state, *request.target),
    GoTo: lambda request, _: request.goal,
    Prompt: lambda request, robot: (
        "|".join(option if robot == DOCUMENTS else f"'{option}'" for option in request.options),),
    Say: lambda request, robot: (request.text, request.language)[:1 + (robot != DOCUMENTS)],
    SetPose: lambda request, _: request.pose,
    SetRecognition: lambda request, _: (str(request.is_enabled).lower(),),
    SetRecognitionLanguage: lambda request, _: (request.language,)
}
SENT.update({PerformGestureGoal: SENT[PerformGesture], GoToGoal: SENT[GoTo], SayGoal: SENT[Say]})
"""Table 3: the values of a request's fields on the wire, on the robot of that interface."""


class RosRobot(NamedTuple):
    """The robot of an interface, with all its names below a ``namespace`` if it is one of several.
    """

    name: str
    namespace: str = ""

    @property
    def has_files(self) -> bool:
        """Whether files answer for the knowledge base and hold language and phrases."""
        return self.name != DOCUMENTS

    @property
    def tells_pressed(self) -> bool:
        """Whether the tablet's answer says which button was pressed."""
        return self.name == DOCUMENTS

    def serves(self, kind: type) -> bool:
        """Return whether requests of a kind are answered, by a service or from files."""
        if kind in (SetPose, SetRecognition, GoToGoal, SayGoal, PerformGestureGoal):
            is_goal = kind not in (SetPose, SetRecognition)
            return self.name == RELEASE_1_1 or self.name == RELEASE_1_0 and not is_goal
        return kind is not SetRecognitionLanguage or self.name == RELEASE_1_0

    def resource(self, kind: type) -> str:
        """Return the name of the service for requests of a kind."""
        if self.has_files and kind is QueryKnowledge:
            return FILES
        if self.has_files and kind is SetAnimation:
            return self.named("/animateBehaviour/setActivation")
        return self.named(SERVICES[kind].name)

    def named(self, name: str) -> str:
        """Return a name of the documents as this robot has it."""
        return self.namespace + name

    def result(self, kind: type, response: Mapping[str, Any]) -> Union[Answer, Cause]:
        """Return what a response says, or the cause of the failure that it is."""
        outcome = response[SERVICES[kind].outcome]
        if outcome == SERVICES[kind].refused:
            return Cause.REFUSED
        if outcome != SERVICES[kind].done:
            return Cause.UNUSABLE_ANSWER
        if kind is QueryKnowledge:
            return _known(response)
        if kind is Prompt and self.tells_pressed:
            return Answer(response["response"])
        return Answer()


def robot_of(settings: Settings) -> RosRobot:
    """Return the robot that a configuration names."""
    return RosRobot(settings.robot_interface, settings.robot and "/" + settings.robot)


def _known(response: Mapping[str, Any]) -> Union[Answer, Cause]:
    """Return the places of a response in metres and degrees, if they have coordinates."""
    exhibits = tuple(
        Exhibit(place["name"], place["description1"], place["description2"],
                Location(*(place["location"][name] for name in ("x", "y", "theta"))),
                Point(*(place["gesture"][name] for name in ("x", "y", "z"))))
        for place in response["exhibits"])
    numbers = (number for place in exhibits for number in place.location + place.gesture)
    if not all(map(math.isfinite, numbers)):
        return Cause.UNUSABLE_ANSWER
    return Answer(exhibits=exhibits)


# ------------------------------------------------------------------------------------------- topics

FACES, ATTENTION, SPEECH = "/faceDetection/data", "/overtAttention/mode", "/speechEvent/text"

MESSAGES: Dict[str, Callable[[Mapping[str, Any]], Any]] = {
    FACES: lambda fields: Faces(tuple(fields["face_label_id"]), tuple(fields["mutualGaze"])),
    ATTENTION: lambda fields: AttentionStatus(fields["state"], fields["value"]),
    SPEECH: lambda fields: fields["data"]
}
"""Table 2: what the fields of a topic's message say."""

STATES = (FACES, ATTENTION)
"""The topics that are published all the time, of which the newest message counts."""

MOST_EVENTS = 100
"""The number of events of another topic that count."""


def node_of(topic: str) -> str:
    """Return the simulated node that publishes a topic."""
    return topic.split("/")[1]


def is_lasting(topic: str, value: Any, robot: RosRobot) -> bool:
    """Return whether a message of a state counts in spite of newer ones: releases may say only once
    that they have found a visitor."""
    return topic == ATTENTION and robot.has_files and value == ("scanning", 2)
