"""The second use case, data/reception.xml: each visitor in virtual time, as judge and story see
them."""
import dataclasses
import re

import pytest

from behavior_controller import folders, leaves
from behavior_controller.bt.engine.builtins import builtin_specs
from behavior_controller.config import phrases
from behavior_controller.run.story import Story
from behavior_controller.robot.requests import Exhibit, GoTo, Location, PerformGesture, Point, Say
from behavior_controller.simulation.rehearsal.play import CALM, LoadedMission
from behavior_controller.simulation.visitor import BEHAVIOURS, Visitor

from unit_tests.judge.verdict import Verdict

from plays import facts, stage

RECEPTION = {"scenarioSpecification": "reception"}
PLACES = [place.name for place in stage(**RECEPTION).world.knowledge.exhibits]


def of_reception(by_voice=True, **test):
    return facts(mission=dict(RECEPTION, asrEnabled=by_voice).items(), **test)


def said(of_test):
    return [each.request.text for each in of_test.run.exchanges if isinstance(each.request, Say)]


def drives(of_test):
    return [each.request.goal for each in of_test.run.exchanges if isinstance(each.request, GoTo)]


@pytest.mark.slow
@pytest.mark.parametrize("by_voice", [True, False])
@pytest.mark.parametrize("behaviour, outcome, asked, walks, is_told_goodbye", [
    ("engages", "SUCCESS", 3, True, True), ("leaves", "FAILURE", 3, True, False),
    ("declines", "SUCCESS", 0, False, False), ("silent", "SUCCESS", 0, False, False),
    ("unclear", "SUCCESS", 0, False, False), ("noGaze", "FAILURE", 0, False, False)])
def test_each_visitor(by_voice, behaviour, outcome, asked, walks, is_told_goodbye):
    of_test = of_reception(by_voice, visitor_behaviour=behaviour)
    visit, = of_test.run.visits
    assert Verdict(of_test).passed and visit.outcome == outcome
    assert [(stop.noun, stop.name) for stop in visit.stops] == [
        ("place", name) for name in PLACES[:asked]]
    known = of_test.world.knowledge
    goals = [known.exhibits[2].location, known.home.location]
    assert drives(of_test) == (goals if walks else [])
    goodbye = phrases.load("English", "reception").speeches["SayGoodByeSpeech"]
    assert (goodbye in said(of_test)) is is_told_goodbye


@pytest.mark.slow
@pytest.mark.parametrize("by_voice", [True, False])
@pytest.mark.parametrize("behaviour, outcome, asked", [
    ("engages", "SUCCESS", 2), ("leaves", "SUCCESS", 2), ("declines", "SUCCESS", 0),
    ("silent", "SUCCESS", 0), ("unclear", "SUCCESS", 0), ("noGaze", "FAILURE", 0)])
def test_each_visitor_of_a_robot_of_release_1_0(by_voice, behaviour, outcome, asked):
    """A drive takes no time here, so a visitor who leaves was seen just before."""
    chosen = {"scenarioSpecification": "release_1_0_reception", "robotInterface": "release-1.0",
              "tabletSuccessIs": "yes", "asrEnabled": by_voice}
    for rate in (0.0, 0.3):
        of_test = facts(mission=chosen.items(), visitor_behaviour=behaviour, failure_rate=rate)
        assert Verdict(of_test).passed, Verdict(of_test).objections
        visit, = of_test.run.visits
        if not rate:
            assert visit.outcome == outcome
            assert [stop.name for stop in visit.stops] == PLACES[:asked]


NOWHERE = Exhibit("nowhere", "?", "", Location(0.0, 0.0, 0.0), Point(0.0, 0.0, 0.0))


@pytest.mark.slow
@pytest.mark.parametrize("wanted, asked, walks", [(0, 1, True), (3, 4, False), (None, 5, False)])
def test_a_visitor_is_shown_the_way_to_any_place_and_led_to_a_near_one(wanted, asked, walks):
    usual = stage(**RECEPTION)
    known = usual.world.knowledge.exhibits
    place = NOWHERE if wanted is None else known[wanted]
    others = [each for each in known if each is not place]
    manners = usual.world.visitor.manners._replace(
        behaviour="engages", places=(*others[:2], place, *others[2:]))
    on = LoadedMission(usual.settings, world=usual.world._replace(visitor=Visitor(manners)))
    of_test = facts(on=on)
    visit, = of_test.run.visits
    assert Verdict(of_test).passed and visit.outcome == "SUCCESS" and len(visit.stops) == asked
    home = usual.world.knowledge.home.location
    assert drives(of_test) == ([place.location, home] if walks else [])
    pointed = [each.request.target for each in of_test.run.exchanges
               if isinstance(each.request, PerformGesture) and each.request.type == "deictic"]
    assert set(pointed) == (set() if wanted is None else {place.gesture})
    assert (place.description2 in said(of_test)) is (wanted is not None)


@pytest.mark.slow
@pytest.mark.parametrize("behaviour", BEHAVIOURS)
@pytest.mark.parametrize("by_voice", [True, False])
def test_with_a_third_of_the_calls_failing_each_verdict_is_passed(behaviour, by_voice):
    for seed in range(1, 6):
        of_test = of_reception(by_voice, visitor_behaviour=behaviour, failure_rate=0.3,
                               random_seed=seed)
        verdict = Verdict(of_test)
        assert verdict.passed, (seed, verdict.objections)


def test_its_story_speaks_of_places_and_of_no_tour():
    played = stage(**RECEPTION).play(dataclasses.replace(CALM, visitor_behaviour="engages"))
    story = Story()
    told = [sentence.text for at, event in played.events for sentence in story.take(at, event)]
    assert any("place 2 of 5, Lecture hall" in text for text in told)
    assert not [text for text in told if re.search("tour|exhibit", text)]


def test_it_is_made_of_the_document_s_nodes_and_built_in_ones():
    mission = stage(**RECEPTION).mission
    types = {node.registration_id for node in mission.tree.nodes}
    own = types - {spec.id for spec in builtin_specs()}
    tour = {node.registration_id for node in stage().mission.tree.nodes}
    assert own <= tour and len(own) >= 25
    assert own <= {spec.id for spec in leaves.mission_specs()}


@pytest.mark.parametrize("language", phrases.languages())
def test_it_has_words_of_its_own_in_each_language(language):
    own, usual = phrases.load(language, "reception"), phrases.load(language)
    assert own.source.file == folders.data("reception_phrases_{}.ini".format(language))
    assert own.meanings == usual.meanings and own.tablet_options == usual.tablet_options
    assert set(own.speeches) == set(usual.speeches)
    assert own.speeches["QueryTourSpeech"] != usual.speeches["QueryTourSpeech"]
