"""Leaves that drive (/robotNavigation/set_goal)."""
from typing import Union

from behavior_controller.bt.registry import Kind, NodeSpec
from behavior_controller.gateway import Cause, Failure
from behavior_controller.interface.records import GoTo, Request
from behavior_controller.leaves.base import TARGET_LOCATION, ServiceLeaf


class Navigate(ServiceLeaf):
    """``<Navigate/>``: drives to ``targetLocation``."""

    asks = GoTo

    def request(self) -> Union[Request, Failure]:
        """Drive."""
        target = self.recall(TARGET_LOCATION)
        if target is None:
            return Failure(Cause.MISSING_DATA, "there is no target location", self.resource)
        return GoTo(target)


SPECS = (NodeSpec("Navigate", Kind.ACTION, Navigate, description="Drives to the current target location."),)
