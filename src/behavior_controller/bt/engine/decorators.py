"""The decorators of BehaviorTree.CPP v4 and the SubTree node: one child each."""
from collections import deque
from functools import cached_property
from typing import Any, Deque, Optional, Tuple

from py_trees import decorators
from py_trees.common import BlackBoxLevel

from behavior_controller.bt.engine.node import (
    ConfigureError, Node, NodeError, Parent, Result, Timed, halt_child, run_script)
from behavior_controller.bt.engine import ports
from behavior_controller.bt.engine.registry import Kind, Port, Role
from behavior_controller.bt.script.parser import Script, compile_script, to_bool
from behavior_controller.bt.values.values import TEXT, ValueFault
from behavior_controller.bt.values.status import FAILURE, IDLE, RUNNING, SKIPPED, SUCCESS


class Decorator(Parent, decorators.Decorator):
    """A node with exactly one child. A completed child is reset after every tick, also if a hook
    decided the result."""

    KIND = Kind.DECORATOR
    decorated: Any = None

    def adopt(self, child: Node) -> None:
        """Make ``child`` the child of this node."""
        super().adopt(child)
        self.decorated = child

    def execute(self) -> Result:
        """Tick, then reset a completed child."""
        result = Node.execute(self)
        status = self.decorated.status
        if status is SUCCESS or status is FAILURE:
            self.decorated.reset()
        return result

    def tick_child(self) -> Result:
        """Tick the child and reset it if it completed, before the decorator's own status changes.
        """
        result = self.decorated.execute()
        if result is SUCCESS or result is FAILURE:
            self.decorated.reset()
        return result


class Inverter(Decorator):
    """Exchanges SUCCESS and FAILURE."""

    def update(self) -> Result:
        """Tick the child and invert its result."""
        self.begin()
        result = self.tick_child()
        if result is SUCCESS:
            return FAILURE
        if result is FAILURE:
            return SUCCESS
        return result


class ForceSuccess(Decorator):
    """SUCCESS when the child completes."""

    forced = SUCCESS

    def update(self) -> Result:
        """Tick the child."""
        self.begin()
        result = self.tick_child()
        return result if result is RUNNING or result is SKIPPED else self.forced


class ForceFailure(ForceSuccess):
    """FAILURE when the child completes."""

    forced = FAILURE


class KeepRunningUntilFailure(Decorator):
    """Repeats the child, one tick each, until it fails."""

    ROUND = ("child_runs",)
    child_runs = False  # by its last result: a SKIPPED child keeps the status RUNNING

    @cached_property
    def _does_foreign_work(self) -> bool:
        return any(node.is_foreign and node.spec.kind is not Kind.CONDITION
                   for node in self.decorated.iterate())

    def update(self) -> Result:
        """Tick the child."""
        self.begin()
        did_run, changes = self.child_runs, self.services.tree.changes
        result = self.tick_child()
        self.child_runs = result is RUNNING
        # a child that only looks is not ticked again before there is anything new
        if not self.child_runs and (did_run or self.services.tree.changes != changes
                                    or self._does_foreign_work):
            self.ask_for_tick()
        return FAILURE if result is FAILURE else RUNNING


class Repeat(Decorator):
    """The child ``num_cycles`` times while it succeeds; -1: no limit."""

    PORTS = (Port("num_cycles", "int", description="rounds; -1: no limit"),)
    goes_on_at = SUCCESS
    ends_at = FAILURE
    reads_again = False  # the port, after each round
    ROUND = ("count",)
    count = 0

    def update(self) -> Result:
        """Tick the child; yield after a round that was done at once, go on within the tick after a
        longer round."""
        port = self.PORTS[0].name
        limit = self.get_input(port)
        self.begin()
        was_idle = False
        while self.count < limit or limit == -1:
            if was_idle:
                self.wake()
                return RUNNING
            was_idle, result = self.decorated.status is IDLE, self.decorated.execute()
            if result is not self.goes_on_at:
                if result is self.ends_at:
                    self.count = 0
                if result is not RUNNING:
                    halt_child(self.decorated)
                return result
            self.count += 1
            if self.reads_again:
                limit = self.get_input(port)
            halt_child(self.decorated)
        self.count = 0
        return self.goes_on_at


class RetryUntilSuccessful(Repeat):
    """The child up to ``num_attempts`` times until it succeeds; -1: no limit. A failure reads the
    port again."""

    PORTS = (Port("num_attempts", "int", description="attempts; -1: no limit"),)
    goes_on_at = FAILURE
    ends_at = SUCCESS
    reads_again = True


class RunOnce(Decorator):
    """The child once in the life of the tree; later ticks are SKIPPED or repeat the result."""

    PORTS = (Port("then_skip", "bool", default="true",
                  description="later ticks are SKIPPED, else they repeat the result"),)
    result: Optional[Result] = None

    def update(self) -> Result:
        """Tick the child unless it has completed before."""
        if self.result is not None:
            # that an empty entry skips is the library's rule
            return SKIPPED if self.input_or("then_skip", True) else self.result
        self.begin()
        result = self.tick_child()
        if result is SUCCESS or result is FAILURE:
            self.result = result
            self.services.actions += 1
        return result


class Scripted:
    """The script of a port: read when the tree is made, and again when the text changes."""

    script_port = "code"
    script: Script

    def configure(self: Any) -> None:
        """Parse the script; a reference must be readable already."""
        try:
            self.script = compile_script(self.get_input(self.script_port), allow_empty=True)
        except ports.PortError as error:
            raise ConfigureError(str(error), self.script_port) from error

    def parse(self: Any) -> str:
        """Read the script again if its text has changed, and return the text."""
        text = self.get_input(self.script_port)
        if text != self.script.text:
            self.script = compile_script(text, allow_empty=True)
        return text

    def run(self: Any) -> Any:
        """Run the script as it was read."""
        return run_script(self.script, self, self.script_port)


class Precondition(Scripted, Decorator):
    """The child if the script ``if`` is true, else the status ``else``. It is not evaluated again
    while the child runs."""

    PORTS = (Port("if", TEXT, description="script that must be true", role=Role.SCRIPT),
             Port("else", "NodeStatus", default="FAILURE", description="the result if it is not"))
    script_port = "if"
    latched = False

    def update(self) -> Result:
        """Evaluate the script unless the child is under way, then tick the child or return
        ``else``."""
        self.parse()
        otherwise = self.get_input("else")
        if not self.latched:
            self.latched = to_bool(self.run())
        if not self.latched:
            return otherwise
        result = self.tick_child()
        self.latched = result is RUNNING or result is SKIPPED
        return result


class Delay(Timed, Decorator):
    """The child after ``delay_msec``."""

    PORTS = (Port("delay_msec", "uint", description="wait that long, in ms"),)

    def update(self) -> Result:
        """Start the timer, wait for it, then tick the child."""
        delay = self.get_input("delay_msec")
        if self.timer is None:
            self.begin()
            self.start_timer(delay)
        if not self.over:
            return RUNNING
        result = self.tick_child()
        if result is SUCCESS or result is FAILURE:
            self.timer = None
        return result


class Timeout(Timed, Decorator):
    """The child for at most ``msec``, then it is halted and the node fails. 0: no limit."""

    PORTS = (Port("msec", "uint", description="the longest time of the child, in ms; 0: no limit"),)
    ROUND = ("active",)
    active = False

    def update(self) -> Result:
        """Start the timer; tick the child unless the timer has halted it."""
        msec = self.get_input("msec")
        if not self.active:
            self.active, self.over = True, False
            self.begin()
            if msec > 0:
                self.start_timer(msec)
        if self.over:
            self.active = False
            return FAILURE
        result = self.tick_child()
        if result is SUCCESS or result is FAILURE:
            self.active = False
            self.stop_timer()
        return result

    def due(self) -> None:
        """Halt the child, between ticks, and only if it is RUNNING at that moment."""
        if self.decorated.status is RUNNING:
            super().due()
            halt_child(self.decorated)


class Loop(Decorator):
    """The child once for each item of ``queue``, a tick each; ``if_empty`` is the result of an
    empty queue."""

    literal: Optional[Deque[Any]] = None
    queue: Optional[Deque[Any]] = None
    child_runs = False  # by its last result: a SKIPPED child keeps the status RUNNING

    def configure(self) -> None:
        """Convert a literal queue."""
        text = self.attributes.get("queue")
        if text is None:
            raise ConfigureError("[queue] not found")
        if ports.reference(text, "queue") is None:
            try:
                self.literal = self._items(text)
            except ValueFault as fault:
                raise ConfigureError(str(fault), "queue") from fault

    def update(self) -> Result:
        """Take the next item unless the child is under way, then tick the child."""
        if self.status is IDLE:
            self.child_runs = False
            self.queue = self.literal and self.literal.copy()
        if not self.child_runs:
            if self.literal is None:
                self.queue = self._from_blackboard()
            if not self.queue:
                return self.get_input("if_empty")
            item = self.queue.popleft()
            # as in the library, a literal is passed over
            if ports.reference(self.attributes.get("value", ""), "value") is not None:
                self.set_output("value", item)
        if self.status is IDLE:
            self.store(RUNNING)
        result = self.tick_child()
        self.child_runs = result is RUNNING
        if not self.child_runs:  # the next item follows
            self.ask_for_tick()
        return FAILURE if result is FAILURE else RUNNING

    def _from_blackboard(self) -> Optional[Deque[Any]]:
        """Return the items that are left: what was read first stays so while the node runs, but an
        entry that has become empty fails it."""
        if self.blackboard.read(ports.reference(self.attributes["queue"], "queue") or "") is None:
            return self.queue
        value = ports.entry_value(self.attributes["queue"], "queue", self.blackboard)
        if isinstance(value, deque):
            return value
        if self.queue is not None:
            return self.queue
        if isinstance(value, str):
            return self._items(value)
        if isinstance(value, list):
            return deque(value)
        raise NodeError("LoopNode: port 'queue' must contain either SharedQueue<T>, "
                        "std::vector<T>, or a string")

    def _items(self, text: str) -> Deque[Any]:
        return deque(ports.loop_items(text, self.spec.port_named["value"].type))


class Watching:
    """A node that watches ``entry``."""

    PORTS: Tuple[Port, ...] = (
        Port("entry", "Any", description="the entry to watch", role=Role.WATCHED),)
    seen = 0
    key = ""

    def configure(self: Any) -> None:
        """Find the entry's name, written with or without braces."""
        text = self.attributes.get("entry")
        if not text:
            raise ConfigureError(f"Missing port 'entry' in {self.name}")
        self.key = ports.reference(text, "entry") or text

    def is_updated(self: Any) -> bool:
        """Return whether the entry was written since this was last true."""
        entry = self.blackboard.read(self.key)
        if entry is None or entry.sequence == self.seen:
            return False
        self.seen = entry.sequence
        self.services.actions += 1
        return True


class SkipUnlessUpdated(Watching, Decorator):
    """The child if ``entry`` was written since this node's last tick, else SKIPPED."""

    ROUND = ("child_runs",)  # and not the counter
    otherwise: Result = SKIPPED
    child_runs = False

    def update(self) -> Result:
        """Go on with a running child, else look whether the entry was written."""
        if not self.child_runs and not self.is_updated():
            return self.otherwise
        result = self.decorated.execute()
        self.child_runs = result is RUNNING
        return result


class WaitValueUpdate(SkipUnlessUpdated):
    """The child if ``entry`` was written since this node's last tick, else RUNNING."""

    otherwise = RUNNING


class SubTree(Decorator):
    """Another tree of the file in this place, with its own blackboard (BT.CPP section "SubTree").
    """

    PORTS = (Port("_autoremap", "bool", default="false",
                  description="entries of equal name are the parent's"),)
    blackbox_level = BlackBoxLevel.COMPONENT

    def update(self) -> Result:
        """Tick the root of the tree."""
        if self.status is IDLE:
            self.store(RUNNING)
        return self.tick_child()
