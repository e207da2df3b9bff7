"""The recovery policy: what to do about each failure, read from ``config/recoveryPolicy.ini`` and checked as a whole."""
import itertools
import re
from dataclasses import dataclass
from typing import Dict, Iterable, List, NamedTuple, Optional, Tuple

from behavior_controller.bt.registry import did_you_mean
from behavior_controller.errors import ConfigurationError, Fault
from behavior_controller.gateway import Cause
from behavior_controller.keys import read_lines, read_source
from behavior_controller.mission_spec import MissionSpec
from behavior_controller.text import Source

CAUSES = [cause.value for cause in Cause]
SKIP, GIVE_UP = "skip", "giveUp"


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
        retry = "retry {}x, then ".format(self.retries) if self.retries else ""
        instead = "{} instead, or ".format(self.substitute.id) if self.substitute else ""
        return retry + instead + ("skip" if self.then == SKIP else "give up")


@dataclass(frozen=True)
class Policy:
    """The rules in order, the budget (at most ``most`` recoveries in ``seconds``), and the file of both."""

    rules: Tuple[Rule, ...]
    most: int
    seconds: float
    source: Source = Source("", "")

    def rule(self, node: MissionSpec, cause: Cause) -> Rule:
        """Return the first rule that matches; without one, the rule to give up."""
        for rule in self.rules:
            if rule.node in ("*", node.id) and rule.cause in ("*", cause.value):
                if rule.then == SKIP and node.is_indispensable:
                    return rule._replace(then=GIVE_UP, substitute=None)
                return rule
        return Rule(node.id, "*", 0, 0.0, GIVE_UP)



def load(path: str, specs: Iterable[MissionSpec]) -> Policy:
    """Read a policy file; ``specs`` are the nodes that it may name. Raises ConfigurationError with every fault."""
    return read(read_source(path, "the recovery policy"), specs)


def read(source: Source, specs: Iterable[MissionSpec]) -> Policy:
    """As ``load``, given the text of the file."""
    reader = _Reader(source.file, {spec.id: spec for spec in specs})
    read_lines(source, reader.faults, reader.line)
    if reader.budget is None:
        reader.fault(0, "the line \"budget <recoveries> <seconds>\" is missing")
    if reader.faults:
        raise ConfigurationError(reader.faults)
    assert reader.budget is not None
    return Policy(tuple(reader.rules), *reader.budget, source)


class _Reader:
    def __init__(self, path: str, nodes: Dict[str, MissionSpec]):
        self.path = path
        self.nodes = nodes
        self.rules: List[Rule] = []
        self.faults: List[Fault] = []
        self.budget: Optional[Tuple[int, float]] = None
        self.seen: Dict[Tuple[str, str], int] = {}

    def fault(self, line: int, text: str, hint: str = "") -> None:
        self.faults.append(Fault(self.path, line, 1 if line else 0, text, hint))

    def line(self, number: int, line: str) -> None:
        words = line.split("#")[0].split()
        if words[:1] == ["budget"]:
            if len(words) != 3 or not _is_count(words[1]) or not _is_seconds(words[2]) or self.budget is not None:
                self.fault(number, "a budget is one line: budget <recoveries> <seconds>")
            else:
                self.budget = (int(words[1]), float(words[2]))
        elif len(words) not in (0, 5):
            self.fault(number, "{} words; a rule has 5: node cause retries back-off then".format(len(words)))
        elif words:
            self._rule(number, words)

    def _rule(self, number: int, words: List[str]) -> None:
        node, cause, retries, back_off, then = words
        before = len(self.faults)
        if node != "*" and node not in self.nodes:
            self.fault(number, "unknown node {}".format(node), did_you_mean(node, self.nodes))
        if cause != "*" and cause not in CAUSES:
            self.fault(number, "unknown cause {}".format(cause), did_you_mean(cause, CAUSES)
                       or "the causes: {}".format(", ".join(CAUSES)))
        if not _is_count(retries):
            self.fault(number, "retries cannot be {}".format(retries), "allowed: 0 to 99")
        if not _is_seconds(back_off):
            self.fault(number, "back-off cannot be {}".format(back_off), "allowed: seconds, 0 to 3600")
        if then not in (SKIP, GIVE_UP) and not self._is_request(then):
            self.fault(number, "the last word cannot be {}".format(then), did_you_mean(then, filter(
                self._is_request, self.nodes)) or "allowed: skip, giveUp, or a node that calls a service")
        elif then != GIVE_UP and node in self.nodes and self.nodes[node].is_indispensable:
            self.fault(number, "{} cannot be skipped".format(node), "write giveUp")
        if len(self.faults) == before:
            last = then if then in (SKIP, GIVE_UP) else SKIP
            self._keep(number, Rule(node, cause, int(retries), float(back_off), last, self.nodes.get(then)))

    def _is_request(self, node: str) -> bool:
        """Return whether the node can be a substitute: its request to a service does not depend on its name."""
        return node in self.nodes and bool(self.nodes[node].calls) and not self.nodes[node].names

    def _keep(self, number: int, rule: Rule) -> None:
        """Append a valid rule, unless it can never decide because of the rules before it."""
        for fits in itertools.product((rule.node, "*"), (rule.cause, "*")):
            if fits in self.seen:
                self.fault(number, "{} {} is never looked at: line {} decides before it".format(
                    rule.node, rule.cause, self.seen[fits]), "the first line that fits decides")
                return
        self.seen[rule.node, rule.cause] = number
        self.rules.append(rule)


def _is_count(text: str) -> bool:
    return re.fullmatch(r"\d{1,2}", text) is not None


def _is_seconds(text: str) -> bool:
    return re.fullmatch(r"\d{1,4}(\.\d{1,3})?", text) is not None and float(text) <= 3600.0
