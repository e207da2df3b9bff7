"""What is so in a run at a moment, as records: its visit, steps, requests, failures, the robot.

``fold.fold`` makes each ``State`` from the one before and an event. The texts in it are as they
came; ``run.story`` has the sentences. Times are Unix seconds. ``None`` means that something
has not happened.
"""
from typing import Any, Dict, Iterator, List, Optional, Tuple, Type, TypeVar, Union

from msgspec import Struct
from msgspec.structs import replace

from behavior_controller.run.events import (
    DONE, SKIPPED, SUBSTITUTED, Checked, HealthChanged, Noticed, Paused, Recovered, Recovering,
    RunFinished, RunStarted, SafeStateReported, Sources, TreeNode, TreeShown, TopicSaid)
from behavior_controller.run.health import FAILING, GONE, NEW, SHORT, SILENT, SLOW
from behavior_controller.robot.gateway import Failure
from behavior_controller.robot.requests import (
    Answer, GoTo, Location, Request, SetAnimation, SetAttention)
from behavior_controller.text import Source

HOME = "home"
"""The name of the place where the robot waits for visitors."""

UNDER_WAY, COMPLETED, LEFT_OUT, BROKEN_OFF = "under way", "completed", "left out", "broken off"
"""The state of a stop."""

FAILED, GAVE_UP, LEFT, STOPPED, NOTICED = "failed", "gave up", "left", "stopped", "noticed"
DECLINED, DONE_ALL, UNCLEAR, SILENT_VISITOR = "declined", "done", "unclear", "silent"
"""The kinds of reasons for which a visit or a stop ends."""

COMPLETE, IN_PART = "complete", "complete without steps"
VISITOR_DECLINED, VISITOR_LEFT, NO_REACTION = "declined", "left", "no reaction"
RESULTS = (COMPLETE, IN_PART, BROKEN_OFF, VISITOR_DECLINED, VISITOR_LEFT, NO_REACTION, STOPPED)
"""How a visit can end. The visitor chose ``declined``, ``left`` and ``no reaction``."""

_RESULT_OF = {DECLINED: VISITOR_DECLINED, LEFT: VISITOR_LEFT, SILENT_VISITOR: NO_REACTION,
              UNCLEAR: NO_REACTION, STOPPED: STOPPED}
"""The results of a visit that ended for these kinds of reasons, if the robot could see and hear."""

_RANKS = {GONE: 0, SHORT: 1, NEW: 2, SILENT: 3, FAILING: 4, SLOW: 5}
"""The respects in which a service or topic may not be well, the strongest first."""


def rank(change: HealthChanged) -> int:
    """Return how strong a trouble is; 0 is the strongest."""
    return _RANKS.get(change.respect, len(_RANKS))


NOT_STARTED = RunStarted("", [], {}, Sources((), Source("", ""), Source("", ""), ""))
"""What is known of a mission before its start."""

NOT_TICKED = "-"
"""The letter of a node that was not ticked in this pass.

A small letter is the status before the node went back to IDLE.
"""


def letter_after(before: str, change: str) -> str:
    """Return the letter of a node after a change of its status."""
    return before.lower() if change == "-" else change


class Reason(Struct, frozen=True):
    """Why a visit, or a stop, ended as it did.

    ``blind`` is what was wrong with the topic by which the robot would have known better,
    ``without`` the node that had been gone on without just before.
    """

    kind: str
    node: str = ""
    failure: Optional[Failure] = None
    tries: int = 1
    policy: str = ""  # why the policy's rule was not followed
    text: str = ""  # of a notice
    blind: Optional[HealthChanged] = None
    without: str = ""


class Stop(Struct, frozen=True):
    """One stop of a visit: what the mission takes one after the other.

    ``why`` is the cause where it was left out or broken off; ``noun`` the mission's word for it.
    ``skipped`` is how often each node failed in it that the mission went on without.
    """

    number: int  # from 1
    of: int
    name: str
    state: str
    why: Optional[Reason]
    seconds: float
    began: float = 0.0
    noun: str = ""
    skipped: Dict[str, int] = {}

    @property
    def is_left(self) -> bool:
        """Whether it ended as its visitor left, which is no failure."""
        return self.why is not None and self.why.kind == LEFT and self.why.blind is None


class Visit(Struct, frozen=True):
    """One visitor's pass. ``outcome`` is empty while it is under way, and if it was stopped.

    ``skipped`` is how often each node failed that the mission went on without, by the policy, and
    the stops that were left out for a condition.
    """

    number: int
    began: float
    arrived: Optional[float] = None
    engaged: Optional[float] = None
    asked: Optional[float] = None
    answer: str = ""  # yes or no, or helped as asked; empty: none
    stops: Tuple[Stop, ...] = ()
    outcome: str = ""  # SUCCESS or FAILURE
    why: Optional[Reason] = None  # how it ended
    seconds: float = 0.0  # from the arrival to the end
    waited: float = 0.0  # seconds before the arrival
    ended: Optional[float] = None
    skipped: Dict[str, int] = {}

    @property
    def has_visitor(self) -> bool:
        """Whether a visitor has come, and the visit goes on."""
        return self.arrived is not None and self.ended is None

    @property
    def is_empty(self) -> bool:
        """Whether it was stopped before a visitor came: that is no visit."""
        return self.ended is not None and not self.outcome and self.arrived is None

    def until(self, at: float) -> "Visit":
        """Return the visit with the seconds that it has taken until then."""
        came = self.arrived or self.began
        return replace(self, seconds=at - came, waited=came - self.began)

    @property
    def result(self) -> str:
        """One of ``RESULTS`` for a visit that has ended."""
        reason = self.why or Reason("")
        is_unasked = reason.kind == SILENT_VISITOR and reason.failure is not None
        if reason.blind is not None or is_unasked:
            return BROKEN_OFF
        if reason.kind in _RESULT_OF:
            return _RESULT_OF[reason.kind]
        if reason.failure is not None and reason.failure.is_false_condition:
            return NO_REACTION
        if self.outcome != "SUCCESS":
            return BROKEN_OFF
        if self.skipped:
            return IN_PART
        return COMPLETE

    @property
    def is_no_failure(self) -> bool:
        """Whether the tree failed only because of what its visitor chose."""
        chosen = (VISITOR_DECLINED, VISITOR_LEFT, NO_REACTION)
        return self.arrived is not None and self.outcome != "SUCCESS" and self.result in chosen


class Step(Struct, frozen=True):
    """What the robot does, or, if ``is_wait``, what it waits for.

    It takes at most ``limit`` seconds; 0: no limit is known. ``words`` and ``what`` are the leaf's
    phrases; a recovery or a pause has its event instead.

    ``attempt`` counts from 1; more than 1 are retries of a recovery, of ``attempts`` at most.
    ``call`` is the number of its request, whose answer it waits for; 0: none is on record.
    ``feedback`` is what an action has reported of it last, in words.
    """

    words: str
    began: float
    limit: float
    uid: int
    is_wait: bool
    path: str = ""
    what: str = ""
    attempt: int = 1
    attempts: int = 1
    call: int = 0
    cause: Union[Recovering, Paused, None] = None
    ended: Optional[float] = None
    feedback: str = ""

    @property
    def until(self) -> Optional[float]:
        """When it ends at the latest."""
        return self.began + self.limit if self.limit else None


class Exchange(Struct, frozen=True):
    """A request to the robot and its result; no result: it was not awaited any more, as when
    its leaf was halted.

    ``uid`` is the node on whose behalf it was sent; 0: none is known. ``words`` say for people what
    the robot does by it.
    """

    call: int
    service: str
    request: Request
    asked: float
    uid: int
    answered: Optional[float] = None
    result: Union[Answer, Failure, None] = None
    words: str = ""

    @property
    def failure(self) -> Optional[Failure]:
        """Why it failed, if it did."""
        return self.result if isinstance(self.result, Failure) else None


class LeafFailure(Struct, frozen=True):
    """A failure of a mission leaf, of a retry of it, or of a substitute, and when and in which
    visit it was noticed.

    ``attempt`` is 0 for the leaf itself, and for a recovery's attempts their number. ``seconds`` is
    how long a leaf took.
    """

    at: float
    visit: int
    uid: int
    node: str
    path: str
    failure: Failure
    attempt: int = 0
    seconds: float = 0.0

    @property
    def is_false_condition(self) -> bool:
        """Whether a condition did not hold, which is no fault."""
        return self.failure.is_false_condition


class RecoveryRound(Struct, frozen=True):
    """A recovery from the failure of a node: ``failures`` are that one and those of its retries.

    ``uid`` and ``handler`` are number and path of the HandleFallBack. ``substitute`` is the node
    that is done instead, and ``instead`` its failures. The last fields are known when it has ended.
    """

    node: str
    path: str
    uid: int
    began: float
    failures: Tuple[LeafFailure, ...] = ()
    instead: Tuple[LeafFailure, ...] = ()
    substitute: str = ""
    attempt: int = 0  # under way; 0: none, or the substitute
    attempts: int = 0  # that the policy allows; when it has ended: that were made
    handler: str = ""
    decided: float = 0.0
    ended: Optional[float] = None
    recovered: Optional[Recovered] = None
    is_halted: bool = False

    @property
    def outcome(self) -> str:
        """``done``, ``substituted``, ``skipped`` or ``given up``; empty if there was no decision.
        """
        if self.recovered is None:
            return ""
        return self.recovered.outcome

    @property
    def has_helped(self) -> bool:
        """Whether the step, or its substitute, was done after all."""
        return self.outcome in (DONE, SUBSTITUTED)

    @property
    def is_idle(self) -> bool:
        """Whether there was nothing to recover from: what is on record is HandleFallBack itself."""
        return self.path == self.handler


class NodeResult(Struct, frozen=True):
    """How a node of the tree ended: S, F or - (halted), and why it failed if it says so."""

    uid: int
    began: float
    ended: float
    letter: str
    failure: Optional[Failure] = None


class Robot(Struct, frozen=True):
    """The robot as the answers to requests leave it; None is what the run has not said.

    ``goal`` is that of the drive whose answer is awaited, and ``goal_name`` the name of the last
    goal that was asked for. ``place`` is where it arrived last, unless it may have left since for
    the goal of the name ``way``, where it did not arrive. ``last_place`` is the name of that place,
    for as long as it arrives nowhere else. ``is_lost``: a visit has left it away from home, failed
    or short of its goal, and it was asked to drive nowhere since. ``services`` are those that were
    asked, by kind of request. ``unfinished`` are the requests with an effect whose end is not
    known, the newest of each kind.
    ``troubles`` are the services, topics and the master that are not well, by name and respect;
    ``ill_since`` is when the first trouble of each began.
    """

    attention: Optional[SetAttention] = None
    animation: Optional[SetAnimation] = None
    goal: Optional[Location] = None
    goal_name: str = ""
    place: Optional[Location] = None
    last_place: str = ""
    way: str = ""
    is_lost: bool = False
    unfinished: Tuple[Exchange, ...] = ()
    services: Dict[str, str] = {}
    troubles: Dict[Tuple[str, str], HealthChanged] = {}
    ill_since: Dict[str, float] = {}

    def trouble(self, name: str) -> Optional[HealthChanged]:
        """Return the strongest trouble of a service or topic."""
        troubles = [change for change in self.troubles.values() if change.name == name]
        return min(troubles, key=rank, default=None)

    @property
    def is_away(self) -> bool:
        """Whether it was asked to drive, and has not arrived at home."""
        return bool(self.goal_name) and (self.place is None or self.last_place != HOME)

    @property
    def cannot_drive(self) -> bool:
        """Whether the node that drives it is gone."""
        trouble = self.trouble(self.services.get(GoTo.__name__, ""))
        return trouble is not None and trouble.respect == GONE

    @property
    def ill(self) -> Tuple[HealthChanged, ...]:
        """The strongest trouble of each that is not well, the oldest first."""
        changes = (self.trouble(name) for name in self.ill_since)
        return tuple(change for change in changes if change is not None)


class Course(Struct, frozen=True):
    """What ``fold`` remembers of a visit to explain how it and its stops end."""

    pass_began: float = 0.0  # on the mission's clock
    met: float = 0.0  # when the visitor came, on the mission's clock
    left_by: Optional[str] = None  # the topic by which the visitor is no longer seen
    is_unclear: bool = False  # the visitor's answer was neither yes nor no
    is_unanswered: bool = False  # the mission went by an answer that had not come
    unasked: Optional[Failure] = None  # for which the visitor could not be asked
    given_up: Optional[Recovered] = None  # the last one
    handler: int = 0  # the HandleFallBack that ended last
    failed: Tuple[int, Optional[Reason]] = (0, None)  # which leaf failed last, and why
    answered: Optional[Exchange] = None  # the last one that was
    # why it or a recovery failed, until a step begins or succeeds after that
    stuck: Optional[Reason] = None
    gave_up: Optional[Reason] = None  # why a failure was given up
    without: str = ""  # the node that failed and was skipped, until a step succeeds after that
    # topics whose conditions were false when asked last, and what was wrong with each meanwhile
    unmet: Dict[str, Optional[HealthChanged]] = {}


Fact = Union[Visit, Stop, Step, Exchange, LeafFailure, RecoveryRound, NodeResult, Noticed]
FactOfKind = TypeVar("FactOfKind", bound=Fact)


class State(Struct, frozen=True):
    """What is so at a moment, in a bounded size however long the run is.

    ``facts`` are what the last event concluded.
    """

    at: float = 0.0
    tree: TreeShown = TreeShown("", [])
    starting: str = ""  # the step of the start that is under way
    checks: Dict[str, Checked] = {}  # what was looked at before the mission begins, by name
    alive: Optional[float] = None  # when the tick thread gave its last sign of life
    heard: Dict[str, float] = {}  # when the last message of each topic came
    said: Dict[str, TopicSaid] = {}  # what that was, by topic
    started: Optional[RunStarted] = None
    finished: Optional[RunFinished] = None
    visits: Tuple[Visit, ...] = ()  # the newest
    visit_count: int = 0
    visit_results: Dict[str, int] = {}  # of all visits that ended: how many had each result
    steps: Tuple[Step, ...] = ()  # under way, the newest last
    exchanges: Tuple[Exchange, ...] = ()  # without a result
    recoveries: Tuple[RecoveryRound, ...] = ()  # under way
    letters: str = ""  # the status of each node, see ``NOT_TICKED``
    suspended: Tuple[str, float] = ("", 0.0)  # what the operator holds the run for; since when
    resume: str = ""  # the service with which the operator lets it go on
    due: str = ""  # what for as soon as the robot has done what it does now
    running: Dict[int, float] = {}  # since when each node is running, by uid
    held: Dict[int, float] = {}  # since when a breakpoint of Groot2 holds each node, by uid
    # of each path since its leaf, or HandleFallBack, ended last
    failures: Dict[str, Tuple[LeafFailure, ...]] = {}
    robot: Robot = Robot()
    entries: Dict[str, str] = {}  # of the blackboard, as texts, by name
    values: Dict[str, Any] = {}  # of those that are numbers, texts, lists or objects
    # if the robot was asked for it, and for nothing since that ends it
    safe_state: Optional[SafeStateReported] = None
    lost: int = 0  # events that the record lacks
    course: Course = Course()
    uids: Dict[str, int] = {}  # of the nodes that were heard of, by path
    omitted: int = 0  # number of the stop that is not gone on with, until a Recovered says why
    # failures in this traversal, until their nodes end with them
    results: Dict[int, Tuple[Optional[Failure], ...]] = {}
    recovered: Optional[RecoveryRound] = None  # decided, and its HandleFallBack has not ended
    facts: Tuple[Fact, ...] = ()

    @property
    def start(self) -> RunStarted:
        """The start of the mission, or before that ``NOT_STARTED``."""
        return self.started or NOT_STARTED

    @property
    def nodes(self) -> List[TreeNode]:
        """The nodes of the tree."""
        return self.tree.nodes

    def node(self, uid: int) -> Optional[TreeNode]:
        """Return the node of that number, if the tree has it."""
        return self.nodes[uid - 1] if 0 < uid <= len(self.nodes) else None

    @property
    def visit(self) -> Optional[Visit]:
        """The visit under way, or else the last one."""
        return self.visits[-1] if self.visits else None

    @property
    def step(self) -> Optional[Step]:
        """What the robot does: of several things at once the one that began last."""
        return self.steps[-1] if self.steps else None

    @property
    def pause(self) -> Optional[Paused]:
        """The pause under way."""
        if self.step is not None and isinstance(self.step.cause, Paused):
            return self.step.cause
        return None

    @property
    def stops(self) -> Tuple[Stop, ...]:
        """The stops of the visit under way, or else of the last one."""
        return self.visits[-1].stops if self.visits else ()

    @property
    def stop(self) -> Optional[Stop]:
        """The stop under way."""
        return next((stop for stop in self.stops[-1:] if stop.state == UNDER_WAY), None)

    @property
    def waits_for(self) -> Optional[Exchange]:
        """The request whose answer the step under way waits for."""
        if self.step is None:
            return None
        call = self.step.call
        return next((exchange for exchange in self.exchanges if exchange.call == call), None)

    @property
    def held_by(self) -> Optional[HealthChanged]:
        """What is wrong with the service, or the topic, that the step under way waits for."""
        exchange, step = self.waits_for, self.step
        if exchange is not None:
            return self.robot.trouble(exchange.service)
        unmet = self.failures.get(step.path) if step is not None and step.is_wait else None
        return self.robot.trouble(unmet[-1].failure.resource) if unmet else None

    @property
    def is_stranded(self) -> bool:
        """Whether a person has to take the robot home: it is away, and will not drive by itself."""
        robot, visit = self.robot, self.visit
        if not robot.is_away or robot.goal is not None:
            return False
        if self.finished is not None:
            return True
        if robot.is_lost:
            return visit is None or not visit.has_visitor
        # at a stop the visit goes on as soon as it can drive again
        return robot.place is None and robot.cannot_drive

    @property
    def why_broken_off(self) -> Optional[Reason]:
        """Why the stop is not completed; None if it is: a step came after each that failed."""
        if self.course.left_by is not None:
            return self.why_left
        return self.course.stuck

    @property
    def why_left(self) -> Reason:
        """The reason that the visitor is not seen any more."""
        return Reason(LEFT, blind=self.course.unmet.get(self.course.left_by or ""))

    def concluded(self, kind: Type[FactOfKind]) -> Iterator[FactOfKind]:
        """Yield what the last event concluded of a kind."""
        return (fact for fact in self.facts if isinstance(fact, kind))

    def omits(self, event: Recovered) -> Optional[Stop]:
        """Return the stop that is not gone on with because of a recovery's decision."""
        allowed = [UNDER_WAY] + [BROKEN_OFF] * (event.outcome == SKIPPED)
        return next((stop for stop in self.stops[-1:]
                     if stop.number == self.omitted and stop.state in allowed), None)

    def has_given_up(self, event: Recovered) -> bool:
        """Return whether an inner HandleFallBack has given up that step already."""
        given_up = self.course.given_up
        return given_up is not None and given_up.path == event.path and given_up.uid != event.uid


def step_over(before: State, after: State) -> Optional[Step]:
    """Return the step that was the newest one and is not any more: a row of these has no two at one
    time.
    """
    old, new = before.step, after.step
    if old is None:
        return None
    if new is not None and (new.uid, new.began, new.words) == (old.uid, old.began, old.words):
        return None
    return replace(old, ended=after.at)
