"""py-trees-render draws a mission from any folder, without ROS, so that each node can be told
apart."""
import os
import re
import shutil
import subprocess
import sys

import py_trees
import pytest

from behavior_controller.cli import create_tree
from behavior_controller.leaves import data
from behavior_controller.config.node_facts import whole_mission

pytestmark = pytest.mark.slow

SOURCES = os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "..", "src")


def dot(root, level="ALL"):
    level = getattr(py_trees.common.VisibilityLevel, level)
    return py_trees.display.dot_tree(root, visibility_level=level)


def test_every_node_of_the_lab_tour_is_drawn_once_with_a_label_of_its_own():
    labels = [node.get_label().strip('"') for node in dot(create_tree("lab_tour")).get_node_list()
              if node.get_label()]
    assert len(labels) == len(set(labels)) == 222
    assert {"lab_tour", "Navigate #107", "UntilMutualGaze (ReactiveFallback) #35",
            "GiveTour #79"} <= set(labels)
    # in the dot language what follows a colon is not part of the name: the edges would miss their
    # nodes
    assert not any(":" in label for label in labels)


def test_the_subtrees_fold():
    text = dot(create_tree("lab_tour"), "BIG_PICTURE").to_string()
    assert "GiveTour #79" in text and "Navigate" not in text


OF_THE_FILE = {"tourBrokenOff"}  # the entry that its scripts use


def entries_of_the_tour():
    defaults = {
        port.default for node in create_tree("lab_tour").iterate() for port in node.spec.ports}
    return {datum.name for datum in data.ALL if whole_mission(datum.name) in defaults} | OF_THE_FILE


@pytest.mark.skipif(shutil.which("dot") is None, reason="graphviz is not installed")
def test_the_command_draws_the_tour_and_its_entries_from_any_folder(tmp_path):
    command = os.path.join(os.path.dirname(sys.executable), "py-trees-render")
    environment = {key: value for key, value in os.environ.items() if not key.startswith("ROS")}
    environment["PYTHONPATH"] = os.path.realpath(SOURCES)
    done = subprocess.run([command, "-b", "--kwargs", '{"mission": "lab_tour"}',
                           "behavior_controller.cli.create_tree"], cwd=str(tmp_path),
                          env=environment, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                          timeout=120, check=False)
    assert done.returncode == 0, done.stdout
    assert sorted(os.listdir(str(tmp_path))) == ["lab_tour.dot", "lab_tour.png", "lab_tour.svg"]
    text = (tmp_path / "lab_tour.dot").read_text(encoding="utf-8")
    assert set(re.findall(r'(?m)^"/LabTour/(\w+)" \[', text)) == entries_of_the_tour()
