"""Warnings beyond BehaviorTree.CPP: what loads, but is probably a mistake.

Only the NodeSpecs say what nodes do. A warning must be worth reading: if the file and the node types do not decide,
there is none.
"""
import itertools
import re
from typing import Collection, Dict, List, Optional, Sequence, Set, Tuple

from behavior_controller.bt import rules
from behavior_controller.bt.checking.checks import (CONDITIONS, Checked, below, condition_meant, is_port_name,
                                                    read_in_part)
from behavior_controller.bt.checking.dataflow import Flow, Key, flow
from behavior_controller.bt.checking.outcomes import outcomes
from behavior_controller.bt.checking.scripts import WORDS, remarks
from behavior_controller.bt.ends import FAILS, SKIPS, SUCCEEDS
from behavior_controller.bt.language import ports
from behavior_controller.bt.language.document import EXPLICIT, Document, Element
from behavior_controller.bt.language.values import TEXT
from behavior_controller.bt.registry import Direction, Kind, NodeSpec, Port, Registry, Role, did_you_mean
from behavior_controller.bt.rules import Rule
from behavior_controller.bt.status import BY_NAME
from behavior_controller.errors import Fault

IGNORED_ON_PURPOSE = ("_uid", "_fullpath", "_description", "__shared_blackboard", "__autoremap")
_REPEATS = {SUCCEEDS: ("repeats", "succeeds", "repeats forever and never waits", "put a Sleep inside"),
            FAILS: ("retries", "fails", "asks again and again without waiting",
                    "a ReactiveFallback of the condition and a Sleep waits for it")}
_ODD_BRACES = re.compile(r"^\{[^{}]*$|^[^{}]*\}$|\$\{|\{=?[A-Za-z_@][A-Za-z0-9_]*\}")
_MOST_WARNINGS = 200
_COMPARISONS = 20_000  # names compared for suggestions, in all


def lint(documents: Sequence[Document], checked: Checked, registry: Registry,
         given: Collection[str] = ()) -> List[Fault]:
    """Return warnings about a mission without errors, in the order of the files.

    ``given`` are entries of the root's blackboard that the host provides, and names of enums.
    """
    if checked.errors:
        return []
    linter = _Linter(checked, registry, given)
    linter.unused(documents[-1])
    for tree, elements in linter.trees.items():
        for element in elements:
            linter.node(element, tree)
    linter.unwritten()
    linter.scripts()
    return sorted(set(linter.faults), key=lambda fault: (fault.file, fault.line, fault.column))


def _called_first(checked: Checked) -> Dict[str, List[Element]]:
    """Return the elements of each tree that the main tree uses, called trees before those that call them."""
    order: Dict[str, List[Element]] = {}
    waiting: List[Tuple[str, bool]] = [(checked.main, False)]
    while waiting:
        tree, is_done = waiting.pop()
        if is_done:
            order[tree] = below(checked.trees[tree])
        elif tree not in order:
            waiting.append((tree, True))
            waiting.extend((call.attributes["ID"], False) for call in checked.calls[tree])
    return order


class _Linter:
    def __init__(self, checked: Checked, registry: Registry, given: Collection[str]):
        self.checked = checked
        self.registry = registry
        self.trees = _called_first(checked)
        self.ends = outcomes(self.trees, registry)
        self.flow: Flow = flow(self.trees, checked.main, checked.models, registry)
        self.written: Dict[str, Set[str]] = {}  # tree -> entries that are written under its names
        for tree, name in self.flow.written:
            self.written.setdefault(tree, set()).add(name)
        self.defaults = _Defaults(registry, given)
        # a mission for another robot may be given entries by it
        self.is_host_known = not any(self._is_stub(element) for elements in self.trees.values() for element in elements)
        self.misspelt: Set[Key] = set()
        self.faults: List[Fault] = []
        self._comparisons = _COMPARISONS

    def warn(self, rule: Rule, element: Element, text: str, hint: str = "", attribute: Optional[str] = None,
             at: int = 0) -> None:
        if len(self.faults) < _MOST_WARNINGS:
            self.faults.append(element.fault(rule, text, hint, attribute, is_warning=True, at=at))

    def _is_stub(self, element: Element) -> bool:
        spec = self.registry.find(element.type_id)
        return spec is not None and spec.is_stub

    def _is_misspelt(self, name: str, tree: str) -> bool:
        """Return whether an entry that the host may give is more likely one that ``tree`` writes, spelt wrongly."""
        return any(len(other) > 3 and is_misspelling(name, other) for other in self.written.get(tree, ()))

    def nearest(self, word: str, known: Set[str]) -> str:
        """Return ``did you mean …?`` or nothing, at a bounded cost for the whole mission."""
        self._comparisons -= len(known)
        return did_you_mean(word, sorted(known)) if self._comparisons > 0 else ""

    # ----------------------------------------------------------------------------------------------- one node at a time

    def node(self, element: Element, tree: str) -> None:
        """Apply the rules of one element of ``tree``."""
        self._ignored_attributes(element)
        if element.tag == "SubTree":
            self._call(element, tree)
            return
        spec = self.registry.find(element.type_id)
        assert spec is not None  # guaranteed by the check
        for port in spec.ports:
            self._port(element, spec, port, tree)
        if element.tag in EXPLICIT and element.tag != spec.kind.value:
            self.warn(rules.KIND_MISMATCH, element, "<{} ID=\"{}\">: {} is of kind {}, not {}".format(
                element.tag, spec.id, spec.id, spec.kind.value, element.tag))
        if spec.child_counts and len(element.children) not in spec.child_counts:
            self.warn(rules.CHILD_COUNT, element, "{} has {} children; it must have {}".format(
                spec.id, len(element.children), " or ".join(map(str, spec.child_counts))),
                "{}; it will fail when it is ticked".format(spec.children))
        if spec.next_after:
            self._chain(element, spec)
        if spec.repeats_on:
            self._repeat(element, spec)

    def _port(self, element: Element, spec: NodeSpec, port: Port, tree: str) -> None:
        text = element.attributes.get(port.name)
        if text is not None:
            if port.type == "NodeStatus" and text not in BY_NAME and ports.reference(text, port.name) is None:
                self.warn(rules.STATUS_UNKNOWN, element, "{}=\"{}\" is not a status".format(port.name, text),
                          "allowed: {}".format(" ".join(BY_NAME)), port.name)
            elif port.role is Role.CHILDREN:
                self._count(element, port, text)
            elif port.role in (Role.DATA, Role.CHOICE) and not self._braces(element, port.name, text, tree):
                if port.role is Role.CHOICE and ports.reference(text, port.name) is None:
                    self.warn(rules.SWITCH_VARIABLE, element, "{} compares the text {}, which never changes".format(
                        port.name, text), "an entry is written {{{}}}".format(text), port.name)
            elif port.role is Role.WATCHED and ports.reference(text, port.name) is None and set(text) & set("{}$"):
                self.warn(rules.BRACES_ODD, element, "{}=\"{}\" names no entry".format(port.name, text),
                          "write {}=\"{{{}}}\"".format(port.name, text.strip("{}$ ")), port.name)
            elif port.role is Role.CASE:
                self._case(element, spec, port, text)
            return
        if port.direction is not Direction.OUT and port.default is None and not port.is_optional:
            self.warn(rules.PORT_MISSING, element, "{} needs the port {}, which is not given".format(
                spec.id, port.name), "it will fail when it is ticked")
        name = element.attributes.get("name", spec.id)
        if port.names and name not in port.names + (spec.id,) and any(letter.isdigit() for letter in name):
            self.warn(rules.NAME_CHOOSES_NOTHING, element, "the name {} has no effect; {} allows the names {}".format(
                name, spec.id, " and ".join(port.names)), spec.description, "name")

    def _braces(self, element: Element, attribute: str, text: str, tree: str) -> bool:
        """Warn of a text that is nearly a reference to an entry; return whether it is."""
        key = ports.reference(text, attribute)
        inner = text.strip("${} \t")
        if key is None and text in self.written.get(tree, ()) and text.isidentifier() and not self._is_stub(element):
            self.warn(rules.BRACES_FORGOTTEN, element, "{}=\"{}\" is the text {}, not the entry".format(
                attribute, text, text), "the entry is written {{{}}}".format(text), attribute)
        elif key is None and not text.startswith("json:") and _ODD_BRACES.search(text):
            self.warn(rules.BRACES_ODD, element, "{}=\"{}\" is a text, no entry".format(attribute, text),
                      "the whole value is written {{{}}}".format(inner) if inner.isidentifier() else
                      "a text is not filled in: a reference is the whole value", attribute)
        elif key is not None and (key != key.strip() or "{" in key or "}" in key):
            self.warn(rules.BRACES_ODD, element, "{}=\"{}\" is the entry called \"{}\"".format(attribute, text, key),
                      "write {{{}}}".format(inner), attribute)
        else:
            return False
        return True

    def _case(self, element: Element, spec: NodeSpec, port: Port, text: str) -> None:
        for other in spec.ports:
            if other.name == port.name:
                break
            if other.role is Role.CASE and element.attributes.get(other.name) == text:
                self.warn(rules.SWITCH_CASE, element, "{} is never chosen: {} is the same".format(
                    port.name, other.name), attribute=port.name)
                return
        bare = text.strip(" \t,;'\"")
        if bare != text and ports.reference(text, port.name) is None:
            self.warn(rules.SWITCH_CASE, element, "{}=\"{}\" is compared with all that stands in it".format(
                port.name, text), "write {}=\"{}\"".format(port.name, bare), port.name)

    def _ignored_attributes(self, element: Element) -> None:
        for name in element.attributes:
            if name[0] != "_" or name in CONDITIONS or name in IGNORED_ON_PURPOSE:
                continue
            if name == "_autoremap":
                if element.tag != "SubTree":
                    self.warn(rules.AUTOREMAP_MISPLACED, element, "_autoremap means something only on a <SubTree>",
                              attribute=name)
                continue
            near = did_you_mean(name, CONDITIONS + ("_autoremap",))
            if near:
                self.warn(rules.CONDITION_MISSPELT, element, "{} is ignored".format(name), near, name)

    def _chain(self, element: Element, spec: NodeSpec) -> None:
        """Apply the rules of a control that ticks its next child after a certain end of the last one."""
        children = element.children[:-1] if spec.last_is_apart else element.children
        is_sequence = spec.next_after == SUCCEEDS
        self._unreachable(children, spec.next_after | SKIPS, "succeeds" if is_sequence else "fails")
        for child in children if is_sequence else children[:1]:
            found = self.registry.find(child.type_id)
            if found is None or not found.is_recovery:
                continue
            if is_sequence:
                self.warn(rules.RECOVERY_MISPLACED, child, "{} is reached only if all before it succeeded: there is no "
                          "failure to look at".format(child.type_id),
                          "it belongs into a Fallback, after the step that may fail")
            else:
                self.warn(rules.RECOVERY_MISPLACED, child, "{} comes first: there is no failure before it to look "
                          "at".format(child.type_id), "it belongs after the step that may fail")

    def _unreachable(self, children: List[Element], wanted: int, what: str) -> None:
        for child, following in zip(children, children[1:]):
            if not self.ends[id(child)] & wanted:
                self.warn(rules.NEVER_REACHED, following, "{} is never reached: {} before it never {}".format(
                    _called(following), _called(child), what))
                return

    def _repeat(self, element: Element, spec: NodeSpec) -> None:
        child, rounds = element.children[0], element.attributes.get(spec.rounds, "")
        repeats, ends, endlessly, hint = _REPEATS[spec.repeats_on]
        if not self.ends[id(child)] & spec.repeats_on:
            self.warn(rules.NEVER_REPEATS, element, "{} never {}: {} never {}".format(
                spec.id, repeats, _called(child), ends))
        elif rounds == "-1" and self._is_instant(child):
            self.warn(rules.NEVER_WAITS, element, "{} {}".format(spec.id, endlessly), hint, spec.rounds)
        if rounds == "0" or (rounds[:1] == "-" and rounds[1:].isdigit() and rounds != "-1"):
            self.warn(rules.NEVER_RUN, element, "{}=\"{}\": the child is never run".format(spec.rounds, rounds),
                      "-1: no limit", spec.rounds)

    def _is_instant(self, element: Element) -> bool:
        """Return whether all below and including ``element`` is known to be done as soon as it is ticked."""
        specs = [self.registry.find(found.type_id) for found in [element] + below(element)]
        return all(spec is not None and (spec.is_instant or spec.kind is Kind.CONDITION) for spec in specs)

    def _count(self, element: Element, port: Port, text: str) -> None:
        attribute, count = port.name, len(element.children)
        if text.isdigit() and int(text[:9]) > count:
            self.warn(rules.COUNT_TOO_HIGH, element, "{}=\"{}\", but there are only {} children".format(
                attribute, text, count), "it will fail when it is ticked", attribute)
        elif text == "0":
            self.warn(rules.COUNT_ZERO, element, "{}=\"0\" {}".format(attribute, port.if_zero),
                      "-1 is all children", attribute)

    def _call(self, element: Element, tree: str) -> None:
        called = element.attributes.get("ID", "")
        used = self.flow.used.get(called, set())
        model = {port.name for port in self.checked.models.get(called, ())}
        for name, text in element.attributes.items():
            if not is_port_name(name):
                continue
            outer = ports.subtree_reference(text, name)
            if outer is not None:
                self._remapped(element, name, outer, tree)
            else:
                self._given(element, name, text, called)
            if not self._braces(element, name, text, tree) and name not in used and name not in model:
                near = self.nearest(name, (used | model) - set(element.attributes)) if len(name) > 2 else ""
                if condition_meant(name):
                    self.warn(rules.SUBTREE_CONDITION, element, "{} is an entry of the tree {}, no condition".format(
                        name, called), condition_meant(name), name)
                elif model:
                    self.warn(rules.MODEL_PORT_UNKNOWN, element, "the model of {} has no port {}".format(called, name),
                              near or "its ports: {}".format(", ".join(sorted(model))), name)
                elif near:
                    self.warn(rules.SUBTREE_PORT_UNKNOWN, element, "the tree {} uses no entry {}".format(called, name),
                              near, name)

    def _given(self, element: Element, name: str, text: str, called: str) -> None:
        """Warn of a literal that a port of the called tree reads in part, or cannot read."""
        port = self.flow.readers.get((called, name))
        if port is None or ports.subtree_literal(text)[0] != TEXT:
            return
        said = read_in_part(text, port, port.type)
        wrong = ports.literal_fault(text, port, {})
        if said:
            self.warn(rules.NUMBER_CUT_SHORT, element, "{}=\"{}\" {}".format(name, text, said[0]), said[1], name)
        elif wrong is not None:
            self.warn(rules.WRONG_LITERAL, element, "{}=\"{}\" cannot be of type {}, as the port {} there".format(
                name, text, port.type, port.name), wrong, name)

    def _remapped(self, element: Element, name: str, outer: str, tree: str) -> None:
        """Warn of an entry that occurs only here in the tree, if a similar name occurs."""
        key = self.flow.key(tree, outer)
        if self.flow.mentions[key] > 1:
            return
        known = self.flow.used.get(key[0], set())
        self._comparisons -= len(known)
        if self._comparisons < 0:
            return
        near = next((other for other in sorted(known) if is_misspelling(key[1], other)), "")
        if near:
            self.misspelt.add(self.flow.first(key))
            self.warn(rules.ENTRY_MISSPELT, element, "the entry {} is named nowhere else".format(outer),
                      "did you mean {}?".format(near), name)

    # ---------------------------------------------------------------------------------------------- the whole mission

    def unused(self, document: Document) -> None:
        """Warn of trees of the mission file itself that the mission does not use; what is included is a library."""
        for tree_id, tree in self.checked.trees.items():
            if tree_id not in self.trees and tree.document is document:
                self.warn(rules.TREE_UNUSED, tree, "the tree {} is not used".format(tree_id),
                          "the main tree is {}".format(self.checked.main))

    def unwritten(self) -> None:
        """Warn of entries that are read and never written; of those that a node reads by default, only of one."""
        if not self.flow.is_known:
            return
        told: Set[int] = set()  # elements
        for read in self.flow.never_written(self.defaults.given)[:_MOST_WARNINGS]:
            tree, name = read.key
            if self.flow.first(read.key) in self.misspelt or name in WORDS or name != name.strip() or "{" in name:
                continue  # reported already by another warning
            if read.attribute not in read.element.attributes:
                if id(read.element) in told:
                    continue
                told.add(id(read.element))
            hint = self._other_scope(tree, name)
            if not hint:
                if not self.is_host_known and not self._is_misspelt(name, tree):
                    continue
                hint = self.defaults.written_by(name) if tree == self.checked.main else ""
                hint = hint or self.nearest(name, self.written.get(tree, set()))
            self.warn(rules.NEVER_WRITTEN, read.element, "the entry {} is read here, but nothing writes it".format(
                name), hint, read.attribute, read.at)

    def _other_scope(self, tree: str, name: str) -> str:
        """Return a hint if an entry of that name is written, but in another tree's blackboard."""
        main = self.checked.main
        if tree != main:
            of_all = name in self.defaults.known or name in self.written.get(main, ())
            return "that of the whole mission is @{}".format(name) if of_all else ""
        elsewhere = [other for other, names in self.written.items() if other != main and name in names]
        return "the tree {} writes one of its own; that of the whole mission is @{}".format(
            elsewhere[0], name) if elsewhere else ""

    def scripts(self) -> None:
        """Warn of scripts that are probably mistakes."""
        for remark in itertools.islice(remarks(self.flow, self.defaults.known), _MOST_WARNINGS):
            if remark.rule is rules.NOT_CREATED and not self.is_host_known:
                continue
            self.warn(remark.rule, remark.use.element, remark.text, remark.hint, remark.use.attribute, remark.at)


def is_misspelling(word: str, other: str) -> bool:
    """Return whether two names differ by one letter left out, added or changed, or two exchanged.

    Names that differ by a digit or an s at the end count as different on purpose.
    """
    if word.rstrip("s0123456789") == other.rstrip("s0123456789"):
        return False
    short, long = sorted((word, other), key=len)
    at = next((index for index, pair in enumerate(zip(short, long)) if pair[0] != pair[1]), len(short))
    rest, longer = short[at:], long[at:]
    if len(short) == len(long):
        return rest[1:] == longer[1:] or (rest[1::-1] == longer[:2] and rest[2:] == longer[2:])
    return rest == longer[1:]


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
        self.given = set(given) | (optional - needed)  # what every reader does without may be missing in a script too
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
