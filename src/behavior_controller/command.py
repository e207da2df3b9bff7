"""Runs a program to its exit code: the commands, the node and the simulated nodes. What is missing
or broken is a line on the terminal, also where a standard stream is closed, full, or has a small
character set."""
import contextlib
import importlib
import os
import signal
import sys
from typing import Any, Callable, List, NoReturn

from behavior_controller import NOT_SET_UP, exit_codes, extensions
from behavior_controller.errors import FaultsFound
from behavior_controller.text import without_controls


def no_resources(error: BaseException) -> str:
    """Return the line for a shortage of the machine."""
    reason = str(error) or type(error).__name__
    return f"the machine gives no more memory, threads or files: {reason}"


def run(name: str, module: str, function: str = "main", redraws: bool = False) -> NoReturn:
    """End with the exit code of a command's ``function``; if it cannot do its work, a line says
    why.

    Control characters in what it prints are escaped; a command that ``redraws`` may move the cursor
    and clear lines. A reader that goes away (``| head``) ends it.
    """
    _open_closed_streams()
    signal.signal(signal.SIGPIPE, signal.SIG_DFL)
    for stream in (sys.stdout, sys.stderr):
        _make_safe(stream, redraws)
    main = _loaded(name, module, function, exit_codes.UNAVAILABLE)
    code, reasons = exit_codes.UNAVAILABLE, []
    try:
        try:
            code = main()
        finally:  # argparse ends a command by itself
            sys.stdout.flush()
    except OSError as error:
        code = exit_codes.UNAVAILABLE
        named = f"{error.filename}: " if error.filename else ""
        reasons = [f"the output cannot be written: {named}{error.strerror}"]
    except FaultsFound as error:  # of another package's leaves
        code, reasons = exit_codes.WRONG_INPUT, _lines(error)
    except ImportError as error:
        reasons = [str(error)]
    except (MemoryError, RecursionError):
        reasons = ["there is too little memory for this"]
    if reasons:
        _discard(sys.stdout.fileno())
    _complain(name, reasons + [str(doubt) for doubt in extensions.doubts()])
    sys.exit(code)


def run_node(name: str, module: str, function: str, *arguments: str) -> NoReturn:
    """End with the exit code of a ROS node's ``function``. Its streams stay as they are."""
    _open_closed_streams()
    main = _loaded(name, module, function, exit_codes.BROKEN)
    try:
        sys.exit(main(*arguments))
    except (MemoryError, OSError, RuntimeError) as error:
        reason = no_resources(error)
    _end(name, exit_codes.BROKEN, [reason])


def _loaded(name: str, module: str, function: str, broken: int) -> Callable[..., int]:
    """Import and return a function. Ends with the lines of what is wrong; ``broken`` is the exit
    code if that is neither a package that is missing or too old nor another package's export."""
    try:
        return getattr(importlib.import_module(module), function)
    except FaultsFound as error:
        code, reasons = exit_codes.WRONG_INPUT, _lines(error)
    except ModuleNotFoundError as error:
        code, reasons = exit_codes.UNAVAILABLE, [NOT_SET_UP.format(error, sys.executable)]
    except (ImportError, MemoryError, OSError, RuntimeError) as error:
        code, reasons = broken, ["cannot be loaded: " + (str(error) or type(error).__name__)]
        if getattr(error, "name", None) == "py_trees":
            code, reasons = exit_codes.UNAVAILABLE, [str(error)]  # it is too old
    _end(name, code, reasons)


def _end(name: str, code: int, reasons: List[str]) -> NoReturn:
    """End with these lines. Threads must not hold the process, and the node's streams need one."""
    lines = "".join(f"{name}: {reason}\n" for reason in reasons)
    with contextlib.suppress(OSError):
        os.write(2, without_controls(lines).encode("utf-8", "backslashreplace"))
    os._exit(code)


def _lines(error: FaultsFound) -> List[str]:
    return [str(fault) for fault in error.faults]


def _make_safe(stream: Any, redraws: bool) -> None:
    write = stream.write
    stream.reconfigure(errors="backslashreplace")
    stream.write = lambda text: write(without_controls(text, redraws))


def _open_closed_streams() -> None:
    """Open closed standard streams on the null device.

    Modules expect them to be open (py_trees asks for them), and would write to a socket that got
    the descriptor of a closed one.
    """
    spare = os.open(os.devnull, os.O_RDWR)
    while spare < 3:
        spare = os.dup(spare)
    os.close(spare)
    for number, (name, mode) in enumerate((("stdin", "r"), ("stdout", "w"), ("stderr", "w"))):
        if getattr(sys, name) is None:
            setattr(sys, name, open(number, mode))


def _discard(descriptor: int) -> None:
    """Discard the rest of a buffer: Python would try to write it again at exit and print its own
    error."""
    null = os.open(os.devnull, os.O_WRONLY)
    os.dup2(null, descriptor)
    os.close(null)


def _complain(name: str, lines: List[str]) -> None:
    try:
        for line in lines:
            sys.stderr.write(f"{name}: {line}\n")
        sys.stderr.flush()
    except OSError:
        _discard(sys.stderr.fileno())
