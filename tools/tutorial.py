"""The tutorial's steps, as docs/tutorial.md shows them: each has the trees that it adds or changes,
and the commands that check the mission as it is then. A line ``…`` in a tree stands for its lines
of the step before.

``python3 tools/tutorial.py`` runs all commands, and writes into the document what they say.
"""
import argparse
import os
import re
import shutil
import subprocess
import sys
import tempfile
from typing import Dict, List, NamedTuple

ROOT = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
DOCUMENT = os.path.join(ROOT, "docs", "tutorial.md")
MISSION, MAIN = "reception", "Reception"
EXECUTABLES = {"cssr_system": "src/behavior_controller", "unit_tests": "unit_tests/nodes"}
MODULES = (os.path.join(ROOT, "src"), os.path.join(ROOT, "unit_tests", "src"))

_HEADING = re.compile(r"^## (?=\d+\. )", re.M)
_XML = re.compile(r"^```xml\n(.*?)^```", re.M | re.S)
_CONSOLE = re.compile(r"(?<=^```console\n).*?(?=^```)", re.M | re.S)
_TREE = re.compile(r'^<BehaviorTree ID="(\w+)">.*?^</BehaviorTree>', re.M | re.S)
_INCLUDE = re.compile(r"^<include .*/>", re.M)
_UNCHANGED = "    …"
_STORY = re.compile(r"(?:^ {6,}.*\n)+", re.M)


class Step(NamedTuple):
    """A step: its part of the document, and the text of the mission after it."""

    text: str
    mission: str

    @property
    def tree(self) -> str:
        """The tree that its picture shows."""
        found = re.search(r"!\[The tree (\w+)\]", self.text)
        return found.group(1) if found else MAIN

    @property
    def console(self) -> str:
        """The commands, and what they say."""
        found = _CONSOLE.search(self.text)
        assert found, self.text
        return found.group()


def steps(document: str) -> List[Step]:
    """Return the steps of the document."""
    trees: Dict[str, str] = {}
    includes, found = [], []
    for text in _HEADING.split(document)[1:]:
        shown = "".join(_XML.findall(text))
        trees.update((tree[1], _whole(tree[0].split("\n"), trees.get(tree[1], "").split("\n")))
                     for tree in _TREE.finditer(shown))
        includes += _INCLUDE.findall(shown)
        root = '<root BTCPP_format="4" main_tree_to_execute="{}">'.format(MAIN)
        lines = [root, *includes, *trees.values(), "</root>"]
        found.append(Step(text, "\n".join(lines) + "\n"))
    return found


def _whole(lines: List[str], before: List[str]) -> str:
    """Return a tree with the lines that ``…`` stands for: of the tree before, those after the tags
    above it, up to the lines at the end that both have."""
    if _UNCHANGED in lines:
        at = lines.index(_UNCHANGED)
        tags = tuple(re.findall(r"^ *<\w+", "\n".join(lines[:at]), re.M))
        first = max(number for number, line in enumerate(before) if line.startswith(tags)) + 1
        same = next(number for number, (line, old) in enumerate(zip(lines[::-1], before[::-1]))
                    if line != old)
        lines[at:at + 1] = before[first:len(before) - same]
    return "\n".join(lines)


def write_mission(step: Step, folder: str) -> str:
    """Write the mission after a step, and what it includes; return its path."""
    shutil.copy(os.path.join(ROOT, "data", "lab_tour.xml"), folder)
    path = os.path.join(folder, MISSION + ".xml")
    with open(path, "w", encoding="utf-8") as file:
        file.write(step.mission)
    return path


def said(step: Step) -> str:
    """Return the commands of a step with what they say now, without times, folders and stories."""
    with tempfile.TemporaryDirectory() as folder:
        write_mission(step, folder)
        shown = []
        for command in re.findall(r"^\$ (.*)$", step.console, re.M):
            text = run(command, folder)
            text = text.replace(folder + os.sep, "").replace(ROOT + os.sep, "")
            text = re.sub(r"(simulated runs?) in [\d.]+ s", r"\1", text)
            text = re.sub(r"(lab_tour\.xml):\d+:\d+", r"\1", text)
            shown += ["$ " + command, _STORY.sub("      …\n", text).rstrip(), ""]
    return "\n".join(shown[:-1]) + "\n"


def run(command: str, folder: str) -> str:
    """Run a command in a folder, and return what it says; rosrun is not needed for it."""
    _, package, name, *options = command.split()
    program = os.path.join(ROOT, EXECUTABLES[package], name)
    done = subprocess.run([sys.executable, program, *options], cwd=folder, stdout=subprocess.PIPE,
                          stderr=subprocess.STDOUT, universal_newlines=True, check=False,
                          env=dict(os.environ, PYTHONPATH=os.pathsep.join(MODULES)))
    return done.stdout


def read() -> List[Step]:
    """Return the steps as the document has them."""
    with open(DOCUMENT, encoding="utf-8") as file:
        return steps(file.read())


def main() -> None:
    """Write into the document what the commands say."""
    argparse.ArgumentParser(description=__doc__).parse_args()
    with open(DOCUMENT, encoding="utf-8") as file:
        document = file.read()
    for step in steps(document):
        document = document.replace(step.text, step.text.replace(step.console, said(step)))
    with open(DOCUMENT, "w", encoding="utf-8") as file:
        file.write(document)


if __name__ == "__main__":
    sys.exit(main())
