"""What is known of a mission without running it: how nodes can end, what its entries hold, and
whether that is a text or a number, as far as the scripts and the texts of the file tell."""
from typing import Collection, Dict, Iterator, List, Mapping, NamedTuple, Optional, Set, Tuple

from behavior_controller.bt.linter.dataflow import EntryPlace, Flow, Key, Use, flow
from behavior_controller.bt.linter.structure import Trees
from behavior_controller.bt.possible_results import ANY, BY_NAME, SUCCEEDS, by
from behavior_controller.bt.engine import ports
from behavior_controller.bt.engine.node import DECISIONS
from behavior_controller.bt.loader.document import Element
from behavior_controller.bt.registry import Direction, NodeSpec, Registry
from behavior_controller.bt.script.operators import ScriptError, leading_number
from behavior_controller.bt.script.parser import Assignment, Operand
from behavior_controller.bt.script.values import GENERIC, TEXT, TYPES
from behavior_controller.bt.status import NAMES

NUMERAL = "numeral"
"""The kind of a text that is a number to a comparison, though not to a calculation."""

SOME_TEXT = "some text"
"""The kind of a text that only the running mission knows."""


class MissionFacts:
    """The facts about a mission without errors, and the findings that its warnings are added to."""

    def __init__(self, trees: Trees, given: Collection[str]):
        self.trees = trees
        self.registry = registry = trees.registry
        self.findings = trees.findings
        self.report = trees.findings.report
        self.elements = {tree: trees.trees[tree].below for tree in trees.used}
        self.ends = outcomes(self.elements, registry)
        self.flow: Flow = flow(self.elements, trees.main, trees.models, registry)
        # tree -> entries that it reads, and that it leaves to its callers to write
        self.needs = {tree: self.flow.needs(tree) for tree in self.elements}
        self.written: Dict[str, Set[str]] = {}  # tree -> entries that are written under its names
        for tree, name in self.flow.written:
            self.written.setdefault(tree, set()).add(name)
        self.defaults = Defaults(registry, given)
        self.kinds = Kinds(self.flow, self.defaults.known, registry)
        # a mission for another robot may be given entries by it
        self.is_host_known = not any(self.spec(element).is_stub for _, element in self.walk())
        self.excused: Set[Key] = set()  # entries that a warning is about

    def excuse(self, tree: str, name: str) -> None:
        """Note that a warning is about an entry: that nothing writes it is no further mistake."""
        self.excused.add(self.flow.first(self.flow.key(tree, name)))

    def walk(self) -> Iterator[Tuple[str, Element]]:
        """Yield each element of the trees in use, with its tree; called trees come first."""
        for tree, elements in self.elements.items():
            for element in elements:
                yield tree, element

    def inside(self, element: Element) -> Iterator[Element]:
        """Yield an element and all below it, also of the trees that it calls, each once."""
        waiting, called = [element, *element.below], set()
        for inner in waiting:
            yield inner
            tree = inner.attributes.get("ID", "") if inner.tag == "SubTree" else ""
            if tree and tree not in called:
                called.add(tree)
                waiting += self.elements[tree]

    def spec(self, element: Element) -> NodeSpec:
        """Return the node type of an element."""
        return self.registry[element.type_id]


def outcomes(trees: Mapping[str, List[Element]], registry: Registry) -> Dict[int, int]:
    """Return how each element can end, by ``id(element)``.

    ``trees`` holds the elements of each tree in document order, called trees before those that call
    them.
    """
    known: Dict[int, int] = {}
    ends_of_tree: Dict[str, int] = {}
    for tree_id, elements in trees.items():
        for element in reversed(elements):  # so that children come before their parent
            known[id(element)] = _ends(element, known, ends_of_tree, registry)
        ends_of_tree[tree_id] = known[id(elements[0])]
    return known


def _ends(element: Element, known: Dict[int, int], trees: Dict[str, int],
          registry: Registry) -> int:
    children = [known[id(child)] for child in element.children]
    if element.tag == "SubTree":
        result = trees.get(element.attributes.get("ID", ""), ANY)
    else:
        spec = registry.find(element.type_id)
        result = by(spec.outcome if spec else None, element.attributes, children)
    for attribute, status in DECISIONS.items():
        if attribute in element.attributes:
            result |= BY_NAME[NAMES[status]]
    return result


class Defaults:
    """The entries of the whole mission: those that ports have by default, and those that the host
    provides."""

    def __init__(self, registry: Registry, given: Collection[str]):
        needed: Set[str] = set()
        optional: Set[str] = set()
        self._writers: Dict[str, List[str]] = {}
        for spec in registry.all():
            for port in spec.ports:
                key = None if port.default is None else ports.reference(port.default, port.name)
                if key is None or key[:1] != "@":
                    continue
                if port.direction is Direction.OUT:
                    self._writers.setdefault(key[1:], []).append(spec.id)
                else:
                    (optional if port.is_optional else needed).add(key[1:])
        # what every reader does without may be missing in a script too
        self.given = set(given) | (optional - needed)
        self.known = self.given | needed | set(self._writers)

    def written_by(self, name: str) -> str:
        """Return which nodes write an entry of the whole mission; "" if none does."""
        writers = self._writers.get(name, [])
        names = " or ".join(filter(None, [", ".join(writers[:-1]), *writers[-1:]]))
        return f"{names} writes it" if writers else ""


# -------------------------------------------------------------------------------- texts and numbers


class Write(NamedTuple):
    """A value of known text that is written to an entry: by a script (``use`` and ``assignment``),
    or as a text."""

    key: Key
    element: Element
    kind: str  # text, number, NUMERAL; empty: not known
    word: str
    use: Optional[Use] = None
    assignment: Optional[Assignment] = None

    @property
    def is_own(self) -> bool:
        """Whether it is calculated from the entry itself, and so has the kind that this has."""
        return self.assignment is not None and self.assignment.is_own

    def place(self) -> Tuple[str, int]:
        """Return where it is in the files, to order it."""
        return self.element.document.file, self.element.number


class Kinds:
    """The kinds of entries that only scripts and texts write. ``given`` are entries that come from
    elsewhere, and enums."""

    def __init__(self, flow: Flow, given: Collection[str], registry: Registry):
        self._flow = flow
        self._registry = registry
        self._touched = {flow.first(key) for key in flow.touched}
        self._types = {flow.first(key): types for key, types in flow.types.items()}
        self._writes: Dict[Key, List[Write]] = {}
        for write in sorted(self._all(), key=Write.place):
            key = flow.first(write.key)
            if key not in self._touched and key[1] not in given:
                self._writes.setdefault(key, []).append(write)

    def _all(self) -> Iterator[Write]:
        for use in self._flow.scripts:
            for assignment in use.script.facts.assignments:
                if assignment.sign in (":=", "="):
                    key, value = self._flow.key(use.tree, assignment.name), assignment.value
                    kind = literal_kind(value)
                    yield Write(key, use.element, kind, value.word, use, assignment)
        for tree, name, element, attribute in self._flow.texts:
            text = element.attributes.get(attribute, "")
            yield Write(self._flow.key(tree, name), element, _kind_of_text(text), text)

    def writes(self, tree: str, name: str) -> List[Write]:
        """Return the values that are written to an entry, in the order of the files; empty if it is
        written otherwise too."""
        return self._writes.get(self._flow.first(self._flow.key(tree, name)), [])

    def all(self) -> Iterator[List[Write]]:
        """Yield the values of each entry."""
        return iter(self._writes.values())

    def of(self, tree: str, name: str) -> str:
        """Return the kind of what an entry holds."""
        key = self._flow.first(self._flow.key(tree, name))
        if key in self._touched and self._types.get(key) == {TEXT}:
            return SOME_TEXT
        kinds = {write.kind for write in self.writes(tree, name) if not write.is_own}
        return kinds.pop() if len(kinds) == 1 else ""

    def is_number(self, tree: str, name: str) -> bool:
        """Return whether an entry holds a number, also by the type of the ports that refer to it.
        """
        types = self._types.get(self._flow.first(self._flow.key(tree, name)), set()) - set(GENERIC)
        numeric = {type_name for type_name in types if TYPES[type_name].number is not None}
        return self.of(tree, name) == "number" or bool(types) and types == numeric

    def emptied(self, place: EntryPlace) -> bool:
        """Return whether a text is written to an entry that a script before it has made, which
        knows no conversion."""
        types = self._types.get(self._flow.first(self._flow.key(place.tree, place.name)), set())
        return types <= set(GENERIC) and any(
            write.assignment is not None and write.assignment.sign == ":="
            and self._is_before(write.element, place.element)
            for write in self.writes(place.tree, place.name))

    def _is_before(self, one: Element, other: Element) -> bool:
        """Return whether a Sequence ticks ``one`` before ``other``."""
        if one.document is not other.document or one.last >= other.number:
            return False
        inner: Optional[Element] = one.document.root
        while inner is not None:
            around = inner
            inner = next((child for child in around.children if child.number <= one.number
                          and other.number <= child.last), None)
        spec = self._registry.find(around.type_id)
        return spec is not None and spec.next_after == SUCCEEDS


def literal_kind(value: Operand) -> str:
    """Return the kind of an operand of a script, if that is a literal."""
    if value.kind == "text":
        return _kind_of_text(value.word[1:-1]) if value.word else ""
    return value.kind if value.kind == "number" else ""


def _kind_of_text(text: str) -> str:
    if text in ("true", "false"):
        return NUMERAL
    try:
        leading_number(text)
    except ScriptError:
        return "text"
    return NUMERAL
