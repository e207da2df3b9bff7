"""A mission is put together from its files in one place: everything wrong is found at once, and
each check runs once."""
import dataclasses
import sys
from types import ModuleType

import pytest

from behavior_controller import extensions, folders, leaves
from behavior_controller.config import phrases, settings
from behavior_controller.missions import load
from behavior_controller.bt.loader import checks
from behavior_controller.bt.engine.clock import ManualClock
from behavior_controller.bt.loader.document import parse
from behavior_controller.errors import ConfigurationError, Fault, FaultsFound
from behavior_controller.run.events import Events
from behavior_controller.robot.gateway import FakeGateway, FakeTopics
from behavior_controller.run.health import Health
from behavior_controller.robot.declarations import Interface, Sense, Topic
from behavior_controller.robot.d543 import INTERFACE
from behavior_controller.robot.requests import Request
from behavior_controller.leaves.base import ServiceLeaf, leaf_spec

WRONG = ('<root BTCPP_format="4"><BehaviorTree ID="M"><Sequence>\n<WelcomeSpeech/><Nope/>'
         '</Sequence></BehaviorTree></root>')
ODD = """<root BTCPP_format="4"><TreeNodesModel><Action ID="Nothing"/></TreeNodesModel>
<BehaviorTree ID="M 1"><Sequence>
<Script code="b := a"/></Sequence></BehaviorTree></root>"""


def test_the_lab_tour_is_what_the_settings_name():
    clock = ManualClock()
    loaded = load.load(settings.defaults(language="Kinyarwanda"), clock)
    assert loaded.file == folders.mission("lab_tour")
    assert loaded.tree.clock is clock
    health = Health()
    context = loaded.context(FakeGateway(), FakeTopics(clock.now), Events(), health)
    assert (context.settings, context.phrases, context.policy, context.clock, context.health) == (
        loaded.settings, loaded.phrases, loaded.policy, clock, health)
    assert context.phrases.speeches["WelcomeSpeech"].startswith("Muraho")


def test_a_mission_that_was_put_together_stays_as_it_is():
    loaded = load.load(settings.defaults())
    with pytest.raises(AttributeError):
        loaded.settings = settings.defaults(language="Kinyarwanda")


def test_the_faults_of_all_files_are_told_at_once(tmp_path, monkeypatch):
    (tmp_path / "recoveryPolicy.ini").write_text("budget 1 1\nNope * 0 0 skip\n")
    monkeypatch.setattr(folders, "config", lambda name: str(tmp_path / name))
    with pytest.raises(FaultsFound) as raised:
        load.load(settings.defaults(language="Klingon"), documents=[parse(WRONG, "m.xml")])
    assert [fault.file.split("/")[-1]
            for fault in raised.value.faults] == ["language", "recoveryPolicy.ini", "m.xml"]


def faults_of_load(body="<WelcomeSpeech/>", **changed):
    text = '<root BTCPP_format="4"><BehaviorTree ID="M">{}</BehaviorTree></root>'.format(body)
    with pytest.raises(FaultsFound) as raised:
        load.load(settings.defaults(**changed), documents=[parse(text, "m.xml")])
    return str(raised.value).split("\n")


def test_a_key_that_the_robot_has_no_use_for_is_a_fault():
    assert faults_of_load(tabletSuccessIs="yes") == [
        "tabletSuccessIs: the tablet of the robot D5.4.3 says which button was pressed (leave "
        "tabletSuccessIs out, or choose another robotInterface)"]


def test_an_operator_needs_the_services_to_start_a_mission():
    fault, = faults_of_load(startBy="operator")
    assert fault.startswith("startBy: ") and "rosInterface true" in fault


def test_a_package_that_cannot_be_used_is_told_with_the_other_faults(monkeypatch):
    package = extensions.Extension("a", "/a", ModuleType("a.phrases"))

    def found(kind):
        raise package.broken("it has no SPEECHES")

    monkeypatch.setattr(extensions, "exported", found)
    first, second = faults_of_load("<Nope/>")
    assert first.startswith("package a: a.phrases: ") and second.startswith("m.xml:1:45: ")


def test_a_phrase_that_the_culture_file_lacks_is_told_with_the_file():
    text = ('<root BTCPP_format="4"><BehaviorTree ID="M"><Sequence><SayText name="7"/>\n<SayText '
            'name="8"/></Sequence>' \
           '</BehaviorTree></root>')
    loaded = load.load(settings.defaults(robotInterface="release-1.0"),
                       documents=[parse(text, "m.xml")])
    fault, = loaded.warnings
    assert (fault.line, fault.column, fault.code) == (2, 10, "phrase-missing")
    assert fault.text.startswith("the culture file has no utility phrase 8")
    assert folders.data("cultureKnowledgeBase.dat") + ": utilityPhraseEnglish8 " in fault.hint


def test_a_mission_that_is_missing_is_told_with_those_that_are_there():
    with pytest.raises(ConfigurationError, match="there is no mission .*did you mean lab_tour"):
        load.load(settings.defaults(scenarioSpecification="lab_tuor"))
    with pytest.raises(ConfigurationError) as raised:
        load.find("x")
    assert str(
        raised.value) == "scenarioSpecification: there is no mission {} (there are: {})".format(
        folders.data("x.xml"), "d6_1_tour, lab_tour, reception, release_1_0_reception, "
        "release_1_0_tour, release_1_1_tour, release_1_1_visitor_tour")


def test_on_a_robot_of_release_1_0_the_culture_file_chooses_the_language():
    assert load.load(settings.defaults(language="Kinyarwanda")).language == "Kinyarwanda"
    loaded = load.load(settings.defaults(robotInterface="release-1.0"))
    assert (loaded.language, loaded.phrases.speeches) == ("English",
                                                          phrases.load("English").speeches)


def test_the_warnings_of_the_mission_come_before_those_of_its_knowledge_files():
    loaded = load.load(settings.defaults(robotInterface="release-1.0"),
                       documents=[parse(ODD, "m.xml")])
    odd = Fault("places.dat", 3, 1, "odd", is_warning=True)
    knowledge = dataclasses.replace(loaded.knowledge, warnings=(odd,))
    found = dataclasses.replace(loaded, knowledge=knowledge).warnings
    assert [fault.line for fault in loaded.warnings] == [1, 2, 3]
    assert found == loaded.warnings + (odd,)


def test_the_warnings_of_check_models_and_linter_stand_in_the_order_of_the_file(tmp_path):
    (tmp_path / "m.xml").write_text(ODD)
    assert [fault.line for fault in load.load_tree(str(tmp_path / "m.xml")).warnings] == [1, 2, 3]


def test_a_load_checks_the_mission_once():
    calls = []

    def notice(frame, event, argument):
        if event == "call" and frame.f_code is checks.check.__code__:
            calls.append(event)

    sys.setprofile(notice)
    try:
        load.load_tree(folders.mission("lab_tour"))
    finally:
        sys.setprofile(None)
    assert len(calls) == 1


# ---------------------------------------------------------------------- only what the mission needs


def offers_of(element, **changed):
    """Return the names of what a mission of these elements needs of the robot."""
    text = ("<root BTCPP_format='4'><BehaviorTree ID='M'><Sequence>{}</Sequence></BehaviorTree></"
            "root>".format(element))
    loaded = load.load(settings.defaults(**changed), documents=[parse(text)])
    return [offer.name for offer in loaded.offers]


class FixtureWave(Request):
    """A request for which no robot has a service."""


class FixtureWaves(ServiceLeaf):
    """Makes it."""

    asks = FixtureWave

    def request(self):
        """FixtureWave."""
        return FixtureWave()


DOORS = Topic("/doors/state", "doors", "std_msgs/String", str, lambda message: message.data,
              "no door is seen", True)


def tree_of(**facts):
    """Return the tree of a mission that is one node with these facts."""
    registry = leaves.registry()
    registry.extend(
        [dataclasses.replace(leaf_spec("FixtureWaves", FixtureWaves, "FixtureWaves."), **facts)])
    return load.build_tree([
        parse('<root BTCPP_format="4"><BehaviorTree ID="M"><FixtureWaves/></BehaviorTree></root>',
              "m.xml")], registry=registry)


def test_what_no_robot_has_is_a_fault():
    fault, = load.on_robot(tree_of(listens=(DOORS, Sense.GAZE)), settings.defaults())
    assert (fault.line, fault.column, fault.code) == (1, 45, "robot-lacks")
    assert (fault.text, fault.hint) == (
        "FixtureWaves cannot work with the robot D5.4.3: it has no service for FixtureWave, topic "
        "/doors/state", "no robot has one; declare it in the robot's interface")


def test_what_a_node_does_without_is_a_warning_that_names_the_robots_that_have_it():
    tree = tree_of(calls=(), listens=(Sense.GAZE,), does_without=True)
    bare = Interface("bare", (), (), (), {})
    fault, = load.unsupported(tree, bare)
    assert (fault.line, fault.column, fault.code, fault.is_warning) == (1, 45, "does-without", True)
    assert fault.text.endswith(
        "aves does nothing with the robot bare: it has no message about the visitor's gaze")
    assert fault.hint == "set robotInterface D5.4.3 or release-1.0 or release-1.1"
    assert load.unsupported(tree, INTERFACE) == load.on_robot(tree, settings.defaults()) == []


def test_a_mission_needs_what_its_nodes_use():
    assert offers_of("<WelcomeSpeech/>") == ["/textToSpeech/say_text"]
    assert offers_of("<IsVisitorDiscovered/><Navigate/>") == [
        "/robotNavigation/set_goal", "/faceDetection/data"]
    assert offers_of("<Sleep msec='1'/>") == []
    assert offers_of("<WelcomeSpeech/>",
                     startupCheck="all") == [offer.name for offer in INTERFACE.offers]
