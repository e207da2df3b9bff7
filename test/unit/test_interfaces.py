"""The types of services and topics: the fields' names, types and order decide whether the robot
understands us."""
import dataclasses
import math
import os
from types import SimpleNamespace

import pytest

from behavior_controller.robot import release_1_0
from behavior_controller.robot.declarations import (
    MOST_EVENTS, Action, Interface, Publication, Sample, Sense, Service, Success, Unusable)
from behavior_controller.robot.d543 import FACES, INTERFACE
from behavior_controller.robot.requests import (
    AttentionStatus, Exhibit, Faces, GoTo, Listen, Location, PerformGesture, Point, Prompt,
    QueryKnowledge, Request, Say, SetAnimation, SetAttention, SetPose, SetRecognition,
    SetRecognitionLanguage)
from ros_md5 import md5, md5_of_service

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))

# D5.4.3 table 3 and section 3.2.5, with the decisions on what they leave open
EXPECTED = {
    "srv/animateBehaviorService.srv": ["string state", "---", "string success"],
    "srv/gestureExecutionService.srv": ["string gesture_type", "uint8 gesture_id",
                                        "int64 gesture_duration", "uint32 bow_nod_angle",
                                        "float64 location_x", "float64 location_y",
                                        "float64 location_z", "---", "uint8 gesture_success"],
    "srv/knowledgeBaseService.srv": ["string parameters", "---", "bool success",
                                     "exhibitInfoMessage[] exhibits"],
    "srv/overtAttentionService.srv": ["string state", "float64 location_x", "float64 location_y",
                                      "float64 location_z", "---", "uint8 mode_set_success"],
    "srv/robotNavigationService.srv": ["float64 goal_x", "float64 goal_y", "float64 goal_theta",
                                       "---", "uint8 navigation_goal_success"],
    "srv/textService.srv": ["string message", "---", "bool success", "string response"],
    "msg/locationMessage.msg": ["float64 x", "float64 y", "float64 theta"],
    "msg/gestureMessage.msg": ["float64 x", "float64 y", "float64 z"],
    "msg/exhibitInfoMessage.msg": ["string name", "string description1", "string description2",
                                   "locationMessage location", "gestureMessage gesture"],
    "msg/faceDetectionMessage.msg": ["string[] face_label_id", "geometry_msgs/Point[] centroids",
                                     "bool[] mutualGaze"],
    "msg/overtAttentionMessage.msg": ["string state", "int64 value"]}


@pytest.mark.parametrize("path", sorted(EXPECTED))
def test_the_fields_are_those_of_the_robot(path):
    with open(os.path.join(ROOT, path), encoding="utf-8") as file:
        fields = [" ".join(line.split("#")[0].split()) for line in file]
    assert [field for field in fields if field] == EXPECTED[path]


def test_each_declared_type_has_its_file():
    missing = []
    for folder, offers in (("srv", INTERFACE.services), ("msg", INTERFACE.topics)):
        own = [offer.type.partition("/")[2] for offer in offers
               if offer.type.startswith("cssr_system/")]
        files = ["{}/{}.{}".format(folder, name, folder) for name in own]
        missing += [path for path in files if not os.path.exists(os.path.join(ROOT, path))]
    assert missing == []


# the tables 2 and 3: request, name, robot's node, type, what is sent, and the field that tells the
# outcome
SERVICES = [
    (SetAnimation("enabled"), "/animateBehaviour/set_activation", "animateBehavior",
     "animateBehaviorService", ("enabled", ), ("success", "1", "0")),
    (PerformGesture("deictic", 2, 3000, Point(1.0, 2.0, 3.0),
                    20), "/gestureExecution/perform_gesture", "gestureExecution",
     "gestureExecutionService", ("deictic", 2, 3000, 20, 1.0, 2.0, 3.0), ("gesture_success", 1, 0)),
    (QueryKnowledge("exhibits"), "/knowledgeBase/query", "knowledgeBase", "knowledgeBaseService",
     ("exhibits", ), ("success", True, False)),
    (SetAttention("location", Point(1.0, 2.0, 3.0)), "/overtAttention/set_mode", "overtAttention",
     "overtAttentionService", ("location", 1.0, 2.0, 3.0), ("mode_set_success", 1, 0)),
    (GoTo(Location(2.0, 3.5, 90.0)), "/robotNavigation/set_goal", "robotNavigation",
     "robotNavigationService", (2.0, 3.5, 90.0), ("navigation_goal_success", 1, 0)),
    (Prompt(("Yes", "No")), "/tabletEvent/prompt_and_get_response", "tabletEvent", "textService",
     ("Yes|No", ), ("success", True, False)),
    (Say("hello"), "/textToSpeech/say_text", "textToSpeech", "textService", ("hello", ),
     ("success", True, False))]


@pytest.mark.parametrize("request_, name, node, type_, fields, success", SERVICES,
                         ids=[row[2] for row in SERVICES])
def test_a_service_is_called_as_the_document_says(request_, name, node, type_, fields, success):
    service = INTERFACE.service(type(request_))
    assert (service.name, service.node, service.type) == (name, node, "cssr_system/" + type_)
    assert service.fields(request_) == fields
    assert tuple(service.success) == success
    assert [type(value) for value in service.success] == [type(value) for value in success]


@pytest.mark.parametrize("name, is_continuous", [
    ("/faceDetection/data", True), ("/overtAttention/mode", True), ("/speechEvent/text", False)])
def test_each_topic_of_the_document_is_declared(name, is_continuous):
    assert INTERFACE.topic(name).is_continuous is is_continuous


def test_an_attention_without_a_place_and_a_gesture_without_a_target_send_zeros():
    assert INTERFACE.service(SetAttention).fields(SetAttention("social")) == ("social", 0.0, 0.0,
                                                                              0.0)
    assert INTERFACE.service(PerformGesture).fields(PerformGesture("iconic", 1, 500)) == (
        "iconic", 1, 500, 0, 0.0, 0.0, 0.0)


# ------------------------------------------------------------------------------ the published types

# the fields of the project's release 1.0, as its public repository has them, by the file of ours
# that carries them
PUBLISHED = {
    "srv/animateBehaviorService": ["string state", "---", "string success"],
    "srv/gestureExecutionService": EXPECTED["srv/gestureExecutionService.srv"],
    "srv/overtAttentionService": EXPECTED["srv/overtAttentionService.srv"],
    "srv/robotNavigationService": EXPECTED["srv/robotNavigationService.srv"],
    "srv/robotPoseService": ["float64 x", "float64 y", "float64 theta", "---", "bool success"],
    "srv/sayTextService": ["string message", "string language", "---", "bool success"],
    "srv/speechEnabledService": ["string status", "---", "int8 response"],
    "srv/speechLanguageService": ["string language", "---", "int8 response"],
    "srv/tabletPromptService": ["string message", "---", "bool success"],
    "msg/overtAttentionMessage": ["string state", "int64 value"],
    "action/recogniseSpeech": ["float32 wait", "---", "string transcription", "---",
                               "int8 progress"]}


def md5s_of_action(lines):
    """Return the md5s of the messages of an action: its own part follows what actionlib puts before
    it."""
    goal, result, feedback = ([part] for part in lines if part != "---")
    header = md5("uint32 seq", "time stamp", "string frame_id")
    goal_id = md5("time stamp", "string id")
    words = ("PENDING ACTIVE PREEMPTED SUCCEEDED ABORTED REJECTED PREEMPTING RECALLING RECALLED "
             "LOST".split())
    status = md5(*["uint8 {}={}".format(word, number) for number, word in enumerate(words)],
                 goal_id + " goal_id", "uint8 status", "string text")
    return {"ActionGoal": md5(header + " header", goal_id + " goal_id", md5(*goal) + " goal"),
            "ActionResult": md5(header + " header", status + " status", md5(*result) + " result"),
            "ActionFeedback": md5(header + " header", status + " status",
                                  md5(*feedback) + " feedback")}


def documented():
    """Return the md5 of each type that the document lists."""
    with open(os.path.join(ROOT, "docs", "release_1_0_types.md"), encoding="utf-8") as file:
        rows = [[cell.strip(" `") for cell in line.split("|")[1:-1]] for line in file
                if line.startswith("| `")]
    return {kind: digest for _, kind, digest in rows}


@pytest.mark.parametrize("name", sorted(PUBLISHED))
def test_the_fields_are_those_of_release_1_0(name):
    with open(os.path.join(ROOT, "{}.{}".format(name,
                                                name.split("/")[0])), encoding="utf-8") as file:
        fields = [" ".join(line.split("#")[0].split()) for line in file]
    assert [field for field in fields if field] == PUBLISHED[name]


def test_the_document_lists_the_md5s_of_the_published_fields():
    computed = {}
    for name, lines in PUBLISHED.items():
        if name.startswith("action/"):
            computed.update((name + part, digest) for part, digest in md5s_of_action(lines).items())
        else:
            computed[name] = md5(*lines) if name.startswith("msg/") else md5_of_service(lines)
    assert documented() == computed


def test_the_document_lists_each_name_that_the_release_offers():
    with open(os.path.join(ROOT, "docs", "release_1_0_types.md"), encoding="utf-8") as file:
        text = file.read()
    own = [offer for offer in release_1_0.INTERFACE.offers if offer.type.startswith("cssr_system/")]
    assert [offer.name for offer in own if "| `{}` |".format(offer.name) not in text] == []
    assert [offer.type for offer in own
            if "/{}` |".format(offer.type.split("/")[1]) not in text] == []


# --------------------------------------------------------------- what release 1.0 is told and tells


def status(state, value):
    return AttentionStatus(state, value)


RELEASE_SERVICES = [
    (SetAnimation("enabled"), "/animateBehaviour/setActivation", "animateBehavior",
     "animateBehaviorService", ("enabled", ), ("success", "1", "0")),
    (SetPose(Location(2.0, 3.5, 90.0)), "/robotLocalization/set_pose", "robotLocalization",
     "robotPoseService", (2.0, 3.5, 90.0), ("success", True, False)),
    (SetRecognition(True), "/speechEvent/set_enabled", "speechEvent", "speechEnabledService",
     ("true", ), ("response", 1, 0)),
    (SetRecognition(False), "/speechEvent/set_enabled", "speechEvent", "speechEnabledService",
     ("false", ), ("response", 1, 0)),
    (SetRecognitionLanguage("IsiZulu"), "/speechEvent/set_language", "speechEvent",
     "speechLanguageService", ("IsiZulu", ), ("response", 1, 0)),
    (Prompt(("Yes", "No")), "/tabletEvent/prompt_and_get_response", "tabletEvent",
     "tabletPromptService", ("'Yes'|'No'", ), ("success", True, False)),
    (Say("Sawubona", "IsiZulu"), "/textToSpeech/say_text", "textToSpeech", "sayTextService",
     ("Sawubona", "IsiZulu"), ("success", True, False))]


@pytest.mark.parametrize("request_, name, node, type_, fields, success", RELEASE_SERVICES)
def test_a_service_is_called_as_release_1_0_publishes_it(request_, name, node, type_, fields,
                                                         success):
    service = release_1_0.INTERFACE.service(type(request_))
    assert (service.name, service.node, service.type) == (name, node, "cssr_system/" + type_)
    assert service.fields(request_) == fields
    assert tuple(service.success) == success
    assert [type(value) for value in service.success] == [type(value) for value in success]


@pytest.mark.parametrize("name, is_continuous", [("/overtAttention/mode", True),
                                                 ("/speechEvent/text", False)])
def test_each_topic_of_release_1_0_is_declared(name, is_continuous):
    assert release_1_0.INTERFACE.topic(name).is_continuous is is_continuous


@pytest.mark.parametrize("transcription, text", [(" yes please ", "yes please"), (" ", ""),
                                                 ("", "")])
def test_speech_may_come_as_the_result_of_an_action(transcription, text):
    action = release_1_0.INTERFACE.topic("/speechEvent/text").action
    assert (action.name, action.type) == ("/speechEvent/recognise_speech_action",
                                          "cssr_system/recogniseSpeech")
    assert action.fields(Listen(10.0)) == (10.0,)
    assert action.answer(SimpleNamespace(transcription=transcription)).response == text


@pytest.mark.parametrize("sense, given, others, wait", [
    (Sense.VISITOR, status("scanning", 2),
     [status("scanning", 1), status("scanning", 3), status("social", 2)], math.inf),
    (Sense.PRESENCE, status("social", 2), [status("social", 1), status("seeking", 2)], 10.0),
    (Sense.GAZE, status("seeking", 2),
     [status("seeking", 1), status("seeking", 3), status("social", 2)], math.inf)])
def test_what_tells_of_a_visitor(sense, given, others, wait):
    evidence = release_1_0.INTERFACE.evidence(sense)
    assert (evidence.topic.name, evidence.wait) == ("/overtAttention/mode", wait)
    assert evidence.is_given(given, 2)
    assert not any(evidence.is_given(other, 2) for other in others)
    given_up = [each for each in [given] + others if evidence.is_given_up(each)]
    assert given_up == ([status("seeking", 3)] if sense is Sense.GAZE else [])


def test_on_the_document_s_robot_a_face_tells_of_presence():
    evidence = INTERFACE.evidence(Sense.PRESENCE)
    assert (evidence.topic.name, evidence.wait) == ("/faceDetection/data", 10.0)
    assert evidence.is_given(Faces(("1",), (False,)), 1) and not evidence.is_given(Faces((), ()), 1)


@pytest.mark.parametrize("gaze_value", [1, 2])
def test_on_the_document_s_robot_the_configured_value_tells_of_gaze(gaze_value):
    evidence = INTERFACE.evidence(Sense.GAZE)
    assert evidence.is_given(status("seeking", gaze_value), gaze_value)
    assert not evidence.is_given(status("seeking", 3 - gaze_value), gaze_value)
    assert not evidence.is_given(status("social", gaze_value), gaze_value)


def test_an_exhibit_without_a_place_is_unusable():
    answer = INTERFACE.service(QueryKnowledge).answer

    def response(*numbers):
        names = ("x", "y", "theta"), ("x", "y", "z")
        location, gesture = (SimpleNamespace(**dict(zip(each, part))) for each, part in zip(
            names, (numbers[:3], numbers[3:])))
        return SimpleNamespace(exhibits=[SimpleNamespace(
            name="Forge", description1="a", description2="b", location=location, gesture=gesture)])

    assert answer(response(1.0, 2.0, 3.0, 4.0, 5.0, 6.0)).exhibits == (
        Exhibit("Forge", "a", "b", Location(1.0, 2.0, 3.0), Point(4.0, 5.0, 6.0)),)
    for numbers in ((math.nan, 2.0, 3.0, 4.0, 5.0, 6.0), (1.0, 2.0, 3.0, 4.0, 5.0, math.inf)):
        with pytest.raises(Unusable, match="^Forge has a coordinate that is not a number: "):
            answer(response(*numbers))


def test_the_knowledge_is_asked_of_files_in_release_1_0_alone():
    assert (INTERFACE.resource(QueryKnowledge), release_1_0.INTERFACE.resource(QueryKnowledge)) == (
        "/knowledgeBase/query", "the knowledge files")
    assert release_1_0.INTERFACE.serves(QueryKnowledge) and not INTERFACE.serves(SetPose)
    with pytest.raises(LookupError, match="QueryKnowledge"):
        release_1_0.INTERFACE.service(QueryKnowledge)


def test_what_only_one_of_the_robots_offers():
    robots = (INTERFACE, release_1_0.INTERFACE)
    assert [robot.tells(FACES) for robot in robots] == [True, False]
    assert [robot.tells(Sense.PRESENCE) for robot in robots] == [True, True]
    assert [robot.tells_pressed for robot in robots] == [True, False]
    assert not any(robot.serves(Request) for robot in robots)


def test_any_speech_is_an_utterance_for_which_the_robot_goes_on_to_listen():
    for robot in (INTERFACE, release_1_0.INTERFACE):
        evidence = robot.evidence(Sense.UTTERANCE)
        assert evidence.is_given("yes", 1) and not evidence.is_given_up("yes")


def test_a_declaration_that_contradicts_itself_is_refused():
    say, (tell, ) = INTERFACE.service(Say), [
        each for each in release_1_0.SERVICES if each.request is Say]
    with pytest.raises(
            ValueError,
            match="^/textToSpeech/say_text and /textToSpeech/say_text are both declared for Say$"):
        Interface("twice", (say, tell), (), (), {})
    with pytest.raises(LookupError, match="no service is declared for the request SetAttention"):
        Interface("unsafe", (say,), (), (SetAttention("disabled"),), {})


@pytest.mark.parametrize("piece, following", [
    ("fields", Success("success", True, False)), ("success", 5.0), ("deadline", "it is dark"),
    ("impact_if_missing", lambda response: None), ("answer", True)])
def test_a_service_names_the_piece_that_is_left_out(piece, following):
    with pytest.raises(TypeError) as raised:
        dataclasses.replace(INTERFACE.service(Say), **{piece: following})
    assert str(
        raised.value
    ) == "the declaration of /textToSpeech/say_text has no {}, but {!r} in its place".format(
        piece, following)


@pytest.mark.parametrize("kind, success, is_refused", [
    (Service, None, True), (Action, None, False), (Publication, None, False),
    (Action, 5.0, True), (Action, Success("success", True, False), False)])
def test_only_a_service_needs_a_field_that_says_whether_it_was_done(kind, success, is_refused):
    fields = vars(INTERFACE.service(Say))
    declared = {field.name: fields[field.name] for field in dataclasses.fields(Service)}
    declared["success"] = success
    if is_refused:
        with pytest.raises(TypeError, match="has no success, but"):
            kind(**declared)
    else:
        assert kind(**declared).success is success


def test_of_events_the_last_are_kept_and_of_a_state_the_newest_and_its_newest_event():
    def kept(topic, *values):
        samples = ()
        for value in values:
            samples = topic.kept(samples, Sample(value, 1.0))
        return [sample.value for sample in samples]

    events = dataclasses.replace(FACES, is_continuous=False)
    assert kept(events, *range(MOST_EVENTS)) == list(range(MOST_EVENTS))
    assert kept(events, *range(MOST_EVENTS + 50)) == list(range(50, MOST_EVENTS + 50))
    assert kept(FACES, 1, 2, 3) == [3]
    evens = dataclasses.replace(FACES, is_event=lambda value: value % 2 == 0)
    assert [kept(evens, *values) for values in ((1,), (1, 3), (1, 2), (2, 3), (2, 3, 5), (2, 4))
            ] == [[1], [3], [2], [2, 3], [2, 5], [4]]


@pytest.mark.parametrize("request_, doing",
                         [(SetAnimation("enabled"), "starting lifelike movement"),
                          (SetAnimation("disabled"), "stopping lifelike movement"),
                          (SetRecognition(True), "switching speech recognition on"),
                          (SetRecognition(False), "switching speech recognition off")])
def test_what_is_switched_on_or_off_is_told_so(request_, doing):
    assert tuple(request_.words) == (doing, "", "", "notice", None)


def test_what_a_robot_of_release_1_0_may_lack():
    assert {
        service.name: service.fails_without for service in release_1_0.SERVICES
        if service.is_optional} == {
        "/robotLocalization/set_pose": False, "/speechEvent/set_enabled": False,
        "/speechEvent/set_language": False, "/tabletEvent/prompt_and_get_response": True}
    assert not any(service.is_optional for service in INTERFACE.services)
    assert not any(topic.is_optional for topic in INTERFACE.topics + release_1_0.INTERFACE.topics)
