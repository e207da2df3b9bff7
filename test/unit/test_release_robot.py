"""A mission on a robot of release 1.0, without ROS: files answer, the tablet tells no button, leaves say when they listen."""
import json

import pytest

from behavior_controller import folders, leaves, mission, settings
from behavior_controller.bt.engine.clock import ManualClock
from behavior_controller.bt.language.document import parse
from behavior_controller.bt.status import FAILURE, RUNNING, SUCCESS
from behavior_controller.errors import FaultsFound
from behavior_controller.events import Events
from behavior_controller.gateway import FakeGateway, FakeTopics
from behavior_controller.interface import Evidence, Interface, Sense, Topic, document, robots
from behavior_controller.interface.records import Answer, GoTo, Location, Prompt, Say, SetPose
from behavior_controller.interface.release_1_0 import SPEECH
from behavior_controller.leaves import base
from behavior_controller.leaves.conditions import TopicCondition
from behavior_controller.runner import Runner, Running
from behavior_controller.watch.record import Record
from behavior_controller.watch.replay import read_record, replay

ENVIRONMENT = """robotLocationDescription 1 the door
robotLocationPose 1 2.5 -1.25 90
preGestureMessageKinyarwanda 1 Muraho
postGestureMessageKinyarwanda 1 Ngwino
gestureTarget 1 0 0 0
robotLocationDescription 2 the arm
robotLocationPose 2 -3.5 4 -90
gestureTarget 2 1 2 0.5
preGestureMessageKinyarwanda 2 Ukuboko
postGestureMessageKinyarwanda 2 Murakoze
tourSpecification 2 1 2
"""
CULTURE = "phraseLanguage Kinyarwanda\n" + "".join(
    "utilityPhraseKinyarwanda{0} {0}\n".format(number) for number in range(1, 8))


@pytest.fixture
def files(tmp_path, monkeypatch):
    """Give the configuration a folder with both knowledge files; return a function that writes one of them anew."""
    (tmp_path / "data").mkdir()
    (tmp_path / "config").mkdir()

    def write(kind, text):
        (tmp_path / "config" / "{}KnowledgeBaseConfiguration.ini".format(kind)).write_text(
            "knowledgeBase {}.dat\n".format(kind))
        (tmp_path / "data" / "{}.dat".format(kind)).write_text(text)

    write("environment", ENVIRONMENT)
    write("culture", CULTURE)
    config = folders.config
    monkeypatch.setattr(folders, "config", lambda name: str(tmp_path / "config" / name)
                        if "KnowledgeBase" in name else config(name))
    return write


def loaded(body, clock=None, **given):
    text = '<root BTCPP_format="4"><BehaviorTree ID="M"><Sequence>{}</Sequence></BehaviorTree></root>'.format(body)
    chosen = settings.defaults(**dict(dict(robotInterface="release-1.0"), **given))
    return mission.load(chosen, clock or ManualClock(), documents=[parse(text, "m.xml")])


class Listened(FakeTopics):
    """Topics that keep what they were asked to listen to."""

    def __init__(self, clock):
        super().__init__(clock.now)
        self.asked = []

    def listen(self, topic, seconds):
        self.asked.append((topic.name, seconds))


class Rig:
    """A mission on a robot that does everything at once; ``tick`` gives the status of its root."""

    def __init__(self, body, **given):
        self.clock = ManualClock(100.0)
        self.mission = loaded(body, self.clock, **given)
        self.tree = self.mission.tree
        self.gateway = FakeGateway(reply=lambda request: Answer())
        self.topics = Listened(self.clock)
        self.context = self.mission.context(self.gateway, self.topics, Events())
        self.tree.setup(mission=self.context)
        self.context.begin_visit(self.tree.blackboard, 99.0)

    def tick(self):
        return self.tree.tick_once()


# ------------------------------------------------------------------------------------------------------ knowledge by files


def test_the_files_answer_at_once_and_the_robot_is_not_asked(files):
    rig = Rig("<LookUpHome/><Navigate/><RetrieveListOfExhibits/><SelectExhibit/><SelectExhibit/><Navigate/>"
              "<DescribeExhibitSpeech name='1'/><LookUpEntrance/><Navigate/>")
    assert rig.tick() is SUCCESS
    assert rig.gateway.requests == [GoTo(Location(2.5, -1.25, 90.0)), GoTo(Location(-3.5, 4.0, -90.0)),
                                    Say("Ukuboko", "Kinyarwanda"), GoTo(Location(-3.5, 4.0, -90.0))]


def test_language_phrases_and_words_are_those_of_the_culture_file(files):
    rig = Rig("<WelcomeSpeech/>", language="English")
    assert rig.tick() is SUCCESS
    assert [request.language for request in rig.gateway.requests] == ["Kinyarwanda"]
    assert rig.gateway.requests[0].text.startswith("Muraho")
    assert rig.context.knowledge.phrases[3] == "3" and rig.mission.language == "Kinyarwanda"


def test_what_is_wrong_in_the_files_and_in_the_mission_is_told_in_one_pass(files):
    files("environment", ENVIRONMENT.replace("2.5 -1.25 90", "2.5 x 90"))
    files("culture", CULTURE.replace("Kinyarwanda2 2", "Kinyarwanda2"))
    with pytest.raises(FaultsFound) as raised:
        loaded("\n<Nope/>")
    found = [(fault.file.split("/")[-1], fault.line) for fault in raised.value.faults]
    assert ("environment.dat", 2) in found and ("culture.dat", 3) in found and ("m.xml", 2) in found


def test_the_warnings_of_the_files_are_the_mission_s(files):
    files("environment", ENVIRONMENT.replace("gestureTarget 1 0 0 0\n", ""))
    assert ["gestureTarget" in fault.text for fault in loaded("<Navigate/>").warnings if "dat" in fault.file] == [True]


def test_a_robot_of_the_document_needs_no_files():
    assert loaded("<Navigate/>", robotInterface="D5.4.3").knowledge is None


# ------------------------------------------------------------------------------------------------------------- the tablet


@pytest.mark.parametrize("success_is, result", [("done", FAILURE), ("yes", SUCCESS)])
def test_what_the_tablet_s_success_means(files, success_is, result):
    rig = Rig("<PressYesNoDialogue/><IsVisitorResponseYes/>", tabletSuccessIs=success_is)
    assert rig.tick() is result
    assert rig.gateway.requests == [Prompt(rig.context.phrases.tablet_options)]


def test_the_key_means_nothing_where_the_tablet_says_what_was_pressed():
    with pytest.raises(FaultsFound, match="tabletSuccessIs: the tablet of the robot D5.4.3 says which button was pressed"):
        loaded("<PressYesNoDialogue/>", robotInterface="D5.4.3", tabletSuccessIs="yes")


# -------------------------------------------------------------------------------------------------------------- utterances


def test_a_condition_listens_as_long_as_it_waits_and_no_longer_than_it_needs_to(files):
    rig = Rig("<IsYesNoUttered/>")
    assert rig.tick() is RUNNING
    assert rig.topics.asked == [(SPEECH.name, 10.0)]
    rig.topics.publish(SPEECH, "yego")
    assert rig.tick() is SUCCESS
    assert rig.topics.asked[-1] == (SPEECH.name, 0.0)


def test_a_condition_that_is_halted_listens_no_longer(files):
    rig = Rig("<IsYesNoUttered/>")
    rig.tree.halt()
    assert rig.topics.asked == []  # another one may listen
    rig.tick()
    rig.tree.halt()
    assert rig.topics.asked == [(SPEECH.name, 10.0), (SPEECH.name, 0.0)]


def test_an_answer_is_waited_for_ten_seconds(files):
    rig = Rig("<IsYesNoUttered/>")
    rig.tick()
    rig.clock.advance(9.9)
    assert rig.tick() is RUNNING
    rig.clock.advance(0.2)
    assert rig.tick() is FAILURE


def test_a_visitor_is_waited_for_without_a_limit(files):
    rig = Rig("<IsVisitorDiscovered/>")
    assert rig.tick() is RUNNING
    rig.clock.advance(1e6)
    assert rig.tick() is RUNNING
    topic = rig.context.interface.evidence(Sense.VISITOR).topic
    rig.topics.publish(topic, topic.value("scanning", 2))
    assert rig.tick() is SUCCESS


# ---------------------------------------------------------------------------------------- a mission and a robot that do not fit


class TellPose(base.ServiceLeaf):
    """A leaf of release 1.0."""

    asks = SetPose

    def request(self):
        return SetPose(Location(0.0, 0.0, 0.0))


class IsPresent(TopicCondition):
    """A condition of release 1.0."""

    sense = Sense.PRESENCE


def faults_of(monkeypatch, node, leaf):
    """Return the faults of a mission with this leaf for the robot of D5.4.3."""
    registry = leaves.registry()
    registry.extend([base.leaf_spec(node, leaf, "A leaf that the robot cannot serve.")])
    monkeypatch.setattr(leaves, "registry", lambda: registry)
    with pytest.raises(FaultsFound) as raised:
        loaded("\n<{}/>".format(node), robotInterface="D5.4.3")
    return [str(fault) for fault in raised.value.faults]


@pytest.mark.parametrize("leaf, lacking", [
    (TellPose, "service for SetPose"), (IsPresent, "message about the visitor's presence")])
def test_a_node_that_the_robot_cannot_serve_is_a_fault_at_its_place(monkeypatch, files, leaf, lacking):
    whole = document.INTERFACE
    evidence = {sense: whole.evidence(sense) for sense in Sense if sense is not Sense.PRESENCE and whole.tells(sense)}
    monkeypatch.setitem(robots.INTERFACES, whole.name, Interface(
        whole.name, whole.services, whole.topics, whole.safe_state, evidence))
    assert faults_of(monkeypatch, "Other", leaf) == [
        "m.xml:2:1: Other cannot work with the robot D5.4.3: it has no {} (set robotInterface release-1.0)".format(lacking)]
    assert loaded("\n<Other/>").tree is not None


def test_what_no_robot_offers_has_to_be_declared(monkeypatch, files):
    class IsLit(TopicCondition):
        own_evidence = Evidence(Topic("/lamp/text", "lamp", "std_msgs/String", str, str, "", is_continuous=False))
    assert faults_of(monkeypatch, "IsLit", IsLit) == [
        "m.xml:2:1: IsLit cannot work with the robot D5.4.3: it has no topic /lamp/text "
        "(no robot has one; declare it in the robot's interface)"]


# ------------------------------------------------------------------------------------------------------------ record, replay


def recorded(tmp_path, files):
    """Record a pass and return the lines of the record."""
    clock = ManualClock(100.0)
    plan = loaded("<LookUpHome/><Navigate/><WelcomeSpeech/><PressYesNoDialogue/>", clock)
    record = Record(str(tmp_path / "run"), clock, pytest.fail, plan.settings.interface)
    events = Events()
    events.subscribe(record)
    record.show(plan.tree)
    context = plan.context(record.gateway(FakeGateway(reply=lambda request: Answer())),
                           record.topics(FakeTopics(clock.now)), events)
    assert Runner(Running(plan.tree, context, plan.file, 1), lambda: False).run() == 0
    record.close()
    return record.path


def test_a_record_has_the_knowledge_and_is_replayed_without_the_files(tmp_path, files):
    path = recorded(tmp_path, files)
    with open(path, encoding="utf-8") as file:
        started = next(json.loads(line) for line in file if '"RunStarted"' in line)
    assert [source["text"] for source in started["sources"]["knowledge"]] == [ENVIRONMENT, CULTURE]
    files("environment", "nothing")
    files("culture", "nothing")
    outcome = replay(read_record(path))
    assert (outcome.passes, outcome.divergence) == (1, "")


def test_a_record_with_other_knowledge_takes_another_path(tmp_path, files):
    path = recorded(tmp_path, files)
    with open(path, encoding="utf-8") as file:
        text = file.read().replace("1 2.5 -1.25 90", "1 2.5 -1.75 90")
    with open(path, "w", encoding="utf-8") as file:
        file.write(text)
    assert "-1.75" in replay(read_record(path)).divergence
