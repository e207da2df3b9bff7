"""Commands without a ROS master: check missions, print the palette for Groot2, draw a mission with py-trees-render."""
import argparse
import json
import os
import sys
import time
from typing import Any, Dict, List, Optional, Set, Tuple
from xml.sax.saxutils import quoteattr

try:
    import behavior_controller.bt
except ImportError as error:  # py-trees-render would show a traceback
    sys.exit("{}: {}".format(os.path.basename(sys.argv[0]), error))
from behavior_controller import exits, folders, leaves
from behavior_controller.bt.checking.palette import tree_nodes_model
from behavior_controller.bt.registry import Kind, did_you_mean
from behavior_controller.bt.rules import RULES
from behavior_controller.errors import MissionError
from behavior_controller.mission import load_tree
from behavior_controller.text import clean
from behavior_controller.validation import Validation, as_json, listed
from behavior_controller.watch.drawing import name_for_drawing

_WATCH_EVERY = 0.3  # seconds


def validate(argv: Optional[List[str]] = None) -> int:
    """``validateMission FILE…``: print every fault of each file. Return 0 if none has a fault, else 2."""
    options = _validation_arguments().parse_args(_without_ros_arguments(argv))
    if not options.watch:
        return _judge_all(options)[0]
    try:
        _watch(options)
    except KeyboardInterrupt:
        pass
    return exits.SUCCESS


def _validation_arguments() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="validateMission", description="Check robot missions without running them.",
                                     epilog="exit code: 0 if no file has a fault, 2 if one has, 1 if a Python "
                                            "package is missing or too old")
    parser.add_argument("files", nargs="+", metavar="FILE",
                        help="a mission or a project (.btproj), as Groot2 saves it, a folder of such files, or a "
                             "knowledge file of release 1.0")
    parser.add_argument("--json", action="store_true", help="print the faults as a JSON array, for editors")
    parser.add_argument("--main", metavar="TREE", help="the main tree, whatever the file says")
    parser.add_argument("--palette", metavar="FILE", action="append", default=[],
                        help="a file with a TreeNodesModel: its node types are taken as stubs")
    parser.add_argument("--folder", action="store_true",
                        help="take trees that a file lacks from the other files in its folder")
    parser.add_argument("--ignore", metavar="CODE", action="append", default=[], type=_code,
                        help="leave out the warnings with this code (docs/faults.md)")
    parser.add_argument("--watch", action="store_true", help="check again whenever a file is saved, until Ctrl-C")
    return parser


def _code(text: str) -> str:
    if text not in RULES:
        raise argparse.ArgumentTypeError("there is no code {} ({})".format(
            text, did_you_mean(text, RULES) or "docs/faults.md has them all"))
    return text


def _judge_all(options: argparse.Namespace) -> Tuple[int, Set[str]]:
    """Print the faults and summaries of all files; return the exit code, and the files that were read."""
    validation = Validation(options.main, options.palette, options.ignore, options.folder)
    judgements = []
    for judgement in validation.judge(options.files):
        judgements.append(judgement)
        if not options.json:
            for fault in judgement.faults:
                print("{} [{}]".format(fault, fault.code) if fault.code else str(fault))
            print(str(judgement))
    if options.json:
        faults = dict.fromkeys(fault for judgement in judgements for fault in judgement.faults)
        print(json.dumps([as_json(fault) for fault in faults], indent=1))
    wrong = any(judgement.is_wrong for judgement in judgements)
    return exits.WRONG_INPUT if wrong else exits.SUCCESS, validation.files


def _watch(options: argparse.Namespace) -> None:
    """Check the files again at each change of one of them, without end."""
    given = list(options.files) + list(options.palette)
    files: Set[str] = set()
    while True:
        before = _state(given, files)
        began = time.time_ns()
        _, read_ones = _judge_all(options)
        sys.stdout.flush()
        added = _state([], read_ones.difference(before))  # what was saved since it was read is checked again
        before.update((path, state) for path, state in added.items() if state and state[0] < began)
        files |= read_ones
        while _state(given, files) == before:
            time.sleep(_WATCH_EVERY)


def _state(given: List[str], files: Set[str]) -> Dict[str, Optional[Tuple[int, int]]]:
    """Return the modification time and length of each file; None for a missing file."""
    state: Dict[str, Optional[Tuple[int, int]]] = {}
    for path in files.union(file for path in given for file in listed(path)):
        try:
            status = os.stat(path)
            state[path] = (status.st_mtime_ns, status.st_size)
        except OSError:
            state[path] = None
    return state


def _without_ros_arguments(argv: Optional[List[str]]) -> List[str]:
    """Return the arguments without those of the form ``name:=value``, which ROS tools add."""
    return [argument for argument in (sys.argv[1:] if argv is None else argv) if ":=" not in argument]


def export_node_model(argv: Optional[List[str]] = None) -> int:
    """``exportNodeModel``: print the mission's node types as Groot2 imports them, or write a project. Return 0."""
    parser = argparse.ArgumentParser(
        prog="exportNodeModel", description="Print the palette of mission nodes for Groot2 (Import models from file).")
    parser.add_argument("--project", metavar="FILE.btproj",
                        help="write a project for Groot2 instead: the palette, and the missions of the folder data")
    options = parser.parse_args(_without_ros_arguments(argv))
    if options.project is None:
        print(_document([], ""))
        return exits.SUCCESS
    missions = sorted(name for name in os.listdir(folders.data("")) if name.endswith(".xml"))
    here = os.path.dirname(os.path.abspath(options.project))
    includes = [os.path.relpath(folders.data(name), here) for name in missions]
    name = os.path.splitext(os.path.basename(options.project))[0]
    with open(options.project, "w", encoding="utf-8") as file:
        file.write(_document(includes, " project_name={}".format(quoteattr(name))) + "\n")
    print("{}: a project of {}".format(clean(options.project), ", ".join(missions)))
    return exits.SUCCESS


def _document(includes: List[str], attributes: str) -> str:
    lines = ['<?xml version="1.0" encoding="UTF-8"?>', '<root BTCPP_format="4"{}>'.format(attributes)]
    lines += ["  <include path={}/>".format(quoteattr(path)) for path in includes]
    return "\n".join(lines + [tree_nodes_model(leaves.beyond_builtins(), indent="  "), "</root>"])


def create_tree(mission: str = "lab_tour", subtree: Optional[str] = None) -> Any:
    """Return the root of a mission to draw with ``py-trees-render behavior_controller.cli.create_tree``.

    ``mission`` is a name in the data folder or the path of a file; with ``subtree``, only the part below the
    first call of that tree is drawn. Nodes have the same numbers as on the page and in Groot2.
    """
    path = mission if mission.endswith(".xml") or os.sep in mission else folders.mission(mission)
    try:
        root = load_tree(path).root if subtree is None else _root_of(path, subtree)
    except MissionError as error:
        sys.exit(str(error))
    for node in root.iterate():
        name_for_drawing(node)
    root.name = subtree or os.path.splitext(os.path.basename(path))[0]
    return root


def _root_of(path: str, subtree: str) -> Any:
    """Return the root of a tree of the file: at its first call in the mission, or alone if the mission does not call it."""
    alone = load_tree(path, main_tree=subtree)
    try:
        whole = load_tree(path)
    except MissionError:
        return alone.root  # several trees, of which none is the main one
    calls = (node.children[0] for node in whole.nodes
             if node.spec.kind is Kind.SUBTREE and node.element.attributes.get("ID") == subtree)
    return next(calls, alone.root)
