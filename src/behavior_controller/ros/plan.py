"""Builds the mission for the node: its files, overridden by the node's parameters and arguments."""
import sys
from typing import Any, Callable, Dict

import rospy

from behavior_controller import folders, mission, settings
from behavior_controller.bt.engine.clock import Clock
from behavior_controller.bt.engine.wakeup import WakeUp
from behavior_controller.errors import FaultsFound, NodesMissing
from behavior_controller.interface.records import Prompt
from behavior_controller.mission import Mission
from behavior_controller.mission_spec import MissionSpec
from behavior_controller.ros.connection import Trouble, ask_master

Tell = Callable[[str, str], None]

TABLET = {
    "done": "the tablet of this robot does not say which button was pressed, and tabletSuccessIs is done: no press "
            "counts as yes, so that a tour is given only to visitors who say yes; tabletSuccessIs yes takes any for yes",
    "yes": "the tablet of this robot does not say which button was pressed, and tabletSuccessIs is yes: any press "
           "counts as yes, No too"}
"""What the tablet's success means for the mission, by ``tabletSuccessIs``."""


def read_plan(clock: Clock, wake: WakeUp, tell: Tell) -> Mission:
    """Read everything and announce the run. Raises FaultsFound with every fault, or NodesMissing."""
    parameters, given = _private_parameters(), settings.split_arguments(sys.argv)[1]
    chosen = settings.load(folders.config(settings.FILE_NAME), parameters, given)
    overrides = {**parameters, **given}
    overriding = ["{} {}".format(key, overrides[key]) for key in chosen.values if key in overrides]
    if overriding:
        tell("info", "parameters of the node override the configuration: {}".format(", ".join(overriding)))
    plan = mission.load(chosen, clock, wake)
    _announce(plan, tell)
    return plan


def tell_faults(found: FaultsFound, tell: Tell, consequence: str) -> None:
    """Report each fault, and their number with the consequence."""
    for fault in found.faults:
        tell("warning" if fault.is_warning else "error", str(fault))
    count = sum(not fault.is_warning for fault in found.faults)
    tell("error", "{}: {} mistake{}, see above".format(consequence, count, "" if count == 1 else "s"))


def _private_parameters() -> Dict[str, Any]:
    """Return the parameters below our own name; they override the configuration file.

    Raises NodesMissing if the master does not answer: without the parameters the file's values may be wrong.
    """
    try:
        values = ask_master("getParam", rospy.get_name())
    except Trouble as trouble:
        raise NodesMissing("the parameters of {} cannot be read: {}".format(rospy.get_name(), trouble))
    return values if isinstance(values, dict) else {}


def _announce(plan: Mission, tell: Tell) -> None:
    """Announce the run, and warn of unusual settings."""
    chosen = plan.settings
    tell("info", "mission {}: {} nodes; language {}; speech recognition {}; verbose mode {}".format(
        plan.file, len(plan.tree.nodes), plan.language, *("on" if switch else "off" for switch in (
            chosen.asr_enabled, chosen.verbose_mode))))
    if plan.knowledge is not None:
        tell("info", "robot interface {}; knowledge: {}".format(
            chosen.robot_interface, ", ".join(source.file for source in plan.knowledge.sources)))
    has_prompt = any(isinstance(node.spec, MissionSpec) and Prompt in node.spec.calls for node in plan.tree.nodes)
    if has_prompt and not chosen.interface.tells_pressed:
        tell("info", TABLET[chosen.tablet_success_is])
    for warning in plan.warnings:
        tell("warning", str(warning))
