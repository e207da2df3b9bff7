"""The node types that a mission may use: their names, kinds, ports, and how to make one."""
import difflib
import enum
from dataclasses import dataclass
from typing import Callable, Dict, Iterable, List, NamedTuple, Optional, Tuple

from py_trees.behaviour import Behaviour

from behavior_controller.bt.ends import Outcome
from behavior_controller.bt.language.values import TYPES, PortType


class Kind(enum.Enum):
    """The kind of a node type, in Groot2's terms."""

    ACTION = "Action"
    CONDITION = "Condition"
    CONTROL = "Control"
    DECORATOR = "Decorator"
    SUBTREE = "SubTree"


class Direction(enum.Enum):
    """The direction of a port, in Groot2's terms."""

    IN = "input_port"
    OUT = "output_port"
    INOUT = "inout_port"


class Role(enum.Enum):
    """What the text of a port is."""

    DATA = "a value, or {entry}"
    SCRIPT = "a script"
    WATCHED = "an entry, with or without braces"
    WRITES = "the name of an entry that is written"
    NAMES = "the name of an entry whose value does not matter"
    CHILDREN = "a number of children"
    CHOICE = "what is compared with the cases"
    CASE = "a text that chooses a child"


class Port(NamedTuple):
    """A typed attribute of a node type.

    ``type`` is a name of ``values.TYPES`` or a PortType, ``literal`` the type of a literal if that differs. ``default``
    is text as it would stand in the file, or None for no default. ``is_optional``: the node needs no value. ``names``
    are names of an instance that replace a missing value; all other names have no meaning. ``if_zero`` describes the
    effect of 0 for a number of children.
    """

    name: str
    type: str = "any"
    direction: Direction = Direction.IN
    default: Optional[str] = None
    description: str = ""
    role: Role = Role.DATA
    is_optional: bool = False
    literal: str = ""
    names: Tuple[str, ...] = ()
    if_zero: str = ""


@dataclass(frozen=True)
class NodeSpec:
    """One node type, with facts for the checks. ``factory(name)`` makes a node without anything that runs.

    ``warning`` is shown to the author of a mission that uses it. ``names`` are the allowed names of an instance if its
    name is its argument; see ``argument``. With the defaults, nothing is known of a node type, and the linter is silent.
    """

    id: str
    kind: Kind
    factory: Callable[[str], Behaviour]
    ports: Tuple[Port, ...] = ()
    description: str = ""
    warning: str = ""
    names: Tuple[str, ...] = ()
    outcome: Optional[Outcome] = None  # how it can end; None: in any way
    is_instant: bool = False  # it adds no waiting to that of its children
    fewest_children: int = 1  # of a control
    child_counts: Tuple[int, ...] = ()  # with another number of children it fails when it is ticked
    children: str = ""  # what they are, for a message
    next_after: int = 0  # the end of a child (SUCCEEDS or FAILS) after which the next child is ticked
    last_is_apart: bool = False  # the last child is ticked for other reasons
    refuses_explicit: bool = False  # BehaviorTree.CPP refuses children that are written <Action ID="…">
    at_most_one: str = ""  # the type of which only one child may be
    rounds: str = ""  # the port with the number of times that the child is run
    repeats_on: int = 0  # the end of the child (SUCCEEDS or FAILS) after which it is run again
    is_recovery: bool = False  # it recovers from the failure of a node before it
    is_stub: bool = False  # only a palette has it: it can be checked, not run

    @property
    def summary(self) -> str:
        """What it does, and what an instance must be called."""
        return self.description + (" Named {}.".format(", ".join(self.names)) if self.names else "")


def argument(name: str) -> str:
    """Return the argument that an instance's name means: case and surrounding blanks are ignored."""
    return name.strip().lower()


class Registry:
    """Node types by name. A duplicate name and a port of an unknown type raise ``ValueError``."""

    def __init__(self, specs: Iterable[NodeSpec] = ()):
        self._specs: Dict[str, NodeSpec] = {}
        self._types: Dict[str, PortType] = {}
        self.extend(specs)

    def extend(self, specs: Iterable[NodeSpec]) -> None:
        """Add each of ``specs``."""
        for spec in specs:
            if spec.id in self._specs:
                raise ValueError("the node type {} is registered twice".format(spec.id))
            for port in spec.ports:
                self._check_type(port, spec)
            self._specs[spec.id] = spec

    def _check_type(self, port: Port, spec: NodeSpec) -> None:
        if isinstance(port.type, PortType):
            if self._types.setdefault(port.type, port.type) is not port.type:
                raise ValueError("the type {} of the port {} of {} is not the one of that name that other ports have; "
                                 "make one PortType and use it for all".format(port.type, port.name, spec.id))
        elif port.type not in TYPES:
            hint = did_you_mean(port.type, list(TYPES) + list(self._types)) or "there are: " + " ".join(TYPES)
            raise ValueError("the port {} of {} has the unknown type {} ({}; a type of your own is a PortType)".format(
                port.name, spec.id, port.type, hint))

    def find(self, node_id: str) -> Optional[NodeSpec]:
        """Return the node type of that name, or None."""
        return self._specs.get(node_id)

    def all(self) -> List[NodeSpec]:
        """Return every node type, in the order of registration."""
        return list(self._specs.values())


def did_you_mean(word: str, known: Iterable[str], likeness: float = 0.6) -> str:
    """Return ``did you mean X?`` for the nearest of ``known`` (case is ignored), or an empty text.

    ``likeness`` is the required similarity, from 0 to 1 (equal).
    """
    by_lower = {name.lower(): name for name in known}
    near = difflib.get_close_matches(word.lower(), list(by_lower), cutoff=likeness)
    return "did you mean {}?".format(by_lower[near[0]]) if near else ""
