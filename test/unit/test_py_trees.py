"""What py_trees' own manager, visitors and display find in a tree, and what a py_trees behaviour
finds as a leaf."""
import re

import py_trees
import pytest
from py_trees.common import Access, Status, VisibilityLevel

from behavior_controller import bt
from behavior_controller.bt.engine.leaf import BehaviourLeaf


class Steps(py_trees.behaviour.Behaviour):
    """Takes a number of ticks, and notes what py_trees calls."""

    ticks = 3

    def __init__(self, name):
        super().__init__(name)
        self.calls = []

    def setup(self, **kwargs):
        self.calls.append(("setup", kwargs))

    def initialise(self):
        self.calls.append("initialise")
        self.left = self.ticks

    def update(self):
        self.left -= 1
        self.feedback_message = "{} left".format(self.left)
        self.calls.append("update")
        return Status.RUNNING if self.left else Status.SUCCESS

    def terminate(self, new_status):
        self.calls.append((self.status, new_status))


class Blank(Steps):
    """Forgets to return its status."""

    def update(self):
        pass


class Invalid(Steps):
    """Returns the status that py_trees has for a behaviour that is not ticked."""

    def update(self):
        return Status.INVALID


ONE = py_trees.behaviours.Success("one")
REGISTRY = bt.Registry(bt.builtin_specs() + [
    bt.NodeSpec(leaf.__name__, bt.Kind.ACTION, leaf) for leaf in (Steps, Blank, Invalid)] + [
    bt.NodeSpec("Pair", bt.Kind.ACTION, lambda name: py_trees.composites.Sequence(name, True, [
        Steps("first"), Steps("second")])),
    bt.NodeSpec("Same", bt.Kind.CONDITION, lambda name: ONE),
    bt.NodeSpec("Below", bt.Kind.DECORATOR, Steps)])


def load(body, rest="", clock=None):
    return bt.load_text(
        "<root BTCPP_format='4' main_tree_to_execute='M'><BehaviorTree ID='M'>{}</BehaviorTree>{}</"
        "root>".format(body, rest), REGISTRY, "m.xml", clock=clock or bt.ManualClock())


class Watched:
    """py_trees' manager of a tree; ``seen`` holds name and status of each node that the last tick
    showed to a visitor."""

    def __init__(self, tree, root=None):
        self.tree, self.seen = tree, []
        self.manager = py_trees.trees.BehaviourTree(root or tree.root)
        self.manager.add_visitor(self)
        self.snapshot = py_trees.visitors.SnapshotVisitor()
        self.manager.add_visitor(self.snapshot)
        self.manager.add_visitor(py_trees.visitors.DebugVisitor())

    full = False

    def initialise(self):
        self.seen = []

    def run(self, node):
        self.seen.append((node.name, node.status))

    def finalise(self):
        pass

    def tick(self, seconds=0.0):
        self.tree.clock.advance(seconds)
        self.manager.tick()
        return self.manager.root.status

    def statuses(self):
        return {node.name: node.status for node in self.tree.nodes}


# -------------------------------------------------------------------------------------- the manager


@pytest.mark.parametrize("body, result",
                         [("<Sleep msec='50'/>", Status.SUCCESS),
                          ("<Delay delay_msec='50'><AlwaysFailure/></Delay>", Status.FAILURE),
                          ("<Timeout msec='50'><Sleep msec='60000'/></Timeout>", Status.FAILURE)])
def test_timers_run_under_the_manager(body, result):
    watched = Watched(load(body))
    assert watched.tick() is Status.RUNNING
    assert watched.tick(0.049) is Status.RUNNING
    assert watched.tick(0.002) is result
    assert watched.tree.is_idle
    assert watched.tick() is Status.RUNNING  # from the beginning


def test_tick_tock_comes_to_the_end_in_real_time():
    tree = load(
        "<Sequence><Delay delay_msec='20'><AlwaysSuccess/></Delay><Sleep msec='20'/></Sequence>",
        clock=bt.Clock())
    manager, ends = py_trees.trees.BehaviourTree(tree.root), []

    def look(manager):
        ends.append(manager.root.status)
        if manager.root.status is not Status.RUNNING:
            manager.interrupt()

    manager.tick_tock(5, 2000, post_tick_handler=look)
    assert ends[-1] is Status.SUCCESS and set(ends[:-1]) == {Status.RUNNING}


def test_visitors_see_what_was_ticked_with_its_result_and_children_first():
    watched = Watched(
        load("<Sequence><AlwaysSuccess name='a'/><Fallback name='f'><AlwaysFailure name='b'/>"
             "<Sleep name='c' msec='10'/><AlwaysSuccess name='d'/></Fallback>"
             "<ForceSuccess name='e'><AlwaysFailure name='g'/></ForceSuccess></Sequence>"))
    watched.tick()
    assert watched.seen == [("a", Status.SUCCESS), ("b", Status.FAILURE), ("c", Status.RUNNING),
                            ("f", Status.RUNNING), ("Sequence", Status.RUNNING)]
    assert watched.manager.tip().name == "c" and watched.manager.root.current_child.name == "f"
    assert watched.snapshot.changed
    watched.tick()
    assert watched.seen == [("c", Status.RUNNING), ("f", Status.RUNNING),
                            ("Sequence", Status.RUNNING)]
    assert watched.tick(0.02) is Status.SUCCESS
    assert watched.seen == [("c", Status.SUCCESS), ("f", Status.SUCCESS), ("g", Status.FAILURE),
                            ("e", Status.SUCCESS), ("Sequence", Status.SUCCESS)]
    # what was ticked still shows it after the tick; the engine has reset all of it
    assert watched.statuses() == {
        "Sequence": Status.SUCCESS, "a": Status.INVALID, "f": Status.SUCCESS, "b": Status.INVALID,
        "c": Status.SUCCESS, "d": Status.INVALID, "e": Status.SUCCESS, "g": Status.FAILURE}
    assert watched.manager.tip().name == "g"
    assert {watched.tree.nodes[n].id for n in (0, 2, 4, 6, 7)} == set(watched.snapshot.visited)


def test_ascii_tree_shows_the_statuses_of_the_last_tick():
    watched = Watched(load("<Fallback><AlwaysFailure/><AlwaysSuccess/></Fallback>"))
    watched.tick()
    for draw in (py_trees.display.ascii_tree, py_trees.display.unicode_tree):
        lines = re.sub("\x1b\\[[0-9;]*m", "", draw(watched.tree.root,
                                                   show_status=True)).splitlines()
        ok, wrong = "ox" if draw is py_trees.display.ascii_tree else (
            py_trees.console.check_mark, py_trees.console.multiplication_x)
        assert [line.strip().split(" ", 1)[1] for line in lines] == [
            "Fallback [{}]".format(ok), "AlwaysFailure [{}]".format(wrong),
            "AlwaysSuccess [{}]".format(ok)]


def test_what_is_skipped_or_was_halted_is_invalid_to_py_trees():
    watched = Watched(load(
        "<Parallel failure_count='1' success_count='1'><AlwaysSuccess name='s' _skipIf='true'/>"
        "<Sleep name='r' msec='9'/><AlwaysFailure name='f'/></Parallel>"))
    assert watched.tick() is Status.FAILURE
    assert watched.seen == [("s", Status.INVALID), ("r", Status.INVALID), ("f", Status.FAILURE),
                            ("Parallel", Status.FAILURE)]


def test_a_tree_that_is_skipped_is_no_longer_running():
    assert Watched(
        load("<Sequence><AlwaysSuccess _skipIf='true'/></Sequence>")).tick() is Status.INVALID


def test_the_engine_goes_by_its_own_statuses():
    body = ("<Sequence><AlwaysSuccess/><RetryUntilSuccessful "
            "num_attempts='2'><AlwaysFailure/></RetryUntilSuccessful></Sequence>")
    watched, other = Watched(load(body)), load(body)
    for _ in range(5):
        changes, told = [], []
        watched.tree.subscribe(lambda node, old, new: changes.append((node.uid, old, new)))
        other.subscribe(lambda node, old, new: told.append((node.uid, old, new)))
        watched.tick()
        other.tick_exactly_once()
        assert changes == told != []
    assert watched.tree.tick_exactly_once() is other.tick_exactly_once()  # both ways in turn
    watched.tree.halt()
    assert set(watched.statuses().values()) == {Status.INVALID}


def test_an_interrupt_halts():
    watched = Watched(
        load("<Sequence><AlwaysSuccess/><Sleep msec='9' _onHalted='x := 1'/></Sequence>"))
    watched.tick()
    watched.manager.root.stop(Status.INVALID)
    assert watched.tree.blackboard.get("x") == 1
    assert set(watched.statuses().values()) == {Status.INVALID} and watched.manager.tip() is None


@pytest.mark.parametrize("halt",
                         [lambda tree: tree.halt(), lambda tree: tree.root.stop(Status.INVALID)])
def test_a_halt_after_the_end_has_nothing_to_do(halt):
    watched = Watched(
        load("<Sequence><AlwaysSuccess/><Inverter><AlwaysFailure/></Inverter></Sequence>"))
    watched.tick()
    changes = []
    watched.tree.subscribe(lambda node, old, new: changes.append((node.uid, old, new)))
    halt(watched.tree)
    assert changes == [] and set(watched.statuses().values()) == {Status.INVALID}


def test_a_part_of_a_tree_has_a_manager_of_its_own():
    tree = load("<Sequence><AlwaysSuccess/><Fallback name='part'><AlwaysFailure/><Sleep "
                "msec='9'/></Fallback></Sequence>")
    watched = Watched(tree, tree.nodes[2])
    assert watched.tick() is Status.RUNNING and watched.seen[-1] == ("part", Status.RUNNING)
    assert watched.tick(0.01) is Status.SUCCESS


def test_a_mission_is_a_part_of_a_tree_of_py_trees():
    tree = load("<Sequence name='mission'><AlwaysSuccess name='a'/><Sleep name='nap' msec='10' "
                "_onHalted='x := 1'/></Sequence>")
    after = py_trees.behaviours.Success("after")
    whole = py_trees.composites.Sequence("whole", True, [tree.root, after])
    manager = py_trees.trees.BehaviourTree(py_trees.composites.Selector("top", False, [
        py_trees.behaviours.Failure("no"), whole]))
    manager.tick()
    assert (whole.status, manager.tip().name) == (Status.RUNNING, "nap")
    manager.root.stop(Status.INVALID)
    assert tree.blackboard.get("x") == 1 and tree.is_idle
    manager.tick()
    tree.clock.advance(0.02)
    manager.tick()
    assert (tree.root.status, after.status, manager.root.status) == (Status.SUCCESS,) * 3


def test_conditions_and_repeated_children_are_seen_once():
    watched = Watched(load("<Repeat num_cycles='2'><Sequence _while='true'><Sleep "
                           "msec='5'/><AlwaysSuccess name='a'/></Sequence></Repeat>"))
    watched.tick()
    watched.tick(0.006)
    assert watched.seen == [("Sleep", Status.RUNNING), ("a", Status.SUCCESS),
                            ("Sequence", Status.RUNNING), ("Repeat", Status.RUNNING)]


def test_an_exception_comes_through_the_manager_with_its_place():
    watched = Watched(load("<Sequence>\n <Blank name='b'/></Sequence>"))
    with pytest.raises(bt.TickError, match=r"'b' \[Blank\]: m.xml:2:2: .*INVALID"):
        watched.tick()


@pytest.mark.slow
def test_two_thousand_levels():
    watched = Watched(load("<Inverter>" * 2000 + "<AlwaysSuccess/>" + "</Inverter>" * 2000))
    assert watched.tick() is Status.SUCCESS and len(watched.seen) == 2001


def test_children_are_those_of_the_file():
    tree = load("<Sequence>\n<Fallback name='f'><AlwaysSuccess/></Fallback></Sequence>")
    manager = py_trees.trees.BehaviourTree(tree.root)
    fallback, child = tree.nodes[1:3]
    other = py_trees.behaviours.Success("s")
    for change in (
            lambda: manager.prune_subtree(child.id),
            lambda: manager.insert_subtree(other, fallback.id, 0),
            lambda: manager.replace_subtree(child.id, other),
            lambda: fallback.add_child(other),
            lambda: fallback.add_children([]),
            lambda: fallback.insert_child(other, index=0),
            lambda: fallback.prepend_child(other),
            lambda: fallback.replace_child(child, other),
            lambda: fallback.remove_child(child),
            lambda: fallback.remove_child_by_id(child.id),
            lambda: fallback.remove_all_children()):
        with pytest.raises(bt.NodeError,
                           match="m.xml:2:1: the children of f are those of its file"):
            change()
    assert [node.name for node in tree.root.iterate()] == ["AlwaysSuccess", "f", "Sequence"]


# --------------------------------------------------------------------------------------- behaviours


def leaf_of(tree):
    return next(node for node in tree.nodes if isinstance(node, BehaviourLeaf))


def test_a_behaviour_lives_as_in_py_trees():
    tree = load("<Sequence><Steps name='s'/></Sequence>")
    tree.setup(robot=1)
    leaf = leaf_of(tree)
    assert leaf.name == "s" and leaf.behaviour.has_parent_with_name("Sequence")
    assert [tree.tick_once() for _ in range(3)] == [Status.RUNNING, Status.RUNNING, Status.SUCCESS]
    assert leaf.behaviour.calls == [("setup", {"robot": 1}), "initialise", "update", "update",
                                    "update", (Status.RUNNING, Status.SUCCESS)]
    assert leaf.feedback_message == "0 left"
    tree.tick_once()
    assert leaf.behaviour.calls[6:] == ["initialise", "update"]


def test_a_behaviour_under_py_trees_manager_is_itself_to_the_tools():
    watched = Watched(load("<Sequence><Steps name='s'/></Sequence>"))
    watched.manager.setup()
    watched.tick()
    leaf = leaf_of(watched.tree)
    assert watched.seen[0] == ("s",
                               Status.RUNNING) and leaf.behaviour.id in watched.snapshot.visited
    assert "2 left" in py_trees.display.ascii_tree(watched.tree.root, show_status=True)
    assert leaf.behaviour.calls[0] == ("setup", {})


def test_a_halt_terminates_a_running_behaviour_alone():
    tree = load(
        "<Timeout msec='10'><Sequence><Steps name='s'/><Sleep msec='100'/></Sequence></Timeout>")
    tree.tick_once()
    tree.clock.advance(0.02)
    calls = leaf_of(tree).behaviour.calls
    assert calls == ["initialise", "update", (Status.RUNNING, Status.INVALID)]
    assert tree.tick_once() is Status.FAILURE
    tree.halt()
    assert len(calls) == 3


def test_a_whole_py_trees_tree_is_a_leaf():
    tree = load("<Pair/>")
    tree.setup(robot=2)
    assert [tree.tick_once() for _ in range(5)] == [Status.RUNNING] * 4 + [Status.SUCCESS]
    first, second = leaf_of(tree).behaviour.children
    assert first.calls[0] == second.calls[0] == ("setup", {"robot": 2})
    tree.tick_once()
    tree.halt()
    assert first.calls[-1] == (Status.RUNNING, Status.INVALID)


def test_a_running_behaviour_asks_for_its_next_tick():
    tree = load("<Steps/>")
    tree.tick_once()
    assert tree.clock.next_due() == pytest.approx(0.01)
    tree.clock.advance(0.005)
    assert not tree.wake.test_and_clear()
    tree.tick_once()
    assert tree.clock.next_due() == pytest.approx(0.015)
    tree.clock.advance(0.011)
    assert tree.wake.test_and_clear()
    changes = tree.changes
    assert tree.tick_once() is Status.SUCCESS and tree.changes > changes
    tree.tick_once()
    tree.halt()
    assert tree.clock.next_due() is None


def test_a_behaviour_comes_to_its_end_in_real_time():
    assert load("<Steps/>", clock=bt.Clock()).tick_while_running(30.0) is Status.SUCCESS


@pytest.mark.parametrize("leaf", ["Blank", "Invalid"])
def test_a_behaviour_without_a_status_is_an_error(leaf):
    tree = load("<Fallback><{}/></Fallback>".format(leaf))
    with pytest.raises(
            bt.TickError,
            match=r"\[{}\]: m.xml:1:80: its update returned INVALID or no status".format(leaf)):
        tree.tick_once()


@pytest.mark.parametrize("body, error", [("<Sequence><Same/><Same/></Sequence>", "Same "),
                                         ("<Below><AlwaysSuccess/></Below>", "Below ")])
def test_a_behaviour_that_cannot_have_its_place(body, error):
    ONE.parent = None
    with pytest.raises(bt.MissionError) as raised:
        load(body)
    fault, = raised.value.faults
    assert (fault.file, fault.line, fault.code) == ("m.xml", 1,
                                                    "node-broken") and fault.text.startswith(error)


# -------------------------------------------------------------------------------------- blackboards

ENTRIES = ("<Sequence><Script code='x := y'/><SetBlackboard value='{x}' output_key='z'/><SubTree "
           "ID='T' inner='{x}' given='3'/></Sequence>")
TREE_T = (
    "<BehaviorTree ID='T'><Sequence><Precondition if='inner == 1'><AlwaysSuccess/></Precondition>"
    "<SetBlackboard value='2' output_key='own'/></Sequence></BehaviorTree>")


@pytest.fixture(name="shown")
def py_trees_blackboard():
    """py_trees' blackboard, which is one for the process."""
    board = py_trees.blackboard.Blackboard
    for part in (board.storage, board.metadata, board.clients):
        part.clear()
    yield board
    for part in (board.storage, board.metadata, board.clients):
        part.clear()


def test_py_trees_draws_the_entries_of_a_tree(shown):
    tree = load(ENTRIES, TREE_T)
    dot = py_trees.display.dot_tree(tree.root, visibility_level=VisibilityLevel.ALL,
                                    with_blackboard_variables=True)
    edges = {(edge.get_source().strip('"'), edge.get_destination().strip('"'))
             for edge in dot.get_edge_list()}
    entries = {"/M/x", "/M/y", "/M/z", "/M/T #4/own"}
    assert {edge for edge in edges if set(edge) & entries} == {("/M/y", "Script"),
                                                               ("Script", "/M/x"),
                                                               ("/M/x", "SetBlackboard"),
                                                               ("SetBlackboard", "/M/z"),
                                                               ("/M/x", "Precondition"),
                                                               ("SetBlackboard*", "/M/T #4/own")}
    assert shown.keys() == entries


def test_visitors_find_the_values_of_now(shown):
    tree = load(ENTRIES, TREE_T)
    tree.blackboard.set("y", 1)
    watched = Watched(tree)
    assert watched.tick() is Status.SUCCESS
    assert watched.snapshot.visited_blackboard_keys == {"/M/x", "/M/y", "/M/z", "/M/T #4/own"}
    assert shown.storage == {"/M/x": 1, "/M/y": 1, "/M/z": 1, "/M/T #4/own": "2"}
    tree.blackboard.unset("z")
    tree.blackboard.set("y", 5)
    assert watched.tick() is Status.FAILURE
    assert shown.storage["/M/x"] == 5
    tree.blackboard.unset("x")
    assert tree.nodes[1].blackboards and "/M/x" not in shown.storage


def test_a_leaf_may_have_a_py_trees_client_of_its_own(shown):
    leaf = load("<AlwaysSuccess/>").root
    client = leaf.attach_blackboard_client("mine")
    client.register_key("k", Access.WRITE)
    assert leaf.blackboards == [client]


def test_nothing_is_shown_that_no_tool_asks_for(shown):
    tree = load(ENTRIES, TREE_T)
    tree.blackboard.set("y", 1)
    assert tree.tick_once() is Status.SUCCESS
    assert shown.keys() == set() and shown.clients == {}
