"""The messages on record as the nodes read them, and what the nodes looked for in
them."""
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
class Look:
    """A node's look for its sign among the messages later than ``after``, at a moment of the
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
        self.read: List[Message] = []
        self.looks: List[Look] = []
        self.waiting: Dict[int, Look] = {}  # looks that have not ended, by the uid of the node

    def begin(self, clock: Clock, began: float) -> None:
        """Begin a mission."""
        self._clock, self._began = clock, began
        self.waiting.clear()
        self._news: List[Tuple[Topic, int, Sample]] = []
        self._recent: Dict[Topic, Tuple[Sample, ...]] = {}
        self._heard: List[str] = []  # topics on which the robot still hears something
        self._reads: Dict[Topic, int] = {}  # in this traversal
        self._newest: List[Look] = []  # in this traversal

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

    def looked(self, node: Duty, topic: Topic, after: float, is_sign: Callable[[Any], bool],
               has_sign: bool) -> None:
        """Note that a node looked for its sign, and whether it was there."""
        now, recent = self._clock.now(), self._recent.get(topic, ())
        newest = recent[-1].arrived if recent else -math.inf
        self._newest.append(
            Look(node, topic, after, is_sign, has_sign, newest, now, now, self._began))

    def end_traversal(self) -> None:
        """Note which nodes go on waiting for a sign, and which wait no more."""
        before, self.waiting = self.waiting, {}
        for look in before.values():
            look.until = self._clock.now()
        for look in self._newest:
            earlier = before.get(look.node.uid)
            is_waiting = not look.has_sign and _waits(look.node)
            if is_waiting and earlier is not None and earlier.after == look.after:
                look = earlier
            else:
                self.looks.append(look)
            if is_waiting:
                self.waiting[look.node.uid] = look
        self._reads.clear()
        self._newest.clear()


def _waits(node: Any) -> bool:
    """Return whether a node goes on waiting for its sign: it, or the control that asks it again, is
    RUNNING."""
    return RUNNING in (node.status, is_asked_again(node) and node.parent.status)
