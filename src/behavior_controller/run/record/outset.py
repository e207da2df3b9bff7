"""What has to be known of a run where a further file of it begins, or a viewer is started late."""
import collections
import itertools
import os
from typing import Any, Callable, Deque, Dict, List

from msgspec.structs import replace

from behavior_controller.run import events
from behavior_controller.run.fold import fold
from behavior_controller.run.state import State, letter_after
from behavior_controller.run.record.codec import encode, header

LASTING: Dict[type, Callable[[Any], Any]] = {
    **dict.fromkeys((events.Starting, events.TreeShown, events.RunStarted, events.PassStarted,
                     events.Suspended, events.SafeStateReported), lambda event: None),
    **dict.fromkeys((events.TopicSaid, events.Message), lambda event: event.topic),
    events.Checked: lambda event: event.name, events.Asked: lambda event: type(event.request),
    events.HealthChanged: lambda event: (event.name, event.respect)}
"""The events that hold until another one of the same kind with the same key."""

FREQUENT = (events.EntriesWritten, events.Tick, events.Message, events.RecognitionPending,
            events.SignOfLife, events.TopicSaid)
"""The kinds of events that do not tell where the robot is."""

SUMMED_UP = (events.TreeShown, events.RunStarted, *FREQUENT)
"""The kinds of events of which a head has the outcome; it repeats all others of the visit."""

MOST_REPEATED = 1000
"""The most lines of the visit under way that are repeated: the newest."""


class Outset:
    """What has to be known of a run where a further file of it begins, so that this file is read
    without those before it."""

    def __init__(self) -> None:
        self._began = events.unix_now()
        self._visits = 0  # that are over
        self._lasting: Dict[Any, List[events.Line]] = {}  # an ``Asked`` with its answer
        self._visit: Deque[events.Line] = collections.deque(maxlen=MOST_REPEATED)  # under way
        self._written = events.EntriesWritten([])  # what the entries of the blackboard are
        self._letters: Dict[int, str] = {}  # of the nodes that were ticked in this pass
        self._nodes = 0  # of the tree
        self._state = State()  # without what ``FREQUENT`` events say

    def take(self, time: float, event: events.Event) -> None:
        """Note the next event."""
        kind, key_of, line = type(event), LASTING.get(type(event)), events.Line(time, event)
        if kind not in FREQUENT:
            self._state = fold(self._state, time, event)
        if isinstance(event, events.TreeShown):
            self._written, self._nodes = events.EntriesWritten([]), len(event.nodes)
        if kind in (events.TreeShown, events.PassStarted):
            self._letters.clear()
            self._visit.clear()
        if kind in (events.PassStarted, events.Paused) or self._visit and kind not in SUMMED_UP:
            self._visit.append(line)
        if key_of is not None:
            key = kind, key_of(event)
            if kind not in (events.TreeShown, events.RunStarted):  # which stay first
                self._lasting.pop(key, None)
            if not (isinstance(event, events.HealthChanged) and event.is_well):
                self._lasting[key] = [line]
        elif isinstance(event, events.EntriesWritten):
            self._note_entries(event)
        elif isinstance(event, events.Tick):
            for uid, letter in event.changes:
                self._letters[uid] = letter_after(self._letters.get(uid, letter), letter)
        elif isinstance(event, events.Answered):
            for about in reversed(list(self._lasting.values())):
                asked = about[0].event
                if isinstance(asked, events.Asked) and asked.call == event.call:
                    about[1:] = [line]
                    break
        elif isinstance(event, events.PassFinished):
            self._visits = event.number
            self._lasting.pop((events.PassStarted, None), None)
            self._visit.clear()

    def _note_entries(self, news: events.EntriesWritten) -> None:
        changed = dict(news.entries)
        texts = {**dict(self._written.entries), **changed}
        values = {name: value for name, value in self._written.values.items()
                  if name not in changed}
        self._written = events.EntriesWritten(
            [entry for entry in texts.items() if entry[1] is not None], {**values, **news.values})

    def head(self, lines: int, at: float, has_former: bool = True) -> bytes:
        """Return the first lines of the file that begins ``at`` that time; ``lines`` are those in
        the files before it. Without these it reads like the begin of a run."""
        visit = set(map(id, self._visit))
        known = [line for line in itertools.chain(*self._lasting.values()) if id(line) not in visit]
        known += self._visit
        if self._written.entries:
            known.append(events.Line(at, self._written))
        robot = self._state.robot
        whereabouts = events.Whereabouts(
            robot.place, robot.last_place, robot.goal_name, robot.way, robot.is_lost)
        if self._letters or whereabouts != events.Whereabouts():
            letters = (self._letters.get(uid, "-") for uid in range(1, self._nodes + 1))
            known.append(events.Line(at, events.TreeStatuses("".join(letters), whereabouts)))
        texts = [encode(line.time, replace(line.event, read=1)
                        if isinstance(line.event, events.Message) else line.event)
                 for line in known]
        repeated = 0
        if has_former:
            repeated = len(texts)
        return b"".join([header(os.getpid(), self._began, lines, self._visits, repeated), *texts])
