"""One clock for everything that waits: the time, and the callbacks that the tick thread runs when
they are due.

Timers run between ticks and only on the tick thread, so their callbacks need no lock and are exact
under a ``ManualClock``. The runner and ``Tree.sleep`` wait for ``time_left()`` at the longest.
Other threads ``post`` callbacks and wake the tree: these run before the next traversal.
"""
import collections
import heapq
import itertools
import math
import time
from typing import Any, Callable, Deque, List, Optional, Tuple

from behavior_controller.bt.engine.failure import failure_of, owner_of
from behavior_controller.thread_check import tick_thread_only


FEW_TIMERS = 64
"""So many timers may wait to be due though they were cancelled; of more, half."""


class Timer:
    """A callback that is due at ``due`` seconds, unless it is cancelled before."""

    @tick_thread_only
    def __init__(self, due: float, callback: Callable[[], None], owner: Any):
        self.due = due
        self.callback: Optional[Callable[[], None]] = callback
        self.owner = owner

    @tick_thread_only
    def cancel(self) -> None:
        """Make sure that the callback does not run from now on."""
        self.callback = None


class Clock:
    """Seconds that only increase, a queue of timers, and what other threads posted. ``now``,
    ``source``, ``arrival`` and ``post`` are for any thread.

    A callback belongs to the node whose code, or whose callback, has set it. What it raises is a
    TickError of that node, as in its rule.
    """

    def __init__(self, source: Callable[[], float] = time.monotonic) -> None:
        """``source`` returns the seconds that the mission goes by."""
        self.source = self.arrival = source
        """The time, also during a traversal; ``arrival``: that of a message."""
        self.process = self
        """The clock of the process' own time: another one if the mission's time is simulated."""
        self.held_at: Optional[float] = None
        """The moment of the traversal under way, or None; for any thread."""
        self._queue: List[Tuple[float, int, Timer]] = []
        self._room = FEW_TIMERS  # the length of the queue at which cancelled timers are taken out
        self._order = itertools.count()
        self._posted: Deque[Tuple[Callable[[], None], Any]] = collections.deque()
        self._running: Any = None  # the owner of the callback that runs

    def now(self) -> float:
        """Return the time; only differences mean something."""
        held = self.held_at
        return self.source() if held is None else held

    def hold(self) -> None:
        """Stop the time until ``release``: all of one traversal has the same time, so that it can
        be replayed."""
        self.held_at = self.source()

    def release(self) -> None:
        """Let the time go on."""
        self.held_at = None

    @tick_thread_only
    def call_after(self, seconds: float, callback: Callable[[], None],
                   is_foreign: bool = False) -> Timer:
        """Run ``callback`` once, ``seconds`` from now, in the next ``run_due`` after that.

        ``is_foreign``: it belongs to no node; the search for one is saved. Its seconds begin when
        it is set, not with the traversal: a slow leaf's time does not count against a request.
        """
        now, owner = self.source, None
        if not is_foreign:
            now, owner = self.now, owner_of(callback) or self._running
        timer = Timer(now() + seconds, callback, owner)
        if len(self._queue) >= self._room:
            self._queue = [entry for entry in self._queue if entry[2].callback is not None]
            heapq.heapify(self._queue)
            self._room = FEW_TIMERS + 2 * len(self._queue)
        heapq.heappush(self._queue, (timer.due, next(self._order), timer))
        return timer

    def post(self, callback: Callable[[], None], is_foreign: bool = False) -> None:
        """Have ``callback`` run soon on the tick thread, in the order of posting. Then the caller
        must wake the tree. ``is_foreign``: see ``call_after``."""
        owner = None
        if not is_foreign:
            owner = owner_of(callback)
        self._posted.append((callback, owner))

    @tick_thread_only
    def run_posted(self) -> None:
        """Run the posted callbacks. Raises TickError; those after a callback that failed wait for
        the next time."""
        while self._posted:
            self._call(*self._posted.popleft())

    @tick_thread_only
    def next_due(self) -> Optional[float]:
        """Return when the next timer is due, or None when there is none."""
        while self._queue:
            due, _, timer = self._queue[0]
            if timer.callback is not None:
                return due
            heapq.heappop(self._queue)
        return None

    @tick_thread_only
    def time_left(self) -> Optional[float]:
        """Return for how many seconds of the process to wait for a timer; None: any."""
        due = self.next_due()
        if due is None:
            return None
        return due - self.now()

    def take_jump(self) -> float:
        """Return by how many seconds the source has jumped back since the last call."""
        return 0.0

    @tick_thread_only
    def timers(self) -> List[Timer]:
        """Return the timers that are neither due nor cancelled, in no order."""
        return [timer for _, _, timer in self._queue if timer.callback is not None]

    @tick_thread_only
    def run_due(self) -> None:
        """Run the posted callbacks, then every due timer, the earliest first. Raises TickError as
        ``run_posted`` does."""
        self.run_posted()
        if not self._queue:
            return
        now = self.now()
        while self._queue and self._queue[0][0] <= now:
            timer = heapq.heappop(self._queue)[2]
            callback, timer.callback = timer.callback, None
            if callback is not None:
                self._call(callback, timer.owner)
                if timer.owner is not None:
                    timer.owner.wake()  # the node may act on what its callback did

    def _call(self, callback: Callable[[], None], owner: Any) -> None:
        self._running = owner
        try:
            callback()
        except BaseException as error:  # a leaf's callback may raise anything
            raise failure_of(owner, error, "a callback of " * (owner is not None))
        finally:
            self._running = None


class ManualClock(Clock):
    """A clock that stands still until a test or a replay moves it."""

    def __init__(self, now: float = 0.0):
        super().__init__(lambda: self._now)
        self._now = now

    def hold(self) -> None:
        """Do nothing: the time stands still anyway."""

    def set_to(self, moment: float) -> None:
        """Set the time to ``moment``; due timers wait for ``run_due``."""
        self._now = moment

    def advance(self, seconds: float) -> None:
        """Move on by ``seconds``; timers on the way run at their own time, in order."""
        moment, due = self._now + seconds, self.next_due()
        while due is not None and due <= moment:
            self._now = max(self._now, due)
            self.run_due()
            due = self.next_due()
        self._now = moment


MESSAGE_STEP = 1e-6
"""Seconds by which a message is later than the one before while the simulated time stands still:
the order of an answer and its question must show."""


class SimulatedClock(Clock):
    """The time of a simulator, as messages tell it. It begins at 0 with the first one, and goes on
    from where it was when theirs jumps back: nothing that has a time has to be changed then.

    ``set_to`` belongs to the threads that receive the messages, one at a time.
    """

    def __init__(self, wake: Callable[[], None]):
        """``wake`` is called when the time begins, when a timer is due, and at a jump back."""
        super().__init__(lambda: max(self._now, self._arrived))
        self.arrival, self.process = self._next_arrival, Clock()
        self.simulated: Optional[float] = None
        """The simulator's own time; None before the first message."""
        self._wake = wake
        self._now = self._arrived = self._offset = 0.0
        self._jumps: Deque[float] = collections.deque()
        self._alarm = math.inf  # when the wait of the tick thread has to end

    def _next_arrival(self) -> float:
        self._arrived = max(self._now, self._arrived + MESSAGE_STEP)
        return self._arrived

    def set_to(self, moment: float) -> None:
        """Go on to that time of the simulator."""
        before, self.simulated = self.simulated, moment
        if before is None:
            self._offset = -moment
            self._wake()
        elif moment < before:
            self._offset += before - moment
            self._jumps.append(before - moment)
            self._wake()
        self._now = moment + self._offset
        if self.source() >= self._alarm:
            self._alarm = math.inf
            self._wake()

    def take_jump(self) -> float:
        return sum(self._jumps.popleft() for _ in range(len(self._jumps)))

    @tick_thread_only
    def time_left(self) -> Optional[float]:
        """See ``Clock``. From now on the tree is woken when the next timer is due."""
        due = self.next_due()
        self._alarm = math.inf if due is None else due
        # asked after the alarm is set: a message that comes in between is seen by one of the two
        if self.source() >= self._alarm:
            return 0.0
        return self.process.time_left()

    @tick_thread_only
    def run_due(self) -> None:
        self.process.run_due()
        super().run_due()
