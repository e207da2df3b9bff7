"""A run as the page shows it: now, as it changes, and at an earlier moment."""
import time
from typing import Any, Callable, Dict, Iterable, Tuple

from msgspec.structs import replace

from behavior_controller.run.events import PULSE, Event, Line, TreeShown
from behavior_controller.viewer.backlog import Backlog
from behavior_controller.viewer.parts import Alive
from behavior_controller.run.story import Sentence
from behavior_controller.viewer.view import CONTROLLER_STOPPED, MOMENT, PARTS, View

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
        self.backlog = Backlog()
        self._lines = lines
        self._pulsed = 0.0

    def close(self) -> None:
        """Note that the controller ends."""
        self.refresh()
        self.stopped = CONTROLLER_STOPPED
        self._touch("now", "alive", "ready")

    def refresh(self) -> None:
        """Process what has happened: events, and time that passes."""
        self.extend(self._lines())
        now = time.monotonic()
        if now - self._pulsed >= PULSE:
            self._pulsed = now
            self._touch("alive", "health")

    def _touch(self, *parts: str) -> None:
        for part in parts:
            self.versions[part] += 1

    def take(self, at: float, event: Event) -> Tuple[Sentence, ...]:
        """Fold an event, keep it for later, and note which parts have changed."""
        before, version = self.state, self.visit_values.version
        if isinstance(event, TreeShown):  # the page shows the nodes of the earlier tree no more
            self.backlog = Backlog(self.backlog.outset)
        self.backlog.take(before, Line(at, event))
        sentences = super().take(at, event)
        self._touch(*self.changed(before), *(["story"] if sentences else []))
        if self.visit_values.version != version:
            self._touch("values")
        return sentences

    def alive(self) -> Alive:
        return replace(super().alive(), kept=self.backlog.began)

    def at(self, moment: float) -> Dict[str, Any]:
        """Return the parts that are known of that time of events, as far as it is kept."""
        state, lines = self.backlog.until(moment, STRETCHES)
        view = View(state)
        view.extend(lines)
        return dict(view.shown(MOMENT), health=view.part("offers"))
