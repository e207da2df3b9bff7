"""What controller, simulated robot and judge share may be wrong in all of them: a test is FAILED
then, if a visitor or the robot would notice."""
import os

import pytest

from behavior_controller import folders
from behavior_controller.bt.loader.document import parse
from behavior_controller.config import settings
from behavior_controller.missions import load as missions
from behavior_controller.simulation.rehearsal.play import LoadedMission

from unit_tests.judge.verdict import Verdict

from plays import facts
from shared_faults import FAULTS

UNNOTICED = {
    "a ReactiveFallback does not halt": "the Sleep beside a condition is halted by the controls "
                                        "above it before it is asked again: the run is the same",
    "a Parallel ends at its first success": "all its requests have been made by then, and calls "
                                            "take no time here"}
"""Faults that no visitor and no robot notices in these tests, and why."""

QUICK = 8
"""Every so many faults one is tried without ``-m long``."""


def judged(what):
    made, visitor, edits, mission = FAULTS[what]
    with made():
        chosen, documents = settings.defaults(**mission), None
        if edits:
            path = missions.find(chosen.scenario_specification)
            with open(path, encoding="utf-8") as file:
                text = file.read()
            for one, other in edits:
                assert one in text
                text = text.replace(one, other, 1)
            documents = [parse(text, path)]
        on = LoadedMission(chosen, documents)
        return Verdict(facts(on=on, visitor_behaviour=visitor, test_timeout=600.0))


@pytest.mark.slow
@pytest.mark.parametrize("what", [
    what if number % QUICK == 0 else pytest.param(what, marks=pytest.mark.long)
    for number, what in enumerate(sorted(FAULTS))])
def test_a_fault_in_shared_code_is_failed_unless_nobody_notices(what):
    verdict = judged(what)
    assert verdict.passed is (what in UNNOTICED), verdict


def test_the_family_has_every_kind():
    assert len(FAULTS) >= 60 and set(UNNOTICED) <= set(FAULTS)


def test_the_explanation_has_these_figures():
    with open(os.path.join(folders.share(), "docs", "verdict.md"), encoding="utf-8") as file:
        text = " ".join(file.read().split())
    assert "makes {} faults in shared code".format(len(FAULTS)) in text
    assert "{} are FAILED".format(len(FAULTS) - len(UNNOTICED)) in text
