"""The state of a running mission as it is sent: the parts of the board that the page's server makes
and ``missionStatus`` reads.
"""
import itertools
from typing import Any, Dict, List, Literal, Optional

from msgspec import Struct

Kind = Literal["step", "wait", "retry", "held", "asleep", "paused", "busy", "idle", "ended"]
"""The kinds of cards."""


class Card(Struct, frozen=True):
    """What the run does now. Times are Unix seconds."""

    kind: Kind
    what: str = ""
    where: str = ""  # the visitor, and the stop
    since: Optional[float] = None
    until: Optional[float] = None  # at the latest
    attempt: int = 1
    attempts: int = 1
    waits_for: str = ""
    trouble: str = ""  # with what it waits for
    next: str = ""  # the node that follows if this succeeds; empty: the tree does not say it
    uid: int = 0


class RobotLine(Struct, frozen=True):
    """How the robot is, and what a person has to do, if anything."""

    is_well: bool  # all that is used answers
    alive: str
    attention: str
    movement: str
    place: str
    safe: str = ""  # after a stop: what was reached of the safe state
    instruction: str = ""

    @property
    def text(self) -> str:
        """All on one line, the instruction last."""
        parts = (self.alive, "attention " + self.attention, "lifelike movement " + self.movement,
                 self.place, self.safe)
        text = " · ".join(filter(None, parts))
        return f"{text}. {self.instruction}" if self.instruction else text


def card_line(now: Card, at: float) -> str:
    """Return the card on one line, as of that time."""
    parts = [now.what]
    if now.attempt > 1 and now.kind != "retry":
        parts.append(f" (attempt {now.attempt} of {now.attempts})")
    if now.since is not None and now.kind != "ended":
        limit = "" if now.until is None else f" of at most {now.until - now.since:g} s"
        parts.append(f", {max(0.0, at - now.since):.0f} s{limit}")
    if now.trouble:
        parts.append("; " + now.trouble)
    waits_for = now.waits_for and "waits for " + now.waits_for
    following = now.next and "next: " + now.next
    return " · ".join(filter(None, (now.where, "".join(parts), waits_for, following)))


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


class Sentence(Struct, frozen=True):
    """A sentence about one event, in words for people and on one line.

    ``kind`` says what it is about (one of ``story.KINDS``), ``severity`` is info, warning or error;
    ``visit`` is 0 before the first. ``uid`` and ``path`` are those of the node that it leads to; 0
    and empty if there is none. Sentences of one ``incident`` have one cause: it is the time of the
    first of them. ``cause`` is the kind of the failure that they are about, in words.
    """

    at: float
    visit: int
    kind: str
    severity: str
    text: str
    uid: int
    path: str = ""
    incident: float = 0.0
    cause: str = ""


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
