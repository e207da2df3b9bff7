"""Leaves about the mission itself."""
from typing import Optional

from behavior_controller.bt.engine.possible_results import SUCCEEDS
from behavior_controller.run.events import Noticed
from behavior_controller.robot.gateway import Failure
from behavior_controller.leaves.base import InstantAction, InstantCondition, MissionLeaf, leaf_spec


def begin_pass(leaf: MissionLeaf) -> None:
    """Announce that a pass begins, and clear the last visitor's data."""
    leaf.mission.events.emit(Noticed("info", "a pass begins"))
    leaf.mission.begin_visit(leaf.blackboard.root, leaf.mission.clock.now())


class StartOfTree(InstantAction):
    """``<START_OF_TREE/>``: announces a pass, and clears the last visitor's data, as the beginning
    of a pass does."""

    def act(self) -> Optional[Failure]:
        """Announce and clear."""
        begin_pass(self)
        return None


class IsASREnabled(InstantCondition):
    """``<IsASREnabled/>``: SUCCESS if the configuration says that speech is recognised."""

    otherwise = "asrEnabled is false"

    def holds(self) -> bool:
        return self.mission.settings.asr_enabled


SPECS = (
    leaf_spec("START_OF_TREE", StartOfTree, "Shows that a visitor's pass begins.",
              outcome=SUCCEEDS, begins_pass=True),
    leaf_spec("IsASREnabled", IsASREnabled, "Is speech recognised?", setting="asr_enabled"))
