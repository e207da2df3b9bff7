"""The facts that are known at the end of a test: the controller's record and the journal of the
simulated nodes."""
from typing import FrozenSet, Iterable, List, NamedTuple, Optional, Sequence, Tuple, Type, TypeVar

from behavior_controller.run import events
from behavior_controller.run.history import Run
from behavior_controller.missions.load import Mission
from behavior_controller.simulation.configuration import Configuration
from behavior_controller.simulation.faults import CRASH
from behavior_controller.simulation.journal import JournalEntry
from behavior_controller.simulation.world import World

Kind = TypeVar("Kind")

LATE_TOLERANCE, EARLY_TOLERANCE = 1.0, 0.25
"""Seconds by which something may come late, on a busy machine too, and seem early: a request is on
record before it is sent, a traversal after it. They are the computer's, as those of ``RETURN``."""

RETURN = 15.0
"""Seconds after a node's crash in which it may be away: its process and its connections have to
come back."""


class Stall(NamedTuple):
    """A time, in Unix seconds, for which the test itself could not run."""

    begins: float
    ends: float


class Facts(NamedTuple):
    """Everything that a verdict is based on."""

    run: Run  # from the controller's record
    journal: Sequence[JournalEntry]
    exit_code: Optional[int]  # of the controller; None: it did not end
    test: Configuration
    world: World  # that of the simulated nodes, before the robot's first request
    mission: Optional[Mission] = None  # as the test has read it; None: it has a fault
    cut_off: str = ""  # why the test did not wait for the end
    # the paths of the leaves that this visitor brings about on a robot without faults
    expected: Optional[FrozenSet[str]] = None
    real: FrozenSet[str] = frozenset()  # the robot's nodes that were not simulated
    errors: Tuple[str, ...] = ()  # that the controller reported on its terminal
    has_timed_out: bool = False  # it was cut off because it had lasted too long
    stalls: Tuple[Stall, ...] = ()  # in their order
    speed: float = 1.0  # of the simulated time, at its fastest

    @property
    def pace(self) -> float:
        """Seconds of the mission's time for each second that a process takes."""
        return max(1.0, self.speed)

    @property
    def late(self) -> float:
        """Seconds by which something may come late while the test can run."""
        return LATE_TOLERANCE * self.pace

    @property
    def early(self) -> float:
        """Seconds by which something may seem early."""
        return EARLY_TOLERANCE * self.pace

    def shortest(self, seconds: float) -> float:
        """Return what a pause of so many seconds of a process takes at least."""
        return seconds / 2 * min(1.0, self.speed)

    @property
    def away(self) -> float:
        """Seconds after a node's crash in which it may be away."""
        return RETURN * self.pace

    def latest(self, due: float) -> float:
        """Return the time until which something may come that was due: nothing can be in time while
        nothing runs. Of simulated time the moments of stalls are not known, but how long they were.
        """
        latest, lengths = due + self.late, [stall.ends - stall.begins for stall in self.stalls]
        if self.speed != 1.0:
            return latest + max(lengths, default=0.0) * self.pace
        for stall in self.stalls:
            if stall.begins < latest and stall.ends > due:
                latest += stall.ends - max(stall.begins, due)
        return latest

    @property
    def is_disturbed(self) -> bool:
        """Whether the test was stopped, or something took the place of one of its nodes."""
        return bool(self.cut_off) and not self.has_timed_out

    @property
    def crashes(self) -> List[JournalEntry]:
        """The calls at which nodes crashed."""
        return [line for line in self.journal if line.fault == CRASH]


def speeds(lines: Iterable[events.Line], usual: float = 1.0) -> Tuple[float, float]:
    """Return the speed of the simulated time, on average and during its fastest second; both are
    the ``usual`` one if there is no second of it."""
    known = [(line.computer, line.time) for line in lines
             if line.ros is not None and line.computer is not None]
    fastest, first = 0.0, next(iter(known), (0.0, 0.0))
    for moment in known:
        if moment[0] >= first[0] + 1.0:
            fastest, first = max(fastest, _speed(first, moment)), moment
    return (_speed(known[0], known[-1]), fastest) if fastest else (usual, usual)


def _speed(first: Tuple[float, float], last: Tuple[float, float]) -> float:
    return (last[1] - first[1]) / (last[0] - first[0])


def by_record(journal: Sequence[JournalEntry], lines: Iterable[events.Line]) -> List[JournalEntry]:
    """Return the entries with the times of the record: where time is simulated, these begin by the
    computer's, and go on as /clock does; those of the journal begin by /clock."""
    first = next((line for line in lines if line.ros is not None), None)
    if first is None or first.ros is None:
        return list(journal)
    # it may have jumped before the controller was started
    jumped = next((entry.jumped for entry in journal if entry.call), 0.0)
    shift = first.time - first.ros - jumped
    return [entry._replace(time=entry.time + shift) for entry in journal]


def of(record: Iterable[events.Line], kind: Type[Kind]) -> List[Tuple[float, Kind]]:
    """Return the events of one kind, each with its time."""
    return [(line.time, line.event) for line in record if isinstance(line.event, kind)]
