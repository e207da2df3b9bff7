"""The lines of a record: what each holds, and how it is written, read and checked.

The first line is a ``Header``. Each other line is an event of the run or an entry that is declared here: an object with
the kind as ``event``, Unix seconds as ``time``, and the fields. Every change of this content needs a new ``VERSION``.
"""
import io
import json
from typing import Any, Dict, Iterator, List, Literal, NamedTuple, Optional, Tuple, Union, get_args

from behavior_controller.bt.status import FAILURE, IDLE, RUNNING, SUCCESS
from behavior_controller.errors import Fault, MissionError
from behavior_controller.events import Event, RunStarted
from behavior_controller.gateway import Failure
from behavior_controller.interface import Interface
from behavior_controller.interface.robots import DEFAULT, INTERFACES
from behavior_controller.interface.records import Answer, Request
from behavior_controller.watch.plain import Count, Wrong, form, inside

FORMAT = "behaviorController record"
VERSION = 3
READ = (2, VERSION)
"""Versions that are read; a record of version 2 has no steps, so its story has fewer sentences."""

LATEST = 1e11
"""The latest time, in Unix seconds, that a record may have: a date in the year 5138."""

LONGEST_NUMBER = 18
"""The most digits of a whole number: Python takes quadratic time for long numbers."""

Letter = Literal["-", "R", "S", "F"]
LETTERS: Dict[Any, Letter] = {IDLE: "-", RUNNING: "R", SUCCESS: "S", FAILURE: "F"}


class Header(NamedTuple):
    """The first line: the file's format and version, and the process that writes it."""

    format: str
    version: int
    pid: int


class TreeNode(NamedTuple):
    """One node of a tree. ``parent`` is its parent's number, counted from 1 in the tree's order; the root's is 0."""

    path: str
    type: str
    name: str
    parent: int


class TreeShown(NamedTuple):
    """The nodes of the mission that runs from the next ``RunStarted`` on."""

    id: str
    nodes: List[TreeNode]


class Tick(NamedTuple):
    """A traversal of the tree: clock time, whether it is the first of its tick, and number and new status of nodes."""

    at: float
    first: bool
    changes: List[Tuple[int, Letter]]


class Asked(NamedTuple):
    """A request that the next traversal sends; ``call`` is its number."""

    call: Count
    service: str
    request: Request


class Answered(NamedTuple):
    """The result of a call, recorded before the traversal that uses it."""

    call: Count
    result: Union[Answer, Failure]


class Message(NamedTuple):
    """The message that the ``read``-th read of a topic in the next traversal returns; ``value`` None: no message yet."""

    topic: str
    read: Count
    value: Any  # of the topic's kind
    arrived: float


class Lost(NamedTuple):
    """The number of lines that are missing here because they did not fit into the queue."""

    lines: int


Entry = Union[Event, TreeShown, Tick, Asked, Answered, Message, Lost]
KINDS: Dict[str, Any] = {kind.__name__: kind for kind in get_args(Entry)}


class Line(NamedTuple):
    """An entry and when it was made, in Unix seconds."""

    time: float
    entry: Entry


def encode(time: float, entry: Union[Header, Entry]) -> bytes:
    """Return a line with its end."""
    kind: Any = type(entry)
    plain = dict({"event": kind.__name__, "time": time}, **form(kind).write(entry))
    # a lone surrogate is written as JSON escapes it
    return (json.dumps(plain, ensure_ascii=False, default=str) + "\n").encode("utf-8", "backslashreplace")


def decode(data: bytes, file: str) -> Iterator[Line]:
    """Yield the lines of a record after its header, without a torn end.

    Raises MissionError if the version is not supported, or for the first line that the node cannot have written.
    """
    order = _Order()
    for number, text in enumerate(io.BytesIO(data), 1):
        if not text.endswith(b"\n"):
            break  # torn when the node was killed
        try:
            plain = _parsed(text[:-1])
            if number == 1:
                _check_header(plain, file)
            else:
                yield order.checked(_line(plain, order.interface))
        except ValueError as error:
            raise MissionError([Fault(file, number, 1, "this is not a line of a record: {}".format(error),
                                      "a record is written by the node")]) from error
    if not order.has_mission:
        raise MissionError([Fault(file, 0, 0, "the record has no mission in it",
                                  "was the node stopped before it began?")])


def _parsed(data: bytes) -> Dict[str, Any]:
    try:
        plain = _JSON.decode(data.decode("utf-8-sig"))
    except UnicodeDecodeError as error:
        raise ValueError("it is not UTF-8 text") from error
    except json.JSONDecodeError as error:
        raise ValueError("it is not JSON: {} at column {}".format(error.msg, error.colno)) from error
    except RecursionError as error:
        raise ValueError("it is nested too deeply") from error
    if not isinstance(plain, dict) or not isinstance(plain.get("event"), str):
        raise ValueError("it has no event")
    return plain


def _whole(text: str) -> int:
    if len(text) > LONGEST_NUMBER:
        raise ValueError("a whole number has more than {} digits".format(LONGEST_NUMBER))
    return int(text)


_JSON = json.JSONDecoder(parse_int=_whole)  # made once: making it takes longer than a short line


def _check_header(plain: Dict[str, Any], file: str) -> None:
    version = plain.get("version") if plain["event"] == Header.__name__ else None
    if version not in READ:
        named = "the version {}".format(version) if isinstance(version, int) else "no version"
        raise MissionError([Fault(file, 1, 1, "the record has {}; this release reads version {}".format(
            named, " and ".join(map(str, READ))),
                                  "replay it with the release that wrote it")])
    header = form(Header).read(plain)
    if header.format != FORMAT:
        raise Wrong("is not {}".format(FORMAT), "format")


def _line(plain: Dict[str, Any], interface: Interface) -> Line:
    kind = KINDS.get(plain["event"])
    if kind is None:
        raise ValueError("the event {} is unknown".format(plain["event"]))
    entry = form(kind).read(plain)
    time = inside(".time", form(float).read, plain.get("time"))
    if not 0 <= time <= LATEST:
        raise Wrong("is not a time", "time")
    if isinstance(entry, Message):
        entry = entry._replace(value=_value(entry, interface))
    return Line(time, entry)


def _value(message: Message, interface: Interface) -> Any:
    try:
        topic = interface.topic(message.topic)
    except LookupError as error:
        raise Wrong("is not one of the interface's", "topic") from error
    return inside(".value", form(Optional[topic.value]).read, message.value)


class _Order:
    """Checks a line against the lines before it."""

    def __init__(self) -> None:
        self.has_mission = False
        self.interface = DEFAULT  # of the running mission
        self._shown = self._running = 0  # nodes of the newest tree, and of the running mission's

    def checked(self, line: Line) -> Line:
        """Return the next line. Raises ValueError if it cannot stand here."""
        entry = line.entry
        if isinstance(entry, TreeShown):
            _check_parents(entry.nodes)
            self._shown = len(entry.nodes)
        elif isinstance(entry, RunStarted):
            if not self._shown:
                raise ValueError("no tree comes before it")
            if not entry.sources.documents:
                raise Wrong("is empty", "sources.documents")
            self.has_mission, self._running = True, self._shown
            self.interface = INTERFACES.get(entry.sources.interface, DEFAULT)  # a replay refuses an unknown interface
        elif isinstance(entry, Tick) and self.has_mission:
            if not all(0 < uid <= self._running for uid, _ in entry.changes):
                raise ValueError("the tree has only {} nodes".format(self._running))
        return line


def _check_parents(nodes: List[TreeNode]) -> None:
    if not nodes or nodes[0].parent or not all(0 < node.parent <= number for number, node in enumerate(nodes[1:], 1)):
        raise ValueError("a node's parent does not come before it")
