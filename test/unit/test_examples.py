"""The examples of plain Python run as their first lines say, and the guide shows them as they are.
"""
import os
import subprocess
import sys
from pathlib import Path

import pytest


ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
EXAMPLES = os.path.join(ROOT, "examples")


def ran(name, mission):
    """Run an example in another folder, without ROS."""
    environment = {key: value for key, value in os.environ.items() if not key.startswith("ROS")}
    environment["PYTHONPATH"] = os.path.join(ROOT, "src")
    return subprocess.run([sys.executable, os.path.join(EXAMPLES, name), str(mission)],
                          env=environment, timeout=60, stdout=subprocess.PIPE,
                          stderr=subprocess.PIPE, encoding="utf-8", cwd=os.sep)


@pytest.mark.slow
def test_own_leaves_run_a_file_of_groot2():
    done = ran("plain_python.py", os.path.join(EXAMPLES, "plain_python.xml"))
    # two drives while the battery is at 2 or more (3, 2), and one home
    assert done.stdout == "SUCCESS {'at': Spot(x=0.0, y=0.0), 'battery': 0} 0\n", done.stderr


@pytest.mark.slow
def test_a_wrong_text_of_an_own_type_is_a_line_with_its_place(tmp_path):
    with open(os.path.join(EXAMPLES, "plain_python.xml"), encoding="utf-8") as file:
        text = file.read().replace('to="2.5;1"', 'to="2.5;north"')
    (tmp_path / "wrong.xml").write_text(text, encoding="utf-8")
    done = ran("plain_python.py", tmp_path / "wrong.xml")
    line = 1 + text[:text.index("north")].count("\n")
    assert done.returncode == 1 and done.stdout == "" and "Traceback" not in done.stderr
    assert done.stderr.startswith("{}:{}:".format(tmp_path / "wrong.xml",
                                                  line)) and "north" in done.stderr


@pytest.mark.slow
def test_py_trees_tools_show_a_mission_to_its_end():
    done = ran("py_trees_tools.py", os.path.join(EXAMPLES, "py_trees_tools.xml"))
    pictures = done.stdout.split("\n\n")
    assert pictures[-1] == "SUCCESS Sleep\n", done.stderr
    assert "to two [" in pictures[0] and "Sleep [" not in pictures[0]
    assert all(sign in pictures[-2] for sign in (
        "Sequence [", "Timeout [", "Sleep [")) and "to two [" not in pictures[-2]


def test_the_guide_shows_the_example():
    example = Path(os.path.join(EXAMPLES, "plain_python.py")).read_text("utf-8")
    assert example in Path(os.path.join(ROOT, "docs", "engine.md")).read_text("utf-8")
