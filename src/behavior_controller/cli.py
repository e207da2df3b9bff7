"""Commands without a ROS master: check missions, print the palette for Groot2, draw a mission with
py-trees-render."""
import argparse
import contextlib
import json
import os
import re
import sys
import time
from typing import Any, Dict, List, NoReturn, Optional, Set, Tuple
from xml.sax.saxutils import quoteattr

from behavior_controller import NOT_SET_UP

try:
    import behavior_controller.bt
except ImportError as error:  # py-trees-render would hide the reason
    reason = str(error)
    if isinstance(error, ModuleNotFoundError):
        reason = NOT_SET_UP.format(error, sys.executable)
    sys.exit(f"{os.path.basename(sys.argv[0])}: {reason}")
from behavior_controller import exit_codes, leaves, ros_arguments
from behavior_controller.bt.linter.palette import tree_nodes_model
from behavior_controller.bt.engine.node import label
from behavior_controller.bt.engine.registry import Kind
from behavior_controller.bt.loader.structure import by_place
from behavior_controller.bt.loader.rules import RULES
from behavior_controller.errors import FaultsFound, attempt
from behavior_controller.missions.load import load_tree, missions
from behavior_controller.output_files import OutputKind
from behavior_controller.robot.interfaces import INTERFACES
from behavior_controller.ros_arguments import CommandParser
from behavior_controller.text import clean, did_you_mean
from behavior_controller.missions.validation import (
    Judgement, Validation, as_json, listed, may_be_a_mission, named)

_WATCH_EVERY = 0.3  # seconds
_CLOCK_STEP = 0.02  # seconds in which a file system may give two changes the same time

XML_HEAD = '<?xml version="1.0" encoding="UTF-8"?>'
MARK = "\n<!-- written by exportNodeModel, which may replace this file -->"
PROJECT = OutputKind("a project that exportNodeModel has written", re.escape(XML_HEAD + MARK))


def validate(argv: Optional[List[str]] = None) -> int:
    """``validateMission FILE…``: print every fault of each file. Return 0 if none has a fault, else
    2."""
    options = ros_arguments.parse(_validation_arguments(), argv)
    if options.watch:
        _watch(options)
    return _judge_all(options)[0]


def _validation_arguments() -> argparse.ArgumentParser:
    parser = CommandParser(
        "validateMission", "Check robot missions without running them.",
        "0 if no file has an error, 2 if one has, 1 if a Python package is missing or too old")
    parser.add_argument(
        "files", nargs="+", metavar="FILE",
        help="a mission or a project (.btproj), as Groot2 saves it, the name of a mission of a "
        "data folder, a folder of such files, or a knowledge file of release 1.0")
    parser.add_argument("--json", action="store_true",
                        help="print the mistakes as a JSON array, for editors")
    parser.add_argument("--main", metavar="TREE", help="the main tree, whatever the file says")
    parser.add_argument("--palette", metavar="FILE", action="append", default=[],
                        help="a file with a TreeNodesModel: its node types are taken as stubs")
    parser.add_argument("--interface", metavar="ROBOT", choices=sorted(INTERFACES), default="",
                        help="check for this robot, whatever the configuration says: %(choices)s")
    parser.add_argument("--folder", action="store_true",
                        help="take trees that a file lacks from the other files in its folder")
    parser.add_argument("--ignore", metavar="CODE", action="append", default=[], type=_code,
                        help="leave out the warnings with this code (docs/faults.md)")
    parser.add_argument("--watch", action="store_true",
                        help="check again whenever a file is saved, until Ctrl-C")
    return parser


def _code(text: str) -> str:
    if text not in RULES:
        raise argparse.ArgumentTypeError("there is no code {} ({})".format(
            text, did_you_mean(text, RULES) or "docs/faults.md has them all"))
    return text


def _judge_all(options: argparse.Namespace) -> Tuple[int, Set[str]]:
    """Print the faults and summaries of all files; return the exit code, and the files that decide
    it."""
    validation = Validation(options.main, options.palette, options.ignore, options.folder,
                            options.interface)
    judgements: List[Judgement] = []
    if not options.json:
        print(validation.head)
    for judgement in validation.judge(options.files):
        judgements.append(judgement)
        if not options.json:
            for fault in judgement.faults:
                print(f"{fault} [{fault.code}]" if fault.code else fault)
            print(judgement)
    faults = {fault for judgement in judgements for fault in judgement.faults}
    files = validation.files.union(fault.file for fault in faults)
    if options.json:
        print(json.dumps([as_json(fault) for fault in sorted(faults, key=by_place)], indent=1))
    if any(judgement.is_wrong for judgement in judgements):
        return exit_codes.WRONG_INPUT, files
    return exit_codes.SUCCESS, files


def _watch(options: argparse.Namespace) -> NoReturn:
    """Check the files again at each change of one of them, until Ctrl-C ends the process."""
    given: List[str] = options.files + options.palette
    files: Set[str] = set()
    while True:
        time.sleep(_CLOCK_STEP)
        before, surely_read = _state(given, files), time.time_ns() - int(_CLOCK_STEP * 1e9)
        read_ones = _judge_all(options)[1]
        sys.stdout.flush()
        before.update(_state([], read_ones.difference(before)))
        # what may have been saved since it was read is checked again
        seen = {path: state for path, state in before.items()
                if not state or state[0] < surely_read}
        files |= read_ones
        while _state(given, files) == seen:
            time.sleep(_WATCH_EVERY)


def _state(given: List[str], files: Set[str]) -> Dict[str, Optional[Tuple[int, int, int]]]:
    """Return for each file when it was last changed or put in its place, its number and its length;
    None for a missing file."""
    paths = files.union(file for path in given for file in listed(path))
    state: Dict[str, Optional[Tuple[int, int, int]]] = dict.fromkeys(paths)
    for path in paths:
        with contextlib.suppress(OSError):
            status = os.stat(path)
            state[path] = status.st_ctime_ns, status.st_ino, status.st_size
    return state


def export_node_model(argv: Optional[List[str]] = None) -> int:
    """``exportNodeModel``: print the mission's node types as Groot2 imports them, or write a
    project. Return 0."""
    parser = CommandParser(
        "exportNodeModel",
        "Print the palette of mission nodes for Groot2 (Import models from file).",
        "0 if it is printed or written, 2 if the call is wrong, 1 if there is no output")
    parser.add_argument(
        "--project", metavar="FILE.btproj",
        help="write a project for Groot2 instead: the palette, and the missions of its own folder; "
        "if there are none, those of the folder data")
    options = ros_arguments.parse(parser, argv)
    if options.project is None:
        print(_document([]), end="")
        return exit_codes.SUCCESS
    if not options.project.endswith(".btproj"):
        parser.error(f"{clean(options.project)} is no project: its name must end with .btproj")
    PROJECT.check(options.project)
    here = os.path.dirname(os.path.abspath(options.project))
    includes: List[str] = []
    if os.path.isdir(here):
        includes = [name for name in sorted(os.listdir(here))
                    if name.endswith(".xml") and may_be_a_mission(os.path.join(here, name))]
    includes = includes or [os.path.relpath(path, here) for path in missions()]
    name = os.path.splitext(os.path.basename(options.project))[0]
    PROJECT.write(options.project, _document(includes, f" project_name={quoteattr(name)}", MARK))
    print(f"{clean(options.project)}: a project of {', '.join(map(os.path.basename, includes))}")
    return exit_codes.SUCCESS


def _document(includes: List[str], attributes: str = "", mark: str = "") -> str:
    lines = [XML_HEAD + mark, f'<root BTCPP_format="4"{attributes}>']
    lines += [f"  <include path={quoteattr(path)}/>" for path in includes]
    return "\n".join(lines + [tree_nodes_model(leaves.specs(), indent="  "), "</root>\n"])


def create_tree(mission: str = "lab_tour", subtree: Optional[str] = None) -> Any:
    """Return the root of a mission to draw with ``py-trees-render
    behavior_controller.cli.create_tree``.

    ``mission`` is a name in the data folder or the path of a file; with ``subtree``, only the part
    below the first call of that tree is drawn. Nodes have the same numbers as on the page and in
    Groot2.
    """
    try:
        path = named(mission)
        root = load_tree(path).root if subtree is None else _root_of(path, subtree)
    except FaultsFound as error:
        sys.exit(str(error))
    for node in root.iterate():
        # py_trees draws nodes of the same name as one, and in the dot language what follows a colon
        # is a port
        node.name = " ".join(label(node)).replace(":", "∶")
        # else py_trees puts a symbol before the name that few fonts have; the label has the type
        setattr(node, "memory", False)
    root.name = subtree or os.path.splitext(os.path.basename(path))[0]
    return root


def _root_of(path: str, subtree: str) -> Any:
    """Return the root of a tree of the file: at its first call in the mission, or alone if the
    mission does not call it."""
    alone = load_tree(path, main_tree=subtree)
    # else there are several trees, of which none is the main one
    whole = attempt(lambda: load_tree(path), []) or alone
    calls = (node.children[0] for node in whole.nodes
             if node.spec.kind is Kind.SUBTREE and node.element.attributes.get("ID") == subtree)
    return next(calls, alone.root)
