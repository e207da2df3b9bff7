"""Requests of leaves to the robot, its answers and messages, as plain records without ROS types."""
from typing import NamedTuple, Optional, Tuple, Union

from msgspec import Struct

from behavior_controller.text import count


class Location(NamedTuple):
    """A place on the floor: metres and degrees in the map frame."""

    x: float
    y: float
    theta_deg: float


class Point(NamedTuple):
    """A point in space, metres in the map frame."""

    x: float
    y: float
    z: float


class Exhibit(NamedTuple):
    """One place of the knowledge base (D5.4.3 section 3.2.5)."""

    name: str
    description1: str
    description2: str
    location: Location
    gesture: Point


# ------------------------------------------------------------------------------- requests (table 3)


Target = Union[Location, Point]


class Words(NamedTuple):
    """Phrases for a step: what the robot is ``doing``, what it has ``done``, and with what, if that
    matters.

    ``kind`` is that of the sentence at the end: see ``story.KINDS``. Without ``done`` there is no
    sentence at the end. ``target`` is the place in ``what``, which a mission may have a name for.
    """

    doing: str
    done: str = ""
    what: str = ""
    kind: str = "notice"
    target: Optional[Target] = None


def _aimed(doing: str, done: str, what: str, target: Target) -> Words:
    return Words(doing, done, what.format(*target), "moved", target)


MOTION, SOUND, NO_EFFECT = EFFECTS = "motion", "sound", ""
"""The effects of a request which the robot may go on with while nothing awaits its answer."""


LETTERS_A_SECOND = 14.0
"""The speed of a robot's speech, in characters a second."""


class Request(Struct, frozen=True, tag=True, tag_field="_type"):
    """A request to a service of the robot.

    ``switches`` is the name for people of what it switches on or off; empty: nothing. ``effect`` is
    ``MOTION`` unless its class says otherwise: a stop then counts it as under way until its end is
    known.
    """

    switches = ""
    effect = MOTION

    @property
    def words(self) -> Optional[Words]:
        """Phrases for the operator; None: the name of the node is used."""
        return None

    @property
    def usual_seconds(self) -> float:
        """How long a robot usually takes for it; 0: that is not known."""
        return 0.0


class SetAnimation(Request, frozen=True):
    """Switch lifelike movement: ``enabled`` or ``disabled``."""

    switches = "lifelike movement"
    effect = NO_EFFECT
    state: str

    @property
    def words(self) -> Words:
        """The end of switching lifelike movement has no sentence."""
        return Words(("starting" if self.state == "enabled" else "stopping") + " lifelike movement")


class PerformGesture(Request, frozen=True):
    """``iconic`` or ``deictic`` gesture number ``id``; ``target`` matters to deictic ones only.

    So do ``arm`` and ``shape`` (of the hand), which a robot of release 1.1 needs.
    """

    type: str
    id: int
    duration_ms: int
    target: Point = Point(0.0, 0.0, 0.0)
    bow_nod_angle_deg: int = 0
    arm: str = ""
    shape: str = ""

    @property
    def words(self) -> Words:
        """Phrases with the target, or with the number of an iconic gesture."""
        if self.type == "deictic":
            return _aimed("pointing", "pointed", "at {:g}, {:g}, {:g}", self.target)
        return Words("making", "made", f"{self.type} gesture {self.id}", "moved")


class QueryKnowledge(Request, frozen=True):
    """Ask for ``exhibits`` (all, in their order), ``entrance`` or ``home`` (one)."""

    effect = NO_EFFECT
    what: str

    @property
    def words(self) -> Words:
        """Phrases with the subject."""
        return Words(f"looking up the {self.what}")


class SetAttention(Request, frozen=True):
    """``disabled``, ``social``, ``scanning``, ``seeking`` or ``location`` (the only one that uses
    ``target``)."""

    switches = "attention"
    effect = NO_EFFECT
    state: str
    target: Point = Point(0.0, 0.0, 0.0)

    @property
    def words(self) -> Words:
        """Phrases with the target, or with the mode of attention."""
        if self.state == "location":
            return _aimed("looking", "looked", "at {:g}, {:g}, {:g}", self.target)
        if self.state == "disabled":
            return Words("switching attention off")
        return Words(f"setting attention to {self.state}")


class GoTo(Request, frozen=True):
    """Drive to ``goal``."""

    goal: Location

    @property
    def words(self) -> Words:
        """Phrases with the goal."""
        return _aimed("driving", "drove", "to {:g}, {:g}, {:g}°", self.goal)


class Prompt(Request, frozen=True):
    """Show ``options`` on the tablet and wait for one to be pressed."""

    effect = NO_EFFECT
    options: Tuple[str, ...]

    @property
    def words(self) -> Words:
        """Phrases with the options."""
        return Words("asking", "asked", f"on the tablet: {' or '.join(self.options)}", "asked")


class Say(Request, frozen=True):
    """Speak ``text``; answered when it has been spoken. A robot of release 1.0 needs its
    ``language``."""

    effect = SOUND
    text: str
    language: str = "English"

    @property
    def words(self) -> Words:
        """Phrases with the text."""
        return Words("saying", "said", f"“{self.text}”", "said")

    @property
    def usual_seconds(self) -> float:
        """The time that its words take."""
        return len(self.text) / LETTERS_A_SECOND


# -------------------------------------------------------------------------- requests of release 1.0


class SetPose(Request, frozen=True):
    """Set the robot's pose at the localization."""

    effect = NO_EFFECT
    words = Words("telling the localization where the robot stands")
    pose: Location


class SetRecognition(Request, frozen=True):
    """Switch speech recognition on or off."""

    effect = NO_EFFECT
    is_enabled: bool

    @property
    def words(self) -> Words:
        return Words("switching speech recognition " + ("on" if self.is_enabled else "off"))


class SetRecognitionLanguage(Request, frozen=True):
    """Recognise speech of ``language``."""

    effect = NO_EFFECT
    language: str

    @property
    def words(self) -> Words:
        return Words(f"having {self.language} recognised")


class Listen(Request, frozen=True):
    """Hear the next utterance, which has to begin within ``seconds``."""

    effect = NO_EFFECT
    seconds: float


# -------------------------------------------------------------------------- requests of release 1.1


class PerformGestureGoal(PerformGesture, frozen=True):
    """Make the gesture as the goal of an action."""


class GoToGoal(GoTo, frozen=True):
    """Drive as the goal of an action."""


class SayGoal(Say, frozen=True):
    """Speak as the goal of an action."""


class Answer(Struct, frozen=True, tag=True, tag_field="_type"):
    """A server's usable, positive answer. ``response`` is the tablet's; ``exhibits`` the knowledge
    base's."""

    response: str = ""
    exhibits: Tuple[Exhibit, ...] = ()


# --------------------------------------------------------------------------------- topics (table 2)


class Faces(NamedTuple):
    """One message of face detection: a label for each face, and whether that face looks at the
    robot."""

    labels: Tuple[str, ...]
    mutual_gaze: Tuple[bool, ...]

    def in_words(self) -> str:
        """Return how many faces there are, and how many look at the robot."""
        if not self.labels:
            return "no face"
        faces, looking = count(len(self.labels), "face"), sum(self.mutual_gaze)
        if not looking:
            return faces
        return f"{faces}, {looking} looking at the robot"


class AttentionStatus(NamedTuple):
    """One message of overt attention: the mode, and the status of ``seeking``."""

    state: str
    value: int
