"""The kinds of leaf: stateful action, synchronous action, condition (BT.CPP section "Leaf kinds"),
py_trees behaviour."""
from typing import Any, Callable, Tuple

from py_trees.behaviour import Behaviour

from behavior_controller.bt.engine.node import Node, NodeError, Result, Timed
from behavior_controller.bt.engine.registry import Kind
from behavior_controller.bt.values.status import IDLE, RUNNING, SUCCESS

POLLING = 10
"""Milliseconds until a RUNNING py_trees behaviour, which has no wake-up, is ticked again (BT.CPP's
default)."""


class ActionLeaf(Node):
    """An action that may take several ticks (BT.CPP ``StatefulActionNode``).

    A leaf that has completed and was not reset returns its result again without running.
    """

    KIND = Kind.ACTION
    RULE: Tuple[str, ...] = ("on_start", "on_running")

    def on_start(self) -> Result:
        """Start the action."""
        raise NotImplementedError

    def on_running(self) -> Result:
        """Continue the action."""
        raise NotImplementedError

    def on_halted(self) -> None:
        """Abort the action; called only when the leaf is RUNNING."""

    @property
    def rule(self) -> Callable[..., Any]:
        """The method of this tick."""
        return getattr(type(self), self.RULE[self.status is RUNNING])

    def update(self) -> Result:
        """Start, go on, or repeat the result."""
        status = self.status
        if status is IDLE:
            result, callback = self.on_start(), "onStart"
        elif status is RUNNING:
            result, callback = self.on_running(), "onRunning"
        else:
            return status
        if result is not RUNNING:
            self.services.actions += 1
        if result is IDLE:
            raise NodeError(f"StatefulActionNode::{callback}() must not return IDLE")
        return result

    def halt(self) -> None:
        """Call ``on_halted`` once if the leaf is RUNNING, then reset it."""
        try:
            if self.status is RUNNING:
                self.on_halted()
        finally:
            self.reset()


class TimedAction(Timed, ActionLeaf):
    """An action that is done after a time."""

    def begin(self, msec: int) -> Result:
        """Start the timer; without a time, complete."""
        if not msec:
            return self.completed()
        self.start_timer(msec)
        return RUNNING

    def completed(self) -> Result:
        """Return the result when the time is over."""
        return SUCCESS

    def on_running(self) -> Result:
        """Wait for the timer."""
        return self.completed() if self.over else RUNNING


class SyncActionLeaf(Node):
    """An action that is done within one tick (BT.CPP ``SyncActionNode``): RUNNING is an error,
    reported once it is stored."""

    KIND = Kind.ACTION
    is_instant = True


class ConditionLeaf(Node):
    """A condition that is evaluated at every tick (BT.CPP ``ConditionNode``)."""

    KIND = Kind.CONDITION


class BehaviourLeaf(Timed):
    """An ordinary py_trees behaviour as a leaf, with all that is below it. py_trees' rules apply to
    it.

    To py_trees' tools the leaf is that behaviour: its id, its message, its blackboard clients.
    """

    is_foreign = True

    def __init__(self, name: str, behaviour: Behaviour):
        """Raises ValueError if the behaviour is in a tree already."""
        super().__init__(name)
        if behaviour.parent is not None:
            raise ValueError("its factory returned the same behaviour twice")
        behaviour.parent = self
        self.behaviour = behaviour

    @property
    def id(self) -> Any:
        """The behaviour's identifier."""
        return self.behaviour.id

    @property
    def blackboards(self) -> Any:
        """The behaviour's blackboard clients."""
        return self.behaviour.blackboards

    def setup(self, **kwargs: Any) -> None:
        """Set up the behaviour and what is below it."""
        for part in self.behaviour.iterate():
            part.setup(**kwargs)

    def shutdown(self) -> None:
        """Shut down the behaviour and what is below it."""
        for part in self.behaviour.iterate():
            part.shutdown()

    def update(self) -> Result:
        """Tick the behaviour as py_trees does."""
        self.stop_timer()
        self.behaviour.tick_once()
        self.feedback_message = self.behaviour.feedback_message
        status = self.behaviour.status
        if status is IDLE:
            allowed = "it must return RUNNING, SUCCESS or FAILURE"
            raise NodeError(f"its update returned INVALID or no status; {allowed}")
        if status is RUNNING:
            self.start_timer(POLLING)
        else:
            self.services.actions += 1
        return status

    def halt(self) -> None:
        """Stop the behaviour if it is RUNNING, which calls its ``terminate(INVALID)``."""
        try:
            if self.behaviour.status is RUNNING:
                self.behaviour.stop(IDLE)
        except BaseException:
            self.behaviour.status = IDLE  # it is not stopped again
            raise
        finally:
            super().halt()
