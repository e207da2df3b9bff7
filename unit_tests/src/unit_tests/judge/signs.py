"""The signs of a visitor: how the nodes searched the messages on record for them, and what the
journal of the simulated nodes says of that. Each message that was read was published, and no sign
was missed."""
import bisect
import math
from dataclasses import dataclass
from typing import Any, Callable, Dict, Iterator, List, Sequence, Set, Tuple, Union

from behavior_controller.bt import Clock, RUNNING
from behavior_controller.run.events import Message, RecognitionPending
from behavior_controller.robot.gateway import Sample
from behavior_controller.simulation import journal

from unit_tests.judge.facts import Facts, of
from unit_tests.judge.reference import ReferenceNode, is_asked_again
from unit_tests.judge.wire import (
    ATTENTION, MESSAGES, MOST_EVENTS, RosRobot, STATES, is_lasting, node_of, robot_of)


@dataclass(eq=False)
class SignSearch:
    """A node's search for its sign among the messages later than ``after``, at a moment of the
    mission's clock. Without a sign it goes on waiting ``until`` another moment."""

    node: ReferenceNode
    topic: str
    after: float
    is_sign: Callable[[Any], bool]
    has_sign: bool
    newest: float  # when the newest message arrived that it had read
    at: float
    until: float
    began: float  # Unix time at which the mission began


class MessagesOnRecord:
    """The messages on record: those that a traversal read are on record before it."""

    def __init__(self, robot: RosRobot):
        self._robot = robot
        self._news: List[Message] = []  # that no traversal has read yet
        self._recent: Dict[str, List[Sample]] = {}
        self._reads: Dict[str, int] = {}
        self._hearing: List[str] = []  # on which topics the robot still hears something

    def take(self, event: Union[Message, RecognitionPending]) -> None:
        """Store a message, or that the robot still hears something, for the next traversal."""
        if isinstance(event, Message):
            self._news.append(event)
        else:
            self._hearing.append(event.topic)

    def begin(self) -> None:
        """A traversal begins."""
        self._reads.clear()

    def recent(self, topic: str) -> List[Sample]:
        """Return the messages that count at this read of a topic, the oldest first."""
        self._reads[topic] = read = self._reads.get(topic, 0) + 1
        kept = self._recent.setdefault(topic, [])
        for event in [event for event in self._news if event.topic == topic and event.read <= read]:
            self._news.remove(event)
            if topic in STATES:
                is_anew = is_lasting(topic, event.value, self._robot)
                kept[:] = [sample for sample in kept if not is_anew and is_lasting(
                    topic, sample.value, self._robot)]
            kept.append(Sample(event.value, event.arrived))
            del kept[:-MOST_EVENTS]
        return kept

    def is_hearing(self, topic: str) -> bool:
        """Return whether it is on record for this traversal, once for each time it was asked."""
        if topic not in self._hearing:
            return False
        self._hearing.remove(topic)
        return True


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

    def searched(self, node: ReferenceNode, topic: str, messages: Sequence[Sample], after: float,
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
    published = {topic: JournalMessages(facts, topic, offset)
                 for topic in MESSAGES if node_of(topic) not in facts.real}
    invented: Set[str] = set()  # of each topic one is enough
    for _, event in of(facts.run.lines, Message):
        is_new = event.topic in published and event.topic not in invented
        if is_new and not published[event.topic].has(event):
            invented.add(event.topic)
            yield (f"the controller read {event.value!r} from "
                   f"{published[event.topic].name}, and nobody published that")
    for search in signs.waiting.values():
        search.until = max(search.until, end - offset)
    for search in signs.searches:
        if search.topic in published:
            yield published[search.topic].objection(search, settings.topic_max_age)


class JournalMessages:
    """The messages of a topic in the journal: times and values. ``offset`` is that of the mission's
    clock."""

    def __init__(self, facts: Facts, topic: str, offset: float):
        self._lines: List[Tuple[float, Any]] = [
            (line.time, MESSAGES[topic](line.content)) for line in facts.journal
            if line.node == node_of(topic) and line.call == 0]
        self._crashes = [line.time for line in facts.crashes if line.node == node_of(topic)]
        robot = robot_of(facts.world.settings)
        self.name = robot.named(topic)
        self._may_last = topic == ATTENTION and robot.has_files
        self._offset, self._facts, self._latest = offset, facts, facts.latest
        stood_still = sum(stall.ends - stall.begins for stall in facts.stalls)
        self._longest = facts.late + stood_still * facts.pace

    def _until(self, time: float) -> int:
        """Return how many messages there were up to that time."""
        return bisect.bisect_right(self._lines, (time,))

    def has(self, event: Message) -> bool:
        """Return whether a message on record was published when it arrived, or soon before."""
        arrived = event.arrived + self._offset
        first = self._until(arrived - journal.REPEAT - self._longest)
        lines = self._lines[first:self._until(self._latest(arrived))]
        return any(value == event.value and arrived <= self._latest(time + journal.REPEAT)
                   for time, value in lines)

    def _in_time(self, at: float) -> int:
        """Return how many messages had to be there at a time."""
        number = self._until(at - self._facts.late)
        while number and self._latest(self._lines[number - 1][0]) > at:
            number -= 1
        return number

    def objection(self, search: SignSearch, max_age: float) -> str:
        """Object to a sign that was there for so long and was not seen, and to one that had
        been over for so long; empty: neither."""
        topic, name = search.topic, search.node.registration_id
        at, until = search.at + self._offset, search.until + self._offset
        place = self._in_time(at)
        time, value = self._lines[place - 1] if place else (-math.inf, None)
        is_state = topic in STATES
        is_newer = is_state and time > search.newest + self._offset + self._facts.early
        if search.has_sign:
            is_over = is_newer and not self._may_last and not search.is_sign(value)
            return f"{name} held, {at - time:.1f} s after {self.name} said {value!r}" * is_over
        # until then the connection to the node may not have been there
        connected = self._latest(search.began)
        if is_newer and self._is_heard(time) and time > connected:
            return f"{name} did not read what {self.name} said {at - time:.1f} s before: {value!r}"
        after = max(search.after + self._offset, connected)
        if is_state:
            after = max(after, at - max_age + self._facts.early)
        for place in range(self._until(after), self._in_time(until)):
            time, value = self._lines[place]
            # a state has to stay the sign until it could have been seen
            last = place + 1
            if is_state:
                last = self._until(max(at, self._latest(time)))
            if self._is_heard(time) and all(
                    search.is_sign(later) for _, later in self._lines[place:last]):
                return (f"{name} did not see what {self.name} said {until - time:.1f} s before: "
                        f"{value!r}")
        return ""

    def _is_heard(self, time: float) -> bool:
        return not any(crash < time < crash + self._facts.away for crash in self._crashes)
