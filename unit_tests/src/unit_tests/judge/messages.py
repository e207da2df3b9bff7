"""What the journal of the simulated nodes says of messages: each that was read was published, and
no sign of the visitor was missed."""
import bisect
import math
from typing import Any, Iterator, List, Tuple

from behavior_controller.execution.events import Message
from behavior_controller.robot.declarations import Topic

from unit_tests.judge.execution import Execution
from unit_tests.judge.facts import EARLY, RETURN, Facts, of
from unit_tests.judge.signs import SignSearch
from unit_tests.robot import journal
from unit_tests.robot.behaviour import TOPICS


def objections(facts: Facts, execution: Execution, end: float) -> Iterator[str]:
    """Object to messages that were not published, and to signs that were not seen until ``end``;
    empty: no objection."""
    offset, signs, interface = execution.offset, execution.signs, facts.world.settings.interface
    if offset is None:
        return
    published = {topic: JournalMessages(facts, topic, offset)
                 for topic in interface.topics
                 if topic.name in TOPICS and topic.node not in facts.real}
    for _, event in of(facts.run.lines, Message):
        topic = interface.topic(event.topic)
        if topic in published and not published[topic].has(event):
            yield (f"the controller read {event.value!r} from {event.topic}, and nobody published "
                   "that")
    for search in signs.waiting.values():
        search.until = max(search.until, end - offset)
    for search in signs.searches:
        if search.topic in published:
            yield published[search.topic].objection(search, execution.settings.topic_max_age)


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

    def objection(self, search: SignSearch, max_age: float) -> str:
        """Object to a sign that was there for ``Facts.late`` and was not seen, and to one that had
        been over for so long; empty: neither."""
        topic, name = search.topic, search.node.registration_id
        at, until = search.at + self._offset, search.until + self._offset
        place = self._until(at - self._late)
        time, value = self._lines[place - 1] if place else (-math.inf, None)
        is_newer = topic.is_continuous and time > search.newest + self._offset + EARLY
        if search.has_sign:
            is_over = is_newer and topic.is_event is None and not search.is_sign(value)
            return f"{name} held, {at - time:.1f} s after {topic.name} said {value!r}" * is_over
        if is_newer and self._is_heard(time) and time > search.began + self._late:
            return f"{name} did not read what {topic.name} said {at - time:.1f} s before: {value!r}"
        after = max(search.after + self._offset, search.began)
        if topic.is_continuous:
            after = max(after, at - max_age + EARLY)
        for place in range(self._until(after), self._until(until - self._late)):
            time, value = self._lines[place]
            # a state has to stay the sign until it could have been seen
            last = self._until(max(at, time + self._late)) if topic.is_continuous else place + 1
            if self._is_heard(time) and all(
                    search.is_sign(later) for _, later in self._lines[place:last]):
                return (f"{name} did not see what {topic.name} said {until - time:.1f} s before: "
                        f"{value!r}")
        return ""

    def _is_heard(self, time: float) -> bool:
        return not any(crash < time < crash + RETURN for crash in self._crashes)
