"""The node types that a mission may use: their names, kinds, ports, and how to make one."""
import difflib
import enum
from typing import Callable, Dict, Iterable, List, NamedTuple, Optional, Tuple

from py_trees.behaviour import Behaviour


class Kind(enum.Enum):
    """What a node type is, as Groot2 names it."""

    ACTION = "Action"
    CONDITION = "Condition"
    CONTROL = "Control"
    DECORATOR = "Decorator"
    SUBTREE = "SubTree"


class Direction(enum.Enum):
    """Which way data flows through a port, as Groot2 names it."""

    IN = "input_port"
    OUT = "output_port"
    INOUT = "inout_port"


class Port(NamedTuple):
    """A typed attribute of a node type.

    ``type`` is a name of ``ports.TYPES``; ``default`` is text as it would stand in the file, or None for no default.
    """

    name: str
    type: str = "any"
    direction: Direction = Direction.IN
    default: Optional[str] = None
    description: str = ""


class NodeSpec(NamedTuple):
    """One node type. ``factory(name)`` makes a node and needs nothing running; ``warning`` is told to who uses it.

    ``names`` are names of an instance that choose what it does; all others mean the same as none.
    """

    id: str
    kind: Kind
    factory: Callable[[str], Behaviour]
    ports: Tuple[Port, ...] = ()
    description: str = ""
    warning: str = ""
    names: Tuple[str, ...] = ()


class Registry:
    """Node types by name. A name is taken once: adding it again raises ``ValueError``."""

    def __init__(self, specs: Iterable[NodeSpec] = ()):
        self._specs: Dict[str, NodeSpec] = {}
        self.extend(specs)

    def extend(self, specs: Iterable[NodeSpec]) -> None:
        """Add each of ``specs``."""
        for spec in specs:
            if spec.id in self._specs:
                raise ValueError("the node type {} is registered twice".format(spec.id))
            self._specs[spec.id] = spec

    def find(self, node_id: str) -> Optional[NodeSpec]:
        """Return the node type of that name, or None."""
        return self._specs.get(node_id)

    def all(self) -> List[NodeSpec]:
        """Return every node type, in the order of registration."""
        return list(self._specs.values())


def did_you_mean(word: str, known: Iterable[str]) -> str:
    """Return ``did you mean X?`` for the nearest of ``known`` (case is no difference), or an empty text."""
    by_lower = {name.lower(): name for name in known}
    near = difflib.get_close_matches(word.lower(), list(by_lower), n=1, cutoff=0.6)
    return "did you mean {}?".format(by_lower[near[0]]) if near else ""
