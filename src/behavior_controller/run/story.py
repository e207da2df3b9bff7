"""Puts a run into sentences for people; terminal, page, report and rehearsal show the same ones.

A sentence is made from the model of the run before and after an event, and from nothing else: a
record gives the same sentences as the run itself. All texts are safe to show, whatever they quote:
see ``text.clean``.
"""
import collections
from typing import Any, Callable, Dict, Iterable, Iterator, List, Optional, Tuple

from msgspec import Struct

from behavior_controller.run import events
from behavior_controller.run.events import GIVEN_UP, SKIPPED, SUBSTITUTED
from behavior_controller.run.fold import fold, why_recovered
from behavior_controller.run.health import NEW, SIMULATED_TIME
from behavior_controller.run.state import (
    BROKEN_OFF, COMPLETE, COMPLETED, DECLINED, DONE_ALL, GAVE_UP, IN_PART, LEFT, NOTICED, RESULTS,
    SILENT_VISITOR, STOPPED, UNCLEAR, LeafFailure, Reason, State, Step, Stop, Visit, rank)
from behavior_controller.folders import mission_name
from behavior_controller.robot.gateway import UNCERTAIN, Cause, Failure
from behavior_controller.robot.requests import MOTION
from behavior_controller.text import bracketed, clean, count, form, joined

KINDS = ("visit", "stop", "said", "heard", "asked", "pressed", "moved", "failure", "recovery",
         "health", "notice")


class Sentence(Struct, frozen=True):
    """A sentence about one event, in words for people and on one line.

    ``kind`` says what it is about (one of ``story.KINDS``), ``severity`` is info, warning or error;
    ``visit`` is 0 before the first. ``uid`` and ``path`` are those of the node that it leads to; 0
    and empty if there is none. Sentences of one ``incident`` have one cause: it is the time of the
    first of them. ``cause`` is the kind of the failure that they are about, in words.
    """

    at: float
    visit: int
    kind: str
    severity: str
    text: str
    uid: int
    path: str = ""
    incident: float = 0.0
    cause: str = ""


SEVERITIES = ("info", "warning", "error")


class Story:
    """Folds events in order, from a state on; ``state`` is what is so after the last one."""

    def __init__(self, before: State = State()) -> None:
        self.state = before

    def take(self, at: float, event: events.Event) -> Tuple[Sentence, ...]:
        """Return the sentences about ``event``."""
        before, self.state = self.state, fold(self.state, at, event)
        return sentences(before, event, self.state)

    def extend(self, lines: Iterable[events.Line]) -> None:
        """Fold the next lines."""
        for line in lines:
            self.take(line.time, line.event)


def sentences(before: State, event: events.Event, after: State) -> Tuple[Sentence, ...]:
    """Return the sentences about an event, given what was so before it and what is so after it."""
    words = _WORDS.get(type(event))
    if words is None:
        return ()
    path, uid, reason = getattr(event, "path", ""), getattr(event, "uid", 0), ""
    if isinstance(event, (events.Recovered, events.Recovering)):
        uid = 0  # that of its HandleFallBack
    failure = getattr(event, "failure", None)
    if failure is not None:
        reason = failure.cause.text
    return tuple(
        Sentence(after.at, after.visit_count, kind if kind in KINDS else "notice",
                 severity if severity in SEVERITIES else "warning", clean(text),
                 after.uids.get(path, uid), clean(path), incident, reason)
        for kind, severity, text, incident in words(before, event, after))


# ----------------------------------------------------------------------------------------- phrases


OF_ROS = (Cause.REFUSED, Cause.HANDLER_EXCEPTION, Cause.NO_ANSWER, Cause.CONNECTION_LOST,
          Cause.NOT_REACHABLE, Cause.NOT_ADVERTISED, Cause.TYPE_MISMATCH)
"""The causes of a failure whose message has addresses, types or names of fields."""


def cause(failure: Optional[Failure], is_short: bool = False) -> str:
    """Return why something failed; in short, without what ROS says of it. Empty: it did not."""
    if failure is None:
        return ""
    message = clean(" ".join(failure.message.split()))
    if failure.is_false_condition:
        return message.partition(";")[0]  # what follows tells of messages of the topic
    if is_short and failure.cause in OF_ROS:
        message = ""
    return joined(", ", failure.cause.text, message) + bracketed(clean(failure.resource))


def why_failed(node: str, failure: Failure, tries: int = 1, is_short: bool = False) -> str:
    """Return what failed, how often if that was tried again, and why; of a condition, what it has
    not seen or heard.
    """
    if failure.is_false_condition:
        return cause(failure) or f"{node} failed"
    return clean(f"{_often(node + ' failed', tries)}: {cause(failure, is_short)}")


def _often(words: str, times: int) -> str:
    return f"{words} {times} times" if times > 1 else words


def why(reason: Optional[Reason]) -> str:
    """Return why something ended; empty without a reason."""
    if reason is None:
        return ""
    text = _REASONS.get(reason.kind, "it failed")
    if reason.kind == NOTICED:
        text = clean(reason.text)
    elif reason.kind == SILENT_VISITOR and reason.failure is not None:
        text = f"the visitor could not be asked: {cause(reason.failure, is_short=True)}"
    elif reason.failure is not None:
        # the sentence about the failure itself has the detail
        text = why_failed(reason.node, reason.failure, reason.tries, is_short=True)
    if reason.policy:
        text = clean(f"{reason.policy}; {text}")
    if reason.blind is not None:
        return f"{_UNSEEN.get(reason.kind, text)}: {condition(reason.blind)}"
    if reason.without and reason.failure is not None and reason.failure.is_false_condition:
        text += clean(f": went on without {reason.without}")
    return text


_REASONS = {
    LEFT: "the visitor left", STOPPED: "the robot was stopped", DECLINED: "the visitor said no",
    DONE_ALL: "complete", UNCLEAR: "no clear answer", SILENT_VISITOR: "no answer"}
_UNSEEN = {LEFT: "the visitor could not be seen", SILENT_VISITOR: "no answer was heard"}


def condition(change: events.HealthChanged) -> str:
    """Return in a few words what is wrong with a service, a topic or the master."""
    if change.kind == "master" and change.respect == NEW:
        return "the ROS master is new"
    if change.kind in _OF_ALL:
        return clean(f"{_OF_ALL[change.kind]} {change.status}")
    return clean(joined(" is ", change.name, change.respect or change.status))


_OF_ALL = {"master": "the ROS master", SIMULATED_TIME: SIMULATED_TIME}
"""The kinds of changes that are about no single service or topic, and what is named."""


def conditions(changes: Iterable[events.HealthChanged]) -> str:
    """Return the same of several ones; those with the same trouble are said together."""
    alike: Dict[str, List[events.HealthChanged]] = {}
    for change in changes:
        subject = change.respect
        if change.kind in _OF_ALL:
            subject = change.name
        alike.setdefault(subject, []).append(change)
    return "; ".join(map(_common_condition, alike.values()))


MOST_NAMES = 3
"""The most services and topics with the same trouble that are named."""


def _common_condition(changes: List[events.HealthChanged]) -> str:
    if len(changes) == 1:
        return condition(changes[0])
    names, kinds = [change.name for change in changes], [change.kind for change in changes]
    return clean(f"{few(names, kinds, MOST_NAMES)} are {changes[0].respect}")


def few(names: List[str], kinds: List[str], most: int) -> str:
    """Return the names, or of more than ``most`` how many there are of each kind."""
    if len(names) <= most:
        return listed(names)
    return listed([count(number, kind) for kind, number in collections.Counter(kinds).items()])


def listed(names: List[str]) -> str:
    """Return ``a, b and c``; empty for none."""
    return joined(" and ", ", ".join(names[:-1]), *names[-1:])


def stop_name(stop: Stop) -> str:
    """Return ``place 2 of 5, name``, with the mission's word for it."""
    return f"{stop.noun or 'stop'} {stop.number} of {stop.of}, {stop.name}"


def completed(visit: Visit) -> str:
    """Return ``2 of 5 places completed, 1 in part``; empty without a stop."""
    if not visit.stops:
        return ""
    done, last = [stop for stop in visit.stops if stop.state == COMPLETED], visit.stops[-1]
    partial = sum(bool(stop.skipped) for stop in done)
    text = f"{len(done) - partial} of {last.of} {last.noun or 'stop'}s completed"
    if partial:
        text += f", {partial} in part"
    return text


def without(skipped: Dict[str, int]) -> str:
    """Return `` without 7 steps (Say 4 times, Point 2 times and 1 more)``, which the mission went
    on without; empty for none.
    """
    if not skipped:
        return ""
    counts = collections.Counter(skipped).most_common()
    names = [_often(node, times) for node, times in counts[:MOST_NAMES]]
    rest, number = sum(times for _, times in counts[MOST_NAMES:]), sum(skipped.values())
    if rest:
        names.append(f"{rest} more")
    if number == 1:
        return clean(f" without {names[0]}")
    return clean(f" without {number} steps ({listed(names)})")


def how_it_ended(visit: Visit) -> str:
    """Return how a visit ended, and what it went without; empty while it is under way."""
    ending, lacks = _ending(visit), without(visit.skipped)
    if ending and lacks not in ending:
        ending += ";" + lacks
    return ending


def _ending(visit: Visit) -> str:
    reason, last, text = visit.why, next(reversed(visit.stops), None), why(visit.why)
    if reason is None:
        return ""
    if reason.kind == DONE_ALL:
        text += without(visit.skipped)
        if last is not None and last.state == COMPLETED and last.number < last.of:
            return f"{text} at {stop_name(last)}"  # what the visitor looked for
        return joined(", ", text, completed(visit))
    if last is not None and last.state == BROKEN_OFF:
        return f"ended at {stop_name(last)}: {text}"
    if reason.kind == GAVE_UP:
        return "gave up: " + text
    return text


def counted(state: State) -> str:
    """Return how many visits there were, and how many of them had each result."""
    counts = state.visit_results
    number = sum(counts.values())
    if not number:
        return "no visit completed"
    results = listed([f"{counts[result]} {result}" for result in RESULTS if result in counts])
    return f"{count(number, 'visit')}: {results}"


def run_end(state: State, is_short: bool = False) -> str:
    """Return how the run ended, and which steps its last visit went without, but not in short, or
    what the visitor chose if the tree failed by that; empty while it goes on.
    """
    if state.finished is None:
        return ""
    outcome = state.finished.outcome
    visit = next((visit for visit in reversed(state.visits) if visit.outcome), None)
    if not outcome or visit is None or state.finished.exit_code is None:
        return outcome
    if visit.result == IN_PART and not is_short:
        return f"{outcome}, {COMPLETE}{without(visit.skipped)}"
    ended, _, last = outcome.rpartition("; ")
    if visit.is_no_failure and last.endswith(visit.outcome):
        return f"{ended}; pass {visit.number} is over: {why(visit.why)}"
    return outcome


def end_headline(state: State) -> str:
    """Return for people how a run ended: its last visit, or when it was stopped; empty while it
    goes on."""
    finished, visit = state.finished, state.visit
    if finished is None or visit is None or finished.exit_code is None:
        return run_end(state)
    if visit.is_empty:
        return "stopped before a visitor came"
    if not visit.outcome:
        return f"stopped in the visit of visitor {visit.number}"
    if finished.outcome.startswith("stopped"):
        return "stopped between two visits"
    return how_it_ended(visit) or run_end(state)


def recovering(event: events.Recovering) -> str:
    """Return what a recovery does."""
    if event.substitute:
        return clean(f"doing {event.substitute} in place of {event.node}")
    # the first attempt has failed
    return clean(f"trying {event.node} again, attempt {event.attempt + 1} of {event.of + 1}")


def to_check(failure: Failure) -> str:
    """Return where a person has to look for the cause of a failure that persists."""
    return clean("check " + (failure.resource or "the mission"))


def waiting(event: events.Paused) -> str:
    """Return what a mission waits for that gave up."""
    if event.awaited:
        return clean(f"waiting for {event.awaited} to return")
    return clean(joined(": ", f"waiting {event.limit:.0f} s", event.reason))


def step_words(step: Step) -> str:
    """Return what the robot does in a step, with what it has reported of it last."""
    if isinstance(step.cause, events.Recovering):
        return recovering(step.cause)
    if isinstance(step.cause, events.Paused):
        return waiting(step.cause)
    return joined(", ", joined(" ", step.words, step.what), step.feedback)


STOP_BUTTON = "keep the stop button at hand"


def may_be_under_way(state: State) -> str:
    """Return in words what the robot may still be carrying out; empty if nothing is."""
    doing = listed([exchange.words for exchange in state.robot.unfinished])
    return doing and "may still be " + doing


def may_move(state: State) -> bool:
    """Return whether the robot may be moving by what it was asked for."""
    return any(exchange.request.effect == MOTION for exchange in state.robot.unfinished)


def under_way_warning(state: State) -> str:
    """Return this with what a person has to do about it."""
    if may_move(state):
        return f"{may_be_under_way(state)}: {STOP_BUTTON}"
    return may_be_under_way(state)


def safe_parts(state: State, is_off: bool) -> List[str]:
    """Return the parts of the safe state that were switched off after a stop, or those that were
    not."""
    if state.safe_state is None:
        return []
    return [part.what for part in state.safe_state.parts if (part.failure is None) is is_off]


def switched_off(state: State) -> str:
    """Return ``attention and lifelike movement are off``, of the parts of the safe state that were
    reached; empty for none.
    """
    off = safe_parts(state, is_off=True)
    return clean(f"{listed(off)} {form(len(off), 'is', 'are')} off") if off else ""


def safe_state(state: State) -> str:
    """Return in words which parts of the safe state were reached, why the others may not be, and
    what may still be under way; empty if it was not asked for.
    """
    if state.safe_state is None:
        return ""
    parts, texts = state.safe_state.parts, [switched_off(state)]
    if not parts:
        texts = ["the robot has neither attention nor lifelike movement to switch off"]
    for part in parts:
        if part.failure is not None and part.failure.cause in UNCERTAIN:
            texts.append(f"whether {part.what} is off is not known: {cause(part.failure)}")
        elif part.failure is not None:
            texts.append(f"{part.what} could not be switched off: {cause(part.failure)}")
    return clean(joined("; ", *texts, under_way_warning(state)))


def ordinal(number: int) -> str:
    """Return 1st, 2nd, 3rd, 4th …"""
    ending = "th"
    if number // 10 % 10 != 1:
        ending = {1: "st", 2: "nd", 3: "rd"}.get(number % 10, ending)
    return f"{number}{ending}"


def _incident(state: State, failure: Failure, path: str) -> float:
    """Return when that began which a failure belongs to: the trouble of its service, or the first
    failure of its step.
    """
    first = next((failed.at for failed in state.failures.get(path, ())), state.at)
    return min(first, state.robot.ill_since.get(failure.resource, first))


_Said = Tuple[str, str, str, float]
"""Kind, severity, text and incident of a sentence."""


def _severity(is_well: bool) -> str:
    return "info" if is_well else "warning"


def _run_started(before: State, event: events.RunStarted, after: State) -> Iterator[_Said]:
    name, leaves = mission_name(event.mission), len(event.leaves)
    yield "notice", "info", f"mission {name} starts, {leaves} mission leaves", 0.0


def _run_finished(before: State, event: events.RunFinished, after: State) -> Iterator[_Said]:
    for visit in after.concluded(Visit):
        if not visit.is_empty:
            yield "visit", "warning", f"visitor {visit.number}: {how_it_ended(visit)}", 0.0
    code = f" (exit code {event.exit_code})" * (event.exit_code is not None)
    yield "notice", "info", f"ends: {run_end(after)}{code}", 0.0


def _pass_finished(before: State, event: events.PassFinished, after: State) -> Iterator[_Said]:
    visit = after.visit
    if visit is not None:
        is_whole = visit.outcome == "SUCCESS" and not visit.skipped and visit.result != BROKEN_OFF
        outcome = event.outcome
        if visit.is_no_failure:
            is_whole, outcome = True, "over"
        text = f"pass {event.number}: {outcome} after {visit.seconds:.1f} s: {how_it_ended(visit)}"
        yield "visit", _severity(is_whole), text, 0.0


def _leaf_finished(before: State, event: events.LeafFinished, after: State) -> Iterator[_Said]:
    if event.summary is not None:
        text = _met(before, after, event.summary.mark) or event.summary.text
        if text:
            yield event.summary.kind, "info", text, 0.0
    for failed in after.concluded(LeafFailure):
        if not failed.is_false_condition:
            incident = _incident(after, failed.failure, failed.path)
            yield "failure", "warning", why_failed(failed.node, failed.failure), incident


def _met(before: State, after: State, mark: str) -> str:
    """Return the sentence for a visitor who was seen, or looked at the robot, for the first time.
    """
    if mark not in _SEEN or before.visit is None or getattr(before.visit, mark) is not None:
        return ""
    return f"visitor {after.visit_count} {_SEEN[mark]}"


_SEEN = {"arrived": "arrived", "engaged": "looks at the robot"}
"""What is said of a visitor by the mark of a ``LeafSummary``."""


def _stop_changed(before: State, event: events.StopChanged, after: State) -> Iterator[_Said]:
    for stop in after.concluded(Stop):
        if stop.why is None:
            text = f"{stop_name(stop)}, is completed{without(stop.skipped)}"
            yield "stop", _severity(not stop.skipped), text, 0.0
        else:
            yield "stop", _severity(stop.is_left), _broken_off(stop), 0.0
    if event.state == events.BEGUN and after.stop is not None:
        yield "stop", "info", stop_name(after.stop), 0.0


def _broken_off(stop: Stop) -> str:
    return f"{stop_name(stop)}, is broken off: {why(stop.why)}"


def _recovering(before: State, event: events.Recovering, after: State) -> Iterator[_Said]:
    text = recovering(event)
    if event.attempt > 1:  # the first failure has its sentence already
        text += ": " + cause(event.failure)
    yield "recovery", "info", text, _incident(after, event.failure, event.path)


def _recovered(before: State, event: events.Recovered, after: State) -> Iterator[_Said]:
    stop, incident = next(after.concluded(Stop), None), _incident(before, event.failure, event.path)
    severity = "error"
    if event.failure.is_false_condition:
        severity = _severity(stop is not None and stop.is_left)
    if stop is not None:
        if incident < stop.began:
            incident = 0.0  # an entry of its own: that of the trouble stands far above
        if event.outcome == SKIPPED:
            text = f"{stop_name(stop)}, is left out: {why(stop.why)}"
            yield "stop", "warning", text, incident
        elif not before.has_given_up(event):
            yield "stop", severity, _broken_off(stop), incident
    elif event.outcome != GIVEN_UP:
        yield ("recovery", *_done(before, event), incident)
    elif not before.has_given_up(event):
        yield "recovery", severity, "gave up: " + why(why_recovered(before, event)), incident


def _done(before: State, event: events.Recovered) -> Tuple[str, str]:
    """Return severity and sentence of a recovery after which the mission goes on."""
    if event.outcome == SKIPPED:
        needed = why(why_recovered(before, event)).replace(" failed", ", which failed", 1)
        return "warning", f"went on without {needed}"
    substitute = next((recovery.substitute for recovery in before.recoveries
                       if recovery.path == event.path), None)
    if event.outcome == SUBSTITUTED and substitute is not None:
        return "warning", f"did {substitute} in place of {event.node}: {cause(event.failure)}"
    return "info", f"{event.node} succeeded on the {ordinal(event.attempts + 1)} attempt"


def _paused(before: State, event: events.Paused, after: State) -> Iterator[_Said]:
    to_do = ": restart it"
    if not event.awaited:
        last = f"{';' if event.reason else ':'} the last failure: {cause(event.failure)}"
        to_do = f"{last}; {to_check(event.failure)}"
    text = waiting(event) + to_do + "; the mission goes on by itself"
    yield "recovery", "warning", text, _incident(after, event.failure, "")


def _safe_state_reported(before: State, event: events.SafeStateReported,
                         after: State) -> Iterator[_Said]:
    is_reached = all(part.failure is None for part in event.parts) and not after.robot.unfinished
    incident = next((_incident(before, recovery.failures[-1].failure, recovery.path)
                     for recovery in reversed(before.recoveries) if recovery.failures), 0.0)
    yield "notice", _severity(is_reached), safe_state(after), incident


def _health_changed(before: State, event: events.HealthChanged, after: State) -> Iterator[_Said]:
    """Say nothing of a trouble while a stronger one is known."""
    strongest = after.robot.trouble(event.name)
    if strongest is None or rank(strongest) >= rank(event):
        since = before.robot.ill_since.get(event.name, after.robot.ill_since.get(event.name, 0.0))
        node = bracketed(event.node and "of node /" + event.node)
        text = f"{event.kind} {event.name}{node}: {event.status}"
        text = joined("; ", text, event.consequence)
        yield "health", _severity(event.is_well), text, since


def _noticed(before: State, event: events.Noticed, after: State) -> Iterator[_Said]:
    yield "notice", event.level, event.text, 0.0


def _lost(before: State, event: events.Lost, after: State) -> Iterator[_Said]:
    yield "notice", "warning", str(event), 0.0


def resume(service: str) -> str:
    """Return the command with which an operator lets the run go on."""
    return clean("rosservice call " + service)


def _suspended(before: State, event: events.Suspended, after: State) -> Iterator[_Said]:
    text = event.words or "goes on, started by the operator"
    if event.is_due:
        text += " as soon as the robot has done what it does now"
    if event.words and event.resume:
        text += ": to go on, " + resume(event.resume)
    yield "notice", "info", text, 0.0


def _breakpoint_changed(before: State, event: events.BreakpointChanged,
                        after: State) -> Iterator[_Said]:
    name = event.path.rpartition("/")[2].partition("::")[0]
    words = f"held by a breakpoint of Groot2 at {name}"
    if event.is_held:
        yield "notice", "warning", words, 0.0
    elif event.uid in before.held:  # it is released, or halted
        yield "notice", "info", "no longer " + words, 0.0


_Words = Callable[[State, Any, State], Iterator[_Said]]  # type: ignore[explicit-any]

_WORDS: Dict[type, _Words] = {words.__annotations__["event"]: words for words in (
    _run_started, _run_finished, _pass_finished, _leaf_finished, _stop_changed, _recovering,
    _recovered, _health_changed, _paused, _safe_state_reported, _breakpoint_changed, _suspended,
    _noticed, _lost)}
"""What is said of each kind of event; the others have no sentence."""
