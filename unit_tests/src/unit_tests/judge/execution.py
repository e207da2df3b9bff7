"""Does a run again with the reference's nodes: at each traversal on record, what had to happen, and
what did.

The mission's tree is built anew from its text, with the proved engine's controls and the nodes of
``reference``. It is ticked at the times of the record's traversals, with the answers and messages
that came until then; whether these were given, ``journal_check`` asks the journal. All else is
computed: which node is due, its request with every field, its result, the entries that it writes,
the recovery. The first difference from the record is the objection.

Two things are not computed. A node of another package has no row: its results, requests and entries
are those of the record. And the times of what the controller does: it is late if it was due more
than ``Facts.late`` before (a timer, the next traversal, the next pass), and early by more than
``Facts.early``.
"""
import itertools
import math
from typing import Any, Callable, Dict, List, Optional, Tuple, Union

from msgspec.structs import replace

from behavior_controller.bt import ManualClock, RUNNING
from behavior_controller.bt.loader.document import parse
from behavior_controller.bt.loader.tree_builder import build
from behavior_controller.bt.values.status import NAMES
from behavior_controller.config import settings
from behavior_controller.errors import BehaviorControllerError
from behavior_controller.run.events import (
    LETTERS, Answered, Asked, EntriesWritten, HealthChanged, LeafFinished, Line, Message, Noticed,
    PassFinished, PassStarted, Recovered, Recovering, Retried, RunFinished, RunStarted,
    SafeStateReported, StepStarted, RecognitionPending, StopChanged, Suspended, Tick, TreeShown)
from behavior_controller.run.health import GONE
from behavior_controller.missions.replay import complete, traverse_again
from behavior_controller.robot.gateway import Cause, Failure
from behavior_controller.robot.requests import Answer, QueryKnowledge, Request
from behavior_controller.simulation.configuration import TOPIC

from unit_tests.judge import files, reference
from unit_tests.judge.comparison import (
    Query, Traversal, WrittenEntries, decision, described, label, request_difference)
from unit_tests.judge.facts import Facts
from unit_tests.judge.foreign import registry
from unit_tests.judge.reference import SAFE_STATE, TaskContext, ReferenceNode, safe_state
from unit_tests.judge.outcome import ReceptionOutcome, VisitOutcome
from unit_tests.judge.signs import MessagesOnRecord, Signs
from unit_tests.judge.wire import SENT

SAFE_LIMIT = 1.0
"""Seconds that the safe state may take at the end."""

SAFE_RETRY = 0.1
"""Seconds from the failure of a part of the safe state to its next attempt."""

ONCE = (Cause.NO_ANSWER, Cause.NOT_ADVERTISED, Cause.TYPE_MISMATCH)
"""The causes of a failure after which a part of the safe state is not asked for again."""

_SHORTEST_PASS = 1.0
"""After a shorter pass the next one waits for so many seconds."""

LATE_RETRY = 0.18
"""Seconds that the promptest of several retries of a node may be late: one of them may meet a busy
machine, all of them do not."""

STATUS_WORDS = {"S": "SUCCESS", "F": "FAILURE", "R": "RUNNING", "-": "halted"}

TABLE = {spec.id for spec in reference.ROWS}
"""The node types that have a row."""


class Execution(TaskContext):
    """A record, done again line by line. ``difference`` is the first one, and ``differs_at`` its
    time; empty: none."""

    def __init__(self, facts: Facts):
        self.test, self._facts = facts.test, facts
        self.now = self.differs_at = self._pass_began = 0.0
        self.difference, self.passes = "", 0
        self.offset: Optional[float] = None  # from the mission's clock to Unix time
        self.queries: Dict[int, Query] = {}
        self._unexplained: List[Query] = []  # that no node has made yet
        self._asker = ""  # the node that made the newest request
        self.signs = Signs()
        self.tree: Any = None
        self._nodes: Dict[int, Any] = {}  # of the tree, by uid
        self._shown: List[TreeShown] = []
        self._next = math.inf, ""  # what is due next, and when
        # how far the times of the record are ahead of /clock, and when they got ahead in this pass
        self._ahead, self._jumped_at = math.inf, math.inf
        self._outcome, self._is_in_pass = "", False  # of the last pass
        # seconds after the pause of each retry, by node type
        self._delays: Dict[str, List[float]] = {}
        for line in facts.run.lines:
            self._take(line)

    def _begin(self, started: RunStarted) -> None:
        """Begin the mission whose tree was shown; a node may take up another one while it runs."""
        sources, self._pass_began, self.clock = started.sources, self.now, ManualClock()
        try:
            chosen = settings.recorded(started.settings, "settings")
            super().__init__(chosen, [source.text for source in sources.knowledge],
                             files.phrases(sources.phrases.text),
                             reference.PolicyTable(sources.policy.text))
            self.registry = registry()
            self.tree = build([parse(text, file) for file, text in sources.documents],
                              self.registry, self.clock)
            self._nodes = dict(enumerate(self.tree.nodes, 1))
            self.tree.setup(course=self)
        except BehaviorControllerError as error:
            self._differ(f"the mission on record cannot be done again: {error}")
            return
        self.signs.begin(self.clock, self.now)
        self.topics = MessagesOnRecord(self.robot)
        self.entries, self.traversal = WrittenEntries(self.tree), Traversal()
        self._next = self.now, "the first pass"
        self._is_in_pass = self._is_over = False
        self._clock_began: Optional[float] = None  # the offset at the first traversal of a pass
        self._visit_began, self._ready, self._pauses = 0.0, 0.0, 0  # after the last pass
        # of the tree in the newest traversal, if it has ended; of the last pass; the last leaf
        self._result = self._outcome = self._last = ""
        # why recoveries failed that had nothing to recover from, by uid: their ends do not say it
        self._unneeded: Dict[int, Failure] = {}
        self.tree.subscribe(
            lambda node, old, new: self.traversal.changes.append((node.uid, LETTERS[NAMES[new]])))
        places = [(node.full_path, node.registration_id) for node in self.tree.nodes]
        leaves = [place for place, node in zip(places, self.tree.nodes)
                  if isinstance(node, ReferenceNode)]
        if leaves != list(map(tuple, started.leaves)) or [places] != [
                [(node.path, node.type) for node in tree.nodes] for tree in self._shown]:
            self._differ("the tree on record is not that of the mission file")
        self._shown.clear()

    # ----------------------------------------------------------------------------------- the record

    def _take(self, line: Line) -> None:
        """Go on with the next event of the record."""
        event, self.now = line.event, line.time
        if line.ros is not None:
            ahead, self._ahead = self._ahead, line.time - line.ros
            if self._ahead > ahead + self._facts.early:
                self._jumped_at = self.now
        if isinstance(event, PACING):
            self._differ(self.overdue(self.now))
        is_begun = self.tree is not None or isinstance(event, (TreeShown, RunStarted))
        is_of_use = is_begun and (not self.difference or isinstance(event, REQUESTS))
        if type(event) in _HANDLERS and is_of_use:
            _HANDLERS[type(event)](self, event)

    def _note_asked(self, event: Asked) -> None:
        query = self.queries.setdefault(
            event.call, Query(event.call, event.request, event.service, self.now))
        self._unexplained.append(query)
        if self._is_over:
            self._differ("after the end of the run nothing is due; what was asked: "
                         f"{self._described(query)}")

    def _note_answer(self, event: Answered) -> None:
        query = self.queries.get(event.call)
        if query is not None and (query.result, query.dropped) != (None, None):
            self._differ(f"{query.node} has an answer on record that nothing waits for: {query}")
        elif query is not None:
            query.answered, query.result = self.now, event.result

    def _note_hearing(self, event: RecognitionPending) -> None:
        if self.test.recognise_by == TOPIC:
            self._differ(f"{event.topic} is no action that goes on hearing")
        self.topics.take(event)

    def _note_entries(self, event: EntriesWritten) -> None:
        if self.entries.note(event):
            self._differ(f"the entries after {self._last} are on record twice")

    def _note_health(self, event: HealthChanged) -> None:
        if event.respect == GONE:
            self.gone.discard(event.name)
            if not event.is_well:
                self.gone.add(event.name)
        if self.passes and not self._is_in_pass:
            self._expect_pass()

    def _note_suspension(self, event: Suspended) -> None:
        if not self.settings.ros_interface:
            self._differ(f"{event.words}, and there is no way to ask for that")
        self._next = self.now, "the mission"
        if event.words:
            self._next = math.inf, ""

    def _note_leaf(self, event: LeafFinished) -> None:
        if not self._is_of(event):
            self._differ(f"node {event.uid} is not {event.node} {event.path}")
        failure = self._unneeded.pop(event.uid, None)
        if failure is not None:
            event = replace(event, failure=failure)
        self.traversal.finished.append(event)

    def _is_of(self, event: Union[LeafFinished, Recovering, Recovered]) -> bool:
        """Return whether the number of a node is that of its path and type."""
        node = self._nodes.get(event.uid)
        return node is not None and (event.path, event.node) == (node.full_path,
                                                                 node.registration_id)

    def _note_step(self, event: Union[StepStarted, StopChanged]) -> None:
        is_request = isinstance(event, StopChanged) or not (event.is_wait or event.goes_on)
        if event.node in TABLE and is_request:
            self.traversal.decisions.append(decision(event))

    def _note_recovery(self, event: Union[Recovering, Retried, Recovered]) -> None:
        if isinstance(event, Recovered):
            if self._is_of(event):  # there was nothing to recover from
                self._unneeded[event.uid] = event.failure
                return
            if event.success is (event.outcome == reference.GIVEN_UP):
                self._differ(f"the recovery of {event.node} is {event.outcome}; on record its "
                             f"success is {event.success}")
        self.traversal.decisions.append(decision(event))

    # ----------------------------------------------------------------------------------- the passes

    def _start_pass(self, event: PassStarted) -> None:
        self._pass_began, self._visit_began, self._clock_began = self.now, event.at, None
        self._jumped_at = math.inf
        if self._is_in_pass or event.number != self.passes + 1:
            self._differ("pass {} began, and pass {} had to {}".format(
                event.number, self.passes + 1, "end" if self._is_in_pass else "begin"))
        for query in self._unexplained:
            asked = self._described(query)
            self._differ(f"before the pass nothing is due; what was asked: {asked}")
        early, persists = self._ready - event.at, "and the cause of the last failure persists"
        if early > 0.01:
            self._differ(f"the pass began {early:.1f} s too early, {persists}")
        elif self._next[0] == math.inf:
            self._differ(f"the pass began without a pause, {persists}")
        self._is_in_pass = True
        self._next = self.now, f"the first step of pass {event.number}"
        self.begin_visit(self.tree.blackboard, event.at)

    def _note_jump(self, event: Noticed) -> None:
        """End the pass if the simulated time has jumped back."""
        if event.jumped_back and self._is_in_pass:
            self.clock.set_to(self.now - (self.offset or 0.0))
            self.tree.stop()
            self._result, self._jumped_at = "FAILURE", math.inf
            self._next = self.now, "the end of the pass"

    def _end_pass(self, event: PassFinished) -> None:
        now = self.clock.now()
        seconds = now - self._visit_began
        if self._is_late(abs(event.seconds - seconds)):
            self._differ(f"the pass took {seconds:.1f} s; on record are {event.seconds:.1f} s")
        if (event.number, event.outcome) != (self.passes + 1, self._result):
            self._differ("pass {} ended with {}; its tree ends with {}".format(
                event.number, event.outcome, self._result or "nothing yet"))
        self._differ(next(self.traversal.unlike_reports(self.tree.nodes), ""))
        self.traversal = Traversal(self._last)
        self.passes += 1
        self._is_in_pass, self._outcome, self._ready = False, event.outcome, now
        if event.seconds < _SHORTEST_PASS:
            self._ready += _SHORTEST_PASS
        if event.outcome == "SUCCESS":
            self._pauses = 0
        elif event.outcome == "FAILURE":
            pause = self.pause(self._pauses, self._ready)
            self._pauses += bool(pause)
            self._ready += pause
        self._expect_pass()

    def _expect_pass(self) -> None:
        """Note when the next pass has to begin, or the run has to end."""
        if self.passes == self.test.mission_runs:
            self._next = self.now + SAFE_LIMIT * self._facts.pace, "the end of the run"
            return
        failed_for = {resource for _, resource in self.failures_of_pass}
        is_awaited = self._outcome == "FAILURE" and not self.gone.isdisjoint(failed_for)
        ready = math.inf if is_awaited else max(self.now, self._ready + (self.offset or 0.0))
        self._next = ready, f"pass {self.passes + 1}"

    def _note_safe_state(self, event: SafeStateReported) -> None:
        causes = {part.service: None if part.failure is None else part.failure.cause
                  for part in event.parts}
        services = (self.robot.resource(type(request)) for request in SAFE_STATE)
        # a part that the robot does not have is left out
        self.traversal.decisions.append(safe_state(
            [causes.get(service, Cause.NOT_ADVERTISED) for service in services]))

    def _end_run(self, event: RunFinished) -> None:
        queries, reports = self._unexplained, self.traversal.decisions
        for query in queries:
            query.drop(self.now)
        parts = [[query for query in queries if query.request == request] for request in SAFE_STATE]
        if [query.request for query in queries[:2]] != list(SAFE_STATE) or any(
                query.request not in SAFE_STATE for query in queries):
            self._differ("at the end the safe state is due, once; what was asked: {}".format(
                ", ".join(map(str, queries)) or "nothing"))
            parts = []
        for asked in parts:
            self._check_attempts(asked)
        due = safe_state([asked[-1].cause if asked[-1].result is not None else Cause.NO_ANSWER
                          for asked in parts])
        if reports != [due]:
            self._differ(f"at the end {due}; on record is: "
                         f"{', '.join(map(str, reports)) or 'nothing'}")
        elif not event.outcome.endswith(self._outcome):
            self._differ(
                f"the last pass ended with {self._outcome}; at the end it was {event.outcome}")
        self._unexplained.clear()
        self._is_over, self._next = True, (math.inf, "")

    def _check_attempts(self, asked: List[Query]) -> None:
        """Object to attempts at a part of the safe state that were not due, or did not come."""
        for before, query in zip(asked, asked[1:]):
            pause = query.asked - (before.answered or math.inf)
            if before.cause in (None, *ONCE) or pause < self._facts.shortest(SAFE_RETRY):
                self._differ(f"at the end the safe state is due, once; asked for again: {query}")
        last, left = asked[-1], asked[0].asked + SAFE_LIMIT - self.now
        if last.cause not in (None, *ONCE) and left > self._facts.early:
            self._differ("at the end a part of the safe state was not asked for again: "
                         f"{last}, {last.outcome}, and {left:.1f} s were left")

    def outcomes(self) -> List[VisitOutcome]:
        """Return what the visitor of each pass saw and heard; none if the mission neither drives to
        exhibits nor asks for the wanted place."""
        types = {node.registration_id for node in self._nodes.values()}
        stops = [node.attributes.get(reference.STOP, reference.EXHIBIT)
                 for node in self._nodes.values() if node.registration_id == reference.SELECTS]
        if types.isdisjoint(reference.DRIVES) or not stops:
            return []
        places = files.places(self.settings.scenario_specification, self.robot.has_files)
        kind = VisitOutcome
        if reference.EXHIBIT not in stops:
            kind = ReceptionOutcome
            if not any(place.description1.endswith("?") for place in places.exhibits):
                return []
        return [kind(visit, self._facts, places, types, self.farewells)
                for visit in self._facts.run.visits]

    # ----------------------------------------------------------------------------------- traversals

    def _traverse(self, tick: Tick) -> None:
        if tick.first is None:  # it follows from what the traversals do
            return
        self._check_clock(tick)
        self.topics.begin()
        self.traversal.recorded = tick.changes
        result, error = traverse_again(
            self.tree, self.clock, tick, tick.changes, self.traversal.changes)
        if error and not isinstance(getattr(error, "cause", error), BehaviorControllerError):
            self._differ(f"the mission cannot be done again: {error}")
        self._differ(self._first_difference())
        self.traversal = Traversal(self._last)
        self._expect_traversal(result)
        complete(self.tree, result)
        self.signs.end_traversal()

    def _check_clock(self, tick: Tick) -> None:
        offset = self.now - tick.at
        if self.offset is None or offset < self.offset:
            self.offset = offset
        if not self._is_in_pass:
            self._differ("the mission went on, and no pass had begun")
        if self.now > self._facts.latest(self._jumped_at):
            self._differ("the pass went on after the simulated time had jumped back")
        if self._clock_began is None:
            self._clock_began = offset
            seconds = tick.at - self._visit_began
            if seconds < 0.0 or self._is_late(seconds):
                self._differ(f"the pass began at {self._visit_began:.1f} s, its first step came at "
                             f"{tick.at:.1f} s")
        if self._is_late(abs(offset - self._clock_began)):
            self._differ(f"the mission's clock is {offset - self._clock_began:.1f} s wrong")

    def _is_late(self, seconds: float) -> bool:
        """Return whether something is late that was due so many seconds ago."""
        return self.now > self._facts.latest(self.now - seconds)

    def _expect_traversal(self, result: Any) -> None:
        """Note the result of the tree, or when the next traversal has to come: at once if one is
        wanted, else at the next timer."""
        self._result, self._next = NAMES.get(result, "FAILURE"), (self.now, "the end of the pass")
        if result is RUNNING:
            time, due = self.now, self.clock.next_due()
            if not self.tree.is_tick_wanted:
                time = math.inf if due is None else due + (self.offset or 0.0)
            self._result, self._next = "", (time, "")

    @property
    def is_paused(self) -> bool:
        """Whether a pass has failed, and the next one has to wait."""
        return self._outcome == "FAILURE" and not self._is_in_pass and self._next[0] > self.now

    def overdue(self, time: float) -> str:
        """Return what had to come long before that time, and has not come; empty: nothing."""
        due, what = self._next
        if time <= self._facts.latest(due):
            return ""
        return f"{what or self.under_way()} was due {time - due:.1f} s before"

    def under_way(self) -> str:
        """Return the nodes that are running, without a running child."""
        running = [node for node in self.tree.nodes if node.status is RUNNING and not any(
            child.status is RUNNING for child in node.children)]
        return " or ".join(map(label, running)) or "a timer"

    # ------------------------------------------------------------------------------- the difference

    def _differ(self, text: str) -> None:
        """Note a difference; empty: there is none."""
        if text and not self.difference:
            self.differs_at = max(self.now, self._pass_began)
            place = f"pass {self.passes + 1}, {self.differs_at - self._pass_began:.1f} s"
            if self.passes and not self._is_in_pass:
                place = f"after pass {self.passes}"
            self.difference = f"{place}: {text}"

    def _first_difference(self) -> str:
        """Return the first difference of the traversal: a request or a change of status, then what
        else is on record."""
        traversal = self.traversal
        pairs = itertools.zip_longest(traversal.changes, traversal.recorded, fillvalue=(None, ""))
        for place, (due, came) in enumerate(pairs):
            if due != came:
                return self._misstep(place, *due, *came)
        for query in self._unexplained:
            return (f"after {self._asker or self._last}, while {self.under_way()} goes on, "
                    f"nothing more was due; what was asked: {self._described(query)}")
        return next(itertools.chain(traversal.unlike_reports(self.tree.nodes),
                                    self.entries.differences(self._last)), "")

    def _misstep(self, place: int, uid: Optional[int], letter: str, other: Optional[int],
                 other_letter: str) -> str:
        """Return which change of status had to come at a place, and which other one came."""
        if uid == 0:  # a request was wrong
            return letter
        due, came = "nothing more had to be", "nothing"
        if uid is not None:
            parent, cause = self._nodes[uid].parent, self.traversal.cause(uid)
            due = f"{self._label(uid)} had to be {STATUS_WORDS[letter]}"
            if cause and letter == "F":
                due += f" ({cause})"
            if parent is not None:
                due += f" (in {label(parent)})"
        if other is not None:
            came = f"{self._label(other)} {STATUS_WORDS[other_letter]}{self._early(other)}"
        return f"{self._after(place)}{due}; on record is {came}"

    def _early(self, uid: int) -> str:
        """Return in words how long a node had to wait yet; empty: it waits for no time."""
        node = self._nodes.get(uid)
        timer: Any = getattr(node, "timer", None)
        if node is None or node.status is not RUNNING or not getattr(timer, "callback", None):
            return ""
        return f", {timer.due - self.clock.now():.1f} s too early"

    def _after(self, place: int) -> str:
        """Return which leaf had ended before a change of status."""
        ended = [self._label(uid) for uid, letter in self.traversal.changes[:place]
                 if letter in "SF" and isinstance(self._nodes[uid], ReferenceNode)]
        last = ended[-1] if ended else self.traversal.last
        return last and f"after {last}, "

    def _label(self, uid: int) -> str:
        """Return the label of a node; that of a control has the first leaf below it."""
        if uid not in self._nodes:
            return f"node {uid}"
        node = first = self._nodes[uid]
        while first.children:
            first = first.children[0]
        return label(node) if first is node else f"{label(node)} of {label(first)}"

    # ------------------------------------------------------------------------- what the nodes go by

    def ask(self, node: ReferenceNode, request: Union[Request, type], is_step: bool) -> Query:
        """Return a request with its answer, if that has come; of a node without a row only the
        request's kind is known. ``is_step``: the record tells that it begins."""
        is_told = is_step and not isinstance(node, reference.RecoveryTask)
        if node.registration_id in TABLE and is_told:
            self.traversal.decided(node, reference.STEP_BEGINS)
        if isinstance(request, QueryKnowledge) and self.robot.has_files:
            places = getattr(self.known.building, request.what)
            return Query(0, request, "", self.unix_now, result=Answer(exhibits=places))
        if not self._is_next(request):
            what, came = "", "nothing was asked"
            if not isinstance(request, type):
                what = ": " + described(request)
            for asked in self._unexplained[:1]:
                came = (f"what was asked: {self._described(asked)}"
                        f"{request_difference(asked.request, request)}")
            after = self._after(len(self.traversal.changes))
            self.traversal.changes.append((0, f"{after}{label(node)} was due{what}; {came}"))
            return Query(0, request, "", self.unix_now)
        query = self._take_next(node)
        kind = type(query.request)
        resource = self.robot_for(kind).resource(kind)
        if query.service != resource:
            wrong = f"{label(node)} asked {query.service} for {query}; {resource} was due"
            self.traversal.changes.append((0, wrong))
        early = self.unix_now - query.asked
        if early > self._facts.early:
            wrong = f"{label(node)} asked {early:.1f} s too early: {query}"
            self.traversal.changes.append((0, wrong))
        return query

    def _is_next(self, request: Union[Request, type, Tuple[type, ...]]) -> bool:
        """Return whether the next request is that one, or of that kind or one of these."""
        asked = [query.request for query in self._unexplained[:1]]
        if isinstance(request, Request):
            return asked == [request]
        return bool(asked) and isinstance(asked[0], request)

    def robot_for(self, kind: type) -> Any:
        """Return what declares how requests of a kind are answered: other packages declare theirs.
        """
        return self.robot if kind in SENT else self.settings.interface

    def _take_next(self, node: ReferenceNode) -> Query:
        """Return the next request, which is that of the node."""
        self._asker, query = label(node), self._unexplained.pop(0)
        query.node, query.path = node.registration_id, node.full_path
        return query

    def _described(self, asked: Query) -> str:
        """Return a request in words, and which node has made the same before."""
        before = [query.node for query in self.queries.values()
                  if query.request == asked.request and query.node]
        return f"{asked}, as {before[-1]} did before" if before else str(asked)

    @property
    def unix_now(self) -> float:
        """The time of the traversal."""
        return self.clock.now() + (self.offset or 0.0)

    @property
    def late_retries(self) -> List[str]:
        """The nodes that were tried again more than once, and too late every time."""
        return [f"{node} was tried again {min(delays):.1f} s later than the policy says"
                for node, delays in self._delays.items()
                if len(delays) > 1 and min(delays) > LATE_RETRY * self._facts.pace]

    def retried(self, node: str, due: float) -> None:
        """Note that a node is tried again now; it was due at a time of the mission's clock."""
        due += self.offset or 0.0
        stood_still = self._facts.latest(due) - due - self._facts.late
        self._delays.setdefault(node, []).append(self.unix_now - due - stood_still)

    def ended(self, node: ReferenceNode, end: str) -> None:
        """Note how a leaf ended: SUCCESS, or the cause of its failure."""
        self.traversal.ended(node, end)
        self._last = label(node)

    def of_record(self, node: ReferenceNode) -> Tuple[str, Optional[Cause]]:
        """Return the next status of a node in this traversal, and why it failed, if it did."""
        traversal = self.traversal
        letters = traversal.letters.setdefault(node.uid, iter([
            letter for uid, letter in traversal.recorded if uid == node.uid and letter != "-"]))
        causes = (event.failure.cause for event in traversal.finished
                  if event.uid == node.uid and event.failure)
        if self._is_next(tuple(getattr(node.spec, "calls", ()))):  # it may ask several times
            self._take_next(node)
        return next(letters, ""), next(causes, None)


_HANDLERS: Dict[type, Callable[[Execution, Any], None]] = {
    Asked: Execution._note_asked, Answered: Execution._note_answer,
    Message: lambda execution, event: execution.topics.take(event),
    RecognitionPending: Execution._note_hearing, EntriesWritten: Execution._note_entries,
    HealthChanged: Execution._note_health, LeafFinished: Execution._note_leaf,
    Noticed: Execution._note_jump,
    Recovered: Execution._note_recovery, Recovering: Execution._note_recovery,
    Retried: Execution._note_recovery, PassStarted: Execution._start_pass,
    PassFinished: Execution._end_pass, RunStarted: Execution._begin,
    RunFinished: Execution._end_run, SafeStateReported: Execution._note_safe_state,
    StepStarted: Execution._note_step, StopChanged: Execution._note_step,
    Suspended: Execution._note_suspension, Tick: Execution._traverse,
    TreeShown: lambda execution, event: execution._shown.append(event)
}
"""The events that are done again, until the first difference."""

REQUESTS = (Asked, Answered)
"""The events that are kept after the first difference too, for the check of the journal."""

PACING = (PassStarted, Tick, PassFinished, RunFinished)
"""The events that come late if nothing else has come when they were due."""
