"""What the simulated nodes do with each kind of request and what they publish, for every interface."""
import math
from typing import Any, Callable, Collection, Dict, List, Mapping, NamedTuple, Optional, Union

from behavior_controller import interface as interfaces
from behavior_controller.interface import Interface, Plain, Sense, Success, document
from behavior_controller.interface.records import (Answer, AttentionStatus, Exhibit, Faces, GoTo, Location,
                                                   PerformGesture, Point, Prompt, QueryKnowledge, Say, SetAnimation,
                                                   SetAttention, SetPose, SetRecognition, SetRecognitionLanguage)
from behavior_controller.interface.robots import INTERFACES
from behavior_controller.settings import YES, Settings

from unit_tests.exhibits import Knowledge
from unit_tests.faults import REFUSED, WRONG
from unit_tests.visitor import FOUND, GAZE_VALUES, LOOKED_FOR, NOTHING_HEARD, Visitor

Fields = Dict[str, Any]

LANGUAGES = ("English", "IsiZulu", "Kinyarwanda")
"""The languages of robots that have a service to set it."""


class World(NamedTuple):
    """What a node knows in addition to the request."""

    visitor: Visitor
    knowledge: Knowledge
    settings: Settings  # the controller's: the robot's interface, and the meaning of a gaze status


# ------------------------------------------------------------------------------------------------------------- services


class Service(NamedTuple):
    """What the robot does with one kind of request, given the fields of the srv request.

    ``object_to`` says what is wrong with a request. ``answer`` is the content of a positive answer; None: the answer is no,
    because the visitor's is. ``nonsense`` is content of the right type without a meaning, where an answer has content.
    ``seconds`` is about how long a real robot takes.
    """

    object_to: Callable[[Fields], Optional[str]]
    answer: Callable[[Fields, World], Optional[Answer]] = lambda request, world: Answer()
    nonsense: Optional[Answer] = None
    seconds: Callable[[Fields], float] = lambda request: 0.2


def _allow(field: str, *values: str) -> Callable[[Fields], Optional[str]]:
    def object_to(request: Fields) -> Optional[str]:
        if request[field] in values:
            return None
        return "{} is {!r}; allowed: {}".format(field, request[field], ", ".join(values))
    return object_to


def _object_to_gesture(request: Fields) -> Optional[str]:
    if request["gesture_duration"] <= 0:
        return "gesture_duration is {} ms; allowed: more than 0".format(request["gesture_duration"])
    return _allow("gesture_type", "deictic", "iconic", "symbolic", "bow", "nod")(request)


def _object_to_place(request: Fields) -> Optional[str]:
    return None if all(map(math.isfinite, request.values())) else "{} is not a place".format(request)


def _object_to_query(request: Fields) -> Optional[str]:
    return _allow("parameters", "exhibits", "entrance", "home")({"parameters": request["parameters"].lower()})


_object_to_language = _allow("language", *LANGUAGES)


def _object_to_text(request: Fields) -> Optional[str]:
    if not request["message"].strip():
        return "there is no text"
    return _object_to_language(request) if "language" in request else None


def _places(request: Fields, world: World) -> Answer:
    return Answer(exhibits=world.knowledge.query(request["parameters"]))


def _press(request: Fields, world: World) -> Optional[Answer]:
    """Return what is pressed; a tablet that does not say which reports yes for any press, or for the first option."""
    options = request["message"].split("|")
    pressed = world.visitor.press(options)
    if world.settings.interface.tells_pressed:
        return Answer(response=pressed)
    wanted = options[:1] if world.settings.tablet_success_is == YES else options
    return Answer() if pressed in wanted else None


LETTERS_A_SECOND = 14.0
"""The speed of a robot's speech, in characters a second."""

NOWHERE = Exhibit("nowhere", "", "", Location(math.nan, 0.0, 0.0), Point(0.0, 0.0, 0.0))
"""A goal that cannot be reached."""

SERVICES: Mapping[type, Service] = {
    SetAnimation: Service(_allow("state", "enabled", "disabled")),
    SetAttention: Service(_allow("state", "disabled", "social", "scanning", "seeking", "location")),
    PerformGesture: Service(_object_to_gesture, seconds=lambda request: request["gesture_duration"] / 1000),
    Say: Service(_object_to_text, seconds=lambda request: len(request["message"]) / LETTERS_A_SECOND),
    GoTo: Service(_object_to_place, seconds=lambda request: 15.0),
    SetPose: Service(_object_to_place),
    QueryKnowledge: Service(_object_to_query, _places, Answer(exhibits=(NOWHERE,))),
    Prompt: Service(_object_to_text, _press, Answer(response="Perhaps"), lambda request: 5.0),
    SetRecognition: Service(_allow("status", "true", "false")),
    SetRecognitionLanguage: Service(_object_to_language),
}
"""Kind of request -> what the robot does with it."""


def nonsense(success: Success) -> Optional[Plain]:
    """Return a value of the outcome field that has no meaning; None if each of its values has one."""
    return None if isinstance(success.done, bool) else 7 if isinstance(success.done, int) else "perhaps"


def usual_seconds(service: interfaces.Service, request: Fields) -> float:
    """Return about how long a real robot takes for a request with these fields."""
    return SERVICES[service.request].seconds(request) if service.request in SERVICES else 1.0


def possible(fault: Optional[str], service: interfaces.Service, response: Collection[str]) -> Optional[str]:
    """Return the fault of a call whose response has these fields: a refusal where no answer can be nonsense."""
    simulated = SERVICES.get(service.request)
    brings = len(response) > 1 and simulated is not None and simulated.nonsense is not None
    return REFUSED if fault == WRONG and not brings and nonsense(service.success) is None else fault


# --------------------------------------------------------------------------------------------------------------- topics

Value = Union[Faces, AttentionStatus, str]


class Topic(NamedTuple):
    """A topic. ``content`` is the content of its next message, None without a message; ``fields`` are the message's.

    ``value`` is the content of a message with such fields.
    """

    content: Callable[[World], Optional[Value]]
    fields: Callable[[Any], Fields]
    value: Callable[[Fields], Value]


def _faces(world: World) -> Faces:
    is_here = world.visitor.is_here
    return Faces(("visitor",), (_meets_gaze(world),)) if is_here else Faces((), ())


def _meets_gaze(world: World) -> bool:
    return world.visitor.attention == "seeking" and world.visitor.looks_back


def _attention(world: World) -> AttentionStatus:
    visitor = world.visitor
    if visitor.attention == "seeking":
        return AttentionStatus("seeking", GAZE_VALUES[world.settings.gaze_value][visitor.gaze()])
    if visitor.attention in ("scanning", "social") and _is_seen_by_attention(world.settings.interface):
        return AttentionStatus(visitor.attention, FOUND if visitor.is_here else LOOKED_FOR)
    return AttentionStatus(visitor.attention, 0)


def _is_seen_by_attention(interface: Interface) -> bool:
    return interface.evidence(Sense.VISITOR).topic.value is AttentionStatus


def _utterance(world: World) -> Optional[str]:
    """Return the text of speech recognition; where it can be switched off, only what it hears while it is on."""
    words = world.visitor.utterance()
    if world.settings.interface.serves(SetRecognition):
        return words if words and world.visitor.is_listened_to else None
    return words or NOTHING_HEARD


TOPICS: Mapping[str, Topic] = {
    document.FACES.name: Topic(
        _faces, lambda faces: {"face_label_id": list(faces.labels), "mutualGaze": list(faces.mutual_gaze)},
        lambda fields: Faces(tuple(fields["face_label_id"]), tuple(fields["mutualGaze"]))),
    document.ATTENTION.name: Topic(
        _attention, lambda status: status._asdict(), lambda fields: AttentionStatus(**fields)),
    document.SPEECH.name: Topic(_utterance, lambda text: {"data": text}, lambda fields: str(fields["data"])),
}
"""Canonical name -> the topic, of any robot."""


# ---------------------------------------------------------------------------------------------------------------- nodes


def services(interface: Interface) -> List[interfaces.Service]:
    """Return the services that are simulated: those of this package, not those that other packages declare."""
    return [service for service in interface.services if service.request in SERVICES]


def topics(interface: Interface) -> List[interfaces.Topic]:
    """Return the topics that are simulated."""
    return [topic for topic in interface.topics if topic.name in TOPICS]


def servers(*robots: Interface) -> Dict[str, None]:
    """Return the simulated nodes that have a service, in the order of their declarations."""
    return dict.fromkeys(service.node for robot in robots for service in services(robot))


def nodes(*robots: Interface) -> Dict[str, None]:
    """Return the simulated nodes."""
    return dict.fromkeys([*servers(*robots), *(topic.node for robot in robots for topic in topics(robot))])


NODES = tuple(nodes(*INTERFACES.values()))
"""All nodes of all robots."""

SERVERS = tuple(servers(*INTERFACES.values()))
"""The nodes that have a service."""

OPTIONAL = tuple(dict.fromkeys(service.name for robot in INTERFACES.values() for service in services(robot)
                               if service.is_optional))
"""Services that some robots do not have."""
