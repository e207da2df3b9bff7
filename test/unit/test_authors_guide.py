"""The author's guide and the reference say of missions and rehearsals what is so."""
import os
import re

import pytest

from behavior_controller import leaves
from behavior_controller.missions import load
from behavior_controller.simulation.rehearsal import cli, play, plays

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))


def text_of(*path):
    with open(os.path.join(ROOT, *path), encoding="utf-8") as file:
        return " ".join(file.read().split())


GUIDE, REFERENCE = text_of("docs", "authors_guide.md"), text_of("docs", "reference.md")


@pytest.mark.parametrize("name", ["lab_tour", "reception"])
def test_the_nodes_of_the_delivered_missions(name):
    nodes = load.load_tree(load.find(name)).nodes
    kinds = {node.spec.id for node in nodes} & {spec.id for spec in leaves.mission_specs()}
    assert "`data/{}.xml` has {} kinds of mission nodes, and {} nodes".format(
        name, len(kinds), len(nodes)) in GUIDE


@pytest.mark.parametrize("document", ["docs/authors_guide.md", "docs/developers_guide.md"])
def test_the_number_of_recorded_traces(document):
    tested = text_of("test", "conformance", "test_conformance.py")
    counts = re.findall(r'\("(?:hand|random\.jsonl\.xz)", (\d+)\)', tested)
    assert len(counts) == 2 and re.search(
        r"{:,} (?:recorded )?traces".format(sum(map(int, counts))), text_of(document))


@pytest.mark.slow
def test_the_quoted_rehearsal(capsys):
    with open(os.path.join(ROOT, "docs", "authors_guide.md"), encoding="utf-8") as file:
        command, *quoted = re.search(r"\$ .* rehearseMission (.*\n[^`]*)```", file.read()).group(
            1).splitlines()
    cli.main(command.split() + ["--jobs", "1"])
    lines = capsys.readouterr().out.splitlines()
    printed = {re.sub(r"in \S+ s$", "in … s", line) for line in lines}
    assert len(quoted) > 8
    assert {re.sub(r"in \S+ s$", "in … s", line) for line in quoted} <= printed | {"…"}


def test_the_limits_of_a_rehearsal():
    assert "up to {} further runs".format(plays.MOST_PLAYS) in REFERENCE
    assert "{:,.0f} s of the mission's time".format(play.PASS_LIMIT) in REFERENCE
