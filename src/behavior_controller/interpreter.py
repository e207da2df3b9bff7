"""Moments at which Python's garbage collection would do harm."""
import contextlib
import gc
import sys
from types import FrameType
from typing import Iterator, Optional


@contextlib.contextmanager
def garbage_collection_paused() -> Iterator[None]:
    """Collect no garbage meanwhile, such as in a growing mission, which has none."""
    was_enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_enabled:
            gc.enable()


def frame_of(thread: Optional[int]) -> Optional[FrameType]:
    """Return the frame that the thread of this number executes; None if it has ended.

    Before Python 3.12 garbage that is collected during this may let another thread run, and if that
    one ends, the whole program waits for ever (Python's issue 106883).
    """
    with garbage_collection_paused():
        return sys._current_frames().get(thread or 0)
