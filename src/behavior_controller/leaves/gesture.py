"""Leaves that gesture (/gestureExecution/perform_gesture)."""
from typing import Optional

from msgspec.structs import replace

from behavior_controller.robot.requests import PerformGesture, Point, Request, Words
from behavior_controller.leaves.base import ServiceLeaf, leaf_spec
from behavior_controller.leaves.data import GESTURE_TARGET


class IconicGesture(ServiceLeaf):
    """``<WelcomeGesture/>``: the iconic gesture with the number in the setting ``setting``."""

    asks = PerformGesture
    setting: str

    def request(self) -> Request:
        settings = self.mission.settings
        return self.asks("iconic", getattr(settings, self.setting), settings.gesture_duration)

    def words(self, request: Request) -> Words:
        """Name the gesture instead of its number."""
        return super().words(request)._replace(what=f"the {self.setting.partition('_')[0]} gesture")


class PerformDeicticGesture(ServiceLeaf):
    """``<PerformDeicticGesture/>``: points at the target; exactly (0, 0, 0) means none."""

    asks = PerformGesture
    PORTS = (GESTURE_TARGET.read("target"),)

    def request(self) -> Optional[Request]:
        target = self.get_input("target")
        if target == Point(0.0, 0.0, 0.0):
            return None
        settings, known = self.mission.settings, self.mission.knowledge
        wanted = self.asks(
            "deictic", settings.deictic_gesture_id, settings.gesture_duration, target)
        return wanted if known is None else replace(wanted, arm=known.arm, shape=known.shape)


SPECS = (
    leaf_spec("WelcomeGesture", IconicGesture, "Makes the welcome gesture.",
              arguments={"setting": "welcome_gesture_id"}),
    leaf_spec("GoodbyeGesture", IconicGesture, "Waves goodbye.",
              arguments={"setting": "goodbye_gesture_id"}, is_farewell=True),
    leaf_spec("PerformDeicticGesture", PerformDeicticGesture,
              "Points at the current gesture target."))
