"""The report of a test as text: a line for each failure, the counts, and the verdict as the last line."""
import datetime
import os
from collections import Counter
from typing import List, Tuple

from behavior_controller import settings
from behavior_controller.gateway import Cause
from behavior_controller.keys import to_text, values_of
from behavior_controller.text import clean

from unit_tests.configuration import KEYS, Configuration
from unit_tests.facts import Facts, count, of
from unit_tests.matching import CAUSE_OF, Matching
from unit_tests.robot import SERVICES
from unit_tests.verdict import Verdict, judge, reached


ALWAYS_TOLD = ("visitorBehaviour", "failureRate", "arrivalRate", "randomSeed")
"""Keys of the test that the title shows whatever they are."""

TOLD_IF_SET = ("missionRuns", "faultKinds", "plannedFaults")
"""Keys of the test that it shows if they are not the default. The rest does not change what happens."""

NOT_TOLD = {"scenarioSpecification", "verboseMode", "missionRuns", "startupTimeout", "groot2Port", "groot2Address",
            "monitorPort", "monitorAddress", "recordDirectory"}
"""Keys of the controller that the title has already, or that do not change what happens. It shows the rest if it is set."""


def title(facts: Facts, test: Configuration, when: datetime.datetime) -> str:
    """Return what ran and when: with the package's files as delivered, enough to repeat it (contract, section 10)."""
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
    """Return the counts: of each mission node that ran, each simulated node, and what the recovery did."""
    ran, failed = Counter(), Counter()  # type: Counter, Counter
    for event in of(facts.events, "LeafFinished"):
        ran[event["node"]] += 1
        failed[event["node"]] += event["status"] == "FAILURE"
    lines = ["{:<28} {:>6} {:>8}".format("mission node", "ran", "failed")]
    lines += ["{:<28} {:>6} {:>8}".format(node, ran[node], failed[node]) for node in sorted(ran)]
    lines += ["", "{:<28} {:>6} {:>8}".format("simulated node", "calls", "injected")]
    for node in SERVICES:
        calls = [line for line in facts.journal if line.node == node and line.call > 0]
        lines.append("{:<28} {:>6} {:>8}".format(node, len(calls), sum(line.fault is not None for line in calls)))
    return lines + [""] + recovery_lines(facts) + coverage_lines(facts)


def recovery_lines(facts: Facts) -> List[str]:
    """Return how many recoveries there were and how they ended, and a line for each decision."""
    recovered = of(facts.events, "Recovered")
    ended = Counter(event["outcome"] for event in recovered)
    lines = ["recoveries: {}{}".format(len(recovered), "".join(
        "; {} {}".format(number, outcome) for outcome, number in sorted(ended.items())))]
    return lines + ["  {}: {}; policy: {}; {}: {}".format(
        event["path"], event["failure"]["cause"], event["policy"], count(event["attempts"], "attempt", "attempts"),
        event["outcome"]) for event in recovered]


def coverage_lines(facts: Facts) -> List[str]:
    """Return how much of the mission ran: leaves, and branches of nodes with several children."""
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


def write(facts: Facts, title: str) -> Tuple[Verdict, str]:
    """Return the verdict and the text of the report."""
    verdict = judge(facts)
    failures = failure_lines(facts)
    lines = ["# " + title, "# time\tnode\tpath\ttopic or service\tcause\tmessage"] + failures
    false = sum("\t{}\t".format(Cause.CONDITION_FALSE.value) in line for line in failures)
    lines += ["", "{}; {} of them conditions that were false for a while".format(
        count(len(failures), "failure", "failures"), false), ""] + [clean(line) for line in summary_lines(facts)]
    lines += ["", str(verdict)]
    return verdict, "\n".join(lines) + "\n"


def _clock(seconds: float) -> str:
    return datetime.datetime.fromtimestamp(seconds).isoformat(timespec="milliseconds")
