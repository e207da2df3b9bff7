"""The commands for mission authors: what they print, and their exit codes."""
import importlib.util
import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import py_trees
import pytest
from lxml import etree

from behavior_controller import cli, folders, leaves, replay_cli
from behavior_controller.bt.linter.palette import tree_nodes_model
from behavior_controller.bt.engine.builtins import builtin_specs
from behavior_controller.bt.engine.registry import Direction, Kind, NodeSpec, Port
from behavior_controller.config import settings
from behavior_controller.errors import Fault, FaultsFound
from behavior_controller.missions import load
from behavior_controller.missions.validation import as_json
from behavior_controller.viewer import main as viewer, status_tool

EXECUTABLES = os.path.join(os.path.dirname(os.path.abspath(cli.__file__)))
LAB_TOUR = folders.mission("lab_tour")
GOOD = '<root BTCPP_format="4"><BehaviorTree ID="Main"><Navigate/></BehaviorTree></root>'
BAD = """<root BTCPP_format="4">
<BehaviorTree ID="Main">
<Sequence><Navigat/>
 <Sleep msec="x"/></Sequence></BehaviorTree></root>"""


HEAD = "checked for the robot D5.4.3 ({})\n".format(
    folders.config("behaviorControllerConfiguration.ini"))


def printed(capsys):
    """Return what a check has printed below its first line, which names the robot."""
    head, _, rest = capsys.readouterr().out.partition("\n")
    assert head + "\n" == HEAD
    return rest


@pytest.fixture
def file(tmp_path):
    def write(text, name="m.xml"):
        path = tmp_path / name
        path.write_text(text, encoding="utf-8")
        return str(path)
    return write


MAINS = {"validateMission": cli.validate, "exportNodeModel": cli.export_node_model,
         "missionStatus": status_tool.main, "missionViewer": viewer.main,
         "replayMission": replay_cli.main}


@pytest.mark.slow
@pytest.mark.parametrize("main", MAINS.values(), ids=MAINS)
def test_a_word_that_no_tool_reads_is_refused(main, capsys):
    with pytest.raises(SystemExit) as end:
        main(["missionRun:=1"])
    assert end.value.code == 2 and "missionRun:=1" in capsys.readouterr().err


# ----------------------------------------------------------------------------------------- validate


def test_the_lab_tour_can_be_run(capsys):
    assert cli.validate([LAB_TOUR]) == 0
    assert printed(capsys) == "{}: can be run, 222 nodes, 0 warnings\n".format(LAB_TOUR)


def test_a_mission_of_the_data_folder_is_known_by_its_name(capsys):
    assert cli.validate(["lab_tour"]) == 0
    assert printed(capsys) == "{}: can be run, 222 nodes, 0 warnings\n".format(LAB_TOUR)
    assert cli.validate(["lab_tor"]) == 2
    assert "(did you mean lab_tour?) [unreadable-file]" in printed(capsys)


def test_the_robot_can_be_chosen(capsys):
    assert cli.validate(["release_1_0_tour"]) == 0
    assert printed(capsys).count("[does-without]") == 4
    assert cli.validate(["--interface", "release-1.0", "release_1_0_tour"]) == 0
    out = capsys.readouterr().out
    assert out.startswith("checked for the robot release-1.0 (--interface)\n")
    assert "[does-without]" not in out


def test_a_faulty_configuration_is_told(file, tmp_path, monkeypatch, capsys):
    path = file("scenarioSpecification lab_tour\nverboseMode maybe\n", "c.ini")
    delivered = folders.config
    monkeypatch.setattr(folders, "config",
                        lambda name: path if name == settings.FILE_NAME else delivered(name))
    assert cli.validate([LAB_TOUR]) == 2
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == "checked for the robot D5.4.3 (by default: the configuration has mistakes)"
    assert lines[1].startswith(path + ":2:13: verboseMode cannot be")
    assert lines[3:] == [path + ": 2 errors", LAB_TOUR + ": can be run, 222 nodes, 0 warnings"]


@pytest.mark.parametrize("keys, robot, other", [
    ("robotInterface release-1.0\ntabletSuccessIs yes\nwaitForSpeech all", "release-1.0", "D5.4.3"),
    ("language Kinyarwanda", "D5.4.3", "release-1.0")])
def test_keys_for_the_configured_robot_are_no_mistake_for_a_chosen_one(
        file, monkeypatch, keys, robot, other):
    path = file(f"scenarioSpecification lab_tour\nverboseMode false\nasrEnabled true\n{keys}\n",
                "c.ini")
    delivered = folders.config
    monkeypatch.setattr(folders, "config",
                        lambda name: path if name == settings.FILE_NAME else delivered(name))
    mission = file('<root BTCPP_format="4"><BehaviorTree ID="M"><Sleep msec="5"/></BehaviorTree>'
                   "</root>")
    for chosen in ([], ["--interface", robot], ["--interface", other]):
        assert cli.validate([*chosen, mission]) == 0


def test_json_is_in_the_order_of_places(file, capsys):
    one = '<root BTCPP_format="4"><BehaviorTree ID="M"><Sequence><In/><Slep/>\n<Slep/></Sequence>' \
        "</BehaviorTree></root>"
    paths = [file(one, "b.xml"), file(one, "a.xml")]
    assert cli.validate(["--json"] + paths) == 2
    found = [(os.path.basename(fault["file"]), fault["range"]["start"]["line"], fault["code"],
              fault["text"]) for fault in json.loads(capsys.readouterr().out)]
    assert len(found) == 6 and found == sorted(found)


def test_every_fault_of_every_file_is_printed_with_its_place(file, capsys):
    good, bad = file(GOOD, "good.xml"), file(BAD, "bad.xml")
    assert cli.validate([good, bad, good + "x"]) == 2
    lines = printed(capsys).splitlines()
    for line, (place, code) in zip(lines[:1] + lines[2:4] + lines[5:6],
                                   [(good + ":1:48: warning: ", "never-written"),
                                    (bad + ":3:11: ", "unknown-node"),
                                    (bad + ":4:9: ", "wrong-literal"),
                                    (good + "x: ", "unreadable-file")]):
        assert line.startswith(place) and line.endswith(" [{}]".format(code))
    assert lines[1] == "{}: can be run, 1 node, 1 warning".format(good)
    assert lines[4] == "{}: 2 errors".format(bad)
    assert lines[6:] == ["{}x: 1 error".format(good)]


def test_a_folder_or_fifo_in_place_of_a_mission_is_refused(tmp_path, capsys):
    folder, fifo = tmp_path / "folder.xml", tmp_path / "fifo.xml"
    folder.mkdir()
    os.mkfifo(str(fifo))
    assert cli.validate([str(folder), str(fifo)]) == 2
    lines = printed(capsys).splitlines()
    assert [line.split(":")[0] for line in lines
            if line.endswith("[unreadable-file]")] == [str(folder), str(fifo)]
    assert len(lines) == 4


def test_warnings_alone_are_no_reason_to_refuse(file):
    assert cli.validate([file(GOOD)]) == 0


def test_json_holds_all_that_an_editor_needs(file, capsys):
    bad = file(BAD)
    assert cli.validate(["--json", bad, LAB_TOUR]) == 2
    unknown, literal = json.loads(capsys.readouterr().out)
    text, hint = unknown.pop("text"), unknown.pop("hint")
    assert unknown == {
        "file": bad,
        "range": {"start": {"line": 3, "column": 11},
                  "end": {"line": 3, "column": 19}}, "severity": "error", "code": "unknown-node"}
    assert "Navigat" in text and "Navigate?" in hint
    assert literal["range"] == {"start": {"line": 4, "column": 9}, "end": {"line": 4, "column": 17}}
    assert literal["code"] == "wrong-literal"
    assert cli.validate(["--json", LAB_TOUR]) == 0
    assert json.loads(capsys.readouterr().out) == []


@pytest.mark.parametrize("place, expected", [
    ((3, 5), {"start": {"line": 3, "column": 5}, "end": {"line": 3, "column": 5}}), ((0, 0), None)])
def test_json_of_a_fault_whose_end_or_place_is_not_known(place, expected):
    fault = Fault("places.dat", *place, "odd", "mend it", True)
    assert as_json(fault) == {"file": "places.dat", "range": expected, "severity": "warning",
                              "code": "", "text": "odd", "hint": "mend it"}


def test_arguments_that_ros_adds_are_passed_over(file):
    assert cli.validate(["__name:=validate", file(GOOD), "__log:=x"]) == 0


def test_no_file_is_a_wrong_call(capsys):
    with pytest.raises(SystemExit) as caught:
        cli.validate([])
    assert caught.value.code == 2
    assert "usage: validateMission" in capsys.readouterr().err


# ------------------------------------------------------------------------------------------ palette


def test_the_palette_holds_every_mission_leaf(capsys):
    assert cli.export_node_model([]) == 0
    root = etree.fromstring(capsys.readouterr().out.encode("utf-8"))
    assert (root.tag, root.get("BTCPP_format"), [child.tag for child in root
                                                 ]) == ("root", "4", ["TreeNodesModel"])
    assert [(model.tag, model.get("ID")) for model in root[0]] == [(spec.kind.value, spec.id)
                                                                   for spec in leaves.SPECS]
    assert all(model.find("MetadataFields/Metadata").get("description") for model in root[0])


def test_the_palette_holds_what_is_registered_beside_the_leaves(capsys, monkeypatch):
    ours = NodeSpec("FixtureHurry", Kind.DECORATOR, None)
    monkeypatch.setattr(leaves, "specs", lambda: leaves.SPECS + (ours,))
    assert cli.export_node_model([]) == 0
    root = etree.fromstring(capsys.readouterr().out.encode("utf-8"))
    assert [model.get("ID") for model in root[0]] == [spec.id
                                                      for spec in leaves.SPECS] + ["FixtureHurry"]


def test_ports_have_type_default_and_description():
    spec = NodeSpec("A&B", Kind.ACTION, None, (
        Port("first", "uint", Direction.IN, "1 < 2", "how <long> & why"),
        Port("second", "string", Direction.INOUT), Port("third", "double", Direction.OUT)))
    model = etree.fromstring(tree_nodes_model([spec]))[0]
    assert (model.tag, model.get("ID"), len(model)) == ("Action", "A&B", 3)
    assert [(port.tag, dict(port.attrib), port.text) for port in model
            ] == [("input_port", {"name": "first", "type": "unsigned int",
                                  "default": "1 < 2"}, "how <long> & why"),
                  ("inout_port", {"name": "second", "type": "std::string"}, None),
                  ("output_port", {"name": "third", "type": "double"}, None)]


def test_each_port_of_a_mission_leaf_has_its_type_and_a_description(capsys):
    cli.export_node_model([])
    root = etree.fromstring(capsys.readouterr().out.encode("utf-8"))
    ports = [port for model in root[0] for port in model if port.tag.endswith("_port")]
    assert ports and [port.get("name")
                      for port in ports if not port.get("type") or not port.text] == []


@pytest.mark.slow
def test_a_project_has_the_palette_and_the_missions_of_the_data_folder(tmp_path, capsys):
    path = tmp_path / "projects" / "tours & more.btproj"
    path.parent.mkdir()
    assert cli.export_node_model(["--project", str(path)]) == 0
    missions = sorted(name for name in os.listdir(os.path.dirname(LAB_TOUR))
                      if name.endswith(".xml"))
    assert capsys.readouterr().out == "{}: a project of {}\n".format(path, ", ".join(missions))
    root = etree.parse(str(path)).getroot()
    assert dict(root.attrib) == {"BTCPP_format": "4", "project_name": "tours & more"}
    assert [child.tag for child in root] == len(missions) * ["include"] + ["TreeNodesModel"]
    assert os.path.samefile(
        os.path.join(str(path.parent), root[missions.index("lab_tour.xml")].get("path")), LAB_TOUR)
    assert [model.get("ID") for model in root[-1]] == [spec.id for spec in leaves.SPECS]
    files = [os.path.join(os.path.dirname(LAB_TOUR), name) for name in missions]
    assert [cli.validate([file]) for file in files] == [0] * len(files)
    nodes = sum(map(int, re.findall(r"can be run, (\d+) nodes", capsys.readouterr().out)))
    trees = [etree.parse(file).getroot().get("main_tree_to_execute") for file in files]
    assert cli.validate(["--ignore", "does-without", str(path)]) == 0
    found = re.fullmatch(r"(.*): can be run from each of (.*), (\d+) nodes, 0 warnings\n",
                         printed(capsys))
    assert found and found.group(1) == str(path) and int(found.group(3)) == nodes
    assert sorted(found.group(2).split(", ")) == sorted(trees)


def test_a_project_beside_missions_has_these(file, tmp_path):
    file(GOOD, "mine.xml")
    file("<palette/>", "other.xml")
    path = tmp_path / "p.btproj"
    assert cli.export_node_model(["--project", str(path)]) == 0
    assert re.findall('<include path="(.*)"/>', path.read_text()) == ["mine.xml"]


@pytest.mark.slow
def test_a_file_that_is_no_project_is_not_overwritten(file, tmp_path, capsys):
    project = str(tmp_path / "p.btproj")
    for _ in range(2):  # a project may be written again
        assert cli.export_node_model(["--project", project]) == 0
    for path in (file(GOOD), file(GOOD, "m.btproj"), file("", "empty.btproj")):
        before = Path(path).read_text("utf-8")
        with pytest.raises((SystemExit, FaultsFound)):
            cli.export_node_model(["--project", path])
        assert Path(path).read_text("utf-8") == before


@pytest.mark.parametrize("name", ["new.xml", "new", "p.btproj.xml"])
def test_a_project_is_written_to_no_file_of_another_kind(tmp_path, name, capsys):
    project = tmp_path / name
    for text in (None, '<root BTCPP_format="4" project_name="p"/>'):
        if text is not None:
            project.write_text(text)
        with pytest.raises(SystemExit) as caught:
            cli.export_node_model(["--project", str(project)])
        assert caught.value.code == 2 and ".btproj" in capsys.readouterr().err.splitlines()[-1]
        assert (project.read_text() if project.exists() else None) == text


def test_a_project_has_the_missions_of_other_packages(tmp_path, monkeypatch):
    data = tmp_path / "greeter" / "data"
    data.mkdir(parents=True)
    (data / "greet.xml").write_text(GOOD, encoding="utf-8")
    monkeypatch.setattr(load, "mission_folders", lambda: [folders.data(""), str(data)])
    path = tmp_path / "p.btproj"
    assert cli.export_node_model(["--project", str(path)]) == 0
    assert 'path="{}"'.format(os.path.join("greeter", "data", "greet.xml")) in path.read_text()


@pytest.mark.slow
def test_a_project_that_cannot_be_written_is_one_line(tmp_path):
    done = run("exportNodeModel", "--project", str(tmp_path / "none" / "x.btproj"))
    assert (done.returncode, done.stderr.count(b"\n")) == (1, 1)
    assert done.stderr.startswith(b"exportNodeModel: the output cannot be written: ")
    assert b"x.btproj: No such file" in done.stderr


# What BehaviorTree.CPP 4.10 itself writes of some nodes: kind, and (direction, name, type, default)
# of each port.
OF_THE_LIBRARY = {
    "Delay": ("Decorator", [("input_port", "delay_msec", "unsigned int", None)]),
    "Inverter": ("Decorator", []),
    "LoopDouble": ("Decorator", [("inout_port", "queue", "BT::AnyTypeAllowed", None),
                                 ("input_port", "if_empty", "BT::NodeStatus", "SUCCESS"),
                                 ("output_port", "value", "double", None)]),
    "Parallel": ("Control", [("input_port", "failure_count", "int", "1"),
                             ("input_port", "success_count", "int", "-1")]),
    "Precondition": ("Decorator", [("input_port", "else", "BT::NodeStatus", "FAILURE"),
                                   ("input_port", "if", "std::string", None)]),
    "ScriptCondition": ("Condition", [("input_port", "code", "BT::AnyTypeAllowed", None)]),
    "SetBlackboard": ("Action", [("inout_port", "output_key", "BT::AnyTypeAllowed", None),
                                 ("input_port", "value", "BT::AnyTypeAllowed", None)]),
    "SkipUnlessUpdated": ("Decorator", [("input_port", "entry", "BT::Any", None)]),
    "SubTree": ("SubTree", [("input_port", "_autoremap", "bool", "false")]),
    "TryCatch": ("Control", [("input_port", "catch_on_halt", "bool", "false")])}


def test_built_in_nodes_are_described_as_the_library_does():
    models = {model.get("ID"): model
              for model in etree.fromstring(tree_nodes_model(builtin_specs()))}
    assert OF_THE_LIBRARY == {
        name: (models[name].tag,
               sorted((port.tag, port.get("name"), port.get("type"), port.get("default"))
                      for port in models[name] if port.tag.endswith("_port")))
        for name in OF_THE_LIBRARY}


# ------------------------------------------------------------------------------------------ drawing


def test_a_mission_can_be_drawn():
    root = cli.create_tree()
    assert len(py_trees.display.ascii_tree(root).splitlines()) >= 222
    names = [node.name for node in root.iterate()]
    assert len(names) == len(set(names)) == 222
    assert [name.split(" #")[0] for name in names if name.startswith("Point to")] == [
        "Point to exhibit (PerformDeicticGesture)", "Point to exit (PerformDeicticGesture)"]
    assert root.name == "lab_tour" and not any(":" in name for name in names)


def test_one_tree_of_a_file_can_be_drawn(file):
    root = cli.create_tree(mission="lab_tour", subtree="GoHome")
    assert [root.name] + [child.name for child in root.children] == [
        "GoHome", "Fallback #186", "NavigateToLocation #189"]
    whole = {node.name for node in cli.create_tree().iterate()}
    # the numbers are those of the whole mission
    assert {child.name for child in root.children} < whole
    assert cli.create_tree(mission=file(GOOD)).name == "m"


@pytest.mark.parametrize("arguments, words", [
    ({"mission": "lab_tur"}, "lab_tour?"), ({"subtree": "GoHom"}, " GoHome?")])
def test_what_cannot_be_drawn_is_said_in_a_line(arguments, words):
    with pytest.raises(SystemExit) as caught:
        cli.create_tree(**arguments)
    assert words in str(caught.value.code)


# -------------------------------------------------------------------------------------- executables


def run(name, *arguments, **environment):
    variables = dict(os.environ, PYTHONPATH=os.pathsep.join(path for path in sys.path if path),
                     **environment)
    return subprocess.run([sys.executable, os.path.join(EXECUTABLES, name)] + list(arguments),
                          env=variables, stdout=subprocess.PIPE, stderr=subprocess.PIPE, timeout=60)


@pytest.mark.slow
def test_the_executable_tells_by_its_exit_code(file):
    done = run("validateMission", LAB_TOUR)
    assert (done.returncode, done.stderr) == (0, b"")
    done = run("validateMission", file(BAD))
    assert (done.returncode, done.stderr) == (2, b"")
    assert os.access(os.path.join(EXECUTABLES, "validateMission"), os.X_OK)


@pytest.mark.slow
def test_a_terminal_that_knows_no_umlauts_gets_no_traceback(file):
    done = run("validateMission", file(GOOD.replace("Main", "Hôtel"), "ü.xml"),
               PYTHONIOENCODING="ascii")
    assert (done.returncode, done.stderr) == (0, b"")
    assert b"\\xfc.xml: can be run" in done.stdout


@pytest.mark.slow
def test_the_palette_executable():
    done = run("exportNodeModel")
    assert (done.returncode, done.stderr) == (0, b"") and b'<Action ID="Navigate">' in done.stdout
    assert os.access(os.path.join(EXECUTABLES, "exportNodeModel"), os.X_OK)


# --------------------------------------------------------------------------------- standard streams

TOOLS = {"validateMission": ([LAB_TOUR], 0), "exportNodeModel": ([], 0),
         "replayMission": (["no such record"], 2), "missionStatus": (["--port", "1"], 1),
         "missionViewer": (["--port", "0", "--groot2-port", "0"], 2)}
"""Tool -> arguments, and the exit code in an ordinary terminal."""


def in_shell(tool, redirection, *arguments):
    """Return exit code, standard output and standard error of a tool under a redirection of the
    shell's."""
    script = 'executable=$1; shift; "$0" "$executable" "$@" {}'.format(redirection)
    variables = dict(os.environ, PYTHONUNBUFFERED="",
                     PYTHONPATH=os.pathsep.join(path for path in sys.path if path))
    done = subprocess.run(["sh", "-c", script, sys.executable,
                           os.path.join(EXECUTABLES, tool)] + list(arguments), env=variables,
                          stdout=subprocess.PIPE, stderr=subprocess.PIPE, timeout=60)
    return done.returncode, done.stdout.decode(), done.stderr.decode()


@pytest.mark.slow
@pytest.mark.parametrize("tool, redirection", [
    ("validateMission", ">&-"), ("replayMission", "2>&-"), ("missionViewer", "<&- >&- 2>&-")])
def test_a_closed_stream_changes_nothing_but_what_is_seen(tool, redirection):
    arguments, code = TOOLS[tool]
    found, out, err = in_shell(tool, redirection, *arguments)
    assert found == code
    assert bool(out) == (code == 0 and ">&-" not in redirection.replace("2>&-", ""))
    assert err.count("\n") == (code != 0 and "2>&-" not in redirection)


@pytest.mark.slow
@pytest.mark.parametrize("tool", ["validateMission", "exportNodeModel"])
def test_a_full_disk_is_one_line_and_exit_code_1(tool):
    code, _, err = in_shell(tool, "> /dev/full", *TOOLS[tool][0])
    assert code == 1
    assert err == "{}: the output cannot be written: No space left on device\n".format(tool)
    assert in_shell(tool, "> /dev/full 2>&1", "--help")[0] == 1


@pytest.mark.slow
def test_a_reader_that_goes_away_ends_a_tool_in_silence(file):
    bad = file(BAD)
    # more than a pipe holds
    code, out, err = in_shell("validateMission", "| head -n 1", *[bad] * 500)
    assert (code, out.count("\n"), err) == (0, 1, "")


@pytest.mark.slow
@pytest.mark.parametrize("tool", ["validateMission", "missionViewer"])
def test_a_wrong_call_is_exit_code_2_with_every_stream(tool):
    assert in_shell(tool, "2>&-", "--nonsense") == (2, "", "")


@pytest.mark.slow
@pytest.mark.parametrize("tool", MAINS)
def test_the_version_is_the_manifests(tool, capsys):
    manifest = etree.parse(os.path.join(folders.share(), "package.xml"))
    with pytest.raises(SystemExit):
        MAINS[tool](["--version"])
    assert capsys.readouterr().out == "{} {}\n".format(tool, manifest.findtext("version"))


@pytest.mark.parametrize("tool", TOOLS)
def test_without_the_package_a_tool_names_the_python_in_one_line(tmp_path, tool):
    alone = shutil.copy(os.path.join(EXECUTABLES, tool), str(tmp_path / tool))
    done = subprocess.run([sys.executable, "-S", alone], env={"PATH": os.environ["PATH"]},
                          timeout=60, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                          universal_newlines=True)
    assert (done.returncode, done.stdout, done.stderr.count("\n")) == (1, "", 1)
    assert done.stderr.startswith(tool + ": ") and sys.executable in done.stderr


# -------------------------------------------------------------------------------- an older py_trees

DRAW = "import sys; sys.argv = ['py-trees-render']; import behavior_controller.cli"


def run_with_py_trees(folder, version, arguments):
    """Run Python while a py_trees of that version, which cannot be imported, comes first."""
    package = folder / "py_trees"
    package.mkdir()
    (package / "version.py").write_text("# License: BSD\n__version__ = '{}'\n".format(version))
    (package / "__init__.py").write_text("raise ImportError('this py_trees was taken')\n")
    path = os.pathsep.join([str(folder)] + [path for path in sys.path if path])
    return subprocess.run([sys.executable] + arguments, env=dict(os.environ, PYTHONPATH=path),
                          timeout=60, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                          universal_newlines=True)


@pytest.mark.slow
@pytest.mark.parametrize("command, arguments", [
    ("validateMission", [os.path.join(EXECUTABLES, "validateMission"), LAB_TOUR]),
    ("exportNodeModel", [os.path.join(EXECUTABLES, "exportNodeModel")]),
    ("replayMission", [os.path.join(EXECUTABLES, "replayMission"), "mission.jsonl"]),
    ("behaviorController", [os.path.join(EXECUTABLES, "behaviorController")]),
    ("py-trees-render", ["-c", DRAW])])
def test_an_older_py_trees_is_told_in_one_line(tmp_path, command, arguments):
    if command == "behaviorController" and importlib.util.find_spec("rospy") is None:
        pytest.skip("needs ROS")
    done = run_with_py_trees(tmp_path, "0.7.6", arguments)
    assert (done.returncode, done.stdout, done.stderr.count("\n")) == (1, "", 1)
    assert done.stderr.startswith(
        "{}: py_trees 0.7.6 in {} is found first and too old, 2.2 or newer is needed (".format(
            command, tmp_path / "py_trees"))


@pytest.mark.slow
def test_the_status_in_the_terminal_needs_no_py_trees(tmp_path):
    done = run_with_py_trees(tmp_path, "0.7.6",
                             [os.path.join(EXECUTABLES, "missionStatus"), "--help"])
    assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.slow
@pytest.mark.parametrize("version, is_refused", [
    ("2.1.6", True), ("2.2.0", False), ("2.10.0", False), ("10.0.0", False)])
def test_which_py_trees_is_too_old(tmp_path, version, is_refused):
    done = run_with_py_trees(tmp_path, version, [os.path.join(EXECUTABLES, "exportNodeModel")])
    assert done.returncode == 1
    assert ("too old" in done.stderr, "this py_trees was taken"
            in done.stderr) == (is_refused, not is_refused)
