"""The report of a test as text: the verdict and its cause first, then failures and counts, and the
verdict at the end."""
import datetime
import math
import os
from collections import Counter
from typing import Any, Dict, Iterator, List, Sequence, Set, Tuple
from xml.etree import ElementTree

from behavior_controller.config import settings
from behavior_controller.config.config_file import to_text, values_of
from behavior_controller.run.events import (
    KILLED, LeafFinished, Line, Noticed, PassFinished, Recovered)
from behavior_controller.run.state import LEFT_OUT, State
from behavior_controller.viewer.report import ShownVerdict, to_html
from behavior_controller.run.story import sentences, why
from behavior_controller.robot.gateway import Failure
from behavior_controller.text import clean, count
from behavior_controller.simulation.behaviour import servers
from behavior_controller.simulation.configuration import Configuration, KEYS
from behavior_controller.simulation.journal import unmet

from unit_tests.folders import COMMAND
from unit_tests.judge.facts import Facts, of
from unit_tests.judge.failures import IN_SAFE_STATE, FailureRow, failure_rows, table
from unit_tests.judge.reference import HANDLERS
from unit_tests.judge.verdict import ENDS, Verdict
from unit_tests.judge.journal_check import CAUSE_OF

ALWAYS_SHOWN = ("visitorBehaviour", "failureRate", "arrivalRate", "randomSeed")
"""Keys of the test that the title always shows."""

SHOWN_IF_SET = [key for key in KEYS if key.name not in (*ALWAYS_SHOWN, "verboseMode")]
"""Keys of the test that it shows if they differ from the default. verboseMode does not change the
test."""

NOT_SHOWN = {"scenarioSpecification", "verboseMode", "missionRuns", "startupTimeout", "groot2Port",
             "groot2Address", "monitorPort", "monitorAddress", "recordDirectory"}
"""Keys of the controller that the title has already, or that do not change the test. It shows the
others if set."""


def title(facts: Facts, test: Configuration, when: datetime.datetime) -> str:
    """Return the test and its time: with the package's files as delivered, enough to repeat it
    (contract, section 10)."""
    begun, chosen, mission = facts.run.state.started, values_of(test), "that did not start"
    given: Dict[str, Any] = {}
    if begun is not None:
        mission, given = os.path.basename(begun.mission), begun.settings
    shown = [(name, chosen[name]) for name in ALWAYS_SHOWN]
    shown += [(key.name, chosen[key.name]) for key in SHOWN_IF_SET
              if chosen[key.name] != key.default]
    shown += [(name, given[name]) for name, usual in settings.defaults().values.items()
             if name not in NOT_SHOWN and given.get(name, usual) != usual]
    shown += [("use_real_" + node, True) for node in sorted(facts.real)]
    chosen_keys = "; ".join(f"{name} {to_text(value)}" for name, value in shown)
    return clean("{}: mission {}; {}".format(when.isoformat(timespec="seconds"), mission,
                                             chosen_keys))


def failure_lines(verdict: Verdict) -> List[str]:
    """Return one line for each failure: time, node, path, topic or service, cause, message; tabs
    between them."""
    failures = sorted(_failures(verdict), key=lambda failed: failed[0])
    return ["\t".join(map(clean, (
        datetime.datetime.fromtimestamp(at).isoformat(timespec="milliseconds"), node or "-",
        path or "-", failure.resource or "-", failure.cause.value,
        " ".join(failure.message.split())))) for at, node, path, failure in failures]


def _failures(verdict: Verdict) -> Iterator[Tuple[float, str, str, Failure]]:
    """Yield time, node, path and failure: of the failures on record, of those that a HandleFallBack
    handed on, and of the faults on the way to the safe state."""
    for failed in verdict.facts.run.failures:
        yield failed.at, failed.node, failed.path, failed.failure
    for time, event in of(verdict.facts.run.lines, LeafFinished):
        if event.failure is not None and event.node in HANDLERS:
            yield time, event.node, event.path, event.failure
    for _, query, line in verdict.journal_check.pairs:
        if query is not None and line is not None and query.is_for_safety and line.fault:
            yield line.time, query.node, query.path, Failure(
                CAUSE_OF[line.fault], IN_SAFE_STATE, line.resource)


def summary_lines(facts: Facts) -> List[str]:
    """Return the counts: of each mission node that ran, each simulated node, how recoveries ended,
    and what was reached."""
    ended_leaves = [event for _, event in of(facts.run.lines, LeafFinished)]
    ran = Counter(event.node for event in ended_leaves)
    failed = Counter(event.node for event in ended_leaves if event.status == "FAILURE")
    lines = ["{:<28} {:>6} {:>8}".format("mission node", "ran", "failed")]
    lines += [f"{node:<28} {ran[node]:>6} {failed[node]:>8}" for node in sorted(ran)]
    lines += ["", "{:<28} {:>6} {:>8}".format("simulated node", "calls", "injected")]
    for node in servers(facts.world.settings.interface):
        calls = [line for line in facts.journal if line.node == node and line.call]
        failures = sum(line.fault is not None for line in calls)
        lines.append(f"{node:<28} {len(calls):>6} {failures:>8}")
    ended = Counter(event.outcome for _, event in of(facts.run.lines, Recovered))
    outcomes = [f"{number} {outcome}" for outcome, number in sorted(ended.items())]
    lines += ["", "recoveries: " + "; ".join([str(sum(ended.values())), *outcomes])]
    return lines + list(coverage_lines(facts, {event.path for event in ended_leaves}))


def decision_lines(facts: Facts) -> List[str]:
    """Return a line for each decision of the recovery."""
    return [f"  {event.path}: {event.failure.cause.value}; policy: {event.policy}; "
            f"{count(event.attempts, 'attempt')}: {event.outcome}"
            for _, event in of(facts.run.lines, Recovered)]


def coverage_lines(facts: Facts, ran: Set[str]) -> Iterator[str]:
    """Yield the coverage of the mission: leaves, of which those with these paths ``ran``, and
    branches of nodes with several children."""
    begun = facts.run.state.started
    if begun is None:
        return
    leaves = {path for path, _ in begun.leaves}
    yield f"coverage: {len(ran & leaves)} of {len(leaves)} leaves of the mission ran"
    if facts.expected is not None and facts.mission is not None:
        both = f"{len(ran & facts.expected)} of {len(facts.expected)}"
        yield f"          {both} that this visitor should bring about"
        branches = [{node.full_path for node in child.iterate()} & leaves
                    for node in facts.mission.tree.nodes if len(node.children) > 1
                    for child in node.children]
        taken = sum(bool(paths & ran) for paths in branches)
        yield f"          {taken} of {len(list(filter(None, branches)))} branches"


MOST_SHOWN, MOST_OBJECTIONS = 40, 10
"""Rows and objections that a terminal shows."""


class Report:
    """The report of a test, in reading order."""

    def __init__(self, facts: Facts, title: str, warnings: Sequence[str] = ()):
        """``warnings`` were printed before the start."""
        self.verdict, self._title, self._run = Verdict(facts), title, facts.run
        self.rows = failure_rows(self.verdict)
        in_vain = [f"planned in vain: {fault}, since that call was not made"
                   for fault in unmet(facts.test.planned_faults, facts.journal)]
        self.visitors = [*warnings, *in_vain, *map(clean, _visitors(facts, self.rows))]
        self._began = next((line.time for line in facts.run.lines), 0.0)
        self._counts = [clean(line) for line in summary_lines(facts)]

    def text(self) -> str:
        """Return the whole report, for the file."""
        decisions = [clean(line) for line in decision_lines(self.verdict.facts)]
        lines = self._top(table(self.rows, self._began))
        lines += ["# time\tnode\tpath\ttopic or service\tcause\tmessage"]
        lines += failure_lines(self.verdict) + [""]
        if decisions:
            lines += ["# recoveries", *decisions, ""]
        return "\n".join([*lines, *self._counts, "", str(self.verdict)]) + "\n"

    def shown(self, width: int, files: Sequence[str] = (), page: str = "") -> str:
        """Return the report for a terminal of that width: the rows replace the failures and the
        decisions about them.

        ``files`` are lines that name the files with the whole report; ``page`` is the path of the
        page, which the last line has.
        """
        shown = table(self.rows[:MOST_SHOWN], self._began, width)
        if len(self.rows) > MOST_SHOWN:
            shown.append(f"and {len(self.rows) - MOST_SHOWN} more in the report")
        verdict = str(self.verdict).split("\n")
        if len(verdict) > MOST_OBJECTIONS:
            more = len(verdict) - MOST_OBJECTIONS
            verdict[MOST_OBJECTIONS:] = [f"        and {more} more in the report"]
        if page:
            verdict.append("the report as a page: file://" + page)
        return "\n".join(self._top(shown) + [*self._counts, "", *files, "", *verdict])

    def _top(self, shown: List[str]) -> List[str]:
        objections, first = self.verdict.objections[1:], str(self.verdict).split("\n")[0]
        if objections:
            first += f" (and {count(len(objections), 'objection')}: see the end)"
        lines = ["# " + self._title, first, *self.visitors, ""]
        return lines + shown + [""] if self.rows else lines

    def page(self) -> str:
        """Return the report as one HTML file: the verdict and the faults, then the record's own
        report with its story, in which the point of difference is marked, timeline and tree; empty
        if the mission did not start."""
        if self._run.state.started is None:
            return ""
        shown = [self._title, "", *self.visitors, "", *table(self.rows, self._began)]
        lines, facts, execution = list(self._run.lines), self.verdict.facts, self.verdict.execution
        if execution.difference:
            what = "Here the run differs. " + clean(execution.difference)
            lines.append(Line(execution.differs_at, Noticed("error", what)))
        if facts.exit_code is not None and self._run.state.finished is None:
            lines.append(Line(self._run.state.at, KILLED))
        judged = ShownVerdict(self.verdict.word, self.verdict.sentences, shown)
        return to_html(sorted(lines, key=lambda line: line.time), judged, COMMAND)


def _visitors(facts: Facts, rows: Sequence[FailureRow]) -> Iterator[str]:
    """Yield a line for each pass: how it ended and why, the stops that the visitor did not see to
    the end, and what the faults cost."""
    false = Counter(failed.visit for failed in facts.run.failures if failed.is_false_condition)
    last = facts.run.state.visit
    under_way = [last] if last is not None and not last.outcome else []
    for visit in facts.run.visits + under_way:
        parts = [f"pass {visit.number}: did not end"]
        if visit.outcome:
            ended = PassFinished(visit.number, visit.outcome, visit.seconds)
            parts = [sentence.text for sentence in sentences(
                State(), ended, State(visits=(visit,)))]
            parts += [f"{stop.name} {stop.state}: {why(stop.why)}" for stop in visit.stops
                      if stop.state == LEFT_OUT]
        said = "; ".join(parts)
        parts += dict.fromkeys(
            event.reason for time, event in of(facts.run.lines, Recovered)
            if visit.began <= time <= (visit.ended or math.inf) and event.reason not in said)
        mine = [row for row in rows if row.visitor == visit.number]
        faults = count(sum(row.is_injected for row in mine), "fault")
        parts.append(f"{faults}, {sum(row.lost for row in mine):.1f} s lost")
        parts.append(count(false[visit.number], "condition") + " false for a while")
        yield "; ".join(parts)


SUITE = "behaviorControllerTest"


def to_junit(verdict: Verdict, seconds: float, title: str) -> str:
    """Return the verdict as JUnit XML, which catkin and build servers collect: a case for each
    question. ``seconds`` is how long the test took, ``title`` what ran."""
    failed = sum(bool(objections) for _, objections in verdict.answers)
    suite = ElementTree.Element("testsuite", name=SUITE, tests=str(len(verdict.answers)),
                                failures=str(failed), errors="0", time=f"{seconds:.3f}",
                                skipped=str(int(verdict.is_cut_off)))
    for question, objections in verdict.answers:
        case = ElementTree.SubElement(suite, "testcase", classname=SUITE, name=question, time="0")
        if objections:
            ElementTree.SubElement(case, "failure",
                                   message=objections[0]).text = "\n".join(objections)
        elif verdict.is_cut_off and question == ENDS:
            ElementTree.SubElement(case, "skipped", message=verdict.facts.cut_off)
    ElementTree.SubElement(suite, "system-out").text = f"{title}\n{verdict}"
    return ElementTree.tostring(suite, encoding="unicode")
