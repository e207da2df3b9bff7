"""Finds ROS packages by name as ``rospack`` does, without ROS: for ``<include ros_pkg="…" path="…"/>``."""
import itertools
import os
import re
from typing import Iterator, List, Optional

from behavior_controller.text import Unreadable, read_text

MOST_FOLDERS = 20_000  # that are looked at, in all
_NAME = re.compile(r"<name>\s*([^<\s]+)\s*</name>")
_IGNORED = ("CATKIN_IGNORE", "COLCON_IGNORE", "AMENT_IGNORE")


def package_folder(name: str) -> Optional[str]:
    """Return the folder of a package below ROS_PACKAGE_PATH, the first that has it; None if none does."""
    roots = [root for root in os.environ.get("ROS_PACKAGE_PATH", "").split(os.pathsep) if root]
    for root in roots:
        direct = os.path.join(root, name)
        if _is_package(direct, name):
            return direct
    return next((folder for folder in _packages(roots) if _is_package(folder, name)), None)


def _packages(roots: List[str]) -> Iterator[str]:
    for folder, inner, files in itertools.islice(itertools.chain.from_iterable(map(os.walk, roots)), MOST_FOLDERS):
        if "package.xml" in files:
            yield folder
        if "package.xml" in files or any(name in files for name in _IGNORED):
            inner.clear()  # a package holds no other
        inner[:] = sorted(name for name in inner if not name.startswith("."))


def _is_package(folder: str, name: str) -> bool:
    try:
        found = _NAME.search(read_text(os.path.join(folder, "package.xml")))
    except Unreadable:
        return False
    return found is not None and found.group(1) == name
