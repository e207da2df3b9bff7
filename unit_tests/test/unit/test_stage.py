"""Missions in virtual time: faults, messages and times are those of a test with real nodes."""
import dataclasses
import math
from itertools import islice
from unittest import mock

import pytest

from behavior_controller.config import phrases, settings
from behavior_controller.bt.engine.tree import Tree
from behavior_controller.bt.loader.document import parse
from behavior_controller.run.events import (HealthChanged, LeafFinished, Noticed,
                                                  PassFinished, PassStarted, Paused,
                                                  RunFinished, RunStarted, Tick, TreeShown)
from behavior_controller.robot.requests import LETTERS_A_SECOND, Say
from behavior_controller.simulation import virtual_robot
from behavior_controller.simulation.arrivals import Arrivals
from behavior_controller.simulation.configuration import REAL
from behavior_controller.simulation.faults import Faults, KINDS, PlannedFault
from behavior_controller.simulation.rehearsal.play import CALM, START, LoadedMission


LAB_TOUR = LoadedMission(settings.defaults())
M = '<root BTCPP_format="4"><BehaviorTree ID="M">{}</BehaviorTree></root>'
SAY = M.format("<Fallback><WelcomeSpeech/><HandleFallBack/></Fallback>")
SPOKEN = len(phrases.load("English").speeches["WelcomeSpeech"]) / LETTERS_A_SECOND


def play(on=LAB_TOUR, silent=(), **changed):
    return on.play(dataclasses.replace(CALM, **changed), silent)


def of_text(text, **chosen):
    return LoadedMission(settings.defaults(**chosen), [parse(text)])


def of(kind, played):
    return [event for _, event in played.events if isinstance(event, kind)]


def changes_of_health(played):
    """Return seconds from the beginning and the status of each change."""
    return [(pytest.approx(at - START, abs=0.01), event.status) for at, event in played.events
            if isinstance(event, HealthChanged)]


def test_a_calm_tour_ends_with_success():
    played = play(mission_runs=2)
    assert [event.outcome for event in of(PassFinished, played)] == ["SUCCESS", "SUCCESS"]
    assert played.exit_code == 0 and not played.cut_off and not played.errors


def test_all_that_happened_has_a_time_of_its_own():
    played = play(mission_runs=2)
    times = [at for at, _ in played.events] + [line.time for line in played.journal]
    assert len(set(times)) == len(times) and min(times) >= START
    assert [at for at, _ in played.events] == sorted(at for at, _ in played.events)


@pytest.mark.parametrize("kind, cause, seconds", [
    ("refused", "refused", SPOKEN), ("exception", "exception", 0.0),
    ("unanswered", "no-answer", 60.0), ("crash", "connection-lost", 0.0),
    ("wrong", "refused", SPOKEN)])
def test_each_kind_of_fault_is_met_as_on_the_real_robot(kind, cause, seconds):
    played = play(of_text(SAY), planned_faults=(PlannedFault("textToSpeech", 1, kind),),
                  call_times=REAL)
    failed = of(LeafFinished, played)[0]
    assert failed.failure.cause.value == cause and failed.seconds == pytest.approx(
        seconds, abs=0.01)
    assert [line.fault for line in played.journal if line.call == 1 and line.time < played.ended
            ] == ["refused" if kind == "wrong" else kind]


@pytest.mark.parametrize("node, leaf, cause",
                         [("knowledgeBase", "LookUpHome", "unusable-answer"),
                          ("gestureExecution", "WelcomeGesture", "unusable-answer"),
                          ("tabletEvent", "PressYesNoDialogue", "unusable-answer")])
def test_an_answer_that_means_nothing_is_found_unusable(node, leaf, cause):
    played = play(of_text(M.format("<{}/>".format(leaf))),
                  planned_faults=(PlannedFault(node, 1, "wrong"), ))
    assert [event.failure.cause.value for event in of(LeafFinished, played)] == [cause]


@pytest.mark.slow
def test_the_visitor_answers_when_the_question_is_over():
    played = play(call_times=REAL, arrival_rate=6000.0)
    asked = next(event for event in of(LeafFinished, played) if event.node == "QueryTourSpeech")
    over = next(at for at, event in played.events if event is asked)
    answered = next(line.time for line in played.journal
                    if line.content.get("data") == LAB_TOUR.world.visitor.manners.yes)
    assert asked.seconds > 1.0 and over < answered < over + 1.0


def test_a_request_without_sense_is_refused_at_once():
    blank = tuple(exhibit._replace(description1=" ")
                  for exhibit in LAB_TOUR.world.knowledge.exhibits)
    on = LoadedMission(settings.defaults(),
               [parse(M.format('<Sequence><RetrieveListOfExhibits/><SelectExhibit/>'
                               '<DescribeExhibitSpeech name="1"/></Sequence>'))],
               LAB_TOUR.world._replace(knowledge=LAB_TOUR.world.knowledge._replace(exhibits=blank)))
    played = play(on, call_times=REAL)
    speech = of(LeafFinished, played)[-1]
    assert (speech.failure.cause.value, speech.seconds) == ("refused", pytest.approx(0.0, abs=0.01))
    assert [bool(line.objection) for line in played.journal
            if line.call and line.time < played.ended] == [False, True]


@pytest.mark.slow
def test_a_speech_that_is_late_for_its_words_is_slow_until_one_is_in_time_again():
    played = play(of_text(SAY), planned_faults=(PlannedFault("textToSpeech", 1, "unanswered"), ),
                  mission_runs=2)
    (began, slow), (ended, _) = changes_of_health(played)
    assert (began, ended) == (pytest.approx(2 * SPOKEN + 3, abs=0.1), 60.0)
    assert slow.startswith("slow: no answer for 11.3 s, where about 4 s are usual")


@pytest.mark.slow
def test_a_call_that_was_answered_is_neither_slow_nor_failing():
    played = play(of_text(M.format(
        '<Sequence>{}<Sleep msec="100000"/></Sequence>'.format("<WelcomeSpeech/>" * 3))))
    assert played.exit_code == 0 and changes_of_health(played) == []


def test_a_node_that_has_crashed_is_not_reachable_until_it_is_back():
    played = play(
        of_text(M.format(
            '<Sequence>{}<Sleep msec="2000"/><WelcomeSpeech/><Sleep msec="200"/></Sequence>'.format(
                "<ForceSuccess><WelcomeSpeech/></ForceSuccess>" * 2))),
        planned_faults=(PlannedFault("textToSpeech", 1, "crash"),))
    causes = [event.failure and event.failure.cause.value for event in of(LeafFinished, played)]
    assert causes == ["connection-lost", "not-reachable", None]
    assert changes_of_health(played) == [(0.1, "gone: not reachable: connection refused"),
                                         (2.1, "available again")]


def test_the_topic_of_a_node_that_has_crashed_is_silent_meanwhile():
    played = play(planned_faults=(PlannedFault("overtAttention", 2, "crash"),))
    said = [line.time for line in played.journal if line.node == "overtAttention" and not line.call]
    crashed = [line.time for line in played.journal if line.fault == "crash"][0]
    assert min(at for at in said if at > crashed) == pytest.approx(crashed + virtual_robot.AWAY,
                                                                   abs=0.1)


@pytest.mark.slow
def test_the_faults_are_those_that_the_simulated_nodes_draw():
    played = play(failure_rate=0.3, random_seed=7, fault_kinds=KINDS, mission_runs=2)
    for node in ("textToSpeech", "overtAttention", "robotNavigation", "gestureExecution"):
        lines = [line for line in played.journal if line.node == node and line.call]
        drawn = Faults(0.3, "7/{}/faults".format(node), KINDS)
        expected = [drawn.next() for _ in lines]
        assert [line.call for line in lines] == list(range(1, len(lines) + 1)) and lines
        if node != "textToSpeech":  # whose answers cannot be nonsense
            assert [line.fault for line in lines] == expected
        assert [line.fault is None for line in lines] == [fault is None for fault in expected]


def test_messages_come_at_the_times_that_the_simulated_nodes_draw():
    played = play(visitor_behaviour="silent", arrival_rate=60.0, random_seed=3)
    first = [line.time for line in played.journal if line.node == "faceDetection"][0]
    assert first == pytest.approx(next(Arrivals(60.0, "3/faceDetection/arrivals").times(START)),
                                  abs=1e-3)
    published = list(islice(Arrivals(60.0, "3/overtAttention/arrivals").times(START), 200))
    for line in played.journal:
        if line.node == "overtAttention" and not line.call:
            assert min(abs(line.time - at) for at in published) < 1e-3


def test_a_mission_that_does_not_end_is_cut_off_and_says_where_it_waits():
    played = play(silent={"/faceDetection/data"}, test_timeout=100.0)
    assert played.exit_code is None and played.seconds == pytest.approx(100.0, abs=1.0)
    assert played.cut_off == "the mission did not end within 100 s"
    # though they have not ended
    assert 1 in played.reached and set(played.waiting) <= played.reached
    assert [LAB_TOUR.mission.tree.nodes[uid - 1].name for uid in played.waiting] == ["ForEver"]


def test_a_mission_that_ends_with_its_time_was_in_time():
    assert play(of_text(M.format('<Sleep msec="10000"/>')), test_timeout=10.0).exit_code == 0


def test_a_mission_that_changes_something_at_every_tick_is_ticked_four_times_a_second():
    loop = '<KeepRunningUntilFailure><Script code="x := 1"/></KeepRunningUntilFailure>'
    ticks = [event.at for _, event in play(of_text(M.format(loop)), test_timeout=60.0).events
             if isinstance(event, Tick)]
    assert ticks[-1] - ticks[-21] == pytest.approx(5.0)


def test_a_message_that_nothing_reads_causes_no_tick():
    with mock.patch.object(Tree, "tick_once", autospec=True, side_effect=Tree.tick_once) as tick:
        played = play(of_text(M.format('<Sleep msec="5000"/>')))
    messages = [line for line in played.journal if line.node == "faceDetection"]
    # one begins the Sleep, the other one follows its end
    assert messages and tick.call_count == 2 and played.exit_code == 0


@pytest.mark.slow
def test_a_mission_that_busy_loops_is_cut_off():
    played = play(of_text(M.format('<Repeat num_cycles="-1"><AlwaysSuccess/></Repeat>')))
    assert (played.exit_code, played.cut_off, played.seconds) == (None, "the mission busy-loops",
                                                                  0.0)


@pytest.mark.parametrize("body, absent, cause", [
    ("<SetSpeechEvent name='enabled'/>", "/speechEvent/set_enabled", None),
    ("<PressYesNoDialogue/>", "/tabletEvent/prompt_and_get_response", "not-advertised")])
def test_a_leaf_without_its_service_succeeds_unless_the_mission_needs_an_answer(
        body, absent, cause):
    played = play(of_text(M.format(body), robotInterface="release-1.0"), absent_services=(absent,))
    ended, = of(LeafFinished, played)
    assert (ended.failure and
            ended.failure.cause.value, ended.seconds) == (cause, pytest.approx(0.0, abs=0.01))


def test_a_visitor_is_present_from_the_first_request_to_the_drive_home():
    played = play()
    home = LAB_TOUR.world.knowledge.home.location
    requests = [line for line in played.journal if line.call and line.time < played.ended]
    left, = [line.time for line in requests if line.content.get("goal_x") == home.x
             and line.content["goal_y"] == home.y]
    assert played.presence == [(requests[0].time, True), (left, False)]
    assert [at for at, _ in played.asked] == sorted(at for at, _ in played.asked)
    assert [type(request)
            for _, request in played.asked] == [service_of(line).request for line in requests]


def service_of(line):
    return next(service for service in LAB_TOUR.settings.interface.services
                if service.name == line.resource)


@pytest.mark.parametrize("recognise_by", ("topic", "action"))
def test_a_robot_of_release_1_0_hears_by_topic_and_by_action(recognise_by):
    release = LoadedMission(
        settings.defaults(robotInterface="release-1.0", scenarioSpecification="release_1_0_tour"))
    played = play(release, recognise_by=recognise_by, arrival_rate=120.0)
    assert played.exit_code == 0
    said = {
        line.resource for line in played.journal if line.node == "speechEvent" and not line.call}
    assert said == {
        "/speechEvent/text" if recognise_by == "topic" else "/speechEvent/recognise_speech_action"}


def test_an_exception_in_a_leaf_ends_the_pass(monkeypatch):
    start = virtual_robot.VirtualRobot.start
    monkeypatch.setattr(
        virtual_robot.VirtualRobot, "start", lambda self, request: 1 / 0
        if isinstance(request, Say) else start(self, request))
    played = play(of_text(SAY))
    assert [event.exit_code for event in of(RunFinished, played)] == [played.exit_code] == [3]
    assert "ZeroDivisionError" in [
        event.text for event in of(Noticed, played) if event.level == "error"][0]


def test_a_run_that_ends_by_itself_asks_for_the_safe_state_which_is_not_the_missions():
    played = play(of_text(SAY))
    last = [(line.resource, line.content["state"]) for line in played.journal
            if line.call and line.time > played.ended]
    assert sorted(last) == [("/animateBehaviour/set_activation", "disabled"),
                            ("/overtAttention/set_mode", "disabled")]
    assert [type(request) for _, request in played.asked] == [Say]


def test_a_pass_that_gives_up_with_its_node_gone_waits_for_it():
    body = '<Sequence><LookUpHome/><Navigate/></Sequence>'
    on = of_text(M.format(body))
    played = play(on, planned_faults=(PlannedFault("robotNavigation", 1, "crash"),), mission_runs=2)
    crashed, = [line.time for line in played.journal if line.fault == "crash"]
    second = [at for at, event in played.events if isinstance(event, PassStarted)][1]
    assert [event.awaited for event in of(Paused, played)] == ["/robotNavigation"]
    assert second == pytest.approx(crashed + virtual_robot.AWAY + virtual_robot.NOTICED,
                                   abs=0.01) and played.exit_code == 0


def test_an_exception_beside_the_leaves_ends_the_mission(monkeypatch):
    monkeypatch.setattr(virtual_robot.Health, "publish", lambda self, events: 1 / 0)
    played = play(of_text(SAY))
    (uid, text), = played.errors
    assert (played.exit_code, uid) == (4, 0)
    assert text.startswith("ZeroDivisionError: division by zero (")


def test_the_record_is_what_a_record_holds():
    run = play().run()
    assert [type(line.event) for line in run.lines[:2]] == [TreeShown, RunStarted]
    assert (1, "R") in next(line.event for line in run.lines
                            if isinstance(line.event, Tick)).changes
    assert run.failures[0].is_false_condition and math.isfinite(
        run.failures[0].at) and run.state.finished is not None
