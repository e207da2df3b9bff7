"""What is known of the robot's services and topics while the mission runs: what is gone, slow, failing or silent.

The ROS edge reports, on any thread; the tick thread hands the changes on as events, so that nothing is told twice and
recovery sees what the operator sees (D5.4.3 section 2, continuous monitoring).
"""
import queue
from typing import Callable, Dict, NamedTuple, Set, Tuple

from behavior_controller.events import Events, HealthChanged

GONE, SLOW, FAILING, SILENT = "gone", "slow", "failing", "silent"


class CallCount(NamedTuple):
    """How a service has done so far: calls that ended, those that failed, and seconds of the last and the slowest."""

    calls: int = 0
    failures: int = 0
    in_a_row: int = 0  # failures since the last success
    last_seconds: float = 0.0
    slowest_seconds: float = 0.0


class Health:
    """The state of each service and topic, by resolved name, in each respect that is watched (``GONE`` …)."""

    def __init__(self, wake: Callable[[], None] = lambda: None):
        """``wake`` is called after each change, so that the tick thread comes and tells it."""
        self._wake = wake
        self._troubles: Set[Tuple[str, str]] = set()
        self._changes: "queue.SimpleQueue[HealthChanged]" = queue.SimpleQueue()
        self.calls: Dict[str, CallCount] = {}

    def report(self, respect: str, change: HealthChanged) -> None:
        """Note how something is in one respect, from any thread; only a change is handed on."""
        key = (change.name, respect)
        if (key in self._troubles) is not change.is_well:
            return
        if change.is_well:
            self._troubles.discard(key)
        else:
            self._troubles.add(key)
        self._changes.put(change)
        self._wake()

    def count(self, name: str, seconds: float, has_failed: bool) -> CallCount:
        """Count a call that ended after ``seconds``, and return the sum for its service."""
        before = self.calls.get(name, CallCount())
        after = CallCount(before.calls + 1, before.failures + has_failed, before.in_a_row + 1 if has_failed else 0,
                          seconds, max(seconds, before.slowest_seconds))
        self.calls[name] = after
        return after

    def is_gone(self, name: str) -> bool:
        """Return whether the service or topic is known to be gone."""
        return (name, GONE) in self._troubles

    def publish(self, events: Events) -> None:
        """Emit the changes since the last time; to be called on the tick thread."""
        while not self._changes.empty():
            events.emit(self._changes.get())
