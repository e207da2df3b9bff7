"""The fold of a run: the only place that interprets events.

``fold`` takes what was so, and an event with its time, and returns what is so now. It looks at no
clock, so a record gives the same model as the run itself. Whoever shows, judges or replays a run
reads a ``State``, or a ``history.Run``, which has all of them.
"""
from typing import Any, Callable, Dict, Iterable, List, Optional, Tuple, TypeVar, Union

from msgspec.structs import asdict, replace

from behavior_controller.run.events import (
    BEGUN, DONE, EVENTS, GIVEN_UP, OMITTED, SKIPPED, Answered, Asked, BreakpointChanged, Checked,
    EntriesWritten, Event, FeedbackReceived, HealthChanged, HookEnded, LeafFinished, Lost, Message,
    Noticed, PassFinished, PassStarted, Paused, Recovered, Recovering, Retried, RunFinished,
    RunStarted, SafeStateReported, SignOfLife, Starting, StepStarted, RecognitionPending,
    StopChanged, Suspended, Tick, TopicSaid, TreeShown, TreeStatuses)
from behavior_controller.run.health import GONE
from behavior_controller.run.state import (
    BROKEN_OFF, DECLINED, DONE_ALL, FAILED, GAVE_UP, LEFT_OUT, NOT_TICKED, NOTICED, COMPLETED,
    SILENT_VISITOR, STOPPED, UNCLEAR, UNDER_WAY, Course, Exchange, Fact, LeafFailure,
    NodeResult, Reason, RecoveryRound, Robot, Stop, State, Step, Visit, letter_after)
from behavior_controller.robot.gateway import UNCERTAIN, UNSENT, Failure
from behavior_controller.robot.requests import (
    GoTo, Prompt, Say, SetAnimation, SetAttention, SetPose, Words)
from behavior_controller.text import clean, joined

KEPT_VISITS = 50
"""Number of the newest visits in a ``State``."""

Item = TypeVar("Item")

_SWITCHES: Dict[Any, str] = {SetAttention: "attention", SetAnimation: "animation"}
"""The requests that switch a part of the robot, and what of ``Robot`` has the last one."""


def fold(state: State, at: float, event: Event) -> State:
    """Return what is so after ``event``, which happened ``at`` that time."""
    return _HANDLERS[type(event)](replace(state, at=at, facts=()), event)


def _change_visit(state: State, **changes: Any) -> State:
    if not state.visits:
        return state
    return replace(state, visits=state.visits[:-1] + (replace(state.visits[-1], **changes),))


def _change_course(state: State, **changes: Any) -> State:
    return replace(state, course=replace(state.course, **changes))


def _change_robot(state: State, **changes: Any) -> State:
    return replace(state, robot=replace(state.robot, **changes))


def _first(items: Iterable[Item], fits: Callable[[Item], bool]) -> Optional[Item]:
    return next(filter(fits, items), None)


def _without(items: Iterable[Item], item: Item) -> Tuple[Item, ...]:
    return tuple(other for other in items if other is not item)


def _conclude(state: State, *facts: Fact) -> State:
    return replace(state, facts=state.facts + facts)


# ----------------------------------------------------------------------------------- run and visits


def _tree_shown(state: State, event: TreeShown) -> State:
    return replace(state, tree=event, letters=NOT_TICKED * len(event.nodes), running={}, held={},
                   results={}, entries={}, values={})


def _starting(state: State, event: Starting) -> State:
    return replace(state, starting=clean(event.what))


def _checked(state: State, event: Checked) -> State:
    return replace(state, checks={**state.checks, event.name: event})


def _topic_said(state: State, event: TopicSaid) -> State:
    return replace(state, said={**state.said, event.topic: event})


def _sign_of_life(state: State, event: SignOfLife) -> State:
    return replace(state, alive=state.at, heard=event.heard)


def _run_started(state: State, event: RunStarted) -> State:
    """Begin anew but for the visits: the mission may be replaced while the node runs."""
    state = _abandon(_end_steps(state))
    return replace(state, started=event, starting="", uids={}, recoveries=(), failures={},
                   recovered=None)


def _run_finished(state: State, event: RunFinished) -> State:
    visit = state.visit
    if visit is not None and not visit.outcome:
        why, visit = Reason(STOPPED), visit.until(state.at)
        if event.exit_code is None:
            why = Reason(NOTICED, text=event.outcome)
        state = _end_visit(_end_stop(state, why), "", why, visit.seconds, visit.waited)
    return replace(_abandon(_end_steps(state)), finished=event, held={})


def _end_visit(state: State, outcome: str, why: Reason, seconds: float, waited: float) -> State:
    state = _change_visit(state, outcome=outcome, why=why, seconds=seconds, waited=waited,
                          ended=state.at)
    result, counts = state.visits[-1].result, state.visit_results
    if not state.visits[-1].is_empty:
        state = replace(state, visit_results={**counts, result: counts.get(result, 0) + 1})
    return _conclude(_end_steps(state), state.visits[-1])


def _pass_started(state: State, event: PassStarted) -> State:
    state = _abandon(_end_steps(state))
    visits = (state.visits + (Visit(event.number, state.at),))[-KEPT_VISITS:]
    return replace(state, visits=visits, visit_count=event.number, recoveries=(), running={},
                   held={}, course=Course(pass_began=event.at, met=event.at),
                   letters=NOT_TICKED * len(state.letters))


def _pass_finished(state: State, event: PassFinished) -> State:
    if state.visit is None:  # the record of this run has lost its beginning
        return state
    is_success = event.outcome == "SUCCESS"
    if is_success:
        state = _end_stop(state, state.why_broken_off)
        why = _why_done(state)
    else:
        why = _why_failed(state)
        state = _end_stop(state, why)
    waited, robot = max(0.0, state.course.met - state.course.pass_began), state.robot
    is_where_sent = robot.place is not None and robot.last_place == robot.goal_name
    is_lost = robot.is_away and (robot.is_lost or not (is_success and is_where_sent))
    return _end_visit(_change_robot(state, is_lost=is_lost), clean(event.outcome), why,
                      event.seconds - waited, waited)


def _why_done(state: State) -> Reason:
    visit, course = state.visits[-1], state.course
    if course.left_by is not None and visit.stops and visit.stops[-1].state == BROKEN_OFF:
        return _why_failed(state)
    if visit.stops or visit.answer in ("yes", "helped"):
        return Reason(DONE_ALL)
    if visit.answer == "no":
        return Reason(DECLINED)
    if course.is_unclear:
        return Reason(UNCLEAR)
    if visit.asked is None and not course.is_unanswered:  # it has no question
        return Reason(DONE_ALL)
    return Reason(SILENT_VISITOR, failure=course.unasked,
                  blind=next(reversed(course.unmet.values()), None))


def _why_failed(state: State) -> Reason:
    course = state.course
    if course.left_by is not None:
        return state.why_left
    if course.given_up is not None and course.gave_up is not None:
        return replace(course.gave_up, kind=GAVE_UP)
    return _as_seen(state, course.failed[1] or Reason(FAILED))


def _as_seen(state: State, reason: Reason) -> Reason:
    """Return the reason, with what kept the robot from seeing better."""
    failure = reason.failure
    if failure is None or not failure.is_false_condition:
        return reason
    return replace(reason, blind=state.course.unmet.get(failure.resource))


def why_recovered(state: State, event: Recovered) -> Reason:
    """Return from what a recovery was needed, and why the policy's rule was not followed."""
    return _as_seen(state, Reason(FAILED, event.node, event.failure, event.attempts + 1,
                                  event.reason, without=state.course.without))


# -------------------------------------------------------------------------------------------- steps


def _step_started(state: State, event: StepStarted) -> State:
    recovery = _first(state.recoveries, lambda recovery: recovery.path == event.path or
                      event.is_wait and recovery.uid == event.uid)
    step = Step(clean(event.words), state.at, event.limit, event.uid, event.is_wait, event.path,
                clean(event.what))
    if recovery is not None:
        step = replace(step, attempt=recovery.attempt + 1, attempts=recovery.attempts + 1)
    state = _note_uid(state, event.path, event.uid)
    same = _first(state.steps, lambda step: step.uid == event.uid and event.goes_on)
    if same is None:
        return _begin_step(state, step)
    answered, longer = state.course.answered, state.at - same.began + event.limit
    if answered is not None and answered.call == same.call:
        state = replace(state, robot=_left_open(state.robot, answered))
    return replace(state, steps=tuple(
        replace(step, limit=longer) if step is same else step for step in state.steps))


def _begin_step(state: State, step: Step) -> State:
    """Start a step; this ends a wait."""
    if not step.is_wait:
        state = _change_course(state, stuck=None)
    state = _end_steps(state, lambda other: other.uid == step.uid or other.is_wait)
    return replace(state, steps=state.steps + (step,))


def _end_steps(state: State, is_over: Callable[[Step], bool] = lambda step: True) -> State:
    for step in filter(is_over, state.steps):
        state = replace(state, steps=_without(state.steps, step))
        state = _conclude(state, replace(step, ended=state.at))
    return state


def _note_uid(state: State, path: str, uid: int) -> State:
    return state if state.uids.get(path) == uid else replace(state, uids={**state.uids, path: uid})


def _leaf_finished(state: State, event: LeafFinished) -> State:
    state = _note_uid(state, event.path, event.uid)
    failure = event.failure
    is_false = failure is not None and failure.is_false_condition
    step = _first(state.steps, lambda step: step.uid == event.uid)
    # a HandleFallBack that was halted has halted its retry
    uids = {event.uid} | {state.uids.get(recovery.path, event.uid) for recovery in state.recoveries
                          if recovery.uid == event.uid}
    # a wait goes on while its condition is false
    goes_on = is_false and step is not None and step.is_wait and not (
        0.0 < step.limit <= event.seconds)
    if not goes_on:
        state = _end_steps(state, lambda other: other.uid in uids)
    state = _abandon(state, lambda exchange: exchange.uid in uids or
                     event.status == "IDLE" and not exchange.uid)
    if event.status == "SUCCESS" and step is not None:  # also what went on after its answer
        state = replace(state, robot=_ended(state.robot, step.call))
    state = _note_visitor(_note_evidence(state, event), event)
    recovery = _first((state.recovered, *state.recoveries),
                      lambda recovery: recovery is not None and recovery.uid == event.uid)
    if recovery is not None:
        state = _end_recovery(state, event, recovery)
    if failure is not None and event.uid != state.course.handler:
        return _leaf_failed(state, event, failure)
    if event.status == "SUCCESS":
        if event.uid == state.course.failed[0]:
            return _change_course(state, failed=(0, None), stuck=None)
        if step is not None and not step.is_wait:
            return _change_course(state, stuck=None, without="")
    return state


def _leaf_failed(state: State, event: LeafFinished, failure: Failure) -> State:
    why = Reason(FAILED, event.node, failure, without=state.course.without)
    results = {**state.results, event.uid: state.results.get(event.uid, ()) + (failure,)}
    state = _change_course(replace(state, results=results), failed=(event.uid, why), stuck=why)
    failed = LeafFailure(state.at, state.visit_count, event.uid, event.node, event.path, failure)
    return _note_failure(state, (), replace(failed, seconds=event.seconds))


def _note_failure(state: State, before: Tuple[LeafFailure, ...], failed: LeafFailure) -> State:
    failures = {**state.failures, failed.path: before + (failed,)}
    return _conclude(replace(state, failures=failures), failed)


def _note_evidence(state: State, event: LeafFinished) -> State:
    """Note whether a condition on a topic holds, and whether the robot could have seen that."""
    before, failure = state.course.unmet, event.failure
    topic = event.resource if failure is None else failure.resource
    unmet = {other: trouble for other, trouble in before.items() if other != topic}
    if failure is not None and failure.is_false_condition and topic:
        trouble = state.robot.trouble(topic)
        if failure.unheard is None:
            unmet[topic] = trouble or before.get(topic)
        elif failure.unheard:  # else a message that counts says so
            unmet[topic] = trouble or HealthChanged(
                "topic", topic, "", False, f"silent ({failure.unheard})", "")
    elif event.status != "SUCCESS" or topic not in before:
        return state
    return _change_course(state, unmet=unmet)


def _note_visitor(state: State, event: LeafFinished) -> State:
    """Note what the sentence at the end of a leaf means for the visit."""
    visit, summary = state.visit, event.summary
    if visit is None or summary is None:
        return state
    mark = summary.mark
    if summary.kind == "heard" and not mark:
        return _change_course(state, is_unclear=True)
    if mark == "unanswered":
        return _change_course(state, is_unanswered=True)
    if mark in ("yes", "no", "helped"):
        return _change_visit(state, answer=mark)
    if mark == "left" and visit.arrived is not None:
        return _change_course(state, left_by=event.resource)
    if mark in ("left", "arrived", "engaged"):
        state = _change_course(state, left_by=None)
    if mark in ("arrived", "engaged") and visit.arrived is None:
        state = _change_visit(_change_course(state, met=summary.at), arrived=state.at)
    # the first time counts
    if mark in ("arrived", "engaged", "asked") and getattr(visit, mark) is None:
        return _change_visit(state, **{mark: state.at})
    return state


# ----------------------------------------------------------------------------------------- stops


def _stop_changed(state: State, event: StopChanged) -> State:
    if event.state == OMITTED:
        return replace(state, omitted=event.number)
    state = _end_stop(state, state.why_broken_off)
    if event.state != BEGUN:
        return state
    begun = Stop(event.number, event.of, clean(event.name), UNDER_WAY, None, 0.0, state.at,
                 clean(event.noun))
    others = tuple(stop for stop in state.stops if stop.number != event.number)
    return _change_course(_change_visit(state, stops=others + (begun,)), stuck=None)


def _end_stop(state: State, why: Optional[Reason], how: str = BROKEN_OFF,
              omitted: Optional[Stop] = None) -> State:
    """Note that the last stop ended so, or that it is completed if there is no ``why``."""
    stop = omitted or state.stop
    if stop is None:
        return state
    if why is None:
        how = COMPLETED
    else:
        why = _as_seen(state, why)
    ended = replace(stop, state=how, why=why, seconds=state.at - stop.began)
    return _conclude(_change_visit(state, stops=state.stops[:-1] + (ended,)), ended)


# ----------------------------------------------------------------------------------------- recovery


def _round(state: State, event: Union[Recovering, Recovered]) -> RecoveryRound:
    """Return the recovery under way from the failure of a node, or a new one."""
    known = _first(state.recoveries, lambda recovery: recovery.path == event.path)
    return known or RecoveryRound(event.node, event.path, event.uid, state.at)


def _recovering(state: State, event: Recovering) -> State:
    known = _round(state, event)
    recovery = replace(known, substitute=event.substitute, attempt=event.attempt,
                       attempts=event.of, failures=state.failures.get(event.path, ()))
    state = replace(state, recoveries=_without(state.recoveries, known) + (recovery,))
    return _begin_step(state, Step("", state.at, 0.0, event.uid, False, attempt=event.attempt + 1,
                                   attempts=event.of + 1, cause=event))


def _retried(state: State, event: Retried) -> State:
    uid = state.uids.get(event.path, 0)
    failed = LeafFailure(state.at, state.visit_count, uid, event.node, event.path, event.failure,
                         event.attempt)
    state = _end_steps(state, lambda step: step.uid == uid or (
        isinstance(step.cause, Recovering) and step.cause.path == event.path))
    return _note_failure(state, state.failures.get(event.path, ()), failed)


def _recovered(state: State, event: Recovered) -> State:
    known, uid = _round(state, event), state.uids.get(event.path, 0)
    decided = replace(known, recovered=event, decided=state.at, attempt=0, attempts=event.attempts)
    why, omitted = why_recovered(state, event), state.omits(event)
    is_known, is_left_out = state.has_given_up(event), event.outcome == SKIPPED
    is_false = event.failure.is_false_condition
    if is_left_out and not is_false:
        state = _count_skipped(_change_course(state, without=event.node), event.node)
    step = _first(state.steps, lambda step: step.uid == uid)
    if step is not None and event.outcome == DONE:  # also what went on after its answer
        state = replace(state, robot=_ended(state.robot, step.call))
    state = _end_steps(state, lambda step: step.uid == uid)
    state = replace(state, omitted=0, recovered=decided,
                    recoveries=_without(state.recoveries, known))
    state = _change_course(state, handler=event.uid, failed=(0, None), stuck=None)
    if event.outcome == GIVEN_UP:
        state = _change_course(state, stuck=why)
    if omitted is not None:
        if state.course.left_by is not None:
            why = state.why_left
        state = _end_stop(state, why, LEFT_OUT if is_left_out else BROKEN_OFF, omitted)
        if is_left_out and is_false:
            state = _count_skipped(state, omitted.name)
        if is_left_out:
            return _change_course(state, given_up=None)
    elif event.outcome != GIVEN_UP:
        return state
    if is_known:
        return state
    return _change_course(state, given_up=event, gave_up=why)


def _count_skipped(state: State, node: str) -> State:
    """Note that the mission went on without a node, or a stop that was left out, for the visit and
    for the stop under way."""
    if state.visit is None:
        return state
    skipped = state.visit.skipped
    state = _change_visit(state, skipped={**skipped, node: skipped.get(node, 0) + 1})
    stop = state.stop
    if stop is None:
        return state
    changed = replace(stop, skipped={**stop.skipped, node: stop.skipped.get(node, 0) + 1})
    return _change_visit(state, stops=state.stops[:-1] + (changed,))


def _end_recovery(state: State, event: LeafFinished, recovery: RecoveryRound) -> State:
    """Note that a HandleFallBack has ended, or was halted, and conclude its recovery."""
    failures, instead = state.failures.get(recovery.path, ()), state.failures.get(event.path, ())
    ended = replace(recovery, failures=failures, instead=instead, handler=event.path,
                    began=state.at - event.seconds, ended=state.at,
                    is_halted=event.status == "IDLE")
    # what is left to an outer HandleFallBack is the failure of the step itself
    kept = {path: failed for path, failed in state.failures.items() if path != event.path}
    if failures and not ended.is_halted:
        kept[recovery.path] = failures[:1]
    recoveries = tuple(other for other in state.recoveries if other.uid != event.uid)
    state = replace(state, recovered=None, failures=kept, recoveries=recoveries)
    return _conclude(state, ended)


def _paused(state: State, event: Paused) -> State:
    return _begin_step(_end_steps(state), Step("", state.at, event.limit, 0, True, cause=event))


def _safe_state_reported(state: State, event: SafeStateReported) -> State:
    switched = {field: kind("disabled") if part.failure is None else None
                for part in event.parts for kind, field in _SWITCHES.items()
                if part.what == kind.switches}
    robot = replace(state.robot, **switched)
    for exchange in state.exchanges:  # as of a leaf that blocks, which nothing has halted
        robot = _left_open(robot, exchange)
    return replace(state, safe_state=event, robot=robot)


def _breakpoint_changed(state: State, event: BreakpointChanged) -> State:
    held = {uid: since for uid, since in state.held.items() if uid != event.uid}
    if event.is_held:
        held[event.uid] = state.at
    return replace(state, held=held)


def _suspended(state: State, event: Suspended) -> State:
    words = clean(event.words)
    if event.is_due:
        return replace(state, due=words)
    return replace(state, suspended=(words, state.at), resume=event.resume, due="")


# ------------------------------------------------------------------------------- requests and robot


def _asked(state: State, event: Asked) -> State:
    request: Any = event.request
    step, uid = state.step, 0
    words = request.words or Words("asking " + event.service)
    doing, what = words.doing, words.what
    if step is not None and not step.is_wait and not step.call:
        uid = step.uid
        if step.words:
            doing, what = step.words, step.what
        state = replace(state, steps=state.steps[:-1] + (replace(step, call=event.call),))
    services = {**state.robot.services, type(request).__name__: event.service}
    if isinstance(request, GoTo):
        name = what[3:] if what.startswith("to ") else what
        state = _change_robot(state, goal=request.goal, goal_name=name, is_lost=False)
        services[GoTo.__name__] = event.service
    state = _change_robot(state, services=services)
    if isinstance(request, GoTo) or type(request) in _SWITCHES and request.state != "disabled":
        state = replace(state, safe_state=None)
    said = clean(joined(" ", doing, what))
    exchange = Exchange(event.call, event.service, request, state.at, uid, words=said)
    return replace(state, exchanges=state.exchanges + (exchange,))


def _answered(state: State, event: Answered) -> State:
    exchange = _first(state.exchanges, lambda exchange: exchange.call == event.call)
    if exchange is None:  # its request was lost
        return state
    ended = replace(exchange, answered=state.at, result=event.result)
    state = replace(state, exchanges=_without(state.exchanges, exchange))
    state = _change_course(replace(state, robot=_moved(state.robot, ended)), answered=ended,
                           unasked=_unasked(state, ended))
    return _conclude(state, ended)


def _unasked(state: State, exchange: Exchange) -> Optional[Failure]:
    """Return the failure, if the last request that could have asked the visitor has failed."""
    is_asked = state.visit is not None and state.visit.asked is not None
    is_speech = isinstance(exchange.request, Say) and (exchange.failure is None or not is_asked)
    if state.course.is_unanswered or not (is_speech or isinstance(exchange.request, Prompt)):
        return state.course.unasked
    return exchange.failure


def _feedback_received(state: State, event: FeedbackReceived) -> State:
    steps = tuple(replace(step, feedback=clean(event.text)) if step.call == event.call else step
                  for step in state.steps)
    return replace(state, steps=steps)


def _abandon(state: State,
             is_abandoned: Callable[[Exchange], bool] = lambda exchange: True) -> State:
    """Note that the results of requests are not awaited any more."""
    for exchange in filter(is_abandoned, state.exchanges):
        state = replace(state, exchanges=_without(state.exchanges, exchange),
                        robot=_left_open(_departed(state.robot, exchange), exchange))
        state = _conclude(state, exchange)
    return state


def _moved(robot: Robot, exchange: Exchange) -> Robot:
    """Return the robot after an answer.

    A request that failed leaves open how far it was carried out, unless it was not sent.
    """
    request, failure = exchange.request, exchange.failure
    robot = _ended(robot, exchange.call)  # which a report of the safe state may have left open
    if type(request) in _SWITCHES:
        return replace(robot, **{_SWITCHES[type(request)]: None if failure else request})
    if failure is None:  # the newest of its kind is done, so no earlier one is under way
        robot = replace(robot, unfinished=_others(robot.unfinished, exchange))
    elif failure.cause in UNCERTAIN:
        robot = _left_open(robot, exchange)
    if isinstance(request, GoTo) and request.goal == robot.goal:
        if failure is None:
            return replace(robot, goal=None, place=request.goal, last_place=robot.goal_name, way="")
        if failure.cause not in UNSENT:
            return _departed(robot, exchange)
        if not (robot.last_place or robot.way):
            robot = replace(robot, goal_name="")
        return replace(robot, goal=None)
    if isinstance(request, SetPose) and failure is None and not robot.goal_name:
        return replace(robot, place=request.pose)  # after a drive it moves nothing
    return robot


def _departed(robot: Robot, exchange: Exchange) -> Robot:
    """Return the robot after a request for a drive that may have begun and did not arrive."""
    if not isinstance(exchange.request, GoTo):
        return robot
    return replace(robot, goal=None, place=None, way=robot.goal_name)


def _left_open(robot: Robot, exchange: Exchange) -> Robot:
    """Return the robot after a request whose end is not known."""
    if not exchange.request.effect:
        return robot
    return replace(robot, unfinished=_others(robot.unfinished, exchange) + (exchange,))


def _ended(robot: Robot, call: int) -> Robot:
    """Return the robot after the end of a request."""
    return replace(robot, unfinished=tuple(one for one in robot.unfinished if one.call != call))


def _others(exchanges: Iterable[Exchange], one: Exchange) -> Tuple[Exchange, ...]:
    """Return the exchanges with other services."""
    return tuple(other for other in exchanges if other.service != one.service)


def _health_changed(state: State, event: HealthChanged) -> State:
    robot, key = state.robot, (event.name, event.respect)
    troubles = {other: change for other, change in robot.troubles.items() if other != key}
    ill_since = dict(robot.ill_since)
    if not event.is_well:
        troubles[key] = event
        first = [recovery.failures[0] for recovery in state.recoveries if recovery.failures]
        times = [failed.at for failed in first if failed.failure.resource == event.name]
        ill_since.setdefault(event.name, min(times, default=state.at))
        if event.respect == GONE:  # it may come back anew
            robot = replace(robot, **{field: None for kind, field in _SWITCHES.items()
                                      if robot.services.get(kind.__name__) == event.name})
    elif event.name not in {name for name, _ in troubles}:
        ill_since.pop(event.name, None)
    robot = replace(robot, troubles=troubles, ill_since=ill_since)
    trouble, unmet = robot.trouble(event.name), dict(state.course.unmet)
    awaited = _awaited(state, event.name)
    if trouble is not None and (event.name in unmet or awaited is not None):
        unmet[event.name] = trouble
    elif awaited is not None and awaited.unheard == "":  # it can be seen again
        unmet.pop(event.name, None)
    return _change_course(replace(state, robot=robot), unmet=unmet)


def _awaited(state: State, topic: str) -> Optional[Failure]:
    """Return why the condition on a topic was false that is waited for; None: none is."""
    waits = (state.failures.get(step.path, ()) for step in state.steps if step.is_wait)
    failures = (failed[-1].failure for failed in waits if failed)
    return _first(failures, lambda failure: failure.resource == topic)


# ---------------------------------------------------------------------------- tree and what is lost


def _ticked(state: State, event: Tick) -> State:
    letters, running, results = list(state.letters), dict(state.running), dict(state.results)
    ended: List[NodeResult] = []
    for uid, letter in event.changes:
        if not 0 < uid <= len(letters):
            continue
        letters[uid - 1] = letter_after(letters[uid - 1], letter)
        if letter == "R":
            running[uid] = state.at
        elif letter != "-" or uid in running:  # otherwise it ended earlier and is reset now
            mine, failure = results.pop(uid, ()), None
            if letter == "F" and mine:
                failure, results[uid] = mine[0], mine[1:]
            ended.append(NodeResult(uid, running.pop(uid, state.at), state.at, letter, failure))
    state = replace(state, letters="".join(letters), running=running, results={},
                    facts=tuple(ended))
    return _end_steps(state, lambda step: step.is_wait and step.uid not in running and
                      step.until is not None and step.until <= state.at)


def _tree_statuses(state: State, event: TreeStatuses) -> State:
    count = len(state.nodes)
    letters = event.letters[:count].ljust(count, NOT_TICKED)
    running = {uid: state.at for uid, letter in enumerate(letters, 1) if letter == "R"}
    state = replace(state, letters=letters, running=running)
    if event.whereabouts is not None:
        state = _change_robot(state, **asdict(event.whereabouts))
    return state


def _entries_written(state: State, event: EntriesWritten) -> State:
    changed = dict(event.entries)
    return replace(state, entries=_known({**state.entries, **changed}),
                   values=_known({**state.values, **changed, **event.values}))


def _known(entries: Dict[str, Optional[Item]]) -> Dict[str, Item]:
    return {name: value for name, value in entries.items() if value is not None}


def _noticed(state: State, event: Noticed) -> State:
    if event.level != "error":
        return state
    return _conclude(_change_course(state, failed=(0, Reason(NOTICED, text=event.text))), event)


def _lost(state: State, event: Lost) -> State:
    return replace(state, lost=state.lost + event.lines)


WITHOUT_EFFECT = (Message, RecognitionPending, HookEnded)
"""The kinds of events that change nothing: what the mission makes of a message, and what a hook
does, are other events."""

_HANDLERS: Dict[type, Callable[[State, Any], State]] = {
    **dict.fromkeys(WITHOUT_EFFECT, lambda state, event: state),
    **{handler.__annotations__["event"]: handler for handler in (
        _tree_shown, _run_started, _pass_started, _step_started, _leaf_finished, _stop_changed,
        _recovering, _retried, _recovered, _paused, _safe_state_reported, _breakpoint_changed,
        _suspended, _health_changed, _pass_finished, _noticed, _run_finished, _ticked, _asked,
        _answered, _feedback_received, _entries_written, _lost, _starting, _sign_of_life,
        _tree_statuses, _checked, _topic_said)}}
"""What interprets each kind of event."""

_unknown = sorted(kind.__name__ for kind in set(EVENTS).difference(_HANDLERS))
if _unknown:
    raise TypeError(f"the model of a run does not interpret {', '.join(_unknown)}")
