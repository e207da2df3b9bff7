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
record before it is sent, a traversal after it."""

RETURN = 15.0
"""Seconds after a node's crash in which it may be away: its process and its connections have to
come back."""


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
    stall: float = 0.0  # the longest time, in seconds, for which the test itself could not run

    @property
    def late(self) -> float:
        """Seconds by which something may come late: nothing can be in time while nothing runs."""
        return LATE_TOLERANCE + self.stall

    @property
    def is_disturbed(self) -> bool:
        """Whether the test was stopped, or something took the place of one of its nodes."""
        return bool(self.cut_off) and not self.has_timed_out

    @property
    def crashes(self) -> List[JournalEntry]:
        """The calls at which nodes crashed."""
        return [line for line in self.journal if line.fault == CRASH]


def of(record: Iterable[events.Line], kind: Type[Kind]) -> List[Tuple[float, Kind]]:
    """Return the events of one kind, each with its time."""
    return [(line.time, line.event) for line in record if isinstance(line.event, kind)]
