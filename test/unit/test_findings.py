"""The kinds of findings: what in a play is one, and what is none. Whole missions with each mistake
are in test_flawed_missions."""
import itertools
from types import SimpleNamespace

import pytest
from msgspec.structs import replace

from behavior_controller.bt.loader.document import parse
from behavior_controller.config import settings
from behavior_controller.run.events import (
    Answered, Asked, LeafFinished, LeafSummary, Noticed, PassFinished, PassStarted, Recovered,
    StepStarted, Tick)
from behavior_controller.run.record.tree_shown import shown
from behavior_controller.robot.gateway import Cause, Failure
from behavior_controller.robot.requests import (
    Answer, GoTo, Location, PerformGesture, Prompt, QueryKnowledge, Say, SetAnimation,
    SetAttention)

from behavior_controller.simulation.rehearsal import findings
from behavior_controller.simulation.rehearsal.findings import Play, RobotCall
from behavior_controller.simulation.journal import JournalEntry
from behavior_controller.simulation.rehearsal.play import BUSY, RunResult, START, LoadedMission
from behavior_controller.simulation.rehearsal.plays import Outcome, Scenario, Search
from behavior_controller.simulation.rehearsal.summary import Survey
from behavior_controller.simulation.visitor import BEHAVIOURS, DECLINES, ENGAGES

STAGE = LoadedMission(settings.defaults(), [
    parse("""<root BTCPP_format="4"><BehaviorTree ID="M"><Fallback name="all">
    <Sequence name="some"><IsVisitorDiscovered name="see"/><Navigate name="drive"/>
    <PressYesNoDialogue name="press"/></Sequence>
    <Sequence name="others"><SayGoodByeSpeech name="bye"/><IsMutualGazeDiscovered name="look"/>
    <WelcomeSpeech name="hi"/><SelectExhibit name="take"/><SelectExhibit name="again"/>
    <LookUpHome name="where"/>
    <DescribeExhibitSpeech name="tell" part="1"/><PerformDeicticGesture name="point"/>
    <QueryTourSpeech name="ask"/><IsYesNoUttered name="hear"/><IsVisitorResponseYes name="agreed"/>
    <PerformDeicticGesture name="next" target="{@nextExhibit}"/>
    <PerformDeicticGesture name="answer" target="{@visitorResponse}"/></Sequence>
    <Parallel name="both"><Navigate name="left"/><Navigate name="right"/></Parallel>
    <HandleFallBack name="help"/></Fallback></BehaviorTree></root>""")])
TREE = STAGE.mission.tree
UIDS = {node.name: node.uid for node in TREE.nodes}
HOME = STAGE.world.knowledge.home.location
TOUR = [GoTo(exhibit.location._replace(theta_deg=7.0))
        for exhibit in STAGE.world.knowledge.exhibits]
BACK = GoTo(HOME._replace(theta_deg=7.0))  # how the robot stands there does not matter
ON, OFF, STIR = SetAttention("scanning"), SetAttention("disabled"), SetAnimation("enabled")
NO_DATA, REFUSED = Failure(Cause.MISSING_DATA, "no {x}", "/x"), Failure(Cause.REFUSED, "no", "/x")
FAULT = JournalEntry(START, "a node", "/x", 1, {}, fault="refused")
NUMBERS = itertools.count(1)


def leaf(name, status="SUCCESS", failure=None, seconds=0.0):
    """Return the events of the end of a leaf."""
    letter = {"SUCCESS": "S", "FAILURE": "F", "IDLE": "-"}[status]
    uid = UIDS[name]
    return [Tick(0.0, True, [(uid, "R")]),
            LeafFinished(uid, "", "path of " + name, status, "", seconds, failure),
            Tick(0.0, True, [(uid, letter)])]


def asked(request, name="drive", result=Answer()):
    """Return the events of a request with its answer; without a result it stays open."""
    number = next(NUMBERS)
    service = STAGE.settings.interface.service(type(request)).name
    events = [StepStarted(UIDS[name], "", "path of " + name, "driving", "", 0.0, False),
              Asked(number, service, request)]
    return events + ([Answered(number, result)] if result is not None else [])


def answered(step):
    """Return the events of the answer to a request that is open."""
    number = next(event.call for event in step if isinstance(event, Asked))
    return [Answered(number, Answer())]


def ended(outcome="SUCCESS"):
    return [PassFinished(1, outcome, 100.0)]


def recovered(outcome, resource="/x", cause=Cause.REFUSED, of=None):
    """Return the events of a recovery, ``of`` the leaf of that name."""
    failure = replace(REFUSED, resource=resource, cause=cause)
    path = "x" if of is None else TREE.nodes[UIDS[of] - 1].full_path
    uid = UIDS["help"]
    return [Recovered("Navigate", path, failure, "-", 0, outcome != "given up", outcome, "", uid),
            LeafFinished(uid, "", TREE.nodes[uid - 1].full_path, "SUCCESS", "", 0.0, None)]


def play(*steps, behaviour=ENGAGES, faults=0, calm=None, times=None, **played):
    """Return a play of 100 s with these steps: from 1 s after the beginning, a second apart, if
    ``times`` does not say when."""
    moments = times or [float(number) for number in range(1, len(steps) + 1)]
    events = [(START, shown(TREE)), (START, PassStarted(1, START))]
    events += [(START + at + number / 1000, event) for at, step in zip(moments, steps)
               for number, event in enumerate(step)]
    given = dict(events=events, journal=[], exit_code=0, cut_off="", errors=[], reached=frozenset(),
                 waiting=(), seconds=100.0, asked=(), presence=[(START, True)])
    return Play(STAGE, RunResult(**dict(given, **played)), behaviour, faults, calm)


def waiting(*names):
    return {"waiting": tuple(UIDS[name] for name in names), "exit_code": None}


def found(seen):
    return [(kind, TREE.nodes[uid - 1].name, what) for kind, uid, what in findings.findings(seen)]


def kinds(seen):
    return [kind for kind, _, _ in findings.findings(seen)]


@pytest.mark.parametrize(
    "seen, expected",
    [
        (play(), []),
        (play(exit_code=None), [("waits-for-ever", "all", "after 100 s it still waits here")]),
        (play(cut_off=BUSY, **waiting("see", "drive")),
         [("busy-loop", "drive", "it is ticked again and again and waits for nothing")]),
        (play(leaf("hi"), **waiting("drive")),
         [("waits-for-ever", "drive", "after 100 s it still waits here")]),
        (play(errors=[(0, "ZeroDivisionError: no")], exit_code=4),
         [("exception", "all", "ZeroDivisionError: no")]),
        (play([Noticed("warning", "so what")],
              errors=[(UIDS["hi"], "Exception in node 'hi' [x]: no")]),
         [("exception", "hi", "Exception in node 'hi' [x]: no")]),
        (play(leaf("drive", "FAILURE", NO_DATA)), [("missing-data", "drive", "no {x}")]),
        (play(leaf("drive", "FAILURE", NO_DATA), leaf("drive", "FAILURE", NO_DATA)),
         [("missing-data", "drive", "no {x}")]),
        (play(leaf("drive", "FAILURE", REFUSED), leaf("drive", "FAILURE")), []),
        (play(leaf("press", "FAILURE", NO_DATA)), []),  # nothing was pressed
        (play(asked(Say(""), "hi"), journal=[FAULT, FAULT._replace(
            time=START + 1.5, fault=None, objection="there is no text",
            resource="/textToSpeech/say_text")]),
         [("senseless-request", "hi", "/textToSpeech/say_text refuses it: there is no text")])])
def test_what_goes_wrong_in_a_play_is_found(seen, expected):
    assert found(seen) == expected


@pytest.mark.parametrize("at, expected", [(81.0, [("endless", "hi")]),
                                          (79.0, [("waits-for-ever", "drive")])])
def test_a_mission_that_goes_on_asking_is_endless(at, expected):
    seen = play(asked(Say("x"), "hi"), times=[at], **waiting("drive"))
    assert [(kind, name) for kind, name, _ in found(seen)] == expected


@pytest.mark.parametrize("calm, result, expected", [
    (play(ended()), REFUSED, ["retries-for-ever"]), (play(ended()), Answer(), ["endless"]),
    (play(exit_code=None), REFUSED, ["endless"]), (None, REFUSED, ["endless"])])
def test_what_a_fault_makes_endless_is_a_retry(calm, result, expected):
    seen = play(asked(Say("x"), "hi", result), times=[90.0], faults=1, calm=calm, exit_code=None)
    assert kinds(seen) == expected


def test_a_retry_is_told_with_the_number_of_its_requests():
    seen = play(asked(Say("x"), "hi", REFUSED), asked(Say("x"), "bye", REFUSED),
                asked(Say("x"), "hi", REFUSED), asked(OFF, "hi", REFUSED),
                times=[1.0, 2.0, 3.0, 90.0], faults=1, calm=play(ended()), exit_code=None)
    assert found(seen) == [
        ("retries-for-ever", "hi", "after 3 requests in 100 s it still tries again")]


@pytest.mark.parametrize("cause, resource, faults, is_found", [
    (Cause.TYPE_MISMATCH, "/x", 0, True), (Cause.TYPE_MISMATCH, "/x", 1, True),
    (Cause.TYPE_MISMATCH, "/faceDetection/data", 0, True), (Cause.UNUSABLE_ANSWER, "/x", 0, True),
    (Cause.UNUSABLE_ANSWER, "/x", 1, False),
    (Cause.UNUSABLE_ANSWER, "/faceDetection/data", 0, False), (Cause.REFUSED, "/x", 0, False)])
def test_a_declaration_that_does_not_fit_is_an_exception(cause, resource, faults, is_found):
    seen = play(leaf("drive", "FAILURE", Failure(cause, "no", resource)), faults=faults)
    assert found(seen) == [("exception", "drive", "no")] * is_found


def test_a_recovery_with_nothing_before_it_misses_its_data():
    assert found(play(recovered("given up", of="help"))) == [("missing-data", "help", "no")]
    assert found(play(recovered("given up", of="drive"))) == []


@pytest.mark.parametrize("seen, is_for_visitor", [
    (play(**waiting("see")), True), (play(**waiting("look")), False),
    (play(**waiting("others", "see")), True), (play(**dict(waiting("see"), exit_code=0)), False),
    (play(cut_off=BUSY, **waiting("see")), False),
    (play(leaf("see", "FAILURE"), **waiting("drive")), True),
    (play(leaf("see"), **waiting("see")), False),
    (play(asked(Say("x"), "hi"), times=[90.0], **waiting("see")), False),
    (play(leaf("hi", "FAILURE"), **waiting("drive")), False)])
def test_a_robot_may_wait_for_its_first_visitor(seen, is_for_visitor):
    assert findings.waits_for_a_visitor(seen) is is_for_visitor
    assert not is_for_visitor or findings.findings(seen) == []


@pytest.mark.parametrize("first, second, expected", [
    (asked(TOUR[0], "left", None), asked(TOUR[1], "right"), ["shares-a-body"]),
    (asked(TOUR[0], "left"), asked(TOUR[1], "right"), []),
    (asked(TOUR[0], "left", None), asked(Say("x"), "hi"), []),
    (asked(TOUR[0], "left", None), asked(TOUR[1], "help"), []),
    (asked(TOUR[0], "left", None), asked(TOUR[1], "left"), []),
    # the safe state, which no leaf asks for
    (asked(TOUR[0], "left", None), asked(TOUR[1])[1:], []),
    (asked(QueryKnowledge("home"), "left", None), asked(QueryKnowledge("home"), "right"), [])])
def test_one_service_carries_out_one_request_at_a_time(first, second, expected):
    late = [] if isinstance(first[-1], Answered) else answered(first)
    assert kinds(play(first, second, late)) == expected


def unrecovered(*more, outcome="FAILURE", other=None, calm="SUCCESS"):
    return play(leaf("hi", "FAILURE", replace(REFUSED, resource="/y")),
                leaf("bye", "FAILURE", REFUSED), *more, ended(outcome), faults=2,
                calm=play(ended(calm)), journal=[FAULT, FAULT,
                                                 FAULT._replace(resource="/y", fault=other)])


def test_a_service_whose_faults_end_the_pass_without_a_recovery_is_unrecovered():
    told = [("unrecovered", "bye", "its failure ends the pass, and no recovery handles it")]
    assert found(unrecovered()) == found(unrecovered(recovered("skipped", "/y"))) == told
    # of several the first
    assert found(unrecovered(leaf("drive", "FAILURE", REFUSED))) == told
    for other in (unrecovered(other="refused"), unrecovered(calm="FAILURE"),
                  unrecovered(outcome="SUCCESS"), unrecovered(recovered("given up"))):
        assert findings.findings(other) == []


@pytest.mark.parametrize("own, most, seconds, is_spent", [
    # the policy's budget: 30 in 600 s
    (15, 31, 599.0, False), (16, 31, 599.0, True), (31, 31, 599.0, True),
    (30, 30, 599.0, False), (31, 31, 600.0, False), (31, 31, 601.0, False)])
def test_a_budget_is_spent_by_the_mission_if_most_of_it_went_where_no_fault_was(
        own, most, seconds, is_spent):
    rounds = [recovered("done", "/calm" if at < own else "/x") for at in range(most)]
    seen = play(*rounds, times=[at * seconds / 30 for at in range(most)], journal=[FAULT])
    assert found(seen) == is_spent * [
        ("budget-spent", "help",
         "more than 30 recoveries in 600 s: whatever fails from here on is given up")]


NOT_HOME = Location(HOME.x, HOME.y + 1.5, HOME.theta_deg)


@pytest.mark.parametrize("requests, outcome, expected", [
    ([OFF, ON, BACK], "FAILURE", ["drives-switched-on", "left-on"]),
    ([BACK, ON], "FAILURE", ["left-on"]), ([ON, OFF, BACK], "FAILURE", []),
    ([OFF, ON], "FAILURE", []), ([ON, BACK], "", ["drives-switched-on"]),
    ([OFF, STIR, BACK], "FAILURE", ["drives-switched-on", "left-on"]),
    ([BACK, TOUR[0]], "FAILURE", ["not-home"]), ([TOUR[0], BACK], "FAILURE", []),
    ([TOUR[0]], "", []), ([], "FAILURE", []), ([GoTo(NOT_HOME)], "FAILURE", ["not-home"]),
    ([TOUR[0], QueryKnowledge("home")], "FAILURE", ["not-home"]),
    ([QueryKnowledge("home"), TOUR[0]], "FAILURE", ["not-home"]),
    ([TOUR[0], QueryKnowledge("exhibits")], "FAILURE", ["not-home"]),
    ([BACK, BACK], "FAILURE", ["drives-twice"]), ([BACK, TOUR[0], BACK], "FAILURE", [])])
def test_how_a_tour_leaves_the_robot(requests, outcome, expected):
    steps = [asked(request) for request in requests]
    assert kinds(play(*steps, *[ended(outcome)] * bool(outcome))) == expected


@pytest.mark.parametrize("outcome, at, cause, is_reported", [
    ("given up", 5.0, Cause.REFUSED, True), ("given up", 0.5, Cause.REFUSED, False),
    ("given up", 5.0, Cause.CONDITION_FALSE, False), ("skipped", 5.0, Cause.REFUSED, False)])
def test_after_a_service_was_given_up_the_operator_takes_the_robot_home(outcome, at, cause,
                                                                        is_reported):
    steps = sorted([(1.0, asked(TOUR[0])), (at, recovered(outcome, cause=cause))],
                   key=lambda step: step[0])
    seen = play(*[step for _, step in steps], ended("FAILURE"), times=[at for at, _ in steps] + [9])
    assert kinds(seen) == ([] if is_reported else ["not-home"])


@pytest.mark.parametrize("steps, expected", [
    ([asked(BACK, "drive", None), leaf("drive", "IDLE")], ["abandoned-drive"]),
    ([asked(BACK, "drive", None), leaf("drive", "IDLE"), asked(BACK)], []),
    ([asked(TOUR[0], "drive", None), leaf("drive", "IDLE"), asked(BACK)], ["abandoned-drive"]),
    ([asked(BACK)], []), ([asked(BACK, "drive", None)], [])])
def test_a_drive_that_is_halted_for_good_is_abandoned(steps, expected):
    assert kinds(play(*steps)) == expected


def test_a_drive_may_be_halted_for_another_if_something_is_wrong():
    steps = [asked(TOUR[0], "drive", None), leaf("drive", "IDLE"), asked(BACK)]
    assert kinds(play(*steps, faults=1)) == kinds(play(*steps, presence=[(START, False)])) == []


@pytest.mark.parametrize("presence, seconds", [
    ([(1.0, True), (30.0, False)], 17), ([(1.0, True), (10.0, False), (12.0, True), (20.0, False)],
                                         27), ([(1.0, True)], None),
    ([(1.0, True), (47.5, False)], None), ([(1.0, False), (46.0, True)], None),
    ([(1.0, True), (30.0, False), (48.0, True)], 17), ([], 47)])
def test_a_goodbye_is_for_a_visitor_who_is_there_when_it_begins(presence, seconds):
    started, _, done = leaf("bye")
    seen = play([started], [done], leaf("hi"), times=[47.0, 50.0, 60.0],
                presence=[(START + at, is_here) for at, is_here in presence])
    assert found(seen) == ([] if seconds is None else [
        ("goodbye-to-nobody", "bye", "the visitor had left {} s before".format(seconds))])


@pytest.mark.parametrize("steps, behaviour, expected", [
    ([ended()], ENGAGES, ["left-out"]), ([ended("FAILURE")], ENGAGES, []),
    ([ended()], DECLINES, []), ([recovered("skipped"), ended()], ENGAGES, []),
    ([recovered("given up"), ended()], ENGAGES, []),
    ([recovered("done"), ended()], ENGAGES, ["left-out"])])
def test_an_exhibit_is_left_out_of_a_tour_that_succeeds(steps, behaviour, expected):
    tour = [step for drive in TOUR for step in (leaf("take"), asked(drive), TOLD)]
    seen = play(*tour[:12], asked(BACK), leaf("bye"), *steps, behaviour=behaviour)
    assert kinds(seen) == expected and len(seen.stops) == 4
    whole = play(*tour, asked(BACK), leaf("bye"), *steps, behaviour=behaviour)
    assert kinds(whole) == [] and len(whole.stops) == 5


@pytest.mark.parametrize("steps, expected", [
    ([leaf("take"), leaf("take")], "take"), ([leaf("take"), leaf("take"), leaf("again")], "again"),
    ([leaf("again"), leaf("take"), leaf("take")], "take"), ([leaf("take"), leaf("again")], None),
    # the visitor is asked meanwhile
    ([leaf("press"), leaf("take"), leaf("take")], "take"),
    ([leaf("take"), leaf("press"), leaf("take")], None),
    ([leaf("take"), leaf("take"), leaf("press")], None),
    ([leaf("take"), leaf("press", "FAILURE"), leaf("take")], "take")])
def test_stops_that_are_taken_one_after_the_other_are_all_to_be_shown(steps, expected):
    seen = play(*steps, asked(TOUR[0], "left"), asked(BACK), ended())
    names = ", ".join(exhibit.name for exhibit in STAGE.world.knowledge.exhibits[1:])
    assert [each for each in found(seen) if each[0] != "not-shown"] == (
        [] if expected is None else [
            ("left-out", expected,
             "the visitor says yes, and the robot does not drive to " + names)])


TOLD = asked(Say("x"), "hi")


def question(mark):
    started, finished, done = leaf("ask")
    return [started, replace(finished, summary=LeafSummary("asked", "so?", mark)), done]


@pytest.mark.parametrize("steps, is_shown", [
    ([TOLD], False), ([leaf("take")], False), ([leaf("take"), TOLD], True),
    ([leaf("take"), TOLD, asked(TOUR[0])], False), ([leaf("take"), asked(TOUR[0]), TOLD], True),
    ([leaf("take"), asked(PerformGesture("deictic", 1, 900), "point")], True),
    ([leaf("take"), asked(TOUR[0]), asked(QueryKnowledge("home"), "where")], False),
    ([leaf("take"), TOLD, leaf("take")], False)])
def test_of_each_stop_that_is_chosen_the_visitor_hears_or_sees_something(steps, is_shown):
    seen = play(*steps, asked(BACK, "right"), leaf("bye"), ended())
    assert ("not-shown" in kinds(seen)) is not (is_shown or steps == [TOLD])
    for other in (play(*steps, ended(), faults=1), play(*steps, ended(), behaviour=DECLINES)):
        assert "not-shown" not in kinds(other)


def heard(words, mark):
    started, finished, done = leaf("hear")
    return [started, replace(finished, summary=LeafSummary("heard", words, mark)), done]


QUESTION, WORDS, DRIVE, AGAIN = [
    asked(request, "ask") for request in (Say("so?"), Say("well"), TOUR[0], Say("so?"))]
NO, UNCLEAR = heard("no", "no"), heard("hm", "")


@pytest.mark.parametrize("steps, is_again", [
    ([QUESTION, NO, AGAIN], True), ([QUESTION, UNCLEAR, AGAIN, NO], False),
    ([QUESTION, NO, WORDS, AGAIN], False), ([QUESTION, NO, DRIVE, AGAIN], False)])
def test_a_visitor_who_has_answered_is_not_asked_the_same_again(steps, is_again):
    for faults in (0, 1):
        assert ("asked-again" in kinds(play(*steps, faults=faults))) is is_again


@pytest.mark.parametrize("steps, is_twice", [
    ([TOLD], False), ([TOLD, asked(Say("x"), "bye")], False), ([TOLD, TOLD], False),
    ([TOLD, asked(Say("y"), "ask")], False), ([TOLD, asked(Say("x"), "ask")], True),
    ([TOLD, asked(TOUR[0]), asked(Say("x"), "ask")], False),
    ([TOLD, asked(ON), asked(Say("x"), "ask")], False),
    ([asked(Say("x?"), "hi"), asked(Say("x?"), "ask")], False),
    ([asked(Say("x"), "tell"), asked(Say("x"), "tell")], True)])
def test_a_visitor_is_not_told_the_same_twice_at_one_place(steps, is_twice):
    assert ("said-twice" in kinds(play(*steps))) is is_twice
    assert "said-twice" not in kinds(play(*steps, faults=1))


@pytest.mark.parametrize("steps, left, is_told", [
    ([TOLD], 0.5, False), ([leaf("see", "FAILURE"), TOLD], 0.5, True),
    ([leaf("see"), TOLD], 0.5, False), ([leaf("see", "FAILURE"), TOLD], 1.5, False),
    ([leaf("see", "FAILURE"), TOLD, leaf("see")], 0.5, False),
    ([leaf("look", "FAILURE"), TOLD], 0.5, False), ([asked(BACK), TOLD], 1.001, True),
    ([asked(TOUR[0]), TOLD], 1.001, False), ([asked(BACK), TOLD], 0.5, False),
    ([asked(BACK), TOLD], None, False)])
def test_nothing_is_said_to_a_visitor_who_is_known_to_have_left(steps, left, is_told):
    presence = [(START, True)] + ([] if left is None else [(START + left, False)])
    assert ("speech-to-nobody" in kinds(play(*steps, presence=presence))) is is_told


def usual(*steps):
    return play(*steps, leaf("bye"), ended())


@pytest.mark.parametrize("steps, calm, more, expected", [
    ([], [TOLD], [], "its failure leaves out WelcomeSpeech"), ([TOLD], [TOLD], [], None),
    ([asked(ON, "look")], [TOLD], [], None),  # another way
    ([asked(ON, "help")], [TOLD], [], "its failure leaves out WelcomeSpeech"),
    ([recovered("given up")], [TOLD], [], None), ([recovered("skipped")], [TOLD], [],
                                                  "its failure leaves out WelcomeSpeech"),
    ([], [TOLD], [question("asked")], None), ([], [asked(TOUR[0], "drive")], [], None),
    ([TOLD], [asked(ON)[1:], TOLD], [], None)])  # the first of two requests of a leaf
def test_a_step_that_another_one_s_failure_leaves_out(steps, calm, more, expected):
    failed = leaf("drive", "FAILURE", REFUSED)
    seen = play(failed, *steps, *more, leaf("bye"), ended(), faults=1, journal=[FAULT],
                calm=usual(*calm, *[question("yes") for _ in more]))
    told = [each[1:] for each in found(seen) if each[0] == "left-out-step"]
    assert told == ([] if expected is None else [("drive", expected)])


@pytest.mark.parametrize("steps, alone, expected", [
    ([TOLD], [TOLD], None), ([], [TOLD], "hi"), ([TOLD], [], "hi"),
    ([asked(Say("y"), "ask")], [TOLD], "hi"), ([asked(Say("x"), "ask")], [TOLD], None)])
def test_a_later_visitor_is_treated_as_the_first(steps, alone, expected):
    seen = play(*steps, ended(), calm=play(*alone, ended()))
    assert "next-visitor" not in kinds(seen)
    seen.visitors_before = 1
    assert [at for kind, at, _ in found(seen) if kind == "next-visitor"] == (
        [] if expected is None else [expected])


def test_a_later_visitor_s_pass_ends_as_the_first_one_s():
    seen = play(TOLD, ended("FAILURE"), calm=play(TOLD, ended()))
    seen.visitors_before = 2
    assert found(seen) == [("next-visitor", "all", "the pass of visitor 3 ends otherwise: FAILURE")]


@pytest.mark.parametrize("steps, left, is_unwanted", [
    ([leaf("see", "FAILURE"), asked(TOUR[0])], 0.5, True), ([asked(TOUR[0])], 0.5, False),
    ([leaf("see"), asked(TOUR[0])], 0.5, False),
    ([leaf("see", "FAILURE"), asked(TOUR[0])], 1.5, False),
    ([leaf("see", "FAILURE"), leaf("see"), asked(TOUR[0])], 0.5, False),
    ([leaf("see", "FAILURE"), asked(BACK)], 0.5, False)])
def test_the_tour_does_not_go_on_for_a_visitor_who_has_left(steps, left, is_unwanted):
    presence = [(START, True), (START + left, False)]
    assert ("unwanted-drive" in kinds(play(*steps, presence=presence))) is is_unwanted
    assert "unwanted-drive" not in kinds(play(*steps, presence=presence, faults=1))


@pytest.mark.parametrize("behaviour, mark, faults, goals, is_unwanted", [
    (DECLINES, "asked", 0, TOUR[:2], True), (DECLINES, "asked", 0, TOUR[:1] + [BACK], True),
    (DECLINES, "asked", 0, [BACK], False), (DECLINES, "asked", 1, TOUR[:2], False),
    (DECLINES, "", 0, TOUR[:2], False), (ENGAGES, "asked", 0, TOUR[:2], False)])
def test_a_visitor_who_says_no_is_not_driven_to_a_stop(behaviour, mark, faults, goals, is_unwanted):
    drives = [asked(to, name) for to, name in zip(goals, ("left", "right"))]
    seen = play(question(mark), *drives, behaviour=behaviour, faults=faults)
    assert found(seen) == is_unwanted * [
        ("unwanted-drive", "left", "the visitor says no, and the robot drives to a stop")]


@pytest.mark.parametrize("result, expected", [
    (Answer(), ["drives-twice"]), (REFUSED, []), (None, [])])
def test_a_robot_that_has_arrived_is_not_sent_there_again(result, expected):
    steps = [asked(BACK, "drive", result), leaf("drive"), asked(BACK)]
    assert [kind for kind in kinds(play(*steps)) if kind == "drives-twice"] == expected
    assert "drives-twice" not in kinds(play(*steps, faults=1))
    under_way = asked(BACK, "left", None)
    assert kinds(play(under_way, asked(BACK, "right"), answered(under_way))) == ["shares-a-body"]


def test_a_mission_that_takes_exhibits_one_by_one_may_be_meant_to_show_only_some():
    steps = [leaf("take"), asked(TOUR[0]), TOLD, asked(BACK), leaf("bye"), ended()]
    assert kinds(play(*steps)) == []


def test_of_a_branch_that_no_play_reaches_only_the_top_is_told_and_of_a_row_the_first():
    def unreached(*names):
        reached = {UIDS[name] for name in names}
        driven = SimpleNamespace(calls=[RobotCall("robotNavigation", 1, UIDS["left"], "", True)])
        return [node.name for node in Search(TREE.nodes, reached, [driven], "refused").targets()]
    assert unreached() == ["all"]
    assert unreached("all", "some", "see", "help") == ["drive", "others"]
    assert unreached("all", "some", "both") == ["see", "others", "left", "right", "help"]
    assert unreached(*UIDS) == []


def test_an_entry_is_of_its_subtree_unless_it_is_of_the_whole_mission():
    stage = LoadedMission(settings.defaults(), [parse(
        """<root BTCPP_format="4" main_tree_to_execute="M">
        <BehaviorTree ID="M"><Sequence><SubTree ID="S" name="a"/><SubTree ID="S" name="b"/>
        <Navigate name="last" target="{x}"/></Sequence></BehaviorTree>
        <BehaviorTree ID="S"><LookUpHome name="find" targetLocation="{x}"/></BehaviorTree>
        </root>""")])
    nodes = [node for node in stage.mission.tree.nodes if node.spec.ports]
    made = [(node.name, *(findings.entries(node, is_written) for is_written in (True, False)))
            for node in nodes if node.name in ("find", "last")]
    assert [(name, sorted(written), sorted(read)) for name, written, read in made] == [
        ("find", ["@gestureTarget", "a/x"], []), ("find", ["@gestureTarget", "b/x"], []),
        ("last", [], ["/x"])]


def first_half(name):
    return leaf(name)[:1]


def second_half(name):
    return leaf(name)[1:]


WAY = asked(TOUR[0], "drive", None)
"""A drive to a stop that is under way."""

TAKE_AND_TELL = leaf("take")[:-1] + [Tick(0.0, True, [(UIDS["take"], "S"), (UIDS["tell"], "R")])]
"""One leaf ends and the next begins in one traversal."""


@pytest.mark.parametrize("steps, expected", [
    ([leaf("take"), asked(TOUR[0]), leaf("tell")], None),
    ([leaf("take"), WAY, leaf("tell"), answered(WAY)], ("tell", "the robot drives meanwhile")),
    ([leaf("take"), WAY, leaf("point"), answered(WAY)], ("point", "the robot drives meanwhile")),
    ([leaf("take"), first_half("tell"), WAY, second_half("tell"), answered(WAY)],
     ("tell", "the robot drives meanwhile")),
    ([leaf("take"), WAY, first_half("tell"), answered(WAY), second_half("tell")],
     ("tell", "the robot drives meanwhile")),
    ([WAY, TAKE_AND_TELL, second_half("tell"), answered(WAY)],
     ("tell", "the robot drives meanwhile")),
    ([leaf("take"), WAY, leaf("hi"), answered(WAY)], None),
    ([leaf("take"), WAY, leaf("tell", "FAILURE"), answered(WAY)], None),
    # what is shown was not chosen, or is home
    ([WAY, leaf("tell"), answered(WAY), leaf("take")], None),
    ([leaf("take"), leaf("where"), WAY, leaf("point"), answered(WAY)], None),
    ([leaf("take"), leaf("tell"), asked(TOUR[0])],
     ("tell", "the robot drives there only after it")),
    ([leaf("take"), leaf("tell"), asked(TOUR[0]), leaf("tell")], None),
    ([leaf("take"), leaf("tell"), leaf("take"), asked(TOUR[0]), leaf("tell")], None),
    ([leaf("take"), asked(TOUR[0]), leaf("tell"), leaf("take"), leaf("tell"), asked(TOUR[1])],
     ("tell", "the robot drives there only after it")),
    ([leaf("take"), leaf("tell"), leaf("take"), asked(TOUR[0]), leaf("tell"), leaf("take")], None),
    ([leaf("take"), leaf("tell"), asked(BACK)], None),
    ([leaf("take"), leaf("tell"), ended(), asked(TOUR[0])], None)])
def test_a_stop_is_shown_when_the_robot_has_driven_there(steps, expected):
    over = {"ended": START + 4} if ended() in steps else {}
    seen = play(*steps, **over)
    shown = [each for each in found(seen) if each[0] == "shown-away"]
    assert shown == ([] if expected is None else [("shown-away", *expected)])
    assert kinds(play(*steps, faults=1, **over)) == []
    assert kinds(play(*steps, behaviour=DECLINES, **over)) == []


@pytest.mark.parametrize("began, over, is_meanwhile", [
    (1.0, 2.005, False), (1.0, 2.015, True), (4.985, 6.0, True), (4.995, 6.0, False)])
def test_what_is_shown_until_a_drive_begins_or_from_its_end_on_is_not_shown_meanwhile(
        began, over, is_meanwhile):
    steps = sorted([(0.0, leaf("take")), (2.0, WAY), (5.0, answered(WAY)),
                    (began, first_half("tell")), (over, second_half("tell"))],
                   key=lambda step: step[0])
    seen = play(*[step for _, step in steps], times=[at for at, _ in steps])
    assert found(seen) == is_meanwhile * [("shown-away", "tell", "the robot drives meanwhile")]


def old(*names):
    return ["it fails, and {} uses the old {}".format(*each) for each in names]


THERE = ["the drive fails, and DescribeExhibitSpeech goes on as if the robot were there"]


@pytest.mark.parametrize("steps, at, expected", [
    ([leaf("where", "FAILURE"), asked(BACK)], "where", old(("Navigate", "targetLocation"))),
    ([leaf("where"), asked(BACK)], "where", []),
    ([leaf("where", "FAILURE"), leaf("where"), asked(BACK)], "where", []),
    ([leaf("where", "FAILURE"), leaf("take"), asked(BACK)], "where", []),
    ([leaf("where", "IDLE"), asked(BACK)], "where", []),
    ([asked(BACK), leaf("where", "FAILURE")], "where", []),
    ([leaf("where", "FAILURE"), recovered("done", of="where"), asked(BACK)], "where", []),
    ([leaf("where", "FAILURE"), recovered("done", of="hi"), asked(BACK)], "where",
     old(("Navigate", "targetLocation"))),
    ([leaf("where", "FAILURE"), recovered("given up", of="where"), asked(BACK)], "where",
     old(("Navigate", "targetLocation"))),
    ([leaf("take", "FAILURE"), asked(Say("x"), "tell")], "take",
     old(("DescribeExhibitSpeech", "currentExhibit"), ("DescribeExhibitSpeech", "description1"),
         ("DescribeExhibitSpeech", "description2"))),
    ([leaf("take", "FAILURE"), asked(Say("x"), "hi")], "take", []),
    # it reads that entry itself, and goes on from it
    ([leaf("take", "FAILURE"), asked(Say("x"), "next")], "take", []),
    # no answer is an answer
    ([leaf("press", "FAILURE"), asked(Say("x"), "answer")], "press", []),
    ([leaf("hear", "FAILURE"), asked(Say("x"), "answer")], "hear", []),
    # a recovery uses what there is
    ([leaf("take", "FAILURE"), asked(BACK, "help")], "take", []),
    ([asked(TOUR[0], "drive", REFUSED), asked(Say("x"), "tell")], "drive", THERE),
    ([asked(TOUR[0], "drive"), asked(Say("x"), "tell")], "drive", []),
    ([asked(TOUR[0], "drive", REFUSED), asked(Say("x"), "hi")], "drive", []),
    ([asked(TOUR[0], "drive", REFUSED), asked(TOUR[0], "right"), asked(Say("x"), "tell")], "drive",
     []),
    ([asked(TOUR[0], "drive", REFUSED), asked(QueryKnowledge("home"), "tell")], "drive", []),
    ([asked(Say("x"), "tell"), asked(TOUR[0], "drive", REFUSED)], "drive", []),
    ([asked(TOUR[0], "help", REFUSED), asked(Say("x"), "tell")], "help", [])])
def test_a_failure_is_swallowed_if_a_later_step_builds_on_what_was_not_done(steps, at, expected):
    assert found(play(*steps)) == [("swallowed-failure", at, what) for what in expected]


QUESTION = Say("And you?")
UNHEARD = "nothing listens to the answer"


@pytest.mark.parametrize("steps, at, expected", [
    ([asked(QUESTION, "ask"), ended()], "ask", UNHEARD),
    ([asked(Say(STAGE.world.visitor.manners.questions[1]), "ask"), ended()], "ask", UNHEARD),
    ([asked(Say("So."), "ask"), ended()], None, None),
    ([asked(QUESTION, "hi"), ended()], None, None),
    ([asked(QUESTION, "ask")], None, None),  # the pass has not ended
    ([asked(QUESTION, "ask"), leaf("hear", "FAILURE"), ended()], None, None),
    ([asked(QUESTION, "ask"), leaf("press"), ended()], None, None),
    ([asked(QUESTION, "ask"), leaf("see"), ended()], "ask", UNHEARD),
    ([asked(QUESTION, "ask"), asked(Prompt(("yes", "no")), "press", None), ended()], None, None),
    ([leaf("hear"), asked(QUESTION, "ask"), ended()], "ask", UNHEARD),
    ([leaf("press"), leaf("agreed"), asked(QUESTION, "ask"), leaf("hear"), leaf("agreed")],
     None, None),
    ([leaf("press"), asked(QUESTION, "ask"), leaf("agreed")], "agreed",
     "it looks at the answer of PressYesNoDialogue although another question was asked since"),
    ([asked(QUESTION, "ask"), leaf("press"), leaf("agreed"), leaf("agreed", "FAILURE")],
     None, None),
    ([leaf("press"), leaf("hear")], "hear",
     "it replaces the answer of PressYesNoDialogue, which nothing has looked at"),
    ([leaf("press"), leaf("hear", "FAILURE")], None, None),
    ([leaf("press", "FAILURE"), leaf("hear")], None, None),
    ([leaf("hear"), leaf("agreed"), leaf("press"), leaf("hear")], "hear",
     "it replaces the answer of PressYesNoDialogue, which nothing has looked at")])
def test_an_answer_is_used_before_the_next_question(steps, at, expected):
    assert found(play(*steps)) == ([] if at is None else [("answer-mixed-up", at, expected)])
    assert found(play(*steps, faults=1)) == []


@pytest.mark.parametrize("before, is_mixed_up", [(0.005, False), (0.015, True)])
def test_a_question_that_is_asked_with_the_look_at_an_answer_is_the_next(before, is_mixed_up):
    seen = play(leaf("press"), asked(QUESTION, "ask")[1:], leaf("agreed"),
                times=[1.0, 2.0 - before, 2.0])
    assert kinds(seen) == ["answer-mixed-up"] * is_mixed_up


GOODBYE = asked(Say("Bye"), "bye")


@pytest.mark.parametrize("steps, expected", [
    ([GOODBYE], None), ([GOODBYE, asked(Say("Bye"), "bye")], "the same visitor hears it again"),
    ([GOODBYE, asked(Say("Farewell"), "bye")], None), ([GOODBYE, asked(Say("Bye"), "hi")], None),
    ([asked(Say("Bye"), "hi"), asked(Say("Bye"), "hi")], None),
    ([GOODBYE, asked(ON), asked(Say("Bye"), "bye")], None),
    ([GOODBYE, asked(OFF), asked(Say("Bye"), "bye")], "the same visitor hears it again"),
    ([GOODBYE, leaf("take"), leaf("tell")], "DescribeExhibitSpeech goes on after it"),
    ([leaf("take"), GOODBYE, leaf("tell")], None), ([GOODBYE, leaf("hi")], None),
    ([leaf("take"), leaf("tell"), GOODBYE], None)])
def test_a_goodbye_is_the_last_that_a_visitor_hears(steps, expected):
    assert found(play(*steps)) == ([] if expected is None else [("early-goodbye", "bye", expected)])
    assert kinds(play(*steps, faults=1)) == []
    for left in (0.5, 2.5):  # before the first step, and before the last
        assert kinds(play(*steps, times=[1.0, 2.0, 3.0][-len(steps):],
                          presence=[(START, True), (START + left, False)])) == []


@pytest.mark.parametrize("stops, more, expected", [
    (2, [ended()], True), (3, [ended()], True), (1, [ended()], False),
    (2, [ended("FAILURE")], True), (2, [], False), (2, [leaf("bye"), ended()], False),
    (2, [leaf("bye", "FAILURE"), ended()], True), (2, [leaf("hi"), ended()], True)])
def test_a_visitor_who_was_shown_several_stops_is_told_goodbye(stops, more, expected):
    steps = [asked(stop) for stop in TOUR[:stops]] + [asked(BACK, "right"), *more]
    assert found(play(*steps)) == expected * [
        ("no-goodbye", "right", "the last drive ends here, and the visitor is told no goodbye")]
    assert found(play(*steps, faults=1)) == found(play(*steps, behaviour=DECLINES)) == []


def without_goodbye(*more, outcome="SUCCESS", faults=1, calm=(leaf("bye"), ended())):
    steps = [leaf("hi", "FAILURE", REFUSED), leaf("look", "FAILURE", REFUSED), *more]
    return play(*steps, *[ended(outcome)] * bool(outcome), faults=faults, journal=[FAULT],
                calm=calm and play(*calm))


def test_a_failure_after_which_the_goodbye_is_not_even_tried_is_told():
    assert found(without_goodbye()) == [
        ("no-goodbye", "hi", "its failure leaves out the goodbye of SayGoodByeSpeech")]
    for other in (without_goodbye(leaf("bye")), without_goodbye(leaf("bye", "FAILURE")),
                  without_goodbye(outcome=""), without_goodbye(faults=0),
                  without_goodbye(calm=None), without_goodbye(calm=(ended(),))):
        assert findings.findings(other) == []
    assert "no-goodbye" not in kinds(without_goodbye(outcome="FAILURE", faults=2))
    assert "no-goodbye" in kinds(without_goodbye(faults=2))


@pytest.mark.parametrize("request_, steps, expected", [
    (Say("x"), [leaf("hi", "IDLE")], True),
    (PerformGesture("bow", 0, 900), [leaf("hi", "IDLE")], True),
    (Say("x"), [leaf("hi")], True), (Say("x"), [], False), (ON, [leaf("hi", "IDLE")], False)])
def test_speech_or_a_gesture_is_cut_short_if_it_is_halted(request_, steps, expected):
    told = [("cut-short", "hi", "it is halted after 3.0 s, before the robot is done")] * expected
    under_way = asked(request_, "hi", None)
    times = [1.0, 4.0][:1 + len(steps)]
    assert found(play(under_way, *steps, times=times)) == told
    assert found(play(under_way, *steps, times=times, faults=1)) == []
    assert found(play(under_way, *steps, times=times, presence=[(START, False)])) == []
    in_time = [under_way, answered(under_way), *steps]
    assert found(play(*in_time, times=[1.0, 2.0, 4.0][:len(in_time)])) == []


def test_a_call_of_the_mission_is_of_the_leaf_that_asked_last():
    speech = "/textToSpeech/say_text"
    lines = [JournalEntry(START + at, "node", resource, call, {"b": at, "a": 1}, fault)
             for at, resource, call, fault in (
                 (0.5, speech, 1, None), (1.5, speech, 2, "refused"), (2.5, speech, 3, None),
                 (2.6, "/topic", 0, None), (3.5, speech, 4, None), (9.0, speech, 5, None))]
    seen = play(asked(Say("x"), "hi"), asked(TOUR[0], "drive"), asked(Say("y"), "bye"),
                journal=lines, ended=START + 8, situations={("node", 3): b"met"})
    assert seen.calls() == [
        RobotCall("node", call, uid, "[('a', 1), ('b', {})]".format(at), is_done, met)
        for call, uid, at, is_done, met in (
            (1, findings.ROOT, 0.5, True, b""), (2, UIDS["hi"], 1.5, False, b""),
            (3, UIDS["hi"], 2.5, True, b"met"), (4, UIDS["bye"], 3.5, True, b""))]


def of_all_plays(reached=(), succeeded=(), switched=()):
    """Return kind, node and text of what all plays together show: one without a fault."""
    survey = Survey(SimpleNamespace(stage=lambda by_voice: STAGE, visitors=BEHAVIOURS), True, ())
    survey.take(Outcome(Scenario(ENGAGES), "SUCCESS", 9.0, (), (),
                        frozenset(UIDS[name] for name in reached),
                        frozenset(UIDS[name] for name in succeeded), tuple(switched)))
    told = survey.findings(SimpleNamespace(unreached=lambda: ()))
    return [(each.kind.name, each.where, each.what) for each in told]


def test_a_leaf_that_only_fails_with_faults_may_never_succeed():
    assert of_all_plays(["see", "look", "help", "some"], ["look"]) == [
        ("never-true", "see", "it never succeeds")]


def test_a_kind_is_explained_to_the_author_of_a_mission():
    assert findings.KIND_BY_NAME["abandoned-drive"].means == (
        "The mission stops waiting for a drive, and the robot drives on.")


def test_what_is_switched_has_its_last_leaf():
    seen = play(asked(ON, "hi"), asked(Say("x"), "hi"), asked(STIR, "drive"), asked(ON, "bye"))
    assert seen.switched == {ON: UIDS["bye"], STIR: UIDS["drive"]}


def test_what_is_switched_on_must_be_switched_off_in_some_play():
    off = "attention is never switched off"
    assert of_all_plays(switched=[(ON, UIDS["hi"]), (STIR, 0), (SetAnimation("disabled"), 0)]) == [
        ("never-off", "hi", off)]
    assert of_all_plays(switched=[(ON, 0), (OFF, 0)]) == of_all_plays() == []
    assert of_all_plays(switched=[(ON, 0)]) == [("never-off", "all", off)]
