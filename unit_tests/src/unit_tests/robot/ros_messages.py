"""The requests, answers, messages and goals of the simulated robot as ROS has them, for whatever
node offers them."""
import threading
from typing import Any, Callable, Optional, Sequence

import actionlib
from actionlib_msgs.msg import GoalStatus
from cssr_system.msg import exhibitInfoMessage, gestureMessage, locationMessage
from geometry_msgs.msg import Point

from behavior_controller.robot.declarations import Action, Service, Topic
from behavior_controller.robot.requests import Answer, Exhibit
from behavior_controller.ros.types import TYPES
from behavior_controller.simulation import behaviour
from behavior_controller.simulation.behaviour import Fields

FACE_CENTRE = Point(320.0, 240.0, 1.5)
"""The position of the visitor's face: pixels, and metres from the camera."""


def response(service: Service, answer: Optional[Answer], fault: Optional[str] = None) -> Any:
    """Return the response that carries ``answer``: see ``behaviour.response``."""
    content = behaviour.response(service, answer, fault)
    content["exhibits"] = [_exhibit_message(exhibit) for exhibit in content["exhibits"]]
    kind = _response_class(service)
    return kind(**{slot: content[slot] for slot in kind.__slots__ if slot in content})


def _response_class(service: Service) -> Any:
    if isinstance(service, Action):
        return type(TYPES[service]().action_result.result)
    return TYPES[service]._response_class


def _exhibit_message(exhibit: Exhibit) -> exhibitInfoMessage:
    return exhibitInfoMessage(exhibit.name, exhibit.description1, exhibit.description2,
                              locationMessage(*exhibit.location), gestureMessage(*exhibit.gesture))


def response_fields(service: Service) -> Sequence[str]:
    """Return the names of the fields of a service's response, or of an action's result."""
    return list(_response_class(service).__slots__)


def message(topic: Topic, content: Fields) -> Any:
    """Return the message that ``topic`` publishes: the content, and for each face its position."""
    fields = dict(content)
    if "face_label_id" in content:
        fields["centroids"] = [FACE_CENTRE] * len(content["face_label_id"])
    return TYPES[topic](**fields)


def feedback(action: Action, content: Fields) -> Any:
    """Return a message with what an action reports of a goal."""
    return type(TYPES[action]().action_feedback.feedback)(**content)


Listen = Callable[[actionlib.SimpleActionServer, float], None]


def serve_goals(action: Action, carry_out: Callable[[Any], None]) -> None:
    """Offer an action; ``carry_out`` carries out a goal, given its handle, on a thread of its own.
    """
    def begin(goal: Any) -> None:
        goal.set_accepted()
        threading.Thread(target=carry_out, args=(goal,), daemon=True).start()

    actionlib.ActionServer(action.name, TYPES[action], begin, auto_start=False).start()


def offer_idle(action: Action) -> None:
    """Offer an action of which no goal is ever handled: its server does not start."""
    actionlib.ActionServer(action.name, TYPES[action], print, auto_start=False).initialize()


def is_cancelled(goal: Any) -> bool:
    """Return whether the client wants a goal to end."""
    return bool(goal.get_goal_status().status == GoalStatus.PREEMPTING)


def serve_action(action: Action, listen: Listen) -> None:
    """Offer an action; ``listen`` carries out a goal, given the server and the seconds that the
    goal may take."""
    server: actionlib.SimpleActionServer = actionlib.SimpleActionServer(
        action.name, TYPES[action], lambda goal: listen(server, goal.wait), auto_start=False)
    server.start()


def succeed(server: actionlib.SimpleActionServer, heard: str) -> None:
    """End a goal with what was heard."""
    result = server.get_default_result()
    result.transcription = heard
    server.set_succeeded(result)
