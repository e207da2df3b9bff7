"""The robot of the project's release 1.0, by its published software: the differences from D5.4.3."""
import math
from typing import Callable, Optional

from behavior_controller.interface import Action, Evidence, Interface, Message, Sense, Service, Success, Topic
from behavior_controller.interface import document
from behavior_controller.interface.records import (AttentionStatus, GoTo, PerformGesture, Prompt, Say, SetAnimation,
                                                   SetAttention, SetPose, SetRecognition, SetRecognitionLanguage)

FOUND = 2
"""The value of /overtAttention/mode that means that a mode has found what it looks for."""

GIVEN_UP = 3
"""The value that means that the mode seeking has found no mutual gaze."""

WAIT = 10.0
"""Seconds that the release's nodes wait for a visitor's presence and for an answer."""


def _transcription(result: Message) -> Optional[str]:
    return result.transcription.strip() or None


SERVICES = (
    Service(SetAnimation, "/animateBehaviour/setActivation", "animateBehavior", "cssr_system/animateBehaviorService",
            lambda request: (request.state,), Success("success", "1", "0"), 5.0,
            "lifelike movement can be neither started nor stopped"),
    document.INTERFACE.service(PerformGesture),
    document.INTERFACE.service(SetAttention),
    document.INTERFACE.service(GoTo),
    Service(SetPose, "/robotLocalization/set_pose", "robotLocalization", "cssr_system/robotPoseService",
            lambda request: tuple(request.pose), Success("success", True, False), 5.0,
            "the localization is not told where the robot stands", is_optional=True),
    Service(SetRecognition, "/speechEvent/set_enabled", "speechEvent", "cssr_system/speechEnabledService",
            lambda request: ("true" if request.is_enabled else "false",), Success("response", 1, 0), 5.0,
            "speech recognition is neither switched on nor off", is_optional=True),
    Service(SetRecognitionLanguage, "/speechEvent/set_language", "speechEvent", "cssr_system/speechLanguageService",
            lambda request: (request.language,), Success("response", 1, 0), 5.0,
            "speech is recognised in the language that the node has of its own", is_optional=True),
    Service(Prompt, "/tabletEvent/prompt_and_get_response", "tabletEvent", "cssr_system/tabletPromptService",
            lambda request: ("|".join("'{}'".format(option) for option in request.options),),
            Success("success", True, False), 60.0, "visitors cannot answer on the tablet", is_optional=True,
            fails_without=True),
    Service(Say, "/textToSpeech/say_text", "textToSpeech", "cssr_system/sayTextService",
            lambda request: (request.text, request.language), Success("success", True, False), 60.0,
            "the robot cannot speak"),
)

ATTENTION = Topic("/overtAttention/mode", "overtAttention", "cssr_system/overtAttentionMessage", AttentionStatus,
                  lambda message: AttentionStatus(message.state, message.value), "visitors are not noticed",
                  is_continuous=True)
SPEECH = Topic("/speechEvent/text", "speechEvent", "std_msgs/String", str, lambda message: message.data,
               "what visitors say is not heard", is_continuous=False,
               action=Action("/speechEvent/recognise_speech_action", "cssr_system/recogniseSpeech",
                             lambda seconds: (seconds,), _transcription))


def _status(state: str, wait: float, is_given_up: Callable[[AttentionStatus], bool] = lambda status: False) -> Evidence:
    """Return the evidence that attention is in that mode and has found what it looks for."""
    return Evidence(ATTENTION, lambda status, _: status == (state, FOUND), wait, is_given_up, state)


INTERFACE = Interface("release-1.0", SERVICES, (ATTENTION, SPEECH),
                      (SetAttention("disabled"), SetAnimation("disabled")), {
                          Sense.VISITOR: _status("scanning", math.inf),
                          Sense.PRESENCE: _status("social", WAIT),
                          Sense.GAZE: _status("seeking", math.inf, lambda status: status == ("seeking", GIVEN_UP)),
                          Sense.UTTERANCE: Evidence(SPEECH, wait=WAIT)},
                      gaze_value=FOUND, has_knowledge_files=True, tells_pressed=False)
