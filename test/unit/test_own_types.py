"""Types of an author's own on ports: read from a file, written, refused; each belongs to the ports
that carry it."""
from typing import NamedTuple

import pytest

from behavior_controller import bt
from behavior_controller.bt.values.values import ValueType


class Spot(NamedTuple):
    """A record."""

    x: float
    y: float


class Far(Spot):
    """A record of a class below."""


def read(text):
    """Read ``x;y``."""
    x, y = text.split(";")
    return Spot(float(x), float(y))


SPOT = bt.PortType("Spot", Spot, read)


class Note(bt.SyncActionLeaf):
    """Notes what it reads, and writes what its test wants."""

    written = Spot(7.0, 8.0)

    def update(self):
        self.seen = self.get_input("at")
        self.set_output("next", self.written)
        return bt.SUCCESS


def registry(spot=SPOT):
    return bt.Registry(bt.builtin_specs() + [bt.NodeSpec("Note", bt.Kind.ACTION, Note, (
        bt.Port("at", spot), bt.Port("next", spot, bt.Direction.OUT)))])


def load(body, types=SPOT):
    return bt.load_text(
        "<root BTCPP_format='4'><BehaviorTree ID='M'>\n{}</BehaviorTree></root>".format(body),
        registry(types), "m.xml")


@pytest.mark.parametrize("text", ["1;2.5", "{spot}"])
def test_a_text_and_an_entry_are_read_as_the_class(text):
    tree = load("<Note at='{}' next='{{out}}'/>".format(text))
    tree.blackboard.set("spot", Spot(1.0, 2.5))
    assert tree.tick_once() is bt.SUCCESS
    assert tree.root.seen == Spot(1.0, 2.5) and tree.blackboard.get("out") == Spot(7.0, 8.0)


def test_a_text_in_an_entry_is_converted():
    tree = load(
        "<Sequence><Note at='0;0' next='{out}'/><SetBlackboard value='3;4' output_key='out'/>"
        "<Note at='{out}' next='{out}'/></Sequence>")
    assert tree.tick_once() is bt.SUCCESS
    assert tree.nodes[3].seen == Spot(3.0, 4.0)


def test_a_class_below_is_welcome_and_another_is_not(monkeypatch):
    tree = load("<Note at='0;0' next='{out}'/>")
    monkeypatch.setattr(Note, "written", Far(1.0, 1.0))
    assert tree.tick_once() is bt.SUCCESS and tree.blackboard.get("out") == Far(1.0, 1.0)
    monkeypatch.setattr(Note, "written", (1.0, 1.0))
    with pytest.raises(bt.TickError, match=r"m.xml:2:1: port \[next\]: .*tuple.*Spot"):
        tree.tick_once()


@pytest.mark.parametrize(
    "text, words", [("1;north", "Spot: ValueError: could not convert string to float: 'north'"),
                    ("1", "Spot: ValueError: not enough values")])
def test_what_the_converter_raises_is_a_fault_at_the_place_of_the_text(text, words):
    with pytest.raises(bt.MissionError) as raised:
        load("<Note next='{{out}}'\n  at='{}'/>".format(text))
    assert len(raised.value.faults) == 1
    assert (raised.value.faults[0].line,
            raised.value.faults[0].code) == (3, "wrong-literal") and words in str(raised.value)


def test_a_converter_that_returns_another_class_is_named():
    with pytest.raises(
            bt.MissionError,
            match=r"the converter of Odd returned \(1, 2\) for \[x\], which is not a Spot"):
        load("<Note at='x' next='{out}'/>", bt.PortType("Odd", Spot, lambda text: (1, 2)))


def test_without_a_converter_an_entry_alone_can_hold_a_value():
    with pytest.raises(bt.MissionError) as raised:
        load("<Note at='1;2' next='{out}'/>", bt.PortType("Spot", Spot))
    assert [fault.code for fault in raised.value.faults] == ["wrong-literal"]


def test_the_palette_names_the_type():
    assert '<input_port name="at" type="Spot"/>' in bt.tree_nodes_model(registry().values())


def test_registries_do_not_share_types():
    miles = bt.PortType("Spot", Spot, lambda text: Spot(float(text) * 1609.0, 0.0))
    near, far = load("<Note at='1;0' next='{out}'/>"), load("<Note at='1' next='{out}'/>", miles)
    for tree in (near, far):
        tree.tick_once()
    assert (near.root.seen.x, far.root.seen.x) == (1.0, 1609.0)


def spec(name, port_type):
    return bt.NodeSpec(name, bt.Kind.ACTION, Note, (bt.Port("p", port_type),))


@pytest.mark.parametrize("specs, words", [
    ([spec("A", "strng")],
     r"the port p of A has the unknown type strng \(did you mean string\?; .* PortType\)"),
    ([spec("A", SPOT), spec("B", "spot")],
     r"the port p of B has the unknown type spot \(did you mean Spot\?"),
    ([spec("A", "xyzzy")],
     r"unknown type xyzzy \(there are: string int uint .*vec_bool any Any; .* PortType\)"),
    ([spec("A", SPOT), spec("B", bt.PortType("Spot", Spot))],
     r"the type Spot of the port p of B is not the one")])
def test_a_type_that_is_not_known_is_refused_with_the_node_type(specs, words):
    with pytest.raises(ValueError, match=words):
        bt.Registry(specs)


def test_a_type_of_the_engine_keeps_its_name():
    with pytest.raises(ValueError, match="double is a type of the engine"):
        bt.PortType("double", float)


def test_a_type_is_its_name():
    assert SPOT == "Spot" and isinstance(SPOT.value_type, ValueType)
