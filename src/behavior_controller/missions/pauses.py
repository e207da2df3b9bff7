"""What persists after a pass that failed, so that the next one waits: a node is gone, for one."""
from typing import Optional

from behavior_controller.execution.events import Paused
from behavior_controller.robot.gateway import Cause
from behavior_controller.leaves.base import MissionContext


class Persistence:
    """Says after each pass what the next one has to wait for; the pauses grow until a pass
    succeeds."""

    def __init__(self) -> None:
        self._pauses = 0  # since the last pass that succeeded

    def reset(self) -> None:
        """Let the next pause be the first one again."""
        self._pauses = 0

    def cause(self, mission: MissionContext, failed_at: float, now: float) -> Optional[Paused]:
        """Return what still persists of a pass that failed at that time; None: nothing, or the
        pause is over."""
        failures, policy, health = mission.failures.of_pass(), mission.policy, mission.health
        for failure in failures:
            if health.is_gone(failure.resource):
                return Paused(failure, health.gone_name(failure.resource))
        # a cause whose end nothing tells: the budget is spent, or the types differ
        paused, pause = None, policy.pause(self._pauses)
        spent_for = mission.recovers_again_at() - failed_at
        mismatches = [failure for failure in failures if failure.cause is Cause.TYPE_MISMATCH]
        if failures and mission.failures.is_budget_spent and spent_for > 0.0:
            paused = Paused(failures[-1], "", policy.spent, min(pause, spent_for))
        elif mismatches:
            paused = Paused(mismatches[-1], "", "", pause)
        if paused is not None and failed_at + paused.limit <= now:
            self._pauses += 1
            return None
        return paused
