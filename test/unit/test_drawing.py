"""py-trees-render draws a mission from any folder, without ROS, so that each node can be told apart."""
import os
import re
import shutil
import subprocess
import sys
from xml.etree import ElementTree

import py_trees
import pytest

from behavior_controller.cli import create_tree
from behavior_controller.leaves import data
from behavior_controller.mission_spec import whole_mission
from behavior_controller.watch import drawing
from behavior_controller.watch.drawing import svg
from mission_rig import one_leaf

SOURCES = os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "..", "src")


def dot(root, level="ALL"):
    level = getattr(py_trees.common.VisibilityLevel, level)
    return py_trees.display.dot_tree(root, visibility_level=level)


def test_every_node_of_the_lab_tour_is_drawn_once_with_a_label_of_its_own():
    labels = [node.get_label().strip('"') for node in dot(create_tree("lab_tour")).get_node_list() if node.get_label()]
    assert len(labels) == len(set(labels)) == 216
    assert {"lab_tour", "Navigate #101", "UntilMutualGaze (ReactiveFallback) #35", "GiveTour #73"} <= set(labels)
    # in the dot language what follows a colon is not part of the name: the edges would miss their nodes
    assert not any(":" in label for label in labels)


@pytest.mark.skipif(shutil.which("dot") is None, reason="graphviz is not installed")
def test_what_is_below_a_node_that_is_left_out_hangs_below_the_nearest_one_above_in_the_same_order():
    rig = one_leaf("<Sequence><Sleep name='a' msec='1'/><Fallback><Inverter><Sleep name='b' msec='1'/></Inverter>"
                   "<Sleep name='c' msec='1'/></Fallback><Sleep name='d' msec='1'/></Sequence>")
    drawn = ElementTree.fromstring(svg(rig.tree, "root", {3, 4}))
    edges = [title.text.split("->") for title in drawn.iter("{http://www.w3.org/2000/svg}title") if "->" in title.text]
    assert [node.name for node in rig.tree.nodes[2:4]] == ["Fallback", "Inverter"]
    assert edges == [["root", "{} (Sleep) #{}".format(*leaf)] for leaf in zip("abcd", (2, 5, 6, 7))]
    assert [node.parent.uid for node in rig.tree.nodes[1:]] == [1, 1, 3, 4, 3, 1]  # the tree that runs is as it was


FAILS = "#!/bin/sh\necho 'too many edges' >&2\nexit 1\n"


@pytest.mark.parametrize("program, most, expected", [
    (None, 3, "graphviz is not installed: apt-get install graphviz"),
    ("", 2, "the tree has 3 nodes; trees of at most 2 are drawn"), (FAILS, 3, "graphviz cannot draw the tree: too many edges"),
    ("#!/bin/sh\nexit 7\n", 3, "graphviz cannot draw the tree: Command '['nice', 'dot', '-Tsvg']' returned non-zero exit status 7.")])
def test_what_cannot_be_drawn_says_why(tmp_path, monkeypatch, program, most, expected):
    if program is not None:
        (tmp_path / "dot").write_text(program)
        (tmp_path / "dot").chmod(0o755)
    os.symlink(shutil.which("nice"), str(tmp_path / "nice"))
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.setattr(drawing, "MOST_NODES", most)
    tree = one_leaf("<Sequence><Inverter><Sleep msec='1'/></Inverter><Sleep msec='1'/></Sequence>").tree
    with pytest.raises(drawing.NotDrawn) as reason:
        svg(tree, "root", {2})
    assert str(reason.value) == expected


def test_the_subtrees_fold():
    text = dot(create_tree("lab_tour"), "BIG_PICTURE").to_string()
    assert "GiveTour #73" in text and "Navigate" not in text


OF_THE_FILE = {"tourBrokenOff"}  # the entry that its scripts use


def entries_of_the_tour():
    defaults = {port.default for node in create_tree("lab_tour").iterate() for port in node.spec.ports}
    return {datum.name for datum in data.ALL if whole_mission(datum.name) in defaults} | OF_THE_FILE


@pytest.mark.skipif(shutil.which("dot") is None, reason="graphviz is not installed")
@pytest.mark.parametrize("options, entries", [([], set), (["-b"], entries_of_the_tour)])
def test_the_command_draws_from_any_folder(tmp_path, options, entries):
    command = os.path.join(os.path.dirname(sys.executable), "py-trees-render")
    environment = {key: value for key, value in os.environ.items() if not key.startswith("ROS")}
    environment["PYTHONPATH"] = os.path.realpath(SOURCES)
    done = subprocess.run(
        [command] + options + ["--kwargs", '{"mission": "lab_tour"}', "behavior_controller.cli.create_tree"], cwd=str(tmp_path),
        env=environment, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, timeout=120, check=False)
    assert done.returncode == 0, done.stdout
    assert sorted(os.listdir(str(tmp_path))) == ["lab_tour.dot", "lab_tour.png", "lab_tour.svg"]
    drawn = set(re.findall(r'^"/LabTour/(\w+)" \[', (tmp_path / "lab_tour.dot").read_text(encoding="utf-8"), re.M))
    assert drawn == entries()
