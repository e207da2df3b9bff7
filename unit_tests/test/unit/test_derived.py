"""Test that what is derived from declarations in both packages is up to date."""
import importlib.util
import os

import pytest

from behavior_controller import folders
from behavior_controller.bt.engine.registry import Kind, Port
from behavior_controller.robot.requests import Request
from behavior_controller.config.node_facts import MissionSpec


@pytest.fixture(scope="module")
def derive():
    spec = importlib.util.spec_from_file_location(
        "derive", os.path.join(folders.share(), "tools", "derive.py"))
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.slow
def test_each_derived_file_is_up_to_date(derive):
    pytest.importorskip("rospy", reason="--help of a node needs ROS")
    # compared by test_rules.py
    outdated = sorted(set(derive.outdated()) - {os.path.join("docs", "faults.md")})
    assert not outdated, "make derived writes {}".format(", ".join(outdated))


def test_a_value_that_a_configuration_gives_stays_and_what_is_new_is_added(derive):
    now = "topicMaxAge  3   # seconds\nlanguage\nforgotten 1\n"
    lines = {line.split()[0]: line.split("#")[0].split()[1:]
             for line in derive.key_lines(derive.settings.KEYS)(now).split("\n")}
    assert (lines["topicMaxAge"], lines["language"], lines["missionRuns"]) == (["3"], [], ["0"])
    assert set(lines) == {key.name for key in derive.settings.KEYS
                          } - {"scenarioSpecification", "verboseMode", "asrEnabled"}


def test_a_part_that_is_not_marked_is_named(derive):
    parts = {"keys": lambda now: now + "more"}
    text = "a\n# derived: keys\nb\n# derived: end\nc\n"
    assert derive.with_parts(text, parts) == "a\n# derived: keys\nb\nmore\n# derived: end\nc\n"
    with pytest.raises(ValueError, match="derived: keys"):
        derive.with_parts("a\n# derived: others\nb\n# derived: end\n", parts)


def test_a_port_is_shown_with_its_default(derive, monkeypatch):
    ports = tuple(Port(name, default=default) for name, default in (
        ("entry", "{@entry}"), ("other", "{@entry}"), ("local", "{there}"), ("literal", "45"),
        ("needed", None)))
    monkeypatch.setattr(derive.leaves, "specs",
                        lambda: [MissionSpec("Bow", Kind.ACTION, None, ports, "Bows.")])
    assert derive.nodes(Kind.ACTION).splitlines()[2:] == [
        "* **Bow**: Bows. Reads `entry`, `other` (`{@entry}`), `local` (`{there}`), `literal` "
        "(`45`), `needed`."]


def test_another_name_of_a_node_stands_beside_it_and_conditions_apart(derive, monkeypatch):
    monkeypatch.setattr(derive.leaves, "specs", lambda: [
        MissionSpec("Bow", Kind.ACTION, None, (), "Bows."), MissionSpec(
            "Bend", Kind.ACTION, None, (), "Bows; another name of Bow."), MissionSpec(
                "IsBowed", Kind.CONDITION, None, (), "Is it bowed?")])
    assert derive.nodes(Kind.ACTION).splitlines()[2:] == ["* **Bow, Bend**: Bows."]
    assert derive.nodes(Kind.CONDITION).splitlines()[2:] == ["* **IsBowed**: Is it bowed?"]


def test_a_request_that_no_robot_has_a_service_for_is_named(derive, monkeypatch):
    monkeypatch.setattr(derive.leaves, "specs",
                        lambda: [MissionSpec("Ask", Kind.ACTION, None, calls=(Request, ))])
    with pytest.raises(LookupError, match="no service is declared for the request Request"):
        derive.nodes(Kind.ACTION)
