"""The decorators of BehaviorTree.CPP v4 and the SubTree node: one child each."""
from collections import deque
from typing import Any, Deque, Optional

from py_trees import decorators
from py_trees.common import BlackBoxLevel

from behavior_controller.bt.engine.clock import Timer
from behavior_controller.bt.engine.node import ConfigureError, Node, NodeError, Result, halt_child
from behavior_controller.bt.language import ports
from behavior_controller.bt.language.script import Script, compile_script, to_bool
from behavior_controller.bt.status import FAILURE, IDLE, RUNNING, SKIPPED, SUCCESS


class Decorator(Node, decorators.Decorator):
    """A node with exactly one child. A completed child is reset after every tick, also if a hook decided the result."""

    decorated: Any = None

    def __init__(self, name: str):
        Node.__init__(self, name)

    def add_child(self, child: Node) -> None:
        child.parent = self
        self.decorated = child
        self.children = [child]

    def execute(self) -> Result:
        """Tick, then reset a completed child."""
        result = Node.execute(self)
        status = self.decorated.status
        if status is SUCCESS or status is FAILURE:
            self.decorated.reset()
        return result

    def tick_child(self) -> Result:
        """Tick the child and reset it if it completed, before the decorator's own status changes."""
        result = self.decorated.execute()
        if result is SUCCESS or result is FAILURE:
            self.decorated.reset()
        return result

    def begin(self) -> None:
        """Store RUNNING."""
        if self.status is not RUNNING:
            self.store(RUNNING)

    def required(self, port: str) -> Any:
        """Return the value of a port that has no default. Raises NodeError, in BT.CPP's words."""
        try:
            return self.get_input(port)
        except ports.PortError as error:
            raise NodeError("Missing parameter [{}] in {}: {}".format(port, self.registration_id, error)) from error

    def halt(self) -> None:
        """Halt the child, then the node itself."""
        self.halt_children()
        self.reset()

    stop = Node.stop
    tick = Node.tick

    def tip(self) -> Any:
        """Return the deepest node that was active (py_trees)."""
        return Node.tip(self) if self.decorated.status is IDLE else self.decorated.tip()


class Inverter(Decorator):
    """Exchanges SUCCESS and FAILURE."""

    def update(self) -> Result:
        """Tick the child and invert its result."""
        self.begin()
        result = self.tick_child()
        if result is SUCCESS:
            return FAILURE
        return SUCCESS if result is FAILURE else result


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

    def update(self) -> Result:
        """Tick the child."""
        self.begin()
        return FAILURE if self.tick_child() is FAILURE else RUNNING


class Repeat(Decorator):
    """The child ``num_cycles`` times while it succeeds; -1: no limit."""

    port = "num_cycles"
    goes_on_at = SUCCESS
    ends_at = FAILURE

    def __init__(self, name: str):
        super().__init__(name)
        self.count = 0

    def _limit(self) -> int:
        return self.required(self.port)

    def update(self) -> Result:
        """Tick the child; yield after a round that was done at once, go on within the tick after a longer round."""
        limit = self._limit()
        go = self.count < limit or limit == -1
        self.begin()
        while go:
            was_idle = self.decorated.status is IDLE
            result = self.decorated.execute()
            if result is self.goes_on_at:
                self.count += 1
                limit = self._limit_after_round(limit)
                go = self.count < limit or limit == -1
                halt_child(self.decorated)
                if was_idle and go:
                    self.wake()
                    return RUNNING
            elif result is self.ends_at:
                self.count = 0
                halt_child(self.decorated)
                return result
            else:
                if result is SKIPPED:
                    halt_child(self.decorated)
                return result
        self.count = 0
        return self.goes_on_at

    def _limit_after_round(self, limit: int) -> int:
        return limit

    def halt(self) -> None:
        """Count from the start next time."""
        self.count = 0
        super().halt()


class RetryUntilSuccessful(Repeat):
    """The child up to ``num_attempts`` times until it succeeds; -1: no limit. A failure reads the port again."""

    port = "num_attempts"
    goes_on_at = FAILURE
    ends_at = SUCCESS

    def _limit_after_round(self, limit: int) -> int:
        return self._limit()


class RunOnce(Decorator):
    """The child once in the life of the tree; later ticks are SKIPPED or repeat the result."""

    def __init__(self, name: str):
        super().__init__(name)
        self.result: Optional[Result] = None

    def update(self) -> Result:
        """Tick the child unless it has completed before."""
        if self.result is not None:
            return SKIPPED if self.get_input("then_skip") else self.result
        self.begin()
        result = self.tick_child()
        if result is SUCCESS or result is FAILURE:
            self.result = result
        return result


class Precondition(Decorator):
    """The child if the script ``if`` is true, else the status ``else``. It is not evaluated again while the child runs."""

    def __init__(self, name: str):
        super().__init__(name)
        self.text = ""
        self.script: Script = None  # type: ignore[assignment]
        self.latched = False

    def configure(self) -> None:
        """Parse the script; a reference must be readable already."""
        try:
            self._parse(self.get_input("if"))
        except ports.PortError as error:
            raise ConfigureError("Missing parameter [if] in Precondition: {}".format(error), "if") from error

    def _parse(self, text: str) -> None:
        if self.script is None or text != self.text:
            self.text = text
            self.script = compile_script(text, allow_empty=True)

    def update(self) -> Result:
        """Evaluate the script unless the child is under way, then tick the child or return ``else``."""
        self._parse(self.get_input("if"))
        otherwise = self.required("else")
        if not self.latched:
            self.latched = to_bool(self.script.run(self.blackboard, self.services.enums))
        if not self.latched:
            return otherwise
        result = self.tick_child()
        if result is SUCCESS or result is FAILURE:
            self.latched = False
        return result


class Delay(Decorator):
    """The child after ``delay_msec``."""

    def __init__(self, name: str):
        super().__init__(name)
        self.timer: Optional[Timer] = None
        self.over = False

    def update(self) -> Result:
        """Start the timer, wait for it, then tick the child."""
        delay = self.required("delay_msec")
        if self.timer is None:
            self.over = False
            self.begin()
            self.timer = self.clock.call_after(delay / 1000.0, self._due)
        if not self.over:
            return RUNNING
        result = self.tick_child()
        if result is SUCCESS or result is FAILURE:
            self.timer = None
        return result

    def _due(self) -> None:
        self.over = True
        self.wake()

    def halt(self) -> None:
        """Wait again next time."""
        if self.timer is not None:
            self.timer.cancel()
            self.timer = None
        super().halt()


class Timeout(Decorator):
    """The child for at most ``msec``, then it is halted and the node fails. 0: no limit."""

    def __init__(self, name: str):
        super().__init__(name)
        self.active = False
        self.expired = False
        self.timer: Optional[Timer] = None

    def update(self) -> Result:
        """Start the timer; tick the child unless the timer has halted it."""
        msec = self.required("msec")
        if not self.active:
            self.active = True
            self.expired = False
            self.begin()
            if msec > 0:
                self.timer = self.clock.call_after(msec / 1000.0, self._due)
        if self.expired:
            self.active = False
            return FAILURE
        result = self.tick_child()
        if result is SUCCESS or result is FAILURE:
            self._stop()
        return result

    def _due(self) -> None:
        # the timer itself halts the child, between ticks, and only if it is RUNNING at that moment
        if self.decorated.status is RUNNING:
            self.expired = True
            halt_child(self.decorated)
            self.wake()

    def _stop(self) -> None:
        self.active = False
        if self.timer is not None:
            self.timer.cancel()
            self.timer = None

    def halt(self) -> None:
        """Cancel the timer."""
        self._stop()
        super().halt()


class Loop(Decorator):
    """The child once for each item of ``queue``, a tick each; ``if_empty`` is the result of an empty queue."""

    item_type = "string"

    def __init__(self, name: str):
        super().__init__(name)
        self.literal: Optional[Deque[Any]] = None
        self.queue: Optional[Deque[Any]] = None
        self.child_runs = False  # by its last result: a SKIPPED child keeps the status RUNNING

    def configure(self) -> None:
        """Convert a literal queue."""
        text = self.attributes.get("queue")
        if text is None:
            raise ConfigureError("[queue] not found")
        if ports.reference(text, "queue") is None:
            self.literal = deque(ports.loop_items(text, self.item_type))

    def update(self) -> Result:
        """Take the next item unless the child is under way, then tick the child."""
        if self.status is IDLE:
            self.child_runs = False
            self.queue = None if self.literal is None else deque(self.literal)
        if not self.child_runs:
            if self.queue is None:
                self.queue = self._from_blackboard()
            if not self.queue:
                return self.get_input("if_empty")
            self._hand_out(self.queue.popleft())
            self.services.changes += 1
        if self.status is IDLE:
            self.store(RUNNING)
        result = self.tick_child()
        self.child_runs = result is RUNNING
        return FAILURE if result is FAILURE else RUNNING

    def _from_blackboard(self) -> Deque[Any]:
        value = ports.entry_value(self.attributes["queue"], "queue", self.blackboard)
        if isinstance(value, deque):
            return value
        if isinstance(value, str):
            return deque(ports.loop_items(value, self.item_type))
        if isinstance(value, list):
            return deque(value)
        raise NodeError("LoopNode: port 'queue' must contain either SharedQueue<T>, std::vector<T>, or a string")

    def _hand_out(self, item: Any) -> None:
        if "value" in self.attributes:
            self.set_output("value", item)


class LoopInt(Loop):
    """Loop over integers."""

    item_type = "int"


class LoopBool(Loop):
    """Loop over booleans."""

    item_type = "bool"


class LoopDouble(Loop):
    """Loop over reals."""

    item_type = "double"


class LoopString(Loop):
    """Loop over texts."""


class SkipUnlessUpdated(Decorator):
    """The child if ``entry`` was written since this node's last tick, else SKIPPED."""

    otherwise: Result = SKIPPED

    def __init__(self, name: str):
        super().__init__(name)
        self.seen = 0
        self.child_runs = False
        self.key = ""

    def configure(self) -> None:
        """Find the entry's name."""
        self.key = entry_key(self)

    def update(self) -> Result:
        """Go on with a running child, else compare the entry's write counter."""
        if not self.child_runs:
            entry = self.blackboard.find(self.key)
            sequence = entry.sequence if entry is not None else None
            if sequence is None or sequence == self.seen:
                return self.otherwise
            self.seen = sequence
            self.services.changes += 1
        result = self.decorated.execute()
        self.child_runs = result is RUNNING
        return result

    def halt(self) -> None:
        """Reset the running child, but not the counter."""
        self.child_runs = False
        super().halt()


class WaitValueUpdate(SkipUnlessUpdated):
    """The child if ``entry`` was written since this node's last tick, else RUNNING."""

    otherwise = RUNNING


class SubTree(Decorator):
    """Another tree of the file in this place, with its own blackboard (BT.CPP section "SubTree")."""

    def __init__(self, name: str):
        super().__init__(name)
        self.blackbox_level = BlackBoxLevel.COMPONENT

    def update(self) -> Result:
        """Tick the root of the tree."""
        if self.status is IDLE:
            self.store(RUNNING)
        return self.tick_child()


def entry_key(node: Node) -> str:
    """Return the name of the entry that port ``entry`` of ``node`` means, written with or without braces."""
    text = node.attributes.get("entry")
    if not text:
        raise ConfigureError("Missing port 'entry' in {}".format(node.name))
    return ports.reference(text, "entry") or text
