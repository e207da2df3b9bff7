"""The requests that the simulated nodes received and their answers: one file of JSON lines that all nodes share.

A file, because its order of lines is the order of events across processes, a line is there before the answer is sent,
and none is lost while connections come up.
"""
import json
import math
import os
import time
from typing import Any, Dict, List, NamedTuple, Optional

FILE_NAME = "journal.jsonl"

REPEAT = 0.1
"""Seconds in which an unchanged message gets no further line: a topic may publish a thousand messages a second."""


class Line(NamedTuple):
    """One request that a node received (``call`` counts from 1), or, with call 0, a message of a topic: see ``Told``."""

    time: float  # unix seconds
    node: str  # the simulated node, without the slash
    resource: str  # resolved name of the service or topic
    call: int
    content: Dict[str, Any]  # the fields of the request or message
    fault: Optional[str] = None  # the injected fault: one of faults.KINDS
    objection: Optional[str] = None  # why the node itself refused the request

    @property
    def done(self) -> bool:
        """Whether the node carried out the request."""
        return self.fault is None and self.objection is None


class Told:
    """Decides which messages of a topic get a line: each changed message, and an unchanged one every ``REPEAT``."""

    def __init__(self) -> None:
        self._content: Dict[str, Any] = {}
        self._at = -math.inf

    def is_due(self, content: Dict[str, Any], at: float) -> bool:
        """Take note of a message at a time in seconds, and return whether it gets a line."""
        if content == self._content and at < self._at + REPEAT:
            return False
        self._content, self._at = content, at
        return True


class Tail:
    """Reads a file of JSON lines while another process writes it."""

    def __init__(self, path: str):
        self.path = path
        self._read = 0  # bytes

    def skip(self) -> None:
        """Treat the lines that are already in the file as read."""
        self._read = os.path.getsize(self.path) if os.path.exists(self.path) else 0

    def news(self) -> List[Dict[str, Any]]:
        """Return the complete lines that were added since the last call."""
        if not os.path.exists(self.path):
            return []
        with open(self.path, "rb") as file:
            file.seek(self._read)
            text = file.read()
        complete = text[:text.rfind(b"\n") + 1]
        self._read += len(complete)
        return [json.loads(line) for line in complete.splitlines()]


class Journal:
    """The file. Every process that writes or reads it has its own Journal."""

    def __init__(self, folder: str):
        os.makedirs(folder, exist_ok=True)
        self.path = os.path.join(folder, FILE_NAME)
        self._tail = Tail(self.path)

    def write(self, line: Line) -> None:
        """Append a line, in one write to a file opened for appending, so that lines of several processes do not mix."""
        with open(self.path, "ab", buffering=0) as file:
            file.write(json.dumps(line._asdict()).encode() + b"\n")

    def skip(self) -> None:
        """Treat the lines that are already in the file as read."""
        self._tail.skip()

    def news(self) -> List[Line]:
        """Return the lines that were added since the last call."""
        return [Line(**line) for line in self._tail.news()]


def now() -> float:
    """Return the time that lines carry: unix seconds, which the controller's record uses too."""
    return time.time()
