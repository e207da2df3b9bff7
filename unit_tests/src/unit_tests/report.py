"""The verdict of a test: what the controller recorded against what the simulated nodes received and what was expected.

Three questions decide: did each pass end as the visitor's behaviour predicts, was every exhibit seen to that had to be,
and is every failure that the controller recorded one that was injected, and the other way round?
"""
import datetime
import itertools
from collections import Counter
from typing import Any, Dict, Iterator, List, NamedTuple, Optional, Sequence, Tuple

from behavior_controller.gateway import Cause

from unit_tests.exhibits import Knowledge
from unit_tests.faults import EXCEPTION, REFUSED, UNANSWERED
from unit_tests.journal import Line
from unit_tests.robot import SERVICES
from unit_tests.visitor import DECLINES, ENGAGES, EXHIBITS_BEFORE_LEAVING, LEAVES, SILENT

Event = Dict[str, Any]

CAUSE_OF = {REFUSED: Cause.REFUSED.value, EXCEPTION: Cause.HANDLER_EXCEPTION.value, UNANSWERED: Cause.NO_ANSWER.value}
"""How the controller must record each kind of fault."""

ASKING = {"IsYesNoUttered", "PressYesNoDialogue"}
"""Mission nodes through which a visitor can say no."""

TOUR = {"RetrieveListOfExhibits", "SelectExhibit", "Navigate"}
"""Mission nodes that together lead to exhibits."""

RECOVERY = {"HandleFallBack", "HandleFallback"}

SAFE_STATE = ("overtAttention", "animateBehavior")
"""Simulated nodes that are asked to be quiet when a recovery is given up; the record does not tell how that went."""


class Facts(NamedTuple):
    """What is known at the end of a test."""

    events: Sequence[Event]  # the controller's record
    journal: Sequence[Line]
    exit_code: Optional[int]  # of the controller; None: it did not end
    behaviour: str
    runs: int
    knowledge: Knowledge
    cut_off: str = ""  # why nobody waited for the end


class Verdict(NamedTuple):
    """The result: PASSED if there is nothing that speaks against it."""

    objections: Tuple[str, ...]
    praise: str

    @property
    def passed(self) -> bool:
        """Whether the test passed."""
        return not self.objections

    def __str__(self) -> str:
        """Return the verdict in lines."""
        if self.passed:
            return "PASSED: {}".format(self.praise)
        return "FAILED: {}".format("\n        ".join(self.objections))


def judge(facts: Facts) -> Verdict:
    """Return the verdict."""
    objections = list(itertools.chain(_ended(facts), _outcomes(facts), _exhibits(facts), _objections(facts),
                                      Matching(facts).objections()))
    passes = len(_of(facts.events, "PassFinished"))
    faults = sum(line.fault is not None for line in facts.journal)
    return Verdict(tuple(objections), "{} as a visitor who {} should; {} of {} calls were made to fail, and all of these "
                   "are on record".format(_many(passes, "pass ended", "passes ended"), _DOES[facts.behaviour], faults,
                                          sum(line.call > 0 for line in facts.journal)))


_DOES = {ENGAGES: "engages", SILENT: "is silent", DECLINES: "declines", LEAVES: "leaves"}


def _of(events: Sequence[Event], kind: str) -> List[Event]:
    return [event for event in events if event["event"] == kind]


def _many(number: int, one: str, more: str) -> str:
    return "{} {}".format(number, one if number == 1 else more)


# ------------------------------------------------------------------------------------------------------ start and end


def _ended(facts: Facts) -> Iterator[str]:
    """Object to a controller that did not start its mission or did not end as it should."""
    finished = _of(facts.events, "RunFinished")
    passes = len(_of(facts.events, "PassFinished"))
    ending = _ending(facts.exit_code)
    if facts.cut_off:
        yield facts.cut_off
    elif not _of(facts.events, "RunStarted"):
        yield "the controller {} before it started its mission".format(ending)
    elif not finished:
        yield "the controller {} in the middle of its mission, in pass {}".format(ending, passes + 1)
    elif facts.exit_code != finished[-1]["exit_code"]:
        yield "the controller {}, but announced exit code {}".format(ending, finished[-1]["exit_code"])
    elif passes != facts.runs:
        yield "the controller made {} instead of {}".format(_many(passes, "pass", "passes"), facts.runs)


def _ending(exit_code: Optional[int]) -> str:
    if exit_code is not None and exit_code < 0:
        return "was ended by signal {}".format(-exit_code)
    return "ended with exit code {}".format(exit_code)


def _outcomes(facts: Facts) -> Iterator[str]:
    """Object to passes that did not end in SUCCESS: whatever a visitor does, the mission has an answer to it."""
    began = 0.0
    for event in _of(facts.events, "PassFinished"):
        if event["outcome"] != "SUCCESS":
            yield "pass {} ended with {}; a visitor who {} should bring SUCCESS{}".format(
                event["number"], event["outcome"], _DOES[facts.behaviour], _given_up(facts, began, event["time"]))
        began = event["time"]


def _given_up(facts: Facts, began: float, ended: float) -> str:
    """Return which failures of a pass the recovery gave up, as an explanation."""
    names = [event["node"] for event in _of(facts.events, "Recovered")
             if began < event["time"] <= ended and not event["success"]]
    return " (given up: {})".format(", ".join(names)) if names else ""


# ------------------------------------------------------------------------------------------------------------ exhibits


def _exhibits(facts: Facts) -> Iterator[str]:
    """Object to exhibits that were left out, or visited though nobody wanted a tour."""
    started = _of(facts.events, "RunStarted")
    nodes = {node for _, node in started[-1]["leaves"]} if started else set()
    if not TOUR <= nodes:
        return
    began = 0.0
    for event in _of(facts.events, "PassFinished"):
        lines = [line for line in facts.journal if began < line.time <= event["time"]]
        began = event["time"]
        if facts.behaviour in (DECLINES, SILENT) and ASKING & nodes:
            yield from _unwanted(lines, event["number"])
        else:
            yield from _left_out(lines, event["number"], facts)


def _unwanted(lines: Sequence[Line], number: int) -> Iterator[str]:
    drives = sum(line.node == "robotNavigation" for line in lines)
    if drives:
        yield "pass {}: the robot was sent to {} without a visitor who wants a tour".format(
            number, _many(drives, "place", "places"))


def _left_out(lines: Sequence[Line], number: int, facts: Facts) -> Iterator[str]:
    """Object to exhibits that the robot did not drive to, or drove to and did not describe to a visitor who was there."""
    goals = {(line.content["goal_x"], line.content["goal_y"]) for line in lines
             if line.node == "robotNavigation" and line.done}
    texts = {line.content["message"] for line in lines if line.node == "textToSpeech"}
    for index, exhibit in enumerate(facts.knowledge.exhibits):
        if (exhibit.location.x, exhibit.location.y) not in goals:
            yield "pass {}: the robot did not get to exhibit {}".format(number, exhibit.name)
        elif facts.behaviour == LEAVES and index >= EXHIBITS_BEFORE_LEAVING:
            continue
        elif not {exhibit.description1, exhibit.description2} <= texts:
            yield "pass {}: exhibit {} was not described; a visitor's gaze can come too late: then a higher " \
                  "arrivalRate helps".format(number, exhibit.name)


def _objections(facts: Facts) -> Iterator[str]:
    """Object to requests that make no sense to the node that received them."""
    for line in facts.journal:
        if line.objection is not None:
            yield "{} received a request that makes no sense: {}".format(line.resource, line.objection)


# ------------------------------------------------------------------------------------------------- injected = recorded


class Matching:
    """Which injected fault each recorded failure comes from.

    A leaf's failure comes from the newest fault of its service before it. What the recovery asked for (its attempts, the
    safe state) and what was halted on the way stands in the record as one event for several calls, so the faults of that
    service between the leaf's failure and that event belong to it.
    """

    def __init__(self, facts: Facts):
        self._facts = facts
        self._open: List[Line] = [line for line in facts.journal if line.fault is not None]
        self._failed_at: Dict[str, float] = {}  # path of a leaf -> when it failed last
        self._not_injected: List[Event] = []
        for event in facts.events:
            if event["event"] == "LeafFinished":
                self._leaf(event)
            elif event["event"] == "Recovered":
                self._recovery(event)

    def objections(self) -> Iterator[str]:
        """Object to failures that were not injected, and to faults without a failure on record."""
        for event in self._not_injected:
            yield "{} failed and nothing was injected there: {}: {}".format(
                event["node"], event["failure"]["cause"], event["failure"]["message"])
        for line in self._open:
            yield "call {} of {} was made to fail ({}) and is not on record as a failure".format(
                line.call, line.resource, line.fault)

    def _leaf(self, event: Event) -> None:
        resource = event["resource"]
        if event["status"] == "IDLE":
            self._take(resource, self._failed_at.get(event["path"], 0.0), event["time"], 1)
        elif event["status"] == "FAILURE" and event["node"] not in RECOVERY:
            self._failed_at[event["path"]] = event["time"]
            if not self._is_natural(event) and not self._take_fault(event):
                self._not_injected.append(event)

    def _is_natural(self, event: Event) -> bool:
        """Whether the failure is the mission's way to say no: a condition that is false, a visitor who presses nothing."""
        cause = event["failure"]["cause"]
        return cause == Cause.CONDITION_FALSE.value or (
            cause == Cause.MISSING_DATA.value and event["node"] == "PressYesNoDialogue"
            and self._facts.behaviour == SILENT)

    def _take_fault(self, event: Event) -> bool:
        """Match the newest fault before a leaf's failure, if it is of the right kind."""
        failure = event["failure"]
        for line in reversed(self._open):
            if line.resource == failure["resource"] and line.time <= event["time"]:
                if CAUSE_OF[line.fault or ""] != failure["cause"]:
                    return False
                self._open.remove(line)
                return True
        return False

    def _recovery(self, event: Event) -> None:
        began = self._failed_at.get(event["path"], 0.0)
        self._take(event["failure"]["resource"], began, event["time"], event["attempts"])
        if not event["success"]:
            for node in SAFE_STATE:
                for line in [line for line in self._open if line.node == node]:
                    self._take(line.resource, began, event["time"], 1)

    def _take(self, resource: str, after: float, until: float, most: int) -> None:
        """Match up to ``most`` faults of a service between two moments."""
        found = [line for line in self._open if line.resource == resource and after < line.time <= until]
        for line in found[:most]:
            self._open.remove(line)


# -------------------------------------------------------------------------------------------------------------- the file


def failure_lines(facts: Facts) -> List[str]:
    """Return one line for each failure: time, node, path, topic or service, cause and message, with tabs between them."""
    return ["\t".join((_clock(event["time"]), event["node"], event["path"], event["failure"]["resource"] or "-",
                       event["failure"]["cause"], " ".join(event["failure"]["message"].split())))
            for event in _of(facts.events, "LeafFinished") if event["status"] == "FAILURE" and event["failure"]]


def summary_lines(facts: Facts) -> List[str]:
    """Return the counts: of each mission node that ran, each simulated node, and what the recovery did."""
    ran, failed = Counter(), Counter()  # type: Counter, Counter
    for event in _of(facts.events, "LeafFinished"):
        ran[event["node"]] += 1
        failed[event["node"]] += event["status"] == "FAILURE"
    lines = ["{:<28} {:>6} {:>8}".format("mission node", "ran", "failed")]
    lines += ["{:<28} {:>6} {:>8}".format(node, ran[node], failed[node]) for node in sorted(ran)]
    lines += ["", "{:<28} {:>6} {:>8}".format("simulated node", "calls", "injected")]
    for node in SERVICES:
        calls = [line for line in facts.journal if line.node == node and line.call > 0]
        lines.append("{:<28} {:>6} {:>8}".format(node, len(calls), sum(line.fault is not None for line in calls)))
    recovered = _of(facts.events, "Recovered")
    going_on = sum(event["success"] for event in recovered)
    return lines + ["", "recoveries: {}; {} went on, {} gave up".format(
        len(recovered), going_on, len(recovered) - going_on)]


def write(facts: Facts, title: str) -> Tuple[Verdict, str]:
    """Return the verdict and the text of the report."""
    verdict = judge(facts)
    failures = failure_lines(facts)
    lines = ["# " + title, "# time\tnode\tpath\ttopic or service\tcause\tmessage"] + failures
    false = sum("\t{}\t".format(Cause.CONDITION_FALSE.value) in line for line in failures)
    lines += ["", "{}; {} of them conditions that were false for a while".format(
        _many(len(failures), "failure", "failures"), false), ""] + summary_lines(facts) + ["", str(verdict)]
    return verdict, "\n".join(lines) + "\n"


def _clock(seconds: float) -> str:
    return datetime.datetime.fromtimestamp(seconds).isoformat(timespec="milliseconds")
