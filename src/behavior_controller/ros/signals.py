"""Handles the signals: requests to stop the node, or to read its files again.

The signals are blocked, and a separate thread waits for them. A Python signal handler is not enough: it runs on the main
thread, and if the signal comes just before that thread sleeps, not until it wakes. Nothing on this thread may hang: it
reads no file, and lines are only queued at the console.
"""
import os
import signal
import threading
import time
from typing import Callable, List

from behavior_controller import exits
from behavior_controller.ros.console import Console

STOP_LIMIT = 1.8
"""Seconds after the first signal at which the process ends in any case (the limit is 2 s)."""

NOT_STOPPED = "did not stop in time: ending now; make sure that the robot has stopped too"

TAKEN = {signal.SIGINT, signal.SIGTERM, signal.SIGQUIT, signal.SIGHUP}


def block_signals() -> None:
    """Block the signals. To be called before any thread is started: threads inherit it."""
    signal.pthread_sigmask(signal.SIG_BLOCK, TAKEN)


class Signals:
    """SIGINT, SIGTERM and SIGQUIT request a stop; SIGHUP to read the files again, unless the terminal is gone."""

    def __init__(self, console: Console):
        self.stop_requested = False
        self.is_over = False
        self.reload: Callable[[], None] = lambda: console.tell("warning", "SIGHUP ignored: the mission has not begun")
        """Called at each SIGHUP that is not a hang-up. Must not wait for anything."""
        self._console = console
        self._wakes: List[Callable[[], None]] = []
        self._lock = threading.Lock()
        self._has_terminal = _terminal_answers()
        self._outlives_terminal = signal.getsignal(signal.SIGHUP) is signal.SIG_IGN  # ``nohup``

    def listen(self) -> None:
        """Handle the signals from now on. Raises RuntimeError if no thread can be started."""
        # an ignored signal would never reach sigwait
        for number in TAKEN:
            signal.signal(number, signal.SIG_DFL)
        threading.Thread(target=self._take, name="signals", daemon=True).start()

    def wake(self, callback: Callable[[], None]) -> None:
        """Have ``callback`` called, on another thread, at the first request to stop; at once if that has come already."""
        with self._lock:
            self._wakes.append(callback)
            is_late = self.stop_requested
        if is_late:
            callback()

    @staticmethod
    def request_stop() -> None:
        """Request a stop, as a signal from outside does."""
        os.kill(os.getpid(), signal.SIGTERM)

    def _take(self) -> None:
        """Act on each signal until one of them means stop."""
        while signal.sigwait(TAKEN) == signal.SIGHUP and not self._is_hang_up():
            self.reload()
        self._stop()

    def _is_hang_up(self) -> bool:
        """Whether the terminal in which the node was started is gone, and ``nohup`` was not used."""
        return self._has_terminal and not self._outlives_terminal and not _terminal_answers()

    def _stop(self) -> None:
        """Pass the request on, and end the process if it has not ended ``STOP_LIMIT`` seconds later."""
        with self._lock:
            self.stop_requested = True
            wakes = list(self._wakes)
        for wake in wakes:
            wake()
        time.sleep(STOP_LIMIT)
        if not self.is_over:
            self._console.tell("error", NOT_STOPPED)
            self._console.drain(0.1)
            os._exit(exits.BROKEN)


def _terminal_answers() -> bool:
    """Return whether the controlling terminal of this process still exists."""
    try:
        os.close(os.open("/dev/tty", os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK))
    except OSError:
        return False
    return True
