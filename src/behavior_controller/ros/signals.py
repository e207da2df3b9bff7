"""Takes the signals: somebody wants the node to stop, or to read its files again.

The signals are blocked and taken by a thread that does nothing else. A Python signal handler would not do: it runs on
the main thread, and not before that thread wakes if the signal comes in the moment before it falls asleep.
"""
import os
import signal
import threading
import time
from typing import Callable, List, Set

from behavior_controller.ros.console import Console

STOP_LIMIT = 1.8
"""Seconds after the first signal at which the process ends, whatever it is doing (the limit is 2 s)."""

NOT_STOPPED = "did not stop in time: ending now; make sure that the robot has stopped too"
FAILED = 3


class Signals:
    """SIGINT and SIGTERM ask for a stop; SIGHUP asks to read the files again, unless the terminal has gone away."""

    def __init__(self, console: Console):
        self.stop_requested = False
        self.is_over = False
        self.reload: Callable[[], None] = lambda: None
        """Called on a thread of ours at each SIGHUP that is no hang-up."""
        self._console = console
        self._wakes: List[Callable[[], None]] = []
        self._lock = threading.Lock()
        self._has_terminal = _terminal_answers()
        self._outlives_terminal = signal.getsignal(signal.SIGHUP) is signal.SIG_IGN  # ``nohup``

    def listen(self) -> None:
        """Take the signals from now on. To be called before any thread is started."""
        signals = {signal.SIGINT, signal.SIGTERM, signal.SIGHUP}
        signal.pthread_sigmask(signal.SIG_BLOCK, signals)
        # an ignored signal would never reach sigwait
        signal.signal(signal.SIGHUP, signal.SIG_DFL)
        threading.Thread(target=self._take, args=(signals,), name="signals", daemon=True).start()

    def wake(self, callback: Callable[[], None]) -> None:
        """Have ``callback`` called, on another thread, when somebody wants us to stop; at once if he does already."""
        with self._lock:
            self._wakes.append(callback)
            is_late = self.stop_requested
        if is_late:
            callback()

    @staticmethod
    def request_stop() -> None:
        """Ask to stop, as a signal from outside does."""
        os.kill(os.getpid(), signal.SIGTERM)

    def _take(self, signals: Set[signal.Signals]) -> None:
        """Act on each signal until one of them means stop."""
        while signal.sigwait(signals) == signal.SIGHUP and not self._is_hang_up():
            self.reload()
        self._stop()

    def _is_hang_up(self) -> bool:
        """Whether the terminal that the operator started us from has gone away, and he did not mean us to stay."""
        return self._has_terminal and not self._outlives_terminal and not _terminal_answers()

    def _stop(self) -> None:
        """Pass the wish on, and end the process if it has not ended ``STOP_LIMIT`` seconds later."""
        with self._lock:
            self.stop_requested = True
            wakes = list(self._wakes)
        for wake in wakes:
            wake()
        time.sleep(STOP_LIMIT)
        if not self.is_over:
            # the terminal may be what hangs: the line is tried on a thread of its own
            threading.Thread(target=self._console.tell, args=("error", NOT_STOPPED), daemon=True).start()
            time.sleep(0.1)
            os._exit(FAILED)


def _terminal_answers() -> bool:
    """Return whether this process has a controlling terminal that is still there."""
    try:
        os.close(os.open("/dev/tty", os.O_RDWR | os.O_NOCTTY))
    except OSError:
        return False
    return True
