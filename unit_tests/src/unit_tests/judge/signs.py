"""The messages on record as the nodes read them, and how the nodes searched them for signs of a
visitor."""
import math
from dataclasses import dataclass
from typing import Any, Callable, Dict, List, Sequence, Tuple

from behavior_controller.bt.engine.clock import Clock
from behavior_controller.bt.status import RUNNING
from behavior_controller.execution.events import Message
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
    """The messages of a record."""

    def __init__(self) -> None:
        self.searches: List[SignSearch] = []
        self.waiting: Dict[int, SignSearch] = {}  # that go on, by the uid of the node

    def begin(self, clock: Clock, began: float) -> None:
        """Begin a mission."""
        self._clock, self._began = clock, began
        self.waiting.clear()
        self.news: List[Message] = []  # that no node has read yet
        self.heard: List[str] = []  # topics on which the robot still hears something
        self._recent: Dict[Topic, Tuple[Sample, ...]] = {}
        self._reads: Dict[Topic, int] = {}  # in this traversal
        self._newest: List[SignSearch] = []  # in this traversal

    def messages(self, topic: Topic) -> Sequence[Sample]:
        """Return the messages of a topic that the node may read now, oldest first."""
        self._reads[topic] = self._reads.get(topic, 0) + 1
        for event in list(self.news):
            if event.topic == topic.name and event.read <= self._reads[topic]:
                sample = Sample(event.value, event.arrived)
                self._recent[topic] = topic.kept(self._recent.get(topic, ()), sample)
                self.news.remove(event)
        return self._recent.get(topic, ())

    def is_hearing(self, topic: Topic) -> bool:
        """Return whether the robot still hears what began in time."""
        if topic.name not in self.heard:
            return False
        self.heard.remove(topic.name)
        return True

    def searched(self, node: Duty, topic: Topic, after: float, is_sign: Callable[[Any], bool],
                 has_sign: bool) -> None:
        """Note that a node searched for its sign, and whether it was there."""
        now, recent = self._clock.now(), self._recent.get(topic, ())
        newest = recent[-1].arrived if recent else -math.inf
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
        self._reads.clear()
        self._newest.clear()


def _waits(node: Any) -> bool:
    """Return whether a node goes on waiting for its sign: it, or the control that asks it again, is
    RUNNING."""
    return RUNNING in (node.status, is_asked_again(node) and node.parent.status)
