"""The lines of a run that the viewer keeps: for an earlier moment, and for other readers."""
import collections
from typing import Deque, List, Optional, Tuple

from msgspec import Struct

from behavior_controller.run.events import Line
from behavior_controller.run.history import History
from behavior_controller.run.record.codec import encode
from behavior_controller.run.record.outset import Outset
from behavior_controller.run.state import State

KEPT_LINES = 5000
"""The least number of the newest lines that a late reader gets; it gets at most twice as many."""


class Batch(Struct, frozen=True):
    """What comes before some lines of a run, where these are sent.

    ``is_first``: the lines are the begin of a run. ``at`` is now, as the sender's time of events.
    ``stopped`` is how the run ended if no line says so.
    """

    lines: int
    is_first: bool
    at: float
    stopped: str = ""


class Backlog(History):
    """The history of a run, and its newest lines as text for readers, also for a late one."""

    def __init__(self, outset: Optional[Outset] = None):
        """``outset`` is what was so before."""
        super().__init__()
        self.count = 0
        """The number of lines so far."""
        self.outset = outset or Outset()
        # of the lines from a number on, what was so before them
        self._heads: Deque[Tuple[int, bytes]] = collections.deque(maxlen=2)

    def take(self, before: State, line: Line) -> None:
        """Keep the next event, given what was so before it."""
        if self.count % KEPT_LINES == 0:
            head = self.outset.head(self.count, line.time, has_former=False)
            self._heads.append((self.count, head))
        super().take(before, line)
        self.outset.take(line.time, line.event)
        self.count += 1

    def since(self, number: int) -> Tuple[bool, List[bytes]]:
        """Return the lines from that number on; or True, and all that are kept with what was so
        before, if that number is 0 or not kept any more."""
        if number == self.count:
            return False, []
        first, head = self._heads[0]
        is_first = not number or number < first
        texts = [encode(line.time, line.event)
                 for line in self.newest(self.count - max(number, first))]
        return is_first, head.splitlines(True) * is_first + texts
