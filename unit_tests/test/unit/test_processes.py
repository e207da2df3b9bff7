"""Tests of the arguments of a test's processes, of the controller's start, and of a simulated
node's."""
import importlib.util
import os
import shutil
import signal
import subprocess
import sys

import pytest

from behavior_controller.config import knowledge_files
from behavior_controller.folders import ros_home
from behavior_controller.errors import ConfigurationError
from behavior_controller.robot.interfaces import INTERFACES
from behavior_controller.simulation import configuration
from behavior_controller.simulation.behaviour import NODES, nodes
from behavior_controller.simulation.world import load_building

from unit_tests.robot import options
from unit_tests.run import controller

REPOSITORY = os.path.dirname(
    os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__)))))


def start(*command, check=lambda own: None):
    """Run the command line of a controller, which ``check`` lets start, and return its exit code.
    """
    arguments = options.of_process()
    return controller.main(arguments._replace(words=["startController", *command]), check)


def read():
    return options.read(options.of_process())


def test_what_a_process_was_given(given, tmp_path):
    assert options.of_process().values == {} and not options.of_process().is_launched
    assert options.of_process().folder == str(tmp_path / "ros" / "unit_tests")
    given("folder:=/x", "failureRate:=0.5")
    given_now = options.of_process()
    assert given_now.values == {"folder": "/x", "failureRate": "0.5"} and given_now.is_launched
    assert given_now.folder == "/x"
    assert given_now.words == ["node", "__name:=node"]


def test_where_ros_writes(monkeypatch):
    monkeypatch.setenv("HOME", "/srv/of/test")
    monkeypatch.delenv("ROS_HOME", raising=False)
    assert ros_home() == "/srv/of/test/.ros"
    monkeypatch.setenv("ROS_HOME", "/elsewhere")
    assert ros_home() == "/elsewhere"


def test_the_seed_is_the_users_then_the_launch_files_then_drawn(given):
    assert 0 <= read().test.random_seed < configuration.SEEDS
    given("drawn:=5")
    assert read().test.random_seed == 5
    given("drawn:=5", "randomSeed:=0")
    assert read().test.random_seed == 0


def test_a_random_visitor_is_the_same_for_all_processes_of_a_seed(given):
    given("visitorBehaviour:=random", "randomSeed:=4")
    drawn = {read().test.visitor_behaviour for _ in range(5)}
    assert len(drawn) == 1 and drawn < {
        "engages", "silent", "unclear", "declines", "leaves", "noGaze"}
    given("visitorBehaviour:=leaves", "randomSeed:=4")
    assert read().test.visitor_behaviour == "leaves"


def test_a_wrong_argument_of_the_controller_or_of_roslaunch_is_a_fault_too(given, monkeypatch):
    given("monitorPort:=99999")
    with pytest.raises(ConfigurationError, match="monitorPort.*99999"):
        read().test
    given()
    roslaunch = subprocess.Popen(["roslaunch", "-", "behaviorControllerTest.launch", "mision:=x"],
                                 stdin=subprocess.PIPE, stdout=subprocess.PIPE,
                                 stderr=subprocess.DEVNULL, bufsize=0,
                                 executable=shutil.which("cat"))
    roslaunch.stdin.write(b"x")
    assert roslaunch.stdout.read(1) == b"x", "it runs"
    monkeypatch.setattr(os, "getppid", lambda: roslaunch.pid)
    with pytest.raises(ConfigurationError, match="mision:=x.*mission"):
        read().test
    roslaunch.communicate()


def test_the_nodes_that_are_real(given):
    assert read().arguments.simulated == list(NODES)
    given("use_real_textToSpeech:=True", "use_real_faceDetection:=false")
    assert set(NODES) - set(read().arguments.simulated) == {"textToSpeech"}


READ_FILES = """
import os, sys
from unit_tests.robot import options
sys.addaudithook(lambda event, given: event == "open" and print(given[0]))
options.read(options.of_process())
"""


@pytest.mark.slow
@pytest.mark.parametrize("robot, files", [
    ("D5.4.3", {"exhibits.json"}),
    ("release-1.0", {"cultureKnowledgeBase.dat", "cultureKnowledgeBaseConfiguration.ini",
                     "environmentKnowledgeBase.dat", "environmentKnowledgeBaseConfiguration.ini"})])
def test_a_process_reads_each_of_its_files_once(robot, files):
    done = subprocess.run([sys.executable, "-B", "-c", READ_FILES, "_robotInterface:=" + robot],
                          env=dict(os.environ, PYTHONPATH=os.pathsep.join(filter(None, sys.path))),
                          timeout=60, stdout=subprocess.PIPE, universal_newlines=True, check=True)
    opened = [os.path.basename(path) for path in done.stdout.splitlines()
              if path.endswith((".ini", ".json", ".dat"))]
    assert sorted(opened) == sorted(files | {
        "behaviorControllerConfiguration.ini", "behaviorControllerTestConfiguration.ini",
        "phrases_English.ini"})


def test_the_simulated_world_follows_the_configuration(given):
    given("visitorBehaviour:=silent", "mutualGazeValue:=2", "randomSeed:=1")
    world = read().world
    assert (world.visitor.manners.behaviour, world.settings.gaze_value) == ("silent", 2)


def test_a_robot_of_release_1_0_stands_in_the_building_of_its_knowledge_files(given):
    given("robotInterface:=release-1.0", "randomSeed:=1")
    world = read().world
    assert [place.name for place in world.knowledge.exhibits][:2] == ["Start of the tour", "Pepper"]
    assert (world.knowledge.home, world.knowledge.entrance) == (
        world.knowledge.exhibits[0], world.knowledge.exhibits[-1])
    assert world.visitor.manners.home is None, "the tour leads past the start"
    assert set(knowledge_files.load().phrases[number]
               for number in (1, 5)) < set(world.visitor.manners.questions)


def test_a_robot_has_the_nodes_of_its_interface():
    all_nodes = {
        "animateBehavior", "gestureExecution", "knowledgeBase", "overtAttention", "robotNavigation",
        "tabletEvent", "textToSpeech", "faceDetection", "speechEvent", "robotLocalization"}
    for robot, lacking in (("D5.4.3", {"robotLocalization"}),
                           ("release-1.0", {"knowledgeBase", "faceDetection"})):
        assert all_nodes - set(nodes(INTERFACES[robot])) == lacking


@pytest.mark.parametrize("end, noted, returned", [
    ("sys.exit(0)", 0, 0), ("sys.exit(1)", 1, 1), ("sys.exit(3)", 3, 0), ("sys.exit(4)", 4, 4),
    ("os.kill(os.getpid(), signal.SIGKILL)", -9, 137)])
def test_how_the_controller_ended_is_noted(given, program, tmp_path, end, noted, returned):
    copies = tmp_path / "copies"
    folder = tmp_path / "run" / "folder"
    given("folder:={}".format(folder), "recordDirectory:={}".format(copies), "missionRuns:=2",
          "verboseMode:=true")
    assert start(program("controller", end), "__name:=behaviorController") == returned
    assert controller.read_exit_code(str(folder)) == noted
    copy, = copies.glob("000001_*/mission.jsonl")
    assert copy.read_text() == '{"format": "behaviorController record"}\n'
    words = (folder / "words").read_text().splitlines()
    assert words[0] == "__name:=behaviorController"
    assert {"_missionRuns:=2", "_verboseMode:=true", "_startupTimeout:=30"} < set(words)


def test_the_errors_of_the_controller_are_passed_on_and_kept(given, program, tmp_path, capfd):
    given("folder:={}".format(tmp_path / "run"))
    lines = ["\x1b[31m[ERROR] [12:00:00.001]: behaviorController: no service /x\x1b[0m",
             "[WARN] [12:00:01.002]: slow", "\xff", "[FATAL] [12:00:02.003]: the end"]
    end = "sys.stdout.write({!r}); sys.exit(1)".format("\n".join(lines))
    assert start(program("controller", end)) == 1
    assert capfd.readouterr().out.splitlines() == lines
    assert controller.read_errors(str(tmp_path / "run")) == ("no service /x", "the end")
    assert controller.read_errors(str(tmp_path)) == ()


def test_the_lines_of_the_controller_keep_their_order_whatever_stream_they_are_written_to(
        given, program, tmp_path, capfd):
    given("folder:={}".format(tmp_path / "run"))
    end = "[os.write(1 + n % 2, b'%d\\n' % n) for n in range(50)]"
    assert start(program("controller", end)) == 0
    shown = capfd.readouterr()
    assert (shown.out.split(), shown.err) == ([str(number) for number in range(50)], "")


@pytest.fixture(name="ignored")
def own_handlers():
    """The signals that reach this process outside of the controller's start, which has handlers of
    its own."""
    ignored, numbers = [], (signal.SIGINT, signal.SIGTERM)
    before = [signal.signal(number, lambda got, _: ignored.append(got)) for number in numbers]
    yield ignored
    for number, handler in zip(numbers, before):
        signal.signal(number, handler)


def test_the_controller_ends_by_itself_after_a_signal_to_all(given, program, tmp_path, ignored):
    for folder in ("run", "copies"):  # of an earlier test
        (tmp_path / folder).mkdir()
    given("folder:={}".format(tmp_path / "run"), "recordDirectory:={}".format(tmp_path / "copies"))
    end = ("[os.kill(os.getppid(), number) for number in (signal.SIGINT, signal.SIGTERM)]; "
           "sys.exit(4)")
    assert start(program("controller", end)) == 4 and ignored == []
    assert len(list((tmp_path / "copies").glob("000001_*/mission.jsonl"))) == 1


def test_a_copy_of_the_record_that_fails_is_one_line(given, program, tmp_path, capfd):
    (tmp_path / "file").write_text("")
    given("folder:={}".format(tmp_path / "run"), "recordDirectory:={}".format(tmp_path / "file"))
    assert start(program("controller", "pass")) == 0
    assert capfd.readouterr().out == "no record in {}: File exists\n".format(tmp_path / "file")


def test_the_controller_is_not_started_for_a_wrong_test(given, program, tmp_path):
    given("failureRate:=7", "folder:={}".format(tmp_path / "run"))
    assert start(program("controller", "sys.exit(3)")) == 0
    # the report waits for it before it ends the launch
    assert controller.read_exit_code(str(tmp_path / "run")) == 0


def test_the_controller_is_not_started_where_another_one_runs(given, program, tmp_path):
    def refuse(own):
        raise ConfigurationError([])
    given("folder:={}".format(tmp_path / "run"))
    assert start(program("controller", "sys.exit(3)"), check=refuse) == 0
    assert controller.read_exit_code(str(tmp_path / "run")) == 0


@pytest.mark.parametrize("text, expected", [(None, None), ("", None), ("3", None), ("3\n", 3),
                                            ("-9\n", -9)])
def test_an_exit_code_counts_when_it_is_written_to_its_end(tmp_path, text, expected):
    if text is not None:
        (tmp_path / controller.EXIT_CODE).write_text(text)
    assert controller.read_exit_code(str(tmp_path)) == expected


def test_a_place_needs_a_name_and_a_location_alone(tmp_path):
    (tmp_path / "places.json"
     ).write_text("""{"exhibits": [{"name": "a", "location": [1, 2, 3], "gesture": [4, 5, 6],
        "description1": "one", "description2": "two"}], "entrance": {"name": "b", "location": [1, 2, 3]},
        "home": {"name": "c", "location": [0, 0, 0]}}""")
    knowledge = load_building(str(tmp_path / "places.json"))
    first, = knowledge.exhibits
    assert (first.description1, first.description2) == ("one", "two")
    assert (first.location, first.gesture) == ((1.0, 2.0, 3.0), (4.0, 5.0, 6.0))
    assert (knowledge.home.gesture, knowledge.home.description1) == ((0.0, 0.0, 0.0), "")


@pytest.mark.slow
@pytest.mark.skipif(importlib.util.find_spec("rospy") is None, reason="needs ROS")
def test_a_node_whose_types_are_not_built_says_so_in_one_line():
    path = os.pathsep.join(
        os.path.join(REPOSITORY, *parts) for parts in (("src", ), ("unit_tests", "src")))
    done = subprocess.run([sys.executable, os.path.join(
                              REPOSITORY, "unit_tests", "nodes", "faceDetection")],
                          env=dict(os.environ, PYTHONPATH=path), timeout=60, stdout=subprocess.PIPE,
                          stderr=subprocess.PIPE, universal_newlines=True)
    assert (done.returncode, done.stdout, done.stderr.count("\n")) == (4, "", 1)
    assert done.stderr.startswith("faceDetection: ") and "cssr_system" in done.stderr
