"""Leaves for the visitor's answer, by voice (/speechEvent/text) or tablet (/tabletEvent/prompt_and_get_response)."""
from typing import Any, Optional

from behavior_controller.bt.registry import Kind, NodeSpec
from behavior_controller.gateway import Cause, Failure, Sample
from behavior_controller.interface.document import SPEECH
from behavior_controller.interface.records import Answer, Prompt, Request
from behavior_controller.leaves.base import (QUESTION_ASKED_AT, VISITOR_RESPONSE, InstantCondition, ServiceLeaf,
                                             TopicCondition)
from behavior_controller.phrases import YES


class IsYesNoUttered(TopicCondition):
    """``<IsYesNoUttered/>``: SUCCESS for a yes or a no that was said after the question; writes ``visitorResponse``.

    Reads ``questionAskedAt`` and moves it on, so that one utterance answers one question.
    """

    topic = SPEECH
    otherwise = "neither yes nor no was heard"

    def is_evidence(self, value: Any) -> bool:
        """Return whether it is an answer."""
        return self.mission.phrases.spoken_answer(value) is not None

    def not_before(self) -> float:
        """Return when the question had been asked."""
        asked_at = self.recall(QUESTION_ASKED_AT)
        return float("-inf") if asked_at is None else asked_at

    def use(self, sample: Sample) -> None:
        """Keep the answer."""
        self.remember(VISITOR_RESPONSE, self.mission.phrases.spoken_answer(sample.value))
        self.remember(QUESTION_ASKED_AT, sample.arrived)


class IsVisitorResponseYes(InstantCondition):
    """``<IsVisitorResponseYes/>``: SUCCESS if ``visitorResponse`` is yes."""

    otherwise = "the visitor did not say yes"

    def holds(self) -> bool:
        """Return whether it is yes."""
        return self.recall(VISITOR_RESPONSE) == YES


class PressYesNoDialogue(ServiceLeaf):
    """``<PressYesNoDialogue/>``: shows two buttons and writes ``visitorResponse``; no answer is a failure."""

    asks = Prompt

    def request(self) -> Request:
        """Show the buttons."""
        return Prompt(self.mission.phrases.tablet_options)

    def accept(self, answer: Answer) -> Optional[Failure]:
        """Keep what was pressed."""
        pressed = self.mission.phrases.pressed_answer(answer.response)
        if pressed is not None:
            self.remember(VISITOR_RESPONSE, pressed)
            return None
        if answer.response.strip() in ("", "0"):
            return Failure(Cause.MISSING_DATA, "the visitor pressed nothing", self.resource)
        return Failure(Cause.UNUSABLE_ANSWER, "the response {!r} is none of {}".format(
            answer.response, ", ".join(self.mission.phrases.tablet_options)), self.resource)


SPECS = (
    NodeSpec("IsYesNoUttered", Kind.CONDITION, IsYesNoUttered, description="Did the visitor say yes or no?"),
    NodeSpec("IsVisitorResponseYes", Kind.CONDITION, IsVisitorResponseYes, description="Was the answer yes?"),
    NodeSpec("PressYesNoDialogue", Kind.ACTION, PressYesNoDialogue, description="Asks yes or no on the tablet."),
)
