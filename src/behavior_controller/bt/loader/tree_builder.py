"""Builds a tree from a checked mission: a node for each element, SubTrees unfolded, entries and
scripts bound."""
import sys
from functools import partial
from typing import Any, Callable, Dict, Iterator, List, NamedTuple, Optional, Sequence, Set, Tuple

from py_trees.behaviour import Behaviour

from behavior_controller.bt.loader import rules
from behavior_controller.bt.loader.structure import CONDITIONS, Trees, given, remaps_all
from behavior_controller.bt.loader.checks import check
from behavior_controller.bt.loader.blackboard_clients import Clients
from behavior_controller.bt.engine.clock import Clock
from behavior_controller.bt.engine.leaf import BehaviourLeaf
from behavior_controller.bt.engine.node import (
    PRE_CONDITIONS, ConfigureError, Node, Parent, Services)
from behavior_controller.bt.engine.substitution import Substitutions, TestNode
from behavior_controller.bt.engine.tree import Tree
from behavior_controller.wakeup import WakeUp
from behavior_controller.bt.engine import ports
from behavior_controller.bt.values.blackboard import Blackboard, Entry
from behavior_controller.bt.loader.document import Document, Element
from behavior_controller.bt.script.parser import ScriptSyntaxError, compile_script
from behavior_controller.bt.values.values import GENERIC, TEXT, ValueFault
from behavior_controller.bt.engine.node_types import Registry, class_fault
from behavior_controller.bt.engine.registry import Kind, NodeSpec, Port
from behavior_controller.errors import Fault, FaultsFound, MissionError
from behavior_controller.interpreter import garbage_collection_paused
from behavior_controller.text import Source

MAX_TREE_DEPTH = 2_500  # levels of the unfolded tree; a tick takes up to four Python frames a level
_FRAMES_PER_LEVEL = 4


@garbage_collection_paused()
def build(documents: Sequence[Document], registry: Registry, clock: Optional[Clock] = None,
          blackboard: Optional[Blackboard] = None, main_tree: Optional[str] = None,
          strict: bool = False, enums: Optional[Dict[str, int]] = None,
          substitutes: Optional[Dict[str, Any]] = None, wake: Optional[WakeUp] = None,
          lint: Callable[[Trees], List[Fault]] = lambda trees: trees.faults,
          checked: Optional[Trees] = None) -> Tree:
    """Check ``documents`` (the mission last), and build the tree. Raises MissionError with every
    fault.

    ``blackboard`` is the root's, with entries of the host; ``strict`` and ``main_tree``: see
    ``checks.check``; ``enums`` are names of integers for scripts; ``substitutes`` are substitution
    rules; ``clock`` and ``wake`` are those of a tree that the new one replaces; ``lint`` is
    ``walker.lint`` to add its warnings; ``checked`` is the result of ``checks.check``, to
    build another tree.
    """
    trees = checked or check(documents, registry, main_tree, strict)
    services = Services(clock or Clock(), wake or WakeUp(), enums or {})
    compiler = _Compiler(trees, services, Substitutions(substitutes or {}))
    services.clients = Clients(trees.main, registry)
    if trees.main and id(trees.trees[trees.main]) not in trees.findings.faulty:
        compiler.unfold(blackboard or Blackboard())
    faults = lint(trees)
    MissionError.raise_any(faults)
    sources = tuple(Source(document.file, document.text) for document in documents)
    return Tree(trees.main, compiler.nodes, compiler.blackboards, services, faults, sources)


class _Use(NamedTuple):
    """A port of a node that refers to an entry."""

    node: Node
    port: Port

    def __str__(self) -> str:
        """Return the port and the node type."""
        return f"{self.port.name} of {self.node.registration_id}"


class _Compiler:
    """Makes the nodes of one mission and adds the faults that only their making shows."""

    def __init__(self, trees: Trees, services: Services, substitutes: Substitutions):
        self.trees, self.registry = trees, trees.registry
        self.services, self.substitutes = services, substitutes
        self.nodes: List[Node] = []
        self.blackboards: Dict[str, Blackboard] = {}
        self.faults = trees.findings.errors
        self._defaults: Dict[str, Dict[str, str]] = {}  # node type -> its entries by default
        self._classes: Set[type] = set()  # of nodes
        self._clashes: List[Tuple[ports.TypeClash, _Use]] = []
        # the entries that calls give a number, with the call and the attribute
        self._numbers: Dict[int, Tuple[Element, str]] = {}

    def unfold(self, blackboard: Blackboard) -> None:
        """Make every node, parents before children, in document order."""
        self.blackboards[""], deepest = blackboard, 0
        stack: List[Tuple[Element, Optional[Node], Blackboard, int]] = [
            (child, None, blackboard, 1) for child in self.trees.trees[self.trees.main].children]
        while stack:
            element, parent, blackboard, depth = stack.pop()
            deepest = max(deepest, depth)
            if depth > MAX_TREE_DEPTH:
                text = f"the mission unfolds to more than {MAX_TREE_DEPTH} levels"
                self.faults.append(element.fault(rules.TOO_LARGE, text))
                break
            children = element.children
            # a node that cannot be made is None, but its content may have mistakes too
            parent = self._node(element, parent, blackboard)
            if parent is not None:
                depth += 1
                if parent.spec.kind is Kind.SUBTREE:
                    blackboard = self._enter(element, blackboard, parent)
                    children = self.trees.trees[element.attributes["ID"]].children
            for child in reversed(children):
                stack.append((child, parent, blackboard, depth))
        self.faults += dict.fromkeys(self._blamed(*clash) for clash in self._clashes)
        sys.setrecursionlimit(max(sys.getrecursionlimit(), 1000 + _FRAMES_PER_LEVEL * deepest))

    def _node(self, element: Element, parent: Optional[Node],
              blackboard: Blackboard) -> Optional[Node]:
        """Make the node of an element; None, with a fault, if it cannot be made."""
        if id(element) in self.trees.findings.faulty:
            return None
        uid, type_id = len(self.nodes) + 1, element.type_id
        own_id = type_id
        if type_id == "SubTree":
            own_id = element.attributes["ID"]
        name = element.attributes.get("name", own_id)
        path = blackboard.prefix + name
        if name == own_id:
            path = f"{path}::{uid}"
        spec, node = self._made(type_id, name, path, element)
        if node is None:
            return None
        node.element, node.uid, node.registration_id, node.full_path = element, uid, type_id, path
        node.blackboard, node.services = blackboard, self.services
        node.spec, node.attributes = spec, element.attributes
        defaults = self._defaults.get(spec.id)
        if defaults is None:
            defaults = self._defaults[spec.id] = ports.defaults(spec.ports)
        if defaults:
            node.attributes = dict(defaults, **element.attributes)
        self.nodes.append(node)
        if isinstance(parent, Parent):
            parent.adopt(node)
        if parent is not None:
            node.is_apart = parent.is_apart or node.parent is None
        self._bind(element, node)
        return node

    def _made(self, type_id: str, name: str, path: str,
              element: Element) -> Tuple[NodeSpec, Optional[Node]]:
        spec = self.registry[type_id]
        if self.substitutes.rules:
            target = self.substitutes.target(name, type_id, path)
            config = self.substitutes.configs.get(target or "")
            if config is not None:
                spec = NodeSpec(target or "", Kind.ACTION, partial(TestNode, config=config))
            elif target is not None:
                spec = self.registry.get(target, spec)
                if spec.id != target:
                    text = f"the substitute {target} is not a node type"
                    self.faults.append(element.fault(rules.SUBSTITUTE_UNKNOWN, text))
        try:
            node: Any = spec.factory(name)
            if type(node) in self._classes:
                return spec, node
            if isinstance(node, Behaviour) and not hasattr(node, "children"):
                raise TypeError("its __init__ does not call super().__init__(name)")
            is_foreign = isinstance(node, Behaviour) and not isinstance(node, Node)
            if is_foreign and spec.kind in (Kind.ACTION, Kind.CONDITION):
                node = BehaviourLeaf(name, node)
            if not isinstance(node, Node):
                kind = "node of ours: a py_trees behaviour is a leaf" if is_foreign else "node"
                raise TypeError(f"its factory returned {node!r}, which is not a {kind}")
            fault = class_fault(spec, type(node))
            if fault:
                self.faults.append(element.fault(rules.NODE_BROKEN, fault))
                return spec, None
            self._classes.add(type(node))
        except BaseException as error:  # a leaf may raise anything
            self.faults.append(element.broken(spec.id, "made", error, spec.factory))
            return spec, None
        return spec, node

    def _bind(self, element: Element, node: Node) -> None:
        """Create the entries that ports refer to, and set the scripts."""
        attribute: Optional[str] = None
        rule = rules.ENTRY_TYPE
        known = {} if element.tag == "SubTree" else node.spec.port_named
        try:
            scripts = {}
            for attribute, text in element.attributes.items():
                if attribute == "name":
                    continue
                if attribute in known:
                    ports.declare(text, known[attribute], node.blackboard)
                elif attribute in CONDITIONS:
                    scripts[attribute] = compile_script(text)
            attribute, rule = None, rules.NODE_REFUSES
            if scripts:
                interception = node.intercepted()
                interception.conditions = [
                    (name, scripts[name]) for name in PRE_CONDITIONS if name in scripts]
                interception.scripts = scripts
            node.configure()
        except ports.TypeClash as clash:
            self._clashes.append((clash, _Use(node, clash.port)))
        except ConfigureError as error:
            self.faults.append(
                element.fault(rules.NODE_REFUSES, str(error), attribute=error.attribute))
        except FaultsFound as error:  # of a file that the leaf reads
            self.faults += error.faults
        except (ValueFault, ScriptSyntaxError) as error:
            self.faults.append(element.fault(rule, str(error), attribute=attribute))
        except BaseException as error:  # ``configure`` of a leaf may raise anything
            self.faults.append(element.broken(node.spec.id, "made", error, type(node)))

    def _blamed(self, clash: ports.TypeClash, blamed: _Use) -> Fault:
        """Return the fault of a type clash: of the number that a call gives, of the first use of
        the entry if it is alone with its type, else of the use ``blamed``."""
        text = str(clash)
        if id(clash.entry) in self._numbers:
            call, name = self._numbers[id(clash.entry)]
            giver, attribute = self.trees.giver(call, name)
            where = blamed.node.element.where(blamed.port.name)
            text = (f"{name}=\"{giver.attributes[attribute]}\" is of type {clash.entry.type}, "
                    f"and {blamed} ({where}) is not")
            hint = "give it an entry that a script sets"
            return giver.fault(rules.ENTRY_TYPE, text, hint, attribute)
        uses = list(self._uses(clash.entry))
        if uses:  # otherwise the host made the entry
            other, alike = uses[0], [use for use in uses if use.port.type == blamed.port.type]
            if len(alike) > 1 and sum(use.port.type == other.port.type for use in uses) == 1:
                blamed, other = other, alike[0]
            key = blamed.node.attributes[blamed.port.name]
            where = other.node.element.where(other.port.name)
            text = (f"{key}: {blamed} is of type {blamed.port.type}, "
                    f"and {other} ({where}) is of type {other.port.type}")
        return blamed.node.element.fault(rules.ENTRY_TYPE, text, attribute=blamed.port.name)

    def _uses(self, entry: Entry) -> Iterator[_Use]:
        """Yield the ports of one type each that refer to an entry, in the order of the nodes."""
        for node in self.nodes:
            for name, text in node.element.attributes.items():
                port, key = node.spec.port_named.get(name), ports.reference(text, name)
                if (port is not None and port.type not in GENERIC + (TEXT,)
                        and key is not None and node.blackboard.find(key) is entry):
                    yield _Use(node, port)

    def _enter(self, element: Element, outer: Blackboard, node: Node) -> Blackboard:
        """Return the blackboard of what is inside a SubTree."""
        tree_id = element.attributes["ID"]
        path = outer.prefix + element.attributes.get("name", f"{tree_id}::{node.uid}")
        if path in self.blackboards:
            wrong = f"two SubTrees have the same path {path}"
            hint = "give them different names, or none"
            self.faults.append(element.fault(rules.SAME_PATH, wrong, hint, "name"))
        inner = self.blackboards[path] = Blackboard(outer, path)
        for name, text in given(element, self.trees.models.get(tree_id, ())).items():
            entry = ports.subtree_reference(text, name)
            if entry is not None:
                inner.remapping[name] = entry
            elif text is not None:
                value_type, value = ports.subtree_literal(text)
                inner.set(name, value, value_type)
                self._numbers[id(inner.find(name))] = element, name
        inner.autoremap = remaps_all(element)  # not before the literals have found their place here
        return inner
