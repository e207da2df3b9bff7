"""Puts a run into sentences for people; terminal, page, report and rehearsal show the same ones.

A sentence is made from the model of the run before and after an event, and from nothing else: a
record gives the same sentences as the run itself. All texts are safe to show, whatever they quote:
see ``text.clean``.
"""
import collections
from typing import Any, Callable, Dict, Iterable, Iterator, List, NamedTuple, Optional, Tuple

from behavior_controller.execution.events import (
    BEGUN, GIVEN_UP, SKIPPED, SUBSTITUTED, BreakpointChanged, Event, HealthChanged, LeafFinished,
    Noticed, PassFinished, Paused, Recovered, Recovering, RunFinished, RunStarted,
    SafeStateReported, StopChanged, Suspended)
from behavior_controller.execution.fold import fold, why_recovered
from behavior_controller.execution.health import NEW
from behavior_controller.execution.state import (
    BROKEN_OFF, COMPLETED, DECLINED, DONE_ALL, GAVE_UP, LEFT, NOTICED, SILENT_VISITOR, STOPPED,
    UNCLEAR, LeafFailure, Reason, State, Step, Stop, Visit, rank)
from behavior_controller.folders import mission_name
from behavior_controller.robot.gateway import Cause, Failure
from behavior_controller.text import clean

UNCERTAIN = (Cause.NO_ANSWER, Cause.CONNECTION_LOST, Cause.HANDLER_EXCEPTION, Cause.UNUSABLE_ANSWER)
"""The causes of a failure in spite of which the request may have been carried out."""


class Sentence(NamedTuple):
    """A sentence about one event, in words for people and on one line.

    ``kind`` says what it is about (one of ``KINDS``), ``severity`` is info, warning or error;
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
    path: str
    incident: float = 0.0
    cause: str = ""


KINDS = ("visit", "stop", "said", "heard", "asked", "pressed", "moved", "failure", "recovery",
         "health", "notice")


SEVERITIES = ("info", "warning", "error")


class Story:
    """Folds events in order, from a state on; ``state`` is what is so after the last one."""

    def __init__(self, before: State = State()) -> None:
        self.state = before

    def take(self, at: float, event: Event) -> Tuple[Sentence, ...]:
        """Return the sentences about ``event``."""
        before, self.state = self.state, fold(self.state, at, event)
        return sentences(before, event, self.state)


def sentences(before: State, event: Event, after: State) -> Tuple[Sentence, ...]:
    """Return the sentences about an event, given what was so before it and what is so after it."""
    words, failure = _WORDS.get(type(event)), getattr(event, "failure", None)
    said = tuple(words(before, event, after)) if words is not None else ()
    if failure is None:
        return said
    return tuple(sentence._replace(cause=failure.cause.text) for sentence in said)


# ----------------------------------------------------------------------------------------- phrases


OF_ROS = (Cause.REFUSED, Cause.HANDLER_EXCEPTION, Cause.NO_ANSWER, Cause.CONNECTION_LOST,
          Cause.NOT_REACHABLE, Cause.NOT_ADVERTISED, Cause.TYPE_MISMATCH)
"""The causes of a failure whose message has addresses, types or names of fields."""


def cause(failure: Failure, is_short: bool = False) -> str:
    """Return why something failed; in short, without what ROS says of it."""
    message = clean(" ".join(failure.message.split()))
    if failure.cause is Cause.CONDITION_FALSE:
        return message.partition(";")[0]  # what follows tells of messages of the topic
    if is_short and failure.cause in OF_ROS:
        message = ""
    resource = f" ({clean(failure.resource)})" if failure.resource else ""
    return ", ".join(filter(None, (failure.cause.text, message))) + resource


def why_failed(node: str, failure: Failure, tries: int = 1, is_short: bool = False) -> str:
    """Return what failed, how often if that was tried again, and why; of a condition, what it has
    not seen or heard.
    """
    if failure.cause is Cause.CONDITION_FALSE:
        return cause(failure) or f"{node} failed"
    often = f" {tries} times" if tries > 1 else ""
    return clean(f"{node} failed{often}: {cause(failure, is_short)}")


def why(reason: Optional[Reason]) -> str:
    """Return why something ended; empty without a reason."""
    if reason is None:
        return ""
    text = _REASONS.get(reason.kind, "it failed")
    if reason.kind == NOTICED:
        text = clean(reason.text)
    elif reason.failure is not None:
        # the sentence about the failure itself has the detail
        text = why_failed(reason.node, reason.failure, reason.tries, is_short=True)
    if reason.policy:
        text = clean(f"{reason.policy}; {text}")
    if reason.blind is not None:
        return f"{_UNSEEN.get(reason.kind, text)}: {condition(reason.blind)}"
    is_false = reason.failure is not None and reason.failure.cause is Cause.CONDITION_FALSE
    if is_false and reason.without:
        text += clean(f": went on without {reason.without}")
    return text


_REASONS = {
    LEFT: "the visitor left", STOPPED: "the robot was stopped", DECLINED: "the visitor said no",
    DONE_ALL: "done", UNCLEAR: "no clear answer", SILENT_VISITOR: "no answer"}
_UNSEEN = {LEFT: "the visitor could not be seen", SILENT_VISITOR: "no answer was heard"}


def condition(change: HealthChanged) -> str:
    """Return in a few words what is wrong with a service, a topic or the master."""
    if change.kind == "master":
        status = "is new" if change.respect == NEW else change.status
        return clean(f"the ROS master {status}")
    word = change.respect or change.status
    return clean(f"{change.name} is {word}" if word else change.name)


def conditions(changes: Iterable[HealthChanged]) -> str:
    """Return the same of several ones; those with the same trouble are said together."""
    alike: Dict[str, List[HealthChanged]] = {}
    for change in changes:
        subject = change.name if change.kind == "master" else change.respect
        alike.setdefault(subject, []).append(change)
    return "; ".join(map(_common_condition, alike.values()))


MOST_NAMES = 3
"""The most services and topics with the same trouble that are named."""


def _common_condition(changes: List[HealthChanged]) -> str:
    if len(changes) == 1:
        return condition(changes[0])
    names = listed([change.name for change in changes])
    if len(changes) > MOST_NAMES:
        kinds = collections.Counter(change.kind for change in changes)
        names = listed([f"{number} {kind}{'s' if number > 1 else ''}"
                        for kind, number in kinds.items()])
    return clean(f"{names} are {changes[0].respect}")


def listed(names: List[str]) -> str:
    """Return ``a, b and c``."""
    return " and ".join(filter(None, (", ".join(names[:-1]), names[-1])))


def stop_name(stop: Stop) -> str:
    """Return ``place 2 of 5, name``, with the mission's word for it."""
    return f"{stop.noun or 'stop'} {stop.number} of {stop.of}, {stop.name}"


def completed(visit: Visit) -> str:
    """Return ``2 of 5 places completed``; empty without a stop."""
    if not visit.stops:
        return ""
    number, last = sum(stop.state == COMPLETED for stop in visit.stops), visit.stops[-1]
    return f"{number} of {last.of} {last.noun or 'stop'}s completed"


def how_it_ended(visit: Visit) -> str:
    """Return how a visit ended; empty while it is under way."""
    reason, stops = visit.why, visit.stops
    if reason is None:
        return ""
    if reason.kind == DONE_ALL and stops:
        last = stops[-1]
        if last.state == COMPLETED and last.number < last.of:  # what the visitor looked for
            return f"{why(reason)} at {stop_name(last)}"
        return f"{why(reason)}, {completed(visit)}"
    if stops and stops[-1].state == BROKEN_OFF:
        return f"ended at {stop_name(stops[-1])}: {why(reason)}"
    return "gave up: " + why(reason) if reason.kind == GAVE_UP else why(reason)


def counted(outcomes: Dict[str, int]) -> str:
    """Return how many visits there were, and how many of them failed; an empty outcome is that of
    a visit that was stopped.
    """
    number, failed = sum(outcomes.values()), outcomes.get("FAILURE", 0)
    if not number:
        return "no visit completed"
    text = f"{number} visit{'' if number == 1 else 's'}, {failed or 'none'} failed"
    return text + ", the last one was stopped" if "" in outcomes else text


def recovering(event: Recovering) -> str:
    """Return what a recovery does."""
    if event.substitute:
        return clean(f"doing {event.substitute} in place of {event.node}")
    return clean(f"retrying {event.node}, {event.attempt} of {event.of}")


def waiting(event: Paused) -> str:
    """Return what a mission waits for that gave up."""
    if event.awaited:
        return clean(f"waiting for {event.awaited} to return")
    reason = ": " + event.reason if event.reason else ""
    return clean(f"waiting {event.limit:.0f} s{reason}")


def step_words(step: Step) -> str:
    """Return what the robot does in a step, with what it has reported of it last."""
    if isinstance(step.cause, Recovering):
        return recovering(step.cause)
    if isinstance(step.cause, Paused):
        return waiting(step.cause)
    words = " ".join(filter(None, (step.words, step.what)))
    return f"{words} ({step.feedback})" if step.feedback else words


def safe_state(state: State) -> str:
    """Return in words which parts of the safe state were reached, and why the others may not be;
    empty if not asked for.
    """
    if state.safe_state is None:
        return ""
    parts = state.safe_state.parts
    if not parts:
        return "the robot has neither attention nor lifelike movement to switch off"
    off = [part.what for part in parts if part.failure is None]
    texts = [f"{' and '.join(off)} {'are' if len(off) > 1 else 'is'} off"] if off else []
    for part in parts:
        if part.failure is not None and part.failure.cause in UNCERTAIN:
            texts.append(f"whether {part.what} is off is not known: {cause(part.failure)}")
        elif part.failure is not None:
            texts.append(f"{part.what} could not be switched off: {cause(part.failure)}")
    return clean("; ".join(texts))


def ordinal(number: int) -> str:
    """Return 1st, 2nd, 3rd, 4th …"""
    ending = {1: "st", 2: "nd", 3: "rd"}.get(number % 10, "th") if number // 10 % 10 != 1 else "th"
    return f"{number}{ending}"


def _sentence(state: State, kind: str, severity: str, text: str, uid: int = 0, path: str = "",
              incident: float = 0.0) -> Sentence:
    visit = state.visit
    kind = kind if kind in KINDS else "notice"
    severity = severity if severity in SEVERITIES else "warning"
    return Sentence(state.at, visit.number if visit is not None else 0, kind, severity, clean(text),
                    uid or state.uids.get(path, 0), clean(path), incident)


def _incident(state: State, failure: Failure, path: str) -> float:
    """Return when that began which a failure belongs to: the trouble of its service, or the first
    failure of its step.
    """
    failures = state.failures.get(path, ())
    first = failures[0].at if failures else state.at
    return min(first, state.robot.ill_since.get(failure.resource, first))


def _run_started(before: State, event: RunStarted, after: State) -> Iterator[Sentence]:
    name, leaves = mission_name(event.mission), len(event.leaves)
    yield _sentence(after, "notice", "info", f"mission {name} starts, {leaves} mission leaves")


def _run_finished(before: State, event: RunFinished, after: State) -> Iterator[Sentence]:
    for visit in after.concluded(Visit):
        if visit.arrived is not None:
            yield _sentence(after, "visit", "warning",
                            f"visitor {visit.number}: {how_it_ended(visit)}")
    yield _sentence(after, "notice", "info", f"ends: {event.outcome} (exit code {event.exit_code})")


def _pass_finished(before: State, event: PassFinished, after: State) -> Iterator[Sentence]:
    visit = after.visit
    if visit is not None:
        yield _sentence(after, "visit", "info" if visit.outcome == "SUCCESS" else "warning",
                        f"pass {event.number}: {event.outcome} after {visit.seconds:.1f} s: "
                        f"{how_it_ended(visit)}")


def _leaf_finished(before: State, event: LeafFinished, after: State) -> Iterator[Sentence]:
    if event.summary is not None:
        text = _met(before, after, event.summary.mark) or event.summary.text
        if text:
            yield _sentence(after, event.summary.kind, "info", text, event.uid, event.path)
    for failed in after.concluded(LeafFailure):
        if not failed.is_false_condition:
            yield _sentence(after, "failure", "warning", why_failed(failed.node, failed.failure),
                            failed.uid, failed.path, _incident(after, failed.failure, failed.path))


def _met(before: State, after: State, mark: str) -> str:
    """Return the sentence for a visitor who was seen, or looked at the robot, for the first time.
    """
    if mark not in ("arrived", "engaged") or before.visit is None or after.visit is None:
        return ""
    if getattr(before.visit, mark) is not None:
        return ""
    what = "arrived" if mark == "arrived" else "looks at the robot"
    return f"visitor {after.visit.number} {what}"


def _stop_changed(before: State, event: StopChanged, after: State) -> Iterator[Sentence]:
    for stop in after.concluded(Stop):
        how = "is completed" if stop.why is None else "is broken off: " + why(stop.why)
        yield _sentence(after, "stop", "info" if stop.why is None else "warning",
                        f"{stop_name(stop)}, {how}", event.uid, event.path)
    if event.state == BEGUN and after.stop is not None:
        yield _sentence(after, "stop", "info", stop_name(after.stop), event.uid, event.path)


def _recovering(before: State, event: Recovering, after: State) -> Iterator[Sentence]:
    # the first failure has its sentence already
    cause_of = ": " + cause(event.failure) if event.attempt > 1 else ""
    yield _sentence(after, "recovery", "info", recovering(event) + cause_of, 0, event.path,
                    _incident(after, event.failure, event.path))


def _recovered(before: State, event: Recovered, after: State) -> Iterator[Sentence]:
    stop, incident = next(after.concluded(Stop), None), _incident(before, event.failure, event.path)
    if stop is not None and incident < stop.began:
        incident = 0.0  # an entry of its own: that of the trouble stands far above
    text = why(why_recovered(before, event) if stop is None else stop.why)
    if stop is not None and event.outcome == SKIPPED:
        yield _sentence(after, "stop", "warning", f"{stop_name(stop)}, is left out: {text}", 0,
                        event.path, incident)
    elif stop is not None or event.outcome == GIVEN_UP:
        if before.has_given_up(event):
            return
        kind, words = "recovery", "gave up: " + text
        if stop is not None:
            kind, words = "stop", f"{stop_name(stop)}, is broken off: {text}"
        severity = "warning" if event.failure.cause is Cause.CONDITION_FALSE else "error"
        yield _sentence(after, kind, severity, words, 0, event.path, incident)
    else:
        severity, words = _done(before, event, text)
        yield _sentence(after, "recovery", severity, words, 0, event.path, incident)


def _done(before: State, event: Recovered, needed: str) -> Tuple[str, str]:
    """Return severity and sentence of a recovery after which the mission goes on."""
    if event.outcome == SKIPPED:
        needed = needed.replace(" failed", ", which failed", 1)
        return "warning", f"went on without {needed}"
    substitute = next((recovery.substitute for recovery in before.recoveries
                       if recovery.path == event.path), None)
    if event.outcome == SUBSTITUTED and substitute is not None:
        return "warning", f"did {substitute} in place of {event.node}: {cause(event.failure)}"
    return "info", f"{event.node} is done at the {ordinal(event.attempts + 1)} try"


def _paused(before: State, event: Paused, after: State) -> Iterator[Sentence]:
    to_do = ": restart it"
    if not event.awaited:
        to_do = f"{';' if event.reason else ':'} failed last: {cause(event.failure)}: repair it"
    yield _sentence(after, "recovery", "warning",
                    waiting(event) + to_do + "; the mission goes on by itself",
                    incident=_incident(after, event.failure, ""))


def _safe_state_reported(before: State, event: SafeStateReported,
                         after: State) -> Iterator[Sentence]:
    is_reached = all(part.failure is None for part in event.parts)
    failed = [recovery.failures[-1] for recovery in before.recoveries if recovery.failures]
    incident = _incident(before, failed[-1].failure, failed[-1].path) if failed else 0.0
    yield _sentence(after, "notice", "info" if is_reached else "warning", safe_state(after),
                    incident=incident)


def _health_changed(before: State, event: HealthChanged, after: State) -> Iterator[Sentence]:
    """Say nothing of a trouble while a stronger one is known."""
    strongest = after.robot.trouble(event.name)
    if strongest is not None and rank(strongest) < rank(event):
        return
    since = before.robot.ill_since.get(event.name, after.robot.ill_since.get(event.name, 0.0))
    yield _sentence(after, "health", "info" if event.is_well else "warning", health_text(event),
                    incident=since)


def health_text(event: HealthChanged) -> str:
    """Return how a service, topic or the master is, and what that means."""
    node = f" (of node /{event.node})" if event.node else ""
    then = "; " + event.consequence if event.consequence else ""
    return clean(f"{event.kind} {event.name}{node}: {event.status}{then}")


def _noticed(before: State, event: Noticed, after: State) -> Iterator[Sentence]:
    yield _sentence(after, "notice", event.level, event.text)


def _suspended(before: State, event: Suspended, after: State) -> Iterator[Sentence]:
    due = " as soon as the robot has done what it does now" if event.is_due else ""
    yield _sentence(after, "notice", "info",
                    event.words + due or "goes on, started by the operator")


def _breakpoint_changed(before: State, event: BreakpointChanged,
                        after: State) -> Iterator[Sentence]:
    name = event.path.rpartition("/")[2].partition("::")[0]
    words = f"held by a breakpoint of Groot2 at {name}"
    if event.is_held:
        yield _sentence(after, "notice", "warning", words, event.uid, event.path)
    elif event.uid in before.held:  # it is released, or halted
        yield _sentence(after, "notice", "info", "no longer " + words, event.uid, event.path)


_Words = Callable[[State, Any, State], Iterator[Sentence]]  # type: ignore[explicit-any]

_WORDS: Dict[type, _Words] = {
    RunStarted: _run_started,
    RunFinished: _run_finished,
    PassFinished: _pass_finished,
    LeafFinished: _leaf_finished,
    StopChanged: _stop_changed,
    Recovering: _recovering,
    Recovered: _recovered,
    HealthChanged: _health_changed,
    Paused: _paused,
    SafeStateReported: _safe_state_reported,
    BreakpointChanged: _breakpoint_changed,
    Suspended: _suspended,
    Noticed: _noticed,
}
"""What is said of each kind of event; the others have no sentence."""
