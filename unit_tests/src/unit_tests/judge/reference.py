"""What each mission node has to do, by D5.4.3 (table 4) and release 1.0: what it asks, what it
stores, when it holds.

It is written from the documents, beside the controller's own leaves, and uses nothing of them.
``ROWS`` is the table. A row's rule takes the node, which reads and writes its entries; the classes
below are the few ways in which a node of the engine obeys its rule. Answers, messages and what is
known of the robot come from a ``Course``.
"""
import math
import re
from functools import partial
from typing import Any, Callable, Dict, Iterator, List, NamedTuple, Optional, Sequence, Tuple, Union

from behavior_controller.bt.engine.blackboard import Blackboard
from behavior_controller.bt.engine.clock import Timer
from behavior_controller.bt.engine.controls import ReactiveFallback, ReactiveSequence, WhileDoElse
from behavior_controller.bt.engine.leaf import ActionLeaf, ConditionLeaf
from behavior_controller.bt.engine.node import Node, Result
from behavior_controller.bt.engine.ports import NoValue, PortError, defaults
from behavior_controller.bt.registry import Direction, Kind, NodeSpec, Port, argument
from behavior_controller.bt.script.values import PortType, TEXT, whole_real
from behavior_controller.bt.status import FAILURE, RUNNING, SUCCESS
from behavior_controller.config.knowledge_files import Knowledge
from behavior_controller.config.phrases import Phrases
from behavior_controller.config.settings import Settings
from behavior_controller.execution.events import BEGUN, OMITTED, OVER
from behavior_controller.robot.declarations import Sense, Topic
from behavior_controller.robot.gateway import Cause, Failure, Sample
from behavior_controller.robot.requests import (Answer, Exhibit, GoTo, Location, PerformGesture,
                                                Point, Prompt, QueryKnowledge, Request, Say,
                                                SetAnimation, SetAttention, SetPose, SetRecognition,
                                                SetRecognitionLanguage)

NOWHERE = Point(0.0, 0.0, 0.0)
"""A gesture target that means that there is nothing to point at."""

ANSWER_WAIT = PRESENCE_WAIT = 10.0
"""Seconds that the nodes of release 1.0 wait for an answer and for a visitor's presence."""

RESULT_WAIT = 10.0
"""Seconds for which an utterance may last and be recognised that began in time."""

RETURN_WAIT = 15.0
"""Seconds that a retry waits for the return of a service that is gone, if the tour needs the step.
"""

DONE, SUBSTITUTED, SKIPPED, GIVEN_UP = "done", "substituted", "skipped", "given up"
"""How a recovery ends."""


# ----------------------------------------------------------------------------------------- entries


def _numbers(record: Any, text: str) -> Any:
    return record(*(whole_real(part.strip()) for part in text.split(";")))


TYPES: Dict[str, str] = {
    "visitorResponse": TEXT, "exhibits": PortType("Exhibits", list), "nextExhibit": "int",
    "currentExhibit": TEXT, "leftOutExhibits": "vec_int", "description1": TEXT,
    "description2": TEXT, "targetLocation": PortType("Location", Location,
                                                     partial(_numbers, Location)),
    "gestureTarget": PortType("Point", Point, partial(_numbers, Point)),
    "questionAskedAt": "double", "attentionSetAt": "double"
}
"""The entries of one visitor: their names and types."""

_DIRECTIONS = {"<": Direction.IN, ">": Direction.OUT, "=": Direction.INOUT}


def _ports(text: str) -> Tuple[Port, ...]:
    """Return the ports of a row: ``<`` reads, ``>`` writes, ``=`` does both; ``<port:entry`` if its
    name is another."""
    ports = []
    for word in text.split():
        name, _, entry = word[1:].partition(":")
        entry = entry or name
        default = "{{@{}}}".format(entry)
        ports.append(Port(name, TYPES[entry], _DIRECTIONS[word[0]], default, is_optional=True))
    return tuple(ports)


# ------------------------------------------------------------------------------ what a node goes by


class Reply:
    """A request under way; ``result`` None: there is no answer yet."""

    result: Union[Answer, Failure, None] = None
    call = 0  # its number


class Failed(NamedTuple):
    """One failure of a node, with its number in the order of time."""

    number: int
    node: "Duty"
    cause: Cause
    resource: str


class Decision(NamedTuple):
    """What the record has to say of a step: node type and path, why it failed, what is done, and
    the number of the HandleFallBack that decided it."""

    node: str
    path: str
    cause: str
    step: str
    handler: int = 0

    def __str__(self) -> str:
        node = "{} ({}):".format(self.node, self.cause) if self.cause else self.node
        return "{} {}".format(node, self.step).strip()


BEGINS, STOP = "begins", "is at stop {} of {}, {}: {}"
"""What is reported of a step that asks, and of one that begins, ends or leaves out a stop."""


RETRY, INSTEAD, ENDED = "retry {} of {}", "{} instead", "{} after {} retries, by a rule to {}"
FAILED_AGAIN = "failed too, after {} retries"
"""What a recovery does about a step."""

SAFE = Decision("", "", "", "what was reached of the safe state is reported")


class Course:
    """What the nodes of a mission go by: configuration, phrases, knowledge, policy; failures. The
    requests, answers and messages are those of the execution that it is the base of."""

    def __init__(self, settings: Settings, phrases: Phrases, known: Optional[Knowledge],
                 policy: "Policy"):
        self.settings, self.phrases, self.known, self.policy = settings, phrases, known, policy
        self.interface = settings.interface
        self.language = settings.language if known is None else known.language
        self.failures: Dict[int, Failed] = {}  # the newest of each node, by uid
        self.newest = 0
        # number of the failure for which the robot was left in the safe state last
        self.given_up = 0
        self.recoveries: List[float] = []
        self.is_spent = False  # the budget, so that a failure of this pass was given up
        self.unrecovered: List[Tuple[Cause, str]] = []  # causes and resources, in this pass
        self._first = 1  # number of the first failure of this pass

    def failed_for(self) -> Iterator[str]:
        """Yield the services and topics that the last pass may have failed for."""
        return (resource for _, resource in self._failures_of_pass())

    def _failures_of_pass(self) -> List[Tuple[Cause, str]]:
        newest = max(self.failures.values(), default=None)
        is_new = newest is not None and newest.number >= self._first
        return self.unrecovered + ([(newest.cause, newest.resource)] if newest and is_new else [])

    def pause(self, number: int, at: float) -> float:
        """Return the seconds that the next pass waits after a number of passes that failed for a
        cause that persists, the last one at that time."""
        policy, spent = self.policy, self.recoveries[-self.policy.most:]
        usual = min(policy.first_pause * 2**min(number, 12), policy.longest_pause)
        rest = spent[0] + policy.seconds - at if policy.most and spent else math.inf
        failures = self._failures_of_pass()
        if failures and self.is_spent and len(spent) >= policy.most and rest > 0.0:
            return min(usual, rest)
        return usual if any(cause is Cause.TYPE_MISMATCH for cause, _ in failures) else 0.0

    def speech_lasts(self, node: "Duty", request: Any) -> float:
        """Return the seconds for which a node waits while release 1.0's robot speaks: it answers
        at once in English."""
        is_early = self.interface.name == "release-1.0" and self.language == "English"
        chosen = self.settings.wait_for_speech
        is_description = node.registration_id.startswith("DescribeExhibitSpeech")
        is_awaited = chosen == "all" or chosen == "descriptions" and is_description
        if not (isinstance(request, Say) and is_early and is_awaited):
            return 0.0
        return len(request.text.split()) / self.settings.speech_pace

    def failed(self, node: "Duty", cause: Cause, resource: str) -> None:
        """Keep a failure for the recovery."""
        self.newest += 1
        self.failures[node.uid] = Failed(self.newest, node, cause, resource)

    def begin_visit(self, board: Blackboard, at: float) -> None:
        """Forget the last visitor: answers and gazes from before do not count."""
        self.is_spent, self.unrecovered, self._first = False, [], self.newest + 1
        for name in TYPES:
            board.unset(name)
        for name in ("questionAskedAt", "attentionSetAt"):
            board.set(name, at, TYPES[name])

    @property
    def knowledge(self) -> Dict[str, Tuple[Exhibit, ...]]:
        """The places of the robot's files, by query; empty if a node answers such queries."""
        known = self.known
        return {} if known is None else {
            "exhibits": known.tour, "home": known.tour[:1], "entrance": known.tour[-1:]
        }


class Duty(Node):
    """A node with a rule."""

    course: Any  # the execution
    rule: Callable[[Any], Any]
    resource = ""

    def setup(self, **kwargs: Any) -> None:
        """Get what the nodes of the mission go by."""
        self.course = kwargs["course"]

    def entry(self, port: str, otherwise: Any = None) -> Any:
        """Return the value of a port; ``otherwise`` if nothing has written it. Raises PortError."""
        try:
            return self.get_input(port)
        except NoValue:
            return otherwise

    def write(self, **entries: Any) -> None:
        """Write ports. Raises PortError."""
        for port, value in entries.items():
            self.set_output(port, value)
            self.course.entries.stored(self, port)

    def conclude(self, cause: Optional[Cause]) -> Result:
        """End the node; without a cause it has succeeded."""
        if cause is not None:
            self.course.failed(self, cause, self.resource)
        self.course.ended(self, cause)
        return SUCCESS if cause is None else FAILURE

    @property
    def word(self) -> str:
        """The argument of a node of release 1.0: its name."""
        return argument(self.name)


class Instant(Duty):
    """A node that is done within its tick: the rule returns why it fails, or None."""

    def update(self) -> Result:
        try:
            return self.conclude(self.rule(self))
        except PortError:
            return self.conclude(Cause.MISSING_DATA)


# ----------------------------------------------------------------------------------------- requests


class Ended(NamedTuple):
    """The end of an attempt."""

    cause: Optional[Cause]


class Attempt:
    """One request of a node, from its sending to its end."""

    def __init__(self, node: "Asking"):
        self._node = node
        try:
            self._wanted = node.rule(node)
        except PortError:
            self._wanted = Cause.MISSING_DATA
        is_asked = self._wanted is not None and not isinstance(self._wanted, Cause)
        self._reply: Optional[Reply] = node.course.ask(node, self._wanted) if is_asked else None
        self._rest: Optional[Timer] = None  # of what the robot says, after its answer

    def poll(self) -> Optional[Ended]:
        """Return how the attempt ended, or None."""
        node = self._node
        if self._reply is None:
            return Ended(self._wanted)
        result = self._reply.result
        if result is None or isinstance(result, Answer) and self._goes_on():
            return None
        try:
            if node.marks_end:  # a question that failed makes older answers invalid too
                node.write(questionAskedAt=node.clock.now())
            if isinstance(result, Failure):
                return Ended(result.cause)
            return Ended(node.keep(node, result))
        except PortError:
            return Ended(result.cause if isinstance(result, Failure) else Cause.MISSING_DATA)

    def drop(self) -> None:
        """Wait no more."""
        if self._reply is not None:
            self._node.course.drop(self._reply)
        if self._rest is not None:
            self._rest.cancel()

    def _goes_on(self) -> bool:
        """Return whether the robot still speaks, though it has answered."""
        if self._rest is None:
            seconds = self._node.course.speech_lasts(self._node, self._wanted)
            if not seconds:
                return False
            self._rest = self._node.clock.call_after(seconds, self._node.wake)
        return self._rest.callback is not None


def _keep_nothing(node: Any, answer: Answer) -> Optional[Cause]:
    return None


class Asking(Duty, ActionLeaf):
    """A node that asks the robot: the rule returns the request, why there is none, or None: none is
    needed."""

    asks: type
    keep: Callable[[Any, Answer], Optional[Cause]] = staticmethod(_keep_nothing)
    marks_end = False
    attempt: Optional[Attempt] = None

    def on_start(self) -> Result:
        interface = self.course.interface
        self.resource = interface.resource(self.asks) if interface.serves(self.asks) else ""
        self.attempt = Attempt(self)
        return self.on_running()

    def on_running(self) -> Result:
        ended = self.attempt.poll() if self.attempt is not None else None
        return RUNNING if ended is None else self.conclude(ended.cause)

    def on_halted(self) -> None:
        if self.attempt is not None:
            self.attempt.drop()
        self.course.halted(self)


# ------------------------------------------------------------------------------- signs of a visitor


class Evidence(NamedTuple):
    """When a message is the sign; ``wait``: seconds that the condition itself waits, None:
    ``conditionWait``."""

    is_sign: Callable[[Any, int], bool]
    wait: Optional[float] = None
    is_given_up: Callable[[Any], bool] = lambda value: False


def _has_face(faces: Any, _gaze: int) -> bool:
    return len(faces.labels) > 0


def _is(state: str, value: int) -> Callable[..., bool]:
    return lambda status, *_gaze: (status.state, status.value) == (state, value)


EVIDENCE: Dict[str, Dict[Sense, Evidence]] = {
    "D5.4.3": {
        Sense.VISITOR: Evidence(_has_face), Sense.PRESENCE: Evidence(_has_face, PRESENCE_WAIT),
        Sense.GAZE: Evidence(lambda status, gaze: (status.state, status.value) == ("seeking", gaze))
    },
    "release-1.0": {
        Sense.VISITOR: Evidence(_is("scanning", 2), math.inf),
        Sense.PRESENCE: Evidence(_is("social", 2), PRESENCE_WAIT),
        Sense.GAZE: Evidence(_is("seeking", 2), math.inf, _is("seeking", 3))
    }
}
"""Sections 4.6 and table 4 of the document; the statuses of release 1.0's attention."""


class Listener(Duty):
    """A node that goes by the messages about one sense."""

    sense: Sense
    _timer: Optional[Timer] = None
    _is_late = False

    @property
    def topic(self) -> Topic:
        return self.course.interface.evidence(self.sense).topic

    def listens(self, seconds: float) -> bool:
        """Return whether the node listens on: for so many seconds from the first call on, and for
        what began within them."""
        if self._timer is None:
            self._timer = self.clock.call_after(min(seconds, 1e9), self.wake)
        if self._timer.callback is not None and not self._is_late:
            return True
        if not self.course.signs.is_hearing(self.topic):
            return False
        if not self._is_late and self.topic.action is not None:
            self._is_late = True
            self._timer = self.clock.call_after(RESULT_WAIT, self.wake)
        return True

    def stop_listening(self) -> None:
        """Listen no more."""
        if self._timer is not None:
            self._timer.cancel()
        self._timer, self._is_late = None, False


class Sign(Listener, ConditionLeaf):
    """A condition on messages: the newest one of a state, each one of events, if they came after
    what they answer."""

    counts_from = "attentionSetAt"

    def update(self) -> Result:
        self.resource = self.topic.name
        try:
            return self._answer(self._after)
        except PortError:
            self.stop_listening()
            return self.conclude(Cause.MISSING_DATA)

    @property
    def _after(self) -> float:
        if self.sense is Sense.VISITOR or self.sense is Sense.PRESENCE:
            return -math.inf
        return self.entry(self.counts_from, -math.inf)

    def _answer(self, after: float) -> Result:
        evidence, now = self._evidence, self.clock.now()
        limit = self.course.settings.topic_max_age if self.topic.is_continuous else math.inf
        counting = [sample for sample in self.course.signs.messages(self.topic)
                    if sample.arrived > after and now - sample.arrived <= limit]
        for sample in counting:
            if self.is_sign(sample.value):
                self.stop_listening()
                self.course.signs.saw(self, self.topic, sample, self.is_sign)
                self.use(sample)
                return self.conclude(None)
        self.course.signs.sought(self, self.topic, after, self.is_sign)
        if any(evidence.is_given_up(sample.value)
               for sample in counting) or not self._waits(evidence.wait):
            self.stop_listening()
            return self.conclude(Cause.CONDITION_FALSE)
        return RUNNING

    @property
    def _evidence(self) -> Evidence:
        of_robot = EVIDENCE.get(self.course.interface.name, EVIDENCE["D5.4.3"])
        return of_robot.get(self.sense) or Evidence(lambda value, gaze: False)

    def is_sign(self, value: Any) -> bool:
        return self._evidence.is_sign(value, self.course.settings.gaze_value)

    def use(self, sample: Sample) -> None:
        """Store what the sign says."""

    def _waits(self, wait: Optional[float]) -> bool:
        wait = self.course.settings.condition_wait if wait is None else wait
        return bool(wait) and not is_asked_again(self) and self.listens(wait)

    def halt(self) -> None:
        self.stop_listening()
        super().halt()


def is_asked_again(node: Any) -> bool:
    """Return whether a reactive control asks a condition again while a later child runs, which
    waits for it."""
    while node.parent is not None:
        parent, node = node.parent, node
        is_reactive = isinstance(
            parent, (ReactiveFallback, ReactiveSequence)) and node is not parent.children[-1]
        if is_reactive or isinstance(parent, WhileDoElse) and node is parent.children[0]:
            return True
        node = parent
    return False


class YesNo(Sign):
    """IsYesNoUttered: a yes or a no after the question; one utterance answers one question."""

    sense = Sense.UTTERANCE
    counts_from = "questionAskedAt"

    @property
    def _evidence(self) -> Evidence:
        is_release = self.course.interface.name == "release-1.0"
        return Evidence(lambda value, gaze: self.is_sign(value),
                        ANSWER_WAIT if is_release else None)

    def is_sign(self, value: Any) -> bool:
        return spoken(self.course.phrases, value) is not None

    def use(self, sample: Sample) -> None:
        self.write(visitorResponse=spoken(self.course.phrases, sample.value),
                   questionAskedAt=sample.arrived)


class Listening(Listener, ActionLeaf):
    """GetVisitorResponse: listens for 10 s; an error of the recognition ends it with FAILURE."""

    sense = Sense.UTTERANCE
    _began = 0.0

    def on_start(self) -> Result:
        self.resource, self._began = self.topic.name, self.clock.now()
        return self.on_running()

    def on_running(self) -> Result:
        heard = [
            sample.value for sample in self.course.signs.messages(self.topic)
            if sample.arrived > self._began
        ]
        ending = next(filter(self._ends, heard), None)
        if ending is None and self.listens(ANSWER_WAIT):
            self.course.signs.sought(self, self.topic, self._began, self._ends)
            return RUNNING
        is_failure = ending is not None and is_error(ending)
        self.stop_listening()
        try:
            answer = None if ending is None or is_failure else spoken(self.course.phrases, ending)
            self.write(visitorResponse=answer or "")
        except PortError:
            return self.conclude(Cause.MISSING_DATA)
        return self.conclude(Cause.UNUSABLE_ANSWER if is_failure else None)

    def _ends(self, text: str) -> bool:
        return is_error(text) or spoken(self.course.phrases, text) is not None

    def on_halted(self) -> None:
        self.stop_listening()
        self.course.halted(self)


_WORD = re.compile(r"[^\W_]+(?:'[^\W_]+)*")


def spoken(phrases: Phrases, text: str) -> Optional[str]:
    """Return ``yes`` or ``no`` for what a visitor said, or None: whole words, the longest phrase
    first, no before yes."""
    if text.lstrip().lower().startswith("error"):
        return None
    words = tuple(_WORD.findall(text.lower().replace("’", "'")))
    known = sorted(((phrase, meaning) for meaning, synonyms in phrases.meanings.items()
                    for phrase in synonyms), key=lambda pair: -len(pair[0]))
    meanings, at = set(), 0
    while at < len(words):
        phrase, meaning = next((pair for pair in known if words[at:at + len(pair[0])] == pair[0]),
                               (words[:1], ""))
        meanings.add(meaning)
        at += len(phrase)
    return "no" if "no" in meanings else "yes" if "yes" in meanings else None


def is_error(text: str) -> bool:
    """Return whether speech recognition reports an error instead of words."""
    return "Error" in text or text.lstrip().lower().startswith("error")


# ----------------------------------------------------------------------------------------- recovery


class Rule(NamedTuple):
    """A line of the policy."""

    node: str
    cause: str
    retries: int
    back_off: float
    then: str


INDISPENSABLE = {
    "Navigate", "SelectExhibit", "RetrieveListOfExhibits", "LookUpEntrance", "LookUpHome",
    "RetrieveInitialLocation"
}
"""Nodes that no policy may skip."""

OF_A_VISIT = {"Navigate", "SelectExhibit"}
"""Nodes without which an exhibit is left out."""


class Policy:
    """The lines of recoveryPolicy.ini, by the words at its head."""

    def __init__(self, text: str):
        self.rules: List[Rule] = []
        self.most, self.seconds = 0, 0.0
        self.first_pause, self.longest_pause = 10.0, 300.0
        for line in text.splitlines():
            words = line.split("#")[0].split()
            if words[:1] == ["budget"]:
                self.most, self.seconds = int(words[1]), float(words[2])
            elif words[:1] == ["pause"]:
                self.first_pause, self.longest_pause = float(words[1]), float(words[2])
            elif len(words) == len(Rule._fields):
                self.rules.append(Rule(words[0], words[1], int(words[2]), float(words[3]),
                                       words[4]))

    def rule(self, node: Node, cause: Cause) -> Rule:
        """Return the first line that fits."""
        name = node.registration_id
        fitting = (rule for rule in self.rules
                   if rule.node in ("*", name) and rule.cause in ("*", cause.value))
        rule = next(fitting, Rule(name, "*", 0, 0.0, "giveUp"))
        is_needed = name in INDISPENSABLE or getattr(node.spec, "is_indispensable", False)
        return rule._replace(then="giveUp") if is_needed else rule


class Recovering(Duty, ActionLeaf):
    """HandleFallBack: does what the policy says about the newest failure of the nodes before it."""

    _last = 0
    round: Optional["Round"] = None  # the newest

    def on_start(self) -> Result:
        self.round = None
        before = list(self._before())
        first = before[0].uid if before else self.uid
        failures = [failed for uid, failed in self.course.failures.items()
                    if first <= uid < self.uid and failed.number > self._last]
        self._last = self.course.newest
        if not failures:
            self.course.ended(self, Cause.MISSING_DATA)
            return FAILURE
        self.round = Round(self, max(failures), before)
        return self.on_running()

    def _before(self) -> Iterator[Any]:
        """Yield the nodes before this one below the nearest ancestor that has any."""
        node: Any = self
        while node.parent is not None:
            children = node.parent.children
            if node is not children[0]:
                return iter(children[:children.index(node)])
            node = node.parent
        return iter(())

    def on_running(self) -> Result:
        outcome = self.round.go_on() if self.round is not None else None
        if outcome is None or self.round is None:
            return RUNNING
        self.course.ended(self, self.round.cause if outcome == GIVEN_UP else None)
        if outcome == GIVEN_UP:
            self.course.unrecovered.append((self.round.cause, self.round.resource))
        return FAILURE if outcome == GIVEN_UP else SUCCESS

    def on_halted(self) -> None:
        if self.round is not None:
            self.round.drop()
        self.course.halted(self)

    def leave_out(self) -> bool:
        """Note that the exhibit under way is left out; return whether the tour still shows one.

        If it does not, the exhibit goes back to the list, once.
        """
        exhibits, index = self.entry("exhibits", ()), self.entry("nextExhibit", 0) - 1
        if not 0 <= index < len(exhibits):
            return True
        if self.entry("targetLocation") != exhibits[index].location:
            return True
        tell_stop(self, exhibits, index, OMITTED)
        before = self.entry("leftOutExhibits", [])
        left_out = sorted({index}.union(before))
        self.write(leftOutExhibits=left_out)
        if len(left_out) < len(exhibits):
            return True
        if index not in before:
            self.write(nextExhibit=index)
        return False


class Round:
    """One recovery under way."""

    def __init__(self, handler: Recovering, failed: Failed, before: Sequence[Any]):
        self._handler, self._failed, self._before = handler, failed, before
        self._course = course = handler.course
        self.cause, self.resource = failed.cause, failed.resource
        self.retries = 0
        now, policy = handler.clock.now(), course.policy
        recent = [began for began in course.recoveries if began > now - policy.seconds]
        course.recoveries = recent + [now]
        self._rule = policy.rule(failed.node, failed.cause)
        if len(course.recoveries) > policy.most:
            self._rule = self._rule._replace(retries=0, then="giveUp")
            course.is_spent = True
        self._can_redo = failed.node.parent is handler.parent and isinstance(failed.node, Asking)
        self._work: Optional[Asking] = None  # what is attempted
        self._attempt: Optional[Attempt] = None
        self._pause: Optional[Timer] = None
        self._patience: Optional[Timer] = None
        self._safe_state: List[Reply] = []
        self._outcome = ""
        self._choose()

    def __str__(self) -> str:
        is_other = self._work not in (None, self._failed.node)
        return "{} failed: {}; {} of {} retries made{}".format(
            self._failed.node.registration_id, self.cause.value, self.retries, self._rule.retries,
            ", " + INSTEAD.format(self._work.registration_id) if self._work and is_other else "")

    def _decided(self, step: str, *values: Any, work: Optional[Duty] = None,
                 cause: Optional[Cause] = None) -> None:
        node = work or self._failed.node
        self._course.reports.decided(Decision(
            node.registration_id, node.full_path, (cause or self.cause).value,
            step.format(*values), 0 if work else self._handler.uid))

    def _choose(self) -> None:
        """Decide what comes after a failure."""
        rule, handler = self._rule, self._handler
        is_substitute = rule.then not in ("skip", "giveUp")
        if self._can_redo and self.retries < rule.retries:
            self._work = self._failed.node  # type: ignore[assignment]
            self._pause = handler.clock.call_after(rule.back_off * 2**self.retries, handler.wake)
            self._decided(RETRY, self.retries + 1, rule.retries)
        elif self._can_redo and is_substitute and self._work in (None, self._failed.node):
            self._work = self._substitute(rule.then)
            self._decided(INSTEAD, rule.then)
        else:
            may_skip = self._may_skip()
            if not may_skip:
                self._rule = rule._replace(then="giveUp")
            self._end(not self.gives_up)

    @property
    def gives_up(self) -> bool:
        """Whether the rule is to give up."""
        return self._rule.then == "giveUp"

    def _may_skip(self) -> bool:
        below = (node for step in self._before for node in step.iterate())
        if not any(node.registration_id in OF_A_VISIT for node in below):
            return True
        try:
            return self._handler.leave_out()
        except PortError:
            return True

    def _end(self, is_skipped: bool) -> None:
        self._outcome = SKIPPED if is_skipped else GIVEN_UP
        if not is_skipped and self._failed.number != self._course.given_up:
            self._course.given_up = self._failed.number
            self._safe_state = [self._course.ask(self._handler, request) for request in SAFE_STATE]

    def _substitute(self, node_id: str) -> Asking:
        # the policy was checked when the mission was loaded
        handler, spec = self._handler, self._course.registry.find(node_id)
        node: Any = spec.factory(node_id)
        node.registration_id, node.spec, node.attributes = node_id, spec, defaults(spec.ports)
        node.uid, node.full_path = handler.uid, handler.full_path
        node.blackboard, node.services, node.course = (handler.blackboard, handler.services,
                                                       handler.course)
        return node

    def go_on(self) -> Optional[str]:
        """Return the outcome, or None while there is something to wait for."""
        while not self._outcome:
            if self._attempt is None and self._waits():
                return None
            assert self._work is not None
            if self._attempt is None:
                self._note_delay()
                self._attempt = Attempt(self._work)
            ended = self._attempt.poll()
            if ended is None:
                return None
            self._attempt = None
            self._judge(ended.cause)
        self.cancel()
        if any(reply.result is None for reply in self._safe_state):
            return None
        if self._safe_state:
            self._course.reports.decided(SAFE)
        self._decided(ENDED, self._outcome, self.retries, "give up" if self.gives_up else "skip")
        return self._outcome

    def _note_delay(self) -> None:
        if self._work is self._failed.node and self._pause is not None and self._patience is None:
            self._course.retried(self._failed.node, self._handler.clock.now() - self._pause.due)

    def cancel(self) -> None:
        """Stop the timers."""
        for timer in (self._pause, self._patience):
            if timer is not None:
                timer.cancel()

    def drop(self) -> None:
        """Wait no more."""
        self.cancel()
        if self._attempt is not None:
            self._attempt.drop()
        for reply in self._safe_state:
            self._course.drop(reply)

    def _judge(self, cause: Optional[Cause]) -> None:
        is_retry = self._work is self._failed.node
        self.retries += is_retry
        if cause is None:
            self._outcome = DONE if is_retry else SUBSTITUTED
            return
        self._decided(FAILED_AGAIN, self.retries, work=self._work, cause=cause)
        if is_retry:
            self.cause = cause
            self._rule = self._course.policy.rule(self._failed.node, cause)
        self._choose()

    def _waits(self) -> bool:
        """Return whether a retry waits: for its pause, or for a service to return that the tour
        needs."""
        if self._work is not self._failed.node or self._pause is None:
            return False
        if self._pause.callback is not None:
            return True
        if self._rule.then != "giveUp" or self._failed.resource not in self._course.gone:
            return False
        if self._patience is None:
            self._patience = self._handler.clock.call_after(RETURN_WAIT, self._handler.wake)
        return self._patience.callback is not None


SAFE_STATE = (SetAttention("disabled"), SetAnimation("disabled"))
"""The requests that leave the robot safe."""

HANDLERS = {"", "HandleFallBack", "HandleFallback"}
"""What asks for the safe state: the nodes that recover, and at the end no node."""


# ----------------------------------------------------------------------------------------- services


def _on_axes(name: str, place: Sequence[float], last: str = "z") -> Dict[str, Any]:
    return dict(zip((name + "x", name + "y", name + last), place))


def _spoken(request: Say, is_release: bool) -> Dict[str, Any]:
    language = {"language": request.language} if is_release else {}
    return dict(message=request.text, **language)


FIELDS: Dict[type, Callable[[Any, bool], Dict[str, Any]]] = {
    SetAnimation: lambda request, _: {"state": request.state},
    PerformGesture: lambda request, _: dict(
        gesture_type=request.type, gesture_id=request.id, gesture_duration=request.duration_ms,
        bow_nod_angle=request.bow_nod_angle_deg, **_on_axes("location_", request.target)),
    QueryKnowledge: lambda request, _: {"parameters": request.what},
    SetAttention: lambda request, _: dict(state=request.state,
                                          **_on_axes("location_", request.target)),
    GoTo: lambda request, _: _on_axes("goal_", request.goal, "theta"),
    Prompt: lambda request, is_release: {
        "message": "|".join("'{}'".format(option) if is_release else option
                            for option in request.options)},
    Say: _spoken,
    SetPose: lambda request, _: _on_axes("", request.pose, "theta"),
    SetRecognition: lambda request, _: {"status": "true" if request.is_enabled else "false"},
    SetRecognitionLanguage: lambda request, _: {"language": request.language}
}
"""Table 3: the fields of a request on the wire, on the document's robot or on release 1.0's."""


# -------------------------------------------------------------------------------------------- rules


def _begin(node: Duty) -> None:
    node.course.begin_visit(node.blackboard.root(), node.clock.now())


def _false_unless(holds: Callable[[Any], bool]) -> Callable[[Any], Optional[Cause]]:
    return lambda node: None if holds(node) else Cause.CONDITION_FALSE


def tell_stop(node: Duty, exhibits: Sequence[Exhibit], index: int, state: str) -> None:
    """Have the record say what becomes of a stop."""
    node.course.reports.decided(Decision(node.registration_id, node.full_path, "", STOP.format(
        index + 1, len(exhibits), exhibits[index].name, state)))


def _has_next(node: Duty) -> Optional[Cause]:
    index, exhibits = node.entry("nextExhibit", 0), node.entry("exhibits", ())
    if 0 < index <= len(exhibits):
        tell_stop(node, exhibits, index - 1, OVER)
    return None if index < len(exhibits) else Cause.CONDITION_FALSE


def _select(node: Duty) -> Optional[Cause]:
    exhibits, index = node.get_input("exhibits"), node.entry("nextExhibit", 0)
    if index >= len(exhibits):
        return Cause.MISSING_DATA
    exhibit = exhibits[index]
    node.write(nextExhibit=index + 1, currentExhibit=exhibit.name, targetLocation=exhibit.location,
               gestureTarget=exhibit.gesture, description1=exhibit.description1,
               description2=exhibit.description2)
    tell_stop(node, exhibits, index, BEGUN)
    return None


def _keep_list(node: Duty, answer: Answer) -> Optional[Cause]:
    if not answer.exhibits:
        return Cause.MISSING_DATA
    node.write(exhibits=list(answer.exhibits), nextExhibit=0, leftOutExhibits=[])
    return None


def _keep_place(node: Duty, answer: Answer, has_gesture: bool) -> Optional[Cause]:
    if len(answer.exhibits) != 1:
        return Cause.UNUSABLE_ANSWER
    node.write(targetLocation=answer.exhibits[0].location)
    if has_gesture:
        node.write(gestureTarget=answer.exhibits[0].gesture)
    else:
        node.clear_output("gestureTarget")
        node.course.entries.stored(node, "gestureTarget")
    return None


def _keep_pressed(node: Duty, answer: Answer) -> Optional[Cause]:
    if not node.course.interface.tells_pressed:
        if node.course.settings.tablet_success_is == "yes":
            node.write(visitorResponse="yes")
        return None
    pressed = answer.response.strip().lower()
    yes, no = (label.lower() for label in node.course.phrases.tablet_options)
    if pressed not in ("1", yes, "2", no):
        return Cause.MISSING_DATA if pressed in ("", "0") else Cause.UNUSABLE_ANSWER
    node.write(visitorResponse="yes" if pressed in ("1", yes) else "no")
    return None


def _keep_time(node: Duty, answer: Answer) -> None:
    node.write(attentionSetAt=node.clock.now())


def _say(node: Duty, speech: str) -> Request:
    return Say(node.course.phrases.speeches[speech], node.course.language)


UTILITY = {
    1: "PressYesNoSpeech", 2: "FollowMeSpeech", 3: "MaybeAnotherTimeSpeech", 4: "WelcomeSpeech",
    5: "QueryTourSpeech", 6: "HereIsTheDoorSpeech", 7: "SayGoodByeSpeech"
}
"""Which of the document's speeches says the same as a utility phrase of release 1.0."""


def _say_utility(node: Duty) -> Union[Request, Cause]:
    number, course = int(node.word), node.course
    if course.known is None:
        text = course.phrases.speeches.get(UTILITY.get(number, ""))
    else:
        text = course.known.phrases.get(number)
    return Cause.MISSING_DATA if text is None else Say(text, course.language)


def _describe(node: Duty, part: str = "") -> Union[Request, Cause, None]:
    node.get_input("currentExhibit")
    if not part:
        part = node.get_input("part") if "part" in node.attributes else node.name
        if "part" in node.attributes and part not in ("1", "2", "both"):
            return Cause.MISSING_DATA
    ports = ["description" + part] if part in ("1", "2") else ["description1", "description2"]
    text = " ".join(filter(None, (node.entry(port, "") for port in ports)))
    return Say(text, node.course.language) if text else None


def _iconic(node: Duty, which: str) -> Request:
    settings = node.course.settings
    number = {"welcome": settings.welcome_gesture_id, "goodbye": settings.goodbye_gesture_id}[which]
    return PerformGesture("iconic", number, settings.gesture_duration)


def _deictic(node: Duty) -> Optional[Request]:
    target, settings = node.get_input("target"), node.course.settings
    return None if target == NOWHERE else PerformGesture("deictic", settings.deictic_gesture_id,
                                                         settings.gesture_duration, target)


def _attend(node: Duty, mode: str) -> Optional[Request]:
    if mode != "location":
        return SetAttention(mode)
    target = node.get_input("target")
    return None if target == NOWHERE else SetAttention(mode, target)


def _pose(node: Duty) -> Union[Request, Cause]:
    exhibits = node.entry("exhibits", ())
    return SetPose(exhibits[0].location) if exhibits else Cause.MISSING_DATA


def _language(node: Duty) -> Optional[Request]:
    return SetRecognitionLanguage(
        node.course.language) if node.course.settings.asr_enabled else None


class Starting(Asking):
    """StartOfTree: a pass begins, once, even if setting the language is retried."""

    def on_start(self) -> Result:
        _begin(self)
        return super().on_start()


# -------------------------------------------------------------------------------------------- table


def _row(node_id: str, leaf: type, rule: Optional[Callable[[Any], Any]] = None, ports: str = "",
         more: Tuple[Port, ...] = (), **facts: Any) -> NodeSpec:
    """Return the node type of a row; ``facts`` are attributes of its leaf."""
    def make(name: str) -> Any:
        node = leaf(name)
        for key, value in dict(facts, **({"rule": rule} if rule is not None else {})).items():
            setattr(node, key, value)
        return node

    is_condition = issubclass(leaf, Sign) or node_id.startswith(("Is", "Has"))
    kind = Kind.CONDITION if is_condition else Kind.ACTION
    return NodeSpec(node_id, kind, make, _ports(ports) + more, is_recovery=leaf is Recovering)


def _asks(node_id: str, request: type, rule: Callable[[Any], Any], ports: str = "",
          **facts: Any) -> NodeSpec:
    return _row(node_id, facts.pop("leaf", Asking), rule, ports, asks=request, **facts)


def _optional(node_id: str, request: type, rule: Callable[[Any], Any], ports: str = "",
              **facts: Any) -> NodeSpec:
    """Return a row whose node succeeds without a request on a robot that lacks the service."""
    return _asks(node_id, request, lambda node: rule(node)
                 if node.course.interface.serves(request) else None, ports, **facts)


def speech(node_id: str, says: str, is_question: bool = False) -> NodeSpec:
    """Return the row of a node that says a phrase of the language's file."""
    return _asks(node_id, Say, partial(_say, speech=says),
                 ">questionAskedAt" if is_question else "", marks_end=is_question)


def _mode(node_id: str, mode: str) -> NodeSpec:
    return _asks(node_id, SetAttention, partial(_attend, mode=mode),
                 ">attentionSetAt" + (" <target:gestureTarget" if mode == "location" else ""),
                 keep=_keep_time)


def _look_up(node_id: str, place: str, has_gesture: bool) -> NodeSpec:
    return _asks(node_id, QueryKnowledge, lambda node: QueryKnowledge(place),
                 ">targetLocation >gestureTarget", keep=partial(_keep_place,
                                                                has_gesture=has_gesture))


LEFT_OUT = "<exhibits <targetLocation =nextExhibit =leftOutExhibits"
_PART = (Port("part", TEXT, is_optional=True),)

SPEECHES = ("EndTourSpeech", "FollowMeSpeech", "HereIsTheDoorSpeech", "MaybeAnotherTimeSpeech",
            "SayGoodByeSpeech", "WelcomeSpeech")
QUESTIONS = ("PressYesNoSpeech", "QueryTourSpeech", "SayYesNoSpeech")

ROWS: Tuple[NodeSpec, ...] = (
    # D5.4.3, table 4
    *(speech(name, name) for name in SPEECHES), *(speech(name, name, True) for name in QUESTIONS),
    _asks("DescribeExhibitSpeech", Say, _describe, "<currentExhibit <description1 <description2",
          more=_PART),
    _asks("DisableAnimateBehavior", SetAnimation, lambda node: SetAnimation("disabled")),
    _mode("DisabledOvertAttentionMode", "disabled"),
    _asks("EnableAnimateBehavior", SetAnimation, lambda node: SetAnimation("enabled")),
    _asks("GoodbyeGesture", PerformGesture, partial(_iconic, which="goodbye")),
    _row("HandleFallBack", Recovering, None, LEFT_OUT),
    _row("IsASREnabled", Instant, _false_unless(lambda node: node.course.settings.asr_enabled)),
    _row("IsListWithExhibit", Instant, _has_next, "<exhibits <nextExhibit"),
    _row("IsMutualGazeDiscovered", Sign, None, "<attentionSetAt", sense=Sense.GAZE),
    _row("IsVisitorDiscovered", Sign, sense=Sense.VISITOR),
    _row("IsVisitorResponseYes", Instant,
         _false_unless(lambda node: node.entry("visitorResponse") == "yes"), "<visitorResponse"),
    _row("IsYesNoUttered", YesNo, None, ">visitorResponse =questionAskedAt"),
    _look_up("LookUpEntrance", "entrance", True),
    _look_up("LookUpHome", "home", False),
    _asks("Navigate", GoTo, lambda node: GoTo(node.get_input("target")), "<target:targetLocation"),
    _asks("PerformDeicticGesture", PerformGesture, _deictic, "<target:gestureTarget"),
    _asks("PressYesNoDialogue", Prompt, lambda node: Prompt(node.course.phrases.tablet_options),
          ">visitorResponse", keep=_keep_pressed),
    _asks("RetrieveListOfExhibits", QueryKnowledge, lambda node: QueryKnowledge("exhibits"),
          ">exhibits >nextExhibit >leftOutExhibits", keep=_keep_list),
    _mode("ScanningOvertAttentionMode", "scanning"),
    _row(
        "SelectExhibit", Instant, _select,
        "<exhibits =nextExhibit >currentExhibit >targetLocation >gestureTarget "
        ">description1 >description2", (Port("stop", TEXT, is_optional=True),)),
    _mode("SocialOvertAttentionMode", "social"),
    _row("START_OF_TREE", Instant, _begin),
    _asks("WelcomeGesture", PerformGesture, partial(_iconic, which="welcome")),
    # other names and extensions
    _row("HandleFallback", Recovering, None, LEFT_OUT),
    speech("SayGoodBye", "SayGoodByeSpeech"),
    _asks("DescribeExhibitSpeech_1", Say, partial(_describe, part="1"),
          "<currentExhibit <description1"),
    _asks("DescribeExhibitSpeech_2", Say, partial(_describe, part="2"),
          "<currentExhibit <description2"),
    _mode("SeekOvertAttentionMode", "seeking"),
    _mode("SeekingOvertAttentionMode", "seeking"),
    _mode("LocationOvertAttentionMode", "location"),
    # release 1.0: the argument is the node's name
    _optional("StartOfTree", SetRecognitionLanguage, _language, leaf=Starting),
    _asks("SayText", Say, _say_utility, ">questionAskedAt", marks_end=True),
    _asks("SetOvertAttentionMode", SetAttention, lambda node: _attend(node, node.word),
          ">attentionSetAt <target:gestureTarget", keep=_keep_time),
    _asks("SetAnimateBehavior", SetAnimation, lambda node: SetAnimation(node.word)),
    _optional("SetSpeechEvent", SetRecognition, lambda node: SetRecognition(node.word in
                                                                            ("true", "enabled"))),
    _asks("PerformIconicGesture", PerformGesture, lambda node: _iconic(node, node.word)),
    _optional("SetRobotPose", SetPose, _pose, "<exhibits"),
    _optional("ResetRobotPose", SetPose, _pose, "<exhibits"),
    _look_up("RetrieveInitialLocation", "home", False),
    _row("GetVisitorResponse", Listening, None, ">visitorResponse"),
    _row("HasVisitorResponded", Instant,
         _false_unless(lambda node: bool(node.entry("visitorResponse"))), "<visitorResponse"),
    _row("IsVisitorPresent", Sign, sense=Sense.PRESENCE),
)
"""The table: a node type, its way of being done, its rule, and the entries it reads and writes."""
