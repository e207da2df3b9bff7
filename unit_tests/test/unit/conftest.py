"""Fixtures for tests of whole processes: arguments, and programs to start."""
import os
import stat
import sys

import pytest

SCRIPT = """#!{}
import os, signal, sys
folder = [word.split(":=")[1] for word in sys.argv if "folder:=" in word or "_recordDirectory:=" in word][0]
open(os.path.join(folder, "words"), "w").write("\\n".join(sys.argv[1:]))
run = os.path.join(folder, "000001_20260101-000000_1")
os.mkdir(run)
open(os.path.join(run, "mission.jsonl"), "w").write("{{\\"format\\": \\"behaviorController record\\"}}\\n")
{}
"""


@pytest.fixture
def given(monkeypatch, tmp_path):
    """Give this process the arguments of a test; it writes below ``tmp_path``."""
    monkeypatch.setenv("ROS_HOME", str(tmp_path / "ros"))

    def give(*words):
        monkeypatch.setattr(sys, "argv", ["node", "__name:=node"] + ["_" + word for word in words])
    give()
    return give


@pytest.fixture
def program(tmp_path, monkeypatch):
    """Make an executable of that name, first on PATH; ``end`` is its last line of Python."""
    def make(name, end):
        path = tmp_path / name
        path.write_text(SCRIPT.format(sys.executable, end))
        path.chmod(path.stat().st_mode | stat.S_IXUSR)
        monkeypatch.setenv("PATH", "{}{}{}".format(tmp_path, os.pathsep, os.environ["PATH"]))
        return str(path)
    return make
