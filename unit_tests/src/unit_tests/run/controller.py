"""Starts the controller under test with the arguments that the test needs, and notes its errors and
its exit code."""
import os
import re
import shutil
import signal
import subprocess
from typing import Callable, List, Optional, Tuple

from behavior_controller import exit_codes
from behavior_controller.errors import ConfigurationError
from behavior_controller.run.record import files
from behavior_controller.ros_arguments import explain_node
from behavior_controller.simulation.configuration import CONTROLLER

from unit_tests.folders import note, noted
from unit_tests.robot import claims, options
from unit_tests.robot.options import Arguments, Options

EXIT_CODE, ERRORS = "exitCode", "errors"
"""Files in the folder of the run."""

_ERROR = re.compile(r"(?:\x1b\[[\d;]*m)?\[(?:ERROR|FATAL)\] \[[^]]*\]: "
                    r"(?:behaviorController: )?([^\x1b\n]*)")
"""A line of rospy's about an error, and its text."""


def start() -> int:
    """Run the controller under test, whose command line this process was given."""
    explain_node("startController", "Runs the command line that it is given: the launch-prefix of "
                 "the controller under test.", "2 if it may not run, otherwise that of the command")
    return main(options.of_process(), claims.check_controller)


def main(arguments: Arguments, check: Callable[[Options], None]) -> int:
    """Run the controller's command line (it is a launch-prefix) and return its exit code.

    ``check`` raises ConfigurationError if it must not start.
    """
    folder = arguments.folder
    os.makedirs(folder, exist_ok=True)
    try:
        own = options.read(arguments)
        check(own)
    except ConfigurationError:
        note(folder, EXIT_CODE, "0\n")
        return 0  # the report names the fault and ends the launch
    for number in (signal.SIGINT, signal.SIGTERM):
        # the controller gets the signal too: wait for it to stop
        signal.signal(number, lambda *_: None)
    process = subprocess.Popen(command_line(own), stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
    _pass_on(process, os.path.join(folder, ERRORS))
    code = process.wait()
    note(folder, EXIT_CODE, "{}\n".format(code))
    _keep_record(folder, arguments.values.get("recordDirectory"))
    if code == exit_codes.FAILURE:
        return 0  # roslaunch would report a crash; the verdict judges the exit code
    return code if code >= 0 else 128 - code


def command_line(own: Options) -> List[str]:
    """Return the controller's command line with its keys among the given arguments, and those that
    the test needs."""
    given = own.arguments
    keys = {name: value for name, value in given.values.items() if name in CONTROLLER}
    keys.update(startupTimeout=given.startup_timeout, missionRuns=str(own.test.mission_runs),
                recordDirectory=given.folder)
    if own.test.verbose_mode:
        keys["verboseMode"] = "true"
    return given.words[1:] + ["_{}:={}".format(*pair) for pair in keys.items()]


def _pass_on(process: "subprocess.Popen[bytes]", path: str) -> None:
    """Copy what the process writes to our own output until it ends, in whole lines; its errors to a
    file too."""
    assert process.stdout is not None
    with process.stdout as lines, open(path, "w", encoding="utf-8") as file:
        for line in lines:
            os.write(1, line)
            error = _ERROR.match(line.decode(errors="replace"))
            if error:
                print(error.group(1), file=file, flush=True)


def read_errors(folder: str) -> Tuple[str, ...]:
    """Return the errors that the controller has reported on its terminal."""
    return tuple(noted(folder, ERRORS).splitlines())


def _keep_record(folder: str, wanted: Optional[str]) -> None:
    """Copy the record to a folder of its own below that which the user named for it."""
    if wanted:
        try:
            copy = files.new_folder(wanted)
            for record in files.runs(folder)[-1:]:
                for file in files.parts(record):
                    shutil.copy(file, copy)
        except OSError as error:
            print("no record in {}: {}".format(wanted, error.strerror))


def read_exit_code(folder: str) -> Optional[int]:
    """Return how the controller ended (negative: by that signal), or None if it has not."""
    text = noted(folder, EXIT_CODE)
    if not text.endswith("\n"):
        return None
    return int(text)
