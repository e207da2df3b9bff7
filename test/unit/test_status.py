"""missionStatus: what it prints of a mission, and that no server makes it hang or fail with a traceback."""
import contextlib
import itertools
import json
import os
import socket
import subprocess
import sys
import threading
import time

import pytest

from behavior_controller.events import HealthChanged, Noticed, RunFinished
from behavior_controller.health import GONE
from behavior_controller.interface.records import Answer, GoTo, Say
from behavior_controller.leaves import registry
from behavior_controller.watch import status
from behavior_controller.watch.board import PARTS, Board
from mission_rig import Rig, one_leaf, visitor_who

SOURCE = os.path.join(os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__)))), "src")


def board_of(rig):
    board = Board(rig.mission.events, rig.mission.health, registry())
    board.show(rig.tree)
    return board


def state_of(board):
    return {name: board.part(name) for name in PARTS}


def good():
    return state_of(board_of(one_leaf("<WelcomeSpeech/>")))


# ------------------------------------------------------------------------------------------------------- what it prints


def test_what_the_terminal_shows():
    rig = one_leaf('<Sequence name="all"><WelcomeSpeech name="hello"/><FollowMeSpeech/><SayGoodByeSpeech/></Sequence>',
                   lambda request: None if "ollow" in request.text else Answer())
    board = board_of(rig)
    rig.tick()
    state = state_of(board)
    assert status.lines(state, False) == [
        "mission ; saying “Please follow me.”, 0 s of at most 60 s",
        "▶ all (Sequence) #1: running", "  ✔ hello (WelcomeSpeech) #2: success", "  ▶ FollowMeSpeech #3: running"]
    assert status.lines(state, True)[-1] == "  · SayGoodByeSpeech #4"
    assert isinstance(rig.requests[0], Say)


def test_what_is_wrong_is_shown():
    rig = one_leaf("<WelcomeSpeech/>")
    board = board_of(rig)
    rig.mission.health.report(GONE, HealthChanged("service", "/a/b", "", False, "gone", "it cannot \x1b[2Jdrive"))
    rig.mission.health.publish(rig.mission.events)
    state = state_of(board)
    assert status.lines(state, False)[2:] == ["service /a/b: gone; it cannot \\x1b[2Jdrive"]
    assert "no message for 7 s" in status.lines(dict(state, silent=7.2), False)[1]
    hung = status.lines(dict(state, alive={"age": 8.5, "hangs": True}), False)[1]
    assert "hangs" in hung and "8.5 s" in hung


def test_a_picture_is_old_after_two_seconds_and_five_lines_of_trouble_are_shown():
    rig = one_leaf("<WelcomeSpeech/>")
    board = board_of(rig)
    for number in range(7):
        rig.mission.events.emit(Noticed("error", "line {}".format(number)))
    state = state_of(board)
    assert [line.split("  ")[1] for line in status.lines(state, False)[-5:]] == [
        "line {}".format(number) for number in range(2, 7)]
    assert len(status.lines(state, False)) == 7 == len(status.lines(dict(state, silent=1.99), False))
    assert len(status.lines(dict(state, silent=2.0), False)) == 8


@pytest.mark.parametrize("width, height", [(20, 5), (40, 12), (80, 24), (100, 30), (200, 130)])
def test_a_window_shows_what_runs_and_what_lies_about_it(width, height):
    rig = Rig(answer=lambda request: None if isinstance(request, GoTo) else NotImplemented)
    board, states = board_of(rig), []

    def visitor(rig):
        states.append(state_of(board))
        visitor_who("yes")(rig)

    rig.run(visitor, is_stopped=lambda: len(states) > 5)
    found = status.in_window(states[-1], False, width, height)
    assert len(found) < height and all(len(line) <= width for line in found)
    tree = "\n".join(found)
    assert "▶ Navigate" in tree and found[0].startswith(time.strftime("%H:"))
    assert height < 12 or "▶ NavigateToLocation" in tree
    assert height < 30 or "✔ DisableAnimateBehavior" in tree and found[0].endswith("  mission lab_tour.xml")
    assert any(line.strip() == "…" for line in found) == (5 < height < 130)


def test_the_story_is_not_cut_in_a_narrow_window():
    state = good()
    state["passes"]["text"] = "visitor 3 · exhibit 2 of 5, Robot arm · driving, 4 s of at most 180 s"
    found = status.in_window(state, False, 30, 20)
    assert " ".join(found[1:4]).startswith(state["passes"]["text"]) and all(len(line) <= 30 for line in found)


def test_names_cannot_steer_the_terminal():
    state = good()
    state["mission"]["nodes"][0]["name"] = "a\x1b]0;owned\x07\nb"
    state["passes"]["text"] = "\x9b31m"
    text = "\n".join(status.lines(state, True))
    assert "\x1b" not in text and "\x9b" not in text and "a\\x1b]0;owned\\x07\\nb" in text


# ----------------------------------------------------------------------------------------------------------- the server


@contextlib.contextmanager
def server(*pieces, pause=0.0, keeps_open=False):
    """Answer each connection with ``pieces`` (bytes, or a function that returns an endless iterator), ``pause`` apart."""
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


def changed(**parts):
    return http(json.dumps(dict(good(), **parts)).encode())


def without(part):
    return http(json.dumps({name: value for name, value in good().items() if name != part}).encode())


def endless(piece):
    return lambda: itertools.repeat(piece)


BAD = {
    "nothing at all": ([b""], "Remote end closed"),
    "no HTTP": ([b"SSH-2.0-OpenSSH_9.2\r\n"], "SSH-2.0"),
    "not even text": ([b"\x00\xff\xfe\r\n\r\n"], ""),
    "an empty body": ([http(b"")], "not JSON"),
    "a web page": ([http(b"<html>")], "not JSON"),
    "a number": ([http(b"3")], "it is not an object"),
    "a list": ([http(b"[]")], "it is not an object"),
    "no parts": ([http(b"{}")], "alive is missing"),
    "a missing part": ([without("statuses")], "statuses is missing"),
    "a missing field": ([changed(passes={"count": 0})], "passes.text is missing"),
    "a wrong type": ([changed(mission={"file": 5, "nodes": []})], "mission.file is not a text"),
    "wrong nodes": ([changed(mission={"file": "", "nodes": [[]]})], "mission.nodes[0] is not an object"),
    "wrong letters": ([changed(statuses={"letters": None})], "statuses.letters is not a text"),
    "wrong health": ([changed(health=[{"kind": "topic"}])], "health[0].name is missing"),
    "a wrong age": ([changed(alive={"age": 1e400, "hangs": True})], "alive.age is not a number"),
    "no UTF-8": ([http(b'{"mission": "\xff"}')], "not JSON"),
    "deep JSON": ([http(b"[" * 100000)], "not JSON"),
    "truncated": ([changed()[:-200]], "not JSON"),
    "less than was said": ([http(b"{}", "200 OK", "Content-Length: 500")], ""),
    "a wrong chunk": ([http(b"zz\r\n{}\r\n", "200 OK", "Transfer-Encoding: chunked").replace(b"1.0", b"1.1", 1)], ""),
    "a redirect": ([http(b"", "302 Found", "Location: http://127.0.0.1:9/")], "HTTP 302 Found"),
    "not found": ([http(b"", "404 Not Found")], "HTTP 404"),
    "an error": ([http(b"", "500 \x1b[31mBad")], "HTTP 500 \\x1b[31mBad"),
    "a long header": ([http(b"", "200 OK", "X: " + "x" * 70000)], "header line"),
    "many headers": ([http(b"", "200 OK", *["X: y"] * 200)], "headers"),
    "an endless body": ([http(b""), endless(b"x" * 100000)], "more than 10000000 bytes"),
}


@pytest.mark.parametrize("pieces, expected", BAD.values(), ids=BAD.keys())
@pytest.mark.parametrize("arguments", [[], ["--watch"]], ids=["once", "watch"])
def test_a_bad_server_is_one_line(capsys, pieces, expected, arguments):
    with server(*pieces) as port:
        assert status.main(["--port", str(port)] + arguments) == 1
    printed = capsys.readouterr()
    assert printed.out == "" and printed.err.count("\n") == 1 and "\x1b" not in printed.err
    assert "http://127.0.0.1:{} ".format(port) in printed.err and "monitorPort" in printed.err
    if not arguments:
        assert expected in printed.err


@pytest.mark.parametrize("pieces", [
    pytest.param([b"HTTP/1.0 200 OK\r\n", endless(b"X")], id="a header that drips"),
    pytest.param([http(b""), endless(b" ")], id="a body that drips"),
    pytest.param([], id="silence"),
    pytest.param([http(b""), endless(b": still here\n")], id="no message")])
@pytest.mark.parametrize("arguments", [[], ["--watch"]], ids=["once", "watch"])
def test_a_server_that_drips_is_not_waited_for(capsys, monkeypatch, pieces, arguments):
    monkeypatch.setattr(status, "LIMIT", 0.5)
    with server(*pieces, pause=0.05, keeps_open=True) as port:
        began = time.monotonic()
        assert status.main(["--port", str(port)] + arguments) == 1
        assert time.monotonic() - began < 5.0
    assert "(no complete answer within 0.5 s)" in capsys.readouterr().err


def event(state):
    return b"data: " + json.dumps(state).encode() + b"\n\n"


STREAM = http(b"", "200 OK", "Content-Type: text/event-stream")


def test_watching_tells_how_the_mission_ended(capsys):
    rig = one_leaf("<WelcomeSpeech/>")
    board = board_of(rig)
    first = event(state_of(board))
    rig.mission.events.emit(RunFinished("all passes are done; last pass: SUCCESS", 0))
    with server(STREAM, first, event({"passes": board.part("passes")})) as port:
        assert status.main(["--watch", "--port", str(port)]) == 0
    printed = capsys.readouterr()
    assert printed.out.endswith("missionStatus: the mission has ended: all passes are done; last pass: SUCCESS\n")
    assert printed.err == ""


@pytest.mark.parametrize("last, expected", [
    (b"", "the connection was closed"), (b"data: {\n\n", "not JSON"),
    (event({"passes": 3}), "passes is not an object")])
def test_watching_tells_why_it_ends_without_the_end_of_the_mission(capsys, last, expected):
    with server(STREAM, event(good()), last) as port:
        assert status.main(["--watch", "--port", str(port)]) == 1
    printed = capsys.readouterr()
    assert "WelcomeSpeech" in printed.out and printed.err.count("\n") == 1
    assert "the connection to http://127.0.0.1:{} is lost".format(port) in printed.err and expected in printed.err


def test_watching_a_controller_that_is_frozen_tells_how_old_the_picture_is(capsys, monkeypatch):
    monkeypatch.setattr(status, "LATE", 0.2)
    monkeypatch.setattr(status, "GIVEN_UP", 2.5)
    with server(STREAM, event(good()), keeps_open=True) as port:
        assert status.main(["--watch", "--port", str(port)]) == 1
    printed = capsys.readouterr()
    assert "no message for 1 s: what is shown may be old" in printed.out and "(no message for 3 s)" in printed.err


def test_what_has_not_changed_is_not_printed_again(capsys):
    state = good()
    with server(STREAM, event(state), event({"alive": {"age": 0.7, "hangs": False}}), event(state)) as port:
        status.main(["--watch", "--port", str(port)])
    assert capsys.readouterr().out.count("WelcomeSpeech") == 1


def test_a_tree_of_many_levels_is_printed(capsys):
    board = board_of(one_leaf("<Inverter>" * 1900 + "<WelcomeSpeech/>" + "</Inverter>" * 1900))
    before = sys.getrecursionlimit()
    with server(http(json.dumps(state_of(board)).encode())) as port:
        sys.setrecursionlimit(300)
        try:
            assert status.main(["--all", "--port", str(port)]) == 0
        finally:
            sys.setrecursionlimit(before)
    assert capsys.readouterr().out.rstrip().endswith("  · WelcomeSpeech #1901")


# ---------------------------------------------------------------------------------------------------------- the command


def command(*arguments, **changes):
    return subprocess.run(
        [sys.executable, os.path.join(SOURCE, "behavior_controller", "missionStatus")] + list(arguments),
        env=dict(os.environ, PYTHONPATH=SOURCE, **changes), stdout=subprocess.PIPE, stderr=subprocess.PIPE, timeout=30)


def test_nobody_there_is_one_line(capsys):
    assert status.main(["--port", "9"]) == 1
    error = capsys.readouterr().err
    assert error.count("\n") == 1 and "http://127.0.0.1:9" in error and "monitorPort" in error


@pytest.mark.parametrize("arguments, code", [
    (["--port", "70000"], 2), (["--port", "0"], 2), (["--port", "x"], 2), (["--port", "-1"], 2), (["--wtach"], 2),
    (["--address", "no such host"], 1), (["--address", ""], 1), (["--address", "\N{SNOWMAN}" * 70], 1),
    (["--address", "127.0.0.1\n"], 1)])
def test_wrong_arguments_are_told_without_a_traceback(arguments, code):
    done = command(*(["--port", "9"] + arguments))
    assert done.returncode == code and b"Traceback" not in done.stderr and done.stderr.count(b"\n") <= 4


def test_a_terminal_without_the_signs_and_a_full_disk():
    with server(http(json.dumps(state_of(board_of(Rig()))).encode())) as port:
        done = command("--all", "--port", str(port), PYTHONIOENCODING="ascii")
        assert done.returncode == 0 and b"\\u25b6" in done.stdout or b"\\xb7" in done.stdout
        with open("/dev/full", "w") as full:
            script = os.path.join(SOURCE, "behavior_controller", "missionStatus")
            done = subprocess.run([sys.executable, script, "--port", str(port)], env=dict(os.environ, PYTHONPATH=SOURCE),
                                  stdout=full, stderr=subprocess.PIPE, universal_newlines=True, timeout=30)
        assert done.returncode == 1 and done.stderr == "missionStatus: cannot print: No space left on device\n"
