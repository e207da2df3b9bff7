"""A rehearsal as one self-contained web page, and the cells of its tables, which the terminal shows
too."""
from typing import Dict, Sequence

from tornado.template import Template

from behavior_controller.viewer.report_frame import encodable, framed
from behavior_controller.text import count

from behavior_controller.simulation.rehearsal.summary import FindingSummary, VisitorRow, Share

COMMAND = "rehearseMission"

ROW_HEAD = ("visitor", "answers by", "outcome", "after", "stops", "with faults")
SHARE_HEAD = ("failure rate", "runs", "successes", "share", "95 % interval", "pass takes")

CONTENT = """{% for section, (head, *rows) in tables.items() %}\
<section id="{{ section }}"><h2>{{ section }}</h2>
{% if section == "Successes" %}{% raw plot(shares) %}{% end %}\
<table class="cells"><tr>{% for cell in head %}<th scope="col">{{ cell }}</th>{% end %}</tr>
{% for row in rows %}<tr>{% for cell in row %}<td>{{ cell }}</td>{% end %}</tr>
{% end %}</table></section>
{% end %}<section id="Findings"><h2>Findings</h2>
{% for finding in findings %}<h3>{{ finding.kind.name }}: {{ text(finding.where) }}</h3>
<p>{{ finding.kind.means }}</p>
<p>{{ text(finding.what) }} (<code>{{ text(finding.place) }}</code>)</p>
{% for other in finding.consequences %}\
<p>As a consequence, {{ other.kind.name }} at {{ text(other.where) }} \
(<code>{{ text(other.place) }}</code>): {{ text(other.what) }}</p>
{% end %}{% if finding.scene is not None %}<details><summary>the shortest of \
{{ count(finding.plays, "simulated run", "simulated runs") }}</summary><table>
{% for sentence in finding.story %}<tr><td class="at">{{ "%.1f" % sentence.at }} s</td>\
<td>{{ text(sentence.text) }}</td></tr>
{% end %}</table></details>
<p>Again: <code>{{ text(finding.command) }}</code></p>
{% end %}{% end %}{% if not findings %}<p>Nothing was found.</p>{% end %}</section>"""

PLOT = """<svg class="plot" role="img" aria-label="share of successes over the failure rate"
width="590" height="260" viewBox="-50 -10 590 260">
{% for at in (0.0, 0.2, 0.4, 0.6, 0.8, 1.0) %}<path d="M0 {{ y(at) }}H520"/>
<text x="-6" y="{{ y(at) }}" dy="4" text-anchor="end">{{ "%.0f" % (100 * at) }} %</text>
<text x="{{ x(at) }}" y="238" text-anchor="middle">{{ "%g" % at }}</text>
{% end %}<polyline points="{{ " ".join(points) }}"/>
{% for share in shares %}{% set low, high = share.interval %}\
<path class="share" d="M{{ x(share.rate) }} {{ y(low) }}V{{ y(high) }}"/>
<circle cx="{{ x(share.rate) }}" cy="{{ y(share.share) }}" r="3.5">\
<title>{{ "; ".join(share_cells(share)) }}</title></circle>
{% end %}<text x="260" y="246" text-anchor="middle">failure rate</text></svg>"""
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
    shown = tables(rows, shares)
    content = Template(CONTENT).generate(tables=shown, shares=shares, findings=findings, plot=plot,
                                         count=count, text=encodable)
    sections = [*shown, "Findings"]
    return framed(COMMAND, title, [], {name: name for name in sections}, content.decode())


def plot(shares: Sequence[Share]) -> str:
    """Return the shares over the failure rate as SVG: points joined by lines, each with its
    interval."""
    points = [f"{_x(share.rate)},{_y(share.share)}" for share in shares]
    svg = Template(PLOT).generate(shares=shares, points=points, share_cells=share_cells, x=_x, y=_y)
    return svg.decode()


def _x(rate: float) -> str:
    return f"{520 * rate:g}"


def _y(share: float) -> str:
    return f"{220 * (1 - share):g}"
