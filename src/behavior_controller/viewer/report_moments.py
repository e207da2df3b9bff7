"""The moments of a record for a script: what was so at first, and what has changed since, packed.
"""
import base64
import json
import zlib
from typing import Any, Dict, List, Tuple

import msgspec

from behavior_controller.run.state import State
from behavior_controller.viewer.parts import changes
from behavior_controller.viewer.view import View

EVERY = 500
"""Number of moments in a stretch, whose first one is whole; the script unpacks one at a time."""

KEPT = ("statuses", "now", "story", "blackboard")
"""The parts of the board that a moment has."""


class Moments:
    """Takes a view after each event, and keeps the moments at which something shown changed."""

    def __init__(self) -> None:
        self._shown = State()
        self._parts: Dict[str, Any] = {}
        self._moments: List[Tuple[int, Dict[str, Any]]] = []  # of the stretch under way
        self._stretches: List[Tuple[int, str]] = []

    def take(self, view: View, at: float) -> None:
        """Note what is shown ``at`` that time, in seconds since the begin of the run."""
        changed = view.changed(self._shown)
        parts = {name: msgspec.to_builtins(view.part(name)) for name in KEPT
                 if name in changed or name not in self._parts}
        before, self._parts = self._parts, {**self._parts, **parts}
        self._shown = view.state
        news = changes(before, self._parts)
        if not news:
            return
        if len(self._moments) == EVERY:
            self._close()
        self._moments.append((round(1000 * at), news if self._moments else self._parts))

    def _close(self) -> None:
        text = json.dumps(self._moments, separators=(",", ":"))
        packed = base64.b64encode(zlib.compress(text.encode(), 9)).decode()
        self._stretches.append((self._moments[0][0], packed))
        self._moments = []

    def packed(self) -> List[Tuple[int, str]]:
        """Return each stretch: when it begins, in milliseconds, and its moments as packed JSON."""
        if self._moments:
            self._close()
        return self._stretches
