"""The mission vocabulary in one visible list: D5.4.3 table 4, the documented extensions, and release 1.0's words."""
from behavior_controller.bt.engine.builtins import builtin_specs
from behavior_controller.bt.registry import Registry
from behavior_controller.leaves import (attention, dialogue, gesture, knowledge, lifecycle, navigation, recovery,
                                        release_1_0, speech)

SPECS = (lifecycle.SPECS + attention.SPECS + speech.SPECS + gesture.SPECS + navigation.SPECS + knowledge.SPECS
         + dialogue.SPECS + recovery.SPECS + release_1_0.SPECS)


def registry() -> Registry:
    """Return the node types that a mission may use: BehaviorTree.CPP's own and the mission's."""
    return Registry(builtin_specs() + list(SPECS))
