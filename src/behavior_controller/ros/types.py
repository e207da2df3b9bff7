"""The ROS types of what is declared. A type that is not built is told when this is imported."""
from typing import Any, Dict, Union

import roslib.message

from behavior_controller.interface import Action, Service, Topic
from behavior_controller.interface.robots import INTERFACES


Offer = Union[Service, Topic, Action]


def _found(offer: Offer) -> Any:
    """Return the class of a srv, msg or action type. Raises ImportError, which says what is missing where."""
    is_service = isinstance(offer, Service)
    find = roslib.message.get_service_class if is_service else roslib.message.get_message_class
    ending = "Action" if isinstance(offer, Action) else ""
    try:
        found = find(offer.type + ending)
    except (ValueError, ImportError):
        found = None
    if found is None:
        package, _, name = offer.type.partition("/")
        folder = "srv" if is_service else "action" if ending else "msg"
        raise ImportError("the type {} of {} is not built: the package {} needs {}/{}.{}".format(
            offer.type, offer.name, package, folder, name, folder))
    return found


TYPES: Dict[Offer, Any] = {
    offer: _found(offer) for interface in INTERFACES.values()
    for offer in interface.offers + tuple(topic.action for topic in interface.topics if topic.action is not None)}
"""Declaration -> its class."""
