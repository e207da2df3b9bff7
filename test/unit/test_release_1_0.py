"""The words of release 1.0's missions: arguments, what each does on either robot, and whole
missions in virtual time."""
import os
import re
import shutil

import pytest

from behavior_controller import cli, folders, leaves
from behavior_controller.config import recovery_policy, settings
from behavior_controller.bt.mission import load_text
from behavior_controller.bt.values.status import FAILURE, RUNNING, SUCCESS
from behavior_controller.errors import ConfigurationError, MissionError
from behavior_controller.run.events import LeafFinished, Noticed, StepStarted, LeafSummary
from behavior_controller.missions import load
from behavior_controller.missions.path_analysis import foresee
from behavior_controller.robot.gateway import Cause, Failure
from behavior_controller.robot import d543, release_1_0
from behavior_controller.robot.requests import (
    AttentionStatus, Faces, GoTo, Location, PerformGesture, Point, Prompt, QueryKnowledge, Say,
    SetAnimation, SetAttention, SetPose, SetRecognition, SetRecognitionLanguage)
from behavior_controller.leaves.attention import IsMutualGazeDiscovered
from behavior_controller.leaves.base import (
    NOT_ASKED, InstantCondition, ServiceLeaf, leaf_spec)
from behavior_controller.leaves.data import VISITOR_RESPONSE
from behavior_controller.leaves.release_1_0 import SPECS
from behavior_controller.config.phrases import SPEECHES
from behavior_controller.text import Source
from mission_rig import ASLEEP, EXHIBITS, HOME, NO_TIMER, WOKEN, Rig, follow, one_leaf, write

RELEASE = "release-1.0"
WORDS = """StartOfTree SayText SetOvertAttentionMode SetAnimateBehavior SetSpeechEvent PerformIconicGesture SetRobotPose
ResetRobotPose RetrieveInitialLocation GetVisitorResponse HasVisitorResponded IsVisitorPresent""".split(
)

# the delivered knowledge files: data/*.dat
START = Location(0.0, 0.0, 0.0)
PHRASES = {1: "Please press Yes or No on my tablet.", 2: "Please follow me.",
           3: "That is all right. Maybe another time! Have a nice day.",
           4: "Hello, and welcome to our robotics lab! My name is Pepper.",
           5: "Would you like me to give you a tour of the lab?", 6: "Here is the door.",
           7: "Thank you for your visit. Goodbye!"}
STOPS = [Location(0.0, 0.0, 0.0), Location(2.0, 1.0, 90.0), Location(4.5, 1.5, 45.0),
         Location(6.0, 4.0, 0.0), Location(3.5, 6.0, 180.0), Location(1.5, 4.5, 270.0),
         Location(0.5, 2.0, 180.0)]


def file(body, more=""):
    return ("<root BTCPP_format='4' main_tree_to_execute='M'><BehaviorTree ID='M'>{}</BehaviorTree>"
            "{}</root>".format(body, more))


def ran(element, robot=RELEASE, ticks=1, **changed):
    """Return a rig after that many ticks of one leaf, and the last result."""
    rig = one_leaf(element, robotInterface=robot, **changed)
    write(rig, exhibits=list(EXHIBITS))
    return rig, [rig.tick() for _ in range(ticks)][-1]


# ---------------------------------------------------------------------------------------- the words


def test_the_words_of_the_release_are_there_and_those_with_an_argument_say_which():
    assert [spec.id for spec in SPECS] == WORDS
    assert {spec.id for spec in leaves.SPECS} >= set(WORDS)
    assert {spec.id: spec.names for spec in SPECS if spec.names} == {
        "SayText": tuple("12345678"), "SetOvertAttentionMode":
            ("disabled", "social", "scanning", "seeking", "location"), "SetAnimateBehavior":
                ("enabled", "disabled"), "SetSpeechEvent": ("true", "false", "enabled", "disabled"),
        "PerformIconicGesture": ("welcome", "goodbye")}
    assert {spec.id: spec.farewells for spec in SPECS if spec.farewells} == {
        # "Here is the door." and "Goodbye!"
        "SayText": ("6", "7"), "PerformIconicGesture": ("goodbye",)}


@pytest.mark.parametrize("element, request_", [
    ("SetAnimateBehavior name='enabled'", SetAnimation("enabled")),
    ("SetAnimateBehavior name='disabled'", SetAnimation("disabled")),
    ("SetOvertAttentionMode name='disabled'", SetAttention("disabled")),
    ("SetOvertAttentionMode name='social'", SetAttention("social")),
    ("SetOvertAttentionMode name='scanning'", SetAttention("scanning")),
    ("SetOvertAttentionMode name='seeking'", SetAttention("seeking")),
    ("SetOvertAttentionMode name='location' target='1;2;3'",
     SetAttention("location", Point(1.0, 2.0, 3.0))),
    ("PerformIconicGesture name='welcome'", PerformGesture("iconic", 1, 3000)),
    ("PerformIconicGesture name='goodbye'", PerformGesture("iconic", 3, 3000)),
    ("PerformIconicGesture name=' Goodbye '", PerformGesture("iconic", 3, 3000)),
    ("SetOvertAttentionMode name='SOCIAL'", SetAttention("social")),
    ("Action ID='SetAnimateBehavior' name='Enabled'", SetAnimation("enabled"))])
@pytest.mark.parametrize("robot", [RELEASE, d543.INTERFACE.name])
def test_what_both_robots_are_asked_for(element, request_, robot):
    rig, result = ran("<{}/>".format(element), robot)
    assert (result, rig.requests) == (SUCCESS, [request_])


@pytest.mark.parametrize("element, request_", [
    ("SetSpeechEvent name='true'", SetRecognition(True)),
    ("SetSpeechEvent name='enabled'", SetRecognition(True)),
    ("SetSpeechEvent name='false'", SetRecognition(False)),
    ("SetSpeechEvent name='disabled'", SetRecognition(False)),
    ("SetRobotPose", SetPose(EXHIBITS[0].location)),
    ("ResetRobotPose", SetPose(EXHIBITS[0].location)),
    ("StartOfTree", SetRecognitionLanguage("English"))])
def test_what_only_the_release_has_is_done_without_elsewhere_and_told_at_load(element, request_):
    rig, result = ran("<{}/>".format(element))
    assert (result, rig.requests) == (SUCCESS, [request_])
    assert rig.tree.warnings == []
    rig, result = ran("<{}/>".format(element), d543.INTERFACE.name)
    assert (result, rig.requests) == (SUCCESS, [])
    assert [event.resource for event in rig.of(LeafFinished)] == [""]
    fault, = rig.tree.warnings
    assert fault.code == "does-without" and fault.text.endswith(
        " " + type(request_).__name__) and RELEASE in fault.hint


@pytest.mark.parametrize("number", sorted(PHRASES))
def test_the_phrases_are_those_of_the_culture_file_or_of_the_language(number):
    rig, result = ran("<SayText name='{}'/>".format(number))
    assert (result, rig.requests) == (SUCCESS, [Say(PHRASES[number], "English")])
    rig, result = ran("<SayText name='{}'/>".format(number), d543.INTERFACE.name)
    speech = ["PressYesNo", "FollowMe", "MaybeAnotherTime", "Welcome", "QueryTour", "HereIsTheDoor",
              "SayGoodBye"]
    expected = rig.mission.phrases.speeches[speech[number - 1] + "Speech"]
    assert (result, rig.requests) == (SUCCESS, [Say(expected)])


def test_the_phrases_that_are_questions_are_told_as_such():
    rig = one_leaf("<Sequence>{}</Sequence>".format("".join("<SayText name='{}'/>".format(number)
                                                            for number in PHRASES)))
    rig.tick()
    assert [number for number, event in zip(PHRASES, rig.of(StepStarted)) if event.words
            == "asking"] == [1, 5]
    assert [number for number, event in zip(PHRASES, rig.of(LeafFinished))
            if event.summary.mark == "asked"] == [1, 5]


@pytest.mark.parametrize("robot", [RELEASE, d543.INTERFACE.name])
def test_a_phrase_that_the_culture_file_lacks_is_a_failure_that_can_be_skipped(robot):
    rig, result = ran("<SayText name='8'/>", robot)
    assert (result, rig.requests) == (FAILURE, [])
    assert rig.of(LeafFinished)[0].failure == Failure(
        Cause.MISSING_DATA, "there is no utility phrase 8", "/textToSpeech/say_text")
    assert ran("<Fallback><SayText name='8'/><HandleFallBack/></Fallback>", robot)[1] is SUCCESS


def test_a_phrase_that_the_culture_file_lacks_is_told_at_load_and_by_validate_mission(
        tmp_path, monkeypatch, capsys):
    text = file("<Sequence><SayText name='7'/>\n<SayText name='8'/></Sequence>")
    rig = Rig(text, robotInterface=RELEASE)
    assert [(fault.line, fault.column, fault.code)
            for fault in rig.tree.warnings] == [(2, 10, "phrase-missing")]
    assert Rig(text).tree.warnings == []
    (tmp_path / settings.FILE_NAME).write_text(
        "scenarioSpecification m\nverboseMode false\nasrEnabled true\nrobotInterface release-1.0\n",
        "utf-8")
    for kind in ("culture", "environment"):
        (tmp_path / "{}KnowledgeBaseConfiguration.ini".format(kind)).write_text(
            "knowledgeBase {}\n".format(folders.data(kind + "KnowledgeBase.dat")), "utf-8")
    (tmp_path / "m.xml").write_text(text, "utf-8")
    shutil.copy(folders.config(load.POLICY), str(tmp_path))
    monkeypatch.setattr(folders, "config", lambda name: str(tmp_path / name))
    assert cli.validate([str(tmp_path / "m.xml")]) == 0
    assert re.search(r"m\.xml:2:10: warning: .*\[phrase-missing\]", capsys.readouterr().out)


@pytest.mark.parametrize("state", ["social", "scanning", "seeking", "disabled"])
def test_only_the_mode_that_looks_at_a_place_needs_one(state):
    element = "<SetOvertAttentionMode name='{}'/>".format(state)
    rig = one_leaf(element, robotInterface=RELEASE)
    assert rig.tick() is SUCCESS and rig.requests == [SetAttention(state)]
    assert rig.tree.warnings == []


def test_nothing_is_looked_at_where_there_is_nothing():
    for element in ("SetOvertAttentionMode name='location'", "LocationOvertAttentionMode"):
        rig, result = ran("<{} target='0;0;0'/>".format(element))
        assert (result, rig.requests) == (SUCCESS, [])
    rig, result = ran("<SetOvertAttentionMode name='location'/>")
    assert (result, rig.requests) == (FAILURE, [])


def test_the_pose_is_not_told_before_there_is_a_tour():
    rig = one_leaf("<SetRobotPose/>", robotInterface=RELEASE)
    assert (rig.tick(), rig.requests) == (FAILURE, [])
    assert rig.of(LeafFinished)[0].failure.cause is Cause.MISSING_DATA


def test_the_first_location_becomes_the_target():
    rig = one_leaf("<Sequence><RetrieveInitialLocation/><Navigate/></Sequence>",
                   robotInterface=RELEASE)
    assert (rig.tick(), rig.requests) == (SUCCESS, [GoTo(START)])
    rig = one_leaf("<Sequence><RetrieveInitialLocation/><Navigate/></Sequence>")
    assert (rig.tick(), rig.requests) == (SUCCESS, [QueryKnowledge("home"), GoTo(HOME.location)])


def test_the_start_forgets_the_last_visitor_and_is_told():
    rig, result = ran("<StartOfTree/>", asrEnabled=False)
    assert (result, rig.requests) == (SUCCESS, [])
    assert [event.text for event in rig.of(Noticed)] == ["a pass begins"]
    assert "exhibits" not in rig.tree.blackboard.local


def test_the_page_has_each_word_with_its_arguments():
    with open(os.path.join(os.path.dirname(folders.config("")), os.pardir, "docs",
                           "release_1_0.md"), encoding="utf-8") as page:
        rows = [line.strip("| ").split(" | ") for line in page if line.startswith("| ")
                and line.count("|") == 4]
    arguments = {word: row[1] for row in rows for word in row[0].split(", ")}
    for spec in SPECS:
        assert {name for name in spec.names if name not in re.split(
            "[^a-z0-9]+", arguments[spec.id])} == set()


# ------------------------------------------------------------------------------------ the arguments


@pytest.mark.parametrize("element, column, allowed", [
    ("SayText name='9'", 10, "1, 2, 3, 4, 5, 6, 7, 8"),
    ("SayText name='hello'", 10, "8"),
    ("SayText", 1, "8"),
    ("SayText name=' '", 1, "8"),
    ("Action ID='SayText' name='0'", 22, "8"),
    ("SetAnimateBehavior name='on'", 21, "enabled, disabled"),
    ("SetOvertAttentionMode name='sociable'", 24, "disabled, social, scanning, seeking, location"),
    ("SetSpeechEvent name='yes'", 17, "true, false, enabled, disabled"),
    ("PerformIconicGesture name='wave'", 23, "welcome, goodbye")])
def test_a_wrong_argument_is_a_fault_with_its_place(element, column, allowed):
    with pytest.raises(MissionError) as raised:
        load_text(file("<Sequence>\n<{}/></Sequence>".format(element)), leaves.registry(), "m.xml")
    fault, = raised.value.faults
    assert (fault.line, fault.column,
            fault.code) == (2, column, "name-argument") and fault.hint.endswith(allowed)


def test_in_a_tree_that_is_not_used_a_wrong_argument_is_a_warning():
    tree = load_text(
        file("<IsASREnabled/>", "<BehaviorTree ID='N'><SayText name='9'/></BehaviorTree>"),
        leaves.registry())
    assert [fault.code for fault in tree.warnings] == ["name-argument"]


def test_an_argument_in_a_port_is_told_where_it_belongs():
    with pytest.raises(MissionError) as raised:
        load_text(file("<SetAnimateBehavior state='enabled'/>"), leaves.registry(), "m.xml")
    port, = [fault for fault in raised.value.faults if fault.code == "unknown-port"]
    assert port.hint.endswith("enabled, disabled")


@pytest.mark.parametrize("typed, meant", [
    ("SetAnimateBehaviour", "SetAnimateBehavior"),
    ("SetAnimationBehavior", "SetAnimateBehavior"),
    ("SetOvertAttention", "SetOvertAttentionMode"),
    ("SayTextNode", "SayText"),
    ("StartOfTre", "StartOfTree"),
    ("START_OF_TRE", "START_OF_TREE"),
    ("GetVisitorsResponse", "GetVisitorResponse"),
    ("HasVisitorResponse", "HasVisitorResponded"),
    ("RetrieveInitialLocations", "RetrieveInitialLocation"),
    ("IsVisitorThere", "IsVisitorPresent"),
    ("SetRobotPoseNode", "SetRobotPose"),
    ("PerformIconicGestures", "PerformIconicGesture"),
    ("DisableAnimateBehaviour", "DisableAnimateBehavior")])
def test_a_misspelt_word_is_answered_with_the_nearest(typed, meant):
    with pytest.raises(MissionError) as raised:
        load_text(file("<{}/>".format(typed)), leaves.registry())
    fault, = raised.value.faults
    assert fault.code == "unknown-node" and " {}?".format(meant) in fault.hint


def test_a_word_with_an_argument_cannot_stand_in_for_a_failed_node():
    with pytest.raises(ConfigurationError, match="p.ini:2:.*SayText"):
        recovery_policy.read(Source("p.ini", "budget 1 1\nNavigate refused 0 0 SayText\n"),
                             leaves.mission_specs())


# ----------------------------------------------------------------------------- what a visitor tells


def listening(robot=RELEASE):
    """Return a rig whose mission listens, and the topic of utterances."""
    rig = one_leaf("<GetVisitorResponse/>", robotInterface=robot)
    speech = (release_1_0 if robot == RELEASE else d543).SPEECH
    rig.topics.publish(speech, "yes")
    assert rig.tick() is RUNNING
    return rig, speech


def stored(rig):
    return rig.tree.blackboard.get("visitorResponse")


@pytest.mark.parametrize("robot", [RELEASE, d543.INTERFACE.name])
@pytest.mark.parametrize("says, answer", [("yes please", "yes"), ("no", "no")])
def test_an_answer_is_one_that_comes_after_the_leaf_began_to_listen(robot, says, answer):
    rig, speech = listening(robot)
    rig.clock.advance(3.0)
    rig.topics.publish(speech, "the weather")
    assert rig.tick() is RUNNING
    rig.clock.advance(3.0)
    rig.tree.wake.test_and_clear()
    rig.topics.publish(speech, says)
    assert rig.tree.wake.test_and_clear(), "the answer itself wakes the tree"
    assert (rig.tick(), stored(rig)) == (SUCCESS, answer)
    event, = rig.of(LeafFinished)
    summary = LeafSummary("heard", "heard “{}”: {}".format(says, answer), answer)
    assert (event.seconds, event.summary) == (6.0, summary)
    assert rig.clock.next_due() is None


def test_an_answer_that_is_followed_at_once_by_another_utterance_counts():
    rig, speech = listening()
    for text in ("well", "no", "the weather"):
        rig.clock.advance(0.001)
        rig.topics.publish(speech, text)
    assert (rig.tick(), stored(rig)) == (SUCCESS, "no")
    assert rig.of(LeafFinished)[0].summary.text == "heard “no”: no"


@pytest.mark.parametrize("robot", [RELEASE, d543.INTERFACE.name])
def test_after_ten_seconds_the_answer_is_empty(robot):
    rig, speech = listening(robot)
    assert [(event.words, event.limit, event.is_wait) for event in rig.of(StepStarted)] == [
        ("listening to the visitor", 10.0, True)]
    rig.clock.advance(9.5)
    rig.topics.publish(speech, "the weather")
    assert rig.tick() is RUNNING
    assert not rig.tree.wake.test_and_clear()
    rig.clock.advance(0.5)
    assert rig.tree.wake.test_and_clear()
    assert (rig.tick(), stored(rig)) == (SUCCESS, "")
    assert rig.of(LeafFinished)[0].summary == LeafSummary(
        "heard", "heard “the weather”: neither yes nor no")
    assert one_leaf("<HasVisitorResponded/>").tick() is FAILURE


def still_hearing(rig, leaf):
    """Return the set of topics on which the robot still hears something; the mission listens, and
    its time is over."""
    heard = {release_1_0.SPEECH}
    rig.topics.is_hearing = lambda topic: topic in heard
    assert rig.tick() is RUNNING
    rig.clock.advance(10.0)
    assert rig.tick() is RUNNING, leaf
    return heard


@pytest.mark.parametrize("leaf, silence", [("GetVisitorResponse", SUCCESS),
                                           ("IsYesNoUttered", FAILURE)])
def test_what_a_visitor_begins_to_say_in_time_is_waited_for(leaf, silence):
    rig = one_leaf("<{}/>".format(leaf), robotInterface=RELEASE)
    still_hearing(rig, leaf)
    rig.clock.advance(1.0)
    rig.topics.publish(release_1_0.SPEECH, "yes")
    assert (rig.tick(), stored(rig)) == (SUCCESS, "yes")
    assert rig.clock.next_due() is None
    rig = one_leaf("<{}/>".format(leaf), robotInterface=RELEASE)
    still_hearing(rig, leaf).clear()
    assert rig.tick() is silence, "what was heard was nothing"
    assert rig.clock.next_due() is None
    rig = one_leaf("<{}/>".format(leaf), robotInterface=RELEASE)
    heard = still_hearing(rig, leaf)
    rig.tree.wake.test_and_clear()
    rig.clock.advance(release_1_0.RESULT_WAIT)
    assert rig.tree.wake.test_and_clear(), "the limit of the result wakes the tree"
    heard.clear()
    assert rig.tick() is silence


@pytest.mark.parametrize("text", ["Error: no speech", "There was an Error", "error"])
def test_an_error_of_the_recognition_is_a_failure_at_once_and_the_policy_goes_on_without(text):
    rig, speech = listening()
    rig.clock.advance(0.1)
    rig.tree.wake.test_and_clear()
    rig.topics.publish(speech, text)
    assert rig.tree.wake.test_and_clear()
    assert (rig.tick(), stored(rig)) == (FAILURE, "")
    event, = rig.of(LeafFinished)
    failure = Failure(Cause.UNUSABLE_ANSWER, "the recognition says {!r}".format(text),
                      "/speechEvent/text")
    assert (event.failure, event.summary) == (failure, None)
    rig = one_leaf("<Fallback><GetVisitorResponse/><HandleFallBack/></Fallback>",
                   robotInterface=RELEASE)
    assert rig.tick() is RUNNING
    rig.clock.advance(0.1)
    rig.topics.publish(speech, text)
    assert (rig.tick(), stored(rig), rig.requests) == (SUCCESS, "", [])


def test_a_halted_leaf_listens_no_longer():
    told = []
    rig = one_leaf("<GetVisitorResponse/>", robotInterface=RELEASE)
    rig.topics.listen = lambda topic, seconds, *_: told.append((topic.name, seconds))
    assert rig.tick() is RUNNING
    rig.tree.halt()
    assert told == [("/speechEvent/text", 10.0), ("/speechEvent/text", 0.0)]
    rig.tree.wake.test_and_clear()
    rig.clock.advance(20.0)
    assert not rig.tree.wake.test_and_clear()
    assert [event.status for event in rig.of(LeafFinished)] == ["IDLE"]


@pytest.mark.parametrize("end", [
    lambda rig, speech: rig.topics.publish(speech, "yes") or rig.tick(),
    lambda rig, speech: rig.topics.publish(speech, "Error: no microphone") or rig.tick(),
    lambda rig, speech: rig.clock.advance(10.0) or rig.tick(),
    lambda rig, speech: rig.tree.halt()])
def test_an_answer_is_ignored_but_while_the_leaf_listens(end):
    rig = one_leaf("<GetVisitorResponse/>", robotInterface=RELEASE)
    rig.tree.setup(mission=rig.mission)
    rig.mission.begin_visit(rig.tree.blackboard, rig.clock.now())
    before = rig.topics.ignoring[release_1_0.SPEECH]
    assert rig.tick() is RUNNING
    listening = rig.topics.ignoring[release_1_0.SPEECH]
    rig.clock.advance(0.1)
    end(rig, release_1_0.SPEECH)
    assert rig.tree.is_idle
    assert (before, listening, rig.topics.ignoring[release_1_0.SPEECH]) == (NOT_ASKED, "",
                                                                            NOT_ASKED)


def test_an_answer_that_cannot_be_stored_is_a_failure():
    rig, speech = listening()
    write(rig, visitorResponse=[1])
    rig.clock.advance(0.1)
    rig.topics.publish(speech, "no")
    assert rig.tick() is FAILURE
    assert rig.of(LeafFinished)[0].failure.cause is Cause.MISSING_DATA


@pytest.mark.parametrize("response, result", [("yes", SUCCESS), ("no", SUCCESS), ("", FAILURE),
                                              (None, FAILURE)])
def test_an_empty_answer_is_none(response, result):
    rig = one_leaf("<HasVisitorResponded/>")
    if response is not None:
        write(rig, visitorResponse=response)
    assert rig.tick() is result


SCANS, SEEN = AttentionStatus("scanning", 1), AttentionStatus("scanning", 2)
SOCIAL, FOUND = AttentionStatus("social", 1), AttentionStatus("social", 2)
SEEKS, GAZE, GIVEN_UP = [AttentionStatus("seeking", value) for value in (1, 2, 3)]


@pytest.mark.parametrize("leaf, steps", [
    # within ten seconds
    ("IsVisitorPresent", [SOCIAL, RUNNING, 9.9, SEEN, RUNNING, FOUND, SUCCESS]),
    ("IsVisitorPresent", [RUNNING, 10.1, FAILURE]),
    # by a single message, whatever follows it until it is too old
    ("IsVisitorDiscovered", [
        RUNNING, ASLEEP, SEEN, SCANS, SCANS, SCANS, WOKEN, SUCCESS, SCANS, ASLEEP, SUCCESS, 2.1,
        WOKEN, SCANS, RUNNING]),
    # without a limit, until the robot gives up
    ("IsMutualGazeDiscovered", [
        RUNNING, 1000.0, SEEKS, RUNNING, NO_TIMER, ASLEEP, GIVEN_UP, WOKEN, FAILURE, SEEKS, ASLEEP,
        GAZE, WOKEN])])
def test_what_the_modes_of_attention_say(leaf, steps):
    follow(one_leaf("<{}/>".format(leaf), robotInterface=RELEASE), release_1_0.ATTENTION, steps)


def test_on_a_robot_of_the_document_a_face_is_a_visitor_who_is_present():
    follow(one_leaf("<IsVisitorPresent/>"), d543.FACES, [RUNNING, Faces(("1",), (False,)), SUCCESS])


def test_a_search_for_gaze_that_is_given_up_is_told_as_a_wait_that_failed():
    rig = one_leaf("<IsMutualGazeDiscovered/>", robotInterface=RELEASE)
    follow(rig, release_1_0.ATTENTION, [RUNNING, GIVEN_UP, FAILURE])
    assert rig.of(LeafFinished)[0].failure == Failure(
        Cause.CONDITION_FALSE, IsMutualGazeDiscovered.otherwise, "/overtAttention/mode", "")
    assert [(event.limit, event.is_wait) for event in rig.of(StepStarted)] == [(0.0, True)]


def says_mode(rig, state, value):
    rig.topics.publish(release_1_0.ATTENTION, AttentionStatus(state, value))


@pytest.mark.parametrize("mode_between, seconds, result", [
    ("", 1.9, SUCCESS), ("", 2.1, RUNNING), ("disabled", 0.1, RUNNING)])
def test_a_visitor_who_was_seen_a_moment_ago_is_present(mode_between, seconds, result):
    rig = one_leaf("<IsVisitorPresent/>", robotInterface=RELEASE)
    says_mode(rig, "social", 2)
    if mode_between:
        says_mode(rig, mode_between, 0)
    rig.clock.advance(seconds)
    write(rig, attentionSetAt=rig.clock.now())
    assert rig.tick() is result


def test_of_events_of_a_state_the_newest_is_kept_with_the_newest_message():
    topics = one_leaf("<IsVisitorDiscovered/>", robotInterface=RELEASE).topics
    for value in (2, 1, 2, 1, 3):
        topics.publish(release_1_0.ATTENTION, AttentionStatus("scanning", value))
    kept = topics.recent(release_1_0.ATTENTION)
    assert [sample.value.value for sample in kept] == [2, 3]
    for value in (2, 3):
        topics.publish(release_1_0.ATTENTION, AttentionStatus("seeking", value))
    assert [sample.value for sample in topics.recent(release_1_0.ATTENTION)][1:] == [("seeking", 3)]


@pytest.mark.parametrize("means, response", [("done", None), ("yes", "yes")])
def test_the_tablet_of_the_release_says_only_that_a_button_was_pressed(means, response):
    rig = one_leaf("<PressYesNoDialogue/>", robotInterface=RELEASE, tabletSuccessIs=means)
    assert (rig.tick(), rig.requests) == (SUCCESS, [Prompt(("Yes", "No"))])
    assert rig.tree.blackboard.get("visitorResponse") == response


# ---------------------------------------------------------------- whole missions, in both notations

TOUR = """<root BTCPP_format="4" main_tree_to_execute="0. Whole tour">
<BehaviorTree ID="0. Whole tour"><Sequence>
  <StartOfTree/>
  <SubTree ID="1. Find"/> <SubTree ID="2. Greet"/> <SubTree ID="3. Ask"/> <SubTree ID="4. Show"/>
  <Fallback><SayText name="7"/><HandleFallBack/></Fallback>
  <Fallback><PerformIconicGesture name="goodbye"/><HandleFallBack/></Fallback>
</Sequence></BehaviorTree>
<BehaviorTree ID="1. Find"><Sequence>
  <Fallback><SetSpeechEvent name="false"/><HandleFallBack/></Fallback>
  <Fallback><RetrieveListOfExhibits/><HandleFallBack/></Fallback>
  <Fallback><SetRobotPose/><HandleFallBack/></Fallback>
  <Fallback><SetAnimateBehavior name="enabled"/><HandleFallBack/></Fallback>
  <Fallback><SetOvertAttentionMode name="scanning"/><HandleFallBack/></Fallback>
  <IsVisitorDiscovered/>
</Sequence></BehaviorTree>
<BehaviorTree ID="2. Greet"><Sequence>
  <Fallback><SetAnimateBehavior name="disabled"/><HandleFallBack/></Fallback>
  <Fallback><PerformIconicGesture name="welcome"/><HandleFallBack/></Fallback>
  <Fallback><SayText name="4"/><HandleFallBack/></Fallback>
  <Fallback><SetOvertAttentionMode name="seeking"/><HandleFallBack/></Fallback>
  <IsMutualGazeDiscovered/>
</Sequence></BehaviorTree>
<BehaviorTree ID="3. Ask"><Sequence>
  <Fallback>
    <IsASREnabled/>
    <Sequence>
      <Fallback><SayText name="5"/><HandleFallBack/></Fallback>
      <Fallback><SayText name="1"/><HandleFallBack/></Fallback>
      <Fallback><PressYesNoDialogue/><HandleFallBack/></Fallback>
    </Sequence>
  </Fallback>
  <Fallback>
    <Inverter><IsASREnabled/></Inverter>
    <RetryUntilSuccessful num_attempts="2"><Sequence>
      <Fallback><SayText name="5"/><HandleFallBack/></Fallback>
      <SetSpeechEvent name="true"/>
      <Delay delay_msec="2000"><Fallback><GetVisitorResponse/><HandleFallBack/></Fallback></Delay>
      <SetSpeechEvent name="false"/>
      <HasVisitorResponded/>
    </Sequence></RetryUntilSuccessful>
    <AlwaysSuccess/>
  </Fallback>
  <Fallback>
    <IsVisitorResponseYes/>
    <ForceFailure><Fallback><SayText name="3"/><HandleFallBack/></Fallback></ForceFailure>
  </Fallback>
</Sequence></BehaviorTree>
<BehaviorTree ID="4. Show"><Sequence>
  <Fallback><SayText name="2"/><HandleFallBack/></Fallback>
  <Inverter><KeepRunningUntilFailure><Sequence>
    <IsListWithExhibit/>
    <Fallback><SelectExhibit/><HandleFallBack/></Fallback>
    <SubTree ID="5. Drive"/>
    <Fallback><SetOvertAttentionMode name="social"/><HandleFallBack/></Fallback>
    <Fallback><IsVisitorPresent/><ForceFailure><SubTree ID="6. Give up"/></ForceFailure></Fallback>
    <Fallback><DescribeExhibitSpeech name="1"/><HandleFallBack/></Fallback>
    <Fallback><SetOvertAttentionMode name="location"/><HandleFallBack/></Fallback>
    <Fallback><PerformDeicticGesture/><HandleFallBack/></Fallback>
    <Fallback><DescribeExhibitSpeech name="2"/><HandleFallBack/></Fallback>
  </Sequence></KeepRunningUntilFailure></Inverter>
</Sequence></BehaviorTree>
<BehaviorTree ID="5. Drive"><Sequence>
  <Fallback><SetOvertAttentionMode name="disabled"/><HandleFallBack/></Fallback>
  <Fallback><Navigate/><HandleFallBack/></Fallback>
</Sequence></BehaviorTree>
<BehaviorTree ID="6. Give up"><Sequence>
  <Fallback><RetrieveInitialLocation/><HandleFallBack/></Fallback>
  <SubTree ID="5. Drive"/>
  <ResetRobotPose/>
</Sequence></BehaviorTree>
</root>"""


def explicit(text):
    """Return the mission with its leaves as Groot1 wrote them: <Action ID="…"/>, <Condition
    ID="…"/>."""
    kinds = {spec.id: spec.kind.value for spec in leaves.SPECS}
    return re.sub(r"<(\w+)((?: name=\"\w+\")?/>)",
                  lambda found: found.group() if found.group(1) not in kinds
                  else '<{} ID="{}"{}'.format(kinds[found.group(1)], *found.groups()), text)


class Visitor:
    """Is seen, looks back, answers ``says`` after each question, and is gone after ``stops`` of the
    robot.

    What is told depends on the robot: by modes of attention (release 1.0), or by faces (the
    document).
    """

    def __init__(self, says=None, gaze=2, stops=99):
        self.says, self.gaze, self.stops = says, gaze, stops

    def __call__(self, rig):
        rig.clock.advance(0.5)
        modes = [request.state for request in rig.requests if isinstance(request, SetAttention)]
        is_here = sum(isinstance(request, GoTo) for request in rig.requests) <= self.stops
        robot = rig.mission.interface
        if robot.name == RELEASE:
            found = {"scanning": 2, "seeking": self.gaze, "social": 2 if is_here else 1}.get(
                modes[-1], 0) if modes else 0
            says_mode(rig, modes[-1] if modes else "disabled", found)
        else:
            rig.topics.publish(d543.FACES,
                               Faces(("1", ) if is_here else (), (True, ) if is_here else ()))
            if modes and modes[-1] == "seeking":
                rig.topics.publish(d543.ATTENTION, AttentionStatus("seeking", 1))
        questions = sum(isinstance(request, Say) and "Would you like" in request.text
                        for request in rig.requests)
        if self.says and questions:
            speech = (release_1_0 if robot.name == RELEASE else d543).SPEECH
            rig.topics.publish(speech, self.says[min(questions, len(self.says)) - 1])


def toured(visitor, text=TOUR, robot=RELEASE, **changed):
    """Return the exit code of one pass and the rig."""
    rig = Rig(text, robotInterface=robot, **changed)
    return rig.run(visitor), rig


class ReleaseDriver:
    """What the release's own test publishes: each second the mode that was set last, with 1 in the
    first message after that and 2 from then on; and "yes", whoever asks."""

    def __init__(self):
        self._due, self._modes, self._value = None, 0, 1

    def __call__(self, rig):
        """Move on to the next message, or to a timer of the mission before that."""
        self._due = self._due or rig.clock.now() + 0.5
        timer = rig.clock.next_due()
        if timer is not None and timer <= self._due:
            rig.clock.set_to(max(timer, rig.clock.now()))
            rig.clock.run_due()
            return
        rig.clock.set_to(self._due)
        self._due += 1.0
        modes = [request.state for request in rig.requests if isinstance(request, SetAttention)]
        self._value = 2 if len(modes) == self._modes else 1
        self._modes = len(modes)
        says_mode(rig, modes[-1] if modes else "disabled", self._value)
        rig.topics.publish(release_1_0.SPEECH, "yes")


def release_seconds(descriptions):
    """Return how long the release's own controller takes for the tour on its own driver.

    It waits for the messages of scanning, seeking and the first social; for the Delay, but not for
    an answer, since it uses one that came before; and a third of a second for each word of a
    description. The visitor is present at each further stop by an older message.
    """
    words = sum(len(text.split()) for text in descriptions)
    return 1.5 + 2.0 + 2.0 + 2.0 + words / 3.0


@pytest.mark.slow
def test_the_tour_takes_as_long_as_with_the_release_s_own_controller():
    mission = TOUR.replace('name="location"', 'name="social"')
    code, rig = toured(ReleaseDriver(), mission)
    assert (code, driven(rig)) == (0, STOPS)
    seconds = rig.clock.now() - Rig().clock.now()
    own = release_seconds(said(rig)[3:-1])
    assert own == pytest.approx(65.2, abs=0.1)  # 173 words
    assert abs(seconds - own) < 0.05 * own
    # what it was before: the robot drove off while it explained
    code, rig = toured(ReleaseDriver(), mission, waitForSpeech="none")
    assert rig.clock.now() - Rig().clock.now() < 0.5 * own


def said(rig):
    return [request.text for request in rig.requests if isinstance(request, Say)]


def driven(rig):
    return [request.goal for request in rig.requests if isinstance(request, GoTo)]


@pytest.mark.parametrize("text", [TOUR, explicit(TOUR)])
def test_a_visitor_who_says_yes_is_shown_each_stop_of_the_tour(text):
    code, rig = toured(Visitor(["yes"]), text)
    assert (code, driven(rig)) == (0, STOPS)
    assert rig.requests[:5] == [
        SetRecognitionLanguage("English"),
        SetRecognition(False),
        SetPose(START),
        SetAnimation("enabled"),
        SetAttention("scanning")]
    assert said(rig)[:3] == [PHRASES[4], PHRASES[5], PHRASES[2]]
    assert said(rig)[3:5] == ["Our tour of the robotics lab begins here.",
                              "Please stay close to me, so that you hear me well."]
    assert len(said(rig)) == 3 + 2 * len(STOPS) + 1
    assert said(rig)[-1] == PHRASES[7]
    assert rig.requests[-1] == PerformGesture("iconic", 3, 3000)
    # the first stop has nothing to point at or to look at
    assert sum(isinstance(request, PerformGesture) and request.type == "deictic"
               for request in rig.requests) == 6
    assert [request.target for request in rig.requests if request == SetAttention(
        "location", getattr(request, "target", None))][0] == Point(2.5, 2.0, 1.0)


@pytest.mark.parametrize("answers", [["no"], None, ["Error: timeout"], ["what is that"]])
def test_a_visitor_who_does_not_say_yes_is_given_no_tour(answers):
    code, rig = toured(Visitor(answers))
    assert (code, driven(rig)) == (3, [])
    assert said(rig) == [PHRASES[4]] + [PHRASES[5]] * (1 if answers == ["no"] else 2) + [PHRASES[3]]
    recognition = [
        request.is_enabled for request in rig.requests if isinstance(request, SetRecognition)]
    assert recognition[-1] is False


def test_a_second_answer_counts_and_takes_no_longer_than_ten_seconds():
    began = Rig().clock.now()
    code, rig = toured(Visitor(["Error: timeout", "yes"]))
    assert (code, driven(rig)) == (0, STOPS)
    code, rig = toured(Visitor(None))
    # two rounds of Delay and listening
    assert 2 * (2.0 + 10.0) <= rig.clock.now() - began < 2 * (2.0 + 10.0) + 5.0


def test_a_visitor_who_leaves_ends_the_tour_where_it_began():
    code, rig = toured(Visitor(["yes"], stops=2))
    assert driven(rig) == STOPS[:3] + [START]
    assert [request for request in rig.requests
            if isinstance(request, SetPose)] == [SetPose(START)] * 2
    # what the warning of this mission says: the tour goes on to its goodbye
    assert said(rig)[-1] == PHRASES[7]


def test_a_visitor_who_never_looks_back_ends_the_pass_when_the_robot_gives_up():
    code, rig = toured(Visitor(["yes"], gaze=3))
    assert (code, driven(rig), said(rig)) == (3, [], [PHRASES[4]])


@pytest.mark.parametrize("means, code, goals", [("done", 3, []), ("yes", 0, STOPS)])
def test_by_tablet_there_is_a_tour_only_if_a_press_means_yes(means, code, goals):
    ended, rig = toured(Visitor(), asrEnabled=False, tabletSuccessIs=means)
    assert (ended, driven(rig)) == (code, goals)
    assert not any(isinstance(request, SetRecognitionLanguage) for request in rig.requests)
    assert said(rig)[:3] == [PHRASES[4], PHRASES[5], PHRASES[1]]


@pytest.mark.parametrize("changed", [{}, {"asrEnabled": False}])
def test_the_same_mission_runs_on_a_robot_of_the_document(changed):
    code, rig = toured(Visitor(["yes"]), robot=d543.INTERFACE.name, conditionWait=30.0, **changed)
    assert (code, driven(rig)) == (0, [exhibit.location for exhibit in EXHIBITS])
    assert not any(isinstance(request, (SetPose, SetRecognition, SetRecognitionLanguage))
                   for request in rig.requests)


def test_what_a_robot_of_the_document_lacks_is_told_once_at_its_first_place():
    rig = Rig(TOUR)
    lines = TOUR.split("\n")
    told = [(lines[fault.line - 1].strip(), fault.text.split(" ")[0]) for fault in rig.tree.warnings
            if fault.code == "does-without" and "service" in fault.text]
    assert sorted(told) == [
        ('<Fallback><SetRobotPose/><HandleFallBack/></Fallback>', "SetRobotPose"),
        ('<Fallback><SetSpeechEvent name="false"/><HandleFallBack/></Fallback>', "SetSpeechEvent"),
        ("<ResetRobotPose/>", "ResetRobotPose"), ("<StartOfTree/>", "StartOfTree")]


@pytest.mark.parametrize("kind, times", [(SetAnimation, 2), (SetAttention, 2), (SetRecognition, 2),
                                         (SetPose, 2), (PerformGesture, 2), (Say, 2), (GoTo, 3)])
def test_a_refused_step_is_recovered_as_the_policy_says(kind, times):
    refused = []

    def answer(request):
        if isinstance(request, kind) and len(refused) < times - 1:
            refused.append(request)
            return Failure(Cause.REFUSED, "no", "service")
        return NotImplemented

    rig = Rig(TOUR, answer, robotInterface=RELEASE)
    assert (rig.run(Visitor(["yes"])), len(refused)) == (0, times - 1)
    assert set(refused) == {refused[0]}, "the same request again"
    assert [goal for goal, before in zip(driven(rig), [None] + driven(rig))
            if goal != before] == STOPS


# ----------------------------------------------------------------------------- what cannot be meant


def foreseen(body, robot=RELEASE, **changed):
    tree = load_text(file(body), leaves.registry(), "m.xml")
    return [(fault.line, fault.text)
            for fault in foresee(tree, settings.defaults(robotInterface=robot, **changed))]


def test_the_warnings_of_the_tour_stand_at_their_places():
    tree = load_text(TOUR, leaves.registry(), "m.xml")
    found = foresee(tree, settings.defaults(robotInterface=RELEASE))
    lines = TOUR.split("\n")
    assert [(lines[fault.line - 1].split(" name")[0].strip(), fault.text) for fault in found] == [
        ("<Fallback><SayText",
         "SayText says goodbye to a visitor who has left: the mission goes on to it after "
         "IsVisitorPresent failed"),
        ("<Fallback><PerformIconicGesture",
         "PerformIconicGesture says goodbye to a visitor who has left: the mission "
         "goes on to it after IsVisitorPresent failed"),
        ("<IsVisitorResponseYes/>",
         "with asrEnabled false IsVisitorResponseYes never succeeds, and the mission never comes "
         "to its stops")]
    assert all(fault.is_warning for fault in found)
    assert [fault.hint for fault in found[1:]] == [
        "end the mission, or the branch, with FAILURE before it",
        "without speech recognition, the mission stores no yes on a way to it"]
    told = foresee(tree, settings.defaults(robotInterface=RELEASE, tabletSuccessIs="yes"))
    assert [fault.text for fault in told] == [fault.text for fault in found[:2]]
    assert [fault.text
            for fault in foresee(tree, settings.defaults())] == [fault.text for fault in found[:2]]


def mode(state):
    return "<SetOvertAttentionMode name='{}'/>".format(state)


NEVER = "{} can never succeed: overtAttention reports {} only in the mode {}"


@pytest.mark.parametrize("body, robot, words", [
    ("\n<IsMutualGazeDiscovered/>", None, (
        "IsMutualGazeDiscovered", "the visitor's gaze", "seeking")),
    (mode("social") + "\n<IsMutualGazeDiscovered/>", None, (
        "IsMutualGazeDiscovered", "the visitor's gaze", "seeking")),
    (mode("seeking") + mode("social") + "\n<IsMutualGazeDiscovered/>", None, (
        "IsMutualGazeDiscovered", "the visitor's gaze", "seeking")),
    ("\n<IsMutualGazeDiscovered/>" + mode("seeking"), None, (
        "IsMutualGazeDiscovered", "the visitor's gaze", "seeking")),
    (mode("seeking") + "\n<IsMutualGazeDiscovered/>", None, None),
    ("<SeekOvertAttentionMode/>\n<IsMutualGazeDiscovered/>", None, None),
    ("<Fallback>{}<HandleFallBack/></Fallback>\n<IsMutualGazeDiscovered/>".format(mode("seeking")),
     None, None),
    ("<Parallel>{}<SayText name='4'/></Parallel>\n<IsMutualGazeDiscovered/>".format(
        mode("seeking")), None, None),
    ("<Parallel><IsMutualGazeDiscovered/>{}</Parallel>".format(mode("seeking")), None, None),
    ("<Fallback><AlwaysSuccess _skipIf='@x'/>\n<IsMutualGazeDiscovered/></Fallback>", None, (
        "IsMutualGazeDiscovered", "the visitor's gaze", "seeking")),
    ("<TryCatch><AlwaysSuccess/>\n<IsMutualGazeDiscovered/><AlwaysSuccess/></TryCatch>", None, (
        "IsMutualGazeDiscovered", "the visitor's gaze", "seeking")),
    ("<TryCatch><AlwaysFailure/>\n<IsMutualGazeDiscovered/></TryCatch>", None, (
        "IsMutualGazeDiscovered", "the visitor's gaze", "seeking")),
    ("<Switch2 variable='{@x}' case_1='1' case_2='2'>" + mode("seeking") +
     "\n<IsMutualGazeDiscovered/><AlwaysSuccess/></Switch2>", None, (
         "IsMutualGazeDiscovered", "the visitor's gaze", "seeking")),
    ("\n<IsVisitorDiscovered/>" + mode("scanning"), RELEASE, (
        "IsVisitorDiscovered", "a visitor", "scanning")),
    (mode("scanning") + "\n<IsVisitorDiscovered/>", RELEASE, None),
    (mode("scanning") + "\n<IsVisitorPresent/>", RELEASE, (
        "IsVisitorPresent", "the visitor's presence", "social")),
    (mode("social") + "\n<IsVisitorPresent/>", RELEASE, None),
    ("\n<IsVisitorDiscovered/>\n<IsVisitorPresent/>", d543.INTERFACE.name, None)])
def test_a_question_to_a_mode_that_was_not_set_is_told(body, robot, words):
    for each in [robot] if robot else [RELEASE, d543.INTERFACE.name]:
        expected = [(2, NEVER.format(*words))] if words else []
        assert foreseen("<Sequence>{}</Sequence>".format(body), each) == expected


def test_a_node_that_sets_the_mode_is_named():
    tree = load_text(file("<IsMutualGazeDiscovered/>"), leaves.registry(), "m.xml")
    assert [fault.hint for fault in foresee(tree, settings.defaults())] == [
        "no node before it sets that mode, as SeekOvertAttentionMode does"]


class Looks(ServiceLeaf):
    """A leaf of another package that sets a mode."""

    asks = SetAttention

    def request(self):
        return SetAttention("seeking")


class Nodded(InstantCondition):
    """A condition of another package on the visitor's answer."""

    PORTS = (VISITOR_RESPONSE.read(),)

    def holds(self):
        return self.get_input("visitorResponse") == "yes"


def test_leaves_of_other_packages_count_by_what_they_declare():
    registry = leaves.registry()
    registry.extend([leaf_spec("Looks", Looks, "", sets_mode="seeking"),
                     leaf_spec("Nodded", Nodded, "")])
    found = foresee(load_text(file(
        "<Sequence><Looks/><IsMutualGazeDiscovered/><IsYesNoUttered/>\n<Nodded/>"
        "<RetrieveListOfExhibits/><SelectExhibit/></Sequence>"), registry, "m.xml"),
        settings.defaults())
    assert [(fault.line, fault.text) for fault in found] == [(
        2, "with asrEnabled false Nodded is never reached, and the mission never comes to its "
           "stops")]


GONE = ("<Fallback><IsVisitorPresent/><ForceFailure><Navigate "
        "target='1;2;3'/></ForceFailure></Fallback>")


@pytest.mark.parametrize("body, is_told", [
    ("<Sequence>{}\n<SayText name='7'/></Sequence>", False),
    ("<Sequence><ForceSuccess>{}</ForceSuccess>\n<SayText name='7'/></Sequence>", True),
    ("<Sequence><ForceSuccess>{}</ForceSuccess>\n<SayText name='4'/></Sequence>", False),
    ("<Sequence><ForceSuccess>{}</ForceSuccess>\n<GoodbyeGesture/></Sequence>", True),
    ("<Sequence><Inverter><KeepRunningUntilFailure>{}</KeepRunningUntilFailure></Inverter>"
     "\n<SayText name='6'/>" "</Sequence>", True),
    ("<Fallback>{}\n<SayGoodByeSpeech/></Fallback>", True),
    ("<Sequence><ForceSuccess>{}</ForceSuccess><IsVisitorPresent/>\n<SayText name='7'/></Sequence>",
     False),
    ("<Sequence><ForceSuccess>{}</ForceSuccess><ScriptCondition code='@x'/>\n<SayText name='7'/></"
     "Sequence>", False),
    ("<Sequence><ForceSuccess>{}</ForceSuccess>\n<SayText name='7' _skipIf='@x'/></Sequence>",
     False),
    ("<Sequence>{}" + mode("seeking")
     + "<ForceSuccess><IsMutualGazeDiscovered/></ForceSuccess>\n<SayText name='7'/>" "</Sequence>",
     False),
    ("<IfThenElse>{}\n<SayText name='7'/><AlwaysFailure/></IfThenElse>", False),
    ("<IfThenElse>{}<AlwaysSuccess/>\n<SayText name='7'/></IfThenElse>", True),
    ("<Sequence><Fallback>{}<HandleFallBack/></Fallback>\n<SayText name='7'/></Sequence>", False),
    ("<RetryUntilSuccessful num_attempts='3'><Sequence>\n<SayText name='7'/>{}</Sequence></"
     "RetryUntilSuccessful>", True),
    ("<KeepRunningUntilFailure><Sequence>\n<SayText name='7'/><ForceSuccess>{}</ForceSuccess></"
     "Sequence>" "</KeepRunningUntilFailure>", True),
    ("<TryCatch>{}\n<SayText name='7'/></TryCatch>", True),
    ("<TryCatch>{}<AlwaysSuccess/><AlwaysSuccess/></TryCatch>\n<SayText name='7'/>", False),
    ("<TryCatch><AlwaysSuccess/>{}<AlwaysSuccess/></TryCatch>\n<SayText name='7'/>", False),
    ("<ForceSuccess><TryCatch>{}<AlwaysSuccess/></TryCatch></ForceSuccess>\n<SayText name='7'/>",
     True),
    ("<ForceSuccess><TryCatch><AlwaysSuccess/>{}</TryCatch></ForceSuccess>\n<SayText name='7'/>",
     False),
    ("<Fallback><TryCatch><AlwaysFailure/>{}</TryCatch>\n<SayText name='7'/></Fallback>", True),
    ("<IfThenElse>{}<AlwaysSuccess/></IfThenElse>\n<SayText name='7'/>", False),
    ("<Fallback><IfThenElse>{}<AlwaysSuccess/></IfThenElse>\n<SayText name='7'/></Fallback>", True),
    ("<IfThenElse><AlwaysSuccess/><ForceSuccess>{}</ForceSuccess></IfThenElse>\n"
     "<SayText name='7'/>", True),
    ("<IfThenElse><AlwaysSuccess/><AlwaysSuccess/><ForceSuccess>{}</ForceSuccess></IfThenElse>\n"
     "<SayText name='7'/>", False),
    ("<IfThenElse><AlwaysFailure/><ForceSuccess>{}</ForceSuccess><AlwaysSuccess/></IfThenElse>\n"
     "<SayText name='7'/>", False)])
def test_a_goodbye_to_a_visitor_who_has_left_is_told(body, is_told):
    found = foreseen("<Sequence>{}{}</Sequence>".format(mode("social"), body.format(GONE)))
    assert [(line, text.split(":")[0].split(" ", 1)[1]) for line, text in found] == (
        [(2, "says goodbye to a visitor who has left")] if is_told else [])


@pytest.mark.parametrize("before, question, is_told", [
    ("<Inverter><IsVisitorResponseYes/></Inverter>", "", False),
    ("", "", True),
    ("<Inverter><IsVisitorResponseYes/></Inverter>", "<IsYesNoUttered/>", True),
    ("<Inverter><IsVisitorResponseYes/></Inverter>", "<Script code=\"@visitorResponse:='no'\"/>",
     True)])
def test_a_goodbye_to_who_said_no_is_none_to_who_left_on_the_tour(before, question, is_told):
    """The answer that the visitor has given stays until another question."""
    body = ("<Sequence><IsYesNoUttered/><Fallback><Sequence><IsVisitorResponseYes/>"
            "<IsVisitorDiscovered/></Sequence><Sequence>{}{}\n<SayGoodByeSpeech/></Sequence>"
            "</Fallback></Sequence>")
    found = foreseen(body.format(question, before), d543.INTERFACE.name)
    assert [line for line, text in found if "says goodbye" in text] == [2] * is_told


@pytest.mark.parametrize("speech", SPEECHES, ids=lambda speech: speech.node)
def test_which_speeches_are_goodbyes_and_which_are_questions(speech):
    body = "<Sequence>{}<ForceSuccess>{}</ForceSuccess><{}/></Sequence>".format(
        mode("social"), GONE, speech.node)
    assert bool(foreseen(body)) is speech.is_farewell
    rig = one_leaf("<{}/>".format(speech.node))
    while rig.tick() is RUNNING:
        pass
    summary = rig.of(LeafFinished)[-1].summary
    assert (summary.kind == "asked") is speech.asks


def test_the_questions_of_table_4():
    asks = {speech.node: speech.asks for speech in SPEECHES}
    assert all(asks[node] for node in ("QueryTourSpeech", "SayYesNoSpeech", "PressYesNoSpeech"))
    assert not any(asks[node]
                   for node in ("WelcomeSpeech", "FollowMeSpeech", "MaybeAnotherTimeSpeech",
                                "EndTourSpeech", "HereIsTheDoorSpeech", "SayGoodByeSpeech"))


def test_a_goodbye_after_several_searches_for_the_visitor_is_told_once():
    missed = "<ForceSuccess><{}/></ForceSuccess>".format
    body = ("<Sequence><IfThenElse><ScriptCondition code='@x'/>{}{}</IfThenElse><SayGoodByeSpeech/>"
            "</Sequence>".format(missed("IsVisitorPresent"), missed("IsVisitorDiscovered")))
    assert [text.split(" to it ")[1] for _, text in foreseen(body, d543.INTERFACE.name)] == [
        "after IsVisitorDiscovered failed"]


@pytest.mark.parametrize("body, robot, how", [
    ("<Sequence><IsASREnabled/><GetVisitorResponse/>\n<IsVisitorResponseYes/><SelectExhibit/>"
     "</Sequence>",
     None, "is never reached"),
    ("<Sequence><GetVisitorResponse/>\n<IsVisitorResponseYes/><SelectExhibit/></Sequence>", None,
     "never succeeds"),
    ("<Sequence><PressYesNoDialogue/>\n<IsVisitorResponseYes/><SelectExhibit/></Sequence>",
     d543.INTERFACE.name, None),
    ("<Sequence><IsYesNoUttered/>\n<IsVisitorResponseYes/><SelectExhibit/></Sequence>", None,
     "is never reached"),
    ("<Sequence><GetVisitorResponse/>\n<IsVisitorResponseYes/><SayText name='3'/></Sequence>", None,
     None),
    ("<Sequence><GetVisitorResponse/><SelectExhibit/></Sequence>", None, None)])
def test_a_tour_that_is_never_given_without_recognition_is_told(body, robot, how):
    for each in [robot] if robot else [RELEASE, d543.INTERFACE.name]:
        assert foreseen(body, each) == ([(
            2,
            "with asrEnabled false IsVisitorResponseYes {}, and the mission never comes to its "
            "stops".format(how))] if how else [])


def test_what_one_use_of_a_subtree_knows_is_not_known_in_another():
    """The lab tour awaits a gaze before the question, and after a yes. The tablet of the release
    does not say what was pressed."""
    with open(folders.mission("lab_tour"), encoding="utf-8") as mission:
        tree = load_text(mission.read(), leaves.registry(), "m.xml")
    told = {name: {fault.code for fault in foresee(tree, settings.defaults(robotInterface=name))}
            for name in (RELEASE, d543.INTERFACE.name)}
    assert "no-stop" in told[RELEASE] and told[d543.INTERFACE.name] == set()


@pytest.mark.parametrize("body", [
    "<Sequence>" * 1900 + "<IsVisitorPresent/>" + "</Sequence>" * 1900,
    "<Sequence>" + "<IsVisitorPresent/>" * 2001 + "</Sequence>"])
def test_a_mission_that_is_too_large_to_be_followed_still_loads(body):
    assert foreseen(body) == []
    assert Rig(file(body), robotInterface=RELEASE).tree.warnings == []


@pytest.mark.slow
@pytest.mark.parametrize("body", ["<Sequence>" * 149 + "<IsVisitorPresent/>" + "</Sequence>" * 149,
                                  "<Sequence>" + "<IsVisitorPresent/>" * 1999 + "</Sequence>"])
def test_the_largest_missions_are_followed(body):
    assert len(foreseen(body)) == max(body.count("<IsVisitorPresent/>"), 1)
    assert foreseen("<Sequence>{}</Sequence>".format(body)) == []


def test_ways_through_nested_loops_are_followed_in_little_time():
    body = "<IsVisitorPresent/>"
    for number in range(40):
        body = ("<Sequence>{}<RetryUntilSuccessful num_attempts='3'><Fallback>{}{}</Fallback></"
                "RetryUntilSuccessful>"
                "</Sequence>".format(mode(["social", "seeking", "scanning"][number % 3]), body,
                                     mode("location")))
    assert foreseen(body) == []
