"""Builds the mission for the node: its files, overridden by the node's parameters and arguments."""
import contextlib
import sys
from dataclasses import replace
from typing import Any, Callable, Dict

import rospy
from rosgraph.names import get_ros_namespace

from behavior_controller import folders, ros_arguments
from behavior_controller.config import settings
from behavior_controller.missions import load
from behavior_controller.bt.engine.clock import Clock
from behavior_controller.wakeup import WakeUp
from behavior_controller.errors import FaultsFound, NodesMissing
from behavior_controller.robot.requests import Prompt
from behavior_controller.config.node_facts import MissionSpec
from behavior_controller.ros.tcpros import Trouble, ask_master
from behavior_controller.ros.types import resolved
from behavior_controller.text import count

_LAUNCH_FILE = "behaviorController.launch"

Tell = Callable[[str, str], None]

_PRESSED = "the tablet of this robot does not say which button was pressed, and tabletSuccessIs is "
TABLET = {
    "done": _PRESSED + "done: no press counts as yes, so that only visitors who say yes get what "
                       "the mission offers; tabletSuccessIs yes takes any for yes",
    "yes": _PRESSED + "yes: any press counts as yes, No too"}
"""What the tablet's success means for the mission, by ``tabletSuccessIs``."""


def read_plan(clock: Clock, wake: WakeUp, tell: Tell) -> load.Mission:
    """Read everything and announce the run. Raises FaultsFound with every fault, or NodesMissing.
    """
    parameters, given = _private_parameters(), _given()
    chosen = settings.load(folders.config(settings.FILE_NAME), parameters, given)
    overrides = {**parameters, **given}
    overriding = [f"{key} {overrides[key]}" for key in chosen.values if key in overrides]
    if overriding:
        tell("info", f"parameters of the node override the configuration: {', '.join(overriding)}")
    robot = chosen.interface
    names = {offer.name: resolved(offer) for offer in robot.offers
             if resolved(offer) != robot.name_of(offer)}
    plan = load.load(replace(chosen, remapped=tuple(names.items())), clock, wake)
    _announce(plan, tell)
    return plan


def read_settings() -> settings.Settings:
    """Read the configuration alone. Raises FaultsFound or NodesMissing."""
    return settings.load(folders.config(settings.FILE_NAME), _private_parameters(), _given())


def valid_values() -> Dict[str, Any]:
    """Return the value of each key, whatever is wrong with the others, and without its parameter if
    the master does not answer. Raises ConfigurationError if the file cannot be read."""
    parameters: Dict[str, Any] = {}
    with contextlib.suppress(NodesMissing):
        parameters = _private_parameters()
    return settings.valid_values(folders.config(settings.FILE_NAME), parameters, _given())


def chosen_robot() -> str:
    """Return the robot whose namespace this node is in, unless the key has a mistake."""
    with contextlib.suppress(FaultsFound):  # which are reported when all is read
        return str(valid_values()["robot"])
    return ""


def _given() -> Dict[str, str]:
    """Return the arguments of the node, and those that its launch file does not declare: roslaunch
    does not refuse them."""
    words = ros_arguments.given_to_roslaunch(ros_arguments.parent_command(), "cssr_system",
                                             _LAUNCH_FILE)
    known = [key.name for key in settings.KEYS]
    given = dict(word.split(ros_arguments.ASSIGNMENT, 1) for word in words)
    unknown = {name: value for name, value in given.items() if name not in known}
    return dict(unknown, **settings.split_arguments(sys.argv)[1])


def report_faults(invalid: FaultsFound, tell: Tell, consequence: str) -> None:
    """Report each fault, and their number with the consequence."""
    for fault in invalid.faults:
        tell("warning" if fault.is_warning else "error", str(fault))
    mistakes = sum(not fault.is_warning for fault in invalid.faults)
    tell("error", f"{consequence}: {count(mistakes, 'mistake')}, see above")


def _private_parameters() -> Dict[str, Any]:
    """Return the parameters below our own name; they override the configuration file. So do those
    below the name without a robot, if one of them names the robot.

    Raises NodesMissing if the master does not answer: without the parameters the file's values may
    be wrong.
    """
    own = rospy.get_name()
    first = get_ros_namespace() + own.rpartition("/")[2]
    found = [_parameters(name) for name in dict.fromkeys((first, own))]
    if "robot" not in found[0]:
        return found[-1]
    return {**found[0], **found[-1]}


def _parameters(node: str) -> Dict[str, Any]:
    try:
        values = ask_master("getParam", node)
    except Trouble as trouble:
        raise NodesMissing(f"the parameters of {node} cannot be read: {trouble}")
    if not isinstance(values, dict):
        return {}
    return values


def _announce(plan: load.Mission, tell: Tell) -> None:
    """Announce the run, and warn of unusual settings."""
    chosen, switched = plan.settings, {False: "off", True: "on"}
    asr, verbose = switched[chosen.asr_enabled], switched[chosen.verbose_mode]
    tell("info", f"mission {plan.file}: {len(plan.tree.nodes)} nodes; language {plan.language}; "
                 f"speech recognition {asr}; verbose mode {verbose}")
    if plan.knowledge is not None:
        files = ", ".join(source.file for source in plan.knowledge.sources)
        tell("info", f"robot interface {chosen.robot_interface}; knowledge: {files}")
    has_prompt = any(isinstance(node.spec, MissionSpec) and Prompt in node.spec.calls
                     for node in plan.tree.nodes)
    if has_prompt and not chosen.interface.tells_pressed:
        tell("info", TABLET[chosen.tablet_success_is])
    for warning in plan.warnings:
        tell("warning", str(warning))
