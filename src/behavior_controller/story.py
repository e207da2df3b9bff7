"""Turns the events of a run into visits, the step under way and sentences; terminal, page, report and verdict show them.

A story is made from events alone, so a record gives the same sentences as the run itself. It holds a bounded number of
visits and never looks at a clock: each event comes with its time (unix seconds). All texts of its records are safe to
show, whatever they quote: see ``text.clean``.
"""
import collections
import os
from typing import Callable, Deque, Dict, List, NamedTuple, Optional, Tuple

from behavior_controller.events import (BEGUN, OMITTED, Event, HealthChanged, LeafFinished, Noticed, PassFinished,
                                        PassStarted, Recovered, Recovering, Retried, RunFinished, RunStarted,
                                        StepStarted, TourAdvanced)
from behavior_controller.gateway import Cause, Failure
from behavior_controller.recovery import GIVEN_UP, SKIPPED, SUBSTITUTED
from behavior_controller.text import clean

KEPT = 50
"""Number of the newest visits that a story keeps."""

UNDER_WAY, SHOWN, LEFT_OUT, BROKEN_OFF = "under way", "shown", "left out", "broken off"
"""The state of an exhibit."""

LEFT = "the visitor left"


class Sentence(NamedTuple):
    """A sentence about one event, in words for people and on one line.

    ``kind`` says what it is about (one of ``KINDS``), ``severity`` is info, warning or error; ``visit`` is 0 before the
    first. ``uid`` and ``path`` are those of the node that it leads to; 0 and empty if there is none.
    """

    at: float
    visit: int
    kind: str
    severity: str
    text: str
    uid: int
    path: str


KINDS = ("visit", "exhibit", "said", "heard", "asked", "pressed", "moved", "failure", "recovery", "health", "notice")


SEVERITIES = ("info", "warning", "error")


class ShownExhibit(NamedTuple):
    """One exhibit of a visit. ``why`` is the cause in a sentence where it was left out or broken off."""

    number: int  # from 1
    of: int
    name: str
    state: str
    why: str
    seconds: float

    def __str__(self) -> str:
        """Return ``exhibit 2 of 5, name``."""
        return "exhibit {} of {}, {}".format(self.number, self.of, self.name)


class Visit(NamedTuple):
    """One visitor's pass. Times are unix seconds, None for what has not happened; ``outcome`` is empty while under way."""

    number: int
    began: float
    arrived: Optional[float] = None
    engaged: Optional[float] = None
    asked: Optional[float] = None
    answer: str = ""  # yes or no; empty: none
    exhibits: Tuple[ShownExhibit, ...] = ()
    outcome: str = ""  # SUCCESS or FAILURE
    why: str = ""  # how it ended, in a sentence
    seconds: float = 0.0  # from the arrival to the end
    waited: float = 0.0  # seconds before the arrival


class Step(NamedTuple):
    """What the robot does or waits for. ``limit`` is in seconds; 0: it has none."""

    words: str
    began: float
    limit: float
    uid: int
    is_wait: bool


def cause(failure: Failure) -> str:
    """Return why something failed, in words that are safe to show."""
    message = clean(" ".join(failure.message.split()))
    if failure.cause is Cause.CONDITION_FALSE:
        return message.partition(";")[0]  # what follows tells of messages of the topic
    resource = " ({})".format(clean(failure.resource)) if failure.resource else ""
    return "{}, {}{}".format(failure.cause.text, message, resource)


def why_failed(node: str, failure: Failure, tries: int = 1) -> str:
    """Return in a sentence what failed, how often if that was tried again, and why; a condition is told by its answer."""
    if failure.cause is Cause.CONDITION_FALSE:
        return cause(failure) or "{} failed".format(node)
    return "{} failed{}: {}".format(node, " {} times".format(tries) if tries > 1 else "", cause(failure))


def title(mission: str) -> str:
    """Return the name of a mission, from its file."""
    return os.path.splitext(os.path.basename(mission))[0]


def ordinal(number: int) -> str:
    """Return 1st, 2nd, 3rd, 4th …"""
    ending = {1: "st", 2: "nd", 3: "rd"}.get(number % 10, "th") if number // 10 % 10 != 1 else "th"
    return "{}{}".format(number, ending)


class Story:
    """Takes events in order; what it has made of them may be read between two of them, on the same thread."""

    def __init__(self) -> None:
        self.visits: Deque[Visit] = collections.deque(maxlen=KEPT)
        self.visit_count = 0
        self.outcomes: Dict[str, int] = {}  # of all visits that ended: how many there were of each
        self._at = 0.0
        self._told: List[Sentence] = []  # of the event that is taken
        self._steps: Dict[int, Step] = {}  # under way, by uid, the newest last
        self._recoveries: Dict[str, Recovering] = {}  # under way, by the path of what failed
        self._uids: Dict[str, int] = {}
        self._exhibit_began = 0.0
        self._pass_began = self._met = 0.0  # when the pass began and the visitor came, on the mission's clock
        self._gave_up = ""  # why a failure was given up
        self._omitted = 0  # number of the exhibit that is not gone on with, until a Recovered says why
        self._forget_visit()
        self._takers: Dict[type, Callable[..., None]] = {  # type: ignore[explicit-any]
            RunStarted: self._run_started, PassStarted: self._pass_started, StepStarted: self._step_started,
            LeafFinished: self._leaf_finished, TourAdvanced: self._tour_advanced, Recovering: self._recovering,
            Retried: self._retried, Recovered: self._recovered, HealthChanged: self._health_changed,
            PassFinished: self._pass_finished, Noticed: self._noticed, RunFinished: self._run_finished}

    def _forget_visit(self) -> None:
        self._has_left = False  # the visitor is no longer seen
        self._is_unclear = False  # the visitor's answer was neither yes nor no
        self._given_up: Optional[Recovered] = None  # the last one in this visit
        self._handler = 0  # the HandleFallBack that ended last
        self._failed = 0, ""  # which leaf failed last in this visit, and why
        self._stuck = ""  # why it or a recovery failed, until a step begins or succeeds after that

    @property
    def visit(self) -> Optional[Visit]:
        """The visit under way, or else the last one."""
        return self.visits[-1] if self.visits else None

    @property
    def step(self) -> Optional[Step]:
        """What the robot does: of several things at once the one that began last."""
        return next(reversed(list(self._steps.values())), None)

    @property
    def exhibit(self) -> Optional[ShownExhibit]:
        """The exhibit under way."""
        last = self.visits[-1].exhibits[-1:] if self.visits else ()
        return last[0] if last and last[0].state == UNDER_WAY else None

    def take(self, at: float, event: Event) -> Tuple[Sentence, ...]:
        """Return what ``event`` adds to the story."""
        self._at, self._told = at, []
        self._takers[type(event)](event)
        return tuple(self._told)

    def now(self, at: float) -> str:
        """Return in one line what the robot does at that time, for how long, and until when at most."""
        parts: List[str] = []
        visit, exhibit, step = self.visit, self.exhibit, self.step
        if visit is not None and not visit.outcome and visit.arrived is not None:
            parts.append("visitor {}".format(visit.number))
        if exhibit is not None:
            parts.append(str(exhibit))
        if step is not None:
            limit = " of at most {:g} s".format(step.limit) if step.limit else ""
            parts.append("{}, {:.0f} s{}".format(step.words, at - step.began, limit))
        return " · ".join(parts)

    def _tell(self, kind: str, severity: str, text: str, uid: int = 0, path: str = "") -> None:
        number = self.visits[-1].number if self.visits else 0
        kind, severity = kind if kind in KINDS else "notice", severity if severity in SEVERITIES else "warning"
        self._told.append(Sentence(self._at, number, kind, severity, clean(text), uid or self._uids.get(path, 0),
                                   clean(path)))

    def _change(self, **changes: object) -> None:
        """Change fields of the visit."""
        if self.visits:
            changes.update((name, clean(value)) for name, value in changes.items() if isinstance(value, str))
            self.visits[-1] = self.visits[-1]._replace(**changes)  # type: ignore[arg-type]

    # ------------------------------------------------------------------------------------------------- run and visits

    def _run_started(self, event: RunStarted) -> None:
        self._steps.clear()
        self._uids.clear()
        self._tell("notice", "info", "mission {} starts, {} mission leaves".format(title(event.mission), len(event.leaves)))

    def _run_finished(self, event: RunFinished) -> None:
        visit = self.visit
        if visit is not None and not visit.outcome:
            self._end_exhibit("the robot was stopped")
            self._change(why="the robot was stopped")
        self._steps.clear()
        self._tell("notice", "info", "ends: {} (exit code {})".format(event.outcome, event.exit_code))

    def _pass_started(self, event: PassStarted) -> None:
        self.visit_count = event.number
        self.visits.append(Visit(event.number, self._at))
        self._steps.clear()
        self._recoveries.clear()
        self._forget_visit()
        self._pass_began = self._met = event.at

    def _pass_finished(self, event: PassFinished) -> None:
        visit = self.visit
        if visit is None:  # the record of this run has lost its beginning
            return
        is_success = event.outcome == "SUCCESS"
        self._end_exhibit(self._why_broken_off() if is_success else self._why_failed())
        why = self._why_done() if is_success else self._why_failed()
        waited = max(0.0, self._met - self._pass_began)
        self._change(outcome=event.outcome, why=why, seconds=event.seconds - waited, waited=waited)
        outcome = self.visits[-1].outcome
        self.outcomes[outcome] = self.outcomes.get(outcome, 0) + 1
        self._steps.clear()
        self._tell("visit", "info" if is_success else "warning", "pass {}: {} after {:.1f} s: {}".format(
            event.number, event.outcome, event.seconds - waited, why))

    def _why_done(self) -> str:
        visit = self.visits[-1]
        shown = sum(exhibit.state == SHOWN for exhibit in visit.exhibits)
        if self._has_left and visit.exhibits and visit.exhibits[-1].state == BROKEN_OFF:
            return self._why_failed()
        if visit.exhibits:
            return "the tour was given, {} of {} exhibits shown".format(shown, visit.exhibits[-1].of)
        if visit.answer == "no":
            return "the visitor did not want a tour"
        if visit.asked is None or visit.answer:
            return "done"
        return "the visitor answered neither yes nor no" if self._is_unclear else "the visitor did not answer"

    def _why_failed(self) -> str:
        exhibits = self.visits[-1].exhibits
        where = " at {}".format(exhibits[-1]) if exhibits and exhibits[-1].state == BROKEN_OFF else ""
        if self._has_left:
            return LEFT + where
        return "gave up{}: {}".format(where, self._gave_up) if self._given_up else self._failed[1] or "it failed"

    # ---------------------------------------------------------------------------------------------------------- steps

    def _step_started(self, event: StepStarted) -> None:
        exhibit, recovery = self.exhibit, self._recoveries.get(event.path)
        is_there = exhibit is not None and clean(event.what).partition(" ")[2] == exhibit.name
        retry = " (retry {} of {})".format(recovery.attempt, recovery.of) if recovery is not None else ""
        words = " ".join(filter(None, (event.words, "" if is_there else event.what)))
        self._uids[event.path] = event.uid
        self._begin(words + retry, event.limit, event.uid, event.is_wait)

    def _begin(self, words: str, limit: float, uid: int, is_wait: bool = False) -> None:
        """Start a step; this ends a wait."""
        self._stuck = self._stuck if is_wait else ""
        self._steps = {other: step for other, step in self._steps.items() if other != uid and not step.is_wait}
        self._steps[uid] = Step(clean(words), self._at, limit, uid, is_wait)

    def _leaf_finished(self, event: LeafFinished) -> None:
        self._uids[event.path] = event.uid
        is_false = event.failure is not None and event.failure.cause is Cause.CONDITION_FALSE
        step = self._steps.get(event.uid)
        # a wait goes on while its condition is false
        if step is not None and not (is_false and step.is_wait and not 0.0 < step.limit <= event.seconds):
            del self._steps[event.uid]
        if event.told is not None:
            self._note(event)
        if event.failure is not None and event.uid != self._handler:
            self._stuck = why_failed(event.node, event.failure)
            self._failed = event.uid, self._stuck
            if not is_false:
                self._tell("failure", "warning", self._stuck, event.uid, event.path)
        elif event.status == "SUCCESS":
            if event.uid == self._failed[0]:
                self._failed, self._stuck = (0, ""), ""
            if step is not None and not step.is_wait:
                self._stuck = ""

    def _note(self, event: LeafFinished) -> None:
        """Process a leaf's sentence at its end, and its meaning for the visit."""
        assert event.told is not None
        kind, text, mark, at = event.told
        visit = self.visit
        if mark == "left":
            self._has_left = visit is not None and visit.arrived is not None
        elif mark == "arrived" or mark == "engaged":
            self._has_left = False
            text = self._meet(mark, at) or text
        elif mark == "asked":
            self._change(asked=self._at if visit is None or visit.asked is None else visit.asked)
        elif mark:
            self._change(answer=mark)
        self._is_unclear = self._is_unclear or kind == "heard" and not mark
        if text:
            self._tell(kind, "info", text, event.uid, event.path)

    def _meet(self, mark: str, at: float) -> str:
        """Note that the visitor was seen, or looked at the robot, for the first time; return what is told of it."""
        visit = self.visit
        if visit is None or getattr(visit, mark) is not None:
            return ""
        if visit.arrived is None:
            self._met = at
        self._change(arrived=self._at if visit.arrived is None else visit.arrived)
        self._change(**{mark: self._at})
        return "visitor {} {}".format(visit.number, "arrived" if mark == "arrived" else "looks at the robot")

    # ------------------------------------------------------------------------------------------------------- exhibits

    def _tour_advanced(self, event: TourAdvanced) -> None:
        exhibit = self.exhibit
        if event.state == OMITTED:
            self._omitted = event.number
        elif exhibit is not None:
            why = self._why_broken_off()
            self._end_exhibit(why)
            self._tell("exhibit", "warning" if why else "info",
                       "{}, {}".format(exhibit, "is broken off: " + why if why else "was shown"), event.uid, event.path)
        if event.state == BEGUN:
            self._stuck = ""
            begun = ShownExhibit(event.number, event.of, clean(event.name), UNDER_WAY, "", 0.0)
            others = self.visits[-1].exhibits if self.visits else ()
            self._change(exhibits=tuple(each for each in others if each.number != event.number) + (begun,))
            self._exhibit_began = self._at
            self._tell("exhibit", "info", str(begun), event.uid, event.path)

    def _why_broken_off(self) -> str:
        """Return why the exhibit was not shown to its end; empty if it was: a step came after each that failed."""
        return LEFT if self._has_left else self._stuck

    def _end_exhibit(self, why: str, state: str = BROKEN_OFF) -> None:
        """Note that the exhibit under way ended so, or that it was shown if there is no ``why``."""
        exhibit = self.exhibit
        if exhibit is not None:
            ended = exhibit._replace(state=state if why else SHOWN, why=clean(why),
                                     seconds=self._at - self._exhibit_began)
            self._change(exhibits=self.visits[-1].exhibits[:-1] + (ended,))

    # ------------------------------------------------------------------------------------------------------- recovery

    def _recovering(self, event: Recovering) -> None:
        words = "doing {} in place of {}".format(event.substitute, event.node) if event.substitute else (
            "retrying {}, {} of {}".format(event.node, event.attempt, event.of))
        self._recoveries[event.path] = event
        self._begin(words, 0.0, event.uid)
        why = ": " + cause(event.failure) if event.attempt > 1 else ""  # the first failure has its sentence already
        self._tell("recovery", "info", words + why, 0, event.path)

    def _retried(self, event: Retried) -> None:
        self._steps.pop(self._uids.get(event.path, 0), None)  # the sentence about the recovery says why it failed

    def _recovered(self, event: Recovered) -> None:
        recovery = self._recoveries.pop(event.path, None)
        omitted, self._omitted = self._omitted, 0
        self._handler = event.uid
        self._steps.pop(self._uids.get(event.path, 0), None)
        self._failed = 0, ""
        why = (event.reason + "; " if event.reason else "") + why_failed(event.node, event.failure, event.attempts + 1)
        self._stuck = why if event.outcome == GIVEN_UP else ""
        if omitted and self._is_omitted(event, omitted, why):
            return
        if event.outcome == GIVEN_UP:
            self._give_up(event, "recovery", "gave up: " + why, why)
        elif event.outcome == SKIPPED:
            self._tell("recovery", "warning", "went on without {}".format(why.replace(" failed", ", which failed", 1)),
                       0, event.path)
        elif event.outcome == SUBSTITUTED and recovery is not None:
            self._tell("recovery", "warning", "did {} in place of {}: {}".format(
                recovery.substitute, event.node, cause(event.failure)), 0, event.path)
        else:
            self._tell("recovery", "info", "{} is done at the {} try".format(
                event.node, ordinal(event.attempts + 1)), 0, event.path)

    def _is_omitted(self, event: Recovered, number: int, why: str) -> bool:
        """Return whether an exhibit is not gone on with for it, and tell so."""
        exhibits = self.visits[-1].exhibits if self.visits else ()
        if not exhibits or exhibits[-1].number != number or exhibits[-1].state not in (UNDER_WAY, BROKEN_OFF):
            return False
        is_left_out = event.outcome == SKIPPED
        if not is_left_out and exhibits[-1].state == BROKEN_OFF:
            return False
        if self._has_left:
            why = LEFT
        self._change(exhibits=exhibits[:-1] + (exhibits[-1]._replace(state=UNDER_WAY),))
        self._end_exhibit(why, LEFT_OUT if is_left_out else BROKEN_OFF)
        if is_left_out:
            self._given_up = None
            self._tell("exhibit", "warning", "{}, is left out: {}".format(exhibits[-1], why), 0, event.path)
        else:
            self._give_up(event, "exhibit", "{}, is broken off: {}".format(exhibits[-1], why), why)
        return True

    def _give_up(self, event: Recovered, kind: str, text: str, why: str) -> None:
        """Note a failure that is given up, unless it is one that an inner HandleFallBack has given up already."""
        if self._given_up is None or self._given_up[:3] != event[:3]:
            severity = "warning" if event.failure.cause is Cause.CONDITION_FALSE else "error"
            self._tell(kind, severity, text, 0, event.path)
            self._gave_up = why
        self._given_up = event

    # ---------------------------------------------------------------------------------------------- health and notices

    def _health_changed(self, event: HealthChanged) -> None:
        self._tell("health", "info" if event.is_well else "warning", "{} {}{}: {}{}".format(
            event.kind, event.name, " (of node /{})".format(event.node) if event.node else "", event.status,
            "; " + event.consequence if event.consequence else ""))

    def _noticed(self, event: Noticed) -> None:
        if event.level == "error":
            self._failed = 0, event.text
        self._tell("notice", event.level, event.text)
