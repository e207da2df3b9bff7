"""HandleFallBack: finds the failure that led to it and does what the recovery policy says (D5.4.3
§3.2.4)."""
from typing import Any, Dict, List, Optional, Tuple

from behavior_controller.bt.engine.clock import Timer
from behavior_controller.bt.engine.origin import origins, steps_before
from behavior_controller.bt import Kind, Node, PortError, Result, FAILURE, RUNNING
from behavior_controller.bt.engine.ports import defaults
from behavior_controller.run.events import (
    DONE, GIVEN_UP, SKIPPED, SUBSTITUTED, Noticed, Recovered, Recovering, Retried)
from behavior_controller.robot.gateway import Cause, Failure
from behavior_controller.leaves.base import MissionLeaf, Waiting, WorkingLeaf, leaf_spec
from behavior_controller.leaves.knowledge import LEAVING_OUT
from behavior_controller.config.node_facts import MissionSpec
from behavior_controller.config.recovery_policy import GIVE_UP, SKIP, Rule
from behavior_controller.text import joined

RETURN_LIMIT = 15.0
"""Seconds that all retries of a step together wait for the return of a service that is known to be
gone, if the mission needs the step."""


class HandleFallBack(WorkingLeaf):
    """``<HandleFallBack/>``: retries the failed step, runs a substitute, goes on without it, or
    gives up.

    The failure is the one with which the nodes before this node below their common parent have
    failed: that of a mission leaf, of a leaf that was halted while it was under way, or of another
    node. Only a step that is a sibling can be retried: in a whole SubTree, repeating one leaf would
    not repeat the rest. SUCCESS only if the step was done after all or may be skipped. A visit may
    be skipped only if that does not leave out every exhibit of the tour.
    """

    PORTS = LEAVING_OUT
    _patience: Optional[Timer] = None  # ends the wait for a service that is gone
    _known = 0  # the changes of status at the last recovery
    _substitutes: Dict[str, Any]  # by node type
    # of the recovery under way
    _leaf: Node  # the step that failed
    _failure: Failure  # the last one of that step
    _rule: Rule  # for this failure
    _reason = ""  # why the policy's rule is not followed
    _attempts = 0  # retries so far

    def join(self) -> None:
        """Make the substitutes for the steps before it: a mistake in one refuses the mission."""
        self._substitutes = {}
        if not any(rule.substitute for rule in self.mission.policy.rules):
            return
        rules = [self.rule(step, cause) for step in steps_before(self) for cause in Cause]
        specs = {rule.substitute.id: rule.substitute for rule in rules if rule.substitute}
        self._substitutes = {name: self._substitute(spec) for name, spec in specs.items()}

    def work(self) -> Waiting[Result]:
        """Find the failure, and recover from it."""
        steps = steps_before(self)
        self._attempts, self._reason = 0, ""
        self._leaf, self._failure = self._find_failure(steps)
        if self._leaf is self:
            self._decided(GIVEN_UP, "give up")
            return self.report(FAILURE)
        self._rule = self.rule(self._leaf, self._failure.cause)
        if not self.mission.afford_recovery():
            self._rule = self._rule._replace(retries=0, then=GIVE_UP, substitute=None)
            self._reason = self.mission.policy.spent
        try:
            outcome = (yield from self._do_instead()) or self._go_on(steps)
        finally:
            if self._patience is not None:
                self._patience.cancel()
            self._patience = None
        if outcome == GIVEN_UP:
            yield from self._make_safe()
        self._decided(outcome, joined(": ", str(self._rule), self._reason))
        if outcome != GIVEN_UP:
            return self.succeeded()
        # not recorded as a failure: an outer HandleFallBack looks for the original one
        self.mission.failures.unrecovered.append(self._failure)
        return self.report(FAILURE, self._failure)

    def _find_failure(self, steps: List[Any]) -> Tuple[Node, Failure]:
        """Return the node with which the failure of ``steps`` began, and why it failed; this node
        if nothing can be recovered from."""
        found, self._known = origins(steps, self._known), self.services.changes
        nothing = "no mission node failed before"
        if not found:
            return self, Failure(Cause.MISSING_DATA, nothing)
        origin = next((node for node in reversed(found) if isinstance(node, MissionLeaf)),
                      found[-1])
        is_condition, name = origin.spec.kind is Kind.CONDITION, _name(origin)
        if origin.last_status is RUNNING:
            halting = origin
            while halting.last_status is RUNNING:
                halting = halting.parent
            text = f"{_name(halting)} halted {name} before it was done"
            if not isinstance(origin, MissionLeaf):
                return halting, Failure(Cause.NO_ANSWER, text)
            cause = Cause.CONDITION_FALSE if is_condition else Cause.NO_ANSWER
            return origin, Failure(cause, text, origin.resource)
        if isinstance(origin, MissionLeaf) and origin.failure is not None:
            return origin, origin.failure
        if is_condition:
            text = origin.feedback_message or f"{name} does not hold"
            return origin, Failure(Cause.CONDITION_FALSE, text)
        return self, Failure(Cause.MISSING_DATA, f"{name} failed, and {nothing}")

    def rule(self, leaf: Node, cause: Cause) -> Rule:
        """Return what to do about the failure of ``leaf``."""
        rule = self.mission.policy.rule(leaf.spec, cause)
        if leaf.parent is self.parent and isinstance(leaf, WorkingLeaf) and leaf.can_redo:
            return rule
        return rule._replace(retries=0, substitute=None)

    def _do_instead(self) -> Waiting[str]:
        """Try the step again, then its substitute; return what helped, or else nothing."""
        while self._attempts < self._rule.retries:
            self._tell(self._attempts + 1)
            yield from self._wait(self._rule.back_off * 2 ** self._attempts)
            self._attempts += 1
            failure = yield from self._try(self._leaf)
            if failure is None:
                return DONE
            self._failure = failure
            # what was refused before may have been done this time
            self._rule = self.rule(self._leaf, failure.cause)
        substitute = self._rule.substitute
        if substitute is not None:
            self._tell(0, substitute.id)
            if (yield from self._try(self._substitutes[substitute.id])) is None:
                return SUBSTITUTED
        return ""

    def _try(self, leaf: Any) -> Waiting[Optional[Failure]]:
        failure = yield from leaf.try_once()
        self.summary, leaf.summary = leaf.summary, None  # of the attempt that succeeded
        if failure is not None:
            self.mission.events.emit(
                Retried(leaf.registration_id, leaf.full_path, self._attempts, failure))
        return failure

    def _go_on(self, steps: List[Any]) -> str:
        """Return whether the mission goes on without the step, or gives up."""
        if not self.leave_out(steps) and self._rule.then == SKIP:
            self._rule = self._rule._replace(then=GIVE_UP)
            self._reason = "every stop would be left out"
        return SKIPPED if self._rule.then == SKIP else GIVEN_UP

    def leave_out(self, steps: List[Any]) -> bool:
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

    def _tell(self, attempt: int, substitute: str = "") -> None:
        self.mission.events.emit(
            Recovering(self.uid, self._leaf.registration_id, self._leaf.full_path, self._failure,
                       attempt, self._rule.retries, substitute))

    def _decided(self, outcome: str, policy: str) -> None:
        self.mission.events.emit(
            Recovered(self._leaf.registration_id, self._leaf.full_path, self._failure, policy,
                      self._attempts, outcome != GIVEN_UP, outcome, self._reason, self.uid))

    def _wait(self, pause: float) -> Waiting[None]:
        """Wait for the pause before a retry, and then for the return of a service that the tour
        needs."""
        yield from self.pause(pause)
        health, resource = self.mission.health, self._failure.resource
        while self._rule.then != SKIP and health.is_gone(resource):
            if self._patience is None:
                self.begin_wait(f"waiting for {health.gone_name(resource)} to return", RETURN_LIMIT)
                self._patience = self.mission.clock.call_after(RETURN_LIMIT, self.wake)
            if self._patience.callback is None:
                return
            yield None

    def _substitute(self, spec: MissionSpec) -> Any:
        leaf: Any = spec.factory(spec.id)
        leaf.uid = self.uid
        leaf.registration_id, leaf.full_path = spec.id, self.full_path
        leaf.spec, leaf.attributes = spec, defaults(spec.ports)
        leaf.blackboard, leaf.services = self.blackboard, self.services
        leaf.configure()
        leaf.setup(mission=self.mission)
        return leaf

    def _make_safe(self) -> Waiting[None]:
        """Ask for the safe state, unless an inner HandleFallBack has left the robot in it."""
        given_up = self._leaf, self._leaf.changed_at
        if given_up == self.mission.failures.given_up:
            return
        self.mission.failures.given_up = given_up
        safe_state = self.mission.ask_for_safe_state()
        if safe_state.result is None:
            yield safe_state
        self.mission.events.emit(safe_state.report())


def _name(node: Node) -> str:
    return node.full_path.rpartition("/")[2]


SPECS = (
    leaf_spec("HandleFallBack", HandleFallBack,
              "Recovers from the failure before it, as the recovery policy says.",
              is_recovery=True),
    leaf_spec("HandleFallback", HandleFallBack,
              "Recovers from the failure before it; another name of HandleFallBack.",
              is_recovery=True, warning="HandleFallback is an old spelling; write HandleFallBack"))
