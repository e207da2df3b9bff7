"""Tests of the journal that the simulated nodes share."""
import dataclasses
import threading

from behavior_controller.config import settings
from behavior_controller.robot.requests import Say

from behavior_controller.simulation import behaviour, configuration
from behavior_controller.simulation.faults import PlannedFault
from behavior_controller.simulation.journal import Journal, JournalEntry
from behavior_controller.simulation.simulated_node import SimulatedNode
from behavior_controller.simulation.visitor import ENGAGES
from behavior_controller.simulation.world import world


def line(number, node="textToSpeech"):
    return JournalEntry(float(number), node, "/" + node, number,
                        {"message": "say {}\nä".format(number)}, None, None)


def test_what_one_process_writes_another_reads_once_and_in_order(tmp_path):
    writer, reader = Journal(str(tmp_path / "new")), Journal(str(tmp_path / "new"))
    assert reader.news() == []
    writer.write(line(1))
    writer.write(line(2))
    assert reader.news() == [line(1), line(2)]
    writer.write(line(3))
    assert reader.news() == [line(3)]


def test_what_was_there_before_can_be_skipped(tmp_path):
    Journal(str(tmp_path)).write(line(1))
    reader = Journal(str(tmp_path), skips=True)
    reader_of_all = Journal(str(tmp_path))
    reader.write(line(2))
    assert reader.news() == [line(2)]
    assert reader_of_all.news() == [line(1), line(2)]


def test_nothing_is_skipped_where_nothing_is(tmp_path):
    journal = Journal(str(tmp_path), skips=True)
    journal.write(line(1))
    assert journal.news() == [line(1)]


def test_a_message_gets_a_line_if_it_has_changed_or_a_tenth_of_a_second_has_passed():
    heard, told = {}, []
    node = SimulatedNode("speechEvent", configuration.defaults(),
                         world(ENGAGES, settings.defaults()), lambda: heard["at"], told.append)
    node.world.visitor.is_here = True
    for text, at in (("a", 0.0), ("a", 0.05), ("a", 0.1), ("b", 0.11), ("a", 0.12), ("a", 0.2)):
        heard.update(at=at)
        node.world.visitor.utterance = lambda: text
        assert node.message("/speechEvent/text") == {"data": text}
    assert [(entry.time, entry.content["data"]) for entry in told] == [
        (0.0, "a"), (0.1, "a"), (0.11, "b"), (0.12, "a")]


def test_a_node_that_was_started_again_counts_on_from_its_last_call():
    planned = tuple(PlannedFault("textToSpeech", call, kind)
                    for call, kind in ((1, "crash"), (3, "unanswered"), (4, "exception")))
    test = dataclasses.replace(configuration.defaults(failureRate=0.0), planned_faults=planned)
    told, of_mission = [], settings.defaults()
    node = SimulatedNode("textToSpeech", test, world(ENGAGES, of_mission), lambda: 0.0, told.append)
    for earlier in (line(1), line(9, "robotNavigation"), line(2), line(0), line(1)):
        node.catch_up(earlier)
    for _ in range(2):
        node.reply(of_mission.interface.service(Say), "/say", {"message": "x"},
                   ["success"], behaviour.response)
    assert [(entry.call, entry.fault) for entry in told] == [(3, "unanswered"), (4, "exception")]


def test_half_a_line_is_left_for_later(tmp_path):
    journal = Journal(str(tmp_path))
    journal.write(line(1))
    with open(journal.path, "rb") as file:
        whole = file.read()
    with open(journal.path, "ab") as file:
        file.write(whole[:20])
    assert journal.news() == [line(1)]
    with open(journal.path, "ab") as file:
        file.write(whole[20:])
    assert journal.news() == [line(1)]


def test_lines_of_many_writers_do_not_mix(tmp_path):
    def write(node):
        journal = Journal(str(tmp_path))
        for number in range(100):
            journal.write(line(number, node))

    writers = [threading.Thread(target=write, args=("node{}".format(i),)) for i in range(8)]
    for writer in writers:
        writer.start()
    for writer in writers:
        writer.join(30)
    found = Journal(str(tmp_path)).news()
    for i in range(8):
        assert [each for each in found if each.node == "node{}".format(i)] == [
            line(number, "node{}".format(i)) for number in range(100)]


def test_done_means_neither_fault_nor_objection():
    assert line(1).done
    assert not line(1)._replace(fault="refused").done
    assert not line(1)._replace(objection="no such mode").done
