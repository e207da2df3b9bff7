"""The nodes of release 1.1's missions that release 1.0 lacks: each is a node of release 1.0 whose
request is the goal of an action.

On a robot without the action the service of the same name carries out the request.
"""
from typing import Tuple

from behavior_controller.robot.requests import GoToGoal, PerformGestureGoal, SayGoal
from behavior_controller.leaves.base import leaf_spec
from behavior_controller.leaves.data import DESCRIPTION_1, DESCRIPTION_2
from behavior_controller.leaves.gesture import IconicGesture, PerformDeicticGesture
from behavior_controller.leaves.knowledge import leave_out_exhibit
from behavior_controller.leaves.navigation import Navigate
from behavior_controller.leaves.release_1_0 import (
    ANSWER_WAIT, FAREWELLS, GESTURES, PHRASES, GetVisitorResponse, SayText)
from behavior_controller.leaves.speech import DescribeExhibitSpeech
from behavior_controller.config.node_facts import MissionSpec


class SayTextAsync(SayText):
    """``<SayTextAsync name="4"/>``: says a utility phrase by the action."""

    asks = SayGoal


class DescribeExhibitSpeechAsync(DescribeExhibitSpeech):
    """``<DescribeExhibitSpeechAsync/>``: says both descriptions in one, whatever its name."""

    asks = SayGoal

    def __init__(self, name: str):
        super().__init__(name, "both")


class NavigateAsync(Navigate):
    """``<NavigateAsync/>``: drives to the target by the action."""

    asks = GoToGoal


class PerformDeicticGestureAsync(PerformDeicticGesture):
    """``<PerformDeicticGestureAsync/>``: points at the target by the action."""

    asks = PerformGestureGoal


class PerformIconicGestureAsync(IconicGesture):
    """``<PerformIconicGestureAsync name="welcome"/>``: makes the gesture by the action."""

    asks = PerformGestureGoal


SPECS: Tuple[MissionSpec, ...] = (
    leaf_spec("SayTextAsync", SayTextAsync, "Says a utility phrase, by its number (action).",
              choices=PHRASES, farewells=FAREWELLS, says_phrase=True),
    leaf_spec("DescribeExhibitSpeechAsync", DescribeExhibitSpeechAsync,
              "Says both descriptions of the current exhibit in one (action).",
              (DESCRIPTION_1.read(), DESCRIPTION_2.read())),
    leaf_spec("NavigateAsync", NavigateAsync, "Drives to the current target location (action).",
              is_indispensable=True, leave_out=leave_out_exhibit),
    leaf_spec("PerformDeicticGestureAsync", PerformDeicticGestureAsync,
              "Points at the current gesture target (action)."),
    leaf_spec("PerformIconicGestureAsync", PerformIconicGestureAsync,
              "Makes the welcome gesture or waves goodbye (action).", choices=GESTURES,
              farewells=("goodbye",)),
    leaf_spec("GetVisitorResponseAsync", GetVisitorResponse,
              f"Listens for a yes or a no for up to {ANSWER_WAIT:g} s, by the action if the robot "
              "offers it; an empty answer if there is none.", arguments={"prefers_action": True}))
