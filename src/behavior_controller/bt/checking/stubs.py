"""Node types that only a palette declares, as stubs: a mission for another robot can be checked, though not run."""
from functools import partial
from typing import Dict, Iterable, Iterator, List, Sequence, Tuple

from behavior_controller.bt import rules
from behavior_controller.bt.checking.checks import ELSEWHERE, below
from behavior_controller.bt.checking.palette import TYPE_NAMES
from behavior_controller.bt.engine.builtins import AlwaysSuccess
from behavior_controller.bt.engine.controls import Sequence as SequenceNode
from behavior_controller.bt.engine.decorators import ForceSuccess
from behavior_controller.bt.language.document import EXPLICIT, Document, Element
from behavior_controller.bt.language.values import ANY, TYPES
from behavior_controller.bt.registry import Direction, Kind, NodeSpec, Port, Registry
from behavior_controller.errors import Fault

_KINDS = {kind.value: kind for kind in Kind}
_DIRECTIONS = {direction.value: direction for direction in Direction}
_FACTORIES = {Kind.ACTION: AlwaysSuccess, Kind.CONDITION: AlwaysSuccess, Kind.CONTROL: SequenceNode,
              Kind.DECORATOR: ForceSuccess}
_OURS: Dict[str, str] = dict({name: name for name in TYPES}, **{name: ours for ours, name in TYPE_NAMES.items()})


def stubs(documents: Iterable[Document], registry: Registry) -> Tuple[List[NodeSpec], List[Fault]]:
    """Return a node type for each model in ``documents`` that ``registry`` lacks, and what is wrong with models.

    The first model of a name counts. What an older version of BehaviorTree.CPP had is not taken.
    """
    found: Dict[str, NodeSpec] = {}
    faults: List[Fault] = []
    for model in models(documents):
        node_id = model.attributes.get("ID", "")
        if not node_id:
            faults.append(model.fault(rules.ID_MISSING, "<{}> in <TreeNodesModel> lacks the attribute ID".format(
                model.tag), is_warning=True))
        elif registry.find(node_id) is None and node_id not in ELSEWHERE:
            found.setdefault(node_id, _stub(model, node_id))
    return list(found.values()), faults


def models(documents: Iterable[Document]) -> Iterator[Element]:
    """Yield each model of a node type in the palettes of ``documents``."""
    for document in documents:
        for palette in document.root.children:
            if palette.tag == "TreeNodesModel":
                yield from (model for model in palette.children if model.tag in EXPLICIT)


def is_palette(documents: Sequence[Document]) -> bool:
    """Return whether a file holds a palette, and neither trees nor other files."""
    return {child.tag for child in documents[-1].root.children} == {"TreeNodesModel"}


def used_types(documents: Iterable[Document]) -> List[str]:
    """Return the node types that the trees of ``documents`` name, each once."""
    trees = [tree for document in documents for tree in document.root.children if tree.tag == "BehaviorTree"]
    return list(dict.fromkeys(element.type_id for tree in trees for element in below(tree)))


def _stub(model: Element, node_id: str) -> NodeSpec:
    elements = [port for port in model.children if port.tag in _DIRECTIONS and port.attributes.get("name")]
    # the library's own palettes do not tell which ports a node does without; one that does, of a port, means the rest
    tells = any("optional" in port.attributes for port in elements)
    kind = _KINDS[model.tag]
    return NodeSpec(node_id, kind, partial(_FACTORIES[kind]), tuple(_port(port, tells) for port in elements),
                    is_stub=True)


def _port(port: Element, tells: bool) -> Port:
    is_optional = not tells or port.attributes.get("optional") in ("true", "1")
    return Port(port.attributes["name"], _OURS.get(port.attributes.get("type", ANY), ANY), _DIRECTIONS[port.tag],
                port.attributes.get("default"), is_optional=is_optional)
