"""Conditions on a topic: evaluated on the messages that count, woken by the one that changes the
answer."""
import math
from functools import cached_property
from typing import Any, Optional, Sequence, Tuple

from behavior_controller.bt.engine.clock import Timer
from behavior_controller.bt import (
    ConditionLeaf, ConfigureError, PortError, Result, FAILURE, RUNNING)
from behavior_controller.run.events import LeafSummary
from behavior_controller.robot.gateway import Cause, Failure, Sample, since
from behavior_controller.robot.declarations import Evidence, Sense, Topic
from behavior_controller.robot.rhythm import unheard
from behavior_controller.leaves.base import MissionLeaf
from behavior_controller.leaves.waits import is_asked_again, wait_for
from behavior_controller.text import joined


class Patience:
    """The time for which a leaf waits for messages of a topic, and for what began within it."""

    def __init__(self, leaf: MissionLeaf, topic: Topic, seconds: float):
        self._leaf, self._topic = leaf, topic
        self._is_late = False
        self._timer = leaf.mission.clock.call_after(seconds, leaf.wake)

    def is_over(self) -> bool:
        """Return whether no message counts any more, apart from those that have come."""
        if self._timer.callback is not None and not self._is_late:
            return False
        if not self._leaf.mission.topics.is_hearing(self._topic):
            return True
        if not self._is_late and self._topic.action is not None:
            self._is_late = True
            self._timer = self._leaf.mission.clock.call_after(self._topic.action.deadline,
                                                              self._leaf.wake)
        return False

    def cancel(self) -> None:
        """Stop waiting."""
        self._timer.cancel()


class TopicCondition(MissionLeaf, ConditionLeaf):
    """A condition on the topic with the evidence of ``sense``: on a state's newest message, or each
    event.

    It answers at once; with ``conditionWait`` it is RUNNING for up to that long, unless a reactive
    control asks it again and again, where the waiting is the mission's. For the first message of
    another package's state it always waits, ``topicMaxAge`` in all: a node that publishes all the
    time has sent one by then, which may not have come yet. Nothing polls: an alarm
    wakes the tree at the message that changes the answer, a timer when the message of the answer
    becomes too old.
    """

    RULE: Tuple[str, ...] = ("own_evidence", "is_evidence")
    sense: Sense
    # what the robot does that waits for it, in people's words, in place of those of the sense
    awaiting = ""
    _mission_waits: Optional[float] = None  # see ``wait_for``
    _expiry: Optional[Timer] = None
    _patience: Optional[Patience] = None
    # the failure reported last, and what a message had to be newer than then
    _last_failure: Tuple[Optional[Failure], float] = (None, 0.0)

    def configure(self) -> None:
        """Refuse a class that does not say what it checks."""
        super().configure()
        if self.sense is None and self.own_evidence is None:
            raise ConfigureError(f"{self.registration_id} does not say what it checks: its class "
                                 "needs a sense, or own_evidence")

    def setup(self, **kwargs: Any) -> None:
        """Find out whether the mission waits for it."""
        super().setup(**kwargs)
        self._mission_waits = wait_for(self)

    @property
    def resource(self) -> str:
        """The topic's name."""
        return self.mission.interface.name_of(self.topic)

    @cached_property
    def evidence(self) -> Evidence:
        """The evidence of ``sense`` on this robot."""
        return self.own_evidence or self.mission.interface.evidence(self.sense)

    @cached_property
    def topic(self) -> Topic:
        """The topic of the evidence."""
        return self.evidence.topic

    def is_evidence(self, value: Any) -> bool:
        """Return whether a message with this value makes the condition true. Called on the
        receiving thread too: ports are read by ``read_ports``."""
        return self.evidence.is_given(value, self.mission.settings.gaze_value)

    def read_ports(self) -> None:
        """Read the ports that the condition depends on; called at each tick."""

    def not_before(self) -> float:
        """Return the time (monotonic seconds) that a message must be newer than."""
        return float("-inf")

    def use(self, sample: Sample) -> None:
        """Store the content of the message."""

    def unused(self, sample: Sample) -> None:
        """Process a message that counts but is not the wanted evidence."""

    def judged(self, counting: Sequence[Sample]) -> None:
        """Process the messages that count apart from the answer to the condition."""

    def update(self) -> Result:
        """Evaluate the messages that count."""
        if self.status is not RUNNING:
            self.started_at = self.mission.clock.now()
        try:
            self.read_ports()
            return self._answer()
        except PortError as error:
            self._stop_timers()
            return self._fail(self.missing(error), 0.0)

    def _answer(self) -> Result:
        topics, topic = self.mission.topics, self.topic
        samples = topics.recent(topic)
        counting = [sample for sample in since(samples, self.not_before())
                    if self.mission.clock.now() - sample.arrived <= self._max_age]
        self.judged(counting)
        for counted in counting:
            if self.is_evidence(counted.value):
                return self._true(counted, counted is counting[-1])
        is_given_up = self.evidence.is_given_up
        if any(is_given_up(counted.value) for counted in counting):
            topics.wake_when(self.uid, topic, self.is_evidence)
            return self._false(samples, counting)
        is_first = self._lacks_first(samples)
        topics.wake_when(self.uid, topic, lambda value: (
            is_first or self.is_evidence(value) or is_given_up(value)))
        if self._patience is None:
            topics.listen(topic, self.wait)
        limit = self._limit(samples)
        if not self._waits(limit):
            return self._false(samples, counting)
        if self.status is not RUNNING:
            self._begin_to_wait(limit)
        return RUNNING

    def _begin_to_wait(self, limit: float) -> None:
        own = self.own_evidence is not None
        words = self.awaiting or (self.registration_id if own else self.sense.awaiting)
        self.begin_wait(words, limit)

    @property
    def _max_age(self) -> float:
        if not self.topic.is_continuous:
            return math.inf
        return self.mission.settings.topic_max_age

    def _true(self, sample: Sample, is_newest: bool) -> Result:
        self._stop_timers()
        self.mission.topics.listen(self.topic, 0.0)
        if self.topic.is_continuous:
            if is_newest:
                self.mission.topics.wake_when(self.uid, self.topic,
                                              lambda value: not self.is_evidence(value))
            left = sample.arrived + self._max_age - self.mission.clock.now()
            self._expiry = self.mission.clock.call_after(left + 0.001, self.wake)
        self._last_failure = (None, 0.0)
        self._note("given")
        self.use(sample)
        return self.succeeded()

    def _false(self, samples: Sequence[Sample], counting: Sequence[Sample]) -> Result:
        self._stop_timers()
        self._note("absent")
        if counting:
            self.unused(counting[-1])
        reason = unheard(samples, self.not_before(), self.mission.clock.now(), self._max_age)
        message = joined("; ", self.words_if_false, reason or "")
        if self._lacks_first(samples):
            name, reason = self.mission.topics.name(self.topic), None
            message = f"{self.registration_id}: no message on {name} yet"
        failure = Failure(Cause.CONDITION_FALSE, message, self.resource,
                          reason if self.topic.is_continuous else None)
        return self._fail(failure, self.not_before())

    def _lacks_first(self, samples: Sequence[Sample]) -> bool:
        """Return whether another package's state, as far as this node knows, was never sent."""
        return not samples and self.own_evidence is not None and self.topic.is_continuous

    def _note(self, what: str) -> None:
        """Tell the story that the sign of the sense is ``given`` or ``absent``."""
        self.summary, mark = None, getattr(self.sense, what, "")
        if mark and self.own_evidence is None:
            self.summary = LeafSummary("visit", "", mark, self.mission.clock.now())

    def _fail(self, failure: Failure, since: float) -> Result:
        reported = failure, max(since, self.mission.visit_began)
        if reported == self._last_failure:
            # asked again at every tick of a wait: recorded each time, reported once
            self.mission.failures.add(self, failure)
            return FAILURE
        is_new = reported[1:] != self._last_failure[1:]
        self._last_failure = reported
        result = self.failed(failure)
        if is_new and self._mission_waits is not None and not self._may_wait:
            self._begin_to_wait(self._mission_waits)
        return result

    @property
    def wait(self) -> float:
        """Seconds that the condition waits for its evidence."""
        if self.evidence.wait is None:
            return self.mission.settings.condition_wait
        return self.evidence.wait

    @cached_property
    def _may_wait(self) -> bool:
        return self.wait > 0.0 and not is_asked_again(self)

    def _limit(self, samples: Sequence[Sample]) -> float:
        """Return the seconds to wait from now on, if the wait has not begun: for the evidence, and
        for the topic's first message."""
        wait = self.wait if self._may_wait else 0.0
        if not self._lacks_first(samples):
            return wait
        now = self.mission.clock.now()
        return max(wait, self.mission.first_due.setdefault(self.topic, now + self._max_age) - now)

    def _waits(self, limit: float) -> bool:
        if limit <= 0.0:
            return False
        if self._patience is None and limit < math.inf:
            self._patience = Patience(self, self.topic, limit)
        return self._patience is None or not self._patience.is_over()

    def _stop_timers(self) -> None:
        for timer in (self._expiry, self._patience):
            if timer is not None:
                timer.cancel()
        self._expiry = self._patience = None

    def halt(self) -> None:
        """Stop waiting."""
        if self.status is RUNNING:
            self.mission.topics.listen(self.topic, 0.0)
        self._stop_timers()
        super().halt()
