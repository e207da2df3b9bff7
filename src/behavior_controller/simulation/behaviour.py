"""What the simulated nodes do with each kind of request and what they publish, for every interface.
"""
import math
from types import SimpleNamespace
from typing import Any, Callable, Collection, Dict, List, Mapping, NamedTuple, Optional, Union

from msgspec.structs import asdict

from behavior_controller.config.phrases import YES
from behavior_controller.robot import d543
from behavior_controller.robot.declarations import (
    Action, Interface, Plain, Publication, Sense, Service, Success, Topic)
from behavior_controller.robot.requests import (
    LETTERS_A_SECOND, Answer, AttentionStatus, Exhibit, Faces, GoTo, GoToGoal, Location,
    PerformGesture, PerformGestureGoal, Point, Prompt, QueryKnowledge, Say, SayGoal, SetAnimation,
    SetAttention, SetPose, SetRecognition, SetRecognitionLanguage)
from behavior_controller.robot.interfaces import INTERFACES

from behavior_controller.simulation.faults import REFUSED, WRONG
from behavior_controller.simulation.visitor import (
    DETECTED, GAZE_VALUES, NOTHING_HEARD, NO_STATUS, SEARCHING, spoken)
from behavior_controller.simulation.world import World

Fields = Dict[str, Any]

_LANGUAGES = ("English", "IsiZulu", "Kinyarwanda")
"""The languages of robots that have a service to set it."""


# ----------------------------------------------------------------------------------------- services


class SimulatedService(NamedTuple):
    """What the robot does with one kind of request, given the fields of the srv request.

    ``object_to`` says what is wrong with a request. ``answer`` is the content of a positive answer;
    None: the answer is no, because the visitor's is. ``nonsense`` is content of the right type
    without a meaning, where an answer has content. ``seconds`` is about how long a real robot
    takes. Of an action, ``feedback`` is the fields of its message after that share of its time,
    without any there is none; a cancel stops it before the share ``stops_until`` alone.
    """

    object_to: Callable[[Fields], Optional[str]]
    answer: Callable[[Fields, World], Optional[Answer]] = lambda request, world: Answer()
    nonsense: Optional[Answer] = None
    seconds: Callable[[Fields], float] = lambda request: 0.2
    feedback: Callable[[Fields, float], Fields] = lambda request, share: {}
    stops_until: float = 0.0


def _allow(field: str, *values: str) -> Callable[[Fields], Optional[str]]:
    def object_to(request: Fields) -> Optional[str]:
        if request[field] in values:
            return None
        return "{} is '{}'; allowed: {}".format(field, request[field], ", ".join(values))
    return object_to


def _object_to_gesture(request: Fields) -> Optional[str]:
    if request["gesture_duration"] <= 0:
        return "gesture_duration is {} ms; allowed: more than 0".format(request["gesture_duration"])
    if request["gesture_type"] == "deictic" and "arm" in request:
        return _allow("arm", "EITHER", "LEFT", "RIGHT")(request)
    return _allow("gesture_type", "deictic", "iconic", "symbolic", "bow", "nod")(request)


def _object_to_place(request: Fields) -> Optional[str]:
    if all(map(math.isfinite, request.values())):
        return None
    numbers = ", ".join("{} {:g}".format(*field) for field in request.items())
    return "{} is not a place".format(numbers)


_object_to_subject = _allow("parameters", "exhibits", "entrance", "home")
_object_to_language = _allow("language", *_LANGUAGES)


def _object_to_text(request: Fields) -> Optional[str]:
    if not spoken(request).strip():
        return "there is no text"
    if "language" in request:
        return _object_to_language(request)
    return None


def _press(request: Fields, world: World) -> Optional[Answer]:
    """Return what is pressed; a tablet that does not say which reports yes for any press, or for
    the first option."""
    options = request["message"].split("|")
    pressed = world.visitor.press(options)
    if world.settings.interface.tells_pressed:
        return Answer(response=pressed)
    if pressed == options[0] or pressed in options and world.settings.tablet_success_is != YES:
        return Answer()
    return None


SYNTHESIZED = 0.2
"""The share of a speech's time after which it is played; a cancel does not stop that."""

SPEED = 0.4
"""The speed of a robot's drive, in metres a second."""

DRIVE = 15.0
"""Seconds that each drive takes."""


def _speaking(request: Fields, share: float) -> Fields:
    status = "playing"
    if share < SYNTHESIZED:
        status = "synthesizing"
    return {"status": status, "progress": share}


_NOWHERE = Exhibit("nowhere", "", "", Location(math.nan, 0.0, 0.0), Point(0.0, 0.0, 0.0))
"""A goal that cannot be reached."""

SERVICES: Dict[type, SimulatedService] = {
    SetAnimation: SimulatedService(_allow("state", "enabled", "disabled")),
    SetAttention: SimulatedService(
        _allow("state", "disabled", "social", "scanning", "seeking", "location")),
    PerformGesture: SimulatedService(
        _object_to_gesture, seconds=lambda request: request["gesture_duration"] / 1000),
    Say: SimulatedService(
        _object_to_text, seconds=lambda request: len(spoken(request)) / LETTERS_A_SECOND,
        feedback=_speaking, stops_until=SYNTHESIZED),
    GoTo: SimulatedService(
        _object_to_place, seconds=lambda request: DRIVE,
        feedback=lambda request, share: {"distance_remaining": (1.0 - share) * DRIVE * SPEED},
        stops_until=1.0),
    SetPose: SimulatedService(_object_to_place),
    QueryKnowledge: SimulatedService(
        lambda request: _object_to_subject({"parameters": request["parameters"].lower()}),
        lambda request, world: Answer(exhibits=world.knowledge.query(request["parameters"])),
        Answer(exhibits=(_NOWHERE,))),
    Prompt: SimulatedService(
        _object_to_text, _press, Answer(response="Perhaps"), lambda request: 5.0),
    SetRecognition: SimulatedService(_allow("status", "true", "false")),
    SetRecognitionLanguage: SimulatedService(_object_to_language)}
"""Kind of request -> what the robot does with it, by a service or as the goal of an action."""

SERVICES.update({PerformGestureGoal: SERVICES[PerformGesture], GoToGoal: SERVICES[GoTo],
                 SayGoal: SERVICES[Say]})

FOREIGN = SimulatedService(lambda request: None, seconds=lambda request: 1.0)
"""A service that another package declares, which answers as ``Service.rehearse`` says."""


def simulated(service: Service) -> SimulatedService:
    """Return what the robot does with a request to a service."""
    return SERVICES.get(service.request, FOREIGN)


def seconds(service: Service, request: Fields) -> float:
    """Return how long a real robot takes for the request to a service until it answers."""
    is_speech = service.request is Say
    if is_speech and service.answers_early(Say(spoken(request), request.get("language", ""))):
        return 0.0
    return simulated(service).seconds(request)


def nonsense(success: Success) -> Optional[Plain]:
    """Return a value of the outcome field that has no meaning; None if each of its values has one.
    """
    return {bool: None, int: 7}.get(type(success.done), "perhaps")


def possible(fault: Optional[str], service: Service,
             response_fields: Collection[str]) -> Optional[str]:
    """Return the fault of a call whose response has these fields: a refusal where no answer can be
    nonsense. A message that is published has no answer: it is refused where no node subscribes."""
    if isinstance(service, Publication):
        return fault and REFUSED
    brings = len(response_fields) > 1 and simulated(service).nonsense is not None
    has_nonsense = service.success is not None and nonsense(service.success) is not None
    if fault == WRONG and not brings and not has_nonsense:
        return REFUSED
    return fault


def response(service: Service, answer: Optional[Answer], fault: Optional[str] = None) -> Fields:
    """Return the outcome and the content of the response that carries ``answer``; without it, of a
    refusal, or of nonsense if that is the ``fault``."""
    success = service.success
    if success is None:
        return asdict(answer or Answer())
    outcome = success.done
    if fault == WRONG:
        senseless = nonsense(success)
        if senseless is not None:
            outcome = senseless
        answer = simulated(service).nonsense
    elif answer is None:
        outcome = success.refused
    return dict(asdict(answer or Answer()), **{success.field: outcome})


# ------------------------------------------------------------------------------------------- topics

Value = Union[Faces, AttentionStatus, str]


class SimulatedTopic(NamedTuple):
    """A topic. ``content`` is the content of its next message, None without a message; ``fields``
    are the message's."""

    content: Callable[[World], Optional[Value]]
    fields: Callable[[Any], Fields]


def _faces(world: World) -> Faces:
    visitor = world.visitor
    if not visitor.is_here:
        return Faces((), ())
    return Faces(("visitor",), (visitor.attention == "seeking" and visitor.looks_back,))


def _attention(world: World) -> AttentionStatus:
    visitor, robot = world.visitor, world.settings.interface
    if visitor.attention == "seeking":
        return AttentionStatus("seeking", GAZE_VALUES[world.settings.gaze_value][visitor.gaze()])
    senses = [robot.evidence(sense) for sense in (Sense.VISITOR, Sense.PRESENCE)]
    if visitor.attention in [evidence.mode for evidence in senses]:
        return AttentionStatus(visitor.attention, DETECTED if visitor.is_here else SEARCHING)
    tells_mode = senses[0].topic.value is AttentionStatus and visitor.attention == "social"
    return AttentionStatus(visitor.attention, NO_STATUS if tells_mode else 0)


def _utterance(world: World) -> Optional[str]:
    """Return the text of speech recognition; where it can be switched off, only what it hears while
    it is on."""
    words = world.visitor.utterance()
    if not world.settings.interface.serves(SetRecognition):
        return words or NOTHING_HEARD
    if not world.visitor.is_listened_to:
        return None
    return words or None


TOPICS: Mapping[str, SimulatedTopic] = {
    d543.FACES.name: SimulatedTopic(_faces, lambda faces: {
        "face_label_id": list(faces.labels), "mutualGaze": list(faces.mutual_gaze)}),
    d543.ATTENTION.name: SimulatedTopic(_attention, lambda status: status._asdict()),
    d543.SPEECH.name: SimulatedTopic(_utterance, lambda text: {"data": text})}
"""Canonical name -> the topic, of any robot."""


def read(topic: Topic, fields: Fields) -> Any:
    """Return what the controller reads from a message with these fields."""
    return topic.read(SimpleNamespace(**fields))


# -------------------------------------------------------------------------------------------- nodes


def services(interface: Interface) -> List[Service]:
    """Return the services that are simulated: those of this package, not those that other packages
    declare."""
    return [service for service in interface.services if service.request in SERVICES]


def topics(interface: Interface) -> List[Topic]:
    """Return the topics that are simulated."""
    return [topic for topic in interface.topics if topic.name in TOPICS]


def rehearsed_topics(interface: Interface) -> List[Topic]:
    """Return the topics with messages in a rehearsal: also those that declare them."""
    return [topic for topic in interface.topics
            if topic.name in TOPICS or topic.simulated_value is not None]


def servers(*robots: Interface) -> Dict[str, None]:
    """Return the simulated nodes that have a service, in the order of their declarations."""
    return dict.fromkeys(service.node for robot in robots for service in services(robot))


def nodes(*robots: Interface) -> Dict[str, None]:
    """Return the simulated nodes."""
    return dict.fromkeys(
        [*servers(*robots), *(topic.node for robot in robots for topic in topics(robot))])


NODES = tuple(nodes(*INTERFACES.values()))
"""All nodes of all robots."""

SERVERS = tuple(servers(*INTERFACES.values()))
"""The nodes that have a service."""

_SERVICES = [service for robot in INTERFACES.values() for service in services(robot)]
ACTIONS = tuple(dict.fromkeys(each.name for each in _SERVICES if isinstance(each, Action)))
"""Actions beside services of the same names, which either may lack."""

OPTIONAL = tuple(dict.fromkeys(
    service.name for service in _SERVICES if service.is_optional or service.name in ACTIONS))
"""Services that some robots do not have."""
