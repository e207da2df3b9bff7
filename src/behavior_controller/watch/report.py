"""A recorded run as one self-contained web page: its story, a timeline, the tree with its outcomes, the mission file."""
import base64
import collections
import hashlib
import html
import itertools
import json
import os
import re
from time import localtime, strftime
from types import SimpleNamespace
from typing import Any, Counter, DefaultDict, Dict, Iterable, Iterator, List, NamedTuple, Optional, Tuple, Union

from behavior_controller import leaves
from behavior_controller.bt.engine.node import label
from behavior_controller.bt.language.document import parse
from behavior_controller.bt.status import NAMES
from behavior_controller.errors import BehaviorControllerError
from behavior_controller.events import (EVENTS, LeafFinished, PassFinished, PassStarted, Retried, RunFinished,
                                        RunStarted)
from behavior_controller.gateway import Cause, Failure
from behavior_controller.mission import build_tree
from behavior_controller.story import SHOWN, UNDER_WAY, Sentence, Step, Story, Visit, cause, title
from behavior_controller.watch.board import clock, is_bare, port_texts
from behavior_controller.watch.codec import LETTERS, Entry, Letter, Line, Lost, Tick, TreeNode, TreeShown
from behavior_controller.watch.lanes import Bar, Lanes

FOLDER = os.path.dirname(os.path.abspath(__file__))
SIGNS = {"S": "✔", "F": "✘", "R": "▶", "-": "■", "n": "○", "r": "↻"}
LETTER_OF = {NAMES[status]: letter for status, letter in LETTERS.items()}
NO, RETRY, DONE = "n", "r", "d"
"""Kinds of bars in addition to the statuses: a condition that does not hold, a retry that failed, a step."""

LEGEND = {"S": "success", "F": "failure", "h": "halted", NO: "does not hold yet", RETRY: "a retry failed",
          "w": "waiting for a visitor", "warning": "warning", "error": "error"}

DEEPEST = 100
"""Levels of nested lists; browsers accept no more than about 170, so deeper nodes are shown beside their parent."""


class Told(NamedTuple):
    """A sentence and the cause of the failure that it is about; the cause is empty if there is none."""

    sentence: Sentence
    cause: str


class Written(NamedTuple):
    """How the file writes a node: the number of a document of the record, the line in it, and the ports.

    A port is its name, its text, and whether that text stands in the file; otherwise it is the default.
    """

    document: int
    line: int
    ports: List[Tuple[str, str, bool]]


class Run:
    """One mission of a record, processed line by line."""

    def __init__(self, began: float, started: RunStarted, nodes: List[TreeNode]):
        self.began = self.ended = began
        self.started = started
        self.nodes = nodes
        self.story = Story()
        self.visits: Dict[int, Visit] = {}
        self.ends: Dict[int, float] = {}  # of the visits that are over
        self.told: Dict[int, List[Told]] = {}  # by visit; 0 is what was before the first
        self.outcome = ""
        self.lost = 0  # lines that the record lacks
        self.counts: List[Counter[str]] = [Counter() for _ in nodes]  # statuses of each node
        self.finished: List[Counter[str]] = [Counter() for _ in nodes]  # kinds of results of each mission leaf
        self.steps: List[Bar] = []
        self.lanes = Lanes()  # results of mission leaves, from their events
        self.changes = Lanes()  # results of other nodes, from their changes of status
        self._running: Dict[int, float] = {}  # when each running node began, by uid
        self._uids = {node.path: uid for uid, node in enumerate(nodes, 1)}
        self._step: Optional[Step] = None

    def take(self, time: float, entry: Entry) -> None:
        """Process the next line."""
        self.ended = max(self.ended, time)
        if isinstance(entry, Tick):
            self._change(self._since(time), entry.changes)
        elif isinstance(entry, Lost):
            self.lost += entry.lines
        elif isinstance(entry, EVENTS):
            self._tell(time, entry)
            self._draw(time, entry)

    def _change(self, at: float, changes: List[Tuple[int, Letter]]) -> None:
        running, told = self._running, self.lanes
        for uid, letter in changes:
            self.counts[uid - 1][letter] += 1
            if uid in told:
                continue
            if letter == "R":
                running[uid] = at
            elif letter != "-" or uid in running:  # otherwise it ended earlier and is reset now
                self.changes.add(uid, Bar(running.pop(uid, at), at, letter))

    def _tell(self, time: float, event: Any) -> None:
        failure: Optional[Failure] = getattr(event, "failure", None)
        for sentence in self.story.take(time, event):
            self.told.setdefault(sentence.visit, []).append(Told(sentence, failure.cause.text if failure else ""))
        visit = self.story.visit
        if visit is not None:
            self.visits[visit.number] = visit
            self.told.setdefault(visit.number, [])
        if isinstance(event, PassStarted):
            self._running.clear()  # the record does not have halts between two traversals
        elif isinstance(event, PassFinished):
            self.ends[event.number] = time
        elif isinstance(event, RunFinished):
            self.outcome = event.outcome
        step = self.story.step
        if step != self._step:
            self._end_step(time)
            self._step = step

    def _end_step(self, time: float) -> None:
        if self._step is not None:
            end = self._since(time)
            self.steps.append(Bar(self._since(self._step.began), end, DONE, self._step.words))
            self.lanes.end_wait(self._step.uid, NO, end)  # a condition tells that it does not hold once

    def _draw(self, time: float, event: Any) -> None:
        end = self._since(time)
        if isinstance(event, Retried):
            self.lanes.add(self._uids.get(event.path, 0), Bar(end, end, RETRY, cause(event.failure)))
        elif isinstance(event, LeafFinished) and 0 < event.uid <= len(self.nodes):
            is_no = event.failure is not None and event.failure.cause is Cause.CONDITION_FALSE
            kind = NO if is_no else LETTER_OF.get(event.status, "-")
            self.finished[event.uid - 1][kind] += 1
            bar = Bar(end - min(end, max(0.0, event.seconds)), end, kind, cause(event.failure) if event.failure else "")
            self.lanes.add(event.uid, bar, is_asked_again=is_no)

    def _since(self, time: float) -> float:
        return max(0.0, time - self.began)

    def finish(self) -> "Run":
        """Note that the record is over."""
        self._end_step(self.ended)
        self._step = None
        return self


def to_html(lines: Iterable[Line]) -> str:
    """Return the page of a record (its last mission, if the mission was changed while it ran)."""
    earlier, run = _last(lines)
    written, doubt = _written(run)
    body = "".join([_header(run, earlier), "<main>", _story(run), _timeline(run), _tree(run, written, doubt),
                    _documents(run), _settings(run), "</main>"])
    style = _file("page_files", "colours.css") + _file("report_files", "report.css")
    script = _file("page_files", "common.js") + _file("report_files", "report.js")
    return PAGE.format(title=_text(title(run.started.mission)), body=body, style=style, script=script, data=_data(run, written),
                       allowed="default-src 'none'; style-src '{}'; script-src '{}'".format(_hash(style), _hash(script)))


PAGE = """<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta http-equiv="Content-Security-Policy" content="{allowed}">
<title>Mission {title}</title>
<style>{style}</style>
</head>
<body>
{body}
<script type="application/json" id="data">{data}</script>
<script>{script}</script>
</body>
</html>
"""


def _last(lines: Iterable[Line]) -> Tuple[List[RunStarted], Run]:
    """Return the missions before the last one, and the last one's run."""
    runs: List[RunStarted] = []
    run: Optional[Run] = None
    nodes: List[TreeNode] = []
    for time, entry in lines:
        if isinstance(entry, TreeShown):
            nodes = entry.nodes
        elif isinstance(entry, RunStarted):
            run = Run(time, entry, nodes)
            runs.append(entry)
        if run is not None:
            run.take(time, entry)
    assert run is not None  # ``decode`` has seen to it
    return runs[:-1], run.finish()


def _written(run: Run) -> Tuple[Dict[str, Written], str]:
    """Return how the file writes the nodes, by path, and why that is not known, if it is not."""
    sources = run.started.sources.documents
    try:
        tree = build_tree([parse(text, file) for file, text in sources])
    except BehaviorControllerError as error:
        return {}, "No lines and ports of the nodes are known: this release cannot read the mission ({}).".format(error)
    number = {source.file: place for place, source in enumerate(sources)}
    return {node.full_path: Written(number[node.element.document.file], node.element.place()[0], [
        (name, text, name in node.element.attributes) for name, text in port_texts(node).items()])
            for node in tree.nodes if node.element is not None}, ""


def _file(folder: str, name: str) -> str:
    with open(os.path.join(FOLDER, folder, name), encoding="utf-8") as file:
        return file.read()


def _hash(text: str) -> str:
    return "sha256-" + base64.b64encode(hashlib.sha256(text.encode("utf-8")).digest()).decode("ascii")


# ------------------------------------------------------------------------------------------------------- parts of a page


def _text(value: Any) -> str:
    """Return a value as HTML; half a surrogate pair, which no file can hold, is escaped."""
    return html.escape(str(value).encode("utf-8", "backslashreplace").decode("utf-8"))


def _time(at: float) -> str:
    return "<time>{}</time>".format(clock(at))


def _seconds(seconds: float) -> str:
    """Return a duration as text, such as ``2 min 5 s``."""
    if seconds < 60:
        return "{:.1f} s".format(seconds)
    minutes, rest = divmod(round(seconds), 60)
    return "{} min {} s".format(minutes, rest) if minutes < 60 else "{} h {} min".format(*divmod(minutes, 60))


def _sign(letter: str, word: str) -> str:
    return '<b class="{}" title="{}">{}</b>'.format(letter, word, SIGNS[letter])


def _options(first: str, values: Iterable[str]) -> str:
    counts = Counter(values)
    return '<option value="">{}</option>'.format(first) + "".join(
        '<option value="{0}">{0} ({1})</option>'.format(_text(value), counts[value]) for value in sorted(counts) if value)


def _header(run: Run, earlier: List[RunStarted]) -> str:
    """Return when the mission ran, how it ended, and what the report lacks."""
    ends = ", ".join("{} {}".format(count, outcome) for outcome, count in sorted(run.story.outcomes.items()))
    told = ["{} {} to {}, {}".format(strftime("%Y-%m-%d", localtime(run.began)), clock(run.began),
                                     clock(run.ended), _seconds(run.ended - run.began)),
            "visits: {}".format(ends) if ends else "no visit was ended",
            "ended: " + run.outcome if run.outcome else
            "the record ends before the run: the node was killed, or the record full"]
    lacks = []
    if earlier:
        lacks.append("Before it the record has {}, which this report leaves out.".format(
            ", ".join(mission.mission for mission in earlier)))
    if run.lost:
        lacks.append("The record lacks {} lines, which the disk was too slow for.".format(run.lost))
    return ('<header><h1>Mission {}</h1><p>{}</p>{}<nav aria-label="Sections"><a href="#story">Story</a> '
            '<a href="#timeline">Timeline</a> <a href="#tree">Tree</a> <a href="#files">Mission file</a> '
            '<a href="#settings">Configuration</a></nav></header>').format(
                _text(title(run.started.mission)), _text("; ".join(told)),
                "".join("<p>{}</p>".format(_text(text)) for text in lacks))


# ----------------------------------------------------------------------------------------------------------------- story


def _story(run: Run) -> str:
    """Return a section for each visit, and what finds sentences in them."""
    told = [each for part in run.told.values() for each in part]
    tools = ('<form class="tools" role="search"><label>Search <input type="search" id="words"></label>'
             '<label>About <select id="kind">{}</select></label><label>Severity <select id="severity">{}</select></label>'
             '<label>Cause <select id="cause">{}</select></label><output id="found"></output></form>').format(
                 _options("everything", (each.sentence.kind for each in told)),
                 _options("all", (each.sentence.severity for each in told)),
                 _options("any", (each.cause for each in told)))
    return ('<section id="story"><h2>Story</h2>{}<details class="visit" id="v0"><summary><h3>Before the first visit</h3>'
            "</summary>{}</details>{}</section>").format(
                tools, _sentences(run.told[0]), "".join(_visit(run, visit) for visit in run.visits.values()))


def _visit(run: Run, visit: Visit) -> str:
    shown = sum(exhibit.state == SHOWN for exhibit in visit.exhibits)
    outcome = _sign(LETTER_OF.get(visit.outcome, "R"), "") + " " + _text(visit.outcome or UNDER_WAY)
    facts = [_time(visit.began), outcome]
    if visit.exhibits:
        facts.append("{} of {} exhibits {}".format(shown, visit.exhibits[0].of, SHOWN))
    facts.append(_seconds(visit.seconds) + (", waited {} before".format(_seconds(visit.waited)) if visit.waited else ""))
    return ('<details class="visit" id="v{0}"><summary><h3>Visitor {0}</h3><span class="facts">{1}</span>'
            '<span class="why">{2}</span></summary>{3}{4}'
            '<button type="button" data-visit="{0}">Show on the timeline</button></details>').format(
                visit.number, "".join("<span>{}</span>".format(fact) for fact in facts), _text(visit.why),
                _exhibits(visit), _sentences(run.told[visit.number]))


def _exhibits(visit: Visit) -> str:
    if not visit.exhibits:
        return ""
    rows = "".join("<tr><th scope=\"row\">{} of {}, {}</th><td>{}</td><td>{}</td><td>{}</td></tr>".format(
        exhibit.number, exhibit.of, _text(exhibit.name), _text(exhibit.state), _seconds(exhibit.seconds), _text(exhibit.why))
        for exhibit in visit.exhibits)
    return '<table class="exhibits"><thead><tr><th>exhibit</th><th>state</th><th>took</th><th>why</th></tr></thead>' \
        "<tbody>{}</tbody></table>".format(rows)


def _sentences(told: List[Told]) -> str:
    """Return sentences as a list; one that is repeated within a second is told once, with its count."""
    items = []
    for _, group in itertools.groupby(told, lambda each: (each.sentence._replace(at=int(each.sentence.at)), each.cause)):
        alike = list(group)
        sentence, cause = alike[0]
        items.append('<li class="{}" data-kind="{}"{} data-at="{:.3f}">{}<span>{}</span>{}{}</li>'.format(
            _text(sentence.severity), _text(sentence.kind), ' data-cause="{}"'.format(_text(cause)) if cause else "",
            sentence.at, _time(sentence.at), _text(sentence.text),
            " <b>{} times</b>".format(len(alike)) if len(alike) > 1 else "",
            ' <a href="#n{0}" title="{1}">#{0}</a>'.format(sentence.uid, _text(sentence.path)) if sentence.uid else ""))
    return '<ol class="told">{}</ol>'.format("".join(items)) if items else ""


# -------------------------------------------------------------------------------------------------------------- timeline


def _timeline(run: Run) -> str:
    """Return the frame that the script draws the bars in, and what is joined in them."""
    joined = "{} results in {} bars: those of a node that are alike and less than {:g} s apart are one.".format(
        run.lanes.results, run.lanes.bars, run.lanes.grain)
    return ('<section id="timeline"><h2>Timeline</h2><noscript><p>The timeline needs JavaScript.</p></noscript>'
            '<div class="tools"><label>Show <select id="range"></select></label>'
            '<button type="button" id="in">Zoom in</button><button type="button" id="out">Zoom out</button>'
            '<button type="button" id="earlier">Earlier</button><button type="button" id="later">Later</button>'
            '<span id="shown"></span></div>'
            '<p class="legend">{}</p>'
            '<div id="lanes" tabindex="0" role="group" aria-label="Timeline: arrow keys move it, + and - zoom, Home '
            'shows all"></div><p id="detail" role="status"></p><p class="quiet">{}</p></section>').format("".join(
                '<span><b class="bar {}" aria-hidden="true"></b>{}</span>'.format(kind, meaning)
                for kind, meaning in LEGEND.items()), joined)


def _numbers(lanes: Iterable[Tuple[int, List[Bar]]], notes: Dict[str, int]) -> List[List[Union[int, str]]]:
    """Return for each lane its key, and for each bar its begin and length (ms), kind, count and number of its note."""
    found: List[List[Union[int, str]]] = []
    for key, bars in lanes:
        found.append([key])
        for bar in bars:
            found[-1] += [round(1000 * bar.begin), round(1000 * (bar.end - bar.begin)), bar.kind, bar.count,
                          notes.setdefault(bar.note, len(notes))]
    return found


def _data(run: Run, written: Dict[str, Written]) -> str:
    """Return what the script draws, as JSON that may stand in HTML: milliseconds from the begin of the run."""
    notes: Dict[str, int] = {}
    lanes = _numbers(itertools.chain([(0, run.steps)], run.lanes), notes)
    types = {node.type for node in run.nodes}
    visits = [[visit.number] + [round(1000 * (at - run.began)) for at in (
        visit.began, visit.arrived or visit.began, run.ends.get(visit.number, run.ended))] for visit in run.visits.values()]
    outcomes = [LETTER_OF.get(visit.outcome, "R") for visit in run.visits.values()]
    data = {"began": round(1000 * run.began), "offset": 1000 * localtime(run.began).tm_gmtoff,
            "length": round(1000 * (run.ended - run.began)), "visits": visits, "outcomes": outcomes,
            "lanes": lanes, "changes": _numbers(run.changes, notes),
            "notes": list(notes), "nodes": [[node.type, written[node.path].ports if node.path in written else []]
                                            for node in run.nodes],
            "types": {spec.id: spec.summary for spec in leaves.registry().all() if spec.id in types},
            "words": dict(LEGEND, **{"R": UNDER_WAY, DONE: ""}), "signs": SIGNS}
    return json.dumps(data, separators=(",", ":")).replace("<", "\\u003c")


# ------------------------------------------------------------------------------------------------------------------ tree


def _tree(run: Run, written: Dict[str, Written], doubt: str) -> str:
    """Return the tree as nested lists, each node with its results and its place; what never ran is grey."""
    nodes = run.nodes
    children: DefaultDict[int, List[int]] = collections.defaultdict(list)
    for number, node in enumerate(nodes, 1):
        children[node.parent].append(number)
    registry = leaves.registry()
    found: List[str] = []
    waiting: List[Tuple[Union[int, str], int]] = [(1, 1)]  # a node, or what closes one, and its level
    while waiting:
        item, level = waiting.pop()
        if isinstance(item, str):
            found.append(item)
            continue
        is_nested = bool(children[item]) and level < DEEPEST
        found.append('<li id="n{}"{}>{}'.format(item, ' class="bare"' if nodes[item - 1].parent and is_bare(
            registry.find(nodes[item - 1].type), nodes[item - 1].name) else "", _row(run, item, written)))
        found.append("<ul>" if is_nested else "</li>")
        closing = "</ul></li>" if is_nested else ""
        waiting += [(closing, level)] + [(child, level + 1) for child in reversed(children[item])]
    return ('<section id="tree"><h2>Tree</h2><div class="tools"><button type="button" id="all" aria-pressed="false">'
            "All rows</button></div>{}<ul>{}</ul></section>").format(
                "<p>{}</p>".format(_text(doubt)) if doubt else "", "".join(found))


def _row(run: Run, uid: int, written: Dict[str, Written]) -> str:
    node, count, finished = run.nodes[uid - 1], run.counts[uid - 1], run.finished[uid - 1]
    name, kind = label(SimpleNamespace(uid=uid, full_path=node.path, registration_id=node.type, name=node.name))
    failed = finished["F"] if finished[NO] else count["F"]  # a condition that does not hold has not failed
    results = [(letter, word, number) for letter, word, number in (
        ("S", "success", count["S"]), ("F", "failure", failed), (NO, "does not hold", count["F"] - failed)) if number > 0]
    place = written.get(node.path)
    return '<div class="row{}" title="{}"><span class="name">{}</span><span class="kind quiet">{}</span>{}{}</div>'.format(
        "" if count else " never", _text(node.path), _text(name), _text(kind),
        "".join('<span class="count">{} {}</span>'.format(_sign(letter, word), number) for letter, word, number in results)
        or '<span class="quiet">{}</span>'.format("halted" if count else "never"),
        "" if place is None else '<a class="quiet" href="#f{0}-{1}"><span class="file">{2}</span>:{1}</a>'.format(
            place.document, place.line, _text(os.path.basename(run.started.sources.documents[place.document].file))))


def _documents(run: Run) -> str:
    """Return the texts of the mission as the record has them, with an anchor for each line."""
    parts = []
    for number, (file, text) in enumerate(run.started.sources.documents):
        lines = "".join('<code id="f{}-{}">{}\n</code>'.format(number, place, _text(line))
                        for place, line in enumerate(re.split("\r\n?|\n", text), 1))
        parts.append("<h3>{}</h3><pre>{}</pre>".format(_text(file), lines))
    return '<section id="files"><h2>Mission file</h2>{}</section>'.format("".join(parts))


def _settings(run: Run) -> str:
    rows = "".join('<tr><th scope="row">{}</th><td>{}</td></tr>'.format(_text(key), _text(value))
                   for key, value in run.started.settings.items())
    return '<section id="settings"><h2>Configuration</h2><table>{}</table></section>'.format(rows)


# ---------------------------------------------------------------------------------------------------------- on a terminal


def story_lines(lines: Iterable[Line]) -> Iterator[str]:
    """Yield the sentences of a record, each with the time of day."""
    story = Story()
    for time, entry in lines:
        if isinstance(entry, EVENTS):
            for sentence in story.take(time, entry):
                yield "{} {}".format(clock(sentence.at), sentence.text)
