"""Tests of the journal as a witness: hand-made requests, messages and searches for a sign."""
from types import SimpleNamespace

import pytest

from behavior_controller.execution.run import Run
from behavior_controller.robot.gateway import Cause, Failure
from behavior_controller.robot.requests import Answer, Say

from unit_tests.judge.comparison import Query
from unit_tests.judge.signs import JournalMessages, SignSearch, objections
from unit_tests.judge.witness import Witness
from unit_tests.robot.journal import JournalEntry

from plays import facts, stage

BEGAN = 1000.0  # of the run, in Unix time, and 0 by the mission's clock


# ------------------------------------------------------------------------- each request has a line


def line_of(text, at, fault=None):
    return JournalEntry(BEGAN + at, "textToSpeech", "/textToSpeech/say_text", 1, {"message": text},
                        fault)


def lines_of(queries, lines):
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
    witness = Witness(facts()._replace(run=Run(), journal=journal), SimpleNamespace(queries=made))
    numbers = {pair.query.call: journal.index(pair.line) if pair.line is not None else None
               for pair in witness.pairs if pair.query is not None}
    assert len(witness.pairs) == len(made) + len(journal) - sum(
        number is not None for number in numbers.values())
    return [numbers[call] for call in made]


A_HALTED, B = ("a", 0.0), ("b", 1.0, 3.0, None)
A_AGAIN = ("a", 1.0, 3.0, None)


@pytest.mark.parametrize("queries, lines, expected", [
    ([A_HALTED], [("a", 0.5)], [0]),
    ([A_HALTED, B], [("a", 0.5), ("b", 1.5)], [0, 1]),
    # it reaches its node up to 1 s after the next one was made
    ([A_HALTED, B], [("a", 1.5), ("b", 1.9)], [0, 1]),
    ([A_HALTED, B], [("a", 1.5)], [0, None]),
    ([A_HALTED, B], [("a", 2.1), ("b", 2.2)], [None, 0]),
    # it never reaches it
    ([A_HALTED, B], [("b", 1.5)], [None, 0]),
    ([A_HALTED, B], [("b", 1.5), ("x", 1.9)], [None, 0]),
    ([A_HALTED, ("b", 1.0), ("c", 2.0, 3.0, None)], [("b", 1.5), ("c", 2.5)], [None, 0, 1]),
    # the next one is the same
    ([A_HALTED, A_AGAIN], [("a", 1.5)], [None, 0]),
    ([A_HALTED, A_AGAIN], [("a", 1.5), ("a", 1.9)], [0, 1]),
    ([A_HALTED, A_AGAIN], [("a", 1.5), ("a", 3.1)], [None, 0]),
    ([A_HALTED, ("a", 1.0, 1.1, Cause.NOT_REACHABLE)], [("a", 1.5)], [0, None])])
def test_a_request_that_is_halted_may_reach_its_node_after_the_next_one_or_never(
        queries, lines, expected):
    assert lines_of(queries, lines) == expected


@pytest.mark.parametrize("cause, fault, may_reach", [
    (None, None, True), (Cause.REFUSED, "refused", True), (Cause.NO_ANSWER, "unanswered", True),
    (Cause.CONNECTION_LOST, "crash", True), (Cause.CONNECTION_LOST, None, False),
    (Cause.NOT_REACHABLE, None, False), (Cause.NOT_ADVERTISED, None, False),
    (Cause.TYPE_MISMATCH, None, False)])
def test_a_request_that_fails_before_its_node_has_it_leaves_the_line_to_the_next_one(
        cause, fault, may_reach):
    queries = [("a", 0.0, 0.1, cause), ("a", 0.2, 1.0, None)]
    assert lines_of(queries, [("a", 0.3, fault)]) == ([0, None] if may_reach else [None, 0])


@pytest.mark.parametrize("at, is_its", [(-0.3, False), (-0.2, True), (1.2, True), (1.3, False)])
def test_a_request_is_on_record_shortly_before_its_node_gets_it_and_after_it_answers(at, is_its):
    assert lines_of([("a", 0.0, 1.0, None)], [("a", at)]) == [0 if is_its else None]


# ---------------------------------------------------------------------------- no sign was missed


NOW = 100.0
STATE, EVENTS = "/overtAttention/mode", "/speechEvent/text"


def objection(topic, said, has_sign=False, crash=None, interface="D5.4.3", **search):
    """Return the objection to a search at ``NOW`` for the value 1; the times of what was said, of a
    crash and of the search are seconds from then on."""
    topic = stage(robotInterface=interface).settings.interface.topic(topic)
    lines = [JournalEntry(BEGAN + NOW + at, topic.node, topic.name, 0,
                          {"state": "seeking", "value": value, "data": str(value)})
             for at, value in said]
    if crash is not None:
        lines.insert(0, JournalEntry(BEGAN + NOW + crash, topic.node, "-", 1, {}, "crash"))
    given = dict(after=-50.0, newest=0.0, until=0.0, began=BEGAN - NOW)
    times = {name: NOW + seconds for name, seconds in dict(given, **search).items()}
    looked = SignSearch(
        SimpleNamespace(registration_id="Look"), topic, at=NOW, has_sign=has_sign,
        is_sign=lambda value: getattr(value, "value", value) in (1, "1"), **times)
    messages = JournalMessages(facts()._replace(journal=lines), topic, BEGAN)
    return messages.objection(looked, 2.0).partition(": ")[0]


UNSEEN = "Look did not see what {} said {} s before"


@pytest.mark.parametrize("said, search, expected", [
    # it is 2 s old at most, and takes up to 1 s to be read
    ([(-1.5, 1)], {}, "1.5"), ([(-1.9, 1)], {}, ""), ([(-0.9, 1)], {}, ""), ([(-1.5, 0)], {}, ""),
    ([(-1.5, 1)], {"after": -1.6}, "1.5"), ([(-1.5, 1)], {"after": -1.4}, ""),
    ([(-1.5, 1)], {"began": BEGAN - 1.4}, ""), ([(-1.5, 1)], {"crash": -9.0}, ""),
    ([(-1.5, 1)], {"crash": -16.6}, "1.5"),
    # the state has to last until it could have been read
    ([(-1.5, 1), (-0.3, 0)], {}, ""), ([(0.5, 1)], {"until": 3.0}, "2.5"),
    ([(0.5, 1), (1.2, 0)], {"until": 3.0}, ""), ([(0.5, 1), (1.8, 0)], {"until": 3.0}, "2.5"),
    ([(0.5, 0), (1.2, 1)], {"until": 3.0}, "1.8"), ([(2.1, 1)], {"until": 3.0}, "")])
def test_a_state_that_is_a_sign_is_seen(said, search, expected):
    assert objection(STATE, said, **search) == (expected and UNSEEN.format(STATE, expected))


@pytest.mark.parametrize("said, search, expected", [
    ([(-20.0, 1), (-19.9, 0)], {}, "20.0"), ([(-20.0, 0)], {}, ""), ([(-0.9, 1)], {}, ""),
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
    search = SignSearch(
        SimpleNamespace(registration_id="Look"), stage().settings.interface.topic(STATE), at=NOW,
        after=0.0, newest=0.0, until=NOW, began=BEGAN, has_sign=False,
        is_sign=lambda status: status.value == 1)
    said = JournalEntry(BEGAN + NOW + 1.0, "overtAttention", STATE, 0,
                        {"state": "seeking", "value": 1})
    signs = SimpleNamespace(waiting={5: search} if is_waiting else {}, searches=[search])
    missed = objections(facts()._replace(run=Run(), journal=[said]), signs, BEGAN,
                        BEGAN + NOW + 5.0)
    assert [words.partition(": ")[0] for words in missed if words] == [
        UNSEEN.format(STATE, "4.0")] * is_waiting
