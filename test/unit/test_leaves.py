"""Each node of table 4: what it asks for, what it writes, and how it fails. Expected fields are the
contract's."""
import re
from functools import partial
from pathlib import Path

import pytest
from msgspec.structs import replace

from behavior_controller import leaves
from behavior_controller.bt.mission import load_text
from behavior_controller.bt.engine.node import Node, NodeError, TickError
from behavior_controller.bt.engine.ports import literal_fault
from behavior_controller.bt.engine.registry import Direction, Kind, NodeSpec, Port
from behavior_controller.bt.values.status import FAILURE, RUNNING, SUCCESS
from behavior_controller.errors import FaultsFound
from behavior_controller.run.events import LeafFinished, StepStarted, LeafSummary, StopChanged
from behavior_controller.robot.gateway import Cause, Failure
from behavior_controller.robot.d543 import FACES
from behavior_controller.robot.declarations import Evidence, Sense
from behavior_controller.robot.requests import (
    Answer, Exhibit, GoTo, Location, PerformGesture, Point, Prompt, QueryKnowledge, Say,
    SetAnimation, SetAttention)
from behavior_controller.robot.interfaces import INTERFACES
from behavior_controller.leaves import data, registry
from behavior_controller.leaves.base import (
    InstantAction, InstantCondition, ServiceLeaf, WorkingLeaf, leaf_spec)
from behavior_controller.leaves.conditions import TopicCondition
from behavior_controller.leaves.dialogue import UtteranceCondition
from behavior_controller.leaves.knowledge import LEAVING_OUT
from behavior_controller.leaves.speech import DescribeExhibitSpeech, FixedSpeech
from behavior_controller.config.node_facts import MissionSpec, whole_mission
from behavior_controller.config.phrases import SPEECHES
from mission_rig import ENTRANCE, EXHIBITS, HOME, one_leaf, refusal, service_of, write
from table_4 import TABLE_4


EXTENSIONS = """SeekOvertAttentionMode SeekingOvertAttentionMode LocationOvertAttentionMode DescribeExhibitSpeech_1
DescribeExhibitSpeech_2 SayGoodBye HandleFallback""".split()


def test_the_vocabulary_is_table_4_and_the_documented_extensions():
    assert len(TABLE_4) == 32
    assert {spec.id for spec in leaves.SPECS} >= set(TABLE_4 + EXTENSIONS)
    conditions = {spec.id for spec in leaves.SPECS if spec.kind.value == "Condition"}
    assert conditions & set(TABLE_4) == {name for name in TABLE_4 if name.startswith("Is")}
    assert [spec.id for spec in leaves.SPECS if not spec.description] == []


def test_a_default_is_a_value_of_its_port_s_type():
    wrong = [(spec.id, port.name, port.default)
             for spec in registry().values() for port in spec.ports
             if port.default is not None and literal_fault(port.default, port, {}) is not None]
    assert wrong == []


def test_an_entry_that_a_leaf_shares_is_cleared_for_the_next_visitor():
    shared = {port.default for spec in leaves.SPECS for port in spec.ports
              if str(port.default).startswith("{@")}
    assert shared <= {whole_mission(datum.name)
                      for datum in data.ALL}, "declare the entry in leaves/data.py"


def test_what_makes_no_sense_after_the_visitor_has_left():
    known = set(TABLE_4 + EXTENSIONS)
    assert known & {
        spec.id for spec in leaves.SPECS if isinstance(spec, MissionSpec) and spec.is_farewell} == {
        "HereIsTheDoorSpeech", "EndTourSpeech", "SayGoodByeSpeech", "SayGoodBye", "GoodbyeGesture"}


PLACE, TARGET = Location(1.0, 2.0, 45.0), Point(1.0, 2.0, 3.0)
DESCRIBED = {"currentExhibit": "robot", "description1": "one", "description2": "two"}


@pytest.mark.parametrize("element, entries, request_", [
    *[("<{}/>".format(node), {}, request) for node, request in [
        ("EnableAnimateBehavior", SetAnimation("enabled")),
        ("DisableAnimateBehavior", SetAnimation("disabled")),
        ("DisabledOvertAttentionMode", SetAttention("disabled")),
        ("SocialOvertAttentionMode", SetAttention("social")),
        ("ScanningOvertAttentionMode", SetAttention("scanning")),
        ("SeekOvertAttentionMode", SetAttention("seeking")),
        ("SeekingOvertAttentionMode", SetAttention("seeking")),
        ("WelcomeGesture", PerformGesture("iconic", 1, 3000)),
        ("GoodbyeGesture", PerformGesture("iconic", 3, 3000)),
        ("RetrieveListOfExhibits", QueryKnowledge("exhibits")),
        ("LookUpEntrance", QueryKnowledge("entrance")),
        ("LookUpHome", QueryKnowledge("home")),
        ("PressYesNoDialogue", Prompt(("Yes", "No")))]],
    ("<LocationOvertAttentionMode/>", {"gestureTarget": TARGET}, SetAttention("location", TARGET)),
    ("<PerformDeicticGesture/>", {"gestureTarget": TARGET},
     PerformGesture("deictic", 1, 3000, TARGET)),
    ("<PerformDeicticGesture/>", {"gestureTarget": Point(0.0, 0.0, 0.0)}, None),  # nothing there
    ("<Navigate/>", {"targetLocation": PLACE}, GoTo(PLACE)),
    # the name, or the part whatever the name, chooses the description
    *[("<DescribeExhibitSpeech{}/>".format(chosen), dict(DESCRIBED, which="2"), Say(text))
      for chosen, text in [
          ("", "one two"), (" name='1'", "one"), (" name='2'", "two"), (" name='other'", "one two"),
          ("_1", "one"), ("_2", "two"), (" part='1' name='1'", "one"),
          (" part='2' name='1'", "two"), (" part='both' name='1'", "one two"),
          (" part='{@which}' name='1'", "two")]],
    ("<DescribeExhibitSpeech_2/>", dict(DESCRIBED, description2=""), None),  # it is passed over
    # a mission may give another entry, or a value
    ('<Navigate target="1;2.5;-90"/>', {"targetLocation": PLACE}, GoTo(Location(1.0, 2.5, -90.0))),
    ('<Navigate target="{@there}"/>', {"there": PLACE}, GoTo(PLACE)),
    ('<Sequence><Script code="there := \'4;5; 6\'"/><Navigate target="{there}"/></Sequence>', {},
     GoTo(Location(4, 5, 6))),
    ('<PerformDeicticGesture target="1;2;3"/>', {}, PerformGesture("deictic", 1, 3000, TARGET)),
    ('<LocationOvertAttentionMode target="1;2;3"/>', {}, SetAttention("location", TARGET)),
    ('<Sequence><LookUpHome targetLocation="{@home}"/><Navigate target="{@home}"/></Sequence>',
     {"targetLocation": PLACE}, GoTo(HOME.location))])
def test_what_a_leaf_asks_for(element, entries, request_):
    rig = one_leaf(element)
    write(rig, **entries)
    assert rig.tick() is SUCCESS
    assert rig.requests[-1:] == [request_] * (request_ is not None)
    assert len(rig.requests) <= element.count("/>")


def test_the_deictic_gesture_is_that_of_the_configuration():
    rig = one_leaf("<PerformDeicticGesture/>", deicticGestureId=7, gestureDuration=1234)
    write(rig, gestureTarget=TARGET)
    assert rig.tick() is SUCCESS
    assert rig.requests == [PerformGesture("deictic", 7, 1234, TARGET)]


@pytest.mark.parametrize("node", [
    "DescribeExhibitSpeech", "PerformDeicticGesture", "Navigate", "SelectExhibit",
    "LocationOvertAttentionMode"])
def test_without_what_it_needs_a_leaf_fails_and_asks_for_nothing(node):
    rig = one_leaf("<{}/>".format(node))
    assert rig.tick() is FAILURE
    assert rig.requests == []
    assert rig.of(LeafFinished)[0].failure.cause is Cause.MISSING_DATA


@pytest.mark.parametrize("element, words", [
    ('<Navigate target="2.0;3,5;90"/>', "write x;y;theta, in metres and degrees"),
    ('<Navigate target="1;2"/>', "write x;y;theta"),
    ('<Navigate target="1;2;inf"/>', "write x;y;theta"),
    ('<PerformDeicticGesture target="left"/>', "write x;y;z, in metres"),
    ('<IsListWithExhibit exhibits="robot"/>', "a value of type Exhibits has no text"),
    ('<DescribeExhibitSpeech part="3"/>', "the part cannot be 3; allowed: 1, 2, both")])
def test_a_value_that_is_none_is_refused_at_load(element, words):
    with pytest.raises(FaultsFound) as caught:
        one_leaf(element)
    assert [words in str(fault) for fault in caught.value.faults] == [True]


@pytest.mark.parametrize("element, entry, value", [
    ("<Navigate/>", "targetLocation", Point(1.0, 2.0, 3.0)),
    ("<Navigate/>", "targetLocation", "there"),
    ("<PerformDeicticGesture/>", "gestureTarget", 5),
    ("<SelectExhibit/>", "exhibits", "robot"),
    ("<IsListWithExhibit/>", "nextExhibit", "first"),
    ("<IsVisitorResponseYes/>", "visitorResponse", [1]),
    ("<IsMutualGazeDiscovered/>", "attentionSetAt", "now"),
    ("<IsYesNoUttered/>", "questionAskedAt", [1]),
    ("<RetrieveListOfExhibits/>", "nextExhibit", "first"),
    ("<SocialOvertAttentionMode/>", "attentionSetAt", [1]),
    ("<DescribeExhibitSpeech part='{@part}'/>", "part", "3")])
def test_data_of_the_wrong_kind_is_a_failure_and_never_an_exception(element, entry, value):
    rig = one_leaf(element)
    write(rig, currentExhibit="robot")
    write(rig, **{entry: value})
    write(rig, **{entry: value})  # a text has its type after the second time
    assert rig.tick() is FAILURE
    failure = rig.of(LeafFinished)[0].failure
    assert failure.cause is Cause.MISSING_DATA and failure.message


@pytest.mark.parametrize("element", [
    "<IsYesNoUttered/>", "<IsMutualGazeDiscovered/>", "<IsVisitorPresent/>",
    "<SetOvertAttentionMode name='social'/>", "<SetRobotPose/>",
    "<Fallback><WelcomeSpeech/><HandleFallBack/></Fallback>",
    "<ScriptCondition code='@questionAskedAt &gt; 0'/>", "<Script code='left := @leftOutExhibits'/>"
])
def test_nothing_has_to_write_what_a_leaf_can_do_without(element):
    assert "never-written" not in {warning.code for warning in one_leaf(element).tree.warnings}


def test_what_a_leaf_cannot_do_without_has_to_be_written():
    assert [warning.code for warning in one_leaf("<Navigate/>").tree.warnings] == ["never-written"]


def test_the_part_of_a_description_need_not_be_given():
    assert "port-missing" not in {
        warning.code for warning in one_leaf("<DescribeExhibitSpeech/>").tree.warnings}


@pytest.mark.parametrize("result", [Answer(),
                                    Failure(Cause.REFUSED, "no", "/textToSpeech/say_text")])
def test_a_question_that_cannot_note_its_time_fails_and_says_so_once(result):
    rig = one_leaf("<QueryTourSpeech/>", lambda request: result)
    write(rig, questionAskedAt=[1])
    assert rig.tick() is FAILURE
    event, = rig.of(LeafFinished)
    # the port and the entry
    assert event.failure.cause is Cause.MISSING_DATA
    assert event.failure.message.count("questionAskedAt") == 2


def test_exhibits_are_selected_in_tour_order():
    rig = one_leaf("<Sequence><RetrieveListOfExhibits/><SelectExhibit/><SelectExhibit/><Inverter>"
                   "<IsListWithExhibit/></Inverter></Sequence>")
    assert rig.tick() is SUCCESS
    second = EXHIBITS[1]
    board = rig.tree.blackboard
    assert board.get("exhibits") == list(EXHIBITS)
    assert (board.get("currentExhibit"), board.get("targetLocation"), board.get("gestureTarget"),
            board.get("description1"), board.get("description2"), board.get("nextExhibit")) == (
        second.name, second.location, second.gesture, second.description1, second.description2, 2)


def test_each_exhibit_of_the_tour_is_begun_and_over():
    rig = one_leaf("<Sequence><RetrieveListOfExhibits/><IsListWithExhibit/><SelectExhibit/>"
                   "<IsListWithExhibit/><SelectExhibit/><Inverter><IsListWithExhibit/></Inverter>"
                   "</Sequence>")
    assert rig.tick() is SUCCESS
    select, ask = "SelectExhibit", "IsListWithExhibit"
    assert rig.of(StopChanged) == [
        StopChanged(uid, node, "{}::{}".format(node, uid), number, 2, "exhibit {}".format(number),
                    state, "exhibit" if state == "begun" else "")
        for uid, node, number, state in [(4, select, 1, "begun"), (5, ask, 1, "over"),
                                         (6, select, 2, "begun"), (8, ask, 2, "over")]]


def test_a_list_that_another_node_has_written_begins_at_its_start():
    rig = one_leaf("<Sequence><IsListWithExhibit/><SelectExhibit/></Sequence>")
    write(rig, exhibits=[ENTRANCE])
    assert (rig.tick(), rig.tree.blackboard.get("nextExhibit")) == (SUCCESS, 1)


def test_after_the_last_exhibit_none_can_be_selected():
    rig = one_leaf("<SelectExhibit/>")
    write(rig, exhibits=list(EXHIBITS), nextExhibit=2)
    assert rig.tick() is FAILURE
    assert rig.of(LeafFinished)[0].failure == Failure(Cause.MISSING_DATA,
                                                      "no exhibit is left to select")


@pytest.mark.parametrize("following", [-1, 0, 3])
def test_no_exhibit_is_over_before_the_first_and_after_the_last(following):
    rig = one_leaf("<IsListWithExhibit/>")
    write(rig, exhibits=list(EXHIBITS), nextExhibit=following)
    assert rig.tick() is (FAILURE if following == 3 else SUCCESS)
    assert rig.of(StopChanged) == []


def test_a_list_that_is_asked_for_again_begins_at_its_start():
    rig = one_leaf("<RetrieveListOfExhibits/>")
    write(rig, exhibits=[ENTRANCE], nextExhibit=1, leftOutExhibits=[0])
    assert rig.tick() is SUCCESS
    board = rig.tree.blackboard
    assert (board.get("exhibits"), board.get("nextExhibit"),
            board.get("leftOutExhibits")) == (list(EXHIBITS), 0, [])


@pytest.mark.parametrize(
    "node", ["DisabledOvertAttentionMode", "SocialOvertAttentionMode", "SeekOvertAttentionMode"])
def test_a_mode_notes_when_it_was_set(node):
    rig = one_leaf("<{}/>".format(node), lambda request: None)
    rig.tick()
    rig.clock.advance(2.0)
    rig.gateway.calls[0].finish(Answer())
    assert rig.tick() is SUCCESS
    assert rig.tree.blackboard.get("attentionSetAt") == 1002.0


@pytest.mark.parametrize("node", ["QueryTourSpeech", "SayYesNoSpeech", "PressYesNoSpeech"])
@pytest.mark.parametrize(
    "result", [Answer(), Failure(Cause.REFUSED, "no", "/textToSpeech/say_text")])
def test_a_question_notes_when_it_was_over(node, result):
    rig = one_leaf("<{}/>".format(node), lambda request: None)
    rig.tick()
    rig.clock.advance(2.0)
    rig.gateway.calls[0].finish(result)
    rig.tick()
    assert rig.tree.blackboard.get("questionAskedAt") == 1002.0


def test_other_speeches_are_no_questions():
    rig = one_leaf("<WelcomeSpeech/>")
    assert rig.tick() is SUCCESS
    assert rig.tree.blackboard.get("questionAskedAt") is None


@pytest.mark.parametrize("home", ["LookUpHome", "RetrieveInitialLocation"])
def test_the_entrance_has_a_gesture_target_and_home_has_none(home):
    rig = one_leaf("<LookUpEntrance/>")
    assert rig.tick() is SUCCESS
    assert rig.tree.blackboard.get("targetLocation") == ENTRANCE.location
    assert rig.tree.blackboard.get("gestureTarget") == ENTRANCE.gesture
    rig = one_leaf("<Sequence><LookUpEntrance/><{}/></Sequence>".format(home))
    assert rig.tick() is SUCCESS
    assert rig.tree.blackboard.get("targetLocation") == HOME.location
    assert rig.tree.blackboard.get("gestureTarget") is None


@pytest.mark.parametrize("node, answer, cause, message", [
    ("RetrieveListOfExhibits", Answer(), Cause.MISSING_DATA, "the knowledge base has no exhibits"),
    ("LookUpEntrance", Answer(), Cause.UNUSABLE_ANSWER,
     "the knowledge base has 0 places for entrance; exactly 1 is needed"),
    ("LookUpHome", Answer(exhibits=EXHIBITS), Cause.UNUSABLE_ANSWER,
     "the knowledge base has 2 places for home; exactly 1 is needed"),
    ("PressYesNoDialogue", Answer(""), Cause.MISSING_DATA, "the visitor pressed nothing"),
    ("PressYesNoDialogue", Answer("0"), Cause.MISSING_DATA, "the visitor pressed nothing"),
    ("PressYesNoDialogue", Answer("perhaps"), Cause.UNUSABLE_ANSWER,
     "the response 'perhaps' is none of Yes, No")])
def test_answers_that_are_none(node, answer, cause, message):
    rig = one_leaf("<{}/>".format(node), lambda request: answer)
    assert rig.tick() is FAILURE
    event, = rig.of(LeafFinished)
    failure = Failure(cause, message, service_of(rig.requests[0]))
    assert (event.failure, event.summary) == (failure, None)


@pytest.mark.parametrize("response, stored", [("Yes", "yes"), ("1", "yes"), ("no", "no"),
                                              ("2", "no")])
def test_the_tablet_stores_the_answer(response, stored):
    rig = one_leaf("<PressYesNoDialogue/>", lambda request: Answer(response))
    assert rig.tick() is SUCCESS
    assert rig.tree.blackboard.get("visitorResponse") == stored
    label = {"yes": "Yes", "no": "No"}[stored]
    assert rig.of(LeafFinished)[0].summary == LeafSummary(
        "pressed", "the visitor pressed “{}”".format(label), stored)


@pytest.mark.parametrize("stored, result", [("yes", SUCCESS), ("no", FAILURE), (None, FAILURE)])
def test_the_stored_answer(stored, result):
    rig = one_leaf("<IsVisitorResponseYes/>")
    if stored:
        write(rig, visitorResponse=stored)
    assert rig.tick() is result


@pytest.mark.parametrize("enabled, result", [(True, SUCCESS), (False, FAILURE)])
def test_the_configuration_decides_about_speech(enabled, result):
    assert one_leaf("<IsASREnabled/>", asrEnabled=enabled).tick() is result


def test_the_start_forgets_the_last_visitor():
    rig = one_leaf("<START_OF_TREE/>")
    write(rig, visitorResponse="yes", exhibits=list(EXHIBITS), nextExhibit=1,
          targetLocation=Location(1.0, 1.0, 1.0), gestureTarget=Point(1.0, 1.0, 1.0),
          currentExhibit="robot", description1="one", description2="two")
    assert rig.tick() is SUCCESS
    assert {key: entry.value for key, entry in rig.tree.blackboard.local.items()} == {
        "questionAskedAt": 1000.0, "attentionSetAt": 1000.0}


CALLERS = [spec.id for spec in leaves.SPECS if not spec.names
           and spec.id.endswith(("Speech", "Mode", "Behavior", "GoodBye", "Exhibits"))
           or spec.id.startswith(("LookUp", "PressYesNoD", "Welcome", "Goodbye"))]


@pytest.mark.slow
@pytest.mark.parametrize("node", CALLERS)
def test_every_cause_of_failure_is_recorded_as_it_came(node):
    for cause in list(Cause)[:8]:
        rig = one_leaf("<{}/>".format(node),
                       lambda request: Failure(cause, "because", service_of(request)))
        write(rig, gestureTarget=TARGET, **DESCRIBED)
        assert rig.tick() is FAILURE
        failure = rig.of(LeafFinished)[0].failure
        assert failure == Failure(cause, "because", service_of(rig.requests[0]))
        assert rig.tree.root.failure == failure


def test_a_leaf_waits_for_its_answer_and_is_woken_by_it():
    rig = one_leaf("<WelcomeSpeech/>", lambda request: None)
    assert rig.tick() is RUNNING
    assert not rig.tree.wake.test_and_clear()
    rig.gateway.calls[0].finish(Answer())
    assert rig.tree.wake.test_and_clear()
    assert rig.tick() is SUCCESS
    assert len(rig.requests) == 1


@pytest.mark.parametrize("node, words, deadline", [
    ("WelcomeSpeech", "saying", 60.0), ("QueryTourSpeech", "asking", 60.0)])
def test_a_leaf_tells_what_it_does_and_for_how_long_at_most(node, words, deadline):
    rig = one_leaf("<{}/>".format(node), lambda request: None)
    rig.tick()
    path, what = node + "::1", "“{}”".format(rig.requests[0].text)
    assert rig.of(StepStarted) == [StepStarted(1, node, path, words, what, deadline, False)]


def test_a_leaf_names_its_gesture_and_the_places_that_the_robot_has_learnt():
    there = "<Navigate/><PerformDeicticGesture/><LocationOvertAttentionMode/>"
    rig = one_leaf("<Sequence><WelcomeGesture/><RetrieveListOfExhibits/><SelectExhibit/>"
                   "{0}<LookUpEntrance/>{0}" "<LookUpHome/><Navigate/></Sequence>".format(there))
    assert rig.tick() is SUCCESS
    assert [(event.words, event.what) for event in rig.of(StepStarted) if event.what] == [
        ("making", "the welcome gesture"), ("driving", "to exhibit 1"),
        ("pointing", "at exhibit 1"), ("looking", "at exhibit 1"), ("driving", "to the entrance"),
        ("pointing", "at the entrance"), ("looking", "at the entrance"), ("driving", "home")]


def test_places_with_the_same_coordinates_keep_their_names():
    here, there = Location(1.0, 2.0, 3.0), Point(1.0, 2.0, 3.0)
    places = [Exhibit(name, "", "", here, there) for name in ("first", "second", "door")]

    def answer(request):
        if not isinstance(request, QueryKnowledge):
            return Answer()
        return Answer(exhibits=tuple(places[:2] if request.what == "exhibits" else places[2:]))

    go = "<Navigate/><PerformDeicticGesture/>"
    rig = one_leaf("<Sequence><LookUpEntrance/><RetrieveListOfExhibits/>{0}<SelectExhibit/>{0}"
                   "<Navigate target='1;2;4'/><SelectExhibit/>{0}</Sequence>".format(go), answer)
    assert rig.tick() is SUCCESS
    assert [event.what for event in rig.of(StepStarted) if event.what] == [
        "to the entrance", "at the entrance", "to first", "at first", "to 1, 2, 4°", "to second",
        "at second"]


@pytest.mark.parametrize("node, summary", [
    ("WelcomeSpeech", LeafSummary("said", "said “{}”")),
    ("QueryTourSpeech", LeafSummary("asked", "asked “{}”", "asked")),
    ("SocialOvertAttentionMode", None)])
def test_a_leaf_tells_what_it_has_done_unless_that_matters_to_nobody(node, summary):
    rig = one_leaf("<{}/>".format(node))
    rig.tick()
    assert rig.of(LeafFinished)[0].summary == (
        summary and replace(summary, text=summary.text.format(rig.requests[0].text)))


def test_a_halted_leaf_drops_its_answer():
    rig = one_leaf("<WelcomeSpeech/>", lambda request: None)
    rig.tick()
    rig.tree.halt()
    assert rig.gateway.dropped == rig.requests
    rig.gateway.calls[0].finish(Answer())
    assert rig.tick() is RUNNING  # a new round, a new request
    assert len(rig.requests) == 2
    assert [event.status for event in rig.of(LeafFinished)] == ["IDLE"]


@pytest.mark.parametrize("leaf",
                         ["<WelcomeSpeech/>", "<IsVisitorResponseYes/>", "<SelectExhibit/>"])
def test_a_leaf_tells_how_long_it_took_and_why_it_failed(leaf):
    rig = one_leaf(
        "<Sequence><Delay delay_msec='1000'><AlwaysSuccess/></Delay>{}</Sequence>".format(leaf),
        lambda request: None)
    rig.tick()
    rig.clock.advance(1.0)
    if rig.tick() is RUNNING:
        rig.clock.advance(2.0)
        rig.gateway.calls[0].finish(Failure(Cause.REFUSED, "not today", "/textToSpeech/say_text"))
        rig.tick()
    event, node = rig.of(LeafFinished)[0], rig.tree.nodes[-1]
    assert (event.seconds, event.status) == (2.0 if rig.requests else 0.0, "FAILURE")
    assert node.feedback_message == event.failure.message != ""


def test_a_success_leaves_no_message():
    rig = one_leaf("<WelcomeSpeech/>", lambda request: refusal(request)
                   if len(rig.requests) == 1 else Answer())
    rig.tick()
    assert rig.tree.nodes[-1].feedback_message == "the server refused"
    rig.tick()
    assert rig.tree.nodes[-1].feedback_message == ""


def test_the_old_spelling_of_handlefallback_loads_with_a_warning():
    rig = one_leaf("<HandleFallback/>")
    assert [str(warning) for warning in rig.tree.warnings] == [
        "<text>:1:49: warning: HandleFallback is an old spelling; write HandleFallBack"]


def test_only_what_is_read_may_be_left_out():
    ports = [(spec.id, port) for spec in leaves.SPECS for port in spec.ports if port.is_optional]
    assert all(port.direction is not Direction.OUT for _, port in ports)
    # a recovery needs no list, a pose none yet; without a time all evidence counts
    assert {node: [port.name for other, port in ports if other == node] for node, _ in ports} == {
        "IsMutualGazeDiscovered": ["attentionSetAt"], "IsYesNoUttered": ["questionAskedAt"],
        "DescribeExhibitSpeech": ["part"], "SetOvertAttentionMode": ["target"],
        "SetRobotPose": ["exhibits"], "ResetRobotPose": ["exhibits"],
        "HandleFallBack": [port.name for port in LEAVING_OUT],
        "HandleFallback": [port.name for port in LEAVING_OUT]}


def test_every_leaf_can_be_made_without_anything_running():
    for spec in leaves.registry().values():
        assert spec.factory((spec.names or ("name",))[0]) is not None


def test_exhibits_are_plain_records():
    assert Exhibit("a", "b", "c", Location(1.0, 2.0, 3.0), Point(1.0, 2.0,
                                                                 3.0)).location.theta_deg == 3.0


@pytest.mark.parametrize("leaf, answer, expected", [
    ("WelcomeSpeech", Answer(), "/textToSpeech/say_text"),
    ("WelcomeSpeech", Failure(Cause.REFUSED, "no", ""), "/textToSpeech/say_text"),
    ("WelcomeSpeech", Failure(Cause.REFUSED, "no", "/other/say_text"), "/other/say_text"),
    ("IsVisitorDiscovered", None, "/faceDetection/data"), ("IsASREnabled", None, "")])
def test_a_finished_leaf_tells_its_service_or_topic(leaf, answer, expected):
    rig = one_leaf("<{}/>".format(leaf), lambda request: answer)
    rig.tick()
    assert [event.resource for event in rig.of(LeafFinished)] == [expected]


def test_requests_and_topics_of_a_node_type_are_those_of_its_leaf():
    spec = {found.id: found for found in leaves.SPECS}
    assert (spec["Navigate"].calls, spec["IsYesNoUttered"].listens) == ((GoTo,), (Sense.UTTERANCE,))
    assert (spec["SelectExhibit"].calls, spec["HandleFallBack"].calls) == ((), ())


def test_each_request_of_a_leaf_has_its_service():
    lacking = [(spec.id, request.__name__) for spec in leaves.mission_specs()
               for request in spec.calls
               if not any(robot.serves(request) for robot in INTERFACES.values())]
    assert lacking == [], ("no service is declared for the request in "
                           "behavior_controller.robot.declarations")


def test_a_leaf_that_does_not_say_what_it_asks_for_is_refused_at_its_registration():
    class FixtureSilent(ServiceLeaf):
        asks = GoTo
    with pytest.raises(ValueError, match=r"FixtureSilent, has no request\(\)"):
        registry().extend([leaf_spec("FixtureSilent", FixtureSilent, "Has no method request.")])


@pytest.mark.parametrize("wanted, words", [
    ("ding", "returned 'ding', which is no Say"), (SetAnimation("enabled"), ".*which is no Say"),
    (Say(5), ".*wrong field: .*str")])
def test_a_request_of_a_wrong_kind_is_an_error_of_its_leaf(wanted, words):
    class FixtureBell(ServiceLeaf):
        asks = Say

        def request(self):
            return wanted
    with pytest.raises(NodeError, match=r"its request\(\) .unit/test_leaves.py:\d+. " + words):
        next(FixtureBell("bell").try_once())


@pytest.mark.parametrize("leaf, rule", [
    (InstantAction, "act"), (InstantCondition, "holds"), (WorkingLeaf, "try_once, work"),
    (ServiceLeaf, "request, try_once, work"), (TopicCondition, "own_evidence, is_evidence"),
    (UtteranceCondition, "meaning, keep")])
def test_a_leaf_that_bypasses_its_base_class_is_refused_with_what_to_write(leaf, rule):
    bypass = type("FixtureBypass", (leaf,), {
        "asks": Say, "own_evidence": Evidence(FACES), "update": lambda self: SUCCESS})
    with pytest.raises(ValueError, match=(
            rf"FixtureBypass.update .* bypasses the rule of the class {leaf.__name__}: write "
            f"{rule} instead")):
        registry().extend([leaf_spec("FixtureBypass", bypass, "Bypasses.")])


class FixtureTwice(WorkingLeaf):
    """Says two texts, half a second apart."""

    asks = Say
    wanted = (Say("one", "English"), Say("two", "English"))

    def try_once(self):
        for wanted in self.wanted:
            answer = yield from self.ask(wanted)
            if isinstance(answer, Failure):
                return answer
            yield from self.pause(0.5)


def test_an_action_of_several_ticks_has_its_steps_its_line_and_its_start_check(monkeypatch):
    rig = rig_with(monkeypatch, FixtureTwice, "<FixtureTwice/>")
    for _ in range(3):
        rig.tick()
        rig.clock.advance(0.5)
    steps, ends = [event.what for event in rig.of(StepStarted)], rig.of(LeafFinished)
    assert steps == ["“one”", "“two”"]
    assert [(end.status, end.summary.text) for end in ends] == [("SUCCESS", "said “two”")]
    assert rig.tree.nodes[-1].spec.calls == (Say,)


def test_a_request_that_a_leaf_does_not_name_is_an_error_of_it(monkeypatch):
    class FixtureOther(FixtureTwice):
        wanted = (SetAnimation("enabled"),)

    rig = rig_with(monkeypatch, FixtureOther, "<FixtureOther/>")
    with pytest.raises(TickError, match="SetAnimation.*name its kind in asks of .* FixtureOther"):
        rig.tick()


def rig_with(monkeypatch, leaf, element):
    """Return a rig whose mission is one leaf of this type, which answers each request."""
    types = registry()
    types.extend([leaf_spec(leaf.__name__, leaf, "A leaf with a mistake.")])
    monkeypatch.setattr(leaves, "registry", lambda: types)
    return one_leaf(element, lambda request: Answer())


@pytest.mark.parametrize("leaf", (InstantAction, ServiceLeaf))
@pytest.mark.parametrize("returned", (SUCCESS, True))
def test_a_leaf_that_returns_a_status_in_place_of_a_failure_is_told_what_is_allowed(
        monkeypatch, leaf, returned):
    class FixtureDone(leaf):
        asks = Say
        request = staticmethod(lambda: Say("Hello"))
        act = accept = staticmethod(lambda *answer: returned)

    rig = rig_with(monkeypatch, FixtureDone, "<FixtureDone/>")
    with pytest.raises(TickError, match=r"FixtureDone.*returned .*allowed: None"):
        rig.tick()
        rig.tick()


def test_a_port_that_a_leaf_does_not_declare_is_an_error_with_the_ports_that_it_has(monkeypatch):
    class FixtureNear(InstantAction):
        PORTS = (Port("colour"), Port("place"))

        def act(self):
            self.get_input("color")

    rig = rig_with(monkeypatch, FixtureNear, "<FixtureNear colour='red' place='hall'/>")
    with pytest.raises(TickError, match=r"\[color\].*colour, place.*test_leaves\.py:\d+"):
        rig.tick()


def test_each_leaf_and_decorator_has_its_row():
    def below(kind):
        return {kind}.union(*map(below, kind.__subclasses__()))

    made = {base for spec in leaves.SPECS
            for base in type(spec.factory((spec.names or ("name",))[0])).__mro__}
    ours = {kind for kind in below(Node) if kind.__module__.startswith(leaves.__name__ + ".")}
    assert {kind.__qualname__
            for kind in ours - made} == set(), "no row in the SPECS of their modules"


def test_each_node_type_is_in_a_test():
    """Fixed phrases are rows, which are tested together."""
    texts = [path.read_text(encoding="utf-8") for path in Path(__file__).parent.glob("test_*.py")]
    names = set(re.findall(r"\w+", " ".join(texts)))
    types = {spec.id for spec in leaves.SPECS} - {speech.node for speech in SPEECHES}
    assert types - names == set(), "write a test of each, in test_leaves.py"


def test_a_node_type_has_no_name_of_a_fixture():
    assert [spec.id for spec in leaves.SPECS if spec.id.startswith("Fixture")] == []


BARE = "<root BTCPP_format='4'><BehaviorTree ID='M'><FixtureBare/></BehaviorTree></root>"


@pytest.mark.parametrize("leaf",
                         [partial(FixedSpeech, phrase="WelcomeSpeech"), DescribeExhibitSpeech])
def test_a_leaf_that_is_declared_without_its_facts_is_refused_at_load(leaf):
    types = registry()
    types.extend([NodeSpec("FixtureBare", Kind.ACTION, leaf)])
    with pytest.raises(FaultsFound,
                       match="FixtureBare is a mission leaf.*declare it with leaf_spec"):
        load_text(BARE, types)


def test_a_condition_that_does_not_say_what_it_checks_is_refused_at_load():
    types = registry()
    types.extend([leaf_spec("FixtureBare", TopicCondition, "A condition without its sense.")])
    with pytest.raises(FaultsFound,
                       match="FixtureBare does not say what it checks: its class needs a sense, or "
                       "own_evidence"):
        load_text(BARE, types)


@pytest.mark.parametrize("kind", [
    type("Never", (InstantCondition,), {"holds": lambda self: False}),
    type("Seen", (TopicCondition,), {"sense": Sense.VISITOR})])
def test_a_condition_needs_no_message_of_its_own(kind, monkeypatch):
    types = registry()
    types.extend([leaf_spec("FixtureBare", kind, "A condition.")])
    monkeypatch.setattr(leaves, "registry", lambda: types)
    rig = one_leaf("<FixtureBare/>")
    assert rig.tick() is FAILURE
    assert rig.of(LeafFinished)[-1].failure.message.partition(";")[0] == "FixtureBare does not hold"


@pytest.mark.parametrize("leaf, words", [
    ("Say", "'Say', the leaf of FixtureBare, is not a class of mission leaves"),
    (Node, "the leaf of FixtureBare, is not a class of mission leaves"),
    (ServiceLeaf, "ServiceLeaf, the leaf of FixtureBare, does not say what it asks for"),
    (type("Quoted", (ServiceLeaf,), {"asks": "Say"}), "does not say what it asks for"),
    (type("Answers", (ServiceLeaf,), {"asks": Answer}), "does not say what it asks for"),
    (type("Sees", (TopicCondition,), {"own_evidence": FACES}),
     "own_evidence of Sees is no Evidence"),
    (type("Sees", (TopicCondition,), {"own_evidence": Evidence("faces")}),
     "own_evidence of Sees is no Evidence")])
def test_a_class_that_cannot_be_a_leaf_is_refused_where_it_is_declared(leaf, words):
    with pytest.raises(ImportError) as raised:
        leaf_spec("FixtureBare", leaf, "A leaf with a mistake.")
    assert words in str(raised.value)


def test_kind_and_haste_of_a_node_type_are_those_of_its_class():
    asks = type("Asks", (ServiceLeaf,), {"asks": Say})
    sees = type("Sees", (TopicCondition,), {"own_evidence": Evidence(FACES)})
    specs = [leaf_spec("FixtureBare", leaf, "A leaf.")
             for leaf in (InstantAction, InstantCondition, asks, sees)]
    assert [(spec.kind, spec.is_instant, spec.may_fail_at_once, spec.calls, spec.listens)
            for spec in specs] == [
        (Kind.ACTION, True, False, (), ()), (Kind.CONDITION, True, False, (), ()),
        (Kind.ACTION, False, True, (Say,), ()), (Kind.CONDITION, False, False, (), (FACES,))]


def test_an_argument_that_the_leaf_does_not_declare_is_refused():
    misspelt = leaf_spec("FixtureSpeech", FixedSpeech, "", arguments={"pharse": "WelcomeSpeech"})
    with pytest.raises(TypeError, match="pharse"):
        misspelt.factory("FixtureSpeech")
