"""The mission vocabulary in one visible list: D5.4.3 table 4, the documented extensions, and release 1.0's nodes.

The nodes of other packages follow them: see ``extensions``.
"""
import functools
from typing import Dict, List, Tuple

from behavior_controller import extensions
from behavior_controller.bt.engine.builtins import builtin_specs
from behavior_controller.bt.registry import NodeSpec, Registry
from behavior_controller.interface.robots import INTERFACES
from behavior_controller.leaves import (attention, dialogue, gesture, knowledge, lifecycle, navigation, recovery,
                                        release_1_0, speech)
from behavior_controller.mission_spec import MissionSpec

SPECS = (lifecycle.SPECS + attention.SPECS + speech.SPECS + gesture.SPECS + navigation.SPECS + knowledge.SPECS
         + dialogue.SPECS + recovery.SPECS + release_1_0.SPECS)


@functools.lru_cache(maxsize=None)
def specs() -> Tuple[NodeSpec, ...]:
    """Return the node types of this package and of all others. Raises BrokenExtension."""
    owners: Dict[str, str] = {spec.id: "BehaviorTree.CPP" for spec in builtin_specs()}
    found = Registry(builtin_specs() + list(SPECS))
    builtins = len(owners)
    owners.update((spec.id, extensions.TARGET) for spec in SPECS)
    for extension in extensions.found("phrases"):
        _add(extension, speech.specs(extension.declared("SPEECHES")), owners, found)
    for extension in extensions.found("leaves"):
        _add(extension, extension.declared("SPECS"), owners, found)
    return tuple(found.all()[builtins:])


def _add(extension: extensions.Extension, added: Tuple[NodeSpec, ...], owners: Dict[str, str], found: Registry) -> None:
    for spec in added:
        if not isinstance(spec, NodeSpec):
            raise extension.broken("{!r} in SPECS is not a NodeSpec; declare a leaf with leaf_spec".format(spec))
        if spec.id in owners:
            raise extension.broken("the node {} is declared by {} already; give it another name".format(
                spec.id, owners[spec.id]))
        unserved = [request.__name__ for request in getattr(spec, "calls", ())
                    if not any(robot.serves(request) for robot in INTERFACES.values())]
        if unserved:
            raise extension.broken("no service is declared for the request {} of {}; declare it in the module that the "
                                   "package exports as interface".format(unserved[0], spec.id))
        owners[spec.id] = extension.package
        try:
            found.extend([spec])
        except ValueError as error:
            raise extension.broken(str(error)) from error


def mission_specs() -> Tuple[MissionSpec, ...]:
    """Return those of ``specs()`` that are mission leaves."""
    return tuple(spec for spec in specs() if isinstance(spec, MissionSpec))


def registry() -> Registry:
    """Return the node types that a mission may use: BehaviorTree.CPP's own and the mission's."""
    return Registry(builtin_specs() + list(specs()))


def beyond_builtins() -> List[NodeSpec]:
    """Return the node types of ``registry()`` that BehaviorTree.CPP does not have, for Groot2's palette."""
    builtins = {spec.id for spec in builtin_specs()}
    return [spec for spec in registry().all() if spec.id not in builtins]
