"""Warnings beyond BehaviorTree.CPP: what loads, but cannot be what its author meant.

What nodes do is told by their NodeSpec alone. A warning must be worth reading: where the file and the node types cannot
tell, there is none.
"""
from typing import Collection, Dict, List, Optional, Sequence, Set, Tuple

from behavior_controller.bt.checking.checks import CONDITIONS, Checked, below, is_port_name
from behavior_controller.bt.checking.dataflow import Flow, flow
from behavior_controller.bt.checking.outcomes import outcomes
from behavior_controller.bt.ends import FAILS, SKIPS, SUCCEEDS
from behavior_controller.bt.language import ports
from behavior_controller.bt.language.document import EXPLICIT, Document, Element
from behavior_controller.bt.registry import Direction, Kind, NodeSpec, Port, Registry, Role, did_you_mean
from behavior_controller.errors import Fault

IGNORED_ON_PURPOSE = ("_uid", "_fullpath", "_description", "__shared_blackboard", "__autoremap")
_REPEATS = {SUCCEEDS: ("repeats", "succeeds", "goes round for ever and never waits", "put a Sleep inside"),
            FAILS: ("retries", "fails", "asks again and again without waiting",
                    "a ReactiveFallback of the condition and a Sleep waits for it")}
_MOST_WARNINGS = 200
_COMPARISONS = 20_000  # names compared for suggestions, in all


def lint(documents: Sequence[Document], checked: Checked, registry: Registry,
         given: Collection[str] = ()) -> List[Fault]:
    """Return warnings about a mission whose check found no error, in the order of the files.

    ``given`` are entries of the root's blackboard that the host provides, and names of enums.
    """
    if not checked.main or checked.errors:
        return []
    linter = _Linter(checked, registry, given)
    linter.unused(documents[-1])
    for elements in linter.trees.values():
        for element in elements:
            linter.node(element)
    linter.unwritten()
    return sorted(set(linter.faults), key=lambda fault: (fault.file, fault.line, fault.column))


def _called_first(checked: Checked) -> Dict[str, List[Element]]:
    """Return the elements of each tree that the main tree uses, called trees before those that call them."""
    order: Dict[str, List[Element]] = {}
    waiting: List[Tuple[str, bool]] = [(checked.main, False)]
    while waiting:
        tree, is_done = waiting.pop()
        if is_done:
            order[tree] = below(checked.trees[tree])
        elif tree in checked.trees and tree not in order:
            waiting.append((tree, True))
            waiting.extend((call.attributes.get("ID", ""), False) for call in checked.calls[tree]
                           if call.attributes.get("ID", "") not in order)
    return order


class _Linter:
    def __init__(self, checked: Checked, registry: Registry, given: Collection[str]):
        self.checked = checked
        self.registry = registry
        self.trees = _called_first(checked)
        self.ends = outcomes(self.trees, registry)
        self.flow: Flow = flow(self.trees, checked.main, checked.models, registry)
        self.used: Dict[str, Set[str]] = {}  # tree -> entries that it reads or writes under its own name
        for tree, name in list(self.flow.reads) + list(self.flow.written):
            self.used.setdefault(tree, set()).add(name)
        self.defaults = _Defaults(registry, given)
        self.faults: List[Fault] = []
        self._comparisons = _COMPARISONS

    def warn(self, element: Element, text: str, hint: str = "", attribute: Optional[str] = None) -> None:
        if len(self.faults) < _MOST_WARNINGS:
            self.faults.append(element.fault(text, hint, attribute, is_warning=True))

    def nearest(self, word: str, known: Set[str]) -> str:
        """Return ``did you mean …?`` or nothing, at a bounded cost for the whole mission."""
        self._comparisons -= len(known)
        return did_you_mean(word, sorted(known)) if self._comparisons > 0 else ""

    # ----------------------------------------------------------------------------------------------- one node at a time

    def node(self, element: Element) -> None:
        """Apply the rules of one element."""
        if element.attributes:
            self._ignored_attributes(element)
        if element.tag == "SubTree":
            self._call(element)
            return
        spec = self.registry.find(element.type_id)
        assert spec is not None  # the check has seen to it
        for port in spec.ports:
            self._port(element, spec, port)
        if element.tag in EXPLICIT and element.tag != spec.kind.value:
            self.warn(element, "<{} ID=\"{}\">: {} is no {} but of kind {}".format(
                element.tag, spec.id, spec.id, element.tag, spec.kind.value))
        if spec.child_counts and len(element.children) not in spec.child_counts:
            self.warn(element, "{} has {} children; it must have {}".format(
                spec.id, len(element.children), " or ".join(map(str, spec.child_counts))),
                "{}; it will fail when it is ticked".format(spec.children))
        if spec.next_after:
            self._chain(element, spec)
        if spec.repeats_on:
            self._repeat(element, spec)

    def _port(self, element: Element, spec: NodeSpec, port: Port) -> None:
        if port.name in element.attributes:
            if port.role is Role.CHILDREN:
                self._count(element, port.name, element.attributes[port.name])
            return
        if port.direction is not Direction.OUT and port.default is None and not port.is_optional:
            self.warn(element, "{} needs the port {}, which is not given".format(spec.id, port.name),
                      "it will fail when it is ticked")
        name = element.attributes.get("name", spec.id)
        if port.names and name not in port.names + (spec.id,) and any(letter.isdigit() for letter in name):
            self.warn(element, "the name {} chooses nothing; {} knows the names {}".format(
                name, spec.id, " and ".join(port.names)), spec.description, "name")

    def _ignored_attributes(self, element: Element) -> None:
        for name in element.attributes:
            if name[0] != "_" or name in CONDITIONS or name in IGNORED_ON_PURPOSE:
                continue
            if name == "_autoremap":
                if element.tag != "SubTree":
                    self.warn(element, "_autoremap means something only on a <SubTree>", attribute=name)
                continue
            near = did_you_mean(name, CONDITIONS + ("_autoremap",))
            if near:
                self.warn(element, "{} is ignored".format(name), near, name)

    def _chain(self, element: Element, spec: NodeSpec) -> None:
        """Apply the rules of a control that ticks its next child when one has ended as it should."""
        children = element.children[:-1] if spec.last_is_apart else element.children
        is_sequence = spec.next_after == SUCCEEDS
        self._unreachable(children, spec.next_after | SKIPS, "succeeds" if is_sequence else "fails")
        for child in children if is_sequence else children[:1]:
            found = self.registry.find(child.type_id)
            if found is None or not found.is_recovery:
                continue
            if is_sequence:
                self.warn(child, "{} is reached only if all before it succeeded: there is no failure to look at".format(
                    child.type_id), "it belongs into a Fallback, after the step that may fail")
            else:
                self.warn(child, "{} comes first: there is no failure before it to look at".format(child.type_id),
                          "it belongs after the step that may fail")

    def _unreachable(self, children: List[Element], wanted: int, what: str) -> None:
        for child, following in zip(children, children[1:]):
            if not self.ends[id(child)] & wanted:
                self.warn(following, "{} is never reached: {} before it never {}".format(
                    _called(following), _called(child), what))
                return

    def _repeat(self, element: Element, spec: NodeSpec) -> None:
        child, rounds = element.children[0], element.attributes.get(spec.rounds, "")
        repeats, ends, endlessly, hint = _REPEATS[spec.repeats_on]
        if not self.ends[id(child)] & spec.repeats_on:
            self.warn(element, "{} never {}: {} never {}".format(spec.id, repeats, _called(child), ends))
        elif rounds == "-1" and self._is_instant(child):
            self.warn(element, "{} {}".format(spec.id, endlessly), hint, spec.rounds)
        if rounds == "0" or (rounds[:1] == "-" and rounds[1:].isdigit() and rounds != "-1"):
            self.warn(element, "{}=\"{}\": the child is never run".format(spec.rounds, rounds), "-1 is for ever",
                      spec.rounds)

    def _is_instant(self, element: Element) -> bool:
        """Return whether all below and including ``element`` is known to be done as soon as it is ticked."""
        specs = [self.registry.find(found.type_id) for found in [element] + below(element)]
        return all(spec is not None and (spec.is_instant or spec.kind is Kind.CONDITION) for spec in specs)

    def _count(self, element: Element, attribute: str, text: str) -> None:
        count = len(element.children)
        if text.isdigit() and len(text) < 10 and int(text) > count:
            self.warn(element, "{}=\"{}\", but there are only {} children".format(attribute, text, count),
                      "it will fail when it is ticked", attribute)
        elif text == "0":
            self.warn(element, "{}=\"0\" is decided before any child has done its work".format(attribute),
                      "-1 is all children", attribute)

    def _call(self, element: Element) -> None:
        called = element.attributes.get("ID", "")
        used = self.used.get(called, set())
        for name in element.attributes:
            if is_port_name(name) and name not in used and len(name) > 2:
                near = self.nearest(name, used - set(element.attributes))
                if near:
                    self.warn(element, "the tree {} uses no entry {}".format(called, name), near, name)

    # ---------------------------------------------------------------------------------------------- the whole mission

    def unused(self, document: Document) -> None:
        """Warn of trees of the mission file itself that the mission does not use; what is included is a library."""
        for tree_id, tree in self.checked.trees.items():
            if tree_id not in self.trees and tree.document is document:
                self.warn(tree, "the tree {} is not used".format(tree_id),
                          "the main tree is {}".format(self.checked.main))

    def unwritten(self) -> None:
        """Warn of entries that are read and that nothing writes; of those that a node reads by default, of one."""
        if not self.flow.is_known:
            return
        written: Dict[str, Set[str]] = {}
        for tree, name in self.flow.written:
            written.setdefault(tree, set()).add(name)
        told: Set[int] = set()  # elements
        for read in self.flow.never_written(self.defaults.given)[:_MOST_WARNINGS]:
            tree, name = read.key
            if read.attribute not in read.element.attributes:
                if id(read.element) in told:
                    continue
                told.add(id(read.element))
            if tree != self.checked.main and name in self.defaults.known:
                hint = "that of the whole mission is @{}".format(name)
            else:
                hint = self.defaults.written_by(name) if tree == self.checked.main else ""
                hint = hint or self.nearest(name, written.get(tree, set()))
            self.warn(read.element, "the entry {} is read here, but nothing writes it".format(name), hint,
                      read.attribute)


class _Defaults:
    """The entries of the whole mission: those that ports have by default, and those that the host provides."""

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
        self.given = set(given) | (optional - needed)  # what every reader does without is no mistake in a script either
        self.known = self.given | needed | set(self._writers)

    def written_by(self, name: str) -> str:
        """Return which nodes write an entry of the whole mission; "" if none does."""
        writers = self._writers.get(name, [])
        if not writers:
            return ""
        return "{} writes it".format(" or ".join(filter(None, [", ".join(writers[:-1]), writers[-1]])))


def _called(element: Element) -> str:
    name = element.attributes.get("name") or element.attributes.get("ID") or ""
    return "{} {}".format(element.type_id, name) if name and name != element.type_id else element.type_id
