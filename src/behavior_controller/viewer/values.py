"""The values of a visit over time: the mode of attention, the newest message of each topic, the
visitor's answer, and the entries of the blackboard."""
from collections import deque
from itertools import chain
from typing import Deque, Dict, Iterator, List, Mapping, Set, Tuple

from behavior_controller.run.state import State
from behavior_controller.text import clean
from behavior_controller.viewer.parts import ValueLane, Values

MOST_LANES = 40
"""The most values of a visit that are followed."""

MOST_CHANGES = 100
"""The most changes of a value in a visit that are kept: the newest."""

LONGEST_VALUE = 60
"""The most characters of a value."""

EMPTY = "(empty)"
"""The value of an entry whose text is empty."""


class VisitValues:
    """Takes what is so after each event of a visit, and keeps when each value changed."""

    def __init__(self) -> None:
        self._lanes: Dict[str, Deque[Tuple[float, str]]] = {}
        self._left_out: Set[str] = set()
        self.version = 0
        """The number of changes so far."""

    def begin(self) -> None:
        """Begin with another visit."""
        self.version += bool(self._lanes)
        self._lanes.clear()
        self._left_out.clear()

    def take(self, state: State, entries: Mapping[str, str]) -> None:
        """Note the values of ``state``; ``entries`` are those of the blackboard as texts."""
        now = dict(_values(state, entries))
        for name, value in {**dict.fromkeys(self._lanes, ""), **now}.items():
            if name not in self._lanes and len(self._lanes) >= MOST_LANES:
                self._left_out.add(name)
                continue
            changes = self._lanes.setdefault(name, deque(maxlen=MOST_CHANGES))
            if not changes or changes[-1][1] != value:
                changes.append((round(state.at, 3), value))
                self.version += 1

    def part(self) -> Values:
        """Return the lanes, entries of the blackboard last."""
        lanes = [ValueLane(name, list(changes)) for name, changes in self._lanes.items()]
        return Values(sorted(lanes, key=lambda lane: lane.name[:1] == "{"), len(self._left_out))


def _values(state: State, entries: Mapping[str, str]) -> Iterator[Tuple[str, str]]:
    """Yield name and text of each value; the name of an entry stands in braces, as in missions."""
    if state.robot.attention is not None:
        yield "attention", clean(state.robot.attention.state)
    for said in state.said.values():
        yield clean(said.topic), clean(said.words, LONGEST_VALUE)
    visit = state.visit
    if visit is not None and visit.ended is None and visit.asked is not None:
        yield "answer", visit.answer or "asked"
    for name, text in entries.items():
        yield clean(f"{{{name}}}"), clean(text, LONGEST_VALUE) or EMPTY


def joined(visits: List[Tuple[float, Values]]) -> Dict[str, List[Tuple[float, str]]]:
    """Return the changes of each value in several visits, each with the time when it began."""
    lanes: Dict[str, List[Tuple[float, str]]] = {}
    for began, values in visits:
        for lane in values.lanes:
            changes = lanes.setdefault(lane.name, [])
            # what was before the oldest change that is kept is not known
            changes += chain([(began, "")] * (lane.changes[0][0] > began), lane.changes)
    return lanes
