"""Leaves that speak (/textToSpeech/say_text)."""
from functools import partial
from typing import Optional, Union

from behavior_controller.bt.engine.node import Result
from behavior_controller.bt.registry import Kind, NodeSpec
from behavior_controller.gateway import Cause, Failure
from behavior_controller.interface.records import Answer, Request, Say
from behavior_controller.leaves.base import (CURRENT_EXHIBIT, DESCRIPTION_1, DESCRIPTION_2, QUESTION_ASKED_AT,
                                             ServiceLeaf)
from behavior_controller.phrases import SPEECHES


class FixedSpeech(ServiceLeaf):
    """``<WelcomeSpeech/>``: says the text that the language's phrases have under ``phrase``."""

    asks = Say

    def __init__(self, name: str, phrase: str):
        super().__init__(name)
        self.phrase = phrase

    def request(self) -> Request:
        """Say the phrase."""
        return Say(self.mission.phrases.speech(self.phrase))


class Question(FixedSpeech):
    """``<QueryTourSpeech/>``: a speech that asks the visitor; writes ``questionAskedAt`` when it has been spoken.

    Not earlier: the robot must not take its own voice for an answer. A question that failed ends the time of older
    answers all the same.
    """

    def accept(self, answer: Answer) -> Optional[Failure]:
        """Note when the question had been asked."""
        self.remember(QUESTION_ASKED_AT, self.mission.clock.now())
        return None

    def failed(self, failure: Failure) -> Result:
        """Note when the attempt was over."""
        self.remember(QUESTION_ASKED_AT, self.mission.clock.now())
        return super().failed(failure)


class DescribeExhibitSpeech(ServiceLeaf):
    """``<DescribeExhibitSpeech name="1"/>``: says description1 of the current exhibit, "2" description2, else both.

    Reads ``currentExhibit``, ``description1``, ``description2``.
    """

    asks = Say
    PARTS = {"1": (DESCRIPTION_1,), "2": (DESCRIPTION_2,)}
    """The names that choose what is said."""

    def __init__(self, name: str, part: str = ""):
        super().__init__(name)
        self.part = part or name

    def request(self) -> Union[Request, Failure, None]:
        """Say what there is to say; an exhibit without that description is passed over."""
        if self.recall(CURRENT_EXHIBIT) is None:
            return Failure(Cause.MISSING_DATA, "no exhibit has been selected", self.resource)
        keys = self.PARTS.get(self.part, (DESCRIPTION_1, DESCRIPTION_2))
        text = " ".join(filter(None, (self.recall(key) for key in keys)))
        return Say(text) if text else None


SPECS = tuple(
    NodeSpec(speech.node, Kind.ACTION, partial(Question if speech.asks else FixedSpeech, phrase=speech.node),
             description=speech.description) for speech in SPEECHES
) + (
    NodeSpec("SayGoodBye", Kind.ACTION, partial(FixedSpeech, phrase="SayGoodByeSpeech"),
             description="Another name of SayGoodByeSpeech."),
    NodeSpec("DescribeExhibitSpeech", Kind.ACTION, DescribeExhibitSpeech,
             description="Describes the current exhibit: name 1 or 2 chooses the part, any other says both.",
             names=tuple(DescribeExhibitSpeech.PARTS)),
    NodeSpec("DescribeExhibitSpeech_1", Kind.ACTION, partial(DescribeExhibitSpeech, part="1"),
             description="Says the first description of the current exhibit."),
    NodeSpec("DescribeExhibitSpeech_2", Kind.ACTION, partial(DescribeExhibitSpeech, part="2"),
             description="Says the second description of the current exhibit."),
)
