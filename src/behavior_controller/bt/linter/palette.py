"""Palettes (``<TreeNodesModel>``): that of our node types, which Groot2 imports and asks a running
tree for, and those of files, with stubs for the node types that we lack.

BehaviorTree.CPP reads only the SubTree models there, so a palette that has grown stale goes
unnoticed until a node of it is used. With stubs, a mission for another robot can be checked, though
not run.
"""
from functools import partial
from typing import Dict, Iterable, Iterator, List, Sequence, Set, Tuple
from xml.sax.saxutils import escape, quoteattr

from behavior_controller.bt.loader import rules
from behavior_controller.bt.loader.checks import ELSEWHERE
from behavior_controller.bt.loader.structure import PORT_ELEMENTS, Findings
from behavior_controller.bt.engine.builtins import AlwaysSuccess, builtin_specs
from behavior_controller.bt.engine.controls import Sequence as SequenceNode
from behavior_controller.bt.engine.decorators import ForceSuccess
from behavior_controller.bt.loader.document import Document, EXPLICIT, Element
from behavior_controller.bt.values.values import ANY, TYPES
from behavior_controller.bt.engine.node_types import Registry
from behavior_controller.bt.engine.registry import Direction, Kind, NodeSpec, Port
from behavior_controller.errors import Fault
from behavior_controller.text import did_you_mean, without_controls

_FACTORIES = {Kind.ACTION: AlwaysSuccess, Kind.CONDITION: AlwaysSuccess, Kind.CONTROL: SequenceNode,
              Kind.DECORATOR: ForceSuccess}
_BUILT_IN = {spec.id for spec in builtin_specs()}
_TYPES = {name: kind.name for kind in TYPES.values() for name in (kind.name, kind.cpp_name)}


def tree_nodes_model(specs: Iterable[NodeSpec], indent: str = "") -> str:
    """Return the ``<TreeNodesModel>``: each type with its ports, their types, defaults and
    descriptions."""
    lines = ["<TreeNodesModel>"]
    for spec in specs:
        lines.extend("  " + line for line in _model(spec))
    # text of other packages may hold characters that XML forbids
    return "\n".join(indent + without_controls(line) for line in lines + ["</TreeNodesModel>"])


def _model(spec: NodeSpec) -> List[str]:
    kind, inside = spec.kind.value, ["  " + _written_port(port) for port in spec.ports]
    if spec.summary:
        inside += ["  <MetadataFields>", f"    <Metadata description={quoteattr(spec.summary)}/>",
                   "  </MetadataFields>"]
    if not inside:
        return [f"<{kind} ID={quoteattr(spec.id)}/>"]
    return [f"<{kind} ID={quoteattr(spec.id)}>"] + inside + [f"</{kind}>"]


def _written_port(port: Port) -> str:
    default = "" if port.default is None else f" default={quoteattr(port.default)}"
    direction = port.direction.value
    type_name = quoteattr(TYPES[port.type].cpp_name or port.type)
    start = f"<{direction} name={quoteattr(port.name)} type={type_name}{default}"
    return f"{start}>{escape(port.description)}</{direction}>" if port.description else start + "/>"


# --------------------------------------------------------------------------- the palettes of files


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
    return list(dict.fromkeys(
        element.type_id for document in documents for tree in document.root.children
        if tree.tag == "BehaviorTree" for element in tree.below))


# -------------------------------------------------------------------------------------------- stubs


def others(documents: Sequence[Document], registry: Registry) -> Dict[str, Fault]:
    """Return the node types in use that a palette defines with another kind or other ports than
    ``registry`` does, each with the fault that this robot cannot run it.

    The first model of a name counts. Those of BehaviorTree.CPP itself are what they are.
    """
    first: Dict[str, Element] = {}
    for model in models(documents):
        first.setdefault(model.attributes.get("ID", ""), model)
    found = {}
    for node_id in used_types(documents):
        if node_id not in first or node_id not in registry or node_id in _BUILT_IN:
            continue
        wrong = _difference(first[node_id], registry[node_id])
        if wrong:
            text = f"{node_id} is a node of another robot: the palette has {wrong}"
            hint = "of a node of this robot, exportNodeModel prints the model"
            found[node_id] = first[node_id].fault(rules.PALETTE_OTHER_NODE, text, hint, "ID")
    return found


def _difference(model: Element, spec: NodeSpec) -> str:
    """Return in which way a model defines another node type than ``spec``; "" for the same one,
    perhaps with fewer ports, as an older release had it."""
    if model.tag != spec.kind.value:
        return f"it as of kind {model.tag}, and it is of kind {spec.kind.value} here"
    for element in model.children:
        name, type_name = (element.attributes.get(key, "") for key in ("name", "type"))
        port = spec.port_named.get(name)
        if element.tag not in PORT_ELEMENTS:
            continue
        if port is None:
            return f"its port {name}, which it has not here"
        if port.direction.value != element.tag:
            return f"its port {name} as an {element.tag}, and it is an {port.direction.value} here"
        is_other = type_name and _TYPES.get(type_name, port.type) not in (port.type, ANY)
        if port.type != ANY and is_other:
            return f"its port {name} of type {type_name}, and it is of type {port.type} here"
    return ""


def stubs(documents: Sequence[Document], registry: Registry) -> Tuple[List[NodeSpec], List[Fault]]:
    """Return a node type for each model in ``documents`` that ``registry`` lacks or defines
    otherwise, and what is wrong with models: also a name that is nearly one of ``registry``.

    The first model of a name counts. What an older version of BehaviorTree.CPP had is not taken.
    """
    made: Dict[str, NodeSpec] = {}
    theirs = others(documents, registry)
    faults = [fault._replace(is_warning=True, hint="the palette's definition is taken")
              for fault in theirs.values()]
    for model in models(documents):
        node_id = model.attributes.get("ID", "")
        if not node_id:
            text = f"<{model.tag}> in <TreeNodesModel> lacks the attribute ID"
            faults.append(model.fault(rules.ID_MISSING, text, is_warning=True))
        elif node_id in theirs:
            made.setdefault(node_id, _stub(model, node_id))
        elif node_id not in registry and node_id not in ELSEWHERE:
            made.setdefault(node_id, _stub(model, node_id))
            hint = did_you_mean(node_id, registry, likeness=0.93)
            if hint:
                text = f"the palette has an unknown node {node_id}"
                faults.append(model.fault(rules.PALETTE_UNKNOWN_NODE, text, hint, "ID"))
    return list(made.values()), faults


def _stub(model: Element, node_id: str) -> NodeSpec:
    given: Dict[str, Tuple[str, Dict[str, str]]] = {}  # the first of each name
    for port in model.children:
        if port.tag in PORT_ELEMENTS and port.attributes.get("name"):
            given.setdefault(port.attributes["name"], (port.tag, port.attributes))
    # the library's own palettes do not tell which ports a node does without; one that does, of a
    # port, means the rest
    tells = any("optional" in attributes for _, attributes in given.values())
    ports = tuple(Port(name, _TYPES.get(attributes.get("type", ANY), ANY), Direction(tag),
                       attributes.get("default"),
                       is_optional=not tells or attributes.get("optional") in ("true", "1"))
                  for name, (tag, attributes) in given.items())
    kind = Kind(model.tag)
    return NodeSpec(node_id, kind, partial(_FACTORIES[kind]), ports, is_stub=True)


# ------------------------------------------------------------------------------------- stale models


def check_models(documents: Sequence[Document], registry: Registry, findings: Findings) -> None:
    """Warn of each model of a node that does not exist, is of another kind, or has other ports."""
    for model in models(documents):
        node_id = model.attributes.get("ID", "")
        spec = registry.get(node_id)
        if spec is None:
            text = f"the palette has an unknown node {node_id}"
            findings.report(rules.PALETTE_UNKNOWN_NODE, model, text,
                            findings.nearest(node_id, registry), "ID")
        else:
            _check_model(model, spec, findings)


def _check_model(model: Element, spec: NodeSpec, findings: Findings) -> None:
    if model.tag != spec.kind.value:
        text = f"the palette has {spec.id} as of kind {model.tag}; it is of kind {spec.kind.value}"
        findings.report(rules.PALETTE_KIND, model, text)
    known: Set[str] = set()
    for element in model.children:
        name = element.attributes.get("name", "")
        port = spec.port_named.get(name)
        if element.tag not in PORT_ELEMENTS:
            continue
        if port is None:
            text = f"the palette has an unknown port {name} of {spec.id}"
            hint = findings.nearest(name, spec.port_named, "its ports")
            findings.report(rules.PALETTE_PORT, element, text, hint, "name")
        elif name in known:
            text = f"the palette has the port {name} of {spec.id} twice"
            findings.report(rules.PALETTE_PORT, element, text, "the first one counts", "name")
        elif port.direction.value != element.tag:
            direction = f"is an {port.direction.value}, not an {element.tag}"
            text = f"the port {name} of {spec.id} {direction}"
            findings.report(rules.PALETTE_DIRECTION, element, text)
        known.add(name)
