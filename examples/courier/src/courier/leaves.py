"""The node types of the delivery robot: a condition with a port, an action, and an action of
several ticks."""
from typing import NamedTuple, Optional

from behavior_controller.extend import (
    Answer, Evidence, Failure, Port, PortType, Request, ServiceLeaf, TopicCondition, Waiting,
    WorkingLeaf, leaf_spec)

from courier.interface import BATTERY, CloseHatch, Drive, OpenHatch


class Place(NamedTuple):
    """A place on the floor, in metres of the map frame."""

    x: float
    y: float


def place(text: str) -> Place:
    """Parse ``2.5;1``. Raises ValueError, which becomes a fault at the place of the text."""
    return Place(*map(float, text.split(";")))


PLACE = PortType("Place", Place, place)


class BatteryAbove(TopicCondition):
    """``<BatteryAbove percent="25"/>``: is the battery's level above that?"""

    PORTS = (Port("percent", "double", default="20"),)
    own_evidence = Evidence(BATTERY)
    awaiting = "waiting for the battery to be charged"
    otherwise = "the battery is too low"

    def read_ports(self) -> None:
        """Read the limit."""
        self.percent = self.get_input("percent")

    def is_evidence(self, value: float) -> bool:
        """Compare a level with the limit."""
        return value > self.percent


class Carry(ServiceLeaf):
    """``<Carry place="2.5;1"/>``: drives to that place; halted, it cancels its goal."""

    asks = Drive
    PORTS = (Port("place", PLACE, description="x;y in metres"),)

    def request(self) -> Request:
        """Drive to the place of the port."""
        return Drive(*self.get_input("place"))


class HandOver(WorkingLeaf):
    """``<HandOver seconds="10"/>``: opens the hatch for that long, and closes it."""

    asks = (OpenHatch, CloseHatch)
    PORTS = (Port("seconds", "double", default="10", description="how long the hatch is open"),)

    def try_once(self) -> Waiting[Optional[Failure]]:
        """Open, wait and close; a failure of either request is that of the leaf."""
        answer = yield from self.ask(OpenHatch())
        if isinstance(answer, Answer):
            seconds = self.get_input("seconds")
            self.begin_wait("waiting for the parcel to be taken", seconds)
            yield from self.pause(seconds)
            answer = yield from self.ask(CloseHatch())
        return answer if isinstance(answer, Failure) else None


SPECS = (
    leaf_spec("BatteryAbove", BatteryAbove, "Is the level of the battery high enough?"),
    leaf_spec("Carry", Carry, "Carries the parcel to a place."),
    leaf_spec("HandOver", HandOver, "Opens the hatch for a while."),
)
