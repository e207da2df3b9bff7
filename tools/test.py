"""Run the test suites, two side by side: a line for each as it ends, what failed, and the sum as the last line.

``python3 tools/test.py [WORD…]`` in the environment that tools/test.sh makes. Words choose suites by their name.
The output of each suite and its results as JUnit XML are in a separate folder under build/log/tests.
A rostest file that says ``measures time`` in a comment runs alone, one that says ``every Python`` runs on each supported
Python. A virtual machine may lose its processors to others: a suite that fails while that happens, or that
measures time, is run again when all others are over (of pytest only the failed tests), and a line says so; it has
failed if it fails each time.
"""
import concurrent.futures
import fcntl
import glob
import os
import shutil
import signal
import subprocess
import sys
import time
from dataclasses import dataclass, replace
from typing import Dict, Iterator, List, NamedTuple, Optional, Set, Tuple
from xml.etree import ElementTree

REPOSITORY = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
BUILD = os.path.join(REPOSITORY, "build")
LOGS = os.path.join(BUILD, "log", "tests")
OWN = "{}.{}".format(*sys.version_info[:2])
CORE = ["test/unit", "test/conformance"]
TEST_PACKAGE = ["unit_tests/test/unit"]
NETWORK = ["test/soak"]
WORKSPACE = ["test/workspace"]
PYTEST_LIMIT = 1200.0  # seconds
ROSTEST_LIMIT = 600.0
NAMED_AT_MOST = 20
SIDE_BY_SIDE = 2
MEASURES_TIME = "measures time"
EVERY_PYTHON = "every Python"
STEAL = 7  # the place of that time in /proc/stat, proc(5)
TRIES = 3
SOME_FAILED = "exit code 1"  # of pytest: all tests have run
STOLEN = 0.01
"""Share of the processors' time taken by others with which a failure says nothing."""


@dataclass(frozen=True, eq=False)
class Suite:
    """A command that leaves JUnit XML in ``folder``. ``missing`` says why it cannot run here; empty: it can."""

    name: str
    command: List[str]
    folder: str
    limit: float
    environment: Dict[str, str]
    missing: str = ""
    is_alone: bool = False
    only_failed: Tuple[str, ...] = ()  # arguments with which the command runs only the tests that failed

    @property
    def log(self) -> str:
        """The file that takes what the command prints."""
        return os.path.join(self.folder, "output.log")


class Outcome(NamedTuple):
    """How many cases passed, and a line for each of the others."""

    passed: int
    failed: List[str]
    skipped: List[str]
    seconds: float = 0.0
    stolen: float = 0.0  # share of the processors' time that went to other virtual machines
    fault: str = ""  # of the command


# ----------------------------------------------------------------------------------------------------------- the suites


def suites() -> Iterator[Suite]:
    """Yield every suite, the quick ones first."""
    others = sorted({"3.8", "3.11"} - {OWN})
    for name, folders in (("core", CORE), ("test package", TEST_PACKAGE)):
        yield pytest_suite(name, folders, OWN, sys.executable, dict(os.environ))
        for version in others:
            yield other_python(name, folders, version)
    yield types_suite()
    yield pytest_suite("network", NETWORK, OWN, sys.executable, dict(os.environ))
    yield pytest_suite("workspace", WORKSPACE, OWN, sys.executable, dict(os.environ))
    for test in sorted(glob.glob("test/rostest/*.test")) + sorted(glob.glob("unit_tests/test/rostest/*.test")):
        yield rostest_suite(test)
        with open(test, encoding="utf-8") as file:
            is_for_all = EVERY_PYTHON in file.read()
        for version in others if is_for_all else ():
            yield rostest_elsewhere(test, version)


def pytest_suite(name: str, folders: List[str], version: str, python: str, environment: Dict[str, str],
                 missing: str = "") -> Suite:
    """Return the suite that runs pytest over ``folders``."""
    results = os.path.join(LOGS, "{}-{}".format(name.replace(" ", "-"), version))
    command = [python, "-m", "pytest", "-q", "-rfE", "--junit-xml", os.path.join(results, "pytest.xml"),
               "-o", "cache_dir=" + results + "-cache"] + folders
    return Suite("{}, Python {}".format(name, version), command, results, PYTEST_LIMIT, environment, missing,
                 only_failed=("--last-failed",))


def types_suite() -> Suite:
    """Return the suite that checks the types, as mypy.ini says."""
    results = os.path.join(LOGS, "types")
    command = [sys.executable, "-m", "mypy", "--junit-xml", os.path.join(results, "mypy.xml")]
    return Suite("types", command, results, PYTEST_LIMIT, dict(os.environ))


def other_python(name: str, folders: List[str], version: str) -> Suite:
    """Return the suite for an interpreter that is not the workspace's: without ROS."""
    python = os.path.join(BUILD, "venv-" + version, "bin", "python")
    environment = {key: value for key, value in os.environ.items() if key not in ("PYTHONPATH", "ROS_PACKAGE_PATH")}
    missing = "" if os.path.exists(python) else "python{} is not installed".format(version)
    return pytest_suite(name, folders, version, python, environment, missing)


def rostest_suite(test: str) -> Suite:
    """Return the suite of one rostest file; it gets its own master and ROS_HOME."""
    package = "unit_tests" if test.startswith("unit_tests") else "cssr_system"
    name = os.path.splitext(os.path.basename(test))[0]
    results = os.path.join(LOGS, "rostest-{}-{}".format(package, name))
    command = ["rostest", "--results-base-dir", results, "--results-filename", name + ".xml", os.path.abspath(test)]
    with open(test, encoding="utf-8") as file:
        is_alone = MEASURES_TIME in file.read()
    return Suite("rostest {} {}".format(package, name), command, results, ROSTEST_LIMIT,
                 dict(os.environ, ROS_HOME=os.path.join(results, "ros")), is_alone=is_alone)


def rostest_elsewhere(test: str, version: str) -> Suite:
    """Return the suite of a rostest file whose nodes run on another interpreter than the workspace's."""
    suite = rostest_suite(test)
    python = os.path.join(BUILD, "venv-" + version, "bin")
    modules = os.path.join(BUILD, "ros_modules")
    environment = dict(suite.environment, PATH=os.pathsep.join((python, os.environ["PATH"])),
                       PYTHONPATH=os.pathsep.join((os.environ["PYTHONPATH"], modules)))
    missing = "" if os.path.exists(python) and os.listdir(modules) else "there is no ROS for python{}".format(version)
    results = suite.folder + "-" + version
    environment["ROS_HOME"] = os.path.join(results, "ros")
    command = [results if word == suite.folder else word for word in suite.command]
    return replace(suite, name="{}, Python {}".format(suite.name, version), command=command, folder=results,
                   environment=environment, missing=missing)


# -------------------------------------------------------------------------------------------------------------- running


_running: Set["subprocess.Popen[bytes]"] = set()


def main(words: List[str]) -> int:
    """Run the suites, print the sum, and return the exit code."""
    os.chdir(REPOSITORY)
    os.environ["BEHAVIOR_CONTROLLER_CHECK_THREADS"] = "1"  # see bt/ownership.py; nodes inherit it
    os.makedirs(os.path.dirname(LOGS), exist_ok=True)
    lock = open(LOGS + ".lock", "w")
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        sys.exit("another run of the tests is writing its results to {}: wait for its end".format(os.path.relpath(LOGS)))
    shutil.rmtree(LOGS, ignore_errors=True)
    os.makedirs(LOGS)
    started = time.monotonic()
    chosen = [suite for suite in suites() if not words or any(word in suite.name for word in words)]
    ended = run_all([suite for suite in chosen if not suite.is_alone], SIDE_BY_SIDE)
    ended.update(run_all([suite for suite in chosen if suite.is_alone], 1))
    for _ in range(TRIES - 1):
        for suite in [each for each in ended if is_doubtful(each, ended[each])]:
            ended[suite] = run_again(suite, ended[suite])
    outcomes = list(ended.values())
    failed = sum(len(outcome.failed) for outcome in outcomes)
    passed = sum(outcome.passed for outcome in outcomes)
    for reason in sorted({reason for outcome in outcomes for reason in outcome.skipped}):
        print("skipped: {}".format(reason))
    skipped = sum(len(outcome.skipped) for outcome in outcomes)
    print("{} passed, {} failed, {} skipped in {:.0f} s".format(passed, failed, skipped, time.monotonic() - started))
    return 0 if passed and not failed else 1


def run_all(chosen: List[Suite], side_by_side: int) -> Dict[Suite, Outcome]:
    """Run suites, so many at a time, and print each as it ends."""
    outcomes: Dict[Suite, Outcome] = {}
    with concurrent.futures.ThreadPoolExecutor(side_by_side) as pool:
        waiting = {pool.submit(run, suite): suite for suite in chosen}
        try:
            for done in concurrent.futures.as_completed(waiting):
                outcomes[waiting[done]] = done.result()
                show(waiting[done], done.result())
        except KeyboardInterrupt:
            for future in waiting:
                future.cancel()
            for process in list(_running):
                stop(process)
            raise
    return outcomes


def run(suite: Suite) -> Outcome:
    """Run one suite and return its outcome."""
    if suite.missing:
        return Outcome(0, [], ["{}: {}".format(suite.name, suite.missing)])
    shutil.rmtree(suite.folder, ignore_errors=True)
    os.makedirs(suite.folder)
    started, before = time.monotonic(), processor_times()
    with open(suite.log, "w") as log:
        fault = execute(suite, log)
    spent = [after - earlier for after, earlier in zip(processor_times(), before)]
    return read_results(suite.folder, fault)._replace(
        seconds=time.monotonic() - started, stolen=spent[STEAL] / max(1, sum(spent)), fault=fault)


def run_again(suite: Suite, before: Outcome) -> Outcome:
    """Run a suite anew, or only its failed tests if all have run, and return the outcome of the whole."""
    is_part = bool(suite.only_failed) and before.fault == SOME_FAILED
    outcome = run(replace(suite, command=suite.command + list(suite.only_failed)) if is_part else suite)
    show(suite, outcome)
    if is_part:
        return outcome._replace(passed=before.passed + outcome.passed, skipped=before.skipped)
    return outcome


def processor_times() -> List[int]:
    """Return what the processors have done so far: user, nice, system, idle, iowait, irq, softirq, steal (proc(5))."""
    with open("/proc/stat") as file:
        return [int(word) for word in file.readline().split()[1:STEAL + 2]]


def is_doubtful(suite: Suite, outcome: Outcome) -> bool:
    """Whether the failures may be the machine's."""
    return bool(outcome.failed) and (suite.is_alone or outcome.stolen > STOLEN)


def show(suite: Suite, outcome: Outcome) -> None:
    """Print the line of a suite that has ended, and what failed."""
    if suite.missing:
        print("{:<44} skipped: {}".format(suite.name, suite.missing), flush=True)
        return
    print("{:<44} {:5} passed {:3} failed {:3} skipped {:5.0f} s".format(
        suite.name, outcome.passed, len(outcome.failed), len(outcome.skipped), outcome.seconds), flush=True)
    if is_doubtful(suite, outcome):
        print("    {:.0f} % of the processors' time went to other machines{}: it counts if it fails {} times".format(
            100 * outcome.stolen, ", and it measures time" if suite.is_alone else "", TRIES), flush=True)
    show_failures(suite, outcome)


def execute(suite: Suite, log) -> str:
    """Run the command to its end or its limit, and return what went wrong; empty: nothing."""
    process = subprocess.Popen(suite.command, stdin=subprocess.DEVNULL, stdout=log, stderr=subprocess.STDOUT,
                               env=suite.environment, start_new_session=True)
    _running.add(process)
    try:
        code = process.wait(suite.limit)
    except subprocess.TimeoutExpired:
        stop(process)
        return "not done after {:.0f} s".format(suite.limit)
    finally:
        _running.discard(process)
    return "exit code {}".format(code) if code else ""


def stop(process: subprocess.Popen) -> None:
    """End a suite: by SIGINT, so that roslaunch can take its nodes along, and after 20 s by force."""
    os.killpg(process.pid, signal.SIGINT)
    try:
        process.wait(20.0)
    except subprocess.TimeoutExpired:
        os.killpg(process.pid, signal.SIGKILL)
        process.wait()


# -------------------------------------------------------------------------------------------------------------- results


def read_results(folder: str, fault: str) -> Outcome:
    """Return the outcome of a suite. One that went wrong without a failed case counts as one failure.

    rostest writes rosunit-*.xml for the cases of each test node, and rostest-*.xml in which a node is one case: that
    one matters only if it is all there is, or if a node failed as a whole.
    """
    outcome = judge(cases(folder, "rosunit-*.xml") or cases(folder, "*.xml"))
    if outcome.failed:
        return outcome
    if fault:
        return outcome._replace(failed=judge(cases(folder, "*.xml")).failed or [fault])
    return outcome if outcome.passed or outcome.skipped else outcome._replace(failed=["no test was found"])


def cases(folder: str, pattern: str) -> List[ElementTree.Element]:
    """Return the test cases in the JUnit files of that name; a file that cannot be read has none."""
    found: List[ElementTree.Element] = []
    for path in sorted(glob.glob(os.path.join(folder, "**", pattern), recursive=True)):
        try:
            found.extend(ElementTree.parse(path).iter("testcase"))
        except ElementTree.ParseError:
            continue  # the suite was ended while it wrote
    return found


def judge(found: List[ElementTree.Element]) -> Outcome:
    """Return how many of the cases passed, and the others."""
    outcome = Outcome(0, [], [])
    for case in found:
        complaint = next((child for child in case if child.tag in ("failure", "error")), None)
        if complaint is not None:
            outcome.failed.append("{}.{}: {}".format(case.get("classname"), case.get("name"), first_line(complaint)))
        elif case.find("skipped") is not None:
            outcome.skipped.append(skip_reason(case))
        else:
            outcome = outcome._replace(passed=outcome.passed + 1)
    return outcome


def first_line(complaint: ElementTree.Element) -> str:
    """Return the first line of a failure's message, or of its text."""
    lines = (complaint.get("message") or complaint.text or "").strip().splitlines()
    return lines[0][:200] if lines else complaint.tag


def skip_reason(case: ElementTree.Element) -> str:
    """Return ``test: reason`` of a skipped case; pytest writes a skipped module as a tuple's text."""
    skipped: Optional[ElementTree.Element] = case.find("skipped")
    assert skipped is not None
    text = skipped.text or "" if skipped.get("message") == "collection skipped" else skipped.get("message") or ""
    return "{}: {}".format(case.get("name"), text.split("Skipped: ")[-1].rstrip("')"))


def show_failures(suite: Suite, outcome: Outcome) -> None:
    """Print what failed, the end of the output, and where the whole of it is."""
    for line in outcome.failed[:NAMED_AT_MOST]:
        print("    FAILED {}".format(line))
    if len(outcome.failed) > NAMED_AT_MOST:
        print("    … and {} more".format(len(outcome.failed) - NAMED_AT_MOST))
    if outcome.failed:
        with open(suite.log, errors="replace") as log:
                print("".join("    | " + line for line in log.readlines()[-25:]), end="")
        print("    the whole output: {}".format(os.path.relpath(suite.log)), flush=True)


if __name__ == "__main__":
    try:
        sys.exit(main(sys.argv[1:]))
    except KeyboardInterrupt:
        sys.exit("interrupted")
