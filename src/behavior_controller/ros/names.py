"""The names of a process whose robot is one of several (key ``robot``): all are below the robot's
namespace, unless they are remapped."""
from typing import List

import rospy
from rosgraph.names import get_ros_namespace, load_mappings, resolve_name

from behavior_controller.errors import ConfigurationError
from behavior_controller.ros.types import CLOCK, TYPES


def words_of(robot: str, words: List[str]) -> List[str]:
    """Return ``words``, a command line for rospy, with the namespace of a robot, and with a
    remapping of each name that a robot may offer.

    A remapping that is given counts, be it of the document's name or of the one below the robot's
    namespace. Raises ConfigurationError if the process is in another namespace.
    """
    if not robot:
        return words
    below, own = "/" + robot, get_ros_namespace(argv=words)
    if own not in ("/", below + "/"):
        raise ConfigurationError.of(
            f"robot {robot}", f"__ns or ROS_NAMESPACE gives the namespace {own[:-1]}, and the "
            f"robot is below {below}", "leave one of the two out")
    node = below + "/node"  # names are relative to that of a node
    given = {resolve_name(one, node): resolve_name(other, node)
             for one, other in load_mappings(words).items() if not one.startswith("__")}
    names = dict.fromkeys(offer.name for offer in TYPES if offer is not CLOCK)
    return words + ["__ns:=" + below] + [
        f"{name}:={given.get(below + name, below + name)}" for name in names if name not in given]


def enter(words: List[str]) -> None:
    """Have rospy resolve names in the namespace of a command line."""
    rospy.names._set_caller_id(get_ros_namespace(argv=words) + "unnamed")
