"""Do missions find what other packages add, and is each way of exporting it wrong told in one line?"""
import os
import subprocess
import sys

import pytest

pytest.importorskip("rospkg")

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
EXAMPLES = os.path.join(ROOT, "examples")
MANIFEST = """<package format="2"><name>{0}</name><version>1.0.0</version><description>d</description>
<maintainer email="a@example.org">a</maintainer><license>BSD</license><export><cssr_system {1}/></export></package>"""
LEAF = """from behavior_controller.bt.registry import Kind, NodeSpec, Port
from behavior_controller.interface.records import Request, Say
from behavior_controller.leaves.base import ServiceLeaf, leaf_spec
"""


def run(tool, *arguments, packages, paths=()):
    """Return the exit code of a tool and all that it prints, where these folders hold packages."""
    environment = dict(os.environ, ROS_PACKAGE_PATH=str(packages), ROS_ROOT="", PYTHONPATH=os.pathsep.join(
        [os.path.join(ROOT, "src")] + list(map(str, paths))))
    done = subprocess.run([sys.executable, os.path.join(ROOT, "src", "behavior_controller", tool)] + list(arguments),
                          env=environment, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, universal_newlines=True)
    return done.returncode, done.stdout


def test_the_example_adds_its_leaves_its_decorator_and_its_phrase():
    there = {"packages": EXAMPLES, "paths": [os.path.join(EXAMPLES, "greeter", "src")]}
    code, text = run("validateMission", os.path.join(EXAMPLES, "greeter", "data", "greet.xml"), **there)
    assert (code, text.splitlines()) == (0, [os.path.join(EXAMPLES, "greeter", "data", "greet.xml")
                                             + ": can be run, 9 nodes, 0 warnings"])
    palette = run("exportNodeModel", **there)[1]
    assert all('ID="{}"'.format(node) in palette for node in ("SayTime", "Lights", "EveryOther", "CuriousSpeech"))
    assert '<Decorator ID="EveryOther">' in palette


def test_without_the_package_its_nodes_are_those_of_another_robot(tmp_path):
    code, text = run("validateMission", os.path.join(EXAMPLES, "greeter", "data", "greet.xml"), packages=tmp_path)
    assert code == 0 and "not a mission of this robot, which lacks 4 node types" in text


@pytest.mark.parametrize("export, module, words", [
    ('leafs="a.leaves"', None, ["package.xml", "has no attribute leafs", "leaves"]),
    ('leaves="a.leaves"', None, ["package a", "a.leaves", "cannot be imported", "No module named"]),
    ('leaves="a.leaves"', "SPECS = (", ["package a", "cannot be imported", "SyntaxError"]),
    ('leaves="a.leaves"', "1 / 0", ["package a", "ZeroDivisionError"]),
    ('leaves="a.leaves"', "", ["package a", "a.leaves", "it has no SPECS"]),
    ('leaves="a.leaves"', "SPECS = 7", ["package a", "SPECS is not a tuple"]),
    ('leaves="a.leaves"', "SPECS = (7,)", ["package a", "7 in SPECS is not a NodeSpec"]),
    ('leaves="a.leaves"', LEAF + "SPECS = (NodeSpec('Navigate', Kind.ACTION, None),)",
     ["package a", "the node Navigate is declared by cssr_system already"]),
    ('leaves="a.leaves"', LEAF + "SPECS = (NodeSpec('Sequence', Kind.ACTION, None),)",
     ["package a", "the node Sequence is declared by BehaviorTree.CPP already"]),
    ('leaves="a.leaves"', LEAF + """
class Wave(Request):
    pass
class Waves(ServiceLeaf):
    asks = Wave
SPECS = (leaf_spec("Waves", Waves, "waves"),)
""", ["package a", "no service is declared for the request Wave of Waves"]),
    ('leaves="a.leaves"', LEAF + """
class Lamp(ServiceLeaf):
    asks = Say
    PORTS = (Port("colour", "std::string"),)
SPECS = (leaf_spec("Lamp", Lamp, "lamp"),)
""", ["package a", "the port colour of Lamp has the unknown type std::string", "did you mean string?"]),
    ('leaves="a.leaves"', LEAF + """
class Lamp(ServiceLeaf):
    pass
SPECS = (leaf_spec("Lamp", Lamp, "lamp"),)
""", ["package a", "cannot be imported", "a.leaves.Lamp, the leaf of Lamp, does not say what it asks for"]),
    ('interface="a.leaves"', "SERVICES = (7,)", ["package a", "a.leaves", "SERVICES and TOPICS cannot be used"]),
])
@pytest.mark.parametrize("tool", ["validateMission", "exportNodeModel"])
def test_what_is_wrong_with_a_package_is_one_line(tmp_path, tool, export, module, words):
    source = tmp_path / "a" / "src" / "a"
    source.mkdir(parents=True)
    (tmp_path / "a" / "package.xml").write_text(MANIFEST.format("a", export))
    (source / "__init__.py").write_text("")
    if module is not None:
        (source / "leaves.py").write_text(module)
    arguments = [os.path.join(ROOT, "data", "lab_tour.xml")] if tool == "validateMission" else []
    code, text = run(tool, *arguments, packages=tmp_path, paths=[tmp_path / "a" / "src"])
    assert code == 1 and len(text.splitlines()) == 1, text
    assert all(word in text for word in words), text


def test_two_packages_with_a_node_of_the_same_name(tmp_path):
    for name in ("a", "b"):
        source = tmp_path / name / "src" / name
        source.mkdir(parents=True)
        (tmp_path / name / "package.xml").write_text(MANIFEST.format(name, 'leaves="{}.leaves"'.format(name)))
        (source / "__init__.py").write_text("")
        (source / "leaves.py").write_text(LEAF + "SPECS = (NodeSpec('Twice', Kind.ACTION, None),)")
    code, text = run("exportNodeModel", packages=tmp_path, paths=[tmp_path / "a" / "src", tmp_path / "b" / "src"])
    assert (code, len(text.splitlines())) == (1, 1)
    assert "package b" in text and "the node Twice is declared by a already" in text
