"""The findings of a rehearsal: one declaration for each kind, with its meaning and how it is
detected in a play."""
import itertools
from collections import Counter
from functools import lru_cache
from typing import (
    Callable, Dict, FrozenSet, Iterator, List, NamedTuple, Optional, Set, Tuple, Union)

from behavior_controller.bt import Direction, Kind, Node
from behavior_controller.bt.engine.ports import reference
from behavior_controller.config.node_facts import MissionSpec
from behavior_controller.run.events import GIVEN_UP, SKIPPED
from behavior_controller.run.state import LEFT_OUT, Exchange, LeafFailure, NodeResult, RecoveryRound
from behavior_controller.leaves import data
from behavior_controller.leaves.base import MissionLeaf
from behavior_controller.robot.declarations import Sense
from behavior_controller.robot.gateway import Cause, Failure
from behavior_controller.robot.requests import (
    Answer, GoTo, PerformGesture, Prompt, QueryKnowledge, Request, Say, SetAttention,
    SetRecognition)
from behavior_controller.text import clean, count, docstring

from behavior_controller.simulation.rehearsal.play import (
    BUSY, LoadedMission, Place, RunResult, START)
from behavior_controller.simulation.journal import JournalEntry
from behavior_controller.simulation.visitor import DECLINES, ENGAGES

LAST_SHARE = 0.2
"""A mission that sends requests in this last share of its time repeats itself; any other is
waiting."""

SHOWN_AT_THE_PLACE = {"@" + datum.name for datum in (data.GESTURE_TARGET, data.DESCRIPTION_1,
                                                     data.DESCRIPTION_2)}
"""The entries whose readers need the robot to stand at the place that it was sent to."""

ANSWER = "@" + data.VISITOR_RESPONSE.name
"""The entry with the visitor's answer."""

SEEKS_NEXT = SetAttention("scanning")
"""The request after which another visitor may be meant."""

TIME_TOLERANCE = 0.01
"""Seconds by which things may differ in time that follow one another."""

ROOT = 1
"""The uid of the root, which stands for the whole mission."""


class Finding(NamedTuple):
    """A finding in a play, and its node."""

    kind: str
    uid: int
    what: str


class RobotCall(NamedTuple):
    """A call that reached a node of the robot: the node, the number of the call there, the leaf
    that made it, the fields of the request, whether it was carried out, and what it met
    (``Situations``)."""

    node: str
    number: int
    uid: int
    fields: str
    is_done: bool
    situation: bytes = b""


class Play:
    """One visitor's pass, played, with the model of its run.

    ``faults`` is the number of injected faults and silent topics; ``calm`` is the same pass without
    them, and without the ``visitors_before``.
    """

    def __init__(self, stage: LoadedMission, played: RunResult, behaviour: str, faults: int,
                 calm: "Optional[Play]", visitors_before: int = 0):
        self.stage, self.played, self.behaviour = stage, played, behaviour
        self.faults, self.calm, self.visitors_before = faults, calm, visitors_before
        self.nodes, self.run = stage.mission.tree.nodes, played.run()
        visit = self.run.state.visit
        self.outcome = visit.outcome if visit is not None else ""  # empty: the pass did not end
        asked = [*self.run.exchanges, *self.run.state.exchanges]
        # what is asked after the end is the safe state
        self.exchanges = sorted((exchange for exchange in asked if exchange.asked <= played.ended),
                                key=lambda exchange: exchange.call)
        self.drives = [exchange for exchange in self.exchanges
                       if isinstance(exchange.request, GoTo)]
        goals = {goal(drive)[:2]: drive.uid for drive in reversed(self.drives)}
        self.stops = {place: goals[place.location[:2]] for place in stage.world.knowledge.exhibits
                      if place.location[:2] in goals}
        """The stops that the robot was sent to, each with the leaf that did it first."""
        self.places = {stop.location[:2] for stop in self.stops}
        self.leaves = [result for result in self.run.results
                       if isinstance(self.node(result.uid), MissionLeaf)]
        self.done = [result for result in self.leaves if result.letter == "S"]
        self.succeeded = frozenset(result.uid for result in self.done)
        self.looks = [result for result in self.leaves if result.letter in "SF"
                      and {Sense.VISITOR, Sense.PRESENCE} & set(self.spec(result.uid).listens)]
        """The results of the leaves that look whether a visitor is there."""
        self.answer_looks = [result for result in self.leaves
                             if ANSWER in entries(self.node(result.uid), False)]
        """The results of the leaves that look at the visitor's answer."""

    def spec(self, uid: int) -> MissionSpec:
        """Return the node type of a mission leaf."""
        spec = self.node(uid).spec
        assert isinstance(spec, MissionSpec)
        return spec

    def name(self, uid: int) -> str:
        """Return the type of a node."""
        return clean(self.node(uid).registration_id)

    def node(self, uid: int) -> Node:
        """Return a node; for 0, which is none, the root."""
        return self.nodes[(uid or ROOT) - 1]

    @property
    def late(self) -> List[Exchange]:
        """The requests of the last share of the time."""
        since = START + self.played.seconds * (1 - LAST_SHARE)
        return [exchange for exchange in self.exchanges if exchange.asked > since]

    @property
    def goodbyes(self) -> List[NodeResult]:
        """The results of the nodes that say goodbye."""
        return [result for result in self.leaves if self.says_goodbye(result.uid)]

    def says_goodbye(self, uid: int) -> bool:
        """Return whether a node is a leaf that says goodbye."""
        node = self.node(uid)
        return isinstance(node, MissionLeaf) and node.spec.says_goodbye(node.name)

    def presence(self, at: float) -> Tuple[float, bool]:
        """Return whether a visitor was present at that time, and before that, since when."""
        changes = (change for change in reversed(self.played.presence) if change[0] <= at)
        return next(changes, (START, False))

    def last_look(self, at: float) -> str:
        """Return the result (S, F) of the mission's last look for the visitor since the visitor
        left, until that time; empty: there was none."""
        since = self.presence(at)[0]
        return next((look.letter for look in reversed(self.looks) if since <= look.ended <= at), "")

    def is_visitor_here(self, at: float) -> bool:
        """Return whether a visitor was present at that time."""
        return self.presence(at)[1]

    @property
    def shown(self) -> Iterator[Tuple[NodeResult, NodeResult]]:
        """Yield how each leaf ended that has described a stop or pointed at it, and the leaf that
        chose the stop."""
        for show in self.done:
            read = entries(self.node(show.uid), False) & SHOWN_AT_THE_PLACE
            if not {Say, PerformGesture} & set(self.spec(show.uid).calls):
                continue
            choices = [result for result in self.done if result.ended <= show.began
                       and entries(self.node(result.uid), True) & read]
            if choices and self.spec(choices[-1].uid).writes(data.CURRENT_EXHIBIT.name):
                yield show, choices[-1]

    @property
    def switched(self) -> Dict[Request, int]:
        """The requests of the kinds that the safe state sends, each with its last leaf."""
        kinds = {type(request) for request in self.stage.settings.interface.safe_state}
        return {exchange.request: exchange.uid for exchange in self.exchanges
                if type(exchange.request) in kinds}

    def is_home(self, drive: Exchange) -> bool:
        """Return whether a drive leads home."""
        return goal(drive)[:2] == self.stage.world.knowledge.home.location[:2]

    def place_at(self, at: float) -> Tuple[float, ...]:
        """Return where the robot had arrived last at that time; empty: nowhere in this pass."""
        return next((goal(drive)[:2] for drive in reversed(self.drives) if isinstance(
            drive.result, Answer) and drive.answered is not None and drive.answered <= at), ())

    @property
    def has_given_up(self) -> bool:
        """Whether a recovery gave up, so that the mission knows of the failure."""
        return any(recovery.outcome == GIVEN_UP for recovery in self.run.recoveries)

    @property
    def signs(self) -> Set[int]:
        """The leaves that have seen or heard a sign of the visitor, or an answer."""
        return {result.uid for result in self.done if self.spec(result.uid).listens
                or Prompt in self.spec(result.uid).calls
                or self.spec(result.uid).needs(data.VISITOR_RESPONSE.name)}

    def has_same_answer(self, other: "Play") -> bool:
        """Return whether the visitor has given the same answer, and none by a tablet that fails:
        its refusal may stand for a no."""
        visit, usual = self.run.state.visit, other.run.state.visit
        tablets = {each.service for each in self.exchanges if isinstance(each.request, Prompt)}
        return visit is not None and usual is not None and visit.answer == usual.answer \
            and tablets.isdisjoint(self.faulty())

    def is_question(self, request: Request) -> bool:
        """Return whether the robot asks the visitor."""
        return isinstance(request, Say) and (request.text.endswith("?") or (
            request.text in self.stage.world.visitor.manners.questions))

    def writers(self, entry: data.Datum) -> List[NodeResult]:
        """Return the results of the leaves that wrote an entry."""
        return [result for result in self.done if self.spec(result.uid).writes(entry.name)]

    @property
    def stops_in_turn(self) -> List[NodeResult]:
        """The choices of stops if one leaf makes several, and the visitor is not asked meanwhile.
        """
        taken = self.writers(data.CURRENT_EXHIBIT)
        asked = [result.began for result in self.writers(data.VISITOR_RESPONSE)]
        is_repeated = len(taken) > len({result.uid for result in taken})
        return taken if is_repeated and max(asked, default=START) <= taken[0].began else []

    def faulty(self) -> FrozenSet[str]:
        """Return the services of which a call went wrong on purpose."""
        return frozenset(line.resource for line in self.played.journal if line.fault is not None)

    def unhandled(self) -> List[LeafFailure]:
        """Return the failures of leaves at those services from which there was no recovery."""
        faulty, handled = self.faulty(), {recovery.path for recovery in self.run.recoveries}
        return [failed for failed in self.run.failures if failed.failure.resource in faulty
                and not failed.attempt and failed.path not in handled]

    def caller(self, line: JournalEntry) -> int:
        """Return the leaf that made a call in the journal."""
        return next((exchange.uid for exchange in reversed(self.exchanges)
                     if exchange.service == line.resource and exchange.asked <= line.time), ROOT)

    def calls(self) -> List[RobotCall]:
        """Return the mission's calls that reached a node."""
        return [RobotCall(line.node, line.call, self.caller(line),
                          str(sorted(line.content.items())), line.done,
                          self.played.situations.get((line.node, line.call), b""))
                for line in self.played.journal if line.call and line.time <= self.played.ended]


def goal(drive: Exchange) -> Tuple[float, ...]:
    """Return where a drive leads."""
    assert isinstance(drive.request, GoTo)
    return drive.request.goal


class FindingKind(NamedTuple):
    """A kind of finding. ``detect`` yields its places in a play; ``means`` explains it to the
    author of the mission."""

    name: str
    means: str
    detect: Callable[[Play], Iterator[Place]] = lambda play: iter(())


def _kind(detect: Callable[[Play], Iterator[Place]]) -> FindingKind:
    """Return the kind that a function detects: its name is the function's, its meaning the first
    paragraph of the docstring."""
    meaning = docstring(detect).partition("\n\n")[0]
    return FindingKind(detect.__name__[1:].replace("_", "-"), " ".join(meaning.split()), detect)


# ------------------------------------------------------------------------------------------- no end


def _busy_loop(play: Play) -> Iterator[Place]:
    """The mission never waits: it takes a whole core, and nothing else of the robot gets a turn.
    Put a Sleep or a Delay into the loop."""
    if play.played.cut_off == BUSY:
        yield _waiting(play), "it is ticked again and again and waits for nothing"


def _retries_for_ever(play: Play) -> Iterator[Place]:
    """A service fails for good, and the mission repeats the request without a limit. Give the loop
    a number of attempts, and each attempt a pause."""
    if not play.played.has_timed_out or play.calm is None or not play.calm.outcome:
        return
    failed = [exchange for exchange in play.late if isinstance(exchange.result, Failure)]
    if failed:
        uid = failed[-1].uid
        number = sum(exchange.uid == uid for exchange in play.exchanges)
        requests = count(number, "request")
        yield uid, f"after {requests} in {play.played.seconds:.0f} s it still tries again"


def _endless(play: Play) -> Iterator[Place]:
    """A loop without a bound repeats the same requests."""
    if play.played.has_timed_out and play.late and not any(_retries_for_ever(play)):
        yield play.late[-1].uid, f"after {play.played.seconds:.0f} s it still repeats itself"


def _waits_for_ever(play: Play) -> Iterator[Place]:
    """The robot waits without a limit for something that does not come."""
    if play.played.has_timed_out and not play.late and not waits_for_a_visitor(play):
        yield _waiting(play), f"after {play.played.seconds:.0f} s it still waits here"


def waits_for_a_visitor(play: Play) -> bool:
    """Return whether no visitor has been seen to the end: a robot may wait for a visitor without a
    limit."""
    if not play.played.has_timed_out or play.late:
        return False
    seekers = [result for result in play.leaves if Sense.VISITOR in play.spec(result.uid).listens]
    if any(result.letter == "S" for result in seekers):
        return False
    specs = [play.nodes[uid - 1].spec for uid in play.played.waiting]
    return bool(seekers) or any(isinstance(spec, MissionSpec) and Sense.VISITOR in spec.listens
                                for spec in specs)


def _waiting(play: Play) -> int:
    return [ROOT, *play.played.waiting][-1]


# ---------------------------------------------------------------------------------- what goes wrong


def _exception(play: Play) -> Iterator[Place]:
    """A node raises an exception, or a declaration does not fit its messages."""
    yield from play.played.errors
    topics = {topic.name for topic in play.stage.settings.interface.topics}
    for failed in play.run.failures:
        # no fault does this, and no visitor who is not understood: what a package declares does not
        # fit its messages
        cause, resource = failed.failure.cause, failed.failure.resource
        is_answer = cause is Cause.UNUSABLE_ANSWER and resource not in topics
        if cause is Cause.TYPE_MISMATCH or is_answer and not play.faults:
            yield failed.uid, failed.failure.message


def _missing_data(play: Play) -> Iterator[Place]:
    """A node reads an entry or an answer that is not there."""
    for failed in play.run.failures:
        # pressing nothing is the visitor's answer, and a substitute is the policy's
        is_missing = failed.failure.cause is Cause.MISSING_DATA and not failed.attempt
        if is_missing and failed.uid and not (
                play.spec(failed.uid).is_recovery or Prompt in play.spec(failed.uid).calls):
            yield failed.uid, failed.failure.message
    for recovery in play.run.recoveries:
        if recovery.is_idle and recovery.recovered is not None:
            yield recovery.uid, recovery.recovered.failure.message


def _senseless_request(play: Play) -> Iterator[Place]:
    """A node of the robot is asked for something that it does not know."""
    for line in play.played.journal:
        if line.objection is not None:
            yield play.caller(line), f"{line.resource} refuses it: {line.objection}"


def _shares_a_body(play: Play) -> Iterator[Place]:
    """Two branches use one service of the robot at the same time. Let one wait for the other.

    Find a request that is made while another leaf's to the same service is under way.
    """
    under_way: Dict[str, Exchange] = {}
    for exchange in play.exchanges:
        if not exchange.uid or play.node(exchange.uid).spec.is_recovery:
            continue  # a recovery's safe state
        before = under_way.get(exchange.service)
        if before is None or (before.answered or 0.0) <= exchange.asked:
            under_way[exchange.service] = exchange
        elif before.uid != exchange.uid and not isinstance(exchange.request, QueryKnowledge):
            yield exchange.uid, (f"{exchange.service} is asked while it still carries out the "
                                 f"request of {play.name(before.uid)}")


def _cut_short(play: Play) -> Iterator[Place]:
    """Speech or a gesture is halted before it is over, and the robot goes on speaking or moving.
    Give a Timeout more time than the robot needs.

    Find speech and gestures that are halted before they are over, with the visitor still there.
    """
    took = {step.call: step.ended - step.began
            for step in play.run.steps if step.ended is not None and not play.faults}
    for exchange in play.run.exchanges:
        is_cut = exchange.result is None and isinstance(exchange.request, (Say, PerformGesture))
        if is_cut and exchange.call in took and play.is_visitor_here(exchange.asked):
            seconds = took[exchange.call]
            yield exchange.uid, f"it is halted after {seconds:.1f} s, before the robot is done"


def _abandoned_drive(play: Play) -> Iterator[Place]:
    """The mission stops waiting for a drive, and the robot drives on.

    Find a drive that was halted and not followed by another, or by one to another place although
    nothing was wrong and the visitor is still there.
    """
    for drive, after in zip(play.drives, [*play.drives[1:], None]):
        is_excused = after is not None and (
            play.faults or goal(after) == goal(drive) or not play.is_visitor_here(drive.asked))
        if drive.result is None and drive in play.run.exchanges and not is_excused:
            yield drive.uid, "it is halted while the robot drives, which no service can stop"


# ------------------------------------------------------------------------------ failures, swallowed


@lru_cache(maxsize=None)
def entries(node: Node, is_written: bool) -> FrozenSet[str]:
    """Return the entries that a node writes, or those that it reads; an entry of a SubTree with the
    path of that SubTree."""
    other = Direction.IN if is_written else Direction.OUT
    names = (reference(node.attributes.get(port.name, ""), port.name)
             for port in node.spec.ports if port.direction is not other)
    tree = node.full_path.rpartition("/")[0]
    return frozenset(name if name.startswith("@") else f"{tree}/{name}" for name in names if name)


def _swallowed_failure(play: Play) -> Iterator[Place]:
    """A step fails, the mission ignores that, and a later step goes on as if it had been done.

    Find a request that builds on a step whose failure nothing has dealt with: it uses what an
    earlier step has left on the blackboard, or shows what the robot has not driven to.
    """
    failed: Dict[str, NodeResult] = {}  # by entry: the failure of its last writer
    # of what happens at one time, results come first, then recoveries, then requests
    steps: List[Tuple[float, Union[NodeResult, RecoveryRound, Exchange]]] = sorted([
        *((result.ended, result) for result in play.leaves if result.letter in "SF"),
        *((recovery.ended or 0.0, recovery) for recovery in play.run.recoveries),
        *((exchange.asked, exchange) for exchange in play.exchanges if exchange.uid)],
        key=lambda step: step[0])
    last_drive: Optional[Exchange] = None
    for _, step in steps:
        if isinstance(step, NodeResult):
            _note_result(play, step, failed)
        elif isinstance(step, Exchange):
            node = play.node(step.uid)
            if not isinstance(node, MissionLeaf) or node.spec.is_recovery:
                continue
            read = entries(node, False)
            for entry in sorted(read & set(failed)):
                old = entry.rpartition("/")[2].lstrip("@")
                yield failed[entry].uid, f"it fails, and {play.name(step.uid)} uses the old {old}"
            if isinstance(step.request, GoTo):
                last_drive = step
            elif isinstance(step.request, (Say, PerformGesture)) and read & SHOWN_AT_THE_PLACE \
                    and last_drive is not None and isinstance(last_drive.result, Failure):
                yield last_drive.uid, (f"the drive fails, and {play.name(step.uid)} goes on as if "
                                       "the robot were there")
        elif step.has_helped:
            failed = {entry: result for entry, result in failed.items()
                      if play.node(result.uid).full_path != step.path}


def _note_result(play: Play, result: NodeResult, failed: Dict[str, NodeResult]) -> None:
    """Note for each entry that a leaf writes whether its last writer has failed to replace it."""
    node = play.node(result.uid)
    if Prompt in play.spec(result.uid).calls or node.spec.kind is Kind.CONDITION:
        return
    for entry in entries(node, True):
        if result.letter == "F" and not entries(node, False) & {entry}:
            failed[entry] = result
        else:
            failed.pop(entry, None)


def _unrecovered(play: Play) -> Iterator[Place]:
    """A service that fails ends the pass, because no HandleFallBack stands beside the node."""
    if play.outcome != "FAILURE" or play.calm is None or play.calm.outcome != "SUCCESS":
        return
    if len(play.faulty()) == 1 and not play.has_given_up:
        for failed in play.unhandled()[:1]:
            yield failed.uid, "its failure ends the pass, and no recovery handles it"


def _left_out_step(play: Play) -> Iterator[Place]:
    """One step fails, and the mission succeeds without other steps, and without another way. Give
    each step a recovery of its own.

    Find requests of the calm play that are missing, although the visitor behaves the same and no
    stop was left out. What else a service does that fails for good says nothing.
    """
    calm = play.calm
    if calm is None or play.visitors_before or (play.outcome, calm.outcome) != 2 * ("SUCCESS",) \
            or play.has_given_up or not play.has_same_answer(calm) or play.signs != calm.signs \
            or any(stop.state == LEFT_OUT for stop in play.run.stops):
        return
    faulty = play.faulty()
    failed = {each.uid for each in play.run.failures if each.failure.resource in faulty}
    made, usual = (Counter(exchange.uid for exchange in each.exchanges) for each in (play, calm))
    is_other_way = any(uid not in usual and not play.node(uid).spec.is_recovery for uid in made)
    if not failed or len(faulty) != 1 or is_other_way:
        return
    for exchange in calm.exchanges:
        # how often the visitor is asked depends on what the visitor says
        may_be_missing = exchange.service in faulty and play.faults > 1 or play.is_question(
            exchange.request) or isinstance(exchange.request, (Prompt, SetRecognition))
        # the first of two requests of a leaf has no step of its own
        if exchange.uid and made[exchange.uid] < usual[exchange.uid] and not may_be_missing \
                and exchange.uid not in failed:
            nearest = max(failed, key=lambda uid: (uid < exchange.uid, uid))
            yield nearest, f"its failure leaves out {play.name(exchange.uid)}"
            return


def _budget_spent(play: Play) -> Iterator[Place]:
    """Recoveries use up the budget of the policy although hardly a call fails. Later failures
    are given up at once.

    Most of the budget was spent on failures that no fault caused.
    """
    policy, faulty = play.stage.mission.policy, play.faulty()
    rounds = sorted((recovery for recovery in play.run.recoveries if recovery.recovered),
                    key=lambda recovery: recovery.decided)
    own = sum(recovery.recovered.failure.resource not in faulty
              for recovery in rounds if recovery.recovered)
    for late, early in zip(rounds[policy.most:], rounds):
        if late.decided - early.decided < policy.seconds and 2 * own > policy.most:
            yield late.uid, (f"more than {policy.most} recoveries in {policy.seconds:g} s: "
                             "whatever fails from here on is given up")
            return


def _next_visitor(play: Play) -> Iterator[Place]:
    """A visitor is treated otherwise because of the one before. A node that acts once, an entry or
    a counter is left from that pass. Have each pass begin with START_OF_TREE and set its entries
    itself.

    Find the first request that the same visitor brings about without one before, and not now, or
    now alone.
    """
    calm = play.calm
    if not play.visitors_before or play.faults or calm is None or not calm.outcome:
        return
    if not calm.signs and any(calm.spec(result.uid).listens for result in calm.leaves):
        return  # whether a visitor is seen is a matter of milliseconds
    changes, this = list(_changes(calm, play)), f"visitor {play.visitors_before + 1}"
    if changes:
        _, alone, later = min(changes, key=lambda change: change[0])
        said = [f"the robot is {each.words} for {visitor}"
                for each, visitor in ((alone, "the first visitor"), (later, this)) if each]
        uid = next(each.uid for each in (alone, later) if each)
        yield uid, ", ".join(said) + " alone" * (len(said) == 1)
    elif play.outcome != calm.outcome:
        yield ROOT, f"the pass of {this} ends otherwise: {play.outcome or 'never'}"


def _above(node: Node) -> Iterator[Node]:
    """Yield the nodes above ``node``, the root the last."""
    while node.parent is not None:
        node = node.parent
        yield node


def _may_take_turns(play: Play, uid: int) -> bool:
    """Return whether a node of another package stands above a leaf: what it does in each pass is
    that package's purpose."""
    return any(node.is_foreign for node in _above(play.node(uid)))


Change = Tuple[int, Optional[Exchange], Optional[Exchange]]
"""Where in a pass a request differs, and the request in both passes, if there is one."""


def _changes(calm: Play, play: Play) -> Iterator[Change]:
    """Yield the first difference at each service; the order between services may depend on who is
    faster."""
    both = [[exchange for exchange in each.exchanges if not _may_take_turns(each, exchange.uid)]
            for each in (calm, play)]
    for service in dict.fromkeys(exchange.service for each in both for exchange in each):
        made = ([(place, exchange) for place, exchange in enumerate(each)
                 if exchange.service == service] for each in both)
        for alone, later in itertools.zip_longest(*made):
            if alone is None or later is None or alone[1].request != later[1].request:
                yield (alone or later)[0], (alone or (0, None))[1], (later or (0, None))[1]
                break


# ---------------------------------------------------------------------------------------- the stops


def _unwanted_drive(play: Play) -> Iterator[Place]:
    """The robot drives to a stop although the visitor says no, or has left and the mission has seen
    that."""
    if play.faults:
        return
    visit = play.run.state.visit
    if play.behaviour == DECLINES and visit is not None and visit.asked is not None and play.stops:
        yield next(iter(play.stops.values())), "the visitor says no, and the robot drives to a stop"
    for exchange in play.drives:
        since, is_here = play.presence(exchange.asked)
        is_stop = goal(exchange)[:2] in play.places and not play.is_home(exchange)
        if is_stop and not is_here and play.last_look(exchange.asked) == "F":
            yield exchange.uid, (f"the visitor had left {exchange.asked - since:.0f} s before, and "
                                 "the robot drives to a further stop")


def _left_out(play: Play) -> Iterator[Place]:
    """The pass succeeds, and a stop is left out without a failure that explains it.

    A mission that does not take one stop after the other may be meant to show only some; so may
    one that asks the visitor meanwhile.
    """
    if play.outcome != "SUCCESS" or play.behaviour != ENGAGES or not play.stops:
        return
    if any(recovery.outcome in (SKIPPED, GIVEN_UP) for recovery in play.run.recoveries):
        return
    taken = play.stops_in_turn
    stops = ", ".join(clean(place.name) for place in play.stage.world.knowledge.exhibits
                      if place not in play.stops)
    if taken and stops:
        yield taken[-1].uid, f"the visitor says yes, and the robot does not drive to {stops}"


def _drives_twice(play: Play) -> Iterator[Place]:
    """The robot is sent to the place where it stands."""
    for before, drive in zip(play.drives, play.drives[1:]):
        is_there = isinstance(before.result, Answer) and (before.answered or 0.0) < drive.asked
        if is_there and not play.faults and goal(drive) == goal(before):
            yield drive.uid, "the robot has just arrived there"


def _not_shown(play: Play) -> Iterator[Place]:
    """A stop is chosen, and the visitor is neither told of it nor pointed at it at its place, or
    a node outside the loop of the stops shows only the last one.

    A mission that describes no stop and points at none may be meant to drive only.
    """
    if play.faults or play.behaviour != ENGAGES or not any(map(shows, play.nodes)):
        return
    yield from _shown_after_the_loop(play)
    taken = play.writers(data.CURRENT_EXHIBIT)
    ends = [*(choice.began for choice in taken[1:]), play.played.ended if play.outcome else START]
    for choice, until in zip(taken, ends):
        since = next((drive.asked for drive in play.drives if goal(drive)[:2] in play.places
                      and choice.ended <= drive.asked < until), choice.ended)
        if until > since and not any(since <= exchange.asked < until and isinstance(
                exchange.request, (Say, PerformGesture)) for exchange in play.exchanges):
            yield choice.uid, "the stop is chosen, and the visitor hears and sees nothing of it"
            return


def _shown_after_the_loop(play: Play) -> Iterator[Place]:
    """Find what shows a stop and stands outside the loop that takes one stop after the other."""
    taken = play.stops_in_turn
    if not taken or not play.outcome:
        return
    for show, chosen in play.shown:
        loops = [node for node in _above(play.node(chosen.uid)) if node.spec.repeats_on]
        if loops and play.node(show.uid) not in loops[-1].iterate():
            yield show.uid, f"of {len(taken)} stops it shows only the last one"


def shows(node: Node) -> bool:
    """Return whether a node tells of a stop, or points at it."""
    return isinstance(node, MissionLeaf) and bool(entries(node, False) & SHOWN_AT_THE_PLACE) \
        and not {Say, PerformGesture}.isdisjoint(node.spec.calls)


def _shown_away(play: Play) -> Iterator[Place]:
    """A stop is described or pointed at while the robot is still driving, before it drives there,
    or, after a failure, at another place than without it.
    """
    yield from _shown_elsewhere(play)
    if play.faults or play.behaviour != ENGAGES:
        return
    taken = play.writers(data.CURRENT_EXHIBIT)
    by_stop: Dict[int, List[NodeResult]] = {}
    for show, chosen in play.shown:
        by_stop.setdefault(taken.index(chosen), []).append(show)
        if any(drive.asked + TIME_TOLERANCE < show.ended and drive.answered is not None
               and show.began < drive.answered - TIME_TOLERANCE for drive in play.drives):
            yield show.uid, "the robot drives meanwhile"
    for number, shows in by_stop.items():
        until = next((result.began for result in taken[number + 1:]), play.played.ended)
        drives = [drive for drive in play.drives if taken[number].ended <= drive.asked < until
                  and goal(drive)[:2] in play.places and not play.is_home(drive)]
        if drives and shows[-1].ended <= drives[0].asked:
            yield shows[0].uid, "the robot drives there only after it"


def _shown_elsewhere(play: Play) -> Iterator[Place]:
    """Find, in a play with a fault, what is shown at another place than in the calm one."""
    if not play.faults or play.calm is None:
        return
    usual = {(each.uid, each.request): play.calm.place_at(each.asked)
             for each in play.calm.exchanges if shows(play.node(each.uid))}
    for each in play.exchanges:
        where = play.place_at(each.asked)
        if usual.get((each.uid, each.request), where) != where:
            yield each.uid, "the robot is not where it shows this without a failure"


def _answer_mixed_up(play: Play) -> Iterator[Place]:
    """The visitor's answer to one question is taken for that to another, or is lost.

    Find a question to which nothing listens, and an answer that is used after another question,
    or that is replaced unused.
    """
    if play.faults:
        return
    asked = [exchange for exchange in play.exchanges if play.is_question(exchange.request)]
    heard = [result.ended for result in play.leaves
             if play.spec(result.uid).writes(data.VISITOR_RESPONSE.name)
             or Sense.UTTERANCE in play.spec(result.uid).listens]
    prompted = [exchange.asked for exchange in play.exchanges
                if isinstance(exchange.request, Prompt)]
    heard_at = max(heard + prompted, default=START)
    for question in asked:
        node = play.node(question.uid)
        if play.outcome and question.asked > heard_at and isinstance(node, MissionLeaf) \
                and node.spec.writes(data.QUESTION_ASKED_AT.name):
            yield question.uid, "nothing listens to the answer"
    # what scripts do with answers is not known
    if not any(ANSWER in text and text != "{" + ANSWER + "}" for node in play.nodes
               for text in node.attributes.values()):
        yield from _wrong_answer(play, [question.asked for question in asked])


def _wrong_answer(play: Play, asked: List[float]) -> Iterator[Place]:
    """Find a leaf that reads the answer to an earlier question, or that replaces one unread."""
    looks = play.answer_looks
    if asked and looks and play.outcome and looks[-1].ended < asked[0] - TIME_TOLERANCE:
        yield looks[-1].uid, "it looks at the answer before the first question is asked"
    source = ""  # the type of the leaf that wrote the answer
    unread = ""  # the same, until a leaf has looked at the answer
    listened = START
    for result in play.leaves:
        node = play.node(result.uid)
        if source and ANSWER in entries(node, False):
            unread = ""
            # what an answer brings about at once is noted before it
            if any(listened - TIME_TOLERANCE < at < result.began - TIME_TOLERANCE for at in asked):
                yield result.uid, (f"it looks at the answer of {source} although another question "
                                   "was asked since")
        if ANSWER in entries(node, True):
            listened = result.ended
            if result.letter == "S":
                if unread:
                    what = f"it replaces the answer of {unread}, which nothing has looked at"
                    yield result.uid, what
                source = unread = play.name(result.uid)


# ------------------------------------------------------------------------------------------ the end


def _goodbye_to_nobody(play: Play) -> Iterator[Place]:
    """The robot says goodbye although the visitor has left."""
    for result in play.goodbyes:
        since, is_here = play.presence(result.began)
        if result.letter == "S" and not is_here:
            yield result.uid, f"the visitor had left {result.began - since:.0f} s before"


def _speech_to_nobody(play: Play) -> Iterator[Place]:
    """The robot speaks although it has driven home from the visitor, or has seen that the visitor
    has left.

    A robot may call for a visitor whom it does not see: what counts is what it says after its last
    look.
    """
    for exchange in play.exchanges:
        since, is_here = play.presence(exchange.asked)
        node = play.node(exchange.uid)
        if not isinstance(exchange.request, Say) or is_here or since == START \
                or not isinstance(node, MissionLeaf) or node.spec.says_goodbye(node.name) \
                or any(look.began > exchange.asked for look in play.looks):
            continue
        is_back = any(play.is_home(drive) and abs(drive.asked - since) < TIME_TOLERANCE
                      for drive in play.drives)
        if play.last_look(exchange.asked) == "F" or is_back:
            yield exchange.uid, f"the visitor had left {exchange.asked - since:.0f} s before"


def _said_twice(play: Play) -> Iterator[Place]:
    """The same visitor is told the same at the same place by two nodes, or the same description
    again.
    """
    if play.faults:
        return
    said: Dict[Request, int] = {}
    for exchange in play.exchanges:
        request, node = exchange.request, play.node(exchange.uid)
        if isinstance(request, GoTo) or request == SEEKS_NEXT:
            said.clear()
        elif isinstance(request, Say) and not play.is_question(request) \
                and isinstance(node, MissionLeaf) and not play.says_goodbye(exchange.uid):
            if request in said and (said[request] != exchange.uid or shows(node)):
                yield exchange.uid, "the visitor has just heard the same"
            said[request] = exchange.uid


def _asked_again(play: Play) -> Iterator[Place]:
    """The visitor has answered, and is asked the same question once more.

    After a look at the answer it is another question in the same words.
    """
    # what follows a look at once is asked before the tick ends
    looks = [result.ended - TIME_TOLERANCE for result in play.answer_looks]
    steps = [exchange for exchange in play.exchanges if isinstance(exchange.request, (Say, GoTo))
             or exchange.request == SEEKS_NEXT]
    for before, after in zip(steps, steps[1:]):
        if before.request == after.request and play.is_question(after.request) \
                and not any(before.asked < look <= after.asked for look in looks):
            earlier, visit = play.run.at(before.asked).visit, play.run.at(after.asked).visit
            if earlier and visit and visit.answer and not earlier.answer:
                yield after.uid, "the answer has just been heard"


def _drives_switched_on(play: Play) -> Iterator[Place]:
    """The robot drives with attention or lifelike movement on. Switch both off before each drive.

    A request to switch it off counts even if it was refused. A mission that looks for no visitor is
    led by a person, who minds the robot.
    """
    is_led = not any(isinstance(node.spec, MissionSpec) and node.spec.listens
                     for node in play.nodes)
    for drive in play.drives if not (play.faults or is_led) else ():
        for safe in play.stage.settings.interface.safe_state:
            before = [exchange.request for exchange in play.exchanges
                      if type(exchange.request) is type(safe) and exchange.asked < drive.asked]
            if before and before[-1] != safe:
                yield drive.uid, f"{safe.switches} is on"


def _early_goodbye(play: Play) -> Iterator[Place]:
    """The robot says goodbye, and then goes on with the same visitor.

    That is, the same visitor is shown another stop, or hears the same words of goodbye again.
    """
    if play.faults:
        return
    said: Dict[Request, Exchange] = {}
    for exchange in play.exchanges:
        if exchange.request == SEEKS_NEXT:  # for the next visitor
            said.clear()
        is_bye = isinstance(exchange.request, Say) and play.says_goodbye(exchange.uid)
        if is_bye and play.is_visitor_here(exchange.asked):
            if exchange.request in said:
                yield exchange.uid, "the same visitor hears it again"
            said[exchange.request] = exchange
    for bye in said.values():
        for show, chosen in play.shown:
            if bye.asked < chosen.began and play.is_visitor_here(show.began):
                yield bye.uid, f"{play.name(show.uid)} goes on after it"


def _no_goodbye(play: Play) -> Iterator[Place]:
    """A visitor who has followed the robot is told no goodbye.

    That is, after several stops, or since another step failed that no recovery has handled.
    """
    is_said = any(result.letter == "S" for result in play.goodbyes)
    if not play.outcome or is_said or play.behaviour != ENGAGES:
        return
    if not play.faults and len(play.stops) > 1:
        yield play.drives[-1].uid, "the last drive ends here, and the visitor is told no goodbye"
    if play.calm is None or not play.faults:
        return
    tried = {result.uid for result in play.goodbyes}
    omitted = [result.uid for result in play.calm.goodbyes if result.uid not in tried]
    failed = play.unhandled() if play.faults == 1 else []
    if not failed and play.outcome == "SUCCESS" and play.has_same_answer(play.calm):
        faulty, goodbye = play.faulty(), set(omitted[:1])
        if not any(each.service in faulty and each.uid in goodbye for each in play.calm.exchanges):
            failed = [each for each in play.run.failures if each.failure.resource in faulty]
    for failure in failed[:1] if omitted else ():
        yield failure.uid, f"its failure leaves out the goodbye of {play.name(omitted[0])}"


def _left_on(play: Play) -> Iterator[Place]:
    """Attention or lifelike movement is on after the drives of a pass.

    A request to switch it off counts even if it was refused.
    """
    if not play.outcome or not play.drives:
        return
    for safe in play.stage.settings.interface.safe_state:
        asked = [exchange for exchange in play.exchanges if type(exchange.request) is type(safe)]
        words = asked[-1].request.words if asked and asked[-1].request != safe else None
        if words is not None:
            last = f"{words.doing} {words.what}".strip()
            yield asked[-1].uid, f"{safe.switches} is left on: the last request is {last}"


def _not_home(play: Play) -> Iterator[Place]:
    """The last drive of a pass does not lead home.

    It may end elsewhere if the way home cannot be looked up, or if a recovery gives up for a
    service: the robot is then in the safe state, and the operator is told what to repair.
    """
    if not play.outcome or not play.drives or play.is_home(play.drives[-1]):
        return
    last = play.drives[-1]
    is_unknown = any(exchange.request == QueryKnowledge("home") and exchange.asked > last.asked
                     and not isinstance(exchange.result, Answer) for exchange in play.exchanges)
    is_reported = any(
        recovery.recovered is not None and recovery.outcome == GIVEN_UP and not recovery.is_idle
        and recovery.recovered.failure.cause is not Cause.CONDITION_FALSE
        for recovery in play.run.recoveries if recovery.decided > last.asked)
    if not (is_unknown or is_reported):
        yield last.uid, "the last drive leads to {:g}, {:g} and not home".format(*goal(last)[:2])


NEVER_SUCCEEDS = FindingKind("never-succeeds",
                             "No visitor's pass ends in SUCCESS, not even without a fault.")
NEVER_ASKED = FindingKind(
    "never-asked", "Without a fault no visitor brings the mission to a node of this type, which no "
    "policy may skip.")
NEVER_TRUE = FindingKind(
    "never-true", "The mission comes to this node, and no visitor and no fault makes it succeed.")
ONE_WAY = FindingKind("one-way-only", "A stop is reached by voice alone, or by tablet alone.")
NEVER_OFF = FindingKind(
    "never-off", "Attention or lifelike movement is switched on, and no pass switches it off.")
UNREACHED = FindingKind("unreached", "No play brings the mission to this node.")

FINDING_KINDS = (
    *map(_kind, (
        _busy_loop, _exception, _next_visitor, _missing_data, _senseless_request, _endless,
        _retries_for_ever, _waits_for_ever, _swallowed_failure, _unrecovered,
        _left_out_step, _shares_a_body, _cut_short, _abandoned_drive, _shown_away, _not_shown,
        _said_twice, _asked_again, _speech_to_nobody, _answer_mixed_up, _early_goodbye)),
    NEVER_TRUE, NEVER_SUCCEEDS, NEVER_ASKED, ONE_WAY,
    *map(_kind, (
        _drives_switched_on, _budget_spent, _unwanted_drive, _left_out, _drives_twice,
        _goodbye_to_nobody, _no_goodbye, _left_on, _not_home)),
    NEVER_OFF, UNREACHED)
"""All kinds; a kind that follows from others stands after them."""

KIND_BY_NAME: Dict[str, FindingKind] = {kind.name: kind for kind in FINDING_KINDS}

CAUSING_KINDS = list(KIND_BY_NAME)[:FINDING_KINDS.index(NEVER_SUCCEEDS) + 1]
"""The names of kinds that may have others as consequences."""


def findings(play: Play) -> List[Finding]:
    """Return the findings of a play."""
    return list(dict.fromkeys(Finding(name, uid or ROOT, clean(what))
                              for name, kind in KIND_BY_NAME.items()
                              for uid, what in kind.detect(play)))
