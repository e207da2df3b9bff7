"""The simulated robot of release 1.1 and the judge of its missions, in virtual time."""
import functools
import re

import pytest
from msgspec.structs import replace

from behavior_controller.bt.loader.document import parse
from behavior_controller.config import knowledge_files, settings
from behavior_controller.run.events import (
    Asked, Answered, EntriesWritten, FeedbackReceived, LeafFinished)
from behavior_controller.robot.requests import LETTERS_A_SECOND
from behavior_controller.simulation.behaviour import DRIVE
from behavior_controller.simulation.faults import KINDS
from behavior_controller.simulation.rehearsal.play import LoadedMission
from behavior_controller.simulation.visitor import BEHAVIOURS
from behavior_controller.text import Source

from unit_tests.judge.facts import of
from unit_tests.judge.verdict import Verdict

from plays import calls, changed, facts

ROBOT = "release-1.1"
MISSION = """<root BTCPP_format="4"><BehaviorTree ID="M"><Sequence><START_OF_TREE/>
<RetrieveListOfExhibits/><SelectExhibit/><SelectExhibit/>{}</Sequence></BehaviorTree></root>"""
AT_ONCE = """<Parallel success_count="2" failure_count="1"><DescribeExhibitSpeechAsync/>
<PerformDeicticGestureAsync/></Parallel>"""
SPEECH, GESTURE = "/textToSpeech/say_text", "/gestureExecution/perform_gesture"


def of_steps(steps, faults=(), chosen=(), **test):
    """Return the facts of a test with a mission of these steps at the second stop, on a robot whose
    calls take their time."""
    on = settings.defaults(robotInterface=ROBOT, **dict(chosen))
    on = LoadedMission(on, [parse(MISSION.format(steps))])
    return facts(faults, on=on, call_times="real", **test)


def objections(of_test):
    return Verdict(of_test).objections


def ends(of_test):
    """Return how each leaf that asks the robot ended, and after how many seconds."""
    return [(event.node, event.failure.cause.value if event.failure else event.status,
             pytest.approx(event.seconds, abs=0.2))
            for _, event in of(of_test.run.lines, LeafFinished) if event.resource.startswith("/")]


# ------------------------------------------------------------------------------------ several steps


def test_steps_at_once_are_judged_and_what_is_changed_in_one_is_objected_to():
    of_test = of_steps(AT_ONCE)
    (first, speech), (second, gesture) = of(of_test.run.lines, Asked)[:2]
    length = len(speech.request.text) / LETTERS_A_SECOND
    assert (speech.service, gesture.service) == (SPEECH, GESTURE)
    assert second - first < 0.1 and length > 4.0
    # the gesture of 3 s ends first
    assert ends(of_test) == [("PerformDeicticGestureAsync", "SUCCESS", 3.0),
                             ("DescribeExhibitSpeechAsync", "SUCCESS", length)]
    assert objections(of_test) == ()
    other = replace(gesture, request=replace(gesture.request, duration_ms=1))
    wrong = changed(of_test, lambda line: [
        replace(line, event=other) if line.event is gesture else line])
    assert "duration_ms is 1 instead of 3000" in objections(wrong)[0]
    for unheard in calls(of_test)[:2]:
        journal = [line for line in of_test.journal if line != unheard]
        assert "never got the request" in objections(of_test._replace(journal=journal))[0]


@pytest.mark.slow
@pytest.mark.parametrize("steps", [
    '<SayTextAsync name="1"/><SayTextAsync name="2"/>',
    '<SayText name="1"/><SayTextAsync name="2"/>',
    '<SayTextAsync name="1"/><PerformIconicGestureAsync name="welcome"/><NavigateAsync/>'])
@pytest.mark.parametrize("fault", [(), ["textToSpeech:1"], ["textToSpeech:1:exception"],
                                   ["textToSpeech:1:crash"]])
def test_several_requests_under_way_are_compared_without_a_false_objection(steps, fault):
    count = steps.count("/>")
    assert objections(of_steps(f'<Parallel success_count="{count}">{steps}</Parallel>',
                               fault)) == ()


def test_the_answers_to_two_requests_are_not_mixed_up():
    of_test = of_steps(AT_ONCE)
    speech = of(of_test.run.lines, Asked)[0][1].call
    wrong = changed(of_test, lambda line: [
        replace(line, event=replace(line.event, call=3 - line.event.call))
        if isinstance(line.event, Answered) and line.event.call < 3 else line])
    assert speech == 1 and objections(wrong) != ()


# ---------------------------------------------------------------------------------------- the robot


@pytest.mark.parametrize("lacks, step, field", [
    ({}, '<SayTextAsync name="2"/>', "text"), ({}, '<SayText name="2"/>', "message"),
    ({"absent_actions": (SPEECH,)}, '<SayTextAsync name="2"/>', "message"),
    ({"absent_services": (SPEECH,)}, '<SayText name="2"/>', "text")])
def test_of_a_service_and_an_action_the_other_one_carries_a_request_out(lacks, step, field):
    of_test = of_steps(step, **lacks)
    assert calls(of_test, "textToSpeech")[0].content == {
        field: "Please follow me.", "language": "English"}
    assert [end[1] for end in ends(of_test)] == ["SUCCESS"] and objections(of_test) == ()


@pytest.mark.parametrize("step", ['<SayText name="2"/>', '<SayTextAsync name="2"/>'])
def test_a_robot_with_neither_does_not_speak(step):
    of_test = of_steps(step, absent_services=(SPEECH,), absent_actions=(SPEECH,))
    assert ends(of_test)[0][1] == "not-advertised"


@pytest.mark.slow
@pytest.mark.parametrize("kind, cause, seconds", [
    ("refused", "refused", DRIVE), ("exception", "refused", 0.0),
    ("wrong", "unusable-answer", DRIVE), ("unanswered", "no-answer", 180.0),
    ("crash", "connection-lost", 0.0)])
def test_each_fault_of_a_goal_has_its_cause(kind, cause, seconds):
    """One that never ends is over at the deadline; a server that dies in it, when that is seen."""
    of_test = of_steps("<NavigateAsync/>", ["robotNavigation:1:" + kind])
    assert ends(of_test)[:1] == [("NavigateAsync", cause, seconds)] and objections(of_test) == ()


HALTED = '<ForceSuccess><Timeout msec="{}">{}</Timeout></ForceSuccess>{}'


@pytest.mark.parametrize("step, at, seconds", [
    # a gesture goes on, and the next one begins after it
    ('<PerformIconicGestureAsync name="welcome"/>', 1.0, 3.0 + 2.0),
    # a drive ends, so that the next one takes its own time alone
    ("<NavigateAsync/>", 5.0, DRIVE),
    # "Please follow me.": 17 letters; it stops before it is played, and not while it is
    ('<SayTextAsync name="2"/>', 0.1, 17 / 14), ('<SayTextAsync name="2"/>', 0.6, 34 / 14 - 0.6)])
def test_a_cancel_stops_a_drive_and_neither_an_arm_nor_a_voice(step, at, seconds):
    of_test = of_steps(HALTED.format(int(at * 1000), step, step))
    (_, halted, after), (_, done, took) = ends(of_test)
    assert (halted, done) == ("IDLE", "SUCCESS")
    assert (after, took) == (pytest.approx(at, abs=0.1), pytest.approx(seconds, abs=0.1))
    assert objections(of_test) == ()


def test_a_drive_reports_how_far_it_is():
    of_test = of_steps("<NavigateAsync/>")
    assert [event.text for _, event in of(of_test.run.lines, FeedbackReceived)] == ["3.0 m left"]


@pytest.mark.parametrize("recognise_by, answer", [
    ("topic", "yes"), ("action", "yes"), ("idleAction", "")])
def test_an_action_that_never_handles_its_goals_ends_the_listening_in_time(recognise_by, answer):
    of_test = of_steps('<SayText name="5"/><GetVisitorResponseAsync/>', recognise_by=recognise_by)
    said = [dict(event.entries).get("visitorResponse")
            for _, event in of(of_test.run.lines, EntriesWritten)]
    assert [text for text in said if text is not None][-1] == answer
    listened = ends(of_test)[-1]
    assert listened[:2] == ("GetVisitorResponseAsync", "SUCCESS")
    assert listened[2] == (10.0 if recognise_by == "idleAction" else pytest.approx(0.5, abs=0.5))
    assert objections(of_test) == ()


# --------------------------------------------------------------------------------------- the tours


TOURS = ["release_1_1_tour", "release_1_1_visitor_tour", "d6_1_tour"]


@functools.lru_cache(maxsize=None)
def tour(name):
    return LoadedMission(settings.defaults(robotInterface=ROBOT, scenarioSpecification=name))


def of_tour(name, **test):
    return facts(on=tour(name), call_times="real", **test)


def stops(of_test):
    """Return the end of the pass and the names of the places that were described."""
    visit, = of_test.run.visits
    return visit.outcome, [stop.name for stop in visit.stops]


@pytest.mark.slow
@pytest.mark.parametrize("seeds", [
    range(1, 6), pytest.param(range(6, 21), marks=pytest.mark.long)], ids=str)
@pytest.mark.parametrize("name", TOURS)
def test_the_verdict_on_each_tour_is_passed_with_each_of_twenty_seeds(name, seeds):
    verdicts = {seed: Verdict(of_tour(name, failure_rate=0.3, random_seed=seed)).objections
                for seed in seeds}
    assert verdicts == dict.fromkeys(verdicts, ())


@pytest.mark.slow
@pytest.mark.parametrize("visitor", BEHAVIOURS)
@pytest.mark.parametrize("name", TOURS)
def test_each_visitor_and_each_kind_of_fault_leads_to_no_false_objection(name, visitor):
    assert objections(of_tour(name, visitor_behaviour=visitor)) == ()
    assert objections(of_tour(name, visitor_behaviour=visitor, failure_rate=0.3, random_seed=7,
                              fault_kinds=KINDS)) == ()


def test_the_introduced_tour_goes_as_its_knowledge_file_has_it():
    """1, 3, 4, 2, 5; the places 1 and 5 have no target."""
    of_test = of_tour("release_1_1_tour", visitor_behaviour="silent")
    assert stops(of_test) == ("SUCCESS", [
        "Tour begin", "Robot arm", "Robot head", "Pepper", "Tour end"])
    pointed = [line.content for line in calls(of_test, "gestureExecution")]
    assert [(content["gesture_type"], content["arm"], content["deictic_shape"])
            for content in pointed] == 3 * [("deictic", "EITHER", "PALM_UPWARDS")] + [
                ("iconic", "", "")]


@pytest.mark.slow
@pytest.mark.parametrize("name", TOURS[1:])
@pytest.mark.parametrize("visitor, outcome, number", [
    ("engages", "SUCCESS", 7), ("leaves", "FAILURE", 4)])
def test_a_visitor_is_shown_each_exhibit_and_is_missed_when_gone(name, visitor, outcome, number):
    """A visitor who leaves is gone at the third place after the first, where the robot scans."""
    end, names = stops(of_tour(name, visitor_behaviour=visitor))
    assert (end, len(names)) == (outcome, number)


# ------------------------------------------------------------------ faults that the release has too


def test_without_its_key_the_arm_is_the_default_and_not_what_was_read_before(monkeypatch):
    """Fault 1: the release sends the last phrase as the arm, and the robot does not move."""
    whole = knowledge_files._source

    def shortened(*given):
        source = whole(*given)
        return Source(source.file, re.sub(r"(?m)^(gestureArm|deicticShape).*\n", "", source.text))
    monkeypatch.setattr(knowledge_files, "_source", shortened)
    of_test = of_steps('<SayText name="2"/><PerformDeicticGesture/><PerformDeicticGestureAsync/>')
    pointed = [line.content for line in calls(of_test, "gestureExecution")]
    assert [(content["arm"], content["deictic_shape"]) for content in pointed] == 2 * [
        ("EITHER", "PALM_UPWARDS")]
    assert [end[1] for end in ends(of_test)] == 3 * ["SUCCESS"]
    # the judge reads the file itself
    assert [text.partition(" of ")[0] for text in objections(of_test)] == [
        "the controller has another text than the file"]


@pytest.mark.slow
def test_a_visitor_is_not_lost_in_the_mode_that_says_nothing_of_visitors():
    """Fault 3: the release asks for another mode than its missions set, and gives no tour."""
    of_test = of_tour("release_1_0_tour")
    assert {line.content["value"] for line in of_test.journal
            if line.content.get("state") == "social" and not line.call} == {-1}
    end, names = stops(of_test)
    assert (end, len(names)) == ("SUCCESS", 7) and objections(of_test) == ()


@pytest.mark.slow
def test_the_published_parts_give_the_whole_tour():
    """Fault 7: speech by the service alone, no way to switch recognition, no tablet."""
    of_test = of_tour("release_1_1_visitor_tour", recognise_by="action", absent_actions=(SPEECH,),
                      absent_services=("/speechEvent/set_enabled",
                                       "/tabletEvent/prompt_and_get_response"))
    end, names = stops(of_test)
    assert (end, len(names)) == ("SUCCESS", 7) and objections(of_test) == ()


@pytest.mark.slow
@pytest.mark.parametrize("press, number", [("yes", 7), ("done", 0)])
def test_a_press_on_the_tablet_gives_the_tour_if_it_may_count_as_a_yes(press, number):
    """Fault 6: the release stores no answer of the tablet, and so never gives a tour by it."""
    chosen = settings.defaults(robotInterface=ROBOT, scenarioSpecification="release_1_0_tour",
                               asrEnabled=False, tabletSuccessIs=press)
    of_test = facts(on=LoadedMission(chosen), call_times="real")
    assert len(stops(of_test)[1]) == number and objections(of_test) == ()


def test_a_mission_that_fails_while_the_robot_drives_ends_by_itself():
    """Fault 12: after its last question the release's program may stay until it is killed."""
    of_test = of_steps("""<Parallel success_count="2" failure_count="1"><NavigateAsync/>
        <Sequence><Sleep msec="2000"/><AlwaysFailure/></Sequence></Parallel>""")
    assert (of_test.exit_code, of_test.cut_off) == (3, "") and objections(of_test) == ()


@pytest.mark.parametrize("node", ["PerformDeicticGesture", "PerformDeicticGestureAsync"])
def test_a_target_whose_coordinates_add_up_to_zero_is_pointed_at(node):
    """Fault 13: the release takes it for none."""
    of_test = of_steps(f'<{node} target="1.0;-1.5;0.5"/>')
    pointed, = [line.content for line in calls(of_test, "gestureExecution")]
    assert [pointed["location_" + axis] for axis in "xyz"] == [1.0, -1.5, 0.5]
    assert objections(of_test) == ()
