"""A mission on a robot of release 1.0, without ROS: files answer, the tablet tells no button,
leaves say when they listen."""
import json
from pathlib import Path

import pytest

from behavior_controller import folders, leaves
from behavior_controller.config import settings
from behavior_controller.missions import load
from behavior_controller.bt.engine.clock import ManualClock
from behavior_controller.bt.loader.document import parse
from behavior_controller.bt.values.status import FAILURE, RUNNING, SUCCESS
from behavior_controller.errors import FaultsFound
from behavior_controller.run.events import Events, LeafFinished, Line, StepStarted
from behavior_controller.run.history import Run
from behavior_controller.robot.gateway import FakeGateway, FakeTopics
from behavior_controller.robot import d543, interfaces
from behavior_controller.robot.declarations import Evidence, Interface, Sense, Topic
from behavior_controller.robot.requests import Answer, GoTo, Location, Prompt, Say, SetPose
from behavior_controller.robot.release_1_0 import SPEECH
from behavior_controller.leaves import base
from behavior_controller.leaves.conditions import TopicCondition
from behavior_controller.missions.runner import Runner, Running
from behavior_controller.run.record.reader import read_record
from behavior_controller.missions.replay import replay

from mission_rig import FileRecord, one_leaf, refusal, write, written

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
    """Give the configuration a folder with both knowledge files; return a function that writes one
    of them anew."""
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
    text = ('<root BTCPP_format="4"><BehaviorTree ID="M"><Sequence>{}</Sequence></BehaviorTree></'
            'root>'.format(body))
    chosen = settings.defaults(**dict(dict(robotInterface="release-1.0"), **given))
    return load.load(chosen, clock or ManualClock(), documents=[parse(text, "m.xml")])


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


# ------------------------------------------------------------------------------- knowledge by files


def test_the_files_answer_at_once_and_the_robot_is_not_asked(files):
    rig = Rig("<LookUpHome/><Navigate/><RetrieveListOfExhibits/><SelectExhibit/><SelectExhibit/>"
              "<Navigate/><DescribeExhibitSpeech name='1'/><LookUpEntrance/><Navigate/>")
    assert rig.tick() is SUCCESS
    assert rig.gateway.requests == [
        GoTo(Location(2.5, -1.25, 90.0)),
        GoTo(Location(-3.5, 4.0, -90.0)),
        Say("Ukuboko", "Kinyarwanda"),
        GoTo(Location(-3.5, 4.0, -90.0))]


def test_language_phrases_and_words_are_those_of_the_culture_file(files):
    rig = Rig("<WelcomeSpeech/>", language="English")
    assert rig.tick() is SUCCESS
    assert [request.language for request in rig.gateway.requests] == ["Kinyarwanda"]
    assert rig.gateway.requests[0].text.startswith("Muraho")
    assert rig.context.knowledge.phrases[3] == "3" and rig.mission.language == "Kinyarwanda"


def test_another_language_than_the_culture_file_s_is_refused(files):
    with pytest.raises(FaultsFound, match="^language: ") as raised:
        loaded("<WelcomeSpeech/>", language="IsiZulu")
    assert "phraseLanguage" in raised.value.faults[0].hint
    assert loaded("<WelcomeSpeech/>", language="Kinyarwanda").language == "Kinyarwanda"


def test_a_key_of_the_release_s_own_controller_is_a_warning(files, tmp_path):
    path = tmp_path / settings.FILE_NAME
    path.write_text("scenarioSpecification labTour\nverboseMode true\nasrEnabled false\n"
                    "audioDebugMode false")
    chosen = settings.load(str(path), {"robotInterface": "release-1.0"}, {"audioDebugMode": "true"})
    assert [(fault.file, fault.line, fault.is_warning) for fault in chosen.warnings] == [
        (str(path), 4, True), ("argument audioDebugMode", 0, True)]
    text = "<root BTCPP_format='4'><BehaviorTree ID='M'><WelcomeSpeech/></BehaviorTree></root>"
    plan = load.load(chosen, documents=[parse(text, "m.xml")])
    assert plan.warnings[:2] == chosen.warnings


def test_what_is_wrong_in_the_files_and_in_the_mission_is_told_in_one_pass(files):
    files("environment", ENVIRONMENT.replace("2.5 -1.25 90", "2.5 x 90"))
    files("culture", CULTURE.replace("Kinyarwanda2 2", "Kinyarwanda2"))
    with pytest.raises(FaultsFound) as raised:
        loaded("\n<Nope/>")
    found = [(fault.file.split("/")[-1], fault.line) for fault in raised.value.faults]
    assert ("environment.dat", 2) in found and ("culture.dat", 3) in found and ("m.xml", 2) in found


def test_the_warnings_of_the_files_are_the_mission_s(files):
    files("environment", ENVIRONMENT.replace("gestureTarget 1 0 0 0\n", ""))
    assert ["gestureTarget" in fault.text for fault in loaded("<Navigate/>").warnings
            if "dat" in fault.file] == [True]


def test_a_robot_of_the_document_needs_no_files():
    assert loaded("<Navigate/>", robotInterface="D5.4.3").knowledge is None


# --------------------------------------------------------------------------------------- the tablet


@pytest.mark.parametrize("success_is, result", [("done", FAILURE), ("yes", SUCCESS)])
def test_what_the_tablet_s_success_means(files, success_is, result):
    rig = Rig("<PressYesNoDialogue/><IsVisitorResponseYes/>", tabletSuccessIs=success_is)
    assert rig.tick() is result
    assert rig.gateway.requests == [Prompt(rig.context.phrases.tablet_options)]


@pytest.mark.parametrize("key, value", [("tabletSuccessIs", "yes"), ("waitForSpeech", "all"),
                                        ("waitForSpeech", "none"), ("speechPace", 2.0)])
def test_a_key_of_this_robot_is_refused_where_it_means_nothing(files, key, value):
    with pytest.raises(FaultsFound, match="^{}: [^\n]*D5.4.3".format(key)):
        loaded("<PressYesNoDialogue/>", robotInterface="D5.4.3", **{key: value})
    assert loaded("<PressYesNoDialogue/>", **{key: value}).tree is not None


# ------------------------------------------------------------------------- how long a speech lasts

TEN_WORDS = "These are ten words, which last ten thirds of seconds."


def describing(body="<DescribeExhibitSpeech name='1'/>", text=TEN_WORDS, **given):
    """Return a rig that describes an exhibit in English, on a robot that answers at once."""
    rig = one_leaf(body, robotInterface="release-1.0", **given)
    write(rig, currentExhibit="arm", description1=text, description2="")
    return rig


def lasted(rig):
    """Return the seconds from the first tick of a mission to its end."""
    began, result = rig.clock.now(), rig.tick()
    while result is RUNNING:
        due = rig.clock.next_due()
        assert due is not None and rig.clock.now() < began + 100.0
        rig.clock.set_to(due)
        rig.clock.run_due()
        assert rig.tree.wake.test_and_clear(), "the clock wakes the tree"
        result = rig.tick()
    assert result is SUCCESS
    return rig.clock.now() - began


def test_a_description_lasts_as_long_as_its_words_and_says_when_it_ends():
    rig = describing()
    assert rig.tick() is RUNNING
    assert [(event.words, event.what, event.limit, event.is_wait) for event in rig.of(StepStarted)
            ][1:] == [("saying", "“{}”".format(TEN_WORDS), pytest.approx(10 / 3), False)]
    steps = Run([Line(time, event) for time, event in enumerate(
        event for event in rig.events if isinstance(event, StepStarted))]).state.steps
    assert [(step.what, step.began, step.until) for step in steps] == [
        ("“{}”".format(TEN_WORDS), 0.0, pytest.approx(1.0 + 10 / 3))]
    assert lasted(rig) == pytest.approx(10 / 3)
    assert len(rig.requests) == 1 and rig.clock.next_due() is None
    assert rig.of(LeafFinished)[-1].summary.text == "said “{}”".format(TEN_WORDS)
    assert lasted(rig) == pytest.approx(10 / 3), "each round lasts"


@pytest.mark.parametrize("chosen, description, phrase", [
    ("descriptions", 10 / 3, 0.0), ("all", 10 / 3, 11 / 3), ("none", 0.0, 0.0)])
def test_the_configuration_chooses_the_speeches_that_last(chosen, description, phrase):
    assert lasted(describing(waitForSpeech=chosen)) == pytest.approx(description)
    # "Would you like me to give you a tour of the lab?" has twelve words, the welcome has eleven
    assert lasted(describing("<SayText name='4'/>", waitForSpeech=chosen)) == pytest.approx(phrase)
    assert lasted(describing("<SayText name='5'/>", waitForSpeech=chosen)) == pytest.approx(
        phrase and 12 / 3)


def test_the_pace_is_words_a_second():
    assert lasted(describing(speechPace=0.5)) == pytest.approx(20.0)


def test_a_question_that_lasts_has_been_asked_when_its_words_are_over():
    rig = describing("<SayText name='5'/>", waitForSpeech="all")
    began = rig.clock.now()
    lasted(rig)
    assert rig.tree.blackboard.get("questionAskedAt") == pytest.approx(began + 12 / 3)


def test_where_the_robot_answers_when_it_has_spoken_nothing_is_added(files):
    rig = Rig("<RetrieveListOfExhibits/><SelectExhibit/><DescribeExhibitSpeech name='1'/>")
    assert rig.tick() is SUCCESS  # in Kinyarwanda
    assert rig.gateway.requests == [Say("Muraho", "Kinyarwanda")]
    document = one_leaf("<DescribeExhibitSpeech name='1'/>")
    write(document, currentExhibit="arm", description1=TEN_WORDS)
    assert document.tick() is SUCCESS


def test_a_speech_that_is_refused_does_not_last():
    rig = describing()
    rig.answer = refusal
    assert rig.tick() is FAILURE


def test_a_halted_speech_leaves_no_timer():
    rig = describing()
    assert rig.tick() is RUNNING
    rig.tree.halt()
    assert rig.clock.next_due() is None
    assert [event.status for event in rig.of(LeafFinished)] == ["IDLE"]
    assert lasted(rig) == pytest.approx(10 / 3)


def test_a_retried_speech_lasts_too():
    rig = describing("<Fallback><DescribeExhibitSpeech name='1'/><HandleFallBack/></Fallback>")
    rig.answer = lambda request: refusal(request) if len(rig.requests) == 1 else Answer()
    assert lasted(rig) >= 10 / 3
    assert len(rig.requests) == 2
    assert Run([Line(0.0, event) for event in rig.events]).steps[-1].attempt == 2


# --------------------------------------------------------------------------------------- utterances


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
    assert rig.topics.asked == [(SPEECH.name, 10.0)], "an utterance makes the time no longer"
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


# ------------------------------------------------------------ a mission and a robot that do not fit


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
    return raised.value.faults


@pytest.mark.parametrize("leaf, lacking", [(TellPose, "SetPose"), (IsPresent, "presence")])
def test_a_node_that_the_robot_cannot_serve_is_a_fault_at_its_place(monkeypatch, files, leaf,
                                                                    lacking):
    whole = d543.INTERFACE
    evidence = {sense: whole.evidence(sense) for sense in Sense if sense is not Sense.PRESENCE
                and whole.tells(sense)}
    monkeypatch.setitem(interfaces.INTERFACES, whole.name, Interface(
        whole.name, whole.services, whole.topics, whole.safe_state, evidence))
    fault, = faults_of(monkeypatch, "Other", leaf)
    assert (fault.file, fault.line, fault.column, fault.code) == ("m.xml", 2, 1, "robot-lacks")
    assert fault.text.endswith(" " + lacking) and fault.hint.endswith("release-1.1")
    assert loaded("\n<Other/>").tree is not None


def test_what_no_robot_offers_has_to_be_declared(monkeypatch, files):
    class IsLit(TopicCondition):
        own_evidence = Evidence(
            Topic("/lamp/text", "lamp", "std_msgs/String", str, str, "", is_continuous=False))
    fault, = faults_of(monkeypatch, "IsLit", IsLit)
    assert (fault.line, fault.column, fault.code) == (2, 1,
                                                      "robot-lacks") and "/lamp/text" in fault.text


# ----------------------------------------------------------------------------------- record, replay


class LateTopics(FakeTopics):
    """The robot still hears something when the mission has listened, and a moment later "yego"."""

    def is_hearing(self, topic):
        self.publish(topic, "yego")
        return True


def recorded(tmp_path, files, body="<LookUpHome/><Navigate/><WelcomeSpeech/><PressYesNoDialogue/>"):
    """Record a pass and return the lines of the record."""
    clock = ManualClock(100.0)
    plan = loaded(body, clock)
    record = FileRecord(str(tmp_path / "run"), pytest.fail).open()
    events = Events()
    events.subscribe(record)
    record.show(plan.tree)
    context = plan.context(FakeGateway(reply=lambda request: Answer()),
                           record.topics(LateTopics(clock.now, plan.tree.wake.emit)), events)

    class Waiting(Runner):
        def wait(self, seconds):
            clock.advance(1.0)

    assert Waiting(Running(plan.tree, context, plan.file, 1), lambda: False).run() == 0
    return written(record)


def test_an_answer_that_came_late_is_replayed(tmp_path, files):
    path = recorded(tmp_path, files, "<GetVisitorResponse/><IsVisitorResponseYes/>")
    assert '"RecognitionPending"' in open(path, encoding="utf-8").read()
    outcome = replay(read_record(path))
    assert (outcome.passes, outcome.divergence) == (1, "")


def test_a_record_has_the_knowledge_and_is_replayed_without_the_files(tmp_path, files):
    path = recorded(tmp_path, files)
    with open(path, encoding="utf-8") as file:
        started = next(json.loads(line)["event"] for line in file if '"RunStarted"' in line)
    assert [text for _, text in started["sources"]["knowledge"]] == [ENVIRONMENT, CULTURE]
    files("environment", "nothing")
    files("culture", "nothing")
    outcome = replay(read_record(path))
    assert (outcome.passes, outcome.divergence) == (1, "")


def test_a_record_with_other_knowledge_takes_another_path(tmp_path, files):
    path = recorded(tmp_path, files)
    text = Path(path).read_text("utf-8").replace("1 2.5 -1.25 90", "1 2.5 -1.75 90")
    Path(path).write_text(text, "utf-8")
    assert "-1.75" in replay(read_record(path)).divergence
