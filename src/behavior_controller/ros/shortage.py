"""What this computer gives no more: memory, threads, files. No peer is to blame for it: whoever
meets it notes it here, and the monitor reports it.
"""
import errno
import math
import time
from typing import Optional

SHORTAGES = (errno.ENOMEM, errno.EAGAIN, errno.EMFILE, errno.ENFILE, errno.ENOSPC)
"""The system's error numbers for a shortage of memory, threads, files or disk space."""

NO_MORE = "start new thread", "can't allocate"
"""Python's words where the system gives no thread, or no memory for a lock."""

LASTS = 2.0
"""Seconds after which a shortage that nothing meets any more is over."""


def is_shortage(error: BaseException) -> bool:
    """Whether the cause of ``error`` is a shortage of the machine, or a limit set on it."""
    return (isinstance(error, MemoryError) or
            isinstance(error, OSError) and error.errno in SHORTAGES or
            isinstance(error, RuntimeError) and any(words in str(error) for words in NO_MORE))


def shortage_behind(error: Optional[BaseException]) -> Optional[BaseException]:
    """Return the shortage that ``error`` is, or follows from; None if it is about something else.
    """
    while error is not None and not is_shortage(error):
        error = error.__cause__ or error.__context__
    return error


class Shortage:
    """The shortage that was met last. Any thread may note and read it."""

    def __init__(self) -> None:
        self._met_at, self._error = -math.inf, ""

    def note(self, error: BaseException) -> None:
        """Note a shortage."""
        self._met_at, self._error = time.monotonic(), str(error) or type(error).__name__

    @property
    def now(self) -> str:
        """What was short within the last ``LASTS`` seconds, in the system's words; empty: nothing.
        """
        return self._error if time.monotonic() - self._met_at < LASTS else ""


SHORTAGE = Shortage()
"""That of this process."""
