"""Does a run again with the reference's nodes: at each traversal on record, what had to happen, and
what did.

The mission's tree is built anew from its text, with the proved engine's controls and the nodes of
``reference``. It is ticked at the times of the record's traversals, with the answers and messages
that came until then; whether these were given, ``witness`` asks the journal. All else is computed:
which node is due, its request with every field, its result, the entries that it writes, the
recovery. The first difference from the record is the objection.

Two things are not computed. A node of another package has no row: its results, requests and entries
are those of the record. And the times of what the controller does: it is late if it was due more
than ``LATE`` before (a timer, the next traversal, the next pass), and early by more than ``EARLY``.
"""
import dataclasses
import itertools
import math
from typing import (
    Any, Callable, Dict, Iterator, List, NamedTuple, Optional, Sequence, Set, Tuple, Union)

from behavior_controller.bt.engine.builtins import builtin_specs
from behavior_controller.bt.engine.clock import ManualClock
from behavior_controller.bt.engine.leaf import ActionLeaf
from behavior_controller.bt.engine.node import Result
from behavior_controller.bt.engine import ports
from behavior_controller.bt.loader.document import parse
from behavior_controller.bt.loader.tree_builder import build
from behavior_controller.bt.registry import Direction, Kind, NodeSpec, Registry
from behavior_controller.bt.status import FAILURE, IDLE, RUNNING, SKIPPED, SUCCESS
from behavior_controller import extensions
from behavior_controller.config import knowledge_files, phrases, settings
from behavior_controller.errors import BehaviorControllerError
from behavior_controller.execution.events import (
    LETTERS, Answered, Asked, EntriesWritten, HealthChanged, LeafFinished, Line, Message,
    PassFinished, PassStarted, Recovered, Recovering, Retried, RunFinished, RunStarted,
    SafeStateReported, StepStarted, StillHearing, StopChanged, Suspended, Tick, TreeShown)
from behavior_controller.monitoring.record.recorder import Entries, entry_text
from behavior_controller.robot.declarations import Topic
from behavior_controller.robot.gateway import Cause, Failure, Sample
from behavior_controller.robot.requests import Answer, QueryKnowledge, Request

from unit_tests.judge import reference
from unit_tests.judge.facts import Facts
from unit_tests.judge.reference import (
    HANDLERS, SAFE, SAFE_STATE, Asking, Course, Decision, Duty, Reply, is_asked_again)
from unit_tests.robot.options import ACTION, Configuration

LATE, EARLY = 1.0, 0.25
"""Seconds by which something may come late, on a busy machine too, and seem early: a request is on
record before it is sent, a traversal after it."""

SAFE_LIMIT = 1.0
"""Seconds that the safe state may take at the end."""

SHORTEST_PASS = 1.0
"""After a shorter pass the next one waits for so many seconds."""

LATE_RETRY = 0.18
"""Seconds that the promptest retry of a node may be late: others may meet a busy machine."""

WORDS = {"S": "SUCCESS", "F": "FAILURE", "R": "RUNNING", "-": "halted"}


TABLE = {spec.id for spec in reference.ROWS}
"""The node types that have a row."""


class SignWait(NamedTuple):
    """A node that saw no sign at a moment of the mission's clock, and until when it went on
    waiting; ``newest``: when the newest message arrived that it had read."""

    node: Duty
    topic: Topic
    after: float
    is_sign: Callable[[Any], bool]
    at: float
    until: float
    newest: float


class Holding(NamedTuple):
    """A sign that a condition on a state held for: when it arrived and when it was read, by the
    mission's clock."""

    node: Duty
    topic: Topic
    is_sign: Callable[[Any], bool]
    arrived: float
    at: float


class Query(NamedTuple):
    """A request on record, the node that it was due for, and its result; ``dropped``: when the node
    was halted."""

    call: int
    request: Request
    service: str
    asked: float
    node: str
    path: str
    answered: Optional[float] = None
    result: Union[Answer, Failure, None] = None
    dropped: Optional[float] = None


class CannotRepeat(Exception):
    """The mission of the record cannot be built again; the text says why."""


# ------------------------------------------------------------------------- nodes of other packages


class Foreign(Asking, ActionLeaf):
    """A leaf without a row: it does what the record says."""

    def update(self) -> Result:
        letter, cause = self.course.of_record(self)
        if letter == "R" or not letter and self.status is RUNNING:
            return RUNNING
        if not letter:
            return SKIPPED if self.status is IDLE else self.status
        for port in self.spec.ports:
            if port.direction is not Direction.IN:
                self.course.copy_entry(self, port.name)
        return self.conclude(None if letter == "S" else cause or Cause.CONDITION_FALSE)


def _foreign(spec: NodeSpec) -> NodeSpec:
    calls = getattr(spec, "calls", ())

    def make(name: str) -> Foreign:
        node = Foreign(name)
        node.asks, node.rule = (calls or (object,))[0], lambda _: calls[0] if calls else None
        return node
    own = {str(kind): kind for kind in reference.TYPES.values()}
    mine = tuple(port._replace(type=own.get(port.type, port.type)) for port in spec.ports)
    is_leaf = spec.kind in (Kind.ACTION, Kind.CONDITION)
    return dataclasses.replace(spec, ports=mine, factory=make if is_leaf else spec.factory)


def registry() -> Registry:
    """Return all node types: the engine's, the reference's, and those of other packages."""
    found = Registry(builtin_specs() + list(reference.ROWS))
    for extension in extensions.exported("phrases"):
        for speech in extension.declared("SPEECHES", phrases.Speech):
            found.extend([reference.speech(speech.node, speech.node, speech.asks)])
    for extension in extensions.exported("leaves"):
        found.extend(map(_foreign, extension.declared("SPECS", NodeSpec)))
    return found


# ----------------------------------------------------------------------------------- the execution


class Execution(Course):
    """One mission of a record, done again line by line. ``difference`` is the first one, and
    ``differs_at`` its time; empty: none."""

    def __init__(self, begins: Line, passes: int, test: Configuration,
                 shown: Sequence[TreeShown]):
        """``passes`` have ended before; ``shown`` has the tree on record. Raises CannotRepeat."""
        began, started = begins.time, begins.event
        assert isinstance(started, RunStarted)
        try:
            self._build(started)
        except BehaviorControllerError as error:
            raise CannotRepeat(
                "the mission on record cannot be done again: {}".format(error)) from error
        self.began = self.last_line = began  # times of its first and its newest line
        self.difference = ""
        self.differs_at = began
        self.passes, self.test = passes, test
        self.outcome = ""  # of the last pass, as it had to be
        self.offset: Optional[float] = None  # from the mission's clock to Unix time
        self.queries: Dict[int, Query] = {}
        self.read: List[Message] = []
        self.searches: List[SignWait] = []
        self.holdings: List[Holding] = []
        self.waiting: Dict[int, SignWait] = {}  # that have not ended, by the uid of the node
        self._next = began, "the first pass"  # what is due next, and when
        self._pass_began = self._visit_began = 0.0
        self._clock_began: Optional[float] = None  # the offset at the first traversal of a pass
        self._is_in_pass = False
        self._outcome, self._ready, self._pauses = "", 0.0, 0  # after the last pass
        self._replies: Dict[int, Reply] = {}
        self._queue: List[Asked] = []
        self._news: List[Tuple[Topic, int, Sample]] = []
        self._recent: Dict[Topic, Tuple[Sample, ...]] = {}
        self._reads: Dict[Topic, int] = {}
        self._gone: Set[str] = set()
        self._heard: List[str] = []  # topics on which the robot still hears something
        self._letters: List[Tuple[int, str]] = []  # of the traversal on record
        self._changes: List[Tuple[int, str]] = []  # of the same, as they had to be
        self._seen: Dict[int, int] = {}
        self._finished: List[LeafFinished] = []
        self._reports: List[Decision] = []  # on record
        self._due: List[Decision] = []  # as they had to be
        self._ends: Dict[int, List[str]] = {}  # of leaves, as they had to be
        # requests: after so many changes of status, what is wrong
        self._wrong: List[Tuple[int, str]] = []
        self._recorded: Dict[str, Optional[str]] = {}  # entries on record
        self._newest_entries: Sequence[Tuple[str, Optional[str]]] = ()  # since then
        self._written: Set[str] = set()  # on record since the last traversal
        self._entries = Entries(self.tree)
        self._writers: Dict[str, str] = {}
        self._sought: List[SignWait] = []
        self._delays: Dict[str, List[float]] = {}  # of retries, by node type
        self._asker = ""  # the node that made the newest request
        self._last = self._before = ""  # the leaf that ended last, now and before the traversal
        self.tree.subscribe(lambda node, old, new: self._changes.append((node.uid, LETTERS[new])))
        leaves = [_of_tree(node) for node in self.tree.nodes if isinstance(node, Duty)]
        nodes = [list(map(_of_tree, self.tree.nodes))]
        if leaves != list(map(tuple, started.leaves)) or nodes != [
                [(node.path, node.type) for node in tree.nodes] for tree in shown]:
            self._differ("the tree on record is not that of the mission file", began)

    def _build(self, started: RunStarted) -> None:
        """Set the mission up. Raises BehaviorControllerError."""
        sources = started.sources
        chosen = settings.recorded(started.settings, "settings")
        known = knowledge_files.read(*sources.knowledge) if sources.knowledge else None
        language = chosen.language if known is None else known.language
        spoken = phrases.load(language, chosen.scenario_specification)
        super().__init__(chosen, spoken, known, reference.Policy(sources.policy.text))
        self.clock = ManualClock()
        self._registry = registry()
        self.tree = build([parse(text, file) for file, text in sources.documents], self._registry,
                          self.clock)
        self.tree.setup(course=self)

    # ----------------------------------------------------------------------------------- the record

    def take(self, line: Line) -> None:
        """Go on with the next event of the record."""
        note, follow = _NOTED.get(type(line.event)), _FOLLOWED.get(type(line.event))
        self.last_line = line.time
        if isinstance(line.event, (PassStarted, Tick, PassFinished, RunFinished)):
            self._differ(self.overdue(line.time), line.time)
        if note is not None:
            note(self, line.event, line.time)
        if follow is not None and not self.difference:
            follow(self, line.event, line.time)

    def _note_asked(self, event: Asked, time: float) -> None:
        self._queue.append(event)
        self.queries[event.call] = Query(event.call, event.request, event.service, time, "", "")

    def _note_answered(self, event: Answered, time: float) -> None:
        query = self.queries.get(event.call)
        if query is not None and (query.result or query.dropped) is not None:
            self._differ("{} has an answer on record that nothing waits for: {}".format(
                query.node, described(query.request)), time)
        elif query is not None:
            self.queries[event.call] = query._replace(answered=time, result=event.result)

    def _note_message(self, event: Message, _time: float) -> None:
        self.read.append(event)
        self._news.append(
            (self.interface.topic(event.topic), event.read, Sample(event.value, event.arrived)))

    def _note_entries(self, event: EntriesWritten, time: float) -> None:
        if event.entries and event.entries == self._newest_entries:
            self._differ("the entries after {} are on record twice".format(self._last), time)
        self._newest_entries = event.entries
        self._recorded.update(event.entries)
        self._written.update(name for name, text in event.entries if text is not None)

    def _note_health(self, event: HealthChanged, time: float) -> None:
        if event.respect == "gone":
            (self._gone.discard if event.is_well else self._gone.add)(event.name)
        if self.passes and not self._is_in_pass:
            self._expect_pass(time)

    def _note_suspension(self, event: Suspended, time: float) -> None:
        if not self.settings.ros_interface:
            self._differ("{}, and there is no way to ask for that".format(event.words), time)
        self._next = math.inf if event.words else time, "the mission"

    def _note_leaf(self, event: LeafFinished, time: float) -> None:
        if (event.path, event.node) != self._place(event.uid):
            self._differ("node {} is not {} {}".format(event.uid, event.node, event.path), time)
        self._finished.append(event)

    def _note_step(self, event: StepStarted, _time: float) -> None:
        if event.node in TABLE and not (event.is_wait or event.goes_on):
            self._reports.append(Decision(event.node, event.path, "", reference.BEGINS))

    def _note_stop(self, event: StopChanged, _time: float) -> None:
        if event.node in TABLE:
            self._reports.append(Decision(event.node, event.path, "", reference.STOP.format(
                event.number, event.of, event.name, event.state)))

    def _note_recovery(self, event: Union[Recovering, Retried, Recovered], time: float) -> None:
        if isinstance(event, Retried):
            step = reference.FAILED_AGAIN.format(event.attempt)
        elif isinstance(event, Recovering):
            step = reference.INSTEAD.format(event.substitute)
            if event.attempt:
                step = reference.RETRY.format(event.attempt, event.of)
        elif (event.path, event.node) == self._place(event.uid):
            return  # there was nothing to recover from
        else:
            if event.success is (event.outcome == reference.GIVEN_UP):
                self._differ("the recovery of {} is {}; on record its success is {}".format(
                    event.node, event.outcome, event.success), time)
            gives_up = event.policy.partition(": ")[0].endswith("give up")
            step = reference.ENDED.format(event.outcome, event.attempts,
                                          "give up" if gives_up else "skip")
        handler = getattr(event, "uid", 0)
        self._reports.append(Decision(event.node, event.path, event.failure.cause.value, step,
                                      handler))

    def _start_pass(self, event: PassStarted, time: float) -> None:
        self._pass_began = time
        if self._is_in_pass or event.number != self.passes + 1:
            self._differ("pass {} began, and pass {} had to {}".format(
                event.number, self.passes + 1, "end" if self._is_in_pass else "begin"), time)
        self._is_in_pass = True
        for asked in self._queue:
            self._differ("before the pass nothing is due; what was asked: {}".format(
                self._came(asked)), time)
        early = self._ready - event.at
        if early > 0.01 or self._next[0] == math.inf:
            self._differ("the pass began {}, and the cause of the last failure persists".format(
                "{:.1f} s too early".format(early) if early > 0.01 else "without a pause"), time)
        self._next = time, "the first step of pass {}".format(event.number)
        self._clock_began = None
        self._visit_began = event.at
        self.begin_visit(self.tree.blackboard, event.at)

    def _end_pass(self, event: PassFinished, time: float) -> None:
        now = self.clock.now()
        if abs(event.seconds - (now - self._visit_began)) > LATE:
            self._differ("the pass took {:.1f} s; on record are {:.1f} s".format(
                now - self._visit_began, event.seconds), time)
        self.passes += 1
        if (event.number, event.outcome) != (self.passes, self.outcome):
            self.passes -= 1
            self._differ("pass {} ended with {}; its tree ends with {}".format(
                event.number, event.outcome, self.outcome or "nothing yet"), time)
        self._differ(next(self._unreported(), ""), time)
        self._is_in_pass = False
        self._outcome = event.outcome
        self._ready = now + (SHORTEST_PASS if event.seconds < SHORTEST_PASS else 0.0)
        self._pauses = 0 if event.outcome == "SUCCESS" else self._pauses
        pause = self.pause(self._pauses, self._ready) if event.outcome == "FAILURE" else 0.0
        self._pauses += pause > 0.0
        self._ready += pause
        self._expect_pass(time)

    def _expect_pass(self, time: float) -> None:
        """Note when the next pass has to begin, or the run has to end."""
        if self.passes == self.test.mission_runs:
            self._next = time + SAFE_LIMIT, "the end of the run"
            return
        is_awaited = self._outcome == "FAILURE" and any(map(self.is_gone, self.failed_for()))
        ready = math.inf if is_awaited else max(time, self._ready + (self.offset or 0.0))
        self._next = ready, "pass {}".format(self.passes + 1)

    def _end_run(self, event: RunFinished, time: float) -> None:
        asked = [query.request for query in self._queue]
        if sorted(map(str, asked)) != sorted(map(str, SAFE_STATE)):
            self._differ("at the end the safe state is due, once; what was asked: {}".format(
                ", ".join(map(described, asked)) or "nothing"), time)
        elif self._reports != [SAFE]:
            self._differ("at the end {}; it was not".format(SAFE), time)
        elif not event.outcome.endswith(self._outcome):
            self._differ("the last pass ended with {}; at the end it was {}".format(
                self._outcome, event.outcome), time)
        self._queue.clear()
        self._reports.clear()
        self._next = math.inf, ""

    def _note_safe_state(self, event: SafeStateReported, time: float) -> None:
        self._reports.append(SAFE)
        reported = {part.service: part for part in event.parts}
        for request in SAFE_STATE:
            newest = {query.path: query for query in self.queries.values()
                      if query.request == request and query.node in HANDLERS
                      and query.asked > time - event.seconds - LATE}
            for query in newest.values():
                if query.result is None:
                    self.queries[query.call] = query._replace(dropped=time)
            part = reported.get(self.interface.resource(type(request)))
            results = {_result(query) for query in newest.values()}
            is_due = results != {Cause.NOT_ADVERTISED.value}
            if not newest or part is None and is_due:
                self._differ("the robot was not asked for the safe state: {}".format(
                    described(request)) if not newest else "what {} has come to is not reported"
                    .format(described(request)), time)
            elif part is not None and len(results) < 2 and (part.failure is None) is not (
                    results == {"an answer"}):
                self._differ("{} was reported as {}; the requests on record say otherwise".format(
                    part.what, "failed" if part.failure else "reached"), time)

    # ----------------------------------------------------------------------------------- traversals

    def _traverse(self, tick: Tick, time: float) -> None:
        offset = time - tick.at
        self.offset = offset if self.offset is None else min(self.offset, offset)
        if not self._is_in_pass:
            self._differ("the mission went on, and no pass had begun", time)
        if self._clock_began is None:
            self._clock_began = offset
            if not 0.0 <= tick.at - self._visit_began <= LATE:
                self._differ("the pass began at {:.1f} s, its first step came at {:.1f} s".format(
                    self._visit_began, tick.at), time)
        if abs(offset - self._clock_began) > LATE:
            self._differ("the mission's clock is {:.1f} s wrong".format(
                offset - self._clock_began), time)
        self._prepare(tick)
        result: Any = None
        changes = self.tree.changes
        try:
            if tick.first:
                self.clock.run_due()
            result = self.tree.root.execute()
        except BehaviorControllerError as error:
            if not isinstance(getattr(error, "cause", error), BehaviorControllerError):
                self._differ("the mission cannot be done again: {}".format(error), time)
            result = FAILURE  # of a script, say: the pass is over
        self._compare(time)
        self._expect_tick(result is RUNNING, self.tree.changes != changes, time)
        if result in (SUCCESS, FAILURE):
            self.outcome = result.name
            self.tree.root.reset()
            if not self.tree.is_idle:
                self.tree.halt()
        elif result is not RUNNING:
            self.tree.halt()
        self._await_signs(tick.at)

    def _prepare(self, tick: Tick) -> None:
        self.clock.set_to(tick.at)
        self.outcome = ""
        self._letters, self._before = list(tick.changes), self._last
        for each in (self._changes, self._wrong, self._sought, self._seen, self._reads):
            each.clear()
        for number, reply in list(self._replies.items()):
            reply.result = self.queries[number].result
            if reply.result is not None:
                del self._replies[number]

    def _expect_tick(self, is_running: bool, has_changed: bool, time: float) -> None:
        """Note when the next traversal has to come: at once after a change, else at the next timer.
        """
        due = self.clock.next_due()
        if is_running and not has_changed:
            time = math.inf if due is None else due + (self.offset or 0.0)
        self._next = time, "" if is_running else "the end of the pass"

    @property
    def is_paused(self) -> bool:
        """Whether a pass has failed, and the next one has to wait."""
        has_failed = self._outcome == "FAILURE" and not self._is_in_pass
        return has_failed and self._next[0] > self.last_line

    def overdue(self, time: float) -> str:
        """Return what had to come long before that time, and has not come; empty: nothing."""
        due, what = self._next
        return "{} was due {:.1f} s before".format(
            what or self.under_way(), time - due) if time - due > LATE else ""

    def under_way(self) -> str:
        """Return the nodes that are running, without a running child."""
        running = [node for node in self.tree.nodes if node.status is RUNNING and not any(
            child.status is RUNNING for child in node.children)]
        return " or ".join(map(label, running)) or "a timer"

    def _compare(self, time: float) -> None:
        """Note the first difference of the traversal."""
        found = min(self._wrong, default=None)
        changed = next((index for index, (mine, other) in enumerate(
            itertools.zip_longest(self._changes, self._letters)) if mine != other), None)
        if found is not None and (changed is None or found[0] <= changed):
            self._differ(found[1], time)
        elif changed is not None:
            self._differ(self._misstep(changed), time)
        else:
            self._differ(next(self._lesser(), ""), time)
        self._newest_entries = ()
        for each in (self._writers, self._written):
            each.clear()

    def _misstep(self, place: int) -> str:
        """Return which change of status had to come there, and which came."""
        mine, other = (list(changes[place:place + 1]) for changes in (self._changes, self._letters))
        due = "nothing more had to be"
        if mine:
            control = self.tree.nodes[mine[0][0] - 1].parent
            where = " (in {})".format(label(control)) if control is not None else ""
            due = "{} had to be {}{}".format(self._label(mine[0][0]), self._reason(mine[0]), where)
        came = "{} {}".format(self._label(other[0][0]), WORDS[other[0][1]]) if other else "nothing"
        return "{}{}; on record is {}".format(self._after(place), due, came)

    def _after(self, place: int) -> str:
        before = [uid for uid, letter in self._changes[:place]
                  if letter in "SF" and isinstance(self.tree.nodes[uid - 1], Duty)]
        last = self._label(before[-1]) if before else self._before
        return "after {}, ".format(last) if last else ""

    def _reason(self, change: Tuple[int, str]) -> str:
        uid, letter = change
        causes = [end for end in self._ends.get(uid, ()) if end not in ("SUCCESS", "IDLE")]
        return WORDS[letter] + (" ({})".format(causes[0]) if causes and letter == "F" else "")

    def _lesser(self) -> Iterator[str]:
        """Yield what else differs: requests without a node, causes, decisions of recoveries,
        entries."""
        for asked in self._queue:
            yield "after {}, while {} goes on, nothing more was due; what was asked: {}".format(
                self._asker or self._last, self.under_way(), self._came(asked))
        yield from self._unreported()
        yield from self._unlike_entries()

    def _unreported(self) -> Iterator[str]:
        """Yield what the record says otherwise of ends of leaves, and of what was begun and
        decided."""
        reported: Dict[int, List[str]] = {}
        for event in self._finished:
            reported.setdefault(event.uid, []).append(_value(event))
        for uid in {**self._ends, **reported}:
            node, wanted, values = self.tree.nodes[uid - 1], self._ends.get(uid, []), reported.get(
                uid, [])
            if isinstance(node, Foreign):
                values = [value for value in values if value != "IDLE"]
            # a condition that is asked again and again is on record when it changes
            is_quiet = isinstance(node, Foreign) or isinstance(
                node, reference.Sign) and wanted[-1:] not in ([], ["SUCCESS"])
            if values != wanted and not (is_quiet and set(values) <= set(wanted)):
                yield "{} ended with {}; on record is {}".format(
                    label(node), ", ".join(wanted) or "nothing", ", ".join(values) or "nothing")
        # decisions of recoveries first, then what is begun: of both the order counts
        for due, other in itertools.zip_longest(*(sorted(
                decisions, key=lambda decision: not decision.cause)
                for decisions in (self._due, self._reports))):
            if due != other:
                yield "this had to happen: {}; on record is: {}".format(
                    due or "nothing", other or "nothing")
        for each in (self._finished, self._ends, self._due, self._reports):
            each.clear()

    def _place(self, uid: int) -> Tuple[str, str]:
        """Return path and type of a node."""
        return _of_tree(self.tree.nodes[uid - 1]) if 0 < uid <= len(self.tree.nodes) else ("", "")

    def _unlike_entries(self) -> Iterator[str]:
        """Yield entries of another value than on record, or that one side wrote alone."""
        mine = dict(self._texts())
        recorded = {name: text for name, text in self._recorded.items() if text is not None}
        written = {name for name, value in self._entries.news() if value is not None}
        for name in sorted(set(mine) | set(recorded)):
            is_written = (name in written) == (name in self._written)
            if mine.get(name) != recorded.get(name) or not is_written:
                writer = self._writers.get(name.rpartition("/")[2]) or self._last
                yield "{} had to leave {} = {}; on record is {}{}".format(
                    writer, name, mine.get(name, "nothing"), recorded.get(name, "nothing"),
                    "" if is_written else ", from before")

    def _texts(self) -> Iterator[Tuple[str, str]]:
        for path, board in self.tree.blackboards.items():
            for key, entry in board.local.items():
                if entry.value is not None:
                    yield "{}/{}".format(path, key) if path else key, entry_text(entry.value)

    def _differ(self, text: str, time: float) -> None:
        if text and not self.difference:
            self.differs_at = max(time, self._pass_began)
            self.difference = "pass {}, {:.1f} s: {}".format(self.passes + 1,
                                                             max(0.0, time - self._pass_began),
                                                             text)

    def _label(self, uid: int) -> str:
        """Return the label of a node; that of a control has the first leaf below it."""
        if not 0 < uid <= len(self.tree.nodes):
            return "node {}".format(uid)
        node = first = self.tree.nodes[uid - 1]
        while first.children:
            first = first.children[0]
        return label(node) if first is node else "{} of {}".format(label(node), label(first))

    # ------------------------------------------------------------------------- what the nodes go by

    def ask(self, node: Duty, request: Union[Request, type]) -> Reply:
        """Return the reply to a request; of a node without a row only its kind is known."""
        reply = Reply()
        if node.registration_id in TABLE and not isinstance(node, reference.Recovering):
            self.decided(Decision(node.registration_id, node.full_path, "", reference.BEGINS))
        if isinstance(request, QueryKnowledge) and self.known is not None:
            reply.result = Answer(exhibits=self.knowledge[request.what])
            return reply
        asked = self._queue[0] if self._queue else None
        fits = asked is not None and (isinstance(asked.request, request) if isinstance(
            request, type) else asked.request == request)
        if asked is None or not fits:
            self._wrong.append((len(self._changes), self._unlike(node, request, asked)))
            return reply
        del self._queue[0]
        self._asker = label(node)
        query = self._attribute(asked, node)
        early = self._unix_now - query.asked
        if early > EARLY:
            self._wrong.append((len(self._changes), "{} asked {:.1f} s too early: {}".format(
                label(node), early, described(query.request))))
        reply.call, reply.result = asked.call, query.result
        if reply.result is None:
            self._replies[asked.call] = reply
        return reply

    @property
    def _unix_now(self) -> float:
        return self.clock.now() + (self.offset or 0.0)

    def _attribute(self, asked: Asked, node: Duty) -> Query:
        query = self.queries[asked.call]._replace(node=node.registration_id, path=node.full_path)
        self.queries[asked.call] = query
        return query

    def drop(self, reply: Reply) -> None:
        """Note that nothing waits for an answer any more."""
        query = self.queries.get(reply.call)
        if query is not None and query.result is None:
            self.queries[reply.call] = query._replace(dropped=self._unix_now)

    def _unlike(self, node: Duty, request: Union[Request, type], asked: Optional[Asked]) -> str:
        what = "" if isinstance(request, type) else ": " + described(request)
        due = "{}{} was due{}".format(self._after(len(self._changes)), label(node), what)
        if asked is None:
            return due + "; nothing was asked"
        text = "{}; what was asked: {}".format(due, self._came(asked))
        if type(asked.request) is type(request):
            text += " ({})".format(_unlike_fields(asked.request, request))
        return text

    def _came(self, asked: Asked) -> str:
        """Return a request in words, and which node has made the same before."""
        before = [query.node for query in self.queries.values()
                  if query.request == asked.request and query.node]
        again = ", as {} did before".format(before[-1]) if before else ""
        return described(asked.request) + again

    def messages(self, topic: Topic) -> Sequence[Sample]:
        """Return the messages of a topic that the node may read now, oldest first."""
        self._reads[topic] = self._reads.get(topic, 0) + 1
        for entry in list(self._news):
            if entry[0] is topic and entry[1] <= self._reads[topic]:
                self._recent[topic] = topic.kept(self._recent.get(topic, ()), entry[2])
                self._news.remove(entry)
        return self._recent.get(topic, ())

    def _note_hearing(self, event: StillHearing, time: float) -> None:
        if self.test.recognise_by != ACTION:
            self._differ("{} is no action that goes on hearing".format(event.topic), time)
        self._heard.append(event.topic)

    def is_hearing(self, topic: Topic) -> bool:
        """Return whether the robot still hears what began in time."""
        if topic.name not in self._heard:
            return False
        self._heard.remove(topic.name)
        return True

    def is_gone(self, resource: str) -> bool:
        """Return whether that service is known to be gone."""
        return resource in self._gone

    def sought(self, node: Duty, topic: Topic, after: float, is_sign: Callable[[Any],
                                                                               bool]) -> None:
        """Note that a node saw no sign among the messages later than ``after``."""
        now, recent = self.clock.now(), self._recent.get(topic, ())
        newest = recent[-1].arrived if recent else -math.inf
        self._sought.append(SignWait(node, topic, after, is_sign, now, now, newest))

    def saw(self, node: Duty, topic: Topic, sample: Sample, is_sign: Callable[[Any], bool]) -> None:
        """Note that a message was the sign."""
        if topic.is_continuous and topic.is_event is None:
            self.holdings.append(Holding(node, topic, is_sign, sample.arrived, self.clock.now()))

    def _await_signs(self, now: float) -> None:
        """Note which nodes go on waiting for a sign, and which wait no more."""
        before, self.waiting = self.waiting, {}
        for search in self._sought:
            known = before.get(search.node.uid, search)
            if not _waits(search.node):
                self.searches.append(search)
            elif known.after == search.after:
                self.waiting[search.node.uid] = before.pop(search.node.uid, search)
            else:
                self.waiting[search.node.uid] = search
        self.searches += [search._replace(until=now) for search in before.values()]

    def spec(self, node_id: str) -> NodeSpec:
        """Return a node type, for a substitute."""
        spec = self._registry.find(node_id)
        assert spec is not None  # the policy was checked when the mission was loaded
        return spec

    def decided(self, decision: Decision) -> None:
        """Note what the record has to say."""
        self._due.append(decision)

    def retried(self, node: Duty, late: float) -> None:
        """Note a retry, and how many seconds after its pause it was made."""
        self._delays.setdefault(node.registration_id, []).append(late)

    @property
    def late_retries(self) -> Iterator[str]:
        """Yield which nodes were tried again too late every time."""
        for node, delays in self._delays.items():
            if min(delays) > LATE_RETRY:
                yield "{} was tried again {:.1f} s later than the policy says".format(
                    node, min(delays))

    def ended(self, node: Duty, cause: Optional[Cause]) -> None:
        """Note that a leaf ended; ``cause`` None: it succeeded."""
        self._ends.setdefault(node.uid, []).append("SUCCESS" if cause is None else cause.value)
        self._last = label(node)

    def halted(self, node: Duty) -> None:
        """Note that a leaf was halted, as it has to report."""
        if not isinstance(node, Foreign):
            self._ends.setdefault(node.uid, []).append("IDLE")

    def stored(self, node: Duty, port: str) -> None:
        """Note that a node wrote an entry."""
        key = ports.reference(node.attributes.get(port, ""), port) or port
        self._writers[key.lstrip("@")] = node.registration_id

    def of_record(self, node: Duty) -> Tuple[str, Optional[Cause]]:
        """Return the next status of a node in this traversal, and why it failed, if it did."""
        mine = [letter for uid, letter in self._letters if uid == node.uid and letter != "-"]
        place = self._seen.get(node.uid, 0)
        self._seen[node.uid] = place + 1
        failures = [
            event.failure.cause for event in self._finished
            if event.uid == node.uid and event.failure
        ]
        calls = tuple(getattr(node.spec, "calls", ()))
        if self._queue and calls and isinstance(self._queue[0].request,
                                                calls) and node.status is not RUNNING:
            self._attribute(self._queue.pop(0), node)
        return mine[place] if place < len(mine) else "", failures[0] if failures else None

    def copy_entry(self, node: Duty, port: str) -> None:
        """Write an entry of a node without a row, as the record has it."""
        key = (ports.reference(node.attributes.get(port, ""), port) or port).lstrip("@")
        if key in self._recorded:
            node.blackboard.set(key, self._recorded[key])


Handler = Callable[[Execution, Any, float], None]

_NOTED: Dict[type, Handler] = {
    Asked: Execution._note_asked, Answered: Execution._note_answered,
    Message: Execution._note_message
}
"""What is kept of each event, for the witness too."""

_FOLLOWED: Dict[type, Handler] = {
    EntriesWritten: Execution._note_entries, HealthChanged: Execution._note_health,
    LeafFinished: Execution._note_leaf, Recovered: Execution._note_recovery,
    Recovering: Execution._note_recovery, Retried: Execution._note_recovery,
    PassStarted: Execution._start_pass, PassFinished: Execution._end_pass,
    RunFinished: Execution._end_run, SafeStateReported: Execution._note_safe_state,
    StepStarted: Execution._note_step, StillHearing: Execution._note_hearing,
    StopChanged: Execution._note_stop, Suspended: Execution._note_suspension,
    Tick: Execution._traverse
}
"""What is done again, until the first difference."""


def _waits(node: Any) -> bool:
    """Return whether a node goes on waiting for its sign: it, or the control that asks it again, is
    RUNNING."""
    return RUNNING in (node.status, is_asked_again(node) and node.parent.status)


def label(node: Any) -> str:
    """Return what a tester calls a node: its type, and its name if that says more."""
    name = node.registration_id
    if isinstance(node, reference.Recovering) and node.round is not None:
        return "{} ({})".format(name, node.round)
    return name if node.name in (name, "") else "{} {}".format(name, node.name)


def described(request: Any) -> str:
    """Return a request in words."""
    words = request.words
    return "{} {}".format(words.doing, words.what).strip() if words is not None else str(request)


def _unlike_fields(asked: Any, due: Any) -> str:
    names = [name for name in due.__struct_fields__ if getattr(asked, name) != getattr(due, name)]
    return ", ".join("{} is {!r} instead of {!r}".format(name, getattr(asked, name),
                                                         getattr(due, name)) for name in names)


def _of_tree(node: Any) -> Tuple[str, str]:
    return node.full_path, node.registration_id


def _result(query: Query) -> str:
    """Return the result of a request: an answer, or the cause of its failure."""
    return query.result.cause.value if isinstance(query.result, Failure) else \
        "an answer" if query.result is not None else "no answer"


def _value(ended: LeafFinished) -> str:
    """Return how a leaf ended: SUCCESS, IDLE, or the cause of its failure."""
    if (ended.failure is None) is (ended.status == "FAILURE"):
        return "{} although it {}".format(ended.status, "failed" if ended.failure else
                                          "did not fail")
    return ended.status if ended.failure is None else ended.failure.cause.value


def execute(facts: Facts) -> List[Execution]:
    """Do all missions of a record again: a node may take up another one while it runs. Raises
    CannotRepeat."""
    found: List[Execution] = []
    shown: List[TreeShown] = []
    for line in facts.run.lines:
        if isinstance(line.event, TreeShown):
            shown.append(line.event)
        elif isinstance(line.event, RunStarted):
            passes = found[-1].passes if found else 0
            found.append(Execution(line, passes, facts.test, shown))
            shown = []
        elif found:
            found[-1].take(line)
    return found
