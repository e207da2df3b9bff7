"""A mission's own palette (TreeNodesModel) against the node types that there are: what Groot2 was told and is not so.

BehaviorTree.CPP reads only the SubTree models there and ignores the rest, so a palette that has grown stale goes
unnoticed until a node of it is used.
"""
from typing import Dict, List, Sequence

from behavior_controller.bt import rules
from behavior_controller.bt.language.document import EXPLICIT, Document, Element
from behavior_controller.bt.registry import Direction, NodeSpec, Port, Registry, did_you_mean
from behavior_controller.errors import Fault

_DIRECTIONS = {direction.value: direction for direction in Direction}
_MOST_WARNINGS = 100


def stale_models(documents: Sequence[Document], registry: Registry) -> List[Fault]:
    """Return a warning for each model of a node that is not there, is of another kind, or has other ports."""
    found: List[Fault] = []
    for document in documents:
        for models in document.root.children:
            for model in models.children if models.tag == "TreeNodesModel" else ():
                if model.tag in EXPLICIT and len(found) < _MOST_WARNINGS:
                    found.extend(_compared(model, registry))
    return found


def _compared(model: Element, registry: Registry) -> List[Fault]:
    node_id = model.attributes.get("ID", "")
    spec = registry.find(node_id)
    if spec is None:
        hint = did_you_mean(node_id, [known.id for known in registry.all()])
        return [model.fault(rules.PALETTE_UNKNOWN_NODE, "the palette has an unknown node {}".format(node_id),
                            hint, "ID")]
    found = []
    if model.tag != spec.kind.value:
        found.append(model.fault(rules.PALETTE_KIND, "the palette has {} as {} {}; it is {} {}".format(
            node_id, _article(model.tag), model.tag, _article(spec.kind.value), spec.kind.value)))
    return found + _compared_ports(model, spec)


def _article(word: str) -> str:
    return "an" if word[0] in "AEIOU" else "a"


def _compared_ports(model: Element, spec: NodeSpec) -> List[Fault]:
    known: Dict[str, Port] = {port.name: port for port in spec.ports}
    found = []
    for element in model.children:
        if element.tag not in _DIRECTIONS:
            continue
        name = element.attributes.get("name", "")
        port = known.get(name)
        if port is None:
            found.append(element.fault(
                rules.PALETTE_PORT, "the palette has an unknown port {} of {}".format(name, spec.id),
                did_you_mean(name, known) or "its ports: {}".format(", ".join(known) or "none"), "name"))
        elif port.direction is not _DIRECTIONS[element.tag]:
            found.append(element.fault(rules.PALETTE_DIRECTION, "the port {} of {} is an {}, not an {}".format(
                name, spec.id, port.direction.value, element.tag)))
    return found
