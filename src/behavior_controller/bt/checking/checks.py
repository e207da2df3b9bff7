"""What is wrong with a mission, seen without building it: structure, names, ports, literals, scripts (BT.CPP 12.3).

``check`` accepts what BehaviorTree.CPP's loader accepts, says everything wrong in one pass, and warns of what loads but
is likely a mistake. What depends on an instance (types of entries, paths of SubTrees) is the compiler's to find.
"""
import itertools
from typing import Callable, Collection, Dict, List, NamedTuple, Optional, Sequence, Set, Tuple

from behavior_controller.bt.engine.node import POST_CONDITIONS, PRE_CONDITIONS
from behavior_controller.bt.language import ports, values
from behavior_controller.bt.language.document import EXPLICIT, Document, Element
from behavior_controller.bt.language.script import ScriptSyntaxError, compile_script
from behavior_controller.bt.language.values import ValueFault
from behavior_controller.bt.registry import Kind, NodeSpec, Port, Registry, Role, argument, did_you_mean
from behavior_controller.errors import Fault

FORBIDDEN = " \t\n\r<>&\"'/\\:*?|."
CONDITIONS = PRE_CONDITIONS + POST_CONDITIONS
PORT_ELEMENTS = ("input_port", "output_port", "inout_port")
RESERVED_PORTS = ("name", "ID", "_autoremap") + CONDITIONS

MOST_NODES = 250_000  # a few SubTrees that each call the next twice would unfold without end
MOST_FAULTS = 1_000  # that are told, and as many warnings
LONGEST_SCRIPT = 20_000  # characters
_COMPARISONS = 20_000  # names compared for "did you mean", in all: each takes some 10 microseconds
_BELOW_ROOT = ("BehaviorTree", "include", "TreeNodesModel")

_BLACKBOARD_CHECK = "version 4 writes _skipIf, _failureIf or Precondition"
# what other versions and other tools call it
_ELSEWHERE = {
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
    "include": "it stands directly below <root>",
    "TreeNodesModel": "it stands directly below <root>",
}
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

    Without ``strict`` two things load that BehaviorTree.CPP refuses: where nothing names the main tree, the only one
    that no other tree calls is it (Groot2 drops the attribute when it saves); and the ID of a tree may contain blanks
    and dots (the published lab tour has such), with a warning.
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
    waiting = tree.children[::-1]
    while waiting:
        element = waiting.pop()
        found.append(element)
        if element.children:
            waiting.extend(element.children[::-1])
    return found


class _Faults:
    """Collects faults, and makes suggestions, both at a bounded cost."""

    def __init__(self) -> None:
        self.errors: List[Fault] = []
        self.warnings: List[Fault] = []
        self.faulty: Set[int] = set()
        self.unrecorded = 0
        self._comparisons = _COMPARISONS

    def fault(self, element: Element, text: str, hint: str = "", attribute: Optional[str] = None) -> None:
        """Record a fault; the element cannot be instantiated."""
        self.faulty.add(id(element))
        if len(self.errors) < MOST_FAULTS:
            self.errors.append(element.fault(text, hint, attribute))
        else:
            self.unrecorded += 1

    def warn(self, element: Element, text: str, hint: str = "", attribute: Optional[str] = None) -> None:
        if len(self.warnings) < MOST_FAULTS:
            self.warnings.append(element.fault(text, hint, attribute, is_warning=True))

    def all(self, file: str) -> List[Fault]:
        """Return every fault in the order of the files; the last may say that there are more in ``file``."""
        faults = sorted(self.errors + self.warnings, key=lambda fault: (fault.file, fault.line, fault.column))
        if self.unrecorded:
            faults.append(Fault(file, 0, 0, "{} more faults are not shown".format(self.unrecorded)))
        return faults

    def nearest(self, word: str, known: Collection[str], otherwise: str = "") -> str:
        """Return ``did you mean …?``, or ``otherwise`` and the known names if they are few."""
        if len(self.errors) >= MOST_FAULTS:
            return ""
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
        self.tolerated = tolerated  # letters in the ID of a tree that only earn a warning
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
            self.fault(root, "the first element is <{}>; it must be <root>".format(root.tag))
            return
        self._format(root)
        self.warnings.extend(document.stray_text(MOST_FAULTS - len(self.warnings)))
        models = [child for child in root.children if child.tag == "TreeNodesModel"]
        for extra in models[1:]:
            self.fault(extra, "a file may hold only one <TreeNodesModel>")
        for child in root.children:
            if child.tag == "BehaviorTree":
                self._tree(child, root)
            elif models and child.tag in EXPLICIT + ("SubTree",) and "ID" not in child.attributes:
                self.fault(child, "<{}> lacks the attribute ID".format(child.tag))
            elif child.tag not in _BELOW_ROOT:
                self.warn(child, "<{}> below <root> is ignored".format(child.tag), self.nearest(child.tag, _BELOW_ROOT))
        for model in models[:1]:
            self._models(model)

    def _format(self, root: Element) -> None:
        version = root.attributes.get("BTCPP_format")
        if version is None:
            self.warn(root, "<root> lacks BTCPP_format=\"4\"", "the file is read as version 4")
        elif version != "4":
            self.warn(root, "BTCPP_format is {}; the file is read as version 4".format(version),
                      attribute="BTCPP_format")

    def _tree(self, tree: Element, root: Element) -> None:
        tree_id = tree.attributes.get("ID", "")
        if not tree_id:
            if len(root.children) > 1:
                self.fault(tree, "<BehaviorTree> lacks the attribute ID",
                           "only a file with nothing else may go without")
            tree_id = "BehaviorTree_{}".format(len(self.trees) + 1)
        else:
            self.check_id(tree, tree_id)
        if tree_id in self.trees:
            first = self.trees[tree_id]
            self.warn(tree, "the tree {} is defined again; this one is used, not that of {}:{}".format(
                tree_id, first.document.file, first.place()[0]), attribute="ID")
        if len(tree.children) != 1:
            self.fault(tree, "<BehaviorTree ID=\"{}\"> has {} children; it must have exactly 1".format(
                tree_id, len(tree.children)), "put a Sequence around them" if tree.children else "")
        self.trees[tree_id] = tree
        self.bodies.append((tree_id, tree))

    def check_id(self, element: Element, tree_id: str) -> None:
        """Check the ID of a <BehaviorTree> or <SubTree>."""
        if tree_id in ("Root", "root"):
            self.fault(element, "{} is a reserved name; a tree cannot be called so".format(tree_id), attribute="ID")
        elif self.registry.find(tree_id) is not None:
            self.fault(element, "{} is the name of a node type; a tree cannot be called so".format(tree_id),
                       "a node of that type is written <{}/>".format(tree_id) if element.tag == "SubTree" else "", "ID")
        elif any(letter in FORBIDDEN or letter < " " or letter == "\x7f" for letter in tree_id):
            self._forbidden(element, tree_id)

    def _forbidden(self, element: Element, tree_id: str) -> None:
        bad = sorted({letter for letter in tree_id if letter in FORBIDDEN or letter < " " or letter == "\x7f"})
        shown = " and ".join(repr(letter) for letter in bad)
        if not set(bad) <= set(self.tolerated):
            self.fault(element, "the ID {} contains {}; not allowed are blanks and any of <>&\"'/\\:*?|.".format(
                tree_id, shown), attribute="ID")
        elif element.tag == "BehaviorTree":
            self.warn(element,
                      "the ID {} contains {}; BehaviorTree.CPP 4.10 refuses such a name".format(tree_id, shown),
                      attribute="ID")

    # ---------------------------------------------------------------------------------------------------------- models

    def _models(self, models: Element) -> None:
        for model in models.children:
            if model.tag != "SubTree":
                continue
            if "ID" not in model.attributes:
                self.fault(model, "<SubTree> in <TreeNodesModel> lacks the attribute ID")
                continue
            self.models[model.attributes["ID"]] = [
                Port(port.attributes["name"], default=port.attributes.get("default"))
                for port in model.children if port.tag in PORT_ELEMENTS and self._usable_port(port)]

    def _usable_port(self, port: Element) -> bool:
        name = port.attributes.get("name")
        if name is None:
            self.fault(port, "<{}> lacks the attribute name".format(port.tag))
        elif not name:
            self.fault(port, "the name of a port cannot be empty", attribute="name")
        elif name in RESERVED_PORTS:
            self.fault(port, "{} is a reserved attribute; a port cannot be called so".format(name), attribute="name")
        elif name[0] in "0123456789":
            self.fault(port, "the name of a port cannot start with a digit: {}".format(name), attribute="name")
        elif any(letter in FORBIDDEN or letter < " " for letter in name):
            self.fault(port, "the name of a port cannot contain blanks or any of <>&\"'/\\:*?|.: {}".format(name),
                       attribute="name")
        else:
            return True
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
            self.fault(root, "there is no tree {} to execute".format(named),
                       self.nearest(named, self.trees, "the trees"), None if wanted else "main_tree_to_execute")
            return ""
        if len(own) == 1 or len(self.trees) == 1:
            return own[0] if len(own) == 1 else next(iter(self.trees))
        called = {call.attributes.get("ID") for calls in self.calls.values() for call in calls}
        free = [tree_id for tree_id in self.trees if tree_id not in called]
        if guess and len(free) == 1:
            return free[0]
        if root.tag == "root":
            self._no_main_tree(root, free)
        return ""

    def _no_main_tree(self, root: Element, free: List[str]) -> None:
        if not self.trees:
            self.fault(root, "the file has no <BehaviorTree>")
            return
        why = "each tree is called by another"
        if free:
            why = "these trees are called by no other: {}".format(", ".join(free[:10]))
        self.fault(root, "main_tree_to_execute is not given, and {}".format(why),
                   "name the main tree in <root main_tree_to_execute=\"…\">")

    def check_calls(self, main: str) -> None:
        """Note which trees are used; find SubTrees that contain themselves, and missions that are too large."""
        sizes: Dict[str, int] = {}
        for start in [main] if main else list(self.trees):
            self._unfold(start, sizes, self.fault)
        self.used = set(sizes)
        if main and sizes.get(main, 0) > MOST_NODES:
            self.fault(self.trees[main], "the mission unfolds to {} nodes; at most {} are allowed".format(
                "more than a billion" if sizes[main] > 10 ** 9 else sizes[main], MOST_NODES), "call fewer SubTrees")
        for start in self.trees:
            self._unfold(start, sizes, self.warn)

    def _unfold(self, start: str, sizes: Dict[str, int], complain: Callable[..., None]) -> None:
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
                circle = path[opened[tree_id]:opened[tree_id] + 8]
                complain(call, "the tree {} contains itself: {}".format(tree_id, " > ".join(circle + [tree_id])),
                         attribute="ID")
            elif tree_id in self.calls and tree_id not in sizes:
                opened[tree_id] = len(path)
                path.append(tree_id)
                waiting.append((tree_id, None))
                waiting.extend((found.attributes.get("ID", ""), found) for found in reversed(self.calls[tree_id]))

    def _size(self, tree_id: str, sizes: Dict[str, int]) -> int:
        inner = sum(sizes.get(call.attributes.get("ID", ""), 0) for call in self.calls[tree_id])
        return min(len(below(self.trees[tree_id])) + inner, 10 ** 10)


# ----------------------------------------------------------------------------------------------------------- the nodes


class _Known(NamedTuple):
    """What the check of a node needs to know of its type."""

    spec: NodeSpec
    ports: Dict[str, Port]
    fewest: int  # children
    most: int

    @property
    def minds_children(self) -> bool:
        """Return whether it has rules about its children beside their number."""
        return self.spec.refuses_explicit or bool(self.spec.at_most_one)


def _known(spec: NodeSpec) -> _Known:
    fewest, most = {Kind.CONTROL: (spec.fewest_children, 10 ** 9), Kind.DECORATOR: (1, 1)}.get(spec.kind, (0, 0))
    return _Known(spec, {port.name: port for port in spec.ports}, fewest, most)


class _Nodes:
    """Checks the nodes of trees."""

    def __init__(self, registry: Registry, index: _Index):
        self.registry = registry
        self.index = index
        self.fault = index.fault
        self.warn = index.warn
        self.is_used = True  # the tree being checked is part of the mission
        self._known = {spec.id: _known(spec) for spec in registry.all() if spec.kind is not Kind.SUBTREE}
        self._compact = {name: known for name, known in self._known.items()
                         if name not in EXPLICIT and not known.minds_children
                         and not known.spec.warning and not known.spec.names}
        self._scripts: Dict[str, str] = {}  # text -> what is wrong with it

    def check_tree(self, tree: Element, is_used: bool) -> None:
        """Check what is below a <BehaviorTree>. What BehaviorTree.CPP notices only when it makes a node is a warning
        in a tree that the mission does not use."""
        self.is_used = is_used
        known = self._compact
        for element in below(tree):
            found = known.get(element.tag) or self._identified(element)
            if found is None:
                continue
            if not found.fewest <= len(element.children) <= found.most:
                self._children(element, found)
            for name, text in element.attributes.items():
                if name != "name":
                    self._attribute(element, found, name, text)

    def fault_in_use(self, element: Element, text: str, hint: str = "", attribute: Optional[str] = None) -> None:
        """Record a fault of an element that may not be in use."""
        (self.fault if self.is_used else self.warn)(element, text, hint, attribute)

    def _identified(self, element: Element) -> Optional[_Known]:
        """Return the node type that an element names; None if there is nothing more to check."""
        if element.tag == "SubTree":
            self._subtree(element)
            return None
        node_id = element.type_id
        if not node_id:
            self.fault(element, "<{}> lacks the attribute ID".format(element.tag), "the ID is the node type")
            return None
        known = self._known.get(node_id)
        if known is None:
            self._unknown(element, node_id)
            return None
        if known.spec.warning:
            self.warn(element, known.spec.warning)
        if known.minds_children:
            self._kinds_of_children(element, known.spec)
        if known.spec.names:
            self._name(element, known.spec)
        return known

    def _name(self, element: Element, spec: NodeSpec) -> None:
        """Check the name of a node whose name is its argument."""
        name = element.attributes.get("name", "")
        allowed = "allowed: name=\"…\" with {}".format(", ".join(spec.names))
        if not argument(name):
            self.fault_in_use(element, "{} takes an argument in its name, which is not given".format(spec.id), allowed)
        elif argument(name) not in spec.names:
            self.fault_in_use(element, "the name of {} cannot be {}".format(spec.id, name), allowed, "name")

    def _unknown(self, element: Element, node_id: str) -> None:
        attribute = "ID" if element.tag in EXPLICIT else None
        if node_id == "BehaviorTree":
            self.fault_in_use(element, "a <BehaviorTree> cannot stand inside another",
                              "call it with <SubTree ID=\"…\"/>")
        elif node_id in self.index.trees:
            self.fault(element, "{} is a tree, not a node".format(node_id),
                       "it is called with <SubTree ID=\"{}\"/>".format(node_id), attribute)
        else:
            hint = _ELSEWHERE.get(node_id) or self.index.nearest(node_id, list(self._known) + ["SubTree"])
            self.fault(element, "unknown node {}".format(node_id), hint, attribute)

    def _kinds_of_children(self, element: Element, spec: NodeSpec) -> None:
        for child in element.children if spec.refuses_explicit else ():
            if child.tag in EXPLICIT and child.type_id:
                self.fault(child, "BehaviorTree.CPP refuses <{}> directly below {}".format(child.tag, spec.id),
                           "write <{}/>".format(child.type_id))
        if spec.at_most_one and sum(child.tag == spec.at_most_one for child in element.children) > 1:
            self.fault(element, "a {} cannot have more than one {} child".format(spec.id, spec.at_most_one))

    def _children(self, element: Element, known: _Known) -> None:
        count, node_id = len(element.children), known.spec.id
        if known.most == 0:
            self.fault(element, "{} is a leaf and cannot have children".format(node_id))
        elif known.most == 1:
            self.fault(element, "{} has {} children; a decorator must have exactly 1".format(node_id, count),
                       "put a Sequence around them" if count else "")
        elif known.fewest > 1:
            self.fault(element, "{} must have at least {} children: {}".format(
                node_id, known.fewest, known.spec.children))
        else:
            self.fault(element, "{} has no child; it must have 1 or more".format(node_id))

    def _attribute(self, element: Element, known: _Known, name: str, text: str) -> None:
        port = known.ports.get(name)
        if name in CONDITIONS:
            self._script(element, name, text)
        elif port is not None:
            self._port(element, port, text)
        elif name == "ID":
            if element.tag not in EXPLICIT:
                self.fault_in_use(element, "the attribute ID is not allowed in <{}>".format(element.tag),
                                  "write name=\"…\" for the name of the node", "ID")
        elif is_port_name(name):
            hint = _PORTS_ELSEWHERE.get((known.spec.id, name)) or self.index.nearest(name, known.ports, "its ports")
            if known.spec.names:
                hint = "its argument is its name: {}".format(", ".join(known.spec.names))
            self.fault_in_use(element, "{} has no port {}".format(known.spec.id, name), hint, name)

    def _port(self, element: Element, port: Port, text: str) -> None:
        wrong = ports.literal_fault(text, port, {})
        if wrong is not None:
            self.fault_in_use(element, "port {} of type {} cannot be \"{}\"".format(port.name, port.type, text), wrong,
                              port.name)
        elif ports.reference(text, port.name) is not None:
            return
        elif port.role is Role.SCRIPT and text:
            self._script(element, port.name, text)
        else:
            self._unread(element, port, text, port.literal or port.type)

    def _unread(self, element: Element, port: Port, text: str, type_name: str) -> None:
        """Warn of a number that is followed by more than blanks: BehaviorTree.CPP reads it no further."""
        rest = values.unread(text, type_name)
        if rest:
            self.warn(element, "{}=\"{}\" is read only up to \"{}\": as {}".format(
                port.name, text, rest, _read(text, type_name)), "the type is {}".format(type_name), port.name)

    def _script(self, element: Element, name: str, text: str) -> None:
        wrong = self._scripts.get(text)
        if wrong is None:
            wrong = self._scripts[text] = _script_fault(text)
        if wrong:
            self.fault_in_use(element, "the script of {} cannot be read: {}".format(name, wrong), text, name)

    def _subtree(self, element: Element) -> None:
        tree_id = element.attributes.get("ID", "")
        for name, text in element.attributes.items():
            if name in CONDITIONS:
                self._script(element, name, text)
            elif name in _SUBTREE_ELSEWHERE:
                self.warn(element, "{} means nothing in version 4".format(name), _SUBTREE_ELSEWHERE[name], name)
        if not tree_id:
            self.fault(element, "<SubTree> lacks the attribute ID", "the ID is that of a <BehaviorTree>")
        else:
            self.index.check_id(element, tree_id)
        if element.children:
            self.fault(element, "<SubTree ID=\"{}\"> cannot have children".format(tree_id))
        if tree_id and id(element) not in self.index.faulty:
            self._call(element, tree_id)

    def _call(self, element: Element, tree_id: str) -> None:
        if tree_id not in self.index.trees:
            self.index.faulty.add(id(element))
            if self.index.is_complete:
                self.fault_in_use(element, "there is no tree {}".format(tree_id),
                                  self.index.nearest(tree_id, self.index.trees, "the trees"), "ID")
        try:
            remaps_all = values.TYPES["bool"].from_text(  # type: ignore[misc]
                element.attributes.get("_autoremap", "false"), {})
        except ValueFault as fault:
            self.fault_in_use(element, str(fault), attribute="_autoremap")
            return
        for port in self.index.models.get(tree_id, ()):
            if not remaps_all and port.default is None and port.name not in element.attributes:
                self.fault_in_use(element, "the model of {} asks for the port {}, which is not given".format(
                    tree_id, port.name), "write {0}=\"{{{0}}}\"".format(port.name))
        if element.document.root.attributes.get("BTCPP_format") != "4":
            self._unbraced(element)

    def _unbraced(self, element: Element) -> None:
        for name, text in element.attributes.items():
            if is_port_name(name) and text.isidentifier() and text not in ("true", "false"):
                self.warn(element, "{0}=\"{1}\" is the text {1} in version 4".format(name, text),
                          "the entry of that name is written {{{}}}".format(text), name)


def _read(text: str, type_name: str) -> str:
    """Return the value that a literal is read as, for a message."""
    try:
        value = values.TYPES[type_name].from_text(text, {})  # type: ignore[misc]
    except ValueFault as fault:
        return str(fault)
    return ";".join(map(str, value)) if isinstance(value, list) else str(value)


def _script_fault(text: str) -> str:
    """Return what is wrong with the text of a script, or nothing."""
    if len(text) > LONGEST_SCRIPT:
        return "it has {} characters; at most {} are allowed".format(len(text), LONGEST_SCRIPT)
    try:
        compile_script(text)
    except ScriptSyntaxError as error:
        return str(error)
    return ""


def is_port_name(name: str) -> bool:
    """Return whether an attribute is taken for a port: others, like ``_uid`` or ``xmlns:x``, mean nothing."""
    return (name[0].isalpha() and name[0].isascii() and name not in ("name", "ID")
            and not any(letter in FORBIDDEN for letter in name))
