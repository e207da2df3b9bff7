"""The reference says of each mission node what the delivered recovery policy does."""
import os

import pytest

from behavior_controller import folders, leaves
from behavior_controller.bt import Kind
from behavior_controller.config import recovery_policy
from behavior_controller.leaves.recovery import RETURN_LIMIT
from behavior_controller.robot import rhythm
from behavior_controller.robot.gateway import Cause
from behavior_controller.ros import console, ros_interface, sinks
from behavior_controller.run import history
from behavior_controller.run.record import files, recorder
from behavior_controller.viewer import view, web_page, zmtp
from table_4 import TABLE_4

DOCUMENTS = os.path.join(os.path.dirname(folders.config("")), os.pardir, "docs")
SPEC = {spec.id: spec for spec in leaves.SPECS}
NODES = list(SPEC)
POLICY = recovery_policy.load(folders.config("recoveryPolicy.ini"), leaves.mission_specs())
COLUMNS = (Cause.REFUSED, Cause.NOT_REACHABLE, Cause.NO_ANSWER, Cause.CONNECTION_LOST,
           Cause.TYPE_MISMATCH)


def text_of(document):
    with open(os.path.join(DOCUMENTS, document), encoding="utf-8") as file:
        return file.read()


def section():
    text = text_of("reference.md").partition("\n## Recovery of each node\n")[2]
    return text.partition("\n## ")[0]


def rows():
    table = [[cell.strip() for cell in line.strip("| ").split("|")]
             for line in section().splitlines() if line.startswith("|")]
    return {node: row[1:] for row in table for node in row[0].split(", ") if node in NODES}


def in_words(rule):
    then = rule.substitute.id if rule.substitute else {
        recovery_policy.SKIP: "skip", recovery_policy.GIVE_UP: "give up"
    }[rule.then]
    return ("{}×, ".format(rule.retries) if rule.retries else "") + then


@pytest.mark.parametrize("node", sorted(rows()))
def test_the_reference_says_what_the_policy_does(node):
    assert rows()[node] == [in_words(POLICY.rule(SPEC[node], cause)) for cause in COLUMNS]


def test_no_node_of_the_document_is_forgotten():
    # those ask nothing of the robot
    assert set(TABLE_4) - set(rows()) == {"START_OF_TREE", "HandleFallBack"} | {
        node for node in TABLE_4 if node.startswith("Is")}


def test_the_policy_for_conditions_is_that_of_the_reference():
    skipped = [spec.id for spec in SPEC.values() if spec.kind is Kind.CONDITION
               and in_words(POLICY.rule(spec, Cause.CONDITION_FALSE)) != "give up"]
    assert ["The exception is {}:".format(node) in section() for node in skipped] == [True]


@pytest.mark.parametrize("words", [
    f"Up to {console.MOST_UNFORMATTED:,} events wait",
    f"up to {sinks.MOST_UNWRITTEN:,} lines wait",
    f"after {rhythm.SILENCE} s, or {rhythm.GAPS} times the usual gap",
    f"at most {1 / ros_interface.CALL_INTERVAL:.0f} a second",
    f"Up to {recorder.MOST_FOR_DISK:,} events wait",
    f"{files.PLACE_BYTES / 1e9:.0f} GB and {files.MOST_RUNS:,} at most",
    f"the last {files.RUN_BYTES / 1e6:.0f} MB are kept",
    f"room for {web_page.MOST_CONNECTIONS} connections",
    f"each of Groot2's two for {zmtp.MOST_CLIENTS}",
    f"silent for {view.HANGS:.0f} s",
    f"wait {RETURN_LIMIT:.0f} s at most"])
def test_the_reference_has_the_figures_of_the_code(words):
    assert words in " ".join(text_of("reference.md").split())


def test_the_viewer_keeps_a_million_events():
    assert "the last million events" in " ".join(text_of("reference.md").split())
    assert history.MOST_STRETCHES * history.STRETCH_EVENTS == 1_000_000


@pytest.mark.parametrize("document", ["operators_guide.md", "reference.md"])
def test_the_budget_and_the_pauses_are_those_of_the_policy(document):
    with open(folders.config("recoveryPolicy.ini"), encoding="utf-8") as file:
        given = {line.split()[0]: line.split()[1:3] for line in file
                 if line.startswith(("budget", "pause"))}
    text = " ".join(text_of(document).split())
    assert "{} recoveries in {} s".format(*given["budget"]) in text
    first, longest = given["pause"]
    assert "{} s, ".format(first) in text or "takes {} s.".format(first) in text
    assert "up to {} s".format(longest) in text


@pytest.mark.parametrize("document, claim", [
    ("operators_guide.md", "no drive under way"), ("operators_guide.md", "ten thousand events"),
    ("reference.md", "ten thousand events"), ("../README.md", "leaves the robot safe"),
    ("tutorial.md", "both commands warn")])
def test_no_wrong_claim_is_back(document, claim):
    assert claim not in " ".join(text_of(document).split())
