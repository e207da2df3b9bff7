"""The kinds of leaf: stateful action, synchronous action and condition (BT.CPP section "Leaf kinds")."""
from behavior_controller.bt.engine.node import Node, NodeError, Result
from behavior_controller.bt.status import IDLE, RUNNING


class ActionLeaf(Node):
    """An action that may take several ticks (BT.CPP ``StatefulActionNode``).

    A leaf that has completed and was not reset returns its result again without running.
    """

    def on_start(self) -> Result:
        """Begin a round of work."""
        raise NotImplementedError

    def on_running(self) -> Result:
        """Go on with the round."""
        raise NotImplementedError

    def on_halted(self) -> None:
        """Drop the round; called only when the leaf is RUNNING."""

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
            self.services.changes += 1
        if result is IDLE:
            raise NodeError("StatefulActionNode::{}() must not return IDLE".format(callback))
        return result

    def halt(self) -> None:
        """Tell the leaf if it is RUNNING, then reset it."""
        if self.status is RUNNING:
            self.on_halted()
        self.reset()


class SyncActionLeaf(Node):
    """An action that is done within one tick (BT.CPP ``SyncActionNode``): RUNNING is an error, told once it is stored."""

    is_instant = True


class ConditionLeaf(Node):
    """A question that is asked again at every tick, whatever the answer was before (BT.CPP ``ConditionNode``)."""
