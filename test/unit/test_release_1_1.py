"""The robot of release 1.1 and the nodes of its missions: what each asks of the robot, and what
comes of an answer that it gives."""
import dataclasses
import os

import pytest
from msgspec.structs import replace

from behavior_controller import leaves
from behavior_controller.config import knowledge_files, settings
from behavior_controller.bt.values.status import FAILURE, RUNNING, SUCCESS
from behavior_controller.errors import ConfigurationError, FaultsFound
from behavior_controller.leaves.release_1_1 import SPECS
from behavior_controller.missions import load
from behavior_controller.missions.replay import replay
from behavior_controller.robot import release_1_0, release_1_1
from behavior_controller.robot.declarations import Sense
from behavior_controller.robot.gateway import Cause, Failure
from behavior_controller.robot.requests import (
    Answer, AttentionStatus, GoTo, GoToGoal, Location, PerformGesture, PerformGestureGoal, Point,
    Say, SayGoal, SetAttention, SetRecognitionLanguage)
from behavior_controller.run.events import Answered, Asked, LeafFinished, StepStarted
from behavior_controller.run.fold import fold
from behavior_controller.run.health import GONE, gone
from behavior_controller.run.moment import card, card_line, robot_line
from behavior_controller.run.record.reader import read_record
from behavior_controller.run.state import State
from behavior_controller.run.story import Story, may_be_under_way
from behavior_controller.text import Source
from mission_rig import FileRecord, Rig, one_leaf, write, written
from ros_md5 import md5, md5_of_service

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
RELEASE = "release-1.1"
ENGLISH = "English"


def rig_of(element, answer=lambda request: NotImplemented, robot=RELEASE, **entries):
    rig = one_leaf(element, answer, robotInterface=robot)
    write(rig, currentExhibit="Forge", description1="First.", description2="Second.",
          targetLocation=Location(1.0, 2.0, 90.0), gestureTarget=Point(1.0, 2.0, 0.5))
    write(rig, **entries)
    return rig


def test_the_six_nodes_are_there():
    assert [spec.id for spec in SPECS] == [
        "SayTextAsync", "DescribeExhibitSpeechAsync", "NavigateAsync",
        "PerformDeicticGestureAsync", "PerformIconicGestureAsync", "GetVisitorResponseAsync"]
    assert {spec.id for spec in leaves.SPECS} >= {spec.id for spec in SPECS}


@pytest.mark.parametrize("element, request_", [
    ("<SayTextAsync name='2'/>", SayGoal("Please follow me.", ENGLISH)),
    ("<DescribeExhibitSpeechAsync/>", SayGoal("First. Second.", ENGLISH)),
    ("<DescribeExhibitSpeechAsync name='1'/>", SayGoal("First. Second.", ENGLISH)),
    ("<DescribeExhibitSpeechAsync name='x'/>", SayGoal("First. Second.", ENGLISH)),
    ("<NavigateAsync/>", GoToGoal(Location(1.0, 2.0, 90.0))),
    ("<PerformIconicGestureAsync name='welcome'/>", PerformGestureGoal("iconic", 1, 3000)),
    ("<PerformIconicGestureAsync name='goodbye'/>", PerformGestureGoal("iconic", 3, 3000))])
def test_what_a_node_asks_of_the_robot(element, request_):
    rig = rig_of(element)
    assert rig.tick() is SUCCESS
    assert rig.requests == [request_] and type(rig.requests[0]) is type(request_)


def test_a_target_at_the_origin_is_not_pointed_at():
    rig = rig_of("<PerformDeicticGestureAsync/>", gestureTarget=Point(0.0, 0.0, 0.0))
    assert (rig.tick(), rig.requests) == (SUCCESS, [])
    # the release's controller takes a sum of 0 for no target
    rig = rig_of("<PerformDeicticGestureAsync/>", gestureTarget=Point(1.0, -1.5, 0.5))
    assert rig.tick() is SUCCESS and rig.requests[0].target == Point(1.0, -1.5, 0.5)


def test_another_gesture_is_a_mistake_at_its_place():
    with pytest.raises(FaultsFound) as caught:
        rig_of("<PerformIconicGestureAsync name='wave'/>")
    fault, = caught.value.faults
    assert fault.line and "wave" in fault.text and "welcome, goodbye" in fault.hint


@pytest.mark.parametrize("element", [
    "<NavigateAsync/>", "<PerformDeicticGestureAsync/>", "<DescribeExhibitSpeechAsync/>"])
def test_without_its_data_a_node_fails_and_asks_nothing(element):
    rig = one_leaf(element, robotInterface=RELEASE)
    assert (rig.tick(), rig.requests) == (FAILURE, [])


def test_a_node_is_running_until_the_result_and_a_halt_cancels_its_goal():
    rig = rig_of("<NavigateAsync/>", lambda request: None)
    assert (rig.tick(), rig.tick()) == (RUNNING, RUNNING)
    rig.tree.halt()
    assert rig.gateway.dropped == [GoToGoal(Location(1.0, 2.0, 90.0))]


def test_a_goal_that_fails_is_a_failure():
    refusal = Failure(Cause.REFUSED, "aborted", "/robotNavigation/set_goal")
    assert rig_of("<NavigateAsync/>", lambda request: refusal).tick() is FAILURE


# ------------------------------------------------------------------- the answer, and substitutes


def test_an_answer_is_heard_and_a_halt_leaves_no_earlier_one():
    told = []
    rig = rig_of("<GetVisitorResponseAsync/>", visitorResponse="yes")
    rig.topics.listen = lambda topic, *more: told.append((topic.name,) + more)
    assert rig.tick() is RUNNING
    assert told == [("/speechEvent/text", 10.0, True)]
    rig.tree.halt()
    assert rig.tree.blackboard.get("visitorResponse") == ""


@pytest.mark.parametrize("said, result, stored", [
    ("YES please", SUCCESS, "yes"), ("no", SUCCESS, "no"), ("Error: sound", FAILURE, "")])
def test_what_was_heard_is_stored(said, result, stored):
    rig = rig_of("<GetVisitorResponseAsync/>", visitorResponse="no")
    assert rig.tick() is RUNNING
    rig.clock.advance(0.1)
    rig.topics.publish(release_1_1.INTERFACE.topic("/speechEvent/text"), said)
    assert rig.tick() is result
    assert rig.tree.blackboard.get("visitorResponse") == stored


def test_nothing_heard_in_ten_seconds_is_no_answer_and_no_failure():
    rig = rig_of("<GetVisitorResponseAsync/>", visitorResponse="yes")
    assert rig.tick() is RUNNING
    rig.clock.advance(9.9)
    assert rig.tick() is RUNNING
    rig.clock.advance(0.2)
    assert (rig.tick(), rig.tree.blackboard.get("visitorResponse")) == (SUCCESS, "")


@pytest.mark.parametrize("robot", ["D5.4.3", "release-1.0"])
def test_a_robot_without_actions_carries_out_the_nodes_by_its_services(robot):
    rig = rig_of("<NavigateAsync/>", robot=robot)
    service = rig.mission.interface.service(GoToGoal)
    assert service is rig.mission.interface.service(GoTo)
    assert rig.mission.interface.used({GoToGoal}, ()) == (service,)
    assert rig.tick() is SUCCESS


def test_service_and_action_of_one_name_stand_in_for_each_other():
    robot = release_1_1.INTERFACE
    pairs = [(GoTo, GoToGoal)] + [(kind.__mro__[1], kind) for kind in (SayGoal, PerformGestureGoal)]
    for plain, goal in pairs:
        service, action = robot.service(plain), robot.service(goal)
        assert (service.kind, action.kind) == ("service", "action")
        assert (robot.substitute(service), robot.substitute(action)) == (action, service)
    assert robot.substitute(robot.services[0]) is None
    speech = robot.topic("/speechEvent/text")
    assert robot.substitute(speech) is speech.action
    # a package may declare both for requests that have nothing in common
    other = dataclasses.replace(robot.service(GoTo), request=SetRecognitionLanguage)
    more = dataclasses.replace(robot, services=(robot.service(GoToGoal), other), safe_state=())
    assert more.substitute(other) is None


# ---------------------------------------------------------------------------------------- the types

# what the published release has: the md5s of the action, and of goal, result and feedback, first
# alone and then as they are sent
ACTIONS = {
    "performGesture": ("30eb9468203b5c78a2294991e42af761", "8941123bbdb7b596d4b3eb3edb1d4f95",
                       "92d901add9db08a4926dfda2c951ba39", "70805092fd20e110765c7b79e8efb737",
                       "f51e0270ffcac7534e127954086414f9", "0e99f8cede58bee42f60e9defbf1f095",
                       "86cfd50d5ec6a9ce6ffde931acdc45c7"),
    "driveTo": ("814637a59bc4d6cd71775c80bffebbdd", "dcb9e3e0212f3880640f43b079ee007b",
                "57a23c3fb57185a0ea20ec7a8cb4a5dd", "267feb09233f6835fd13c0b9eb53983a",
                "28d8ae1d7d678202cde9c8eb4538dbd7", "4a0f63b7caa093c607da8edc99fa76d1",
                "a115664d5ee8a12d4ba4ea7f7d78e7bd"),
    "sayText": ("c4662161e3ba916ee91fdaa3169a30be", "8227818ab6074445792448d628153554",
                "d87bbe21c1656c675f84b4c05933a7f4", "ce404b6cabcba81b67a4c8bac81c05d3",
                "9fce07cd5d392e27070655a09a2256a6", "ec0812bb1ec2f36f04dfab91c7b4ed35",
                "74b2c8a9bddfff7e1b57abd9d9fb5b18"),
    "recogniseSpeech": ("285a0d46ff90e818864fdde700b010e5", "2567284f9b27e367bfc369af0ceabc86",
                        "d87ceb831c5fd1ff2239ff1c5b3dfc96", "87786d9a5ca076f1bf41849c2f853f3c",
                        "2cd991f93efa3b06d29067b7091ba086", "51661283cf76efc19ccbdd2a770b77f5",
                        "6261032f9b6816b79b5f03291c78cbdd")}

SERVICES = {
    "/animateBehaviour/setActivation": "627ff1bdab3517806109f1877a0616fa",
    "/gestureExecution/perform_gesture": "65be385647e9cf319646c91e1469cecf",
    "/overtAttention/set_mode": "6b429c994e2d4c561fbf8e50b20b7da9",
    "/robotLocalization/set_pose": "6c1e120a3caf1ce812f6eed6de5d7cc5",
    "/robotNavigation/set_goal": "dd6618e508540fc6bea777db29895dc5",
    "/speechEvent/set_enabled": "f67071e4d9d809e097308ca63ae6a005",
    "/tabletEvent/prompt_and_get_response": "8b7095eb8dcd517ba7c37a0a06dcc50b",
    "/textToSpeech/say_text": "7277e0c800cdef28cf205e132038aaf8"}


def fields_of(kind, folder):
    """Return the lines of a type's file, without comments."""
    path = os.path.join(ROOT, folder, kind.partition("/")[2] + "." + folder)
    with open(path, encoding="utf-8") as file:
        lines = [" ".join(line.split("#")[0].split()) for line in file]
    return list(filter(None, lines))


def test_the_services_have_the_published_types():
    declared = {service.name: md5_of_service(fields_of(service.type, "srv"))
                for service in release_1_1.SERVICES if service.kind == "service"}
    assert declared == SERVICES


@pytest.mark.parametrize("kind", sorted(ACTIONS))
def test_the_actions_have_the_published_types(kind):
    parts = "\n".join(fields_of("/" + kind, "action")).split("---")
    plain = [md5(part.strip()) for part in parts]
    header = md5("uint32 seq", "time stamp", "string frame_id") + " header"
    goal_id = md5("time stamp", "string id") + " goal_id"
    words = "PENDING ACTIVE PREEMPTED SUCCEEDED ABORTED REJECTED PREEMPTING RECALLING RECALLED LOST"
    status = md5(*["uint8 {}={}".format(word, number) for number, word in enumerate(words.split())],
                 goal_id, "uint8 status", "string text") + " status"
    sent = [md5(header, other, "{} {}".format(own, name)) for own, name, other in zip(
        plain, ("goal", "result", "feedback"), (goal_id, status, status))]
    whole = md5(*map("{} action_{}".format, sent, ("goal", "result", "feedback")))
    assert (whole, *plain, *sent) == ACTIONS[kind]


def test_the_declared_actions_are_those():
    robot = release_1_1.INTERFACE
    declared = {action.name: action.type for action in robot.services if action.kind == "action"}
    listening = robot.topic("/speechEvent/text").action
    assert dict(declared, **{listening.name: listening.type}) == {
        "/gestureExecution/perform_gesture": "cssr_system/performGesture",
        "/robotNavigation/set_goal": "cssr_system/driveTo",
        "/textToSpeech/say_text": "cssr_system/sayText",
        "/speechEvent/recognise_speech_action": "cssr_system/recogniseSpeech"}


def test_the_document_lists_the_types():
    with open(os.path.join(ROOT, "docs", "release_1_1.md"), encoding="utf-8") as document:
        text = document.read()
    whole = [digests[0] for digests in ACTIONS.values()]
    gesture = SERVICES["/gestureExecution/perform_gesture"]
    assert [digest for digest in whole + [gesture] if digest not in text] == []


# -------------------------------------------------------------------------------------- knowledge

LONG = "x" * 600  # the longest text of this release
ENVIRONMENT = """robotLocationDescription 1 start
robotLocationPose 1 2.0 7.8 270
gestureTarget 1 0.0 0.0 0.0
preGestureMessageEnglish 1 Good morning. This is our workshop, which has several benches. {}
postGestureMessageEnglish 1 Come closer.
robotLocationDescription 2 bench
robotLocationPose 2 2.9 6.3 335
gestureTarget 2 4.4 7.8 0.82
preGestureMessageEnglish 2 Here is a bench. It is made of oak. It is older than I am.
postGestureMessageEnglish 2 Let us go on.
culturalKnowledge 2 gestureArm
tourSpecification 3 1 2 1""".format(LONG)
CULTURE = "phraseLanguage English\nutilityPhraseEnglish1 Welcome to the workshop\n" \
          "utilityPhraseEnglish8 Until next time\n"
GESTURES = "gestureArm {}\ndeicticShape {}\n"


def known(culture, takes_arm=True, environment=ENVIRONMENT):
    return knowledge_files.read(Source("e", environment), Source("c", culture), takes_arm=takes_arm)


def test_an_environment_file_with_long_texts_is_read_in_the_order_of_its_tour():
    tour = known(CULTURE + GESTURES.format("LEFT", "PALM_UPWARDS")).tour
    assert [place.location for place in tour] == [
        Location(2.0, 7.8, 270.0), Location(2.9, 6.3, 335.0), Location(2.0, 7.8, 270.0)]
    assert tour[0].description1.endswith(LONG) and tour[1].gesture == Point(4.4, 7.8, 0.82)


@pytest.mark.parametrize("arm", ["EITHER", "LEFT", "RIGHT"])
def test_the_culture_file_chooses_arm_and_shape(arm):
    found = known(CULTURE + GESTURES.format(arm, "OTHER"))
    assert (found.arm, found.shape, found.warnings) == (arm, "OTHER", ())


def test_a_missing_arm_or_shape_has_its_default_and_one_warning():
    found = known(CULTURE)
    assert (found.arm, found.shape) == ("EITHER", "PALM_UPWARDS")
    assert [fault.text.split(":")[0] for fault in found.warnings] == [
        "there is no gestureArm", "there is no deicticShape"]
    others = CULTURE + "".join("utilityPhraseEnglish{0} {0}\n".format(n) for n in range(2, 8))
    assert known(others, takes_arm=False).warnings == ()


@pytest.mark.parametrize("lines, line, text", [
    (GESTURES.format("BOTH", "PALM_UPWARDS"), 4, 'gestureArm cannot be "BOTH"'),
    (GESTURES.format("left", "PALM_UPWARDS"), 4, 'gestureArm cannot be "left"'),
    (GESTURES.format("", "PALM_UPWARDS"), 4, "gestureArm cannot be empty"),
    (GESTURES.format("LEFT", "PALM UPWARDS"), 5, 'deicticShape cannot be "PALM UPWARDS"'),
    (GESTURES.format("LEFT", ""), 5, "deicticShape cannot be empty")])
def test_a_wrong_arm_or_shape_is_an_error_at_its_line(lines, line, text):
    with pytest.raises(ConfigurationError) as caught:
        known(CULTURE + lines)
    fault, = [fault for fault in caught.value.faults if not fault.is_warning]
    assert (fault.line, fault.text) == (line, text)
    others = CULTURE + "".join("utilityPhraseEnglish{0} {0}\n".format(n) for n in range(2, 8))
    assert known(others + lines, takes_arm=False).arm == ""  # another robot does not read them


def gesture_of(element, robot=RELEASE, **more):
    rig = rig_of(element, robot=robot)
    if rig.mission.knowledge is not None:
        rig.mission.knowledge = dataclasses.replace(rig.mission.knowledge, **more)
    assert rig.tick() is SUCCESS
    return rig.requests[0]


@pytest.mark.parametrize("node, kind", [
    ("PerformDeicticGesture", PerformGesture), ("PerformDeicticGestureAsync", PerformGestureGoal)])
def test_the_arm_is_sent_with_deictic_gestures_alone(node, kind):
    pointing = gesture_of("<{}/>".format(node), arm="RIGHT", shape="OTHER")
    assert pointing == kind("deictic", 1, 3000, Point(1.0, 2.0, 0.5), 0, "RIGHT", "OTHER")
    fields = release_1_1.INTERFACE.service(kind).fields(pointing)
    assert fields == ("deictic", 1, "RIGHT", "OTHER", 3000, 0, 1.0, 2.0, 0.5)
    waving = gesture_of("<PerformIconicGestureAsync name='welcome'/>", arm="RIGHT", shape="OTHER")
    assert (waving.arm, waving.shape) == ("", "")
    for robot in ("D5.4.3", "release-1.0"):
        other = gesture_of("<PerformDeicticGesture/>", robot)
        assert (other.arm, other.shape) == ("", "")


def test_a_phrase_that_the_file_lacks_is_a_mistake_before_the_start():
    body = "<Sequence><SayText name='7'/>\n<{} name='8'/></Sequence>"
    for node in ("SayText", "SayTextAsync"):
        with pytest.raises(FaultsFound) as caught:
            Rig(file(body.format(node)), robotInterface=RELEASE)
        fault, = caught.value.faults
        assert (fault.line, fault.text) == (2, "the culture file has no utility phrase 8")
        assert fault.hint.startswith("there are: 1, 2, 3, 4, 5, 6, 7; or add a line to ")
        assert fault.hint.endswith("cultureKnowledgeBase.dat: utilityPhraseEnglish8 <text>")
    assert len(Rig(file(body.format("SayText")), robotInterface="release-1.0").tree.warnings) == 1


def file(body):
    return ("<root BTCPP_format='4' main_tree_to_execute='M'><BehaviorTree ID='M'>{}</BehaviorTree>"
            "</root>".format(body))


def test_a_phrase_is_a_question_by_its_text_whatever_its_number():
    asked = {}
    for number in (1, 5):  # the delivered file: "Please press …", "Would you like …?"
        rig = rig_of("<SayTextAsync name='{}'/>".format(number))
        rig.tick()
        asked[number] = rig.of(StepStarted)[0].words
    assert asked == {1: "saying", 5: "asking"}


# ------------------------------------------------------------------------------------- behaviours


@pytest.mark.parametrize("state, value, is_given", [
    ("scanning", 2, True), ("social", 2, True), ("social", -1, True), ("scanning", 1, False),
    ("social", 1, False), ("seeking", 2, False), ("location", -1, False), ("disabled", 0, False)])
def test_a_visitor_is_present_by_the_published_node_and_by_the_stub(state, value, is_given):
    evidence = release_1_1.INTERFACE.evidence(Sense.PRESENCE)
    assert evidence.wait == 10.0
    assert evidence.is_given(AttentionStatus(state, value), 2) is is_given


def test_the_visitor_is_seen_at_a_message_and_missed_after_ten_seconds():
    for value, result in ((-1, SUCCESS), (1, FAILURE)):
        rig = rig_of("<IsVisitorPresent/>")
        assert rig.tick() is RUNNING
        rig.topics.publish(release_1_0.ATTENTION, AttentionStatus("social", value))
        rig.clock.advance(0.1 if value < 0 else 10.1)
        assert rig.tick() is result


@pytest.mark.parametrize("answer", [
    lambda request: NotImplemented,
    lambda request: Failure(Cause.REFUSED, "no", "/overtAttention/set_mode")
    if request.state == "disabled" else NotImplemented])
def test_after_a_look_at_a_location_attention_is_switched_off(answer):
    for node in ("<SetOvertAttentionMode name='location'/>", "<LocationOvertAttentionMode/>"):
        rig = rig_of(node, answer)
        assert rig.tick() is SUCCESS
        assert rig.requests == [SetAttention("location", Point(1.0, 2.0, 0.5)),
                                SetAttention("disabled")]
    rig = rig_of("<SetOvertAttentionMode name='social'/>")
    assert rig.tick() is SUCCESS and rig.requests == [SetAttention("social")]


def test_attention_stays_where_the_look_failed_and_on_the_other_robots():
    refusal = Failure(Cause.REFUSED, "no", "/overtAttention/set_mode")
    rig = rig_of("<SetOvertAttentionMode name='location'/>", lambda request: refusal)
    assert (rig.tick(), len(rig.requests)) == (FAILURE, 1)
    rig = rig_of("<SetOvertAttentionMode name='location'/>", gestureTarget=Point(0.0, 0.0, 0.0))
    assert (rig.tick(), rig.requests) == (SUCCESS, [])
    for robot in ("D5.4.3", "release-1.0"):
        rig = rig_of("<SetOvertAttentionMode name='location'/>", robot=robot)
        assert (rig.tick(), len(rig.requests)) == (SUCCESS, 1)


def test_the_language_of_recognition_is_never_set_and_no_speech_lasts():
    rig = rig_of("<Sequence><StartOfTree/><SayText name='1'/></Sequence>")
    assert rig.tree.warnings == [] and rig.mission.settings.asr_enabled
    assert rig.tick() is SUCCESS  # at once
    assert [type(request) for request in rig.requests] == [Say]


def test_the_mission_that_was_not_published_is_told_as_such():
    with pytest.raises(ConfigurationError) as caught:
        load.find("labTourAsync")
    assert "was not published" in caught.value.faults[0].hint


def test_keys_of_the_release_s_own_controller_are_a_warning_each(tmp_path):
    path = tmp_path / "c.ini"
    path.write_text("scenarioSpecification lab_tour\nverboseMode true\nasrEnabled false\n"
                    "audioDebugMode false\naudioMode false\nrobotInterface release-1.1\n", "utf-8")
    chosen = settings.load(str(path))
    assert [(fault.line, fault.is_warning) for fault in chosen.warnings] == [(4, True), (5, True)]


# ------------------------------------------------------------------------------- several at once


def test_description_and_gesture_run_at_once_and_a_halt_leaves_both_open():
    rig = Rig(file("<Sequence><RetrieveListOfExhibits/><SelectExhibit/><SelectExhibit/>"
                   "<Timeout msec='5000'><Parallel><DescribeExhibitSpeechAsync/>"
                   "<PerformDeicticGestureAsync/></Parallel></Timeout></Sequence>"),
              lambda request: None if isinstance(request, (SayGoal, PerformGestureGoal))
              else NotImplemented, robotInterface=RELEASE)
    story = Story()
    rig.mission.events.subscribe(lambda event: story.take(rig.clock.now(), event))
    while rig.tick() is RUNNING and len(rig.requests) < 2:
        pass
    now = card(story.state)
    assert [words.split()[0] for words in [now.what] + now.also] == ["pointing", "saying"]
    assert "; also saying" in card_line(now, rig.clock.now())
    rig.clock.advance(5.1)
    rig.tick()
    assert [type(request) for request in rig.gateway.dropped] == [SayGoal, PerformGestureGoal]
    doing = [exchange.words.split()[0] for exchange in story.state.robot.unfinished]
    assert sorted(doing) == ["pointing", "saying"]
    assert robot_line(story.state)


def fold_of(*happened):
    state = State()
    for at, event in enumerate(happened):
        state = fold(state, float(at), event)
    return state


def drive(number, request=GoToGoal):
    return Asked(number, "/robotNavigation/set_goal", request(Location(1.0, 2.0, 90.0)))


HALTED = LeafFinished(1, "NavigateAsync", "go", "IDLE", "/robotNavigation/set_goal", 1.0, None)


def test_a_drive_that_was_cancelled_may_go_on_until_a_later_one_is_done():
    state = fold_of(drive(1), HALTED)
    assert may_be_under_way(state).startswith("may still be driving")
    state = fold(fold(state, 5.0, drive(2, GoTo)), 6.0, Answered(2, Answer()))
    assert may_be_under_way(state) == ""


def test_the_node_that_drives_is_known_by_a_goal_too():
    change = gone("action", "/robotNavigation/set_goal", "robotNavigation", "x", "it cannot drive")
    state = fold_of(drive(1), replace(change, respect=GONE))
    assert state.robot.cannot_drive


def test_a_run_is_recorded_and_takes_the_same_path_again(tmp_path):
    path = tmp_path / "m.xml"
    path.write_text(file(
        "<Sequence><RetrieveListOfExhibits/><SelectExhibit/><SelectExhibit/><NavigateAsync/>"
        "<SetOvertAttentionMode name='location'/><Parallel><DescribeExhibitSpeechAsync/>"
        "<PerformDeicticGestureAsync/></Parallel><GetVisitorResponseAsync/></Sequence>"), "utf-8")
    rig = Rig(str(path), robotInterface=RELEASE)
    record = FileRecord(str(tmp_path)).open()
    rig.mission.events.subscribe(record)
    record.show(rig.tree)
    rig.mission.topics = record.topics(rig.topics)
    rig.mission_file = str(path)

    def visitor(rig):
        rig.clock.advance(0.5)
        rig.topics.publish(release_1_1.INTERFACE.topic("/speechEvent/text"), "yes")

    assert rig.run(visitor) == 0
    assert [type(request) for request in rig.requests] == [
        GoToGoal, SetAttention, SetAttention, SayGoal, PerformGestureGoal]
    replayed = replay(read_record(written(record)))
    assert (replayed.divergence, replayed.passes) == ("", 1)
