"""The tester's guide and the reference have the visitors, and the limits of a test."""
import os
import re

import pytest

from behavior_controller.simulation import behaviour, configuration
from behavior_controller.simulation.rehearsal import arrival_waits
from behavior_controller.simulation.visitor import BEHAVIOURS, LONG_WAIT
from unit_tests.judge import execution, facts, outcome
from unit_tests.robot import options
from unit_tests.run import test_node as node

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
         arrival_waits.SUFFICIENT_SHARE).replace("%", " %")),
], ids=lambda row: row[1])
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
