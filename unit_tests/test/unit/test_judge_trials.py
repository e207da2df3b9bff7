"""The judge of a test is tried in virtual time; the soak tries it with many more."""
import dataclasses
import os
import sys
from unittest import mock

import pytest

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__)))))
sys.path.append(os.path.join(ROOT, "test", "soak"))
import judge_trials  # noqa: E402
from behavior_controller.simulation.rehearsal.play import CALM  # noqa: E402

pytestmark = pytest.mark.slow

MORE = pytest.mark.long
VOICE = "lab tour by voice"


@pytest.mark.parametrize("seeds", [range(8), pytest.param(range(8, 100), marks=MORE)], ids=str)
def test_the_sound_controller_is_never_failed(seeds):
    assert judge_trials.soundness(seeds, jobs=1) == []


def test_a_visitor_may_leave_while_the_gesture_before_the_goodbye_is_tried_again():
    assert judge_trials.soundness([5203847], jobs=1) == []


@pytest.mark.parametrize("names, most",
                         [([VOICE], 5), pytest.param(list(judge_trials.STAGES), 60, marks=MORE)])
def test_a_broken_controller_is_failed_with_the_node_named(names, most):
    outcomes = judge_trials.sharpness(judge_trials.chosen(1, most, names=names), jobs=1)
    shown = [outcome for outcome in outcomes if outcome.is_visible]
    assert len(shown) >= most // 2
    missed = [outcome.what for outcome in shown if not outcome.is_named]
    assert len(missed) <= len(shown) // 100, missed


def test_a_judge_that_fails_nothing_is_noticed():
    with mock.patch.object(judge_trials, "verdict_on", lambda *_: ()):
        outcomes = judge_trials.sharpness(
            judge_trials.chosen(1, only="WelcomeSpeech succeeds without", names=[VOICE]), jobs=1)
    assert [outcome.objections for outcome in outcomes] == [(), ()]
    assert all(outcome.shown.startswith("requests") for outcome in outcomes)


def test_both_tours_have_breakages_of_every_family():
    families = [{breakage.family for breakage in judge_trials.family(name, 1)}
                for name in (VOICE, "release 1.0 by voice")]
    assert families[0] == families[1] and len(families[0]) >= 15


@pytest.mark.parametrize("seed, rate, arrivals", [(6, 0.1, 600.0), (1, 0.0, 1.0), (2, 0.0, 5.0),
                                                  (3, 0.0, 10.0)])
def test_what_comes_too_late_or_is_given_up_is_not_the_controllers_fault(seed, rate, arrivals):
    test = dataclasses.replace(CALM, random_seed=seed, failure_rate=rate, arrival_rate=arrivals,
                               test_timeout=36000.0)
    on = judge_trials.stage(VOICE)
    played = on.play(test)
    assert [visit.outcome for visit in played.run().visits] == ["FAILURE"]
    assert judge_trials.verdict_on(on, test, played) == ()
