#!/usr/bin/env python3
"""Judge many tours in virtual time, each with its own settings, and compare every verdict with an independent model.

``verdicts.py [--settings N] [--seed N]``. A setting is drawn: failureRate 0 to 1, arrivalRate 1 to inf, the visitor,
voice or tablet, the kinds of faults, the number of visitors. A verdict is right if it is PASSED where ``timed_tour``
says that the run was as the policy's text asks, and FAILED where it was not. A fiftieth as many seeds are tried with
each controller of ``broken``, at the failure rates 0.3 and 0.5; there FAILED is right for what only the record shows
too. Exit code 0 if every verdict is right.
"""
import argparse
import collections
import contextlib
import dataclasses
import functools
import math
import multiprocessing
import os
import random
import sys

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.realpath(__file__))))  # the workspace links here
sys.path[:0] = [os.path.dirname(os.path.abspath(__file__)), os.path.join(ROOT, "src"),
                os.path.join(ROOT, "unit_tests", "src"), os.path.join(ROOT, "unit_tests", "test", "rostest")]

import broken  # noqa: E402
import timed_tour  # noqa: E402
from behavior_controller import settings  # noqa: E402
from behavior_controller.leaves.base import Attempt  # noqa: E402
from behavior_controller.leaves.knowledge import SelectExhibit  # noqa: E402
from behavior_controller.leaves.recovery import HandleFallBack  # noqa: E402
from behavior_controller.recovery import Recovery  # noqa: E402
from unit_tests import journal  # noqa: E402
from unit_tests.facts import Facts  # noqa: E402
from unit_tests.faults import KINDS, REFUSED  # noqa: E402
from unit_tests.rehearsal import rehearse_on  # noqa: E402
from unit_tests.stage import CALM, Stage  # noqa: E402
from unit_tests.verdict import judge  # noqa: E402
from unit_tests.visitor import BEHAVIOURS, DECLINES, ENGAGES, SILENT, UNCLEAR  # noqa: E402

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
    """Return the facts of one test, with all messages in the journal: the model wants every one."""
    kept, journal.REPEAT = journal.REPEAT, 0.0
    try:
        return _facts(by_voice, test)
    finally:
        journal.REPEAT = kept


def thinned(facts):
    """Return the facts with a journal as the nodes of a test write it."""
    told = collections.defaultdict(journal.Told)
    return facts._replace(journal=[line for line in facts.journal
                                   if line.call or told[line.resource].is_due(line.content, line.time)])


def _facts(by_voice, test):
    played = stage(by_voice).play(test)
    return Facts(played.record(), played.journal, played.exit_code, test.visitor_behaviour, test.mission_runs,
                 stage(by_voice).knowledge, played.cut_off, rehearsal(by_voice, test.visitor_behaviour))


def difference(by_voice, test, facts):
    """Return how the run differs from what the policy's text asks; "" if it does not."""
    starts = [event["at"] for event in facts.events if event["event"] == "PassStarted"]
    outcomes = [event["outcome"] for event in facts.events if event["event"] == "PassFinished"]
    pressed = {SILENT: None, DECLINES: False, UNCLEAR: False}.get(test.visitor_behaviour, True)
    if len(outcomes) != test.mission_runs:
        return "there were {} passes".format(len(outcomes))
    return timed_tour.differences(facts.journal, starts, outcomes, by_voice, pressed)


@contextlib.contextmanager
def spoilt(code):
    """Have the controller spoilt by ``code`` meanwhile."""
    kept = [(kind, dict(vars(kind))) for kind in (Attempt, HandleFallBack, SelectExhibit, Recovery)]
    exec(code, {})
    try:
        yield
    finally:
        for kind, attributes in kept:
            for name in set(vars(kind)) - set(attributes):
                delattr(kind, name)
            for name, value in attributes.items():
                if vars(kind)[name] is not value:
                    setattr(kind, name, value)


class Tally:
    """How many runs there were, what their verdicts were, and which of those are wrong."""

    def __init__(self, is_spoilt):
        self._is_spoilt = is_spoilt
        self.verdicts = collections.Counter()  # (failure rate in tenths, outcome of the verdict)
        self.differing = 0  # runs that differ from what the policy's text asks
        self.wrong = []

    def take(self, by_voice, test):
        """Play, judge, and compare."""
        facts = play(by_voice, test)
        verdict, told = judge(thinned(facts)), difference(by_voice, test, facts)
        self.verdicts[test.failure_rate, verdict.passed] += 1
        self.differing += bool(told)
        if verdict.passed if told else not verdict.passed and not self._is_spoilt:
            self.wrong.append("{} by {}: the model says {!r}; {}".format(
                test, "voice" if by_voice else "tablet", told, verdict))

    def add(self, other):
        self.verdicts += other.verdicts
        self.differing += other.differing
        self.wrong += other.wrong

    def __str__(self):
        return "{} tours, {} of them not as the policy asks; {} verdicts were FAILED, {} verdicts are wrong".format(
            sum(self.verdicts.values()), self.differing,
            sum(number for (_, passed), number in self.verdicts.items() if not passed), len(self.wrong))


def try_settings(seeds, failure_rates=(None,), is_spoilt=False):
    """Return the tally of one tour for each seed and failure rate; None: drawn."""
    tally = Tally(is_spoilt)
    for seed in seeds:
        for rate in failure_rates:
            by_voice, test = draw(seed, rate)
            if is_spoilt:  # with a visitor who brings it to its mistake
                test = dataclasses.replace(test, visitor_behaviour=ENGAGES, arrival_rate=600.0)
            tally.take(by_voice, test)
    return tally


CHUNK = 50
"""Seeds that one process tries before it tells of them."""


def _try_chunk(task):
    name, seeds = task
    if not name:
        return name, try_settings(seeds)
    with spoilt(broken.ALL[name]):
        return name, try_settings(seeds, (0.3, 0.5), True)


def run(number, seed):
    """Try so many settings from a seed on, on all cores, print what came of it, and return what is wrong."""
    ends = {"": seed + number, **dict.fromkeys(broken.ALL, seed + max(CHUNK, number // 50))}
    tasks = [(name, range(first, min(first + CHUNK, end))) for name, end in ends.items()
             for first in range(seed, end, CHUNK)]
    tallies = {name: Tally(bool(name)) for name in ends}
    with multiprocessing.Pool() as pool:
        for done, (name, tally) in enumerate(pool.imap_unordered(_try_chunk, tasks), 1):
            tallies[name].add(tally)
            if done % 20 == 0:
                print("{} of {} parts; {}".format(done, len(tasks), tallies[""]), flush=True)
    wrong = []
    for name, tally in tallies.items():
        print("{}: {}".format(name.lower().replace("_", " ") or "the controller", tally), flush=True)
        wrong += tally.wrong + ([] if bool(tally.differing) is bool(name) else [
            "{} differs {}".format(name or "the controller", "nowhere" if name else "from the model")])
    print("FAILED at failureRate {}".format(", ".join("{:g}: {} of {}".format(
        rate, tallies[""].verdicts[rate, False], tallies[""].verdicts[rate, False] + tallies[""].verdicts[rate, True])
        for rate in FAILURE_RATES)), flush=True)
    print("".join("  {}\n".format(each) for each in wrong), end="", flush=True)
    return wrong


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--settings", type=int, default=10000)
    parser.add_argument("--seed", type=int, default=1)
    chosen = parser.parse_args()
    sys.exit(1 if run(chosen.settings, chosen.seed) else 0)
