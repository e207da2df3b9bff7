"""The verdict of a test: the controller's behaviour against the injected faults and the visitor's signs.

What is believed: the journal, which the simulated nodes write, tells every request, every injected fault and every
message. Of the controller's record only the built-in controls are believed, which the traces of BehaviorTree.CPP prove,
and when things happened; what it says of leaves and recoveries is held against the journal and the policy:

* ``matching``: each recorded failure was injected, and each injected fault is recorded;
* ``evidence``: each condition held if a message told so in time, and only then;
* ``recoveries``: each recovery tried, left out and gave up what the policy prescribes for its failures.

Where all of that is right, a pass ended as it had to. Where nothing kept it from going its way (``_obstacles``), it also
has to end, and to get about, as the visitor's behaviour predicts. A mission whose record has no tree, and what real
nodes do, is judged by the rest. ``QUESTIONS`` are all that decides.
"""
from typing import Callable, Dict, Iterable, Iterator, List, NamedTuple, Optional, Sequence, Set, Tuple

from behavior_controller import leaves
from behavior_controller.bt.registry import Kind
from behavior_controller.interface import Sense
from behavior_controller.interface.records import Exhibit, GoTo, Say
from behavior_controller.leaves import data
from behavior_controller.mission_spec import MissionSpec
from behavior_controller.settings import YES
from behavior_controller.text import clean

from unit_tests.evidence import Wait, Watch
from unit_tests.facts import Event, Facts, Pass, Tree, count, of, passes, started
from unit_tests.journal import Line
from unit_tests.matching import AWAY, Matching
from unit_tests.recoveries import GIVEN_UP, SPECS, Recoveries, Round, rounds
from unit_tests.stage import TIMED_OUT
from unit_tests.visitor import DECLINES, ENGAGES, EXHIBITS_BEFORE_LEAVING, LEAVES, LONG_WAIT, NO_GAZE, SILENT, UNCLEAR


def _nodes(fits: Callable[[MissionSpec], bool]) -> Set[str]:
    return {spec.id for spec in leaves.mission_specs() if fits(spec)}


ASKING = _nodes(lambda spec: spec.writes(data.VISITOR_RESPONSE.name))
"""Mission nodes through which a visitor can say no."""

TOUR = (_nodes(lambda spec: spec.writes(data.EXHIBITS.name)),
        _nodes(lambda spec: spec.writes(data.CURRENT_EXHIBIT.name)), _nodes(lambda spec: GoTo in spec.calls))
"""Mission nodes that lead to exhibits, one of each kind."""

GAZE = _nodes(lambda spec: Sense.GAZE in spec.listens)
"""Mission nodes that a visitor who never looks back fails; that ends the pass, for no visitor is there to speak to."""

MISSING = GAZE | _nodes(lambda spec: Sense.PRESENCE in spec.listens)
"""Mission nodes that notice in the middle of the tour that the visitor has left."""

SPEAKING = _nodes(lambda spec: Say in spec.calls)

DOES = {ENGAGES: "engages", SILENT: "is silent", UNCLEAR: "is unclear", DECLINES: "declines", LEAVES: "leaves",
        NO_GAZE: "never looks back"}

JUDGED_BY = {"robotNavigation", "textToSpeech", "knowledgeBase", "overtAttention"}
"""Simulated nodes whose journals tell which exhibits were seen to."""


class Verdict(NamedTuple):
    """The result: PASSED without objections. ``answers``: each question and its objections."""

    answers: Tuple[Tuple[str, Tuple[str, ...]], ...]
    praise: str

    @property
    def objections(self) -> Tuple[str, ...]:
        """The objections to all questions."""
        return tuple(objection for _, objections in self.answers for objection in objections)

    @property
    def passed(self) -> bool:
        return not self.objections

    def __str__(self) -> str:
        """Return the verdict as lines of text."""
        if self.passed:
            return "PASSED: {}".format(self.praise)
        return "FAILED: {}".format("\n        ".join(self.objections))


class Case:
    """The facts of a test, and what follows from them."""

    def __init__(self, facts: Facts):
        self.facts = facts
        self.tree = Tree(facts.events)
        self.matching = Matching(facts)
        self.watch = Watch(facts, self.tree)
        self.rounds = list(rounds(facts.events))
        self.passes = [(each, tuple(self._obstacles(each))) for each in passes(facts)]
        """Each pass and its obstacles."""

    def _obstacles(self, a_pass: Pass) -> Iterator[str]:
        """Yield the obstacles that a correct controller cannot overcome, first those that may have ended the pass.

        What it goes by then is the policy and the mission.
        """
        rounds = [each for each in self.rounds if _is_within(each.fallback["time"], a_pass)]
        lost = [each for each in rounds if each.outcome != GIVEN_UP and self.is_lost(each)]
        recovered = {id(failure) for each in rounds for failure in each.failures}
        for each in [each for each in rounds if each.outcome == GIVEN_UP]:
            yield _told(each)
        for event in self.matching.injected:
            if _is_within(event["time"], a_pass) and id(event) not in recovered:
                yield "{} failed ({})".format(event["node"], event["failure"]["cause"])
        for wait in reversed(self.watch.waits):
            if _is_within(wait.ended, a_pass) and not wait.held and wait.sign is None and self._is_given(wait, a_pass):
                seconds = wait.ended - wait.began
                yield "{} saw nothing{}".format(wait.node, " in {:.1f} s".format(seconds) if seconds >= 0.05 else "")
        yield from map(_told, lost)

    def is_lost(self, each: Round) -> bool:
        """Return whether more than one step is left undone: a recovery gave up, or skipped a whole SubTree."""
        is_one_step = bool(each.failures) and self.tree.are_neighbours(each.failures[0]["uid"], each.fallback["uid"])
        return each.outcome == GIVEN_UP or not each.helped and not is_one_step

    def _is_given(self, wait: Wait, a_pass: Pass) -> bool:
        """Whether the visitor gives such a sign, if only the messages come."""
        behaviour = self.facts.behaviour
        drives = sum(line.node == "robotNavigation" and line.done and line.time < wait.ended for line in a_pass.lines)
        if behaviour == LEAVES and drives > EXHIBITS_BEFORE_LEAVING:
            return False
        return not (wait.sense is Sense.GAZE and behaviour == NO_GAZE
                    or wait.sense is Sense.UTTERANCE and behaviour in (SILENT, UNCLEAR))


def _told(each: Round) -> str:
    return "{} was {} ({})".format(each.recovered["node"], each.outcome, each.recovered["failure"]["cause"])


def _is_within(time: float, a_pass: Pass) -> bool:
    return a_pass.began < time <= a_pass.ended


def judge(facts: Facts) -> Verdict:
    case = Case(facts)
    answers = tuple((question, tuple(map(clean, answer(case)))) for question, answer in QUESTIONS)
    ended = len(case.passes)
    calls = [line for line in facts.journal if line.call]
    praise = "{} as a visitor who {} should; {} of {} calls were made to fail, and all of these are on record".format(
        count(ended, "pass ended", "passes ended"), DOES[facts.behaviour],
        sum(line.fault is not None for line in calls), len(calls))
    if _is_mute(facts):
        praise += "; no yes can reach the robot (asrEnabled false, tabletSuccessIs done), so no tour is expected"
    praise += "".join("; pass {} ended with FAILURE, as it had to: {}".format(a_pass.number, obstacles[0])
                      for a_pass, obstacles in case.passes if obstacles and a_pass.outcome == "FAILURE")
    if _waits_without_a_sign(case):
        praise += "; at last {} waited for a sign of the visitor that never came: {}".format(
            case.watch.endless[0].node, facts.cut_off)
    if case.rounds and not case.tree:
        praise += "; the record shows no tree, so the recoveries are not judged"
    if facts.real:
        praise += "; not simulated, so what they were asked is not judged: {}".format(", ".join(sorted(facts.real)))
    return Verdict(answers, praise)


# ------------------------------------------------------------------------------------------------------ start and end


def _ended(case: Case) -> Iterator[str]:
    """Object to a controller that did not start its mission or did not end as it should."""
    facts = case.facts
    finished = of(facts.events, "RunFinished")
    ended = len(of(facts.events, "PassFinished"))
    ending = _ending(facts.exit_code)
    if facts.cut_off:
        if not _waits_without_a_sign(case):
            yield facts.cut_off
    elif not of(facts.events, "RunStarted"):
        yield "the controller {} before it started its mission".format(ending)
    elif not finished:
        yield "the controller {} in the middle of its mission, in pass {}".format(ending, ended + 1)
    elif facts.exit_code != finished[-1]["exit_code"]:
        yield "the controller {}, but announced exit code {}".format(ending, finished[-1]["exit_code"])
    elif ended != facts.runs:
        yield "the controller made {} instead of {}".format(count(ended, "pass", "passes"), facts.runs)


def _waits_without_a_sign(case: Case) -> bool:
    """Whether the mission has long waited for a sign of the visitor and none came: then it may wait without end."""
    return case.facts.cut_off.startswith(TIMED_OUT.split("{")[0]) and any(
        wait.sign is None and wait.ended - wait.began > LONG_WAIT for wait in case.watch.endless)


def _ending(exit_code: Optional[int]) -> str:
    if exit_code is not None and exit_code < 0:
        return "was ended by signal {}".format(-exit_code)
    return "ended with exit code {}".format(exit_code)


def _outcomes(case: Case) -> Iterator[str]:
    """Object to passes that did not end as their tree, or, with nothing in the way, as the visitor's behaviour predicts."""
    expected = _expected_outcome(case.facts)
    for a_pass, obstacles in case.passes:
        root = [letter for tick in of(a_pass.events, "Tick") for uid, letter in tick["changes"] if uid == 1][-1:]
        if root in (["S"], ["F"]) and root[0] != a_pass.outcome[:1]:
            yield "pass {} ended with {}, and its tree did not".format(a_pass.number, a_pass.outcome)
        elif a_pass.outcome != expected and not obstacles:
            yield "pass {} ended with {}; a visitor who {} should bring {} ({})".format(
                a_pass.number, a_pass.outcome, DOES[case.facts.behaviour], expected, _last_failure(a_pass.events))


def _taken_over(case: Case) -> Iterator[str]:
    """Object to leaves whose result is not what the tree went on with."""
    told: Dict[int, List[str]] = {}
    for event in case.facts.events:
        if event["event"] == "LeafFinished" and event["status"] != "IDLE":
            told.setdefault(event["uid"], []).append(event["status"])
        elif event["event"] == "Tick":
            for uid in told:
                yield from _differs(case.tree.types.get(uid, ""), told[uid], [
                    letter for number, letter in event["changes"] if number == uid and letter in "SF"])
            told.clear()


def _differs(node: str, told: Sequence[str], letters: Sequence[str]) -> Iterator[str]:
    for status, letter in zip(told, letters):
        if status[:1] != letter and node in SPECS and SPECS[node].kind is Kind.ACTION:
            yield "{} ended with {}, and the mission went on as if it had not".format(node, status)


def _expected_outcome(facts: Facts) -> str:
    """Return how a pass should end; without a tour, that is for the mission to say: as it does in the rehearsal."""
    if _is_never_met(facts) or _is_deserted(facts):
        return "FAILURE"
    if (_is_declined(facts) or _is_mute(facts)) and facts.rehearsal is not None:
        return facts.rehearsal.outcome
    return "SUCCESS"


def _is_declined(facts: Facts) -> bool:
    return facts.behaviour in (DECLINES, SILENT, UNCLEAR) and bool(ASKING & _mission_nodes(facts))


def _is_never_met(facts: Facts) -> bool:
    """Whether the mission waits for a gaze that this visitor never returns. All other visitors it has an answer to."""
    return facts.behaviour == NO_GAZE and bool(GAZE & _mission_nodes(facts))


def _is_deserted(facts: Facts) -> bool:
    """Whether the visitor leaves before the last exhibit of a mission that seeks visitors: the tour is broken off."""
    nodes = _mission_nodes(facts)
    return (facts.behaviour == LEAVES and not _is_mute(facts) and _has_tour(nodes) and bool(MISSING & nodes)
            and len(facts.knowledge.exhibits) > EXHIBITS_BEFORE_LEAVING)


def _is_mute(facts: Facts) -> bool:
    """Whether the visitor can answer by nothing but a tablet that does not tell what was pressed."""
    settings = started(facts).get("settings", {})
    return not facts.interface.tells_pressed and settings.get("asrEnabled") is False \
        and settings.get("tabletSuccessIs") != YES


def _has_tour(nodes: Set[str]) -> bool:
    return all(kind & nodes for kind in TOUR)


def _mission_nodes(facts: Facts) -> Set[str]:
    """Return the names of the mission's nodes; none if it did not start."""
    return {node for _, node in started(facts).get("leaves", ())}


def _last_failure(events: Sequence[Event]) -> str:
    failed = [event for event in of(events, "LeafFinished") if event["status"] == "FAILURE"]
    if failed:
        return "failed last: {}: {}".format(failed[-1]["node"], failed[-1]["failure"]["message"])
    return "without a failure of a mission node"


# ------------------------------------------------------------------------------------------------------------ exhibits


def _exhibits(case: Case) -> Iterator[str]:
    """Object to exhibits that were left out, or visited though no visitor wanted a tour."""
    facts = case.facts
    if not _has_tour(_mission_nodes(facts)) or facts.real & JUDGED_BY or _is_mute(facts):
        return
    for a_pass, obstacles in case.passes:
        if _is_never_met(facts) or _is_declined(facts):
            yield from _unwanted(a_pass)
        elif _is_deserted(facts):
            yield from _left_out(case, a_pass, bool(obstacles), EXHIBITS_BEFORE_LEAVING)
            yield from _waved_after(a_pass)
        elif a_pass.outcome == "SUCCESS" or obstacles:  # else its failure is reported already
            yield from _left_out(case, a_pass, bool(obstacles), len(facts.knowledge.exhibits))


def _unwanted(a_pass: Pass) -> Iterator[str]:
    drives = sum(line.node == "robotNavigation" for line in a_pass.lines)
    if drives:
        yield "pass {}: the robot was sent to {} without a visitor who wants a tour".format(
            a_pass.number, count(drives, "place", "places"))


def _waved_after(a_pass: Pass) -> Iterator[str]:
    """Object to a goodbye to a visitor who has left."""
    told = sorted({event["node"] for event in of(a_pass.events, "LeafFinished") if _is_goodbye(event)})
    if told:
        yield "pass {}: the visitor had left, and the robot went on to {}".format(a_pass.number, ", ".join(told))


def _is_goodbye(event: Event) -> bool:
    name = event["path"].rpartition("/")[2]
    return any(spec.id == event["node"] and spec.says_goodbye(name) for spec in leaves.mission_specs())


def _left_out(case: Case, a_pass: Pass, is_excused: bool, number: int) -> Iterator[str]:
    """Object to exhibits that the robot did not get to, or did not describe to a visitor who was there.

    With an excuse, the tour may have ended early, a drive may have failed, and a visit may have been given up.
    """
    visits, stops = _visits(a_pass), _stops(a_pass.lines)
    for index, exhibit in enumerate(case.facts.knowledge.exhibits[:number]):
        place = exhibit.location.x, exhibit.location.y
        visit = visits[index] if index < len(visits) else None
        is_over = is_excused and (visit is None or _is_broken_off(case, visit))
        if place not in stops and not (is_over and (visit is None or not _is_elsewhere(case, visit, place))):
            yield "pass {}: the robot did not get to exhibit {}".format(a_pass.number, exhibit.name)
        elif place in stops and not _is_described(exhibit, stops[place]) and not (
                is_over or visit and _is_mute_for_a_while(case, visit)):
            yield "pass {}: exhibit {} was not described".format(a_pass.number, exhibit.name)


def _is_elsewhere(case: Case, visit: Tuple[float, float], place: Tuple[float, float]) -> bool:
    """Whether the robot was sent to another exhibit than the one that the visit was to."""
    knowledge = case.facts.knowledge
    others = {(each.location.x, each.location.y) for each in knowledge.exhibits} - {place}
    others -= {(knowledge.home.location.x, knowledge.home.location.y)}
    return any(
        _place(line) in others for line in case.facts.journal
        if line.node == "robotNavigation" and visit[0] < line.time <= visit[1])


def _place(drive: Line) -> Tuple[float, float]:
    return drive.content["goal_x"], drive.content["goal_y"]


def _visits(a_pass: Pass) -> List[Tuple[float, float]]:
    """Return from when until when the robot was about each exhibit that it chose."""
    chosen = [event["time"] for event in of(a_pass.events, "LeafFinished") if event["status"] == "SUCCESS"
              and event["node"] in SPECS and SPECS[event["node"]].writes(data.CURRENT_EXHIBIT.name)]
    return list(zip(chosen, chosen[1:] + [a_pass.ended]))


def _is_broken_off(case: Case, visit: Tuple[float, float]) -> bool:
    """Whether a visit as a whole was left out or given up, the visitor was not found in it, or the pass failed in it."""
    began, ended = visit
    return any(began < each.fallback["time"] <= ended and case.is_lost(each) for each in case.rounds) or any(
        began < wait.ended <= ended and not wait.held and wait.sign is None for wait in case.watch.waits) or any(
        a_pass.outcome == "FAILURE" and ended == a_pass.ended for a_pass, _ in case.passes)


def _is_mute_for_a_while(case: Case, visit: Tuple[float, float]) -> bool:
    """Whether words of a visit could not reach the robot's speech: its node had crashed and was not back."""
    return any(visit[0] < event["time"] <= visit[1] and event["failure"]["cause"] in AWAY and event["node"] in SPEAKING
               for event in case.matching.injected)


def _stops(lines: Sequence[Line]) -> Dict[Tuple[float, float], List[Line]]:
    """Return for each place (x, y) that the robot got to what it did there: all requests until the next drive.

    A tour may pass a place again.
    """
    stops: Dict[Tuple[float, float], List[Line]] = {}
    stop: List[Line] = []
    for line in lines:
        if line.node == "robotNavigation":
            stop = stops.setdefault(_place(line), []) if line.done else []
        else:
            stop.append(line)
    return stops


def _is_described(exhibit: Exhibit, stop: Sequence[Line]) -> bool:
    texts = {line.content["message"] for line in stop if line.node == "textToSpeech"}
    return {text for text in (exhibit.description1, exhibit.description2) if text} <= texts


def _objections(case: Case) -> Iterator[str]:
    """Object to requests that make no sense to the node that received them."""
    for line in case.facts.journal:
        if line.objection is not None:
            yield "{} received a request that makes no sense: {}".format(line.resource, line.objection)


# ------------------------------------------------------------------------------------------------------------ coverage


def _unreached(case: Case) -> Iterator[str]:
    """Object to leaves that the same mission reaches with a robot that never fails, if a pass had nothing in its way."""
    facts = case.facts
    if facts.rehearsal is None or facts.real or all(obstacles for _, obstacles in case.passes):
        return  # without a pass, that is reported already
    for path in sorted(facts.rehearsal.reached - reached(facts)):
        yield "the leaf {} was not reached; a visitor who {} should bring the robot there".format(
            path, DOES[facts.behaviour])


def reached(facts: Facts) -> Set[str]:
    """Return the paths of the mission leaves that ran."""
    return {event["path"] for event in of(facts.events, "LeafFinished")}


QUESTIONS: Tuple[Tuple[str, Callable[[Case], Iterable[str]]], ...] = (
    ("the controller ran the mission to its end", _ended),
    ("each pass ended as it should", _outcomes),
    ("each exhibit was seen to, and no visitor had an unwanted tour", _exhibits),
    ("each leaf was reached that should be", _unreached),
    ("each request made sense to the node that got it", _objections),
    ("the failures on record are those that were injected", lambda case: case.matching.objections()),
    ("each recovery did what the policy prescribes", lambda case: Recoveries(case.facts, case.tree, case.rounds).objections()),
    ("each leaf's result is what the mission went on with", _taken_over),
    ("the mission saw of its visitor what there was to see", lambda case: case.watch.objections()),
)
