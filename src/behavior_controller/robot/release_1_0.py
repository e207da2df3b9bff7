"""The robot of the project's release 1.0, by its published software: the differences from D5.4.3.
"""
import math
from dataclasses import replace

from behavior_controller.robot.declarations import (
    Action, Evidence, Interface, Sense, Service, Success)
from behavior_controller.robot import d543, requests

FOUND = 2
"""The value of /overtAttention/mode that means that a mode has found what it looks for."""

GIVEN_UP = 3
"""The value that means that the mode seeking has found no mutual gaze."""

WAIT = 10.0
"""Seconds that the release's nodes wait for a visitor's presence and for an answer."""

RESULT_WAIT = 10.0
"""Seconds after the time within which a visitor has to begin to speak: up to five for the
utterance, the rest for its recognition."""


SERVICES = (
    replace(d543.INTERFACE.service(requests.SetAnimation), name="/animateBehaviour/setActivation"),
    d543.INTERFACE.service(requests.PerformGesture),
    d543.INTERFACE.service(requests.SetAttention),
    d543.INTERFACE.service(requests.GoTo),
    Service(requests.SetPose, "/robotLocalization/set_pose", "robotLocalization",
            "cssr_system/robotPoseService", lambda request: tuple(request.pose),
            Success("success", True, False), 5.0, "the localization does not get the robot's pose",
            is_optional=True),
    Service(requests.SetRecognition, "/speechEvent/set_enabled", "speechEvent",
            "cssr_system/speechEnabledService",
            lambda request: ("true" if request.is_enabled else "false",),
            Success("response", 1, 0), 5.0, "speech recognition is neither switched on nor off",
            is_optional=True),
    Service(requests.SetRecognitionLanguage, "/speechEvent/set_language", "speechEvent",
            "cssr_system/speechLanguageService", lambda request: (request.language,),
            Success("response", 1, 0), 5.0, "speech is recognised in the node's default language",
            is_optional=True),
    # its answer does not say which button was pressed
    replace(d543.INTERFACE.service(requests.Prompt), type="cssr_system/tabletPromptService",
            fields=lambda request: ("|".join(map("'{}'".format, request.options)),),
            answer=lambda response: requests.Answer(), is_optional=True, fails_without=True),
    replace(d543.INTERFACE.service(requests.Say), type="cssr_system/sayTextService",
            fields=lambda request: (request.text, request.language),
            answers_early=lambda request: request.language == "English"))

ATTENTION = replace(d543.ATTENTION, impact_if_missing="visitors are not noticed",
                    is_event=lambda status: status == ("scanning", FOUND))
RECOGNITION = Action(
    requests.Listen, "/speechEvent/recognise_speech_action", "speechEvent",
    "cssr_system/recogniseSpeech", lambda request: (request.seconds,), None, RESULT_WAIT,
    d543.SPEECH.impact_if_missing,
    lambda result: requests.Answer(response=result.transcription.strip()))
SPEECH = replace(d543.SPEECH, action=RECOGNITION)


def _status(state: str, wait: float) -> Evidence:
    """Return the evidence that attention is in that mode and has found what it looks for."""
    return Evidence(ATTENTION, lambda status, _: status == (state, FOUND), wait, mode=state)


INTERFACE = Interface(
    "release-1.0", SERVICES, (ATTENTION, SPEECH),
    (requests.SetAttention("disabled"), requests.SetAnimation("disabled")),
    {Sense.VISITOR: _status("scanning", math.inf), Sense.PRESENCE: _status("social", WAIT),
     Sense.GAZE: replace(_status("seeking", math.inf),
                         is_given_up=lambda status: status == ("seeking", GIVEN_UP)),
     Sense.UTTERANCE: Evidence(SPEECH, wait=WAIT)},
    gaze_value=FOUND, has_knowledge_files=True, tells_pressed=False)
