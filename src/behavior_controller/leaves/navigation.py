"""Leaves that drive (/robotNavigation/set_goal)."""
from behavior_controller.robot.requests import GoTo, Request
from behavior_controller.leaves.base import ServiceLeaf, leaf_spec
from behavior_controller.leaves.data import TARGET_LOCATION
from behavior_controller.leaves.knowledge import leave_out_exhibit


class Navigate(ServiceLeaf):
    """``<Navigate/>``: drives to the target."""

    asks = GoTo
    PORTS = (TARGET_LOCATION.read("target"),)

    def request(self) -> Request:
        return self.asks(self.get_input("target"))


SPECS = (leaf_spec("Navigate", Navigate, "Drives to the current target location.",
                   is_indispensable=True, leave_out=leave_out_exhibit),)
