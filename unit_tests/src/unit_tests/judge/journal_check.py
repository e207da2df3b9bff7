"""The check of a run against the journal of the simulated nodes: each request, answer and message
on record needs its line there.

Nothing is excused that the journal does not show: a failed call needs its fault, a node that is
away its crash, a wait without an end the silence of its topic. What a real node or one of another
package was asked and said stands in the record alone.
"""
import itertools
import math
from typing import Any, Dict, Iterator, List, NamedTuple, Optional, Sequence, Union

from behavior_controller.run.events import HealthChanged, Noticed
from behavior_controller.run.health import GONE
from behavior_controller.robot.declarations import Action, Publication, Service, Topic
from behavior_controller.robot.gateway import Cause
from behavior_controller.robot.requests import Answer, Prompt, QueryKnowledge
from behavior_controller.simulation.faults import CRASH, EXCEPTION, REFUSED, UNANSWERED, WRONG
from behavior_controller.simulation.journal import JournalEntry

from unit_tests.judge import files
from unit_tests.judge.comparison import Query, result_words
from unit_tests.judge.execution import Execution
from unit_tests.judge.facts import EARLY_TOLERANCE, Facts, of
from unit_tests.judge.reference import SAFE_STATE
from unit_tests.judge.signs import objections
from unit_tests.judge.wire import SENT, robot_of

CAUSE_OF = {REFUSED: Cause.REFUSED, EXCEPTION: Cause.HANDLER_EXCEPTION, UNANSWERED: Cause.NO_ANSWER,
            CRASH: Cause.CONNECTION_LOST, WRONG: Cause.UNUSABLE_ANSWER}
"""The cause by which the controller must record each kind of fault."""

AWAY_CAUSES = {Cause.NOT_REACHABLE, Cause.NOT_ADVERTISED, Cause.CONNECTION_LOST}
"""The causes of failures between the crash of a node and its return."""


class Pair(NamedTuple):
    """A request on record and the line of the node that got it; one of them may be missing."""

    service: Service
    query: Optional[Query]
    line: Optional[JournalEntry]

    @property
    def time(self) -> float:
        """When the node got the request; if it did not, when it was made."""
        return self.line.time if self.line is not None else self.query.asked  # type: ignore

    @property
    def call(self) -> str:
        """The node and the number of the call, as plannedFaults names it."""
        return f"{self.line.node}:{self.line.call}"  # type: ignore

    @property
    def fault(self) -> str:
        """The fault that was injected; empty: none."""
        return self.line.fault or "" if self.line is not None else ""


class JournalCheck:
    """The journal beside the record."""

    def __init__(self, facts: Facts, execution: Execution):
        chosen = facts.world.settings
        self._facts, self._interface = facts, chosen.interface
        self._name_of = self._interface.name_of
        self._execution, self._crashes = execution, facts.crashes
        self.end = max([facts.run.state.at, *(line.time for line in facts.journal)])
        self._robot, self._deadlines = robot_of(chosen), chosen.deadlines
        self._places = files.places(chosen.scenario_specification, self._robot.has_files)
        self._safe_limit = max(self._deadlines[self._interface.service(type(request)).deadline_key]
                               for request in SAFE_STATE)
        names = dict.fromkeys(map(self._name_of, self._interface.services))
        self.pairs = sorted(itertools.chain(*map(self._pair, names)), key=lambda pair: pair.time)
        self._in_journal = {line.resource for line in facts.journal}

    @property
    def only_recorded(self) -> List[str]:
        """The nodes whose requests have the record as their only witness."""
        asked = {pair.service.node for pair in self.pairs if not self._is_witnessed(pair.service)}
        return sorted(self._facts.real | asked)

    def _is_witnessed(self, service: Service) -> bool:
        """Return whether the service's node writes the journal: a play simulates the nodes of other
        packages, a test does not."""
        is_simulated = service.request in SENT or self._name_of(service) in self._in_journal
        return is_simulated and service.node not in self._facts.real

    def _carrier(self, query: Query) -> Service:
        """Return what carried out a request: of a name there may be a service and an action."""
        declared = self._interface.service(type(query.request))
        return self._facts.test.carrier(declared, self._interface)

    def _pair(self, name: str) -> Iterator[Pair]:
        """Yield the requests to a service, each with its line: the next one while it was under way,
        or of several requests under way at once that with its content.
        """
        lines = [line for line in self._facts.journal if line.call and line.resource == name]
        queries = [query for query in self._execution.queries.values() if query.service == name]
        service = next(each for each in self._interface.services if self._name_of(each) == name)
        paired: Optional[JournalEntry] = None
        for number, (query, following) in enumerate(itertools.zip_longest(queries, queries[1:]), 1):
            service = self._carrier(query)
            while lines and lines[0].time < query.asked - self._facts.early:
                yield Pair(service, None, lines.pop(0))
            place = self._overtaken_by(lines, query, itertools.islice(queries, number, None))
            if place:
                lines.insert(0, lines.pop(place))
            while paired is not None and self._is_repeated(paired, lines, query, following):
                yield Pair(service, None, lines.pop(0))
            line = None
            if lines and self._is_of(lines, query, following):
                paired = line = lines.pop(0)
            yield Pair(service, query, line)
        for line in lines:
            yield Pair(service, None, line)

    def _overtaken_by(self, lines: Sequence[JournalEntry], query: Query,
                      later: Iterator[Query]) -> int:
        """Return how many of the next lines are those of ``later`` requests that were under way at
        the same time and reached the node before this one, whose line comes after them; 0: none."""
        following = next(later, None)
        if following is None or not lines or self._fits(query, lines[0]):
            return 0
        until = query.answered
        if until is None:  # it was dropped
            until = self._facts.latest(following.asked)
        beside = list(itertools.takewhile(lambda other: other.asked < until,
                                          itertools.chain([following], later)))
        for place, line in enumerate(lines):
            owners = [other for other in beside if self._fits(other, line)]
            if self._fits(query, line):
                is_theirs = query.answered is None and bool(owners)
                if is_theirs or not self._is_of(lines[place:], query, following):
                    return 0
                return place
            if not any(other.asked <= line.time + self._facts.early for other in owners):
                break
        return 0

    def _fits(self, query: Query, line: JournalEntry) -> bool:
        """Return whether a line has the content of a request."""
        return line.content == self._fields(query, line)

    def _is_repeated(self, paired: JournalEntry, lines: Sequence[JournalEntry], query: Query,
                     following: Optional[Query]) -> bool:
        """Return whether the next line is the last one once more, and the one after it is that of a
        request."""
        if len(lines) < 2 or lines[0].content != paired.content or (
                self._is_next(lines[0], query, following)):
            return False
        due = self._fields(query, lines[0])
        is_other = lines[0].content != due and lines[1].content == due
        return is_other and self._is_of(lines[1:], query, following)

    def _is_of(self, lines: Sequence[JournalEntry], query: Query,
               following: Optional[Query]) -> bool:
        """Return whether the next line may be that of a request: the node got it while it was under
        way, or soon after. One that was dropped need not have reached its node."""
        line = lines[0]
        if not self._reaches(query, line) or self._is_next(line, query, following):
            return False
        if query.answered is not None:
            # a request without an answer may have been late on its way
            is_of_node = line.fault == UNANSWERED or query.cause is not Cause.NO_ANSWER
            if is_of_node or line.time <= query.answered:
                return line.time <= query.answered + self._facts.early
        # /clock reaches one process after the other
        skew = self._facts.early - EARLY_TOLERANCE
        if following is None or line.time <= following.asked - skew:
            return True
        is_in_time = line.time <= self._facts.latest(following.asked)
        if not is_in_time or not self._fits(query, line):
            return False
        has_another = len(lines) > 1 and lines[1].time <= (following.answered or math.inf)
        fits_following = self._fits(following, line)
        return has_another or not self._reaches(following, line) or not fits_following

    def _reaches(self, query: Query, line: JournalEntry) -> bool:
        """Return whether a request with that result can have reached its node, as that line."""
        if query.cause is Cause.CONNECTION_LOST:
            return self._as_ended(query, line).fault == CRASH
        return query.cause is not Cause.TYPE_MISMATCH and query.cause not in AWAY_CAUSES

    def _as_ended(self, query: Query, line: JournalEntry) -> JournalEntry:
        """Return a line as the call ended: with a crash, if another call crashed the node first."""
        ends = math.inf
        if line.fault != UNANSWERED:
            ends = line.time + line.seconds
        limit = ends - self._facts.early
        if query.cause is Cause.CONNECTION_LOST:
            limit = self._facts.latest(ends)
        crash = next((crash.time for crash in self._crashes
                      if crash.node == line.node and line.time < crash.time < limit), None)
        if crash is None:
            return line
        return line._replace(fault=CRASH, seconds=crash - line.time)

    def _is_next(self, line: JournalEntry, query: Query, following: Optional[Query]) -> bool:
        """Return whether a line can only be that of the following request."""
        return following is not None and line.time >= following.asked and (
            self._fits(following, line) and not self._fits(query, line))

    def objections(self) -> Iterator[str]:
        """Object to requests, answers, messages and losses that record and journal do not share: of
        each service to the first."""
        asker = "the beginning"
        before: Dict[str, Optional[JournalEntry]] = {}  # of each service
        told: Dict[str, List[str]] = {}
        until = self._execution.differs_at or math.inf  # what comes later may follow from that
        for pair in self.pairs:
            name = pair.service.name
            if pair.query is not None:
                asker = pair.query.asker
            if self._is_witnessed(pair.service) and not told.get(name) and pair.time <= until:
                told[name] = list(self._of_pair(pair, asker, before.get(name)))
                yield from told[name]
            before[name] = pair.line
        yield from self._of_health()
        yield from self._of_jumps()
        signs, offset = self._execution.signs, self._execution.offset
        if offset is not None:
            end = self._execution.differs_at or self.end  # later searches are not known
            yield from filter(None, objections(self._facts, signs, offset, end))

    def _of_jumps(self) -> Iterator[str]:
        """Object to jumps of the simulated time that the simulated nodes have not seen."""
        told = sum(event.jumped_back for _, event in of(self._facts.run.lines, Noticed))
        seen = max((line.jumped for line in self._facts.journal), default=told)
        if told > seen + self._facts.early:
            yield (f"the simulated time jumped back by {seen:.1f} s in all; on record are "
                   f"{told:.1f} s")

    def _of_pair(self, pair: Pair, asker: str, before: Optional[JournalEntry]) -> Iterator[str]:
        """Object to a request; ``asker`` is what has made the newest one on record, ``before`` what
        the node got before."""
        service, query, line = pair
        if line is None:
            assert query is not None
            yield from self._unheard(query, service)
        elif query is None and before is not None and before.content == line.content:
            yield (f"{asker}: {line.resource} was asked twice for {line.content}, and one request "
                   "is on record")
        elif query is None:
            yield (f"after {asker}, {line.resource} was asked {line.content}, and no such request "
                   "is on record")
        else:
            sent = self._fields(query, line)
            if sent != line.content:
                yield f"{asker}: {line.resource} was asked {line.content} instead of {sent}"
            if line.objection is not None:
                yield (f"{asker}: {line.resource} received a request that makes no sense: "
                       f"{line.objection}")
            yield from self._of_result(query, self._as_ended(query, line), service)

    def _fields(self, query: Query, line: JournalEntry) -> Dict[str, Any]:
        """Return the fields of a request as they have to be sent."""
        sent = SENT.get(type(query.request))
        if sent is None:  # of another package
            return dict(zip(line.content, self._carrier(query).fields(query.request)))
        return dict(zip(line.content, sent(query.request, self._interface.name)))

    def _unheard(self, query: Query, service: Service) -> Iterator[str]:
        """Object to a request that reached no node, unless the node was away."""
        cause = query.cause
        # nothing is sent in less, if the machine is busy
        is_short = self._until(query) - query.asked < (
            self._facts.latest(query.asked) - query.asked - self._facts.early)
        if self._facts.test.lacks(service):
            may_lack = service.is_optional and not service.fails_without
            is_well = cause is (None if may_lack else Cause.NOT_ADVERTISED)
        elif query.result is None:  # it may have been dropped on its way
            is_well = is_short or self._is_away(service.node, query.asked)
        elif cause is Cause.NO_ANSWER:
            is_well = is_short
        else:
            is_well = cause in AWAY_CAUSES and self._is_away(service.node, query.asked)
        if not is_well:
            yield (f"{query.asker}: {query.service} never got the request {query}, and on record "
                   f"is {query.outcome}")

    def _until(self, query: Query) -> float:
        """Return until when an answer was awaited."""
        return next((at for at in (query.answered, query.dropped) if at is not None), self.end)

    def _is_away(self, node: str, at: float) -> bool:
        """Return whether a node had crashed and was perhaps not back.

        When a test is disturbed, each node may have ended.
        """
        if self._facts.is_disturbed:
            return True
        crash = max((crash.time for crash in self._crashes
                     if crash.node == node and crash.time <= self._facts.latest(at)), default=None)
        if crash is None or at < crash + self._facts.away:
            return crash is not None
        return not any(line.node == node and crash < line.time < at for line in self._facts.journal)

    def _of_result(self, query: Query, line: JournalEntry, service: Service) -> Iterator[str]:
        """Object to a result that is not that of the node."""
        name, result, fault = query.asker, query.result, line.fault
        # a goal is sent when its server is back
        is_awaited = isinstance(service, Action) and self._is_away(service.node, query.asked)
        if line.time > self._facts.latest(query.asked) and not is_awaited:
            yield f"{name}: {query.service} got the request {line.time - query.asked:.1f} s late"
        limit = self._deadlines[service.deadline_key]
        until, deadline = self._until(query), query.asked + limit
        due = deadline if fault == UNANSWERED else min(line.time + line.seconds, deadline)
        latest = due
        if query.is_for_safety:  # all results are read when the last one is there
            latest = query.asked + self._safe_limit * self._facts.pace
        elif due == deadline and query.request in SAFE_STATE:  # it may take the computer's time
            latest = query.asked + limit * self._facts.pace
        is_early = result is not None and until < due - self._facts.early
        if until > self._facts.latest(latest) or is_early:
            yield (f"{name}: {query.service} was waited for {until - query.asked:.1f} s; it was "
                   f"due after {due - query.asked:.1f} s, its deadline is "
                   f"{deadline - query.asked:g} s")
        is_too_late = query.cause is Cause.NO_ANSWER and self._facts.latest(due) > deadline
        if result is None or is_too_late or line.objection is not None and fault is None:
            return
        done = "carried out" if fault is None else f"made to fail ({fault})"
        call, said = f"call {line.call} of {line.resource}", self._due_result(query, line, service)
        found = query.cause or result
        if found != said and not (said is None and query.cause is None):
            its, right = result_words(found, said)
            yield f"{call} for {name} was {done}; on record is {its} instead of {right}"
        served = self._served(query, line, service)
        if None not in (said, served) and said != served:
            yield "{} was {}; its node sent {} instead of {}".format(
                call, done, *result_words(said, served))

    def _due_result(self, query: Query, line: JournalEntry,
                    service: Service) -> Union[Answer, Cause, None]:
        """Return what the node's response says, or the cause of its failure; None: an answer that
        another package reads."""
        is_known = self._name_of(service) == query.service and service.request in SENT
        is_sent = is_known and line.fault not in (EXCEPTION, UNANSWERED, CRASH)
        if line.response is not None and is_sent:
            return self._robot.result(service.request, line.response)
        return _cause(line.fault, service)

    def _served(self, query: Query, line: JournalEntry,
                service: Service) -> Union[Answer, Cause, None]:
        """Return what a simulated node has to say; None: that is for the visitor to decide."""
        if isinstance(query.request, Prompt):
            return None
        if line.fault is None and isinstance(query.request, QueryKnowledge):
            return Answer(exhibits=getattr(self._places, query.request.what.lower()))
        return _cause(line.fault, service) or Answer()

    # --------------------------------------------------------------------------------------- health

    def _of_health(self) -> Iterator[str]:
        """Object to services that were taken for gone, and to a loss that was not noticed."""
        test, changes = self._facts.test, [
            (time, event) for time, event in of(self._facts.run.lines, HealthChanged)
            if event.kind != Topic.kind and event.respect == GONE and not event.is_well]
        absent = {self._interface.namespace + name for name in test.absent_services}
        witnessed = {self._name_of(service) for service in self._interface.services
                     if self._is_witnessed(service)}.difference(absent)
        for time, event in changes:
            if event.name in witnessed and not self._is_away(event.node.rpartition("/")[2], time):
                yield f"{event.name} was taken for gone, and /{event.node} was running"
        for service, query, _ in self.pairs:
            if query is None or isinstance(service, Publication):  # subscribers are not monitored
                continue
            at = query.answered
            if at is None or self._facts.latest(at) > self._facts.run.lines[-1].time:
                continue
            since = at - self._facts.away
            is_noticed = any(
                event.name == query.service and since < time < self._facts.latest(at)
                for time, event in changes)
            is_there = query.cause not in AWAY_CAUSES or query.service in absent
            if not is_there and not is_noticed:
                yield f"{query.node}: {query.service} was gone, and that was not noticed"


def _cause(fault: Optional[str], service: Service) -> Optional[Cause]:
    """Return the cause of a call's failure, if it has a fault; the server of an action aborts a
    goal that raises."""
    if fault == EXCEPTION and isinstance(service, Action):
        return Cause.REFUSED
    return CAUSE_OF.get(fault or "")
