"""Leaves of the mission itself."""
from typing import Optional

from behavior_controller.bt.ends import SUCCEEDS
from behavior_controller.events import Noticed
from behavior_controller.gateway import Failure
from behavior_controller.leaves.base import InstantAction, InstantCondition, MissionLeaf, leaf_spec


def begin_pass(leaf: MissionLeaf) -> None:
    """Tell that a pass begins, and forget the last visitor."""
    leaf.mission.events.emit(Noticed("info", "a pass begins"))
    leaf.mission.begin_visit(leaf.blackboard.root(), leaf.mission.clock.now())


class StartOfTree(InstantAction):
    """``<START_OF_TREE/>``: shows that a pass begins, and forgets the last visitor, as the beginning of a pass does."""

    def act(self) -> Optional[Failure]:
        """Tell, and forget."""
        begin_pass(self)
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
