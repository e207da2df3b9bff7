"""The node that waits for the end of the mission, writes the report and gives the verdict."""
import datetime
import os
import sys
import time
from typing import Any, Callable, Dict, List, Optional, Tuple

import rospkg
import rospy

from behavior_controller.errors import BehaviorControllerError
from behavior_controller.watch.record import FILE_NAME as RECORD

from unit_tests import configuration, parameters
from unit_tests.controller import STARTUP_TIMEOUT, read_exit_code
from unit_tests.exhibits import Knowledge
from unit_tests.facts import Facts
from unit_tests.journal import Journal, Tail
from unit_tests.junit import to_xml
from unit_tests.rehearsal import Rehearsal, rehearse
from unit_tests.report import title, write

OUTPUT = "behaviorControllerTestOutput.dat"
JUNIT = "behaviorControllerTest.xml"
"""File with the verdict as JUnit XML, in the folder where ROS keeps test results."""

VERDICT = "verdict"
"""File in the folder of the run that holds the exit code of the test."""

START_LIMIT = STARTUP_TIMEOUT + 30.0
"""Seconds after which a controller that has not started its mission is given up."""

PROGRESS_INTERVAL = 5.0
"""Seconds between two lines about how far the mission is."""

LOOK_INTERVAL = 0.1
"""Seconds between two looks at what the controller has recorded."""


def main() -> int:
    """Return the exit code: 0 passed, 1 failed, 2 the configuration cannot be used."""
    rospy.init_node("behaviorControllerTest")
    try:
        test = parameters.read_configuration()
        world = parameters.read_world(test)
    except BehaviorControllerError as error:
        print(error)
        return _finish(2)
    print("randomSeed {}".format(test.random_seed), flush=True)
    folder = parameters.folder()
    began = time.monotonic()
    events, exit_code, cut_off = wait_for_end(folder, test.test_timeout, Progress(folder).show)
    facts = Facts(events, Journal(folder).news(), exit_code, test.visitor_behaviour, test.mission_runs,
                  world.knowledge, cut_off, _rehearse(events, test, world.knowledge), parameters.real_nodes())
    heading = title(facts, test, datetime.datetime.now())
    verdict, text = write(facts, heading)
    print("\n" + text, flush=True)
    _save_junit(to_xml(verdict, time.monotonic() - began, heading))
    print("written to {}; the record and the journal are in {}".format(_save(text), folder), flush=True)
    return _finish(0 if verdict.passed else 1)


class Progress:
    """Shows a waiting user every few seconds how far the mission is."""

    def __init__(self, folder: str):
        self._journal = Journal(folder)
        self._calls = self._faults = 0
        self._began = self._told = time.monotonic()

    def show(self, events: List[Dict[str, Any]]) -> None:
        """Print a line, if the last one was a while ago."""
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


def _rehearse(events: List[Dict[str, Any]], test: configuration.Configuration,
              knowledge: Knowledge) -> Optional[Rehearsal]:
    """Return how the mission goes with a robot that never fails; None if it did not start."""
    started = [event for event in events if event["event"] == "RunStarted"]
    if not started:
        return None
    manners = parameters.read_manners(test, knowledge)
    return rehearse(started[-1]["mission"], started[-1]["settings"], manners, knowledge)


def wait_for_end(folder: str, limit: float, show: Callable[[List[Dict[str, Any]]], None] = lambda events: None
                 ) -> Tuple[List[Dict[str, Any]], Optional[int], str]:
    """Return the controller's record, its exit code once it has ended, and else why nobody waits any longer.

    ``show`` is given the record again and again meanwhile.
    """
    record = Tail(os.path.join(folder, RECORD))
    events: List[Dict[str, Any]] = []
    began = time.monotonic()
    cut_off = ""
    while read_exit_code(folder) is None and not cut_off and not rospy.is_shutdown():
        events += record.news()
        show(events)
        waited = time.monotonic() - began
        is_started = any(event["event"] == "RunStarted" for event in events)  # near the beginning, if at all
        if not is_started and waited > START_LIMIT:
            cut_off = "the controller did not start its mission within {:g} s".format(START_LIMIT)
        elif waited > limit:
            cut_off = "the mission did not end within {:g} s (testTimeout)".format(limit)
        else:
            time.sleep(LOOK_INTERVAL)
    if rospy.is_shutdown():
        cut_off = "the test was stopped before the mission had ended"
    return events + record.news(), read_exit_code(folder), cut_off


def _save(text: str) -> str:
    """Write the report where this user may write and return the path."""
    places = [os.path.join(configuration.share(), "data", OUTPUT), os.path.join(parameters.ros_home(), OUTPUT)]
    wanted = rospy.get_param(parameters.NAMESPACE + "/outputFile", "")
    for path in [wanted] if wanted else places:
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


def _finish(code: int) -> int:
    """Leave the exit code where whoever started the launch can find it: roslaunch does not pass it on."""
    if parameters.is_launched():
        os.makedirs(parameters.folder(), exist_ok=True)
        with open(os.path.join(parameters.folder(), VERDICT), "w") as file:
            file.write("{}\n".format(code))
    sys.stdout.flush()
    return code
