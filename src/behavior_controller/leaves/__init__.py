"""The mission vocabulary: the 32 nodes of D5.4.3 table 4 and the documented extensions, in one visible list."""
from behavior_controller.leaves import attention, dialogue, gesture, knowledge, lifecycle, navigation, recovery, speech

SPECS = (lifecycle.SPECS + attention.SPECS + speech.SPECS + gesture.SPECS + navigation.SPECS + knowledge.SPECS
         + dialogue.SPECS + recovery.SPECS)
