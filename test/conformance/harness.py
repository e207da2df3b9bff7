"""Run the engine over recorded traces of BehaviorTree.CPP and say where it differs.

``python3 test/conformance/harness.py VECTORS [--level roots|leaves|full]``; VECTORS is a folder of
``*.json`` or a ``.jsonl`` or ``.jsonl.xz`` file in the format of the README beside the traces. Exit
code 0 only if every case passes.
"""
import argparse
import json
import lzma
import math
import os
import sys
import tempfile
from pathlib import Path
from typing import Any, Callable, Dict, Iterator, List, Optional, Tuple

from behavior_controller.bt.loader.tree_builder import build
from behavior_controller.bt.engine import leaf
from behavior_controller.bt.engine.builtins import builtin_specs
from behavior_controller.bt.engine.clock import Clock, ManualClock
from behavior_controller.bt.engine.node import Node, Result
from behavior_controller.bt.engine.tree import Tree
from behavior_controller.bt.engine import ports
from behavior_controller.bt.values.blackboard import Blackboard
from behavior_controller.bt.loader.document import Document, parse, read, with_includes
from behavior_controller.bt.engine.node_types import Registry
from behavior_controller.bt.engine.registry import Direction, Kind, NodeSpec, Port
from behavior_controller.bt.values.status import BY_NAME, IDLE, NAMES
from behavior_controller.errors import BehaviorControllerError

LEVELS = ("roots", "leaves", "full")
LEAF_EVENTS = ("tick", "halt", "port", "port_err", "out_err")
_ITEMS = {"S": "SUCCESS", "F": "FAILURE", "R": "RUNNING", "K": "SKIPPED", "I": "IDLE"}
_TYPES = {"status": "NodeStatus", "color": "enum"}
_DIRECTIONS = {"in": Direction.IN, "out": Direction.OUT, "inout": Direction.INOUT}
_STANDARD = {"Act": "stateful", "Cond": "cond", "SyncAct": "sync"}
COLOURS = {"RED": 1, "GREEN": 2, "BLUE": 3}


class _Leaf(Node):
    """A leaf that follows the script of its case and notes what it does."""

    events: List[Any]
    scripts: Dict[str, List[str]]
    emits: Dict[str, List[Any]]
    calls = 0

    def note(self, kind: str, *details: Any) -> None:
        """Record one event of this leaf."""
        self.events.append([kind, self.uid, self.name] + list(details))

    def act(self, callback: str) -> Result:
        """Read and write the ports, then take the next item of the script."""
        self.calls += 1
        for port in self.spec.ports:
            if port.direction is not Direction.OUT:
                self._read(port)
        for port in self.spec.ports:
            if self.emits.get(port.name):
                self._write(port)
        item = _nth(self._script(), self.calls)
        if item.startswith("X"):
            self.note("tick", "THROW", callback)
            raise RuntimeError("boom")
        if item.endswith("w"):
            self.wake()
        self.note("tick", _ITEMS[item[0]], callback)
        return BY_NAME[_ITEMS[item[0]]]

    def _script(self) -> List[str]:
        for key in (self.full_path, self.name, self.registration_id):
            if key in self.scripts:
                return self.scripts[key]
        return ["S"]

    def _read(self, port: Port) -> None:
        try:
            self.note("port", port.name, _plain(self.get_input(port.name)))
        except ports.PortError as error:
            self.note("port_err", port.name, str(error))

    def _write(self, port: Port) -> None:
        try:
            self.set_output(port.name, _nth(self.emits[port.name], self.calls))
        except ports.PortError as error:
            self.note("out_err", port.name, str(error))


class _Stateful(_Leaf, leaf.ActionLeaf):
    def on_start(self) -> Result:
        return self.act("start")

    def on_running(self) -> Result:
        return self.act("running")

    def on_halted(self) -> None:
        self.note("halt")


class _Sync(_Leaf, leaf.SyncActionLeaf):
    def update(self) -> Result:
        return self.act("tick")


class _Cond(_Leaf, leaf.ConditionLeaf):
    def update(self) -> Result:
        return self.act("tick")


_KINDS = {"stateful": (_Stateful, Kind.ACTION), "sync": (_Sync, Kind.ACTION),
          "cond": (_Cond, Kind.CONDITION)}


def _nth(items: List[Any], number: int) -> Any:
    """Return item ``number`` from 1; the last one repeats."""
    return items[min(number, len(items)) - 1]


def _plain(value: Any) -> Any:
    if isinstance(value, float) and not math.isfinite(value):
        return "nan" if math.isnan(value) else "inf" if value > 0 else "-inf"
    return NAMES[value] if not isinstance(value, (list, dict)) and value in NAMES else value


def registry_of(case: Dict[str, Any], events: List[Any]) -> Registry:
    registry = Registry(builtin_specs())
    types: Dict[str, Any] = dict(_STANDARD, **case.get("leaf_types", {}))
    if case.get("auto_register", True):
        for key in case["leaves"]:
            if '<{}'.format(key) in case["xml"] or 'ID="{}"'.format(key) in case["xml"]:
                types.setdefault(key, "stateful")
    for node_id, described in types.items():
        is_tree = 'BehaviorTree ID="{}"'.format(node_id) in case["xml"]
        if node_id not in registry and not is_tree or node_id in case.get("leaf_types", {}):
            registry.extend([_leaf_spec(node_id, described, case, events)])
    return registry


def _leaf_spec(node_id: str, described: Any, case: Dict[str, Any], events: List[Any]) -> NodeSpec:
    if isinstance(described, str):
        described = {"kind": described}
    leaf_class, kind = _KINDS[described["kind"]]
    given = described.get("ports", {})

    def factory(name: str) -> Node:
        node: Any = leaf_class(name)
        node.events, node.scripts = events, case["leaves"]
        node.emits = {port: detail.get("emit", []) for port, detail in given.items()
                      if detail.get("dir", "in") != "in"}
        return node

    node_ports = tuple(Port(name, _TYPES.get(detail.get("type", "any"), detail.get("type", "any")),
                            _DIRECTIONS[detail.get("dir", "in")], detail.get("default"))
                       for name, detail in given.items())
    return NodeSpec(node_id, kind, factory, node_ports)


def _written(values: Dict[str, Any], blackboard: Blackboard) -> None:
    for key, value in values.items():
        blackboard.set(key, value, "vec_int" if isinstance(value, list) else None)


def _documents(case: Dict[str, Any]) -> List[Document]:
    if case.get("load_api") == "createTreeFromFile":
        return with_includes(read(case["main_file"]))
    documents = with_includes(parse(case["xml"]))
    for text in case.get("extra_xml", ()):
        documents.extend(with_includes(parse(text)))
    return documents


def build_case(case: Dict[str, Any], events: List[Any]) -> Tree:
    blackboard = Blackboard()
    if "global_blackboard" in case:
        outside = Blackboard()
        _written(case["global_blackboard"], outside)
        blackboard = Blackboard(outside)
    _written(case.get("blackboard", {}), blackboard)
    clock = Clock() if case.get("tick_mode") == "while_running" else ManualClock()
    enums = dict(case.get("enums", {}))
    if "\"color\"" in json.dumps(case.get("leaf_types", {})):
        enums.update(COLOURS)
    return build(_documents(case), registry_of(case, events), clock=clock, blackboard=blackboard,
                 strict=True, main_tree=case.get("main_tree"), enums=enums,
                 substitutes=case.get("substitutions"))


def run(case: Dict[str, Any]) -> Dict[str, Any]:
    """Run one case and return what happened, in the form of its ``expected``."""
    events: List[Any] = []
    folder = os.getcwd()
    with tempfile.TemporaryDirectory() as scratch:
        for name, text in case.get("files", {}).items():
            path = os.path.join(scratch, name)
            os.makedirs(os.path.dirname(path), exist_ok=True)
            Path(path).write_text(text, "utf-8")
        try:
            os.chdir(scratch)
            tree = build_case(case, events)
        except BehaviorControllerError as error:
            return {"error": True, "message": str(error)}
        finally:
            os.chdir(folder)
    return _run_tree(case, tree, events)


def _run_tree(case: Dict[str, Any], tree: Tree, events: List[Any]) -> Dict[str, Any]:
    tree.subscribe(lambda node, old, new: events.append(
        ["status", node.uid, node.name, NAMES[old], NAMES[new]]))
    records: List[Dict[str, Any]] = []
    for number in range(1, case["max_ticks"] + 1):
        _before_tick(case, tree, events, records, number)
        record, threw = _tick(case, tree, events)
        records.append(record)
        if threw and not case.get("continue_after_exception"):
            break
        if case.get("stop_when_done") and record["root"] in ("SUCCESS", "FAILURE"):
            break
    if case.get("halt_at_end"):
        records.append(_halted(tree, events))
    tree.show_own_statuses()  # py_trees' tools are shown the results instead
    return {
        "nodes": [[node.uid, node.registration_id, node.name, node.full_path]
                  for node in tree.nodes],
        "ticks": records,
        "blackboard": {path: {key: _plain(entry.value) for key, entry in board.local.items()}
                       for path, board in tree.blackboards.items()},
        "final_status": {str(node.uid): NAMES[node.status] for node in tree.nodes
                         if node.status is not IDLE}}


def _before_tick(case: Dict[str, Any], tree: Tree, events: List[Any], records: List[Any],
                 number: int) -> None:
    if number in case.get("halt_before_tick", ()):
        records.append(_halted(tree, events))
    pause = case.get("sleep_ms_before_tick", {}).get(str(number))
    if pause and isinstance(tree.clock, ManualClock):
        tree.clock.advance(pause / 1000.0)
    _written(case.get("set_before_tick", {}).get(str(number), {}), tree.blackboard)


def _halted(tree: Tree, events: List[Any]) -> Dict[str, Any]:
    tree.halt()
    return {"halt_tree": True, "events": _taken(events)}


def _taken(events: List[Any]) -> List[Any]:
    taken = list(events)
    events.clear()
    return taken


def _tick(case: Dict[str, Any], tree: Tree, events: List[Any]) -> Tuple[Dict[str, Any], bool]:
    pause = case.get("while_running_sleep_ms", 1) / 1000.0
    ticks: Dict[str, Callable[[], Result]] = {
        "exactly_once": tree.tick_exactly_once, "once": tree.tick_once,
        "while_running": lambda: tree.tick_while_running(pause)}
    try:
        result = ticks[case.get("tick_mode", "exactly_once")]()
    except BehaviorControllerError as error:
        return {"root": None, "exception": {"type": type(error).__name__, "message": str(error)},
                "events": _taken(events)}, True
    return {"root": NAMES[result], "events": _taken(events)}, False


# ---------------------------------------------------------------------------------------- comparing


def differences(expected: Dict[str, Any], got: Dict[str, Any], level: str) -> List[str]:
    """Return what differs, most telling first; an empty list means equal. Texts of messages are not
    compared."""
    if expected.get("error") or got.get("error"):
        if bool(expected.get("error")) == bool(got.get("error")):
            return []
        return ["the library gives an error, the tree was made" if expected.get("error")
                else "unexpected error: {}".format(got["message"])]
    found = _tick_differences(expected["ticks"], got["ticks"], level)
    if level == "full":
        for key in ("nodes", "blackboard", "final_status"):
            if key in expected and not _equal(expected[key], got[key]):
                found.append("{}: {} instead of {}".format(key, got[key], expected[key]))
    return found


def _tick_differences(expected: List[Any], got: List[Any], level: str) -> List[str]:
    found = []
    if len(expected) != len(got):
        found.append("{} tick records instead of {}".format(len(got), len(expected)))
    for number, (wanted, seen) in enumerate(zip(expected, got), 1):
        if _root(wanted) != _root(seen):
            found.append("tick {}: root {} instead of {} {}".format(
                number, _root(seen), _root(wanted), seen.get("exception", "")))
        if level != "roots":
            found.extend("tick {}: {}".format(number, text)
                         for text in _event_difference(wanted, seen, level))
    return found


def _root(record: Dict[str, Any]) -> str:
    return "HALT" if record.get("halt_tree") else record.get("root") or "EXCEPTION"


def _event_difference(wanted: Dict[str, Any], seen: Dict[str, Any], level: str) -> Iterator[str]:
    left, right = ([
        event[:4] if event[0] in ("port_err", "out_err") else event for event in record["events"]
        if level == "full" or event[0] in LEAF_EVENTS] for record in (wanted, seen))
    for index in range(max(len(left), len(right))):
        pair = [side[index] if index < len(side) else None for side in (left, right)]
        if not _equal(*pair):
            yield "event {}: {} instead of {}".format(index, pair[1], pair[0])
            return


def _equal(left: Any, right: Any) -> bool:
    if type(left) is not type(right):
        return False
    if isinstance(left, dict):
        return left.keys() == right.keys() and all(_equal(left[key], right[key]) for key in left)
    if isinstance(left, list):
        return len(left) == len(right) and all(map(_equal, left, right))
    if isinstance(left, float):
        return left == right or abs(left - right) <= 1e-12 * max(1.0, abs(left))
    return bool(left == right)


def cases(path: str) -> Iterator[Dict[str, Any]]:
    """Yield the cases of a folder or file; a file of the folder holds a list of cases, or one."""
    if os.path.isdir(path):
        for name in sorted(os.listdir(path)):
            if name.endswith(".json"):
                found = json.loads(Path(os.path.join(path, name)).read_text("utf-8"))
                yield from found if isinstance(found, list) else [found]
    else:
        opened: Any = lzma.open(path, "rt", encoding="utf-8") if path.endswith(".xz") else open(
            path, encoding="utf-8")
        with opened as file:
            yield from map(json.loads, file)


def judge(case: Dict[str, Any], level: str) -> List[str]:
    """Run one case and return its differences. Cases of real time are compared by the root's
    results."""
    return differences(case["expected"], run(case), "roots" if case.get("timing") else level)


def main(argv: Optional[List[str]] = None) -> int:
    """Run the cases and print the differences and the sum. Return the exit code."""
    parser = argparse.ArgumentParser(prog="conformance", description=__doc__.split("\n")[0])
    parser.add_argument("vectors", help="a folder of *.json, or a .jsonl or .jsonl.xz file")
    parser.add_argument("--level", choices=LEVELS, default="full")
    parser.add_argument(
        "--may-differ",
        help="JSON file: cases that may differ, each with the reason, which is printed")
    options = parser.parse_args(argv)
    allowed = {}
    if options.may_differ:
        allowed = json.loads(Path(options.may_differ).read_text("utf-8"))
    passed = failed = 0
    for case in cases(options.vectors):
        found = judge(case, options.level)
        reason = allowed.get(case["name"])
        failed += bool(found) and reason is None
        passed += not found or reason is not None
        if found:
            print("{}: {}{}".format(case["name"], found[0],
                                    " (may differ: {})".format(reason) if reason else ""))
    print("{} passed, {} failed".format(passed, failed))
    return 1 if failed or not passed else 0


if __name__ == "__main__":
    sys.exit(main())
