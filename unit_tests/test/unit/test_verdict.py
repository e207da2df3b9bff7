"""Tests of the verdict: what passes, and every way in which a test must fail."""
from xml.etree import ElementTree

import pytest

from behavior_controller.interface.records import Exhibit, Location, Point
from behavior_controller.interface.robots import INTERFACES

from unit_tests.exhibits import Knowledge
from unit_tests.facts import Facts
from unit_tests.journal import Line
from unit_tests.junit import to_xml
from unit_tests.rehearsal import Rehearsal
from unit_tests.report import failure_lines, summary_lines
from unit_tests.verdict import QUESTIONS, judge

SAY, GO, ATTEND = "/textToSpeech/say_text", "/robotNavigation/set_goal", "/overtAttention/set_mode"
ANIMATE = "/animateBehaviour/set_activation"


def place(name, x):
    return Exhibit(name, name + " one", name + " two", Location(x, 0.0, 0.0), Point(x, 1.0, 1.0))


EXHIBITS = (place("Arm", 1.0), place("Base", 2.0), place("Desk", 3.0))
KNOWLEDGE = Knowledge(EXHIBITS, place("Door", 4.0), place("Home", 0.0))
TOUR_LEAVES = ("RetrieveListOfExhibits", "SelectExhibit", "Navigate", "IsYesNoUttered")


class Story:
    """A test as it happened, told step by step, a second each."""

    def __init__(self, behaviour="engages", leaves=TOUR_LEAVES, runs=1):
        self.now, self.passes, self.exit_code, self.cut_off = 100.0, 0, None, ""
        self.behaviour, self.runs = behaviour, runs
        self.journal, self.calls = [], {}
        self.events = [self.event("RunStarted", mission="lab_tour.xml", leaves=[["p", leaf] for leaf in leaves])]

    def event(self, kind, **fields):
        self.now += 1.0
        return dict(fields, event=kind, time=self.now)

    def record(self, kind, **fields):
        self.events.append(self.event(kind, **fields))

    def call(self, node, resource, fault=None, objection=None, **content):
        self.now += 1.0
        self.calls[node] = self.calls.get(node, 0) + 1
        self.journal.append(Line(self.now, node, resource, self.calls[node], content, fault, objection))

    def say(self, text, fault=None):
        self.call("textToSpeech", SAY, fault, message=text)

    def go(self, x, fault=None):
        self.call("robotNavigation", GO, fault, goal_x=x, goal_y=0.0, goal_theta=0.0)

    def failed(self, node, resource, cause, message="-", path=None, status="FAILURE"):
        self.record("LeafFinished", uid=1, node=node, path=path or node, status=status, resource=resource, seconds=0.1,
                    failure={"cause": cause, "message": message, "resource": resource} if status == "FAILURE" else None)

    def retried(self, node, resource, cause="refused", path=None):
        self.record("Retried", node=node, path=path or node, attempt=1,
                    failure={"cause": cause, "message": "-", "resource": resource})

    def done(self, node, resource=""):
        self.record("LeafFinished", uid=1, node=node, path=node, status="SUCCESS", resource=resource, seconds=0.1,
                    failure=None)

    def recovered(self, node, resource, attempts, success=True, cause="refused", path=None, policy="retry"):
        self.record("Recovered", node=node, path=path or node, policy=policy, attempts=attempts, success=success,
                    outcome="done" if success else "given up",
                    failure={"cause": cause, "message": "-", "resource": resource})

    def handled(self, node, resource, outcome, cause="refused", uid=2, seconds=0.5, path="HandleFallBack"):
        """End a recovery and the HandleFallBack that made it."""
        is_done = outcome != "given up"
        self.recovered(node, resource, 0, is_done, cause)
        self.events[-1]["outcome"] = outcome
        self.record("LeafFinished", uid=uid, node="HandleFallBack", path=path, resource="", seconds=seconds,
                    status="SUCCESS" if is_done else "FAILURE", failure=None if is_done else self.events[-1]["failure"])

    def choose(self):
        self.record("LeafFinished", uid=3, node="SelectExhibit", path="SelectExhibit", status="SUCCESS", resource="",
                    seconds=0.0, failure=None)

    def visit(self, exhibit, described=True):
        self.go(exhibit.location.x)
        if described:
            self.say(exhibit.description1)
            self.say(exhibit.description2)

    def tour(self, described=3):
        for index, exhibit in enumerate(KNOWLEDGE.exhibits):
            self.visit(exhibit, index < described)

    def end_pass(self, outcome="SUCCESS"):
        self.passes += 1
        self.record("PassFinished", number=self.passes, outcome=outcome, seconds=1.0)

    def end(self, exit_code=0):
        self.exit_code = exit_code
        self.record("RunFinished", outcome="all passes are done", exit_code=exit_code)

    def facts(self):
        return Facts(self.events, self.journal, self.exit_code, self.behaviour, self.runs, KNOWLEDGE, self.cut_off)

    def objections(self):
        return list(judge(self.facts()).objections)


def finished(story, outcome="SUCCESS"):
    story.end_pass(outcome)
    story.end(0 if outcome == "SUCCESS" else 3)
    return story


# -------------------------------------------------------------------------------------------------------------- passes


def test_a_tour_of_all_exhibits_passes():
    story = Story()
    story.tour()
    story.journal.append(Line(story.now, "speechEvent", "/speechEvent/text", 0, {"data": "What a bright room"}))
    verdict = judge(finished(story).facts())
    assert verdict.passed
    assert str(verdict) == ("PASSED: 1 pass ended as a visitor who engages should; "
                            "0 of 9 calls were made to fail, and all of these are on record")


@pytest.mark.parametrize("behaviour", ("declines", "silent"))
def test_no_tour_passes_when_nobody_wants_one(behaviour):
    story = Story(behaviour)
    story.say("Maybe another time")
    assert finished(story).objections() == []


GAZING = TOUR_LEAVES + ("IsMutualGazeDiscovered",)


def test_who_leaves_breaks_the_tour_off():
    story = Story("leaves", leaves=GAZING)
    story.tour(described=2)
    assert finished(story, "FAILURE").objections() == []


def test_who_leaves_is_not_told_goodbye():
    story = Story("leaves", leaves=GAZING)
    story.tour(described=2)
    story.done("SayGoodByeSpeech", SAY)
    assert finished(story, "FAILURE").objections() == [
        "pass 1: the visitor had left, and the robot went on to SayGoodByeSpeech"]


def test_a_tour_without_its_visitor_is_no_success():
    story = Story("leaves", leaves=GAZING)
    story.tour(described=2)
    assert finished(story).objections()[0].startswith(
        "pass 1 ended with SUCCESS; a visitor who leaves should bring FAILURE")


def test_every_pass_is_judged_for_itself():
    story = Story(runs=2)
    story.tour()
    story.end_pass()
    story.visit(KNOWLEDGE.exhibits[0])
    assert finished(story).objections() == ["pass 2: the robot did not get to exhibit Base",
                                            "pass 2: the robot did not get to exhibit Desk"]


@pytest.mark.parametrize("node", ("robotNavigation", "textToSpeech", "knowledgeBase", "overtAttention"))
def test_what_a_real_node_was_asked_is_not_judged(node):
    story = finished(Story())
    verdict = judge(story.facts()._replace(real=frozenset([node])))
    assert verdict.passed and "not judged: " + node in str(verdict)


def test_the_failures_of_a_real_node_are_its_own():
    story = Story(leaves=("WelcomeSpeech",))
    story.failed("WelcomeSpeech", SAY, "refused")
    facts = finished(story).facts()
    assert judge(facts._replace(real=frozenset(["textToSpeech"]))).passed
    assert not judge(facts._replace(real=frozenset(["robotNavigation"]))).passed


def test_a_crash_excuses_what_fails_until_the_node_is_back():
    story = Story(leaves=("WelcomeSpeech",))
    story.say("Hello", "crash")
    story.failed("WelcomeSpeech", SAY, "connection-lost")
    for node, resource in (("overtAttention", ATTEND), ("animateBehavior", ANIMATE), ("knowledgeBase", "/knowledge")):
        story.call(node, resource, state="-")
    story.failed("FollowMeSpeech", SAY, "not-reachable")
    assert finished(story).objections() == []
    story = Story(leaves=("WelcomeSpeech",))
    story.say("Hello", "crash")
    story.failed("WelcomeSpeech", SAY, "connection-lost")
    story.say("Follow me")
    story.failed("FollowMeSpeech", SAY, "not-reachable")
    assert len(finished(story).objections()) == 1


def test_a_leaf_that_should_run_and_did_not_is_named():
    story = Story(leaves=("WelcomeSpeech", "FollowMeSpeech"))
    story.done("WelcomeSpeech", SAY)
    facts = finished(story).facts()._replace(rehearsal=Rehearsal("SUCCESS", frozenset(["WelcomeSpeech", "p/Follow"]), (
        frozenset(["WelcomeSpeech"]), frozenset(["p/Follow"]))))
    assert judge(facts).objections == (
        "the leaf p/Follow was not reached; a visitor who engages should bring the robot there",)
    assert summary_lines(facts)[-3:] == [
        "coverage: 0 of 1 leaves of the mission ran", "          1 of 2 that this visitor should bring about",
        "          1 of 2 branches"]


def test_the_verdict_as_junit_names_each_question_and_what_speaks_against_it():
    story = Story(leaves=("WelcomeSpeech",))
    story.failed("WelcomeSpeech", SAY, "refused")
    suite = ElementTree.fromstring(to_xml(judge(finished(story).facts()), 12.5, "a title"))
    assert (suite.get("tests"), suite.get("failures"), suite.get("time")) == (str(len(QUESTIONS)), "1", "12.500")
    failed = [case.get("name") for case in suite.iter("testcase") if case.find("failure") is not None]
    assert failed == ["the failures on record are those that were injected"]
    assert "WelcomeSpeech failed" in suite.find("testcase/failure").get("message")
    assert "a title" in suite.find("system-out").text


def with_a_leaf_that_did_not_run(story):
    """Return the facts of a mission whose second leaf should have run."""
    story.done("WelcomeSpeech", SAY)
    return finished(story).facts()._replace(
        rehearsal=Rehearsal("SUCCESS", frozenset(["WelcomeSpeech", "p/Follow"]), ()))


@pytest.mark.parametrize("was_done, number", ((True, 1), (False, 0)))
def test_only_a_recovery_that_gave_up_excuses_a_leaf_that_did_not_run(was_done, number):
    story = Story(leaves=("WelcomeSpeech", "FollowMeSpeech"))
    story.say("Hello", "refused")
    story.failed("WelcomeSpeech", SAY, "refused")
    story.handled("WelcomeSpeech", SAY, "done" if was_done else "given up")
    assert len(judge(with_a_leaf_that_did_not_run(story)).objections) == number


def test_the_mission_that_counts_is_the_one_after_a_change():
    story = Story("declines", leaves=("WelcomeSpeech",))
    story.record("RunStarted", mission="lab_tour.xml", leaves=[["p", leaf] for leaf in TOUR_LEAVES])
    story.go(1.0)
    assert finished(story).objections() == ["pass 1: the robot was sent to 1 place without a visitor who wants a tour"]


@pytest.mark.parametrize("leaves", [("WelcomeSpeech",), TOUR_LEAVES[1:], TOUR_LEAVES[:1] + TOUR_LEAVES[2:], TOUR_LEAVES[:2]])
def test_a_mission_without_a_tour_needs_no_exhibits(leaves):
    assert finished(Story(leaves=leaves)).objections() == []


def test_who_follows_to_two_exhibits_sees_all_of_a_building_with_two():
    story = Story("leaves", leaves=GAZING)
    story.tour()
    facts = finished(story).facts()
    assert judge(facts._replace(knowledge=KNOWLEDGE._replace(exhibits=EXHIBITS[:2]))).passed


def test_a_mission_that_does_not_ask_gives_its_tour_to_everybody():
    story = Story("silent", leaves=TOUR_LEAVES[:3])
    story.tour()
    assert finished(story).objections() == []


# ----------------------------------------------------------------------------------------------------------- exhibits


def test_an_exhibit_that_was_left_out_is_named():
    story = Story()
    story.visit(KNOWLEDGE.exhibits[0])
    story.visit(KNOWLEDGE.exhibits[2])
    assert finished(story).objections() == ["pass 1: the robot did not get to exhibit Base"]


def test_a_drive_that_failed_does_not_count():
    story = Story()
    story.tour()
    story.journal[0] = story.journal[0]._replace(fault="refused")
    assert "pass 1: the robot did not get to exhibit Arm" in finished(story).objections()


@pytest.mark.parametrize("behaviour", ("engages", "leaves"))
def test_an_exhibit_that_was_not_described_to_a_visitor_is_named(behaviour):
    story = Story(behaviour)
    story.visit(KNOWLEDGE.exhibits[0])
    story.visit(KNOWLEDGE.exhibits[1], described=False)
    story.visit(KNOWLEDGE.exhibits[2])
    objections = finished(story).objections()
    assert [text.split(": ")[1] for text in objections] == ["exhibit Base was not described"]


@pytest.mark.parametrize("second_try, number", (("refused", 0), (None, 1)))
def test_an_exhibit_where_the_robot_was_not_let_seek_the_gaze_needs_no_description(second_try, number):
    story = Story()
    story.choose()
    story.visit(KNOWLEDGE.exhibits[0], described=False)
    story.call("overtAttention", ATTEND, "refused", state="seeking")
    story.failed("SeekOvertAttentionMode", ATTEND, "refused")
    story.call("overtAttention", ATTEND, second_try, state="seeking")
    if second_try:
        story.retried("SeekOvertAttentionMode", ATTEND)
    story.handled("SeekOvertAttentionMode", ATTEND, "skipped" if second_try else "done")
    if second_try:
        story.failed("IsMutualGazeDiscovered", "/overtAttention/mode", "condition-false")
        story.handled("IsMutualGazeDiscovered", "/overtAttention/mode", "skipped", "condition-false")
    for exhibit in KNOWLEDGE.exhibits[1:]:
        story.choose()
        story.visit(exhibit)
    assert len(finished(story).objections()) == number


@pytest.mark.parametrize("behaviour", ("declines", "silent"))
def test_a_tour_that_nobody_wanted_is_wrong(behaviour):
    story = Story(behaviour)
    story.go(1.0)
    assert finished(story).objections() == ["pass 1: the robot was sent to 1 place without a visitor who wants a tour"]


# ------------------------------------------------------------------------------------------------------ start and end


def test_a_pass_may_fail_where_a_recovery_gave_up_and_only_there():
    story = Story()
    story.tour()
    for call in range(3):
        story.go(0.0, "refused")
        (story.retried if call else story.failed)("Navigate", GO, "refused")
    story.handled("Navigate", GO, "given up")
    finished(story, "FAILURE")
    assert story.objections() == []
    assert "pass 1 ended with FAILURE, as it had to: Navigate was given up (refused)" in str(judge(story.facts()))
    story.events = [event for event in story.events if event["event"] not in ("Recovered", "LeafFinished", "Retried")]
    story.journal = [line._replace(fault=None) for line in story.journal]
    assert story.objections() == ["pass 1 ended with FAILURE; a visitor who engages should bring SUCCESS (without a failure "
                                  "of a mission node)"]


def test_a_pass_that_failed_at_a_condition_names_it():
    story = without_tour()
    story.failed("IsMutualGazeDiscovered", "/overtAttention/mode", "condition-false", "no mutual gaze")
    assert finished(story, "FAILURE").objections() == [
        "pass 1 ended with FAILURE; a visitor who engages should bring SUCCESS (failed last: IsMutualGazeDiscovered: "
        "no mutual gaze)"]


def test_a_controller_that_never_started():
    story = Story()
    story.events, story.cut_off = [], "the controller did not start its mission within 60 s"
    assert story.objections() == [story.cut_off]


@pytest.mark.parametrize("exit_code, how", [
    (2, "ended with exit code 2"), (0, "ended with exit code 0"), (-1, "was ended by signal 1")])
def test_a_controller_that_refused_to_start(exit_code, how):
    story = Story()
    story.events, story.exit_code = [], exit_code
    assert story.objections() == ["the controller {} before it started its mission".format(how)]


def test_a_controller_that_crashed():
    story = Story(runs=2)
    story.tour()
    story.end_pass()
    story.exit_code = -11
    assert story.objections() == ["the controller was ended by signal 11 in the middle of its mission, in pass 2"]


def test_a_controller_that_never_ended():
    story = Story()
    story.cut_off = "the mission did not end within 900 s (testTimeout)"
    assert story.objections() == [story.cut_off]


def test_a_controller_that_ends_otherwise_than_it_said():
    story = Story()
    story.tour()
    finished(story).exit_code = 1
    assert story.objections() == ["the controller ended with exit code 1, but announced exit code 0"]


def test_too_few_passes():
    story = Story(runs=3)
    story.tour()
    assert finished(story).objections() == ["the controller made 1 pass instead of 3"]


def test_a_request_that_a_node_objected_to():
    story = Story(leaves=())
    story.call("overtAttention", ATTEND, None, "state is 'sleeping'", state="sleeping")
    story.failed("SocialOvertAttentionMode", ATTEND, "refused")
    objections = finished(story).objections()
    assert objections[0] == "/overtAttention/set_mode received a request that makes no sense: state is 'sleeping'"
    assert len(objections) == 2  # it was not injected either


# ------------------------------------------------------------------------------------------------- injected = recorded


def without_tour():
    return Story(leaves=())


def test_an_injected_failure_that_is_on_record_passes():
    for fault, cause in (("refused", "refused"), ("exception", "exception"),
                         ("unanswered", "no-answer")):
        story = without_tour()
        story.say("Hello", fault)
        story.failed("WelcomeSpeech", SAY, cause)
        assert finished(story).objections() == []


def test_a_failure_that_was_not_injected():
    story = without_tour()
    story.say("Hello")
    story.failed("WelcomeSpeech", SAY, "connection-lost", "the server hung up")
    assert finished(story).objections() == [
        "WelcomeSpeech failed and nothing was injected there: connection-lost: the server hung up"]


def test_a_failure_of_another_service_than_the_injected_one():
    story = without_tour()
    story.say("Hello", "refused")
    story.failed("Navigate", GO, "refused")
    assert len(finished(story).objections()) == 2


def test_a_failure_of_another_cause_than_the_injected_one():
    story = without_tour()
    story.say("Hello", "exception")
    story.failed("WelcomeSpeech", SAY, "refused")
    assert len(finished(story).objections()) == 2


def test_a_failure_on_record_before_it_was_injected():
    story = without_tour()
    story.failed("WelcomeSpeech", SAY, "refused")
    story.say("Hello", "refused")
    assert len(finished(story).objections()) == 2


def test_one_injected_failure_does_not_explain_two():
    story = without_tour()
    story.say("Hello", "refused")
    story.failed("WelcomeSpeech", SAY, "refused")
    story.failed("WelcomeSpeech", SAY, "refused", "again")
    assert finished(story).objections() == ["WelcomeSpeech failed and nothing was injected there: refused: again"]


def test_an_injected_failure_that_is_not_on_record():
    story = without_tour()
    story.say("Hello")
    story.say("Hello", "refused")
    story.done("WelcomeSpeech", SAY)
    assert finished(story).objections() == [
        "call 2 of /textToSpeech/say_text was made to fail (refused) and is not on record as a failure"]


def test_failed_attempts_of_the_recovery_belong_to_it():
    story = without_tour()
    story.go(1.0, "refused")
    story.failed("Navigate", GO, "refused")
    story.go(1.0, "refused")
    story.retried("Navigate", GO)
    story.go(1.0)
    story.recovered("Navigate", GO, 2)
    assert finished(story).objections() == []


def test_a_failed_attempt_that_was_not_injected():
    story = without_tour()
    story.go(1.0, "refused")
    story.failed("Navigate", GO, "refused")
    story.go(1.0)
    story.retried("Navigate", GO)
    story.recovered("Navigate", GO, 2)
    assert finished(story).objections() == ["Navigate failed and nothing was injected there: refused: -"]


def test_more_failed_calls_than_the_recovery_made_attempts():
    story = without_tour()
    story.go(1.0, "refused")
    story.failed("Navigate", GO, "refused")
    story.go(1.0, "refused")
    story.retried("Navigate", GO)
    story.go(1.0, "refused")
    story.recovered("Navigate", GO, 1)
    assert len(finished(story).objections()) == 1


def test_a_recovery_does_not_cover_what_came_before_its_leaf_failed():
    story = without_tour()
    story.go(1.0, "refused")
    story.done("Navigate", GO)
    story.go(2.0, "refused")
    story.failed("Navigate", GO, "refused")
    story.go(2.0)
    story.recovered("Navigate", GO, 1)
    assert finished(story).objections() == [
        "call 1 of /robotNavigation/set_goal was made to fail (refused) and is not on record as a failure"]


def test_the_failure_of_a_handlefallback_is_the_one_before():
    story = without_tour()
    story.go(1.0, "refused")
    story.failed("Navigate", GO, "refused")
    story.recovered("Navigate", GO, 0, success=False)
    story.failed("HandleFallBack", GO, "refused")
    assert finished(story).objections() == []


def test_the_safe_state_may_fail_when_a_recovery_gives_up():
    story = without_tour()
    story.go(1.0, "refused")
    story.failed("Navigate", GO, "refused")
    story.call("overtAttention", ATTEND, "refused", state="disabled")
    story.call("animateBehavior", ANIMATE, "refused", state="disabled")
    story.recovered("Navigate", GO, 0, success=False)
    assert finished(story).objections() == []


def test_of_each_request_for_the_safe_state_one_may_fail_and_no_other_request():
    story = without_tour()
    story.call("overtAttention", ATTEND, "refused", state="seeking")
    story.go(1.0, "refused")
    story.failed("Navigate", GO, "refused")
    story.say("Hello", "refused")
    for _ in range(2):
        story.call("overtAttention", ATTEND, "refused", state="disabled")
    story.recovered("Navigate", GO, 0, success=False)
    assert [text.split(" was")[0] for text in finished(story).objections()] == [
        "call 1 of " + ATTEND, "call 1 of " + SAY, "call 3 of " + ATTEND]


def test_without_giving_up_there_is_no_safe_state():
    story = without_tour()
    story.go(1.0, "refused")
    story.failed("Navigate", GO, "refused")
    story.call("overtAttention", ATTEND, "refused", state="disabled")
    story.recovered("Navigate", GO, 0)
    assert len(finished(story).objections()) == 1


def test_the_answer_of_a_halted_leaf_is_lost():
    story = without_tour()
    story.say("Hello", "unanswered")
    story.failed("WelcomeSpeech", SAY, "", status="IDLE")
    assert finished(story).objections() == []


def test_of_a_halted_leaf_one_answer_is_lost():
    story = without_tour()
    story.say("Hello", "unanswered")
    story.say("Hello", "unanswered")
    story.failed("WelcomeSpeech", SAY, "", status="IDLE")
    assert [text[:7] for text in finished(story).objections()] == ["call 2 "]


def test_the_answers_that_a_halted_recovery_waited_for_are_lost():
    story = without_tour()
    story.say("Hello", "refused")  # of another leaf, which says nothing of it
    story.go(1.0, "refused")
    story.failed("Navigate", GO, "refused")
    for _ in range(2):
        story.go(1.0, "unanswered")
        story.call("overtAttention", ATTEND, "unanswered", state="disabled")
    story.record("LeafFinished", uid=2, node="HandleFallBack", path="-", status="IDLE", resource="", seconds=5.5, failure=None)
    assert [text.split(" was")[0] for text in finished(story).objections()] == [
        "call 1 of " + SAY, "call 3 of " + GO, "call 2 of " + ATTEND]


@pytest.mark.parametrize("seconds, left", [(0.5, [1, 2]), (2.5, [1, 3]), (3.5, [2, 3])])
def test_a_failure_comes_from_the_first_fault_while_its_leaf_ran_or_from_the_newest_before(seconds, left):
    story = without_tour()
    for _ in range(3):
        story.say("Hello", "refused")
    story.failed("WelcomeSpeech", SAY, "refused")
    story.events[-1]["seconds"] = seconds
    assert [text.split(" was")[0] for text in finished(story).objections()] == [
        "call {} of {}".format(call, SAY) for call in left]


def test_conditions_that_are_false_need_no_injection():
    story = without_tour()
    story.failed("IsMutualGazeDiscovered", "/overtAttention/mode", "condition-false")
    assert finished(story).objections() == []


def test_only_a_silent_visitor_presses_nothing():
    for behaviour, number in (("silent", 0), ("engages", 1)):
        story = Story(behaviour, leaves=())
        story.failed("PressYesNoDialogue", "/tabletEvent/prompt_and_get_response", "missing-data", "pressed nothing")
        assert len(finished(story).objections()) == number


PROMPT, SPEECH = "/tabletEvent/prompt_and_get_response", "/speechEvent/text"


@pytest.mark.parametrize("node, resource, behaviour, real, is_wrong", [
    ("PressYesNoDialogue", PROMPT, "silent", (), True), ("PressYesNoDialogue", PROMPT, "declines", (), False),
    ("PressYesNoDialogue", PROMPT, "silent", ("tabletEvent",), False), ("WelcomeSpeech", SAY, "silent", (), False)])
def test_what_a_silent_visitor_pressed_is_wrong(node, resource, behaviour, real, is_wrong):
    story = Story(behaviour, leaves=())
    story.done(node, resource)
    assert list(judge(finished(story).facts()._replace(real=frozenset(real))).objections) == is_wrong * [
        "PressYesNoDialogue ended with SUCCESS, and the visitor pressed nothing"]


# ---------------------------------------------------------------------------------------------- a robot of release 1.0


def of_release(story, **more):
    return story.facts()._replace(interface=INTERFACES["release-1.0"], **more)


@pytest.mark.parametrize("behaviour, fault, number", (
    ("silent", None, 0), ("declines", None, 0), ("engages", None, 1), ("declines", "refused", 0),
    ("declines", "exception", 2)))
def test_a_refusal_of_a_tablet_that_does_not_tell_is_the_visitors_no(behaviour, fault, number):
    story = Story(behaviour, leaves=())
    story.call("tabletEvent", PROMPT, fault, message="'Yes'|'No'")
    story.failed("PressYesNoDialogue", PROMPT, "refused")
    assert len(judge(of_release(finished(story))).objections) == number


def test_each_refusal_of_a_tablet_that_does_not_tell_is_judged_by_its_own_call():
    story = Story("declines", leaves=())
    for fault in ("refused", None):
        story.call("tabletEvent", PROMPT, fault, message="'Yes'|'No'")
        story.failed("PressYesNoDialogue", PROMPT, "refused")
    assert judge(of_release(finished(story))).passed


def test_a_refusal_of_a_tablet_that_tells_is_none():
    story = Story("declines", leaves=())
    story.call("tabletEvent", PROMPT, message="Yes|No")
    story.failed("PressYesNoDialogue", PROMPT, "refused")
    assert len(finished(story).objections()) == 1


@pytest.mark.parametrize("behaviour, number", (("unclear", 0), ("engages", 1)))
def test_only_of_an_unclear_visitor_the_recognition_tells_an_error(behaviour, number):
    story = Story(behaviour, leaves=())
    story.failed("GetVisitorResponse", SPEECH, "unusable-answer")
    assert len(judge(of_release(finished(story))).objections) == number


def test_with_a_node_all_of_its_services_crash():
    story = Story(leaves=())
    story.call("speechEvent", "/speechEvent/set_language", "crash", language="English")
    story.failed("SetSpeechEvent", "/speechEvent/set_language", "connection-lost")
    story.failed("SetSpeechEvent", "/speechEvent/set_enabled", "not-reachable")
    assert judge(of_release(finished(story))).passed


def test_a_service_that_the_robot_does_not_offer_fails_by_itself():
    story = Story("engages", leaves=())
    story.say("Hello")
    story.failed("PressYesNoDialogue", PROMPT, "not-advertised")
    facts = of_release(finished(story))
    assert len(judge(facts).objections) == 1
    assert judge(facts._replace(absent=frozenset({PROMPT}))).passed


@pytest.mark.parametrize("settings, is_expected", (
    ({"asrEnabled": False, "tabletSuccessIs": "done"}, False), ({"asrEnabled": False, "tabletSuccessIs": "yes"}, True),
    ({"asrEnabled": True, "tabletSuccessIs": "done"}, True)))
def test_no_tour_is_expected_where_no_yes_can_reach_the_robot(settings, is_expected):
    story = Story()
    story.events[0]["settings"] = settings
    story.say("Maybe another time")
    verdict = judge(of_release(finished(story)))
    assert verdict.passed is not is_expected
    assert ("no yes can reach the robot" in str(verdict)) is not is_expected


@pytest.mark.parametrize("behaviour, objections", (("declines", 0), ("engages", 1)))
def test_without_a_tour_the_mission_says_how_a_pass_ends(behaviour, objections):
    facts = finished(Story(behaviour), "FAILURE").facts()
    facts = facts._replace(rehearsal=Rehearsal("FAILURE", frozenset(), ()))
    assert len(judge(facts).objections) == objections
    assert len(judge(facts._replace(rehearsal=None)).objections) == 1


def test_presence_tells_of_a_visitor_who_left_too():
    story = Story("leaves", leaves=TOUR_LEAVES + ("IsVisitorPresent",))
    story.tour(described=2)
    assert judge(of_release(finished(story, "FAILURE"))).passed


@pytest.mark.parametrize("number, is_farewell", (("7", True), ("3", False)))
def test_a_text_may_be_a_goodbye(number, is_farewell):
    story = Story("leaves", leaves=GAZING)
    story.tour(described=2)
    story.record("LeafFinished", uid=1, node="SayText", path="Tree::1/" + number, status="SUCCESS", resource=SAY,
                 seconds=0.1, failure=None)
    assert bool(judge(of_release(finished(story, "FAILURE"))).objections) is is_farewell


def test_a_tour_may_end_where_it_began():
    story = Story()
    story.tour()
    story.go(EXHIBITS[0].location.x)
    assert finished(story).objections() == []


def test_an_exhibit_without_a_text_needs_no_description():
    story = Story()
    places = tuple(place._replace(description2="") for place in EXHIBITS)
    for place in places:
        story.go(place.location.x)
        story.say(place.description1)
    facts = finished(story).facts()
    assert judge(facts._replace(knowledge=KNOWLEDGE._replace(exhibits=places))).passed
    assert not judge(facts).passed


# -------------------------------------------------------------------------------------------------- what is unforeseen


def test_what_the_verdict_does_not_know_changes_nothing():
    story = Story()
    story.events.append(dict(story.event("HealthChanged", name=SAY, node="textToSpeech", is_well=False, status="gone",
                                         consequence="nothing is said"), kind="service"))
    story.record("Tick", at=1.0, first=True, changes=[])
    story.tour()
    story.record("NotYetInvented")
    facts = finished(story).facts()
    assert judge(facts).passed
    assert failure_lines(facts) == []
