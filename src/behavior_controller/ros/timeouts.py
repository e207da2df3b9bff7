"""Runs work that may hang (a frozen master, a dead disk) on a separate thread, and waits for it
with a limit."""
import threading
import time
from concurrent.futures import Future
from types import FrameType
from typing import Any, Callable, Iterable, Optional, Tuple

from behavior_controller.wakeup import WakeUp
from behavior_controller.errors import BehaviorControllerError
from behavior_controller.interpreter import frame_of
from behavior_controller.ros.shortage import SHORTAGE


class Stopped(BehaviorControllerError):
    """A stop was requested while the work was under way."""


class Late(BehaviorControllerError):
    """The work did not end in time; its thread goes on. ``frame`` is where it was then, if that is
    known."""

    def __init__(self, text: str, frame: Optional[FrameType]):
        super().__init__(text)
        self.frame = frame


NOTICE_AFTER = 2.0
"""Seconds after which ``is_slow`` is called for work that has not ended."""


def start_thread(name: str, work: Callable[..., object], *arguments: Any) -> threading.Thread:
    """Run ``work`` on a daemon thread: one that hangs does not keep the process from its end.

    Raises RuntimeError if no thread can be started.
    """
    thread = threading.Thread(target=work, args=arguments, name=name, daemon=True)
    try:
        thread.start()
    except RuntimeError as error:
        SHORTAGE.note(error)
        raise
    return thread


def begin(name: str, work: Callable[[], Any]) -> "Tuple[threading.Thread, Future[Any]]":
    """Run ``work`` on a daemon thread; return the thread and what gets the result or the error."""
    outcome: "Future[Any]" = Future()

    def run() -> None:
        try:
            outcome.set_result(work())
        except BaseException as error:  # raised again where it is awaited
            outcome.set_exception(error)

    return start_thread(name, run), outcome


def run_apart(work: Callable[[], Any], wake: WakeUp, is_stopped: Callable[[], bool], seconds: float,
              is_slow: Callable[[], None] = lambda: None) -> Any:
    """Return what ``work()`` returns on another thread, or raise what it raises.

    ``is_slow`` is called, on this thread, if it has not ended after ``NOTICE_AFTER`` seconds.
    Raises ``Stopped`` as soon as ``wake`` is signalled and ``is_stopped()``, ``Late`` after
    ``seconds``, and RuntimeError if no thread can be started.
    """
    thread, outcome = begin("apart", work)
    outcome.add_done_callback(lambda _: wake.emit())
    deadline = time.monotonic() + seconds
    slow_at = time.monotonic() + NOTICE_AFTER
    while not outcome.done():
        now = time.monotonic()
        if is_stopped():
            raise Stopped("stopped")
        if now >= deadline:
            raise Late(f"not done in {seconds:g} s", frame_of(thread.ident))
        if now >= slow_at:
            is_slow()
            slow_at = deadline
        wake.wait(min(deadline, slow_at) - now)
        wake.test_and_clear()
    return outcome.result()


def run_together(works: Iterable[Callable[[], Any]], seconds: float) -> None:
    """Run ``works`` side by side and return when all have ended, after ``seconds`` at the latest.
    """
    deadline = time.monotonic() + seconds
    for thread in [start_thread("beside", work) for work in works]:
        thread.join(max(0.0, deadline - time.monotonic()))
