"""runTest: checks its arguments, runs the launch file of the test, and returns the verdict as text
and exit code."""
import os
import signal
import subprocess
import sys
import tempfile
from typing import Dict, Optional, Sequence

from behavior_controller.folders import ros_home
from behavior_controller.errors import BehaviorControllerError
from behavior_controller.missions import load as missions
from behavior_controller.ros_arguments import version
from behavior_controller.simulation import configuration
from behavior_controller.simulation.rehearsal import arrival_waits

from unit_tests.robot import claims, options
from unit_tests.robot.options import Arguments
from unit_tests.run.test_node import NOTHING_TESTED, NOT_RUN, expect_verdict, read_verdict


def main(words: Optional[Sequence[str]] = None) -> int:
    """Return 0 if the test passed, 1 if it failed, 2 if it could not be run, 3 if its time was too
    short."""
    if words is None:
        words = sys.argv[1:]
    try:
        if "--version" in words:
            print("runTest", version())
            return 0
        if {"-h", "--help"}.intersection(words):
            waits = arrival_waits.of_mission(options.read(Arguments([], {})).world)
            print(options.usage(arrival_waits.sufficient(waits) if waits else ""))
            return 0
        values = configuration.parse(words, options.NAMES, options.HELP)
        if "outputFile" in values:  # the nodes run in another folder
            values["outputFile"] = os.path.abspath(values["outputFile"])
        own = options.read(Arguments([], values))
        missions.find(own.world.settings.scenario_specification)
        claims.check_test(own)
    except BehaviorControllerError as error:
        print("{}\n{}".format(error, NOTHING_TESTED))
        return NOT_RUN
    code, text = read_verdict(_launch(values)) or (NOT_RUN, NOTHING_TESTED)
    print("\n" + text)
    return code


def _launch(values: Dict[str, str]) -> str:
    """Run the test to its end and return the folder of the run."""
    logs = os.path.join(ros_home(), "log")
    os.makedirs(logs, exist_ok=True)
    folder = tempfile.mkdtemp(prefix="behaviorControllerTest_", dir=logs)
    expect_verdict(folder)
    given = dict({options.FOLDER: folder}, **values)
    command = ["roslaunch", "unit_tests", options.LAUNCH_FILE]
    command += ["{}:={}".format(*pair) for pair in given.items()]
    # its own session: roslaunch gets a Ctrl-C once, from here, and has the time to stop its nodes
    process = subprocess.Popen(command, start_new_session=True)
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, lambda *_: process.send_signal(signal.SIGINT))
    process.wait()
    return folder
