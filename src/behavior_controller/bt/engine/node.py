"""The tick pipeline that all nodes share (pre-conditions, status, post-conditions, halt), and the leaf base classes.

The rules are BehaviorTree.CPP's (``TreeNode::executeTick`` and ``haltNode``); the classes are py_trees behaviours, so
that py_trees' display and visitor tools read them. ``execute`` ticks a node; py_trees' generator ``tick`` only adapts it.
"""
import logging
import uuid
from typing import Any, Callable, Dict, Iterator, List, Optional, Tuple, Union

from py_trees.behaviour import Behaviour
from py_trees.common import BlackBoxLevel, Status

from behavior_controller.bt.engine.clock import Clock
from behavior_controller.bt.engine.wakeup import WakeUp
from behavior_controller.bt.language import ports
from behavior_controller.bt.language.blackboard import Blackboard
from behavior_controller.bt.language.script import Script, to_bool
from behavior_controller.bt.registry import Port
from behavior_controller.bt.status import FAILURE, IDLE, RUNNING, SKIPPED, SUCCESS, Skipped
from behavior_controller.errors import BehaviorControllerError
from behavior_controller.text import clean

Result = Union[Status, Skipped]
Observer = Callable[["Node", Status, Status], None]

PRE_CONDITIONS = ("_failureIf", "_successIf", "_skipIf", "_while")
POST_CONDITIONS = ("_onHalted", "_onFailure", "_onSuccess", "_post")


class ConfigureError(BehaviorControllerError):
    """A node cannot be made as the file wants it; ``attribute`` names the place, or is None for the whole element."""

    def __init__(self, text: str, attribute: Optional[str] = None):
        super().__init__(text)
        self.attribute = attribute


class NodeError(BehaviorControllerError):
    """A node broke a rule of the engine while it was ticked."""


class TickError(BehaviorControllerError):
    """A tick ended in an exception. Wrapped once, at the node in whose rule it happened (BT.CPP ``NodeExecutionError``)."""

    def __init__(self, node: "Node", cause: Exception):
        super().__init__("Exception in node '{}' [{}]: {}".format(node.full_path, node.registration_id, cause))
        self.node = node
        self.cause = cause


class Services:
    """What the nodes of one tree share: the clock, the wake-up signal, and the enums known to scripts."""

    def __init__(self, clock: Clock, enums: Optional[Dict[str, int]] = None, wake: Optional[WakeUp] = None):
        self.clock = clock
        self.wake = wake or WakeUp()
        self.enums = enums or {}
        self.changes = 0  # what nodes have done, beside writing to entries, that may change what another tick would do


class Node(Behaviour):
    """One node of a tree. Sub-classes give ``update``, the node's own rule; it returns a status or SKIPPED.

    ``registration_id`` is the node type, ``name`` the instance's name, ``full_path`` the place in the tree, ``uid`` the
    number in depth-first order from 1 (BT.CPP section "UIDs and paths").
    """

    status: Status
    element: Any = None
    """The ``document.Element`` that the node was made from, if it was made from a file."""

    # py_trees' constructor makes a UUID and a logger for each node, which costs more than all the rest of a load;
    # here both are made when somebody asks
    def __init__(self, name: str):
        self.name = name
        self.status = IDLE
        self.parent: Optional["Node"] = None  # type: ignore[assignment]
        self.children: List[Any] = []
        self.feedback_message = ""
        self.blackbox_level = BlackBoxLevel.NOT_A_BLACKBOX
        self.blackboards: List[Any] = []
        self.uid = 0
        self.registration_id = ""
        self.full_path = name
        self.blackboard: Blackboard = None  # type: ignore[assignment]
        self.services: Services = None  # type: ignore[assignment]
        self.ports: Tuple[Port, ...] = ()
        self.attributes: Dict[str, str] = {}
        self.observer: Optional[Observer] = None
        self.before: List[Tuple[str, Script]] = []
        self.after: Dict[str, Script] = {}

    @property
    def id(self) -> uuid.UUID:
        """The unique identifier that py_trees' tools ask for."""
        return self.__dict__.setdefault("_id", uuid.uuid4())

    @property
    def logger(self) -> logging.Logger:
        """The logger that py_trees' methods use."""
        return logging.getLogger(__name__)

    @property
    def qualified_name(self) -> str:
        """Type and name, for py_trees' tools."""
        return "{}/{}".format(self.registration_id, self.name)

    @property
    def iterator(self) -> Iterator[Behaviour]:
        """A fresh tick generator, for py_trees' tools."""
        return self.tick()

    # ------------------------------------------------------------------------------------------------------ life cycle

    def configure(self) -> None:
        """Check what BT.CPP's constructors check. Called once, when all attributes are bound; raises ConfigureError."""

    def set_conditions(self, before: List[Tuple[str, Script]], after: Dict[str, Script]) -> None:
        """Use these pre- and post-condition scripts, by attribute name; ``before`` in the order of PRE_CONDITIONS."""
        self.before, self.after = before, after
        if before or after:
            self.execute = self.execute_with_conditions  # type: ignore[method-assign]

    # ------------------------------------------------------------------------------------------------------- execution

    def execute(self) -> Result:
        """Tick this node: run its rule and store the result (BT.CPP ``executeTick``, for a node without conditions)."""
        try:
            result = self.update()
        except TickError:
            raise
        except Exception as error:
            raise TickError(self, error) from error
        if result is not SKIPPED and (result is not self.status or result is IDLE):
            self.store(result)
        return result

    def execute_with_conditions(self) -> Result:
        """Tick this node; a pre-condition may decide in its place, and post-conditions follow a completion."""
        result = self._check_before()
        if result is None:
            try:
                result = self.update()
            except TickError:
                raise
            except Exception as error:
                raise TickError(self, error) from error
        if result is SUCCESS:
            self._run_after("_onSuccess", "_post")
        elif result is FAILURE:
            self._run_after("_onFailure", "_post")
        if result is not SKIPPED and (result is not self.status or result is IDLE):
            self.store(result)
        return result

    def _check_before(self) -> Optional[Result]:
        """Return the status that a pre-condition decides, or None (BT.CPP ``checkPreConditions``)."""
        status = self.status
        if status is IDLE:
            for attribute, script in self.before:
                if self._is_true(script) is not (attribute == "_while"):
                    return _DECISIONS[attribute]
        elif status is RUNNING:
            for attribute, script in self.before:
                if attribute == "_while" and not self._is_true(script):
                    self.halt_node()
                    return SKIPPED
        return None

    def _is_true(self, script: Script) -> bool:
        return to_bool(script.run(self.blackboard, self.services.enums))

    def _run_after(self, *attributes: str) -> None:
        for attribute in attributes:
            script = self.after.get(attribute)
            if script is not None:
                script.run(self.blackboard, self.services.enums)

    def store(self, status: Status) -> None:
        """Make ``status`` the node's status and tell the observer. Raises NodeError or TickError for what is none."""
        old = self.status
        if status is not RUNNING and status is not SUCCESS and status is not FAILURE:
            raise self._refusal(status)
        self.status = status
        if self.observer is not None and old is not status:
            self.observer(self, old, status)

    def _refusal(self, status: Any) -> BehaviorControllerError:
        """Return why ``status`` cannot be stored."""
        if status is IDLE:
            return NodeError("Node [{}]: you are not allowed to set manually the status to IDLE. "
                             "If you know what you are doing (?) use resetStatus() instead.".format(self.name))
        element = self.element
        place = "{}:{}:{}: ".format(element.document.file, *element.place()) if element is not None else ""
        return TickError(self, NodeError(
            "{}its rule returned {!r}; it must be RUNNING, SUCCESS, FAILURE or SKIPPED".format(place, status)))

    def reset(self) -> None:
        """Go back to IDLE; children and scripts are not touched."""
        old = self.status
        if old is not IDLE:
            self.status = IDLE
            if self.observer is not None:
                self.observer(self, old, IDLE)

    def halt(self) -> None:
        """Interrupt the node's own work. Sub-classes extend it."""
        self.reset()

    def halt_node(self) -> None:
        """Halt, then run the ``_onHalted`` script, whether the node was running or not (BT.CPP ``haltNode``)."""
        self.halt()
        self._run_after("_onHalted")

    def halt_children(self) -> None:
        """Halt each child that is RUNNING and reset all (BT.CPP ``resetChildren``), in order."""
        for child in self.children:
            if child.status is not IDLE:
                halt_child(child)

    # ------------------------------------------------------------------------------------------------------------ ports

    def get_input(self, name: str) -> Any:
        """Return the value of an input port. Raises PortError if it has none or a wrong one."""
        port = self._port(name)
        text = self.attributes.get(name, port.default)
        if text is None:
            raise ports.PortError("missing required port [{}]".format(name))
        return ports.read(text, port, self.blackboard, self.services.enums)

    def set_output(self, name: str, value: Any) -> None:
        """Write to an output port. Raises PortError if it is not connected."""
        port = self._port(name)
        text = self.attributes.get(name)
        if text is None:
            raise ports.PortError("output port [{}] is not connected".format(name))
        ports.write(text, port, self.blackboard, value)

    def _port(self, name: str) -> Port:
        for port in self.ports:
            if port.name == name:
                return port
        raise ports.PortError("{} declares no port [{}]".format(self.registration_id, name))

    @property
    def clock(self) -> Clock:
        """The tree's clock."""
        return self.services.clock

    def wake(self) -> None:
        """Ask for another tick soon (BT.CPP ``emitWakeUpSignal``); any thread may."""
        self.services.wake.emit()

    # ----------------------------------------------------------------------------------------------------- for py_trees

    def update(self) -> Result:  # type: ignore[override]
        """Run the node's own rule and return its result."""
        raise NotImplementedError

    def tick(self) -> Iterator[Behaviour]:
        """Tick, then yield every node, children first, as py_trees' visitors expect."""
        self.execute()
        yield from self.iterate()

    def stop(self, new_status: Status = IDLE) -> None:
        """Halt (py_trees' ``stop``; for a result other than INVALID there is nothing to do)."""
        if new_status is IDLE:
            self.halt_node()


def label(node: Any) -> Tuple[str, str]:
    """Return a node's name, and what tells it from others of that name: its type, if that is another, and its uid."""
    if node.full_path.rsplit("/", 1)[-1] == "{}::{}".format(node.name, node.uid):
        return clean(node.name), "#{}".format(node.uid)
    return clean(node.name), "({}) #{}".format(node.registration_id, node.uid)


_DECISIONS: Dict[str, Result] = {"_failureIf": FAILURE, "_successIf": SUCCESS, "_skipIf": SKIPPED, "_while": SKIPPED}


def halt_child(child: Any) -> None:
    """Halt ``child`` if it is RUNNING, then reset it."""
    if child.status is RUNNING:
        child.halt_node()
    child.reset()
