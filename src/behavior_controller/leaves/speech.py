"""Leaves that speak (/textToSpeech/say_text)."""
from typing import Iterable, Optional, Tuple, Union

from behavior_controller.bt.engine.node import ConfigureError
from behavior_controller.bt.language.ports import PortError, reference
from behavior_controller.bt.language.values import TEXT
from behavior_controller.bt.registry import Port
from behavior_controller.events import Told
from behavior_controller.gateway import Cause, Failure
from behavior_controller.interface.records import Answer, Request, Say, Words
from behavior_controller.leaves.base import ServiceLeaf, leaf_spec
from behavior_controller.leaves.data import CURRENT_EXHIBIT, DESCRIPTION_1, DESCRIPTION_2, QUESTION_ASKED_AT
from behavior_controller.mission_spec import MissionSpec
from behavior_controller.phrases import SPEECHES, Speech


class FixedSpeech(ServiceLeaf):
    """``<WelcomeSpeech/>``: says the language's text for ``phrase``."""

    asks = Say

    def __init__(self, name: str, phrase: str):
        super().__init__(name)
        self.phrase = phrase

    def request(self) -> Union[Request, Failure]:
        """Say the phrase."""
        return Say(self.mission.phrases.speech(self.phrase), self.mission.language)


class Question(FixedSpeech):
    """``<QueryTourSpeech/>``: a speech with a question; it notes when it has been spoken.

    Not earlier: the robot must not treat its own voice as an answer. A question that failed, at the first attempt or
    at a retry, also invalidates older answers.
    """

    PORTS = (QUESTION_ASKED_AT.written(),)
    is_question = True  # in sentences for people

    def words(self, request: Request) -> Words:
        """Describe it as a question."""
        words = super().words(request)
        return words._replace(doing="asking", done="asked", kind="asked") if self.is_question else words

    def done(self, words: Words) -> Optional[Told]:
        """Note that the visitor was asked."""
        told = super().done(words)
        return told._replace(mark="asked") if told is not None and self.is_question else told

    def accept(self, answer: Answer) -> Optional[Failure]:
        """Note when the question had been asked."""
        self.set_output("questionAskedAt", self.mission.clock.now())
        return None

    def attempt_failed(self, failure: Failure) -> Failure:
        """Note when the attempt ended."""
        try:
            self.set_output("questionAskedAt", self.mission.clock.now())
        except PortError as error:
            return failure._replace(message="{}; {}".format(failure.message, error))
        return failure


class DescribeExhibitSpeech(ServiceLeaf):
    """``<DescribeExhibitSpeech part="1"/>``: says the first description of the exhibit, the second, or both.

    Without ``part`` the name of the node chooses it: 1, 2, any other both.
    """

    asks = Say
    PARTS = {"1": ("description1",), "2": ("description2",), "both": ("description1", "description2")}
    """The ports with the texts to say."""

    PORTS = (CURRENT_EXHIBIT.read(),)
    PART = Port("part", TEXT, is_optional=True, names=("1", "2"),
                description="1, 2 or both; without it the node's name 1 or 2 chooses, any other says both")

    def __init__(self, name: str, part: str = ""):
        super().__init__(name)
        self.part = part or (name if name in self.PARTS else "both")

    def configure(self) -> None:
        """Refuse a part that does not exist."""
        super().configure()
        part = self.attributes.get(self.PART.name, self.part)
        if reference(part, self.PART.name) is None and part not in self.PARTS:
            raise ConfigureError("the part cannot be {}; allowed: {}".format(part, ", ".join(self.PARTS)),
                                 self.PART.name)

    def request(self) -> Union[Request, Failure, None]:
        """Say the descriptions; a missing one is skipped."""
        self.get_input("currentExhibit")
        part = self.get_input(self.PART.name) if self.PART.name in self.attributes else self.part
        if part not in self.PARTS:
            return Failure(Cause.MISSING_DATA, "the part cannot be {}".format(part), self.resource)
        text = " ".join(filter(None, (self.get_input_or(port, "") for port in self.PARTS[part])))
        return Say(text, self.mission.language) if text else None


def specs(speeches: Iterable[Speech]) -> Tuple[MissionSpec, ...]:
    """Return the node types of these speeches."""
    return tuple(leaf_spec(speech.node, Question if speech.asks else FixedSpeech, speech.description,
                           arguments={"phrase": speech.node}, is_farewell=speech.is_farewell) for speech in speeches)


SPECS = specs(SPEECHES) + (
    leaf_spec("SayGoodBye", FixedSpeech, "Another name of SayGoodByeSpeech.",
              arguments={"phrase": "SayGoodByeSpeech"}, is_farewell=True),
    leaf_spec("DescribeExhibitSpeech", DescribeExhibitSpeech,
              "Describes the current exhibit: name 1 or 2 chooses the part, any other says both.",
              (DESCRIPTION_1.read(), DESCRIPTION_2.read(), DescribeExhibitSpeech.PART)),
    leaf_spec("DescribeExhibitSpeech_1", DescribeExhibitSpeech,
              "Says the first description of the current exhibit.", (DESCRIPTION_1.read(),), {"part": "1"}),
    leaf_spec("DescribeExhibitSpeech_2", DescribeExhibitSpeech,
              "Says the second description of the current exhibit.", (DESCRIPTION_2.read(),), {"part": "2"}),
)
