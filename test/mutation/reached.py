"""Which tests run which line: a plugin of pytest that notes it once on the unbroken code, and what
reads its notes.

As a plugin it also ends a run in which a test hangs or swallows the memory, as broken code makes
it.
"""
import ast
import collections
import glob
import json
import os
import resource
import signal
from typing import Dict, List, Set, Tuple

import coverage

TEST_LIMIT = 60  # seconds
MEASURING = 10  # times that limit where lines are noted, which takes longer
MEMORY_LIMIT = 4 << 30  # bytes
OVERHEAD = 0.005  # seconds that pytest itself takes for a test
SETTINGS = """[run]
parallel = true
patch = _exit
data_file = {place}/notes/coverage
context = ${{PYTEST_CURRENT_TEST-}}
source =
  {place}/src
  {place}/unit_tests/src
"""


def pytest_configure(config):
    """Limit the memory, and measure if the environment says so; coverage itself does so in the
    tests' children."""
    resource.setrlimit(resource.RLIMIT_DATA,
                       (MEMORY_LIMIT, resource.getrlimit(resource.RLIMIT_DATA)[1]))
    coverage.process_startup()


seconds = {}  # of each test of this run


def pytest_runtest_logreport(report):
    """Note how long the parts of a test take."""
    test = _test(report.nodeid)
    seconds[test] = seconds.get(test, 0.0) + report.duration


def pytest_unconfigure(config):
    """Write how long each test took, if this run measures."""
    settings = os.environ.get("COVERAGE_PROCESS_START")
    if settings:
        with open(os.path.join(os.path.dirname(settings), "notes", "seconds.json"), "w",
                  encoding="utf-8") as file:
            json.dump(seconds, file)


def pytest_runtest_logstart(nodeid, location):
    """Give the next test its time, and the lines that it runs its name."""
    measuring = coverage.Coverage.current()
    signal.alarm(TEST_LIMIT if measuring is None else MEASURING * TEST_LIMIT)
    if measuring is not None:
        measuring.switch_context(nodeid)


class Reached:
    """What was measured below ``places``, which are copies of the same code."""

    def __init__(self, places: List[str]):
        self._tests: Dict[Tuple[str, int], Set[str]] = {}  # by file and line
        # lines that run before the first test, also in functions
        self._at_import: Set[Tuple[str, int]] = set()
        self._reach: Dict[str, int] = {}  # how many lines a test runs
        self._inside: Dict[str, Set[int]] = {}
        self._seconds: Dict[str, float] = {}
        for place in places:
            self._read(place)

    def _read(self, place: str) -> None:
        for notes in glob.glob(os.path.join(place, "notes", "coverage.*")):
            measured = coverage.CoverageData(notes)
            try:
                measured.read()
            except coverage.exceptions.DataError:
                continue  # of a child that was killed while it wrote
            for path in measured.measured_files():
                file = os.path.relpath(path, place)
                self._inside[file] = _inside_functions(path)
                for line, contexts in measured.contexts_by_lineno(path).items():
                    self._note(file, line, {_test(context) for context in contexts})
        with open(os.path.join(place, "notes", "seconds.json"), encoding="utf-8") as file:
            self._seconds.update(json.load(file))

    def _note(self, file: str, line: int, tests: Set[str]) -> None:
        if "" in tests:
            self._at_import.add((file, line))
        self._tests.setdefault((file, line), set()).update(tests - {""})
        for test in tests - {""}:
            self._reach[test] = self._reach.get(test, 0) + 1

    def tests(self, file: str, line: int) -> List[str]:
        """Return the tests that run the line, first those that run little but the file in a short
        time.

        What an import runs matters to all tests in the files that run the module's functions; to
        all if it has none.
        """
        inside = self._inside.get(file, set())
        found = self._tests.get((file, line), set())
        here = collections.Counter(test for number in inside
                                   for test in self._tests.get((file, number), ()))

        def cost(test: str) -> Tuple[bool, float, str]:
            share = max(here[test], 1) / max(self._reach.get(test, 0), 1)
            return (line in inside and test not in here,
                    (OVERHEAD + self._seconds.get(test, 0.0)) / share, test)

        if line not in inside or (file, line) in self._at_import:
            files = {test.split("::")[0] for test in here}
            found = found | {
                test for test in self._seconds if not files or test.split("::")[0] in files}
        return sorted(found, key=cost)


def _inside_functions(path: str) -> Set[int]:
    """Return the lines of functions: an import of the file runs their first ones alone."""
    with open(path, encoding="utf-8") as file:
        functions = [node for node in ast.walk(ast.parse(file.read()))
                     if isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef))]
    return {line for function in functions
            for line in range(function.lineno, (function.end_lineno or function.lineno) + 1)}


def _test(context: str) -> str:
    """Return the test of a context, which may be that of a child: ``file::test[parameters]
    (call)``."""
    return context.split("[")[0].split(" ")[0]
