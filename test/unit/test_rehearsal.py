"""The mission without ROS: what it should reach for each kind of visitor, derived by hand from
lab_tour.xml."""
import dataclasses

import pytest

from behavior_controller import folders
from behavior_controller.bt.loader.document import parse, read, with_includes
from behavior_controller.config import knowledge_files, phrases, settings

from behavior_controller.simulation.faults import PlannedFault
from behavior_controller.simulation.world import World, building_file, building_of, load_building
from behavior_controller.simulation.rehearsal.play import (
    CALM, PASS_LIMIT, LoadedMission, leaves_reached)
from behavior_controller.simulation.visitor import Manners, Visitor

KNOWLEDGE = load_building(building_file())
LANGUAGE = phrases.load("English")
TOUR = {"RetrieveListOfExhibits", "SelectExhibit", "Navigate", "FollowMeSpeech"}
GOODBYE = {"EndTourSpeech", "HereIsTheDoorSpeech", "SayGoodByeSpeech", "GoodbyeGesture"}


def play(behaviour, asr=True, mission=folders.mission("lab_tour")):
    yes, no = LANGUAGE.tablet_options
    home = KNOWLEDGE.home.location
    manners = Manners(behaviour,
                      [LANGUAGE.speeches[node] for node in ("QueryTourSpeech", "SayYesNoSpeech")],
                      yes, no, (home.x, home.y))
    return on_stage(mission, {"asrEnabled": asr}, manners, KNOWLEDGE)


def on_stage(mission, chosen, manners, knowledge):
    given = settings.defaults(**chosen)
    world = World(Visitor(manners), knowledge, given)
    stage = LoadedMission(given, with_includes(read(mission)), world)
    test = dataclasses.replace(CALM, visitor_behaviour=manners.behaviour, test_timeout=PASS_LIMIT)
    played = stage.play(test)
    outcomes = [visit.outcome for visit in played.run().visits]
    return outcomes, nodes(leaves_reached(stage, test))


def nodes(paths):
    return paths and {path.split("/")[-1].split("::")[0] for path in paths}


WITH_EACH_VISITOR = pytest.mark.parametrize("behaviour, outcome, tour, goodbye", [
    ("engages", "SUCCESS", True, True), ("declines", "SUCCESS", False, False),
    ("silent", "SUCCESS", False, False), ("unclear", "SUCCESS", False, False),
    ("noGaze", "FAILURE", False, False), ("leaves", "FAILURE", True, False)])


@pytest.mark.slow
@pytest.mark.parametrize("asr", (True, False))
@WITH_EACH_VISITOR
def test_how_the_lab_tour_goes_with_each_visitor(behaviour, outcome, tour, goodbye, asr):
    outcomes, reached = play(behaviour, asr)
    assert outcomes == [outcome]
    assert TOUR <= reached if tour else not TOUR & reached
    assert GOODBYE <= reached if goodbye else not GOODBYE & reached
    assert ("PressYesNoDialogue" in reached) is (not asr and behaviour != "noGaze")


FILES = knowledge_files.load()
QUESTION, PRESS = FILES.phrases[5], FILES.phrases[1]
TELLS, TELLS_YES = {"asrEnabled": True}, {"asrEnabled": False, "tabletSuccessIs": "yes"}


@pytest.mark.slow
@pytest.mark.parametrize("chosen", (TELLS, TELLS_YES))
@WITH_EACH_VISITOR
def test_how_the_tour_of_release_1_0_goes_with_each_visitor(behaviour, outcome, tour, goodbye,
                                                            chosen):
    outcomes, reached = play_release(behaviour, **chosen)
    assert outcomes == [outcome]
    assert ({"SelectExhibit", "Navigate", "DescribeExhibitSpeech"} & reached != set()) is tour
    assert ("goodbye" in reached) is goodbye


def test_no_press_on_a_tablet_that_does_not_tell_brings_a_tour():
    outcomes, reached = play_release("engages", asrEnabled=False)
    assert outcomes == ["SUCCESS"] and "PressYesNoDialogue" in reached
    assert "SelectExhibit" not in reached


def play_release(behaviour, **chosen):
    manners = Manners(behaviour, [QUESTION, PRESS], *LANGUAGE.tablet_options, None)
    return on_stage(folders.mission("release_1_0_tour"), dict(chosen, robotInterface="release-1.0"),
                    manners, building_of(FILES))


@pytest.mark.slow
def test_a_mission_that_never_ends_is_not_rehearsed(monkeypatch):
    monkeypatch.setattr("behavior_controller.simulation.rehearsal.play.PASS_LIMIT", 300.0)
    stage = LoadedMission(settings.defaults(), [parse(
        '<root BTCPP_format="4"><BehaviorTree ID="M"><ReactiveFallback><AlwaysFailure/>'
        '<Sleep msec="99999999"/></ReactiveFallback></BehaviorTree></root>')])
    assert leaves_reached(stage, CALM) is None


def test_the_leaves_of_a_pass_without_faults_are_those_of_the_robot_of_the_test():
    """Speech comes by an action that never handles a goal: no answer of the visitor is heard."""
    stage = LoadedMission(settings.defaults(robotInterface="release-1.0",
                                            scenarioSpecification="release_1_0_tour"))
    heard, unheard = (dataclasses.replace(CALM, recognise_by=way)
                      for way in ("topic", "idleAction"))
    faulty = dataclasses.replace(
        unheard, failure_rate=1.0, planned_faults=(PlannedFault("textToSpeech", 1, "crash"),),
        mission_runs=3, random_seed=5, arrival_rate=60.0, call_times="real", test_timeout=8.0)
    reached = {name: leaves_reached(stage, test)
               for name, test in (("heard", heard), ("unheard", unheard), ("faulty", faulty))}
    assert len(reached["unheard"]) < len(reached["heard"])
    assert reached["faulty"] == reached["unheard"]


def situations(steps, seconds, call_times, node):
    """Return what the calls of a node met in the first seconds of a mission of these steps."""
    stage = LoadedMission(settings.defaults(), [parse(
        '<root BTCPP_format="4"><BehaviorTree ID="M"><Sequence><START_OF_TREE/>' + steps +
        '</Sequence></BehaviorTree></root>')])
    met = stage.play(dataclasses.replace(CALM, test_timeout=seconds, call_times=call_times),
                     has_situations=True).situations
    return [met[call] for call in sorted(met) if call[0] == node]


FOR_EVER = "<KeepRunningUntilFailure><Sequence>{}</Sequence></KeepRunningUntilFailure>"
GREETS = '<WelcomeSpeech/><Sleep msec="900"/>'


@pytest.mark.parametrize("steps, is_one", [
    (FOR_EVER.format(GREETS), True),
    # they differ in the number of rounds, the value of an entry, the time that is left
    ('<Repeat num_cycles="9"><Sequence>' + GREETS + "</Sequence></Repeat>", False),
    ('<Script code="n := 0"/>' + FOR_EVER.format('<Script code="n += 1"/>' + GREETS), False),
    ('<Timeout msec="60000">' + FOR_EVER.format(GREETS) + "</Timeout>", False)])
def test_calls_meet_one_situation_unless_the_mission_may_go_on_otherwise(steps, is_one):
    """From the second call on the visitor is there."""
    met = situations(steps, 4.0, "none", "textToSpeech")[1:]
    assert len(met) == 4 and len(set(met)) == (1 if is_one else 4)


@pytest.mark.parametrize("faulty, told", [(None, [1, 2, 3]), (1, [2, 3]), (2, [3]), (3, [])])
def test_the_situations_after_the_first_fault_are_told_or_all_without_a_fault(faulty, told):
    stage = LoadedMission(settings.defaults(), [parse(
        '<root BTCPP_format="4"><BehaviorTree ID="M"><Sequence>' +
        3 * '<ForceSuccess><WelcomeSpeech/></ForceSuccess>' + '</Sequence></BehaviorTree></root>')])
    planned = (PlannedFault("textToSpeech", faulty, "refused"),) if faulty else ()
    met = stage.play(dataclasses.replace(CALM, planned_faults=planned),
                     has_situations=True).situations
    assert sorted(number for node, number in met if node == "textToSpeech") == told


@pytest.mark.parametrize("pause, is_one", [(100, False), (1000, True)])
def test_moments_are_no_part_of_a_situation_and_the_time_until_an_answer_is(pause, is_one):
    """A visitor answers 0.3 s after a question that takes time, and else at once."""
    steps = f'<QueryTourSpeech/><Sleep msec="{pause}"/><SocialOvertAttentionMode/>'
    at_once, later = (situations(steps, 60.0, call_times, "overtAttention")[0]
                      for call_times in ("none", "real"))
    assert (at_once == later) is is_one
