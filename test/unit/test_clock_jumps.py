"""The computer's clock is set while the node runs, as by NTP: nothing is decided by it, and what is
shown has the new time of day."""
import json
import logging
import re
import time

import pytest

from behavior_controller.bt.engine.clock import ManualClock
from behavior_controller.run import events
from behavior_controller.run.events import (
    Answered, Asked, HealthChanged, Noticed, PassStarted, StepStarted)
from behavior_controller.run.health import GONE
from behavior_controller.run.record.recorder import Record
from behavior_controller.robot.gateway import Cause, Failure
from behavior_controller.robot.requests import GoTo, Location
from behavior_controller.ros import console as console_module
from behavior_controller.ros.console import ROSOUT_LOGGER
from mission_rig import FileRecord, Rig, visitor_who, written
from page_rig import is_second_text, open_page, text, wait_until

HOUR, YEARS = 3600, 20 * 365 * 86400
JUMPS = [-HOUR, HOUR, -YEARS, YEARS]
NAV = "/robotNavigation/set_goal"
GONE_NAV = HealthChanged("service", NAV, "robotNavigation", False, "gone", "", GONE)


@pytest.fixture
def jump(monkeypatch):
    """Return what sets the computer's clock forward by so many seconds."""
    real, shift = time.time, [0]
    monkeypatch.setattr(time, "time", lambda: real() + shift[0])

    def by(seconds):
        shift[0] += seconds
    return by


@pytest.fixture
def robot_lines(console, monkeypatch):
    """A console, and the robot's lines that it has written."""
    monkeypatch.setattr(console_module, "ROBOT_SPAN", 0.0)
    told, handler, logger = [], logging.Handler(), logging.getLogger(ROSOUT_LOGGER)
    handler.emit = lambda record: told.append(record.getMessage())
    monkeypatch.setattr(logger, "level", logging.INFO)
    logger.addHandler(handler)

    def lines():
        console.drain(5)
        return [line for line in told if ": robot: " in line]
    yield console, lines
    logger.removeHandler(handler)


@pytest.mark.parametrize("by", JUMPS)
@pytest.mark.parametrize("moment", range(6))
def test_what_a_person_has_to_do_is_said_whenever_the_clock_jumps(robot_lines, jump, by, moment):
    console, lines = robot_lines
    happens = [
        HealthChanged("topic", "/faceDetection/data", "faceDetection", False, "gone", "", GONE),
        PassStarted(1, 0.0), StepStarted(1, "Navigate", "a", "driving", "to Arm", 9.0, False),
        Asked(1, NAV, GoTo(Location(1.0, 2.0, 0.0))),
        Answered(1, Failure(Cause.CONNECTION_LOST, "", NAV)), GONE_NAV]
    for number, event in enumerate(happens):
        if number == moment:
            jump(by)
        console(event)
        console.drain(5)
    assert lines()[-1].endswith("Restart /faceDetection and /robotNavigation; take the robot home")


@pytest.mark.parametrize("by, words", [
    (-HOUR, "jumped back by 1:00:00"), (1, "jumped forward by 0:00:01"),
    (90061, "jumped forward by 1 day, 1:01:01")])
def test_a_jump_is_told_once(robot_lines, jump, by, words):
    clock, told = ManualClock(), []
    robot_lines[0].start_heartbeat(clock, told.append, Record())
    clock.advance(10.0)
    assert not told
    jump(by)
    clock.advance(20.0)
    notice, = told
    assert isinstance(notice, Noticed) and words in notice.text
    jump(-by)
    clock.advance(10.0)
    assert len(told) == 2


@pytest.mark.slow
@pytest.mark.parametrize("by", JUMPS)
@pytest.mark.parametrize("moment", ["before", "in a drive", "between visits"])
def test_the_page_shows_now_and_the_past_in_order(show, jump, by, moment):  # noqa: F811
    shown = show(Rig())
    if moment == "before":
        jump(by)
    if moment == "in a drive":
        shown.run_until(lambda request: isinstance(request, GoTo))
    else:
        shown.rig.run(visitor_who("yes"))
    if moment != "before":
        jump(by)
    if moment == "between visits":
        shown.run_until(is_second_text)
    state = json.loads(shown.fetch("state")[1])
    now, at = state["now"], state["alive"]["at"]
    assert now["card"]["what"] != "nothing runs"
    for asked in ("now", "{:.6f}".format(at)):
        status, then, _ = shown.fetch("at/" + asked)
        assert status == 200 and json.loads(then)["now"] == now
    assert shown.fetch("at/then")[0] == 404
    assert state["alive"]["kept"] <= at and state["alive"]["clock_shift"] == by
    card = shown.page.board.part("now")["card"]
    assert card["since"] is None or 0.0 <= at - card["since"] < 60.0
    times = [each["at"] for each in state["story"]["sentences"]]
    assert times == sorted(times) and at - times[0] < 60.0
    assert all(0.0 <= each["seconds"] < 60.0 for each in state["timeline"])


@pytest.mark.parametrize("by", JUMPS)
def test_the_times_of_a_record_do_not_jump(tmp_path, jump, by):
    record = FileRecord(str(tmp_path), pytest.fail).open()
    for number in range(4):
        record(Noticed("info", str(number)))
        jump(by if number % 2 else -by)
    with open(written(record), encoding="utf-8") as file:
        times = [json.loads(line)["time"] for line in file]
    assert times == sorted(times) and times[-1] - times[0] < 60.0


def test_the_time_of_day_is_that_of_the_clock_as_it_is_set(jump):
    before = events.unix_now()
    jump(HOUR)
    assert events.clock_shift() == HOUR
    assert events.unix_now() - before < 60.0
    jump(-3 * HOUR)
    assert events.clock_shift() == -2 * HOUR


@pytest.mark.slow
def test_the_page_counts_by_itself_whatever_the_clocks_are(show, browser, jump):  # noqa: F811
    shown = show(Rig())
    shown.run_until(is_second_text)
    jump(2 * HOUR)
    open_page(browser, shown)
    wait_until(lambda: text(browser, "#moment") == time.strftime(
        "%H:%M:%S", time.localtime(time.time())))
    browser.execute_script("Date.now = () => 0")  # the browser's clock is set, too
    wait_until(lambda: re.match("[3-9] s of at most", text(browser, "#elapsed")))
    assert text(browser, "#connection") == "live"
