"""A second model of the lab tour with its times: what must follow each call in a test's journal, and when.

Written from lab_tour.xml and the policy's text, beside the engine, the recovery and the verdict. The journal says what
was made to go wrong and which messages came; the rest follows.
"""
import bisect
import json
import os

from tour_model import (ANIMATION, ATTENTION, DRIVE, KNOWLEDGE, ROOT, SAY, TABLET, GivenUp, Telling, read_policy)

with open(os.path.join(ROOT, "unit_tests", "data", "exhibits.json")) as places:
    PLACES = json.load(places)

WORDS = {"refused": "refused", "exception": "exception", "unanswered": "no-answer", "crash": "connection-lost",
         "wrong": "unusable-answer"}
"""The policy's word for each kind of fault."""

DEADLINES = {ANIMATION: 5, "/gestureExecution/perform_gesture": 15, KNOWLEDGE: 5, ATTENTION: 5, DRIVE: 180, TABLET: 60,
             SAY: 60}
STATES = {"EnableAnimateBehavior": "enabled", "DisableAnimateBehavior": "disabled", "safe state": "disabled",
          "ScanningOvertAttentionMode": "scanning", "SeekOvertAttentionMode": "seeking",
          "SocialOvertAttentionMode": "social", "DisabledOvertAttentionMode": "disabled",
          "LocationOvertAttentionMode": "location"}
QUESTIONS = ("QueryTourSpeech", "SayYesNoSpeech")
INDISPENSABLE = ("Navigate", "RetrieveListOfExhibits", "LookUpEntrance", "LookUpHome")
TIE = 0.0005  # s: what happens so near to each other may be in either order
AWAY, NOTICED, RETURN_LIMIT = 2.0, 0.1, 15.0  # s: how long a node is away after a crash; when it is noticed; patience
GAZE_WAIT, ANSWER_WAIT, MAX_AGE = 15.0, 10.0, 2.0
NEARLY = 0.3  # s by which a call may come at another time than predicted


class NotAsTold(Exception):
    """The journal has something else than the tour; the text says what."""


class Journal:
    """The journal of a test, taken service by service."""

    def __init__(self, lines):
        self.calls = {}
        self.faces, self.gazes, self.answers = [], [], []
        for line in lines:
            if line.call:
                self.calls.setdefault(line.resource, []).append(line)
        self.topic = {name: [line for line in lines if line.node == name and not line.call]
                      for name in ("faceDetection", "overtAttention", "speechEvent")}
        self.times = {name: [line.time for line in found] for name, found in self.topic.items()}

    def take(self, service, node, at, place):
        """Return the next call of a service, which must be that node's, and now."""
        left = self.calls.get(service)
        if not left or abs(left[0].time - at) > NEARLY:
            raise NotAsTold("{} should have been called by {} at {:.2f}, and was {}".format(
                service, node, at, "at {:.2f}".format(left[0].time) if left else "not"))
        line = left.pop(0)
        if line.content.get("state", STATES.get(node)) != STATES.get(node):
            raise NotAsTold("{} asked {} for {}".format(node, service, line.content))
        if place is not None:
            goal = PLACES["exhibits"][place] if isinstance(place, int) else PLACES[place]
            if [line.content["goal_x"], line.content["goal_y"]] != goal["location"][:2]:
                raise NotAsTold("{} drove to {}".format(node, line.content))
        return line

    def has(self, service, at):
        """Return whether the next call of a service is at that time."""
        left = self.calls.get(service)
        return bool(left) and abs(left[0].time - at) < TIE

    def newest(self, topic, at):
        """Return the newest message of a topic and the ones after it."""
        index = bisect.bisect_right(self.times[topic], at)
        return (self.topic[topic][index - 1] if index else None), self.topic[topic][index:]

    def left(self):
        return [line for lines in self.calls.values() for line in lines]


class Memory:
    """What lasts from pass to pass: the time, the budget, and which nodes are away."""

    def __init__(self, lines):
        self.journal = Journal(lines)
        self.policy = read_policy()
        self.most, self.seconds = 30, 600.0
        self.recoveries = []
        self.crashed = {}  # service -> when its node crashed last
        self.now = None


class TimedTour(Telling):
    """One pass, from the time in ``memory`` on. Raises NotAsTold."""

    exhibits = len(PLACES["exhibits"])

    def __init__(self, memory, by_voice, pressed):
        """``pressed``: what the visitor presses, True is yes, None nothing."""
        self.by_voice, self.pressed, self.m = by_voice, pressed, memory
        self.attention_set = self.asked_at = memory.now
        self.exhibit, self.left_out = None, set()
        self.outcome = "SUCCESS"
        try:
            for _ in self.whole():
                pass
        except GivenUp:
            self.outcome = "FAILURE"

    # ------------------------------------------------------------------------------------------------------- calls

    def ask(self, node, service, place=None):
        """Make one call and return the policy's word for what went wrong, or ""."""
        m = self.m
        sent, arrives = m.now, m.now + 0.001
        if self.is_away(service, arrives):
            m.now = arrives
            return "not-reachable"
        line = m.journal.take(service, node, arrives, place)
        m.now = line.time + (0.005 if line.fault in (None, "refused", "wrong") else 0.0)
        if line.fault == "unanswered":
            m.now = sent + DEADLINES[service]
        elif line.fault == "crash":
            m.crashed[service] = line.time
        if line.fault is None and service == ATTENTION and node != "safe state":
            self.attention_set = m.now
        if node in QUESTIONS:
            self.asked_at = m.now
        return WORDS.get(line.fault, "")

    def is_away(self, service, at):
        """Return whether a node that has crashed is not back; at the very moment of its return the journal tells."""
        crashed = self.m.crashed.get(service, -1e9)
        if abs(at - crashed - AWAY) < TIE:
            return not self.m.journal.has(service, at)
        return crashed <= at < crashed + AWAY

    def visit(self, number):
        self.exhibit = number
        yield from super().visit(number)

    def step(self, node, service, place=None):
        yield
        cause = self.ask(node, service, place)
        yield
        if cause:
            yield from self.recover(node, service, cause, place)

    def recover(self, node, service, cause, place):
        first, tries, spent = cause, 0, self.is_spent()
        while not spent and tries < int(self.rule(node, cause)[2]):
            self.m.now += float(self.rule(node, cause)[3]) * 2 ** tries
            yield
            self.wait_for_return(node, service)
            yield
            tries += 1
            cause = self.ask(node, service, place)
            yield
            if not cause:
                return
        then = "giveUp" if spent else self.rule(node, cause)[4]
        if then == "LocationOvertAttentionMode":
            self.ask(then, ATTENTION)
            yield
        if node == "Navigate" and isinstance(place, int):
            self.left_out.add(place)
        if then == "giveUp":
            yield from self.safe_state()
            raise GivenUp(node, first)

    def wait_for_return(self, node, service):
        """A retry of what the tour cannot do without waits for a node that is known to be gone."""
        crashed = self.m.crashed.get(service, -1e9)
        if node in INDISPENSABLE and crashed + NOTICED <= self.m.now < crashed + AWAY + NOTICED:
            self.m.now = crashed + AWAY + NOTICED

    def rule(self, node, cause):
        return next(rule for rule in self.m.policy if rule[0] in ("*", node) and rule[1] in ("*", cause))

    def is_spent(self):
        m = self.m
        m.recoveries = [began for began in m.recoveries if began > m.now - m.seconds] + [m.now]
        return len(m.recoveries) > m.most

    def safe_state(self):
        """Both requests are made at once."""
        began, ended = self.m.now, []
        for service in (ATTENTION, ANIMATION):
            self.m.now = began
            self.ask("safe state", service)
            ended.append(self.m.now)
        self.m.now = max(ended)
        yield

    def side_by_side(self, *steps):
        """Each goes its own way in time; the first that is given up ends the others."""
        began = self.m.now
        under_way = [[began, number, self.step(*step)] for number, step in enumerate(steps)]
        ended = began
        while under_way:
            first = min(under_way, key=lambda entry: entry[:2])
            self.m.now = first[0]
            try:
                next(first[2])
                first[0] = self.m.now
            except StopIteration:
                ended = max(ended, self.m.now)
                under_way.remove(first)
        self.m.now = ended
        yield

    def may_go_on(self, reason):
        """The recovery beside a visit: nothing can be done again, but the exhibit may be left out."""
        spent = self.is_spent()
        self.left_out.add(self.exhibit)
        is_skipped = not spent and self.rule(reason.node, reason.cause)[4] == "skip"
        if is_skipped and len(self.left_out) < len(PLACES["exhibits"]):
            return
        if reason.node.startswith("Is"):
            yield from self.safe_state()  # else it was asked for when the step was given up
        raise reason

    # ------------------------------------------------------------------------------------------------- the visitor

    def visitor_comes(self):
        newest, later = self.m.journal.newest("faceDetection", self.m.now)
        if not self.is_seen():
            seen = next((line for line in later if line.content["face_label_id"]), None)
            if seen is None:
                raise NotAsTold("no visitor came, and the pass ended")
            self.m.now = seen.time
        yield

    def is_seen(self):
        newest, _ = self.m.journal.newest("faceDetection", self.m.now)
        return newest is not None and newest.time >= self.m.now - MAX_AGE and bool(newest.content["face_label_id"])

    def gaze(self):
        def is_gaze(line):
            return line.time > self.attention_set and line.content == {"state": "seeking", "value": 1}
        newest, later = self.m.journal.newest("overtAttention", self.m.now)
        if newest is None or not is_gaze(newest) or newest.time < self.m.now - MAX_AGE:
            found = next((line for line in later if is_gaze(line)), None)
            if found is None or found.time > self.m.now + GAZE_WAIT:
                self.m.now += GAZE_WAIT
                raise GivenUp("IsMutualGazeDiscovered", "condition-false")
            self.m.now = found.time
        yield

    def answer(self):
        """Return whether a yes or a no was heard, or None."""
        yield
        newest, later = self.m.journal.newest("speechEvent", self.m.now)
        for line in ([newest] if newest is not None else []) + later:
            if line.time > self.m.now + ANSWER_WAIT:
                break
            if line.time > self.asked_at and line.content["data"].lower() in ("yes", "no"):
                self.m.now = max(self.m.now, line.time)
                self.asked_at = line.time
                return line.content["data"].lower() == "yes"
        self.m.now += ANSWER_WAIT
        return None

    def press(self):
        yield
        cause = self.ask("PressYesNoDialogue", TABLET)
        return None if cause else self.pressed


def differences(lines, starts, outcomes, by_voice, pressed):
    """Return in one sentence how a run differs from the tour; "" if it does not. ``starts``: when its passes began."""
    memory = Memory(lines)
    try:
        for number, (start, outcome) in enumerate(zip(starts, outcomes), 1):
            memory.now = start
            tour = TimedTour(memory, by_voice, pressed)
            if tour.outcome != outcome:
                return "pass {} should have ended with {}".format(number, tour.outcome)
    except NotAsTold as reason:
        return str(reason)
    left = memory.journal.left()
    return "there was no reason for call {} of {}".format(left[0].call, left[0].resource) if left else ""
