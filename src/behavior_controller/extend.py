"""The public names for what other packages add: their leaves, declarations and phrases, and tests.

docs/reference.md lists them. They stay here when a module of this package moves; nothing else of
it is promised to other packages.
"""
import importlib
from typing import Any, Dict, List

from behavior_controller.text import did_you_mean

_MODULES = {
    "bt": "IDLE RUNNING SUCCESS FAILURE SKIPPED Result NodeSpec Kind Port Direction PortType Node "
          "ActionLeaf SyncActionLeaf ConditionLeaf Decorator Control "
          "ConfigureError NodeError PortError NoValue ValueFault",
    "leaves.base": "ServiceLeaf WorkingLeaf Waiting InstantAction InstantCondition MissionContext "
                   "leaf_spec",
    "leaves.conditions": "TopicCondition",
    "leaves.dialogue": "UtteranceCondition",
    "leaves.data": "GESTURE_TARGET",
    "run.events": "LeafSummary",
    "robot.declarations": "Service Action Publication Success Topic Evidence Sense Unusable",
    "robot.requests": "Request Answer Words MOTION SOUND NO_EFFECT Location Point Exhibit "
                      "Say Prompt GoTo PerformGesture QueryKnowledge SetAnimation SetAttention "
                      "SetPose SetRecognition SetRecognitionLanguage Listen",
    "robot.gateway": "Failure Cause Call",
    "config.phrases": "Speech",
    "config.config_file": "LineReader TextLine read_source number",
    "ros_packages": "package_folder",
    "missions.trial": "Trial",
    "errors": "FaultsFound"}
"""Names by module. A module is imported when one of its names is: a package's declarations are read
before the leaves, which need all declarations."""

_MODULE_OF: Dict[str, str] = {
    name: f"behavior_controller.{module}" for module, names in _MODULES.items()
    for name in names.split()}

__all__ = list(_MODULE_OF)


def __getattr__(name: str) -> Any:
    if name not in _MODULE_OF:
        meant = did_you_mean(name, _MODULE_OF) or "docs/reference.md lists the names"
        raise AttributeError(f"{__name__} has no {name} ({meant})")
    return getattr(importlib.import_module(_MODULE_OF[name]), name)


def __dir__() -> List[str]:
    return __all__
