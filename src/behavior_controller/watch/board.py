"""What there is to see of a running mission, as plain data: the page and ``missionStatus`` show it."""
import collections
import os
import time
from typing import Any, Deque, Dict, List, Optional

from behavior_controller.bt.engine.clock import Clock
from behavior_controller.bt.engine.node import Node, label
from behavior_controller.bt.engine.tree import Tree
from behavior_controller.bt.registry import Kind, Registry
from behavior_controller.bt.status import IDLE
from behavior_controller.events import (Event, Events, HealthChanged, LeafFinished, Noticed, PassFinished, Recovered,
                                        Retried, RunFinished, RunStarted)
from behavior_controller.gateway import Cause
from behavior_controller.health import Health
from behavior_controller.interface import Interface
from behavior_controller.interface.robots import DEFAULT
from behavior_controller.text import clean
from behavior_controller.watch.codec import LETTERS

KEPT = 40
"""How many of the newest lines of each list are kept."""

PULSE = 1.0
"""Seconds between two signs of life: of the tick thread to the board, and of the board to those that show it."""

HANGS = 3.0
"""Seconds without a sign of the tick thread after which it hangs."""

PARTS = ("mission", "statuses", "passes", "blackboard", "trouble", "health", "alive")
"""The parts of the board; each is sent again when it has changed, the last one with every ``PULSE``."""


class Board:
    """Collects what happens on the tick thread, and wakes no other; ``part`` may be called from any thread.

    ``versions`` counts the changes of each part.
    """

    def __init__(self, events: Events, health: Health, registry: Registry, interface: Interface = DEFAULT):
        self.versions: Dict[str, int] = dict.fromkeys(PARTS, 0)
        self._registry = registry
        self._tree: Optional[Tree] = None
        self._mission = ""
        # a small letter is the status before the node went back to IDLE; -: it was not ticked in this pass
        self._statuses: List[str] = []
        self._writes = 0
        self._passes: Deque[Dict[str, Any]] = collections.deque(maxlen=KEPT)
        self._count = 0
        self._is_under_way = False  # a pass has begun and not ended
        self._ended = ""
        self._beaten = 0.0
        self._trouble: Deque[Dict[str, Any]] = collections.deque(maxlen=KEPT)
        self._state = health
        self._called, self._pulsed = 0, 0.0
        self._health: Dict[str, Dict[str, Any]] = {}
        for kind, offers in (("service", interface.services), ("topic", interface.topics)):
            for offer in offers:
                self._health[offer.name] = {"kind": kind, "name": offer.name, "well": True, "status": "",
                                            "consequence": ""}
        events.subscribe(self._take)

    def show(self, tree: Tree) -> None:
        """Show ``tree`` from now on. On the tick thread, which gives a sign of life through the tree's clock."""
        if self._tree is None:
            self._beat(tree.clock)
        self._is_under_way = False
        self._statuses = ["-"] * (len(tree.nodes) + 1)
        self._tree = tree
        tree.subscribe(self._observe)
        self._touch("mission", "statuses", "passes", "blackboard")

    def close(self) -> None:
        """Note that the controller ends, if it has not told how."""
        self._ended, self._is_under_way = self._ended or "the controller has stopped", False
        self._touch("passes")

    def _beat(self, clock: Clock) -> None:
        self._beaten = time.monotonic()
        clock.call_after(PULSE, lambda: self._beat(clock))

    def _touch(self, *parts: str) -> None:
        for part in parts:
            self.versions[part] += 1

    def _observe(self, node: Any, old: Any, new: Any) -> None:
        if not self._is_under_way:  # what is left of the visitor before is shown until the next pass begins
            self._is_under_way = True
            self._statuses[1:] = "-" * (len(self._statuses) - 1)
            self._touch("passes")
        self._statuses[node.uid] = LETTERS[new] if new is not IDLE else LETTERS[old].lower()
        self.versions["statuses"] += 1

    def _take(self, event: Event) -> None:
        """Keep what is worth being seen of an event."""
        if isinstance(event, RunStarted):
            self._mission = event.mission
            self._touch("mission")
        elif isinstance(event, PassFinished):
            self._count, self._is_under_way = event.number, False
            self._passes.append(dict(event._asdict()))
            self._touch("passes")
        elif isinstance(event, RunFinished):
            self._ended, self._is_under_way = event.outcome, False
            self._touch("passes")
        elif isinstance(event, HealthChanged):
            entry = self._health.setdefault(event.name, {"kind": event.kind, "name": event.name})
            entry.update(well=event.is_well, status=clean(event.status), consequence=event.consequence)
            self._touch("health")
        else:
            text = clean(self._line(event))
            if text:
                self._trouble.append({"time": time.strftime("%H:%M:%S"), "text": text})
                self._touch("trouble")

    def _line(self, event: Event) -> str:
        """Return what is told of a failure, a recovery or a notice; empty for all else."""
        if isinstance(event, LeafFinished):
            failure, spec = event.failure, self._registry.find(event.node)
            if failure is None or failure.cause is Cause.CONDITION_FALSE or (spec is not None and spec.is_recovery):
                return ""
            return "{} failed: {}: {}".format(event.path, failure.cause.value, failure.message)
        if isinstance(event, Retried):
            return "{}: retry {} failed: {}".format(event.path, event.attempt, event.failure.cause.value)
        if isinstance(event, Recovered):
            return "{}: recovery: {} ({}), for {}: {}".format(event.path, event.outcome, event.policy,
                                                              event.failure.cause.value, event.failure.message)
        return event.text if isinstance(event, Noticed) and event.level != "info" else ""

    # ------------------------------------------------------------------------------------------------- to be shown

    def part(self, name: str) -> Any:
        """Return one part as data that JSON can carry."""
        return getattr(self, "_part_" + name)()

    def look(self) -> None:
        """Notice changes without an event: entries that were written, calls that ended, topics that grow older."""
        writes = self._tree.blackboard.writes if self._tree is not None else 0
        if writes != self._writes:
            self._writes = writes
            self.versions["blackboard"] += 1
        called = sum(count.calls for count in self._state.calls.values())
        if called != self._called:
            self._called = called
            self.versions["health"] += 1
        now = time.monotonic()
        if now - self._pulsed >= PULSE:
            self._pulsed = now
            self._touch("alive", "health")

    def _part_mission(self) -> Dict[str, Any]:
        """Return the nodes in document order, each with its parent's uid: a list, since a tree may be very deep."""
        nodes = [] if self._tree is None else [self._outline(node) for node in self._tree.nodes]
        if nodes and self._mission:
            # as py-trees-render has it
            nodes[0].update(name=os.path.splitext(os.path.basename(self._mission))[0], kind="")
        return {"file": self._mission, "nodes": nodes}

    def _outline(self, node: Node) -> Dict[str, Any]:
        spec = self._registry.find(node.registration_id)
        name, kind = label(node)
        return {"uid": node.uid, "parent": node.parent.uid if node.parent else 0, "name": name, "kind": kind,
                "path": node.full_path, "subtree": spec is not None and spec.kind is Kind.SUBTREE}

    def _part_statuses(self) -> Dict[str, Any]:
        letters = "".join(self._statuses[1:])
        tip = letters.rfind("R") + 1  # the last in depth-first order: a running leaf, or what waits above it
        return {"letters": letters, "tip": tip}

    def _part_passes(self) -> Dict[str, Any]:
        last = list(self._passes)[-5:]
        told = ["pass {} is under way".format(self._count + 1)] if self._is_under_way else []
        told += ["pass {}: {} after {:.1f} s".format(each["number"], each["outcome"], each["seconds"])
                 for each in last[-1:]]
        return {"count": self._count, "last": last, "ended": self._ended, "text": "; ".join(told) or "no pass yet"}

    def _part_alive(self) -> Dict[str, Any]:
        """Return how long ago, in seconds, the tick thread gave its last sign of life, and whether that is too long."""
        if self._tree is None or self._ended:
            return {"age": None, "hangs": False}
        age = round(time.monotonic() - self._beaten, 1)
        return {"age": age, "hangs": age >= HANGS}

    def _part_blackboard(self) -> List[List[str]]:
        tree = self._tree
        if tree is None:
            return []
        return [[path + "/" + key if path else key, _text(entry.value)]
                for path, board in list(tree.blackboards.items())
                for key, entry in sorted(dict(board.local).items()) if entry.value is not None]

    def _part_trouble(self) -> List[Dict[str, Any]]:
        return list(self._trouble)

    def _part_health(self) -> List[Dict[str, Any]]:
        found = []
        for entry in list(self._health.values()):
            calls, heard = self._state.calls.get(entry["name"]), self._state.heard.get(entry["name"])
            found.append(dict(entry, calls=calls.calls if calls else 0, failures=calls.failures if calls else 0,
                              seconds=round(calls.last_seconds, 3) if calls else None,
                              age=None if heard is None else round(time.monotonic() - heard, 1)))
        return found


def _text(value: Any) -> str:
    """Return a value in a line, not too long for a table."""
    text = str(value) if not isinstance(value, list) else ", ".join(getattr(item, "name", str(item)) for item in value)
    return clean(text, 120)
