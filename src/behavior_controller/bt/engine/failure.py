"""Failures of nodes: an exception in a node's code, in a callback that it set, or in its halt, tied
to that node."""
import sys
from types import FrameType
from typing import Any, Callable, Optional, Tuple

from py_trees.behaviour import Behaviour

from behavior_controller.errors import BehaviorControllerError
from behavior_controller.foreign_code import described, is_ctrl_c


class TickError(BehaviorControllerError):
    """A tick ended in an exception. Wrapped once, at the node in whose rule it happened (BT.CPP
    ``NodeExecutionError``).

    ``node`` is None for a callback that no node has set.
    """

    def __init__(self, node: Any, cause: BaseException, where: str = ""):
        """``where`` names the part of the node that is not its rule."""
        owner, place = "a callback", ""
        if node is not None:
            owner = f"node '{node.full_path}' [{node.registration_id}]"
            place = node.place_in_file()
        self.origin = getattr(node, "element", None), None
        if not isinstance(cause, BehaviorControllerError):
            text = described(cause, type(node))
        else:
            text = str(cause)
            if cause.origin[0]:
                self.origin = cause.origin
        super().__init__(f"Exception in {where}{owner}: {place}{text}")
        self.node = node
        self.cause = self.__cause__ = cause


def failure_of(node: Any, error: BaseException, where: str = "") -> BaseException:
    """Return ``error``, which the code of ``node`` raised, as a TickError; a Ctrl-C and a TickError
    as they are."""
    if isinstance(error, TickError) or is_ctrl_c(error):
        return error
    return TickError(node, error, where)


def owner_of(callback: Callable[..., Any]) -> Any:
    """Return the node whose method ``callback`` is, or else whose code has called our caller; None
    if there is none."""
    owner = getattr(callback, "__self__", None)
    return owner if _is_node(owner) else node_on(sys._getframe(2))[0]


def node_on(frame: Optional[FrameType]) -> Tuple[Any, Optional[FrameType]]:
    """Return the node whose code runs on the stack that ends with ``frame``, and the frame of that
    code; or None."""
    while frame is not None:
        if "self" in frame.f_code.co_varnames or "self" in frame.f_code.co_freevars:
            candidate = frame.f_locals.get("self")
            if _is_node(candidate):
                return candidate, frame
        frame = frame.f_back
    return None, None


def _is_node(candidate: Any) -> bool:
    """Return whether this is a node of a tree; a behaviour of py_trees inside a leaf is none."""
    # in this order: a timer looks at each frame of the stack, and an ABC's isinstance is slow
    return hasattr(candidate, "full_path") and isinstance(candidate, Behaviour)
