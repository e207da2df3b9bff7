"""A node type's name is taken once, and a wrong name finds its neighbour."""
import dataclasses

import pytest

from behavior_controller.bt import SKIPS, SUCCEEDS, SUCCESS
from behavior_controller.bt.engine.node_types import Registry
from behavior_controller.bt.engine.registry import Kind, NodeSpec, Port


def spec(node_id):
    return NodeSpec(node_id, Kind.ACTION, lambda name: None)


def test_types_are_found_by_name_and_kept_in_order():
    registry = Registry([spec("WelcomeSpeech"), spec("Navigate")])
    assert registry["Navigate"].id == "Navigate"
    assert "navigate" not in registry
    assert list(registry)[-2:] == ["WelcomeSpeech", "Navigate"]


def test_nothing_is_known_of_a_type_that_says_nothing():
    silent = spec("Wave")
    assert {name for name, value in vars(silent).items()
            if value} == {"id", "kind", "factory", "fewest_children"}
    assert silent.fewest_children == 1
    assert {name for name, value in Port("at")._asdict().items()
            if value} == {"name", "type", "direction", "role"}


def test_the_summary_names_what_an_instance_may_be_called():
    waves = NodeSpec("Wave", Kind.ACTION, lambda name: None, description="Waves.")
    assert waves.summary == "Waves."
    assert dataclasses.replace(waves,
                               names=("left", "right")).summary == "Waves. Named left, right."


def test_a_second_registration_is_refused():
    registry = Registry([spec("Navigate")])
    with pytest.raises(ValueError, match="Navigate is registered twice"):
        registry.extend([spec("Navigate")])


@pytest.mark.parametrize("field", ["advances_on", "repeats_on", "outcome"])
def test_the_status_of_a_node_is_no_end_of_it(field):
    with pytest.raises(ValueError, match="the {} of the node type 'Wave' is <?Status.*, and not of "
                                         "the type int".format(field)):
        Registry([dataclasses.replace(spec("Wave"), **{field: SUCCESS})])
    Registry([dataclasses.replace(spec("Wave"), **{field: SUCCEEDS | SKIPS})])
