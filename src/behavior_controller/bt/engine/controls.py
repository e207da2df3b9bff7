"""The control nodes of BehaviorTree.CPP v4, each with its own rule for ticking several children.

A control node stores RUNNING at the start of its tick. When it returns SKIPPED its stored status
therefore stays RUNNING, and its parent will halt it: that is the library's behaviour, recorded in
its traces.
"""
from typing import Any, Dict, Iterator, Optional, Tuple

from py_trees import composites
from py_trees.common import ParallelPolicy

from behavior_controller.bt.engine.node import NodeError, Parent, Result, halt_child
from behavior_controller.bt.engine import ports
from behavior_controller.bt.engine.registry import Kind, Port, Role
from behavior_controller.bt.values.status import FAILURE, IDLE, RUNNING, SKIPPED, SUCCESS


class Control(Parent, composites.Composite):
    """A node with one or more children."""

    KIND = Kind.CONTROL

    @property
    def current_child(self) -> Any:
        """The last child that is not INVALID, or None (py_trees)."""
        return next((child for child in reversed(self.children) if child.status is not IDLE), None)


class _InOrder(Control):
    """The base of Sequence and Fallback, which differ in ``ends_at``, the child's result that ends
    them."""

    ends_at = FAILURE
    goes_on_at = SUCCESS
    memory = True
    handlers = 0
    """How many children at the end are not ticked in order."""
    yields = False
    """Whether to yield (RUNNING and a wake-up) after a child that completed at once."""
    ROUND: Tuple[str, ...] = ("index", "skipped")
    index = skipped = 0

    def update(self) -> Result:
        """Tick the children from where the last tick stopped."""
        if self.status is not RUNNING:
            if self.status is IDLE:
                self.skipped = 0
            self.store(RUNNING)
        children = self.children
        count = len(children) - self.handlers
        while self.index < count:
            child = children[self.index]
            was_idle, result = child.status is IDLE, child.execute()
            if result is self.goes_on_at:
                self.index += 1
                if self.yields and was_idle and self.index < count:
                    self.wake()
                    return RUNNING
            elif result is RUNNING:
                return RUNNING
            elif result is SKIPPED:
                self.index += 1
                self.skipped += 1
            else:
                return self.ended()
        all_skipped = self.skipped == count
        self.halt_children()
        self.index = self.skipped = 0
        return SKIPPED if all_skipped else self.goes_on_at

    def ended(self) -> Result:
        """End early. The count of skipped children is not cleared, as in the library."""
        self.halt_children()
        self.index = 0
        return self.ends_at


class Sequence(_InOrder, composites.Sequence):
    """Children in order, each must succeed."""


class AsyncSequence(Sequence):
    """A Sequence that yields after each child that succeeded at once."""

    yields = True


class SequenceWithMemory(AsyncSequence):
    """A Sequence that resumes at the child that failed or was halted. It yields like AsyncSequence.
    """

    ROUND = ()

    def ended(self) -> Result:
        """Halt only the children from here on; keep the place."""
        for child in self.children[self.index:]:
            if child.status is not IDLE:
                halt_child(child)
        return FAILURE


class Fallback(_InOrder, composites.Selector):
    """Children in order until one succeeds."""

    ends_at = SUCCESS
    goes_on_at = FAILURE


class AsyncFallback(Fallback):
    """A Fallback that yields after each child that failed at once."""

    yields = True


class _Reactive(Control):
    """The base of ReactiveSequence and ReactiveFallback: every tick begins at the first child."""

    ends_at = FAILURE
    goes_on_at = SUCCESS
    memory = False

    def update(self) -> Result:
        """Tick the children from the first; a RUNNING one halts all others."""
        self.begin()
        skipped, has_acted = 0, False
        for child in self.children:
            actions, was_running = self.services.actions, child.status is RUNNING
            result = child.execute()
            if result is RUNNING:
                if has_acted:
                    self.ask_for_tick()
                for other in self.children:
                    if other is not child and other.status is not IDLE:
                        halt_child(other)
                return RUNNING
            if result is self.ends_at:
                self.halt_children()
                return result
            has_acted |= was_running or self.services.actions != actions  # it may begin again
            if result is SKIPPED:
                skipped += 1
                halt_child(child)
        self.halt_children()
        return SKIPPED if skipped == len(self.children) else self.goes_on_at


class ReactiveSequence(_Reactive, composites.Sequence):
    """A Sequence that ticks its first children again at every tick."""


class ReactiveFallback(_Reactive, composites.Selector):
    """A Fallback that ticks its first children again at every tick."""

    ends_at = SUCCESS
    goes_on_at = FAILURE


class ParallelBase(Control, composites.Parallel):
    """The base of Parallel and ParallelAll. A child that has completed keeps its status until all
    are reset, and is not ticked before."""

    policy = ParallelPolicy.SuccessOnAll(synchronise=False)

    def threshold(self, port: str, verb: str) -> int:
        """Return the count of a port: negative values count from the end, -1 is all."""
        value, count = self.get_input(port), len(self.children)
        if value > count:
            raise NodeError(f"Number of children is less than threshold. Can never {verb}.")
        if value < 0:
            return max(count + value + 1, 0)
        return value

    def tick_children(self) -> Iterator[Tuple[int, int, int]]:
        """Tick every child that has not completed, and yield after each child how many have
        succeeded, have failed and were skipped."""
        statuses = [child.status for child in self.children]
        successes, failures, skipped = statuses.count(SUCCESS), statuses.count(FAILURE), 0
        for child, status in zip(self.children, statuses):
            if status is not SUCCESS and status is not FAILURE:
                result = child.execute()
                successes += result is SUCCESS
                failures += result is FAILURE
                skipped += result is SKIPPED
            yield successes, failures, skipped

    def complete(self, result: Result) -> Result:
        """Complete with ``result``."""
        self.halt_children()
        return result


def _count(name: str, default: str, description: str) -> Port:
    return Port(name, "int", default=default, description=description, role=Role.CHILDREN)


class Parallel(ParallelBase):
    """All children at once; ``success_count`` and ``failure_count`` decide, and are tested after
    every child."""

    PORTS = (_count("success_count", "-1", "children that must succeed; -1 is all"),
             _count("failure_count", "1", "children that must fail to fail; -1 is all"))

    def update(self) -> Result:
        """Tick every child that has not completed, until the thresholds decide."""
        needed = self.threshold("success_count", "succeed")
        allowed = self.threshold("failure_count", "fail")
        count, skipped = len(self.children), 0
        skips_count = self.get_input("success_count") < 0
        self.begin()
        for successes, failures, skipped in self.tick_children():
            if successes >= needed or (skips_count and successes + skipped >= needed):
                return self.complete(SUCCESS)
            if count - failures < needed or failures == allowed:
                return self.complete(FAILURE)
        return SKIPPED if skipped == count else RUNNING


class ParallelAll(ParallelBase):
    """All children to their end; FAILURE if at least ``max_failures`` of them failed."""

    PORTS = (_count("max_failures", "1", "FAILURE if at least as many children fail"),)

    def update(self) -> Result:
        """Tick every child that has not completed."""
        allowed, count = self.threshold("max_failures", "fail"), len(self.children)
        self.begin()
        *_, (successes, failures, skipped) = self.tick_children()
        if skipped == count:
            return SKIPPED
        if successes + failures + skipped == count:
            return self.complete(FAILURE if failures >= allowed else SUCCESS)
        return RUNNING


_CHOSEN: Dict[Result, int] = {SUCCESS: 1, FAILURE: 2}
"""The child that follows, by the result of the condition."""


class _Branches(Control):
    """The base of IfThenElse and WhileDoElse."""

    def begin(self) -> None:
        """Store RUNNING. Raises NodeError unless there are two or three children."""
        if len(self.children) not in (2, 3):
            raise NodeError(f"{type(self).__name__}Node must have either 2 or 3 children")
        Parent.begin(self)


class IfThenElse(_Branches):
    """The second child if the first succeeds, else the third (or FAILURE); the first is not ticked
    again meanwhile."""

    ROUND = ("branch",)
    branch = 0  # 0: the condition

    def update(self) -> Result:
        """Tick the condition once, then the branch that it chose."""
        self.begin()
        if self.branch == 0:
            was, result = self.children[0].status, self.children[0].execute()
            if result is RUNNING:
                return RUNNING
            if result is SKIPPED:
                raise NodeError("Something unexpected happened in IfThenElseNode")
            if result is FAILURE and len(self.children) == 2:
                # the condition keeps its status, with which its next tick may differ
                self.services.actions += was is not result
                return FAILURE
            self.branch = _CHOSEN[result]
        result = self.children[self.branch].execute()
        if result is not RUNNING:
            self.branch = 0
            self.halt_children()
        return result


class WhileDoElse(_Branches):
    """As IfThenElse, but the condition is ticked at every tick, and a new result changes the
    branch."""

    def update(self) -> Result:
        """Tick the condition, halt the other branch, tick the chosen one."""
        self.begin()
        actions, was = self.services.actions, self.children[0].status
        result = self.children[0].execute()
        # the condition keeps its status, with which its next tick may differ
        if result is not RUNNING and (result is not was or self.services.actions != actions):
            self.ask_for_tick()
        if result is SKIPPED:
            result = IDLE  # which is refused, as in the library
        elif result is SUCCESS or (result is FAILURE and len(self.children) == 3):
            chosen = _CHOSEN[result]
            if len(self.children) == 3:
                halt_child(self.children[3 - chosen])
            result = self.children[chosen].execute()
        if result is not RUNNING:
            self.halt_children()
        return result


class Switch(Control):
    """The child whose ``case_i`` equals ``variable``, else the last one."""

    ROUND = ("running",)
    running: Optional[int] = None

    def update(self) -> Result:
        """Choose again at every tick; a RUNNING child that is no longer chosen is halted."""
        if len(self.children) not in self.spec.child_counts:
            raise NodeError("Wrong number of children in SwitchNode; must be (num_cases + default)")
        chosen = self._choose()
        if self.running is not None and self.running != chosen:
            halt_child(self.children[self.running])
        self.running = None
        result = self.children[chosen].execute()
        if result is RUNNING:
            self.running = chosen
        elif result is not SKIPPED:
            self.halt_children()
        return result

    def _choose(self) -> int:
        default = len(self.children) - 1
        variable, enums = self.input_or("variable", None), self.services.enums
        if variable is None:
            return default
        for index in range(default):
            case = self.input_or(f"case_{index + 1}", None)
            if case is not None and ports.same_text_or_number(variable, case, enums):
                return index
        return default


class TryCatch(_InOrder):
    """All children but the last in order; if one fails, the last one runs and the node fails."""

    PORTS = (Port("catch_on_halt", "bool", default="false",
                  description="tick the last child on a halt too"),)
    ROUND = ("index", "skipped", "catching")
    handlers = 1
    catching = False

    def update(self) -> Result:
        """Tick the try block, or the catch child once the block has failed."""
        if self.status is IDLE:
            self.catching = False
        if self.catching:
            return self._catch()
        return super().update()

    def ended(self) -> Result:
        """Go on with the catch child."""
        self.halt_children()
        self.catching = True
        return self._catch()

    def _catch(self) -> Result:
        if self.children[-1].execute() is RUNNING:
            return RUNNING
        self.catching, self.skipped = False, 0
        return super().ended()

    def halt(self) -> None:
        """With ``catch_on_halt``, give the catch child one tick first."""
        *tries, catch = self.children
        if (self.status is not IDLE and not self.catching
                and self.input_or("catch_on_halt", False)):
            for child in tries:
                halt_child(child)
            if catch.execute() is RUNNING:
                halt_child(catch)
        super().halt()
