"""A record as text: one JSON object a line, how it is written, read and checked.

The first line is a ``Header``, each other line an ``events.Line``. Every change of what these hold
needs a new ``VERSION``, except a field with a default.
"""
import io
import json
from typing import Any, Iterator, List, Optional, Tuple

import msgspec
from msgspec.structs import replace

from behavior_controller.errors import Fault, MissionError
from behavior_controller.run.events import (Event, Line, Lost, Message, PassFinished, RunStarted,
                                            Tick, TreeNode, TreeShown, is_simulated, unix_at)
from behavior_controller.robot.interfaces import DEFAULT, INTERFACES

FORMAT = "behaviorController record"
VERSION = 11

LATEST_TIME = 1e11
"""The latest time, in Unix seconds, that a record may have: a date in the year 5138."""


class Header(msgspec.Struct, frozen=True):
    """The first line: the file's format and version, and the process that writes it since ``time``
    (Unix seconds).

    ``unix_at_zero`` is the time of events at which the monotonic clock of its computer is 0; 0
    itself if the mission's time is simulated.
    Of a further file of a long run: how many ``lines`` of events and ``visits`` the files before it
    had, and how many lines after this one repeat events from there.
    """

    format: str
    version: int
    pid: int
    time: float
    lines: int = 0
    visits: int = 0
    repeated: int = 0
    unix_at_zero: float = 0.0


_encoder = msgspec.json.Encoder(enc_hook=str)  # a foreign message may hold anything
_lines, _headers = msgspec.json.Decoder(Line), msgspec.json.Decoder(Header)


def header(pid: int, time: float, lines: int = 0, visits: int = 0, repeated: int = 0) -> bytes:
    """Return the first line with its end."""
    return _encoder.encode(Header(FORMAT, VERSION, pid, time, lines, visits, repeated,
                                  0.0 if is_simulated() else unix_at(0.0))) + b"\n"


def encode(time: float, event: Event, *others: Optional[float]) -> bytes:
    """Return a line with its end. For ``others`` see ``Line``."""
    line = Line(time, event, *others)
    try:
        return _encoder.encode(line) + b"\n"
    except UnicodeEncodeError:  # a lone surrogate, which only JSON's own escapes can write
        return json.dumps(msgspec.to_builtins(line, enc_hook=str)).encode() + b"\n"


class Decoder:
    """Reads the lines of one file of a record in order, and checks each against those before it.

    Raises MissionError if the version is not supported, or for the first line that the node cannot
    have written.
    """

    def __init__(self, file: str, former: "Optional[Decoder]" = None, is_late: bool = False):
        """``former`` has read the file before it of the same run, if there is one. ``is_late``:
        what the files before it have is not missing."""
        self.has_mission = False
        self._file, self._is_late = file, is_late
        self._read = 0  # lines
        self.head = Header(FORMAT, VERSION, 0, 0.0)
        self._run: Optional[Tuple[int, float]] = None  # process and beginning
        self._is_foreign = False  # the file is of another run
        self._lines = self._visits = 0  # of the run
        if former is not None:
            self.has_mission, self._run = former.has_mission, former._run
            self._lines, self._visits = former._lines, former._visits
        self._interface = DEFAULT  # of the running mission
        self._shown = self._running = 0  # nodes of the newest tree, and of the running mission's

    def read_all(self, data: bytes) -> Iterator[Line]:
        """Yield the lines in the content of the file, without a torn end."""
        for text in io.BytesIO(data):
            if text.endswith(b"\n"):  # else it was torn when the node was killed
                yield from self.read(text)

    def finish(self) -> None:
        """Raise MissionError if no file of the record has a mission in it."""
        if not self.has_mission:
            raise MissionError.of(self._file, "the record has no mission in it",
                                  "was the node stopped before it began?")

    def read(self, text: bytes) -> List[Line]:
        """Return the line in a text; none for the header, and for what a file before it has too.
        Raises MissionError."""
        self._read += 1
        try:
            if self._read == 1:
                self._check_header(text)
            if self._read == 1 or self._is_foreign:
                return []
            return self._joined(self._checked(self._line(text)))
        except RecursionError:
            why = "it is nested too deeply"
        except (msgspec.MsgspecError, ValueError, LookupError) as error:
            why = str(error)
        raise self._fault(f"this is not a line of a record: {why}",
                          "a record is written by the node")

    def _joined(self, line: Line) -> List[Line]:
        """Return a line that follows on those of the file before it; where some are missing, what
        is repeated of them, and last that they are missing."""
        head, number = self.head, self._read - 1
        if number > head.repeated:
            place = head.lines + number - head.repeated
            if place <= self._lines:
                return []  # it was written to a disk that then failed, and so again
            self._lines = place
            if isinstance(line.event, PassFinished):
                self._visits = line.event.number
            return [line]
        missing = head.lines - self._lines
        if missing <= 0:
            return []
        if number < head.repeated:
            return [line]
        first, last = self._visits + 1, head.visits
        reason = f"visits {first} to {last} are no longer kept"
        if first == last:
            reason = f"visit {first} is no longer kept"
        elif first > last:
            reason = f"visit {first} is no longer kept from its beginning"
        self._lines, self._visits = head.lines, head.visits
        if self._is_late:
            return [line]
        return [line, Line(line.time, Lost(missing, reason))]

    def _fault(self, text: str, hint: str) -> MissionError:
        return MissionError([Fault(self._file, self._read, 1, text, hint)])

    def _check_header(self, text: bytes) -> None:
        try:
            head = _headers.decode(text.decode("utf-8-sig"))
        except msgspec.ValidationError:  # JSON, and no header
            head = Header("", 0, 0, 0.0)
        if head.format != FORMAT or min(head.lines, head.visits, head.repeated) < 0 \
                or head.repeated and not head.lines:
            raise self._fault("this is no record: it does not begin with the header of one",
                              "name the mission.jsonl of a run")
        if head.version != VERSION:
            raise self._fault(f"the record has the version {head.version}; this release reads "
                              f"version {VERSION}", "replay it with the release that wrote it")
        self.head = head
        self._is_foreign = self._run not in (None, (head.pid, head.time))
        self._run = self._run or (head.pid, head.time)

    def _line(self, text: bytes) -> Line:
        has_escapes = b"\\u" in text  # perhaps a lone surrogate, which the quick decoder refuses
        line = msgspec.convert(json.loads(text), Line) if has_escapes else _lines.decode(text)
        if not isinstance(line.event, Message):
            return line
        kind: Any = self._interface.topic(line.event.topic).value
        value = msgspec.convert(line.event.value, kind)
        return replace(line, event=replace(line.event, value=value))

    def _checked(self, line: Line) -> Line:
        """Return the line. Raises ValueError if it cannot stand here."""
        event = line.event
        if not 0 <= line.time <= LATEST_TIME:
            raise ValueError(f"{line.time} is not a time")
        if isinstance(event, TreeShown):
            _check_parents(event.nodes)
            self._shown = len(event.nodes)
        elif isinstance(event, RunStarted):
            self._start(event)
        elif isinstance(event, Tick) and self.has_mission:
            if not all(0 < uid <= self._running for uid, _ in event.changes):
                raise ValueError(f"the tree has only {self._running} nodes")
        elif getattr(event, "call", 1) < 1:
            raise ValueError("calls count from 1")
        elif isinstance(event, Message) and event.read < 1:
            raise ValueError("reads count from 1")
        return line

    def _start(self, event: RunStarted) -> None:
        if not self._shown:
            raise ValueError("no tree comes before it")
        if not event.sources.documents:
            raise ValueError("the mission has no documents")
        self.has_mission, self._running = True, self._shown
        # a replay refuses an unknown interface
        self._interface = INTERFACES.get(event.sources.interface, DEFAULT)


def _check_parents(nodes: List[TreeNode]) -> None:
    if not nodes or nodes[0].parent or not all(0 < node.parent <= number
                                               for number, node in enumerate(nodes[1:], 1)):
        raise ValueError("a node's parent does not come before it")
