"""The wake-up signal of a tree: one flag that any thread or signal handler may set and the tick
thread waits for."""
import contextlib
import threading
from typing import Optional


class WakeUp:
    """BehaviorTree.CPP's wake-up signal.

    Built on a lock, which is free while a signal waits to be taken. A signal handler may free it at
    any moment, where an Event could lock up. A SimpleQueue may wait for ever in Python 3.8, though
    its limit is over.
    """

    def __init__(self) -> None:
        self._free = threading.Lock()
        self._free.acquire()
        self._signalled = False

    def emit(self) -> None:
        """Set the flag and wake the waiting thread."""
        if not self._signalled:
            self._signalled = True
            with contextlib.suppress(RuntimeError):  # another thread has freed it
                self._free.release()

    @property
    def is_set(self) -> bool:
        """Whether the flag is set."""
        return self._signalled

    def test_and_clear(self) -> bool:
        """Return whether the flag was set since it was last cleared, and clear it."""
        if not self._signalled:
            return False
        # cleared before the lock is taken: a signal that comes in between leaves the flag set and
        # is not lost
        self._signalled = False
        self._free.acquire(blocking=False)
        return True

    def wait(self, seconds: Optional[float]) -> None:
        """Return when the flag is set, after ``seconds`` at the latest (None: no limit). Does not
        clear the flag."""
        if not self._signalled:
            self._free.acquire(timeout=-1 if seconds is None else max(0.0, seconds))
