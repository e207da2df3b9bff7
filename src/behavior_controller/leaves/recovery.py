"""HandleFallBack: looks at the failure that brought it there and does what the recovery policy says (D5.4.3 §3.2.4)."""
from typing import Any, List, Optional

from behavior_controller.bt.engine.clock import Timer
from behavior_controller.bt.engine.leaf import ActionLeaf
from behavior_controller.bt.engine.node import Result
from behavior_controller.bt.registry import Kind, NodeSpec
from behavior_controller.bt.status import FAILURE, IDLE, RUNNING, SUCCESS
from behavior_controller.events import Recovered, Retried
from behavior_controller.gateway import SAFE_STATE, Call, Cause, Failure
from behavior_controller.leaves.base import Failed, MissionLeaf, ServiceLeaf
from behavior_controller.leaves.knowledge import leave_out_exhibit
from behavior_controller.policy import GIVE_UP, SKIP, Rule

VISITING = ("SelectExhibit", "Navigate")
"""Nodes that belong to the visit of an exhibit: to go on without them is to leave the exhibit out."""

RETURN_LIMIT = 15.0
"""Seconds that a retry waits for the return of a service that is known to be gone, if the tour cannot do without."""

DONE, SUBSTITUTED, SKIPPED, GIVEN_UP = "done", "substituted", "skipped", "given up"
"""How a recovery may end."""


class HandleFallBack(MissionLeaf, ActionLeaf):
    """``<HandleFallBack/>``: retries the failed step, does another instead, goes on without it, or gives up.

    The failure is the newest one of the leaves before this node below their common parent. Only a step that is itself
    the neighbour can be retried: of a whole SubTree, redoing one leaf would not do the rest. SUCCESS only if the step
    was done after all or may be skipped. A visit may be skipped only if that does not leave out every exhibit of the
    tour (reads and writes ``leftOutExhibits``, ``nextExhibit``).
    """

    def __init__(self, name: str):
        super().__init__(name)
        self.cause: Optional[Failed] = None
        self.rule: Rule = None  # type: ignore[assignment]
        self.attempts = 0
        self.stand_in: Optional[ServiceLeaf] = None  # what is done instead of the failed step
        self.call: Optional[Call] = None
        self.timer: Optional[Timer] = None
        self.patience: Optional[Timer] = None  # ends the wait for a service that is gone
        self.farewell: List[Call] = []  # the safe state under way
        self.is_giving_up = False
        self.last_number = 0
        self.because = ""  # why the policy's rule is not followed

    def on_start(self) -> Result:
        """Find the failure and decide."""
        self.started_at = self.mission.clock.now()
        steps = self._steps()
        self.cause = self.mission.failures.newest(steps[0].uid if steps else self.uid, self.uid, self.last_number)
        self.last_number = self.mission.failures.newest_number
        self.attempts, self.is_giving_up, self.because, self.stand_in = 0, False, "", None
        if self.cause is None:
            self.feedback_message = "no mission node failed before"
            self._report_end(GIVEN_UP, "give up", Failure(Cause.MISSING_DATA, self.feedback_message))
            return self._finished(False)
        self.rule = self.mission.policy.rule(self.cause.leaf.registration_id, self.cause.failure.cause)
        if not self._within_budget():
            self.rule = self.rule._replace(retries=0, then=GIVE_UP, substitute=None)
            self.because = ": the budget of {} recoveries in {:g} s is spent".format(
                self.mission.policy.most, self.mission.policy.seconds)
        if not self._is_neighbour():
            self.rule = self.rule._replace(retries=0, substitute=None)
        return self._next()

    def _steps(self) -> List[Any]:
        """Return the nodes before this one below the nearest ancestor that has any: a consecutive range of uids."""
        node: Any = self
        while node.parent is not None:
            before = node.parent.children[:node.parent.children.index(node)]
            if before:
                return before
            node = node.parent
        return []

    def _is_neighbour(self) -> bool:
        assert self.cause is not None
        return self.cause.leaf.parent is self.parent and isinstance(self.cause.leaf, ServiceLeaf)

    def _within_budget(self) -> bool:
        now, policy = self.mission.clock.now(), self.mission.policy
        recent = [began for began in self.mission.recoveries if began > now - policy.seconds] + [now]
        self.mission.recoveries = recent
        return len(recent) <= policy.most

    def _next(self) -> Result:
        """Wait for the next attempt, or end."""
        if self.attempts < self.rule.retries:
            self.timer = self.mission.clock.call_after(self.rule.back_off * 2 ** self.attempts, self._due)
            return RUNNING
        if self.rule.substitute is not None and self.stand_in is None:
            return self._stand_in(self.rule.substitute)
        if self._is_visit() and not leave_out_exhibit(self) and self.rule.then == SKIP:
            self.rule = self.rule._replace(then=GIVE_UP)
            self.because = ": every exhibit would be left out"
        if self.rule.then == SKIP:
            return self._ended(SKIPPED)
        return self._give_up()

    def _stand_in(self, spec: NodeSpec) -> Result:
        """Do another node in place of the one that failed."""
        leaf = spec.factory(spec.id)
        assert isinstance(leaf, ServiceLeaf)
        leaf.registration_id, leaf.full_path = spec.id, self.full_path
        leaf.blackboard, leaf.services, leaf.mission = self.blackboard, self.services, self.mission
        self.stand_in = leaf
        return self._attempt()

    def _is_visit(self) -> bool:
        return any(node.registration_id in VISITING for step in self._steps() for node in step.iterate())

    def _give_up(self) -> Result:
        """Leave the robot in the safe state."""
        assert self.cause is not None
        self.is_giving_up = True
        if self.cause.number != self.mission.failures.given_up:  # else an inner HandleFallBack has done it
            self.mission.failures.given_up = self.cause.number
            self.farewell = [self.mission.gateway.start(request) for request in SAFE_STATE]
        return self._leave()

    def _due(self) -> None:
        self.timer = None
        self.wake()

    def on_running(self) -> Result:
        """Go on with the attempt, or with the safe state."""
        if self.timer is not None:
            return RUNNING
        if self.is_giving_up:
            return self._leave()
        if self.call is None and self._awaits_return():
            return RUNNING
        return self._attempt()

    def _awaits_return(self) -> bool:
        """Return whether to put the attempt off: what is gone may be started again, and the tour cannot do without."""
        assert self.cause is not None
        if self.rule.then == SKIP or not self.mission.health.is_gone(self.cause.failure.resource):
            return False
        if self.patience is None:
            self.patience = self.mission.clock.call_after(RETURN_LIMIT, self.wake)
        return self.patience.callback is not None

    def _attempt(self) -> Result:
        assert self.cause is not None
        leaf = self.stand_in or self.cause.leaf
        assert isinstance(leaf, ServiceLeaf)
        if self.call is None:
            self.attempts += leaf is not self.stand_in
            wanted = leaf.request()
            if wanted is None:
                return self._done()
            if isinstance(wanted, Failure):
                return self._failed_again(leaf, wanted)
            self.call = self.mission.gateway.start(wanted)
        if self.call.result is None:
            return RUNNING
        result, self.call = self.call.result, None
        failure = result if isinstance(result, Failure) else leaf.accept(result)
        return self._done() if failure is None else self._failed_again(leaf, failure)

    def _done(self) -> Result:
        return self._ended(SUBSTITUTED if self.stand_in is not None else DONE)

    def _failed_again(self, leaf: ServiceLeaf, failure: Failure) -> Result:
        assert self.cause is not None
        self.mission.events.emit(Retried(leaf.registration_id, leaf.full_path, self.attempts, failure))
        if leaf is not self.stand_in:
            self.cause = self.cause._replace(failure=failure)
            # what was refused before may have been done this time: the rule is that of the new cause
            self.rule = self.mission.policy.rule(leaf.registration_id, failure.cause)
        return self._next()

    def _leave(self) -> Result:
        if any(call.result is None for call in self.farewell):
            return RUNNING
        self.farewell = []
        return self._ended(GIVEN_UP)

    def _ended(self, outcome: str) -> Result:
        assert self.cause is not None
        self._forget_timers()
        self._report_end(outcome, str(self.rule) + self.because, self.cause.failure)
        return self._finished(outcome != GIVEN_UP)

    def _report_end(self, outcome: str, policy: str, failure: Failure) -> None:
        path = self.cause.leaf.full_path if self.cause is not None else self.full_path
        node = self.cause.leaf.registration_id if self.cause is not None else self.registration_id
        self.mission.events.emit(
            Recovered(node, path, failure, policy, self.attempts, outcome != GIVEN_UP, outcome))

    def _forget_timers(self) -> None:
        for timer in (self.timer, self.patience):
            if timer is not None:
                timer.cancel()
        self.timer = self.patience = None

    def _finished(self, success: bool) -> Result:
        # a failed recovery is not a failure of its own: what an outer HandleFallBack looks for is the first one
        failure = None if success or self.cause is None else self.cause.failure
        self.report(SUCCESS if success else FAILURE, failure)
        return SUCCESS if success else FAILURE

    def on_halted(self) -> None:
        """Drop what is under way."""
        for call in self.farewell + ([self.call] if self.call is not None else []):
            call.drop()
        self._forget_timers()
        self.call, self.farewell = None, []
        self.report(IDLE)


SPECS = (
    NodeSpec("HandleFallBack", Kind.ACTION, HandleFallBack,
             description="Recovers from the failure before it, as the recovery policy says."),
    NodeSpec("HandleFallback", Kind.ACTION, HandleFallBack, description="Another spelling of HandleFallBack.",
             warning="HandleFallback is an old spelling; write HandleFallBack"),
)
