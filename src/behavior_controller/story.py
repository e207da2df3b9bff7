"""Turns the events of a run into visits, the step under way and sentences; terminal, page, report and verdict show them.

A story is made from events alone, so a record of a run tells the same as the run did. It holds a bounded number of
visits and never looks at a clock: each event comes with its time (unix seconds).
"""
import collections
from typing import Deque, Dict, List, NamedTuple, Optional, Tuple

from behavior_controller.events import Event, PassFinished, PassStarted

KEPT = 50
"""Visits that a story keeps: the newest."""

UNDER_WAY, SHOWN, LEFT_OUT, BROKEN_OFF = "under way", "shown", "left out", "broken off"
"""How it stands with an exhibit."""


class Sentence(NamedTuple):
    """What is told of one thing that happened, in people's words and on one line.

    ``kind`` says what it is about (one of ``KINDS``), ``severity`` is info, warning or error; ``visit`` is 0 before the
    first. ``uid`` and ``path`` are those of the node that it leads to; 0 and empty if there is none.
    """

    at: float
    visit: int
    kind: str
    severity: str
    text: str
    uid: int = 0
    path: str = ""


KINDS = ("visit", "exhibit", "said", "heard", "asked", "pressed", "moved", "failure", "recovery", "health", "notice")


class ShownExhibit(NamedTuple):
    """One exhibit of a visit. ``why`` is the cause in a sentence where it was left out or broken off."""

    number: int  # from 1
    of: int
    name: str
    state: str
    why: str
    seconds: float


class Visit(NamedTuple):
    """One visitor's pass. Times are unix seconds, None for what has not happened; ``outcome`` is empty while under way."""

    number: int
    began: float
    arrived: Optional[float] = None
    engaged: Optional[float] = None
    asked: Optional[float] = None
    answer: str = ""  # yes or no; empty: none
    exhibits: Tuple[ShownExhibit, ...] = ()
    outcome: str = ""  # SUCCESS or FAILURE
    why: str = ""  # how it ended, in a sentence
    seconds: float = 0.0  # from the arrival to the end
    waited: float = 0.0  # seconds before the arrival


class Step(NamedTuple):
    """What the robot does or waits for. ``limit`` is in seconds; 0: it has none."""

    words: str
    began: float
    limit: float
    uid: int
    path: str


class Story:
    """Takes events in order; what it has made of them may be read between two of them, on the same thread."""

    def __init__(self) -> None:
        self.visits: Deque[Visit] = collections.deque(maxlen=KEPT)
        self.step: Optional[Step] = None
        self.visit_count = 0
        self.outcomes: Dict[str, int] = {}  # of all visits that ended: how many there were of each

    @property
    def visit(self) -> Optional[Visit]:
        """The visit under way, or else the last one."""
        return self.visits[-1] if self.visits else None

    def take(self, at: float, event: Event) -> Tuple[Sentence, ...]:
        """Return what ``event`` adds to the story."""
        told: List[Sentence] = []
        if isinstance(event, PassStarted):
            self.visit_count = event.number
            self.visits.append(Visit(event.number, at))
        elif isinstance(event, PassFinished) and self.visits:
            self.visits[-1] = self.visits[-1]._replace(outcome=event.outcome, seconds=event.seconds)
            self.outcomes[event.outcome] = self.outcomes.get(event.outcome, 0) + 1
            told.append(Sentence(at, event.number, "visit", "info", "visit {}: {}".format(event.number, event.outcome)))
        return tuple(told)

    def now(self, at: float) -> str:
        """Return in one line what the robot does at that time, for how long, and until when at most."""
        return "" if self.step is None else "{}, {:.0f} s".format(self.step.words, at - self.step.began)
