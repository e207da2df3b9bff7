"""The tasks of the mission nodes by D5.4.3 (table 4), release 1.0 and 1.1: the requests that they
make, the entries that they store, the conditions on which they hold.

It is written from the documents, beside the controller's own leaves, and uses nothing of them.
``ROWS`` is the table. The steps of a row take the node, and are a generator if they may pause while
the node goes on; they raise ``Fails``. Requests, messages and knowledge of the robot come from
a ``TaskContext``.
"""
import math
import re
from contextlib import ExitStack, suppress
from dataclasses import dataclass
from functools import partial
from typing import (
    Any, Callable, Dict, Generator, Iterator, List, NamedTuple, Optional, Sequence, Set, Tuple)

from behavior_controller.bt import (
    ActionLeaf, Blackboard, Direction, Kind, Node, NodeSpec, NoValue, Port, PortError, PortType,
    Result, FAILURE, IDLE, RUNNING, SUCCESS)
from behavior_controller.bt.engine.clock import Timer
from behavior_controller.bt.engine.controls import ReactiveFallback, ReactiveSequence, WhileDoElse
from behavior_controller.bt.engine.origin import origins, steps_before
from behavior_controller.bt.engine.ports import defaults
from behavior_controller.bt.engine.registry import argument
from behavior_controller.bt.values.values import TEXT, whole_real
from behavior_controller.config.settings import Settings
from behavior_controller.run.events import BEGUN, OMITTED, OVER
from behavior_controller.robot.gateway import Cause, Sample
from behavior_controller.robot.requests import (
    Answer, Exhibit, GoTo, GoToGoal, Location, PerformGesture, PerformGestureGoal, Point, Prompt,
    QueryKnowledge, Request, Say, SayGoal, SetAnimation, SetAttention, SetPose, SetRecognition,
    SetRecognitionLanguage)

from unit_tests.judge import files
from unit_tests.judge.wire import (
    ATTENTION, DOCUMENTS, FACES, RELEASE_1_0, RELEASE_1_1, SPEECH, STATES, robot_of)

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
"""The ends of a recovery."""

SAFE_STATE = (SetAttention("disabled"), SetAnimation("disabled"))
"""The requests that leave the robot safe."""

HANDLERS = ("HandleFallBack", "HandleFallback")
"""The nodes that recover."""

INDISPENSABLE = {"Navigate", "NavigateAsync", "SelectExhibit", "RetrieveListOfExhibits",
                 "LookUpEntrance", "LookUpHome", "RetrieveInitialLocation"}
"""Nodes that no policy may skip."""

OF_A_VISIT = {"Navigate", "NavigateAsync", "SelectExhibit"}
"""Nodes without which an exhibit is left out."""

SELECTS, STOP, EXHIBIT = "SelectExhibit", "stop", "exhibit"
"""The node that begins a stop, its port with what a stop is called, and that of a tour."""

ANSWERS = ("IsVisitorResponseYes", "HasVisitorResponded")
GAZES = ("IsMutualGazeDiscovered",)
PRESENCES = ("IsVisitorDiscovered", "IsVisitorPresent")
"""The conditions on what a visitor answers, on the gaze, and on whether anybody is there."""

DRIVES = ("Navigate", "NavigateAsync")
WAITS, LOOK_HOME = ("Sleep", "Timeout"), ("LookUpHome", "RetrieveInitialLocation")
"""The nodes by which a mission drives, waits for a visitor, and finds its way home."""

DESCRIBES = ("DescribeExhibitSpeech", "DescribeExhibitSpeech_1", "DescribeExhibitSpeech_2",
             "DescribeExhibitSpeechAsync")
"""The types of nodes that say the description of an exhibit."""

SLEEP = "Sleep"
NUMBERED = {SLEEP: "msec", "RetryUntilSuccessful": "num_attempts"}
"""The nodes whose number in the mission file can be compared with the record, with its port."""

GOODBYE, REFUSED = "SayGoodByeSpeech", "MaybeAnotherTimeSpeech"
FAREWELLS = {"EndTourSpeech": 0, "HereIsTheDoorSpeech": 6, GOODBYE: 7, REFUSED: 3}
"""The speeches that end a visit, with the number of release 1.0's phrase; 0: it has none."""


# ----------------------------------------------------------------------------------------- entries


def _numbers(record: Any, text: str) -> Any:
    return record(*(whole_real(part.strip()) for part in text.split(";")))


RECORDS: Dict[str, Any] = {"Location": Location, "Point": Point}
"""Types of entries that are records, with their class."""

TYPES: Dict[str, str] = {
    **dict.fromkeys(("visitorResponse", "currentExhibit", "description1", "description2"), TEXT),
    "exhibits": PortType("Exhibits", list), "nextExhibit": "int", "leftOutExhibits": "vec_int",
    "targetLocation": PortType("Location", Location, partial(_numbers, Location)),
    "gestureTarget": PortType("Point", Point, partial(_numbers, Point)),
    "questionAskedAt": "double", "attentionSetAt": "double"
}
"""The entries of one visitor: their names and types."""

_DIRECTIONS = {"<": Direction.IN, "?": Direction.IN, ">": Direction.OUT, "=": Direction.INOUT}


def _ports(text: str) -> Iterator[Port]:
    """Yield the ports of a row: ``<`` reads, ``>`` writes, ``=`` does both; ``<port:entry`` if its
    name is another. ``?`` reads a text of the mission file."""
    for word in text.split():
        name, _, entry = word[1:].partition(":")
        entry = entry or name
        default = None if word[0] == "?" else "{@" + entry + "}"
        yield Port(name, TYPES.get(entry, TEXT), _DIRECTIONS[word[0]], default)


# ------------------------------------------------------------------------------ what a node goes by


class TaskFailure(NamedTuple):
    """One failure of a node."""

    node: Node
    cause: Cause
    resource: str


class Decision(NamedTuple):
    """The words about a step that the record has to have: node type and path, the cause of its
    failure, the decision, and the number of the HandleFallBack that made it."""

    node: str
    path: str
    cause: str
    step: str
    handler: int = 0

    def __str__(self) -> str:
        cause = self.cause and f" ({self.cause}):"
        return f"{self.node}{cause} {self.step}".strip()


STEP_BEGINS, STOP_STATE = "begins", "is at stop {number} of {of}, {name}: {state}"
"""The report of a step that asks, and of one that begins, ends or leaves out a stop."""

RETRIED, SUBSTITUTE_USED = "retry {attempt} of {of}", "{substitute} instead"
ENDED = "{outcome} after {attempts} retries, by a rule to {rule}"
FAILED_AGAIN = "failed too, after {attempt} retries"
"""The decisions of a recovery about a step."""


def safe_state(causes: Sequence[Optional[Cause]]) -> Decision:
    """Return what the record has to say of the safe state; ``causes`` are why each of its requests
    failed, None: it was carried out."""
    parts = (f"{request.switches} {'off' if cause is None else cause.value}"
             for request, cause in zip(SAFE_STATE, causes))
    return Decision("", "", "", "what was reached of the safe state is reported: "
                                f"{', '.join(parts)}")


class TaskContext:
    """What the nodes of a mission go by: configuration, phrases, knowledge, policy; failures. The
    requests, answers and messages are those of the execution that it is the base of."""

    def __init__(self, settings: Settings, knowledge: Sequence[str], phrases: files.PhrasesFile,
                 policy: "PolicyTable"):
        """``knowledge`` are the texts of the robot's knowledge files, if it has these."""
        self.settings, self.phrases, self.policy = settings, phrases, policy
        self.robot = robot_of(settings)
        speeches = {number: phrases.speeches[name] for number, name in UTILITY.items()
                    if name in phrases.speeches}
        self.known = files.KnowledgeFiles((), settings.language, speeches, "", "")
        if knowledge:
            environment, culture = knowledge
            self.known = files.knowledge(environment, culture, self.robot.name == RELEASE_1_1)
        self.language = self.known.language
        self.gone: Set[str] = set()  # services that are known to be gone
        self.failures: List[TaskFailure] = []
        # the node for whose failure the robot was left in the safe state last, and when it failed
        self.given_up: Tuple[Optional[Node], int] = (None, 0)
        self.recoveries: List[float] = []
        self.is_spent = False  # the budget, so that a failure of this pass was given up
        self.unrecovered: List[Tuple[Cause, str]] = []  # causes and resources, in this pass
        self._before = 0  # number of failures before this pass

    @property
    def failures_of_pass(self) -> List[Tuple[Cause, str]]:
        """The causes and resources for which the last pass may have failed."""
        newest = self.failures[self._before:][-1:]
        return self.unrecovered + [(failed.cause, failed.resource) for failed in newest]

    @property
    def farewells(self) -> Dict[str, str]:
        """What is said at the end of a tour, by the node that says it."""
        return {node: self.known.phrases.get(number, self.phrases.speeches[node])
                for node, number in FAREWELLS.items()}

    def pause(self, number: int, at: float) -> float:
        """Return the seconds that the next pass waits after a number of passes that failed for a
        cause that persists, the last one at that time."""
        policy, spent = self.policy, self.recoveries[-self.policy.most:]
        usual = min(policy.first_pause * 2**min(number, 12), policy.longest_pause)
        rest = spent[0] + policy.seconds - at if policy.most and spent else math.inf
        failures = self.failures_of_pass
        if failures and self.is_spent and len(spent) >= policy.most and rest > 0.0:
            return min(usual, rest)
        if any(cause is Cause.TYPE_MISMATCH for cause, _ in failures):
            return usual
        return 0.0

    def speech_lasts(self, node: "ReferenceNode", request: Any) -> float:
        """Return the seconds for which a node waits while release 1.0's robot speaks: it answers
        at once in English."""
        is_early = self.robot.name == RELEASE_1_0 and self.language == "English"
        chosen = self.settings.wait_for_speech
        is_description = node.registration_id.startswith("DescribeExhibitSpeech")
        is_awaited = chosen == "all" or chosen == "descriptions" and is_description
        if not (isinstance(request, Say) and is_early and is_awaited):
            return 0.0
        return len(request.text.split()) / self.settings.speech_pace

    def begin_visit(self, board: Blackboard, at: float) -> None:
        """Forget the last visitor: answers and gazes from before do not count."""
        self.is_spent, self.unrecovered, self._before = False, [], len(self.failures)
        for name in TYPES:
            board.unset(name)
        for name in ("questionAskedAt", "attentionSetAt"):
            board.set(name, at, TYPES[name])


# ------------------------------------------------------------------------------ how it is done

Steps = Iterator[None]
"""The course of a node's task: it pauses while there is something to wait for."""


class Fails(Exception):
    """A node fails: the argument is the cause."""


class ReferenceNode(Node):
    """A node whose row has steps."""

    is_foreign = False
    course: Any  # the execution
    spec: Any  # its row
    resource = ""
    _attempt: Any = None  # under way

    def setup(self, **kwargs: Any) -> None:
        """Get what the nodes of the mission go by."""
        self.course = kwargs["course"]

    def steps(self) -> Steps:
        """Do what the row says. Raises Fails, and PortError."""
        yield from self.spec.steps(self) or ()

    def attempt(self) -> Generator[None, None, Optional[Cause]]:
        """Take the steps once; return why they failed, or None."""
        with ExitStack() as self._at_end:
            try:
                yield from self.steps()
            except Fails as failed:
                return failed.args[0]
            except PortError:  # an entry cannot be read or written
                return Cause.MISSING_DATA
        return None

    def go_on(self) -> Result:
        """Begin an attempt, or go on with it."""
        attempt, self._attempt = self._attempt or self.attempt(), None
        try:
            next(attempt)
        except StopIteration as end:
            return self.conclude(end.value)
        self._attempt = attempt
        return RUNNING

    def conclude(self, cause: Optional[Cause]) -> Result:
        """End the node; without a cause it has succeeded."""
        if cause is None:
            self.course.ended(self, "SUCCESS")
            return SUCCESS
        if not self.spec.is_recovery:
            self.course.failures.append(TaskFailure(self, cause, self.resource))
        self.course.ended(self, cause.value)
        return FAILURE

    def halt(self) -> None:
        if self._attempt is not None:
            self._attempt.close()
        self._attempt = None
        super().halt()

    def ask(self, request: Any, is_step: bool = True) -> Any:
        """Return the query of a request, which is dropped with the attempt."""
        query = self.course.ask(self, request, is_step)
        self._at_end.callback(lambda: query.drop(self.course.unix_now))
        return query

    def timer(self, seconds: float) -> Timer:
        """Have the node ticked again after a time, if the attempt lasts so long."""
        timer = self.clock.call_after(seconds, self.wake)
        self._at_end.callback(timer.cancel)
        return timer

    def pause(self, seconds: float) -> Steps:
        """Wait for so many seconds."""
        timer = self.timer(seconds)
        while timer.callback is not None:
            yield

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


class Check(ReferenceNode):
    """A node that is done anew at every tick: a condition, or an action within one tick."""

    def update(self) -> Result:
        return self.go_on()


class Sign(Check):
    """A condition on messages."""


class Task(ReferenceNode, ActionLeaf):
    """An action that may take several ticks."""

    on_start = on_running = ReferenceNode.go_on

    def on_halted(self) -> None:
        self.course.traversal.ended(self, "IDLE")


class ReferenceServiceAction(Task):
    """An action that asks the robot; a recovery may try it again."""


@dataclass(frozen=True)
class Row(NodeSpec):
    """A row of the table: a node type and what it does."""

    steps: Optional[Callable[[Any], Optional[Steps]]] = None


def _require(node: Any, condition: Callable[[Any], Any]) -> None:
    """Fail unless a condition holds."""
    if not condition(node):
        raise Fails(Cause.CONDITION_FALSE)


def ask(node: Any, kind: type, rule: Callable[[Any], Any],
        keep: Callable[[Any, Answer], None] = lambda node, answer: None,
        is_question: bool = False) -> Steps:
    """Ask the robot for what the rule returns; None: nothing has to be asked, as on a robot that
    lacks the service."""
    robot = node.course.robot_for(kind)
    if not robot.serves(kind):
        return
    node.resource = robot.resource(kind)
    wanted = rule(node)
    if wanted is None:
        return
    query = node.ask(wanted)
    while query.result is None:
        yield
    rest = node.course.speech_lasts(node, wanted)
    if rest and query.cause is None:
        yield from node.pause(rest)
    try:
        if is_question:  # one that failed makes older answers invalid too
            node.write(questionAskedAt=node.clock.now())
    finally:
        if query.cause is not None:
            raise Fails(query.cause)
    keep(node, query.result)


# ------------------------------------------------------------------------------- signs of a visitor


class SignRule(NamedTuple):
    """When a message of a topic is the sign; ``wait``: seconds that the condition itself waits,
    None: ``conditionWait``."""

    topic: str
    is_sign: Callable[[Any, Any], bool]  # takes the course and the message's value
    wait: Optional[float] = None
    is_given_up: Callable[[Any, Any], bool] = lambda course, value: False


def _is(state: str, value: int) -> Callable[[Any, Any], bool]:
    return lambda course, status: bool(status == (state, value))


def _has_face(_course: Any, faces: Any) -> bool:
    return len(faces.labels) > 0


def _is_answer(course: Any, text: str) -> bool:
    return spoken(course.phrases, text) is not None


VISITOR, PRESENCE, GAZE, UTTERANCE = "visitor", "presence", "gaze", "utterance"
EVIDENCE: Dict[str, Dict[str, SignRule]] = {
    DOCUMENTS: {
        VISITOR: SignRule(FACES, _has_face), PRESENCE: SignRule(FACES, _has_face, PRESENCE_WAIT),
        GAZE: SignRule(ATTENTION, lambda course, status: bool(
            status == ("seeking", course.settings.mutual_gaze_value))),
        UTTERANCE: SignRule(SPEECH, _is_answer)
    },
    RELEASE_1_0: {
        VISITOR: SignRule(ATTENTION, _is("scanning", 2), math.inf),
        PRESENCE: SignRule(ATTENTION, _is("social", 2), PRESENCE_WAIT),
        GAZE: SignRule(ATTENTION, _is("seeking", 2), math.inf, _is("seeking", 3)),
        UTTERANCE: SignRule(SPEECH, _is_answer, ANSWER_WAIT)
    }
}
PRESENT = ("scanning", 2), ("social", 2), ("social", -1)
EVIDENCE[RELEASE_1_1] = dict(EVIDENCE[RELEASE_1_0])
EVIDENCE[RELEASE_1_1][PRESENCE] = SignRule(
    ATTENTION, lambda course, status: status in PRESENT, PRESENCE_WAIT)
"""Sections 4.6 and table 4 of the document; the statuses of the releases' attention, which in 1.1
says nothing of a visitor in the mode social."""

END_OF_LISTENING = SignRule(
    SPEECH, lambda course, text: is_error(text) or _is_answer(course, text))
"""The end of listening: an answer, or an error of the recognition."""


def _listening(node: Any, topic: str, seconds: float) -> Iterator[bool]:
    """Yield True while the node listens: for so many seconds, and for what began within them."""
    if seconds:
        for _ in node.pause(min(seconds, 1e9)):
            yield True
        node.timer(RESULT_WAIT)
        while node.course.topics.is_hearing(topic):
            yield True


def _sense(node: Any, evidence: SignRule, seconds: float,
           after: Callable[[], float]) -> Generator[None, None, Optional[Sample]]:
    """Return the message that is the sign, the newest one of a state, each one of events, if it
    came after what it answers; None: there was none in time."""
    course, topic = node.course, evidence.topic
    node.resource, listening = course.robot.named(topic), _listening(node, topic, seconds)
    limit = math.inf
    if topic in STATES:
        limit = course.settings.topic_max_age
    is_sign = partial(evidence.is_sign, course)
    while True:
        messages, since, now = course.topics.recent(topic), after(), node.clock.now()
        counting = [sample for sample in messages
                    if sample.arrived > since and now - sample.arrived <= limit]
        sign = next((sample for sample in counting if is_sign(sample.value)), None)
        course.signs.searched(node, topic, messages, since, is_sign, sign is not None)
        if sign is None and any(evidence.is_given_up(course, sample.value) for sample in counting):
            raise Fails(Cause.CONDITION_FALSE)
        if sign is not None or not next(listening, False):
            return sign
        yield


def _see(node: Any, sense: str, since: str = "",
         keep: Callable[[Any, Sample], None] = lambda node, sample: None) -> Steps:
    """Fail without a sign in messages later than the entry ``since``."""
    evidence, wait = EVIDENCE[node.course.robot.name][sense], 0.0
    if not is_asked_again(node):
        wait = node.course.settings.condition_wait if evidence.wait is None else evidence.wait
    sample = yield from _sense(node, evidence, wait,
                               lambda: node.entry(since, -math.inf) if since else -math.inf)
    if sample is None:
        raise Fails(Cause.CONDITION_FALSE)
    keep(node, sample)


def _keep_utterance(node: Any, sample: Sample) -> None:
    """Store a yes or a no; one utterance answers one question."""
    node.write(visitorResponse=spoken(node.course.phrases, sample.value),
               questionAskedAt=sample.arrived)


def _listen(node: Any) -> Steps:
    """Listen for 10 s; an error of the recognition ends that with FAILURE."""
    began = node.clock.now()
    node.write(visitorResponse="")
    sample = yield from _sense(node, END_OF_LISTENING, ANSWER_WAIT, lambda: began)
    text = "" if sample is None else sample.value
    if is_error(text):
        node.write(visitorResponse="")
        raise Fails(Cause.UNUSABLE_ANSWER)
    node.write(visitorResponse=spoken(node.course.phrases, text) or "")


def is_asked_again(node: Any) -> bool:
    """Return whether a reactive control asks a condition again while a later child runs, which
    waits for it."""
    parent = node.parent
    if isinstance(parent, (ReactiveFallback, ReactiveSequence)) and node is not parent.children[-1]:
        return True
    is_condition = isinstance(parent, WhileDoElse) and node is parent.children[0]
    return is_condition or parent is not None and is_asked_again(parent)


def spoken(known: files.PhrasesFile, text: str) -> Optional[str]:
    """Return ``yes`` or ``no`` for what a visitor said, or None: whole words, the longest phrase
    first, no before yes."""
    if text.lstrip().lower().startswith("error"):
        return None
    words = files.words_of(text)
    pairs = sorted(((phrase, meaning) for meaning, synonyms in known.meanings.items()
                    for phrase in synonyms), key=lambda pair: -len(pair[0]))
    meanings, at = set(), 0
    while at < len(words):
        phrase, meaning = next((pair for pair in pairs if words[at:at + len(pair[0])] == pair[0]),
                               (words[:1], ""))
        meanings.add(meaning)
        at += len(phrase)
    return next((meaning for meaning in ("no", "yes") if meaning in meanings), None)


def is_error(text: str) -> bool:
    """Return whether speech recognition reports an error instead of words."""
    return "Error" in text or text.lstrip().lower().startswith("error")


# ----------------------------------------------------------------------------------------- recovery


class PolicyRow(NamedTuple):
    """A line of the policy."""

    node: str
    cause: str
    retries: int
    back_off: float
    then: str


class PolicyTable:
    """The lines of recoveryPolicy.ini, by the number of their words."""

    def __init__(self, text: str):
        lines = [line.split("#")[0].split() for line in text.splitlines()]
        pairs = {words[0]: (float(words[1]), float(words[2])) for words in lines if len(words) == 3}
        self.most, self.seconds = int(pairs["budget"][0]), pairs["budget"][1]
        self.first_pause, self.longest_pause = pairs.get("pause", (10.0, 300.0))
        self.rules = [PolicyRow(words[0], words[1], int(words[2]), float(words[3]), words[4])
                      for words in lines if len(words) == len(PolicyRow._fields)]

    def rule(self, node: Node, cause: Cause) -> PolicyRow:
        """Return the first line that fits."""
        name = node.registration_id
        fitting = (rule for rule in self.rules
                   if rule.node in ("*", name) and rule.cause in ("*", cause.value))
        rule = next(fitting, PolicyRow(name, "*", 0, 0.0, "giveUp"))
        if name in INDISPENSABLE or getattr(node.spec, "is_indispensable", False):
            rule = rule._replace(then="giveUp")
        return rule


def _is_of_mission(node: Node) -> bool:
    """Return whether a node is of the mission vocabulary, with what other packages add to it."""
    return isinstance(node, ReferenceNode) and (not node.is_foreign or hasattr(node.spec, "calls"))


class RecoveryTask(Task):
    """HandleFallBack: does what the policy says about the failure of the nodes before it."""

    remark = ""  # what it recovers from, and what it has done last
    _known = 0  # number of changes of status when it was begun last

    def _failure(self) -> Optional[TaskFailure]:
        """Return the failure with which that of the nodes before this one began."""
        found = origins(steps_before(self), self._known)
        self._known = self.services.changes
        own = [node for node in found if _is_of_mission(node)]
        if not found:
            return None
        node: Any = (own or found)[-1]
        cause, resource = Cause.NO_ANSWER, getattr(node, "resource", "")
        if node.spec.kind is Kind.CONDITION:
            cause = Cause.CONDITION_FALSE
        if node.last_status is RUNNING:
            while not own and node.last_status is RUNNING:  # up to the node that has halted it
                node = node.parent
        elif own:
            return next(each for each in reversed(self.course.failures) if each.node is node)
        elif node.spec.kind is not Kind.CONDITION:
            return None
        return TaskFailure(node, cause, resource)

    def recover(self) -> Steps:
        """Do one thing after the other about that failure."""
        course, self.remark = self.course, ""
        failed = self._failure()
        if failed is None:
            raise Fails(Cause.MISSING_DATA)
        self._take_up(failed)
        outcome = yield from self._repair()
        if self._patience is not None:
            self._patience.cancel()
        outcome = outcome or self._do_without()
        safe_since = self.failed.node, self.failed.node.changed_at
        if outcome == GIVEN_UP and safe_since != course.given_up:
            course.given_up = safe_since
            queries = [self.ask(request) for request in SAFE_STATE]
            while any(query.result is None for query in queries):
                yield
            course.traversal.due.append(safe_state([query.cause for query in queries]))
        rule = "give up" if self._rule.then == "giveUp" else "skip"
        self._decided(ENDED.format(outcome=outcome, attempts=self._retries, rule=rule))
        if outcome == GIVEN_UP:
            course.unrecovered.append((self._cause, self.failed.resource))
            raise Fails(self._cause)

    def _take_up(self, failed: TaskFailure) -> None:
        course, policy, now = self.course, self.course.policy, self.clock.now()
        self.failed, self._cause, self._retries = failed, failed.cause, 0
        self._patience: Optional[Timer] = None
        self.remark = f"{failed.node.registration_id} ({failed.cause.value})"
        self._rule = PolicyRow(failed.node.registration_id, "*", 0, 0.0, "giveUp")
        if _is_of_mission(failed.node):
            self._rule = policy.rule(failed.node, failed.cause)
        course.recoveries = [at for at in course.recoveries if at > now - policy.seconds] + [now]
        if len(course.recoveries) > policy.most:
            self._rule = self._rule._replace(retries=0, then="giveUp")
            course.is_spent = True

    def _decided(self, step: str) -> None:
        self.course.traversal.decided(self.failed.node, step, self._cause.value, self.uid)
        self.remark = str(self.course.traversal.due[-1])

    def _repair(self) -> Generator[None, None, str]:
        """Try the step again, then its substitute; return the outcome, empty: neither helped."""
        step: Any = self.failed.node
        work: Any = None
        while step.parent is self.parent and isinstance(step, ReferenceServiceAction):
            if self._retries < self._rule.retries:
                work, outcome = step, DONE
                self._decided(RETRIED.format(attempt=self._retries + 1, of=self._rule.retries))
                yield from self._wait()
            elif self._rule.then in ("skip", "giveUp") or work not in (None, step):
                break
            else:
                work, outcome = self._substitute(self._rule.then), SUBSTITUTED
                self._decided(SUBSTITUTE_USED.format(substitute=self._rule.then))
            cause = yield from work.attempt()
            if work is step:
                self._retries += 1
            if cause is None:
                return outcome
            again = FAILED_AGAIN.format(attempt=self._retries)
            self.course.traversal.decided(work, again, cause.value)
            if work is step:
                self._cause, self._rule = cause, self.course.policy.rule(step, cause)
        return ""

    def _wait(self) -> Steps:
        """Wait for the pause before a retry, and for a service to return that the tour needs."""
        seconds = self._rule.back_off * 2**self._retries
        due = self.clock.now() + seconds
        yield from self.pause(seconds)
        while self._rule.then == "giveUp" and self.failed.resource in self.course.gone:
            self._patience = self._patience or self.timer(RETURN_WAIT)
            if self._patience.callback is None:
                break
            yield
        if self._patience is None:
            self.course.retried(self.failed.node.registration_id, due)

    def _substitute(self, node_id: str) -> ReferenceNode:
        # the policy was checked when the mission was loaded
        spec = self.course.registry.get(node_id)
        node: Any = spec.factory(node_id)
        node.registration_id, node.spec, node.attributes = node_id, spec, defaults(spec.ports)
        for name in ("full_path", "blackboard", "services", "course"):
            setattr(node, name, getattr(self, name))
        return node

    def _do_without(self) -> str:
        """Note whether the mission goes on without the step; return the outcome."""
        before = (node for step in steps_before(self) for node in step.iterate())
        if any(node.registration_id in OF_A_VISIT for node in before):
            with suppress(PortError):
                if not self._leave_out():
                    self._rule = self._rule._replace(then="giveUp")
        return GIVEN_UP if self._rule.then == "giveUp" else SKIPPED

    def _leave_out(self) -> bool:
        """Note that the exhibit under way is left out; return whether the tour still shows one.

        If it does not, the exhibit goes back to the list, once.
        """
        exhibits, index = self.entry("exhibits", ()), self.entry("nextExhibit", 0) - 1
        is_at_one = 0 <= index < len(exhibits)
        if not is_at_one or self.entry("targetLocation") != exhibits[index].location:
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


# -------------------------------------------------------------------------------------------- rules


def _begin(node: Any) -> None:
    node.course.begin_visit(node.blackboard.root, node.clock.now())


def tell_stop(node: Any, exhibits: Sequence[Exhibit], index: int, state: str) -> None:
    """Have the record say what becomes of a stop."""
    node.course.traversal.decided(node, STOP_STATE.format(
        number=index + 1, of=len(exhibits), name=exhibits[index].name, state=state))


def _has_next(node: Any) -> bool:
    index, exhibits = node.entry("nextExhibit", 0), node.entry("exhibits", ())
    if 0 < index <= len(exhibits):
        tell_stop(node, exhibits, index - 1, OVER)
    return index < len(exhibits)


def _select(node: Any) -> None:
    exhibits, index = node.get_input("exhibits"), node.entry("nextExhibit", 0)
    if index >= len(exhibits):
        raise Fails(Cause.MISSING_DATA)
    exhibit = exhibits[index]
    node.write(nextExhibit=index + 1, currentExhibit=exhibit.name, targetLocation=exhibit.location,
               gestureTarget=exhibit.gesture, description1=exhibit.description1,
               description2=exhibit.description2)
    tell_stop(node, exhibits, index, BEGUN)


def _keep_list(node: Any, answer: Answer) -> None:
    if not answer.exhibits:
        raise Fails(Cause.MISSING_DATA)
    node.write(exhibits=list(answer.exhibits), nextExhibit=0, leftOutExhibits=[])


def _keep_place(node: Any, answer: Answer, has_gesture: bool) -> None:
    if len(answer.exhibits) != 1:
        raise Fails(Cause.UNUSABLE_ANSWER)
    node.write(targetLocation=answer.exhibits[0].location)
    if has_gesture:
        node.write(gestureTarget=answer.exhibits[0].gesture)
    else:
        node.clear_output("gestureTarget")
        node.course.entries.stored(node, "gestureTarget")


def _keep_pressed(node: Any, answer: Answer) -> None:
    course, pressed = node.course, answer.response.strip().lower()
    yes, no = (label.lower() for label in course.phrases.tablet_options)
    meaning = {"2": "no", no: "no", "1": "yes", yes: "yes"}.get(pressed)
    if not course.robot.tells_pressed:  # release 1.0's tablet says only that it is done
        meaning = course.settings.tablet_success_is
    elif meaning is None:
        raise Fails(Cause.MISSING_DATA if pressed in ("", "0") else Cause.UNUSABLE_ANSWER)
    if meaning in ("yes", "no"):
        node.write(visitorResponse=meaning)


def _keep_time(node: Any, _answer: Answer) -> None:
    node.write(attentionSetAt=node.clock.now())


UTILITY = dict(enumerate((
    "PressYesNoSpeech", "FollowMeSpeech", "MaybeAnotherTimeSpeech", "WelcomeSpeech",
    "QueryTourSpeech", "HereIsTheDoorSpeech", "SayGoodByeSpeech"), start=1))
"""The document's speeches that say the same as the utility phrases of release 1.0, by number."""


def _say_utility(node: Any, kind: Any = Say) -> Any:
    number, known = int(argument(node.name)), node.course.known
    if number not in known.phrases:
        raise Fails(Cause.MISSING_DATA)
    return kind(known.phrases[number], known.language)


def _describe(node: Any, part: str = "", kind: Any = Say) -> Any:
    node.get_input("currentExhibit")
    if not part and "part" in node.attributes:
        part = node.get_input("part")
        if part not in ("1", "2", "both"):
            raise Fails(Cause.MISSING_DATA)
    part = part or node.name
    parts = ["1", "2"]
    if part in parts:
        parts = [part]
    text = " ".join(filter(None, (node.entry("description" + each, "") for each in parts)))
    return kind(text, node.course.language) if text else None


def _iconic(node: Any, which: str, kind: Any = PerformGesture) -> Any:
    settings = node.course.settings
    number = {"welcome": settings.welcome_gesture_id, "goodbye": settings.goodbye_gesture_id}[which]
    return kind("iconic", number, settings.gesture_duration)


def _deictic(node: Any, kind: Any = PerformGesture) -> Any:
    target, settings, known = node.get_input("target"), node.course.settings, node.course.known
    if target == NOWHERE:
        return None
    return kind("deictic", settings.deictic_gesture_id, settings.gesture_duration, target,
                arm=known.arm, shape=known.shape)


def _attend(node: Any, mode: str) -> Optional[Request]:
    if mode != "location":
        return SetAttention(mode)
    target = node.get_input("target")
    return None if target == NOWHERE else SetAttention(mode, target)


def _set_mode(node: Any, mode: str) -> Steps:
    """Set a mode; release 1.1 ends a look at a location at once, whatever comes of that."""
    yield from ask(node, SetAttention, lambda node: _attend(node, mode), _keep_time)
    is_ended = mode == "location" and node.course.robot.name == RELEASE_1_1
    if is_ended and _attend(node, mode) is not None:
        query = node.ask(SetAttention("disabled"), is_step=False)
        while query.result is None:
            yield


def _pose(node: Any) -> Request:
    exhibits = node.entry("exhibits", ())
    if not exhibits:
        raise Fails(Cause.MISSING_DATA)
    return SetPose(exhibits[0].location)


def _language(node: Any) -> Optional[Request]:
    if not node.course.settings.asr_enabled:
        return None
    return SetRecognitionLanguage(node.course.language)


def _start(node: Any) -> Steps:
    if node.status is IDLE:  # it is not retried
        _begin(node)
    return ask(node, SetRecognitionLanguage, _language)


# -------------------------------------------------------------------------------------------- table


def _row(node_id: str, node: Callable[[str], Any], ports: str,
         steps: Callable[[Any], Optional[Steps]]) -> Row:
    """Return a row: a node type, the class of its nodes, the entries that they read and write, and
    their steps."""
    kind = Kind.CONDITION if node_id.startswith(("Is", "Has")) else Kind.ACTION
    return Row(node_id, kind, node, tuple(_ports(ports)), is_recovery=node is RecoveryTask,
               steps=steps)


def _asks(node_id: str, kind: type, rule: Callable[[Any], Any], ports: str = "",
          **facts: Any) -> Row:
    return _row(node_id, ReferenceServiceAction, ports, partial(ask, kind=kind, rule=rule, **facts))


def _is_so(node_id: str, condition: Callable[[Any], Any], ports: str = "") -> Row:
    return _row(node_id, Check, ports, partial(_require, condition=condition))


def _sees(node_id: str, sense: str, ports: str = "", **facts: Any) -> Row:
    return _row(node_id, Sign, ports, partial(_see, sense=sense, **facts))


def _phrase(node: Any, phrase: str, variables: Sequence[str]) -> Request:
    text = node.course.phrases.speeches[phrase]
    if variables:  # each stands in braces
        parts = re.split("[{}]", text)
        parts[1::2] = map(node.get_input, parts[1::2])
        text = "".join(parts)
    return Say(text, node.course.language)


def speech(node_id: str, phrase: str, is_question: bool = False,
           variables: Sequence[str] = ()) -> Row:
    """Return the row of a node that says a phrase of the language's file."""
    ports = [">questionAskedAt"] * is_question + ["<" + name for name in variables]
    return _asks(node_id, Say, partial(_phrase, phrase=phrase, variables=variables),
                 " ".join(ports), is_question=is_question)


def _mode(node_id: str, mode: str) -> Row:
    ports = ">attentionSetAt"
    if mode == "location":
        ports += " <target:gestureTarget"
    return _row(node_id, ReferenceServiceAction, ports, partial(_set_mode, mode=mode))


def _look_up(node_id: str, place: str, has_gesture: bool) -> Row:
    return _asks(node_id, QueryKnowledge, lambda node: QueryKnowledge(place),
                 ">targetLocation >gestureTarget",
                 keep=partial(_keep_place, has_gesture=has_gesture))


MODES = {"Disabled": "disabled", "Scanning": "scanning", "Social": "social", "Seek": "seeking",
         "Seeking": "seeking", "Location": "location"}
SPEECHES = ("EndTourSpeech", "FollowMeSpeech", "HereIsTheDoorSpeech", "MaybeAnotherTimeSpeech",
            "SayGoodByeSpeech", "WelcomeSpeech")
QUESTIONS = ("PressYesNoSpeech", "QueryTourSpeech", "SayYesNoSpeech")

ROWS: Tuple[Row, ...] = (
    # D5.4.3, table 4
    *(speech(name, name) for name in SPEECHES), *(speech(name, name, True) for name in QUESTIONS),
    *(_mode(name + "OvertAttentionMode", mode) for name, mode in MODES.items()),
    *(_row(name, RecoveryTask, "<exhibits <targetLocation =nextExhibit =leftOutExhibits",
           RecoveryTask.recover) for name in HANDLERS),
    _asks("DescribeExhibitSpeech", Say, _describe,
          "<currentExhibit <description1 <description2 ?part"),
    _asks("DisableAnimateBehavior", SetAnimation, lambda node: SetAnimation("disabled")),
    _asks("EnableAnimateBehavior", SetAnimation, lambda node: SetAnimation("enabled")),
    _asks("GoodbyeGesture", PerformGesture, partial(_iconic, which="goodbye")),
    _is_so("IsASREnabled", lambda node: node.course.settings.asr_enabled),
    _is_so("IsListWithExhibit", _has_next, "<exhibits <nextExhibit"),
    _sees("IsMutualGazeDiscovered", GAZE, "<attentionSetAt", since="attentionSetAt"),
    _sees("IsVisitorDiscovered", VISITOR),
    _is_so("IsVisitorResponseYes", lambda node: node.entry("visitorResponse") == "yes",
           "<visitorResponse"),
    _sees("IsYesNoUttered", UTTERANCE, ">visitorResponse =questionAskedAt",
          since="questionAskedAt", keep=_keep_utterance),
    _look_up("LookUpEntrance", "entrance", True),
    _look_up("LookUpHome", "home", False),
    _asks("Navigate", GoTo, lambda node: GoTo(node.get_input("target")), "<target:targetLocation"),
    _asks("PerformDeicticGesture", PerformGesture, _deictic, "<target:gestureTarget"),
    _asks("PressYesNoDialogue", Prompt, lambda node: Prompt(node.course.phrases.tablet_options),
          ">visitorResponse", keep=_keep_pressed),
    _asks("RetrieveListOfExhibits", QueryKnowledge, lambda node: QueryKnowledge("exhibits"),
          ">exhibits >nextExhibit >leftOutExhibits", keep=_keep_list),
    _row("SelectExhibit", Check,
         "<exhibits =nextExhibit >currentExhibit >targetLocation >gestureTarget >description1 "
         ">description2 ?stop", _select),
    _row("START_OF_TREE", Check, "", _begin),
    _asks("WelcomeGesture", PerformGesture, partial(_iconic, which="welcome")),
    # other names and extensions
    speech("SayGoodBye", "SayGoodByeSpeech"),
    *(_asks("DescribeExhibitSpeech_" + part, Say, partial(_describe, part=part),
            "<currentExhibit <description" + part) for part in "12"),
    # release 1.0: the argument is the node's name
    _row("StartOfTree", ReferenceServiceAction, "", _start),
    _asks("SayText", Say, _say_utility, ">questionAskedAt", is_question=True),
    _row("SetOvertAttentionMode", ReferenceServiceAction, ">attentionSetAt <target:gestureTarget",
         lambda node: _set_mode(node, argument(node.name))),
    _asks("SetAnimateBehavior", SetAnimation, lambda node: SetAnimation(argument(node.name))),
    _asks("SetSpeechEvent", SetRecognition,
              lambda node: SetRecognition(argument(node.name) in ("true", "enabled"))),
    _asks("PerformIconicGesture", PerformGesture, lambda node: _iconic(node, argument(node.name))),
    _asks("SetRobotPose", SetPose, _pose, "<exhibits"),
    _asks("ResetRobotPose", SetPose, _pose, "<exhibits"),
    _look_up("RetrieveInitialLocation", "home", False),
    _row("GetVisitorResponse", Task, ">visitorResponse", _listen),
    _is_so("HasVisitorResponded", lambda node: node.entry("visitorResponse"), "<visitorResponse"),
    _sees("IsVisitorPresent", PRESENCE),
    # release 1.1: the request is the goal of an action
    _asks("SayTextAsync", SayGoal, partial(_say_utility, kind=SayGoal), ">questionAskedAt",
          is_question=True),
    _asks("DescribeExhibitSpeechAsync", SayGoal, partial(_describe, part="both", kind=SayGoal),
          "<currentExhibit <description1 <description2"),
    _asks("NavigateAsync", GoToGoal, lambda node: GoToGoal(node.get_input("target")),
          "<target:targetLocation"),
    _asks("PerformDeicticGestureAsync", PerformGestureGoal,
          partial(_deictic, kind=PerformGestureGoal), "<target:gestureTarget"),
    _asks("PerformIconicGestureAsync", PerformGestureGoal,
          lambda node: _iconic(node, argument(node.name), PerformGestureGoal)),
    _row("GetVisitorResponseAsync", Task, ">visitorResponse", _listen),
)
"""The table: a node type, what it asks or goes by, its rule, and the entries it reads and writes.
"""
