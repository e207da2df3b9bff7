"""The tick loop: passes, stop, the safe state, exit codes, and errors that end a pass but not the
node."""
import dataclasses
import itertools
import logging
import re
import time

import pytest
from msgspec.structs import replace

from behavior_controller.bt.values.status import IDLE
from behavior_controller.run.events import (Answered, Asked, HealthChanged, LeafFinished,
                                                  Noticed, PassFinished, PassStarted, Paused,
                                                  RunFinished, RunStarted, SafePart,
                                                  SafeStateReported, Suspended)
from behavior_controller.robot.gateway import Cause, Failure
from behavior_controller.run.health import FAILURES_IN_A_ROW, GONE
from behavior_controller.run.safe_state import SafeState
from behavior_controller.robot.d543 import ATTENTION, INTERFACE, SPEECH
from behavior_controller.robot.requests import (
    Answer, AttentionStatus, GoTo, Prompt, QueryKnowledge, Say, SetAnimation, SetAttention)
from behavior_controller.missions.runner import RetryGate, Runner, Running
from mission_rig import ASKS_WITHOUT_START_OF_TREE, hanging, one_leaf, refusal, service_of, write

SAFE = [SetAttention("disabled"), SetAnimation("disabled")]


def advance(rig):
    rig.clock.advance(0.25)


def test_as_many_passes_as_asked_for():
    rig = one_leaf("<WelcomeSpeech/>")
    assert rig.run(advance, runs=3) == 0
    assert [(event.number, event.outcome) for event in rig.of(PassFinished)] == [
        (1, "SUCCESS"), (2, "SUCCESS"), (3, "SUCCESS")]
    assert rig.of(RunFinished) == [RunFinished("all passes are done; pass 3 was a SUCCESS", 0)]


def test_the_last_pass_decides_the_exit_code():
    rig = one_leaf("<WelcomeSpeech/>", lambda request: refusal(request)
                   if len(rig.requests) < 2 else Answer())
    assert rig.run(advance, runs=2) == 0
    rig = one_leaf("<WelcomeSpeech/>", lambda request: refusal(request)
                   if len(rig.requests) > 1 else Answer())
    assert rig.run(advance, runs=2) == 3


def test_what_was_posted_for_a_wake_up_that_is_cleared_is_not_waited_for():
    rig = one_leaf("<WelcomeSpeech/>", lambda request: None)
    rig.tick()
    runner = Runner(Running(rig.tree, rig.mission, "m.xml", 1), lambda: False)
    rig.clock.post(lambda: rig.gateway.calls[0].finish(Answer()))
    rig.tree.wake.test_and_clear()
    began = time.monotonic()
    runner.wait(5.0)
    assert rig.gateway.calls[0].result is not None and time.monotonic() - began < 4.0


def test_an_event_is_answered_by_one_tick():
    rig = one_leaf("<ReactiveSequence><ScriptCondition code='count += 1; true'/><Sleep "
                   "msec='9000'/></ReactiveSequence>")
    rig.tree.blackboard.set("count", 0)
    waits = []

    def event(rig):
        waits.append(rig.tree.blackboard.get("count"))
        rig.tree.wake.emit()

    rig.run(event, is_stopped=lambda: len(waits) > 9)
    assert [after - before for before, after in zip(waits[1:], waits[2:])] == [1] * 8


def test_a_tick_that_nothing_asked_for_does_not_happen():
    rig = one_leaf("<Sequence><WelcomeSpeech/><SayGoodByeSpeech/><Sleep msec='700'/></Sequence>",
                   lambda request: None)
    traversals, beats = [], []
    rig.tree.follow(lambda is_first, changes: traversals.append(is_first is not None))
    rig.clock.call_after(0.3, lambda: beats.append(rig.clock.now()))  # of no node

    def answer(rig):
        if rig.gateway.calls[-1].result is None:
            rig.gateway.calls[-1].finish(Answer())
        else:
            rig.clock.advance(0.1)

    rig.run(answer)
    # the first one, for each of the two answers, for the end of the Sleep
    assert len(rig.requests) == 2 and sum(traversals) == 4 and len(beats) == 1


def test_an_entry_asks_for_a_tick_if_it_was_read_since_its_last_write():
    rig = one_leaf("<Sequence><ScriptCondition code='x == 0'/><Script code='x := 1'/><Sleep msec="
                   "'100'/><Script code='x := 2'/><Sleep msec='100'/></Sequence>")
    write(rig, x=0)
    traversals = []
    rig.tree.follow(lambda is_first, changes: traversals.append(is_first is not None))
    rig.run(advance)
    assert sum(traversals) == 4  # the first, for x, for the end of each Sleep


UNTIL_WRITTEN = "<Script code='x := 1'/><Sleep msec='9000'/>"


@pytest.mark.parametrize("mission, code", [
    ("<ReactiveFallback><ScriptCondition code='x == 1'/><Sequence>{}</Sequence>"
     "</ReactiveFallback>".format(UNTIL_WRITTEN), 0),
    ("<WhileDoElse><ScriptCondition code='x == 0'/><Sequence>{}</Sequence><AlwaysSuccess/>"
     "</WhileDoElse>".format(UNTIL_WRITTEN), 0),
    ("<Fallback><Sequence _while='x == 0'>{}</Sequence><AlwaysFailure/></Fallback>".format(
        UNTIL_WRITTEN), 3),
    ('<Sequence><Script code="y := \'0\'"/><Switch2 variable="{y}" case_1="0" case_2="1"><Sequence>'
     '<Script code="y := \'1\'"/><Sleep msec="9000"/></Sequence><AlwaysSuccess/><AlwaysFailure/>'
     '</Switch2></Sequence>', 0),
    ("<Parallel><Precondition if='x == 1' else='RUNNING'><AlwaysSuccess/></Precondition>"
     "<Script code='x += 1'/></Parallel>", 0),
    ("<Parallel><WaitValueUpdate entry='new'><AlwaysSuccess/></WaitValueUpdate>"
     "<Script code='new := 1'/></Parallel>", 0),
    ("<ReactiveFallback><Inverter><WasEntryUpdated entry='x'/></Inverter><Sleep msec='9000'/>"
     "</ReactiveFallback>", 0),
    ("<KeepRunningUntilFailure><Sequence><Script code='x += 1'/><ScriptCondition code='x &lt; 4'/>"
     "</Sequence></KeepRunningUntilFailure>", 3),
    ("<KeepRunningUntilFailure><WasEntryUpdated entry='x'/></KeepRunningUntilFailure>", 3),
    ("<WhileDoElse><WasEntryUpdated entry='x'/><Sleep msec='9000'/><AlwaysSuccess/></WhileDoElse>",
     0),
    ("<LoopInt queue='1;2;3' value='{item}'><AlwaysSuccess/></LoopInt>", 0),
    ("<LoopInt queue='1;2;3'><AlwaysSuccess/></LoopInt>", 0),
    ("<KeepRunningUntilFailure><Fallback><RunOnce><AlwaysSuccess/></RunOnce><AlwaysFailure/>"
     "</Fallback></KeepRunningUntilFailure>", 3),
    ("<ReactiveSequence><Fallback><RunOnce><AlwaysSuccess/></RunOnce><AlwaysFailure/></Fallback>"
     "<Sleep msec='9000'/></ReactiveSequence>", 3),
    ("<WhileDoElse><AlwaysFailure _successIf='true'/><Sleep msec='9000'/><AlwaysSuccess/>"
     "</WhileDoElse>", 0),
    ("<ReactiveFallback><IfThenElse><AlwaysSuccess _failureIf='true'/><AlwaysSuccess/></IfThenElse>"
     "<Sleep msec='9000'/></ReactiveFallback>", 0)])
def test_what_a_tick_can_go_on_with_is_ticked_again(mission, code):
    rig = one_leaf(mission)
    write(rig, x=0)
    assert rig.run(lambda rig: pytest.fail("it waits"), runs=1) == code


@pytest.mark.parametrize("mission, code, ends_at", [("<AlwaysFailure/>", 3, 1003.0),
                                                    ("<Sleep msec='1000'/>", 0, 1004.0)])
def test_passes_of_less_than_a_second_are_paced(mission, code, ends_at):
    rig = one_leaf(mission)
    assert rig.run(advance, runs=4) == code
    assert rig.clock.now() == ends_at  # a second between their starts, no pause after the last


def test_the_run_is_announced_with_its_leaves():
    rig = one_leaf(
        "<Sequence><WelcomeSpeech/><Sleep msec='1'/><FollowMeSpeech name='come'/></Sequence>")
    rig.run(advance)
    started = rig.of(RunStarted)[0]
    assert started.leaves == [("WelcomeSpeech::2", "WelcomeSpeech"), ("come", "FollowMeSpeech")]
    assert started.settings["asrEnabled"] is True


def test_stopping_halts_the_mission_and_leaves_the_robot_calm_once():
    stopped = []
    rig = one_leaf("<WelcomeSpeech/>", lambda request: None
                   if isinstance(request, Say) else Answer())
    assert rig.run(lambda rig: stopped.append(True), runs=0, is_stopped=lambda: bool(stopped)) == 0
    assert rig.requests[1:] == SAFE
    assert rig.of(PassFinished) == []
    assert [event.outcome for event in rig.of(RunFinished)] == ["stopped; no pass is over"]
    assert rig.tree.is_idle


@pytest.mark.parametrize("mission", [
    "<Sequence><LookUpHome/><Parallel><Sleep msec='9000' _onHalted=\"x := 'a' * 2\"/><Delay "
    "delay_msec='9000'><AlwaysSuccess/></Delay><Navigate/></Parallel></Sequence>",
    "<Sequence _onHalted=\"x := 'a' * 2\"><LookUpHome/><Timeout msec='9000'><Navigate "
    "_onHalted=\"x := 'a' * 2\"/></Timeout></Sequence>"])
def test_a_script_that_fails_while_halting_leaves_nothing_running(mission):
    stopped = []
    rig = one_leaf(mission, hanging(GoTo))
    rig.run(lambda rig: stopped.append(True), runs=0, is_stopped=lambda: bool(stopped))
    assert rig.gateway.dropped == rig.requests[1:2]
    assert {node.status for node in rig.tree.nodes} == {IDLE}
    assert rig.clock.next_due() is None
    assert rig.requests[2:] == SAFE
    assert [event.text.split(":")[0] for event in rig.of(Noticed)] == ["while halting"]


def test_stopping_does_not_wait_for_a_robot_that_hangs():
    stopped = []

    def visitor(rig):
        stopped.append(True)
        rig.clock.advance(0.25)

    rig = one_leaf("<WelcomeSpeech/>", lambda request: None)
    rig.run(visitor, runs=0, is_stopped=lambda: bool(stopped))
    assert rig.clock.now() == 1001.25  # a second after it was stopped
    assert rig.gateway.dropped[1:] == SAFE
    report, = rig.of(SafeStateReported)
    assert [(part.what, part.service, part.failure.cause) for part in report.parts] == [
        ("attention", "/overtAttention/set_mode", Cause.NO_ANSWER),
        ("lifelike movement", "/animateBehaviour/set_activation", Cause.NO_ANSWER)]


def test_a_part_of_the_safe_state_that_fails_is_told():
    stopped = []
    rig = one_leaf(
        "<WelcomeSpeech/>", lambda request: None if isinstance(request, Say) else Answer()
        if isinstance(request, SetAttention) else Failure(Cause.NOT_REACHABLE, "no way", "/x"))
    rig.run(lambda rig: stopped.append(rig.clock.advance(0.1)), runs=0,
            is_stopped=lambda: bool(stopped))
    report, = rig.of(SafeStateReported)
    assert report.parts == (SafePart("attention", "/overtAttention/set_mode", None),
                            SafePart("lifelike movement", "/animateBehaviour/set_activation",
                                     Failure(Cause.NOT_REACHABLE, "no way", "/x")))


REFUSAL = Failure(Cause.REFUSED, "answered 0", "/x")


@pytest.mark.parametrize("failure, times, attempts, is_reached", [
    (REFUSAL, 1, 2, True), (REFUSAL, 3, 4, True), (REFUSAL, 99, 9, False),
    (replace(REFUSAL, cause=Cause.NOT_REACHABLE), 2, 3, True),
    (replace(REFUSAL, cause=Cause.CONNECTION_LOST), 2, 3, True),
    (replace(REFUSAL, cause=Cause.HANDLER_EXCEPTION), 2, 3, True),
    (replace(REFUSAL, cause=Cause.UNUSABLE_ANSWER), 2, 3, True),
    # that another attempt cannot mend
    (replace(REFUSAL, cause=Cause.NO_ANSWER), 1, 1, False),
    (replace(REFUSAL, cause=Cause.TYPE_MISMATCH), 1, 1, False)])
def test_a_part_of_the_safe_state_that_fails_at_once_is_asked_for_again(
        failure, times, attempts, is_reached):
    """Every 0.1 s, here 0.12 s as it waits in steps; the other part is asked for once."""
    failures = [failure] * times
    rig = one_leaf("<AlwaysSuccess/>", lambda request: (
        failures.pop() if isinstance(request, SetAttention) and failures else Answer()))
    rig.run(lambda rig: rig.clock.advance(0.04))
    assert rig.last_requests == [SAFE[0], SAFE[1]] + [SAFE[0]] * (attempts - 1)
    report, = rig.of(SafeStateReported)
    assert [part.failure for part in report.parts] == [None if is_reached else failure, None]
    assert report.seconds == pytest.approx(1.04 if attempts == 9 else 0.12 * (attempts - 1))


def test_no_wait_for_the_safe_state_is_negative_though_time_goes_on():
    rig, time, waits = one_leaf("<AlwaysSuccess/>", lambda request: REFUSAL), [0.0], []

    def now():
        time[0] += 0.12
        return time[0]

    SafeState(rig.gateway, INTERFACE, (), now).wait(waits.append)
    assert waits and min(waits) >= 0.0


def test_a_part_that_failed_before_its_last_attempt_got_no_answer_says_so():
    failures = [REFUSAL, REFUSAL, REFUSAL]
    rig = one_leaf("<AlwaysSuccess/>", lambda request: Answer() if isinstance(
        request, SetAnimation) else failures.pop() if failures else None)
    rig.run(lambda rig: rig.clock.advance(0.04))
    report, = rig.of(SafeStateReported)
    assert report.parts[0].failure == Failure(
        Cause.NO_ANSWER, "waited 1.0 s; refused before", "/overtAttention/set_mode")
    assert report.parts[1].failure is None


def test_a_loss_is_reported_while_the_safe_state_is_asked_for_and_a_failing_service_is_not():
    def answer(request):
        health = rig.mission.health
        health.ended("/a", 0.1, 5.0, True)
        if len(rig.gateway.requests) == 3:
            health.report(GONE, HealthChanged("service", "/x", "x", False, "gone: it ended", ""))
        return REFUSAL

    rig = one_leaf("<AlwaysSuccess/>", answer)
    rig.run(lambda rig: rig.clock.advance(0.04))
    assert len(rig.last_requests) > 2 * FAILURES_IN_A_ROW
    assert [(event.name, event.respect) for event in rig.of(HealthChanged)] == [("/x", GONE)]


def test_a_part_of_the_safe_state_that_the_robot_lacks_is_reported_only_if_the_mission_uses_it():
    def answer(request):
        return Failure(Cause.NOT_ADVERTISED, "no", "/x") if isinstance(request,
                                                                       SetAnimation) else Answer()

    for mission, parts in (("<WelcomeSpeech/>", 1),
                           ("<ForceSuccess><EnableAnimateBehavior/></ForceSuccess>", 2)):
        rig = one_leaf(mission, answer)
        rig.run(advance)
        assert [len(report.parts) for report in rig.of(SafeStateReported)] == [parts]


def test_a_mission_that_is_skipped_leaves_nothing_running():
    # it says RUNNING before it asks its child
    rig = one_leaf("<Inverter><AlwaysSuccess _skipIf='true'/></Inverter>")
    rig.run(advance)
    assert [event.outcome for event in rig.of(PassFinished)] == ["SKIPPED"] and rig.tree.is_idle


@pytest.mark.parametrize("mission, code", [
    ("<WelcomeSpeech/>", 0), ("<AlwaysFailure/>", 3), ("<Script code=\"x := 'a' * 2\"/>", 3)])
def test_a_run_that_ends_by_itself_leaves_the_robot_calm_once(mission, code):
    rig = one_leaf(mission)
    assert rig.run(advance, runs=2) == code
    assert rig.last_requests == SAFE and not [
        request for request in rig.requests if request in SAFE]
    assert [type(event) for event in rig.events[-2:]] == [SafeStateReported, RunFinished]
    assert [part.failure for part in rig.events[-2].parts] == [None, None]


def test_an_error_in_a_node_ends_the_pass_with_one_line_and_the_next_one_runs():
    rig = one_leaf("<Script code=\"x := 'a' * 2\"/>")
    assert rig.run(advance, runs=2) == 3
    lines = [event.text for event in rig.of(Noticed)]
    assert len(lines) == 2
    assert re.search(r"'Script::1' \[Script\]: \S+:1:\d+: .*\[x := 'a' \* 2\]", lines[0])
    assert "\n" not in lines[0]
    assert [event.outcome for event in rig.of(PassFinished)] == ["FAILURE", "FAILURE"]


@pytest.mark.parametrize("leaf, column", [
    ("<Script code=\"x := 'a' * 2\"/>", 9),
    ("<WelcomeSpeech name=\"hi\" _skipIf=\"never == 1\"/>", 26),
    ("<AlwaysSuccess _onSuccess=\"x := never\"/>", 16),
    ("<Sleep msec=\"{never}\"/>", 1)])
def test_a_fault_at_run_time_names_its_place(leaf, column):
    rig = one_leaf("\n" + leaf)
    rig.run(advance, runs=1)
    text, = [event.text for event in rig.of(Noticed)]
    assert ":2:{}".format(column) in text, text


def test_an_error_in_a_node_leaves_no_other_node_running():
    rig = one_leaf("<Parallel><Sleep msec='9000'/><Script code=\"x := 'a' * 2\"/></Parallel>")
    rig.run(advance)
    assert (rig.tree.is_idle, rig.clock.next_due()) == (True, None)


def test_a_mission_that_busy_loops_can_be_stopped_and_is_named():
    rounds = []

    def is_stopped():
        rounds.append(True)
        return len(rounds) > 8

    rig = one_leaf("<Repeat num_cycles='-1'><AlwaysSuccess/></Repeat>")
    rig.run(lambda rig: None, runs=0, is_stopped=is_stopped)
    assert [event.text for event in rig.of(Noticed)] == [
        "the mission busy-loops, it never waits: put a Sleep or a Delay into its loop"]


def test_waiting_ends_at_the_next_timer():
    rig = one_leaf("<WelcomeSpeech/>")
    fired = []
    rig.clock.call_after(0.0, lambda: fired.append(True))
    Runner(Running(rig.tree, rig.mission, "x", 1), lambda: False).wait(None)
    assert fired == [True]


@pytest.mark.parametrize("at_most, timers, expected", [(None, [], None), (1.5, [], 1.5),
                                                       (None, [2.0, 3.0], 2.0), (1.5, [2.0], 1.5),
                                                       (2.5, [2.0], 2.0), (1.5, [-1.0], 0.0)])
def test_a_wait_ends_at_the_limit_or_the_next_timer_whichever_is_first(at_most, timers, expected):
    rig = one_leaf("<WelcomeSpeech/>")
    for due in timers:
        rig.clock.call_after(due, lambda: None)
    waited = []
    rig.tree.wake.wait = waited.append
    Runner(Running(rig.tree, rig.mission, "x", 1), lambda: False).wait(at_most)
    assert waited == [expected]


@pytest.mark.parametrize("mission, stops", [("<WelcomeSpeech/>", 4), ("<AlwaysFailure/>", 4),
                                            ("<Sleep msec='700'/>", 4)])
def test_no_wait_begins_with_an_old_wake_up(mission, stops):
    # such a wait would end at once, and a loop of them would keep the processor busy
    waits = []

    class Waiting(Runner):
        def wait(self, seconds):
            waits.append(self.tree.wake.test_and_clear())
            rig.clock.advance(0.25)
            self.tree.wake.emit()

    rig = one_leaf(mission, lambda request: None)
    Waiting(Running(rig.tree, rig.mission, "x", 0), lambda: len(waits) >= stops).run()
    assert len(waits) > stops and not any(waits)


def run_until_it_waits(mission, waits=1):
    """Run a mission until it has waited so often; return the rig and how long it would have waited,
    None for ever."""
    asked = []

    class Waiting(Runner):
        def wait(self, seconds):
            asked.append(seconds)
            rig.clock.advance(0.25 if seconds is None else seconds)

    rig = one_leaf(mission)
    Waiting(Running(rig.tree, rig.mission, "x", 0),
            lambda: len(asked) >= waits or len(rig.of(PassFinished)) > 0).run()
    return rig, asked


def test_what_a_tick_changed_is_acted_on_without_an_event():
    rig, asked = run_until_it_waits(
        "<Sequence><Script code='x := " "0'/><ReactiveFallback><ScriptCondition code='x == "
        "1'/><Sequence><Script code='x := 1'/><Sleep "
        "msec='60000'/></Sequence></ReactiveFallback></Sequence>", waits=2)
    assert [event.outcome for event in rig.of(PassFinished)] == ["SUCCESS"]
    assert len(asked) == 1 and asked[0] < 0.001  # other threads go on, nothing is waited for


@pytest.mark.parametrize("first, wait",
                         [("<Script code='rounds := 0'/>", []),
                          ("<Delay delay_msec='100'><Script code='rounds := 0'/></Delay>", [None])])
def test_a_loop_that_is_running_after_each_round_goes_on(first, wait):
    # KeepRunningUntilFailure signals no wake-up: BT.CPP comes round by ticking every 10 ms
    loop = "<KeepRunningUntilFailure><Script code='rounds += 1'/></KeepRunningUntilFailure>"
    rig, asked = run_until_it_waits("<Sequence>{}{}</Sequence>".format(first, loop),
                                    waits=len(wait) + 103)
    assert rig.tree.blackboard.get("rounds") > 100
    rounds = asked[len(wait):]
    assert asked[:len(wait)] == wait and max(rounds[:100]) < 0.001 and rounds[100:] == 3 * [0.01]


def test_a_loop_that_changes_nothing_waits_for_an_event():
    rig, asked = run_until_it_waits(
        "<ReactiveFallback><IsVisitorDiscovered/><KeepRunningUntilFailure><AlwaysSuccess/>"
        "</KeepRunningUntilFailure></ReactiveFallback>")
    assert asked == [None]


def test_pauses_and_the_stop_wait_for_what_is_left_of_their_second():
    rig, asked = one_leaf("<AlwaysFailure/>", lambda request: None), []

    class Waiting(Runner):
        def wait(self, seconds):
            asked.append(self.clock.time_left() if seconds is None else seconds)
            rig.clock.advance(0.25)

    Waiting(Running(rig.tree, rig.mission, "x", 0), lambda: len(asked) >= 4).run()
    assert asked == 2 * [1.0, 0.75, 0.5, 0.25]


def test_what_was_read_anew_runs_from_the_next_pass_on():
    rig = one_leaf("<WelcomeSpeech/>")
    other = one_leaf("<FollowMeSpeech/>")
    other.mission.gateway = rig.gateway
    waiting = [Running(other.tree, other.mission, "other.xml", 3)]

    def successor():
        return waiting.pop() if waiting and len(rig.of(PassFinished)) == 1 else None

    assert rig.run(advance, runs=0, successor=successor) == 0
    assert len(rig.of(PassFinished)) == 1 and [event.number
                                               for event in other.of(PassFinished)] == [2, 3]
    assert [event.mission for event in rig.of(RunStarted) + other.of(RunStarted)
            ] == ["lab_tour.xml", "other.xml"]
    first, *others = [request.text for request in rig.gateway.requests if isinstance(request, Say)]
    assert others == 2 * others[:1] != 2 * [first]


def test_a_reloaded_mission_whose_passes_are_done_already_says_so():
    rig, other = one_leaf("<WelcomeSpeech/>"), one_leaf("<FollowMeSpeech/>")
    waiting = [Running(other.tree, other.mission, "other.xml", 2)]
    assert rig.run(advance, runs=0, successor=lambda: waiting.pop()
                   if waiting and len(rig.of(PassFinished)) == 3 else None) == 0
    assert [event.text for event in other.of(Noticed)] == [
        "missionRuns 2 is reached already: 3 passes of this run are over"]
    assert not other.of(PassStarted) and other.of(RunFinished)


def test_a_stop_while_another_mission_waits_halts_the_one_that_runs():
    stopped = []
    rig = one_leaf("<Sequence><LookUpHome/><Navigate/></Sequence>", hanging(GoTo))
    other = one_leaf("<FollowMeSpeech/>")
    other.mission.gateway = rig.gateway
    waiting = [Running(other.tree, other.mission, "other.xml", 0)]
    rig.run(lambda rig: stopped.append(True), runs=0, is_stopped=lambda: bool(stopped),
            successor=lambda: waiting.pop() if waiting else None)
    assert rig.gateway.dropped == rig.requests[1:2] and rig.tree.is_idle
    assert rig.requests[2:] == SAFE
    assert other.of(RunStarted) == []
    assert len(rig.of(RunFinished)) == 1


def test_a_stop_may_have_an_exit_code_of_its_own():
    stopped = []
    rig = one_leaf("<AlwaysFailure/>")

    def stop(rig):
        stopped.extend(rig.of(PassFinished))
        rig.clock.advance(0.5)

    assert rig.run(stop, runs=0, is_stopped=lambda: bool(stopped), stop_code=lambda: 0
                   if stopped else None) == 0
    assert [event.exit_code for event in rig.of(RunFinished)] == [0]


@pytest.mark.parametrize("mission, runs, at",
                         [("<Sequence><WelcomeSpeech/><Sleep msec='700'/></Sequence>", 1, 1000.5),
                          ("<WelcomeSpeech/>", 2, 1000.5)])
def test_what_changed_about_the_robot_is_told_at_a_tick_and_during_a_pause(mission, runs, at):
    rig = one_leaf(mission)
    change = HealthChanged("service", "/say", "", False, "gone", "", "gone")
    told = []
    rig.mission.events.subscribe(lambda event: told.append((event, rig.clock.now())))

    def act(rig):
        rig.mission.health.report("gone", change)
        rig.clock.advance(0.5)

    rig.run(act, runs=runs)
    assert [found for found in told if isinstance(found[0], HealthChanged)] == [(change, at)]


def test_what_a_visitor_said_ends_with_the_pass_without_start_of_tree_too():
    def says_yes_in_the_first_pass(rig):
        rig.clock.advance(0.5)
        if not rig.of(PassFinished):
            rig.topics.publish(SPEECH, "yes")

    rig = one_leaf(ASKS_WITHOUT_START_OF_TREE)
    assert rig.run(says_yes_in_the_first_pass, runs=2) == 3
    assert [event.outcome for event in rig.of(PassFinished)] == ["SUCCESS", "FAILURE"]
    assert len([request for request in rig.requests if isinstance(request, GoTo)]) == 1


def test_a_target_ends_with_the_pass():
    rig = one_leaf("<Fallback><Navigate/><LookUpHome/></Fallback>")
    rig.run(advance, runs=2)
    assert [(event.node, event.status) for event in rig.of(LeafFinished)] == 2 * [
        ("Navigate", "FAILURE"), ("LookUpHome", "SUCCESS")]


@pytest.mark.parametrize("condition, topic, value",
                         [("IsYesNoUttered", SPEECH, "yes"),
                          ("IsMutualGazeDiscovered", ATTENTION, AttentionStatus("seeking", 1))])
@pytest.mark.parametrize("wait, outcome", [("0", "FAILURE"), ("600", "SUCCESS")])
def test_evidence_from_before_the_pass_never_counts(condition, topic, value, wait, outcome):
    # the message comes at 1000.5, the pass begins at 1000.75; another one comes at 1001.0
    rig = one_leaf("<Sequence><Sleep msec='{}'/><{}/></Sequence>".format(wait, condition))
    rig.clock.advance(0.5)
    rig.topics.publish(topic, value)
    rig.clock.advance(0.25)

    def says_it_again(rig):
        advance(rig)
        if rig.clock.now() == 1001.0:
            rig.topics.publish(topic, value)

    rig.run(says_it_again)
    assert [event.outcome for event in rig.of(PassFinished)] == [outcome]


def test_the_begin_of_each_pass_is_told():
    rig = one_leaf("<Sequence><START_OF_TREE/><Sleep msec='3000'/></Sequence>")
    rig.run(advance, runs=2)
    assert rig.of(PassStarted) == [PassStarted(1, 1000.0), PassStarted(2, 1003.0)]
    assert rig.of(Noticed) == 2 * [Noticed("info", "a pass begins")]


def run_for_real(mission, runs=2):
    """Run passes with the runner's own wait, on a clock whose time passes where the runner waits.
    """
    rig = one_leaf(mission)
    rig.tree.wake.wait = lambda seconds: rig.clock.set_to(rig.clock.now() + (seconds or 0.0))
    code = Runner(Running(rig.tree, rig.mission, "m.xml", runs), lambda: False).run()
    return rig, code


def test_a_script_that_fails_in_the_halt_of_a_timer_ends_its_pass_and_the_next_one_runs():
    rig, code = run_for_real(
        "\n<Timeout msec='100'>\n<Sleep msec='9000' _onHalted=\"x := 'a' * 2\"/></Timeout>")
    assert code == 3 and [event.outcome for event in rig.of(PassFinished)] == ["FAILURE", "FAILURE"]
    # once a pass, though the halt that follows runs the script too
    lines = [event.text for event in rig.of(Noticed)]
    assert len(lines) == 2 and all(line.endswith(":3:20)") for line in lines)
    assert rig.tree.is_idle and rig.clock.next_due() is None


def test_a_run_that_asks_for_the_safe_state_is_stopping():
    seen = []
    rig = one_leaf("<AlwaysSuccess/>", lambda request: seen.append(runner.is_stopping) or Answer())
    runner = Runner(Running(rig.tree, rig.mission, "m.xml", 1), lambda: False)
    rig.tree.wake.wait = lambda seconds: rig.clock.set_to(rig.clock.now() + (seconds or 0.0))
    assert not runner.is_stopping
    runner.run()
    assert seen == [True] * len(SAFE)


def test_a_callback_that_fails_after_its_pass_fails_no_other():
    rig = one_leaf("<AlwaysSuccess/>")
    rig.clock.call_after(0.5, lambda: 1 / 0)
    rig.tree.wake.wait = lambda seconds: rig.clock.set_to(rig.clock.now() + seconds)
    assert Runner(Running(rig.tree, rig.mission, "m.xml", 2), lambda: False).run() == 0
    assert len(rig.of(Noticed)) == 1


def test_the_log_file_alone_gets_the_traceback_of_foreign_code(caplog):
    foreign, own = one_leaf("<AlwaysSuccess/>"), one_leaf("<Script code=\"x := 'a' * 2\"/>")
    foreign.clock.call_after(0.5, lambda: 1 / 0)
    foreign.tree.wake.wait = lambda seconds: foreign.clock.set_to(foreign.clock.now() + seconds)
    with caplog.at_level(logging.INFO, "behavior_controller"):
        Runner(Running(foreign.tree, foreign.mission, "m.xml", 2), lambda: False).run()
        assert own.run(advance, runs=1) == 3
    told = [event.text for rig in (foreign, own) for event in rig.of(Noticed)]
    written = [(line.getMessage(), line.exc_info[0]) for line in caplog.records
               if line.getMessage() in told]
    assert written == [(told[0], ZeroDivisionError)] and len(told) == 2


def test_a_reloaded_mission_whose_leaves_cannot_be_set_up_is_refused(monkeypatch):
    rig, second = one_leaf("<AlwaysSuccess/>"), one_leaf("\n<AlwaysFailure/>")
    monkeypatch.setattr(second.tree.nodes[0], "setup", lambda **kwargs: 1 / 0)
    begun, following = [], [
        Running(second.tree, second.mission, "second.xml", 2, lambda: begun.append(True))]
    assert rig.run(advance, runs=2, successor=lambda: following.pop() if following else None) == 0
    assert [event.outcome for event in rig.of(PassFinished)] == ["SUCCESS", "SUCCESS"] and not begun
    text, = [event.text for event in rig.of(Noticed)]
    assert text.startswith(
        "refused, the running mission stays: ") and ":2:1: AlwaysFailure cannot be set up" in text


# -------------------------------------------------------------------------------- persistent causes


GREET_AND_DRIVE = "<Sequence><WelcomeSpeech/><LookUpHome/><Navigate/></Sequence>"


def drives(cause, is_broken=lambda: True):
    """Return a robot whose drives fail with ``cause`` while it is broken."""
    return lambda request: (Failure(cause, "test", service_of(GoTo))
                            if isinstance(request, GoTo) and is_broken() else NotImplemented)


def tell(rig, service, is_well):
    rig.mission.health.report(GONE,
                              HealthChanged("service", service, "robotNavigation", is_well, "", ""))


def starts(rig):
    return [event.at - 1000.0 for event in rig.of(PassStarted)]


@pytest.mark.parametrize("mission", [GREET_AND_DRIVE,
                                     "<Sequence><WelcomeSpeech/><LookUpHome/><Fallback><Navigate/>"
                                     "<HandleFallBack/></Fallback></Sequence>",
                                     "<Sequence><WelcomeSpeech/><LookUpHome/><Fallback><Navigate/>"
                                     "<Inverter><AlwaysSuccess/></Inverter></Fallback></Sequence>"])
def test_no_visitor_is_greeted_while_a_node_is_gone_for_which_the_mission_failed(mission):
    rig = one_leaf(mission, drives(Cause.NOT_REACHABLE, lambda: rig.clock.now() < 5000.0))
    tell(rig, service_of(GoTo), False)

    def visitor(rig):
        before = rig.clock.now()
        rig.clock.advance(0.5 if not rig.of(Paused) else 100.0)
        if before < 5000.0 <= rig.clock.now():
            tell(rig, service_of(GoTo), True)

    assert rig.run(visitor, runs=2) == 0
    assert len([request for request in rig.requests if isinstance(request, Say)]) == 2
    assert [(event.awaited, event.limit) for event in rig.of(Paused)] == [("/robotNavigation", 0.0)]
    assert 4000.0 <= starts(rig)[1] <= 4100.0


@pytest.mark.parametrize("mission", [
    GREET_AND_DRIVE,
    "<Sequence><ForceSuccess><WelcomeSpeech/></ForceSuccess><IsVisitorResponseYes/></Sequence>"])
def test_a_pass_that_failed_for_something_else_is_followed_by_the_next(mission):
    rig = one_leaf(
        mission, lambda request: NotImplemented if isinstance(request, QueryKnowledge) or
        (isinstance(request, Say) and mission is GREET_AND_DRIVE) else refusal(request))
    tell(rig, service_of(Say), False)
    rig.run(advance, runs=2)
    assert starts(rig) == [0.0, 1.0] and rig.of(Paused) == []


def test_a_topic_that_is_gone_is_waited_for_too():
    rig = one_leaf("<IsVisitorDiscovered/>")
    rig.mission.health.report(
        GONE, HealthChanged("topic", "/faceDetection/data", "faceDetection", False, "", ""))
    rig.run(lambda rig: rig.clock.advance(100.0), runs=0,
            is_stopped=lambda: rig.clock.now() > 2000.0)
    assert [event.awaited
            for event in rig.of(Paused)] == ["/faceDetection"] and starts(rig) == [0.0]


def spent(rig, seconds=6000.0, most=0):
    rig.mission.policy = dataclasses.replace(rig.mission.policy, most=most, seconds=seconds)
    return rig


def test_the_pauses_after_a_spent_budget_grow_until_a_pass_succeeds():
    said = []

    def answer(request):
        if isinstance(request, GoTo):
            said.append(True)
            return Answer() if len(said) == 8 else refusal(request)
        return NotImplemented

    rig = spent(one_leaf(
        "<Sequence><LookUpHome/><Fallback><Navigate/><HandleFallBack/></Fallback></Sequence>",
        answer))
    rig.run(advance, runs=10)
    waits = [later - sooner for sooner, later in zip(starts(rig), starts(rig)[1:])]
    # with the pace of a second
    assert waits == [11.0, 21.0, 41.0, 81.0, 161.0, 301.0, 301.0, 1.0, 11.0]
    assert [event.limit
            for event in rig.of(Paused)] == [10.0, 20.0, 40.0, 80.0, 160.0, 300.0, 300.0, 10.0]
    assert {(event.awaited, event.failure.cause, "budget" in event.reason)
            for event in rig.of(Paused)} == {("", Cause.REFUSED, True)}


def test_a_pause_is_over_when_the_budget_allows_a_recovery_again():
    rig = spent(one_leaf("<Fallback><PressYesNoDialogue/><HandleFallBack/></Fallback>", refusal),
                6.0, 2)
    rig.run(advance, runs=4)
    # the recovery at 1.0 counts for six seconds, and that at 2.0 is one of two
    assert starts(rig) == [0.0, 1.0, 2.0, 7.0]


def test_a_pause_counts_when_it_is_over_and_none_where_the_budget_allows_a_recovery_already():
    rig, persistence = one_leaf("<WelcomeSpeech/>"), RetryGate()
    leaf, = rig.tree.nodes
    leaf.setup(mission=rig.mission)
    leaf.failed(refusal(Say))
    rig.mission.failures.is_budget_spent = True

    def limit(again_at, failed_at, now):
        rig.mission.recovers_again_at = lambda: again_at
        paused = persistence.cause(rig.mission, failed_at, now)
        return paused and paused.limit

    assert limit(1000.0, 1000.0, 1000.0) is None
    assert [limit(2000.0, 1000.0, now) for now in (1000.0, 1009.9, 1010.0)] == [10.0, 10.0, None]
    assert [limit(1025.0, 1010.0, now) for now in (1010.0, 1024.9, 1025.0)] == [15.0, 15.0, None]
    assert limit(2000.0, 1025.0, 1025.0) == 40.0


def test_what_the_pass_before_failed_for_is_no_cause_after_this_one():
    rig = spent(one_leaf("<Sequence><ScriptCondition code='passes == 0'/><Script code='passes += 1'"
                         "/><Fallback><Navigate target='1;2;90'/><HandleFallBack/></Fallback>"
                         "</Sequence>", refusal))
    write(rig, passes=0)
    rig.run(advance, runs=4)
    assert starts(rig) == [0.0, 11.0, 12.0, 13.0] and len(rig.of(Paused)) == 1


def test_a_service_of_another_type_is_a_cause_that_persists():
    rig = one_leaf(GREET_AND_DRIVE, drives(Cause.TYPE_MISMATCH))
    rig.run(advance, runs=3)
    assert starts(rig) == [0.0, 11.0, 32.0]
    assert [(event.awaited, event.failure.cause)
            for event in rig.of(Paused)] == 2 * [("", Cause.TYPE_MISMATCH)]


@pytest.mark.parametrize("second", ["<Navigate/>",
                                    "<Fallback><Navigate/><HandleFallBack/></Fallback>"])
@pytest.mark.parametrize("cause", [Cause.REFUSED, Cause.TYPE_MISMATCH])
def test_of_several_causes_that_persist_the_newest_is_reported(cause, second):
    mission = ("<Sequence><LookUpHome/><ForceSuccess><Fallback><WelcomeSpeech/><HandleFallBack/>"
               "</Fallback></ForceSuccess>" + second + "</Sequence>")
    rig = one_leaf(mission, lambda request: NotImplemented if isinstance(request, QueryKnowledge)
                   else Failure(cause, "no", service_of(request)))
    spent(rig, most=0 if cause is Cause.REFUSED else 100).run(advance, runs=2)
    assert [event.failure.resource for event in rig.of(Paused)] == [service_of(GoTo)]


def test_a_pause_for_a_cause_that_persists_waits_for_what_is_left_of_it():
    rig, asked = one_leaf(GREET_AND_DRIVE, drives(Cause.TYPE_MISMATCH)), []

    class Waiting(Runner):
        def wait(self, seconds):
            asked.append(self.clock.time_left() if seconds is None else seconds)
            rig.clock.advance(2.5)

    polls = itertools.count()
    Waiting(Running(rig.tree, rig.mission, "x", 0),
            lambda: asked[-1:] == [2.5] or next(polls) > 100).run()
    assert asked[-4:] == [10.0, 7.5, 5.0, 2.5]


def test_a_node_that_goes_during_a_pause_is_waited_for_and_its_return_ends_the_pause():
    rig = one_leaf(GREET_AND_DRIVE, drives(Cause.TYPE_MISMATCH, lambda: rig.clock.now() < 1500.0))

    def visitor(rig):
        rig.clock.advance(0.5)
        if rig.clock.now() in (1004.0, 1500.0):
            tell(rig, service_of(GoTo), rig.clock.now() == 1500.0)

    assert rig.run(visitor, runs=2) == 0
    assert starts(rig)[1] == pytest.approx(500.0, abs=1.0)
    assert [event.awaited for event in rig.of(Paused)][:2] == ["", "/robotNavigation"]


def test_after_the_last_pass_nothing_is_waited_for():
    rig = spent(one_leaf("<Fallback><PressYesNoDialogue/><HandleFallBack/></Fallback>",
                         lambda each: refusal(each) if isinstance(each, Prompt) else Answer()))
    assert rig.run(advance, runs=1) == 3
    assert rig.of(Paused) == [] and rig.clock.now() == 1000.0


def test_a_stop_ends_the_wait():
    rig = one_leaf(GREET_AND_DRIVE, drives(Cause.NOT_REACHABLE))
    tell(rig, service_of(GoTo), False)
    assert rig.run(advance, runs=0, is_stopped=lambda: bool(rig.of(Paused))) == 3
    assert rig.last_requests == SAFE and len(rig.of(PassStarted)) == 1


def test_a_reloaded_mission_ends_the_wait():
    rig, other = one_leaf(GREET_AND_DRIVE,
                          drives(Cause.NOT_REACHABLE)), one_leaf("<FollowMeSpeech/>")
    tell(rig, service_of(GoTo), False)
    waiting = [Running(other.tree, other.mission, "other.xml", 2)]
    began = rig.clock.now()
    assert rig.run(advance, runs=0, successor=lambda: waiting.pop()
                   if waiting and rig.of(Paused) else None) == 0
    assert [event.number
            for event in other.of(PassStarted)] == [2] and rig.clock.now() - began < 2.0


def test_a_reloaded_mission_begins_with_the_shortest_pause():
    rig, other = [one_leaf(GREET_AND_DRIVE, drives(Cause.TYPE_MISMATCH)) for _ in range(2)]
    other.mission.gateway, other.mission.clock = rig.mission.gateway, rig.clock
    other.tree.clock = rig.clock
    waiting = [Running(other.tree, other.mission, "other.xml", 4)]
    rig.run(advance, runs=0, successor=lambda: waiting.pop()
            if waiting and len(rig.of(Paused)) == 2 and len(rig.of(PassFinished)) == 2 else None)
    assert [event.limit for event in rig.of(Paused) + other.of(Paused)] == [10.0, 20.0, 10.0]


def test_the_nodes_of_a_mission_are_set_up_once(monkeypatch):
    rig, set_up = one_leaf("<AlwaysSuccess/>"), []
    monkeypatch.setattr(rig.tree.nodes[0], "setup", lambda **kwargs: set_up.append(kwargs))
    runner = Runner(Running(rig.tree, rig.mission, "m.xml", 1), lambda: False)
    runner.prepare()
    assert set_up == [{"mission": rig.mission}]
    runner.run()
    assert len(set_up) == 1


def test_a_reloaded_mission_that_is_refused_ends_no_wait(monkeypatch):
    rig, other = one_leaf(GREET_AND_DRIVE,
                          drives(Cause.NOT_REACHABLE)), one_leaf("<FollowMeSpeech/>")
    monkeypatch.setattr(other.tree.nodes[0], "setup", lambda **kwargs: 1 / 0)
    tell(rig, service_of(GoTo), False)
    waiting = [Running(other.tree, other.mission, "other.xml", 2)]
    rig.run(advance, runs=0, is_stopped=lambda: rig.clock.now() > 1100.0,
            successor=lambda: waiting.pop() if waiting and rig.of(Paused) else None)
    assert not waiting and starts(rig) == [0.0]


class Operator:
    """Holds a run: ``acts`` are called one after the other whenever it waits."""

    def __init__(self, *acts, held=""):
        self.acts, self.held, self.is_stopped = list(acts), held, False

    def run(self, rig, **options):
        def act(rig):
            self.acts.pop(0)(rig)
            rig.clock.advance(0.25)

        return rig.run(act, held=lambda: self.held, is_stopped=lambda: self.is_stopped, **options)

    def hold(self, words):
        def act(rig):
            self.held = words

        return act

    def stop(self, rig):
        self.is_stopped = True


def nothing(rig):
    pass


def test_a_run_waits_for_its_start_before_its_first_pass():
    rig, operator, asked = one_leaf("<WelcomeSpeech/>"), Operator(held="waiting"), []
    operator.acts = [nothing, lambda rig: asked.extend(rig.requests), operator.hold("")]
    assert operator.run(rig) == 0
    assert asked == [] and [type(request) for request in rig.requests] == [Say]
    assert rig.of(Suspended) == [Suspended("waiting"), Suspended("")]


def test_a_pause_waits_for_what_the_robot_does_and_begins_nothing_new():
    rig = one_leaf("<Sequence><LookUpHome/><Navigate/><WelcomeSpeech/></Sequence>", hanging(GoTo))
    operator, counts = Operator(), []

    def note(rig):
        counts.append((len(rig.of(Suspended)), len(rig.requests)))

    def arrive(rig):
        rig.gateway.calls[1].finish(Answer())

    operator.acts = [operator.hold("paused"), note, arrive, note, note, operator.hold("")]
    assert operator.run(rig) == 0
    assert counts == [(1, 2), (2, 2), (2, 2)]  # the drive goes on; then nothing is asked
    assert rig.of(Suspended) == [Suspended("paused", is_due=True), Suspended("paused"),
                                 Suspended("")] and len(rig.requests) == 3
    arrived = next(event for event in rig.of(Answered) if event.call == 2)
    assert rig.events.index(arrived) < rig.events.index(Suspended("paused"))  # nothing drives


def test_a_pause_takes_hold_although_branches_overlap():
    rig = one_leaf("<Parallel><Repeat num_cycles='-1'><WelcomeGesture/></Repeat>"
                   "<Repeat num_cycles='-1'><WelcomeSpeech/></Repeat></Parallel>",
                   lambda request: Answer() if request in SAFE else None)
    operator, asked = Operator(), []

    def end(number):
        def act(rig):
            rig.gateway.calls[number].finish(Answer())
            asked.append(len(rig.requests))
        return act

    operator.acts = [operator.hold("paused"), end(0), end(1), operator.hold(""), operator.stop]
    operator.run(rig)
    assert asked == [2, 2] and rig.requests[4:] == SAFE
    assert rig.of(Suspended) == [Suspended("paused", is_due=True), Suspended("paused"),
                                 Suspended("")]


def test_a_timeout_ends_a_drive_during_a_pause_too():
    rig, operator = one_leaf("<Timeout msec='1000'><Navigate target='1;2;90'/></Timeout>",
                             hanging(GoTo)), Operator()
    dropped = []
    operator.acts = [operator.hold("paused")] + 6 * [nothing] + [
        lambda rig: dropped.extend(rig.gateway.dropped), operator.hold("")]
    operator.run(rig)
    assert dropped == rig.requests
    assert rig.of(Suspended) == [Suspended("paused", is_due=True), Suspended("paused"),
                                 Suspended("")]


def test_a_pause_while_a_cause_persists_is_reported():
    rig = one_leaf("<Navigate target='1;2;90'/>", drives(Cause.NOT_REACHABLE))
    rig.mission.health.report(GONE, HealthChanged(
        "service", "/robotNavigation/set_goal", "robotNavigation", False, "gone", "no drive", GONE))
    operator = Operator()
    operator.acts = 5 * [nothing] + [operator.hold("paused"), nothing, operator.stop]
    operator.run(rig, runs=0)
    assert rig.of(Paused) and rig.of(Suspended) == [Suspended("paused")]


@pytest.mark.parametrize("mission, held", [("<WelcomeSpeech/>", "waiting"),
                                           ("<Sleep msec='9000'/>", "")])
def test_a_stop_ends_a_run_that_is_held(mission, held):
    rig, operator = one_leaf(mission), Operator(held=held)
    operator.acts = [operator.hold("paused"), nothing, operator.stop]
    assert operator.run(rig, runs=0) == 0
    assert rig.gateway.requests[-2:] == SAFE and rig.tree.is_idle


def test_what_was_read_anew_while_a_run_waits_for_its_start_runs_first():
    rig, other, waiting = one_leaf("<WelcomeSpeech/>"), one_leaf("<FollowMeSpeech/>"), []
    other.mission.gateway = rig.mission.gateway
    operator = Operator(held="waiting")
    operator.acts = [lambda rig: waiting.append(Running(other.tree, other.mission, "other.xml", 1)),
                     nothing, operator.hold("")]
    assert operator.run(rig, successor=lambda: waiting.pop() if waiting else None) == 0
    assert (len(rig.of(PassStarted)), len(other.of(PassFinished))) == (0, 1)
