"""The node types of this package: a leaf on a service of cssr_system, leaves on our own service,
action and display, a condition on our own topic, and a decorator."""
import time

from behavior_controller.extend import (
    Decorator, Evidence, Kind, NodeSpec, Port, RUNNING, Request, Result, SUCCESS, Say, ServiceLeaf,
    TopicCondition, leaf_spec)

from greeter.interface import DOORBELL, MoveTo, SetLights, ShowText


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


class DriveTo(ServiceLeaf):
    """``<DriveTo x="1.5" y="0.5" theta_deg="90"/>``: drives there; halted, it cancels its goal."""

    asks = MoveTo
    PORTS = (Port("x", "double", description="metres in the map frame"),
             Port("y", "double", description="metres in the map frame"),
             Port("theta_deg", "double", default="0", description="degrees"))

    def request(self) -> Request:
        """Drive to the place of the ports."""
        return MoveTo(self.get_input("x"), self.get_input("y"), self.get_input("theta_deg"))


class Display(ServiceLeaf):
    """``<Display text="Hello"/>``: publishes a text to the display."""

    asks = ShowText
    PORTS = (Port("text", description="what is shown"),)

    def request(self) -> Request:
        """Show the text."""
        return ShowText(self.get_input("text"))


class DoorbellRang(TopicCondition):
    """``<DoorbellRang/>``: has somebody rung since this visit began?"""

    own_evidence = Evidence(DOORBELL, lambda is_pressed, gaze_value: is_pressed)
    awaiting = "waiting for the doorbell"

    def not_before(self) -> float:
        """Leave the rings for earlier visitors out."""
        return self.mission.visit_began


class EveryOther(Decorator):
    """``<EveryOther>``: the child is done every other time, beginning with the first; else SUCCESS
    without it."""

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
    leaf_spec("DriveTo", DriveTo, "Drives to a place."),
    leaf_spec("Display", Display, "Shows a text."),
    leaf_spec("DoorbellRang", DoorbellRang, "Has the doorbell rung?"),
    NodeSpec("EveryOther", Kind.DECORATOR, EveryOther,
             description="Does the child every other time."),
)
