"""Mistakes in the code of a node type: an error with the node's place, never a status and never a
traceback."""
import json
import re
import signal
import sys
import threading

import pytest

from behavior_controller.bt.mission import load_text
from behavior_controller.bt.engine.builtins import builtin_specs
from behavior_controller.bt.engine.leaf import ActionLeaf, SyncActionLeaf
from behavior_controller.bt.engine.node import NodeError, TickError
from behavior_controller.bt.engine.node_types import Registry
from behavior_controller.bt.engine.registry import Kind, NodeSpec
from behavior_controller.bt.values.status import IDLE, RUNNING
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


class Broken(Raises):
    """Cannot be made."""

    def __init__(self, name):
        super().__init__(name)
        self.limit = int(name)


class Leaves(Raises):
    """Ends the program where it is made."""

    def __init__(self, name):
        super().__init__(name)
        sys.exit(3)


class Unsettled(Raises):
    """Can be made, and not configured."""

    def configure(self):
        raise KeyError("gripper")


class Anything(ActionLeaf):
    """Raises what its test wants, where its test wants it."""

    at, raised = "", None

    def fail(self):
        raise self.raised

    def fail_at(self, place):
        if self.at == place:
            self.fail()

    def setup(self, **kwargs):
        self.fail_at("setup")

    def on_start(self):
        self.fail_at("start")
        fail = self.fail
        if self.at == "timer":
            self.clock.call_after(0.0, self.fail)
        elif self.at == "lambda":
            self.clock.call_after(0.0, lambda: fail())
        elif self.at == "thread":
            thread = threading.Thread(target=self.post)
            thread.start()
            thread.join()
        return RUNNING

    def post(self):
        fail = self.fail
        self.clock.post(lambda: fail())

    def on_running(self):
        self.fail_at("running")
        return RUNNING

    def on_halted(self):
        self.fail_at("halt")


MISTAKEN = Registry(builtin_specs() + [
    NodeSpec("Forgetful", Kind.ACTION, Forgetful), NodeSpec("Waiting", Kind.ACTION, Waiting),
    NodeSpec("Broken", Kind.ACTION, Broken), NodeSpec("Unsettled", Kind.ACTION, Unsettled),
    NodeSpec("Raises", Kind.ACTION, Raises), NodeSpec("Nothing", Kind.ACTION, lambda name: None),
    NodeSpec("Leaves", Kind.ACTION, Leaves), NodeSpec("Anything", Kind.ACTION, Anything)])


def mistaken(body):
    return load_text(
        "<root BTCPP_format='4'><BehaviorTree ID='Main'>\n  {}</BehaviorTree></root>".format(body),
        MISTAKEN, "m.xml")


@pytest.mark.parametrize("control", [
    "Sequence", "Fallback", "ReactiveSequence", "ReactiveFallback", "Parallel",
    "SequenceWithMemory", "AsyncFallback", "Inverter", "ForceSuccess"])
@pytest.mark.parametrize("condition", ["", " _skipIf='false'"])
@pytest.mark.parametrize("result", [None, True, "SUCCESS"])
def test_a_rule_that_returns_no_status_is_an_error_at_its_node(monkeypatch, control, condition,
                                                               result):
    monkeypatch.setattr(Forgetful, "result", result)
    tree = mistaken("<{0}>\n<Forgetful name='grip'{1}/></{0}>".format(control, condition))
    with pytest.raises(TickError) as raised:
        tree.tick_once()
    assert str(raised.value) == (
        "Exception in node 'grip' [Forgetful]: m.xml:3:1: its rule returned {!r} "
        "(unit/test_broken_leaves.py:{}); it must be RUNNING, SUCCESS, FAILURE or SKIPPED".format(
            result, Forgetful.update.__code__.co_firstlineno))
    assert isinstance(raised.value.cause, NodeError) and raised.value.node is tree.nodes[1]


def test_a_running_leaf_that_forgets_its_status_is_an_error_too():
    tree = mistaken("<Fallback><Waiting/></Fallback>")
    assert tree.tick_once() is RUNNING
    with pytest.raises(TickError,
                       match=r"'Waiting::2' \[Waiting\]: m.xml:2:13: its rule returned None"):
        tree.tick_once()


@pytest.mark.parametrize("result, words", [
    (IDLE, "its rule returned IDLE (unit/test_broken_leaves.py:{}); it must be RUNNING, SUCCESS, "
     "FAILURE or SKIPPED".format(Forgetful.update.__code__.co_firstlineno)),
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
    assert re.match(r"Exception in node 'Raises::2' \[Raises\]: m.xml:3:2: KeyError: 'gripper' "
                    r"\(unit/test_broken_leaves.py:\d+\)$", str(raised.value))


def test_a_node_that_was_not_made_from_a_file_has_no_place():
    with pytest.raises(TickError, match=r"Exception in node 'grip' \[\]: its rule returned None"):
        Forgetful("grip").execute()


def test_node_types_that_fail_where_they_make_a_node_are_faults_at_their_places():
    with pytest.raises(MissionError) as raised:
        mistaken("<Sequence><Broken name='3'/><Broken/>\n<Unsettled/>\n<Nothing/><Leaves/><Sleep "
                 "msec='x'/></Sequence>")
    broken = raised.value.faults[:4]
    assert {fault.code for fault in broken} == {"node-broken"}
    assert [(fault.line, fault.column, fault.text.split(" ")[0]) for fault in broken] == [
        (2, 31, "Broken"), (3, 1, "Unsettled"), (4, 1, "Nothing"), (4, 11, "Leaves")]
    assert all(error in fault.text for error, fault in zip(
        ("ValueError: ", "cannot be made: KeyError: 'gripper' (", "TypeError: ", "SystemExit: 3"),
        broken))
    assert {fault.hint for fault in broken} == {
        "a mistake in the code of the node type, not in this file"}
    assert all(re.search(r"\(unit/\w+\.py:\d+\)", str(fault)) for fault in broken)
    assert len(raised.value.faults) == 5


def test_what_is_inside_a_faulty_node_has_its_faults_too():
    with pytest.raises(MissionError) as raised:
        mistaken("<Sequence><Unknown><Inverter><Broken/></Inverter></Unknown></Sequence>")
    assert [(fault.line, fault.column, fault.code) for fault in raised.value.faults] == [
        (2, 13, "unknown-node"), (2, 32, "node-broken")]


@pytest.mark.parametrize("raised", [
    SystemExit(3), KeyboardInterrupt(), GeneratorExit(), KeyError("gripper")])
@pytest.mark.parametrize("at, where", [("start", ""), ("running", ""), ("timer", "a callback of "),
                                       ("lambda", "a callback of "), ("thread", "a callback of "),
                                       ("halt", "the halt of ")])
def test_whatever_a_leaf_raises_wherever_is_its_failure_with_both_places(
        monkeypatch, at, where, raised):
    monkeypatch.setattr(Anything, "at", at)
    monkeypatch.setattr(Anything, "raised", raised)
    tree = mistaken(
        "<Parallel failure_count='1'><AlwaysSuccess/>\n<Anything name='grip'/></Parallel>")
    with pytest.raises(TickError) as failed:
        assert tree.tick_once() is RUNNING
        tree.tick_once()
        tree.halt()
    assert re.match(r"Exception in {}node 'grip' \[Anything\]: m.xml:3:1: {}.* \(unit/"
                    r"test_broken_leaves.py:\d+\)$".format(where, type(raised).__name__),
                    str(failed.value))
    assert failed.value.__cause__ is raised


def test_the_place_is_that_of_the_leaf_also_if_a_library_raises(monkeypatch):
    monkeypatch.setattr(Anything, "at", "start")
    monkeypatch.setattr(Anything, "fail", lambda self: json.loads("{"))
    with pytest.raises(TickError, match=r"JSONDecodeError: .*\(unit/test_broken_leaves.py:\d+\)$"):
        mistaken("<Anything/>").tick_once()


def test_a_leaf_that_fails_in_its_halt_is_halted_and_not_halted_again(monkeypatch):
    monkeypatch.setattr(Anything, "at", "halt")
    monkeypatch.setattr(Anything, "raised", SystemExit())
    tree = mistaken("<Anything/>")
    tree.tick_once()
    with pytest.raises(TickError):
        tree.halt()
    tree.halt()
    assert tree.is_idle


def test_leaves_that_cannot_be_set_up_are_faults_of_the_mission_at_their_places(monkeypatch):
    monkeypatch.setattr(Anything, "at", "setup")
    monkeypatch.setattr(Anything, "raised", SystemExit("no gripper"))
    with pytest.raises(MissionError) as raised:
        mistaken("<Sequence><Anything/>\n<Anything/></Sequence>").setup()
    assert [(fault.line, fault.code) for fault in raised.value.faults] == [(2, "node-broken"),
                                                                           (3, "node-broken")]
    assert "SystemExit: no gripper (unit/test_broken_leaves.py:" in str(raised.value)


def test_ctrl_c_is_no_failure_of_the_leaf_that_it_interrupts(monkeypatch):
    monkeypatch.setattr(Anything, "at", "start")
    monkeypatch.setattr(Anything, "fail",
                        lambda self: [signal.raise_signal(signal.SIGINT) for _ in range(9)])
    # a shell may have its background jobs ignore it
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        with pytest.raises(KeyboardInterrupt):
            mistaken("<Anything/>").tick_once()
    finally:
        signal.signal(signal.SIGINT, before)


def test_an_exception_without_a_text_of_its_own_has_one(monkeypatch):
    class Mute(Exception):
        def __str__(self):
            raise SystemExit

    monkeypatch.setattr(Anything, "at", "start")
    monkeypatch.setattr(Anything, "raised", Mute())
    with pytest.raises(TickError, match="Mute: its text raised SystemExit"):
        mistaken("<Anything/>").tick_once()
