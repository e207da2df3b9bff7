"""When the messages of a topic came: whether one of them still counts, and whether the topic is
silent. Times are monotonic seconds."""
from typing import Optional, Sequence

from behavior_controller.robot.declarations import Sample

SILENCE = 1.25
"""Seconds without a message after which a continuous topic is silent, unless its messages are rare.
"""

GAPS = 12
"""A topic is silent only after this many times its usual gap: with random arrivals a single gap may
be long."""

FIRST_SILENCE = 10.0
"""The same as ``SILENCE`` until ``ENOUGH`` messages have shown the topic's rate."""

ENOUGH = 5


class Rhythm:
    """When the newest message came that the mission can read, and how often messages come."""

    def __init__(self, now: float):
        self.count = 0  # messages since there is a connection
        self.last = self._first = now

    def hear(self, arrived: float) -> None:
        """Note the arrival of a message."""
        if not self.count:
            self._first = arrived
        self.count += 1
        self.last = arrived

    def restart(self) -> None:
        """Measure the rate again, without the silence before."""
        self.count = 0

    @property
    def rate(self) -> float:
        """How many messages come in a second, rounded; 0: not known."""
        length = self.last - self._first
        if length <= 0.0:
            return 0.0
        return round((self.count - 1) / length, 1)

    def is_silent(self, now: float) -> bool:
        """Return whether no message has come for too long."""
        usual_gap = (self.last - self._first) / max(1, self.count - 1)
        limit = FIRST_SILENCE
        if self.count >= ENOUGH:
            limit = max(SILENCE, GAPS * usual_gap)
        return now - self.last > limit


def unheard(samples: Sequence[Sample], after: float, now: float, max_age: float) -> Optional[str]:
    """Return why none of a topic's messages counts: each must be later than ``after`` and at most
    ``max_age`` seconds old.

    Empty: one does, and the topic cannot be silent. None: one does, but it is so old that only the
    topic's ``Rhythm`` can say that.
    """
    if not samples:
        return "no message has come"
    age = now - samples[-1].arrived
    if samples[-1].arrived <= after:
        return "the newest message came before"
    if age > max_age:
        return "the newest message is too old"
    return "" if age <= SILENCE else None
