"""Describes a tree for the record: its nodes, their ports, and the document that Groot2 asks for.
"""
import itertools
from typing import Any, Callable, Dict, List, Optional, Sequence
from xml.sax.saxutils import quoteattr

from behavior_controller.bt.engine.node import Node, label
from behavior_controller.bt.engine.ports import reference
from behavior_controller.bt.engine.successors import Successors
from behavior_controller.bt.engine.tree import Tree
from behavior_controller.bt.linter.palette import tree_nodes_model
from behavior_controller.bt.loader.structure import CONDITIONS
from behavior_controller.bt.engine.registry import Kind, NodeSpec
from behavior_controller.run.events import PortText, TreeNode, TreeShown
from behavior_controller.text import clean


Describe = Callable[[Tree, int], TreeShown]
"""Makes the event for a tree that is going to run, and for its number."""


def shown(tree: Tree, number: int = 1, specs: Sequence[NodeSpec] = (),
          times: Sequence[str] = ()) -> TreeShown:
    """Return the event for a tree that is going to run, the ``number``-th of the run. ``specs`` are
    the node types to describe, and ``times`` the entries whose values are times of the mission's
    clock."""
    types = {node.registration_id for node in tree.nodes}
    successors = Successors(tree.nodes)
    return TreeShown(
        tree.id, [_shown_node(node, successors) for node in tree.nodes], list(tree.blackboards),
        {spec.id: spec.summary for spec in specs if spec.id in types}, full_tree(tree, specs),
        list(times), number)


def _shown_node(node: Any, successors: Successors) -> TreeNode:
    name, kind = label(node)
    parent, is_bare = 0, False
    if node.parent is not None:
        parent, is_bare = node.parent.uid, _is_bare(node.spec, node.name)
    place = node.place_in_file().rstrip(": ")
    return TreeNode(
        node.full_path, node.registration_id, node.name, parent, _pause(node), successors.of(node),
        clean(name), clean(kind), is_bare, node.blackboard.path, place, _ports(node))


def _pause(node: Node) -> float:
    if not node.spec.pause:
        return 0.0
    milliseconds = node.attributes.get(node.spec.pause, "")
    return int(milliseconds) / 1000.0 if milliseconds.isdecimal() else -1.0


def _is_bare(spec: NodeSpec, name: str) -> bool:
    """Whether a node below the root, with that name, only says how the mission is put together."""
    return spec.is_recovery or spec.kind in (Kind.CONTROL, Kind.DECORATOR) and name == spec.id


def _ports(node: Node) -> List[PortText]:
    defaults = {port.name: port.default for port in node.spec.ports if port.default is not None}
    given = node.attributes if node.element is None else node.element.attributes
    ports = []
    for name, text in {**defaults, **node.attributes}.items():
        key, entry = reference(text, name), ""
        if key is not None:
            board, home = node.blackboard.home(key)
            entry = board.prefix + home
        ports.append(PortText(name, text, entry, name in given))
    return ports


# ------------------------------------------------------------------------------------------- Groot2


def full_tree(tree: Tree, specs: Sequence[NodeSpec]) -> str:
    """Return the tree as Groot2 reads it: a ``<BehaviorTree>`` for each subtree instance, then the
    model. Takes no recursion, however deep the tree is."""
    texts: Dict[str, List[str]] = {}  # of each instance, by path
    unclosed: Dict[str, List[Node]] = {path: [] for path in tree.blackboards}
    for node in tree.nodes:
        path, parent = node.blackboard.path, node.parent
        if path not in texts:
            name = tree.id
            if parent is not None:
                name = parent.attributes["ID"]
            texts[path] = [_tag("BehaviorTree", {"ID": name, "_fullpath": path})]
        _close(texts[path], unclosed[path], parent)
        texts[path].append(_tag(node.registration_id, _attributes(node)))
        unclosed[path].append(node)
    for path, text in texts.items():
        _close(text, unclosed[path])
        text.append("</BehaviorTree>")
    trees = "".join(itertools.chain(*texts.values()))
    return f'<root BTCPP_format="4">{trees}{tree_nodes_model(specs)}</root>'


def _tag(name: str, attributes: Dict[str, str]) -> str:
    words = "".join(f" {key}={quoteattr(text)}" for key, text in attributes.items())
    return f"<{name}{words}>"


def _close(text: List[str], unclosed: List[Node], parent: Optional[Node] = None) -> None:
    """Close the elements that are no parents of what follows below ``parent``."""
    while unclosed and unclosed[-1] is not parent:
        text.append(f"</{unclosed.pop().registration_id}>")


def _attributes(node: Node) -> Dict[str, str]:
    """Return the attributes of a node's element."""
    shown, names = {"name": node.name}, {port.name for port in node.spec.ports}
    if node.registration_id == "SubTree":
        shown = {"ID": node.attributes["ID"], "_fullpath": node.children[0].blackboard.path}
        names = {key for key in node.attributes if key not in ("ID", "name") and key[:1] != "_"}
    given = {key: text for key, text in node.attributes.items()
             if key in names or key in CONDITIONS}
    return {**shown, "_uid": str(node.uid), **given}
