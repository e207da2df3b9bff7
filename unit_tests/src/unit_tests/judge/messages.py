"""What the journal of the simulated nodes says of messages: each that was read was published, and
no sign of the visitor was missed."""
import bisect
import math
from typing import Any, Iterator, List, Tuple

from behavior_controller.execution.events import Message
from behavior_controller.robot.declarations import Topic

from unit_tests.judge.execution import Execution
from unit_tests.judge.facts import EARLY, RETURN, Facts
from unit_tests.judge.signs import Holding, SignWait
from unit_tests.robot import journal
from unit_tests.robot.behaviour import TOPICS


def objections(facts: Facts, execution: Execution, end: float) -> Iterator[str]:
    """Object to messages that were not published, and to signs that were not seen until ``end``."""
    offset, signs = execution.offset, execution.signs
    if offset is None:
        return
    published = {topic: JournalMessages(facts, topic, offset)
                 for topic in facts.world.settings.interface.topics
                 if topic.name in TOPICS and topic.node not in facts.real}
    for event in signs.read:
        topic = execution.interface.topic(event.topic)
        if topic in published and not published[topic].has(event):
            yield (f"the controller read {event.value!r} from {event.topic}, and nobody published "
                   "that")
    waiting = [search._replace(until=max(search.until, end - offset))
               for search in signs.waiting.values()]
    for search in signs.searches + waiting:
        if search.topic in published:
            yield from published[search.topic].missed(search, execution)
    for holding in signs.holdings:
        if holding.topic in published:
            yield from published[holding.topic].outdated(holding)


class JournalMessages:
    """The messages of a topic in the journal: times and values. ``offset`` is that of the mission's
    clock."""

    def __init__(self, facts: Facts, topic: Topic, offset: float):
        self._lines: List[Tuple[float, Any]] = [
            (line.time, TOPICS[topic.name].value(line.content)) for line in facts.journal
            if line.node == topic.node and line.call == 0]
        self._crashes = [line.time for line in facts.crashes if line.node == topic.node]
        self._offset, self._late = offset, facts.late

    def _until(self, time: float) -> int:
        """Return how many messages there were up to that time."""
        return bisect.bisect_right(self._lines, (time,))

    def has(self, event: Message) -> bool:
        """Return whether a message on record was published when it arrived, or soon before."""
        arrived = event.arrived + self._offset
        first = self._until(arrived - journal.REPEAT - self._late)
        lines = self._lines[first:self._until(arrived + self._late)]
        return any(value == event.value for _, value in lines)

    def missed(self, search: SignWait, execution: Execution) -> Iterator[str]:
        """Object to a sign that was there for ``Facts.late`` and was not seen."""
        offset, began = self._offset, execution.began
        at, until = search.at + offset, search.until + offset
        after = max(search.after + offset, began)
        if search.topic.is_continuous:
            time, value = self._newest(at - self._late)
            earliest = max(began + self._late, search.newest + offset + EARLY)
            if self._is_heard(time) and time > earliest:
                yield (f"{search.node.registration_id} did not read what {search.topic.name} said "
                       f"{at - time:.1f} s before: {value!r}")
                return
            after = max(after, at - execution.settings.topic_max_age + EARLY)
        for place in range(self._until(after), self._until(until - self._late)):
            time, value = self._lines[place]
            # a state has to stay the sign until it could have been seen
            last = place + 1
            if search.topic.is_continuous:
                last = self._until(max(at, time + self._late))
            if self._is_heard(time) and all(
                    search.is_sign(later) for _, later in self._lines[place:last]):
                yield (f"{search.node.registration_id} did not see what {search.topic.name} said "
                       f"{until - time:.1f} s before: {value!r}")
                return

    def outdated(self, holding: Holding) -> Iterator[str]:
        """Object to a sign that was over ``Facts.late`` before it was read."""
        at = holding.at + self._offset
        time, value = self._newest(at - self._late)
        if time > holding.arrived + self._offset + EARLY and not holding.is_sign(value):
            yield (f"{holding.node.registration_id} held, {at - time:.1f} s after "
                   f"{holding.topic.name} said {value!r}")

    def _newest(self, time: float) -> Tuple[float, Any]:
        """Return time and value of the newest message at that time."""
        place = self._until(time)
        return self._lines[place - 1] if place else (-math.inf, None)

    def _is_heard(self, time: float) -> bool:
        return not any(crash < time < crash + RETURN for crash in self._crashes)
