"""Leaves that speak (/textToSpeech/say_text)."""
from typing import Iterable, Optional, Tuple, Union

from msgspec.structs import replace

from behavior_controller.bt import ConfigureError, Port
from behavior_controller.bt.engine.ports import reference
from behavior_controller.bt.values.values import TEXT
from behavior_controller.robot.gateway import Cause, Failure
from behavior_controller.robot.requests import Answer, Request, Say, Words
from behavior_controller.leaves.base import BEFORE_QUESTION, ServiceLeaf, Waiting, leaf_spec
from behavior_controller.leaves.data import (
    CURRENT_EXHIBIT, DESCRIPTION_1, DESCRIPTION_2, QUESTION_ASKED_AT)
from behavior_controller.config.node_facts import MissionSpec, whole_mission
from behavior_controller.config.phrases import SPEECHES, Speech, filled
from behavior_controller.config.settings import DESCRIPTIONS
from behavior_controller.text import joined


class SpeechLeaf(ServiceLeaf):
    """A leaf that speaks. Where the robot answers before it has spoken, ``waitForSpeech`` decides
    whether the leaf is RUNNING for the time that the words take."""

    asks = Say
    is_description = False

    def lasts(self, request: Say) -> float:
        """Return the seconds that the words take, if they are waited for."""
        settings = self.mission.settings
        chosen = settings.wait_for_speech
        is_awaited = chosen == "all" or chosen == DESCRIPTIONS and self.is_description
        if not is_awaited or not self.mission.interface.service(self.asks).answers_early(request):
            return 0.0
        return len(request.text.split()) / settings.speech_pace


class FixedSpeech(SpeechLeaf):
    """``<WelcomeSpeech/>``: says the language's text for ``phrase``, with the values of the ports
    ``variables``."""

    phrase: str
    variables: Tuple[str, ...] = ()

    def request(self) -> Union[Request, Failure]:
        """Say the phrase."""
        text = self.mission.phrases.speeches[self.phrase]
        if self.variables:
            text = filled(text, self.get_input)
        return self.asks(text, self.mission.language)


class Question(FixedSpeech):
    """``<QueryTourSpeech/>``: a speech with a question; it notes when it has been spoken.

    Not earlier: the robot must not treat its own voice as an answer. A question that failed, at the
    first attempt or at a retry, also invalidates older answers.
    """

    PORTS = (QUESTION_ASKED_AT.written(),)
    is_question = True  # in sentences for people

    def join(self) -> None:
        """Let the mission know that it asks."""
        self.mission.has_questions = True

    def try_once(self) -> Waiting[Optional[Failure]]:
        """Begin to ask; what is said meanwhile is no answer."""
        self.mission.ignore_answers(BEFORE_QUESTION)
        return super().try_once()

    def words(self, request: Request) -> Words:
        """Describe it as a question."""
        words = super().words(request)
        if not self.is_question:
            return words
        return words._replace(doing="asking", done="asked", kind="asked")

    def accept(self, answer: Answer) -> Optional[Failure]:
        """Note that the visitor was asked, and when."""
        if self.summary is not None and self.is_question:
            self.summary = replace(self.summary, mark="asked")
        self.attempt_failed()
        return None

    def attempt_failed(self) -> None:
        """Note when the attempt ended."""
        self.mission.ignore_answers("")
        self.set_output("questionAskedAt", self.mission.clock.now())


class DescribeExhibitSpeech(SpeechLeaf):
    """``<DescribeExhibitSpeech part="1"/>``: says the first description of the exhibit, the second,
    or both.

    Without ``part`` the name of the node chooses it: 1, 2, any other both.
    """

    is_description = True
    PARTS = {"1": ("description1",), "2": ("description2",),
             "both": ("description1", "description2")}
    """The ports with the texts to say."""

    PORTS = (CURRENT_EXHIBIT.read(),)
    PART = Port(
        "part", TEXT, is_optional=True, names=("1", "2"),
        description="1, 2 or both; without it the node's name 1 or 2 chooses, any other says both")

    def __init__(self, name: str, part: str = ""):
        super().__init__(name)
        self.part = part or "both"
        if not part and name in self.PARTS:
            self.part = name

    def configure(self) -> None:
        """Refuse a part that does not exist."""
        super().configure()
        part = self.attributes.get(self.PART.name, self.part)
        if reference(part, self.PART.name) is None and part not in self.PARTS:
            raise ConfigureError(
                f"the part cannot be {part}; allowed: {', '.join(self.PARTS)}", self.PART.name)

    def request(self) -> Union[Request, Failure, None]:
        """Say the descriptions; a missing one is skipped."""
        self.get_input("currentExhibit")
        part = self.part
        if self.PART.name in self.attributes:
            part = self.get_input(self.PART.name)
        if part not in self.PARTS:
            return Failure(Cause.MISSING_DATA, f"the part cannot be {part}", self.resource)
        text = joined(" ", *(self.get_input_or(port, "") for port in self.PARTS[part]))
        if not text:
            return None
        return self.asks(text, self.mission.language)


def specs(speeches: Iterable[Speech]) -> Tuple[MissionSpec, ...]:
    """Return the node types of these speeches."""
    return tuple(leaf_spec(
        speech.node, Question if speech.asks else FixedSpeech, speech.description,
        ports=tuple(Port(name, TEXT, default=whole_mission(name)) for name in speech.variables),
        arguments={"phrase": speech.node, "variables": speech.variables},
        is_farewell=speech.is_farewell) for speech in speeches)


SPECS = specs(SPEECHES) + (
    leaf_spec("SayGoodBye", FixedSpeech, "Says goodbye; another name of SayGoodByeSpeech.",
              arguments={"phrase": "SayGoodByeSpeech"}, is_farewell=True),
    leaf_spec("DescribeExhibitSpeech", DescribeExhibitSpeech,
              "Describes the current exhibit: name 1 or 2 chooses the part, any other says both.",
              (DESCRIPTION_1.read(), DESCRIPTION_2.read(), DescribeExhibitSpeech.PART)),
    leaf_spec("DescribeExhibitSpeech_1", DescribeExhibitSpeech,
              "Says the first description of the current exhibit.",
              (DESCRIPTION_1.read(),), {"part": "1"}),
    leaf_spec("DescribeExhibitSpeech_2", DescribeExhibitSpeech,
              "Says the second description of the current exhibit.",
              (DESCRIPTION_2.read(),), {"part": "2"}))
