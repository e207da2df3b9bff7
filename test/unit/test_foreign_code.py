"""An exception is told in one line with the place in the code that is to blame: another package's,
before the libraries that it uses, and before ours, which called it."""
import functools
import importlib
import json
import os
import signal

import pytest

from behavior_controller import foreign_code
from behavior_controller.foreign_code import defined_at, described, is_ctrl_c

HERE = "unit/test_foreign_code.py:"
OURS = os.path.join(os.path.dirname(foreign_code.__file__), "cli.py")
EXTENSIONS = os.path.join(os.path.dirname(foreign_code.__file__), "extensions.py")
LIBRARY, IMPORTS = json.__file__, importlib.__file__
INSTALLED = os.path.join(os.path.dirname(os.path.dirname(LIBRARY)), "dist-packages", "arm", "a.py")


def raised(files, statement="raise KeyError('gripper')"):
    """Return what the last of these files raises; line 1 of the first calls line 2 of the next."""
    names = {}
    for line, file in reversed(list(enumerate(files))):
        names = {"code": compile("\n" * line + statement, file, "exec"), "names": names}
        statement = "exec(code, names)"
    try:
        # exec of a text would have Python 3.8 end with SIGINT after a Ctrl-C in it
        exec(compile(statement, "<test>", "exec"), names)
    except BaseException as error:
        return error.with_traceback(error.__traceback__.tb_next.tb_next)


@pytest.mark.parametrize("files, place", [
    (["/ws/greeter/leaves.py"], "greeter/leaves.py:1"),
    ([OURS, "/ws/greeter/leaves.py"], "greeter/leaves.py:2"),
    (["/ws/greeter/leaves.py", OURS], "greeter/leaves.py:1"),
    ([OURS, "/ws/greeter/leaves.py", "/ws/greeter/moving.py"], "greeter/moving.py:3"),
    ([OURS, "/ws/greeter/leaves.py", LIBRARY], "greeter/leaves.py:2"),
    ([OURS, "/ws/greeter/leaves.py", INSTALLED], "greeter/leaves.py:2"),
    ([OURS, "/ws/greeter/leaves.py", "/ws/arm/arm.py"], "greeter/leaves.py:2"),
    ([OURS, INSTALLED, LIBRARY], "arm/a.py:2"),
    ([OURS], "behavior_controller/cli.py:1"),
    ([EXTENSIONS, IMPORTS, "/ws/greeter/leaves.py"], "greeter/leaves.py:3"),
    ([EXTENSIONS, IMPORTS], ""),  # the module is missing
])
def test_the_place_is_in_the_code_of_another_package(files, place):
    where = " ({})".format(place) if place else ""
    assert described(raised(files)) == "KeyError: 'gripper'" + where


class Gripper:
    """A class of another package."""

    force = 1

    def open(self):
        """The first function."""

    def close(self):
        """Another one."""


def grip():
    """A function of another package."""


FIRST = HERE + str(Gripper.open.__code__.co_firstlineno)
GRIP = HERE + str(grip.__code__.co_firstlineno)


@pytest.mark.parametrize("owner, place", [
    (Gripper, FIRST), (grip, GRIP), (functools.partial(grip, 1), GRIP), (defined_at, ""),
    (json.loads, ""), (int, ""), (None, "")])
def test_the_owner_is_to_blame_where_its_code_did_not_run(owner, place):
    where = " ({})".format(place) if place else ""
    assert defined_at(owner) == where
    assert described(TypeError("too few"), owner) == "TypeError: too few" + where
    if place:
        assert described(raised([OURS]), owner) == "KeyError: 'gripper'" + where
        assert described(raised(["/ws/a/b.py"]), owner) == "KeyError: 'gripper' (a/b.py:1)"


def test_an_exception_is_one_line_whatever_its_text():
    assert described(ValueError("one\n  two")) == "ValueError: one two"
    assert described(ValueError()) == "ValueError"


def test_the_text_of_a_syntax_error_has_its_place():
    try:
        compile("x = (", "leaves.py", "exec")
    except SyntaxError as error:
        text = described(error)
    assert text.startswith("SyntaxError: ") and text.endswith("/leaves.py:1)")


@pytest.fixture(name="ctrl_c")
def ctrl_c_raises():
    """Ctrl-C is Python's own; a shell may have its background jobs ignore it."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


INTERRUPTED = "import signal\nfor _ in range(9): signal.raise_signal(signal.SIGINT)"


@pytest.mark.parametrize("statement, expected", [
    (INTERRUPTED, True), ("raise KeyboardInterrupt", False), ("raise SystemExit", False)])
@pytest.mark.parametrize("depth", [1, 2, 3])
def test_a_ctrl_c_is_told_from_a_statement_that_raises_the_same(ctrl_c, statement, expected, depth):
    assert is_ctrl_c(raised(["/ws/greeter/leaves.py"] * depth, statement)) is expected


def test_where_a_program_treats_ctrl_c_itself_python_raises_nothing(ctrl_c):
    interrupted = raised(["/ws/greeter/leaves.py"], INTERRUPTED)
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    assert not is_ctrl_c(interrupted)
