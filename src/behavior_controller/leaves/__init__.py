"""The mission vocabulary: the 32 nodes of D5.4.3 table 4 and the documented extensions, in one visible list."""
from typing import List

from behavior_controller.bt.engine.builtins import builtin_specs
from behavior_controller.bt.registry import NodeSpec, Registry
from behavior_controller.leaves import attention, dialogue, gesture, knowledge, lifecycle, navigation, recovery, speech

SPECS = (lifecycle.SPECS + attention.SPECS + speech.SPECS + gesture.SPECS + navigation.SPECS + knowledge.SPECS
         + dialogue.SPECS + recovery.SPECS)


def registry() -> Registry:
    """Return the node types that a mission may use: BehaviorTree.CPP's own and the mission's."""
    return Registry(builtin_specs() + list(SPECS))


def beyond_builtins() -> List[NodeSpec]:
    """Return the node types of ``registry()`` that BehaviorTree.CPP does not have: what Groot2 has to be told."""
    builtins = {spec.id for spec in builtin_specs()}
    return [spec for spec in registry().all() if spec.id not in builtins]
