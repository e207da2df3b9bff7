"""The plays of a rehearsal: which visitor, which faults, by voice or tablet; run on all cores, and
evaluated."""
import dataclasses
import itertools
import multiprocessing
import signal
from contextlib import ExitStack, contextmanager
from functools import lru_cache
from multiprocessing.pool import Pool
from typing import (Any, Callable, Dict, FrozenSet, Iterable, Iterator, List, Mapping, NamedTuple,
                    Optional, Sequence, Set, Tuple)

from behavior_controller.bt.engine.node import Node
from behavior_controller.bt.loader.document import read, with_includes
from behavior_controller.config.node_facts import MissionSpec
from behavior_controller.config.settings import defaults
from behavior_controller.folders import mission_name
from behavior_controller.interpreter import garbage_collection_paused
from behavior_controller.robot.declarations import Sense
from behavior_controller.robot.requests import Prompt, Request
from behavior_controller.text import clean, count

from behavior_controller.simulation.rehearsal import findings
from behavior_controller.simulation.rehearsal.findings import (
    TIME_TOLERANCE, Finding, Play, RobotCall)
from behavior_controller.simulation.faults import CRASH, KINDS, PlannedFault
from behavior_controller.simulation.journal import JournalEntry
from behavior_controller.simulation.rehearsal.play import CALM, LoadedMission, Place, RunResult
from behavior_controller.simulation.configuration import REAL, SEEDS
from behavior_controller.simulation.visitor import BEHAVIOURS, ENGAGES, HABITS

MESSAGE_INTERVAL = 1.0
"""Seconds between two messages of a topic, or half of ``topicMaxAge`` if less: in a rehearsal no
message is late."""

FEW = 60
"""Up to this number of plays run in this process: starting others would take longer."""

PLAYS_PER_TASK = 8
"""Plays that a process receives at once."""

MOST_PLAYS = 400
"""Plays towards all nodes together."""

MOST_BASES = 12
"""Plays that get a further fault for a node in one round."""

BURSTS = (2, 3, 4)
"""The numbers of calls in a row that go wrong where nothing says which ones have to."""

MOST_VISITORS = 4
"""Visitors in a row at most."""

MOST_LEFT = 24
"""What passes leave behind that is tried with further visitors, at most so many times."""

ENDS = ("SUCCESS", "FAILURE")
"""The outcomes of a pass that has ended."""

WAYS = {True: "voice", False: "tablet"}
"""How a visitor answers, by whether that is by voice."""

NO_VISITOR = "waiting for a visitor"
"""The outcome of a pass in which no visitor is seen."""


class Scenario(NamedTuple):
    """One play: a visitor, how the visitor answers, and the faults: planned, or random with
    ``rate`` and ``seed`` (0: no random faults)."""

    visitor: str
    by_voice: bool = True
    planned: Tuple[PlannedFault, ...] = ()
    silent: Tuple[str, ...] = ()
    rate: float = 0.0
    seed: int = 0
    kinds: Tuple[str, ...] = KINDS
    is_traced: bool = False  # its calls are wanted, however many faults it has
    quick: Tuple[str, ...] = ()  # nodes whose calls take no time
    then: Tuple[str, ...] = ()  # visitors after this one; what is found is about the last of them

    @property
    def is_faultless(self) -> bool:
        """Whether nothing goes wrong in the scene, planned or at random."""
        return not (self.planned or self.silent or self.rate or self.then)

    @property
    def is_calm(self) -> bool:
        """Whether the scene has no faults, none are drawn for it, and calls take their time."""
        return self.is_faultless and not (self.seed or self.quick)

    @property
    def is_listed(self) -> bool:
        """Whether its calls are wanted."""
        return self.is_traced or len(self.planned) < 2 and not self.seed

    @property
    def may_have_successors(self) -> bool:
        """Whether what goes wrong is over when the last visitor goes."""
        goes_on = any(fault.is_lasting or fault.kind == CRASH for fault in self.planned)
        return not (goes_on or self.silent or self.quick or self.seed) \
            and len(self.then) < MOST_VISITORS - 1

    @property
    def calm(self) -> "Scenario":
        """The same without faults, and without visitors before."""
        return Scenario((self.visitor, *self.then)[-1], self.by_voice)

    @property
    def words(self) -> str:
        """How it differs from the others, in one line."""
        wrong = [*map(str, self.planned), *(f"{name} silent" for name in self.silent)]
        wrong += [f"{name} quick" for name in self.quick]
        if self.seed:
            wrong.append(f"failure rate {self.rate:g}, seed {self.seed}")
        visitors = ", then ".join((self.visitor, *self.then))
        return f"visitor {visitors}, by {WAYS[self.by_voice]}, {', '.join(wrong) or 'no fault'}"

    def with_fault(self, fault: PlannedFault) -> "Scenario":
        """Return the scene with a further planned fault; those that last stand last."""
        planned = sorted((*self.planned, fault), key=lambda planned: planned.is_lasting)
        return self._replace(planned=tuple(planned))


class Outcome(NamedTuple):
    """The result of a scene. ``outcome`` is SUCCESS, FAILURE, NO_VISITOR, or empty if the pass did
    not end.
    """

    scene: Scenario
    outcome: str
    seconds: float
    stops: Tuple[Tuple[str, int], ...]  # that the robot was sent to, with the leaf that did it
    findings: Tuple[Finding, ...]
    reached: FrozenSet[int]
    succeeded: FrozenSet[int]  # the leaves
    # the requests of the kinds that the safe state sends, with a leaf that makes each
    switched: Tuple[Tuple[Request, int], ...]
    calls: Tuple[RobotCall, ...] = ()
    last: FrozenSet[str] = frozenset()  # nodes with a call that did not end before that of another
    left_behind: bytes = b""  # for the next visitor: see ``Situations``
    unmet: Tuple[PlannedFault, ...] = ()  # planned, and no visitor in turn causes that call

    def rank(self) -> Tuple[Any, ...]:
        """Return the key by which the shortest play sorts first; of equals, the first declared
        visitor and kind of fault."""
        scene = self.scene
        return (scene.rate > 0, len(scene.planned + scene.silent + scene.quick + scene.then),
                sum(fault.is_lasting for fault in scene.planned), round(self.seconds),
                BEHAVIOURS.index(scene.visitor), not scene.by_voice,
                [KINDS.index(fault.kind) for fault in scene.planned], scene)


class ScenarioRunner:
    """A mission on its stages, one for visitors who answer by voice and one for the tablet. Each
    process has its own."""

    def __init__(self, chosen: Mapping[str, Any], mission: str, limit: float,
                 for_pairs: bool = False):
        """``chosen`` are the values of the controller's keys, ``mission`` is a file; ``limit`` is
        in seconds of the mission's time; ``for_pairs``: ``pairs`` needs what the calls meet."""
        self.chosen, self.mission, self.limit = dict(chosen), mission, limit
        self.for_pairs = for_pairs
        self.stage: Callable[[bool], LoadedMission] = lru_cache(maxsize=None)(self._stage)
        """Returns the stage, by voice or not. Raises FaultsFound if it cannot be played."""
        self._calm_play: Callable[[Scenario], Play] = lru_cache(maxsize=None)(self.play)

    @property
    def visitors(self) -> Tuple[str, ...]:
        """The kinds of visitors that make a difference: one kind alone if the mission neither sees
        nor hears visitors, nor has them press a button."""
        specs = [node.spec for node in self.stage(True).mission.tree.nodes
                 if isinstance(node.spec, MissionSpec)]
        meets = any(isinstance(sign, Sense) for spec in specs for sign in spec.listens) or any(
            issubclass(kind, Prompt) for spec in specs for kind in spec.calls)
        return BEHAVIOURS if meets else (ENGAGES,)

    @property
    def ways(self) -> Tuple[bool, ...]:
        """By voice or not, as far as that makes a difference."""
        is_asked = any(node.spec.setting for node in self.stage(True).mission.tree.nodes
                       if isinstance(node.spec, MissionSpec))
        if is_asked or len(self.visitors) > 1:
            return True, False
        return (True,)

    def __reduce__(self) -> Tuple[Any, ...]:
        """Have another process make its own from the same arguments, once."""
        return _of_process, (tuple(self.chosen.items()), self.mission, self.limit, self.for_pairs)

    def _stage(self, by_voice: bool) -> LoadedMission:
        own = dict(asrEnabled=by_voice, scenarioSpecification=mission_name(self.mission))
        return LoadedMission(defaults(**{**self.chosen, **own}), with_includes(read(self.mission)))

    def play(self, scene: Scenario) -> Play:
        """Play a scene."""
        test = dataclasses.replace(
            CALM, visitor_behaviour=scene.visitor, planned_faults=scene.planned,
            quick_nodes=scene.quick, failure_rate=scene.rate, random_seed=scene.seed,
            fault_kinds=scene.kinds, test_timeout=self.limit, call_times=REAL)
        stage, silent = self.stage(scene.by_voice), scene.silent
        robot = stage.settings.interface
        if not stage.settings.asr_enabled and robot.tells(Sense.UTTERANCE):
            silent += (robot.evidence(Sense.UTTERANCE).topic.name,)  # no speech is recognised
        gap = min(MESSAGE_INTERVAL, stage.settings.topic_max_age / 2)
        has_situations = self.for_pairs and scene.is_listed
        played = stage.play(test, silent, gap, has_situations, scene.then).last_pass()
        faults = sum(line.fault is not None for line in played.journal) + len(scene.silent)
        calm = None if scene.is_calm else self._calm_play(scene.calm)
        return Play(stage, played, scene.calm.visitor, faults, calm, len(scene.then))

    def evaluate(self, scene: Scenario) -> Outcome:
        """Play a scene and find what is wrong in it."""
        with garbage_collection_paused():
            play = self.play(scene)
            outcome = play.outcome or (NO_VISITOR if findings.waits_for_a_visitor(play) else "")
            return Outcome(scene, outcome, play.played.seconds,
                           tuple((clean(place.name), uid) for place, uid in play.stops.items()),
                           tuple(findings.findings(play)), play.played.reached, play.succeeded,
                           tuple(play.switched.items()),
                           tuple(play.calls()) if scene.is_listed else (),
                           _last(play.played) if scene.is_calm else frozenset(),
                           play.played.left_behind, play.played.unmet)


def _last(played: RunResult) -> FrozenSet[str]:
    """Return the nodes with a call that began before that of another node ended, and did not end
    before it."""
    def outlasts(one: JournalEntry, other: JournalEntry) -> bool:
        ended = other.time + other.seconds
        return max(one.time, other.time) < ended <= one.time + one.seconds + TIME_TOLERANCE

    calls = [line for line in played.journal if line.call and line.time <= played.ended]
    return frozenset(one.node for one, other in itertools.permutations(calls, 2)
                     if one.node != other.node and outlasts(one, other))


# ------------------------------------------------------------------------------------- which scenes


def single(outcomes: Sequence[Outcome], kinds: Sequence[str], topics: Sequence[str],
           is_every: bool = False) -> Iterator[Scenario]:
    """Yield the scenes of the calm ``outcomes`` with each call going wrong in each way, with each
    leaf's service going wrong for good from its first call on, and with each topic silent.

    Left out are calls that the same visitor causes in an earlier one, unless ``is_every``: what is
    asked by tablet is mostly what is asked by voice. A pass that does not end without a fault is
    not played with one.
    """
    known: Set[Tuple[str, str, str]] = set()
    for outcome in outcomes:
        scene = outcome.scene
        if outcome.outcome not in ENDS:
            continue
        asked = [(call, (scene.visitor, call.node, call.fields)) for call in outcome.calls]
        leaves: Set[int] = set()
        for call in (call for call, what in asked if is_every or what not in known):
            fault = PlannedFault(call.node, call.number, kinds[0])
            yield from (scene.with_fault(fault._replace(kind=kind)) for kind in kinds)
            if call.uid not in leaves:
                leaves.add(call.uid)
                yield scene.with_fault(fault._replace(is_lasting=True))
        yield from (scene._replace(silent=(topic,)) for topic in topics)
        known.update(what for _, what in asked)


def pairs(outcomes: Sequence[Outcome], kinds: Sequence[str]) -> Iterator[Scenario]:
    """Yield the scenes with each pair of faults, given the ``outcomes`` of the calm scenes and of
    all scenes with a single fault.

    The second fault is at any later call of the play with the first one, also at its repetition by
    a recovery. Left out is a call that meets the same situation as one of another play, without
    a fault or with another first one: the mission would go on as there.
    """
    met = {(outcome.scene, call.node, call.fields, call.situation)
           for outcome in outcomes if outcome.scene.is_calm for call in outcome.calls}
    for outcome in outcomes:
        single = [fault for fault in outcome.scene.planned if not fault.is_lasting]
        if not single or not outcome.outcome:
            continue
        first = [call[:2] for call in outcome.calls].index(single[0][:2])
        for call in outcome.calls[first + 1:]:
            key = outcome.scene.calm, call.node, call.fields, call.situation
            if key not in met:
                met.add(key)
                for kind in kinds:
                    yield outcome.scene.with_fault(PlannedFault(call.node, call.number, kind))


def orders(outcomes: Sequence[Outcome]) -> Iterator[Scenario]:
    """Yield the scenes in which of two calls under way at once the other one ends first."""
    met: Set[Tuple[str, str]] = set()
    for outcome in outcomes:
        for node in sorted(outcome.last):
            if (outcome.scene.visitor, node) not in met:
                met.add((outcome.scene.visitor, node))
                yield outcome.scene._replace(quick=(node,))


def successors(outcomes: Sequence[Outcome]) -> Iterator[List[Scenario]]:
    """Yield rounds of scenes in which each visitor of the calm ``outcomes`` comes after what a pass
    has left behind that no pass before has left; ``outcomes`` grow with each round."""
    visitors = dict.fromkeys(outcome.scene.visitor for outcome in outcomes if outcome.scene.is_calm)
    met: Set[Tuple[bool, bytes]] = set()
    while True:
        scenes: List[Scenario] = []
        for outcome in sorted(outcomes, key=Outcome.rank):
            scene, key = outcome.scene, (outcome.scene.by_voice, outcome.left_behind)
            if outcome.outcome in ENDS and scene.may_have_successors and key not in met \
                    and len(met) < MOST_LEFT:
                met.add(key)
                scenes += [scene._replace(then=(*scene.then, visitor)) for visitor in visitors]
        if not scenes:
            return
        yield scenes


def random(scenes: Sequence[Scenario], runs: int, rates: Sequence[float], seed: int,
           kinds: Sequence[str]) -> List[Scenario]:
    """Return that many scenes for each failure rate, with the visitors in turn and a seed for each
    run; after the last seed comes 1."""
    return [scenes[run % len(scenes)]._replace(
                rate=rate, seed=(seed + run - 1) % SEEDS + 1, kinds=tuple(kinds))
            for rate in rates for run in range(runs)]


# -------------------------------------------------------------------------------------- the search


class Search:
    """Plans plays in rounds, from the ``outcomes`` so far: a play that comes as far as the sibling
    before a node gets a further fault below that sibling, until the sibling fails.

    ``plays`` is the number of planned plays. ``is_cut``: more could have been tried.
    """

    def __init__(self, nodes: List[Node], reached: Set[int], outcomes: List[Outcome], kind: str):
        """``reached`` and ``outcomes`` grow with each round that is played."""
        self._nodes, self._reached, self._outcomes = nodes, reached, outcomes
        self._kind = kind
        self._tried: Set[Scenario] = set()
        self._bases: Set[Tuple[int, Scenario]] = set()
        self.plays, self.is_cut = 0, False

    def targets(self) -> List[Node]:
        """Return the nodes to search for, which no play has reached; of a whole branch only the
        topmost, of nodes that follow one another only the first.

        A tree that is called several times is one part of the file: one call that reaches a node is
        enough. None is a recovery from a step that cannot fail.
        """
        known = {node.element for node in self._nodes if node.uid in self._reached}
        asked = {call.uid for outcome in self._outcomes for call in outcome.calls}
        targets = []
        for node in self._nodes:
            before = _sibling_before(node)
            is_first = before is None or before.uid in self._reached
            is_top = node.parent is None or node.parent.uid in self._reached
            may_be_needed = not node.spec.is_recovery or _below(before) & asked
            if node.element not in known and is_top and is_first and may_be_needed:
                targets.append(node)
        return targets

    def unreached(self) -> Iterator[Place]:
        """Yield the nodes that are still not reached, and in words how sure it is that no play
        reaches them."""
        runs = count(len(self._outcomes), "simulated run")
        for node in self.targets():
            what = f"no visitor and no fault brings the mission here, in {runs}"
            if self.is_cut:
                what = f"not reached by {runs}"
            yield node.uid, what + _habit(node)

    def rounds(self) -> Iterator[List[Scenario]]:
        """Yield the scenes of each round."""
        yield from self._towards()
        if self.targets():
            yield self._new(self._bursts())
            yield from self._towards()

    def _towards(self) -> Iterator[List[Scenario]]:
        while True:
            scenes = self._new(scene for node in self.targets() for scene in self._extended(node))
            if not scenes:
                return
            yield scenes

    def _new(self, scenes: Iterable[Scenario]) -> List[Scenario]:
        new = [scene for scene in dict.fromkeys(scenes) if scene not in self._tried]
        chosen = new[:MOST_PLAYS - self.plays]
        self.is_cut = self.is_cut or len(chosen) < len(new)
        self._tried.update(chosen)
        self.plays += len(chosen)
        return chosen

    def _extended(self, node: Node) -> Iterator[Scenario]:
        """Yield the nearest plays that end before ``node``, with a further fault below its sibling.
        """
        before = _sibling_before(node)
        below = _below(before)
        near = [outcome for outcome in self._outcomes
                if before is not None and before.uid in outcome.reached
                and outcome.calls and (node.uid, outcome.scene) not in self._bases]
        for outcome in sorted(near, key=Outcome.rank)[:MOST_BASES]:
            self._bases.add((node.uid, outcome.scene))
            scene = outcome.scene._replace(is_traced=True)
            for call in outcome.calls:
                if call.uid in below and call.is_done:
                    fault = PlannedFault(call.node, call.number, self._kind)
                    yield scene.with_fault(fault)
                    yield scene.with_fault(fault._replace(is_lasting=True))

    def _bursts(self) -> Iterator[Scenario]:
        """Yield, for a visitor who engages, several faults in a row from each leaf's first call on,
        and each two services that go wrong for good."""
        for outcome in self._outcomes:
            scene = outcome.scene._replace(is_traced=True)
            if not outcome.scene.is_calm or scene.visitor != ENGAGES:
                continue
            first: Dict[int, PlannedFault] = {}
            for call in outcome.calls:
                first.setdefault(call.uid, PlannedFault(call.node, call.number, self._kind))
            for fault in first.values():
                for length in BURSTS:
                    burst = (fault._replace(call=fault.call + later) for later in range(length))
                    yield scene._replace(planned=tuple(burst))
            nodes = {fault.node: fault for fault in reversed(list(first.values()))}  # their first
            lasting = (fault._replace(is_lasting=True) for fault in nodes.values())
            for pair in itertools.combinations(sorted(lasting), 2):
                yield scene._replace(planned=pair)


def _sibling_before(node: Node) -> Optional[Node]:
    """Return the sibling after which a node is ticked; None if it does not wait for another."""
    parent = node.parent
    if parent is None or not parent.spec.advances_on or parent.children[0] is node:
        return None
    return parent.children[parent.children.index(node) - 1]


def _habit(node: Node) -> str:
    """Return what simulated visitors always do and others may not, if the way to a node leads past
    a sign of the visitor."""
    before: Any = _sibling_before(node)
    if before is None:
        return ""
    senses = (sense for each in before.iterate() for sense in getattr(each.spec, "listens", ()))
    habit = next((HABITS[sense] for sense in senses if sense in HABITS), "")
    return habit and f"; a simulated visitor {habit}"


def _below(node: Any) -> Set[int]:
    if node is None:
        return set()
    return {below.uid for below in node.iterate()}


# ------------------------------------------------------------------------------------- on all cores


@lru_cache(maxsize=1)
def _of_process(chosen: Tuple[Tuple[str, Any], ...], *more: Any) -> ScenarioRunner:
    return ScenarioRunner(dict(chosen), *more)


@contextmanager
def players(runner: ScenarioRunner, jobs: int
            ) -> Iterator[Callable[[Sequence[Scenario]], Iterator[Outcome]]]:
    """Give a function that yields the result of each scenario as soon as it is known."""
    with ExitStack() as processes:
        pool = lru_cache()(lambda: processes.enter_context(_pool(jobs)))

        def play_all(scenarios: Sequence[Scenario]) -> Iterator[Outcome]:
            if jobs <= 1 or len(scenarios) <= FEW:
                return map(runner.evaluate, scenarios)
            return pool().imap_unordered(runner.evaluate, scenarios, PLAYS_PER_TASK)

        yield play_all


def _pool(jobs: int) -> Pool:
    # Ctrl-C is for this process; the others inherit that they ignore it, else each would print a
    # traceback
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        return multiprocessing.get_context("spawn").Pool(jobs)
    finally:
        signal.signal(signal.SIGINT, before)
