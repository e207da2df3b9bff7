"""The words of a command line that ROS reads, or roslaunch was given; needs no py_trees, as
missionStatus does not."""
import argparse
import contextlib
import os
import re
import sys
from typing import List, NoReturn, Optional, Sequence
from xml.etree import ElementTree

from behavior_controller import folders
from behavior_controller.ros_packages import MANIFEST
from behavior_controller.text import bracketed, did_you_mean

ASSIGNMENT = ":="

ROS_WORDS = ("__name", "__log", "__ns", "__ip", "__hostname", "__master")
"""The names that every ROS node reads."""

PACKAGE = "cssr_system"

_PACKAGE = re.compile(r"[a-z]\w*")


def version() -> str:
    """Return the version in the package's manifest, or the one that pip has installed."""
    with contextlib.suppress(OSError, ElementTree.ParseError):
        manifest = ElementTree.parse(os.path.join(folders.share(), MANIFEST))
        return manifest.findtext("version") or "unknown"
    from importlib import metadata  # takes long, and is seldom needed
    try:
        return metadata.version(PACKAGE)
    except metadata.PackageNotFoundError:
        return "unknown"


class CommandParser(argparse.ArgumentParser):
    """The options of a command; it suggests the nearest one for an unknown one."""

    def __init__(self, command: str, description: str, exit_codes: str):
        """``exit_codes`` ends the help: the codes, each with its meaning."""
        super().__init__(prog=command, description=description, allow_abbrev=False,
                         epilog="exit code: " + exit_codes)
        self.add_argument("--version", action="version", version="%(prog)s " + version())

    def error(self, message: str) -> NoReturn:
        """Exit with that message."""
        unknown = message.partition("unrecognized arguments: ")[2].split(" ")[0]
        options = [option for action in self._actions for option in action.option_strings]
        super().error(message + bracketed(did_you_mean(unknown.partition("=")[0], options)))


def parse(parser: argparse.ArgumentParser,
          words: Optional[Sequence[str]] = None) -> argparse.Namespace:
    """Return the arguments of a command that is no ROS node: only the words that roslaunch adds are
    ignored."""
    words = sys.argv[1:] if words is None else words
    others = [word for word in words if word.partition(ASSIGNMENT)[0] not in ROS_WORDS]
    for word in others:
        if re.match(r"\w+:=", word):
            parser.error("unrecognized argument: " + word)
    return parser.parse_args(others)


def port(text: str, least: int = 0) -> int:
    """Return the port that an argument names."""
    if not text.isdecimal() or not least <= int(text) <= 65535:
        raise argparse.ArgumentTypeError(f"{text!r} is not a port: {least} to 65535")
    return int(text)


def explain_node(name: str, does: str, exit_codes: str) -> None:
    """End a ROS node with its help or its version if its first argument asks for one of them."""
    asked = [word for word in sys.argv[1:2] if word in ("-h", "--help", "--version")]
    CommandParser(name, does, exit_codes).parse_args(asked)


# ---------------------------------------------------------------------------------------- roslaunch


def parent_command() -> List[str]:
    """Return the command line of the parent process; empty if it cannot be read."""
    with contextlib.suppress(OSError), open(f"/proc/{os.getppid()}/cmdline", "rb") as file:
        return file.read().decode(errors="replace").split("\0")[:-1]
    return []


def given_to_roslaunch(command: Sequence[str], package: str, launch_file: str) -> List[str]:
    """Return the arguments that a command line passes to our launch file: roslaunch ignores those
    that it does not declare.

    Another package may have a launch file of the same name.
    """
    is_ours = any(os.path.basename(word) == launch_file and (
        word != launch_file or before == package or not _PACKAGE.fullmatch(before))
        for before, word in zip(command, command[1:]))
    if not is_ours:
        return []
    return [word for word in command if ASSIGNMENT in word and not word.startswith("__")]


def is_roslaunch(command: Sequence[str]) -> bool:
    """Return whether a command line runs roslaunch or rostest, directly or through an interpreter.
    """
    return not {"roslaunch", "rostest"}.isdisjoint(map(os.path.basename, command[:2]))
