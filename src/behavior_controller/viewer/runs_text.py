"""The list of runs on a terminal."""
from typing import Iterator, List, Sequence

from behavior_controller.run.state import BROKEN_OFF, COMPLETE, IN_PART
from behavior_controller.run.statistics import NodeFigures, statistics, time_of
from behavior_controller.text import clean, count, joined
from behavior_controller.viewer.run_index import Listed


def text_lines(listed: Sequence[Listed]) -> Iterator[str]:
    """Yield the figures of the runs, and a line for each run, the newest first."""
    figures = statistics(each.digest for each in listed)
    number = sum(figures.visits.values())
    results = ", ".join(f"{many} {result}" for result, many in figures.visits.items())
    yield joined(": ", f"{count(number, 'visit')} in {count(figures.runs, 'run')}", results)
    yield from _table(["day", "runs", "visits", "complete", "broken off", "could be served"], [
        [day.day, day.runs, sum(day.visits.values()),
         day.visits.get(COMPLETE, 0) + day.visits.get(IN_PART, 0),
         day.visits.get(BROKEN_OFF, 0), f"{int(100 * day.served)} %"] for day in figures.days])
    yield from _table(["fault of the robot", "visits that met it", "that it ended"], [
        [fault.fault, fault.visits, fault.ended] for fault in figures.faults])
    yield from _table(["node", "times not well", "once in", "back after", "at the longest"], [
        [node.node, node.outages, seconds(node.between), *_back(node)] for node in figures.nodes])
    yield ""
    for each in reversed(listed):
        yield _run(each)


def _back(node: NodeFigures) -> List[str]:
    """Return how long it took until a node was back, and at the longest."""
    if node.back is None or node.longest is None:
        return ["not yet", ""]
    return [seconds(node.back), seconds(node.longest)]


def seconds(length: float) -> str:
    """Return a duration as text, such as ``2 min 5 s``."""
    if length < 60:
        return f"{length:.1f} s"
    minutes, rest = divmod(round(length), 60)
    return f"{minutes} min {rest} s" if minutes < 60 else f"{minutes // 60} h {minutes % 60} min"


def _table(head: List[str], rows: List[List[object]]) -> Iterator[str]:
    """Yield the lines of a table after an empty one; nothing without rows."""
    if not rows:
        return
    texts = [head] + [[clean(str(cell)) for cell in row] for row in rows]
    widths = [max(map(len, column)) for column in zip(*texts)]
    yield ""
    for row in texts:
        cells = [row[0].ljust(widths[0])] + [
            cell.rjust(width) for cell, width in zip(row[1:], widths[1:])]
        yield "  ".join(cells).rstrip()


def _run(listed: Listed) -> str:
    digest = listed.digest
    times = joined(" to ", time_of(digest.began), time_of(digest.ended))
    visits = count(len(digest.visits), "visit")
    facts = joined(", ", digest.mission, times, visits, listed.ending)
    return clean(f"{listed.name}  {facts}")
