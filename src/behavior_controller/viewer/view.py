"""What is shown of a run: the same for now, for an earlier moment, and for each moment of a record.
"""
import collections
import contextlib
from typing import Any, Deque, Dict, Iterable, List, NamedTuple, Optional, Tuple

import msgspec
from msgspec.structs import asdict, replace

from behavior_controller.folders import mission_name
from behavior_controller.run.events import (
    HANGS, Event, HealthChanged, PassStarted, PortText, TreeNode, TreeShown, clock_shift, unix_now)
from behavior_controller.run.state import (
    Exchange, LeafFailure, NodeResult, State, Step, Visit, rank, step_over)
from behavior_controller.viewer import parts
from behavior_controller.viewer.values import VisitValues
from behavior_controller.run import story
from behavior_controller.run.moment import card, robot_line
from behavior_controller.run.readiness import is_ready, readiness
from behavior_controller.run.statistics import time_of
from behavior_controller.text import clean, joined

SENTENCES = 100
"""Number of the newest sentences of the story that are kept."""

STEPS = 200
"""Number of the newest steps of a visit that are kept for its timeline."""

RESULTS = 5
"""Number of the newest results of a node that are kept."""

LONGEST_PORT = 120
"""The most characters of a port's text."""

CONTROLLER_STOPPED = "the controller has stopped"
"""How a run ended that does not say so itself."""

INSTANT = 0.01
"""Seconds; alike results of a node that each took less are joined."""


LANGUAGE_CODES = {"Kinyarwanda": "rw", "IsiZulu": "zu"}
"""The codes of the languages of robots that the page is not in, for screen readers."""


class Calls(NamedTuple):
    """How many calls of a service ended, how many failed, and the seconds of the last."""

    calls: int = 0
    failures: int = 0
    seconds: float = 0.0


class View(story.Story):
    """Keeps besides the state what is shown of what has ended.

    Each part of the board has a method, which makes it.
    """

    stopped = ""
    """How the run ended if it does not say so itself."""

    def __init__(self, before: State = State()):
        super().__init__(before)
        self._sentences: Deque[parts.SentenceRow] = collections.deque(maxlen=SENTENCES)
        self._count = 0  # of all sentences
        # of this visit, that ended, and whether each failed
        self._steps: Deque[Tuple[Step, bool]] = collections.deque(maxlen=STEPS)
        self._results: Dict[int, Deque[Tuple[NodeResult, int]]] = {}  # and how often in a row
        self.visit_values = VisitValues()
        self.visit_values.take(before, self.blackboard())
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
            self.visit_values.begin()
        elif isinstance(event, TreeShown):  # the results are those of an earlier tree's nodes
            self._results.clear()
        ended_step = step_over(before, self.state)
        if ended_step is not None:
            has_failed = any(failed.uid == ended_step.uid and not failed.is_false_condition
                             for failed in self.state.concluded(LeafFailure))
            self._steps.append((ended_step, has_failed))
        for ended in self.state.concluded(NodeResult):
            self._end(ended)
        for exchange in self.state.concluded(Exchange):
            self._count_call(exchange)
        if isinstance(event, PassStarted) or _change(VALUES, before, self.state):
            self.visit_values.take(self.state, self.blackboard())
        return sentences

    def _count_call(self, exchange: Exchange) -> None:
        if exchange.answered is not None:
            calls, failures, _ = self.calls.get(exchange.service, Calls())
            failures += exchange.failure is not None
            seconds = round(exchange.answered - exchange.asked, 3)
            self.calls[exchange.service] = Calls(calls + 1, failures, seconds)

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
        return outcome and joined("; ", outcome, story.safe_state(self.state))

    # ------------------------------------------------------------------------------------ the parts

    def changed(self, before: State) -> List[str]:
        """Return the parts that may have changed since ``before``; to make one takes longer than to
        fold an event."""
        now = self.state
        names = [name for name, fields in PARTS.items() if _change(fields, before, now)]
        if "statuses" in names and now.step is None:  # which the card shows then
            names.append("now")
        return names

    def part(self, name: str) -> Any:
        """Return a part of the board as data that JSON can carry."""
        return msgspec.to_builtins(getattr(self, name)())

    def shown(self, names: Iterable[str]) -> Dict[str, Any]:
        """Return some parts of the board, likewise."""
        return {name: self.part(name) for name in names}

    def mission(self) -> parts.MissionPart:
        nodes = [_row(uid, node) for uid, node in enumerate(self.state.nodes, 1)]
        started = self.state.started
        if started is None:
            return parts.MissionPart("", nodes)
        if nodes:  # as py-trees-render has it
            nodes[0] = replace(nodes[0], name=clean(mission_name(started.mission)), kind="")
        return parts.MissionPart(clean(started.mission), nodes,
                                 clean(str(started.settings.get("robot", ""))), self.language)

    @property
    def language(self) -> str:
        """The code of the language that the robot speaks; empty: that of the page, or unknown."""
        said = [check.name for check in self.state.checks.values() if check.kind == "language"]
        usual = str(self.state.start.settings.get("language", ""))
        return LANGUAGE_CODES.get((said or [usual])[0], "")

    def statuses(self) -> parts.Statuses:
        # the last in depth-first order: a running leaf, or what waits above it
        tip = self.state.letters.rfind("R") + 1
        # a recovery that runs does a failed node again
        failed = (self.state.uids.get(recovery.path, 0) for recovery in self.state.recoveries
                  if recovery.uid == tip)
        return parts.Statuses(self.state.letters, next(failed, 0) or tip)

    def now(self) -> parts.Now:
        state = self.state
        over, last = self._ended_visits(), ""
        if over:
            last = f"visitor {over[-1].number}: {story.how_it_ended(over[-1])}"
        return parts.Now(card(state), robot_line(state), state.visit_count, self.ended, last)

    def story(self) -> parts.StoryPart:
        visit = self.state.visit
        return parts.StoryPart(_visit(visit) if visit is not None else None, list(self._sentences))

    def visits(self) -> Dict[str, Any]:
        """Return the visits that ended, the newest last, and how many there were in words."""
        newest = list(map(_visit, self._ended_visits()))
        return {"counted": story.counted(self.state), "newest": newest}

    def _ended_visits(self) -> List[Visit]:
        return [visit for visit in self.state.visits
                if visit.ended is not None and not visit.is_empty]

    def timeline(self) -> List[Dict[str, Any]]:
        """Return the steps of the visit that ended: when each began, and how long it took."""
        return [_step(*ended) for ended in self._steps]

    def values(self) -> parts.Values:
        return self.visit_values.part()

    def blackboard(self) -> Dict[str, str]:
        return {name: self._value(name, text) for name, text in sorted(self.state.entries.items())}

    def _value(self, name: str, text: str) -> str:
        """Return the value of an entry; a time of the mission's clock as the time of day."""
        visit = self.state.visit
        if name not in self.state.tree.times or visit is None:
            return text
        # a script of the mission may have written something else
        with contextlib.suppress(ValueError, OverflowError):
            return clock(visit.began + float(text) - self.state.course.pass_began)
        return text

    def offers(self) -> Dict[str, parts.Offer]:
        """Return how each service and topic is, by name."""
        state = self.state
        names = {**state.start.offers, **{change.name: change.kind for change in state.robot.ill}}
        return {name: _offer(name, kind, state.robot.trouble(name)) for name, kind in names.items()}

    def ready(self) -> parts.Ready:
        rows = readiness(self.state, bool(self.stopped))
        return parts.Ready(rows, is_ready(rows))

    def health(self) -> Dict[str, parts.Offer]:
        """Return this with what is known for now only: how often each was called, or heard last."""
        offers = {}
        for name, offer in self.offers().items():
            if name in self.calls:
                offer = replace(offer, **self.calls[name]._asdict())
            if name in self.state.heard:
                offer = replace(offer, age=round(unix_now() - self.state.heard[name], 1))
            offers[clean(name)] = offer
        return offers

    def alive(self) -> parts.Alive:
        age = None
        if self.state.alive is not None and not self.ended:
            age = round(unix_now() - self.state.alive, 1)
        return parts.Alive(age, age is not None and age >= HANGS, unix_now(),
                           clock_shift=clock_shift())

    def node(self, uid: int) -> Optional[Dict[str, Any]]:
        """Return the details of a node: its place, ports with values, last results; None if it does
        not exist."""
        tree = self.state.tree
        if not 1 <= uid <= len(tree.nodes):
            return None
        node, results = tree.nodes[uid - 1], reversed(self._results.get(uid, ()))
        return {"uid": uid, "path": node.path, "type": node.type,
                "description": tree.summaries.get(node.type, ""), "place": node.place,
                "ports": list(map(self._port, node.ports)),
                "results": [_result(*result) for result in results]}

    def _port(self, port: PortText) -> Dict[str, str]:
        """Return a port of a node: its name and text, and the value of the entry that it refers to.
        """
        # without a value nothing has written it
        value = port.entry and self.state.entries.get(port.entry, "–")
        return {"name": port.name, "text": clean(port.text, LONGEST_PORT), "value": value}


PARTS: Dict[str, Tuple[str, ...]] = {
    "mission": ("started", "tree"), "statuses": ("letters", "recoveries"),
    "now": ("starting", "started", "finished", "held", "suspended", "resume", "due", "steps",
            "exchanges", "robot", "visits", "safe_state", "tree", "failures", "recoveries"),
    "story": ("visits",),
    "ready": ("checks", "said", "starting", "started", "finished", "robot"),
    "visits": ("visit_results", "finished"), "timeline": ("steps", "visit_count"), "values": (),
    "blackboard": ("entries", "tree"), "health": ("started", "robot"), "alive": ()}
"""All parts of the board in the order in which they are sent, and the fields of the model that each
shows."""

MOMENT = ("statuses", "now", "story", "visits", "timeline", "values", "blackboard")
"""Those that are known for each moment."""

VALUES = ("robot", "said", "visits", "entries", "tree")
"""The fields of the model that have the values of a visit."""


def clock(at: float) -> str:
    """Return the time of day of an event, as sentences show it."""
    return time_of(at + clock_shift())


def _row(uid: int, node: TreeNode) -> parts.NodeRow:
    return parts.NodeRow(uid, node.parent, node.label, node.kind, clean(node.path),
                         node.type == "SubTree", node.is_bare)


def _offer(name: str, kind: str, trouble: Optional[HealthChanged]) -> parts.Offer:
    if trouble is None:
        return parts.Offer(kind, clean(name), True, "", "")
    text = clean(f"{story.condition(trouble)}; {trouble.consequence}")
    return parts.Offer(kind, clean(name), False, clean(trouble.status), clean(trouble.consequence),
                       text, rank(trouble))


def _change(fields: Iterable[str], before: State, now: State) -> bool:
    """Return whether one of these fields is another one; most are the same object."""
    pairs = ((getattr(before, field), getattr(now, field)) for field in fields)
    return any(old is not new and old != new for old, new in pairs)


def _are_alike(one: NodeResult, other: NodeResult) -> bool:
    is_instant = max(one.ended - one.began, other.ended - other.began) < INSTANT
    return is_instant and (one.letter, one.failure) == (other.letter, other.failure)


def _step(step: Step, has_failed: bool) -> Dict[str, Any]:
    seconds = round((step.ended or step.began) - step.began, 2)
    return {"words": story.step_words(step), "began": step.began, "uid": step.uid,
            "is_wait": step.is_wait, "failed": has_failed, "seconds": seconds}


def _result(last: NodeResult, times: int) -> Dict[str, Any]:
    return {"time": clock(last.ended), "letter": last.letter, "times": times,
            "seconds": last.ended - last.began, "why": story.cause(last.failure)}


def _visit(visit: Visit) -> Dict[str, Any]:
    """Return a visit; ``ending``: how it ended, in words."""
    stops = [dict(asdict(stop), why=story.why(stop.why), is_left=stop.is_left)
             for stop in visit.stops]
    return {"number": visit.number, "time": clock(visit.arrived or visit.began),
            "began": visit.began, "arrived": visit.arrived, "outcome": visit.outcome,
            "stops": stops, "result": visit.result if visit.ended is not None else "",
            "ending": story.how_it_ended(visit)}
