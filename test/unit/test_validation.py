"""What validateMission makes of the files that an author has: projects, folders, parts, palettes,
other robots."""
import io
import itertools
import os
import re
import shutil
import subprocess
import sys
import threading
import time

import navigator
import pytest

from behavior_controller import cli, folders
from behavior_controller.bt.linter.calls import is_misspelling
from behavior_controller.errors import Fault, MissionError
from behavior_controller.missions.load import load_tree
from behavior_controller.missions.validation import Judgement, Validation, as_json

HEAD = '<root BTCPP_format="4">\n{}\n</root>'
TREE = '<BehaviorTree ID="{}">{}</BehaviorTree>'
LEAF = '<Sleep msec="5"/>'


@pytest.fixture
def file(tmp_path):
    def write(name, *inside):
        path = tmp_path / name
        path.parent.mkdir(exist_ok=True, parents=True)
        path.write_text(HEAD.format("\n".join(inside)), encoding="utf-8")
        return str(path)
    return write


def judged(*paths, **options):
    return list(Validation(**options).judge(paths))


def told(*paths, **options):
    """Return file name, line and code of every fault and warning."""
    return [(os.path.basename(fault.file), fault.line, fault.code)
            for judgement in judged(*paths, **options) for fault in judgement.faults]


def said(*paths, **options):
    """Return the lines that sum up, with file names instead of paths."""
    return [str(judgement).replace(os.path.dirname(judgement.file) + os.sep, "")
            for judgement in judged(*paths, **options)]


def test_a_mission_is_checked_with_the_knowledge_that_it_has_of_its_own(file):
    path = file("release_1_0_reception.xml", TREE.format("M", '<SayText name="8"/>'))
    fault, = judged(path, robot="release-1.0")[0].faults
    assert folders.data("release_1_0_reception_cultureKnowledgeBase.dat") in fault.hint


# ------------------------------------------------------------------------------ a robot's own nodes


@pytest.mark.slow
def test_the_trees_of_a_navigator_are_clean_with_its_palette(tmp_path):
    palette, trees = navigator.write(tmp_path)
    found = judged(*trees, palettes=[palette])
    assert len(trees) == 15 and len(found) == 16
    assert [fault for judgement in found for fault in judgement.faults] == []
    assert found[0].palette == len(navigator.PALETTE) == 60
    assert all(judgement.stubs and judgement.nodes for judgement in found[1:])


@pytest.mark.slow
def test_a_folder_with_a_palette_is_checked_with_it(tmp_path):
    navigator.write(tmp_path)
    assert len(judged(str(tmp_path))) == 16 and told(str(tmp_path)) == []


def test_without_the_palette_its_nodes_are_unknown(tmp_path):
    _, trees = navigator.write(tmp_path)
    assert {code for _, _, code in told(trees[0])} == {"unknown-node"}


@pytest.mark.slow
@pytest.mark.parametrize("old, new, code", [
    ('path="{path}" controller', 'pfad="{path}" controller', "unknown-port"),
    ('<FollowPath path="{path}"', '<FollowPath path="{paht}"', "never-written"),
    ("<GoalUpdated/>", "<GoalUpdatet/>", "unknown-node"),
    ('<SpinInPlace angle="1.57" error="{spin_error}"/>',
     '<SpinInPlace angle="1.57"><GoalUpdated/></SpinInPlace>', "leaf-children"),
    ('<AtRate hertz="1.0">', '<AtRate hertz="1.0"><GoalUpdated/>', "decorator-children"),
    ('planner="{selected_planner}"', 'planner="{selected_planner"', "braces-odd")])
def test_mistakes_with_stubs_are_told(tmp_path, old, new, code):
    palette, _ = navigator.write(tmp_path)
    path = tmp_path / "to_pose.xml"
    text = path.read_text(encoding="utf-8")
    path.write_text(text.replace(old, new, 1), encoding="utf-8")
    line = text[:text.index(old)].count("\n") + 1
    assert (path.name, line, code) in told(str(path), palettes=[palette])
    assert {found[1] for found in told(str(path), palettes=[palette])} == {line}


def test_what_the_robot_provides_is_not_asked_for(file):
    path = file("m.xml", TREE.format("Main", '<FixtureDrive goal="{goal}"/>'),
                '<TreeNodesModel><Action ID="FixtureDrive"><input_port '
                'name="goal"/></Action></TreeNodesModel>')
    assert told(path) == []
    assert said(path) == [
        "m.xml: checked, 1 node, 0 warnings; not a mission of this robot, which lacks 1 node type "
        "(taken as stubs): FixtureDrive"]


# the node types of another robot that has some of our names: a workshop's, and a football team's
THEIRS = """<TreeNodesModel>
  <Action ID="Navigate"><input_port name="target" type="std::string"/>
    <input_port name="action_name" type="std::string" default=""/></Action>
  <Action ID="SetRobotPose"><input_port name="x" type="double"/><input_port name="y"/></Action>
  <Condition ID="WelcomeSpeech"/>
</TreeNodesModel>"""
TREE_OF_THEIRS = TREE.format("Main", """<Sequence><Navigate target="office"/>
  <SetRobotPose x="{start_x}" y="-3,5"/><WelcomeSpeech/></Sequence>""")
SUM_OF_THEIRS = ("{}: checked, 4 nodes, 3 warnings; not a mission of this robot, which lacks 3 "
                 "node types (taken as stubs): Navigate, SetRobotPose, WelcomeSpeech; defined by "
                 "the palette, not as here: Navigate, SetRobotPose, WelcomeSpeech")


def test_a_type_that_the_file_itself_defines_otherwise_is_another_robot_s(file):
    path = file("m.xml", TREE_OF_THEIRS, THEIRS)
    assert told(path) == [("m.xml", line, "palette-other-node") for line in (5, 7, 8)]
    assert said(path) == [SUM_OF_THEIRS.format("m.xml")] and not judged(path)[0].is_wrong


def test_a_type_that_a_palette_or_a_project_defines_otherwise_is_another_robot_s(file):
    path, palette = file("m.xml", TREE_OF_THEIRS), file("p.xml", THEIRS)
    assert "wrong-literal" in {code for _, _, code in told(path)}
    assert said(path, palettes=[palette])[-1] == SUM_OF_THEIRS.format("m.xml")
    project = file("p.btproj", '<include path="m.xml"/>', THEIRS)
    assert said(project) == [SUM_OF_THEIRS.format("p.btproj")]


def test_a_mission_with_another_robot_s_definition_of_a_node_is_not_run(file):
    path = file("m.xml", TREE.format("Main", "<Navigate/>"), THEIRS)
    with pytest.raises(MissionError) as caught:
        load_tree(path)
    fault, = caught.value.faults
    assert (fault.line, fault.code, fault.is_warning) == (4, "palette-other-node", False)


@pytest.mark.parametrize("model", [
    '<Action ID="Navigate"/>', '<Action ID="Navigate"><input_port name="target" type="Location"/>'
    '</Action>', '<Decorator ID="Timeout"><input_port name="seconds"/></Decorator>',
    '<Action ID="NavigateAsync"><input_port name="other"/></Action>'])
def test_a_model_with_fewer_ports_or_of_the_library_or_not_in_use_is_no_other_one(file, model):
    body = '<Timeout msec="9000"><Navigate target="1;2;3"/></Timeout>'
    path = file("m.xml", TREE.format("Main", body),
                "<TreeNodesModel>{}</TreeNodesModel>".format(model))
    assert "palette-other-node" not in {code for _, _, code in told(path)}
    assert load_tree(path).root.name == "Timeout"


def test_words_of_scripts_that_another_robot_may_know_are_no_fault_of_its_missions(file):
    body = ('<Sequence><FixtureDrive/><Script code="colour := RED"/>'
            '<Script code="n := abs(colour)"/><ScriptCondition code="colour == SUCCESS"/>'
            '</Sequence>')
    path = file("m.xml", TREE.format("Main", body),
                '<TreeNodesModel><Action ID="FixtureDrive"/></TreeNodesModel>')
    assert not judged(path)[0].is_wrong
    body = body.replace("<FixtureDrive/>", "")
    assert judged(file("m.xml", TREE.format("Main", body)))[0].is_wrong


@pytest.mark.parametrize("count, rest", [(20, ""), (21, ", …")])
def test_of_many_stubs_the_first_are_named(count, rest):
    names = tuple("Node{}".format(number) for number in range(1, count + 1))
    assert str(Judgement("m.xml", nodes=30, stubs=names)) == (
        "m.xml: checked, 30 nodes, 0 warnings; not a mission of this robot, which lacks {} node "
        "types (taken as stubs): {}{}".format(count, ", ".join(names[:20]), rest))


@pytest.mark.parametrize("port, is_told", [
    ('<input_port name="speed"/>', False),
    ('<input_port name="speed" optional="true"/>', False),
    ('<input_port name="speed" optional="false"/>', True),
    ('<input_port name="goal" optional="true"/><input_port name="speed"/>', True),
    ('<input_port name="goal" optional="true"/><input_port name="speed" default="1"/>', False)])
def test_ports_of_a_palette_may_be_optional(file, port, is_told):
    path = file(
        "m.xml", TREE.format("Main", "<FixtureDrive/>"),
        '<TreeNodesModel><Action ID="FixtureDrive">{}</Action></TreeNodesModel>'.format(port))
    assert told(path) == [("m.xml", 2, "port-missing")] * is_told


@pytest.mark.parametrize("type_name, value, codes", [
    ("unsigned int", "2 min", ["number-cut-short"]), ("int", "fast", ["wrong-literal"]),
    ("double", "2,5", ["number-cut-short"]), ("bool", "yes", ["wrong-literal"]),
    ("geometry_msgs::Pose", "1;2", []), ("std::string", "2 min", [])])
def test_types_of_a_palette_are_those_of_the_library(file, type_name, value, codes):
    path = file("m.xml", TREE.format("Main", '<FixtureDrive how="{}"/>'.format(value)),
                '<TreeNodesModel><Action ID="FixtureDrive"><input_port name="how" '
                'type="{}"/></Action></TreeNodesModel>'.format(type_name))
    assert [code for _, _, code in told(path)] == codes


def test_a_stub_that_is_nearly_a_node_of_ours_is_pointed_out(file):
    path = file("m.xml", TREE.format("Main", "<WelcomSpeech/>"),
                '<TreeNodesModel><Action ID="WelcomSpeech"/></TreeNodesModel>')
    assert told(path) == [("m.xml", 3, "palette-unknown-node")]


def test_what_an_older_version_had_is_no_stub(file):
    path = file("m.xml", TREE.format("Main", "<SequenceStar>{}</SequenceStar>".format(LEAF)),
                '<TreeNodesModel><Control ID="SequenceStar"/></TreeNodesModel>')
    assert [code for _, _, code in told(path)] == ["unknown-node"]


@pytest.mark.parametrize("word, other, is_so", [
    ("paht", "path", True), ("pat", "path", True), ("paath", "path", True), ("bath", "path", True),
    ("goal", "goals", False), ("pose1", "pose2", False), ("goal", "path", False),
    ("path", "path", False), ("apth", "path", True), ("goal_pose", "pose", False)])
def test_what_is_a_misspelling(word, other, is_so):
    assert is_misspelling(word, other) is is_so


def test_a_misspelling_is_one_edit():
    words = {"".join(letters) for length in range(5)
             for letters in itertools.product("abc", repeat=length)}
    for word in words:
        edits = set()
        for at in range(len(word) + 1):
            begin, rest = word[:at], word[at:]
            edits |= {begin + letter + rest
                      for letter in "abc"} | {begin + rest[1:], begin + rest[1::-1] + rest[2:]}
            edits |= {begin + letter + rest[1:] for letter in "abc" if rest}
        assert {other for other in words if is_misspelling(word, other)} == edits & words - {word}


@pytest.mark.parametrize(
    "inside, codes",
    [
        # a robot's entries are its own, but this is near
        ('<Out out="{abcd}"/><FixtureDrive goal="{abce}"/>', ["never-written"]),
        ('<Out out="{abc}"/><FixtureDrive goal="{abd}"/>', []),
        ('<Out out="{abcd}"/><FixtureDrive goal="{wxyz}"/>', []),
        ('<Out out="{abcd}"/><FixtureDrive goal="abcd"/>', []),
        ('<Script code="count = 1"/><FixtureDrive/>', []),
        ('<Script code="1 == 1"/><FixtureDrive/>', ["script-no-effect"])])
def test_what_is_said_of_entries_in_a_mission_for_another_robot(file, inside, codes):
    models = ('<Action ID="Out"><output_port name="out"/></Action>'
              '<Action ID="FixtureDrive"><input_port name="goal"/></Action>')
    path = file("m.xml", TREE.format("Main", "<Sequence>{}</Sequence>".format(inside)),
                "<TreeNodesModel>{}</TreeNodesModel>".format(models))
    assert [code for _, _, code in told(path)] == codes


# ----------------------------------------------------------------------- files that belong together


def test_an_included_file_is_judged_as_a_part(file):
    # nothing says which is its main tree
    part = file("part.xml", TREE.format("A", LEAF), TREE.format("B", LEAF))
    whole = file("whole.xml", '<include path="part.xml"/>',
                 TREE.format("Main", '<SubTree ID="A"/>'))
    assert told(part) == [("part.xml", 1, "main-tree-missing")]
    assert said(part, whole) == [
        "part.xml: a part of whole.xml", "whole.xml: can be run, 2 nodes, 0 warnings"]
    validation = Validation()
    assert len(list(validation.judge([whole]))) == 1
    assert {part, whole} < validation.files


def test_files_that_include_each_other_are_no_parts(file):
    one = file("one.xml", '<include path="two.xml"/>', TREE.format("A", LEAF))
    two = file("two.xml", '<include path="one.xml"/>', TREE.format("B", LEAF))
    assert {code for _, _, code in told(one, two)} == {"include-circle"}
    assert len(judged(one, two)) == 2


def test_each_tree_of_a_project_that_no_other_calls_is_a_main_tree(file):
    file("a.xml", TREE.format("A", '<SubTree ID="C"/>'))
    file("b.xml", TREE.format("B", '<Sequence>{}<Slep/></Sequence>'.format(LEAF)),
         TREE.format("C", LEAF))
    project = file("p.btproj", '<include path="a.xml"/>', '<include path="b.xml"/>')
    assert told(project) == [("b.xml", 2, "unknown-node")]
    file("b.xml", TREE.format("B", LEAF), TREE.format("C", LEAF))
    assert said(project) == ["p.btproj: can be run from each of A, B, 3 nodes, 0 warnings"]
    assert said(project, main="A") == ["p.btproj: can be run, 2 nodes, 0 warnings"]
    assert said(file("q.btproj", '<include path="a.xml"/>',
                     '<include path="c.xml"/>')) == ["q.btproj: 1 error"]
    file("c.xml", TREE.format("C", LEAF))
    assert said(file("q.btproj", '<include path="a.xml"/>', '<include path="c.xml"/>')) == [
        "q.btproj: can be run, 2 nodes, 0 warnings"]


def test_a_project_may_say_which_tree_is_the_main_one(file):
    file("a.xml", TREE.format("A", LEAF), TREE.format("B", LEAF))
    project = file("p.btproj", '<include path="a.xml"/>')
    assert said(project) == ["p.btproj: can be run from each of A, B, 2 nodes, 0 warnings"]
    with open(project, "w", encoding="utf-8") as opened:
        opened.write(
            '<root BTCPP_format="4" main_tree_to_execute="A"><include path="a.xml"/></root>')
    assert said(project) == ["p.btproj: can be run, 1 node, 0 warnings"]


def test_the_palette_of_a_project_is_that_of_its_files(file):
    file("a.xml", TREE.format("A", "<FixtureDrive/>"))
    project = file("p.btproj", '<include path="a.xml"/>',
                   '<TreeNodesModel><Action ID="FixtureDrive"/></TreeNodesModel>')
    assert told(project) == []


def test_a_palette_may_be_in_the_file_of_another_mission(file):
    robot = file("robot.xml", TREE.format("X", LEAF),
                 '<TreeNodesModel><Action ID="FixtureDrive"/></TreeNodesModel>')
    path = file("m.xml", TREE.format("Main", "<FixtureDrive/>"))
    assert [code for _, _, code in told(robot, path)] == ["unknown-node"]
    assert [os.path.basename(judgement.file)
            for judgement in judged(path, palettes=[robot])] == ["m.xml"]
    assert told(path, palettes=[robot]) == []


def test_the_main_tree_may_be_chosen(file):
    path = file("m.xml", TREE.format("A", LEAF),
                TREE.format("B", "<Sequence>{0}{0}</Sequence>".format(LEAF)))
    assert said(path) == ["m.xml: 1 error"]
    assert said(path, main="C") == ["m.xml: 1 error"]
    assert told(path, main="B") == [("m.xml", 2, "tree-unused")]
    assert told(path, main="C") == [("m.xml", 1, "main-tree-unknown")]


def test_a_folder_is_all_missions_in_it(file, tmp_path):
    file("a.xml", TREE.format("A", LEAF))
    file("inner/b.xml", TREE.format("B", LEAF))
    (tmp_path / "package.xml").write_text("<package><name>x</name></package>")
    (tmp_path / "notes.txt").write_text("<root>")
    (tmp_path / ".git").mkdir()
    file(".git/c.xml", TREE.format("C", LEAF))
    assert [os.path.basename(judgement.file)
            for judgement in judged(str(tmp_path))] == ["a.xml", "b.xml"]
    (tmp_path / "latin.xml").write_bytes(HEAD.format(TREE.format("Café", LEAF)).encode("latin-1"))
    assert told(str(tmp_path)) == [("latin.xml", 2, "not-text")]


def test_trees_are_found_in_the_files_beside_only_when_asked(file):
    path = file("m.xml", TREE.format("Main", '<Sequence><SubTree ID="A"/></Sequence>'))
    file("other.xml", TREE.format("A", '<SubTree ID="B"/>'), TREE.format("Main", "<Slep/>"))
    file("third.xml", TREE.format("B", LEAF))
    assert told(path) == [("m.xml", 2, "unknown-tree")]
    assert said(path, in_folder=True) == ["m.xml: can be run, 4 nodes, 0 warnings"]
    file("third.xml", TREE.format("B", "<FixtureDrive/>"),
         '<TreeNodesModel><Action ID="FixtureDrive"/></TreeNodesModel>')
    assert said(path, in_folder=True) == [
        "m.xml: checked, 4 nodes, 0 warnings; not a mission of this robot, which lacks 1 "
        "node type (taken as stubs): FixtureDrive"]


def test_a_mission_that_lends_trees_to_another_is_judged_itself(file, tmp_path):
    file("a.xml", TREE.format("A", '<SubTree ID="Common"/>'))
    main = TREE.format("B", '<Sequence><SubTree ID="Common"/><Slep/></Sequence>')
    file("b.xml", main, TREE.format("Common", LEAF))
    assert said(str(tmp_path), in_folder=True) == [
        "a.xml: can be run, 2 nodes, 0 warnings", "b.xml: 1 error"]
    assert told(str(tmp_path), in_folder=True) == [("b.xml", 2, "unknown-node")]
    file("b.xml", TREE.format("B", LEAF), TREE.format("Common", LEAF))
    assert said(str(tmp_path), in_folder=True)[1] == "b.xml: can be run, 1 node, 0 warnings"
    file("b.xml", TREE.format("Common", LEAF))
    assert said(str(tmp_path), in_folder=True)[1] == "b.xml: a part of a.xml"


def test_a_mission_by_its_main_tree_is_judged_itself_though_all_its_trees_are_lent(file, tmp_path):
    file("a.xml", TREE.format("A", '<SubTree ID="B"/>'))
    (tmp_path / "b.xml").write_text(
        '<root BTCPP_format="4" main_tree_to_execute="B">' + TREE.format("B", LEAF) + "</root>")
    assert said(str(tmp_path), in_folder=True)[1] == "b.xml: can be run, 1 node, 0 warnings"


def test_each_tree_that_no_other_takes_from_a_library_is_a_main_tree(file, tmp_path):
    file("a.xml", TREE.format("A", '<Sequence><SubTree ID="C"/><SubTree ID="Own"/></Sequence>'),
         TREE.format("Own", LEAF))
    lent = TREE.format("C", '<SubTree ID="D"/>') + TREE.format("D", LEAF)
    file("lib.xml", lent, TREE.format("E", LEAF), TREE.format("F", LEAF))
    assert said(str(tmp_path), in_folder=True) == [
        "a.xml: can be run, 6 nodes, 0 warnings",
        "lib.xml: can be run from each of E, F, 2 nodes, 0 warnings"]
    file("lib.xml", lent, TREE.format("Own", "<Slep/>"))  # which a.xml does not take
    assert told(str(tmp_path), in_folder=True) == [("lib.xml", 3, "unknown-node")]


def test_a_tree_is_taken_from_the_file_of_its_caller_before_others(file):
    path = file("m.xml", TREE.format("M", '<SubTree ID="A"/>'))
    file("first.xml", TREE.format("B", "<Slep/>"))
    file("second.xml", TREE.format("A", '<SubTree ID="B"/>'), TREE.format("B", LEAF))
    assert said(path, in_folder=True) == ["m.xml: can be run, 3 nodes, 0 warnings"]


def test_a_file_of_a_ros_package_is_included(file, tmp_path, monkeypatch):
    file("src/deep/robot/trees/part.xml", TREE.format("A", LEAF))
    (tmp_path /
     "src/deep/robot/package.xml").write_text("<package>\n <name> my_robot </name></package>")
    path = file("m.xml", '<include ros_pkg="my_robot" path="trees/part.xml"/>',
                TREE.format("Main", '<SubTree ID="A"/>'))
    monkeypatch.setenv("ROS_PACKAGE_PATH", os.pathsep.join(["/nowhere", str(tmp_path / "src")]))
    assert said(path) == ["m.xml: can be run, 2 nodes, 0 warnings"]
    monkeypatch.delenv("ROS_PACKAGE_PATH")
    assert told(path) == [("m.xml", 2, "include-package")]


def test_a_file_with_nothing_but_a_palette_is_one(file):
    path = file(
        "p.xml",
        '<TreeNodesModel><Action ID="FixtureDrive"/><Control ID="Both"/><Action/></TreeNodesModel>')
    assert said(path) == ["p.xml: a palette of 3 node types, 1 warning"]
    assert told(path) == [("p.xml", 2, "id-missing")]


def test_of_a_port_that_a_palette_has_twice_the_first_counts(file):
    model = ('<TreeNodesModel><Action ID="FixtureDrive"><input_port name="far" type="int"/>'
             '<output_port name="far"/><input_port name="to"/></Action></TreeNodesModel>')
    assert said(file("p.xml", model)) == ["p.xml: a palette of 1 node type, 1 warning"]
    path = file("m.xml", TREE.format("Main", '<FixtureDrive far="5" to="x"/>'), model)
    assert told(path) == [("m.xml", 3, "palette-port")]


def test_a_palette_is_compared_with_the_node_types_that_there_are(file):
    path = file("p.xml", '<TreeNodesModel><Condition ID="Sleep"/></TreeNodesModel>')
    assert told(path) == [("p.xml", 2, "palette-kind")]


def test_a_palette_that_cannot_be_read_is_told(tmp_path, file):
    path = file("m.xml", TREE.format("Main", LEAF))
    assert told(path, palettes=[str(tmp_path / "none.xml")]) == [("none.xml", 0, "unreadable-file")]


# -------------------------------------------------------------------------------------- the command


def test_a_warning_may_be_left_out_and_a_fault_not(file, capsys):
    path = file("m.xml", TREE.format("Main", '<Sequence><Sleep msec="2 min"/></Sequence>'))
    assert cli.validate(["--ignore", "number-cut-short", path]) == 0
    assert capsys.readouterr().out.endswith("\n{}: can be run, 2 nodes, 0 warnings\n".format(path))
    path = file("m.xml", TREE.format("Main", "<Slep/>"))
    assert cli.validate(["--ignore", "unknown-node", path]) == 2


def test_faults_and_warnings_are_counted_apart(file):
    path = file("m.xml", TREE.format("Main", '<Sequence><Slep/><Sleep msec="2 min"/></Sequence>'))
    assert said(path) == ["m.xml: 1 error, 1 warning"]


def test_a_code_that_does_not_exist_is_a_wrong_call(capsys):
    with pytest.raises(SystemExit) as caught:
        cli.validate(["--ignore", "number-cut-shor", "m.xml"])
    assert caught.value.code == 2
    assert "there is no code number-cut-shor (did you mean number-cut-short?)" in capsys.readouterr(
    ).err


def test_no_delivered_mission_has_a_warning(capsys):
    assert cli.validate([folders.data("")]) == 0
    assert ", 0 warnings\n" in capsys.readouterr().out


LIMIT = 30.0  # seconds


@pytest.mark.slow
def test_a_file_is_checked_again_at_each_save(file, tmp_path):
    file("part.xml", TREE.format("A", "<Slep/>"))
    path = file("m.xml", '<include path="part.xml"/>', TREE.format("Main", '<SubTree ID="A"/>'))
    executable = os.path.join(os.path.dirname(os.path.abspath(cli.__file__)), "validateMission")
    variables = dict(os.environ, PYTHONPATH=os.pathsep.join(filter(None, sys.path)))
    variables.pop("PYTHONUNBUFFERED", None)  # in a pipe, too, each check is shown when it is made
    process = subprocess.Popen([sys.executable, executable, "--watch", path], env=variables,
                               stdout=subprocess.PIPE, universal_newlines=True)
    limit = threading.Timer(LIMIT, process.kill)
    limit.start()

    def line():
        text = process.stdout.readline()
        return process.stdout.readline() if text.startswith("checked for") else text

    try:
        assert line().endswith(" [unknown-node]\n")
        assert line() == "{}: 1 error\n".format(path)
        os.replace(file("saved", TREE.format("A", LEAF)), str(tmp_path / "part.xml"))
        assert line() == "{}: can be run, 2 nodes, 0 warnings\n".format(path)
        os.replace(file("saved", TREE.format("Main", LEAF)), path)
        assert line() == "{}: can be run, 1 node, 0 warnings\n".format(path)
        os.remove(path)
        assert "cannot be read" in line()
        assert line() == "{}: 1 error\n".format(path)
        os.mkdir(path)
        assert "the folder has no mission" in line()
    finally:
        limit.cancel()
        process.kill()
        process.communicate()


class Stopped(Exception):
    """Ends the watch, as Ctrl-C does."""


def save(file, part):
    file(part, TREE.format("A", "<Slep/>"))


def save_with_the_old_time(file, part):
    """As a checkout, or an editor that keeps the time, does."""
    os.utime(file(part, TREE.format("A", LEAF.replace("1", "2"))), ns=(1, 1))


def move_an_older_file_there(file, part):
    older = file("older", TREE.format("A", "<Slep/>"))
    os.utime(older, ns=(1, 1))
    os.replace(older, os.path.join(os.path.dirname(older), part))


@pytest.mark.slow
@pytest.mark.parametrize("change, checks", [
    (lambda file, part: None, 1), (save, 2), (save_with_the_old_time, 2),
    (move_an_older_file_there, 2)])
@pytest.mark.parametrize("part", ["part.xml", "m.xml"])
def test_what_is_saved_while_it_is_read_is_checked_again_at_once(file, monkeypatch, part, change,
                                                                 checks):
    file("part.xml", TREE.format("A", LEAF))
    path = file("m.xml", '<include path="part.xml"/>', TREE.format("Main", '<SubTree ID="A"/>'))
    os.utime(path, ns=(1, 1))
    time.sleep(2 * cli._CLOCK_STEP)
    shown, results = io.BytesIO(), []
    check = cli._judge_all

    def check_and_save(options):
        results.append(check(options))
        if len(results) == 1:
            change(file, part)
        return results[-1]

    def wait(seconds):
        if seconds == cli._WATCH_EVERY:
            raise Stopped
        pause(seconds)

    pause = time.sleep
    monkeypatch.setattr(cli, "_judge_all", check_and_save)
    monkeypatch.setattr(cli.time, "sleep", wait)
    monkeypatch.setattr(sys, "stdout", io.TextIOWrapper(shown, encoding="utf-8"))
    with pytest.raises(Stopped):
        cli.validate(["--watch", path])
    assert len(results) == checks
    assert shown.getvalue() != b""  # although the buffer is not full


@pytest.fixture
def watched(monkeypatch, tmp_path):
    """Return the exit code of each check of ``validateMission --watch``, if a change follows each,
    until the changes end. Configuration and data are in the folder ``share``."""
    for name in ("config", "data"):
        shutil.copytree(getattr(folders, name)(""), str(tmp_path / "share" / name))
    monkeypatch.setattr(folders, "share", lambda *_: str(tmp_path / "share"))
    check, pause = cli._judge_all, time.sleep

    def codes(argument, *changes):
        coming, results = iter(changes), []

        def wait(seconds):
            pause(min(seconds, cli._CLOCK_STEP))
            if seconds == cli._WATCH_EVERY:
                change = next(coming, None)
                if change is None:
                    raise Stopped
                change()

        def noted(options):
            results.append(check(options))
            return results[-1]

        monkeypatch.setattr(cli, "_judge_all", noted)
        monkeypatch.setattr(cli.time, "sleep", wait)
        with pytest.raises(Stopped):
            cli.validate(["--watch", argument])
        return [code for code, _ in results]
    return codes


def test_an_included_file_that_is_mended_is_checked_again(file, watched):
    path = file("m.xml", '<include path="part.xml"/>', TREE.format("Main", '<SubTree ID="A"/>'))
    assert watched(path, lambda: file("part.xml", "<BehaviorTree"),
                   lambda: file("part.xml", TREE.format("A", LEAF))) == [2, 2, 0]


def test_the_mission_of_a_name_that_is_mended_is_checked_again(file, watched):
    assert watched("own", lambda: file("share/data/own.xml", "<BehaviorTree"),
                   lambda: file("share/data/own.xml", TREE.format("A", LEAF))) == [2, 2, 0]


@pytest.mark.parametrize("name, line", [
    ("config/behaviorControllerConfiguration.ini", "startBy operator"),
    ("config/recoveryPolicy.ini", "whatever"), ("data/phrases_English.ini", "whatever")])
def test_files_of_the_robot_that_are_mended_are_checked_again(file, watched, tmp_path, name, line):
    robot_file = tmp_path / "share" / name
    right = robot_file.read_text(encoding="utf-8")
    wrong = re.sub(r"^startBy.*", "", right, flags=re.MULTILINE) + line + "\n"
    assert watched(file("m.xml", TREE.format("Main", LEAF)), lambda: robot_file.write_text(wrong),
                   lambda: robot_file.write_text(right)) == [0, 2, 0]


@pytest.mark.slow
def test_what_is_left_of_9000_nodes_is_not_searched_for_garbage_at_the_end(file):
    part = ('<Sequence><Script code="n := {0}"/><Fallback><Navigate _skipIf="n == {0}"/>'
            '<HandleFallBack/></Fallback><Timeout msec="20000"><Sleep msec="{0}"/></Timeout>'
            '<SetBlackboard output_key="last" value="x{0}"/></Sequence>')
    path = file("m.xml", TREE.format("Main", "<Sequence>{}</Sequence>".format(
        "".join(map(part.format, range(1125))))))
    assert said(path) == ["m.xml: can be run, 9001 nodes, 1 warning"]
    code = ("import atexit, gc; from behavior_controller import command; "
            "atexit.register(lambda: print(gc.get_freeze_count())); "
            "command.run('validateMission', 'behavior_controller.cli', 'validate')")
    done = subprocess.run([sys.executable, "-c", code, path], stdout=subprocess.PIPE, check=True,
                          env=dict(os.environ, PYTHONPATH=os.pathsep.join(filter(None, sys.path))))
    assert int(done.stdout.split()[-1]) > 10_000


# ----------------------------------------------------------------------- files that are no missions


def test_the_phrases_that_a_mission_has_of_its_own_are_checked_with_it(file, monkeypatch):
    mission, other = file("greeting.xml", TREE.format("Main", LEAF)), file(
        "other.xml", TREE.format("Main", LEAF))
    own = file("greeting_phrases_English.ini", "WelcomeSpeech")
    monkeypatch.setattr(folders, "of_mission",
                        lambda path, name: own if name == "greeting" else path)
    assert {name for name, _, _ in told(mission)} == {"greeting_phrases_English.ini"}
    assert told(other) == []


@pytest.mark.parametrize("place, end", [((4, 7), (4, 7)), ((2, 9), (2, 9)), ((0, 0), (2, 3))])
def test_a_fault_in_json_has_its_range_as_far_as_it_is_known(place, end):
    fault = Fault("m.xml", 2, 3, "odd", "mend it", True, "code", *place)
    assert as_json(fault) == {
        "file": "m.xml", "range": {"start": {"line": 2, "column": 3},
                                   "end": {"line": end[0], "column": end[1]}},
        "severity": "warning", "code": "code", "text": "odd", "hint": "mend it"}
    assert as_json(Fault("m.xml", 0, 0, "odd")) == {
        "file": "m.xml", "range": None, "severity": "error", "code": "", "text": "odd", "hint": ""}


def test_a_palette_without_node_types_is_told(file):
    path = file("p.xml", "<TreeNodesModel/>")
    assert told(path) == [("p.xml", 2, "palette-empty")]
    assert said(path) == ["p.xml: a palette of 0 node types, 1 warning"]
    assert told(file("m.xml", TREE.format("Main", LEAF), "<TreeNodesModel/>")) == []


@pytest.mark.parametrize("name, text", [("", ""), ("notes.txt", "<root/>"), ("a.xml", "<robot/>")])
def test_a_folder_without_a_mission_is_a_fault(tmp_path, name, text):
    if name:
        (tmp_path / name).write_text(text, encoding="utf-8")
    judgement, = judged(str(tmp_path))
    fault, = judgement.faults
    assert judgement.is_wrong and "the folder has no mission" in fault.text
    assert fault[:3] == (str(tmp_path), 0, 0)  # a folder has no line
