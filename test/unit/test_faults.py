"""Tests of the faults of service calls."""
import itertools
import math

import pytest

from behavior_controller.simulation.faults import (
    EXCEPTION, Faults, PlannedFault, REFUSED, UNANSWERED, parse_planned_fault)

CALLS = 10_000
NODES = ("textToSpeech", "robotNavigation")


def decisions(faults, number=CALLS):
    return [faults.next() for _ in range(number)]


def binomial_interval(rate, level):
    """Return the bounds of the number of faults between which ``level`` of all series of CALLS
    calls lie."""
    def share_of(count):
        ways = math.lgamma(CALLS + 1) - math.lgamma(count + 1) - math.lgamma(CALLS - count + 1)
        return math.exp(ways + count * math.log(rate) + (CALLS - count) * math.log(1 - rate))

    sums = list(itertools.accumulate(map(share_of, range(CALLS + 1))))
    outside = (1 - level) / 2
    return (next(count for count, below in enumerate(sums) if below > outside),
            next(count for count, below in enumerate(sums) if below >= 1 - outside))


def test_the_interval_is_that_of_the_tables():
    # of the normal distribution, which the binomial is near: 3.2905 standard deviations hold 99.9 %
    assert binomial_interval(0.5, 0.999) == pytest.approx((5000 - 3.2905 * 50, 5000 + 3.2905 * 50),
                                                          abs=1)


@pytest.mark.parametrize("rate", (0.01, 0.1, 0.5, 0.9))
@pytest.mark.parametrize("seed", ("1/textToSpeech/faults", "2/knowledgeBase/faults"))
def test_the_share_of_faults_is_the_failure_rate(rate, seed):
    failed = sum(fault == REFUSED for fault in decisions(Faults(rate, seed)))
    least, most = binomial_interval(rate, 0.999)
    assert least <= failed <= most


@pytest.mark.parametrize("rate, expected", ((0, None), (1, REFUSED)))
def test_none_and_all(rate, expected):
    assert set(decisions(Faults(rate, "x"))) == {expected}


def test_the_same_seed_fails_the_same_calls():
    assert decisions(Faults(0.3, "1/a"), 100) == decisions(Faults(0.3, "1/a"), 100)
    assert decisions(Faults(0.3, "1/a"), 100) != decisions(Faults(0.3, "1/b"), 100)


def test_kinds_share_the_faults_evenly():
    found = decisions(Faults(0.5, "x", (REFUSED, EXCEPTION)))
    share = found.count(EXCEPTION) / (found.count(EXCEPTION) + found.count(REFUSED))
    assert share == pytest.approx(0.5, abs=4 * math.sqrt(0.25 / (CALLS / 2)))
    assert UNANSWERED not in found


def test_a_planned_fault_comes_at_its_call_and_moves_no_other():
    plain = decisions(Faults(0.3, "x"), 50)
    planned = Faults(0.3, "x", planned=[PlannedFault("textToSpeech", 4, UNANSWERED)])
    found = decisions(planned, 50)
    assert found[3] == UNANSWERED
    assert found[:3] + found[4:] == plain[:3] + plain[4:]
    assert planned.calls == 50


@pytest.mark.parametrize("text, expected", (
    ("textToSpeech:3", PlannedFault("textToSpeech", 3, REFUSED)),
    ("textToSpeech:1", PlannedFault("textToSpeech", 1, REFUSED)),
    ("robotNavigation:12:unanswered", PlannedFault("robotNavigation", 12, UNANSWERED))))
def test_planned_faults_are_read(text, expected):
    assert parse_planned_fault(text, NODES) == expected


@pytest.mark.parametrize("text",
                         ("textToSpeech", "textToSpeech:", "textToSpeech:0", "textToSpeech:-1",
                          "textToSpeech:x", "speech:1", "textToSpeech:1:slow", ":1", ""))
def test_what_is_no_planned_fault_is_refused(text):
    with pytest.raises(ValueError):
        parse_planned_fault(text, NODES)
