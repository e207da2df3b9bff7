"""The robots that a configuration can choose from, by the name of their interface."""
from typing import Dict, List, Tuple

from behavior_controller import extensions
from behavior_controller.interface import Interface, Service
from behavior_controller.interface import document, release_1_0


def _extended(robot: Interface) -> Interface:
    """Return the robot with what other packages declare for it. Raises BrokenExtension."""
    for extension in extensions.found("interface"):
        try:
            robot = robot.with_more(extension.declared("SERVICES"), extension.declared("TOPICS"))
        except (AttributeError, TypeError, ValueError) as error:
            raise extension.broken("its SERVICES and TOPICS cannot be used: {}".format(error)) from error
    return robot


INTERFACES: Dict[str, Interface] = {each.name: _extended(each) for each in (document.INTERFACE, release_1_0.INTERFACE)}

DEFAULT = INTERFACES[document.INTERFACE.name]


def by_deadline() -> Tuple[Tuple[Service, ...], ...]:
    """Return the services of all robots, those together that share the key of their deadline."""
    found: Dict[str, List[Service]] = {}
    for interface in INTERFACES.values():
        for service in interface.services:
            found.setdefault(service.deadline_key, []).append(service)
    return tuple(map(tuple, found.values()))
