"""Runs a program to its exit code: the commands, the node and the simulated nodes. What is missing
or broken is a line on the terminal, also where a standard stream is closed, full, or has a small
character set."""
import contextlib
import gc
import importlib
import os
import signal
import sys
import threading
import warnings
from functools import partial
from typing import Any, Callable, List, NoReturn

from behavior_controller import NOT_SET_UP, exit_codes, extensions
from behavior_controller.errors import FaultsFound
from behavior_controller.text import without_controls


def no_resources(error: BaseException) -> str:
    """Return the line for a shortage of the machine."""
    reason = str(error) or type(error).__name__
    return ("the machine gives no more memory, threads or files; end what uses them up, or raise "
            f"the limits (ulimit -n, ulimit -u): {reason}")


def run(name: str, module: str, function: str = "main", redraws: bool = False) -> NoReturn:
    """End with the exit code of a command's ``function``; if it cannot do its work, a line says
    why.

    Control characters in what it prints are escaped; a command that ``redraws`` may move the cursor
    and clear lines. A reader that goes away (``| head``) ends it.
    """
    _prepare()
    signal.signal(signal.SIGPIPE, signal.SIG_DFL)
    for stream in (sys.stdout, sys.stderr):
        _make_safe(stream, redraws)
    extensions.watch()
    threading.excepthook = partial(_report_thread, name, threading.excepthook)
    main = _loaded(name, module, function, exit_codes.UNAVAILABLE)
    code, lines = exit_codes.UNAVAILABLE, []
    try:
        try:
            code = main()
        finally:  # argparse ends a command by itself
            sys.stdout.flush()
    except OSError as error:
        code = exit_codes.UNAVAILABLE
        named = f"{error.filename}: " if error.filename else ""
        lines = [f"the output cannot be written: {named}{error.strerror}"]
    except FaultsFound as error:  # of another package's leaves
        code, lines = exit_codes.WRONG_INPUT, str(error).split("\n")
    except ImportError as error:
        lines = [str(error)]
    except (MemoryError, RecursionError):
        lines = ["there is too little memory for this"]
    lines += map(str, extensions.doubts)
    if lines:
        _end(name, code, lines)
    gc.freeze()  # Python would search all that is left for garbage before it ends
    sys.exit(code)


def run_node(name: str, module: str, function: str, *arguments: str) -> NoReturn:
    """End with the exit code of a ROS node's ``function``. Its streams stay as they are."""
    _prepare()
    main = _loaded(name, module, function, exit_codes.BROKEN)
    try:
        sys.exit(main(*arguments))
    except (MemoryError, OSError, RuntimeError) as error:
        _end(name, exit_codes.BROKEN, [no_resources(error)])


def _report_thread(name: str, report: Callable[[Any], Any], failed: Any) -> None:
    """Write a line about a thread of another package that has failed; ``report`` all others."""
    failure = extensions.thread_failure(failed.exc_value)
    if failure is None:
        report(failed)
    else:
        sys.stderr.write(f"{name}: {failure}\n")


def _loaded(name: str, module: str, function: str, broken: int) -> Callable[..., int]:
    """Import and return a function. Ends with the lines of what is wrong; ``broken`` is the exit
    code if that is neither a package that is missing or too old nor another package's export."""
    try:
        return getattr(importlib.import_module(module), function)
    except FaultsFound as error:
        code, lines = exit_codes.WRONG_INPUT, str(error).split("\n")
    except ModuleNotFoundError as error:
        code, lines = exit_codes.UNAVAILABLE, [NOT_SET_UP.format(error, sys.executable)]
    except (ImportError, MemoryError, OSError, RuntimeError) as error:
        code, lines = broken, ["cannot be loaded: " + (str(error) or type(error).__name__)]
        if getattr(error, "name", None) == "py_trees":
            code, lines = exit_codes.UNAVAILABLE, [str(error)]  # it is too old
    _end(name, code, lines)


def _end(name: str, code: int, lines: List[str]) -> NoReturn:
    """End with these lines on standard error.

    Nothing holds the process: no thread, no standard error that is full, and no rest of an output
    that cannot be written.
    """
    text = without_controls("".join(f"{name}: {line}\n" for line in lines))
    with contextlib.suppress(OSError):
        sys.stderr.flush()
        os.write(2, text.encode(sys.stderr.encoding or "utf-8", "backslashreplace"))
    os._exit(code)


def _make_safe(stream: Any, redraws: bool) -> None:
    write = stream.write
    stream.reconfigure(errors="backslashreplace")
    stream.write = lambda text: write(without_controls(text, redraws))


def _prepare() -> None:
    """Open closed standard streams on the null device, and let no warning be an error.

    Modules expect the streams to be open (py_trees asks for them), and would write to a socket that
    got the descriptor of a closed one. Modules of ROS warn, and with PYTHONWARNINGS=error each
    warning would be an exception.
    """
    if any(each[0] == "error" for each in warnings.filters):
        warnings.simplefilter("default")
    spare = os.open(os.devnull, os.O_RDWR)
    while spare < 3:
        spare = os.dup(spare)
    os.close(spare)
    for number, (name, mode) in enumerate((("stdin", "r"), ("stdout", "w"), ("stderr", "w"))):
        if getattr(sys, name) is None:
            setattr(sys, name, open(number, mode))
