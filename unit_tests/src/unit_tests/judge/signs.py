"""The messages on record as the nodes read them, and the signs of a visitor that they saw or waited
for."""
import math
from typing import Any, Callable, Dict, List, NamedTuple, Sequence, Tuple

from behavior_controller.bt.engine.clock import Clock
from behavior_controller.bt.status import RUNNING
from behavior_controller.execution.events import Message
from behavior_controller.robot.declarations import Topic
from behavior_controller.robot.gateway import Sample

from unit_tests.judge.reference import Duty, is_asked_again

IsSign = Callable[[Any], bool]


class SignWait(NamedTuple):
    """A node that saw no sign at a moment of the mission's clock, and until when it went on
    waiting; ``newest``: when the newest message arrived that it had read."""

    node: Duty
    topic: Topic
    after: float
    is_sign: IsSign
    at: float
    until: float
    newest: float


class Holding(NamedTuple):
    """A sign that a condition on a state held for: when it arrived and when it was read, by the
    mission's clock."""

    node: Duty
    topic: Topic
    is_sign: IsSign
    arrived: float
    at: float


class Signs:
    """The messages of one mission."""

    def __init__(self, clock: Clock):
        self.read: List[Message] = []
        self.searches: List[SignWait] = []
        self.holdings: List[Holding] = []
        self.waiting: Dict[int, SignWait] = {}  # that have not ended, by the uid of the node
        self._clock = clock
        self._news: List[Tuple[Topic, int, Sample]] = []
        self._recent: Dict[Topic, Tuple[Sample, ...]] = {}
        self._heard: List[str] = []  # topics on which the robot still hears something
        self._reads: Dict[Topic, int] = {}  # in this traversal
        self._sought: List[SignWait] = []  # in this traversal

    def note(self, event: Message, topic: Topic) -> None:
        """Note a message on record."""
        self.read.append(event)
        self._news.append((topic, event.read, Sample(event.value, event.arrived)))

    def note_hearing(self, topic: str) -> None:
        """Note that the robot still hears something."""
        self._heard.append(topic)

    def messages(self, topic: Topic) -> Sequence[Sample]:
        """Return the messages of a topic that the node may read now, oldest first."""
        self._reads[topic] = self._reads.get(topic, 0) + 1
        for entry in list(self._news):
            if entry[0] is topic and entry[1] <= self._reads[topic]:
                self._recent[topic] = topic.kept(self._recent.get(topic, ()), entry[2])
                self._news.remove(entry)
        return self._recent.get(topic, ())

    def is_hearing(self, topic: Topic) -> bool:
        """Return whether the robot still hears what began in time."""
        if topic.name not in self._heard:
            return False
        self._heard.remove(topic.name)
        return True

    def sought(self, node: Duty, topic: Topic, after: float, is_sign: IsSign) -> None:
        """Note that a node saw no sign among the messages later than ``after``."""
        now, recent = self._clock.now(), self._recent.get(topic, ())
        newest = recent[-1].arrived if recent else -math.inf
        self._sought.append(SignWait(node, topic, after, is_sign, now, now, newest))

    def saw(self, node: Duty, topic: Topic, sample: Sample, is_sign: IsSign) -> None:
        """Note that a message was the sign."""
        if topic.is_continuous and topic.is_event is None:
            self.holdings.append(Holding(node, topic, is_sign, sample.arrived, self._clock.now()))

    def end_traversal(self) -> None:
        """Note which nodes go on waiting for a sign, and which wait no more."""
        before, self.waiting = self.waiting, {}
        for search in self._sought:
            known = before.get(search.node.uid, search)
            if not _waits(search.node):
                self.searches.append(search)
            elif known.after == search.after:
                self.waiting[search.node.uid] = before.pop(search.node.uid, search)
            else:
                self.waiting[search.node.uid] = search
        self.searches += [search._replace(until=self._clock.now()) for search in before.values()]
        self._reads.clear()
        self._sought.clear()


def _waits(node: Any) -> bool:
    """Return whether a node goes on waiting for its sign: it, or the control that asks it again, is
    RUNNING."""
    return RUNNING in (node.status, is_asked_again(node) and node.parent.status)
