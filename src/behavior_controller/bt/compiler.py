"""Builds a tree from a checked mission: a node for each element, SubTrees unfolded, entries and scripts bound."""
import sys
from typing import Any, Dict, List, NamedTuple, Optional, Sequence, Tuple

from py_trees.behaviour import Behaviour

from behavior_controller.bt import rules
from behavior_controller.bt.checking.checks import CONDITIONS, Checked, check, is_port_name
from behavior_controller.bt.checking.lint import lint
from behavior_controller.bt.checking.models import stale_models
from behavior_controller.bt.clients import Clients
from behavior_controller.bt.engine.clock import Clock
from behavior_controller.bt.engine.leaf import BehaviourLeaf
from behavior_controller.bt.engine.node import POST_CONDITIONS, PRE_CONDITIONS, ConfigureError, Node, Services
from behavior_controller.bt.engine.substitution import Substitutions, TestNode, substitutions
from behavior_controller.bt.engine.tree import Tree
from behavior_controller.bt.engine.wakeup import WakeUp
from behavior_controller.bt.language import ports
from behavior_controller.bt.language.blackboard import Blackboard
from behavior_controller.bt.language.document import Document, Element, garbage_collection_paused, parse, read, with_includes
from behavior_controller.bt.language.script import Script, ScriptSyntaxError, compile_script
from behavior_controller.bt.language.values import TYPES, ValueFault
from behavior_controller.bt.registry import Kind, NodeSpec, Port, Registry
from behavior_controller.errors import Fault, MissionError
from behavior_controller.text import Source

DEEPEST = 2_500  # levels of the unfolded tree; a tick takes up to four Python frames a level
_FRAMES_PER_LEVEL = 4


def load_mission(path: str, registry: Registry, **options: Any) -> Tree:
    """Read a mission file and what it includes, and ``build`` it with ``options``. Raises MissionError."""
    return build(with_includes(read(path)), registry, **options)


def load_text(text: str, registry: Registry, file: str = "<text>", **options: Any) -> Tree:
    """As ``load_mission``, for a mission that is not a file. Includes are relative to the working directory."""
    return build(with_includes(parse(text, file)), registry, **options)


def build(documents: Sequence[Document], registry: Registry, clock: Optional[Clock] = None,
          blackboard: Optional[Blackboard] = None, main_tree: Optional[str] = None, strict: bool = False,
          enums: Optional[Dict[str, int]] = None, rules: Optional[Dict[str, Any]] = None,
          wake: Optional[WakeUp] = None, with_lint: bool = False) -> Tree:
    """Check ``documents`` (the mission last), and build the tree. Raises MissionError with every fault.

    ``blackboard`` is the root's, with entries of the host; ``strict`` and ``main_tree``: see ``checks.check``;
    ``enums`` are names of integers for scripts; ``rules`` are substitution rules; ``clock`` and ``wake`` are those of
    a tree that the new one replaces; ``with_lint`` adds the linter's warnings.
    """
    with garbage_collection_paused():
        checked = check(documents, registry, main_tree, strict)
        compiler = _Compiler(checked, registry, Services(clock or Clock(), enums, wake), substitutions(rules or {}))
        compiler.services.clients = Clients(checked.main, compiler.blackboards, registry)
        if checked.main and id(checked.trees[checked.main]) not in checked.faulty:
            compiler.unfold(blackboard if blackboard is not None else Blackboard())
    faults = list(dict.fromkeys(checked.faults + compiler.faults))
    if any(not fault.is_warning for fault in faults):
        raise MissionError(sorted(faults, key=_by_place))
    if with_lint:
        faults += stale_models(documents, registry) + lint(documents, checked, registry)
        faults.sort(key=_by_place)
    return Tree(checked.main, compiler.nodes, compiler.blackboards, compiler.services, faults,
                tuple(Source(document.file, document.text) for document in documents))


def _by_place(fault: Fault) -> Tuple[str, int, int]:
    return fault.file, fault.line, fault.column


class _Place(NamedTuple):
    """Where an element is to be made: below which node, on which blackboard, under which path."""

    element: Element
    parent: Optional[Node]
    blackboard: Blackboard
    prefix: str
    depth: int


class _Compiler:
    """Makes the nodes of one mission and collects the faults that only their making shows."""

    def __init__(self, checked: Checked, registry: Registry, services: Services, rules: Substitutions):
        self.checked = checked
        self.registry = registry
        self.services = services
        self.rules = rules
        self.nodes: List[Node] = []
        self.blackboards: Dict[str, Blackboard] = {}
        self.faults: List[Fault] = []
        self._scripts: Dict[str, Script] = {}
        self._by_spec: Dict[str, Tuple[Dict[str, Port], Dict[str, str]]] = {}
        self._deepest = 0

    def unfold(self, blackboard: Blackboard) -> None:
        """Make every node, parents before children, in document order."""
        self.blackboards[""] = blackboard
        waiting = [_Place(child, None, blackboard, "", 1)
                   for child in self.checked.trees[self.checked.main].children]
        while waiting:
            place = waiting.pop()
            if place.depth > DEEPEST:
                self.faults.append(place.element.fault(
                    rules.TOO_LARGE, "the mission unfolds to more than {} levels".format(DEEPEST)))
                break
            self._deepest = max(self._deepest, place.depth)
            node = None if id(place.element) in self.checked.faulty else self._node(place)
            if node is None:
                # it cannot be made, but its content may have mistakes too
                waiting.extend(place._replace(element=child, parent=None) for child in reversed(place.element.children))
                continue
            children = place.element.children
            if isinstance(node, TestNode):
                continue
            if place.element.tag == "SubTree":
                place, children = self._enter(place, node)
            waiting.extend(_Place(child, node, place.blackboard, place.prefix, place.depth + 1)
                           for child in reversed(children))
        needed = 1000 + _FRAMES_PER_LEVEL * self._deepest
        if sys.getrecursionlimit() < needed:
            sys.setrecursionlimit(needed)

    def _node(self, place: _Place) -> Optional[Node]:
        """Make the node of an element; None, with a fault, if it cannot be made."""
        element, uid = place.element, len(self.nodes) + 1
        type_id = "SubTree" if element.tag == "SubTree" else element.type_id
        own_id = element.attributes.get("ID", "") if type_id == "SubTree" else type_id
        name = element.attributes.get("name", own_id)
        path = place.prefix + name + ("::{}".format(uid) if name == own_id else "")
        spec, node = self._made(type_id, name, path, element)
        if node is None:
            return None
        node.element, node.uid, node.registration_id, node.full_path = element, uid, type_id, path
        node.blackboard, node.services = place.blackboard, self.services
        node.spec, node.attributes = spec, element.attributes
        defaults = self._ports(spec)[1]
        if defaults:
            node.attributes = dict(defaults, **element.attributes)
        self.nodes.append(node)
        if place.parent is not None:
            place.parent.add_child(node)  # type: ignore[attr-defined]
        self._bind(element, spec, node)
        return node

    def _made(self, type_id: str, name: str, path: str, element: Element) -> Tuple[NodeSpec, Optional[Node]]:
        spec = self.registry.find(type_id)
        assert spec is not None  # guaranteed by the checks
        if self.rules.rules:
            target = self.rules.target(name, type_id, path)
            if target in self.rules.configs:
                config = self.rules.configs[target]
                return NodeSpec(target, Kind.ACTION, lambda name: TestNode(name, config)), TestNode(name, config)
            if target is not None:
                replacement = self.registry.find(target)
                if replacement is None:
                    self.faults.append(element.fault(rules.SUBSTITUTE_UNKNOWN,
                                                     "the substitute {} is not a node type".format(target)))
                else:
                    spec = replacement
        try:
            node = spec.factory(name)
            if spec.kind in (Kind.ACTION, Kind.CONDITION) and not isinstance(node, Node) and isinstance(node, Behaviour):
                node = BehaviourLeaf(name, node)
            if not isinstance(node, Node):
                raise TypeError("its factory returned {!r}, which is not a {}".format(
                    node, "node" if not isinstance(node, Behaviour) else "node of ours: a py_trees behaviour is a leaf"))
        except Exception as error:  # a leaf may raise anything
            self._broken(element, spec, error)
            return spec, None
        return spec, node

    def _broken(self, element: Element, spec: NodeSpec, error: Exception) -> None:
        """Record that the code of a node type failed where it makes a node."""
        self.faults.append(element.fault(rules.NODE_BROKEN, "{} cannot be made: {}: {}".format(
            spec.id, type(error).__name__, error), "a mistake in the code of the node type, not in this file"))

    def _bind(self, element: Element, spec: NodeSpec, node: Node) -> None:
        attribute: Optional[str] = None
        rule = rules.ENTRY_TYPE
        try:
            if spec.kind is not Kind.SUBTREE:
                for attribute in element.attributes:
                    self._declare(attribute, spec, node)
            scripts = {}
            for attribute in element.attributes:
                if attribute in CONDITIONS:
                    scripts[attribute] = self._script(element.attributes[attribute])
            attribute, rule = None, rules.NODE_REFUSES
            if scripts:
                node.set_conditions([(name, scripts[name]) for name in PRE_CONDITIONS if name in scripts],
                                    {name: scripts[name] for name in POST_CONDITIONS if name in scripts})
            node.configure()
        except ConfigureError as error:
            self.faults.append(element.fault(rules.NODE_REFUSES, str(error), attribute=error.attribute))
        except (ValueFault, ScriptSyntaxError) as error:
            self.faults.append(element.fault(rule, str(error), attribute=attribute))
        except Exception as error:  # ``configure`` of a leaf may raise anything
            self._broken(element, spec, error)

    def _declare(self, attribute: str, spec: NodeSpec, node: Node) -> None:
        """Create the entry that a port refers to."""
        port = self._ports(spec)[0].get(attribute)
        if port is not None:
            ports.declare(node.attributes[attribute], port, node.blackboard)

    def _ports(self, spec: NodeSpec) -> Tuple[Dict[str, Port], Dict[str, str]]:
        """Return the ports of a node type by name, and the entries that they have by default."""
        found = self._by_spec.get(spec.id)
        if found is None:
            found = self._by_spec[spec.id] = ({port.name: port for port in spec.ports}, ports.defaults(spec.ports))
        return found

    def _script(self, text: str) -> Script:
        script = self._scripts.get(text)
        if script is None:
            script = self._scripts[text] = compile_script(text)
        return script

    def _enter(self, place: _Place, node: Node) -> Tuple[_Place, List[Element]]:
        """Return where the contents of a SubTree are to be made, and what they are."""
        element = place.element
        tree_id = element.attributes["ID"]
        path = place.prefix + element.attributes.get("name", "{}::{}".format(tree_id, node.uid))
        if path in self.blackboards:
            self.faults.append(element.fault(rules.SAME_PATH, "two SubTrees have the same path {}".format(path),
                                             "give them different names, or none", "name"))
        inner = Blackboard(place.blackboard)
        self.blackboards[path] = inner
        self._remap(element, tree_id, inner)
        return (place._replace(blackboard=inner, prefix=path + "/"), self.checked.trees[tree_id].children)

    def _remap(self, element: Element, tree_id: str, inner: Blackboard) -> None:
        autoremap = bool(TYPES["bool"].from_text(  # type: ignore[misc]
            element.attributes.get("_autoremap", "false"), {}))
        given = {name: text for name, text in element.attributes.items() if is_port_name(name)}
        if not autoremap:
            for port in self.checked.models.get(tree_id, ()):
                if port.default is not None:
                    given.setdefault(port.name, port.default)
        for name, text in given.items():
            outer = ports.subtree_reference(text, name)
            if outer is not None:
                inner.add_remapping(name, outer)
            else:
                value_type, value = ports.subtree_literal(text)
                inner.set(name, value, value_type)
        inner.autoremap = autoremap  # not before the literals have found their place here
