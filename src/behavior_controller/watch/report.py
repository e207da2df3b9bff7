"""A recorded run as one self-contained web page: what happened when, and the tree with the outcome of each node."""
import datetime
import functools
import html
from typing import Any, Dict, FrozenSet, Iterator, List, Optional, Set, Tuple, Union

from behavior_controller import leaves
from behavior_controller.bt.status import NAMES
from behavior_controller.events import (HealthChanged, LeafFinished, Noticed, PassFinished, Recovered, Retried,
                                        RunFinished, RunStarted)
from behavior_controller.gateway import Cause, Failure
from behavior_controller.interface.records import Answer, Exhibit, GoTo, Location, QueryKnowledge, Request, Say
from behavior_controller.watch.codec import LETTERS, Answered, Asked, Entry, Line, Tick, TreeNode, TreeShown

SIGNS = {"S": "✔", "F": "✘", "R": "▶", "-": "■"}
LETTER_OF = {NAMES[status]: letter for status, letter in LETTERS.items()}
STEPS = 400
"""Results of a leaf that are nearer than this part of the timeline, and alike, are one bar: a page must open."""

DEEPEST = 100
"""Levels of nested lists; browsers take no more than about 170, so what is deeper stands beside its parent."""

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


def to_html(lines: List[Line]) -> str:
    """Return the page of a record (its last mission, if the mission was changed while it ran)."""
    missions = [(time, entry) for time, entry in lines if isinstance(entry, RunStarted)]
    began, started = missions[-1]
    first = [number for number, line in enumerate(lines) if line.entry is started][-1]
    nodes = [line.entry.nodes for line in lines[:first] if isinstance(line.entry, TreeShown)][-1]
    after = lines[first:]
    entries = [line.entry for line in after]
    parts = [_summary(missions, entries), _passes(nodes, entries), _decisions(after, began), _timeline(after, began),
             _tree(nodes, entries)]
    title = "Mission {}".format(started.mission.split("/")[-1])
    return ("<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><title>{0}</title><style>{1}</style></head>"
            "<body><h1>{0}</h1>{2}</body></html>\n").format(_text(title), STYLE, "\n".join(parts))


# ------------------------------------------------------------------------------------------------------- parts of a page


def _text(value: Any) -> str:
    """Return a value as HTML; half a surrogate pair, which no file can hold, is escaped."""
    return html.escape(str(value).encode("utf-8", "backslashreplace").decode("utf-8"))


def _table(head: List[str], rows: List[List[str]]) -> str:
    """Return a table of cells that are HTML already."""
    return "<table><tr>{}</tr>{}</table>".format("".join("<th>{}</th>".format(cell) for cell in head), "".join(
        "<tr>{}</tr>".format("".join("<td>{}</td>".format(cell) for cell in row)) for row in rows))


def _sign(letter: str) -> str:
    return '<span class="{}">{}</span>'.format(letter if letter != "-" else "h", SIGNS[letter])


def _summary(missions: List[Tuple[float, RunStarted]], entries: List[Entry]) -> str:
    """Return when the last of the missions ran, with which configuration, and how it ended."""
    began, started = missions[-1]
    earlier = [mission.mission for _, mission in missions[:-1]]
    when = datetime.datetime.fromtimestamp(began).isoformat(sep=" ", timespec="seconds")
    chosen = "; ".join("{} {}".format(key, value) for key, value in started.settings.items())
    ends = [entry.outcome for entry in entries if isinstance(entry, RunFinished)]
    told = ["ended: " + ends[-1] if ends else "the record ends before the run: the node was killed, or the record full"]
    if earlier:
        told.append("before it the record has {}, which this report leaves out".format(", ".join(earlier)))
    return "<p>{}; {}<br><span class=\"count\">{}</span></p>".format(_text(when), _text("; ".join(told)), _text(chosen))


def _passes(nodes: List[TreeNode], entries: List[Entry]) -> str:
    """Return how each pass ended, and which exhibits it left out."""
    rows, tour = [], _Tour(nodes)
    for entry in entries:
        tour.take(entry)
        if isinstance(entry, PassFinished):
            rows.append([_text(entry.number), _sign(LETTER_OF.get(entry.outcome, "-")) + " " + _text(entry.outcome),
                         "{:.1f} s".format(entry.seconds), "<br>".join(map(_text, tour.left_out()))])
            tour = _Tour(nodes)
    return _table(["visitor", "outcome", "took", "exhibits left out"], rows)


class _Tour:
    """What became of the exhibits of one pass."""

    def __init__(self, nodes: List[TreeNode]):
        self._parents = {node.path: node.parent for node in nodes}
        self._requests: Dict[int, Request] = {}
        self._exhibits: Tuple[Exhibit, ...] = ()
        self._said: Set[str] = set()
        self._goal: Optional[Location] = None
        self._recovered: Optional[Recovered] = None
        # recoveries by the last goal: of a step by the node beside it; of more, such as the visit of an exhibit
        self._steps: Dict[Optional[Location], List[str]] = {}
        self._whole: Dict[Optional[Location], List[str]] = {}

    def take(self, entry: Entry) -> None:
        """Take in the next entry."""
        if isinstance(entry, Asked):
            self._requests[entry.call] = entry.request
            if isinstance(entry.request, GoTo):
                self._goal = entry.request.goal
        elif isinstance(entry, Answered) and isinstance(entry.result, Answer):
            request = self._requests.get(entry.call)
            if request == QueryKnowledge("exhibits"):
                self._exhibits = entry.result.exhibits
            elif isinstance(request, Say):
                self._said.add(request.text)
        elif isinstance(entry, Recovered):
            self._recovered = entry
        elif isinstance(entry, LeafFinished) and self._recovered:  # the recovery's own
            self._keep(self._recovered, entry.path)
            self._recovered = None

    def _keep(self, recovered: Recovered, handler: str) -> None:
        if recovered.outcome in ("skipped", "given up"):
            is_step = self._parents.get(recovered.path) == self._parents.get(handler)
            (self._steps if is_step else self._whole).setdefault(self._goal, []).append("{}: {}; {} ({})".format(
                recovered.node, _why(recovered.failure), recovered.outcome, recovered.policy))

    def left_out(self) -> List[str]:
        """Return the exhibits of which nothing was said, and why."""
        return ["{}: {}".format(exhibit.name, self._reason(exhibit.location)) for exhibit in self._exhibits
                if not self._said & {exhibit.description1, exhibit.description2}]

    def _reason(self, goal: Location) -> str:
        reasons = self._whole.get(goal, [])[-1:] or dict.fromkeys(self._steps.get(goal, []))
        return "; ".join(reasons) or ("no description was spoken" if goal == self._goal else "it was not driven to")


def _why(failure: Failure) -> str:
    return "{}: {}".format(failure.cause.text, failure.message)


def _decisions(lines: List[Line], began: float) -> str:
    """Return failures, retries, recoveries and what was noticed of the robot, in order."""
    told = [(time, _decision(entry)) for time, entry in lines]
    rows = [['<span class="time">{:.1f} s</span>'.format(time - began), _text(text)] for time, text in told if text]
    return "<h2>Failures and recoveries</h2>" + (_table(["after", "what"], rows) if rows else "<p>none</p>")


def _decision(entry: Entry) -> str:
    """Return what is told of an entry; "" for most."""
    if isinstance(entry, LeafFinished) and entry.failure and _is_worth_telling(entry.node, entry.failure):
        return "{} failed: {}".format(entry.path, _why(entry.failure))
    if isinstance(entry, Retried):
        return "{}: retry {} failed: {}".format(entry.path, entry.attempt, entry.failure.cause.text)
    if isinstance(entry, Recovered):
        return "{}: recovery: {} ({}), for {}".format(entry.path, entry.outcome, entry.policy, _why(entry.failure))
    if isinstance(entry, HealthChanged):
        return "{} {}: {}".format(entry.kind, entry.name, entry.status)
    return "{}: {}".format(entry.level, entry.text) if isinstance(entry, Noticed) else ""


@functools.lru_cache(maxsize=None)
def _recoveries() -> FrozenSet[str]:
    return frozenset(spec.id for spec in leaves.mission_specs() if spec.is_recovery)


def _is_worth_telling(node: str, failure: Failure) -> bool:
    """Whether a leaf failed; a false condition is an answer, and what HandleFallBack decided is told by itself."""
    return failure.cause is not Cause.CONDITION_FALSE and node not in _recoveries()


def _timeline(lines: List[Line], began: float) -> str:
    """Return a row for each mission leaf that ran, with bars for its results."""
    lanes: Dict[str, List[Tuple[float, LeafFinished]]] = {}
    for time, entry in lines:
        if isinstance(entry, LeafFinished):
            lanes.setdefault(entry.path, []).append((time, entry))
    whole = max([time - began for lane in lanes.values() for time, _ in lane] + [0.001])
    cells = [[_text(path.split("/")[-1]), '<div class="lane">{}</div>'.format("".join(_bars(lane, began, whole)))]
             for path, lane in lanes.items()]
    return "<h2>Timeline of {:.1f} s</h2>{}".format(
        whole, _table(["leaf", "when (dashed: failure; grey: halted)"], cells))


def _bars(finished: List[Tuple[float, LeafFinished]], began: float, whole: float) -> Iterator[str]:
    """Yield the bars of a leaf; results that are alike and near each other are one, which says how many they are."""
    bars: List[List[Any]] = []  # status, begin, end, results
    newest: Dict[str, List[Any]] = {}
    for time, leaf in finished:
        end = time - began
        begin = max(0.0, end - leaf.seconds)
        bar = newest.get(leaf.status)
        if bar is not None and begin - bar[2] < whole / STEPS:
            bar[2:] = [end, bar[3] + 1]
        else:
            newest[leaf.status] = [leaf.status, begin, end, 1]
            bars.append(newest[leaf.status])
    for status, begin, end, count in bars:
        letter = LETTER_OF.get(status, "-")
        yield '<span class="bar {}" style="left:{:.2f}%;width:{:.2f}%" title="{}{} {:.3f} s"></span>'.format(
            letter if letter != "-" else "h", 100 * begin / whole, 100 * (end - begin) / whole,
            "" if count == 1 else "{} × ".format(count), _text(status), end - begin)


def _tree(nodes: List[TreeNode], entries: List[Entry]) -> str:
    """Return the tree as nested lists, each node with its results; what never ran is grey."""
    counts: List[Dict[str, int]] = [{} for _ in nodes]
    for entry in entries:
        if isinstance(entry, Tick):
            for uid, letter in entry.changes:
                counts[uid - 1][letter] = counts[uid - 1].get(letter, 0) + 1
    children: List[List[int]] = [[] for _ in range(len(nodes) + 1)]
    for number, node in enumerate(nodes, 1):
        children[node.parent].append(number)
    found: List[str] = []
    waiting: List[Tuple[Union[int, str], int]] = [(1, 1)]  # a node, or what closes one, and its level
    while waiting:
        item, level = waiting.pop()
        if isinstance(item, str):
            found.append(item)
            continue
        is_nested = bool(children[item]) and level < DEEPEST
        opening, closing = _item(nodes[item - 1], counts[item - 1], is_nested)
        found.append(opening)
        inner: List[Tuple[Union[int, str], int]] = [(child, level + 1) for child in reversed(children[item])]
        waiting += [(closing, level)] + inner if is_nested else inner + [(closing, level)]
    return '<h2>Tree</h2><div class="tree"><ul>{}</ul></div>'.format("".join(found))


def _item(node: TreeNode, count: Dict[str, int], is_nested: bool) -> Tuple[str, str]:
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
