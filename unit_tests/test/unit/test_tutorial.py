"""Does docs/tutorial.md build data/reception.xml, and say at each step what the commands say?"""
import importlib.util
import os
import re
import shutil
from xml.etree import ElementTree

import pytest

from behavior_controller import folders
from behavior_controller.missions.validation import Validation

pytestmark = pytest.mark.slow

ROOT = folders.share()
spec = importlib.util.spec_from_file_location("tutorial",
                                              os.path.join(ROOT, "tools", "tutorial.py"))
tutorial = importlib.util.module_from_spec(spec)
spec.loader.exec_module(tutorial)
STEPS = tutorial.read()


def trees_of(text):
    """Return the trees of a mission by their ID, as attributes and children."""
    return {tree.get("ID"): as_tuples(tree)
            for tree in ElementTree.fromstring(text).iter("BehaviorTree")}


def as_tuples(element):
    return element.tag, dict(element.attrib), [as_tuples(child) for child in element]


def test_it_builds_the_reception_in_ten_steps():
    with open(folders.mission("reception"), encoding="utf-8") as file:
        assert trees_of(STEPS[-1].mission) == trees_of(file.read())
    assert [step.text.partition(".")[0] for step in STEPS] == [str(n) for n in range(1, 11)]


def commands_of(step):
    return [line for line in step.console.splitlines() if line.startswith("$ ")]


def is_long(step):
    return any(line.endswith("rehearseMission reception.xml") for line in commands_of(step))


@pytest.mark.parametrize("step", [
    pytest.param(step, id=str(number), marks=[pytest.mark.long] if is_long(step) else [])
    for number, step in enumerate(STEPS, 1)])
def test_each_step_says_what_the_commands_say(step):
    names = [line.split()[3] for line in commands_of(step)]
    assert names == ["validateMission", "rehearseMission"][step is not STEPS[0]:]
    assert step.console == tutorial.said(step)


@pytest.mark.parametrize("step", STEPS, ids=[str(number) for number in range(1, 11)])
def test_no_step_has_a_warning(step, tmp_path):
    tutorial.write_mission(step, str(tmp_path))
    judgement, = Validation().judge([str(tmp_path / "reception.xml")])
    assert judgement.faults == []


def test_dots_stand_for_the_lines_of_the_step_before():
    tree = '<BehaviorTree ID="A">\n  <Sequence>\n{}  </Sequence>\n</BehaviorTree>\n'
    shown = ["    <B/>\n    <C/>\n", "    <B d='1'/>\n    …\n", "    …\n    <E/>\n"]
    missions = [step.mission for step in tutorial.steps("".join(
        f"## {number}. x\n```xml\n{tree.format(lines)}```\n"
        for number, lines in enumerate(shown, 1)))]
    assert tree.format("    <B d='1'/>\n    <C/>\n") in missions[1]
    assert tree.format("    <B d='1'/>\n    <C/>\n    <E/>\n") in missions[2]


def test_the_first_commands_make_the_project(tmp_path):
    with open(tutorial.DOCUMENT, encoding="utf-8") as file:
        make, copy, export = re.search(r"^```\n(.*?)^```", file.read(), re.M | re.S)[1].splitlines()
    assert make == "mkdir ~/reception && cd ~/reception"
    assert copy == 'cp "$(rospack find cssr_system)/data/lab_tour.xml" .'
    shutil.copy(folders.mission("lab_tour"), str(tmp_path))
    tutorial.run(export, str(tmp_path))
    with open(str(tmp_path / export.split()[-1]), encoding="utf-8") as file:
        project = file.read()
    assert '"lab_tour.xml"' in project and '"START_OF_TREE"' in project


def test_the_last_commands_copy_what_belongs_to_the_name():
    copied = re.findall(r"^cp (reception_\S+) my_(\S+)$", STEPS[-1].text, re.M)
    assert all(source == target for source, target in copied)
    data = os.path.dirname(folders.mission("reception"))
    files = {name for name in os.listdir(data) if name.startswith("reception_")}
    assert {source for source, _ in copied} == {name for name in files if "Kinyarwanda" not in name}
