"""Check the thread rule in all tests; skip by name the test modules that need ROS where the
interpreter has none.

What a test prints is made printable: some print half characters, which pytest-xdist cannot send.
The plugin for rostest files is tools/rostest_items.py.
"""
import ast
import importlib.util
import os
from typing import Iterator

import pytest

# before anything of ours is imported
os.environ.setdefault("BEHAVIOR_CONTROLLER_CHECK_THREADS", "1")

pytest_plugins = ["rostest_items"]
ROS = {
    "actionlib", "actionlib_msgs", "cssr_system", "diagnostic_msgs", "genpy", "geometry_msgs",
    "rosgraph", "roslaunch", "roslib", "rospy", "rostest", "std_msgs", "std_srvs"
}


class _WithoutRos(pytest.Module):
    """A test module of an interpreter that has no ROS."""

    def collect(self):
        """Skip the module as a whole if it cannot be imported here."""
        if any(map(_needs_ros, _imports(self.path))):
            pytest.skip("needs ROS, which this interpreter does not have", allow_module_level=True)
        return super().collect()


def _imports(path) -> Iterator[str]:
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            yield node.module
            yield from ("{}.{}".format(node.module, alias.name) for alias in node.names)


def _needs_ros(name: str) -> bool:
    return name.split(".")[0] in ROS or (name + ".").startswith(
        ("behavior_controller.ros.", "unit_tests.robot.ros_nodes.", "unit_tests.robot.claims.",
         "unit_tests.robot.ros_messages.", "unit_tests.run.controller."))


def pytest_pycollect_makemodule(module_path, parent):
    """Look at what a module imports before it is collected, if there is no rospy."""
    if importlib.util.find_spec("rospy") is None:
        return _WithoutRos.from_parent(parent, path=module_path)
    return None


@pytest.hookimpl(hookwrapper=True)
def pytest_runtest_makereport(item):
    """Write half characters in the output of the test as escapes."""
    report = (yield).get_result()
    report.sections = [(name, text.encode("utf-8", "backslashreplace").decode())
                       for name, text in report.sections]
