"""Which blackboard entries a mission reads and writes, and which are the same: by remapping, ``@``
and SubTrees."""
from typing import Counter, Dict, List, Mapping, NamedTuple, Optional, Set, Tuple

from behavior_controller.bt.linter.structure import CONDITIONS, given, is_port_name, remaps_all
from behavior_controller.bt.engine.node import PRE_CONDITIONS
from behavior_controller.bt.engine import ports
from behavior_controller.bt.loader.document import Element
from behavior_controller.bt.script.parser import Script, ScriptSyntaxError, compile_script
from behavior_controller.bt.registry import Direction, Kind, Port, Registry, Role

Key = Tuple[str, str]  # tree, entry; the tree of ``@`` entries is that of the root


class Access(NamedTuple):
    """The first place where an entry is read, or is written; ``at`` is where in the attribute's
    value."""

    key: Key
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


class EntryPlace(NamedTuple):
    """An attribute of an element of a tree, which names the entry ``name``."""

    tree: str
    name: str
    element: Element
    attribute: str


class Flow:
    """What a mission reads and writes. ``is_known`` is False if a script or a name comes from the
    blackboard itself."""

    def __init__(self, main: str):
        self.main = main
        self.reads: Dict[Key, Access] = {}
        self.writes: Dict[Key, Access] = {}  # by nodes
        self.written: Set[Key] = set()
        self.keys: Dict[str, Set[str]] = {}
        self.is_known = True
        self.scripts: List[Use] = []
        self.readers: Dict[Key, Port] = {}  # the first port that reads an entry
        self.created: Set[Key] = set()  # entries that exist without a script, or by := in one
        self.touched: Set[Key] = set()  # entries that not only scripts write
        self.mentions: Counter[Key] = Counter()  # how often a tree names an entry
        # tree -> names that it uses itself; not what its callers give it
        self.used: Dict[str, Set[str]] = {}
        # entries that a tree writes itself, or a tree that it calls; not what its callers give it
        self.own: Set[Key] = set()
        self.texts: List[EntryPlace] = []  # where a text is written to an entry
        self.types: Dict[Key, Set[str]] = {}  # of the ports that refer to an entry
        self._same: Dict[Key, Key] = {}

    def key(self, tree: str, name: str) -> Key:
        """Return the entry called ``name`` in ``tree``."""
        key = (self.main, name[1:]) if name.startswith("@") else (tree, name)
        self.keys.setdefault(key[0], set()).add(key[1])
        return key

    def read(self, tree: str, name: str, element: Element, attribute: str,
             script: Optional[Script] = None) -> None:
        """Note that an entry is read."""
        key = self._used(tree, name)
        at = script.facts.read[name] if script is not None else 0
        self.reads.setdefault(key, Access(key, element, attribute, at, script))

    def needs(self, tree: str) -> List[str]:
        """Return the entries that ``tree`` reads, and that it leaves to its callers to write."""
        names = filter(is_port_name, sorted(self.used.get(tree, ())))
        keys = [(tree, name) for name in names]
        return [key[1] for key in keys if key in self.reads and key not in self.own]

    def write(self, tree: str, name: str, element: Element, attribute: str, at: int = 0,
              creates: bool = True, touches: bool = True) -> None:
        """Note that a node of ``tree`` writes an entry. ``creates``: it may be a new one;
        ``touches``: neither a script nor a text of the file does it."""
        key = self._used(tree, name)
        self.own.add(key)
        self.writes.setdefault(key, Access(key, element, attribute, at))
        self.give(tree, name, creates, touches)

    def give(self, tree: str, name: str, creates: bool = True, touches: bool = True) -> None:
        """As ``write``, by what calls the tree."""
        key = self.key(tree, name)
        self.written.add(key)
        if creates:
            self.created.add(key)
        if touches:
            self.touched.add(key)

    def _used(self, tree: str, name: str) -> Key:
        key = self.key(tree, name)
        self.used.setdefault(key[0], set()).add(key[1])
        self.mentions[key] += 1
        return key

    def remap(self, called: str, inner: str, tree: str, outer: str, call: Element) -> None:
        """Note that ``inner`` of the called tree is ``outer`` of the tree that calls it."""
        key, outer_key = self.key(called, inner), self._used(tree, outer)
        if key in self.own:
            self.own.add(outer_key)
        elif key in self.reads:
            self.reads.setdefault(outer_key, Access(outer_key, call, inner))
        self.join(key, outer_key)

    def join(self, one: Key, other: Key) -> None:
        """Note that two names mean the same entry."""
        self._same[self.first(one)] = self.first(other)

    def first(self, key: Key) -> Key:
        """Return the representative of all names of the same entry."""
        while key in self._same and self._same[key] != key:
            # halves the way for the next time
            self._same[key] = self._same.get(self._same[key], self._same[key])
            key = self._same[key]
        return key

    def never_written(self, given: Set[str]) -> List[Access]:
        """Return the reads of the main tree's entries that nothing writes; ``given`` are those that
        the host provides. What another tree reads, its callers must give it, if they can."""
        written = {self.first(key) for key in self.written}
        written |= {self.first((self.main, name)) for name in given}
        return [read for key, read in self.reads.items() if self.first(key) not in written
                and (key[0] == self.main or not is_port_name(key[1]))]


def flow(trees: Mapping[str, List[Element]], main: str, models: Mapping[str, List[Port]],
         registry: Registry) -> Flow:
    """Return the data flow of ``trees``: the elements of each, called trees before those that call
    them."""
    result = Flow(main)
    for tree, elements in trees.items():
        for element in elements:
            if element.tag == "SubTree":
                _call(result, tree, element, models.get(element.attributes["ID"], []))
            else:
                spec = registry[element.type_id]
                for port in spec.ports:
                    _port(result, tree, element, port, spec.kind is not Kind.ACTION)
            for name in CONDITIONS:
                text = element.attributes.get(name)
                if text is not None:
                    _script(result, tree, element, name, text, name in PRE_CONDITIONS)
    return result


def _port(result: Flow, tree: str, element: Element, port: Port, is_condition: bool) -> None:
    """Note what a port reads and writes; ``is_condition``: the script that it may hold decides
    something."""
    text = element.attributes.get(port.name, port.default)
    if text is None or port.role is Role.NAMES:
        return
    name, is_given = ports.reference(text, port.name), port.name in element.attributes
    if name is None and port.role is Role.WATCHED:
        name = text
    if name is not None:
        if port.direction is not Direction.OUT and (is_given or not port.is_optional):
            result.read(tree, name, element, port.name)
            result.readers.setdefault(result.key(tree, name), port)
        if port.direction is not Direction.IN and port.role is not Role.WRITES:
            result.write(tree, name, element, port.name)
        if is_given:  # when the tree is made
            result.created.add(result.key(tree, name))
        if is_given or port.direction is not Direction.IN:
            result.types.setdefault(result.key(tree, name), set()).add(port.type)
    if port.role in (Role.SCRIPT, Role.WRITES) and name is not None:
        result.is_known = False
    elif port.role is Role.SCRIPT:
        _script(result, tree, element, port.name, text, is_condition)
    elif port.role is Role.WRITES:
        value = element.attributes.get("value", "")
        is_text = ports.reference(value, "value") is None
        result.write(tree, text, element, port.name, touches=not is_text)
        if is_text:
            result.texts.append(EntryPlace(tree, text, element, "value"))


def _script(result: Flow, tree: str, element: Element, attribute: str, text: str,
            is_condition: bool) -> None:
    try:
        script = compile_script(text)
    except ScriptSyntaxError:
        return  # an empty one
    result.scripts.append(Use(tree, element, attribute, script, is_condition))
    for name in sorted(script.facts.read):
        result.read(tree, name, element, attribute, script)
    for name in sorted(script.facts.written):
        given = [assignment for assignment in script.facts.assignments if assignment.name == name]
        creates = any(assignment.sign == ":=" for assignment in given)
        result.write(tree, name, element, attribute, given[0].position, creates, touches=False)


def _call(result: Flow, tree: str, element: Element, model: List[Port]) -> None:
    called = element.attributes["ID"]
    texts = given(element, model)
    for name, text in texts.items():
        outer = None if text is None else ports.subtree_reference(text, name)
        if outer is not None:
            result.remap(called, name, tree, outer, element)
        elif text is not None:
            result.give(called, name)
    for name in sorted(result.keys.get(called, ())) if remaps_all(element) else ():
        if name[0] != "_" and name not in texts:
            result.remap(called, name, tree, name, element)
