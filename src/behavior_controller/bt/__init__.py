"""BehaviorTree.CPP version 4 on py_trees, independent of ROS and of this robot; docs/engine.md
shows how to use it alone.

Its folders use one another one way: ``values`` < ``script`` < ``engine`` (node types, and the tick
pipeline that all nodes share) < ``loader`` (from a file to every fault and the tree) < ``linter``
(warnings). The names in ``__all__`` are for use outside of the project; changes of their meaning
are listed in the changelog.
"""
import importlib.util
import os
import re

OLDEST_PY_TREES = (2, 2)


def _refuse_older_py_trees() -> None:
    """Raise ImportError with one line for an operator if the py_trees that Python finds first is
    too old.

    ROS Noetic installs version 0.7. The version is read, not imported: an old one may fail to load.
    """
    spec = importlib.util.find_spec("py_trees")
    for folder in spec.submodule_search_locations or () if spec is not None else ():
        try:
            with open(os.path.join(folder, "version.py"), encoding="utf-8") as file:
                match = re.search(r"""__version__ = ["'](([0-9]+)\.([0-9]+)[^"']*)""", file.read())
        except OSError:
            continue
        if match is not None and (int(match.group(2)), int(match.group(3))) < OLDEST_PY_TREES:
            oldest = ".".join(map(str, OLDEST_PY_TREES))
            raise ImportError(f"py_trees {match.group(1)} in {folder} is found first and too old, "
                              f"{oldest} or newer is needed (remove it, or put a newer one before "
                              "it on PYTHONPATH)", name="py_trees")


_refuse_older_py_trees()

# after the check, which has the better message
from behavior_controller.bt.linter.palette import tree_nodes_model
from behavior_controller.bt.mission import load_mission as load, load_text
from behavior_controller.bt.engine.builtins import builtin_specs
from behavior_controller.bt.engine.clock import Clock, ManualClock
from behavior_controller.bt.engine.controls import Control
from behavior_controller.bt.engine.decorators import Decorator
from behavior_controller.bt.engine.leaf import ActionLeaf, ConditionLeaf, SyncActionLeaf
from behavior_controller.bt.engine.node import ConfigureError, Node, NodeError, Result, TickError
from behavior_controller.bt.engine.node_types import Registry
from behavior_controller.bt.engine.tree import Tree
from behavior_controller.bt.values.blackboard import Blackboard
from behavior_controller.bt.engine.ports import NoValue, PortError
from behavior_controller.bt.values.values import PortType, ValueFault
from behavior_controller.bt.engine.possible_results import FAILS, SKIPS, SUCCEEDS
from behavior_controller.bt.engine.registry import Direction, Kind, NodeSpec, Port
from behavior_controller.bt.values.status import FAILURE, IDLE, RUNNING, SKIPPED, SUCCESS
from behavior_controller.errors import BehaviorControllerError, Fault, MissionError

__all__ = [
    # to declare node types
    "Registry", "builtin_specs", "NodeSpec", "Kind", "Port", "Direction", "PortType",
    "SUCCEEDS", "FAILS", "SKIPS", "tree_nodes_model",
    # to write them
    "ActionLeaf", "SyncActionLeaf", "ConditionLeaf", "Decorator", "Control", "Node", "Result",
    "IDLE", "RUNNING", "SUCCESS", "FAILURE", "SKIPPED",
    # to run a file
    "load", "load_text", "Tree", "Blackboard", "Clock", "ManualClock",
    # what can be wrong
    "BehaviorControllerError", "MissionError", "Fault", "TickError", "NodeError", "ConfigureError",
    "PortError", "NoValue", "ValueFault"]
