"""What the lab tour asks of the robot when calls fail: written from lab_tour.xml and the policy's
text, beside the engine.

The faulty robot plays it call by call, so it has to be known before the run; a finished run is
judged without it.
"""
import os

# the workspace links here
ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.realpath(__file__))))
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
    "malformed": ("unusable-answer", "unusable answer")}
BEFORE_SENDING = ("refused connection", "zombie", "wrong md5")
"""Faults that keep the request from arriving at all; only the log shows the first two."""


class GivenUp(Exception):
    """A step that the tour cannot do without was not done."""


def read_policy():
    """Return the rules of the delivered policy as lists of words."""
    with open(os.path.join(ROOT, "config", "recoveryPolicy.ini")) as file:
        lines = [line.split("#")[0].split() for line in file]
    return [words for words in lines if len(words) == 5]


class Attempt:
    """One call: of which node, to which service, and what is made to go wrong with it ("" is
    nothing)."""

    def __init__(self, node, service, fault, is_told, abreast):
        self.node, self.service, self.fault = node, service, fault
        self.is_told = is_told  # whether a failure of it appears in the log
        # what it has in common with the calls that are made beside it; None: nothing
        self.abreast = abreast


class Tour:
    """One pass of the lab tour with a visitor who engages.

    ``fault(service)`` is asked at each call, in order, for the kind of fault or "".

    Where a call is the last of its step, the next one to the same service may follow at once;
    ``is_careful`` has such a call meet no fault that only the log can tell of, so that there is
    time to put the robot in order again.
    """

    def __init__(self, fault, by_voice=True, is_careful=False):
        self.attempts = []
        self.outcome = "SUCCESS"
        self._fault = fault
        self._by_voice = by_voice
        self._is_careful = is_careful
        self._rules = read_policy()
        self._abreast = None
        try:
            self._whole()
        except GivenUp:
            self.outcome = "FAILURE"

    # ------------------------------------------------------------------------------- lab_tour.xml

    def _whole(self):
        self._side_by_side(("EnableAnimateBehavior", ANIMATION),
                           ("ScanningOvertAttentionMode", ATTENTION))
        self._step("DisableAnimateBehavior", ANIMATION)
        self._step("WelcomeGesture", GESTURE)
        self._step("EnableAnimateBehavior", ANIMATION)
        self._step("WelcomeSpeech", SAY)
        self._mutual_gaze()
        self._step("QueryTourSpeech", SAY)
        if not (self._by_voice or self._by_tablet()):
            self._step("MaybeAnotherTimeSpeech", SAY)
            return
        try:
            self._tour()
        except GivenUp as reason:
            try:
                self._home()
            except GivenUp:
                pass
            raise reason

    def _by_tablet(self):
        """The tablet is tried three times; the dialogue has no recovery."""
        for _ in range(3):
            try:
                self._step("PressYesNoSpeech", SAY)
            except GivenUp:
                continue
            if not self._ask("PressYesNoDialogue", TABLET):
                return True
        return False

    def _mutual_gaze(self):
        self._step("SeekOvertAttentionMode", ATTENTION)
        self._step("SocialOvertAttentionMode", ATTENTION)

    def _drive(self):
        self._step("DisabledOvertAttentionMode", ATTENTION)
        self._step("DisableAnimateBehavior", ANIMATION)
        self._step("Navigate", DRIVE)

    def _tour(self):
        self._step("RetrieveListOfExhibits", KNOWLEDGE)
        for _ in range(EXHIBITS):
            self._visit()
        self._step("EndTourSpeech", SAY)
        self._step("LookUpEntrance", KNOWLEDGE)
        self._drive()
        self._mutual_gaze()
        self._step("HereIsTheDoorSpeech", SAY)
        self._step("PerformDeicticGesture", GESTURE)
        self._side_by_side(("GoodbyeGesture", GESTURE), ("SayGoodByeSpeech", SAY))
        self._home()

    def _visit(self):
        """The recovery beside a visit cannot help: nothing that is given up in it may be skipped.
        """
        self._step("FollowMeSpeech", SAY)
        self._drive()
        self._mutual_gaze()
        self._step("DescribeExhibitSpeech", SAY)
        self._step("PerformDeicticGesture", GESTURE)
        self._step("SocialOvertAttentionMode", ATTENTION)
        self._step("DescribeExhibitSpeech", SAY)

    def _home(self):
        self._step("LookUpHome", KNOWLEDGE)
        self._drive()

    # --------------------------------------------------------------------------------- the policy

    def _ask(self, node, service, is_told=True, tries=99):
        """Make one call and return the policy's word for what went wrong, or ""."""
        fault = self._fault(service)
        if self._is_careful and fault in BEFORE_SENDING[:2] and tries >= int(
                self._rule(node, "not-reachable")[2]):
            fault = "wrong md5"
        if fault in BEFORE_SENDING and not is_told:
            fault = "refused"  # nothing would show when such a fault has been met
        self.attempts.append(Attempt(node, service, fault, is_told, self._abreast))
        return FAULTS[fault][0] if fault else ""

    def _rule(self, node, cause):
        return next(rule for rule in self._rules
                    if rule[0] in ("*", node) and rule[1] in ("*", cause))

    def _step(self, node, service):
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
            raise GivenUp

    def _side_by_side(self, *steps):
        """In which order the attempts of such steps are made is left to time."""
        self._abreast = (id(self), steps)
        for step in steps:
            self._step(*step)
        self._abreast = None


def tour_with(faults, by_voice=True, is_careful=False):
    """Return the tour in which the ``n``-th call of a service (from 0) meets ``faults[service,
    n]``, if it is made."""
    counts = dict.fromkeys(SERVICES, 0)

    def fault(service):
        counts[service] += 1
        return faults.get((service, counts[service] - 1), "")

    return Tour(fault, by_voice, is_careful)
