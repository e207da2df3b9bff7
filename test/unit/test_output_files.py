"""Each command that writes a file writes a new one or replaces its own; all else stays."""
import os
import signal
import subprocess
import sys

import pytest

from behavior_controller import cli
from behavior_controller.errors import FaultsFound
from behavior_controller import replay_cli as command
from behavior_controller.output_files import OutputKind
from mission_rig import recorded, visitor_who
from unit_tests import folders
from behavior_controller.simulation.rehearsal import cli as rehearsal
from unit_tests.robot import options

KIND = OutputKind("a list of ours", "# ours\n")
OLD, NEW = "# ours\nold\n", "# ours\nnew\n"
MISSION = '<root BTCPP_format="4"><BehaviorTree ID="M"><AlwaysSuccess/></BehaviorTree></root>'


class Called:
    """The commands, each with the option that names its output."""

    def __init__(self, folder):
        self.folder = folder
        self.mission = folder / "mission.xml"
        self.mission.write_text(MISSION)
        (folder / "run").mkdir()
        self.record = recorded(folder / "run", visitor_who(says="no"))

    def replay(self, output):
        return command.main(["--report", output, self.record])

    def rehearse(self, output):
        return rehearsal.main([str(self.mission), "--runs", "1", "--jobs", "1", "--html", output])

    def project(self, output):
        return cli.export_node_model(["--project", output])

    def test(self, output):
        """Check the option as each process of a test does, and write what the last of them does."""
        options.read(options.Arguments([], {"outputFile": output}))
        folders.REPORT.write(output, "# 2026-01-01T12:00:00: mission m\n")
        return 0


COMMANDS = ("replay", "rehearse", "project", "test")


@pytest.fixture(name="call", params=COMMANDS)
def called(request, tmp_path):
    """Call one of the commands with the path of its output; the exit code, and what it prints."""
    call = getattr(Called(tmp_path), request.param)

    def run(output):
        try:
            return call(str(output))
        except FaultsFound as error:
            print(error)
            return 2
        except OSError as error:
            assert error.filename == str(output)
            print(error)
            return 1

    run.ending = ".btproj" if request.param == "project" else ".out"
    return run


def contents(folder):
    """Return path, kind, and content of all that is below a folder."""
    return {path: (path.lstat().st_mode, path.read_bytes() if path.is_file() else None)
            for path in folder.rglob("*")}


def foreign(folder, ending):
    """Yield paths that are no output of a command."""
    def place(name):
        return folder / (name + ending)

    yield folder / "mission.xml"
    yield from folder.glob("run/*/mission.jsonl")
    place("empty").write_text("")
    place("binary").write_bytes(b"\xff\x00" * 100)
    place("page").write_text("<!DOCTYPE html>\n<html><head><title>Mine</title></head></html>")
    place("project").write_text('<root BTCPP_format="4" project_name="p">' + MISSION[24:])
    place("link").symlink_to(folder / "mission.xml")
    os.link(str(folder / "mission.xml"), str(place("hard_link")))
    place("folder").mkdir()
    os.mkfifo(str(place("fifo")))
    place("device").symlink_to("/dev/full")
    for name in "empty binary page project link hard_link folder fifo device".split():
        yield place(name)


def test_nothing_of_the_users_is_overwritten(call, tmp_path, capfd):
    paths = list(foreign(tmp_path, call.ending))
    before = contents(tmp_path)
    for path in paths:
        try:
            code = call(path)
        except SystemExit as wrong:  # a project has its own ending
            code = wrong.code
            capfd.readouterr()
        else:
            printed = "".join(capfd.readouterr())
            assert printed.count("\n") == 1 and str(path) in printed and "another" in printed
        assert code == 2
    assert contents(tmp_path) == before


@pytest.mark.slow
def test_a_commands_own_output_is_replaced(call, tmp_path, capfd):
    path = tmp_path / ("new" + call.ending)
    link = tmp_path / ("link" + call.ending)
    link.symlink_to(path)
    before = set(tmp_path.iterdir())
    assert call(path) in (0, 4) and path.is_file()
    path.write_text(path.read_text() + "old")
    for output in (path, link):
        assert call(output) in (0, 4)
        assert not path.read_text().endswith("old")
    assert link.is_symlink() and set(tmp_path.iterdir()) - before == {path}


@pytest.mark.slow
def test_the_output_of_another_command_is_not_replaced(tmp_path, capfd):
    commands = Called(tmp_path)
    for first in COMMANDS:
        path = tmp_path / (first + ".btproj")
        assert getattr(commands, first)(str(path)) in (0, 4)
        before = path.read_bytes()
        for second in set(COMMANDS) - {first}:
            try:
                assert getattr(commands, second)(str(path)) == 2
            except FaultsFound:
                pass
        assert path.read_bytes() == before


def test_what_cannot_be_written_is_refused_before_the_work(tmp_path, capfd, monkeypatch):
    commands = Called(tmp_path)
    for work, name in ((command, "to_html"), (rehearsal, "rehearse")):
        monkeypatch.setattr(work, name, None)
    for output in (str(tmp_path / "none" / "x"), "", str(tmp_path) + "/x/"):
        for write in (commands.replay, commands.rehearse):
            try:
                assert write(output) == 2
            except OSError as error:
                assert error.filename == output


def test_a_mode_stays_and_a_new_file_has_that_of_the_umask(tmp_path):
    path = tmp_path / "x"
    KIND.write(str(path), OLD)
    mask = os.umask(0)
    os.umask(mask)
    assert path.stat().st_mode & 0o777 == 0o666 & ~mask
    path.chmod(0o640)
    KIND.write(str(path), NEW)
    assert path.stat().st_mode & 0o777 == 0o640 and path.read_text() == NEW


def write_in_process(path, before, text):
    """Write a file in a process that does something ``before``; return how it ended."""
    command = ("import os, resource, signal\n{}\n"
               "from behavior_controller.output_files import OutputKind\n"
               "OutputKind('', '# ours').write({!r}, {!r})".format(before, str(path), text))
    return subprocess.run([sys.executable, "-c", command], stderr=subprocess.PIPE, timeout=60,
                          env=dict(os.environ, PYTHONPATH=os.pathsep.join(sys.path)))


def test_a_full_disk_keeps_the_earlier_file(tmp_path):
    path = tmp_path / "x"
    path.write_text(OLD)
    done = write_in_process(path, "signal.signal(signal.SIGXFSZ, signal.SIG_IGN)\n"
                            "resource.setrlimit(resource.RLIMIT_FSIZE, (4096, 4096))", OLD * 10000)
    assert done.returncode == 1 and b"File too large" in done.stderr
    assert path.read_text() == OLD and list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize("sign", (signal.SIGINT, signal.SIGTERM, signal.SIGHUP))
def test_ctrl_c_leaves_no_half_of_a_file(tmp_path, sign):
    path = tmp_path / "x"
    path.write_text(OLD)
    done = write_in_process(path, "signal.signal(signal.SIGINT, signal.SIG_DFL)\n"
                            "os.fsync = lambda _: os.kill(os.getpid(), {:d})".format(sign), NEW)
    assert done.returncode == -sign
    assert path.read_text() == NEW and list(tmp_path.iterdir()) == [path]


@pytest.mark.slow
def test_standard_output_takes_a_report(tmp_path, capfd):
    commands = Called(tmp_path)
    for output in ("/dev/stdout", "/dev/fd/1"):
        assert commands.replay(output) == 0
        printed = capfd.readouterr().out
        assert printed.startswith("<!DOCTYPE html>") and printed.endswith("</html>\n")
