"""What happens on the tick thread, queued there at next to no cost, and made into events elsewhere.
"""
import collections
from typing import Any, Callable, Deque, Dict, Iterator, List, Optional, Tuple

from behavior_controller.bt.values.blackboard import Entry as EntryOfTree
from behavior_controller.bt.engine.tree import Change, Tree
from behavior_controller.bt.values.status import NAMES
from behavior_controller.run import events
from behavior_controller.robot.requests import Location, Point
from behavior_controller.text import clean

LONGEST_ENTRY = 120
"""The most characters of the value of an entry."""

MOST_EVENTS = 100_000
"""The most events that wait for another thread."""


def traversed(at: float, is_first: Optional[bool], changes: List[Change]) -> events.Tick:
    """Return the event for a traversal ``at`` that time of the clock, as a follower of its tree is
    told of it."""
    letters = [(node.uid, events.LETTERS[NAMES[new]]) for node, _, new in changes]
    return events.Tick(at, is_first, letters)


def entry_text(value: Any) -> str:
    """Return the value of an entry as one line for people, short enough for a table."""
    if isinstance(value, list):
        text = ", ".join(getattr(item, "name", str(item)) for item in value)
    elif isinstance(value, Location):
        text = "x {:g} m, y {:g} m, {:g}°".format(*value)
    elif isinstance(value, Point):
        text = "x {:g} m, y {:g} m, z {:g} m".format(*value)
    elif isinstance(value, float) and value.is_integer():
        text = f"{value:.0f}"
    else:
        text = str(value)
    return clean(text, LONGEST_ENTRY)


def written(*entries: Tuple[str, Any]) -> events.EntriesWritten:
    """Return the event for entries with these values."""
    texts = [(name, None if value is None else entry_text(value)) for name, value in entries]
    plain = {name: _plain(value) for name, value in entries if value is not None}
    return events.EntriesWritten(texts, {name: plain[name] for name, text in texts
                                         if text is not None and plain[name] != text})


def _plain(value: Any) -> Any:
    """Return a value as numbers, texts, lists and objects, or None if it is none of these."""
    if isinstance(value, (bool, int, float, str)):
        return value
    if hasattr(value, "_asdict"):  # the mission's own records: places, points
        return {key: _plain(item) for key, item in sorted(value._asdict().items())}
    if isinstance(value, (list, tuple)):
        return list(map(_plain, value))
    return None


class Entries:
    """Which entries of a tree's blackboards were written since the last call of ``news``."""

    def __init__(self, tree: Tree) -> None:
        self._tree, self._writes = tree, 0
        self._known: Dict[str, Tuple[EntryOfTree, int]] = {}

    def news(self) -> List[Tuple[str, Any]]:
        """Return name and value of each entry that was written; None for one that was removed. On
        the tick thread."""
        if self._writes == self._tree.blackboard.writes:
            return []
        self._writes = self._tree.blackboard.writes
        before, self._known = self._known, {}
        changed: List[Tuple[str, Any]] = []
        for path, board in self._tree.blackboards.items():
            prefix = path and path + "/"
            for key, entry in board.local.items():
                name = prefix + key
                self._known[name] = entry, entry.sequence
                if before.pop(name, None) != self._known[name]:
                    changed.append((name, entry.value))
        return changed + [(name, None) for name in before]


class Feed:
    """What happens on the tick thread, as another thread takes it: as events, which it makes of
    what was queued, so that this takes no time from the robot. No thread is woken.

    ``lost`` is the number of those that did not fit since the last one that did.
    """

    def __init__(self) -> None:
        self.lost = 0
        self._most = MOST_EVENTS
        self._waiting: Deque[Tuple[float, Tuple[Optional[float], Optional[float]],
                                   Callable[..., events.Event], Tuple[Any, ...]]] = (
            collections.deque())

    def __call__(self, event: events.Event) -> None:
        """Queue an event."""
        self.put(lambda: event)

    def put(self, make: Callable[..., events.Event], *values: Any) -> None:
        """Queue the event that ``make`` makes of ``values``."""
        if len(self._waiting) >= self._most:
            self.lost += 1
            return
        self.note_loss()
        self._waiting.append((events.unix_now(), events.other_times(), make, values))

    def note_loss(self) -> None:
        """Queue a ``Lost`` where events are missing."""
        if self.lost:
            self._waiting.append(
                (events.unix_now(), events.other_times(), events.Lost, (self.lost,)))
            self.lost = 0

    def follow(self, tree: Tree) -> None:
        """Queue from now on each traversal of ``tree``, and what was written to its entries."""
        entries = Entries(tree)

        def note(is_first: Optional[bool], changes: List[Change]) -> None:
            news = entries.news()
            if news:
                self.put(written, *news)
            self.put(traversed, tree.clock.now(), is_first, changes)

        tree.follow(note)

    def stop(self) -> None:
        """Forget what waits, and queue nothing more."""
        self._most = 0
        self._waiting.clear()

    def lines(self) -> Iterator[events.Line]:
        """Yield what waits, each with its time."""
        while self._waiting:
            at, others, make, values = self._waiting.popleft()
            try:
                event = make(*values)
            except Exception as error:  # another package's value may do anything when it is read
                event = events.Lost(1, f"an event cannot be recorded: {type(error).__name__}")
            yield events.Line(at, event, *others)
