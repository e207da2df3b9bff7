"""The built-in leaves of BehaviorTree.CPP v4, and the list of every built-in node type with its ports."""
from functools import partial
from typing import Any, Dict, List, Optional, Tuple

from behavior_controller.bt import ends
from behavior_controller.bt.engine import controls, decorators
from behavior_controller.bt.engine.clock import Timer
from behavior_controller.bt.engine.leaf import ActionLeaf, ConditionLeaf, SyncActionLeaf
from behavior_controller.bt.engine.node import ConfigureError, NodeError, Result
from behavior_controller.bt.language import ports
from behavior_controller.bt.language.script import Script, compile_script, to_bool
from behavior_controller.bt.language.values import TEXT, ValueFault
from behavior_controller.bt.registry import Direction, Kind, NodeSpec, Port, Role
from behavior_controller.bt.status import FAILURE, RUNNING, SUCCESS

Factory = Any  # a class of nodes


class AlwaysSuccess(SyncActionLeaf):
    """SUCCESS, always."""

    def update(self) -> Result:
        """Succeed."""
        return SUCCESS


class AlwaysFailure(SyncActionLeaf):
    """FAILURE, always."""

    def update(self) -> Result:
        """Fail."""
        return FAILURE


class _Code:
    """The script of port ``code``: read when the tree is made, and again when the text changes."""

    script: Script

    def configure(self: Any) -> None:
        """Parse the script; a reference must be readable already."""
        try:
            text = self.get_input("code")
        except ports.PortError as error:
            raise ConfigureError("Missing port [code] in {}: {}".format(self.registration_id, error), "code") from error
        self.script = compile_script(text, allow_empty=True)

    def run(self: Any) -> Any:
        """Run the script."""
        text = self.get_input("code")
        if text != self.script.text:
            self.script = compile_script(text, allow_empty=True)
        return self.script.run(self.blackboard, self.services.enums)


class RunScript(_Code, SyncActionLeaf):
    """Run a script; always SUCCESS. An empty one does nothing."""

    def update(self) -> Result:
        """Run it."""
        if self.get_input("code"):
            self.run()
        return SUCCESS


class ScriptCondition(_Code, ConditionLeaf):
    """SUCCESS if the value of a script is true."""

    def update(self) -> Result:
        """Run it and judge its value."""
        return SUCCESS if to_bool(self.run()) else FAILURE


class SetBlackboard(SyncActionLeaf):
    """Write a text, or copy an entry, to the entry whose name is ``output_key``."""

    def update(self) -> Result:
        """Write it."""
        key = self._key()
        if "value" not in self.attributes:
            raise NodeError("unordered_map::at: port [value] is missing")
        source = ports.reference(self.attributes["value"], "value")
        if source is None:
            return self._write_text(key, self.attributes["value"])
        return self._copy(key, source)

    def _key(self) -> str:
        try:
            return self.get_input("output_key")
        except ports.PortError as error:
            raise NodeError("missing port [output_key]: {}".format(error)) from error

    def _write_text(self, key: str, text: str) -> Result:
        entry = self.blackboard.find(key)
        if entry is None or entry.type == TEXT:
            self.blackboard.set_any(key, text, TEXT)
        else:
            # an entry of generic type has no conversion and becomes empty, as in the library
            self.blackboard.set_any(key, self._converted(text, entry), entry.type)
        return SUCCESS

    def _copy(self, key: str, source: str) -> Result:
        entry = self.blackboard.find(source)
        if entry is None:
            raise NodeError("there is no entry [{}] to copy".format(source))
        target = self.blackboard.find(key)
        if target is None:
            target = self.blackboard.create(key, entry.type)
        if entry.value is None:
            return FAILURE
        value, origin = entry.value, entry.origin
        if isinstance(value, str) and target.type != TEXT:
            value, origin = self._converted(value, target), target.type
        self.blackboard.set_any(key, value, origin)
        return SUCCESS

    @staticmethod
    def _converted(text: str, entry: Any) -> Any:
        try:
            return entry.from_text(text)
        except ValueFault as fault:
            raise NodeError("Can't convert string [{}] to type [{}]: {}".format(text, entry.type, fault)) from fault


class UnsetBlackboard(SyncActionLeaf):
    """Remove an entry from the blackboard of this tree instance; SUCCESS even if it does not exist."""

    def update(self) -> Result:
        """Remove it."""
        try:
            key = self.get_input("key")
        except ports.PortError as error:
            raise NodeError("missing input port [key]: {}".format(error)) from error
        self.blackboard.unset(key)
        return SUCCESS


class Sleep(ActionLeaf):
    """RUNNING for ``msec``, then SUCCESS."""

    timer: Optional[Timer] = None
    over = False

    def on_start(self) -> Result:
        """Start the timer."""
        try:
            msec = self.get_input("msec")
        except ports.PortError as error:
            raise NodeError("Missing parameter [msec] in SleepNode: {}".format(error)) from error
        if msec == 0:
            return SUCCESS
        self.over = False
        self.timer = self.clock.call_after(msec / 1000.0, self._due)
        return RUNNING

    def _due(self) -> None:
        self.over = True
        self.wake()

    def on_running(self) -> Result:
        """Wait for the timer."""
        return SUCCESS if self.over else RUNNING

    def on_halted(self) -> None:
        """Cancel the timer."""
        if self.timer is not None:
            self.timer.cancel()


class WasEntryUpdated(SyncActionLeaf):
    """SUCCESS if ``entry`` was written since this node's last tick, else FAILURE."""

    seen = 0
    key = ""

    def configure(self) -> None:
        """Find the entry's name."""
        self.key = decorators.entry_key(self)

    def update(self) -> Result:
        """Compare the entry's write counter."""
        entry = self.blackboard.find(self.key)
        if entry is None or entry.sequence == self.seen:
            return FAILURE
        self.seen = entry.sequence
        self.services.changes += 1
        return SUCCESS


def _in(name: str, type_name: str, default: Optional[str] = None, description: str = "",
        role: Role = Role.DATA) -> Port:
    return Port(name, type_name, Direction.IN, default, description, role)


def _count(name: str, default: str, description: str, if_zero: str) -> Port:
    return Port(name, "int", Direction.IN, default, description, Role.CHILDREN, if_zero=if_zero)


def _loop(factory: Factory, item_type: str, literal: str = "") -> NodeSpec:
    return _decorator(factory, (
        Port("queue", "any", Direction.INOUT, None, "the items: an entry, or texts with ; between them",
             literal=literal),
        _in("if_empty", "NodeStatus", "SUCCESS", "the result when nothing is left"),
        Port("value", item_type, Direction.OUT, None, "the item of this round")), ends.for_each_item, is_instant=False)


def _switch(cases: int) -> NodeSpec:
    names = ["case_{}".format(number + 1) for number in range(cases)]
    return NodeSpec("Switch{}".format(cases), Kind.CONTROL, partial(controls.Switch, cases=cases),
                    (_in("variable", TEXT, None, "compared with each case", Role.CHOICE),)
                    + tuple(_in(name, TEXT, None, "value that chooses this child", Role.CASE) for name in names),
                    outcome=ends.of_any_child, is_instant=True, child_counts=(cases + 1,),
                    children="one for each case and the default")


def _described(factory: Factory) -> str:
    return (factory.__doc__ or "").split("\n")[0]


def _control(factory: Factory, outcome: ends.Outcome, ports_: Tuple[Port, ...] = (), **facts: Any) -> NodeSpec:
    return NodeSpec(factory.__name__, Kind.CONTROL, factory, ports_, _described(factory), outcome=outcome,
                    is_instant=True, **facts)


def _sequence(factory: Factory, **facts: Any) -> NodeSpec:
    return _control(factory, ends.in_sequence, next_after=ends.SUCCEEDS, **facts)


def _fallback(factory: Factory) -> NodeSpec:
    return _control(factory, ends.in_fallback, next_after=ends.FAILS)


def _decorator(factory: Factory, ports_: Tuple[Port, ...], outcome: ends.Outcome, is_instant: bool = True,
               **facts: Any) -> NodeSpec:
    return NodeSpec(factory.__name__, Kind.DECORATOR, factory, ports_, _described(factory), outcome=outcome,
                    is_instant=is_instant, **facts)


def _action(node_id: str, factory: Factory, ports_: Tuple[Port, ...] = (), outcome: Optional[int] = None,
            is_instant: bool = True) -> NodeSpec:
    return NodeSpec(node_id, Kind.ACTION, factory, ports_, _described(factory), outcome=outcome, is_instant=is_instant)


_DECIDED = "is decided before any child has done its work"
_BRANCHES: Dict[str, Any] = {"child_counts": (2, 3), "children": "condition, then, else"}
_ENTRY = (_in("entry", "Any", None, "the entry to watch", Role.WATCHED),)
_SPECS = (
    _sequence(controls.Sequence), _sequence(controls.AsyncSequence), _sequence(controls.SequenceWithMemory),
    _sequence(controls.ReactiveSequence, refuses_explicit=True, at_most_one=controls.AsyncSequence.__name__),
    _fallback(controls.Fallback), _fallback(controls.AsyncFallback), _fallback(controls.ReactiveFallback),
    _control(controls.IfThenElse, ends.chosen, **_BRANCHES), _control(controls.WhileDoElse, ends.chosen, **_BRANCHES),
    _control(controls.Parallel, ends.in_parallel, (
        _count("success_count", "-1", "children that must succeed; -1 is all", _DECIDED),
        _count("failure_count", "1", "children that must fail to fail; -1 is all", _DECIDED))),
    _control(controls.ParallelAll, ends.ANY, (
        _count("max_failures", "1", "FAILURE if at least as many children fail",
               "waits for all children, and is then always FAILURE"),)),
    _control(controls.TryCatch, ends.in_sequence_before_the_last,
             (_in("catch_on_halt", "bool", "false", "tick the last child on a halt too"),), fewest_children=2,
             children="the last is the one that catches", next_after=ends.SUCCEEDS, last_is_apart=True),
) + tuple(map(_switch, range(2, 7))) + (
    _decorator(decorators.Inverter, (), ends.swapped),
    _decorator(decorators.ForceSuccess, (), ends.forced(ends.SUCCEEDS)),
    _decorator(decorators.ForceFailure, (), ends.forced(ends.FAILS)),
    _decorator(decorators.KeepRunningUntilFailure, (), ends.until_failure, is_instant=False),
    _decorator(decorators.Repeat, (_in("num_cycles", "int", None, "rounds; -1: no limit"),), ends.repeated,
               rounds="num_cycles", repeats_on=ends.SUCCEEDS),
    _decorator(decorators.RetryUntilSuccessful, (_in("num_attempts", "int", None, "attempts; -1: no limit"),),
               ends.retried, rounds="num_attempts", repeats_on=ends.FAILS),
    _decorator(decorators.RunOnce, (
        _in("then_skip", "bool", "true", "later ticks are SKIPPED, else they repeat the result"),),
        ends.of_any_child_or(ends.SKIPS)),
    _decorator(decorators.Precondition, (
        _in("if", TEXT, None, "script that must be true", Role.SCRIPT),
        _in("else", "NodeStatus", "FAILURE", "the result if it is not")), ends.with_precondition),
    _decorator(decorators.Delay, (_in("delay_msec", "uint", None, "wait that long, in ms"),), ends.of_any_child,
               is_instant=False),
    _decorator(decorators.Timeout, (_in("msec", "uint", None, "the longest time of the child, in ms; 0: no limit"),),
               ends.of_any_child_or(ends.FAILS)),
    _loop(decorators.LoopInt, "int", "vec_int"), _loop(decorators.LoopBool, "bool"),
    _loop(decorators.LoopDouble, "double", "vec_double"), _loop(decorators.LoopString, TEXT),
    _decorator(decorators.SkipUnlessUpdated, _ENTRY, ends.of_any_child_or(ends.SKIPS)),
    _decorator(decorators.WaitValueUpdate, _ENTRY, ends.of_any_child, is_instant=False),
    _action("AlwaysSuccess", AlwaysSuccess, outcome=ends.SUCCEEDS),
    _action("AlwaysFailure", AlwaysFailure, outcome=ends.FAILS),
    _action("Script", RunScript, (_in("code", TEXT, None, "the script", Role.SCRIPT),), ends.SUCCEEDS),
    _action("SetBlackboard", SetBlackboard, (
        _in("value", "any", None, "a text, or {entry} to copy"),
        Port("output_key", "any", Direction.INOUT, None, "name of the entry to write", Role.WRITES))),
    _action("UnsetBlackboard", UnsetBlackboard, (
        _in("key", TEXT, None, "name of the entry to remove", Role.NAMES),), ends.SUCCEEDS),
    _action("Sleep", Sleep, (_in("msec", "uint", None, "how long, in ms"),), ends.SUCCEEDS, is_instant=False),
    _action("WasEntryUpdated", WasEntryUpdated, _ENTRY),
    NodeSpec("ScriptCondition", Kind.CONDITION, ScriptCondition,
             (_in("code", "any", None, "script that must be true", Role.SCRIPT),), "SUCCESS if a script is true.",
             is_instant=True),
    NodeSpec("SubTree", Kind.SUBTREE, decorators.SubTree,
             (_in("_autoremap", "bool", "false", "entries of equal name are the parent's"),),
             "Another tree of the file in this place."),
)


def builtin_specs() -> List[NodeSpec]:
    """Return every node type that BehaviorTree.CPP 4 registers by itself."""
    return list(_SPECS)
