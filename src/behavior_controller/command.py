"""Runs a command-line tool to its exit code, even if a standard stream is closed, full, or has a small character set."""
import os
import sys
from typing import Callable, Optional

from behavior_controller import exits

def run(name: str, main: Callable[[], int]) -> int:
    """Return the exit code of ``main``, or ``UNAVAILABLE`` with a line on the terminal. The streams are open."""
    for stream in (sys.stdout, sys.stderr):
        stream.reconfigure(errors="backslashreplace")  # type: ignore[union-attr]
    code = exits.UNAVAILABLE
    reason: Optional[str] = None
    try:
        try:
            code = main()
        finally:  # argparse ends a tool by itself
            sys.stdout.flush()
    except OSError as error:
        reason = "the output cannot be written: {}".format(error.strerror)
    except ImportError as error:  # of another package's leaves
        reason = str(error)
    except (MemoryError, RecursionError):
        reason = "there is too little memory for this"
    if reason:
        _discard(sys.stdout.fileno())
        code = exits.UNAVAILABLE
        _complain("{}: {}\n".format(name, reason))
    return code


def open_closed_streams() -> None:
    """Open closed standard streams on the null device.

    Modules expect them to be open, and would write to a socket that got the descriptor of a closed one.
    """
    spare = os.open(os.devnull, os.O_RDWR)
    while spare < 3:
        spare = os.dup(spare)
    os.close(spare)
    for number, (name, mode) in enumerate((("stdin", "r"), ("stdout", "w"), ("stderr", "w"))):
        if getattr(sys, name) is None:
            setattr(sys, name, open(number, mode))


def _discard(descriptor: int) -> None:
    """Discard the rest of a buffer: Python would try to write it again at exit and print its own error."""
    null = os.open(os.devnull, os.O_WRONLY)
    os.dup2(null, descriptor)
    os.close(null)


def _complain(text: str) -> None:
    try:
        sys.stderr.write(text)
        sys.stderr.flush()
    except OSError:
        _discard(sys.stderr.fileno())
