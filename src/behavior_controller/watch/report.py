"""A recorded run as one self-contained web page: what happened when, and the tree with the outcome of each node."""
import datetime
import html
from typing import Any, Dict, List, NamedTuple

Line = Dict[str, Any]
SIGNS = {"S": "✔", "F": "✘", "R": "▶", "-": "■"}
WORDS = {"SUCCESS": "S", "FAILURE": "F", "IDLE": "-"}
KEPT = 2000
"""Bars of the timeline at the most: a page must open in a browser."""

STYLE = """
body { font: 15px/1.45 system-ui, "DejaVu Sans", sans-serif; margin: 0 auto; max-width: 76rem; padding: 1rem; color: #16202b; }
h1 { font-size: 1.3rem; } h2 { font-size: 1.05rem; margin: 1.6rem 0 .4rem; }
table { border-collapse: collapse; width: 100%; } td, th { text-align: left; vertical-align: top; padding: .1rem .6rem .1rem 0;
  border-top: 1px solid #d5dbe1; } th { color: #5d6975; font-weight: 600; }
td:first-child { width: 1%; white-space: nowrap; } .time { white-space: nowrap; color: #5d6975; } .lane { position: relative; height: 1rem; min-width: 18rem; background: #f2f5f8; }
.bar { position: absolute; top: .15rem; height: .7rem; min-width: 3px; border-radius: 2px; }
.S { color: #00785a; } .F { color: #b34700; } .R { color: #0072b2; } .h { color: #5d6975; }
.bar.S { background: #00785a; } .bar.F { background: #b34700; border: 1px dashed #000; } .bar.h { background: #8d99a6; }
ul { list-style: none; padding-left: 1.1rem; border-left: 1px solid #d5dbe1; margin: 0; } .tree > ul { border: 0; padding: 0; }
summary { cursor: pointer; } .count { color: #5d6975; font-size: .85em; } .never { color: #8d99a6; }
"""


class _Node(NamedTuple):
    path: str
    type: str
    name: str
    parent: int  # its number; 0 is none


def to_html(lines: List[Line]) -> str:
    """Return the page of a record (its last mission, if the mission was changed while it ran)."""
    start = max(place for place, line in enumerate(lines) if line["event"] == "RunStarted")
    started, after = lines[start], lines[start:]
    tree = [line for line in lines[:start] if line["event"] == "Tree"][-1]
    parts = [_summary(started, after), _decisions(after, started["time"]), _timeline(after, started["time"]),
             _tree([_Node(*node) for node in tree["nodes"]], after)]
    title = "Mission {}".format(started["mission"].split("/")[-1])
    return ("<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><title>{0}</title><style>{1}</style></head>"
            "<body><h1>{0}</h1>{2}</body></html>\n").format(html.escape(title), STYLE, "\n".join(parts))


def _text(value: Any) -> str:
    return html.escape(str(value))


def _table(head: List[str], rows: List[List[str]]) -> str:
    """Return a table of cells that are HTML already."""
    return "<table><tr>{}</tr>{}</table>".format("".join("<th>{}</th>".format(cell) for cell in head), "".join(
        "<tr>{}</tr>".format("".join("<td>{}</td>".format(cell) for cell in row)) for row in rows))


def _sign(letter: str) -> str:
    return '<span class="{}">{}</span>'.format(letter if letter != "-" else "h", SIGNS[letter])


def _summary(started: Line, lines: List[Line]) -> str:
    """Return when it ran, with which configuration, and how each pass ended."""
    when = datetime.datetime.fromtimestamp(started["time"]).isoformat(sep=" ", timespec="seconds")
    passes = [[_text(line["number"]), _sign(WORDS.get(line["outcome"], "-")) + " " + _text(line["outcome"]),
               "{:.1f} s".format(line["seconds"])] for line in lines if line["event"] == "PassFinished"]
    chosen = "; ".join("{} {}".format(key, value) for key, value in started["settings"].items())
    return "<p>{}<br><span class=\"count\">{}</span></p>{}".format(
        _text(when), _text(chosen), _table(["visitor", "outcome", "took"], passes))


def _decisions(lines: List[Line], began: float) -> str:
    """Return failures, retries, recoveries and what was noticed of the robot, in order."""
    rows = []
    for line in lines:
        text = ""
        if line["event"] == "LeafFinished" and _is_worth_telling(line):
            text = "{} failed: {}: {}".format(line["path"], line["failure"]["cause"], line["failure"]["message"])
        elif line["event"] == "Retried":
            text = "{}: retry {} failed: {}".format(line["path"], line["attempt"], line["failure"]["cause"])
        elif line["event"] == "Recovered":
            text = "{}: recovery: {} ({})".format(line["path"], line["outcome"], line["policy"])
        elif line["event"] == "HealthChanged":
            text = "{} {}: {}".format(line["kind"], line["name"], line["status"])
        if text:
            rows.append(['<span class="time">{:.1f} s</span>'.format(line["time"] - began), _text(text)])
    return "<h2>Failures and recoveries</h2>" + (_table(["after", "what"], rows) if rows else "<p>none</p>")


def _is_worth_telling(finished: Line) -> bool:
    """Whether a leaf failed; a false condition is an answer, and what HandleFallBack decided is told by itself."""
    failure = finished["failure"]
    return bool(failure) and failure["cause"] != "condition false" and finished["node"].lower() != "handlefallback"


def _timeline(lines: List[Line], began: float) -> str:
    """Return a bar for each mission leaf that ran, a row for each that took time or failed."""
    finished = [line for line in lines if line["event"] == "LeafFinished"][:KEPT]
    whole = max([line["time"] - began for line in finished] + [0.001])
    rows: Dict[str, List[str]] = {}
    for line in finished:
        letter = WORDS[line["status"]]
        begin = max(0.0, line["time"] - began - line["seconds"])
        rows.setdefault(line["path"], []).append(
            '<span class="bar {}" style="left:{:.2f}%;width:{:.2f}%" title="{} {:.3f} s"></span>'.format(
                letter if letter != "-" else "h", 100 * begin / whole, 100 * line["seconds"] / whole, line["status"],
                line["seconds"]))
    cells = [[_text(path.split("/")[-1]), '<div class="lane">{}</div>'.format("".join(bars))]
             for path, bars in rows.items()]
    return "<h2>Timeline of {:.1f} s</h2>{}".format(
        whole, _table(["leaf", "when (dashed: failure; grey: halted)"], cells))


def _tree(nodes: List[_Node], lines: List[Line]) -> str:
    """Return the tree as nested lists, each node with its results; what never ran is grey."""
    counts: List[Dict[str, int]] = [{} for _ in nodes]
    for line in lines:
        if line["event"] == "Tick":
            for uid, letter in line["changes"]:
                counts[uid - 1][letter] = counts[uid - 1].get(letter, 0) + 1
    children: Dict[int, List[int]] = {}
    for number, node in enumerate(nodes, 1):
        children.setdefault(node.parent, []).append(number)
    return '<h2>Tree</h2><div class="tree"><ul>{}</ul></div>'.format(_item(1, nodes, counts, children))


def _item(number: int, nodes: List[_Node], counts: List[Dict[str, int]], children: Dict[int, List[int]]) -> str:
    node, count = nodes[number - 1], counts[number - 1]
    results = " ".join("{}&thinsp;{}".format(_sign(letter), count[letter]) for letter in "SF" if letter in count)
    kind = "" if node.type == node.name else ' <span class="count">{}</span>'.format(_text(node.type))
    label = '<span class="{}">{}</span>{} {}'.format("" if count else "never", _text(node.name), kind, results or (
        _sign("-") if count else '<span class="never">never</span>'))
    below = children.get(number, [])
    if below:
        inner = "".join(_item(child, nodes, counts, children) for child in below)
        label = "<details{}><summary>{}</summary><ul>{}</ul></details>".format(" open" if count else "", label, inner)
    return '<li class="node" title="{}">{}</li>'.format(html.escape(node.path), label)
