"""Runs what may hang (a frozen master, a dead disk) on a thread of its own, and waits for it as long as is sensible."""
import threading
import time
from typing import Any, Callable, Iterable, List

from behavior_controller.bt.engine.wakeup import WakeUp
from behavior_controller.errors import BehaviorControllerError


class Stopped(BehaviorControllerError):
    """A stop was requested while the work was under way."""


class Late(BehaviorControllerError):
    """The work did not end in time; its thread hangs on."""


def run_apart(work: Callable[[], Any], wake: WakeUp, is_stopped: Callable[[], bool], seconds: float) -> Any:
    """Return what ``work()`` returns on another thread, or raise what it raises.

    Raises ``Stopped`` as soon as ``wake`` is signalled and ``is_stopped()``, ``Late`` after ``seconds``, and
    RuntimeError if no thread can be started.
    """
    results: List[Any] = []
    errors: List[BaseException] = []

    def run() -> None:
        try:
            results.append(work())
        except BaseException as error:  # raised again by the thread that waits
            errors.append(error)
        wake.emit()

    threading.Thread(target=run, name="apart", daemon=True).start()
    ends = time.monotonic() + seconds
    while not results and not errors:
        if is_stopped():
            raise Stopped("stopped")
        if time.monotonic() >= ends:
            raise Late("not done in {:g} s".format(seconds))
        wake.wait(max(0.0, ends - time.monotonic()))
        wake.test_and_clear()
    if errors:
        raise errors[0]
    return results[0]


def run_together(works: Iterable[Callable[[], Any]], seconds: float) -> None:
    """Run ``works`` side by side and return when all have ended, after ``seconds`` at the latest."""
    threads = [threading.Thread(target=work, daemon=True) for work in works]
    ends = time.monotonic() + seconds
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(max(0.0, ends - time.monotonic()))
