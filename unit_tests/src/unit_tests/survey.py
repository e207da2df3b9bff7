"""The summary of a rehearsal: outcomes for each visitor, findings with their shortest play, shares of success."""
import math
import shlex
from collections import Counter
from dataclasses import dataclass, field
from typing import Any, Dict, Iterable, List, NamedTuple, Optional, Sequence, Set, Tuple

from behavior_controller.interface.records import Request
from behavior_controller.story import Sentence, Story
from behavior_controller.text import clean

from unit_tests import findings
from unit_tests.faults import KINDS
from unit_tests.findings import Kind
from unit_tests.scenes import Outcome, Scene, Theatre
from unit_tests.stage import START
from unit_tests.visitor import BEHAVIOURS

Z = 1.96
"""Standard deviations on each side of an interval that holds the true share in 95 of 100 cases."""


class Found(NamedTuple):
    """A finding: what, where and how often; the shortest play with it, None if only all plays together show it."""

    kind: Kind
    where: str
    place: str  # file:line:column of the node, if it is one
    what: str
    plays: int
    scene: Optional[Scene]
    seconds: float
    story: Tuple[Sentence, ...]
    command: str


class Row(NamedTuple):
    """The outcome of a visitor's pass without faults, and the number of each outcome with faults."""

    visitor: str
    by_voice: bool
    outcome: str
    seconds: float
    exhibits: int
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


@dataclass
class Survey:
    """Collects the results of the plays."""

    theatre: Theatre
    chosen: Sequence[str] = ()  # arguments of the command that are the same for all plays
    plays: int = 0
    _outcomes: List[Tuple[Scene, str, float, int]] = field(default_factory=list)
    _shortest: Dict[Tuple[str, str], Tuple[Outcome, str]] = field(default_factory=dict)
    _often: "Counter[Tuple[str, str]]" = field(default_factory=Counter)
    _reached: Set[int] = field(default_factory=set)
    _switched: Set[Request] = field(default_factory=set)

    def take(self, outcome: Outcome) -> None:
        """Add the result of a scene."""
        self.plays += 1
        self._outcomes.append((outcome.scene, outcome.outcome, outcome.seconds, outcome.exhibits))
        self._reached |= outcome.reached
        self._switched |= outcome.switched
        for name, where, what in outcome.found:
            self._often[name, where] += 1
            known = self._shortest.get((name, where))
            if known is None or _length(outcome) < _length(known[0]):
                self._shortest[name, where] = outcome, what

    def found(self, is_complete: bool) -> List[Found]:
        """Return the findings, those of one kind together. ``is_complete``: every visitor and every fault was played.

        Nodes after a pass that does not end are not reported as unreached.
        """
        whole: List[Tuple[str, str, str]] = []
        if is_complete and all(outcome for scene, outcome, _, _ in self._outcomes if scene.is_calm):
            stage = self.theatre.stage(self._outcomes[0][0].by_voice)
            whole = findings.unreached(stage, frozenset(self._reached)) + findings.never_off(
                stage, frozenset(self._switched))
        told = [self._told(name, where, what, outcome) for (name, where), (outcome, what) in self._shortest.items()]
        told += [self._told(name, where, what, None) for name, where, what in whole]
        order = list(findings.BY_NAME)
        return sorted(told, key=lambda found: (order.index(found.kind.name), found.seconds, found.where))

    def _told(self, name: str, where: str, what: str, outcome: Optional[Outcome]) -> Found:
        scene = outcome.scene if outcome is not None else None
        return Found(findings.BY_NAME[name], where, self.place(where), what, self._often[name, where], scene,
                     outcome.seconds if outcome is not None else 0.0, self.story(scene) if scene is not None else (),
                     self.command(scene) if scene is not None else "")

    def place(self, path: str) -> str:
        """Return file, line and column of the node at ``path``; empty if there is none."""
        for node in self.theatre.stage(self._outcomes[0][0].by_voice).mission.tree.nodes:
            if path and clean(node.full_path) == path:
                return "{}:{}:{}".format(clean(node.element.document.file), *node.element.place())
        return ""

    def story(self, scene: Scene) -> Tuple[Sentence, ...]:
        """Return the sentences of a play; their times are seconds from its beginning."""
        story = Story()
        return tuple(sentence._replace(at=sentence.at - START)
                     for at, event in self.theatre.play(scene).played.events for sentence in story.take(at, event))

    def command(self, scene: Scene) -> str:
        """Return the command that plays a scene again."""
        words = ["rosrun", "unit_tests", "rehearseMission", *self.chosen, "--visitors", scene.visitor]
        if scene.seed:
            words += ["--runs", "1", "--failureRate", "{:g}".format(scene.rate), "--seed", str(scene.seed)]
            words += ["--kinds", ",".join(scene.kinds)] if scene.kinds != KINDS else []
        elif scene.is_calm:
            words += ["--faults", "none"]
        if scene.planned:
            words += ["--planned", ",".join(map(str, scene.planned))]
        if scene.silent:
            words += ["--silent", ",".join(scene.silent)]
        return " ".join(map(shlex.quote, words + ["asrEnabled:={}".format("true" if scene.by_voice else "false")]))

    def rows(self) -> List[Row]:
        """Return the outcomes for each visitor."""
        rows = []
        for scene, outcome, seconds, exhibits in self._outcomes:
            if scene.is_calm:
                counted = Counter(other[1] for other in self._outcomes if not other[0].is_calm
                                  and other[0][:2] == scene[:2])
                rows.append(Row(scene.visitor, scene.by_voice, outcome, seconds, exhibits, tuple(sorted(counted.items()))))
        return rows

    def shares(self) -> List[Share]:
        """Return the share of successes for each failure rate, of the plays with random faults."""
        return [_share(rate, [(outcome, seconds) for scene, outcome, seconds, _ in self._outcomes if scene.rate == rate])
                for rate in sorted({scene.rate for scene, _, _, _ in self._outcomes if scene.seed})]


def _length(outcome: Outcome) -> Tuple[Any, ...]:
    """Return the key by which the shortest play sorts first; of equals, the first declared visitor and kind of fault."""
    scene = outcome.scene
    return (len(scene.planned) + len(scene.silent) + 99 * bool(scene.rate), round(outcome.seconds),
            BEHAVIOURS.index(scene.visitor), not scene.by_voice, [KINDS.index(fault.kind) for fault in scene.planned], scene)


def _share(rate: float, ended: Iterable[Tuple[str, float]]) -> Share:
    all_of_them = list(ended)
    seconds = [seconds for outcome, seconds in all_of_them if outcome]
    return Share(rate, len(all_of_them), sum(outcome == "SUCCESS" for outcome, _ in all_of_them),
                 sum(seconds) / len(seconds) if seconds else math.nan)
