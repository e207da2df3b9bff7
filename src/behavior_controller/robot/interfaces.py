"""The robots that a configuration can choose from, by the name of their interface."""
import re
from typing import Dict

from behavior_controller import extensions
from behavior_controller.robot.declarations import Action, Interface, Offer, Service, Topic
from behavior_controller.robot import d543, release_1_0
from behavior_controller.robot.requests import Request


DECLARED_BY: Dict[Offer, extensions.Extension] = {}
"""The extension of each declaration that is not this package's own."""


def _extended(robot: Interface) -> Interface:
    """Return the robot with what other packages declare for it. Raises BrokenExtension."""
    for extension in extensions.exported("interface"):
        services = extension.declared("SERVICES", Service)
        topics = extension.declared("TOPICS", Topic)
        for offer in services + topics:
            fault = _fault(offer)
            if fault:
                raise extension.broken(f"the declaration of {offer.name}: {fault}",
                                       *extensions.quoted(offer.name))
            DECLARED_BY[offer] = extension
        try:
            robot = robot.with_more(services, topics)
        except (AttributeError, TypeError, ValueError) as error:
            raise extension.broken(f"its SERVICES and TOPICS cannot be used: {error}",
                                   "SERVICES =", "TOPICS =") from error
    return robot


def _fault(offer: Offer) -> str:
    """Return what is wrong with a declaration of another package; empty: nothing."""
    if not offer.name.startswith("/"):
        return "its name does not begin with /"
    if not re.fullmatch(r"[a-z]\w*/\w+", offer.type):
        return f"its type {offer.type!r} is not package/Type"
    if not offer.absence:
        return "it does not say what the robot cannot do without it (absence)"
    if not offer.node.isidentifier():
        return f"its node {offer.node!r} is not the name of a node, without /"
    if isinstance(offer, Topic):
        if not isinstance(offer.value, type):
            return f"the kind of its values is {offer.value!r}, and not a type"
        return "" if callable(offer.read) else f"{offer.read!r} cannot read a message"
    if isinstance(offer, Action) and not callable(offer.feedback):
        return f"{offer.feedback!r} cannot read a feedback"
    if offer.deadline <= 0.0:
        return f"a deadline of {offer.deadline} s lets nothing end in time"
    request = offer.request
    if not (isinstance(request, type) and issubclass(request, Request)):
        return f"{request!r} is not a class of requests"
    loose = [name for name, value in vars(request).items()
             if not name.startswith("_") and isinstance(value, (str, int, float))]
    return f"{request.__name__}.{loose[0]} has no annotation, so it is not a field" if loose else ""


INTERFACES: Dict[str, Interface] = {
    robot.name: _extended(robot) for robot in (d543.INTERFACE, release_1_0.INTERFACE)}

DEFAULT = INTERFACES[d543.INTERFACE.name]
