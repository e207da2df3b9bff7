"""Leaves for the visitor's answer, by voice (/speechEvent/text) or tablet
(/tabletEvent/prompt_and_get_response)."""
from abc import abstractmethod
from typing import Any, Optional, Sequence, Tuple

from behavior_controller.bt import Port
from behavior_controller.run.events import LeafSummary
from behavior_controller.robot.gateway import Cause, Failure, Sample
from behavior_controller.robot.declarations import Sense
from behavior_controller.robot.requests import Answer, Prompt, Request
from behavior_controller.leaves.base import NOT_ASKED, InstantCondition, ServiceLeaf, leaf_spec
from behavior_controller.leaves.conditions import TopicCondition
from behavior_controller.leaves.data import QUESTION_ASKED_AT, VISITOR_RESPONSE
from behavior_controller.config.phrases import NO, YES, begins_with_error


def utterance_summary(utterance: str, answer: Optional[str],
                      without: str = "neither yes nor no") -> LeafSummary:
    """Return the sentence about an utterance and its answer; ``without``: there is none."""
    if answer is None and begins_with_error(utterance):  # of the recognition
        return LeafSummary("heard", "no answer recognised", "unrecognised")
    if answer is None:
        return LeafSummary("heard", f"heard “{utterance}”: {without}")
    mark = answer if answer in (YES, NO) else "understood"
    return LeafSummary("heard", f"heard “{utterance}”: {answer}", mark)


class UtteranceCondition(TopicCondition):
    """SUCCESS for an utterance after the question that has a meaning; the first one counts.

    It advances the question's time, so that one utterance answers only one question.
    """

    RULE = ("meaning", "keep")
    sense = Sense.UTTERANCE
    ASKED_AT = QUESTION_ASKED_AT.changed(is_optional=True)
    PORTS: Tuple[Port, ...] = (ASKED_AT,)
    without_meaning = "not understood"  # of an utterance, for people

    def __init_subclass__(cls) -> None:
        """Add the port with the question's time to those of the class."""
        cls.PORTS = (*(port for port in cls.PORTS if port != cls.ASKED_AT), cls.ASKED_AT)

    @abstractmethod
    def meaning(self, utterance: str) -> Optional[str]:
        """Return the meaning of an utterance in words for people, None if it has none. Called on
        the receiving thread too."""

    @abstractmethod
    def keep(self, utterance: str) -> None:
        """Store the meaning of the utterance."""

    def is_evidence(self, value: Any) -> bool:
        """Return whether the utterance has a meaning; an error of the recognition has none."""
        return not begins_with_error(value) and self.meaning(value) is not None

    def judged(self, counting: Sequence[Sample]) -> None:
        """Have answers count from now on, whether something was asked or not."""
        self.mission.ignore_answers("")

    def not_before(self) -> float:
        """Return when the question had been asked."""
        return self.get_input_or("questionAskedAt", float("-inf"))

    def use(self, sample: Sample) -> None:
        """Store the meaning."""
        self.keep(sample.value)
        self.set_output("questionAskedAt", sample.arrived)
        self.mission.ignore_answers(NOT_ASKED)
        self.summary = utterance_summary(sample.value, self.meaning(sample.value))

    def unused(self, sample: Sample) -> None:
        """Report an utterance without a meaning."""
        self.summary = utterance_summary(sample.value, None, self.without_meaning)


class IsYesNoUttered(UtteranceCondition):
    """``<IsYesNoUttered/>``: SUCCESS for a yes or a no after the question."""

    PORTS = (VISITOR_RESPONSE.written(),)
    otherwise = "no yes or no heard"
    without_meaning = "neither yes nor no"

    def meaning(self, utterance: str) -> Optional[str]:
        """Return the answer."""
        return self.mission.phrases.spoken_answer(utterance)

    def keep(self, utterance: str) -> None:
        """Store the answer."""
        self.set_output("visitorResponse", self.meaning(utterance))


class IsVisitorResponseYes(InstantCondition):
    """``<IsVisitorResponseYes/>``: SUCCESS if the visitor's answer is yes; without an answer
    FAILURE."""

    PORTS = (VISITOR_RESPONSE.read(),)
    otherwise = "the visitor did not say yes"

    def holds(self) -> bool:
        """Return whether it is yes."""
        answer = self.get_input_or("visitorResponse", "")
        if not answer:
            self.summary = LeafSummary("heard", "", "unanswered")
        return answer == YES


class PressYesNoDialogue(ServiceLeaf):
    """``<PressYesNoDialogue/>``: shows two buttons; no answer is a failure."""

    asks = Prompt
    PORTS = (VISITOR_RESPONSE.written(),)

    def request(self) -> Request:
        """Show the buttons."""
        return Prompt(self.mission.phrases.tablet_options)

    def accept(self, answer: Answer) -> Optional[Failure]:
        """Store the pressed answer; if the robot does not report it, ``tabletSuccessIs`` decides
        the meaning of a press."""
        if not self.mission.interface.tells_pressed:
            if self.mission.settings.tablet_success_is == YES:
                self.set_output("visitorResponse", YES)
            return None
        pressed = self.mission.phrases.pressed_answer(answer.response)
        if pressed is not None:
            self.set_output("visitorResponse", pressed)
            yes, no = self.mission.phrases.tablet_options
            label = yes if pressed == YES else no
            self.summary = LeafSummary("pressed", f"the visitor pressed “{label}”", pressed)
            return None
        if answer.response.strip() in ("", "0"):
            return Failure(Cause.MISSING_DATA, "the visitor pressed nothing", self.resource)
        options = ", ".join(self.mission.phrases.tablet_options)
        text = f"the response {answer.response!r} is none of {options}"
        return Failure(Cause.UNUSABLE_ANSWER, text, self.resource)


SPECS = (
    leaf_spec("IsYesNoUttered", IsYesNoUttered, "Did the visitor say yes or no?"),
    leaf_spec("IsVisitorResponseYes", IsVisitorResponseYes, "Was the answer yes?"),
    leaf_spec("PressYesNoDialogue", PressYesNoDialogue, "Asks yes or no on the tablet."))
