"""Ends the code of a leaf that does not return: a mission on a robot stands still then, and so
would a play."""
import contextlib
import signal
import threading
import time
from types import CodeType, FrameType
from typing import Iterator, Optional, Set

from behavior_controller import extensions
from behavior_controller.bt.engine.failure import node_on
from behavior_controller.missions.blocked_tick import CHECKS, INTERVAL

_known: Set[CodeType] = set()
"""What has blocked a play of this process: it is ended at the first check, since a rehearsal has
hundreds of plays."""


@contextlib.contextmanager
def ended() -> Iterator[None]:
    """Raise TimeoutError in the code of a leaf that has not returned for a second. On the main
    thread, which alone gets signals; elsewhere nothing is checked."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    seen: Optional[FrameType] = None
    checks = 0

    def check(_signal: int, frame: Optional[FrameType]) -> None:
        nonlocal seen, checks
        code = node_on(frame)[1] or next(iter(extensions.frames_of_packages(frame)), None)
        checks = checks + 1 if code is not None and code is seen else 0
        seen = code
        if code is not None and (checks == CHECKS or checks and code.f_code in _known):
            _known.add(code.f_code)
            seen, checks = None, 0
            raise TimeoutError(f"it has not returned for {CHECKS * INTERVAL:g} s; a leaf must not "
                               "wait, the mission stands still until it returns")

    before, began = signal.signal(signal.SIGALRM, check), time.monotonic()
    other, _ = signal.setitimer(signal.ITIMER_REAL, INTERVAL, INTERVAL)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)
        if other:  # a limit that the caller has set
            signal.setitimer(signal.ITIMER_REAL, max(INTERVAL, other + began - time.monotonic()))
