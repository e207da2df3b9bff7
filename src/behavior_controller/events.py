"""The events of a mission as records, and their distribution to sinks.

Producers (leaves, the runner, the gateway's monitor) call ``Events.emit``; sinks (the terminal, the record file, the
page) subscribe. A sink is called on the producer's thread and must be quick.
"""
from typing import Any, Callable, Dict, List, NamedTuple, Optional, Tuple, Union, get_args

from behavior_controller.gateway import Failure
from behavior_controller.text import Source


BEGUN, OVER, OMITTED = "begun", "over", "omitted"
"""States of an exhibit in ``TourAdvanced``."""


class Sources(NamedTuple):
    """The sources of a mission besides its settings: texts of files, and the name of the interface.

    ``documents`` are the files that the mission file includes, and last the mission file itself. ``knowledge`` are the
    environment and the culture file; empty where the robot has a knowledge base.
    """

    documents: Tuple[Source, ...]
    phrases: Source
    policy: Source
    interface: str
    knowledge: Tuple[Source, ...] = ()


class RunStarted(NamedTuple):
    """The node has checked everything and starts to tick."""

    mission: str
    leaves: List[List[str]]  # [path, node type] of each mission leaf, in document order
    settings: Dict[str, Union[bool, int, float, str]]
    sources: Sources


class StepStarted(NamedTuple):
    """A mission leaf begins a request, or begins to wait for a condition that is checked again and again.

    ``words`` and ``what`` describe for people what the robot does now: see ``records.Words``. ``limit`` is the seconds
    that it may take; 0: no limit, or an unknown one. A wait is over when something else begins.
    """

    uid: int
    node: str
    path: str
    words: str
    what: str
    limit: float
    is_wait: bool


class Told(NamedTuple):
    """The sentence for people when a leaf ends: one line, and its ``kind`` (``story.KINDS``).

    ``mark`` is its meaning for the visit: the visitor ``arrived``, is ``engaged``, was ``asked``, answered ``yes`` or
    ``no``, or has ``left``; else empty. ``at`` is the time of the mission's clock when a visitor arrived.
    """

    kind: str
    text: str
    mark: str = ""
    at: float = 0.0


class LeafFinished(NamedTuple):
    """A mission leaf ended with a result, or was halted (``status`` IDLE)."""

    uid: int
    node: str
    path: str
    status: str
    resource: str
    seconds: float
    failure: Optional[Failure]
    told: Optional[Told] = None


class TourAdvanced(NamedTuple):
    """An exhibit of the tour was begun, is over, or was abandoned (``omitted``), as ``state`` says.

    The ``Recovered`` that follows says why, and whether the tour goes on without it. ``number`` counts from 1.
    """

    uid: int
    node: str
    path: str
    number: int
    of: int
    name: str
    state: str


class Recovering(NamedTuple):
    """HandleFallBack (``uid``) is about to try the step ``node`` again: number ``attempt`` ``of`` the policy's retries.

    Or it is about to run ``substitute`` instead; then ``attempt`` is 0.
    """

    uid: int
    node: str
    path: str
    failure: Failure
    attempt: int
    of: int
    substitute: str = ""


class Retried(NamedTuple):
    """A retry of a failed step, or its substitute, failed too: which attempt, and why."""

    node: str
    path: str
    attempt: int
    failure: Failure


class Recovered(NamedTuple):
    """A decision of HandleFallBack: which failure, what was done, after how many attempts, and whether it helped.

    ``outcome`` is ``done`` (a retry did it), ``substituted``, ``skipped`` or ``given up``; ``success`` is false for the
    last only.
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


class HealthChanged(NamedTuple):
    """A service, topic or the master failed while the mission ran, or works again.

    ``kind`` is ``service``, ``topic`` or ``master``; ``name`` the resolved name (the master's: its address); ``node``
    the robot's node that offers it; ``consequence`` its meaning for the mission, empty when it works.
    """

    kind: str
    name: str
    node: str
    is_well: bool
    status: str
    consequence: str
    respect: str = ""  # the respect that changed: see ``health``


class PassStarted(NamedTuple):
    """One visitor's pass through the mission begins; ``at`` is the time of the mission's clock."""

    number: int
    at: float


class PassFinished(NamedTuple):
    """One visitor's pass through the mission ended."""

    number: int
    outcome: str
    seconds: float


class Noticed(NamedTuple):
    """Something that an operator should know; ``level`` is ``info``, ``warning`` or ``error``."""

    level: str
    text: str


class RunFinished(NamedTuple):
    """The node stops. ``outcome`` is that of the last pass, or the reason to stop."""

    outcome: str
    exit_code: int


Event = Union[RunStarted, PassStarted, StepStarted, LeafFinished, TourAdvanced, Recovering, Retried, Recovered,
              HealthChanged, PassFinished, Noticed, RunFinished]
EVENTS: Tuple[Any, ...] = get_args(Event)
"""The kinds of events."""


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
