"""The mission vocabulary in one visible list: D5.4.3 table 4, the documented extensions, and
the nodes of release 1.0 and 1.1.

The nodes of other packages follow them: see ``extensions``.
"""
import functools
import re
from typing import Any, Dict, Iterator, Tuple

from behavior_controller import extensions
from behavior_controller.bt import Direction, NodeSpec, Port, Registry, builtin_specs
from behavior_controller.bt.engine import ports
from behavior_controller.bt.engine.node_types import class_fault
from behavior_controller.bt.loader.structure import STRUCTURE, is_port_name
from behavior_controller.robot.interfaces import INTERFACES
from behavior_controller.leaves import (attention, dialogue, gesture, knowledge, lifecycle,
                                        navigation, recovery, release_1_0, release_1_1, speech)
from behavior_controller.config.node_facts import MissionSpec
from behavior_controller.config.phrases import Speech

from py_trees.behaviour import Behaviour  # after ours, which refuse an older one in plain words

SPECS = (lifecycle.SPECS + attention.SPECS + speech.SPECS + gesture.SPECS + navigation.SPECS +
         knowledge.SPECS + dialogue.SPECS + recovery.SPECS + release_1_0.SPECS +
         release_1_1.SPECS)

_NAME = re.compile(r"[^\W\d][\w.-]*")


@functools.lru_cache(maxsize=None)
def specs() -> Tuple[NodeSpec, ...]:
    """Return the node types of this package and of all others. Raises BrokenExtension."""
    owners: Dict[str, str] = {spec.id: "BehaviorTree.CPP" for spec in builtin_specs()}
    known, builtins = Registry(SPECS), len(owners)
    owners.update((spec.id, extensions.TARGET) for spec in SPECS)
    for extension in extensions.exported("phrases"):
        _add(extension, speech.specs(extension.declared("SPEECHES", Speech)), owners, known)
    for extension in extensions.exported("leaves"):
        _add(extension, extension.declared("SPECS", NodeSpec), owners, known)
    return tuple(known.values())[builtins:]


def _add(extension: extensions.Extension, added: Tuple[NodeSpec, ...], owners: Dict[str, str],
         known: Registry) -> None:
    for spec in added:
        for text, *near in _faults(spec, owners, known):
            raise extension.broken(text, *near, *extensions.quoted(spec.id))
        owners[spec.id] = extension.package


def _faults(spec: NodeSpec, owners: Dict[str, str], known: Registry) -> Iterator[Tuple[str, ...]]:
    """Add ``spec`` to those that are known, and yield each reason why no mission can use it, and
    texts that stand near the mistake. What comes after the first one may not hold."""
    if spec.id in owners:
        yield (f"the node {spec.id} is declared by {owners[spec.id]} already; "
               "give it another name",)
    unserved = [request.__name__ for request in getattr(spec, "calls", ())
                if not any(robot.serves(request) for robot in INTERFACES.values())]
    if unserved:
        yield (f"no service is declared for the request {unserved[0]} of {spec.id}; "
               "declare it in the module that the package exports as interface",)
    made: Any = getattr(spec.factory, "func", spec.factory)
    try:
        known.extend([spec])
    except (AttributeError, TypeError, ValueError) as error:
        is_of_class = str(error) == class_fault(spec, made)  # and not of a field
        yield (str(error), *(["class " + made.__name__] if is_of_class else ()))
    if not callable(made) or isinstance(made, type) and not issubclass(made, Behaviour):
        yield (f"{made} makes no nodes of the type {spec.id}: name a class of nodes",)
    if not _NAME.fullmatch(spec.id) or spec.id in STRUCTURE:
        yield (f"{spec.id!r} cannot be the name of a node, which is that of an XML element",)
    for port in spec.ports:
        fault = _port_fault(port)
        if fault:
            yield (f"the port {port.name!r} of {spec.id}: {fault}", *extensions.quoted(port.name))


def _port_fault(port: Port) -> str:
    """Return why no mission can use a port as it is declared; empty: it can."""
    if not port.name or not is_port_name(port.name):
        return "this cannot be the name of a port"
    if port.default is not None and port.direction is not Direction.OUT:
        wrong = ports.literal_fault(port.default, port, {})
        if wrong:
            return f"its default is not of the type {port.type}: {wrong}"
    return ""


def mission_specs() -> Tuple[MissionSpec, ...]:
    """Return those of ``specs()`` that are mission leaves."""
    return tuple(spec for spec in specs() if isinstance(spec, MissionSpec))


def registry() -> Registry:
    """Return the node types that a mission may use: BehaviorTree.CPP's own and the mission's."""
    return Registry(specs())
