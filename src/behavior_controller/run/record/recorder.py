"""The record of a run: all inputs and actions of the mission, one JSON object a line, complete
enough to replay.

A line for each event, each traversal of the tree with the statuses and the entries that it changed,
each request, each answer in the traversal that saw it, and each message in the traversal that
looked at it. The tick thread only queues what happened. A thread makes a line of each event, once,
and hands it to the files of the record and to the viewer: each has a queue and a thread of its own.
"""
import collections
import contextlib
import threading
from functools import partial
from typing import (
    Any, Callable, Deque, Dict, Iterator, List, Mapping, NamedTuple, Optional, Protocol, Tuple)

from msgspec.structs import replace

from behavior_controller.bt.engine.clock import Clock
from behavior_controller.bt.engine.tree import Tree
from behavior_controller.run import events
from behavior_controller.run.record import files
from behavior_controller.run.record.codec import encode
from behavior_controller.run.record.feed import Feed
from behavior_controller.run.record.outset import Outset
from behavior_controller.run.record.tree_shown import Describe, shown
from behavior_controller.robot.declarations import Topic
from behavior_controller.robot.gateway import Sample, Topics

LONGEST_LINE = 10_000_000
"""The most bytes of a line, such as one with a large message."""

MOST_FOR_DISK = 100_000
"""The most lines that wait for a slow disk."""

LINES_AT_ONCE = 2000
"""The most lines that are written in a row: after a trouble of the disk many wait."""

OPENING = 0.5
"""The most seconds that ``open`` waits for the file."""

RECORD_INTERVAL = 0.05
"""Seconds between two rounds of formatting lines, and of writing them."""

DISK_RETRY = 2.0
"""Seconds between two attempts to write to a disk that is full or gone."""

CLOSING_LIMIT = 1.0
"""The most seconds to write what waits at the end."""

TOO_SLOW = "the disk is too slow"


class EncodedLine(NamedTuple):
    """An event, when it happened, and its line of the record."""

    time: float
    event: events.Event
    text: bytes


class Output(Protocol):
    """Takes the lines of a run."""

    def put(self, line: EncodedLine) -> None:
        """Take the next line, at once."""

    def close(self) -> None:
        """Finish: no line follows. Takes a bounded time."""


def encoded(time: float, event: events.Event, *others: Optional[float]) -> EncodedLine:
    """Return the line of an event; of one that cannot be written, the line that says so. For
    ``others`` see ``events.Line``."""
    text = b""
    with contextlib.suppress(Exception):  # another package's message may hold anything
        text = encode(time, event, *others)
    if not 0 < len(text) <= LONGEST_LINE:
        event = events.Lost(1, f"a line of the kind {type(event).__name__} cannot be written")
        text = encode(time, event, *others)
    return EncodedLine(time, event, text)


class Record(Feed, Topics):
    """Makes the lines of a run, and hands them to its ``outputs``. A sink of events, and the
    robot's topics as the mission reads them."""

    def __init__(self, *outputs: Output, describe: Describe = shown):
        """``describe`` makes the event for a tree that is going to run; its number counts them."""
        super().__init__()
        self._outputs, self._describe = list(outputs), describe
        self._is_over = threading.Event()
        self._thread = threading.Thread(target=self._work, name="record", daemon=True)
        self._reads: Dict[Topic, int] = {}  # in this traversal
        self._seen: Dict[Topic, Tuple[Sample, ...]] = {}
        self._said: Dict[str, events.TopicSaid] = {}
        self._trees = 0  # that were shown

    def add(self, output: Output) -> None:
        """Hand the lines that follow to a further output, too."""
        self._outputs.append(output)

    def open(self) -> "Record":
        """Make lines from now on, also of what has happened before; return itself."""
        if not self._thread.is_alive():
            self._thread.start()
        return self

    def finish(self) -> None:
        """Hand over the waiting lines; none follows. Takes ``CLOSING_LIMIT`` seconds at most."""
        self._is_over.set()
        if self._thread.is_alive():
            self._thread.join(CLOSING_LIMIT)
        self.stop()

    def close(self) -> None:
        """Hand over the waiting lines, and close the outputs."""
        for close in self.closers():
            close()

    def closers(self) -> List[Callable[[], None]]:
        """Return the functions that close the outputs, to be called on threads of their own."""
        def close(output: Output) -> None:
            self.finish()
            output.close()

        return [partial(close, output) for output in self._outputs]

    def hand_over(self) -> None:
        """Make a line of each event that waits, and hand it to the outputs. On one thread only: the
        record's own after ``open``."""
        for line in self.lines():
            made = encoded(line.time, line.event, line.ros, line.computer)
            for output in self._outputs:
                output.put(made)

    def _work(self) -> None:
        is_last = False
        while not is_last:
            is_last = self._is_over.wait(RECORD_INTERVAL)
            if is_last:
                self.note_loss()
            self.hand_over()

    # --------------------------------------------------------------------------------- what happens

    def show(self, tree: Tree, heard: Mapping[str, float] = {},
             said: Mapping[str, events.TopicSaid] = {}) -> None:
        """Record ``tree`` from now on, with each message that it reads, and signs of life.

        ``heard`` has the time of each topic's last message, by the tree's clock; ``said`` what it
        was.
        """
        self._seen.clear()
        self._trees += 1
        tree.follow(lambda is_first, changes: self._reads.clear())
        self.follow(tree)
        self.put(self._describe, tree, self._trees)
        if self._trees == 1:
            self._give_sign_of_life(tree.clock, heard, said)

    def _give_sign_of_life(self, clock: Clock, heard: Mapping[str, float],
                           said: Mapping[str, events.TopicSaid]) -> None:
        self.put(lambda heard: events.SignOfLife(
            {topic: events.unix_at(at) for topic, at in heard.items()}), dict(heard))
        clock.process.call_after(events.PULSE, lambda: self._give_sign_of_life(clock, heard, said))
        for topic, newest in dict(said).items():
            if self._said.get(topic) != newest:
                self._said[topic] = newest
                self(newest)

    # --------------------------------------------------------------------------- the robot's topics

    def topics(self, inner: Topics) -> Topics:
        """Return itself: topics like ``inner``, of which the messages that are read are recorded.
        """
        self._inner = inner
        return self

    def name(self, topic: Topic) -> str:
        return self._inner.name(topic)

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
            self.put(events.RecognitionPending, topic.name)
        return is_so

    def wake_when(self, key: Any, topic: Topic, wanted: Callable[[Any], bool]) -> None:
        self._inner.wake_when(key, topic, wanted)

    def listen(self, topic: Topic, seconds: float, prefers_action: bool = False) -> None:
        self._inner.listen(topic, seconds, prefers_action)

    def ignore(self, topic: Topic, reason: str, missed: Callable[[Any], bool]) -> None:
        self._inner.ignore(topic, reason, missed)


class LineQueue:
    """Keeps the lines of a run until they are taken."""

    def __init__(self) -> None:
        self._waiting: Deque[events.Line] = collections.deque(maxlen=MOST_FOR_DISK)

    def put(self, line: EncodedLine) -> None:
        """Keep a line."""
        self._waiting.append(events.Line(line.time, line.event))

    def close(self) -> None:
        """Do nothing: what waits can still be taken."""

    def take(self) -> Iterator[events.Line]:
        """Yield what waits."""
        while self._waiting:
            yield self._waiting.popleft()


class RecordFiles:
    """Writes the lines of a run to files in a folder of its own below ``place``.

    The files are opened, written and closed on a separate thread: a disk may be slow, or hang. A
    failure is reported once, and writing is tried again every ``DISK_RETRY`` seconds; the run goes
    on.
    """

    def __init__(self, place: str, complain: Callable[[str], None], robot: str = ""):
        """Write from now on. Waits ``OPENING`` for the disk, for ``path`` to be known. ``robot``:
        see ``files.robot_of``."""
        self.path = ""
        """The first file, as soon as it is there."""
        self._place, self._robot = place, robot
        self._complain = complain
        self._waiting: Deque[EncodedLine] = collections.deque()  # the first one is being written
        self._lost = 0  # lines that did not fit since the last one that did
        self._outset = Outset()
        self._files: Optional[files.RunFiles] = None
        self._trouble = ""  # why writing fails, or has failed while lines that wait came
        self._fails = False
        self._is_over = threading.Event()
        self._is_open = threading.Event()  # or has failed
        self._thread = threading.Thread(target=self._work, name="record files", daemon=True)
        self._thread.start()
        self._is_open.wait(OPENING)

    def put(self, line: EncodedLine) -> None:
        """Queue a line."""
        if len(self._waiting) >= MOST_FOR_DISK:
            self._lost += 1
            return
        if self._lost:
            self._waiting.append(encoded(line.time, events.Lost(self._lost)))
            self._lost = 0
        self._waiting.append(line)

    def close(self) -> None:
        """Write the waiting lines, for ``CLOSING_LIMIT`` seconds at most."""
        if self._lost:
            self._waiting.append(encoded(events.unix_now(), events.Lost(self._lost)))
        self._is_over.set()
        self._thread.join(CLOSING_LIMIT)

    def _work(self) -> None:
        is_last = False
        while True:
            try:
                self._write_round(is_last)
            except (OSError, ValueError) as error:
                self._note_failure(getattr(error, "strerror", None) or str(error), is_last)
            self._is_open.set()
            if is_last:
                break
            is_last = self._is_over.wait(DISK_RETRY if self._fails else RECORD_INTERVAL)
        self._waiting.clear()
        if self._files is not None:
            self._files.close()

    def _note_failure(self, trouble: str, is_last: bool) -> None:
        self._trouble = trouble
        if is_last and self.path:
            self._complain(f"the record {self.path} lacks the end of the run: {trouble}")
        elif not self._fails:
            self._complain(f"no record is written to {self.path or self._place}: {trouble}; it is "
                           "tried again, the mission goes on")
        self._fails = True

    def _write_round(self, is_last: bool) -> None:
        """Write what waits. Raises OSError or ValueError; the next round goes on there."""
        if self._files is None:
            self._files = files.RunFiles(self._place, self._outset.head(0, 0.0), self._robot)
            self.path = self._files.path
            files.make_room(self._place)
        if self._files.is_lost:
            self._files.begin_next(self._outset.head(self._files.lines, events.unix_now()))
        self._files.flush()
        for _ in range(len(self._waiting) if is_last else min(LINES_AT_ONCE, len(self._waiting))):
            self._add(self._files, self._waiting[0])
            self._waiting.popleft()
        self._files.flush()
        if self._fails:
            self._complain(f"the record {self.path} is written again")
        self._fails = False
        if not (self._lost or self._waiting):
            self._trouble = ""

    def _add(self, out: files.RunFiles, line: EncodedLine) -> None:
        """Add a line, to a further file if the newest one is full: between two passes if possible.
        """
        event = line.event
        if isinstance(event, events.Lost) and not event.reason:
            event = replace(event, reason=self._trouble or TOO_SLOW)
            line = encoded(line.time, event)
            self._complain(f"the record {self.path} lacks {event.lines} lines: {event.reason}; "
                           "the mission goes on")
        room = files.FILE_BYTES // (2 if isinstance(event, events.PassStarted) else 1)
        if out.size and out.size + len(line.text) > room:
            out.flush()
            out.begin_next(self._outset.head(out.lines, line.time))
        self._outset.take(line.time, event)
        out.add(line.text)
