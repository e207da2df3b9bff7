"""Requests of leaves to the robot, its answers and messages, as plain records without ROS types."""
from dataclasses import dataclass
from typing import NamedTuple, Optional, Tuple


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


# ------------------------------------------------------------------------------------------------ requests (table 3)


class Words(NamedTuple):
    """Phrases for a step: what the robot is ``doing``, what it has ``done``, and with what, if that matters.

    ``kind`` is that of the sentence at the end: see ``story.KINDS``. Without ``done`` there is no sentence at the end.
    """

    doing: str
    done: str = ""
    what: str = ""
    kind: str = "notice"


@dataclass(frozen=True)
class Request:
    """A request to a service of the robot."""

    @property
    def words(self) -> Optional[Words]:
        """Phrases for the operator; None: the name of the node is used."""
        return None


@dataclass(frozen=True)
class SetAnimation(Request):
    """Switch lifelike movement: ``enabled`` or ``disabled``."""

    state: str

    @property
    def words(self) -> Words:
        """The end of switching lifelike movement has no sentence."""
        return Words("starting lifelike movement" if self.state == "enabled" else "stopping lifelike movement")


@dataclass(frozen=True)
class PerformGesture(Request):
    """``iconic`` or ``deictic`` gesture number ``id``; ``target`` matters to deictic ones only."""

    type: str
    id: int
    duration_ms: int
    target: Point = Point(0.0, 0.0, 0.0)
    bow_nod_angle_deg: int = 0

    @property
    def words(self) -> Words:
        """Phrases with the target, or with the number of an iconic gesture."""
        if self.type == "deictic":
            return Words("pointing", "pointed", "at {:g}, {:g}, {:g}".format(*self.target), "moved")
        return Words("making", "made", "{} gesture {}".format(self.type, self.id), "moved")


@dataclass(frozen=True)
class QueryKnowledge(Request):
    """Ask for ``exhibits`` (all, in tour order), ``entrance`` or ``home`` (one)."""

    what: str

    @property
    def words(self) -> Words:
        """Phrases with the subject."""
        return Words("looking up the {}".format(self.what))


@dataclass(frozen=True)
class SetAttention(Request):
    """``disabled``, ``social``, ``scanning``, ``seeking`` or ``location`` (the only one that uses ``target``)."""

    state: str
    target: Point = Point(0.0, 0.0, 0.0)

    @property
    def words(self) -> Words:
        """Phrases with the target, or with the mode of attention."""
        if self.state == "location":
            return Words("looking", "looked", "at {:g}, {:g}, {:g}".format(*self.target), "moved")
        return Words("setting attention to {}".format(self.state))


@dataclass(frozen=True)
class GoTo(Request):
    """Drive to ``goal``."""

    goal: Location

    @property
    def words(self) -> Words:
        """Phrases with the goal."""
        return Words("driving", "drove", "to {:g}, {:g}, {:g}°".format(*self.goal), "moved")


@dataclass(frozen=True)
class Prompt(Request):
    """Show ``options`` on the tablet and wait for one to be pressed."""

    options: Tuple[str, ...]

    @property
    def words(self) -> Words:
        """Phrases with the options."""
        return Words("asking", "asked", "on the tablet: {}".format(" or ".join(self.options)), "asked")


@dataclass(frozen=True)
class Say(Request):
    """Speak ``text``; answered when it has been spoken. A robot of release 1.0 needs its ``language``."""

    text: str
    language: str = "English"

    @property
    def words(self) -> Words:
        """Phrases with the text."""
        return Words("saying", "said", "“{}”".format(self.text), "said")


# -------------------------------------------------------------------------------------------- requests of release 1.0


@dataclass(frozen=True)
class SetPose(Request):
    """Set the robot's pose at the localization."""

    pose: Location

    @property
    def words(self) -> Words:
        """Its end has no sentence."""
        return Words("telling the localization where the robot stands")


@dataclass(frozen=True)
class SetRecognition(Request):
    """Switch speech recognition on or off."""

    is_enabled: bool

    @property
    def words(self) -> Words:
        return Words("switching speech recognition {}".format("on" if self.is_enabled else "off"))


@dataclass(frozen=True)
class SetRecognitionLanguage(Request):
    """Recognise speech of ``language``."""

    language: str

    @property
    def words(self) -> Words:
        return Words("having {} recognised".format(self.language))


class Answer(NamedTuple):
    """A server's usable, positive answer. ``response`` is the tablet's; ``exhibits`` the knowledge base's."""

    response: str = ""
    exhibits: Tuple[Exhibit, ...] = ()


# ---------------------------------------------------------------------------------------------------- topics (table 2)


class Faces(NamedTuple):
    """One message of face detection: a label for each face, and whether that face looks at the robot."""

    labels: Tuple[str, ...]
    mutual_gaze: Tuple[bool, ...]


class AttentionStatus(NamedTuple):
    """One message of overt attention: the mode, and the status of ``seeking``."""

    state: str
    value: int
