"""The five results of a tick, under BehaviorTree.CPP's names.

IDLE is py_trees' INVALID, so that py_trees' display and visitor tools work with our nodes. SKIPPED
is only ever returned: it is never stored as the status of a node (BT.CPP,
``TreeNode::executeTick``), and py_trees has no such status.
"""
import enum

from py_trees.common import Status


class Skipped(enum.Enum):
    """The result of a node that chose not to run."""

    SKIPPED = "SKIPPED"


IDLE = Status.INVALID
RUNNING = Status.RUNNING
SUCCESS = Status.SUCCESS
FAILURE = Status.FAILURE
SKIPPED = Skipped.SKIPPED

BY_NAME = {
    "IDLE": IDLE, "RUNNING": RUNNING, "SUCCESS": SUCCESS, "FAILURE": FAILURE, "SKIPPED": SKIPPED}
NAMES = {status: name for name, status in BY_NAME.items()}
NUMBERS = {status: number for number, status in enumerate(NAMES)}
"""The statuses as BehaviorTree.CPP numbers them."""
