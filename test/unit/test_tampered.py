"""A record that was tampered with gives replayMission no traceback and no strange exit code, the
report no script."""
import copy
import json
import os
import re

import msgspec
import pytest

from behavior_controller.run.events import (
    EVENTS, BreakpointChanged, Checked, FeedbackReceived, HealthChanged, HookEnded, Line, Noticed,
    Paused, RecognitionPending, Retried, RunFinished, Starting, StopChanged, Suspended, TopicSaid,
    TreeStatuses)
from behavior_controller.robot.gateway import Cause, Failure
from behavior_controller import replay_cli as command
from mission_rig import recorded, visitor_who

pytestmark = pytest.mark.slow

SCRIPT = "<script>alert(1)</script>\"'\x1b[31m\n\u202e"


def nested(depth):
    value = []
    for _ in range(depth):
        value = [value]
    return value


ODD = [None, True, -1, 0, 10**17, 1e308, float("inf"), float("nan"), "", SCRIPT, "\ud800\0", [], {},
       [[]], nested(500)]


KINDS = {kind.__name__ for kind in EVENTS}


def kind_of(line):
    return line["event"]["_type"] if "event" in line else "Header"


@pytest.fixture(scope="module")
def record(tmp_path_factory):
    """The lines of a short run that has a line of each kind."""
    folder = tmp_path_factory.mktemp("record")
    path = recorded(folder, visitor_who(says="no"), failure_rate=0.1, seed=3)
    with open(path, encoding="utf-8") as file:
        lines = [json.loads(line) for line in file]
    began = [kind_of(line) for line in lines].index("RunStarted")
    failure = Failure(Cause.REFUSED, "-", "/x")
    extra = [
        HealthChanged("service", "/x", "n", False, "gone", "-", "gone"),
        Noticed("info", "-"),
        RunFinished("-", 0),
        Paused(failure, "/x"),
        BreakpointChanged(1, "x", True),
        Retried("x", "x", 1, failure),
        RecognitionPending("/speechEvent/text"),
        StopChanged(1, "x", "x", 1, 2, "x", "begun"),
        Suspended("-"),
        Starting("-"),
        HookEnded(1, 1, 1),
        TreeStatuses("R-"),
        FeedbackReceived(1, "-"),
        Checked("topic", "/x", "ready"),
        TopicSaid("/x", "-", 1.0)]
    at = lines[began]["time"]
    lines[began + 1:began + 1] = [msgspec.to_builtins(Line(at, event)) for event in extra]
    return lines


def judged(lines, folder, capsys):
    """Return the exit codes of a replay and of a report, after a look at what they print and write.
    """
    path, page = os.path.join(str(folder), "tampered.jsonl"), os.path.join(str(folder), "page.html")
    data = lines if isinstance(lines, bytes) else "".join(
        json.dumps(line) + "\n" for line in lines).encode()
    with open(path, "wb") as file:
        file.write(data)
    codes = command.main([path]), command.main(["--report", page, path])
    printed = capsys.readouterr()
    for line in printed.out.split("\n") + printed.err.split("\n"):
        assert line.isprintable() and len(line) < 3000
    assert printed.err.count("\n") <= 12 and bool(printed.err) == (2 in codes)
    if codes[1] == 0:
        with open(page, encoding="utf-8") as file:
            assert file.read().count("<script") == 2  # our own: the data, and what shows them
    assert codes[0] in (0, 2, 3) and codes[1] in (0, 2)
    return codes


def places(value, path=()):
    """Yield the paths to the parts of a line: keys and places; of a list or a mapping in it the
    first few."""
    if path:
        yield path
    parts = list(value.items(
    ) if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ())
    for key, part in parts[:2] if path else parts:
        yield from places(part, path + (key,))


def tampered(line, path, change):
    line = copy.deepcopy(line)
    holder = line
    for key in path[:-1]:
        holder = holder[key]
    change(holder, path[-1])
    return line


def delete(holder, key):
    del holder[key]


def test_the_record_itself_is_right_also_with_foreign_line_ends(record, tmp_path, capsys):
    assert set(map(kind_of, record)) == {"Header"} | KINDS - {"Lost"}
    assert judged(record, tmp_path, capsys) == (0, 0)
    data = b"\xef\xbb\xbf" + "".join(json.dumps(line) + "\r\n" for line in record).encode()
    assert judged(data, tmp_path, capsys) == (0, 0)


ALL_KINDS = ["Header"] + sorted(KINDS - {"Lost"})


@pytest.mark.parametrize("step", [15, pytest.param(4, marks=pytest.mark.long)])
@pytest.mark.parametrize("event", ALL_KINDS)
def test_any_part_of_a_line(event, step, record, tmp_path, capsys):
    number = next(number for number, line in enumerate(record) if kind_of(line) == event)
    line = record[number]
    refused = 0
    for turn, path in enumerate(places(line)):
        odd_ones = ODD[turn % step::step]  # at each place one of so many
        for change in [delete] + [
                lambda holder, key, odd=odd: holder.__setitem__(key, odd) for odd in odd_ones]:
            codes = judged(record[:number] + [tampered(line, path, change)] + record[number + 1:],
                           tmp_path, capsys)
            refused += codes[0] == 2
    assert refused > 4


def without(kind):
    return lambda lines: [line for line in lines if kind_of(line) != kind]


def with_fields(lines, **fields):
    """Return the lines with these fields in each event."""
    return lines[:1] + [dict(line, event=dict(line["event"], **fields)) for line in lines[1:]]


@pytest.mark.parametrize("change", [
    lambda lines: lines[::-1],
    lambda lines: [dict(lines[0], lines=-1)] + lines[1:],
    lambda lines: lines + lines,
    lambda lines: lines[1:] + lines[:1],
    lambda lines: [line for line in lines for _ in range(2)],
    lambda lines: lines[len(lines) // 2:],
    lambda lines: lines[:1] + lines[len(lines) // 2:],
    lambda lines: [dict(line, time=0) for line in lines],
    lambda lines: with_fields(lines, at=-1e308),
    lambda lines: with_fields(lines, call=1),
    lambda lines: with_fields(lines, changes=[]),
    lambda lines: with_fields(lines, extra=nested(50)),
    lambda lines: with_fields(lines, _type="Tick"),
    lambda lines: [[line] for line in lines],
    lambda lines: "\n".join(map(json.dumps, lines)).encode("utf-16"),
    lambda lines: b"\0" * 10_000 + b"\n",
    lambda lines: b"\xff\n",
    lambda lines: b"\x80" * 1000,
    lambda lines: b"{" * 100_000 + b"\n",
    lambda lines: json.dumps(lines).encode() + b"\n",
    lambda lines: b"\n" * 100_000] + [without(kind) for kind in ALL_KINDS])
def test_the_record_as_a_whole(change, record, tmp_path, capsys):
    judged(change(record), tmp_path, capsys)


def test_a_pass_number_is_no_html(record, tmp_path, capsys):
    lines = [dict(line, event=dict(line["event"], number=SCRIPT)) if kind_of(line) == "PassFinished"
             else line for line in record]
    assert judged(lines, tmp_path, capsys) == (2, 2)


@pytest.mark.parametrize("name, text", [
    *[("documents", text) for text in (
        "", "\0", "\ud800", SCRIPT, "<root/>", "<a>" * 5000, "x\n" * 5000)],
    ("phrases", SCRIPT), ("policy", SCRIPT)])
def test_the_texts_of_a_record_are_checked_as_files_are(name, text, record, tmp_path, capsys):
    source = [SCRIPT, text]
    lines = copy.deepcopy(record)
    for line in lines:
        if kind_of(line) == "RunStarted":
            line["event"]["sources"][name] = [source] if name == "documents" else source
    assert judged(lines, tmp_path, capsys) == (2, 0)
    assert command.main([str(tmp_path / "tampered.jsonl")]) == 2
    assert re.fullmatch(
        "the record: it cannot be used: .* \\(replay it with the release that wrote it\\)\n",
        capsys.readouterr().err)
