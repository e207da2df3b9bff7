"""The newest lines of a run as text: a reader who comes late learns from them what is so."""
import collections
from typing import Deque, List, NamedTuple, Tuple

from msgspec import Struct

from behavior_controller.run.events import Line
from behavior_controller.run.record.codec import encode
from behavior_controller.run.record.outset import Outset

KEPT_LINES = 5000
"""The least number of the newest lines that are kept; at most twice as many are."""


class Batch(Struct, frozen=True):
    """What comes before some lines of a run, where these are sent.

    ``is_first``: the lines are the begin of a run. ``at`` is now, as the sender's time of events.
    ``stopped`` is how the run ended if no line says so.
    """

    lines: int
    is_first: bool
    at: float
    stopped: str = ""


class _Stretch(NamedTuple):
    """Lines from a ``number`` of the run on; ``head`` is what was so before them."""

    number: int
    head: bytes
    texts: List[bytes]


class Backlog:
    """Keeps the newest lines of a run."""

    def __init__(self) -> None:
        self.count = 0
        """The number of lines of the run so far."""
        self._outset = Outset()
        self._stretches: Deque[_Stretch] = collections.deque(maxlen=2)

    def take(self, line: Line) -> None:
        """Keep the next line."""
        if not self._stretches or len(self._stretches[-1].texts) == KEPT_LINES:
            head = self._outset.head(self.count, line.time, has_former=False)
            self._stretches.append(_Stretch(self.count, head, []))
        self._outset.take(line.time, line.event)
        self._stretches[-1].texts.append(encode(line.time, line.event))
        self.count += 1

    def since(self, number: int) -> Tuple[bool, List[bytes]]:
        """Return the lines from that number on; or True, and all that are kept with what was so
        before, if that number is 0 or not kept any more."""
        if number == self.count:
            return False, []
        first = self._stretches[0]
        texts = [text for stretch in self._stretches for text in stretch.texts]
        if number and number >= first.number:
            return False, texts[number - first.number:]
        return True, first.head.splitlines(True) + texts
