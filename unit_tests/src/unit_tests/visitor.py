"""The visitor in front of the robot: what sensors see and hear of one person, given what the robot has done so far.

Each simulated sensor has its own Visitor and passes it every line of the journal, so all of them simulate the same
person. Only the times of messages are random.
"""
import math
from typing import Callable, Dict, NamedTuple, Optional, Sequence, Tuple

from unit_tests.journal import Line

ENGAGES, SILENT, DECLINES, LEAVES = "engages", "silent", "declines", "leaves"
UNCLEAR, NO_GAZE = "unclear", "noGaze"
RANDOM = "random"  # one of the others, at random
BEHAVIOURS = (ENGAGES, SILENT, UNCLEAR, DECLINES, LEAVES, NO_GAZE)

ALIASES = {"complete": ENGAGES, "partial01": NO_GAZE, "partial02": SILENT, "partial03": DECLINES, "partial04": LEAVES}
"""The names of the project's former test -> what they mean here."""

EXHIBITS_BEFORE_LEAVING = 2
"""A visitor who leaves follows the robot to this many exhibits only."""

LONG_WAIT = 300.0
"""Seconds without a request after which the next visitor always comes: longer than any step takes."""

SMALL_TALK = "What a bright room"
"""What a visitor says when there is nothing to answer; it is an answer in no language."""

NOTHING_HEARD = "Error: no speech recognised"
"""The text of speech recognition when it recognises no words."""

TAKES_TIME = ("overtAttention", "animateBehavior", "speechEvent", "tabletEvent")
"""Nodes of the robot whose calls a visitor does not notice: a question stays open after them."""

UNCLEAR_ANSWER = "That is a good question"
"""What an unclear visitor answers; it is a yes or a no in no language."""

STILL_SEEKING, MUTUAL_GAZE, GAZE_FAILED = "still seeking", "mutual gaze", "failed"
GAZE_VALUES: Dict[int, Dict[str, int]] = {
    1: {STILL_SEEKING: 0, MUTUAL_GAZE: 1, GAZE_FAILED: 0},
    2: {STILL_SEEKING: 1, MUTUAL_GAZE: 2, GAZE_FAILED: 3},
}
"""The ``value`` of /overtAttention/mode while seeking, for each ``mutualGazeValue`` of the controller."""

LOOKS = 10
"""How often a robot seeks the gaze of a visitor who does not look back, before it gives up."""

LOOKED_FOR, FOUND = 1, 2
"""Its ``value`` in other modes, on a robot whose attention reports visitors."""


class Manners(NamedTuple):
    """The behaviour of a visitor, and the words of the language in which the robot speaks."""

    behaviour: str
    questions: Sequence[str]  # sentences of the robot that ask for a yes or no
    yes: str
    no: str
    home: Optional[Tuple[float, float]]  # x and y of the place where the robot waits between two visitors; None: on its tour


class Visitor:
    """One visitor after the other: the first comes when the robot wakes up, the next when it scans or stirs again.

    A robot whose nodes have crashed may do neither; then the next comes after a long wait.
    """

    def __init__(self, manners: Manners):
        self.manners = manners
        self.attention = "disabled"  # the last mode of the robot's gaze
        self.is_listened_to = True  # until the robot switches its speech recognition off
        self._is_first_request = True
        self._last_request = math.inf
        self._come()
        self.is_here = False

    def _come(self) -> None:
        self.is_here = True
        self._is_asked = False
        self._questions = 0
        self._drives = 0
        self._looks = 0

    # ------------------------------------------------------------------------------------------- what the robot does

    def notice(self, line: Line) -> None:
        """Process a request of the robot; lines about topics only advance the time."""
        if line.call == 0:
            if not self.is_here and line.time > self._last_request + LONG_WAIT:
                self._come()
            return
        self._last_request = line.time
        if self._is_first_request:
            self._is_first_request = False
            self._come()
        was_asked, self._is_asked = self._is_asked, self._is_asked and line.node in TAKES_TIME
        reaction = self._REACTIONS.get(line.node)
        if reaction is not None:
            reaction(self, line, was_asked)

    def _notice_attention(self, line: Line, _was_asked: bool) -> None:
        if line.content["state"] == "scanning":
            self._come()
        if line.done:
            self.attention = line.content["state"]
            self._looks = 0

    def _notice_movement(self, line: Line, _was_asked: bool) -> None:
        if line.content["state"] == "enabled" and not self.is_here:  # the call for scanning may have been lost
            self._come()

    def _notice_speech(self, line: Line, was_asked: bool) -> None:
        if not line.done:
            self._is_asked = was_asked
        elif line.content["message"] in self.manners.questions:
            self._is_asked = True
            self._questions += 1

    def _notice_drive(self, line: Line, _was_asked: bool) -> None:
        goal = (line.content["goal_x"], line.content["goal_y"])
        self._drives += line.done
        if goal == self.manners.home:
            self.is_here = False
        elif self.manners.behaviour == LEAVES and self._drives > EXHIBITS_BEFORE_LEAVING:
            self.is_here = False

    def _notice_recognition(self, line: Line, _was_asked: bool) -> None:
        if line.done and "status" in line.content:
            self.is_listened_to = line.content["status"] == "true"

    _REACTIONS: Dict[str, Callable[["Visitor", Line, bool], None]] = {
        "overtAttention": _notice_attention, "animateBehavior": _notice_movement, "textToSpeech": _notice_speech,
        "robotNavigation": _notice_drive, "speechEvent": _notice_recognition}

    # ------------------------------------------------------------------------------------------- what the visitor does

    @property
    def looks_back(self) -> bool:
        """Whether the visitor returns the gaze of a robot that seeks it."""
        return self.is_here and self.manners.behaviour != NO_GAZE

    def gaze(self) -> str:
        """Return the result of the robot's next look for mutual gaze: the visitor returns the second look, or none."""
        self._looks += 1
        if not self.is_here or self._looks > LOOKS and not self.looks_back:
            return GAZE_FAILED
        return MUTUAL_GAZE if self._looks > 1 and self.looks_back else STILL_SEEKING

    def utterance(self) -> str:
        """Return the recognised words of the visitor; empty if there are none.

        An answer is repeated until the robot goes on.
        """
        unclear = UNCLEAR_ANSWER if self._questions % 2 else NOTHING_HEARD
        answers = {ENGAGES: self.manners.yes, LEAVES: self.manners.yes, NO_GAZE: self.manners.yes,
                   DECLINES: self.manners.no, UNCLEAR: unclear}
        if not self.is_here or self.manners.behaviour not in answers:
            return ""
        return answers[self.manners.behaviour] if self._is_asked else SMALL_TALK

    def press(self, options: Sequence[str]) -> str:
        """Return which of the tablet's options is pressed, yes being the first and no the last; nothing if silent.

        There is nothing unclear to press, so an unclear visitor presses no.
        """
        yes, no = options[0], options[-1]
        pressed = {ENGAGES: yes, LEAVES: yes, NO_GAZE: yes, DECLINES: no, UNCLEAR: no}
        return pressed.get(self.manners.behaviour, "") if self.is_here else ""
