"""The types as mypy.ini says, and what needs no ROS on the other supported interpreter."""
import os
import subprocess
import sys

import pytest

from rostest_items import BUILD, OTHER_PYTHON, REPOSITORY

OF_ONE_PYTHON = ["test_{}.py".format(name) for name in (
    "add_to_workspace", "architecture", "documents", "examples", "flawed_missions", "flawed_tours",
    "fuzz_missions", "judge_trials", "judged_situations", "lab_tour", "no_false_alarm",
    "operators_guide", "page", "planted_mistakes", "reception", "receptionist", "release_1_1_robot",
    "report", "run_list", "shared_faults", "situations", "tampered", "tasks", "tutorial")]
"""What reads files, looks at pages or plays many visits with code that other files run as well."""
SLOW_TOO = ["test_{}.py".format(name) for name in (
    "conformance", "connection", "groot2", "master", "server", "service_client", "signals", "sinks",
    "subscriber", "ticks_on_demand", "viewer", "watchdog")]
"""The engine, and what goes by threads and sockets, which differ between versions of Python."""
UNIT = "not long and not slow"  # the tests of make unit
LIMIT = 900.0  # seconds


def run(*command, **environment):
    """Run a command in the repository; a test that fails shows the end of what it printed."""
    done = subprocess.run(command, cwd=str(REPOSITORY), env=dict(os.environ, **environment),
                          timeout=LIMIT, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                          universal_newlines=True)
    assert done.returncode == 0, done.stdout[-5000:]


def run_on_other(*arguments):
    """Run pytest on the other interpreter, which collects every module and has no ROS."""
    python = BUILD / "venv-{}".format(OTHER_PYTHON) / "bin" / "python"
    if not python.exists():
        pytest.skip("python{} is not installed".format(OTHER_PYTHON))
    cache = "cache_dir={}/pytest_cache-{}".format(BUILD, OTHER_PYTHON)
    run(str(python), "-m", "pytest", "-q", "-rfE", "-o", cache, *arguments, PYTHONPATH="")


def test_the_types_agree():
    run(sys.executable, "-m", "mypy")


@pytest.mark.long
def test_all_on_the_other_python():
    files = [path for folder in ("test/conformance", "test/unit", "unit_tests/test/unit")
             for path in sorted((REPOSITORY / folder).glob("test_*.py"))
             if path.name not in OF_ONE_PYTHON]
    run_on_other("-m", UNIT, *(str(path) for path in files if path.name not in SLOW_TOO))
    run_on_other("-m", "not long", *(str(path) for path in files if path.name in SLOW_TOO))
