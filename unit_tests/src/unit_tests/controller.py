"""Starts the controller under test with the arguments that the test needs, and notes its exit code."""
import os
import shutil
import signal
import subprocess
from typing import List, Optional

from behavior_controller import exits
from behavior_controller.errors import ConfigurationError
from behavior_controller.settings import split_arguments
from behavior_controller.watch.record import FILE_NAME as RECORD

from unit_tests import arguments, configuration, parameters

EXIT_CODE = "exitCode"
"""File in the folder of the run."""


def main(command: List[str]) -> int:
    """Run the controller's command line (it is a launch-prefix) and return its exit code."""
    folder = parameters.folder()
    os.makedirs(folder, exist_ok=True)
    try:
        test = parameters.read_configuration()
    except ConfigurationError:
        _note_exit_code(folder, 0)
        return 0  # the report names the fault and ends the launch
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: None)  # the controller gets the signal too: wait for it to stop
    process = subprocess.Popen(command_line(command, test, folder))
    code = process.wait()
    _note_exit_code(folder, code)
    _keep_record(folder)
    if code == exits.FAILURE:
        return 0  # roslaunch would report a crash; the verdict judges the exit code
    return code if code >= 0 else 128 - code


def command_line(command: List[str], test: configuration.Configuration, folder: str) -> List[str]:
    """Return the controller's command line with its keys among the given arguments, and those that the test needs."""
    others, given = split_arguments(command)
    keys = {"startupTimeout": "{:g}".format(arguments.STARTUP_TIMEOUT)}
    keys.update((name, value) for name, value in given.items() if name in arguments.CONTROLLER)
    keys.update(missionRuns=str(test.mission_runs), recordDirectory=folder)
    if test.verbose_mode:
        keys["verboseMode"] = "true"
    return others + ["_{}:={}".format(*pair) for pair in keys.items()]


def _note_exit_code(folder: str, code: int) -> None:
    with open(os.path.join(folder, EXIT_CODE), "w") as file:
        file.write("{}\n".format(code))


def _keep_record(folder: str) -> None:
    """Copy the record to the folder that the user named for it."""
    wanted = parameters.given().get("recordDirectory")
    if wanted:
        try:
            os.makedirs(wanted, exist_ok=True)
            shutil.copy(os.path.join(folder, RECORD), wanted)
        except OSError as error:
            print("no record in {}: {}".format(wanted, error.strerror))


def read_exit_code(folder: str) -> Optional[int]:
    """Return how the controller ended (negative: by that signal), or None if it has not."""
    try:
        with open(os.path.join(folder, EXIT_CODE)) as file:
            text = file.read()
    except FileNotFoundError:
        return None
    return int(text) if text.endswith("\n") else None
