"""A record as text: one JSON object a line, how it is written, read and checked.

The first line is a ``Header``, each other line an ``events.Line``. Every change of what these hold
needs a new ``VERSION``.
"""
import io
import json
from typing import Any, Iterator, List

import msgspec
from msgspec.structs import replace

from behavior_controller.errors import Fault, MissionError
from behavior_controller.execution.events import (
    Event, Line, Message, RunStarted, Tick, TreeNode, TreeShown)
from behavior_controller.robot.interfaces import DEFAULT, INTERFACES

FORMAT = "behaviorController record"
VERSION = 10

LATEST = 1e11
"""The latest time, in Unix seconds, that a record may have: a date in the year 5138."""


class Header(msgspec.Struct, frozen=True):
    """The first line: the file's format and version, and the process that writes it since ``time``
    (Unix seconds).
    """

    format: str
    version: int
    pid: int
    time: float


_encoder = msgspec.json.Encoder(enc_hook=str)  # a foreign message may hold anything
_lines, _headers = msgspec.json.Decoder(Line), msgspec.json.Decoder(Header)


def header(pid: int, time: float) -> bytes:
    """Return the first line with its end."""
    return _encoder.encode(Header(FORMAT, VERSION, pid, time)) + b"\n"


def encode(time: float, event: Event) -> bytes:
    """Return a line with its end."""
    line = Line(time, event)
    try:
        return _encoder.encode(line) + b"\n"
    except UnicodeEncodeError:  # a lone surrogate, which only JSON's own escapes can write
        return json.dumps(msgspec.to_builtins(line, enc_hook=str)).encode() + b"\n"


def decode(data: bytes, file: str) -> Iterator[Line]:
    """Yield the lines of a record after its header, without a torn end.

    Raises MissionError if the version is not supported, or for the first line that the node cannot
    have written.
    """
    decoder = Decoder(file)
    for text in io.BytesIO(data):
        if text.endswith(b"\n"):  # else it was torn when the node was killed
            yield from decoder.read(text)
    if not decoder.has_mission:
        raise MissionError.of(file, "the record has no mission in it",
                              "was the node stopped before it began?")


class Decoder:
    """Reads the lines of one record in order, and checks each against those before it."""

    def __init__(self, file: str) -> None:
        self.has_mission = False
        self._file = file
        self._read = 0  # lines
        self._interface = DEFAULT  # of the running mission
        self._shown = self._running = 0  # nodes of the newest tree, and of the running mission's

    def read(self, text: bytes) -> List[Line]:
        """Return the line in a text; none for the header. Raises MissionError."""
        self._read += 1
        try:
            if self._read == 1:
                self._check_header(text)
                return []
            return [self._checked(self._line(text))]
        except RecursionError:
            why = "it is nested too deeply"
        except (msgspec.MsgspecError, ValueError, LookupError) as error:
            why = str(error)
        raise self._fault(f"this is not a line of a record: {why}",
                          "a record is written by the node")

    def _fault(self, text: str, hint: str) -> MissionError:
        return MissionError([Fault(self._file, self._read, 1, text, hint)])

    def _check_header(self, text: bytes) -> None:
        try:
            head = _headers.decode(text.decode("utf-8-sig"))
        except msgspec.ValidationError:  # JSON, and no header
            head = Header("", 0, 0, 0.0)
        if head.format != FORMAT:
            raise self._fault("this is no record: it does not begin with the header of one",
                              "name the mission.jsonl of a run")
        if head.version != VERSION:
            raise self._fault(f"the record has the version {head.version}; this release reads "
                              f"version {VERSION}", "replay it with the release that wrote it")

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
        if not 0 <= line.time <= LATEST:
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
