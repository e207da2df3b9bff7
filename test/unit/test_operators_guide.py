"""The operator's guide says of each mission node what the delivered recovery policy does."""
import os

import pytest

from behavior_controller import folders, leaves
from behavior_controller.config import recovery_policy
from behavior_controller.robot.gateway import Cause
from table_4 import TABLE_4

GUIDE = os.path.join(os.path.dirname(folders.config("")), os.pardir, "docs", "operators_guide.md")
SPEC = {spec.id: spec for spec in leaves.SPECS}
NODES = list(SPEC)
POLICY = recovery_policy.load(folders.config("recoveryPolicy.ini"), leaves.mission_specs())
COLUMNS = ((Cause.REFUSED, ), (Cause.NOT_REACHABLE, ), (Cause.NO_ANSWER, Cause.CONNECTION_LOST),
           (Cause.TYPE_MISMATCH, ))


def rows():
    with open(GUIDE, encoding="utf-8") as file:
        table = [[cell.strip() for cell in line.strip("|\n ").split("|")] for line in file
                 if line.startswith("|")]
    return {row[0]: row[1:] for row in table if row[0] in NODES}


def in_words(rule):
    then = rule.substitute.id if rule.substitute else {
        recovery_policy.SKIP: "skip", recovery_policy.GIVE_UP: "give up"
    }[rule.then]
    return ("{}×, ".format(rule.retries) if rule.retries else "") + then


@pytest.mark.parametrize("node", sorted(node for node, cells in rows().items() if len(cells) == 5))
def test_the_guide_says_what_the_policy_does(node):
    for cell, causes in zip(rows()[node], COLUMNS):
        rules = [in_words(POLICY.rule(SPEC[node], cause)) for cause in causes]
        if len(set(rules)) == 1:
            assert cell == rules[0]
        else:
            assert (node, cell, rules) == ("Navigate", "1× (no answer) or 2× (lost), give up",
                                           ["1×, give up", "2×, give up"])


def test_no_node_of_the_document_is_forgotten():
    with open(GUIDE, encoding="utf-8") as file:
        text = file.read()
    assert [node for node in TABLE_4 if node not in text] == []
    # these never fail by themselves
    assert set(TABLE_4) - set(rows()) == {"START_OF_TREE", "HandleFallBack"}
