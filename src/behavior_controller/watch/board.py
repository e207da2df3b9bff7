"""What there is to see of a running mission, as plain data: the page and ``missionStatus`` show it."""
import collections
import os
import time
from typing import Any, Deque, Dict, List, Optional

from behavior_controller.bt.engine.node import Node, label
from behavior_controller.bt.engine.tree import Tree
from behavior_controller.bt.language.blackboard import Entry
from behavior_controller.bt.registry import Kind, Registry
from behavior_controller.bt.status import FAILURE, IDLE, RUNNING, SUCCESS
from behavior_controller.events import (Event, Events, HealthChanged, LeafFinished, Noticed, PassFinished, Recovered,
                                        Retried, RunFinished, RunStarted)
from behavior_controller.gateway import SERVICES, Cause, Topic
from behavior_controller.health import Health

LETTERS = {IDLE: "-", RUNNING: "R", SUCCESS: "S", FAILURE: "F"}
"""How a node is; a small letter is what it was before it went back to IDLE, ``-`` that it was never ticked."""

KEPT = 40
"""How many of the newest lines of each list are kept."""

PARTS = ("mission", "statuses", "passes", "blackboard", "trouble", "health")
"""The parts of the board; each is sent anew when it has changed."""


class Board:
    """Collects what happens on the tick thread, and wakes nobody there; ``part`` may be asked from any other.

    ``versions`` counts the changes of each part.
    """

    def __init__(self, events: Events, health: Health, registry: Registry):
        self.versions: Dict[str, int] = dict.fromkeys(PARTS, 0)
        self._registry = registry
        self._tree: Optional[Tree] = None
        self._mission = ""
        self._statuses: List[str] = []
        self._writes = 0
        self._passes: Deque[Dict[str, Any]] = collections.deque(maxlen=KEPT)
        self._count = 0
        self._ended = ""
        self._trouble: Deque[Dict[str, Any]] = collections.deque(maxlen=KEPT)
        self._state = health
        self._called, self._aged = 0, 0.0
        self._health: Dict[str, Dict[str, Any]] = {}
        for kind, names in (("service", SERVICES), ("topic", [topic.value for topic in Topic])):
            for name in names:
                self._health[name] = {"kind": kind, "name": name, "well": True, "status": "", "consequence": ""}
        events.subscribe(self._take)

    def show(self, tree: Tree) -> None:
        """Show ``tree`` from now on."""
        self._statuses = ["-"] * (len(tree.nodes) + 1)
        self._tree = tree
        tree.subscribe(self._observe)
        self._touch("mission", "statuses", "blackboard")

    def _touch(self, *parts: str) -> None:
        for part in parts:
            self.versions[part] += 1

    def _observe(self, node: Any, old: Any, new: Any) -> None:
        self._statuses[node.uid] = LETTERS[new] if new is not IDLE else LETTERS[old].lower()
        self.versions["statuses"] += 1

    def _take(self, event: Event) -> None:
        """Keep what is worth being seen of an event."""
        if isinstance(event, RunStarted):
            self._mission = event.mission
            self._touch("mission")
        elif isinstance(event, PassFinished):
            self._count = event.number
            self._passes.append(dict(event._asdict()))
            self._touch("passes")
        elif isinstance(event, RunFinished):
            self._ended = event.outcome
            self._touch("passes")
        elif isinstance(event, HealthChanged):
            entry = self._health.setdefault(event.name, {"kind": event.kind, "name": event.name})
            entry.update(well=event.is_well, status=event.status, consequence=event.consequence)
            self._touch("health")
        else:
            text = _line(event)
            if text:
                self._trouble.append({"time": time.strftime("%H:%M:%S"), "text": text})
                self._touch("trouble")

    # ------------------------------------------------------------------------------------------------- to be shown

    def part(self, name: str) -> Any:
        """Return one part as data that JSON can carry."""
        return getattr(self, "_part_" + name)()

    def look(self) -> None:
        """Notice what nobody tells: entries that were written, calls that ended, topics that grow older."""
        if Entry.writes != self._writes:
            self._writes = Entry.writes
            self.versions["blackboard"] += 1
        called = sum(count.calls for count in list(self._state.calls.values()))
        now = time.monotonic()
        if called != self._called or self._state.heard and now - self._aged >= 1.0:
            self._called, self._aged = called, now
            self.versions["health"] += 1

    def _part_mission(self) -> Dict[str, Any]:
        tree = self._tree
        outline = None if tree is None else self._outline(tree.root)
        if outline is not None and self._mission:
            # as py-trees-render has it
            outline.update(name=os.path.splitext(os.path.basename(self._mission))[0], kind="")
        return {"file": self._mission, "tree": outline}

    def _outline(self, node: Node) -> Dict[str, Any]:
        spec = self._registry.find(node.registration_id)
        name, kind = label(node)
        return {"uid": node.uid, "name": name, "kind": kind, "path": node.full_path,
                "subtree": spec is not None and spec.kind is Kind.SUBTREE,
                "children": [self._outline(child) for child in node.children]}

    def _part_statuses(self) -> Dict[str, Any]:
        letters = "".join(self._statuses[1:])
        tip = letters.rfind("R") + 1  # the last in depth-first order: a running leaf, or what waits above it
        return {"letters": letters, "tip": tip}

    def _part_passes(self) -> Dict[str, Any]:
        return {"count": self._count, "last": list(self._passes)[-5:], "ended": self._ended}

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


def _line(event: Event) -> str:
    """Return what is told of a failure, a recovery or a notice; empty for all else."""
    if isinstance(event, LeafFinished):
        failure = event.failure
        if failure is None or failure.cause is Cause.CONDITION_FALSE or event.node.lower() == "handlefallback":
            return ""
        return "{} failed: {}: {}".format(event.path, failure.cause.value, failure.message)
    if isinstance(event, Retried):
        return "{}: retry {} failed: {}".format(event.path, event.attempt, event.failure.cause.value)
    if isinstance(event, Recovered):
        return "{}: recovery: {} ({})".format(event.path, event.outcome, event.policy)
    return event.text if isinstance(event, Noticed) else ""


def _text(value: Any) -> str:
    """Return a value in a line, not too long for a table."""
    text = str(value) if not isinstance(value, list) else ", ".join(getattr(item, "name", str(item)) for item in value)
    return text if len(text) <= 120 else text[:119] + "…"
