"""A recorded run as one self-contained web page: its story, a timeline, the tree with its outcomes,
the mission file."""
import collections
import itertools
import json
import os
import re
import sys
from functools import partial
from time import localtime, strftime
from types import SimpleNamespace
from typing import (
    Any, Counter, Dict, Iterable, Iterator, List, NamedTuple, Optional, Sequence, Tuple, Union)

from msgspec.structs import replace
from tornado.escape import xhtml_escape
from tornado.template import Template

from behavior_controller.run import events
from behavior_controller.run.history import with_tree
from behavior_controller.run.record.reader import stream_record
from behavior_controller.run.state import (
    BROKEN_OFF, COMPLETE, IN_PART, STOPPED, UNDER_WAY, NodeResult, Step, Visit, step_over)
from behavior_controller.folders import mission_name
from behavior_controller.run import story
from behavior_controller.run.moment import robot_line
from behavior_controller.viewer.timeline import Bar, Lanes
from behavior_controller.viewer.runs_text import seconds
from behavior_controller.viewer.report_moments import Moments, packed
from behavior_controller.viewer.report_frame import encodable, file_text, framed
from behavior_controller.viewer.values import joined
from behavior_controller.viewer.parts import Values
from behavior_controller.viewer.view import View, clock
from behavior_controller.text import clean

COMMAND = "replayMission"

SECTIONS = {"then": "Moment", "story": "Story", "timeline": "Timeline", "tree": "Tree",
            "files": "Mission file", "settings": "Configuration"}
ICONS = {"S": "✔", "F": "✘", "R": "▶", "-": "■", "n": "○", "r": "↻", "d": "○"}
UNTRUE, RETRIED, STEP_DONE, VALUE = "n", "r", "d", "v"
"""Kinds of bars in addition to the statuses: a condition that does not hold, a retry that failed, a
step, a value."""

_LETTERS = {COMPLETE: "S", IN_PART: "S", BROKEN_OFF: "F", STOPPED: "-", UNDER_WAY: "R"}
"""The kinds of bars for visits by result; for one that the visitor chose it is that of a step."""

LEGEND = {"S": "success", "F": "failure", "h": "halted", UNTRUE: "not yet true",
          RETRIED: "a retry failed", "w": "waiting for a visitor", "warning": "warning",
          "error": "error", VALUE: "value"}

MAX_LIST_DEPTH = 100
"""Levels of nested lists; browsers accept no more than about 170, so deeper nodes are shown beside
their parent."""


MOST_MISSING = 5
"""The most places at the head of the page where the record lacks something."""


PASSED, FAILED, CUT_OFF = "PASSED", "FAILED", "CUT OFF"
VERDICT_ICONS = {PASSED: "✔", FAILED: "✘", CUT_OFF: "■"}


class ShownVerdict(NamedTuple):
    """The verdict on a test: a word of ``VERDICT_ICONS``, why, and further lines."""

    word: str
    sentences: Sequence[str]
    details: Sequence[str]


class FilePlace(NamedTuple):
    """Where a mission file has a node: the number of a document of the record, its name, and the
    line in it."""

    document: int
    file: str
    line: int


class Drawn:
    """What the report shows of one mission of a record, processed line by line."""

    def __init__(self, began: float, started: events.RunStarted, tree: events.TreeShown):
        self.began = self.ended = began
        self.started, self.tree, self.nodes = started, tree, tree.nodes
        self.visits: Dict[int, Visit] = {}
        # by visit; 0 is what was before the first
        self.sentences: Dict[int, List[story.Sentence]] = collections.defaultdict(list)
        self.counts: List[Counter[str]] = [Counter() for _ in tree.nodes]  # results of each node
        # kinds of results of each mission leaf
        self.finished: List[Counter[str]] = [Counter() for _ in tree.nodes]
        self.steps: List[Bar] = []
        self.lanes = Lanes()  # results of mission leaves, from their events
        self.changes = Lanes()  # results of other nodes, from their changes of status
        self.moments = Moments()
        self._values: List[Tuple[float, Values]] = []  # of each visit that is over
        self._values_began = began
        self.missing: List[str] = []  # of the record
        self.view = View()
        self.view.take(began, tree)
        self._uids = {node.path: uid for uid, node in enumerate(tree.nodes, 1)}

    def take(self, time: float, event: events.Event) -> None:
        """Process the next line."""
        self.ended = max(self.ended, time)
        before = self.view.state
        if isinstance(event, events.PassStarted):
            self._end_values(time)
        for sentence in self.view.take(time, event):
            self.sentences[sentence.visit].append(sentence)
        state = self.view.state
        if state.visit is not None:
            self.visits[state.visit.number] = state.visit
        step = step_over(before, state)
        if step is not None:
            self._end_step(step)
        for ended in state.concluded(NodeResult):
            self.counts[ended.uid - 1][ended.letter] += 1
            if ended.uid not in self.lanes:
                self.changes.add(ended.uid, self._bar(ended.began, ended.ended, ended.letter))
        self._draw(time, event)
        self.moments.take(self.view, self.ended)

    def _end_step(self, step: Step) -> None:
        bar = self._bar(step.began, step.ended or step.began, STEP_DONE, story.step_words(step))
        self.steps.append(bar)
        # a condition tells that it does not hold once
        self.lanes.end_wait(step.uid, UNTRUE, bar.end)

    def _draw(self, time: float, event: events.Event) -> None:
        if isinstance(event, events.Lost):
            self.missing.append(str(event))
        elif isinstance(event, events.Retried):
            bar = self._bar(time, time, RETRIED, story.cause(event.failure))
            self.lanes.add(self._uids.get(event.path, 0), bar)
        elif isinstance(event, events.LeafFinished) and 0 < event.uid <= len(self.nodes):
            is_no = event.failure is not None and event.failure.is_false_condition
            kind: str = events.LETTERS.get(event.status, "-")
            if is_no:
                kind = UNTRUE
            self.finished[event.uid - 1][kind] += 1
            bar = self._bar(time - max(0.0, event.seconds), time, kind, story.cause(event.failure))
            self.lanes.add(event.uid, bar, is_asked_again=is_no)

    def _end_values(self, time: float) -> None:
        self._values.append((self._values_began, self.view.values()))
        self._values_began = time

    def values(self) -> Dict[str, List[Tuple[int, str]]]:
        """Return when each value changed (ms), and to which text."""
        return {name: [(round(1000 * self._since(at)), text) for at, text in changes]
                for name, changes in joined(self._values).items()}

    def _bar(self, began: float, ended: float, kind: str, note: str = "") -> Bar:
        return Bar(self._since(began), self._since(ended), kind, note)

    def _since(self, time: float) -> float:
        return max(0.0, time - self.began)

    def finish(self) -> "Drawn":
        """Draw what was under way when the record ended."""
        visit = self.view.state.visit
        if visit is not None and visit.ended is None:
            stops = tuple(replace(stop, seconds=self.ended - stop.began)
                          if stop.state == UNDER_WAY else stop for stop in visit.stops)
            self.visits[visit.number] = replace(visit.until(self.ended), stops=stops)
        if self.view.state.step is not None:
            self._end_step(replace(self.view.state.step, ended=self.ended))
        self._end_values(self.ended)
        return self


def to_html(lines: Iterable[events.Line], verdict: Optional[ShownVerdict] = None,
            generator: str = COMMAND) -> str:
    """Return the page of a record (its last mission, if the mission was changed while it ran).

    ``verdict`` stands before the story, ``generator`` is the command that makes the page.
    """
    earlier, run = _last(lines)
    visits = [(visit, _grouped(run.sentences[number]))
              for number, visit in {0: None, **run.visits}.items()]
    documents = [(encodable(file), re.split("\r\n?|\n", encodable(text)))
                 for file, text in run.started.sources.documents]
    settings = [tuple(map(encodable, setting)) for setting in run.started.settings.items()]
    live = file_text("page_files", "index.html")
    content = Template(file_text("report_files", "report.html")).generate(
        clock=clock, seconds=seconds, sign=_sign, story=story, letter_of=_letter,
        result_of=_result, verdict=verdict, verdict_icons=VERDICT_ICONS,
        quoting=partial(_quoting, language=run.view.language),
        choices=_choices(run), legend=LEGEND, lanes=run.lanes, visits=visits,
        rows=_rows(run), settings=settings, documents=documents,
        moment=_between(live, '<div id="card">', "</section>"),
        robot_then=_between(live, '<div id="robot"', "</div>") + "</div>")
    sections = SECTIONS
    if verdict:
        sections = {"verdict": "Verdict", **SECTIONS}
    return framed(generator, "Mission " + mission_name(run.started.mission),
                  list(_heads(run, earlier)), sections, content.decode(), _script(),
                  _data(run))


def _quoting(text: str, language: str) -> str:
    """Return a text as HTML; what is quoted in it is in a language if a code is given."""
    html = xhtml_escape(text)
    if not language:
        return html
    return re.sub("“[^”]*”", lambda quoted: f'<span lang="{language}">{quoted[0]}</span>', html)


def _last(lines: Iterable[events.Line]) -> Tuple[List[events.RunStarted], Drawn]:
    """Return the missions before the last one, and the last one's run."""
    runs: List[events.RunStarted] = []
    run: Optional[Drawn] = None
    for line, tree in with_tree(lines):
        event = line.event
        if isinstance(event, events.RunStarted):
            run = Drawn(line.time, event, tree)
            runs.append(event)
        if run is not None:
            run.take(line.time, event)
    assert run is not None  # ``decode`` has seen to it
    return runs[:-1], run.finish()


def _script() -> str:
    """Return the script; what shows moments has names of its own."""
    common, report = file_text("page_files", "common.js"), file_text("report_files", "report.js")
    moments = file_text("page_files", "moment.js") + file_text("report_files", "moments.js")
    return f"{common}{report}{{\n{moments}}}\n"


def _between(text: str, begin: str, end: str) -> str:
    """Return a part of a page that another page has too, with its begin."""
    place = text.index(begin)
    return text[place:text.index(end, place)]


# ---------------------------------------------------------------------------------- parts of a page


def _sign(letter: str, word: str) -> str:
    return '<b class="{}" title="{}">{}</b>'.format(letter, word, ICONS[letter])


def _result(visit: Visit) -> str:
    if visit.ended is None:
        return UNDER_WAY
    return visit.result


def _letter(visit: Visit) -> str:
    return _LETTERS.get(_result(visit), STEP_DONE)


def _heads(run: Drawn, earlier: List[events.RunStarted]) -> Iterator[str]:
    """Yield when the mission ran, how it ended, and what the report does not have."""
    state, day = run.view.state, strftime("%Y-%m-%d", localtime(run.began))
    ending = "goes on"
    if state.finished is not None:
        ending = "ended: " + story.run_end(state)
    yield (f"{day} {clock(run.began)} to {clock(run.ended)}, {seconds(run.ended - run.began)}; "
           f"{story.counted(state)}; {ending}")
    yield "Robot at the end: " + robot_line(state).text
    if earlier:
        missions = ", ".join(mission.mission for mission in earlier)
        yield f"Before it the record has {missions}, which this report leaves out."
    if run.missing:
        yield "The record lacks some of the run: " + "; ".join(run.missing[:MOST_MISSING])


# -------------------------------------------------------------------------------------------- story


def _choices(run: Drawn) -> List[Tuple[str, str, str, Counter[str]]]:
    """Return the lists by which sentences are found: title, id, first choice, and the values."""
    sentences = list(itertools.chain.from_iterable(run.sentences.values()))
    return [("About", "kind", "everything", Counter(said.kind for said in sentences)),
            ("Severity", "severity", "all", Counter(said.severity for said in sentences)),
            ("Cause", "cause", "any", Counter(said.cause for said in sentences if said.cause))]


def _grouped(sentences: List[story.Sentence]) -> List[Tuple[int, story.Sentence]]:
    """Return sentences; one that is repeated within a second comes once, with its count."""
    alike = itertools.groupby(sentences, lambda said: replace(said, at=int(said.at)))
    return [(len(group), group[0]) for group in (list(group) for _, group in alike)]


# ----------------------------------------------------------------------------------------- timeline


def _lanes(lanes: Iterable[Tuple[int, List[Bar]]]) -> List[List[Any]]:
    """Return for each lane its key, and its bars: begin and length (ms), kind, count and note."""
    return [[key, *([round(1000 * bar.begin), round(1000 * (bar.end - bar.begin)), bar.kind,
                     bar.count, bar.note] for bar in bars)] for key, bars in lanes]


def _data(run: Drawn) -> str:
    """Return what the script draws, as JSON that may stand in HTML: milliseconds from the begin of
    the run."""
    visits = []
    for visit in run.visits.values():
        ended = run.ended if visit.ended is None else visit.ended
        times = (visit.began, visit.arrived or visit.began, ended)
        visits.append([visit.number, *(round(1000 * (at - run.began)) for at in times),
                       _letter(visit)])
    data = {
        "began": round(1000 * run.began), "offset": 1000 * localtime(run.began).tm_gmtoff,
        "length": round(1000 * (run.ended - run.began)), "visits": visits,
        "lanes": _lanes([(0, run.steps), *run.lanes]), "changes": _lanes(run.changes),
        "nodes": [[node.type, [(port.name, port.text, port.given) for port in node.ports]]
                  for node in run.nodes],
        "types": run.tree.summaries, "language": run.view.language,
        "moments": run.moments.packed(), "values": packed(run.values()),
        "words": dict(LEGEND, **{"R": UNDER_WAY, STEP_DONE: "", VALUE: ""}),
        "signs": ICONS}
    return json.dumps(data, separators=(",", ":")).replace("<", "\\u003c")


# --------------------------------------------------------------------------------------------- tree


def _rows(run: Drawn) -> Iterator[Union[SimpleNamespace, str]]:
    """Yield the nodes of the tree in order, and between them the tags that nest their lists."""
    numbers = {clean(source.file): number
               for number, source in enumerate(run.started.sources.documents)}
    levels = [0]  # of each node
    before = 0  # the level of the row before
    for uid, node in enumerate(run.nodes, 1):
        level = min(levels[node.parent] + 1, before + 1, MAX_LIST_DEPTH)
        if uid > 1:
            yield "<ul>" if level > before else "</li>" + "</ul></li>" * (before - level)
        yield _row(run, uid, _place(node, numbers))
        levels.append(level)
        before = level
    yield "</li>" + "</ul></li>" * (before - 1)


def _row(run: Drawn, uid: int, place: Optional[FilePlace]) -> SimpleNamespace:
    """Return what the template shows of a node: its results, and its place in the file."""
    node, count, finished = run.nodes[uid - 1], run.counts[uid - 1], run.finished[uid - 1]
    # a condition that does not hold has not failed
    failed = finished["F"] if finished[UNTRUE] else count["F"]
    results = (("S", "success", count["S"]), ("F", "failure", failed),
               (UNTRUE, LEGEND[UNTRUE], count["F"] - failed))
    return SimpleNamespace(
        uid=uid, path=encodable(node.path), name=encodable(node.label),
        kind=encodable(node.kind), is_bare=node.is_bare,
        has_run=bool(count) or uid in run.view.state.running, place=place,
        results=[result for result in results if result[2] > 0])


def _place(node: events.TreeNode, numbers: Dict[str, int]) -> Optional[FilePlace]:
    """Return where the file has a node; None if its document is not among those ``numbers``."""
    file, line = (node.place.rsplit(":", 2) + ["", ""])[:2]
    if file not in numbers or not line.isdecimal():
        return None
    return FilePlace(numbers[file], encodable(os.path.basename(file)), int(line))


# ------------------------------------------------------------------------------------ on a terminal


def story_lines(lines: Iterable[events.Line]) -> Iterator[str]:
    """Yield the sentences of a record, each with the time of day."""
    run = story.Story()
    for line in lines:
        for sentence in run.take(line.time, line.event):
            yield f"{clock(sentence.at)} {sentence.text}"


if __name__ == "__main__":  # for the list of runs: a report of a long run takes time and memory
    sys.stdout.buffer.write(to_html(stream_record(sys.argv[1])).encode("utf-8", "replace"))
