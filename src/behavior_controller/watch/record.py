"""The record of a run: all that the mission was told and did, one JSON object a line, complete enough to replay.

A line for each event, each traversal of the tree with the statuses that it changed, each request, each answer in the
traversal that saw it, and each message in the traversal that looked at it. The tick thread only notes what happened; a
thread of its own makes lines of it, a little later, so that it competes with nothing that the robot waits for.
"""
import collections
import dataclasses
import hashlib
import json
import os
import shutil
import threading
import time
from typing import Any, BinaryIO, Callable, Deque, Dict, List, Optional, Tuple, Union

from behavior_controller import folders
from behavior_controller.bt.engine.clock import Clock
from behavior_controller.bt.engine.tree import Tree
from behavior_controller.bt.language.document import LARGEST
from behavior_controller.events import Event, RunStarted
from behavior_controller.gateway import Call, Failure, Gateway, Sample, Topics
from behavior_controller.interface import Topic
from behavior_controller.interface.document import INTERFACE
from behavior_controller.interface.records import Answer, Request
from behavior_controller.text import Unreadable, read_bytes
from behavior_controller.watch.board import LETTERS

FILE_NAME = "mission.jsonl"

LOST = "Lost"
"""The event that stands where lines did not fit into the queue."""

MOST_BYTES = 50_000_000
"""No record is larger; a longer run is recorded up to there."""

MOST_RUNS = 20
"""So many runs are kept in the default folder."""

MOST_WAITING = 100_000
"""Lines that may wait for a slow disk."""

REST = 0.05
"""Seconds between two times that lines are made of what has happened."""


def new_folder(logs: str) -> str:
    """Return the folder of a new run below ``logs``, and remove all but the newest ``MOST_RUNS - 1`` that are there."""
    place = os.path.join(logs, folders.RECORDS)
    runs = sorted(os.listdir(place)) if os.path.isdir(place) else []
    for name in runs[:max(0, len(runs) - MOST_RUNS + 1)]:
        shutil.rmtree(os.path.join(place, name), ignore_errors=True)
    return os.path.join(place, "{}_{}".format(time.strftime("%Y%m%d-%H%M%S"), os.getpid()))


class Record:
    """Writes ``<directory>/mission.jsonl``. A sink of events. What cannot be written is told once; the run goes on.

    The file is opened, written and closed on a thread of its own: a disk may take its time, or for ever.
    """

    def __init__(self, directory: str, clock: Clock, complain: Callable[[str], None]):
        self.path = os.path.join(directory, FILE_NAME)
        self._clock = clock
        self._complain = complain
        self._lost = 0  # notes that did not fit since the last one that did
        self._notes: Deque[Tuple[str, float, Dict[str, Any]]] = collections.deque()
        self._is_over = threading.Event()
        self._changes: List[Tuple[int, str]] = []  # of this traversal
        self._is_first = self._is_traversing = False
        self._reads: Dict[Topic, int] = {}  # in this traversal
        self._seen: Dict[Topic, Optional[Sample]] = {}
        self._calls = 0
        self._thread: Optional[threading.Thread] = threading.Thread(target=self._write, name="record", daemon=True)
        self._thread.start()

    @property
    def is_kept(self) -> bool:
        """Whether nothing has kept the record from being written so far."""
        return self._thread is not None

    def _tell(self, reason: Any) -> None:
        self._complain("no record is written to {}: {}; the mission goes on".format(self.path, reason))

    def close(self) -> None:
        """Write what waits, for a second at the most."""
        thread = self._thread
        if thread is not None:
            self._note_loss()
            self._is_over.set()
            thread.join(1.0)

    # --------------------------------------------------------------------------------------------------------- writing

    def _put(self, event_name: str, **fields: Any) -> None:
        """Note what happened, and wake nobody; values that JSON does not know are made plain later."""
        if self._thread is None:
            return
        if len(self._notes) >= MOST_WAITING:
            self._lost += 1
            return
        self._note_loss()
        self._notes.append((event_name, time.time(), fields))

    def _note_loss(self) -> None:
        """Put a line where lines are missing."""
        if self._lost:
            self._notes.append((LOST, time.time(), {"lines": self._lost}))
            self._lost = 0

    def _write(self) -> None:
        """Make lines until the end; on a thread of its own, as a disk may take its time."""
        try:
            os.makedirs(os.path.dirname(self.path), exist_ok=True)
            # O_NONBLOCK: else a FIFO of that name would be waited for
            flags = os.O_WRONLY | os.O_CREAT | os.O_TRUNC | os.O_NONBLOCK
            with open(os.open(self.path, flags, 0o666), "wb") as file:
                self._fill(file)
        except (OSError, ValueError) as error:
            self._tell(getattr(error, "strerror", None) or error)
        self._thread = None
        self._notes.clear()

    def _fill(self, file: BinaryIO) -> None:
        is_last, written = False, 0
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

    def _line(self, name: str, when: float, fields: Dict[str, Any]) -> bytes:
        if name == LOST:
            self._complain("the record {} lacks {} lines, because the disk is too slow; the mission goes on".format(
                self.path, fields["lines"]))
        if name == RunStarted.__name__:
            fields["sha256"] = sha256(fields["mission"])
        line = dict({"event": name, "time": when}, **{key: _plain(value) for key, value in fields.items()})
        # a lone surrogate is written as JSON escapes it
        return (json.dumps(line, ensure_ascii=False, default=str) + "\n").encode("utf-8", "backslashreplace")

    # ----------------------------------------------------------------------------------------------------- what happens

    def __call__(self, event: Event) -> None:
        """Record an event."""
        if isinstance(event, RunStarted):
            self._put("RunStarted", pid=os.getpid(), **event._asdict())
        else:
            self._put(type(event).__name__, **event._asdict())

    def show(self, tree: Tree) -> None:
        """Record ``tree`` from now on."""
        tree.subscribe(self._observe)
        tree.traversals = self
        self._put("Tree", id=tree.id, nodes=[
            [node.full_path, node.registration_id, node.name, node.parent.uid if node.parent else 0]
            for node in tree.nodes])

    def begin(self, is_first: bool) -> None:
        """A traversal begins, the first one of a tick or a further one."""
        self._reads.clear()
        self._changes = []
        self._is_first, self._is_traversing = is_first, True

    def end(self) -> None:
        """The traversal is over."""
        self._is_traversing = False
        self._put("Tick", at=self._clock.now(), first=self._is_first, changes=self._changes)

    def _observe(self, node: Any, old: Any, new: Any) -> None:
        if self._is_traversing:  # what is halted or reset between two traversals follows from what is recorded
            self._changes.append((node.uid, LETTERS[new]))

    def gateway(self, inner: Gateway) -> Gateway:
        """Return a gateway that records requests and answers."""
        return _Gateway(inner, self)

    def topics(self, inner: Topics) -> Topics:
        """Return topics that record the messages that were looked at."""
        return _Topics(inner, self)

    def asked(self, request: Request) -> int:
        """Record a request and return its number."""
        self._calls += 1
        self._put("Asked", call=self._calls, service=INTERFACE.service(type(request)).name, request=request)
        return self._calls

    def answered(self, call: int, result: Union[Answer, Failure]) -> None:
        """Record that the mission saw the answer of a call."""
        self._put("Answered", call=call, **{"failure" if isinstance(result, Failure) else "answer": result})

    def looked_at(self, topic: Topic, sample: Optional[Sample]) -> None:
        """Record that the mission looked at the newest message of a topic, if that was another one than last time."""
        self._reads[topic] = self._reads.get(topic, 0) + 1
        if sample is not self._seen.get(topic):
            self._seen[topic] = sample
            self._put("Message", topic=topic.name, read=self._reads[topic], value=sample.value if sample else None,
                      arrived=sample.arrived if sample else 0.0)


class _Gateway(Gateway):
    """Passes on, and records."""

    def __init__(self, inner: Gateway, record: Record):
        self._inner = inner
        self._record = record

    def start(self, request: Request) -> Call:
        """Send ``request``."""
        number = self._record.asked(request)
        return _Call(self._inner.start(request), number, self._record)


class _Call(Call):
    """A call whose answer is recorded when it is seen."""

    def __init__(self, inner: Call, number: int, record: Record):
        self._inner = inner
        self._number = number
        self._told = record
        self._is_told = False
        self.request = inner.request

    @property
    def result(self) -> Optional[Union[Answer, Failure]]:  # type: ignore[override]
        """The result, once there is one."""
        result = self._inner.result
        if result is not None and not self._is_told:
            self._is_told = True
            self._told.answered(self._number, result)
        return result

    def drop(self) -> None:
        """Nobody waits any more."""
        self._inner.drop()


class _Topics(Topics):
    """Passes on, and records."""

    def __init__(self, inner: Topics, record: Record):
        self._inner = inner
        self._record = record

    def newest(self, topic: Topic) -> Optional[Sample]:
        """Return the newest message."""
        sample = self._inner.newest(topic)
        self._record.looked_at(topic, sample)
        return sample

    def wake_when(self, key: Any, topic: Topic, wanted: Callable[[Any], bool]) -> None:
        """Set the alarm."""
        self._inner.wake_when(key, topic, wanted)


def plain_request(request: Request) -> List[Any]:
    """Return a request as JSON holds it: its kind and its fields."""
    return [type(request).__name__, json.loads(json.dumps(dataclasses.asdict(request)))]


def _plain(value: Any) -> Any:
    """Return a value as JSON can hold it: failures as objects, other records as lists."""
    if isinstance(value, tuple(service.request for service in INTERFACE.services)):
        return plain_request(value)
    if isinstance(value, Failure):
        return {"cause": value.cause.value, "message": value.message, "resource": value.resource}
    return value


def sha256(path: str) -> str:
    """Return the hash of a file; empty if it cannot be read."""
    try:
        return hashlib.sha256(read_bytes(path, LARGEST)).hexdigest()
    except Unreadable:
        return ""
