"""Tests of the Poisson arrivals."""
import itertools
import math
import time

import pytest

from behavior_controller.config import settings
from behavior_controller.simulation import configuration
from behavior_controller.simulation.arrivals import Arrivals
from behavior_controller.simulation.simulated_node import SimulatedNode
from behavior_controller.simulation.visitor import ENGAGES
from behavior_controller.simulation.world import world

GAPS = 10_000
RATES = (1, 60, 1000)


def gaps(rate, seed="7/faceDetection/arrivals", number=GAPS):
    times = list(itertools.islice(Arrivals(rate, seed).times(0.0), number))
    return [later - sooner for sooner, later in zip([0.0] + times, times)]


def kolmogorov_smirnov(sample, cumulative):
    """Return the p-value of a sample under a distribution (Kolmogorov's series; good for large
    samples)."""
    ordered, size = sorted(sample), len(sample)
    distance = max(max((i + 1) / size - cumulative(x), cumulative(x) - i / size)
                   for i, x in enumerate(ordered))
    scaled = distance * math.sqrt(size)
    if scaled < 0.2:
        return 1.0
    return 2 * sum((-1) ** (k - 1) * math.exp(-2 * (k * scaled) ** 2) for k in range(1, 101))


@pytest.mark.parametrize("rate", RATES)
def test_the_mean_gap_is_sixty_seconds_by_the_rate(rate):
    number = 10 * GAPS
    # three standard errors
    assert sum(gaps(rate, number=number)) / number == pytest.approx(60 / rate, rel=0.01)


@pytest.mark.parametrize("rate", RATES)
def test_the_gaps_are_exponential(rate):
    assert kolmogorov_smirnov(gaps(rate),
                              lambda seconds: 1 - math.exp(-seconds * rate / 60)) > 0.001


def test_the_comparison_sees_what_is_not_exponential():
    even = [2 * (i + 0.5) / GAPS for i in range(GAPS)]  # uniform, of mean 1
    assert kolmogorov_smirnov(even, lambda seconds: 1 - math.exp(-seconds)) < 0.001


def test_the_number_of_arrivals_in_a_minute_varies_as_much_as_its_mean():
    minutes = 2000
    counts = [0] * minutes
    for due in itertools.takewhile(lambda due: due < 60 * minutes,
                                   Arrivals(60, "counts").times(0.0)):
        counts[int(due // 60)] += 1
    mean = sum(counts) / minutes
    variance = sum((count - mean) ** 2 for count in counts) / (minutes - 1)
    assert mean == pytest.approx(60, rel=0.03)
    # more than four standard errors, sqrt(2 / minutes)
    assert variance / mean == pytest.approx(1, abs=0.15)


def test_gaps_do_not_depend_on_each_other():
    sample = gaps(60)
    mean = sum(sample) / GAPS
    covariance = sum((a - mean) * (b - mean) for a, b in zip(sample, sample[1:]))
    assert abs(covariance / sum((a - mean) ** 2 for a in sample)) < 4 / math.sqrt(GAPS)


def test_the_same_seed_gives_the_same_gaps_and_another_seed_others():
    assert gaps(60, "1/a", 20) == gaps(60, "1/a", 20)
    assert not set(gaps(60, "1/a", 20)) & set(gaps(60, "1/b", 20))


def test_an_infinite_rate_leaves_no_gaps():
    assert gaps(math.inf, number=3) == [0.0, 0.0, 0.0]
    assert list(itertools.islice(Arrivals(math.inf, "x").times(5.0), 2)) == [5.0, 5.0]


def test_times_begin_at_any_moment():
    early, late = (list(itertools.islice(Arrivals(60, "x").times(start), 5))
                   for start in (0.0, 100.0))
    assert late == pytest.approx([time + 100.0 for time in early])


@pytest.mark.parametrize("rate", RATES)
def test_each_topic_has_the_configured_rate_and_none_keeps_step_with_another(rate):
    test = configuration.defaults(arrivalRate=float(rate), randomSeed=7)
    around = world(ENGAGES, settings.defaults())
    times = [[*itertools.islice(SimulatedNode(node, test, around, time.monotonic, print).arrivals()
                                .times(0.0), GAPS)]
             for node in ("faceDetection", "overtAttention", "speechEvent")]
    for own in times:
        assert own[-1] == pytest.approx(60 * GAPS / rate, rel=5 / math.sqrt(GAPS))
    assert len(set(itertools.chain(*times))) == 3 * GAPS
