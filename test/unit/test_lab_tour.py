"""The lab tour on the real engine: what the robot is asked, in which order, for each kind of
visitor and each failure.

The expected orders are read off data/lab_tour.xml by hand, with the meaning that BehaviorTree.CPP
gives its nodes.
"""
import pytest

from behavior_controller.bt.values.status import SUCCESS
from behavior_controller.run.events import LeafFinished, PassFinished, Recovered
from behavior_controller.robot.gateway import Cause, Failure
from behavior_controller.robot.d543 import ATTENTION, FACES
from behavior_controller.robot.requests import (
    Answer, AttentionStatus, Faces, GoTo, PerformGesture, Point, Prompt, QueryKnowledge, Say,
    SetAnimation, SetAttention)
from behavior_controller.leaves.recovery import HandleFallBack
from mission_rig import (
    ENTRANCE, EXHIBITS, HOME, Rig, one_leaf, refusal, refusing, service_of, visitor_who)

SAYS = {
    "Welcome": "welcome",
    "Query": "would you like",
    "SayYesNo": "only understand yes or no",
    "Press": "press yes or no",
    "Follow": "follow me",
    "Another": "another time",
    "End": "last exhibit",
    "Door": "here is the door",
    "Bye": "goodbye"}


def named(request):
    """Return a short name of a request: what it does, and to what."""
    if isinstance(request, Say):
        return "say " + next(
            (name for name, words in SAYS.items() if words in request.text.lower()), request.text)
    if isinstance(request, SetAttention):
        return "attention " + request.state
    if isinstance(request, SetAnimation):
        return "animation " + request.state
    if isinstance(request, QueryKnowledge):
        return "query " + request.what
    if isinstance(request, GoTo):
        return "go to {:g} {:g} {:g}".format(*request.goal)
    if isinstance(request, Prompt):
        return "prompt " + "|".join(request.options)
    assert isinstance(request, PerformGesture)
    return "{} {} {} at {:g} {:g} {:g}".format(request.type, request.id, request.duration_ms,
                                               *request.target)


GAZE = ["attention seeking", "attention social"]
MEETING = ["animation enabled", "attention scanning", "animation disabled",
           "iconic 1 3000 at 0 0 0", "animation enabled", "say Welcome"] + GAZE


def drive(place):
    return [
        "attention disabled", "animation disabled", "go to {:g} {:g} {:g}".format(*place.location)]


def visit(exhibit):
    return (["say Follow"] + drive(exhibit) + GAZE + [
        "say " + exhibit.description1, "deictic 1 3000 at {:g} {:g} {:g}".format(*exhibit.gesture),
        "attention social", "say " + exhibit.description2])


FAREWELL = (["say End", "query entrance"] + drive(ENTRANCE) + GAZE
            + ["say Door", "deictic 1 3000 at {:g} {:g} {:g}".format(*ENTRANCE.gesture),
               "iconic 3 3000 at 0 0 0", "say Bye"])
SAFE, GO_HOME = ["attention disabled", "animation disabled"], ["query home"] + drive(HOME)
FIRST, SECOND = visit(EXHIBITS[0]), visit(EXHIBITS[1])
TOUR = ["query exhibits"] + FIRST + SECOND + FAREWELL + GO_HOME
ASKED = MEETING + ["say Query"]
UP_TO_THE_TOUR = ASKED + ["query exhibits"]
WHOLE = ASKED + TOUR


def asked(rig):
    return [named(request) for request in rig.requests]


def never_reaching(place):
    goal = "go to {:g} {:g} {:g}".format(*place.location)
    return goal, lambda request: refusal(request) if named(request) == goal else NotImplemented


def gaze_except_at(*stops):
    """Return a visitor who says yes and looks at the robot but at these stops, the first exhibit
    being stop 1."""
    def act(rig):
        drives = sum(isinstance(request, GoTo) for request in rig.requests)
        visitor_who(says="yes", gazes=drives not in stops)(rig)
    return act


def knowing(exhibits, answer=lambda request: NotImplemented):
    """Return a robot whose knowledge base has these exhibits, and that answers as ``answer``
    otherwise."""
    return lambda request: Answer(exhibits=exhibits) if request == QueryKnowledge(
        "exhibits") else answer(request)


def leaves_at(stop):
    """Return a visitor who says yes and is gone when the robot has driven that often."""
    def act(rig):
        drives = sum(isinstance(request, GoTo) for request in rig.requests)
        if drives < stop:
            visitor_who(says="yes")(rig)
        else:
            rig.clock.advance(0.5)
            rig.topics.publish(FACES, Faces((), ()))
            rig.topics.publish(ATTENTION, AttentionStatus("seeking", 0))
    return act


def pressing(text):
    """Return a robot by tablet whose visitor presses this."""
    return {"asrEnabled": False,
            "answer": lambda request: Answer(text) if isinstance(request, Prompt)
            else NotImplemented}


(GOAL_1, NEVER_1), (GOAL_2, NEVER_2) = map(never_reaching, EXHIBITS)
YES, NO, SILENT = visitor_who(says="yes"), visitor_who(says="no"), visitor_who()
NO_GAZE, WAITS = visitor_who(says="yes", gazes=False), {"conditionWait": 5.0}
PRESS = ["say Press", "prompt Yes|No"]
VISITS = {  # the visitor, the robot, the exit code, all requests
    "yes": (YES, {}, 0, WHOLE),
    "yes by tablet": (SILENT, {"asrEnabled": False}, 0, ASKED + PRESS + TOUR),
    "no": (NO, {}, 0, ASKED + ["say Another"]),
    "no by tablet": (SILENT, pressing("No"), 0, ASKED + PRESS + ["say Another"]),
    "silent": (SILENT, {}, 0, ASKED + 3 * ["say SayYesNo"] + ["say Another"]),
    "presses nothing": (SILENT, pressing(""), 0, ASKED + 3 * PRESS + ["say Another"]),
    "does not look": (NO_GAZE, {}, 3, MEETING[:-1]),
    # a condition wait does not disturb a mission that waits itself
    "yes, with a wait": (YES, WAITS, 0, WHOLE),
    "silent, with a wait": (SILENT, WAITS, 0, ASKED + 3 * ["say SayYesNo"] + ["say Another"]),
    "does not look, with a wait": (visitor_who(gazes=False), WAITS, 3, MEETING[:-1]),
    "looks away at an exhibit": (
        gaze_except_at(1), {}, 0, UP_TO_THE_TOUR + FIRST[:5] + SECOND + FAREWELL + GO_HOME),
    "looks away at the last one": (
        gaze_except_at(2), {}, 0, UP_TO_THE_TOUR + FIRST + SECOND[:5] + FAREWELL + GO_HOME),
    "looks away at the door": (gaze_except_at(3), {}, 0, UP_TO_THE_TOUR + FIRST + SECOND
                               + FAREWELL[:6] + FAREWELL[7:] + GO_HOME),
    "leaves on the way to the first": (
        leaves_at(1), {}, 3, UP_TO_THE_TOUR + FIRST[:5] + SAFE + GO_HOME),
    "leaves on the way to the last": (
        leaves_at(2), {}, 3, UP_TO_THE_TOUR + FIRST + SECOND[:5] + SAFE + GO_HOME),
    "leaves on the way to the door": (
        leaves_at(3), {}, 3, UP_TO_THE_TOUR + FIRST + SECOND + FAREWELL[:6] + GO_HOME),
    # the tour ends at home, as a failure
    "an exhibit out of reach": (
        YES, {"answer": NEVER_1}, 3, UP_TO_THE_TOUR + FIRST[:3] + 3 * [GOAL_1] + SAFE + GO_HOME),
    "the last one out of reach": (
        YES, {"answer": NEVER_2}, 3,
        UP_TO_THE_TOUR + FIRST + SECOND[:3] + 3 * [GOAL_2] + SAFE + GO_HOME),
    "the only one out of reach": (
        YES, {"answer": knowing(EXHIBITS[:1], NEVER_1)}, 3,
        UP_TO_THE_TOUR + FIRST[:3] + 3 * [GOAL_1] + SAFE + GO_HOME),
    "no exhibits": (
        YES, {"answer": knowing(())}, 3, ASKED + 3 * ["query exhibits"] + SAFE + GO_HOME)}


@pytest.mark.slow
@pytest.mark.parametrize("name", VISITS)
def test_what_a_visitor_gets(name):
    visitor, robot, code, expected = VISITS[name]
    rig = Rig(**robot)
    assert rig.run(visitor, is_stopped=lambda: rig.clock.now() > 2000.0) == code
    assert asked(rig) == expected
    assert [event.outcome for event in rig.of(PassFinished)] == ["FAILURE" if code else "SUCCESS"]
    if name == "yes":
        assert rig.of(Recovered) == []


@pytest.mark.parametrize("first, second, outcome, asked_last", [
    (YES, NO, "SUCCESS", TOUR + ASKED + ["say Another"]),
    (gaze_except_at(1, 2), YES, "FAILURE", GO_HOME + WHOLE),
    (leaves_at(1), YES, "FAILURE", GO_HOME + WHOLE)])
def test_the_next_visitor_starts_afresh(first, second, outcome, asked_last):
    rig = Rig()
    rig.run(lambda rig: (second if rig.of(PassFinished) else first)(rig), runs=2)
    assert [event.outcome for event in rig.of(PassFinished)] == [outcome, "SUCCESS"]
    assert asked(rig)[-len(asked_last):] == asked_last


def test_a_yes_from_before_the_question_is_no_answer():
    rig = Rig()

    def visitor(rig):
        has_asked = "say Query" in asked(rig)
        visitor_who(says=None if has_asked else "yes")(rig)

    assert rig.run(visitor) == 0
    assert asked(rig)[-1] == "say Another"


@pytest.mark.parametrize("words", ["Welcome", "Query", "Follow", "End", "Door", "Bye"])
def test_a_speech_that_is_refused_for_good_is_tried_twice_and_left_out(words):
    def answer(request):
        return refusal(request) if named(request) == "say " + words else NotImplemented

    rig = Rig(answer=answer)
    assert rig.run(visitor_who(says="yes")) == 0
    expected = []
    for name in WHOLE:
        expected += 2 * [name] if name == "say " + words else [name]
    assert asked(rig) == expected
    assert {event.success for event in rig.of(Recovered)} == {True}


def test_navigation_that_works_at_the_second_attempt_changes_nothing_else():
    goals = []

    def answer(request):
        if isinstance(request, GoTo):
            goals.append(request)
            if len(goals) == 1:
                return refusal(request)
        return NotImplemented

    rig = Rig(answer=answer)
    assert rig.run(visitor_who(says="yes")) == 0
    first = "go to {:g} {:g} {:g}".format(*EXHIBITS[0].location)
    whole = list(WHOLE)
    whole.insert(whole.index(first), first)
    assert asked(rig) == whole


# the pairs in Parallel
ABREAST = ("animation enabled", "attention scanning"), ("iconic 3 3000 at 0 0 0", "say Bye")


def once_more(name, cause):
    """Return whether a request that failed in this way is made again: by what kind it is, as the
    policy's text says."""
    may_be_done = cause in (Cause.NO_ANSWER, Cause.CONNECTION_LOST)
    if name.split()[0] in ("animation", "attention", "query", "go"):
        return True  # twice is the same as once
    return not may_be_done and cause is not Cause.HANDLER_EXCEPTION  # said or shown twice is wrong


@pytest.mark.slow
@pytest.mark.parametrize("cause", [
    Cause.REFUSED, Cause.NO_ANSWER, Cause.HANDLER_EXCEPTION,
    # as the first two
    *(pytest.param(cause, marks=pytest.mark.long)
      for cause in (Cause.NOT_REACHABLE, Cause.CONNECTION_LOST))])
@pytest.mark.parametrize("number", range(len(WHOLE)))
def test_any_single_failure_is_made_good_or_left_out(number, cause):
    rig = Rig(answer=lambda request: Failure(cause, "test", service_of(request))
              if len(rig.requests) == number + 1 else NotImplemented)
    assert rig.run(visitor_who(says="yes")) == 0
    expected = list(WHOLE)
    if once_more(WHOLE[number], cause):
        # its neighbour in a Parallel is asked in the same tick, the repetition comes after a pause
        is_first = any(WHOLE[number:number + 2] == list(pair) for pair in ABREAST)
        expected.insert(number + 1 + is_first, WHOLE[number])
    elif WHOLE[number].startswith("deictic"):
        expected.insert(number + 1, "attention location")  # it looks there instead
    assert asked(rig) == expected
    assert [(event.failure.cause, event.success) for event in rig.of(Recovered)] == [(cause, True)]


def test_a_tour_at_which_nobody_looks_is_no_success():
    rig = Rig()
    assert rig.run(gaze_except_at(1, 2)) == 3
    tour = ["query exhibits"] + FIRST[:5] + SECOND[:5]
    assert asked(rig) == ASKED + tour + SAFE + GO_HOME
    assert [(event.policy, event.success) for event in rig.of(Recovered)] == [
        ("skip", True), ("give up: every stop would be left out", False)]


def test_one_exhibit_left_out_and_the_last_one_out_of_reach_is_no_success():
    goal, answer = never_reaching(EXHIBITS[1])
    rig = Rig(answer=answer)
    assert rig.run(gaze_except_at(1)) == 3
    assert asked(rig)[-len(GO_HOME):] == GO_HOME and "say End" not in asked(rig)


def test_a_mission_that_goes_on_in_spite_of_all_still_ends():
    loop = ("<Sequence><RetrieveListOfExhibits/><Inverter><KeepRunningUntilFailure><Sequence>"
            "<IsListWithExhibit/><ForceSuccess><Fallback><Sequence><SelectExhibit/>"
            "<IsMutualGazeDiscovered/></Sequence><HandleFallBack/></Fallback></ForceSuccess>"
            "</Sequence></KeepRunningUntilFailure></Inverter></Sequence>")
    rig = one_leaf(loop)
    assert rig.run(lambda rig: rig.clock.advance(0.5)) == 0
    assert rig.tree.blackboard.get("leftOutExhibits") == [0, 1]


def test_no_recovery_gives_a_tour_to_who_said_no():
    rig = one_leaf(
        "<Sequence><QueryTourSpeech/><ReactiveFallback><IsYesNoUttered/><Sleep msec=\"9000\"/>"
        "</ReactiveFallback><Fallback><IsVisitorResponseYes/><HandleFallBack/></Fallback>"
        "<RetrieveListOfExhibits/></Sequence>")
    assert rig.run(visitor_who(says="no")) == 3
    assert [named(request) for request in rig.requests] == ["say Query"] + SAFE


@pytest.mark.parametrize("shown", [
    lambda: test_what_a_visitor_gets("an exhibit out of reach"),
    lambda: test_what_a_visitor_gets("no exhibits"),
    test_a_tour_at_which_nobody_looks_is_no_success,
    lambda: test_what_a_visitor_gets("leaves on the way to the first"),
    test_no_recovery_gives_a_tour_to_who_said_no])
def test_a_recovery_that_always_succeeds_is_noticed(monkeypatch, shown):
    monkeypatch.setattr(HandleFallBack, "on_start", lambda self: SUCCESS)
    with pytest.raises(AssertionError):
        shown()


def test_an_exhibit_with_nothing_to_point_at_gets_no_gesture():
    pointless = tuple(exhibit._replace(gesture=Point(0.0, 0.0, 0.0)) for exhibit in EXHIBITS)
    rig = Rig(answer=knowing(pointless))
    assert rig.run(visitor_who(says="yes")) == 0
    pointed = [name for name in asked(rig) if name.startswith("deictic")]
    assert pointed == ["deictic 1 3000 at {:g} {:g} {:g}".format(*ENTRANCE.gesture)]


def test_every_leaf_of_the_mission_is_reached_by_one_visitor_or_another():
    reached = set()
    for changed, says in (({}, "yes"), ({"asrEnabled": False}, None), ({}, "no"), ({}, None)):
        rig = Rig(answer=lambda request: refusal(request) if named(request) == "say Welcome"
                  else NotImplemented, **changed)
        rig.run(visitor_who(says=says))
        reached |= {event.node for event in rig.of(LeafFinished)}
    assert len(reached) == 33  # the 32 nodes of table 4 and SeekOvertAttentionMode


def test_every_failure_is_recorded_with_cause_and_service():
    rig = Rig(answer=refusing(PerformGesture))
    rig.run(visitor_who(says="yes"))
    failures = [event.failure for event in rig.of(LeafFinished) if event.failure
                and event.node.endswith("Gesture")]
    assert failures and all(
        isinstance(failure, Failure) and failure.cause.value == "refused" and
        failure.resource == "/gestureExecution/perform_gesture" for failure in failures)
