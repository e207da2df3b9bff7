"""The state of a running mission, kept for what shows it: page and ``missionStatus``."""
import time
from typing import Any, Callable, Dict, Iterable, Optional, Tuple

import msgspec
from msgspec.structs import replace

from behavior_controller.run.events import (
    PULSE, Event, HealthChanged, Line, PortText, TreeNode, TreeShown, clock_shift, unix_now)
from behavior_controller.run.history import History
from behavior_controller.run.state import State, rank
from behavior_controller.folders import mission_name
from behavior_controller.viewer.parts import Alive, MissionPart, NodeRow, Offer
from behavior_controller.run.story import Sentence, condition
from behavior_controller.viewer.view import MOMENT, PARTS, View
from behavior_controller.text import clean

LONGEST_PORT = 120
"""The most characters of a port's text."""

HANGS = 3.0
"""Seconds without a sign of the tick thread after which it hangs."""

STRETCHES = 3
"""Number of stretches of the history whose sentences and steps are shown with an earlier moment: of
the lab tour more than a visit."""


class Board(View):
    """The view of now, made of the lines of a run.

    ``versions`` has a number for each part, which grows with it. All belongs to the thread that
    shows it.
    """

    def __init__(self, lines: Callable[[], Iterable[Line]]):
        """``lines`` returns those that have come since its last call."""
        super().__init__()
        self.versions: Dict[str, int] = dict.fromkeys(PARTS, 0)
        self._lines = lines
        self._history = History()
        self._pulsed = 0.0

    def close(self) -> None:
        """Note that the controller ends."""
        self.refresh()
        self.stopped = "the controller has stopped"
        self._touch("now")

    # ---------------------------------------------------------------------------- what has happened

    def refresh(self) -> None:
        """Process what has happened: events, and time that passes."""
        for line in self._lines():
            self.take(line.time, line.event)
        now = time.monotonic()
        if now - self._pulsed >= PULSE:
            self._pulsed = now
            self._touch("alive", "health")

    def _touch(self, *parts: str) -> None:
        for part in parts:
            self.versions[part] += 1

    def take(self, at: float, event: Event) -> Tuple[Sentence, ...]:
        """Fold an event, keep it for later, and note which parts have changed."""
        before = self.state
        if isinstance(event, TreeShown):  # the page shows the nodes of the earlier tree no more
            self._history = History()
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
        nodes = [_row(uid, node) for uid, node in enumerate(self.state.nodes, 1)]
        started = self.state.started
        if started is None:
            return MissionPart("", nodes)
        if nodes:  # as py-trees-render has it
            nodes[0] = replace(nodes[0], name=clean(mission_name(started.mission)), kind="")
        return MissionPart(clean(started.mission), nodes)

    def alive(self) -> Alive:
        age = None
        if self.state.alive is not None and not self.ended:
            age = round(unix_now() - self.state.alive, 1)
        return Alive(age, age is not None and age >= HANGS, unix_now(), self._history.began,
                     clock_shift())

    def _offers_of(self, state: State) -> Dict[str, Offer]:
        """Return how each service and topic is, by name."""
        offers = state.started.offers if state.started is not None else {}
        names = {**offers, **{change.name: change.kind for change in state.robot.ill}}
        return {name: _offer(name, kind, state.robot.trouble(name)) for name, kind in names.items()}

    def health(self) -> Dict[str, Offer]:
        """Return this with what is known for now only: how often each was called, or heard last."""
        offers = {}
        for name, offer in self._offers_of(self.state).items():
            calls, heard = self.calls.get(name), self.state.heard.get(name)
            if calls is not None:
                offer = replace(offer, calls=calls.calls, failures=calls.failures,
                                seconds=round(calls.seconds, 3))
            if heard is not None:
                offer = replace(offer, age=round(unix_now() - heard, 1))
            offers[clean(name)] = offer
        return offers

    def node(self, uid: int) -> Optional[Dict[str, Any]]:
        """Return the details of a node: its place, ports with values, last results; None if it does
        not exist."""
        self.refresh()
        tree = self.state.tree
        if not 1 <= uid <= len(tree.nodes):
            return None
        node = tree.nodes[uid - 1]
        return {"uid": uid, "path": node.path, "type": node.type,
                "description": tree.summaries.get(node.type, ""), "place": node.place,
                "ports": list(map(self._port, node.ports)), "results": self.results(uid)}

    def _port(self, port: PortText) -> Dict[str, str]:
        """Return a port of a node: its name and text, and the value of the entry that it refers to.
        """
        # without a value nothing has written it
        value = port.entry and self.state.entries.get(port.entry, "–")
        return {"name": port.name, "text": clean(port.text, LONGEST_PORT), "value": value}


def _row(uid: int, node: TreeNode) -> NodeRow:
    return NodeRow(uid, node.parent, node.label, node.kind, clean(node.path),
                   node.type == "SubTree", node.is_bare)


def _offer(name: str, kind: str, trouble: Optional[HealthChanged]) -> Offer:
    if trouble is None:
        return Offer(kind, clean(name), True, "", "")
    text = clean(f"{condition(trouble)}; {trouble.consequence}")
    return Offer(kind, clean(name), False, clean(trouble.status), clean(trouble.consequence), text,
                 rank(trouble))
