"""What is told of page and record: where they are, and why one is not there."""
import types

import pytest

pytest.importorskip("rospy", reason="needs ROS")

from behavior_controller import folders  # noqa: E402
from behavior_controller.ros import outputs  # noqa: E402
from behavior_controller.ros.outputs import Outputs, record_place  # noqa: E402
from behavior_controller.run.events import Events, Noticed, Starting  # noqa: E402

VALUES = {"monitorPort": 8080, "groot2Port": 1667, "monitorAddress": "127.0.0.1", "robot": "",
          "groot2Address": "127.0.0.1", "recordDirectory": "none"}


class Viewer:
    """A viewer that gets these ports."""

    def __init__(self, arguments, change, ended, warn, tell_ports):
        self.arguments, self.tell_ports, self.ports = arguments, tell_ports, (0, 0)

    def gets(self, *ports):
        self.ports = ports
        self.tell_ports(*ports)


@pytest.fixture
def opened(monkeypatch):
    """Return what opens the viewer of a configuration; it has the lines and events of it."""
    monkeypatch.setattr(outputs, "ViewerProcess", Viewer)

    def make(**values):
        lines, seen, events = [], [], Events()
        made = Outputs(events, lambda *line: lines.append(line))
        made.record = Recorded(seen)
        made.open_viewer(dict(VALUES, **values))
        return types.SimpleNamespace(outputs=made, lines=lines, seen=seen, viewer=made._viewer)
    return make


class Recorded:
    """A record that keeps the events."""

    def __init__(self, seen):
        self._seen = seen

    def __call__(self, event):
        self._seen.append(event)

    def add(self, viewer):
        """Nothing."""

    def open(self):
        """Nothing."""


@pytest.mark.parametrize("directory, expected", [
    ("none", ""), ("", folders.records()), ("/r", "/r")])
def test_where_a_run_is_recorded(directory, expected):
    assert record_place({"recordDirectory": directory}) == expected


@pytest.mark.parametrize("wanted, got, line", [
    ((8080, 1667), (8080, 1667), "page: http://127.0.0.1:8080/"),
    ((8080, 1667), (8081, 1669),
     "page: http://127.0.0.1:8081/ (port 8080 is taken); Groot2: port 1669 (1667 is taken)"),
    ((8080, 0), (8080, 0), "page: http://127.0.0.1:8080/"), ((0, 1667), (0, 1667), None),
    ((0, 1667), (0, 1669), "Groot2: port 1669 (1667 is taken)"),
    ((8080, 1667), (8080, 0), "page: http://127.0.0.1:8080/")])
def test_the_ports_of_page_and_groot2(opened, wanted, got, line):
    shown = opened(monitorPort=wanted[0], groot2Port=wanted[1])
    shown.viewer.gets(*got)
    assert shown.lines == [("info", line)] * bool(line)
    assert [(each.kind, each.name) for each in shown.seen] == [("Groot2", f"port {got[1]}")] * bool(
        got[1])
    shown.outputs.tell_places()
    page = ("info", f"page of this run, closed now: http://127.0.0.1:{got[0]}/")
    assert shown.lines[bool(line):] == [page] * bool(got[0])


@pytest.mark.parametrize("values, attempts, records", [
    ({}, "1", ""), ({"robot": "r1"}, "50", ""), ({"recordDirectory": "/r"}, "1", "/r")])
def test_how_the_viewer_is_started(opened, values, attempts, records):
    arguments = opened(**values).viewer.arguments
    assert dict(zip(arguments[::2], arguments[1::2])) == {
        "--port": "8080", "--address": "127.0.0.1", "--groot2-port": "1667",
        "--groot2-address": "127.0.0.1", "--records": records, "--attempts": attempts}


@pytest.mark.parametrize("values, is_started", [
    ({"monitorPort": 0, "groot2Port": 0}, False), ({"recordDirectory": "/seen"}, False),
    ({"recordDirectory": "/seen", "robot": "r1"}, True), ({"recordDirectory": "/r"}, True)])
def test_where_no_viewer_is_needed_none_is_started(opened, monkeypatch, values, is_started):
    monkeypatch.setattr(outputs, "has_viewer", lambda place: place == "/seen")
    shown = opened(**values)
    assert (shown.viewer is not None) is is_started
    is_told = not is_started and "recordDirectory" in values
    assert shown.lines == [("info", "a missionViewer shows the runs in /seen: no other is started")
                           ] * is_told
    shown.outputs.tell_places()
    assert len(shown.lines) == is_told


@pytest.mark.parametrize("address, url", [
    ("127.0.0.1", "http://127.0.0.1:5/"), ("::1", "http://[::1]:5/"),
    ("0.0.0.0", "http://robot:5/"), ("::", "http://robot:5/")])
def test_the_address_of_the_page(monkeypatch, address, url):
    monkeypatch.setattr(outputs.rosgraph.network, "get_host_name", lambda: "robot")
    assert outputs._url(address, 5) == url


def test_the_lines_of_the_start_are_shown_too(opened):
    shown = opened()
    shown.outputs.note("info", "begins")
    shown.outputs.note("warning", "is old")
    assert shown.lines == [("info", "begins"), ("warning", "is old")]
    assert shown.seen == [Starting("begins"), Noticed("warning", "is old")]


@pytest.mark.parametrize("path, state", [
    (None, "doubtful"), ("", "doubtful"), ("/tmp/x", "ready"), ("/no/such/folder/x", "doubtful")])
def test_whether_the_run_is_recorded(opened, path, state):
    shown = opened()
    shown.outputs._files = None if path is None else types.SimpleNamespace(path=path)
    assert shown.outputs._record_check().state == state
