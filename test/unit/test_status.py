"""missionStatus: what it prints of a mission, and that no server makes it hang or fail with a
traceback."""
import contextlib
import fcntl
import io
import itertools
import json
import os
import re
import select
import socket
import struct
import subprocess
import sys
import termios
import threading
import time
import types
from pathlib import Path

import msgspec
import pytest

from behavior_controller import folders
from behavior_controller.run import events
from behavior_controller.run.events import (
    HealthChanged, Line, Noticed, RunFinished, RunStarted, SignOfLife, Sources, Tick, TreeNode,
    TreeShown, unix_now)
from behavior_controller.run.health import GONE
from behavior_controller.robot.requests import Answer, GoTo, Say
from behavior_controller.config.settings import KEYS
from behavior_controller.run.readiness import ReadyRow
from behavior_controller.run.record import files
from behavior_controller.run.record.codec import encode, header
from behavior_controller.run.record.reader import read_record
from behavior_controller.run.state import State
from behavior_controller.text import Source
from behavior_controller.viewer import status_tool
from behavior_controller.viewer.backlog import Backlog
from behavior_controller.viewer.view import PARTS
from mission_rig import (
    FileRecord, Rig, board_of, hanging, one_leaf, refusal, refusing, service_of, visitor_who)
from page_rig import wait_until

SOURCE = os.path.join(os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__)))),
                      "src")
COMMAND = [sys.executable, os.path.join(SOURCE, "behavior_controller", "missionStatus")]


def state_of(board):
    return {name: board.part(name) for name in PARTS}


def good():
    return state_of(board_of(one_leaf("<WelcomeSpeech/>")))


def read(state, **changes):
    """Return a state as the command reads it."""
    return msgspec.convert(dict(state, **changes), status_tool.ShownState)


# ----------------------------------------------------------------------------------- what it prints


def test_what_the_terminal_shows():
    rig = one_leaf('<Sequence name="all"><WelcomeSpeech name="hello"/><FollowMeSpeech/>'
                   '<SayGoodByeSpeech/></Sequence>',
                   lambda request: None if "ollow" in request.text else Answer())
    board = board_of(rig)
    rig.tick()
    doing, robot, *rest = status_tool.lines(read(state_of(board)), False)
    now = board.part("now")
    assert now["card"]["what"] in doing and "“Please follow me.”" in doing
    assert now["robot"]["place"] in robot and now["robot"]["alive"] in robot
    assert rest == ["▶ all (Sequence) #1: running", "  ✔ hello (WelcomeSpeech) #2: success",
                    "  ▶ FollowMeSpeech #3: running"]
    assert status_tool.lines(read(state_of(board)), True)[-1] == "  · SayGoodByeSpeech #4"
    assert isinstance(rig.requests[0], Say)


def test_what_is_wrong_is_shown():
    rig = one_leaf("<WelcomeSpeech/>")
    board = board_of(rig)
    rig.report(GONE, HealthChanged("service", "/a/b", "", False, "gone", "it cannot \x1b[2Jdrive"))
    state = state_of(board)
    todo, _, wrong = status_tool.lines(read(state), False)[1:4]
    assert todo == "to do: Restart /a/b"
    assert wrong == "service /a/b: gone; it cannot \\x1b[2Jdrive"
    assert "no message for 7 s" in status_tool.lines(read(state, silent=7.2), False)[3]
    alive = {"age": 8.5, "hangs": True, "at": 0.0}
    hung = status_tool.lines(read(state, alive=alive), False)[3]
    assert "hangs" in hung and "8.5 s" in hung


def test_a_picture_is_old_after_two_seconds_and_five_lines_of_trouble_are_shown():
    rig = one_leaf("<WelcomeSpeech/>")
    board = board_of(rig)
    for number in range(7):
        rig.mission.events.emit(Noticed("error", "line {}".format(number)))
    state = state_of(board)
    assert [line.split("  ")[1] for line in status_tool.lines(read(state), False)[2:7]] == [
        "line {}".format(number) for number in range(2, 7)]
    assert len(status_tool.lines(read(state), False)) == 8 == len(
        status_tool.lines(read(state, silent=1.99), False))
    assert len(status_tool.lines(read(state, silent=2.0), False)) == 9


def test_a_failure_is_shown_with_what_came_of_it():
    asked = []

    def refuse_once(request):
        asked.append(request)
        return refusal(request) if len(asked) == 1 else NotImplemented

    rig = one_leaf("<Fallback><WelcomeSpeech/><HandleFallBack/></Fallback>", refuse_once)
    board = board_of(rig)
    for _ in range(4):
        rig.tick()
        rig.clock.advance(1.0)
    told = [row["text"] for row in board.part("story")["sentences"] if row["incident"]]
    line = status_tool.lines(read(state_of(board)), False)[2]
    assert len(told) == 3 and line.endswith("  {}; {}".format(told[0], told[2]))


def test_a_node_that_is_gone_is_told_once_and_what_is_done_again_is_marked():
    rig = one_leaf("<Sequence><LookUpHome/><Fallback><Navigate/><HandleFallBack/></Fallback>"
                   "</Sequence>", refusing(GoTo))
    board = board_of(rig)
    rig.tick()
    rig.report(GONE, HealthChanged(
        "service", service_of(GoTo), "nav", False, "gone: refused", "it cannot drive", GONE))
    rest = status_tool.lines(read(state_of(board)), False)[2:]
    rows = [line.strip() for line in rest]
    assert len([line for line in rows if "gone: refused" in line]) == 1
    assert [row for row in rows if "Navigate" in row and row[:1] in "✘▶↻"] == [
        "↻ Navigate #4: done again after a failure"]
    tree = [line for line in rest if line.lstrip()[0] in status_tool.MARKS.values()]
    assert [line for line in status_tool.fitted(tree, 60, 2) if "Navigate #4" in line]


def tree_rows(nodes, letters, tip=0, is_all=False):
    """Return the rows of a tree of (parent, name), of which those in brackets are bare."""
    rows = [{"uid": uid, "parent": parent, "name": name.strip("()"), "kind": "", "path": "",
             "subtree": False, "bare": name[0] == "("}
            for uid, (parent, name) in enumerate(nodes, 1)]
    state = read(good(), mission={"file": "m.xml", "nodes": rows},
                 statuses={"letters": letters, "tip": tip})
    return status_tool.lines(state, is_all)[2:]


FOUR = [(0, "all"), (1, "(group)"), (2, "say"), (2, "go")]


@pytest.mark.parametrize("nodes, letters, tip, is_all, expected", [
    (FOUR, "RRSR", 4, False, ["▶ all: running", "  ✔ say: success", "  ▶ go: running"]),
    (FOUR, "RRS-", 0, False, ["▶ all: running", "  ✔ say: success"]),
    (FOUR, "RRS-", 2, False, ["▶ all: running", "  ▶ group: running", "    ✔ say: success"]),
    (FOUR, "rrsf", 0, False, ["■ all: was halted", "  ✔ say: was success", "  ✘ go: was failure"]),
    (FOUR, "RRSF", 4, False,
     ["▶ all: running", "  ✔ say: success", "  ↻ go: done again after a failure"]),
    (FOUR, "----", 0, False, ["· all"]),
    (FOUR, "RR", 0, True, ["▶ all: running", "  ▶ group: running", "    · say", "    · go"]),
    (FOUR, "????", 0, True, ["· all", "  · group", "    · say", "    · go"]),
    ([(0, "(all)"), (1, "say")], "RR", 0, False, ["▶ all: running", "  ▶ say: running"]),
    # numbers that no tree has
    ([(7, "all"), (2, "say"), (3, "go")], "RRR", 0, False,
     ["▶ all: running", "  ▶ say: running", "  ▶ go: running"])])
def test_the_rows_of_a_tree(nodes, letters, tip, is_all, expected):
    assert tree_rows(nodes, letters, tip, is_all) == expected


def test_the_rows_of_a_deep_tree_are_indented_so_far():
    rows = tree_rows([(parent, "n") for parent in range(33)], 33 * "R")
    assert [len(row) - len(row.lstrip()) for row in rows] == [
        2 * min(depth, status_tool.MAX_INDENT) for depth in range(33)]


def told(*sentences):
    """Return the lines about troubles of a story of (visit, kind, severity, incident)."""
    rows = [{"at": 0.0, "visit": visit, "kind": kind, "severity": severity, "text": str(number),
             "uid": 0, "incident": incident, "number": number, "time": "12:00:00"}
            for number, (visit, kind, severity, incident) in enumerate(sentences, 1)]
    state = read(good(), story={"visit": None, "sentences": rows})
    return [line.replace("12:00:00  ", "") for line in status_tool.lines(state, False)[2:-1]]


FAILS, HELPS = (1, "failure", "warning", 5.0), (1, "recovery", "info", 5.0)


@pytest.mark.parametrize("sentences, lines", [
    ([], []), ([HELPS], []), ([FAILS], ["1"]), ([FAILS, HELPS], ["1; 2"]),
    ([HELPS, FAILS, HELPS, HELPS], ["2; 4"]),
    ([FAILS, (2, *FAILS[1:]), HELPS], ["1", "2", "3"]),
    ([HELPS, FAILS, (1, "notice", "warning", 0.0), (1, "notice", "info", 0.0), HELPS, FAILS],
     ["2", "3", "5; 6"]),
    ([(1, "notice", "error", 0.0), (1, "notice", "info", 0.0), (1, "notice", "error", 0.0)],
     ["1", "3"]),
    # how the robot is has lines of its own; that it is well again belongs to the incident
    ([(1, "health", "warning", 5.0)], []),
    ([FAILS, (1, "health", "warning", 5.0)], ["1"]),
    ([FAILS, (1, "health", "info", 5.0)], ["1; 2"]),
    ([(1, "notice", "error", float(number)) for number in range(1, 8)], list("34567"))])
def test_what_went_wrong_is_a_line_for_each_incident(sentences, lines):
    assert told(*sentences) == lines


def test_the_card_is_last_where_a_long_tree_would_hide_it():
    rig = one_leaf("<WelcomeSpeech/>", lambda request: None)
    board = board_of(rig)
    rig.tick()
    rig.mission.events.emit(Noticed("error", "it is so"))
    state = read(state_of(board))
    card, robot, wrong, *tree = status_tool.lines(state, False)
    assert "WelcomeSpeech" in tree[-1] and "saying" in card
    assert status_tool.lines(state, False, True) == [*tree, wrong, robot, card]


def test_the_head_before_the_mission_has_its_name():
    state = good()
    state["mission"]["file"] = ""
    state["now"]["card"]["what"] = "starting: waiting for /say"
    assert status_tool.lines(read(state), False)[0].startswith("mission: ")
    state["mission"]["robot"] = "robot1"
    assert status_tool.lines(read(state), False)[0].startswith("mission of robot1: ")


def test_a_second_face_is_in_the_head():
    state = good()
    rows = [ReadyRow("topic", "/faces", "ready", "2 faces, 1 looking at the robot"),
            ReadyRow("topic", "/mode", "untried", "nothing was heard yet"),
            ReadyRow("service", "/say", "ready", "there, and was asked")]
    ready = {"rows": [msgspec.to_builtins(row) for row in rows], "is_ready": True}
    heard = "hears: /faces: 2 faces, 1 looking at the robot"
    assert status_tool.lines(read(state, ready=ready), False)[2] == heard
    state["now"]["ended"] = "stopped"
    assert heard not in status_tool.lines(read(state, ready=ready), False)


def test_a_controller_that_was_killed_is_not_shown_as_under_way():
    rig = one_leaf("<WelcomeSpeech/>", lambda request: None)
    board = board_of(rig)
    rig.tick()
    state = state_of(board)
    assert state["now"]["card"]["kind"] == "step"
    state["now"]["ended"] = "the controller has stopped"
    head = status_tool.lines(read(state), False)[0]
    assert ": the controller has stopped; last: saying “" in head and " of at most " not in head


def test_a_standstill_is_in_the_head():
    rig = one_leaf("<WelcomeSpeech/>", lambda request: None)
    board = board_of(rig)
    rig.tick()
    rig.mission.events.emit(Noticed("warning", "the controller stood still for 9 s"))
    assert status_tool.lines(read(state_of(board)), False)[2].endswith("stood still for 9 s")


def test_how_the_run_ended_is_in_the_first_line():
    rig = Rig(answer=hanging(GoTo))
    board = board_of(rig)
    rig.run(visitor_who("yes"), is_stopped=lambda: bool(rig.requests) and isinstance(
        rig.requests[-1], GoTo))
    state = read(state_of(board))
    assert state.now.card.kind == "ended"
    assert state.now.card.what in status_tool.lines(state, False)[0]


def test_how_long_it_takes_goes_on_while_no_message_comes():
    rig = one_leaf("<WelcomeSpeech/>", lambda request: None)
    board = board_of(rig)
    rig.tick()
    state = state_of(board)
    state["alive"]["at"] = state["now"]["card"]["since"] + 3.0
    assert ", 3 s of at most 60 s" in status_tool.lines(read(state), False)[0]
    assert ", 7 s of at most 60 s" in status_tool.lines(read(state, silent=4.0), False)[0]


@pytest.mark.slow
@pytest.mark.parametrize("width, height", [(20, 8), (40, 12), (80, 24), (100, 30), (200, 130)])
def test_a_window_shows_what_runs_and_what_lies_about_it(width, height):
    rig = Rig(answer=hanging(GoTo))
    board, states = board_of(rig), []

    def visitor(rig):
        states.append(state_of(board))
        visitor_who("yes")(rig)

    rig.run(visitor, is_stopped=lambda: len(states) > 5)
    text = status_tool.lines(read(states[-1]), False)
    found = status_tool.fitted(text, width, height)
    assert len(found) < height and all(len(line) <= width for line in found)
    assert " ".join(" ".join(found[:8]).split()).startswith(text[0][:40])
    assert height < 24 or any("▶ Navigate" in line for line in found)


@pytest.mark.parametrize("width, height", [(20, 24), (32, 14), (40, 20), (80, 24)])
def test_what_a_person_has_to_do_is_whole_in_a_narrow_window(width, height):
    state = good()
    todo = "Restart /robotNavigation, /overtAttention and 7 more; switch attention and lifelike " \
        "movement off by hand; take the robot home"
    state["now"]["robot"].update(is_well=False, instruction=todo, alive="/" + "gone " * 80)
    found = status_tool.fitted(status_tool.lines(read(state), True), width, height)
    assert "".join(todo.split()) in "".join("".join(found).split())
    assert all(len(line) <= width for line in found)


@pytest.mark.parametrize("width, height, expected", [
    (16, 5, ["robot: well", "  ✔ B: success", "  ▶ C: running", "  · D"]),
    (12, 5, ["robot: well", "    success", "  ▶ C:", "    running"]),
    (40, 3, ["robot: well", "  ▶ C: running"]), (8, 4, ["robot:", "    well", "  ▶ C:"]),
    (40, 1, ["robot: well"]),
    (40, 20, ["robot: well", "▶ A: running", "  ✔ B: success", "  ▶ C: running", "  · D"])])
def test_a_window_line_by_line(width, height, expected):
    text = ["robot: well", "▶ A: running", "  ✔ B: success", "  ▶ C: running", "  · D"]
    assert status_tool.fitted(text, width, height) == expected


@pytest.mark.parametrize("height, first, last", [
    (3, 20, 20), (4, 19, 20), (5, 19, 21), (8, 17, 22), (9, 17, 23)])
def test_the_leaf_that_runs_is_in_the_middle_of_a_window(height, first, last):
    rows = ["· node {}".format(number) for number in range(40)]
    rows[20] = "▶ node 20"
    found = status_tool.fitted(["robot: well"] + rows, 80, height)
    assert found == ["robot: well"] + rows[first:last + 1]


def test_a_window_in_which_nothing_runs_begins_with_the_first_row():
    rows = ["✔ node {}".format(number) for number in range(40)]
    for height in (2, 3, 9):
        assert status_tool.fitted(rows, 80, height) == rows[:height - 1]


def test_a_line_above_the_tree_that_is_wrapped_before_a_dot_is_no_row_of_it():
    text = ["mission tour: stop 3 · next: turn", "▶ A: running", "  ▶ B: running"]
    assert status_tool.fitted(text, 20, 4) == [
        "mission tour: stop 3", "    · next: turn", "  ▶ B: running"]


def test_names_cannot_steer_the_terminal():
    state = good()
    state["mission"]["nodes"][0]["name"] = "a\x1b]0;owned\x07\nb"
    state["now"]["card"]["what"] = "\x9b31m"
    text = "\n".join(status_tool.lines(read(state), True))
    assert "\x1b" not in text and "\x9b" not in text and "a\\x1b]0;owned\\x07\\nb" in text


# --------------------------------------------------------------------------------------- the server


@pytest.fixture(autouse=True)
def own_clock(monkeypatch):
    """The command uses the clock of the computer that it asks."""
    monkeypatch.setattr(events, "_unix_at_zero", events._unix_at_zero)


@contextlib.contextmanager
def server(*pieces, pause=0.0, keeps_open=False):
    """Answer each connection with ``pieces`` (bytes, or a function that returns an endless
    iterator), ``pause`` apart."""
    listener = socket.create_server(("127.0.0.1", 0))
    over = threading.Event()

    def answer(link):
        with link, contextlib.suppress(OSError):
            link.recv(4096)
            for piece in pieces:
                for part in piece() if callable(piece) else [piece]:
                    if over.wait(pause):
                        return
                    link.sendall(part)
            if keeps_open:
                over.wait(60)

    def serve():
        with contextlib.suppress(OSError):
            while True:
                threading.Thread(target=answer, args=(listener.accept()[0],), daemon=True).start()

    threading.Thread(target=serve, daemon=True).start()
    try:
        yield listener.getsockname()[1]
    finally:
        over.set()
        listener.shutdown(socket.SHUT_RDWR)
        listener.close()


def http(body, line="200 OK", *headers):
    return "\r\n".join(("HTTP/1.0 " + line,) + headers + ("", "")).encode() + body


def sent(*happened, stopped="", **told):
    """Return what the viewer sends of a run of these events."""
    backlog = Backlog()
    for number, happens in enumerate(happened):
        backlog.take(State(), Line(unix_now() + number / 1000, happens))
    return batch(backlog.since(0)[1], is_first=True, stopped=stopped, **told)


def batch(texts, **told):
    head = dict({"lines": len(texts), "is_first": False, "at": unix_now()}, **told)
    return json.dumps(head).encode() + b"\n" + b"".join(texts)


def more(*happened, **told):
    return batch([encode(unix_now(), happens) for happens in happened], **told)


SPEECH = TreeShown("M", [TreeNode("a", "WelcomeSpeech", "a", 0, label="WelcomeSpeech #1")])
GOOD = [SPEECH, Tick(0.0, True, [(1, "R")])]


def endless(piece):
    return lambda: itertools.repeat(piece)


BAD = {
    "nothing at all": ([b""], "Remote end closed"),
    "no HTTP": ([b"SSH-2.0-OpenSSH_9.2\r\n"], "SSH-2.0"),
    "not even text": ([b"\x00\xff\xfe\r\n\r\n"], ""),
    "an empty body": ([http(b"")], "(the answer is not a mission's)"),
    "a web page": ([http(b"<html>")], "(the answer is not JSON)"),
    "a number": ([http(b"3\n")], "Expected `object`"),
    "a list": ([http(b"[]\n")], "Expected `object`"),
    "no batch": ([http(b"{}\n")], "required field `lines`"),
    "a wrong type": ([http(batch([], lines="5"))], "Expected `int`, got `str` - at `$.lines`"),
    "a wrong time": ([http(batch([], at="1"))], "got `str` - at `$.at`"),
    "no UTF-8": ([http(b'{"lines": "\xff\n')], "not JSON"),
    "deep JSON": ([http(b'{"x":' * 100000)], "not JSON"),
    "no header": ([http(batch([encode(1.0, SPEECH)], is_first=True))], "this is no record"),
    "another version": ([http(batch([header(1, 1.0).replace(b"11", b"99")], is_first=True))],
                        "version 99"),
    "no event": ([http(batch([header(1, 1.0), b"{}\n"], is_first=True))], "not a line of a record"),
    "truncated": ([http(sent(*GOOD)[:-20])], "not a line of a record"),
    "less than was said": ([http(b"{}", "200 OK", "Content-Length: 500")], ""),
    "a wrong chunk": ([http(b"zz\r\n{}\r\n", "200 OK", "Transfer-Encoding: chunked").replace(
        b"1.0", b"1.1", 1)], ""),
    "a redirect": ([http(b"", "302 Found", "Location: http://127.0.0.1:9/")], "HTTP 302 Found"),
    "not found": ([http(b"", "404 Not Found")], "HTTP 404"),
    "an error": ([http(b"", "500 \x1b[31mBad")], "HTTP 500 \\x1b[31mBad"),
    "a long header": ([http(b"", "200 OK", "X: " + "x" * 70000)], "header line"),
    "many headers": ([http(b"", "200 OK", *["X: y"] * 200)], "headers"),
    "an endless body": ([http(b""), endless(b"x" * 100000)], "more than 10000000 bytes")}


@pytest.mark.slow
@pytest.mark.parametrize("pieces, expected", BAD.values(), ids=BAD.keys())
@pytest.mark.parametrize("arguments", [[], ["--watch"]], ids=["once", "watch"])
def test_a_bad_server_is_one_line(capsys, pieces, expected, arguments):
    with server(*pieces) as port:
        assert status_tool.main(["--port", str(port)] + arguments) == 1
    printed = capsys.readouterr()
    assert printed.out == "" and printed.err.count("\n") == 1 and "\x1b" not in printed.err
    assert "http://127.0.0.1:{} ".format(port) in printed.err and "monitorPort" in printed.err
    assert expected in printed.err


@pytest.mark.slow
@pytest.mark.parametrize("pieces", [
    pytest.param([b"HTTP/1.0 200 OK\r\n", endless(b"X")], id="a header that drips"),
    pytest.param([http(b""), endless(b" ")], id="a body that drips"),
    pytest.param([], id="silence"),
    pytest.param([http(batch([header(1, 1.0)], lines=10 ** 9)),
                  endless(encode(1.0, Noticed("info", "so")))], id="no last line")])
@pytest.mark.parametrize("arguments", [[], ["--watch"]], ids=["once", "watch"])
def test_a_server_that_drips_is_not_waited_for(capsys, monkeypatch, pieces, arguments):
    monkeypatch.setattr(status_tool, "FIRST_ANSWER_LIMIT", 0.5)
    with server(*pieces, pause=0.05, keeps_open=True) as port:
        began = time.monotonic()
        assert status_tool.main(["--port", str(port)] + arguments) == 1
        assert time.monotonic() - began < 5.0
    assert "(no complete answer within 0.5 s)" in capsys.readouterr().err
    # the command ends in spite of it
    assert all(each.daemon for each in threading.enumerate() if each.name == "messages")


ENDED = RunFinished("stopped", 0)
STREAM = http(b"", "200 OK", "Content-Type: application/x-ndjson")


@pytest.mark.parametrize("last, words", [
    (more(RunFinished("all passes are done; last pass: SUCCESS", 0)),
     "all passes are done; last pass: SUCCESS"),
    (more(stopped="the controller has stopped"), "the controller has stopped"),
    (sent(SPEECH, ENDED), "stopped")],
    ids=["its end", "a controller that stopped", "another run"])
def test_watching_tells_how_the_mission_ended(capsys, last, words):
    with server(STREAM, sent(*GOOD), last) as port:
        assert status_tool.main(["--watch", "--port", str(port)]) == 0
    printed = capsys.readouterr()
    assert printed.out.endswith("missionStatus: the mission has ended: {}\n".format(words))
    assert printed.err == ""


@pytest.mark.parametrize("columns, rows, lines", [(200, 4, 3), (0, 0, 4), (80, 1, 1)])
def test_watching_in_a_terminal_fills_its_window_if_its_size_is_known(
        monkeypatch, columns, rows, lines):
    terminal, inside = os.openpty()
    fcntl.ioctl(inside, termios.TIOCSWINSZ, struct.pack("HHHH", rows, columns, 0, 0))
    with os.fdopen(inside, "w", encoding="utf-8") as stdout, server(
            STREAM, sent(*GOOD), more(ENDED)) as port:
        monkeypatch.setattr(sys, "stdout", stdout)
        assert status_tool.main(["--watch", "--port", str(port)]) == 0
        printed = b""
        while not printed.endswith(b"stopped\r\n") and select.select([terminal], [], [], 5.0)[0]:
            printed += os.read(terminal, 10000)
    os.close(terminal)
    found = printed.decode().replace("\r\n", "\n")
    shown, cleared, last = found.rpartition("\x1b[J")
    assert (shown[:3], cleared) == ("\x1b[H", "\x1b[J")
    assert shown.rpartition("\x1b[H")[2].count("\x1b[K\n") == lines
    assert last == "missionStatus: the mission has ended: stopped\n"


def test_watching_prints_at_once_what_a_pipe_is_to_carry_on(monkeypatch):
    monkeypatch.setattr(status_tool, "LATE", 0.1)
    monkeypatch.setattr(status_tool, "NO_MESSAGE_LIMIT", 0.1)
    carried, pipe = os.pipe()
    os.set_blocking(carried, False)
    with os.fdopen(pipe, "w", encoding="utf-8") as stdout, server(STREAM, sent(*GOOD),
                                                                  keeps_open=True) as port:
        monkeypatch.setattr(sys, "stdout", stdout)
        assert status_tool.main(["--watch", "--port", str(port)]) == 1
        assert b"WelcomeSpeech" in os.read(carried, 10000)
    os.close(carried)


def test_once_is_once_though_the_mission_has_ended(capsys):
    with server(http(sent(*GOOD, ENDED))) as port:
        assert status_tool.main(["--port", str(port)]) == 0
    assert capsys.readouterr().out.endswith("\n▶ WelcomeSpeech #1: running\n")


@pytest.mark.parametrize("length, code", [(0, 0), (-1, 1)])
def test_a_line_may_have_so_many_bytes(capsys, monkeypatch, length, code):
    message = sent(*GOOD)
    longest = max(map(len, message.splitlines(True)))
    monkeypatch.setattr(status_tool, "LONGEST_LINE_READ", longest + length)
    with server(http(message)) as port:
        assert status_tool.main(["--port", str(port)]) == code
    assert ("the answer has more than {} bytes".format(longest - 1)
            in capsys.readouterr().err) == bool(code)


@pytest.mark.parametrize("last, expected", [
    (b"", "the connection was closed"), (b"{\n", "not JSON"),
    (b'{"lines": "3"}\n', "got `str` - at `$.lines`")])
def test_watching_tells_why_it_ends_without_the_end_of_the_mission(capsys, last, expected):
    with server(STREAM, sent(*GOOD), last) as port:
        assert status_tool.main(["--watch", "--port", str(port)]) == 1
    printed = capsys.readouterr()
    assert "WelcomeSpeech" in printed.out and printed.err.count("\n") == 1
    assert "the connection to http://127.0.0.1:{} is lost".format(
        port) in printed.err and expected in printed.err


@pytest.mark.slow
def test_watching_a_controller_that_is_frozen_tells_how_old_the_picture_is(capsys, monkeypatch):
    monkeypatch.setattr(status_tool, "LATE", 0.2)
    monkeypatch.setattr(status_tool, "NO_MESSAGE_LIMIT", 2.5)
    with server(STREAM, sent(*GOOD), keeps_open=True) as port:
        assert status_tool.main(["--watch", "--port", str(port)]) == 1
    printed = capsys.readouterr()
    words = "no message for ([0-9]+) s: what is shown may be old"
    ages = list(map(int, re.findall(words, printed.out)))
    assert ages == sorted(set(ages)) and len(ages) >= 2  # a line a second
    assert int(re.search(r"\(no message for ([0-9]+) s\)", printed.err).group(1)) >= 2


def test_what_has_not_changed_is_not_printed_again(capsys):
    with server(STREAM, sent(*GOOD), more(), more(SignOfLife())) as port:
        status_tool.main(["--watch", "--port", str(port)])
    assert capsys.readouterr().out.count("WelcomeSpeech") == 2  # the card, and the tree


@pytest.mark.parametrize("ahead", [-5000.0, 5000.0])
def test_the_clock_of_another_computer_makes_nothing_old(capsys, ahead):
    at = unix_now() + ahead
    texts = [header(1, at)] + [encode(at, each) for each in (*GOOD, SignOfLife())]
    with server(http(batch(texts, is_first=True, at=at + 4.0))) as port:
        assert status_tool.main(["--port", str(port)]) == 0
    assert "the controller hangs: no sign of its tick thread for 4.0 s" in capsys.readouterr().out


# --------------------------------------------------------------------------------------- the record


@pytest.fixture
def run(tmp_path, monkeypatch):
    """A run that is written to the default folder, whose page would have the port 9."""
    monkeypatch.setenv("ROS_LOG_DIR", str(tmp_path))
    with written_run("tour", 9) as record:
        yield record


@contextlib.contextmanager
def written_run(mission, port, robot=""):
    """A run of that mission whose page has that port, as it is written to the default folder."""
    record = FileRecord(folders.records()).open()
    rig = one_leaf("<WelcomeSpeech/>", lambda request: None)
    rig.mission.events.subscribe(record)
    record.show(rig.tree)
    record(RunStarted(mission + ".xml", [], {"monitorPort": port, "robot": robot}, Sources(
        (Source("m.xml", "<m/>"),), Source("", ""), Source("", ""), "")))
    rig.tick()
    yield record
    record.close()


def command(*arguments):
    """Return exit code, output and complaints of the command."""
    out, error = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(error):
        try:
            code = status_tool.main(list(arguments))
        except SystemExit as end:
            code = end.code
    return types.SimpleNamespace(code=code, out=out.getvalue(), error=error.getvalue())


def status_until(words, *arguments):
    """Return the result of the command when it is so."""
    ends = time.monotonic() + 10.0
    while True:
        done = command(*arguments)
        if words in done.out + done.error or time.monotonic() > ends:
            return done


@pytest.mark.slow
def test_a_run_of_this_computer_is_read_from_its_record(run):
    done = status_until("tour: running", "--port", "9")
    assert (done.code, done.error) == (0, "")
    lines = done.out.splitlines()
    assert lines[0].startswith("mission tour: ") and lines[-1] == "▶ tour: running"


@pytest.mark.slow
@pytest.mark.parametrize("arguments", [
    ["--port", "10"], ["--port", "9", "--address", "host.invalid"]])
def test_the_record_of_another_mission_is_not_shown(run, arguments):
    status_until("tour", "--port", "9")
    done = command(*arguments)
    assert done.code == 1 and done.out == "" and "no mission answers" in done.error


@pytest.mark.slow
@pytest.mark.parametrize("port, shown", [("9", "mission tour: "), ("10", "mission other: ")])
def test_of_two_runs_the_one_with_that_port_is_shown_or_else_the_one_without_a_page(
        run, port, shown):
    with written_run("other", 0):
        done = status_until(shown, "--port", port)
    assert done.out.startswith(shown)


@pytest.mark.slow
@pytest.mark.parametrize("arguments, shown", [
    (["--port", "9"], "mission tour: "), (["--robot", "robot1"], "mission other of robot1: "),
    (["--robot", "/robot1", "--port", "9"], "mission other of robot1: ")])
def test_of_several_robots_the_one_that_is_named_is_shown(run, arguments, shown):
    with written_run("other", 9, "robot1"):
        done = status_until(shown, *arguments)
    assert done.out.startswith(shown)


@pytest.mark.slow
def test_a_record_that_cannot_be_read_hides_no_other(run):
    status_until("tour: running", "--port", "9")
    with written_run("other", 9) as newer:
        status_until("mission other", "--port", "9")
        with open(newer.path, "ab") as file:
            file.write(b"{}\n")
        done = command("--port", "9")
    assert (done.code, done.error) == (0, "")
    assert done.out.startswith("mission tour: ")


@pytest.mark.slow
def test_a_further_file_of_a_record_does_not_take_away_what_went_wrong(run, monkeypatch):
    run(Noticed("error", "the lamp is broken"))
    status_until("the lamp is broken", "--port", "9")
    further, ends = files.part(run.path, 1), time.monotonic() + 10.0
    with monkeypatch.context() as small:
        small.setattr(files, "FILE_BYTES", 1)
        run(SignOfLife())
        while not os.path.exists(further) and time.monotonic() < ends:
            time.sleep(0.05)
    assert os.path.exists(further)
    assert "the lamp is broken" in command("--port", "9").out


@pytest.mark.slow
@pytest.mark.parametrize("age, told", [(0.0, ""), (100.0, "no message for 100 s: what is shown")])
def test_a_record_that_lags_is_shown_with_its_age(run, monkeypatch, capsys, age, told):
    status_until("tour: running", "--port", "9")
    last = read_record(run.path)[-1].time
    monkeypatch.setattr(status_tool, "unix_now", lambda: last + age)
    assert status_tool.main(["--port", "9"]) == 0
    shown, error = capsys.readouterr()
    assert shown.startswith("mission tour: ") and error == ""
    assert told in shown and ("what is shown may be old" in shown) is bool(told)


@pytest.mark.slow
def test_the_simulated_time_of_a_record_is_followed(tmp_path, monkeypatch):
    """Else a clock that goes at half the computer's speed would make all old."""
    monkeypatch.setenv("ROS_LOG_DIR", str(tmp_path))
    monkeypatch.setattr(events, "_unix_at_zero", events._unix_at_zero)  # to be restored
    with monkeypatch.context() as simulated:
        simulated.setattr(events, "_ros_now", lambda: 1.0)
        simulated.setattr(events, "_unix_at_zero", events._unix_at_zero - 5000.0)
        with written_run("tour", 9) as record:
            record(SignOfLife())
            wait_until(lambda: b"SignOfLife" in Path(record.path).read_bytes())
            simulated.undo()
            done = command("--port", "9")
    assert done.out.startswith("mission tour: ") and "may be old" not in done.out


@pytest.mark.slow
def test_a_viewer_is_asked_before_a_record_that_lags_is_shown(run, monkeypatch, capsys):
    status_until("tour: running", "--port", "9")
    last = read_record(run.path)[-1].time
    with server(http(sent(*GOOD))) as port:
        run(RunStarted("tour.xml", [], {"monitorPort": port}, Sources(
            (Source("m.xml", "<m/>"),), Source("", ""), Source("", ""), "")))
        status_until("tour", "--port", str(port))
        monkeypatch.setattr(status_tool, "unix_now", lambda: last + 100.0)
        assert status_tool.main(["--port", str(port)]) == 0
    assert "mission tour" not in capsys.readouterr().out


@pytest.mark.slow
def test_a_record_is_watched_to_the_end_of_its_run(run):
    status_until("tour", "--port", "9")
    with subprocess.Popen(COMMAND + ["--watch", "--port", "9"], stdout=subprocess.PIPE,
                          env=dict(os.environ, PYTHONPATH=SOURCE)) as watching:
        assert watching.stdout.readline().startswith(b"mission tour: ")
        run(RunFinished("stopped; last pass: none", 0))
        run.close()
        assert watching.stdout.read().decode().endswith(
            "missionStatus: the mission has ended: stopped; last pass: none\n")
    assert watching.returncode == 0


def test_a_tree_of_many_levels_is_printed(capsys):
    nodes = [TreeNode("n", "Inverter", "n", parent, label="n") for parent in range(1901)]
    before = sys.getrecursionlimit()
    with server(http(sent(TreeShown("M", nodes)))) as port:
        sys.setrecursionlimit(300)
        try:
            assert status_tool.main(["--all", "--port", str(port)]) == 0
        finally:
            sys.setrecursionlimit(before)
    assert capsys.readouterr().out.rstrip().endswith("  · n")


# -------------------------------------------------------------------------------------- the command


def test_nobody_there_is_one_line(capsys):
    assert status_tool.main(["--port", "9"]) == 1
    error = capsys.readouterr().err
    assert error.count("\n") == 1 and "http://127.0.0.1:9" in error and "monitorPort" in error


@pytest.mark.parametrize("port, is_one", [
    ("0", False), ("1", True), ("65535", True), ("65536", False), ("x", False)])
def test_the_numbers_of_ports(capsys, port, is_one):
    with contextlib.nullcontext() if is_one else pytest.raises(SystemExit):
        assert status_tool.main(["--port", port]) == 1
    assert ("'{}' is not a port: 1 to 65535".format(port) in capsys.readouterr().err) != is_one


def test_the_command_s_help_tells_the_default_of_the_configuration(capsys):
    with pytest.raises(SystemExit):
        status_tool.main(["--help"])
    printed = " ".join(capsys.readouterr().out.split())
    defaults = {key.name: key.default for key in KEYS}
    for name in ("monitorAddress", "monitorPort"):
        assert "{} of the node (default {})".format(name, defaults[name]) in printed
    for words in (" ".join(status_tool.EXIT_CODES.split()), "--watch go on", "--all also"):
        assert words in printed


@pytest.mark.slow
@pytest.mark.parametrize("code, arguments", [
    *[(2, ["--port", port]) for port in ("70000", "0", "x", "-1")], (2, ["--wtach"]),
    *[(1, ["--address", name]) for name in (
        "no such host", "", "\N{SNOWMAN}" * 70, "127.0.0.1\n")]])
def test_wrong_arguments_are_told_without_a_traceback(code, arguments):
    done = command("--port", "9", *arguments)
    assert done.code == code and 0 < done.error.count("\n") <= 4


@pytest.mark.slow
def test_a_terminal_without_the_signs_and_a_full_disk():
    variables = dict(os.environ, PYTHONPATH=SOURCE, PYTHONIOENCODING="ascii")
    with server(http(sent(*GOOD))) as port, open("/dev/full", "w") as full:
        words = COMMAND + ["--all", "--port", str(port)]
        assert "\\u25b6" in subprocess.check_output(words, env=variables, encoding="ascii")
        done = subprocess.run(words, env=variables, stdout=full, stderr=subprocess.PIPE,
                              encoding="utf-8", timeout=30)
    assert (done.returncode, done.stderr) == (
        1, "missionStatus: cannot print: No space left on device\n")
