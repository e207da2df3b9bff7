"""Sinks on real pipes and terminals: nothing waits for one that is blocked, nothing is lost without
a word."""
import fcntl
import logging
import os
import pty
import struct
import sys
import termios
import threading
import time
import unicodedata

import pytest
from rosgraph.roslogging import RosStreamHandler

from behavior_controller.ros.sinks import (
    MOST_IN_ROW, MOST_IN_FLOOD, Detached, FLOOD, ColouredLine, LineStream, Sink, drain, fitted,
    take_over_streams, use_line_handler)
from behavior_controller.text import LONGEST

CTRL_S, CTRL_Q = b"\x13", b"\x11"
F_SETPIPE_SZ = 1031  # fcntl has the name from Python 3.10 on


class Gate:
    """What is written, and a gate in front of it that a test closes."""

    def __init__(self):
        self.open = threading.Event()
        self.reached = threading.Semaphore(0)
        self.written = []

    def write(self, item):
        self.reached.release()
        self.open.wait(10)
        self.written.append(item)


def gated(most):
    """Return a gate, and its sink with one item that waits in ``write``."""
    gate = Gate()
    sink = Sink("test", gate.write, str, most)
    sink.put(0)
    assert gate.reached.acquire(timeout=5)
    return gate, sink


def test_what_does_not_fit_is_counted_and_told_where_it_is_missing():
    gate, sink = gated(most=4)
    for number in range(1, 11):
        sink.put(number)
    gate.open.set()
    sink.drain(5)
    sink.put(11)
    sink.drain(5)
    assert gate.written == [0, 1, 2, 3, 4, "6 lines left out: test did not take them in time", 11]


def test_a_full_sink_takes_items_again_when_half_of_them_are_written():
    written, reached, going_on = [], threading.Semaphore(0), threading.Semaphore(0)

    def write(item):
        reached.release()
        assert going_on.acquire(timeout=10)
        written.append(item)

    def write_one():
        going_on.release()
        assert reached.acquire(timeout=5)

    sink = Sink("test", write, str, 4)
    sink.put(0)
    assert reached.acquire(timeout=5)
    for number in range(1, 6):
        sink.put(number)  # the fifth does not fit
    write_one()
    sink.put(6)  # three are left
    write_one()
    sink.put(7)  # two are left
    for _ in range(10):
        going_on.release()
    sink.drain(10)
    assert written == [0, 1, 2, 3, 4, "2 lines left out: test did not take them in time", 7]


def test_a_sink_that_is_blocked_keeps_nobody_waiting():
    gate, sink = gated(most=4)
    # not even the process at its end
    assert all(thread.daemon for thread in threading.enumerate() if thread.name == "test")
    began = time.monotonic()
    for number in range(1000):
        sink.put(number)
    sink.drain(0.2)
    assert 0.2 <= time.monotonic() - began < 4.0
    gate.open.set()


def test_a_thousand_items_wait_if_nothing_else_is_said():
    gate, written = Gate(), []
    sink = Sink("test", gate.write, written.append)
    sink.put(0)
    assert gate.reached.acquire(timeout=5)
    for number in range(1002):
        sink.put(number)
    gate.open.set()
    sink.drain(10)
    assert written == ["2 lines left out: test did not take them in time"]
    assert len(gate.written) == 1002


@pytest.mark.slow
def test_what_is_just_being_written_is_waited_for():
    gate, sink = gated(most=4)
    began = time.monotonic()
    sink.drain(0.2)
    assert time.monotonic() - began >= 0.2
    threading.Timer(0.2, gate.open.set).start()
    sink.drain(30)
    assert gate.written == [0] and time.monotonic() - began < 5.0


@pytest.mark.slow
def test_a_blocked_sink_takes_no_time_from_the_others():
    blocked, other = gated(most=4)[1], gated(most=4)
    other[0].open.set()
    other[1].put(1)
    began = time.monotonic()
    drain([blocked, other[1]], 0.3)
    assert other[0].written == [0, 1] and time.monotonic() - began < 5.0


@pytest.mark.slow
def test_a_sink_with_a_rest_writes_a_few_items_and_rests():
    times = []
    sink = Sink("test", lambda item: times.append(time.monotonic()), str, rest=0.2)
    sink.put("-")
    sink.drain(5)  # it does not rest while it is drained, but later
    assert len(times) == 1
    del times[:]
    for number in range(2 * MOST_IN_ROW + 1):
        sink.put(number)
    ends = time.monotonic() + 10
    while len(times) < 2 * MOST_IN_ROW + 1 and time.monotonic() < ends:
        time.sleep(0.01)
    gaps = [times[MOST_IN_ROW * batch] - times[MOST_IN_ROW * batch - 1] for batch in (1, 2)]
    assert min(gaps) >= 0.15


@pytest.mark.slow
def test_a_sink_with_a_rest_does_not_try_to_keep_up_with_a_flood():
    times = []
    sink = Sink("test", lambda item: times.append(time.monotonic()), str, most=2 * FLOOD, rest=0.5)
    for number in range(FLOOD + MOST_IN_FLOOD):
        sink.put(number)
    ends = time.monotonic() + 10
    while len(times) < MOST_IN_ROW and time.monotonic() < ends:
        time.sleep(0.01)
    assert times[MOST_IN_FLOOD] - times[MOST_IN_FLOOD - 1] >= 0.4
    assert times[MOST_IN_ROW - 1] - times[MOST_IN_FLOOD] < 0.4  # what waits is no flood any more


def test_draining_a_sink_that_rests_writes_all_at_once():
    written = []
    sink = Sink("test", written.append, str, rest=60.0)
    for number in range(5 * MOST_IN_ROW):
        sink.put(number)
    sink.drain(10)
    assert written == list(range(5 * MOST_IN_ROW))


@pytest.fixture
def streams():
    """Standard streams that a test may replace."""
    before = sys.stdout, sys.stderr
    yield
    sys.stdout, sys.stderr = before


KEPT = []  # a thread that still writes must not meet its descriptor's number again in another test


def take_over(out, err):
    sys.stdout, sys.stderr = (os.fdopen(os.dup(end), "w") for end in (out, err))
    KEPT.extend((sys.stdout, sys.stderr))
    return take_over_streams()


def test_all_lines_go_to_standard_output_and_keep_their_order(streams):
    (reader, out), (errors, err) = os.pipe(), os.pipe()
    sink = take_over(out, err)
    for number in range(50):
        print(number, file=sys.stderr if number % 2 else sys.stdout)
    sink.drain(5)
    assert os.read(reader, 65536).split() == [b"%d" % number for number in range(50)]
    os.set_blocking(errors, False)
    with pytest.raises(BlockingIOError):
        os.read(errors, 1)


@pytest.fixture
def rosout():
    """The logger of rospy's lines, with rospy's own handler."""
    logger = logging.getLogger("rosout")
    before, level = list(logger.handlers), logger.level
    logger.handlers[:] = [RosStreamHandler()]
    yield logger
    logger.handlers[:] = before
    logger.setLevel(level)


def logged(rosout):
    """Return what the terminal shows of a warning of 12:00:00.0625 and a line without a colour."""
    reader, out = os.pipe()
    sink = take_over(out, os.open(os.devnull, os.O_WRONLY))
    use_line_handler()
    for level, text in ((logging.WARNING, "no %s"), (logging.INFO, "%s found")):
        record = rosout.makeRecord("rosout", level, __file__, 0, text, ("node",), None)
        record.created = time.mktime((2026, 1, 2, 12, 0, 0, 0, 0, -1)) + 0.0625
        rosout.handle(record)
    sink.drain(5)
    return os.read(reader, 65536).decode().splitlines()


def test_a_line_begins_with_the_time_of_day_to_the_millisecond(streams, rosout, monkeypatch):
    monkeypatch.delenv("ROSCONSOLE_FORMAT", raising=False)
    assert logged(rosout) == ["[WARN] [12:00:00.062]: no node", "[INFO] [12:00:00.062]: node found"]
    use_line_handler()
    assert len(rosout.handlers) == 1


def test_a_format_of_the_user_is_kept(streams, rosout, monkeypatch):
    monkeypatch.setenv("ROSCONSOLE_FORMAT", "${severity} ${message}")
    assert logged(rosout) == ["WARN no node", "INFO node found"]


def test_a_terminal_held_by_ctrl_s_shows_all_when_it_is_let_go(streams):
    operator, terminal = pty.openpty()
    sink = take_over(terminal, terminal)
    os.write(operator, CTRL_S)
    for number in range(10):
        print("line", number)
    sink.drain(0.1)
    os.write(operator, CTRL_Q)
    shown = b""
    while shown.count(b"\n") < 10:
        shown += os.read(operator, 65536)
    assert shown.split() == b" ".join(b"line %d" % number for number in range(10)).split()
    assert sys.stdout.isatty()


def all_shown(operator, terminal):
    """Return what was written to a terminal, which may pass it on in pieces."""
    os.write(terminal, b"\0")
    shown = b""
    while not shown.endswith(b"\0"):
        shown += os.read(operator, 65536)
    return shown[:-1].decode()


def wide(terminal, width):
    fcntl.ioctl(terminal, termios.TIOCSWINSZ, struct.pack("HHHH", 24, width, 0, 0))


WORDS = " ".join("word{}".format(number) for number in range(60))


@pytest.mark.parametrize("width", [24, 40, 80, 132])
@pytest.mark.parametrize("text", [WORDS, 300 * "x", "展品 " * 60, "\x1b[33m" + WORDS, "a short one"])
def test_no_line_is_wider_than_the_terminal_and_nothing_of_it_is_lost(streams, width, text):
    operator, terminal = pty.openpty()
    wide(terminal, width)
    sink = take_over(terminal, terminal)
    print(text)
    sink.drain(5)
    shown = all_shown(operator, terminal).replace("\r\n", "\n")
    assert shown.endswith("\x1b[0m\n") == text.startswith("\x1b")
    shown = shown.replace("\x1b[0m", "")
    for line in shown.replace("\x1b[33m", "").split("\n"):
        assert sum(2 if unicodedata.east_asian_width(letter) in "WF" else 1
                   for letter in line) <= width
    assert "".join(shown.split()) == "".join(text.split())


@pytest.mark.parametrize("line, width, expected", [
    ("aaaa bbbb cccc", 10, "aaaa bbbb\n    cccc"), ("aaaa bbb  ", 10, "aaaa bbb  "),
    ("aaaa bb-cc", 9, "aaaa\n    bb-cc"), ("aaaaaa", 5, "aaaaa\n    a"), ("aaaaaa", 4, "aaaaaa"),
    ("aaaaaa", 0, "aaaaaa"), (20 * " ", 10, ""), (12 * "展", 20, 10 * "展" + "\n    " + 2 * "展"),
    (10 * "展", 20, 10 * "展")])
def test_a_line_is_broken_where_the_terminal_ends(line, width, expected):
    assert fitted(line, width) == expected


def test_a_path_that_is_longer_than_the_terminal_is_whole(streams):
    path = "/records/" + 8 * "0123456789" + "/mission.jsonl"
    assert path in fitted("record of this run: {}".format(path), 80)


def test_a_terminal_gets_no_name_of_the_node_but_with_the_heartbeat(streams):
    operator, terminal = pty.openpty()
    sink = take_over(terminal, terminal)
    for text in ("drove home", "running. asleep, 3 s"):
        print("[INFO] [12:00:00]: behaviorController: " + text)
    sink.drain(5)
    assert all_shown(operator, terminal).split("\r\n") == [
        "[INFO] [12:00:00]: drove home",
        "[INFO] [12:00:00]: behaviorController: running. asleep, 3 s", ""]


@pytest.mark.parametrize("value, has_colours", [(None, True), ("", True), ("1", False)])
def test_colours_are_left_out_on_demand(streams, monkeypatch, value, has_colours):
    if value is not None:
        monkeypatch.setenv("NO_COLOR", value)
    terminal = pty.openpty()[1]
    take_over(terminal, terminal)
    assert sys.stdout.isatty() is has_colours


@pytest.mark.parametrize("width", [0, 4])
def test_a_terminal_that_does_not_tell_its_width_or_has_none_gets_whole_lines(streams, width):
    operator, terminal = pty.openpty()
    wide(terminal, width)
    sink = take_over(terminal, terminal)
    print(WORDS)
    sink.drain(5)
    assert all_shown(operator, terminal) == WORDS + "\r\n"


def test_a_pipe_that_another_process_made_non_blocking_loses_nothing(streams):
    reader, writer = os.pipe()
    os.set_blocking(writer, False)
    sink = take_over(writer, writer)
    text = "".join("{:07}\n".format(number) for number in range(900))
    fcntl.fcntl(reader, F_SETPIPE_SZ, 4096)
    sys.stdout.write(text)
    shown = b""
    while len(shown) < len(text):
        shown += os.read(reader, 65536)
    assert shown.decode() == text
    sink.drain(5)


def test_a_stream_without_a_reader_is_no_error(streams):
    reader, writer = os.pipe()
    sink = take_over(writer, writer)
    os.close(reader)
    print("into the void")
    sink.drain(5)


def test_a_line_in_pieces_stays_whole_and_a_foreign_letter_gets_its_code(streams):
    reader, writer = os.pipe()
    with open(os.dup(writer), "w", encoding="ascii") as original:
        sys.stdout = sys.stderr = original
        sink = take_over_streams()
        sys.stdout.write("Grü")
        sys.stdout.write("ße\nand")
        sys.stdout.write(" more\n")
        sink.drain(5)
    assert os.read(reader, 100) == b"Gr\\xfc\\xdfe\nand more\n"


def test_a_line_has_room_for_a_long_text_and_the_message_around_it():
    written = []
    sink = Sink("test", written.append, str)
    with open(os.devnull, "w", encoding="ascii") as original:
        stream = LineStream(sink, original)
        assert stream.fileno() == original.fileno() and not stream.isatty()
        for length in (2 * LONGEST, 2 * LONGEST + 1):
            stream.write(length * "x" + "\n")
        sink.drain(5)
    whole, cut = written
    assert whole == ColouredLine("", 2 * LONGEST * "x")
    assert cut.text.count("x") < 2 * LONGEST and "x … x" in cut.text


def test_what_is_printed_of_outside_text_does_nothing_to_a_terminal(streams):
    reader, writer = os.pipe()
    sink = take_over(writer, writer)
    print("shutdown request: \x1b[2J\x1b]0;title\x07\r\u202e")
    sys.stdout.write("\x1b[33m[WARN] a \x1b[2J\n\x1b[0m")
    print("next")
    sink.drain(5)
    assert os.read(reader, 65536).decode() == (
        "shutdown request: \\x1b[2J\\x1b]0;title\\x07\\r\\u202e\n"
        "\x1b[33m[WARN] a \\x1b[2J\x1b[0m\nnext\n")


def test_a_log_that_hangs_does_not_hold_its_caller(tmp_path):
    fifo = str(tmp_path / "log")
    os.mkfifo(fifo)
    logger = logging.getLogger("test_a_log_that_hangs")
    # opening it waits for a reader
    logger.addHandler(Detached(logging.FileHandler(fifo, delay=True)))
    began = time.monotonic()
    logger.error("not %s", "lost")
    assert time.monotonic() - began < 4.0
    with open(fifo) as reader:
        assert reader.readline() == "not lost\n"


def test_what_a_log_does_not_take_is_counted_in_it():
    gate, handler = Gate(), logging.Handler(logging.INFO)
    handler.emit = gate.write
    detached = Detached(handler)
    assert detached.level == logging.INFO
    record = logging.LogRecord("rosout", logging.INFO, "", 0, "line", (), None)
    detached.emit(record)
    assert gate.reached.acquire(timeout=5)
    for _ in range(1002):
        detached.emit(record)
    gate.open.set()
    detached.sink.drain(10)
    told = [each for each in gate.written if each is not record]
    assert [(each.name, each.levelno, each.getMessage()) for each in told
            ] == [("rosout", logging.WARNING,
                   "behaviorController: 2 lines left out: /rosout did not take them in time")]
