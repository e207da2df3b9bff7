"""Tries the judge of a test in virtual time: controllers with one mistake each, which it has to
fail, and the sound controller under many settings, which it must not.

``sharpness``: each breakage of ``breakages`` is played at the failure rates 0 and 0.2, with one
visitor after the other, until the run differs visibly from that of the sound controller. What does
not under any visitor is listed with the reason: nothing differs ("nowhere"), or it differs in times
that a busy machine may have too, less than ``facts.LATE``, or in requests that left no trace
("unseen"). ``soundness``: drawn settings of the sound controller. A breakage also holds while the
verdict is made: the judge runs beside the product, and a mistake in what both use must not hide
itself.

``python3 test/soak/judge_trials.py broken --only 'text that' --stage 'lab tour by voice' --why``
repeats a part and prints the verdicts.
"""
import argparse
import collections
import contextlib
import dataclasses
import functools
import itertools
import math
import multiprocessing
import os
import random
import sys
from typing import (
    Any, Callable, Dict, FrozenSet, Iterator, List, NamedTuple, Optional, Sequence, Tuple)
from unittest import mock

# the workspace links here
ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.realpath(__file__))))
sys.path[:0] = [os.path.dirname(os.path.abspath(__file__)),
                os.path.join(ROOT, "src"),
                os.path.join(ROOT, "unit_tests", "src")]

from breakages import ON_PURPOSE, Breakage, Catalogue, Needs, breakages  # noqa: E402
from behavior_controller import exit_codes  # noqa: E402
from behavior_controller.config import recovery_policy, settings  # noqa: E402
from behavior_controller.run.events import (  # noqa: E402
    EntriesWritten, LeafFinished, Message, Noticed, Recovered, Recovering, Retried, StepStarted,
    Tick)
from behavior_controller.robot.gateway import Cause  # noqa: E402
from behavior_controller.text import Source, count  # noqa: E402
from unit_tests.judge.facts import LATE_TOLERANCE, Facts  # noqa: E402
from unit_tests.judge.verdict import Verdict  # noqa: E402
from behavior_controller.simulation.behaviour import OPTIONAL  # noqa: E402
from behavior_controller.simulation.faults import KINDS, REFUSED  # noqa: E402
from behavior_controller.simulation.rehearsal.play import (  # noqa: E402
    CALM, LoadedMission, RunResult)
from behavior_controller.simulation.visitor import BEHAVIOURS, ENGAGES  # noqa: E402
from behavior_controller.simulation.configuration import NONE, REAL, Configuration  # noqa: E402

RELEASE = {"robotInterface": "release-1.0", "scenarioSpecification": "release_1_0_tour"}
STAGES: Dict[str, Dict[str, Any]] = {
    "lab tour by voice": {"asrEnabled": True},
    "lab tour by tablet": {"asrEnabled": False},
    "release 1.0 by voice": dict(RELEASE, asrEnabled=True),
    "release 1.0 by tablet": dict(RELEASE, asrEnabled=False, tabletSuccessIs="yes"),
    "reception by voice": {"scenarioSpecification": "reception", "asrEnabled": True},
    "release 1.0 reception by voice": dict(
        RELEASE, scenarioSpecification="release_1_0_reception", asrEnabled=True)}


@functools.lru_cache(maxsize=None)
def stage(name: str) -> LoadedMission:
    return LoadedMission(settings.defaults(**STAGES[name]))


def verdict_on(on: LoadedMission, test: Configuration, played: RunResult) -> Tuple[str, ...]:
    """Return the objections of the judge to a play; none: PASSED."""
    facts = Facts(played.run(), played.journal, played.exit_code, test, on.world_of(test),
                  on.mission, played.cut_off, has_timed_out=played.has_timed_out)
    return Verdict(facts).objections


# --------------------------------------------------------------------------------------- sharpness


RATES = (0.0, 0.2)
SEEDS = 3
"""How many seeds are tried with each visitor where calls fail."""

PACE = 120.0
"""Messages per minute on each topic."""

LIMIT = 1500.0
"""Seconds of the clock until a play is cut off."""


def tests(rate: float, seed: int) -> Iterator[Configuration]:
    """Yield the tests that may show a mistake: one visitor of each kind, then some in a row."""
    plans = [(behaviour, seed + number, 1) for number in range(SEEDS if rate else 1)
             for behaviour in BEHAVIOURS] + [(ENGAGES, seed, 5 if rate else 2)]
    for behaviour, number, runs in plans:
        yield dataclasses.replace(
            CALM, arrival_rate=PACE, visitor_behaviour=behaviour, failure_rate=rate,
            random_seed=number, fault_kinds=KINDS, mission_runs=runs, test_timeout=LIMIT * runs)


class Sound(NamedTuple):
    """A play of the sound controller, and what its leaves did, as breakages need it."""

    played: RunResult
    happened: FrozenSet[Needs]
    objections: Tuple[str, ...]


@functools.lru_cache(maxsize=None)
def sound(name: str, test: Configuration) -> Sound:
    played = stage(name).play(test)
    happened = {(event.node, event.path, getattr(event, "status", ""))
                for _, event in played.events if isinstance(event, (LeafFinished, StepStarted))}
    happened |= {(node, path, "") for node, path, _ in happened}
    happened |= {(node, "", status) for node, _, status in happened}
    return Sound(played, frozenset(happened), verdict_on(stage(name), test, played))


@functools.lru_cache(maxsize=None)
def family(name: str, seed: int) -> Tuple[Breakage, ...]:
    """Return the breakages of a stage; by tablet without those of leaves that run by voice too."""
    known = Catalogue()
    with known.watching():
        for rate in RATES:
            for test in tests(rate, seed):
                stage(name).play(test)
    found = breakages(known)
    if "by tablet" in name:
        voice = name.replace("by tablet", "by voice")
        ran = {need for rate in RATES for test in tests(rate, seed)
               for need in sound(voice, test).happened}
        found = [breakage for breakage in found if breakage.needs not in ran]
    return tuple(found)


class Outcome(NamedTuple):
    """What became of a breakage at one failure rate."""

    stage: str
    family: str
    what: str
    rate: float
    shown: str = ""  # in what the run differs from the sound one; empty: nowhere
    objections: Tuple[str, ...] = ()
    is_named: bool = False
    test: Optional[Configuration] = None
    unseen: str = ""  # why neither record nor journal can show it
    plays: int = 0  # that might have shown it

    @property
    def is_visible(self) -> bool:
        """Whether the run tells it from the sound controller's."""
        return bool(self.shown) and not self.unseen

    @property
    def why_nowhere(self) -> str:
        """Why nothing shows it."""
        if not self.plays:
            return "no visitor and no fault brings about what it needs"
        return "in {} requests, times, journal, record and exit code are as they were".format(
            count(self.plays, "play", "plays"))


NEAR = 0.001
"""Seconds by which the times of two plays may differ, since events at one moment are put in order.
"""


def essence(event: Any) -> Any:
    """Return what counts of an event: neither sentences nor times, which the line has."""
    if isinstance(event, (Message, Noticed, StepStarted)):
        return None  # what was read first when, and sentences for people
    if isinstance(event, EntriesWritten):
        return sorted(event.entries, key=str)  # in which order is not said
    if isinstance(event, (LeafFinished, Recovered, Recovering, Retried)):
        cause = event.failure.cause if event.failure is not None else None
        if isinstance(event, LeafFinished) and cause is Cause.CONDITION_FALSE:
            return None  # reported once in a wait, in another one more often
        return type(event), event.path, cause, getattr(event, "status", ""), \
            getattr(event, "outcome", "")
    return tuple(getattr(event, name) for name in event.__struct_fields__
                 if name not in ("at", "seconds", "arrived"))


def recorded(played: RunResult) -> Iterator[Tuple[float, Any]]:
    """Yield what counts of a record; a traversal after which all is as it was before does not."""
    statuses: Dict[int, str] = {}
    for at, event in played.events:
        if isinstance(event, Tick):
            before, statuses = statuses, {**statuses, **dict(event.changes)}
            if all(before.get(uid, "-") == letter for uid, letter in statuses.items()):
                continue
        if essence(event):
            yield at, essence(event)


Timed = Sequence[Tuple[float, Any]]


def first_difference(one: Timed, other: Timed) -> str:
    """Return where two lists of things with their times differ first; empty: nowhere."""
    nothing = math.inf, None
    for (at, mine), (then, its) in itertools.zip_longest(one, other, fillvalue=nothing):
        if mine != its or abs(at - then) > NEAR:
            return "{:.3f} {}, and not {:.3f} {}".format(then, its, at, mine)
    return ""


ASPECTS: Dict[str, Callable[[RunResult], Timed]] = {
    "requests": lambda played: [(0.0, request) for _, request in played.asked],
    "exit code": lambda played: [(0.0, played.exit_code)],
    "times": lambda played: played.asked,
    "journal": lambda played: [(line.time, line[1:]) for line in played.journal],
    "record": lambda played: list(recorded(played))}
"""In what a run can differ from another: first what tells most about the robot."""


def difference(sound: RunResult, broken: RunResult) -> str:
    """Return in what two plays differ and where first; empty: in nothing that counts."""
    for name, aspect in ASPECTS.items():
        found = first_difference(aspect(sound), aspect(broken))
        if found:
            return "{}: {}".format(name, found)
    return ""


def unseen(sound: RunResult, broken: RunResult) -> str:
    """Return why neither record nor journal can show a difference of two plays; empty: they can."""
    differing = [name for name, aspect in ASPECTS.items()
                 if first_difference(aspect(sound), aspect(broken))]
    if not {"exit code", "journal", "record"} & set(differing):
        return "what was sent reached no node, and is not on record"
    end = sound.events[-1][0] - LATE_TOLERANCE
    if differing == ["record"] and not first_difference(*(
        [(at, event) for at, event in recorded(played) if at < end] for played in (sound, broken))):
        return "the record ends within {:g} s of the difference".format(LATE_TOLERANCE)
    is_fine = difference(sound, broken).startswith("times") and all(
        abs(at - then) < LATE_TOLERANCE for (at, _), (then, _) in zip(sound.asked, broken.asked))
    return "the times differ by less than {:g} s".format(LATE_TOLERANCE) if is_fine else ""


def attempt(name: str, breakage: Breakage, rate: float, seed: int) -> Outcome:
    """Play a breakage until it is visible, and judge that play."""
    found, plays = Outcome(name, breakage.family, str(breakage), rate), 0
    for test in tests(rate, seed):
        well = sound(name, test)
        if well.objections or breakage.needs and breakage.needs not in well.happened:
            continue
        plays += 1
        with breakage.broken():
            played = stage(name).play(test)
            is_broken = played.exit_code == exit_codes.BROKEN
            if is_broken and ON_PURPOSE not in played.errors[-1][1]:
                raise RuntimeError("{} cannot be made: {}".format(breakage, played.errors[-1][1]))
            shown = difference(well.played, played)
            if shown:
                try:
                    told = verdict_on(stage(name), test, played)
                except Exception as error:  # a judge that fails has not judged
                    return found._replace(shown="the judge raised {!r}".format(error), test=test)
                found = found._replace(
                    shown=shown, objections=told, test=test,
                    is_named=any(word in text for word in breakage.names for text in told),
                    unseen="" if told else unseen(well.played, played))
                if found.is_visible:
                    break
    return found._replace(plays=plays)


def _attempt(task: Tuple[str, int, float, int]) -> Outcome:
    name, number, rate, seed = task
    return attempt(name, family(name, seed)[number], rate, seed)


def chosen(seed: int, most: Optional[int] = None, only: str = "", names: Sequence[str] = ()
           ) -> List[Tuple[str, int, float, int]]:
    """Return the trials to make; at most ``most`` breakages, each family's in proportion, others
    with another seed."""
    all_of = [(name, number) for name in names or STAGES
              for number, breakage in enumerate(family(name, seed)) if only in str(breakage)]
    if most is not None and most < len(all_of):
        all_of.sort(key=lambda one: (family(one[0], seed)[one[1]].family, one))
        step, first = len(all_of) / most, seed * 0.618 % 1
        all_of = [all_of[int((number + first) * step)] for number in range(most)]
    return [(name, number, rate, seed) for name, number in all_of for rate in RATES]


def sharpness(trials: Sequence[Tuple[str, int, float, int]], jobs: Optional[int] = None
              ) -> List[Outcome]:
    """Make the trials, on ``jobs`` processes, and return what became of them."""
    if jobs == 1:
        return list(map(_attempt, trials))
    outcomes = []
    with multiprocessing.Pool(jobs) as pool:
        for outcome in pool.imap(_attempt, trials, chunksize=8):
            outcomes.append(outcome)
            if len(outcomes) % 500 == 0:
                print("{} of {} plays judged".format(len(outcomes), len(trials)), file=sys.stderr)
    return outcomes


def table(outcomes: Sequence[Outcome]) -> Iterator[str]:
    """Yield the lines of the table of families, and of the sum."""
    yield "{:12} {:>6} {}".format("family", "made", "".join(
        "  at rate {:<4}{:>6}{:>8}{:>7}".format(rate, "shown", "FAILED", "named")
        for rate in RATES))
    families: Dict[str, List[Outcome]] = collections.OrderedDict()
    for outcome in outcomes:
        families.setdefault(outcome.family, []).append(outcome)
    for name, found in list(families.items()) + [("all", list(outcomes))]:
        yield "{:12} {:>6} {}".format(name, len(found) // len(RATES), "".join(
            "  {:12}{:>6}{:>8}{:>7}".format("", *_counts(found, rate)) for rate in RATES))


def _counts(outcomes: Sequence[Outcome], rate: float) -> Tuple[int, int, int]:
    shown = [outcome for outcome in outcomes if outcome.rate == rate and outcome.is_visible]
    failed = [outcome for outcome in shown if outcome.objections]
    return len(shown), len(failed), sum(outcome.is_named for outcome in failed)


def report(outcomes: Sequence[Outcome], why: bool = False) -> Iterator[str]:
    """Yield the table, and each breakage that passed, or whose node was not named."""
    yield from table(outcomes)
    for rate in RATES:
        shown, failed, named = _counts(outcomes, rate)
        yield "rate {:g}: {:.2f} % FAILED, {:.2f} % with the node named".format(
            rate, 100 * failed / max(1, shown), 100 * named / max(1, shown))
    for outcome in outcomes:
        if outcome.shown and not outcome.objections:
            yield "{} {:g} {}: {} [{}]; {}what differs: {:.200}".format(
                "unseen  " if outcome.unseen else "PASSED  ", outcome.rate, outcome.stage,
                outcome.what, _test(outcome.test), outcome.unseen and outcome.unseen + "; ",
                outcome.shown)
        elif outcome.shown and (why or not outcome.is_named):
            yield "{} {:g} {}: {} [{}]: {}".format(
                "FAILED  " if outcome.is_named else "no name ", outcome.rate, outcome.stage,
                outcome.what, _test(outcome.test), " | ".join(outcome.objections[:3]))
    shown = {(outcome.stage, outcome.what) for outcome in outcomes if outcome.shown}
    for outcome in outcomes:
        if outcome.rate == RATES[-1] and (outcome.stage, outcome.what) not in shown:
            yield "nowhere  {}: {}; {}".format(outcome.stage, outcome.what, outcome.why_nowhere)


def _test(test: Optional[Configuration]) -> str:
    return "" if test is None else "{}, {} runs, seed {}".format(
        test.visitor_behaviour, test.mission_runs, test.random_seed)


# --------------------------------------------------------------------------------------- soundness


FAILURE_RATES = (0.0, 0.05, 0.1, 0.2, 0.3, 0.5, 0.7, 1.0)
ARRIVAL_RATES = (1, 5, 10, 20, 60, 200, 600, math.inf)
POLICY = "recoveryPolicy.ini"


MISSIONS = {(False, "tour"): "lab_tour", (True, "tour"): "release_1_0_tour",
            (False, "reception"): "reception", (True, "reception"): "release_1_0_reception"}
"""The delivered missions: for a robot of release 1.0 or not, and what the robot does in them."""


class Setting(NamedTuple):
    """One drawn setting: the controller's, the policy's text, and the test's."""

    chosen: Tuple[Tuple[str, Any], ...]
    policy: str
    test: Configuration


def draw(seed: int) -> Setting:
    """Return the setting of a seed."""
    chance = random.Random("judge/{}".format(seed))
    by_voice, is_release = chance.random() < 0.6, chance.random() < 0.4
    mission = chance.choice(("tour", "reception"))
    configuration = dict(RELEASE) if is_release else {}
    configuration["scenarioSpecification"] = MISSIONS[is_release, mission]
    configuration["asrEnabled"] = by_voice
    if is_release:
        configuration["tabletSuccessIs"] = chance.choice(("yes", "done"))
    test = dataclasses.replace(
        CALM, failure_rate=chance.choice(FAILURE_RATES + (round(chance.random(), 2),)),
        arrival_rate=chance.choice(ARRIVAL_RATES + (round(10 ** chance.uniform(0, 3), 1),)),
        visitor_behaviour=chance.choice(BEHAVIOURS), random_seed=seed,
        fault_kinds=chance.choice(((REFUSED,), KINDS, tuple(chance.sample(KINDS, 2)))),
        mission_runs=chance.choice((1, 1, 1, 3)), test_timeout=3000.0,
        call_times=(REAL, NONE)[seed % 2])
    if is_release:
        test = dataclasses.replace(
            test, recognise_by=chance.choice(("topic", "action")),
            absent_services=tuple(chance.sample(OPTIONAL, chance.choice((0, 0, 1)))))
    return Setting(tuple(configuration.items()), drawn_policy(chance), test)


def drawn_policy(chance: random.Random) -> str:
    """Return the delivered policy, or one with other numbers."""
    with open(os.path.join(ROOT, "config", POLICY), encoding="utf-8") as file:
        text = file.read()
    if chance.random() < 0.6:
        return text
    lines = []
    for line in text.splitlines():
        words = line.split("#")[0].split()
        if words[:1] == ["budget"]:
            line = "budget {} {}".format(chance.choice((1, 3, 30)), chance.choice((60, 600)))
        elif len(words) == 5 and chance.random() < 0.5:
            words[2:4] = [str(chance.randrange(4)), str(chance.choice((0.1, 0.5, 2)))]
            if words[4] == "skip":
                words[4] = chance.choice(("skip", "giveUp"))
            line = " ".join(words)
        lines.append(line)
    return "\n".join(lines) + "\n"


@contextlib.contextmanager
def with_policy(text: str) -> Iterator[None]:
    """Have missions loaded with the policy of ``text``."""
    source = Source(os.path.join(ROOT, "config", POLICY), text)
    with mock.patch.object(recovery_policy, "load",
                           lambda path, specs: recovery_policy.read(source, specs)):
        yield


def judged(setting: Setting) -> Tuple[str, ...]:
    """Return what the judge objects to the sound controller in a setting."""
    with with_policy(setting.policy):
        on = LoadedMission(settings.defaults(**dict(setting.chosen)))
        return verdict_on(on, setting.test, on.play(setting.test))


def _judged(seed: int) -> Tuple[int, Tuple[str, ...]]:
    return seed, judged(draw(seed))


def soundness(seeds: Sequence[int], jobs: Optional[int] = None
              ) -> List[Tuple[int, Tuple[str, ...]]]:
    """Return the seeds at which the judge fails the sound controller, with the objections."""
    if jobs == 1:
        return [found for found in map(_judged, seeds) if found[1]]
    with multiprocessing.Pool(jobs) as pool:
        return [found for found in pool.imap(_judged, seeds, chunksize=20) if found[1]]


# -------------------------------------------------------------------------------------- the command


def run_broken(seed: int, most: Optional[int] = None, only: str = "", names: Sequence[str] = (),
               jobs: Optional[int] = None, why: bool = False) -> List[str]:
    """Try the judge's sharpness, print the table, and return what passed."""
    outcomes = sharpness(chosen(seed, most, only, names), jobs)
    print("\n".join(report(outcomes, why)), flush=True)
    return [outcome.what for outcome in outcomes if outcome.is_visible and not outcome.objections]


def run_sound(seed: int, number: int, jobs: Optional[int] = None) -> List[str]:
    """Try the judge's soundness, print what is wrong, and return it."""
    wrong = ["seed {}: {}".format(at, " | ".join(objections[:3]))
             for at, objections in soundness(range(seed, seed + number), jobs)]
    print("the sound controller: {} settings from seed {} on, {} judged FAILED".format(
        number, seed, len(wrong)))
    print("".join("  {}\n".format(line) for line in wrong), end="", flush=True)
    return wrong


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("trial", choices=["broken", "sound"])
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--number", type=int, help="settings, or breakages at most")
    parser.add_argument("--only", default="", metavar="WORDS",
                        help="breakages with these words in their description")
    parser.add_argument("--stage", action="append", choices=list(STAGES), default=[])
    parser.add_argument("--jobs", type=int)
    parser.add_argument("--why", action="store_true", help="print every verdict")
    given = parser.parse_args()
    if given.trial == "broken":
        wrong = run_broken(given.seed, given.number, given.only, given.stage, given.jobs, given.why)
    else:
        wrong = run_sound(given.seed, given.number or 10000, given.jobs)
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
