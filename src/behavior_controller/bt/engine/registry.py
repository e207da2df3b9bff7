"""One node type: its name, kind, ports, how it ends, and how to make a node of it."""
import enum
import sys
from dataclasses import dataclass
from functools import cached_property
from typing import Callable, Dict, FrozenSet, List, NamedTuple, Optional, Sequence, Tuple, TypeVar

from py_trees.behaviour import Behaviour

from behavior_controller.bt.engine.possible_results import (
    ANY_RESULT, FAILS, OF_A_LEAF, SKIPS, SUCCEEDS, Attributes, Outcome, in_chain, in_rounds,
    of_branches)


Child = TypeVar("Child")


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

    ``type`` is a name of ``values.TYPES`` or a PortType, ``literal`` the type of a literal if that
    differs. ``default`` is text as it would stand in the file, or None for no default.
    ``is_optional``: the node needs no value. ``names`` are names of an instance that replace a
    missing value; all other names have no meaning.
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


@dataclass(frozen=True)
class NodeSpec:
    """One node type, with facts for the checks: how it can end, and which child it ticks next.
    ``factory(name)`` makes a node without anything that runs.

    ``warning`` is shown to the author of a mission that uses it. ``names`` are the allowed names of
    an instance if its name is its argument; see ``argument``. With the defaults, nothing is known
    of a node type, and the linter is silent.
    """

    id: str
    kind: Kind
    factory: Callable[[str], Behaviour]
    ports: Tuple[Port, ...] = ()
    description: str = ""
    warning: str = ""
    names: Tuple[str, ...] = ()
    # how it can end; None: as the fields below say, else in any way
    outcome: Optional[Outcome] = None
    is_instant: bool = False  # it adds no waiting to that of its children
    fewest_children: int = 1  # of a control
    child_counts: Tuple[int, ...] = ()  # with another number of children it fails when it is ticked
    children: str = ""  # what they are, for a message
    # of a control: the end of a child (SUCCEEDS or FAILS) after which it ticks the next one
    advances_on: int = 0
    is_reactive: bool = False  # it begins with its first child at every tick
    # the last child is ticked only when one before it has ended otherwise; then the node fails
    last_child_is_handler: bool = False
    # the second child follows when the first one succeeds, the third one when it fails
    first_child_chooses: bool = False
    # BehaviorTree.CPP refuses children that are written <Action ID="…">
    refuses_explicit: bool = False
    at_most_one: str = ""  # the type of which only one child may be
    rounds: str = ""  # the port with the number of times that the child is run
    repeats_on: int = 0  # the ends of the child after which it is run again
    pause: str = ""  # the port with the milliseconds for which it waits
    limit: str = ""  # the port with the milliseconds after which it halts its child, and fails
    may_fail_at_once: bool = False  # however often it is tried: what it needs may be gone
    is_recovery: bool = False  # it recovers from the failure of a node before it
    is_stub: bool = False  # only a palette has it: it can be checked, not run

    @cached_property
    def port_named(self) -> Dict[str, Port]:
        """The ports by their names."""
        return {port.name: port for port in self.ports}

    @cached_property
    def child_range(self) -> Tuple[int, int]:
        """The fewest and the most children that it can have."""
        ranges = {Kind.CONTROL: (self.fewest_children, sys.maxsize), Kind.DECORATOR: (1, 1)}
        return ranges.get(self.kind, (0, 0))

    @cached_property
    def roles(self) -> FrozenSet[Role]:
        """What its ports hold."""
        return frozenset(port.role for port in self.ports)

    def in_turn(self, children: List[Child]) -> List[Child]:
        """Return the children that a control ticks one after the other: all but a handler."""
        return children[:len(children) - self.last_child_is_handler]

    def ends(self, attributes: Attributes, children: List[int]) -> int:
        """Return how a node can end, given how its children can end."""
        if callable(self.outcome):
            return self.outcome(attributes, children)
        if self.outcome is not None:
            return self.outcome
        if self.advances_on:
            return in_chain(self.in_turn(children), self.advances_on)
        if self.first_child_chooses:
            return of_branches(children)
        if self.repeats_on:
            return in_rounds(children[0], attributes.get(self.rounds, ""), self.repeats_on)
        return ANY_RESULT if children else OF_A_LEAF

    def first(self, count: int) -> Sequence[int]:
        """Return which of its children a node may tick first."""
        return range(count if Role.CHOICE in self.roles else 1)

    def after(self, attributes: Attributes, count: int, index: int,
              end: int) -> Tuple[int, Sequence[int]]:
        """Return how a node can end when its child ``index`` of ``count`` has ended with ``end``,
        and which children it may tick then."""
        if self.advances_on:
            return self._after_in_chain(count, index, end)
        if self.first_child_chooses and index == 0:
            following = {SUCCEEDS: 1, FAILS: 2}.get(end, count)
            if following < count:
                return 0, [following]
            return end & FAILS, ()
        if self.first_child_chooses or Role.CHOICE in self.roles:
            return end, ()
        if count == 1:
            ends = self.ends(attributes, [end])
            if not ends or end & self.repeats_on and attributes.get(self.rounds) != "1":
                return ends, [0]
            return ends, ()
        return ANY_RESULT, range(count)  # it may run any of its children in any order

    def _after_in_chain(self, count: int, index: int, end: int) -> Tuple[int, Sequence[int]]:
        last = count - 1 - self.last_child_is_handler
        if index > last:
            return FAILS, ()
        goes_on = end & (self.advances_on | SKIPS)
        if goes_on and index < last:
            return 0, [index + 1]
        if goes_on:
            return self.advances_on, ()
        if self.last_child_is_handler:
            return 0, [count - 1]
        return end, ()

    @property
    def summary(self) -> str:
        """What it does, and what an instance must be called."""
        if not self.names:
            return self.description
        return f"{self.description} Named {', '.join(self.names)}."


def argument(name: str) -> str:
    """Return the argument that an instance's name means: case and surrounding blanks are ignored.
    """
    return name.strip().lower()
