"""The recovery policy: what to do about each failure, read from ``config/recoveryPolicy.ini`` and
checked as a whole."""
import itertools
import re
from dataclasses import dataclass
from typing import Iterable, List, NamedTuple, Optional, Tuple

from behavior_controller.bt.engine.registry import NodeSpec
from behavior_controller.errors import ConfigurationError
from behavior_controller.robot.gateway import Cause
from behavior_controller.config.config_file import (
    LineReader, Place, TextLine, integer, number, read_source)
from behavior_controller.config.node_facts import MissionSpec
from behavior_controller.text import Source, did_you_mean

CAUSE_NAMES = [cause.value for cause in Cause]
SKIP, GIVE_UP = "skip", "giveUp"

MOST_RECOVERIES = 99
"""The largest budget of recoveries, and the most retries of a step."""

MOST_DOUBLINGS = 12
"""From 1 s to more than the longest pause that a policy may name."""

_COUNT = integer(0, MOST_RECOVERIES)
_PAUSE = number(0, 3600, of="seconds")


class Rule(NamedTuple):
    """One line of the policy. ``node`` and ``cause`` may be ``*``; ``back_off`` in seconds.

    A ``substitute`` is run instead of the failed node; if that fails too, ``then`` decides.
    """

    node: str
    cause: str
    retries: int
    back_off: float
    then: str
    substitute: Optional[MissionSpec] = None

    def __str__(self) -> str:
        """Return the rule in words."""
        words = "skip" if self.then == SKIP else "give up"
        if self.substitute:
            words = f"{self.substitute.id} instead, or {words}"
        if self.retries:
            words = f"retry {self.retries}x, then {words}"
        return words


@dataclass(frozen=True)
class Policy:
    """The rules in order, the budget (at most ``most`` recoveries in ``seconds``), the pause, and
    the file of all.

    ``first_pause`` are the seconds before the next pass when a mission gave up for a cause that
    persists. Each further pause is twice as long, up to ``longest_pause``, until a pass succeeds.
    """

    rules: Tuple[Rule, ...]
    most: int
    seconds: float
    source: Source = Source("", "")
    first_pause: float = 10.0
    longest_pause: float = 300.0

    def pause(self, number: int) -> float:
        """Return the seconds of pause ``number``, from 0 on, since the last pass that succeeded."""
        return min(self.first_pause * 2 ** min(number, MOST_DOUBLINGS), self.longest_pause)

    @property
    def spent(self) -> str:
        """The words for a budget that is spent."""
        return f"the budget of {self.most} recoveries in {self.seconds:g} s is spent"

    def rule(self, node: NodeSpec, cause: Cause) -> Rule:
        """Return the first rule that matches; without one, and for a node that is none of the
        mission vocabulary, the rule to give up."""
        for rule in self.rules:
            if isinstance(node, MissionSpec) and rule.node in ("*", node.id) \
                    and rule.cause in ("*", cause.value):
                if rule.then == SKIP and node.is_indispensable:
                    return rule._replace(then=GIVE_UP, substitute=None)
                return rule
        return Rule(node.id, "*", 0, 0.0, GIVE_UP)


def load(path: str, specs: Iterable[MissionSpec]) -> Policy:
    """Read a policy file; ``specs`` are the nodes that it may name. Raises ConfigurationError with
    every fault."""
    return read(read_source(path, "the recovery policy"), specs)


def read(source: Source, specs: Iterable[MissionSpec]) -> Policy:
    """As ``load``, given the text of the file."""
    reader = _PolicyReader(source, specs)
    reader.read()
    ConfigurationError.raise_any(reader.faults)
    most, seconds = reader.values["budget"]
    pause = reader.values.get("pause", (Policy.first_pause, Policy.longest_pause))
    return Policy(tuple(reader.rules), int(most), seconds, source, *pause)


class _PolicyReader(LineReader):
    """Reads rules, and the pairs of numbers of the budget and the pauses."""

    comment = re.compile("#|$")

    def __init__(self, source: Source, specs: Iterable[MissionSpec]):
        super().__init__(source)
        self.nodes = {spec.id: spec for spec in specs}
        self.rules: List[Rule] = []

    def line(self, line: TextLine) -> None:
        words, place = [word.group() for word in line.words], (line.file, line.number, 1)
        if line.key in ("budget", "pause"):
            self._pair(place, line.key, words[1:])
        elif len(words) == 5:
            self._rule(place, words)
        else:
            self.fault(place, f"{len(words)} words; a rule has 5: node cause retries back-off then")

    def finish(self) -> None:
        if "budget" not in self.values:
            self.fault(None, "the line \"budget <recoveries> <seconds>\" is missing")

    def _pair(self, place: Place, name: str, words: List[str]) -> None:
        is_pair = len(words) == 2 and all(map(_PAUSE.is_allowed, words)) and name not in self.values
        if name == "budget" and not (is_pair and _COUNT.is_allowed(words[0])):
            self.fault(place, "a budget is one line: budget <recoveries> <seconds>")
        elif name == "pause" and not (is_pair and 1.0 <= float(words[0]) <= float(words[1])):
            self.fault(place, "pauses are one line: pause <first> <longest>",
                       "allowed: seconds, 1 to 3600, the longest last")
        else:
            self.values[name] = float(words[0]), float(words[1])

    def _rule(self, place: Place, words: List[str]) -> None:
        node, cause, retries, back_off, then = words
        before = len(self.faults)
        if node != "*" and node not in self.nodes:
            self.fault(place, f"unknown node {node}", did_you_mean(node, self.nodes))
        if cause != "*" and cause not in CAUSE_NAMES:
            self.fault(place, f"unknown cause {cause}", did_you_mean(cause, CAUSE_NAMES)
                       or f"the causes: {', '.join(CAUSE_NAMES)}")
        self.parsed(_COUNT, retries, "retries", place)
        self.parsed(_PAUSE, back_off, "back-off", place)
        if then not in (SKIP, GIVE_UP) and not self._is_request(then):
            self.fault(place, f"the last word cannot be {then}",
                       did_you_mean(then, filter(self._is_request, self.nodes))
                       or "allowed: skip, giveUp, or a node that calls a service")
        elif then != GIVE_UP and node in self.nodes and self.nodes[node].is_indispensable:
            self.fault(place, f"{node} cannot be skipped", "write giveUp")
        if len(self.faults) == before:
            last = GIVE_UP if then == GIVE_UP else SKIP
            self._keep(place,
                       Rule(node, cause, int(retries), float(back_off), last, self.nodes.get(then)))

    def _is_request(self, node: str) -> bool:
        """Return whether the node can be a substitute: its request to a service does not depend on
        its name."""
        return node in self.nodes and bool(self.nodes[node].calls) and not self.nodes[node].names

    def _keep(self, place: Place, rule: Rule) -> None:
        """Append a valid rule, unless it can never decide because of the rules before it."""
        for fits in map(" ".join, itertools.product((rule.node, "*"), (rule.cause, "*"))):
            if fits in self.lines:
                self.fault(place, f"{rule.node} {rule.cause} is never looked at: line "
                                  f"{self.lines[fits]} decides before it",
                           "the first line that fits decides")
                return
        self.lines[f"{rule.node} {rule.cause}"] = place[1]
        self.rules.append(rule)
