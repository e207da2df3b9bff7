"""The record of a run: all inputs and actions of the mission, one JSON object a line, complete
enough to replay.

A line for each event, each traversal of the tree with the statuses and the entries that it changed,
each request, each answer in the traversal that saw it, and each message in the traversal that
looked at it. The tick thread only queues what happened; a separate thread formats the lines a
little later, so that this delays nothing that the robot waits for.
"""
import collections
import itertools
import os
import threading
import time
from typing import Any, Callable, Deque, Dict, Iterator, List, Optional, Tuple

from msgspec.structs import replace

from behavior_controller.bt.engine.node import PRE_CONDITIONS
from behavior_controller.bt.engine.tree import Change, Tree
from behavior_controller.bt.engine.blackboard import Entry as EntryOfTree
from behavior_controller.execution import events
from behavior_controller.robot.gateway import Sample, Topics
from behavior_controller.robot.declarations import Topic
from behavior_controller.robot.requests import Location, Point
from behavior_controller.text import clean
from behavior_controller.monitoring.record import files
from behavior_controller.monitoring.record.codec import encode, header

LONGEST_VALUE = 120
"""The most characters of the value of an entry."""

LONGEST_LINE = 10_000_000
"""The most bytes of a line, such as one with a large message."""

MOST_WAITING = 100_000
"""The most events that wait for another thread, such as that of a slow disk."""

AT_ONCE = 2000
"""The most lines that are formatted in a row: after a trouble of the disk many wait."""

OPENING = 0.5
"""The most seconds that ``open`` waits for the file."""

REST = 0.05
"""Seconds between two rounds of formatting lines."""

RETRY = 2.0
"""Seconds between two attempts to write to a disk that is full or gone."""

TOO_SLOW = "the disk is too slow"


def shown(tree: Tree) -> events.TreeShown:
    """Return the event for a tree that is going to run."""
    return events.TreeShown(tree.id, list(map(_shown_node, tree.nodes)))


def _shown_node(node: Any) -> events.TreeNode:
    pause = node.attributes.get(node.spec.pause, "")
    return events.TreeNode(
        node.full_path, node.registration_id, node.name, node.parent.uid if node.parent else 0,
        int(pause) / 1000.0 if pause.isdecimal() else 0.0,
        any(node.attributes.get(name) for name in PRE_CONDITIONS))


def traversed(at: float, is_first: Optional[bool], changes: List[Change]) -> events.Tick:
    """Return the event for a traversal ``at`` that time of the clock, as a follower of its tree is
    told of it."""
    return events.Tick(at, is_first, [(node.uid, events.LETTERS[new]) for node, _, new in changes])


def entry_text(value: Any) -> str:
    """Return the value of an entry as one line for people, short enough for a table."""
    if isinstance(value, list):
        text = ", ".join(getattr(item, "name", str(item)) for item in value)
    elif isinstance(value, Location):
        text = "x {:g} m, y {:g} m, {:g}°".format(*value)
    elif isinstance(value, Point):
        text = "x {:g} m, y {:g} m, z {:g} m".format(*value)
    else:
        is_whole = isinstance(value, float) and value.is_integer()
        text = f"{value:.0f}" if is_whole else str(value)
    return clean(text, LONGEST_VALUE)


def written(*entries: Tuple[str, Any]) -> events.EntriesWritten:
    """Return the event for entries with these values."""
    return events.EntriesWritten([(name, None if value is None else entry_text(value))
                           for name, value in entries])


class Entries:
    """Which entries of a tree's blackboards were written since the last call of ``news``."""

    def __init__(self, tree: Tree) -> None:
        self._tree = tree
        self._writes = 0
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
            for key, entry in board.local.items():
                name = f"{path}/{key}" if path else key
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
        self._most = MOST_WAITING
        self._waiting: Deque[Tuple[float, Callable[..., events.Event], Tuple[Any, ...]]] = (
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
        self._waiting.append((events.unix_now(), make, values))

    def note_loss(self) -> None:
        """Queue a ``Lost`` where events are missing."""
        if self.lost:
            self._waiting.append((events.unix_now(), events.Lost, (self.lost,)))
            self.lost = 0

    def follow(self, tree: Tree, is_wanted: Callable[[Optional[bool], List[Change]], bool]) -> None:
        """Queue from now on what was written to the entries of ``tree``, and each of its traversals
        that ``is_wanted``."""
        entries = Entries(tree)

        def note(is_first: Optional[bool], changes: List[Change]) -> None:
            news = entries.news()
            if news:
                self.put(written, *news)
            if is_wanted(is_first, changes):
                self.put(traversed, tree.clock.now(), is_first, changes)

        tree.follow(note)

    def stop(self) -> None:
        """Forget what waits, and queue nothing more."""
        self._most = 0
        self._waiting.clear()

    def lines(self) -> Iterator[events.Line]:
        """Yield what waits, each with its time."""
        while self._waiting:
            at, make, values = self._waiting.popleft()
            yield events.Line(at, make(*values))


LASTING: Dict[type, Callable[[Any], Any]] = {
    events.TreeShown: lambda event: None, events.RunStarted: lambda event: None,
    events.PassStarted: lambda event: None, events.Suspended: lambda event: None,
    events.SafeStateReported: lambda event: None, events.Message: lambda event: event.topic,
    events.HealthChanged: lambda event: (event.name, event.respect),
    events.Asked: lambda event: type(event.request)}
"""The events that hold until another one of the same kind with the same key."""


class Outset:
    """What has to be known of a run where a further file of it begins, so that this file is read
    without those before it."""

    def __init__(self) -> None:
        self._began = events.unix_now()
        self._visits = 0
        self._lasting: Dict[Any, List[events.Event]] = {}  # an ``Asked`` with its answer
        self._entries: Dict[str, Optional[str]] = {}  # of the blackboard, as texts

    def take(self, event: events.Event) -> None:
        """Note the next event."""
        kind, key_of = type(event), LASTING.get(type(event))
        if key_of is not None:
            key = kind, key_of(event)
            if kind not in (events.TreeShown, events.RunStarted):  # which stay first
                self._lasting.pop(key, None)
            if kind is events.TreeShown:
                self._entries.clear()
            if not (isinstance(event, events.HealthChanged) and event.is_well):
                self._lasting[key] = [event]
        elif isinstance(event, events.EntriesWritten):
            self._entries.update(event.entries)
        elif isinstance(event, events.Answered):
            for about in reversed(list(self._lasting.values())):
                if isinstance(about[0], events.Asked) and about[0].call == event.call:
                    about[1:] = [event]
                    break
        elif isinstance(event, events.PassFinished):
            self._visits = event.number
            self._lasting.pop((events.PassStarted, None), None)

    def head(self, lines: int, at: float) -> bytes:
        """Return the first lines of the file that begins ``at`` that time; ``lines`` are those in
        the files before it."""
        known = list(itertools.chain(*self._lasting.values()))
        entries = [entry for entry in self._entries.items() if entry[1] is not None]
        known += [events.EntriesWritten(entries)] if entries else []
        texts = [encode(at, replace(event, read=1) if isinstance(event, events.Message) else event)
                 for event in known]
        return b"".join([header(os.getpid(), self._began, lines, self._visits, len(texts)), *texts])


class Record(Feed, Topics):
    """Writes the files of a run in a folder of its own below ``place``. A sink of events, and the
    robot's topics as the mission reads them.

    The files are opened, written and closed on a separate thread: a disk may be slow, or hang. A
    failure is reported once, and writing is tried again every ``RETRY`` seconds; the run goes on.
    """

    def __init__(self, place: str, complain: Callable[[str], None]):
        super().__init__()
        self.path = ""
        """The first file, as soon as it is there."""
        self._place = place
        self._complain = complain
        self._outset = Outset()
        self._files: Optional[files.RunFiles] = None
        self._unwritten: List[events.Line] = []  # the line at which writing has failed
        self._trouble = ""  # why writing fails, or has failed while lines that wait came
        self._fails = False
        self._is_over = threading.Event()
        self._reads: Dict[Topic, int] = {}  # in this traversal
        self._seen: Dict[Topic, Tuple[Sample, ...]] = {}
        self._is_open = threading.Event()  # or has failed
        self._thread: Optional[threading.Thread] = threading.Thread(
            target=self._write, name="record", daemon=True)

    def open(self) -> "Record":
        """Write from now on, also what has happened before; return itself.

        Until then the disk is as it was. Waits ``OPENING`` for the disk, for ``path`` to be known.
        """
        if self._thread is not None:
            self._thread.start()
            self._is_open.wait(OPENING)
        return self

    @property
    def is_kept(self) -> bool:
        """Whether lines are taken: until all are written after ``close``."""
        return self._thread is not None

    def close(self) -> None:
        """Write the waiting lines, for a second at most."""
        thread = self._thread
        if thread is not None and thread.is_alive():
            self.note_loss()
            self._is_over.set()
            thread.join(1.0)

    # -------------------------------------------------------------------------------------- writing

    def _write(self) -> None:
        """Format and write lines until the end, on a separate thread, as a disk may be slow."""
        is_last = False
        while True:
            try:
                self._write_round(is_last)
            except (OSError, ValueError) as error:
                self._trouble = getattr(error, "strerror", None) or str(error)
                if is_last and self.path:
                    self._complain(f"the record {self.path} lacks the end of the run: "
                                   f"{self._trouble}")
                elif not self._fails:
                    self._complain(f"no record is written to {self.path or self._place}: "
                                   f"{self._trouble}; it is tried again, the mission goes on")
                self._fails = True
            self._is_open.set()
            if is_last:
                break
            is_last = self._is_over.wait(RETRY if self._fails else REST)
        self._thread = None
        self.stop()
        if self._files is not None:
            self._files.close()

    def _write_round(self, is_last: bool) -> None:
        """Write what waits. Raises OSError or ValueError; the next round goes on there."""
        if self._files is None:
            self._files = files.RunFiles(self._place, self._outset.head(0, 0.0))
            self.path = self._files.path
            files.make_room(self._place)
        if self._files.is_lost:
            self._files.begin_next(self._outset.head(self._files.lines, events.unix_now()))
        self._files.flush()
        new = itertools.islice(self.lines(), None if is_last else AT_ONCE)
        for line in itertools.chain(self._unwritten, new):
            self._unwritten = [line]
            self._add(self._files, line)
            self._unwritten = []
        self._files.flush()
        if self._fails:
            self._complain(f"the record {self.path} is written again")
        self._fails = False
        if not (self.lost or self._waiting):
            self._trouble = ""

    def _add(self, out: files.RunFiles, line: events.Line) -> None:
        """Add a line, to a further file if the newest one is full: between two passes if possible.
        """
        event, text = line.event, b""
        if isinstance(event, events.Lost):
            event = replace(event, reason=event.reason or self._trouble or TOO_SLOW)
            self._complain(f"the record {self.path} lacks {event.lines} lines: {event.reason}; "
                           "the mission goes on")
        try:
            text = encode(line.time, event)
        except Exception:  # another package's message may hold anything
            pass
        if not 0 < len(text) <= LONGEST_LINE:
            event = events.Lost(1, f"a line of the kind {type(event).__name__} cannot be written")
            text = encode(line.time, event)
        room = files.FILE_BYTES // (2 if isinstance(event, events.PassStarted) else 1)
        if out.size and out.size + len(text) > room:
            out.flush()
            out.begin_next(self._outset.head(out.lines, line.time))
        self._outset.take(event)
        out.add(text)

    # --------------------------------------------------------------------------------- what happens

    def show(self, tree: Tree) -> None:
        """Record ``tree`` from now on, with each message that it reads."""
        self._seen.clear()
        tree.follow(lambda is_first, changes: self._reads.clear())
        # what is halted or reset between two traversals follows from what is recorded
        self.follow(tree, lambda is_first, changes: is_first is not None)
        self.put(shown, tree)

    # --------------------------------------------------------------------------- the robot's topics

    def topics(self, inner: Topics) -> Topics:
        """Return itself: topics like ``inner``, of which the messages that are read are recorded.
        """
        self._inner = inner
        return self

    def recent(self, topic: Topic) -> Tuple[Sample, ...]:
        """Record those messages of a topic that the mission had not read before."""
        samples = self._inner.recent(topic)
        read = self._reads[topic] = self._reads.get(topic, 0) + 1
        before = self._seen.get(topic, ())
        if samples is not before:
            self._seen[topic] = samples
            known = set(map(id, before))
            for sample in samples:
                if id(sample) not in known:
                    self.put(events.Message, topic.name, read, sample.value, sample.arrived)
        return samples

    def is_hearing(self, topic: Topic) -> bool:
        """Record that the robot still hears something on a topic."""
        is_so = self._inner.is_hearing(topic)
        if is_so:
            self.put(events.StillHearing, topic.name)
        return is_so

    def wake_when(self, key: Any, topic: Topic, wanted: Callable[[Any], bool]) -> None:
        self._inner.wake_when(key, topic, wanted)

    def listen(self, topic: Topic, seconds: float) -> None:
        self._inner.listen(topic, seconds)

    def ignore(self, topic: Topic, reason: str, missed: Callable[[Any], bool]) -> None:
        self._inner.ignore(topic, reason, missed)
