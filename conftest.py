"""Check the thread rule in all tests; skip by name the test modules that need ROS where the interpreter has none."""
import ast
import importlib.util
import os
from typing import Iterator

import pytest

os.environ.setdefault("BEHAVIOR_CONTROLLER_CHECK_THREADS", "1")  # before anything of ours is imported

ROS = {"actionlib", "actionlib_msgs", "cssr_system", "genpy", "geometry_msgs", "rosgraph", "roslaunch", "roslib", "rospy",
       "rostest", "std_msgs"}


class _WithoutRos(pytest.Module):
    """A test module that cannot be imported here."""

    def collect(self):
        """Skip the module as a whole."""
        pytest.skip("needs ROS, which this interpreter does not have", allow_module_level=True)


def _imports(path) -> Iterator[str]:
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            yield node.module
            yield from ("{}.{}".format(node.module, alias.name) for alias in node.names)


def _needs_ros(name: str) -> bool:
    return name.split(".")[0] in ROS or (name + ".").startswith(("behavior_controller.ros.", "unit_tests.nodes."))


def pytest_pycollect_makemodule(module_path, parent):
    """Replace a module that imports ROS, or a part of ours that does, if there is no rospy."""
    if importlib.util.find_spec("rospy") is None and any(map(_needs_ros, _imports(module_path))):
        return _WithoutRos.from_parent(parent, path=module_path)
    return None
