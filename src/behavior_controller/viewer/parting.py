"""Two visits of any runs side by side, and the node at which they part."""
from typing import List, Optional, Set

from msgspec import Struct
from msgspec.structs import replace

from behavior_controller.run import story
from behavior_controller.run.events import TreeShown
from behavior_controller.run.record.reader import stream_record
from behavior_controller.run.state import NodeResult, State
from behavior_controller.text import clean, joined

MOST_ROWS = 5000
"""The most results of a visit that are compared."""


class ResultRow(Struct, frozen=True):
    """How a leaf ended, ``times`` in a row; ``seconds`` are since the visitor came, or, before
    that, since the pass began."""

    uid: int
    path: str
    name: str
    letter: str
    why: str
    seconds: float
    times: int = 1


class Parting(Struct, frozen=True):
    """The results of two visits; they are alike before the number ``first``, counted from 0, which
    is None if all are."""

    one: List[ResultRow]
    other: List[ResultRow]
    first: Optional[int]


def parting(one: List[ResultRow], other: List[ResultRow]) -> Parting:
    """Compare two visits: the path of each leaf, and how it ended."""
    keys, others = ([(row.path, row.letter) for row in rows] for rows in (one, other))
    first = next((number for number, pair in enumerate(zip(keys, others)) if pair[0] != pair[1]),
                 None)
    if first is None and len(one) != len(other):
        first = min(len(one), len(other))
    return Parting(one, other, first)


def visit_rows(path: str, number: int) -> List[ResultRow]:
    """Return the results of a visit of the run with this first file. Raises MissionError."""
    run, rows = story.Story(), RowList()
    for line in stream_record(path):
        run.take(line.time, line.event)
        visit = run.state.visit
        if visit is not None and visit.number == number:
            rows.take(run.state)
        elif visit is not None and visit.number > number:
            break
    return rows.rows


class RowList:
    """The results of leaves, those in a row that are alike as one."""

    def __init__(self) -> None:
        self.rows: List[ResultRow] = []
        self._tree = TreeShown("", [])
        self._parents: Set[int] = set()

    def take(self, state: State) -> None:
        """Add those that the last event concluded."""
        visit = state.visit
        assert visit is not None
        if state.tree is not self._tree:
            self._tree = state.tree
            self._parents = {node.parent for node in state.nodes}
        for ended in state.concluded(NodeResult):
            node = state.nodes[ended.uid - 1]
            if ended.uid in self._parents or len(self.rows) >= MOST_ROWS:
                continue
            name = node.label
            if node.kind != name:
                name = joined(" ", name, node.kind)
            row = ResultRow(ended.uid, clean(node.path), clean(name), ended.letter,
                            story.cause(ended.failure),
                            round(ended.ended - (visit.arrived or visit.began), 1))
            last = self.rows[-1] if self.rows else None
            if last is not None and (last.path, last.letter) == (row.path, row.letter):
                self.rows[-1] = replace(row, times=last.times + 1)
            else:
                self.rows.append(row)
