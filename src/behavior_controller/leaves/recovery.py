"""HandleFallBack: finds the failure that led to it and does what the recovery policy says (D5.4.3
§3.2.4)."""
from typing import Any, List, Optional

from behavior_controller.bt.engine.clock import Timer
from behavior_controller.bt import PortError, Result, FAILURE
from behavior_controller.bt.engine.ports import defaults
from behavior_controller.execution.events import Noticed, Recovered, Recovering, Retried
from behavior_controller.robot.gateway import Cause, Failure
from behavior_controller.leaves.base import (
    Failed, MissionLeaf, ServiceLeaf, Waiting, WorkingLeaf, leaf_spec)
from behavior_controller.leaves.knowledge import LEAVING_OUT
from behavior_controller.config.node_facts import MissionSpec
from behavior_controller.execution.recovery import End, GIVEN_UP, Recovery, Retry

RETURN_LIMIT = 15.0
"""Seconds that all retries of a step together wait for the return of a service that is known to be
gone, if the mission needs the step."""


class HandleFallBack(WorkingLeaf):
    """``<HandleFallBack/>``: retries the failed step, runs a substitute, goes on without it, or
    gives up.

    The failure is the newest one of the leaves before this node below their common parent. Only a
    step that is a sibling can be retried: in a whole SubTree, repeating one leaf would not repeat
    the rest. SUCCESS only if the step was done after all or may be skipped. A visit may be skipped
    only if that does not leave out every exhibit of the tour.
    """

    PORTS = LEAVING_OUT
    _patience: Optional[Timer] = None  # ends the wait for a service that is gone
    _last_number = 0

    def work(self) -> Waiting[Result]:
        """Find the failure, and recover from it."""
        steps = self._steps()
        failed = self.mission.failures.newest(steps[0].uid if steps else self.uid, self.uid,
                                              self._last_number)
        self._last_number = self.mission.failures.newest_number
        if failed is None:
            failure = Failure(Cause.MISSING_DATA, "no mission node failed before")
            self._decided(self, failure, "give up", 0, GIVEN_UP, "")
            self.report(FAILURE)
            return FAILURE
        can_redo = failed.leaf.parent is self.parent and isinstance(failed.leaf, ServiceLeaf)
        recovery = Recovery(self.mission.policy, failed.leaf.spec, failed.failure, can_redo,
                            self.mission.afford_recovery(), lambda: self._leave_out(steps))
        return (yield from self._recover(failed, recovery))

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

    def on_halted(self) -> None:
        """Drop the recovery."""
        self._stop_waiting()
        super().on_halted()

    def _recover(self, failed: Failed, recovery: Recovery) -> Waiting[Result]:
        """Carry out the decisions of ``recovery``."""
        doing: Any = failed.leaf  # or its substitute
        step = recovery.next_step()
        while not isinstance(step, End):
            if isinstance(step, Retry):
                self._tell(failed.leaf, recovery, recovery.attempts + 1)
                yield from self._wait(recovery, step.pause)
            else:
                self._tell(failed.leaf, recovery, 0, step.spec.id)
                doing = self._substitute(step.spec)
            failure = yield from doing.try_once()
            step = recovery.attempted(failure)
            if failure is not None:
                self.mission.events.emit(Retried(doing.registration_id, doing.full_path,
                                                 recovery.attempts, failure))
        if step.outcome == GIVEN_UP:
            yield from self._make_safe(failed)
        self._stop_waiting()
        self._decided(failed.leaf, recovery.failure, str(recovery), recovery.attempts,
                      step.outcome, recovery.reason)
        self.summary, doing.summary = doing.summary, None  # of the attempt that succeeded
        if step.outcome != GIVEN_UP:
            return self.succeeded()
        # not recorded as a failure: an outer HandleFallBack looks for the original one
        self.mission.failures.give_up(recovery.failure)
        self.report(FAILURE, recovery.failure)
        return FAILURE

    def _tell(self, leaf: MissionLeaf, recovery: Recovery, attempt: int,
              substitute: str = "") -> None:
        self.mission.events.emit(
            Recovering(self.uid, leaf.registration_id, leaf.full_path, recovery.failure, attempt,
                       recovery.retries, substitute))

    def _decided(self, leaf: MissionLeaf, failure: Failure, policy: str, attempts: int,
                 outcome: str, reason: str) -> None:
        self.mission.events.emit(
            Recovered(leaf.registration_id, leaf.full_path, failure, policy, attempts,
                      outcome != GIVEN_UP, outcome, reason, self.uid))

    def _wait(self, recovery: Recovery, pause: float) -> Waiting[None]:
        """Wait for the pause before a retry, and then for the return of a service that the tour
        needs."""
        yield from self.pause(pause)
        health, resource = self.mission.health, recovery.failure.resource
        while recovery.is_indispensable and health.is_gone(resource):
            if self._patience is None:
                self.begin_wait(f"waiting for {health.gone_name(resource)} to return", RETURN_LIMIT)
                self._patience = self.mission.clock.call_after(RETURN_LIMIT, self.wake)
            if self._patience.callback is None:
                return
            yield None

    def _stop_waiting(self) -> None:
        if self._patience is not None:
            self._patience.cancel()
            self._patience = None

    def _substitute(self, spec: MissionSpec) -> Any:
        leaf: Any = spec.factory(spec.id)
        leaf.uid = self.uid
        leaf.registration_id, leaf.full_path = spec.id, self.full_path
        leaf.spec, leaf.attributes = spec, defaults(spec.ports)
        leaf.blackboard, leaf.services = self.blackboard, self.services
        leaf.mission = self.mission
        return leaf

    def _make_safe(self, failed: Failed) -> Waiting[None]:
        """Ask for the safe state, unless an inner HandleFallBack has left the robot in it."""
        if failed.number == self.mission.failures.given_up:
            return
        self.mission.failures.given_up = failed.number
        safe_state = self.mission.ask_for_safe_state()
        try:
            while not safe_state.is_over:
                yield None
        except GeneratorExit:
            safe_state.drop()
            raise
        self.mission.events.emit(safe_state.report())


SPECS = (
    leaf_spec("HandleFallBack", HandleFallBack,
              "Recovers from the failure before it, as the recovery policy says.",
              is_recovery=True),
    leaf_spec("HandleFallback", HandleFallBack, "Another spelling of HandleFallBack.",
              is_recovery=True, warning="HandleFallback is an old spelling; write HandleFallBack"),
)
