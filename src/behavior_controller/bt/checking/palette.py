"""Node types as a ``<TreeNodesModel>``: the palette that Groot2 imports, and the model it asks a running tree for."""
from typing import Iterable, List
from xml.sax.saxutils import escape, quoteattr

from behavior_controller.bt.registry import NodeSpec, Port

# names of types as BehaviorTree.CPP writes them
_TYPES = {
    "string": "std::string", "uint": "unsigned int", "int8": "signed char", "uint8": "unsigned char", "int64": "long",
    "uint64": "unsigned long", "any": "BT::AnyTypeAllowed", "Any": "BT::Any", "NodeStatus": "BT::NodeStatus",
    "vec_int": "std::vector<int>", "vec_double": "std::vector<double>", "vec_string": "std::vector<std::string>",
    "vec_bool": "std::vector<bool>",
}


def tree_nodes_model(specs: Iterable[NodeSpec], indent: str = "") -> str:
    """Return the ``<TreeNodesModel>``: each type with its ports, their types, defaults and descriptions."""
    lines = ["<TreeNodesModel>"]
    for spec in specs:
        lines.extend("  " + line for line in _model(spec))
    return "\n".join(indent + line for line in lines + ["</TreeNodesModel>"])


def _model(spec: NodeSpec) -> List[str]:
    kind = spec.kind.value
    inside = ["  " + _port(port) for port in spec.ports]
    if spec.summary:
        inside += ["  <MetadataFields>", "    <Metadata description={}/>".format(quoteattr(spec.summary)),
                   "  </MetadataFields>"]
    if not inside:
        return ["<{} ID={}/>".format(kind, quoteattr(spec.id))]
    return ["<{} ID={}>".format(kind, quoteattr(spec.id))] + inside + ["</{}>".format(kind)]


def _port(port: Port) -> str:
    default = "" if port.default is None else " default={}".format(quoteattr(port.default))
    direction = port.direction.value
    start = "<{} name={} type={}{}".format(direction, quoteattr(port.name),
                                           quoteattr(_TYPES.get(port.type, port.type)), default)
    return "{}>{}</{}>".format(start, escape(port.description), direction) if port.description else start + "/>"
