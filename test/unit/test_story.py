"""What an operator asks of a visit is answered by the story: what happened, why, and what the robot
did, in one line each.

The runs are real ones of the engine, in virtual time; each is told twice, as it happens and from
its record.
"""
import re

import py_trees
import pytest
from msgspec.structs import replace

from behavior_controller.run.events import (
    SKIPPED, Asked, BreakpointChanged, HealthChanged, LeafFinished, Noticed, PassFinished,
    PassStarted, Paused, Recovered, Recovering, Retried, RunFinished, RunStarted, SafePart,
    SafeStateReported, Sources, StepStarted, StopChanged, Suspended, LeafSummary)
from behavior_controller.robot.gateway import Cause, Failure
from behavior_controller.run.health import FAILING, GONE, NEW, SILENT
from behavior_controller.robot.requests import (
    Answer, GoTo, Location, PerformGesture, Prompt, Say, SetAttention)
from behavior_controller.run.fold import KEPT_VISITS
from behavior_controller.run.moment import card
from behavior_controller.run.state import (
    BROKEN_OFF, COMPLETE, DECLINED, DONE_ALL, FAILED, GAVE_UP, IN_PART, LEFT, LEFT_OUT, COMPLETED,
    NO_REACTION, NOTICED, SILENT_VISITOR, STOPPED, UNCLEAR, UNDER_WAY, Reason, State, Step, Stop,
    Visit)
from behavior_controller.leaves.attention import IsMutualGazeDiscovered, IsVisitorDiscovered
from behavior_controller.run.story import (
    KINDS, Story, completed, condition, conditions, counted, stop_name, how_it_ended,
    ordinal, run_end, safe_state, step_words, why as in_words, why_failed)
from behavior_controller.text import Source

from mission_rig import Rig, hanging, one_leaf, refusal, refusing, service_of, visitor_who
from told_visits import (
    DATA, RUNS, Teller, drives, gist, looks_away, now_of, rig_of, unanswered_drive, walks_off)


HAS_GONE = Reason(LEFT)
HAS_LEFT = in_words(HAS_GONE)


@pytest.mark.slow
@pytest.mark.parametrize("kind", RUNS)
def test_each_kind_of_visit_is_told_with_its_causes_and_the_record_tells_the_same(kind, tmp_path):
    visitor, _, _, runs, expected = RUNS[kind]
    teller = Teller(rig_of(kind), tmp_path)
    teller.run(visitor, runs)
    rest = map(gist, teller.sentences)
    assert [wanted for wanted in expected if wanted not in rest] == []
    assert teller.recorded() == teller.lines
    assert {sentence.kind for sentence in teller.sentences} <= set(KINDS)
    nowhere = [sentence for sentence in teller.sentences if sentence.kind in ("notice", "health") or
               re.search("^pass |^ends: ", sentence.text)]
    assert {(sentence.uid, sentence.path) for sentence in nowhere} == {(0, "")}
    assert all(sentence.uid and sentence.path for sentence in teller.sentences
               if sentence not in nowhere)


@pytest.mark.slow
def test_visits_that_end_otherwise_have_another_reason():
    whys = {kind: how_it_ended(Teller(rig_of(kind)).run(RUNS[kind][0]).story.state.visit)
            for kind in ("tour", "silent", "declined", "no gaze", "unclear", "tablet")}
    assert whys.pop("tablet") == whys["declined"] and len(set(whys.values())) == 5


def test_a_budget_that_is_spent_is_the_reason_of_the_visit_s_end():
    teller = Teller(Rig(answer=refusing(Say, PerformGesture))).run(visitor_who("yes"), 2)
    assert DATA.findall(how_it_ended(teller.story.state.visits[-1]))[:2] == ["30", "600"]


NO_ANSWER = Failure(Cause.NO_ANSWER, "waited 180 s", "/robotNavigation/set_goal")


@pytest.mark.parametrize("visitor, answer, states, why", [
    (visitor_who("yes"), None, [COMPLETED, COMPLETED], ["", ""]),
    (looks_away, None, [LEFT_OUT, COMPLETED], [IsMutualGazeDiscovered.otherwise, ""]),
    (walks_off, None, [BROKEN_OFF], [HAS_LEFT]),
    (visitor_who("yes"), unanswered_drive, [BROKEN_OFF],
     [why_failed("Navigate", NO_ANSWER, 2, is_short=True)])])
def test_how_it_stands_with_each_exhibit_and_why(visitor, answer, states, why):
    visit = Teller(
        Rig(answer=answer or (lambda request: NotImplemented))).run(visitor).story.state.visit
    assert [(shown.state, in_words(shown.why)) for shown in visit.stops] == list(zip(states, why))
    assert [(shown.number, shown.of, shown.name) for shown in visit.stops] == [
        (1, 2, "exhibit 1"), (2, 2, "exhibit 2")][:len(states)]


def test_the_wait_for_a_visitor_does_not_count_as_the_visit():
    def comes_late(rig):
        rig.clock.advance(0.5) if rig.clock.now() < 1100.0 else visitor_who("no")(rig)

    visit = Teller(Rig()).run(comes_late).story.state.visit
    assert (visit.waited, visit.seconds, visit.outcome, visit.answer) == (100.5, 1.0, "SUCCESS",
                                                                          "no")
    assert visit.began < visit.arrived < visit.engaged <= visit.asked


def test_a_visit_under_way_counts():
    teller = Teller(Rig())
    counts = []

    def visitor(rig):
        counts.append((teller.story.state.visit_count, dict(teller.story.state.visit_results)))
        visitor_who("no")(rig)

    teller.run(visitor, 2)
    assert counts[0] == (1, {}) and counts[-1] == (2, {"declined": 1})
    assert teller.story.state.visit_results == {"declined": 2}


def test_the_step_under_way_with_its_time_and_its_limit():
    rig = Rig(answer=hanging(GoTo))
    teller = Teller(rig)

    def visitor(rig):
        visitor_who("yes")(rig)
        if drives(rig):
            rig.clock.advance(3.5)

    teller.run(visitor, is_stopped=lambda: len(teller.now) > 4)
    assert [DATA.findall(now) for now in teller.now[:3]] == [["0"], ["1", "0", "15"],
                                                             ["1", "0", "10"]]
    # visitor, exhibit, seconds of at most so many, and whose answer is waited for
    assert DATA.findall(teller.now[4]) == ["1", "1", "2", "1", "1", "4", "180", service_of(GoTo)]
    visit = teller.story.state.visit
    shown = visit.stops[0]
    assert (visit.outcome, shown.why, shown.state) == ("", visit.why, BROKEN_OFF) and visit.why
    ended = card(teller.story.state)
    assert (ended.what, ended.where) == ("stopped in the visit of visitor 1", "")


def test_a_retry_is_told_as_it_goes_on_and_when_it_is_done():
    answers = [Failure(Cause.REFUSED, "busy", "/robotNavigation/set_goal")] * 2 + [None]
    rig = Rig(answer=lambda request: answers.pop(0)
              if isinstance(request, GoTo) and answers else NotImplemented)
    teller = Teller(rig).run(visitor_who("yes"),
                             is_stopped=lambda: drives(rig) == 3 and rig.clock.now() > 1010.0)
    gists = list(map(gist, teller.sentences))
    at = gists.index("recovery info Navigate 2 3")
    assert gists[at - 1:at + 2] == [
        "failure warning Navigate /robotNavigation/set_goal", "recovery info Navigate 2 3",
        "recovery info Navigate 3 3 /robotNavigation/set_goal"]
    data = list(map(DATA.findall, teller.now))
    # visitor, exhibit, where it drives, attempt, seconds, service
    assert ["1", "1", "2", "1", "1", "3", "3", "0", "180", service_of(GoTo)] in data
    assert data[-1][:7] == ["1", "1", "2", "1", "1", "3", "3"]


def test_a_step_that_is_done_at_another_try_is_told_once_with_what_it_did():
    answers = [Failure(Cause.REFUSED, "busy", "/robotNavigation/set_goal")]
    rig = Rig(answer=lambda request: answers.pop()
              if isinstance(request, GoTo) and answers else NotImplemented)
    gists = list(map(gist, Teller(rig).run(visitor_who("yes")).sentences))
    at = gists.index("recovery info Navigate 2")
    assert gists[at + 1] == "moved info HandleFallBack 1" and gists.count(gists[at + 1]) == 1
    assert "moved info Navigate 1" not in gists


def test_a_wait_is_over_when_something_else_begins():
    story = Story()
    story.take(1.0, StepStarted(1, "Seen", "a", "waiting for a visitor", "", 5.0, True))
    story.take(1.0, LeafFinished(1, "Seen", "a", "FAILURE", "", 0.0, Failure(
        Cause.CONDITION_FALSE, "no face")))
    assert story.state.step.is_wait and DATA.findall(now_of(story.state, 3.0)) == ["2", "5"]
    story.take(3.0, StepStarted(2, "Say", "b", "saying", "hello", 0.0, False))
    story.take(4.0, LeafFinished(2, "Say", "b", "SUCCESS", "", 1.0, None))
    assert now_of(story.state, 4.0) == ""


@pytest.mark.parametrize("beside, limit", [
    ("<ForceFailure><Sleep msec='15000'/></ForceFailure>", 15.0), ("<Sleep msec='{@long}'/>", 0.0),
    ("<KeepRunningUntilFailure><AlwaysSuccess/></KeepRunningUntilFailure>", 0.0),
    ("<Repeat num_cycles='3'><Sleep msec='1000'/></Repeat>", 0.0),
    ("<LoopInt queue='1;2'><Sleep msec='1000'/></LoopInt>", 0.0),
    ("<Sequence><Sleep msec='1000'/><WelcomeSpeech/></Sequence>", 0.0)])
def test_the_limit_of_a_wait_is_that_of_the_timer_beside_it(beside, limit):
    rig = one_leaf("<ReactiveFallback><IsVisitorDiscovered/>{}</ReactiveFallback>".format(beside))
    rig.tree.blackboard.set("long", 1)
    rig.tick()
    assert [(event.limit, event.is_wait) for event in rig.of(StepStarted)] == [(limit, True)]


def test_the_limit_of_a_wait_may_be_that_of_a_timeout_above_it():
    rig = one_leaf("<Timeout msec='3000'><ReactiveFallback><IsVisitorDiscovered/>"
                   "<KeepRunningUntilFailure><AlwaysSuccess/></KeepRunningUntilFailure>"
                   "</ReactiveFallback></Timeout>")
    rig.tick()
    assert [event.limit for event in rig.of(StepStarted)] == [3.0]


SEEN, SECOND = "<IsVisitorDiscovered/>", "<Sleep msec='1000'/>"
UNSEEN, TWO_SECONDS = "<Inverter>" + SEEN + "</Inverter>", ("<Delay delay_msec='2000'>"
                                                            "<AlwaysFailure/></Delay>")


def within(*elements):
    """Return elements, each within the one before it; the last is text."""
    inner = elements[-1]
    for element in reversed(elements[:-1]):
        inner = "<{}>{}</{}>".format(element, inner, element.split()[0])
    return inner


def retried(attempts, *elements):
    return within("RetryUntilSuccessful num_attempts='{}'".format(attempts), *elements)


POLLED = {  # a mission that asks again and again, and attempts × pause
    "a Delay before each question": (retried(30, "Delay delay_msec='500'", SEEN), 15.0),
    "a Sleep before each question": (retried(4, "Sequence", SECOND + SEEN), 4.0),
    "a Sleep after each no":
        (retried(5, "Fallback", SEEN + within("ForceFailure", SECOND)), 5.0), "two pauses a round":
            (retried(5, "Fallback",
                     SEEN + within("ForceFailure", SECOND) + TWO_SECONDS), 15.0), "two conditions":
                         (retried(5, "Delay delay_msec='1000'", "Sequence",
                                  "<IsASREnabled/>" + SEEN), 5.0), "a condition after each no":
                                      (retried(5, "Delay delay_msec='1000'", "Fallback",
                                               SEEN + "<IsVisitorResponseYes/>"), 5.0),
    "what is done at a yes": (retried(5, "Delay delay_msec='1000'", "Sequence",
                                      SEEN + "<WelcomeSpeech/>"), 5.0), "a wait in each attempt":
                                          (retried(5, "ReactiveFallback",
                                                   SEEN + within("ForceFailure", SECOND)), 5.0),
    "many nodes a round":
        (retried(3, "Sequence",
                 99 * "<AlwaysSuccess/>" + SECOND + SEEN), 3.0), "rounds within rounds":
                     (retried(3, "RetryUntilSuccessful num_attempts='2'", "Delay delay_msec='1000'",
                              SEEN), 6.0), "without end": (retried(-1, "Delay delay_msec='1000'",
                                                                   SEEN), 0.0),
    "without end, with a Timeout":
        (within("Timeout msec='9000'", retried(-1, "Delay delay_msec='1000'", SEEN)), 9.0
         ), "a Timeout that is none":
             (within("Timeout msec='0'",
                     retried(5, "Delay delay_msec='1000'", SEEN)), 5.0), "attempts in an entry":
                         (retried("{@n}", "Delay delay_msec='1000'",
                                  SEEN), 0.0), "a pause in an entry":
                                      (retried(3, "Delay delay_msec='{@ms}'",
                                               SEEN), 0.0), "rounds while it is false":
                                                   (within("Repeat num_cycles='7'", "Sequence",
                                                           UNSEEN + SECOND), 7.0),
    "until it is true":
        (within("KeepRunningUntilFailure", "Sequence",
                UNSEEN + SECOND), 0.0), "until it is true, by messages alone":
                    (within("KeepRunningUntilFailure", UNSEEN), 0.0
                     ), "an endless mission that begins with a visitor":
                         (within("KeepRunningUntilFailure", "Fallback",
                                 within("Sequence", SEEN + "<WelcomeSpeech/>") + SECOND), 0.0)}


@pytest.mark.parametrize("kind", POLLED)
def test_a_condition_that_is_asked_again_after_a_pause_is_waited_for_attempts_times_pause(kind):
    mission, limit = POLLED[kind]
    teller = Teller(one_leaf(mission))
    for entry, value in (("n", 9), ("ms", 2000)):
        teller.rig.tree.blackboard.set(entry, value)
    times = []

    def nobody(rig):
        rig.clock.advance(0.5)
        times.append(rig.clock.now() - 1000.0)

    teller.run(nobody, is_stopped=lambda: teller.rig.clock.now() >= 1100.0)
    assert [(event.limit, event.is_wait) for event in teller.rig.of(StepStarted)] == [(limit, True)]
    assert times[-1] == (limit or times[-1])
    assert ["2"] + ["{:g}".format(limit)] * bool(limit) in list(map(DATA.findall, teller.now))


def test_a_wait_is_told_of_a_mission_that_is_a_part_of_a_tree_of_py_trees():
    rig = one_leaf(retried(30, "Delay delay_msec='500'", SEEN))
    py_trees.composites.Sequence("outer", True, [rig.tree.root])
    rig.tree.setup(mission=rig.mission)
    rig.tick()
    rig.clock.advance(0.5)
    rig.tick()
    assert [event.limit for event in rig.of(StepStarted)] == [15.0]


@pytest.mark.parametrize(
    "mission",
    [
        retried(3, SEEN),  # all at once
        retried(3, "Sequence", SEEN + SECOND),  # no pause where it is false
        retried(3, "Fallback", SEEN + SECOND),  # one round
        retried(3, "Delay delay_msec='1000'", UNSEEN),  # for a visitor to be gone
        within("ReactiveFallback", SEEN + "<AlwaysFailure/>"),  # asked once
        within("Timeout msec='3000'", "Sequence", SEEN + SECOND),
        retried(3, "Delay delay_msec='1000'", "Parallel success_count='2' failure_count='1'",
                SEEN + "<WelcomeSpeech/>"),
        retried(3, "Sequence",
                100 * "<AlwaysSuccess/>" + SECOND + SEEN),  # too large to be looked at
        within("Repeat num_cycles='3'", "Sequence", SEEN + SECOND),  # as long as there is a visitor
        retried(3, "Sequence", "<WelcomeSpeech/>" + SECOND + SEEN)
    ])  # each time after something else
def test_a_question_that_a_loop_does_not_repeat_for_its_answer_is_no_wait(mission):
    rig = one_leaf(mission)
    rig.run(lambda rig: rig.clock.advance(0.5), is_stopped=lambda: rig.clock.now() >= 1010.0)
    assert [event.words for event in rig.of(StepStarted) if event.is_wait] == []


def test_a_condition_that_waits_by_itself_in_each_round_tells_its_own_wait():
    rig = one_leaf(retried(3, "Delay delay_msec='1000'", SEEN), conditionWait=7.0)
    rig.run(lambda rig: rig.clock.advance(0.5), is_stopped=lambda: rig.clock.now() >= 1100.0)
    assert [event.limit for event in rig.of(StepStarted)] == [7.0, 7.0, 7.0]


def test_a_condition_that_waits_by_itself_waits_as_long_as_it_does():
    rig = one_leaf("<Sequence><IsVisitorDiscovered/></Sequence>", conditionWait=7.0)
    rig.tick()
    rig.tick()
    assert [(event.node, event.limit)
            for event in rig.of(StepStarted)] == [("IsVisitorDiscovered", 7.0)]


def test_a_condition_that_does_not_wait_is_no_step():
    rig = one_leaf("<Sequence><IsVisitorDiscovered/></Sequence>")
    rig.tick()
    assert rig.of(StepStarted) == []


# ------------------------------------------------------------------------------- other vocabularies


def test_a_leaf_without_words_is_told_by_its_name(monkeypatch):
    monkeypatch.setattr(Say, "words", None)
    teller = Teller(
        one_leaf("<Sequence><WelcomeSpeech/><Sleep msec='100'/></Sequence>", lambda request: None))

    def robot(rig):
        rig.clock.advance(0.5)
        rig.gateway.calls[0].finish(Answer())

    gists = list(map(gist, teller.run(robot).sentences))
    assert DATA.findall(teller.now[0]) == ["WelcomeSpeech", "0", "60", service_of(Say)]
    assert "notice info WelcomeSpeech WelcomeSpeech" in gists


def test_the_robot_s_requests_have_words_for_leaves_of_any_package():
    rig = one_leaf(
        '<Sequence><Navigate target="1;2;90"/><PerformDeicticGesture target="1;2;3"/></Sequence>')
    assert list(map(gist, Teller(rig).run(lambda rig: None).sentences))[1:3] == [
        "moved info Navigate 1 2 90", "moved info PerformDeicticGesture 1 2 3"]


# ----------------------------------------------------------------------------------- event by event


RUN = RunStarted("/missions/lab_tour.xml", [["a", "Say"], ["b", "Navigate"]], {},
                 Sources((), Source("", ""), Source("", ""), ""))
HELD = BreakpointChanged(3, "tour/Say::3", True)
START, BUSY = PassStarted(1, 0.0), Failure(Cause.REFUSED, "busy", "/go")
HEAD, BODY = SafePart("attention", "/attend", None), SafePart("lifelike movement", "/animate", None)
NOT_REACHED = why_failed("Navigate", BUSY, is_short=True)


def leaf(mark="", kind="visit", text="", uid=1, at=0.0):
    """Return that a leaf succeeded which tells something."""
    return LeafFinished(uid, "Leaf", "tour/leaf", "SUCCESS", "", 0.0, None,
                        LeafSummary(kind, text, mark, at))


def failed(failure=BUSY, uid=1, seconds=0.0, status="FAILURE"):
    return LeafFinished(uid, "Navigate", "tour/go", status, "/go", seconds, failure)


def begins(uid=1, words="driving", what="", limit=0.0, is_wait=False, path="tour/go"):
    return StepStarted(uid, "Navigate", path, words, what, limit, is_wait)


def exhibit(state, number=1):
    return StopChanged(8, "SelectExhibit", "tour/select", number, 2, "Arm", state, "exhibit")


def recovering(attempt=1, substitute=""):
    return Recovering(5, "Navigate", "tour/go", BUSY, attempt, 3, substitute)


def recovered(outcome, reason="", failure=BUSY, policy="-", attempts=2):
    return Recovered("Navigate", "tour/go", failure, policy, attempts, outcome != "given up",
                     outcome, reason, 5)


def story_of(*events):
    """Return the story of events, one each second from 0 on."""
    story = Story()
    for at, event in enumerate(events):
        story.take(at, event)
    return story


NO_FACE = Failure(Cause.CONDITION_FALSE, "no face; the newest message is 9 s old")
ARRIVED, ENGAGED, LEFT, ASKED = leaf("arrived"), leaf("engaged"), leaf("left"), leaf(
    "asked", "asked")
THREE_TIMES = why_failed("Navigate", BUSY, 3, is_short=True)


@pytest.mark.parametrize(
    "events, outcome, why",
    [([], "SUCCESS", "complete"), ([leaf("yes", "heard")], "SUCCESS", "complete"),
     ([ASKED, leaf("yes", "heard")], "SUCCESS", "complete"),
     ([ASKED, leaf("no", "heard")], "SUCCESS", "the visitor said no"),
     ([ASKED, leaf("", "said")], "SUCCESS", "no answer"),
     ([ASKED, leaf("", "heard"), ASKED], "SUCCESS", "no clear answer"),
     ([ASKED, leaf("", "heard"), START, ASKED], "SUCCESS", "no answer"),
     ([ASKED, leaf("understood", "heard")], "SUCCESS", "no answer"),
     ([ASKED, leaf("", "heard"), leaf("understood", "heard"), leaf("helped", "notice")], "SUCCESS",
      "complete"),
     ([ASKED, leaf("no", "heard"), leaf("helped", "notice")], "SUCCESS", "complete"),
     # nothing was asked: the question failed
     ([leaf("no", "heard")], "SUCCESS", "the visitor said no"),
     ([leaf("", "heard")], "SUCCESS", "no clear answer"),
     ([leaf("unanswered", "heard")], "SUCCESS", "no answer"),
     ([leaf("unanswered", "heard"), leaf("yes", "heard")], "SUCCESS", "complete"),
     ([exhibit("begun")], "SUCCESS", "complete at exhibit 1 of 2, Arm"),
     ([exhibit("begun"), exhibit("over"), exhibit("begun", 2)], "SUCCESS",
      "complete, 2 of 2 exhibits completed"),
     ([ARRIVED, exhibit("begun"), failed(), exhibit("over")
       ], "SUCCESS", "complete, 0 of 2 exhibits completed"),
     ([ARRIVED, exhibit("begun"), exhibit("over"), LEFT
       ], "SUCCESS", "complete at exhibit 1 of 2, Arm"),
     ([ARRIVED, exhibit("begun"), exhibit("over"), LEFT], "FAILURE", "the visitor left"),
     ([ARRIVED, LEFT], "SUCCESS", "complete"), ([ARRIVED, LEFT], "FAILURE", "the visitor left"),
     ([ARRIVED, LEFT, ARRIVED], "FAILURE", "it failed"),
     ([ARRIVED, LEFT, ENGAGED], "FAILURE", "it failed"),
     ([ARRIVED, LEFT, START], "FAILURE", "it failed"), ([LEFT], "FAILURE", "it failed"),
     ([Noticed("error", "no heap"), leaf()], "FAILURE", "no heap"),
     ([Noticed("warning", "no heap")], "FAILURE", "it failed"),
     ([failed(), leaf(uid=2)], "FAILURE", NOT_REACHED),
     ([failed(), failed(None, status="IDLE")], "FAILURE", NOT_REACHED),
     ([failed(), leaf()], "FAILURE", "it failed"), ([failed(), START], "FAILURE", "it failed"),
     ([failed(NO_FACE)], "FAILURE", "no face"),
     ([failed(replace(NO_FACE, message=""))], "FAILURE", "Navigate failed"),
     ([recovered("given up"), failed(uid=5)], "FAILURE", "gave up: " + THREE_TIMES),
     ([recovered("given up", "the budget is spent")
       ], "FAILURE", "gave up: the budget is spent; " + THREE_TIMES),
     ([recovered("given up"), START], "FAILURE", "it failed"),
     ([failed(), recovered("skipped")], "FAILURE", "it failed; without Navigate"),
     ([recovered("skipped"), failed(uid=5)], "FAILURE", "it failed; without Navigate"),
     ([recovered("skipped"), START, failed(uid=5)], "FAILURE", NOT_REACHED),
     ([exhibit("begun"), exhibit("omitted"),
       recovered("given up")], "FAILURE", "ended at exhibit 1 of 2, Arm: " + THREE_TIMES),
     ([
         exhibit("begun"),
         exhibit("omitted"),
         recovered("given up"),
         exhibit("omitted"),
         recovered("skipped")], "FAILURE", "it failed; without Navigate")])
def test_why_a_visit_ended_so(events, outcome, why):
    story = story_of(START, *events, PassFinished(1, outcome, 9.0))
    assert (how_it_ended(story.state.visit), story.state.visit.outcome) == (why, outcome)


def test_a_visit_is_complete_without_the_stops_that_were_left_out():
    rig, story = Rig(), Story()
    rig.mission.events.subscribe(lambda event: story.take(rig.clock.now(), event))
    rig.run(looks_away)
    visit = story.state.visit
    assert how_it_ended(visit) == "complete without exhibit 1, 1 of 2 exhibits completed"
    assert story.state.visit_results == {"complete without steps": 1}


@pytest.mark.parametrize("says, ending", [
    (None, "the visitor could not be asked: refused (/textToSpeech/say_text)"),
    ("perhaps later", "no clear answer"), ("no", "the visitor said no")])
def test_a_visit_with_a_robot_that_cannot_ask_is_not_complete(says, ending):
    rig, story = Rig(answer=refusing(Say)), Story()
    rig.mission.events.subscribe(lambda event: story.take(rig.clock.now(), event))
    rig.run(visitor_who(says))
    assert how_it_ended(story.state.visit).startswith(ending + "; without ")


@pytest.mark.parametrize("events, state, why", [
    ([exhibit("over")], COMPLETED, ""), ([failed(), exhibit("over")], BROKEN_OFF, NOT_REACHED),
    ([failed(), begins(2), exhibit("over")], COMPLETED, ""),
    ([failed(), begins(2, is_wait=True), leaf(uid=2), exhibit("over")], BROKEN_OFF, NOT_REACHED),
    ([begins(2), failed(), leaf(uid=2), exhibit("over")], COMPLETED, ""),
    ([begins(2), failed(), failed(None, 2, status="IDLE"), exhibit("over")], BROKEN_OFF,
     NOT_REACHED), ([failed(), leaf(uid=2), exhibit("over")], BROKEN_OFF, NOT_REACHED),
    ([failed(), leaf(), exhibit("over")], COMPLETED, ""),
    ([failed(), exhibit("over"), exhibit("begun")], UNDER_WAY, ""),
    ([failed(), exhibit("over"), exhibit("begun"), exhibit("over")], COMPLETED, ""),
    ([recovered("given up"), leaf(), exhibit("over")], BROKEN_OFF, THREE_TIMES),
    ([recovered("done"), exhibit("over")], COMPLETED, ""),
    ([failed(), recovered("skipped"), exhibit("over")], COMPLETED, ""),
    ([exhibit("omitted")], UNDER_WAY, ""),
    ([exhibit("omitted"), recovered("skipped")], LEFT_OUT, THREE_TIMES),
    ([exhibit("omitted", 2), recovered("skipped")], UNDER_WAY, ""),
    ([recovered("skipped")], UNDER_WAY, ""),
    ([exhibit("omitted", 2), recovered("skipped"), recovered("skipped")], UNDER_WAY, ""),
    ([exhibit("omitted"), recovered("given up")], BROKEN_OFF, THREE_TIMES),
    ([exhibit("over"), exhibit("omitted"), recovered("skipped")], COMPLETED, ""),
    ([ARRIVED, LEFT, exhibit("omitted"), recovered("given up")], BROKEN_OFF, HAS_LEFT),
    ([exhibit("omitted"), recovered("given up"), exhibit("omitted"),
      recovered("skipped", "budget")], LEFT_OUT, "budget; " + THREE_TIMES),
    ([exhibit("omitted"), recovered("given up"), exhibit("omitted"),
      recovered("given up", "budget")], BROKEN_OFF, THREE_TIMES),
    ([RunFinished("stopped", 0)], BROKEN_OFF, "the robot was stopped")])
def test_how_an_exhibit_ends(events, state, why):
    story = story_of(START, exhibit("begun"), *events)
    assert [(shown.number, shown.state, in_words(shown.why))
            for shown in story.state.visit.stops] == [(1, state, why)]


@pytest.mark.parametrize("events, state",
                         [([], UNDER_WAY), ([exhibit("over", 2)], COMPLETED),
                          ([failed(), exhibit("over", 2)], BROKEN_OFF),
                          ([exhibit("omitted", 2), recovered("skipped")], LEFT_OUT)])
def test_the_exhibit_before_stays_as_it_is(events, state):
    story = story_of(START, exhibit("begun"), exhibit("over"), exhibit("begun", 2), *events)
    assert [(shown.number, shown.state) for shown in story.state.visit.stops] == [(1, COMPLETED),
                                                                                     (2, state)]


@pytest.mark.parametrize("before, event, severity, text, leads_to", [
    ([], RUN, "info", "mission lab_tour starts, 2 mission leaves", ()),
    ([], RunFinished("stopped", 3), "info", "ends: stopped (exit code 3)", ()),
    ([START], PassFinished(1, "SUCCESS", 2.0), "info", "pass 1: SUCCESS after 2.0 s: complete", ()),
    ([START, Noticed("error", "no heap")], PassFinished(1, "FAILURE", 2.0), "warning",
     "pass 1: FAILURE after 2.0 s: no heap", ()),
    ([START], Paused(BUSY, "/go_node"), "warning",
     "waiting for /go_node to return: restart it; the mission goes on by itself", ()),
    ([START], Paused(BUSY, "", "the budget is spent", 20.0), "warning",
     "waiting 20 s: the budget is spent; the last failure: refused, busy (/go); check /go; the "
     "mission goes on by itself",
     ()),
    ([START], Paused(BUSY, "", "", 20.0), "warning",
     "waiting 20 s: the last failure: refused, busy (/go); check /go; the mission goes on by "
     "itself",
     ()),
    ([], SafeStateReported((HEAD, BODY), 0.1), "info", "attention and lifelike movement are off",
     ()),
    ([], SafeStateReported((HEAD,), 0.1), "info", "attention is off", ()),
    ([], SafeStateReported((), 0.1), "info",
     "the robot has neither attention nor lifelike movement to switch off", ()),
    ([], SafeStateReported((HEAD, replace(BODY, failure=BUSY)), 0.1), "warning",
     "attention is off; lifelike movement could not be switched off: refused, busy (/go)", ()),
    ([],
     SafeStateReported((replace(
         HEAD, failure=replace(BUSY, cause=Cause.NO_ANSWER, message="waited 1 s")), BODY), 0.1),
     "warning", "lifelike movement is off; whether attention is off is not known: no answer in "
                "time, waited 1 s (/go)",
     ()),
    ([], Noticed("error", "no heap"), "error", "no heap", ()),
    ([], Noticed("odd", "no heap"), "warning", "no heap", ()),
    ([], Suspended("paused"), "info", "paused", ()),
    ([], Suspended("paused", is_due=True), "info",
     "paused as soon as the robot has done what it does now", ()),
    ([], Suspended("paused", True, "/r/node/start"), "info",
     "paused as soon as the robot has done what it does now: to go on, rosservice call "
     "/r/node/start", ()),
    ([Suspended("paused")], Suspended(""), "info", "goes on, started by the operator", ()),
    ([], HELD, "warning", "held by a breakpoint of Groot2 at Say", (3, "tour/Say::3")),
    ([HELD], replace(HELD, is_held=False), "info",
     "no longer held by a breakpoint of Groot2 at Say", (3, "tour/Say::3")),
    ([], HealthChanged("topic", "/a", "", True, "well", ""), "info", "topic /a: well", ()),
    ([], HealthChanged("topic", "/a", "b", False, "ill", "so"), "warning",
     "topic /a (of node /b): ill; so", ()),
    ([START], leaf("arrived", uid=3), "info", "visitor 1 arrived", (3, "tour/leaf")),
    ([START], leaf("engaged", uid=3), "info", "visitor 1 looks at the robot", (3, "tour/leaf")),
    ([], leaf("", "said", "said “Hello”", 3), "info", "said “Hello”", (3, "tour/leaf")),
    ([START], exhibit("begun"), "info", "exhibit 1 of 2, Arm", (8, "tour/select")),
    ([START, exhibit("begun")], exhibit("over"), "info", "exhibit 1 of 2, Arm, is completed", (
        8, "tour/select")),
    ([START, exhibit("begun"), recovered("skipped"), recovered("skipped")], exhibit("over"),
     "warning", "exhibit 1 of 2, Arm, is completed without 2 steps (Navigate 2 times)",
     (8, "tour/select")),
    ([START, exhibit("begun"), failed()], exhibit("over"), "warning",
     "exhibit 1 of 2, Arm, is broken off: " + NOT_REACHED, (8, "tour/select")),
    ([], failed(), "warning", "Navigate failed: refused, busy (/go)", (1, "tour/go")),
    ([begins(3)], recovering(), "info", "trying Navigate again, attempt 2 of 4", (3, "tour/go")),
    ([begins(3)], recovering(2), "info",
     "trying Navigate again, attempt 3 of 4: refused, busy (/go)",
     (3, "tour/go")),
    ([begins(3)], recovering(0, "Say"), "info", "doing Say in place of Navigate", (3, "tour/go")),
    ([begins(3)], recovered("done"), "info",
     "Navigate succeeded on the 3rd attempt", (3, "tour/go")),
    ([begins(3)], recovered("skipped"), "warning",
     "went on without Navigate, which failed 3 times: refused (/go)", (3, "tour/go")),
    ([begins(3), recovering(0, "Say")], recovered("substituted"), "warning",
     "did Say in place of Navigate: refused, busy (/go)", (3, "tour/go")),
    ([begins(3)], recovered("skipped", failure=replace(BUSY, message="a motor failed"), attempts=1),
     "warning", "went on without Navigate, which failed 2 times: refused (/go)",
     (3, "tour/go")),
    ([begins(3)], recovered("skipped", failure=Failure(Cause.UNUSABLE_ANSWER, "a motor failed"),
                            attempts=0),
     "warning", "went on without Navigate, which failed: unusable answer, a motor failed",
     (3, "tour/go")),
    ([START, exhibit("begun"), exhibit("omitted", 2)], recovered("given up"), "error",
     "gave up: Navigate failed 3 times: refused (/go)", (0, "tour/go")),
    ([START, exhibit("begun"), exhibit("omitted"), recovered("given up"), exhibit("omitted")],
     recovered("given up", failure=replace(BUSY, message="stuck")), "error",
     "gave up: Navigate failed 3 times: refused (/go)", (0, "tour/go")),
    ([begins(3)], recovered("given up", attempts=0), "error", "gave up: " + NOT_REACHED,
     (3, "tour/go")),
    ([begins(3), RUN], recovered("done", attempts=1), "info",
     "Navigate succeeded on the 2nd attempt",
     (0, "tour/go")),
    ([START, exhibit("begun"), begins(3), exhibit("omitted")], recovered("skipped"), "warning",
     "exhibit 1 of 2, Arm, is left out: " + THREE_TIMES, (3, "tour/go")),
    ([START, exhibit("begun"), begins(3), exhibit("omitted")], recovered("given up"), "error",
     "exhibit 1 of 2, Arm, is broken off: " + THREE_TIMES, (3, "tour/go"))])
def test_the_sentence_about_an_event(before, event, severity, text, leads_to):
    told, = story_of(*before).take(60.0, event)
    assert (told.at, told.visit, told.severity, told.text, told.kind
            in KINDS) == (60.0, int(START in before), severity, text, True)
    assert (told.uid, told.path) == (leads_to or (0, ""))


@pytest.mark.parametrize("before, texts", [
    ([], []), ([START], []), ([START, ARRIVED], ["visitor 1: the robot was stopped"]),
    ([START, ARRIVED, PassFinished(1, "SUCCESS", 1.0)], [])])
def test_a_visit_that_is_stopped_has_a_sentence_if_a_visitor_came(before, texts):
    told = story_of(*before).take(60.0, RunFinished("stopped", 3))
    assert [sentence.text for sentence in told] == texts + ["ends: stopped (exit code 3)"]


@pytest.mark.parametrize(
    "before, event", [([], failed(NO_FACE)), ([recovered("skipped")], failed(uid=5)),
                      ([START, ARRIVED], ARRIVED), ([START, ENGAGED], ARRIVED), ([], ARRIVED),
                      ([], ENGAGED), ([], ASKED), ([START], leaf()), ([], begins()),
                      ([], exhibit("over")), ([], replace(HELD, is_held=False)),
                      # by an outer HandleFallBack, for the failure before the retries
                      ([recovered("given up")], replace(recovered(
                          "given up", "budget", NO_FACE, "other"), uid=6)),
                      ([], PassFinished(1, "SUCCESS", 1.0))])
def test_what_is_no_news_has_no_sentence(before, event):
    assert story_of(*before).take(60.0, event) == ()


@pytest.mark.parametrize("events, text", [
    ([begins()], "driving, 60 s"), ([begins(limit=180.0)], "driving, 60 s of at most 180 s"),
    ([begins(what="to Arm")], "driving to Arm, 60 s"),
    ([START, exhibit("begun"), begins(what="to Arm")],
     "exhibit 1 of 2, Arm · driving to Arm, 58 s"),
    ([START, exhibit("begun"), begins(what="to its home")],
     "exhibit 1 of 2, Arm · driving to its home, 58 s"),
    ([START, begins()], "driving, 59 s"), ([START, ARRIVED, begins()], "visitor 1 · driving, 58 s"),
    ([START, ARRIVED, PassFinished(1, "SUCCESS", 1.0)], ""), ([begins(), START], ""),
    ([begins(), RUN], ""),
    ([START, PassFinished(1, "FAILURE", 1.0), Paused(BUSY, "/go_node")],
     "waiting for /go_node to return, 58 s; the last failure: refused (/go) · "
     "next: the next visit"),
    ([START, PassFinished(1, "FAILURE", 1.0), Paused(BUSY, "/go_node"), PassStarted(2, 1.0)], ""),
    ([begins(), RunFinished("stopped", 0)], ""),
    ([START, begins(), PassFinished(1, "SUCCESS", 1.0)], ""), ([begins(), leaf()], ""),
    ([begins(), leaf(uid=2)], "driving, 60 s"), ([begins(), failed(NO_FACE)], ""),
    ([begins(is_wait=True), failed(NO_FACE, seconds=9.0)], "driving, 60 s"),
    ([begins(is_wait=True), failed()], ""),
    ([begins(limit=9.0, is_wait=True), failed(NO_FACE, seconds=8.0)],
     "driving, 60 s of at most 9 s"),
    ([begins(limit=9.0, is_wait=True), failed(NO_FACE, seconds=9.0)], ""),
    ([begins(is_wait=True), leaf()], ""),
    ([begins(is_wait=True), begins(2, "waiting", is_wait=True), leaf(uid=2)], ""),
    ([begins(), begins(2, "speaking")], "speaking, 59 s; also driving"),
    ([begins(), begins(2, "speaking"), leaf(uid=2)], "driving, 60 s"),
    ([begins(), begins(2, "speaking"), begins()], "driving, 58 s; also speaking"),
    ([begins(), begins(2, "waiting", is_wait=True), leaf(uid=2)], "driving, 60 s"),
    ([recovering()], "trying Navigate again, attempt 2 of 4, 60 s"),
    ([recovering(), begins(5)], "driving (attempt 2 of 4), 59 s"),
    ([recovering(), recovered("done"), begins()], "driving, 58 s"),
    ([recovering(), START, begins()], "driving, 58 s"),
    ([recovering(), begins(2), leaf(uid=2)], "trying Navigate again, attempt 2 of 4, 60 s"),
    ([begins(), Retried("Navigate", "tour/go", 1, BUSY)], ""),
    ([begins(), Retried("Say", "say", 1, BUSY)], "driving, 60 s"),
    ([begins(), recovered("done")], ""), ([begins(path="a"), recovered("done")], "driving, 60 s")])
def test_what_the_robot_does_now(events, text):
    assert now_of(story_of(*events).state, 60.0) == text


def asked(request):
    return Asked(1, service_of(request), request)


@pytest.mark.parametrize("events, text", [
    ([], "attention is off"), ([START], "attention is off"), ([RUN], "attention is off"),
    ([RunFinished("-", 0)], "attention is off"), ([asked(Say("Hello"))], "attention is off"),
    ([asked(SetAttention("disabled"))], "attention is off"),
    ([asked(SetAttention("social"))], ""), ([asked(GoTo(Location(1.0, 2.0, 3.0)))], "")])
def test_the_safe_state_is_known_until_the_robot_is_asked_for_what_ends_it(events, text):
    assert safe_state(story_of(SafeStateReported((HEAD, ), 0.1), *events).state) == text


def test_the_times_of_a_visit_are_those_when_each_thing_happened_first():
    visit = story_of(PassStarted(1, 100.0), leaf("arrived", at=130.0), leaf("engaged", at=140.0),
                     ASKED, ARRIVED, ENGAGED, ASKED, leaf("yes", "heard"),
                     PassFinished(1, "SUCCESS", 50.0)).state.visit
    assert (visit.began, visit.arrived, visit.engaged, visit.asked, visit.answer) == (0, 1, 2, 3,
                                                                                      "yes")
    assert (visit.waited, visit.seconds) == (30.0, 20.0)
    visit = story_of(START, leaf("engaged", at=4.0), ARRIVED).state.visit
    assert (visit.began, visit.arrived, visit.engaged) == (0, 1, 1)


@pytest.mark.parametrize("words", [
    "1st 2nd 3rd 4th 10th 11th 12th 13th 20th 21st 22nd 23rd 24th 101st 111th 112th 121st"])
def test_ordinals(words):
    assert [ordinal(int(word[:-2])) for word in words.split()] == words.split()


# ------------------------------------------------------------------------------------ what it bears


def test_it_keeps_a_bounded_number_of_visits_and_steps():
    story = Story()
    assert (story.state.visit_count, story.state.visit_results) == (0, {})
    for number in range(1, KEPT_VISITS + 10):
        story.take(1.0, PassStarted(number, 0.0))
        story.take(1.0, StepStarted(number, "x", "x", "doing", "", 0.0, False))
        story.take(1.0, PassFinished(number, "SUCCESS", 1.0))
        assert story.state.step is None
    assert len(story.state.visits) == KEPT_VISITS
    assert story.state.visits[-1].number == KEPT_VISITS + 9
    assert story.state.visit_results == {"complete": KEPT_VISITS + 9}


FAILURE = Failure(Cause.REFUSED, "\x1b[2J\n", "/x\x1b")


@pytest.mark.parametrize("event", [
    LeafFinished(7, "x", "x", "SUCCESS", "", 1.0, None, LeafSummary("odd", "\x1b[2J", "odd")),
    Noticed("odd", "\x1b[2J"),
    LeafFinished(7, "x", "x", "SUCCESS", "", 1.0, None, LeafSummary("visit", "", "left")),
    LeafFinished(7, "x", "x", "FAILURE", "", 1.0, FAILURE),
    PassFinished(3, "FAILURE", 1.0),
    Recovered("x\x1b", "x", FAILURE, "-", 2, False, "given up"),
    Recovered("x", "x", FAILURE, "-", 2, True, "substituted"),
    StopChanged(1, "x", "x", 3, 2, "\x1b", "begun"),
    StopChanged(1, "x", "x", 3, 2, "x", "omitted")])
def test_whatever_comes_in_whatever_order_is_one_line_each(event):
    story = Story()
    for known in (story.take(1.0, event), story.take(2.0, event)):
        assert all(sentence.text.isprintable() and sentence.kind in KINDS for sentence in known)
    assert now_of(story.state, 3.0).isprintable()


ODD = "\x1b[2J\u202e\ud800"
ODD_FAILURE = Failure(Cause.REFUSED, ODD, ODD)


def texts(value):
    """Return all texts in a record and the records in it."""
    return [value] if isinstance(
        value, str) else sum(map(texts, value), []) if isinstance(value, tuple) else []


@pytest.mark.parametrize("ends", [
    [LeafFinished(2, ODD, ODD, "FAILURE", ODD, 1.0, ODD_FAILURE),
     StopChanged(1, ODD, ODD, 1, 2, ODD, "over")],
    [Recovered(ODD, ODD, ODD_FAILURE, ODD, 1, False, "given up", ODD),
     PassFinished(1, "FAILURE", 1.0)],
    [StopChanged(1, ODD, ODD, 1, 2, ODD, "omitted"),
     Recovered(ODD, ODD, ODD_FAILURE, ODD, 1, True, "skipped", ODD)],
    [Noticed("error", ODD), PassFinished(1, ODD, 1.0)],
    [LeafFinished(2, ODD, ODD, "FAILURE", ODD, 1.0, replace(
         ODD_FAILURE, cause=Cause.CONDITION_FALSE)), PassFinished(1, "FAILURE", 1.0)]])
def test_no_text_of_a_story_s_records_does_anything_to_what_shows_it(ends):
    story = Story()
    records = [story.take(1.0, event)
               for event in [PassStarted(1, 0.0),
                             StopChanged(1, ODD, ODD, 1, 2, ODD, "begun"),
                             LeafFinished(2, ODD, ODD, "SUCCESS", ODD, 1.0, None,
                                          LeafSummary(ODD, ODD, ODD, 1.0))] + ends
               + [StepStarted(3, ODD, ODD, ODD, ODD, 1.0, False),
                  Recovering(4, ODD, ODD, ODD_FAILURE, 0, 1, ODD)]]
    visit = story.state.visit
    records += [how_it_ended(visit), tuple(each.name for each in visit.stops),
                now_of(story.state, 3.0), tuple(story.state.visit_results)]
    assert any("\\x1b" in text for text in texts(tuple(records)))
    assert [text for text in texts(tuple(records)) if not text.isprintable()] == []


@pytest.mark.parametrize("outcome", ["SUCCESS", "FAILURE"])
@pytest.mark.parametrize("ends", [[StopChanged(1, "x", "x", 1, 2, "Arm", "over")], []])
def test_an_exhibit_that_the_visitor_left_was_not_shown_whatever_the_mission_makes_of_it(
        ends, outcome):
    story = Story()
    for event in [
        PassStarted(1, 0.0),
        LeafFinished(7, "x", "x", "SUCCESS", "", 0.0, None, LeafSummary("visit", "", "arrived")),
        StopChanged(1, "x", "x", 1, 2, "Arm", "begun"),
        LeafFinished(7, "x", "x", "FAILURE", "", 0.0, Failure(Cause.CONDITION_FALSE, "no face"),
                     LeafSummary("visit", "", "left"))] + ends + [PassFinished(1, outcome, 5.0)]:
        story.take(1.0, event)
    assert (story.state.visit.stops[0].state,
            in_words(story.state.visit.stops[0].why)) == (BROKEN_OFF, HAS_LEFT)
    ended = how_it_ended(story.state.visit)
    assert ended.endswith(HAS_LEFT) and stop_name(story.state.visit.stops[0]) in ended


def toured(*steps):
    """Return a mission that goes on to the next exhibit whatever becomes of these steps."""
    return within("Sequence", "<RetrieveListOfExhibits/>" + within(
        "Inverter", "KeepRunningUntilFailure", "Sequence",
        ("<IsListWithExhibit/>" + within(
            "ForceSuccess", "Sequence", "<SelectExhibit/>" + "".join(steps)))))


DRIVES, TELLS = "<Navigate/>", "<DescribeExhibitSpeech name='1'/>"
RECOVERED = within("Fallback", DRIVES + "<HandleFallBack/>")
TWO_WAYS = within("Fallback", DRIVES + TELLS)
REFUSED = Failure(Cause.REFUSED, "the server refused", "/robotNavigation/set_goal")
LOST = why_failed("Navigate", REFUSED, is_short=True)
LOST_AGAIN = why_failed("Navigate", REFUSED, 3, is_short=True)


@pytest.mark.parametrize("mission, state, why", [
    (toured(DRIVES, TELLS), BROKEN_OFF, LOST), (toured(TELLS, DRIVES), BROKEN_OFF, LOST),
    (toured(within("ForceSuccess", DRIVES), TELLS), COMPLETED, ""),
    (toured(TWO_WAYS), COMPLETED, ""), (toured(retried(9, DRIVES)), COMPLETED, ""),
    (toured(RECOVERED, TELLS), BROKEN_OFF, LOST_AGAIN),
    (toured("<IsVisitorDiscovered/>", TELLS), BROKEN_OFF,
     IsVisitorDiscovered.otherwise + ": /faceDetection/data is silent (no message has come)"),
    (toured(within("Parallel success_count='1' failure_count='2'", DRIVES + TELLS)), COMPLETED, ""),
    (within("Sequence", "<RetrieveListOfExhibits/><SelectExhibit/>" + within(
         "ForceSuccess", "Sequence", DRIVES + TELLS)), BROKEN_OFF, LOST)])
def test_an_exhibit_is_broken_off_where_a_step_failed_and_none_came_after_it(mission, state, why):
    refused = iter([True] * 3)
    rig = one_leaf(mission, lambda request: refusal(request) if (
        isinstance(request, GoTo) and next(refused, False)) else NotImplemented)
    teller = Teller(rig).run(lambda rig: rig.clock.advance(0.5))
    assert teller.story.state.visit.outcome == "SUCCESS"
    shown = teller.story.state.visit.stops[0]
    assert (shown.state, in_words(shown.why)) == (state, why)
    if len(teller.story.state.visit.stops) > 1:
        _, ended, *_ = [sentence for sentence in teller.sentences if sentence.kind == "stop"]
        assert (ended.severity == "info") is not bool(why) and why in ended.text


def test_an_exhibit_under_way_is_under_way():
    story = Story()
    story.take(1.0, PassStarted(1, 0.0))
    story.take(1.0, StopChanged(1, "x", "x", 1, 2, "Arm", "begun"))
    assert story.state.stop.state == UNDER_WAY and now_of(
        story.state, 1.0) == stop_name(story.state.stop)


@pytest.mark.parametrize("outcome, state", [("SUCCESS", COMPLETED), ("FAILURE", BROKEN_OFF)])
def test_an_exhibit_under_way_ends_with_its_pass(outcome, state):
    story = Story()
    story.take(1.0, PassStarted(1, 0.0))
    story.take(1.0, StopChanged(1, "x", "x", 1, 2, "Arm", "begun"))
    story.take(3.0, PassFinished(1, outcome, 2.0))
    exhibit, = story.state.visits[-1].stops
    assert (exhibit.state, bool(exhibit.why), exhibit.seconds) == (state, state == BROKEN_OFF, 2.0)


@pytest.mark.parametrize("why, severity", [(Cause.CONDITION_FALSE, "warning"),
                                           (Cause.REFUSED, "error"), (Cause.NO_ANSWER, "error")])
def test_to_give_up_is_an_error_unless_a_visitor_brought_it_about_and_belongs_to_what_failed(
        why, severity):
    story, failure = Story(), Failure(why, "it is so", "/x")
    story.take(1.0, LeafFinished(7, "Navigate", "tour/Navigate", "FAILURE", "", 1.0, failure))
    told, = story.take(
        2.0, Recovered("Navigate", "tour/Navigate", failure, "-", 2, False, "given up", "", 5))
    assert (told.severity, told.uid, told.path) == (severity, 7, "tour/Navigate")


def test_a_weaker_trouble_has_no_sentence_while_a_stronger_one_lasts():
    story = Story()
    gone = HealthChanged("service", "/go", "driver", False, "gone", "it cannot drive", GONE)
    failing = replace(gone, respect=FAILING, status="failing: 3 calls in a row")
    back, works = replace(gone, is_well=True), replace(failing, is_well=True)
    told = [len(story.take(1.0, event)) for event in (gone, failing, works, back, failing, gone)]
    assert told == [1, 0, 0, 1, 1, 1]


@pytest.mark.parametrize("respect, words", [(NEW, "is new"), (GONE, "is asleep")])
def test_the_trouble_of_a_master_in_few_words(respect, words):
    change = HealthChanged("master", "http://m:11311", "", False, "is asleep", "so", respect)
    assert condition(change).endswith(words)


def ill(kind, name, respect, status="does not answer"):
    return HealthChanged(kind, name, "", False, status, "", respect)


@pytest.mark.parametrize("changes, words", [
    ([], ""),
    ([ill("service", "/a", GONE)], "/a is gone"),
    ([ill("service", "/a", "", "odd")], "/a is odd"),
    ([ill("service", "/a", "", "")], "/a"),
    ([ill("service", "/a", GONE), ill("topic", "/b", GONE)], "/a and /b are gone"),
    ([ill("service", "/a", GONE), ill("service", "/b", FAILING), ill("topic", "/c", GONE)],
     "/a and /c are gone; /b is failing"),
    ([ill("service", "/a", GONE), ill("topic", "/b", GONE), ill("service", "/c", GONE)],
     "/a, /b and /c are gone"),
    ([ill("service", "/a", GONE), ill("topic", "/b", GONE), ill("service", "/c", GONE),
      ill("action", "/d", GONE)], "2 services, 1 topic and 1 action are gone"),
    # the master's trouble is not that of a service
    ([ill("master", "http://m", GONE), ill("service", "/a", GONE), ill("service", "/b", GONE)],
     "the ROS master does not answer; /a and /b are gone"),
    ([ill("master", "http://m", GONE), ill("master", "http://n", NEW)],
     "the ROS master does not answer; the ROS master is new")])
def test_the_troubles_of_the_robot_in_few_words(changes, words):
    assert conditions(changes) == words


@pytest.mark.parametrize("results, words", [
    ({}, "no visit completed"), ({"complete": 1}, "1 visit: 1 complete"),
    ({"broken off": 1, "complete": 2}, "3 visits: 2 complete and 1 broken off"),
    ({"left": 1, "complete without steps": 2, "declined": 1},
     "4 visits: 2 complete without steps, 1 declined and 1 left"),
    ({"no reaction": 2, "stopped": 1}, "3 visits: 2 no reaction and 1 stopped")])
def test_how_many_visits_there_were(results, words):
    assert counted(State(visit_results=results)) == words


REFUSED_NO = Failure(Cause.CONDITION_FALSE, "no gaze seen", "/faces")


@pytest.mark.parametrize("outcome, why, skipped, result", [
    ("SUCCESS", Reason(DONE_ALL), {}, "complete"),
    ("SUCCESS", Reason(DONE_ALL), {"Say": 1}, "complete without steps"),
    ("SUCCESS", Reason(DECLINED), {}, "declined"), ("SUCCESS", Reason(UNCLEAR), {}, "no reaction"),
    ("SUCCESS", Reason(SILENT_VISITOR), {}, "no reaction"), ("FAILURE", HAS_GONE, {}, "left"),
    ("FAILURE", Reason(FAILED, "IsSeen", REFUSED_NO), {}, "no reaction"),
    ("FAILURE", Reason(GAVE_UP, "Go", BUSY), {}, "broken off"),
    ("FAILURE", Reason(FAILED), {}, "broken off"), ("", Reason(STOPPED), {}, "stopped"),
    # the robot could not see or hear: that is its fault
    ("FAILURE", Reason(LEFT, blind=ill("topic", "/faces", SILENT)), {}, "broken off"),
    ("SUCCESS", Reason(SILENT_VISITOR, blind=ill("topic", "/speech", GONE)), {}, "broken off")])
def test_the_result_of_a_visit(outcome, why, skipped, result):
    visit = Visit(1, 0.0, outcome=outcome, why=why, skipped=skipped, ended=1.0)
    assert visit.result == result


TABLET = service_of(Prompt)


@pytest.mark.slow
@pytest.mark.parametrize("by_voice, answer, result, ending", [
    (False, refusing(Prompt), BROKEN_OFF, f"the visitor could not be asked: refused ({TABLET})"),
    (False, lambda request: Answer("") if isinstance(request, Prompt) else NotImplemented,
     NO_REACTION, "no answer"),
    (True, lambda request: refusal(request) if getattr(request, "text", "").startswith("Would")
     else NotImplemented, NO_REACTION, "no answer; without QueryTourSpeech")])  # asked again
def test_a_visitor_who_was_not_asked_is_not_silent(by_voice, answer, result, ending):
    teller = Teller(Rig(answer=answer, asrEnabled=by_voice)).run(visitor_who())
    visit = teller.story.state.visit
    assert (visit.result, how_it_ended(visit)) == (result, ending)
    last, = [sentence for sentence in teller.sentences if sentence.text.startswith("pass 1: ")]
    assert (last.severity == "info") == (ending == "no answer")


ARM = Stop(1, 3, "arm", COMPLETED, None, 1.0)
CUP = Stop(2, 3, "cup", BROKEN_OFF, HAS_GONE, 1.0, noun="exhibit")


@pytest.mark.parametrize("stops, why, words", [
    ((), None, ""), ((ARM,), None, ""), ((), Reason(DONE_ALL), "complete"),
    ((), Reason(GAVE_UP, "Go", BUSY, 2), "gave up: Go failed 2 times: refused (/go)"),
    ((), Reason(FAILED, "Go", BUSY, 2), "Go failed 2 times: refused (/go)"),
    ((), Reason(FAILED), "it failed"), ((ARM,), Reason(DONE_ALL), "complete at stop 1 of 3, arm"),
    ((replace(ARM, number=3),), Reason(DONE_ALL), "complete, 1 of 3 stops completed"),
    ((ARM, replace(CUP, number=3)), Reason(DONE_ALL), "complete, 1 of 3 exhibits completed"),
    ((ARM, CUP), HAS_GONE, "ended at exhibit 2 of 3, cup: the visitor left"),
    ((ARM, CUP), Reason(GAVE_UP, "Go", BUSY),
     "ended at exhibit 2 of 3, cup: Go failed: refused (/go)"),
    ((CUP, ARM), HAS_GONE, "the visitor left")])
def test_how_a_visit_ended(stops, why, words):
    assert how_it_ended(Visit(1, 0.0, stops=stops, why=why)) == words


MUTE = {"Welcome": 1, "Describe": 5, "Ask": 2, "Part": 1, "Thank": 3}


@pytest.mark.parametrize("skipped, of_visit", [
    ({}, "complete"), ({"Say": 1}, "complete without Say"),
    ({"Say": 2}, "complete without 2 steps (Say 2 times)"),
    ({"Say": 1, "Go": 1}, "complete without 2 steps (Say and Go)"),
    (MUTE, "complete without 12 steps (Describe 5 times, Thank 3 times, Ask 2 times and 2 more)")])
def test_how_much_of_a_visit_was_done(skipped, of_visit):
    visit = Visit(1, 0.0, outcome="SUCCESS", ended=9.0, skipped=skipped, why=Reason(DONE_ALL))
    assert how_it_ended(visit) == of_visit
    assert visit.result == (IN_PART if skipped else COMPLETE)
    assert replace(visit, outcome="FAILURE").result == BROKEN_OFF
    end = run_end(State(visits=(visit,), finished=RunFinished("stopped; pass 1 was a SUCCESS", 0)))
    assert end == "stopped; pass 1 was a SUCCESS" + (f", {of_visit}" if skipped else "")
    end = RunFinished("all passes are done; pass 1 was a SUCCESS", 0)
    now = card(State(visits=(visit,), finished=end))
    assert (now.what, now.trouble) == (of_visit, end.outcome)  # that stands there once


BLIND = HealthChanged("topic", "/faces", "", False, "silent", "", SILENT)


@pytest.mark.parametrize("why, of_visit", [
    (HAS_GONE, "left"), (replace(HAS_GONE, blind=BLIND), "broken off"),
    (Reason(FAILED, "See", REFUSED_NO), "no reaction"), (Reason(DECLINED), "declined"),
    (Reason(STOPPED), "stopped"), (Reason(GAVE_UP), "broken off")])
def test_what_a_visitor_chooses_is_no_failure(why, of_visit):
    visit = Visit(1, 0.0, 1.0, outcome="FAILURE", ended=9.0, why=why)
    assert visit.result == of_visit
    assert visit.is_no_failure == (of_visit in ("left", "no reaction", "declined"))
    assert not replace(visit, arrived=None).is_no_failure  # nobody was there
    # without a step too
    visit = replace(visit, outcome="SUCCESS", skipped={"Say": 1})
    end = "stopped; pass 1 was a SUCCESS"
    if why.kind != GAVE_UP:
        assert run_end(State(visits=(visit,), finished=RunFinished(end, 0))) == end


def test_nothing_about_a_visitor_who_leaves_is_told_as_a_failure():
    sentences = Teller(rig_of("visitor left")).run(walks_off).sentences
    assert [one.text for one in sentences if one.severity != "info" or "FAIL" in one.text] == []
    assert sentences[-1].text == (
        "ends: all passes are done; pass 1 is over: the visitor left (exit code 3)")
    ending = next(one.text for one in sentences if one.text.startswith("pass 1: "))
    assert ending == ("pass 1: over after 16.0 s: ended at exhibit 1 of 2, exhibit 1: the visitor "
                      "left")


def test_a_mute_tour_is_no_complete_visit():
    teller = Teller(Rig(answer=refusing(Say))).run(visitor_who("yes"))
    state, run_over = teller.story.state, teller.sentences[-1].text
    visit = state.visit
    number = sum(event.outcome == SKIPPED for event in teller.rig.of(Recovered))
    assert visit.outcome == "SUCCESS" and sum(visit.skipped.values()) == number > 5
    assert f"complete without {number} steps (DescribeExhibitSpeech " in run_over
    assert "0 of 2 exhibits completed, 2 in part" in how_it_ended(visit)
    assert counted(state) == "1 visit: 1 complete without steps"
    assert run_over.endswith("(exit code 0)")
    assert [each.severity for each in teller.sentences if "is completed without" in each.text] == [
        "warning", "warning"]


def test_what_a_visit_that_failed_went_without_is_named_too():
    assert how_it_ended(Visit(1, 0.0, why=HAS_GONE, skipped={"Say": 1})) == (
        "the visitor left; without Say")


def test_how_far_a_visit_came():
    in_part = replace(ARM, skipped={"Say": 1})
    assert completed(Visit(1, 0.0, stops=(ARM, in_part))) == "1 of 3 stops completed, 1 in part"
    assert completed(Visit(1, 0.0)) == ""
    assert completed(Visit(1, 0.0, stops=(ARM, ARM, CUP))) == "2 of 3 exhibits completed"
    assert completed(Visit(1, 0.0, stops=(CUP, ARM))) == "1 of 3 stops completed"


@pytest.mark.parametrize("reason, words", [
    (None, ""), (HAS_GONE, "the visitor left"),
    (replace(HAS_GONE, blind=ill("topic", "/f", GONE)),
     "the visitor could not be seen: /f is gone"),
    (Reason(FAILED, blind=ill("topic", "/f", GONE)), "it failed: /f is gone"),
    (Reason(FAILED, policy="no retry is left"), "no retry is left; it failed"),
    (Reason(FAILED, "Go", BUSY, without="Look"), "Go failed: refused (/go)"),
    (Reason(FAILED, "See", NO_FACE, without="Look"), "no face: went on without Look"),
    (Reason(FAILED, "See", NO_FACE, 3), "no face"), (Reason(NOTICED, text="so \x1b"), "so \\x1b")])
def test_why_something_ended(reason, words):
    assert in_words(reason) == words


@pytest.mark.parametrize("step, words", [
    (("driving", "to Arm", ""), "driving to Arm"), (("driving", "", ""), "driving"),
    (("driving", "to Arm", "3 m left"), "driving to Arm, 3 m left")])
def test_what_a_step_does(step, words):
    doing, what, feedback = step
    assert step_words(Step(doing, 0.0, 0.0, 1, False, what=what, feedback=feedback)) == words


def test_a_visitor_is_not_blamed_for_what_the_robot_went_on_without():
    rig = Rig(answer=lambda request: refusal(request) if isinstance(request, SetAttention) and (
        request.state == "seeking") else NotImplemented)
    visit = Teller(rig).run(visitor_who(gazes=False)).story.state.visit
    assert how_it_ended(visit) == "{}: went on without SeekOvertAttentionMode".format(
        IsMutualGazeDiscovered.otherwise)


def test_what_is_noticed_of_a_service_in_the_recovery_from_its_failure_is_of_that_incident():
    gone = HealthChanged("service", "/go", "go_node", False, "gone", "no drive", GONE)
    other = replace(gone, name="/say")
    story = story_of(START, failed(), recovering())
    began = story.take(11.0, gone)[0].incident
    assert (began, story.take(12.0, replace(gone, is_well=True))[0].incident) == (1.0, 1.0)
    assert story.take(13.0, other)[0].incident == 13.0


def test_what_belongs_to_one_cause_is_one_incident():
    teller = Teller(Rig(answer=refusing(PerformGesture))).run(visitor_who("yes"))
    incidents = [each.incident for each in teller.sentences if each.kind in ("failure", "recovery")]
    assert all(incidents) and len(set(incidents)) < len(incidents)
    assert {each.incident for each in teller.sentences if each.kind == "said"} == {0.0}
