"""The report of a test as text: a line for each failure, the counts, and the verdict as the last line."""
import datetime
from collections import Counter
from typing import List, Tuple

from behavior_controller.gateway import Cause

from unit_tests.facts import Facts, count, of
from unit_tests.matching import CAUSE_OF, Matching
from unit_tests.robot import SERVICES
from unit_tests.verdict import Verdict, judge


def failure_lines(facts: Facts) -> List[str]:
    """Return one line for each failure: time, node, path, topic or service, cause, message; tabs between them."""
    failures = [(event["time"], event["node"], event["path"], event["failure"]["resource"] or "-",
                 event["failure"]["cause"], " ".join(event["failure"]["message"].split()))
                for event in of(facts.events, "LeafFinished") if event["status"] == "FAILURE" and event["failure"]]
    failures += [(line.time, event["node"], event["path"], line.resource, CAUSE_OF[line.fault or ""],
                  "during the recovery from the failure before") for line, event in Matching(facts).in_recovery]
    return ["\t".join((_clock(failure[0]),) + failure[1:]) for failure in sorted(failures)]


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
    recovered = of(facts.events, "Recovered")
    going_on = sum(event["success"] for event in recovered)
    return lines + ["", "recoveries: {}; {} went on, {} gave up".format(
        len(recovered), going_on, len(recovered) - going_on)]


def write(facts: Facts, title: str) -> Tuple[Verdict, str]:
    """Return the verdict and the text of the report."""
    verdict = judge(facts)
    failures = failure_lines(facts)
    lines = ["# " + title, "# time\tnode\tpath\ttopic or service\tcause\tmessage"] + failures
    false = sum("\t{}\t".format(Cause.CONDITION_FALSE.value) in line for line in failures)
    lines += ["", "{}; {} of them conditions that were false for a while".format(
        count(len(failures), "failure", "failures"), false), ""] + summary_lines(facts) + ["", str(verdict)]
    return verdict, "\n".join(lines) + "\n"


def _clock(seconds: float) -> str:
    return datetime.datetime.fromtimestamp(seconds).isoformat(timespec="milliseconds")
