"""Topic conditions: which message counts, and that whatever changes the answer brings a tick by
itself."""
import pytest

from behavior_controller.bt.values.status import FAILURE, RUNNING, SUCCESS
from behavior_controller.run.events import LeafFinished, Noticed, StepStarted, LeafSummary
from behavior_controller.robot.gateway import Cause
from behavior_controller.robot.d543 import ATTENTION, FACES, SPEECH
from behavior_controller.robot.requests import Answer, AttentionStatus, Faces
from behavior_controller.leaves.base import BEFORE_QUESTION, NOT_ASKED
from mission_rig import ASLEEP, NO_TIMER, WOKEN, follow, one_leaf, refusal

FACE, NO_FACE = Faces(("7",), (False,)), Faces((), ())


def woken(rig):
    return rig.tree.wake.test_and_clear()


SEEN = "<IsVisitorDiscovered/>"
STEPS = {  # of a state, which counts for 2 s (topicMaxAge)
    "a face is a visitor and an empty message is none":
        [FAILURE, NO_FACE, ASLEEP, FAILURE, FACE, WOKEN, SUCCESS],
    "a visitor who goes wakes the tree":
        [FACE, SUCCESS, FACE, ASLEEP, NO_FACE, WOKEN, FAILURE],
    "a message that grows too old wakes the tree and counts no more":
        [FACE, SUCCESS, 1.9, ASLEEP, 0.2, WOKEN, FAILURE],
    "a message counts until it is older than allowed": [FACE, 2.0, SUCCESS],
    "a newer message puts the end off":
        [FACE, SUCCESS, 1.5, FACE, SUCCESS, 1.5, ASLEEP, 0.4, ASLEEP, 0.2, WOKEN],
    "only the newest message counts": [FACE, NO_FACE, FAILURE]}


@pytest.mark.parametrize("steps", STEPS.values(), ids=STEPS)
def test_a_condition_on_a_state(steps):
    follow(one_leaf(SEEN), FACES, steps)


@pytest.mark.parametrize("mission, steps", [
    ("<IsYesNoUttered/>", ["yes", SUCCESS, FAILURE]),
    ("<IsYesNoUttered/>", ["yes", 60.0, SUCCESS]),
    ("<Sequence><IsYesNoUttered/><IsVisitorResponseYes/></Sequence>",
     ["yes", 0.001, "hm", 0.001, "no", 0.001, "yes", SUCCESS, FAILURE, SUCCESS, FAILURE])],
    ids=["one utterance answers one question", "none grows old", "in their order"])
def test_a_condition_on_utterances(mission, steps):
    follow(one_leaf(mission), SPEECH, steps)


ONCE = [RUNNING, 2.9, RUNNING, 0.2, FAILURE]
ITSELF = [RUNNING, 3.9, RUNNING, 0.2, FAILURE, RUNNING, FACE, SUCCESS]
REST = "<ForceFailure><Sleep msec='4000'/></ForceFailure>"


@pytest.mark.parametrize("mission, steps", [
    (SEEN, [RUNNING, 2.9, RUNNING, FACE, WOKEN, SUCCESS, 0.2, ASLEEP]),
    (SEEN, [RUNNING, 1.0, RUNNING, 2.0, WOKEN, FAILURE, NO_TIMER, RUNNING, 3.0, WOKEN, FAILURE]),
    # asked once
    ("<Sequence>" + SEEN + "<AlwaysSuccess/></Sequence>", ONCE),
    ("<WhileDoElse><AlwaysSuccess/>" + SEEN + "</WhileDoElse>", ONCE),
    ("<ReactiveSequence><AlwaysSuccess/>" + SEEN + "</ReactiveSequence>", ONCE),
    ("<Inverter>" + SEEN + "</Inverter>", ONCE[:3]),
    # the mission waits itself
    ("<ReactiveFallback>" + SEEN + REST + "</ReactiveFallback>", ITSELF),
    ("<ReactiveFallback><Sequence><AlwaysSuccess/>" + SEEN + "</Sequence>" + REST
     + "</ReactiveFallback>", ITSELF),
    ("<Inverter><ReactiveSequence><Inverter>" + SEEN + "</Inverter><Sleep msec='4000'/>"
     "</ReactiveSequence></Inverter>", ITSELF),
    ("<WhileDoElse>" + SEEN + "<AlwaysSuccess/>" + REST + "</WhileDoElse>", ITSELF)])
def test_a_condition_wait_of_three_seconds(mission, steps):
    follow(one_leaf(mission, conditionWait=3.0), FACES, steps)


def test_a_condition_wait_may_be_short():
    follow(one_leaf(SEEN, conditionWait=0.25), FACES, [RUNNING, 0.25, FAILURE])


def test_the_tree_is_woken_when_the_message_has_just_grown_too_old():
    rig = one_leaf("<IsVisitorDiscovered/>")
    rig.topics.publish(FACES, FACE)
    rig.tick()
    rig.clock.advance(rig.clock.next_due() - rig.clock.now())
    assert rig.clock.now() == pytest.approx(1002.0, abs=0.01)
    assert rig.tick() is FAILURE


@pytest.mark.parametrize("condition, topic, value, summary", [
    ("IsVisitorDiscovered", FACES, FACE, LeafSummary("visit", "", "arrived", 1000.0)),
    ("IsVisitorDiscovered", FACES, NO_FACE, LeafSummary("visit", "", "left", 1000.0)),
    ("IsMutualGazeDiscovered", ATTENTION, AttentionStatus("seeking", 1),
     LeafSummary("visit", "", "engaged", 1000.0)),
    ("IsMutualGazeDiscovered", ATTENTION, AttentionStatus("seeking", 0), None)])
def test_what_is_seen_of_the_visitor_is_told_with_its_time(condition, topic, value, summary):
    rig = one_leaf("<{}/>".format(condition))
    rig.topics.publish(topic, value)
    rig.tick()
    assert [event.summary for event in rig.of(LeafFinished)] == [summary]


def test_a_visitor_who_comes_goes_and_comes_is_reported_each_time():
    rig = one_leaf("<IsVisitorDiscovered/>")
    for faces in (NO_FACE, FACE, NO_FACE, FACE, NO_FACE):
        rig.topics.publish(FACES, faces)
        rig.tick()
    assert [event.status for event in rig.events] == ["FAILURE", "SUCCESS"] * 2 + ["FAILURE"]


@pytest.mark.parametrize("convention, state, value, result", [
    (1, "seeking", 1, SUCCESS), (1, "seeking", 2, FAILURE), (1, "seeking", 3, FAILURE),
    (1, "seeking", 0, FAILURE), (2, "seeking", 1, FAILURE), (2, "seeking", 2, SUCCESS),
    (2, "seeking", 3, FAILURE), (1, "social", 1, FAILURE), (2, "social", 2, FAILURE),
    (1, "", 1, FAILURE)])
def test_what_mutual_gaze_is(convention, state, value, result):
    rig = one_leaf("<IsMutualGazeDiscovered/>", mutualGazeValue=convention)
    rig.topics.publish(ATTENTION, AttentionStatus(state, value))
    assert rig.tick() is result


SEEK_AND_LOOK = ("<Sequence><SeekOvertAttentionMode/><IsMutualGazeDiscovered/>"
                 "<IsMutualGazeDiscovered/></Sequence>")


def searches(convention, *values):
    """Return the warnings after searches, each of which brings these values one after the other."""
    rig = one_leaf(SEEK_AND_LOOK, mutualGazeValue=convention)
    for of_one_search in values:
        rig.tick()
        for value in of_one_search:
            rig.clock.advance(0.25)
            rig.topics.publish(ATTENTION, AttentionStatus("seeking", value))
            rig.tree.nodes[2].execute()
        rig.tree.halt()
        rig.clock.advance(1.0)
    return rig.of(Noticed)


THE_ROBOTS = Noticed("warning", "/overtAttention/mode has said seeking with 2 or 3, as the robot's "
                                "own node does, where 1 is still seeking and 2 mutual gaze; if "
                                "this is such a node, set mutualGazeValue 2")
THE_DOCUMENTS = Noticed("warning", "/overtAttention/mode has said seeking with 1 in 3 searches and "
                                   "never 2 or 3, as a node of D5.4.3 does, where 1 is mutual "
                                   "gaze; if this is such a node, set mutualGazeValue 1")


@pytest.mark.parametrize("convention, values, warnings", [
    (1, [(2, ), (2, ), (3, )], [THE_ROBOTS]),
    (1, [(1, ), (0, ), (3, 3)], [THE_ROBOTS]),
    (1, [(0, 1)] * 5, []),
    (1, [(0, 7, -1)] * 5, []),
    (2, [(1, 1, 1, 1), (1, )], []),
    (2, [(1, )] * 5, [THE_DOCUMENTS]),
    (2, [(0, 1)] * 3, [THE_DOCUMENTS]),
    (2, [(0, )] * 5, []),
    (2, [(1, 2)] + [(1, )] * 5, []),
    (2, [(1, ), (1, 3), (1, ), (1, )], [])])
def test_a_sign_of_the_other_convention_is_told_once(convention, values, warnings):
    assert searches(convention, *values) == warnings


def test_a_sign_that_comes_after_the_success_is_told_at_the_next_look():
    rig = one_leaf(SEEK_AND_LOOK)
    rig.tick()
    # the robot's node: still seeking, which was taken for the gaze, then the gaze
    for value in (1, 2):
        rig.clock.advance(0.25)
        rig.topics.publish(ATTENTION, AttentionStatus("seeking", value))
        assert rig.tree.nodes[2 if value == 1 else 3].execute() is (SUCCESS
                                                                    if value == 1 else FAILURE)
    assert rig.of(Noticed) == [THE_ROBOTS]


def test_a_gaze_from_before_the_mode_was_set_is_none_and_the_next_one_wakes_the_tree():
    rig = one_leaf("<Sequence><SeekOvertAttentionMode/><IsMutualGazeDiscovered/></Sequence>")
    rig.topics.publish(ATTENTION, AttentionStatus("seeking", 1))
    rig.clock.advance(0.1)
    assert rig.tick() is FAILURE
    assert reported(rig, "IsMutualGazeDiscovered") == [
        "no gaze seen; the newest message came before"]
    rig.clock.advance(0.1)
    # the same value as before: it is its time that makes it an answer
    rig.topics.publish(ATTENTION, AttentionStatus("seeking", 1))
    assert woken(rig)


@pytest.mark.parametrize("condition, entry, topic, value", [
    ("IsMutualGazeDiscovered", "attentionSetAt", ATTENTION, AttentionStatus("seeking", 1)),
    ("IsYesNoUttered", "questionAskedAt", SPEECH, "yes")])
def test_what_comes_at_the_very_time_of_the_question_is_no_answer(condition, entry, topic, value):
    rig = one_leaf("<{}/>".format(condition))
    rig.tree.blackboard.set(entry, rig.clock.now())
    rig.topics.publish(topic, value)
    assert rig.tick() is FAILURE
    assert reported(rig, condition)[0].endswith("; the newest message came before")


QUESTION = "<Sequence><QueryTourSpeech/><IsYesNoUttered/></Sequence>"


@pytest.mark.parametrize("utterance, result, stored", [
    ("yes please", SUCCESS, "yes"), ("no", SUCCESS, "no"), ("hello", FAILURE, None),
    ("Error: noise", FAILURE, None)])
def test_an_answer_is_stored_and_what_was_heard_is_told(utterance, result, stored):
    rig = one_leaf("<IsYesNoUttered/>")
    rig.topics.publish(SPEECH, utterance)
    assert rig.tick() is result
    assert rig.tree.blackboard.get("visitorResponse") == stored
    said, = [event.summary for event in rig.of(LeafFinished)]
    mark = "unrecognised" if "Error" in utterance else stored or ""
    assert (said.kind, said.mark) == ("heard", mark)
    assert (utterance in said.text) is ("Error" not in utterance)


def test_an_utterance_from_before_the_end_of_the_question_is_no_answer():
    rig = one_leaf(QUESTION, lambda request: None)
    rig.tick()
    rig.topics.publish(SPEECH, "yes")  # the robot is still speaking
    rig.clock.advance(1.0)
    rig.gateway.calls[0].finish(Answer())
    assert rig.tick() is FAILURE
    assert [event.summary.text.partition(" ")[0] for event in rig.of(LeafFinished)
            if event.summary] == ["asked"]
    rig.clock.advance(1.0)
    rig.topics.publish(SPEECH, "hm")
    woken(rig)
    rig.topics.publish(SPEECH, "no")
    assert woken(rig)


def test_a_question_that_failed_ends_the_time_of_older_answers():
    rig = one_leaf(
        "<Sequence><ForceSuccess><QueryTourSpeech/></ForceSuccess><IsYesNoUttered/></Sequence>",
        refusal)
    rig.topics.publish(SPEECH, "yes")
    rig.clock.advance(1.0)
    assert rig.tick() is FAILURE


def test_a_retry_of_the_question_that_failed_does_so_too():
    rig = one_leaf("<Sequence><Fallback><QueryTourSpeech/><HandleFallBack/></Fallback>"
                   "<IsYesNoUttered/></Sequence>", lambda request: None)
    rig.tick()
    for text in ("yes", "no"):
        rig.clock.advance(1.0)
        rig.topics.publish(SPEECH, text)  # while the robot may be speaking
        rig.clock.advance(1.0)
        rig.gateway.calls[-1].finish(refusal(rig.gateway.requests[-1]))
        status = rig.tick()
        rig.clock.advance(1.0)
        status = rig.tick() if status is RUNNING else status
    assert len(rig.gateway.requests) == 2 and status is FAILURE


def test_the_robot_listens_as_long_as_the_condition_waits():
    rig = one_leaf("<IsYesNoUttered/>", conditionWait=3.0)
    told = []
    rig.topics.listen = lambda topic, seconds: told.append((topic, seconds))
    rig.tick()
    rig.tree.halt()
    assert told == [(SPEECH, 3.0), (SPEECH, 0.0)]
    rig.tree.halt()
    assert told[2:] == []
    rig.topics.publish(SPEECH, "no")
    rig.tick()
    assert told[2:] == [(SPEECH, 0.0)]


def test_a_wait_that_ends_with_wrong_data_leaves_no_timer():
    rig = one_leaf("<IsYesNoUttered/>", conditionWait=3.0)
    assert rig.tick() is RUNNING
    rig.tree.blackboard.set("questionAskedAt", [1])
    rig.clock.advance(1.0)
    rig.topics.publish(SPEECH, "yes")
    assert rig.tick() is FAILURE
    event, = rig.of(LeafFinished)
    assert (event.failure.cause, event.seconds, rig.clock.next_due()) == (Cause.MISSING_DATA, 1.0,
                                                                          None)


def test_a_halted_wait_begins_anew():
    rig = one_leaf("<IsVisitorDiscovered/>", conditionWait=3.0)
    rig.tick()
    rig.clock.advance(2.0)
    rig.tree.halt()
    assert rig.tree.is_idle
    assert rig.clock.next_due() is None
    assert rig.tick() is RUNNING
    rig.clock.advance(2.0)
    assert rig.tick() is RUNNING


def reported(rig, node):
    return [event.failure.message for event in rig.of(LeafFinished) if event.node == node
            and event.failure]


def test_each_round_of_a_condition_is_reported():
    rig = one_leaf("<Sequence><SeekOvertAttentionMode/><IsMutualGazeDiscovered/></Sequence>")
    for _ in range(3):
        assert rig.tick() is FAILURE
        rig.clock.advance(1.0)
    assert reported(rig, "IsMutualGazeDiscovered") == 3 * ["no gaze seen; no message has come"]


def test_a_condition_wait_that_found_nothing_is_reported():
    rig = one_leaf("<IsVisitorDiscovered/>", conditionWait=3.0)
    rig.tick()
    rig.clock.advance(3.0)
    rig.tick()
    assert reported(rig, "IsVisitorDiscovered") == ["no face seen; no message has come"]
    assert [event.seconds for event in rig.of(LeafFinished)] == [3.0]


def test_a_wait_goes_on_if_its_condition_is_false_for_another_reason():
    rig = one_leaf(
        "<ReactiveFallback><IsVisitorDiscovered/><Sleep msec='9000'/></ReactiveFallback>")
    for faces in (None, NO_FACE):
        if faces is not None:
            rig.topics.publish(FACES, faces)
            rig.clock.advance(2.5)
        assert rig.tick() is RUNNING
    assert reported(rig, "IsVisitorDiscovered") == [
        "no face seen; no message has come", "no face seen; the newest message is too old"]
    assert [(event.words, event.limit)
            for event in rig.of(StepStarted)] == [("waiting for a visitor", 9.0)]


def test_a_waiting_condition_is_reported_once():
    rig = one_leaf("<IsVisitorDiscovered/>")
    for _ in range(5):
        assert rig.tick() is FAILURE
    assert len([event for event in rig.events if type(event).__name__ == "LeafFinished"]) == 1


# ---------------------------------------------------------------------- utterances: none is skipped


ASKED = ("<Sequence><QueryTourSpeech/><Sleep "
         "msec='1000'/><IsYesNoUttered/><IsVisitorResponseYes/></Sequence>")


def hear(rig, *utterances):
    for utterance in utterances:
        rig.clock.advance(0.001)
        rig.topics.publish(SPEECH, utterance)


@pytest.mark.parametrize("utterances, result", [
    (("yes", "where is the toilet"), SUCCESS), (("hm", "yes", "hm"), SUCCESS),
    (("yes", "no"), SUCCESS), (("no", "yes"), FAILURE), (("hm", "what") * 10, FAILURE),
    (("yes",) + ("hm",) * 99, SUCCESS)])
def test_the_first_answer_among_the_utterances_since_the_question_counts(utterances, result):
    rig = one_leaf(ASKED, answer=lambda request: None)
    hear(rig, "no")
    rig.tick()
    hear(rig, "no")  # while the robot asks
    rig.gateway.calls[0].finish(Answer())
    rig.tick()
    hear(rig, *utterances)
    rig.clock.advance(1.0)
    assert rig.tick() is result


def test_why_an_answer_is_ignored_is_known_at_each_time():
    rig = one_leaf(
        "<Sequence><Sleep msec='1000'/><QueryTourSpeech/><Sleep msec='1000'/><IsYesNoUttered/>"
        "<Sleep msec='1000'/></Sequence>", answer=lambda request: None)
    seen = []

    def step(act):
        act()
        rig.tick()
        seen.append(rig.topics.ignoring.get(SPEECH))

    step(lambda: rig.tree.setup(mission=rig.mission) or rig.mission.begin_visit(
        rig.tree.blackboard, rig.clock.now()))
    step(lambda: rig.clock.advance(1.1))
    step(lambda: rig.gateway.calls[0].finish(Answer()))
    step(lambda: rig.clock.advance(1.1) or hear(rig, "yes"))
    assert seen == [NOT_ASKED, BEFORE_QUESTION, "", NOT_ASKED]


def test_where_answers_are_listened_to_they_count_without_a_question_before():
    rig = one_leaf("<Sequence><IsYesNoUttered/><QueryTourSpeech/></Sequence>")
    rig.tree.setup(mission=rig.mission)
    rig.mission.begin_visit(rig.tree.blackboard, rig.clock.now())
    assert rig.topics.ignoring[SPEECH] == NOT_ASKED
    assert rig.tick() is FAILURE and rig.topics.ignoring[SPEECH] == ""


def test_without_a_question_in_the_mission_no_answer_is_ignored():
    rig = one_leaf("<IsYesNoUttered/>")
    rig.tick()
    rig.mission.begin_visit(rig.tree.blackboard, rig.clock.now())
    hear(rig, "yes")
    rig.tick()
    assert not rig.topics.ignoring.get(SPEECH)


def test_a_mission_that_is_reloaded_without_a_question_ignores_no_answer():
    before = one_leaf("<Sequence><QueryTourSpeech/><IsYesNoUttered/></Sequence>")
    before.tree.setup(mission=before.mission)
    before.mission.begin_visit(before.tree.blackboard, before.clock.now())
    assert before.topics.ignoring[SPEECH] == NOT_ASKED
    rig = one_leaf("<IsYesNoUttered/>")
    rig.mission.topics = before.topics
    rig.mission.begin_visit(rig.tree.blackboard, rig.clock.now())
    assert not before.topics.ignoring[SPEECH]
