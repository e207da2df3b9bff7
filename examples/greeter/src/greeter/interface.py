"""What this package's robot offers beside cssr_system: a service for its lights, the topic of a
doorbell, an action that drives, and a display."""
import math

from behavior_controller.extend import (
    Action, NO_EFFECT, Publication, Request, Service, Success, Topic, Words)


class SetLights(Request, frozen=True):
    """Light up in ``colour``."""

    effect = NO_EFFECT
    colour: str

    @property
    def words(self) -> Words:
        """What an operator is told."""
        return Words("lighting up", "lit up", "in {}".format(self.colour), "moved")


class MoveTo(Request, frozen=True):
    """Drive to a pose in the map frame."""

    x: float
    y: float
    theta_deg: float

    @property
    def words(self) -> Words:
        """What an operator is told."""
        return Words("driving", "drove", f"to {self.x:g}, {self.y:g}", "moved")


class ShowText(Request, frozen=True):
    """Show ``text`` on the display."""

    effect = NO_EFFECT
    text: str


def target_pose(request: MoveTo) -> dict:
    """Return the goal's pose as ``rostopic pub`` takes it; what is left out is 0."""
    half = math.radians(request.theta_deg) / 2
    return {"header": {"stamp": "now", "frame_id": "map"},
            "pose": {"position": {"x": request.x, "y": request.y},
                     "orientation": {"z": math.sin(half), "w": math.cos(half)}}}


def place(feedback) -> str:
    """Return where move_base says that the robot is."""
    position = feedback.base_position.pose.position
    return f"at {position.x:.1f}, {position.y:.1f}"


SERVICES = (
    Service(SetLights, "/lights/set_colour", "lights", "greeter/lightsService",
            lambda request: (request.colour,), Success("success", True, False), 5.0,
            "the robot's lights stay as they are"),
    # an action: the status of its goal says whether it is done, so no field of the result does
    Action(MoveTo, "/move_base", "move_base", "greeter/moveBase",
           lambda request: (target_pose(request),), None, 120.0, "the robot cannot drive",
           feedback=place),
    # a message
    Publication(ShowText, "/display/text", "display", "std_msgs/String",
                lambda request: (request.text,), None, 5.0, "nothing is displayed"),
)

DOORBELL = Topic("/doorbell/pressed", "doorbell", "std_msgs/Bool", bool,
                 lambda message: message.data, "visitors at the door are not noticed",
                 is_continuous=False, simulated_value=lambda seconds: True)
TOPICS = (DOORBELL,)
