"""A mission is put together from its files in one place: everything wrong is found at once, and each check runs once."""
import sys

import pytest

from behavior_controller import folders, mission, settings
from behavior_controller.bt.checking import checks
from behavior_controller.bt.engine.clock import ManualClock
from behavior_controller.bt.language.document import parse
from behavior_controller.errors import ConfigurationError, FaultsFound
from behavior_controller.events import Events
from behavior_controller.gateway import FakeGateway, FakeTopics
from behavior_controller.health import Health
from behavior_controller.interface.document import INTERFACE

WRONG = '<root BTCPP_format="4"><BehaviorTree ID="M"><Sequence>\n<WelcomeSpeech/><Nope/></Sequence></BehaviorTree></root>'
ODD = """<root BTCPP_format="4"><TreeNodesModel><Action ID="Nothing"/></TreeNodesModel>
<BehaviorTree ID="M 1"><Sequence>
<Script code="b := a"/></Sequence></BehaviorTree></root>"""


def test_the_lab_tour_is_what_the_settings_name():
    clock = ManualClock()
    loaded = mission.load(settings.defaults(language="Kinyarwanda"), clock)
    assert loaded.file == folders.mission("lab_tour")
    assert loaded.tree.clock is clock
    health = Health()
    context = loaded.context(FakeGateway(), FakeTopics(clock.now), Events(), health)
    assert (context.settings, context.phrases, context.policy, context.clock, context.health) == (
        loaded.settings, loaded.phrases, loaded.policy, clock, health)
    assert context.phrases.speech("WelcomeSpeech").startswith("Muraho")


def test_a_mission_that_was_put_together_stays_as_it_is():
    loaded = mission.load(settings.defaults())
    with pytest.raises(AttributeError):
        loaded.settings = settings.defaults(language="Kinyarwanda")


def test_the_faults_of_all_files_are_told_at_once(tmp_path, monkeypatch):
    (tmp_path / "recoveryPolicy.ini").write_text("budget 1 1\nNope * 0 0 skip\n")
    monkeypatch.setattr(folders, "config", lambda name: str(tmp_path / name))
    with pytest.raises(FaultsFound) as raised:
        mission.load(settings.defaults(language="Klingon"), documents=[parse(WRONG, "m.xml")])
    assert [fault.file.split("/")[-1] for fault in raised.value.faults] == ["language", "recoveryPolicy.ini", "m.xml"]


def test_a_mission_that_is_missing_is_told_with_those_that_are_there():
    with pytest.raises(ConfigurationError, match="there is no mission .*did you mean lab_tour"):
        mission.load(settings.defaults(scenarioSpecification="lab_tuor"))


def test_the_warnings_of_check_models_and_linter_stand_in_the_order_of_the_file(tmp_path):
    (tmp_path / "m.xml").write_text(ODD)
    assert [fault.line for fault in mission.load_tree(str(tmp_path / "m.xml")).warnings] == [1, 2, 3]


def test_a_load_checks_the_mission_once():
    calls = []

    def notice(frame, event, argument):
        if event == "call" and frame.f_code is checks.check.__code__:
            calls.append(event)

    sys.setprofile(notice)
    try:
        mission.load_tree(folders.mission("lab_tour"))
    finally:
        sys.setprofile(None)
    assert len(calls) == 1


# --------------------------------------------------------------------------------------- only what the mission needs


def offers_of(element, **changed):
    """Return the names of what a mission of these elements needs of the robot."""
    text = "<root BTCPP_format='4'><BehaviorTree ID='M'><Sequence>{}</Sequence></BehaviorTree></root>".format(element)
    loaded = mission.load(settings.defaults(**changed), documents=[parse(text)])
    return [offer.name for offer in loaded.offers]


def test_a_mission_needs_what_its_nodes_use():
    assert offers_of("<WelcomeSpeech/>") == ["/textToSpeech/say_text"]
    assert offers_of("<IsVisitorDiscovered/><Navigate/>") == ["/robotNavigation/set_goal", "/faceDetection/data"]
    assert offers_of("<Sleep msec='1'/>") == []
    assert offers_of("<WelcomeSpeech/>", startupCheck="all") == [offer.name for offer in INTERFACE.offers]
