"""Which tests run which line: a plugin of pytest that notes it once on the unbroken code, and what reads its notes.

As a plugin it also ends a run in which a test hangs or swallows the memory, as broken code makes it.
"""
import ast
import glob
import os
import resource
import signal
from typing import Dict, List, Set, Tuple

import coverage

TEST_LIMIT = 60  # seconds
MEMORY_LIMIT = 4 << 30  # bytes
SETTINGS = """[run]
parallel = true
data_file = {place}/notes/coverage
context = ${{PYTEST_CURRENT_TEST-}}
source =
  {place}/src
  {place}/unit_tests/src
"""


def pytest_configure(config):
    """Limit the memory, and measure if the environment says so; coverage itself does so in the tests' children."""
    resource.setrlimit(resource.RLIMIT_DATA, (MEMORY_LIMIT, resource.getrlimit(resource.RLIMIT_DATA)[1]))
    coverage.process_startup()


def pytest_runtest_logstart(nodeid, location):
    """Give the next test its time, and the lines that it runs its name."""
    signal.alarm(TEST_LIMIT)
    measuring = coverage.Coverage.current()
    if measuring is not None:
        measuring.switch_context(nodeid)


class Reached:
    """What was measured below ``place``."""

    def __init__(self, place: str):
        self._place = place
        self._tests: Dict[Tuple[str, int], Set[str]] = {}  # by file and line
        self._at_import: Set[Tuple[str, int]] = set()  # lines that run before the first test, also in functions
        self._reach: Dict[str, int] = {}  # how many lines a test runs
        for path in glob.glob(os.path.join(place, "notes", "coverage.*")):
            measured = coverage.CoverageData(path)
            measured.read()
            for file in measured.measured_files():
                for line, contexts in measured.contexts_by_lineno(file).items():
                    self._note(os.path.relpath(file, place), line, {_test(context) for context in contexts})

    def _note(self, file: str, line: int, tests: Set[str]) -> None:
        if "" in tests:
            self._at_import.add((file, line))
        self._tests.setdefault((file, line), set()).update(tests - {""})
        for test in tests - {""}:
            self._reach[test] = self._reach.get(test, 0) + 1

    def tests(self, file: str, line: int) -> List[str]:
        """Return the tests that run the line, those of few lines first.

        What an import runs matters to all tests of the module's functions; to all tests if it has none.
        """
        inside = _inside_functions(os.path.join(self._place, file))
        found = self._tests.get((file, line), set())
        if line not in inside or (file, line) in self._at_import:
            users = {test for number in inside for test in self._tests.get((file, number), ())}
            found = found | users if users else set(self._reach)
        return sorted(found, key=lambda test: (self._reach[test], test))


def _inside_functions(path: str) -> Set[int]:
    """Return the lines that an import of the file does not run."""
    with open(path, encoding="utf-8") as file:
        functions = [node for node in ast.walk(ast.parse(file.read()))
                     if isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef))]
    return {line for function in functions for statement in function.body
            for line in range(statement.lineno, (statement.end_lineno or statement.lineno) + 1)}


def _test(context: str) -> str:
    """Return the test of a context, which may be that of a child: ``file::test[parameters] (call)``."""
    return context.split("[")[0].split(" ")[0]
