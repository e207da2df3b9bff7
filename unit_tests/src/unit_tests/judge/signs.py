"""How the nodes searched the messages on record for signs of a visitor."""
import math
from dataclasses import dataclass
from typing import Any, Callable, Dict, List, Sequence

from behavior_controller.bt.engine.clock import Clock
from behavior_controller.bt.status import RUNNING
from behavior_controller.robot.declarations import Topic
from behavior_controller.robot.gateway import Sample

from unit_tests.judge.reference import Duty, is_asked_again


@dataclass(eq=False)
class SignSearch:
    """A node's search for its sign among the messages later than ``after``, at a moment of the
    mission's clock. Without a sign it goes on waiting ``until`` another moment."""

    node: Duty
    topic: Topic
    after: float
    is_sign: Callable[[Any], bool]
    has_sign: bool
    newest: float  # when the newest message arrived that it had read
    at: float
    until: float
    began: float  # Unix time at which the mission began


class Signs:
    """The searches of a record."""

    def __init__(self) -> None:
        self.searches: List[SignSearch] = []
        self.waiting: Dict[int, SignSearch] = {}  # that go on, by the uid of the node

    def begin(self, clock: Clock, began: float) -> None:
        """Begin a mission."""
        self._clock, self._began = clock, began
        self.waiting.clear()
        self._newest: List[SignSearch] = []  # in this traversal

    def searched(self, node: Duty, topic: Topic, messages: Sequence[Sample], after: float,
                 is_sign: Callable[[Any], bool], has_sign: bool) -> None:
        """Note that a node searched messages for its sign, and whether it was there."""
        now, newest = self._clock.now(), messages[-1].arrived if messages else -math.inf
        self._newest.append(
            SignSearch(node, topic, after, is_sign, has_sign, newest, now, now, self._began))

    def end_traversal(self) -> None:
        """Note which nodes go on waiting for a sign, and which wait no more."""
        before, self.waiting = self.waiting, {}
        for search in before.values():
            search.until = self._clock.now()
        for search in self._newest:
            earlier = before.get(search.node.uid)
            is_waiting = not search.has_sign and _waits(search.node)
            if is_waiting and earlier is not None and earlier.after == search.after:
                search = earlier
            else:
                self.searches.append(search)
            if is_waiting:
                self.waiting[search.node.uid] = search
        self._newest.clear()


def _waits(node: Any) -> bool:
    """Return whether a node goes on waiting for its sign: it, or the control that asks it again, is
    RUNNING."""
    return RUNNING in (node.status, is_asked_again(node) and node.parent.status)
