"""The node types of this package: a leaf on a service of cssr_system, one on our own service, and a decorator."""
import time

from behavior_controller.bt.engine.decorators import Decorator
from behavior_controller.bt.engine.node import Result
from behavior_controller.bt.registry import Kind, NodeSpec, Port
from behavior_controller.bt.status import RUNNING, SUCCESS
from behavior_controller.interface.records import Request, Say
from behavior_controller.leaves.base import ServiceLeaf, leaf_spec

from greeter.interface import SetLights


class SayTime(ServiceLeaf):
    """``<SayTime/>``: says what time it is."""

    asks = Say

    def request(self) -> Request:
        """Say the time of day."""
        return Say(time.strftime("It is %H:%M."), self.mission.language)


class Lights(ServiceLeaf):
    """``<Lights colour="blue"/>``: sets the colour of the robot's lights."""

    asks = SetLights
    PORTS = (Port("colour", default="white", description="the colour, in words"),)

    def request(self) -> Request:
        """Set the colour."""
        return SetLights(self.get_input("colour"))


class EveryOther(Decorator):
    """``<EveryOther>``: the child is done every other time, beginning with the first; else SUCCESS without it."""

    def __init__(self, name: str):
        super().__init__(name)
        self.times = 0

    def update(self) -> Result:
        """Tick the child, or pass it over."""
        if self.status is not RUNNING:
            self.times += 1
        self.begin()
        return self.tick_child() if self.times % 2 else SUCCESS


SPECS = (
    leaf_spec("SayTime", SayTime, "Says what time it is."),
    leaf_spec("Lights", Lights, "Sets the colour of the robot's lights."),
    NodeSpec("EveryOther", Kind.DECORATOR, EveryOther, description="Does the child every other time."),
)
