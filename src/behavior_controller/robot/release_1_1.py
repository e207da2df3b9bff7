"""The robot of the project's release 1.1: the differences from release 1.0.

Gestures have an arm and a shape of the hand. Driving, gestures and speech are actions too, under
the names of the services.
"""
from dataclasses import replace
from typing import Callable, Tuple, Type

from behavior_controller.robot.declarations import (
    Action, Evidence, Interface, Message, Sense, Service, Success)
from behavior_controller.robot import release_1_0, requests

SERVICES_OF_1_0 = {service.request: service for service in release_1_0.SERVICES}


def _gesture(gesture: requests.PerformGesture) -> Tuple[object, ...]:
    return (gesture.type, gesture.id, gesture.arm, gesture.shape, gesture.duration_ms,
            gesture.bow_nod_angle_deg, *gesture.target)


def _progress(feedback: Message) -> str:
    return f"{100.0 * feedback.progress:.0f} %"


def _by_action(request: Type[requests.Request], service: Service, file: str, success: Success,
               feedback: Callable[[Message], str]) -> Action:
    """Return the action beside ``service``: the same name, node, deadline and consequence."""
    return Action(request, service.name, service.node, f"cssr_system/{file}", service.fields,
                  success, service.deadline, service.impact_if_missing, feedback=feedback)


GESTURE = replace(SERVICES_OF_1_0[requests.PerformGesture],
                  type="cssr_system/gestureArmService", fields=_gesture)
DRIVE = SERVICES_OF_1_0[requests.GoTo]
SAY = replace(SERVICES_OF_1_0[requests.Say], answers_early=lambda request: False)

ACTIONS = (
    _by_action(requests.PerformGestureGoal, GESTURE, "performGesture",
               Success("gesture_success", 1, 0), _progress),
    _by_action(requests.GoToGoal, DRIVE, "driveTo", Success("navigation_goal_success", 1, 0),
               lambda feedback: f"{feedback.distance_remaining:.1f} m left"),
    _by_action(requests.SayGoal, SAY, "sayText", Success("success", True, False),
               lambda feedback: feedback.status))

_CHANGED = {service.name: service for service in (GESTURE, SAY)}
NEVER_ASKED = (requests.SetRecognitionLanguage,)
SERVICES = (
    *(_CHANGED.get(service.name, service) for service in release_1_0.SERVICES
      if service.request not in NEVER_ASKED), *ACTIONS)

PRESENT = (("scanning", release_1_0.FOUND), ("social", release_1_0.FOUND), ("social", -1))
"""The messages of attention with which a visitor counts as present.

Release 1.1 asks for the first; its own driver sends the second. Its published node sends nothing
but the third in the mode social, whoever is there: otherwise each visitor would count as gone.
"""

INTERFACE = Interface(
    "release-1.1", SERVICES, release_1_0.INTERFACE.topics, release_1_0.INTERFACE.safe_state,
    {**release_1_0.INTERFACE.senses,
     Sense.PRESENCE: Evidence(release_1_0.ATTENTION, lambda status, _: status in PRESENT,
                              release_1_0.WAIT)},
    gaze_value=release_1_0.FOUND, has_knowledge_files=True, tells_pressed=False,
    takes_arm=True, numbers_phrases=False, ends_location=True, never_asked=NEVER_ASKED)
