"""What the lab tour asks of the robot when calls fail: written from lab_tour.xml and the policy's text, beside the engine.

A second, plain telling of the mission, so that the engine's run can be held against something that is not the engine.
"""
import os

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
ANIMATION, GESTURE, KNOWLEDGE, ATTENTION, DRIVE, TABLET, SAY = SERVICES = (
    "/animateBehaviour/set_activation", "/gestureExecution/perform_gesture", "/knowledgeBase/query",
    "/overtAttention/set_mode", "/robotNavigation/set_goal", "/tabletEvent/prompt_and_get_response",
    "/textToSpeech/say_text")
EXHIBITS = 2

FAULTS = {  # a kind of fault: the policy's word for its cause, and what an operator reads
    "refused": ("refused", "refused"),
    "exception": ("exception", "exception in the server"),
    "hang": ("no-answer", "no answer in time"),
    "killed": ("connection-lost", "connection lost"),
    "refused connection": ("not-reachable", "not reachable"),
    "zombie": ("not-reachable", "not reachable"),
    "wrong md5": ("type-mismatch", "type mismatch"),
    "malformed": ("unusable-answer", "unusable answer"),
}
BEFORE_SENDING = ("refused connection", "zombie", "wrong md5")
"""Faults that keep the request from arriving at all; only the log tells of the first two."""


class GivenUp(Exception):
    """A step that the tour cannot do without was not done."""


def read_policy():
    """Return the rules of the delivered policy as lists of words."""
    with open(os.path.join(ROOT, "config", "recoveryPolicy.ini")) as file:
        lines = [line.split("#")[0].split() for line in file]
    return [words for words in lines if len(words) == 5]


class Attempt:
    """One call: of which node, to which service, and what is made to go wrong with it ("" is nothing)."""

    def __init__(self, node, service, fault, is_told, abreast):
        self.node, self.service, self.fault = node, service, fault
        self.is_told = is_told  # whether a failure of it appears in the log
        self.abreast = abreast  # what it has in common with the calls that are made beside it; None: nothing


class Tour:
    """One pass of the lab tour. ``fault(service)`` is asked at each call, in order, for the kind of fault or "".

    Where a call is the last of its step, the next one to the same service may follow at once; ``is_careful`` has such a
    call meet no fault that only the log can tell of, so that there is time to put the robot in order again.
    """

    def __init__(self, fault, by_voice=True, is_careful=False):
        self.attempts = []
        self.outcome = "SUCCESS"
        self._fault = fault
        self._by_voice = by_voice
        self._is_careful = is_careful
        self._rules = read_policy()
        self._abreast = None
        self._whole()

    def _ask(self, node, service, is_told=True, tries=99):
        """Make one call and return the policy's word for what went wrong, or ""."""
        fault = self._fault(service)
        if self._is_careful and fault in BEFORE_SENDING[:2] and tries >= int(self._rule(node, "not-reachable")[2]):
            fault = "wrong md5"
        if fault in BEFORE_SENDING and not is_told:
            fault = "refused"  # nothing would show when such a fault has been met
        self.attempts.append(Attempt(node, service, fault, is_told, self._abreast))
        return FAULTS[fault][0] if fault else ""

    def _rule(self, node, cause):
        return next(rule for rule in self._rules if rule[0] in ("*", node) and rule[1] in ("*", cause))

    def step(self, node, service):
        """A leaf and the HandleFallBack beside it."""
        tries = 0
        cause = self._ask(node, service, tries=tries)
        while cause and tries < int(self._rule(node, cause)[2]):
            tries += 1
            cause = self._ask(node, service, tries=tries)
        then = self._rule(node, cause)[4] if cause else ""
        if then == "LocationOvertAttentionMode":
            self._ask(then, ATTENTION)
        if then == "giveUp":
            self._ask("safe state", ATTENTION, False)
            self._ask("safe state", ANIMATION, False)
            raise GivenUp(node)

    def _whole(self):
        self._side_by_side(("EnableAnimateBehavior", ANIMATION), ("ScanningOvertAttentionMode", ATTENTION))
        self.step("DisableAnimateBehavior", ANIMATION)
        self.step("WelcomeGesture", GESTURE)
        self.step("EnableAnimateBehavior", ANIMATION)
        self.step("WelcomeSpeech", SAY)
        self._gaze()
        self.step("QueryTourSpeech", SAY)
        if not (self._by_voice or self._dialogue()):
            self.step("MaybeAnotherTimeSpeech", SAY)
            return
        try:
            self._tour()
        except GivenUp:
            self.outcome = "FAILURE"
            try:
                self._home()
            except GivenUp:
                pass

    def _side_by_side(self, *steps):
        """Steps of a Parallel: in which order their attempts are made is left to time."""
        self._abreast = (id(self), steps)
        for step in steps:
            self.step(*step)
        self._abreast = None

    def _dialogue(self):
        """The tablet is tried three times; the dialogue has no recovery of its own."""
        for _ in range(3):
            self.step("PressYesNoSpeech", SAY)
            if not self._ask("PressYesNoDialogue", TABLET):
                return True
        return False

    def _gaze(self):
        self.step("SeekOvertAttentionMode", ATTENTION)
        self.step("SocialOvertAttentionMode", ATTENTION)

    def _drive(self):
        self.step("DisabledOvertAttentionMode", ATTENTION)
        self.step("DisableAnimateBehavior", ANIMATION)
        self.step("Navigate", DRIVE)

    def _tour(self):
        self.step("RetrieveListOfExhibits", KNOWLEDGE)
        for _ in range(EXHIBITS):
            self.step("FollowMeSpeech", SAY)
            self._drive()
            self._gaze()
            self.step("DescribeExhibitSpeech", SAY)
            self.step("PerformDeicticGesture", GESTURE)
            self.step("SocialOvertAttentionMode", ATTENTION)
            self.step("DescribeExhibitSpeech", SAY)
        self.step("EndTourSpeech", SAY)
        self.step("LookUpEntrance", KNOWLEDGE)
        self._drive()
        self._gaze()
        self.step("HereIsTheDoorSpeech", SAY)
        self.step("PerformDeicticGesture", GESTURE)
        self._side_by_side(("GoodbyeGesture", GESTURE), ("SayGoodByeSpeech", SAY))
        self._home()

    def _home(self):
        self.step("LookUpHome", KNOWLEDGE)
        self._drive()


def tour_with(faults, by_voice=True, is_careful=False):
    """Return the tour in which the ``n``-th call of a service (from 0) meets ``faults[service, n]``, if it is made."""
    counts = dict.fromkeys(SERVICES, 0)

    def fault(service):
        counts[service] += 1
        return faults.get((service, counts[service] - 1), "")

    return Tour(fault, by_voice, is_careful)
