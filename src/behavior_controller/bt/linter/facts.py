"""What is known of a mission without running it: how nodes can end, and what its entries hold."""
from typing import Collection, Dict, Iterator, List, Mapping, Set, Tuple

from behavior_controller.bt.linter.dataflow import Flow, Key, flow
from behavior_controller.bt.linter.kinds import Kinds
from behavior_controller.bt.linter.structure import Trees
from behavior_controller.bt.possible_results import ANY, FAILS, SKIPS, SUCCEEDS, by
from behavior_controller.bt.engine import ports
from behavior_controller.bt.loader.document import Element
from behavior_controller.bt.registry import Direction, NodeSpec, Registry

_CONDITIONS = {"_failureIf": FAILS, "_successIf": SUCCEEDS, "_skipIf": SKIPS, "_while": SKIPS}


class MissionFacts:
    """The facts about a mission without errors, and the findings that its warnings are added to."""

    def __init__(self, trees: Trees, registry: Registry, given: Collection[str]):
        self.trees = trees
        self.registry = registry
        self.findings = trees.findings
        self.warn = trees.findings.warn
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
        spec = self.registry.find(element.type_id)
        assert spec is not None  # guaranteed by the check
        return spec


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
    for attribute, end in _CONDITIONS.items():
        if attribute in element.attributes:
            result |= end
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
        if not writers:
            return ""
        return f"{' or '.join(filter(None, [', '.join(writers[:-1]), writers[-1]]))} writes it"
