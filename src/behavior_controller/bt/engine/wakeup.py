"""The wake-up signal of a tree: one flag that any thread or signal handler may set and the tick
thread waits for."""
import queue
from typing import Optional


class WakeUp:
    """BehaviorTree.CPP's wake-up signal.

    Built on SimpleQueue because its ``put`` may be called from a signal handler at any moment; an
    Event could lock up.
    """

    def __init__(self) -> None:
        self._queue: "queue.SimpleQueue[None]" = queue.SimpleQueue()
        self._signalled = False

    def emit(self) -> None:
        """Set the flag and wake the waiting thread."""
        if not self._signalled:
            self._signalled = True
            self._queue.put(None)

    @property
    def is_set(self) -> bool:
        """Whether the flag is set."""
        return self._signalled

    def test_and_clear(self) -> bool:
        """Return whether the flag was set since it was last cleared, and clear it."""
        if not self._signalled:
            return False
        # cleared before the queue is drained: a signal that comes in between leaves the flag set
        # and is not lost
        self._signalled = False
        while not self._queue.empty():
            self._queue.get()
        return True

    def wait(self, seconds: Optional[float]) -> None:
        """Return when the flag is set, after ``seconds`` at the latest (None: no limit). Does not
        clear the flag."""
        if self._signalled:
            return
        try:
            self._queue.get(timeout=seconds)
        except queue.Empty:
            pass
