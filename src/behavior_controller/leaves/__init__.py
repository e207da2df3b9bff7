"""The mission vocabulary in one visible list: D5.4.3 table 4, the documented extensions, and release 1.0's words."""
from typing import List

from behavior_controller.bt.engine.builtins import builtin_specs
from behavior_controller.bt.registry import NodeSpec, Registry
from behavior_controller.leaves import (attention, dialogue, gesture, knowledge, lifecycle, navigation, recovery,
                                        release_1_0, speech)

SPECS = (lifecycle.SPECS + attention.SPECS + speech.SPECS + gesture.SPECS + navigation.SPECS + knowledge.SPECS
         + dialogue.SPECS + recovery.SPECS + release_1_0.SPECS)


def registry() -> Registry:
    """Return the node types that a mission may use: BehaviorTree.CPP's own and the mission's."""
    return Registry(builtin_specs() + list(SPECS))


def beyond_builtins() -> List[NodeSpec]:
    """Return the node types of ``registry()`` that BehaviorTree.CPP does not have: what Groot2 has to be told."""
    builtins = {spec.id for spec in builtin_specs()}
    return [spec for spec in registry().all() if spec.id not in builtins]
