"""Which entries a mission reads and writes, and which of them are the same: by remapping, ``@`` and
SubTrees."""
from functools import cached_property
from typing import Dict, Iterator, List, Mapping, NamedTuple, Optional, Set

from behavior_controller.bt.loader.structure import CONDITIONS, given, is_port_name, remaps_all
from behavior_controller.bt.engine import ports
from behavior_controller.bt.engine.node import PRE_CONDITIONS
from behavior_controller.bt.loader.document import Element
from behavior_controller.bt.engine.node_types import Registry
from behavior_controller.bt.engine.registry import Direction, Kind, Port, Role
from behavior_controller.bt.script.parser import Assignment, Operand, Script, compile_script
from behavior_controller.bt.values.values import GENERIC, TEXT, TYPES, ValueFault, real_from_text

NUMERAL = "numeral"
"""The kind of a text that is a number to a comparison, though not to a calculation."""

SOME_TEXT = "some text"
"""The kind of a text that only the running mission knows."""

# what happens to an entry
READ = "read"
WRITTEN = "written"
CREATED = "created"  # without a script, or by := in one
TOUCHED = "touched"  # written, and not only by scripts and texts of the file
UNCREATED = "uncreated"  # a warning says that nothing creates it
SUPPRESSED = "excused"  # a warning is about it: that nothing writes it is no further mistake


class Access(NamedTuple):
    """The first place where an entry is read, or is written; ``at`` is where in the attribute's
    value."""

    element: Element
    attribute: str
    at: int = 0
    script: Optional[Script] = None


class Use(NamedTuple):
    """A script and its place. ``is_condition``: its value decides something."""

    tree: str
    element: Element
    attribute: str
    script: Script
    is_condition: bool


class Value(NamedTuple):
    """A value of known text that is written to an entry: by an assignment of a script, or as a
    text."""

    name: str  # under which it is written
    element: Element
    attribute: str
    kind: str  # text, number, NUMERAL; empty: not known
    word: str
    assignment: Optional[Assignment] = None

    @property
    def is_own(self) -> bool:
        """Whether it is calculated from the entry itself, and so has the kind that this has."""
        return self.assignment is not None and self.assignment.is_own


class Literal(NamedTuple):
    """A text that a SubTree gives its tree for the entry ``name``, by an attribute or a default of
    its model."""

    call: Element
    text: str
    name: "Name"

    @property
    def kind(self) -> str:
        """The kind that a script finds: text, number, NUMERAL."""
        is_text = ports.subtree_literal(self.text)[0] == TEXT
        return _kind_of_text(self.text) if is_text else "number"


class EntryFacts:
    """One entry, under all names that trees have for it."""

    def __init__(self, name: "Name"):
        self.names = [name]
        self.uses: Set[str] = set()  # READ, WRITTEN …
        self.types: Set[str] = set()  # of the ports that refer to it

    @cached_property
    def known_values(self) -> List[Value]:
        """All values that are written to it, in the order of the files; empty if it is written
        otherwise too."""
        return self._known(self.names)

    def instances(self) -> Iterator[List[Value]]:
        """Yield ``known_values`` for each entry of the running mission: a tree that is called twice
        may be given two."""
        inside = {id(inner) for name in self.names for inner in name.inside}
        for name in self.names:
            if id(name) not in inside:
                yield self._known(name.below())

    def _known(self, names: List["Name"]) -> List[Value]:
        values = [value for name in names for value in name.values if TOUCHED not in self.uses]
        return sorted(values, key=lambda value: (value.element.document.file, value.element.number))

    @cached_property
    def kind(self) -> str:
        """The kind of what it holds; empty if that is not known."""
        if TOUCHED in self.uses and self.types == {TEXT}:
            return SOME_TEXT
        kinds = {value.kind for value in self.known_values if not value.is_own}
        return kinds.pop() if len(kinds) == 1 else ""

    @cached_property
    def is_number(self) -> bool:
        """Whether it holds a number, also by the type of the ports that refer to it."""
        types = self.types.difference(GENERIC)
        is_numeric = all(TYPES[name].number is not None for name in types)
        return self.kind == "number" or bool(types) and is_numeric


class Name:
    """What one tree does with an entry, under the name that it has there."""

    def __init__(self, tree: str, name: str):
        self.tree, self.name = tree, name
        self.entry = EntryFacts(self)
        self.mentions = 0  # how often the tree itself names it; not what its callers give it
        self.read: Optional[Access] = None
        self.write: Optional[Access] = None  # by a node
        # the tree writes it itself, or a tree that it calls; not what its callers give it
        self.is_own = False
        self.is_given = False  # a text, by a call
        self.values: List[Value] = []
        self.writers: List[Element] = []  # also calls of trees that write it
        self.inside: List["Name"] = []  # its names in the trees that are called with it

    def below(self) -> List["Name"]:
        """Return the name and all that it has in the trees that are called with it, each once."""
        names, waiting = {id(self): self}, [self]
        for name in waiting:
            for inner in name.inside:
                if id(inner) not in names:
                    names[id(inner)] = inner
                    waiting.append(inner)
        return waiting

    def join(self, other: "Name") -> None:
        """Note that both names mean the same entry."""
        small, large = sorted((self.entry, other.entry), key=lambda entry: len(entry.names))
        if small is not large:
            large.uses |= small.uses
            large.types |= small.types
            large.names += small.names
            for name in small.names:
                name.entry = large


class Flow:
    """What a mission reads and writes. ``trees`` are the elements of each, called trees before
    those that call them; ``models`` the ports of trees that have a model."""

    def __init__(self, trees: Mapping[str, List[Element]], main: str,
                 models: Mapping[str, List[Port]], registry: Registry):
        self._main = main
        # tree -> its names; those with ``@`` are of the main tree
        self.names: Dict[str, Dict[str, Name]] = {tree: {} for tree in [*trees, main]}
        self.scripts: List[Use] = []
        self.literals: List[Literal] = []
        self.is_known = True  # False: a script or a name comes from the blackboard itself
        for tree, elements in trees.items():
            for element in elements:
                if element.tag == "SubTree":
                    self._call(tree, element, models.get(element.attributes["ID"], []))
                else:
                    spec = registry[element.type_id]
                    for port in spec.ports:
                        self._port(tree, element, port, spec.kind is not Kind.ACTION)
                for name in CONDITIONS:
                    text = element.attributes.get(name)
                    if text is not None:
                        self._script(tree, element, name, text, name in PRE_CONDITIONS)

    def name(self, tree: str, name: str) -> Name:
        """Return what ``tree`` does with the entry that is called ``name`` there."""
        if name.startswith("@"):
            tree, name = self._main, name[1:]
        names = self.names[tree]
        if name not in names:
            names[name] = Name(tree, name)
        return names[name]

    def all(self) -> Iterator[Name]:
        """Yield the names of each tree."""
        yield from (name for names in self.names.values() for name in names.values())

    def used(self, tree: str) -> List[str]:
        """Return the names that ``tree`` uses itself."""
        return [name.name for name in self.names[tree].values() if name.mentions]

    def is_named(self, name: str) -> bool:
        """Return whether a tree uses an entry of this name."""
        name = name.lstrip("@")
        return any(name in names and names[name].mentions for names in self.names.values())

    def needs(self, tree: str) -> List[str]:
        """Return the entries that ``tree`` reads, and that it leaves to its callers to write."""
        return [name for name, use in sorted(self.names[tree].items())
                if use.mentions and use.read and not use.is_own and is_port_name(name)]

    def _mention(self, tree: str, name: str) -> Name:
        result = self.name(tree, name)
        result.mentions += 1
        return result

    def _read(self, tree: str, name: str, access: Access) -> None:
        result = self._mention(tree, name)
        result.read = result.read or access
        result.entry.uses.add(READ)

    def _write(self, tree: str, name: str, access: Access, *uses: str) -> Name:
        result = self._mention(tree, name)
        result.is_own = True
        result.write = result.write or access
        result.writers.append(access.element)
        result.entry.uses.update((WRITTEN, *uses))
        return result

    def _port(self, tree: str, element: Element, port: Port, is_condition: bool) -> None:
        """Note what a port reads and writes; ``is_condition``: the script that it may hold decides
        something."""
        text = element.attributes.get(port.name, port.default)
        if text is None or port.role is Role.NAMES and not ports.reference(text, port.name):
            return
        name, is_given = ports.reference(text, port.name), port.name in element.attributes
        place = Access(element, port.name)
        if name is None and port.role is Role.WATCHED:
            name = text
        if name is not None:
            if port.direction is not Direction.OUT and (is_given or not port.is_optional):
                self._read(tree, name, place)
            if port.direction is not Direction.IN and port.role is not Role.WRITES:
                self._write(tree, name, place, CREATED, TOUCHED)
            entry = self.name(tree, name).entry
            if is_given:  # when the tree is made
                entry.uses.add(CREATED)
            if is_given or port.direction is not Direction.IN:
                entry.types.add(port.type)
        if port.role in (Role.SCRIPT, Role.WRITES) and name is not None:
            self.is_known = False
        elif port.role is Role.SCRIPT:
            self._script(tree, element, port.name, text, is_condition)
        elif port.role is Role.WRITES:
            value = element.attributes.get("value", "")
            if ports.reference(value, "value") is None:
                written = self._write(tree, text, place, CREATED)
                written.values.append(Value(text, element, "value", _kind_of_text(value), value))
            else:
                self._write(tree, text, place, CREATED, TOUCHED)

    def _script(self, tree: str, element: Element, attribute: str, text: str,
                is_condition: bool) -> None:
        if not text:
            return
        script = compile_script(text)
        self.scripts.append(Use(tree, element, attribute, script, is_condition))
        for name, at in script.facts.read.items():
            self._read(tree, name, Access(element, attribute, at, script))
        for assignment in script.facts.assignments:
            if not assignment.name:
                continue
            place = Access(element, attribute, assignment.position)
            written = self._write(tree, assignment.name, place)
            if assignment.sign == ":=":
                written.entry.uses.add(CREATED)
            if assignment.sign in (":=", "="):
                kind, word = literal_kind(assignment.value), assignment.value.word
                written.values.append(
                    Value(assignment.name, element, attribute, kind, word, assignment))

    def _call(self, tree: str, call: Element, model: List[Port]) -> None:
        called, texts = call.attributes["ID"], given(call, model)
        for name, text in texts.items():
            outer = ports.subtree_reference(text, name)
            if outer is not None:
                self._remap(called, name, tree, outer, call)
            elif text is not None:
                inner = self.name(called, name)
                inner.entry.uses.update((WRITTEN, CREATED, TOUCHED))
                inner.is_given = True
                self.literals.append(Literal(call, text, inner))
        if remaps_all(call):
            for name in sorted(self.names[called]):
                if name[:1] != "_" and name not in texts:
                    self._remap(called, name, tree, name, call)

    def _remap(self, called: str, inner: str, tree: str, outer: str, call: Element) -> None:
        """Note that ``inner`` of the called tree is ``outer`` of the tree that calls it."""
        name, outer_name = self.name(called, inner), self._mention(tree, outer)
        if name.is_own:
            outer_name.is_own = True
            outer_name.writers.append(call)
        elif name.read:
            outer_name.read = outer_name.read or Access(call, inner)
        name.join(outer_name)
        outer_name.inside.append(name)


def literal_kind(value: Operand) -> str:
    """Return the kind of an operand of a script, if that is a literal."""
    if value.kind == "text" and value.word:
        return _kind_of_text(value.word[1:-1])
    return value.kind if value.kind == "number" else ""


def _kind_of_text(text: str) -> str:
    if text in ("true", "false"):
        return NUMERAL
    try:
        real_from_text(text)
    except ValueFault:
        return "text"
    return NUMERAL
