"""The verdict of a test: what the controller recorded against what the simulated nodes received and what was expected.

``QUESTIONS`` decide, among them: did each pass end as the visitor's behaviour predicts, was every exhibit and every leaf
of the mission seen to that had to be, and is every recorded failure one that was injected, and the other way round?
"""
from collections import Counter
from typing import Callable, Dict, Iterable, Iterator, List, NamedTuple, Optional, Sequence, Set, Tuple

from behavior_controller import leaves
from behavior_controller.interface import Sense
from behavior_controller.interface.records import Exhibit, GoTo
from behavior_controller.leaves import data
from behavior_controller.mission_spec import MissionSpec
from behavior_controller.text import clean

from unit_tests.facts import Event, Facts, Pass, count, of, passes
from unit_tests.journal import Line
from unit_tests.matching import Matching
from unit_tests.visitor import DECLINES, ENGAGES, EXHIBITS_BEFORE_LEAVING, LEAVES, NO_GAZE, SILENT, UNCLEAR


def _nodes(fits: Callable[[MissionSpec], bool]) -> Set[str]:
    return {spec.id for spec in leaves.mission_specs() if fits(spec)}


ASKING = _nodes(lambda spec: spec.writes(data.VISITOR_RESPONSE.name))
"""Mission nodes through which a visitor can say no."""

TOUR = (_nodes(lambda spec: spec.writes(data.EXHIBITS.name)),
        _nodes(lambda spec: spec.writes(data.CURRENT_EXHIBIT.name)), _nodes(lambda spec: GoTo in spec.calls))
"""Mission nodes of which one of each kind leads to exhibits."""

GAZE = _nodes(lambda spec: Sense.GAZE in spec.listens)
"""Mission nodes that a visitor who never looks back fails; that ends the pass, for no visitor is there to speak to."""

DOES = {ENGAGES: "engages", SILENT: "is silent", UNCLEAR: "is unclear", DECLINES: "declines", LEAVES: "leaves",
        NO_GAZE: "never looks back"}

GOODBYE = _nodes(lambda spec: spec.is_farewell)

JUDGED_BY = {"robotNavigation", "textToSpeech", "knowledgeBase", "overtAttention"}
"""Simulated nodes whose journals tell which exhibits were seen to."""


class Verdict(NamedTuple):
    """The result: PASSED if there is nothing that speaks against it. ``answers``: each question and the objections."""

    answers: Tuple[Tuple[str, Tuple[str, ...]], ...]
    praise: str

    @property
    def objections(self) -> Tuple[str, ...]:
        """All that speaks against it."""
        return tuple(objection for _, objections in self.answers for objection in objections)

    @property
    def passed(self) -> bool:
        return not self.objections

    def __str__(self) -> str:
        """Return the verdict in lines."""
        if self.passed:
            return "PASSED: {}".format(self.praise)
        return "FAILED: {}".format("\n        ".join(self.objections))


def judge(facts: Facts) -> Verdict:
    answers = tuple((question, tuple(map(clean, answer(facts)))) for question, answer in QUESTIONS)
    ended = len(of(facts.events, "PassFinished"))
    calls = [line for line in facts.journal if line.call > 0]
    praise = "{} as a visitor who {} should; {} of {} calls were made to fail, and all of these are on record".format(
        count(ended, "pass ended", "passes ended"), DOES[facts.behaviour],
        sum(line.fault is not None for line in calls), len(calls))
    if facts.real:
        praise += "; not simulated, so what they were asked is not judged: {}".format(", ".join(sorted(facts.real)))
    return Verdict(answers, praise)


# ------------------------------------------------------------------------------------------------------ start and end


def _ended(facts: Facts) -> Iterator[str]:
    """Object to a controller that did not start its mission or did not end as it should."""
    finished = of(facts.events, "RunFinished")
    ended = len(of(facts.events, "PassFinished"))
    ending = _ending(facts.exit_code)
    if facts.cut_off:
        yield facts.cut_off
    elif not of(facts.events, "RunStarted"):
        yield "the controller {} before it started its mission".format(ending)
    elif not finished:
        yield "the controller {} in the middle of its mission, in pass {}".format(ending, ended + 1)
    elif facts.exit_code != finished[-1]["exit_code"]:
        yield "the controller {}, but announced exit code {}".format(ending, finished[-1]["exit_code"])
    elif ended != facts.runs:
        yield "the controller made {} instead of {}".format(count(ended, "pass", "passes"), facts.runs)


def _ending(exit_code: Optional[int]) -> str:
    if exit_code is not None and exit_code < 0:
        return "was ended by signal {}".format(-exit_code)
    return "ended with exit code {}".format(exit_code)


def _outcomes(facts: Facts) -> Iterator[str]:
    """Object to passes that did not end as the visitor's behaviour predicts; once to those of one cause."""
    expected = "FAILURE" if _is_never_met(facts) or _is_deserted(facts) else "SUCCESS"
    alike: Dict[object, List[Pass]] = {}
    for a_pass in passes(facts):
        if a_pass.outcome != expected:
            alike.setdefault(_reasons(_given_up(a_pass.events)) or a_pass.number, []).append(a_pass)
    for group in alike.values():
        events = [event for a_pass in group for event in a_pass.events]
        yield "{} ended with {}; a visitor who {} should bring {} ({}{})".format(
            _numbers(group), group[0].outcome, DOES[facts.behaviour], expected, _last_failure(events), _hint(*group))


def _numbers(group: Sequence[Pass]) -> str:
    if len(group) == 1:
        return "pass {}".format(group[0].number)
    return "{} passes, from {} to {},".format(len(group), group[0].number, group[-1].number)


def _is_never_met(facts: Facts) -> bool:
    """Whether the mission waits for a gaze that this visitor never returns. All other visitors it has an answer to."""
    return facts.behaviour == NO_GAZE and bool(GAZE & _mission_nodes(facts))


def _is_deserted(facts: Facts) -> bool:
    """Whether the visitor leaves before the last exhibit of a mission that seeks visitors: the tour is broken off."""
    nodes = _mission_nodes(facts)
    return (facts.behaviour == LEAVES and _has_tour(nodes) and bool(GAZE & nodes)
            and len(facts.knowledge.exhibits) > EXHIBITS_BEFORE_LEAVING)


def _has_tour(nodes: Set[str]) -> bool:
    return all(kind & nodes for kind in TOUR)


def _mission_nodes(facts: Facts) -> Set[str]:
    """Return the names of the mission's nodes; none if it did not start."""
    started = of(facts.events, "RunStarted")
    return {node for _, node in started[-1]["leaves"]} if started else set()


def _last_failure(events: Sequence[Event]) -> str:
    """Return what the recovery gave up and why, if not for the policy's rule; or else what failed last."""
    given_up = _given_up(events)
    failed = [event for event in of(events, "LeafFinished") if event["status"] == "FAILURE"]
    if given_up:
        nodes = Counter(event["node"] for event in given_up)
        return "; ".join(_reasons(given_up) + ("given up: " + ", ".join(
            node if number == 1 else "{} ({} times)".format(node, number) for node, number in nodes.items()),))
    if failed:
        return "failed last: {}: {}".format(failed[-1]["node"], failed[-1]["failure"]["message"])
    return "without a failure of a mission node"


def _given_up(events: Sequence[Event]) -> List[Event]:
    return [event for event in of(events, "Recovered") if not event["success"]]


def _reasons(given_up: Sequence[Event]) -> Tuple[str, ...]:
    """Return what kept recoveries from the policy's rule, each once: the record has it after the rule and a colon."""
    found = dict.fromkeys(event["policy"].partition(": ")[2] for event in given_up)
    return tuple(reason for reason in found if reason)


def _hint(*group: Pass) -> str:
    """Return what may have made a good controller fail."""
    faults = sum(line.fault is not None for a_pass in group for line in a_pass.lines)
    if faults:
        return "; {} made to fail in {}".format(count(faults, "call was", "calls were"),
                                                "this pass" if len(group) == 1 else "these passes")
    return "; if the visitor's messages came too late for the mission, a higher arrivalRate helps"


# ------------------------------------------------------------------------------------------------------------ exhibits


def _exhibits(facts: Facts) -> Iterator[str]:
    """Object to exhibits that were left out, or visited though no visitor wanted a tour."""
    nodes = _mission_nodes(facts)
    if not _has_tour(nodes) or facts.real & JUDGED_BY:
        return
    for a_pass in passes(facts):
        if _is_never_met(facts):
            yield from _unwanted(a_pass)
            yield from _never_sought(a_pass)
        elif _is_deserted(facts):
            yield from _left_out(a_pass, facts, EXHIBITS_BEFORE_LEAVING)
            yield from _waved_after(a_pass)
        elif a_pass.outcome != "SUCCESS":
            continue  # why it failed is told already
        elif facts.behaviour in (DECLINES, SILENT, UNCLEAR) and ASKING & nodes:
            yield from _unwanted(a_pass)
        else:
            yield from _left_out(a_pass, facts, len(facts.knowledge.exhibits))


def _unwanted(a_pass: Pass) -> Iterator[str]:
    drives = sum(line.node == "robotNavigation" for line in a_pass.lines)
    if drives:
        yield "pass {}: the robot was sent to {} without a visitor who wants a tour".format(
            a_pass.number, count(drives, "place", "places"))


def _never_sought(a_pass: Pass) -> Iterator[str]:
    """Object to a pass that failed before the visitor's gaze was sought, without a fault that excuses it."""
    sought = any(line.node == "overtAttention" and line.content["state"] == "seeking" for line in a_pass.lines)
    if not sought and not any(line.fault for line in a_pass.lines):
        yield "pass {}: the robot did not seek the visitor's gaze".format(a_pass.number)


def _waved_after(a_pass: Pass) -> Iterator[str]:
    """Object to a goodbye to a visitor who has left."""
    told = sorted({event["node"] for event in of(a_pass.events, "LeafFinished")} & GOODBYE)
    if told:
        yield "pass {}: the visitor had left, and the robot went on to {}".format(a_pass.number, ", ".join(told))


def _left_out(a_pass: Pass, facts: Facts, count_of_exhibits: int) -> Iterator[str]:
    """Object to exhibits that the robot did not get to, or did not describe to a visitor who was there."""
    stops = _stops(a_pass.lines)
    for exhibit in facts.knowledge.exhibits[:count_of_exhibits]:
        stop = stops.get((exhibit.location.x, exhibit.location.y))
        if stop is None:
            yield "pass {}: the robot did not get to exhibit {}".format(a_pass.number, exhibit.name)
        elif not _is_described(exhibit, stop) and not _could_not_seek(stop):
            yield "pass {}: exhibit {} was not described{}".format(a_pass.number, exhibit.name, _hint(a_pass))


def _stops(lines: Sequence[Line]) -> Dict[Tuple[float, float], List[Line]]:
    """Return for each place (x, y) that the robot got to what it did there: all requests until the next drive."""
    stops: Dict[Tuple[float, float], List[Line]] = {}
    stop: List[Line] = []
    for line in lines:
        if line.node == "robotNavigation":
            stop = []
            if line.done:
                stops[line.content["goal_x"], line.content["goal_y"]] = stop
        else:
            stop.append(line)
    return stops


def _is_described(exhibit: Exhibit, stop: Sequence[Line]) -> bool:
    texts = {line.content["message"] for line in stop if line.node == "textToSpeech"}
    return {exhibit.description1, exhibit.description2} <= texts


def _could_not_seek(stop: Sequence[Line]) -> bool:
    """Whether every attempt to seek the visitor's gaze was made to fail, so that no visitor was found."""
    tries = [line for line in stop
             if line.node == "overtAttention" and line.call > 0 and line.content["state"] == "seeking"]
    return bool(tries) and not any(line.done for line in tries)


def _objections(facts: Facts) -> Iterator[str]:
    """Object to requests that make no sense to the node that received them."""
    for line in facts.journal:
        if line.objection is not None:
            yield "{} received a request that makes no sense: {}".format(line.resource, line.objection)


# ------------------------------------------------------------------------------------------------------------ coverage


def _unreached(facts: Facts) -> Iterator[str]:
    """Object to leaves that the same mission reaches with a robot that never fails, unless a recovery gave up."""
    if facts.rehearsal is None or facts.real or any(not event["success"] for event in of(facts.events, "Recovered")):
        return
    if not of(facts.events, "PassFinished"):
        return  # told already
    for path in sorted(facts.rehearsal.reached - reached(facts)):
        yield "the leaf {} was not reached; a visitor who {} should bring the robot there".format(
            path, DOES[facts.behaviour])


def reached(facts: Facts) -> Set[str]:
    """Return the paths of the mission leaves that ran."""
    return {event["path"] for event in of(facts.events, "LeafFinished")}


QUESTIONS: Tuple[Tuple[str, Callable[[Facts], Iterable[str]]], ...] = (
    ("the controller ran the mission to its end", _ended),
    ("each pass ended as the visitor's behaviour predicts", _outcomes),
    ("each exhibit was seen to, and no visitor had an unwanted tour", _exhibits),
    ("each leaf was reached that should be", _unreached),
    ("each request made sense to the node that got it", _objections),
    ("the failures on record are those that were injected", lambda facts: Matching(facts).objections()),
)
