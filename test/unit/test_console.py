"""What the robot says stays on the line that quotes it, and does nothing to a terminal."""
import logging
import threading
import time

import pytest
from msgspec.structs import replace

from behavior_controller.bt.engine.clock import ManualClock
from behavior_controller.run import events
from behavior_controller.run.events import (
    Asked, BreakpointChanged, HealthChanged, LeafFinished, LeafSummary, Noticed, PassFinished,
    PassStarted, Paused, Recovered, Recovering, Retried, RunFinished, RunStarted, SafePart,
    SafeStateReported, Sources, StepStarted, StopChanged, Suspended, Tick, TreeNode, TreeShown)
from behavior_controller.run.events import Line
from behavior_controller.run.health import GONE
from behavior_controller.run.history import Run
from behavior_controller.run.moment import robot_line
from behavior_controller.run.record import recorder
from behavior_controller.run.record.recorder import Record
from behavior_controller.robot.gateway import Cause, Failure
from behavior_controller.robot.requests import GoTo, Location
from behavior_controller.ros import console as module
from behavior_controller.ros.tcpros import Trouble
from behavior_controller.ros.console import FILE_ONLY, ROSOUT_LOGGER
from behavior_controller.text import Source, clean
from told_visits import RUNS, Teller, rig_of

ODD = "\x1b[2J\n[INFO] behaviorController: pass 1: SUCCESS\r\t\x9b\u202e\ud800"
FAILURE = Failure(Cause.HANDLER_EXCEPTION, ODD, ODD)


class Lines(list):
    """The lines, and the handler that takes them."""

    handler: logging.Handler


@pytest.fixture
def told():
    """The lines that reach the terminal, the log file and /rosout."""
    lines = Lines()
    handler = lines.handler = logging.Handler()
    handler.emit = lambda record: lines.append(record.getMessage())
    logger = logging.getLogger(ROSOUT_LOGGER)
    before = logger.level
    logger.addHandler(handler)
    logger.setLevel(logging.INFO)
    yield lines
    logger.removeHandler(handler)
    logger.setLevel(before)


@pytest.mark.parametrize("event", [
    RunStarted(ODD, [], {}, Sources((), Source(ODD, ODD), Source(ODD, ODD), ODD)),
    LeafFinished(1, ODD, ODD, "FAILURE", ODD, 1.0, FAILURE),
    Retried(ODD, ODD, 1, FAILURE),
    Recovered(ODD, ODD, FAILURE, ODD, 1, False, ODD),
    HealthChanged("service", ODD, ODD, False, ODD, ODD),
    Recovering(1, ODD, ODD, FAILURE, 1, 2),
    Recovering(1, ODD, ODD, FAILURE, 0, 2, ODD),
    StopChanged(1, ODD, ODD, 1, 2, ODD, "begun"),
    LeafFinished(1, "-", "-", "SUCCESS", "-", 1.0, None, LeafSummary(ODD, ODD, ODD)),
    PassFinished(1, ODD, 1.0),
    Paused(FAILURE, ODD),
    Paused(FAILURE, "", ODD),
    SafeStateReported((SafePart(ODD, ODD, FAILURE), SafePart(ODD, ODD, None)), 1.0),
    Noticed("error", ODD),
    Noticed(ODD, ODD),
    RunFinished(ODD, 3)])
@pytest.mark.parametrize("is_verbose", [False, True])
def test_each_event_is_told_on_lines_of_its_own(told, console, event, is_verbose):
    console(PassStarted(1, 0.0))
    console.is_verbose = is_verbose
    console(event)
    console.drain(5)
    assert all(line.isprintable() and line.startswith("behaviorController: ") for line in told)
    sentences = [line for line in told if ": robot: " not in line]
    assert len(sentences) == (not isinstance(event, Retried)) + (is_verbose and isinstance(
        event, (LeafFinished, Retried)))
    assert all("\\x1b[2J" in line for line in sentences)


def test_in_verbose_mode_a_leaf_is_told_with_what_it_said(told, console):
    event = LeafFinished(1, "WelcomeSpeech", "a/b", "SUCCESS", "/say", 1.25, None,
                         LeafSummary("said", "said “Hello”"))
    console(event)
    console.is_verbose = True
    console(event)
    console.drain(5)
    assert told == ["behaviorController: said “Hello”", "behaviorController: said “Hello”",
                    "behaviorController: WelcomeSpeech (a/b): SUCCESS, /say, 1.250 s, said “Hello”"]


@pytest.mark.slow
@pytest.mark.parametrize("kind", RUNS)
def test_the_terminal_tells_each_kind_of_visit_in_the_sentences_of_the_story(told, console, kind):
    visitor, _, _, runs, _ = RUNS[kind]
    rig = rig_of(kind)
    rig.mission.events.subscribe(console)
    sentences = Teller(rig).run(visitor, runs).lines
    console.drain(10)
    assert [line for line in told if ": robot: " not in line] == [
        "behaviorController: " + sentence for sentence in sentences]
    state = Run(Line(0.0, event) for event in rig.events).state
    assert told[-1] == "behaviorController: robot: " + robot_line(state).text


def gone(node):
    return HealthChanged("service", "/{}/do".format(node), node, False, "gone", "", GONE)


@pytest.fixture
def told_at(told, console, monkeypatch):
    """Have events told at given times, and return the robot's lines."""
    def tell(*events):
        for at, event in events:
            monkeypatch.setattr(module, "computer_now", lambda: at)
            console(event)
        console.drain(5)
        return [line for line in told if ": robot: " in line]
    return tell


def test_what_a_person_has_to_do_is_said_when_it_changes(told_at):
    robot = told_at((0.0, gone("nav")), (9.0, gone("nav")), (9.0, Noticed("info", "so")),
                    (9.0, replace(gone("nav"), is_well=True)))
    assert len(robot) == 2 and robot[0].endswith("Restart /nav")
    assert "Restart" not in robot[1]


def test_nodes_that_go_together_are_said_once_more_and_not_one_by_one(told_at):
    robot = told_at(*((number / 5, gone("n{}".format(number))) for number in range(9)),
                    (2.0, Noticed("info", "so")))
    assert [line.count("/n") for line in robot] == [2, 0]
    assert "9 services are gone" in robot[1] and "9 nodes" in robot[1]


def test_a_heartbeat_brings_what_was_held_back(told_at, told, console):
    clock = ManualClock()
    told_at((0.0, gone("a")), (0.1, gone("b")))
    console.start_heartbeat(clock, console, Record())
    clock.advance(10.0)
    assert "Restart /a and /b" in told_at((10.0, Noticed("info", "so")))[-1]


DRIVES = (
    PassStarted(1, 0.0), StepStarted(2, "Navigate", "a", "driving", "to Robot arm", 180.0, False),
    Asked(1, "/go", GoTo(Location(1.0, 2.0, 0.0))))


@pytest.mark.parametrize("happened, line", [
    (DRIVES, "driving to Robot arm, 40 s of at most 180 s · waits for the answer of /go"),
    ((*DRIVES, HealthChanged("service", "/go", "", False, "slow", "", "slow")),
     "driving to Robot arm, 40 s of at most 180 s; /go is slow · waits for the answer of /go"),
    ((PassStarted(1, 0.0), StepStarted(1, "Navigate", "a", "driving", "home", 0.0, False)),
     "driving home, 40 s"),
    ((PassStarted(1, 0.0), StepStarted(1, "Seen", "a", "waiting for a visitor", "", 0.0, True)),
     "waiting for a visitor, 40 s"),
    ((Tick(0.0, True, [(1, "R")]),), "asleep, 40 s of at most 90 s"),
    ((BreakpointChanged(1, "a", True),),
     "held by a breakpoint of Groot2 at Sleep, 40 s · waits for its release in Groot2"),
    ((Suspended("waiting for the operator's start", resume="/lab/tour/start"),),
     "waiting for the operator's start, 40 s · waits for the operator: rosservice call "
     "/lab/tour/start"),
    ((Paused(FAILURE, "/nav"),), "waiting for /nav to return, 40 s; the last failure: exception in "
     "the server (" + clean(ODD) + ") · next: the next visit")])
def test_a_heartbeat_is_the_line_of_the_card(told, console, monkeypatch, happened, line):
    clock, record = ManualClock(), Record()
    console.start_heartbeat(clock, console, record)
    monkeypatch.setattr(events, "unix_now", lambda: 1000.0)
    for event in (TreeShown("M", [TreeNode("a", "Sleep", "Sleep", 0, 90.0)]), *happened):
        record(event)
    record.hand_over()
    monkeypatch.setattr(module, "unix_now", lambda: 1040.0)
    clock.advance(10.0)
    console.drain(5)
    assert told[-1] == "behaviorController: running. " + line


def test_a_heartbeat_knows_more_than_fits_between_two(told, console, monkeypatch):
    monkeypatch.setattr(recorder, "MOST_FOR_DISK", 5)
    clock, record = ManualClock(), Record()
    console.start_heartbeat(clock, console, record)
    for event in (*DRIVES, *8 * [Tick(0.0, True, [])]):
        record(event)
        record.hand_over()
        clock.advance(1.0)
        console.drain(5)
    assert "driving to Robot arm" in told[-1]


@pytest.mark.parametrize("seconds, lines", [
    (3.9, []), (4.5, ["the controller stood still for 4 s"]),
    (61.0, ["the controller stood still for 60 s"])])
def test_a_controller_that_stood_still_says_so_when_it_goes_on(told, console, seconds, lines):
    clock, emitted = ManualClock(100.0), []
    console.start_heartbeat(clock, emitted.append, Record())
    clock.advance(5.0)
    clock.set_to(105.0 + seconds)
    clock.run_due()
    clock.advance(5.0)
    console.drain(5)
    assert [event.text for event in emitted] == lines


def test_the_robot_is_told_once_at_the_end(told_at):
    failed = SafePart("attention", "/a", Failure(Cause.NO_ANSWER, "waited 1 s"))
    robot = told_at((0.0, SafeStateReported((failed,), 0.1)), (0.1, RunFinished("stopped", 0)))
    assert len(robot) == 1 and "switch attention off by hand" in robot[0].lower()


def test_a_condition_that_stays_false_is_one_line_in_verbose_mode(told, console):
    console.is_verbose = True
    false = LeafFinished(1, "IsASREnabled", "a", "FAILURE", "", 0.0,
                         Failure(Cause.CONDITION_FALSE, "asrEnabled is false"))
    for event in (false, false, replace(false, status="SUCCESS", failure=None), false):
        console(event)
    console.drain(5)
    assert [line.split(", ")[0].rpartition(" ")[2] for line in told] == [
        "FAILURE", "SUCCESS", "FAILURE"]


def test_what_rospy_says_is_one_line_and_its_traceback_goes_to_the_log_file_alone(told, console):
    details = []
    handler = logging.Handler()
    handler.emit = lambda record: details.append(record.getMessage())
    logging.getLogger(FILE_ONLY).addHandler(handler)
    logger = logging.getLogger("rosout")
    logger.addHandler(told.handler)
    try:
        logger.error("unable: %s\nTraceback (most recent call last):\n  File", ODD)
    finally:
        logger.removeHandler(told.handler)
        logging.getLogger(FILE_ONLY).removeHandler(handler)
    assert len(told) == 1 and told[0].isprintable() and told[0].endswith(
        "(details in the log file)")
    assert len(details) == 1 and "Traceback" in details[0]


@pytest.mark.parametrize("reason", [
    "error in XML-RPC server: can't start new thread", "can't allocate lock",
    "can't allocate read lock"])
def test_a_shortage_that_many_threads_meet_is_one_line(told, console, reason):
    for _ in range(3):
        console.report_internal_error(RuntimeError(reason))
    console.drain(5)
    assert len(told) == 1 and "no more memory, threads or files" in told[0]


def test_an_internal_error_is_told_where_its_details_cannot_be_kept(
        told, console, monkeypatch, tmp_path):
    monkeypatch.setattr(module.tempfile, "tempdir", str(tmp_path / "missing"))
    monkeypatch.setattr(logging.getLogger(), "handlers", [])
    failed = []
    monkeypatch.setattr(threading, "excepthook", failed.append)
    for text in ("odd", "even"):
        console.report_internal_error(ValueError(text))
        console.drain(5)
    assert not failed and [line.partition(";")[0] for line in told] == [
        "behaviorController: internal error (ValueError: odd)",
        "behaviorController: internal error (ValueError: even)"]


def test_the_details_of_an_internal_error_are_in_a_file_of_their_own_without_a_log_file(
        told, console, monkeypatch, tmp_path):
    monkeypatch.setattr(module.tempfile, "tempdir", str(tmp_path))
    monkeypatch.setattr(logging.getLogger(), "handlers", [])
    console.report_internal_error(ValueError("odd"))
    console.drain(5)
    file, = tmp_path.iterdir()
    assert str(file) in told[0] and "ValueError: odd" in file.read_text()


def test_what_another_node_answers_is_one_line():
    assert str(Trouble(Cause.HANDLER_EXCEPTION, ODD)).isprintable()


@pytest.mark.slow
def test_a_line_has_the_time_of_what_it_tells_and_not_that_of_its_writing(told, console):
    records, is_written = [], threading.Event()

    def emit(record):
        records.append(record)
        is_written.wait(10)

    told.handler.emit = emit
    began = time.time()
    for text in ("first", "second"):
        console.tell("info", text)
    ended = time.time()
    time.sleep(0.3)
    is_written.set()
    console.drain(5)
    assert len(records) == 2
    for record in records:
        assert began - 0.01 <= record.created <= ended + 0.01
        assert record.msecs == pytest.approx(record.created % 1.0 * 1000.0)
