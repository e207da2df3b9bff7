"""HandleFallBack: finds the failure that led to it and does what the recovery policy says (D5.4.3
§3.2.4)."""
from typing import Any, List, Optional

from behavior_controller.bt.engine.clock import Timer
from behavior_controller.bt import ActionLeaf, PortError, Result, FAILURE, IDLE, RUNNING, SUCCESS
from behavior_controller.bt.engine.ports import defaults
from behavior_controller.execution.events import (
    LeafSummary, Noticed, Recovered, Recovering, Retried)
from behavior_controller.robot.gateway import Cause, Failure
from behavior_controller.leaves.base import Attempt, Failed, MissionLeaf, ServiceLeaf, leaf_spec
from behavior_controller.leaves.knowledge import LEAVING_OUT
from behavior_controller.config.node_facts import MissionSpec
from behavior_controller.execution.recovery import End, GIVEN_UP, Recovery, Retry, Step
from behavior_controller.execution.safe_state import SafeState

RETURN_LIMIT = 15.0
"""Seconds that all retries of a step together wait for the return of a service that is known to be
gone, if the mission needs the step."""


class HandleFallBack(MissionLeaf, ActionLeaf):
    """``<HandleFallBack/>``: retries the failed step, runs a substitute, goes on without it, or
    gives up.

    The failure is the newest one of the leaves before this node below their common parent. Only a
    step that is a sibling can be retried: in a whole SubTree, repeating one leaf would not repeat
    the rest. SUCCESS only if the step was done after all or may be skipped. A visit may be skipped
    only if that does not leave out every exhibit of the tour.
    """

    PORTS = LEAVING_OUT
    _round: "Optional[_Round]" = None
    _last_number = 0

    def on_start(self) -> Result:
        """Find the failure and start to recover from it."""
        self.started_at = self.mission.clock.now()
        steps = self._steps()
        failed = self.mission.failures.newest(steps[0].uid if steps else self.uid, self.uid,
                                              self._last_number)
        self._last_number = self.mission.failures.newest_number
        if failed is None:
            failure = Failure(Cause.MISSING_DATA, "no mission node failed before")
            self._tell(self, failure, "give up", 0, GIVEN_UP, "")
            return self._finished(GIVEN_UP, None)
        is_affordable = self._is_affordable()
        self.mission.failures.is_budget_spent |= not is_affordable
        can_redo = failed.leaf.parent is self.parent and isinstance(failed.leaf, ServiceLeaf)
        recovery = Recovery(self.mission.policy, failed.leaf.spec, failed.failure, can_redo,
                            is_affordable, lambda: self._leave_out(steps))
        self._round = _Round(self, failed, recovery)
        return self.on_running()

    def _leave_out(self, steps: List[Any]) -> bool:
        """Note that the mission goes on without ``steps``; return whether it may."""
        for node in (node for step in steps for node in step.iterate()):
            if isinstance(node.spec, MissionSpec) and node.spec.leave_out is not None:
                try:
                    return node.spec.leave_out(self)
                except PortError as error:
                    self.mission.events.emit(
                        Noticed("warning", f"what is left out cannot be noted: {error}"))
                    return True
        return True

    def _steps(self) -> List[Any]:
        """Return the nodes before this one below the nearest ancestor that has any: a consecutive
        range of uids."""
        node: Any = self
        while node.parent is not None:
            before = node.parent.children[:node.parent.children.index(node)]
            if before:
                return before
            node = node.parent
        return []

    def _is_affordable(self) -> bool:
        now, policy = self.mission.clock.now(), self.mission.policy
        recent = [began for began in self.mission.recoveries if began > now - policy.seconds]
        self.mission.recoveries = [*recent, now]
        return len(recent) < policy.most

    def on_running(self) -> Result:
        """Go on with the recovery."""
        under_way = self._round
        outcome = under_way.go_on() if under_way is not None else GIVEN_UP
        if under_way is None or outcome is None:
            return RUNNING
        self._round = None
        recovery = under_way.recovery
        self._tell(under_way.failed.leaf, recovery.failure, str(recovery), recovery.attempts,
                   outcome, recovery.reason)
        self.summary = under_way.summary()
        return self._finished(outcome, recovery.failure)

    def _tell(self, leaf: MissionLeaf, failure: Failure, policy: str, attempts: int, outcome: str,
              reason: str) -> None:
        self.mission.events.emit(
            Recovered(leaf.registration_id, leaf.full_path, failure, policy, attempts,
                      outcome != GIVEN_UP, outcome, reason, self.uid))

    def _finished(self, outcome: str, failure: Optional[Failure]) -> Result:
        # a failed recovery is not recorded as a failure: an outer HandleFallBack looks for the
        # original one
        result = FAILURE if outcome == GIVEN_UP else SUCCESS
        if result is FAILURE and failure is not None:
            self.mission.failures.give_up(failure)
        self.report(result, failure if result is FAILURE else None)
        return result

    def on_halted(self) -> None:
        """Drop the recovery."""
        if self._round is not None:
            self._round.drop()
            self._round = None
        self.report(IDLE)


class _Round:
    """One recovery under way: carries out the decisions of ``Recovery``."""

    def __init__(self, leaf: HandleFallBack, failed: Failed, recovery: Recovery):
        self.failed = failed
        self.recovery = recovery
        self._leaf = leaf
        self._mission = leaf.mission
        self._doing: Any = failed.leaf  # the failed leaf, or its substitute
        self._attempt: Optional[Attempt] = None
        self._pause: Optional[Timer] = None
        self._patience: Optional[Timer] = None  # ends the wait for a service that is gone
        self._safe_state: Optional[SafeState] = None
        self._step = self._begun(recovery.next_step())

    def _begun(self, step: Step) -> Step:
        if isinstance(step, Retry):
            self._tell(self.recovery.attempts + 1)
            self._pause = self._mission.clock.call_after(step.pause, self._leaf.wake)
        elif not isinstance(step, End):
            self._tell(0, step.spec.id)
            self._doing = self._substitute(step.spec)
        elif step.outcome == GIVEN_UP and self.failed.number != self._mission.failures.given_up:
            # else an inner HandleFallBack has left the robot in the safe state
            self._mission.failures.given_up = self.failed.number
            self._safe_state = self._mission.ask_for_safe_state()
        return step

    def _tell(self, attempt: int, substitute: str = "") -> None:
        leaf = self.failed.leaf
        self._mission.events.emit(
            Recovering(self._leaf.uid, leaf.registration_id, leaf.full_path, self.recovery.failure,
                       attempt, self.recovery.retries, substitute))

    def summary(self) -> Optional[LeafSummary]:
        """Return the sentence about the attempt that succeeded."""
        summary, self._doing.summary = self._doing.summary, None
        return summary

    def _substitute(self, spec: MissionSpec) -> Any:
        leaf: Any = spec.factory(spec.id)
        leaf.uid = self._leaf.uid
        leaf.registration_id, leaf.full_path = spec.id, self._leaf.full_path
        leaf.spec, leaf.attributes = spec, defaults(spec.ports)
        leaf.blackboard, leaf.services = self._leaf.blackboard, self._leaf.services
        leaf.mission = self._mission
        return leaf

    def go_on(self) -> Optional[str]:
        """Return the outcome, or None while the recovery waits."""
        while not isinstance(self._step, End):
            if self._waits():
                return None
            self._attempt = self._attempt or self._doing.try_once()
            ended = self._attempt.poll()
            if ended is None:
                return None
            self._attempt = None
            self._step = self._begun(self._judged(ended.failure))
        if self._safe_state is not None:
            if not self._safe_state.is_over:
                return None
            self._mission.events.emit(self._safe_state.report())
            self._safe_state = None
        self._cancel_timers()
        return self._step.outcome

    def _waits(self) -> bool:
        """Return whether to delay the attempt: for the pause, or for the return of a service that
        the tour needs."""
        if self._attempt is not None or not isinstance(self._step, Retry):
            return False
        if self._pause is not None and self._pause.callback is not None:
            return True
        health, resource = self._mission.health, self.recovery.failure.resource
        if not self.recovery.is_indispensable or not health.is_gone(resource):
            return False
        if self._patience is None:
            self._leaf.begin_wait(f"waiting for {health.gone_name(resource)} to return",
                                  RETURN_LIMIT)
            self._patience = self._mission.clock.call_after(RETURN_LIMIT, self._leaf.wake)
        return self._patience.callback is not None

    def _judged(self, failure: Optional[Failure]) -> Step:
        step = self.recovery.attempted(failure)
        if failure is not None:
            doing, attempts = self._doing, self.recovery.attempts
            self._mission.events.emit(
                Retried(doing.registration_id, doing.full_path, attempts, failure))
        return step

    def _cancel_timers(self) -> None:
        for timer in (self._pause, self._patience):
            if timer is not None:
                timer.cancel()

    def drop(self) -> None:
        """Drop the requests under way."""
        self._cancel_timers()
        if self._safe_state is not None:
            self._safe_state.drop()
        if self._attempt is not None:
            self._attempt.drop()


SPECS = (
    leaf_spec("HandleFallBack", HandleFallBack,
              "Recovers from the failure before it, as the recovery policy says.",
              is_recovery=True),
    leaf_spec("HandleFallback", HandleFallBack, "Another spelling of HandleFallBack.",
              is_recovery=True, warning="HandleFallback is an old spelling; write HandleFallBack"),
)
