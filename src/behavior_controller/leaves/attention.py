"""Leaves of the robot's attention and lifelike movement, and what its cameras see of a visitor."""
from functools import partial
from typing import Any, Optional, Union

from behavior_controller.bt.registry import Kind, NodeSpec
from behavior_controller.gateway import Answer, Cause, Failure, Request, SetAnimation, SetAttention, Topic
from behavior_controller.leaves.base import ATTENTION_SET_AT, GESTURE_TARGET, ServiceLeaf, TopicCondition

STILL_SEEKING_OR_FOUND, FOUND = 1, 2
"""Values of /overtAttention/mode; 1 means mutual gaze in D5.4.3 and "still seeking" on the robot; 3 is failed."""


class AnimateBehavior(ServiceLeaf):
    """``<EnableAnimateBehavior/>``: switches lifelike movement to ``state`` (/animateBehaviour/set_activation)."""

    resource = SetAnimation.service

    def __init__(self, name: str, state: str):
        super().__init__(name)
        self.state = state

    def request(self) -> Request:
        """Set the state."""
        return SetAnimation(self.state)


class OvertAttentionMode(ServiceLeaf):
    """``<SocialOvertAttentionMode/>``: sets the mode of attention to ``state`` (/overtAttention/set_mode).

    Writes ``attentionSetAt``; mode ``location`` reads ``gestureTarget``.
    """

    resource = SetAttention.service

    def __init__(self, name: str, state: str):
        super().__init__(name)
        self.state = state

    def request(self) -> Union[Request, Failure]:
        """Set the mode."""
        if self.state != "location":
            return SetAttention(self.state)
        target = self.recall(GESTURE_TARGET)
        if target is None:
            return Failure(Cause.MISSING_DATA, "there is no gesture target to look at", self.resource)
        return SetAttention(self.state, target)

    def accept(self, answer: Answer) -> Optional[Failure]:
        """Note when the mode was set."""
        self.remember(ATTENTION_SET_AT, self.mission.clock.now())
        return None


class IsVisitorDiscovered(TopicCondition):
    """``<IsVisitorDiscovered/>``: SUCCESS if the newest message of /faceDetection/data has a face."""

    topic = Topic.FACES
    otherwise = "no face in view"

    def is_evidence(self, value: Any) -> bool:
        """Return whether there is a face."""
        return bool(value.labels)


class IsMutualGazeDiscovered(TopicCondition):
    """``<IsMutualGazeDiscovered/>``: SUCCESS if /overtAttention/mode reports mutual gaze since the mode was set.

    Reads ``attentionSetAt``; ``mutualGazeValue`` tells what value 1 means.
    """

    topic = Topic.ATTENTION
    otherwise = "no mutual gaze"

    def is_evidence(self, value: Any) -> bool:
        """Return whether the attention is seeking and has found a gaze."""
        return value.state == "seeking" and (
            value.value == FOUND
            or value.value == STILL_SEEKING_OR_FOUND and self.mission.settings.mutual_gaze_value == 1)

    def not_before(self) -> float:
        """Return when the mode was set."""
        set_at = self.recall(ATTENTION_SET_AT)
        return float("-inf") if set_at is None else set_at


# name, mode, what it does
MODES = (
    ("DisabledOvertAttentionMode", "disabled", "Switches attention off."),
    ("SocialOvertAttentionMode", "social", "Looks at people."),
    ("ScanningOvertAttentionMode", "scanning", "Looks around."),
    ("SeekOvertAttentionMode", "seeking", "Seeks mutual gaze (extension)."),
    ("SeekingOvertAttentionMode", "seeking", "Another name of SeekOvertAttentionMode (extension)."),
    ("LocationOvertAttentionMode", "location", "Looks at the gesture target (extension)."),
)

SPECS = tuple(
    NodeSpec(name, Kind.ACTION, partial(OvertAttentionMode, state=state), description=text)
    for name, state, text in MODES
) + (
    NodeSpec("EnableAnimateBehavior", Kind.ACTION, partial(AnimateBehavior, state="enabled"),
             description="Starts lifelike movement."),
    NodeSpec("DisableAnimateBehavior", Kind.ACTION, partial(AnimateBehavior, state="disabled"),
             description="Stops lifelike movement."),
    NodeSpec("IsVisitorDiscovered", Kind.CONDITION, IsVisitorDiscovered, description="Is a face in view?"),
    NodeSpec("IsMutualGazeDiscovered", Kind.CONDITION, IsMutualGazeDiscovered,
             description="Does the visitor look at the robot, since the mode was set?"),
)
