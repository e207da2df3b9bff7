"""Reads all that decides about a run (configuration, phrases, policy, mission) and finds all that is wrong."""
import os
import sys
from typing import Any, Callable, Dict, List, NamedTuple

import rospy

from behavior_controller import folders, leaves
from behavior_controller.bt.engine.clock import Clock
from behavior_controller.bt.engine.tree import Tree
from behavior_controller.bt.engine.wakeup import WakeUp
from behavior_controller.bt.registry import did_you_mean
from behavior_controller.errors import ConfigurationError, Fault, FaultsFound, NodesMissing
from behavior_controller.leaves.vocabulary import load as load_mission
from behavior_controller.phrases import Phrases
from behavior_controller.phrases import load as load_phrases
from behavior_controller.policy import Policy
from behavior_controller.policy import load as load_policy
from behavior_controller.ros.connection import Trouble, ask_master
from behavior_controller.settings import Settings
from behavior_controller.settings import load as load_settings
from behavior_controller.settings import split_arguments

CONFIGURATION = "behaviorControllerConfiguration.ini"
POLICY = "recoveryPolicy.ini"

Tell = Callable[[str, str], None]


class Plan(NamedTuple):
    """All that was read from files, and found right."""

    settings: Settings
    mission: str
    phrases: Phrases
    policy: Policy
    tree: Tree


def read_plan(clock: Clock, wake: WakeUp, tell: Tell) -> Plan:
    """Read everything and tell what is going to run. Raises FaultsFound with all that is wrong, or NodesMissing."""
    parameters, given = _private_parameters(), split_arguments(sys.argv)[1]
    settings = load_settings(folders.config(CONFIGURATION), parameters, given)
    overrides = {**parameters, **given}
    overriding = ["{} {}".format(key, overrides[key]) for key in settings.values if key in overrides]
    if overriding:
        tell("info", "parameters of the node override the configuration: {}".format(", ".join(overriding)))
    mission = _find_mission(settings.scenario_specification)
    faults: List[Fault] = []

    def attempt(load: Callable[..., Any], *arguments: Any, **options: Any) -> Any:
        try:
            return load(*arguments, **options)
        except FaultsFound as found:
            faults.extend(found.faults)
            return None

    plan = Plan(settings, mission, attempt(load_phrases, settings.language),
                attempt(load_policy, folders.config(POLICY), leaves.SPECS),
                attempt(load_mission, mission, clock=clock, wake=wake))
    if faults:
        raise FaultsFound(faults)
    _announce(plan, tell)
    return plan


def tell_faults(found: FaultsFound, tell: Tell, consequence: str) -> None:
    """Tell each fault, and the sum with what follows from it."""
    for fault in found.faults:
        tell("warning" if fault.is_warning else "error", str(fault))
    count = sum(not fault.is_warning for fault in found.faults)
    tell("error", "{}: {} mistake{}, see above".format(consequence, count, "" if count == 1 else "s"))


def _private_parameters() -> Dict[str, Any]:
    """Return the parameters below our own name; they override the configuration file.

    Raises NodesMissing if the master does not answer: the file alone may say something else than they do.
    """
    try:
        values = ask_master("getParam", rospy.get_name())
    except Trouble as trouble:
        raise NodesMissing("the parameters of {} cannot be read: {}".format(rospy.get_name(), trouble))
    return values if isinstance(values, dict) else {}


def _find_mission(name: str) -> str:
    """Return the path of the mission file; raises ConfigurationError, which names those that there are."""
    path = folders.mission(name)
    if os.path.isfile(path):
        return path
    known = sorted(file[:-4] for file in os.listdir(folders.data("")) if file.endswith(".xml"))
    raise ConfigurationError([Fault("scenarioSpecification", 0, 0, "there is no mission {}".format(path),
                                    did_you_mean(name, known) or "there are: {}".format(", ".join(known)))])


def _announce(plan: Plan, tell: Tell) -> None:
    """Tell what is going to run, and what is odd about it."""
    chosen = plan.settings
    tell("info", "mission {}: {} nodes; language {}; speech recognition {}; verbose mode {}".format(
        plan.mission, len(plan.tree.nodes), chosen.language, *("on" if switch else "off" for switch in (
            chosen.asr_enabled, chosen.verbose_mode))))
    for warning in plan.tree.warnings:
        tell("warning", str(warning))
