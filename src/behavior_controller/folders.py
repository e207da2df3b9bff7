"""Where the configuration and the missions are, in the source tree and when installed, without
asking ROS."""
import os
import pathlib

_HERE = os.path.dirname(os.path.abspath(__file__))


def share(module_folder: str = _HERE, package: str = "cssr_system") -> str:
    """Return the folder that holds ``config`` and ``data`` of a package with this folder of
    modules: the package's root, or its share folder when installed."""
    here = pathlib.Path(module_folder).resolve()
    for folder in (here, *here.parents):
        for candidate in (folder, folder / "share" / package):
            if os.path.isdir(candidate / "config") and os.path.isdir(candidate / "data"):
                return str(candidate)
    return os.getcwd()


def config(name: str) -> str:
    """Return the path of a file in ``config``."""
    return os.path.join(share(), "config", name)


def data(name: str) -> str:
    """Return the path of a file in ``data``."""
    return os.path.join(share(), "data", name)


def mission(name: str) -> str:
    """Return the path of the mission called ``name``, with or without ``.xml``."""
    return data(name if name.endswith(".xml") else name + ".xml")


def of_mission(path: str, mission: str) -> str:
    """Return the file that a mission has of its own in place of ``path``, such as
    reception_phrases_English.ini beside phrases_English.ini, or else ``path``."""
    folder, name = os.path.split(path)
    own = os.path.join(folder, f"{mission}_{name}")
    if mission and os.path.isfile(own):
        return own
    return path


RECORDS = "behaviorController_records"
"""Folder among ROS' logs that has a folder for each recorded run."""


def ros_home() -> str:
    """Return ROS_HOME, the folder where ROS programs of this user may write."""
    return os.environ.get("ROS_HOME") or os.path.join(os.path.expanduser("~"), ".ros")


def records() -> str:
    """Return the folder of the recorded runs, below the folder that ``rospkg.get_log_dir()``
    returns."""
    logs = os.environ.get("ROS_LOG_DIR", os.path.join(ros_home(), "log"))
    return os.path.join(logs, RECORDS)


def mission_name(file: str) -> str:
    """Return the name of a mission, from its file."""
    return os.path.splitext(os.path.basename(file))[0]
