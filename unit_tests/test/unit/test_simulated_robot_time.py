"""Tests of a test in simulated time: the clock of the simulated nodes, and the judge's times."""
import dataclasses
import threading
from unittest import mock

import genpy
import pytest
import rospy
from msgspec.structs import replace
from rosgraph_msgs.msg import Clock

from behavior_controller.bt import ManualClock
from behavior_controller.run.events import Asked, Line, Noticed
from behavior_controller.run.history import Run
from behavior_controller.simulation.journal import JournalEntry
from behavior_controller.simulation.rehearsal.play import START

from unit_tests.judge.facts import by_record, speeds
from unit_tests.judge.verdict import Verdict
from unit_tests.robot import options
from unit_tests.robot.ros_time import RosTime
from unit_tests.run.test_node import too_fast

from plays import UNIX, calls, changed, facts, from_then_on, of_mission

LONG = "<WelcomeSpeech/><Sleep msec='6000'/><WelcomeSpeech/><Sleep msec='60000'/>"


# ---------------------------------------------------------------------------------- the nodes' time


@pytest.fixture
def clock():
    """Return a node's time, and what a message of /clock does."""
    with mock.patch.object(rospy, "Subscriber"):
        time = RosTime()
    return time, lambda seconds: time._hear(Clock(genpy.Time.from_sec(seconds)))


def test_a_wait_ends_with_the_message_of_its_time_and_goes_on_over_a_jump_back(clock):
    time, hear = clock
    hear(1000.0)
    ended = threading.Event()
    waits = threading.Thread(target=lambda: (time.wait(5.0), ended.set()))
    waits.start()
    for moment in (1004.0, 10.0, 10.5):  # 4.5 s in all
        hear(moment)
    assert not ended.wait(0.2) and (time.now(), time.jumped) == (1004.5, 994.0)
    hear(11.0)
    assert ended.wait(5.0)
    waits.join()


def test_a_wait_without_an_end_ends_with_the_node(clock):
    time, hear = clock
    hear(1000.0)
    threading.Timer(0.1, time.end).start()
    assert time.wait(float("inf")) is True


# -------------------------------------------------------------------------------- the judge's times


def lines(*moments):
    return [Line(time, Noticed("info", "so"), ros, computer) for time, ros, computer in moments]


def test_the_speed_is_that_of_the_fastest_second_and_that_on_average():
    # 30 s in 10 s; 20 of them in one
    assert speeds(lines((0.0, 1.0, 50.0), (5.0, 6.0, 55.0), (25.0, 26.0, 56.0),
                        (30.0, 31.0, 60.0))) == (3.0, 20.0)
    assert speeds(lines((0.0, None, None), (9.0, None, None))) == (1.0, 1.0)


@pytest.mark.parametrize("speed, told", [
    (20.0, ["speed 20 was asked for, and 13.4 was reached: this machine does not go faster"]),
    (14.0, []), (1.0, [])])
def test_a_speed_that_was_not_reached_is_told(given, speed, told):
    given()
    own = dataclasses.replace(options.read(options.of_process()), speed=speed)
    run = Run(lines((0.0, 1.0, 50.0), (26.8, 27.8, 52.0)))
    assert too_fast(own, run) == told
    assert too_fast(own, Run(lines((0.0, 1.0, 50.0), (0.1, 1.1, 50.5)))) == []  # too short


def test_the_journal_gets_the_times_of_the_record():
    entries = [JournalEntry(1010.0, "faceDetection", "/f", 0, {}, jumped=0.0),
               JournalEntry(1020.0, "textToSpeech", "/t", 1, {}, jumped=700.0)]
    # when the first call came, 700 s more had been on /clock than now are
    assert [entry.time for entry in by_record(entries, lines((5000.0, 315.0, 1.0)))] == [
        4995.0, 5005.0]
    assert by_record(entries, lines((5000.0, None, None))) == entries


@pytest.mark.parametrize("seconds, speed, is_late", [
    (0.5, 1.0, False), (5.0, 1.0, True), (5.0, 10.0, False), (15.0, 10.0, True), (5.0, 0.1, True)])
def test_what_a_process_takes_is_allowed_for_times_the_speed(seconds, speed, is_late):
    sound = of_mission("<WelcomeSpeech/><Sleep msec='3000'/><WelcomeSpeech/>")
    assert Verdict(sound).passed
    later = changed(sound, from_then_on(UNIX + START + 2.0, seconds))._replace(
        speed=speed, journal=[line._replace(time=line.time + (line.time > UNIX + START + 2.0)
                                            * seconds) for line in sound.journal])
    assert ("was due" in str(Verdict(later))) is is_late


def test_a_request_whose_deadline_is_no_time_for_a_process_may_reach_no_node():
    sound = of_mission("<ForceSuccess><EnableAnimateBehavior/></ForceSuccess>",
                       ["animateBehavior:1:unanswered"])
    assert Verdict(sound).passed
    unheard = sound._replace(journal=[
        line for line in sound.journal if line.node != "animateBehavior" or line.call > 1])
    deadline = sound.world.settings.deadlines["animateBehaviorDeadline"]
    told = "/animateBehaviour/set_activation never got the request"
    assert told in str(Verdict(unheard))
    assert told in str(Verdict(unheard._replace(speed=deadline)))  # 1 s, less than is allowed for
    assert Verdict(unheard._replace(speed=2.0 * deadline)).objections == ()


@pytest.mark.slow
@pytest.mark.parametrize("speed, is_early", [(1.0, True), (0.4, False)])
def test_the_pause_before_a_part_of_the_safe_state_is_the_computers(speed, is_early):
    last = calls(facts(), "overtAttention")[-1].call
    of_test = facts([f"overtAttention:{last}"])
    *_, again = [line.event for line in of_test.run.lines if isinstance(line.event, Asked)]

    def sooner(line):  # 0.04 s after the failure, and not 0.1 s
        return [replace(line, time=line.time - 0.06 * (line.event is again))]

    told = "asked for again: switching attention off"
    assert (told in str(Verdict(changed(of_test, sooner)._replace(speed=speed)))) is is_early


# -------------------------------------------------------------------------------------- a jump back


def with_jump(steps, seconds=12.0):
    """Return the facts of a mission during which /clock jumps back."""
    jumps = iter([seconds])

    def take(clock):
        return next(jumps, 0.0) if clock.now() >= START + 5.0 else 0.0

    with mock.patch.object(ManualClock, "take_jump", take):
        played = of_mission(steps, mission_runs=2)
    jumped = {line.time: seconds * (line.time > UNIX + START + 6.0) for line in played.journal}
    return played._replace(journal=[line._replace(jumped=jumped[line.time])
                                    for line in played.journal])


def test_a_pass_that_a_jump_back_ends_is_as_it_has_to_be():
    jumped = with_jump(LONG)
    verdict = Verdict(jumped)
    assert verdict.passed, str(verdict)
    assert [visit.outcome for visit in jumped.run.visits] == ["FAILURE", "SUCCESS"]
    assert ("pass 1 ended early, as it had to: simulated time jumped back by 12 s: this visit is "
            "over") in verdict.praise


def test_a_jump_back_that_the_simulated_nodes_have_not_seen_is_an_objection():
    jumped = with_jump(LONG)
    unseen = jumped._replace(journal=[line._replace(jumped=0.0) for line in jumped.journal])
    assert Verdict(unseen).objections == (
        "the simulated time jumped back by 0.0 s in all; on record are 12.0 s",)


def test_a_pass_that_ends_without_the_jump_back_is_an_objection():
    def without(line):
        is_jump = isinstance(line.event, Noticed) and line.event.jumped_back
        return [replace(line, event=Noticed("info", "so"))] if is_jump else [line]

    assert Verdict(changed(with_jump(LONG), without)).objections == (
        "pass 1, 6.0 s: the pass took 0.0 s; on record are 6.0 s",)


@pytest.mark.parametrize("after, is_ignored", [(2.0, True), (8.5, False)])
def test_a_pass_that_goes_on_after_a_jump_back_is_an_objection(after, is_ignored):
    # the last traversal comes 9 s after the beginning
    def jumped(line):
        return [replace(line, ros=line.time - 4000.0 - 12.0 * (line.time > UNIX + START + after))]

    played = of_mission("<WelcomeSpeech/><Sleep msec='3000'/><Sleep msec='6000'/>")
    told = "the pass went on after the simulated time had jumped back"
    assert (told in str(Verdict(changed(played, jumped)))) is is_ignored
