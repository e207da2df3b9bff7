"""What the delivery robot offers: an action that drives, a hatch, and the level of its battery."""
from behavior_controller.extend import Action, Request, Service, Success, Topic, Words


class Drive(Request, frozen=True):
    """Drive to a place, in metres of the map frame."""

    x: float
    y: float

    @property
    def words(self) -> Words:
        """What an operator is told."""
        return Words("driving", "drove", f"to {self.x:g}, {self.y:g}", "moved")


class OpenHatch(Request, frozen=True):
    """Open the hatch."""

    words = Words("opening", "opened", "the hatch", "moved")


class CloseHatch(Request, frozen=True):
    """Close the hatch."""

    words = Words("closing", "closed", "the hatch", "moved")


def target(request: Drive) -> dict:
    """Return the goal's PoseStamped as ``rostopic pub`` takes it; what is left out is 0."""
    return {"header": {"stamp": "now", "frame_id": "map"},
            "pose": {"position": {"x": request.x, "y": request.y}, "orientation": {"w": 1.0}}}


def trigger(request: type, name: str, impact: str) -> Service:
    """Return the declaration of a Trigger, whose request has no fields."""
    return Service(request, name, "hatch", "std_srvs/Trigger", lambda request: (),
                   Success("success", True, False), 5.0, impact)


SERVICES = (
    Action(Drive, "/drive", "base", "courier/drive", lambda request: (target(request),), None, 60.0,
           "nothing is delivered", feedback=lambda feedback: f"{feedback.metres_left:.1f} m left"),
    trigger(OpenHatch, "/hatch/open", "no parcel can be taken out"),
    trigger(CloseHatch, "/hatch/close", "the hatch stays open"),
)

BATTERY = Topic("/battery/level", "battery", "std_msgs/Float32", float,
                lambda message: message.data, "an empty battery is not noticed",
                is_continuous=True, simulated_value=lambda seconds: 80.0 - seconds / 10.0)
TOPICS = (BATTERY,)
