"""The tick pipeline that all nodes share (pre-conditions, status, post-conditions, halt), and the
leaf base classes.

The rules are BehaviorTree.CPP's (``TreeNode::executeTick`` and ``haltNode``); the classes are
py_trees behaviours, so that py_trees' display and visitor tools read them. ``execute`` ticks a
node; py_trees' generator ``tick`` only adapts it. Conditions, a hook and the results for py_trees'
visitors intervene between a node's tick and its rule: that is its ``Interception``; most nodes have
none.
"""
import logging
import uuid
from dataclasses import dataclass
from typing import Any, Callable, Dict, Iterator, List, Optional, Sequence, Tuple, Union

from py_trees.behaviour import Behaviour
from py_trees.common import BlackBoxLevel, Status

from behavior_controller.bt.engine.clock import Clock, Timer
from behavior_controller.bt.engine.failure import TickError, failure_of
from behavior_controller.wakeup import WakeUp
from behavior_controller.bt.engine import ports
from behavior_controller.bt.values.blackboard import Blackboard
from behavior_controller.bt.script.parser import Script, ScriptError, to_bool
from behavior_controller.bt.engine.registry import Direction, NodeSpec, Port
from behavior_controller.bt.values.status import FAILURE, IDLE, RUNNING, SKIPPED, SUCCESS, Skipped
from behavior_controller.errors import BehaviorControllerError
from behavior_controller.foreign_code import defined_at
from behavior_controller.text import clean

Result = Union[Status, Skipped]
Observer = Callable[["Node", Status, Status], None]

DECISIONS: Dict[str, Result] = {
    "_failureIf": FAILURE, "_successIf": SUCCESS, "_skipIf": SKIPPED, "_while": SKIPPED}
PRE_CONDITIONS = tuple(DECISIONS)
POST_CONDITIONS = ("_onHalted", "_onFailure", "_onSuccess", "_post")


class ConfigureError(BehaviorControllerError):
    """A node cannot be made from its element; ``attribute`` names the place, or is None for the
    whole element."""

    def __init__(self, text: str, attribute: Optional[str] = None):
        super().__init__(text)
        self.attribute = attribute


class NodeError(BehaviorControllerError):
    """A node broke a rule of the engine while it was ticked."""


@dataclass
class Services:
    """What the nodes of one tree share: the clock, the wake-up signal, and the enums known to
    scripts."""

    clock: Clock
    wake: WakeUp
    enums: Dict[str, int]
    # number of actions that ended, and of updates that were seen: what has an effect beside writes
    actions: int = 0
    changes: int = 0  # of a status, other than to IDLE
    is_tick_wanted: bool = False  # a node has asked for another tick since the last traversal began
    tree: Any = None
    clients: Any = None  # shows py_trees' tools the entries that a node uses


class NodeHook:
    """May replace a node's rule or its result, while it is the node's ``hook``."""

    is_holding = False
    """Whether the node is RUNNING because of the hook."""

    def before(self, node: "Node") -> Optional[Result]:
        """Return the result that replaces the rule's, or None: the rule is run."""
        raise NotImplementedError

    def after(self, node: "Node", result: Result) -> Result:
        """Return the result of the tick, given the node's own ``result``."""
        raise NotImplementedError

    def halt(self, node: "Node") -> bool:
        """Note that the node is halted; return whether it has started work that must be halted."""
        raise NotImplementedError


class Interception:
    """Intervenes between the ticks of one node and its rule: pre- and post-conditions, and inside
    these a hook.

    Two calls around the rule and none around both: a deep tree needs no more Python frames for it.
    """

    def __init__(self) -> None:
        self.conditions: Sequence[Tuple[str, Script]] = ()  # in the order of PRE_CONDITIONS
        self.scripts: Dict[str, Script] = {}  # of all conditions
        # takes the result of each tick, if py_trees' tools ask for it
        self.ticked: Optional[Dict["Node", Result]] = None
        self.hook: Optional[NodeHook] = None
        self._asks_hook = False  # after this tick's rule: no pre-condition has decided

    def before(self, node: "Node") -> Optional[Result]:
        """Return the result that a pre-condition or the hook decides, or None: the rule is run."""
        result = self._check_before(node)
        self._asks_hook = result is None and self.hook is not None
        if self._asks_hook:
            result = self.hook.before(node)  # type: ignore[union-attr]
        return result

    def after(self, node: "Node", result: Result) -> Result:
        """Return the tick's result, which the hook may replace; post-conditions follow a
        completion."""
        if self._asks_hook:
            result = self.hook.after(node, result)  # type: ignore[union-attr]
        if self.scripts and (result is SUCCESS or result is FAILURE):
            self.run(node, "_onSuccess" if result is SUCCESS else "_onFailure", "_post")
        if self.ticked is not None:
            self.ticked[node] = result
        return result

    def _check_before(self, node: "Node") -> Optional[Result]:
        """Return the status that a pre-condition decides, or None (BT.CPP ``checkPreConditions``).
        """
        status = node.status
        for attribute, script in self.conditions:
            is_while = attribute == "_while"
            if status is IDLE or (status is RUNNING and is_while):
                if to_bool(run_script(script, node, attribute)) is not is_while:
                    if status is RUNNING:
                        node.halt_node()
                    return DECISIONS[attribute]
        return None

    def run(self, node: "Node", *attributes: str) -> None:
        """Run the scripts of these post-conditions."""
        for attribute in attributes:
            if attribute in self.scripts:
                run_script(self.scripts[attribute], node, attribute)


def run_script(script: Script, node: "Node", attribute: str) -> Any:
    """Run a script of a node and return its value; what it raises knows its place in the file."""
    try:
        return script.run(node.blackboard, node.services.enums)
    except BehaviorControllerError as error:
        error.origin = (node.element, attribute)
        raise
    except BaseException as error:  # a value of a foreign type may raise anything
        raise failure_of(node, error, "a script of ")


def place_of(error: BehaviorControllerError) -> str:
    """Return ``file:line:column`` of the node at which a tick failed, or of its script; "" if the
    tree is not from a file."""
    element, attribute = error.origin
    return "" if element is None else element.where(attribute)


class Node(Behaviour):
    """One node of a tree. Sub-classes give ``update``, the node's own rule; it returns a status or
    SKIPPED.

    ``registration_id`` is the node type, ``name`` the instance's name, ``full_path`` the place in
    the tree, ``uid`` the number in depth-first order from 1 (BT.CPP section "UIDs and paths").
    """

    PORTS: Tuple[Port, ...] = ()
    RULE: Tuple[str, ...] = ("update",)
    """The methods with which a sub-class gives its rule."""
    status: Status
    element: Any = None
    """The ``document.Element`` that the node was made from, if it was made from a file."""
    interception: Optional[Interception] = None
    is_instant = False
    """Whether RUNNING is an error of the node's rule."""
    was: Status = IDLE
    """The status before the node went back to IDLE."""
    changed_at = 0
    """The number of changes in the tree when the status changed last, other than to IDLE."""
    parent: Optional["Node"] = None
    feedback_message = ""
    logger: Any = logging.getLogger(__name__)  # that py_trees' methods use
    blackbox_level = BlackBoxLevel.NOT_A_BLACKBOX
    uid = 0
    is_apart = False
    """Whether it stands below a leaf that replaces its parent, and so is never ticked or halted."""
    registration_id = ""
    blackboard: Blackboard = None  # type: ignore[assignment]
    services: Services = None  # type: ignore[assignment]
    spec: NodeSpec = None  # type: ignore[assignment]
    observer: Optional[Observer] = None

    # py_trees' constructor makes a UUID and a logger for each node, which costs more than all the
    # rest of a load; here the UUID is made on first use
    def __init__(self, name: str):
        self.name = self.full_path = name
        self.status = IDLE
        self.children: List[Any] = []
        self.attributes: Dict[str, str] = {}

    @property
    def id(self) -> uuid.UUID:
        """The unique identifier that py_trees' tools ask for."""
        return self.__dict__.setdefault("_id", uuid.uuid4())

    @property
    def qualified_name(self) -> str:
        """Type and name, for py_trees' tools."""
        return f"{self.registration_id}/{self.name}"

    @property
    def iterator(self) -> Iterator[Behaviour]:
        """A fresh tick generator, for py_trees' tools."""
        return self.tick()

    @property
    def blackboards(self) -> List[Any]:
        """The py_trees clients of the node: its own ones, and one for the entries that it uses."""
        clients = self.__dict__.setdefault("_blackboards", [])
        if self.services is not None and self.services.clients is not None:
            self.services.clients.show(self, clients)
        return clients

    # ----------------------------------------------------------------------------------- life cycle

    def adopt(self, child: "Node") -> None:
        """Make ``child`` the next child of this node, while the tree is built."""
        child.parent = self
        self.children.append(child)

    def configure(self) -> None:
        """Make the checks of BT.CPP's constructors. Called once, when all attributes are bound;
        raises ConfigureError."""

    @property
    def hook(self) -> Optional[NodeHook]:
        """The hook that may replace the node's rule, or None. On the tick thread only."""
        return self.interception.hook if self.interception is not None else None

    @hook.setter
    def hook(self, hook: Optional[NodeHook]) -> None:
        self.intercepted().hook = hook

    def intercepted(self) -> Interception:
        """Return the node's interception, made if it has none."""
        if self.interception is None:
            self.interception = Interception()
        return self.interception

    # ------------------------------------------------------------------------------------ execution

    def execute(self) -> Result:
        """Tick this node: run its rule and store the result (BT.CPP ``executeTick``)."""
        interception = self.interception
        result = None if interception is None else interception.before(self)
        if result is None:
            try:
                result = self.update()
            except BaseException as error:  # a leaf may raise anything
                raise failure_of(self, error)
        if interception is not None:
            result = interception.after(self, result)
        if result is not SKIPPED and (result is not self.status or result is IDLE):
            self.store(result)
        if result is RUNNING and self.is_instant and not (self.hook and self.hook.is_holding):
            raise TickError(self, NodeError("SyncActionNode MUST never return RUNNING"))
        return result

    def store(self, status: Status) -> None:
        """Make ``status`` the node's status and tell the observer. Raises TickError for an invalid
        one."""
        old = self.status
        if status is not RUNNING and status is not SUCCESS and status is not FAILURE:
            shown = "IDLE" if status is IDLE else repr(status)
            returned = f"its rule returned {shown}{defined_at(self.rule)}"
            raise TickError(self, NodeError(
                f"{returned}; it must be RUNNING, SUCCESS, FAILURE or SKIPPED"))
        self.status = status
        if old is not status:
            services = self.services
            self.changed_at = services.changes = services.changes + 1
            if self.observer is not None:
                self.observer(self, old, status)

    @property
    def last_status(self) -> Status:
        """The status, or that before the node went back to IDLE."""
        return self.was if self.status is IDLE else self.status

    @property
    def rule(self) -> Callable[..., Any]:
        """The function that returns the result of a tick."""
        return getattr(type(self), self.RULE[-1])

    def place_in_file(self) -> str:
        """Return ``file:line:column: `` as a message begins with it, or nothing if the node was not
        made from a file."""
        if self.element is None:
            return ""
        return f"{self.element.where()}: "

    def reset(self) -> None:
        """Go back to IDLE; children and scripts are not touched."""
        old = self.status
        if old is not IDLE:
            self.was, self.status = old, IDLE
            if self.observer is not None:
                self.observer(self, old, IDLE)

    def halt(self) -> None:
        """Interrupt the node's own work. Sub-classes extend it."""
        self.reset()

    def interrupt(self) -> None:
        """Halt without a script; a node whose hook prevented its start has nothing to halt."""
        try:
            if self.hook is None or self.hook.halt(self):
                self.halt()
        except ScriptError:
            raise  # of a child's script
        except BaseException as error:  # a leaf may raise anything
            self.reset()
            raise failure_of(self, error, "the halt of ")
        self.reset()

    def halt_node(self) -> None:
        """Interrupt, then run the ``_onHalted`` script, whether the node was running or not (BT.CPP
        ``haltNode``)."""
        self.interrupt()
        if self.interception is not None:
            self.interception.run(self, "_onHalted")

    def halt_children(self) -> None:
        """Halt each child that is RUNNING and reset all (BT.CPP ``resetChildren``), in order."""
        for child in self.children:
            if child.status is RUNNING:  # as ``halt_child``, with a Python frame less a level
                child.halt_node()
            child.reset()

    # ---------------------------------------------------------------------------------------- ports

    def get_input(self, name: str) -> Any:
        """Return the value of an input port. Raises PortError if it has no value or a wrong one."""
        port = self._port(name, Direction.OUT, "read")
        text = self.attributes.get(name, port.default)
        if text is None:
            raise ports.PortError(f"Missing parameter [{name}] in {self.registration_id}")
        return ports.read(text, port, self.blackboard, self.services.enums)

    def set_output(self, name: str, value: Any) -> None:
        """Write to an output port. Raises PortError if it is not connected."""
        port, text = self._port(name, Direction.IN, "written"), self.attributes.get(name)
        if text is None:
            raise ports.PortError(f"output port [{name}] is not connected")
        ports.write(text, port, self.blackboard, value)

    def clear_output(self, name: str) -> None:
        """Empty the entry of an output port."""
        port = self._port(name, Direction.IN, "written")
        ports.clear(self.attributes.get(name, ""), port, self.blackboard)

    def _port(self, name: str, unfit: Direction, use: str) -> Port:
        port = self.spec.port_named.get(name)
        if port is None:
            declared = ", ".join(self.spec.port_named) or "none"
            raise LookupError(f"{self.registration_id} declares no port [{name}]; its ports: "
                              f"{declared}")
        if port.direction is unfit:
            raise LookupError(f"{self.registration_id} declares [{name}] as an {unfit.value}, which"
                              f" cannot be {use}; declare Direction.INOUT")
        return port

    @property
    def clock(self) -> Clock:
        """The tree's clock."""
        return self.services.clock

    def wake(self) -> None:
        """Have the tree traversed again within this tick (BT.CPP ``emitWakeUpSignal``), or ticked
        at once; any thread may."""
        self.services.wake.emit()

    def ask_for_tick(self) -> None:
        """Have the tree ticked again soon after this tick."""
        self.services.is_tick_wanted = True

    @property
    def is_foreign(self) -> bool:
        """Whether the node is of another package, and may act on a change without having asked for
        a tick."""
        return not type(self).__module__.startswith("behavior_controller.")

    # --------------------------------------------------------------------------------- for py_trees

    def update(self) -> Result:
        """Run the node's own rule and return its result."""
        raise NotImplementedError

    def tick(self) -> Iterator[Behaviour]:
        """Tick the tree from this node on, then yield what was ticked, children first, as py_trees'
        visitors expect."""
        yield from self.services.tree.tick_from(self)

    def stop(self, new_status: Status = IDLE) -> None:
        """Halt (py_trees' ``stop``; for a result other than INVALID there is nothing to do)."""
        if new_status is IDLE:
            self.services.tree.show_own_statuses()
            self.halt_node()

    def _is_fixed(self, *_arguments: Any, **_named: Any) -> Any:
        """Raise NodeError."""
        where = f"{self.place_in_file()}the children of {self.full_path}"
        raise NodeError(f"{where} are those of its file, which cannot be changed in the running "
                        "tree; load another file")

    add_child = add_children = insert_child = prepend_child = replace_child = _is_fixed
    remove_child = remove_child_by_id = remove_all_children = _is_fixed


class Parent(Node):
    """A node with children. It stores RUNNING at the start of its tick."""

    ROUND: Tuple[str, ...] = ()
    """The attributes that a halt resets to those of the class."""

    def input_or(self, port: str, otherwise: Any) -> Any:
        """Return the value of an input port, or ``otherwise`` if it cannot be read."""
        try:
            return self.get_input(port)
        except ports.PortError:
            return otherwise

    def begin(self) -> None:
        """Store RUNNING."""
        if self.status is not RUNNING:
            self.store(RUNNING)

    def halt(self) -> None:
        """Halt the children in order, then the node itself."""
        for name in self.ROUND:
            setattr(self, name, getattr(type(self), name))
        self.halt_children()
        self.reset()


class Timed(Node):
    """A node that waits for a time, and no longer once it is halted."""

    timer: Optional[Timer] = None
    over = False

    def start_timer(self, msec: int) -> None:
        """Let ``over`` become true, and wake the tree, in ``msec`` milliseconds."""
        self.over = False
        self.timer = self.clock.call_after(msec / 1000.0, self.due)

    def due(self) -> None:
        """Note that the time is over."""
        self.over = True
        self.wake()

    def stop_timer(self) -> None:
        """Cancel the timer, if there is one."""
        if self.timer is not None:
            self.timer.cancel()
            self.timer = None

    def halt(self) -> None:
        """Cancel the timer."""
        self.stop_timer()
        super().halt()


def label(node: Any) -> Tuple[str, str]:
    """Return a node's name, its type if that differs, and its uid."""
    if node.full_path.rsplit("/", 1)[-1] == f"{node.name}::{node.uid}":
        return clean(node.name), f"#{node.uid}"
    return clean(node.name), f"({node.registration_id}) #{node.uid}"


def halt_child(child: Any) -> None:
    """Halt ``child`` if it is RUNNING, then reset it."""
    if child.status is RUNNING:
        child.halt_node()
    child.reset()
