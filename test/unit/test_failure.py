"""Which node an exception, a callback or a running frame belongs to."""
import signal
import sys

import py_trees
import pytest

from behavior_controller.bt.engine.failure import TickError, failure_of, node_on, owner_of
from behavior_controller.bt.engine.leaf import SyncActionLeaf
from behavior_controller.bt.engine.node_types import Registry
from behavior_controller.bt.engine.registry import Kind, NodeSpec
from behavior_controller.bt.mission import load_text
from behavior_controller.bt.values.status import SUCCESS


def owner(callback):
    """Set a callback as a clock does: who owns it?"""
    return owner_of(callback)


class Child(py_trees.behaviour.Behaviour):
    """A behaviour of py_trees inside a leaf."""

    def update(self):
        """Nothing."""

    def act(self):
        return owner(len)

    def callback(self):
        """Nothing."""


class Helper:
    """What is no node."""

    def ask(self, callback):
        return owner(callback)

    def callback(self):
        """Nothing."""


class Asks(SyncActionLeaf):
    """Asks, in its tick, what belongs to whom."""

    ask = staticmethod(lambda leaf: None)

    def update(self):
        self.found = type(self).ask(self)
        return SUCCESS

    def callback(self):
        """Nothing."""

    def act(self):
        return owner(lambda: None)


def leaves():
    tree = load_text("<root BTCPP_format='4'><BehaviorTree ID='M'><Sequence><Asks/><Asks/>"
                     "</Sequence></BehaviorTree></root>",
                     Registry([NodeSpec("Asks", Kind.ACTION, Asks)]), "m.xml")
    return tree, [node for node in tree.nodes if isinstance(node, Asks)]


OTHER = leaves()[1][0]


@pytest.mark.parametrize("ask, expected", [
    (lambda leaf: owner(leaf.callback), "itself"), (lambda leaf: owner(len), "itself"),
    (lambda leaf: owner(lambda: None), "itself"),
    (lambda leaf: owner(OTHER.callback), "other"),  # whose method it is counts first
    (lambda leaf: Helper().ask(Helper().callback), "itself"),
    (lambda leaf: owner(Child("c").callback), "itself"),
    (lambda leaf: Child("c").act(), "itself"),
    (lambda leaf: node_on(sys._getframe())[0], "itself"), (lambda leaf: node_on(None)[0], "none")])
def test_whose_a_callback_is_that_is_set_in_a_tick(monkeypatch, ask, expected):
    tree, (first, second) = leaves()
    monkeypatch.setattr(Asks, "ask", staticmethod(ask))
    tree.tick_once()
    for leaf in (first, second):
        assert leaf.found is {"itself": leaf, "other": OTHER, "none": None}[expected]


@pytest.mark.parametrize("callback", [len, Helper().callback, Child("c").callback, lambda: None])
def test_a_callback_that_is_set_outside_of_a_tick_has_no_owner(callback):
    assert owner(callback) is None
    assert owner(OTHER.callback) is OTHER
    assert OTHER.act() is OTHER  # set by one of its own, as a timer runs it


def test_the_frame_is_that_of_the_nodes_code(monkeypatch):
    tree, (first, _) = leaves()
    monkeypatch.setattr(Asks, "ask", staticmethod(lambda leaf: node_on(sys._getframe())[1]))
    tree.tick_once()
    assert first.found.f_code.co_name == "update"


@pytest.mark.parametrize("node, words", [(None, "Exception in its timer: a callback: "),
                                         (OTHER, "[Asks]: ")])
def test_an_exception_names_its_node_once(node, words):
    failure = failure_of(node, KeyError("x"), "its timer: ")
    assert isinstance(failure, TickError) and failure.node is node
    assert words in str(failure) and failure_of(None, failure) is failure


def test_a_ctrl_c_stays_one(monkeypatch):
    monkeypatch.setattr(signal, "getsignal", {signal.SIGINT: signal.default_int_handler}.get)
    assert isinstance(failure_of(OTHER, KeyboardInterrupt()), KeyboardInterrupt)
