"""A rehearsal as one self-contained web page, and the cells of its tables, which the terminal shows
too."""
import html
from typing import Any, Dict, Sequence

from behavior_controller.monitoring.report_frame import encodable, framed
from behavior_controller.text import count

from unit_tests.rehearsal.summary import FindingSummary, VisitorRow, Share

ROW_HEAD = ("visitor", "answers by", "outcome", "after", "stops", "with faults")
SHARE_HEAD = ("failure rate", "runs", "successes", "share", "95 % interval", "pass takes")

PLOT = """<svg class="plot" role="img" aria-label="share of successes over the failure rate"
width="590" height="260" viewBox="-50 -10 590 260">{0}<polyline points="{1}"/>{2}
<text x="260" y="246" text-anchor="middle">failure rate</text></svg>"""
AXES = """<path d="M0 {1}H520"/><text x="-6" y="{1}" dy="4" text-anchor="end">{2:.0f} %</text>
<text x="{0}" y="238" text-anchor="middle">{3:g}</text>"""
MARK = """<path class="share" d="M{0} {2}V{3}"/><circle cx="{0}" cy="{1}" r="3.5">
<title>{4}</title></circle>"""
"""The plot's area is 520 pixels wide and 220 high, from the origin on; the axes' labels are outside
of it."""


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
    return [row.visitor, "voice" if row.by_voice else "tablet", row.outcome or "no end",
            duration(row.seconds), str(row.stops), faulty or "-"]


def share_cells(share: Share) -> Sequence[str]:
    """Return the cells for the runs at one failure rate."""
    return [f"{share.rate:g}", str(share.runs), str(share.successes), f"{100 * share.share:.1f} %",
            "{:.1f} to {:.1f} %".format(*(100 * end for end in share.interval)),
            duration(share.seconds) if share.seconds == share.seconds else "-"]


def duration(seconds: float) -> str:
    """Return a duration as text, such as ``2 min 5 s``."""
    whole = int(round(seconds))
    return "{} min {} s".format(*divmod(whole, 60)) if whole >= 60 else f"{whole} s"


def to_html(title: str, rows: Sequence[VisitorRow], shares: Sequence[Share],
            findings: Sequence[FindingSummary]) -> str:
    """Return the page."""
    sections = {title: _table(table) for title, table in tables(rows, shares).items()}
    if shares:
        sections["Successes"] = plot(shares) + sections["Successes"]
    sections["Findings"] = "\n".join(map(_finding, findings)) or "<p>Nothing was found.</p>"
    content = "\n".join(f'<section id="{name}"><h2>{name}</h2>{part}</section>'
                        for name, part in sections.items())
    return framed(title, [], {name: name for name in sections}, content)


def _text(value: Any) -> str:
    return html.escape(encodable(value))


def _table(table: Table) -> str:
    lines = ["".join(f'<th scope="col">{_text(cell)}</th>' for cell in table[0])]
    lines += ["".join(f"<td>{_text(cell)}</td>" for cell in row) for row in table[1:]]
    body = "\n".join(f"<tr>{line}</tr>" for line in lines)
    return f'<table class="cells">{body}</table>'


def _finding(finding: FindingSummary) -> str:
    story = "".join(
        f'<tr><td class="at">{sentence.at:.1f} s</td><td>{_text(sentence.text)}</td></tr>'
        for sentence in finding.story)
    runs = count(finding.plays, "simulated run", "simulated runs")
    shown = "" if finding.scene is None else (
        f"<details><summary>the shortest of {runs}</summary><table>{story}</table></details>"
        f"<p>Again: <code>{_text(finding.command)}</code></p>")
    others = "".join(
        f"<p>As a consequence, {_text(other.kind.name)} at {_text(other.where)} "
        f"(<code>{_text(other.place)}</code>): {_text(other.what)}</p>"
        for other in finding.consequences)
    return (f"<h3>{_text(finding.kind.name)}: {_text(finding.where)}</h3>"
            f"<p>{_text(finding.kind.means)}</p>"
            f"<p>{_text(finding.what)} (<code>{_text(finding.place)}</code>)</p>{others}{shown}")


def plot(shares: Sequence[Share]) -> str:
    """Return the shares over the failure rate as SVG: points joined by lines, each with its
    interval."""
    axes = "".join(AXES.format(_x(at), _y(at), 100 * at, at)
                   for at in (0.0, 0.2, 0.4, 0.6, 0.8, 1.0))
    points = " ".join(f"{_x(share.rate)},{_y(share.share)}" for share in shares)
    marks = "".join(
        MARK.format(_x(share.rate), _y(share.share), *map(_y, share.interval),
                    _text("; ".join(share_cells(share)))) for share in shares)
    return PLOT.format(axes, points, marks)


def _x(rate: float) -> str:
    return f"{520 * rate:g}"


def _y(share: float) -> str:
    return f"{220 * (1 - share):g}"
