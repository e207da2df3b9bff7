"""The built-in leaves of BehaviorTree.CPP v4, and the list of every built-in node type with its
ports."""
from typing import Any, Dict, List, Optional

from behavior_controller.bt.engine import controls, decorators, ports, possible_results as possible
from behavior_controller.bt.engine.leaf import ConditionLeaf, SyncActionLeaf, TimedAction
from behavior_controller.bt.engine.node import NodeError, Result
from behavior_controller.bt.script.parser import to_bool
from behavior_controller.bt.values.values import BT_ANY, TEXT, convert
from behavior_controller.bt.engine.registry import Direction, Kind, NodeSpec, Port, Role
from behavior_controller.bt.values.status import FAILURE, SUCCESS
from behavior_controller.text import docstring


class AlwaysSuccess(SyncActionLeaf):
    """SUCCESS, always."""

    result: Result = SUCCESS

    def update(self) -> Result:
        """Return the result."""
        return self.result


class AlwaysFailure(AlwaysSuccess):
    """FAILURE, always."""

    result = FAILURE


class RunScript(decorators.Scripted, SyncActionLeaf):
    """Run a script; always SUCCESS. An empty one does nothing."""

    PORTS = (Port("code", TEXT, description="the script", role=Role.SCRIPT),)

    def update(self) -> Result:
        """Run it."""
        if self.parse():
            self.run()
        return SUCCESS


class ScriptCondition(decorators.Scripted, ConditionLeaf):
    """SUCCESS if a script is true."""

    PORTS = (Port("code", description="script that must be true", role=Role.SCRIPT),)

    def update(self) -> Result:
        """Run it and judge its value."""
        self.parse()
        return SUCCESS if to_bool(self.run()) else FAILURE


class SetBlackboard(SyncActionLeaf):
    """Write a text, or copy an entry, to the entry whose name is ``output_key``."""

    PORTS = (Port("value", description="a text, or {entry} to copy"), Port(
        "output_key", "any", Direction.INOUT, None, "name of the entry to write", Role.WRITES))

    def update(self) -> Result:
        """Write it."""
        # a number is the name that its text is
        key = convert(self.get_input("output_key"), TEXT, {})
        if "value" not in self.attributes:
            raise NodeError("unordered_map::at: port [value] is missing")
        board = self.blackboard
        value, origin, target = self.attributes["value"], TEXT, board.find(key)
        source = ports.reference(value, "value")
        if source is not None:
            entry = board.read(source)
            if entry is None:
                raise NodeError(f"there is no entry [{source}] to copy")
            if target is None:
                target = board.create(key, entry.type)
            if entry.value is None:
                return FAILURE
            value, origin = entry.value, entry.origin
        if target is not None and target.type != TEXT and isinstance(value, str):
            # an entry that a script has made becomes empty, as in the library; since this write
            # makes it a BT::Any, which no text can be, the next one raises
            if target.type == BT_ANY:
                raise NodeError(f"Can't convert string [{value}] to type [BT::Any]")
            value, origin = target.from_text(value), target.type
        board.set_any(key, value, origin)
        return SUCCESS


def _of_write(attributes: possible.Attributes, _children: List[int]) -> int:
    """Return how a SetBlackboard can end: it fails if the entry that it copies is empty."""
    if ports.reference(attributes.get("value", "="), "value") is None:
        return possible.SUCCEEDS
    return possible.OF_A_LEAF


class UnsetBlackboard(SyncActionLeaf):
    """Remove an entry from the blackboard of this tree instance; SUCCESS even if it does not exist.
    """

    PORTS = (Port("key", TEXT, description="name of the entry to remove", role=Role.NAMES),)

    def update(self) -> Result:
        """Remove it."""
        self.blackboard.unset(self.get_input("key"))
        return SUCCESS


class Sleep(TimedAction):
    """RUNNING for ``msec``, then SUCCESS."""

    PORTS = (Port("msec", "uint", description="how long, in ms"),)

    def on_start(self) -> Result:
        """Start the timer."""
        return self.begin(self.get_input("msec"))


class WasEntryUpdated(decorators.Watching, SyncActionLeaf):
    """SUCCESS if ``entry`` was written since this node's last tick, else FAILURE."""

    def update(self) -> Result:
        """Look whether the entry was written."""
        return SUCCESS if self.is_updated() else FAILURE


def _spec(factory: Any, outcome: Optional[possible.Outcome] = None, node_id: str = "",
          is_instant: bool = True, **facts: Any) -> NodeSpec:
    """Return the node type of a class, with the first line of what it does."""
    return NodeSpec(node_id or factory.__name__, factory.KIND, factory, factory.PORTS,
                    docstring(factory).split("\n")[0], outcome=outcome, is_instant=is_instant,
                    **facts)


def _loop(node_id: str, item_type: str, over: str, literal: str = "") -> NodeSpec:
    items = "the items: an entry, or texts with ; between them"
    queue = Port("queue", "any", Direction.INOUT, None, items, literal=literal)
    at_end = "the result when nothing is left"
    if_empty = Port("if_empty", "NodeStatus", default="SUCCESS", description=at_end)
    value = Port("value", item_type, Direction.OUT, None, "the item of this round")
    return NodeSpec(node_id, Kind.DECORATOR, decorators.Loop, (queue, if_empty, value),
                    f"Loop over {over}.", outcome=possible.for_each_item,
                    repeats_on=possible.SUCCEEDS | possible.SKIPS)


def _switch(cases: int) -> NodeSpec:
    variable = Port("variable", TEXT, description="compared with each case", role=Role.CHOICE)
    value = "value that chooses this child"
    case_ports = [Port(f"case_{number}", TEXT, description=value, role=Role.CASE)
                  for number in range(1, cases + 1)]
    return NodeSpec(f"Switch{cases}", Kind.CONTROL, controls.Switch, (variable, *case_ports),
                    outcome=possible.of_any_child, is_instant=True, child_counts=(cases + 1,),
                    children="one for each case and the default")


_IN_SEQUENCE: Dict[str, Any] = {"advances_on": possible.SUCCEEDS}
_IN_FALLBACK: Dict[str, Any] = {"advances_on": possible.FAILS}
_BRANCHES: Dict[str, Any] = {"first_child_chooses": True, "child_counts": (2, 3),
                             "children": "condition, then, else"}
_OR_SKIPS, _OR_FAILS = (possible.of_child(possible.SUCCEEDS, possible.FAILS, always=end)
                        for end in (possible.SKIPS, possible.FAILS))
_SPECS = (
    _spec(controls.Sequence, **_IN_SEQUENCE),
    _spec(controls.AsyncSequence, **_IN_SEQUENCE),
    _spec(controls.SequenceWithMemory, **_IN_SEQUENCE),
    _spec(controls.ReactiveSequence, is_reactive=True, refuses_explicit=True,
          at_most_one=controls.AsyncSequence.__name__, **_IN_SEQUENCE),
    _spec(controls.Fallback, **_IN_FALLBACK),
    _spec(controls.AsyncFallback, **_IN_FALLBACK),
    _spec(controls.ReactiveFallback, is_reactive=True, **_IN_FALLBACK),
    _spec(controls.IfThenElse, **_BRANCHES),
    _spec(controls.WhileDoElse, is_reactive=True, **_BRANCHES),
    _spec(controls.Parallel, possible.in_parallel),
    _spec(controls.ParallelAll, possible.ANY_RESULT),
    _spec(controls.TryCatch, last_child_is_handler=True, fewest_children=2,
          children="the last is the one that catches", **_IN_SEQUENCE),
    *map(_switch, range(2, 7)),
    _spec(decorators.Inverter, possible.of_child(possible.FAILS, possible.SUCCEEDS)),
    _spec(decorators.ForceSuccess, possible.of_child(possible.SUCCEEDS, possible.SUCCEEDS)),
    _spec(decorators.ForceFailure, possible.of_child(possible.FAILS, possible.FAILS)),
    _spec(decorators.KeepRunningUntilFailure, possible.of_child(0, possible.FAILS, 0),
          is_instant=False, repeats_on=possible.SUCCEEDS | possible.SKIPS),
    _spec(decorators.Repeat, rounds="num_cycles", repeats_on=possible.SUCCEEDS),
    _spec(decorators.RetryUntilSuccessful, rounds="num_attempts", repeats_on=possible.FAILS),
    _spec(decorators.RunOnce, _OR_SKIPS),
    _spec(decorators.Precondition, possible.with_precondition),
    _spec(decorators.Delay, possible.of_any_child, is_instant=False, pause="delay_msec"),
    _spec(decorators.Timeout, _OR_FAILS, limit="msec"),
    _loop("LoopInt", "int", "integers", "vec_int"),
    _loop("LoopBool", "bool", "booleans", "vec_bool"),
    _loop("LoopDouble", "double", "reals", "vec_double"),
    _loop("LoopString", TEXT, "texts", "vec_string"),
    _spec(decorators.SkipUnlessUpdated, _OR_SKIPS),
    _spec(decorators.WaitValueUpdate, possible.of_any_child, is_instant=False),
    _spec(AlwaysSuccess, possible.SUCCEEDS),
    _spec(AlwaysFailure, possible.FAILS),
    _spec(RunScript, possible.SUCCEEDS, "Script"),
    _spec(SetBlackboard, _of_write),
    _spec(UnsetBlackboard, possible.SUCCEEDS),
    _spec(Sleep, possible.SUCCEEDS, is_instant=False, pause="msec"),
    _spec(WasEntryUpdated),
    _spec(ScriptCondition),
    NodeSpec("SubTree", Kind.SUBTREE, decorators.SubTree, decorators.SubTree.PORTS,
             "Another tree of the file in this place.", outcome=possible.of_any_child))


def builtin_specs() -> List[NodeSpec]:
    """Return every node type that BehaviorTree.CPP 4 registers by itself."""
    return list(_SPECS)
