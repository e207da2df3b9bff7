"""The viewer as a process of its own: it shows the run that it is fed with, whatever happens to
it."""
import argparse
import contextlib
import errno
import itertools
import json
import math
import os
import re
import resource
import signal
import socket
import subprocess
import sys
import threading
import time
import types
import urllib.request
from unittest import mock

import pytest
import zmq

from behavior_controller.errors import MissionError
from behavior_controller.run.events import (
    Asked, BreakpointChanged, Line, Noticed, RunFinished, SignOfLife, clock_shift,
    follow_simulated_time, unix_at, unix_now, use_clock_of)
from behavior_controller.run.record import files
from behavior_controller.run.record.codec import encode, header
from behavior_controller.robot.requests import GoTo, Location
from behavior_controller.viewer import main
from behavior_controller.viewer import process as module
from behavior_controller.viewer.process import ViewerProcess
from free_ports import free_port
from mission_rig import FileRecord, Rig, one_leaf
from groot2_client import Client, hook
from page_rig import Stop, until, wait_until
from viewer_rig import Viewed

pytestmark = pytest.mark.slow

ENVIRONMENT = dict(os.environ, PYTHONPATH=os.pathsep.join(filter(None, sys.path)))


@pytest.fixture
def view():
    views = []

    def make(*arguments):
        views.append(Viewed(*arguments))
        return views[-1]

    yield make
    for each in views:
        each.close()


def is_over(pid):
    """Whether a process has ended, which need not be a child of this one."""
    try:
        with open(f"/proc/{pid}/stat") as file:
            return file.read().rpartition(")")[2].split()[0] == "Z"
    except OSError:
        return True


def wait_for_page(viewer):
    """Read what a viewer sends to its controller until it serves the page."""
    assert any(re.search(rb'"page":[1-9]', line) for line in viewer.stdout)


# ------------------------------------------------------------------------- whatever happens to it


@pytest.mark.parametrize("number, trouble", [
    (signal.SIGKILL, "it was ended by signal 9"),
    (signal.SIGSTOP, "it gave no sign of life for 3 s")])
def test_a_viewer_that_ends_or_hangs_is_started_again_and_shows_the_run(
        view, monkeypatch, number, trouble):
    monkeypatch.setattr(module, "NO_SIGN_LIMIT", 3.0)
    parts = ["mission", "statuses", "now", "timeline", "blackboard"]
    drives, rig = [], Rig()
    viewed = view(rig)

    def drive(request):
        drives.extend([request] if isinstance(request, GoTo) else [])
        return None if len(drives) > 1 else NotImplemented

    rig.answer = drive
    with pytest.raises(Stop):
        rig.run(until(lambda: len(drives) > 1))
    wait_until(lambda: viewed.shows(*parts), 20.0)
    assert "R" in viewed.state()["statuses"]["letters"]
    first = viewed.pid
    os.kill(first, number)
    wait_until(lambda: viewed.pid not in (first, None), 20.0)
    wait_until(lambda: viewed.shows(*parts), 20.0)
    assert is_over(first) and viewed.warnings == [
        f"the viewer (page, Groot2) is started again: {trouble}; the mission goes on"]
    rig.tree.halt()
    wait_until(lambda: viewed.shows(*parts))


def test_a_viewer_that_does_not_take_its_lines_in_time_is_started_again(view, monkeypatch):
    viewed = view(one_leaf("<Sleep msec='9000'/>"))
    wait_until(lambda: viewed.shows("mission"), 20.0)
    first = viewed.pid
    os.kill(first, signal.SIGSTOP)
    monkeypatch.setattr(module, "MOST_FOR_VIEWER", 1000)
    for number in range(1100):  # a pipe takes 64 of them
        viewed.rig.mission.events.emit(Noticed("info", str(number) + 1000 * "x"))
    wait_until(lambda: viewed.pid not in (first, None), 20.0)
    wait_until(lambda: viewed.shows("mission", "statuses"), 20.0)
    assert viewed.warnings == ["the viewer (page, Groot2) is started again: it did not take the "
                               "lines of the run in time; the mission goes on"]


def test_a_viewer_that_ends_leaves_no_hook(view):
    rig = one_leaf("<Sequence><Sleep msec='9000'/></Sequence>")
    viewed = view(rig)
    wait_until(lambda: viewed.shows("mission"), 20.0)
    client = Client(viewed.groot2_port)
    assert client.ask("I", hook(1, mode=0, status="SKIPPED")) is None

    def held():
        rig.tick()
        return [event.is_held for event in rig.of(BreakpointChanged)]

    wait_until(lambda: held() == [True])
    os.kill(viewed.pid, signal.SIGKILL)
    wait_until(lambda: held() == [True, False])
    client.close()
    assert any(line.endswith(" is removed: the viewer has ended") for line in viewed.warnings)


def test_a_viewer_that_cannot_be_started_is_told_once_until_it_is_tried_again(view, monkeypatch):
    monkeypatch.setattr(module, "VIEWER_COMMAND", ["/no/such/program"])
    monkeypatch.setattr(module, "PAUSES", (0.5, 30.0))
    viewed, began = view(one_leaf("<Sleep msec='9000'/>")), time.monotonic()
    wait_until(lambda: len(viewed.warnings) == 3)
    assert time.monotonic() - began >= 2 * 0.5
    assert viewed.warnings[0].startswith("the viewer (page, Groot2) cannot be started: ")


# --------------------------------------------------------------------------------- when it ends


def test_it_ends_after_the_run_and_shows_the_end(view):
    viewed = view(one_leaf("<Sleep msec='9000'/>"))
    wait_until(lambda: viewed.shows("mission"), 20.0)
    with urllib.request.urlopen(f"http://127.0.0.1:{viewed.port}/events", timeout=5) as stream:
        stream.readline(), stream.readline()
        viewed.rig.mission.events.emit(RunFinished("all passes are done", 0))
        began = time.monotonic()
        viewed.close()
        told = [json.loads(line[len("data: "):]) for line in stream if line.strip()]
    assert [news["now"]["ended"] for news in told if "now" in news][-1] == "all passes are done"
    assert viewed.process._child.wait(5.0) == 0 and time.monotonic() - began < 2.0
    assert viewed.warnings == []


CONTROLLER = """
import sys, time
from mission_rig import one_leaf
from page_rig import wait_until
from viewer_rig import Viewed
viewed = Viewed(one_leaf("<Sleep msec='9000'/>"))
wait_until(lambda: viewed.shows("mission"), 20.0)
print(viewed.pid, flush=True)
time.sleep(60.0)
"""


@pytest.mark.parametrize("is_stopped", [False, True])
def test_it_ends_after_a_controller_that_is_killed(is_stopped):
    with subprocess.Popen([sys.executable, "-c", CONTROLLER], env=ENVIRONMENT,
                          stdout=subprocess.PIPE) as controller:
        pid = int(controller.stdout.readline())
        assert not is_over(pid)
        if is_stopped:
            os.kill(pid, signal.SIGSTOP)
        controller.kill()
    wait_until(lambda: is_over(pid), 2.0)


def test_a_line_that_the_controller_could_not_finish_is_left_out():
    port = free_port()
    with subprocess.Popen(module.VIEWER_COMMAND + ["--port", str(port), "--groot2-port", "0"],
                          env=ENVIRONMENT, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as viewer:
        viewer.stdin.write(header(1, 0.0) + encode(5.0, Noticed("info", "whole")))
        viewer.stdin.flush()
        wait_for_page(viewer)
        with urllib.request.urlopen(f"http://127.0.0.1:{port}/events", timeout=5) as stream:
            stream.readline(), stream.readline()
            viewer.stdin.write(encode(6.0, Noticed("info", "torn"))[:-5])
            viewer.stdin.close()
            last = [line for line in stream if line.strip()][-1]
        assert b"the controller has stopped" in last and b"torn" not in last
        assert viewer.wait(5.0) == 0


def test_the_terminal_s_signals_are_not_for_it(view):
    viewed = view(one_leaf("<Sleep msec='9000'/>"))
    wait_until(lambda: viewed.shows("mission"), 20.0)
    assert os.getsid(viewed.pid) == os.getpgid(viewed.pid) == viewed.pid
    for number in (signal.SIGINT, signal.SIGHUP):
        os.kill(viewed.pid, number)
    viewed.rig.tick()
    wait_until(lambda: viewed.shows("statuses"))
    assert viewed.warnings == []


STOPPED_CONTROLLER = CONTROLLER.replace("time.sleep(60.0)", """
from behavior_controller.viewer import process
process.NO_SIGN_LIMIT = 2.5
for _ in sys.stdin:
    time.sleep(0.5)
    print(viewed.pid, viewed.warnings, flush=True)
viewed.close()""")


def test_it_stays_when_the_controller_is_stopped_for_a_while():
    """Ctrl-Z in the terminal, and fg: either of two threads goes on first."""
    with subprocess.Popen([sys.executable, "-c", STOPPED_CONTROLLER], env=ENVIRONMENT,
                          stdin=subprocess.PIPE, stdout=subprocess.PIPE) as controller:
        pid = int(controller.stdout.readline())
        for _ in range(2):
            os.kill(controller.pid, signal.SIGSTOP)
            time.sleep(3.2)  # more than the limit without a sign of life
            os.kill(controller.pid, signal.SIGCONT)
            controller.stdin.write(b"\n")
            controller.stdin.flush()
            assert controller.stdout.readline().decode() == f"{pid} []\n"


# ------------------------------------------------------------------------------ what it costs


def test_it_imports_nothing_of_ros_nor_of_the_engine():
    code = "import sys, behavior_controller.viewer.main\nprint(*sys.modules)"
    names = set(subprocess.run([sys.executable, "-c", code], env=ENVIRONMENT, check=True,
                               stdout=subprocess.PIPE).stdout.decode().split())
    assert "behavior_controller.viewer.groot2" in names
    assert not names & {"rospy", "roslib", "py_trees", "lxml.etree", "behavior_controller.leaves",
                        "behavior_controller.bt", "behavior_controller.ros"}


def work_to_page(*command):
    """Return the processor's seconds until a program serves a page, the least of three times."""
    def seconds():
        used = resource.getrusage(resource.RUSAGE_CHILDREN)
        return used.ru_utime + used.ru_stime

    taken = []
    for _ in range(3):
        before = seconds()
        with subprocess.Popen([sys.executable, *command], env=ENVIRONMENT, stdin=subprocess.PIPE,
                              stdout=subprocess.PIPE) as started:
            wait_for_page(started)
            started.kill()
        taken.append(seconds() - before)
    return min(taken)


@pytest.mark.timing
def test_it_is_there_soon():
    """Half of the work are its libraries, which take a third of a second."""
    libraries = "import tornado.web, tornado.httpserver, msgspec\nprint('\"page\":1')"
    viewer = module.VIEWER_COMMAND[1:] + ["--port", str(free_port()), "--groot2-port", "0"]
    assert work_to_page(*viewer) < 2.0 * work_to_page("-c", libraries)


# ------------------------------------------------------------------- what it must not depend on


def test_a_module_in_the_working_directory_is_not_its_own(view, tmp_path, monkeypatch):
    (tmp_path / "queue.py").write_text("raise SystemExit('this is no part of Python')")
    monkeypatch.chdir(tmp_path)
    viewed = view(one_leaf("<Sleep msec='9000'/>"))
    wait_until(lambda: viewed.shows("mission"), 20.0)
    assert viewed.warnings == []


def test_an_event_that_cannot_be_read_is_left_out(view):
    """JSON has no NaN: a request of another package, and its like, may hold one."""
    viewed = view(one_leaf("<Sleep msec='9000'/>"))
    nowhere = GoTo(Location(math.nan, 0.0, 0.0))
    viewed.rig.mission.events.emit(Asked(1, "/robotNavigation/set_goal", nowhere))
    viewed.rig.mission.events.emit(Noticed("info", "the next one"))
    wait_until(lambda: "the next one" in json.dumps(viewed.state()), 20.0)
    assert viewed.warnings == []


SOON = ("import sys; from behavior_controller.viewer import main; main.PORTS_LIMIT = 0.1; "
        "sys.exit(main.main())")


def test_it_comes_when_another_program_leaves_its_port(view, monkeypatch):
    """A controller may wait long for the robot before it replaces the one whose page has it."""
    monkeypatch.setattr(module, "VIEWER_COMMAND", [sys.executable, "-c", SOON, "-", "--child"])
    port = free_port()
    with socket.create_server(("127.0.0.1", port)):
        viewed = view(one_leaf("<Sleep msec='9000'/>"), port)
        wait_until(lambda: viewed.warnings != [], 20.0)
    assert "no page in the browser" in viewed.warnings[0]
    wait_until(lambda: viewed.shows("mission"), 20.0)


# ------------------------------------------------------------------------------ by hand


@contextlib.contextmanager
def shown_by_hand(place):
    """Start a viewer of all runs in a folder; yield its process and a function that returns the
    state of its page."""
    port = free_port()
    with subprocess.Popen(
            [sys.executable, "-m", "behavior_controller.viewer.main", str(place), "--port",
             str(port), "--groot2-port", "0"], env=ENVIRONMENT, stderr=subprocess.PIPE) as viewer:
        try:
            yield viewer, lambda: page(port)
        finally:
            viewer.kill()


def page(port):
    with contextlib.suppress(OSError):
        with urllib.request.urlopen(f"http://127.0.0.1:{port}/state", timeout=2) as answer:
            return answer.read().decode()
    return ""


def test_a_run_that_cannot_be_read_is_named_once_and_the_next_one_is_shown(tmp_path):
    old = tmp_path / "000001_20260101-000000_1"
    old.mkdir()
    (old / "mission.jsonl").write_text(
        '{"format":"behaviorController record","version":8,"pid":1,"time":1.0}\n')
    with shown_by_hand(tmp_path) as (viewer, state):
        lines = [viewer.stderr.readline().decode() for _ in range(2)]
        assert str(old) in lines[0] and "the record has the version 8" in lines[1]
        time.sleep(3 * main.NEWER_RUN_POLL)  # in which nothing is told again
        record = FileRecord(str(tmp_path), lambda text: None).open()
        record(Noticed("info", "of the next one"))
        assert record.path in viewer.stderr.readline().decode()
        wait_until(lambda: "of the next one" in state())
        os.remove(record.path)  # as rosclean does
        assert "No such file" in viewer.stderr.readline().decode()
        record.close()
        time.sleep(3 * main.NEWER_RUN_POLL)
        assert viewer.poll() is None


def test_clients_that_go_away_before_their_answers_do_not_end_the_viewer():
    port = free_port(3)
    warnings, is_served = [], threading.Event()
    viewer = ViewerProcess(["--port", str(port), "--groot2-port", str(port + 1)], print,
                           lambda: None, warnings.append, lambda *_: is_served.set())
    try:
        assert is_served.wait(30.0), warnings
        with zmq.Context() as context, context.socket(zmq.DEALER) as leaving:
            leaving.setsockopt(zmq.LINGER, 0)
            leaving.connect(f"tcp://127.0.0.1:{port + 1}")
            for _ in range(2000):  # more than ZeroMQ and the sockets keep
                leaving.send_multipart([b"", *10 * [b"20 bytes of nonsense"]])
        with urllib.request.urlopen(f"http://127.0.0.1:{port}/events", timeout=10.0) as staying:
            pushed = [line for line, _ in zip(staying, range(10))]
        assert len(pushed) == 10  # each is followed by an empty line
        assert warnings == []
    finally:
        viewer.close()


def test_a_clock_that_was_set_after_the_start_of_the_node_makes_nothing_old(tmp_path):
    """A robot without a clock of its own gets the time from the network."""
    own = unix_at(0.0)
    try:
        use_clock_of(own - 3600.0)  # that of the node
        record = FileRecord(str(tmp_path)).open()
        with shown_by_hand(tmp_path) as (_, state):
            record(SignOfLife({}))
            wait_until(lambda: state() and json.loads(state())["alive"]["age"] is not None, 20.0)
            wait_until(lambda: json.loads(state())["alive"]["age"] < 60.0, 2.0)
        record.close()
    finally:
        use_clock_of(own)


def test_a_record_that_is_not_there_ends_the_viewer_and_a_newest_run_is_awaited(
        tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("ROS_LOG_DIR", str(tmp_path))
    monkeypatch.setattr(main, "Viewer", lambda *_: types.SimpleNamespace(is_serving=True))
    monkeypatch.setattr(main, "NEWER_RUN_POLL", 0.0)
    looks = itertools.chain(3 * [MissionError.of("records", "none there")], [KeyboardInterrupt])
    monkeypatch.setattr(main, "find_record", mock.Mock(side_effect=looks))
    assert main.main([str(tmp_path / "none"), "--port", "9"]) == 2
    assert capsys.readouterr().err == "records: none there\n"
    with pytest.raises(KeyboardInterrupt):
        main.main(["latest", "--records", str(tmp_path), "--port", "9"])
    assert capsys.readouterr().err.count("none there") == 1  # in two looks


def test_simulated_time_is_followed_and_changes_no_time_of_day():
    own = unix_at(0.0)
    try:
        for at in (5000.0, 5010.0):  # ten times as fast as the computer's
            follow_simulated_time(Line(at, SignOfLife({}), at, 5000.0))
            assert unix_now() == pytest.approx(at, abs=0.5) and clock_shift() == 0
        for line in (Line(7000.0, SignOfLife({})), Line(7000.0, Noticed("info", ""), 1.0, 1.0)):
            follow_simulated_time(line)
            assert unix_now() == pytest.approx(5010.0, abs=0.5)
    finally:
        use_clock_of(own)


def test_a_folder_that_takes_no_lock_is_shown_and_a_controller_starts_its_own(
        tmp_path, monkeypatch):
    record = FileRecord(str(tmp_path)).open()
    record(Noticed("info", "in a folder without a lock"))
    record.close()
    (tmp_path / files.VIEWER).mkdir()  # as little to be opened as a file of a read-only disk
    with shown_by_hand(tmp_path) as (viewer, state):
        assert b"does not know of this viewer" in viewer.stderr.readline()
        wait_until(lambda: "in a folder without a lock" in state(), 20.0)
    (tmp_path / files.VIEWER).rmdir()
    with files.watched(str(tmp_path)) as trouble:
        assert (trouble, files.has_viewer(str(tmp_path))) == ("", True)

    def refuse(file, operation):
        raise OSError(errno.ENOLCK, os.strerror(errno.ENOLCK))

    monkeypatch.setattr(files.fcntl, "flock", refuse)
    with files.watched(str(tmp_path)) as trouble:
        assert trouble.endswith("No locks available")
        assert not files.has_viewer(str(tmp_path))


# ---------------------------------------------------------------------------------- in this process


@pytest.mark.parametrize("record, given, expected", [
    ("/r/000001/mission.jsonl", "", "/r"), ("/r/000001/mission.jsonl", "/other", "/other")])
def test_the_folder_of_runs_is_that_of_the_record_unless_one_is_given(monkeypatch, record, given,
                                                                     expected):
    seen = []
    monkeypatch.setattr(main, "Viewer", lambda chosen, tell: seen.append(chosen.records) or
                        types.SimpleNamespace(is_serving=False))
    assert main._show_record(argparse.Namespace(record=record, records=given)) == 1
    assert seen == [expected]


def test_a_viewer_without_ports_takes_a_run_and_serves_nothing():
    chosen = argparse.Namespace(address="127.0.0.1", port=0, groot2_address="127.0.0.1",
                                groot2_port=0, records="", attempts=1)
    viewer = main.Viewer(chosen, pytest.fail)
    assert (viewer.is_serving, viewer.ports, viewer.missing) == (False, [0, 0], [])
    viewer.begin()
    viewer.take(Line(1.0, RunFinished("stopped", 0)))
    viewer.note_end()
    viewer.close()


def test_the_end_of_a_run_is_shown_on_the_page():
    viewer, ends = object.__new__(main.Viewer), []
    viewer._page = types.SimpleNamespace(note_end=lambda: ends.append(1))
    viewer.note_end()
    assert ends == [1]
