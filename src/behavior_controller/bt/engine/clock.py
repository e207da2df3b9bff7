"""One clock for everything that waits: what time it is, and timers that the tick thread runs when they are due.

Timers run between ticks and never on a thread of their own, so what they do needs no lock and is exact under a
``ManualClock``. Whoever waits (the runner, ``Tree.sleep``) waits until ``next_due()`` at the longest.
"""
import heapq
import itertools
import time
from typing import Callable, List, Optional, Tuple


class Timer:
    """A callback that is due at ``due`` seconds, unless it is cancelled before."""

    __slots__ = ("due", "callback")

    def __init__(self, due: float, callback: Callable[[], None]):
        self.due = due
        self.callback: Optional[Callable[[], None]] = callback

    def cancel(self) -> None:
        """Make sure that the callback does not run (any more)."""
        self.callback = None


class Clock:
    """Monotonic seconds and a queue of timers. Used from the tick thread only, but for ``now``."""

    def __init__(self) -> None:
        self._held: Optional[float] = None
        self._queue: List[Tuple[float, int, Timer]] = []
        self._order = itertools.count()

    def now(self) -> float:
        """Return monotonic seconds; only differences mean something."""
        held = self._held
        return time.monotonic() if held is None else held

    def hold(self) -> None:
        """Let time stand still until ``release``: within one traversal all happens at once, and can be replayed."""
        self._held = time.monotonic()

    def release(self) -> None:
        """Let time go on."""
        self._held = None

    def call_after(self, seconds: float, callback: Callable[[], None]) -> Timer:
        """Run ``callback`` once, ``seconds`` from now, by whoever calls ``run_due`` then."""
        timer = Timer(self.now() + seconds, callback)
        heapq.heappush(self._queue, (timer.due, next(self._order), timer))
        return timer

    def next_due(self) -> Optional[float]:
        """Return when the next timer is due, or None when there is none."""
        while self._queue and self._queue[0][2].callback is None:
            heapq.heappop(self._queue)
        return self._queue[0][0] if self._queue else None

    def run_due(self) -> None:
        """Run every timer that is due, the earliest first."""
        if not self._queue:
            return
        now = self.now()
        while self._queue and self._queue[0][0] <= now:
            timer = heapq.heappop(self._queue)[2]
            callback, timer.callback = timer.callback, None
            if callback is not None:
                callback()


class ManualClock(Clock):
    """A clock that stands still until a test or a replay moves it."""

    def __init__(self, now: float = 0.0):
        super().__init__()
        self._now = now

    def hold(self) -> None:
        """It stands still anyway."""

    def now(self) -> float:
        """Return the time that was set."""
        return self._now

    def set_to(self, moment: float) -> None:
        """Let it be ``moment``; timers that are due then wait for ``run_due``."""
        self._now = moment

    def advance(self, seconds: float) -> None:
        """Move on by ``seconds``; timers on the way run at their own time, in order."""
        end = self._now + seconds
        due = self.next_due()
        while due is not None and due <= end:
            self._now = max(self._now, due)
            self.run_due()
            due = self.next_due()
        self._now = end
