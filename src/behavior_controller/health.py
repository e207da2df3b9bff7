"""What is known of the robot's services and topics while the mission runs: what is gone, slow, failing or silent.

The ROS edge reports, on any thread; the tick thread hands the changes on as events, so that nothing is told twice and
recovery sees what the operator sees (D5.4.3 section 2, continuous monitoring).
"""
import queue
import threading
from typing import Callable, Dict, NamedTuple, Set, Tuple

from behavior_controller.events import Events, HealthChanged

GONE, SLOW, FAILING, SILENT, NEW = "gone", "slow", "failing", "silent", "new"

SLOW_SHARE = 0.5
"""A service is slow when a call has taken this share of its deadline."""

FAILURES_IN_A_ROW = 3
"""A service is failing after so many failed calls without a good one between them."""


class CallCount(NamedTuple):
    """How a service has done so far: calls that ended, those that failed, and seconds of the last and the slowest."""

    calls: int = 0
    failures: int = 0
    in_a_row: int = 0  # failures since the last success
    last_seconds: float = 0.0
    slowest_seconds: float = 0.0


class Health:
    """The state of each service and topic, by resolved name, in each respect that is watched (``GONE`` …).

    Any thread may report; ``publish`` and ``is_gone`` belong to the tick thread.
    """

    def __init__(self, wake: Callable[[], None] = lambda: None):
        """``wake`` is called after each change, so that the tick thread comes and tells it."""
        self._wake = wake
        self._lock = threading.Lock()  # of what is reported
        self._troubles: Set[Tuple[str, str]] = set()
        self._gone: Set[str] = set()
        self._changes: "queue.SimpleQueue[HealthChanged]" = queue.SimpleQueue()
        self.calls: Dict[str, CallCount] = {}
        self.heard: Dict[str, float] = {}
        """When each topic was heard last (monotonic seconds), as far as anybody has looked."""

    def report(self, respect: str, change: HealthChanged) -> None:
        """Note how something is in one respect, from any thread; only a change is handed on."""
        key = (change.name, respect)
        with self._lock:
            if (key in self._troubles) is not change.is_well:
                return
            if change.is_well:
                self._troubles.discard(key)
            else:
                self._troubles.add(key)
            self._changes.put(change._replace(respect=respect))
        self._wake()

    def slow(self, service: str, deadline: float) -> None:
        """Note that a call has taken ``SLOW_SHARE`` of its deadline (seconds) and is not answered."""
        self.report(SLOW, HealthChanged("service", service, "", False, "slow: no answer for {:g} s".format(
            deadline * SLOW_SHARE), "the call is given up after {:g} s".format(deadline)))

    def ended(self, service: str, seconds: float, deadline: float, has_failed: bool) -> None:
        """Count a call that ended after ``seconds``; its ``deadline`` tells whether that was slow."""
        with self._lock:
            before = self.calls.get(service, CallCount())
            row = before.in_a_row + 1 if has_failed else 0
            self.calls[service] = CallCount(before.calls + 1, before.failures + has_failed, row, seconds,
                                            max(seconds, before.slowest_seconds))
        if row >= FAILURES_IN_A_ROW:
            self.report(FAILING, HealthChanged("service", service, "", False, "failing: {} calls in a row".format(row),
                                               "the recovery policy says what is left out"))
        elif not has_failed:
            self.report(FAILING, HealthChanged("service", service, "", True, "works again", ""))
            if seconds < deadline * SLOW_SHARE:
                self.report(SLOW, HealthChanged("service", service, "", True, "answers in time again", ""))

    def is_gone(self, name: str) -> bool:
        """Return whether the service or topic was known to be gone when the changes were published last."""
        return name in self._gone

    def publish(self, events: Events) -> None:
        """Emit the changes since the last time; to be called on the tick thread."""
        while not self._changes.empty():
            change = self._changes.get()
            if change.respect == GONE and change.is_well:
                self._gone.discard(change.name)
            elif change.respect == GONE:
                self._gone.add(change.name)
            events.emit(change)
