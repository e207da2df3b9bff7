"""Tests of what an arrival rate means for a mission, against Poisson's formula worked out by hand.
"""
import math

import pytest

from behavior_controller.config import settings
from behavior_controller.missions import load as missions
from behavior_controller.simulation.rehearsal import arrival_waits
from behavior_controller.simulation.rehearsal.arrival_waits import Wait
from behavior_controller.simulation.visitor import ENGAGES, NO_GAZE, SILENT
from behavior_controller.simulation.world import world

GAZE = Wait("IsMutualGazeDiscovered", 2, 15.0)
SPEECH = Wait("IsYesNoUttered", 1, 10.0)
FACE = Wait("IsVisitorDiscovered", 1, 2.0, (GAZE,))


def waits(behaviour=ENGAGES, **chosen):
    """Return the waits of a mission for a visitor of that behaviour."""
    return arrival_waits.of_mission(world(behaviour, settings.defaults(**chosen)))


def of(mission, tmp_path, monkeypatch, **chosen):
    """Return the waits of a mission with these nodes."""
    (tmp_path / "small.xml").write_text(
        '<root BTCPP_format="4"><BehaviorTree ID="Small">{}</BehaviorTree></root>'.format(mission))
    monkeypatch.setattr(missions, "find", lambda name: str(tmp_path / "{}.xml".format(name)))
    return waits(scenarioSpecification="small", **chosen)


def test_the_chance_of_two_messages():
    # 1 a minute: 0.25 are expected in 15 s; 1 - e^-0.25 (1 + 0.25) = 1 - 0.7788 * 1.25
    assert GAZE.chance(1) == pytest.approx(0.0265, abs=1e-4)
    # 60 a minute: 1 - e^-15 (1 + 15)
    assert GAZE.chance(60) == pytest.approx(1 - 16 * math.exp(-15))
    assert GAZE.chance(math.inf) == 1.0


def test_the_chance_of_one_message():
    # 6 a minute: 1 is expected in 10 s; 1 - e^-1
    assert SPEECH.chance(6) == pytest.approx(0.63212, abs=1e-5)
    assert SPEECH.warning(6).endswith(" in about 63 % of waits")
    assert SPEECH.warning(0.1).endswith(" in about 2 % of waits")  # 1 - e^(-1/60)


def test_the_chance_of_three_messages():
    # 12 a minute: 3 are expected in 15 s; 1 - e^-3 (1 + 3 + 3^2 / 2)
    assert GAZE._replace(messages=3).chance(12) == pytest.approx(0.57681, abs=1e-5)


def test_where_one_message_a_minute_is_enough_no_lower_rate_is_told():
    assert arrival_waits.lowest_rate([SPEECH._replace(seconds=180.0)]) == 1  # m = 3, see below


def test_a_condition_after_another_is_weighted_with_the_failures_of_that_one():
    # 60 a minute: 2 are expected in 2 s, so that e^-2 = 13.5 % are missed; but FACE is asked only
    # if the gaze is missed
    assert 1 - FACE.chance(60) == pytest.approx(0.1353, abs=1e-4)
    assert FACE.missed(60) == pytest.approx(0.1353 * 16 * math.exp(-15), rel=1e-3)
    assert FACE._replace(after=()).missed(60) == pytest.approx(0.1353, abs=1e-4)


def test_each_condition_has_one_line_and_the_rate_that_is_enough_is_told():
    worse = SPEECH._replace(seconds=5.0)
    assert arrival_waits.warnings([GAZE, SPEECH, worse, SPEECH], 1) == [
        "arrivalRate 1: IsMutualGazeDiscovered needs 2 messages within 15 s, which happens in "
        "about 3 % of waits",
        # 1 - e^(-1/12)
        "arrivalRate 1: IsYesNoUttered needs 1 message within 5 s, which happens in about 8 % of "
        "waits",
        # 1 - e^-m >= 0.95 from m = ln 20 = 2.9957 on, in 5 s: 35.9 a minute
        "from arrivalRate 36 on, all that this mission waits for comes in time in 95 % of waits"]
    assert arrival_waits.warnings([GAZE, SPEECH, worse], 36) == []
    assert arrival_waits.warnings([GAZE], math.inf) == [] and arrival_waits.warnings([], 1) == []


def test_a_chance_that_is_next_to_none_is_no_zero():
    assert GAZE._replace(seconds=1.0).warning(1).endswith("which happens in less than 1 % of waits")


def test_the_lowest_rate_of_the_lab_tour():
    found = waits()
    # the tour's Sleeps, and topicMaxAge for what is asked at once
    prompted = SPEECH._replace(after=(SPEECH,))
    assert set(found) == {GAZE, SPEECH, prompted, FACE}
    # 1 - e^-m (1 + m) >= 0.95 from m = 4.744 on, in 15 s: 18.98 a minute
    assert arrival_waits.lowest_rate(found) == 19


@pytest.mark.parametrize("behaviour, nodes", [
    (NO_GAZE, {"IsYesNoUttered", "IsVisitorDiscovered"}),
    (SILENT, {"IsMutualGazeDiscovered", "IsVisitorDiscovered"})])
def test_what_a_visitor_never_gives_is_no_matter_of_the_rate(behaviour, nodes):
    assert {wait.node for wait in waits(behaviour)} == nodes


@pytest.mark.parametrize(
    "mission, seconds",
    (
        ("<ReactiveFallback>{}<Sleep msec='4000'/></ReactiveFallback>", 4.0),
        ("<ReactiveFallback>{}<Sequence><Sleep msec='4000'/><Sleep msec='3000'/></Sequence></"
         "ReactiveFallback>",
         7.0),
        # topicMaxAge
        ("<ReactiveFallback>{}<ForceFailure><Sleep msec='500'/></ForceFailure></ReactiveFallback>",
         2.0),
        ("<Timeout msec='3000'><ReactiveFallback>{}<Sleep msec='4000'/></ReactiveFallback></"
         "Timeout>",
         3.0),
        ("<Sequence>{}</Sequence>", 2.0),
        ("<RetryUntilSuccessful num_attempts='6'><Delay delay_msec='1500'>{}</Delay></"
         "RetryUntilSuccessful>",
         9.0)))
def test_how_long_a_mission_waits(tmp_path, monkeypatch, mission, seconds):
    wait, = of(mission.format("<IsVisitorDiscovered/>"), tmp_path, monkeypatch)
    assert (wait.seconds, wait.messages) == (seconds, 1)


@pytest.mark.parametrize(
    "mission",
    (
        "<ReactiveFallback><IsVisitorDiscovered/><KeepRunningUntilFailure><Sleep msec='500'/></"
        "KeepRunningUntilFailure>"
        "</ReactiveFallback>",
        "<Sequence><Script code='ms := 500'/><ReactiveFallback><IsVisitorDiscovered/><Sleep "
        "msec='{ms}'/></ReactiveFallback>"
        "</Sequence>",
        # words before the question are old, and nothing waits for words after it
        "<Sequence><IsYesNoUttered/></Sequence>"))
def test_a_wait_without_a_known_bound_is_left_out(tmp_path, monkeypatch, mission):
    assert of(mission, tmp_path, monkeypatch) == []


@pytest.mark.parametrize("seconds", (12.0, 0.5))
def test_condition_wait_is_a_bound(tmp_path, monkeypatch, seconds):
    wait, = of("<IsYesNoUttered/>", tmp_path, monkeypatch, conditionWait=seconds)
    assert wait.seconds == seconds


def test_a_mission_that_cannot_be_loaded_has_none():
    assert waits(scenarioSpecification="no_such_mission") == []
