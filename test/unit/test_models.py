"""A palette in the file that does not fit the node types is told, with its place."""
from behavior_controller import folders
from behavior_controller.bt.linter.palette import check_models, stubs
from behavior_controller.bt.loader.structure import MOST_FINDINGS, Findings
from behavior_controller.bt.loader.document import parse, read
from behavior_controller.bt.engine.registry import Direction, Kind
from behavior_controller.leaves import registry
from behavior_controller.missions.load import load_tree


def warnings(models):
    text = ("<root BTCPP_format='4'>\n<BehaviorTree "
            "ID='M'><AlwaysSuccess/></BehaviorTree>\n<TreeNodesModel>\n{}</TreeNodesModel></root>")
    found = Findings()
    check_models([parse(text.format(models), "m.xml")], registry(), found)
    assert not found.errors
    return [(fault.line, fault.column, fault.code) for fault in found.warnings]


def test_the_delivered_mission_has_a_true_palette():
    found = Findings()
    check_models([read(folders.mission("lab_tour"))], registry(), found)
    assert found.warnings == []


def test_a_node_that_is_not_there():
    assert warnings("<Action ID='WelcomSpeech'/>") == [(4, 9, "palette-unknown-node")]


def test_another_kind():
    assert warnings("<Condition ID='WelcomeSpeech'/>") == [(4, 1, "palette-kind")]


def test_other_ports():
    assert warnings(
        "<Action ID='Sleep'><input_port name='msecs'/><output_port name='msec'/></Action>") == [
            (4, 32, "palette-port"), (4, 46, "palette-direction")]
    assert warnings("<Action ID='AlwaysSuccess'><input_port name='msec'/></Action>") == [
        (4, 40, "palette-port")]


def test_not_all_of_very_many_models_are_told():
    assert len(warnings("<Action ID='Unknown'/>" * (MOST_FINDINGS + 1))) == MOST_FINDINGS


def test_what_fits_and_what_is_none_of_our_business():
    assert warnings("<Action ID='Sleep' editable='true'><input_port name='msec' "
                    "type='unsigned'>how long</input_port><MetadataFields><Metadata "
                    "author='me'/></MetadataFields></Action><SubTree ID='M'/>") == []


def test_the_mission_loader_warns(tmp_path):
    path = tmp_path / "m.xml"
    path.write_text("<root BTCPP_format='4'><BehaviorTree ID='M'><AlwaysSuccess/></BehaviorTree>"
                    "<TreeNodesModel><Action ID='Nothing'/></TreeNodesModel></root>")
    assert "palette-unknown-node" in [fault.code for fault in load_tree(str(path)).warnings]


def test_a_palette_s_own_node_is_a_stub_with_its_ports():
    text = ("<root BTCPP_format='4'><TreeNodesModel><Condition ID='FixtureIsNear'>"
            "<input_port name='to' type='int' default='3'/><output_port name='by'/>"
            "<input_port type='int'/><input_port name=''/><MetadataFields name='no port'/>"
            "</Condition><Action ID='Sleep'/><Action ID='FixtureIsNear'/></TreeNodesModel></root>")
    (stub,), faults = stubs([parse(text, "m.xml")], registry())
    assert (stub.id, stub.kind, stub.is_stub, faults) == ("FixtureIsNear", Kind.CONDITION, True, [])
    assert [(port.name, port.type, port.direction, port.default, port.is_optional)
            for port in stub.ports] == [("to", "int", Direction.IN, "3", True),
                                        ("by", "any", Direction.OUT, None, True)]
