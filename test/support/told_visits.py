"""Visits of each kind: runs of the engine in virtual time, and the sentences about them."""
import re

import pytest

from behavior_controller.run.events import HealthChanged
from behavior_controller.robot.d543 import FACES
from behavior_controller.robot.gateway import Cause, Failure
from behavior_controller.run.health import GONE
from behavior_controller.robot.requests import Answer, Faces, GoTo, PerformGesture, Prompt, Say
from behavior_controller.run.moment import card, card_line
from behavior_controller.run.story import Story
from behavior_controller.run.record.reader import read_record
from behavior_controller.missions.replay import replay

from mission_rig import FileRecord, Rig, refusing, service_of, visitor_who


def now_of(state, at):
    """Return the card's line; if nothing is done, only where that is."""
    now = card(state)
    return card_line(now, at) if now.kind not in ("idle", "ended") else now.where


class Teller:
    """The story of a rig's run as it happens: ``lines`` are its sentences, ``now`` what was shown
    while it waited."""

    def __init__(self, rig, folder=None):
        self.rig, self.story, self.sentences, self.now = rig, Story(), [], []
        rig.mission.events.subscribe(self._take)
        self._record = None
        if folder is not None:
            self._record = FileRecord(str(folder), pytest.fail).open()
            rig.mission.events.subscribe(self._record)
            self._record.show(rig.tree)
            rig.mission.topics = self._record.topics(rig.topics)

    def _take(self, event):
        self.sentences += self.story.take(self.rig.clock.now(), event)

    @property
    def lines(self):
        return [sentence.text for sentence in self.sentences]

    def run(self, visitor, runs=1, **options):
        """Run passes; return the teller."""
        def act(rig):
            self.now.append(now_of(self.story.state, rig.clock.now()))
            visitor(rig)

        self.rig.run(act, runs=runs, **options)
        return self

    def recorded(self):
        """Return the sentences that the record tells; the record is replayed first."""
        self._record.close()
        lines = read_record(self._record.path)
        assert not replay(lines).divergence
        story = Story()
        return [sentence.text for line in lines for sentence in story.take(line.time, line.event)]


def drives(rig):
    return sum(isinstance(request, GoTo) for request in rig.requests)


def unanswered_drive(request):
    return Failure(Cause.NO_ANSWER, "waited 180 s", service_of(request)) if isinstance(
        request, GoTo) else NotImplemented


def looks_away(rig):
    """Look at the robot everywhere but at the first exhibit."""
    visitor_who("yes", gazes=drives(rig) != 1)(rig)


def walks_off(rig):
    """Be gone when the robot has driven to the first exhibit."""
    if not drives(rig):
        visitor_who("yes")(rig)
        return
    rig.clock.advance(0.5)
    rig.topics.publish(FACES, Faces((), ()))


def loses_the_voice(rig):
    """Lose the node that speaks while the visitor is met."""
    if not rig.of(HealthChanged):
        rig.mission.health.report(GONE, HealthChanged(
            "service", "/textToSpeech/say_text", "textToSpeech", False, "gone: no node offers it",
            "until it is back, the robot cannot speak"))
    visitor_who("no")(rig)


def unreachable_speech(request):
    return Failure(Cause.NOT_REACHABLE, "connection refused", service_of(request)) if (
        isinstance(request, Say) and "another time" in request.text.lower()) else NotImplemented


NO = lambda request: Answer("No") if isinstance(request, Prompt) else NotImplemented  # noqa: E731
DATA = re.compile(r"“[^”]*”|/[\w/]+|[A-Z]\w*[A-Z]\w*|\d+(?:\.\d+)?")


def gist(sentence):
    """Return kind, severity and node of a sentence, and what it says without its words: names,
    numbers, quotations."""
    node = sentence.path.rpartition("/")[2].partition("::")[0]
    return " ".join(
        filter(None, [sentence.kind, sentence.severity, node] + DATA.findall(sentence.text)))


# the visitor, the robot's answers, asrEnabled, passes; the gist of sentences that stand in the
# story in this order
RUNS = {
    "tour": (visitor_who("yes please"), None, True, 1, [
        "visit info IsVisitorDiscovered 1", "moved info WelcomeGesture",
        "visit info IsMutualGazeDiscovered 1",
        "asked info QueryTourSpeech “Would you like me to give you a tour of the lab?”",
        "heard info IsYesNoUttered “yes please”", "stop info SelectExhibit 1 2 1",
        "moved info Navigate 1", "said info 1 “first text 1”", "moved info Point to exhibit 1",
        "said info 2 “second text 1”", "stop info IsListWithExhibit 1 2 1",
        "stop info SelectExhibit 2 2 2", "stop info IsListWithExhibit 2 2 2",
        "moved info Navigate", "moved info GoodbyeGesture", "moved info Navigate",
        "visit info 1 SUCCESS 2.5 2 2"]),
    "left out": (looks_away, None, True, 1, [
        "stop info SelectExhibit 1 2 1", "moved info Navigate 1",
        "stop warning IsMutualGazeDiscovered 1 2 1", "stop info SelectExhibit 2 2 2",
        "visit warning 1 SUCCESS 17.0 1 1 2"]),
    "given up": (visitor_who("yes"), unanswered_drive, True, 1, [
        "failure warning Navigate 180 /robotNavigation/set_goal", "recovery info Navigate 2 2",
        "stop error Navigate 1 2 1 2 /robotNavigation/set_goal",
        "recovery error Navigate 2 /robotNavigation/set_goal",
        "visit warning 1 FAILURE 3.0 1 2 1 2 /robotNavigation/set_goal"]),
    "visitor left": (walks_off, None, True, 1, [
        "moved info Navigate 1", "stop info IsVisitorDiscovered 1 2 1", "moved info Navigate",
        "visit info 1 16.0 1 2 1"]),
    "node died": (loses_the_voice, unreachable_speech, True, 1, [
        "health warning /textToSpeech/say_text /textToSpeech",
        "failure warning MaybeAnotherTimeSpeech MaybeAnotherTimeSpeech /textToSpeech/say_text",
        "recovery info MaybeAnotherTimeSpeech MaybeAnotherTimeSpeech 2 2",
        "recovery warning MaybeAnotherTimeSpeech MaybeAnotherTimeSpeech 2 /textToSpeech/say_text",
        "visit warning 1 SUCCESS 1.5 MaybeAnotherTimeSpeech"]),
    "budget spent": (visitor_who("yes"), refusing(Say, PerformGesture), True, 2, [
        "recovery warning WelcomeSpeech WelcomeSpeech 2 /textToSpeech/say_text",
        "recovery warning Point to exhibit LocationOvertAttentionMode PerformDeicticGesture "
        "/gestureExecution/perform_gesture", "moved info HandleFallBack 1",
        "recovery error GoodbyeGesture 30 600 GoodbyeGesture /gestureExecution/perform_gesture"]),
    "silent": (visitor_who(), None, True, 1, [
        "asked info SayYesNoSpeech “I am sorry, I can only understand yes or no. Please say yes "
        "or no.”",
        "asked info SayYesNoSpeech “I am sorry, I can only understand yes or no. Please say yes "
        "or no.”",
        "asked info SayYesNoSpeech “I am sorry, I can only understand yes or no. Please say yes "
        "or no.”",
        "said info MaybeAnotherTimeSpeech “That is all right. Maybe another time! Have a nice "
        "day.”",
        "visit info 1 SUCCESS 40.5"]),
    "declined": (visitor_who("no"), None, True, 1,
                 ["heard info IsYesNoUttered “no”", "visit info 1 SUCCESS 1.0"]),
    "no gaze": (visitor_who(gazes=False), None, True, 1,
                ["visit info IsVisitorDiscovered 1", "visit info 1 15.0"]),
    "unclear": (visitor_who("perhaps"), None, True, 1, [
        "heard info IsYesNoUttered “perhaps”",
        "asked info SayYesNoSpeech “I am sorry, I can only understand yes or no. Please say yes "
        "or no.”",
        "visit info 1 SUCCESS 40.5"]),
    "tablet": (visitor_who(), NO, False, 1,
               ["pressed info PressYesNoDialogue “No”", "visit info 1 SUCCESS 0.5"])}


def rig_of(kind):
    """Return the rig of one of the ``RUNS``."""
    _, answer, by_voice, _, _ = RUNS[kind]
    return Rig(answer=answer or (lambda request: NotImplemented), asrEnabled=by_voice)
