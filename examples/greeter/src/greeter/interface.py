"""The service that this package's robot offers beside those of cssr_system: its lights."""
from dataclasses import dataclass

from behavior_controller.interface import Service, Success
from behavior_controller.interface.records import Request, Words


@dataclass(frozen=True)
class SetLights(Request):
    """Light up in ``colour``."""

    colour: str

    @property
    def words(self) -> Words:
        """What an operator is told."""
        return Words("lighting up", "lit up", "in {}".format(self.colour), "moved")


SERVICES = (
    Service(SetLights, "/lights/set_colour", "lights", "greeter/lightsService", lambda request: (request.colour,),
            Success("success", True, False), 5.0, "the robot's lights stay as they are"),
)
