#!/usr/bin/env python3
"""Judge many tours in virtual time, each with settings of its own, and hold every verdict against a plain model.

``verdicts.py [--settings N] [--seed N]``. A setting is drawn: failureRate 0 to 1, arrivalRate 1 to inf, the visitor,
voice or tablet, the kinds of faults. A verdict is right if it is PASSED where ``tour_model`` says that the controller
did what the policy's text asks, and FAILED where it did not. Exit code 0 if every verdict is right.
"""
import argparse
import collections
import contextlib
import dataclasses
import functools
import math
import os
import random
import sys

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
sys.path[:0] = [os.path.dirname(os.path.abspath(__file__)), os.path.join(ROOT, "src"),
                os.path.join(ROOT, "unit_tests", "src")]

import timed_tour  # noqa: E402
from behavior_controller import settings  # noqa: E402
from unit_tests import journal  # noqa: E402
from unit_tests.facts import Facts  # noqa: E402
from unit_tests.faults import KINDS, REFUSED  # noqa: E402
from unit_tests.rehearsal import rehearse_on  # noqa: E402
from unit_tests.stage import CALM, Stage  # noqa: E402
from unit_tests.verdict import judge  # noqa: E402
from unit_tests.visitor import BEHAVIOURS, DECLINES, SILENT, UNCLEAR  # noqa: E402

FAILURE_RATES = (0.0, 0.05, 0.1, 0.2, 0.3, 0.5, 0.7, 1.0)
ARRIVAL_RATES = (1, 5, 10, 20, 60, 200, 600, math.inf)


def draw(seed, failure_rate=None):
    """Return whether the visitor may answer by voice, and the test's configuration, both drawn."""
    chance = random.Random("verdicts/{}".format(seed))
    rate = chance.choice(FAILURE_RATES + (round(chance.random(), 2),))
    kinds = chance.choice(((REFUSED,), KINDS, tuple(chance.sample(KINDS, 2))))
    return chance.random() < 0.6, dataclasses.replace(
        CALM, failure_rate=rate if failure_rate is None else failure_rate,
        arrival_rate=chance.choice(ARRIVAL_RATES + (round(10 ** chance.uniform(0, 3), 1),)),
        visitor_behaviour=chance.choice(BEHAVIOURS), random_seed=seed, fault_kinds=kinds,
        mission_runs=chance.choice((1, 1, 1, 3)), test_timeout=36000.0)


@functools.lru_cache(maxsize=None)
def stage(by_voice):
    return Stage(settings.defaults(asrEnabled=by_voice))


@functools.lru_cache(maxsize=None)
def rehearsal(by_voice, behaviour):
    return rehearse_on(stage(by_voice), behaviour)


def play(by_voice, test):
    """Return the facts of one test."""
    played = stage(by_voice).play(test)
    return Facts(played.record(), played.journal, played.exit_code, test.visitor_behaviour, test.mission_runs,
                 stage(by_voice).knowledge, played.cut_off, rehearsal(by_voice, test.visitor_behaviour))


def right(by_voice, test, facts):
    """Return how the run differs from what the policy's text asks; "" if it does not."""
    starts = [event["at"] for event in facts.events if event["event"] == "PassStarted"]
    outcomes = [event["outcome"] for event in facts.events if event["event"] == "PassFinished"]
    pressed = {SILENT: None, DECLINES: False, UNCLEAR: False}.get(test.visitor_behaviour, True)
    return timed_tour.differences(facts.journal, starts, outcomes, by_voice, pressed)


if __name__ == "__main__":
    import time
    n0, n1 = map(int, sys.argv[1:3])
    bad = bad2 = 0
    c = collections.Counter()
    t = time.time()
    tj = 0
    journal.REPEAT = 0.0
    for seed in range(n0, n1):
        facts = play(*draw(seed))
        a = time.time()
        verdict = judge(facts)
        tj += time.time() - a
        if not verdict.passed:
            bad += 1
            print(seed, draw(seed))
            print(verdict)
        told = right(*draw(seed), facts)
        if told:
            print(seed, draw(seed))
            print("model", told)
            bad2 += 1
        c[verdict.passed, draw(seed)[1].failure_rate] += 1
    print(bad, bad2, time.time() - t, tj)
    print(c)
