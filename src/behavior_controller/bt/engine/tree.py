"""A mission tree ready to tick: its nodes, its blackboards, the three ways to tick it, the wake-up
and the halt."""
from typing import Any, Callable, Dict, Iterator, List, Optional, Sequence, Tuple

from py_trees.common import Status

from behavior_controller.bt.engine.failure import failure_of
from behavior_controller.bt.engine.node import Node, Observer, Result, Services
from behavior_controller.bt.values.blackboard import Blackboard
from behavior_controller.thread_check import tick_thread_only
from behavior_controller.bt.values.status import FAILURE, IDLE, RUNNING, SKIPPED, SUCCESS
from behavior_controller.errors import BehaviorControllerError, Fault, MissionError
from behavior_controller.text import Source

# the most traversals of one tick_once, so that a mission that busy-loops can be stopped
ROUNDS_PER_TICK = 1000

Change = Tuple[Node, Any, Any]
"""A node, its old status and its new one."""

Follower = Callable[[Optional[bool], List[Change]], None]


class Tree:
    """The unfolded tree ``id``. ``nodes`` in order of uid; ``blackboards`` by path of the subtree,
    "" is the root's."""

    def __init__(self, id: str, nodes: List[Node], blackboards: Dict[str, Blackboard],
                 services: Services, warnings: Sequence[Fault] = (),
                 sources: Tuple[Source, ...] = ()):
        """``sources`` are the texts that it was built from, the mission's the last."""
        self.id, self.warnings, self.sources = id, list(warnings), sources
        self.nodes, self.root = nodes, nodes[0]
        self.blackboards, self.blackboard = blackboards, blackboards[""]
        self.services, self.clock, self.wake = services, services.clock, services.wake
        services.tree = self
        self.failure: Optional[BehaviorControllerError] = None
        """What a callback raised since the last traversal: the next one ends with it."""
        self._has_foreign_nodes = any(node.is_foreign for node in nodes)
        self._changes_before = 0  # the last traversal
        self.busy_loops = False  # the last tick_once was cut short: the mission never waits
        self._observers: List[Observer] = []
        self._followers: List[Follower] = []
        self._changes: List[Change] = []  # that the followers have not been given
        # by the last traversal, if py_trees' tools ask for it
        self._ticked: Optional[Dict[Node, Result]] = None
        # the statuses of nodes that show another between two ticks
        self._hidden: Dict[Node, Status] = {}

    def setup(self, **kwargs: Any) -> None:
        """Give each node what it needs at run time (py_trees' ``setup``). Raises MissionError with
        each node's failure."""
        faults = []
        for node in self.nodes:
            try:
                node.setup(**kwargs)
            except BaseException as error:  # a leaf may raise anything
                if node.element is None:
                    raise failure_of(node, error, "the setup of ")
                faults.append(
                    node.element.broken(node.registration_id, "set up", error, type(node)))
        MissionError.raise_any(faults)

    def subscribe(self, observer: Observer) -> None:
        """Call ``observer(node, old_status, new_status)`` at every change of a node's status."""
        self._observers.append(observer)
        for node in self.nodes:
            node.observer = observer if len(self._observers) == 1 else self._notify

    def _notify(self, node: Any, old: Any, new: Any) -> None:
        for observer in self._observers:
            observer(node, old, new)

    def follow(self, follower: Follower) -> None:
        """Call ``follower(is_first, changes)`` after each traversal, with its changes of status in
        order.

        ``is_first``: it was the first one of its tick. It is None for changes outside of
        traversals, as by a halt. Takes less of the tick thread's time than ``subscribe``.
        """
        if not self._followers:
            self.subscribe(lambda node, old, new: self._changes.append((node, old, new)))
        self._followers.append(follower)

    def _hand_over(self, is_first: Optional[bool] = None) -> None:
        """Give the changes to the followers."""
        if self._followers and (self._changes or is_first is not None):
            changes, self._changes = self._changes, []
            for follower in self._followers:
                follower(is_first, changes)

    @property
    def changes(self) -> int:
        """A number that grows when an action completes or an entry is written."""
        return self.services.actions + self.blackboard.writes

    @property
    def is_tick_wanted(self) -> bool:
        """Whether another tick may do what the last traversal could not: a node asked for one, an
        entry was written that a node had read, or a node of another package may act on a change.

        Without it a RUNNING tree would do the same again: it needs no tick before a wake-up.
        """
        return (self.services.is_tick_wanted or self.blackboard.is_stale
                or self._has_foreign_nodes and self.changes != self._changes_before)

    def tick_exactly_once(self) -> Result:
        """Traverse the tree once; the wake-up signal is ignored."""
        return self.complete(self.traverse(True))

    def tick_once(self) -> Result:
        """Traverse the tree, and again for as long as it is RUNNING and a wake-up was signalled
        meanwhile."""
        result, rounds = self.traverse(True), 1
        while result is RUNNING and self.wake.test_and_clear():
            if rounds == ROUNDS_PER_TICK:
                self.wake.emit()
                break
            rounds += 1
            result = self.traverse(False)
        self.busy_loops = rounds == ROUNDS_PER_TICK
        return self.complete(result)

    @tick_thread_only
    def traverse(self, is_first: bool, root: Optional[Node] = None) -> Result:
        """Traverse the tree, or the part below ``root``, at one moment of its clock.

        Posted callbacks run before the nodes; in the first traversal of a tick, due timers too. The
        caller gives ``complete`` the result.
        """
        if self._ticked is not None:
            self._ticked.clear()
        if self._hidden:
            self.show_own_statuses()
        self._hand_over()
        clock = self.clock
        clock.hold()
        try:
            if is_first:
                clock.run_due()
            else:
                clock.run_posted()
            if self.failure is not None:
                raise self.failure
            self.services.is_tick_wanted = self.blackboard.is_stale = False
            self._changes_before = self.changes
            return (root or self.root).execute()
        finally:
            self.failure = None
            self._hand_over(is_first)
            clock.release()

    def tick_while_running(self, sleep_seconds: float = 0.01) -> Result:
        """Tick until the result is not RUNNING; sleep between ticks, at most until the next
        wake-up. Then the nodes show their results."""
        if self.is_idle:
            for node in self.nodes:
                node.was = IDLE
        while True:
            result = self.tick_once()
            if result is not RUNNING:
                self.show_results()
                return result
            self.sleep(sleep_seconds)

    def sleep(self, seconds: float) -> bool:
        """Wait for the wake-up signal, and run timers when they are due. Return whether it came
        within ``seconds`` of the process."""
        now = self.clock.process.now
        deadline = now() + seconds
        while True:
            self.clock.run_due()
            if self.wake.test_and_clear():
                return True
            left, due_in = deadline - now(), self.clock.time_left()
            if left <= 0.0:
                return False
            self.wake.wait(left if due_in is None else max(0.0, min(left, due_in)))

    def complete(self, result: Result, root: Optional[Node] = None) -> Result:
        """Reset the tree, or the part below ``root``, if that is the result of a tick; return it.
        """
        if result is SUCCESS or result is FAILURE:
            (root or self.root).reset()
            self._hand_over()
        return result

    # --------------------------------------------------------------------------------- for py_trees

    def tick_from(self, root: Node) -> Iterator[Node]:
        """Traverse what is below ``root`` once, and yield each node that was ticked, children
        first.

        Until the next tick these nodes show how they ended, as py_trees' do, though the engine has
        reset them since.
        """
        if self._ticked is None:
            self._ticked = {}
            for node in self.nodes:
                node.intercepted().ticked = self._ticked
        self.complete(self.traverse(True, root), root)
        ticked = dict(self._ticked)
        for node, result in ticked.items():
            shown: Any = result
            if result is SKIPPED:
                shown = IDLE
            if shown is not RUNNING and shown is not node.status:
                self._hidden[node] = node.status
                node.status = shown
        yield from ticked

    def show_results(self) -> None:
        """Let each node that is IDLE again show its last result to py_trees' tools, until the next
        tick."""
        for node in self.nodes:
            if node.status is IDLE and node.was in (SUCCESS, FAILURE):
                self._hidden[node] = IDLE
                node.status = node.was

    def show_own_statuses(self) -> None:
        """Restore the statuses that the engine uses."""
        for node, status in self._hidden.items():
            node.status = status
        self._hidden.clear()

    @tick_thread_only
    def halt(self) -> None:
        """Halt everything (BT.CPP ``haltTree``: every node's ``_onHalted`` script runs, running or
        not)."""
        self.show_own_statuses()
        self.root.halt_node()
        for node in self.nodes:
            if not node.is_apart:
                node.halt_node()
        self.root.reset()
        self._hand_over()

    def stop(self) -> List[BehaviorControllerError]:
        """Halt everything, and leave no node running even if a script or a leaf fails meanwhile.
        Return what was raised."""
        try:
            self.halt()
        except BehaviorControllerError as error:
            raised = [error]
            # children first: then no control has a child left to halt by script
            for node in reversed(self.nodes):
                try:
                    node.interrupt()
                except BehaviorControllerError as another:
                    raised.append(another)
            return raised
        return []

    @property
    def is_idle(self) -> bool:
        """Return whether nothing is under way."""
        return self._hidden.get(self.root, self.root.status) is IDLE
