"""The debug check of the thread rule: an object of the tick thread fails if another thread uses it,
at that line.

On if ``BEHAVIOR_CONTROLLER_CHECK_THREADS`` is set in the environment when this is imported, as in
the tests.
"""
import functools
import os
import threading
from typing import Any, Callable, TypeVar, cast

IS_CHECKED = bool(os.environ.get("BEHAVIOR_CONTROLLER_CHECK_THREADS"))

Method = TypeVar("Method", bound=Callable[..., Any])


class WrongThread(AssertionError):
    """A mistake in the program: a thread uses an object of another thread, which it should ``post``
    to."""


def tick_thread_only(method: Method) -> Method:
    """Let the first thread that calls such a method of an object be the only one, for as long as it
    lives."""
    return checked(method) if IS_CHECKED else method


def checked(method: Method) -> Method:
    """Return ``method`` with the check, which raises WrongThread."""
    @functools.wraps(method)
    def check(self: Any, *arguments: Any, **named: Any) -> Any:
        here = threading.current_thread()
        owner = self.__dict__.setdefault("_owner_thread", here)
        if owner is not here:
            if owner.is_alive():
                raise WrongThread(f"{method.__qualname__} on the thread {here.name!r}: it belongs "
                                  f"to {owner.name!r}")
            self._owner_thread = here
        return method(self, *arguments, **named)
    return cast(Method, check)
