"""A rehearsal as one self-contained web page, and the cells of its tables, which the terminal shows too."""
import html
from typing import Any, List, Sequence

from unit_tests.facts import count
from unit_tests.survey import Found, Row, Share

ROW_HEAD = ("visitor", "answers by", "outcome", "after", "exhibits", "with faults")
SHARE_HEAD = ("failure rate", "runs", "successes", "share", "95 % interval", "pass takes")

STYLE = """
body { font: 15px/1.45 system-ui, "DejaVu Sans", sans-serif; margin: 0 auto; max-width: 64rem; padding: 1rem; color: #16202b; }
h1 { font-size: 1.3rem; } h2 { font-size: 1.05rem; margin: 1.6rem 0 .4rem; }
table { border-collapse: collapse; } td, th { text-align: left; padding: .1rem 1rem .1rem 0; border-top: 1px solid #d5dbe1; }
th { color: #5d6975; } code { background: #f2f5f8; overflow-wrap: anywhere; } summary { cursor: pointer; }
.at { color: #5d6975; text-align: right; white-space: nowrap; } svg { max-width: 100%; height: auto; }
"""

PLOT = """<svg role="img" aria-label="share of successes over the failure rate" width="590" height="260"
viewBox="-50 -10 590 260" font-size="12" fill="#5d6975">{0}<polyline points="{1}" fill="none" stroke="#0072b2"/>{2}
<text x="260" y="246" text-anchor="middle">failure rate</text></svg>"""
"""The plot's area is 520 pixels wide and 220 high, from the origin on; the axes' labels are outside of it."""

PAGE = """<!DOCTYPE html>
<html lang="en"><head><meta charset="utf-8"><meta name="viewport" content="width=device-width"><title>{0}</title>
<style>{1}</style></head>
<body><h1>{0}</h1>
{2}
</body></html>
"""


def row_cells(row: Row) -> List[str]:
    """Return the cells for a visitor."""
    faulty = ", ".join("{} {}".format(number, outcome or "without an end") for outcome, number in row.with_faults)
    return [row.visitor, "voice" if row.by_voice else "tablet", row.outcome or "no end",
            duration(row.seconds), str(row.exhibits), faulty or "-"]


def share_cells(share: Share) -> List[str]:
    """Return the cells for the runs at one failure rate."""
    return ["{:g}".format(share.rate), str(share.runs), str(share.successes), "{:.1f} %".format(100 * share.share),
            "{:.1f} to {:.1f} %".format(*(100 * end for end in share.interval)),
            duration(share.seconds) if share.seconds == share.seconds else "-"]


def duration(seconds: float) -> str:
    """Return a duration as text, such as ``2 min 5 s``."""
    whole = int(round(seconds))
    return "{} min {} s".format(*divmod(whole, 60)) if whole >= 60 else "{} s".format(whole)


def to_html(title: str, rows: Sequence[Row], shares: Sequence[Share], found: Sequence[Found]) -> str:
    """Return the page."""
    parts = []
    if rows:
        parts += ["<h2>Visitors</h2>", _table(ROW_HEAD, [row_cells(row) for row in rows])]
    if shares:
        parts += ["<h2>Share of successes</h2>", plot(shares), _table(SHARE_HEAD, [share_cells(each) for each in shares])]
    parts += ["<h2>Findings</h2>"] + [_found(each) for each in found] + ([] if found else ["<p>Nothing was found.</p>"])
    return PAGE.format(_text(title), STYLE, "\n".join(parts))


def _text(value: Any) -> str:
    return html.escape(str(value).encode("utf-8", "backslashreplace").decode("utf-8"))


def _table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    lines = ["<tr>{}</tr>".format("".join("<th>{}</th>".format(_text(cell)) for cell in head))]
    lines += ["<tr>{}</tr>".format("".join("<td>{}</td>".format(_text(cell)) for cell in row)) for row in rows]
    return "<table>{}</table>".format("\n".join(lines))


def _found(found: Found) -> str:
    story = "".join("<tr><td class=\"at\">{:.1f} s</td><td>{}</td></tr>".format(each.at, _text(each.text))
                    for each in found.story)
    shown = "" if found.scene is None else (
        "<details><summary>the shortest of {}</summary><table>{}</table></details>"
        "<p>Again: <code>{}</code></p>").format(count(found.plays, "play", "plays"), story, _text(found.command))
    return "<h3>{}: {}</h3><p>{}</p><p>{}{}</p>{}".format(
        _text(found.kind.name), _text(found.where or "the mission"), _text(found.kind.means), _text(found.what),
        " (<code>{}</code>)".format(_text(found.place)) if found.place else "", shown)


def plot(shares: Sequence[Share]) -> str:
    """Return the shares over the failure rate as SVG: points joined by lines, each with its interval."""
    axes = ["<path d=\"M0 {1}H520\" stroke=\"#d5dbe1\"/><text x=\"-6\" y=\"{1}\" dy=\"4\" text-anchor=\"end\">{2:.0f} %</text>"
            "<text x=\"{0}\" y=\"238\" text-anchor=\"middle\">{3:g}</text>".format(_x(at), _y(at), 100 * at, at)
            for at in (0.0, 0.2, 0.4, 0.6, 0.8, 1.0)]
    points = " ".join("{},{}".format(_x(share.rate), _y(share.share)) for share in shares)
    marks = ["<path d=\"M{0} {1}V{2}\" stroke=\"#0072b2\"/><circle cx=\"{0}\" cy=\"{3}\" r=\"3.5\" fill=\"#0072b2\">"
             "<title>{4}</title></circle>".format(_x(share.rate), *map(_y, share.interval), _y(share.share),
                                                  _text("; ".join(share_cells(share))))
             for share in shares]
    return PLOT.format("".join(axes), points, "".join(marks))


def _x(rate: float) -> str:
    return "{:g}".format(520 * rate)


def _y(share: float) -> str:
    return "{:g}".format(220 * (1 - share))
