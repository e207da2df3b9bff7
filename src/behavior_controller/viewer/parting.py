"""Two visits of any runs side by side, and the node at which they part."""
import itertools
from typing import List, Optional

from msgspec import Struct
from msgspec.structs import replace

from behavior_controller.run import story
from behavior_controller.run.events import TreeNode, TreeShown
from behavior_controller.run.record.reader import stream_record
from behavior_controller.run.state import NodeResult, Visit
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
    pairs = enumerate(itertools.zip_longest(keys, others))
    return Parting(one, other, next((number for number, pair in pairs if pair[0] != pair[1]), None))


def visit_rows(path: str, number: int) -> List[ResultRow]:
    """Return the results of a visit of the run with this first file. Raises MissionError."""
    run, parents = story.Story(), set()
    rows: List[ResultRow] = []
    for line in stream_record(path):
        run.take(line.time, line.event)
        visit = run.state.visit
        if isinstance(line.event, TreeShown):
            parents = {node.parent for node in line.event.nodes}
        if visit is None or visit.number < number:
            continue
        if visit.number > number:
            break
        for ended in run.state.concluded(NodeResult):
            if ended.uid not in parents and len(rows) < MOST_ROWS:
                _add(rows, _row(run.state.nodes[ended.uid - 1], visit, ended))
    return rows


def _row(node: TreeNode, visit: Visit, ended: NodeResult) -> ResultRow:
    kind = node.kind if node.kind != node.label else ""
    seconds = round(ended.ended - (visit.arrived or visit.began), 1)
    return ResultRow(ended.uid, clean(node.path), clean(joined(" ", node.label, kind)),
                     ended.letter, story.cause(ended.failure), seconds)


def _add(rows: List[ResultRow], row: ResultRow) -> None:
    """Add a row, or count it with one that is alike just before it."""
    if rows and (rows[-1].path, rows[-1].letter) == (row.path, row.letter):
        row = replace(row, times=rows.pop().times + 1)
    rows.append(row)
