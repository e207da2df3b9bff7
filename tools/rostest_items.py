"""A pytest plugin: a rostest file is a test, run by ``rostest`` with its own master and ROS_HOME.

A comment of the file may say ``measures time`` and ``takes long``: markers ``timing`` and ``long``.
If it says ``every Python`` there is a second test, ``long`` as well, that runs the nodes on the
other supported interpreter, but for the cases that are marked ``on_one_python``.
A test that fails beside others, on a busy computer, is run once more, and named as RERUN.
The output and the results as JUnit XML are in build/log/tests, in a folder with the test's name.
"""
import itertools
import os
import shutil
import signal
import subprocess
import sys
from pathlib import Path
from typing import Iterator, List, NamedTuple
from xml.etree import ElementTree

import pytest

REPOSITORY = Path(__file__).resolve().parent.parent
BUILD = REPOSITORY / "build"
LOGS = BUILD / "log" / "tests"
LIMIT = 600.0  # seconds for a file; rostest has its own for each test node
STOP_LIMIT = 20.0  # seconds that roslaunch has to stop its nodes
MARKS = {"measures time": "timing", "takes long": "long"}
EVERY_PYTHON = "every Python"
OTHER_PYTHON = "3.8" if sys.version_info[:2] != (3, 8) else "3.11"


class Case(NamedTuple):
    """A test case of a test node; ``complaint`` is the first line of its failure."""

    name: str
    complaint: str


class Failed(Exception):
    """A rostest file did not pass; the text says which cases, and where the output is."""


def pytest_ignore_collect(collection_path):
    """Leave the test nodes to the rostest files that start them."""
    is_node = collection_path.parent.name == "rostest" and collection_path.suffix == ".py"
    return True if is_node else None


def pytest_collect_file(file_path, parent):
    """Collect rostest files."""
    return RostestFile.from_parent(parent, path=file_path) if file_path.suffix == ".test" else None


@pytest.hookimpl(trylast=True)
def pytest_collection_modifyitems(config, items):
    """Let each process of pytest-xdist begin with its share of the rostest files, which are slow.

    ``--dist worksteal`` gives each process an equal part of the list.
    """
    processes = getattr(config, "workerinput", {}).get("workercount", 1)
    slow = [item for item in items if isinstance(item, Rostest)]
    quick = iter([item for item in items if not isinstance(item, Rostest)])
    ordered: List[pytest.Item] = []
    for number in range(processes):
        size, own = (len(items) - len(ordered)) // (processes - number), slow[number::processes]
        ordered += own + list(itertools.islice(quick, max(0, size - len(own))))
    items[:] = ordered + list(quick)


class RostestFile(pytest.File):
    """A rostest file: a test, or one for each supported Python."""

    def collect(self):
        """Yield the tests, marked as the comment of the file says."""
        text = self.path.read_text(encoding="utf-8")
        marks = [mark for words, mark in MARKS.items() if words in text]
        yield self._test("", marks)
        if EVERY_PYTHON in text:
            yield self._test(OTHER_PYTHON, marks + ["long"])

    def _test(self, python: str, marks: List[str]) -> "Rostest":
        name = f"{self.path.stem}-{python}" if python else self.path.stem
        test = Rostest.from_parent(self, name=name, python=python)
        for mark in marks:
            test.add_marker(mark)
        # of pytest-rerunfailures. Its option --reruns asks a server twice about each test of all,
        # which takes 40 ms
        if hasattr(self.config, "workerinput"):
            test.add_marker(pytest.mark.flaky(reruns=1))
        return test


class Rostest(pytest.Item):
    """Runs a rostest file, its nodes on the Python of that version; empty: the workspace's."""

    def __init__(self, python: str = "", **keywords):
        super().__init__(**keywords)
        self._python = python
        package = "unit_tests" if self.nodeid.startswith("unit_tests") else "cssr_system"
        self._folder = LOGS / f"{package}-{self.name}"

    def runtest(self):
        """Run it to its end or its limit; raise ``Failed`` unless every case passes."""
        environment = self._environment()
        if getattr(self, "execution_count", 1) > 1:  # it is run once more
            first = self._folder.with_name(f"{self._folder.name}-first")
            shutil.rmtree(first, ignore_errors=True)
            self._folder.rename(first)
        shutil.rmtree(self._folder, ignore_errors=True)
        self._folder.mkdir(parents=True)
        fault = self._execute(environment)
        cases = list(read_cases(self._folder))
        failed = [f"{case.name}: {case.complaint}" for case in cases if case.complaint]
        if not failed and not cases:
            failed = ["no case was run"]
        if failed or fault:
            place = f"the whole output: {os.path.relpath(str(self._log))}"
            raise Failed("\n".join(failed + [fault] * bool(fault) + [place, self._last_lines()]))

    def repr_failure(self, excinfo, style=None):
        """Show the text alone if a case failed."""
        if excinfo.errisinstance(Failed):
            return str(excinfo.value)
        return super().repr_failure(excinfo, style)

    def reportinfo(self):
        """Name the file."""
        return self.path, None, self.name

    @property
    def _log(self) -> Path:
        return self._folder / "output.log"

    def _environment(self):
        if "ROS_PACKAGE_PATH" not in os.environ or shutil.which("rostest") is None:
            pytest.skip("needs the workspace's shell: source build/devel/setup.bash")
        environment = dict(os.environ, ROS_HOME=str(self._folder / "ros"))
        if self._python:
            environment["REPEATED_ON"] = self._python  # cases may leave out what it does not touch
            python, modules = BUILD / f"venv-{self._python}" / "bin", BUILD / "ros_modules"
            if not python.exists() or not any(modules.iterdir()):
                pytest.skip(f"there is no ROS for python{self._python}")
            environment["PATH"] = f"{python}:{environment['PATH']}"
            environment["PYTHONPATH"] = f"{environment['PYTHONPATH']}:{modules}"
        return environment

    def _execute(self, environment) -> str:
        """Return what went wrong with the command; empty: nothing."""
        command = ["rostest", "--results-base-dir", str(self._folder),
                   "--results-filename", self.path.stem + ".xml", str(self.path)]
        with self._log.open("w") as log:
            process = subprocess.Popen(command, env=environment, stdin=subprocess.DEVNULL,
                                       stdout=log, stderr=subprocess.STDOUT)
            try:
                code = process.wait(LIMIT)
            except subprocess.TimeoutExpired:
                return f"not done after {LIMIT:.0f} s"
            finally:
                stop(process)
        return f"rostest's exit code is {code}" if code else ""

    def _last_lines(self) -> str:
        return "".join("| " + line for line in self._log.open(errors="replace").readlines()[-25:])


def stop(process: subprocess.Popen) -> None:
    """Stop a rostest that still runs: by SIGINT, so that it stops its nodes, or else by force."""
    if process.poll() is None:
        process.send_signal(signal.SIGINT)
        try:
            process.wait(STOP_LIMIT)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()


def read_cases(folder: Path) -> Iterator[Case]:
    """Yield the cases in rostest's results.

    It writes rosunit-*.xml for the cases of a test node, and rostest-*.xml in which a node is one
    case: that one says which node failed as a whole.
    """
    for path in sorted(folder.rglob("*.xml")):
        try:
            for case in ElementTree.parse(str(path)).iter("testcase"):
                complaints = [child for child in case if child.tag in ("failure", "error")]
                yield Case(f"{case.get('classname')}.{case.get('name')}",
                           first_line(complaints[0]) if complaints else "")
        except ElementTree.ParseError:
            continue  # rostest was stopped while it wrote


def first_line(complaint: ElementTree.Element) -> str:
    """Return the first line of a failure's message, or of its text."""
    lines = (complaint.get("message") or complaint.text or "").strip().splitlines()
    return lines[0][:200] if lines else complaint.tag
