"""The node that waits for the end of the mission, writes the report and gives the verdict."""
import datetime
import os
import shutil
import signal
import time
from typing import Any, Callable, Dict, List, Optional, Sequence, Tuple

import rosgraph
import rospkg
import rospy

from behavior_controller.errors import BehaviorControllerError
from behavior_controller.watch.record import FILE_NAME as RECORD

from unit_tests import arguments, configuration, parameters, waits
from unit_tests.controller import read_exit_code
from unit_tests.facts import Facts
from unit_tests.journal import Journal, Tail
from unit_tests.junit import to_xml
from unit_tests.rehearsal import Rehearsal, rehearse
from unit_tests.report import title, write
from unit_tests.robot import World
from unit_tests.stage import TIMED_OUT

OUTPUT = "behaviorControllerTestOutput.dat"
JUNIT = "behaviorControllerTest.xml"
"""File with the verdict as JUnit XML, in the folder where ROS keeps test results."""

VERDICT = "verdict"
"""File in the folder of the run with the exit code of the test and the text that is shown at its end."""

PASSED, FAILED, NOT_RUN = 0, 1, 2
"""Exit codes of a test."""

NOTHING_TESTED = "nothing was tested"
"""The last line of a test that did not start."""

START_LIMIT = 30.0
"""Seconds after ``startupTimeout`` within which a controller must have started its mission."""

END_LIMIT = 30.0
"""Seconds that roslaunch may take to end the report after it was asked to stop."""

PROGRESS_INTERVAL = 5.0
"""Seconds between two lines of progress."""

WIDTH = 120
"""Columns where the output is not a terminal."""

LOOK_INTERVAL = 0.1
"""Seconds between two reads of the controller's record."""


def main() -> int:
    """Return the exit code: 0 passed, 1 failed, 2 the configuration cannot be used."""
    rospy.init_node("behaviorControllerTest", argv=parameters.for_rospy())
    try:
        return _test()
    finally:
        _end_launch()


def _test() -> int:
    """Wait for the end of the mission, and report."""
    try:
        test = parameters.read_configuration()
        world = parameters.read_world(test)
    except BehaviorControllerError as error:
        _await_nodes()
        return finish(NOT_RUN, "{}\n{}".format(error, NOTHING_TESTED))
    print("randomSeed {}".format(test.random_seed), flush=True)
    warnings = waits.warnings(waits.of_mission(world), test.arrival_rate)
    print("".join(line + "\n" for line in warnings), end="", flush=True)
    folder = parameters.folder()
    began = time.monotonic()
    events, exit_code, cut_off = wait_for_end(folder, test.test_timeout, Progress(folder).show)
    facts = Facts(events, Journal(folder).news(), exit_code, test.visitor_behaviour, test.mission_runs,
                  world.knowledge, cut_off, _rehearse(events, world), parameters.real_nodes(),
                  world.settings.interface, frozenset(test.absent_services))
    heading = title(facts, test, datetime.datetime.now())
    report = write(facts, heading, warnings)
    _save_junit(to_xml(report.verdict, time.monotonic() - began, heading))
    files = ["report: " + save(report.text(), folder), "its folder, with record and journal: " + folder]
    columns = shutil.get_terminal_size(fallback=(WIDTH, 0)).columns
    return finish(PASSED if report.verdict.passed else FAILED, report.shown(columns, files))


def _await_nodes() -> None:
    """Wait for the nodes of the launch: one that is still starting when the launch ends would print a traceback."""
    master = rosgraph.Master(rospy.get_name())
    folder = parameters.folder()
    starts = [lambda node=node: _is_registered(master, node)
              for node in parameters.present_nodes() - parameters.real_nodes()]
    starts.append(lambda: read_exit_code(folder) is not None or os.path.exists(os.path.join(folder, RECORD)))
    ends = time.monotonic() + START_LIMIT
    for has_started in starts:
        while not has_started() and time.monotonic() < ends and not rospy.is_shutdown():
            time.sleep(LOOK_INTERVAL)


def _is_registered(master: rosgraph.Master, node: str) -> bool:
    try:
        return bool(master.lookupNode("/" + node))
    except rosgraph.MasterException:
        return False


class Progress:
    """Shows the progress of the mission every few seconds."""

    def __init__(self, folder: str):
        self._journal = Journal(folder)
        self._calls = self._faults = 0
        self._began = self._told = time.monotonic()

    def show(self, events: List[Dict[str, Any]]) -> None:
        """Print a line of progress, unless the last one is recent."""
        if time.monotonic() - self._told < PROGRESS_INTERVAL:
            return
        self._told = time.monotonic()
        for line in self._journal.news():
            self._calls += line.call > 0
            self._faults += line.fault is not None
        ran = [event["node"] for event in events if event["event"] == "LeafFinished"]
        ended = sum(event["event"] == "PassFinished" for event in events)
        print("{:4.0f} s: pass {}, {} calls, {} of them made to fail; last: {}".format(
            self._told - self._began, ended + 1, self._calls, self._faults, ran[-1] if ran else "not started"),
            flush=True)


def _rehearse(events: List[Dict[str, Any]], world: World) -> Optional[Rehearsal]:
    """Return the play of the mission on a robot without faults; None if the mission did not start."""
    started = [event for event in events if event["event"] == "RunStarted"]
    if not started:
        return None
    return rehearse(started[-1]["mission"], started[-1]["settings"], world.visitor.manners, world.knowledge)


def wait_for_end(folder: str, limit: float, show: Callable[[List[Dict[str, Any]]], None] = lambda events: None
                 ) -> Tuple[List[Dict[str, Any]], Optional[int], str]:
    """Return the controller's record, and its exit code or, if it has not ended, why the wait is over.

    ``show`` is called with the record at every read.
    """
    record = Tail(os.path.join(folder, RECORD))
    events: List[Dict[str, Any]] = []
    began = time.monotonic()
    start_limit = START_LIMIT + float(parameters.given().get("startupTimeout", arguments.STARTUP_TIMEOUT))
    cut_off = ""
    while read_exit_code(folder) is None and not cut_off and not rospy.is_shutdown():
        events += record.news()
        show(events)
        waited = time.monotonic() - began
        is_started = any(event["event"] == "RunStarted" for event in events)  # near the beginning, if anywhere
        if not is_started and waited > start_limit:
            cut_off = "the controller did not start its mission within {:g} s".format(start_limit)
        elif waited > limit:
            cut_off = TIMED_OUT.format(limit) + " (testTimeout)"
        else:
            time.sleep(LOOK_INTERVAL)
    if rospy.is_shutdown():
        cut_off = "the test was stopped before the mission had ended"
    return events + record.news(), read_exit_code(folder), cut_off


def save(text: str, folder: str) -> str:
    """Write the report to the folder of the run, and a copy as the newest report; return the path of the copy."""
    newest = [os.path.join(configuration.share(), "data", OUTPUT), os.path.join(parameters.ros_home(), OUTPUT)]
    wanted = parameters.given().get("outputFile")
    _write([os.path.join(folder, OUTPUT)], text)
    return _write([wanted] if wanted else newest, text)


def _write(paths: Sequence[str], text: str) -> str:
    """Write a file to the first folder where this user may write, and return its path."""
    for path in paths:
        try:
            with open(path, "w", encoding="utf-8") as file:
                file.write(text)
            return path
        except OSError as error:
            reason = "nowhere: {}: {}".format(path, error.strerror)
    return reason


def _save_junit(text: str) -> None:
    """Write the verdict where catkin collects test results."""
    folder = os.path.join(rospkg.get_test_results_dir(), "unit_tests")
    try:
        os.makedirs(folder, exist_ok=True)
        with open(os.path.join(folder, JUNIT), "w", encoding="utf-8") as file:
            file.write(text)
    except OSError as error:
        print("no JUnit file: {}: {}".format(folder, error.strerror), flush=True)


def finish(code: int, text: str) -> int:
    """Write exit code and text for runTest, which shows the text when roslaunch has ended; without runTest, show it.

    roslaunch does not pass on an exit code, and prints many lines at its end.
    """
    if parameters.is_launched():
        os.makedirs(parameters.folder(), exist_ok=True)
        with open(os.path.join(parameters.folder(), VERDICT), "w", encoding="utf-8") as file:
            file.write("{}\n{}\n".format(code, text))
    if not arguments.is_by_run_test(arguments.parent_command()):
        print("\n" + text, flush=True)
    return code


def read_verdict(folder: str) -> Optional[Tuple[int, str]]:
    """Return the exit code of the test and the text that is shown at its end; None if there is none."""
    try:
        with open(os.path.join(folder, VERDICT), encoding="utf-8") as file:
            code, text = file.read().split("\n", 1)
    except (OSError, ValueError):
        return None
    return int(code), text.rstrip("\n")


def _end_launch() -> None:
    """Stop roslaunch as Ctrl-C does, which ends this process too: it would report the end of a required node as a crash."""
    if arguments.is_roslaunch(arguments.parent_command()) and not rospy.is_shutdown():
        os.kill(os.getppid(), signal.SIGINT)
        ends = time.monotonic() + END_LIMIT
        while not rospy.is_shutdown() and time.monotonic() < ends:
            time.sleep(LOOK_INTERVAL)
