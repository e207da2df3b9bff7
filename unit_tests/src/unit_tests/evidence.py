"""Whether the mission noticed its visitor: its conditions against the messages in the journal.

A condition holds if a message says so in time, and does not if none does. Which of the two it was, the journal tells;
when the mission asked, the record's traversals of the tree do.
"""
from typing import Dict, Iterator, List, NamedTuple, Optional, Sequence, Tuple

from behavior_controller.bt.registry import Kind
from behavior_controller.interface import Evidence, Sense
from behavior_controller.settings import defaults

from unit_tests.facts import Facts, Tree, started
from unit_tests.faults import CRASH
from unit_tests.journal import Line
from unit_tests.recoveries import SPECS
from unit_tests.robot import TOPICS
from unit_tests.visitor import NOTHING_HEARD, SMALL_TALK, UNCLEAR_ANSWER

SLACK = 0.5
"""Seconds that a message may take to be noticed, and by which the times of record and journal may differ."""

RETURN = 15.0
"""Seconds after a node's crash in which its messages may be missed: its connection has to come back too."""

ASKED_AGAIN = "ReactiveFallback"
"""The control below which a condition is asked until it holds."""


class Wait(NamedTuple):
    """A leaf that asked for a sign of the visitor, from when until when. ``sign``: the first that came in that time."""

    node: str
    sense: Sense
    began: float
    ended: float
    held: bool  # whether it was seen
    sign: Optional[Line]

    @property
    def is_missed(self) -> bool:
        """Whether the sign was there and was not seen."""
        return not self.held and self.sign is not None and self.sign.time < self.ended - SLACK


class Signs:
    """The journal's lines about the visitor's presence, gaze and answers."""

    def __init__(self, facts: Facts):
        self._facts = facts
        self._settings = dict(defaults().values, **started(facts).get("settings", {}))
        self._crashes = [line for line in facts.journal if line.fault == CRASH]
        self._signs: Dict[Sense, List[Line]] = {}

    def of(self, sense: Sense) -> List[Line]:
        """Return the lines that are such a sign."""
        if sense not in self._signs:
            evidence = self._facts.interface.evidence(sense)
            self._signs[sense] = [line for line in self.lines(sense) if self._is_sign(sense, evidence, line)]
        return self._signs[sense]

    def lines(self, sense: Sense) -> List[Line]:
        """Return all lines of the topic with the evidence."""
        topic = self._facts.interface.evidence(sense).topic
        return [line for line in self._facts.journal if line.node == topic.node and line.call == 0]

    def _is_sign(self, sense: Sense, evidence: Evidence, line: Line) -> bool:
        value = TOPICS[evidence.topic.name].value(line.content)
        if sense is Sense.UTTERANCE:
            return value not in ("", NOTHING_HEARD, SMALL_TALK, UNCLEAR_ANSWER)
        gaze = self._facts.interface.gaze_value or self._settings["mutualGazeValue"]
        return evidence.is_given(value, gaze)

    def first(self, sense: Sense, after: float, until: float) -> Optional[Line]:
        """Return the first sign between two moments that must have been heard."""
        return next((line for line in self.of(sense) if after < line.time <= until and not any(
            crash.node == line.node and crash.time < line.time < crash.time + RETURN for crash in self._crashes)), None)

    def is_told(self, sense: Sense) -> bool:
        """Return whether a simulated node publishes the evidence."""
        return self._facts.interface.evidence(sense).topic.node not in self._facts.real

    def may_hold(self, sense: Sense, at: float) -> bool:
        """Return whether there was a sign that counted at that time."""
        topic = self._facts.interface.evidence(sense).topic
        oldest = at - SLACK - self._settings["topicMaxAge"] if topic.is_continuous else 0.0
        return any(oldest <= line.time <= at + SLACK for line in self.of(sense))

    def must_hold(self, sense: Sense, at: float) -> bool:
        """Return whether the newest message was a sign, and neither too new to have been seen nor too old to count."""
        newest = [line for line in self.lines(sense) if line.time <= at][-1:]
        return sense is Sense.VISITOR and newest == [self.first(sense, at - self._settings["topicMaxAge"] + SLACK,
                                                                at - SLACK)]


class Watch:
    """Follows the leaves that ask for a sign, traversal by traversal."""

    def __init__(self, facts: Facts, tree: Tree):
        self._tree = tree
        self._signs = Signs(facts)
        self._asked = {uid: sense for uid, node in self._tree.types.items() for sense in self._senses(node)}
        self._since: Dict[int, float] = {}
        self.waits: List[Wait] = []
        self.wrong: List[str] = []  # answers that no message explains
        for event in facts.events:
            if event["event"] == "Tick":
                self._traverse(event["time"], event["changes"])
            elif event["event"] == "PassFinished":
                self._end_all(event["time"])
        self.endless = self._end_all(max([line.time for line in facts.journal], default=0.0))
        """Waits that the end of the test cut off."""

    def _senses(self, node: str) -> List[Sense]:
        listens = SPECS[node].listens if node in SPECS else ()
        return [sense for sense in listens if isinstance(sense, Sense) and self._signs.is_told(sense)]

    def objections(self) -> Iterator[str]:
        """Object to answers that no message explains, and to signs that were not seen."""
        yield from self.wrong
        for wait in self.waits:
            if wait.is_missed and wait.sign is not None:
                yield "{} did not see what {} told {:.1f} s before it was asked last".format(
                    wait.node, wait.sign.resource, wait.ended - wait.sign.time)

    def _traverse(self, now: float, changes: Sequence[Tuple[int, str]]) -> None:
        for uid, letter in changes:
            if uid in self._asked:
                self._change(uid, letter, now)

    def _change(self, uid: int, letter: str, now: float) -> None:
        node, sense = self._tree.types[uid], self._asked[uid]
        is_condition = SPECS[node].kind is Kind.CONDITION
        if is_condition and letter == "S" and not self._signs.may_hold(sense, now):
            self.wrong.append("{} held, and no message told so".format(node))
        if is_condition and letter == "F" and uid not in self._since and self._signs.must_hold(sense, now):
            self.wrong.append("{} did not hold, though the newest message told so".format(node))
        if letter != "-":
            self._since.setdefault(uid, now)
        if uid in self._since and not (letter == "R" or letter == "F" and self._tree.is_below(uid, ASKED_AGAIN)):
            self._end(uid, now, is_condition and letter == "S")

    def _end_all(self, now: float) -> List[Wait]:
        """End the waits that are under way, and return them."""
        before = len(self.waits)
        for uid in list(self._since):
            self._end(uid, now, False)
        return self.waits[before:]

    def _end(self, uid: int, now: float, held: bool) -> None:
        began, sense = self._since.pop(uid), self._asked[uid]
        sign = self._signs.first(sense, began, now)
        self.waits.append(Wait(self._tree.types[uid], sense, began, now, held, sign))
