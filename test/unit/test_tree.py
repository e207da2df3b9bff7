"""The tree: exact time under a test clock, waiting, py_trees' tools, depth, and what a mission may
unfold to."""
import importlib
import sys
import threading
import time
from functools import partial

import py_trees
import pytest

from behavior_controller.bt.mission import load_mission, load_text
from behavior_controller.bt.engine.builtins import builtin_specs
from behavior_controller.bt.engine.clock import Clock, ManualClock
from behavior_controller.bt.engine.failure import TickError
from behavior_controller.bt.engine.leaf import ActionLeaf, SyncActionLeaf
from behavior_controller.bt.engine.node_types import Registry
from behavior_controller.bt.engine.registry import Kind, NodeSpec
from behavior_controller.bt.values.status import FAILURE, IDLE, RUNNING, SUCCESS
from behavior_controller.errors import MissionError

REGISTRY = Registry(builtin_specs())


def load(body, rest="", clock=None, registry=REGISTRY):
    text = ("<root BTCPP_format='4' main_tree_to_execute='M'><BehaviorTree "
            "ID='M'>{}</BehaviorTree>{}</root>")
    return load_text(text.format(body, rest), registry, clock=clock or ManualClock())


@pytest.mark.parametrize("leaf, remaining", [
    ("<SetBlackboard output_key='{counter}' value='x'/>", {"counter": 5, "5": "x"}),
    ("<UnsetBlackboard key='{counter}'/>", {"counter": 5})])
def test_a_number_in_place_of_a_name_is_the_name_of_its_text(leaf, remaining):
    tree = load("<Sequence><Script code='counter := 5'/>{}</Sequence>".format(leaf))
    assert tree.tick_once() is SUCCESS
    assert {key: entry.value for key, entry in tree.blackboard.local.items()} == remaining


@pytest.mark.parametrize("between", ["", "<Script code='x := 2'/>"])
def test_the_second_text_that_is_set_on_an_entry_of_a_script_is_an_error(between):
    tree = load("<Sequence><Script code='x := 1'/><SetBlackboard output_key='x' value='42'/>" +
                between + "<SetBlackboard name='again' output_key='x' value='43'/></Sequence>")
    with pytest.raises(TickError, match=r"'again' \[SetBlackboard\].*\[43\] to type \[BT::Any\]"):
        tree.tick_once()
    assert tree.blackboard.get("x") == (2 if between else None)


@pytest.mark.parametrize("body, milliseconds, result", [
    ("<Sleep msec='1500'/>", 1500, SUCCESS),
    ("<Delay delay_msec='250'><AlwaysFailure/></Delay>", 250, FAILURE),
    ("<Timeout msec='700'><Sleep msec='9000'/></Timeout>", 700, FAILURE),
    ("<Timeout msec='9000'><Sleep msec='700'/></Timeout>", 700, SUCCESS),
    ("<Sequence><Sleep msec='300'/><Sleep msec='400'/></Sequence>", 700, SUCCESS)])
def test_time_is_exact(body, milliseconds, result):
    tree = load(body)
    assert tree.tick_once() is RUNNING
    elapsed = 0
    while elapsed < milliseconds - 1:
        tree.clock.advance(0.001)
        elapsed += 1
        assert tree.tick_once() is RUNNING, elapsed
    tree.clock.advance(0.0011)
    assert tree.tick_once() is result


def test_a_timeout_halts_its_child_at_the_time_and_not_at_the_next_tick():
    tree = load("<Timeout msec='100'><Sleep msec='5000' _onHalted='halted := 1'/></Timeout>")
    tree.tick_once()
    tree.clock.advance(0.1)
    assert tree.blackboard.get("halted") == 1
    assert tree.nodes[1].status is IDLE
    assert tree.wake.test_and_clear()


def test_sleeping_ends_at_the_wake_up_of_another_thread():
    tree = load("<Sleep msec='60000'/>", clock=Clock())
    tree.tick_once()
    threading.Timer(0.05, tree.wake.emit).start()
    began = time.monotonic()
    assert tree.sleep(30.0)
    assert time.monotonic() - began < 10.0


def test_sleeping_runs_timers_and_ends_when_one_wakes_the_tree():
    tree = load("<Sleep msec='20'/>", clock=Clock())
    assert tree.tick_while_running(sleep_seconds=30.0) is SUCCESS


def test_every_observer_hears_every_change():
    tree = load("<Sequence><AlwaysSuccess/></Sequence>")
    first, second = [], []
    tree.subscribe(lambda node, old, new: first.append((node.uid, old, new)))
    tree.subscribe(lambda node, old, new: second.append((node.uid, old, new)))
    tree.tick_exactly_once()
    assert first == second == [(1, IDLE, RUNNING), (2, IDLE, SUCCESS), (2, SUCCESS, IDLE),
                               (1, RUNNING, SUCCESS), (1, SUCCESS, IDLE)]


# ---------------------------------------------------------------------------------- py_trees' tools

FAMILY = ("<Sequence name='steps'><Fallback "
          "name='choice'><Inverter><AlwaysSuccess/></Inverter><Sleep name='nap' "
          "msec='5'/></Fallback><Parallel name='both'><AlwaysSuccess/><SubTree "
          "ID='T'/></Parallel></Sequence>")
TREE_T = "<BehaviorTree ID='T'><AlwaysSuccess name='inside'/></BehaviorTree>"


def test_py_trees_draws_our_trees():
    tree = load(FAMILY, TREE_T)
    text = py_trees.display.ascii_tree(tree.root, show_status=True)
    assert [line.strip().split(" ")[1] for line in text.splitlines() if line.strip()] == [
        "steps", "choice", "Inverter", "AlwaysSuccess", "nap", "both", "AlwaysSuccess", "T",
        "inside"]
    dot = py_trees.display.dot_tree(
        tree.root, visibility_level=py_trees.common.VisibilityLevel.ALL).to_string()
    shapes = {"steps": "box", "choice": "octagon", "both": "parallelogram"}
    for name, shape in shapes.items():
        assert any(name in line and "shape={}".format(shape) in line
                   for line in dot.splitlines()), name


def test_subtrees_fold_in_py_trees_drawings():
    tree = load(FAMILY, TREE_T)
    folded = py_trees.display.dot_tree(
        tree.root, visibility_level=py_trees.common.VisibilityLevel.BIG_PICTURE).to_string()
    assert "inside" not in folded and "steps" in folded


def test_py_trees_visitors_and_the_tree_manager_work():
    tree = load(FAMILY, TREE_T)
    manager = py_trees.trees.BehaviourTree(tree.root)
    snapshot = py_trees.visitors.SnapshotVisitor()
    manager.add_visitor(snapshot)
    manager.tick()
    assert tree.root.status is RUNNING
    assert tree.root.tip().name == "nap"
    assert snapshot.visited[tree.nodes[4].id] is RUNNING
    tree.root.stop(IDLE)
    assert {node.status for node in tree.nodes} == {IDLE}
    assert [node.name for node in tree.root.iterate()][-1] == "steps"


# -------------------------------------------------------------------------------------------- depth


@pytest.mark.slow
@pytest.mark.parametrize("condition", ["", " _onSuccess='x := 1' _onHalted='y := 1'"])
def test_two_thousand_levels_tick_and_halt(condition):
    body = "<Inverter{}>".format(condition) * 2000 + "<Sleep msec='10'/>" + "</Inverter>" * 2000
    tree = load(body)
    assert tree.tick_once() is RUNNING
    tree.halt()
    tree.tick_once()
    tree.clock.advance(0.02)
    assert tree.tick_once() is SUCCESS  # an even number of turns
    assert len(list(tree.root.iterate())) == 2001


def test_a_tree_unfolds_to_two_and_a_half_thousand_levels_at_most():
    level = ("<BehaviorTree "
             "ID='T{}'>" + 49 * "<Inverter>" + "{}" + 49 * "</Inverter>" + "</BehaviorTree>\n")
    rest = "".join(level.format(n, "<SubTree ID='T{}'/>".format(n + 1)) for n in range(49))
    assert len(
        load(
            "<SubTree ID='T0'/>", rest + level.format(49, "<AlwaysSuccess/>").replace(
                "<Inverter>", "", 1).replace("</Inverter>", "", 1)).nodes) == 2500
    with pytest.raises(MissionError) as raised:
        load("<SubTree ID='T0'/>", rest + level.format(49, "<AlwaysSuccess/>"))
    fault, = raised.value.faults
    assert (fault.line, fault.column, fault.code) == (50, 514, "too-large") and "2500" in fault.text


def load_substituted(substitute):
    return load_text("<root BTCPP_format='4'><BehaviorTree ID='M'>\n<Sequence><Sleep "
                     "msec='1'/></Sequence></BehaviorTree></root>",
                     REGISTRY, "m.xml", substitutes={"SubstitutionRules": {"Sleep": substitute}})


def substituted(body, target, filter_="Fallback"):
    text = ("<root BTCPP_format='4' main_tree_to_execute='M'><BehaviorTree ID='M'><Sequence>{}"
            "<Script code='after := 1'/></Sequence></BehaviorTree><BehaviorTree ID='Sub'>"
            "<Script name='inside' code='x := 1' _onHalted='@halted := 1'/></BehaviorTree></root>")
    return load_text(text.format(body), REGISTRY, clock=ManualClock(), substitutes={
        "SubstitutionRules": {filter_: target},
        "TestNodeConfigs": {"Test": {"return_status": "SUCCESS"}}})


@pytest.mark.parametrize("target", ["AlwaysSuccess", "Test"])
def test_the_children_of_a_substituted_control_stay_idle_and_are_not_halted(target):
    tree = substituted("<Fallback><SubTree ID='Sub'/></Fallback>", target)
    assert [(node.name, node.uid, node.status) for node in tree.nodes][1:] == [
        ("Fallback", 2, IDLE), ("Sub", 3, IDLE), ("inside", 4, IDLE), ("Script", 5, IDLE)]
    assert tree.tick_once() is SUCCESS
    tree.halt()
    assert {key: entry.value for key, entry in tree.blackboard.local.items()} == {"after": 1}


def test_a_control_in_place_of_a_control_has_its_children():
    tree = substituted("<Fallback><SubTree ID='Sub'/></Fallback>", "Sequence")
    assert tree.tick_once() is SUCCESS
    assert tree.blackboards["Sub::3"].get("x") == 1


@pytest.mark.parametrize("target", ["AlwaysSuccess", "Test"])
def test_a_substituted_subtree_has_nothing_inside(target):
    tree = substituted("<SubTree ID='Sub'/>", target, "SubTree")
    assert [(node.name, node.uid) for node in tree.nodes][1:] == [("Sub", 2), ("Script", 3)]
    assert tree.tick_once() is SUCCESS
    tree.halt()
    assert {key: entry.value for key, entry in tree.blackboard.local.items()} == {"after": 1}


def test_a_run_once_whose_entry_is_empty_skips():
    tree = load("<Sequence><Script code='n := 0'/><Repeat num_cycles='3'><ForceSuccess>"
                "<RunOnce then_skip='{then}'><Script code='n += 1'/></RunOnce></ForceSuccess>"
                "</Repeat></Sequence>")
    assert tree.tick_once() is SUCCESS
    assert tree.blackboard.get("n") == 1


@pytest.mark.parametrize("kept, result", [("'7'", RUNNING), (None, None)])
def test_a_loop_whose_entry_has_become_empty_fails_and_stays_running(kept, result):
    tree = load("<Sequence><Script code=\"q := '1;2;3'\"/><LoopInt queue='{q}' value='{v}'>"
                "<AlwaysSuccess/></LoopInt></Sequence>")
    assert tree.tick_exactly_once() is RUNNING
    tree.blackboard.find("q").clear()
    if kept:  # what was read first stays so
        tree.blackboard.find("q").replace(kept)
        assert tree.tick_exactly_once() is result and tree.blackboard.get("v") == 2
    else:
        with pytest.raises(TickError, match="LoopInt"):
            tree.tick_exactly_once()
    assert tree.nodes[2].status is RUNNING


def test_a_loop_without_its_entry_is_over():
    assert load("<Sequence><UnsetBlackboard key='q'/><LoopInt queue='{q}' if_empty='FAILURE'>"
                "<AlwaysSuccess/></LoopInt></Sequence>").tick_once() is FAILURE


def test_a_loop_whose_value_is_a_text_writes_nothing():
    tree = load("<LoopString queue='a;b' value='item'><Script code='n := 1'/></LoopString>")
    assert [tree.tick_exactly_once() for _ in range(3)] == [RUNNING, RUNNING, SUCCESS]
    assert list(tree.blackboard) == ["n"]


def test_a_substitute_that_does_not_exist_is_a_fault_of_the_node():
    with pytest.raises(MissionError) as raised:
        load_substituted("Slep")
    fault, = raised.value.faults
    assert (fault.file, fault.line, fault.column, fault.code) == ("m.xml", 2, 11,
                                                                  "substitute-unknown")
    assert "the substitute Slep is not a node type" in fault.text


@pytest.mark.parametrize("body, rest, code, words", [pytest.param(*case, id=case[2]) for case in [
    ("<Inverter>" * 10000 + "<AlwaysSuccess/>" + "</Inverter>" * 10000, "", "too-large", "2040"),
    ("<SubTree ID='T0'/>",
     "".join("<BehaviorTree ID='T{0}'><Sequence><SubTree ID='T{1}'/><SubTree ID='T{1}'/></Sequence>"
             "</BehaviorTree>".format(n, n + 1)
             for n in range(40)) + "<BehaviorTree ID='T40'><AlwaysSuccess/></BehaviorTree>",
     "too-large", "250000"),
    ("<SubTree ID='A'/>",
     "<BehaviorTree ID='A'><Inverter><SubTree ID='B'/></Inverter></BehaviorTree>"
     "<BehaviorTree ID='B'><SubTree ID='A'/></BehaviorTree>", "tree-circle", "A > B > A")]])
def test_what_would_never_end_is_a_fault(body, rest, code, words):
    with pytest.raises(MissionError) as raised:
        load(body, rest)
    assert raised.value.faults[0].code == code and words in str(raised.value)
    assert "\n" not in str(raised.value)


def test_faults_of_every_stage_come_in_one_pass():
    with pytest.raises(MissionError) as raised:
        load("<Sequence><Nonsense/><Script code='1 +'/><Sleep msec='soon'/><SetBlackboard "
             "value='1' output_key='{x}'/><Repeat num_cycles='{x}'><LoopInt queue='1;b' "
             "value='{x}'><AlwaysSuccess/></LoopInt></Repeat></Sequence>")
    assert [fault.code for fault in raised.value.faults] == [
        "unknown-node", "script-syntax", "wrong-literal", "node-refuses"]


def test_includes_are_read_relative_to_their_file_and_once(tmp_path):
    (tmp_path / "lib").mkdir()
    (tmp_path / "lib" / "a.xml").write_text("<root BTCPP_format='4'><include "
                                            "path='b.xml'/><BehaviorTree ID='A'><SubTree "
                                            "ID='B'/></BehaviorTree></root>")
    (tmp_path / "lib" / "b.xml").write_text(
        "<root BTCPP_format='4'><BehaviorTree ID='B'><AlwaysSuccess/></BehaviorTree></root>")
    main = tmp_path / "main.xml"
    main.write_text("<root BTCPP_format='4' main_tree_to_execute='M'><include "
                    "path='lib/a.xml'/><include path='lib/b.xml'/><BehaviorTree ID='M'><SubTree "
                    "ID='A'/></BehaviorTree></root>")
    tree = load_mission(str(main), REGISTRY)
    assert tree.tick_once() is SUCCESS
    assert tree.warnings == []


@pytest.mark.parametrize("path, code", [("none.xml", "include-unreadable"),
                                        ("main.xml", "include-circle")])
def test_includes_that_cannot_be(tmp_path, path, code):
    main = tmp_path / "main.xml"
    main.write_text(
        "<root BTCPP_format='4'>\n <include path='{}'/>\n <BehaviorTree ID='M'><AlwaysSuccess/></"
        "BehaviorTree>" "</root>".format(path))
    with pytest.raises(MissionError) as raised:
        load_mission(str(main), REGISTRY)
    fault, = raised.value.faults
    assert (fault.line,
            fault.code) == (2, code) and fault.file.endswith("main.xml") and path in fault.text


def test_what_is_posted_during_a_tick_counts_in_its_next_traversal():
    tree, told = load("<Sleep msec='9000'/>"), []

    def follow(is_first, changes):
        told.append(is_first)
        if len(told) == 1:  # as a worker does while the first traversal is under way
            tree.clock.post(lambda: told.append("posted"))
            tree.wake.emit()

    tree.follow(follow)
    assert tree.tick_once() is RUNNING
    assert told == [True, "posted", False]


def test_a_follower_gets_the_changes_of_each_traversal_and_those_after_it():
    tree, told = load("<Sequence><AlwaysSuccess/><Sleep msec='20'/></Sequence>"), []
    tree.follow(lambda is_first, changes: told.append((
        is_first, [(node.uid, old, new) for node, old, new in changes])))
    tree.tick_exactly_once()
    tree.tick_exactly_once()
    tree.clock.advance(0.02)
    tree.tick_exactly_once()
    assert told == [(True, [(1, IDLE, RUNNING), (2, IDLE, SUCCESS), (3, IDLE, RUNNING)]),
                    (True, []),
                    (True, [(3, RUNNING, SUCCESS), (2, SUCCESS, IDLE), (3, SUCCESS, IDLE),
                            (1, RUNNING, SUCCESS)]), (None, [(1, SUCCESS, IDLE)])]
    told.clear()
    tree.tick_exactly_once()
    tree.halt()
    assert told[1:] == [(None, [(2, SUCCESS, IDLE), (3, RUNNING, IDLE), (1, RUNNING, IDLE)])]


def test_the_writes_of_one_tree_are_not_those_of_another():
    first, second = load("<Script code='x := 1'/>"), load(
        "<SubTree ID='T'/>", "<BehaviorTree ID='T'><Script code='x := 1'/></BehaviorTree>")
    changes = second.changes
    first.tick_once()
    assert second.changes == changes
    second.tick_once()
    assert second.changes > changes  # those of its subtrees count


@pytest.mark.parametrize("options, number", [({}, 0), ({"with_lint": True}, 1)])
def test_a_tree_has_the_warnings_of_the_linter_if_they_are_wanted(options, number):
    text = ("<root BTCPP_format='4'><BehaviorTree ID='M'><Sequence><AlwaysFailure/><AlwaysSuccess/>"
            "</Sequence></BehaviorTree></root>")
    assert [fault.code for fault in load_text(text, REGISTRY, **options).warnings] == (
        number * ["never-reached"])


@pytest.mark.parametrize("old, new, name", [("registry", "engine.registry", "NodeSpec"),
                                            ("status", "values.status", "SUCCESS")])
def test_a_module_that_was_moved_is_still_found_and_says_where_it_is(old, new, name):
    with pytest.warns(FutureWarning, match="bt.{} is now behavior_controller.bt.{}".format(
            old, new)):
        sys.modules.pop("behavior_controller.bt." + old, None)
        moved = importlib.import_module("behavior_controller.bt." + old)
    there = importlib.import_module("behavior_controller.bt." + new)
    assert getattr(moved, name) is getattr(there, name)


class Waits(ActionLeaf):
    """A leaf of another package, which is done when another node has done something, and gives a
    timer a callback that does not wake the tree."""

    def on_start(self):
        self.clock.call_after(0.5, lambda: None)
        return RUNNING

    on_running = on_start


def test_a_tree_with_a_node_of_another_package_wants_a_tick_after_each_change():
    body = "<Parallel success_count='3'>{}<Sleep msec='0'/><Sleep msec='9000'/></Parallel>"
    registry = Registry([*builtin_specs(), NodeSpec("Waits", Kind.ACTION, Waits)])
    trees = [load(body.format(element), registry=registry)
             for element in ("<Sleep msec='9000'/>", "<Waits/>")]
    assert [tree.tick_once() for tree in trees] == [RUNNING, RUNNING]
    assert [tree.is_tick_wanted for tree in trees] == [False, True]
    trees[1].tick_once()
    assert not trees[1].is_tick_wanted  # nothing has changed in this tick


class Chained(ActionLeaf):
    """A leaf whose timer sets the next one, in a function that does not know the leaf."""

    def on_start(self):
        clock, self.beats = self.clock, []

        def beat(beats):
            beats.append(clock.now())
            if len(beats) < 3:
                clock.call_after(0.1, partial(beat, beats))

        clock.call_after(0.1, partial(beat, self.beats))
        return RUNNING

    def on_running(self):
        return SUCCESS if len(self.beats) == 3 else RUNNING


def test_each_timer_that_a_timer_of_a_node_sets_wakes_the_tree():
    tree = load("<Chained/>", registry=Registry([NodeSpec("Chained", Kind.ACTION, Chained)]))
    for _ in range(3):
        assert tree.tick_once() is RUNNING
        tree.clock.advance(0.1)
        assert tree.wake.test_and_clear()
    assert tree.tick_once() is SUCCESS


class Tries(SyncActionLeaf):
    """A leaf of another package that does something at each tick, and fails in the end."""

    tries = 0

    def update(self):
        self.tries += 1
        return SUCCESS if self.tries < 3 else FAILURE


@pytest.mark.parametrize("body, wanted", [
    ("<ReactiveSequence><AsyncSequence><AlwaysSuccess/><AlwaysSuccess/></AsyncSequence>"
     "<Sleep msec='9000'/></ReactiveSequence>", True),  # the AsyncSequence begins again
    ("<ReactiveSequence><AlwaysSuccess/><Sleep msec='9000'/></ReactiveSequence>", False),
    ("<KeepRunningUntilFailure><Sequence><AlwaysSuccess _skipIf='true'/></Sequence>"
     "</KeepRunningUntilFailure>", False),
    ("<KeepRunningUntilFailure><AlwaysSuccess/></KeepRunningUntilFailure>", False),
    ("<KeepRunningUntilFailure><Tries/></KeepRunningUntilFailure>", True)])
def test_a_tree_wants_a_tick_while_the_next_one_differs(body, wanted):
    registry = Registry([*builtin_specs(), NodeSpec("Tries", Kind.ACTION, Tries)])
    tree = load(body, registry=registry)
    for _ in range(2):
        assert tree.tick_once() is RUNNING and tree.is_tick_wanted is wanted


def test_a_condition_that_stays_as_it_was_asks_for_no_tick():
    tree = load("<WhileDoElse><AlwaysSuccess/><Sleep msec='9000'/></WhileDoElse>")
    for _ in range(2):
        assert tree.tick_once() is RUNNING
    assert not tree.is_tick_wanted


def test_a_timer_of_a_node_wakes_the_tree():
    registry = Registry([*builtin_specs(), NodeSpec("Waits", Kind.ACTION, Waits)])
    tree = load("<Waits/>", registry=registry)
    assert tree.tick_once() is RUNNING and not tree.wake.is_set
    tree.clock.call_after(0.1, lambda: None)  # of no node
    tree.clock.advance(0.2)
    assert not tree.wake.is_set
    tree.clock.advance(0.4)
    assert tree.wake.is_set
