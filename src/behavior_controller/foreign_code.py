"""What code of other packages raised: in one line, with its place in Python."""
import inspect
import opcode
import os
import signal
import traceback
from types import FunctionType
from typing import List, Tuple

from behavior_controller.text import bracketed, joined

_RAISE = opcode.opmap["RAISE_VARARGS"]

OUR_PACKAGES = ("behavior_controller.", "unit_tests.")
_OURS = os.path.dirname(os.path.abspath(__file__)) + os.sep
_PYTHONS_OWN = os.path.dirname(os.path.abspath(traceback.__file__)) + os.sep


def described(error: BaseException, owner: object = None) -> str:
    """Return kind, text and place of ``error``: ``KeyError: 'gripper' (greeter/leaves.py:31)``.
    Raises it again if it is a Ctrl-C, for which no code is to blame.

    ``owner`` is the foreign class or function that is to blame if no foreign code raised it.
    """
    if is_ctrl_c(error):
        raise error
    try:
        # the text of a syntax error names the file without its folder
        text = " ".join(str(getattr(error, "msg", None) or error).split())
    except BaseException as another:  # even its text is foreign code
        text = f"its text raised {type(another).__name__}"
    return joined(": ", type(error).__name__, text) + bracketed(_raised_at(error, owner))


def _raised_at(error: BaseException, owner: object) -> str:
    """Return the place in the foreign code that ours has called, also if a library raised that this
    code uses."""
    if isinstance(error, SyntaxError) and error.filename:
        return place(error.filename, error.lineno or 0)
    places = [(frame.f_code.co_filename, line)
              for frame, line in traceback.walk_tb(error.__traceback__)
              if "importlib" not in frame.f_code.co_filename and
              os.path.basename(frame.f_code.co_filename) != "extensions.py"]
    foreign = [(file, line) for file, line in places if _is_foreign(file)]
    if foreign:
        folder = os.path.dirname(foreign[0][0])
        places = [(file, line) for file, line in foreign if file.startswith(folder)]
    else:
        places += _defined_at(owner)
    return place(*places[-1]) if places else ""


def _defined_at(owner: object) -> List[Tuple[str, int]]:
    """Return where a foreign function, or the first one of a foreign class, is defined."""
    owner = getattr(owner, "func", owner)  # of a partial
    owner = getattr(owner, "__func__", owner)  # of a method
    parts = list(vars(owner).values()) if isinstance(owner, type) else [owner]
    codes = [part.__code__ for part in parts if isinstance(part, FunctionType)]
    return [(code.co_filename, code.co_firstlineno) for code in codes[:1]
            if _is_foreign(code.co_filename)]


def defined_at(owner: object) -> str:
    """Return the place of a foreign function in brackets; of another one an empty text."""
    places = _defined_at(owner)
    return bracketed(place(*places[0])) if places else ""


def takes(function: object, count: int) -> bool:
    """Return whether a function can be called with so many arguments. Some of Python's own do not
    tell; they count as if they could."""
    try:
        inspect.signature(function).bind(*[None] * count)  # type: ignore[arg-type]
    except TypeError:
        return False
    except ValueError:
        return True
    return True


def _is_foreign(file: str) -> bool:
    """Return whether a file is neither this package's nor in Python's own library."""
    return not file.startswith(_OURS) and ("-packages" in file or not file.startswith(_PYTHONS_OWN))


def place(file: str, line: int) -> str:
    """Return ``folder/file.py:line``."""
    file = os.path.join(os.getcwd(), file)
    return f"{'/'.join(file.split(os.sep)[-2:])}:{line}"


def is_ctrl_c(error: BaseException) -> bool:
    """Return whether Python raised ``error`` because of a Ctrl-C, wherever the program was, and not
    a statement of it."""
    if not isinstance(error, KeyboardInterrupt):
        return False
    if signal.getsignal(signal.SIGINT) is not signal.default_int_handler:
        return False
    innermost = error.__traceback__
    while innermost is not None and innermost.tb_next is not None:
        innermost = innermost.tb_next
    return innermost is None or innermost.tb_frame.f_code.co_code[innermost.tb_lasti] != _RAISE
