"""Where the configuration and the missions are, in the source tree and when installed, without asking ROS."""
import os

_HERE = os.path.dirname(os.path.abspath(__file__))


def share() -> str:
    """Return the folder that holds ``config`` and ``data``: the package's root, or its share folder when installed."""
    folder = os.path.realpath(_HERE)
    while True:
        for candidate in (folder, os.path.join(folder, "share", "cssr_system")):
            if os.path.isdir(os.path.join(candidate, "data")) and os.path.isdir(os.path.join(candidate, "config")):
                return candidate
        parent = os.path.dirname(folder)
        if parent == folder:
            return os.getcwd()
        folder = parent


def config(name: str) -> str:
    """Return the path of a file in ``config``."""
    return os.path.join(share(), "config", name)


def data(name: str) -> str:
    """Return the path of a file in ``data``."""
    return os.path.join(share(), "data", name)


def mission(name: str) -> str:
    """Return the path of the mission called ``name``, with or without ``.xml``."""
    return data(name if name.endswith(".xml") else name + ".xml")


RECORDS = "behaviorController_records"
"""Folder among ROS' logs that has a folder for each recorded run; their names sort by time."""


def records() -> str:
    """Return the folder of the recorded runs, below the folder that ``rospkg.get_log_dir()`` returns."""
    home = os.environ["ROS_HOME"] if "ROS_HOME" in os.environ else os.path.join(os.path.expanduser("~"), ".ros")
    logs = os.environ["ROS_LOG_DIR"] if "ROS_LOG_DIR" in os.environ else os.path.join(home, "log")
    return os.path.join(logs, RECORDS)
