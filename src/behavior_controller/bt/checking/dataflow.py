"""Which blackboard entries a mission reads and writes, and which are one: through remapping, ``@`` and SubTrees."""
from typing import Dict, List, Mapping, NamedTuple, Optional, Set, Tuple

from behavior_controller.bt.engine.node import POST_CONDITIONS, PRE_CONDITIONS
from behavior_controller.bt.language import ports
from behavior_controller.bt.language.document import Element
from behavior_controller.bt.language.script import ScriptSyntaxError, compile_script
from behavior_controller.bt.registry import Direction, Port, Registry

_SCRIPTS = {("Script", "code"), ("ScriptCondition", "code"), ("Precondition", "if")}
_NAMES = {("SetBlackboard", "output_key")}  # ports whose text is the name of an entry to write
_NO_DATA = {("UnsetBlackboard", "key")}

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
    types = {spec.id: {port.name: port for port in spec.ports} for spec in registry.all()}
    for tree, elements in trees.items():
        for element in elements:
            if element.tag == "SubTree":
                _call(result, tree, element, models.get(element.attributes.get("ID", ""), []))
            else:
                _node(result, tree, element, types.get(element.type_id, {}))
            for name in PRE_CONDITIONS + POST_CONDITIONS:
                if name in element.attributes:
                    _script(result, tree, element, name)
    return result


def _node(result: Flow, tree: str, element: Element, declared: Mapping[str, Port]) -> None:
    for name, port in declared.items():
        text = element.attributes.get(name, port.default)
        if text is None or (element.type_id, name) in _NO_DATA:
            continue
        key = ports.reference(text, name)
        if key is None and port.type == "Any":
            key = text  # the entry to watch may be written without braces
        if key is not None:
            if port.direction is not Direction.OUT:
                result.read(tree, key, element, name)
            if port.direction is not Direction.IN:
                result.write(tree, key)
        if (element.type_id, name) in _NAMES | _SCRIPTS:
            if key is not None:
                result.is_known = False
            elif (element.type_id, name) in _SCRIPTS:
                _script(result, tree, element, name)
            else:
                result.write(tree, text)


def _script(result: Flow, tree: str, element: Element, attribute: str) -> None:
    try:
        script = compile_script(element.attributes[attribute], allow_empty=True)
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
