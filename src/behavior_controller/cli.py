"""Commands without a ROS master: check missions, print the palette for Groot2, draw a mission with py-trees-render."""
import argparse
import json
import os
import sys
from typing import Any, List, Optional, Tuple

try:
    import behavior_controller.bt
except ImportError as error:  # py-trees-render would show a traceback
    sys.exit("{}: {}".format(os.path.basename(sys.argv[0]), error))
from behavior_controller import exits, folders, knowledge_files, leaves, settings
from behavior_controller.bt.checking.palette import tree_nodes_model
from behavior_controller.bt.engine.node import label
from behavior_controller.errors import ConfigurationError, Fault, MissionError
from behavior_controller.mission import load_tree, on_robot
from behavior_controller.settings import Settings
from behavior_controller.text import clean


def validate(argv: Optional[List[str]] = None) -> int:
    """``validateMission FILE…``: print every fault of each file. Return 0 if all can be run, else 2."""
    parser = argparse.ArgumentParser(prog="validateMission", description="Check robot missions without running them.",
                                     epilog="exit code: 0 if every file can be run, 2 if not, 1 if a Python "
                                            "package is missing or too old")
    parser.add_argument("files", nargs="+", metavar="FILE",
                        help="a mission, as Groot2 saves it, or a knowledge file of release 1.0")
    parser.add_argument("--json", action="store_true", help="print the faults as a JSON array, for editors")
    options = parser.parse_args(_without_ros_arguments(argv))
    found: List[Fault] = []
    for path in options.files:
        faults, nodes = _judged(path)
        found.extend(faults)
        if not options.json:
            _print_judgement(path, faults, nodes)
    if options.json:
        print(json.dumps([fault._asdict() for fault in found], indent=1))
    return exits.WRONG_INPUT if any(not fault.is_warning for fault in found) else exits.SUCCESS


def _without_ros_arguments(argv: Optional[List[str]]) -> List[str]:
    """Return the arguments but for those of the form ``name:=value``, which ROS tools add."""
    return [argument for argument in (sys.argv[1:] if argv is None else argv) if ":=" not in argument]


def _judged(path: str) -> Tuple[List[Fault], int]:
    """Return the faults of a file, and how many nodes it unfolds to if it is a mission that can be run."""
    knowledge = knowledge_files.check(path)
    if knowledge is not None:
        return knowledge, 0
    try:
        tree = load_tree(path)
    except MissionError as error:
        return list(error.faults), 0
    faults = sorted(tree.warnings + on_robot(tree, _settings()), key=lambda fault: (fault.file, fault.line, fault.column))
    return faults, len(tree.nodes) if all(fault.is_warning for fault in faults) else 0


def _settings() -> Settings:
    """Return the configuration, or its defaults where it cannot be read: the node tells what is wrong with it."""
    try:
        return settings.load(folders.config(settings.FILE_NAME))
    except ConfigurationError:
        return settings.defaults()


def _print_judgement(path: str, faults: List[Fault], nodes: int) -> None:
    for fault in faults:
        print(str(fault))
    warnings = sum(fault.is_warning for fault in faults)
    counts = [] if nodes else [_count(len(faults) - warnings, "fault")]
    if warnings or nodes:
        counts.append(_count(warnings, "warning"))
    good = "can be run, {}, ".format(_count(nodes, "node")) if nodes else ""
    print("{}: {}{}".format(clean(path), good, ", ".join(counts)))


def _count(number: int, what: str) -> str:
    return "{} {}{}".format(number, what, "" if number == 1 else "s")


def export_node_model(argv: Optional[List[str]] = None) -> int:
    """``exportNodeModel``: print the mission's node types as Groot2 imports them. Return 0."""
    parser = argparse.ArgumentParser(
        prog="exportNodeModel", description="Print the palette of mission nodes for Groot2 (Import models from file).")
    parser.parse_args(_without_ros_arguments(argv))
    print('<?xml version="1.0" encoding="UTF-8"?>\n<root BTCPP_format="4">\n{}\n</root>'.format(
        tree_nodes_model(leaves.beyond_builtins(), indent="  ")))
    return exits.SUCCESS


def create_tree(mission: str = "lab_tour", subtree: Optional[str] = None) -> Any:
    """Return the root of a mission to draw with ``py-trees-render behavior_controller.cli.create_tree``.

    ``mission`` is a name in the data folder or the path of a file; ``subtree`` draws that tree of the file alone. A node
    is labelled with its own name and type, or with its type and uid, so that those of one type can be told apart.
    """
    path = mission if mission.endswith(".xml") or os.sep in mission else folders.mission(mission)
    try:
        tree = load_tree(path, main_tree=subtree)
    except MissionError as error:
        sys.exit(str(error))
    for node in tree.nodes:
        node.name = " ".join(label(node))  # a colon would be a port in the dot language
        # else py_trees puts a sign before the name that few fonts have; the label tells the type
        setattr(node, "memory", False)
    tree.root.name = subtree or os.path.splitext(os.path.basename(path))[0]
    return tree.root
