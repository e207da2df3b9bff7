"""The robots that a configuration can choose from, by the name of their interface."""
from typing import Dict, List, Tuple

from behavior_controller.interface import Interface, Service
from behavior_controller.interface import document, release_1_0

INTERFACES: Dict[str, Interface] = {each.name: each for each in (document.INTERFACE, release_1_0.INTERFACE)}

DEFAULT = document.INTERFACE


def by_deadline() -> Tuple[Tuple[Service, ...], ...]:
    """Return the services of all robots, those together that share the key of their deadline."""
    found: Dict[str, List[Service]] = {}
    for interface in INTERFACES.values():
        for service in interface.services:
            found.setdefault(service.deadline_key, []).append(service)
    return tuple(map(tuple, found.values()))
