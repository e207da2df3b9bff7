"""What is shown of a run: the same for now, for an earlier moment, and for each moment of a record.
"""
import collections
import time
from typing import Any, Deque, Dict, List, NamedTuple, Tuple

from msgspec.structs import asdict

from behavior_controller.run.events import Event, PassStarted, TreeShown, clock_shift
from behavior_controller.run.state import Exchange, NodeResult, State, Step, Visit, step_over
from behavior_controller.viewer import parts
from behavior_controller.run import story
from behavior_controller.run.moment import card, robot_line
from behavior_controller.robot.gateway import Failure

SENTENCES = 100
"""Number of the newest sentences of the story that are kept."""

STEPS = 200
"""Number of the newest steps of a visit that are kept for its timeline."""

RESULTS = 5
"""Number of the newest results of a node that are kept."""

INSTANT = 0.01
"""Seconds; alike results of a node that each took less are joined."""


class Calls(NamedTuple):
    """How many calls of a service ended, how many failed, and the seconds of the last."""

    calls: int = 0
    failures: int = 0
    seconds: float = 0.0


class View(story.Story):
    """Keeps besides the state what is shown of what has ended.

    Each part of the board that is known for each moment has a method, which makes it.
    """

    stopped = ""
    """How the run ended if it does not say so itself."""

    def __init__(self, before: State = State()):
        super().__init__(before)
        self._sentences: Deque[parts.SentenceRow] = collections.deque(maxlen=SENTENCES)
        self._count = 0  # of all sentences
        self._steps: Deque[Step] = collections.deque(maxlen=STEPS)  # of this visit, that ended
        self._results: Dict[int, Deque[Tuple[NodeResult, int]]] = {}  # and how often in a row
        self.calls: Dict[str, Calls] = {}
        """The calls of each service so far."""

    def take(self, at: float, event: Event) -> Tuple[story.Sentence, ...]:
        """Fold the next event, and return the sentences about it."""
        before = self.state
        sentences = super().take(at, event)
        for sentence in sentences:
            self._count += 1
            self._sentences.append(parts.SentenceRow(
                **asdict(sentence), number=self._count, time=clock(sentence.at)))
        if isinstance(event, PassStarted):
            self._steps.clear()
        elif isinstance(event, TreeShown):  # the results are those of an earlier tree's nodes
            self._results.clear()
        ended_step = step_over(before, self.state)
        if ended_step is not None:
            self._steps.append(ended_step)
        for ended in self.state.concluded(NodeResult):
            self._end(ended)
        for exchange in self.state.concluded(Exchange):
            self._count_call(exchange)
        return sentences

    def _count_call(self, exchange: Exchange) -> None:
        if exchange.answered is not None:
            before = self.calls.get(exchange.service, Calls())
            self.calls[exchange.service] = Calls(
                before.calls + 1, before.failures + isinstance(exchange.result, Failure),
                exchange.answered - exchange.asked)

    def _end(self, ended: NodeResult) -> None:
        results = self._results.setdefault(ended.uid, collections.deque(maxlen=RESULTS))
        times = 1
        if results and _are_alike(results[-1][0], ended):
            times += results.pop()[1]
        results.append((ended, times))

    @property
    def ended(self) -> str:
        """How the run ended, and what was reached of the safe state; empty while it goes on."""
        outcome = story.run_end(self.state) or self.stopped
        return outcome and "; ".join(filter(None, (outcome, story.safe_state(self.state))))

    # ------------------------------------------------------------------------------------ the parts

    def changed(self, before: State) -> List[str]:
        """Return the parts that may have changed since ``before``; to make one takes longer than to
        fold an event."""
        now = self.state
        names = [name for name, fields in PARTS.items()
                 if any(_has_changed(getattr(before, field), getattr(now, field))
                        for field in fields)]
        # without a step, the card shows the statuses
        return names + (["now"] if "statuses" in names and now.step is None else [])

    def part(self, name: str) -> Any:
        """Return a part of the board."""
        return getattr(self, name)()

    def statuses(self) -> parts.Statuses:
        # the last in depth-first order: a running leaf, or what waits above it
        tip = self.state.letters.rfind("R") + 1
        # a recovery that runs does a failed node again
        failed = (self.state.uids.get(recovery.path, 0) for recovery in self.state.recoveries
                  if recovery.uid == tip)
        return parts.Statuses(self.state.letters, next(failed, 0) or tip)

    def now(self) -> parts.Now:
        state = self.state
        over = [visit for visit in state.visits if visit.ended is not None]
        last = f"visitor {over[-1].number}: {story.how_it_ended(over[-1])}" if over else ""
        return parts.Now(card(state), robot_line(state), state.visit_count, self.ended, last)

    def story(self) -> parts.StoryPart:
        visit = self.state.visit
        return parts.StoryPart(_visit(visit) if visit is not None else None, list(self._sentences))

    def visits(self) -> Dict[str, Any]:
        """Return the visits that ended, the newest last, and how many there were in words."""
        ended = [_visit(visit) for visit in self.state.visits if visit.ended is not None]
        return {"counted": story.counted(self.state), "newest": ended}

    def timeline(self) -> List[Dict[str, Any]]:
        """Return the steps of the visit that ended: when each began, and how long it took."""
        return list(map(_step, self._steps))

    def blackboard(self) -> Dict[str, str]:
        return {name: self._value(name, text) for name, text in sorted(self.state.entries.items())}

    def _value(self, name: str, text: str) -> str:
        """Return the value of an entry; a time of the mission's clock as the time of day."""
        visit = self.state.visit
        if name not in self.state.tree.times or visit is None:
            return text
        try:
            return clock(visit.began + float(text) - self.state.course.pass_began)
        except (ValueError, OverflowError):  # a script of the mission wrote something else
            return text

    def results(self, uid: int) -> List[Dict[str, Any]]:
        """Return how a node ended, the newest first."""
        return [_result(*result) for result in reversed(self._results.get(uid, ()))]


PARTS: Dict[str, Tuple[str, ...]] = {
    "mission": ("started", "tree"),
    "statuses": ("letters", "recoveries"),
    "now": ("starting", "started", "finished", "held", "suspended", "due", "steps", "exchanges",
            "robot", "visits", "safe_state", "tree", "failures"),
    "story": ("visits",),
    "visits": ("outcomes", "incomplete", "finished"),
    "timeline": ("steps", "visit_count"),
    "blackboard": ("entries", "tree"),
    "health": ("started", "robot"),
    "alive": ()}
"""All parts of the board in the order in which they are sent, and the fields of the model that each
shows."""

MOMENT = ("statuses", "now", "story", "visits", "timeline", "blackboard")
"""Those that are known for each moment."""


def clock(at: float) -> str:
    """Return the time of day of an event, as sentences show it."""
    return time.strftime("%H:%M:%S", time.localtime(at + clock_shift()))


def _has_changed(before: Any, now: Any) -> bool:
    return before is not now and before != now  # most are the same object


def _are_alike(one: NodeResult, other: NodeResult) -> bool:
    is_instant = max(one.ended - one.began, other.ended - other.began) < INSTANT
    return is_instant and (one.letter, one.failure) == (other.letter, other.failure)


def _step(step: Step) -> Dict[str, Any]:
    seconds = round((step.ended or step.began) - step.began, 2)
    return {"words": story.step_words(step), "began": step.began, "uid": step.uid,
            "is_wait": step.is_wait, "seconds": seconds}


def _result(last: NodeResult, times: int) -> Dict[str, Any]:
    return {"time": clock(last.ended), "letter": last.letter, "times": times,
            "seconds": last.ended - last.began,
            "why": story.cause(last.failure) if last.failure is not None else ""}


def _visit(visit: Visit) -> Dict[str, Any]:
    """Return a visit; ``degree``: how much of it was done, ``ending``: how it ended, in words."""
    stops = [dict(asdict(stop), why=story.why(stop.why)) for stop in visit.stops]
    return {"number": visit.number, "time": clock(visit.arrived or visit.began),
            "began": visit.began, "arrived": visit.arrived, "outcome": visit.outcome,
            "stops": stops, "degree": story.degree(visit), "ending": story.how_it_ended(visit)}
