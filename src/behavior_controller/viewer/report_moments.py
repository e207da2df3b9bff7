"""The moments of a record for a script: what was so at first, and what has changed since, packed.
"""
import base64
import json
import zlib
from typing import Any, Dict, List, Tuple

from behavior_controller.run.state import State
from behavior_controller.viewer.view import View

STRETCH_MOMENTS = 500
"""Number of moments in a stretch, whose first one is whole; the script unpacks one at a time."""

AT_MOMENTS = ("statuses", "now", "story", "blackboard")
"""The parts of the board that a moment has; the sentences stand in the page itself."""


def packed(data: Any) -> str:
    """Return data as compressed JSON."""
    text = json.dumps(data, separators=(",", ":"))
    return base64.b64encode(zlib.compress(text.encode(), 9)).decode()


class Moments:
    """Takes a view after each event, and keeps the moments at which something shown changed."""

    def __init__(self) -> None:
        self._shown = State()
        self._parts: Dict[str, Any] = {}
        self._moments: List[Tuple[float, Dict[str, Any]]] = []  # of the stretch under way
        self._stretches: List[Tuple[float, str]] = []

    def take(self, view: View, at: float) -> None:
        """Note what is shown ``at`` that time."""
        changed = view.changed(self._shown)
        parts = view.shown(name for name in AT_MOMENTS
                           if name in changed or name not in self._parts)
        if "story" in parts:
            parts["story"] = {"visit": parts["story"]["visit"]}
        self._shown = view.state
        news = {name: part for name, part in parts.items() if part != self._parts.get(name)}
        if not news:
            return
        self._parts.update(news)
        if len(self._moments) == STRETCH_MOMENTS:
            self._close()
        self._moments.append((round(at, 3), news if self._moments else dict(self._parts)))

    def _close(self) -> None:
        self._stretches.append((self._moments[0][0], packed(self._moments)))
        self._moments = []

    def packed(self) -> List[Tuple[float, str]]:
        """Return each stretch: when it begins, and its moments as packed JSON."""
        if self._moments:
            self._close()
        return self._stretches
