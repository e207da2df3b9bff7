"""Runs the whole test as a user does, each time with its own master."""
import glob
import os
import subprocess
import sys
import tempfile
import unittest
from concurrent.futures import ThreadPoolExecutor
from typing import List, NamedTuple
from xml.etree import ElementTree

from behavior_controller.robot.gateway import Cause
from behavior_controller.run.events import LeafFinished, Recovered
from behavior_controller.run.history import Run
from behavior_controller.run.record.reader import read_record
from unit_tests.judge.verdict import QUESTIONS

from launched import USUAL

HERE = os.path.dirname(os.path.realpath(__file__))
sys.path.append(os.path.join(HERE, "../../../test/rostest"))
from free_ports import free_port  # noqa: E402

LIMIT = 120.0  # seconds for one test
PASSED, FAILED, NOT_RUN = 0, 1, 2
CLEAN = ("scenarioSpecification:=lab_tour", "failureRate:=0")


class Result(NamedTuple):
    """The results for a user: exit code, output, the lines of the report, the JUnit file, and the
    run on record."""

    code: int
    printed: str
    report: List[str]  # empty: it was not written
    junit: ElementTree.Element
    run: Run


class WholeTest(unittest.TestCase):
    """A test case whose cases run the whole test."""

    def assert_passed(self, result, outcome):
        """Expect one pass of that outcome, no objection, and every leaf that this visitor should
        bring about."""
        self.assertEqual(result.code, 0, "\n".join(result.report))
        self.assertEqual([visit.outcome for visit in result.run.visits], [outcome])
        self.assertEqual((result.junit.get("tests"), result.junit.get("failures")),
                         (str(len(QUESTIONS)), "0"))
        wanted = next(line.split() for line in result.report
                      if "that this visitor should bring about" in line)
        self.assertEqual(wanted[0], wanted[2], "of the leaves that should be reached")


def run_test(*arguments, **environment):
    """Run ``runTest`` with these arguments and, unless they say otherwise, with a high rate of
    messages, calls that take no time, and without a viewer."""
    names = {argument.partition(":=")[0] for argument in arguments}
    arguments += tuple(usual for usual in USUAL if usual.partition(":=")[0] not in names)
    with tempfile.TemporaryDirectory() as folder:
        report = os.path.join(folder, "report.dat")
        environment = {**os.environ, "ROS_MASTER_URI": "http://localhost:{}".format(free_port()),
                       "ROS_HOME": folder, "ROS_TEST_RESULTS_DIR": folder, **environment}
        for name in ("ROS_LOG_DIR", "ROS_NAMESPACE"):
            environment.pop(name, None)
        done = subprocess.run(
            ("rosrun", "unit_tests", "runTest", "outputFile:=" + report) + arguments,
            env=environment, timeout=LIMIT, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
            universal_newlines=True)
        return Result(
            done.returncode, done.stdout, _lines(report),
            _junit(os.path.join(folder, "unit_tests", "behaviorControllerTest.xml")),
            _run(os.path.join(folder, "log", "behaviorControllerTest_*", "*", "mission.jsonl")))


def run_tests(each, **environment):
    """Run ``runTest`` with each of these arguments, two at a time, as most of them wait for a
    visitor; yield the arguments and the result of each."""
    with ThreadPoolExecutor(2) as pool:
        results = pool.map(lambda arguments: run_test(*arguments, **environment), each)
        for arguments, result in zip(each, results):
            print(*arguments)
            yield arguments, result


def _lines(pattern):
    found = glob.glob(pattern)
    if not found:
        return []
    with open(found[0], encoding="utf-8") as file:
        return file.read().splitlines()


def _run(pattern):
    return Run(line for path in glob.glob(pattern)[:1] for line in read_record(path))


def _junit(path):
    return ElementTree.parse(path).getroot() if os.path.exists(path) else ElementTree.Element(
        "none")


def story(run):
    """Return what happened to each leaf in turn: branches that run side by side may do so in any
    order.

    Times differ, and so does the number of reports that a waiting condition is false.
    """
    found = {}
    for event in [
            line.event for line in run.lines if isinstance(line.event, (LeafFinished, Recovered))]:
        if event.failure is None or event.failure.cause is not Cause.CONDITION_FALSE:
            how = event.status if isinstance(event, LeafFinished) else event.outcome
            found.setdefault(event.path, []).append((type(event), how, event.failure and
                                                     event.failure.cause))
    return found
