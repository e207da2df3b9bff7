"""Tests of runTest: what it refuses, what it starts, and its exit code."""
import os
import re
import signal
import subprocess
import sys

import pytest

pytest.importorskip("rosgraph", reason="needs ROS, which this interpreter does not have")

from unit_tests import folders  # noqa: E402
from unit_tests.robot import options  # noqa: E402
from unit_tests.run import run_test  # noqa: E402
from unit_tests.run.test_node import NOT_RUN  # noqa: E402

NODES = os.path.join(folders.share(), "nodes")
PROGRAMS = ["faceDetection", "report", "runTest", "startController"]


def test_help_is_no_test(monkeypatch, capsys):
    monkeypatch.setenv("COLUMNS", "1000")
    assert run_test.main(["--help"]) == 0
    text = capsys.readouterr().out
    assert "failureRate" in text and "; from arrivalRate " in text


@pytest.mark.slow
@pytest.mark.parametrize("program", PROGRAMS)
def test_each_program_explains_itself_with_its_exit_codes(program):
    def printed(option):
        return subprocess.run([sys.executable, os.path.join(NODES, program), option], check=True,
                              stdout=subprocess.PIPE, encoding="utf-8").stdout

    assert re.search(r"exit\s+code:?\s+\d", printed("--help"))
    assert re.fullmatch(program + r" \d+\.\d+\.\d+\n", printed("--version"))


@pytest.mark.parametrize("words", [["failureRat:=1"], ["failureRate:=7"], ["failureRate"]])
def test_what_cannot_be_tested_is_told_before_anything_starts(words, capsys):
    assert run_test.main(words) == NOT_RUN == 2
    assert "failureRat" in capsys.readouterr().out


def test_a_launch_without_a_verdict_has_tested_nothing(given, program, tmp_path, monkeypatch,
                                                       capsys):
    monkeypatch.setattr(run_test.signal, "signal", lambda *_: None)
    program("roslaunch",
            "open(os.path.join(folder, 'leader'), 'w').write(str(os.getsid(0) == os.getpid()))\n"
            "open(os.path.join(folder, 'waits'), 'w').write(str(os.path.exists("
            "os.path.join(folder, 'verdict'))))")
    (tmp_path / "ros" / "log").mkdir(parents=True)
    assert run_test.main(["failureRate:=0"]) == 2
    assert capsys.readouterr().out.strip()
    folder, = (tmp_path / "ros" / "log").iterdir()
    assert (folder / "leader").read_text() == "True", "Ctrl-C does not reach it directly"
    assert (folder / "waits").read_text() == "True", "the report would show the verdict itself"
    words = (folder / "words").read_text().splitlines()
    assert words[:2] == ["unit_tests", options.LAUNCH_FILE]
    assert set(words[2:]) == {"folder:={}".format(folder), "failureRate:=0"}


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_signal_interrupts_roslaunch(given, program, monkeypatch, number):
    program("roslaunch", "signal.pause()")
    # a process in the background may ignore it
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    monkeypatch.setattr(run_test.signal, "signal", lambda given, handler: handler()
                        if given == number else None)
    assert run_test.main(["failureRate:=0"]) == NOT_RUN
    monkeypatch.undo()
    signal.signal(signal.SIGINT, before)
