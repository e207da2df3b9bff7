"""The state of a running mission as plain data: the page and ``missionStatus`` show it."""
import collections
import itertools
import time
from functools import partial
from typing import Any, Callable, Deque, Dict, List, NamedTuple, Optional, Tuple

from behavior_controller.bt.engine.clock import Clock
from behavior_controller.bt.engine.node import Node, label
from behavior_controller.bt.engine.tree import Change, Tree
from behavior_controller.bt.language.ports import PortError, entry_value, reference
from behavior_controller.bt.registry import Kind, NodeSpec, Registry
from behavior_controller.bt.status import FAILURE, IDLE, RUNNING
from behavior_controller.events import (Event, Events, HealthChanged, LeafFinished, PassFinished, PassStarted,
                                        RunFinished, RunStarted)
from behavior_controller.gateway import Failure
from behavior_controller.health import Health
from behavior_controller.interface import Interface
from behavior_controller.interface.robots import DEFAULT
from behavior_controller.story import KEPT as VISITS
from behavior_controller.story import Sentence, Step, Story, Visit, cause, title
from behavior_controller.text import clean
from behavior_controller.watch.codec import LETTERS

KEPT = 40
"""Number of the newest passes and lines of trouble that are kept."""

TOLD = 100
"""Number of the newest sentences of the story that are kept."""

STEPS = 200
"""Number of the newest steps of a visit that are kept for its timeline."""

RESULTS = 5
"""Number of the newest results of a node that are kept."""

INSTANT = 0.01
"""Seconds; alike results of a node that each took less are joined."""

PULSE = 1.0
"""Seconds between two signs of life: of the tick thread to the board, and of the board to those that show it."""

HANGS = 3.0
"""Seconds without a sign of the tick thread after which it hangs."""

MOST_WAITING = 10_000
"""The most events and traversals that wait for ``look``; of what more traversals change only the newest status is shown."""

PARTS = ("mission", "statuses", "passes", "story", "visits", "timeline", "blackboard", "trouble", "health", "alive")
"""The parts of the board; each is sent again when it has changed, the last one with every ``PULSE``."""


class Result(NamedTuple):
    """How a node ended: when (monotonic seconds), S, F or - (halted), after how long, why it failed, how often in a row."""

    at: float
    letter: str
    seconds: float
    failure: Optional[Failure]
    times: int


class Board:
    """Queues what happens on the tick thread, without waking another; the thread that shows it does the rest.

    That thread calls ``look``, ``part`` and ``node``; ``versions`` changes its number when a part has changed.
    """

    def __init__(self, events: Events, health: Health, registry: Registry, interface: Interface = DEFAULT):
        self.versions: Dict[str, int] = dict.fromkeys(PARTS, 0)
        self._numbers = itertools.count(1)  # of all parts together: two threads may change one at the same time
        self.tree: Optional[Tree] = None
        self.mission = ""
        self._registry = registry
        # a small letter is the status before the node went back to IDLE; -: it was not ticked in this pass
        self._statuses: List[str] = []
        self._began: Dict[int, float] = {}  # when each node that is RUNNING became so
        self._results: Dict[int, Deque[Result]] = {}
        self._failures: Dict[int, Deque[Failure]] = {}  # of the leaves in this traversal, until their nodes end with them
        self._news: Deque[Callable[[], None]] = collections.deque()  # what ``look`` has to do
        self._has_missed = False  # a change of status
        self._writes = 0
        self._ended = ""
        self._is_closed = False
        self._beaten = 0.0
        self._story = Story()
        self._now, self._step, self._visit = "", self._story.step, self._story.visit
        self._visits: Deque[Tuple[Visit, str]] = collections.deque(maxlen=VISITS)  # that ended, and what was told of it
        self._told: Deque[Tuple[int, Sentence]] = collections.deque(maxlen=TOLD)
        self._trouble: Deque[Sentence] = collections.deque(maxlen=KEPT)
        self._steps: Deque[Tuple[Step, float]] = collections.deque(maxlen=STEPS)  # of this visit, and when each ended
        self._state = health
        self._called, self._pulsed = 0, 0.0
        self._health: Dict[str, Dict[str, Any]] = {}
        for kind, offers in (("service", interface.services), ("topic", interface.topics)):
            for offer in offers:
                self._health[offer.name] = {"kind": kind, "name": offer.name, "well": True, "status": "",
                                            "consequence": "", "told": ""}
        events.subscribe(lambda event: self._news.append(partial(self._take, time.time(), event)))

    def show(self, tree: Tree) -> None:
        """Show ``tree`` from now on. On the tick thread, which gives a sign of life through the tree's clock."""
        if not self._beaten:
            self._beat(tree.clock)
        tree.follow(self._note)
        self._news.append(partial(self._begin, tree))

    def close(self) -> None:
        """Note that the controller ends. Any thread may call it."""
        self._is_closed = True
        self._touch("passes")

    def _beat(self, clock: Clock) -> None:
        self._beaten = time.monotonic()
        clock.call_after(PULSE, lambda: self._beat(clock))

    def _note(self, is_first: Optional[bool], changes: List[Change]) -> None:
        if not changes:
            return
        if len(self._news) < MOST_WAITING:
            self._news.append(partial(self._change, time.monotonic(), changes))
        else:
            self._has_missed = True

    # ----------------------------------------------------------------------------------------------- what has happened

    def look(self) -> None:
        """Process what has happened: events, written entries, calls that ended, topics that become older."""
        self._catch_up()
        writes = self.tree.blackboard.writes if self.tree is not None else 0
        if writes != self._writes:
            self._writes = writes
            self._touch("blackboard")
        called = sum(count.calls for count in self._state.calls.values())
        if called != self._called:
            self._called = called
            self._touch("health")
        now = time.monotonic()
        if now - self._pulsed >= PULSE:
            self._pulsed = now
            self._touch("alive", "health")

    def _catch_up(self) -> None:
        while self._news:
            self._news.popleft()()
        if self._has_missed and self.tree is not None:
            self._has_missed = False
            self._statuses[1:] = [LETTERS[node.status] for node in self.tree.nodes]
        now = self._story.now(time.time())
        if now != self._now:
            self._now = now
            self._touch("passes")

    def _touch(self, *parts: str) -> None:
        for part in parts:
            self.versions[part] = next(self._numbers)

    def _begin(self, tree: Tree) -> None:
        """Clear the data of the earlier tree."""
        self._results.clear()
        self._began.clear()
        self._statuses = ["-"] * (len(tree.nodes) + 1)
        self.tree = tree
        self._touch("mission", "statuses", "passes", "blackboard")

    def _change(self, at: float, changes: List[Change]) -> None:
        """Keep the new statuses, and how nodes ended, ``at`` that time (monotonic)."""
        for node, old, new in changes:
            uid = node.uid
            self._statuses[uid] = LETTERS[new] if new is not IDLE else LETTERS[old].lower()
            if new is RUNNING:
                self._began[uid] = at
            elif new is not IDLE or old is RUNNING:
                self._end(uid, LETTERS[new], at)
        self._failures.clear()
        self._touch("statuses")

    def _end(self, uid: int, letter: str, at: float) -> None:
        failures = self._failures.get(uid) if letter == LETTERS[FAILURE] else None
        seconds, failure, times = at - self._began.pop(uid, at), failures.popleft() if failures else None, 1
        results = self._results.get(uid)
        if results is None:
            results = self._results[uid] = collections.deque(maxlen=RESULTS)
        elif seconds < INSTANT and results[-1].letter == letter and results[-1].failure == failure:
            times += results.pop().times
        results.append(Result(at, letter, seconds, failure, times))

    def _take(self, at: float, event: Event) -> None:
        """Keep the parts of an event that are shown."""
        if isinstance(event, RunStarted):
            self.mission = event.mission
            self._touch("mission")
        elif isinstance(event, PassStarted):
            self._statuses[1:] = "-" * (len(self._statuses) - 1)
            self._steps.clear()
            self._touch("statuses", "passes", "timeline")
        elif isinstance(event, LeafFinished) and event.failure is not None:
            self._failures.setdefault(event.uid, collections.deque(maxlen=RESULTS)).append(event.failure)
        elif isinstance(event, RunFinished):
            self._ended = event.outcome
            self._touch("passes")
        told = self._tell(at, event)
        if isinstance(event, HealthChanged):
            entry = self._health.setdefault(event.name, {"kind": event.kind, "name": event.name})
            entry.update(well=event.is_well, status=clean(event.status), consequence=event.consequence,
                         told=told[0].text if told else "")
            self._touch("health")
        if isinstance(event, PassFinished) and self._visit is not None:
            self._visits.append((self._visit, told[-1].text if told else ""))
            self._touch("passes", "visits")

    def _tell(self, at: float, event: Event) -> Tuple[Sentence, ...]:
        """Pass an event to the story, and keep its sentences."""
        told = self._story.take(at, event)
        for sentence in told:
            self._told.append((self._told[-1][0] + 1 if self._told else 1, sentence))
            if sentence.severity != "info" and sentence.kind != "health":  # which is a part of its own
                self._trouble.append(sentence)
                self._touch("trouble")
            self._touch("story")
        if self._story.visit is not self._visit:
            self._visit = self._story.visit
            self._touch("story")
        if self._story.step is not self._step:
            if self._step is not None:
                self._steps.append((self._step, at))
            self._step = self._story.step
            self._touch("story", "timeline")
        return told

    # ------------------------------------------------------------------------------------------------- to be shown

    def part(self, name: str) -> Any:
        """Return one part as data that JSON can carry."""
        self._catch_up()
        return getattr(self, "_part_" + name)()

    def _part_mission(self) -> Dict[str, Any]:
        """Return the nodes in document order, each with its parent's uid: a list, since a tree may be very deep."""
        nodes = [] if self.tree is None else [self._outline(node) for node in self.tree.nodes]
        if nodes and self.mission:
            # as py-trees-render has it
            nodes[0].update(name=title(self.mission), kind="")
        return {"file": self.mission, "nodes": nodes}

    def _outline(self, node: Node) -> Dict[str, Any]:
        """Return the row of a node in the tree."""
        spec = self._registry.find(node.registration_id)
        name, kind = label(node)
        return {"uid": node.uid, "parent": node.parent.uid if node.parent else 0, "name": name, "kind": kind,
                "path": node.full_path, "subtree": spec is not None and spec.kind is Kind.SUBTREE,
                "bare": self.is_bare(node)}

    def is_bare(self, node: Node) -> bool:
        """Whether the operator's view leaves ``node`` out."""
        return node.parent is not None and is_bare(self._registry.find(node.registration_id), node.name)

    def _part_statuses(self) -> Dict[str, Any]:
        letters = "".join(self._statuses[1:])
        tip = letters.rfind("R") + 1  # the last in depth-first order: a running leaf, or what waits above it
        return {"letters": letters, "tip": tip}

    def _part_passes(self) -> Dict[str, Any]:
        """Return in the story's words what the robot does, how many visits began, and how the mission ended."""
        return {"count": self._story.visit_count, "ended": self._how_ended(), "text": self._now}

    def _how_ended(self) -> str:
        return self._ended or ("the controller has stopped" if self._is_closed else "")

    def _part_story(self) -> Dict[str, Any]:
        """Return the step under way, with its age in seconds, the visit that it belongs to, and the sentences."""
        step, visit = self._step, self._visit
        return {"step": None if step is None else dict(
                    _step(step), age=max(0.0, round(time.time() - step.began, 1)), limit=step.limit),
                "visit": None if visit is None else _visit(visit),
                "sentences": [dict(_sentence(each), number=number) for number, each in self._told]}

    def _part_visits(self) -> Dict[str, Any]:
        """Return the newest visits that ended, and how often each outcome was there among all."""
        return {"outcomes": dict(self._story.outcomes),
                "newest": [dict(_visit(visit), told=text) for visit, text in reversed(self._visits)]}

    def _part_timeline(self) -> Dict[str, Any]:
        """Return the steps of the visit that ended: when each began, in unix seconds, and how long it took."""
        return {"steps": [dict(_step(step), seconds=round(ended - step.began, 2)) for step, ended in self._steps]}

    def _part_alive(self) -> Dict[str, Any]:
        """Return how long ago, in seconds, the tick thread gave its last sign of life, and whether that is too long."""
        if self.tree is None or self._how_ended():
            return {"age": None, "hangs": False}
        age = round(time.monotonic() - self._beaten, 1)
        return {"age": age, "hangs": age >= HANGS}

    def _part_blackboard(self) -> List[List[str]]:
        tree = self.tree
        if tree is None:
            return []
        return [[path + "/" + key if path else key, _text(entry.value)]
                for path, board in list(tree.blackboards.items())
                for key, entry in sorted(dict(board.local).items()) if entry.value is not None]

    def _part_trouble(self) -> List[Dict[str, Any]]:
        return [_sentence(each) for each in self._trouble]

    def _part_health(self) -> List[Dict[str, Any]]:
        found = []
        for entry in self._health.values():
            calls, heard = self._state.calls.get(entry["name"]), self._state.heard.get(entry["name"])
            found.append(dict(entry, calls=calls.calls if calls else 0, failures=calls.failures if calls else 0,
                              seconds=round(calls.last_seconds, 3) if calls else None,
                              age=None if heard is None else round(time.monotonic() - heard, 1)))
        return found

    def node(self, uid: int) -> Optional[Dict[str, Any]]:
        """Return the details of a node: its place, ports with values, last results; None if it does not exist."""
        self._catch_up()
        nodes = self.tree.nodes if self.tree is not None else []
        if not 1 <= uid <= len(nodes):
            return None
        node = nodes[uid - 1]
        spec = self._registry.find(node.registration_id)
        return {"uid": uid, "path": node.full_path, "type": node.registration_id,
                "description": spec.summary if spec is not None else "", "place": node.place_in_file().rstrip(": "),
                "ports": [dict(zip(("name", "text", "value"), row)) for row in _ports(node)],
                "results": [_result(result) for result in reversed(self._results.get(uid, ()))]}


def port_texts(node: Node) -> Dict[str, str]:
    """Return for each port of a node what the file or the default says."""
    texts = {port.name: port.default for port in node.spec.ports if port.default is not None}
    texts.update(node.attributes)
    return texts


def _ports(node: Node) -> List[Tuple[str, str, str]]:
    """Return for each port of a node its name, its text, and the value of the entry that this means."""
    found = []
    for name, text in port_texts(node).items():
        value = ""
        if reference(text, name) is not None:
            try:
                value = _text(entry_value(text, name, node.blackboard))
            except PortError:
                value = "–"  # nothing has written it
        found.append((name, clean(text, 120), value))
    return found


def is_bare(spec: Optional[NodeSpec], name: str) -> bool:
    """Whether a node below the root, with that name, only says how the mission is put together."""
    return spec is not None and (spec.is_recovery or (
        spec.kind in (Kind.CONTROL, Kind.DECORATOR) and name == spec.id))


def clock(at: float) -> str:
    """Return the time of day, as sentences show it."""
    return time.strftime("%H:%M:%S", time.localtime(at))


def _sentence(sentence: Sentence) -> Dict[str, Any]:
    return dict(sentence._asdict(), time=clock(sentence.at))


def _result(result: Result) -> Dict[str, Any]:
    return {"time": clock(time.time() - time.monotonic() + result.at), "letter": result.letter, "times": result.times,
            "seconds": result.seconds, "why": cause(result.failure) if result.failure is not None else ""}


def _step(step: Step) -> Dict[str, Any]:
    return {"words": step.words, "began": step.began, "uid": step.uid, "is_wait": step.is_wait}


def _visit(visit: Visit) -> Dict[str, Any]:
    return dict(visit._asdict(), time=clock(visit.arrived or visit.began), exhibits=[
        shown._asdict() for shown in visit.exhibits])


def _text(value: Any) -> str:
    """Return a value as one line, short enough for a table."""
    text = str(value) if not isinstance(value, list) else ", ".join(getattr(item, "name", str(item)) for item in value)
    return clean(text, 120)
