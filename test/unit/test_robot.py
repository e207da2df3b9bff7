"""Tests of the answers and messages of the simulated nodes."""
import json
from dataclasses import replace
from types import SimpleNamespace

import pytest

from behavior_controller.bt.engine.clock import ManualClock
from behavior_controller.errors import ConfigurationError
from behavior_controller.robot import d543
from behavior_controller.robot.declarations import (
    Action, Publication, Sense, Service, Success, Topic, Unusable)
from behavior_controller.robot.d543 import INTERFACE
from behavior_controller.robot.gateway import Cause
from behavior_controller.robot.requests import (
    Answer, AttentionStatus, Exhibit, Faces, GoTo, Location, PerformGesture, Point, Prompt,
    QueryKnowledge, Request, Say, SayGoal, SetAnimation, SetAttention, SetPose, SetRecognition,
    SetRecognitionLanguage)
from behavior_controller.robot.interfaces import INTERFACES
from behavior_controller.config.settings import defaults

from behavior_controller.simulation import behaviour, configuration
from behavior_controller.simulation.faults import (
    CRASH, EXCEPTION, KINDS, PlannedFault, REFUSED, UNANSWERED, WRONG)
from behavior_controller.simulation.journal import JournalEntry
from behavior_controller.simulation.behaviour import (
    NODES, SERVERS, SERVICES, TOPICS, nodes, nonsense, possible, rehearsed_topics, services,
    simulated)
from behavior_controller.simulation.virtual_robot import (
    HANDLING, VirtualRobot, WAY, response, slots)
from behavior_controller.simulation.visitor import (
    BEHAVIOURS, DECLINES, ENGAGES, Manners, NOTHING_HEARD, NO_GAZE, SILENT, SMALL_TALK, Visitor)
from behavior_controller.simulation.world import Building, FORM, World, building_file, load_building

KNOWLEDGE = load_building(building_file())
GESTURE = {"gesture_type": "iconic", "gesture_id": 1, "gesture_duration": 3000, "bow_nod_angle": 0,
           "location_x": 0.0, "location_y": 0.0, "location_z": 0.0}


class Lamp(Request):
    """A request of another package."""


LAMP = Service(Lamp, "/lamp/set", "lamp", "a/B", lambda lamp: (), Success("done", True, False), 5.0,
               "no light")


DANCE = Action(Lamp, "/dance", "lamp", "a/B", lambda lamp: (), None, 5.0, "no dance",
               simulated_answer=lambda lamp: Answer(response="danced"))
COLOUR = Publication(Lamp, "/lamp/colour", "lamp", "a/B", lambda lamp: (), None, 5.0, "no colour")


def world(behaviour=ENGAGES, *states, **settings):
    person = Visitor(Manners(behaviour, ("A tour?",), "Yes", "No", (0.0, 0.0)))
    for state in states:
        person.notice(
            JournalEntry(0.0, "overtAttention", "/overtAttention/set_mode", 1, {"state": state}))
    return World(person, KNOWLEDGE, defaults(**settings))


def release(behaviour=ENGAGES, *states, **settings):
    return world(behaviour, *states, robotInterface="release-1.0", **settings)


@pytest.mark.parametrize("interface", INTERFACES.values())
def test_each_declared_service_and_topic_is_simulated(interface):
    assert {service.request for service in interface.services} - set(SERVICES) == set()
    assert {topic.name for topic in interface.topics} - set(TOPICS) == set()
    assert set(nodes(interface)) <= set(NODES) and {service.node for service in interface.services
                                                    } <= set(SERVERS)


@pytest.mark.parametrize(
    "request_", [kind for kind, simulated in SERVICES.items() if simulated.nonsense is not None])
def test_an_answer_is_read_on_one_of_the_robots(request_):
    declared = [service for interface in INTERFACES.values() for service in interface.services
                if service.request is request_]
    assert any(is_read(service, SERVICES[request_].nonsense)
               for service in declared), "its service needs an ``answer``"


def is_read(service, answer):
    try:
        return service.answer(response(service, answer)) != Answer()
    except Unusable:
        return True


@pytest.mark.parametrize("interface", INTERFACES.values())
def test_each_field_of_a_response_has_the_name_of_what_it_brings(interface):
    strange = [(service.type, field) for service in services(interface)
               if not isinstance(service, Action) for field in slots(service)[1]
               if field not in (service.success.field,) + Answer.__struct_fields__]
    assert strange == [], "add a field of that name to records.Answer"


def test_what_another_package_declares_is_not_simulated():
    topic = Topic("/lamp/text", "lamp", "std_msgs/String", str, str, "no light",
                  is_continuous=False)
    more = replace(INTERFACE, services=INTERFACE.services + (LAMP,),
                   topics=INTERFACE.topics + (topic,))
    assert len(more.offers) == len(INTERFACE.offers) + 2 and nodes(more) == nodes(INTERFACE)
    assert rehearsed_topics(more) == rehearsed_topics(INTERFACE) == list(INTERFACE.topics)
    rehearsed = replace(topic, simulated_value=lambda seconds: None)
    assert rehearsed_topics(replace(more, topics=INTERFACE.topics + (rehearsed,))) == [
        *INTERFACE.topics, rehearsed]


def test_each_kind_of_request_has_a_robot_that_is_asked_so():
    assert set(SERVICES) - {service.request for interface in INTERFACES.values()
                            for service in interface.services} == set()


@pytest.mark.parametrize("kind, request_fields, answer", (
    (SetAnimation, {"state": "enabled"}, Answer()),
    (SetAttention, {"state": "seeking"}, Answer()),
    (PerformGesture, GESTURE, Answer()),
    (Say, {"message": "Hello"}, Answer()),
    (GoTo, {"goal_x": 1.0, "goal_y": 2.0, "goal_theta": 90.0}, Answer()),
    (Prompt, {"message": "Yes|No"}, Answer("Yes")),
    (Say, {"message": "Hello", "language": "IsiZulu"}, Answer()),
    (SetPose, {"x": 1.0, "y": -2.0, "theta": 90.0}, Answer()),
    (SetRecognition, {"status": "true"}, Answer()),
    (SetRecognitionLanguage, {"language": "Kinyarwanda"}, Answer())))
def test_success_is_what_the_contract_says(kind, request_fields, answer):
    assert SERVICES[kind].object_to(request_fields) is None
    assert SERVICES[kind].answer(request_fields, world(ENGAGES, "scanning")) == answer


def test_a_gesture_may_be_as_short_as_it_likes():
    assert SERVICES[PerformGesture].object_to(dict(GESTURE, gesture_duration=1)) is None


@pytest.mark.parametrize("request_fields, kind, seconds",
                         ((GESTURE, PerformGesture, 3.0), ({"message": "x" * 28}, Say, 2.0),
                          ({"state": "disabled"}, SetAnimation, 0.2)))
def test_a_gesture_takes_its_time_and_a_second_has_fourteen_letters(request_fields, kind, seconds):
    assert behaviour.seconds(INTERFACE.service(kind), request_fields) == pytest.approx(seconds)


@pytest.mark.parametrize("robot, kind, language, seconds", [
    ("release-1.0", Say, "Kinyarwanda", 2.0), ("release-1.0", Say, "English", 0.0),
    ("release-1.1", Say, "English", 2.0), ("release-1.1", SayGoal, "English", 2.0)])
def test_release_1_0_answers_at_once_in_english_and_release_1_1_does_not(
        robot, kind, language, seconds):
    field = "text" if kind is SayGoal else "message"
    request = {field: "x" * 28, "language": language}
    assert behaviour.seconds(INTERFACES[robot].service(kind), request) == pytest.approx(seconds)


def test_another_packages_service_takes_a_second():
    assert simulated(LAMP).seconds({"colour": "red"}) == 1.0


@pytest.mark.parametrize("kind, response, fault", (
    # a number, which may be neither success nor failure
    (GoTo, ("navigation_goal_success",), WRONG),
    (QueryKnowledge, ("success", "exhibits"), WRONG), (QueryKnowledge, ("success",), REFUSED),
    (Prompt, ("success", "response"), WRONG), (Prompt, ("success",), REFUSED),
    (Say, ("success",), REFUSED), (Say, ("success", "more"), REFUSED)))
def test_an_answer_is_nonsense_only_where_a_field_can_hold_any(kind, response, fault):
    assert possible(WRONG, INTERFACE.service(kind), response) == fault
    assert [possible(other, INTERFACE.service(kind), response)
            for other in (None, CRASH)] == [None, CRASH]


def test_what_another_package_answers_is_never_nonsense():
    assert possible(WRONG, LAMP, ("done", "more")) == REFUSED


@pytest.mark.parametrize("fault", KINDS)
def test_a_message_goes_wrong_where_nothing_subscribes(fault):
    assert possible(fault, COLOUR, ()) == REFUSED and possible(None, COLOUR, ()) is None


def virtual_robot(offer, *planned, **given):
    """Return a robot in virtual time that has another package's offer too, and these faults; a test
    has the configuration that is given."""
    interface = replace(INTERFACE, services=INTERFACE.services + (offer,))
    mission = SimpleNamespace(
        tree=SimpleNamespace(clock=ManualClock(0.0), wake=SimpleNamespace(emit=lambda: None)),
        settings=SimpleNamespace(interface=interface, deadline=lambda service: service.deadline),
        offers=())
    test = replace(configuration.defaults(failureRate=0.0, **given), planned_faults=planned)
    return VirtualRobot(mission, world(), test)


AT_ONCE, CARRIED_OUT, LATE = 0.01, 1.01, 5.0
"""Seconds after which the result of a call is there: the node takes a second, its caller waits 5.
"""


@pytest.mark.parametrize("offer, fault, over, expected", [
    (LAMP, None, CARRIED_OUT, Answer()), (LAMP, REFUSED, CARRIED_OUT, Cause.REFUSED),
    (LAMP, WRONG, CARRIED_OUT, Cause.REFUSED), (LAMP, EXCEPTION, AT_ONCE, Cause.HANDLER_EXCEPTION),
    (LAMP, CRASH, AT_ONCE, Cause.CONNECTION_LOST), (LAMP, UNANSWERED, LATE, Cause.NO_ANSWER),
    (DANCE, None, CARRIED_OUT, Answer(response="danced")),
    (DANCE, REFUSED, CARRIED_OUT, Cause.REFUSED), (DANCE, EXCEPTION, AT_ONCE, Cause.REFUSED),
    (DANCE, CRASH, AT_ONCE, Cause.CONNECTION_LOST), (DANCE, UNANSWERED, LATE, Cause.NO_ANSWER),
    (COLOUR, None, CARRIED_OUT, Answer()), (COLOUR, REFUSED, CARRIED_OUT, Cause.NOT_ADVERTISED)])
def test_what_another_package_declares_ends_as_on_its_robot(offer, fault, over, expected):
    robot = virtual_robot(offer, *[PlannedFault("lamp", 1, fault)] * bool(fault))
    call, results = robot.start(Lamp()), {}
    for moment in (AT_ONCE, CARRIED_OUT, LATE):
        robot.clock.set_to(moment)
        robot.clock.run_due()
        results[moment] = call.result
    assert [moment for moment, result in results.items() if result is not None][0] == over
    assert getattr(call.result, "cause", call.result) == expected


@pytest.mark.parametrize("fault, seconds", [
    (None, WAY + HANDLING), (REFUSED, WAY + HANDLING), (EXCEPTION, WAY), (CRASH, WAY)])
def test_a_call_that_takes_no_time_takes_that_of_its_way_and_its_handling(fault, seconds):
    robot = virtual_robot(LAMP, *[PlannedFault("lamp", 1, fault)] * bool(fault), callTimes="none")
    call = robot.start(Lamp())
    while call.result is None:
        robot.clock.set_to(robot.clock.next_due())
        robot.clock.run_due()
    assert robot.clock.now() == pytest.approx(seconds)


def test_a_message_is_noted_with_the_read_that_returns_it_first():
    topic = Topic("/door", "door", "std_msgs/String", str, str, "no door", is_continuous=False)
    robot, noted = virtual_robot(LAMP), []
    robot.note = noted.append
    for reads in (("a", "b", ""), ("c",)):  # of two traversals
        robot.topics.reads.clear()
        for value in reads:
            if value:
                robot.topics.publish(topic, value)
            robot.topics.recent(topic)
    assert [(message.value, message.read) for message in noted] == [("a", 1), ("b", 2), ("c", 1)]


def test_a_topic_of_another_package_says_what_its_declaration_says():
    door = Topic("/door", "door", "std_msgs/String", str, str, "no door", is_continuous=True,
                 simulated_value=lambda seconds: "open" if seconds > 0.42 else None)
    robot = virtual_robot(LAMP)
    robot.publish(door)
    silent, said = [], []
    while robot.clock.now() < 1.0:
        robot.clock.set_to(robot.clock.next_due())
        robot.clock.run_due()
        heard = [sample.value for sample in robot.topics.recent(door)]
        (said if heard == ["open"] else silent).append(robot.clock.now())
    # 20 messages a second
    assert [*silent, *said] == pytest.approx([number / 20 for number in range(1, 21)])
    assert said[0] == pytest.approx(0.45) and max(silent) < said[0] and robot.journal == []


def test_what_tells_an_outcome_may_be_neither_yes_nor_no():
    found = {kind: nonsense(INTERFACE.service(kind).success) for kind in (
        SetAnimation, PerformGesture, QueryKnowledge, SetAttention, GoTo, Prompt, Say)}
    assert found == {SetAnimation: "perhaps", PerformGesture: 7, QueryKnowledge: None,
                     SetAttention: 7, GoTo: 7, Prompt: None, Say: None}


@pytest.mark.parametrize("what, names", (
    ("exhibits", ["Pepper", "Robot arm", "Camera wall", "Mobile base", "Workshop"]),
    ("Entrance", ["Entrance"]), ("HOME", ["Home"])))
def test_the_knowledge_base_knows_places_in_tour_order(what, names):
    assert SERVICES[QueryKnowledge].object_to({"parameters": what}) is None
    answer = SERVICES[QueryKnowledge].answer({"parameters": what}, world())
    assert [place.name for place in answer.exhibits] == names


def test_exhibits_have_what_a_tour_needs():
    for exhibit in KNOWLEDGE.exhibits:
        assert exhibit.description1 and exhibit.description2 and exhibit.gesture != (0, 0, 0)
    assert len({exhibit.location for exhibit in KNOWLEDGE.exhibits}) == len(KNOWLEDGE.exhibits) >= 3
    assert KNOWLEDGE.entrance.gesture != (0, 0, 0)


@pytest.mark.parametrize("kind, request_fields, objection", (
    (SetAnimation, {"state": "on"}, "state is 'on'; allowed: enabled, disabled"),
    (SetAttention, {"state": "sleeping"}, "allowed: disabled, social, scanning, seeking, location"),
    (PerformGesture, dict(GESTURE, gesture_type="dance"), "gesture_type is 'dance'"),
    (PerformGesture, dict(GESTURE, gesture_duration=0), "gesture_duration is 0 ms"),
    (Say, {"message": " "}, "no text"),
    (Say, {"message": "Hello", "language": "english"}, "allowed: English, IsiZulu, Kinyarwanda"),
    (GoTo, {"goal_x": float("nan"), "goal_y": 0.0, "goal_theta": 0.0}, "not a place"),
    (SetPose, {"x": float("inf"), "y": 0.0, "theta": 0.0}, "not a place"),
    (QueryKnowledge, {"parameters": "toilets"}, "allowed: exhibits, entrance, home"),
    (Prompt, {"message": ""}, "no text"),
    (SetRecognition, {"status": "enabled"}, "allowed: true, false"),
    (SetRecognitionLanguage, {"language": ""}, "allowed: English")))
def test_requests_that_make_no_sense_are_objected_to(kind, request_fields, objection):
    assert objection in SERVICES[kind].object_to(request_fields)


def test_who_is_silent_presses_nothing():
    assert SERVICES[Prompt].answer({"message": "Yes|No"}, world(SILENT, "scanning")) == Answer("")


@pytest.mark.parametrize("meaning, says_yes", (("done", {ENGAGES, DECLINES}), ("yes", {ENGAGES})))
def test_a_tablet_that_does_not_tell_the_button_says_that_there_was_one_or_that_it_was_yes(
        meaning, says_yes):
    pressed = {
        behaviour for behaviour in (ENGAGES, DECLINES, SILENT)
        if SERVICES[Prompt].answer({"message":
            "'Yes'|'No'"}, release(behaviour, "scanning", tabletSuccessIs=meaning)) is not None}
    assert pressed == says_yes


def faces(*given):
    return TOPICS[d543.FACES.name].content(world(*given))


def test_faces():
    assert faces() == Faces((), ())
    assert faces(ENGAGES, "scanning") == Faces(("visitor",), (False,))
    assert faces(ENGAGES, "scanning", "seeking") == Faces(("visitor",), (True,))
    assert faces(NO_GAZE, "scanning", "seeking") == Faces(("visitor",), (False,))


@pytest.mark.parametrize("state", ("disabled", "social", "scanning", "location"))
def test_a_gaze_status_is_published_in_seeking_only(state):
    status = TOPICS[d543.ATTENTION.name].content(world(ENGAGES, "scanning", "seeking", state))
    assert status == AttentionStatus(state, 0)


@pytest.mark.parametrize("mutual_gaze_value, values", ((1, [0, 1]), (2, [1, 2])))
def test_the_gaze_status_keeps_to_the_convention(mutual_gaze_value, values):
    seeking = world(ENGAGES, "scanning", "seeking", mutualGazeValue=mutual_gaze_value)
    assert [TOPICS[d543.ATTENTION.name].content(seeking) for _ in range(2)] == [("seeking", value)
                                                                                for value in values]


@pytest.mark.parametrize(
    "states, sense, value",
    (
        # robot_releases: discovered at scanning and 2, present at social and 2, mutual gaze at
        # seeking and 2
        (("scanning", ), Sense.VISITOR, ("scanning", 2)),
        (("scanning", "social"), Sense.PRESENCE, ("social", 2)),
        (("scanning", "seeking"), Sense.GAZE, ("seeking", 2))))
@pytest.mark.parametrize("behaviour", BEHAVIOURS)
def test_the_attention_of_release_1_0_tells_of_the_visitor(states, sense, value, behaviour):
    robot = release(behaviour, *states)
    status = [TOPICS[d543.ATTENTION.name].content(robot) for _ in range(2)][1]
    is_met = not (behaviour == NO_GAZE and sense is Sense.GAZE)
    assert (status == value) is is_met
    assert robot.settings.interface.evidence(sense).is_given(status,
                                                             robot.settings.gaze_value) is is_met


@pytest.mark.parametrize("state", ("scanning", "social"))
def test_the_attention_of_release_1_0_finds_nobody_where_nobody_is(state):
    robot = release(ENGAGES, "scanning", state)
    robot.visitor.is_here = False
    assert TOPICS[d543.ATTENTION.name].content(robot) == (state, 1)


@pytest.mark.parametrize("robot, text", (
    (world(), NOTHING_HEARD), (world(ENGAGES, "scanning"), SMALL_TALK),
    (world(SILENT, "scanning"), NOTHING_HEARD), (release(), None),
    (release(ENGAGES, "scanning"), SMALL_TALK), (release(SILENT, "scanning"), None)))
def test_what_speech_recognition_writes(robot, text):
    assert TOPICS[d543.SPEECH.name].content(robot) == text


def test_recognition_that_is_switched_off_hears_nothing():
    robot = release(ENGAGES, "scanning")
    for status, text in (("false", None), ("true", SMALL_TALK)):
        robot.visitor.notice(
            JournalEntry(0.0, "speechEvent", "/speechEvent/set_enabled", 1, {"status": status}))
        assert TOPICS[d543.SPEECH.name].content(robot) == text


@pytest.mark.parametrize(
    "text", ("", "[]", "{\"exhibits\": []}", "{\"exhibits\": [{\"name\": \"x\"}]}",
             "{\"exhibits\": [{\"name\": \"x\", \"location\": [1, 2]}]}", "{\"exhibits\": [[]]}",
             "{\"exhibits\": [1]}", "[" * 100_000, "{\"exhibits\": [\"\u202e\"]}"))
def test_a_file_of_places_that_cannot_be_used_is_named(tmp_path, text):
    path = tmp_path / "exhibits.json"
    path.write_text(text)
    place = ":1:1" if text == "" else ""
    with pytest.raises(ConfigurationError,
                       match="exhibits.json{}: the places cannot be read".format(place)):
        load_building(str(path))
    with pytest.raises(ConfigurationError, match="none.json: the places cannot be read"):
        load_building(str(tmp_path / "none.json"))


@pytest.mark.parametrize("place, named", (
    ('{"nam": "x", "location": [1, 2, 3]}', "`nam` - at `$.exhibits[0]`"),
    ('{"name": "x", "location": [1, "a", 3]}', "`$.exhibits[0].location[1]`"),
    ('{"name": "x",\n location: 1}', "exhibits.json:2:2: ")))
def test_a_mistake_in_a_place_is_named_with_its_entry(tmp_path, place, named):
    path = tmp_path / "exhibits.json"
    path.write_text('{"exhibits": [' + place + "]}")
    with pytest.raises(ConfigurationError) as caught:
        load_building(str(path))
    assert named in str(caught.value) and FORM in str(caught.value)


def test_a_place_needs_no_descriptions_and_no_gesture(tmp_path):
    place = {"name": "x", "location": [1, 2, 90]}
    (tmp_path / "exhibits.json").write_text(
        json.dumps({"exhibits": [], "entrance": place, "home": place}))
    known = Exhibit("x", "", "", Location(1.0, 2.0, 90.0), Point(0.0, 0.0, 0.0))
    assert load_building(str(tmp_path / "exhibits.json")) == Building((), known, known)


def test_a_file_of_places_may_begin_with_a_byte_order_mark_and_must_be_a_file(tmp_path):
    with open(building_file(), "rb") as file:
        (tmp_path / "marked.json").write_bytes(b"\xef\xbb\xbf" + file.read())
    assert load_building(str(tmp_path / "marked.json")) == KNOWLEDGE
    with pytest.raises(ConfigurationError,
                       match="/dev/zero: the places cannot be read: it is not a regular file"):
        load_building("/dev/zero")
