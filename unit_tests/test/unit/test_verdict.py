"""Tests of the verdict: sound tests pass, and what is changed in a record or a journal is objected
to."""
import dataclasses
from unittest import mock
from xml.etree import ElementTree

import pytest
from msgspec.structs import replace

from behavior_controller.bt.engine.node import Timed
from behavior_controller.config.settings import defaults
from behavior_controller.run.events import (
    Answered, Asked, EntriesWritten, LeafFinished, Line, Lost, Message, Noticed, PassFinished,
    PassStarted, Recovered, Recovering, Retried, RunFinished, RunStarted, SafeStateReported,
    StepStarted, StopChanged, Tick, TreeShown)
from behavior_controller.run.history import Run
from behavior_controller.robot.gateway import Cause, Failure
from behavior_controller.robot.requests import GoTo, Location, Say, SetAnimation, SetAttention
from behavior_controller.text import Source
from behavior_controller.simulation.rehearsal.play import CALM, LoadedMission, TIMED_OUT

from unit_tests.judge.facts import Stall
from unit_tests.judge.report import to_junit
from unit_tests.judge.verdict import QUESTIONS, Verdict

from plays import calls, changed, facts, of_test_with, stage, with_event

REFUSED, START = "textToSpeech:2", Timed.start_timer


def objections(of_test):
    return Verdict(of_test).objections


def assert_objects(of_test, *words):
    """Expect an objection with all of these words, whatever else is wrong then."""
    assert any(all(word in text for word in words) for text in objections(of_test)), objections(
        of_test)


def first(kind, change, which=lambda event: True):
    """Return a change of the first event of a kind that ``which`` holds for; None leaves it out."""
    done = []

    def apply(line):
        if done or not isinstance(line.event, kind) or not which(line.event):
            return [line]
        done.append(line)
        event = change(line.event)
        return [] if event is None else [replace(line, event=event)]
    return apply


def after(of_test, kind, more):
    """Return facts with another event on record after the first one of a kind."""
    event = next(line.event for line in of_test.run.lines if isinstance(line.event, kind))
    return with_event(of_test, event, event, more)


# -------------------------------------------------------------------------------------- what passes


@pytest.mark.slow
@pytest.mark.parametrize("behaviour, outcome", [
    ("engages", "SUCCESS"), ("leaves", "FAILURE"), ("declines", "SUCCESS"), ("silent", "SUCCESS"),
    ("unclear", "SUCCESS"), ("noGaze", "FAILURE")])
def test_a_sound_tour_passes_with_each_visitor(behaviour, outcome):
    of_test = facts(visitor_behaviour=behaviour)
    verdict = Verdict(of_test)
    assert verdict.passed
    assert [visit.outcome for visit in of_test.run.visits] == [outcome]
    assert ("ended early, as it had to: " in str(verdict)) is (outcome == "FAILURE")


def test_a_test_that_passes_says_how_many_calls_were_made_to_fail():
    verdict = Verdict(facts([REFUSED, "robotNavigation:1:exception"]))
    assert verdict.passed and ": 1 pass ended" in str(verdict) and " 2 of " in str(verdict)
    assert "the budget" not in str(verdict)


@pytest.mark.slow
def test_no_message_ever_comes_to_a_mission_that_waits_for_its_visitor():
    on = stage()
    played = on.play(dataclasses.replace(CALM, test_timeout=1000.0), ["/faceDetection/data"])
    of_test = facts()._replace(run=played.run(), journal=played.journal, exit_code=None,
                               cut_off=TIMED_OUT.format(1000), has_timed_out=True)
    verdict = Verdict(of_test)
    assert verdict.passed and "PASSED: no pass ended; " in str(verdict)
    assert "never came" in str(verdict)
    short = TIMED_OUT.format(100)
    played = on.play(dataclasses.replace(CALM, test_timeout=100.0), ["/faceDetection/data"])
    verdict = Verdict(of_test._replace(run=played.run(), journal=played.journal, cut_off=short))
    assert verdict.is_cut_off and not verdict.passed and not verdict.objections
    assert str(verdict).startswith(f"CUT OFF: {short}, and IsVisitorDiscovered")
    assert "testTimeout" in str(verdict)


@pytest.mark.slow
def test_three_visitors_for_whom_the_time_is_too_short_are_no_failure():
    """Each is asked four times, and has 10 s for an answer."""
    cut_off = facts(visitor_behaviour="silent", mission_runs=3, test_timeout=100.0)
    verdict = Verdict(cut_off)
    assert len(cut_off.run.visits) == 2 and verdict.is_cut_off
    assert str(verdict).startswith("CUT OFF: the mission did not end within 100 s, and ")
    suite = ElementTree.fromstring(to_junit(verdict, 1.0, "title"))
    assert (suite.get("failures"), suite.get("skipped")) == ("0", "1")
    assert len(suite.findall("testcase/skipped")) == 1
    # a wrong step before that is one
    first_said = calls(cut_off, "textToSpeech")[0]
    wrong = Verdict(cut_off._replace(journal=[
        line._replace(content={"message": "Psst"}) if line is first_said else line
        for line in cut_off.journal]))
    assert not wrong.is_cut_off and str(wrong).startswith("FAILED: ")


# ------------------------------------------------------------------------------------ start and end


def test_a_controller_that_did_not_start():
    empty = facts()._replace(run=Run(), journal=[], exit_code=2)
    assert [
        text for text in objections(empty) if "exit code 2" in text and "before it started" in text]
    why = ("missing: /x, offered by nobody", "nothing was started")
    assert objections(empty._replace(errors=why))[1:] == why
    late = "the controller did not start its mission within 60 s"
    assert objections(empty._replace(exit_code=None, cut_off=late)) == (late,)
    assert objections(facts()._replace(errors=why)) == ()


@pytest.mark.slow
@pytest.mark.parametrize("announced, exit_code, words", [
    (0, 3, ("ended with exit code 3", "announced exit code 0")), (0, -11, ("signal 11",)),
    (3, 0, ("ended with exit code 0", "announced exit code 3")), (0, -1, ("signal 1,",)),
    (3, 3, ("the last pass ended with SUCCESS", "exit code 3"))])
def test_an_exit_code_that_is_not_that_of_the_end(announced, exit_code, words):
    announce = first(RunFinished, lambda event: replace(event, exit_code=announced))
    assert_objects(changed(facts(), announce)._replace(exit_code=exit_code), *words)


def test_a_controller_that_died():
    def cut(line):
        return [] if isinstance(line.event, (PassFinished, RunFinished)) else [line]
    assert_objects(changed(facts(), cut)._replace(exit_code=-9), "signal 9", "pass 1")


def test_too_few_passes():
    assert_objects(of_test_with(facts(), mission_runs=2), "1 pass instead of 2")


def test_an_exception_of_the_controller_comes_first():
    raised = after(facts(), RunFinished, Noticed("error", "ValueError in WelcomeSpeech"))
    assert "ValueError in WelcomeSpeech" in objections(raised)[0]


def test_a_record_that_lacks_lines_cannot_be_judged():
    assert_objects(after(facts(), PassFinished, Lost(3)), "lacks 3 lines")


def test_a_mission_that_cannot_be_built_again_is_not_passed():
    documents = (Source("mission.xml", "<root"),)
    broken = first(RunStarted, lambda event: replace(
        event, sources=replace(event.sources, documents=documents)))
    assert_objects(changed(facts(), broken), "the mission on record cannot be done again: ")


# --------------------------------------------------------------------- what the journal has to show


REQUESTS = calls(facts())


@pytest.mark.slow
@pytest.mark.parametrize("line", [REQUESTS[at] for at in range(0, len(REQUESTS), 7)],
                         ids=lambda line: "{}:{}".format(line.node, line.call))
def test_each_request_has_its_witness(line):
    of_test = facts()
    others = [other for other in of_test.journal if other != line]
    assert_objects(of_test._replace(journal=others), "never got the request")
    twice = sorted(list(of_test.journal) + [line._replace(time=line.time + 0.001)])
    assert_objects(of_test._replace(journal=twice), line.resource)
    for field, value in line.content.items():
        wrong = dict(line.content,
                     **{field: value + value if isinstance(value, str) else value + 1})
        lines = [other if other != line else line._replace(content=wrong)
                 for other in of_test.journal]
        assert_objects(of_test._replace(journal=lines), line.resource, " instead of ")


def test_a_message_that_nobody_published():
    of_test = facts()
    lines = [line for line in of_test.journal if line.call or line.node != "speechEvent"]
    assert_objects(of_test._replace(journal=lines), "/speechEvent/text", "nobody published")


def test_a_sign_that_was_not_seen():
    of_test = facts(visitor_behaviour="noGaze")
    seeking = next(line.time for line in calls(of_test) if line.content.get("state") == "seeking")
    lines = [line._replace(content={"state": "seeking", "value": 1}) if line.node
             == "overtAttention" and not line.call and line.time > seeking + 2 else line
             for line in of_test.journal]
    assert_objects(of_test._replace(journal=lines), "IsMutualGazeDiscovered did not see")


def test_the_knowledge_is_that_which_was_served():
    of_test = facts()
    served = calls(of_test, "knowledgeBase")[0]
    fewer = dict(served.response, exhibits=served.response["exhibits"][1:])
    of_test = of_test._replace(journal=[
        line._replace(response=fewer) if line is served else line for line in of_test.journal])
    assert_objects(of_test, "RetrieveListOfExhibits", "'Pepper'", "instead of", "'Robot arm'")
    assert_objects(of_test, "its node sent", "'Robot arm'", "instead of", "'Pepper'")


@pytest.mark.slow
@pytest.mark.parametrize("node", ["textToSpeech", "speechEvent"])
def test_what_a_real_node_was_asked_or_said_has_the_record_as_its_only_witness(node):
    of_test = facts()
    lines = [line for line in of_test.journal if line.node != node]
    assert not Verdict(of_test._replace(journal=lines)).passed
    verdict = Verdict(of_test._replace(journal=lines, real=frozenset({node})))
    assert verdict.passed and f"only witness: {node}" in str(verdict)


# ------------------------------------------------------------------- what the record has to show


def is_request(kind):
    return lambda event: isinstance(event.request, kind)


@pytest.mark.slow
def test_another_request_than_the_mission_has():
    of_test = changed(facts(), first(
        Asked, lambda event: replace(event, request=Say("Hello")), is_request(Say)))
    assert_objects(of_test, "after EnableAnimateBehavior, WelcomeSpeech was due: saying “Hello, ",
                   "what was asked: saying “Hello” (text is 'Hello' instead of 'Hello, ")
    driven = changed(facts(), first(
        Asked, lambda event: replace(event, request=GoTo(Location(1.0, 2.0, 3.0))),
        is_request(Say)))
    text, = [text for text in objections(driven) if "WelcomeSpeech was due" in text]
    assert " instead of " not in text.partition("; what was asked")[2]


def test_a_request_that_was_not_made():
    of_test = changed(facts(), first(Asked, lambda event: None, is_request(GoTo)))
    assert_objects(of_test, "Navigate was due: driving to ")


@pytest.mark.slow
@pytest.mark.parametrize("letters", [("S", "F"), ("F", "S")])
def test_another_result_of_a_leaf(letters):
    of_test = facts([REFUSED])
    nodes = [node.type for node in of_test.run.state.nodes]
    uid = nodes.index("QueryTourSpeech" if letters[0] == "F" else "WelcomeSpeech") + 1
    of_test = changed(of_test, first(
        Tick, lambda tick: replace(tick, changes=[
            (number, letters[1] if number == uid else letter) for number, letter in tick.changes]),
        lambda tick: (uid, letters[0]) in tick.changes))
    due = "FAILURE (refused)" if letters[0] == "F" else "SUCCESS"
    assert_objects(of_test, f"{nodes[uid - 1]} had to be {due} (in Fallback")


@pytest.mark.slow
@pytest.mark.parametrize("kind, words",
                         [(LeafFinished, "ended with SUCCESS; on record is SUCCESS, SUCCESS"),
                          (Answered, "has an answer on record that nothing waits for"),
                          (EntriesWritten, "are on record twice"),
                          (Recovered, "on record is: QueryTourSpeech"),
                          (PassStarted, "pass 1 had to end"),
                          (RunFinished, "the safe state is due, once")])
def test_what_is_on_record_twice(kind, words):
    of_test = facts([REFUSED])
    event = next(line.event for line in of_test.run.lines if isinstance(line.event, kind))
    assert_objects(with_event(of_test, event, event, event), words)


def test_a_safe_state_that_is_asked_for_twice():
    def twice(line):
        event = line.event
        yield line
        if isinstance(event, (Asked, Answered)) and event.call == last:
            yield replace(line, event=replace(event, call=event.call + 1))
    of_test = facts()
    last = max(line.event.call for line in of_test.run.lines if isinstance(line.event, Asked))
    assert_objects(changed(of_test, twice), "the safe state is due, once")


@pytest.mark.slow
def test_a_part_of_the_safe_state_that_is_refused_is_asked_for_again():
    """The last call of attention is made to fail, so that the end has one attempt more."""
    of_test = facts([f"overtAttention:{calls(facts(), 'overtAttention')[-1].call}"])
    asked = [line.event for line in of_test.run.lines if isinstance(line.event, Asked)][-3:]
    assert [event.request for event in asked] == [
        SetAttention("disabled"), SetAnimation("disabled"), SetAttention("disabled")]
    assert Verdict(of_test).passed

    def without_it(line):
        event = line.event
        if isinstance(event, (Asked, Answered)) and event.call == asked[-1].call:
            return []
        if isinstance(event, SafeStateReported):
            failed = Failure(Cause.REFUSED, "-", event.parts[0].service)
            event = replace(event, parts=(replace(event.parts[0], failure=failed), event.parts[1]))
        return [Line(line.time, event)]
    assert_objects(changed(of_test, without_it), "attention off, refused, and 0.9 s were left")

    def at_once(line):
        is_last = isinstance(line.event, Asked) and line.event.call == asked[-1].call
        return [Line(line.time - 0.08, line.event) if is_last else line]
    assert_objects(changed(of_test, at_once), "asked for again: switching attention off")


@pytest.mark.slow
def test_the_verdict_says_what_a_pass_went_without():
    """The goodbye fails, and so does its retry; the policy goes on without it."""
    of_test = facts([f"gestureExecution:{number}" for number in range(1, 40)])
    verdict = Verdict(of_test)
    assert verdict.passed and "1 pass ended as a visitor who engages should" in str(verdict)
    assert "pass 1: complete without" in str(verdict) and "WelcomeGesture" in str(verdict)
    assert "without" not in str(Verdict(facts()))


def test_another_cause_than_that_of_the_answer():
    other = Failure(Cause.NO_ANSWER, "-", "/textToSpeech/say_text")
    of_test = changed(facts([REFUSED]), first(
        LeafFinished, lambda event: replace(event, failure=other),
        lambda event: event.node == "QueryTourSpeech"))
    assert_objects(of_test, "QueryTourSpeech ended with refused; on record is no-answer")


def later(seconds, kind, which=lambda event: True):
    """Return a change by which all from the first such event on happens so many seconds later."""
    begun = []

    def apply(line):
        if begun or isinstance(line.event, kind) and which(line.event):
            begun.append(line)
            event = line.event
            if isinstance(event, Tick):
                event = replace(event, at=event.at + seconds)
            if isinstance(event, Message):
                event = replace(event, arrived=event.arrived + seconds)
            line = Line(line.time + seconds, event)
        yield line
    return apply


@pytest.mark.parametrize("seconds, number, is_late", [(0.05, 2, False), (0.3, 1, False),
                                                      (0.3, 2, True)])
def test_retries_that_come_late_every_time(seconds, number, is_late):
    """One that comes late may have met a busy machine."""
    of_test = facts(["robotNavigation:1", "robotNavigation:2"])
    goals = [line.event for line in of_test.run.lines if isinstance(line.event, Asked)
             and isinstance(line.event.request, GoTo)]
    for again in goals[1:1 + number]:
        of_test = changed(of_test, later(seconds, Asked, lambda event: event == again))
    retried = [text for text in objections(of_test) if "was tried again" in text]
    assert bool(retried) is is_late and all("Navigate" in text for text in retried)


@pytest.mark.slow
def test_what_disturbed_the_test_comes_before_what_followed_from_it():
    of_test = facts()
    cut = of_test._replace(run=Run(list(of_test.run.lines)[:40]), cut_off="it was disturbed")
    assert objections(cut)[0] == "it was disturbed" and objections(cut)[1:]


@pytest.mark.slow
@pytest.mark.parametrize("left_out, asked", [
    (["SetAttention"], SetAnimation("disabled").words.doing),
    (["SetAnimation"], SetAttention("disabled").words.doing),
    (["SetAttention", "SetAnimation"], "nothing")])
def test_the_safe_state_at_the_end(left_out, asked):
    of_test = facts()
    last = max(line.event.call for line in of_test.run.lines if isinstance(line.event, Asked))
    of_test = changed(of_test, lambda line: [] if isinstance(line.event, Asked) and (
        line.event.call > last - 2 and type(line.event.request).__name__ in left_out) else [line])
    assert_objects(of_test, f"at the end the safe state is due, once; what was asked: {asked}")


@pytest.mark.slow
@pytest.mark.parametrize("kind, change, words", [
    (RunStarted, lambda event: replace(event, settings=dict(event.settings, language="French")),
     "has language French; it was given English"),
    (RunStarted, lambda event: replace(event, sources=replace(
        event.sources, policy=event.sources.policy._replace(text="budget 9 9"))),
     "another recovery policy"),
    (TreeShown, lambda event: replace(event, nodes=event.nodes[1:]), "the tree on record"),
    (RunStarted, lambda event: replace(event, leaves=event.leaves[1:]), "the tree on record"),
    (StepStarted, lambda event: None, "EnableAnimateBehavior begins; on record is"),
    (StopChanged, lambda event: replace(event, name="?"), "SelectExhibit is at stop 1 of 5"),
    (LeafFinished, lambda event: None, "START_OF_TREE ended with SUCCESS; on record is nothing"),
    (LeafFinished, lambda event: replace(event, status="FAILURE"), "although it did not fail"),
    (PassStarted, lambda event: None, "no pass had begun"),
    (PassStarted, lambda event: replace(event, number=2), "pass 1 had to begin"),
    (PassFinished, lambda event: replace(event, number=2), "pass 2 ended"),
    (PassFinished, lambda event: replace(event, outcome="FAILURE"),
     "pass 1 ended with FAILURE; its tree ends with SUCCESS"),
    (SafeStateReported, lambda event: None, "at the end what was reached of the safe state is "
     "reported: attention off, lifelike movement off; on record is: nothing"),
    (SafeStateReported, lambda event: replace(event, parts=event.parts[1:]),
     "attention not-advertised, lifelike movement off"),
    (Recovering, lambda event: None, "QueryTourSpeech (refused): retry 1 of "),
    (Retried, lambda event: None, "QueryTourSpeech (refused): failed too"),
    (Recovered, lambda event: None, "retries, by a rule to "),
    (Recovered, lambda event: replace(event, success=False), "on record its success is False"),
    (RunFinished, lambda event: replace(event, outcome="stopped"), "at the end it was stopped")])
def test_what_the_record_says_otherwise(kind, change, words):
    of_test = facts([REFUSED, "textToSpeech:3"])
    assert Verdict(of_test).passed
    assert_objects(changed(of_test, first(kind, change)), words)


def at(event, seconds):
    """Return a change by which an event is on record so many seconds later."""
    return lambda line: [Line(line.time + seconds, line.event) if line.event is event else line]


@pytest.mark.slow
@pytest.mark.parametrize("kind, number, seconds, words", [
    (PassStarted, 0, 5.0, "the first pass was due 5.0 s before"),
    (Tick, 0, 5.0, "the first step of pass 1 was due"),
    (PassFinished, 0, 5.0, "the end of the pass was due"),
    (RunFinished, 0, 5.0, "the end of the run was due"),
    (Asked, 20, -0.5, "0.5 s too early"), (Answered, 3, 2.0, "was waited for 2.0 s")])
def test_what_comes_early_or_late(kind, number, seconds, words):
    of_test = facts()
    event = [line.event for line in of_test.run.lines if isinstance(line.event, kind)][number]
    assert_objects(changed(of_test, at(event, seconds)), words)


def test_a_timer_that_never_ends_is_no_wait_for_the_visitor():
    of_test = facts(visitor_behaviour="silent")
    lines = of_test.run.lines
    gaps = [later.time - line.time for line, later in zip(lines, lines[1:])]
    lines = lines[:gaps.index(max(gaps)) + 1]
    journal = [line for line in of_test.journal if line.time < lines[-1].time + 1.0]
    journal += [line._replace(time=line.time + 900) for line in journal if not line.call][-3:]
    assert_objects(of_test._replace(run=Run(lines), journal=journal, exit_code=None,
                                    cut_off=TIMED_OUT.format(2000), has_timed_out=True),
                   "Sleep", " was due ")


def test_a_request_after_the_end_of_the_run():
    of_test = facts()
    last = max(line.event.call for line in of_test.run.lines if isinstance(line.event, Asked))

    more = after(of_test, RunFinished, Asked(last + 1, "/textToSpeech/say_text", Say("Psst")))
    assert_objects(more, "after the end of the run nothing is due", "“Psst”")


def test_a_safe_state_that_was_never_sent():
    of_test = facts()
    last = max(line.event.call for line in of_test.run.lines if isinstance(line.event, Asked))

    def unsent(line):
        event = line.event
        if isinstance(event, Answered) and event.call == last:
            return []
        if isinstance(event, SafeStateReported):
            failed = Failure(Cause.NO_ANSWER, "-", event.parts[1].service)
            parts = (event.parts[0], replace(event.parts[1], failure=failed))
            return [Line(line.time + 1.0, replace(event, parts=parts, seconds=1.0))]
        return [Line(line.time + 1.0, event)] if isinstance(event, RunFinished) else [line]
    journal = [line for line in of_test.journal if line != calls(of_test)[-1]]
    assert_objects(changed(of_test, unsent)._replace(journal=journal), "never got the request")


@pytest.mark.parametrize("stalls, is_late", [
    ([], True), ([(0.0, 0.3)], True), ([(0.0, 0.5)], False), ([(0.0, 0.2), (0.9, 1.2)], False),
    # before it was due, and after it came
    ([(-30.0, -0.1)], True), ([(-30.0, 0.1)], True), ([(1.5, 30.0)], True)])
def test_while_a_machine_stood_still_what_was_due_may_come_as_much_later(stalls, is_late):
    of_test = facts()
    last = [line.event for line in of_test.run.lines if isinstance(line.event, Asked)][-1].call
    journal = list(of_test.journal)
    sent = calls(of_test)[-1]
    journal[journal.index(sent)] = sent._replace(time=sent.time + 1.4)

    def late(line):
        event = line.event
        if isinstance(event, SafeStateReported):
            event = replace(event, seconds=event.seconds + 1.4)
        is_after = isinstance(event, (SafeStateReported, RunFinished))
        is_answer = isinstance(event, Answered) and event.call == last
        return [Line(line.time + 1.4 * (is_after or is_answer), event)]
    assert bool(objections(changed(of_test, late)._replace(
        journal=sorted(journal),
        stalls=tuple(Stall(sent.time + begins, sent.time + ends) for begins, ends in stalls))
    )) is is_late


@pytest.mark.slow
@pytest.mark.parametrize("node, number", [("robotNavigation", 1), ("overtAttention", 3),
                                          ("overtAttention", 9), ("textToSpeech", 5)])
def test_a_request_that_is_sent_twice_is_named_as_that_and_nothing_else_is(node, number):
    """Also where the node gets it while the next request is made."""
    of_test = facts()
    its = calls(of_test, node)
    for at in (its[number - 1].time + 0.001, its[number].time - 0.001):
        again = its[number - 1]._replace(time=at, call=99)
        text, = objections(of_test._replace(journal=sorted([*of_test.journal, again])))
        assert f"{again.resource} was asked twice for {again.content}" in text


def test_the_place_of_what_is_wrong_after_the_last_pass_is_that_pass():
    of_test = facts()
    last = [line.event for line in of_test.run.lines if isinstance(line.event, Asked)][-1]
    text, = [text for text in objections(changed(of_test, lambda line: (
        [] if line.event is last else [line]))) if "the safe state is due" in text]
    assert text.startswith("after pass 1: at the end ")


def test_a_wait_that_ended_early_is_named_as_that():
    with mock.patch.object(Timed, "start_timer", lambda self, msec: START(self, msec - 4000)):
        of_test = facts(on=LoadedMission(defaults()), visitor_behaviour="silent")
    text, = objections(of_test)
    assert "on record is Sleep SUCCESS, 4.0 s too early" in text


@pytest.mark.parametrize("node, content", [("textToSpeech", {"message": "Psst"}),
                                           ("animateBehavior", {"state": "Psst"})])
def test_a_request_that_is_not_on_record_is_placed(node, content):
    of_test = facts()
    line, at = calls(of_test, node)[0], calls(of_test, "textToSpeech")[0].time
    more = line._replace(time=at + 0.002, content=content, call=99)
    assert_objects(of_test._replace(journal=sorted(list(of_test.journal) + [more])),
                   "after WelcomeSpeech, /", "Psst", "no such request is on record")


# --------------------------------------------------------------------------- a robot of release 1.0


RELEASE = {"robotInterface": "release-1.0", "scenarioSpecification": "release_1_0_tour"}


@pytest.mark.slow
@pytest.mark.parametrize("chosen", [
    {"asrEnabled": True}, {"asrEnabled": False, "tabletSuccessIs": "yes"},
    {"asrEnabled": False, "tabletSuccessIs": "done"}])
@pytest.mark.parametrize("behaviour", ["engages", "declines", "silent"])
def test_a_tour_of_release_1_0_passes(chosen, behaviour):
    assert objections(facts(mission=tuple(dict(RELEASE, **chosen).items()),
                            visitor_behaviour=behaviour)) == ()


# ----------------------------------------------------------------------------------------- the rest


def test_junit_has_a_case_for_each_question():
    passed = ElementTree.fromstring(to_junit(Verdict(facts()), 1.0, "title"))
    assert (passed.get("tests"), passed.get("failures")) == (str(len(QUESTIONS)), "0")
    failed = ElementTree.fromstring(
        to_junit(Verdict(of_test_with(facts(), mission_runs=2)), 1.0, "title"))
    assert failed.get("failures") == "1"
    assert [case.get("name") for case in failed.iter("testcase")] == [
        question for question, _ in QUESTIONS]
