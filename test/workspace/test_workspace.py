"""Both packages in a user's own catkin workspace, beside a robot whose nodes live in a package of
the same name."""
import os
import re
import signal
import subprocess

import pytest
import tutorial

from free_ports import free_port

pytestmark = pytest.mark.long
REPOSITORY = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
ROS = "/opt/ros/noetic/setup.bash"
EXAMPLES = ("courier", "greeter", "receptionist")
BUILD_LIMIT, RUN_LIMIT = 300.0, 120.0
ROBOTS_SPEECH = """#!/usr/bin/env python3
import rospy
from cssr_system.srv import sayText, sayTextResponse

def say(request):
    print("said:", request.message, flush=True)
    return sayTextResponse(True, "")

rospy.init_node("textToSpeech")
rospy.Service("/textToSpeech/say_text", sayText, say)
print("ready", flush=True)
rospy.spin()
"""
ROBOTS_CMAKE = """cmake_minimum_required(VERSION 3.5)
project(cssr_system)
find_package(catkin REQUIRED COMPONENTS message_generation)
add_service_files(FILES sayText.srv)
generate_messages()
catkin_package(CATKIN_DEPENDS message_runtime)
catkin_install_python(PROGRAMS textToSpeech DESTINATION ${CATKIN_PACKAGE_BIN_DESTINATION})
"""
ROBOTS_MANIFEST = """<package format="2"><name>cssr_system</name><version>1.0.0</version><description>a robot</description>
<maintainer email="a@example.org">a</maintainer><license>BSD</license><buildtool_depend>catkin</buildtool_depend>
<depend>message_generation</depend><depend>message_runtime</depend><depend>rospy</depend></package>
"""


class Shell:
    """A user's shell that has sourced only what is given."""

    def __init__(self, home, *sourced):
        self.environment = {
            "HOME": str(home), "PATH": "/usr/sbin:/usr/bin:/sbin:/bin", "LANG": "C.UTF-8",
            "ROS_HOSTNAME": "localhost", "ROS_HOME": str(home / "ros"), "PYTHONUNBUFFERED": "1",
            "ROS_MASTER_URI": "http://localhost:{}".format(free_port())}
        # where packages come from is the machine's
        self.environment.update({
            key: value for key, value in os.environ.items()
            if key.startswith("PIP_") or key.lower().endswith("_proxy") or "_CERT_" in key})
        ros = (ROS,) if os.path.exists(ROS) else ()
        self._sourced = "".join(". {} && ".format(path) for path in ros + sourced)

    def run(self, command, limit=RUN_LIMIT):
        """Return the exit code and all that the command prints."""
        done = subprocess.run(["bash", "-c", self._sourced + command], env=self.environment,
                              timeout=limit, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                              universal_newlines=True)
        return done.returncode, done.stdout

    def do(self, command, limit=RUN_LIMIT):
        """Run a command that has to succeed, and return what it prints."""
        code, text = self.run(command, limit)
        assert code == 0, text
        return text

    def start(self, command):
        """Start a command in its own process group and return its process."""
        return subprocess.Popen(["bash", "-c", self._sourced + command], env=self.environment,
                                start_new_session=True, stdout=subprocess.PIPE,
                                stderr=subprocess.STDOUT, universal_newlines=True)


@pytest.fixture(scope="module")
def home(tmp_path_factory):
    """A user's home folder."""
    found = tmp_path_factory.mktemp("home")
    (found / "ros").mkdir()
    return found


@pytest.fixture(scope="module")
def workspace(home):
    """A workspace that was built before, into which the packages were put by the command; built
    again and installed."""
    place = home / "catkin_ws"
    (place / "src").mkdir(parents=True)
    Shell(home).do("cd {} && catkin_make".format(place), BUILD_LIMIT)
    Shell(home).do("{}/tools/add_to_workspace.sh {}".format(REPOSITORY, place), BUILD_LIMIT)
    for name in EXAMPLES:
        (place / "src" / name).symlink_to(os.path.join(REPOSITORY, "examples", name))
    Shell(home).do("cd {} && catkin_make && catkin_make install".format(place), BUILD_LIMIT)
    return place


@pytest.fixture(params=["devel", "install"])
def sourced(request, workspace):
    """Each space in turn; while the install space is tried, nothing else of the workspace is there.
    """
    if request.param == "devel":
        yield workspace / "devel/setup.bash"
        return
    hidden = workspace.parent / "hidden"
    hidden.mkdir()
    for name in ("src", "devel", "build"):
        (workspace / name).rename(hidden / name)
    yield workspace / "install/setup.bash"
    for name in ("src", "devel", "build"):
        (hidden / name).rename(workspace / name)
    hidden.rmdir()


def test_all_runs_from_the_workspace(home, sourced):
    shell = Shell(home, str(sourced))
    package = shell.do("rospack find cssr_system").splitlines()[-1]
    assert package.startswith(str(home))
    assert "can be run" in shell.do(
        "rosrun cssr_system validateMission {}/data/lab_tour.xml".format(package))
    assert "TreeNodesModel" in shell.do("rosrun cssr_system exportNodeModel")
    shell.do("cd {} && py-trees-render --kwargs '{{\"mission\": \"lab_tour\"}}' "
             "behavior_controller.cli.create_tree".format(home))
    assert (home / "lab_tour.svg").exists()
    code, text = shell.run("rosrun cssr_system behaviorController")
    assert (code, text.count("no ROS master")) == (1, 1), text
    shell.do("roslaunch unit_tests behaviorControllerTest.launch missionRuns:=1 "
             "visitorBehaviour:=declines arrivalRate:=6000 failureRate:=0 callTimes:=none")


@pytest.mark.parametrize("sourced", ["install"], indirect=True)  # it has missions of its own
def test_the_last_commands_of_the_tutorial(home, sourced):
    (home / "reception").mkdir()
    tutorial.write_mission(tutorial.read()[-1], str(home / "reception"))
    with open(tutorial.DOCUMENT, encoding="utf-8") as file:
        commands = file.read().rpartition("\n```\n")[0].rpartition("```\n")[2]
    assert "mission:=my_reception" in commands
    told = Shell(home, str(sourced)).do("set -e\n" + commands)
    assert told.splitlines()[-2].startswith("PASSED: "), told


def test_a_program_starts_with_the_python_that_it_was_built_with(home, sourced):
    other = home / "other_python"
    other.mkdir(exist_ok=True)
    (other / "python3").write_text("#!/bin/sh\necho another python; exit 9\n")
    (other / "python3").chmod(0o755)
    shell = Shell(home, str(sourced))
    shell.do(f"export PATH={other}:$PATH; rosrun cssr_system validateMission --help && "
             "rosrun unit_tests runTest --help && py-trees-render --help")


def test_no_package_of_the_system_is_shadowed(home, workspace):
    added = [path.name for path in (workspace / "src/cssr_system/python_packages").iterdir()
             if "." not in path.name]
    assert "py_trees" in added
    found = "[name for name in {} if importlib.util.find_spec(name)]".format(added)
    assert Shell(home).do("/usr/bin/python3 -c 'import importlib.util; print({})'".format(
        found.replace("'", '"'))) == "[]\n"


@pytest.mark.parametrize("sourced", ["install"], indirect=True)  # as test_extensions in devel
def test_another_packages_leaves(home, sourced):
    shell = Shell(home, str(sourced))
    text = shell.do("roslaunch greeter greeter.launch")
    for words in ("the lights are blue", "CuriousSpeech::11): SUCCESS", "the lights are white",
                  "the display shows Follow me", "the robot has driven", "exit code 0"):
        assert words in text, text
    assert text.count("SayTime::15): SUCCESS") == 1  # every other time, of two
    assert 'ID="EveryOther"' in shell.do("rosrun cssr_system exportNodeModel")
    text = shell.do("roslaunch courier courier.launch")
    for words in ("the hatch is open", "HandOver::11): SUCCESS", "the hatch is closed",
                  "the robot is at 0, 0", "exit code 0"):
        assert words in text, text
    assert "can be run" in shell.do("rosrun cssr_system validateMission receptionist")
    text = shell.do("roslaunch receptionist receptionist.launch")
    assert "showing the way to room B203" in text and "exit code 0" in text, text


def test_beside_a_robot_whose_package_has_the_same_name(home, workspace):
    robot = home / "robot_ws"
    package = robot / "src/cssr_system"
    (package / "srv").mkdir(parents=True)
    (package / "CMakeLists.txt").write_text(ROBOTS_CMAKE)
    (package / "package.xml").write_text(ROBOTS_MANIFEST)
    (package / "srv/sayText.srv").write_text("string message\n---\nbool success\nstring response\n")
    (package / "textToSpeech").write_text(ROBOTS_SPEECH)
    (package / "textToSpeech").chmod(0o755)
    ours, theirs = Shell(home, str(workspace / "devel/setup.bash")), Shell(
        home, str(robot / "devel/setup.bash"))
    theirs.environment["ROS_MASTER_URI"] = ours.environment["ROS_MASTER_URI"]
    code, text = Shell(home).run("{}/tools/add_to_workspace.sh {}".format(REPOSITORY, robot))
    assert code == 1 and "not made by this command" in text and not (robot /
                                                                     "src/unit_tests").exists()
    Shell(home).do("cd {} && catkin_make".format(robot), BUILD_LIMIT)
    started = [ours.start(
        "roslaunch unit_tests simulatedRobot.launch use_real_textToSpeech:=true failureRate:=0 "
        "visitorBehaviour:=declines arrivalRate:=6000")]
    try:
        ours.do("until rostopic list >/dev/null 2>&1; do sleep 0.2; done")
        started.append(theirs.start("rosrun cssr_system textToSpeech"))
        assert started[1].stdout.readline() == "ready\n"
        ours.do("rosrun cssr_system behaviorController _missionRuns:=1 _startupTimeout:=30 "
                "_groot2Port:=0 _monitorPort:=0 _recordDirectory:=none")
        assert re.match("said: .", started[1].stdout.readline())
    finally:
        for process in started:
            os.killpg(process.pid, signal.SIGINT)
        for process in started:
            process.communicate(timeout=30)


def test_nothing_is_left_after_it_was_removed(home, workspace):
    """The last test of this workspace."""
    for name in EXAMPLES:
        (workspace / "src" / name).unlink()
    added = [path.name for path in (workspace / "src/cssr_system/python_packages").iterdir()]
    Shell(home).do("{}/tools/add_to_workspace.sh --remove {}".format(REPOSITORY, workspace))
    ours = re.compile(r"cssr_system|unit_tests|behavior|py-trees-render|validateMission|runTest")
    left = [path for path in workspace.rglob("*")
            if ours.search(str(path.relative_to(workspace))) or path.name in added]
    assert left == []
    assert [path.name for path in (workspace / "src").iterdir()] == ["CMakeLists.txt"]
