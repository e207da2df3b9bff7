"""The signs of a visitor: how the nodes searched the messages on record for them, and what the
journal of the simulated nodes says of that. Each message that was read was published, and no sign
was missed."""
import bisect
import math
from dataclasses import dataclass
from typing import Any, Callable, Dict, Iterator, List, Sequence, Tuple

from behavior_controller.bt import Clock, RUNNING
from behavior_controller.run.events import Message
from behavior_controller.robot.declarations import Topic
from behavior_controller.robot.gateway import Sample
from behavior_controller.simulation import journal
from behavior_controller.simulation.behaviour import TOPICS, read

from unit_tests.judge.facts import Facts, of
from unit_tests.judge.reference import ReferenceNode, is_asked_again


@dataclass(eq=False)
class SignSearch:
    """A node's search for its sign among the messages later than ``after``, at a moment of the
    mission's clock. Without a sign it goes on waiting ``until`` another moment."""

    node: ReferenceNode
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

    def searched(self, node: ReferenceNode, topic: Topic, messages: Sequence[Sample], after: float,
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


def objections(facts: Facts, signs: Signs, offset: float, end: float) -> Iterator[str]:
    """Object to messages that were not published, and to signs that were not seen until ``end``;
    ``offset`` is from the mission's clock to Unix time."""
    settings = facts.world.settings
    interface = settings.interface
    published = {topic: JournalMessages(facts, topic, offset)
                 for topic in interface.topics
                 if topic.name in TOPICS and topic.node not in facts.real}
    for _, event in of(facts.run.lines, Message):
        topic = interface.topic(event.topic)
        if topic in published and not published[topic].has(event):
            yield (f"the controller read {event.value!r} from {interface.name_of(topic)}, "
                   "and nobody published that")
    for search in signs.waiting.values():
        search.until = max(search.until, end - offset)
    for search in signs.searches:
        if search.topic in published:
            yield published[search.topic].objection(search, settings.topic_max_age)


class JournalMessages:
    """The messages of a topic in the journal: times and values. ``offset`` is that of the mission's
    clock."""

    def __init__(self, facts: Facts, topic: Topic, offset: float):
        self._lines: List[Tuple[float, Any]] = [
            (line.time, read(topic, line.content)) for line in facts.journal
            if line.node == topic.node and line.call == 0]
        self._crashes = [line.time for line in facts.crashes if line.node == topic.node]
        self._offset, self._facts, self._late = offset, facts, facts.late
        self._name = facts.world.settings.interface.name_of(topic)

    def _until(self, time: float) -> int:
        """Return how many messages there were up to that time."""
        return bisect.bisect_right(self._lines, (time,))

    def has(self, event: Message) -> bool:
        """Return whether a message on record was published when it arrived, or soon before."""
        arrived = event.arrived + self._offset
        first = self._until(arrived - journal.REPEAT - self._late)
        lines = self._lines[first:self._until(arrived + self._late)]
        return any(value == event.value for _, value in lines)

    def objection(self, search: SignSearch, max_age: float) -> str:
        """Object to a sign that was there for ``Facts.late`` and was not seen, and to one that had
        been over for so long; empty: neither."""
        topic, name = search.topic, search.node.registration_id
        at, until = search.at + self._offset, search.until + self._offset
        place = self._until(at - self._late)
        time, value = self._lines[place - 1] if place else (-math.inf, None)
        is_newer = topic.is_continuous and time > search.newest + self._offset + self._facts.early
        if search.has_sign:
            is_over = is_newer and topic.is_event is None and not search.is_sign(value)
            return f"{name} held, {at - time:.1f} s after {self._name} said {value!r}" * is_over
        # until then the connection to the node may not have been there
        connected = search.began + self._late
        if is_newer and self._is_heard(time) and time > connected:
            return f"{name} did not read what {self._name} said {at - time:.1f} s before: {value!r}"
        after = max(search.after + self._offset, connected)
        if topic.is_continuous:
            after = max(after, at - max_age + self._facts.early)
        for place in range(self._until(after), self._until(until - self._late)):
            time, value = self._lines[place]
            # a state has to stay the sign until it could have been seen
            last = self._until(max(at, time + self._late)) if topic.is_continuous else place + 1
            if self._is_heard(time) and all(
                    search.is_sign(later) for _, later in self._lines[place:last]):
                return (f"{name} did not see what {self._name} said {until - time:.1f} s before: "
                        f"{value!r}")
        return ""

    def _is_heard(self, time: float) -> bool:
        return not any(crash < time < crash + self._facts.away for crash in self._crashes)
