"""Tests of runTest: what it refuses, what it starts, and its exit code."""
import pytest

pytest.importorskip("rosgraph", reason="needs ROS, which this interpreter does not have")

from unit_tests import arguments, launcher  # noqa: E402
from unit_tests.reporter import NOT_RUN  # noqa: E402


def test_help_is_no_test(monkeypatch, capsys):
    monkeypatch.setattr(launcher.signal, "signal", lambda *_: None)  # this process goes on
    assert launcher.main(["--help"]) == 0
    assert "failureRate" in capsys.readouterr().out


@pytest.mark.parametrize("words", [["failureRat:=1"], ["failureRate:=7"], ["failureRate"]])
def test_what_cannot_be_tested_is_told_before_anything_starts(words, capsys):
    assert launcher.main(words) == NOT_RUN == 2
    assert "failureRat" in capsys.readouterr().out


def test_a_launch_without_a_verdict_has_tested_nothing(given, program, tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(launcher.signal, "signal", lambda *_: None)
    program("roslaunch", "pass")
    assert launcher.main(["failureRate:=0"]) == 2
    assert capsys.readouterr().out.strip()
    folder, = (tmp_path / "ros" / "log").iterdir()
    words = (folder / "words").read_text().splitlines()
    assert words[:2] == ["unit_tests", arguments.LAUNCH_FILE]
    assert set(words[2:]) == {"folder:={}".format(folder), "failureRate:=0"}
