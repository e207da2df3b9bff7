"""A tree as graphviz draws it, for py-trees-render and the page: each node has the number that Groot2 and the page give it."""
import copy
import shutil
import subprocess
from typing import Any, Collection, Dict

from py_trees.common import VisibilityLevel
from py_trees.display import dot_tree

from behavior_controller.bt.engine.node import Node, label
from behavior_controller.bt.engine.tree import Tree
from behavior_controller.errors import BehaviorControllerError

LIMIT = 30.0
"""Seconds that graphviz may take."""

MOST_NODES = 2000
"""Nodes of a tree that is drawn: graphviz takes minutes, and much memory, for more."""


class NotDrawn(BehaviorControllerError):
    """The tree was not drawn; the text says why."""


def name_for_drawing(node: Any) -> None:
    """Rename ``node`` to its name, type and uid: py_trees draws nodes of the same name as one."""
    node.name = " ".join(label(node)).replace(":", "∶")  # in the dot language what follows a colon is a port
    # else py_trees puts a symbol before the name that few fonts have; the label has the type
    setattr(node, "memory", False)


def _drawable(root: Node, title: str, left_out: Collection[int]) -> Node:
    """Return a copy of the running tree, with names for a drawing; ``title`` is the root's name."""
    copies: Dict[int, Node] = {}
    waiting = [root]
    while waiting:
        node = waiting.pop()
        waiting += reversed(node.children)
        above = copies[node.parent.uid] if node.parent is not None else None
        if above is not None and node.uid in left_out:
            copies[node.uid] = above  # what is below it hangs there
            continue
        drawn = copies[node.uid] = copy.copy(node)
        name_for_drawing(drawn)
        drawn.children = []
        if above is not None:
            above.children.append(drawn)
    copies[root.uid].name = title
    return copies[root.uid]


def svg(tree: Tree, title: str, left_out: Collection[int] = ()) -> bytes:
    """Return the drawing of a tree as SVG, without the nodes below the root whose uids are ``left_out``. Raises NotDrawn.

    It may take seconds: not for a thread that must not wait.
    """
    count = len(tree.nodes) - len(left_out)
    if shutil.which("dot") is None:
        raise NotDrawn("graphviz is not installed: apt-get install graphviz")
    if count > MOST_NODES:
        raise NotDrawn("the tree has {} nodes; trees of at most {} are drawn".format(count, MOST_NODES))
    try:
        text = dot_tree(_drawable(tree.root, title, left_out), visibility_level=VisibilityLevel.ALL).to_string()
        done = subprocess.run(["nice", "dot", "-Tsvg"], input=text.encode("utf-8", "backslashreplace"),
                              stdout=subprocess.PIPE, stderr=subprocess.PIPE, timeout=LIMIT, check=True)
    except RecursionError:
        raise NotDrawn("the tree is too deep to be drawn")
    except subprocess.TimeoutExpired:
        raise NotDrawn("graphviz did not draw the tree within {:g} s".format(LIMIT))
    except (OSError, subprocess.CalledProcessError) as error:
        said = getattr(error, "stderr", b"").decode("utf-8", "replace").strip()
        raise NotDrawn("graphviz cannot draw the tree: {}".format(said or error))
    return done.stdout
