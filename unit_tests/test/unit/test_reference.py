"""Tests of the judge's reference: table 4 of D5.4.3 and the decisions of its contract, each by its
own words."""
import ast
import inspect
import os

import pytest

from behavior_controller.config import phrases
from behavior_controller.robot.requests import (
    GoTo, PerformGesture, Prompt, QueryKnowledge, Say, SetAnimation, SetAttention)

from unit_tests import judge
from unit_tests.judge import reference

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


@pytest.mark.parametrize("name",
                         sorted(file for file in os.listdir(FOLDER) if file.endswith(".py")))
def test_the_judge_uses_nothing_of_the_controllers_leaves(name):
    with open(os.path.join(FOLDER, name), encoding="utf-8") as file:
        tree = ast.parse(file.read())
    modules = [node.module or "" for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)]
    modules += [alias.name for node in ast.walk(tree) if isinstance(node, ast.Import)
                for alias in node.names]
    names = [alias.name for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)
             for alias in node.names if node.module == "behavior_controller"]
    foreign = [module for module in modules
               if module.startswith("behavior_controller.leaves")]
    assert foreign == [] and "leaves" not in names


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


@pytest.mark.parametrize("text, answer", [("Yes", "yes"), ("yes please", "yes"), ("No", "no"),
                                          ("not good", "no"), ("no, yes", "no"), ("goodbye", None),
                                          ("I know", None), ("Error: yes", None), ("", None),
                                          ("yesterday", None)])
def test_a_spoken_answer_is_whole_words_with_no_first(text, answer):
    assert reference.spoken(phrases.load("English"), text) == answer


def test_the_policy_is_read_by_the_words_at_its_head():
    class Failing:
        registration_id, spec = "Navigate", None

    policy = reference.PolicyTable(
        "budget 3 60 # at most\nNavigate refused 2 1.5 skip\n* * 0 0 skip # the rest\n")
    from behavior_controller.robot.gateway import Cause
    assert (policy.most, policy.seconds) == (3, 60.0)
    refused = policy.rule(Failing(), Cause.REFUSED)
    # it is never skipped
    assert (refused.retries, refused.back_off, refused.then) == (2, 1.5, "giveUp")
    Failing.registration_id = "FollowMeSpeech"
    assert policy.rule(Failing(), Cause.NO_ANSWER).then == "skip"


def test_no_row_says_nothing_of_itself():
    assert inspect.getdoc(reference.RecoveryTask) and len({spec.id for spec in reference.ROWS
                                                         }) == len(reference.ROWS)
