"""A rehearsal as one self-contained web page, and the cells of its tables, which the terminal shows
too."""
import os
from typing import Dict, Mapping, Sequence

from tornado.template import Loader

from behavior_controller.viewer.report_frame import encodable, framed
from behavior_controller.text import count

from behavior_controller.simulation.rehearsal.plays import WAYS
from behavior_controller.simulation.rehearsal.summary import (
    FindingSummary, SimulatedRun, VisitorRow, Share)

COMMAND = "rehearseMission"

ROW_HEAD = ("visitor", "answers by", "outcome", "after", "stops", "with faults")
SHARE_HEAD = ("failure rate", "runs", "successes", "share", "95 % interval", "pass takes")

TEMPLATES = Loader(os.path.join(os.path.dirname(os.path.abspath(__file__)), "report_files"),
                   whitespace="all")

Table = Sequence[Sequence[str]]
"""The cells of a table, its head first."""


def tables(rows: Sequence[VisitorRow], shares: Sequence[Share]) -> Dict[str, Table]:
    """Return the tables that have rows, by their titles."""
    all_tables = {"Visitors": [ROW_HEAD, *map(row_cells, rows)],
                  "Successes": [SHARE_HEAD, *map(share_cells, shares)]}
    return {title: table for title, table in all_tables.items() if len(table) > 1}


def row_cells(row: VisitorRow) -> Sequence[str]:
    """Return the cells for a visitor."""
    faulty = ", ".join(f"{number} {outcome or 'without an end'}"
                       for outcome, number in row.with_faults)
    return [row.visitor, WAYS[row.by_voice], row.outcome or "no end",
            duration(row.seconds), str(row.stops), faulty or "-"]


def share_cells(share: Share) -> Sequence[str]:
    """Return the cells for the runs at one failure rate."""
    return [f"{share.rate:g}", str(share.runs), str(share.successes), f"{100 * share.share:.1f} %",
            "{:.1f} to {:.1f} %".format(*(100 * end for end in share.interval)),
            "-" if share.seconds is None else duration(share.seconds)]


def duration(seconds: float) -> str:
    """Return a duration as text, such as ``2 min 5 s``."""
    whole = int(round(seconds))
    if whole < 60:
        return f"{whole} s"
    return "{} min {} s".format(*divmod(whole, 60))


def to_html(title: str, rows: Sequence[VisitorRow], shares: Sequence[Share],
            findings: Sequence[FindingSummary],
            runs: Mapping[str, Sequence[SimulatedRun]] = {}) -> str:
    """Return the page; ``runs`` by their end."""
    shown = tables(rows, shares)
    content = TEMPLATES.load("page.html").generate(
        tables=shown, shares=shares, findings=findings, plot=plot, count=count, text=encodable,
        runs=runs, duration=duration)
    sections = {name: name for name in (*shown, "Findings", *["Runs"] * bool(runs))}
    return framed(COMMAND, title, [], sections, content.decode())


def plot(shares: Sequence[Share]) -> str:
    """Return the shares over the failure rate as SVG: points joined by lines, each with its
    interval."""
    return TEMPLATES.load("shares.svg").generate(shares=shares, share_cells=share_cells).decode()
