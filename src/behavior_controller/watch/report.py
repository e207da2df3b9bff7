"""A recorded run as one self-contained web page: what happened when, and the tree with the outcome of each node."""
import datetime
import html
from typing import Any, Dict, Iterator, List, NamedTuple, Set, Tuple, Union

from behavior_controller import leaves
from behavior_controller.errors import Fault, MissionError
from behavior_controller.watch.expected import NUMBER, mismatch

Line = Dict[str, Any]
RECOVERIES = {spec.id for spec in leaves.SPECS if spec.is_recovery}
SIGNS = {"S": "✔", "F": "✘", "R": "▶", "-": "■"}
WORDS = {"SUCCESS": "S", "FAILURE": "F", "IDLE": "-"}
STEPS = 400
"""Results of a leaf that are nearer than this part of the timeline, and alike, are one bar: a page must open."""

DEEPEST = 100
"""Levels of nested lists; browsers take no more than about 170, so what is deeper stands beside its parent."""

FAILURE = {"cause": str, "message": str}
SHAPES = {
    "Tree": {"nodes": [[str, str, str, int]]},
    "RunStarted": {"time": NUMBER, "mission": str, "settings": dict},
    "Tick": {"changes": [[int, str]]},
    "LeafFinished": {"time": NUMBER, "node": str, "path": str, "status": str, "seconds": NUMBER,
                     "failure": (FAILURE, type(None))},
    "Retried": {"time": NUMBER, "path": str, "attempt": int, "failure": FAILURE},
    "Recovered": {"time": NUMBER, "node": str, "path": str, "outcome": str, "policy": str, "failure": FAILURE},
    "HealthChanged": {"time": NUMBER, "kind": str, "name": str, "status": str},
    "Noticed": {"time": NUMBER, "level": str, "text": str},
    "PassFinished": {"number": int, "outcome": str, "seconds": NUMBER},
    "RunFinished": {"outcome": str},
    "Asked": {"call": int, "request": [str, dict]},
    "Answered": {"call": int},
}
"""What the report reads of the lines of a record."""

ANSWER = [str, [[str, str, str, list, list]]]
"""The response of a service, and the exhibits or places of the knowledge base."""

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


def to_html(lines: List[Line], file: str = "the record") -> str:
    """Return the page of a record (its last mission, if the mission was changed while it ran).

    Raises MissionError that names the first line of ``file`` that the node cannot have written.
    """
    _check(lines, file)
    starts = [place for place, line in enumerate(lines) if line["event"] == "RunStarted"]
    started, after = lines[starts[-1]], lines[starts[-1]:]
    tree = [line for line in lines[:starts[-1]] if line["event"] == "Tree"][-1]
    nodes = [_Node(*node) for node in tree["nodes"]]
    parts = [_summary(started, after, [lines[place]["mission"] for place in starts[:-1]]), _passes(nodes, after),
             _decisions(after, started["time"]), _timeline(after, started["time"]), _tree(nodes, after)]
    title = "Mission {}".format(started["mission"].split("/")[-1])
    return ("<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><title>{0}</title><style>{1}</style></head>"
            "<body><h1>{0}</h1>{2}</body></html>\n").format(_text(title), STYLE, "\n".join(parts))


# ----------------------------------------------------------------------------------------------- what a record may hold


def _check(lines: List[Line], file: str) -> None:
    """Raise MissionError if the lines are not what the node writes: a record may have been changed by hand."""
    nodes = 0  # of the tree whose ticks follow
    for number, line in enumerate(lines, 1):
        wrong = mismatch(line, {"event": str}) or mismatch(line, SHAPES.get(line["event"], {}))
        wrong = wrong or _misplaced(line, nodes)
        if wrong:
            raise MissionError([Fault(file, number, 1, "this is no line of a record: {}".format(wrong),
                                      "a record is written by the node")])
        if line["event"] == "Tree":
            nodes = len(line["nodes"])


def _misplaced(line: Line, nodes: int) -> str:
    """Return what is wrong with a line of the right shape, after a tree of so many ``nodes``; "" if nothing is."""
    kind = line["event"]
    if kind == "Tree" and not all(parent < number and bool(parent) is (number > 1)
                                  for number, (_, _, _, parent) in enumerate(line["nodes"], 1)):
        return "a node's parent does not come before it"
    if kind == "RunStarted" and not nodes:
        return "no tree comes before it"
    if kind == "Tick" and not all(1 <= uid <= nodes for uid, _ in line["changes"]):
        return "the tree has only {} nodes".format(nodes)
    return mismatch(line["answer"], ANSWER) if kind == "Answered" and "answer" in line else ""


# ------------------------------------------------------------------------------------------------------- parts of a page


def _text(value: Any) -> str:
    """Return a value as HTML; half a surrogate pair, which no file can hold, is escaped."""
    return html.escape(str(value).encode("utf-8", "backslashreplace").decode("utf-8"))


def _table(head: List[str], rows: List[List[str]]) -> str:
    """Return a table of cells that are HTML already."""
    return "<table><tr>{}</tr>{}</table>".format("".join("<th>{}</th>".format(cell) for cell in head), "".join(
        "<tr>{}</tr>".format("".join("<td>{}</td>".format(cell) for cell in row)) for row in rows))


def _letter(status: str) -> str:
    return WORDS.get(status, "-")


def _sign(letter: str) -> str:
    return '<span class="{}">{}</span>'.format(letter if letter != "-" else "h", SIGNS[letter])


def _summary(started: Line, lines: List[Line], earlier: List[str]) -> str:
    """Return when it ran, with which configuration, and how it ended."""
    when = datetime.datetime.fromtimestamp(started["time"]).isoformat(sep=" ", timespec="seconds")
    chosen = "; ".join("{} {}".format(key, value) for key, value in started["settings"].items())
    ends = [line["outcome"] for line in lines if line["event"] == "RunFinished"]
    told = ["ended: " + ends[-1] if ends else "the record ends before the run: the node was killed, or the record full"]
    if earlier:
        told.append("before it the record has {}, which this report leaves out".format(", ".join(earlier)))
    return "<p>{}; {}<br><span class=\"count\">{}</span></p>".format(_text(when), _text("; ".join(told)), _text(chosen))


def _passes(nodes: List[_Node], lines: List[Line]) -> str:
    """Return how each pass ended, and which exhibits it left out."""
    rows, tour = [], _Tour(nodes)
    for line in lines:
        tour.take(line)
        if line["event"] == "PassFinished":
            rows.append([_text(line["number"]), _sign(_letter(line["outcome"])) + " " + _text(line["outcome"]),
                         "{:.1f} s".format(line["seconds"]), "<br>".join(map(_text, tour.left_out()))])
            tour = _Tour(nodes)
    return _table(["visitor", "outcome", "took", "exhibits left out"], rows)


class _Tour:
    """What became of the exhibits of one pass."""

    def __init__(self, nodes: List[_Node]):
        self._parents = {node.path: node.parent for node in nodes}
        self._requests: Dict[int, List[Any]] = {}
        self._exhibits: List[Any] = []
        self._said: Set[str] = set()
        self._goal = ""
        self._recovered: Line = {}
        self._steps: Dict[str, List[str]] = {}  # recoveries of a step by the node beside it, by the last goal
        self._whole: Dict[str, List[str]] = {}  # of more than a step, such as the visit of an exhibit

    def take(self, line: Line) -> None:
        """Take in the next line."""
        kind = line["event"]
        if kind == "Asked":
            self._requests[line["call"]] = line["request"]
            if line["request"][0] == "GoTo":
                self._goal = str(line["request"][1].get("goal"))
        elif kind == "Answered" and "answer" in line:
            asked, fields = self._requests.get(line["call"], ["", {}])
            self._exhibits = line["answer"][1] if fields == {"what": "exhibits"} else self._exhibits
            self._said |= {str(fields.get("text"))} if asked == "Say" else set()
        elif kind == "Recovered":
            self._recovered = line
        elif kind == "LeafFinished" and self._recovered:  # the recovery's own
            self._keep(self._recovered, line["path"])
            self._recovered = {}

    def _keep(self, recovered: Line, handler: str) -> None:
        if recovered["outcome"] in ("skipped", "given up"):
            is_step = self._parents.get(recovered["path"]) == self._parents.get(handler)
            (self._steps if is_step else self._whole).setdefault(self._goal, []).append("{}: {}; {} ({})".format(
                recovered["node"], _why(recovered), recovered["outcome"], recovered["policy"]))

    def left_out(self) -> List[str]:
        """Return the exhibits of which nothing was said, and why."""
        return ["{}: {}".format(name, self._reason(str(place)))
                for name, first, second, place, _ in self._exhibits if not self._said & {first, second}]

    def _reason(self, goal: str) -> str:
        reasons = self._whole.get(goal, [])[-1:] or dict.fromkeys(self._steps.get(goal, []))
        return "; ".join(reasons) or ("no description was spoken" if goal == self._goal else "it was not driven to")


def _why(line: Line) -> str:
    return "{}: {}".format(line["failure"]["cause"], line["failure"]["message"])


def _decisions(lines: List[Line], began: float) -> str:
    """Return failures, retries, recoveries and what was noticed of the robot, in order."""
    rows = [['<span class="time">{:.1f} s</span>'.format(line["time"] - began), _text(text)]
            for line, text in zip(lines, map(_decision, lines)) if text]
    return "<h2>Failures and recoveries</h2>" + (_table(["after", "what"], rows) if rows else "<p>none</p>")


def _decision(line: Line) -> str:
    """Return what is told of a line; "" for most."""
    kind = line["event"]
    if kind == "LeafFinished" and _is_worth_telling(line):
        return "{} failed: {}".format(line["path"], _why(line))
    if kind == "Retried":
        return "{}: retry {} failed: {}".format(line["path"], line["attempt"], line["failure"]["cause"])
    if kind == "Recovered":
        return "{}: recovery: {} ({}), for {}".format(line["path"], line["outcome"], line["policy"], _why(line))
    if kind == "HealthChanged":
        return "{} {}: {}".format(line["kind"], line["name"], line["status"])
    return "{}: {}".format(line["level"], line["text"]) if kind == "Noticed" else ""


def _is_worth_telling(finished: Line) -> bool:
    """Whether a leaf failed; a false condition is an answer, and what HandleFallBack decided is told by itself."""
    failure = finished["failure"]
    return bool(failure) and failure["cause"] != "condition false" and finished["node"] not in RECOVERIES


def _timeline(lines: List[Line], began: float) -> str:
    """Return a row for each mission leaf that ran, with bars for its results."""
    lanes: Dict[str, List[Line]] = {}
    for line in lines:
        if line["event"] == "LeafFinished":
            lanes.setdefault(line["path"], []).append(line)
    whole = max([line["time"] - began for lane in lanes.values() for line in lane] + [0.001])
    cells = [[_text(path.split("/")[-1]), '<div class="lane">{}</div>'.format("".join(_bars(lane, began, whole)))]
             for path, lane in lanes.items()]
    return "<h2>Timeline of {:.1f} s</h2>{}".format(
        whole, _table(["leaf", "when (dashed: failure; grey: halted)"], cells))


def _bars(finished: List[Line], began: float, whole: float) -> Iterator[str]:
    """Yield the bars of a leaf; results that are alike and near each other are one, which says how many they are."""
    bars: List[List[Any]] = []  # status, begin, end, results
    newest: Dict[str, List[Any]] = {}
    for line in finished:
        end = line["time"] - began
        begin = max(0.0, end - line["seconds"])
        bar = newest.get(line["status"])
        if bar is not None and begin - bar[2] < whole / STEPS:
            bar[2:] = [end, bar[3] + 1]
        else:
            newest[line["status"]] = [line["status"], begin, end, 1]
            bars.append(newest[line["status"]])
    for status, begin, end, count in bars:
        letter = _letter(status)
        yield '<span class="bar {}" style="left:{:.2f}%;width:{:.2f}%" title="{}{} {:.3f} s"></span>'.format(
            letter if letter != "-" else "h", 100 * begin / whole, 100 * (end - begin) / whole,
            "" if count == 1 else "{} × ".format(count), _text(status), end - begin)


def _tree(nodes: List[_Node], lines: List[Line]) -> str:
    """Return the tree as nested lists, each node with its results; what never ran is grey."""
    counts: List[Dict[str, int]] = [{} for _ in nodes]
    for line in lines:
        if line["event"] == "Tick":
            for uid, letter in line["changes"]:
                counts[uid - 1][letter] = counts[uid - 1].get(letter, 0) + 1
    children: List[List[int]] = [[] for _ in range(len(nodes) + 1)]
    for number, node in enumerate(nodes, 1):
        children[node.parent].append(number)
    found: List[str] = []
    waiting: List[Tuple[Union[int, str], int]] = [(1, 1)]  # a node, or what closes one, and its level
    while waiting:
        entry, level = waiting.pop()
        if isinstance(entry, str):
            found.append(entry)
            continue
        is_nested = bool(children[entry]) and level < DEEPEST
        opening, closing = _item(nodes[entry - 1], counts[entry - 1], is_nested)
        found.append(opening)
        inner = [(child, level + 1) for child in reversed(children[entry])]
        waiting += [(closing, level)] + inner if is_nested else inner + [(closing, level)]
    return '<h2>Tree</h2><div class="tree"><ul>{}</ul></div>'.format("".join(found))


def _item(node: _Node, count: Dict[str, int], is_nested: bool) -> Tuple[str, str]:
    """Return what stands before and after the children of a node."""
    results = " ".join("{}&thinsp;{}".format(_sign(letter), count[letter]) for letter in "SF" if letter in count)
    kind = "" if node.type == node.name else ' <span class="count">{}</span>'.format(_text(node.type))
    label = '<span class="{}">{}</span>{} {}'.format("" if count else "never", _text(node.name), kind, results or (
        _sign("-") if count else '<span class="never">never</span>'))
    opening = '<li class="node" title="{}">'.format(_text(node.path))
    if not is_nested:
        return opening + label, "</li>"
    return (opening + "<details{}><summary>{}</summary><ul>".format(" open" if count else "", label),
            "</ul></details></li>")
