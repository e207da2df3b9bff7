"""What the linter must know of the mission's own leaves."""
from behavior_controller.bt.checking.lint import Vocabulary
from behavior_controller.bt.checking.outcomes import SUCCEEDS
from behavior_controller.leaves.base import OF_ONE_VISITOR

_TARGET = ("SelectExhibit", "LookUpEntrance", "LookUpHome")
_SEEKING = ("SeekOvertAttentionMode", "SeekingOvertAttentionMode")

VOCABULARY = Vocabulary(
    keys=OF_ONE_VISITOR,
    ends={"START_OF_TREE": SUCCEEDS},
    needs={
        "IsMutualGazeDiscovered": (_SEEKING, "overtAttention looks for mutual gaze only in the mode seeking"),
        "IsVisitorResponseYes": (("IsYesNoUttered", "PressYesNoDialogue"), "nothing takes the visitor's answer"),
        "Navigate": (_TARGET, "nothing sets the target location"),
        "IsListWithExhibit": (("RetrieveListOfExhibits",), "the exhibits are never asked for"),
        "SelectExhibit": (("RetrieveListOfExhibits",), "the exhibits are never asked for"),
        "DescribeExhibitSpeech": (("SelectExhibit",), "no exhibit is ever selected"),
    },
    recoveries=("HandleFallBack", "HandleFallback"),
)
