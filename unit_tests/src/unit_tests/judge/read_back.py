"""The written reports of a test, read back and compared with the journal: a mistake in what makes
them does not hide a fault."""
import html
import re
from collections import Counter
from typing import Iterator, Sequence, Tuple
from xml.etree import ElementTree

from behavior_controller.simulation.faults import KINDS
from behavior_controller.simulation.journal import JournalEntry

from unit_tests.judge.verdict import Verdict

_ROW = re.compile(r"^ *-?\d+\.\d .*?(\w+:\d+) +({}) .* \d+\.\d s(?:$|</)".format(
    "|".join(KINDS)), re.M)
_COUNTS = re.compile(r"^(\w+) +(\d+) +(\d+)$", re.M)
_PRAISE = re.compile(r"(\d+) of (\d+) calls were made to fail")


def misprints(verdict: Verdict, report: str, junit: str, page: str) -> Iterator[str]:
    """Yield what the texts of the report, the JUnit file and the page have otherwise; one that is
    empty was not written."""
    calls = [line for line in verdict.facts.journal if line.call]
    if report:
        yield from _of_report(str(verdict), report, calls)
    if junit:
        yield from _of_junit(verdict, junit)
    faults = Counter(map(_fault, filter(lambda line: line.fault, calls)))
    for name, text in (("report", report), ("page", html.unescape(page))):
        found = Counter(match.groups() for match in _ROW.finditer(text))
        for call, kind in (faults - found) + (found - faults) if text else ():
            yield (f"the {name} has {found[call, kind]} rows for {call} {kind}, and the journal "
                   f"has {faults[call, kind]}")
        if text and not all(part in text for part in (verdict.word, *verdict.sentences)):
            yield f"the {name} does not have the verdict"


def _fault(line: JournalEntry) -> Tuple[str, ...]:
    return f"{line.node}:{line.call}", line.fault or ""


def _of_report(verdict: str, report: str, calls: Sequence[JournalEntry]) -> Iterator[str]:
    shown = {name: (int(made), int(failed)) for name, made, failed in _COUNTS.findall(
        report.partition("\nsimulated node ")[2])}
    for node in dict.fromkeys(line.node for line in calls):
        its = [line.fault for line in calls if line.node == node]
        due = len(its), len(its) - its.count(None)
        if shown.get(node) != due:
            yield f"the report counts {shown.get(node)} calls of {node}, and the journal {due}"
    due = sum(line.fault is not None for line in calls), len(calls)
    for failed, made in _PRAISE.findall(verdict):
        if (int(failed), int(made)) != due:
            yield f"the verdict counts {failed} of {made} calls that failed, and the journal {due}"


def _of_junit(verdict: Verdict, junit: str) -> Iterator[str]:
    suite = ElementTree.fromstring(junit)
    told = [line for case in suite.findall("testcase/failure")
            for line in (case.text or "").split("\n")]
    if told != list(verdict.objections):
        yield (f"the JUnit file has {len(told)} objections, and the verdict has "
               f"{len(verdict.objections)}")
    if int(suite.get("failures", "-1")) != len(suite.findall("testcase/failure")):
        yield "the JUnit file counts its failures wrong"
