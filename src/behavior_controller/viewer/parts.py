"""The parts of the board: what page and ``missionStatus`` show of a run."""
from typing import Any, Dict, List, Optional, Tuple

from msgspec import Struct

from behavior_controller.run.moment import Card, RobotLine
from behavior_controller.run.readiness import ReadyRow
from behavior_controller.run.story import Sentence


class NodeRow(Struct, frozen=True):
    """The row of a node in the tree; ``bare``: it only says how the mission is put together."""

    uid: int
    parent: int
    name: str
    kind: str
    path: str
    subtree: bool
    bare: bool


class MissionPart(Struct, frozen=True):
    """The nodes in document order, with their parents' numbers: a tree may be very deep."""

    file: str
    nodes: List[NodeRow]
    robot: str = ""
    language: str = ""  # the code of what the robot speaks; empty: that of the page, or unknown


class Statuses(Struct, frozen=True):
    """The letter of each node, and the leaf where the run is (0: none): the one that runs, or the
    failed one that a recovery does again."""

    letters: str
    tip: int


class Now(Struct, frozen=True):
    """The card, the robot, how the mission ended, and how the ``last`` visit did that has ended."""

    card: Card
    robot: RobotLine
    count: int
    ended: str
    last: str = ""


class SentenceRow(Sentence, frozen=True, kw_only=True):
    """A sentence of the story, with its number and its time of day."""

    number: int
    time: str


class StoryPart(Struct, frozen=True):
    """The visit under way, or the last one, and the newest sentences."""

    visit: Optional[Dict[str, Any]]
    sentences: List[SentenceRow]


class ValueLane(Struct, frozen=True):
    """A value of the visit: when it changed, and to which text; an empty one: it had no value."""

    name: str
    changes: List[Tuple[float, str]]


class Values(Struct, frozen=True):
    """The values of the visit over time, and how many more it has that are not followed."""

    lanes: List[ValueLane]
    left_out: int = 0


class Offer(Struct, frozen=True):
    """A service, topic or the master; ``trouble``: its strongest one in short, and ``rank`` how
    strong that is; 0 is the strongest."""

    kind: str
    name: str
    well: bool
    status: str
    consequence: str
    trouble: str = ""
    rank: int = 0
    calls: int = 0
    failures: int = 0
    seconds: Optional[float] = None
    age: Optional[float] = None


class Ready(Struct, frozen=True):
    """What the mission needs, and whether a visitor can be received."""

    rows: List[ReadyRow]
    is_ready: bool


class Alive(Struct, frozen=True):
    """How long ago the tick thread gave its last sign of life, and whether that is too long.

    ``at`` is now, ``kept`` the earliest moment that can be shown, as times of events;
    ``clock_shift`` is what makes these times of day: see ``events``.
    """

    age: Optional[float]
    hangs: bool
    at: float
    kept: Optional[float] = None
    clock_shift: int = 0

