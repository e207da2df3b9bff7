"""The values at the edges of what is allowed: the last one that is taken, and the first one that is
not."""
import os

import pytest

from behavior_controller import cli, folders, leaves
from behavior_controller.config import recovery_policy, settings
from behavior_controller.bt.script import parser
from behavior_controller.errors import ConfigurationError, MissionError
from behavior_controller.run.events import Events, HealthChanged
from behavior_controller.run.health import Health
from behavior_controller.run.record.reader import find_record, read_record
from mission_rig import one_leaf

GOOD = "scenarioSpecification lab_tour\nverboseMode false\nasrEnabled true\n"
DEADLINES = ["animateBehavior", "gestureExecution", "knowledgeBase", "overtAttention",
             "robotNavigation", "tabletEvent", "textToSpeech"]
RANGES = [  # the first two are taken, the others are not; as the reference says
    ("missionRuns", "0", "1000000000", "-1", "1000000001"),
    ("startupTimeout", "0", "86400", "-0.001", "86400.001"),
    ("topicMaxAge", "0.001", "86400", "0", "86400.001"),
    ("conditionWait", "0", "86400", "-0.001", "86400.001"),
    ("mutualGazeValue", "1", "2", "0", "3"),
    ("welcomeGestureId", "0", "255", "-1", "256"),
    ("goodbyeGestureId", "0", "255", "-1", "256"),
    ("deicticGestureId", "0", "255", "-1", "256"),
    ("gestureDuration", "1", "600000", "0", "600001"),
    ("groot2Port", "0", "65534", "-1", "65535"),
    ("monitorPort", "0", "65535", "-1", "65536"),
] + [(name + "Deadline", "0.001", "86400", "0", "86400.001") for name in DEADLINES]


@pytest.mark.parametrize("key, lowest, highest, below, above", RANGES,
                         ids=[row[0] for row in RANGES])
def test_the_range_of_a_key(tmp_path, key, lowest, highest, below, above):
    path = tmp_path / "test.ini"

    def read(value):
        path.write_text("{}{} {}\n".format(GOOD, key, value))
        return settings.load(str(path)).values[key]

    assert [read(lowest), read(highest)] == [float(lowest), float(highest)]
    for value in (below, above):
        with pytest.raises(ConfigurationError, match="test.ini:4:"):
            read(value)


DEFAULTS = {"language": "English", "missionRuns": 0, "startupTimeout": 0, "topicMaxAge": 2,
            "conditionWait": 0, "mutualGazeValue": 1, "welcomeGestureId": 1, "goodbyeGestureId": 3,
            "deicticGestureId": 1, "gestureDuration": 3000, "groot2Port": 1667, "monitorPort": 8080,
            "animateBehaviorDeadline": 5, "gestureExecutionDeadline": 15,
            "knowledgeBaseDeadline": 5, "overtAttentionDeadline": 5, "robotNavigationDeadline": 180,
            "tabletEventDeadline": 60, "textToSpeechDeadline": 60}


def test_what_a_key_is_if_the_file_does_not_say_it(tmp_path):
    (tmp_path / "test.ini").write_text(GOOD)
    found = settings.load(str(tmp_path / "test.ini")).values
    assert {key: found[key] for key in DEFAULTS} == DEFAULTS


def test_a_policy_of_mistakes_is_told_as_far_as_a_person_reads_it(tmp_path):
    path = tmp_path / "policy.ini"
    for mistakes, told, last in ((100, 101, "budget"), (101, 101, " 100 "), (500, 101, " 100 ")):
        path.write_text("one two\n" * mistakes)
        with pytest.raises(ConfigurationError) as caught:
            recovery_policy.load(str(path), leaves.mission_specs())
        assert len(caught.value.faults) == told and last in str(caught.value.faults[-1])
    assert "policy.ini:101:1: " in str(caught.value.faults[-1])


@pytest.mark.parametrize("line, is_taken", [
    ("budget 99 3600", True), ("budget 100 3600", False), ("budget 1 3600.001", False),
    ("budget 0 0", True), ("* * 99 0 giveUp", True), ("* * 100 0 giveUp", False),
    ("* * 0 3600 skip", True), ("* * 0 3600.001 skip", False)])
def test_the_numbers_of_a_policy(tmp_path, line, is_taken):
    path = tmp_path / "policy.ini"
    path.write_text(line + ("\n" if line.startswith("budget") else "\nbudget 5 60\n"))
    if is_taken:
        recovery_policy.load(str(path), leaves.mission_specs())
    else:
        with pytest.raises(ConfigurationError, match="policy.ini:1:1: "):
            recovery_policy.load(str(path), leaves.mission_specs())


def test_a_service_fails_after_three_failures_without_a_success_between():
    health, seen, events = Health(), [], Events()
    events.subscribe(seen.append)
    for has_failed in (True, True, False, True, True):
        health.ended("/say", 1.0, 60.0, has_failed)
    health.publish(events)
    assert seen == []
    health.ended("/say", 1.0, 60.0, True)
    health.publish(events)
    assert [(change.name, change.is_well) for change in seen
            if isinstance(change, HealthChanged)] == [("/say", False)]


def test_a_service_is_slow_after_half_its_deadline():
    health, seen, events = Health(), [], Events()
    events.subscribe(seen.append)
    health.slow("/say", 60.0)
    health.ended("/say", 30.0, 60.0, False)
    health.publish(events)
    assert [change.is_well for change in seen] == [False]
    health.ended("/say", 29.9, 60.0, False)
    health.publish(events)
    assert [change.is_well for change in seen] == [False, True]
    assert "30 s" in seen[0].status


@pytest.mark.parametrize("name", ["lab_tour", "a path", "a name with a folder"])
def test_a_mission_to_draw_is_named_or_is_a_file(tmp_path, monkeypatch, name):
    with open(folders.mission("lab_tour"), encoding="utf-8") as file:
        (tmp_path / "m.xml").write_text(file.read(), encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    mission = {"lab_tour": name, "a path": "m.xml",
               "a name with a folder": os.path.join(".", "m.xml")}[name]
    assert cli.create_tree(mission).name == ("lab_tour" if name == "lab_tour" else "m")


def test_a_record_that_cannot_be_read_is_named_as_a_whole(tmp_path, monkeypatch):
    missing = str(tmp_path / "mission.jsonl")
    with pytest.raises(MissionError) as caught:
        read_record(missing)
    assert str(caught.value).startswith(missing + ": the record cannot be read: ")
    monkeypatch.setattr(folders, "records", lambda: str(tmp_path))
    monkeypatch.chdir(tmp_path)
    with pytest.raises(MissionError, match=r"mission.jsonl: there is no record yet"):
        find_record("latest")
    assert find_record(str(tmp_path)) == missing


@pytest.mark.parametrize("choice, read", [("1 < 2 ? a : b", {"a", "b"}), ("1 < 2 ? 3 : b", {"b"}),
                                          ("1 < 2 ? 3 : c < 4 ? 5 : b", {"b", "c"})])
def test_an_entry_that_a_script_may_choose_counts_as_read(choice, read):
    assert set(parser.compile_script("x := ({})".format(choice)).facts.read) == read


def test_an_exhibit_without_a_gesture_is_not_pointed_at():
    rig = one_leaf("<Sequence><LookUpHome/><PerformDeicticGesture/></Sequence>")
    rig.tick()
    assert [type(request).__name__ for request in rig.requests] == ["QueryKnowledge"]
