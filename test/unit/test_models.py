"""A palette in the file that does not fit the node types is told, with its place."""
from behavior_controller import folders
from behavior_controller.bt.checking.models import stale_models
from behavior_controller.bt.language.document import parse, read
from behavior_controller.leaves import registry
from behavior_controller.mission import load_tree


def warnings(models):
    text = "<root BTCPP_format='4'>\n<BehaviorTree ID='M'><AlwaysSuccess/></BehaviorTree>\n<TreeNodesModel>\n{}</TreeNodesModel></root>"
    return [str(fault) for fault in stale_models([parse(text.format(models), "m.xml")], registry())]


def test_the_delivered_mission_has_a_true_palette():
    assert stale_models([read(folders.mission("lab_tour"))], registry()) == []


def test_a_node_that_is_not_there():
    assert warnings("<Action ID='WelcomSpeech'/>") == [
        "m.xml:4:9: warning: the palette has an unknown node WelcomSpeech (did you mean WelcomeSpeech?)"]


def test_another_kind():
    assert warnings("<Condition ID='WelcomeSpeech'/>") == [
        "m.xml:4:1: warning: the palette has WelcomeSpeech as a Condition; it is an Action"]


def test_other_ports():
    assert warnings("<Action ID='Sleep'><input_port name='msecs'/><output_port name='msec'/></Action>") == [
        "m.xml:4:32: warning: the palette has an unknown port msecs of Sleep (did you mean msec?)",
        "m.xml:4:46: warning: the port msec of Sleep is an input_port, not an output_port"]
    assert warnings("<Action ID='AlwaysSuccess'><input_port name='msec'/></Action>") == [
        "m.xml:4:40: warning: the palette has an unknown port msec of AlwaysSuccess (its ports: none)"]


def test_a_hundred_models_are_told():
    assert len(warnings("<Action ID='Unknown'/>" * 101)) == 100


def test_what_fits_and_what_is_none_of_our_business():
    assert warnings("<Action ID='Sleep' editable='true'><input_port name='msec' type='unsigned'>how long</input_port>"
                    "<MetadataFields><Metadata author='me'/></MetadataFields></Action><SubTree ID='M'/>") == []


def test_the_mission_loader_warns(tmp_path):
    path = tmp_path / "m.xml"
    path.write_text("<root BTCPP_format='4'><BehaviorTree ID='M'><AlwaysSuccess/></BehaviorTree>"
                    "<TreeNodesModel><Action ID='Nothing'/></TreeNodesModel></root>")
    assert any("an unknown node Nothing" in str(fault) for fault in load_tree(str(path)).warnings)
