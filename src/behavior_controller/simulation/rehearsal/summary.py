"""The summary of a rehearsal: outcomes for each visitor, findings with their shortest play, shares
of success."""
import math
import shlex
from collections import Counter
from typing import Dict, FrozenSet, Iterator, List, NamedTuple, Optional, Sequence, Set, Tuple

from msgspec.structs import replace

from behavior_controller.config.node_facts import MissionSpec
from behavior_controller.leaves.base import MissionLeaf
from behavior_controller.run.story import Sentence, Story
from behavior_controller.robot.declarations import Topic
from behavior_controller.text import clean, count

from behavior_controller.simulation.rehearsal import findings
from behavior_controller.simulation.rehearsal.findings import Finding, FindingKind
from behavior_controller.simulation.rehearsal.plays import (
    NO_VISITOR, Outcome, Scenario, Search, ScenarioRunner)
from behavior_controller.simulation.faults import KINDS
from behavior_controller.simulation.rehearsal.play import START, Place
from behavior_controller.simulation.visitor import BEHAVIOURS, ENGAGES

Z = 1.96
"""Standard deviations on each side of an interval that holds the true share in 95 of 100 cases."""

MOST_SENTENCES = 40
"""Sentences of a story that are shown."""

_NONE: FrozenSet[int] = frozenset()

Key = Tuple[str, str]
"""The kind of a finding and its place."""


class FindingSummary(NamedTuple):
    """A finding: what, where and how often; the shortest play with it, None if only all plays
    together show it. ``consequences`` are other findings that are gone without this one."""

    kind: FindingKind
    where: str  # the path of the node
    place: str  # file:line:column
    what: str
    plays: int = 0
    scene: Optional[Scenario] = None
    seconds: float = 0.0
    story: Tuple[Sentence, ...] = ()
    command: str = ""
    consequences: Tuple["FindingSummary", ...] = ()


class VisitorRow(NamedTuple):
    """The outcome of a visitor's pass without faults, and the number of each outcome with faults.
    """

    visitor: str
    by_voice: bool
    outcome: str
    seconds: float
    stops: int
    with_faults: Tuple[Tuple[str, int], ...]


class SimulatedRun(NamedTuple):
    """One play: how it ended (empty: it did not), after how many seconds, how it differs from the
    others, and the command that plays it again."""

    outcome: str
    seconds: float
    words: str
    command: str


class Share(NamedTuple):
    """The runs at one failure rate and how many of them succeeded."""

    rate: float
    runs: int
    successes: int
    seconds: Optional[float]  # of a pass that ended, on average; None: none did

    @property
    def share(self) -> float:
        return self.successes / self.runs

    @property
    def interval(self) -> Tuple[float, float]:
        """Wilson's interval: 95 of 100 such intervals contain the true share."""
        p, n = self.share, self.runs
        centre = (p + Z * Z / (2 * n)) / (1 + Z * Z / n)
        half = Z / (1 + Z * Z / n) * math.sqrt(p * (1 - p) / n + Z * Z / (4 * n * n))
        return max(0.0, centre - half), min(1.0, centre + half)


class Survey:
    """Collects the results of the plays."""

    def __init__(self, runner: ScenarioRunner, by_voice: bool, chosen: Sequence[str]):
        """``by_voice``: the stage whose tree gives the nodes their places; ``chosen`` are the
        arguments of the command that are the same for all plays."""
        self._runner, self._chosen = runner, chosen
        self._stage = runner.stage(by_voice)
        self.nodes = self._stage.mission.tree.nodes
        self.outcomes: List[Outcome] = []
        self._found: Dict[Key, Dict[int, Finding]] = {}  # by the number of the play
        self.reached: Set[int] = set()  # the uids of nodes
        self._succeeded: Set[int] = set()

    def take(self, outcome: Outcome) -> None:
        """Add the result of a scene."""
        self.reached |= outcome.reached
        self._succeeded |= outcome.succeeded
        for finding in outcome.findings:
            plays = self._found.setdefault((finding.kind, self.place(finding.uid)), {})
            plays.setdefault(len(self.outcomes), finding)
        # of the many others only the end is needed
        self.outcomes.append(outcome if outcome.calls or outcome.scene.is_calm else
                             outcome._replace(findings=(), reached=_NONE, succeeded=_NONE))

    @property
    def has_ended(self) -> bool:
        """Whether each pass without faults ended: else nothing is known of what comes after."""
        return all(outcome.outcome for outcome in self._calm)

    @property
    def _calm(self) -> List[Outcome]:
        return [outcome for outcome in self.outcomes if outcome.scene.is_calm]

    def _whole(self, search: Optional[Search]) -> Iterator[Tuple[FindingKind, Place]]:
        """Yield what only all plays together show, if each visitor and each fault was played, and
        ``search`` has planned faults towards the nodes that they do not reach."""
        detectors = {findings.NEVER_SUCCEEDS: self._never_succeeds,
                     findings.NEVER_ASKED: self._never_asked, findings.ONE_WAY: self._one_way}
        if search is not None:
            detectors.update({findings.NEVER_TRUE: self._never_true,
                              findings.NEVER_OFF: self._never_off,
                              findings.UNREACHED: search.unreached})
        if self.has_ended:
            for kind, detect in detectors.items():
                yield from ((kind, place) for place in detect())

    def _never_succeeds(self) -> Iterator[Place]:
        """Find that no pass succeeds without a fault, if all visitors were played, or if the one
        who engages was in runs at failure rate 0."""
        passes = [outcome for outcome in self.outcomes if outcome.scene.is_faultless]
        visitors = {outcome.scene.visitor for outcome in self._calm}
        is_run = any(outcome.scene.seed and outcome.scene.visitor == ENGAGES for outcome in passes)
        if (visitors >= set(self._runner.visitors) or is_run) and \
                {outcome.outcome for outcome in passes}.isdisjoint({"SUCCESS", NO_VISITOR, ""}):
            yield findings.ROOT, f"each of {count(len(passes), 'pass', 'passes')} fails"

    def _one_way(self) -> Iterator[Place]:
        """Find that voice and tablet lead a visitor who engages to other stops, on a robot that
        understands both."""
        stops = {outcome.scene.by_voice: dict(outcome.stops) for outcome in self._calm
                 if outcome.scene.visitor == ENGAGES}
        if len(stops) == 2 and self._stage.settings.tablet_tells:
            for by_voice, way in ((True, "tablet"), (False, "voice")):
                missed = [name for name in stops[by_voice] if name not in stops[not by_voice]]
                if missed:
                    what = f"by {way} the robot does not come to {', '.join(missed)}"
                    yield stops[by_voice][missed[0]], what

    def _never_asked(self) -> Iterator[Place]:
        """Find the first node of each type that no policy may skip and that no calm pass reaches,
        if all visitors were played, by voice and by tablet."""
        scenes = {outcome.scene for outcome in self._calm if outcome.outcome != NO_VISITOR}
        if len(scenes) < 2 * len(BEHAVIOURS):
            return
        reached = {self.nodes[uid - 1].spec.id for outcome in self._calm for uid in outcome.reached}
        for node in {node.spec.id: node for node in reversed(self.nodes)}.values():
            if isinstance(node.spec, MissionSpec) and node.spec.is_indispensable \
                    and node.spec.id not in reached:
                yield node.uid, "without a fault, no visitor brings the mission here"

    def _never_true(self) -> Iterator[Place]:
        """Find the leaves that were reached in a pass without faults and have never succeeded.

        A condition on a topic that is not simulated is none of them.
        """
        failed = {uid for outcome in self._calm for uid in outcome.reached} - self._succeeded
        for node in self.nodes:
            if node.uid in failed and isinstance(node, MissionLeaf) and not node.spec.is_recovery \
                    and not any(isinstance(topic, Topic) and topic.simulated_value is None
                                for topic in node.spec.listens):
                yield node.uid, "it never succeeds"

    def _never_off(self) -> Iterator[Place]:
        """Find what the mission switches on, and no play has switched off."""
        switched = {request: uid for outcome in self.outcomes for request, uid in outcome.switched}
        for safe in self._stage.settings.interface.safe_state:
            others = [uid for request, uid in switched.items() if type(request) is type(safe)]
            if others and safe not in switched:
                yield others[0] or findings.ROOT, f"{safe.switches} is never switched off"

    def findings(self, search: Optional[Search] = None) -> List[FindingSummary]:
        """Return the findings, those of one kind together, each with its consequences."""
        every = {key: self._of_play(key) for key in self._found}
        places = {place for _, place in every}
        for kind, (uid, what) in self._whole(search):
            key = kind.name, self.place(uid)
            if key[1] not in places or uid == findings.ROOT:
                every.setdefault(key, self._summary(Finding(kind.name, uid, what)))
        order = list(findings.KIND_BY_NAME)
        keys = sorted(every, key=lambda key: (order.index(key[0]), every[key].seconds,
                                              every[key].where))
        below: Dict[Key, List[FindingSummary]] = {}
        for key in keys:
            causes = (other for other in below if other[0] in findings.CAUSING_KINDS)
            cause = next((other for other in causes if self._follows(key, other)), None)
            if cause is None:
                below[key] = []
            else:
                below[cause].append(every[key])
        return [every[key]._replace(consequences=tuple(others)) for key, others in below.items()]

    def _follows(self, key: Key, other: Key) -> bool:
        """Return whether a finding may be there because of another one: it is at the same place, or
        in no play without the other."""
        if key[1] == other[1]:
            return True
        if other not in self._found:  # the mission never comes to its proper end
            return key[0] != other[0]
        engaged = {number for number, outcome in enumerate(self.outcomes)
                   if outcome.scene.is_calm and outcome.scene.visitor == ENGAGES}
        plays, others = set(self._found.get(key, engaged)), set(self._found[other])
        if key[0] == findings.ONE_WAY.name:  # of the plays of one way
            return not plays.isdisjoint(others)
        return bool(plays) and plays <= others

    def _of_play(self, key: Key) -> FindingSummary:
        plays = self._found[key]
        shortest = min(plays, key=lambda number: self.outcomes[number].rank())
        scene = self.outcomes[shortest].scene
        return self._summary(plays[shortest])._replace(
            plays=len(plays), scene=scene, seconds=self.outcomes[shortest].seconds,
            story=shortened(self.story(scene)), command=self.command(scene))

    def _summary(self, finding: Finding) -> FindingSummary:
        where = clean(self.nodes[finding.uid - 1].full_path)
        return FindingSummary(findings.KIND_BY_NAME[finding.kind], where, self.place(finding.uid),
                              finding.what)

    def place(self, uid: int) -> str:
        """Return file, line and column of a node."""
        return self.nodes[uid - 1].element.where()

    def story(self, scene: Scenario) -> Tuple[Sentence, ...]:
        """Return the sentences of a play; their times are seconds from its beginning."""
        story = Story()
        return tuple(replace(sentence, at=sentence.at - START)
                     for line in self._runner.play(scene).run.lines
                     for sentence in story.take(line.time, line.event))

    def command(self, scene: Scenario) -> str:
        """Return the command that plays a scene again."""
        words = ["rosrun", "cssr_system", "rehearseMission", *self._chosen, "--visitors",
                 scene.visitor]
        if scene.seed:
            words += ["--runs", "1", "--failureRate", repr(scene.rate), "--seed", str(scene.seed)]
            words += ["--kinds", ",".join(scene.kinds)] if scene.kinds != KINDS else []
        elif scene.is_calm:
            words += ["--faults", "none"]
        for option in ("planned", "silent", "then", "quick"):
            if getattr(scene, option):
                words += ["--" + option, ",".join(map(str, getattr(scene, option)))]
        words.append("asrEnabled:=" + str(scene.by_voice).lower())
        return " ".join(map(shlex.quote, words))

    def rows(self) -> List[VisitorRow]:
        """Return the outcomes for each visitor."""
        rows = []
        for calm in self._calm:
            counted = Counter(
                outcome.outcome for outcome in self.outcomes if outcome.scene[:2] == calm.scene[:2]
                and not outcome.scene.is_calm and not outcome.scene.then)
            rows.append(VisitorRow(calm.scene.visitor, calm.scene.by_voice, calm.outcome,
                                   calm.seconds, len(calm.stops), tuple(sorted(counted.items()))))
        return rows

    def runs(self) -> Dict[str, List[SimulatedRun]]:
        """Return all plays by their end, in the order in which they were played."""
        runs: Dict[str, List[SimulatedRun]] = {}
        for outcome in self.outcomes:
            scene = outcome.scene
            runs.setdefault(outcome.outcome, []).append(SimulatedRun(
                outcome.outcome, outcome.seconds, scene.words, self.command(scene)))
        return runs

    def shares(self) -> List[Share]:
        """Return the share of successes for each failure rate, of the plays with random faults."""
        shares = []
        for rate in sorted({outcome.scene.rate for outcome in self.outcomes if outcome.scene.seed}):
            runs = [outcome for outcome in self.outcomes if outcome.scene.rate == rate]
            seconds = [outcome.seconds for outcome in runs if outcome.outcome]
            shares.append(Share(rate, len(runs), sum(run.outcome == "SUCCESS" for run in runs),
                                sum(seconds) / len(seconds) if seconds else None))
        return shares


def shortened(story: Sequence[Sentence]) -> Tuple[Sentence, ...]:
    """Return a story that a person reads: of a long one the beginning and the end."""
    left_out = len(story) - MOST_SENTENCES
    if left_out <= 0:
        return tuple(story)
    half = MOST_SENTENCES // 2
    gap = replace(story[half], text=f"… {count(left_out, 'sentence')} more …")
    return (*story[:half], gap, *story[-half:])
