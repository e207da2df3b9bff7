"""rospy's log file: opened only if it can be written, as rospy opens it under the lock that every
line needs."""
import os
import stat

import rospkg
import rospy
from rosgraph.roslogging import configure_logging, makedirs_with_parent_perms


def path() -> str:
    """Return the path of the log file of this node, whose name is known: that of ``__log``, or one
    in ROS' log folder."""
    given = rospy.names.get_mappings().get("__log")
    name = rospy.get_name().strip("/").replace("/", "_") + ".log"
    return os.path.abspath(given) if given else os.path.join(rospkg.get_log_dir(), name)


def open_log(path: str) -> None:
    """Have rospy write the log file. Raises OSError if that is not possible; may hang with the
    disk."""
    makedirs_with_parent_perms(os.path.dirname(path))
    if os.path.exists(path) and not stat.S_ISREG(os.stat(path).st_mode):
        raise OSError("it is not a regular file")
    os.close(os.open(path, os.O_WRONLY | os.O_APPEND | os.O_CREAT, 0o666))
    # as rospy does, but without a link "latest" beside the folder that __log names
    configure_logging("rospy", filename=path, env={"ROS_LOG_DIR": os.path.dirname(path)})


def leave_as_it_is() -> None:
    """Have ``rospy.init_node`` open no log file: it would be the second time, or it would hang."""
    rospy.core.configure_logging = lambda *_: None
