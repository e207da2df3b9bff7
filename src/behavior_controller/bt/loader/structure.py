"""The trees of a mission: their IDs, models and calls, and which one is the main tree (BT.CPP
12.3); and the findings about the mission, to which each rule adds."""
import re
from typing import (
    Callable, Collection, Counter, Dict, Iterable, List, Mapping, Optional, Set, Tuple, TypeVar)

from behavior_controller.bt.loader import rules
from behavior_controller.bt.engine.node import POST_CONDITIONS, PRE_CONDITIONS
from behavior_controller.bt.loader.document import Document, EXPLICIT, Element
from behavior_controller.bt.engine.node_types import Registry
from behavior_controller.bt.engine.registry import Direction, Port
from behavior_controller.bt.values.values import TYPES
from behavior_controller.errors import Fault
from behavior_controller.text import did_you_mean, first_names, quoted

_FORBIDDEN = re.compile(r"[\x00- \x7f<>&\"'/\\:*?|.]")  # in names
_WORD = re.compile(r"[A-Za-z_]\w*")
_SIGNS = "any of <>&\"'/\\:*?|."
AROUND_THEM = "put a Sequence around them"
CONDITIONS = PRE_CONDITIONS + POST_CONDITIONS
PORT_ELEMENTS = tuple(direction.value for direction in Direction)
RESERVED_PORTS = ("name", "ID", "_autoremap") + CONDITIONS

MOST_NODES = 250_000  # a few SubTrees that each call the next twice would unfold without end
Value = TypeVar("Value")
_MANY = 10 ** 9  # nodes: counted no further
_BELOW_ROOT = ("BehaviorTree", "include", "TreeNodesModel")
_ATTRIBUTES: Dict[str, Tuple[str, ...]] = {
    "root": ("BTCPP_format", "main_tree_to_execute", "project_name"), "BehaviorTree": ("ID",),
    "include": ("path", "ros_pkg"), "TreeNodesModel": ()}
"""The attributes that mean something on what is around nodes."""
STRUCTURE = EXPLICIT + _BELOW_ROOT + ("root",)
"""Elements that cannot be node types."""

MOST_FINDINGS = 1_000  # errors that are reported, and as many warnings
_COMPARISONS = 40_000  # names compared for suggestions: each takes some 10 microseconds


class Findings:
    """Collects findings, and makes suggestions, both at a bounded cost."""

    def __init__(self) -> None:
        self.errors: List[Fault] = []
        self.warnings: List[Fault] = []
        self.faulty: Set[int] = set()  # id() of elements that cannot be instantiated
        # what is noticed late is an error, as in the trees that are part of the mission
        self.refuses_late, self._unrecorded = True, 0
        self._comparisons = _COMPARISONS

    def report(self, rule: rules.LintRule, element: Element, text: str, hint: str = "",
               attribute: Optional[str] = None, at: int = 0) -> None:
        """Record a finding; an element with an error cannot be instantiated."""
        is_warning = rule.is_warning or (rule.is_late and not self.refuses_late)
        found = self.warnings
        if not is_warning:
            found = self.errors
            self.faulty.add(id(element))
        if len(found) < MOST_FINDINGS:
            found.append(element.fault(rule, text, hint, attribute, is_warning, at))
        elif not is_warning:
            self._unrecorded += 1

    def all(self, file: str) -> List[Fault]:
        """Return the findings in the order of the files; the last may say that ``file`` has more.
        """
        faults = sorted(dict.fromkeys(self.errors + self.warnings), key=by_place)
        if self._unrecorded:
            text = f"{self._unrecorded} more mistakes are not shown"
            faults.append(Fault(file, 0, 0, text, code=rules.TOO_LARGE.code))
        return faults

    def may_compare(self, number: int) -> bool:
        """Return whether a name may be compared with so many others."""
        self._comparisons -= number
        return self._comparisons > 0

    def nearest(self, word: str, known: Collection[str], otherwise: str = "") -> str:
        """Return ``did you mean …?``, or ``otherwise`` and the known names."""
        near = ""
        if len(word) < 60 and self.may_compare(len(known)):
            near = did_you_mean(word, sorted(known))
        if near or not otherwise:
            return near
        return f"{otherwise}: {first_names(known) or 'none'}"


def by_place(fault: Fault) -> Tuple[str, int, int, str, str]:
    """Return the key by which findings are ordered."""
    return fault.file, fault.line, fault.column, fault.code, fault.text



def from_leaves(trees: Mapping[str, List[Element]],
                value_of: Callable[[Element, List[Value]], Value],
                decided: Callable[[Element, Value], Value]) -> Dict[int, Value]:
    """Return a value of each element, by ``id(element)``, made of those of its children, or of the
    tree that a SubTree calls; then ``decided`` by its attributes.

    ``trees`` holds the elements of each tree in document order, called trees before those that call
    them.
    """
    values: Dict[int, Value] = {}
    of_tree: Dict[str, Value] = {}
    for tree_id, elements in trees.items():
        for element in reversed(elements):  # so that children come before their parent
            if element.tag == "SubTree":
                value = of_tree[element.attributes["ID"]]
            else:
                value = value_of(element, [values[id(child)] for child in element.children])
            values[id(element)] = decided(element, value)
        of_tree[tree_id] = values[id(elements[0])]
    return values


class Trees:
    """The trees of a mission by ID, which one is the main tree, SubTree models, and calls.

    ``tolerated`` are characters in the ID of a tree that only cause a warning.
    """

    def __init__(self, registry: Registry, tolerated: str):
        self.registry, self.findings = registry, Findings()
        self.report, self.nearest = self.findings.report, self.findings.nearest
        self.trees: Dict[str, Element] = {}
        # every <BehaviorTree>, also those that another replaces
        self.bodies: List[Tuple[str, Element]] = []
        self.models: Dict[str, List[Port]] = {}
        self.model_ports: Dict[Tuple[str, str], Element] = {}  # by tree and name
        self.main = ""  # empty: there is none
        self.calls: Dict[str, List[Element]] = {}  # tree -> its SubTree elements
        # the trees that are part of the mission, called ones first, with the number of their nodes,
        # unfolded; all trees where there is no main tree
        self.used: Dict[str, int] = {}
        self.documents: List[Document] = []  # the mission file is the last
        self.is_complete = True  # False: a file is missing, and what it would define
        self._tolerated = tolerated

    @property
    def faults(self) -> List[Fault]:
        """What is found so far, in the order of the files."""
        return self.findings.all(self.documents[-1].file)

    def add(self, document: Document) -> None:
        """Collect the trees and models of one file."""
        root = document.root
        self.documents.append(document)
        self.findings.errors.extend(document.faults)
        self.is_complete = self.is_complete and not document.faults
        if root.tag != "root":
            text = f"the first element is <{root.tag}>; it must be <root>"
            self.report(rules.WRONG_ROOT, root, text)
            return
        version = root.attributes.get("BTCPP_format")
        if version is None:
            text, hint = "<root> lacks BTCPP_format=\"4\"", "the file is read as version 4"
            meant = next((name for name in root.attributes
                          if did_you_mean(name, ["BTCPP_format"], 0.8)), None)
            if meant:
                hint = "did you mean BTCPP_format?"
            self.report(rules.FORMAT_MISSING, root, text, hint, meant)
        elif version != "4":
            text = f"BTCPP_format is {version}; the file is read as version 4"
            self.report(rules.OTHER_FORMAT, root, text, attribute="BTCPP_format")
        warnings = self.findings.warnings
        warnings.extend(document.remarks(MOST_FINDINGS - len(warnings)))
        models = [child for child in root.children if child.tag == "TreeNodesModel"]
        for extra in models[1:]:
            self.report(rules.TWO_MODELS, extra, "a file may hold only one <TreeNodesModel>")
        for element in [root, *root.children]:
            self._check_attributes(element)
        for child in root.children:
            if child.tag == "BehaviorTree":
                self._tree(child, root)
            elif models and child.tag in EXPLICIT + ("SubTree",) and "ID" not in child.attributes:
                self.report_no_id(child)
            elif child.tag not in _BELOW_ROOT:
                text = f"<{child.tag}> below <root> is ignored"
                hint = self.nearest(child.tag, _BELOW_ROOT)
                self.report(rules.IGNORED_BELOW_ROOT, child, text, hint)
        for model in models:
            self._models(model)

    def _check_attributes(self, element: Element) -> None:
        """Warn of the attributes of a tree or of what is around trees that mean nothing."""
        known = _ATTRIBUTES.get(element.tag)
        for name in element.attributes:
            if known is None or name in known or (name[0] == "_" and name not in CONDITIONS):
                continue
            meant = {"BehaviorTree": "ID", "root": "BTCPP_format"}.get(element.tag, "")
            if meant not in element.attributes and did_you_mean(name, [meant], 0.8):
                continue  # it is told that the other one is missing
            hint = self.nearest(name, known, "it may have")
            if name[0] == "_":
                hint = "a condition belongs on the <SubTree> that calls the tree, or on a node"
            text = f"{name} means nothing on <{element.tag}>"
            self.report(rules.ATTRIBUTE_IGNORED, element, text, hint, name)

    def _tree(self, tree: Element, root: Element) -> None:
        tree_id = tree.attributes.get("ID", "")
        if not tree_id:
            if len(root.children) > 1:
                hint = "only a file with nothing else may go without"
                self.report_no_id(tree, hint=hint, rule=rules.TREE_WITHOUT_ID)
            tree_id = f"BehaviorTree_{len(self.trees) + 1}"
        else:
            self.check_id(tree, tree_id)
        if tree_id in self.trees:
            first = self.trees[tree_id]
            text = (f"the tree {tree_id} is defined again; this one is used, not that "
                    f"of {first.document.file}:{first.place()[0]}")
            self.report(rules.TREE_TWICE, tree, text, attribute="ID")
        count = len(tree.children)
        if count != 1:
            text = f"<BehaviorTree ID=\"{tree_id}\"> has {count} children; it must have exactly 1"
            self.report(rules.TREE_CHILDREN, tree, text, AROUND_THEM if count else "")
        self.trees[tree_id] = tree
        self.bodies.append((tree_id, tree))

    def report_no_id(self, element: Element, where: str = "", hint: str = "",
                     rule: rules.LintRule = rules.ID_MISSING) -> None:
        """Report that an element lacks the attribute ID, at the one that is written for it."""
        name = next((name for name in element.attributes if name.lower() == "id"), None)
        if name is not None:
            hint = f"did you mean ID? write ID=\"{element.attributes[name]}\""
        self.report(rule, element, f"<{element.tag}>{where} lacks the attribute ID", hint, name)

    def check_id(self, element: Element, tree_id: str) -> None:
        """Check the ID of a <BehaviorTree> or <SubTree>."""
        bad = sorted(set(_FORBIDDEN.findall(tree_id)))
        contains = f"the ID {tree_id} contains {' and '.join(map(repr, bad))}"
        if tree_id in ("Root", "root"):
            text = f"{tree_id} is a reserved name; a tree cannot be called so"
            self.report(rules.RESERVED_ID, element, text, attribute="ID")
        elif tree_id in self.registry:
            text, hint = f"{tree_id} is the name of a node type; a tree cannot be called so", ""
            if element.tag == "SubTree":
                hint = f"a node of that type is written <{tree_id}/>"
            self.report(rules.ID_OF_A_NODE, element, text, hint, "ID")
        elif not set(bad) <= set(self._tolerated):
            text = f"{contains}; not allowed are blanks and {_SIGNS}"
            self.report(rules.ID_LETTERS, element, text, attribute="ID")
        elif bad and element.tag == "BehaviorTree":
            text = f"{contains}; BehaviorTree.CPP 4.10 refuses such a name"
            self.report(rules.ID_BLANKS, element, text, attribute="ID")

    # --------------------------------------------------------------------------------------- models

    def _models(self, models: Element) -> None:
        for model in models.children:
            if model.tag == "SubTree" and "ID" not in model.attributes:
                self.report_no_id(model, " in <TreeNodesModel>")
            elif model.tag == "SubTree":
                tree_id = model.attributes["ID"]
                usable = {port.attributes["name"]: port for port in model.children
                          if port.tag in PORT_ELEMENTS and self._usable_port(port)}
                self.models[tree_id] = [Port(name, default=port.attributes.get("default"))
                                        for name, port in usable.items()]
                self.model_ports.update(((tree_id, name), port) for name, port in usable.items())

    def words(self, tree_id: str) -> Set[str]:
        """Return the words in the attributes of a tree's nodes, such as the entries that it uses.
        """
        below = self.trees[tree_id].below if tree_id in self.trees else []
        return {word for element in below for text in element.attributes.values()
                for word in _WORD.findall(text)}

    def giver(self, call: Element, name: str) -> Tuple[Element, str]:
        """Return the element and its attribute with the text that a call gives the tree for
        ``name``: the call, or the port of the tree's model."""
        if name in call.attributes:
            return call, name
        return self.model_ports[call.attributes["ID"], name], "default"

    def _usable_port(self, port: Element) -> bool:
        name = port.attributes.get("name")
        if name is None:
            wrong = f"<{port.tag}> lacks the attribute name"
        elif not name:
            wrong = "the name of a port cannot be empty"
        elif name in RESERVED_PORTS:
            wrong = f"{name} is a reserved attribute; a port cannot be called so"
        elif name[0] in "0123456789":
            wrong = f"the name of a port cannot start with a digit: {name}"
        elif _FORBIDDEN.search(name):
            wrong = f"the name of a port cannot contain blanks or {_SIGNS}: {quoted(name)}"
        else:
            return True
        self.report(rules.MODEL_PORT_NAME, port, wrong, attribute="name")
        return False

    # ---------------------------------------------------------------------- the calls between trees

    def choose_main(self, wanted: Optional[str], guess: bool) -> None:
        """Find the calls and the main tree; ``guess``: it may be the only tree that no other calls.
        """
        self.calls = {tree_id: [element for element in tree.below if element.tag == "SubTree"]
                      for tree_id, tree in self.trees.items()}
        root = self.documents[-1].root
        named = wanted or root.attributes.get("main_tree_to_execute")
        own = [tree_id for tree_id, tree in self.trees.items() if tree.document.root is root]
        called = {call.attributes.get("ID") for calls in self.calls.values() for call in calls}
        free = [tree_id for tree_id in self.trees if tree_id not in called]
        choices = [own, list(self.trees)]
        if named:
            choices = [[named]]
        elif guess:
            choices.append(free)
        self.main = next((choice[0] for choice in choices
                          if len(choice) == 1 and choice[0] in self.trees), "")
        if self.main or (root.tag != "root" and not named):
            return
        if named:
            text = f"there is no tree {quoted(named)} to execute"
            attribute = "main_tree_to_execute"
            hint = self.nearest(named, self.trees, "the trees")
            self.report(rules.MAIN_TREE_UNKNOWN, root, text, hint, None if wanted else attribute)
        elif not self.trees:
            self.report(rules.NO_TREE, root, "the file has no <BehaviorTree>")
        else:
            why = "each tree is called by another"
            if free:
                why = f"these trees are called by no other: {first_names(free)}"
            text = f"main_tree_to_execute is not given, and {why}"
            hint = "name the main tree in <root main_tree_to_execute=\"…\">"
            self.report(rules.MAIN_TREE_MISSING, root, text, hint)

    def check_calls(self) -> None:
        """Note the used trees; find SubTrees that contain themselves, and missions that are too
        large."""
        main = self.main
        sizes: Counter[str] = Counter()
        for start in [main] if main else self.trees:
            self._unfold(start, sizes)
        self.used = dict(sizes)
        if sizes[main] > MOST_NODES:
            size = "a billion or more" if sizes[main] >= _MANY else str(sizes[main])
            text = f"the mission unfolds to {size} nodes; at most {MOST_NODES} are allowed"
            self.report(rules.TOO_LARGE, self.trees[main], text, "call fewer SubTrees")
        self.findings.refuses_late = False
        for start in self.trees:
            self._unfold(start, sizes)

    def _unfold(self, start: str, sizes: Counter[str]) -> None:
        """Go through what ``start`` calls, depth first; ``sizes`` gets the number of nodes of each
        tree, unfolded."""
        if start in sizes:
            return
        path = {start: iter(self.calls[start])}  # with the calls that are still to be followed
        while path:
            tree_id = next(reversed(path))
            call = next(path[tree_id], None)
            if call is None:
                del path[tree_id]
                inner = sum(sizes[call.attributes.get("ID", "")] for call in self.calls[tree_id])
                sizes[tree_id] = min(len(self.trees[tree_id].below) + inner, _MANY)
                continue
            called = call.attributes.get("ID", "")
            if called in path:
                circle = " > ".join([*path, called][list(path).index(called):])
                text = f"the tree {called} contains itself: {circle}"
                self.report(rules.TREE_CIRCLE, call, text, attribute="ID")
            elif called in self.calls and called not in sizes:
                path[called] = iter(self.calls[called])

    def check_unused(self) -> None:
        """Warn of trees of the mission file itself that the mission does not use; what is included
        is a library."""
        for tree_id, tree in self.trees.items():
            if tree.document is self.documents[-1] and tree_id not in self.used:
                text = f"the tree {quoted(tree_id)} is not used"
                self.report(rules.TREE_UNUSED, tree, text, f"the main tree is {quoted(self.main)}")


def given(call: Element, model: Iterable[Port]) -> Dict[str, Optional[str]]:
    """Return what a call gives the tree, by its attributes or by the defaults of the tree's model,
    which do not count if it gives all entries of equal names."""
    texts: Dict[str, Optional[str]] = {
        name: text for name, text in call.attributes.items() if is_port_name(name)}
    for port in () if remaps_all(call) else model:
        texts.setdefault(port.name, port.default)
    return texts


def remaps_all(call: Element) -> bool:
    """Return whether a call gives the tree all entries of equal names. Raises ValueFault."""
    return bool(TYPES["bool"].from_text(call.attributes.get("_autoremap", "false"), {}))


def is_port_name(name: str) -> bool:
    """Return whether an attribute counts as a port: others, like ``_uid`` or ``xmlns:x``, have no
    meaning."""
    return (name[:1].isalpha() and name[0].isascii() and name not in ("name", "ID")
            and not _FORBIDDEN.search(name))
