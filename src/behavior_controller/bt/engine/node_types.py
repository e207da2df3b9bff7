"""The node types that a mission may use, by name: the built-in ones and those that are added."""
import collections.abc
from functools import partial
from types import FunctionType
from typing import Any, Callable, Dict, Iterable, Mapping, Sequence, Tuple

from behavior_controller.bt.engine.builtins import builtin_specs
from behavior_controller.bt.engine.leaf import ConditionLeaf, SyncActionLeaf
from behavior_controller.bt.engine.node import Node, Result
from behavior_controller.bt.engine.registry import Direction, Kind, NodeSpec, Port
from behavior_controller.bt.values.status import FAILURE, SUCCESS
from behavior_controller.bt.values.values import PortType, TYPES
from behavior_controller.foreign_code import OUR_PACKAGES, defined_at, takes
from behavior_controller.text import did_you_mean

LeafFunction = Callable[..., Any]
"""What a leaf does, with the leaf as its argument, or without an argument."""

_SPEC_FIELDS: Dict[str, Tuple[Any, ...]] = {
    "kind": (Kind,), "id": (str,), "description": (str,), "advances_on": (int,),
    "repeats_on": (int,), "outcome": (int, type(None), collections.abc.Callable)}
_PORT_FIELDS = {"name": (str,), "type": (str,), "direction": (Direction,),
                "default": (str, type(None)), "description": (str,)}


def _check_fields(what: str, record: object, kinds: Mapping[str, Tuple[Any, ...]]) -> None:
    """Raise ValueError, which names it, if a field of ``record`` has a value of another type."""
    for field, allowed in kinds.items():
        value = getattr(record, field)
        if not isinstance(value, allowed):
            wrong = f"the {field} of the {what} is {value!r}"
            raise ValueError(f"{wrong}, and not of the type {allowed[0].__name__}")


class FunctionAction(SyncActionLeaf):
    """An action that is one call of a function."""

    is_foreign = True

    def __init__(self, name: str, function: LeafFunction):
        super().__init__(name)
        self.function = function

    def update(self) -> Result:
        """Call the function; True means SUCCESS, False FAILURE."""
        result = self.function() if takes(self.function, 0) else self.function(self)
        if result is True:
            return SUCCESS
        if result is False:
            return FAILURE
        return result

    @property
    def rule(self) -> LeafFunction:
        """The function."""
        return self.function


class FunctionCondition(FunctionAction, ConditionLeaf):
    """A condition that is one call of a function."""

    KIND = Kind.CONDITION


_RULES = ("tick", "execute", "initialise", "terminate", "stop", "update", "on_start", "on_running",
          "act")
"""Methods of nodes that may be taken for their rule, some of them out of habit with py_trees."""


def class_fault(spec: NodeSpec, made: Any) -> str:
    """Return why ``made``, the class of a node type, makes no nodes of it; empty: it does."""
    if not (isinstance(made, type) and issubclass(made, Node)) or _base_of_ours(made) is made:
        return ""
    kind = getattr(made, "KIND", spec.kind)
    if kind is not spec.kind:
        return (f"{made.__name__}, the class of {spec.id}, makes nodes of {kind}, and its NodeSpec "
                f"says {spec.kind}")
    base = _base_of_ours(made)
    for name in _RULES:
        function = getattr(made, name, None)
        usual = getattr(base, name, function)
        if name not in base.RULE and function is not usual and not _names(made, name, "super"):
            return (f"{made.__name__}.{name}{defined_at(function)} bypasses the rule of the class "
                    f"{base.__name__}: write {', '.join(base.RULE)} instead")
    missing = sorted(made.__abstractmethods__)
    if all(getattr(made, name, None) is getattr(base, name, None) for name in base.RULE):
        missing += [name for name in base.RULE[:1] if _names(made, name, "NotImplementedError")]
    if not missing:
        return ""
    return f"{made.__name__}, the class of {spec.id}, has no {missing[0]}()"


def _names(made: type, method: str, name: str) -> bool:
    """Return whether the code of a method has that name in it."""
    function = getattr(made, method)
    return isinstance(function, FunctionType) and name in function.__code__.co_names


def _base_of_ours(made: type) -> Any:
    return next(kind for kind in made.__mro__ if kind.__module__.startswith(OUR_PACKAGES))


class Registry(Dict[str, NodeSpec]):
    """Node types by name: the built-in ones, then others in the order of registration."""

    def __init__(self, specs: Iterable[NodeSpec] = ()):
        """``specs`` are added to the built-in ones, which may be among them."""
        builtin = {spec.id: spec for spec in builtin_specs()}
        super().__init__(builtin)
        self._types: Dict[str, PortType] = {}
        self.extend(spec for spec in specs if spec != builtin.get(spec.id))

    def register_action(self, name: str, function: LeafFunction, ports: Sequence[Port] = (),
                        description: str = "") -> None:
        """Add an action of one tick that calls ``function(leaf)``, or ``function()``.

        It returns a status or a bool. Instead, ``function`` may be a class of leaves. Raises
        ValueError.
        """
        self._register(name, Kind.ACTION, FunctionAction, function, ports, description)

    def register_condition(self, name: str, function: LeafFunction, ports: Sequence[Port] = (),
                           description: str = "") -> None:
        """Add a condition; see ``register_action``."""
        self._register(name, Kind.CONDITION, FunctionCondition, function, ports, description)

    def _register(self, name: str, kind: Kind, leaf: type, function: LeafFunction,
                  ports: Sequence[Port], description: str) -> None:
        if not (callable(function) and (takes(function, 0) or takes(function, 1))):
            raise ValueError(f"the function of the node type {name} is {function!r}; it must be "
                             "one that takes the leaf, or nothing")
        factory: Any = function
        if not isinstance(function, type):
            factory = partial(leaf, function=function)
        self.extend([NodeSpec(name, kind, factory, tuple(ports), description)])

    def extend(self, specs: Iterable[NodeSpec]) -> None:
        """Add each of ``specs``. Raises ValueError for a duplicate name, and for a field or a port
        of a wrong type, and for a class that makes no nodes of the type."""
        for spec in specs:
            if spec.id in self:
                raise ValueError(f"the node type {spec.id} is registered twice")
            _check_fields(f"node type {spec.id!r}", spec, _SPEC_FIELDS)
            if isinstance(spec.ports, Port) or {type(port) for port in spec.ports} - {Port}:
                wrong = f"the ports of the node type {spec.id} are not a tuple of Port"
                raise ValueError(f"{wrong}; with one port it needs a comma")
            for port in spec.ports:
                _check_fields(f"port {port.name} of {spec.id}", port, _PORT_FIELDS)
                self._check_type(port, spec)
            if len(spec.port_named) < len(spec.ports):
                raise ValueError(f"two ports of the node type {spec.id} have the same name")
            fault = class_fault(spec, getattr(spec.factory, "func", spec.factory))
            if fault:
                raise ValueError(fault)
            self[spec.id] = spec

    def _check_type(self, port: Port, spec: NodeSpec) -> None:
        if isinstance(port.type, PortType):
            if self._types.setdefault(port.type, port.type) is not port.type:
                wrong = f"the type {port.type} of the port {port.name} of {spec.id}"
                raise ValueError(f"{wrong} is not the one of that name that other ports have; "
                                 "make one PortType and use it for all")
        elif port.type not in TYPES:
            # a float is no Location, though the names are a little alike
            hint = did_you_mean(port.type, TYPES) or did_you_mean(port.type, self._types, 0.75)
            hint = hint or "there are: " + " ".join(TYPES)
            wrong = f"the port {port.name} of {spec.id} has the unknown type {port.type}"
            raise ValueError(f"{wrong} ({hint}; a type of your own is a PortType)")
