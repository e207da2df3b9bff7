"""The diagnostics of a run: the level of each component, by what its events mean."""
import pytest
from msgspec.structs import replace

from behavior_controller.run.events import (
    BEGUN, OMITTED, SKIPPED, HealthChanged, LeafFinished, PassStarted, Paused, Recovered,
    Recovering, Retried, RunFinished, RunStarted, Sources, StepStarted, StopChanged)
from behavior_controller.run.fold import fold
from behavior_controller.run.health import FAILING, GONE, SILENT, SIMULATED_TIME, SLOW
from behavior_controller.run.state import State
from behavior_controller.run.diagnostics import ERROR, OK, WARN, statuses
from behavior_controller.robot.d543 import FACES, INTERFACE
from behavior_controller.robot.gateway import Cause, Failure
from behavior_controller.robot.requests import GoTo, Say

DRIVE, SAY = INTERFACE.service(GoTo), INTERFACE.service(Say)
OFFERS = (DRIVE, SAY, FACES)
BUSY = Failure(Cause.REFUSED, "busy", DRIVE.name)
STARTED = RunStarted("/m/tour.xml", [("go", "Navigate")], {},
                     Sources((), ("", ""), ("", ""), "D5.4.3"))
DRIVES = StepStarted(2, "Navigate", "go", "driving", "home", 180.0, False)
FAILED = LeafFinished(2, "Navigate", "go", "FAILURE", DRIVE.name, 1.0, BUSY)
RETRIED = Recovering(3, "Navigate", "go", BUSY, 1, 2)
GIVEN_UP = Recovered("Navigate", "go", BUSY, "retry", 2, False, "given up", uid=3)


def after(*events, is_simulated=False):
    """Return the level of each component, and the whole, after those events."""
    state = State()
    for number, event in enumerate((STARTED, PassStarted(1, 0.0)) + events):
        state = fold(state, 100.0 + number, event)
    found = statuses(state, INTERFACE, OFFERS, is_simulated)
    return {each.name: each.level for each in found}, {each.name: each for each in found}


def ill(offer, respect, is_well=False):
    return HealthChanged(offer.kind, offer.name, offer.node, is_well, "ill", "so", respect)


def test_a_run_without_troubles_is_ok_and_each_node_has_its_status():
    levels, found = after(DRIVES)
    assert levels == dict.fromkeys(("mission", "recovery", "master", "/robotNavigation",
                                    "/textToSpeech", "/faceDetection"), OK)
    assert "driving" in found["mission"].message
    assert found["mission"].values["mission"] == "tour"
    assert DRIVE.name in found["/robotNavigation"].values


@pytest.mark.parametrize("offer, respect, level", [
    (DRIVE, GONE, ERROR), (DRIVE, FAILING, ERROR), (DRIVE, SLOW, WARN), (FACES, SILENT, ERROR)])
def test_a_node_is_as_ill_as_what_it_offers_until_that_is_well(offer, respect, level):
    name = "/" + offer.node
    levels, found = after(ill(offer, respect))
    assert levels[name] == level and offer.name in found[name].message
    assert sum(levels.values()) == level  # no other
    assert after(ill(offer, respect), ill(offer, respect, True))[0][name] == OK


def test_a_master_that_does_not_answer_is_an_error():
    gone = HealthChanged("master", "http://m:11311", "", False, "does not answer", "so", GONE)
    assert after(gone)[0]["master"] == ERROR


def test_a_simulated_time_that_stands_still_is_a_warning():
    assert "/clock" not in after()[0]
    still = HealthChanged(SIMULATED_TIME, "/sim/clock", "", False, "stands still since 12:00:00",
                          "so", SILENT)
    goes_on = replace(still, is_well=True, status="goes on")
    levels, found = after(still, is_simulated=True)
    assert levels["/clock"] == WARN and sum(levels.values()) == WARN
    assert "stands still since 12:00:00" in found["/clock"].message
    levels, found = after(still, goes_on, is_simulated=True)
    assert (levels["/clock"], found["/clock"].message) == (OK, "goes on")


def test_a_recovery_is_a_warning_and_what_is_given_up_an_error():
    levels, found = after(DRIVES, FAILED, RETRIED)
    assert (levels["recovery"], levels["mission"]) == (WARN, WARN)
    assert found["recovery"].values["node"] == "Navigate"
    levels, found = after(DRIVES, FAILED, RETRIED, GIVEN_UP)
    assert levels["recovery"] == ERROR and "3 times" in found["recovery"].message
    helped = replace(GIVEN_UP, success=True, outcome="done")
    assert after(DRIVES, FAILED, RETRIED, helped)[0]["recovery"] == OK
    assert after(DRIVES, FAILED, RETRIED, GIVEN_UP, PassStarted(2, 9.0))[0]["recovery"] == OK


def test_a_recovery_says_what_it_does_and_then_that_it_is_not_over():
    message = after(DRIVES, FAILED, RETRIED)[1]["recovery"].message
    assert message == "trying Navigate again, attempt 2 of 3"
    # the retry is a step of its own; when it has failed there is none
    for event in (DRIVES, Retried("Navigate", "go", 1, BUSY)):
        found = after(DRIVES, FAILED, RETRIED, event)[1]["recovery"]
        assert (found.level, found.message) == (WARN, "recovering from a failure")


def test_a_stop_that_was_left_out_is_nothing_to_recover_from():
    begun = StopChanged(1, "SelectExhibit", "select", 1, 2, "robot arm", BEGUN)
    left_out = replace(GIVEN_UP, outcome=SKIPPED, success=True, uid=9)
    course = (begun, DRIVES, FAILED, RETRIED, GIVEN_UP)
    assert after(*course)[0]["recovery"] == ERROR
    levels, found = after(*course, replace(begun, state=OMITTED), left_out)
    assert (levels["recovery"], found["recovery"].message) == (OK, "nothing to recover from")


@pytest.mark.parametrize("event, level", [
    (Paused(BUSY, "/robotNavigation"), WARN), (RunFinished("stopped", 0), OK),
    (RunFinished("stopped", 3), ERROR)])
def test_the_mission_is_as_well_as_its_pause_or_its_end(event, level):
    assert after(event)[0]["mission"] == level
