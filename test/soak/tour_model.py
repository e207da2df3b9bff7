"""What the lab tour asks of the robot when calls fail: written from lab_tour.xml and the policy's text, beside the engine.

A second, independent model of the mission, with which the engine's run is compared.
"""
import os

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.realpath(__file__))))  # the workspace links here
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
"""Faults that keep the request from arriving at all; only the log shows the first two."""


class GivenUp(Exception):
    """A step that the tour cannot do without was not done: which, and what went wrong with it at first."""

    def __init__(self, node, cause):
        super().__init__(node)
        self.node, self.cause = node, cause


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


class Telling:
    """The lab tour, step by step. What a step does is for a subclass to say; all of them are generators.

    ``visitor_comes``, ``gaze`` and ``answer`` wait for the visitor, ``is_seen`` looks; ``may_go_on`` is what the recovery
    beside a whole visit says to what ended it, and ``side_by_side`` does steps of a Parallel.
    """

    by_voice = True
    exhibits = EXHIBITS

    def whole(self):
        yield from self.side_by_side(("EnableAnimateBehavior", ANIMATION), ("ScanningOvertAttentionMode", ATTENTION))
        yield from self.visitor_comes()
        yield from self.step("DisableAnimateBehavior", ANIMATION)
        yield from self.step("WelcomeGesture", GESTURE)
        yield from self.step("EnableAnimateBehavior", ANIMATION)
        yield from self.step("WelcomeSpeech", SAY)
        yield from self.mutual_gaze()
        yield from self.step("QueryTourSpeech", SAY)
        if not (yield from (self.by_ear() if self.by_voice else self.by_tablet())):
            yield from self.step("MaybeAnotherTimeSpeech", SAY)
            return
        try:
            yield from self.tour()
        except GivenUp as reason:
            try:
                yield from self.home()
            except GivenUp:
                pass
            raise reason

    def by_ear(self):
        """Silence means no; so does whatever goes wrong on the way."""
        for _ in range(3):
            heard = yield from self.answer()
            if heard is not None:
                return heard
            try:
                yield from self.step("SayYesNoSpeech", SAY)
            except GivenUp:
                pass
        return False

    def by_tablet(self):
        """The tablet is tried three times; the dialogue has no recovery."""
        for _ in range(3):
            try:
                yield from self.step("PressYesNoSpeech", SAY)
            except GivenUp:
                continue
            pressed = yield from self.press()
            if pressed is not None:
                return pressed
        return False

    def mutual_gaze(self):
        yield from self.step("SeekOvertAttentionMode", ATTENTION)
        yield from self.gaze()
        yield from self.step("SocialOvertAttentionMode", ATTENTION)

    def drive(self, place):
        yield from self.step("DisabledOvertAttentionMode", ATTENTION)
        yield from self.step("DisableAnimateBehavior", ANIMATION)
        yield from self.step("Navigate", DRIVE, place)

    def tour(self):
        yield from self.step("RetrieveListOfExhibits", KNOWLEDGE)
        for number in range(self.exhibits):
            try:
                yield from self.visit(number)
            except GivenUp as reason:
                yield from self.may_go_on(reason)
        yield from self.step("EndTourSpeech", SAY)
        yield from self.step("LookUpEntrance", KNOWLEDGE)
        yield from self.drive("entrance")
        try:
            yield from self.mutual_gaze()
        except GivenUp as reason:
            if not self.is_seen():
                raise reason
        yield from self.step("HereIsTheDoorSpeech", SAY)
        yield from self.step("PerformDeicticGesture", GESTURE)
        yield from self.side_by_side(("GoodbyeGesture", GESTURE), ("SayGoodByeSpeech", SAY))
        yield from self.home()

    def visit(self, number):
        yield from self.step("FollowMeSpeech", SAY)
        yield from self.drive(number)
        try:
            yield from self.mutual_gaze()
        except GivenUp as reason:
            raise reason if self.is_seen() else GivenUp("IsVisitorDiscovered", "condition-false")
        yield from self.step("DescribeExhibitSpeech", SAY)
        yield from self.step("PerformDeicticGesture", GESTURE)
        yield from self.step("SocialOvertAttentionMode", ATTENTION)
        yield from self.step("DescribeExhibitSpeech", SAY)

    def home(self):
        yield from self.step("LookUpHome", KNOWLEDGE)
        yield from self.drive("home")


class Tour(Telling):
    """One pass of the lab tour with a visitor who engages.

    ``fault(service)`` is asked at each call, in order, for the kind of fault or "".

    Where a call is the last of its step, the next one to the same service may follow at once; ``is_careful`` has such a
    call meet no fault that only the log can tell of, so that there is time to put the robot in order again.
    """

    def __init__(self, fault, by_voice=True, is_careful=False):
        self.attempts = []
        self.outcome = "SUCCESS"
        self._fault = fault
        self.by_voice = by_voice
        self._is_careful = is_careful
        self._rules = read_policy()
        self._abreast = None
        try:
            for _ in self.whole():
                pass
        except GivenUp:
            self.outcome = "FAILURE"

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

    def step(self, node, service, place=None):
        """A leaf and the HandleFallBack beside it."""
        tries = 0
        first = cause = self._ask(node, service, tries=tries)
        while cause and tries < int(self._rule(node, cause)[2]):
            tries += 1
            cause = self._ask(node, service, tries=tries)
        then = self._rule(node, cause)[4] if cause else ""
        if then == "LocationOvertAttentionMode":
            self._ask(then, ATTENTION)
        if then == "giveUp":
            self._ask("safe state", ATTENTION, False)
            self._ask("safe state", ANIMATION, False)
            raise GivenUp(node, first)
        yield

    def side_by_side(self, *steps):
        """In which order the attempts of such steps are made is left to time."""
        self._abreast = (id(self), steps)
        for step in steps:
            yield from self.step(*step)
        self._abreast = None

    def nothing(self):
        yield

    visitor_comes = gaze = nothing

    def answer(self):
        yield
        return True

    def press(self):
        yield
        return None if self._ask("PressYesNoDialogue", TABLET) else True

    def may_go_on(self, reason):
        yield
        raise reason


def tour_with(faults, by_voice=True, is_careful=False):
    """Return the tour in which the ``n``-th call of a service (from 0) meets ``faults[service, n]``, if it is made."""
    counts = dict.fromkeys(SERVICES, 0)

    def fault(service):
        counts[service] += 1
        return faults.get((service, counts[service] - 1), "")

    return Tour(fault, by_voice, is_careful)
