"""Leaves of the mission itself."""
from typing import Optional

from behavior_controller.bt.registry import Kind, NodeSpec
from behavior_controller.gateway import Failure
from behavior_controller.leaves.base import OF_ONE_VISITOR, QUESTION_ASKED_AT, InstantAction, InstantCondition


class StartOfTree(InstantAction):
    """``<START_OF_TREE/>``: forgets what belongs to the last visitor; shows in verbose mode that a pass begins."""

    def act(self) -> Optional[Failure]:
        """Forget."""
        self.forget(*OF_ONE_VISITOR)
        self.remember(QUESTION_ASKED_AT, self.mission.clock.now())
        return None


class IsASREnabled(InstantCondition):
    """``<IsASREnabled/>``: SUCCESS if the configuration says that speech is recognised."""

    otherwise = "asrEnabled is false"

    def holds(self) -> bool:
        """Return the setting."""
        return self.mission.settings.asr_enabled


SPECS = (
    NodeSpec("START_OF_TREE", Kind.ACTION, StartOfTree, description="Begins a visitor's pass."),
    NodeSpec("IsASREnabled", Kind.CONDITION, IsASREnabled, description="Is speech recognised?"),
)
