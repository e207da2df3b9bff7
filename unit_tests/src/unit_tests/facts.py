"""What is known at the end of a test: the controller's record and the journal of the simulated nodes."""
from typing import Any, Dict, FrozenSet, Iterator, List, NamedTuple, Optional, Sequence

from behavior_controller.interface import Interface
from behavior_controller.interface.robots import DEFAULT

from unit_tests.exhibits import Knowledge
from unit_tests.journal import Line
from unit_tests.rehearsal import Rehearsal

Event = Dict[str, Any]
"""A line of the record: ``event`` (one of ``behavior_controller.events``), ``time`` (unix seconds) and its fields."""


class Facts(NamedTuple):
    """Everything that a verdict is based on."""

    events: Sequence[Event]  # the controller's record
    journal: Sequence[Line]
    exit_code: Optional[int]  # of the controller; None: it did not end
    behaviour: str
    runs: int
    knowledge: Knowledge
    cut_off: str = ""  # why the test did not wait for the end
    rehearsal: Optional[Rehearsal] = None  # the same mission on a robot without faults
    real: FrozenSet[str] = frozenset()  # the robot's nodes that were not simulated
    interface: Interface = DEFAULT  # the interface of the simulated robot
    absent: FrozenSet[str] = frozenset()  # canonical names of the services that it did not offer


class Tree:
    """The mission's nodes as the record shows them, by number from 1; empty if it shows none."""

    def __init__(self, events: Sequence[Event]):
        shown = of(events, "TreeShown")
        nodes = shown[-1]["nodes"] if shown else []
        self.types: Dict[int, str] = {uid: node["type"] for uid, node in enumerate(nodes, 1)}
        self._parents: Dict[int, int] = {uid: node["parent"] for uid, node in enumerate(nodes, 1)}

    def __bool__(self) -> bool:
        return bool(self.types)

    def are_neighbours(self, one: int, other: int) -> bool:
        """Return whether two nodes have the same parent."""
        return one in self._parents and self._parents[one] == self._parents.get(other)

    def is_below(self, uid: int, control: str) -> bool:
        """Return whether a node's parent is of that type."""
        return self.types.get(self._parents[uid]) == control

    def before(self, uid: int) -> range:
        """Return the earlier siblings of a node, or of its nearest ancestor that has any, with all nodes below them."""
        while uid:
            first = self._parents[uid] + 1
            if first < uid:
                return range(first, uid)
            uid = self._parents[uid]
        return range(0)


class Pass(NamedTuple):
    """One pass of the mission: the events that the controller recorded and the requests that the nodes received meanwhile."""

    number: int
    outcome: str
    began: float
    ended: float
    events: Sequence[Event]
    lines: Sequence[Line]


def started(facts: Facts) -> Event:
    """Return the event with which the mission started; an empty event if it did not start."""
    found = of(facts.events, "RunStarted")
    return found[-1] if found else {}


def of(events: Sequence[Event], kind: str) -> List[Event]:
    """Return the events of one kind."""
    return [event for event in events if event["event"] == kind]


def passes(facts: Facts) -> Iterator[Pass]:
    began = 0.0
    for end in of(facts.events, "PassFinished"):
        yield Pass(end["number"], end["outcome"], began, end["time"],
                   [event for event in facts.events if began < event["time"] <= end["time"]],
                   [line for line in facts.journal if began < line.time <= end["time"]])
        began = end["time"]


def count(number: int, one: str, more: str) -> str:
    """Return a number and its noun."""
    return "{} {}".format(number, one if number == 1 else more)
