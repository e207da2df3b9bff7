"""Warnings beyond BehaviorTree.CPP: what loads, but cannot be what its author meant.

What a mission's own leaves do comes in as data, a ``Vocabulary``. A warning must be worth reading: where the file alone
cannot tell, there is none.
"""
from typing import Callable, Dict, List, Mapping, NamedTuple, Optional, Sequence, Set, Tuple

from behavior_controller.bt.checking.checks import CONDITIONS, Checked, below, is_port_name
from behavior_controller.bt.checking.dataflow import Flow, flow
from behavior_controller.bt.checking.outcomes import FAILS, SKIPS, SUCCEEDS, outcomes
from behavior_controller.bt.language.document import EXPLICIT, Document, Element
from behavior_controller.bt.registry import Direction, Kind, NodeSpec, Registry, did_you_mean
from behavior_controller.errors import Fault

IGNORED_ON_PURPOSE = ("_uid", "_fullpath", "_description", "__shared_blackboard", "__autoremap")
_SEQUENCES = ("Sequence", "AsyncSequence", "SequenceWithMemory", "ReactiveSequence", "TryCatch")
_FALLBACKS = ("Fallback", "AsyncFallback", "ReactiveFallback")
_INSTANT = ("AlwaysSuccess", "AlwaysFailure", "Script", "SetBlackboard", "UnsetBlackboard", "WasEntryUpdated")
_TAKE_TIME = ("Delay", "KeepRunningUntilFailure", "LoopInt", "LoopBool", "LoopDouble", "LoopString", "WaitValueUpdate")
_MOST_WARNINGS = 200
_COMPARISONS = 20_000  # names compared for suggestions, in all


class Vocabulary(NamedTuple):
    """What the linter must know of a mission's own leaves."""

    keys: Sequence[str] = ()  # entries of the root's blackboard that leaves or the host provide, and names of enums
    ends: Mapping[str, int] = {}  # leaf -> outcomes.SUCCEEDS and so on, where it has but one
    needs: Mapping[str, Tuple[Sequence[str], str]] = {}  # leaf -> leaves of which one must be there too, and why
    recoveries: Sequence[str] = ()  # leaves that look at the failure of an earlier sibling


def lint(documents: Sequence[Document], checked: Checked, registry: Registry,
         vocabulary: Vocabulary = Vocabulary()) -> List[Fault]:
    """Return warnings about a mission whose check found no error, in the order of the files."""
    if not checked.main or checked.errors:
        return []
    linter = _Linter(checked, registry, vocabulary)
    linter.unused(documents[-1])
    for elements in linter.trees.values():
        for element in elements:
            linter.node(element)
    linter.unwritten()
    linter.needs()
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
    def __init__(self, checked: Checked, registry: Registry, vocabulary: Vocabulary):
        self.checked = checked
        self.registry = registry
        self.vocabulary = vocabulary
        self.trees = _called_first(checked)
        self.ends = outcomes(self.trees, vocabulary.ends)
        self.flow: Flow = flow(self.trees, checked.main, checked.models, registry)
        self.used: Dict[str, Set[str]] = {}  # tree -> entries that it reads or writes under its own name
        for tree, name in list(self.flow.reads) + list(self.flow.written):
            self.used.setdefault(tree, set()).add(name)
        self.faults: List[Fault] = []
        self._comparisons = _COMPARISONS
        self._rules: Dict[str, Callable[[Element], None]] = {
            "SubTree": self._call, "Repeat": self._repeat, "RetryUntilSuccessful": self._retry,
            "Parallel": self._parallel,
            "ParallelAll": self._parallel, "IfThenElse": self._branches, "WhileDoElse": self._branches}
        self._rules.update((name, self._switch) for name in ("Switch2", "Switch3", "Switch4", "Switch5", "Switch6"))
        self._rules.update((name, self._sequence) for name in _SEQUENCES)
        self._rules.update((name, self._fallback) for name in _FALLBACKS)

    def warn(self, element: Element, text: str, hint: str = "", attribute: Optional[str] = None) -> None:
        """Record a warning."""
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
        spec = self.registry.find(element.type_id)
        for port in spec.ports if spec and spec.kind is not Kind.SUBTREE else ():
            if port.direction is not Direction.OUT and port.default is None and port.name not in element.attributes:
                self.warn(element, "{} needs the port {}, which is not given".format(element.type_id, port.name),
                          "it will fail when it is ticked")
        if spec and element.tag in EXPLICIT and element.tag != spec.kind.value:
            self.warn(element, "<{} ID=\"{}\">: {} is no {} but of kind {}".format(
                element.tag, spec.id, spec.id, element.tag, spec.kind.value))
        if spec and spec.names:
            self._name(element, spec)
        rule = self._rules.get(element.type_id)
        if rule is not None:
            rule(element)

    def _name(self, element: Element, spec: NodeSpec) -> None:
        """Warn of a name that looks as if it should choose something: one with a number, as those that do have."""
        name = element.attributes.get("name", spec.id)
        if name not in spec.names + (spec.id,) and any(letter.isdigit() for letter in name):
            self.warn(element, "the name {} chooses nothing; {} knows the names {}".format(
                name, spec.id, " and ".join(spec.names)), spec.description, "name")

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

    def _sequence(self, element: Element) -> None:
        children = element.children[:-1] if element.type_id == "TryCatch" else element.children
        self._unreachable(children, SUCCEEDS | SKIPS, "succeeds")
        for child in children:
            if child.type_id in self.vocabulary.recoveries:
                self.warn(child, "{} is reached only if all before it succeeded: there is no failure to look at".format(
                    child.type_id), "it belongs into a Fallback, after the step that may fail")

    def _fallback(self, element: Element) -> None:
        self._unreachable(element.children, FAILS | SKIPS, "fails")
        first = element.children[0]
        if first.type_id in self.vocabulary.recoveries:
            self.warn(first, "{} comes first: there is no failure before it to look at".format(first.type_id),
                      "it belongs after the step that may fail")

    def _unreachable(self, children: List[Element], wanted: int, what: str) -> None:
        for child, following in zip(children, children[1:]):
            if not self.ends[id(child)] & wanted:
                self.warn(following, "{} is never reached: {} before it never {}".format(
                    _called(following), _called(child), what))
                return

    def _repeat(self, element: Element) -> None:
        child = element.children[0]
        rounds = element.attributes.get("num_cycles", "")
        if not self.ends[id(child)] & SUCCEEDS:
            self.warn(element, "Repeat never repeats: {} never succeeds".format(_called(child)))
        elif rounds == "-1" and self._is_instant(child):
            self.warn(element, "Repeat goes round for ever and never waits", "put a Sleep inside", "num_cycles")
        self._rounds(element, "num_cycles", rounds)

    def _retry(self, element: Element) -> None:
        child = element.children[0]
        attempts = element.attributes.get("num_attempts", "")
        if not self.ends[id(child)] & FAILS:
            self.warn(element, "RetryUntilSuccessful never retries: {} never fails".format(_called(child)))
        elif attempts == "-1" and self._is_instant(child):
            self.warn(element, "RetryUntilSuccessful asks again and again without waiting",
                      "a ReactiveFallback of the condition and a Sleep waits for it", "num_attempts")
        self._rounds(element, "num_attempts", attempts)

    def _rounds(self, element: Element, attribute: str, text: str) -> None:
        if text == "0" or (text[:1] == "-" and text[1:].isdigit() and text != "-1"):
            self.warn(element, "{}=\"{}\": the child is never run".format(attribute, text), "-1 is for ever", attribute)

    def _is_instant(self, element: Element) -> bool:
        """Return whether all below and including ``element`` is known to be done as soon as it is ticked."""
        for found in [element] + below(element):
            spec = self.registry.find(found.type_id)
            is_leaf = not found.children and found.type_id not in _INSTANT and (
                spec is None or spec.kind is not Kind.CONDITION)
            if is_leaf or found.type_id in _TAKE_TIME:
                return False
        return True

    def _parallel(self, element: Element) -> None:
        count = len(element.children)
        for attribute in ("success_count", "failure_count", "max_failures"):
            text = element.attributes.get(attribute, "")
            if text.isdigit() and len(text) < 10 and int(text) > count:
                self.warn(element, "{}=\"{}\", but there are only {} children".format(attribute, text, count),
                          "it will fail when it is ticked", attribute)
            elif text == "0":
                self.warn(element, "{}=\"0\" is decided before any child has done its work".format(attribute),
                          "-1 is all children", attribute)

    def _branches(self, element: Element) -> None:
        if len(element.children) not in (2, 3):
            self.warn(element, "{} has {} children; it must have 2 or 3".format(element.type_id, len(element.children)),
                      "condition, then, else; it will fail when it is ticked")

    def _switch(self, element: Element) -> None:
        cases = int(element.type_id[-1])
        if len(element.children) != cases + 1:
            self.warn(element, "{} has {} children; it must have {}".format(
                element.type_id, len(element.children), cases + 1), "one for each case and the default")

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
        """Warn of entries that are read and that nothing writes."""
        if not self.flow.is_known:
            return
        given = set(self.vocabulary.keys)
        written: Dict[str, Set[str]] = {}
        for tree, name in self.flow.written:
            written.setdefault(tree, set()).add(name)
        for read in self.flow.never_written(given)[:_MOST_WARNINGS]:
            tree, name = read.key
            if name.lstrip("@") in given and tree != self.checked.main:
                hint = "that of the whole mission is @{}".format(name)
            else:
                hint = self.nearest(name, written.get(tree, set()))
            self.warn(read.element, "the entry {} is read here, but nothing writes it".format(name), hint,
                      read.attribute)

    def needs(self) -> None:
        """Warn of leaves that can do nothing, because a leaf that must go before them is not there."""
        present = {element.type_id: element for elements in self.trees.values() for element in reversed(elements)}
        for leaf, (others, why) in self.vocabulary.needs.items():
            if leaf in present and not any(other in present for other in others):
                self.warn(present[leaf], "{} can never succeed: {}".format(leaf, why),
                          "the mission lacks {}".format(" or ".join(others[:2])))


def _called(element: Element) -> str:
    name = element.attributes.get("name") or element.attributes.get("ID") or ""
    return "{} {}".format(element.type_id, name) if name and name != element.type_id else element.type_id
