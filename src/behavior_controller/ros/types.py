"""The ROS types of what is declared. A type that is not built, or lacks a declared field, is told when this is imported."""
from typing import Any, Callable, Dict, Union

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
        raise ImportError("the type {} of {} is not built: the package {} needs {}/{}.{}; build its workspace when that "
                          "is there".format(offer.type, offer.name, package, folder, name, folder))
    if isinstance(offer, Service) and offer.success.field not in kind._response_class.__slots__:
        raise ImportError("the response of {} has no field {}, which is to tell the outcome of {}; it has: {}".format(
            offer.type, offer.success.field, offer.name, ", ".join(kind._response_class.__slots__) or "none"))
    if isinstance(offer, Service):
        _read_empty(offer, offer.answer, kind._response_class())
    elif isinstance(offer, Topic):
        _read_empty(offer, offer.read, kind())
    return kind


def _read_empty(offer: Offer, read: Callable[[Any], object], message: Any) -> None:
    """Raise ImportError if the declaration reads a field that the type does not have."""
    try:
        read(message)
    except AttributeError as error:
        if repr(type(message).__name__) in str(error):
            raise ImportError("the declaration of {} reads a field that {} does not have: {}".format(
                offer.name, offer.type, error))
    except Exception:
        pass  # an empty message may have no meaning


TYPES: Dict[Offer, Any] = {
    offer: found(offer) for interface in INTERFACES.values()
    for offer in interface.offers + tuple(topic.action for topic in interface.topics if topic.action is not None)}
"""Declaration -> its class."""
