"""No program shows a traceback of its own, whatever the environment that it runs in."""
import os
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor

import pytest

pytest.importorskip("rosgraph", reason="needs ROS, which this interpreter does not have")

from mission_rig import recorded, visitor_who  # noqa: E402

pytestmark = pytest.mark.slow

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
COMMANDS = os.path.join(ROOT, "src", "behavior_controller")
NODES = os.path.join(ROOT, "unit_tests", "nodes")
BUSY = os.path.join(ROOT, "test", "unit", "planted", "busy_loop.xml")
CALLS = {  # with their exit codes, where there is no master and no mission runs
    ("validateMission", "lab_tour"): 0, ("exportNodeModel", ): 0,
    ("missionViewer", "--port", "x"): 2, ("missionStatus", "--port", "9"): 1,
    ("replayMission", "RECORD", "--story"): 0,
    ("behaviorController", ): 1, ("textToSpeech", ): 1, ("faceDetection", ): 1,
    ("rehearseMission", BUSY, "--faults", "none", "--visitors", "engages", "--jobs", "1"): 4,
    ("runTest", "failureRate:=7"): 2, ("report", "_failureRate:=7"): 2,
    ("startController", "true", "_failureRate:=7", "_folder:=FOLDER"): 0}
DRAWING = ("py-trees-render", "--kwargs", '{"mission": "reception"}',
           "behavior_controller.cli.create_tree")
ASCII = {"LC_ALL": "C", "LANG": "C", "PYTHONIOENCODING": "ascii", "PYTHONUTF8": "0",
         "PYTHONCOERCECLOCALE": "0"}
ENVIRONMENTS = {
    "no docstrings": ({"PYTHONOPTIMIZE": "2"}, ""),
    "warnings are errors": ({"PYTHONWARNINGS": "error"}, ""),
    "small character set": (ASCII, ""),
    "no home": ({"HOME": None, "ROS_HOME": None}, ""),
    "a home that is not there": ({"HOME": "/proc/none", "ROS_HOME": "/proc/none",
                                  "TMPDIR": "/proc/none"}, ""),
    "odd terminal": ({"TERM": "odd", "COLUMNS": "-1", "LINES": "x"}, ""),
    "no terminal": ({"TERM": None, "COLUMNS": "0"}, ""),
    "closed streams": ({}, "exec <&- >&-; "),
    "all streams closed": ({}, "exec <&- >&- 2>&-; "),
    "full output": ({}, "exec >/dev/full; "),
    "no folder": ({}, "mkdir gone; cd gone; rmdir ../gone; ")}

ENVIRONMENTS["much at once"] = (
    {name: value for changes, _ in ENVIRONMENTS.values() for name, value in changes.items()}, "")


def executables():
    """Return the name of each executable, and its path."""
    paths = (os.path.join(folder, name) for folder in (COMMANDS, NODES)
             for name in os.listdir(folder))
    return {os.path.basename(path): path for path in paths
            if os.path.isfile(path) and os.access(path, os.X_OK)}


def run(words, folder, changes, before=""):
    """Return the exit code of a program, and what it prints."""
    changes = dict({"ROS_MASTER_URI": "http://localhost:1", "ROS_HOME": str(folder)}, **changes)
    variables = dict(os.environ, PYTHONPATH=os.pathsep.join(filter(None, sys.path)),
                     PYTHONPYCACHEPREFIX=os.path.join(ROOT, "build", "pycache"))
    for name, value in changes.items():
        variables.pop(name, None)
        if value is not None:
            variables[name] = value
    command = ["sh", "-c", before + 'exec "$@"', "sh", sys.executable, executables()[words[0]]]
    with open(str(folder / str(abs(hash(words)))), "w+b") as output:
        done = subprocess.run(command + list(words[1:]), env=variables, cwd=str(folder),
                              timeout=120, stdin=subprocess.DEVNULL, stdout=output, stderr=output)
        output.seek(0)
        return done.returncode, output.read().decode("utf-8", "replace")


ALONE = ("no docstrings", "no home", "closed streams", "all streams closed", "full output",
         "no folder")
"""What cannot be together with the others, or has calls of its own."""


@pytest.mark.long
@pytest.mark.parametrize("environment", ["much at once", *ALONE])
def test_no_program_shows_a_traceback(environment, tmp_path):
    record = str(recorded(tmp_path, visitor_who(says="no")))
    changes, before = ENVIRONMENTS[environment]
    calls = [tuple(word.replace("RECORD", record).replace("FOLDER", str(tmp_path))
                   for word in words) for words in CALLS]
    if not before:
        calls.append(DRAWING)
    if environment == "no docstrings":
        calls += [(name, "--help") for name in executables()]
    folders = [tmp_path / str(number) for number in range(len(calls))]
    for folder in folders:
        folder.mkdir()
    with ThreadPoolExecutor(3) as pool:
        ended = list(pool.map(lambda words, folder: run(words, folder, changes, before), calls,
                              folders))
    for words, expected, (code, told) in zip(calls, [*CALLS.values()] + [0] * 99, ended):
        assert "Traceback" not in told and "Exception ignored" not in told, (words, told)
        assert code == (expected if environment != "full output" else code), (words, told)


def test_texts_that_are_docstrings_are_there_without_docstrings():
    command = ("from behavior_controller.bt import builtin_specs\n"
               "from behavior_controller.simulation.rehearsal.findings import KIND_BY_NAME\n"
               "print(KIND_BY_NAME['busy-loop'].means,"
               " [each.summary for each in builtin_specs() if each.id in ('Sleep', 'Delay')])")
    told = [subprocess.check_output([sys.executable, *option, "-B", "-c", command],
                                    env=dict(os.environ, PYTHONPATH=os.pathsep.join(sys.path)))
            for option in ((), ("-OO", ))]
    assert told[0] == told[1] and b"RUNNING for" in told[0] and b"Put a Sleep or a" in told[0]
