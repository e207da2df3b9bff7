"""What is known of a mission without running it: how nodes can end, and what its entries hold."""
from typing import Collection, Dict, Iterator, List, Mapping, Set, Tuple

from behavior_controller.bt.linter.dataflow import EXCUSED, TOUCHED, WRITTEN, Flow
from behavior_controller.bt.linter.structure import Trees
from behavior_controller.bt.possible_results import BY_NAME, by
from behavior_controller.bt.engine import ports
from behavior_controller.bt.engine.node import DECISIONS
from behavior_controller.bt.loader.document import Element
from behavior_controller.bt.registry import Direction, NodeSpec, Port, Registry
from behavior_controller.bt.status import NAMES


class MissionFacts:
    """The facts about a mission without errors, and the findings that its warnings are added to."""

    def __init__(self, trees: Trees):
        self.trees = trees
        self.registry = registry = trees.registry
        self.findings = trees.findings
        self.report = trees.findings.report
        self.elements = {tree: trees.trees[tree].below for tree in trees.used}
        self.ends = outcomes(self.elements, registry)
        self.flow = Flow(self.elements, trees.main, trees.models, registry)
        self.needs = {tree: self.flow.needs(tree) for tree in self.elements}
        self.defaults = Defaults(registry)
        for name in self.defaults.known:
            self.flow.name(trees.main, name).entry.uses.add(TOUCHED)
            if self.defaults.is_optional(name):
                self.excuse(trees.main, name)
        self.written: Dict[str, Set[str]] = {tree: set() for tree in self.elements}
        for use in self.flow.all():
            if WRITTEN in use.entry.uses:
                self.written[use.tree].add(use.name)
        # a mission for another robot may be given entries by it
        self.is_host_known = not any(self.spec(element).is_stub for _, element in self.walk())

    def excuse(self, tree: str, name: str) -> None:
        """Note that a warning is about an entry, or that every reader of it does without."""
        self.flow.name(tree, name).entry.uses.add(EXCUSED)

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
    ends: Dict[int, int] = {}
    ends_of_tree: Dict[str, int] = {}
    for tree_id, elements in trees.items():
        for element in reversed(elements):  # so that children come before their parent
            if element.tag == "SubTree":
                result = ends_of_tree[element.attributes["ID"]]
            else:
                children = [ends[id(child)] for child in element.children]
                result = by(registry[element.type_id].outcome, element.attributes, children)
            for attribute, status in DECISIONS.items():
                if attribute in element.attributes:
                    result |= BY_NAME[NAMES[status]]
            ends[id(element)] = result
        ends_of_tree[tree_id] = ends[id(elements[0])]
    return ends


class Defaults:
    """The entries of the whole mission that ports have by default."""

    def __init__(self, registry: Registry):
        self._users: Dict[str, List[Tuple[NodeSpec, Port]]] = {}
        for spec in registry.all():
            for port in spec.ports:
                key = ports.reference(port.default or "", port.name)
                if key is not None and key.startswith("@"):
                    self._users.setdefault(key[1:], []).append((spec, port))

    @property
    def known(self) -> Collection[str]:
        """Their names."""
        return self._users.keys()

    def is_optional(self, name: str) -> bool:
        """Return whether an entry has readers, and each does without: a script may do so too."""
        readers = [port.is_optional for _, port in self._users[name]
                   if port.direction is not Direction.OUT]
        return bool(readers) and all(readers)

    def written_by(self, name: str) -> str:
        """Return which nodes write an entry of the whole mission; "" if none does."""
        writers = [spec.id for spec, port in self._users.get(name, ())
                   if port.direction is Direction.OUT]
        names = " or ".join(filter(None, [", ".join(writers[:-1]), *writers[-1:]]))
        return f"{names} writes it" if writers else ""
