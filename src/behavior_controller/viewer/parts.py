"""The state of a running mission as it is sent: the parts of the board that the page's server makes
and ``missionStatus`` reads.
"""
import itertools
from typing import Any, Dict, List, Optional

from msgspec import Struct

from behavior_controller.run.moment import Card, RobotLine
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


def changes(old: Any, new: Any) -> Any:
    """Return what differs in ``new``, as JSON for ``patched``.

    Of a record the fields that differ, with None for one that is gone; of a list the number of
    items to ``drop`` at its begin, and those to ``add`` at its end.
    """
    if isinstance(old, list) and isinstance(new, list):
        drop = next(count for count in itertools.count() if old[count:] == new[:len(old) - count])
        return {"drop": drop, "add": new[len(old) - drop:]}
    if not isinstance(old, dict) or not isinstance(new, dict):
        return new
    differences = {name: changes(old.get(name), value) for name, value in new.items()
                   if name not in old or old[name] != value}
    return {**differences, **dict.fromkeys(old.keys() - new.keys())}


def patched(old: Any, change: Any) -> Any:
    """Return what ``changes`` were made of. Raises ValueError for changes that do not fit."""
    if not isinstance(change, dict):
        return change
    if isinstance(old, list):
        drop, add = change.get("drop"), change.get("add")
        if not isinstance(drop, int) or not isinstance(add, list):
            raise ValueError("a list is changed without drop and add")
        return old[drop:] + add
    known = old if isinstance(old, dict) else {}
    return dict(known, **{name: patched(known.get(name), value) for name, value in change.items()})
