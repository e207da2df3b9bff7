"""Commands that need no ROS master: check missions, print the palette for Groot2, draw a mission with py-trees-render."""
import argparse
import json
import os
import sys
from typing import Any, List, Optional
from xml.sax.saxutils import quoteattr

from behavior_controller import folders, leaves
from behavior_controller.bt.builtins import builtin_specs
from behavior_controller.bt.compiler import load_mission
from behavior_controller.bt.registry import Registry
from behavior_controller.errors import Fault, MissionError

GOOD, BAD = 0, 2


def registry() -> Registry:
    """Return every node type that a mission may use."""
    return Registry(builtin_specs() + list(leaves.SPECS))


def validate(argv: Optional[List[str]] = None) -> int:
    """``validateMission FILE…``: print every fault of each file. Return 0 if all can be run, else 2."""
    parser = argparse.ArgumentParser(prog="validateMission", description="Check robot missions without running them.")
    parser.add_argument("files", nargs="+", metavar="FILE", help="a mission, as Groot2 saves it")
    parser.add_argument("--json", action="store_true", help="print the faults as a JSON array, for editors")
    options = parser.parse_args(argv)
    found: List[Fault] = []
    for path in options.files:
        faults = _faults(path)
        found.extend(faults)
        if not options.json:
            _print_faults(path, faults)
    if options.json:
        print(json.dumps([fault._asdict() for fault in found], indent=1))
    return BAD if any(not fault.is_warning for fault in found) else GOOD


def _faults(path: str) -> List[Fault]:
    try:
        return load_mission(path, registry()).warnings
    except MissionError as error:
        return list(error.faults)


def _print_faults(path: str, faults: List[Fault]) -> None:
    for fault in faults:
        print(fault)
    errors = sum(not fault.is_warning for fault in faults)
    print("{}: {}".format(path, "{} fault{}".format(errors, "" if errors == 1 else "s") if errors else "can be run"))


def export_node_model(argv: Optional[List[str]] = None) -> int:
    """``exportNodeModel``: print the mission's node types as Groot2 imports them. Return 0."""
    argparse.ArgumentParser(
        prog="exportNodeModel", description="Print the palette of mission nodes for Groot2 (Import models from file)."
    ).parse_args(argv)
    print('<?xml version="1.0" encoding="UTF-8"?>\n<root BTCPP_format="4">\n  <TreeNodesModel>')
    for spec in leaves.SPECS:
        print("    <{} ID={} editable=\"true\">".format(spec.kind.value, quoteattr(spec.id)))
        print("      <MetadataFields>\n        <Metadata description={}/>\n      </MetadataFields>".format(
            quoteattr(spec.description)))
        for port in spec.ports:
            default = "" if port.default is None else " default={}".format(quoteattr(port.default))
            print("      <{} name={} type={}{}>{}</{}>".format(
                port.direction.value, quoteattr(port.name), quoteattr(port.type), default, port.description,
                port.direction.value))
        print("    </{}>".format(spec.kind.value))
    print("  </TreeNodesModel>\n</root>")
    return GOOD


def create_tree(mission: str = "lab_tour", subtree: Optional[str] = None) -> Any:
    """Return the root of a mission to draw with ``py-trees-render behavior_controller.cli.create_tree``.

    ``mission`` is a name in the data folder or the path of a file; ``subtree`` draws that tree of the file alone. A node is
    labelled with its own name and type, or with its type and uid, so that those of the same type can be told apart.
    """
    path = mission if mission.endswith(".xml") or os.sep in mission else folders.mission(mission)
    try:
        tree = load_mission(path, registry(), main_tree=subtree)
    except MissionError as error:
        sys.exit(str(error))
    for node in tree.nodes:
        node.name = _label(node)
        node.memory = False  # else py_trees puts a sign before the name that few fonts have; the label tells the type
    tree.root.name = subtree or os.path.splitext(os.path.basename(path))[0]
    return tree.root


def _label(node: Any) -> str:
    last = node.full_path.rsplit("/", 1)[-1]
    if last == "{}::{}".format(node.name, node.uid):
        return "{} #{}".format(node.name, node.uid)  # a colon would be a port in the dot language
    return "{} ({}) #{}".format(node.name, node.registration_id, node.uid)
