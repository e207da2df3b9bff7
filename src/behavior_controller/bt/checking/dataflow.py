"""Which blackboard entries a mission reads and writes, and which are the same: by remapping, ``@`` and SubTrees."""
from typing import Counter, Dict, List, Mapping, NamedTuple, Optional, Set, Tuple

from behavior_controller.bt.checking.checks import is_port_name
from behavior_controller.bt.engine.node import POST_CONDITIONS, PRE_CONDITIONS
from behavior_controller.bt.language import ports
from behavior_controller.bt.language.document import Element
from behavior_controller.bt.language.script import Script, ScriptSyntaxError, compile_script
from behavior_controller.bt.registry import Direction, Kind, Port, Registry, Role

Key = Tuple[str, str]  # tree, entry; the tree of ``@`` entries is that of the root


class Read(NamedTuple):
    """The first place where an entry is read; ``at`` is where in the attribute's value."""

    key: Key
    element: Element
    attribute: str
    at: int


class Use(NamedTuple):
    """A script and its place. ``is_condition``: its value decides something."""

    tree: str
    element: Element
    attribute: str
    script: Script
    is_condition: bool


class Flow:
    """What a mission reads and writes. ``is_known`` is False if a script or a name comes from the blackboard itself."""

    def __init__(self, main: str):
        self.main = main
        self.reads: Dict[Key, Read] = {}
        self.written: Set[Key] = set()
        self.keys: Dict[str, Set[str]] = {}
        self.is_known = True
        self.scripts: List[Use] = []
        self.readers: Dict[Key, Port] = {}  # the first port that reads an entry
        self.created: Set[Key] = set()  # entries that exist without a script, or by := in one
        self.touched: Set[Key] = set()  # entries that not only scripts write
        self.mentions: Counter[Key] = Counter()  # how often a tree names an entry
        self.used: Dict[str, Set[str]] = {}  # tree -> names that it uses itself; not what its callers give it
        self._same: Dict[Key, Key] = {}
        self._created: Optional[Set[Key]] = None

    def key(self, tree: str, name: str) -> Key:
        """Return the entry called ``name`` in ``tree``."""
        key = (self.main, name[1:]) if name.startswith("@") else (tree, name)
        self.keys.setdefault(key[0], set()).add(key[1])
        return key

    def read(self, tree: str, name: str, element: Element, attribute: str, at: int = 0) -> None:
        """Note that an entry is read."""
        key = self._used(tree, name)
        self.reads.setdefault(key, Read(key, element, attribute, at))

    def write(self, tree: str, name: str) -> None:
        """Note that an entry is written other than by a script."""
        self._used(tree, name)
        self.give(tree, name)

    def give(self, tree: str, name: str) -> None:
        """Note that an entry is written other than by a script or a node of ``tree``: by what calls the tree."""
        key = self.key(tree, name)
        for keys in (self.written, self.created, self.touched):
            keys.add(key)

    def _used(self, tree: str, name: str) -> Key:
        key = self.key(tree, name)
        self.used.setdefault(key[0], set()).add(key[1])
        self.mentions[key] += 1
        return key

    def remap(self, called: str, inner: str, tree: str, outer: str) -> None:
        """Note that ``inner`` of the called tree is ``outer`` of the tree that calls it."""
        self.join(self.key(called, inner), self._used(tree, outer))

    def assign(self, tree: str, name: str, creates: bool) -> None:
        """Note that a script writes an entry."""
        key = self._used(tree, name)
        self.written.add(key)
        if creates:
            self.created.add(key)

    def created_first(self) -> Set[Key]:
        """Return those of ``created`` by their representative names; only after everything is noted."""
        if self._created is None:
            self._created = {self.first(key) for key in self.created}
        return self._created

    def join(self, one: Key, other: Key) -> None:
        """Note that two names mean the same entry."""
        self._same[self.first(one)] = self.first(other)

    def first(self, key: Key) -> Key:
        """Return the representative of all names of the same entry."""
        while key in self._same and self._same[key] != key:
            self._same[key] = self._same.get(self._same[key], self._same[key])  # halves the way for the next time
            key = self._same[key]
        return key

    def never_written(self, given: Set[str]) -> List[Read]:
        """Return the reads of entries that nothing writes; ``given`` are entries of the root that the host provides."""
        written = {self.first(key) for key in self.written}
        written |= {self.first((self.main, name)) for name in given}
        return [read for key, read in self.reads.items() if self.first(key) not in written]


def flow(trees: Mapping[str, List[Element]], main: str, models: Mapping[str, List[Port]], registry: Registry) -> Flow:
    """Return the data flow of ``trees``: the elements of each, called trees before those that call them."""
    result = Flow(main)
    for tree, elements in trees.items():
        for element in elements:
            if element.tag == "SubTree":
                _call(result, tree, element, models.get(element.attributes["ID"], []))
            else:
                spec = registry.find(element.type_id)
                assert spec is not None  # guaranteed by the check
                for port in spec.ports:
                    _port(result, tree, element, port, spec.kind is not Kind.ACTION)
            for name in PRE_CONDITIONS + POST_CONDITIONS:
                if name in element.attributes:
                    _script(result, tree, element, name, element.attributes[name], name in PRE_CONDITIONS)
    return result


def _port(result: Flow, tree: str, element: Element, port: Port, is_condition: bool) -> None:
    """Note what a port reads and writes; ``is_condition``: the script that it may hold decides something."""
    text = element.attributes.get(port.name, port.default)
    if text is None or port.role is Role.NAMES:
        return
    key = ports.reference(text, port.name)
    if key is None and port.role is Role.WATCHED:
        key = text
    if key is not None:
        if port.direction is not Direction.OUT and (port.name in element.attributes or not port.is_optional):
            result.read(tree, key, element, port.name)
            result.readers.setdefault(result.key(tree, key), port)
        if port.direction is not Direction.IN:
            result.write(tree, key)
        if port.name in element.attributes:
            result.created.add(result.key(tree, key))  # when the tree is made
    if port.role in (Role.SCRIPT, Role.WRITES) and key is not None:
        result.is_known = False
    elif port.role is Role.SCRIPT:
        _script(result, tree, element, port.name, text, is_condition)
    elif port.role is Role.WRITES:
        result.write(tree, text)


def _script(result: Flow, tree: str, element: Element, attribute: str, text: str, is_condition: bool) -> None:
    try:
        script = compile_script(text)
    except ScriptSyntaxError:
        return  # an empty one
    result.scripts.append(Use(tree, element, attribute, script, is_condition))
    for name in sorted(script.read):
        result.read(tree, name, element, attribute, script.facts.names[name])
    creates = {assignment.name for assignment in script.facts.assignments if assignment.sign == ":="}
    for name in script.written:
        result.assign(tree, name, name in creates)


def _call(result: Flow, tree: str, element: Element, model: List[Port]) -> None:
    called = element.attributes["ID"]
    given: Dict[str, Optional[str]] = {port.name: port.default for port in model}
    given.update((name, text) for name, text in element.attributes.items() if is_port_name(name))
    for name, text in given.items():
        outer = None if text is None else ports.subtree_reference(text, name)
        if outer is not None:
            result.remap(called, name, tree, outer)
        elif text is not None:
            result.give(called, name)
    if element.attributes.get("_autoremap") in ("1", "true", "True", "TRUE"):
        for name in sorted(result.keys.get(called, ())):
            if name[0] != "_" and name not in given:
                result.remap(called, name, tree, name)
