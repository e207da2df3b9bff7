"""The state of a running mission, kept for what shows it: page and ``missionStatus``."""
import time
from typing import Any, Dict, Optional, Tuple

import msgspec
from msgspec.structs import replace

from behavior_controller.bt.engine.clock import Clock
from behavior_controller.bt.engine.node import Node, label
from behavior_controller.bt.engine.ports import PortError, entry_value, reference
from behavior_controller.bt.engine.tree import Tree
from behavior_controller.bt.registry import Kind, NodeSpec, Registry
from behavior_controller.execution.events import (
    Event, Events, HealthChanged, Line, clock_shift, unix_now)
from behavior_controller.execution.health import Health
from behavior_controller.execution.run import History
from behavior_controller.execution.state import State, rank
from behavior_controller.folders import mission_name
from behavior_controller.monitoring.parts import Alive, MissionPart, NodeRow, Offer
from behavior_controller.monitoring.record.recorder import Feed, entry_text, shown
from behavior_controller.monitoring.story import Sentence, condition
from behavior_controller.monitoring.view import MOMENT, PARTS, View
from behavior_controller.robot.declarations import Interface
from behavior_controller.robot.interfaces import DEFAULT
from behavior_controller.text import clean

PULSE = 1.0
"""Seconds between two signs of life: of the tick thread to the board, and of the board to those
that show it."""

HANGS = 3.0
"""Seconds without a sign of the tick thread after which it hangs."""

STRETCHES = 3
"""Number of stretches of the history whose sentences and steps are shown with an earlier moment: of
the lab tour more than a visit."""


class Board(View):
    """The view of now: queues what happens on the tick thread, without waking another; the thread
    that shows it does the rest.

    ``versions`` has a number for each part, which grows with it. That thread calls ``refresh``,
    ``part``, ``node`` and ``close``.
    """

    def __init__(self, events: Events, health: Health, registry: Registry,
                 interface: Interface = DEFAULT):
        super().__init__()
        self.versions: Dict[str, int] = dict.fromkeys(PARTS, 0)
        self.tree: Optional[Tree] = None
        self._registry = registry
        self._history = History()
        self._feed = Feed()
        self._beaten = self._pulsed = 0.0
        self._health = health
        self._offers = {offer.name: offer.kind for offer in interface.offers}
        events.subscribe(self._feed)

    def show(self, tree: Tree) -> None:
        """Show ``tree`` from now on. On the tick thread, which gives a sign of life through the
        tree's clock."""
        if not self._beaten:
            self._beat(tree.clock)
        self._feed.follow(tree, lambda is_first, changes: bool(changes))
        self._feed.put(self._begin, tree)

    def close(self) -> None:
        """Note that the controller ends."""
        self.stopped = "the controller has stopped"
        self._touch("now")

    def _beat(self, clock: Clock) -> None:
        self._beaten = time.monotonic()
        clock.call_after(PULSE, lambda: self._beat(clock))

    # ---------------------------------------------------------------------------- what has happened

    def refresh(self) -> None:
        """Process what has happened: events, and time that passes."""
        for line in self._feed.lines():
            self.take(line.time, line.event)
        now = time.monotonic()
        if now - self._pulsed >= PULSE:
            self._pulsed = now
            self._touch("alive", "health")

    def _touch(self, *parts: str) -> None:
        for part in parts:
            self.versions[part] += 1

    def _begin(self, tree: Tree) -> Event:
        """Clear the data of the earlier tree, whose nodes the page shows no more."""
        self._history = History()
        self.tree = tree
        return shown(tree)

    def take(self, at: float, event: Event) -> Tuple[Sentence, ...]:
        """Fold an event, keep it for later, and note which parts have changed."""
        before = self.state
        self._history.take(before, Line(at, event))
        sentences = super().take(at, event)
        self._touch(*self.changed(before), *(["story"] if sentences else []))
        return sentences

    # ---------------------------------------------------------------------------------- to be shown

    def part(self, name: str) -> Any:
        """Return one part as data that JSON can carry."""
        self.refresh()
        return msgspec.to_builtins(super().part(name))

    def at(self, moment: float) -> Dict[str, Any]:
        """Return the parts that are known of that time of events, as far as it is kept."""
        self.refresh()
        state, lines = self._history.until(moment, STRETCHES)
        view = View(state)
        for line in lines:
            view.take(line.time, line.event)
        parts = {name: view.part(name) for name in MOMENT}
        return msgspec.to_builtins(dict(parts, health=self._offers_of(view.state)))

    def mission(self) -> MissionPart:
        nodes = [] if self.tree is None else [self._outline(node) for node in self.tree.nodes]
        started = self.state.started
        if started is None:
            return MissionPart("", nodes)
        if nodes:  # as py-trees-render has it
            nodes[0] = replace(nodes[0], name=clean(mission_name(started.mission)), kind="")
        return MissionPart(clean(started.mission), nodes)

    def _outline(self, node: Node) -> NodeRow:
        spec = self._registry.find(node.registration_id)
        name, kind = label(node)
        return NodeRow(node.uid, node.parent.uid if node.parent else 0, clean(name), clean(kind),
                       clean(node.full_path), spec is not None and spec.kind is Kind.SUBTREE,
                       node.parent is not None and is_bare(spec, node.name))

    def alive(self) -> Alive:
        age = None
        if self.tree is not None and not self.ended:
            age = round(time.monotonic() - self._beaten, 1)
        return Alive(age, age is not None and age >= HANGS, unix_now(), self._history.began,
                     clock_shift())

    def _offers_of(self, state: State) -> Dict[str, Offer]:
        """Return how each service and topic is, by name."""
        names = {**self._offers, **{change.name: change.kind for change in state.robot.ill}}
        return {name: _offer(name, kind, state.robot.trouble(name)) for name, kind in names.items()}

    def health(self) -> Dict[str, Offer]:
        """Return this with what is known for now only: how often each was called, or heard last."""
        offers = {}
        for name, offer in self._offers_of(self.state).items():
            calls, heard = self._health.calls.get(name), self._health.last_arrivals.get(name)
            if calls is not None:
                offer = replace(offer, calls=calls.calls, failures=calls.failures,
                                seconds=round(calls.last_seconds, 3))
            if heard is not None:
                offer = replace(offer, age=round(time.monotonic() - heard, 1))
            offers[clean(name)] = offer
        return offers

    def node(self, uid: int) -> Optional[Dict[str, Any]]:
        """Return the details of a node: its place, ports with values, last results; None if it does
        not exist."""
        self.refresh()
        nodes = self.tree.nodes if self.tree is not None else []
        if not 1 <= uid <= len(nodes):
            return None
        node = nodes[uid - 1]
        spec = self._registry.find(node.registration_id)
        return {"uid": uid, "path": node.full_path, "type": node.registration_id,
                "description": spec.summary if spec is not None else "",
                "place": node.place_in_file().rstrip(": "),
                "ports": [_port(node, name, text) for name, text in port_texts(node).items()],
                "results": self.results(uid)}


def _offer(name: str, kind: str, trouble: Optional[HealthChanged]) -> Offer:
    if trouble is None:
        return Offer(kind, clean(name), True, "", "")
    text = clean(f"{condition(trouble)}; {trouble.consequence}")
    return Offer(kind, clean(name), False, clean(trouble.status), clean(trouble.consequence), text,
                 rank(trouble))


def port_texts(node: Node) -> Dict[str, str]:
    """Return for each port of a node what the file or the default says."""
    defaults = {port.name: port.default for port in node.spec.ports if port.default is not None}
    return {**defaults, **node.attributes}


def _port(node: Node, name: str, text: str) -> Dict[str, str]:
    """Return a port of a node: its name, its text, and the value of the entry that this means."""
    value = ""
    if reference(text, name) is not None:
        try:
            value = entry_text(entry_value(text, name, node.blackboard))
        except PortError:
            value = "–"  # nothing has written it
    return {"name": name, "text": clean(text, 120), "value": value}


def is_bare(spec: Optional[NodeSpec], name: str) -> bool:
    """Whether a node below the root, with that name, only says how the mission is put together."""
    return spec is not None and (spec.is_recovery or (
        spec.kind in (Kind.CONTROL, Kind.DECORATOR) and name == spec.id))
