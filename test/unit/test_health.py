"""What is known of the robot's nodes: each change is handed on once, by the tick thread."""
import pytest
from msgspec.structs import replace

from behavior_controller.run.events import Events, HealthChanged
from behavior_controller.robot.requests import Say, SayGoal, SetAttention
from behavior_controller.run.health import (
    GONE, Health, SLOW, available_again, gone, slow_after)

DEAD = HealthChanged("service", "/say", "textToSpeech", False, "gone: closed by the peer",
                     "the robot cannot speak", GONE)
BACK = HealthChanged("service", "/say", "textToSpeech", True, "back", "", GONE)


def published(health):
    events, seen = Events(), []
    events.subscribe(seen.append)
    health.publish(events)
    return seen


def test_a_change_is_told_once_and_wakes():
    wakes = []
    health = Health(lambda: wakes.append(True))
    for _ in range(3):
        health.report(GONE, DEAD)
    assert wakes
    assert published(health) == [DEAD]
    assert published(health) == []
    for _ in range(3):
        health.report(GONE, BACK)
    assert published(health) == [BACK]


def test_what_was_always_well_is_no_news():
    health = Health()
    health.report(GONE, BACK)
    assert published(health) == []


def test_what_is_gone_is_known_until_it_is_back():
    health = Health()
    health.report(GONE, DEAD)
    published(health)
    assert health.is_gone("/say") and not health.is_gone("/go")
    health.report(GONE, BACK)
    published(health)
    assert not health.is_gone("/say")


def test_what_is_gone_has_the_name_of_its_node_or_else_its_own():
    health = Health()
    health.report(GONE, gone("service", "/say", "textToSpeech", "closed by the peer",
                             "the robot cannot speak"))
    health.report(GONE, replace(DEAD, name="/go", node=""))
    published(health)
    names = [health.gone_name(name) for name in ("/say", "/go", "/look")]
    assert names == ["/textToSpeech", "/go", "/look"]
    health.report(GONE, available_again("service", "/say", "textToSpeech"))
    assert [event.is_well for event in published(health)] == [True]
    assert health.gone_name("/say") == "/say" and not health.is_gone("/say")


def test_each_respect_is_for_itself():
    health = Health()
    health.report(SLOW, DEAD)
    assert not health.is_gone("/say")
    health.report(GONE, DEAD)
    assert published(health) == [replace(DEAD, respect=SLOW), DEAD]


def statuses(health):
    return [(event.is_well, event.status.split(":")[0]) for event in published(health)]


def test_three_failures_in_a_row_are_told_until_a_call_succeeds():
    health = Health()
    for calls, told in ("FF.FF", []), (".FFF", [(False, "failing")
                                                ]), ("F", []), ("..", [(True, "works again")]):
        for call in calls:
            health.ended("/say", 0.1, 9.0, call == "F")
        assert statuses(health) == told


def test_calls_of_a_node_that_is_gone_do_not_make_it_failing_when_it_is_back():
    health = Health()
    health.report(GONE, DEAD)
    published(health)
    for _ in range(4):
        health.ended("/say", 0.1, 9.0, True)
    health.report(GONE, BACK)
    assert published(health) == [BACK]


def test_a_slow_service_is_slow_until_it_answers_in_less_than_half_its_deadline():
    wakes = []
    health = Health(lambda: wakes.append(True))
    health.slow("/say", 8.0)
    assert wakes == [True]
    health.ended("/say", 4.0, 8.0, False)
    health.ended("/say", 1.0, 8.0, True)
    assert [(event.status, event.consequence) for event in published(health)] == [
        ("slow: no answer for 4 s", "a call is given up after 8 s")]
    health.ended("/say", 3.9, 8.0, False)
    assert statuses(health) == [(True, "answers in time again")]


@pytest.mark.parametrize("letters, deadline, after", [
    (14, 60.0, 5.0), (56, 60.0, 11.0), (0, 60.0, 30.0), (140, 60.0, 23.0), (1400, 60.0, 60.0),
    (56, 8.0, 8.0)])
def test_a_speech_is_slow_when_it_is_late_for_its_words(letters, deadline, after):
    usual = Say("a" * letters).usual_seconds
    assert slow_after(usual, deadline) == pytest.approx(after)
    health = Health()
    health.slow("/say", deadline, usual=usual)
    published(health)
    health.ended("/say", after, deadline, False, usual=usual)
    assert published(health) == []
    health.ended("/say", after - 0.1, deadline, False, usual=usual)
    assert statuses(health) == [(True, "answers in time again")]


def test_other_requests_have_no_usual_time():
    assert SetAttention("social").usual_seconds == SayGoal("").usual_seconds == 0.0
    assert SayGoal("a" * 28).usual_seconds == 2.0


def test_when_a_topic_was_heard_last_is_known_and_wakes_nothing():
    wakes = []
    health = Health(lambda: wakes.append(True))
    health.hear("/mode", 0.5)
    for number in range(99):
        health.hear("/faces", float(number))
    assert health.last_arrivals == {"/mode": 0.5, "/faces": 98.0}
    assert published(health) == [] and wakes == []
