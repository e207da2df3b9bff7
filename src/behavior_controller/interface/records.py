"""What leaves ask of the robot and what they learn from it, as plain records that know no ROS types."""
from dataclasses import dataclass
from typing import NamedTuple, Tuple


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
    """What the knowledge base knows of one place (D5.4.3 section 3.2.5)."""

    name: str
    description1: str
    description2: str
    location: Location
    gesture: Point


# ------------------------------------------------------------------------------------------------ requests (table 3)


@dataclass(frozen=True)
class Request:
    """What a service of the robot is asked to do."""


@dataclass(frozen=True)
class SetAnimation(Request):
    """Switch lifelike movement: ``enabled`` or ``disabled``."""

    state: str


@dataclass(frozen=True)
class PerformGesture(Request):
    """``iconic`` or ``deictic`` gesture number ``id``; ``target`` matters to deictic ones only."""

    type: str
    id: int
    duration_ms: int
    target: Point = Point(0.0, 0.0, 0.0)
    bow_nod_angle_deg: int = 0


@dataclass(frozen=True)
class QueryKnowledge(Request):
    """Ask for ``exhibits`` (all, in tour order), ``entrance`` or ``home`` (one)."""

    what: str


@dataclass(frozen=True)
class SetAttention(Request):
    """``disabled``, ``social``, ``scanning``, ``seeking`` or ``location`` (the only one that uses ``target``)."""

    state: str
    target: Point = Point(0.0, 0.0, 0.0)


@dataclass(frozen=True)
class GoTo(Request):
    """Drive to ``goal``."""

    goal: Location


@dataclass(frozen=True)
class Prompt(Request):
    """Show ``options`` on the tablet and wait for one to be pressed."""

    options: Tuple[str, ...]


@dataclass(frozen=True)
class Say(Request):
    """Speak ``text``; answered when it has been spoken. A robot of release 1.0 is told its ``language``."""

    text: str
    language: str = "English"


# -------------------------------------------------------------------------------------------- requests of release 1.0


@dataclass(frozen=True)
class SetPose(Request):
    """Tell the localization that the robot stands at ``pose``."""

    pose: Location


@dataclass(frozen=True)
class SetRecognition(Request):
    """Switch speech recognition on or off."""

    is_enabled: bool


@dataclass(frozen=True)
class SetRecognitionLanguage(Request):
    """Recognise speech of ``language``."""

    language: str


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
