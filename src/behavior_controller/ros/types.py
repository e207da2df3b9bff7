"""The ROS types of what is declared. A type that is not built, or lacks the outcome, is told when this is imported."""
from typing import Any, Dict, Union

import roslib.message

from behavior_controller.interface import Action, Service, Topic
from behavior_controller.interface.robots import INTERFACES


Offer = Union[Service, Topic, Action]


def found(offer: Offer) -> Any:
    """Return the class of a srv, msg or action type. Raises ImportError, which says what is missing where."""
    is_service = isinstance(offer, Service)
    find = roslib.message.get_service_class if is_service else roslib.message.get_message_class
    ending = "Action" if isinstance(offer, Action) else ""
    try:
        kind = find(offer.type + ending)
    except (ValueError, ImportError):
        kind = None
    if kind is None:
        package, _, name = offer.type.partition("/")
        folder = "srv" if is_service else "action" if ending else "msg"
        raise ImportError("the type {} of {} is not built: the package {} needs {}/{}.{}".format(
            offer.type, offer.name, package, folder, name, folder))
    if isinstance(offer, Service) and offer.success.field not in kind._response_class.__slots__:
        raise ImportError("the response of {} has no field {}, which is to tell the outcome of {}; it has: {}".format(
            offer.type, offer.success.field, offer.name, ", ".join(kind._response_class.__slots__) or "none"))
    return kind


TYPES: Dict[Offer, Any] = {
    offer: found(offer) for interface in INTERFACES.values()
    for offer in interface.offers + tuple(topic.action for topic in interface.topics if topic.action is not None)}
"""Declaration -> its class."""
