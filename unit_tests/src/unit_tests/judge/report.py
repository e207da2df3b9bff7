"""The report of a test as text: the verdict and its cause first, then failures and counts, and the
verdict at the end."""
import datetime
import math
import os
import sys
from collections import Counter
from typing import Iterator, List, NamedTuple, Sequence, Tuple

from behavior_controller.config import settings
from behavior_controller.config.config_file import to_text, values_of
from behavior_controller.execution.events import (
    LeafFinished, Line, Noticed, PassFinished, Recovered)
from behavior_controller.execution.state import LEFT_OUT, LeafFailure
from behavior_controller.monitoring.record.html_report import to_html
from behavior_controller.monitoring.story import Story, why
from behavior_controller.text import clean, count

from unit_tests.judge.facts import Facts, of
from unit_tests.judge.failures import IN_SAFE_STATE, FailureRow, Rows, table
from unit_tests.judge.reference import HANDLERS
from unit_tests.judge.verdict import Case, Verdict, judge, reached
from unit_tests.judge.witness import CAUSE_OF
from unit_tests.robot.behaviour import servers
from unit_tests.robot.options import Configuration, KEYS

ALWAYS_SHOWN = ("visitorBehaviour", "failureRate", "arrivalRate", "randomSeed")
"""Keys of the test that the title always shows."""

SHOWN_IF_SET = ("missionRuns", "faultKinds", "plannedFaults", "recogniseBy", "absentServices")
"""Keys of the test that it shows if they differ from the default. The others do not change the
test."""

NOT_SHOWN = {"scenarioSpecification", "verboseMode", "missionRuns", "startupTimeout", "groot2Port",
             "groot2Address", "monitorPort", "monitorAddress", "recordDirectory"}
"""Keys of the controller that the title has already, or that do not change the test. It shows the
others if set."""


def title(facts: Facts, test: Configuration, when: datetime.datetime) -> str:
    """Return the test and its time: with the package's files as delivered, enough to repeat it
    (contract, section 10)."""
    begun = facts.run.state.started
    mission = os.path.basename(begun.mission) if begun is not None else "that did not start"
    chosen = values_of(test)
    shown = [(name, chosen[name]) for name in ALWAYS_SHOWN]
    shown += [(key.name, chosen[key.name]) for key in KEYS
             if key.name in SHOWN_IF_SET and chosen[key.name] != key.default]
    given = begun.settings if begun is not None else {}
    shown += [(name, given[name]) for name, usual in settings.defaults().values.items()
             if name not in NOT_SHOWN and given.get(name, usual) != usual]
    shown += [("use_real_" + node, True) for node in sorted(facts.real)]
    chosen_keys = "; ".join(f"{name} {to_text(value)}" for name, value in shown)
    return clean("{}: mission {}; {}".format(when.isoformat(timespec="seconds"), mission,
                                             chosen_keys))


def failure_lines(case: Case) -> List[str]:
    """Return one line for each failure: time, node, path, topic or service, cause, message; tabs
    between them."""
    failures = [(failed.at, failed.node, failed.path, failed.failure.resource or
                 "-", failed.failure.cause.value, " ".join(failed.failure.message.split()))
                for failed in _failures(case.facts)]
    for _, query, line in case.witness.pairs:
        if query is not None and line is not None and query.is_for_safety and line.fault:
            failures.append((line.time, query.node or "-", query.path or "-", line.resource,
                             CAUSE_OF[line.fault].value, IN_SAFE_STATE))
    return ["\t".join([_clock(failure[0])] + [clean(cell) for cell in failure[1:]])
            for failure in sorted(failures)]


def _failures(facts: Facts) -> Iterator[LeafFailure]:
    """Yield the failures on record, and those that a HandleFallBack handed on."""
    yield from facts.run.failures
    for time, event in of(facts.run.lines, LeafFinished):
        if event.failure is not None and event.node in HANDLERS:
            yield LeafFailure(time, 0, event.uid, event.node, event.path, event.failure)


def summary_lines(facts: Facts) -> List[str]:
    """Return the counts: of each mission node that ran, each simulated node, how recoveries ended,
    and what was reached."""
    ran, failed = Counter(), Counter()  # type: Counter, Counter
    for _, event in of(facts.run.lines, LeafFinished):
        ran[event.node] += 1
        failed[event.node] += event.status == "FAILURE"
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
    return lines + coverage_lines(facts)


def decision_lines(facts: Facts) -> List[str]:
    """Return a line for each decision of the recovery."""
    return [f"  {event.path}: {event.failure.cause.value}; policy: {event.policy}; "
            f"{count(event.attempts, 'attempt', 'attempts')}: {event.outcome}"
            for _, event in of(facts.run.lines, Recovered)]


def coverage_lines(facts: Facts) -> List[str]:
    """Return the coverage of the mission: leaves, and branches of nodes with several children."""
    begun = facts.run.state.started
    if begun is None:
        return []
    ran, leaves = reached(facts), {path for path, _ in begun.leaves}
    lines = [f"coverage: {len(ran & leaves)} of {len(leaves)} leaves of the mission ran"]
    if facts.rehearsal is not None:
        wanted, ways = facts.rehearsal.reached, facts.rehearsal.branches
        taken = sum(bool(paths & ran) for paths in ways)
        both = f"{len(ran & wanted)} of {len(wanted)} that this visitor should bring about"
        lines += ["          " + both, f"          {taken} of {len(ways)} branches"]
    return lines


class Report(NamedTuple):
    """The content of the report of a test, in reading order."""

    title: str
    verdict: Verdict
    visitors: Sequence[str]  # the warnings; then how each pass ended and why
    rows: Sequence[FailureRow]
    began: float  # unix seconds
    failures: Sequence[str]
    decisions: Sequence[str]  # of the recovery
    counts: Sequence[str]

    def text(self) -> str:
        """Return the whole report, for the file."""
        lines = self._top(table(self.rows, self.began, WIDEST))
        lines += ["# time\tnode\tpath\ttopic or service\tcause\tmessage"] + list(self.failures)
        lines += [""] + (["# recoveries"] + list(self.decisions) + [""] if self.decisions else [])
        return "\n".join(lines + list(self.counts) + ["", str(self.verdict)]) + "\n"

    def shown(self, width: int, files: Sequence[str] = (), page: str = "") -> str:
        """Return the report for a terminal of that width: the rows replace the failures and the
        decisions about them.

        ``files`` are lines that name the files with the whole report; ``page`` is the path of the
        page, which the last line has.
        """
        shown = table(self.rows[:MOST_SHOWN], self.began, width)
        if len(self.rows) > MOST_SHOWN:
            shown.append(f"and {len(self.rows) - MOST_SHOWN} more in the report")
        verdict = str(self.verdict).split("\n")
        if len(verdict) > MOST_OBJECTIONS:
            more = len(verdict) - MOST_OBJECTIONS
            verdict[MOST_OBJECTIONS:] = [f"        and {more} more in the report"]
        last = ["the report as a page: file://" + page] if page else []
        return "\n".join(self._top(shown) + [*self.counts, "", *files, "", *verdict, *last])

    def _top(self, shown: List[str]) -> List[str]:
        objections = self.verdict.objections[1:]
        number = count(len(objections), "objection", "objections")
        more = f" (and {number}: see the end)" if objections else ""
        first = str(self.verdict).split("\n")[0] + more
        lines = ["# " + self.title, first, *self.visitors, ""]
        return lines + shown + [""] if self.rows else lines


def to_page(report: Report, facts: Facts) -> str:
    """Return the report as one HTML file: the verdict and the faults, then the record's own report
    with its story, in which the point of difference is marked, timeline and tree; empty if the
    mission did not start."""
    if facts.run.state.started is None:
        return ""
    shown = [report.title, "", str(report.verdict), "", *report.visitors, ""]
    marks = [Line(time, Noticed("error", "Here the run differs. " + text))
             for time, text in report.verdict.differences]
    lines = sorted([*facts.run.lines, *marks], key=lambda line: line.time)
    return to_html(lines, "\n".join(shown + table(report.rows, report.began, WIDEST)))


WIDEST = sys.maxsize
"""Columns of a file."""

MOST_SHOWN, MOST_OBJECTIONS = 40, 10
"""Rows and objections that a terminal shows."""


def write(facts: Facts, title: str, warnings: Sequence[str] = ()) -> Report:
    """Return the report; ``warnings`` were printed before the start."""
    case = Case(facts)
    began = facts.run.lines[0].time if facts.run.lines else 0.0
    rows = Rows(facts, case.witness).all()
    visitors = list(warnings) + [clean(line) for line in _visitors(facts, rows)]
    return Report(title, judge(case), visitors, rows, began, failure_lines(case),
                  [clean(line) for line in decision_lines(facts)],
                  [clean(line) for line in summary_lines(facts)])


def _visitors(facts: Facts, rows: Sequence[FailureRow]) -> Iterator[str]:
    """Yield a line for each pass: how it ended and why, and what the faults cost."""
    sentences = dict(_sentences(facts))
    false = Counter(failed.visit for failed in facts.run.failures if failed.is_false_condition)
    last = facts.run.state.visit
    under_way = [last] if last is not None and not last.outcome else []
    for visit in facts.run.visits + under_way:
        mine = [row for row in rows if row.visitor == visit.number]
        sentence = sentences.get(visit.number, f"pass {visit.number}: did not end")
        reasons = dict.fromkeys(
            event.reason for time, event in of(facts.run.lines, Recovered)
            if visit.began <= time <= (visit.ended or math.inf) and event.reason not in sentence)
        faults = count(sum(row.is_injected for row in mine), "fault", "faults")
        lost = f"{faults}, {sum(row.lost for row in mine):.1f} s lost"
        conditions = count(false[visit.number], "condition", "conditions") + " false for a while"
        yield "; ".join([sentence] + list(reasons) + [lost, conditions])


def _sentences(facts: Facts) -> Iterator[Tuple[int, str]]:
    """Yield for each pass that ended its sentence, and the stops that the visitor did not see to
    the end."""
    story = Story()
    for line in facts.run.lines:
        added, event, visit = story.take(line.time, line.event), line.event, story.state.visit
        if added and isinstance(event, PassFinished) and visit is not None:
            left_out = [f"{stop.name} {stop.state}: {why(stop.why)}" for stop in visit.stops
                        if stop.state == LEFT_OUT]
            yield event.number, "; ".join([added[-1].text] + left_out)


def _clock(seconds: float) -> str:
    return datetime.datetime.fromtimestamp(seconds).isoformat(timespec="milliseconds")
