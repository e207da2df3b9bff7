"""The tester's guide and the reference have the visitors, and the limits of a test."""
import os
import re
from math import inf

import pytest

pytest.importorskip("rospkg", reason="needs ROS, which this interpreter does not have")

from behavior_controller.simulation import behaviour, configuration
from behavior_controller.simulation.rehearsal import arrival_waits
from behavior_controller.simulation.rehearsal.play import leaves_reached
from behavior_controller.simulation.visitor import BEHAVIOURS, LONG_WAIT
from unit_tests.judge import execution, facts, outcome
from unit_tests.robot import options
from unit_tests.judge.report import Report, summary_lines
from unit_tests.judge.verdict import Verdict
from unit_tests.run import test_node as node

import plays

DOCS = os.path.join(os.path.dirname(os.path.abspath(__file__)), *[os.pardir] * 3, "docs")


def text_of(name):
    with open(os.path.join(DOCS, name), encoding="utf-8") as file:
        return file.read()


@pytest.mark.parametrize("row", [
    ("a step, a timer, an answer, the next pass or the end may be late by",
     "{:g} s, and".format(facts.LATE_TOLERANCE)),
    ("such a time is told in the report", "from {:g} s on".format(node.WORTH_TELLING)),
    ("a request may be on record too early by", "{:g} s |".format(facts.EARLY_TOLERANCE)),
    ("of several retries of a node, at least one comes within",
     "{:g} s of its pause".format(execution.LATE_RETRY)),
    ("a mission may wait for a visitor until `testTimeout` after",
     "{:g} s without a sign".format(LONG_WAIT)),
    ("simulated calls take a robot's time (`callTimes auto`)",
     "if `testTimeout` has {:g} s for each".format(configuration.VISIT)),
    ("a simulated drive", "{:g} s |".format(behaviour.DRIVE)),
    ("a rate of messages is too low for a condition",
     "if they come in time in less than {:.0%}".format(
         arrival_waits.SUFFICIENT_SHARE).replace("%", " %"))], ids=lambda row: row[1])
def test_the_reference_has_the_limits_of_a_test(row):
    assert "| {} | {}".format(*row) in text_of("reference.md")


def test_the_explanation_has_the_same_limits():
    text = " ".join(text_of("verdict.md").split())
    assert "a step may be {:g} s late, and a request may be on record {:g} s early".format(
        facts.LATE_TOLERANCE, facts.EARLY_TOLERANCE) in text
    assert "no sign came for more than {:g} s".format(LONG_WAIT) in text
    assert "`arrivalRate` is below {:g}".format(outcome.PROMPT_RATE) in text


def test_the_guide_has_each_visitor():
    guide = text_of("testers_guide.md")
    rows = re.findall(r"(?m)^\| `(\w+)` \|", guide.partition("## The visitor")[2])[1:]
    assert sorted(rows) == sorted(BEHAVIOURS)
    assert "`startupTimeout` is {:g} if".format(options.STARTUP_TIMEOUT) in guide


def in_a_simulated_run(line):
    """Return a line without what differs from run to run: times, and conditions while it waits."""
    return re.sub(r"[\d.]+ s\b|\d+ (?=conditions? false)|^ +[\d.]+(?=  )", "…", line)


def test_the_guide_quotes_what_a_test_prints():
    of_test = plays.facts(failure_rate=0.1, random_seed=1, arrival_rate=inf)
    of_test = of_test._replace(expected=leaves_reached(plays.stage(), of_test.test))
    told = [str(Verdict(of_test)), *Report(of_test, "title").visitors, *summary_lines(of_test)]
    quoted = text_of("testers_guide.md").partition("## What a test prints")[2].partition("```")[2]
    wanted = [line for line in quoted.partition("```")[0].splitlines()
              if re.match(r"PASSED|pass 1|coverage| +\d+ (of|branches)", line)]
    assert len(wanted) == 5
    assert {in_a_simulated_run(line) for line in wanted} <= set(map(in_a_simulated_run, told))
