"""The judge of missions with nodes of another package: it takes their results and entries from the
record, and judges what comes of them."""
import dataclasses
from types import ModuleType
from unittest import mock

import pytest
from msgspec.structs import replace

from behavior_controller import extensions, leaves
from behavior_controller.bt.loader.document import parse
from behavior_controller.bt.engine.registry import Direction, Port
from behavior_controller.bt.values.status import SKIPPED
from behavior_controller.config import phrases, settings
from behavior_controller.run.events import (
    Asked, EntriesWritten, HealthChanged, LeafFinished, Tick)
from behavior_controller.leaves.base import InstantAction, WorkingLeaf, leaf_spec
from behavior_controller.leaves.data import GESTURE_TARGET
from behavior_controller.robot.declarations import Publication
from behavior_controller.robot.requests import PerformGesture, Point, Say
from behavior_controller.simulation.rehearsal.play import LoadedMission

from unit_tests.judge.verdict import Verdict
from unit_tests.judge.wire import SENT

from plays import changed, facts


class CountVisits(InstantAction):
    """``<CountVisits/>``: counts to the parity of the visits, and says it at every second one."""

    PORTS = (Port("parity", direction=Direction.OUT),)
    visits = 0

    def act(self):
        """Write the parity, or remove it."""
        CountVisits.visits += 1
        if CountVisits.visits % 2:
            self.set_output("parity", "odd")
        else:
            self.clear_output("parity")


class ChooseWay(InstantAction):
    """``<ChooseWay/>``: points to a place, and names it."""

    PORTS = (GESTURE_TARGET.written("target"),
             Port("place", direction=Direction.OUT, default="{@place}"))

    def act(self):
        """Choose the door."""
        self.set_output("target", Point(1.0, 2.5, 0.0))
        self.set_output("place", "the door")


class Ponder(WorkingLeaf):
    """``<Ponder/>``: takes two seconds."""

    def work(self):
        """Wait."""
        yield from self.pause(2.0)
        return self.succeeded()


class Pass(WorkingLeaf):
    """``<Pass/>``: is skipped."""

    def work(self):
        """Skip it, without a wait."""
        yield from ()
        return SKIPPED


class SayTwice(WorkingLeaf):
    """``<SayTwice/>``: makes two requests."""

    asks = Say

    def try_once(self):
        """Say two texts."""
        yield from self.ask(Say("One."))
        yield from self.ask(Say("Two."))


INNER = '<SubTree ID="Inner"{}/>'
MISSION = """<root BTCPP_format="4" main_tree_to_execute="M"><BehaviorTree ID="M">
<Sequence><START_OF_TREE/>{}<Fallback><WelcomeSpeech/><HandleFallBack/></Fallback></Sequence>
</BehaviorTree><BehaviorTree ID="Inner"><Sequence><CountVisits parity="{}"/></Sequence>
</BehaviorTree></root>"""


@pytest.fixture(autouse=True)
def package(tmp_path):
    module = ModuleType("counting")
    module.SPECS = (leaf_spec("CountVisits", CountVisits, "Counts the visits."),
                    leaf_spec("Ponder", Ponder, "Takes two seconds."),
                    leaf_spec("SayTwice", SayTwice, "Says two texts."),
                    leaf_spec("Pass", Pass, "Is skipped."),
                    leaf_spec("ChooseWay", ChooseWay, "Chooses a way."))
    CountVisits.visits = 0
    module.SPEECHES = (phrases.Speech("CountingSpeech", False, "Counts."),
                       phrases.Speech("CountingQuestion", True, "Asks for the count."),
                       phrases.Speech("WaySpeech", False, "Tells the way.", variables=("place",)))
    (tmp_path / "data").mkdir()
    (tmp_path / "data" / "phrases_English.ini").write_text(
        "CountingSpeech One, two.\nCountingQuestion Shall I count?\nWaySpeech There is {place}.\n")
    extension = extensions.Extension("counting", str(tmp_path), module)
    with mock.patch.object(extensions, "exported", lambda kind: [extension]
                           if kind in ("leaves", "phrases") else []):
        leaves.specs.cache_clear()
        yield
    leaves.specs.cache_clear()


PONDERING = """<root BTCPP_format="4" main_tree_to_execute="M"><BehaviorTree ID="M">
<Sequence><START_OF_TREE/>{}</Sequence></BehaviorTree></root>"""


def of_mission(inner, entry):
    text = MISSION.format(inner, entry)
    return facts(on=LoadedMission(settings.defaults(), [parse(text)]), mission_runs=3)


@pytest.mark.slow
@pytest.mark.parametrize("inner, entry, name", [
    (INNER.format(""), "{parity}", "/parity"), (INNER.format(""), "{@parity}", "parity"),
    (INNER.format(' parity="{kept}"'), "{parity}", "kept"),
    (INNER.format(' _autoremap="true"'), "{parity}", "parity")])
def test_its_entries_are_those_of_the_record(inner, entry, name):
    of_test = of_mission(inner, entry)
    written = [item for line in of_test.run.lines if isinstance(line.event, EntriesWritten)
               for item in line.event.entries if item[0].endswith("parity") or item[0] == "kept"]
    assert [text for _, text in written] == ["odd", None, "odd"]
    assert all(item[0].endswith(name) for item in written)
    assert Verdict(of_test).objections == ()


def test_what_comes_of_its_result_is_judged():
    of_test = of_mission(INNER.format(""), "{parity}")
    uid = 1 + [node.type for node in of_test.run.state.nodes].index("CountVisits")

    def failed(line):
        if isinstance(line.event, Tick):
            changes = [(number, "F" if number == uid and letter == "S" else letter)
                       for number, letter in line.event.changes]
            return [replace(line, event=replace(line.event, changes=changes))]
        return [line]
    assert not Verdict(changed(of_test, failed)).passed


def test_an_end_of_it_on_record_that_its_status_is_not_is_objected_to():
    def failed(line):
        is_its = isinstance(line.event, LeafFinished) and line.event.node == "CountVisits"
        event = replace(line.event, status="FAILURE") if is_its else line.event
        return [replace(line, event=event)]
    text, = Verdict(changed(of_mission(INNER.format(""), "{parity}"), failed)).objections
    assert "CountVisits ended with SUCCESS; on record is FAILURE although it did not fail" in text


@pytest.mark.parametrize("steps, seconds, outcome", [
    ("<Ponder/>", 2.0, "SUCCESS"), ('<Timeout msec="500"><Ponder/></Timeout>', 0.5, "FAILURE"),
    ('<Parallel success_count="2"><Ponder/><WelcomeSpeech/></Parallel>', 2.0, "SUCCESS"),
    ('<Parallel success_count="1"><Ponder/><Sleep msec="900"/></Parallel>', 0.9, "SUCCESS"),
    ('<Repeat num_cycles="2"><Ponder/></Repeat>', 4.0, "SUCCESS"),
    ("<Sequence><Pass/><Ponder/></Sequence>", 2.0, "SUCCESS")])
def test_one_that_takes_its_time_runs_as_long_as_on_record(steps, seconds, outcome):
    of_test = facts(on=LoadedMission(settings.defaults(), [parse(PONDERING.format(steps))]))
    visit, = of_test.run.visits
    assert (visit.outcome, visit.seconds) == (outcome, pytest.approx(seconds, abs=0.1))
    assert Verdict(of_test).objections == ()


def test_what_its_phrases_say_is_judged_and_a_question_of_it_is_answered():
    steps = "<CountingSpeech/><CountingQuestion/><Sleep msec='2000'/><IsYesNoUttered/>"
    of_test = facts(on=LoadedMission(settings.defaults(), [parse(PONDERING.format(steps))]))
    visit, = of_test.run.visits
    assert visit.outcome == "SUCCESS" and Verdict(of_test).objections == ()

    def other(line):
        is_it = isinstance(line.event, Asked) and line.event.request == Say("One, two.")
        event = replace(line.event, request=Say("One, three.")) if is_it else line.event
        return [replace(line, event=event)]
    assert any("One, three." in text for text in Verdict(changed(of_test, other)).objections)


def test_one_that_makes_several_requests_is_judged():
    of_test = facts(on=LoadedMission(settings.defaults(), [parse(PONDERING.format("<SayTwice/>"))]))
    assert Verdict(of_test).objections == ()

    def thrice(line):
        is_second = isinstance(line.event, Asked) and line.event.request == Say("Two.")
        return [line, replace(line, event=replace(line.event, call=99))] if is_second else [line]
    assert not Verdict(changed(of_test, thrice)).passed


WAY = "<ChooseWay/><WaySpeech/><PerformDeicticGesture/>"


@pytest.mark.parametrize("wrong", [
    None, Say("There is a wall."), PerformGesture("deictic", 1, 3000, Point(1.0, 2.0, 0.0))])
def test_what_comes_of_its_entries_is_judged(wrong):
    of_test = facts(on=LoadedMission(settings.defaults(), [parse(PONDERING.format(WAY))]))
    asked = [line.event.request for line in of_test.run.lines if isinstance(line.event, Asked)]
    assert asked[:2] == [Say("There is the door."),
                         PerformGesture("deictic", 1, 3000, Point(1.0, 2.5, 0.0))]

    def other(line):
        is_it = isinstance(line.event, Asked) and type(line.event.request) is type(wrong)
        return [replace(line, event=replace(line.event, request=wrong)) if is_it else line]
    assert Verdict(changed(of_test, other)).passed is (wrong is None)


CRASH = ("textToSpeech:1:crash",)


@pytest.mark.parametrize("fault", [(), CRASH])
def test_what_it_asks_of_a_node_that_no_test_simulates_is_judged_by_the_record(fault):
    of_test = facts(fault, visitor_behaviour="declines")
    without = of_test._replace(
        journal=[line for line in of_test.journal if line.node != "textToSpeech"])
    assert any("never got the request" in text for text in Verdict(without).objections)
    with mock.patch.dict(SENT):
        del SENT[Say]
        verdict = Verdict(without)
    assert verdict.objections == () and "only witness: textToSpeech" in str(verdict)


def test_a_message_without_a_subscriber_need_not_be_noticed_by_the_monitor():
    unnoticed = changed(facts(CRASH), lambda line: [] if isinstance(line.event, HealthChanged)
                        else [line])
    assert any("that was not noticed" in text for text in Verdict(unnoticed).objections)
    interface = unnoticed.world.settings.interface
    say = interface.service(Say)
    fields = {field.name: getattr(say, field.name) for field in dataclasses.fields(say)}
    services = tuple(Publication(**fields) if service is say else service
                     for service in interface.services)
    by_request = {service.request: service for service in services}
    with mock.patch.object(interface, "services", services), \
            mock.patch.object(interface, "_by_request", by_request):
        assert not any("not noticed" in text for text in Verdict(unnoticed).objections)
