"""What is wrong with a mission, seen without building it: structure, names, ports, literals, scripts (BT.CPP section 12.3).

``check`` accepts what BehaviorTree.CPP's loader accepts, says everything wrong in one pass, and warns of what loads but is
likely a mistake. What depends on an instance (types of entries, paths of SubTrees) is the compiler's to find.
"""
from typing import Dict, Iterator, List, NamedTuple, Optional, Sequence, Set, Tuple

from behavior_controller.bt import ports, values
from behavior_controller.bt.document import EXPLICIT, Document, Element
from behavior_controller.bt.node import POST_CONDITIONS, PRE_CONDITIONS
from behavior_controller.bt.registry import Kind, NodeSpec, Port, Registry, did_you_mean
from behavior_controller.bt.script import ScriptSyntaxError, compile_script
from behavior_controller.bt.values import ValueFault
from behavior_controller.errors import Fault

FORBIDDEN = " \t\n\r<>&\"'/\\:*?|."
CONDITIONS = PRE_CONDITIONS + POST_CONDITIONS
PORT_ELEMENTS = ("input_port", "output_port", "inout_port")
RESERVED_PORTS = ("name", "ID", "_autoremap") + CONDITIONS

_VERSION_3 = {
    "SubTreePlus": "version 4 writes <SubTree>, and _autoremap for __autoremap",
    "SequenceStar": "version 4 calls it SequenceWithMemory",
    "RetryUntilSuccesful": "version 4 spells it RetryUntilSuccessful",
    "BlackboardCheckInt": "version 4 writes a Precondition, or _skipIf and its like",
    "BlackboardCheckDouble": "version 4 writes a Precondition, or _skipIf and its like",
    "BlackboardCheckString": "version 4 writes a Precondition, or _skipIf and its like",
    "BlackboardCheckBool": "version 4 writes a Precondition, or _skipIf and its like",
}


class Checked(NamedTuple):
    """The trees of a mission by ID, which one is the main tree, SubTree models, and every fault found."""

    trees: Dict[str, Element]
    main: str
    models: Dict[str, List[Port]]
    faults: List[Fault]
    faulty: Set[int]  # id() of elements that cannot be instantiated

    @property
    def errors(self) -> List[Fault]:
        """The faults that keep the mission from loading."""
        return [fault for fault in self.faults if not fault.is_warning]


def check(documents: Sequence[Document], registry: Registry, main_tree: Optional[str] = None,
          strict: bool = False) -> Checked:
    """Check ``documents``, included ones first, the mission itself last. ``main_tree`` overrides the file's choice.

    Without ``strict`` two things load that BehaviorTree.CPP refuses: where nothing names the main tree, the only one that
    no other tree calls is it (Groot2 drops the attribute when it saves); and the ID of a tree may contain blanks and dots
    (the published lab tour has such), with a warning.
    """
    checker = _Checker(registry, "" if strict else " .")
    for document in documents:
        checker.document(document)
    checker.collect_calls()
    main = checker.main_tree(documents[-1], main_tree, not strict)
    checker.find_used(main)
    checker.check_trees()
    checker.check_cycles(main)
    return Checked(checker.trees, main, checker.models, checker.faults, checker.faulty)


class _Checker:
    def __init__(self, registry: Registry, tolerated: str):
        self.registry = registry
        self.tolerated = tolerated  # letters in the ID of a tree that only earn a warning
        self.trees: Dict[str, Element] = {}
        self.models: Dict[str, List[Port]] = {}
        self.faults: List[Fault] = []
        self.faulty: Set[int] = set()
        self.calls: Dict[str, List[Element]] = {}  # tree -> its SubTree elements
        self.used: Set[str] = set()
        self.is_used = True  # the tree being checked is part of the mission

    def fault(self, element: Element, text: str, hint: str = "", attribute: Optional[str] = None) -> None:
        """Record a fault; the element cannot be instantiated."""
        self.faults.append(element.fault(text, hint, attribute))
        self.faulty.add(id(element))

    def fault_in_use(self, element: Element, text: str, hint: str = "", attribute: Optional[str] = None) -> None:
        """Record what BehaviorTree.CPP notices only when it makes the node: in a tree that nothing uses, a warning."""
        (self.fault if self.is_used else self.warn)(element, text, hint, attribute)

    def warn(self, element: Element, text: str, hint: str = "", attribute: Optional[str] = None) -> None:
        """Record a warning."""
        self.faults.append(element.fault(text, hint, attribute, is_warning=True))

    # ------------------------------------------------------------------------------------------------------- documents

    def document(self, document: Document) -> None:
        """Collect the trees and models of one file."""
        root = document.root
        if root.tag != "root":
            self.fault(root, "the first element is <{}>; it must be <root>".format(root.tag))
            return
        if "BTCPP_format" not in root.attributes:
            self.warn(root, "<root> lacks BTCPP_format=\"4\"", "the file is read as version 4")
        elif root.attributes["BTCPP_format"] != "4":
            self.warn(root, "BTCPP_format is {}; the file is read as version 4".format(
                root.attributes["BTCPP_format"]), attribute="BTCPP_format")
        models = [child for child in root.children if child.tag == "TreeNodesModel"]
        for extra in models[1:]:
            self.fault(extra, "a file may hold only one <TreeNodesModel>")
        for child in root.children:
            if child.tag == "BehaviorTree":
                self._tree(child, root)
            elif models and child.tag in EXPLICIT + ("SubTree",) and "ID" not in child.attributes:
                self.fault(child, "<{}> lacks the attribute ID".format(child.tag))
            elif child.tag not in ("include", "TreeNodesModel"):
                self.warn(child, "<{}> below <root> is ignored".format(child.tag),
                          did_you_mean(child.tag, ("BehaviorTree", "include", "TreeNodesModel")))
        for model in models[:1]:
            self._models(model)

    def _tree(self, tree: Element, root: Element) -> None:
        tree_id = tree.attributes.get("ID", "")
        if not tree_id:
            if len(root.children) > 1:
                self.fault(tree, "<BehaviorTree> lacks the attribute ID", "only a file with nothing else may go without")
                return
            tree_id = "BehaviorTree_{}".format(len(self.trees) + 1)
        elif not self._usable_id(tree, tree_id):
            return
        if tree_id in self.trees:
            line, _ = self.trees[tree_id].place()
            self.warn(tree, "the tree {} is defined again; this one is used, not that of {}:{}".format(
                tree_id, self.trees[tree_id].document.file, line), attribute="ID")
        if len(tree.children) != 1:
            self.fault(tree, "<BehaviorTree ID=\"{}\"> has {} children; it must have exactly 1".format(
                tree_id, len(tree.children)), "put a Sequence around them" if tree.children else "")
        self.trees[tree_id] = tree

    def _usable_id(self, element: Element, tree_id: str) -> bool:
        if tree_id in ("Root", "root"):
            self.fault(element, "{} is a reserved name; a tree cannot be called so".format(tree_id), attribute="ID")
        elif self.registry.find(tree_id) is not None:
            self.fault(element, "{} is the name of a node type; a tree cannot be called so".format(tree_id), attribute="ID")
        elif any(ord(letter) < 32 or letter == "\x7f" for letter in tree_id):
            self.fault(element, "the ID {!r} contains a control character".format(tree_id), attribute="ID")
        elif self._has_forbidden(element, tree_id):
            pass
        else:
            return True
        return False

    def _has_forbidden(self, element: Element, tree_id: str) -> bool:
        bad = sorted(set(tree_id) & set(FORBIDDEN))
        if not bad:
            return False
        if set(bad) <= set(self.tolerated):
            self.warn(element, "the ID {} contains {}; BehaviorTree.CPP 4.10 refuses such a name".format(
                tree_id, " and ".join(repr(letter) for letter in bad)), attribute="ID")
            return False
        self.fault(element, "the ID {} contains {}; not allowed are blanks and any of <>&\"'/\\:*?|.".format(
            tree_id, " and ".join(repr(letter) for letter in bad)), attribute="ID")
        return True

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
        elif name[0].isdigit():
            self.fault(port, "the name of a port cannot start with a digit: {}".format(name), attribute="name")
        elif set(name) & set(FORBIDDEN):
            self.fault(port, "the name of a port cannot contain blanks or any of <>&\"'/\\:*?|.: {}".format(name),
                       attribute="name")
        else:
            return True
        return False

    # ----------------------------------------------------------------------------------------------------------- trees

    def collect_calls(self) -> None:
        """Note which trees each tree calls."""
        for tree_id, tree in self.trees.items():
            self.calls[tree_id] = [element for _, element in _below(tree) if element.tag == "SubTree"]

    def find_used(self, main: str) -> None:
        """Note which trees are part of the mission; all, if there is no main tree."""
        waiting = [main] if main else list(self.trees)
        while waiting:
            tree_id = waiting.pop()
            if tree_id in self.calls and tree_id not in self.used:
                self.used.add(tree_id)
                waiting.extend(call.attributes.get("ID", "") for call in self.calls[tree_id])

    def check_trees(self) -> None:
        """Check the nodes of every tree."""
        for tree_id, tree in self.trees.items():
            self.is_used = tree_id in self.used
            for parent, element in _below(tree):
                self._node(parent, element)

    def _node(self, parent: Element, element: Element) -> None:
        if element.tag == "SubTree":
            self._subtree(element)
            return
        node_id = element.type_id
        if element.tag in EXPLICIT:
            if not node_id:
                self.fault(element, "<{}> lacks the attribute ID".format(element.tag), "the ID is the node type")
                return
            if parent.type_id == "ReactiveSequence":
                self.fault(element, "BehaviorTree.CPP refuses <{}> directly below ReactiveSequence".format(element.tag),
                           "write <{}/>".format(node_id))
        elif "ID" in element.attributes:
            self.fault_in_use(element, "the attribute ID is not allowed in <{}>".format(element.tag),
                       "write name=\"…\" for the name of the node", "ID")
        spec = self.registry.find(node_id)
        if spec is None or spec.kind is Kind.SUBTREE:
            self._unknown(element, node_id)
            return
        if spec.warning:
            self.warn(element, spec.warning)
        self._children(element, spec)
        self._attributes(element, spec)

    def _unknown(self, element: Element, node_id: str) -> None:
        if node_id == "BehaviorTree":
            self.fault_in_use(element, "a <BehaviorTree> cannot stand inside another", "call it with <SubTree ID=\"…\"/>")
            return
        hint = _VERSION_3.get(node_id) or did_you_mean(node_id, [spec.id for spec in self.registry.all()])
        if not hint and node_id in self.trees:
            hint = "a tree is called with <SubTree ID=\"{}\"/>".format(node_id)
        self.fault(element, "unknown node {}".format(node_id), hint, "ID" if element.tag in EXPLICIT else None)

    def _children(self, element: Element, spec: NodeSpec) -> None:
        count = len(element.children)
        if spec.kind is Kind.DECORATOR and count != 1:
            self.fault(element, "{} has {} children; a decorator must have exactly 1".format(spec.id, count))
        elif spec.kind is Kind.CONTROL and count == 0:
            self.fault(element, "{} has no child; it must have 1 or more".format(spec.id))
        elif spec.kind in (Kind.ACTION, Kind.CONDITION) and count:
            self.fault(element, "{} is a leaf and cannot have children".format(spec.id))
        elif spec.id == "TryCatch" and count < 2:
            self.fault(element, "TryCatch must have at least 2 children: the last is the one that catches")
        elif spec.id == "ReactiveSequence" and sum(child.tag == "AsyncSequence" for child in element.children) > 1:
            self.fault(element, "a ReactiveSequence cannot have more than one AsyncSequence child")

    def _attributes(self, element: Element, spec: NodeSpec) -> None:
        self._instance_name(element)
        by_name = {port.name: port for port in spec.ports}
        for name, text in element.attributes.items():
            if name in CONDITIONS:
                self._condition(element, name, text)
            elif is_port_name(name):
                port = by_name.get(name)
                if port is None:
                    known = ", ".join(by_name) or "none"
                    self.fault_in_use(element, "{} has no port {}".format(spec.id, name),
                                      did_you_mean(name, by_name) or "its ports: {}".format(known), name)
                else:
                    self._literal(element, port, text)

    def _instance_name(self, element: Element) -> None:
        name = element.attributes.get("name", "")
        if any(ord(letter) < 32 and letter not in "\t\n\r" for letter in name):
            self.fault_in_use(element, "the name {!r} contains a control character".format(name), attribute="name")

    def _literal(self, element: Element, port: Port, text: str) -> None:
        wrong = ports.literal_fault(text, port, {})
        if wrong is not None:
            self.fault_in_use(element, "port {} of type {} cannot be \"{}\"".format(port.name, port.type, text[:60]),
                              wrong, port.name)

    def _condition(self, element: Element, name: str, text: str) -> None:
        try:
            compile_script(text)
        except ScriptSyntaxError as error:
            self.fault_in_use(element, "the script of {} cannot be read: {}".format(name, error), attribute=name)

    def _subtree(self, element: Element) -> None:
        tree_id = element.attributes.get("ID", "")
        self._instance_name(element)
        for name, text in element.attributes.items():
            if name in CONDITIONS:
                self._condition(element, name, text)
        if not tree_id:
            self.fault(element, "<SubTree> lacks the attribute ID", "the ID is that of a <BehaviorTree>")
        elif element.children:
            self.fault(element, "<SubTree ID=\"{}\"> cannot have children".format(tree_id))
        elif self._usable_id(element, tree_id):
            self._subtree_attributes(element, tree_id)

    def _subtree_attributes(self, element: Element, tree_id: str) -> None:
        if tree_id not in self.trees:
            self.fault_in_use(element, "there is no tree {}".format(tree_id), did_you_mean(tree_id, self.trees)
                       or "the trees: {}".format(", ".join(sorted(self.trees)[:10])), "ID")
        autoremap = element.attributes.get("_autoremap", "false")
        try:
            remaps_all = values.TYPES["bool"].from_text(autoremap, {})  # type: ignore[misc]
        except ValueFault as fault:
            self.fault_in_use(element, str(fault), attribute="_autoremap")
            return
        for port in self.models.get(tree_id, ()):
            if not remaps_all and port.default is None and port.name not in element.attributes:
                self.fault_in_use(element, "the model of {} asks for the port {}, which is not given".format(tree_id, port.name))
        for old in ("__shared_blackboard", "__autoremap"):
            if old in element.attributes:
                self.warn(element, "{} means nothing in version 4".format(old), "write _autoremap=\"true\"", old)

    # ------------------------------------------------------------------------------------------------- the whole mission

    def main_tree(self, document: Document, wanted: Optional[str], guess: bool) -> str:
        """Return the ID of the main tree, or an empty text if there is a fault."""
        root = document.root
        named = wanted or root.attributes.get("main_tree_to_execute")
        if named:
            if named in self.trees:
                return named
            self.fault(root, "there is no tree {} to execute".format(named), did_you_mean(named, self.trees)
                       or "the trees: {}".format(", ".join(sorted(self.trees)[:10]) or "none"),
                       None if wanted else "main_tree_to_execute")
            return ""
        own = [tree_id for tree_id, tree in self.trees.items() if tree.document is document]
        if len(own) == 1:
            return own[0]
        if len(self.trees) == 1:
            return next(iter(self.trees))
        called = {call.attributes.get("ID") for calls in self.calls.values() for call in calls}
        free = [tree_id for tree_id in self.trees if tree_id not in called]
        if guess and len(free) == 1:
            return free[0]
        if root.tag == "root":
            self.fault(root, "main_tree_to_execute is not given, and {}".format(
                "no tree is left that no other calls" if not free else
                "these trees are called by no other: {}".format(", ".join(free[:10]))) if self.trees else
                "the file has no <BehaviorTree>", "name one in <root main_tree_to_execute=\"…\">" if self.trees else "")
        return ""

    def check_cycles(self, main: str) -> None:
        """Find SubTrees that contain themselves."""
        open_, done = 1, 2
        state: Dict[str, int] = {}
        for start in [main] if main else list(self.trees):
            path: List[str] = []
            waiting: List[Tuple[str, Optional[Element]]] = [(start, None)]
            while waiting:
                tree_id, call = waiting.pop()
                if not tree_id:
                    state[path.pop()] = done
                elif state.get(tree_id) == open_ and call is not None:
                    self.fault(call, "the tree {} contains itself: {}".format(
                        tree_id, " > ".join(path[path.index(tree_id):] + [tree_id])), attribute="ID")
                elif tree_id in self.calls and tree_id not in state:
                    state[tree_id] = open_
                    path.append(tree_id)
                    waiting.append(("", None))
                    waiting.extend((inner.attributes.get("ID", " "), inner) for inner in reversed(self.calls[tree_id]))


def _below(tree: Element) -> Iterator[Tuple[Element, Element]]:
    """Yield (parent, element) for everything below ``tree``, in document order."""
    # a loop, not recursion: a file may be nested deeper than Python's stack
    waiting = [(tree, child) for child in reversed(tree.children)]
    while waiting:
        parent, element = waiting.pop()
        yield parent, element
        waiting.extend((element, child) for child in reversed(element.children))


def is_port_name(name: str) -> bool:
    """Return whether an attribute is taken for a port: others, like ``_uid`` or ``xmlns:x``, mean nothing."""
    return (name[0].isalpha() and name[0].isascii() and name not in ("name", "ID")
            and not any(letter in FORBIDDEN for letter in name))

