"""The state of the robot's services and topics while the mission runs: gone, slow, failing or
silent.

The ROS edge reports, on any thread; the tick thread emits the changes as events, so that nothing is
reported twice and recovery and operator get the same information (D5.4.3 section 2, continuous
monitoring).
"""
import collections
from typing import Callable, Deque, Dict, List, Tuple

from msgspec.structs import replace

from behavior_controller.thread_check import tick_thread_only
from behavior_controller.run.events import Events, HealthChanged, TopicSaid

GONE, SLOW, FAILING, SILENT, NEW = "gone", "slow", "failing", "silent", "new"
SHORT = "out of resources"

SIMULATED_TIME = "simulated time"
"""The kind of a change of /clock, which is silent while that time stands still."""

SLOW_SHARE = 0.5
"""A service is slow when a call has taken this share of its deadline."""

LATE_FACTOR, LATE_RESERVE = 2.0, 3.0
"""A call whose usual time is known, such as that of a speech by its words, is slow after this many
times that time and these seconds."""

RATE_SHARE = 0.3
"""The share by which the rate of a topic has to change before that is noted."""

FAILURES_IN_A_ROW = 3
"""A service is failing after this number of failed calls in a row."""


def slow_after(usual: float, deadline: float) -> float:
    """Return after how many seconds a call is slow that usually takes ``usual`` seconds (0: that is
    not known)."""
    if not usual:
        return deadline * SLOW_SHARE
    return min(LATE_FACTOR * usual + LATE_RESERVE, deadline)


def gone(kind: str, name: str, node: str, reason: str, impact: str) -> HealthChanged:
    """Return the change of a service or topic that is gone; ``impact`` is what the robot cannot do
    without it."""
    return HealthChanged(kind, name, node, False, "gone: " + reason, "until it is back, " + impact)


def available_again(kind: str, name: str, node: str) -> HealthChanged:
    """Return the change of a service or topic that was gone."""
    return HealthChanged(kind, name, node, True, "available again", "")


class Health:
    """The state of each service and topic, by resolved name, in each respect that is monitored
    (``GONE`` …).

    Any thread may call ``report``, which only queues its argument for ``publish``, and ``hear``,
    and may read ``last_arrivals`` by name. All else belongs to the tick thread.
    """

    @tick_thread_only
    def __init__(self, wake: Callable[[], None] = lambda: None):
        """``wake`` is called after each report, so that the tick thread publishes it."""
        self._wake = wake
        self._reports: Deque[HealthChanged] = collections.deque()
        self._troubles: Dict[Tuple[str, str], HealthChanged] = {}  # by name and respect
        self._changes: List[HealthChanged] = []
        self._counts = True
        self._failures: Dict[str, int] = {}  # of each service since its last success
        self.last_arrivals: Dict[str, float] = {}
        """The time of each topic's last message, by the mission's clock."""
        self.said: Dict[str, TopicSaid] = {}
        """What each topic said last."""

    def report(self, respect: str, change: HealthChanged) -> None:
        """Report a state in one respect, from any thread; only a change is passed on."""
        self._reports.append(replace(change, respect=respect))
        self._wake()

    def hear(self, topic: str, at: float, words: str = "", rate: float = 0.0) -> None:
        """Report the time of a topic's last message, what it says, and how many come in a second,
        from any thread. This does not wake the tree."""
        self.last_arrivals[topic] = at
        before = self.said.get(topic)
        if before is not None and abs(before.rate - rate) < RATE_SHARE * rate:
            rate = before.rate  # a small change is none
        self.said[topic] = TopicSaid(topic, words, rate)

    @tick_thread_only
    def slow(self, service: str, deadline: float, kind: str = "service",
             usual: float = 0.0) -> None:
        """Note that a call has no answer after the time of ``slow_after``."""
        status = f"slow: no answer for {slow_after(usual, deadline):.3g} s"
        if usual:
            status += f", where about {max(1.0, usual):.0f} s are usual"
        self._note(HealthChanged(kind, service, "", False, status,
                                 f"a call is given up after {deadline:g} s", SLOW))
        self._wake()

    @tick_thread_only
    def ended(self, service: str, seconds: float, deadline: float, has_failed: bool,
              kind: str = "service", usual: float = 0.0) -> None:
        """Count a call that ended after ``seconds``; ``slow_after`` decides whether that was slow.
        """
        # of a node that is gone something stronger is known, which ends when it is started again
        is_counted = has_failed and self._counts and not self.is_gone(service)
        row = self._failures[service] = self._failures.get(service, 0) + 1 if is_counted else 0
        if row >= FAILURES_IN_A_ROW:
            self._note(HealthChanged(kind, service, "", False, f"failing: {row} calls in a row",
                                     "what needs it is tried again, left out or given up", FAILING))
        elif not has_failed:
            self._note(HealthChanged(kind, service, "", True, "works again", "", FAILING))
            if seconds < slow_after(usual, deadline):
                self._note(
                    HealthChanged(kind, service, "", True, "answers in time again", "", SLOW))

    @tick_thread_only
    def stop_counting(self) -> None:
        """Take no service for failing from now on, however many of its calls fail."""
        self._counts = False

    def _note(self, change: HealthChanged) -> None:
        """Keep a change for the next ``publish``."""
        key = (change.name, change.respect)
        if (key in self._troubles) is change.is_well:
            self._changes.append(change)
            self._troubles.pop(key, None)
            if not change.is_well:
                self._troubles[key] = change

    @tick_thread_only
    def is_gone(self, name: str) -> bool:
        """Return whether the service or topic was known to be gone when the changes were published
        last."""
        return (name, GONE) in self._troubles

    @tick_thread_only
    def gone_name(self, name: str) -> str:
        """Return the name of the node that offers a service or topic that is gone, or else the name
        of that service or topic."""
        change = self._troubles.get((name, GONE))
        if change is None:
            return name
        return change.owner

    @tick_thread_only
    def publish(self, events: Events) -> None:
        """Process the reports, and emit the changes since the last call."""
        while self._reports:
            self._note(self._reports.popleft())
        changes, self._changes = self._changes, []
        for change in changes:
            events.emit(change)
