"""The summary of a rehearsal: outcomes for each visitor, findings with their shortest play, shares
of success."""
import math
import shlex
from collections import Counter
from typing import Any, Dict, FrozenSet, List, NamedTuple, Optional, Sequence, Set, Tuple

from msgspec.structs import replace

from behavior_controller.robot.requests import Request
from behavior_controller.monitoring.story import Sentence, Story
from behavior_controller.text import clean, count

from unit_tests.rehearsal import findings
from unit_tests.rehearsal.findings import Finding, FindingKind
from unit_tests.rehearsal.plays import NO_VISITOR, Outcome, Scene, Theatre
from unit_tests.rehearsal.search import Search, verdict
from unit_tests.robot.faults import KINDS
from unit_tests.rehearsal.play import START
from unit_tests.robot.visitor import BEHAVIOURS, ENGAGES

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
    scene: Optional[Scene] = None
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


class Share(NamedTuple):
    """The runs at one failure rate and how many of them succeeded."""

    rate: float
    runs: int
    successes: int
    seconds: float  # of a pass that ended, on average

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

    def __init__(self, theatre: Theatre, by_voice: bool = True, chosen: Sequence[str] = ()):
        """``by_voice``: the stage whose tree gives the nodes their places; ``chosen`` are the
        arguments of the command that are the same for all plays."""
        self.theatre = theatre
        self._stage = theatre.stage(by_voice)
        self._nodes = self._stage.mission.tree.nodes
        self._chosen = chosen
        self.plays = 0
        self._outcomes: List[Outcome] = []
        self._shortest: Dict[Key, Tuple[Outcome, Finding]] = {}
        self._plays_of: Dict[Key, Set[int]] = {}
        self.reached: Set[int] = set()  # the uids of nodes
        self._calmly: Set[int] = set()  # reached without a fault
        self._succeeded: Set[int] = set()
        self._switched: Dict[Request, int] = {}

    def take(self, outcome: Outcome) -> None:
        """Add the result of a scene."""
        self._outcomes.append(
            outcome._replace(findings=(), calls=(), reached=_NONE, succeeded=_NONE))
        self.reached |= outcome.reached
        if outcome.scene.is_calm:
            self._calmly |= outcome.reached
        self._succeeded |= outcome.succeeded
        self._switched.update(outcome.switched)
        for finding in outcome.findings:
            key = finding.kind, self.place(finding.uid)
            self._plays_of.setdefault(key, set()).add(self.plays)
            known = self._shortest.get(key)
            if known is None or _length(outcome) < _length(known[0]):
                self._shortest[key] = outcome, finding
        self.plays += 1

    @property
    def has_ended(self) -> bool:
        """Whether each pass without faults ended: else nothing is known of what comes after."""
        return all(outcome.outcome for outcome in self._calm)

    @property
    def _calm(self) -> List[Outcome]:
        return [outcome for outcome in self._outcomes if outcome.scene.is_calm]

    def whole(self, search: Optional[Search]) -> List[Finding]:
        """Return what only all plays together show, if each visitor and each fault was played, and
        ``search`` has planned faults towards the nodes that they do not reach."""
        if not self.has_ended:
            return []
        of_all = self._never_succeeds() + self._one_way()
        if search is None:
            return of_all
        of_all += findings.never_true(self._nodes, self._calmly, self._succeeded)
        of_all += findings.never_off(self._stage, self._switched)
        return of_all + [Finding(findings.UNREACHED.name, node.uid, verdict(search, self.plays))
                         for node in search.targets()]

    def _never_succeeds(self) -> List[Finding]:
        """Return the finding that no visitor's pass succeeds without a fault, if all were played.
        """
        visitors = {outcome.scene.visitor for outcome in self._calm}
        outcomes = {outcome.outcome for outcome in self._calm}
        if visitors != set(BEHAVIOURS) or outcomes & {"SUCCESS", NO_VISITOR}:
            return []
        return [Finding(findings.NEVER_SUCCEEDS.name, findings.ROOT,
                        f"each of {count(len(self._calm), 'pass', 'passes')} fails")]

    def _one_way(self) -> List[Finding]:
        """Return the finding that voice and tablet lead a visitor who engages to other stops, on a
        robot that understands both."""
        stops = {outcome.scene.by_voice: dict(outcome.stops) for outcome in self._calm
                 if outcome.scene.visitor == ENGAGES}
        if len(stops) < 2 or not self._stage.settings.tablet_tells:
            return []
        one_way = []
        for by_voice, way in ((True, "tablet"), (False, "voice")):
            missed = [name for name in stops[by_voice] if name not in stops[not by_voice]]
            if missed:
                what = f"by {way} the robot does not come to {', '.join(missed)}"
                one_way.append(Finding(findings.ONE_WAY.name, stops[by_voice][missed[0]], what))
        return one_way

    def findings(self, search: Optional[Search] = None) -> List[FindingSummary]:
        """Return the findings, those of one kind together, each with its consequences."""
        every = {key: self._of_play(key) for key in self._shortest}
        places = {place for _, place in every}
        for finding in self.whole(search):
            key = finding.kind, self.place(finding.uid)
            if key[1] not in places or finding.uid == findings.ROOT:
                every.setdefault(key, self._summary(finding))
        order = list(findings.BY_NAME)
        keys = sorted(every, key=lambda key: (order.index(key[0]), every[key].seconds,
                                              every[key].where))
        below: Dict[Key, List[FindingSummary]] = {}
        for key in keys:
            cause = next((other for other in below
                          if other[0] in findings.CAUSES and self._follows(key, other)), None)
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
        if other not in self._plays_of:  # the mission never comes to its proper end
            return key[0] != other[0]
        engaged = {number for number, outcome in enumerate(self._outcomes)
                   if outcome.scene.is_calm and outcome.scene.visitor == ENGAGES}
        plays, others = self._plays_of.get(key, engaged), self._plays_of[other]
        if key[0] == findings.ONE_WAY.name:  # of the plays of one way
            return not plays.isdisjoint(others)
        return bool(plays) and plays <= others

    def _of_play(self, key: Key) -> FindingSummary:
        outcome, finding = self._shortest[key]
        return self._summary(finding)._replace(
            plays=len(self._plays_of[key]), scene=outcome.scene, seconds=outcome.seconds,
            story=shortened(self.story(outcome.scene)), command=self.command(outcome.scene))

    def _summary(self, finding: Finding) -> FindingSummary:
        where = clean(self._nodes[finding.uid - 1].full_path)
        return FindingSummary(findings.BY_NAME[finding.kind], where, self.place(finding.uid),
                              finding.what)

    def place(self, uid: int) -> str:
        """Return file, line and column of a node."""
        element = self._nodes[uid - 1].element
        return "{}:{}:{}".format(clean(element.document.file), *element.place())

    def story(self, scene: Scene) -> Tuple[Sentence, ...]:
        """Return the sentences of a play; their times are seconds from its beginning."""
        story = Story()
        return tuple(replace(sentence, at=sentence.at - START)
                     for line in self.theatre.play(scene).run.lines
                     for sentence in story.take(line.time, line.event))

    def command(self, scene: Scene) -> str:
        """Return the command that plays a scene again."""
        words = ["rosrun", "unit_tests", "rehearseMission", *self._chosen, "--visitors",
                 scene.visitor]
        if scene.seed:
            words += ["--runs", "1", "--failureRate", f"{scene.rate:g}", "--seed", str(scene.seed)]
            words += ["--kinds", ",".join(scene.kinds)] if scene.kinds != KINDS else []
        elif scene.is_calm:
            words += ["--faults", "none"]
        if scene.planned:
            words += ["--planned", ",".join(map(str, scene.planned))]
        if scene.silent:
            words += ["--silent", ",".join(scene.silent)]
        words.append("asrEnabled:=" + ("true" if scene.by_voice else "false"))
        return " ".join(map(shlex.quote, words))

    def rows(self) -> List[VisitorRow]:
        """Return the outcomes for each visitor."""
        rows = []
        for calm in self._calm:
            counted = Counter(
                outcome.outcome for outcome in self._outcomes
                if not outcome.scene.is_calm and outcome.scene[:2] == calm.scene[:2])
            rows.append(VisitorRow(calm.scene.visitor, calm.scene.by_voice, calm.outcome,
                                   calm.seconds, len(calm.stops), tuple(sorted(counted.items()))))
        return rows

    def shares(self) -> List[Share]:
        """Return the share of successes for each failure rate, of the plays with random faults."""
        rates = sorted({outcome.scene.rate for outcome in self._outcomes if outcome.scene.seed})
        return [_share(rate, [outcome for outcome in self._outcomes if outcome.scene.rate == rate])
                for rate in rates]


def shortened(story: Sequence[Sentence]) -> Tuple[Sentence, ...]:
    """Return a story that a person reads: of a long one the beginning and the end."""
    left_out = len(story) - MOST_SENTENCES
    if left_out <= 0:
        return tuple(story)
    half = MOST_SENTENCES // 2
    gap = replace(story[half], text=f"… {count(left_out, 'sentence', 'sentences')} more …")
    return (*story[:half], gap, *story[-half:])


def _length(outcome: Outcome) -> Tuple[Any, ...]:
    """Return the key by which the shortest play sorts first; of equals, the first declared visitor
    and kind of fault."""
    scene = outcome.scene
    lasting = [fault for fault in scene.planned if fault.is_lasting]
    return (scene.rate > 0, len(scene.planned + scene.silent), len(lasting),
            round(outcome.seconds), BEHAVIOURS.index(scene.visitor), not scene.by_voice,
            [KINDS.index(fault.kind) for fault in scene.planned], scene)


def _share(rate: float, outcomes: Sequence[Outcome]) -> Share:
    seconds = [outcome.seconds for outcome in outcomes if outcome.outcome]
    return Share(rate, len(outcomes), sum(outcome.outcome == "SUCCESS" for outcome in outcomes),
                 sum(seconds) / len(seconds) if seconds else math.nan)
