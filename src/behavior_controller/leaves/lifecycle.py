"""Leaves of the mission itself."""
from typing import Optional

from behavior_controller.bt.ends import SUCCEEDS
from behavior_controller.events import Noticed
from behavior_controller.gateway import Failure
from behavior_controller.leaves.base import InstantAction, InstantCondition, leaf_spec


class StartOfTree(InstantAction):
    """``<START_OF_TREE/>``: shows that a pass begins, and forgets the last visitor, as the beginning of a pass does."""

    def act(self) -> Optional[Failure]:
        """Tell, and forget."""
        self.mission.events.emit(Noticed("info", "a pass begins"))
        self.mission.begin_visit(self.blackboard.root(), self.mission.clock.now())
        return None


class IsASREnabled(InstantCondition):
    """``<IsASREnabled/>``: SUCCESS if the configuration says that speech is recognised."""

    otherwise = "asrEnabled is false"

    def holds(self) -> bool:
        return self.mission.settings.asr_enabled


SPECS = (
    leaf_spec("START_OF_TREE", StartOfTree, "Shows that a visitor's pass begins.", outcome=SUCCEEDS),
    leaf_spec("IsASREnabled", IsASREnabled, "Is speech recognised?"),
)
