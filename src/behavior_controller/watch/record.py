"""The record of a run: all inputs and actions of the mission, one JSON object a line, complete enough to replay.

A line for each event, each traversal of the tree with the statuses that it changed, each request, each answer in the
traversal that saw it, and each message in the traversal that looked at it. The tick thread only queues what happened; a
separate thread formats the lines a little later, so that this delays nothing that the robot waits for.
"""
import collections
import os
import shutil
import threading
import time
from typing import Any, BinaryIO, Callable, Deque, Dict, List, Optional, Tuple, Union

from behavior_controller import folders
from behavior_controller.bt.engine.clock import Clock
from behavior_controller.bt.engine.tree import Change, Tree
from behavior_controller.events import Event
from behavior_controller.gateway import Call, Failure, Gateway, Sample, Topics
from behavior_controller.interface import Interface, Topic
from behavior_controller.interface.records import Answer, Request
from behavior_controller.interface.robots import DEFAULT
from behavior_controller.watch.codec import (FORMAT, LETTERS, VERSION, Answered, Asked, Entry, Header, Lost,
                                             Message, Tick, TreeNode, TreeShown, encode)

FILE_NAME = "mission.jsonl"

MOST_BYTES = 50_000_000
"""The most bytes of a record; the rest of a longer run is not recorded."""

MOST_RUNS = 20
"""Number of runs that are kept in the default folder."""

MOST_WAITING = 100_000
"""The most lines that wait for a slow disk."""

REST = 0.05
"""Seconds between two rounds of formatting lines."""


def new_folder(logs: str) -> str:
    """Return the folder of a new run below ``logs``, and remove all others but the newest ``MOST_RUNS - 1``."""
    place = os.path.join(logs, folders.RECORDS)
    runs = sorted(os.listdir(place)) if os.path.isdir(place) else []
    for name in runs[:max(0, len(runs) - MOST_RUNS + 1)]:
        shutil.rmtree(os.path.join(place, name), ignore_errors=True)
    return os.path.join(place, "{}_{}".format(time.strftime("%Y%m%d-%H%M%S"), os.getpid()))


def shown(tree: Tree) -> TreeShown:
    """Return the entry for a tree that is going to run."""
    return TreeShown(tree.id, [
        TreeNode(node.full_path, node.registration_id, node.name, node.parent.uid if node.parent else 0)
        for node in tree.nodes])


def traversed(at: float, is_first: bool, changes: List[Change]) -> Tick:
    """Return the entry for a traversal ``at`` that time of the clock, as a follower of its tree is told of it."""
    return Tick(at, is_first, [(node.uid, LETTERS[new]) for node, _, new in changes])


class Record:
    """Writes ``<directory>/mission.jsonl``. A sink of events. A failure to write is reported once; the run goes on.

    The file is opened, written and closed on a separate thread: a disk may be slow, or hang.
    """

    def __init__(self, directory: str, clock: Clock, complain: Callable[[str], None],
                 interface: Interface = DEFAULT):
        self._clock = clock
        self._interface = interface
        self.path = os.path.join(directory, FILE_NAME)
        self._complain = complain
        self._lost = 0  # notes that did not fit since the last one that did
        self._notes: Deque[Tuple[float, Callable[..., Entry], Tuple[Any, ...]]] = collections.deque()
        self._is_over = threading.Event()
        self._reads: Dict[Topic, int] = {}  # in this traversal
        self._seen: Dict[Topic, Optional[Sample]] = {}
        self._calls = 0
        self._thread: Optional[threading.Thread] = threading.Thread(target=self._write, name="record", daemon=True)
        self._thread.start()

    @property
    def is_kept(self) -> bool:
        """Whether the record has been written without a failure so far."""
        return self._thread is not None

    def _tell(self, reason: Any) -> None:
        self._complain("no record is written to {}: {}; the mission goes on".format(self.path, reason))

    def close(self) -> None:
        """Write the waiting lines, for a second at most."""
        thread = self._thread
        if thread is not None:
            self._note_loss()
            self._is_over.set()
            thread.join(1.0)

    # --------------------------------------------------------------------------------------------------------- writing

    def __call__(self, event: Event) -> None:
        """Record an event."""
        self._note(lambda: event)

    def _note(self, make: Callable[..., Entry], *values: Any) -> None:
        """Queue what happened, without waking a thread: the entry is made of ``values`` and written later."""
        if self._thread is None:
            return
        if len(self._notes) >= MOST_WAITING:
            self._lost += 1
            return
        self._note_loss()
        self._notes.append((time.time(), make, values))

    def _note_loss(self) -> None:
        """Put a ``Lost`` line where lines are missing."""
        if self._lost:
            self._notes.append((time.time(), Lost, (self._lost,)))
            self._lost = 0

    def _write(self) -> None:
        """Format and write lines until the end, on a separate thread, as a disk may be slow."""
        try:
            os.makedirs(os.path.dirname(self.path), exist_ok=True)
            # O_NONBLOCK: else open() would wait on a FIFO of that name
            flags = os.O_WRONLY | os.O_CREAT | os.O_TRUNC | os.O_NONBLOCK
            with open(os.open(self.path, flags, 0o666), "wb") as file:
                self._fill(file)
        except (OSError, ValueError) as error:
            self._tell(getattr(error, "strerror", None) or error)
        finally:
            self._thread = None
            self._notes.clear()

    def _fill(self, file: BinaryIO) -> None:
        is_last = False
        written = file.write(encode(time.time(), Header(FORMAT, VERSION, os.getpid())))
        while not is_last:
            is_last = self._is_over.wait(REST)
            while self._notes:
                line = self._line(*self._notes.popleft())
                written += len(line)
                if written > MOST_BYTES:
                    self._tell("it has reached {} bytes and ends here".format(MOST_BYTES))
                    return
                file.write(line)
            file.flush()

    def _line(self, when: float, make: Callable[..., Entry], values: Tuple[Any, ...]) -> bytes:
        entry = make(*values)
        if isinstance(entry, Lost):
            self._complain("the record {} lacks {} lines, because the disk is too slow; the mission goes on".format(
                self.path, entry.lines))
        return encode(when, entry)

    # ----------------------------------------------------------------------------------------------------- what happens

    def show(self, tree: Tree) -> None:
        """Record ``tree`` from now on."""
        tree.follow(self._follow)
        self._note(shown, tree)

    def _follow(self, is_first: Optional[bool], changes: List[Change]) -> None:
        self._reads.clear()
        if is_first is not None:  # what is halted or reset between two traversals follows from what is recorded
            self._note(traversed, self._clock.now(), is_first, changes)

    def gateway(self, inner: Gateway) -> Gateway:
        """Return a gateway that records requests and answers."""
        return _Gateway(inner, self)

    def topics(self, inner: Topics) -> Topics:
        """Return topics that record the messages that are read."""
        return _Topics(inner, self)

    def asked(self, request: Request) -> int:
        """Record a request and return its number."""
        self._calls += 1
        self._note(Asked, self._calls, self._interface.resource(type(request)), request)
        return self._calls

    def answered(self, call: int, result: Union[Answer, Failure]) -> None:
        """Record that the mission read the answer of a call."""
        self._note(Answered, call, result)

    def looked_at(self, topic: Topic, sample: Optional[Sample]) -> None:
        """Record that the mission read the newest message of a topic, if it differs from the last one read."""
        read = self._reads[topic] = self._reads.get(topic, 0) + 1
        if sample is not self._seen.get(topic):
            self._seen[topic] = sample
            value, arrived = (None, 0.0) if sample is None else (sample.value, sample.arrived)
            self._note(Message, topic.name, read, value, arrived)


class _Gateway(Gateway):
    """Forwards to the robot's, and records."""

    def __init__(self, inner: Gateway, record: Record):
        self._inner = inner
        self._record = record

    def start(self, request: Request) -> Call:
        number = self._record.asked(request)
        return _Call(self._inner.start(request), number, self._record)


class _Call(Call):
    """A call whose answer is recorded when it is read."""

    def __init__(self, inner: Call, number: int, record: Record):
        self._inner = inner
        self._number = number
        self._told = record
        self._is_told = False
        self.request = inner.request

    @property
    def result(self) -> Optional[Union[Answer, Failure]]:  # type: ignore[override]
        """The result, or None while there is none."""
        result = self._inner.result
        if result is not None and not self._is_told:
            self._is_told = True
            self._told.answered(self._number, result)
        return result

    def drop(self) -> None:
        """Drop the call."""
        self._inner.drop()


class _Topics(Topics):
    """Forwards to the robot's, and records."""

    def __init__(self, inner: Topics, record: Record):
        self._inner = inner
        self._record = record

    def newest(self, topic: Topic) -> Optional[Sample]:
        sample = self._inner.newest(topic)
        self._record.looked_at(topic, sample)
        return sample

    def wake_when(self, key: Any, topic: Topic, wanted: Callable[[Any], bool]) -> None:
        self._inner.wake_when(key, topic, wanted)

    def listen(self, topic: Topic, seconds: float) -> None:
        self._inner.listen(topic, seconds)
