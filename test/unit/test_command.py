"""A program ends with its exit code; what it lacks is a line, also where a stream is closed or
full."""
import io
import os
import signal
import subprocess
import sys
from types import SimpleNamespace

import pytest

from behavior_controller import command, exit_codes, extensions
from behavior_controller.errors import Fault, FaultsFound

FULL = OSError(28, "No space left on device")


class Stream(io.TextIOWrapper):
    """A standard stream, on which there may be no space left."""

    def __init__(self, encoding="utf-8", is_full=False):
        super().__init__(io.BytesIO(), encoding=encoding)
        self.is_full = is_full

    def flush(self):
        if self.is_full:
            raise FULL
        super().flush()

    @property
    def text(self):
        """What was written and flushed."""
        return self.buffer.getvalue().decode()


class Program:
    """Runs programs to their end, with standard streams of their own."""

    def __init__(self, monkeypatch, capfd):
        self.stdout, self.stderr = Stream(), Stream()
        self.monkeypatch, self.capfd = monkeypatch, capfd

    def load(self, module, runs=command.run, *arguments, **options):
        """Return the exit code of the function main of a module, and its last lines."""
        with self.monkeypatch.context() as patch:
            patch.setattr(sys, "stdout", self.stdout)
            patch.setattr(sys, "stderr", self.stderr)
            patch.setattr(command.os, "_exit", sys.exit)
            with pytest.raises(SystemExit) as caught:
                runs("tool", module, "main", *arguments, **options)
        return caught.value.code, self.capfd.readouterr().err

    def run(self, main, runs=command.run, *arguments, **options):
        """Return the exit code of a function, and its last lines."""
        self.monkeypatch.setitem(sys.modules, "fixture_tool", SimpleNamespace(main=main))
        return self.load("fixture_tool", runs, *arguments, **options)


@pytest.fixture(name="program")
def program_of_its_own(monkeypatch, capfd):
    """Restore what a program changes for its whole process."""
    pipe = signal.getsignal(signal.SIGPIPE)
    program = Program(monkeypatch, capfd)
    yield program
    signal.signal(signal.SIGPIPE, pipe)
    program.stdout.is_full = program.stderr.is_full = False


def raising(error):
    """Return a function that raises."""

    def main(*arguments):
        raise error

    return main


@pytest.mark.parametrize("code", [0, 1, 2, 3])
def test_the_exit_code_is_what_the_function_returns(program, code):
    assert program.run(lambda: code) == (code, "")
    assert program.run(lambda word: code + len(word), command.run_node, "x") == (code + 1, "")
    assert program.run(raising(SystemExit(code))) == (code, "")


@pytest.mark.parametrize("error, code, lines", [
    (FULL, 1, ["the output cannot be written: No space left on device"]),
    (FileNotFoundError(2, "No such file or directory", "x/p.btproj"), 1,
     ["the output cannot be written: x/p.btproj: No such file or directory"]),
    (FaultsFound([Fault("a.xml", 1, 2, "odd"), Fault("b.xml", 0, 0, "even")]), 2,
     ["a.xml:1:2: odd", "b.xml: even"]),
    (ImportError("lxml is too old"), 1, ["lxml is too old"]),
    (MemoryError(), 1, ["there is too little memory for this"]),
    (RecursionError(), 1, ["there is too little memory for this"])])
def test_what_a_command_cannot_do_is_told_line_by_line(program, error, code, lines):
    text = "".join("tool: {}\n".format(line) for line in lines)
    assert program.run(raising(error)) == (code, text)


@pytest.mark.parametrize("error, reason", [
    (MemoryError(), "MemoryError"), (OSError("no pipes left"), "no pipes left"),
    (RuntimeError("can't start new thread"), "can't start new thread")])
def test_a_node_that_the_machine_gives_no_more_ends_as_broken(program, error, reason):
    assert command.no_resources(error).endswith(": " + reason)
    line = "tool: {}\n".format(command.no_resources(error))
    assert program.run(raising(error), command.run_node) == (exit_codes.BROKEN, line)


def test_a_doubt_about_another_package_changes_no_exit_code(program, monkeypatch):
    monkeypatch.setattr(extensions, "doubts", [Fault("package a", 0, 0, "odd", "", True)])
    assert program.run(lambda: 3) == (3, "tool: package a: warning: odd\n")


@pytest.mark.parametrize("source, command_code, node_code, words", [
    ("import no_such_module", 1, 1, "No module named 'no_such_module'"),
    ("raise ImportError('py_trees is too old', name='py_trees')", 1, 1,
     "tool: py_trees is too old\n"),
    ("raise ImportError('half a module')", 1, 4, "tool: cannot be loaded: half a module\n"),
    ("raise MemoryError", 1, 4, "tool: cannot be loaded: MemoryError\n"),
    ("raise OSError('no files left')", 1, 4, "tool: cannot be loaded: no files left\n"),
    ("from behavior_controller.errors import ConfigurationError as E\nraise E.of('a', 'odd')", 2, 2,
     "tool: a: odd\n")])
def test_a_program_that_cannot_be_loaded_says_why(tmp_path, monkeypatch, program, source,
                                                  command_code, node_code, words):
    (tmp_path / "unloaded_tool.py").write_text(source)
    monkeypatch.syspath_prepend(str(tmp_path))
    for runs, expected in ((command.run, command_code), (command.run_node, node_code)):
        code, line = program.load("unloaded_tool", runs)
        assert code == expected and line.count("\n") == 1
        assert line.startswith("tool: ") and words in line


def test_what_a_python_lacks_is_said_with_what_to_do_in_a_workspace_that_is_broken(
        monkeypatch, program):
    monkeypatch.setitem(sys.modules, "lacked", None)
    code, line = program.load("lacked")
    assert code == exit_codes.UNAVAILABLE
    assert "lacked" in line and sys.executable in line and "`catkin_find cssr_system`" in line
    assert len(line.splitlines()) == 1


CONTROLS = "\x1b[Hone\r\x1b[J\x1b]0;two\x07\n"


@pytest.mark.parametrize("options, shown", [
    ({}, "\\x1b[Hone\\r\\x1b[J\\x1b]0;two\\x07\n"),
    ({"redraws": True}, "\x1b[Hone\r\x1b[J\\x1b]0;two\\x07\n")])
def test_what_a_command_prints_moves_no_cursor_unless_it_redraws(program, options, shown):
    def main():
        sys.stderr.write(CONTROLS)
        return sys.stdout.write(CONTROLS) and 0

    program.run(main, **options)
    program.stderr.flush()
    assert program.stdout.text == program.stderr.text == shown


def test_a_node_prints_what_it_wants(program):
    program.run(lambda: print(CONTROLS, end=""), command.run_node)
    program.stdout.flush()
    assert program.stdout.text == CONTROLS


def test_a_reader_that_goes_away_ends_a_command(program):
    signal.signal(signal.SIGPIPE, signal.SIG_IGN)  # as Python does
    program.run(lambda: signal.getsignal(signal.SIGPIPE) is not signal.SIG_DFL)
    assert signal.getsignal(signal.SIGPIPE) is signal.SIG_DFL


@pytest.mark.parametrize("end", [int, sys.exit])
def test_an_output_for_which_there_is_no_space_is_told_however_a_command_ends(program, end):
    def main():
        program.stdout.is_full = True
        return end(0)

    line = "tool: the output cannot be written: No space left on device\n"
    assert program.run(main) == (1, line)


def test_a_last_line_comes_after_what_was_printed_before_and_without_controls(program):
    def main():
        sys.stderr.write("before")
        raise ImportError("\x1b[2J")

    assert program.run(main) == (1, "tool: \\x1b[2J\n")
    assert program.stderr.text == "before"


def test_a_full_standard_error_keeps_no_exit_code_back(program):
    def main():
        program.stderr.is_full = True
        raise ImportError

    assert program.run(main)[0] == 1


def test_a_terminal_that_lacks_a_character_gets_its_escape(program):
    def main():
        sys.stdout.write("H\u00f4tel")
        raise ImportError("H\u00f4tel")

    assert program.run(main) == (1, "tool: H\u00f4tel\n")
    program.stdout, program.stderr = Stream("ascii"), Stream("ascii")
    assert program.run(main) == (1, "tool: H\\xf4tel\n")
    assert program.stdout.text == "H\\xf4tel"


@pytest.mark.slow
@pytest.mark.parametrize("runs", ["run", "run_node"])
@pytest.mark.parametrize("closed", ["<&-", ">&-", "2>&-", "<&- >&-", "<&- >&- 2>&-", ""])
def test_closed_streams_are_open_and_nothing_else(tmp_path, runs, closed):
    (tmp_path / "opened_tool.py").write_text(
        "import os, sys\n" "def main():\n"
        "    is_open = None not in (sys.stdin, sys.stdout, sys.stderr)\n"
        "    return 10 * is_open + len(os.listdir('/proc/self/fd')) - 1\n")
    code = "from behavior_controller import command; command.{}('t', 'opened_tool', 'main')"
    done = subprocess.run(
        ["sh", "-c", 'exec "$0" -c "$1" ' + closed, sys.executable, code.format(runs)],
        env=dict(os.environ, PYTHONPATH=os.pathsep.join([str(tmp_path), *filter(None, sys.path)])))
    assert done.returncode == 13
