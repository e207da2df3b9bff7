"""Does each command of README and the guides work as it is written there, one after the other?"""
import glob
import os
import re
import signal
import socket
import subprocess
import time

import pytest

pytestmark = [pytest.mark.long, pytest.mark.skipif(
    "ROS_PACKAGE_PATH" not in os.environ,
    reason="needs the workspace's shell: source build/devel/setup.bash")]

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
SERVES = {  # what goes on until it is stopped, and what it prints when it is up
    "roslaunch unit_tests simulatedRobot.launch speed:=10": "faceDetection: randomSeed",
    "rosrun cssr_system behaviorController": " starts, ",
    "rosrun cssr_system missionStatus --watch": "lab_tour",
    "rosrun cssr_system validateMission --watch data/lab_tour.xml": "can be run"}
PROGRAMS = ("make", "source", "rosrun", "roslaunch", "py-trees-render", "python3")
LIMIT = 900.0  # s, for each command: a tour in a robot's time takes four minutes and more


def blocks():
    """Return the commands of each block of README and of the guides, each command once, without
    those of make and of the shell. What needs a second computer begins with export."""
    texts = []
    for document in ["README.md"] + sorted(glob.glob(os.path.join(ROOT, "docs", "*.md"))):
        with open(os.path.join(ROOT, document), encoding="utf-8") as file:
            texts += re.findall(r"(?ms)^```\w*\n(.*?)^```", file.read())
    seen, found = set(), []
    for text in texts:
        commands = [line.partition("  #")[0].strip() for line in text.splitlines() if line]
        if commands and all(command.startswith(PROGRAMS) for command in commands):
            found.append([command for command in commands
                          if not command.startswith(("make", "source")) and command not in seen])
            seen.update(commands)
    return [commands for commands in found if commands]


@pytest.fixture(name="folder")
def folder_with_files(tmp_path, monkeypatch):
    """Work in a folder that has the repository's files, with a ROS_HOME and a master of its own."""
    for name in ("data", "examples"):
        (tmp_path / name).symlink_to(os.path.join(ROOT, name))
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("ROS_HOME", str(tmp_path / "ros"))
    with socket.create_server(("localhost", 0)) as server:  # other blocks run beside this one
        port = server.getsockname()[1]
    monkeypatch.setenv("ROS_MASTER_URI", "http://localhost:{}".format(port))
    return tmp_path


def wait_for(path, words, process):
    ends = time.monotonic() + LIMIT
    while words not in path.read_text(errors="replace"):
        assert process.poll() is None and time.monotonic() < ends, path.read_text(errors="replace")
        time.sleep(0.1)


def alone(commands):
    """Mark a block that reads the page: another mission's may have its port."""
    reads = any("missionStatus" in command for command in commands)
    return pytest.param(commands, marks=[pytest.mark.timing] if reads else [], id=commands[0])


@pytest.mark.parametrize("commands", [alone(commands) for commands in blocks()])
def test_each_command_works_as_written(folder, commands):
    running = []
    try:
        for number, command in enumerate(commands):
            output = folder / "output{}.log".format(number)
            with output.open("w") as file:
                process = subprocess.Popen("exec " + command, shell=True, stdout=file,
                                           stderr=subprocess.STDOUT, stdin=subprocess.DEVNULL)
            if command in SERVES:
                running.append(process)
                wait_for(output, SERVES[command], process)
            else:
                assert process.wait(LIMIT) == 0, output.read_text(errors="replace")
    finally:
        for process in reversed(running):
            process.send_signal(signal.SIGINT)
            process.wait(60)
