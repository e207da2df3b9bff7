"""The engine in plain Python: leaves in one line, visible arguments, and habits from py_trees that
are refused where a node type is registered."""
import inspect
import json
import time
from xml.etree import ElementTree

import msgspec
import py_trees
import pytest
from py_trees.common import Status

from behavior_controller import bt
from behavior_controller.errors import MissionError
from behavior_controller.viewer.publish import publish
from free_ports import free_port
from groot2_client import Client

FILE = "<root BTCPP_format='4'{}><BehaviorTree ID='M'>{}</BehaviorTree></root>"


def tree(body, registry, **options):
    return bt.load_text(FILE.format("", body), registry, "m.xml", **options)


def soon(ask, wanted):
    """Return the first answer that is wanted, within five seconds."""
    ends = time.monotonic() + 5.0
    while True:
        answer = ask()
        if wanted(answer):
            return answer
        assert time.monotonic() < ends, answer
        time.sleep(0.01)


def test_a_registry_knows_the_built_in_node_types():
    registry = bt.Registry()
    assert list(registry) == [spec.id for spec in bt.builtin_specs()]
    assert tree("<Sequence><AlwaysSuccess/><Sleep msec='1'/></Sequence>",
                registry).tick_while_running() is bt.SUCCESS


def test_a_registry_takes_the_built_in_node_types_again_and_no_other_of_their_name():
    wave = bt.NodeSpec("Wave", bt.Kind.ACTION, lambda name: None)
    assert list(bt.Registry(bt.builtin_specs() + [wave])) == list(bt.Registry([wave]))
    with pytest.raises(ValueError, match="the node type Sleep is registered twice"):
        bt.Registry([bt.NodeSpec("Sleep", bt.Kind.ACTION, lambda name: None)])


@pytest.mark.parametrize("returned, result", [
    (bt.SUCCESS, bt.SUCCESS), (bt.FAILURE, bt.FAILURE), (True, bt.SUCCESS), (False, bt.FAILURE)])
@pytest.mark.parametrize("register", ["register_action", "register_condition"])
def test_a_function_is_a_leaf(register, returned, result):
    registry, called = bt.Registry(), []
    getattr(registry, register)("Wave", lambda leaf: called.append(leaf.name) or returned)
    assert tree("<Wave name='hello'/>", registry).tick_once() is result
    assert called == ["hello"]
    kind = {"register_action": bt.Kind.ACTION, "register_condition": bt.Kind.CONDITION}[register]
    assert registry["Wave"].kind is kind


def test_a_function_may_take_no_argument_and_may_be_built_in():
    registry, said = bt.Registry(), iter([True, False])
    registry.register_action("Wave", lambda: bt.SUCCESS)
    registry.register_condition("Says", said.__next__)
    assert tree("<Sequence><Says/><Wave/></Sequence>", registry).tick_once() is bt.SUCCESS


def test_a_function_has_the_ports_of_its_leaf():
    registry = bt.Registry()

    def double(leaf):
        leaf.set_output("twice", 2 * leaf.get_input("of"))
        return bt.SUCCESS

    registry.register_action("Double", double, [
        bt.Port("of", "int"), bt.Port("twice", "int", bt.Direction.OUT)], "Doubles a number.")
    doubles = tree("<Double of='21' twice='{t}'/>", registry)
    doubles.tick_once()
    assert doubles.blackboard["t"] == 42
    assert registry["Double"].description == "Doubles a number."
    with pytest.raises(MissionError, match='m.xml:1:53: .*cannot be "x"'):
        tree("<Double of='x' twice='{t}'/>", registry)


def nothing(leaf):
    """Return no status."""


def test_a_function_that_returns_no_status_is_named_with_its_place():
    registry = bt.Registry()
    registry.register_action("Nothing", nothing)
    with pytest.raises(bt.TickError) as raised:
        tree("<Nothing/>", registry).tick_once()
    line = inspect.getsourcelines(nothing)[1]
    assert str(raised.value) == (
        "Exception in node 'Nothing::1' [Nothing]: m.xml:1:45: its rule returned None "
        f"(unit/test_plain_engine.py:{line}); it must be RUNNING, SUCCESS, FAILURE or SKIPPED")


class Drive(bt.ActionLeaf):
    def on_start(self):
        return bt.RUNNING

    def on_running(self):
        pass


@pytest.mark.parametrize("register", [
    lambda registry: registry.register_action("Drive", Drive),
    lambda registry: registry.extend([
        bt.NodeSpec("Drive", bt.Kind.ACTION, lambda name: Drive(name))])])
def test_a_class_that_returns_no_status_is_named_with_the_place_of_its_method(register):
    registry = bt.Registry()
    register(registry)
    drive = tree("<Drive/>", registry)
    drive.tick_once()
    line = inspect.getsourcelines(Drive.on_running)[1]
    with pytest.raises(bt.TickError, match=f"None .unit/test_plain_engine.py:{line}.; it must"):
        drive.tick_once()


def test_what_is_no_function_is_refused():
    with pytest.raises(ValueError, match="the function of the node type Wave is None"):
        bt.Registry().register_action("Wave", None)


def test_the_arguments_of_load_are_visible_and_a_wrong_one_is_refused(tmp_path):
    path = tmp_path / "m.xml"
    path.write_text("<root BTCPP_format='4'><BehaviorTree ID='A'><AlwaysSuccess/></BehaviorTree>"
                    "<BehaviorTree ID='B'><AlwaysFailure/></BehaviorTree></root>")
    for load in (bt.load, bt.load_text):
        options = inspect.signature(load).parameters
        assert {"main_tree", "blackboard", "clock", "enums", "with_lint"} <= set(options)
        assert not any(option.kind is option.VAR_KEYWORD for option in options.values())
    registry = bt.Registry()
    assert bt.load(str(path), registry, main_tree="A").tick_once() is bt.SUCCESS
    assert bt.load(str(path), registry, main_tree="B").tick_once() is bt.FAILURE
    with pytest.raises(TypeError, match="main_tre"):
        bt.load(str(path), registry, main_tre="B")


def test_a_blackboard_has_the_items_of_a_mapping():
    board = bt.Blackboard()
    board["home"] = 3
    assert board["home"] == board.get("home") == 3 and "home" in board
    assert board.get("away") is None and board.get("away", 7) == 7 and "away" not in board
    with pytest.raises(KeyError, match="away"):
        board["away"]
    board.create("empty")
    with pytest.raises(KeyError, match="empty"):
        board["empty"]
    assert list(board) == ["home"] and 0 not in board


def habit(base, *names, kind=bt.Kind.ACTION):
    """Return a node type whose class has these methods beside those of ``base``."""
    methods = {name: lambda self, *arguments: bt.SUCCESS for name in names}
    return bt.NodeSpec("Wave", kind, type("Wave", (base,), methods))


HABITS = [(bt.ActionLeaf, "update", "on_start, on_running"),
          (bt.ActionLeaf, "tick", "on_start, on_running"),
          (bt.ActionLeaf, "initialise", "on_start, on_running"),
          (bt.ActionLeaf, "terminate", "on_start, on_running"),
          (bt.SyncActionLeaf, "tick", "update"), (bt.SyncActionLeaf, "initialise", "update"),
          (bt.ConditionLeaf, "tick", "update"), (bt.ConditionLeaf, "stop", "update"),
          (bt.Decorator, "tick", "update"), (bt.Control, "terminate", "update")]


@pytest.mark.parametrize("base, name, instead", HABITS)
def test_a_habit_from_py_trees_is_refused_with_the_method_to_write(base, name, instead):
    spec = habit(base, name, *base.RULE, kind=base.KIND)
    with pytest.raises(ValueError, match=(
            rf"Wave.{name} .unit/test_plain_engine.py:\d+. bypasses the rule of the class "
            f"{base.__name__}: write {instead} instead")):
        bt.Registry([spec])


def test_a_habit_in_the_class_of_a_factory_is_a_fault_of_the_file():
    made = habit(bt.SyncActionLeaf, "tick", "update").factory
    registry = bt.Registry([bt.NodeSpec("Wave", bt.Kind.ACTION, lambda name: made(name))])
    with pytest.raises(MissionError, match="m.xml:1:45: Wave.tick"):
        tree("<Wave/>", registry)


def test_a_method_that_goes_on_to_the_engine_s_is_not_refused():
    class Wave(Drive):
        def update(self):
            return super().update()

    bt.Registry([bt.NodeSpec("Wave", bt.Kind.ACTION, Wave)])


@pytest.mark.parametrize("base, rule", [
    (bt.ActionLeaf, "on_start"), (bt.SyncActionLeaf, "update"), (bt.Decorator, "update")])
def test_a_class_without_its_rule_is_refused(base, rule):
    with pytest.raises(ValueError, match=rf"Wave, the class of Wave, has no {rule}\(\)"):
        bt.Registry([habit(base, kind=base.KIND)])


@pytest.mark.parametrize("base, kind", [
    (bt.ActionLeaf, bt.Kind.CONDITION), (bt.ConditionLeaf, bt.Kind.ACTION),
    (bt.Decorator, bt.Kind.ACTION), (bt.SyncActionLeaf, bt.Kind.CONTROL)])
def test_a_kind_that_contradicts_the_class_is_refused(base, kind):
    with pytest.raises(ValueError, match=(
            f"Wave, the class of Wave, makes nodes of {base.KIND}, and its NodeSpec says {kind}")):
        bt.Registry([habit(base, *base.RULE, kind=kind)])


def test_after_a_run_the_display_shows_its_results():
    ended = tree("<Sequence><Fallback><AlwaysFailure/><AlwaysSuccess/></Fallback>"
                 "<Sleep msec='1'/><Script code='b:=1' _skipIf='true'/></Sequence>", bt.Registry())
    assert ended.tick_while_running() is bt.SUCCESS
    assert [node.status for node in ended.nodes] == [Status.SUCCESS, Status.SUCCESS, Status.FAILURE,
                                                     Status.SUCCESS, Status.SUCCESS, Status.INVALID]
    drawn = py_trees.display.ascii_tree(ended.root, show_status=True)
    assert drawn.count("o") > 4 and "x" in drawn.split("AlwaysFailure")[1].split("\n")[0]


def test_a_run_shows_none_of_the_results_of_the_run_before_it():
    ended = tree("<Sequence><ScriptCondition code='go'/><Sleep msec='1'/></Sequence>",
                 bt.Registry())
    ended.blackboard["go"] = True
    assert ended.tick_while_running() is bt.SUCCESS
    assert ended.nodes[2].status is Status.SUCCESS
    ended.blackboard["go"] = False
    assert ended.tick_while_running() is bt.FAILURE
    assert [node.status for node in ended.nodes] == [Status.FAILURE, Status.FAILURE, Status.INVALID]


def test_groot2_sees_a_plain_tree_run_and_stops_it_at_a_breakpoint():
    shown, port = tree("<Sequence><Sleep msec='30'/><Script code='b:=7'/></Sequence>",
                       bt.Registry()), free_port(2)
    record, client = publish(shown, port), Client(port)
    shows = soon(lambda: client.ask("T"), lambda answer: answer != "no tree yet")
    assert [node.tag for node in ElementTree.fromstring(shows).iter("Sleep")] == ["Sleep"]
    client.ask("I", json.dumps({"enabled": True, "uid": 3, "mode": 0, "once": True,
                                "desired_status": "SKIPPED", "position": 0}))
    soon(shown.tick_once, lambda result: shown.nodes[2].hook is not None and
         shown.nodes[2].hook.is_holding)
    assert client.ask("S") and shown.blackboard.get("b") is None
    client.ask("U", json.dumps({"uid": 3, "position": 0, "desired_status": "SKIPPED",
                                "remove_when_done": True}))
    assert shown.tick_while_running() is bt.SUCCESS
    board = soon(lambda: msgspec.msgpack.decode(client.ask("B", "M")), lambda board: board["M"])
    assert board["M"] == {"b": 7}
    client.close()
    record.close()


@pytest.mark.parametrize("direction, use, words", [
    (bt.Direction.IN, lambda leaf: leaf.set_output("at", 1), "input_port, which cannot be written"),
    (bt.Direction.IN, lambda leaf: leaf.clear_output("at"), "input_port, which cannot be written"),
    (bt.Direction.OUT, lambda leaf: leaf.get_input("at"), "output_port, which cannot be read")])
def test_a_port_is_used_in_its_direction(direction, use, words):
    registry = bt.Registry()
    registry.register_action("Move", lambda leaf: use(leaf) or bt.SUCCESS,
                             [bt.Port("at", "int", direction)])
    moves = tree("<Move at='{at}'/>", registry)
    moves.blackboard["at"] = 0
    with pytest.raises(bt.TickError, match=(
            rf"Move declares \[at\] as an {words}; declare Direction.INOUT")):
        moves.tick_once()
    assert moves.blackboard["at"] == 0
    registry = bt.Registry()
    registry.register_action("Move", lambda leaf: use(leaf) or bt.SUCCESS,
                             [bt.Port("at", "int", bt.Direction.INOUT)])
    moves = tree("<Move at='{at}'/>", registry)
    moves.blackboard["at"] = 0
    assert moves.tick_once() is bt.SUCCESS
