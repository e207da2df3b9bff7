"""The model of a run: what its events say is so, at any moment. What is expected follows from the
events' own meaning."""
import pytest
from msgspec.structs import replace

from behavior_controller.run import history as run_module
from behavior_controller.run.events import (
    Answered, Asked, BreakpointChanged, EntriesWritten, FeedbackReceived, HealthChanged,
    LeafFinished, Line, Lost, Message, Noticed, PassFinished, PassStarted, Paused, Recovered,
    Recovering, Retried, RunFinished, RunStarted, SafePart, SafeStateReported, Sources,
    StepStarted, Suspended, Tick, LeafSummary, StopChanged, TreeNode, TreeShown)
from behavior_controller.run.fold import KEPT_VISITS, fold
from behavior_controller.run.history import Run
from behavior_controller.run.state import (
    FAILED, STOPPED, NodeResult, Reason, RecoveryRound, State, step_over)
from behavior_controller.robot.gateway import Cause, Failure
from behavior_controller.run.health import GONE, SLOW
from behavior_controller.robot.requests import (
    Answer, GoTo, Location, PerformGesture, Prompt, QueryKnowledge, Say, SetAnimation, SetAttention,
    SetPose)
from behavior_controller.run.moment import card
from behavior_controller.run.record.reader import read_record
from behavior_controller.run.story import step_words
from mission_rig import recorded, visitor_who

EMPTY = ("", "")
BEGIN = [TreeShown("M", [
             TreeNode("all", "Sequence", "all", 0),
             TreeNode("all/go", "Navigate", "go", 1, next=(3,)),
             TreeNode("all/help", "HandleFallBack", "help", 1)]),
         RunStarted("/m/tour.xml", [("all/go", "Navigate"), ("all/help", "HandleFallBack")], {},
                    Sources((), EMPTY, EMPTY, "D5.4.3"))]
ARM, DESK = Location(1.0, 2.0, 90.0), Location(3.0, 4.0, 0.0)
BUSY, LATE = Failure(Cause.REFUSED, "busy", "/nav"), Failure(Cause.NO_ANSWER, "late", "/nav")
UNSEEN = Failure(Cause.CONDITION_FALSE, "no gaze seen", "/gaze")
DRIVES = StepStarted(2, "Navigate", "all/go", "driving", "to the arm", 180.0, False)


def arrived(mark="arrived", at=0.0):
    return LeafFinished(9, "Seen", "all/seen", "SUCCESS", "", 0.0, None,
                        LeafSummary("visit", "", mark, at))


def ended(status="SUCCESS", failure=None, seconds=1.0, uid=2, path="all/go", node="Navigate"):
    return LeafFinished(uid, node, path, status, "/nav", seconds, failure)


def lines(*events, begin=100.0):
    """Return a line for each event, one a second from ``begin`` on."""
    return [Line(begin + number, event) for number, event in enumerate(events)]


def after(*events):
    """Return the run of those events; the first one happens at 102."""
    return Run(lines(*BEGIN) + lines(*events, begin=102.0))


# ------------------------------------------------------------------------------------------- visits


def test_a_run_without_events_says_nothing():
    state = Run().state
    assert (state.visit, state.step, state.stop, state.waits_for, state.held_by) == (None,) * 5
    assert Run().at(5.0) == State()
    assert (state.visit_count, state.lost, state.omitted) == (0, 0, 0)
    assert not (state.robot.is_lost or state.course.is_unclear or state.course.handler)
    assert state.course.failed == (0, None)
    nothing = RecoveryRound("", "", 1, 0.0)
    assert (nothing.attempt, nothing.attempts, nothing.is_halted) == (0, 0, False)


def test_a_visit_has_its_times_and_its_end():
    run = after(PassStarted(1, 50.0), arrived(at=57.0), arrived("engaged"), arrived("asked"),
                arrived("yes"), PassFinished(1, "SUCCESS", 30.0))
    visit, = run.visits
    assert (visit.number, visit.began, visit.arrived, visit.engaged, visit.asked,
            visit.ended) == (1, 102, 103, 104, 105, 107)
    assert (visit.answer, visit.outcome) == ("yes", "SUCCESS")
    assert (visit.waited, visit.seconds) == (7.0, 23.0)  # of the 30 s of the mission's clock
    assert run.state.visits == (visit,) and run.state.visit_results == {"complete": 1}


def test_the_exhibits_of_a_visit_have_their_state_and_their_cause():
    def exhibit(number, state="begun"):
        return StopChanged(4, "SelectExhibit", "all/choose", number, 3, "thing {}".format(number),
                            state)

    run = after(PassStarted(1, 0.0), exhibit(1), exhibit(2), exhibit(2, "omitted"),
                Recovered("Navigate", "all/go", BUSY, "-", 0, True, "skipped"), exhibit(3),
                ended("FAILURE", LATE), PassFinished(1, "FAILURE", 9.0))
    assert [(each.number, each.state, each.began, each.seconds)
            for each in run.state.visit.stops] == [(1, "completed", 103, 1.0),
                                                      (2, "left out", 104, 2.0),
                                                      (3, "broken off", 107, 2.0)]
    assert [each.number for each in run.stops] == [1, 2, 3]
    assert [each.why and each.why.failure for each in run.stops] == [None, BUSY, LATE]
    assert run.at(104.5).stop.number == 2 and run.at(104.5).visit.stops[0].state == "completed"


def test_only_the_newest_visits_are_in_a_state_and_all_of_them_in_a_run():
    events = [event for number in range(1, 61) for event in (
        PassStarted(number, 0.0), PassFinished(number, "FAILURE", 1.0))]
    run = after(*events)
    assert len(run.state.visits) == KEPT_VISITS
    assert len(run.visits) == 60 == run.state.visit_results["broken off"]
    assert run.state.visit_count == 60 == run.state.visits[-1].number


def test_a_run_that_is_stopped_says_so_of_its_visit():
    state = after(PassStarted(1, 0.0), DRIVES, RunFinished("stopped", 0)).state
    assert (state.finished.exit_code, state.steps, state.visit.outcome) == (0, (), "")
    assert state.visit.why == Reason(STOPPED)


# -------------------------------------------------------------------------------------------- steps


def test_a_step_has_its_begin_its_limit_and_its_end():
    run = after(PassStarted(1, 0.0), DRIVES, ended())
    step, = run.steps
    assert (step.words, step.what, step.began, step.until,
            step.ended) == ("driving", "to the arm", 103, 283, 104)
    assert (step.uid, step.attempt, step.attempts, step.is_wait) == (2, 1, 1, False)
    assert run.state.step is None and replace(run.at(103.0).step, ended=104) == step


def test_a_step_waits_for_the_answer_to_its_request_and_is_held_by_what_is_wrong_there():
    gone = HealthChanged("service", "/nav", "robotNavigation", False, "gone",
                         "the robot cannot drive", GONE)
    run = after(DRIVES, Asked(1, "/nav", GoTo(ARM)), gone, Answered(1, LATE))
    assert run.at(102.0).waits_for is None
    assert (run.at(103.0).waits_for.call, run.at(103.0).waits_for.uid,
            run.at(103.0).held_by) == (1, 2, None)
    assert run.at(104.0).held_by == gone
    assert run.state.waits_for is None and run.state.held_by is None


def test_feedback_belongs_to_the_step_that_waits_for_its_call():
    run = after(DRIVES, Asked(1, "/nav", GoTo(ARM)), FeedbackReceived(1, "3 m to go"),
                FeedbackReceived(7, "of another"), FeedbackReceived(1, "1 m to go"))
    assert [run.at(time).step.feedback for time in (103.0, 104.0, 105.0, 106.0)] == [
        "", "3 m to go", "3 m to go", "1 m to go"]
    assert step_words(run.state.step) == "driving to the arm, 1 m to go"


def test_a_run_is_held_from_one_word_of_the_operator_to_the_next():
    run = after(DRIVES, Suspended("paused", is_due=True), Suspended("paused"), Suspended(""))
    assert (card(run.at(103.0)).kind, card(run.at(103.0)).next) == ("step", "paused")
    assert run.at(104.0).suspended == ("paused", 104.0)
    assert (card(run.at(104.0)).kind, card(run.at(104.0)).what) == ("paused", "paused")
    assert run.state.suspended[0] == "" and card(run.state).kind == "step"
    assert card(run.state).next == "help"


def test_a_wait_is_over_when_something_else_begins_and_two_steps_may_be_under_way():
    waits = StepStarted(5, "Seen", "all/seen", "waiting", "", 0.0, True)
    run = after(waits, DRIVES, StepStarted(6, "Say", "all/say", "speaking", "", 0.0, False))
    assert [(step.words, step.ended) for step in run.steps] == [("waiting", 103)]
    assert [step.uid for step in run.state.steps] == [2, 6] and run.state.step.until is None
    assert [step.uid for step in run.at(103.0).steps] == [2]


def test_a_pause_is_a_wait_with_its_limit_and_ends_what_was_under_way():
    run = after(PassStarted(1, 0.0), DRIVES, PassFinished(1, "FAILURE", 9.0),
                Paused(BUSY, "", "", 30.0), PassStarted(2, 9.0))
    step = run.at(105.0).step
    assert (step.is_wait, step.began, step.until, step.uid) == (True, 105, 135,
                                                                0) and step.cause.failure == BUSY
    assert [(each.began, each.ended) for each in run.steps] == [(103, 104), (105, 106)]


def test_what_was_reached_of_the_safe_state_is_so_until_the_robot_is_asked_for_what_ends_it():
    report = SafeStateReported(
        (SafePart("attention", "/att", None), SafePart("movement", "/ani", LATE)), 0.5)
    run = after(PassStarted(1, 0.0), report, PassStarted(2, 0.0), Asked(1, "/nav", GoTo(ARM)))
    assert [run.at(time).safe_state
            for time in (102, 103, 104, 105)] == [None, report, report, None]


@pytest.mark.parametrize("uid, goes_on, limits", [
    (2, True, [(103, 9.0)]), (2, False, [(105, 7.0)]),
    (8, True, [(103, 180.0), (105, 7.0)]), (8, False, [(103, 180.0), (105, 7.0)])])
def test_a_step_that_goes_on_is_the_same_one_with_a_later_end(uid, goes_on, limits):
    run = after(PassStarted(1, 0.0), DRIVES, Noticed("info", "so"),
                replace(DRIVES, uid=uid, limit=7.0, goes_on=goes_on))
    assert [(step.began, step.limit) for step in run.state.steps] == limits


def test_a_step_is_over_where_another_one_is_the_newest():
    says = StepStarted(6, "Say", "all/say", "speaking", "", 0.0, False)
    run = after(PassStarted(1, 0.0), DRIVES, Asked(1, "/nav", GoTo(ARM)), says,
                ended(uid=6, path="all/say"), ended(), Noticed("info", "so"))
    states = [run.at(float(time)) for time in range(102, 109)]
    over = [step_over(before, now) for before, now in zip(states, states[1:])]
    assert [step and (step.uid, step.began, step.ended) for step in over] == [
        None, None, (2, 103, 105), (6, 105, 106), (2, 103, 107), None]


# ----------------------------------------------------------------------------- requests and answers


def test_each_request_is_paired_with_its_answer_whatever_the_order():
    run = after(DRIVES, Asked(1, "/nav", GoTo(ARM)), Asked(2, "/say", Say("a")),
                Answered(2, Answer()), Answered(1, BUSY), Answered(7, Answer()))
    assert [(each.call, each.request, each.asked, each.answered, each.result, each.uid)
            for each in run.exchanges] == [(2, Say("a"), 104, 105, Answer(), 0),
                                           (1, GoTo(ARM), 103, 106, BUSY, 2)]
    assert [each.call for each in run.at(104.0).exchanges] == [1, 2] and run.state.exchanges == ()


@pytest.mark.parametrize("end", [ended("IDLE"), PassStarted(2, 0.0), BEGIN[1]])
def test_a_request_that_nobody_waits_for_any_more_has_no_result(end):
    run = after(DRIVES, Asked(1, "/nav", GoTo(ARM)), end, Answered(1, Answer()))
    assert [(each.call, each.answered, each.result) for each in run.exchanges] == [(1, None, None)]
    assert run.state.exchanges == ()


# -------------------------------------------------------------------------- failures and recoveries


def recovered(outcome, attempts, failure=BUSY):
    return Recovered("Navigate", "all/go", failure, "-", attempts, outcome != "given up", outcome,
                     "", 3)


def handler_ended(outcome="SUCCESS", seconds=5.0):
    return LeafFinished(3, "HandleFallBack", "all/help", outcome, "", seconds,
                        BUSY if outcome == "FAILURE" else None)


def test_a_recovery_has_its_failures_in_order_and_its_attempts():
    run = after(PassStarted(1, 0.0), DRIVES, ended("FAILURE", BUSY, seconds=4.0),
                Recovering(3, "Navigate", "all/go", BUSY, 1, 2), DRIVES,
                Retried("Navigate", "all/go", 1, LATE),
                Recovering(3, "Navigate", "all/go", LATE, 2, 2), DRIVES, recovered("done", 1),
                handler_ended(seconds=6.5))
    assert [(each.failure, each.attempt, each.at, each.visit, each.seconds)
            for each in run.failures] == [(BUSY, 0, 104, 1, 4.0), (LATE, 1, 107, 1, 0.0)]
    recovery, = run.recoveries
    assert recovery.failures == tuple(run.failures) and recovery.instead == ()
    assert (recovery.uid, recovery.path, recovery.handler, recovery.began,
            recovery.ended) == (3, "all/go", "all/help", 104.5, 111)
    assert (recovery.recovered.outcome, recovery.attempts, recovery.is_halted) == ("done", 1, False)
    # the pause before a retry counts as it
    steps = [run.at(time).step for time in (105.0, 106.0, 108.0, 109.0)]
    assert [(step.attempt, step.attempts) for step in steps] == [(2, 3), (2, 3), (3, 3), (3, 3)]
    assert [(step.uid, step.limit, step.is_wait) for step in (steps[0], steps[2])] == [
        (3, 0.0, False)] * 2
    assert [each.attempt for each in run.at(105.0).recoveries] == [1] and run.state.recoveries == ()


def test_what_an_inner_recovery_gave_up_is_left_to_the_outer_one_as_the_failure_of_the_step():
    outer = LeafFinished(8, "HandleFallBack", "all/outer", "SUCCESS", "", 1.0, None)
    run = after(ended("FAILURE", BUSY), Recovering(3, "Navigate", "all/go", BUSY, 1, 1),
                Retried("Navigate", "all/go", 1, LATE), recovered("given up", 1),
                handler_ended("FAILURE"), replace(recovered("skipped", 0), uid=8), outer)
    assert [[each.failure for each in recovery.failures]
            for recovery in run.recoveries] == [[BUSY, LATE], [BUSY]]
    assert [recovery.handler for recovery in run.recoveries] == ["all/help", "all/outer"]
    # what HandleFallBack hands on is no failure of its own
    assert [each.failure for each in run.failures] == [BUSY, LATE]


def test_failures_of_a_substitute_are_told_from_those_of_the_step():
    run = after(ended("FAILURE", BUSY), Recovering(3, "Navigate", "all/go", BUSY, 0, 0, "Look"),
                Retried("Look", "all/help", 1, LATE), recovered("given up", 0),
                handler_ended("FAILURE"))
    recovery, = run.recoveries
    assert [each.failure for each in recovery.failures] == [BUSY]
    assert [(each.node, each.failure)
            for each in recovery.instead] == [("Look", LATE)] and recovery.substitute == "Look"


def test_a_recovery_that_is_halted_has_no_decision():
    run = after(ended("FAILURE", BUSY), Recovering(3, "Navigate", "all/go", BUSY, 1, 2),
                handler_ended("IDLE"))
    recovery, = run.recoveries
    assert recovery.is_halted and recovery.recovered is None and run.state.recoveries == ()


@pytest.mark.parametrize("decision, then, without", [
    (recovered("skipped", 2), [], "Navigate"), (recovered("skipped", 2, UNSEEN), [], ""),
    (recovered("done", 1), [], ""), (recovered("substituted", 1), [], ""),
    (recovered("given up", 2), [], ""), (recovered("skipped", 2), [DRIVES], "Navigate"),
    (recovered("skipped", 2), [DRIVES, ended("IDLE")], "Navigate"),
    (recovered("skipped", 2), [DRIVES, ended()], ""),
    (recovered("skipped", 2), [replace(DRIVES, is_wait=True), ended()], "Navigate"),
    (recovered("skipped", 2), [PassStarted(2, 9.0)], "")])
def test_a_failure_tells_of_a_step_just_before_that_was_gone_on_without(decision, then, without):
    run = after(PassStarted(1, 0.0), decision, handler_ended(), *then,
                ended("FAILURE", LATE, uid=4, path="all/say", node="Say"))
    assert run.state.course.stuck == Reason(FAILED, "Say", LATE, without=without)


# ---------------------------------------------------------------------------------------- the robot


def test_the_robot_is_as_the_answers_leave_it():
    run = after(Asked(1, "/nav", GoTo(ARM)), Answered(1, Answer()), Asked(2, "/nav", GoTo(DESK)),
                Answered(2, BUSY), Asked(3, "/att", SetAttention("seeking")), Answered(3, Answer()),
                Asked(4, "/ani", SetAnimation("enabled")), Answered(4, Answer()),
                Asked(5, "/att", SetAttention("disabled")), Answered(5, LATE))
    where = [(run.at(time).robot.goal, run.at(time).robot.place)
             for time in (101, 102, 103, 104, 105)]
    assert where == [(None, None), (ARM, None), (None, ARM), (DESK, ARM), (None, None)]
    assert run.at(110.0).robot.attention == SetAttention("seeking") and run.at(
        110.0).robot.animation == SetAnimation("enabled")
    assert run.state.robot.attention is None  # nobody knows whether it was carried out


def test_a_service_is_well_when_nothing_is_wrong_in_any_respect():
    def change(is_well, respect):
        return HealthChanged("service", "/nav", "robotNavigation", is_well, respect, "", respect)

    run = after(change(False, GONE), change(False, SLOW), change(True, GONE), change(True, SLOW))
    assert [sorted(respect for _, respect in run.at(time).robot.troubles)
            for time in (102, 103, 104, 105)] == [[GONE], [GONE, SLOW], [SLOW], []]


@pytest.mark.parametrize("end, outcome, is_lost", [
    ([Answered(1, Answer()), ended()], "SUCCESS", False),
    ([Answered(1, Answer()), ended()], "FAILURE", True),
    ([Answered(1, BUSY), ended("FAILURE", BUSY)], "SUCCESS", True),
    ([Answered(1, BUSY), ended("FAILURE", BUSY)], "FAILURE", True),
    ([ended("IDLE")], "SUCCESS", True)])
def test_a_robot_is_lost_where_a_visit_left_it_away_from_home_until_it_sets_off(end, outcome,
                                                                               is_lost):
    run = after(PassStarted(1, 0.0), DRIVES, Asked(1, "/nav", GoTo(ARM)), *end)
    assert not run.state.robot.is_lost
    run.extend(lines(PassFinished(1, outcome, 9.0), PassStarted(2, 9.0), begin=200.0))
    assert run.state.robot.is_lost is is_lost
    run.extend(lines(Asked(2, "/say", Say("a")), begin=300.0))
    assert run.state.robot.is_lost is is_lost
    run.extend(lines(Asked(3, "/nav", GoTo(DESK)), begin=400.0))
    assert not run.state.robot.is_lost


def test_a_robot_that_never_drove_is_not_lost():
    run = after(PassStarted(1, 0.0), Asked(1, "/say", Say("a")), Answered(1, BUSY),
                PassFinished(1, "FAILURE", 9.0))
    assert not run.state.robot.is_lost


# ----------------------------------------------------------------------------------------- the tree


def test_the_letters_of_the_nodes_and_how_each_ended():
    run = after(PassStarted(1, 0.0), Tick(1.0, True, [(1, "R"), (2, "R")]), ended("FAILURE", BUSY),
                Tick(2.0, True, [(2, "F"), (3, "S"), (2, "-"), (3, "-"), (1, "S")]),
                Tick(2.0, None, [(1, "-")]), PassStarted(2, 9.0))
    assert [run.at(time).letters
            for time in (102, 103, 105, 106, 107)] == ["---", "RR-", "Sfs", "sfs", "---"]
    assert run.at(103.0).running == {1: 103, 2: 103} and run.state.running == {}
    assert run.results == [NodeResult(2, 103, 105, "F", BUSY),
                           NodeResult(3, 105, 105, "S"),
                           NodeResult(1, 103, 105, "S")]


def test_a_node_that_is_halted_has_ended_and_a_number_that_the_tree_has_not_changes_nothing():
    run = after(Tick(1.0, True, [(1, "R"), (9, "R")]), Tick(2.0, True, [(1, "-"), (2, "-")]))
    assert run.results == [NodeResult(1, 102, 103, "-")] and run.state.letters == "r--"


def test_the_entries_of_the_blackboard_at_any_moment():
    run = after(EntriesWritten([("a", "1"), ("tour/b", "x")]),
                EntriesWritten([("a", "2"), ("tour/b", None), ("c", None)]), BEGIN[0])
    assert [run.at(time).entries
            for time in (101, 102, 103, 104)] == [{}, {"a": "1", "tour/b": "x"}, {"a": "2"}, {}]


def test_what_the_record_lacks_is_counted_and_what_is_no_state_changes_none():
    run = after(Lost(3), Lost(4), Message("/speechEvent/text", 1, "yes", 1.0),
                Noticed("info", "so"))
    assert run.state.lost == 7
    assert replace(run.state, at=0.0) == replace(run.at(103.0), at=0.0)


def test_a_mission_that_replaces_another_begins_without_its_steps_and_statuses():
    run = after(DRIVES, Tick(1.0, True, [(2, "R")]), TreeShown("N", [TreeNode("a", "Say", "a", 0)]),
                BEGIN[1])
    assert (run.state.letters, run.state.steps, run.state.running) == ("-", (), {})


# --------------------------------------------------------------------------------------- any moment


def test_a_state_is_not_changed_by_what_comes_later():
    before = after(PassStarted(1, 0.0), DRIVES).state
    copy = replace(before)
    fold(before, 200.0, ended("FAILURE", BUSY))
    assert before == copy


def test_any_moment_of_a_run_is_the_same_as_the_run_was_then(tmp_path, monkeypatch):
    monkeypatch.setattr(run_module, "STRETCH_EVENTS", 7)
    record = read_record(recorded(tmp_path, visitor_who(says="yes"), failure_rate=0.2, seed=3))
    run, states = Run(), []
    for number, line in enumerate(record):
        run.take(Line(float(number), line.event))
        states.append(run.state)
    assert len(states) > 100 and run.at(-1.0) == State()
    for number, state in enumerate(states):
        assert run.at(float(number)) == state == run.at(number + 0.5)


def test_a_clock_that_is_set_back_hides_nothing():
    run = Run([Line(100.0, BEGIN[0]), Line(50.0, BEGIN[1]), Line(60.0, PassStarted(1, 0.0))])
    assert run.at(99.0) == State() and run.at(100.0).visit_count == 1


@pytest.mark.slow
def test_a_moment_of_a_long_run_costs_no_more_than_some_hundred_events(monkeypatch):
    run = after(*[Noticed("info", "so")] * 20_000)
    folded = []
    monkeypatch.setattr(run_module, "fold", lambda state, at, event: folded.append(at) or state)
    run.at(15_000.0)
    assert 0 < len(folded) <= run_module.STRETCH_EVENTS


# --------------------------------------------------------------------- what could not be seen, held


ASKS = LeafFinished(5, "Gaze", "all/gaze", "FAILURE", "/gaze", 0.0, UNSEEN)
SEES = LeafFinished(5, "Gaze", "all/gaze", "SUCCESS", "/gaze", 0.0, None)
HALTED = replace(SEES, status="IDLE")
GOES = HealthChanged("topic", "/gaze", "eyes", False, "gone", "no gaze is noticed", GONE)
RETURNS = replace(GOES, is_well=True, status="available again")


@pytest.mark.parametrize("events, blind", [
    ([ASKS], None), ([GOES, ASKS], GOES), ([ASKS, GOES], GOES), ([ASKS, GOES, RETURNS], GOES),
    ([GOES, RETURNS, ASKS], None), ([ASKS, GOES, SEES, RETURNS, ASKS], None),
    ([replace(GOES, name="/other"), ASKS], None), ([GOES, ASKS, RETURNS, HALTED, ASKS], GOES)])
def test_what_could_not_be_seen_is_told_from_what_was_not_there(events, blind):
    run = after(PassStarted(1, 0.0), *events, PassFinished(1, "FAILURE", 9.0))
    assert (run.state.visit.why.failure, run.state.visit.why.blind) == (UNSEEN, blind)


def test_a_visitor_who_is_not_seen_any_more_has_left_only_if_the_robot_can_see():
    leaves = replace(ASKS, summary=LeafSummary("visit", "", "left"))
    for events, blind in (([leaves], None), ([leaves, GOES], GOES)):
        run = after(PassStarted(1, 0.0), arrived(), *events, PassFinished(1, "FAILURE", 9.0))
        assert (run.state.visit.why.kind, run.state.visit.why.blind) == ("left", blind)


def test_the_strongest_trouble_of_a_service_is_the_one_that_counts():
    slow = replace(GOES, respect=SLOW, status="slow")
    for events in ([GOES, slow], [slow, GOES]):
        robot = after(*events).state.robot
        assert robot.trouble("/gaze") == GOES and robot.ill == (GOES,)
    healed = after(slow, GOES, RETURNS).state.robot
    assert healed.ill == (slow,) and healed.ill_since == {"/gaze": 102}
    assert after(GOES, RETURNS).state.robot.ill == ()


def test_a_node_is_held_until_its_breakpoint_lets_it_go_or_its_pass_begins_again():
    holds = BreakpointChanged(2, "all/go", True)
    run = after(PassStarted(1, 0.0), holds, replace(holds, is_held=False), holds,
                PassStarted(2, 0.0))
    assert [run.at(time).held for time in (103, 104, 105, 106)] == [{2: 103}, {}, {2: 105}, {}]


@pytest.mark.parametrize("cause, is_on_the_way, may_be_under_way", [
    (Cause.REFUSED, True, False), (Cause.NO_ANSWER, True, True),
    (Cause.CONNECTION_LOST, True, True), (Cause.HANDLER_EXCEPTION, True, True),
    (Cause.UNUSABLE_ANSWER, True, True), (Cause.NOT_REACHABLE, False, False),
    (Cause.NOT_ADVERTISED, False, False), (Cause.TYPE_MISMATCH, False, False)])
def test_a_goal_that_was_asked_for_is_not_one_that_may_be_under_way(
        cause, is_on_the_way, may_be_under_way):
    """The robot was on its way to the arm when the drive was dropped, and is asked to go home."""
    run = after(DRIVES, Asked(1, "/nav", GoTo(DESK)), Answered(1, Answer()), ended(),
                DRIVES, Asked(2, "/nav", GoTo(ARM)), replace(DRIVES, what="home"))
    home = [Asked(3, "/nav", GoTo(DESK)), Answered(3, Failure(cause, "", "/nav"))]
    run.extend(lines(*home, begin=200.0))
    robot, place = run.state.robot, run.at(108.0).robot.place
    assert robot.goal is None and place == DESK  # where it stood before
    assert (robot.way, robot.place) == (("home", None) if is_on_the_way else ("", DESK))
    assert [each.call for each in robot.unfinished] == ([3] if may_be_under_way else [])
    run.extend(lines(Asked(4, "/nav", GoTo(ARM)), Answered(4, Answer()), begin=300.0))
    assert (run.state.robot.way, run.state.robot.unfinished) == ("", ())


@pytest.mark.parametrize("request_, is_acting", [
    (GoTo(ARM), True), (Say("a"), True), (PerformGesture("iconic", 1, 3000), True),
    (SetAttention("social"), False), (SetAnimation("enabled"), False),
    (QueryKnowledge("home"), False), (Prompt(("Yes", "No")), False)])
def test_what_a_stop_leaves_under_way_is_what_the_robot_may_still_do(request_, is_acting):
    step = StepStarted(2, "Node", "all/go", "doing", "it", 9.0, False)
    run = after(step, Asked(1, "/a", request_), ended("IDLE"))
    words = [each.words for each in run.state.robot.unfinished]
    assert words == (["doing it"] if is_acting else [])
    run.extend(lines(Asked(2, "/a", request_), Answered(2, Answer()), begin=200.0))
    assert run.state.robot.unfinished == ()


def test_a_request_that_nothing_has_halted_is_under_way_when_the_safe_state_is_reported():
    run = after(DRIVES, Asked(1, "/nav", GoTo(ARM)), SafeStateReported((), 0.1))
    assert [each.words for each in run.state.robot.unfinished] == ["driving to the arm"]
    run.extend(lines(Answered(1, Answer()), begin=200.0))
    assert run.state.robot.unfinished == () and run.state.robot.place == ARM


@pytest.mark.parametrize("end, is_speaking", [("SUCCESS", False), ("IDLE", True)])
def test_a_robot_that_answers_early_goes_on_until_the_step_ends(end, is_speaking):
    says = StepStarted(2, "Welcome", "all/go", "saying", "“a”", 9.0, False)
    run = after(says, Asked(1, "/say", Say("a")), Answered(1, Answer()),
                replace(says, goes_on=True), ended(end))
    assert [each.words for each in run.at(105.0).robot.unfinished] == ["saying “a”"]
    assert bool(run.state.robot.unfinished) is is_speaking


def test_a_run_that_ends_awaits_nothing_more():
    run = after(DRIVES, Asked(1, "/nav", GoTo(ARM)), RunFinished("stopped", 0))
    assert run.state.exchanges == () and run.state.robot.goal is None


@pytest.mark.parametrize("answer, place", [(Answer(), ARM), (BUSY, None)])
def test_the_robot_is_where_its_first_pose_was_set_to_be(answer, place):
    run = after(Asked(1, "/pose", SetPose(ARM)), Answered(1, answer))
    assert run.state.robot.place == place
    # what is told after a drive moves nothing
    drive = [DRIVES, Asked(2, "/nav", GoTo(DESK)), Answered(2, Answer()), ended()]
    later = [Asked(3, "/pose", SetPose(ARM)), Answered(3, answer)]
    assert after(*drive, *later).state.robot.place == DESK


def test_where_the_robot_is_after_a_drive_that_failed_or_was_dropped():
    there = [DRIVES, Asked(1, "/nav", GoTo(ARM)), Answered(1, Answer()), ended()]
    for end in ([Answered(2, BUSY)], [ended("IDLE")]):
        robot = after(*there, replace(DRIVES, what="home"), Asked(2, "/nav", GoTo(DESK)),
                      *end).state.robot
        assert (robot.goal, robot.place, robot.last_place, robot.way) == (
            None, None, "the arm", "home")
