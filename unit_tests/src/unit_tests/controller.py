"""Starts the controller under test with what the test needs of it, and notes how it ended."""
import os
import signal
import subprocess
from typing import List, Optional

from behavior_controller.errors import ConfigurationError

from unit_tests import parameters

STARTUP_TIMEOUT = 30.0
"""Seconds that the controller waits for the simulated nodes, which are started at the same time."""

EXIT_CODE = "exitCode"
"""File in the folder of the run."""


def main(command: List[str]) -> int:
    """Run the controller's command line (it is a launch-prefix) and return its exit code."""
    try:
        test = parameters.read_configuration()
    except ConfigurationError:
        return 0  # the report tells of it and ends the launch
    folder = parameters.folder()
    os.makedirs(folder, exist_ok=True)
    given = {"missionRuns": test.mission_runs, "recordDirectory": folder, "startupTimeout": STARTUP_TIMEOUT}
    if test.verbose_mode:
        given["verboseMode"] = "true"
    process = subprocess.Popen(command + ["_{}:={}".format(key, value) for key, value in given.items()])
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: None)  # the controller gets it too, and we wait for how it takes it
    code = process.wait()
    with open(os.path.join(folder, EXIT_CODE), "w") as file:
        file.write("{}\n".format(code))
    return code if code >= 0 else 128 - code


def read_exit_code(folder: str) -> Optional[int]:
    """Return how the controller ended (negative: by that signal), or None if it has not."""
    try:
        with open(os.path.join(folder, EXIT_CODE)) as file:
            text = file.read()
    except FileNotFoundError:
        return None
    return int(text) if text.endswith("\n") else None
