"""Finds ROS packages as ``rospack`` does, without ROS, and whatever their package.xml may be."""
import contextlib
import itertools
import os
import re
from typing import Iterator, List, Optional, Set

from behavior_controller.text import Unreadable, read_bytes

MANIFEST = "package.xml"
MOST_FOLDERS = 20_000  # in which a package is looked for by its name
_NAME = re.compile(rb"<name>\s*([^<\s]+)\s*</name>")
_IGNORED = ("CATKIN_IGNORE", "COLCON_IGNORE", "AMENT_IGNORE")


def package_folder(name: str) -> Optional[str]:
    """Return the folder of a package below ROS_PACKAGE_PATH, the first that has it; None if none
    does.

    This is for ``<include ros_pkg="…" path="…"/>``.
    """
    folders = [os.path.join(root, name) for root in _roots()]
    for folder in itertools.chain(folders, package_folders(MOST_FOLDERS)):
        with contextlib.suppress(Unreadable):
            if package_name(read_bytes(os.path.join(folder, MANIFEST))) == name:
                return folder
    return None


def package_name(manifest: bytes) -> Optional[str]:
    """Return the name that the content of a package.xml gives, or None."""
    match = _NAME.search(manifest)
    return match.group(1).decode("utf-8", "replace") if match is not None else None


def package_folders(most: Optional[int] = None) -> Iterator[str]:
    """Yield every folder below ROS_PACKAGE_PATH that has a package.xml, the first roots first; a
    package holds no other.

    At most ``most`` folders are looked at.
    """
    seen: Set[str] = set()  # where links lead to: they may lead to themselves
    walks = itertools.chain.from_iterable(os.walk(root, followlinks=True) for root in _roots())
    for folder, inner, files in itertools.islice(walks, most):
        if MANIFEST in files:
            yield folder
        if MANIFEST in files or any(name in files for name in _IGNORED):
            inner.clear()
        inner[:] = [name for name in sorted(inner)
                    if not name.startswith(".") and _is_new(os.path.join(folder, name), seen)]


def _roots() -> List[str]:
    return [root for root in os.environ.get("ROS_PACKAGE_PATH", "").split(os.pathsep) if root]


def _is_new(folder: str, seen: Set[str]) -> bool:
    """Whether no link has led to ``folder`` before."""
    if not os.path.islink(folder):
        return True
    target = os.path.realpath(folder)
    is_new = target not in seen
    seen.add(target)
    return is_new
