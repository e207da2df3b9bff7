"""Leaves for the robot's attention and lifelike movement, and for what its cameras see of a
visitor."""
from typing import Any, Optional, Sequence, Set, Tuple

from behavior_controller.bt.engine.registry import Port
from behavior_controller.run.events import Noticed
from behavior_controller.robot.gateway import Failure, Sample
from behavior_controller.robot.declarations import Sense
from behavior_controller.robot.requests import Answer, Point, Request, SetAnimation, SetAttention
from behavior_controller.leaves.base import ServiceLeaf, Waiting, leaf_spec
from behavior_controller.leaves.conditions import TopicCondition
from behavior_controller.leaves.data import ATTENTION_SET_AT, GESTURE_TARGET

SEEKING = "seeking"
OF_THE_ROBOT = (2, 3)
"""Values of /overtAttention/mode that only the robot's own node publishes: mutual gaze and failed;
there 1 is seeking.

In D5.4.3 value 1 means mutual gaze, and no others are defined.
"""

SEARCHES = 3
"""This number of searches with value 1 alone indicates the document's convention."""


class AnimateBehavior(ServiceLeaf):
    """``<EnableAnimateBehavior/>``: switches lifelike movement to ``state``
    (/animateBehaviour/set_activation)."""

    asks = SetAnimation
    state: str

    def request(self) -> Request:
        """Set the state."""
        return SetAnimation(self.state)


class OvertAttentionMode(ServiceLeaf):
    """``<SocialOvertAttentionMode/>``: sets the mode of attention to ``state``
    (/overtAttention/set_mode)."""

    asks = SetAttention
    PORTS = (ATTENTION_SET_AT.written(),)
    state: str
    _is_set = False  # by this attempt

    def try_once(self) -> Waiting[Optional[Failure]]:
        """Set the mode; release 1.1 switches attention off after a look at a location, whatever
        comes of it."""
        self._is_set = False
        failure = yield from super().try_once()
        if self._is_set and self.state == "location" and self.mission.interface.ends_location:
            call = self.mission.gateway.start(SetAttention("disabled"))
            if call.result is None:
                yield call
        return failure

    def request(self) -> Optional[Request]:
        """Set the mode; a target of exactly (0, 0, 0) means none."""
        if self.state != "location":
            return SetAttention(self.state)
        target = self.get_input("target")
        return None if target == Point(0.0, 0.0, 0.0) else SetAttention(self.state, target)

    def accept(self, answer: Answer) -> Optional[Failure]:
        """Note when the mode was set."""
        self.set_output("attentionSetAt", self.mission.clock.now())
        self._is_set = True
        return None


class IsVisitorDiscovered(TopicCondition):
    """``<IsVisitorDiscovered/>``: SUCCESS if the newest message of /faceDetection/data has a face.
    """

    sense = Sense.VISITOR
    otherwise = "no face seen"


class GazeValues:
    """Detects the robot's convention from the values seen so far; the gaze leaves of a mission
    share it."""

    def __init__(self) -> None:
        self.has_robots_value = False
        self.searches: Set[float] = set()  # start times of the searches with value 1
        self.is_reported = False

    def sign(self, configured: int) -> str:
        """Return the evidence against the ``configured`` value; empty if there is none."""
        if configured == 1 and self.has_robots_value:
            return ("2 or 3, as the robot's own node does, where 1 is still seeking and 2 mutual "
                    "gaze")
        if configured == 2 and not self.has_robots_value and len(self.searches) >= SEARCHES:
            return (f"1 in {SEARCHES} searches and never 2 or 3, as a node of D5.4.3 does, where 1 "
                    "is mutual gaze")
        return ""


class IsMutualGazeDiscovered(TopicCondition):
    """``<IsMutualGazeDiscovered/>``: SUCCESS if /overtAttention/mode reports mutual gaze since the
    mode was set.

    Only the value ``mutualGazeValue`` means mutual gaze. Evidence that the robot has the other
    convention is reported once.
    """

    sense = Sense.GAZE
    PORTS = (ATTENTION_SET_AT.read(is_optional=True),)
    otherwise = "no gaze seen"
    values: GazeValues

    def join(self) -> None:
        """Get the object that the mission's gaze leaves share."""
        self.values = self.mission.shared(GazeValues)

    def is_evidence(self, value: Any) -> bool:
        """Return whether the attention is seeking and has found a gaze."""
        if value.state == SEEKING and value.value in OF_THE_ROBOT:
            self.values.has_robots_value = True
        return super().is_evidence(value)

    def not_before(self) -> float:
        """Return when the mode was set."""
        return self.get_input_or("attentionSetAt", float("-inf"))

    def judged(self, counting: Sequence[Sample]) -> None:
        """Report evidence that the robot has the other convention."""
        values, configured = self.values, self.mission.settings.mutual_gaze_value
        is_one = bool(counting) and counting[-1].value == (SEEKING, 1)
        if is_one and len(values.searches) < SEARCHES:
            values.searches.add(self.not_before())
        if values.is_reported or self.mission.interface.gaze_value is not None:
            return
        sign = values.sign(configured)
        if sign:
            values.is_reported = True
            self.mission.events.emit(Noticed(
                "warning", f"/overtAttention/mode has said seeking with {sign}; if this is such a "
                           f"node, set mutualGazeValue {3 - configured}"))


# name, mode, description, additional ports
MODES: Tuple[Tuple[str, str, str, Tuple[Port, ...]], ...] = (
    ("DisabledOvertAttentionMode", "disabled", "Switches attention off.", ()),
    ("SocialOvertAttentionMode", "social", "Looks at people.", ()),
    ("ScanningOvertAttentionMode", "scanning", "Looks around.", ()),
    ("SeekOvertAttentionMode", SEEKING, "Seeks mutual gaze (extension).", ()),
    ("SeekingOvertAttentionMode", SEEKING,
     "Seeks mutual gaze; another name of SeekOvertAttentionMode (extension).", ()),
    ("LocationOvertAttentionMode", "location", "Looks at the gesture target (extension).",
     (GESTURE_TARGET.read("target"),)))

SPECS = tuple(
    leaf_spec(name, OvertAttentionMode, text, ports, {"state": state}, sets_mode=state)
    for name, state, text, ports in MODES) + (
        leaf_spec("EnableAnimateBehavior", AnimateBehavior, "Starts lifelike movement.",
                  arguments={"state": "enabled"}),
        leaf_spec("DisableAnimateBehavior", AnimateBehavior, "Stops lifelike movement.",
                  arguments={"state": "disabled"}),
        leaf_spec("IsVisitorDiscovered", IsVisitorDiscovered, "Is a face in view?"),
        leaf_spec("IsMutualGazeDiscovered", IsMutualGazeDiscovered,
                  "Does the visitor look at the robot, since the mode was set?"))
