"""Leaves that gesture (/gestureExecution/perform_gesture)."""
from functools import partial
from typing import Union

from behavior_controller.bt.registry import Kind, NodeSpec
from behavior_controller.gateway import Cause, Failure
from behavior_controller.interface.records import PerformGesture, Point, Request
from behavior_controller.leaves.base import GESTURE_TARGET, ServiceLeaf


class IconicGesture(ServiceLeaf):
    """``<WelcomeGesture/>``: the iconic gesture whose number is the setting ``setting``."""

    asks = PerformGesture

    def __init__(self, name: str, setting: str):
        super().__init__(name)
        self.setting = setting

    def request(self) -> Request:
        """Perform it."""
        settings = self.mission.settings
        return PerformGesture("iconic", getattr(settings, self.setting), settings.gesture_duration)


class PerformDeicticGesture(ServiceLeaf):
    """``<PerformDeicticGesture/>``: points at ``gestureTarget``; exactly (0, 0, 0) is nothing to point at."""

    asks = PerformGesture

    def request(self) -> Union[Request, Failure, None]:
        """Point."""
        target = self.recall(GESTURE_TARGET)
        if target is None:
            return Failure(Cause.MISSING_DATA, "there is no gesture target", self.resource)
        if target == Point(0.0, 0.0, 0.0):
            return None
        settings = self.mission.settings
        return PerformGesture("deictic", settings.deictic_gesture_id, settings.gesture_duration, target)


SPECS = (
    NodeSpec("WelcomeGesture", Kind.ACTION, partial(IconicGesture, setting="welcome_gesture_id"),
             description="Makes the welcome gesture."),
    NodeSpec("GoodbyeGesture", Kind.ACTION, partial(IconicGesture, setting="goodbye_gesture_id"),
             description="Waves goodbye."),
    NodeSpec("PerformDeicticGesture", Kind.ACTION, PerformDeicticGesture,
             description="Points at the current gesture target."),
)
