"""The visitor in front of the robot: what sensors see and hear of one person, given what the robot
has done so far.

Each simulated sensor has its own Visitor and passes it every entry of the journal, so all of them
simulate the same person. Only the times of messages are random.
"""
import math
from typing import Any, Callable, Dict, Mapping, NamedTuple, Optional, Pattern, Sequence, Tuple

from behavior_controller.robot.declarations import Sense
from behavior_controller.robot.requests import Exhibit

from behavior_controller.simulation.journal import JournalEntry

ENGAGES, SILENT, DECLINES, LEAVES = "engages", "silent", "declines", "leaves"
UNCLEAR, NO_GAZE = "unclear", "noGaze"
RANDOM = "random"  # one of the others, at random
BEHAVIOURS = (ENGAGES, SILENT, UNCLEAR, DECLINES, LEAVES, NO_GAZE)

ALIASES = {
    "complete": ENGAGES, "partial01": NO_GAZE, "partial02": SILENT, "partial03": DECLINES,
    "partial04": LEAVES}
"""The names of the project's former test -> what they mean here."""

WANTED = 2
"""The number, from 0, of the place that a visitor looks for, of those that the robot names. One who
leaves is gone when the robot has driven there, or to so many places before."""

LONG_WAIT = 300.0
"""Seconds without a request after which the next visitor always comes: longer than any step takes.
"""

FIRST_WAIT = 20.0
"""Seconds after which the first visitor comes to a robot that has made no request."""

REACTION = 0.3
"""Seconds from the end of a question to its answer, where speaking takes time: in those the robot
learns that it has asked."""

SMALL_TALK = "What a bright room"
"""What a visitor says when there is nothing to answer; it is an answer in no language."""

NOTHING_HEARD = "Error: no speech recognised"
"""The text of speech recognition when it recognises no words."""

UNNOTICED = ("overtAttention", "animateBehavior", "speechEvent", "tabletEvent")
"""Nodes of the robot whose calls a visitor does not notice: a question stays open after them."""

UNCLEAR_ANSWER = "That is a good question"
"""What an unclear visitor answers; it is a yes or a no in no language."""

STILL_SEEKING, MUTUAL_GAZE, GAZE_FAILED = "still seeking", "mutual gaze", "failed"
GAZE_VALUES: Dict[int, Dict[str, int]] = {
    1: {STILL_SEEKING: 0, MUTUAL_GAZE: 1, GAZE_FAILED: 0},
    2: {STILL_SEEKING: 1, MUTUAL_GAZE: 2, GAZE_FAILED: 3}}
"""The ``value`` of /overtAttention/mode while seeking, for each ``mutualGazeValue`` of the
controller."""

GAZE_ATTEMPTS = 10
"""How often a robot seeks the gaze of a visitor who does not look back, before it gives up."""

SEARCHING, DETECTED = 1, 2
"""Its ``value`` in other modes, on a robot whose attention reports visitors."""

NO_STATUS = -1
"""Its ``value`` in the mode social on a robot that does not report them there."""


HABITS = {
    Sense.VISITOR: "is seen until the robot drives home, or on the tour leaves for good",
    Sense.PRESENCE: "is seen until the robot drives home, or on the tour leaves for good",
    Sense.GAZE: "returns the second attempt at a gaze, or none",
    Sense.UTTERANCE: "gives each question the same answer, or never one"}
"""What a simulated visitor always does, by what the robot senses of it."""


def spoken(content: Mapping[str, Any]) -> str:
    """Return the text of a request to speak: a service and an action name its field otherwise."""
    return str(content.get("message", content.get("text")))


class Manners(NamedTuple):
    """The behaviour of a visitor, and the words of the language in which the robot speaks."""

    behaviour: str
    questions: Sequence[str]  # of the robot that ask for a yes or no; others end with ?
    yes: str
    no: str
    # x and y of the place where the robot waits between two visitors; None: one of the places
    home: Optional[Tuple[float, float]]
    places: Sequence[Exhibit] = ()  # that the robot may name
    # further questions, each with the answer of a visitor who agrees; empty: yes
    answers: Sequence[Tuple[Pattern[str], str]] = ()
    # x and y of the place where the robot scans for the next visitor; None: every place
    start: Optional[Tuple[float, float]] = None


class Visitor:
    """One visitor after the other: the first comes when the robot wakes up, the next when it stirs
    again, or scans at its start.

    A robot whose nodes have crashed may do neither; then the next comes after a long wait.
    """

    def __init__(self, manners: Manners):
        self.manners = manners
        self.attention = "disabled"  # the last mode of the robot's gaze
        self.is_listened_to = True  # until the robot switches its speech recognition off
        self.now = -math.inf  # the time of what is seen and heard next
        self._listens_until = -math.inf
        self._is_on_tour = False  # the robot was last sent to another place than its start
        self.succeed(manners.behaviour)

    def succeed(self, behaviour: str) -> None:
        """Be the next visitor, of that behaviour, who comes as the first one does."""
        self.manners = self.manners._replace(behaviour=behaviour)
        self._last_request = math.inf  # there was none
        self._expected = math.inf  # when this visitor comes to a robot that makes none
        self._come()
        self.is_here = False

    def _come(self) -> None:
        self.is_here, self._is_asked = True, False
        self._answer = ""  # to the last question, if that is not yes or no
        self._questions = self._drives = self._gaze_attempts = 0
        self._named: Optional[Exhibit] = None  # the place that the robot has named last

    # -------------------------------------------------------------------------- what the robot does

    def notice(self, entry: JournalEntry) -> None:
        """Process a request of the robot; entries about topics only advance the time."""
        self.now = entry.time
        if entry.call == 0:
            self._expected = min(self._expected, entry.time + FIRST_WAIT)
            due = self._last_request + LONG_WAIT
            if not self.is_here and entry.time > (due if due < math.inf else self._expected):
                self._come()
            return
        self.notice_start()
        self._last_request = entry.time
        is_speech_lost = entry.node == "textToSpeech" and not entry.done
        self._is_asked = self._is_asked and (entry.node in UNNOTICED or is_speech_lost)
        reaction = self._REACTIONS.get(entry.node)
        if reaction is not None:
            reaction(self, entry)

    def notice_start(self) -> None:
        """Come, if this is the robot's first request."""
        if self._last_request == math.inf:
            self._come()

    def _notice_attention(self, entry: JournalEntry) -> None:
        if entry.content["state"] == "scanning" and not self._is_on_tour:
            self._come()
        if entry.done:
            self.attention, self._gaze_attempts = entry.content["state"], 0

    def _notice_movement(self, entry: JournalEntry) -> None:
        # the call for scanning may have been lost
        if entry.content["state"] == "enabled" and not self.is_here:
            self._come()

    def _notice_speech(self, entry: JournalEntry) -> None:
        if not entry.done:
            return
        words = spoken(entry.content)
        self._named = next((place for place in self.manners.places if place.description1 == words),
                           self._named)
        answers = [answer for question, answer in self.manners.answers if question.fullmatch(words)]
        if words.endswith("?") or words in self.manners.questions or answers:
            self._is_asked, self._answer = True, "".join(answers[:1])
            self._questions += 1
            self._listens_until = entry.time + entry.seconds + REACTION * (entry.seconds > 0)

    def _notice_drive(self, entry: JournalEntry) -> None:
        if entry.done:
            self._drives += 1
        has_seen = self._drives > WANTED or self._is_wanted
        place = entry.content["goal_x"], entry.content["goal_y"]
        is_home = self.manners.home == place
        self._is_on_tour = self.manners.start not in (None, place)
        if is_home or self.manners.behaviour == LEAVES and has_seen:
            self.is_here = False

    def _notice_recognition(self, entry: JournalEntry) -> None:
        if entry.done and "status" in entry.content:
            self.is_listened_to = entry.content["status"] == "true"

    _REACTIONS: Dict[str, Callable[["Visitor", JournalEntry], None]] = {
        "overtAttention": _notice_attention, "animateBehavior": _notice_movement,
        "textToSpeech": _notice_speech, "robotNavigation": _notice_drive,
        "speechEvent": _notice_recognition}

    # ------------------------------------------------------------------------ what the visitor does

    @property
    def _is_wanted(self) -> bool:
        """Whether the visitor looks for the place that was named last."""
        return self._named in self.manners.places[:WANTED + 1][-1:]

    @property
    def _agrees(self) -> bool:
        """Whether the visitor says yes when asked now."""
        is_wrong = self._named is not None and not self._is_wanted
        return self.manners.behaviour not in (DECLINES, UNCLEAR) and not is_wrong

    @property
    def looks_back(self) -> bool:
        """Whether the visitor returns the gaze of a robot that seeks it."""
        return self.is_here and self.manners.behaviour != NO_GAZE

    def gaze(self) -> str:
        """Return the result of the robot's next attempt at mutual gaze: the visitor returns the
        second attempt, or none."""
        self._gaze_attempts += 1
        if not self.is_here or self._gaze_attempts > GAZE_ATTEMPTS and not self.looks_back:
            return GAZE_FAILED
        if self._gaze_attempts > 1 and self.looks_back:
            return MUTUAL_GAZE
        return STILL_SEEKING

    def utterance(self) -> str:
        """Return the recognised words of the visitor; empty if there are none.

        An answer is repeated until the robot goes on. Nobody answers before the robot has asked.
        """
        behaviour = self.manners.behaviour
        if not self.is_here or behaviour == SILENT or self.now < self._listens_until:
            return ""
        if not self._is_asked:
            return SMALL_TALK
        if behaviour == UNCLEAR:
            return UNCLEAR_ANSWER if self._questions % 2 else NOTHING_HEARD
        if not self._agrees:
            return self.manners.no
        return self._answer or self.manners.yes

    def press(self, options: Sequence[str]) -> str:
        """Return which of the tablet's options is pressed, yes being the first and no the last, or
        what is typed; nothing if silent.

        There is nothing unclear to press, so an unclear visitor presses no. Who does not agree
        types nothing.
        """
        if not self.is_here or self.manners.behaviour == SILENT:
            return ""
        if self._agrees:
            return self._answer or options[0]
        if self._answer:
            return ""
        return options[-1]
