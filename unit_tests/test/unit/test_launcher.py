"""Tests of runTest: what it refuses, what it starts, and its exit code."""
import signal

import pytest

pytest.importorskip("rosgraph", reason="needs ROS, which this interpreter does not have")

from unit_tests import arguments, launcher  # noqa: E402
from unit_tests.reporter import NOT_RUN  # noqa: E402


def test_help_is_no_test(monkeypatch, capsys):
    handlers = {}
    monkeypatch.setattr(launcher.signal, "signal", handlers.__setitem__)  # this process goes on
    monkeypatch.setenv("COLUMNS", "1000")
    assert launcher.main(["--help"]) == 0
    text = capsys.readouterr().out
    assert "failureRate" in text and "; from arrivalRate " in text
    assert handlers == {signal.SIGPIPE: signal.SIG_DFL}, "| head ends it without a message"


@pytest.mark.parametrize("words", [["failureRat:=1"], ["failureRate:=7"], ["failureRate"]])
def test_what_cannot_be_tested_is_told_before_anything_starts(words, capsys):
    assert launcher.main(words) == NOT_RUN == 2
    assert "failureRat" in capsys.readouterr().out


def test_a_launch_without_a_verdict_has_tested_nothing(given, program, tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(launcher.signal, "signal", lambda *_: None)
    program("roslaunch", "open(os.path.join(folder, 'leader'), 'w').write(str(os.getsid(0) == os.getpid()))")
    (tmp_path / "ros" / "log").mkdir(parents=True)
    assert launcher.main(["failureRate:=0"]) == 2
    assert capsys.readouterr().out.strip()
    folder, = (tmp_path / "ros" / "log").iterdir()
    assert (folder / "leader").read_text() == "True", "Ctrl-C does not reach it directly"
    words = (folder / "words").read_text().splitlines()
    assert words[:2] == ["unit_tests", arguments.LAUNCH_FILE]
    assert set(words[2:]) == {"folder:={}".format(folder), "failureRate:=0"}


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_signal_interrupts_roslaunch(given, program, monkeypatch, number):
    program("roslaunch", "signal.pause()")
    before = signal.signal(signal.SIGINT, signal.default_int_handler)  # a process in the background may ignore it
    monkeypatch.setattr(launcher.signal, "signal", lambda given, handler: handler() if given == number else None)
    assert launcher.main(["failureRate:=0"]) == NOT_RUN
    monkeypatch.undo()
    signal.signal(signal.SIGINT, before)
