"""HandleFallBack and its policy: what is retried, left out, given up, and when the budget is spent.
"""
import dataclasses
from math import inf

import pytest

from behavior_controller import folders, leaves
from behavior_controller.config import recovery_policy
from behavior_controller.bt.values.status import FAILURE, RUNNING, SUCCESS
from behavior_controller.errors import ConfigurationError, MissionError
from behavior_controller.run.events import (HealthChanged, LeafFinished, Noticed, Recovered,
                                                  Recovering, Retried, SafeStateReported,
                                                  StopChanged)
from behavior_controller.robot.gateway import Cause, Failure
from behavior_controller.run.health import GONE
from behavior_controller.robot.requests import (
    Answer, Faces, GoTo, Location, Point, QueryKnowledge, Say, SetAnimation, SetAttention)
from behavior_controller.robot.d543 import FACES
from behavior_controller.leaves.base import ServiceLeaf, leaf_spec
from behavior_controller.leaves.data import TARGET_LOCATION
from behavior_controller.simulation.rehearsal.plays import Scenario, ScenarioRunner
from behavior_controller.text import Source
from mission_rig import EXHIBITS, one_leaf, refusal, service_of, write

SPEC = {spec.id: spec for spec in leaves.SPECS}
DELIVERED = recovery_policy.load(folders.config("recoveryPolicy.ini"), leaves.mission_specs())
SAFE = [SetAttention("disabled"), SetAnimation("disabled")]


def fallback(leaf, answer, **changed):
    return one_leaf("<Fallback>{}<HandleFallBack/></Fallback>".format(leaf), answer, **changed)


def failing(times, cause, value=Answer()):
    """Return a server that fails that often, then answers ``value``."""
    left = [times]

    def answer(request):
        if request in SAFE:
            return Answer()
        left[0] -= 1
        return Failure(cause, "test", service_of(request)) if left[0] >= 0 else value
    return answer


def to_the_end(rig):
    for _ in range(50):
        result = rig.tick()
        if result is not RUNNING:
            return result
        rig.clock.advance(0.5)
    raise AssertionError("no end")


def test_a_retry_waits_its_back_off_and_then_twice_as_long():
    rig = fallback("<Navigate/>", failing(9, Cause.REFUSED))
    write(rig, targetLocation=Location(1.0, 2.0, 3.0))
    when = []
    for _ in range(80):
        before = len(rig.requests)
        result = rig.tick()
        when += [rig.clock.now() - 1000.0] * (len(rig.requests) - before)
        if result is not RUNNING:
            break
        rig.clock.advance(0.125)
    goals = [request for request in rig.requests if isinstance(request, GoTo)]
    assert goals == 3 * [GoTo(Location(1.0, 2.0, 3.0))]
    assert when[:3] == [0.0, 1.0, 3.0]  # the policy's back-off is 1 s for Navigate


def test_a_step_that_works_at_the_second_attempt_has_its_effects():
    rig = fallback("<RetrieveListOfExhibits/>", failing(1, Cause.REFUSED,
                                                        Answer(exhibits=EXHIBITS)))
    assert to_the_end(rig) is SUCCESS
    assert rig.tree.blackboard.get("exhibits") == list(EXHIBITS)
    assert [(event.attempts, event.success) for event in rig.of(Recovered)] == [(1, True)]


def test_an_answer_without_content_counts_as_a_failed_attempt():
    rig = fallback("<RetrieveListOfExhibits/>", lambda request: Answer())
    assert to_the_end(rig) is FAILURE
    assert rig.requests == 3 * [QueryKnowledge("exhibits")] + SAFE


@pytest.mark.parametrize("node, cause, asked, result", [
    # refused: surely nothing was done, so once more; then the tour goes on without
    ("WelcomeSpeech", Cause.REFUSED, 2, SUCCESS),
    ("WelcomeSpeech", Cause.NOT_REACHABLE, 2, SUCCESS),
    # it may have been said: never twice
    ("WelcomeSpeech", Cause.NO_ANSWER, 1, SUCCESS),
    ("WelcomeSpeech", Cause.CONNECTION_LOST, 1, SUCCESS),
    ("WelcomeGesture", Cause.NO_ANSWER, 1, SUCCESS),
    ("SocialOvertAttentionMode", Cause.NO_ANSWER, 2, SUCCESS),
    ("SocialOvertAttentionMode", Cause.TYPE_MISMATCH, 1, SUCCESS),
    ("Navigate", Cause.REFUSED, 3, FAILURE),
    ("Navigate", Cause.NO_ANSWER, 2, FAILURE),
    ("Navigate", Cause.TYPE_MISMATCH, 1, FAILURE),
    ("LookUpHome", Cause.REFUSED, 3, FAILURE),
    ("PressYesNoDialogue", Cause.REFUSED, 1, FAILURE)])
def test_the_delivered_policy(node, cause, asked, result):
    rig = fallback("<{}/>".format(node), failing(99, cause))
    write(rig, **{TARGET_LOCATION.name: Location(1.0, 2.0, 3.0)})
    assert to_the_end(rig) is result
    assert [request for request in rig.requests if request not in SAFE] == asked * [rig.requests[0]]
    assert rig.requests[asked:] == (SAFE if result is FAILURE else [])


@pytest.mark.parametrize(
    "node", ["IsVisitorDiscovered", "IsVisitorResponseYes", "IsListWithExhibit", "IsYesNoUttered"])
def test_an_answer_no_is_not_turned_into_a_yes(node):
    rig = fallback("<{}/>".format(node), lambda request: Answer())
    assert to_the_end(rig) is FAILURE
    assert [(event.failure.cause, event.success)
            for event in rig.of(Recovered)] == [(Cause.CONDITION_FALSE, False)]


def test_without_a_visitors_gaze_the_mission_goes_on():
    assert to_the_end(fallback("<IsMutualGazeDiscovered/>", lambda request: Answer())) is SUCCESS


@pytest.mark.parametrize(
    "node", ["Navigate", "SelectExhibit", "RetrieveListOfExhibits", "LookUpEntrance", "LookUpHome"])
@pytest.mark.parametrize("cause", list(Cause))
def test_what_the_tour_rests_on_is_never_skipped(node, cause):
    assert DELIVERED.rule(SPEC[node], cause).then == recovery_policy.GIVE_UP
    anything_goes = recovery_policy.Policy(
        (recovery_policy.Rule("*", "*", 0, 0.0, recovery_policy.SKIP), ), 9, 9.0)
    assert anything_goes.rule(SPEC[node], cause).then == recovery_policy.GIVE_UP


def test_other_nodes_may_be_skipped_by_a_rule_for_all():
    rules = recovery_policy.Policy((recovery_policy.Rule("*", "*", 0, 0.0, recovery_policy.SKIP), ),
                                   9, 9.0)
    assert rules.rule(SPEC["WelcomeSpeech"], Cause.REFUSED).then == recovery_policy.SKIP


def test_without_a_rule_a_failure_is_given_up():
    assert str(recovery_policy.Policy((), 9, 9.0).rule(SPEC["WelcomeSpeech"],
                                                       Cause.REFUSED)) == "give up"


@pytest.mark.parametrize("word, cause", [("refused", Cause.REFUSED),
                                         ("exception", Cause.HANDLER_EXCEPTION),
                                         ("no-answer", Cause.NO_ANSWER),
                                         ("connection-lost", Cause.CONNECTION_LOST),
                                         ("not-reachable", Cause.NOT_REACHABLE),
                                         ("not-advertised", Cause.NOT_ADVERTISED),
                                         ("type-mismatch", Cause.TYPE_MISMATCH),
                                         ("unusable-answer", Cause.UNUSABLE_ANSWER),
                                         ("missing-data", Cause.MISSING_DATA),
                                         ("condition-false", Cause.CONDITION_FALSE)])
def test_the_words_for_causes(tmp_path, word, cause):
    rules = read(tmp_path, "budget 5 10\nWelcomeSpeech {} 7 0 skip\n".format(word))
    assert [other for other in Cause
            if rules.rule(SPEC["WelcomeSpeech"], other).retries == 7] == [cause]
    with open(folders.config("recoveryPolicy.ini"), encoding="utf-8") as file:
        explained = file.read().split("# retries")[0]
    assert word in explained.replace(",", "").split()


def test_after_a_subtree_only_going_on_or_giving_up_is_possible():
    rig = fallback("<Sequence><FollowMeSpeech/></Sequence>", failing(9, Cause.REFUSED))
    assert to_the_end(rig) is SUCCESS
    assert len(rig.requests) == 1


UNTIL_SEEN = ("<ReactiveFallback><IsVisitorDiscovered/><ForceFailure><Sleep msec='{}'/>"
              "</ForceFailure></ReactiveFallback>")
SEEN, UNSEEN = UNTIL_SEEN.format(2000), "no face seen"
DRIVE = "<Navigate target='1;2;3'/>"


@pytest.mark.parametrize("steps, node, cause, words, outcome", [
    (f"<Timeout msec='5000'><Sequence>{SEEN}<WelcomeSpeech/></Sequence></Timeout>", "WelcomeSpeech",
     Cause.NO_ANSWER, "Timeout::2 halted WelcomeSpeech::8 before it was done", "skipped"),
    (f"<Timeout msec='5000'><Sequence>{SEEN}{DRIVE}</Sequence></Timeout>", "Navigate",
     Cause.NO_ANSWER, "Timeout::2 halted Navigate::8 before it was done", "given up"),
    (f"<Timeout msec='5000'>{DRIVE}</Timeout>", "Navigate",
     Cause.NO_ANSWER, "Timeout::2 halted Navigate::3 before it was done", "given up"),
    (f"<Timeout msec='5000'><Sequence>{SEEN}<Sleep msec='9000'/></Sequence></Timeout>", "Timeout",
     Cause.NO_ANSWER, "Timeout::2 halted Sleep::8 before it was done", "given up"),
    (f"<Sequence>{SEEN}<ReactiveSequence><ScriptCondition code='is_open'/>{DRIVE}"
     "</ReactiveSequence></Sequence>", "ScriptCondition", Cause.CONDITION_FALSE,
     "ScriptCondition::8 does not hold", "given up"),
    (f"<Sequence>{SEEN}<IsVisitorResponseYes/></Sequence>", "IsVisitorResponseYes",
     Cause.CONDITION_FALSE, "", "given up"),
    ("<Sequence><ForceSuccess><IsASREnabled/></ForceSuccess><ScriptCondition code='!is_open'/>"
     "</Sequence>", "ScriptCondition", Cause.CONDITION_FALSE,
     "ScriptCondition::5 does not hold", "given up"),
    ("<Sequence><Fallback><IsASREnabled/><AlwaysSuccess/></Fallback><AlwaysFailure/></Sequence>",
     "HandleFallBack", Cause.MISSING_DATA,
     "AlwaysFailure::6 failed, and no mission node failed before", "given up"),
    ("<Sequence><Inverter><IsASREnabled/></Inverter><IsASREnabled/></Sequence>", "IsASREnabled",
     Cause.CONDITION_FALSE, "", "given up"),
    (f"<Timeout msec='1000'>{SEEN}</Timeout>", "IsVisitorDiscovered", Cause.CONDITION_FALSE,
     UNSEEN, "given up"),
    ("<Timeout msec='1000'><RetryUntilSuccessful num_attempts='-1'><Sequence><Sleep msec='300'/>"
     "<IsVisitorDiscovered/></Sequence></RetryUntilSuccessful></Timeout>", "IsVisitorDiscovered",
     Cause.CONDITION_FALSE, UNSEEN, "given up"),
    ("<Timeout msec='1000'><Inverter><KeepRunningUntilFailure><Inverter><IsVisitorDiscovered/>"
     "</Inverter></KeepRunningUntilFailure></Inverter></Timeout>", "IsVisitorDiscovered",
     Cause.CONDITION_FALSE, UNSEEN, "given up"),
    (f"<Sequence><Fallback>{UNTIL_SEEN.format(200)}<HandleFallBack/></Fallback></Sequence>",
     "IsVisitorDiscovered", Cause.CONDITION_FALSE, UNSEEN, "given up")])
def test_the_failure_that_led_to_a_recovery_is_its_cause(steps, node, cause, words, outcome):
    """The visitor is seen after 1.5 s; a drive and speech have no answer, and after 4 s a door is
    closed."""
    rig = one_leaf(f"<Fallback>{steps}<HandleFallBack/></Fallback>",
                   lambda request: Answer() if request in SAFE else None, asrEnabled=False)
    write(rig, is_open=True)
    rig.clock.call_after(1.5, lambda: rig.topics.publish(FACES, Faces(("1",), (True,))))
    rig.clock.call_after(4.0, lambda: write(rig, is_open=False))
    assert to_the_end(rig) is (SUCCESS if outcome == "skipped" else FAILURE)
    event = rig.of(Recovered)[-1]
    assert (event.node, event.failure.cause, event.outcome) == (node, cause, outcome)
    assert words in event.failure.message
    assert rig.requests.count(SAFE[0]) == (outcome == "given up" and node != "HandleFallBack")


@pytest.mark.parametrize("failing_step", [
    "<Inverter>{}</Inverter>", "<ForceSuccess>{}</ForceSuccess>",
    "<Fallback>{}<AlwaysSuccess/></Fallback>"])
def test_a_failure_that_has_become_a_success_leads_to_a_recovery_after_it(failing_step):
    step = failing_step.format("<WelcomeSpeech/>")
    rig = one_leaf(f"<Sequence>{step}<HandleFallBack/></Sequence>", refusal)
    assert to_the_end(rig) is SUCCESS
    assert [event.node for event in rig.of(Recovered)] == ["WelcomeSpeech"]


def test_a_condition_that_waits_is_the_cause_when_its_time_is_over():
    rig = fallback("<Timeout msec='1000'><IsVisitorDiscovered/></Timeout>", refusal,
                   conditionWait=9.0)
    assert to_the_end(rig) is FAILURE
    failure = Failure(Cause.CONDITION_FALSE,
                      "Timeout::2 halted IsVisitorDiscovered::3 before it was done", FACES.name)
    assert [(event.node, event.failure) for event in rig.of(Recovered)] == [
        ("IsVisitorDiscovered", failure)]


def test_a_rehearsal_shows_the_cause_of_a_recovery(tmp_path):
    """The visitor looks at the robot at once, and its words take longer than the time limit."""
    mission = tmp_path / "m.xml"
    mission.write_text(
        "<root BTCPP_format='4'><BehaviorTree ID='M'><Sequence><SeekOvertAttentionMode/><Fallback>"
        "<Timeout msec='9000'><Sequence><ReactiveFallback><IsMutualGazeDiscovered/><ForceFailure>"
        "<Sleep msec='8000'/></ForceFailure></ReactiveFallback><QueryTourSpeech/><QueryTourSpeech/>"
        "<QueryTourSpeech/><QueryTourSpeech/></Sequence></Timeout><HandleFallBack/></Fallback>"
        "</Sequence></BehaviorTree></root>", encoding="utf-8")
    run = ScenarioRunner({}, str(mission), 100.0).play(Scenario("engages")).run
    assert [(each.node, each.outcome) for each in run.recoveries] == [
        ("QueryTourSpeech", "skipped")]
    assert "Timeout::4 halted QueryTourSpeech" in run.recoveries[0].recovered.failure.message


def test_nothing_failed_before_is_a_failure():
    rig = one_leaf("<Fallback><AlwaysFailure/><HandleFallBack/></Fallback>")
    assert rig.tick() is FAILURE
    nothing = Failure(Cause.MISSING_DATA,
                      "AlwaysFailure::2 failed, and no mission node failed before")
    assert rig.of(Recovered) == [Recovered(
        "HandleFallBack", "HandleFallBack::3", nothing, "give up", 0, False, "given up", "", 3)]
    assert [event.failure for event in rig.of(LeafFinished)] == [None]  # the event above tells it
    assert rig.requests == []


def test_an_old_failure_is_not_handled_again():
    rig = one_leaf("<Fallback><Sequence><WelcomeSpeech/><AlwaysFailure/></Sequence>"
                   "<HandleFallBack/></Fallback>", failing(1, Cause.NO_ANSWER))
    assert to_the_end(rig) is SUCCESS
    assert to_the_end(rig) is FAILURE  # the speech worked: what failed now is not a mission node


def test_each_branch_of_a_parallel_recovers_from_its_own_failure():
    def answer(request):
        return Failure(Cause.REFUSED, "test", service_of(request)) if isinstance(request,
                                                                                 Say) else Answer()

    rig = one_leaf("<Parallel><Fallback><GoodbyeGesture/><HandleFallBack/></Fallback>"
                   "<Fallback><SayGoodByeSpeech/><HandleFallBack/></Fallback></Parallel>", answer)
    assert to_the_end(rig) is SUCCESS
    assert [event.node for event in rig.of(Recovered)] == ["SayGoodByeSpeech"]


def test_no_policy_skips_a_drive_or_what_says_where_to_drive():
    assert {spec.id for spec in leaves.SPECS if spec.is_indispensable} == {
        "Navigate", "NavigateAsync", "RetrieveListOfExhibits", "SelectExhibit", "LookUpEntrance",
        "LookUpHome", "RetrieveInitialLocation"}


def test_a_recovery_needs_no_list_of_exhibits_under_either_spelling():
    recoveries = [spec for spec in leaves.SPECS if spec.is_recovery]
    assert [spec.id for spec in recoveries] == ["HandleFallBack", "HandleFallback"]
    assert all(port.is_optional for spec in recoveries for port in spec.ports)


def test_the_budget_ends_endless_recovery():
    rig = one_leaf("<Fallback><WelcomeSpeech/><HandleFallBack/></Fallback>",
                   failing(9999, Cause.NO_ANSWER))
    rig.mission.policy = dataclasses.replace(rig.mission.policy, most=2, seconds=100.0)
    assert [to_the_end(rig) for _ in range(3)] == [SUCCESS, SUCCESS, FAILURE]
    rig.clock.advance(99.0)
    assert to_the_end(rig) is FAILURE
    rig.clock.advance(100.0)
    assert to_the_end(rig) is SUCCESS


@pytest.mark.parametrize("most, times, allowed, again_at", [
    (0, [0.0, 100.0], "--", inf), (1, [], "", -inf), (1, [0.0], "+", 6.0),
    (1, [0.0, 5.9], "+-", 11.9), (1, [0.0, 6.0], "++", 12.0), (1, [0.0, 6.1], "++", 12.1),
    (2, [0.0], "+", -inf), (2, [0.0, 1.0], "++", 6.0), (2, [0.0, 1.0, 5.9], "++-", 7.0),
    (2, [0.0, 1.0, 6.0], "+++", 7.0), (2, [0.0, 1.0, 6.0, 7.0], "++++", 12.0)])
def test_so_many_recoveries_may_begin_within_the_seconds_of_the_budget(most, times, allowed,
                                                                       again_at):
    rig = one_leaf("<HandleFallBack/>")
    mission, found = rig.mission, []
    mission.policy = dataclasses.replace(mission.policy, most=most, seconds=6.0)
    for time in times:
        rig.clock.set_to(1000.0 + time)
        found.append(mission.afford_recovery())
    assert found == [sign == "+" for sign in allowed]
    assert mission.failures.is_budget_spent is ("-" in allowed)
    assert mission.recovers_again_at() - 1000.0 == pytest.approx(again_at)


def test_beyond_the_budget_nothing_is_retried():
    rig = fallback("<WelcomeSpeech/>", failing(9999, Cause.REFUSED))
    rig.mission.policy = dataclasses.replace(rig.mission.policy, most=0, seconds=60.0)
    assert to_the_end(rig) is FAILURE
    assert rig.requests[1:] == SAFE
    report, = rig.of(SafeStateReported)
    assert [(part.what, part.failure) for part in report.parts] == [
        ("attention", None), ("lifelike movement", None)]
    assert [event.policy for event in rig.of(Recovered)
            ] == ["give up: the budget of 0 recoveries in 60 s is spent"]
    rig.mission.policy = dataclasses.replace(rig.mission.policy, most=99)
    assert to_the_end(rig) is SUCCESS
    assert rig.of(Recovered)[-1].policy == "retry 1x, then skip"


def test_another_cause_at_the_second_attempt_has_a_rule_of_its_own():
    # refused, surely not said; then no answer, perhaps said: not a third time
    causes = [Cause.REFUSED, Cause.NO_ANSWER, Cause.REFUSED, Cause.REFUSED]
    rig = fallback("<WelcomeSpeech/>", lambda request: Failure(
        causes[len(rig.requests) - 1], "test", service_of(request)))
    rig.mission.policy = recovery_policy.Policy(
        (recovery_policy.Rule("*", "refused", 3, 0.5, recovery_policy.SKIP),
         recovery_policy.Rule("*", "*", 0, 0.0, recovery_policy.SKIP)), 9, 9.0)
    assert to_the_end(rig) is SUCCESS
    assert len(rig.requests) == 2
    assert [(event.failure.cause, event.attempts, event.policy) for event in rig.of(Recovered)] == [
        (Cause.NO_ANSWER, 1, "skip")]


def test_data_that_went_missing_meanwhile_ends_the_attempts():
    rig = fallback("<Navigate/>", failing(9, Cause.REFUSED))
    write(rig, targetLocation=Location(1.0, 2.0, 3.0))
    assert rig.tick() is RUNNING
    rig.tree.blackboard.unset("targetLocation")
    assert to_the_end(rig) is FAILURE
    assert rig.requests == [GoTo(Location(1.0, 2.0, 3.0))] + SAFE
    assert rig.of(Recovered)[0].failure.cause is Cause.MISSING_DATA


def test_what_has_become_needless_counts_as_done():
    rig = fallback("<PerformDeicticGesture/>", failing(9, Cause.REFUSED))
    write(rig, gestureTarget=Point(1.0, 2.0, 3.0))
    assert rig.tick() is RUNNING
    write(rig, gestureTarget=Point(0.0, 0.0, 0.0))
    assert to_the_end(rig) is SUCCESS
    assert len(rig.requests) == 1
    assert [event.success for event in rig.of(Recovered)] == [True]


def test_giving_up_waits_for_the_safe_state_and_asks_for_nothing_else():
    rig = fallback("<PressYesNoDialogue/>", lambda request: None
                   if request in SAFE else refusal(request))
    for _ in range(3):
        assert rig.tick() is RUNNING
    assert rig.requests[1:] == SAFE
    for call in rig.gateway.calls[1:]:
        assert rig.of(Recovered) == []
        call.finish(Answer())
        result = rig.tick()
    assert result is FAILURE
    assert rig.requests[1:] == SAFE


def test_a_recovery_wakes_the_tree_when_a_pause_is_over_and_tells_how_long_it_took():
    rig = fallback("<Navigate/>", failing(1, Cause.REFUSED))
    write(rig, targetLocation=Location(1.0, 2.0, 3.0))
    rig.tick()
    rig.tree.wake.test_and_clear()
    rig.clock.advance(0.9)
    assert not rig.tree.wake.test_and_clear()
    rig.clock.advance(0.1)
    assert rig.tree.wake.test_and_clear()
    assert rig.tick() is SUCCESS
    assert [(event.node, event.seconds) for event in rig.of(LeafFinished)] == [
        ("Navigate", 0.0), ("HandleFallBack", 1.0)]


@pytest.mark.parametrize("times, retried, outcome", [
    (1, [], "done"), (2, [1], "done"), (3, [1, 2], "given up")])
def test_each_attempt_that_fails_is_told_and_how_it_ended(times, retried, outcome):
    rig = fallback("<Navigate/>", failing(times, Cause.REFUSED))  # the policy: twice more
    write(rig, targetLocation=Location(1.0, 2.0, 3.0))
    assert to_the_end(rig) is (FAILURE if outcome == "given up" else SUCCESS)
    assert [(event.node, event.attempt, event.failure.cause) for event in rig.of(Retried)] == [
        ("Navigate", attempt, Cause.REFUSED) for attempt in retried]
    assert [(event.outcome, event.success)
            for event in rig.of(Recovered)] == [(outcome, outcome == "done")]
    first, last = rig.of(LeafFinished)[0], rig.of(LeafFinished)[-1]
    assert (last.node, last.failure) == ("HandleFallBack",
                                         first.failure if outcome == "given up" else None)


def test_what_is_left_out_is_told_as_skipped():
    rig = fallback("<WelcomeSpeech/>", failing(9, Cause.NO_ANSWER))
    assert to_the_end(rig) is SUCCESS
    assert [event.outcome for event in rig.of(Recovered)] == ["skipped"]


def gone(service, is_well=False):
    return HealthChanged("service", service, "", is_well, "", "")


def goals_of(rig, seconds):
    """Tick for that long and return when, since the start, the robot was asked to drive."""
    when = []
    for _ in range(int(seconds / 0.25)):
        before = len(rig.requests)
        rig.tick()
        when += [rig.clock.now() - 1000.0 for request in rig.requests[before:]
                 if isinstance(request, GoTo)]
        rig.clock.advance(0.25)
    return when


def test_a_retry_waits_for_a_service_that_is_gone_to_come_back():
    rig = fallback("<Navigate/>", failing(1, Cause.CONNECTION_LOST))
    write(rig, targetLocation=Location(1.0, 2.0, 3.0))
    rig.report(GONE, gone(service_of(GoTo)))
    assert goals_of(rig, 5.0) == [0.0]
    rig.report(GONE, gone(service_of(GoTo), is_well=True))
    assert goals_of(rig, 0.25) == [5.0]
    assert [event.outcome for event in rig.of(Recovered)] == ["done"]
    assert rig.clock.next_due() is None


def test_the_answer_to_a_retry_counts_if_the_service_is_gone_when_it_comes():
    rig = fallback("<Navigate/>", lambda request: refusal(request)
                   if len(rig.requests) == 1 else None)
    write(rig, targetLocation=Location(1.0, 2.0, 3.0))
    assert goals_of(rig, 2.0) == [0.0, 1.0]
    rig.report(GONE, gone(service_of(GoTo)))
    rig.gateway.calls[1].finish(Answer())
    assert rig.tick() is SUCCESS


def test_the_wait_for_a_service_has_an_end():
    rig = fallback("<Navigate/>", failing(9, Cause.NOT_REACHABLE))
    write(rig, targetLocation=Location(1.0, 2.0, 3.0))
    rig.report(GONE, gone(service_of(GoTo)))
    # the back-off of 1 s, then at most RETURN_LIMIT; the second retry waits its own back-off of 2 s
    # only
    assert goals_of(rig, 30.0)[:3] == [0.0, 1.0 + 15.0, 1.0 + 15.0 + 2.0]


def test_nobody_waits_for_what_may_be_left_out():
    rig = fallback("<WelcomeGesture/>", failing(9, Cause.NOT_REACHABLE))
    rig.report(GONE, gone("/gestureExecution/perform_gesture"))
    assert to_the_end(rig) is SUCCESS
    assert rig.clock.now() <= 1002.0


INSTEAD = "budget 5 10\nPerformDeicticGesture * 1 0.5 LocationOvertAttentionMode\n"
LOOK = SetAttention("location", Point(1.0, 2.0, 3.0))


@pytest.mark.parametrize("looks, outcome", [(True, "substituted"), (False, "skipped")])
def test_another_node_may_stand_in_for_the_one_that_failed(tmp_path, looks, outcome):
    rig = fallback("<PerformDeicticGesture/>", lambda request: Answer() if request == LOOK and looks
                   else refusal(request))
    rig.mission.policy = read(tmp_path, INSTEAD)
    write(rig, gestureTarget=Point(1.0, 2.0, 3.0))
    assert to_the_end(rig) is SUCCESS
    assert [type(request).__name__
            for request in rig.requests] == ["PerformGesture", "PerformGesture", "SetAttention"]
    assert rig.requests[-1] == LOOK
    assert [(event.outcome, event.attempts, event.policy) for event in rig.of(Recovered)] == [
        (outcome, 1, "retry 1x, then LocationOvertAttentionMode instead, or skip")]
    assert [(event.attempt, event.of, event.substitute) for event in rig.of(Recovering)] == [
        (1, 1, ""), (0, 1, "LocationOvertAttentionMode")]
    assert [event.node for event in rig.of(Retried)] == ["PerformDeicticGesture"] + [
        "LocationOvertAttentionMode"] * (not looks)
    assert (rig.tree.blackboard.get("attentionSetAt") is not None) is looks


def test_a_subtree_has_no_stand_in(tmp_path):
    rig = one_leaf(
        "<Fallback><Sequence><PerformDeicticGesture/></Sequence><HandleFallBack/></Fallback>",
        failing(9, Cause.REFUSED))
    rig.mission.policy = read(tmp_path, INSTEAD)
    write(rig, gestureTarget=Point(1.0, 2.0, 3.0))
    assert to_the_end(rig) is SUCCESS
    assert len(rig.requests) == 1


class Beep(ServiceLeaf):
    """Prepares what it says, as a leaf of another package may."""

    asks = Say
    sound = ""

    def configure(self):
        super().configure()
        self.sounds = [self.sound]

    def join(self):
        self.said = self.sounds[0].upper()

    def request(self):
        return Say(self.said)


def beeping(sound):
    """Return a rig whose failed speech is replaced by the sound."""
    rig = fallback("<WelcomeSpeech/>", lambda request: Answer() if request == Say("BEEP")
                   else refusal(request))
    spec = leaf_spec("Beep", Beep, "Beeps.", arguments={"sound": sound})
    text = "budget 5 10\nWelcomeSpeech refused 0 0 Beep\n"
    rig.mission.policy = recovery_policy.read(
        Source("policy.ini", text), leaves.mission_specs() + (spec,))
    return rig


def test_a_stand_in_is_set_up_as_any_other_leaf():
    rig = beeping("beep")
    assert to_the_end(rig) is SUCCESS
    assert [event.outcome for event in rig.of(Recovered)] == ["substituted"]


def test_a_mistake_in_a_stand_in_refuses_the_mission():
    with pytest.raises(MissionError, match="HandleFallBack cannot be set up: AttributeError: 'int'"
                                           r".*test_recovery\.py:\d+"):
        beeping(7).tick()


VISIT = (
    "<Sequence><SelectExhibit/><Fallback><Sequence><Navigate/><IsMutualGazeDiscovered/></Sequence>"
    "<HandleFallBack/></Fallback></Sequence>")


def test_an_exhibit_goes_back_to_the_list_once():
    rig = one_leaf(
        "<Sequence><RetrieveListOfExhibits/>{0}<ForceSuccess>{0}</ForceSuccess>{0}</Sequence>".
        format(VISIT))
    assert to_the_end(rig) is FAILURE
    assert [event.success for event in rig.of(Recovered)] == [True, False, False]
    assert [(event.number, event.state) for event in rig.of(StopChanged)] == [
        (1, "begun"), (1, "omitted")] + 2 * [(2, "begun"), (2, "omitted")]
    assert rig.tree.blackboard.get("nextExhibit") == 2


def test_a_visit_may_be_wrapped_otherwise():
    rig = one_leaf("<Sequence><RetrieveListOfExhibits/>{}{}</Sequence>".format(VISIT, VISIT))
    assert to_the_end(rig) is FAILURE
    assert [event.success for event in rig.of(Recovered)] == [True, False]
    assert rig.tree.blackboard.get("nextExhibit") == 1  # the second one goes back to the list
    assert [(event.number, event.of, event.state) for event in rig.of(StopChanged)] == [
        (1, 2, "begun"), (1, 2, "omitted"), (2, 2, "begun"), (2, 2, "omitted")]


def test_a_place_of_the_tour_that_was_not_selected_is_not_left_out():
    rig = one_leaf("<Fallback><Sequence><Navigate/><IsMutualGazeDiscovered/></Sequence>"
                   "<HandleFallBack/></Fallback>")
    write(rig, exhibits=list(EXHIBITS), targetLocation=EXHIBITS[0].location)
    assert to_the_end(rig) is SUCCESS
    assert (rig.tree.blackboard.get("leftOutExhibits"), rig.of(StopChanged)) == (None, [])


def test_what_is_left_out_and_cannot_be_noted_is_told_and_no_exception():
    rig = one_leaf("<Sequence><SelectExhibit/><Fallback><Sequence><Navigate/>"
                   "<IsMutualGazeDiscovered/></Sequence><HandleFallBack/></Fallback></Sequence>")
    write(rig, exhibits=list(EXHIBITS), leftOutExhibits="none")
    assert to_the_end(rig) is SUCCESS
    assert [event.outcome for event in rig.of(Recovered)] == ["skipped"]
    assert [("leftOutExhibits" in event.text, event.level)
            for event in rig.of(Noticed)] == [(True, "warning")]


def test_what_fails_after_the_last_exhibit_leaves_out_none():
    rig = one_leaf("<Fallback><Sequence><RetrieveListOfExhibits/><SelectExhibit/><SelectExhibit/>"
                   "<LookUpEntrance/><IsMutualGazeDiscovered/></Sequence><HandleFallBack/>"
                   "</Fallback>")
    assert to_the_end(rig) is SUCCESS
    assert rig.tree.blackboard.get("leftOutExhibits") == []


def test_the_safe_state_is_taken_once_for_one_failure():
    rig = one_leaf(
        "<Fallback><Sequence><Fallback><Navigate/><HandleFallBack/></Fallback></Sequence>"
        "<HandleFallBack/></Fallback>", failing(9, Cause.TYPE_MISMATCH))
    write(rig, targetLocation=Location(1.0, 2.0, 3.0))
    assert to_the_end(rig) is FAILURE
    assert rig.requests[1:] == SAFE


def test_halting_a_recovery_drops_its_call():
    rig = fallback(
        "<LookUpHome/>", lambda request: Failure(Cause.REFUSED, "test", service_of(request))
        if len(rig.requests) == 1 else None)
    rig.tick()
    rig.clock.advance(1.0)
    assert rig.tick() is RUNNING
    rig.tree.halt()
    assert rig.gateway.dropped == rig.requests[1:]
    assert [event.status for event in rig.of(LeafFinished)] == ["FAILURE", "IDLE"]


def test_halting_a_recovery_stops_its_pause():
    rig = fallback("<LookUpHome/>", failing(9, Cause.REFUSED))
    assert rig.tick() is RUNNING
    rig.tree.halt()
    assert rig.clock.next_due() is None


def test_halting_a_recovery_drops_the_safe_state():
    rig = fallback("<PressYesNoDialogue/>", lambda request: None
                   if request in SAFE else refusal(request))
    rig.tick()
    dropped = []
    for call in rig.gateway.calls[1:]:
        call.drop = lambda: dropped.append(True)
    rig.tree.halt()
    assert dropped == [True, True]


def read(tmp_path, text):
    path = tmp_path / "policy.ini"
    path.write_text(text, encoding="utf-8")
    return recovery_policy.load(str(path), leaves.mission_specs())


PAUSES = ("2:1: pauses are one line: pause <first> <longest> (allowed: seconds, 1 to 3600, the "
          "longest last)")


@pytest.mark.parametrize("text, pauses", [("", [10, 20, 40, 80, 160, 300, 300]),
                                          ("pause 1 3600\n", [1, 2, 4, 8, 16, 32, 64]),
                                          ("pause 7 7\n", 7 * [7])])
def test_a_pause_doubles_up_to_the_longest(tmp_path, text, pauses):
    rules = read(tmp_path, "budget 5 10\n" + text)
    assert [rules.pause(number) for number in range(7)] == pauses
    assert rules.pause(10 ** 9) == rules.longest_pause


def test_the_delivered_pauses_are_those_of_a_policy_that_names_none():
    assert (DELIVERED.first_pause, DELIVERED.longest_pause) == (
        recovery_policy.Policy.first_pause, recovery_policy.Policy.longest_pause)
    with open(folders.config("recoveryPolicy.ini"), encoding="utf-8") as file:
        assert "\npause 10 300 " in file.read()


@pytest.mark.parametrize("line, expected", [
    ("Navigate refused 1 0 skip", "2:1: Navigate cannot be skipped (write giveUp)"),
    ("Navigat refused 1 0 giveUp", "2:1: unknown node Navigat (did you mean Navigate?)"),
    ("Navigate refusd 1 0 giveUp", "2:1: unknown cause refusd (did you mean refused?)"),
    ("Navigate refused -1 0 giveUp",
     "2:1: retries cannot be \"-1\" (allowed: a whole number from 0 to 99)"),
    ("Navigate refused 1 soon giveUp",
     "2:1: back-off cannot be \"soon\" (allowed: a number of seconds from 0 to 3600)"),
    ("Navigate refused 1 0 ignore",
     "2:1: the last word cannot be ignore (allowed: skip, giveUp, or a node that "
     "calls a service)"),
    ("Navigate refused 1 0 LookUpHome", "2:1: Navigate cannot be skipped (write giveUp)"),
    ("WelcomeGesture refused 1 0 IsASREnabled",
     "2:1: the last word cannot be IsASREnabled (allowed: skip, giveUp, or a "
     "node that calls a service)"),
    ("WelcomeGesture refused 1 0 WelcomeSpech",
     "2:1: the last word cannot be WelcomeSpech (did you mean WelcomeSpeech?)"),
    ("Navigate refused 1 0", "2:1: 4 words; a rule has 5: node cause retries back-off then"),
    ("budget 1 1", "2:1: a budget is one line: budget <recoveries> <seconds>"),
    ("pause 10", PAUSES),
    ("pause 10 5", PAUSES),
    ("pause 0.5 5", PAUSES),
    ("pause 10 3601", PAUSES),
    ("pause soon 5", PAUSES),
    ("pause 1 2 3", PAUSES),
    ("pause 1 2\npause 1 2", PAUSES.replace("2:1", "3:1"))])
def test_a_wrong_line_is_named(tmp_path, line, expected):
    with pytest.raises(ConfigurationError) as raised:
        read(tmp_path, "budget 5 10\n" + line + "\n")
    assert [str(fault).split("policy.ini:")[1] for fault in raised.value.faults] == [expected]


@pytest.mark.parametrize(
    "line", ["budget 5", "budget 5 10 60", "budget many 10", "budget 5 soon", "budget 100 10"])
def test_a_budget_is_a_number_of_recoveries_and_of_seconds(tmp_path, line):
    with pytest.raises(ConfigurationError) as raised:
        read(tmp_path, line + "\n")
    assert [str(fault).split("policy.ini:")[1] for fault in raised.value.faults] == [
        "1:1: a budget is one line: budget <recoveries> <seconds>",
        " the line \"budget <recoveries> <seconds>\" is missing"]


def test_the_largest_numbers_of_a_policy(tmp_path):
    rules = read(tmp_path, "budget 99 3600\nNavigate refused 99 3600 giveUp\n")
    assert (rules.most, rules.seconds) == (99, 3600.0)
    assert rules.rules == (recovery_policy.Rule("Navigate", "refused", 99, 3600.0,
                                                recovery_policy.GIVE_UP), )


def test_all_wrong_lines_come_at_once_and_a_missing_budget_too(tmp_path):
    with pytest.raises(ConfigurationError) as raised:
        read(tmp_path, "* * 0 0 skip\n* * 0 0 skip\nx y 0 0 skip # comment\n")
    assert [str(fault).split("policy.ini:")[1] for fault in raised.value.faults] == [
        "2:1: * * is never looked at: line 1 decides before it (the first line that fits decides)",
        "3:1: unknown node x",
        "3:1: unknown cause y (the causes: {})".format(
            "refused, exception, no-answer, connection-lost, not-reachable, not-advertised, "
            "type-mismatch, unusable-answer, missing-data, condition-false"),
        " the line \"budget <recoveries> <seconds>\" is missing"]


@pytest.mark.parametrize("first, second", [
    ("Navigate refused", "Navigate refused"), ("Navigate *", "Navigate refused"),
    ("* refused", "Navigate refused"), ("* *", "Navigate refused"), ("* *", "* refused")])
def test_a_rule_that_can_never_decide_is_a_mistake(tmp_path, first, second):
    with pytest.raises(ConfigurationError) as raised:
        read(tmp_path, "budget 5 10\n{} 0 0 giveUp\n{} 1 0 giveUp\n".format(first, second))
    assert [str(fault).split("policy.ini:")[1] for fault in raised.value.faults] == [
        "3:1: {} is never looked at: line 2 decides before it (the first line that fits decides)".
        format(second)]


def test_a_narrow_rule_may_stand_before_a_wide_one(tmp_path):
    assert len(
        read(tmp_path,
             "budget 5 10\nNavigate refused 1 0 giveUp\nNavigate * 0 0 giveUp\n* refused 1 0 skip\n"
             "* * 0 0 skip\n").rules) == 4


def test_the_first_rule_that_fits_decides(tmp_path):
    rules = read(tmp_path,
                 "budget 5 10\nWelcomeSpeech refused 3 0.5 skip\nWelcomeSpeech * 1 0 giveUp\n")
    assert rules.rule(SPEC["WelcomeSpeech"], Cause.REFUSED).retries == 3
    assert rules.rule(SPEC["WelcomeSpeech"], Cause.NO_ANSWER).retries == 1
    assert rules.rule(SPEC["FollowMeSpeech"], Cause.REFUSED).then == recovery_policy.GIVE_UP


def test_the_first_failure_of_a_run_is_found_by_a_recovery_that_was_there_before_it():
    rig = one_leaf("<Fallback><Sequence><ScriptCondition "
                   "code='speaks'/><WelcomeSpeech/></Sequence><HandleFallBack/></Fallback>",
                   refusal)
    write(rig, speaks=0)
    rig.tick()  # no mission node has failed: there is nothing to recover from
    write(rig, speaks=1)
    rig.tick()
    assert [event.node for event in rig.of(Recovered)] == ["ScriptCondition", "WelcomeSpeech"]
