"""The node that waits for the end of the mission, writes the report and gives the verdict."""
import contextlib
import dataclasses
import datetime
import math
import os
import shutil
import signal
import time
from typing import Callable, List, Optional, Sequence, Tuple

import rospkg
import rospy

from behavior_controller import exit_codes
from behavior_controller.folders import ros_home
from behavior_controller.errors import BehaviorControllerError, FaultsFound
from behavior_controller.ros.names import enter
from behavior_controller.run.events import LeafFinished, unix_now
from behavior_controller.run.history import Run
from behavior_controller.run.record import files
from behavior_controller.run.record.tail import RunTail
from behavior_controller.output_files import OutputKind
from behavior_controller.ros_arguments import explain_node, is_roslaunch, parent_command
from behavior_controller.text import count, joined
from behavior_controller.simulation.behaviour import NODES
from behavior_controller.simulation.journal import Journal, JournalEntry
from behavior_controller.simulation.rehearsal import arrival_waits
from behavior_controller.simulation.configuration import NONE, REAL, Configuration
from behavior_controller.simulation.rehearsal.play import (
    LoadedMission, PASS_LIMIT, TIMED_OUT, leaves_reached)

from unit_tests import folders
from unit_tests.judge import verdict
from unit_tests.folders import noted
from unit_tests.robot import claims, options
from unit_tests.run.controller import read_errors, read_exit_code
from unit_tests.judge.facts import Facts, Stall, by_record, speeds
from unit_tests.judge.outcome import DOES
from unit_tests.judge.read_back import misprints
from unit_tests.judge.report import Report, title, to_junit
from unit_tests.robot.options import Arguments, Options

OUTPUT = "behaviorControllerTestOutput.dat"
"""The report. Beside it is the same as a page, with the record's story and timeline."""

JUNIT_FILE = "behaviorControllerTest.xml"
"""File with the verdict as JUnit XML, in the folder where ROS keeps test results."""

VERDICT = "verdict"
"""File in the folder of the run with the exit code of the test and the text that is shown at its
end."""

PASSED, _FAILED, NOT_RUN, CUT_OFF = 0, 1, 2, 3
EXIT_CODES = {verdict.PASSED: PASSED, verdict.FAILED: _FAILED, verdict.CUT_OFF: CUT_OFF}
"""Exit codes of a test, and those of its verdicts."""

NOTHING_TESTED = "nothing was tested"
"""The last line of a test that did not start."""

TOO_SHORT = ", so that the test may be cut off"
"""The words about a testTimeout that is too short."""

START_TIME = 10.0
"""Seconds that the nodes of a test may take to start, and the controller to end."""

MISSION_START_LIMIT = 30.0
"""Seconds after ``startupTimeout`` within which a controller must have started its mission."""

LAUNCH_END_LIMIT = 30.0
"""Seconds that roslaunch may take to end the report after it was asked to stop."""

PROGRESS_INTERVAL = 5.0
"""Seconds between two lines of progress."""

DEFAULT_COLUMNS = 120
"""Columns where the output is not a terminal."""

NODE_CHECK_INTERVAL = 1.0
"""Seconds between two checks whether all nodes of the test are its own."""

POLL_INTERVAL = 0.1
"""Seconds between two reads of the controller's record."""

SHORTEST_STALL, WORTH_TELLING = 0.05, 0.25
"""Seconds of a stall that counts, and of one that a report tells."""

KEPT_SHARE = 0.9
"""The share of the speed that was asked for which counts as reached."""

TOO_FAST = "speed {:g} was asked for, and {:.1f} was reached: this machine does not go faster"

STALLED = "this machine stood still {}, for up to {:.1f} s: what was due then may be as much later"


def main() -> int:
    """Return the exit code: 0 passed, 1 failed, 2 the configuration cannot be used, or a living
    node has a name of ours, 3 its time was too short."""
    explain_node(
        "report", "Waits for the end of a test, and writes its report. The launch file of the "
        "test starts it.", "0 passed, 1 failed, 2 nothing was tested, 3 cut off by testTimeout")
    try:
        arguments = options.of_process()
        try:
            own = options.read(arguments)
            claims.check(claims.REPORT, own)
        except BehaviorControllerError as error:
            return finish(NOT_RUN, "{}\n{}".format(error, NOTHING_TESTED), arguments)
        enter(own.words)
        rospy.init_node(claims.REPORT, argv=own.words, disable_rostime=True)
        return _test(own)
    finally:
        _end_launch()


def _test(own: Options) -> int:
    """Wait for the end of the mission, and report."""
    test, world = own.test, own.world
    print("randomSeed {}".format(test.random_seed), flush=True)
    stage: Optional[LoadedMission] = None
    needed = ""
    with contextlib.suppress(BehaviorControllerError):  # the mission has a fault
        stage = LoadedMission(world.settings, world=world)
        needed = time_needed(stage, test)
    warnings = arrival_waits.warnings(arrival_waits.of_mission(world), test.arrival_rate)
    print("".join(line + "\n" for line in [*warnings, needed] if line), end="", flush=True)
    warnings += [needed] * (TOO_SHORT in needed)
    arguments = own.arguments
    began = time.monotonic()
    facts = wait_for_end(own, lambda: claims.replacement(own))
    facts = facts._replace(cut_off=facts.cut_off or claims.replacement(own),
                           real=frozenset(NODES).difference(arguments.simulated))
    if stage is not None:
        facts = facts._replace(mission=stage.mission, expected=leaves_reached(stage, test))
    stalls = [stall.ends - stall.begins for stall in facts.stalls]
    told = count(sum(seconds > WORTH_TELLING for seconds in stalls), "time")
    if max(stalls, default=0.0) > WORTH_TELLING:
        warnings.append(STALLED.format(told, max(stalls)))
    warnings += too_fast(own, facts.run)
    heading = title(facts, test, datetime.datetime.now()) + f"; speed {own.speed:g}" * own.has_clock
    report = Report(facts, heading, warnings)
    robot = world.settings.robot
    junit = _save_junit(to_junit(report.verdict, time.monotonic() - began, heading), robot)
    files = ["report: " + save(report.text(), arguments, folders.REPORT, robot),
             "its folder, with record and journal: " + arguments.folder]
    content = report.page()
    page = content and save(content, arguments, folders.PAGE, robot)
    columns = shutil.get_terminal_size(fallback=(DEFAULT_COLUMNS, 0)).columns
    is_refused = facts.run.state.started is None and facts.exit_code == exit_codes.WRONG_INPUT
    code = EXIT_CODES[report.verdict.word]
    if is_refused and code == _FAILED:
        code = NOT_RUN
    wrong = _read_back(report, arguments.folder, junit)
    shown = "\n".join([report.shown(columns, files, page), *wrong])
    if wrong:
        code = _FAILED
    return finish(code, shown, arguments)


def _read_back(report: Report, folder: str, junit: str) -> List[str]:
    """Return a line for each mistake in the files that were written: the report and its page in
    the folder of the run, and the JUnit file at a path."""
    texts = [noted(folder, name) for name in (OUTPUT, folders.page_beside(OUTPUT))]
    return [f"FAILED: {text}" for text in misprints(
        report.verdict, texts[0], noted(*os.path.split(junit)), texts[1])]


def time_needed(stage: LoadedMission, test: Configuration) -> str:
    """Return in a line how long the visitors of a test take without faults, each as the first one
    in a play, and whether the test has that time; empty: the play does not end."""
    alone = dataclasses.replace(test, failure_rate=0.0, planned_faults=(), mission_runs=1,
                                call_times=REAL if test.takes_time else NONE,
                                test_timeout=PASS_LIMIT)
    seconds = stage.play(alone).seconds
    if seconds >= PASS_LIMIT:
        return ""
    whole = test.mission_runs * seconds + START_TIME
    line = (f"a visitor who {DOES[test.visitor_behaviour]} takes about {seconds:.1f} s: for "
            f"{test.mission_runs} and the start {whole:.0f} s are needed, and testTimeout is "
            f"{test.test_timeout:g} s")
    is_short = whole > test.test_timeout
    return line + f"{TOO_SHORT}; set testTimeout:={math.ceil(whole)}" * is_short


def show_progress(run: Run, journal: Sequence[JournalEntry], seconds: float) -> None:
    """Print a line about a mission that has run for so many seconds."""
    calls = sum(line.call > 0 for line in journal)
    faults = sum(line.fault is not None for line in journal)
    ran = next((line.event.node
                for line in reversed(run.lines) if isinstance(line.event, LeafFinished)), "")
    print(f"{seconds:4.0f} s: pass {len(run.visits) + 1}, {calls} calls, {faults} of them made to "
          f"fail; last: {ran or 'not started'}", flush=True)


def too_fast(own: Options, run: Run) -> List[str]:
    """Return a line if the speed of the simulated time is one that this machine has not reached."""
    reached = speeds(run.lines, own.speed)[0]
    if not own.has_clock or reached >= KEPT_SHARE * own.speed:
        return []
    return [TOO_FAST.format(own.speed, reached)]


def _lasted(run: Run, own: Options, seconds: float) -> float:
    """Return for how long a test has run that took so many seconds of the computer: by the record,
    if its time is faster."""
    first = next((line.time for line in run.lines), run.state.at)
    return max(seconds * min(1.0, own.speed), run.state.at - first)


def wait_for_end(own: Options, disturbance: Callable[[], str] = lambda: "") -> Facts:
    """Wait until the controller has ended, or the time of the test is over.

    Every ``NODE_CHECK_INTERVAL`` seconds ``disturbance`` returns why the test cannot go on, or an
    empty text.
    """
    folder, test = own.arguments.folder, own.test
    run, entries = Run(), Journal(folder)
    journal: List[JournalEntry] = []
    records: List[RunTail] = []  # of the only run, as soon as it is there

    def read() -> None:
        records.extend(map(RunTail, files.runs(folder)[len(records):]))
        for record in records:
            run.extend(record.news())
        journal.extend(entries.news())

    start_limit = MISSION_START_LIMIT + float(own.arguments.startup_timeout)
    began = checked = shown = time.monotonic()
    cut_off, has_timed_out, stalls = "", False, []
    while read_exit_code(folder) is None and not cut_off and not rospy.is_shutdown():
        if time.monotonic() > checked + NODE_CHECK_INTERVAL:
            cut_off, checked = disturbance(), time.monotonic()
        # the master may let a disturbance wait; the rest takes as long as the machine lets it
        polled = time.monotonic()
        read()
        lasted = _lasted(run, own, polled - began)
        if polled > shown + PROGRESS_INTERVAL:
            show_progress(run, journal, lasted)
            shown = polled
        if not cut_off and run.state.started is None and polled - began > start_limit:
            cut_off = "the controller did not start its mission within {:g} s".format(start_limit)
        elif not cut_off and lasted > test.test_timeout:
            cut_off, has_timed_out = TIMED_OUT.format(test.test_timeout) + " (testTimeout)", True
        time.sleep(POLL_INTERVAL)
        stall = time.monotonic() - polled - POLL_INTERVAL
        if stall > SHORTEST_STALL:
            stalls.append(Stall(unix_now() - stall, unix_now()))
    if rospy.is_shutdown():
        cut_off, has_timed_out = "the test was stopped before the mission had ended", False
    read()
    return Facts(run, by_record(journal, run.lines), read_exit_code(folder), test, own.world,
                 cut_off=cut_off, has_timed_out=has_timed_out, errors=read_errors(folder),
                 stalls=tuple(stalls), speed=max(own.speed, speeds(run.lines, own.speed)[1]))


def _of_robot(name: str, robot: str) -> str:
    """Return the name of the file about a robot that is one of several; of the only one
    ``name``."""
    base, ending = os.path.splitext(name)
    return joined("_", base, robot.replace("/", ".")) + ending


def save(text: str, arguments: Arguments, kind: OutputKind, robot: str = "") -> str:
    """Write the report, or its page, to the folder of the run, and a copy as the newest one of the
    robot; return the path of the copy."""
    wanted, name = arguments.values.get("outputFile"), _of_robot(OUTPUT, robot)
    newest = [os.path.join(folders.share(), "data", name), os.path.join(ros_home(), name)]
    paths = [os.path.join(arguments.folder, OUTPUT)] + ([wanted] if wanted else newest)
    if kind is folders.PAGE:
        paths = list(map(folders.page_beside, paths))
    _write(paths[:1], text, kind)
    return _write(paths[1:], text, kind)


def _write(paths: Sequence[str], text: str, kind: OutputKind) -> str:
    """Write a file to the first path where this user may write, and return the path."""
    for path in paths:
        try:
            kind.write(path, text)
            return path
        except FaultsFound as error:
            reason = f"nowhere: {error}"
        except OSError as error:
            reason = f"nowhere: {error.filename}: {error.strerror}"
    return reason


def _save_junit(text: str, robot: str = "") -> str:
    """Write the verdict where catkin collects test results, and return its path."""
    folder = os.path.join(rospkg.get_test_results_dir(), "unit_tests")
    with contextlib.suppress(OSError):
        os.makedirs(folder, exist_ok=True)
    path = os.path.join(folder, _of_robot(JUNIT_FILE, robot))
    reason = _write([path], text, folders.JUNIT).partition("nowhere: ")[2]
    if reason:
        print("no JUnit file: " + reason, flush=True)
    return "" if reason else path


def finish(code: int, text: str, arguments: Arguments) -> int:
    """Write exit code and text for runTest, which shows the text when roslaunch has ended; without
    runTest, show it.

    roslaunch does not pass on an exit code, and prints many lines at its end.
    """
    is_expected = os.path.exists(os.path.join(arguments.folder, VERDICT))
    if arguments.is_launched:
        os.makedirs(arguments.folder, exist_ok=True)
        folders.note(arguments.folder, VERDICT, "{}\n{}\n".format(code, text))
    if not is_expected:
        print("\n" + text, flush=True)
    return code


def expect_verdict(folder: str) -> None:
    """Have the report of the run in that folder leave it to this process to show the verdict."""
    folders.note(folder, VERDICT, "")


def read_verdict(folder: str) -> Optional[Tuple[int, str]]:
    """Return the exit code of the test and the text that is shown at its end; None if there is
    none."""
    code, is_whole, text = folders.noted(folder, VERDICT).partition("\n")
    if not is_whole:
        return None
    return int(code), text.rstrip("\n")


def _end_launch() -> None:
    """Stop roslaunch as Ctrl-C does, which ends this process too: it would report the end of a
    required node as a crash."""
    if is_roslaunch(parent_command()) and not rospy.is_shutdown():
        os.kill(os.getppid(), signal.SIGINT)
        ends = time.monotonic() + LAUNCH_END_LIMIT
        while not rospy.is_shutdown() and time.monotonic() < ends:
            time.sleep(POLL_INTERVAL)
