"""The ROS types of the declared services and topics. A type that is not built is told when this is imported."""
from typing import Any, Dict, Union

import roslib.message

from behavior_controller.interface import Service, Topic
from behavior_controller.interface.robots import INTERFACES


def _found(offer: Union[Service, Topic]) -> Any:
    """Return the class of a srv or msg type. Raises ImportError, which says what is missing where."""
    is_service = isinstance(offer, Service)
    find = roslib.message.get_service_class if is_service else roslib.message.get_message_class
    try:
        found = find(offer.type)
    except (ValueError, ImportError):
        found = None
    if found is None:
        package, _, name = offer.type.partition("/")
        raise ImportError("the type {} of {} is not built: the package {} needs {}/{}.{}".format(
            offer.type, offer.name, package, *("srv", name, "srv") if is_service else ("msg", name, "msg")))
    return found


TYPES: Dict[Union[Service, Topic], Any] = {
    offer: _found(offer) for interface in INTERFACES.values() for offer in interface.offers}
"""Declaration -> its class."""
