"""Tests of the judge's reference: table 4 of D5.4.3 and the decisions of its contract, each by its
own words."""
import ast
import os
from types import SimpleNamespace

import pytest

from behavior_controller.bt.values.blackboard import Blackboard
from behavior_controller.config import phrases, settings
from behavior_controller.robot.gateway import Cause
from behavior_controller.robot.requests import (
    Answer, GoTo, PerformGesture, Prompt, QueryKnowledge, Say, SetAnimation, SetAttention)
from behavior_controller.text import read_text

from unit_tests import judge
from unit_tests.judge import files, reference

from plays import facts

TABLE_4 = """
DescribeExhibitSpeech DisableAnimateBehavior DisabledOvertAttentionMode EnableAnimateBehavior
EndTourSpeech FollowMeSpeech GoodbyeGesture HandleFallBack HereIsTheDoorSpeech IsASREnabled
IsListWithExhibit IsMutualGazeDiscovered IsVisitorDiscovered IsVisitorResponseYes IsYesNoUttered
LookUpEntrance LookUpHome MaybeAnotherTimeSpeech Navigate PerformDeicticGesture
PressYesNoDialogue PressYesNoSpeech QueryTourSpeech RetrieveListOfExhibits SayGoodByeSpeech
SayYesNoSpeech ScanningOvertAttentionMode SelectExhibit SocialOvertAttentionMode START_OF_TREE
WelcomeGesture WelcomeSpeech
""".split()

RELEASE_1_0 = """
StartOfTree SayText SetOvertAttentionMode SetAnimateBehavior SetSpeechEvent PerformIconicGesture
SetRobotPose ResetRobotPose RetrieveInitialLocation GetVisitorResponse HasVisitorResponded
IsVisitorPresent
""".split()

FOLDER = os.path.dirname(judge.__file__)

ENGLISH = files.phrases(read_text(files.path_of("phrases_English.ini", "")))


JUDGES = sorted(file for file in os.listdir(FOLDER) if file.endswith(".py"))

OF_THE_PRODUCT = ("bt", "run", "errors", "exit_codes", "text", "folders", "extensions",
                  "robot.requests", "robot.gateway", "config.settings", "missions.load",
                  "missions.replay", "simulation.configuration", "simulation.faults",
                  "simulation.journal", "simulation.visitor", "simulation.world")
"""What the judge uses of the product: the model of a run, the loader and the engine, the records
that a run is made of, and the test that was run. docs/testers_guide.md says what proves it."""

ONLY = {"foreign.py": ("config.phrases",), "journal_check.py": ("robot.declarations",),
        "report.py": ("config.config_file", "simulation.behaviour", "viewer.report"),
        "verdict.py": ("viewer.report",)}
"""What one module uses beside that: declarations of other packages and of services; the report, and
its words."""


@pytest.mark.parametrize("name", JUDGES)
def test_the_judge_uses_no_reader_of_the_product(name):
    with open(os.path.join(FOLDER, name), encoding="utf-8") as file:
        tree = ast.parse(file.read())
    modules = [node.module or "" for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)]
    modules += [f"{node.module}.{alias.name}" for node in ast.walk(tree)
                if isinstance(node, ast.ImportFrom) for alias in node.names if node.module in (
                    "behavior_controller", "behavior_controller.config",
                    "behavior_controller.simulation")]
    used = {module.partition(".")[2] for module in modules
            if module.startswith("behavior_controller.")} - {"config", "simulation"}
    allowed = OF_THE_PRODUCT + ONLY.get(name, ())
    assert {module for module in used if not any(
        module == one or module.startswith(one + ".") for one in allowed)} == set()


def test_every_node_of_the_table_and_of_the_release_has_its_row():
    rows = {spec.id for spec in reference.ROWS}
    assert len(TABLE_4) == 32
    assert set(TABLE_4 + RELEASE_1_0) - rows == set()


def asked_by(of_test):
    """Return what each node asked in a sound tour, of each the first request."""
    from unit_tests.judge.execution import Execution
    found = {}
    for query in Execution(of_test).queries.values():
        found.setdefault(query.node, query.request)
    return found


@pytest.mark.slow
def test_the_requests_of_a_tour_are_those_of_the_document():
    of_test = facts()
    spoken, exhibit = phrases.load("English"), of_test.world.knowledge.exhibits[0]
    asked = asked_by(of_test)
    assert asked["EnableAnimateBehavior"] == SetAnimation("enabled")
    assert asked["DisableAnimateBehavior"] == SetAnimation("disabled")
    assert asked["ScanningOvertAttentionMode"] == SetAttention("scanning")
    assert asked["SocialOvertAttentionMode"] == SetAttention("social")
    assert asked["DisabledOvertAttentionMode"] == SetAttention("disabled")
    assert asked["WelcomeGesture"] == PerformGesture("iconic", 1, 3000)
    assert asked["GoodbyeGesture"] == PerformGesture("iconic", 3, 3000)
    assert asked["PerformDeicticGesture"] == PerformGesture("deictic", 1, 3000, exhibit.gesture)
    assert asked["RetrieveListOfExhibits"] == QueryKnowledge("exhibits")
    assert asked["LookUpEntrance"] == QueryKnowledge("entrance")
    assert asked["LookUpHome"] == QueryKnowledge("home")
    assert asked["Navigate"] == GoTo(exhibit.location)
    assert asked["DescribeExhibitSpeech"] == Say(exhibit.description1)
    for node in ("WelcomeSpeech", "QueryTourSpeech", "FollowMeSpeech", "EndTourSpeech",
                 "HereIsTheDoorSpeech", "SayGoodByeSpeech"):
        assert asked[node] == Say(spoken.speeches[node])
    assert asked_by(facts(mission={"asrEnabled": False}))["PressYesNoDialogue"] == Prompt(
        ("Yes", "No"))


@pytest.mark.parametrize("text, answer", [
    ("Yes", "yes"), ("yes please", "yes"), ("No", "no"), ("not good", "no"), ("no, yes", "no"),
    ("goodbye", None), ("I know", None), ("Error: yes", None), ("", None), (" error yes", None),
    ("yesterday", None), ("well, YES!", "yes"), ("yes no", "no")])
def test_a_spoken_answer_is_whole_words_with_no_first(text, answer):
    assert reference.spoken(ENGLISH, text) == answer


MEANINGS = SimpleNamespace(meanings={
    "yes": [("good",), ("sure",), ("no", "problem"), ("that's", "it")],
    "no": [("no",), ("not", "good"), ("sure", "not", "today")]})


@pytest.mark.parametrize("text, answer", [
    ("no problem", "yes"), ("no", "no"), ("not good", "no"), ("good", "yes"), ("sure", "yes"),
    ("Sure not today", "no"), ("sure not", "yes"), ("problem", None), ("no problem, no", "no"),
    ("That’s it", "yes"), ("good no problem", "yes")])
def test_the_longest_phrase_counts(text, answer):
    assert reference.spoken(MEANINGS, text) == answer


@pytest.mark.parametrize("text, is_error", [
    ("Error: no speech", True), ("error", True), ("  ERROR 5", True), ("An Error occurred", True),
    ("terror", False), ("no", False), ("", False)])
def test_an_error_of_the_recognition_is_no_answer(text, is_error):
    assert reference.is_error(text) is is_error


class Failing:
    """A node that fails."""

    def __init__(self, registration_id, is_indispensable=False):
        self.registration_id = registration_id
        self.spec = SimpleNamespace(is_indispensable=is_indispensable)


POLICY = """budget 3 60 # at most
Navigate refused 2 1.5 skip
FollowMeSpeech no-answer 1 0.5 WelcomeSpeech
FollowMeSpeech * 4 0 skip
* refused 3 2 skip
"""


@pytest.mark.parametrize("node, cause, rule", [
    ("Navigate", Cause.REFUSED, (2, 1.5, "giveUp")),  # it is never skipped
    ("FollowMeSpeech", Cause.NO_ANSWER, (1, 0.5, "WelcomeSpeech")),
    ("FollowMeSpeech", Cause.REFUSED, (4, 0.0, "skip")),
    ("WelcomeSpeech", Cause.REFUSED, (3, 2.0, "skip")),
    # no line fits
    ("WelcomeSpeech", Cause.NO_ANSWER, (0, 0.0, "giveUp"))])
def test_the_first_line_of_the_policy_that_fits_is_the_rule(node, cause, rule):
    found = reference.PolicyTable(POLICY).rule(Failing(node), cause)
    assert (found.retries, found.back_off, found.then) == rule


@pytest.mark.parametrize("is_indispensable, then", [(True, "giveUp"), (False, "skip")])
def test_a_node_of_another_package_may_be_indispensable(is_indispensable, then):
    found = reference.PolicyTable(POLICY).rule(Failing("Count", is_indispensable), Cause.REFUSED)
    assert found.then == then


@pytest.mark.parametrize("more, pauses", [("", (10.0, 300.0)), ("pause 5 60\n", (5.0, 60.0))])
def test_the_policy_has_a_budget_and_pauses(more, pauses):
    table = reference.PolicyTable(POLICY + more)
    assert (table.most, table.seconds) == (3, 60.0)
    assert (table.first_pause, table.longest_pause) == pauses


REFUSED, MISTYPED = Cause.REFUSED, Cause.TYPE_MISMATCH


def context():
    policy = reference.PolicyTable(POLICY)
    return reference.TaskContext(settings.defaults(), (), ENGLISH, policy)


@pytest.mark.parametrize("causes, is_spent, spent, number, at, seconds", [
    # nothing failed that persists
    ([], True, [0.0, 10.0, 20.0], 0, 30.0, 0.0),
    ([REFUSED], False, [0.0, 10.0, 20.0], 0, 30.0, 0.0),
    # a type: 10 s, twice as long each time, at most 300 s
    ([MISTYPED], False, [], 0, 30.0, 10.0), ([MISTYPED], False, [], 1, 30.0, 20.0),
    ([MISTYPED], False, [], 4, 30.0, 160.0), ([MISTYPED], False, [], 5, 30.0, 300.0),
    ([MISTYPED], False, [], 99, 30.0, 300.0), ([REFUSED, MISTYPED], False, [], 0, 30.0, 10.0),
    # the budget: until the oldest of its three recoveries is 60 s old
    ([REFUSED], True, [0.0, 10.0, 20.0], 0, 30.0, 10.0),
    ([REFUSED], True, [0.0, 10.0, 20.0], 2, 30.0, 30.0),
    ([REFUSED], True, [0.0, 10.0, 20.0], 2, 55.0, 5.0),
    ([REFUSED], True, [-50.0, 0.0, 10.0, 20.0], 2, 55.0, 5.0),
    ([REFUSED], True, [0.0, 10.0, 20.0], 2, 60.0, 0.0), ([REFUSED], True, [0.0], 2, 30.0, 0.0)])
def test_a_pass_waits_while_the_cause_of_the_failure_persists(
        causes, is_spent, spent, number, at, seconds):
    course = context()
    course.unrecovered = [(cause, "/x") for cause in causes]
    course.is_spent, course.recoveries = is_spent, spent
    assert course.pause(number, at) == seconds


def test_the_failures_of_a_pass_are_the_newest_and_what_was_given_up_in_it():
    course = context()
    board = Blackboard()
    course.failures.append(reference.TaskFailure(None, Cause.REFUSED, "/before"))
    course.begin_visit(board, 5.0)
    assert course.failures_of_pass == []
    course.failures += [reference.TaskFailure(None, Cause.REFUSED, name) for name in ("/a", "/b")]
    course.unrecovered.append((Cause.NO_ANSWER, "/c"))
    assert course.failures_of_pass == [(Cause.NO_ANSWER, "/c"), (Cause.REFUSED, "/b")]
    course.begin_visit(board, 9.0)
    assert course.failures_of_pass == [] and course.is_spent is False


@pytest.mark.parametrize("pressed, meaning, cause", [
    ("1", "yes", None), ("2", "no", None), ("Yes", "yes", None), (" no ", "no", None),
    ("NO", "no", None), ("", None, Cause.MISSING_DATA), ("0", None, Cause.MISSING_DATA),
    ("3", None, Cause.UNUSABLE_ANSWER), ("maybe", None, Cause.UNUSABLE_ANSWER)])
def test_a_press_is_yes_or_no_or_none_at_all(pressed, meaning, cause):
    written = {}
    course = context()
    node = SimpleNamespace(course=course, write=written.update)
    found = None
    try:
        reference._keep_pressed(node, Answer(response=pressed))
    except reference.Fails as failed:
        found = failed.args[0]
    assert (written.get("visitorResponse"), found) == (meaning, cause)

