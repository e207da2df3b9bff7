"""Ports whose default is an entry, as the library was seen to treat them (the addendum of the
semantics), and records."""
from typing import NamedTuple

import pytest

from behavior_controller.bt.linter.palette import tree_nodes_model
from behavior_controller.bt.mission import load_text
from behavior_controller.bt.engine.builtins import builtin_specs
from behavior_controller.bt.engine.leaf import SyncActionLeaf
from behavior_controller.bt.values import values
from behavior_controller.bt.engine.ports import NoValue, PortError
from behavior_controller.bt.values.values import PortType, ValueFault
from behavior_controller.bt.engine.node_types import Registry
from behavior_controller.bt.engine.registry import Direction, Kind, NodeSpec, Port
from behavior_controller.bt.values.status import SUCCESS
from behavior_controller.errors import MissionError
from behavior_controller.run.record.tree_shown import full_tree


class Spot(NamedTuple):
    """A record that ports carry."""

    x: float
    y: float


def spot(text):
    """Read ``x;y``."""
    numbers = [values.whole_real(part) for part in text.split(";")]
    if len(numbers) != 2 or None in numbers:
        raise ValueFault("{} is not a spot: write x;y".format(text))
    return Spot(*numbers)


SPOT = PortType("Spot", Spot, spot)
MARKS = PortType("Marks", list)


class Reader(SyncActionLeaf):
    """Notes what its ports have: the value, or the exception."""

    def update(self):
        self.seen = {port.name: self._seen(port.name) for port in self.spec.ports}
        return SUCCESS

    def _seen(self, name):
        try:
            return self.get_input(name)
        except PortError as error:
            return type(error)


class Writer(SyncActionLeaf):
    """Writes to all of its ports."""

    value = 1

    def update(self):
        self.refused = []
        for port in self.spec.ports:
            try:
                self.set_output(port.name, self.value)
            except PortError as error:
                self.refused.append(str(error))
        return SUCCESS


def specs():
    return builtin_specs() + [
        NodeSpec("In", Kind.ACTION, Reader,
                 (Port("x", "int", default="{@x}", description="a number"),
                  Port("local", "int", default="{loc}"), Port("lit", "int", default="7"))),
        NodeSpec("Out", Kind.ACTION, Writer,
                 (Port("y", "int", Direction.OUT, "{@x}"), Port("z", "int", Direction.OUT, "{loc}"),
                  Port("same", "int", Direction.OUT, "{=}"))),
        NodeSpec("To", Kind.ACTION, Reader, (Port("spot", SPOT, default="{@spot}"), )),
        NodeSpec("Put", Kind.ACTION, Writer, (Port("spot", SPOT, Direction.OUT, "{@spot}"), )),
        NodeSpec("Mark", Kind.ACTION, Writer, (Port("marks", MARKS, Direction.OUT, "{marks}"), )),
        NodeSpec("Marked", Kind.ACTION, Reader, (Port("marks", MARKS, default="{marks}"), ))]


def ran(body, more="", **host):
    """Return the tree of a mission after one tick; ``host`` are entries that were there before."""
    tree = load_text(
        '<root BTCPP_format="4" main_tree_to_execute="Main"><BehaviorTree ID="Main"><Sequence>{}</'
        'Sequence>' '</BehaviorTree>{}</root>'.format(body, more), Registry(specs()))
    for key, value in host.items():
        tree.blackboard.set(key, value)
    assert tree.tick_once() is SUCCESS
    return tree


def of(tree, kind):
    return [node for node in tree.nodes if isinstance(node, kind)]


def sub(attributes, inside):
    return ('<SubTree ID="Sub" {}/>'.format(attributes), '<BehaviorTree ID="Sub"><Sequence>{}</'
                                                         'Sequence></BehaviorTree>'\
        .format(inside))


def test_outputs_write_to_the_entry_of_the_root_of_the_tree_and_of_the_ports_own_name():
    board = ran("<Out/>").blackboard
    assert {key: entry.value for key, entry in board.local.items()} == {"x": 1, "loc": 1, "same": 1}
    assert {entry.type for entry in board.local.values()} == {"int"}


def test_inputs_read_their_entries_and_a_default_that_is_none_is_a_literal():
    reader, = of(ran("<In/>", x=3, loc=4), Reader)
    assert reader.seen == {"x": 3, "local": 4, "lit": 7}


def test_nothing_is_there_before_something_is_written():
    reader, = of(ran("<In/>"), Reader)
    assert reader.seen == {"x": NoValue, "local": NoValue, "lit": 7}


def test_a_subtree_has_an_entry_of_its_own_unless_it_is_remapped():
    reader, = of(ran(*sub("", "<In/>"), x=3, loc=4), Reader)
    assert reader.seen == {"x": 3, "local": NoValue, "lit": 7}
    reader, = of(ran(*sub('_autoremap="true"', "<In/>"), x=3, loc=4), Reader)
    assert reader.seen == {"x": 3, "local": 4, "lit": 7}
    tree = ran(*sub("", "<Out/>"))
    assert set(tree.blackboard.local) == {"x"} and set(
        tree.blackboards["Sub::2"].local) == {"loc", "same"}


MODEL = ('<TreeNodesModel><SubTree ID="Sub"><input_port name="loc" default="7"/><input_port '
         'name="x"/></SubTree></TreeNodesModel>')


@pytest.mark.parametrize("attributes, local", [
    ('x="{x}"', 7), ('x="{x}" loc="3"', 3), ('x="{x}" loc="{x}"', 5),
    ('_autoremap="true"', NoValue), ('_autoremap="true" loc="4"', 4)])
def test_the_model_of_a_subtree_has_the_defaults_of_its_ports(attributes, local):
    element, tree = sub(attributes, "<In/>")
    reader, = of(ran(element, tree + MODEL, x=5), Reader)
    assert reader.seen == {"x": 5, "local": local, "lit": 7}


def test_a_port_of_a_model_may_be_an_entry_of_the_root():
    element, tree = sub("", "<In/>")
    reader, = of(ran(element, tree + MODEL.replace('"x"', '"@x" default="5"')), Reader)
    assert reader.seen == {"x": 5, "local": 7, "lit": 7}


@pytest.mark.parametrize("body, line, column, code", [
    ('\n<SubTree ID="Sub" name="a"/><SubTree ID="Sub"\n name="a"/>', 3, 2, "same-path"),
    ('<In x="{e}"/>\n<To\n spot="{e}"/>', 3, 2, "entry-type"),
    ('\n<LoopInt queue="1;b" value="{x}"><AlwaysSuccess/></LoopInt>', 2, 10, "node-refuses")])
def test_what_only_the_making_of_a_node_shows_is_a_fault_at_its_place(body, line, column, code):
    with pytest.raises(MissionError) as caught:
        load_text(
            '<root BTCPP_format="4" main_tree_to_execute="Main"><BehaviorTree ID="Main"><Sequence>'
            '{}</Sequence>'
            '</BehaviorTree><BehaviorTree ID="Sub"><In/></BehaviorTree></root>'.format(body),
            Registry(specs()), "m.xml")
    assert [(fault.line, fault.column, fault.code)
            for fault in caught.value.faults] == [(line, column, code)]


def test_after_loading_the_node_is_as_if_the_file_had_said_so():
    tree = ran('<In lit="8"/><Out y="{other}"/>')
    assert of(tree, Reader)[0].attributes == {"x": "{@x}", "local": "{loc}", "lit": "8"}
    assert of(tree, Writer)[0].attributes == {"y": "{other}", "z": "{loc}", "same": "{=}"}
    assert tree.nodes[1].element.attributes == {"lit": "8"}  # the file stays as it is
    shown = full_tree(tree, specs())
    assert '<In name="In" _uid="2" x="{@x}" local="{loc}" lit="8">' in shown
    assert '<Out name="Out" _uid="3" y="{other}" z="{loc}" same="{=}">' in shown


def test_the_palette_shows_the_default():
    model = tree_nodes_model(specs())
    assert '<input_port name="x" type="int" default="{@x}">a number</input_port>' in model
    assert '<output_port name="same" type="int" default="{=}"/>' in model


# ------------------------------------------------------------------------------------------ records


def test_a_record_is_read_from_a_literal_from_a_text_and_from_an_entry():
    for tree in (ran('<To spot="1.5;2"/>'),
                 ran('<SetBlackboard output_key="@spot" value="1.5;2"/><To/>'),
                 ran("<To/>", spot=Spot(1.5, 2.0))):
        assert of(tree, Reader)[0].seen == {"spot": Spot(1.5, 2.0)}


@pytest.mark.parametrize("body, column, words", [
    ('<To spot="1.5"/>', 5, "1.5 is not a spot: write x;y"),
    ('<Marked marks="1;2"/>', 9, " Marks ")])
def test_a_literal_that_is_none_is_refused_where_it_stands(body, column, words):
    with pytest.raises(MissionError) as caught:
        load_text(
            '<root BTCPP_format="4"><BehaviorTree ID="Main">\n{}</BehaviorTree></root>'.format(
                body), Registry(specs()))
    fault, = caught.value.faults
    assert (fault.line, fault.column, fault.code) == (2, column,
                                                      "wrong-literal") and words in str(fault)


def test_what_is_no_record_is_neither_read_nor_written(monkeypatch):
    assert of(ran("<To/>", spot=3), Reader)[0].seen == {"spot": PortError}
    assert of(ran("<Marked/>", marks=Spot(1.0, 2.0)), Reader)[0].seen == {"marks": PortError}
    tree = ran("<Put/>")
    assert of(tree, Writer)[0].refused[0] and "spot" not in tree.blackboard.local
    monkeypatch.setattr(Writer, "value", Spot(0.0, 1.0))
    tree = ran("<Put/>")
    assert tree.blackboard.get("spot") == Spot(0.0,
                                               1.0) and tree.blackboard.find("spot").type == "Spot"
    assert of(ran("<Put/>", spot=3), Writer)[0].refused  # the entry is an integer for good


def test_host_and_port_may_write_a_list_in_turn(monkeypatch):
    monkeypatch.setattr(Writer, "value", [3])
    tree = ran("<Mark/>", marks=[1, 2])
    assert of(tree, Writer)[0].refused == [] and tree.blackboard.get("marks") == [3]
    tree = ran("<Mark/>")
    tree.blackboard.set("marks", [4])
    assert tree.blackboard.get("marks") == [4] and tree.blackboard.find("marks").type == "Marks"
