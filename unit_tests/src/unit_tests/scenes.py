"""The plays of a rehearsal: which visitor, which faults, by voice or tablet; run on all cores, and evaluated."""
import dataclasses
import itertools
import multiprocessing
import multiprocessing.pool
import signal
from typing import Any, Dict, FrozenSet, Iterator, List, Mapping, NamedTuple, Optional, Sequence, Set, Tuple

from behavior_controller.interface.records import Request
from behavior_controller.settings import defaults

from unit_tests import findings, robot
from unit_tests.faults import KINDS, PlannedFault
from unit_tests.findings import Look
from unit_tests.stage import CALM, Played, Stage

MESSAGES = 1.0
"""Seconds between two messages of a topic, or half of ``topicMaxAge`` if less: in a rehearsal no message is late."""

FEW = 60
"""Up to this number of plays run in this process: starting others would take longer."""

CHUNK = 8
"""Plays that a process receives at once."""


NO_VISITOR = "waiting for a visitor"
"""The outcome of a pass in which no visitor is seen."""


BROKEN = "exception"
"""The outcome of a pass that an exception outside the tree ended."""


class Scene(NamedTuple):
    """One play: a visitor, how the visitor answers, and the faults: planned, or random with ``rate`` and ``seed``.

    Seed 0: no random faults.
    """

    visitor: str
    by_voice: bool = True
    planned: Tuple[PlannedFault, ...] = ()
    silent: Tuple[str, ...] = ()
    rate: float = 0.0
    seed: int = 0
    kinds: Tuple[str, ...] = KINDS

    @property
    def is_calm(self) -> bool:
        """Whether the scene has no faults."""
        return not (self.planned or self.silent or self.seed)


class Outcome(NamedTuple):
    """The result of a scene. ``outcome`` is SUCCESS, FAILURE, NO_VISITOR, BROKEN, or empty if the pass did not end."""

    scene: Scene
    outcome: str
    seconds: float
    exhibits: int  # that the robot was sent to
    found: Tuple[Tuple[str, str, str], ...]  # name, place and words of each finding
    reached: FrozenSet[int]
    switched: FrozenSet[Request]  # the requests of the kinds that the safe state sends


class Theatre:
    """A mission on its stages, one for visitors who answer by voice and one for the tablet. Each process has its own."""

    def __init__(self, chosen: Mapping[str, Any], mission: str, limit: float):
        """``chosen`` are the values of the controller's keys; ``limit`` is in seconds of the mission's time."""
        self._chosen, self._mission = dict(chosen), mission
        self._limit = limit
        self._stages: Dict[bool, Stage] = {}
        self._calm: Dict[Tuple[str, bool], str] = {}

    def stage(self, by_voice: bool) -> Stage:
        """Return the stage. Raises FaultsFound if the mission cannot be played."""
        if by_voice not in self._stages:
            self._stages[by_voice] = Stage.of_file(defaults(**dict(self._chosen, asrEnabled=by_voice)), self._mission)
        return self._stages[by_voice]

    def play(self, scene: Scene) -> Look:
        """Play a scene."""
        test = dataclasses.replace(
            CALM, visitor_behaviour=scene.visitor, planned_faults=scene.planned, failure_rate=scene.rate,
            random_seed=scene.seed, fault_kinds=scene.kinds, test_timeout=self._limit)
        stage = self.stage(scene.by_voice)
        gap = min(MESSAGES, stage.settings.topic_max_age / 2)
        played = stage.play(test, scene.silent, robot.usual_seconds, gap)
        faults = sum(line.fault is not None for line in played.journal) + len(scene.silent)
        return Look(stage, played, scene.visitor, faults, "" if scene.is_calm else self._outcome_if_calm(scene))

    def _outcome_if_calm(self, scene: Scene) -> str:
        key = scene.visitor, scene.by_voice
        if key not in self._calm:
            self._calm[key] = self.play(Scene(*key)).outcome
        return self._calm[key]

    def look(self, scene: Scene) -> Outcome:
        """Play a scene and find what is wrong in it."""
        look = self.play(scene)
        kinds = {type(request) for request in look.stage.settings.interface.safe_state}
        switched = frozenset(request for _, request in look.played.asked if type(request) in kinds)
        outcome = look.outcome or (
            BROKEN if look.played.error else NO_VISITOR if findings.waits_for_a_visitor(look) else "")
        return Outcome(scene, outcome, look.played.seconds, findings.visited(look),
                       tuple(findings.look_at(look)), look.played.reached, switched)


# -------------------------------------------------------------------------------------------------------- which scenes


def calm(visitors: Sequence[str], ways: Sequence[bool]) -> List[Scene]:
    """Return the scenes without faults. ``ways``: by voice, by tablet, or both."""
    return [Scene(visitor, by_voice) for by_voice in ways for visitor in visitors]


def calls(played: Played) -> List[Tuple[str, int, str]]:
    """Return node, number and fields of each call of a play."""
    return [(line.node, line.call, repr(sorted(line.content.items()))) for line in played.journal if line.call]


def single(theatre: Theatre, scenes: Sequence[Scene], kinds: Sequence[str]) -> Iterator[Scene]:
    """Yield each of the calm ``scenes`` with each call going wrong in each way, and with each topic silent.

    Scenes by tablet are played only with the calls that the same visitor does not cause by voice. A pass that does not
    end without a fault is not played with one.
    """
    known: Dict[str, Set[Tuple[str, str]]] = {}
    for scene in scenes:
        heard = known.setdefault(scene.visitor, set())
        look = theatre.play(scene)
        if not look.outcome:
            continue
        made = calls(look.played)
        for (node, call, _), kind in itertools.product([each for each in made if (each[0], each[2]) not in heard], kinds):
            yield scene._replace(planned=(PlannedFault(node, call, kind),))
        heard.update((node, fields) for node, _, fields in made)
        for topic in robot.topics(theatre.stage(scene.by_voice).settings.interface):
            yield scene._replace(silent=(topic.name,))


def pairs(theatre: Theatre, scenes: Sequence[Scene], kinds: Sequence[str]) -> Iterator[Scene]:
    """Yield each of the calm ``scenes`` with each pair of calls going wrong, both in the same way.

    The second may be the one that a recovery makes of the first.
    """
    for scene in scenes:
        look = theatre.play(scene)
        if not look.outcome:
            continue
        made = [(node, call) for node, call, _ in calls(look.played)]
        twice = sorted({((node, call), (node, call + 1)) for node, call in made}.union(itertools.combinations(made, 2)))
        for (first, second), kind in itertools.product(twice, kinds):
            yield scene._replace(planned=(PlannedFault(*first, kind), PlannedFault(*second, kind)))


def random(scenes: Sequence[Scene], runs: int, rates: Sequence[float], seed: int, kinds: Sequence[str]) -> List[Scene]:
    """Return that many scenes for each failure rate, with the visitors in turn and a seed for each run."""
    return [scenes[run % len(scenes)]._replace(rate=rate, seed=seed + run, kinds=tuple(kinds))
            for rate in rates for run in range(runs)]


# ------------------------------------------------------------------------------------------------------ on all cores


_theatre: Optional[Theatre] = None


def _open(*arguments: Any) -> None:
    """Prepare a process for its plays."""
    global _theatre
    _theatre = Theatre(*arguments)


def _look(scene: Scene) -> Outcome:
    assert _theatre is not None
    return _theatre.look(scene)


def play_all(theatre: Theatre, arguments: Tuple[Any, ...], scenes: Sequence[Scene], jobs: int) -> Iterator[Outcome]:
    """Yield the result of each scene as soon as it is known. ``arguments`` make another Theatre of the same mission."""
    if jobs <= 1 or len(scenes) <= FEW:
        yield from map(theatre.look, scenes)
        return
    # Ctrl-C is for this process; the others inherit that they ignore it, else each would print a traceback
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        pool = multiprocessing.get_context("spawn").Pool(jobs, _open, arguments)
    finally:
        signal.signal(signal.SIGINT, before)
    with pool:
        yield from pool.imap_unordered(_look, scenes, CHUNK)
