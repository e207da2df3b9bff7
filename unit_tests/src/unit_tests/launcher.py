"""runTest: checks its arguments, runs the launch file of the test, and returns the verdict as text and exit code."""
import os
import signal
import subprocess
import tempfile
from typing import Dict, List

from behavior_controller.errors import ConfigurationError

from unit_tests import arguments, parameters, waits
from unit_tests.reporter import NOT_RUN, NOTHING_TESTED, read_verdict


def main(given: List[str]) -> int:
    """Return 0 if the test passed, 1 if it failed, 2 if it could not be run."""
    try:
        if {"-h", "--help"} & set(given):
            signal.signal(signal.SIGPIPE, signal.SIG_DFL)  # so that ``| head`` causes no traceback; nothing runs yet
            print(arguments.usage({"arrivalRate": _of_arrival_rate()}))
            return 0
        values = arguments.read(given)
        arguments.check(values)
    except ConfigurationError as error:
        print("{}\n{}".format(error, NOTHING_TESTED))
        return NOT_RUN
    code, text = read_verdict(_launch(values)) or (NOT_RUN, NOTHING_TESTED)
    print("\n" + text)
    return code


def _of_arrival_rate() -> str:
    """Return a line with the arrival rate that the configured mission needs."""
    needed = waits.of_mission(parameters.read_world(parameters.read_configuration()))
    return waits.sufficient(needed) if needed else ""


def _launch(values: Dict[str, str]) -> str:
    """Run the test to its end and return the folder of the run."""
    logs = os.path.join(parameters.ros_home(), "log")
    os.makedirs(logs, exist_ok=True)
    folder = tempfile.mkdtemp(prefix="behaviorControllerTest_", dir=logs)
    command = ["roslaunch", "unit_tests", arguments.LAUNCH_FILE, "{}:={}".format(arguments.FOLDER, folder)]
    command += ["{}:={}".format(*pair) for pair in values.items()]
    # its own session: roslaunch gets a Ctrl-C once, from here, and has the time to stop its nodes
    process = subprocess.Popen(command, start_new_session=True)
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, lambda *_: process.send_signal(signal.SIGINT))
    process.wait()
    return folder
