"""What each of the nine simulated nodes does with a request and what it has to publish, as plain data."""
import math
from typing import Any, Callable, Dict, NamedTuple, Optional, Tuple

from behavior_controller import interface
from behavior_controller.interface.document import ATTENTION, FACES, INTERFACE, SPEECH
from behavior_controller.interface.records import (Exhibit, GoTo, Location, PerformGesture, Point, Prompt,
                                                   QueryKnowledge, Say, SetAnimation, SetAttention)

from unit_tests.exhibits import Knowledge
from unit_tests.visitor import GAZE_VALUES, Visitor

Fields = Dict[str, Any]


class World(NamedTuple):
    """What a node knows besides the request."""

    visitor: Visitor
    knowledge: Knowledge
    mutual_gaze_value: int  # the convention for which the controller is configured


# ------------------------------------------------------------------------------------------------------------- services


class Service(NamedTuple):
    """A simulated service. ``object_to`` says what is wrong with a request; ``answer`` is what success looks like."""

    offer: interface.Service
    object_to: Callable[[Fields], Optional[str]]
    answer: Callable[[Fields, World], Fields]
    refusal: Fields
    wrong: Optional[Fields] = None  # an answer of the right type that means nothing, if there is one

    @property
    def name(self) -> str:
        """The canonical name."""
        return self.offer.name


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


def _object_to_goal(request: Fields) -> Optional[str]:
    return None if all(map(math.isfinite, request.values())) else "the goal {} is no place".format(request)


def _object_to_query(request: Fields) -> Optional[str]:
    return _allow("parameters", "exhibits", "entrance", "home")({"parameters": request["parameters"].lower()})


def _object_to_text(request: Fields) -> Optional[str]:
    return None if request["message"].strip() else "there is no text"


def _fixed(**answer: Any) -> Callable[[Fields, World], Fields]:
    return lambda request, world: answer


def _exhibits(request: Fields, world: World) -> Fields:
    return {"success": True, "exhibits": list(world.knowledge.query(request["parameters"]))}


def _press(request: Fields, world: World) -> Fields:
    return {"success": True, "response": world.visitor.press(request["message"].split("|"))}


NOWHERE = Exhibit("nowhere", "", "", Location(math.nan, 0.0, 0.0), Point(0.0, 0.0, 0.0))
"""A place that cannot be driven to."""

def _service(request: type, *behaviour: Any) -> Tuple[str, Service]:
    offer = INTERFACE.service(request)
    return offer.node, Service(offer, *behaviour)


SERVICES: Dict[str, Service] = dict((
    _service(SetAnimation, _allow("state", "enabled", "disabled"),
             _fixed(success="1"), {"success": "0"}, {"success": "perhaps"}),
    _service(SetAttention, _allow("state", "disabled", "social", "scanning", "seeking", "location"),
             _fixed(mode_set_success=1), {"mode_set_success": 0}, {"mode_set_success": 7}),
    _service(PerformGesture, _object_to_gesture,
             _fixed(gesture_success=1), {"gesture_success": 0}, {"gesture_success": 7}),
    _service(Say, _object_to_text,
             _fixed(success=True, response=""), {"success": False, "response": ""}),
    _service(GoTo, _object_to_goal,
             _fixed(navigation_goal_success=1), {"navigation_goal_success": 0}, {"navigation_goal_success": 7}),
    _service(QueryKnowledge, _object_to_query,
             _exhibits, {"success": False, "exhibits": []}, {"success": True, "exhibits": [NOWHERE]}),
    _service(Prompt, _object_to_text,
             _press, {"success": False, "response": ""}, {"success": True, "response": "Perhaps"}),
))
"""Node -> its service (table 3)."""


# --------------------------------------------------------------------------------------------------------------- topics


class Topic(NamedTuple):
    """A simulated topic. ``content`` is the next message; a new content is worth a line in the journal."""

    offer: interface.Topic
    content: Callable[[World], Fields]

    @property
    def name(self) -> str:
        """The canonical name."""
        return self.offer.name


def _faces(world: World) -> Fields:
    if not world.visitor.is_here:
        return {"face_label_id": [], "mutualGaze": []}
    return {"face_label_id": ["visitor"], "mutualGaze": [_meets_gaze(world)]}


def _meets_gaze(world: World) -> bool:
    return world.visitor.attention == "seeking" and world.visitor.looks_back


def _attention(world: World) -> Fields:
    state = world.visitor.attention
    value = GAZE_VALUES[world.mutual_gaze_value][world.visitor.gaze()] if state == "seeking" else 0
    return {"state": state, "value": value}


def _utterance(world: World) -> Fields:
    return {"data": world.visitor.utterance()}


TOPICS: Dict[str, Topic] = {topic.node: Topic(topic, content) for topic, content in (
    (FACES, _faces), (ATTENTION, _attention), (SPEECH, _utterance))}
"""Node -> its topic (table 2)."""

NODES = tuple(dict.fromkeys([*SERVICES, *TOPICS]))
