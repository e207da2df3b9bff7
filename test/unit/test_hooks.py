"""Hooks without a wire: the list that clients see, and what the tick thread makes of it, also when
both change at once."""
import itertools
import types

import pytest

from behavior_controller.bt.mission import load_text
from behavior_controller.bt.engine.builtins import builtin_specs
from behavior_controller.bt.engine.leaf import ActionLeaf, SyncActionLeaf
from behavior_controller.bt.engine.node import TickError
from behavior_controller.bt.engine.node_types import Registry
from behavior_controller.bt.engine.registry import Kind, NodeSpec
from behavior_controller.bt.values.status import FAILURE, RUNNING, SKIPPED, SUCCESS
from behavior_controller.run.events import BreakpointChanged
from behavior_controller.run.from_viewer import (
    AFTER, BEFORE, BREAKPOINT, REPLACE, SET, Hook, HookChange, HookPlace, Unlocking)
from behavior_controller.missions import breakpoints
from behavior_controller.missions.breakpoints import Breakpoints
from behavior_controller.run.record.tree_shown import shown
from behavior_controller.viewer.hook_list import HookList


class Probe(ActionLeaf):
    """Calls ``during`` while it is ticked, which sees the tick half done, and is done at once."""

    during = staticmethod(lambda: None)
    halted = 0

    def on_start(self):
        self.during()
        return SUCCESS

    def on_halted(self):
        self.halted += 1


class Busy(Probe):
    """Goes on until it is halted."""

    def on_start(self):
        return RUNNING

    def on_running(self):
        return RUNNING


class Instant(SyncActionLeaf):
    """An action that breaks the rule that it must end within its tick."""

    def update(self):
        return RUNNING


SPECS = builtin_specs() + [NodeSpec("Probe", Kind.ACTION, Probe),
                           NodeSpec("Instant", Kind.ACTION, Instant),
                           NodeSpec("Busy", Kind.ACTION, Busy)]


class Hooks(HookList):
    """The list of hooks of a tree, and its nodes, which follow: what each of both sends reaches the
    other at once. ``held`` has for each event of a breakpoint whether it holds its node."""

    def __init__(self, tree, tell=lambda line: None):
        self.held = []
        self.nodes = Breakpoints(self._take, tell)
        self.nodes.show(tree)
        super().__init__(shown(tree, specs=SPECS), self.nodes.change)

    def _take(self, event):
        if isinstance(event, BreakpointChanged):
            assert (event.uid, event.path) == (1, self.tree.nodes[0].path)
            self.held.append(event.is_held)
        else:
            self.end(event)


def hooked(body):
    """Return a tree, its hooks, and the lines that the operator is told."""
    tree = load_text(
        "<root BTCPP_format='4'><BehaviorTree ID='M'>{}</BehaviorTree></root>".format(body),
        Registry(SPECS))
    lines = []
    return tree, Hooks(tree, lines.append), lines


def test_a_hook_that_went_by_itself_while_it_was_unlocked_is_gone():
    tree, hooks, lines = hooked("<Probe/>")
    hooks.insert([Hook(1, AFTER, REPLACE, True, True, "FAILURE")])
    tree.root.during = lambda: hooks.unlock(Unlocking(1, AFTER, "SUCCESS", False))
    assert tree.tick_exactly_once() is FAILURE
    tree.root.during = lambda: None
    assert tree.tick_exactly_once() is SUCCESS
    assert hooks.all() == [] and "lets the node go on" not in "".join(lines)


def test_a_tick_follows_the_one_in_which_a_hook_went_by_itself():
    tree, hooks, _ = hooked("<KeepRunningUntilFailure><AlwaysFailure/></KeepRunningUntilFailure>")
    hooks.insert([Hook(2, BEFORE, REPLACE, True, True, "SUCCESS")])
    assert tree.tick_exactly_once() is RUNNING and tree.is_tick_wanted
    assert tree.tick_exactly_once() is FAILURE


@pytest.mark.parametrize("ask", [lambda hooks: hooks.remove(HookPlace(1, AFTER)),
                                 lambda hooks: hooks.unlock(Unlocking(1, AFTER, "SUCCESS", False))])
def test_a_hook_that_went_by_itself_is_not_there_any_more(ask):
    tree, hooks, _ = hooked("<Probe/>")
    hooks.insert([Hook(1, AFTER, REPLACE, True, True, "FAILURE")])
    assert ask(hooks) is True
    hooks.insert([Hook(1, AFTER, REPLACE, True, True, "FAILURE")])
    assert tree.tick_exactly_once() is FAILURE
    assert ask(hooks) is False


def test_a_hook_set_where_one_went_by_itself_stays():
    tree, hooks, _ = hooked("<Probe/>")
    hook = Hook(1, AFTER, REPLACE, True, True, "FAILURE")
    hooks.insert([hook])
    tree.root.during = lambda: hooks.insert([hook])
    assert tree.tick_exactly_once() is FAILURE
    assert hooks.all() == [hook]
    tree.root.during = lambda: None
    assert tree.tick_exactly_once() is FAILURE
    assert hooks.all() == []


def test_of_many_hooks_for_one_place_the_last_counts():
    tree, hooks, lines = hooked("<Probe/>")
    hooks.insert([Hook(1, BEFORE, REPLACE, False, True, "FAILURE")] * 1000 +
                 [Hook(1, BEFORE, REPLACE, False, True, "SUCCESS")])
    assert tree.tick_exactly_once() is SUCCESS
    assert len([line for line in lines if "is set" in line]) == 1


@pytest.mark.parametrize("condition, expected", [("_successIf", SUCCESS), ("_failureIf", FAILURE),
                                                 ("_skipIf", SKIPPED)])
def test_hooks_are_inside_the_conditions(condition, expected):
    tree, hooks, _ = hooked("<Probe {}='true'/>".format(condition))
    hooks.insert([
        Hook(1, position, REPLACE, False, True, "FAILURE" if expected is SUCCESS else "SUCCESS")
        for position in (BEFORE, AFTER)])
    assert tree.tick_exactly_once() is expected


def test_post_conditions_follow_what_a_hook_decides():
    tree, hooks, _ = hooked("<Probe _onFailure='x := 7'/>")
    hooks.insert([Hook(1, AFTER, REPLACE, False, True, "FAILURE")])
    assert tree.tick_exactly_once() is FAILURE and tree.blackboard.get("x") == 7


def test_a_hook_does_not_let_an_instant_action_run_on():
    tree, hooks, _ = hooked("<Sequence><Instant/></Sequence>")
    hooks.insert([Hook(2, BEFORE, REPLACE, False, True, "SKIPPED")])
    with pytest.raises(TickError, match="SyncActionNode MUST never return RUNNING"):
        tree.tick_exactly_once()


@pytest.mark.parametrize("halt", ["halt_node", "interrupt"])
def test_a_node_that_waits_before_its_work_has_none_to_halt(halt):
    tree, hooks, _ = hooked("<Probe/>")
    hooks.insert([Hook(1, BEFORE, BREAKPOINT, False, True, "SKIPPED")])
    assert tree.tick_exactly_once() is RUNNING
    getattr(tree.root, halt)()
    assert tree.is_idle and tree.root.halted == 0
    assert hooks.held == [True, False]


def test_a_node_that_works_is_halted_whatever_waits_for_its_end():
    tree, hooks, _ = hooked("<Busy/>")
    hooks.insert([Hook(1, AFTER, BREAKPOINT, True, False, "SUCCESS")])
    assert tree.tick_exactly_once() is RUNNING
    tree.root.halt_node()
    assert tree.root.halted == 1 and tree.is_idle


def test_the_operator_is_told_that_a_hook_is_removed():
    tree, hooks, lines = hooked("<Busy/>")
    hooks.insert([Hook(1, AFTER, BREAKPOINT, True, False, "SUCCESS")])
    tree.tick_exactly_once()
    hooks.remove(HookPlace(1, AFTER))
    tree.tick_exactly_once()
    assert lines[-1] == "Groot2: breakpoint after {} is removed".format(tree.root.full_path)


def steps(body, *actions):
    """Carry out each action, then tick; return the results, the lines about hooks without what all
    of them begin with, and the hooks."""
    tree, hooks, lines = hooked(body)
    results = []
    for action in actions:
        action(hooks)
        results.append(tree.tick_exactly_once())
    short = [line.replace("Groot2: ", "").replace(tree.root.full_path + " ", "") for line in lines]
    return results, short, hooks


def sets(position=BEFORE, mode=BREAKPOINT, once=False, enabled=True, status="FAILURE"):
    return lambda hooks: hooks.insert([Hook(1, position, mode, once, enabled, status)])


def unlocks(status="SKIPPED", remove=False, position=BEFORE):
    return lambda hooks: hooks.unlock(Unlocking(1, position, status, remove))


WAITS, DISABLES, REMOVES_ALL = (lambda hooks: None), Hooks.disable_all, Hooks.remove_all
REMOVES = lambda hooks: hooks.remove(HookPlace(1, BEFORE), ": so")  # noqa: E731
HOLDS = ["breakpoint before is set"]
GOES_ON, REMOVED = "breakpoint before lets the node go on", "breakpoint before is removed"
DECIDES = "breakpoint before decides FAILURE and the node is not run"
REPLACES = ["replacement before is set to FAILURE",
            "replacement before decides FAILURE and the node is not run"]
HOLDS_AFTER, GOES_ON_AFTER = "breakpoint after is set", "breakpoint after lets the node go on"


@pytest.mark.parametrize("actions, results, lines", [
    ([sets(), WAITS, unlocks()], [RUNNING, RUNNING, SUCCESS], HOLDS + [GOES_ON]),
    ([sets(), unlocks("FAILURE"), WAITS], [RUNNING, FAILURE, RUNNING], HOLDS + [GOES_ON, DECIDES]),
    ([sets(), unlocks("FAILURE", True), WAITS], [RUNNING, FAILURE, SUCCESS],
     HOLDS + [GOES_ON, DECIDES, REMOVED]),
    ([sets(once=True), unlocks(), WAITS], [RUNNING, SUCCESS, SUCCESS], HOLDS + [GOES_ON, REMOVED]),
    ([sets(), DISABLES, WAITS], [RUNNING, SUCCESS, SUCCESS],
     HOLDS + ["breakpoint before is disabled"]),
    ([sets(), sets(enabled=False)], [RUNNING, SUCCESS],
     HOLDS + ["breakpoint before is set, but disabled"]),
    ([sets(), sets(), unlocks()], [RUNNING, RUNNING, SUCCESS], HOLDS + HOLDS + [GOES_ON]),
    ([sets(), REMOVES], [RUNNING, SUCCESS], HOLDS + [REMOVED + ": so"]),
    ([sets(), REMOVES_ALL], [RUNNING, SUCCESS], HOLDS + [REMOVED]),
    ([sets(), REMOVES, sets()], [RUNNING, SUCCESS, RUNNING], HOLDS + [REMOVED + ": so"] + HOLDS),
    # as in the library, it waits to be let go
    ([sets(), sets(mode=REPLACE), unlocks()], [RUNNING, RUNNING, SUCCESS],
     HOLDS + [REPLACES[0], "replacement before lets the node go on"]),
    ([sets(AFTER), sets(AFTER, REPLACE), unlocks(position=AFTER)], [RUNNING, RUNNING, SUCCESS],
     [HOLDS_AFTER, "replacement after is set to FAILURE",
      "replacement after lets the node go on"]),
    ([unlocks(), REMOVES, WAITS], [SUCCESS] * 3, []),
    ([sets(AFTER), WAITS, unlocks(position=AFTER)], [RUNNING, RUNNING, SUCCESS],
     [HOLDS_AFTER, GOES_ON_AFTER]),
    ([sets(AFTER), unlocks("FAILURE", position=AFTER), WAITS], [RUNNING, FAILURE, RUNNING],
     [HOLDS_AFTER, GOES_ON_AFTER,
      "breakpoint after decides FAILURE instead of the node's SUCCESS"]),
    ([sets(AFTER), sets(), REMOVES_ALL], [RUNNING, RUNNING, SUCCESS],
     [HOLDS_AFTER, *HOLDS, REMOVED, "breakpoint after is removed"]),
    ([sets(mode=REPLACE), WAITS, sets(mode=REPLACE)], [FAILURE] * 3, REPLACES * 2),
    ([sets(AFTER, REPLACE), WAITS], [FAILURE] * 2, [
        "replacement after is set to FAILURE",
        "replacement after decides FAILURE instead of the node's SUCCESS"]),
    ([sets(mode=REPLACE, status="SKIPPED")], [SUCCESS], ["replacement before is set to SKIPPED"]),
    ([sets(mode=REPLACE, enabled=False), sets(mode=REPLACE)], [SUCCESS, FAILURE],
     ["replacement before is set to FAILURE, but disabled", *REPLACES]),
    ([sets(mode=REPLACE), DISABLES], [FAILURE, SUCCESS],
     REPLACES + ["replacement before is disabled"])])
def test_what_hooks_do_tick_by_tick_and_what_the_operator_is_told(actions, results, lines):
    found = steps("<Probe/>", *actions)
    assert found[:2] == (results, lines)
    # the probe itself is never RUNNING
    waits = [False] + [result is RUNNING for result in results]
    assert found[2].held == [key for key, _ in itertools.groupby(waits)][1:]


def test_hooks_that_are_disabled_are_still_there():
    hooks = steps("<Probe/>", sets(), DISABLES)[2]
    assert hooks.all() == [Hook(1, BEFORE, BREAKPOINT, False, False, "FAILURE")]
    hooks.remove_all()
    assert hooks.all() == []


def test_a_node_without_hooks_is_left_alone_again():
    tree, hooks, _ = hooked("<Probe/>")
    hooks.insert([Hook(1, AFTER, BREAKPOINT, True, True, "SKIPPED")])
    assert tree.tick_exactly_once(
    ) is RUNNING and tree.root.hook is not None and tree.root.hook.is_holding
    hooks.unlock(Unlocking(1, AFTER, "SKIPPED", False))
    assert tree.tick_exactly_once() is SUCCESS and tree.root.hook is None
    hooks.insert([Hook(1, BEFORE, BREAKPOINT, False, True, "SKIPPED")])
    assert tree.tick_exactly_once() is RUNNING
    hooks.remove(HookPlace(1, BEFORE))
    tree.sleep(0.0)  # the tick thread carries it out
    assert tree.root.hook.is_holding
    tree.halt()
    assert tree.root.hook is None
    hooks.insert([Hook(1, BEFORE, REPLACE, False, True, "SKIPPED")])
    hooks.remove(HookPlace(1, BEFORE))
    tree.sleep(0.0)
    assert tree.root.hook is None


def test_a_change_of_hooks_wakes_the_tree_and_a_breakpoint_that_is_reached_is_reported_once():
    tree, hooks, _ = hooked("<Probe/>")
    tree.wake.test_and_clear()
    hooks.insert([Hook(1, BEFORE, BREAKPOINT, False, True, "SKIPPED")])
    assert tree.wake.test_and_clear()
    assert [tree.tick_exactly_once() for _ in range(3)] == [RUNNING] * 3 and hooks.held == [True]
    tree.halt()
    assert tree.tick_exactly_once() is RUNNING and hooks.held == [True, False, True]


def test_a_viewer_that_ends_leaves_no_hook():
    tree, hooks, lines = hooked("<Sequence><Probe/></Sequence>")
    hooks.insert([Hook(1, BEFORE, BREAKPOINT, False, True, "SKIPPED"),
                  Hook(2, AFTER, REPLACE, False, True, "FAILURE")])
    assert tree.tick_exactly_once() is RUNNING
    tree.wake.test_and_clear()
    hooks.nodes.remove_all(": the viewer has ended")
    assert tree.wake.test_and_clear() and tree.tick_exactly_once() is SUCCESS
    assert hooks.held == [True, False] and not any(node.hook for node in tree.nodes)
    assert [line.endswith("is removed: the viewer has ended") for line in lines] == [
        False, False, True, True]


def test_a_change_that_was_made_for_the_tree_before_changes_nothing():
    tree, hooks, lines = hooked("<Probe/>")
    following = hooked("<Probe/>")[0]
    hooks.nodes.show(following)
    hooks.insert([Hook(1, BEFORE, REPLACE, False, True, "FAILURE")])
    assert [tree.tick_exactly_once(), following.tick_exactly_once()] == [SUCCESS] * 2
    assert lines == []
    hooks.nodes.change(HookChange(SET, Hook(1, BEFORE, REPLACE, False, True, "FAILURE"), 2, 2))
    assert following.tick_exactly_once() is FAILURE


def test_of_changes_the_operator_is_told_twenty_in_a_second(monkeypatch):
    now = [50.0]
    monkeypatch.setattr(breakpoints, "time", types.SimpleNamespace(monotonic=lambda: now[0]))
    tree, hooks, lines = hooked("<Probe/>")
    for _ in range(25):
        hooks.insert([Hook(1, BEFORE, REPLACE, False, True, "SKIPPED")])
    tree.sleep(0.0)  # the tick thread carries it out
    assert all("is set" in line for line in lines[:20]) and lines[20:] == [
        "Groot2: more changes of breakpoints and replacements within this second"]
    now[0] = 51.0
    hooks.remove_all()
    tree.sleep(0.0)
    assert len(lines) == 22 and "is removed" in lines[21]


def test_a_node_that_worked_before_it_waited_is_halted():
    tree, hooks, _ = hooked("<Busy/>")
    assert tree.tick_exactly_once() is RUNNING
    hooks.insert([Hook(1, BEFORE, BREAKPOINT, False, True, "SKIPPED")])
    assert tree.tick_exactly_once() is RUNNING
    tree.halt()
    assert tree.root.halted == 1 and tree.is_idle
