"""The nodes of release 1.0's missions that D5.4.3 lacks: their argument is the name of the
instance.

Most are a leaf of D5.4.3 with the argument as its constant.
"""
from typing import Optional, Tuple, Union

from behavior_controller.bt import Result
from behavior_controller.robot.gateway import Cause, Failure, since
from behavior_controller.robot.declarations import Sense, Topic
from behavior_controller.robot.requests import (
    Request, SetPose, SetRecognition, SetRecognitionLanguage)
from behavior_controller.config.knowledge_files import UTILITY_PHRASES
from behavior_controller.leaves.attention import MODES, AnimateBehavior, OvertAttentionMode
from behavior_controller.leaves.base import (
    NOT_ASKED, InstantCondition, ServiceLeaf, Waiting, WorkingLeaf, leaf_spec)
from behavior_controller.leaves.conditions import Patience, TopicCondition
from behavior_controller.leaves.data import EXHIBITS, GESTURE_TARGET, VISITOR_RESPONSE
from behavior_controller.leaves.dialogue import utterance_summary
from behavior_controller.leaves.gesture import IconicGesture
from behavior_controller.leaves.knowledge import LookUp
from behavior_controller.leaves.lifecycle import begin_pass
from behavior_controller.leaves.speech import Question
from behavior_controller.config.phrases import SPEECHES, is_error

ANSWER_WAIT = 10.0
"""Seconds that GetVisitorResponse listens."""


class StartOfTreeInLanguage(ServiceLeaf):
    """``<StartOfTree/>``: announces a pass, and sets the language of speech recognition."""

    asks = SetRecognitionLanguage
    does_without = True

    def on_start(self) -> Result:
        """Begin the pass, only once even if the language is retried."""
        begin_pass(self)
        return super().on_start()

    def request(self) -> Optional[Request]:
        """Set the language, if speech is recognised."""
        is_used = self.mission.settings.asr_enabled
        return SetRecognitionLanguage(self.mission.language) if is_used else None


class SetSpeechEvent(ServiceLeaf):
    """``<SetSpeechEvent name="true"/>``: switches speech recognition on or off
    (/speechEvent/set_enabled)."""

    asks = SetRecognition
    does_without = True
    is_enabled: bool

    def request(self) -> Request:
        return SetRecognition(self.is_enabled)


class SetRobotPose(ServiceLeaf):
    """``<SetRobotPose/>``: sets the robot's pose to the start of the tour."""

    asks = SetPose
    does_without = True
    PORTS = (EXHIBITS.read(is_optional=True),)

    def request(self) -> Union[Request, Failure]:
        """Send the first location of the tour."""
        exhibits = self.get_input_or("exhibits", ())
        if not exhibits:
            return Failure(Cause.MISSING_DATA,
                           "there is no tour yet, whose first location it would be", self.resource)
        return SetPose(exhibits[0].location)


class SayText(Question):
    """``<SayText name="4"/>``: says a utility phrase.

    Like a question, it invalidates older answers: some of the phrases are questions.
    """

    number: int

    def request(self) -> Union[Request, Failure]:
        """Say the phrase; a culture file may have none of that number."""
        knowledge, text = self.mission.knowledge, self.mission.phrases.utility(self.number)
        if knowledge is not None:
            text = knowledge.phrases.get(self.number)
        if text is None:
            return Failure(Cause.MISSING_DATA, f"there is no utility phrase {self.number}",
                           self.resource)
        if not self.mission.interface.numbers_phrases:
            self.is_question = "?" in text
        return self.asks(text, self.mission.language)


class IsVisitorPresent(TopicCondition):
    """``<IsVisitorPresent/>``: SUCCESS if the visitor is seen, by the newest message."""

    sense = Sense.PRESENCE
    otherwise = "no visitor is seen"


class HasVisitorResponded(InstantCondition):
    """``<HasVisitorResponded/>``: SUCCESS if an answer is stored."""

    PORTS = (VISITOR_RESPONSE.read(),)
    otherwise = "the visitor has not answered"

    def holds(self) -> bool:
        """Return whether a non-empty answer is stored."""
        return bool(self.get_input_or("visitorResponse", ""))


class GetVisitorResponse(WorkingLeaf):
    """``<GetVisitorResponse/>``: listens for a yes or a no from now on, and stores it.

    SUCCESS with an empty answer if none was understood in ``ANSWER_WAIT``; FAILURE at an error of
    the recognition.
    """

    sense = Sense.UTTERANCE
    PORTS = (VISITOR_RESPONSE.written(),)
    prefers_action = False  # where the robot offers both, the action is listened to
    topic: Topic

    def join(self) -> None:
        """Get the topic of utterances."""
        self.mission.has_questions = True
        self.topic = self.mission.interface.evidence(self.sense).topic
        self.resource = self.mission.interface.name_of(self.topic)

    def work(self) -> Waiting[Result]:
        """Listen; the first utterance that ends the listening counts."""
        topics = self.mission.topics
        self.set_output("visitorResponse", "")  # a halt leaves no earlier answer
        self.begin_wait(self.sense.awaiting, ANSWER_WAIT)
        patience = Patience(self, self.topic, ANSWER_WAIT)
        topics.listen(self.topic, ANSWER_WAIT, self.prefers_action)
        self.mission.ignore_answers("")
        try:
            utterance, answer = self._heard()
            while not (is_error(utterance) or answer or patience.is_over()):
                topics.wake_when(self.uid, self.topic, self._ends)
                yield None
                utterance, answer = self._heard()
        finally:
            topics.listen(self.topic, 0.0)
            self.mission.ignore_answers(NOT_ASKED)
            patience.cancel()
        self.set_output("visitorResponse", answer)
        if is_error(utterance):
            text = f"the recognition says {utterance!r}"
            return self.failed(Failure(Cause.UNUSABLE_ANSWER, text, self.resource))
        return self.succeeded()

    def _heard(self) -> Tuple[str, str]:
        """Return the utterance that counts so far, and the answer in it; empty if there is none."""
        utterances = [sample.value for sample in
                      since(self.mission.topics.recent(self.topic), self.started_at)]
        utterance = next(filter(self._ends, utterances), utterances[-1] if utterances else "")
        if not utterance or is_error(utterance):
            return utterance, ""
        answer = self.mission.phrases.spoken_answer(utterance)
        self.summary = utterance_summary(utterance, answer)
        return utterance, answer or ""

    def _ends(self, utterance: str) -> bool:
        """Return whether an utterance ends the listening. Called on the receiving thread too."""
        return is_error(utterance) or self.mission.phrases.is_answer(utterance)


_QUESTIONS = [speech.utility for speech in SPEECHES if speech.asks]
FAREWELLS = tuple(str(speech.utility) for speech in SPEECHES
                   if speech.is_farewell and speech.utility)

PHRASES = {str(number): {"number": number, "is_question": number in _QUESTIONS}
           for number in UTILITY_PHRASES}
GESTURES = {"welcome": {"setting": "welcome_gesture_id"},
            "goodbye": {"setting": "goodbye_gesture_id"}}
"""The phrase or the gesture that the name of an instance chooses."""

SPECS = (
    leaf_spec("StartOfTree", StartOfTreeInLanguage,
              "Shows that a visitor's pass begins, and sets the language of recognition.",
              begins_pass=True),
    leaf_spec("SayText", SayText, "Says a utility phrase, by its number.", choices=PHRASES,
              farewells=FAREWELLS, says_phrase=True),
    leaf_spec("SetOvertAttentionMode", OvertAttentionMode, "Sets the mode of attention.",
              (GESTURE_TARGET.read("target", is_optional=True),),
              choices={state: {"state": state} for _, state, _, _ in MODES}, sets_mode=""),
    leaf_spec("SetAnimateBehavior", AnimateBehavior, "Starts or stops lifelike movement.",
              choices={state: {"state": state} for state in ("enabled", "disabled")}),
    leaf_spec("SetSpeechEvent", SetSpeechEvent, "Switches speech recognition on or off.",
              choices={"true": {"is_enabled": True}, "false": {"is_enabled": False},
                       "enabled": {"is_enabled": True}, "disabled": {"is_enabled": False}}),
    leaf_spec("PerformIconicGesture", IconicGesture, "Makes the welcome gesture or waves goodbye.",
              choices=GESTURES, farewells=("goodbye",)),
    leaf_spec("SetRobotPose", SetRobotPose,
              "Tells the localization that the robot is at the first location of the tour."),
    leaf_spec("ResetRobotPose", SetRobotPose,
              "Tells the localization where the robot is; another name of SetRobotPose."),
    leaf_spec("RetrieveInitialLocation", LookUp, "Makes the first location the target.",
              is_indispensable=True, arguments={"place": "home", "has_gesture": False}),
    leaf_spec("GetVisitorResponse", GetVisitorResponse,
              f"Listens for a yes or a no for up to {ANSWER_WAIT:g} s; an empty answer if there is "
              "none."),
    leaf_spec("HasVisitorResponded", HasVisitorResponded, "Did the visitor answer?"),
    leaf_spec("IsVisitorPresent", IsVisitorPresent, "Is the visitor there?"))
