"""Verdicts on many tours in virtual time, compared with an independent model of the tour; the soak runs more of them."""
import dataclasses
import os
import random
import sys

import pytest

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__)))))
sys.path.append(os.path.join(ROOT, "test", "soak"))
import verdicts  # noqa: E402
from behavior_controller import settings  # noqa: E402
from broken import ALL  # noqa: E402

from unit_tests.facts import Facts  # noqa: E402
from unit_tests.rehearsal import rehearse_on  # noqa: E402
from unit_tests.robot import OPTIONAL  # noqa: E402
from unit_tests.stage import CALM, Stage  # noqa: E402
from unit_tests.verdict import judge  # noqa: E402

SETTINGS = 250 if sys.version_info >= (3, 9) else 50
"""Fewer on the oldest Python: verdicts do not depend on the version."""


def test_no_verdict_speaks_against_a_controller_that_does_what_the_policy_says():
    tally = verdicts.try_settings(range(SETTINGS))
    assert (tally.differing, tally.wrong) == (0, [])


@pytest.mark.parametrize("name", sorted(ALL))
def test_a_controller_that_does_one_thing_wrong_is_found_out(name):
    with verdicts.spoilt(ALL[name]):
        tally = verdicts.try_settings(range(max(4, SETTINGS // 30)), (0.3, 0.5), is_spoilt=True)
    assert tally.differing and tally.wrong == []


def test_a_model_that_could_not_differ_would_prove_nothing():
    facts = verdicts.play(True, CALM)
    assert verdicts.difference(True, CALM, facts) == ""
    calls = [line for line in facts.journal if line.call]
    for left_out in calls:
        assert verdicts.difference(True, CALM, facts._replace(journal=[line for line in facts.journal if line != left_out]))
        twice = left_out._replace(time=left_out.time + 0.01)
        assert verdicts.difference(True, CALM, facts._replace(journal=sorted(list(facts.journal) + [twice])))


@pytest.mark.parametrize("seed, rate, arrivals", [(6, 0.1, 600.0), (1, 0.0, 1.0), (2, 0.0, 5.0), (3, 0.0, 10.0)])
def test_what_comes_too_late_or_is_given_up_is_not_the_controllers_fault(seed, rate, arrivals):
    test = dataclasses.replace(CALM, random_seed=seed, failure_rate=rate, arrival_rate=arrivals, test_timeout=36000.0)
    facts = verdicts.play(True, test)
    assert [event["outcome"] for event in facts.events if event["event"] == "PassFinished"] == ["FAILURE"]
    assert judge(facts).passed


@pytest.mark.parametrize("by_voice, tablet", [(True, "done"), (False, "yes"), (False, "done")])
def test_no_verdict_speaks_against_a_tour_of_release_1_0(by_voice, tablet):
    on = Stage(settings.defaults(asrEnabled=by_voice, tabletSuccessIs=tablet, robotInterface="release-1.0",
                                 scenarioSpecification="release_1_0_tour"))
    for seed in range(SETTINGS // 10):
        chance = random.Random(seed)
        test = dataclasses.replace(
            verdicts.draw(seed)[1], recognise_by=chance.choice(("topic", "action")), test_timeout=3000.0,
            absent_services=tuple(chance.sample(OPTIONAL, chance.choice((0, 0, 1)))))
        played = on.play(test)
        verdict = judge(Facts(played.record(), played.journal, played.exit_code, test.visitor_behaviour, test.mission_runs,
                              on.knowledge, played.cut_off, rehearse_on(on, test.visitor_behaviour),
                              interface=on.settings.interface, absent=frozenset(test.absent_services)))
        assert verdict.passed, (test, str(verdict))
