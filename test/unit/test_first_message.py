"""The first message of another package's state: waited for as long as a message counts, once."""
import pytest

from behavior_controller import leaves
from behavior_controller.bt.values.status import FAILURE, RUNNING, SUCCESS
from behavior_controller.extend import Evidence, TopicCondition, leaf_spec
from behavior_controller.missions.replay import replay
from behavior_controller.robot.d543 import FACES, SPEECH
from behavior_controller.robot.requests import Faces
from behavior_controller.run.events import Line, LeafFinished, StepStarted
from behavior_controller.run.history import Run
from behavior_controller.run.record.reader import read_record
from behavior_controller.run.story import how_it_ended
from mission_rig import NO_TIMER, WOKEN, FileRecord, follow, one_leaf, written

FACE, NO_FACE = Faces(("7",), (False,)), Faces((), ())
NO_MESSAGE = "Seen: no message on /faceDetection/data yet"
MAX_AGE = 2.0  # topicMaxAge, its default


@pytest.fixture(autouse=True)
def conditions(monkeypatch):
    """Conditions of another package, one on a state and one on events."""
    seen = Evidence(FACES, lambda faces, gaze_value: bool(faces.labels))
    said = Evidence(SPEECH, lambda text, gaze_value: bool(text))
    types = leaves.registry()
    types.extend([
        leaf_spec(name, type(name, (TopicCondition,), dict({"own_evidence": evidence}, **more)), "")
        for name, evidence, more in (("Seen", seen, {}), ("Said", said, {}),
                                     ("Near", seen, {"otherwise": "nobody is near"}))])
    monkeypatch.setattr(leaves, "registry", lambda: types)


def messages(rig):
    return [event.failure.message for event in rig.of(LeafFinished) if event.failure]


@pytest.mark.parametrize("faces, result", [(FACE, SUCCESS), (NO_FACE, FAILURE)])
def test_the_first_message_answers_and_wakes_the_tree(faces, result):
    rig = one_leaf("<Seen/>")
    assert rig.tick() is RUNNING
    assert [event.limit for event in rig.of(StepStarted)] == [MAX_AGE]
    rig.tree.wake.test_and_clear()
    rig.clock.advance(0.5)
    rig.topics.publish(FACES, faces)
    assert rig.tree.wake.test_and_clear()
    assert rig.tick() is result
    assert messages(rig) == ([] if result is SUCCESS else ["Seen does not hold"])


@pytest.mark.parametrize("mission, given, steps, told", [
    # no second time
    ("<Seen/>", {}, [RUNNING, 1.9, RUNNING, 0.2, WOKEN, FAILURE, FAILURE, NO_TIMER, FACE, SUCCESS],
     [NO_MESSAGE]),
    # all conditions on a topic together
    ("<Fallback><Seen/><Near/></Fallback>", {}, [RUNNING, 2.1, FAILURE],
     [NO_MESSAGE, NO_MESSAGE.replace("Seen", "Near")]),
    # what has become too old is not waited for
    ("<Near/>", {}, [FACE, 2.1, FAILURE], ["nobody is near; the newest message is too old"]),
    ("<Seen/>", {"topicMaxAge": 0.5}, [RUNNING, 0.6, FAILURE], [NO_MESSAGE]),
    ("<Seen/>", {"conditionWait": 5.0}, [RUNNING, 4.9, RUNNING, 0.2, FAILURE], [NO_MESSAGE])])
def test_without_a_message_it_waits_so_long_and_says_so(mission, given, steps, told):
    rig = one_leaf(mission, **given)
    follow(rig, FACES, steps)
    assert messages(rig) == told


@pytest.mark.parametrize("mission", ["<Said/>", "<IsVisitorDiscovered/>"])
def test_events_and_the_conditions_of_the_document_answer_at_once(mission):
    assert one_leaf(mission).tick() is FAILURE


def test_a_guard_waits_before_what_it_guards_begins():
    guard = "<ReactiveSequence><Seen/><WelcomeSpeech/></ReactiveSequence>"
    rig = one_leaf(guard, answer=lambda request: None)
    assert rig.tick() is RUNNING
    assert not rig.requests
    rig.topics.publish(FACES, FACE)
    assert rig.tick() is RUNNING
    assert len(rig.requests) == 1
    rig = one_leaf("<ReactiveFallback><Near/><WelcomeSpeech/></ReactiveFallback>")
    assert rig.tick() is RUNNING
    rig.topics.publish(FACES, FACE)
    assert rig.tick() is SUCCESS
    assert not rig.requests


def test_halted_it_leaves_no_timer():
    rig = one_leaf("<Seen/>")
    rig.tick()
    rig.tree.halt()
    assert rig.clock.next_due() is None


def test_the_end_of_the_visit_says_that_no_message_has_come():
    rig = one_leaf("<Seen/>")
    assert rig.run(lambda rig: rig.clock.advance(MAX_AGE)) == 3
    run = Run([Line(0.0, event) for event in rig.events])
    assert how_it_ended(run.visits[-1]) == NO_MESSAGE


@pytest.mark.parametrize("at", [1, 5])
def test_the_wait_is_replayed(tmp_path, at):
    rig, moments = one_leaf("<Seen/>"), []
    record = FileRecord(str(tmp_path)).open()
    rig.mission.events.subscribe(record)
    record.show(rig.tree)
    rig.mission.topics = record.topics(rig.topics)
    rig.mission_file = "m.xml"

    def pass_time(rig):
        moments.append(rig.clock.now())
        rig.clock.advance(0.5)
        if len(moments) == at:
            rig.topics.publish(FACES, FACE)

    rig.run(pass_time)
    replayed = replay(read_record(written(record)))
    assert replayed.passes == 1 and not replayed.divergence
