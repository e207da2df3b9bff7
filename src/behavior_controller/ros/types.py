"""The ROS types of what is declared. A type that is not built, or lacks a declared field, is
reported when this is imported."""
import io
import struct
from typing import Any, Callable, Dict, Mapping, Tuple

import genpy
import msgspec
import roslib.message
import rospy

from behavior_controller import extensions
from behavior_controller.foreign_code import defined_at, is_ctrl_c
from behavior_controller.robot.declarations import (
    Action, Offer, Publication, Service, Topic, WrongFields)
from behavior_controller.robot.gateway import Cause
from behavior_controller.robot.interfaces import DECLARED_BY, INTERFACES
from behavior_controller.robot.requests import Request
from behavior_controller.ros.tcpros import Trouble

Make = Callable[[Any], Any]
"""Makes an empty message of a class."""

_MESSAGE = (roslib.message.get_message_class, "", "msg", lambda kind: kind(), lambda kind: kind())

_KINDS: Dict[type, Tuple[Callable[[str], Any], str, str, Make, Make]] = {
    Service: (roslib.message.get_service_class, "", "srv",
              lambda kind: kind._request_class(), lambda kind: kind._response_class()),
    Action: (roslib.message.get_message_class, "Action", "action",
             lambda kind: kind().action_goal.goal, lambda kind: kind().action_result.result),
    Publication: _MESSAGE, Topic: _MESSAGE}
"""How the class of each kind of declaration is named, in which folder its file is, and what is sent
to the robot and comes from it."""


def message_class(offer: Offer) -> Any:
    """Return the class of a srv, msg or action type. Raises ImportError, or BrokenExtension for a
    declaration of another package, which says what is missing where."""
    find, ending, folder, to_robot, from_robot = _KINDS[type(offer)]
    try:
        kind = find(offer.type + ending)
    except (ValueError, ImportError):
        kind = None
    if kind is None:
        package, _, name = offer.type.partition("/")
        raise _broken(offer, f"the type {offer.type} of {offer.name} is not built: the package "
                             f"{package} needs {folder}/{name}.{folder}; build its workspace when "
                             "that is there")
    message = from_robot(kind)
    if isinstance(offer, Topic):
        _read_empty(offer, offer.read, message)
        return kind
    if offer.success is not None and offer.success.field not in message.__slots__:
        names = ", ".join(message.__slots__) or "none"
        raise _broken(offer, f"the response of {offer.type} has no field {offer.success.field}, "
                             f"which is to tell the outcome of {offer.name}; it has: {names}")
    _fill_empty(offer, to_robot(kind))
    _read_empty(offer, offer.answer, message)
    if isinstance(offer, Action):
        _read_empty(offer, offer.feedback, kind().action_feedback.feedback)
    return kind


def _broken(offer: Offer, text: str) -> Exception:
    extension = DECLARED_BY.get(offer)
    if extension is None:
        return ImportError(text)
    return extension.broken(text, *extensions.quoted(offer.name))


def _read_empty(offer: Offer, read: Callable[[Any], object], message: Any) -> None:
    """Raise an error as ``message_class`` does if the declaration reads a field that the type does
    not have."""
    try:
        read(message)
    except AttributeError as error:
        if repr(type(message).__name__) in str(error):
            raise _broken(offer, f"the declaration of {offer.name} reads a field that {offer.type} "
                                 f"does not have: {error}")
    # an empty message may have no meaning, and other packages may raise anything
    except BaseException as error:
        if is_ctrl_c(error):
            raise


def _fill_empty(service: Service, message: Any) -> None:
    """Raise an error as ``message_class`` does if the declaration gives an empty request other
    fields than those of the type."""
    try:
        fields = msgspec.structs.fields(service.request)
        values = {field.name: _EMPTY[field.type] for field in fields if field.required}
        filled(message, service, service.request(**values), genpy.Time)
    except WrongFields as error:
        raise _broken(service, f"{service.name}: {error}")
    except Trouble as error:
        if isinstance(error.__context__, genpy.MessageException):
            raise _broken(service, str(error))
    # an empty request may have no meaning, and other packages may raise anything
    except BaseException as error:
        if is_ctrl_c(error):
            raise


def resolved(offer: Offer) -> str:
    """Return the resolved name of a service or topic."""
    return rospy.resolve_name(offer.name)


def not_published(topic: Topic) -> str:
    """Return why there is no evidence from a topic that has no publisher."""
    if topic.action is None:
        return "no node publishes it"
    return f"no node publishes it, and none offers the action {resolved(topic.action)}"


def in_place_of(offer: Offer, other: Offer) -> str:
    """Return the line about ``other``, which stands in for ``offer``."""
    return (f"no node offers the {offer.kind} {resolved(offer)}: the {other.kind} "
            f"{resolved(other)} is used in its place")


def type_mismatch(header: Mapping[str, str], wanted: Any) -> str:
    """Return the type in a peer's handshake, and ours."""
    return (f"{header.get('type')} (md5 {header.get('md5sum')}), expected is {wanted._type} "
            f"(md5 {wanted._md5sum})")


_EMPTY: Dict[Any, Any] = {str: "", bool: False, int: 0, float: 0.0}


def filled(message: Any, service: Service, request: Request,
           now: Callable[[], Any] = rospy.get_rostime) -> Any:
    """Return ``message`` with the values of a request; nested ones are dicts or lists, and a stamp
    may be ``now``. Raises ``Trouble`` if they do not fit, and Unsendable."""
    values = service.values(request, message.__slots__)
    try:
        genpy.message.fill_message_args(message, [dict(zip(message.__slots__, values))],
                                        {"now": now()})
        message.serialize(io.BytesIO())
    except (ValueError, TypeError, struct.error, genpy.MessageException) as error:
        raise Trouble(Cause.TYPE_MISMATCH, f"{request} cannot be sent as {message._type}: {error}"
                    f"{defined_at(service.fields)}")
    return message


CLOCK = Topic("/clock", "", "rosgraph_msgs/Clock", genpy.Time, lambda message: message.clock,
              "the mission stands still", is_continuous=True)
"""The simulated time."""

TYPES: Dict[Offer, Any] = {
    offer: message_class(offer) for robot in INTERFACES.values()
    for offer in (*robot.offers, *(topic.action for topic in robot.topics if topic.action))}
TYPES[CLOCK] = message_class(CLOCK)
"""Declaration -> its class."""
