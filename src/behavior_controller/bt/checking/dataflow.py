"""Which blackboard entries a mission reads and writes, and which are one: through remapping, ``@`` and SubTrees."""
from typing import Dict, List, Mapping, NamedTuple, Optional, Set, Tuple

from behavior_controller.bt.engine.node import POST_CONDITIONS, PRE_CONDITIONS
from behavior_controller.bt.language import ports
from behavior_controller.bt.language.document import Element
from behavior_controller.bt.language.script import ScriptSyntaxError, compile_script
from behavior_controller.bt.registry import Direction, Port, Registry, Role

Key = Tuple[str, str]  # tree, entry; the tree of ``@`` entries is that of the root


class Read(NamedTuple):
    """The first place where an entry is read."""

    key: Key
    element: Element
    attribute: str


class Flow:
    """What a mission reads and writes. ``is_known`` is False if a script or a name comes from the blackboard itself."""

    def __init__(self, main: str):
        self.main = main
        self.reads: Dict[Key, Read] = {}
        self.written: Set[Key] = set()
        self.keys: Dict[str, Set[str]] = {}
        self.is_known = True
        self._same: Dict[Key, Key] = {}

    def key(self, tree: str, name: str) -> Key:
        """Return the entry called ``name`` in ``tree``."""
        key = (self.main, name[1:]) if name.startswith("@") else (tree, name)
        self.keys.setdefault(key[0], set()).add(key[1])
        return key

    def read(self, tree: str, name: str, element: Element, attribute: str) -> None:
        """Note that an entry is read."""
        key = self.key(tree, name)
        self.reads.setdefault(key, Read(key, element, attribute))

    def write(self, tree: str, name: str) -> None:
        """Note that an entry is written."""
        self.written.add(self.key(tree, name))

    def join(self, one: Key, other: Key) -> None:
        """Note that two names mean one entry."""
        self._same[self._first(one)] = self._first(other)

    def _first(self, key: Key) -> Key:
        while key in self._same and self._same[key] != key:
            self._same[key] = self._same.get(self._same[key], self._same[key])  # halves the way for the next time
            key = self._same[key]
        return key

    def never_written(self, given: Set[str]) -> List[Read]:
        """Return the reads of what nothing writes; ``given`` are entries of the root that come from elsewhere."""
        written = {self._first(key) for key in self.written}
        written |= {self._first((self.main, name)) for name in given}
        return [read for key, read in self.reads.items() if self._first(key) not in written]


def flow(trees: Mapping[str, List[Element]], main: str, models: Mapping[str, List[Port]], registry: Registry) -> Flow:
    """Return the data flow of ``trees``: the elements of each, called trees before those that call them."""
    result = Flow(main)
    for tree, elements in trees.items():
        for element in elements:
            spec = registry.find(element.type_id)
            if element.tag == "SubTree":
                _call(result, tree, element, models.get(element.attributes.get("ID", ""), []))
            else:
                for port in spec.ports if spec is not None else ():
                    _port(result, tree, element, port)
            for name in PRE_CONDITIONS + POST_CONDITIONS:
                if name in element.attributes:
                    _script(result, tree, element, name, element.attributes[name])
    return result


def _port(result: Flow, tree: str, element: Element, port: Port) -> None:
    text = element.attributes.get(port.name, port.default)
    if text is None or port.role is Role.NAMES:
        return
    key = ports.reference(text, port.name)
    if key is None and port.role is Role.WATCHED:
        key = text
    if key is not None:
        if port.direction is not Direction.OUT and (port.name in element.attributes or not port.is_optional):
            result.read(tree, key, element, port.name)
        if port.direction is not Direction.IN:
            result.write(tree, key)
    if port.role in (Role.SCRIPT, Role.WRITES) and key is not None:
        result.is_known = False
    elif port.role is Role.SCRIPT:
        _script(result, tree, element, port.name, text)
    elif port.role is Role.WRITES:
        result.write(tree, text)


def _script(result: Flow, tree: str, element: Element, attribute: str, text: str) -> None:
    try:
        script = compile_script(text, allow_empty=True)
    except ScriptSyntaxError:
        return
    for name in sorted(script.read):
        result.read(tree, name, element, attribute)
    for name in script.written:
        result.write(tree, name)


def _call(result: Flow, tree: str, element: Element, model: List[Port]) -> None:
    called = element.attributes.get("ID", "")
    given: Dict[str, Optional[str]] = {port.name: port.default for port in model}
    given.update((name, text) for name,
                 text in element.attributes.items() if name[0] != "_" and name not in ("ID", "name"))
    for name, text in given.items():
        outer = None if text in (None, "=") else ports.reference(str(text), name)
        if outer is not None:
            result.join(result.key(called, name), result.key(tree, outer))
        elif text is not None:
            result.write(called, name)
    if element.attributes.get("_autoremap") in ("1", "true", "True", "TRUE"):
        for name in sorted(result.keys.get(called, ())):
            if name[0] != "_" and name not in given:
                result.join(result.key(called, name), result.key(tree, name))
