"""Tests of the journal as a witness: hand-made requests, messages and searches for a sign."""
import dataclasses
import functools
from types import SimpleNamespace

import pytest

from behavior_controller.bt.engine.clock import ManualClock
from behavior_controller.bt.values.status import FAILURE, RUNNING
from behavior_controller.run.events import HealthChanged, Line, Noticed
from behavior_controller.run.history import Run
from behavior_controller.robot.gateway import Cause, Failure, Sample
from behavior_controller.robot.requests import Answer, Say, SetAnimation, SetAttention
from behavior_controller.simulation.journal import JournalEntry

from unit_tests.judge.comparison import Query
from unit_tests.judge.signs import JournalMessages, Signs, SignSearch, objections
from unit_tests.judge.journal_check import JournalCheck

from plays import facts, stage

BEGAN = 1000.0  # of the run, in Unix time, and 0 by the mission's clock


# ------------------------------------------------------------------------- each request has a line


def line_of(text, at, fault=None):
    return JournalEntry(BEGAN + at, "textToSpeech", "/textToSpeech/say_text", 1, {"message": text},
                        fault)


def lines_of(queries, lines, speed=1.0):
    """Return for each query the number of its line, None: none; of each query text, when it was
    asked, when it was answered (None: the node was halted), and why it failed."""
    made, journal = {}, [line_of(*line) for line in lines]
    for text, asked, *answered in queries:
        query = made[len(made)] = Query(
            len(made), Say(text), "/textToSpeech/say_text", BEGAN + asked, "WelcomeSpeech")
        if answered:
            at, cause = answered
            query.answered = BEGAN + at
            query.result = Answer() if cause is None else Failure(cause, "-", query.service)
    witness = JournalCheck(facts()._replace(run=Run(), journal=journal, speed=speed),
                           SimpleNamespace(queries=made))
    numbers = {pair.query.call: journal.index(pair.line) if pair.line is not None else None
               for pair in witness.pairs if pair.query is not None}
    assert len(witness.pairs) == len(made) + len(journal) - sum(
        number is not None for number in numbers.values())
    return [numbers[call] for call in made]


@pytest.mark.parametrize("robot, is_found", [("robot1", True), ("robot2", False)])
def test_the_requests_to_one_of_several_robots_have_their_lines(robot, is_found):
    played = facts()
    world = played.world._replace(settings=dataclasses.replace(played.world.settings,
                                                               robot="robot1"))
    name = "/{}/textToSpeech/say_text"
    query = Query(0, Say("a"), name.format("robot1"), BEGAN, "WelcomeSpeech")
    line = line_of("a", 0.5)._replace(resource=name.format(robot))
    witness = JournalCheck(played._replace(run=Run(), journal=[line], world=world),
                           SimpleNamespace(queries={0: query}))
    pair, = witness.pairs
    assert pair.query is query and (pair.line is line) == is_found


A_HALTED, B = ("a", 0.0), ("b", 1.0, 3.0, None)
A_AGAIN = ("a", 1.0, 3.0, None)


@pytest.mark.slow
@pytest.mark.parametrize("queries, lines, expected", [
    ([A_HALTED], [("a", 0.5)], [0]),
    ([A_HALTED, B], [("a", 0.5), ("b", 1.5)], [0, 1]),
    # it reaches its node up to 1 s after the next one was made
    ([A_HALTED, B], [("a", 1.5), ("b", 1.9)], [0, 1]),
    ([A_HALTED, B], [("a", 1.5)], [0, None]),
    ([A_HALTED, B], [("a", 2.1), ("b", 2.2)], [None, 0]),
    ([A_HALTED, B], [("a", 2.0), ("b", 2.2)], [0, 1]),
    ([A_HALTED, B], [("x", 1.0), ("b", 1.5)], [0, 1]),
    # it never reaches it
    ([A_HALTED, B], [("b", 1.5)], [None, 0]),
    ([A_HALTED, B], [("b", 1.5), ("x", 1.9)], [None, 0]),
    ([A_HALTED, ("b", 1.0), ("c", 2.0, 3.0, None)], [("b", 1.5), ("c", 2.5)], [None, 0, 1]),
    # the next one is the same
    ([A_HALTED, A_AGAIN], [("a", 1.5)], [None, 0]),
    ([A_HALTED, A_AGAIN], [("a", 1.5), ("a", 1.9)], [0, 1]),
    ([A_HALTED, A_AGAIN], [("a", 1.5), ("a", 3.0)], [0, 1]),
    ([A_HALTED, A_AGAIN], [("a", 1.5), ("a", 3.1)], [None, 0]),
    ([A_HALTED, ("a", 1.0, 1.1, Cause.NOT_REACHABLE)], [("a", 1.5)], [0, None])])
def test_a_request_that_is_halted_may_reach_its_node_after_the_next_one_or_never(
        queries, lines, expected):
    assert lines_of(queries, lines) == expected


A_LONG, B_LONG, C_LONG = ((text, 0.0, 3.0, None) for text in "abc")


@pytest.mark.parametrize("queries, lines, expected", [
    ([A_LONG, B_LONG], [("b", 0.001), ("a", 0.003)], [1, 0]),
    ([A_LONG, B_LONG, C_LONG], [("c", 0.1), ("a", 0.1), ("b", 0.2)], [1, 2, 0]),
    ([A_LONG, B_LONG], [("b", 0.1), ("x", 0.1), ("a", 0.2)], [None, 0]),
    ([A_LONG, B_LONG], [("b", 0.1), ("a", 3.3)], [None, 0]),
    # one after the other
    ([("a", 0.0, 1.0, None), ("b", 1.0, 2.0, None)], [("b", 1.1), ("a", 1.2)], [None, 0]),
    # one that was dropped was on its way
    ([A_HALTED, B], [("b", 1.5), ("a", 1.9)], [1, 0]),
    ([A_HALTED, B], [("b", 1.5), ("a", 2.1)], [None, 0]),
    ([A_HALTED, B, ("a", 1.2, 3.0, None)], [("b", 1.5), ("a", 1.9)], [None, 0, 1])])
def test_of_requests_under_way_at_once_a_later_one_may_reach_the_node_first(
        queries, lines, expected):
    assert lines_of(queries, lines) == expected


def test_a_request_as_before_one_that_never_reached_its_node_is_not_sent_twice():
    queries = [("b", 0.0, 0.1, Cause.CONNECTION_LOST), A_HALTED, ("b", 20.0, 20.2, None),
               ("a", 20.4, 20.6, None)]
    lines = [("b", 0.0, "crash"), ("b", 20.0), ("a", 20.4)]
    assert lines_of(queries, lines) == [0, None, 1, 2]


A_SILENT, B_THEN = ("a", 0.0, 5.0, Cause.NO_ANSWER), ("b", 5.5, 5.6, None)


@pytest.mark.slow
@pytest.mark.parametrize("lines, speed, expected", [
    # by the clock of its node it came before it was made
    ([("b", 5.4)], 1.0, [0, None]), ([("b", 5.4)], 10.0, [None, 0]),
    # the one before was late on its way
    ([("a", 5.5), ("b", 5.6)], 10.0, [0, 1]), ([("a", 5.55)], 10.0, [0, None])])
def test_a_request_without_an_answer_may_reach_its_node_late_or_never(lines, speed, expected):
    assert lines_of([A_SILENT, B_THEN], lines, speed) == expected


@pytest.mark.slow
@pytest.mark.parametrize("cause, fault, may_reach", [
    (None, None, True), (Cause.REFUSED, "refused", True), (Cause.NO_ANSWER, "unanswered", True),
    (Cause.CONNECTION_LOST, "crash", True), (Cause.CONNECTION_LOST, None, False),
    (Cause.NOT_REACHABLE, None, False), (Cause.NOT_ADVERTISED, None, False),
    (Cause.TYPE_MISMATCH, None, False)])
def test_a_request_that_fails_before_its_node_has_it_leaves_the_line_to_the_next_one(
        cause, fault, may_reach):
    queries = [("a", 0.0, 0.1, cause), ("a", 0.2, 1.0, None)]
    assert lines_of(queries, [("a", 0.3, fault)]) == ([0, None] if may_reach else [None, 0])


@pytest.mark.parametrize("at, is_its", [(-0.3, False), (-0.25, True), (1.25, True), (1.3, False)])
def test_a_request_is_on_record_shortly_before_its_node_gets_it_and_after_it_answers(at, is_its):
    assert lines_of([("a", 0.0, 1.0, None)], [("a", at)]) == [0 if is_its else None]


SAFE, OTHER = SetAttention("disabled"), SetAttention("social")


@pytest.mark.parametrize("node, request_made, asker, is_for_safety", [
    ("DisabledOvertAttentionMode", SAFE, "DisabledOvertAttentionMode", False),
    ("HandleFallBack", SAFE, "HandleFallBack", True),
    ("HandleFallback", SAFE, "HandleFallback", True),
    ("HandleFallBack", OTHER, "HandleFallBack", False), ("", SAFE, "the safe state", True),
    ("", SetAnimation("disabled"), "the safe state", True), ("", OTHER, "a later step", False)])
def test_a_request_is_made_by_a_node_or_at_the_end(node, request_made, asker, is_for_safety):
    query = Query(0, request_made, "/x", BEGAN, node)
    assert (query.asker, query.is_for_safety) == (asker, is_for_safety)


# ------------------------------------------------------------------ each result is that of its node


SPEECH = "/textToSpeech/say_text"
DEADLINE = 60.0  # of a speech, in seconds
AWAY = [Cause.NOT_REACHABLE, Cause.NOT_ADVERTISED, Cause.CONNECTION_LOST]


@functools.lru_cache(maxsize=None)
def usual(**mission):
    return facts(mission=tuple(mission.items()))


def objected(answered=None, cause=None, got=None, dropped=None, request=Say("a"), node="",
             health=(), more=(), ends=500.0, mission=(), absent=(), **of_test):
    """Return the objections to one request at 0 s: when it was answered, or dropped, and why it
    failed; ``got``: when its node got it, its fault and the seconds that it takes, None: never;
    ``more``: nodes, times and faults of other lines; ``health``: times and fields of changes."""
    known = usual(**dict(mission))
    service = known.world.settings.interface.service(type(request))
    query = Query(0, request, service.name, BEGAN, node or "WelcomeSpeech")
    query.dropped = None if dropped is None else BEGAN + dropped
    if answered is not None:
        query.answered = BEGAN + answered
        query.result = Answer() if cause is None else Failure(cause, "-", service.name)
    journal = [JournalEntry(BEGAN + at, other, "-", 1, {"message": ""}, fault)
               for other, at, fault in more]
    if got is not None:
        at, fault, seconds = got
        content = {"message": "a"} if isinstance(request, Say) else dict(zip(
            ("state", "x", "y", "z"), (request.state, *request.target)))
        journal.append(JournalEntry(BEGAN + at, service.node, service.name, 1, content, fault,
                                    seconds=seconds))
    changes = [Line(BEGAN + at, HealthChanged(**dict(
        dict(kind="service", name=service.name, node=service.node, is_well=False, status="-",
             consequence="-", respect="gone"), **fields))) for at, fields in health]
    test = dataclasses.replace(known.test, absent_services=absent)
    judged = known._replace(run=Run([*changes, Line(BEGAN + ends, Noticed("info", "-"))]),
                            journal=sorted(journal), test=test, **of_test)
    signs = SimpleNamespace(waiting={}, searches=[])
    return list(JournalCheck(judged, SimpleNamespace(
        queries={0: query}, offset=None, signs=signs, differs_at=0.0)).objections())


@pytest.mark.parametrize("at, is_late", [(0.0, False), (1.0, False), (1.25, True)])
def test_a_request_reaches_its_node_within_a_second(at, is_late):
    found = objected(at + 0.5, got=(at, None, 0.5))
    assert found == [f"WelcomeSpeech: {SPEECH} got the request {at:.1f} s late"] * is_late


@pytest.mark.parametrize("seconds, fault, cause, answered, due, is_in_time", [
    (2.0, None, None, 2.0, 2.0, True), (2.0, None, None, 1.75, 2.0, True),
    (2.0, None, None, 1.5, 2.0, False), (2.0, None, None, 3.0, 2.0, True),
    (2.0, None, None, 3.25, 2.0, False), (2.0, "refused", Cause.REFUSED, 1.5, 2.0, False),
    # its deadline comes before its answer
    (70.0, None, Cause.NO_ANSWER, 60.0, 60.0, True),
    (70.0, None, Cause.NO_ANSWER, 59.5, 60.0, False),
    (70.0, None, Cause.NO_ANSWER, 61.25, 60.0, False),
    # it never answers
    (0.0, "unanswered", Cause.NO_ANSWER, 60.0, 60.0, True),
    (0.0, "unanswered", Cause.NO_ANSWER, 59.5, 60.0, False)])
def test_an_answer_is_awaited_until_it_is_there_or_the_deadline(
        seconds, fault, cause, answered, due, is_in_time):
    found = objected(answered, cause, got=(0.0, fault, seconds))
    assert found == ([] if is_in_time else [
        f"WelcomeSpeech: {SPEECH} was waited for {answered:.1f} s; it was due after {due:.1f} s, "
        "its deadline is 60 s"])


@pytest.mark.parametrize("dropped, is_in_time", [(0.5, True), (3.0, True), (3.25, False)])
def test_the_answer_to_a_request_that_is_halted_may_never_be_awaited(dropped, is_in_time):
    found = objected(dropped=dropped, got=(0.0, None, 2.0))
    assert (found == []) is is_in_time


@pytest.mark.slow
@pytest.mark.parametrize("node, answered, is_in_time", [
    ("DisabledOvertAttentionMode", 1.0, True), ("DisabledOvertAttentionMode", 1.25, False),
    ("HandleFallBack", 1.25, True), ("HandleFallBack", 8.0, True), ("HandleFallBack", 8.25, False)])
def test_the_answers_to_the_safe_state_are_read_together(node, answered, is_in_time):
    """The slower of its two services may take 7 s."""
    found = objected(answered, request=SetAttention("disabled"), node=node, got=(0.0, None, 0.0),
                     mission=(("animateBehaviorDeadline", 7.0),))
    assert [words for words in found if " was waited for " in words] == found
    assert (found == []) is is_in_time


@pytest.mark.parametrize("seconds, is_excused", [(58.5, False), (59.0, False), (59.5, True)])
def test_an_answer_just_before_the_deadline_may_come_too_late(seconds, is_excused):
    found = objected(60.0, Cause.NO_ANSWER, got=(0.0, None, seconds))
    carried_out = ("call 1 of {} for WelcomeSpeech was carried out; on record is no-answer instead "
                   "of an answer")
    assert (carried_out.format(SPEECH) in found) is not is_excused


RESULTS = {None: None, "refused": Cause.REFUSED, "exception": Cause.HANDLER_EXCEPTION,
           "unanswered": Cause.NO_ANSWER, "crash": Cause.CONNECTION_LOST,
           "wrong": Cause.UNUSABLE_ANSWER}


@pytest.mark.parametrize("fault", RESULTS)
def test_each_fault_has_its_cause_on_record_and_no_other(fault):
    at = DEADLINE if fault == "unanswered" else 0.5
    for cause in [None, *Cause]:
        found = objected(at, cause, got=(0.0, fault, at), health=[(at, {})] * (cause in AWAY))
        assert (found == []) is (cause is RESULTS[fault]), cause


@pytest.mark.parametrize("answered, cause, crash, is_well", [
    (1.5, Cause.CONNECTION_LOST, ("textToSpeech", 1.5, "crash"), True),
    (3.0, Cause.CONNECTION_LOST, ("textToSpeech", 3.0, "crash"), True),  # before it was sent
    (3.0, None, ("textToSpeech", 3.0, "crash"), True),
    (1.5, Cause.CONNECTION_LOST, ("tabletEvent", 1.5, "crash"), False),
    (1.5, Cause.CONNECTION_LOST, ("textToSpeech", 1.5, "refused"), False),
    (3.0, Cause.CONNECTION_LOST, ("textToSpeech", 1.5, "crash"), False),
    (3.0, None, ("textToSpeech", 1.5, "crash"), False)])
@pytest.mark.parametrize("fault", [None, "unanswered"])
def test_a_crash_of_the_node_ends_its_other_calls(fault, answered, cause, crash, is_well):
    if fault is None or answered == 1.5:
        found = objected(answered, cause, got=(0.0, fault, 3.0), more=[crash],
                         health=[(crash[1], {})])
        assert ([words for words in found if "was taken for gone" not in words] == []) is is_well


@pytest.mark.parametrize("end, outcome", [
    ({"dropped": 0.5}, ""), ({"dropped": 0.75}, "no answer"), ({"ends": 0.5}, ""),
    ({"ends": 0.75}, "no answer"), ({"answered": 0.1}, "an answer")])
def test_a_request_that_its_node_never_got_has_no_answer(end, outcome):
    """One that was dropped at once, or made at the end, may have been on its way."""
    words = f"WelcomeSpeech: {SPEECH} never got the request saying “a”, and on record is {outcome}"
    assert objected(**end) == [words] * bool(outcome)


CRASH = "crash"


@pytest.mark.parametrize("more, is_away", [
    ([], False), ([("textToSpeech", -1.0, CRASH)], True), ([("tabletEvent", -1.0, CRASH)], False),
    ([("textToSpeech", -1.0, "refused")], False),
    # it may be on record before
    ([("textToSpeech", 1.0, CRASH)], True), ([("textToSpeech", 1.25, CRASH)], False),
    # it is back after 15 s, or as soon as it is heard of then
    ([("textToSpeech", -30.0, CRASH)], True),
    ([("textToSpeech", -30.0, CRASH), ("textToSpeech", -10.0, None)], False),
    ([("textToSpeech", -30.0, CRASH), ("tabletEvent", -10.0, None)], True),
    ([("textToSpeech", -30.0, CRASH), ("textToSpeech", 0.0, None)], True),
    ([("textToSpeech", -15.0, CRASH), ("textToSpeech", -10.0, None)], False),
    ([("textToSpeech", -14.75, CRASH), ("textToSpeech", -10.0, None)], True),
    # it has crashed again
    ([("textToSpeech", -40.0, CRASH), ("textToSpeech", -30.0, None),
      ("textToSpeech", -20.0, CRASH)], True)])
def test_a_node_gets_no_request_between_its_crash_and_its_return(more, is_away):
    for cause in [*AWAY, Cause.REFUSED, None]:
        found = [words for words in objected(0.0, cause, more=more, health=[(0.0, {})])
                 if "never got" in words]
        assert (found == []) is (is_away and cause in AWAY), cause


def test_at_a_test_that_is_stopped_each_node_may_have_ended():
    assert objected(0.0, Cause.NOT_REACHABLE, health=[(0.0, {})], cut_off="stopped") == []
    assert objected(0.0, Cause.NOT_REACHABLE, health=[(0.0, {})], cut_off="stopped",
                    has_timed_out=True) != []


@pytest.mark.parametrize("cause, is_well", [(None, False), (Cause.NOT_ADVERTISED, True),
                                            (Cause.REFUSED, False)])
def test_a_step_whose_service_the_robot_does_not_have_fails_as_not_advertised(cause, is_well):
    assert (objected(0.0, cause, absent=(SPEECH,)) == []) is is_well


# ----------------------------------------------------------------------------- each loss is noticed


CRASHED = [("textToSpeech", -1.0, CRASH)]


@pytest.mark.parametrize("noticed, is_noticed", [
    ([], False), ([(10.0, {})], True), ([(-4.75, {})], True), ([(-5.0, {})], False),
    ([(10.75, {})], True), ([(11.0, {})], False), ([(10.0, {"is_well": True})], False),
    ([(10.0, {"respect": "slow"})], False), ([(10.0, {"kind": "topic"})], False),
    ([(10.0, {"name": "/x"})], False)])
def test_a_service_that_is_gone_is_noticed_within_a_second(noticed, is_noticed):
    for cause in [*AWAY, Cause.NO_ANSWER, Cause.REFUSED, None]:
        found = [words for words in objected(10.0, cause, more=CRASHED, health=noticed)
                 if "was gone, and that was not noticed" in words]
        assert bool(found) is (cause in AWAY and not is_noticed), cause


@pytest.mark.parametrize("ends, is_noticed", [(10.5, True), (10.75, True), (11.0, False)])
def test_a_loss_at_the_end_of_the_run_need_not_be_noticed(ends, is_noticed):
    assert (objected(10.0, Cause.NOT_REACHABLE, more=CRASHED, ends=ends) == []) is is_noticed


@pytest.mark.parametrize("fields, facts_of, is_well", [
    ({}, {}, False), ({"is_well": True}, {}, True), ({"respect": "slow"}, {}, True),
    ({"kind": "topic"}, {}, True), ({}, {"more": CRASHED}, True), ({}, {"absent": (SPEECH,)}, True),
    ({}, {"real": frozenset({"textToSpeech"})}, True),
    ({}, {"real": frozenset({"tabletEvent"})}, False), ({"name": "/x"}, {}, True)])
def test_what_is_taken_for_gone_is_gone(fields, facts_of, is_well):
    found = objected(0.5, got=(0.0, None, 0.5), health=[(0.2, fields)], **facts_of)
    taken = "{} was taken for gone, and /textToSpeech was running".format(SPEECH)
    assert (taken in found) is not is_well


# ---------------------------------------------------------------------------- no sign was missed


NOW = 100.0
STATE, EVENTS = "/overtAttention/mode", "/speechEvent/text"


def objection(topic, said, has_sign=False, crash=None, interface="D5.4.3", **search):
    """Return the objection to a search at ``NOW`` for the value 1; the times of what was said, of a
    crash and of the search are seconds from then on."""
    node = topic.split("/")[1]
    lines = [JournalEntry(BEGAN + NOW + at, node, topic, 0, {
                 "state": "seeking", "value": value, "data": str(value)}) for at, value in said]
    if crash is not None:
        lines.insert(0, JournalEntry(BEGAN + NOW + crash, node, "-", 1, {}, "crash"))
    given = dict(after=-50.0, newest=0.0, until=0.0, began=BEGAN - NOW)
    times = {name: NOW + seconds for name, seconds in dict(given, **search).items()}
    looked = SignSearch(SimpleNamespace(registration_id="Look"), topic, at=NOW, has_sign=has_sign,
                        is_sign=lambda value: getattr(value, "value", value) in (1, "1"), **times)
    world = stage(robotInterface=interface).world
    messages = JournalMessages(facts()._replace(journal=lines, world=world), topic, BEGAN)
    return messages.objection(looked, 2.0).partition(": ")[0]


UNSEEN = "Look did not see what {} said {} s before"


@pytest.mark.slow
@pytest.mark.parametrize("said, search, expected", [
    # it is 2 s old at most, and takes up to 1 s to be read
    ([(-1.5, 1)], {}, "1.5"), ([(-1.9, 1)], {}, ""), ([(-0.9, 1)], {}, ""), ([(-1.5, 0)], {}, ""),
    ([(-1.5, 1)], {"after": -1.6}, "1.5"), ([(-1.5, 1)], {"after": -1.4}, ""),
    # a connection may take a second when a mission begins
    ([(-1.5, 1)], {"began": BEGAN - 2.4}, ""), ([(-1.5, 1)], {"began": BEGAN - 2.6}, "1.5"),
    ([(-1.5, 1)], {"crash": -9.0}, ""),
    ([(-1.5, 1)], {"crash": -16.6}, "1.5"),
    # the state has to last until it could have been read
    ([(-1.5, 1), (-0.3, 0)], {}, ""), ([(0.5, 1)], {"until": 3.0}, "2.5"),
    ([(0.5, 1), (1.2, 0)], {"until": 3.0}, ""), ([(0.5, 1), (1.8, 0)], {"until": 3.0}, "2.5"),
    ([(0.5, 0), (1.2, 1)], {"until": 3.0}, "1.8"), ([(2.1, 1)], {"until": 3.0}, "")])
def test_a_state_that_is_a_sign_is_seen(said, search, expected):
    assert objection(STATE, said, **search) == (expected and UNSEEN.format(STATE, expected))


@pytest.mark.slow
@pytest.mark.parametrize("said, search, expected", [
    ([(-20.0, 1), (-19.9, 0)], {}, "20.0"), ([(-20.0, 0)], {}, ""), ([(-0.9, 1)], {}, ""),
    ([(-20.0, 1)], {"began": BEGAN - 20.9}, ""), ([(-20.0, 1)], {"began": BEGAN - 21.1}, "20.0"),
    ([(-20.0, 1)], {"after": -19.0}, ""), ([(0.5, 1), (0.6, 0)], {"until": 2.0}, "1.5")])
def test_an_event_that_is_a_sign_is_seen_however_old_it_is(said, search, expected):
    assert objection(EVENTS, said, **search) == (expected and UNSEEN.format(EVENTS, expected))


@pytest.mark.parametrize("newest, is_unread", [(-1.8, True), (-1.7, False)])
def test_the_newest_state_is_read(newest, is_unread):
    assert objection(STATE, [(-9.0, 0), (-1.5, 0)], newest=newest) == (
        "Look did not read what {} said 1.5 s before".format(STATE) if is_unread else "")


@pytest.mark.parametrize("interface, newer, is_over", [
    ("D5.4.3", 0, True), ("D5.4.3", 1, False),
    ("release-1.0", 0, False)])  # whose attention says once that it has found somebody
def test_a_state_that_was_a_sign_and_is_over_is_none(interface, newer, is_over):
    said = [(-2.9, 1), (-1.5, newer)]
    assert bool(objection(STATE, said, True, interface=interface, newest=-2.9)) is is_over


@pytest.mark.parametrize("is_waiting", [True, False])
def test_a_search_that_goes_on_lasts_until_the_end_of_the_run(is_waiting):
    search = SignSearch(SimpleNamespace(registration_id="Look"), STATE, at=NOW, after=0.0,
                        newest=0.0, until=NOW, began=BEGAN, has_sign=False,
                        is_sign=lambda status: status.value == 1)
    said = JournalEntry(BEGAN + NOW + 1.0, "overtAttention", STATE, 0,
                        {"state": "seeking", "value": 1})
    signs = SimpleNamespace(waiting={5: search} if is_waiting else {}, searches=[search])
    missed = objections(facts()._replace(run=Run(), journal=[said]), signs, BEGAN,
                        BEGAN + NOW + 5.0)
    assert [words.partition(": ")[0] for words in missed if words] == [
        UNSEEN.format(STATE, "4.0")] * is_waiting


def test_a_search_goes_on_while_its_node_waits_for_the_same_sign():
    clock, signs = ManualClock(10.0), Signs()
    node = SimpleNamespace(uid=5, status=RUNNING, parent=None)

    def traversal(at, **facts_of):
        clock.set_to(at)
        if facts_of:
            node.status = facts_of.get("status", RUNNING)
            signs.searched(node, STATE, [Sample(0, at - 0.5)], facts_of.get("after", 1.0),
                           lambda value: False, facts_of.get("has_sign", False))
        signs.end_traversal()
        return [(search.at, search.until) for search in signs.searches], list(signs.waiting)
    signs.begin(clock, BEGAN)
    assert traversal(10.0, after=1.0) == ([(10.0, 10.0)], [5])
    assert traversal(12.0, after=1.0) == ([(10.0, 12.0)], [5])
    # it was asked something else
    assert traversal(13.0, after=2.0) == ([(10.0, 13.0), (13.0, 13.0)], [5])
    # it was halted
    assert traversal(15.0) == ([(10.0, 13.0), (13.0, 15.0)], [])
    assert traversal(16.0) == ([(10.0, 13.0), (13.0, 15.0)], [])
    # it has its sign, or has given up
    assert traversal(17.0, has_sign=True)[1] == traversal(18.0, status=FAILURE)[1] == []
    assert [search.until for search in signs.searches[2:]] == [17.0, 18.0]
    assert [search.newest for search in signs.searches] == [9.5, 12.5, 16.5, 17.5]
    assert traversal(19.0, after=1.0)[1] == [5]
    signs.begin(clock, BEGAN)  # another mission
    assert traversal(30.0)[1] == [] and signs.searches[-1].until == 19.0
