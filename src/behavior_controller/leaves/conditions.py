"""Conditions on a topic: evaluated on the newest message, and woken by the message that changes the answer."""
import math
from typing import Any, Optional, Tuple

from behavior_controller.bt.engine.clock import Timer
from behavior_controller.bt.engine.leaf import ConditionLeaf
from behavior_controller.bt.engine.node import ConfigureError, Result
from behavior_controller.bt.language.ports import PortError
from behavior_controller.bt.status import FAILURE, RUNNING
from behavior_controller.events import Told
from behavior_controller.gateway import Cause, Failure, Sample
from behavior_controller.interface import Evidence, Sense, Topic
from behavior_controller.leaves.base import MissionLeaf
from behavior_controller.leaves.waits import is_asked_again, wait_for


class TopicCondition(MissionLeaf, ConditionLeaf):
    """A condition on the newest message of the topic with the evidence of ``sense``.

    It answers at once; with ``conditionWait`` it is RUNNING for up to that long, unless a reactive control asks it
    again and again, where the waiting is the mission's. Nothing polls: an alarm wakes the tree at the message that
    changes the answer, a timer when the message of the answer becomes too old.
    """

    sense: Sense
    awaiting = ""  # what the robot does that waits for it, in people's words, in place of those of the sense
    _is_asked_again: bool
    _mission_waits: Optional[float] = None  # see ``wait_for``
    _expiry: Optional[Timer] = None
    _patience: Optional[Timer] = None
    _is_over = False
    _told: Tuple[str, float] = ("", 0.0)  # the failure reported last, and what a message had to be newer than then

    def configure(self) -> None:
        """Refuse a class that does not say what it checks."""
        super().configure()
        if self.sense is None and self.own_evidence is None:
            raise ConfigureError("{} does not say what it checks: its class needs a sense, or own_evidence".format(
                self.registration_id))

    def setup(self, **kwargs: Any) -> None:
        """Find out whether the mission waits for it."""
        super().setup(**kwargs)
        self._is_asked_again = is_asked_again(self)
        self._mission_waits = wait_for(self)

    @property
    def resource(self) -> str:
        """The topic's canonical name."""
        return self.topic.name

    @property
    def own_sense(self) -> Optional[Sense]:
        """The sense of the condition; None if another package declares its evidence."""
        return None if self.own_evidence is not None else self.sense

    @property
    def evidence(self) -> Evidence:
        """The evidence of ``sense`` on this robot."""
        return self.own_evidence or self.mission.interface.evidence(self.sense)

    @property
    def topic(self) -> Topic:
        """The topic of the evidence."""
        return self.evidence.topic

    def is_evidence(self, value: Any) -> bool:
        """Return whether a message with this value makes the condition true. Called on the receiving thread too."""
        return self.evidence.is_given(value, self.mission.settings.gaze_value)

    def not_before(self) -> float:
        """Return the time (monotonic seconds) that a message must be newer than."""
        return float("-inf")

    def use(self, sample: Sample) -> None:
        """Store the content of the message."""

    def unused(self, sample: Sample) -> None:
        """Process a message that counts but is not the wanted evidence."""

    def judged(self, sample: Optional[Sample]) -> None:
        """Process the newest message apart from the answer to the condition."""

    def update(self) -> Result:
        """Evaluate the newest message."""
        if self.status is not RUNNING:
            self.started_at = self.mission.clock.now()
        try:
            return self._answer()
        except PortError as error:
            self._stop_timers()
            return self._fail(self.missing(error), 0.0)

    def _answer(self) -> Result:
        sample = self.mission.topics.newest(self.topic)
        counts = sample is not None and self._counts(sample)
        self.judged(sample)
        if sample is not None and counts and self.is_evidence(sample.value):
            return self._true(sample)
        if sample is not None and counts and self.evidence.is_given_up(sample.value):
            self.mission.topics.wake_when(self.uid, self.topic, self.is_evidence)
            return self._false(sample)
        self.mission.topics.wake_when(self.uid, self.topic, self._is_end)
        self.mission.topics.listen(self.topic, self.wait)
        if not self._waits():
            return self._false(sample)
        if self.status is not RUNNING:
            self._begin_to_wait(self.wait)
        return RUNNING

    def _begin_to_wait(self, limit: float) -> None:
        sensed = self.own_sense
        self.begin_wait(self.awaiting or (self.registration_id if sensed is None else sensed.awaiting), limit)

    def _is_end(self, value: Any) -> bool:
        return self.is_evidence(value) or self.evidence.is_given_up(value)

    def _counts(self, sample: Sample) -> bool:
        age = self.mission.clock.now() - sample.arrived
        return sample.arrived > self.not_before() and (
            not self.topic.is_continuous or age <= self.mission.settings.topic_max_age)

    def _true(self, sample: Sample) -> Result:
        self._stop_timers()
        self.mission.topics.listen(self.topic, 0.0)
        if self.topic.is_continuous:
            self.mission.topics.wake_when(self.uid, self.topic, lambda value: not self.is_evidence(value))
            left = sample.arrived + self.mission.settings.topic_max_age - self.mission.clock.now()
            self._expiry = self.mission.clock.call_after(left + 0.001, self.wake)
        self._told = ("", 0.0)
        self.told = self._told_of(self.own_sense.given if self.own_sense is not None else "")
        self.use(sample)
        return self.succeeded()

    def _false(self, sample: Optional[Sample]) -> Result:
        self._stop_timers()
        failure = Failure(Cause.CONDITION_FALSE, self.otherwise, self.resource)
        if sample is not None and not self._counts(sample):
            when = "came before" if sample.arrived <= self.not_before() else "is too old"
            failure = failure._replace(message="{}; the newest message {}".format(self.otherwise, when))
        self.told = self._told_of(self.own_sense.absent if self.own_sense is not None else "")
        if sample is not None and self._counts(sample):
            self.unused(sample)
        return self._fail(failure, self.not_before())

    def _told_of(self, mark: str) -> Optional[Told]:
        return Told("visit", "", mark, self.mission.clock.now()) if mark else None

    def _fail(self, failure: Failure, since: float) -> Result:
        telling = failure.message, max(since, self.mission.visit_began)
        if telling == self._told:
            # asked again at every tick of a wait: recorded each time, reported once
            self.mission.failures.add(self, failure)
            return FAILURE
        is_new = telling[1:] != self._told[1:]
        self._told = telling
        result = self.failed(failure)
        if is_new and self._mission_waits is not None and not self._may_wait():
            self._begin_to_wait(self._mission_waits)
        return result

    @property
    def wait(self) -> float:
        """Seconds that the condition waits for its evidence."""
        wait = self.evidence.wait
        return self.mission.settings.condition_wait if wait is None else wait

    def _may_wait(self) -> bool:
        return self.wait > 0.0 and not self._is_asked_again

    def _waits(self) -> bool:
        if self._is_over or not self._may_wait():
            return False
        if self._patience is None and self.wait < math.inf:
            self._patience = self.mission.clock.call_after(self.wait, self._give_up)
        return True

    def _give_up(self) -> None:
        self._is_over = True
        self.wake()

    def _stop_timers(self) -> None:
        for timer in (self._expiry, self._patience):
            if timer is not None:
                timer.cancel()
        self._expiry = self._patience = None
        self._is_over = False

    def halt(self) -> None:
        """Stop waiting."""
        if self.status is RUNNING:
            self.mission.topics.listen(self.topic, 0.0)
        self._stop_timers()
        super().halt()
