"""Handles the signals: requests to stop the node, or to read its files again.

The signals are blocked, and a separate thread waits for them. A Python signal handler is not
enough: it runs on the main thread, and if the signal comes just before that thread sleeps, not
until it wakes. Nothing on this thread may hang: it reads no file, and lines are only queued at the
console.
"""
import math
import os
import signal
import threading
import time
from typing import Callable, Optional

from behavior_controller import exit_codes
from behavior_controller.ros.console import Console
from behavior_controller.ros.timeouts import start_thread

STOP_LIMIT = 1.8
"""Seconds after the first signal at which the process ends in any case (the limit is 2 s)."""

REACTION_LIMIT = 0.3
"""Seconds after the first signal after which ``ignored`` is called, while the process has not
ended."""

NOT_STOPPED = "did not stop in time: ending now; make sure that the robot has stopped too"

TAKEN = {signal.SIGINT, signal.SIGTERM, signal.SIGQUIT, signal.SIGHUP}


def block_signals() -> None:
    """Block the signals. To be called before any thread is started: threads inherit it."""
    signal.pthread_sigmask(signal.SIG_BLOCK, TAKEN)


class Signals:
    """SIGINT, SIGTERM and SIGQUIT request a stop; SIGHUP to read the files again, unless the
    terminal is gone."""

    def __init__(self, console: Console, wake: Callable[[], None], ignored: Callable[[], None]):
        """Handle the signals from now on. Raises RuntimeError if no thread can be started.

        ``wake`` is called at the first request to stop, ``ignored`` ``REACTION_LIMIT`` seconds
        later, on a thread of its own.
        """
        self.stop_requested = threading.Event()
        self.stop_code: Optional[int] = None
        """The exit code of a stop that has a special one."""
        self.is_over = False
        self.reload: Callable[[], None] = lambda: console.tell(
            "warning", "SIGHUP ignored: the mission has not begun")
        """Called at each SIGHUP that is not a hang-up. Must not wait for anything."""
        self._console, self._wake, self._ignored = console, wake, ignored
        self._deadline = math.inf  # when the process ends in any case
        uses_nohup = signal.getsignal(signal.SIGHUP) is signal.SIG_IGN
        self._ends_with_terminal = _terminal_answers() and not uses_nohup
        # an ignored signal would never reach sigwait
        for number in TAKEN:
            signal.signal(number, signal.SIG_DFL)
        start_thread("signals", self._take)

    @property
    def time_left(self) -> float:
        """Seconds until the process ends in any case; infinite while no stop is requested."""
        return self._deadline - time.monotonic()

    @staticmethod
    def request_stop() -> None:
        """Request a stop, as a signal from outside does."""
        os.kill(os.getpid(), signal.SIGTERM)

    def _take(self) -> None:
        """Act on each signal until one of them means stop."""
        while signal.sigwait(TAKEN) == signal.SIGHUP and (
                _terminal_answers() or not self._ends_with_terminal):
            self.reload()
        self._stop()

    def _stop(self) -> None:
        """Pass the request on, and end the process if it has not ended ``STOP_LIMIT`` seconds
        later."""
        self._deadline = time.monotonic() + STOP_LIMIT
        self.stop_requested.set()
        self._wake()
        time.sleep(REACTION_LIMIT)
        try:
            start_thread("stop", self._ignored)
        except RuntimeError:  # no thread is left
            self._ignored()
        time.sleep(max(0.0, self.time_left))
        if not self.is_over:
            self._console.tell("error", NOT_STOPPED)
            self._console.drain(0.1)
            os._exit(exit_codes.BROKEN)


def _terminal_answers() -> bool:
    """Return whether the controlling terminal of this process still exists."""
    try:
        os.close(os.open("/dev/tty", os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK))
    except OSError:
        return False
    return True
