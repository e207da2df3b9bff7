"""The robots that a configuration can choose from, by the name of their interface."""
from typing import Dict, Tuple

from behavior_controller.interface import Interface, Service
from behavior_controller.interface import document

INTERFACES: Dict[str, Interface] = {each.name: each for each in (document.INTERFACE,)}

DEFAULT = document.INTERFACE


def services() -> Tuple[Service, ...]:
    """Return a service for each key of a deadline: those of all robots, the first robot's where they share a key."""
    found: Dict[str, Service] = {}
    for interface in INTERFACES.values():
        for service in interface.services:
            found.setdefault(service.deadline_key, service)
    return tuple(found.values())
