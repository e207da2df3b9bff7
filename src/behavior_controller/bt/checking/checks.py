"""Finds faults of a mission without building it: structure, names, ports, literals, scripts (BT.CPP 12.3).

``check`` accepts what BehaviorTree.CPP's loader accepts, reports every fault in one pass, and warns of what loads but
is likely a mistake. The compiler finds what depends on an instance (types of entries, paths of SubTrees).
"""
import difflib
import itertools
import re
import sys
from typing import Callable, Collection, Counter, Dict, List, NamedTuple, Optional, Sequence, Set, Tuple

from behavior_controller.bt import rules
from behavior_controller.bt.engine.node import POST_CONDITIONS, PRE_CONDITIONS
from behavior_controller.bt.language import ports, values
from behavior_controller.bt.language.document import EXPLICIT, Document, Element
from behavior_controller.bt.language.script import ScriptSyntaxError, compile_script
from behavior_controller.bt.language.values import ValueFault
from behavior_controller.bt.registry import Kind, NodeSpec, Port, Registry, Role, argument, did_you_mean
from behavior_controller.bt.rules import Rule
from behavior_controller.errors import Fault

_FORBIDDEN = re.compile(r"[\x00- \x7f<>&\"'/\\:*?|.]")  # in names
CONDITIONS = PRE_CONDITIONS + POST_CONDITIONS
PORT_ELEMENTS = ("input_port", "output_port", "inout_port")
RESERVED_PORTS = ("name", "ID", "_autoremap") + CONDITIONS

MOST_NODES = 250_000  # a few SubTrees that each call the next twice would unfold without end
_MANY = 10 ** 9  # nodes: counted no further
MOST_FAULTS = 1_000  # that are told, and as many warnings
LONGEST_SCRIPT = 20_000  # characters
_COMPARISONS = 20_000  # names compared for "did you mean", in all: each takes some 10 microseconds
_BELOW_ROOT = ("BehaviorTree", "include", "TreeNodesModel")

_BLACKBOARD_CHECK = "version 4 writes _skipIf, _failureIf or Precondition"
ELSEWHERE = {
    "SubTreePlus": "version 4 writes <SubTree>, and _autoremap for __autoremap",
    "SequenceStar": "version 4 calls it SequenceWithMemory",
    "FallbackStar": "version 4 calls it Fallback",
    "RetryUntilSuccesful": "version 4 spells it RetryUntilSuccessful",
    "BlackboardCheckInt": _BLACKBOARD_CHECK,
    "BlackboardCheckDouble": _BLACKBOARD_CHECK,
    "BlackboardCheckString": _BLACKBOARD_CHECK,
    "BlackboardCheckBool": _BLACKBOARD_CHECK,
    "ConsumeQueue": "version 4 has LoopString, LoopInt, LoopDouble and LoopBool",
    "ManualSelector": "version 4 has Switch2 to Switch6",
    "Selector": "BehaviorTree.CPP calls it Fallback",
    "include": "it belongs directly below <root>",
    "TreeNodesModel": "it belongs directly below <root>",
}
"""Names of a node type in other versions and tools -> its name here."""
_PORTS_ELSEWHERE = {
    ("Parallel", "threshold"): "version 4 writes success_count",
    ("Parallel", "success_threshold"): "version 4 writes success_count",
    ("Parallel", "failure_threshold"): "version 4 writes failure_count",
}
_SUBTREE_ELSEWHERE = {
    "__shared_blackboard": "version 4 ignores it: write _autoremap=\"true\"",
    "__autoremap": "version 4 ignores it: write _autoremap",
}


class Checked(NamedTuple):
    """The trees of a mission by ID, which one is the main tree, SubTree models, and every fault found."""

    trees: Dict[str, Element]
    main: str
    models: Dict[str, List[Port]]
    faults: List[Fault]  # in the order of the files
    faulty: Set[int]  # id() of elements that cannot be instantiated
    calls: Dict[str, List[Element]]  # tree -> its SubTree elements
    used: Set[str]  # trees that are part of the mission; all, where there is no main tree

    @property
    def errors(self) -> List[Fault]:
        """The faults that keep the mission from loading."""
        return [fault for fault in self.faults if not fault.is_warning]


def check(documents: Sequence[Document], registry: Registry, main_tree: Optional[str] = None,
          strict: bool = False) -> Checked:
    """Check ``documents``, included ones first, the mission itself last. ``main_tree`` overrides the file's choice.

    Without ``strict`` two things load that BehaviorTree.CPP refuses. If nothing names the main tree, it is the only one
    that no other tree calls (Groot2 drops the attribute when it saves). The ID of a tree may contain blanks and dots
    (as in the published lab tour), with a warning.
    """
    index = _Index(registry, "" if strict else " .")
    for document in documents:
        index.add(document)
    main = index.main_tree(documents[-1], main_tree, not strict)
    index.check_calls(main)
    nodes = _Nodes(registry, index)
    for tree_id, tree in index.bodies:
        nodes.check_tree(tree, tree_id in index.used and index.trees[tree_id] is tree)
    return Checked(index.trees, main, index.models, index.all(documents[-1].file), index.faulty, index.calls,
                   index.used)


def below(tree: Element) -> List[Element]:
    """Return every element below ``tree``, in document order."""
    # a loop, not recursion: a file may be nested deeper than Python's stack
    found: List[Element] = []
    waiting = [tree]
    while waiting:
        element = waiting.pop()
        found.append(element)
        waiting.extend(reversed(element.children))
    return found[1:]


class _Faults:
    """Collects faults, and makes suggestions, both at a bounded cost."""

    def __init__(self) -> None:
        self.errors: List[Fault] = []
        self.warnings: List[Fault] = []
        self.faulty: Set[int] = set()
        self.unrecorded = 0
        self._comparisons = _COMPARISONS

    def fault(self, rule: Rule, element: Element, text: str, hint: str = "", attribute: Optional[str] = None,
              at: int = 0) -> None:
        """Record a fault; the element cannot be instantiated."""
        self.faulty.add(id(element))
        if len(self.errors) < MOST_FAULTS:
            self.errors.append(element.fault(rule, text, hint, attribute, is_warning=False, at=at))
        else:
            self.unrecorded += 1

    def warn(self, rule: Rule, element: Element, text: str, hint: str = "", attribute: Optional[str] = None,
             at: int = 0) -> None:
        if len(self.warnings) < MOST_FAULTS:
            self.warnings.append(element.fault(rule, text, hint, attribute, is_warning=True, at=at))

    def no_id(self, element: Element, where: str = "", hint: str = "") -> None:
        """Record that an element lacks the attribute ID."""
        self.fault(rules.ID_MISSING, element, "<{}>{} lacks the attribute ID".format(element.tag, where),
                   *_instead_of_id(element, hint))

    def all(self, file: str) -> List[Fault]:
        """Return the faults in the order of the files; the last may say that ``file`` has more."""
        faults = sorted(self.errors + self.warnings, key=lambda fault: (fault.file, fault.line, fault.column))
        if self.unrecorded:
            faults.append(Fault(file, 0, 0, "{} more faults are not shown".format(self.unrecorded),
                                code=rules.TOO_LARGE.code))
        return faults

    def nearest(self, word: str, known: Collection[str], otherwise: str = "") -> str:
        """Return ``did you mean …?``, or ``otherwise`` and the known names if they are few."""
        self._comparisons -= len(known)
        near = did_you_mean(word, known) if len(word) < 60 and self._comparisons > 0 else ""
        if near or not otherwise:
            return near
        return "{}: {}".format(otherwise, ", ".join(itertools.islice(known, 10)) or "none")


# ------------------------------------------------------------------------------------------- the mission as a whole


class _Index(_Faults):
    """Collects the trees and models of all documents, and their calls."""

    def __init__(self, registry: Registry, tolerated: str):
        super().__init__()
        self.registry = registry
        self.tolerated = tolerated  # characters in the ID of a tree that only cause a warning
        self.trees: Dict[str, Element] = {}
        self.bodies: List[Tuple[str, Element]] = []  # every <BehaviorTree>, also those that another replaces
        self.models: Dict[str, List[Port]] = {}
        self.calls: Dict[str, List[Element]] = {}
        self.used: Set[str] = set()
        self.is_complete = True  # False: a file is missing, and what it would define

    def add(self, document: Document) -> None:
        """Collect the trees and models of one file."""
        root = document.root
        self.errors.extend(document.faults)
        self.is_complete = self.is_complete and not document.faults
        if root.tag != "root":
            self.fault(rules.WRONG_ROOT, root, "the first element is <{}>; it must be <root>".format(root.tag))
            return
        self._format(root)
        self.warnings.extend(document.stray_text(MOST_FAULTS - len(self.warnings)))
        models = [child for child in root.children if child.tag == "TreeNodesModel"]
        for extra in models[1:]:
            self.fault(rules.TWO_MODELS, extra, "a file may hold only one <TreeNodesModel>")
        for child in root.children:
            if child.tag == "BehaviorTree":
                self._tree(child, root)
            elif models and child.tag in EXPLICIT + ("SubTree",) and "ID" not in child.attributes:
                self.no_id(child)
            elif child.tag not in _BELOW_ROOT:
                self.warn(rules.IGNORED_BELOW_ROOT, child, "<{}> below <root> is ignored".format(child.tag),
                          self.nearest(child.tag, _BELOW_ROOT))
        for model in models:
            self._models(model)

    def _format(self, root: Element) -> None:
        version = root.attributes.get("BTCPP_format")
        if version is None:
            self.warn(rules.FORMAT_MISSING, root, "<root> lacks BTCPP_format=\"4\"", "the file is read as version 4")
        elif version != "4":
            self.warn(rules.OTHER_FORMAT, root, "BTCPP_format is {}; the file is read as version 4".format(version),
                      attribute="BTCPP_format")

    def _tree(self, tree: Element, root: Element) -> None:
        tree_id = tree.attributes.get("ID", "")
        if not tree_id:
            if len(root.children) > 1:
                self.fault(rules.TREE_WITHOUT_ID, tree, "<BehaviorTree> lacks the attribute ID",
                           *_instead_of_id(tree, "only a file with nothing else may go without"))
            tree_id = "BehaviorTree_{}".format(len(self.trees) + 1)
        else:
            self.check_id(tree, tree_id)
        if tree_id in self.trees:
            first = self.trees[tree_id]
            self.warn(rules.TREE_TWICE, tree, "the tree {} is defined again; this one is used, not that of {}:{}"
                      .format(tree_id, first.document.file, first.place()[0]), attribute="ID")
        if len(tree.children) != 1:
            self.fault(rules.TREE_CHILDREN, tree, "<BehaviorTree ID=\"{}\"> has {} children; it must have exactly 1"
                       .format(tree_id, len(tree.children)), "put a Sequence around them" if tree.children else "")
        self.trees[tree_id] = tree
        self.bodies.append((tree_id, tree))

    def check_id(self, element: Element, tree_id: str) -> None:
        """Check the ID of a <BehaviorTree> or <SubTree>."""
        if tree_id in ("Root", "root"):
            self.fault(rules.RESERVED_ID, element, "{} is a reserved name; a tree cannot be called so".format(tree_id),
                       attribute="ID")
        elif self.registry.find(tree_id) is not None:
            self.fault(rules.ID_OF_A_NODE, element,
                       "{} is the name of a node type; a tree cannot be called so".format(tree_id),
                       "a node of that type is written <{}/>".format(tree_id) if element.tag == "SubTree" else "", "ID")
        else:
            self._letters(element, tree_id)

    def _letters(self, element: Element, tree_id: str) -> None:
        bad = sorted(set(_FORBIDDEN.findall(tree_id)))
        shown = " and ".join(repr(letter) for letter in bad)
        if not set(bad) <= set(self.tolerated):
            self.fault(rules.ID_LETTERS, element, "the ID {} contains {}; not allowed are blanks and any of "
                       "<>&\"'/\\:*?|.".format(tree_id, shown), attribute="ID")
        elif bad and element.tag == "BehaviorTree":
            self.warn(rules.ID_BLANKS, element,
                      "the ID {} contains {}; BehaviorTree.CPP 4.10 refuses such a name".format(tree_id, shown),
                      attribute="ID")

    # ---------------------------------------------------------------------------------------------------------- models

    def _models(self, models: Element) -> None:
        for model in models.children:
            if model.tag != "SubTree":
                continue
            if "ID" not in model.attributes:
                self.no_id(model, " in <TreeNodesModel>")
                continue
            self.models[model.attributes["ID"]] = [
                Port(port.attributes["name"], default=port.attributes.get("default"))
                for port in model.children if port.tag in PORT_ELEMENTS and self._usable_port(port)]

    def _usable_port(self, port: Element) -> bool:
        name = port.attributes.get("name")
        if name is None:
            wrong = "<{}> lacks the attribute name".format(port.tag)
        elif not name:
            wrong = "the name of a port cannot be empty"
        elif name in RESERVED_PORTS:
            wrong = "{} is a reserved attribute; a port cannot be called so".format(name)
        elif name[0] in "0123456789":
            wrong = "the name of a port cannot start with a digit: {}".format(name)
        elif _FORBIDDEN.search(name):
            wrong = "the name of a port cannot contain blanks or any of <>&\"'/\\:*?|.: {}".format(name)
        else:
            return True
        self.fault(rules.MODEL_PORT_NAME, port, wrong, attribute="name")
        return False

    # -------------------------------------------------------------------------------------- the calls between trees

    def main_tree(self, document: Document, wanted: Optional[str], guess: bool) -> str:
        """Return the ID of the main tree, or an empty text if there is a fault."""
        self.calls = {tree_id: [element for element in below(tree) if element.tag == "SubTree"]
                      for tree_id, tree in self.trees.items()}
        root = document.root
        named = wanted or root.attributes.get("main_tree_to_execute")
        if named in self.trees:
            return named
        own = [tree_id for tree_id, tree in self.trees.items() if tree.document is document]
        if named:
            self.fault(rules.MAIN_TREE_UNKNOWN, root, "there is no tree {} to execute".format(named),
                       self.nearest(named, self.trees, "the trees"), None if wanted else "main_tree_to_execute")
            return ""
        called = {call.attributes.get("ID") for calls in self.calls.values() for call in calls}
        free = [tree_id for tree_id in self.trees if tree_id not in called]
        for choice in (own, list(self.trees), free if guess else []):
            if len(choice) == 1:
                return choice[0]
        if root.tag == "root":
            self._no_main_tree(root, free)
        return ""

    def _no_main_tree(self, root: Element, free: List[str]) -> None:
        if not self.trees:
            self.fault(rules.NO_TREE, root, "the file has no <BehaviorTree>")
            return
        why = "each tree is called by another"
        if free:
            why = "these trees are called by no other: {}".format(", ".join(free[:10]))
        self.fault(rules.MAIN_TREE_MISSING, root, "main_tree_to_execute is not given, and {}".format(why),
                   "name the main tree in <root main_tree_to_execute=\"…\">")

    def check_calls(self, main: str) -> None:
        """Note the used trees; find SubTrees that contain themselves, and missions that are too large."""
        sizes: Counter[str] = Counter()
        for start in [main] if main else list(self.trees):
            self._unfold(start, sizes, self.fault)
        self.used = set(sizes)
        if sizes[main] > MOST_NODES:
            self.fault(rules.TOO_LARGE, self.trees[main], "the mission unfolds to {} nodes; at most {} are allowed"
                       .format("a billion or more" if sizes[main] >= _MANY else sizes[main], MOST_NODES),
                       "call fewer SubTrees")
        for start in self.trees:
            self._unfold(start, sizes, self.warn)

    def _unfold(self, start: str, sizes: Counter[str], complain: Callable[..., None]) -> None:
        """Go through what ``start`` calls, depth first; ``sizes`` gets the number of nodes of each tree, unfolded."""
        path: List[str] = []
        opened: Dict[str, int] = {}  # where in the path a tree is
        waiting: List[Tuple[str, Optional[Element]]] = [(start, None)]
        while waiting:
            tree_id, call = waiting.pop()
            if tree_id in opened and call is None:
                del opened[path.pop()]
                sizes[tree_id] = self._size(tree_id, sizes)
            elif tree_id in opened:
                begin = opened[tree_id]
                shown = path[begin:begin + 8] + ["…"] * (len(path) > begin + 8) + [tree_id]
                complain(rules.TREE_CIRCLE, call, "the tree {} contains itself: {}".format(
                    tree_id, " > ".join(shown)), attribute="ID")
            elif tree_id in self.calls and tree_id not in sizes:
                opened[tree_id] = len(path)
                path.append(tree_id)
                waiting.append((tree_id, None))
                waiting.extend((found.attributes.get("ID", ""), found) for found in reversed(self.calls[tree_id]))

    def _size(self, tree_id: str, sizes: Counter[str]) -> int:
        inner = sum(sizes[call.attributes.get("ID", "")] for call in self.calls[tree_id])
        return min(len(below(self.trees[tree_id])) + inner, _MANY)


# ----------------------------------------------------------------------------------------------------------- the nodes


class _Known(NamedTuple):
    """What the check of a node needs to know of its type."""

    spec: NodeSpec
    ports: Dict[str, Port]
    fewest: int  # children
    most: int


def _known(spec: NodeSpec) -> _Known:
    fewest, most = {Kind.CONTROL: (spec.fewest_children, sys.maxsize), Kind.DECORATOR: (1, 1)}.get(spec.kind, (0, 0))
    return _Known(spec, {port.name: port for port in spec.ports}, fewest, most)


class _Nodes:
    """Checks the nodes of trees."""

    def __init__(self, registry: Registry, index: _Index):
        self.registry = registry
        self.index = index
        self.fault = index.fault
        self.warn = index.warn
        self.is_used: bool  # the tree being checked is part of the mission
        self._known = {spec.id: _known(spec) for spec in registry.all() if spec.kind is not Kind.SUBTREE}
        self._scripts: Dict[str, Optional[ScriptSyntaxError]] = {}  # text -> what is wrong with it

    def check_tree(self, tree: Element, is_used: bool) -> None:
        """Check what is below a <BehaviorTree>. What BehaviorTree.CPP notices only when it makes a node is a warning
        in a tree that the mission does not use."""
        self.is_used = is_used
        for element in below(tree):
            found = self._identified(element)
            if found is None:
                continue
            if not found.fewest <= len(element.children) <= found.most:
                self._children(element, found)
            for name, text in element.attributes.items():
                self._attribute(element, found, name, text)

    def fault_in_use(self, rule: Rule, element: Element, text: str, hint: str = "", attribute: Optional[str] = None,
                     at: int = 0) -> None:
        """Record a fault of an element that may not be in use."""
        (self.fault if self.is_used else self.warn)(rule, element, text, hint, attribute, at)

    def _identified(self, element: Element) -> Optional[_Known]:
        """Return the node type that an element names; None if nothing more can be checked."""
        if element.tag == "SubTree":
            self._subtree(element)
            return None
        node_id = element.type_id
        if not node_id:
            self.index.no_id(element, "", "the ID is the node type")
            return None
        known = self._known.get(node_id)
        if known is None:
            self._unknown(element, node_id)
            return None
        if known.spec.warning:
            self.warn(rules.NODE_TYPE_WARNING, element, known.spec.warning)
        self._kinds_of_children(element, known.spec)
        if known.spec.names:
            self._name(element, known.spec)
        return known

    def _name(self, element: Element, spec: NodeSpec) -> None:
        """Check the name of a node whose name is its argument."""
        name = element.attributes.get("name", "")
        allowed = "allowed: name=\"…\" with {}".format(", ".join(spec.names))
        if not argument(name):
            self.fault_in_use(rules.NAME_ARGUMENT, element,
                              "{} takes an argument in its name, which is not given".format(spec.id), allowed)
        elif argument(name) not in spec.names:
            self.fault_in_use(rules.NAME_ARGUMENT, element, "the name of {} cannot be {}".format(spec.id, name),
                              allowed, "name")

    def _unknown(self, element: Element, node_id: str) -> None:
        attribute = "ID" if element.tag in EXPLICIT else None
        if node_id == "BehaviorTree":
            self.fault_in_use(rules.TREE_IN_TREE, element, "a <BehaviorTree> cannot stand inside another",
                              "call it with <SubTree ID=\"…\"/>")
        elif node_id in self.index.trees:
            self.fault(rules.TREE_AS_NODE, element, "{} is a tree, not a node".format(node_id),
                       "it is called with <SubTree ID=\"{}\"/>".format(node_id), attribute)
        else:
            hint = ELSEWHERE.get(node_id) or self.index.nearest(node_id, list(self._known) + ["SubTree"])
            self.fault(rules.UNKNOWN_NODE, element, "unknown node {}".format(node_id), hint, attribute)

    def _kinds_of_children(self, element: Element, spec: NodeSpec) -> None:
        for child in element.children if spec.refuses_explicit else ():
            if child.tag in EXPLICIT and child.type_id:
                self.fault(rules.EXPLICIT_IN_REACTIVE, child,
                           "BehaviorTree.CPP refuses <{}> directly below {}".format(child.tag, spec.id),
                           "write <{}/>".format(child.type_id))
        if sum(child.tag == spec.at_most_one for child in element.children) > 1:
            self.fault(rules.TWO_ASYNC, element, "a {} cannot have more than one {} child".format(
                spec.id, spec.at_most_one))

    def _children(self, element: Element, known: _Known) -> None:
        count, node_id = len(element.children), known.spec.id
        if known.most == 0:
            self.fault(rules.LEAF_CHILDREN, element, "{} is a leaf and cannot have children".format(node_id))
        elif known.most == 1:
            self.fault(rules.DECORATOR_CHILDREN, element,
                       "{} has {} children; a decorator must have exactly 1".format(node_id, count),
                       "put a Sequence around them" if count else "")
        elif known.fewest > 1:
            self.fault(rules.FEW_CHILDREN, element, "{} must have at least {} children: {}".format(
                node_id, known.fewest, known.spec.children))
        else:
            self.fault(rules.NO_CHILD, element, "{} has no child; it must have 1 or more".format(node_id))

    def _attribute(self, element: Element, known: _Known, name: str, text: str) -> None:
        port = known.ports.get(name)
        if name in CONDITIONS:
            self._script(element, name, text)
        elif port is not None:
            self._port(element, port, text)
        elif name == "ID":
            if element.tag not in EXPLICIT:
                self.fault_in_use(rules.ID_NOT_ALLOWED, element,
                                  "the attribute ID is not allowed in <{}>".format(element.tag),
                                  "write name=\"…\" for the name of the node", "ID")
        elif is_port_name(name):
            hint = _PORTS_ELSEWHERE.get((known.spec.id, name)) or condition_meant(name) or self.index.nearest(
                name, known.ports, "its ports")
            if known.spec.names:
                hint = "its argument is its name: {}".format(", ".join(known.spec.names))
            self.fault_in_use(rules.UNKNOWN_PORT, element, "{} has no port {}".format(known.spec.id, name), hint, name)

    def _port(self, element: Element, port: Port, text: str) -> None:
        wrong = ports.literal_fault(text, port, {})
        if wrong is not None:
            self.fault_in_use(rules.WRONG_LITERAL, element, "port {} of type {} cannot be \"{}\"".format(
                port.name, port.type, text), wrong, port.name)
        elif ports.reference(text, port.name) is not None:
            return
        elif port.role is Role.SCRIPT and text:
            self._script(element, port.name, text)
        else:
            self._unread(element, port, text, port.literal or port.type)

    def _unread(self, element: Element, port: Port, text: str, type_name: str) -> None:
        """Warn of a number that is followed by more than blanks: BehaviorTree.CPP ignores the rest."""
        said = read_in_part(text, port, type_name)
        if said:
            self.warn(rules.NUMBER_CUT_SHORT, element, "{}=\"{}\" {}".format(port.name, text, said[0]), said[1],
                      port.name)

    def _script(self, element: Element, name: str, text: str) -> None:
        if text not in self._scripts:
            self._scripts[text] = _script_fault(text)
        wrong = self._scripts[text]
        if wrong is not None:
            self.fault_in_use(rules.SCRIPT_SYNTAX, element, "the script of {} cannot be read: {}".format(
                name, wrong), wrong.hint or text, name, wrong.position)

    def _subtree(self, element: Element) -> None:
        tree_id = element.attributes.get("ID", "")
        for name, text in element.attributes.items():
            if name in CONDITIONS:
                self._script(element, name, text)
            elif name in _SUBTREE_ELSEWHERE:
                self.warn(rules.SUBTREE_OLD, element, "{} means nothing in version 4".format(name),
                          _SUBTREE_ELSEWHERE[name], name)
        if not tree_id:
            self.index.no_id(element, "", "the ID is that of a <BehaviorTree>")
        else:
            self.index.check_id(element, tree_id)
        if element.children:
            self.fault(rules.LEAF_CHILDREN, element, "<SubTree ID=\"{}\"> cannot have children".format(tree_id))
        if id(element) not in self.index.faulty:
            self._call(element, tree_id)

    def _call(self, element: Element, tree_id: str) -> None:
        if tree_id not in self.index.trees:
            self.index.faulty.add(id(element))
            if self.index.is_complete:
                self.fault_in_use(rules.UNKNOWN_TREE, element, "there is no tree {}".format(tree_id),
                                  self.index.nearest(tree_id, self.index.trees, "the trees"), "ID")
        try:
            remaps_all = values.TYPES["bool"].from_text(  # type: ignore[misc]
                element.attributes.get("_autoremap", "false"), {})
        except ValueFault as fault:
            self.fault_in_use(rules.AUTOREMAP_VALUE, element, str(fault), attribute="_autoremap")
            return
        for port in self.index.models.get(tree_id, ()):
            if not remaps_all and port.default is None and port.name not in element.attributes:
                self._missing(element, tree_id, port)
        if element.document.root.attributes.get("BTCPP_format") != "4":
            self._unbraced(element)

    def _missing(self, element: Element, tree_id: str, port: Port) -> None:
        """Record that a port of a tree's model is not given; at the attribute that is meant for it, if there is one."""
        known = [known.name for known in self.index.models[tree_id]]
        other = next((name for name in element.attributes if is_port_name(name) and name not in known
                      and did_you_mean(name, known) == did_you_mean(port.name, [port.name])), None)
        text = "the model of {} asks for the port {}, which is not given".format(tree_id, port.name)
        if other:
            self.fault_in_use(rules.MODEL_PORT_MISSING, element, "{}; it has no port {}".format(text, other),
                              "did you mean {}?".format(port.name), other)
        else:
            self.fault_in_use(rules.MODEL_PORT_MISSING, element, text, "write {0}=\"{{{0}}}\"".format(port.name))

    def _unbraced(self, element: Element) -> None:
        for name, text in element.attributes.items():
            if is_port_name(name) and text.isidentifier() and text not in ("true", "false"):
                self.warn(rules.UNBRACED, element, "{0}=\"{1}\" is the text {1} in version 4".format(name, text),
                          "the entry of that name is written {{{}}}".format(text), name)


def read_in_part(text: str, port: Port, type_name: str) -> Optional[Tuple[str, str]]:
    """Return what is read of a number that ``port`` does not read to its end, and what may be meant; else None."""
    rest = values.unread(text, type_name)
    if not rest:
        return None
    return "is read only up to \"{}\": as {}".format(rest, _read(text, type_name)), _meant(text, port, type_name)


def _read(text: str, type_name: str) -> str:
    """Return the value that a literal is read as, for a message."""
    try:
        value = values.TYPES[type_name].from_text(text, {})  # type: ignore[misc]
    except ValueFault as fault:
        return str(fault)
    return ";".join(map(str, value)) if isinstance(value, list) else str(value)


_THOUSANDS = re.compile(r"-?[0-9]{1,3}(?:[,._' ][0-9]{3})+")
_AMOUNT = re.compile(r"([0-9]+(?:[.,][0-9]+)?)\s*([a-z]+)", re.IGNORECASE)
_MILLISECONDS = {"ms": 1, "msec": 1, "s": 1000, "sec": 1000, "second": 1000, "seconds": 1000, "min": 60_000,
                 "minute": 60_000, "minutes": 60_000, "h": 3_600_000, "hour": 3_600_000, "hours": 3_600_000}


def _meant(text: str, port: Port, type_name: str) -> str:
    """Return what may be meant by a number that is read only in part."""
    amount = _AMOUNT.fullmatch(text.strip())
    number = values.whole_real(text.replace(",", "."))
    if amount is not None and port.name.endswith("msec") and amount.group(2).lower() in _MILLISECONDS:
        milliseconds = float(amount.group(1).replace(",", ".")) * _MILLISECONDS[amount.group(2).lower()]
        return "the number is of milliseconds: {} is {:.0f}".format(text, milliseconds)
    if _THOUSANDS.fullmatch(text):
        return "a number has no separators: write {}".format(re.sub("[^-0-9]", "", text))
    if number is None:
        return "the type is {}".format(type_name)
    if type_name == "double":
        return "write {}".format(text.replace(",", "."))
    return "the type is {}{}".format(type_name, ": write {:.0f}".format(number) if number.is_integer() else
                                     ", without fraction")


def condition_meant(name: str) -> str:
    """Return ``did you mean _…?`` if an attribute is a condition that lacks its underscore."""
    by_lower = {condition.lower(): condition for condition in CONDITIONS}
    near = difflib.get_close_matches("_" + name.lower(), list(by_lower), cutoff=0.8)
    return "did you mean {}?".format(by_lower[near[0]]) if near else ""


def _instead_of_id(element: Element, otherwise: str) -> Tuple[str, Optional[str]]:
    """Return a hint and the attribute it is about, for an element without the attribute ID."""
    other = next((name for name in element.attributes if name.lower() == "id"), None)
    return ("did you mean ID? write ID=\"{}\"".format(element.attributes[other]), other) if other else (otherwise, None)


def _script_fault(text: str) -> Optional[ScriptSyntaxError]:
    """Return what is wrong with the text of a script, or None."""
    if len(text) > LONGEST_SCRIPT:
        return ScriptSyntaxError("it has {} characters; at most {} are allowed".format(len(text), LONGEST_SCRIPT))
    try:
        compile_script(text)
    except ScriptSyntaxError as error:
        return error
    return None


def is_port_name(name: str) -> bool:
    """Return whether an attribute counts as a port: others, like ``_uid`` or ``xmlns:x``, have no meaning."""
    return (name[0].isalpha() and name[0].isascii() and name not in ("name", "ID")
            and not _FORBIDDEN.search(name))
