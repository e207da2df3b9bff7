"""What is known of a mission without errors and without running it: how nodes can end, and what its
trees read and write."""
from functools import cached_property
from typing import Dict, Iterator, List, Mapping, Tuple

from behavior_controller.bt.engine import ports
from behavior_controller.bt.linter.least_times import Times, least_times
from behavior_controller.bt.engine.node import DECISIONS
from behavior_controller.bt.engine.possible_results import ENDS_BY_NAME, SUCCEEDS
from behavior_controller.bt.engine.node_types import Registry
from behavior_controller.bt.engine.registry import Direction, NodeSpec, Port
from behavior_controller.bt.loader.document import Element
from behavior_controller.bt.loader.flow import SUPPRESSED, TOUCHED, WRITTEN, Flow
from behavior_controller.bt.loader.structure import Trees, from_leaves
from behavior_controller.bt.values.status import NAMES
from behavior_controller.text import joined


class MissionFacts:
    """The facts about a mission without errors, and the findings that its warnings are added to."""

    def __init__(self, trees: Trees):
        self.trees = trees
        self.registry = registry = trees.registry
        self.findings, self.report = trees.findings, trees.report
        self.elements = {tree: trees.trees[tree].below for tree in trees.used}
        self.ends = outcomes(self.elements, registry)
        self.flow = Flow(self.elements, trees.main, trees.models, registry)
        self.needs = {tree: self.flow.needs(tree) for tree in self.elements}
        self.used = {tree: self.flow.used(tree) for tree in self.elements}
        # the entries of the whole mission that ports have by default
        self.defaults: Dict[str, List[Tuple[NodeSpec, Port]]] = {}
        for spec in registry.values():
            for port in spec.ports:
                key = ports.reference(port.default or "", port.name)
                if key is not None and key.startswith("@"):
                    self.defaults.setdefault(key[1:], []).append((spec, port))
        for name, users in self.defaults.items():
            uses = self.flow.name(trees.main, name).entry.uses
            uses.add(TOUCHED)
            readers = [port.is_optional for _, port in users if port.direction is not Direction.OUT]
            if readers and all(readers):  # what they do without, a script may do without too
                uses.add(SUPPRESSED)
        self.written = {tree: {use.name for use in self.flow.names[tree].values()
                               if WRITTEN in use.entry.uses} for tree in self.elements}
        # a mission for another robot may be given entries by it
        self.is_host_known = not any(self.spec(element).is_stub for _, element in self.walk())

    @cached_property
    def least_times(self) -> Dict[int, Times]:
        """The least times of each element."""
        return least_times(self.elements, self.ends, self.registry)

    def excuse(self, tree: str, name: str) -> None:
        """Note that a warning is about an entry."""
        self.flow.name(tree, name).entry.uses.add(SUPPRESSED)

    def written_by(self, name: str) -> str:
        """Return which nodes write an entry of the whole mission by default; "" if none does."""
        writers = [spec.id for spec, port in self.defaults.get(name, ())
                   if port.direction is Direction.OUT]
        names = joined(" or ", ", ".join(writers[:-1]), *writers[-1:])
        return names and f"{names} writes it"

    def walk(self) -> Iterator[Tuple[str, Element]]:
        """Yield each element of the trees in use, with its tree; called trees come first."""
        return ((tree, element) for tree, elements in self.elements.items() for element in elements)

    def inside(self, element: Element) -> Iterator[Element]:
        """Yield an element and all below it, also of the trees that it calls, each once."""
        waiting, called = [element, *element.below], set()
        for inner in waiting:
            yield inner
            tree = inner.attributes.get("ID", "") if inner.tag == "SubTree" else ""
            if tree and tree not in called:
                called.add(tree)
                waiting += self.elements[tree]

    @cached_property
    def _calls(self) -> Dict[str, List[Tuple[str, Element]]]:
        """The SubTree elements that call each tree, with the trees that they stand in."""
        calls: Dict[str, List[Tuple[str, Element]]] = {tree: [] for tree in self.elements}
        for tree, element in self.walk():
            if element.tag == "SubTree":
                calls[element.attributes["ID"]].append((tree, element))
        return calls

    @cached_property
    def _tree_of(self) -> Dict[int, Tuple[int, str]]:
        """The tree that an element stands in; called trees have lower numbers."""
        return {id(element): (number, tree)
                for number, (tree, elements) in enumerate(self.elements.items())
                for element in elements}

    def is_before(self, one: Element, other: Element) -> bool:
        """Return whether a Sequence ticks ``one`` before ``other``, and neither of them again; it
        is not known of trees that are called more than once."""
        places = [one, other]
        trees = [self._tree_of[id(element)] for element in places]
        while trees[0] != trees[1]:
            index = trees.index(min(trees))
            calls = self._calls[trees[index][1]]
            if len(calls) != 1:
                return False
            places[index] = calls[0][1]
            trees[index] = self._tree_of[id(places[index])]
        one, other = places
        tree = trees[0][1]
        around = self._around(tree, one, other)
        if one.last >= other.number or not around or self.spec(around[-1]).advances_on != SUCCEEDS:
            return False
        while not any(self._may_repeat(element) for element in around):
            calls = self._calls[tree]
            if tree == self.trees.main or len(calls) != 1:
                return tree == self.trees.main
            tree, call = calls[0]
            around = self._around(tree, call, call)
        return False

    def _around(self, tree: str, one: Element, other: Element) -> List[Element]:
        """Return the elements of a tree in which both stand, from the outermost."""
        return [element for element in self.elements[tree]
                if element.number < one.number and other.number <= element.last]

    def _may_repeat(self, element: Element) -> bool:
        spec = self.spec(element)
        return bool(spec.repeats_on) or spec.is_reactive or spec.is_stub

    def spec(self, element: Element) -> NodeSpec:
        """Return the node type of an element."""
        return self.registry[element.type_id]


def outcomes(trees: Mapping[str, List[Element]], registry: Registry) -> Dict[int, int]:
    """Return how each element can end, by ``id(element)``. ``trees``: see ``from_leaves``."""
    def decided(element: Element, ends: int) -> int:
        for attribute, status in DECISIONS.items():
            if attribute in element.attributes:
                ends |= ENDS_BY_NAME[NAMES[status]]
        return ends

    return from_leaves(trees, lambda element, children: registry[element.type_id].ends(
        element.attributes, children), decided)
