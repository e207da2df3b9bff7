"""Node types as a ``<TreeNodesModel>``: the palette that Groot2 imports, and the model it asks a
running tree for."""
from typing import Iterable, List
from xml.sax.saxutils import escape, quoteattr

from behavior_controller.bt.registry import NodeSpec, Port
from behavior_controller.text import without_controls

TYPE_NAMES = {"string": "std::string", "uint": "unsigned int", "int8": "signed char",
              "uint8": "unsigned char", "int64": "long", "uint64": "unsigned long",
              "any": "BT::AnyTypeAllowed", "Any": "BT::Any", "NodeStatus": "BT::NodeStatus",
              "vec_int": "std::vector<int>", "vec_double": "std::vector<double>",
              "vec_string": "std::vector<std::string>", "vec_bool": "std::vector<bool>"}
"""Our names of types, and those that BehaviorTree.CPP writes."""


def tree_nodes_model(specs: Iterable[NodeSpec], indent: str = "") -> str:
    """Return the ``<TreeNodesModel>``: each type with its ports, their types, defaults and
    descriptions."""
    lines = ["<TreeNodesModel>"]
    for spec in specs:
        lines.extend("  " + line for line in _model(spec))
    # text of other packages may hold characters that XML forbids
    return "\n".join(indent + without_controls(line) for line in lines + ["</TreeNodesModel>"])


def _model(spec: NodeSpec) -> List[str]:
    kind = spec.kind.value
    inside = ["  " + _port(port) for port in spec.ports]
    if spec.summary:
        inside += ["  <MetadataFields>", f"    <Metadata description={quoteattr(spec.summary)}/>",
                   "  </MetadataFields>"]
    if not inside:
        return [f"<{kind} ID={quoteattr(spec.id)}/>"]
    return [f"<{kind} ID={quoteattr(spec.id)}>"] + inside + [f"</{kind}>"]


def _port(port: Port) -> str:
    default = "" if port.default is None else f" default={quoteattr(port.default)}"
    direction = port.direction.value
    type_name = quoteattr(TYPE_NAMES.get(port.type, port.type))
    start = f"<{direction} name={quoteattr(port.name)} type={type_name}{default}"
    return f"{start}>{escape(port.description)}</{direction}>" if port.description else start + "/>"
