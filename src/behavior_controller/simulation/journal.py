"""The requests that the simulated nodes received and their answers: one file of JSON lines that all
nodes share.

A file, because its order of lines is the order of events across processes, a line is there before
the answer is sent, and none is lost while connections come up.
"""
import json
import os
from typing import Any, Dict, Iterable, List, NamedTuple, Optional, Sequence, Tuple

from behavior_controller.simulation.faults import PlannedFault

_FILE_NAME = "journal.jsonl"

REPEAT = 0.1
"""Seconds in which an unchanged message gets no further entry: a topic may publish a thousand
messages a second."""


class JournalEntry(NamedTuple):
    """One request that a node received (``call`` counts from 1), or, with call 0, a message of a
    topic: each that is not the one before, repeated within ``REPEAT``."""

    time: float  # unix seconds, as in the controller's record; if it is simulated, that of /clock
    node: str  # the simulated node, without the slash
    resource: str  # resolved name of the service or topic
    call: int
    content: Dict[str, Any]  # the fields of the request or message
    fault: Optional[str] = None  # the injected fault: one of faults.KINDS
    objection: Optional[str] = None  # why the node itself refused the request
    seconds: float = 0.0  # that the node takes until it answers
    response: Optional[Dict[str, Any]] = None  # the fields of the response; None: there is none
    jumped: float = 0.0  # by how many seconds /clock has jumped back, which ``time`` leaves out

    @property
    def done(self) -> bool:
        """Whether the node carried out the request."""
        return self.fault is None and self.objection is None


def unmet(planned: Sequence[PlannedFault],
          journal: Iterable[JournalEntry]) -> Tuple[PlannedFault, ...]:
    """Return the planned faults whose call was not made."""
    made = {(entry.node, entry.call) for entry in journal}
    return tuple(fault for fault in planned if fault[:2] not in made)


def plain(value: Any) -> Any:
    """Return a message as plain data, by ROS' own names of its fields."""
    if isinstance(value, (list, tuple)) and not hasattr(value, "_fields"):
        return list(map(plain, value))
    names = getattr(value, "_fields", None) or getattr(value, "__slots__", None)
    names = names or getattr(value, "__dict__", None)
    if not names:
        return value
    return {name: plain(getattr(value, name)) for name in names}


class Tail:
    """Reads a file of lines while another process writes it."""

    def __init__(self, path: str, skips: bool = False):
        """``skips``: the lines that are already in the file are left out."""
        self.path = path
        self._read = os.path.getsize(path) if skips and os.path.exists(path) else 0  # bytes

    def news(self) -> List[bytes]:
        """Return the complete lines that were added since the last call."""
        if not os.path.exists(self.path):
            return []
        with open(self.path, "rb") as file:
            file.seek(self._read)
            text = file.read()
        complete = text[:text.rfind(b"\n") + 1]
        self._read += len(complete)
        return complete.splitlines(keepends=True)


class Journal:
    """The file. Every process that writes or reads it has its own Journal."""

    def __init__(self, folder: str, skips: bool = False):
        """``skips``: the entries that are already in the file are left out."""
        os.makedirs(folder, exist_ok=True)
        self.path = os.path.join(folder, _FILE_NAME)
        self._tail = Tail(self.path, skips)

    def write(self, entry: JournalEntry) -> None:
        """Append an entry, in one write to a file opened for appending, so that lines of several
        processes do not mix."""
        with open(self.path, "ab", buffering=0) as file:
            file.write(json.dumps(entry._asdict()).encode() + b"\n")

    def news(self) -> List[JournalEntry]:
        """Return the entries that were added since the last call."""
        return [JournalEntry(**json.loads(line)) for line in self._tail.news()]
