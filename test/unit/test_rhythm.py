"""A decision for want of fresh messages is told as such, whenever the topic itself is told as
silent; and when that is."""
import random

import pytest

from behavior_controller.run.events import HealthChanged, Line, PassFinished
from behavior_controller.run.health import GONE, SILENT
from behavior_controller.run.history import Run
from behavior_controller.run.story import how_it_ended
from behavior_controller.robot.d543 import ATTENTION, FACES
from behavior_controller.robot.requests import AttentionStatus, Faces
from behavior_controller.robot.rhythm import Rhythm
from mission_rig import Rig

FACE, NO_FACE = Faces(("7",), (True,)), Faces((), ())
GAZE, NO_GAZE = AttentionStatus("seeking", 1), AttentionStatus("seeking", 0)
# asked 3 s after the visitor was seen; the visit ends a second after that
LOOKS = """<Sequence><IsVisitorDiscovered/><SeekOvertAttentionMode/><Sleep msec="3000"/><Fallback>
<{}/><ForceFailure><Sleep msec="1000"/></ForceFailure></Fallback></Sequence>"""
WAITS = """<Sequence><IsVisitorDiscovered/><Sleep msec="500"/><Timeout msec="{}"><ReactiveFallback>
<IsVisitorDiscovered/><ForceFailure><Sleep msec="3000"/></ForceFailure></ReactiveFallback></Timeout>
</Sequence>"""
LEFT, BLIND = "the visitor left", "the visitor could not be seen: /faceDetection/data is "
OLD, NONE = "silent (the newest message is too old)", "silent (no message has come)"


def change(respect, is_well=False, name="/faceDetection/data"):
    return HealthChanged("topic", name, "faceDetection", is_well, "so", "", respect)


def ending(mission, *happens):
    """Return how the visit ended of a visitor who is seen at its begin; ``happens`` are a
    topic's messages and what is told of it, each at its time since then."""
    rig = Rig(mission)
    run, left = Run(), list(happens)
    rig.mission.events.subscribe(lambda event: run.take(Line(rig.clock.now(), event)))
    rig.topics.publish(FACES, FACE)

    def act(rig):
        at, what = left[0] if left else (float("inf"), None)
        due = min(1000.0 + at, rig.clock.next_due() or float("inf"))
        rig.clock.advance(due - rig.clock.now())
        if due < 1000.0 + at:
            return
        left.pop(0)
        if isinstance(what, HealthChanged):
            rig.mission.health.report(what.respect, what)
        else:
            rig.topics.publish(FACES if isinstance(what, Faces) else ATTENTION, what)

    rig.run(act)
    assert rig.of(PassFinished)[0].outcome == "FAILURE" and not left
    return how_it_ended(run.state.visit)


@pytest.mark.slow
@pytest.mark.parametrize("happens, words", [
    # the newest message showed a face and is 2.01 s old
    ([(0.99, FACE)], BLIND + OLD), ([(0.99, NO_FACE)], BLIND + OLD),
    ([(0.99, FACE), (2.5, change(SILENT))], BLIND + "silent"),
    ([(0.99, FACE), (3.2, change(SILENT))], BLIND + "silent"),
    ([(0.99, FACE), (3.2, change(SILENT)), (3.4, change(SILENT, True))], BLIND + "silent"),
    ([(0.99, FACE), (3.4, NO_FACE)], BLIND + OLD),
    ([(0.5, FACE), (1.8, change(SILENT)), (2.0, change(SILENT, True))], BLIND + OLD),
    # the publisher died; it returned, and has sent nothing since
    ([(0.99, FACE), (1.9, change(GONE))], BLIND + "gone"),
    ([(0.99, FACE), (3.1, change(GONE))], BLIND + "gone"),
    ([(0.5, FACE), (1.4, change(GONE)), (2.8, change(GONE, True))], BLIND + OLD),
    ([(0.5, FACE), (1.4, change(GONE)), (3.3, change(GONE, True))], BLIND + "gone"),
    # the topic has another name here
    ([(0.99, FACE), (2.5, change(SILENT, name="/robot2/faces"))], BLIND + OLD),
    # a fresh message without a face
    ([(2.9, NO_FACE)], LEFT), ([(2.9, NO_FACE), (3.5, change(SILENT))], LEFT),
    ([(0.5, FACE), (1.8, change(SILENT)), (2.9, NO_FACE), (2.95, change(SILENT, True))], LEFT),
    ([(0.5, FACE), (1.8, change(SILENT)), (2.9, NO_FACE), (3.1, change(SILENT, True))], LEFT),
    ([(0.5, FACE), (1.4, change(GONE)), (2.9, NO_FACE), (2.95, change(GONE, True))], LEFT),
    # a message that counts, of a topic that may have fallen silent since
    ([(1.5, NO_FACE)], LEFT), ([(1.5, NO_FACE), (2.9, change(SILENT))], BLIND + "silent"),
    ([(1.5, NO_FACE), (3.3, change(SILENT))], BLIND + "silent")])
def test_a_visitor_has_left_only_if_a_fresh_message_says_so(happens, words):
    assert ending(LOOKS.format("IsVisitorDiscovered"), *happens) == words


@pytest.mark.parametrize("happens, words", [
    ([], "no gaze seen: /overtAttention/mode is " + NONE),
    ([(0.9, NO_GAZE)], "no gaze seen: /overtAttention/mode is " + OLD),
    ([(0.9, GAZE)], "no gaze seen: /overtAttention/mode is " + OLD),
    ([(0.9, GAZE), (2.9, change(SILENT, name="/overtAttention/mode"))],
     "no gaze seen: /overtAttention/mode is silent"),
    ([(2.9, NO_GAZE)], "no gaze seen"),
    ([(2.9, NO_GAZE), (3.2, change(SILENT, name="/overtAttention/mode"))], "no gaze seen")])
def test_a_gaze_that_could_not_be_seen_is_told_as_such(happens, words):
    assert ending(LOOKS.format("IsMutualGazeDiscovered"), *happens) == words


@pytest.mark.parametrize("limit", [9000, 2900])  # the Sleep ends first, or the Timeout
@pytest.mark.parametrize("happens, words", [
    ([(0.3, NO_FACE), (1.6, change(SILENT))], BLIND + "silent"),
    ([(0.3, NO_FACE), (1.6, change(SILENT)), (3.3, NO_FACE), (3.35, change(SILENT, True))], LEFT)])
def test_what_becomes_of_the_topic_in_a_wait_counts_until_that_is_over(limit, happens, words):
    assert ending(WAITS.format(limit), *happens) == words


# ------------------------------------------------------------------------------------------ silence


@pytest.mark.parametrize("gaps, silence, is_silent", [
    ([], 9.9, False), ([], 10.1, True),
    ([0.1] * 3, 9.9, False), ([0.1] * 3, 10.1, True),  # four messages do not show a rate
    ([0.1] * 4, 1.2, False), ([0.1] * 4, 1.3, True), ([0.001] * 999, 1.3, True),
    ([1.0] * 9, 11.9, False), ([1.0] * 9, 12.1, True), ([12.0] * 9, 140.0, False)])
def test_a_topic_is_silent_by_its_own_rate(gaps, silence, is_silent):
    at, rhythm = 500.0, Rhythm(500.0)
    for gap in [0.0, *gaps] if gaps else []:
        at += gap
        rhythm.hear(at)
    assert rhythm.is_silent(at + silence) is is_silent


def test_five_messages_a_minute_at_random_times_are_no_silence():
    draw, at = random.Random(7), 0.0
    rhythm = Rhythm(at)
    for number in range(2000):
        gap = draw.expovariate(5 / 60)
        assert number < 5 or not rhythm.is_silent(at + gap)
        at += gap
        rhythm.hear(at)


def test_the_rate_of_a_topic_that_is_connected_again_is_measured_again():
    rhythm = Rhythm(0.0)
    for at in (0.0, 0.1, 0.2, 0.3, 0.4, 60.0):
        rhythm.hear(at)
    assert not rhythm.is_silent(70.0)
    rhythm.restart()
    for at in (80.0, 80.1, 80.2, 80.3, 80.4):
        rhythm.hear(at)
    assert rhythm.is_silent(81.8)
