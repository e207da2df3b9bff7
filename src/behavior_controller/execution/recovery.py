"""The recovery from one failure as a state machine: the next step by the policy, without tree,
clock or services."""
from typing import Callable, NamedTuple, Optional, Union

from behavior_controller.robot.gateway import Failure
from behavior_controller.config.node_facts import MissionSpec
from behavior_controller.config.recovery_policy import GIVE_UP, Policy, Rule, SKIP

DONE, SUBSTITUTED, SKIPPED, GIVEN_UP = "done", "substituted", "skipped", "given up"
"""How a recovery may end."""


class Retry(NamedTuple):
    """Do the failed step again after ``pause`` seconds."""

    pause: float


class Substitute(NamedTuple):
    """Run this node instead of the failed one."""

    spec: MissionSpec


class End(NamedTuple):
    """The recovery is over."""

    outcome: str


Step = Union[Retry, Substitute, End]


class Recovery:
    """Decides one step after another: ``next_step``, then ``attempted`` with its result."""

    def __init__(self, policy: Policy, node: MissionSpec, failure: Failure, can_redo: bool,
                 is_affordable: bool, leave_out: Callable[[], bool]):
        """``can_redo`` is false if repeating one node would not repeat all that failed (a SubTree).

        ``is_affordable`` is false once the budget is spent. ``leave_out`` notes that the mission
        goes on without the step, and returns whether the mission may.
        """
        self.failure = failure
        self.attempts = 0
        self._policy = policy
        self._node = node
        self._leave_out = leave_out
        self.reason = ""  # why the policy's rule is not followed
        self._is_substituting = False
        self._rule: Rule = policy.rule(node, failure.cause)
        if not is_affordable:
            self._give_up(policy.spent)
        if not can_redo:
            self._rule = self._rule._replace(retries=0, substitute=None)

    def __str__(self) -> str:
        """Return the rule that was followed, in words, and why it was not the policy's."""
        return str(self._rule) + (": " + self.reason if self.reason else "")

    @property
    def retries(self) -> int:
        """How often the rule allows the step to be tried again."""
        return self._rule.retries

    @property
    def is_indispensable(self) -> bool:
        """Whether the mission cannot go on without the step."""
        return self._rule.then != SKIP

    def _give_up(self, reason: str) -> None:
        self._rule = self._rule._replace(retries=0, then=GIVE_UP, substitute=None)
        self.reason = reason

    def next_step(self) -> Step:
        """Return what to do now that the last attempt has failed."""
        if self.attempts < self._rule.retries:
            return Retry(self._rule.back_off * 2 ** self.attempts)
        if self._rule.substitute is not None and not self._is_substituting:
            self._is_substituting = True
            return Substitute(self._rule.substitute)
        if not self._leave_out() and self._rule.then == SKIP:
            self._rule = self._rule._replace(then=GIVE_UP)
            self.reason = "every stop would be left out"
        return End(SKIPPED if self._rule.then == SKIP else GIVEN_UP)

    def attempted(self, failure: Optional[Failure]) -> Step:
        """Take the outcome of a retry or of the substitute (None: it was done) and return what to
        do next."""
        if self._is_substituting:
            return End(SUBSTITUTED) if failure is None else self.next_step()
        self.attempts += 1
        if failure is None:
            return End(DONE)
        self.failure = failure
        # what was refused before may have been done this time: the rule is that of the new cause
        self._rule = self._policy.rule(self._node, failure.cause)
        return self.next_step()
