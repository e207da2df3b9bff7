"""BehaviorTree.CPP version 4 on py_trees. Knows neither ROS nor this robot.

A file goes through ``language`` (XML with places, scripts), ``checking`` (every fault), ``compiler`` (the tree); a tree
runs through ``engine`` (the tick pipeline that all nodes share). ``registry`` declares the node types.
"""
import importlib.util
import os
import re

OLDEST_PY_TREES = (2, 2)


def _refuse_older_py_trees() -> None:
    """Raise ImportError with one line for an operator if the py_trees that Python finds first is too old.

    ROS Noetic has a 0.7 of its own. Its version is read, not imported: an old one may not even load.
    """
    spec = importlib.util.find_spec("py_trees")
    for folder in spec.submodule_search_locations or () if spec is not None else ():
        try:
            with open(os.path.join(folder, "version.py"), encoding="utf-8") as file:
                found = re.search(r"""__version__ = ["'](([0-9]+)\.([0-9]+)[^"']*)""", file.read())
        except OSError:
            continue
        if found is not None and (int(found.group(2)), int(found.group(3))) < OLDEST_PY_TREES:
            raise ImportError(
                "py_trees {} in {} is found first and too old, {}.{} or newer is needed (remove it, or put a newer one "
                "before it on PYTHONPATH)".format(found.group(1), folder, *OLDEST_PY_TREES), name="py_trees")


_refuse_older_py_trees()
