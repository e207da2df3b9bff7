"""The node's name at the ROS master: which node takes it, and which one gives way.

A master keeps one node for each name: the last that registered anything. It asks the one before to
end. Several nodes that start at the same moment register in turn, so that the master asks each of
them to end. So a node that is asked checks who has the name after its own registrations are
complete: the registered node stays, and a node that gives way registers nothing any more. Thus
exactly one node stays, whatever the order was.
"""
import socket
import urllib.parse
from typing import Any, List, Optional

import rosgraph
import rospy
import rospy.impl.init
from rospy.impl.masterslave import ROSHandler
from rospy.impl.paramserver import get_param_server_cache

from behavior_controller.ros.timeouts import Stopped
from behavior_controller.errors import ConfigurationError, NodesMissing
from behavior_controller.ros.tcpros import Trouble, ask_master
from behavior_controller.ros.master import DIRECTORY, NAME_IS_TAKEN

NO_TOPICS_IN_ROSOUT = "/rosout_disable_topics_generation"

PARTING_LIMIT = 2.5
"""Seconds that the former node of the name may take to end; ours take 2 at most."""


def adopt(name: str, argv: List[str]) -> None:
    """Have rospy resolve names as the node ``name`` does, without registering it at the master.

    Raises NodesMissing if no master answers, and ConfigurationError for a ``__name`` that is not
    allowed.
    """
    is_silent = _ask("getParam", NO_TOPICS_IN_ROSOUT)
    # rospy would ask the master at each line for /rosout. A master that hangs would hold the lines
    # back, and that question registers the node: asked by a node whose name was taken, it would
    # shut down the one that took it.
    get_param_server_cache().set(NO_TOPICS_IN_ROSOUT, bool(is_silent))
    rospy.names.reload_mappings(argv)
    name = rospy.names.get_mappings().get("__name", name)
    if not rosgraph.names.is_legal_base_name(name):
        raise ConfigurationError.of(
            "argument __name:=" + name, "this is not the name of a node",
            "allowed: a letter, then letters, digits and _; __ns:= sets the namespace")
    resolved = rosgraph.names.resolve_name(name, rospy.get_name())
    rospy.names._set_caller_id(resolved)
    rospy.names.initialize_mappings(resolved)
    # leaves are set up before the name is taken, and may ask for the time
    rospy.rostime.set_rostime_initialized(True)


def _ask(method: str, argument: str) -> Any:
    try:
        return ask_master(method, argument)
    except Trouble as trouble:
        if isinstance(trouble.__cause__, ConnectionRefusedError):
            raise NodesMissing(f"no ROS master at {rosgraph.get_master_uri()}: start roscore or "
                               "the robot, or set ROS_MASTER_URI")
        raise NodesMissing(f"{trouble}; check roscore's computer and ROS_MASTER_URI")


def join(name: str, argv: List[str]) -> Optional[str]:
    """Register the node ``name`` at the master; a running node of that name ends.

    Return the address of the former node if it has not ended in ``PARTING_LIMIT`` seconds. Raises
    ``Stopped``, ConfigurationError, and NodesMissing without a master.
    """
    former = _ask("lookupNode", rospy.get_name())
    rospy.impl.init.ROSHandler = _Handler
    try:
        with DIRECTORY.registering:
            rospy.init_node(name, argv=argv, disable_signals=True)
    except (rospy.ROSException, ValueError) as error:
        if rospy.is_shutdown():
            raise Stopped("rospy has ended meanwhile")  # and has reported the reason
        raise ConfigurationError.of("command line", str(error))
    is_other = former not in (None, rospy.core.get_node_uri())
    return former if is_other and not _ends(former) else None


class _Handler(ROSHandler):
    """Answers the master and other nodes in rospy's place."""

    def shutdown(self, caller_id: str, msg: str = "") -> object:
        """End the node, unless the reason is another node of its name, and that one is not
        registered."""
        if NAME_IS_TAKEN in msg and _has_name():
            return 1, "the name is still taken by this node", 0
        return super().shutdown(caller_id, msg)


def _has_name() -> bool:
    """Return whether no other node has our name, once our registrations under way are complete."""
    with DIRECTORY.registering:
        try:
            return ask_master("lookupNode", rospy.get_name()) in (None, rospy.core.get_node_uri())
        except Trouble:
            return False


def _ends(uri: str) -> bool:
    """Return whether the process of the node at ``uri`` ends in time: its end closes every
    connection."""
    address = urllib.parse.urlsplit(uri)
    try:
        with socket.create_connection((address.hostname, address.port),
                                      PARTING_LIMIT) as connection:
            return not connection.recv(1)
    except socket.timeout:
        return False
    except (OSError, ValueError, TypeError):
        return True
