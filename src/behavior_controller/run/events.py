"""What happens while a mission runs, as typed events: emitted, recorded, and folded into a model.

Producers (leaves, the runner, the gateway's monitor, the record's wrappers) make them; sinks (the
terminal, the record, the page) subscribe to those that ``Events`` distributes. A sink is called on
the producer's thread and must be quick.
"""
import time
from typing import (TYPE_CHECKING, Any, Callable, Dict, List, Literal, Optional, Tuple, Union,
                    get_args)

from msgspec import Struct

from behavior_controller.robot.gateway import Failure
from behavior_controller.robot.requests import Answer, Location, Request
from behavior_controller.robot.interfaces import INTERFACES
from behavior_controller.text import Source, clean, count, joined

if TYPE_CHECKING:
    AnyRequest = Request
else:  # the kinds that can be read from a record
    AnyRequest = Union[tuple(dict.fromkeys(
        service.request for interface in INTERFACES.values() for service in interface.services))]

BEGUN, OVER, OMITTED = "begun", "over", "omitted"
"""States of a stop in ``StopChanged``."""

DONE, SUBSTITUTED, SKIPPED, GIVEN_UP = "done", "substituted", "skipped", "given up"
"""The outcomes of a recovery in ``Recovered``."""

Letter = Literal["-", "R", "S", "F"]
LETTERS: Dict[str, Letter] = {"IDLE": "-", "RUNNING": "R", "SUCCESS": "S", "FAILURE": "F"}
"""The statuses of nodes in ``Tick``, by their names."""


class BaseEvent(Struct, frozen=True, tag=True, tag_field="_type"):
    """The base class of all kinds of events."""


class OfNode(BaseEvent, frozen=True):
    """The base class of events about a node of the tree: its number, its type and its path."""

    uid: int
    node: str
    path: str


class Sources(Struct, frozen=True):
    """The sources of a mission besides its settings: texts of files, and the name of the interface.

    ``documents`` are the files that the mission file includes, and last the mission file itself.
    ``knowledge`` are the environment and the culture file; empty where the robot has a knowledge
    base.
    """

    documents: Tuple[Source, ...]
    phrases: Source
    policy: Source
    interface: str
    knowledge: Tuple[Source, ...] = ()


class Starting(BaseEvent, frozen=True):
    """The node does a step of its start, or waits for ``what``."""

    what: str


READY, AWAITED, MISSING, DOUBTFUL = "ready", "awaited", "missing", "doubtful"
"""The states of a part that was ``Checked``."""


class Checked(BaseEvent, frozen=True):
    """A part of the run was looked at before the mission begins; of a ``name`` the newest counts.

    ``kind`` says what it is, in a word; ``text`` what is so, for people.
    """

    kind: str
    name: str
    state: str
    text: str = ""


class RunStarted(BaseEvent, frozen=True):
    """The node has checked everything and starts to tick. ``offers`` are the names and kinds of
    what the robot's interface has, ``requests`` the kinds that the mission cannot do without; None:
    any, as in earlier records."""

    mission: str
    leaves: List[Tuple[str, str]]  # path and node type of each mission leaf, in document order
    settings: Dict[str, Union[bool, int, float, str]]
    sources: Sources
    offers: Dict[str, str] = {}
    requests: Optional[List[str]] = None


class StepStarted(OfNode, frozen=True):
    """A mission leaf begins a request, or begins to wait for a condition.

    ``words`` and ``what`` describe for people what the robot does now: see ``requests.Words``.
    ``limit`` is the seconds that it may take; 0: no limit, or an unknown one. A wait is over when
    something else begins. ``goes_on``: the robot has answered, and goes on with the step under way.
    """

    words: str
    what: str
    limit: float
    is_wait: bool
    goes_on: bool = False


class LeafSummary(Struct, frozen=True):
    """The sentence for people when a leaf ends: one line, and its ``kind`` (``story.KINDS``).

    ``mark`` is its meaning for the visit: the visitor ``arrived``, is ``engaged``, was ``asked``,
    answered ``yes`` or ``no``, something else that was ``understood``, or nothing (``unanswered``),
    was ``unrecognised``, was ``helped`` as asked, or has ``left``; else empty. ``at`` is the time
    of the mission's clock when a visitor arrived.
    """

    kind: str
    text: str
    mark: str = ""
    at: float = 0.0


class LeafFinished(OfNode, frozen=True):
    """A mission leaf ended with a result, or was halted (``status`` IDLE)."""

    status: str
    resource: str
    seconds: float
    failure: Optional[Failure]
    summary: Optional[LeafSummary] = None


class StopChanged(OfNode, frozen=True):
    """A stop of the mission was begun, is over, or was abandoned (``omitted``), as ``state`` says.

    The ``Recovered`` that follows says why, and whether the mission goes on without it. ``number``
    counts from 1; ``noun`` is the mission's word for its stops, where one is begun.
    """

    number: int
    of: int
    name: str
    state: str
    noun: str = ""


class Recovering(OfNode, frozen=True):
    """HandleFallBack (``uid``) is about to try the step ``node`` again: number ``attempt`` ``of``
    the policy's retries.

    Or it is about to run ``substitute`` instead; then ``attempt`` is 0.
    """

    failure: Failure
    attempt: int
    of: int
    substitute: str = ""


class Retried(BaseEvent, frozen=True):
    """A retry of a failed step, or its substitute, failed too: which attempt, and why."""

    node: str
    path: str
    attempt: int
    failure: Failure


class Recovered(BaseEvent, frozen=True):
    """A decision of HandleFallBack: which failure, what was done, after how many attempts, and
    whether it helped.

    ``outcome`` is ``done`` (a retry did it), ``substituted``, ``skipped`` or ``given up``;
    ``success`` is false for the last only.
    """

    node: str
    path: str
    failure: Failure
    policy: str
    attempts: int
    success: bool
    outcome: str
    reason: str = ""  # why the policy's rule was not followed
    uid: int = 0  # of the HandleFallBack


class HealthChanged(BaseEvent, frozen=True):
    """A service, topic or the master failed while the mission ran, or works again.

    ``kind`` is ``service``, ``topic``, ``action``, ``master`` or ``computer`` (on which the node
    runs); ``name`` the resolved name (the master's: its address); ``node`` the robot's node that
    offers it; ``consequence`` its meaning for the mission, empty when it works.
    """

    kind: str
    name: str
    node: str
    is_well: bool
    status: str
    consequence: str
    respect: str = ""  # the respect that changed: see ``health``

    @property
    def owner(self) -> str:
        """The node that offers it, or else its own name."""
        return "/" + self.node if self.node else self.name


class PassStarted(BaseEvent, frozen=True):
    """One visitor's pass through the mission begins; ``at`` is the time of the mission's clock."""

    number: int
    at: float


class PassFinished(BaseEvent, frozen=True):
    """One visitor's pass through the mission ended."""

    number: int
    outcome: str
    seconds: float


class Paused(BaseEvent, frozen=True):
    """The next pass waits, because the last one failed for a cause that persists.

    ``failure`` is what the mission gave up for. ``awaited`` is the node, service or topic that has
    to return; empty: none is gone, and the pause takes ``limit`` seconds. ``reason`` says what
    persists besides the failure.
    """

    failure: Failure
    awaited: str
    reason: str = ""
    limit: float = 0.0


class SafePart(Struct, frozen=True):
    """A part of the safe state: what is switched off by which service, and why that failed.

    ``failure`` None: it is off.
    """

    what: str
    service: str
    failure: Optional[Failure]


class SafeStateReported(BaseEvent, frozen=True):
    """The robot was asked for the safe state ``seconds`` ago: which parts of it were reached.

    A part that the robot does not have is left out.
    """

    parts: Tuple[SafePart, ...]
    seconds: float


class BreakpointChanged(BaseEvent, frozen=True):
    """A breakpoint of Groot2 holds a node, or lets it go on."""

    uid: int
    path: str
    is_held: bool


class HookEnded(BaseEvent, frozen=True):
    """A hook of Groot2 has removed itself: its place, and the number of the change that set it."""

    uid: int
    position: int
    number: int


class Suspended(BaseEvent, frozen=True):
    """The operator holds the run: nothing is begun until another of these comes with no ``words``,
    which say what the run waits for. ``is_due``: as soon as the robot has done what it does now.
    ``resume`` is the resolved name of the service that lets it go on.
    """

    words: str
    is_due: bool = False
    resume: str = ""


class Noticed(BaseEvent, frozen=True, omit_defaults=True):
    """Something that an operator should know; ``level`` is ``info``, ``warning`` or ``error``.

    ``jumped_back``: by how many seconds the simulated time did, which ended the visit.
    """

    level: str
    text: str
    jumped_back: float = 0.0


class RunFinished(BaseEvent, frozen=True):
    """The node stops. ``outcome`` is that of the last pass, or the reason to stop; ``exit_code`` is
    None in ``KILLED`` alone."""

    outcome: str
    exit_code: Optional[int]


KILLED = RunFinished("the record has no end: the controller was killed, or the disk full", None)
"""What readers of a record take for the end that it does not have."""


# ---------------------------------------------------------------- what only the record has of a run


class PortText(Struct, frozen=True, array_like=True):
    """A port of a node: what the mission file says, or the default if it is not ``given`` there;
    and the name of the entry that it refers to, as in ``EntriesWritten``; empty: to none."""

    name: str
    text: str
    entry: str = ""
    given: bool = True


class TreeNode(Struct, frozen=True):
    """One node of a tree.

    ``parent`` is its parent's number, counted from 1 in the tree's order; the root's is 0.
    ``pause`` is the seconds for which it pauses; 0: it does not; -1: the file does not say them.
    ``next`` are the numbers of the leaves that may follow when it succeeds, 0 for the end of the
    visit; none: the file leaves it open. ``label`` and ``kind`` are what it is called in a drawing
    of the tree; ``is_bare``: it only says how the mission is put together. ``subtree`` is the path
    of the SubTree that it belongs to, and ``place`` where the mission file has it.
    """

    path: str
    type: str
    name: str
    parent: int
    pause: float = 0.0
    next: Tuple[int, ...] = ()
    label: str = ""
    kind: str = ""
    is_bare: bool = False
    subtree: str = ""
    place: str = ""
    ports: List[PortText] = []


class TreeShown(BaseEvent, frozen=True):
    """The nodes of the mission that runs from the next ``RunStarted`` on.

    ``subtrees`` are the paths of its SubTrees in the order in which they were made, ``summaries``
    says what each type of node is for, ``xml`` is the tree as Groot2 reads it, and ``times`` are
    the entries whose values are times of the mission's clock. ``number`` counts the trees of the
    run.
    """

    id: str
    nodes: List[TreeNode]
    subtrees: List[str] = []
    summaries: Dict[str, str] = {}
    xml: str = ""
    times: List[str] = []
    number: int = 1


class Tick(BaseEvent, frozen=True):
    """A traversal of the tree: clock time, whether it is the first of its tick, and number and new
    status of nodes.

    ``first`` None: these statuses changed between two traversals, as by a halt.
    """

    at: float
    first: Optional[bool]
    changes: List[Tuple[int, Letter]]


class Whereabouts(Struct, frozen=True):
    """Where the robot is: see ``state.Robot``."""

    place: Optional[Location] = None
    last_place: str = ""
    goal_name: str = ""
    way: str = ""
    is_lost: bool = False


class TreeStatuses(BaseEvent, frozen=True):
    """The status of each node of the tree where a further file begins: see ``state.NOT_TICKED``;
    and where the robot is, which visits before may have left so."""

    letters: str
    whereabouts: Optional[Whereabouts] = None


class Asked(BaseEvent, frozen=True):
    """A request that the next traversal sends; ``call`` is its number, from 1 on."""

    call: int
    service: str
    request: AnyRequest


class Answered(BaseEvent, frozen=True):
    """The result of a call, recorded before the traversal that uses it."""

    call: int
    result: Union[Answer, Failure]


class FeedbackReceived(BaseEvent, frozen=True):
    """What an action reports of a call that is under way, in words for people."""

    call: int
    text: str


class Message(BaseEvent, frozen=True):
    """A message that the ``read``-th read of a topic in the next traversal is the first to return.
    """

    topic: str
    read: int  # from 1 on
    value: Any  # of the topic's kind
    arrived: float


class RecognitionPending(BaseEvent, frozen=True):
    """When a leaf of the next traversal has listened to a topic, the robot still hears something.
    """

    topic: str


class EntriesWritten(BaseEvent, frozen=True):
    """Entries of the blackboard that were written or removed since the last traversal, by name: the
    value as text.

    The name of a SubTree's entry has the SubTree's path before it. None: the entry has no value any
    more. ``values`` are those that differ from their text: numbers, lists and objects; None for
    what is none of these.
    """

    entries: List[Tuple[str, Optional[str]]]
    values: Dict[str, Any] = {}


class SignOfLife(BaseEvent, frozen=True):
    """The tick thread goes on: emitted every ``PULSE`` seconds. ``heard`` is when the last message
    of each topic came, as times of events."""

    heard: Dict[str, float] = {}


class TopicSaid(BaseEvent, frozen=True):
    """The newest message of a topic in words, and how many come in a second."""

    topic: str
    words: str
    rate: float


class Lost(BaseEvent, frozen=True):
    """The number of events that are missing here, and why; without a reason they did not fit into a
    queue.
    """

    lines: int
    reason: str = ""

    def __str__(self) -> str:
        """Return what the record lacks, and why."""
        missing = count(self.lines, "event is", "events are") + " missing"
        return clean(joined(": ", missing, self.reason))


Event = Union[
    Starting, RunStarted, PassStarted, StepStarted, LeafFinished, StopChanged, Recovering, Retried,
    Recovered, HealthChanged, PassFinished, Paused, SafeStateReported, BreakpointChanged, HookEnded,
    Suspended, Noticed, RunFinished, TreeShown, Tick, TreeStatuses, Asked, Answered, Message,
    FeedbackReceived, RecognitionPending, EntriesWritten, SignOfLife, Lost, Checked, TopicSaid]
EVENTS: Tuple[Any, ...] = get_args(Event)
"""The kinds of events."""


PULSE = 1.0
"""Seconds between two signs of life of the tick thread."""

HANGS = 3.0
"""Seconds without one after which it hangs."""

_unix_at_zero = _computer_at_zero = time.time() - time.monotonic()
_now: Callable[[], float] = time.monotonic  # of the mission's clock
_ros_now: Optional[Callable[[], Optional[float]]] = None  # where the mission's time is simulated


def unix_now() -> float:
    """Return the time for events, in Unix seconds: that of the computer's clock when the process
    started, and what has passed since then. It does not jump when that clock is set."""
    return _unix_at_zero + _now()


def computer_now() -> float:
    """Return the same where the mission's time is not simulated."""
    return _computer_at_zero + time.monotonic()


def unix_at(moment: float) -> float:
    """Return a time of the mission's clock as a time of events."""
    return _unix_at_zero + moment


def use_simulated_time(now: Callable[[], float], ros_now: Callable[[], Optional[float]]) -> None:
    """Have the time of events go on as the clock ``now`` does; ``ros_now`` returns the time of
    /clock, None before its first message."""
    global _unix_at_zero, _now, _ros_now
    _unix_at_zero, _now, _ros_now = unix_now() - now(), now, ros_now


def is_simulated() -> bool:
    """Return whether the mission's time is simulated."""
    return _ros_now is not None


def other_times() -> "Tuple[Optional[float], Optional[float]]":
    """Return ROS' time and the computer's, where they differ from that for events."""
    return (None, None) if _ros_now is None else (_ros_now(), computer_now())


def use_clock_of(unix_at_zero: float, is_simulated: bool = False) -> None:
    """Have ``unix_now`` follow another process of this computer, for which it is this time when
    the monotonic clock is 0; for a moment, if its mission's time is simulated."""
    global _unix_at_zero, _computer_at_zero
    _unix_at_zero = unix_at_zero
    if not is_simulated:
        _computer_at_zero = unix_at_zero


def clock_shift() -> int:
    """Return by how many seconds the computer's clock has jumped since the process started: to be
    added to the time of an event that is shown as the time of day."""
    return round(time.time() - time.monotonic() - _computer_at_zero)


class Line(Struct, frozen=True, omit_defaults=True):
    """An event and when it happened (see ``unix_now``): a line of a record. For ``ros`` and
    ``computer`` see ``other_times``."""

    time: float
    event: Event
    ros: Optional[float] = None
    computer: Optional[float] = None


def follow_simulated_time(line: Line) -> None:
    """Have ``unix_now`` go on from the newest line, if it is of simulated time and a sign of life:
    nothing else tells how far that time is."""
    if line.computer is not None and isinstance(line.event, SignOfLife):
        use_clock_of(line.time - time.monotonic(), is_simulated=True)


class Events:
    """Hands each event to every sink, in order of subscription."""

    def __init__(self) -> None:
        self._sinks: List[Callable[[Event], None]] = []

    def subscribe(self, sink: Callable[[Event], None]) -> None:
        """Call ``sink`` with every later event."""
        self._sinks.append(sink)

    def emit(self, event: Event) -> None:
        """Pass an event to every sink."""
        for sink in self._sinks:
            sink(event)
