"""The report of a test as text: the verdict and its cause first, then failures and counts, and the verdict at the end."""
import datetime
import math
import os
import sys
from collections import Counter
from typing import Iterator, List, NamedTuple, Sequence, Tuple

from behavior_controller import settings
from behavior_controller.gateway import Cause
from behavior_controller.keys import to_text, values_of
from behavior_controller.story import LEFT_OUT
from behavior_controller.text import clean

from unit_tests.configuration import KEYS, Configuration
from unit_tests.facts import Event, Facts, Pass, count, of, passes
from unit_tests.fault_rows import Row, Told, reason_of, story_of, table
from unit_tests.matching import CAUSE_OF, Matching
from unit_tests.robot import servers
from unit_tests.verdict import Verdict, judge, reached


ALWAYS_TOLD = ("visitorBehaviour", "failureRate", "arrivalRate", "randomSeed")
"""Keys of the test that the title always shows."""

TOLD_IF_SET = ("missionRuns", "faultKinds", "plannedFaults", "recogniseBy", "absentServices")
"""Keys of the test that it shows if they differ from the default. The others do not change the test."""

NOT_TOLD = {"scenarioSpecification", "verboseMode", "missionRuns", "startupTimeout", "groot2Port", "groot2Address",
            "monitorPort", "monitorAddress", "recordDirectory"}
"""Keys of the controller that the title has already, or that do not change the test. It shows the others if set."""


def title(facts: Facts, test: Configuration, when: datetime.datetime) -> str:
    """Return the test and its time: with the package's files as delivered, enough to repeat it (contract, section 10)."""
    started = of(facts.events, "RunStarted")
    mission = os.path.basename(started[-1]["mission"]) if started else "that did not start"
    chosen = values_of(test)
    told = [(name, chosen[name]) for name in ALWAYS_TOLD]
    told += [(key.name, chosen[key.name]) for key in KEYS
             if key.name in TOLD_IF_SET and chosen[key.name] != key.default]
    given = started[-1].get("settings", {}) if started else {}
    told += [(name, given[name]) for name, usual in settings.defaults().values.items()
             if name not in NOT_TOLD and given.get(name, usual) != usual]
    told += [("use_real_" + node, True) for node in sorted(facts.real)]
    return clean("{}: mission {}; {}".format(when.isoformat(timespec="seconds"), mission, "; ".join(
        "{} {}".format(name, to_text(value)) for name, value in told)))


def failure_lines(facts: Facts) -> List[str]:
    """Return one line for each failure: time, node, path, topic or service, cause, message; tabs between them."""
    failures = [(event["time"], event["node"], event["path"], event["failure"]["resource"] or "-",
                 event["failure"]["cause"], " ".join(event["failure"]["message"].split()))
                for event in facts.events if event["event"] == "Retried"
                or event["event"] == "LeafFinished" and event["status"] == "FAILURE" and event["failure"]]
    failures += [(line.time, event["node"], event["path"], line.resource, CAUSE_OF[line.fault or ""],
                  "on the way to the safe state") for line, event in Matching(facts).in_recovery]
    return ["\t".join([_clock(failure[0])] + [clean(cell) for cell in failure[1:]]) for failure in sorted(failures)]


def summary_lines(facts: Facts) -> List[str]:
    """Return the counts: of each mission node that ran, each simulated node, how recoveries ended, and what was reached."""
    ran, failed = Counter(), Counter()  # type: Counter, Counter
    for event in of(facts.events, "LeafFinished"):
        ran[event["node"]] += 1
        failed[event["node"]] += event["status"] == "FAILURE"
    lines = ["{:<28} {:>6} {:>8}".format("mission node", "ran", "failed")]
    lines += ["{:<28} {:>6} {:>8}".format(node, ran[node], failed[node]) for node in sorted(ran)]
    lines += ["", "{:<28} {:>6} {:>8}".format("simulated node", "calls", "injected")]
    for node in servers(facts.interface):
        calls = [line for line in facts.journal if line.node == node and line.call]
        lines.append("{:<28} {:>6} {:>8}".format(node, len(calls), sum(line.fault is not None for line in calls)))
    ended = Counter(event["outcome"] for event in of(facts.events, "Recovered"))
    lines += ["", "recoveries: {}{}".format(sum(ended.values()), "".join(
        "; {} {}".format(number, outcome) for outcome, number in sorted(ended.items())))]
    return lines + coverage_lines(facts)


def decision_lines(facts: Facts) -> List[str]:
    """Return a line for each decision of the recovery."""
    return ["  {}: {}; policy: {}; {}: {}".format(
        event["path"], event["failure"]["cause"], event["policy"], count(event["attempts"], "attempt", "attempts"),
        event["outcome"]) for event in of(facts.events, "Recovered")]


def coverage_lines(facts: Facts) -> List[str]:
    """Return the coverage of the mission: leaves, and branches of nodes with several children."""
    started = of(facts.events, "RunStarted")
    if not started:
        return []
    ran, leaves = reached(facts), {path for path, _ in started[-1]["leaves"]}
    lines = ["coverage: {} of {} leaves of the mission ran".format(len(ran & leaves), len(leaves))]
    if facts.rehearsal is not None:
        wanted, ways = facts.rehearsal.reached, facts.rehearsal.branches
        lines.append("          {} of {} that this visitor should bring about".format(len(ran & wanted), len(wanted)))
        lines.append("          {} of {} branches".format(sum(bool(paths & ran) for paths in ways), len(ways)))
    return lines


class Report(NamedTuple):
    """The content of the report of a test, in reading order."""

    title: str
    verdict: Verdict
    visitors: Sequence[str]  # the warnings; then how each pass ended and why
    rows: Sequence[Row]
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

    def shown(self, width: int, files: Sequence[str] = ()) -> str:
        """Return the report for a terminal of that width: the rows replace the failures and the decisions about them.

        ``files`` are lines that name the files with the whole report.
        """
        shown = table(self.rows[:MOST_SHOWN], self.began, width)
        if len(self.rows) > MOST_SHOWN:
            shown.append("and {} more in the report".format(len(self.rows) - MOST_SHOWN))
        verdict = str(self.verdict).split("\n")
        if len(verdict) > MOST_OBJECTIONS:
            verdict[MOST_OBJECTIONS:] = ["        and {} more in the report".format(len(verdict) - MOST_OBJECTIONS)]
        return "\n".join(self._top(shown) + list(self.counts) + [""] + list(files) + [""] + verdict)

    def _top(self, shown: List[str]) -> List[str]:
        objections = self.verdict.objections[1:]
        more = " (and {}: see the end)".format(count(len(objections), "objection", "objections")) if objections else ""
        lines = ["# " + self.title, str(self.verdict).split("\n")[0] + more] + list(self.visitors) + [""]
        return lines + shown + [""] if self.rows else lines


WIDEST = sys.maxsize
"""Columns of a file."""

MOST_SHOWN, MOST_OBJECTIONS = 40, 10
"""Rows and objections that a terminal shows."""


def write(facts: Facts, title: str, warnings: Sequence[str] = ()) -> Report:
    """Return the report; ``warnings`` were printed before the start."""
    began = facts.events[0]["time"] if facts.events else 0.0
    rows = Told(facts).rows()
    visitors = list(warnings) + [clean(line) for line in _visitors(facts, rows)]
    return Report(title, judge(facts), visitors, rows, began, failure_lines(facts),
                  [clean(line) for line in decision_lines(facts)], [clean(line) for line in summary_lines(facts)])


def _visitors(facts: Facts, rows: Sequence[Row]) -> Iterator[str]:
    """Yield a line for each pass: how it ended and why, and what the faults cost."""
    ends = dict(_ends(facts))
    for a_pass in [*passes(facts), *_under_way(facts)]:
        mine = [row for row in rows if row.visitor == a_pass.number]
        told = ends.get(a_pass.number, "pass {}: {}".format(a_pass.number, a_pass.outcome))
        reasons = dict.fromkeys(reason_of(event) for event in of(a_pass.events, "Recovered"))
        parts = [told] + [reason for reason in reasons if reason not in told]
        parts += ["{}, {:.1f} s lost".format(
            count(sum(row.is_injected for row in mine), "fault", "faults"), sum(row.lost for row in mine))]
        parts += [count(sum(map(_is_false, a_pass.events)), "condition", "conditions") + " false for a while"]
        yield "; ".join(parts)


def _ends(facts: Facts) -> Iterator[Tuple[int, str]]:
    """Yield for each pass that ended its sentence, and the exhibits that the visitor did not see to the end."""
    for event, story, added in story_of(facts.events):
        for sentence in added:
            if sentence.kind == "visit" and event["event"] == "PassFinished" and story.visit is not None:
                yield event["number"], "; ".join([sentence.text] + [
                    "{} {}: {}".format(exhibit.name, exhibit.state, exhibit.why) for exhibit in story.visit.exhibits
                    if exhibit.state == LEFT_OUT])


def _under_way(facts: Facts) -> Iterator[Pass]:
    """Yield the pass that did not end, if there is one."""
    ended = of(facts.events, "PassFinished")
    began = ended[-1]["time"] if ended else 0.0
    events = [event for event in facts.events if event["time"] > began]
    if of(events, "LeafFinished"):
        yield Pass(len(ended) + 1, "did not end", began, math.inf, events, ())


def _is_false(event: Event) -> bool:
    return event["event"] == "LeafFinished" and event["status"] == "FAILURE" \
        and (event["failure"] or {}).get("cause") == Cause.CONDITION_FALSE.value


def _clock(seconds: float) -> str:
    return datetime.datetime.fromtimestamp(seconds).isoformat(timespec="milliseconds")
