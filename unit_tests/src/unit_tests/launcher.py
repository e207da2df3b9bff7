"""Runs the launch file of the test and returns the verdict as an exit code, which roslaunch by itself does not do."""
import os
import subprocess
from typing import List

from unit_tests.parameters import ros_home
from unit_tests.reporter import VERDICT

NOT_RUN = 2


def main(arguments: List[str]) -> int:
    """Return 0 if the test passed, 1 if it failed, 2 if it could not be run. ``arguments`` go to the launch file."""
    folder = os.path.join(ros_home(), "log", "behaviorControllerTest_{}".format(os.getpid()))
    command = ["roslaunch", "unit_tests", "behaviorControllerTest.launch", "folder:=" + folder]
    try:
        subprocess.call(command + arguments)
    except KeyboardInterrupt:
        pass  # roslaunch has got the signal too and the report has been written
    try:
        with open(os.path.join(folder, VERDICT)) as file:
            return int(file.read())
    except (OSError, ValueError):
        return NOT_RUN
