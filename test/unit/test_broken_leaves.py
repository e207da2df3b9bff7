"""Mistakes in the code of a node type: an error with the node's place, never a status and never a traceback."""
import pytest

from behavior_controller.bt.compiler import load_text
from behavior_controller.bt.engine.builtins import builtin_specs
from behavior_controller.bt.engine.leaf import ActionLeaf, SyncActionLeaf
from behavior_controller.bt.engine.node import NodeError, TickError
from behavior_controller.bt.registry import Kind, NodeSpec, Registry
from behavior_controller.bt.status import IDLE, RUNNING
from behavior_controller.errors import MissionError


class Forgetful(SyncActionLeaf):
    """Returns what its test wants, which is not a status."""

    result = None

    def update(self):
        return self.result


class Waiting(ActionLeaf):
    """Forgets to return its status while it is RUNNING."""

    def on_start(self):
        return RUNNING

    def on_running(self):
        pass


class Raises(SyncActionLeaf):
    """Fails where it is ticked."""

    def update(self):
        raise KeyError("gripper")


class Broken(SyncActionLeaf):
    """Cannot be made."""

    def __init__(self, name):
        super().__init__(name)
        self.limit = int(name)


class Unsettled(SyncActionLeaf):
    """Can be made, and not configured."""

    def configure(self):
        raise KeyError("gripper")


MISTAKEN = Registry(builtin_specs() + [
    NodeSpec("Forgetful", Kind.ACTION, Forgetful), NodeSpec("Waiting", Kind.ACTION, Waiting),
    NodeSpec("Broken", Kind.ACTION, Broken), NodeSpec("Unsettled", Kind.ACTION, Unsettled),
    NodeSpec("Raises", Kind.ACTION, Raises), NodeSpec("Nothing", Kind.ACTION, lambda name: None)])


def mistaken(body):
    return load_text("<root BTCPP_format='4'><BehaviorTree ID='Main'>\n  {}</BehaviorTree></root>".format(body), MISTAKEN,
                     "m.xml")


@pytest.mark.parametrize("control", ["Sequence", "Fallback", "ReactiveSequence", "ReactiveFallback", "Parallel",
                                     "SequenceWithMemory", "AsyncFallback", "Inverter", "ForceSuccess"])
@pytest.mark.parametrize("condition", ["", " _skipIf='false'"])
@pytest.mark.parametrize("result", [None, True, "SUCCESS"])
def test_a_rule_that_returns_no_status_is_an_error_at_its_node(monkeypatch, control, condition, result):
    monkeypatch.setattr(Forgetful, "result", result)
    tree = mistaken("<{0}>\n<Forgetful name='grip'{1}/></{0}>".format(control, condition))
    with pytest.raises(TickError) as raised:
        tree.tick_once()
    assert str(raised.value) == (
        "Exception in node 'grip' [Forgetful]: m.xml:3:1: its rule returned {!r}; "
        "it must be RUNNING, SUCCESS, FAILURE or SKIPPED".format(result))
    assert isinstance(raised.value.cause, NodeError) and raised.value.node is tree.nodes[1]


def test_a_running_leaf_that_forgets_its_status_is_an_error_too():
    tree = mistaken("<Fallback><Waiting/></Fallback>")
    assert tree.tick_once() is RUNNING
    with pytest.raises(TickError, match=r"'Waiting::2' \[Waiting\]: m.xml:2:13: its rule returned None"):
        tree.tick_once()


@pytest.mark.parametrize("result, words", [
    (IDLE, "its rule returned IDLE; it must be RUNNING, SUCCESS, FAILURE or SKIPPED"),
    (RUNNING, "SyncActionNode MUST never return RUNNING")])
def test_a_status_that_is_no_result_is_an_error_at_its_node(monkeypatch, result, words):
    monkeypatch.setattr(Forgetful, "result", result)
    tree = mistaken("<Inverter>\n <Forgetful/></Inverter>")
    with pytest.raises(TickError) as raised:
        tree.tick_once()
    assert str(raised.value) == "Exception in node 'Forgetful::2' [Forgetful]: m.xml:3:2: " + words


def test_an_exception_in_a_rule_names_the_node_its_place_and_what_it_is():
    with pytest.raises(TickError) as raised:
        mistaken("<Fallback>\n <Raises/></Fallback>").tick_once()
    assert str(raised.value) == "Exception in node 'Raises::2' [Raises]: m.xml:3:2: KeyError: 'gripper'"


def test_a_node_that_was_not_made_from_a_file_has_no_place():
    with pytest.raises(TickError, match=r"Exception in node 'grip' \[\]: its rule returned None"):
        Forgetful("grip").execute()


def test_node_types_that_fail_where_they_make_a_node_are_faults_at_their_places():
    with pytest.raises(MissionError) as raised:
        mistaken("<Sequence><Broken name='3'/><Broken/>\n<Unsettled/>\n<Nothing/><Sleep msec='x'/></Sequence>")
    hint = " (a mistake in the code of the node type, not in this file)"
    assert [str(fault) for fault in raised.value.faults][:3] == [
        "m.xml:2:31: Broken cannot be made: ValueError: invalid literal for int() with base 10: 'Broken'" + hint,
        "m.xml:3:1: Unsettled cannot be made: KeyError: 'gripper'" + hint,
        "m.xml:4:1: Nothing cannot be made: TypeError: its factory returned None, which is not a node" + hint]
    assert len(raised.value.faults) == 4


def test_what_is_inside_a_faulty_node_has_its_faults_too():
    with pytest.raises(MissionError) as raised:
        mistaken("<Sequence><Unknown><Inverter><Broken/></Inverter></Unknown></Sequence>")
    assert [str(fault).partition(" cannot")[0] for fault in raised.value.faults] == [
        "m.xml:2:13: unknown node Unknown", "m.xml:2:32: Broken"]
