"""The robots that a configuration can choose from, by the name of their interface."""
import functools
import math
import re
from dataclasses import replace
from typing import Dict, Tuple

import msgspec

from behavior_controller import extensions
from behavior_controller.robot.declarations import (
    Action, Interface, Offer, Publication, Service, Topic)
from behavior_controller.robot import d543, release_1_0, release_1_1
from behavior_controller.robot.requests import EFFECTS, Request


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
            robot = replace(robot, services=robot.services + services, topics=robot.topics + topics)
        except (AttributeError, TypeError, ValueError) as error:
            raise extension.broken(f"its SERVICES and TOPICS cannot be used: {error}",
                                   "SERVICES =", "TOPICS =") from error
    return robot


def _fault(offer: Offer) -> str:
    """Return what is wrong with a declaration of another package; empty: nothing."""
    if not re.fullmatch(r"/\w(/?\w)*", offer.name, re.ASCII):
        return "its name has to begin with /, with letters, digits, _ and / after it"
    if not re.fullmatch(r"[a-z]\w*/\w+", offer.type):
        return f"its type {offer.type!r} is not package/Type"
    if not offer.impact_if_missing:
        return "it does not say what the robot cannot do without it (impact_if_missing)"
    if not offer.node.isidentifier():
        return f"its node {offer.node!r} is not the name of a node, without /"
    field = "simulated_value" if isinstance(offer, Topic) else "simulated_answer"
    simulated = getattr(offer, field)
    if simulated is not None and not callable(simulated):
        return f"{simulated!r} is not a function for a rehearsal ({field})"
    if isinstance(offer, Topic):
        if not isinstance(offer.value, type):
            return f"the kind of its values is {offer.value!r}, and not a type"
        if not callable(offer.read):
            return f"{offer.read!r} cannot read a message"
        return ""
    if isinstance(offer, Action) and not callable(offer.feedback):
        return f"{offer.feedback!r} cannot read a feedback"
    if isinstance(offer, Publication) and offer.success is not None:
        return "a message has no outcome: its success is None"
    if not 0.0 < offer.deadline < math.inf:
        return f"a deadline of {offer.deadline} s: it has to be more than 0 and finite"
    return _request_fault(offer.request)


def _request_fault(request: object) -> str:
    """Return what is wrong with a class of requests of another package; empty: nothing."""
    if not (isinstance(request, type) and issubclass(request, Request)):
        return f"{request!r} is not a class of requests"
    if request.effect not in EFFECTS:
        return f"{request.__name__}.effect is {request.effect!r}; allowed: MOTION, SOUND, NO_EFFECT"
    loose = [name for name, value in vars(request).items() if not name.startswith("_")
             and not hasattr(Request, name) and isinstance(value, (str, int, float))]
    if loose:
        return f"{request.__name__}.{loose[0]} has no annotation, so it is not a field"
    try:
        msgspec.json.Decoder(request)
    except Exception as error:  # an annotation may be anything
        return f"a record cannot hold the fields of {request.__name__}: {error}"
    return ""


Remapped = Tuple[Tuple[str, str], ...]
"""Canonical and resolved name of each service and topic that is remapped."""

INTERFACES: Dict[str, Interface] = {robot.name: _extended(robot) for robot in (
    d543.INTERFACE, release_1_0.INTERFACE, release_1_1.INTERFACE)}

DEFAULT = INTERFACES[d543.INTERFACE.name]


def interface_of(name: str, robot: str = "", remapped: Remapped = ()) -> Interface:
    """Return the interface of that name; its names are below the namespace ``robot``, if any, or as
    they are ``remapped``."""
    if not robot and not remapped:
        return INTERFACES[name]
    return _renamed(INTERFACES[name], robot and "/" + robot, remapped)


@functools.lru_cache(maxsize=None)
def _renamed(robot: Interface, namespace: str, remapped: Remapped) -> Interface:
    return replace(robot, namespace=namespace, names=dict(remapped))
