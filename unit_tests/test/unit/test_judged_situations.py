"""The judge of small missions, each made for one situation that no delivered mission meets: a sound
controller passes, and what is changed in its record is objected to."""
import re
from unittest import mock

import pytest
from msgspec.structs import replace

from behavior_controller.bt.loader.document import parse
from behavior_controller.config import phrases, recovery_policy, settings
from behavior_controller.run.events import (
    Answered, Asked, EntriesWritten, HealthChanged, LeafFinished, Line, Message, PassFinished,
    PassStarted, Recovered, RunStarted, SafeStateReported, RecognitionPending, StopChanged,
    Suspended,
    Tick, TreeShown)
from behavior_controller.run.history import Run
from behavior_controller.missions.replay import replay
from behavior_controller.robot.gateway import Cause, Failure
from behavior_controller.robot.requests import (
    Answer, GoTo, PerformGesture, Prompt, QueryKnowledge, Say, SetAnimation, SetAttention, SetPose,
    SetRecognition, SetRecognitionLanguage)
from behavior_controller.text import Source
from behavior_controller.simulation import virtual_robot
from behavior_controller.simulation.rehearsal.play import LoadedMission
from behavior_controller.simulation.virtual_robot import VirtualTopics

from unit_tests.judge import numbers, reference
from unit_tests.judge.failures import failure_rows
from unit_tests.judge.verdict import Verdict

from plays import (
    MISSION, RELEASE, changed, facts, from_then_on, of_mission, of_test_with, with_event)

def policy(text):
    """Have the missions read this recovery policy."""
    def load(path, specs):
        return recovery_policy.read(Source(path, text), specs)
    return mock.patch.object(recovery_policy, "load", load)


def objections(of_test):
    return Verdict(of_test).objections


def ends(of_test, node):
    """Return how a node ended, each time."""
    return [line.event.status for line in of_test.run.lines
            if isinstance(line.event, LeafFinished) and line.event.node == node]


def times(of_test, kind):
    """Return the events of a kind and their times."""
    return [(line.time, line.event) for line in of_test.run.lines if isinstance(line.event, kind)]


# ----------------------------------------------------------------------------- causes of recoveries


SEEN = ("<ReactiveFallback><IsVisitorDiscovered/><ForceFailure><Sleep msec='60000'/></ForceFailure>"
        "</ReactiveFallback>")


@pytest.mark.slow
@pytest.mark.parametrize("steps, node, cause", [
    (f"<Timeout msec='30000'><Sequence>{SEEN}{'<WelcomeSpeech/>' * 30}</Sequence></Timeout>",
     "WelcomeSpeech", Cause.NO_ANSWER),
    (f"<Timeout msec='30000'><Sequence>{SEEN}<Sleep msec='60000'/></Sequence></Timeout>", "Timeout",
     Cause.NO_ANSWER),
    (f"<Sequence>{SEEN}<Parallel><Sequence><Sleep msec='1000'/><Script code='@open := false'/>"
     "<AlwaysSuccess/></Sequence><ReactiveSequence><ScriptCondition code='@open'/><Navigate "
     "target='1;2;3'/></ReactiveSequence></Parallel></Sequence>", "ScriptCondition",
     Cause.CONDITION_FALSE),
    (f"<Sequence>{SEEN}<IsVisitorResponseYes/></Sequence>", "IsVisitorResponseYes",
     Cause.CONDITION_FALSE),
    ("<Timeout msec='3000'><RetryUntilSuccessful num_attempts='-1'><Sequence><Sleep msec='500'/>"
     "<IsVisitorResponseYes/></Sequence></RetryUntilSuccessful></Timeout>", "IsVisitorResponseYes",
     Cause.CONDITION_FALSE)])
def test_a_recovery_is_judged_by_the_failure_that_led_to_it(steps, node, cause):
    of_test = of_mission(f"<Script code='@open := true'/><Fallback>{steps}<HandleFallBack/>"
                         "</Fallback>", call_times="real")
    decided = [event for _, event in times(of_test, Recovered)]
    assert [(event.node, event.failure.cause) for event in decided] == [(node, cause)]
    assert objections(of_test) == ()
    other = replace(decided[0], node="IsVisitorDiscovered",
                    failure=Failure(Cause.CONDITION_FALSE, "no face seen"))
    assert objections(with_event(of_test, decided[0], other)) != ()


# ------------------------------------------------------------------------------------- interruption


SPEECH_HALTED = '<Timeout msec="500"><WelcomeSpeech/></Timeout>'
UNANSWERED = ["textToSpeech:1:unanswered"]


def test_a_request_that_is_halted_ends_and_its_answer_is_awaited_no_more():
    of_test = of_mission(SPEECH_HALTED, UNANSWERED)

    def at_the_tick(line):
        """The timer was due just after the wait for it, so that the traversal ran it."""
        if isinstance(line.event, Tick) and line.event.changes[:1] == [(3, "F")]:
            line = replace(line, event=replace(line.event, changes=[(4, "-"), *line.event.changes]))
        return [line]
    assert ends(of_test, "WelcomeSpeech") == ["IDLE"]
    for each in (of_test, changed(of_test, at_the_tick)):
        assert objections(each) == ()
        assert str(replay(list(each.run.lines))).startswith("the same path: 1 pass")
    assert changed(of_test, at_the_tick).run.lines != of_test.run.lines
    silent = changed(of_test, lambda line: [] if isinstance(line.event, LeafFinished)
                     and line.event.status == "IDLE" else [line])
    assert "WelcomeSpeech ended with IDLE; on record is nothing" in objections(silent)[0]


SCRIPT_FAILS = '<Script code="n := nowhere + 1"/>'
TWO_PASSES = {"mission_runs": 2}


def test_a_crash_ends_each_call_at_its_node():
    of_test = of_mission(
        '<Parallel success_count="2" failure_count="1"><ForceSuccess><WelcomeGesture/>'
        '</ForceSuccess><ForceSuccess><Sequence><Sleep msec="1500"/><GoodbyeGesture/></Sequence>'
        '</ForceSuccess></Parallel>', ["gestureExecution:2:crash"], call_times="real")
    assert {failed.node: failed.failure.cause for failed in of_test.run.failures} == dict.fromkeys(
        ["WelcomeGesture", "GoodbyeGesture"], Cause.CONNECTION_LOST)
    assert objections(of_test) == ()


@pytest.mark.parametrize("beside", [
    "<WelcomeSpeech/>", '<WelcomeSpeech/><Sleep msec="1000" _onHalted="halted := 1"/>',
    # what is halted after one that fails is halted too
    '<Sleep msec="1000" _onHalted="halted := nowhere"/><WelcomeSpeech/>'])
def test_a_script_that_fails_ends_the_pass_and_what_runs_beside_it(beside):
    of_test = of_mission(f"<Parallel>{beside}{SCRIPT_FAILS}</Parallel>", **TWO_PASSES)
    assert [visit.outcome for visit in of_test.run.visits] == ["FAILURE", "FAILURE"]
    assert ends(of_test, "WelcomeSpeech") == ["IDLE", "IDLE"]
    text, = objections(of_test)
    assert text.startswith("the controller reports an error: ") and "nowhere" in text
    silent = changed(of_test, lambda line: [] if isinstance(line.event, LeafFinished)
                     and line.event.status == "IDLE" else [line])
    assert "WelcomeSpeech ended with IDLE; on record is nothing" in objections(silent)[1]
    assert str(replay(list(of_test.run.lines))).startswith("the same path: 2 passes")


def test_a_retry_that_its_precondition_ends_makes_no_attempt():
    of_test = of_mission("<ForceSuccess><RetryUntilSuccessful num_attempts='3' _failureIf='true'>"
                         "<AlwaysFailure/></RetryUntilSuccessful></ForceSuccess>")
    assert objections(of_test) == ()

    def attempt(line):
        if isinstance(line.event, Tick) and (4, "F") in line.event.changes:
            line = replace(line, event=replace(line.event, changes=[(5, "F"), (4, "F")]))
        return [line]
    nodes = of_test.mission.tree.nodes
    assert list(numbers.objections(changed(of_test, attempt), nodes)) == [
        f"{nodes[3].full_path} made 1 attempts that failed, of 3"]


def test_the_numbers_of_a_mission_are_those_of_its_own_part_of_the_record():
    """A node may take up another mission while it runs."""
    first, last = (of_mission(f"<Sleep msec='{milliseconds}'/>") for milliseconds in (500, 2000))
    both = last._replace(run=Run([*first.run.lines, *last.run.lines]))
    assert list(numbers.objections(both, last.mission.tree.nodes)) == []
    wrong, = numbers.objections(both, first.mission.tree.nodes)
    assert wrong.endswith("lasted 2.0 s instead of 0.5 s")


def test_a_mission_that_is_skipped_as_a_whole_ends_its_pass():
    text = MISSION.replace("<Sequence>", '<Sequence _skipIf="true">').format("START_OF_TREE", "")
    of_test = facts(on=LoadedMission(settings.defaults(), [parse(text)]), **TWO_PASSES)
    assert [event.outcome for _, event in times(of_test, PassFinished)] == ["SKIPPED", "SKIPPED"]
    assert objections(of_test) == ()


# ------------------------------------------------------------------------------------------ results


def test_a_call_that_outlasts_its_deadline_needs_no_fault_and_another_one_does():
    """The greeting is spoken in more than 1.5 s, as on a robot."""
    slow = of_mission("<WelcomeSpeech/>", chosen={"textToSpeechDeadline": 1.5}, call_times="real")
    failed, = [event for _, event in times(slow, LeafFinished) if event.status == "FAILURE"]
    assert failed.failure.cause is Cause.NO_ANSWER and objections(slow) == ()
    quick = [line._replace(seconds=0.1) if line.node == "textToSpeech" else line
             for line in slow.journal]
    waited, result = objections(slow._replace(journal=quick))
    assert "was waited for 1.5 s; it was due after 0.1 s, its deadline is 1.5 s" in waited
    assert "was carried out; on record is no-answer" in result


def test_a_node_that_refuses_what_makes_no_sense_is_objected_to_once():
    of_test = of_mission(STEP, ["textToSpeech:1"])
    refused = next(line for line in of_test.journal if line.fault)

    def objections_to(**facts_of_line):
        return objections(of_test._replace(journal=[
            line._replace(**facts_of_line) if line == refused else line
            for line in of_test.journal]))
    assert objections(of_test) == ()
    text, = objections_to(fault=None, objection="nonsense")
    assert "makes no sense: nonsense" in text
    texts = objections_to(fault="exception", objection="nonsense")
    assert len(texts) == 2 and "was made to fail (exception)" in texts[1]
    text, = objections_to(fault=None)
    assert "was carried out; its node sent refused instead of an answer" in text


@pytest.mark.parametrize("node", ["DescribeExhibitSpeech", "DescribeExhibitSpeech_1", "Navigate",
                                  "SelectExhibit", "PerformDeicticGesture"])
def test_a_node_without_its_exhibit_has_no_data(node):
    of_test = of_mission("<{}/>".format(node))
    failed, = [event for _, event in times(of_test, LeafFinished) if event.node == node]
    assert failed.failure.cause is Cause.MISSING_DATA and objections(of_test) == ()


DESCRIPTIONS = {"1": ["description1"], "2": ["description2"],
                "both": ["description1", "description2"], "3": []}


@pytest.mark.parametrize("part, written", [("1", "1"), ("2", "2"), ("both", "both"), *(
    (part, "{part}") for part in DESCRIPTIONS)])
def test_a_description_says_the_part_that_its_port_names(part, written):
    of_test = of_mission(f"""<RetrieveListOfExhibits/><SelectExhibit/>
<Script code="part := '{part}'"/><DescribeExhibitSpeech part="{written}"/>""")
    exhibit = of_test.world.knowledge.exhibits[0]
    text = " ".join(getattr(exhibit, name) for name in DESCRIPTIONS[part])
    assert [event.request.text for _, event in times(of_test, Asked)
            if isinstance(event.request, Say)] == ([text] if text else [])
    failed = [event.failure.cause for _, event in times(of_test, LeafFinished) if event.failure]
    assert failed == ([] if text else [Cause.MISSING_DATA]) and objections(of_test) == ()


@pytest.mark.parametrize("uid, place", [(1, ""), (2, " (in Sequence)"), (3, " (in Sequence)")])
def test_a_status_that_had_to_be_another_is_placed_in_its_control(uid, place):
    of_test = of_mission("<WelcomeSpeech/>")

    def failed(line):
        if isinstance(line.event, Tick):
            changes = [(number, "F" if (number, letter) == (uid, "S") else letter)
                       for number, letter in line.event.changes]
            line = replace(line, event=replace(line.event, changes=changes))
        return [line]
    assert f"had to be SUCCESS{place}; on record is " in " ".join(
        objections(changed(of_test, failed)))


NUMBERS = """<RetrieveListOfExhibits/><SelectExhibit/><IsASREnabled/><Script code="n := 1"/>
<Sleep msec="500"/><Script code="n := 2"/><Sleep msec="500"/><Script code="n := 2"/>"""


@pytest.mark.parametrize("name, number, value, words", [
    ("currentExhibit", 0, None, "SelectExhibit had to leave currentExhibit = Pepper; on record is "
     "nothing"),
    ("n", 0, None, "IsASREnabled had to leave n = 1; on record is nothing"),
    ("n", 1, None, "IsASREnabled had to leave n = 2; on record is 1, from before"),
    ("n", 2, None, "IsASREnabled had to leave n = 2; on record is 2, from before"),
    ("n", 1, "3", "IsASREnabled had to leave n = 2; on record is 3")])
def test_an_entry_is_left_as_its_writer_leaves_it(name, number, value, words):
    """Without a value it is not on record."""
    of_test = of_mission(NUMBERS)
    assert objections(of_test) == ()
    event = [event for _, event in times(of_test, EntriesWritten)
             if name in dict(event.entries)][number]
    entries = [(key, value if key == name else text) for key, text in event.entries
               if key != name or value is not None]
    wrong = with_event(of_test, event, replace(event, entries=entries))
    assert any(text.endswith(": " + words) for text in objections(wrong))


@pytest.mark.parametrize("entry, words", [
    (("m", "7"), "had to leave m = nothing; on record is 7"),
    (("n", "1"), "had to leave n = 1, from before; on record is 1")])
def test_an_entry_that_nothing_writes_is_not_on_record(entry, words):
    of_test = of_mission('<Script code="n := 1"/><Sleep msec="500"/><AlwaysSuccess/>')
    last = times(of_test, Tick)[-1][1]
    wrong = with_event(of_test, last, EntriesWritten([entry]), last)
    assert any(text.endswith(words) for text in objections(wrong))


def test_exhibits_are_counted_from_the_first_one():
    """The number of a stop is an entry that nothing has written."""
    of_test = of_mission("""<RetrieveListOfExhibits/><Repeat num_cycles="2"><Sequence>
<IsListWithExhibit nextExhibit="{mine}"/><SelectExhibit nextExhibit="{mine}"/></Sequence></Repeat>
""")
    assert [(event.name, event.number, event.state) for _, event in times(of_test, StopChanged)] \
        == [("Pepper", 1, "begun"), ("Pepper", 1, "over"), ("Robot arm", 2, "begun")]
    assert objections(of_test) == ()


@pytest.mark.parametrize("node, number", [("LookUpHome", 0), ("RetrieveInitialLocation", 0),
                                          ("LookUpEntrance", -1)])
def test_release_1_0_begins_at_its_first_stop_and_ends_at_its_last(node, number):
    of_test = of_mission(f"<{node}/>", chosen=RELEASE)
    place, = [text for _, event in times(of_test, EntriesWritten)
              for name, text in event.entries if name == "targetLocation"]
    location = of_test.mission.knowledge.tour[number].location
    assert [float(value) for value in re.findall(r"-?[\d.]+", place)] == list(location)
    assert objections(of_test) == ()


def test_release_1_0_begins_a_visit_where_its_mission_says_so():
    of_test = of_mission('<Sleep msec="500"/><StartOfTree/>', chosen=RELEASE)
    asked = [float(dict(event.entries)["questionAskedAt"])
             for _, event in times(of_test, EntriesWritten)]
    assert asked == [1000.0, pytest.approx(1000.5, abs=0.05)] and objections(of_test) == ()


# ------------------------------------------------------------------------------------------ waiting


ASKED_AGAIN = [
    '<ReactiveSequence><IsYesNoUttered/><Sleep msec="4000"/></ReactiveSequence>',
    '<ReactiveFallback><IsYesNoUttered/><Sleep msec="4000"/></ReactiveFallback>',
    '<WhileDoElse><IsYesNoUttered/><AlwaysSuccess/><Sleep msec="4000"/></WhileDoElse>',
    '<ReactiveFallback><Inverter><IsYesNoUttered/></Inverter><AlwaysSuccess/></ReactiveFallback>']
WAITS = ['<ReactiveSequence><AlwaysSuccess/><IsYesNoUttered/></ReactiveSequence>',
         '<WhileDoElse><AlwaysSuccess/><IsYesNoUttered/><AlwaysSuccess/></WhileDoElse>',
         '<Sequence><IsYesNoUttered/><AlwaysSuccess/></Sequence>']


@pytest.mark.parametrize("steps, is_asked_again", [
    *((steps, True) for steps in ASKED_AGAIN), *((steps, False) for steps in WAITS)])
def test_a_condition_waits_unless_a_reactive_control_asks_it_again(steps, is_asked_again):
    """A silent visitor is waited for 3 s, by the condition itself or not at all."""
    of_test = of_mission(steps, chosen={"conditionWait": 3.0}, visitor_behaviour="silent")
    assert objections(of_test) == ()
    began = times(of_test, Tick)[0][0]
    ended = next(line.time for line in of_test.run.lines if isinstance(line.event, LeafFinished)
                 and line.event.node == "IsYesNoUttered")
    assert ended - began == pytest.approx(0.0 if is_asked_again else 3.0, abs=0.1)


LATE_LOOK = '<QueryTourSpeech/><Sleep msec="9000"/><IsYesNoUttered/>'


def test_an_utterance_does_not_become_too_old_and_a_face_does():
    heard = of_mission(LATE_LOOK, visitor_behaviour="engages")
    arrived = times(heard, Message)[0][1].arrived
    read = [event.at for _, event in times(heard, Tick) if event.at >= arrived][0]
    assert read - arrived > settings.defaults().topic_max_age
    assert ends(heard, "IsYesNoUttered") == ["SUCCESS"] and objections(heard) == ()
    seen = of_mission("<ScanningOvertAttentionMode/><IsVisitorDiscovered/>",
                      chosen={"conditionWait": 90.0})
    assert ends(seen, "IsVisitorDiscovered") == ["SUCCESS"] and objections(seen) == ()

    def older(line):
        event = line.event
        is_face = isinstance(event, Message) and event.topic == "/faceDetection/data"
        return [replace(line, event=replace(event, arrived=event.arrived - 2.5))
                if is_face else line]
    assert "nothing more had to be; on record is IsVisitorDiscovered SUCCESS" in " ".join(
        objections(changed(seen, older)))


def hearing(seconds):
    """Have the robot hear something for so many seconds from its first question on, as one that
    hears by an action."""
    began = []

    def is_hearing(self, topic):
        began.append(self._robot.clock.now())
        is_so = began[-1] - began[0] < seconds
        if is_so:
            self._robot.note(RecognitionPending(topic.name))
        return is_so
    return mock.patch.object(VirtualTopics, "is_hearing", is_hearing)


@pytest.mark.parametrize("steps, status", [("<GetVisitorResponse/>", "SUCCESS"),
                                           ("<IsYesNoUttered/>", "FAILURE")])
def test_what_is_still_heard_is_waited_for_as_long_as_its_result_may_take(steps, status):
    """10 s to listen, and 10 s for what began within them."""
    with hearing(10.0):
        of_test = of_mission(steps, chosen=RELEASE, visitor_behaviour="silent",
                             recognise_by="action")
    assert ends(of_test, steps[1:-2]) == [status] and objections(of_test) == ()
    ticks = times(of_test, Tick)
    assert ticks[-1][0] - ticks[0][0] == pytest.approx(20.0, abs=0.1)

    late = from_then_on(ticks[-1][0] - 0.01, 5.0)
    assert any("was due 5.0 s before" in text for text in objections(changed(of_test, late)))
    by_topic = objections(of_test_with(of_test, recognise_by="topic"))
    assert any("/speechEvent/text is no action that goes on hearing" in text for text in by_topic)


@pytest.mark.parametrize("seconds", [-1.5, -0.9, 0.9, 1.5])
def test_the_clock_of_the_mission_goes_with_that_of_the_record(seconds):
    """It may be 1 s late, as on a busy machine."""
    of_test = of_mission('<Sleep msec="4000"/>')

    def wrong(line):
        event = line.event
        if isinstance(event, Tick) and event.at > 1002.0:
            event = replace(event, at=event.at - seconds)
        return [replace(line, event=event)]
    found = any(f"the mission's clock is {seconds:.1f} s wrong" in text
                for text in objections(changed(of_test, wrong)))
    assert found is (abs(seconds) > 1.0)


# -------------------------------------------------------------------------------------- substitutes


POLICY = "budget 9 60\nFollowMeSpeech * 1 0.5 {}\n* * 0 0 skip\n"
STEP = "<Fallback><FollowMeSpeech/><HandleFallBack/></Fallback>"


@pytest.mark.parametrize("substitute, more, outcome", [
    ("QueryTourSpeech", (), "substituted"), ("SocialOvertAttentionMode", (), "substituted"),
    ("SocialOvertAttentionMode", ("overtAttention:1",), "skipped")])
def test_a_substitute_does_what_its_own_node_does(substitute, more, outcome):
    with policy(POLICY.format(substitute)):
        of_test = of_mission(STEP, ["textToSpeech:1", "textToSpeech:2", *more])
    asked = [type(event.request).__name__ for _, event in times(of_test, Asked)]
    assert asked[:3] == ["Say", "Say", "Say" if substitute == "QueryTourSpeech" else "SetAttention"]
    assert [recovery.outcome for recovery in of_test.run.recoveries] == [outcome]
    assert objections(of_test) == ()


def test_each_attempt_of_a_recovery_has_its_row():
    with policy(POLICY.format("SocialOvertAttentionMode")):
        of_test = of_mission(STEP, ["textToSpeech:1", "textToSpeech:2", "overtAttention:1"])
    rows = failure_rows(Verdict(of_test))
    assert [(row.node, row.call, row.recovery) for row in rows] == [
        ("FollowMeSpeech", "textToSpeech:1", "tried again"),
        ("FollowMeSpeech", "textToSpeech:2", "SocialOvertAttentionMode instead"),
        ("SocialOvertAttentionMode", "overtAttention:1", "skipped")]


def test_a_recovery_below_another_control_deals_with_what_failed_before_that():
    of_test = of_mission("""<Fallback><FollowMeSpeech/><Sequence><HandleFallBack/>
<AlwaysSuccess/></Sequence></Fallback>""", ["textToSpeech:1"])
    assert [recovery.outcome for recovery in of_test.run.recoveries] == ["skipped"]
    assert objections(of_test) == ()


TOUR = """<RetrieveListOfExhibits/><Repeat num_cycles="7"><ForceSuccess><Fallback><Sequence>
<IsListWithExhibit/><SelectExhibit/><{}/></Sequence><HandleFallBack/></Fallback>
</ForceSuccess></Repeat>"""


@pytest.mark.parametrize("step, then, first", [
    ("Navigate", "giveUp", "given up"), ("DescribeExhibitSpeech", "skip", "skipped")])
def test_the_last_exhibit_that_is_left_goes_back_to_the_list_once(step, then, first):
    """Each request is refused: five exhibits are tried, and the last one once more. Without any
    exhibit the tour is given up."""
    node = "robotNavigation" if step == "Navigate" else "textToSpeech"
    with policy("budget 20 60\n* * 0 0 {}\n".format(then)):
        of_test = of_mission(TOUR.format(step), [f"{node}:{call}" for call in range(1, 8)])
    exhibits = of_test.world.knowledge.exhibits
    requests = [GoTo(exhibit.location) if step == "Navigate" else
                Say(" ".join(filter(None, (exhibit.description1, exhibit.description2))))
                for exhibit in exhibits]
    assert [event.request for _, event in times(of_test, Asked)
            if isinstance(event.request, (GoTo, Say))] == [*requests, requests[-1]]
    assert [recovery.outcome for recovery in of_test.run.recoveries][:6] == (
        [first] * 4 + ["given up"] * 2)
    assert objections(of_test) == ()


TWO_GIVE_UP = """<Parallel success_count="2">
<ForceSuccess><Fallback><WelcomeSpeech/><HandleFallBack/></Fallback></ForceSuccess>
<ForceSuccess><Fallback><WelcomeGesture/><HandleFallBack/></Fallback></ForceSuccess></Parallel>"""


@pytest.mark.slow
@pytest.mark.parametrize("call_times", ["none", "real"])  # at once, and one after the other
@pytest.mark.parametrize("fault, number, part", [
    ("overtAttention:1", 0, 0), ("animateBehavior:2:unanswered", 1, 1),
    ("overtAttention:3:unanswered", 2, 0)])
def test_each_report_of_the_safe_state_is_that_of_its_own_requests(call_times, fault, number, part):
    """Two recoveries give up, and the end of the run is the third to ask for the safe state."""
    with policy("budget 9 60\n* * 0 0 giveUp\n"):
        of_test = of_mission(TWO_GIVE_UP, ["textToSpeech:1", "gestureExecution:1", fault],
                             call_times=call_times)
    reports = [event for _, event in times(of_test, SafeStateReported)]
    assert [(at, place) for at, event in enumerate(reports)
            for place, reached in enumerate(event.parts) if reached.failure] == [(number, part)]
    assert objections(of_test) == ()
    failure = reports[number].parts[part].failure
    for report in reports:
        for place, reached in enumerate(report.parts):
            parts = list(report.parts)
            parts[place] = replace(reached, failure=None if reached.failure else failure)
            falsified = with_event(of_test, report, replace(report, parts=tuple(parts)))
            assert any("of the safe state is reported" in text for text in objections(falsified))


# ----------------------------------------------------------------------------- the end of a pass


@pytest.mark.parametrize("then, outcome, is_awaited", [("giveUp", "FAILURE", True),
                                                       ("skip", "SUCCESS", False)])
def test_a_pass_waits_for_what_is_gone_if_the_last_one_failed_for_it(then, outcome, is_awaited):
    """Another pass begins 1 s after a short one at the earliest."""
    with policy("budget 9 60\n* * 0 0 {}\n".format(then)):
        of_test = of_mission(STEP, ["textToSpeech:1:crash"], mission_runs=2)
    (ended, first), _ = times(of_test, PassFinished)
    began, second = times(of_test, PassStarted)[1]
    assert first.outcome == outcome and objections(of_test) == ()
    assert (began - ended > 2.0) is is_awaited
    late = from_then_on(began, 5.0)
    assert any("pass 2 was due" in text for text in objections(changed(of_test, late)))


def test_what_a_node_answers_to_the_safe_state_after_the_end_is_awaited_no_more():
    """The simulated nodes go on for a while."""
    of_test = of_mission("<WelcomeSpeech/>", ["animateBehavior:1:unanswered"])
    assert times(of_test, SafeStateReported)[0][1].parts[1].failure is not None
    last = of_test.journal[-1]
    assert objections(of_test) == ()
    more = [line for line in of_test.journal if line.node == "speechEvent" and not line.call][:1]
    assert objections(of_test._replace(journal=list(of_test.journal) + [
        line._replace(time=last.time + 30.0) for line in more])) == ()


@pytest.mark.parametrize("seconds, words", [
    (0.0, ""), (-0.2, "0.2 s too early"), (5.0, "pass 2 was due 5.0 s before")])
def test_the_pause_after_a_spent_budget_ends_with_the_time_of_its_oldest_recovery(seconds, words):
    """Of two recoveries in 12 s the older one is at 5 s, the pass ends after 9 s; the usual pause
    is 10 s."""
    with policy("budget 2 12\n* * 0 0 skip\n"):
        of_test = of_mission(f'{STEP}<Sleep msec="5000"/>{STEP}<Sleep msec="4000"/>{STEP}',
                             ["textToSpeech:1", "textToSpeech:2", "textToSpeech:3"], **TWO_PASSES)
    (ended, _), _ = times(of_test, PassFinished)
    began = times(of_test, PassStarted)[1][0]
    assert began - ended == pytest.approx(8.0, abs=0.1)
    assert (words or "()") in str(objections(changed(of_test, from_then_on(began, seconds))))


GONE = ["textToSpeech:1:crash"]


def given_up(then="", **test):
    """Return the facts of a mission that gives up a step for a service that is gone, and goes on
    with other steps then."""
    with policy("budget 9 60\n* * 0 0 giveUp\n"):
        return of_mission(f"<ForceSuccess>{STEP}</ForceSuccess>{then or '<AlwaysFailure/>'}", GONE,
                          **test)


@pytest.mark.parametrize("then", ["<AlwaysFailure/>", "<IsVisitorResponseYes/>"])
def test_a_pass_that_failed_otherwise_waits_too_for_what_it_gave_up_a_step_for(then):
    of_test = given_up(then, **TWO_PASSES)
    (ended, first), _ = times(of_test, PassFinished)
    began = times(of_test, PassStarted)[1][0]
    assert first.outcome == "FAILURE" and began - ended > 2.0 and objections(of_test) == ()
    # it begins while the service is gone
    returned, = [event for _, event in times(of_test, HealthChanged) if event.is_well]
    early = with_event(of_test, returned)
    assert any("began without a pause, and the cause of the last failure persists" in text
               for text in objections(early))


def test_a_test_that_ends_while_the_mission_waits_for_a_service_has_passed():
    of_test = given_up(test_timeout=1.5, **TWO_PASSES)
    assert of_test.has_timed_out and len(of_test.run.visits) == 1
    verdict = Verdict(of_test)
    assert verdict.passed and "it waited for the end of a cause that persists" in str(verdict)
    under_way = given_up('<Sleep msec="4000"/><AlwaysFailure/>', test_timeout=6.0, **TWO_PASSES)
    assert [event.number for _, event in times(under_way, PassStarted)] == [1, 2]
    text = str(Verdict(under_way))
    assert text.startswith("CUT OFF: the mission did not end within 6 s, and Sleep")


SHORT_PASS = 1.0
"""Seconds from the end of a short pass to the next one, and to its pause."""


@pytest.mark.slow
def test_the_pause_after_passes_that_fail_for_a_spent_budget_doubles_until_one_succeeds():
    """10 s at first and 25 s at most; the first pass spends the budget."""
    with policy("budget 1 600\npause 10 25\n* * 0 0 giveUp\n"):
        of_test = of_mission(STEP, ["textToSpeech:{}".format(call) for call in (1, 2, 3, 4, 6)],
                             mission_runs=7)
    ended = [(time, event.outcome) for time, event in times(of_test, PassFinished)]
    began = [time for time, _ in times(of_test, PassStarted)]
    assert [outcome for _, outcome in ended] == ["FAILURE"] * 4 + ["SUCCESS", "FAILURE", "SUCCESS"]
    gaps = [begin - end - SHORT_PASS for begin, (end, _) in zip(began[1:], ended)]
    assert gaps == pytest.approx([0.0, 10.0, 20.0, 25.0, 0.0, 10.0], abs=0.01)
    verdict = Verdict(of_test)
    assert verdict.passed and "the budget of recoveries was spent" in str(verdict)
    for number, begin in enumerate(began[1:], 2):
        early = objections(changed(of_test, from_then_on(begin, -0.1)))
        assert any(f"after pass {number - 1}: " in text and "0.1 s too early" in text
                   for text in early)
        late = objections(changed(of_test, from_then_on(begin, 1.5)))
        assert any(f"pass {number} was due 1.5 s before" in text for text in late)


# ---------------------------------------------------------------------------- what an operator does


def due(of_test):
    """Return the objections to what came too late."""
    return tuple(text for text in objections(of_test)
                 if re.search(r" was due [\d.]+ s before$", text))


def held(of_test, at, seconds, late=0.0):
    """Return facts of a run that was held at a time for so many seconds, and went on some seconds
    too late."""
    def hold(line):
        if line.time >= at and not begun:
            begun.append(line)
            yield Line(at, Suspended("an operator holds it"))
            yield Line(at + seconds, Suspended(""))
        yield from from_then_on(at, seconds + late)(line)
    begun = []
    return changed(of_test, hold)


@pytest.mark.parametrize("place", ["between two steps", "between two passes"])
def test_a_run_that_is_held_goes_on_as_soon_as_it_is_let_go(place):
    of_test = of_mission('<Sleep msec="500"/><Sleep msec="500"/>', chosen={"rosInterface": True},
                         **TWO_PASSES)
    at = times(of_test, PassStarted)[1][0] if "passes" in place else 6000.7
    assert objections(of_test) == () == due(held(of_test, at, 30.0))
    assert due(changed(of_test, from_then_on(at, 30.0))) != ()
    text, = due(held(of_test, at, 30.0, 2.0))
    assert ": the mission was due " in text


def test_a_run_that_nobody_can_hold_is_not_held():
    of_test = held(of_mission('<Sleep msec="1000"/>'), 6000.7, 30.0)
    assert any("an operator holds it, and there is no way to ask for that" in text
               for text in objections(of_test))


# -------------------------------------------------------------------------- what is on record amiss


@pytest.mark.parametrize("change", [{"uid": 0}, {"uid": 5}, {"uid": 4}, {"node": "FollowMeSpeech"},
                                    {"path": "x"}, {"uid": -1}])
def test_an_end_is_on_record_with_the_number_path_and_type_of_its_node(change):
    """The mission has four nodes."""
    of_test = of_mission("<WelcomeSpeech/><WelcomeGesture/>")
    ended, = [event for _, event in times(of_test, LeafFinished) if event.node == "WelcomeSpeech"]
    wrong = replace(ended, **change)
    found = objections(with_event(of_test, ended, wrong))
    assert any(f": node {wrong.uid} is not {wrong.node} {wrong.path}" in text for text in found)


@pytest.mark.parametrize("seconds", [-1.25, -0.9, 0.9, 1.25])
def test_a_pass_lasts_as_long_as_its_clock_says(seconds):
    of_test = of_mission('<Sleep msec="3000"/>')

    end = times(of_test, PassFinished)[0][1]
    other = with_event(of_test, end, replace(end, seconds=end.seconds + seconds))
    found = any(f"the pass took 3.0 s; on record are {3 + seconds:.1f} s" in text
                for text in objections(other))
    assert found is (abs(seconds) > 1.0)


@pytest.mark.parametrize("seconds, is_wrong", [(-0.1, True), (0.0, False), (0.9, False),
                                               (1.1, True)])
def test_the_first_step_of_a_pass_comes_within_a_second(seconds, is_wrong):
    """By the mission's clock."""
    of_test = of_mission("<WelcomeSpeech/>")
    first = times(of_test, Tick)[0][1]
    later = changed(of_test, from_then_on(times(of_test, PassStarted)[0][0], 5.0))
    assert any("the first pass was due 5.0 s before" in text for text in objections(later))

    begun = times(of_test, PassStarted)[0][1]
    found = objections(with_event(of_test, begun, replace(begun, at=first.at - seconds)))
    words = f"the pass began at {first.at - seconds:.1f} s, its first step came at {first.at:.1f} s"
    assert any(words in text for text in found) is is_wrong


def test_before_the_first_pass_nothing_is_asked():
    of_test = of_mission("<WelcomeSpeech/>")
    asked = times(of_test, Asked)[0][1]

    begun = times(of_test, PassStarted)[0][1]
    sooner = with_event(with_event(of_test, asked), begun, asked, begun)
    assert any("before the pass nothing is due; what was asked: saying “Hello, " in text
               for text in objections(sooner))


def test_a_request_in_the_middle_of_a_step_is_placed_after_the_one_before():
    of_test = of_mission("<WelcomeSpeech/>")
    asked = times(of_test, Asked)[0][1]
    more = replace(asked, call=asked.call + 90, request=Say("Psst"))
    found = objections(with_event(of_test, asked, asked, more))
    assert any("after WelcomeSpeech, while WelcomeSpeech goes on, nothing more was due; what was "
               "asked: saying “Psst”" in text for text in found)
    again = objections(with_event(of_test, asked, asked, replace(more, request=asked.request)))
    assert any(text.endswith("”, as WelcomeSpeech did before") for text in again)


def test_what_was_due_is_placed_after_the_leaf_that_ended_in_the_same_step():
    of_test = of_mission("<WelcomeSpeech/>")
    silent = changed(of_test, lambda line: [] if isinstance(line.event, Asked) else [line])
    assert ": after START_OF_TREE, WelcomeSpeech was due: saying “Hello" in objections(silent)[0]
    first = changed(of_mission("<AlwaysSuccess/>"), lambda line: [
        replace(line, event=replace(line.event, changes=[(1, "S")]))
        if isinstance(line.event, Tick) else line])
    assert "0.0 s: Sequence of START_OF_TREE had to be RUNNING; on record is Sequence of " \
        "START_OF_TREE SUCCESS" in objections(first)[0]


def test_what_was_to_come_after_the_record_of_a_step_ends_is_named():
    of_test = of_mission("<AlwaysSuccess/>")
    last = times(of_test, Tick)[-1][1]
    shorter = with_event(of_test, last, replace(last, changes=last.changes[:-1]))
    assert "had to be SUCCESS; on record is nothing" in objections(shorter)[0]
    foreign = with_event(of_test, last, replace(last, changes=[*last.changes, (9, "S")]))
    assert "nothing more had to be; on record is node 9 SUCCESS" in objections(foreign)[0]


def test_a_step_that_has_changed_something_is_followed_by_the_next_one_at_once():
    """Though the timer that it set is due later."""
    of_test = of_mission('<Sleep msec="9000"/>')
    second = times(of_test, Tick)[1][1]
    late = changed(of_test, lambda line: [
        Line(line.time + 5.0, replace(second, at=second.at + 5.0))
        if line.event is second else line])
    assert re.match(r"pass 1, 5\.0 s: Sleep\S* was due 5\.0 s before$", objections(late)[0])


@pytest.mark.slow
def test_what_is_due_at_the_end_of_a_test_is_no_wait_for_the_visitor():
    of_test = of_mission('<Parallel><IsYesNoUttered/><Sleep msec="30000"/></Parallel>',
                         chosen={"conditionWait": 3000.0}, visitor_behaviour="silent",
                         test_timeout=900.0)
    cut_off = of_test.cut_off
    assert of_test.has_timed_out and Verdict(of_test).passed  # it has waited for long enough
    lines = [line for line in of_test.run.lines if line.time < 6020.0]
    waiting = Verdict(of_test._replace(run=Run(lines), journal=[
        line for line in of_test.journal if line.time < 6020.0]))
    assert str(waiting).startswith(f"CUT OFF: {cut_off}, and IsYesNoUttered")
    overdue, ending = objections(of_test._replace(run=Run(lines)))
    assert " was due " in overdue and ending == cut_off


SPEECHES = """<RetrieveListOfExhibits/><SelectExhibit/><SayText name="1"/>
<DescribeExhibitSpeech_1/><PerformIconicGesture name="welcome"/>"""


@pytest.mark.parametrize("chosen, faults, waits", [
    ({"waitForSpeech": "none"}, (), (False, False)),
    ({"waitForSpeech": "descriptions"}, (), (False, True)),
    ({"waitForSpeech": "all"}, (), (True, True)),
    ({"waitForSpeech": "all"}, ["textToSpeech:1"], (False, True)),
    ({"waitForSpeech": "all"}, ["textToSpeech:2"], (True, False))])
def test_the_speech_of_release_1_0_is_waited_for_as_long_as_it_takes(chosen, faults, waits):
    """In English it answers at once; a word takes half a second here."""
    steps = "".join(f"<ForceSuccess>{step}/></ForceSuccess>" for step in SPEECHES.split("/>")[:-1])
    text = MISSION.format("StartOfTree", steps)
    on = settings.defaults(**RELEASE, speechPace=2.0, **chosen)
    of_test = facts(faults, on=LoadedMission(on, [parse(text)]))
    asked = [(time, event.request) for time, event in times(of_test, Asked)][1:4]
    gaps = [later - time for (time, _), (later, _) in zip(asked, asked[1:])]
    seconds = [len(request.text.split()) / 2.0 for _, request in asked[:2]]
    assert gaps == pytest.approx([length * is_waited for length, is_waited in zip(seconds, waits)],
                                 abs=0.1)
    assert objections(of_test) == ()


# -------------------------------------------------------------------------------- several missions


def test_a_mission_may_be_replaced_before_its_first_pass():
    of_test = of_mission("<WelcomeSpeech/>")
    lines = of_test.run.lines
    begun = [isinstance(line.event, PassStarted) for line in lines].index(True)
    assert objections(of_test._replace(run=Run(lines[:begun] + lines))) == ()


def test_what_is_on_record_before_the_mission_begins_is_not_judged():
    of_test = of_mission("<WelcomeSpeech/>")
    lines = of_test.run.lines
    begun = [isinstance(line.event, (TreeShown, RunStarted)) for line in lines].index(True)
    earlier = [Line(line.time - 100.0, line.event) for line in lines[begun:]
               if not isinstance(line.event, (TreeShown, RunStarted))]
    unjudged = of_test._replace(run=Run(earlier + lines))
    assert Verdict(unjudged).execution.difference == ""


# -------------------------------------------------------------------------------- nodes one by one


def failures(of_test):
    """Return the nodes that failed and why, and the requests before the end of the run."""
    failed = [(event.node, event.failure.cause.value)
              for _, event in times(of_test, (LeafFinished, Recovered)) if event.failure is not None
              and (isinstance(event, LeafFinished) or event.node in reference.HANDLERS)]
    return failed, [event.request for _, event in times(of_test, Asked)][:-2]


def forced(*steps):
    return "".join(f"<ForceSuccess>{step}</ForceSuccess>" for step in steps)


@pytest.mark.parametrize("steps, faults, expected", [
    # nothing before it has failed, in its scope and since it was run last
    ("<HandleFallBack/>", [], ["missing-data"]),
    (forced("<WelcomeSpeech/>", "<Fallback><AlwaysFailure/><HandleFallBack/></Fallback>"),
     ["textToSpeech:1"], ["refused", "missing-data"]),
    ('<Repeat num_cycles="3">' + forced("<Fallback><Inverter><WelcomeSpeech/></Inverter>"
                                        "<HandleFallBack/></Fallback>") + "</Repeat>",
     ["textToSpeech:1"], ["refused", "missing-data", "missing-data"]),
    # behind the last exhibit
    ('<RetrieveListOfExhibits/><Repeat num_cycles="6"><SelectExhibit/></Repeat>', [],
     ["missing-data"]),
    # without a place to point or to look at, nothing is asked
    ("""<Script code="t := '0;0;0'"/><PerformDeicticGesture target="{t}"/>
<LocationOvertAttentionMode target="{t}"/>""", [], []),
    ("<LookUpHome/>" + forced("<PerformDeicticGesture/>", "<LocationOvertAttentionMode/>"), [],
     ["missing-data", "missing-data"])])
def test_a_node_without_what_it_needs_asks_nothing(steps, faults, expected):
    of_test = of_mission(steps, faults)
    failed, requests = failures(of_test)
    assert [cause for _, cause in failed] == expected and objections(of_test) == ()
    assert {type(request) for request in requests} <= {Say, QueryKnowledge}


def test_a_recovery_without_a_failure_before_it_says_so():
    of_test = of_mission("<HandleFallBack/>")
    silent = changed(of_test, lambda line: [] if isinstance(line.event, Recovered) else [line])
    assert any("HandleFallBack ended with missing-data; on record is FAILURE although it did not "
               "fail" in text for text in objections(silent))


@pytest.mark.parametrize("step, is_left_out", [
    ("<SelectExhibit/><FollowMeSpeech/>", True), ("<FollowMeSpeech/><SelectExhibit/>", False),
    ("<SelectExhibit/><LookUpHome/><FollowMeSpeech/>", False)])
def test_an_exhibit_is_left_out_if_the_robot_is_on_its_way_to_it(step, is_left_out):
    with policy("budget 9 60\n* * 0 0 skip\n"):
        of_test = of_mission(f"""<RetrieveListOfExhibits/><Fallback><Sequence>{step}</Sequence>
<HandleFallBack/></Fallback>""", ["textToSpeech:1"])
    assert [recovery.outcome for recovery in of_test.run.recoveries] == ["skipped"]
    states = [event.state for _, event in times(of_test, StopChanged)]
    assert ("omitted" in states) is is_left_out and objections(of_test) == ()


@pytest.mark.parametrize("away, asked", [(2.0, 2.0), (40.0, 15.5)])
def test_a_retry_of_what_must_not_be_left_out_waits_15_s_for_its_service(away, asked):
    with policy("budget 9 60\nFollowMeSpeech * 1 0.5 giveUp\n* * 0 0 skip\n"), mock.patch.object(
            virtual_robot, "AWAY", away):
        of_test = of_mission(STEP, GONE)
    first, second = [time for time, event in times(of_test, Asked)
                     if isinstance(event.request, Say)]
    assert second - first == pytest.approx(asked, abs=0.3) and objections(of_test) == ()


@pytest.mark.parametrize("number, phrase", list(enumerate((
    "PressYesNoSpeech", "FollowMeSpeech", "MaybeAnotherTimeSpeech", "WelcomeSpeech",
    "QueryTourSpeech", "HereIsTheDoorSpeech", "SayGoodByeSpeech", ""), start=1)))
def test_a_robot_without_utility_phrases_says_the_speeches_that_mean_the_same(number, phrase):
    of_test = of_mission(f'<SayText name="{number}"/>')
    failed, requests = failures(of_test)
    assert requests == ([Say(phrases.load("English").speeches[phrase])] if phrase else [])
    assert failed == ([] if phrase else [("SayText", "missing-data")])
    assert objections(of_test) == ()


@pytest.mark.parametrize("steps, requests", [
    ('<SetSpeechEvent name="true"/><SetSpeechEvent name="false"/>',
     [SetRecognition(True), SetRecognition(False)]),
    ('<SetSpeechEvent name="enabled"/><SetSpeechEvent name="disabled"/>',
     [SetRecognition(True), SetRecognition(False)]),
    ('<PerformIconicGesture name="welcome"/><PerformIconicGesture name="goodbye"/>',
     [PerformGesture("iconic", 1, 3000), PerformGesture("iconic", 3, 3000)]),
    ('<SetOvertAttentionMode name="social"/><SetAnimateBehavior name="enabled"/>',
     [SetAttention("social"), SetAnimation("enabled")])])
def test_a_node_of_release_1_0_goes_by_its_argument(steps, requests):
    of_test = of_mission(steps, chosen=RELEASE)
    assert failures(of_test) == ([], [SetRecognitionLanguage("English"), *requests])
    assert objections(of_test) == ()


def test_a_robot_of_release_1_0_is_where_its_tour_begins():
    of_test = of_mission("<RetrieveListOfExhibits/><SetRobotPose/>", chosen=RELEASE)
    assert failures(of_test)[1][1:] == [SetPose(of_test.mission.knowledge.tour[0].location)]
    assert objections(of_test) == ()
    without = of_mission("<SetRobotPose/>", chosen=RELEASE)
    assert failures(without)[0] == [("SetRobotPose", "missing-data")]
    assert objections(without) == ()


@pytest.mark.parametrize("behaviour", ["noGaze", "engages"])
def test_a_gaze_that_release_1_0_has_given_up_is_waited_for_no_more(behaviour):
    of_test = of_mission('<SetOvertAttentionMode name="seeking"/><IsMutualGazeDiscovered/>',
                         chosen=RELEASE, visitor_behaviour=behaviour, test_timeout=900.0)
    assert ends(of_test, "IsMutualGazeDiscovered") == [
        "FAILURE" if behaviour == "noGaze" else "SUCCESS"]
    assert objections(of_test) == ()


def test_a_pass_that_failed_for_another_type_of_service_is_followed_by_a_pause():
    """Of 10 s, after 1 s for a short pass."""
    with policy("budget 9 60\n* * 0 0 giveUp\n"):
        of_test = of_mission(STEP, ["textToSpeech:1"], **TWO_PASSES)

    def other(line):
        event = line.event
        for name in ("result", "failure"):
            failure = getattr(event, name, None)
            if isinstance(failure, Failure):
                event = replace(event, **{name: Failure(Cause.TYPE_MISMATCH, failure.message,
                                                        failure.resource)})
        return [replace(line, event=event)]
    mistyped, began = changed(of_test, other), times(of_test, PassStarted)[1][0]
    assert any("10.0 s too early" in text for text in objections(mistyped))
    later = objections(changed(mistyped, from_then_on(began, 10.0)))
    assert not any("too early" in text or "was due" in text for text in later)


NO_PRESS = Failure(Cause.REFUSED, "-", "/tabletEvent/prompt_and_get_response")


@pytest.mark.parametrize("chosen, behaviour, faults, result", [
    ({}, "engages", [], Answer(response="Yes")), ({}, "declines", [], Answer(response="No")),
    ({}, "silent", [], Answer(response="")),
    ({}, "engages", ["tabletEvent:1:wrong"], Answer(response="Perhaps")),
    # it says whether a button was pressed, but not which
    (RELEASE, "engages", [], Answer()), (RELEASE, "declines", [], Answer()),
    (RELEASE, "silent", [], NO_PRESS), (RELEASE, "engages", ["tabletEvent:1:wrong"], NO_PRESS)])
def test_the_answer_of_the_tablet_is_what_the_visitor_pressed(chosen, behaviour, faults, result):
    of_test = of_mission("<PressYesNoDialogue/>", faults, chosen=chosen,
                         visitor_behaviour=behaviour)
    call, = [event.call for _, event in times(of_test, Asked) if isinstance(event.request, Prompt)]
    answered, = [event for _, event in times(of_test, Answered) if event.call == call]
    cause = getattr(answered.result, "cause", None)
    assert cause is Cause.REFUSED if result is NO_PRESS else answered.result == result
    assert objections(of_test) == ()
    others = [Answer(response="Maybe"), Failure(Cause.HANDLER_EXCEPTION, "-", NO_PRESS.resource)]
    others += [Answer()] if result is NO_PRESS else [NO_PRESS]
    if chosen and result is not NO_PRESS:
        del others[0]  # it has no response
    for other in others:
        falsified = with_event(of_test, answered, replace(answered, result=other))
        assert any(" of /tabletEvent/prompt_and_get_response for PressYesNoDialogue was " in text
                   for text in objections(falsified)), other
